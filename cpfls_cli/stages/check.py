"""Check an artifact against its format; exit code 1 where it does not keep to it."""

from __future__ import annotations

from typing import Any

from cpfls_cli.arguments import FileArgument
from cpfls_cli.artifacts.model import AnyModel
from cpfls_cli.pages.trust import stopped_words
from cpfls_cli.stage import Run, kind_of, stage
from cpfls_cli.store import findings_in, read


@stage(dict, output=False)
def check(run: Run, file: FileArgument) -> dict[str, Any]:
    """Find what is wrong in a file."""
    kind = kind_of(file)
    findings = findings_in(file, kind)
    is_model = issubclass(kind, AnyModel) and not findings
    stopped = stopped_words(read(file, kind)[0]) if is_model else ""
    held = {"file": str(file), "format": kind.FORMAT, "good": not findings, "findings": findings}
    run.also = held | ({"stopped": stopped} if stopped else {})
    run.exit_code = int(bool(findings))
    run.next += [] if findings else [("cpfls", "info", file)]
    return held | {"stopped": stopped}
