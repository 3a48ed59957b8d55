"""Compiled loops of playback: free runs from many samples of a flight, and their derivatives by the parameters.

A state is position (world), velocity (world), rotation (body to world) and body rate. Between two samples the rotors
are constant, and one step of the midpoint rule is taken:

    R' = R [omega]_x,   m v' = m g + R F,   I omega' = M - omega x I omega,   (M, F) = G x(R' v, omega),

with the terms x of the motion (`cpfls_cli.effects.polynomial.STATE_TERMS`, then those of a learned remainder) and the
weights G of each sample, which hold the rotors. All loops stand in one module because the cache of compiled code
follows its file.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.regressor.kernels import compiled

Function = TypeVar("Function", bound=Callable[..., Any])


def _compiled(function: Function) -> Function:
    return compiled(function)


class Motion(NamedTuple):
    """Measured motion, where runs start and what they are held against.

    Attributes
    ----------
    position, velocity : array, shape (time, 3), m and m/s, world frame
    rotation : array, shape (time, 3, 3)
        Body to world.
    rate : array, shape (time, 3), rad/s, body frame
    period : float, s
    """

    position: Array
    velocity: Array
    rotation: Array
    rate: Array
    period: float


class Body(NamedTuple):
    """What is moved.

    Attributes
    ----------
    mass, gravity : float
    inertia, inverse : array, shape (3, 3)
    """

    mass: float
    gravity: float
    inertia: Array
    inverse: Array


class Airflow(NamedTuple):
    """Terms of a learned remainder over the direction of the airflow; none where there are no rules.

    Attributes
    ----------
    breakpoints : array, shape (rules + 1,)
        Peaks of the membership functions, share of a turn; empty for none.
    order : int
        Of the harmonics in each consequent; 0 for the seesaw.
    """

    breakpoints: Array
    order: int


POLYNOMIAL_TERMS = 34
_POWERS = 2


@_compiled
def airflow_terms(airflow: Airflow) -> int:
    """Count the terms of a remainder: each column of the system times the speed, and times its square."""
    if len(airflow.breakpoints) == 0:
        return 0
    features = 1 + (2 * airflow.order if airflow.order else 1)
    return max(len(airflow.breakpoints) - 1, 1) * features * _POWERS


@_compiled
def _falling(u: float) -> tuple[float, float]:
    """Zadeh's z-function and its derivative: the copy of `cpfls_cli.fuzzy.membership.z_function`."""
    rest = 1.0 - u
    return (1.0 - 2.0 * u * u, -4.0 * u) if u < 0.5 else (2.0 * rest * rest, -4.0 * rest)


@_compiled
def _columns(airflow: Airflow, angle: float, value: Array, slope: Array) -> int:
    """Evaluate the columns of a periodic system of one angle and their slopes; see `cpfls_cli.fuzzy.basis.basis`."""
    rules = max(len(airflow.breakpoints) - 1, 1)
    features = 1 + (2 * airflow.order if airflow.order else 1)
    value[: rules * features] = 0.0
    slope[: rules * features] = 0.0
    turn = angle / (2.0 * np.pi)
    turn -= np.floor(turn)
    interval = 0
    for k in range(1, rules):
        interval += 1 if turn >= airflow.breakpoints[k] else 0
    degrees, degree_slopes, fires = np.ones(2), np.zeros(2), np.zeros(2, np.int64)
    count = 1
    if rules > 1:
        start, end = airflow.breakpoints[interval], airflow.breakpoints[interval + 1]
        width = end - start
        u = min((turn - start) / width, 1.0) if width > 0.0 else 1.0
        falling, by_u = _falling(u)
        by_angle = by_u / width / (2.0 * np.pi) if width > 0.0 else 0.0
        degrees[0], degrees[1], degree_slopes[0], degree_slopes[1] = falling, 1.0 - falling, by_angle, -by_angle
        fires[0], fires[1] = interval, (interval + 1) % rules
        count = 2
    for i in range(count):
        base = fires[i] * features
        value[base] += degrees[i]
        slope[base] += degree_slopes[i]
        if airflow.order == 0:
            wrapped = angle - 2.0 * np.pi * np.floor((angle + np.pi) / (2.0 * np.pi))
            if abs(wrapped) > 0.5 * np.pi:
                saw, saw_slope = (np.copysign(np.pi, wrapped) - wrapped) * (2.0 / np.pi), -2.0 / np.pi
            else:
                saw, saw_slope = wrapped * (2.0 / np.pi), 2.0 / np.pi
            value[base + 1] += degrees[i] * saw
            slope[base + 1] += degree_slopes[i] * saw + degrees[i] * saw_slope
        for k in range(1, airflow.order + 1):
            sine, cosine = np.sin(k * angle), np.cos(k * angle)
            value[base + k] += degrees[i] * sine
            slope[base + k] += degree_slopes[i] * sine + degrees[i] * k * cosine
            value[base + airflow.order + k] += degrees[i] * cosine
            slope[base + airflow.order + k] += degree_slopes[i] * cosine - degrees[i] * k * sine
    return rules * features


@_compiled
def terms(motion: Array, factors: IntArray, airflow: Airflow, value: Array, slope: Array) -> None:
    """Evaluate the terms of a motion and their derivatives.

    Parameters
    ----------
    motion : array, shape (6,)
        Air velocity and rate, body frame.
    factors : array of int, shape (21, 2)
        See `cpfls_cli.effects.polynomial.FACTORS`.
    airflow : Airflow
    value : array, shape (terms,)
        Written to.
    slope : array, shape (terms, 6)
        Written to, where it has room; has to be zero elsewhere.
    """
    value[0] = 1.0
    for i in range(6):
        value[1 + i] = motion[i]
        slope[1 + i, i] = 1.0
    at = 7
    for k in range(len(factors)):
        i, j = factors[k, 0], factors[k, 1]
        value[at] = motion[i] * motion[j]
        slope[at, i] = motion[j]
        slope[at, j] = motion[i]
        if i == j:
            slope[at, i] = 2.0 * motion[i]
        at += 1
    speed = np.sqrt(motion[0] ** 2 + motion[1] ** 2 + motion[2] ** 2)
    inverse = 1.0 / speed if speed > 0.0 else 0.0
    for i in range(3):
        value[at] = speed * motion[i]
        for j in range(3):
            slope[at, j] = motion[i] * motion[j] * inverse
        slope[at, i] += speed
        at += 1
    for i in range(3, 6):
        value[at] = abs(motion[i]) * motion[i]
        slope[at, i] = 2.0 * abs(motion[i])
        at += 1
    if len(airflow.breakpoints):
        _airflow(motion, airflow, at, value, slope)


@_compiled
def _airflow(motion: Array, airflow: Airflow, at: int, value: Array, slope: Array) -> None:
    forward, left = motion[0], motion[1]
    speed = np.sqrt(forward * forward + left * left)
    angle = np.arctan2(left, forward)
    inverse = 1.0 / speed if speed > 0.0 else 0.0
    column, by_angle = np.zeros(64), np.zeros(64)
    count = _columns(airflow, angle, column, by_angle)
    for c in range(count):
        value[at] = column[c] * speed
        slope[at, 0] = (column[c] * forward - by_angle[c] * left) * inverse
        slope[at, 1] = (column[c] * left + by_angle[c] * forward) * inverse
        value[at + 1] = column[c] * speed * speed
        slope[at + 1, 0] = 2.0 * column[c] * forward - by_angle[c] * left
        slope[at + 1, 1] = 2.0 * column[c] * left + by_angle[c] * forward
        at += 2


@_compiled
def _turn(vector: Array, matrix: Array, right: Array) -> None:
    """Write the rotation ``exp [a]_x`` and its right Jacobian, ``exp [a + d]_x = exp [a]_x exp [J d]_x``."""
    x, y, z = vector[0], vector[1], vector[2]
    square = x * x + y * y + z * z
    angle = np.sqrt(square)
    if angle < 1e-4:
        first, second, third = 1.0 - square / 6.0, 0.5 - square / 24.0, 1.0 / 6.0 - square / 120.0
    else:
        first, second = np.sin(angle) / angle, (1.0 - np.cos(angle)) / square
        third = (1.0 - first) / square
    for i in range(3):
        for j in range(3):
            outer = vector[i] * vector[j]
            diagonal = square if i == j else 0.0
            one = 1.0 if i == j else 0.0
            matrix[i, j] = one + second * (outer - diagonal)
            right[i, j] = one + third * (outer - diagonal)
    for i, j, value in ((0, 1, -z), (0, 2, y), (1, 2, -x)):
        matrix[i, j] += first * value
        matrix[j, i] -= first * value
        right[i, j] -= second * value
        right[j, i] += second * value


@_compiled
def _slopes(body: Body, weights: Array, value: Array, rotation: Array, rate: Array, out: Array) -> None:
    """Write the accelerations, world and body frame, and the body force: shape (9,)."""
    for k in range(6):
        total = 0.0
        for a in range(len(value)):
            total += weights[k, a] * value[a]
        out[k] = total
    inertia, inverse = body.inertia, body.inverse
    momentum = inertia @ rate
    m0 = out[0] - (rate[1] * momentum[2] - rate[2] * momentum[1])
    m1 = out[1] - (rate[2] * momentum[0] - rate[0] * momentum[2])
    m2 = out[2] - (rate[0] * momentum[1] - rate[1] * momentum[0])
    f0, f1, f2 = out[3], out[4], out[5]
    for i in range(3):
        out[i] = (rotation[i, 0] * f0 + rotation[i, 1] * f1 + rotation[i, 2] * f2) / body.mass
        out[3 + i] = inverse[i, 0] * m0 + inverse[i, 1] * m1 + inverse[i, 2] * m2
    out[2] -= body.gravity
    out[6], out[7], out[8] = f0, f1, f2


_FASTEST = 300.0
"""Body rate in rad/s, and speed in m/s, at which a run is called diverged and stands still."""


class Workspace(NamedTuple):
    """Arrays of one run; `value` and `slope` of all terms, `active` ones of both."""

    value: Array
    slope: Array
    active_value: Array
    active_slope: Array
    out: Array
    turn: Array
    right: Array
    half: Array
    half_right: Array


@_compiled
def _workspace(terms_count: int, active: int) -> Workspace:
    return Workspace(
        np.zeros(terms_count),
        np.zeros((terms_count, 6)),
        np.zeros(active),
        np.zeros((active, 6)),
        np.zeros(9),
        np.zeros((3, 3)),
        np.zeros((3, 3)),
        np.zeros((3, 3)),
        np.zeros((3, 3)),
    )


class Terms(NamedTuple):
    """The terms of the motion that a model uses.

    Attributes
    ----------
    factors : array of int, shape (21, 2)
        See `cpfls_cli.effects.polynomial.FACTORS`.
    airflow : Airflow
    active : array of int, shape (active,)
        Indices of the terms that have weights.
    total : int
        Number of all terms.
    """

    factors: IntArray
    airflow: Airflow
    active: IntArray
    total: int


@_compiled
def _evaluate(
    body: Body, used: Terms, weights: Array, velocity: Array, rotation: Array, rate: Array, w: Workspace
) -> None:
    motion = np.empty(6)
    for i in range(3):
        motion[i] = rotation[0, i] * velocity[0] + rotation[1, i] * velocity[1] + rotation[2, i] * velocity[2]
        motion[3 + i] = rate[i]
    terms(motion, used.factors, used.airflow, w.value, w.slope)
    for a in range(len(used.active)):
        w.active_value[a] = w.value[used.active[a]]
    _slopes(body, weights, w.active_value, rotation, rate, w.out)


@_compiled
def _rotated(first: Array, second: Array, out: Array) -> None:
    for i in range(3):
        for j in range(3):
            out[i, j] = first[i, 0] * second[0, j] + first[i, 1] * second[1, j] + first[i, 2] * second[2, j]


@_compiled
def rotation_error(measured: Array, predicted: Array, out: Array) -> None:
    """Write the rotation vector from a measured to a predicted rotation, body frame of the measured one."""
    relative = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            relative[i, j] = (
                measured[0, i] * predicted[0, j] + measured[1, i] * predicted[1, j] + measured[2, i] * predicted[2, j]
            )
    x = 0.5 * (relative[2, 1] - relative[1, 2])
    y = 0.5 * (relative[0, 2] - relative[2, 0])
    z = 0.5 * (relative[1, 0] - relative[0, 1])
    sine = np.sqrt(x * x + y * y + z * z)
    cosine = 0.5 * (relative[0, 0] + relative[1, 1] + relative[2, 2] - 1.0)
    angle = np.arctan2(sine, cosine)
    if sine > 1e-12:
        scale = angle / sine
    elif cosine > 0.0:
        scale = 1.0
    else:
        # Half a turn: the axis does not show in the skew part, its length is all that is used.
        x, y, z, scale = np.pi, 0.0, 0.0, 1.0
    out[0], out[1], out[2] = scale * x, scale * y, scale * z


@_compiled
def errors_of_runs(
    motion: Motion, body: Body, used: Terms, weights: Array, starts: IntArray, translates: bool, out: Array
) -> IntArray:
    """Simulate free runs and write their errors.

    Parameters
    ----------
    motion : Motion
    body : Body
    used : Terms
    weights : array, shape (time, 6, active)
        Torque (3) and force (3) by term, for the step that begins at each sample.
    starts : array of int, shape (run,)
    translates : bool
        Whether velocity and position are simulated; otherwise they stay.
    out : array, shape (run, horizon, 4, 3)
        Written to: predicted less measured position, velocity, rotation vector, rate.

    Returns
    -------
    array of int, shape (run,)
        Step at which a run diverged and was stopped; -1 for those that did not.
    """
    horizon, h = out.shape[1], motion.period
    diverged = np.full(len(starts), -1)
    w = _workspace(used.total, len(used.active))
    rotation, middle, moved = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    rate_m, velocity_m = np.empty(3), np.empty(3)
    for n in range(len(starts)):
        s = starts[n]
        position, velocity, rate = motion.position[s].copy(), motion.velocity[s].copy(), motion.rate[s].copy()
        rotation[:] = motion.rotation[s]
        for step in range(horizon):
            if diverged[n] < 0:
                G = weights[s + step]
                _evaluate(body, used, G, velocity, rotation, rate, w)
                _turn(0.5 * h * rate, w.half, w.half_right)
                for i in range(3):
                    velocity_m[i] = velocity[i] + (0.5 * h * w.out[i] if translates else 0.0)
                    rate_m[i] = rate[i] + 0.5 * h * w.out[3 + i]
                _rotated(rotation, w.half, middle)
                _evaluate(body, used, G, velocity_m, middle, rate_m, w)
                _turn(h * rate_m, w.turn, w.right)
                _rotated(rotation, w.turn, moved)
                rotation[:] = moved
                fastest = 0.0
                for i in range(3):
                    rate[i] += h * w.out[3 + i]
                    if translates:
                        position[i] += h * velocity_m[i]
                        velocity[i] += h * w.out[i]
                    fastest = max(fastest, abs(rate[i]), abs(velocity[i]))
                if not fastest < _FASTEST:
                    diverged[n] = step
                    for i in range(3):
                        rate[i] = min(max(rate[i], -_FASTEST), _FASTEST) if rate[i] == rate[i] else _FASTEST
                        velocity[i] = min(max(velocity[i], -_FASTEST), _FASTEST) if velocity[i] == velocity[i] else 0.0
                        if not abs(position[i]) < 1e6:
                            position[i] = motion.position[s, i]
                    if not np.abs(rotation).max() < 2.0:
                        rotation[:] = np.eye(3)
            at = s + step + 1
            for i in range(3):
                out[n, step, 0, i] = position[i] - motion.position[at, i]
                out[n, step, 1, i] = velocity[i] - motion.velocity[at, i]
                out[n, step, 3, i] = rate[i] - motion.rate[at, i]
            rotation_error(motion.rotation[at], rotation, out[n, step, 2])
    return diverged


class Parameters(NamedTuple):
    """What the weights and the inertia depend on.

    Attributes
    ----------
    parameter, row, term : array of int, shape (entry,)
        Weight ``(row, term)`` of all samples changes with a parameter; entries of a parameter stand together.
    first : array of int, shape (parameter + 1,)
        First entry of each parameter.
    value : array, shape (time, entry)
        Derivative of the weight by the parameter.
    inertia : array, shape (parameter, 3, 3)
        Derivative of the inertia tensor.
    moves : array of bool, shape (parameter,)
        Whether it is not zero.
    """

    row: IntArray
    term: IntArray
    first: IntArray
    value: Array
    inertia: Array
    moves: BoolArray


class Loss(NamedTuple):
    """How errors are weighed: ``sum over signals of weight * delta^2 (sqrt(1 + |e|^2 / delta^2) - 1)``.

    Attributes
    ----------
    weight, delta : array, shape (horizon, 4)
        For position, velocity, attitude, rate.
    """

    weight: Array
    delta: Array


@_compiled
def _linearise(
    body: Body,
    used: Terms,
    weights: Array,
    parameters: Parameters,
    sample: int,
    rotation: Array,
    velocity: Array,
    rate: Array,
    state: Array,
    w: Workspace,
    out: Array,
) -> None:
    """Write derivatives of the accelerations by each parameter, shape (6, parameter), given those of the state.

    `state` has the rows velocity, rotation vector (body frame), rate: shape (9, parameter).
    """
    active = len(used.active)
    by_motion = np.zeros((6, 6))
    for k in range(6):
        for a in range(active):
            weight = weights[k, a]
            if weight != 0.0:
                for i in range(6):
                    by_motion[k, i] += weight * w.slope[used.active[a], i]
    count = state.shape[1]
    air = np.empty(3)
    for i in range(3):
        air[i] = rotation[0, i] * velocity[0] + rotation[1, i] * velocity[1] + rotation[2, i] * velocity[2]
    force = w.out[6:9]
    momentum = body.inertia @ rate
    inertia, inverse = body.inertia, body.inverse
    d = np.empty(6)
    W = np.empty(6)
    for c in range(count):
        p0, p1, p2 = state[3, c], state[4, c], state[5, c]
        for i in range(3):
            d[i] = rotation[0, i] * state[0, c] + rotation[1, i] * state[1, c] + rotation[2, i] * state[2, c]
            d[3 + i] = state[6 + i, c]
        d[0] += air[1] * p2 - air[2] * p1
        d[1] += air[2] * p0 - air[0] * p2
        d[2] += air[0] * p1 - air[1] * p0
        for k in range(6):
            total = 0.0
            for i in range(6):
                total += by_motion[k, i] * d[i]
            W[k] = total
        for e in range(parameters.first[c], parameters.first[c + 1]):
            W[parameters.row[e]] += parameters.value[sample, e] * w.active_value[parameters.term[e]]
        if parameters.moves[c]:
            change = parameters.inertia[c]
            turned, pushed = change @ rate, change @ w.out[3:6]
            W[0] -= pushed[0] + rate[1] * turned[2] - rate[2] * turned[1]
            W[1] -= pushed[1] + rate[2] * turned[0] - rate[0] * turned[2]
            W[2] -= pushed[2] + rate[0] * turned[1] - rate[1] * turned[0]
        r0, r1, r2 = d[3], d[4], d[5]
        i0 = inertia[0, 0] * r0 + inertia[0, 1] * r1 + inertia[0, 2] * r2
        i1 = inertia[1, 0] * r0 + inertia[1, 1] * r1 + inertia[1, 2] * r2
        i2 = inertia[2, 0] * r0 + inertia[2, 1] * r1 + inertia[2, 2] * r2
        m0 = W[0] - (r1 * momentum[2] - r2 * momentum[1]) - (rate[1] * i2 - rate[2] * i1)
        m1 = W[1] - (r2 * momentum[0] - r0 * momentum[2]) - (rate[2] * i0 - rate[0] * i2)
        m2 = W[2] - (r0 * momentum[1] - r1 * momentum[0]) - (rate[0] * i1 - rate[1] * i0)
        f0 = W[3] - (force[1] * p2 - force[2] * p1)
        f1 = W[4] - (force[2] * p0 - force[0] * p2)
        f2 = W[5] - (force[0] * p1 - force[1] * p0)
        for i in range(3):
            out[i, c] = (rotation[i, 0] * f0 + rotation[i, 1] * f1 + rotation[i, 2] * f2) / body.mass
            out[3 + i, c] = inverse[i, 0] * m0 + inverse[i, 1] * m1 + inverse[i, 2] * m2


@_compiled
def _turned_state(turn: Array, right: Array, interval: float, phi: Array, rate: Array, out: Array) -> None:
    """Write derivatives of a rotation after a turn: ``turn' phi + right * interval * rate``."""
    for c in range(phi.shape[1]):
        for i in range(3):
            out[i, c] = turn[0, i] * phi[0, c] + turn[1, i] * phi[1, c] + turn[2, i] * phi[2, c]
            out[i, c] += interval * (right[i, 0] * rate[0, c] + right[i, 1] * rate[1, c] + right[i, 2] * rate[2, c])


@_compiled
def sensitivities(
    motion: Motion,
    body: Body,
    used: Terms,
    weights: Array,
    parameters: Parameters,
    loss: Loss,
    starts: IntArray,
    translates: bool,
    gradient: Array,
    hessian: Array,
    group: IntArray,
) -> float:
    """Sum the loss of free runs, its gradient and its Gauss-Newton Hessian by the parameters.

    Parameters
    ----------
    motion, body, used, weights, starts, translates
        See `errors_of_runs`.
    parameters : Parameters
    loss : Loss
    gradient : array, shape (group, parameter)
        Added to.
    hessian : array, shape (group, parameter, parameter)
        Added to.
    group : array of int, shape (run,)
        Which sum a run is added to.
    """
    h, horizon = motion.period, len(loss.weight)
    count = len(parameters.inertia)
    w = _workspace(used.total, len(used.active))
    rotation, middle, moved = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    rate_m, velocity_m, error = np.empty(3), np.empty(3), np.empty(3)
    state, middle_state, place = np.empty((9, count)), np.empty((9, count)), np.empty((3, count))
    change = np.empty((6, count))
    total = 0.0
    for n in range(len(starts)):
        s, g = starts[n], group[n]
        position, velocity, rate = motion.position[s].copy(), motion.velocity[s].copy(), motion.rate[s].copy()
        rotation[:] = motion.rotation[s]
        state[:] = 0.0
        place[:] = 0.0
        for step in range(horizon):
            G, sample = weights[s + step], s + step
            _evaluate(body, used, G, velocity, rotation, rate, w)
            _linearise(body, used, G, parameters, sample, rotation, velocity, rate, state, w, change)
            _turn(0.5 * h * rate, w.half, w.half_right)
            for i in range(3):
                velocity_m[i] = velocity[i] + (0.5 * h * w.out[i] if translates else 0.0)
                rate_m[i] = rate[i] + 0.5 * h * w.out[3 + i]
                for c in range(count):
                    middle_state[i, c] = state[i, c] + (0.5 * h * change[i, c] if translates else 0.0)
                    middle_state[6 + i, c] = state[6 + i, c] + 0.5 * h * change[3 + i, c]
            _turned_state(w.half, w.half_right, 0.5 * h, state[3:6], state[6:9], middle_state[3:6])
            _rotated(rotation, w.half, middle)
            _evaluate(body, used, G, velocity_m, middle, rate_m, w)
            _linearise(body, used, G, parameters, sample, middle, velocity_m, rate_m, middle_state, w, change)
            _turn(h * rate_m, w.turn, w.right)
            _rotated(rotation, w.turn, moved)
            rotation[:] = moved
            _turned_state(w.turn, w.right, h, state[3:6].copy(), middle_state[6:9], state[3:6])
            for i in range(3):
                rate[i] += h * w.out[3 + i]
                for c in range(count):
                    state[6 + i, c] += h * change[3 + i, c]
                if translates:
                    position[i] += h * velocity_m[i]
                    velocity[i] += h * w.out[i]
                    for c in range(count):
                        place[i, c] += h * middle_state[i, c]
                        state[i, c] += h * change[i, c]
            fastest = max(np.abs(rate).max(), np.abs(velocity).max())
            if not fastest < _FASTEST:
                # A run that leaves every flight behind: as bad as the largest error, and of no direction.
                total += np.sum(loss.weight[step:]) * _FASTEST
                break
            at = s + step + 1
            for signal in range(4):
                if loss.weight[step, signal] == 0.0:
                    continue
                if signal == 2:
                    rotation_error(motion.rotation[at], rotation, error)
                    rows = state[3:6]
                elif signal == 0:
                    error[:] = position - motion.position[at]
                    rows = place
                elif signal == 1:
                    error[:] = velocity - motion.velocity[at]
                    rows = state[0:3]
                else:
                    error[:] = rate - motion.rate[at]
                    rows = state[6:9]
                delta = loss.delta[step, signal]
                root = np.sqrt(1.0 + (error[0] ** 2 + error[1] ** 2 + error[2] ** 2) / (delta * delta))
                total += loss.weight[step, signal] * delta * delta * (root - 1.0)
                weight = loss.weight[step, signal] / root
                for c in range(count):
                    r0, r1, r2 = weight * rows[0, c], weight * rows[1, c], weight * rows[2, c]
                    gradient[g, c] += r0 * error[0] + r1 * error[1] + r2 * error[2]
                    for k in range(c + 1):
                        hessian[g, c, k] += r0 * rows[0, k] + r1 * rows[1, k] + r2 * rows[2, k]
    return total
