"""Excitation by the training data: fired rules, and what explains each axis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.dynamics.rigid_body import rigid_columns, vertical
from cpfls_cli.identification.data import TorqueData, TorqueSource, axis_scale
from cpfls_cli.identification.judge import VarianceExplained
from cpfls_cli.identification.least_squares import Triangle
from cpfls_cli.identification.samples import Samples
from cpfls_cli.identification.solver import regressor_blocks
from cpfls_cli.regressor.motion import RIGID
from cpfls_cli.regressor.regressor import Breakpoints
from cpfls_cli.result import about
from cpfls_cli.rotations import body_acceleration, body_torque, euler_rate_matrix

# A rule that never fires by more adds nothing to a torque; half of its directions known are a surface, if a rough one.
_SILENT_FIRING, _DETERMINED_SHARE = 1e-3, 0.5
# Standard deviations beyond which a rate is clearly on one side of its mean, so that noise does not count.
_CLEARLY = 0.5


@dataclass(frozen=True, eq=False)
class RuleExcitation:
    """Excitation of each rule by data."""

    name: tuple[str, ...] = about("inertia function and rule", "rule")
    firing: Array = about("largest firing strength in training", "rule")
    determined: Array = about("share of the rule's coefficients that data determine", "rule")

    @property
    def excited(self) -> BoolArray:
        """Whether a rule fires at all and data determine at least half of its coefficients."""
        return np.asarray((self.firing > _SILENT_FIRING) & (self.determined >= _DETERMINED_SHARE))


def rule_excitation(
    learned: Samples, partitions: Breakpoints, noise: float, inertia: float, rank_tolerance: float
) -> RuleExcitation:
    """Measure how far samples excite each rule.

    A direction of the coefficients counts as determined where noise in the torque (root mean square of what no model
    explains, N m) moves it by less than the inertia itself (a typical moment, kg m^2): its singular value is above
    noise over inertia, and above the rank tolerance.
    """
    blocks, singular_values, Vt = learned.structure.blocks, *_decomposed(learned, partitions)
    floor = max(rank_tolerance * singular_values[0], noise / inertia if inertia > 0 else 0.0)
    share = np.sum(Vt[singular_values > floor] ** 2, axis=0)
    names = [f"{block.function.name} rule {rule + 1}" for block in blocks for rule in range(block.rules)]
    determined = [np.mean(share[block.columns].reshape(block.rules, block.features), axis=1) for block in blocks]
    return RuleExcitation(tuple(names), _firing(learned, partitions), np.concatenate(determined))


def _decomposed(learned: Samples, partitions: Breakpoints) -> tuple[Array, Array]:
    """Singular values and right singular vectors of the fuzzy columns alone."""
    rows = (
        (regressor.matrix(partitions).reshape(-1, learned.structure.parameters), data.torque.reshape(-1))
        for data, regressor in regressor_blocks(learned)
    )
    _, singular_values, Vt = linalg.svd(Triangle.of(rows).matrix[:, :-1], full_matrices=False, check_finite=False)
    return singular_values, Vt


def _firing(learned: Samples, partitions: Breakpoints) -> Array:
    """Largest firing strength of every rule over the samples."""
    blocks = range(len(learned.structure.blocks))
    strongest = [
        np.concatenate([np.max(regressor.firing(index, partitions), axis=0) for index in blocks])
        for _, regressor in regressor_blocks(learned)
    ]
    return np.asarray(np.max(strongest, axis=0))


@dataclass(frozen=True)
class AxisEvidence:
    """Share of each body axis that a rigid body and a constant torque explain, where the pitch is not vertical.

    `constant`: body torque fitted jointly with the rigid body, N m; `r2`: share of the body torque explained by both,
    NaN without samples; `torque` and `acceleration`: root mean squares of it, N m, and of the derivative of the body
    rates, rad/s^2.
    """

    constant: Array
    r2: Array
    torque: Array
    acceleration: Array


def axis_evidence(source: TorqueSource, rank_tolerance: float) -> AxisEvidence:
    """Fit six inertia parameters and a constant body torque, and measure what they explain of each axis."""
    scale = 1.0 / axis_scale(source)
    rows = ((_columns(data) * scale[:, None], data.torque * scale) for data in source.chunks())
    triangle = Triangle.of((columns.reshape(-1, columns.shape[2]), torque.reshape(-1)) for columns, torque in rows)
    parameters = triangle.solve(rank_tolerance).coefficients
    explained, count, torque, acceleration = VarianceExplained(), 0, np.zeros(3), np.zeros(3)
    for data in source.chunks():
        motion, known = data.motion, ~vertical(data.motion.attitude)
        by_both = _columns(data) @ parameters
        measured, predicted = (body_torque(motion.attitude[known], values[known]) for values in (data.torque, by_both))
        explained.add(measured, measured - predicted)
        count, torque = count + len(measured), torque + np.sum(measured**2, axis=0)
        acceleration += np.sum(body_acceleration(motion.attitude, motion.rate, motion.acceleration) ** 2, axis=0)
    size = np.sqrt([torque / max(count, 1), acceleration / len(source)])
    return AxisEvidence(parameters[RIGID:], explained.r2, size[0], size[1])


def _columns(data: TorqueData) -> Array:
    """Columns of six inertia parameters and three constant body torques, shape (samples, 3, 9)."""
    constant = euler_rate_matrix(data.motion.attitude).swapaxes(1, 2)
    return np.concatenate([rigid_columns(data.motion), constant], axis=2)


@dataclass(frozen=True)
class Swings:
    """How often a flight turns round: its seconds, and changes of direction of the Euler rates by axis."""

    seconds: float
    by_axis: IntArray


def swings(source: TorqueSource) -> Swings:
    """Count how often each Euler rate goes from clearly above its mean to clearly below, or back.

    Clearly is half a standard deviation, so that noise does not count. A signal of bandwidth B holds about 2 B T
    independent numbers in the time T, and one of a narrow band crosses its mean as often.
    """
    count, total, squares = 0, np.zeros(3), np.zeros(3)
    for data in source.chunks():
        rate = data.motion.rate
        count, total, squares = count + len(data), total + rate.sum(axis=0), squares + np.sum(rate**2, axis=0)
    mean = total / count
    clearly = _CLEARLY * np.sqrt(np.maximum(squares / count - mean**2, 0.0))
    found, side, seconds = np.zeros(3, dtype=np.int64), np.zeros(3), 0.0
    for data in source.chunks():
        seconds += float(data.time[-1] - data.time[0]) * len(data) / max(1, len(data) - 1)
        for axis, rate in enumerate((data.motion.rate - mean).T):
            sides = np.concatenate([side[axis : axis + 1], np.sign(rate[np.abs(rate) > clearly[axis]])])
            sides = sides[sides != 0]
            found[axis] += int((np.diff(sides) != 0).sum())
            side[axis] = sides[-1] if len(sides) else 0.0
    return Swings(seconds, found)
