"""Figures of identified models: of one, and of several on the same data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from math import ceil
from typing import Any, Literal

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray, runs
from cpfls_cli.artifacts.identified import IdentifiedModel
from cpfls_cli.fuzzy.basis import join_ends, memberships
from cpfls_cli.identification.findings import AXES
from cpfls_cli.identification.identify import MODEL, RIGID_BODY
from cpfls_cli.identification.solver import RidgeCurve
from cpfls_cli.pages.comparison import FLOOR_TICK, compared_curves, compared_parts
from cpfls_cli.report.canvas import (
    BASELINE,
    GREY,
    HELD,
    Axes,
    Drawn,
    Figure,
    band,
    in_columns,
    legend_above,
    legend_over,
    named,
    plain_ticks,
    stacked,
    style_of,
)
from cpfls_cli.report.content import number, plain
from cpfls_cli.report.source import Source
from cpfls_cli.validation.residuals import ResidualAnalysis
from cpfls_cli.validation.validate import Curves

PREDICTORS = {"rigid-body": "rigid body", "nothing-moves": "nothing moves"}
"""What a model is compared with where motion is predicted."""
STEP_ROWS = (("attitude", "attitude, °", 180.0 / np.pi), ("body_rate", "body rate, rad/s", 1.0))
"""Predicted quantities, each with its name and the factor to its unit."""
ENTRIES = ("D22", "D33", "D23", "D11", "D12", "D13")
"""Entries of D(q) in the order in which they are shown."""

_STEP_AXES = ("about x", "about y", "about z")
_STEP_STYLES: dict[str, dict[str, Any]] = {
    "model": {**style_of(0), "linewidth": 1.8},
    "rigid-body": {**BASELINE, "linewidth": 1.6},
    "nothing-moves": HELD,
}
_MARKED: dict[str, Any] = {"color": style_of(1)["color"], "markerfacecolor": "none", "markeredgewidth": 2}
_DECADE = 10.0
_NAMED = 3
_OTHERS: dict[str, Any] = {"color": "#b5b5b5", "linewidth": 0.7, "zorder": 1.5}
_NOISE: dict[str, Any] = {"color": "#d9d9d9", "zorder": 0}
_QUARTILE = 0.6745
_FILL: dict[str, Any] = {"color": "#9db8d6", "edgecolor": "#1b4f8a", "linewidth": 0.3}
_NORMAL: dict[str, Any] = {**BASELINE, "color": "black"}
_AGAIN = {**style_of(1), "linewidth": 1.2}
_VISITED = "#eef3e6"
_ROOM, _LEAST = 0.6, 0.02
_BAND = "95 % band of"
_POINTS = np.linspace(0.0, 1.0, 401)
_CLOSE = 0.05
_MARKERS = ("o", "s", "D", "^", "v", "P")
_FLOOR = 1e-9


def first_objective(r: IdentifiedModel) -> tuple[str, str]:
    """Name the error that the search minimised, and its unit.

    Over a rigid body it is the error on blocks left out in turn, every axis divided by its own scale.
    """
    return ("cross-validated error", "scaled torque²") if r.on_rigid_body else ("mean squared error", "(N m)²")


def weight_words(weight: float, digits: int) -> str:
    """Write a ridge weight; an infinite one switches the fuzzy part off."""
    return "fuzzy part off" if np.isinf(weight) else number(weight, digits)


def entry_of(values: Array, entry: str) -> Array:
    """Take an entry such as D23 out of matrices of shape (..., 3, 3)."""
    return np.asarray(values[..., int(entry[1]) - 1, int(entry[2]) - 1])


def _draw_ridge(r: IdentifiedModel, figure: Figure) -> None:
    """Draw the cross-validated error (method.md section 8) over the ridge weight; the last point has no fuzzy part."""
    assert isinstance(r.ridge, RidgeCurve), "drawn only where there is one"
    weight, error, last = r.ridge.weight, r.ridge.error, len(r.ridge.weight) - 1
    finite = np.where(np.isfinite(weight), weight, np.finfo(float).max)
    chosen = last if np.isinf(r.ridge_weight) else int(np.argmin(np.abs(finite - r.ridge_weight)))
    # The point without a fuzzy part stands a decade beyond the largest weight.
    position = np.where(np.isfinite(weight), weight, 10.0 * weight[np.isfinite(weight)].max(initial=1e-9))
    axes = figure.subplots()
    style = {"color": style_of(0)["color"], "markersize": 4, "capsize": 3, "linewidth": 1.2}
    axes.errorbar(position, error, r.ridge.standard_error, fmt="o-", label="error ± one standard error", **style)
    axes.plot([position[chosen]], [error[chosen]], "D", label="chosen", markersize=10, **_MARKED)
    axes.set_xscale("log")
    if error.min() > 0 and error.max() > _DECADE * error.min():
        axes.set_yscale("log", nonpositive="clip")
    else:
        plain_ticks(axes.yaxis)
    shown = [*range(0, last - 1, max(last // 6, 1)), last]
    axes.set_xticks(position[shown], [weight_words(weight[index], 1) for index in shown])
    axes.minorticks_off()
    axes.set(xlabel="ridge weight on the fuzzy part", ylabel="cross-validated error, scaled torque²")
    legend_above(axes)


def residuals_of(r: IdentifiedModel) -> ResidualAnalysis:
    """Give the residual analysis; asked only of models that hold one."""
    assert r.residuals is not None, "asked only of models that hold them"
    return r.residuals


def _has_residuals(r: IdentifiedModel) -> bool:
    return r.residuals is not None and not np.isnan(r.residuals.autocorrelation).all()


def _by_axis(figure: Figure, rows: int = 1, share_y: Literal["row"] | bool = False) -> list[list[Axes]]:
    """Make plots in three columns: roll, pitch, yaw; each row with one x axis."""
    grid = figure.subplots(rows, len(AXES), sharex="row", sharey=share_y, squeeze=False)
    for axes, axis in zip(grid[0], AXES, strict=True):
        axes.set_title(axis)
    for axes in grid.flat:
        plain_ticks(axes.yaxis)
    return [list(row) for row in grid]


def _draw_autocorrelation(r: IdentifiedModel, figure: Figure) -> None:
    """Draw the correlation of the torque error with itself some time later, by axis, with the band of white noise."""
    residuals = residuals_of(r)
    values, noise = residuals.autocorrelation, residuals.band
    low = min(-0.2, float(np.nanmin(values, initial=0.0)) - 0.05)
    (panels,) = _by_axis(figure, share_y=True)
    for axes, column in zip(panels, values.T, strict=True):
        axes.axhspan(-noise, noise, label="95 % of the lags of white noise", **_NOISE)
        axes.axhline(0.0, color=GREY, linewidth=0.7)
        axes.plot(residuals.lag, column, marker="o", markersize=2.6, label="error", **style_of(0))
        axes.set_ylim(low, 1.05)
    panels[0].set_ylabel("correlation")
    panels[1].set_xlabel("lag, s")
    legend_over(figure, panels[0])


def _draw_cross_correlation(r: IdentifiedModel, figure: Figure) -> None:
    """Draw the correlation of error and inputs over the lag; the strongest three of each axis are named."""
    residuals = residuals_of(r)
    panels = stacked(figure, len(AXES))
    for index, (axes, axis) in enumerate(zip(panels, AXES, strict=True)):
        axes.axhspan(-residuals.band, residuals.band, **_NOISE)
        _draw_correlations(axes, residuals.input_lag, residuals.correlation[:, :, index], residuals.input)
        axes.set_title(f"error on {axis}", loc="right")
        plain_ticks(axes.yaxis)
    figure.supylabel("correlation", fontsize=9.5)
    panels[-1].set_xlabel("lag, s (positive: the error follows the input)")


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


def _draw_distribution(r: IdentifiedModel, figure: Figure) -> None:
    """Draw histogram and quantiles of the torque error by axis, each with the normal distribution."""
    residuals = residuals_of(r)
    normal = residuals.normal_quantile
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


def _draw_curve(curve: int, r: IdentifiedModel, figure: Figure) -> None:
    """Draw the six entries of D(q) along one curve of attitudes, with what a second identification gave."""
    assert r.curves is not None, "drawn only where there are some"
    again = None if r.round_trip is None else r.round_trip.inertia[curve]
    panels = _panels(figure, r.curves.name[curve])
    for axes, entry in zip(panels, ENTRIES, strict=True):
        _draw_entry(axes, r.curves, curve, entry, again)
    legend_over(figure, panels[0])


def _has_curve(curve: int, r: IdentifiedModel) -> bool:
    return r.curves is not None and curve < len(r.curves.name)


def _panels(figure: Figure, word: str) -> list[Axes]:
    """Make a plot for each entry of D(q)."""
    panels = figure.subplots(2, len(ENTRIES) // 2, sharex=True)
    for axes, entry in zip(panels.flat, ENTRIES, strict=True):
        axes.set_title(entry)
        plain_ticks(axes.yaxis)
    panels[-1, 1].set_xlabel(f"{word.removeprefix('over ')}, °")
    figure.supylabel("kg m²", fontsize=9.5)
    return list(panels.flat)


def _keep_scale(axes: Axes, shown: Sequence[Array], curves: Sequence[Curves]) -> None:
    """Show some values in full and no more: a band that opens where training was not would flatten everything."""
    # Of the whole matrices, so that rounding of an entry that is zero is not drawn large.
    largest = max(float(np.abs(each.inertia).max(initial=1e-12)) for each in curves)
    known = np.concatenate([curve[np.isfinite(curve)] for curve in shown])
    if known.size:
        low, high = float(known.min()), float(known.max())
        room = max(_ROOM * (high - low), _LEAST * largest) / 2
        axes.set_ylim(low - room, high + room)


def _along(curves: Curves, curve: int, entry: str) -> tuple[Array, BoolArray, Array, Array, Array, Array]:
    """Give along a curve its angle in degrees, where training was, an entry of D(q), its band and the rigid body's."""
    attitude = np.degrees(curves.attitude[curve])
    angle = attitude[:, int(np.argmax(np.ptp(attitude, axis=0)))]
    matrices = (curves.inertia, curves.low, curves.high, curves.rigid_body)
    values, low, high, rigid = (entry_of(matrix[curve], entry) for matrix in matrices)
    return angle, ~curves.outside[curve], values, low, high, rigid


def _draw_entry(axes: Axes, curves: Curves, curve: int, entry: str, again: Array | None) -> None:
    from matplotlib.ticker import MaxNLocator

    angle, visited, values, low, high, rigid = _along(curves, curve, entry)
    for first, after in runs(visited):
        axes.axvspan(angle[first], angle[after - 1], color=_VISITED, label="training was here", zorder=0)
    band(axes, angle, low, high, color="#9db8d6", alpha=0.7, label="95 % band")
    axes.plot(angle, rigid, label="rigid body", **{**BASELINE, "linewidth": 1.6})
    axes.plot(angle, values, label="model", **{**style_of(0), "linewidth": 1.6})
    if again is not None:
        axes.plot(angle, entry_of(again, entry), label="identified again", **_AGAIN)
    axes.set_xlim(angle[0], angle[-1])
    axes.xaxis.set_major_locator(MaxNLocator(5, steps=[1, 1.5, 2, 3, 4.5, 5, 6, 9, 10]))
    _keep_scale(axes, [rigid, values, low[visited], high[visited]], [curves])


def _draw_steps(r: IdentifiedModel, figure: Figure) -> None:
    """Draw errors over the horizon on logarithmic axes, with those of the rigid body and of nothing that moves."""
    from matplotlib.ticker import FuncFormatter

    steps = r.steps
    assert steps is not None, "drawn only where there are some"
    grid = figure.subplots(len(STEP_ROWS), len(_STEP_AXES), sharex=True, sharey="row")
    for panels, (quantity, title, scale) in zip(grid, STEP_ROWS, strict=True):
        for index, predictor in enumerate(steps.model):
            style = _STEP_STYLES.get(predictor, style_of(index + 1))
            for axes, column in zip(panels, scale * getattr(steps, quantity)[index].T, strict=True):
                positive = np.where(column > 0, column, np.nan)
                axes.plot(steps.horizon, positive, label=PREDICTORS.get(predictor, predictor), **style)
        panels[0].set_ylabel(title)
    for axes in grid.flat:
        axes.set(xscale="log", yscale="log")
        axes.minorticks_off()
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_formatter(FuncFormatter(lambda value, _: plain(value, smallest=1e-3)))
    for axes, axis in zip(grid[0], _STEP_AXES, strict=True):
        axes.set_title(axis)
    grid[-1][1].set_xlabel("horizon, s")
    legend_over(figure, grid[0][0])


def _draw_convergence(r: IdentifiedModel, figure: Figure) -> None:
    """Draw the best of each objective found so far, by generation."""
    from matplotlib.ticker import MaxNLocator

    error, unit = first_objective(r)
    titles = (f"smallest {error}", "smallest largest error", "smallest condition number")
    panels, generation = stacked(figure, len(titles)), np.arange(len(r.history.best))
    units = (unit, "N m", "pure number")
    for axes, title, unit, best in zip(panels, titles, units, r.history.best.T, strict=True):
        axes.plot(generation, np.where(np.isfinite(best), best, np.nan), marker="o", markersize=3, **style_of(0))
        axes.set(title=title, ylabel=unit)
        plain_ticks(axes.yaxis)
    panels[-1].set_xlabel("generation")
    panels[-1].xaxis.set_major_locator(MaxNLocator(integer=True))


def _draw_front(r: IdentifiedModel, figure: Figure) -> None:
    """Draw the members of the Pareto front and mark the chosen one."""
    objectives, chosen = r.pareto_front.objectives, r.pareto_front.chosen
    shown = np.delete(objectives, chosen, axis=0)
    axes = figure.subplots()
    axes.plot(shown[:, 2], shown[:, 0], "o", color=style_of(0)["color"], markersize=5, label="not dominated")
    axes.plot(*objectives[chosen, [2, 0]], "D", label="chosen", markersize=9, **_MARKED)
    axes.set(xlabel="condition number", ylabel=", ".join(first_objective(r)))
    plain_ticks(axes.yaxis)
    axes.set_xscale("log")
    legend_above(axes)


def _draw_partitions(r: IdentifiedModel, figure: Figure) -> None:
    """Draw the membership functions (equation 8) of all partitions: Figure 6 of the paper."""
    functions = r.functions
    joined = functions.structure.circular
    panels = in_columns(figure, len(functions.partitions), 2, share_y=True)
    named_peaks = zip(functions.structure.partitions, functions.partitions, strict=True)
    for axes, (own, peaks) in zip(panels.flat, named_peaks, strict=False):
        _draw_partition(axes, peaks, joined)
        axes.set_title(own.name)
    for axes in panels[:, 0]:
        axes.set_ylabel("membership")
    for axes in panels[-1]:
        axes.set_xlabel("input, scaled to 0 .. 1")


def has_partitions(r: IdentifiedModel) -> bool:
    """Tell whether membership functions take part in it of which more than one shares an input."""
    return not r.fuzzy_part_off and max(map(len, r.functions.partitions)) > 1


def _draw_partition(axes: Axes, peaks: Array, joined: bool) -> None:
    # The peaks themselves belong to the grid, or a narrow function would lose its top.
    points = np.union1d(_POINTS, peaks)
    values = memberships(points, peaks).value
    values = join_ends(values) if joined else values
    for function in range(values.shape[1]):
        axes.plot(points, values[:, function], **style_of(function))
    axes.set(ylim=(0.0, 1.18), yticks=[0.0, 0.5, 1.0])
    for index, peak in enumerate(peaks):
        function_number = index % values.shape[1] + 1
        colour = style_of(function_number - 1)["color"]
        axes.text(peak, 1.03, str(function_number), ha=_side(peaks, index), fontsize=8, color=colour)


def _side(peaks: Array, index: int) -> Literal["left", "center", "right"]:
    """Keep the numbers of two close peaks apart."""
    if index + 1 < len(peaks) and peaks[index + 1] - peaks[index] < _CLOSE:
        return "right"
    return "left" if index > 0 and peaks[index] - peaks[index - 1] < _CLOSE else "center"


FIGURES: Mapping[str, Drawn] = {
    "ridge-curve": Drawn(
        "Cross-validated error over the ridge weight, the chosen weight marked",
        3.0,
        _draw_ridge,
        lambda r: r.ridge is not None,
    ),
    "autocorrelation": Drawn(
        "Autocorrelation of the torque error by axis, with the band of white noise",
        2.5,
        _draw_autocorrelation,
        _has_residuals,
    ),
    "cross-correlation": Drawn(
        "Correlation of the torque error with each input over the lag", 5.6, _draw_cross_correlation, _has_residuals
    ),
    "error-distribution": Drawn(
        "Histogram and quantile plot of the torque error by axis", 4.6, _draw_distribution, _has_residuals
    ),
    **{
        f"inertia-curves-{curve + 1}": Drawn(
            f"Six entries of the inertia matrix {word}, with bands",
            4.5,
            partial(_draw_curve, curve),
            partial(_has_curve, curve),
        )
        for curve, word in enumerate(("over roll", "over pitch"))
    },
    "steps": Drawn(
        "Error of predicted attitude and body rate over the horizon, by axis",
        4.4,
        _draw_steps,
        lambda r: r.steps is not None,
    ),
    "convergence": Drawn(
        "Best error, largest error and condition number by generation", 4.6, _draw_convergence, lambda r: r.searched
    ),
    "pareto-front": Drawn(
        "Scatter of error against condition number, the chosen member marked", 3.0, _draw_front, lambda r: r.searched
    ),
    "figure-6": Drawn(
        "Membership functions of each fuzzy partition on the interval 0 to 1",
        lambda r: 1.75 * ceil(len(r.functions.partitions) / 2),
        _draw_partitions,
        has_partitions,
    ),
}
"""Figures of one identified model."""


_Models = Sequence[Source[IdentifiedModel]]


def _draw_errors(models: _Models, figure: Figure) -> None:
    """Draw the error of every model and its rigid body on the data that several were judged on."""
    parts = compared_parts(models)
    shown = [model for model in models if any(model in part.models for part in parts)]
    panels = figure.subplots(1, len(AXES), sharey=True)
    for axis, axes in enumerate(panels):
        for kind in (MODEL, RIGID_BODY):
            for index, model in enumerate(shown):
                offset = (0.5 - (index + 0.5) / len(shown)) * 0.6
                # From below.
                named_parts = [
                    (row + offset, part.names[part.models.index(model)])
                    for row, part in enumerate(parts[::-1])
                    if model in part.models
                ]
                shares = [float(model.record.judged.nrmse(kind, name)[axis]) for _, name in named_parts]
                errors = [0.0 if share < _FLOOR else 100 * share for share in shares]
                axes.plot(errors, [height for height, _ in named_parts], **_look(model.label, kind, index))
        axes.set_title(AXES[axis])
        axes.set_yticks(range(len(parts)), [part.title for part in parts[::-1]])
        axes.set_ylim(-0.6, len(parts) - 0.4)
        axes.grid(visible=False, axis="y")
        axes.tick_params(axis="y", length=0)
        _scale(axes)
    panels[1].set_xlabel("root mean square error over the standard deviation of the torque, %")
    legend_over(figure, panels[0])


def _errors_height(models: _Models) -> float:
    parts = compared_parts(models)
    shown = [model for model in models if any(model in part.models for part in parts)]
    return 1.3 + 0.16 * len(parts) * (len(shown) + 1.5)


def _look(label: str, kind: str, index: int) -> dict[str, Any]:
    mark: dict[str, Any] = {"marker": _MARKERS[index % len(_MARKERS)], "linestyle": "none"}
    if kind == MODEL:
        return {**mark, "label": label, "color": style_of(index)["color"], "markersize": 5}
    hollow = {"markersize": 9, "color": GREY, "markerfacecolor": "none", "zorder": 1.9}
    return {**mark, "label": f"rigid body of {label}", **hollow}


def _scale(axes: Axes) -> None:
    """Give the errors that can be resolved the whole width; those that are rounding stand at the left end."""
    from matplotlib.ticker import FuncFormatter

    values = np.concatenate([np.asarray(line.get_xdata(), dtype=float) for line in axes.lines])
    known, floored = values[np.isfinite(values) & (values > 0)], bool(np.any(values == 0))
    if not known.size:
        return
    low, high = float(known.min()), float(known.max())
    if high > _DECADE * low:
        axes.set_xscale("symlog", linthresh=0.7 * low, linscale=0.4) if floored else axes.set_xscale("log")
        axes.set_xlim(-0.3 * low if floored else None, 1.6 * high)
    else:
        axes.set_xlim(-0.06 * high if floored else 0.0, 1.1 * high)
    axes.minorticks_off()
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: _tick(value, floored)))


def _tick(value: float, floored: bool) -> str:
    if value < 0:
        return ""
    return FLOOR_TICK if value == 0 and floored else plain(value, smallest=1e-4)


def _draw_compared_curves(place: int, models: _Models, figure: Figure) -> None:
    """Draw the six entries of D(q) of several models along their curves."""
    word, compared = compared_curves(models)[place]
    panels = _panels(figure, word)
    for axes, entry in zip(panels, ENTRIES, strict=True):
        shown = [_draw_model(axes, *model, index, entry, word) for index, model in enumerate(compared)]
        _keep_scale(axes, shown, [curves for _, curves in compared])
    curves = [(handle, label) for handle, label in zip(*named(panels[0]), strict=True) if _BAND not in label]
    figure.legend(*zip(*curves, strict=True), loc="outside upper left", ncols=3)


def _draw_model(axes: Axes, label: str, curves: Curves, index: int, entry: str, word: str) -> Array:
    """Draw one model; give the values that must be seen in full."""
    curve = curves.name.index(word)
    angle, visited, values, low, high, rigid = _along(curves, curve, entry)
    style = style_of(index)
    band(axes, angle, low, high, color=style["color"], alpha=0.16, label=f"{_BAND} {label}")
    axes.plot(angle, values, label=label, **{**style, "linewidth": 1.6})
    if index == 0:
        axes.plot(angle, rigid, label="rigid body", **BASELINE)
    return np.concatenate([values, low[visited], high[visited]])


def _has_compared_curves(place: int, models: _Models) -> bool:
    return place < len(compared_curves(models))


COMPARED: Mapping[str, Drawn] = {
    "errors": Drawn(
        "Errors of the models and their rigid bodies, by part and axis", _errors_height, _draw_errors, compared_parts
    ),
    **{
        f"curves-{place + 1}": Drawn(
            f"Six entries of the inertia matrices of several models {word}",
            4.6,
            partial(_draw_compared_curves, place),
            partial(_has_compared_curves, place),
        )
        for place, word in enumerate(("over roll", "over pitch"))
    },
}
"""Figures of several identified models."""
