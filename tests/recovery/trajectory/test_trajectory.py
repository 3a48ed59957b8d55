"""The shortest move, and a mission in gusts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.signal import butter, sosfiltfilt

from cpfls_cli.arrays import Array
from cpfls_cli.simulation.inverse import room_left
from cpfls_cli.trajectory.excited import added_motion
from cpfls_cli.trajectory.legs import MoveOutcome, plan_moves
from cpfls_cli.trajectory.planning import plan, repeated
from cpfls_cli.trajectory.profile import LIMIT_NAMES, Limits
from cpfls_cli.trajectory.settings import ExciteSettings, TrajectorySettings
from tests.builders import gusty_flights
from tests.builders.gusty_flights import EVERY, GRAVITY, GUSTS, LARGE, MEMORY_S, SMALL, STEP_S, Flight

_DOUBLING = np.log([1.0, 1.0, 2.0, 4.0, 8.0])
BAND_HZ = (0.5, 5.0)


def shortest_duration(displacement: float, limits: Array, period: float | None, rng: np.random.Generator) -> float:
    """Minimise the total time, s, from two starts; spans that nothing limits are left out, as they are zero.

    Limits are on velocity to pop: one of them is finite, or the period given.
    """
    first = 0 if period is not None else max(4 - int(np.isfinite(limits).nonzero()[0][-1]), 0)
    matrix, bounds = _peak_constraints(displacement, limits, first)
    longer = (np.zeros(5 - first), rng.exponential(0.3, 5 - first))
    starts = [_feasible(matrix, bounds, period, more) for more in longer]
    return min(_minimised(start, matrix, bounds, period) for start in starts)


def _peak_constraints(displacement: float, limits: Array, first: int) -> tuple[Array, Array]:
    """Write ``matrix @ log spans <= bounds``; peaks are the displacement over the product of the spans above."""
    rows = [-(np.arange(5) >= 4 - order).astype(float) for order in range(4)]
    values = [np.log(limits[order] / displacement) for order in range(4)]
    rows += [-np.ones(5), -np.array([2.0, 1, 1, 1, 1])]
    values += [np.log(limits[4] / 2 / displacement), np.log(limits[5] / (2 * np.pi) / displacement)]
    finite = np.isfinite(values)
    return np.array(rows)[finite][:, first:], np.array(values)[finite]


def _feasible(matrix: Array, bounds: Array, period: float | None, more: Array) -> Array:
    """Take spans without holds, long enough for all limits, each lengthened by a factor exp(more)."""
    doubling = _DOUBLING[: len(more)] + np.cumsum(more)
    if period is None:
        return doubling + np.max((bounds - matrix @ doubling) / matrix.sum(axis=1))
    start = np.log(period) + doubling - doubling[0]
    start[-1] += np.max((matrix @ start - bounds) / -matrix[:, -1], initial=0.0)
    return start


def _total(y: Array) -> float:
    """Give ``log sum exp y``; SciPy's own spends its time around five numbers, not on them."""
    largest = y.max()
    return float(largest + np.log(np.exp(y - largest).sum()))


def _shares(y: Array) -> Array:
    """Differentiate `_total`."""
    parts = np.exp(y - y.max())
    return np.asarray(parts / parts.sum())


def _minimised(start: Array, matrix: Array, bounds: Array, period: float | None) -> float:
    size = len(start)
    constraints = [{"type": "ineq", "fun": lambda y: bounds - matrix @ y, "jac": lambda _: -matrix}]
    if size > 1:
        constraints.append({"type": "ineq", "fun": _nested, "jac": _nested_slope})
    if period is not None:
        held = np.eye(1, size)
        constraints.append({"type": "eq", "fun": lambda y: y[:1] - np.log(period), "jac": lambda _: held})
    spans = minimize(
        _total, start, jac=_shares, method="SLSQP", constraints=constraints, options={"maxiter": 500, "ftol": 1e-14}
    ).x
    broken = min(np.min(bounds - matrix @ spans, initial=0.0), _nested(spans).min(initial=0.0))
    return float(np.exp(_total(spans))) if broken > -1e-8 else np.inf


def _nested(spans: Array) -> Array:
    return spans[1:] - np.logaddexp.accumulate(spans)[:-1]


def _nested_slope(spans: Array) -> Array:
    size = len(spans)
    slope = np.eye(size)[1:]
    for row in range(size - 1):
        slope[row, : row + 1] -= _shares(spans[: row + 1])
    return slope


@pytest.mark.parametrize("chosen", [True, False], ids=["chosen-period", "given-period"])
def test_brute_force_finds_the_same_duration(chosen):
    rng = np.random.default_rng(21)
    count = 500
    displacement, limits = 10 ** rng.uniform(-3, 3, count), 10 ** rng.uniform(-3, 3, (6, count))
    limits[rng.random((6, count)) < 0.3] = np.inf
    period = None if chosen else 10 ** rng.uniform(-2, 1, count)
    moves = plan_moves(displacement, Limits(**dict(zip(LIMIT_NAMES, limits, strict=True))), period)
    for index in np.flatnonzero(moves.outcome == MoveOutcome.SOLVED):
        given = None if period is None else float(period[index])
        shortest = shortest_duration(float(displacement[index]), limits[:, index], given, rng)
        assert moves.duration[index] == pytest.approx(shortest, rel=1e-6), index


def mission_of(truth, seconds=30.0, runs=4):
    """Plan the mission that the docs tell to fly: a multisine on roll and pitch in hover, again and again."""
    asked = ExciteSettings(axes=("roll", "pitch"), band_hz=BAND_HZ)
    settings = TrajectorySettings(path="hover", duration_s=seconds, repeat=runs, sample_time_s=STEP_S, excite=asked)
    run = plan(settings, GRAVITY)
    # What flies clips at four times the squared speed of hover.
    fastest = float(np.sqrt(truth.mass * GRAVITY / truth.thrust_factor))
    vehicle = replace(truth.vehicle, rotor_speed_max_rad_s=fastest)
    room = room_left(run, added_motion(asked, run, GRAVITY), settings, vehicle)
    return repeated(room.added.onto(run, GRAVITY), settings, GRAVITY)


def flown(mission, flights):
    """Fly a mission with each vehicle in its gusts; give its logged body rates and rotor speeds, (time, 3 and 4)."""
    heading = np.zeros((len(mission.position), 1))
    path = np.hstack([mission.position, mission.velocity, mission.acceleration, heading])
    rngs, samples = [np.random.default_rng([77, each.draw]) for each in flights], len(path)
    memory = gusty_flights.memory
    pushes = [memory(rng, samples, MEMORY_S) * each.gusts for rng, each in zip(rngs, flights, strict=True)]
    shoves = [memory(rng, samples, np.ones(3)) * 0.06 * max(e.gusts) for rng, e in zip(rngs, flights, strict=True)]
    noise = [e.truth.gyro_noise * rng.standard_normal((samples, 3)) for rng, e in zip(rngs, flights, strict=True)]
    paths = np.repeat(path[:, None], len(flights), axis=1)
    air = (np.stack(each, axis=1) for each in (pushes, shoves, noise))
    *_, rate, speed, _, _ = gusty_flights.flown_along(flights, paths, *air)
    for number, (rng, each) in enumerate(zip(rngs, flights, strict=True)):
        measured = each.truth.speed_noise * speed[:, number].mean() * rng.standard_normal(speed[:, number].shape)
        yield rate[:, number], speed[:, number] + measured


def factors(truth, mission, rate, speed):
    """Find the factor on Ixx and Iyy in the band: rotation on torque, torque on rotation, other runs as instrument."""
    step, inertia = STEP_S * EVERY, np.array(truth.inertia)
    torque = speed**2 @ truth.mixer[1:].T
    taken = inertia * np.gradient(rate, step, axis=0) + np.cross(rate, inertia * rate) + truth.damping * rate
    band = butter(4, BAND_HZ, btype="bandpass", fs=1 / step, output="sos")
    firsts, length = [round(begin / step) for begin, _ in mission.runs], round(mission.runs[0][1] / step)
    t, h = (
        np.array([values[first : first + length, :2] for first in firsts])
        for values in (sosfiltfilt(band, each, axis=0) for each in (torque, taken))
    )
    others = t.sum(axis=0) - t
    products = [(t * t, t * h), (t * h, h * h), (others * t, others * h)]
    return np.array([above.sum(axis=(0, 1)) / below.sum(axis=(0, 1)) for above, below in products])


def found(mission, flights):
    """Give the factors of each flight, all flown at once, shape (flight, 3, 2)."""
    logs = zip(flights, flown(mission, flights), strict=True)
    return np.array([factors(flight.truth, mission, *log) for flight, log in logs])


def test_runs_are_instruments_for_each_other():
    """Two vehicles of 45 g and 1.5 kg, which have room for all of the signal, two draws of gusts each."""
    mission = mission_of(SMALL, seconds=16.0)
    np.testing.assert_array_equal(mission.position, mission_of(LARGE, seconds=16.0).position)
    flights = [Flight(truth, GUSTS, draw=draw) for truth in (SMALL, LARGE) for draw in (0, 1)]
    by_torque, _, by_runs = np.moveaxis(found(mission, flights), 1, 0)
    assert (by_torque > 1.05).all()
    assert np.abs(by_runs - 1).max() < 0.04
