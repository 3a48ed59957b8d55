"""Trajectories of any settings: profiles, limits of rotation, samples and the time that they take."""

from __future__ import annotations

from dataclasses import astuple
from decimal import Decimal, localcontext
from math import factorial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cpfls_cli import rotations
from cpfls_cli.arrays import Array
from cpfls_cli.dynamics import newton_euler_torque
from cpfls_cli.trajectory.legs import MoveOutcome, plan_moves
from cpfls_cli.trajectory.profile import LIMIT_NAMES, BaseProfile, Holds, Limits
from cpfls_cli.trajectory.rotation import RotationLimits, full_rotation
from cpfls_cli.trajectory.settings import RotationSettings

hold = st.one_of(st.just(0.0), st.floats(0.01, 3.0))
profiles = st.builds(
    BaseProfile,
    amplitude=st.floats(0.1, 20.0),
    period=st.floats(0.2, 3.0),
    holds=st.builds(Holds, snap=hold, jerk=hold, acceleration=hold, velocity=hold),
)
INERTIA = (0.6, 0.7, 1.2, 0.02, -0.01, 0.03)
TORQUE = (5.0, 5.0, 3.0)
_TURN = 2 * Decimal("3.14159265358979323846264338327950288419716939937510582097494459230781640629")
# Sine and cosine after a quarter, a half, three quarters and the whole of a wave.
_QUARTERS = {"0.25": (1, 0), "0.5": (0, -1), "0.75": (-1, 0), "1": (0, 1)}
CASES = 50_000


def pulse_sequence(profile):
    """Build the signs and lengths by nesting: every ramp up, its hold, its ramp down."""
    sequence = [(1, profile.period)]
    for length in (profile.holds.snap, profile.holds.jerk, profile.holds.acceleration, profile.holds.velocity):
        sequence = [*sequence, (0, length), *[(-sign, duration) for sign, duration in sequence]]
    return [(sign, length) for sign, length in sequence if length > 0]


@settings(max_examples=50, deadline=None)
@given(profiles)
def test_peaks_bound_the_samples_and_are_reached(profile):
    lengths = [length for _, length in pulse_sequence(profile)]
    ends = np.cumsum(lengths)
    quarters = np.concatenate([ends - fraction * np.array(lengths) for fraction in (0.0, 0.25, 0.5, 0.75)])
    np.testing.assert_allclose(np.abs(profile.sample(quarters)).max(axis=0), astuple(profile.peaks), rtol=1e-9)
    everywhere = np.abs(profile.sample(np.linspace(0, profile.duration, 2000))).max(axis=0)
    assert (everywhere <= np.array(astuple(profile.peaks)) * (1 + 1e-9)).all()


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    rate=st.floats(2.0, 20.0),
    acceleration=st.floats(4.0, 100.0),
    frequency=st.floats(0.1, 1.0),
    duration=st.floats(15.0, 30.0),
    torque=st.booleans(),
)
def test_limits_hold_between_the_samples_that_were_looked_at(seed, rate, acceleration, frequency, duration, torque):
    chosen = RotationSettings(
        rate_max_rad_s=rate,
        acceleration_max_rad_s2=acceleration,
        frequency_max_hz=frequency,
        torque_max_n_m=TORQUE if torque else None,
    )
    path = full_rotation(chosen, duration, np.random.default_rng(seed), INERTIA)
    motion = path.sample(path.times(20_000))
    motions = motion.attitude, motion.attitude_rate, motion.attitude_acceleration
    assert np.abs(motion.attitude_rate).max() <= rate
    assert np.abs(rotations.body_rate(*motions[:2])).max() <= rate
    assert np.abs(motion.attitude_acceleration).max() <= acceleration
    assert np.abs(rotations.body_acceleration(*motions)).max() <= acceleration
    if torque:
        assert np.all(np.abs(RotationLimits(chosen, INERTIA).loads(motion)[:, 12:]) <= 1)


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_torque_shares_are_those_of_newton_and_euler(seed):
    chosen = RotationSettings(torque_max_n_m=TORQUE)
    path = full_rotation(chosen, 10.0, np.random.default_rng(seed), INERTIA)
    motion = path.sample(path.times(50))
    motions = motion.attitude, motion.attitude_rate, motion.attitude_acceleration
    expected = newton_euler_torque(*motions, np.array([[0.6, 0.02, -0.01], [0.02, 0.7, 0.03], [-0.01, 0.03, 1.2]]))
    shares = RotationLimits(chosen, INERTIA).loads(motion)[:, 12:]
    np.testing.assert_allclose(rotations.generalised_torque(motion.attitude, shares * TORQUE), expected, atol=1e-12)


def integrated(profile: BaseProfile) -> tuple[Array, Array]:
    """Integrate the pop from rest, at the quarters of every wave and hold: times, and displacement to pop by time."""
    with localcontext(prec=60):
        amplitude = _amplitude(profile)
        start, state, times, states = Decimal(0), [Decimal(0)] * 7, [], []
        for sign, length in _sequence(profile):
            for fraction, (sine, cosine) in _QUARTERS.items():
                elapsed = length * Decimal(fraction)
                wave = _wave(elapsed, _TURN / length, sine, cosine)
                coast = _coasted(state, elapsed)
                ahead = [rest + sign * amplitude * part for rest, part in zip(coast, wave, strict=True)]
                times.append(float(start + elapsed))
                states.append([float(value) for value in ahead])
            start, state = start + length, ahead
    return np.array(times), np.array(states)


def _amplitude(profile: BaseProfile) -> Decimal:
    """Divide the displacement by all five spans, each of which is the sum of those before and a hold."""
    spans: list[Decimal] = []
    for hold in (profile.period, *astuple(profile.holds)):
        spans.append(sum(spans, Decimal(hold)))
    amplitude = Decimal(profile.displacement)
    for span in spans:
        amplitude /= span
    return amplitude


def _sequence(profile: BaseProfile) -> list[tuple[int, Decimal]]:
    """Nest signs and lengths: every rise, its hold, its fall."""
    pieces = [(1, Decimal(profile.period))]
    for length in map(Decimal, astuple(profile.holds)):
        pieces = [*pieces, (0, length), *[(-sign, duration) for sign, duration in pieces]]
    return [(sign, length) for sign, length in pieces if length]


def _coasted(state: list[Decimal], t: Decimal) -> list[Decimal]:
    taylor = [sum(value * t**k / factorial(k) for k, value in enumerate(state[order:5])) for order in range(5)]
    return [*taylor, Decimal(0), Decimal(0)]


def _wave(t: Decimal, f: Decimal, sine: int, cosine: int) -> list[Decimal]:
    """Integrals of ``1 - cos(f t)``, from five to none, and its slope."""
    return [
        t**5 / 120 - t**3 / (6 * f**2) + t / f**4 - sine / f**5,
        t**4 / 24 - t**2 / (2 * f**2) + (1 - cosine) / f**4,
        t**3 / 6 - t / f**2 + sine / f**3,
        t**2 / 2 - (1 - cosine) / f**2,
        t - sine / f,
        Decimal(1 - cosine),
        f * sine,
    ]


def test_samples_are_the_integral_of_the_pop():
    rng = np.random.default_rng(3)
    count = 60
    limits = 10 ** rng.uniform(-3, 3, (6, count))
    limits[:5][rng.random((5, count)) < 0.2] = np.inf
    for move in plan_moves(10 ** rng.uniform(-3, 3, count), Limits(**dict(zip(LIMIT_NAMES, limits, strict=True)))):
        times, states = integrated(move.profile)
        peaks = np.array(astuple(move.peaks))
        slopes = np.append(peaks[1:], peaks[6] * 2 * np.pi / move.profile.period)
        # A time of type float may be off by a rounding of the duration.
        tolerance = 1e-12 * peaks + 4 * np.finfo(float).eps * move.duration * slopes
        inside = times < move.duration
        assert (np.abs(move.profile.sample(times[inside]) - states[inside]) <= tolerance).all()
        assert abs(states[-1, 0] - move.profile.displacement) <= 1e-12 * peaks[0]
        assert (np.abs(states[-1, 1:]) <= 1e-12 * peaks[1:]).all()


class Batch:
    """Random moves: each limit is absent in three of ten, and all of them are in some."""

    def __init__(self, chosen):
        rng = np.random.default_rng(11)
        self.displacement = 10 ** rng.uniform(-3, 3, CASES) * rng.choice([-1, 1], CASES)
        self.limits = 10 ** rng.uniform(-3, 3, (6, CASES))
        self.limits[rng.random((6, CASES)) < 0.3] = np.inf
        self.period = None if chosen else 10 ** rng.uniform(-2, 1, CASES)
        self.moves = self.planned(self.limits)

    def planned(self, limits):
        return plan_moves(self.displacement, Limits(**dict(zip(LIMIT_NAMES, limits, strict=True))), self.period)


@pytest.fixture(scope="module", params=[True, False], ids=["chosen-period", "given-period"])
def batch(request):
    return Batch(request.param)


def peaks_upward(batch):
    """Multiply the printed formulas up from the amplitude, where it is finite."""
    period, (snap_hold, jerk_hold, acceleration_hold, velocity_hold) = batch.moves.period, batch.moves.holds
    smooth = period > 0
    snap = batch.moves.peaks[5] / 2 * np.where(smooth, period, np.nan)
    jerk = snap * (period + snap_hold)
    acceleration = jerk * (2 * period + snap_hold + jerk_hold)
    velocity = acceleration * (4 * period + 2 * snap_hold + jerk_hold + acceleration_hold)
    rise = 8 * period + 4 * snap_hold + 2 * jerk_hold + acceleration_hold
    pop = 2 * np.pi * snap[smooth] / period[smooth] ** 2
    peaks = np.array([velocity * (rise + velocity_hold), velocity, acceleration, jerk, snap, batch.moves.peaks[5]])
    return np.vstack([peaks[:, smooth], pop]), smooth


def test_a_move_is_found_wherever_anything_limits_it_and_nothing_is_not_a_number(batch):
    limited = np.isfinite(batch.limits).any(axis=0) | (batch.period is not None)
    np.testing.assert_array_equal(batch.moves.outcome, np.where(limited, MoveOutcome.SOLVED, MoveOutcome.NO_LIMIT))
    assert np.isfinite(batch.moves.duration[limited]).all()
    for values in (batch.moves.duration, batch.moves.peaks, batch.moves.holds, batch.moves.period):
        assert not np.isnan(values).any()


def test_no_derivative_is_above_its_limit_and_the_displacement_is_covered(batch):
    assert (batch.moves.peaks[1:] <= batch.limits * (1 + 1e-12)).all()
    upward, smooth = peaks_upward(batch)
    assert smooth.any()
    assert (upward[1:] <= batch.limits[:, smooth] * (1 + 1e-12)).all()
    np.testing.assert_allclose(upward[0], np.abs(batch.displacement[smooth]), rtol=1e-12)


def test_a_chosen_move_reaches_a_limit(batch):
    reached = batch.moves.active.any(axis=0) | (batch.moves.outcome == MoveOutcome.NO_LIMIT)
    if batch.period is None:
        assert reached.all()
    else:
        # Where the period alone sets the time, nothing is held.
        np.testing.assert_allclose(batch.moves.duration[~reached], 16 * batch.period[~reached], rtol=1e-14)


@pytest.mark.parametrize("order", range(6), ids=LIMIT_NAMES)
def test_a_looser_limit_never_makes_a_move_longer(batch, order):
    looser = batch.limits.copy()
    looser[order] *= 1.5
    duration, before = batch.planned(looser).duration, batch.moves.duration
    assert (duration <= before * (1 + 1e-13)).all()
    assert (duration < before * (1 - 1e-6)).any()


def test_samples_stay_within_the_peaks_and_end_at_rest(batch):
    for index in range(0, CASES, CASES // 400):
        if batch.moves.outcome[index] != MoveOutcome.SOLVED:
            continue
        move = batch.moves[index]
        peaks = np.array(astuple(move.peaks))
        time = np.append(np.linspace(0, move.duration, 200)[1:-1], np.nextafter(move.duration, 0.0))
        motion = np.abs(move.profile.sample(time))
        assert (motion <= peaks * (1 + 1e-12)).all()
        assert (motion[:, 1:] <= batch.limits[:, index] * (1 + 1e-12)).all()
        assert abs(motion[-1, 0] / peaks[0] - 1) <= 1e-9
        # Relative to the peak; what the next derivative does within one rounding of the time is no error.
        jumped = (move.duration - time[-1]) * peaks[2:4]
        falling = np.isfinite(peaks[2:4])
        assert (motion[-1, 1:3][falling] <= (1e-9 * peaks[1:3] + jumped)[falling]).all()
