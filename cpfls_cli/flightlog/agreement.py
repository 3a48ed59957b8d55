"""Signals of a log held against each other: which axes, signs, units and frames let them agree."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations, product
from typing import Final

import numpy as np
from scipy.spatial.transform import Rotation

from cpfls_cli.arrays import Array
from cpfls_cli.flightlog.repair import align_quaternion_signs
from cpfls_cli.flightlog.smoothing import derivative, low_pass
from cpfls_cli.units import STANDARD_GRAVITY

_FILTER_ORDER = 2
_EDGE_S = 0.5
SLOW_HZ = 3.0
"""Below which rates are compared: between two sensors with clocks of their own a few ten ms do not matter there."""

_TILT_HZ = 1.0
_RISES = 0.4
_AS_NAMED_IS_GOOD_ENOUGH = 0.02
_CLEARLY, _TIMES_BETTER = 0.6, 2.0
_MOVES_RAD_S = 0.03


@dataclass(frozen=True)
class AxisFit:
    """How the axes of a measured vector lie to those of a reference.

    Attributes
    ----------
    order : tuple of int
        Which measured column is x, y and z of the reference.
    sign : tuple of float
        Of those columns, in that order.
    gain : float
        Measured over reference.
    explained : float
        Share of the measured vector's square that the reference explains.
    runner_up : float
        The same of the next best axes.
    as_named : float
        The same of the axes in their order, with a plus.
    """

    order: tuple[int, int, int]
    sign: tuple[float, float, float]
    gain: float
    explained: float
    runner_up: float
    as_named: float

    @property
    def is_as_named(self) -> bool:
        """Whether the axes are in their order, with a plus."""
        return self.order == (0, 1, 2) and self.sign == (1.0, 1.0, 1.0)

    @property
    def times_better(self) -> float:
        """How many times smaller the unexplained part is than that of the next best axes."""
        return float(np.sqrt(max(1 - self.runner_up, 1e-9) / max(1 - self.explained, 1e-9)))


_SIGNED_AXES: Final = tuple(
    (order, sign) for order in permutations((0, 1, 2)) for sign in product((1.0, -1.0), repeat=3)
)


def fit_axes(reference: Array, measured: Array) -> AxisFit:
    """Find the order and the signs of axes with which one vector follows another.

    Parameters
    ----------
    reference, measured : array, shape (time, 3)
        Filtered alike.

    Returns
    -------
    AxisFit
        As named where that is as good as the best, within 0.02 of explained share: axes that hardly move say nothing.
    """
    reference = reference - reference.mean(axis=0)
    measured = measured - measured.mean(axis=0)
    cross = measured.T @ reference
    power = float((reference**2).sum())
    total = float((measured**2).sum())
    if power == 0.0 or total == 0.0:
        return AxisFit((0, 1, 2), (1.0, 1.0, 1.0), float("nan"), 0.0, 0.0, 0.0)
    together = {
        (order, sign): sum(sign[axis] * cross[order[axis], axis] for axis in range(3)) for order, sign in _SIGNED_AXES
    }
    explained = {axes: max(value, 0.0) ** 2 / (power * total) for axes, value in together.items()}
    named = ((0, 1, 2), (1.0, 1.0, 1.0))
    best = max(explained, key=lambda axes: explained[axes])
    runner_up = max(value for axes, value in explained.items() if axes != best)
    # Other axes than the names say have to be clearly better.
    clearly = explained[best] > _CLEARLY and 1 - explained[best] < (1 - explained[named]) / _TIMES_BETTER
    if not clearly or explained[named] >= explained[best] - _AS_NAMED_IS_GOOD_ENOUGH:
        best = named
        runner_up = max(value for axes, value in explained.items() if axes != best)
    # Noise in the reference makes the regression's gain small, that of the spreads does not.
    gain = float(np.sqrt(total / power)) if explained[best] > 0.2 else together[best] / power
    order, sign = best
    return AxisFit(
        (order[0], order[1], order[2]),
        (sign[0], sign[1], sign[2]),
        float(gain),
        float(explained[best]),
        float(runner_up),
        float(explained[named]),
    )


def slow(values: Array, rate_hz: float, cutoff_hz: float = SLOW_HZ) -> Array:
    """Low-pass both ways, and leave the ends out."""
    cutoff_hz = min(cutoff_hz, rate_hz / 5)
    filtered = low_pass(values, rate_hz, cutoff_hz, _FILTER_ORDER)
    edge = min(round(_EDGE_S * rate_hz), len(filtered) // 5)
    return filtered[edge : len(filtered) - edge]


def rotations_of(quaternion: Array, order: str, inverse: bool = False) -> Rotation:
    """Make rotations of quaternions, of body to world; `inverse` where the log has them from world to body."""
    scalar_last = np.roll(quaternion, -1, axis=1) if order == "wxyz" else quaternion
    rotation = Rotation.from_quat(scalar_last)
    return rotation.inv() if inverse else rotation


def on_clock(rotation: Rotation, time: Array, clock: Array) -> Rotation:
    """Interpolate rotations to a clock, near enough for the comparison of slow motion."""
    quaternion = align_quaternion_signs(np.asarray(rotation.as_quat()))
    columns = np.column_stack([np.interp(clock, time, column) for column in quaternion.T])
    return Rotation.from_quat(columns)


def body_rate_from(rotation: Rotation, rate_hz: float) -> Array:
    """Derive body rates from rotations on a uniform clock.

    Returns
    -------
    array, shape (time, 3), rad/s
        In the body frame of the rotations; the last one stands twice.
    """
    steps = (rotation[:-1].inv() * rotation[1:]).as_rotvec() * rate_hz
    return np.vstack([steps, steps[-1:]])


def fit_rates(rotation: Rotation, measured: Array, rate_hz: float) -> AxisFit | None:
    """Hold a gyroscope against the derivative of an attitude; None where the vehicle hardly turns.

    Parameters
    ----------
    measured : array, shape (time, 3)
        In any unit.
    """
    derived = slow(body_rate_from(rotation, rate_hz), rate_hz)
    if float(np.sqrt((derived.var(axis=0)).sum())) < _MOVES_RAD_S:
        return None
    return fit_axes(derived, slow(measured, rate_hz))


@dataclass(frozen=True)
class TiltFit:
    """How the acceleration over ground follows the tilt of a body.

    Attributes
    ----------
    body : {"FLU", "FRD"}
        Whether the body's third axis points up or down.
    order : tuple of int
        Which column of the position is the first and the second axis of the attitude's world.
    sign : tuple of float
        Of those columns and of the third.
    gain : float
        Acceleration over what the tilt makes of gravity, 1 where the units agree.
    explained, runner_up : float
        Share of the acceleration that the tilt explains, and that of the next best frames.
    """

    body: str
    order: tuple[int, int]
    sign: tuple[float, float, float]
    gain: float
    explained: float
    runner_up: float


def fit_tilt(rotation: Rotation, acceleration: Array, rate_hz: float, lift: Array | None = None) -> TiltFit:
    """Find out from tilt and acceleration whether body z points up or down, and how the world's axes lie.

    A multirotor accelerates where its thrust leans: over the ground by ``g b_xy / b_z`` with the direction b of thrust
    in the world, which is the body's third axis where that points up and its opposite where it points down.

    Parameters
    ----------
    acceleration : array, shape (time, 3)
        Second derivative of the position, in any unit.
    lift : array, shape (time,), or None
        What grows with the thrust: with it the position's third axis is known to point up or down, and a body that
        looks like another one in a world that is turned round is told from that.
    """
    axis = rotation.as_matrix()[:, :, 2]
    upright = np.where(np.abs(axis[:, 2:]) < 0.2, 0.2, axis[:, 2:])
    lean = slow(STANDARD_GRAVITY * axis[:, :2] / np.abs(upright), rate_hz, _TILT_HZ)
    ground = slow(acceleration[:, :2], rate_hz, _TILT_HZ)
    lean, ground = lean - lean.mean(axis=0), ground - ground.mean(axis=0)
    power, total = float((lean**2).sum()), float((ground**2).sum())
    cross = ground.T @ lean
    results = {}
    for body, up in (("FLU", 1.0), ("FRD", -1.0)):
        for order in ((0, 1), (1, 0)):
            for sign in product((1.0, -1.0), repeat=2):
                handed = sign[0] * sign[1] * (1.0 if order == (0, 1) else -1.0)
                together = up * sum(sign[i] * cross[order[i], i] for i in range(2))
                results[(body, order, (*sign, handed))] = together
    rises = 0.0 if lift is None else _rises(axis[:, 2], acceleration[:, 2], lift * np.abs(axis[:, 2]), rate_hz)
    if rises:
        # The attitude's third axis of the world points up where that of the body does, as the vehicle is level.
        results = {key: own for key, own in results.items() if rises * key[2][2] == (1.0 if key[0] == "FLU" else -1.0)}
    scale = power * total
    explained = {key: (max(value, 0.0) ** 2 / scale if scale else 0.0) for key, value in results.items()}
    # A turn of the world by half a turn looks like the other body frame: of the two the one as named is taken.
    best = max(explained, key=lambda key: (round(explained[key], 2), key[1] == (0, 1), sum(key[2][:2])))
    others = [value for key, value in explained.items() if explained[key] < explained[best] - 1e-9]
    body, order, sign = best
    return TiltFit(
        body,
        (order[0], order[1]),
        (sign[0], sign[1], sign[2]),
        float(np.sqrt(total / power)) if power else float("nan"),
        float(explained[best]),
        float(max(others, default=0.0)),
    )


def _rises(upright: Array, vertical: Array, lift: Array, rate_hz: float) -> float:
    """Tell whether what the position's third axis shows grows (1) or falls (-1) with the lift; 0 if neither."""
    own, other = (slow(values[:, None], rate_hz)[:, 0] for values in (vertical, lift))
    if own.std() == 0 or other.std() == 0:
        return 0.0
    together = float(np.corrcoef(own, other)[0, 1])
    return float(np.sign(together) * np.sign(np.median(upright))) if abs(together) > _RISES else 0.0


def second_derivative(values: Array, rate_hz: float) -> Array:
    """Differentiate twice what is slow of a signal on a uniform clock."""
    return first_derivative(first_derivative(values, rate_hz), rate_hz)


def first_derivative(values: Array, rate_hz: float) -> Array:
    """Differentiate what is slow of a signal on a uniform clock."""
    time = np.arange(len(values)) / rate_hz
    return derivative(time, low_pass(values, rate_hz, min(2 * SLOW_HZ, rate_hz / 5), _FILTER_ORDER))
