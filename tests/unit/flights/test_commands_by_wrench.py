"""Four rotors whose thrust and torque are logged, but not their commands."""

from dataclasses import replace
from typing import get_args

import numpy as np
import pytest

from cpfls_cli.config.study import Study
from cpfls_cli.flights.recordings import ReadFlight, signals_of
from cpfls_cli.vehicle.rotors import body_wrench
from cpfls_cli.vehicle.settings import Unknown, VehicleSettings

SAMPLES = 20


def read(vehicle, speed, **changes):
    """Read a flight that states what such speeds give."""
    wrench = body_wrench(vehicle, speed)
    stated = {"thrust": wrench.thrust, "body_torque": wrench.body_torque} | changes
    known = {"time": np.arange(SAMPLES) / 100, "body_rate": np.ones((SAMPLES, 3))} | stated
    known = {name: values for name, values in known.items() if values is not None}
    return signals_of(ReadFlight("flight.csv", known, {}, ()), known, Study(vehicle=vehicle))


@pytest.fixture
def speed():
    return np.random.default_rng(1).uniform(300.0, 600.0, (SAMPLES, 4))


def test_the_commands_are_those_that_give_the_wrench(speed):
    signals, notes = read(VehicleSettings(), speed)
    np.testing.assert_allclose(signals.rotor_speed, speed, rtol=1e-9)
    assert signals.commanded
    assert "four rotors of the config" in " ".join(notes)


def test_a_rotor_that_would_have_to_push_down_stands_still(speed):
    vehicle = VehicleSettings()
    thrust = body_wrench(vehicle, speed).thrust
    thrust[:3] = 0.0
    signals, notes = read(vehicle, speed, thrust=thrust)
    assert f"at 3 of {SAMPLES} samples" in " ".join(notes)
    assert (signals.rotor_speed[:3] == 0).any(axis=1).all()


@pytest.mark.parametrize("unknown", [name for name in get_args(Unknown) if name.endswith("factor")])
def test_rotors_of_unknown_factors_are_asked_for_nothing(unknown, speed):
    signals, notes = read(replace(VehicleSettings(), unknown=(unknown,)), speed)
    assert signals.rotor_speed is None
    assert signals.stated_thrust is not None
    assert not notes


def test_torque_without_thrust_tells_no_commands(speed):
    signals, _ = read(VehicleSettings(), speed, thrust=None)
    assert signals.rotor_speed is None
    assert signals.stated_torque is not None


def test_six_rotors_leave_a_choice(speed):
    vehicle = VehicleSettings()
    six = replace(vehicle, rotors=(*vehicle.rotors, *vehicle.rotors[:2]))
    signals, _ = read(six, np.hstack([speed, speed[:, :2]]))
    assert signals.rotor_speed is None
