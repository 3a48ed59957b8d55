"""What models that were judged on the same data reached there, as tables."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from cpfls_cli.pages.evidence import SHORT_VERDICTS, has
from cpfls_cli.pages.gap_words import joined
from cpfls_cli.pages.judged import AXES, MODEL, RIGID_BODY, judged
from cpfls_cli.pages.judged_on import JudgedOn, learned_only
from cpfls_cli.pages.source import Source
from cpfls_cli.report.content import Cell, Table
from cpfls_cli.report.numbers import ROUNDING, UNKNOWN, count, number, percent, r_squared

_OVERALL = (
    "Model",
    "Verdict",
    "Parameters",
    "Condition number",
    "Largest error, N\N{NO-BREAK SPACE}m",
    "Relative error, worst axis",
    "R², worst axis",
)
_BY_AXIS = ("Model", *(f"{axis}, N\N{NO-BREAK SPACE}m" for axis in AXES))
_SENTENCES = frozenset({0, 1})
_TIE = 1.0 + 1e-6


@dataclass(frozen=True)
class _Line:
    """A row of a table: words, and what is compared, as numbers and as they are shown."""

    words: tuple[str, ...]
    errors: tuple[float, ...]
    shown: tuple[str, ...]


def compared_tables(index: int, part: JudgedOn) -> Iterator[Table]:
    """Show models and their rigid bodies on the same data: all axes together, then by axis.

    Parameters
    ----------
    index : int
        Number of the part, from 1.
    part : JudgedOn
        By two models or more.
    """
    yield _overall(f"comparison-{index}", part)
    yield _by_axis(f"comparison-axes-{index}", part)


def hashes_words(flights: Sequence[str]) -> str:
    """Name flights by the first digits of their hashes."""
    return "sha256 " + joined(sha256[:12] for sha256 in flights)


def _overall(name: str, part: JudgedOn) -> Table:
    learned = " They learned from it: these errors are no prediction." if learned_only(part) else ""
    caption = (
        f"All on {part.title} ({hashes_words(part.hashes)}), the same data for all.{learned} Each rigid body was "
        "fitted to what its model learned from. ◂ marks the best of a column, of models and rigid bodies alike."
    )
    lines = [_Line(_words(model), *_worst(model, MODEL, own)) for model, own in _pairs(part)]
    lines += [_Line((label, "", "6", UNKNOWN), *_worst(model, RIGID_BODY, own)) for label, model, own in _bodies(part)]
    return Table(name, caption, _OVERALL, _marked(lines), _SENTENCES, _SENTENCES)


def _by_axis(name: str, part: JudgedOn) -> Table:
    caption = (
        f"The same by axis: root mean square error of the torque on {part.title}, and in brackets over the standard "
        "deviation of the torque. ◂ as above."
    )
    lines = [_Line((model.label,), *_axes(model, MODEL, own)) for model, own in _pairs(part)]
    lines += [_Line((label,), *_axes(model, RIGID_BODY, own)) for label, model, own in _bodies(part)]
    return Table(name, caption, _BY_AXIS, _marked(lines), frozenset({0}), frozenset({0}))


def _pairs(part: JudgedOn) -> Iterator[tuple[Source, str]]:
    return zip(part.models, part.names, strict=True)


def _marked(lines: Sequence[_Line]) -> list[list[str | Cell]]:
    # Below rounding nobody is better than another.
    best = np.fmax(np.fmin.reduce([line.errors for line in lines]) * _TIE, ROUNDING)
    return [[*line.words, *map(_cell, line.shown, line.errors, best)] for line in lines]


def _cell(text: str, error: float, least: float) -> Cell:
    return Cell(f"{text} ◂", "good") if error <= least else Cell(text)


def _words(model: Source) -> tuple[str, ...]:
    artifact = model.artifact
    label = artifact.text("verdict/label") if has(model, "verdict") else UNKNOWN
    size = (count(artifact.number("solve/parameters")), number(artifact.number("solve/condition_number"), 4))
    return (model.label, SHORT_VERDICTS.get(label, label), *size)


def _bodies(part: JudgedOn) -> list[tuple[str, Source, str]]:
    """Name each rigid body once: models that learned from the same samples have the same."""
    owners: dict[tuple[str, ...], list[tuple[Source, str]]] = {}
    for model, own in _pairs(part):
        shown = (*_worst(model, RIGID_BODY, own)[1], *_axes(model, RIGID_BODY, own)[1])
        owners.setdefault(shown, []).append((model, own))
    if len(owners) == 1:
        return [("rigid body", *next(_pairs(part)))]
    return [(f"rigid body of {joined(model.label for model, _ in who)}", *who[0]) for who in owners.values()]


def _worst(model: Source, kind: str, part: str) -> tuple[tuple[float, ...], tuple[str, ...]]:
    """Read what is compared over all axes; R² as what it lacks, so that the least is the best of every column."""
    scores = judged(model)
    shares = scores.of("r2", kind, part)
    r2 = float(np.nanmin(shares)) if np.isfinite(shares).any() else float("nan")
    largest, relative = float(np.max(scores.of("max_error", kind, part))), scores.worst(kind, part)[0]
    return (largest, relative, 1.0 - r2), (number(largest, 3), percent(relative), r_squared(r2))


def _axes(model: Source, kind: str, part: str) -> tuple[tuple[float, ...], tuple[str, ...]]:
    scores = judged(model)
    error, share = np.sqrt(scores.of("mse", kind, part)), scores.nrmse(kind, part)
    shown = (f"{number(float(e), 3)} ({percent(float(s))})" for e, s in zip(error, share, strict=True))
    return tuple(map(float, error)), tuple(shown)
