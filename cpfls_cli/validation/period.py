"""Errors one period away from the data: a periodic model makes none there that it does not make here."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.identification.data import TorqueSource
from cpfls_cli.identification.judge import score_of
from cpfls_cli.identification.model import Model
from cpfls_cli.regressor.motion import Motion

_AWAY = 2 * np.pi * np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])


@dataclass(frozen=True)
class PeriodErrors:
    """Torque errors one period away, by part and Euler axis.

    Attributes
    ----------
    parts : tuple of str
    mse : array, shape (part, 3), (N m)^2
        Mean squared error; the worse of one turn in roll and one turn back in pitch.
    max_error : array, shape (part, 3), N m
        Largest absolute error; likewise.
    """

    parts: tuple[str, ...]
    mse: Array
    max_error: Array


def one_period_away(model: Model, parts: Mapping[str, TorqueSource]) -> PeriodErrors | None:
    """Judge a model with roll one turn on, and with pitch one turn back, against the same torque.

    Parameters
    ----------
    model : Model
    parts : mapping of str to TorqueSource
        By name.

    Returns
    -------
    PeriodErrors or None
        None where the inputs of the model are not those of the full circle.
    """
    if model.structure.settings.input_map != "full-circle":
        return None
    scores = [[score_of(data, _moved(model, shift)) for shift in _AWAY] for data in parts.values()]
    return PeriodErrors(
        parts=tuple(parts),
        mse=np.max([[score.mse for score in both] for both in scores], axis=1),
        max_error=np.max([[score.max_error for score in both] for both in scores], axis=1),
    )


def _moved(model: Model, shift: Array) -> Callable[[Motion], Array]:
    return lambda motion: model.torque(replace(motion, attitude=motion.attitude + shift))
