"""Figure 5: the condition number while samples are selected."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cpfls_cli.arrays import Array
from cpfls_cli.report.canvas import BASELINE, legend_above, plot, style_of
from cpfls_cli.report.content import Plot
from cpfls_cli.report.source import Source


def reduction_figure(name: str, selections: Sequence[Source]) -> Plot:
    """Draw condition number and extreme singular values after each selected sample.

    Parameters
    ----------
    selections : sequence of Source
        Selections from one flight.

    References
    ----------
    Figure 5 of the paper.
    """

    def draw(figure: Figure) -> None:
        upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
        for index, selection in enumerate(selections):
            _draw_condition(upper, selection, index)
            _draw_singular_values(lower, selection, index)
        for value in sorted({s.artifact.number("condition_number_full") for s in selections}):
            upper.axhline(value, label=f"full set, {value:.0f}", **BASELINE)
        upper.set_ylabel("condition number")
        lower.set_ylabel("singular value")
        lower.set_xlabel("selected samples")
        for axes in (upper, lower):
            axes.set_yscale("log")
            legend_above(axes, columns=2)

    caption = (
        f"Figure 5. Condition number (above) and smallest and largest singular value (below) after each sample taken "
        f"from {selections[0].input_name('flight')}. The curve begins where the selection reaches full rank; a cross "
        "is the median of random choices of equal size."
    )
    return plot(name, caption, "Condition number over the number of selected samples, on a log scale", 5.0, draw)


def _draw_condition(axes: Axes, selection: Source, index: int) -> None:
    trace = selection.artifact.array("trace/condition_number")
    deficient = selection.artifact.number("rank") < selection.artifact.number("rank_full")
    label = f"{selection.artifact.text('criterion')}, {len(trace)} samples{', rank deficient' if deficient else ''}"
    known = np.where(np.isfinite(trace), trace, np.nan)
    axes.plot(_numbers(trace), known, label=label, **style_of(index))
    random = float(np.median(selection.artifact.array("random/condition_number")))
    if np.isfinite(random):
        word = "random choice" if index == 0 else None
        axes.plot([len(trace)], [random], "x", color=style_of(index)["color"], markersize=7, label=word)


def _draw_singular_values(axes: Axes, selection: Source, index: int) -> None:
    colour = style_of(index)["color"]
    for which, word, dashes in (("max", "largest", "-"), ("min", "smallest", (0, (4, 1.5)))):
        values = selection.artifact.array(f"trace/singular_value_{which}")
        shown = np.where(values > 0, values, np.nan)
        label = word if index == 0 else None
        axes.plot(_numbers(values), shown, color=colour, linestyle=dashes, label=label)


def _numbers(trace: Array) -> Array:
    return np.arange(1, len(trace) + 1, dtype=float)
