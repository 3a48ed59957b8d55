"""What no vehicle has is refused, or set to 0 where 0 is the best that is possible; what is open is not."""

import numpy as np
import pytest

from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.gap.naming.ranking import within_bounds
from tests.builders.gap_flights import VEHICLE

DAMPING, OFFSET, WIND = (CATALOGUE[name] for name in ("linear_damping", "com_offset", "wind"))
SURE = np.full(3, 1e-6)


def test_a_refused_sign_takes_out_one_coefficient_only():
    keep, admissible = within_bounds(DAMPING, np.array([0.1, -0.2, 0.3]), SURE, VEHICLE)
    assert keep.tolist() == [True, False, True]
    assert admissible


@pytest.mark.parametrize(("length", "admissible"), [(0.10, True), (0.13, False), (-0.13, False)])
def test_a_centre_of_mass_lies_inside_four_tenths_of_the_arm(length, admissible):
    keep, found = within_bounds(OFFSET, np.array([length, 0.0]), SURE[:2], VEHICLE)
    assert found == admissible
    assert keep.all()


def test_what_the_data_leave_open_is_no_reason_to_refuse():
    far = np.array([0.15, 0.0])
    assert within_bounds(OFFSET, far, np.array([0.02, 0.02]), VEHICLE)[1]
    assert not within_bounds(OFFSET, far, np.array([0.01, 0.02]), VEHICLE)[1]


def test_a_damping_beyond_all_bodies_is_refused():
    assert within_bounds(DAMPING, np.array([1.7, 0.0, 0.0]), SURE, VEHICLE)[1]
    assert not within_bounds(DAMPING, np.array([1.9, 0.0, 0.0]), SURE, VEHICLE)[1]


@pytest.mark.parametrize(
    ("drag", "wind", "error", "admissible"),
    [(1.3e-3, 8.0, 1e-9, True), (1.3e-3, 20.0, 1e-9, False), (1.3e-3, 20.0, 5e-3, True), (-1.3e-3, 8.0, 1e-9, False)],
    ids=["usual", "storm", "storm not sure", "drag that pushes"],
)
def test_wind_is_bounded_by_its_speed_not_by_its_column(drag, wind, error, admissible):
    linear = np.array([drag, drag * wind, 0.0])
    keep, found = within_bounds(WIND, linear, np.full(3, error), VEHICLE)
    assert keep.all()
    assert found == admissible
