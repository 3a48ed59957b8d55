"""When an evolution has reached its end."""

from __future__ import annotations

from typing import Literal

import numpy as np

from cpfls_cli.evolution.history import History
from cpfls_cli.evolution.settings import EvolutionSettings
from cpfls_cli.evolution.state import EvolutionState

End = Literal["generations", "converged"]


def ended(state: EvolutionState, settings: EvolutionSettings) -> End | None:
    """Tell whether an evolution has reached its end.

    Returns
    -------
    {"generations", "converged"} or None
        None where another generation is to be bred.
    """
    if state.index >= settings.generations:
        return "generations"
    return "converged" if stalled(state.history, settings.stall_generations, settings.stall_improvement) else None


def stalled(history: History, generations: int | None, improvement: float) -> bool:
    """Tell whether the best of no objective improved enough over the last generations.

    ``best_before - best_now <= improvement * |best_before|`` for every objective.

    Parameters
    ----------
    history : History
    generations : int or None
        Generations looked back; never stalled if None.
    improvement : float
        Relative improvement that is not enough.

    Returns
    -------
    bool
        False while the history is shorter. An objective that got its first finite value improved.
    """
    if generations is None or len(history) <= generations:
        return False
    before, now = history.best[-1 - generations], history.best[-1]
    known = np.isfinite(before)
    if np.any(np.isfinite(now[~known])):
        return False
    return bool(np.all(before[known] - now[known] <= improvement * np.abs(before[known])))
