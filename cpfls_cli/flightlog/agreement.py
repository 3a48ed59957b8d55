"""Signals of a log held against each other: which axes, signs, units and frames let them agree."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import permutations, product
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.flightlog.repair import align_quaternion_signs
from cpfls_cli.flightlog.smoothing import derivative, low_pass
from cpfls_cli.rounding import largest
from cpfls_cli.units import STANDARD_GRAVITY

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

_FILTER_ORDER = 2
_EDGE_S = 0.5  # At both ends, where the filter settles, s.
# Below which rates are compared: between two sensors with clocks of their own a few ten ms do not matter there.
SLOW_HZ = 3.0
# Below which an acceleration over ground is compared with the lean: a position derived twice is full of noise.
_TILT_HZ = 1.0
_RISES = 0.4  # Correlation with the lift from which on a vertical axis follows it.
_AS_NAMED_IS_GOOD_ENOUGH = 0.02  # Share that other axes may explain more by noise alone.
# Share that other axes than named have to explain, and how many times less they have to leave.
_CLEARLY, _TIMES_BETTER = 0.6, 2.0
# Share of the spread of the axis that moves most below which another hardly moves: its sign is that of noise.
_STILL = 1e-3
_MOVES_RAD_S = 0.03  # Rate below which noise and drift of an attitude are as large as its motion.

Order = tuple[int, ...]
Sign = tuple[float, ...]
# Order and signs of three axes that are what they are called.
AS_NAMED: Final[tuple[Order, Sign]] = ((0, 1, 2), (1.0, 1.0, 1.0))
_SIGNED_AXES: Final = tuple(product(permutations((0, 1, 2)), product((1.0, -1.0), repeat=3)))


def handed(order: Sequence[int], sign: Sequence[float]) -> float:
    """Give 1 for axes that are right-handed, -1 for others."""
    return float(np.round(np.linalg.det(np.eye(3)[list(order)])) * np.prod(sign))


class AxisFit(NamedTuple):
    """How the axes of a measured vector lie to those of a reference."""

    order: Order  # Which measured column is x, y and z of the reference.
    sign: Sign  # Of those columns, in that order.
    gain: float  # Measured over reference.
    explained: float  # Share of the measured vector's square that the reference explains.
    times_better: float  # How many times smaller the unexplained part is than that of the next best axes.
    as_named: float  # The share that the axes in their order, with a plus, explain.
    # Correlation with the reference along each of its axes, in that order and with those signs; nan where one of the
    # two does not move.
    along: Sequence[float]

    @property
    def is_as_named(self) -> bool:
        """Whether the axes are in their order, with a plus."""
        return (self.order, self.sign) == AS_NAMED


def fit_axes(reference: Array, measured: Array) -> AxisFit:
    """Find the order and the signs of axes with which one vector follows another, both shape (time, 3), filtered alike.

    They are as named where that is as good as the best, within 0.02 of explained share, or where an axis does not move:
    with one or two axes, a turn and a mirrored column look alike.
    """
    reference, measured = reference - reference.mean(axis=0), measured - measured.mean(axis=0)
    cross = measured.T @ reference
    power, total = float((reference**2).sum()), float((measured**2).sum())
    if power == 0.0 or total == 0.0:
        return AxisFit(*AS_NAMED, float("nan"), 0.0, 0.0, 0.0, (float("nan"),) * 3)
    together = {
        (order, sign): sum(sign[axis] * cross[order[axis], axis] for axis in range(3)) for order, sign in _SIGNED_AXES
    }
    explained = {axes: float(max(value, 0.0) ** 2 / (power * total)) for axes, value in together.items()}
    # An axis that does not move fits as well with either sign.
    best = largest(explained, lambda axes: explained[axes])
    # Other axes than the names say have to be clearly better.
    clearly = explained[best] > _CLEARLY and 1 - explained[best] < (1 - explained[AS_NAMED]) / _TIMES_BETTER
    moving = _all_move(reference) and _all_move(measured)
    if not (moving and clearly) or explained[AS_NAMED] >= explained[best] - _AS_NAMED_IS_GOOD_ENOUGH:
        best = AS_NAMED
    runner_up = max(value for axes, value in explained.items() if axes != best)
    # Noise in the reference makes the regression's gain small, that of the spreads does not.
    gain = float(np.sqrt(total / power)) if explained[best] > 0.2 else float(together[best] / power)
    order, sign = best
    sizes = np.sqrt((reference**2).sum(axis=0) * (measured**2).sum(axis=0)[list(order)])
    along = [float(sign[i] * cross[order[i], i] / sizes[i]) if sizes[i] > 0 else float("nan") for i in range(3)]
    times_better = float(np.sqrt(max(1 - runner_up, 1e-9) / max(1 - explained[best], 1e-9)))
    return AxisFit(order, sign, gain, explained[best], times_better, explained[AS_NAMED], along)


def _all_move(vectors: Array) -> bool:
    spread = vectors.std(axis=0)
    return bool(spread.min() > _STILL * spread.max())


def correlations(first: Array, second: Array) -> Array:
    """Correlate columns with columns, shape (time, column) both; 0 where one of the two does not move."""
    first, second = first - first.mean(axis=0), second - second.mean(axis=0)
    size = np.sqrt((first**2).sum(axis=0) * (second**2).sum(axis=0))
    return np.asarray((first * second).sum(axis=0) / np.where(size > 0, size, np.inf))


def slow(values: Array, rate_hz: float, cutoff_hz: float = SLOW_HZ) -> Array:
    """Low-pass both ways, and leave the ends out."""
    filtered = low_pass(values, rate_hz, min(cutoff_hz, rate_hz / 5), _FILTER_ORDER)
    edge = min(round(_EDGE_S * rate_hz), len(filtered) // 5)
    return filtered[edge : len(filtered) - edge]


def rotations_of(quaternion: Array, order: str, inverse: bool = False) -> Rotation:
    """Make rotations of quaternions, of body to world; `inverse` where the log has them from world to body."""
    from scipy.spatial.transform import Rotation

    rotation = Rotation.from_quat(np.roll(quaternion, -1, axis=1) if order == "wxyz" else quaternion)
    return rotation.inv() if inverse else rotation


def on_clock(rotation: Rotation, time: Array, clock: Array) -> Rotation:
    """Interpolate rotations to a clock, near enough for the comparison of slow motion."""
    quaternion = align_quaternion_signs(np.asarray(rotation.as_quat()))
    return type(rotation).from_quat(np.column_stack([np.interp(clock, time, column) for column in quaternion.T]))


def body_rate_from(rotation: Rotation, rate_hz: float) -> Array:
    """Derive body rates, shape (time, 3), rad/s, from rotations of the body on a uniform clock, the last repeated."""
    steps = (rotation[:-1].inv() * rotation[1:]).as_rotvec() * rate_hz
    return np.vstack([steps, steps[-1:]])


def turning_of(rotation: Rotation, rate_hz: float) -> Array | None:
    """Derive what is slow of the body rates, shape (time, 3), rad/s; None where the vehicle hardly turns."""
    derived = slow(body_rate_from(rotation, rate_hz), rate_hz)
    return None if float(np.sqrt((derived.var(axis=0)).sum())) < _MOVES_RAD_S else derived


class LeanFit(NamedTuple):
    """How the acceleration over ground follows the lean of a body."""

    # By (order, sign); Share of the acceleration that the lean explains, if these columns of the position with these
    # signs are the first two axes of the attitude's world, and the thrust points along the body's third axis.
    shares: Mapping[tuple[tuple[int, int], tuple[float, float]], float]
    # 1 where the position's third column grows with the lift, -1 where it falls, 0 where that is not clear.
    rises: float
    gain: float  # Acceleration over what the lean makes of gravity, 1 where the units agree.

    @property
    def explained(self) -> float:
        """The largest of the shares."""
        return max(self.shares.values())


class Ground(NamedTuple):
    """What is slow of an acceleration over ground, in any unit."""

    horizontal: Array  # Shape (time, 2)
    vertical: Array  # Shape (time,)

    @classmethod
    def of(cls, acceleration: Array, rate_hz: float) -> Ground:
        """Filter the second derivative of a position, shape (time, 3)."""
        return cls(slow(acceleration[:, :2], rate_hz, _TILT_HZ), slow(acceleration[:, 2:3], rate_hz)[:, 0])


def fit_lean(rotation: Rotation, moving: Ground, rate_hz: float, lift: Array | None = None) -> LeanFit:
    """Hold the acceleration over ground against the lean of a body in every order and with every sign of the columns.

    A multirotor accelerates where its thrust leans: over the ground by ``g b_xy / b_z`` with the direction b of thrust
    in the world, which is the body's third axis where that points up and its opposite where it points down. What moves
    along one axis alone, such as an airplane in a plane, explains nothing. The lift, if known, grows with the thrust.
    """
    axis = rotation.as_matrix()[:, :, 2]
    lean = slow(STANDARD_GRAVITY * axis[:, :2] / np.maximum(np.abs(axis[:, 2:]), 0.2), rate_hz, _TILT_HZ)
    lean, ground = lean - lean.mean(axis=0), moving.horizontal - moving.horizontal.mean(axis=0)
    power, total = float((lean**2).sum()), float((ground**2).sum())
    cross, moves = ground.T @ lean, _all_move(lean) and _all_move(ground)
    shares: dict[tuple[tuple[int, int], tuple[float, float]], float] = {}
    for order in ((0, 1), (1, 0)):
        for first, second in product((1.0, -1.0), repeat=2):
            together = float(first * cross[order[0], 0] + second * cross[order[1], 1])
            shares[(order, (first, second))] = max(together, 0.0) ** 2 / (power * total) if moves else 0.0
    rises = 0.0
    if lift is not None:
        lifted = slow((lift * np.abs(axis[:, 2]))[:, None], rate_hz)
        together = float(correlations(moving.vertical[:, None], lifted)[0])
        rises = float(np.sign(together)) if abs(together) > _RISES else 0.0
    return LeanFit(shares, rises, float(np.sqrt(total / power)) if power else float("nan"))


def second_derivative(values: Array, rate_hz: float) -> Array:
    """Differentiate twice what is slow of a signal on a uniform clock."""
    return first_derivative(first_derivative(values, rate_hz), rate_hz)


def first_derivative(values: Array, rate_hz: float) -> Array:
    """Differentiate what is slow of a signal on a uniform clock."""
    time = np.arange(len(values)) / rate_hz
    return derivative(time, low_pass(values, rate_hz, min(2 * SLOW_HZ, rate_hz / 5), _FILTER_ORDER))
