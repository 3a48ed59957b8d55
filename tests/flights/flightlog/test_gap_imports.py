"""Flights of others through the import command and the shipped configs: nothing is lost that a comparison needs."""

import json
from pathlib import Path

import h5py
import numpy as np
import pytest

from tests.builders.command_line import run
from tests.builders.recorded_flights import columns_of_log, path_of_log

CONFIGS = Path(__file__).parents[3] / "configs" / "gap"
SAMPLED = {"time", "rotor_command"}
RAW = SAMPLED | {"body_rate", "position", "velocity", "acceleration", "rotor_speed"}
RAW |= {"attitude", "attitude_rate", "attitude_acceleration"}
ARPL = SAMPLED | {"body_rate", "specific_force"}
CRAZYPAD = SAMPLED | {"position", "velocity", "acceleration", "voltage"}
CRAZYSWARM = {"time", "attitude", "attitude_rate", "attitude_acceleration", "body_rate", "torque", "body_torque"}
CRAZYSWARM |= {"thrust", "position", "velocity"}
NORMAL = [f"normal_flight__E9_log0{number}" for number in range(3)]
LIGHT, HEAVY = ["add_weight_W1_near_M3__E9_log04"], [f"add_weight_W3_near_M3__E9_log0{number}" for number in (0, 2)]
CASES = (
    [(config, "rotorpy", name, RAW) for config in ("rotorpy", "sixkg") for name in ("none", "drag", "com")]
    + [("arpl", "real/arpl_crazyflie_1khz", f"log{name}", ARPL) for name in ("10_35_65s", "15_55_90s", "16_32_49s")]
    + [("arpl_yaw", "real/arpl_crazyflie_1khz", "log16_32_49s", ARPL)]
    + [("crazypad", "real/crazypad_com", name, CRAZYPAD) for name in NORMAL + LIGHT + HEAVY]
    + [("crazyswarm2", "real/crazyswarm2_lee", name, CRAZYSWARM) for name in ("log119", "log149", "log45")]
)


@pytest.fixture
def imported(tmp_path):
    """Import a flight; give the summary and the sampled signals."""

    def call(config, folder, name):
        flight = tmp_path / f"{config}_{name}.h5"
        words = ("import", CONFIGS / f"{config}.yaml", path_of_log(folder, name), "-o", flight, "--json")
        result = run(*words)
        assert result.exit_code == 0, result.stderr
        with h5py.File(flight) as file:
            samples = len(file["time"])
            each = {name: own for name, own in file.items() if isinstance(own, h5py.Dataset)}
            found = {name: own[:] for name, own in each.items() if own.shape[:1] == (samples,)}
        return json.loads(result.stdout), found

    return call


@pytest.mark.parametrize(("config", "folder", "name", "signals"), CASES, ids=lambda value: value if value else "")
def test_the_flight_holds_every_signal_of_the_log(imported, config, folder, name, signals):
    summary, found = imported(config, folder, name)
    assert set(found) == signals
    assert (summary["spikes"], summary["missing"], summary["delay_s"]) == ({}, {}, 0.0)
    assert len({len(values) for values in found.values()}) == 1


def test_a_simulated_flight_comes_back_as_it_was_logged(imported):
    columns = columns_of_log("rotorpy", "none")
    _, found = imported("rotorpy", "rotorpy", "none")
    for name, prefix, parts in (
        ("rotor_speed", "om", "1234"),
        ("rotor_command", "omcmd", "1234"),
        ("body_rate", "w", "xyz"),
    ):
        logged = np.column_stack([columns[prefix + part] for part in parts])
        np.testing.assert_allclose(found[name], logged, rtol=1e-10, atol=1e-10)


def test_the_accelerometer_of_a_parked_crazyflie_senses_gravity_upward(imported):
    """The motors of log16 stand still at first."""
    _, found = imported("arpl", "real/arpl_crazyflie_1khz", "log16_32_49s")
    parked = found["specific_force"][(found["time"] > 0.2) & (found["time"] < 0.5)].mean(axis=0)
    assert np.linalg.norm(parked) == pytest.approx(9.81, rel=0.02)
    assert parked[2] > 9.6


def test_commands_and_thrust_of_a_crazyflie_are_those_of_the_log(imported):
    columns = columns_of_log("real/crazyswarm2_lee", "log119")
    summary, found = imported("crazyswarm2", "real/crazyswarm2_lee", "log119")
    at = columns["t"][0] + summary["span_s"][0] + found["time"]
    np.testing.assert_allclose(found["thrust"], np.interp(at, columns["t"], columns["ctrlLee_thrustSi"]), rtol=1e-6)


def imbalance(found):
    """Thrust asked of the left motors (M3, M4) less that of the right ones, over all."""
    thrust = found["rotor_command"] ** 2
    right, left = thrust[:, :2].mean(), thrust[:, 2:].mean()
    return (left - right) / (left + right)


def test_a_heavier_weight_on_the_left_asks_for_more_of_the_left_motors(imported):
    """The origin's own figures: 0.003 without, 0.025 with the lighter weight, 0.092 with the heavier one."""
    folder = "real/crazypad_com"
    normal, light, heavy = (
        [imbalance(imported("crazypad", folder, name)[1]) for name in names] for names in (NORMAL, LIGHT, HEAVY)
    )
    assert np.mean(normal) == pytest.approx(0.003, abs=0.004)
    assert np.mean(light) == pytest.approx(0.025, abs=0.004)
    assert np.mean(heavy) == pytest.approx(0.092, abs=0.008)


@pytest.mark.parametrize("name", NORMAL + LIGHT + HEAVY)
def test_one_crop_keeps_level_flight_from_rest_to_rest(imported, name):
    _, found = imported("crazypad", "real/crazypad_com", name)
    assert found["time"][-1] > 5
    assert found["position"][:, 2].min() > 0.44
    # Side speed decides about roll; forward, the craft starts and ends at rest.
    assert abs(found["velocity"][:, 1].mean()) < 0.03
    assert np.abs(found["velocity"][[0, -1], 0]).max() < 0.25
    assert 3.2 < found["voltage"].min() < found["voltage"].max() < 3.7
