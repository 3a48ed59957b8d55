"""The gyroscope judged by the attitude: bias, scale, misalignment and delay, by kinematics in weak form."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.linalg import polar

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.blocks import block_length, jackknife_error
from cpfls_cli.effects.hooks import FaultFit
from cpfls_cli.effects.signals import Signals
from cpfls_cli.flightlog.repair import align_quaternion_signs
from cpfls_cli.lag import fit_delay
from cpfls_cli.rotations import attitude_rate, body_rate
from cpfls_cli.weak_form.windows import Windows, blocks_of, folds

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

FEWEST_BLOCKS = 7  # Blocks below which a jackknife says too little about significance of one in a thousand.
# Short flights are cut into so many blocks, but into none that knows its neighbour.
_WANTED_BLOCKS, _SHORTEST_BLOCK_S = 8, 1.5
# Between delays that are tried, and Gauss-Newton steps from the best: the last one changes nothing.
_SCAN_STEP_S, _ROUNDS = 0.005, 4
# A rate about an axis counts as excited from this multiple of the residual variance; below it, noise of the
# gyroscope would pull its scale by more than a tenth.
_EXCITED = 10.0
# Gain, 1/s, and its standard errors, from which on an attitude is levelled: no estimator takes longer than 100 s.
_LEVELS, _SURELY = 0.01, 5.0
_MOST = 3.0  # Standard errors that next to nothing exceeds.
_NUMBERS = {"bias": slice(0, 3), "scale": slice(3, 6), "misalignment": slice(6, 9), "delay": slice(12, 13)}
LONGEST_DELAY_S = 0.1
"""Longest shift between gyroscope and attitude that is looked for, s; a log beyond that is broken, not late."""


@dataclass(frozen=True)
class Kinematics:
    """Windows of one flight, ``d/dt r = 1/2 (r0 omega + r x omega)`` with r relative to the middle of the window.

    The equation keeps its form under any fixed rotation of r, so noise of the middle sample does not enter.
    """

    # Shape (window, 3), rad/s: averages of the rate that the attitude shows, body axes at the middle of the window;
    # nothing is differentiated.
    rate: Array
    # Shape (window, sample, 3, 3): ``phi dt (r0 1 + [r]x)``, which turns a rate along the window into those axes.
    turning: Array
    level: Array  # Shape (window, 3): the same of what an estimator levels its attitude by, for a unit of its gain.
    time: Array  # Shape (window, sample), s.
    gyro: "CubicSpline"  # Body rate over time; through smooth windows its interpolation error is nothing.

    @property
    def centres(self) -> Array:
        """Middle of each window, shape (window,), s."""
        return np.asarray(self.time.mean(axis=1))

    def gyro_rate(self, delay: float) -> Array:
        """Average the rate of a gyroscope that is late by a delay in s, shape (window, 3), rad/s."""
        read = self.gyro(self.time + delay).reshape(len(self.time), -1)
        return np.asarray(np.einsum("wak,wk->wa", self._turning_rows, read))

    @cached_property
    def _turning_rows(self) -> Array:
        """Rows that a whole rate along the window is multiplied with, shape (window, 3, 3 sample)."""
        return np.moveaxis(self.turning, 1, 2).reshape(len(self.turning), 3, -1)

    def products(self, delay: float, order: int = 0) -> Array:
        """Average each reading, put on each axis; the columns of a matrix on the gyroscope.

        `delay`: s; `order`: 1 for the derivative of the reading; Result: shape (window, 3, to, from), rad/s or rad/s^2.
        """
        turning = np.moveaxis(self.turning, 1, 3)
        averages = turning.reshape(len(turning), 9, -1) @ self.gyro(self.time + delay, order)
        return np.asarray(averages.reshape(-1, 3, 3, 3))

    def constants(self) -> Array:
        """Average a constant about each axis, shape (window, 3, 3)."""
        return np.asarray(self.turning.sum(axis=1))


def kinematics(signals: Signals, windows: Windows) -> Kinematics | None:
    """Cut a flight with attitude into windows, clear of its ends by the longest delay; None for too short a one.

    What the logging of one of the two averages is averaged in the other, too.
    """
    from scipy.interpolate import CubicSpline
    from scipy.spatial.transform import Rotation

    of_attitude, of_gyro = signals.attitude_spans, signals.body_rate_spans
    margin = int(np.ceil((LONGEST_DELAY_S + 0.5 * max(sum(of_attitude), sum(of_gyro))) / windows.period))
    inside = slice(margin, len(signals) - margin)
    length = len(windows.weight)
    if len(signals) - 2 * margin < length or signals.attitude is None:
        return None
    # At an overlap of three quarters the windows add up to a constant, so attitude noise cancels between neighbours.
    hop = max(1, length // 4)
    turned = align_quaternion_signs(Rotation.from_euler("ZYX", signals.attitude[:, ::-1]).as_quat())
    if of_gyro:
        turned = _averaged(CubicSpline(signals.time, turned), of_gyro)(signals.time)
        turned /= np.linalg.norm(turned, axis=1, keepdims=True)
    relative = _relative(np.moveaxis(sliding_window_view(turned[inside], length, axis=0)[::hop], 1, 2))
    time = sliding_window_view(signals.time[inside], length)[::hop]
    rate = -2 * np.einsum("wsi,s->wi", relative[..., :3], windows.slope)
    x, y, z, scalar = np.moveaxis(relative, -1, 0)
    turning = np.stack([scalar, -z, y, z, scalar, -x, -y, x, scalar], axis=-1).reshape(*relative.shape[:-1], 3, 3)
    weighted = turning * windows.weight[:, None, None]
    gyro = CubicSpline(signals.time, signals.body_rate)
    if of_attitude:
        # Angles are what is averaged: in fast turns body axes are others after an update.
        gyro = _averaged(CubicSpline(signals.time, attitude_rate(signals.attitude, signals.body_rate)), of_attitude)
        gyro = CubicSpline(gyro.x, body_rate(signals.attitude[np.isin(signals.time, gyro.x)], gyro(gyro.x)))
    level = sliding_window_view(_levelling(signals)[inside], length, axis=0)[::hop]
    return Kinematics(rate, weighted, np.einsum("wsab,wbs->wa", weighted, level), np.asarray(time), gyro)


def _levelling(signals: Signals) -> Array:
    """Compute the turn, shape (time, 3), by which an estimator levels its attitude, for a unit of its gain.

    It takes what the accelerometer feels for the vertical: in flight about the axis of the thrust. So the attitude
    follows ``omega + k (f / |f|) x R' e_z``; it leads by ``k / frequency^2``, which looks like a late gyroscope.
    Reference: Mahony et al. 2008 (explicit complementary filter).
    """
    if signals.specific_force is None:
        x, y, _ = signals.rotation[:, 2].T
        return np.stack([-y, x, np.zeros_like(x)], axis=1)
    felt = np.linalg.norm(signals.specific_force, axis=1, keepdims=True)
    along = signals.specific_force / np.maximum(felt, np.finfo(float).tiny)
    return np.asarray(np.cross(along, signals.rotation[:, 2]))


def _averaged(values: "CubicSpline", spans: Sequence[float]) -> "CubicSpline":
    """Average values over spans of time, s, one after another, each around its middle; the ends lose half of them."""
    from scipy.interpolate import CubicSpline

    for span in spans:
        whole = values.antiderivative()
        time = values.x[(values.x >= values.x[0] + 0.5 * span) & (values.x <= values.x[-1] - 0.5 * span)]
        values = CubicSpline(time, (whole(time + 0.5 * span) - whole(time - 0.5 * span)) / span)
    return values


def _relative(turned: Array) -> Array:
    """Take quaternions (x, y, z, scalar) relative to the middle of their window."""
    vector, scalar = turned[..., :3], turned[..., 3:]
    middle = turned[:, [turned.shape[1] // 2]]
    conjugate, known = -middle[..., :3], middle[..., 3:]
    product = known * vector + scalar * conjugate + np.cross(conjugate, vector)
    rest = known * scalar - (conjugate * vector).sum(axis=-1, keepdims=True)
    return np.concatenate([product, rest], axis=-1)


@dataclass(frozen=True)
class DelayScan:
    """The delay at which the readings as they are fit best."""

    delay: float  # Positive where the gyroscope is delayed, s; Gauss-Newton steps refine it.
    variance: Array  # Shape (3,), rad^2/s^2: left about each axis.
    excited: BoolArray  # Shape (3,): axes that turn enough to identify a scale.
    seen: Array  # Shape (window, 3), rad/s: averages of the rate by the attitude.
    read: Array  # Shape (window, 3), rad/s: the same by the gyroscope at that delay.


def scan(flights: Sequence[Kinematics]) -> DelayScan:
    """Scan the delay between gyroscope and attitude."""
    step = max(float(flights[0].time[0, 1] - flights[0].time[0, 0]), _SCAN_STEP_S)
    half = int(LONGEST_DELAY_S / step)
    seen = np.concatenate([flight.rate for flight in flights])

    def moved(delay: float) -> tuple[Array, Array]:
        # Any matrix on the readings, so that a swapped axis does not shift the delay.
        return np.broadcast_to(_read(flights, delay)[:, None], (*seen.shape, 3)), seen

    whole = np.zeros(len(seen), dtype=np.int64)
    delay = float(fit_delay(np.linspace(-half, half, 2 * half + 1) * step, moved, whole).delay)
    read = _read(flights, delay)
    variance = np.maximum((seen - read).var(axis=0), np.finfo(float).eps ** 2)
    # The variance of each rate that the other two do not share.
    alone = 1.0 / np.diag(_precision(read))
    return DelayScan(delay, variance, alone > _EXCITED * variance, seen, read)


def _read(flights: Sequence[Kinematics], delay: float) -> Array:
    return np.concatenate([flight.gyro_rate(delay) for flight in flights])


def _precision(read: Array) -> Array:
    """Invert the covariance of three rates, of which some may never change."""
    return np.asarray(np.linalg.inv(np.cov(read.T) + 1e-12 * np.eye(3)))


@dataclass(frozen=True)
class GyroFit:
    """``omega_gyro(t) = (1 + scale + cross) C(misalignment) omega(t - delay) + bias``, estimated."""

    # Shape (14,): bias (3, rad/s), scale (3), misalignment (3, rad), symmetric cross-axis (yz, zx, xy), delay (s), gain
    # by which the attitude is levelled (1/s). The misalignment is the rotation of the gyroscope against the attitude, a
    # rotation vector in body axes.
    value: Array
    error: Array  # Shape (14,): standard errors by the jackknife over blocks.
    # Shape (14,): how far noise of the gyroscope, or levelling that is left out, can have pulled the value at most.
    pull: Array
    known: BoolArray  # Shape (14,): what the motion identifies.
    blocks: int
    variance: Array  # Shape (3,), rad^2/s^2: left about each axis.
    flight_bias: Array  # Shape (flight, 3), rad/s: bias of each flight less that of all.
    flight_bias_error: Array  # Shape (flight, 3), rad/s.

    def of(self, name: str) -> FaultFit:
        """Select the numbers of one kind of fault: bias, scale, misalignment or delay."""
        numbers = _NUMBERS[name]
        return FaultFit(self.value[numbers], self.error[numbers], self.pull[numbers], self.known[numbers], self.blocks)


def fit_gyro(flights: Sequence[Kinematics], scanned: DelayScan) -> GyroFit | None:
    """Regress the rate by the attitude on the gyroscope, and invert the result.

    The gyroscope is the cleaner side, hence the reverse regression ``omega(t) = M omega_gyro(t + delay) - c``; its
    noise still pulls M by at most ``variance left / variance of the rate``, which is reported. The delay is a column
    with the derivative of the reading, refined by Gauss-Newton steps.

    An estimator that levels its attitude by the accelerometer makes it lead, most in slow motion, where a delay shows
    least. Where that is significant it is fitted jointly; elsewhere the delay may be off by what it would change.

    None where there are too few blocks. Nothing is known where only some of them rotate.
    Reference: Frisch 1934 (bounds of regression with noise on both sides); Hausman 1978 (what is left out).
    """
    index = np.repeat(np.arange(len(flights)), [len(flight.rate) for flight in flights])
    whole = sum(float(np.ptp(flight.centres)) for flight in flights)
    length_s = block_length(whole, shortest=_SHORTEST_BLOCK_S, wanted=_WANTED_BLOCKS)
    block = blocks_of(index, np.concatenate([flight.centres for flight in flights]), length_s)
    if block.max() + 1 < FEWEST_BLOCKS:
        return None
    plain = _regressed(flights, scanned, index, block, levels=False)
    levelled = _regressed(flights, scanned, index, block, levels=bool(scanned.excited.any()))
    if levelled.value[13] > max(_LEVELS, _SURELY * levelled.error[13]):
        return levelled
    # Levelling that is left out shifts the delay by about that, whose variance is the difference of both.
    unsure = max(0.0, levelled.error[12] ** 2 - plain.error[12] ** 2) ** 0.5
    plain.pull[12] = abs(levelled.value[12] - plain.value[12]) + _MOST * unsure
    return plain


def _regressed(
    flights: Sequence[Kinematics], scanned: DelayScan, index: IntArray, block: IntArray, *, levels: bool
) -> GyroFit:
    """Fit all numbers; `index`, `block`, shape (window,): number of the flight and of the block of each window."""
    excited = scanned.excited
    others = [excited.any(), levels]
    # Axes that turn, and the delay if any does.
    columns = np.flatnonzero(np.concatenate([np.tile(excited, 3), np.ones(3, dtype=bool), others]))
    matrix, delay, variance = np.eye(3), scanned.delay, scanned.variance
    for _ in range(_ROUNDS):
        design, right = _design(flights, matrix, delay), scanned.seen - _read(flights, delay)
        normal = folds(design / np.sqrt(variance)[:, None], right / np.sqrt(variance), block)
        solution = _padded(normal.fit(columns)[0][None, :, 0], columns)[0]
        rest = right - design @ solution
        base, variance = delay, np.maximum(rest.var(axis=0), np.finfo(float).eps ** 2)
        matrix = np.eye(3) + solution[:9].reshape(3, 3)
        delay = float(np.clip(base + solution[12], -LONGEST_DELAY_S, LONGEST_DELAY_S))
    left_out = _padded(normal.solve(columns)[0][..., 0], columns)
    # Where a flight hardly turns, noise mirrors axes.
    matrices = np.eye(3) + np.vstack([solution, left_out])[:, :9].reshape(-1, 3, 3)
    turns = bool((np.linalg.det(matrices) > 0).all())
    draws = np.array([_faults(each, base) if turns else each for each in left_out])
    across = np.array([excited[1] & excited[2], excited[2] & excited[0], excited[0] & excited[1]])
    bias, error = _flight_bias(rest, index, block)
    return GyroFit(
        value=_faults(solution, base) if turns else np.zeros_like(solution),
        error=jackknife_error(draws),
        pull=_pull(scanned.read, variance),
        known=np.concatenate([np.ones(3, dtype=bool), excited, across, across, others]) & turns,
        blocks=len(draws),
        variance=variance,
        flight_bias=bias,
        flight_bias_error=error,
    )


def _design(flights: Sequence[Kinematics], matrix: Array, delay: float) -> Array:
    parts = []
    for flight in flights:
        later = np.einsum("waij,ij->wa", flight.products(delay, 1), matrix)
        products = flight.products(delay).reshape(-1, 3, 9)
        parts.append(np.concatenate([products, -flight.constants(), later[..., None], flight.level[..., None]], axis=2))
    return np.concatenate(parts)


def _padded(solutions: Array, columns: IntArray) -> Array:
    whole = np.zeros((len(solutions), 14))
    whole[:, columns] = solutions
    return whole


def _faults(solution: Array, base: float) -> Array:
    """Invert ``M, c`` to faults; the left polar form separates scale and cross-axis from rotation exactly."""
    from scipy.spatial.transform import Rotation

    inverse = np.linalg.inv(np.eye(3) + solution[:9].reshape(3, 3))
    turned, stretched = polar(inverse, side="left")
    misalignment = -Rotation.from_matrix(turned).as_rotvec()
    cross = [stretched[1, 2], stretched[2, 0], stretched[0, 1]]
    bias, scale = inverse @ solution[9:12], np.diag(stretched) - 1
    return np.concatenate([bias, scale, misalignment, cross, [base + solution[12]], solution[13:]])


def _pull(read: Array, variance: Array) -> Array:
    pull = variance[:, None] * np.abs(_precision(read))
    both = 0.5 * (pull + pull.T)
    across = np.array([both[1, 2], both[2, 0], both[0, 1]])
    return np.concatenate([np.zeros(3), np.diag(pull), across, across, [0.0, 0.0]])


def _flight_bias(rest: Array, index: IntArray, block: IntArray) -> tuple[Array, Array]:
    """Give the bias that each flight has of its own, and its standard error by the scatter of its blocks."""
    means = np.array([-rest[block == b].mean(axis=0) for b in range(block.max() + 1)])
    flights, owner = np.unique([index[block == b][0] for b in range(block.max() + 1)], return_inverse=True)
    flight_mean = np.array([means[owner == flight].mean(axis=0) for flight in range(len(flights))])
    spread = np.sqrt(((means - flight_mean[owner]) ** 2).sum(axis=0))
    count = np.bincount(owner)[:, None]
    return flight_mean, spread / np.sqrt(max(1, len(means) - len(flight_mean))) / np.sqrt(count)
