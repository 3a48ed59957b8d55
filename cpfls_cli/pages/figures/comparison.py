"""Models beside each other: their inertia over attitude."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cpfls_cli.pages.figures.inertia_curves import ENTRIES, MISFIT_WORDS, OUTSIDE_WORDS, entry_of, keep_scale
from cpfls_cli.pages.source import Source
from cpfls_cli.report.canvas import BASELINE, band, plain_ticks, plot, style_of
from cpfls_cli.report.content import Plot

_COLUMNS = 3
_BAND = "95 % band of"


def compared_curves_figure(name: str, models: Sequence[Source], word: str) -> Plot:
    """Draw the six entries of D(q) of several models along their curves of one name.

    Parameters
    ----------
    models : sequence of Source
        With curves of that name.
    word : str
        "over roll" or "over pitch".
    """
    largest = max(float(np.abs(model.artifact.array("curves/inertia")).max(initial=1e-12)) for model in models)

    def draw(figure: Figure) -> None:
        grid = figure.subplots(len(ENTRIES) // _COLUMNS, _COLUMNS, sharex=True)
        for axes, entry in zip(grid.flat, ENTRIES, strict=True):
            shown = [_draw_model(axes, model, index, entry, word) for index, model in enumerate(models)]
            keep_scale(axes, shown, largest)
            axes.set_title(entry)
            plain_ticks(axes.yaxis)
        grid[-1, 1].set_xlabel(f"{word.removeprefix('over ')}, °")
        figure.supylabel("kg m²", fontsize=9.5)
        handles, labels = grid[0, 0].get_legend_handles_labels()
        shown_labels = [(handle, label) for handle, label in zip(handles, labels, strict=True) if _BAND not in label]
        figure.legend(*zip(*shown_labels, strict=True), loc="outside upper left", ncols=3)

    caption = (
        f"D(q) of {', '.join(model.label for model in models)} {word}, each with its 95 % band, along the attitudes "
        "that its own training visited; grey: the rigid body that fits best to the first. Where two bands part, the "
        f"flights tell the models apart. {OUTSIDE_WORDS} {MISFIT_WORDS}"
    )
    return plot(name, caption, f"Six entries of the inertia matrices of several models {word}", 4.6, draw)


def _draw_model(axes: Axes, model: Source, index: int, entry: str, word: str) -> np.ndarray:
    """Draw one model; give the values that must be seen in full."""
    artifact = model.artifact
    curve = artifact.texts("curves/name").index(word)
    attitude = np.degrees(artifact.array("curves/attitude")[curve])
    angle = attitude[:, int(np.argmax(np.ptp(attitude, axis=0)))]
    keys = ("inertia", "low", "high", "rigid_body")
    values, low, high, rigid = (entry_of(artifact.array(f"curves/{key}")[curve], entry) for key in keys)
    visited = artifact.array("curves/outside")[curve] == 0
    style = style_of(index)
    band(axes, angle, low, high, color=style["color"], alpha=0.16, label=f"{_BAND} {model.label}")
    axes.plot(angle, values, label=model.label, **{**style, "linewidth": 1.6})
    if index == 0:
        axes.plot(angle, rigid, label="rigid body", **BASELINE)
    return np.concatenate([values, low[visited], high[visited]])
