"""How the balance moves with the shapes of the chosen effects: their columns beside those of the coefficients."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.gap.balance.balance_system import System, system
from cpfls_cli.gap.balance.weak_flight import Candidate

_STEP = 1e-3


def free_shapes(hypothesis: System) -> list[tuple[Candidate, str]]:
    """List the shapes of a hypothesis in the order of its effects.

    Returns
    -------
    list of (Candidate, str)
    """
    return [(candidate, shape.name) for candidate in hypothesis.chosen for shape in candidate.effect.shapes]


def shape_columns(hypothesis: System, linear: Array) -> Array:
    """Differentiate what the hypothesis explains by each of its shapes, by central differences.

    Parameters
    ----------
    hypothesis : System
    linear : array, shape (column,)
        Coefficients of the base, held.

    Returns
    -------
    array, shape (window, 6, shape)
    """
    shapes = free_shapes(hypothesis)
    columns = np.zeros((*hypothesis.residual.shape, len(shapes)))
    for place, (candidate, name) in enumerate(shapes):
        value = candidate.shape[name]
        step = _STEP * (abs(value) or 1.0)
        ahead, behind = (_left(hypothesis, linear, candidate, name, value + s) for s in (step, -step))
        columns[..., place] = (behind - ahead) / (2 * step)
    return columns


def _left(hypothesis: System, linear: Array, moved: Candidate, name: str, value: float) -> Array:
    chosen = [Candidate(c.effect, {**c.shape, name: value}) if c is moved else c for c in hypothesis.chosen]
    there = system(hypothesis.flights, chosen)
    return np.asarray(there.residual - there.base @ linear)
