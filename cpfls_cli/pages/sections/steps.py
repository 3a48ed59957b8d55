"""Prediction by horizon."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from cpfls_cli.pages.evidence import has
from cpfls_cli.pages.figures.steps import steps_figure
from cpfls_cli.pages.sections.each import section_of_each
from cpfls_cli.pages.source import Source, Sources
from cpfls_cli.report.content import Block, Cell, Heading, Section, Table
from cpfls_cli.report.numbers import count, number

_WORDS = {"rigid-body": "rigid body", "nothing-moves": "nothing moves"}
# Of equal predictors rounding must not choose one.
_TIE = 1.0 + 1e-6


def steps_section(sources: Sources) -> Section | None:
    """Show how well the models predict motion, where that was tried.

    Returns
    -------
    Section or None
        None where no model holds it.
    """
    models = [model for model in sources.models if has(model, "steps")]
    return section_of_each("steps", "Prediction by horizon", models, _steps)


def _steps(model: Source, index: int) -> Iterator[Block]:
    yield Heading(model.label)
    yield steps_figure(f"steps-{index}", model)
    yield _table(model, index)


def _table(model: Source, index: int) -> Table:
    artifact = model.artifact
    horizon, samples = artifact.array("steps/horizon"), artifact.array("steps/samples")
    shown = sorted({0, len(horizon) // 5, len(horizon) // 2, len(horizon) - 1})
    sizes = [
        scale * np.sqrt(np.sum(artifact.array(f"steps/{key}") ** 2, axis=2))
        for key, scale in (("attitude", 180.0 / np.pi), ("body_rate", 1.0))
    ]
    rows: list[list[str | Cell]] = []
    for step in shown:
        for place, predictor in enumerate(artifact.texts("steps/model")):
            cells = [_cell(size[:, step], place) for size in sizes]
            reach = f"{number(float(horizon[step]), 3)} s" if place == 0 else ""
            rows.append([reach, count(samples[step]) if place == 0 else "", _WORDS.get(predictor, predictor), *cells])
    caption = (
        f"Root mean square error after so much time on {artifact.text('steps/part')}, all axes together. Marked: the "
        "least. — where a predictor could not be simulated over every window."
    )
    header = ("Horizon", "Samples", "Predictor", "Attitude, °", "Body rate, rad/s")
    return Table(f"steps-table-{index}", caption, header, rows, frozenset({0, 2}))


def _cell(errors: np.ndarray, place: int) -> Cell:
    least = np.isfinite(errors[place]) and errors[place] <= _TIE * np.nanmin(errors)
    text = number(float(errors[place]), 3)
    return Cell(f"{text} ◂", "good") if least else Cell(text)
