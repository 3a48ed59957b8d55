"""Many random moves over six decades: limits kept, the end reached, and nothing that is not a number."""

from dataclasses import astuple

import numpy as np
import pytest

from cpfls_cli.trajectory.legs import MoveOutcome, plan_moves
from cpfls_cli.trajectory.profile import LIMIT_NAMES, Limits

CASES = 50_000


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


def test_a_move_is_found_wherever_anything_limits_it(batch):
    limited = np.isfinite(batch.limits).any(axis=0) | (batch.period is not None)
    expected = np.where(limited, MoveOutcome.SOLVED, MoveOutcome.NO_LIMIT)
    np.testing.assert_array_equal(batch.moves.outcome, expected)
    assert np.isfinite(batch.moves.duration[limited]).all()


def test_nothing_is_not_a_number(batch):
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
