"""Command `report`: one self-contained page about artifacts."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from cpfls_cli.artifacts.job import Job, check_outputs, take_inputs
from cpfls_cli.artifacts.output import write_text
from cpfls_cli.pages.comparison import model_verdicts
from cpfls_cli.pages.page import Page, report_page
from cpfls_cli.pages.source import Source, Sources, unique_labels
from cpfls_cli.report.content import Text
from cpfls_cli.report.forms import Form, form_of
from cpfls_cli.report.outcome import Outcome, nothing_written
from cpfls_cli.report.source import source_of_result
from cpfls_cli.stage import Stage, kind_of, loaded
from cpfls_cli.store import read, stage_of
from cpfls_cli.version import __version__


def run(job: Job, artifacts: Sequence[Path], form: Form | None = None) -> Outcome:
    """Write a report about artifacts."""
    if len(artifacts) == 1 and (name := stage_of(artifacts[0])) and not (own := loaded(name)).study:
        return _of_result(job, own, artifacts[0], form or form_of(job.output))
    inputs = take_inputs(job, {str(path): path for path in artifacts})
    check_outputs(job, job.output)
    files = {path: inputs[str(path)].sha256 for path in artifacts}
    distinct = {sha256: path for path, sha256 in reversed(files.items())}
    kept = [path for path, sha256 in files.items() if distinct[sha256] == path]
    sources = read_sources(kept, [files[path] for path in kept])
    if job.dry_run:
        return nothing_written(job)
    given = Sources(sources, job.study.vehicle, job.study.report)
    page = report_page(given, __version__, form or form_of(job.output))
    write_text(job.output, page.text)
    again = [f"{path}: given {times} times; shown once" for path, times in Counter(artifacts).items() if times > 1]
    equal = [f"{path}: holds the same as {distinct[files[path]]}; shown once" for path in files if path not in kept]
    return _outcome(job.output, page, given, [*again, *equal])


def _of_result(job: Job, own: Stage, path: Path, form: Form) -> Outcome:
    """Write the page that a result has by itself."""
    take_inputs(job, {str(path): path})
    check_outputs(job, job.output)
    text = own.report(path, form)
    if job.dry_run:
        return nothing_written(job)
    write_text(job.output, text)
    size = len(text.encode())
    return Outcome({"output": str(job.output), "bytes": size}, (Text(f"{size} bytes"),))


def read_sources(paths: Sequence[Path], hashes: Sequence[str]) -> list[Source]:
    """Read artifacts of any format for a report, each under a name of its own."""
    labels = map(_printable, unique_labels(paths))
    return [
        source_of_result(*read(path, kind_of(path)), path, label, sha256)
        for path, label, sha256 in zip(paths, labels, hashes, strict=True)
    ]


def _printable(name: str) -> str:
    """Replace what a page cannot show: control characters, and bytes that are not text."""
    return "".join(character if character.isprintable() else "\N{REPLACEMENT CHARACTER}" for character in name)


def _outcome(output: Path, page: Page, given: Sources, repeated: Sequence[str]) -> Outcome:
    size = len(page.text.encode())
    summary = {
        "output": str(output),
        "figures": list(page.figures),
        "tables": list(page.tables),
        "sections": list(page.sections),
        "missing": list(page.missing),
        "bytes": size,
    }
    parts = {"section": page.sections, "figure": page.figures, "table": page.tables}
    counts = ", ".join(f"{len(own)} {name}{'' if len(own) == 1 else 's'}" for name, own in parts.items())
    lacks = [Text(f"not given: {', '.join(page.missing)}")] if page.missing else []
    warnings = (Text(sentence, "warning") for sentence in repeated)
    return Outcome(summary, (Text(f"{counts}, {size} bytes"), *lacks, *model_verdicts(given), *warnings))
