"""The configs for other people's flights hold the vehicles that the origins of the flights state."""

from pathlib import Path

import numpy as np
import pytest

from cpfls_cli.config.load import load_study
from cpfls_cli.vehicle.rotors import body_wrench

FOLDER = Path(__file__).parents[3] / "configs" / "gap"
SPEED = np.array([[300.0, 350.0, 400.0, 470.0]])
O1, O2, O3, O4 = SPEED[0] ** 2


def study(name):
    return load_study(FOLDER / f"{name}.yaml")


def torque(name, speed=SPEED):
    return body_wrench(study(name).vehicle, speed).body_torque[0]


def test_every_config_is_looked_at():
    crazyflies = {"arpl", "crazyswarm2", "crazyswarm2_card", "crazypad", "crazypad_usd", "nanodrone"}
    known = crazyflies | {"rotorpy", "sixkg", "neurobem"}
    assert known <= {path.stem for path in FOLDER.glob("*.yaml")}


def test_the_hummingbird_has_the_torques_of_its_origin():
    k, b, d = 5.57e-6, 1.36e-7, 0.1202081528
    expected = [k * d * (O1 - O2 - O3 + O4), k * d * (-O1 - O2 + O3 + O4), b * (O1 - O2 + O3 - O4)]
    np.testing.assert_allclose(torque("rotorpy"), expected, rtol=1e-12)


def test_the_six_kilogram_craft_has_the_torques_of_the_plus_layout():
    k, b, arm = 121.5e-6, 2.7e-6, 0.3
    expected = [arm * k * (O4 - O2), arm * k * (O3 - O1), b * (-O1 + O2 - O3 + O4)]
    np.testing.assert_allclose(torque("sixkg"), expected, rtol=1e-12)
    assert {(rotor.radius_m, rotor.position_m[2]) for rotor in study("sixkg").vehicle.rotors} == {(0.2, 0.05)}


def test_the_crazyflie_gives_the_stated_thrust_for_a_command():
    vehicle = study("arpl").vehicle
    share = np.array([[0.3, 0.5, 0.7, 0.9]])
    wrench = body_wrench(vehicle, share * vehicle.rotor_speed_max_rad_s)
    u = 0.15002497 * share[0] ** 2
    assert wrench.thrust[0] == pytest.approx(u.sum(), rel=1e-6)
    # M1 (+x, -y), M2 (-x, -y), M3 (-x, +y), M4 (+x, +y), and about z the signs - + - +.
    expected = 0.028 * np.array([-u[0] - u[1] + u[2] + u[3], -u[0] + u[1] + u[2] - u[3]])
    np.testing.assert_allclose(wrench.body_torque[0, :2], expected, rtol=1e-6)


@pytest.mark.parametrize("name", ["arpl", "crazypad", "crazypad_usd", "crazyswarm2", "crazyswarm2_card", "nanodrone"])
def test_the_motors_of_every_crazyflie_stand_and_turn_alike(name):
    rotors = study(name).vehicle.rotors
    assert [tuple(np.sign(rotor.position_m[:2])) for rotor in rotors] == [(1, -1), (-1, -1), (-1, 1), (1, 1)]
    alone = [torque(name, 1000 * np.eye(4)[[rotor]])[2] for rotor in range(4)]
    assert list(np.sign(alone)) == [-1, 1, -1, 1]


@pytest.mark.parametrize("name", ["rotorpy", "sixkg"])
def test_only_body_rates_are_needed_and_nothing_changes_the_data(name):
    settings = study(name).import_
    assert [signal for signal, entry in settings.signals.items() if entry.required] == ["body_rate"]
    changing = (settings.lowpass_hz, settings.spike_deviations, settings.rate_hz, settings.crop_s)
    assert (*changing, settings.delay_s, settings.torque_source) == (None, None, None, None, 0.0, None)
