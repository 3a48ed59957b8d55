"""Logs of PX4's default profile: motors ten times a second, which are rebuilt from what they are mixed from."""

import numpy as np
import pytest

from cpfls_cli.config.load import load_study
from cpfls_cli.errors import InputError
from cpfls_cli.flights.recordings import imported
from tests.builders.command_line import run
from tests.builders.thinned_logs import Flown, write_px4

SWAPPED = {"CA_ROTOR0_PX": -0.16, "CA_ROTOR0_PY": -0.16, "CA_ROTOR1_PX": 0.16, "CA_ROTOR1_PY": 0.16}


@pytest.fixture(scope="module")
def flown():
    return Flown("px4", seconds=8.0)


@pytest.fixture(scope="module")
def log(flown, tmp_path_factory):
    return write_px4(tmp_path_factory.mktemp("log") / "flight.ulg", flown)


@pytest.fixture(scope="module")
def config(log):
    done = run("init", log, "-o", log.with_name("study.yaml"), "--mass", 1.2)
    assert done.exit_code == 0, done.output
    said = "rotor commands are rebuilt from vehicle_torque_setpoint and CA_ROTOR*: 50 Hz instead of 10; they explain"
    assert said in " ".join(done.output.split())
    assert "too slow" not in done.output
    return log.with_name("study.yaml")


def commands(path, config):
    return imported(path, load_study(config))


def test_a_config_of_init_imports_rebuilt_motors(flown, log, config):
    flight = commands(log, config)
    assert flight.report.updated_hz["rotor_command"] == pytest.approx(50, rel=0.02)
    at = np.searchsorted(flown.time, flight.report.span_s[0] + flight.time + 1e-6, side="right") - 1
    truth = flown.command[at]
    differing = truth - truth.mean(axis=1, keepdims=True)
    own = flight.rotor_command - flight.rotor_command.mean(axis=1, keepdims=True)
    # What is left is held for 20 ms.
    assert ((own - differing) ** 2).sum() < 0.2 * (differing**2).sum()


def test_who_names_the_logged_columns_gets_them(log, config):
    text = config.read_text()
    own = text.replace("gap_s: 0.1", "gap_s: 0.3")
    for motor in range(4):
        own = own.replace(f'"rebuilt.rotor[{motor}]"', f'"actuator_motors.control[{motor}]"')
    assert own != text
    named = config.with_name("logged.yaml")
    named.write_text(own)
    flight = commands(log, named)
    assert len(np.unique(flight.rotor_command[:, 0].round(6))) < 90


def test_a_log_of_which_nothing_can_be_rebuilt_is_refused(flown, config, tmp_path):
    wrong = write_px4(tmp_path / "wrong.ulg", flown, more=SWAPPED)
    with pytest.raises(InputError, match=r"cannot be rebuilt.*about.*name the logged commands"):
        commands(wrong, config)
