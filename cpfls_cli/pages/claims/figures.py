"""The figures of the paper, each with what its text says of it in numbers."""

from __future__ import annotations

from cpfls_cli.pages.claims.compared import ComparedFigure
from cpfls_cli.pages.claims.model_figures import error_compared, partitions_compared, reduction_compared
from cpfls_cli.pages.claims.motion_figures import (
    attitude_compared,
    derivatives_compared,
    seesaw_compared,
    torque_compared,
)
from cpfls_cli.pages.source import Sources


def compared_figures(sources: Sources) -> list[ComparedFigure]:
    """Hold the figures of a report against what the paper's text says of its own.

    Returns
    -------
    list of ComparedFigure
        Figures 1 to 7.
    """
    of_sources = (
        derivatives_compared,
        attitude_compared,
        torque_compared,
        reduction_compared,
    )
    shown = [compare(sources) for compare in of_sources]
    return [seesaw_compared(), *shown, partitions_compared(), error_compared(sources)]
