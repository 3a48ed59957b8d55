"""What models leave of the torque: white or not, correlated with their inputs or not, normal or not."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.artifacts.identified import IdentifiedModel
from cpfls_cli.identification.scores import AXES
from cpfls_cli.pages.source import Source
from cpfls_cli.report.canvas import BASELINE, GREY, legend_over, plain_ticks, plot, stacked, style_of
from cpfls_cli.report.content import Block, Cell, Heading, Plot, Table, Text
from cpfls_cli.report.numbers import UNKNOWN, number, percent, probability
from cpfls_cli.validation.residuals import ResidualAnalysis

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# As in the reasons of the verdict.
_SIGNIFICANT = 0.01
_NAMED = 3
_OTHERS: dict[str, Any] = {"color": "#b5b5b5", "linewidth": 0.7, "zorder": 1.5}
_BAND: dict[str, Any] = {"color": "#d9d9d9", "zorder": 0}
_QUARTILE = 0.6745
_FILL: dict[str, Any] = {"color": "#9db8d6", "edgecolor": "#1b4f8a", "linewidth": 0.3}
_NORMAL: dict[str, Any] = {**BASELINE, "color": "black"}


def residual_blocks(model: Source[IdentifiedModel], index: int) -> Iterator[Block]:
    """Show what a model leaves of the torque, where it holds that."""
    residuals = model.record.residuals
    assert residuals is not None, "only models that hold them are shown"
    yield Heading(model.label)
    if np.isnan(residuals.autocorrelation).all():
        yield Text("Nothing but rounding is left over, so there is nothing to examine.", "good")
        return
    yield _whiteness(model.label, residuals, index)
    yield autocorrelation_figure(f"autocorrelation-{index}", model.label, residuals)
    yield cross_correlation_figure(f"cross-correlation-{index}", model.label, residuals)
    yield _followed(residuals, index)
    yield distribution_figure(f"error-distribution-{index}", model.label, residuals)


def _whiteness(label: str, residuals: ResidualAnalysis, index: int) -> Table:
    samples, available = residuals.samples, residuals.available
    examined = f"{samples}" if available == samples else f"the first {samples} of its {available}"
    caption = (
        f"Whether the torque error of {label} is white noise about 0 on {residuals.part}, {examined} samples. Of white "
        "noise 5 % of the lags lie outside the band; p is the chance that white noise has autocorrelations as large "
        "(Ljung and Box). Filtered signals are never quite white. The mean is a constant torque that the model lacks, "
        "with the chance that errors without one have a mean as large."
    )
    header = ("Axis", "At one sample", "Lags outside the band", "p", "Mean, N m", "p of the mean", "Conclusion")
    rows = [[name, *_whiteness_about(residuals, axis)] for axis, name in enumerate(AXES)]
    return Table(f"whiteness-of-errors-{index}", caption, header, rows, frozenset({0, len(header) - 1}))


def _whiteness_about(residuals: ResidualAnalysis, axis: int) -> list[str | Cell]:
    values, chance = residuals.autocorrelation[:, axis], float(residuals.ljung_box[axis])
    known = values[np.isfinite(values)]
    if not known.size:
        return [*[UNKNOWN] * 5, "only rounding is left"]
    outside = float(np.mean(np.abs(known) > residuals.band))
    mean, mean_chance = float(residuals.mean[axis]), float(residuals.mean_p[axis])
    white, biased = chance >= _SIGNIFICANT, mean_chance < _SIGNIFICANT
    conclusion = ("white" if white else "not white") + (", not 0 in the mean" if biased else "")
    return [
        number(float(known[0]), 3),
        percent(outside),
        probability(chance),
        number(mean, 3) if np.isfinite(mean) else UNKNOWN,
        probability(mean_chance) if np.isfinite(mean_chance) else UNKNOWN,
        Cell(conclusion, "plain" if white and not biased else "warning"),
    ]


def _followed(residuals: ResidualAnalysis, index: int) -> Table:
    values, band = residuals.correlation, residuals.band
    rows: list[list[str | Cell]] = [
        [name, *(_strength(values[signal, :, axis], residuals.input_lag, band) for axis in range(len(AXES)))]
        for signal, name in enumerate(residuals.input)
    ]
    caption = (
        "Largest correlation of the error with each signal, and the lag where it is (s). Marked: more than twice the "
        f"band of ±{number(band, 2)}."
    )
    return Table(f"followed-{index}", caption, ("Signal", *(f"Error on {axis}" for axis in AXES)), rows)


def _strength(values: Array, lag: Array, band: float) -> Cell:
    if not np.isfinite(values).any():
        return Cell(UNKNOWN)
    largest = int(np.nanargmax(np.abs(values)))
    text = f"{values[largest]:+.2f} at {lag[largest]:.2g}".replace("-", "−")
    return Cell(f"{text} ◂", "warning") if abs(values[largest]) > 2 * band else Cell(text)


def autocorrelation_figure(name: str, label: str, residuals: ResidualAnalysis) -> Plot:
    """Draw the correlation of the torque error with itself some time later, by axis, with the band of white noise."""
    values, band = residuals.autocorrelation, residuals.band
    low = min(-0.2, float(np.nanmin(values, initial=0.0)) - 0.05)

    def draw(figure: Figure) -> None:
        (panels,) = _by_axis(figure, share_y=True)
        for axes, column in zip(panels, values.T, strict=True):
            axes.axhspan(-band, band, label="95 % of the lags of white noise", **_BAND)
            axes.axhline(0.0, color=GREY, linewidth=0.7)
            axes.plot(residuals.lag, column, marker="o", markersize=2.6, label="error", **style_of(0))
            axes.set_ylim(low, 1.05)
        panels[0].set_ylabel("correlation")
        panels[1].set_xlabel("lag, s")
        legend_over(figure, panels[0])

    caption = (
        f"Correlation of the torque error of {label} with itself some time later, on {residuals.part}. Errors that "
        "noise alone makes stay within the grey band at 95 % of the lags; errors outside it follow motion that the "
        "model does not explain."
    )
    return plot(name, caption, "Autocorrelation of the torque error by axis, with the band of white noise", 2.5, draw)


def _by_axis(figure: Figure, rows: int = 1, share_y: Literal["row"] | bool = False) -> list[list[Axes]]:
    """Make plots in three columns: roll, pitch, yaw; each row with one x axis."""
    grid = figure.subplots(rows, len(AXES), sharex="row", sharey=share_y, squeeze=False)
    for axes, axis in zip(grid[0], AXES, strict=True):
        axes.set_title(axis)
    for axes in grid.flat:
        plain_ticks(axes.yaxis)
    return [list(row) for row in grid]


def cross_correlation_figure(name: str, label: str, residuals: ResidualAnalysis) -> Plot:
    """Draw the correlation of error and inputs over the lag; the strongest three of each axis are named."""

    def draw(figure: Figure) -> None:
        panels = stacked(figure, len(AXES))
        for index, (axes, axis) in enumerate(zip(panels, AXES, strict=True)):
            axes.axhspan(-residuals.band, residuals.band, **_BAND)
            _draw_correlations(axes, residuals.input_lag, residuals.correlation[:, :, index], residuals.input)
            axes.set_title(f"error on {axis}", loc="right")
            plain_ticks(axes.yaxis)
        figure.supylabel("correlation", fontsize=9.5)
        panels[-1].set_xlabel("lag, s (positive: the error follows the input)")

    caption = (
        f"Correlation of the torque error of {label} with the signals that go into the model and the torque that "
        f"comes out of it, on {residuals.part}; the three strongest of each axis are named, the others are grey lines. "
        "Far outside the grey band the error follows a signal, so that a better model could explain it; slow signals "
        "leave the band by chance too."
    )
    return plot(name, caption, "Correlation of the torque error with each input over the lag", 5.6, draw)


def _draw_correlations(axes: Axes, lag: Array, values: Array, inputs: tuple[str, ...]) -> None:
    strongest = np.where(np.isfinite(values), np.abs(values), -1.0).max(axis=1)
    handles = []
    for rank, index in enumerate(np.argsort(-strongest, kind="stable")):
        if not np.isfinite(values[index]).any():
            continue
        style = style_of(rank) if rank < _NAMED else _OTHERS
        (curve,) = axes.plot(lag, values[index], label=inputs[index], **style)
        handles += [curve] if rank < _NAMED else []
    if handles:
        axes.legend(handles=handles, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=_NAMED, borderaxespad=0.1)


def distribution_figure(name: str, label: str, residuals: ResidualAnalysis) -> Plot:
    """Draw histogram and quantiles of the torque error by axis, each beside the normal distribution."""
    normal = residuals.normal_quantile

    def draw(figure: Figure) -> None:
        upper, lower = _by_axis(figure, rows=2)
        for index, quantiles in enumerate(residuals.quantile.T):
            # Median and quartiles give a normal distribution that outliers do not move.
            low, middle, high = np.interp([-_QUARTILE, 0.0, _QUARTILE], normal, quantiles)
            deviation = (high - low) / (2 * _QUARTILE)
            edges, counts = residuals.histogram_edge[:, index], residuals.histogram_count[:, index]
            _histogram(upper[index], edges, counts, middle, deviation)
            lower[index].plot(normal, quantiles, "o", markersize=2.4, color=style_of(0)["color"])
            ends = normal[[0, -1]]
            lower[index].plot(ends, middle + deviation * ends, **_NORMAL)
        upper[0].set_ylabel("errors in a bin")
        upper[1].set_xlabel("error, N m")
        lower[0].set_ylabel("quantile of the error, N m")
        lower[1].set_xlabel("quantile of the standard normal distribution")
        legend_over(figure, upper[0])

    caption = (
        f"Distribution of the torque error of {label} on {residuals.part}: histogram, and its quantiles over those of "
        "the normal distribution (dashed: the normal distribution through the quartiles). Points that leave the dashed "
        "line at the ends are errors larger than noise makes them."
    )
    return plot(name, caption, "Histogram and quantile plot of the torque error by axis", 4.6, draw)


def _histogram(axes: Axes, edges: Array, counts: IntArray, middle: float, deviation: float) -> None:
    from matplotlib.ticker import MaxNLocator

    widths = np.diff(edges)
    axes.bar(edges[:-1], counts, widths, align="edge", label="errors", **_FILL)
    if deviation > 0 and (widths > 0).all():
        x = np.linspace(edges[0], edges[-1], 201)
        density = np.exp(-0.5 * ((x - middle) / deviation) ** 2) / (deviation * np.sqrt(2 * np.pi))
        axes.plot(x, counts.sum() * widths.mean() * density, label="normal distribution", **_NORMAL)
    axes.grid(visible=False, axis="x")
    axes.xaxis.set_major_locator(MaxNLocator(3, symmetric=True))
    plain_ticks(axes.xaxis)
