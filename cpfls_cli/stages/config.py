"""Print the resolved config; without CONFIG, a commented default."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cpfls_cli.config.check import commented_default
from cpfls_cli.config.study import resolved, resolved_yaml
from cpfls_cli.errors import ConfigError
from cpfls_cli.stage import Run, stage

ConfigArgument = Annotated[Path | None, typer.Argument(metavar="CONFIG", help="Study config (YAML).")]
SectionOption = Annotated[
    list[str] | None, typer.Option("--section", help="Only this section, or section.key; may be repeated.")
]


@stage(dict, output=False, study=True)
def config(run: Run, config: ConfigArgument = None, section: SectionOption = None) -> dict[str, str]:
    """Write a config out."""
    if config is None and section:
        raise ConfigError("--section needs a CONFIG; without one the commented default is printed")
    run.also = resolved(run.study, section or ())
    return {"text": commented_default() if config is None else resolved_yaml(run.study, section or ())}
