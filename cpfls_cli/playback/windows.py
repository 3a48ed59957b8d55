"""Free runs in windows of a flight, all windows side by side, and their derivatives by the numbers of the vehicle.

A state is position (world), velocity (world), rotation (body to world, row by row) and momentum (body), in components.
Between two samples the rotors are constant, and one step of the midpoint rule is taken:

    R' = R [omega]_x,   m v' = m g + R F,   L' = M - omega x L,   L = I omega.

A step is a function of any kind of numbers: of arrays, runs last, or of symbols, by which it is traced where it is
taken often. So are the derivatives of the accelerations; they are evaluated at all states that the runs passed, and
then composed step by step.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import chain, pairwise
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.playback.flight import FASTEST, Body, MeasuredMotion
from cpfls_cli.vehicle.motion import Instant, Vehicle
from cpfls_cli.vehicle.values import (
    ARRAYS,
    Functions,
    Tangent,
    Value,
    Vector,
    add,
    apply,
    cross,
    dot,
    minus,
    scaled,
    subtract,
    transposed,
    value_of,
    zero,
)

_SAMPLES = 2_000
"""Steps at a time of which derivatives are taken, so that they stay in the cache."""

MOST_RUNS = 1_200
"""Runs side by side."""

STATES = 9
"""Components of the derivatives of a state: velocity, rotation as a vector in the body frame, body rate."""

_ADDED = (0, 1, 2, 6, 7, 8)
"""Those of velocity and rate, which a step adds to."""

_VELOCITY, _ROTATION, _MOMENTUM = slice(3, 6), slice(6, 15), slice(15, 18)


class Turned(NamedTuple):
    """How bodies turn in the states of runs.

    `rate` is that which has the momentum, rad/s; `direct` the torque that the motion takes beyond the change of
    momentum, N m; `exists` is False where no body has the inertia, shape (run,).
    """

    rate: Vector
    direct: Vector
    exists: BoolArray | bool = True


class Turning(NamedTuple):
    """An inertia that depends on the attitude.

    `momentum` takes rotations and rates, shapes (3, 3, run) and (3, run), to momenta; `turned` takes rotations and
    momenta, rows of the vectors along its first axis.
    """

    momentum: Callable[[Array, Array], Array]
    turned: Callable[[Array, Array], Turned]


class Slopes(NamedTuple):
    """Derivatives of the accelerations of a vehicle by the components of a state and by so many numbers.

    `places`: the component of the state that each derivative moves, and what it is by, of `STATES`, then of the
    numbers; `values` gives them from velocity, rotation and rate, then see `Steps.arguments`.
    """

    numbers: int
    places: tuple[tuple[int, int], ...]
    values: Callable[..., Iterable[Value]]


@dataclass(frozen=True)
class Flown:
    """A vehicle that runs fly.

    Attributes
    ----------
    vehicle : Vehicle
        What acts on it.
    body : Body
        What is moved.
    drag_scale : value
        Ratio of the drag factors that effects share to those stated.
    turning : Turning or None
        In the place of a constant inertia.
    functions : Functions
        Of the kind of numbers that it is flown with.
    traced : callable or None
        `stepped` as one function, which takes a part of the time: from states, rotors, and what pushes on top.
    """

    vehicle: Vehicle
    body: Body
    drag_scale: Value = 1
    turning: Turning | None = None
    functions: Functions = ARRAYS
    traced: Callable[[Vector, Vector, Vector], tuple[Vector, Vector]] | None = None

    @cached_property
    def _at_rest(self) -> Instant:
        still = np.zeros((len(self.vehicle.settings.rotors), 1))
        at = Instant(self.vehicle.settings, still, drag_scale=self.drag_scale, functions=self.functions)
        # Worked out here once for all states that follow.
        assert at.hubs
        assert np.any(at.spins)
        return at

    def wrench(self, air: Vector, rate: Vector, rotors: Rotors) -> tuple[Vector, Vector]:
        """Compute torque and force, N m and N, body frame, without weight."""
        torque, force = self.vehicle.wrench(self._instant(air, rate, rotors))
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

    def begun(self, motion: MeasuredMotion, starts: IntArray) -> Vector:
        """Give the states that runs start from."""
        rotation, rate = motion.rotation[starts].transpose(1, 2, 0), motion.rate[starts].T
        if self.turning is None:
            momentum = apply(self.body.inertia, tuple(rate))
        else:
            momentum = tuple(self.turning.momentum(rotation, rate))
        position, velocity = (np.ascontiguousarray(each[starts].T) for each in motion[:2])
        return (*position, *velocity, *np.ascontiguousarray(rotation.reshape(9, -1)), *momentum)

    def turned(self, state: Vector) -> Turned:
        """Say how bodies turn in states."""
        momentum = state[_MOMENTUM]
        if self.turning is None:
            rate = apply(self.body.inverse, momentum)
            return Turned(rate, cross(rate, momentum))
        return self.turning.turned(np.stack(state[_ROTATION]).reshape(3, 3, -1), np.stack(momentum))

    def stepped(self, state: Vector, rotors: Rotors, period: Value, translates: bool) -> Stepped:
        """Take a step of the midpoint rule."""
        now = self.turned(state)
        middle = self._moved(state, (state, now), rotors, 0.5 * period, translates)
        there = self.turned(middle)
        end = self._moved(state, (middle, there), rotors, period, translates)
        passed = ((*at[_VELOCITY], *at[_ROTATION], *turned.rate) for at, turned in ((state, now), (middle, there)))
        return Stepped(end, tuple(chain(*passed)), (now.exists, there.exists))

    def _moved(
        self, start: Vector, at: tuple[Vector, Turned], rotors: Rotors, interval: Value, translates: bool
    ) -> Vector:
        """Move states for an interval with the derivatives at others."""
        here, turned = at
        rows, velocity = _rows(here[_ROTATION]), here[_VELOCITY]
        torque, force = self.wrench(apply(transposed(rows), velocity), turned.rate, rotors)
        momentum = add(start[_MOMENTUM], scaled(interval, subtract(torque, turned.direct)))
        columns = transposed(_rows(exponential(scaled(interval, turned.rate), self.functions)))
        rotation = (dot(row, column) for row in _rows(start[_ROTATION]) for column in columns)
        place = start[: _ROTATION.start]
        if translates:
            pushed = apply(rows, scaled(interval / self.body.mass, force))
            fallen = (*velocity, 0, 0, -self.body.gravity)
            place = add(place, scaled(interval, fallen), (0, 0, 0, *pushed))
        return (*place, *rotation, *momentum)

    def accelerations(self, velocity: Vector, rotation: Vector, rate: Vector, rotors: Rotors) -> Vector:
        """Give the derivatives of velocity and rate, with those by the components of a state, by place, and by numbers.

        ``R' dv + v_b x dphi`` and ``d omega`` move the wrench; then ``m dv' = R (dF - F x dphi)`` and
        ``I d omega' = dM - d omega x I omega - omega x I d omega``.

        Parameters
        ----------
        velocity, rotation, rate : vector
            Without derivatives.
        rotors : Rotors
            With those by numbers, by places from `STATES` on.
        """
        rows = _rows(rotation)
        columns = transposed(rows)
        air, turning = apply(columns, velocity), tuple(Tangent(x, {6 + place: 1.0}) for place, x in enumerate(rate))
        moved = (Tangent(x, dict(enumerate(column))) for x, column in zip(air, columns, strict=True))
        torque, force = self.wrench(add(moved, _by_turn(air)), turning, rotors)
        lifted = scaled(1 / self.body.mass, force)
        momentum = apply(self.body.inertia, turning)
        return (
            *apply(rows, subtract(lifted, _by_turn(tuple(map(value_of, lifted))))),
            *apply(self.body.inverse, subtract(torque, cross(turning, momentum))),
        )


class Stepped(NamedTuple):
    """A step of runs: the state at its end, and velocity, rotation and rate at the begin, then in the middle.

    `exist` says whether a body has the inertia there.
    """

    end: Vector
    passed: Vector
    exist: tuple[BoolArray | bool, ...] = ()


def _rows(matrix: Vector) -> tuple[Vector, ...]:
    return matrix[:3], matrix[3:6], matrix[6:]


def _by_turn(vector: Vector) -> Vector:
    """Differentiate a vector, which is 0, as ``v x dphi`` by the turn of a state."""
    x, y, z = vector
    by = (0, minus(0, z), y), (z, 0, minus(0, x)), (minus(0, y), x, 0)
    return tuple(Tangent(0, {3 + at: slope for at, slope in enumerate(row) if not zero(slope)}) for row in by)


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
    def of(cls, terms: Array, terms_by: Mapping[int, Array] = {}) -> Rotors:
        """Take what drives vehicles from terms of the rotors.

        Parameters
        ----------
        terms : array, shape (sample, 1 + 4 rotors)
        terms_by : mapping of int to array
            Their derivatives by numbers, by place.
        """
        values = [each.T for each in _rotor_motion(terms)]
        by: list[dict[int, Value]] = [{}, {}, {}]
        for place, each in terms_by.items():
            faster, change, late = (own.T for own in _divided(each))
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

    def arguments(self) -> tuple[list[Array], ...]:
        """Give what derivatives are taken with, each with steps and runs last.

        Returns
        -------
        rotors : list of array
            Speeds, accelerations and slow squares.
        by : list of array
            Derivatives by each number of their response: of speeds, accelerations, and slow less present squares.
        push, push_by : list of array
            What pushes on top, by component, and its derivatives by each of its numbers.
        """
        pushes = [] if self.push is None else [self.push, *(by for _, by in sorted(self.push_by.items()))]
        driven = [_rotor_motion(self.terms), *(_divided(by) for _, by in sorted(self.terms_by.items()))]
        rotors, *by = ([np.moveaxis(each, -1, 0) for each in own] for own in driven)
        push, *push_by = ([*np.moveaxis(each, -1, 0)] for each in pushes) if pushes else [[]]
        return rotors, [*chain(*by)], push, [*chain(*push_by)]


def _divided(terms: Array) -> tuple[Array, Array, Array]:
    """Take speeds, accelerations, and slow less present squares, shapes (..., rotor), from terms of the rotors."""
    rotors = terms.shape[-1] // 4
    mean, _, change, late = (terms[..., 1 + n * rotors : 1 + (n + 1) * rotors] for n in range(4))
    return mean, change, late


def _rotor_motion(terms: Array) -> tuple[Array, Array, Array]:
    """Give speeds, accelerations and slow squares, shapes (..., rotor), of terms of the rotors."""
    speed, acceleration, late = _divided(terms)
    return speed, acceleration, late + speed**2


class _Path(NamedTuple):
    """Where runs went, shapes (step + 1, 3, run) and (step + 1, 3, 3, run).

    A run that diverged stays as it was before the step in which it did: `diverged`, -1 for those that did not. `passed`
    is what each step passed, see `Stepped`; empty where not asked for.
    """

    position: Array
    velocity: Array
    rotation: Array
    rate: Array
    passed: list[Vector]
    diverged: IntArray


def exponential(turn: Vector, functions: Functions = ARRAYS) -> Vector:
    """Compute rotations ``exp [a]_x``, row by row, of turns a, rad."""
    square = dot(turn, turn)
    half = 0.5 * functions.sqrt(functions.largest(square, _TINY**2))
    # By half the angle nothing cancels where it is small.
    ratio = functions.sin(half) / half
    pairs = 0.5 * ratio * ratio
    return _turn(turn, pairs, 1.0 - pairs * square, ratio * functions.cos(half))


def right_jacobian(turn: Vector) -> Vector:
    """Compute J of ``exp [a + d]_x = exp [a]_x exp [J d]_x``, row by row, of turns a, arrays, rad."""
    square = dot(turn, turn)
    small = square < 1e-8
    safe = np.where(small, 1.0, square)
    angle = np.sqrt(safe)
    skew = np.where(small, 0.5 - square / 24.0, (1.0 - np.cos(angle)) / safe)
    pairs = np.where(small, 1.0 / 6.0 - square / 120.0, (1.0 - np.sin(angle) / angle) / safe)
    return _turn(turn, pairs, 1.0 - pairs * square, -skew)


def _turn(turn: Vector, pairs: Value, diagonal: Value, skew: Value) -> Vector:
    """Sum ``pairs a a' + diagonal 1 + skew [a]_x``, row by row."""
    (x, y, z), (i, j, k) = scaled(pairs, turn), scaled(skew, turn)
    xy, xz, yz = x * turn[1], x * turn[2], y * turn[2]
    xx, yy, zz = (own * each + diagonal for own, each in zip((x, y, z), turn, strict=True))
    return xx, xy - k, xz + j, xy + k, yy, yz - i, xz - j, yz + i, zz


def rotation_errors(measured: Array, predicted: Array) -> Array:
    """Compute the rotation vectors from measured to predicted attitudes, rad, body frame of the measured one.

    From shape (..., 3, 3, run) to (..., 3, run); the length is the geodesic distance.
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

    Both have shape (horizon, 3) or (horizon, 3, run), for velocity, attitude and rate.
    """

    weight: Array
    delta: Array

    def of(self, squares: Array) -> Array:
        """Weigh squared errors, shape (horizon, 3, run)."""
        weight, delta = self.of_runs()
        return np.asarray(weight * delta**2 * (np.sqrt(1.0 + squares / delta**2) - 1.0))

    def of_runs(self, part: slice = slice(None)) -> Loss:
        """Give the weights of some runs, shapes (horizon, 3, run)."""
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
    _seen: dict[int, tuple[Array, ...]] = field(default_factory=dict, repr=False)

    def blocks(self, steps: Steps, most: int) -> Iterator[tuple[slice, Runs, Steps]]:
        """Take some runs at a time."""
        if len(self.starts) <= most:
            yield slice(len(self.starts)), self, steps
            return
        for part in _slices(len(self.starts), most):
            yield part, Runs(self.motion, self.starts[part], self.translates), steps.of_runs(part)

    def fly(self, flown: Flown, steps: Steps, *, passed: bool = False) -> _Path:
        """Fly all runs."""
        state, period = flown.begun(self.motion, self.starts), self.motion.period
        samples: list[Array] = []
        all_passed: list[Vector] = []
        exist: list[tuple[BoolArray | bool, ...]] = []
        with np.errstate(all="ignore"):
            for rotors in steps.each():
                if flown.traced is None:
                    step = flown.stepped(state, rotors, period, self.translates)
                else:
                    step = Stepped(*flown.traced(state, rotors[:3], rotors.push or ()))
                samples += [*state[: _ROTATION.stop], *step.passed[12:15]]
                all_passed += [step.passed] if passed else []
                exist.append(step.exist)
                state = step.end
            last = flown.turned(state)
            shape = len(steps.terms) + 1, 18, len(self.starts)
            path = np.concatenate([*samples, *state[: _ROTATION.stop], *last.rate]).reshape(shape)
            slow = (np.abs(path[1:, [3, 4, 5, 15, 16, 17]]) < FASTEST).all(axis=1)
        if flown.turning is not None:
            there = np.array([*exist, (last.exists, last.exists)])
            slow &= there[:-1].all(axis=1) & there[1:, 0]
        diverged = np.where(slow.all(axis=0), -1, np.argmin(slow, axis=0))
        if (diverged >= 0).any():
            ends = np.where(diverged < 0, len(path), diverged)
            path = np.take_along_axis(path, np.minimum(np.arange(len(path))[:, None], ends)[:, None], axis=0)
        position, velocity, rotation, rate = path[:, :3], path[:, 3:6], path[:, 6:15], path[:, 15:]
        return _Path(position, velocity, rotation.reshape(len(path), 3, 3, -1), rate, all_passed, diverged)

    def errors(self, path: _Path) -> Array:
        """Compare velocity, attitude and rate with what was measured: predicted less measured, (3, step, 3, run)."""
        velocity, rotation, rate = self._measured(len(path.rate) - 1)
        turned = rotation_errors(rotation, path.rotation[1:])
        return np.stack([path.velocity[1:] - velocity, turned, path.rate[1:] - rate])

    def _measured(self, horizon: int) -> tuple[Array, ...]:
        """Give measured velocity, rotation and rate after each step, runs last; remembered: runs are flown again."""
        if horizon not in self._seen:
            at = self.samples(horizon)
            found = (np.moveaxis(each[at], 1, -1) for each in self.motion[1:4])
            self._seen[horizon] = tuple(map(np.ascontiguousarray, found))
        return self._seen[horizon]

    def samples(self, horizon: int) -> IntArray:
        """Give the samples of the motion after each step, shape (step, run)."""
        return np.asarray(self.starts + np.arange(1, horizon + 1)[:, None])


class RunErrors(NamedTuple):
    """Errors of free runs.

    Attributes
    ----------
    errors : array, shape (run, horizon, 4, 3)
        Predicted less measured position, velocity, rotation vector (body frame) and rate. A run that diverges stays as
        it was before the step in which it did.
    diverged : array of int, shape (run,)
        Step at which a run was stopped; -1 for those that went on.
    """

    errors: Array
    diverged: IntArray


def errors_of_runs(flown: Flown, runs: Runs, steps: Steps) -> RunErrors:
    """Fly runs and give their errors."""
    errors, diverged = [], []
    for _, own, part in runs.blocks(steps, MOST_RUNS):
        path = own.fly(flown, part)
        away = path.position[1:] - runs.motion.position[own.samples(len(part.terms))].swapaxes(1, 2)
        errors.append(np.concatenate([away[None], own.errors(path)]).transpose(3, 1, 0, 2))
        diverged.append(path.diverged)
    return RunErrors(np.concatenate(errors), np.concatenate(diverged))


class Leg(NamedTuple):
    """Some of the runs, flown, and their errors (see `Runs.errors`)."""

    part: slice
    runs: Runs
    path: _Path
    errors: Array


def legs(flown: Flown, runs: Runs, steps: Steps) -> Iterator[Leg]:
    """Fly runs, some at a time."""
    for part, own, of_steps in runs.blocks(steps, MOST_RUNS):
        path = own.fly(flown, of_steps, passed=True)
        yield Leg(part, own, path, own.errors(path))


def losses_of(flown: Iterable[Leg], loss: Loss) -> Array:
    """Weigh the errors of runs, shape (run,)."""
    found = []
    for leg in flown:
        weighed = loss.of_runs(leg.part)
        found.append(_lost(leg.path.diverged, weighed, weighed.of(_squares(leg.errors))).sum(axis=(0, 1)))
    return np.concatenate(found)


def _squares(errors: Array) -> Array:
    """Sum the squares of the components, shape (step, 3, run)."""
    return np.asarray((errors**2).sum(axis=2).swapaxes(0, 1))


def _lost(diverged: IntArray, loss: Loss, found: Array) -> Array:
    """Count what a run leaves behind: as bad as the largest error, and of no direction."""
    if (diverged < 0).all():
        return found
    gone = _gone(diverged, len(found))
    return np.where(gone[:, None], loss.weight * loss.delta * FASTEST, found)


def _gone(diverged: IntArray, horizon: int) -> BoolArray:
    return np.asarray((diverged >= 0) & (np.arange(horizon)[:, None] >= diverged))


def sums_of(legs: Iterable[Leg], slopes: Slopes, steps: Steps, loss: Loss, group: IntArray) -> tuple[Array, Array]:
    """Sum gradient and Gauss-Newton Hessian of the loss of runs by the numbers, by the group of each run.

    The gradient is exact: the derivative of a rotation's error vector differs from that of the rotation only across the
    vector, and the loss depends on its length alone. Shapes (group, number) and (group, number, number).
    """
    numbers, groups, horizon = slopes.numbers, int(group.max(initial=0)) + 1, len(loss.weight)
    gradient, hessian = np.zeros((groups, numbers)), np.zeros((groups, numbers, numbers))
    for leg in legs if numbers else ():
        shares, residual = _shares(leg, loss.of_runs(leg.part))
        tangents = _Tangents(slopes, leg, steps.of_runs(leg.part), max(1, _SAMPLES // horizon))
        own = group[leg.part]
        for some in _slices(len(own), tangents.most):
            rows = tangents.of_runs(some, shares[some])
            ends = [some.start, *(some.start + 1 + np.flatnonzero(np.diff(own[some]))).tolist(), some.stop]
            for first, end in pairwise(ends):
                jacobian = rows[first - some.start : end - some.start].reshape(-1, numbers)
                gradient[own[first]] += residual[first:end].reshape(-1) @ jacobian
                hessian[own[first]] += jacobian.T @ jacobian
    return gradient, hessian


def _shares(leg: Leg, loss: Loss) -> tuple[Array, Array]:
    """Give by what rows of the Jacobian are multiplied, and what they come to, shapes (run, step, STATES)."""
    share = np.sqrt(loss.weight / np.sqrt(1.0 + _squares(leg.errors) / loss.delta**2))
    share[np.broadcast_to(_gone(leg.path.diverged, len(share))[:, None], share.shape)] = 0.0
    shares = np.repeat(share.transpose(2, 0, 1), 3, axis=2)
    return shares, shares * leg.errors.transpose(3, 1, 0, 2).reshape(shares.shape)


def _slices(count: int, most: int) -> Iterator[slice]:
    for first in range(0, count, most):
        yield slice(first, min(first + most, count))


_Key = tuple[tuple[tuple[int, int], ...], bool, int, int, int]
_made: dict[_Key, tuple[Array, ...]] = {}


def _made_once(key: _Key) -> tuple[Array, ...]:
    """Make the arrays that derivatives are composed in: a fit takes those of one vehicle again and again.

    What is 0 stays so; the rest, which the places say, is filled anew each time. The middle of a step follows from its
    begin and the numbers, and its end from these and from the middle.
    """
    if key in _made:
        return _made[key]
    # Those of the last vehicle go first, so that there are never two.
    _made.clear()
    *_, horizon, runs, numbers = key
    middle, end, moved = (np.zeros((horizon, runs, STATES, STATES + numbers)) for _ in range(3))
    for component in _ADDED:
        end[..., component, component] = 1.0
    through = np.zeros((horizon, runs, STATES, STATES))
    return _made.setdefault(key, (middle, through, end, moved, np.empty((runs, horizon, STATES, numbers))))


class _Tangents:
    """Derivatives of the states of some runs at a time by the numbers."""

    def __init__(self, slopes: Slopes, leg: Leg, steps: Steps, most: int) -> None:
        self.most, self._slopes, self._runs = min(most, len(leg.path.diverged)), slopes, leg.runs
        horizon, runs = steps.terms.shape[:2]
        self._gone = _gone(leg.path.diverged, horizon)
        passed = np.concatenate([*chain(*leg.path.passed)]).reshape(horizon, 2, -1, runs)
        self._passed, self._driven = np.moveaxis(passed, 0, 2), steps.arguments()
        key = slopes.places, leg.runs.translates, horizon, self.most, slopes.numbers
        *self._parts, self._rows = _made_once(key)

    def of_runs(self, some: slice, shares: Array) -> Array:
        """Compose them from step to step, times shares of shape (run, step, STATES); (run, step, STATES, number)."""
        count = some.stop - some.start
        rows = self._rows[:count]
        middle, through, end, moved = (each[:, :count] for each in self._parts)
        with np.errstate(all="ignore"):
            self._fill(some.start, middle, through, end)
            np.add(np.matmul(through, middle, out=moved), end, out=moved)
            # Products of what lies in one piece are faster.
            reached = rows[:, 0] = np.ascontiguousarray(moved[0, ..., STATES:])
            for step in range(1, len(moved)):
                reached = moved[step, ..., :STATES] @ reached
                reached += moved[step, ..., STATES:]
                rows[:, step] = reached
            rows *= shares[..., None]
        rows[self._gone[:, some].T] = 0.0
        return rows

    def _fill(self, first: int, middle: Array, through: Array, end: Array) -> None:
        """Differentiate the middle of each step, and its end by begin and middle, both by the numbers too."""
        period, translates, some = (
            self._runs.motion.period,
            self._runs.translates,
            slice(first, first + middle.shape[1]),
        )
        driven = [[each[..., some].reshape(*each.shape[:-2], -1) for each in own] for own in self._driven]
        for component in _ADDED:
            middle[..., component, component] = 0.0
        for stage, interval, into, by_state in ((0, 0.5 * period, middle, middle), (1, period, end, through)):
            passed = tuple(self._passed[stage, :, :, some].reshape(15, -1))
            turn = scaled(interval, passed[12:])
            shape = middle.shape[:2]
            for place, (turned, own) in enumerate(zip(exponential(turn), right_jacobian(turn), strict=True)):
                row, column = divmod(place, 3)
                into[..., 3 + column, 3 + row] = turned.reshape(shape)
                by_state[..., 3 + row, 6 + column] = interval * own.reshape(shape)
            for (row, column), slope in zip(self._slopes.places, self._slopes.values(passed, *driven), strict=True):
                if translates or row >= 3:
                    out = (by_state if column < STATES else into)[..., row, column]
                    np.multiply(interval, slope if np.size(slope) == 1 else slope.reshape(shape), out=out)
        for component in _ADDED:
            middle[..., component, component] += 1.0
