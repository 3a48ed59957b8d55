"""What `cpfls export` and `spread` say: files, and what speaks against a model."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cpfls_cli.artifacts.identified import IdentifiedModel
from cpfls_cli.artifacts.parameters import name_of
from cpfls_cli.config.load import stored_study
from cpfls_cli.export.samples import Samples
from cpfls_cli.pages.trust import trust_words
from cpfls_cli.playback.gusts import GUST_AXES, Gusts
from cpfls_cli.report.content import Block, Folded, Table, Text
from cpfls_cli.report.numbers import number
from cpfls_cli.report.outcome import caution_texts
from cpfls_cli.validation.trust import Trust
from cpfls_cli.words import joined

_SCORE_UNITS = {"mse": "(N m)^2", "max_error": "N m", "relative_error": "1", "r2": "1", "vaf": "1", "r2_body": "1"}


def export_answer(
    told: Sequence[str], warnings: Sequence[str], sizes: Mapping[str, int], dry_run: bool
) -> Iterator[Text]:
    """Say which files a model was exported to and their bytes, what it is worth, and what speaks against it."""
    verb = "would be written" if dry_run else "written"
    for file, size in sizes.items():
        yield Text(f"{file}: {verb} ({size} bytes)")
    yield from map(Text, told)
    yield from (Text(warning, "warning") for warning in warnings)


def identified_evidence(record: IdentifiedModel) -> dict[str, Any]:
    """Say the same for machines."""
    verdict, judged = record.verdict, record.judged
    counts = zip(judged.parts, judged.samples, judged.outside, strict=True)
    stated = None
    if verdict is not None:
        reasons = [{"reason": reason, "speaks": float(speaks)} for reason, speaks in verdict.reasons]
        stated = {"label": verdict.label, "region": verdict.region, "reasons": reasons}
    return {
        "stop_reason": record.stop_reason,
        "verdict": stated,
        "findings": record.findings,
        "judged": {
            "units": _SCORE_UNITS,
            "parts": {part: {"samples": int(samples), "outside": int(outside)} for part, samples, outside in counts},
            "models": {
                model: {
                    part: {measure: judged.of_axes(measure, model, part).tolist() for measure in judged.measures}
                    for part in judged.parts
                }
                for model in judged.models
            },
        },
    }


def identified_warnings(model: IdentifiedModel, config: str, path: object) -> Iterator[str]:
    """Say what speaks against flying with an identified model."""
    if not model.complete:
        yield "the model is incomplete, and marked as such: do not fly with it"
    if model.verdict is None:
        off = not stored_study(config, path).identification.validation.enabled
        why = "identification.validation.enabled was off when it was identified" if off else "it was not validated"
        yield (
            f"{path}: holds no verdict ({why}), so nothing says how far to trust it; run `cpfls identify` with "
            "identification.validation.enabled: true"
        )
    elif model.verdict.label == "do-not-use":
        against = [reason for reason, speaks in model.verdict.reasons if speaks < 0]
        yield ": ".join([f"{path}: its verdict is do-not-use, exported all the same", *against[:1]])


_SHOWN = 8
"""Rows of a table that the first screen has room for."""


def spread_answer(samples: Samples, output: Path, size: int) -> Iterator[Block]:
    """Say what was drawn and written, what its numbers lie between, and what speaks against them."""
    spread, sheet = samples.spread, samples.sheet
    count, out = len(spread.models), spread.tried - len(spread.models)
    yield Text(f"{output}: written ({size} bytes)")
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
    if sheet.verdict == Trust.LACKING:
        drawn = ": the file holds how large that is, to be played beside the gusts."
        narrow = ", so the spread is too narrow by as much as that."
        said = drawn if spread.lack else narrow
        yield Text(f"The vehicle answers with something that the model lacks{said}", "warning", always=True)
    calm = _without_gusts(sheet.model.gusts)
    if calm:
        yield Text(
            f"No gusts {joined(calm)}: the flights do not tell their size, so what blew there is not in the spread.",
            "warning",
            always=True,
        )
    yield from caution_texts(sheet.cautions)


def _name(name: str) -> str:
    kind, _, axis = name.partition(".")
    return f"gusts, {axis.replace('_', ' ')}" if kind == "gust" else name_of(name)


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
