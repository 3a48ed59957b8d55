"""Which stage made a file."""

from __future__ import annotations

import re
from collections.abc import Mapping
from keyword import iskeyword
from pathlib import Path
from typing import Any


def stage_module(attributes: Mapping[str, Any]) -> str:
    """Name the module of the stage that made a file, by its root attributes; empty where it holds no result.

    One with a line before its name is no command: other stages keep what it makes.
    """
    module = module_of(str(attributes.get("stage", "")))
    names = (module, f"_{module}") if re.fullmatch(r"[a-z]\w*", module) else ()
    folder = Path(__file__).parents[1] / "stages"
    return next((name for name in names if (folder / f"{name}.py").is_file()), "")


def module_of(stage: str) -> str:
    """Name the module of a stage: as the command, with a trailing underscore where Python has that word."""
    module = stage.replace("-", "_")
    return f"{module}_" if iskeyword(module) else module
