"""The inertia matrix of a model along a flight."""

from __future__ import annotations

from matplotlib.figure import Figure

from cpfls_cli.pages.figures.prediction import shade_outside
from cpfls_cli.pages.source import Source
from cpfls_cli.pages.uncertainty import MISFIT_WORDS, OUTSIDE_WORDS
from cpfls_cli.report.canvas import band, legend_above, line, plot, stacked, style_of
from cpfls_cli.report.content import Plot

_PANELS = (("D22", "D33"), ("D13", "D23"))


def inertia_figure(name: str, prediction: Source) -> Plot:
    """Draw the entries of D(q) that depend on attitude.

    References
    ----------
    Equations (14) and (15).
    """
    artifact = prediction.artifact
    time, inertia = artifact.array("time"), artifact.array("inertia")
    banded = {"inertia_low", "inertia_high"} <= set(artifact.data)

    def draw(figure: Figure) -> None:
        panels = stacked(figure, len(_PANELS))
        for axes, entries in zip(panels, _PANELS, strict=True):
            for index, entry in enumerate(entries):
                row, column = int(entry[1]) - 1, int(entry[2]) - 1
                line(axes, time, inertia[:, row, column], label=entry, **style_of(index))
                if banded:
                    ends = (artifact.array(f"inertia_{end}")[:, row, column] for end in ("low", "high"))
                    band(axes, time, *ends, color=style_of(index)["color"], alpha=0.22, label=f"95 % band of {entry}")
            shade_outside(axes, time, artifact.array("outside"))
            axes.set_ylabel("kg m²")
            legend_above(axes)
        panels[-1].set_xlabel("time, s")

    caption = (
        f"Entries of the inertia matrix D(q) of {prediction.input_name('model')} that depend on attitude, along "
        f"{prediction.input_name('flight')}{f', with 95 % bands. {OUTSIDE_WORDS} {MISFIT_WORDS}' if banded else '.'}"
    )
    return plot(name, caption, "Entries 22, 33, 13 and 23 of the inertia matrix over time", 3.8, draw)
