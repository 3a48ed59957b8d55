"""Check an artifact against its format; exit code 1 where it does not keep to it."""

from __future__ import annotations

from cpfls_cli.arguments import FileArgument
from cpfls_cli.artifacts.model import AnyModel
from cpfls_cli.pages.trust import stopped_words
from cpfls_cli.result import about, result
from cpfls_cli.stage import Run, kind_of, stage
from cpfls_cli.store import findings_in, read


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
    kind = kind_of(file)
    findings = findings_in(file, kind)
    is_model = issubclass(kind, AnyModel) and not findings
    stopped = stopped_words(read(file, kind)[0]) if is_model else ""
    run.also |= {"stopped": stopped} if stopped else {}
    run.exit_code = int(bool(findings))
    run.next += [] if findings else [("cpfls", "info", file)]
    return Checked(file=str(file), format=kind.FORMAT, good=not findings, findings=tuple(findings), stopped=stopped)
