"""Commands that print what a file holds, and whether it keeps to its format: `info` and `check`."""

from __future__ import annotations

from pathlib import Path

from cpfls_cli.flights.models import any_model, is_model
from cpfls_cli.pages.trust import stopped_words
from cpfls_cli.report.content import Folded, Text
from cpfls_cli.report.outcome import Outcome
from cpfls_cli.stage import kind_of, stage_that_made
from cpfls_cli.store import findings_in, stage_of

_FINDINGS_SHOWN = 8


def info(path: Path) -> Outcome:
    """Describe a file: where it comes from and what it holds."""
    return stage_that_made(path).info(path)


def artifact_that_tells(output: Path) -> Path | None:
    """Find the file among what a command wrote whose `info` shows its answer again; None where there is none."""
    paths = [output / "diagnosis.h5", output / "changed.h5", output / "trend.h5"] if output.is_dir() else [output]
    return next((path for path in paths if stage_of(path)), None)


def check(path: Path) -> Outcome:
    """Check a file against its format; the exit code is 1 where it does not keep to it."""
    kind = kind_of(path)
    name, findings = kind.FORMAT, findings_in(path, kind)
    summary = {"file": str(path), "format": name, "good": not findings, "findings": findings}
    stopped = "" if findings or not is_model(path) else stopped_words(any_model(path))
    good = f"keeps to its format ({name}), but its search was {stopped}" if stopped else f"good ({name})"
    summary |= {"stopped": stopped} if stopped else {}
    said = [Text(f"{path}: {finding}") for finding in findings] or [Text(f"{path}: {good}")]
    rest = said[_FINDINGS_SHOWN:]
    more = [Folded(f"{len(rest)} more findings", rest)] if rest else []
    followed = () if findings else (("cpfls", "info", path),)
    return Outcome(summary, (*said[:_FINDINGS_SHOWN], *more), int(bool(findings)), followed)
