"""Two models or more beside each other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from cpfls_cli.pages.differences import differences
from cpfls_cli.pages.evidence import has
from cpfls_cli.pages.figures.compared_errors import compared_errors_figure
from cpfls_cli.pages.figures.comparison import compared_curves_figure
from cpfls_cli.pages.gap_words import joined
from cpfls_cli.pages.judged_on import JudgedOn, judged_on
from cpfls_cli.pages.sections.compared_scores import compared_tables, hashes_words
from cpfls_cli.pages.source import Source, Sources
from cpfls_cli.report.content import Block, Heading, Section, Table, Text

_MOST_KEYS = 30


def comparison_section(sources: Sources) -> Section | None:
    """Compare the models with each other.

    Returns
    -------
    Section or None
        None for fewer than two models.
    """
    models = sources.models
    if len(models) < 2:
        return None
    return Section("comparison", "The models beside each other", [*_tables(models), *_curves(models), *_keys(models)])


def _tables(models: Sequence[Source]) -> Iterator[Block]:
    parts = judged_on(models)
    common = [part for part in parts if len(part.models) > 1]
    told = _alone([part for part in parts if len(part.models) == 1])
    if not common:
        yield Text(f"Judged on different flights, so the errors cannot be ranked: {told}.", "warning")
        return
    for index, part in enumerate(common, start=1):
        yield from compared_tables(index, part)
    yield compared_errors_figure("comparison-errors", common, models)
    if told:
        yield Text(f"Judged by itself, so not ranked: {told}.", "note")


def _alone(parts: Sequence[JudgedOn]) -> str:
    """Say which model was judged on what, each model once."""
    own: dict[str, list[JudgedOn]] = {}
    for part in parts:
        own.setdefault(part.models[0].label, []).append(part)
    return "; ".join(
        f"{label} on {joined(part.title for part in its)} ({hashes_words(sum((part.hashes for part in its), ()))})"
        for label, its in own.items()
    )


def _curves(models: Sequence[Source]) -> Iterator[Block]:
    with_curves = [model for model in models if has(model, "curves")]
    names = dict.fromkeys(name for model in with_curves for name in model.artifact.texts("curves/name"))
    for index, name in enumerate(names, start=1):
        own = [model for model in with_curves if name in model.artifact.texts("curves/name")]
        if len(own) > 1:
            yield compared_curves_figure(f"comparison-curves-{index}", own, name)


def _keys(models: Sequence[Source]) -> Iterator[Block]:
    found = differences([model.config for model in models])
    yield Heading("What their configs differ in")
    if not found:
        yield Text("Nothing: the same config made all of them.")
        return
    rows = [[key, *values] for key, values in found[:_MOST_KEYS]]
    more = (
        f" {len(found) - _MOST_KEYS} more keys differ; see the configs under Provenance."
        if len(found) > _MOST_KEYS
        else ""
    )
    words = frozenset(range(len(models) + 1))
    header = ("Key", *(model.label for model in models))
    yield Table("comparison-keys", f"Keys of the configs that differ.{more}", header, rows, words, words - {0})
