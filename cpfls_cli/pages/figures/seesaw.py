"""Figure 1: the seesaw that makes an angle an input."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from cpfls_cli.fuzzy.inputs import seesaw
from cpfls_cli.pages.printed import PRINTED_SEESAW
from cpfls_cli.report.canvas import line, plot, style_of
from cpfls_cli.report.content import Plot


def seesaw_figure(name: str) -> Plot:
    """Draw the piecewise linear seesaw over two turns, with the values that the paper prints.

    References
    ----------
    Figure 1 and equation (11) of the paper.
    """
    half_turns = np.linspace(-1.0, 3.0, 801)

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        line(axes, half_turns, seesaw(np.pi * half_turns)[0], **style_of(0))
        axes.plot(list(PRINTED_SEESAW), list(PRINTED_SEESAW.values()), "o", color=style_of(1)["color"])
        axes.set_xlabel("angle, π rad")
        axes.set_ylabel("seesaw")

    caption = (
        "Figure 1. The seesaw of equation (11) over two turns: equal where an angle and 2π meet. Dots: the values that "
        "the equation prints at the quarters of a turn. It takes each value twice in a turn."
    )
    return plot(name, caption, "A triangle wave between -1 and 1 over two turns", 2.3, draw)
