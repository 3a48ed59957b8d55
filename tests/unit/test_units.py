from typing import get_args

import numpy as np
import pytest

from cpfls_cli.errors import InputError
from cpfls_cli.units import KNOWN_UNITS, UnitName, to_si


@pytest.mark.parametrize(
    ("value", "unit", "expected"),
    [
        (180.0, "deg", np.pi),
        (90.0, "deg/s", np.pi / 2),
        (60.0, "rpm", 2 * np.pi),
        (1500.0, "us", 1.5e-3),
        (2.0, "g", 19.6133),
        (250.0, "N mm", 0.25),
        (3.0, "N·m", 3.0),
        (7.0, "mm/s", 0.007),
        (0.3, "N", 0.3),
        (16.8, "V", 16.8),
    ],
)
def test_a_value_converts_to_si(value, unit, expected):
    assert to_si(np.array([value]), unit)[0] == pytest.approx(expected, rel=1e-12)


def test_the_table_holds_exactly_the_names_that_a_config_may_use():
    assert set(KNOWN_UNITS) == set(get_args(UnitName))


def test_an_unknown_unit_is_refused_with_the_nearest_names():
    with pytest.raises(InputError, match=r"'degs'.*did you mean 'deg/s' or 'deg'"):
        to_si(np.zeros(1), "degs")
