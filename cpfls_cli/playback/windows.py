"""Free runs in windows of a flight, all windows side by side, and their derivatives by the numbers of the vehicle.

A state is position (world), velocity (world), rotation (body to world) and body rate, in components, runs last. Between
two samples the rotors are constant, and one step of the midpoint rule is taken:

    R' = R [omega]_x,   m v' = m g + R F,   L' = M - omega x L,   L = I omega.

Torque and force follow from the vehicle itself (`cpfls_cli.vehicle.motion`): on arrays for the runs, and on numbers
with derivatives at all states that the runs passed, which are then composed step by step.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.playback.motion import FASTEST, Body, MeasuredMotion
from cpfls_cli.vehicle.motion import Instant, Vehicle
from cpfls_cli.vehicle.values import ARRAYS, Tangent, Value, Vector, add, zero

_SAMPLES = 2_000
"""States at a time of which derivatives are taken, so that they stay in the cache."""

MOST_RUNS = 1_200
"""Runs side by side."""

MOTION = 6
"""Places of the derivatives by the motion that a wrench depends on, air velocity and body rate; numbers follow."""

STATES = 9
"""Components of the derivatives of a state: velocity, rotation as a vector in the body frame, body rate."""


class Turned(NamedTuple):
    """How bodies turn in the states of runs.

    Attributes
    ----------
    rate : array, shape (3, run), rad/s
        That has the momentum.
    direct : array, shape (3, run), N m
        Torque that the motion takes beyond the change of momentum.
    exists : array of bool, shape (run,)
        False where no body has the inertia.
    """

    rate: Array
    direct: Array
    exists: BoolArray


class Turning(NamedTuple):
    """An inertia that depends on the attitude.

    Attributes
    ----------
    momentum : callable
        From rotations and rates, shapes (3, 3, run) and (3, run), to momenta.
    turned : callable
        From rotations and momenta.
    """

    momentum: Callable[[Array, Array], Array]
    turned: Callable[[Array, Array], Turned]


@dataclass(frozen=True)
class Flown:
    """A vehicle that runs fly.

    Attributes
    ----------
    vehicle : Vehicle
        What acts on it; its numbers may have derivatives, by places from `MOTION` on.
    body : Body
        What is moved.
    inertia_by : array, shape (number, 3, 3), kg m^2
        Derivatives of the inertia by each number; without rows for nothing but runs.
    log_mass : int or None
        Place of the number that is the logarithm of the mass, if any.
    drag_scale : value
        Ratio of the drag factors that effects share to those stated.
    turning : Turning or None
        In the place of a constant inertia.
    traced : callable or None
        Torque and force of the same vehicle as one function of air velocity, body rate, speeds, accelerations and slow
        squares, which takes a part of the time.
    """

    vehicle: Vehicle
    body: Body
    inertia_by: Array = field(default_factory=lambda: np.zeros((0, 3, 3)))
    log_mass: int | None = None
    drag_scale: Value = 1
    turning: Turning | None = None
    traced: Callable[[Vector, Vector, Value, Value, Value], tuple[Vector, Vector]] | None = None

    @cached_property
    def _at_rest(self) -> Instant:
        still = np.zeros((len(self.vehicle.settings.rotors), 1))
        at = Instant(self.vehicle.settings, still, drag_scale=self.drag_scale, functions=ARRAYS)
        # Worked out here once for all states that follow.
        assert at.hubs
        assert np.any(at.spins)
        return at

    def wrench(self, air: Vector, rate: Vector, rotors: Rotors) -> tuple[Vector, Vector]:
        """Compute torque and force, N m and N, body frame, without weight."""
        if self.traced is None:
            torque, force = self.vehicle.wrench(self._instant(air, rate, rotors))
        else:
            torque, force = self.traced(air, rate, *rotors[:3])
        push = rotors.push
        return (torque, force) if push is None else (add(torque, push[:3]), add(force, push[3:]))

    def wrench_by_part(self, air: Vector, rate: Vector, rotors: Rotors) -> dict[str, Vector]:
        """Compute torque and force of each part alone, six components by name."""
        return self.vehicle.wrench_by_part(self._instant(air, rate, rotors))

    def _instant(self, air: Vector, rate: Vector, rotors: Rotors) -> Instant:
        return self._at_rest.moved(
            rotor_speed=rotors.speed,
            rotor_acceleration=rotors.acceleration,
            slow_square=rotors.slow_square,
            air_velocity=air,
            body_rate=rate,
        )


class Rotors(NamedTuple):
    """What drives runs over steps.

    Attributes
    ----------
    speed, acceleration, slow_square : value by rotor, arrays of shape (rotor, ...)
        rad/s, rad/s^2, rad^2/s^2.
    push : vector of 6 or None
        Torque and force on top of what the vehicle gives, N m and N, body frame.
    """

    speed: Value
    acceleration: Value
    slow_square: Value
    push: Vector | None = None

    @classmethod
    def of(cls, terms: Array, terms_by: Mapping[int, Array] = {}, copies: int = 1) -> Rotors:
        """Take what drives vehicles from terms of the rotors.

        Parameters
        ----------
        terms : array, shape (..., 1 + 4 rotors)
        terms_by : mapping of int to array
            Their derivatives by numbers, by place.
        copies : int
            How often all are given, one after another.
        """
        values = [_laid(each, copies) for each in _rotor_motion(terms)]
        by: list[dict[int, Value]] = [{}, {}, {}]
        for place, each in terms_by.items():
            faster, change, late = (_laid(own, copies) for own in _divided(each))
            for own, moved in zip(by, (faster, change, late + 2.0 * values[0] * faster), strict=True):
                own[place] = moved
        speed, acceleration, slow = (Tangent(x, own) if own else x for x, own in zip(values, by, strict=True))
        return cls(speed, acceleration, slow)


class Steps(NamedTuple):
    """Rotors over the steps of runs.

    Attributes
    ----------
    terms : array, shape (step, run, 1 + 4 rotors)
        See `cpfls_cli.playback.rotors`.
    push : array, shape (step, run, 6), N m and N, or None
    terms_by : mapping of int to array, shape (step, run, 1 + 4 rotors)
        Derivatives by numbers of their response, by place.
    push_by : mapping of int to array, shape (step, run, 6)
        Derivatives by numbers of the push, by place.
    """

    terms: Array
    push: Array | None = None
    terms_by: Mapping[int, Array] = {}
    push_by: Mapping[int, Array] = {}

    def of_runs(self, part: slice) -> Steps:
        """Take some of the runs."""
        return Steps(
            self.terms[:, part],
            None if self.push is None else self.push[:, part],
            {place: each[:, part] for place, each in self.terms_by.items()},
            {place: each[:, part] for place, each in self.push_by.items()},
        )

    def each(self) -> Iterator[Rotors]:
        """Give the rotors over one step after another."""
        pushes = [None] * len(self.terms) if self.push is None else self.push
        # What is read again and again lies side by side.
        parts = (np.ascontiguousarray(each.swapaxes(1, 2)) for each in _rotor_motion(self.terms))
        for speed, acceleration, slow, push in zip(*parts, pushes, strict=True):
            yield Rotors(speed, acceleration, slow, None if push is None else tuple(push.T))

    def for_both_stages(self) -> Rotors:
        """Give the rotors over all steps of all runs, once for each stage of a step, with derivatives."""
        by = {MOTION + place: each for place, each in self.terms_by.items()}
        push = None if self.push is None else self._pushes(self.push)
        return Rotors.of(self.terms, by, 2)._replace(push=push)

    def _pushes(self, push: Array) -> Vector:
        by = {MOTION + place: _laid(each, 2) for place, each in self.push_by.items()}
        return tuple(
            Tangent(own, {place: each[row] for place, each in by.items()}) for row, own in enumerate(_laid(push, 2))
        )


def _laid(values: Array, copies: int) -> Array:
    """Arrange values of steps and runs, shape (..., column), side by side: (column, copies times all)."""
    return np.tile(values.reshape(-1, values.shape[-1]).T, copies)


def _divided(terms: Array) -> tuple[Array, Array, Array]:
    """Take speeds, accelerations, and slow less present squares, shapes (..., rotor), from terms of the rotors."""
    rotors = terms.shape[-1] // 4
    mean, _, change, late = (terms[..., 1 + n * rotors : 1 + (n + 1) * rotors] for n in range(4))
    return mean, change, late


def _rotor_motion(terms: Array) -> tuple[Array, Array, Array]:
    """Give speeds, accelerations and slow squares, shapes (..., rotor), of terms of the rotors."""
    speed, acceleration, late = _divided(terms)
    return speed, acceleration, late + speed**2


class _State(NamedTuple):
    """States of runs, runs last."""

    position: Array
    velocity: Array
    rotation: Array
    momentum: Array


class _Path(NamedTuple):
    """Where runs went.

    Attributes
    ----------
    velocity, rate : array, shape (step + 1, 3, run)
    position : array, shape (step + 1, 3, run)
    rotation : array, shape (step + 1, 3, 3, run)
        At their samples; a run that diverged stays as it was before the step in which it did.
    stages : tuple of array, shapes (2, step, 3, run), (2, step, 3, 3, run) and (2, step, 3, run)
        Velocity, rotation and rate at the begin and in the middle of each step; empty where not asked for.
    diverged : array of int, shape (run,)
        Step at which a run diverged; -1 for those that did not.
    """

    position: Array
    velocity: Array
    rotation: Array
    rate: Array
    stages: tuple[Array, ...]
    diverged: IntArray

    def of_runs(self, part: slice) -> _Path:
        """Take some of the runs."""
        position, velocity, rotation, rate = (each[..., part] for each in self[:4])
        stages = tuple(each[..., part] for each in self.stages)
        return _Path(position, velocity, rotation, rate, stages, self.diverged[part])


def exponential(turn: Array) -> Array:
    """Compute rotations ``exp [a]_x``, shape (3, 3, ...), of turns a, shape (3, ...), rad."""
    square = (turn * turn).sum(axis=0)
    half = 0.5 * np.sqrt(np.maximum(square, _TINY**2))
    # By half the angle nothing cancels where it is small.
    ratio = np.sin(half) / half
    pairs = 0.5 * ratio * ratio
    return _turn(turn, pairs, 1.0 - pairs * square, ratio * np.cos(half))


def right_jacobian(turn: Array) -> Array:
    """Compute J of ``exp [a + d]_x = exp [a]_x exp [J d]_x``, shape (3, 3, ...), of turns a, shape (3, ...), rad."""
    square = (turn * turn).sum(axis=0)
    small = square < 1e-8
    safe = np.where(small, 1.0, square)
    angle = np.sqrt(safe)
    skew = np.where(small, 0.5 - square / 24.0, (1.0 - np.cos(angle)) / safe)
    pairs = np.where(small, 1.0 / 6.0 - square / 120.0, (1.0 - np.sin(angle) / angle) / safe)
    return _turn(turn, pairs, 1.0 - pairs * square, -skew)


def _turn(turn: Array, pairs: Array, diagonal: Array, skew: Array) -> Array:
    """Sum ``pairs a a' + diagonal 1 + skew [a]_x``, shape (3, 3, ...)."""
    out = turn[:, None] * (pairs * turn)
    across = skew * turn
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        out[i, i] += diagonal
        out[k, j] += across[i]
        out[j, k] -= across[i]
    return np.asarray(out)


def _product(first: Array, second: Array) -> Array:
    """Multiply matrices, shapes (3, 3, ...)."""
    return np.asarray(first[:, 0, None] * second[0] + first[:, 1, None] * second[1] + first[:, 2, None] * second[2])


def _applied(matrix: Array, vector: Array) -> Array:
    return np.asarray(matrix[:, 0] * vector[0] + matrix[:, 1] * vector[1] + matrix[:, 2] * vector[2])


def _back(matrix: Array, vector: Array) -> Array:
    """Multiply with the transposed matrix."""
    return np.asarray(matrix[0] * vector[0] + matrix[1] * vector[1] + matrix[2] * vector[2])


def _crossed(first: Array, second: Array) -> Array:
    (a, b, c), (u, v, w) = first, second
    out = np.empty(np.broadcast_shapes(first.shape, second.shape))
    out[0], out[1], out[2] = b * w - c * v, c * u - a * w, a * v - b * u
    return out


def _filled(components: Vector, count: int) -> Array:
    out = np.zeros((3, count))
    for row, value in zip(out, components, strict=True):
        if not zero(value):
            row[:] = value.value if isinstance(value, Tangent) else value
    return out


def _turned(flown: Flown, rotation: Array, momentum: Array) -> Turned:
    if flown.turning is not None:
        return flown.turning.turned(rotation, momentum)
    rate = flown.body.inverse @ momentum
    return Turned(rate, _crossed(rate, momentum), np.ones(rate.shape[1], dtype=bool))


def _moved(
    flown: Flown,
    start: _State,
    at: tuple[_State, Turned],
    rotors: Rotors,
    interval: float,
    translates: bool,
) -> _State:
    """Move states for an interval with the derivatives at others."""
    here, turned = at
    torque, force = flown.wrench(tuple(_back(here.rotation, here.velocity)), tuple(turned.rate), rotors)
    count = turned.rate.shape[1]
    momentum = start.momentum + interval * (_filled(torque, count) - turned.direct)
    rotation = _product(start.rotation, exponential(interval * turned.rate))
    if not translates:
        return _State(start.position, start.velocity, rotation, momentum)
    acceleration = _applied(here.rotation, _filled(force, count)) / flown.body.mass
    acceleration[2] -= flown.body.gravity
    return _State(
        start.position + interval * here.velocity, start.velocity + interval * acceleration, rotation, momentum
    )


def _run(flown: Flown, start: _State, steps: Steps, period: float, translates: bool, *, stages: bool) -> _Path:
    """Fly all runs."""
    horizon, count = steps.terms.shape[:2]
    position, velocity, rate = np.empty((3, horizon + 1, 3, count))
    rotation = np.empty((horizon + 1, 3, 3, count))
    passed = (np.empty((2, horizon, 3, count)), np.empty((2, horizon, 3, 3, count)), np.empty((2, horizon, 3, count)))
    diverged, state, now = np.full(count, -1), start, _turned(flown, start.rotation, start.momentum)
    position[0], velocity[0], rotation[0], rate[0] = state.position, state.velocity, state.rotation, now.rate
    with np.errstate(all="ignore"):
        for step, rotors in enumerate(steps.each()):
            middle = _moved(flown, state, (state, now), rotors, 0.5 * period, translates)
            there = _turned(flown, middle.rotation, middle.momentum)
            end = _moved(flown, state, (middle, there), rotors, period, translates)
            after = _turned(flown, end.rotation, end.momentum)
            fastest = np.maximum(np.abs(after.rate).max(axis=0), np.abs(end.velocity).max(axis=0))
            good = (diverged < 0) & now.exists & there.exists & after.exists & (fastest < FASTEST)
            if stages:
                for stage, (at, turned) in enumerate(((state, now), (middle, there))):
                    for own, value in zip(passed, (at.velocity, at.rotation, turned.rate), strict=True):
                        own[stage, step] = value
            if good.all():
                state, now = end, after
            else:
                # A run that no body flies stays as it is from there on.
                diverged[(diverged < 0) & ~good] = step
                state = _State(*(np.where(good, new, old) for new, old in zip(end, state, strict=True)))
                now = Turned(*(np.where(good, new, old) for new, old in zip(after, now, strict=True)))
            place = step + 1
            position[place], velocity[place], rotation[place], rate[place] = (
                state.position,
                state.velocity,
                state.rotation,
                now.rate,
            )
    return _Path(position, velocity, rotation, rate, passed if stages else (), diverged)


def _begun(flown: Flown, motion: MeasuredMotion, starts: IntArray) -> _State:
    rotation, rate = motion.rotation[starts].transpose(1, 2, 0), motion.rate[starts].T
    momentum = flown.body.inertia @ rate if flown.turning is None else flown.turning.momentum(rotation, rate)
    return _State(motion.position[starts].T, motion.velocity[starts].T, rotation, momentum)


def rotation_errors(measured: Array, predicted: Array) -> Array:
    """Compute the rotation vectors from measured to predicted attitudes, rad, body frame of the measured one.

    Parameters
    ----------
    measured, predicted : array, shape (..., 3, 3, run)

    Returns
    -------
    array, shape (..., 3, run)
        Its length is the geodesic distance.
    """

    def entry(i: int, j: int) -> Array:
        return np.asarray((measured[..., :, i, :] * predicted[..., :, j, :]).sum(axis=-2))

    pairs = [0.5 * (entry(2, 1) - entry(1, 2)), 0.5 * (entry(0, 2) - entry(2, 0)), 0.5 * (entry(1, 0) - entry(0, 1))]
    skew = np.stack(pairs, axis=-2)
    sine = np.sqrt((skew**2).sum(axis=-2))
    cosine = 0.5 * (entry(0, 0) + entry(1, 1) + entry(2, 2) - 1.0)
    shown = sine > _TINY
    scale = np.where(shown, np.arctan2(sine, cosine) / np.where(shown, sine, 1.0), 1.0)
    # Half a turn: the axis does not show in the skew part, its length is all that is used.
    half_turn = np.asarray(~shown & (cosine < 0.0))
    vector = skew * scale[..., None, :]
    vector[..., 0, :] = np.where(half_turn, np.pi, vector[..., 0, :])
    return np.asarray(vector)


_TINY = 1e-12
"""Sine of an angle, in rad, that is rounding: the axis does not show."""


class Loss(NamedTuple):
    """How errors are weighed: ``sum over signals of weight delta^2 (sqrt(1 + |e|^2 / delta^2) - 1)``.

    Attributes
    ----------
    weight, delta : array, shape (horizon, 4) or (horizon, 4, run)
        For position, velocity, attitude, rate; position is not weighed.
    """

    weight: Array
    delta: Array

    def of(self, squares: Array) -> Array:
        """Weigh squared errors, shape (horizon, 4, run)."""
        weight, delta = self.of_runs()
        return np.asarray(weight * delta**2 * (np.sqrt(1.0 + squares / delta**2) - 1.0))

    def of_runs(self, part: slice = slice(None)) -> Loss:
        """Give the weights of some runs, shapes (horizon, 4, run)."""
        return Loss(*(each[:, :, None] if each.ndim == 2 else each[..., part] for each in self))


@dataclass(frozen=True)
class Runs:
    """Windows of a flight that a vehicle is flown in.

    Attributes
    ----------
    starts : array of int, shape (run,)
        Samples of the motion.
    translates : bool
        Whether velocity and position are simulated; otherwise they stay.
    """

    motion: MeasuredMotion
    starts: IntArray
    translates: bool

    def blocks(self, steps: Steps, most: int) -> Iterator[tuple[slice, Runs, Steps]]:
        """Take some runs at a time."""
        for part in _slices(len(self.starts), most):
            yield part, Runs(self.motion, self.starts[part], self.translates), steps.of_runs(part)

    def fly(self, flown: Flown, steps: Steps, *, stages: bool = False) -> _Path:
        """Fly all runs."""
        begun = _begun(flown, self.motion, self.starts)
        return _run(flown, begun, steps, self.motion.period, self.translates, stages=stages)

    def errors(self, path: _Path) -> Array:
        """Compare with what was measured: predicted less measured, shape (4, step, 3, run); see `errors_of_runs`."""
        motion, at = self.motion, self.starts + np.arange(1, len(path.rate))[:, None]
        measured = (each[at].swapaxes(1, 2) for each in (motion.position, motion.velocity, motion.rate))
        position, velocity, rate = measured
        turned = rotation_errors(motion.rotation[at].transpose(0, 2, 3, 1), path.rotation[1:])
        return np.stack([path.position[1:] - position, path.velocity[1:] - velocity, turned, path.rate[1:] - rate])


def errors_of_runs(flown: Flown, runs: Runs, steps: Steps) -> tuple[Array, IntArray]:
    """Fly runs and give their errors.

    Returns
    -------
    errors : array, shape (run, horizon, 4, 3)
        Predicted less measured position, velocity, rotation vector, rate. A run that diverges stays as it was before
        the step in which it did.
    diverged : array of int, shape (run,)
        Step at which a run diverged; -1 for those that did not.
    """
    found = [(own.fly(flown, part), own) for _, own, part in runs.blocks(steps, MOST_RUNS)]
    errors = [own.errors(path).transpose(3, 1, 0, 2) for path, own in found]
    return np.concatenate(errors), np.concatenate([path.diverged for path, _ in found])


class Leg(NamedTuple):
    """Some of the runs, flown.

    Attributes
    ----------
    part : slice
        Which of all they are.
    """

    part: slice
    runs: Runs
    path: _Path


def legs(flown: Flown, runs: Runs, steps: Steps) -> Iterator[Leg]:
    """Fly runs, some at a time."""
    for part, own, of_steps in runs.blocks(steps, MOST_RUNS):
        yield Leg(part, own, own.fly(flown, of_steps, stages=True))


def losses_of(flown: Iterable[Leg], loss: Loss) -> Array:
    """Weigh the errors of runs, shape (run,)."""
    found = []
    for part, runs, path in flown:
        weighed = loss.of_runs(part)
        found.append(_lost(path.diverged, weighed, weighed.of(_squares(runs.errors(path)))).sum(axis=(0, 1)))
    return np.concatenate(found)


def _squares(errors: Array) -> Array:
    """Sum the squares of the components, shape (step, 4, run)."""
    return np.asarray((errors**2).sum(axis=2).swapaxes(0, 1))


def _lost(diverged: IntArray, loss: Loss, found: Array) -> Array:
    """Count what a run leaves behind: as bad as the largest error, and of no direction."""
    if (diverged < 0).all():
        return found
    gone = _gone(diverged, len(found))
    return np.where(gone[:, None], loss.weight * loss.delta * FASTEST, found)


def _gone(diverged: IntArray, horizon: int) -> BoolArray:
    return np.asarray((diverged >= 0) & (np.arange(horizon)[:, None] >= diverged))


def sums_of(legs: Iterable[Leg], flown: Flown, steps: Steps, loss: Loss, group: IntArray) -> tuple[Array, Array]:
    """Sum the gradient and the Gauss-Newton Hessian of the loss of runs by the numbers.

    The gradient is exact: the derivative of a rotation's error vector differs from that of the rotation only across
    the vector, and the loss depends on its length alone.

    Parameters
    ----------
    flown : Flown
        That flew them, with derivatives.
    group : array of int, shape (run,)
        Which sum a run is added to.

    Returns
    -------
    gradient : array, shape (group, number)
    hessian : array, shape (group, number, number)
    """
    numbers, groups, horizon = len(flown.inertia_by), int(group.max(initial=0)) + 1, len(loss.weight)
    gradient, hessian = np.zeros((groups, numbers)), np.zeros((groups, numbers, numbers))
    for leg in legs if numbers else ():
        shares, residual = _shares(leg, loss.of_runs(leg.part))
        own_steps, owners = steps.of_runs(leg.part), group[leg.part]
        for some in _slices(len(owners), max(1, _SAMPLES // (2 * horizon))):
            for place, by_number, square in _products(leg, flown, own_steps, shares, residual, owners, some):
                gradient[place] += by_number
                hessian[place] += square
    return gradient, hessian


def _products(
    leg: Leg, flown: Flown, steps: Steps, shares: Array, residual: Array, group: IntArray, some: slice
) -> list[tuple[int, Array, Array]]:
    """Multiply rows of the Jacobian of some runs with each other, by group."""
    rows = _tangents(flown, leg, steps, some)
    rows *= shares[some, :, :, None]
    own, found = group[some], []
    ends = [0, *(np.flatnonzero(np.diff(own)) + 1).tolist(), len(own)]
    for kept in map(slice, ends[:-1], ends[1:]):
        jacobian = rows[kept].reshape(-1, rows.shape[-1])
        product = residual[some][kept].reshape(-1) @ jacobian
        found.append((int(own[kept.start]), product, np.asarray(jacobian.T @ jacobian)))
    return found


def _shares(leg: Leg, loss: Loss) -> tuple[Array, Array]:
    """Give by what rows of the Jacobian are multiplied, and what they come to, shapes (run, step, STATES)."""
    errors, (weight, delta) = leg.runs.errors(leg.path)[1:], (each[:, 1:] for each in loss)
    share = np.sqrt(weight / np.sqrt(1.0 + _squares(errors) / delta**2))
    share[np.broadcast_to(_gone(leg.path.diverged, len(share))[:, None], share.shape)] = 0.0
    shares = np.repeat(share.transpose(2, 0, 1), 3, axis=2)
    return shares, shares * errors.transpose(3, 1, 0, 2).reshape(shares.shape)


def _slices(count: int, most: int) -> Iterator[slice]:
    for first in range(0, count, most):
        yield slice(first, min(first + most, count))


def _tangents(flown: Flown, leg: Leg, steps: Steps, some: slice) -> Array:
    """Compose the derivatives of the states of some runs by the numbers, shape (run, step, STATES, number)."""
    path = leg.path.of_runs(some)
    moved = _steps_by(flown, path, steps.of_runs(some), leg.runs.motion.period, leg.runs.translates)
    horizon, count, _, width = moved.shape
    changes, change = np.empty((count, horizon, STATES, width - STATES)), np.zeros((count, STATES, width - STATES))
    with np.errstate(all="ignore"):
        for step in range(horizon):
            change = moved[step, ..., :STATES] @ change + moved[step, ..., STATES:]
            changes[:, step] = change
    changes[_gone(path.diverged, horizon).T] = 0.0
    return changes


def _steps_by(flown: Flown, path: _Path, steps: Steps, period: float, translates: bool) -> Array:
    """Differentiate steps by the state at their begin and by numbers, shape (step, run, STATES, STATES + number)."""
    _, horizon, _, count = path.stages[0].shape
    numbers, samples = len(flown.inertia_by), horizon * count
    parts = (np.moveaxis(each, (0, 1), (-3, -2)) for each in path.stages)
    velocity, rotation, rate = (each.reshape(*each.shape[:-3], -1) for each in parts)
    by = _accelerations_by(flown, velocity, rotation, rate, steps.for_both_stages(), translates)
    by = np.moveaxis(by.reshape(6, -1, 2, samples), (2, 3), (0, 1))
    rates = rate.reshape(3, 2, samples)
    first, rest = np.zeros((2, samples, STATES, STATES + numbers))
    second = np.zeros((samples, STATES, STATES))
    diagonal = [0, 1, 2, 6, 7, 8]
    for own, half, into_state, into_number in (
        (by[0], 0.5 * period, first[..., :STATES], first[..., STATES:]),
        (by[1], period, second, rest[..., STATES:]),
    ):
        for rows, components in ((slice(3), slice(3)), (slice(3, 6), slice(6, 9))):
            np.multiply(half, own[:, rows, :STATES], out=into_state[:, components])
            np.multiply(half, own[:, rows, STATES:], out=into_number[:, components])
    for stage, interval, by_turn, by_rate in ((0, 0.5 * period, first, first), (1, period, rest, second)):
        turn = interval * rates[:, stage]
        by_turn[:, 3:6, 3:6] = exponential(turn).transpose(2, 1, 0)
        by_rate[:, 3:6, 6:9] = interval * right_jacobian(turn).transpose(2, 0, 1)
    for component in diagonal:
        first[:, component, component] += 1.0
        rest[:, component, component] = 1.0
    return np.asarray(second @ first + rest).reshape(horizon, count, STATES, -1)


def _accelerations_by(
    flown: Flown, velocity: Array, rotation: Array, rate: Array, rotors: Rotors, translates: bool
) -> Array:
    """Differentiate accelerations, world and body frame, by state and numbers, shape (6, STATES + number, samples).

    ``R' dv + v_b x dphi`` and ``d omega`` move the wrench; then ``m dv' = R (dF - F x dphi)`` and
    ``I d omega' = dM - d omega x I omega - omega x I d omega``.
    """
    air, body, numbers = _back(rotation, velocity), flown.body, len(flown.inertia_by)
    seen = [Tangent(own, {place: 1.0}) for place, own in enumerate((*air, *rate))]
    torque, force = flown.wrench(tuple(seen[:3]), tuple(seen[3:]), rotors)
    samples = rate.shape[1]
    by = np.zeros((6, STATES + numbers, samples))
    of_air, places = np.zeros((6, 3, samples)), [*range(6, 9), *range(STATES, STATES + numbers)]
    for row, value in enumerate((*torque, *force)):
        for place, change in value.by.items() if isinstance(value, Tangent) else ():
            (of_air if place < 3 else by)[row, place if place < 3 else places[place - 3]] = change
    turned, pushed = _filled(torque, samples), _filled(force, samples)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        by[:, i] = of_air[:, 0] * rotation[i, 0] + of_air[:, 1] * rotation[i, 1] + of_air[:, 2] * rotation[i, 2]
        by[:, 3 + i] = of_air[:, j] * air[k] - of_air[:, k] * air[j]
    momentum = body.inertia @ rate
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        # - F x dphi
        by[3 + k, 3 + j] -= pushed[i]
        by[3 + j, 3 + k] += pushed[i]
        # - omega x I d omega - d omega x I omega
        by[i, 6:9] -= rate[j] * body.inertia[k][:, None] - rate[k] * body.inertia[j][:, None]
        by[k, 6 + j] += momentum[i]
        by[j, 6 + k] -= momentum[i]
    accelerated = body.inverse @ (turned - _crossed(rate, momentum))
    for place, change in enumerate(flown.inertia_by):
        if change.any():
            by[:3, STATES + place] -= change @ accelerated + _crossed(rate, change @ rate)
    if flown.log_mass is not None:
        by[3:, STATES + flown.log_mass] -= pushed
    # In the order of the state: world, then body.
    out = np.zeros_like(by)
    if translates:
        for i in range(3):
            out[i] = (rotation[i, 0] * by[3] + rotation[i, 1] * by[4] + rotation[i, 2] * by[5]) / body.mass
    out[3:] = (body.inverse @ by[:3].reshape(3, -1)).reshape(3, *by.shape[1:])
    return out
