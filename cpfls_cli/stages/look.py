"""Say what one ordinary log can answer, with nothing else known of the vehicle: one page for each log.

Without -o the answer is printed; with it, FOLDER gets a page and a result for each log.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, ClassVar

import typer

from cpfls_cli.logs.formats import log_contents, suffixes_in_words
from cpfls_cli.result import about, result
from cpfls_cli.stage import Run, stage, unique_names


@result
class Look:
    """What a log can answer."""

    FORMAT: ClassVar = "cpfls/look"

    name: str = about("of the log")
    system: str = about("what wrote the log, and its version; empty where unknown")


@stage(Look, folder=True)
def look(
    run: Run,
    logs: Annotated[list[Path], typer.Argument(metavar="LOG...", help=f"Flight logs: {suffixes_in_words()}.")],
) -> dict[str, Look] | None:
    """Look into logs, each by itself."""
    named = unique_names(logs)
    for name, path in named.items():
        run.take({"log": path}, name)
    if run.dry_run:
        return None
    found = {}
    for done, (name, path) in enumerate(named.items()):
        run.progress(done, len(named), path.name)
        contents = log_contents(path)
        found[name] = Look(name=path.name, system=contents.system)
        for warning in contents.warnings:
            run.caution(f"{path}: {warning}", name)
    if run.output is None:
        run.next.append(("cpfls", "look", *logs, "-o", "look"))
    return found
