"""The planned move is the shortest: a numerical minimiser over all moves of the family finds none shorter."""

import numpy as np
import pytest

from cpfls_cli.trajectory.limits import LIMIT_NAMES, Limits
from cpfls_cli.trajectory.moves import MoveOutcome, plan_moves
from tests.builders.brute_force import shortest_duration


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
