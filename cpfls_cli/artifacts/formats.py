"""The formats of all artifacts, in the order of the pipeline."""

from __future__ import annotations

import re
from collections.abc import Mapping
from importlib import import_module
from keyword import iskeyword
from pathlib import Path
from typing import Any

from cpfls_cli.artifacts.spec import Record

_RECORDS = {
    ("cpfls/checkpoint", ""): "checkpoint.CheckpointRecord",
    ("cpfls/model", "extended"): "extended.ExtendedRecord",
    ("cpfls/vehicle-checkpoint", ""): "checkpoint.VehicleCheckpointRecord",
}
"""Every artifact format by its name and kind, and where its record is: it is loaded when a file of it is met."""


def record_of_format(name: str, kind: str = "") -> type[Record] | None:
    """Look up a format by the values of the root attributes ``format`` and ``kind``, and load its record."""
    place = _RECORDS.get((name, kind))
    if place is None:
        return None
    module, record = place.split(".")
    found: type[Record] = getattr(import_module(f"cpfls_cli.artifacts.{module}"), record)
    return found


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


def records() -> list[type[Record]]:
    """Load the records of all formats."""
    return [record for format_and_kind in _RECORDS if (record := record_of_format(*format_and_kind)) is not None]
