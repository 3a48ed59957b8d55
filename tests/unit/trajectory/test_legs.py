from dataclasses import astuple

import numpy as np
import pytest

from cpfls_cli.trajectory.legs import MoveOutcome, plan_moves, synchronised
from cpfls_cli.trajectory.profile import Limits

DISPLACEMENTS = np.array([10.0, -4.0, 0.0, 0.5])
LIMITS = Limits(
    velocity=np.array([2.0, 3.0, 1.0, 0.05]),
    acceleration=np.array([1.0, 0.2, 1.0, 1.0]),
    jerk=2.0,
    snap=5.0,
    pop=np.array([np.inf, 100.0, 1.0, 50.0]),
)


@pytest.fixture
def moves():
    return synchronised(DISPLACEMENTS, LIMITS)


def test_all_axes_begin_and_end_together_within_their_limits(moves):
    solved = [move for move in moves if move.outcome == MoveOutcome.SOLVED]
    assert [move.duration for move in solved] == pytest.approx([moves[0].duration] * 3)
    assert [move.profile.displacement for move in moves] == DISPLACEMENTS.tolist()
    peaks = np.array([astuple(move.peaks)[1:] for move in moves]).T
    assert (peaks <= LIMITS.broadcast(4) * (1 + 1e-12)).all()
    assert any(move.active for move in moves)


def test_an_axis_that_stays_is_told(moves):
    assert [move.outcome for move in moves].index(MoveOutcome.ZERO_DISPLACEMENT) == 2
    assert moves[2].profile.duration == 0.0


def test_each_axis_takes_as_long_as_the_slowest_alone():
    alone = plan_moves(DISPLACEMENTS, LIMITS).duration
    moves = synchronised(DISPLACEMENTS, LIMITS)
    slowest = int(alone.argmax())
    assert moves[0].duration == pytest.approx(alone.max(), rel=1e-14)
    assert moves[slowest].active == plan_moves(DISPLACEMENTS, LIMITS)[slowest].active


def test_axes_that_nothing_limits_have_no_solution():
    limits = Limits(velocity=np.array([1.0, np.inf]))
    each = synchronised(np.array([1.0, 1.0]), limits)
    assert [move.outcome for move in each] == [MoveOutcome.SOLVED, MoveOutcome.NO_LIMIT]


def test_nothing_moves_where_nothing_is_asked():
    moves = synchronised(np.zeros(3), Limits(velocity=1.0))
    assert [(move.outcome, move.duration) for move in moves] == [(MoveOutcome.ZERO_DISPLACEMENT, 0.0)] * 3
