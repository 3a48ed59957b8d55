"""Write one self-contained page about artifacts (html, md or json); models that are given together are compared."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from cpfls_cli.artifacts.model import AnyModel
from cpfls_cli.config.study import Study
from cpfls_cli.errors import InputError
from cpfls_cli.files import read_content
from cpfls_cli.pages.comparison import differing
from cpfls_cli.pages.page import WORDS, Page, report_page
from cpfls_cli.pages.trust import model_words
from cpfls_cli.report.content import Form
from cpfls_cli.report.source import Source, Sources, source_of_result, unique_labels
from cpfls_cli.stage import Run, kind_of, stage, stage_that_made
from cpfls_cli.store import Origin, read
from cpfls_cli.version import __version__
from cpfls_cli.words import joined

ArtifactsArgument = Annotated[list[Path], typer.Argument(metavar="ARTIFACT", help="Artifacts to report on.")]
FormOption = Annotated[
    Form | None, typer.Option("--format", help="Form of the report; default: by the suffix of FILE.")
]
_FORMS = {".html": Form.HTML, ".htm": Form.HTML, ".md": Form.MARKDOWN, ".markdown": Form.MARKDOWN, ".json": Form.JSON}


@stage(dict, study=True, words=WORDS)
def report(run: Run, artifacts: ArtifactsArgument, form: FormOption = None) -> dict[str, Any] | None:
    """Write a report about artifacts."""
    form = form or _FORMS.get(run.output.suffix.lower() or ".html")
    if form is None:
        raise InputError(f"{run.output}: its suffix names no form: {joined(list(_FORMS), 'or')}; else give --format")
    inputs = run.take({str(path): path for path in artifacts})
    if len(artifacts) == 1 and not (own := stage_that_made(artifacts[0])).study:
        return _written(run, own.report(artifacts[0], form))
    files = {path: inputs[str(path)].sha256 for path in artifacts}
    first = {sha256: path for path, sha256 in reversed(files.items())}
    kept = [path for path, sha256 in files.items() if first[sha256] == path]
    given = Sources(
        read_sources(kept, [files[path] for path in kept]), vehicle=run.study.vehicle, settings=run.study.report
    )
    again = [f"{path}: given {times} times; shown once" for path, times in Counter(artifacts).items() if times > 1]
    equal = [f"{path}: holds the same as {first[files[path]]}; shown once" for path in files if path not in kept]
    if run.dry_run:
        return None
    page = report_page(given, __version__, form)
    return _written(
        run,
        page.text,
        page,
        verdicts={model.label: model_words(model.record).sentence for model in given.of_kind(AnyModel)},
        differing=differing(given),
        repeated=(*again, *equal),
    )


def _written(run: Run, text: str, page: Page | None = None, **more: Any) -> dict[str, Any] | None:
    run.texts[run.output] = text
    if run.dry_run:
        return None
    run.also = {"output": str(run.output), "bytes": len(text.encode())}
    run.also |= {name: getattr(page, name, ()) for name in ("sections", "figures", "tables", "missing")}
    return {"verdicts": {}, "differing": None, "repeated": (), **run.also, **more}


def read_sources(paths: Sequence[Path], hashes: Sequence[str]) -> list[Source]:
    """Read artifacts of any format for a report."""
    return _sources({path: read(path, kind_of(path)) for path in paths}, hashes)


def _sources(made: Mapping[Path, tuple[Any, Origin]], hashes: Sequence[str]) -> list[Source]:
    """Name results of any format for a report, each by a name of its own."""
    labels = map(_printable, unique_labels(list(made)))
    return [
        source_of_result(*each, path, label, sha256)
        for (path, each), label, sha256 in zip(made.items(), labels, hashes, strict=True)
    ]


def page_about(study: Study, made: Mapping[Path, tuple[Any, Origin]]) -> str:
    """Write the page of the results, by file, that a stage filled a folder with."""
    sources = _sources(made, [read_content(path).sha256 for path in made])
    return report_page(Sources(sources, study.vehicle, study.report), __version__).text


def _printable(name: str) -> str:
    """Replace what a page cannot show: control characters, and bytes that are not text."""
    return "".join(character if character.isprintable() else "\N{REPLACEMENT CHARACTER}" for character in name)
