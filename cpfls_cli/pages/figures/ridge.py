"""The ridge curve: cross-validated error over the weight that holds the fuzzy part."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cpfls_cli.arrays import Array
from cpfls_cli.pages.source import Source
from cpfls_cli.report.canvas import legend_above, plain_ticks, plot, style_of
from cpfls_cli.report.content import Plot
from cpfls_cli.report.numbers import number

_DECADE = 10.0


def ridge_figure(name: str, model: Source) -> Plot:
    """Draw the cross-validated error with its standard error; the last point has no fuzzy part at all.

    References
    ----------
    method.md section 8.
    """
    weight, error = model.artifact.array("ridge/weight"), model.artifact.array("ridge/error")
    deviation = model.artifact.array("ridge/standard_error")
    chosen = _chosen(weight, model.artifact.number("model/ridge_weight"))
    place = _places(weight)

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        style = {"color": style_of(0)["color"], "markersize": 4, "capsize": 3, "linewidth": 1.2}
        axes.errorbar(place, error, deviation, fmt="o-", label="error ± one standard error", **style)
        axes.plot(
            [place[chosen]],
            [error[chosen]],
            "D",
            color=style_of(1)["color"],
            markersize=10,
            markerfacecolor="none",
            markeredgewidth=2,
            label="chosen",
        )
        axes.set_xscale("log")
        _scale(axes, error)
        last = len(weight) - 1
        shown = [*range(0, last - 1, max(last // 6, 1)), last]
        axes.set_xticks(place[shown], [_word(weight[index]) for index in shown])
        axes.minorticks_off()
        axes.set_xlabel("ridge weight on the fuzzy part")
        axes.set_ylabel("cross-validated error, scaled torque²")
        legend_above(axes)

    caption = (
        f"Ridge curve of {model.label}: error on blocks of the training flight that were left out in turn. The last "
        "point is the rigid body alone (fuzzy part off). The largest weight within one standard error of the best is "
        "taken."
    )
    return plot(name, caption, "Cross-validated error over the ridge weight, the chosen weight marked", 3.0, draw)


def _chosen(weight: Array, value: float) -> int:
    if np.isinf(value):
        return len(weight) - 1
    finite = np.where(np.isfinite(weight), weight, np.finfo(float).max)
    return int(np.argmin(np.abs(finite - value)))


def _scale(axes: Axes, error: Array) -> None:
    """Take a logarithmic scale where errors differ by more than a decade."""
    if error.min() > 0 and error.max() > _DECADE * error.min():
        axes.set_yscale("log", nonpositive="clip")
    else:
        plain_ticks(axes.yaxis)


def _places(weight: Array) -> Array:
    """Put the point without a fuzzy part a decade beyond the largest weight."""
    finite = weight[np.isfinite(weight)]
    return np.where(np.isfinite(weight), weight, 10.0 * finite.max(initial=1e-9))


def _word(weight: float) -> str:
    return "fuzzy part off" if np.isinf(weight) else number(weight, 1)
