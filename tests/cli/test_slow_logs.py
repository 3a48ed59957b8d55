"""Motors that PX4 logs ten times a second: no search for what they cannot show, and what to set is said at once."""

import numpy as np
import pytest
import yaml

from cpfls_cli.flights.models import found_vehicle
from cpfls_cli.result import plain
from tests.builders.unknown_logs import THRUST_FACTOR, flight, ulog_of_flight

CURE = "PX4: SDLOG_PROFILE = 17 (bits 0 and 4: default and high rate)"


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    """Two flights by how many samples their motors are logged apart."""
    folder = tmp_path_factory.mktemp("slow")

    def call(every):
        paths = [folder / f"{number}-every-{every}.ulg" for number in (1, 2)]
        for number, path in enumerate(paths):
            own = flight(seconds=30, seed=number)
            motors = np.hstack([(own.speed / 1000.0) ** 2, np.full((len(own.speed), 8), np.nan)])
            path.write_bytes(ulog_of_flight(own, asked={"actuator_motors": ("float[12] control", every, motors)}))
        return paths

    return call


@pytest.fixture(scope="module")
def slow(cpfls, logs):
    """The config that `init` writes, its logs, and what it said."""
    first, second = logs(10)
    config = first.with_name("study.yaml")
    return config, first, second, cpfls.done("init", first, second, "--mass", 0.8, "--arm", 0.16, "-o", config)


def test_init_says_what_to_set(slow):
    assert f"log them at 100 Hz or more ({CURE}" in slow[-1].stderr


@pytest.fixture(scope="module")
def found(cpfls, slow):
    """The vehicle of these logs, and what was said."""
    config, first, second, _ = slow
    output = config.with_name("vehicle.h5")
    return output, cpfls.done("vehicle", config, first, "--held-out", second, "-o", output)


def test_vehicle_says_it_first_and_fits_only_what_can_be_said(found):
    output, result = found
    assert result.stderr.startswith("vehicle: The rotors are logged 10 times a second")
    # What to set is said once, in the answer.
    assert (result.stdout.count("SDLOG_PROFILE"), result.stderr.count("SDLOG_PROFILE")) == (1, 0)
    assert "Fly in still air" not in result.stdout
    assert "cpfls trajectory" not in result.stdout
    summary = plain(found_vehicle(output))
    assert summary["verdict"] == "shows-the-loop"
    assert summary["evaluated"] <= 2
    assert set(summary["not_determined"]) == {"drag_factor", "inertia.Ixx", "inertia.Iyy", "inertia.Izz"}
    assert abs(summary["parameters"]["rotors.thrust_factor_n_s2"]["value"] / 6e-6 - 1) < 0.02


def test_tune_asks_for_faster_logs_before_a_flight(cpfls, slow, found):
    config = slow[0]
    result = cpfls("tune", config, found[0], "--autopilot", "px4", "-o", config.with_name("g.h5"))
    assert result.exit_code == 2
    assert result.stderr.index(CURE) < result.stderr.index("cpfls trajectory")


def test_anyway_searches_what_is_slow(cpfls, slow):
    config, first, _, _ = slow
    result = cpfls("vehicle", config, first, "--anyway", "-o", config.with_name("anyway.h5"), "--dry-run")
    assert (result.exit_code, "times a second" in result.stderr) == (0, False)


def test_of_fast_logs_nothing_is_said(cpfls, slow, logs):
    first, _ = logs(1)
    result = cpfls("vehicle", slow[0], first, "--dry-run", "-o", first.with_name("fast.h5"))
    assert (result.exit_code, "times a second" in result.stderr) == (0, False)


@pytest.mark.decides
def test_gap_names_wrong_guesses_and_no_effect(cpfls, slow):
    """Motors that rows repeat, taken as they are, had three effects that nobody hid."""
    config, first, second, _ = slow
    words = ("gap", config, first, "--held-out", second, "--accept-guesses", "-o", config.with_name("gap"))
    found = cpfls.summary(*words)
    assert (found["verdict"], [effect["name"] for effect in found["effects"]]) == ("NAMED", ["parameter_error"])
    thrust = found["effects"][0]["coefficients"]["thrust_scale"]
    guessed = yaml.safe_load(cpfls.done("config", config).stdout)["vehicle"]["rotors"][0]["thrust_factor_n_s2"]
    # The accelerometer may be off by 1 % of gravity all along.
    assert thrust["low"] < THRUST_FACTOR / guessed - 1 < thrust["high"]
    assert thrust["value"] == pytest.approx(THRUST_FACTOR / guessed - 1, abs=0.008)
