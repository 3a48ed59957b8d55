"""Flights of other people, whose columns are recognised without a config, and imported by the config that follows."""

import json

import numpy as np
import pytest
import yaml

from cpfls_cli.flightlog.recognition import recognise
from cpfls_cli.logs.formats import log_contents
from tests.builders import command_line
from tests.builders.recorded_flights import FLIGHTS, path_of_log

CRAZYFLIE = [("front right", 1), ("rear right", -1), ("rear left", 1), ("front left", -1)]


def seen(path):
    contents = log_contents(path)
    return recognise(contents.topics, contents.units, contents.parameters, contents.system)


def maps(recognition):
    return {
        guess.signal: (guess.columns.columns[0], guess.columns.unit, guess.columns.sign)
        for guess in recognition.signals
    }


@pytest.mark.parametrize("name", ["none", "drag", "com"])
def test_everything_in_a_flight_of_rotorpy_is_told_by_the_data_or_its_name(name):
    recognition = seen(path_of_log("rotorpy", name))
    assert maps(recognition) == {
        "attitude": ("phi", "rad", None),
        "body_rate": ("wx", "rad/s", None),
        "acceleration": ("ax", "m/s^2", None),
        "position": ("x", "m", None),
        "velocity": ("vx", "m/s", None),
        "rotor_speed": ("om1", "rad/s", None),
        "rotor_command": ("omcmd1", "rad/s", None),
    }
    assert "guess" not in {entry.sure for entry in (*recognition.signals, *recognition.choices)}
    assert recognition.moved.clear
    assert [(rotor.name, rotor.spin) for rotor in recognition.moved.airframe.rotors] == [
        ("front left", -1),
        ("front right", 1),
        ("rear right", -1),
        ("rear left", 1),
    ]


@pytest.mark.parametrize("name", ["log10_35_65s", "log15_55_90s", "log16_32_49s"])
def test_the_motion_of_a_real_crazyflie_tells_its_rotors(name):
    recognition = seen(path_of_log("real/arpl_crazyflie_1khz", name))
    assert maps(recognition) == {
        "body_rate": ("wx", "rad/s", None),
        "acceleration": ("sfx", "m/s^2", None),
        "rotor_command": ("u1", "1", None),
    }
    assert recognition.choice("acceleration_frame") == "body-specific-force"
    assert recognition.moved.clear
    assert [(rotor.name, rotor.spin) for rotor in recognition.moved.airframe.rotors] == CRAZYFLIE


def test_the_second_hover_of_a_real_log_is_the_longer_one():
    recognition = seen(path_of_log("real/crazypad_com", "normal_flight__E9_log00"))
    begin, end = recognition.flown.span_s
    assert (begin, end) == (pytest.approx(17.8, abs=0.3), pytest.approx(25.7, abs=0.3))
    assert "it also flies at 3.6 to 11.5 s" in recognition.flown.reasons[1]
    assert recognition.choice("rotor_command_is") == "thrust"


@pytest.mark.parametrize("name", ["log45", "log119", "log149"])
def test_a_log_without_rotors_states_its_torque(name):
    recognition = seen(path_of_log("real/crazyswarm2_lee", name))
    found = maps(recognition)
    assert found["attitude"] == ("ctrlLee_rpyx", "rad", None)
    assert found["body_torque"] == ("ctrlLee_torquex", "N m", None)
    assert found["setpoint_position"] == ("ctrltargetZ_x", "m", None)
    assert found["setpoint_velocity"] == ("ctrltargetZ_vx", "m/s", None)
    assert recognition.signal("body_torque").sure == "guess"


def test_a_card_of_a_crazyflie_is_read_without_a_word_of_config():
    path = FLIGHTS / "real/crazypad_usd/normal_flight__E8_log00"
    if not path.exists():
        pytest.skip(f"{path} is absent; set CPFLS_FLIGHTS to the folder of other people's flights")
    recognition = seen(path)
    assert maps(recognition) == {
        # The pitch rate of the controller is that of the nose up: x accelerates against its integral in all 15 logs.
        "body_rate": ("fixedFrequency.controller.r_roll", "rad/s", (1.0, -1.0, 1.0)),
        "position": ("fixedFrequency.stateEstimate.x", "m", None),
        "rotor_command": ("fixedFrequency.controller.cmd_thrust", "1", None),
        "setpoint_attitude": ("fixedFrequency.controller.roll", "deg", (1.0, -1.0, 1.0)),
    }
    # Where the rotors carry it, it hovers, and follows a third of the rates that are asked for.
    (why,) = recognition.left_out
    assert "controller.rollRate" in why
    assert "which no unit explains" in why


def test_what_is_written_imports_the_flight(tmp_path):
    log = path_of_log("real/arpl_crazyflie_1khz", "log15_55_90s")
    study, flight = tmp_path / "study.yaml", tmp_path / "flight.h5"
    done = command_line.run("init", log, "-o", study, "--mass", "0.027", "--arm", "0.0396")
    assert done.exit_code == 0, done.stderr
    rotors = yaml.safe_load(study.read_text())["vehicle"]["rotors"]
    # The source states 28 mm along both axes, M1 front right.
    np.testing.assert_allclose(rotors[0]["position_m"][:2], [0.028, -0.028], atol=1e-4)
    imported = command_line.run("import", study, log, "-o", flight, "--json")
    assert imported.exit_code == 0, imported.stderr
    summary = json.loads(imported.stdout)
    assert summary["rate_hz"] == pytest.approx(250.0)
    assert {"body_rate", "specific_force", "rotor_command"} <= set(summary["signals"])
