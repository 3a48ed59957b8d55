from dataclasses import asdict, astuple

import numpy as np
import pytest

from cpfls_cli.trajectory.legs import MoveOutcome, plan_move, plan_moves
from cpfls_cli.trajectory.profile import LIMIT_NAMES, Limits, covering

PAPER = {"velocity": 8.0, "acceleration": 2.0, "jerk": 1.0, "snap": 1.0, "crackle": 2.0, "pop": 2 * np.pi}


def test_the_papers_limits_give_the_papers_move():
    move = plan_move(64.0, Limits(**PAPER))
    assert move.duration == pytest.approx(16.0, rel=1e-14)
    assert (move.profile.period, move.active) == (pytest.approx(1.0, rel=1e-14), LIMIT_NAMES)
    assert move.profile.integral_of_absolute_jerk == pytest.approx(8.0, rel=1e-14)


@pytest.mark.parametrize("displacement", [1.0, 64.0, 640.0])
def test_integral_of_absolute_jerk_is_that_of_the_samples(displacement):
    move = plan_move(displacement, Limits(**PAPER))
    time = np.linspace(0, move.duration, 400_001)
    jerk = np.abs(move.profile.sample(time)[:, 3])
    assert move.profile.integral_of_absolute_jerk == pytest.approx(np.trapezoid(jerk, time), rel=1e-7)


@pytest.mark.parametrize("name", LIMIT_NAMES)
def test_one_limit_alone_is_reached_and_sets_the_time(name):
    move = plan_move(5.0, Limits(**{name: 0.3}))
    assert move.active == (name,)
    assert asdict(move.peaks)[name] == pytest.approx(0.3, rel=1e-13)
    order = LIMIT_NAMES.index(name) + 1
    # What is not limited rises in no time, but a wave that one limit sets is smooth.
    unbounded = [order < 5 and above > order for above in range(7)]
    assert np.isinf(astuple(move.peaks)).tolist() == unbounded


def jerk_limited_duration(displacement, velocity, acceleration, jerk):
    """Textbook durations of the rest-to-rest move of seven segments (Biagiotti and Melchiorri, section 3.4)."""
    ramp = acceleration / jerk
    rise = ramp + velocity / acceleration if velocity * jerk >= acceleration**2 else 2 * np.sqrt(velocity / jerk)
    if displacement >= velocity * rise:
        return displacement / velocity + rise
    if displacement >= 2 * acceleration**3 / jerk**2:
        return ramp + np.sqrt(ramp**2 + 4 * displacement / acceleration)
    return 4 * np.cbrt(displacement / (2 * jerk))


def test_limits_up_to_the_jerk_give_the_move_of_seven_segments():
    displacement, velocity, acceleration, jerk = 10 ** np.random.default_rng(5).uniform(-3, 3, (4, 1000))
    moves = plan_moves(displacement, Limits(velocity=velocity, acceleration=acceleration, jerk=jerk))
    expected = [jerk_limited_duration(*case) for case in zip(displacement, velocity, acceleration, jerk, strict=True)]
    np.testing.assert_allclose(moves.duration, expected, rtol=1e-13)
    assert (moves.period == 0).all()


def test_a_given_period_is_kept_and_the_amplitude_chosen():
    move = plan_move(3.0, Limits(velocity=100.0), period=0.5)
    assert (move.duration, move.active, move.peaks.displacement) == (16 * 0.5, (), 3.0)
    assert plan_move(3.0, Limits(), period=0.5).profile == move.profile


def test_a_given_period_bounds_the_snap_by_crackle_and_pop():
    by_crackle = plan_move(50.0, Limits(crackle=2.0, velocity=3.0), period=0.5)
    assert (by_crackle.active, by_crackle.peaks.snap) == (("velocity", "crackle"), pytest.approx(0.5))
    by_pop = plan_move(50.0, Limits(pop=2.0, velocity=3.0), period=0.5)
    assert (by_pop.active, by_pop.peaks.pop) == (("velocity", "pop"), pytest.approx(2.0))


def test_zero_displacement_is_no_move():
    move = plan_move(0.0, Limits(velocity=1.0))
    assert (move.outcome, move.duration, move.active) == (MoveOutcome.ZERO_DISPLACEMENT, 0.0, ())
    assert move.outcome.solved
    assert astuple(move.peaks) == (0.0,) * 7
    np.testing.assert_array_equal(move.profile.sample(np.array([-1.0, 0.0, 1.0])), 0.0)


def test_nothing_that_limits_is_no_solution_and_says_what_would_help():
    move = plan_move(1.0, Limits())
    assert not move.outcome.solved
    assert move.duration == np.inf
    assert "give a limit on velocity, acceleration, jerk, snap, crackle or pop, or a period" in move.outcome.words


@pytest.mark.parametrize(("displacement", "limit"), [(1e300, 1e-300), (1e-300, 1e300)])
def test_times_that_numbers_cannot_hold_are_no_solution(displacement, limit):
    move = plan_move(displacement, Limits(velocity=limit, pop=limit))
    assert (move.outcome, move.duration) == (MoveOutcome.OUT_OF_RANGE, np.inf)
    assert "bring the displacement and the limits closer to 1" in move.outcome.words


def test_a_negative_displacement_is_the_mirror_image_and_many_moves_are_planned_as_one():
    there, back = plan_move(7.0, Limits(**PAPER)), plan_move(-7.0, Limits(**PAPER))
    assert (back.duration, back.peaks, back.active) == (there.duration, there.peaks, there.active)
    time = np.linspace(0, there.duration, 100)
    np.testing.assert_array_equal(back.profile.sample(time), -there.profile.sample(time))
    displacements, snaps = np.array([64.0, -1.0, 0.0, 3.0]), np.array([1.0, 2.0, 3.0, np.inf])
    moves = plan_moves(displacements, Limits(velocity=2.0, snap=snaps), period=np.array([1.0, 2.0, 3.0, 4.0]))
    for index, (displacement, snap) in enumerate(zip(displacements, snaps, strict=True)):
        assert moves[index] == plan_move(displacement, Limits(velocity=2.0, snap=snap), period=1.0 + index)


def test_a_jump_of_the_snap_is_the_limit_of_short_waves():
    sudden = plan_move(30.0, Limits(velocity=3.0, acceleration=2.0, jerk=1.5, snap=4.0))
    quick = covering(30.0, 1e-9, sudden.profile.holds)
    assert sudden.profile.period == 0.0
    time = np.random.default_rng(1).uniform(0, sudden.duration, 1000)
    motion, expected = sudden.profile.sample(time), quick.sample(time)
    np.testing.assert_allclose(motion[:, :5], expected[:, :5], atol=1e-6)
    np.testing.assert_array_equal(motion[:, 5:], 0.0)
