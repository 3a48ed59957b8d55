"""The torque or force of the channel with the largest gap: measured, simulated before and after."""

from __future__ import annotations

from matplotlib.figure import Figure

from cpfls_cli.pages.figures.before_after import BEFORE, MEASURED, keep_in_view, legend_over, marked
from cpfls_cli.pages.gap_words import channel_unit, channel_words
from cpfls_cli.pages.source import Source
from cpfls_cli.report.canvas import plain_ticks, plot
from cpfls_cli.report.content import Plot


def gap_picture_figure(name: str, diagnosis: Source, after: str) -> Plot:
    """Draw the channel with the largest gap over the stretch in which it is largest.

    Parameters
    ----------
    diagnosis : Source
        With a picture.
    after : str
        What the second model is, for the caption.
    """
    artifact = diagnosis.artifact
    channel = artifact.text("picture/channel")
    time, measured, before, later = (
        artifact.array(f"picture/{key}") for key in ("time", "measured", "before", "after")
    )

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        axes.plot(time, measured, label="measured", **MEASURED)
        axes.plot(time, before, label="simulated before", **BEFORE)
        axes.plot(time, later, label="simulated after", **marked(len(time)))
        keep_in_view(axes, (measured, later), before)
        plain_ticks(axes.yaxis)
        axes.set_ylabel(f"{channel_words(channel)}, {channel_unit(channel)}")
        axes.set_xlabel("time, s")
        legend_over(figure, axes)

    caption = (
        f"The {channel_words(channel)} of {artifact.text('picture/flight')} where its gap is largest, averaged over "
        f"smooth windows. Measured: what the measured motion takes; before: what the model as given provides; after: "
        f"{after}."
    )
    return plot(name, caption, f"{channel_words(channel)} over time, measured and simulated", 2.9, draw)
