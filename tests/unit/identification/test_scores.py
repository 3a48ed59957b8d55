import numpy as np
import pytest

from cpfls_cli.identification.identify import Judged


def scores(model, rigid, zero=(1.0, 1.0, 1.0)):
    mse = np.array([[model], [rigid], [zero]])
    names, parts, samples = ("model", "rigid-body", "torque-zero"), ("training",), np.array([10])
    measures = dict.fromkeys(("mse", "max_error", "relative_error", "r2", "vaf", "r2_body"), mse)
    return Judged(models=names, parts=parts, samples=samples, outside=0 * samples, **measures)


def test_the_smaller_mean_squared_error_wins_axis_by_axis():
    assert scores((0.1, 0.3, 0.2), (0.2, 0.2, 0.2)).winners("training") == ["model", "rigid-body", "tie"]


def test_a_difference_of_nothing_but_rounding_is_a_tie():
    assert scores((3e-28, 1e-30, 2e-29), (1e-33, 2e-34, 1e-33)).winners("training") == ["tie"] * 3


def test_the_same_small_numbers_decide_where_the_torque_itself_is_small():
    small = (1e-26, 1e-26, 1e-26)
    assert scores((3e-28, 3e-28, 3e-28), (1e-33, 1e-33, 1e-33), small).winners("training") == ["rigid-body"] * 3


def test_the_worst_axis_is_named_and_an_axis_without_torque_is_passed_over():
    error, axis = scores((0.1, 0.3, np.nan), (0.1, 0.1, 0.1)).worst("model", "training")
    assert (error, axis) == (pytest.approx(0.3), "pitch")
