import numpy as np
import pytest

from cpfls_cli.errors import SettingError
from cpfls_cli.trajectory.legs import plan_move, plan_moves
from cpfls_cli.trajectory.profile import LIMIT_NAMES, Limits


@pytest.mark.parametrize("key", LIMIT_NAMES)
@pytest.mark.parametrize("value", [0.0, -0.0, -3.0, np.nan, -np.inf, np.array([1.0, 0.0])])
def test_a_limit_that_no_move_keeps_is_refused_by_name(key, value):
    with pytest.raises(SettingError, match="must be greater than 0, or leave it out for no limit") as refused:
        Limits(**{key: value})
    assert refused.value.key == key


def test_limits_of_the_wrong_length_are_refused_by_name():
    with pytest.raises(SettingError, match="2 moves; give one value, or one for each move") as refused:
        plan_moves(np.ones(2), Limits(velocity=1.0, jerk=np.ones(3)))
    assert refused.value.key == "jerk"


@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf, np.ones(3)])
def test_a_period_that_is_none_is_refused(value):
    with pytest.raises(SettingError, match=r"leave it out|give one value") as refused:
        plan_moves(np.ones(2), Limits(velocity=1.0), value)
    assert refused.value.key == "period"


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_a_displacement_that_is_not_finite_is_refused(value):
    with pytest.raises(SettingError, match="give a finite length") as refused:
        plan_move(value, Limits(velocity=1.0))
    assert refused.value.key == "displacement"
