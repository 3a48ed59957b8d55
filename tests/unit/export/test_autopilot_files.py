"""What autopilots state of a vehicle: written, and evaluated by their own published equations against the vehicle's."""

import re
from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.autopilots.registry import AUTOPILOTS
from cpfls_cli.errors import InputError
from cpfls_cli.export.registry import FORMS, exported
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.simulators.formats import read_model
from cpfls_cli.vehicle.rotors import allocation_matrix
from cpfls_cli.vehicle.settings import RotorSettings
from tests.builders.exported_vehicles import sheet_of_vehicle
from tests.builders.playback_flights import truth
from tests.builders.vehicle_models import HEXA, QUAD

CROSS = AUTOPILOTS["crazyflie"].cross
TO_PX4 = np.diag([1.0, -1.0, -1.0])


def rotors_of(cross, side=0.07, height=0.01, **changed):
    """A vehicle of equal rotors at the places and spins that an autopilot has them."""
    like = replace(QUAD.rotors[0], **changed)
    rotors = [replace(like, position_m=(x * side, y * side, height), spin=spin) for x, y, spin in cross]
    return replace(QUAD, rotors=tuple(rotors))


def text_of(form, vehicle, name="uav"):
    return exported(sheet_of_vehicle(VehicleModel(vehicle=vehicle)), form, name).text


def unequal(vehicle):
    """Rotors that differ in thrust, yaw torque and place."""
    rng = np.random.default_rng(4)

    def changed(rotor: RotorSettings) -> RotorSettings:
        a, b = rng.uniform(0.8, 1.2, 2)
        place = tuple(np.array(rotor.position_m) + rng.uniform(-0.02, 0.02, 3))
        factors = {
            "thrust_factor_n_s2": a * rotor.thrust_factor_n_s2,
            "drag_factor_n_m_s2": b * rotor.drag_factor_n_m_s2,
        }
        return replace(rotor, position_m=place, **factors)

    return replace(vehicle, rotors=tuple(map(changed, vehicle.rotors)))


@pytest.mark.parametrize("vehicle", [QUAD, HEXA, unequal(QUAD), unequal(HEXA)], ids=["quad", "hexa", "quad*", "hexa*"])
def test_px4_computes_the_torques_of_the_vehicle(vehicle):
    """Its effectiveness matrix: ct p x a - ct km a and ct a of each rotor, forward, right, down."""
    lines = [line.split("\t") for line in text_of("px4params", vehicle).splitlines() if not line.startswith("#")]
    assert {(line[0], line[1]) for line in lines} == {("1", "1")}
    given = {name: float(value) for _, _, name, value, _ in lines}
    assert {name for _, _, name, _, kind in lines if kind == "6"} == {"CA_AIRFRAME", "CA_ROTOR_COUNT"}
    count = int(given["CA_ROTOR_COUNT"])
    assert (count, given["CA_AIRFRAME"]) == (len(vehicle.rotors), 0)
    rows = []
    for rotor in range(count):
        place, axis = ([given[f"CA_ROTOR{rotor}_{kind}{each}"] for each in "XYZ"] for kind in "PA")
        ct, km = given[f"CA_ROTOR{rotor}_CT"], given[f"CA_ROTOR{rotor}_KM"]
        axis = np.array(axis) / np.linalg.norm(axis)
        assert np.sign(km) == vehicle.rotors[rotor].spin
        rows.append([*(ct * np.cross(place, axis) - ct * km * axis), *(ct * axis)])
    lift, *torque = allocation_matrix(vehicle) * vehicle.rotor_speed_max_rad_s**2
    full = np.array([*(TO_PX4 @ torque), *(TO_PX4 @ np.outer([0, 0, 1], lift))])
    # Parameters are floats of 32 bits, written in nine digits.
    np.testing.assert_allclose(np.transpose(rows), full, rtol=1e-8, atol=1e-8 * np.abs(full).max())


def mixer_of(text):
    """Read the lines of Betaflight's command line, shape (motor, 4): throttle, roll, pitch, yaw."""
    head, *lines, last = [line for line in text.splitlines() if not line.startswith("#")]
    assert (head, lines[0], last) == ("mixer CUSTOM", "mmix reset", "save")
    words = [line.split() for line in lines[1:]]
    assert [word[:2] for word in words] == [["mmix", str(motor)] for motor in range(len(words))]
    return np.array([[float(share) for share in word[2:]] for word in words])


@pytest.mark.parametrize("vehicle", [QUAD, HEXA, unequal(QUAD), unequal(HEXA)], ids=["quad", "hexa", "quad*", "hexa*"])
def test_betaflight_turns_about_one_axis_at_a_time(vehicle):
    """Commands of its mixTable, as shares of each rotor's largest thrust, give lift and torques of the vehicle."""
    mixer = mixer_of(text_of("betaflight", vehicle))
    lift, roll, pitch, yaw = allocation_matrix(vehicle) @ mixer
    found = np.array([lift, roll, pitch, yaw]) / lift[0]
    # Lift to the right, nose down, counter-clockwise: the last sum enters with the other sign.
    assert np.sign(np.diag(found)).tolist() == [1, 1, 1, -1]
    off = found - np.diag(np.diag(found))
    np.testing.assert_allclose(off, 0.0, atol=1e-5 * np.abs(found[1:]).max())
    assert found[1, 1] == pytest.approx(found[2, 2], rel=1e-5)
    assert np.abs(mixer[:, 0]).max() == np.abs(mixer[:, 3]).max() == np.abs(mixer[:, 1:3]).max() == 1.0


def test_betaflights_own_mixers_are_those_of_its_own_frames():
    """QUADX and HEX6X of mixer_init.c: shares of throttle, roll, pitch, yaw of motors at their places."""
    cross = AUTOPILOTS["betaflight"].cross
    quad = mixer_of(text_of("betaflight", rotors_of(cross)))
    np.testing.assert_allclose(quad, [[1, y, -x, spin] for x, y, spin in cross])
    # Rear right, front right, rear left, front left, right, left; 1 of the last column is counter-clockwise.
    angles = np.radians([-150.0, -30.0, 150.0, 30.0, -90.0, 90.0])
    six = [(np.cos(a), np.sin(a), way) for a, way in zip(angles, [1, 1, -1, -1, -1, 1], strict=True)]
    known = [
        [1, -0.5, 0.866025, 1], [1, -0.5, -0.866025, 1], [1, 0.5, 0.866025, -1],
        [1, 0.5, -0.866025, -1], [1, -1, 0, -1], [1, 1, 0, 1],
    ]  # fmt: skip
    np.testing.assert_allclose(mixer_of(text_of("betaflight", rotors_of(six))), known, atol=1e-6)


def test_rotors_that_cannot_be_mixed_are_refused():
    line = rotors_of([(x, 0.0, spin) for x, spin in ((2, 1), (1, -1), (-1, 1), (-2, -1))])
    with pytest.raises(InputError, match=r"vehicle.h5: Betaflight mixes lift, .*cannot give each of the four alone"):
        text_of("betaflight", line)
    many = rotors_of([(np.cos(a), np.sin(a), 1 - 2 * (i % 2)) for i, a in enumerate(np.linspace(0, 6, 9))])
    with pytest.raises(InputError, match="at most 8 motors, and the 9 rotors"):
        text_of("betaflight", many)
    with pytest.raises(InputError, match="PX4 allocates to at most 8 rotors, and this vehicle has 9"):
        text_of("px4params", many)


def defined(text):
    return {name: float(value) for name, value in re.findall(r"#define (\w+) (\S+)f\b", text)}


def test_the_crazyflie_distributes_what_the_vehicle_needs():
    """Forces of its powerDistributionForceTorque give torques and lift of the vehicle, in any order of the rotors."""
    order = [2, 0, 3, 1]
    vehicle = rotors_of([CROSS[motor] for motor in order])
    given = defined(text_of("crazyflie", vehicle, "uav.h"))
    arm, ratio = np.sqrt(0.5) * given["ARM_LENGTH"], given["THRUST2TORQUE"]
    # Torques in N m, forward, left, up, and lift in N: of each of the four by itself, the forces of motors 1 to 4.
    force = 0.25 * np.array([
        [1, -1 / arm, -1 / arm, -1 / ratio],
        [1, -1 / arm, 1 / arm, 1 / ratio],
        [1, 1 / arm, 1 / arm, -1 / ratio],
        [1, 1 / arm, -1 / arm, 1 / ratio],
    ])  # fmt: skip
    factors = [rotor.thrust_factor_n_s2 for rotor in vehicle.rotors]
    squares = force[order] / np.array(factors)[:, None]
    np.testing.assert_allclose(allocation_matrix(vehicle) @ squares, np.eye(4), atol=1e-9)
    assert given["THRUST_MAX"] == pytest.approx(factors[0] * vehicle.rotor_speed_max_rad_s**2, rel=1e-9)
    assert given["CF_MASS"] == vehicle.mass_kg


def test_a_header_is_read_again(tmp_path):
    vehicle = rotors_of(CROSS, height=0.0)
    path = tmp_path / "platform_defaults_mine.h"
    path.write_text(text_of("crazyflie", vehicle, path.name))
    read = read_model(path)
    assert read.mass_kg == pytest.approx(vehicle.mass_kg, rel=1e-9)
    np.testing.assert_allclose(read.hubs, [rotor.position_m for rotor in vehicle.rotors], rtol=1e-9, atol=1e-12)
    for own, rotor in zip(read.rotors, vehicle.rotors, strict=True):
        assert own.ratio.value == pytest.approx(rotor.drag_factor_n_m_s2 / rotor.thrust_factor_n_s2, rel=1e-9)
        assert own.most.value == pytest.approx(rotor.thrust_factor_n_s2 * vehicle.rotor_speed_max_rad_s**2, rel=1e-9)
        assert own.spin == rotor.spin


def test_a_header_says_what_is_not_its_own():
    for vehicle in (rotors_of([(x, y, -spin) for x, y, spin in CROSS]), HEXA):
        with pytest.raises(InputError, match=r"the Crazyflie has four rotors on diagonals, .*counter-clockwise"):
            text_of("crazyflie", vehicle)
    made = exported(sheet_of_vehicle(VehicleModel(vehicle=unequal(rotors_of(CROSS)))), "crazyflie", "uav.h")
    assert made.remarks[0].startswith("It states no inertia, and no thrust by speed: VMOTOR2THRUST0 to 3")
    assert any("what differs between rotors" in each for each in made.remarks)
    assert "what differs between rotors" in made.text


def test_what_each_cannot_state_is_said():
    for form in ("crazyflie", "betaflight", "px4params"):
        made = exported(sheet_of_vehicle(truth()), form, "uav")
        assert " no " in made.remarks[0]
        words = " ".join(re.sub(r"\n[#*/ ]*", " ", made.text).split())
        assert all(remark in words for remark in made.remarks)


@pytest.mark.parametrize("form", FORMS)
def test_no_number_is_written_as_minus_nothing(form):
    """A rotor in the plane of the centre of mass has a height of 0 in axes with z down, too."""
    assert re.findall(r"(?<![\w.])-0(?:\.0*)?(?![\w.])", text_of(form, rotors_of(CROSS, height=0.0))) == []
