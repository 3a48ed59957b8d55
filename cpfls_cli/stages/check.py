"""Check an artifact against its format; exit code 1 where it does not keep to it."""

from __future__ import annotations

from pathlib import Path

from cpfls_cli.arguments import FileArgument
from cpfls_cli.artifacts.store import findings_of
from cpfls_cli.flights.models import any_model, is_model
from cpfls_cli.pages.trust import stopped_words
from cpfls_cli.result import about, result
from cpfls_cli.stage import Run, loaded, stage
from cpfls_cli.store import findings_in, stage_of


@result
class Checked:
    """Whether a file keeps to its format."""

    file: str = about("as it was given")
    format: str = about("that it is of")
    good: bool = about("whether it keeps to it")
    findings: tuple[str, ...] = about("everything that its format does not allow", "finding")
    stopped: str = about("why its search ended before its end, and how to go on", default="", brief=False)


@stage(Checked, output=False)
def check(run: Run, file: FileArgument) -> Checked:
    """Find what is wrong in a file."""
    name, findings = _examined(file)
    stopped = "" if findings or not is_model(file) else stopped_words(any_model(file))
    run.also |= {"stopped": stopped} if stopped else {}
    run.exit_code = int(bool(findings))
    run.next += [] if findings else [("cpfls", "info", file)]
    return Checked(file=str(file), format=name, good=not findings, findings=tuple(findings), stopped=stopped)


def _examined(file: Path) -> tuple[str, list[str]]:
    if module := stage_of(file):
        kind = loaded(module).kind
        return kind.FORMAT, findings_in(file, kind)
    spec, found = findings_of(file)
    return spec.name, found
