import numpy as np
import pytest

from cpfls_cli.errors import SettingError
from cpfls_cli.identification.choice import choose

# Mean squared error, largest error, condition number; the median condition number is 300.
FRONT = np.array([[1.0, 5.0, 900.0], [2.0, 1.0, 400.0], [3.0, 4.0, 300.0], [4.0, 3.0, 200.0], [5.0, 2.0, 100.0]])
KEPT = np.array([4.0, np.inf, 2.0, 1.0, 3.0])


@pytest.mark.parametrize(("rule", "member"), [("mse", 0), ("max-error", 1), ("mse-below-median-condition", 2)])
def test_rules(rule, member):
    assert choose(FRONT, rule) == member
    assert choose(FRONT[::-1], rule) == 4 - member
    assert choose(FRONT[:1], rule) == 0


def test_held_out_errors_decide_alone():
    assert choose(FRONT, "held-out", KEPT) == 3
    assert choose(FRONT[::-1], "held-out", KEPT[::-1]) == 1


@pytest.mark.parametrize(("rule", "kept", "said"), [("held-out", None, "add --choose-on"), ("mse", KEPT, "held-out")])
def test_rule_and_kept_flights_go_together(rule, kept, said):
    with pytest.raises(SettingError, match=said) as caught:
        choose(FRONT, rule, kept)
    assert caught.value.key == "choice"
