"""Figure 7: the error of a model's torque along a flight, and the torques themselves."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cpfls_cli.arrays import Array
from cpfls_cli.pages.source import Source
from cpfls_cli.pages.uncertainty import MISFIT_WORDS, OUTSIDE_WORDS
from cpfls_cli.report.canvas import BASELINE, band, legend_above, line, plot, stacked, style_of
from cpfls_cli.report.content import Plot
from cpfls_cli.report.decimation import runs

AXES = ("roll", "pitch", "yaw")


def error_figure(name: str, prediction: Source) -> Plot:
    """Draw the torque error along a flight; samples outside the excited region are shaded.

    Parameters
    ----------
    prediction : Source
        With measured torque.

    References
    ----------
    Figure 7 of the paper.
    """
    artifact = prediction.artifact
    time, error = artifact.array("time"), artifact.array("error")

    def draw(figure: Figure) -> None:
        panels = stacked(figure, 3)
        for index, (axes, axis) in enumerate(zip(panels, AXES, strict=True)):
            line(axes, time, error[:, index], **style_of(0))
            shade_outside(axes, time, artifact.array("outside"))
            axes.set_title(f"error on {axis}")
            axes.set_ylabel("N m")
        panels[-1].set_xlabel("time, s")

    caption = f"Figure 7. Torque error (flight minus model) of {_pair(prediction)}.{_shaded(prediction)}"
    return plot(name, caption, "Torque error on roll, pitch and yaw over time", 4.6, draw)


def torques_figure(name: str, prediction: Source) -> Plot:
    """Draw the torque of the model over the torque of the flight."""
    artifact = prediction.artifact
    time, model = artifact.array("time"), artifact.array("torque")
    banded = {"torque_low", "torque_high"} <= set(artifact.data)
    measured = artifact.array("measured_torque") if "measured_torque" in artifact.data else None

    def draw(figure: Figure) -> None:
        panels = stacked(figure, 3)
        for index, (axes, axis) in enumerate(zip(panels, AXES, strict=True)):
            if banded:
                ends = (artifact.array(f"torque_{end}")[:, index] for end in ("low", "high"))
                band(axes, time, *ends, color=style_of(0)["color"], alpha=0.25, label="95 % band of the model")
            line(axes, time, model[:, index], label="model", **style_of(0))
            if measured is not None:
                line(axes, time, measured[:, index], label="flight", **BASELINE)
            shade_outside(axes, time, artifact.array("outside"))
            axes.set_title(f"torque on {axis}", loc="left" if index else "right")
            axes.set_ylabel("N m")
        legend_above(panels[0])
        panels[-1].set_xlabel("time, s")

    told = ", with the 95 % band of the prediction; a measured torque has its own noise beside it" if banded else ""
    words = f" {OUTSIDE_WORDS} {MISFIT_WORDS}" if banded else ""
    caption = f"Generalised torque of {_pair(prediction)}{told}.{_shaded(prediction)}{words}"
    return plot(name, caption, "Torque of the model and of the flight over time", 4.8, draw)


def shade_outside(axes: Axes, time: Array, outside: Array) -> None:
    """Shade the samples whose attitude the training data never visited.

    Parameters
    ----------
    time, outside : array, shape (samples,)
    """
    half = 0.5 * float(np.median(np.diff(time))) if len(time) > 1 else 0.5
    spans = [(time[first] - half, time[last] - time[first] + 2 * half) for first, last in runs(outside)]
    if spans:
        axes.broken_barh(
            spans, (0.0, 1.0), transform=axes.get_xaxis_transform(), facecolor="#f3d9b8", edgecolor="none", zorder=0
        )


def _pair(prediction: Source) -> str:
    return f"{prediction.input_name('model')} along {prediction.input_name('flight')}"


def _shaded(prediction: Source) -> str:
    outside = prediction.artifact.array("outside")
    share = int(np.sum(outside != 0))
    return f" Shaded: {share} of {len(outside)} samples outside the region that training visited." if share else ""
