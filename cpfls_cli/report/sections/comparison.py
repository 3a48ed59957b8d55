"""Two models or more beside each other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from cpfls_cli.report.content import Block, Cell, Heading, Section, Table, Text
from cpfls_cli.report.differences import differences
from cpfls_cli.report.evidence import SHORT_VERDICTS, has
from cpfls_cli.report.figures.comparison import compared_curves_figure, compared_errors_figure
from cpfls_cli.report.gap_words import joined
from cpfls_cli.report.judged import AXES, MODEL, RIGID_BODY, judged
from cpfls_cli.report.judged_on import JudgedOn, judged_on, learned_only
from cpfls_cli.report.numbers import UNKNOWN, count, number, percent, r_squared
from cpfls_cli.report.source import Source, Sources

_HEADER = (
    "Model",
    "Verdict",
    "Parameters",
    "Condition number",
    *(f"RMSE (NRMSE) {axis}, N\N{NO-BREAK SPACE}m" for axis in AXES),
    "R², worst axis",
    "VAF, worst axis",
    "Largest error, N\N{NO-BREAK SPACE}m",
    "Relative error",
)
_WORDS = 4
_TIE = 1.0 + 1e-9
_MOST_KEYS = 30


@dataclass(frozen=True)
class _Line:
    """A row of a table: words, and what is compared, as numbers and as they are shown."""

    words: tuple[str, ...]
    errors: tuple[float, ...]
    shown: tuple[str, ...]


def comparison_section(sources: Sources) -> Section | None:
    """Compare the models with each other.

    Parameters
    ----------
    sources : Sources

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
    alone = [part for part in parts if len(part.models) == 1]
    if not common:
        yield Text("These models were judged on different flights: their errors cannot be ranked.", "warning")
    for index, part in enumerate(common, start=1):
        yield _table(f"comparison-{index}", part, _caption(part), ranked=True)
    if common:
        yield compared_errors_figure("comparison-errors", common, models)
    if alone:
        told = joined(f"{part.models[0].label} on {part.title} ({_flights(part)})" for part in alone)
        yield Text(f"Judged by itself, so not ranked: {told}.", "note")
    if alone and not common:
        for index, part in enumerate(alone, start=1):
            yield _table(f"comparison-{index}", part, f"{part.models[0].label} on {part.title}.", ranked=False)


def _caption(part: JudgedOn) -> str:
    learned = " They learned from it: these errors are no prediction." if learned_only(part) else ""
    return (
        f"All on {part.title} ({_flights(part)}), the same data for all.{learned} Each rigid body was fitted to what "
        "its model learned from. NRMSE: over the standard deviation of the torque. ◂ marks the best of a column, of "
        "models and rigid bodies alike."
    )


def _flights(part: JudgedOn) -> str:
    return "sha256 " + joined(sha256[:12] for sha256 in part.hashes)


def _table(name: str, part: JudgedOn, caption: str, ranked: bool) -> Table:
    pairs = list(zip(part.models, part.names, strict=True))
    lines = [_of_model(model, own) for model, own in pairs] + _rigid_bodies(pairs)
    best = np.fmin.reduce([line.errors for line in lines]) if ranked else np.full(len(_HEADER) - _WORDS, -np.inf)
    rows: list[list[str | Cell]] = [
        [*line.words, *(_cell(*cell) for cell in zip(line.shown, line.errors, best, strict=True))] for line in lines
    ]
    return Table(name, caption, _HEADER, rows, frozenset({0, 1}))


def _cell(text: str, error: float, best: float) -> Cell:
    return Cell(f"{text} ◂", "good") if error <= best * _TIE else Cell(text)


def _of_model(model: Source, part: str) -> _Line:
    artifact = model.artifact
    size = (count(artifact.number("solve/parameters")), number(artifact.number("solve/condition_number"), 4))
    label = artifact.text("verdict/label") if has(model, "verdict") else UNKNOWN
    verdict = SHORT_VERDICTS.get(label, label)
    return _Line((model.label, verdict, *size), *_scores(model, MODEL, part))


def _rigid_bodies(pairs: Sequence[tuple[Source, str]]) -> list[_Line]:
    """Show each rigid body once: models that learned from the same samples have the same."""
    owners: dict[tuple[str, ...], list[str]] = {}
    errors: dict[tuple[str, ...], tuple[float, ...]] = {}
    for model, part in pairs:
        own, shown = _scores(model, RIGID_BODY, part)
        owners.setdefault(shown, []).append(model.label)
        errors[shown] = own
    words = {shown: (f"rigid body of {joined(labels)}", "", "6", UNKNOWN) for shown, labels in owners.items()}
    return [_Line(words[shown], errors[shown], shown) for shown in owners]


def _scores(model: Source, kind: str, part: str) -> tuple[tuple[float, ...], tuple[str, ...]]:
    """Read what is compared; a share of variance as what it lacks, so that the least is the best of every column."""
    scores = judged(model)
    error = np.sqrt(scores.of("mse", kind, part))
    share = scores.nrmse(kind, part)
    r2, vaf = _worst(scores.of("r2", kind, part)), _worst(_vaf(model, kind, part))
    largest, relative = float(np.max(scores.of("max_error", kind, part))), scores.worst(kind, part)[0]
    shown = [f"{number(float(e), 3)} ({percent(float(s))})" for e, s in zip(error, share, strict=True)]
    return (
        (*map(float, error), 1.0 - r2, 1.0 - vaf, largest, relative),
        (*shown, r_squared(r2), r_squared(vaf), number(largest, 3), percent(relative)),
    )


def _worst(shares: np.ndarray) -> float:
    return float(np.nanmin(shares)) if np.isfinite(shares).any() else float("nan")


def _vaf(model: Source, kind: str, part: str) -> np.ndarray:
    if "judged/vaf" not in model.artifact.data:
        return np.full(len(AXES), np.nan)
    scores = judged(model)
    return np.asarray(model.artifact.array("judged/vaf")[scores.models.index(kind), scores.parts.index(part)])


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
