"""Autocorrelation of what is left, before and after: white is what noise is."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from cpfls_cli.pages.figures.before_after import BEFORE, by_channel, legend_over, marked
from cpfls_cli.pages.gap_words import known_channels
from cpfls_cli.pages.source import Source
from cpfls_cli.report.canvas import plot
from cpfls_cli.report.content import Plot

_BAND = 1.96


def whiteness_figure(name: str, diagnosis: Source) -> Plot:
    """Draw the autocorrelation of the gap by channel, with the band of white noise.

    Parameters
    ----------
    diagnosis : Source
        With whiteness.
    """
    artifact = diagnosis.artifact
    lag = artifact.array("whiteness/lag")
    channels = known_channels(diagnosis, "gap/before")
    band = _BAND / np.sqrt(max(_independent(diagnosis), 1.0))

    def draw(figure: Figure) -> None:
        panels = by_channel(figure, [channel for _, channel in channels], share_y=True)
        for axes, (index, _) in zip(panels, channels, strict=True):
            axes.axhspan(-band, band, color="#e6e6e6", label="white noise", zorder=0)
            axes.axhline(0.0, color="#999999", linewidth=0.7)
            axes.plot(lag, artifact.array("whiteness/before")[:, index], label="before", **BEFORE)
            axes.plot(lag, artifact.array("whiteness/after")[:, index], label="after", **marked(len(lag)))
            axes.set_ylim(-1.05, 1.05)
        panels[min(1, len(panels) - 1)].set_xlabel("" if len(panels) > 3 else "distance in time, s")
        if len(panels) > 3:
            panels[min(4, len(panels) - 1)].set_xlabel("distance in time, s")
        panels[0].set_ylabel("correlation")
        legend_over(figure, panels[0])

    caption = (
        "Correlation of the gap with itself some time later, on held-out flights. Noise stays within the grey band; "
        "a gap that keeps its sign for seconds has a cause."
    )
    rows = -(-len(channels) // 3)
    return plot(name, caption, "Autocorrelation of the gap before and after, by channel", 0.9 + 1.6 * rows, draw)


def _independent(diagnosis: Source) -> float:
    """Count the windows that share no sample."""
    artifact = diagnosis.artifact
    time = artifact.array("residual/time")
    steps = np.diff(time)
    hop = float(np.median(steps[steps > 0])) if (steps > 0).any() else 1.0
    return len(time) * hop / float(artifact.array("whiteness/lag")[0])
