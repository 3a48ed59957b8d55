"""Bands: of the inertia matrix over attitude, and of the inertia parameters."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from cpfls_cli.inertia import INERTIA_PARAMETERS
from cpfls_cli.pages.evidence import has
from cpfls_cli.pages.figures.inertia_curves import ENTRIES, entry_of, inertia_curves_figure
from cpfls_cli.pages.sections.each import section_of_each
from cpfls_cli.pages.source import Source, Sources
from cpfls_cli.report.content import Block, Cell, Heading, Section, Table, Text
from cpfls_cli.report.numbers import number, percent
from cpfls_cli.report.rounded import printed, with_interval
from cpfls_cli.validation.bands import band


def uncertainty_section(sources: Sources) -> Section | None:
    """Show the bands of the models that hold them.

    Returns
    -------
    Section or None
        None where no model holds any.
    """
    models = [model for model in sources.models if has(model, "uncertainty") or has(model, "curves")]
    return section_of_each("uncertainty", "How sure the inertia is", models, _uncertainty)


def _uncertainty(model: Source, index: int) -> Iterator[Block]:
    yield Heading(model.label)
    if has(model, "uncertainty"):
        yield _parameters(model, index)
    if has(model, "curves"):
        for curve in range(len(model.artifact.texts("curves/name"))):
            yield inertia_curves_figure(f"inertia-curves-{index}-{curve + 1}", model, curve)
    if has(model, "round_trip"):
        yield Text(_round_trip(model))


def _parameters(model: Source, index: int) -> Table:
    artifact = model.artifact
    blocks = int(artifact.number("uncertainty/blocks"))
    based = artifact.text("model/base") == "rigid-body"
    pairs = [("baselines/rigid_body", "uncertainty/best_rigid_body")]
    pairs += [("model/rigid_body", "uncertainty/rigid_body")] if based else []
    columns = [
        (artifact.array(value), *band(artifact.array(value), artifact.array(key), blocks)) for value, key in pairs
    ]
    stated = [*model.vehicle.inertia_kg_m2, *[0.0] * 6][:6]
    rows: list[list[str | Cell]] = []
    for place, name in enumerate(INERTIA_PARAMETERS):
        cells = [_with_band(*(float(side[place]) for side in column)) for column in columns]
        low, high = float(columns[0][1][place]), float(columns[0][2][place])
        inside = low <= stated[place] <= high
        told = Cell("inside" if inside else "outside ◂", "plain" if inside else "warning")
        rows.append([name, number(stated[place]), *cells, told])
    header = [
        "kg m²",
        "Stated in the config",
        "Rigid body that fits best",
        *(["Under the fuzzy part"] if based else []),
    ]
    caption = (
        f"Inertia parameters of {model.label} with 95 % intervals, from a bootstrap of {blocks} contiguous blocks of "
        f"{number(artifact.number('uncertainty/block_duration'), 2)} s. The last column says whether the stated value "
        "lies in the interval of the rigid body that fits best."
    )
    last = len(header)
    return Table(
        f"inertia-bands-{index}",
        caption,
        [*header, "Stated value"],
        rows,
        frozenset({0, last}),
        frozenset(range(2, last)),
    )


def _with_band(value: float, low: float, high: float) -> str:
    middle, *ends = map(printed, with_interval(value, low, high))
    return f"{middle} ({ends[0]} … {ends[1]})"


def _round_trip(model: Source) -> str:
    inside = model.artifact.array("round_trip/inside")
    shares = [(entry, float(entry_of(inside, entry))) for entry in ENTRIES]
    told = ", ".join(f"{entry} {percent(share)}" for entry, share in shares if np.isfinite(share))
    return (
        "Round trip: the model was simulated along its training motion, with errors as large as its own, and "
        f"identified again (dashed). Share of the visited points where that lies within the band: "
        f"{told or 'none was visited'}. About 95 % is what a band of 95 % promises; much less says that "
        "the band is too narrow."
    )
