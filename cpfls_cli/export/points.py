"""States with what the library computes there, which an export carries to test itself."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.dynamics.equations_of_motion import coriolis_matrix
from cpfls_cli.dynamics.rigid_body import body_torque
from cpfls_cli.identification.model import Model
from cpfls_cli.identification.visited import CELLS
from cpfls_cli.inertia import symmetric
from cpfls_cli.regressor.motion import Motion
from cpfls_cli.regressor.regressor import InertiaValues, Regressor

POINTS = 8
_RATE, _ACCELERATION = 3.0, 10.0
_UPRIGHT = 0.2


@dataclass(frozen=True)
class Expected:
    """What a model gives along a motion.

    Attributes
    ----------
    inertia, coriolis : array, shape (samples, 3, 3)
    torque, body : array, shape (samples, 3), N m
    inside : array of bool, shape (samples,)
    scale : array, shape (samples, 4)
        Sizes of the terms that D, C, torque and body torque are sums of: what their rounding errors are relative to.
    """

    motion: Motion
    inertia: Array
    coriolis: Array
    torque: Array
    body: Array
    inside: BoolArray
    scale: Array

    def __len__(self) -> int:
        """Count the samples."""
        return len(self.motion)


def expected(model: Model, motion: Motion) -> Expected:
    """Compute what an export has to give along a motion.

    Returns
    -------
    Expected
        The torque of the rigid body is computed about the body axes, where it is finite at every attitude.
    """
    q, qd, qdd = motion.attitude, motion.rate, motion.acceleration
    inertia, fuzzy = model.inertia(q), _fuzzy_torque(model, motion)
    rigid = body_torque(q, qd, qdd, symmetric(model.rigid_body))
    return Expected(
        motion,
        inertia.value,
        coriolis_matrix(inertia, qd),
        model.torque(motion),
        rigid + rotations.body_torque(q, fuzzy),
        ~model.outside(q),
        _scale(inertia, motion, bool(fuzzy.any())),
    )


def _fuzzy_torque(model: Model, motion: Motion) -> Array:
    return Regressor(model.structure, motion, model.ranges).torque(model.partitions, model.coefficients)


def _scale(inertia: InertiaValues, motion: Motion, fuzzy: bool) -> Array:
    samples = len(motion)
    size, slope = (np.abs(a).reshape(samples, -1).max(axis=1) for a in (inertia.value, inertia.gradient))
    speed, push = (np.abs(a).max(axis=1) for a in (motion.rate, motion.acceleration))
    torque = size * push + slope * speed**2
    upright = np.abs(np.cos(motion.attitude[:, 1])) if fuzzy else np.ones(samples)
    scale = np.column_stack([size, slope * speed, torque, torque / upright])
    return np.where(scale > 0.0, scale, 1.0)


def reference_points(model: Model, rng: np.random.Generator) -> Expected:
    """Draw a few states, half of them where training went, and compute what the model gives there.

    Returns
    -------
    Expected
        In the middle of cells, away from a vertical pitch, so that single precision agrees as well.
    """
    centres = (np.arange(CELLS) + 0.5) * (2.0 * np.pi / CELLS) - np.pi
    upright = np.abs(np.cos(centres)) > _UPRIGHT
    cells = list(_cells(model.visited & upright, rng)) + list(_cells(np.broadcast_to(upright, (CELLS, CELLS)), rng))
    places = np.array(cells[-POINTS:])
    attitude = np.column_stack([centres[places], rng.uniform(-np.pi, np.pi, POINTS)])
    attitude[0, :2] += 2.0 * np.pi
    rate = rng.uniform(-_RATE, _RATE, (POINTS, 3))
    return expected(model, Motion(attitude, rate, rng.uniform(-_ACCELERATION, _ACCELERATION, (POINTS, 3))))


def _cells(allowed: BoolArray, rng: np.random.Generator) -> Iterator[tuple[int, int]]:
    places = np.argwhere(allowed)
    for index in rng.permutation(len(places))[:POINTS]:
        yield int(places[index, 0]), int(places[index, 1])
