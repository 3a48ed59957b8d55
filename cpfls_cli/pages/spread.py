"""What `cpfls spread` says: how many vehicles it drew, how many draws no vehicle has, and what they lie between."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from cpfls_cli.artifacts.parameters import name_of
from cpfls_cli.export.samples import Samples
from cpfls_cli.pages.trust import trust_words
from cpfls_cli.playback.gusts import GUST_AXES, Gusts
from cpfls_cli.report.content import Block, Folded, Table, Text
from cpfls_cli.report.numbers import number
from cpfls_cli.report.outcome import caution_texts
from cpfls_cli.words import joined

_SHOWN = 8
"""Rows of a table that the first screen has room for."""


def spread_answer(samples: Samples, output: Path, size: int, dry_run: bool) -> Iterator[Block]:
    """Say what was drawn and written, what its numbers lie between, and what speaks against them."""
    spread, sheet = samples.spread, samples.sheet
    count, out = len(spread.models), spread.tried - len(spread.models)
    yield Text(f"{output}: {'would be written' if dry_run else 'written'} ({size} bytes)")
    verdict = f"Verdict on the model: {trust_words(sheet.verdict).short}." if sheet.verdict else "It has no verdict."
    yield Text(f"{count} vehicles drawn from {sheet.file} with seed {samples.seed}. {verdict}")
    if out:
        reasons = joined(f"{often} with {why}" for why, often in spread.rejected.items())
        yield Text(f"Rejected {out} of {spread.tried} draws, because no vehicle has such numbers: {reasons}.")
    if samples.moved:
        factors = joined(f"{name_of(name)} {100 * (factor - 1):+.2g} %" for name, factor in samples.moved.items())
        yield Text(f"The estimate is of no body, so they are drawn around the nearest one: {factors}.")
    rows = [
        [
            _name(name),
            each.unit,
            number(each.value),
            number(each.low, 3),
            number(each.high, 3),
            "yes" if each.determined else "no",
        ]
        for name, each in samples.ranges.items()
    ]
    header = ("number", "unit", "estimate", "2.5 %", "97.5 %", "determined")
    yield Table("spread", "95 % of them lie between these.", header, rows[:_SHOWN], frozenset({0, 1, 5}))
    if rows[_SHOWN:]:
        more = Table("spread-more", "The other numbers.", header, rows[_SHOWN:], frozenset({0, 1, 5}))
        yield Folded(f"{len(rows[_SHOWN:])} more numbers", [more])
    if samples.held:
        held = joined(each.replace("_", " ") for each in samples.held)
        yield Text(
            f"Not drawn, because it is a guess and no flight tells it: {held}. Give it a range of your own.",
            "warning",
            always=True,
        )
    calm = _without_gusts(sheet.model.gusts)
    if calm:
        yield Text(
            f"No gusts {joined(calm)}: the flights do not tell their size, so whatever blew there is not in the spread.",
            "warning",
            always=True,
        )
    yield from caution_texts(sheet.cautions)


def _name(name: str) -> str:
    axis = name.removeprefix("gust.")
    return name_of(name) if axis == name else f"gusts, {axis.replace('_', ' ')}"


def _without_gusts(gusts: Gusts | None) -> list[str]:
    """Name the axes on which none are known."""
    sizes = np.zeros(len(GUST_AXES)) if gusts is None else gusts.size
    still = [name for name, size in zip(GUST_AXES, sizes, strict=True) if not size]
    named = (
        ("about", [name for name in GUST_AXES[:3] if name in still]),
        ("along", [name for name in GUST_AXES[3:] if name in still]),
    )
    return [f"{word} {joined(names)}" for word, names in named if names]


def spread_summary(samples: Samples) -> dict[str, Any]:
    """Say the same for machines."""
    return {**samples.facts, "ranges": {name: each._asdict() for name, each in samples.ranges.items()}}
