"""What no vehicle has is found and explained by its unit; what any of the vehicles here has is not touched."""

from pathlib import Path

import numpy as np
import pytest

from cpfls_cli.config.load import load_study, read_config, validate
from cpfls_cli.errors import ConfigError
from cpfls_cli.vehicle_limits import LIMITS, beyond_any_vehicle, figures_of, figures_of_hubs, room

CONFIGS = sorted(Path(__file__).parents[2].glob("configs/**/*.yaml"))
LENGTHS = {"mm": 1000.0, "cm": 100.0}
QUADROTORS = [(0.025, 0.03), (0.045, 0.05), (0.8, 0.16), (6.0, 0.3), (25.0, 0.6)]
RPM = np.pi / 30


def of_quadrotor(mass, arm):
    return figures_of(mass=mass, arm=arm, room=room(arm, 4), rotors=4.0)


@pytest.mark.parametrize(("mass", "arm"), QUADROTORS)
def test_quadrotors_from_25_g_to_25_kg_are_possible_and_units_of_mass_and_arm_are_named(mass, arm):
    assert beyond_any_vehicle(of_quadrotor(mass, arm)) == ()
    (found,) = beyond_any_vehicle(of_quadrotor(1000 * mass, arm))
    assert found.name == "mass"
    assert found.why.endswith(f"{mass:g} kg? {1000 * mass:.4g} is a mass in g")
    for unit, factor in LENGTHS.items():
        found = beyond_any_vehicle(of_quadrotor(mass, factor * arm))
        assert {each.name for each in found} == {"arm"}
        assert f"{arm:g} m? {factor * arm:.4g} is an arm in {unit}" in found[0].why


def test_mass_and_arm_in_small_units_are_both_named():
    mass, arm = beyond_any_vehicle(of_quadrotor(45.0, 50.0))
    assert "0.045 kg? 45 is a mass in g" in mass.why
    assert "0.05 m? 50 is an arm in mm" in arm.why


def test_a_mass_in_g_is_said_by_what_is_too_heavy_for_the_arm_that_is_meant():
    """1200 kg on arms of 225 m are too light for their discs, which no smaller mass mends."""
    mass, arm = beyond_any_vehicle(of_quadrotor(1200.0, 225.0))
    assert mass.why.startswith("with the others right, the disc loading between its hubs is 3.7e+04 N/m^2, and no ")
    assert "has more than 3000: 1.2 kg? 1200 is a mass in g" in mass.why
    assert "0.225 m? 225 is an arm in mm" in arm.why


def test_another_vehicle_that_explains_it_as_well_is_said_too():
    """27 and 39.6 are a Crazyflie in g and mm, and a vehicle of 27 kg with arms in cm."""
    (arm,) = beyond_any_vehicle(of_quadrotor(27.0, 39.6))
    assert "0.396 m? 39.6 is an arm in cm; or " in arm.why
    assert "27 is a mass in g and 39.6 is an arm in mm" in arm.why


def test_every_limit_holds_what_is_usual():
    for limit in LIMITS:
        assert limit.possible[0] < limit.usual[0] < limit.usual[1] < limit.possible[1]


def test_hubs_in_one_place_and_numbers_beyond_floating_point_are_met():
    assert beyond_any_vehicle(figures_of(mass=1.0, **figures_of_hubs(np.zeros((4, 3))))) == ()
    for size in (1e-300, 1e300):
        hubs = size * np.array([[1.0, 0, 0], [0, 1.0, 0], [-1.0, 0, 0], [0, -1.0, 0]])
        known = {"thrust_factor": size, "inertia": size, "least_inertia": size, "radius": size, "speed_max": size}
        assert beyond_any_vehicle(figures_of(mass=size, **known, **figures_of_hubs(hubs)))


@pytest.mark.parametrize("path", CONFIGS, ids=lambda path: path.name)
def test_configs_that_are_shipped_are_possible(path):
    load_study(path)


def _rotors(vehicle, key, factor):
    for rotor in vehicle["rotors"]:
        value = rotor[key]
        rotor[key] = [factor * each for each in value] if isinstance(value, list) else factor * value


WRONG = {
    "mass in g": (lambda v: v.update(mass_kg=32.5), "vehicle.mass_kg = 32.5: ", "0.0325 kg? 32.5 is a mass in g"),
    "arms in mm": (lambda v: _rotors(v, "position_m", 1e3), "vehicle.rotors.0.position_m = [", "is an arm in mm"),
    "radii in inches": (lambda v: _rotors(v, "radius_m", 1 / 0.0254), "radius_m = 0.90", "is a radius in inches"),
    "factors for rpm": (
        lambda v: _rotors(v, "thrust_factor_n_s2", RPM**2),
        "vehicle.rotors.0.thrust_factor_n_s2 = ",
        "is a factor in N/rpm^2",
    ),
    "inertia in g cm^2": (
        lambda v: v.update(inertia_kg_m2=[160.0, 165.0, 290.0]),
        "vehicle.inertia_kg_m2 = [160.0, 165.0, 290.0]: ",
        "is an inertia in g cm^2",
    ),
    "speeds in rpm": (lambda v: v.update(rotor_speed_max_rad_s=25000.0 / RPM), "rotor_speed_max_rad_s", "tips"),
    "gravity in cm/s^2": (lambda v: v.update(gravity_m_s2=981.0), "vehicle.gravity_m_s2 = 981.0", "981 m/s^2, and no"),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_a_config_in_a_wrong_unit_is_refused_with_key_value_and_unit(wrong):
    """Of a vehicle of 32.5 g whose constants are all known, one is in another unit."""
    (path,) = [path for path in CONFIGS if path.name == "crazypad.yaml"]
    data = read_config(path)
    change, key, meant = WRONG[wrong]
    change(data["vehicle"])
    with pytest.raises(ConfigError) as refused:
        validate(data, "study.yaml")
    assert str(refused.value).startswith("study.yaml: vehicle.")
    assert key in str(refused.value)
    assert meant in str(refused.value)


def test_guesses_are_held_against_nothing():
    (path,) = [path for path in CONFIGS if path.name == "crazypad.yaml"]
    data = read_config(path)
    data["vehicle"]["inertia_kg_m2"] = None
    _rotors(data["vehicle"], "drag_factor_n_m_s2", 0.0)
    for rotor in data["vehicle"]["rotors"]:
        rotor["drag_factor_n_m_s2"] = None
    assert validate(data, "study.yaml").vehicle.unknown == ("drag_factor", "inertia")
