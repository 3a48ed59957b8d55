"""Curves of the inertia matrix over roll and over pitch, with their bands."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.dynamics.rigid_body import inertia_matrix
from cpfls_cli.fuzzy.inputs import wrap
from cpfls_cli.identification.data import TorqueSource
from cpfls_cli.identification.model import Model
from cpfls_cli.inertia import symmetric
from cpfls_cli.regressor.structure import PITCH, ROLL
from cpfls_cli.validation.bands import inertia_band
from cpfls_cli.validation.bootstrap import Draws

POINTS = 181

# A flight that stays within this range would be a speck on the whole turn.
_SMALL_RANGE = np.deg2rad(60.0)
_MARGIN_SHARE = 0.25
_SMALLEST_MARGIN = np.deg2rad(2.0)

# Of a long flight every so many samples are enough to say where it was.
_LOOKED_AT = 100_000


@dataclass(frozen=True)
class Curves:
    """D_ij(q) along curves of attitude.

    Attributes
    ----------
    name : tuple of str
        "over roll", "over pitch".
    attitude : array, shape (curves, points, 3), rad
    inertia : array, shape (curves, points, 3, 3), kg m^2
        Of the model.
    low, high : array, shape (curves, points, 3, 3), kg m^2
        Its 95 % band. Of a model without a rigid body below it is, where training was not, what the structure does, not
        what the vehicle does.
    rigid_body : array, shape (curves, points, 3, 3), kg m^2
        Of the rigid body that fits best.
    outside : array of bool, shape (curves, points)
        Where training was not.
    """

    name: tuple[str, ...]
    attitude: Array
    inertia: Array
    low: Array
    high: Array
    rigid_body: Array
    outside: BoolArray

    @property
    def relative_width(self) -> Array:
        """Widest band of D11, D22 and D33 over the value itself, where training was, shape (3,)."""
        of = np.diagonal(self.inertia, axis1=2, axis2=3)
        width = np.diagonal(self.high - self.low, axis1=2, axis2=3)
        ratio = np.divide(width, np.abs(of), out=np.full_like(width, np.inf), where=of != 0)
        return np.asarray(np.max(ratio[~self.outside], axis=0, initial=0.0))


def curves(model: Model, draws: Draws, best_rigid_body: Array, training: TorqueSource) -> Curves:
    """Evaluate a model over roll, at the median pitch of the training data, and over pitch, at their median roll.

    Each curve runs from -180 to 180 degrees; where training kept within 60 degrees, over what it visited and a quarter
    of that on both sides.

    Parameters
    ----------
    model : Model
    draws : Draws
    best_rigid_body : array, shape (6,), kg m^2
    training : TorqueSource
    """
    visited = _visited_angles(training)
    attitude = np.stack([_along(visited, angle) for angle in (ROLL, PITCH)])
    flat, shape = attitude.reshape(-1, 3), (*attitude.shape[:2], 3, 3)
    low, high = inertia_band(model, draws, flat)
    return Curves(
        name=("over roll", "over pitch"),
        attitude=attitude,
        inertia=model.inertia(flat).value.reshape(shape),
        low=low.reshape(shape),
        high=high.reshape(shape),
        rigid_body=inertia_matrix(flat, symmetric(best_rigid_body)).reshape(shape),
        outside=model.outside(flat).reshape(attitude.shape[:2]),
    )


def _visited_angles(training: TorqueSource) -> Array:
    """Roll and pitch at samples spread over the flight, shape (samples, 2)."""
    every = len(training) // _LOOKED_AT + 1
    return wrap(np.concatenate([data.motion.attitude[::every, :2] for data in training.chunks()]))


def _along(visited: Array, angle: int) -> Array:
    """Attitudes along a curve, shape (points, 3)."""
    attitude = np.zeros((POINTS, 3))
    attitude[:, :2] = np.median(visited, axis=0)
    attitude[:, angle] = np.linspace(*_ends(visited[:, angle]), POINTS)
    return attitude


def _ends(angle: Array) -> tuple[float, float]:
    lowest, highest = float(np.min(angle)), float(np.max(angle))
    if highest - lowest >= _SMALL_RANGE:
        return -np.pi, np.pi
    margin = max(_MARGIN_SHARE * (highest - lowest), _SMALLEST_MARGIN)
    return lowest - margin, highest + margin
