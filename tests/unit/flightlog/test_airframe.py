"""Rotors told by parameters and by motion."""

from itertools import permutations

import numpy as np
import pytest

from cpfls_cli.errors import InputError
from cpfls_cli.flightlog.airframe import airframe_from_motion, named_airframe, stated_airframe
from tests.builders.unknown_logs import HUBS, flight

NAMES = {(1, -1): "front right", (-1, 1): "rear left", (1, 1): "front left", (-1, -1): "rear right"}


def px4(hubs):
    """Parameters as PX4 has them: y to the right, a positive moment turns counter-clockwise."""
    parameters = {"CA_ROTOR_COUNT": float(len(hubs))}
    for index, (x, y, spin) in enumerate(hubs):
        own = {"PX": 0.1 * x, "PY": -0.1 * y, "PZ": -0.02, "KM": 0.05 * spin}
        parameters |= {f"CA_ROTOR{index}_{name}": value for name, value in own.items()}
    return parameters


@pytest.mark.parametrize("order", list(permutations(range(4))))
def test_motion_shows_every_numbering(order):
    own = flight(seconds=20.0, noise=3.0)
    found = airframe_from_motion(own.rate, own.speed[:, list(order)], 100.0, False)
    assert found.clear
    assert [(rotor.name, rotor.spin) for rotor in found.airframe.rotors] == [
        (NAMES[HUBS[index][:2]], HUBS[index][2]) for index in order
    ]


def test_rotors_that_turn_the_other_way_are_found():
    own = flight(seconds=20.0)
    squared = own.speed**2
    spins = np.array([hub[2] for hub in HUBS])
    yaw = squared @ spins / 4
    found = airframe_from_motion(own.rate, np.sqrt(squared - 2 * yaw[:, None] * spins), 100.0, False)
    assert [rotor.spin for rotor in found.airframe.rotors] == [-spin for spin in spins]


def test_gusts_that_turn_a_vehicle_slowly_hide_no_rotors():
    own = flight(seconds=20.0, angle=0.01, highest_hz=12.0, noise=0.1, climb=0.1)
    gusts = 10.0 * flight(seconds=20.0, seed=8, noise=0.0).rate
    found = airframe_from_motion(own.rate + gusts, own.speed, 100.0, False)
    assert [(rotor.name, rotor.spin) for rotor in found.airframe.rotors] == [(NAMES[hub[:2]], hub[2]) for hub in HUBS]
    assert found.by_axes
    assert found.airframe.is_asked
    assert "above 6 Hz" in found.airframe.reason


def test_what_is_fast_of_late_motors_puts_no_rotor_opposite():
    """Half a cycle after their commands, rotors push the other way."""
    own = flight(seconds=20.0, angle=0.01, highest_hz=12.0, noise=0.1, climb=0.1)
    rate = own.rate + 10.0 * flight(seconds=20.0, seed=8, noise=0.0).rate
    found = airframe_from_motion(rate, np.roll(own.speed, -3, axis=0), 100.0, True)
    assert [(rotor.name, rotor.spin) for rotor in found.airframe.rotors] == [(NAMES[hub[:2]], hub[2]) for hub in HUBS]
    assert airframe_from_motion(rate, np.roll(own.speed, -5, axis=0), 100.0, True) is None


def test_noise_shows_no_rotors():
    noise = np.random.default_rng(1)
    found = airframe_from_motion(noise.normal(size=(3000, 3)), noise.normal(500, 5, (3000, 4)), 100.0, False)
    assert found is None or not found.clear


def test_parameters_of_px4_are_turned_into_the_axes_of_a_config():
    airframe = stated_airframe(px4(HUBS))
    assert airframe.in_metres
    assert [(r.name, r.spin, r.height_m) for r in airframe.rotors] == [(NAMES[h[:2]], h[2], 0.02) for h in HUBS]
    assert [r.direction for r in airframe.rotors] == [pytest.approx((0.1 * x, 0.1 * y)) for x, y, _ in HUBS]
    assert airframe.moment_ratio_m == pytest.approx(0.05)


def test_moments_of_px4_that_a_log_leaves_out_are_the_usual_ones():
    parameters = px4(HUBS)
    changed = {name: value for name, value in parameters.items() if not (name.endswith("_KM") and value > 0)}
    assert len(changed) == len(parameters) - 2
    assert stated_airframe(changed) == stated_airframe(parameters)
    # Without that of one that turns clockwise as many would not turn either way: its spin is not known.
    (one, *_) = (name for name, value in parameters.items() if name.endswith("_KM") and value < 0)
    found = stated_airframe({name: value for name, value in parameters.items() if name != one})
    assert sorted(rotor.spin for rotor in found.rotors) == [-1, 0, 1, 1]


def test_an_arm_scales_what_is_stated():
    airframe = stated_airframe(px4(HUBS)).with_arm(0.3)
    assert all(np.hypot(*rotor.direction) == pytest.approx(0.3) for rotor in airframe.rotors)


@pytest.mark.parametrize(
    ("kind", "form", "names"),
    [
        (1, 1, ["front right", "rear left", "front left", "rear right"]),
        (1, 0, ["right", "left", "front", "rear"]),
        (2, 1, ["right", "left", "front left", "rear right", "front right", "rear left"]),
    ],
)
def test_frames_of_ardupilot_are_known_by_class_and_type(kind, form, names):
    airframe = stated_airframe({"FRAME_CLASS": float(kind), "FRAME_TYPE": float(form)})
    assert [rotor.name for rotor in airframe.rotors] == names
    assert sum(rotor.spin for rotor in airframe.rotors) == 0
    assert not airframe.in_metres


@pytest.mark.parametrize(
    ("hubs", "axis"),
    [
        ([(x, y, 1) for x, y, _ in HUBS], "yaw"),
        ([(x, 0, spin) for x, _, spin in HUBS], "roll"),
        ([(0, y, spin) for _, y, spin in HUBS], "pitch"),
    ],
)
def test_rotors_that_cannot_turn_a_vehicle_are_refused(hubs, axis):
    with pytest.raises(InputError, match=f"these 4 rotors cannot turn the vehicle about {axis} by themselves"):
        stated_airframe(px4(hubs))


def test_parameters_of_nothing_known_state_no_rotors():
    assert stated_airframe({"MOT_PWM_MAX": 1900.0, "FRAME_CLASS": 7.0}) is None


@pytest.mark.parametrize(
    ("columns", "places"),
    [
        ("motor_fl motor_fr motor_bl motor_br", "front left, front right, rear left, rear right"),
        ("rpmRR rpmRL rpmFR rpmFL", "rear right, rear left, front right, front left"),
        (
            "backLeftMotor frontLeftMotor backRightMotor frontRightMotor",
            "rear left, front left, rear right, front right",
        ),
        ("BACK_LEFT BACK_RIGHT FRONT_LEFT FRONT_RIGHT", "rear left, rear right, front left, front right"),
        ("m1 m2 m3 m4", ""),
        ("motor_fl motor_fr motor_rl", ""),
        ("motor_fl motor_fr motor_rl motor_rl_2", ""),
    ],
)
def test_names_of_columns_place_rotors(columns, places):
    found = named_airframe(columns.split(), None)
    assert ", ".join(rotor.name for rotor in found.rotors if not rotor.spin) == places if places else found is None


def test_the_motion_shows_which_way_named_rotors_turn():
    own = flight(seconds=20.0)
    names = [NAMES[hub[:2]] for hub in HUBS]
    columns = ["motor_" + "".join(part[0] for part in name.split()) for name in names]
    found = named_airframe(columns, airframe_from_motion(own.rate, own.speed, 100.0, False))
    assert [(rotor.name, rotor.spin) for rotor in found.rotors] == [
        (n, hub[2]) for n, hub in zip(names, HUBS, strict=True)
    ]
    # What moves as if it were elsewhere says no spins.
    other = airframe_from_motion(own.rate, own.speed[:, [1, 0, 2, 3]], 100.0, False)
    assert [rotor.spin for rotor in named_airframe(columns, other).rotors] == [0] * 4
