"""Numbers of a vehicle that no vehicle has name what is wrong with the log or the config."""

import pytest

from cpfls_cli.consistency.numbers import impossible


@pytest.mark.parametrize(
    ("ratios", "suspect"),
    [
        ({"inertia_z": 1 / 29}, "drag_factor_n_m_s2 of vehicle.rotors looks 29 times too small"),
        ({"inertia_z": 12.0}, "drag_factor_n_m_s2 of vehicle.rotors looks 12 times too large"),
        ({"inertia_z": -1.0}, "spin of vehicle.rotors"),
        ({"thrust_scale": 6.0}, "thrust_factor_n_s2 of vehicle.rotors looks 6 times too small, or mass_kg 6 times too"),
        ({"thrust_scale": -1.0}, "the sign and frame of the acceleration"),
        ({"thrust_scale": 0.011, "inertia_z": 91.0}, "the rotor speeds look 9.53 times too large"),
        ({f"inertia_{axis}": 1 / 57.3 for axis in "xyz"}, "the gyroscope looks 57.3 times too large"),
        ({"inertia_x": 4.0}, "inertia_kg_m2 about this axis and position_m"),
        (
            {"inertia_x": 4.0, "inertia_z": 9.0},
            "check the signs, units and order of the gyroscope's and the rotors' columns",
        ),
        ({"inertia_x": -4.0, "inertia_z": 9.0}, "check the signs and order of the gyroscope's and the rotors' columns"),
    ],
)
def test_numbers_that_no_vehicle_has_name_the_suspect(ratios, suspect):
    findings = impossible(ratios)
    assert len(findings) == len(ratios)
    assert all(suspect in each.remedy and each.contradiction for each in findings)
