"""Coefficients with their intervals inside the range that is physically possible."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cpfls_cli.pages.figures.before_after import AFTER
from cpfls_cli.pages.gap_words import unit_words
from cpfls_cli.pages.source import Source
from cpfls_cli.report.canvas import plot
from cpfls_cli.report.content import Plot
from cpfls_cli.report.numbers import number

_KEYS = ("value", "low", "high", "plausible_low", "plausible_high")


def intervals_figure(name: str, source: Source) -> Plot | None:
    """Draw where each coefficient lies between the least and the largest possible value.

    Parameters
    ----------
    source : Source
        A diagnosis or an extended model.

    Returns
    -------
    Plot or None
        None where no range is known.
    """
    artifact = source.artifact
    table = np.column_stack([artifact.array(f"coefficient/{key}") for key in _KEYS])
    with np.errstate(divide="ignore", invalid="ignore"):
        placed = (table - table[:, 3:4]) / (table[:, 4:5] - table[:, 3:4])
    shown = np.flatnonzero(np.isfinite(placed[:, [0, 3, 4]]).all(axis=1))
    if not len(shown):
        return None
    labels = zip(artifact.texts("coefficient/effect"), artifact.texts("coefficient/name"), strict=True)
    names = [f"{effect}  {coefficient}" for effect, coefficient in labels]
    units = [unit_words(unit) for unit in artifact.texts("coefficient/unit")]
    ranges = [f"{number(row[3], 3)} … {number(row[4], 3)} {unit}" for row, unit in zip(table, units, strict=True)]

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for row, place in enumerate(shown[::-1]):
            _draw_row(axes, row, placed[place])
        axes.set_yticks(range(len(shown)), [names[place] for place in shown[::-1]])
        _right_labels(axes, [ranges[place] for place in shown[::-1]])
        axes.set_xlim(-0.03, 1.03)
        axes.set_xticks([0.0, 1.0], ["least possible", "largest possible"])
        axes.grid(visible=False)

    caption = "Value (dot) and 95 % interval (bar) of each coefficient within the range that is physically possible."
    return plot(name, caption, "Coefficients within their possible ranges", 0.75 + 0.3 * len(shown), draw)


def _draw_row(axes: Axes, row: int, placed: np.ndarray) -> None:
    value, low, high = placed[:3]
    axes.hlines(row, 0.0, 1.0, color="#cccccc", linewidth=5, zorder=0)
    if np.isfinite(low) and np.isfinite(high):
        axes.hlines(row, np.clip(low, 0, 1), np.clip(high, 0, 1), color="black", linewidth=2.4, zorder=1)
    axes.plot([np.clip(value, 0.0, 1.0)], [row], "o", color=AFTER["color"], markersize=6, zorder=2)


def _right_labels(axes: Axes, labels: list[str]) -> None:
    right = axes.twinx()
    axes.set_ylim(-0.6, len(labels) - 0.4)
    right.set_ylim(axes.get_ylim())
    right.set_yticks(range(len(labels)), labels)
    right.tick_params(length=0)
    right.grid(visible=False)
