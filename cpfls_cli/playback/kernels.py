"""Compiled loops of playback: free runs from many samples of a flight, and their derivatives by the parameters.

A state is position (world), velocity (world), rotation (body to world) and body rate. Between two samples the rotors
are constant, and one step of the midpoint rule is taken:

    R' = R [omega]_x,   m v' = m g + R F,   I omega' = M - omega x I omega,   (M, F) = G x(R' v, omega),

with the terms x of the motion (`cpfls_cli.effects.polynomial.STATE_TERMS`, then those of a learned remainder) and the
weights G of each sample, which hold the rotors. All loops stand in one module because the cache of compiled code
follows its file.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.compiling import Function, compiled, part
from cpfls_cli.effects.polynomial import STATE_TERMS
from cpfls_cli.playback.motion import FASTEST, Body, MeasuredMotion


def _inlined(function: Function) -> Function:
    """Compile into the caller: to hand over tuples of arrays takes longer than what most of these functions do."""
    return part(function, forceinline=True)


def _inlined_sum(function: Function) -> Function:
    """Compile into the caller, and let the processor take the terms of a sum in the order that suits its registers."""
    return part(function, fastmath={"reassoc", "contract"}, forceinline=True)


class Airflow(NamedTuple):
    """Terms of a learned remainder over the direction of the airflow; empty without rules.

    Attributes
    ----------
    breakpoints : array, shape (rules + 1,)
        Peaks of the membership functions, share of a turn; empty for none.
    order : int
        Of the harmonics in each consequent; 0 for the seesaw.
    """

    breakpoints: Array
    order: int


_POWERS = 2
"""Terms of a column of the remainder: by the speed, and by its square."""

_POLYNOMIAL = len(STATE_TERMS)


def airflow_terms(airflow: Airflow) -> int:
    """Count the terms of a remainder: each column of the system times the speed, and times its square."""
    if len(airflow.breakpoints) == 0:
        return 0
    features = 1 + (2 * airflow.order if airflow.order else 1)
    return max(len(airflow.breakpoints) - 1, 1) * features * _POWERS


@_inlined
def _falling(u: float) -> tuple[float, float]:
    """Zadeh's z-function and its derivative: the copy of `cpfls_cli.fuzzy.membership.z_function`."""
    rest = 1.0 - u
    return (1.0 - 2.0 * u * u, -4.0 * u) if u < 0.5 else (2.0 * rest * rest, -4.0 * rest)


@_inlined
def _degree(airflow: Airflow, angle: float) -> tuple[int, float, float]:
    """Find the first of the two rules of a periodic partition that fire, its degree and the slope of that.

    The next rule fires by what is left of 1; one rule alone always fires.
    """
    rules = len(airflow.breakpoints) - 1
    if rules < 2:
        return 0, 1.0, 0.0
    turn = angle / (2.0 * np.pi)
    turn -= np.floor(turn)
    interval = 0
    for k in range(1, rules):
        interval += 1 if turn >= airflow.breakpoints[k] else 0
    start, end = airflow.breakpoints[interval], airflow.breakpoints[interval + 1]
    width = end - start if end > start else 1.0
    falling, by_position = _falling(min((turn - start) / width, 1.0) if end > start else 1.0)
    return interval, falling, by_position / (width * 2.0 * np.pi)


@_inlined
def _consequents(airflow: Airflow, angle: float, feature: Array) -> int:
    """Write the consequent features and their slopes: 1, and a seesaw or harmonics of the angle."""
    feature[0, 0], feature[1, 0] = 1.0, 0.0
    if airflow.order == 0:
        wrapped = angle - 2.0 * np.pi * np.floor((angle + np.pi) / (2.0 * np.pi))
        outer = abs(wrapped) > 0.5 * np.pi
        feature[0, 1] = (np.copysign(np.pi, wrapped) - wrapped if outer else wrapped) * (2.0 / np.pi)
        feature[1, 1] = -2.0 / np.pi if outer else 2.0 / np.pi
        return 2
    sine, cosine = np.sin(angle), np.cos(angle)
    one_sine, one_cosine = sine, cosine
    for k in range(1, airflow.order + 1):
        feature[0, k], feature[1, k] = sine, k * cosine
        feature[0, airflow.order + k], feature[1, airflow.order + k] = cosine, -k * sine
        sine, cosine = sine * one_cosine + cosine * one_sine, cosine * one_cosine - sine * one_sine
    return 1 + 2 * airflow.order


MOST_COLUMNS = 64
"""Columns of a remainder at most: rules times features of a rule."""


@_inlined
def _write_terms(motion: Array, airflow: Airflow, feature: Array, value: Array, slope: Array) -> None:
    """Evaluate the terms of a motion and their derivatives.

    Parameters
    ----------
    motion : array, shape (6,)
        Air velocity and rate, body frame.
    feature : array, shape (2, MOST_COLUMNS)
        Work space.
    value : array, shape (terms,)
        Written to, in the order of `cpfls_cli.effects.polynomial.STATE_TERMS`.
    slope : array, shape (terms, 6), or (0, 6)
        Written to where it is not always zero; without rows it is not asked for.
    """
    value[0] = 1.0
    for i in range(6):
        value[1 + i] = motion[i]
    at = 7
    for pair in range(3):
        first, second = 3 * (pair // 2), 3 * ((pair + 1) // 2)
        for i in range(3):
            for j in range(0 if pair == 1 else i, 3):
                value[at] = motion[first + i] * motion[second + j]
                at += 1
    speed = np.sqrt(motion[0] ** 2 + motion[1] ** 2 + motion[2] ** 2)
    for i in range(3):
        value[28 + i] = speed * motion[i]
        value[31 + i] = abs(motion[3 + i]) * motion[3 + i]
    if len(slope):
        _write_slopes(motion, speed, slope)
    if len(airflow.breakpoints):
        _write_airflow(motion, airflow, feature, value, slope)


@_inlined
def _write_slopes(motion: Array, speed: float, slope: Array) -> None:
    for i in range(6):
        slope[1 + i, i] = 1.0
    at = 7
    for pair in range(3):
        first, second = 3 * (pair // 2), 3 * ((pair + 1) // 2)
        for i in range(first, first + 3):
            for j in range(second if pair == 1 else i, second + 3):
                slope[at, i] = motion[j]
                slope[at, j] = motion[i] if i != j else 2.0 * motion[i]
                at += 1
    inverse = 1.0 / speed if speed > 0.0 else 0.0
    for i in range(3):
        for j in range(3):
            slope[28 + i, j] = motion[i] * motion[j] * inverse
        slope[28 + i, i] += speed
        slope[31 + i, 3 + i] = 2.0 * abs(motion[3 + i])


@_inlined
def _write_airflow(motion: Array, airflow: Airflow, feature: Array, value: Array, slope: Array) -> None:
    """Write the terms of a remainder: each column of the system (see `cpfls_cli.fuzzy.basis.basis`) by the speed."""
    forward, left = motion[0], motion[1]
    speed, angle = np.sqrt(forward * forward + left * left), np.arctan2(left, forward)
    inverse = 1.0 / speed if speed > 0.0 else 0.0
    features, rules = _consequents(airflow, angle, feature), max(len(airflow.breakpoints) - 1, 1)
    rule, degree, by_angle = _degree(airflow, angle)
    value[_POLYNOMIAL:] = 0.0
    slope[_POLYNOMIAL:, :2] = 0.0
    for _ in range(min(rules, 2)):
        for f in range(features):
            at = _POLYNOMIAL + 2 * (rule * features + f)
            column = degree * feature[0, f]
            value[at], value[at + 1] = column * speed, column * speed * speed
            if len(slope):
                turned = by_angle * feature[0, f] + degree * feature[1, f]
                slope[at, 0] = (column * forward - turned * left) * inverse
                slope[at, 1] = (column * left + turned * forward) * inverse
                slope[at + 1, 0] = 2.0 * column * forward - turned * left
                slope[at + 1, 1] = 2.0 * column * left + turned * forward
        rule, degree, by_angle = (rule + 1) % rules, 1.0 - degree, -by_angle


@_inlined
def _turn(interval: float, rate: Array, matrix: Array, right: Array) -> None:
    """Write the rotation ``exp [a]_x`` by ``interval * rate``, and its right Jacobian.

    ``exp [a + d]_x = exp [a]_x exp [J d]_x``
    """
    x, y, z = interval * rate[0], interval * rate[1], interval * rate[2]
    square = x * x + y * y + z * z
    angle = np.sqrt(square)
    if angle < 1e-4:
        first, second, third = 1.0 - square / 6.0, 0.5 - square / 24.0, 1.0 / 6.0 - square / 120.0
    else:
        first, second = np.sin(angle) / angle, (1.0 - np.cos(angle)) / square
        third = (1.0 - first) / square
    for i, a, b in ((0, y, z), (1, x, z), (2, x, y)):
        matrix[i, i] = 1.0 - second * (a * a + b * b)
        right[i, i] = 1.0 - third * (a * a + b * b)
    for i, j, product, value in ((0, 1, x * y, -z), (0, 2, x * z, y), (1, 2, y * z, -x)):
        matrix[i, j] = second * product + first * value
        matrix[j, i] = second * product - first * value
        right[i, j] = third * product - second * value
        right[j, i] = third * product + second * value


@_inlined_sum
def _weighted(weights: Array, row: int, value: Array) -> float:
    total = 0.0
    for a in range(len(value)):
        total += weights[row, a] * value[a]
    return total


@_inlined
def _slopes(body: Body, weights: Array, value: Array, rotation: Array, rate: Array, out: Array) -> None:
    """Write the accelerations, world and body frame, and the body force: shape (9,)."""
    for k in range(6):
        out[k] = _weighted(weights, k, value)
    inertia, inverse = body.inertia, body.inverse
    p0 = inertia[0, 0] * rate[0] + inertia[0, 1] * rate[1] + inertia[0, 2] * rate[2]
    p1 = inertia[1, 0] * rate[0] + inertia[1, 1] * rate[1] + inertia[1, 2] * rate[2]
    p2 = inertia[2, 0] * rate[0] + inertia[2, 1] * rate[1] + inertia[2, 2] * rate[2]
    m0 = out[0] - (rate[1] * p2 - rate[2] * p1)
    m1 = out[1] - (rate[2] * p0 - rate[0] * p2)
    m2 = out[2] - (rate[0] * p1 - rate[1] * p0)
    f0, f1, f2 = out[3], out[4], out[5]
    for i in range(3):
        out[i] = (rotation[i, 0] * f0 + rotation[i, 1] * f1 + rotation[i, 2] * f2) / body.mass
        out[3 + i] = inverse[i, 0] * m0 + inverse[i, 1] * m1 + inverse[i, 2] * m2
    out[2] -= body.gravity
    out[6], out[7], out[8] = f0, f1, f2


class Terms(NamedTuple):
    """The terms of the motion that a model uses.

    Attributes
    ----------
    active : array of int, shape (active,)
        Indices of the terms that have weights.
    total : int
        Number of all terms.
    """

    airflow: Airflow
    active: IntArray
    total: int


class _State(NamedTuple):
    """A state, in arrays that a run writes over."""

    position: Array
    velocity: Array
    rotation: Array
    rate: Array


class _Space(NamedTuple):
    """What one evaluation leaves: terms with slopes, accelerations and force, turns with their right Jacobians."""

    motion: Array
    feature: Array
    value: Array
    slope: Array
    active: Array
    out: Array
    turn: Array
    right: Array
    half: Array
    half_right: Array
    moved: Array


def _new_state() -> _State:
    return _State(np.zeros(3), np.zeros(3), np.zeros((3, 3)), np.zeros(3))


def _new_space(used: Terms, slopes: bool) -> _Space:
    turns = (np.zeros((3, 3)) for _ in range(5))
    terms = np.zeros(used.total), np.zeros((used.total if slopes else 0, 6)), np.zeros(len(used.active))
    return _Space(np.zeros(6), np.zeros((2, MOST_COLUMNS)), *terms, np.zeros(9), *turns)


@_inlined
def _start(motion: MeasuredMotion, sample: int, state: _State) -> None:
    for i in range(3):
        state.position[i] = motion.position[sample, i]
        state.velocity[i] = motion.velocity[sample, i]
        state.rate[i] = motion.rate[sample, i]
        for j in range(3):
            state.rotation[i, j] = motion.rotation[sample, i, j]


@_inlined
def _evaluate(body: Body, used: Terms, weights: Array, state: _State, at: _Space) -> None:
    rotation, velocity, motion = state.rotation, state.velocity, at.motion
    for i in range(3):
        motion[i] = rotation[0, i] * velocity[0] + rotation[1, i] * velocity[1] + rotation[2, i] * velocity[2]
        motion[3 + i] = state.rate[i]
    _write_terms(motion, used.airflow, at.feature, at.value, at.slope)
    for a in range(len(used.active)):
        at.active[a] = at.value[used.active[a]]
    _slopes(body, weights, at.active, rotation, state.rate, at.out)


@_inlined
def _product(first: Array, second: Array, out: Array) -> None:
    for i in range(3):
        for j in range(3):
            out[i, j] = first[i, 0] * second[0, j] + first[i, 1] * second[1, j] + first[i, 2] * second[2, j]


@_inlined
def _to_middle(state: _State, middle: _State, h: float, translates: bool, at: _Space) -> None:
    """Go half a step along the slopes at its begin."""
    _turn(0.5 * h, state.rate, at.half, at.half_right)
    for i in range(3):
        middle.velocity[i] = state.velocity[i] + (0.5 * h * at.out[i] if translates else 0.0)
        middle.rate[i] = state.rate[i] + 0.5 * h * at.out[3 + i]
    _product(state.rotation, at.half, middle.rotation)


@_inlined
def _to_end(state: _State, middle: _State, h: float, translates: bool, at: _Space) -> None:
    """Go the whole step along the slopes in its middle."""
    _turn(h, middle.rate, at.turn, at.right)
    _product(state.rotation, at.turn, at.moved)
    for i in range(3):
        for j in range(3):
            state.rotation[i, j] = at.moved[i, j]
        state.rate[i] += h * at.out[3 + i]
        if translates:
            state.position[i] += h * middle.velocity[i]
            state.velocity[i] += h * at.out[i]


@_inlined
def _lost(state: _State) -> bool:
    """Tell whether a state is beyond what any vehicle flies, or not a number."""
    for i in range(3):
        for value in (state.rate[i], state.velocity[i]):
            if not abs(value) < FASTEST:
                return True
    return False


@_inlined
def _write_rotation_error(measured: Array, predicted: Array, turn: Array, out: Array) -> None:
    """Write the rotation vector from a measured to a predicted rotation, body frame of the measured one."""
    for i in range(3):
        for j in range(3):
            turned = measured[0, i] * predicted[0, j] + measured[1, i] * predicted[1, j]
            turn[i, j] = turned + measured[2, i] * predicted[2, j]
    x, y, z = 0.5 * (turn[2, 1] - turn[1, 2]), 0.5 * (turn[0, 2] - turn[2, 0]), 0.5 * (turn[1, 0] - turn[0, 1])
    sine, cosine = np.sqrt(x * x + y * y + z * z), 0.5 * (turn[0, 0] + turn[1, 1] + turn[2, 2] - 1.0)
    scale = np.arctan2(sine, cosine) / sine if sine > 1e-12 else 1.0
    if sine <= 1e-12 and cosine < 0.0:
        # Half a turn: the axis does not show in the skew part, its length is all that is used.
        x, y, z, scale = np.pi, 0.0, 0.0, 1.0
    out[0], out[1], out[2] = scale * x, scale * y, scale * z


@_inlined
def _write_errors(motion: MeasuredMotion, sample: int, state: _State, turn: Array, out: Array) -> None:
    for i in range(3):
        out[0, i] = state.position[i] - motion.position[sample, i]
        out[1, i] = state.velocity[i] - motion.velocity[sample, i]
        out[3, i] = state.rate[i] - motion.rate[sample, i]
    _write_rotation_error(motion.rotation[sample], state.rotation, turn, out[2])


@_inlined
def _copy(source: _State, target: _State) -> None:
    for i in range(3):
        target.position[i] = source.position[i]
        target.velocity[i] = source.velocity[i]
        target.rate[i] = source.rate[i]
        for j in range(3):
            target.rotation[i, j] = source.rotation[i, j]


class Parameters(NamedTuple):
    """What the weights and the inertia depend on.

    Attributes
    ----------
    row, term : array of int, shape (entry,)
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


NO_PARAMETERS = Parameters(
    row=np.zeros(0, dtype=np.int64),
    term=np.zeros(0, dtype=np.int64),
    first=np.zeros(1, dtype=np.int64),
    value=np.zeros((0, 0)),
    inertia=np.zeros((0, 3, 3)),
    moves=np.zeros(0, dtype=np.bool_),
)
"""For sums of the loss alone."""


class Loss(NamedTuple):
    """How errors are weighed: ``sum over signals of weight delta^2 (sqrt(1 + |e|^2 / delta^2) - 1)``.

    Attributes
    ----------
    weight, delta : array, shape (horizon, 4)
        For position, velocity, attitude, rate.
    """

    weight: Array
    delta: Array


_VELOCITY, _ROTATION, _RATE = 3, 6, 9
"""First rows of a tangent, shape (12, parameter): derivatives of a state by each parameter, position, velocity,
rotation as a vector in the body frame, and rate."""


class _Columns(NamedTuple):
    """Work space of a linearisation, a column for each parameter: of the air velocity, the wrench and its slopes."""

    air: Array
    wrench: Array
    by_motion: Array
    turned: Array
    pushed: Array


@_inlined
def _by_motion(used: Terms, weights: Array, slope: Array, out: Array) -> None:
    """Write derivatives of the wrench by air velocity and rate, shape (6, 6)."""
    for k in range(6):
        for i in range(6):
            out[k, i] = 0.0
    for a in range(len(used.active)):
        row = used.active[a]
        for k in range(6):
            weight = weights[k, a]
            for i in range(6):
                out[k, i] += weight * slope[row, i]


@_inlined
def _own_change(parameters: Parameters, sample: int, rate: Array, at: _Space, work: _Columns) -> None:
    """Write the derivatives of the wrench by the parameters, less those of ``I omega'`` by the inertia."""
    turned, pushed, wrench = work.turned, work.pushed, work.wrench
    _clear(wrench, 0)
    for c in range(len(parameters.moves)):
        for e in range(parameters.first[c], parameters.first[c + 1]):
            wrench[parameters.row[e], c] += parameters.value[sample, e] * at.active[parameters.term[e]]
        if parameters.moves[c]:
            change = parameters.inertia[c]
            for i in range(3):
                turned[i] = change[i, 0] * rate[0] + change[i, 1] * rate[1] + change[i, 2] * rate[2]
                pushed[i] = change[i, 0] * at.out[3] + change[i, 1] * at.out[4] + change[i, 2] * at.out[5]
            for i in range(3):
                j, k = (i + 1) % 3, (i + 2) % 3
                wrench[i, c] -= pushed[i] + rate[j] * turned[k] - rate[k] * turned[j]


@_inlined
def _weigh_rows(first: float, second: float, third: float, rows: Array, begin: int, out: Array) -> None:
    """Write the weighted sum of three rows."""
    for c in range(len(out)):
        out[c] = first * rows[begin, c] + second * rows[begin + 1, c] + third * rows[begin + 2, c]


@_inlined
def _linearise(
    body: Body,
    used: Terms,
    weights: Array,
    parameters: Parameters,
    sample: int,
    state: _State,
    tangent: Array,
    at: _Space,
    work: _Columns,
    out: Array,
) -> None:
    """Write derivatives of the accelerations (world, body frame) by each parameter, shape (6, parameter).

    ``R' dv + v_b x dphi`` and ``d omega`` move the wrench; then ``m dv' = R (dF - F x dphi)`` and
    ``I d omega' = dM - d omega x I omega - omega x I d omega``. The gyroscopic torque is a slope by the rate as well.
    """
    rotation, rate, air, slope, wrench = state.rotation, state.rate, at.motion, work.by_motion, work.wrench
    _by_motion(used, weights, at.slope, slope)
    _own_change(parameters, sample, rate, at, work)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        for m in range(3):
            slope[i, 3 + m] -= rate[j] * body.inertia[k, m] - rate[k] * body.inertia[j, m]
            # Of the momentum I omega, whose cross product with d omega is added.
            slope[i, 3 + j] -= body.inertia[k, m] * rate[m]
            slope[i, 3 + k] += body.inertia[j, m] * rate[m]
    # What does not hang on the column is read before each loop over columns, so that the loop runs in registers.
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        r0, r1, r2, a0, a1 = rotation[0, i], rotation[1, i], rotation[2, i], air[j], air[k]
        for c in range(out.shape[1]):
            turned = a0 * tangent[_ROTATION + k, c] - a1 * tangent[_ROTATION + j, c]
            work.air[i, c] = turned + r0 * tangent[3, c] + r1 * tangent[4, c] + r2 * tangent[5, c]
    for k in range(6):
        s0, s1, s2, s3, s4, s5 = slope[k, 0], slope[k, 1], slope[k, 2], slope[k, 3], slope[k, 4], slope[k, 5]
        for c in range(out.shape[1]):
            moved = s0 * work.air[0, c] + s1 * work.air[1, c] + s2 * work.air[2, c]
            turned = s3 * tangent[9, c] + s4 * tangent[10, c] + s5 * tangent[11, c]
            wrench[k, c] += moved + turned
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        f0, f1 = at.out[6 + j], at.out[6 + k]
        for c in range(out.shape[1]):
            wrench[3 + i, c] -= f0 * tangent[_ROTATION + k, c] - f1 * tangent[_ROTATION + j, c]
    for i in range(3):
        _weigh_rows(
            rotation[i, 0] / body.mass, rotation[i, 1] / body.mass, rotation[i, 2] / body.mass, wrench, 3, out[i]
        )
        _weigh_rows(body.inverse[i, 0], body.inverse[i, 1], body.inverse[i, 2], wrench, 0, out[3 + i])


@_inlined
def _move_row(begin: Array, change: Array, h: float, out: Array) -> None:
    for c in range(len(out)):
        out[c] = begin[c] + h * change[c]


@_inlined
def _tangent_moved(
    begin: Array, rate: Array, change: Array, h: float, moves: bool, turn: Array, right: Array, out: Array
) -> None:
    """Take a step of the derivatives of a state: ``turn' rotation + h right rate``, and by the accelerations' change.

    Parameters
    ----------
    begin : array, shape (12, parameter)
        At its begin.
    rate : array, shape (12, parameter)
        That the body turns and moves with.
    out : array, shape (12, parameter)
        Not `begin`.
    """
    for i in range(3):
        t0, t1, t2 = turn[0, i], turn[1, i], turn[2, i]
        r0, r1, r2 = h * right[i, 0], h * right[i, 1], h * right[i, 2]
        for c in range(out.shape[1]):
            turned = t0 * begin[6, c] + t1 * begin[7, c] + t2 * begin[8, c]
            out[_ROTATION + i, c] = turned + r0 * rate[9, c] + r1 * rate[10, c] + r2 * rate[11, c]
        _move_row(begin[_RATE + i], change[3 + i], h, out[_RATE + i])
        _move_row(begin[i], rate[_VELOCITY + i], h if moves else 0.0, out[i])
        _move_row(begin[_VELOCITY + i], change[i], h if moves else 0.0, out[_VELOCITY + i])


_ROWS = 9
"""Of a Jacobian at a time: those of a step, but for position, which is not weighed."""


@_inlined
def _add_squares(rows: Array, filled: int, hessian: Array) -> None:
    """Add products of columns, of some rows and of zeros behind them, to the lower triangle."""
    for first in range(0, filled, _ROWS):
        for c in range(len(hessian)):
            for k in range(c + 1):
                product = 0.0
                for r in range(_ROWS):
                    product += rows[first + r, c] * rows[first + r, k]
                hessian[c, k] += product


@_inlined
def _clear(matrix: Array, first: int) -> None:
    """Set rows from one on to 0."""
    for i in range(first, matrix.shape[0]):
        for c in range(matrix.shape[1]):
            matrix[i, c] = 0.0


class _Sums(NamedTuple):
    """What runs are added to, and what they are written to: errors where `writes`, else an array to work in."""

    group: IntArray
    gradient: Array
    hessian: Array
    writes: bool
    errors: Array
    diverged: IntArray


class _Work(NamedTuple):
    """Arrays to work in: made by NumPy, as numba compiles long for each that it makes."""

    state: _State
    middle: _State
    before: _State
    at: _Space
    tangent: Array
    half: Array
    moved: Array
    columns: _Columns
    change: Array
    rows: Array


@_inlined
def _add_rows(loss: Loss, step: int, error: Array, tangent: Array, gradient: Array, rows: Array, filled: int) -> int:
    """Add the gradient of a step's loss, and write the rows of its Jacobian; give how many there are then."""
    for signal in range(4):
        weight, delta = loss.weight[step, signal], loss.delta[step, signal]
        if weight > 0.0:
            size = error[signal, 0] ** 2 + error[signal, 1] ** 2 + error[signal, 2] ** 2
            share = np.sqrt(weight / np.sqrt(1.0 + size / (delta * delta)))
            for i in range(3):
                for c in range(len(gradient)):
                    row = share * tangent[3 * signal + i, c]
                    rows[filled, c] = row
                    gradient[c] += share * error[signal, i] * row
                filled += 1
    return filled


@_inlined
def _loss_of(loss: Loss, step: int, error: Array) -> float:
    total = 0.0
    for signal in range(4):
        weight, delta = loss.weight[step, signal], loss.delta[step, signal]
        if weight > 0.0:
            size = error[signal, 0] ** 2 + error[signal, 1] ** 2 + error[signal, 2] ** 2
            total += weight * delta * delta * (np.sqrt(1.0 + size / (delta * delta)) - 1.0)
    return total


@compiled
def _run_all(
    motion: MeasuredMotion,
    body: Body,
    used: Terms,
    weights: Array,
    parameters: Parameters,
    loss: Loss,
    starts: IntArray,
    translates: bool,
    sums: _Sums,
    work: _Work,
) -> float:
    """Simulate free runs, write their errors or sum their loss and its derivatives, see `sensitivities`."""
    h, count, total = motion.period, len(parameters.moves), 0.0
    state, middle, at = work.state, work.middle, work.at
    tangent, half, moved = work.tangent, work.half, work.moved
    for n in range(len(starts)):
        _start(motion, starts[n], state)
        _clear(tangent, 0)
        filled = 0
        for step in range(len(loss.weight)):
            sample, error = starts[n] + step, sums.errors[n if sums.writes else 0, step if sums.writes else 0]
            if sums.diverged[n] < 0:
                if sums.writes:
                    _copy(state, work.before)
                here, of_here, turn, right, ahead, elapsed = state, tangent, at.half, at.half_right, half, 0.5 * h
                # Written once for both halves of a step: what is written twice takes twice as long to compile.
                for in_middle in (False, True):
                    _evaluate(body, used, weights[sample], here, at)
                    if count:
                        _linearise(
                            body,
                            used,
                            weights[sample],
                            parameters,
                            sample,
                            here,
                            of_here,
                            at,
                            work.columns,
                            work.change,
                        )
                    if in_middle:
                        _to_end(state, middle, h, translates, at)
                    else:
                        _to_middle(state, middle, h, translates, at)
                    if count:
                        _tangent_moved(tangent, of_here, work.change, elapsed, translates, turn, right, ahead)
                    here, of_here, turn, right, ahead, elapsed = middle, half, at.turn, at.right, moved, h
                tangent, moved = moved, tangent
                if _lost(state):
                    sums.diverged[n] = step
                    if sums.writes:
                        _copy(work.before, state)
            if sums.writes:
                _write_errors(motion, sample + 1, state, at.moved, error)
            elif sums.diverged[n] >= 0:
                # A run that leaves every flight behind: as bad as the largest error, and of no direction.
                for signal in range(4):
                    total += loss.weight[step, signal] * loss.delta[step, signal] * FASTEST
            else:
                _write_errors(motion, sample + 1, state, at.moved, error)
                total += _loss_of(loss, step, error)
                if count:
                    filled = _add_rows(loss, step, error, tangent, sums.gradient[sums.group[n]], work.rows, filled)
        if count:
            _clear(work.rows, filled)
            _add_squares(work.rows, filled, sums.hessian[sums.group[n]])
    return total


def _new_work(used: Terms, count: int, horizon: int) -> _Work:
    columns = _Columns(np.zeros((3, count)), np.zeros((6, count)), np.zeros((6, 6)), np.zeros(3), np.zeros(3))
    tangent, half, moved = np.zeros((3, 12, count))
    return _Work(
        state=_new_state(),
        middle=_new_state(),
        before=_new_state(),
        at=_new_space(used, count > 0),
        tangent=tangent,
        half=half,
        moved=moved,
        columns=columns,
        change=np.zeros((6, count)),
        rows=np.zeros((12 * horizon + _ROWS, count)),
    )


def errors_of_runs(
    motion: MeasuredMotion, body: Body, used: Terms, weights: Array, starts: IntArray, translates: bool, out: Array
) -> IntArray:
    """Simulate free runs and write their errors.

    Parameters
    ----------
    weights : array, shape (time, 6, active)
        Torque (3) and force (3) by term, for the step that begins at each sample.
    starts : array of int, shape (run,)
    translates : bool
        Whether velocity and position are simulated; otherwise they stay.
    out : array, shape (run, horizon, 4, 3)
        Written to: predicted less measured position, velocity, rotation vector, rate. A run that diverges stays as it
        was before the step in which it did.

    Returns
    -------
    array of int, shape (run,)
        Step at which a run diverged; -1 for those that did not.
    """
    horizon, diverged, none = out.shape[1], np.full(len(starts), -1), np.zeros((1, 0))
    loss, work = Loss(*np.zeros((2, horizon, 4))), _new_work(used, 0, horizon)
    sums = _Sums(np.zeros(len(starts), np.int64), none, none[:, None], True, out, diverged)
    _run_all(motion, body, used, weights, NO_PARAMETERS, loss, starts, translates, sums, work)
    return diverged


def sensitivities(
    motion: MeasuredMotion,
    body: Body,
    used: Terms,
    weights: Array,
    parameters: Parameters,
    loss: Loss,
    starts: IntArray,
    translates: bool,
    group: IntArray,
    gradient: Array,
    hessian: Array,
) -> float:
    """Sum the loss of free runs, its gradient and its Gauss-Newton Hessian by the parameters.

    The gradient is exact: the derivative of a rotation's error vector differs from that of the rotation only across
    the vector, and the loss depends on its length alone. The rows of a run's Jacobian are collected, and multiplied
    with each other at its end.

    Parameters
    ----------
    motion, body, used, weights, starts, translates
        See `errors_of_runs`.
    parameters : Parameters
        Without any, the loss alone is summed, to the same digits.
    group : array of int, shape (run,)
        Which sum a run is added to.
    gradient : array, shape (group, parameter)
        Added to.
    hessian : array, shape (group, parameter, parameter)
        Added to, the lower triangle.
    """
    diverged, errors = np.full(len(starts), -1), np.zeros((1, 1, 4, 3))
    work = _new_work(used, len(parameters.moves), len(loss.weight))
    sums = _Sums(group, gradient, hessian, False, errors, diverged)
    return float(_run_all(motion, body, used, weights, parameters, loss, starts, translates, sums, work))
