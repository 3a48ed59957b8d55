"""What models leave of the torque: white or not, related to their inputs or not, normal or not."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from cpfls_cli.pages.evidence import has
from cpfls_cli.pages.figures.autocorrelation import autocorrelation_figure
from cpfls_cli.pages.figures.cross_correlation import cross_correlation_figure, strongest
from cpfls_cli.pages.figures.distribution import distribution_figure
from cpfls_cli.pages.gap_words import probability
from cpfls_cli.pages.judged import AXES
from cpfls_cli.pages.sections.each import section_of_each
from cpfls_cli.pages.source import Source, Sources
from cpfls_cli.report.content import Block, Cell, Heading, Section, Table, Text
from cpfls_cli.report.numbers import UNKNOWN, number, percent

# As in the reasons of the verdict.
_SIGNIFICANT = 0.01


def residuals_section(sources: Sources) -> Section | None:
    """Show the residuals of the models that hold them.

    Returns
    -------
    Section or None
        None where no model holds any.
    """
    models = [model for model in sources.models if has(model, "residuals")]
    return section_of_each("residuals", "What the model leaves over", models, _residuals)


def _residuals(model: Source, index: int) -> Iterator[Block]:
    yield Heading(model.label)
    exact = np.isnan(model.artifact.array("residuals/autocorrelation")).all(axis=0)
    if exact.all():
        yield Text("Nothing but rounding is left over, so there is nothing to examine.", "good")
        return
    yield _whiteness(model, index)
    yield autocorrelation_figure(f"autocorrelation-{index}", model)
    yield cross_correlation_figure(f"cross-correlation-{index}", model)
    yield _followed(model, index)
    yield distribution_figure(f"error-distribution-{index}", model)


def _whiteness(model: Source, index: int) -> Table:
    artifact = model.artifact
    caption = (
        f"Whether the torque error of {model.label} is white noise about 0 on {artifact.text('residuals/part')}, "
        f"{_examined(model)}. Of white noise 5 % of the lags lie outside the band; p is the chance that white noise "
        "has autocorrelations as large (Ljung and Box). Filtered signals are never quite white. The mean is a constant "
        "torque that the model lacks, with the chance that errors without one have a mean as large."
    )
    header = ("Axis", "At one sample", "Lags outside the band", "p", "Mean, N m", "p of the mean", "So it is")
    rows = [[word, *_axis(model, axis)] for axis, word in enumerate(AXES)]
    return Table(f"whiteness-of-errors-{index}", caption, header, rows, frozenset({0, len(header) - 1}))


def _examined(model: Source) -> str:
    samples = int(model.artifact.number("residuals/samples"))
    available = int(model.artifact.number("residuals/available")) if _has_mean(model) else samples
    return f"{samples} samples" if samples == available else f"the first {samples} of its {available} samples"


def _has_mean(model: Source) -> bool:
    """Tell models that were made before their mean was tested."""
    return "residuals/mean" in model.artifact.data


def _axis(model: Source, axis: int) -> list[str | Cell]:
    artifact = model.artifact
    values, chance = artifact.array("residuals/autocorrelation")[:, axis], artifact.array("residuals/ljung_box")[axis]
    known = values[np.isfinite(values)]
    if not known.size:
        return [*[UNKNOWN] * 5, "only rounding is left"]
    outside = float(np.mean(np.abs(known) > artifact.number("residuals/band")))
    mean, of_mean = _mean(model, axis)
    white, biased = chance >= _SIGNIFICANT, of_mean < _SIGNIFICANT
    told = ("white" if white else "not white") + (", not 0 in the mean" if biased else "")
    return [
        number(float(known[0]), 3),
        percent(outside),
        probability(float(chance)),
        number(mean, 3) if np.isfinite(mean) else UNKNOWN,
        probability(of_mean) if np.isfinite(of_mean) else UNKNOWN,
        Cell(told, "plain" if white and not biased else "warning"),
    ]


def _mean(model: Source, axis: int) -> tuple[float, float]:
    if not _has_mean(model):
        return float("nan"), float("nan")
    mean, chance = (model.artifact.array(f"residuals/{key}")[axis] for key in ("mean", "mean_p"))
    return float(mean), float(chance)


def _followed(model: Source, index: int) -> Table:
    artifact = model.artifact
    values, band = artifact.array("residuals/correlation"), artifact.number("residuals/band")
    lag, largest = artifact.array("residuals/input_lag"), strongest(values)
    rows: list[list[str | Cell]] = [
        [name, *(_strength(values[place, :, axis], lag, largest[place, axis], band) for axis in range(len(AXES)))]
        for place, name in enumerate(artifact.texts("residuals/input"))
    ]
    caption = (
        "Largest correlation of the error with each signal, and the lag where it is (s). Marked: more than twice the "
        f"band of ±{number(band, 2)}."
    )
    return Table(f"followed-{index}", caption, ("Signal", *(f"Error on {axis}" for axis in AXES)), rows)


def _strength(values: np.ndarray, lag: np.ndarray, largest: float, band: float) -> Cell:
    if not np.isfinite(largest):
        return Cell(UNKNOWN)
    place = int(np.nanargmax(np.abs(values)))
    text = f"{values[place]:+.2f} at {lag[place]:.2g}".replace("-", "−")
    return Cell(f"{text} ◂", "warning") if largest > 2 * band else Cell(text)
