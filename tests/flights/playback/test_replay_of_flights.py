"""Real flights are played back."""

from dataclasses import replace
from pathlib import Path

import pytest

from benchmarks.shared.playback_scores import free_runs, rate_stays, score
from cpfls_cli import load_model
from cpfls_cli.config.load import load_study
from cpfls_cli.config.study import resolved_yaml
from cpfls_cli.consistency.check import check
from cpfls_cli.flights.playback import flights_to_play
from tests.builders.command_line import run
from tests.builders.playback_flights import ROTORPY_HIDDEN, rotorpy_flight, rotorpy_truth
from tests.builders.recorded_flights import path_of_log
from tests.builders.vehicle_models import vehicle_of, write_vehicle

CONFIGS = Path(__file__).parents[3] / "configs" / "gap"
SIGNALS = ("body_rate", "attitude", "velocity", "position")
ROTORPY = Path(__file__).parents[3] / "configs" / "gap" / "rotorpy.yaml"


def replayed(config, folder, name, output):
    words = ("replay", CONFIGS / f"{config}.yaml", "vehicle", path_of_log(folder, name), "-o", output, "--every", "5")
    return run.summary(*words)


def known(answer):
    return tuple(signal for signal in SIGNALS if answer["models"]["model"][signal] is not None)


def test_the_stated_vehicle_is_the_one_that_another_simulator_flew(tmp_path):
    answer = replayed("rotorpy", "rotorpy", "none", tmp_path / "replay.h5")
    assert known(answer) == SIGNALS
    models = answer["models"]
    for signal in SIGNALS:
        rivals = (models[name][signal]["sum"] for name in ("nothing-moves", "rate-stays"))
        assert models["model"][signal]["sum"] < 1e-3 * min(rivals), signal


@pytest.mark.parametrize(
    ("config", "folder", "name", "signals", "driven_by"),
    [
        ("crazyswarm2", "crazyswarm2_lee", "log119", SIGNALS, "stated torque and thrust"),
        ("arpl", "arpl_crazyflie_1khz", "log15_55_90s", ("body_rate",), "rotor commands"),
        ("crazypad", "crazypad_com", "normal_flight__E9_log00", ("body_rate",), "rotor commands"),
    ],
)
def test_real_flights_are_played_back_as_far_as_they_are_known(config, folder, name, signals, driven_by, tmp_path):
    answer = replayed(config, f"real/{folder}", name, tmp_path / "replay.h5")
    assert known(answer) == signals
    (flight,) = answer["flights"]
    assert flight["driven_by"] == driven_by
    assert flight["rotation_alone"] == (signals == ("body_rate",))
    # No real flight follows the rigid body for half a second: each has a lag or a number that is wrong.
    assert answer["models"]["model"]["body_rate"]["sum"] > answer["models"]["nothing-moves"]["body_rate"]["sum"]


def logged(config, folder, name):
    study = load_study(CONFIGS / f"{config}.yaml")
    (flight,) = flights_to_play([path_of_log(folder, name)], study)
    return flight.parts, study.gap


def said_of(parts, settings):
    return [finding.sentence for finding in check(parts, settings)]


@pytest.mark.parametrize(
    ("config", "folder", "name", "said"),
    [
        *(("rotorpy", "rotorpy", name, []) for name in ("none", "com", "drag")),
        *(("crazyswarm2", "real/crazyswarm2_lee", name, []) for name in ("log119", "log149", "log45")),
        *(("arpl", "real/arpl_crazyflie_1khz", name, []) for name in ("log10_35_65s", "log15_55_90s", "log16_32_49s")),
        ("crazypad", "real/crazypad_com", "add_weight_W1_near_M3__E9_log04", []),
        ("crazypad", "real/crazypad_com", "add_weight_W3_near_M3__E9_log00", []),
        # A velocity of a filter that trusts its accelerometer little, in a hover.
        ("crazypad", "real/crazypad_com", "add_weight_W3_near_M3__E9_log02", []),
        ("crazypad", "real/crazypad_com", "normal_flight__E9_log00", []),
        ("crazypad", "real/crazypad_com", "normal_flight__E9_log01", []),
        ("crazypad", "real/crazypad_com", "normal_flight__E9_log02", []),
        ("crazypad_usd", "real/crazypad_usd", "normal_flight__E8_log00", []),
        ("crazypad_usd", "real/crazypad_usd", "cut_propeller_M3_4mm_4mm_39mm__E8_log00", []),
        ("crazypad_usd", "real/crazypad_usd", "weight_on_string_W3_near_M3__E8_log01", []),
    ],
)
def test_a_flight_in_its_right_units_does_not_contradict_itself(config, folder, name, said):
    found = check(*logged(config, folder, name))
    assert len(found) == len(said)
    assert all(words in finding.what for words, finding in zip(said, found, strict=True))
    assert not any(finding.contradiction for finding in found)


@pytest.mark.parametrize("name", ["none", "com", "drag"])
def test_a_flight_of_another_simulator_with_a_wrong_unit_is_said(name):
    (part,), settings = logged("rotorpy", "rotorpy", name)
    assert "the velocity is in km/h" in said_of([replace(part, velocity=3.6 * part.velocity)], settings)[0]
    assert "the acceleration is in g" in said_of([replace(part, acceleration=part.acceleration / 9.81)], settings)[0]
    in_rpm = said_of([replace(part, rotor_speed=9.549 * part.rotor_speed)], settings)
    assert ["rotors turn" in in_rpm[0], "times the weight" in in_rpm[1], len(in_rpm)] == [True, True, 2]


@pytest.mark.parametrize(
    ("config", "folder", "name"),
    [
        ("rotorpy", "rotorpy", "none"),
        ("rotorpy", "rotorpy", "com"),
        ("arpl", "real/arpl_crazyflie_1khz", "log10_35_65s"),
        ("crazypad_usd", "real/crazypad_usd", "normal_flight__E8_log02"),
    ],
)
def test_columns_of_rotors_in_another_order_are_said_with_the_right_one(config, folder, name):
    parts, settings = logged(config, folder, name)
    part = max(parts, key=len)
    (said,) = said_of([replace(part, rotor_speed=part.rotor_speed[:, [1, 0, 2, 3]])], settings)
    places = said.partition("columns: ")[2].partition(" (which")[0].split("; ")
    sides = [place.partition(",")[0].split() for place in places]
    right = [part.vehicle.rotors[index] for index in (1, 0, 2, 3)]
    assert [("front" in side, "left" in side) for side in sides] == [
        (rotor.position_m[0] > 0, rotor.position_m[1] > 0) for rotor in right
    ]
    assert [place.endswith("counter-clockwise") for place in places] == [rotor.spin > 0 for rotor in right]


@pytest.mark.parametrize("name", ROTORPY_HIDDEN)
def test_the_model_that_flew_plays_the_flight_back(name):
    flight = rotorpy_flight(name)
    truth = score([free_runs(rotorpy_truth(name), flight, every=5)])
    stays = score([rate_stays(flight, every=5)])
    # Measured speeds are joined by straight lines; the rotors follow with a lag of 5 ms.
    assert (truth.sums < 4e-4 * stays.sums).all()


@pytest.mark.parametrize("name", [name for name, hidden in ROTORPY_HIDDEN.items() if hidden])
def test_what_is_hidden_is_seen(name):
    flight = rotorpy_flight(name)
    without, truth = (score([free_runs(rotorpy_truth(model), flight, every=5)]) for model in ("none", name))
    assert (without.sums > 1000 * truth.sums).all()


def answered(*words):
    return run.summary(*words, "--force")


@pytest.mark.parametrize("name", [name for name, hidden in ROTORPY_HIDDEN.items() if hidden])
def test_torque_and_force_of_the_model_that_flew_are_what_the_motion_takes(name, tmp_path):
    """About 1e-6 N m and N; at its first samples one flight falls into its path."""
    log, flight, study = path_of_log("rotorpy", name), tmp_path / "flight.h5", load_study(ROTORPY)
    answered("import", ROTORPY, log, "-o", flight)
    found, gaps = {}, {}
    for model in ("none", name):
        vehicle = replace(rotorpy_truth(model), vehicle=study.vehicle)
        write_vehicle(tmp_path / "vehicle.h5", vehicle_of(vehicle), resolved_yaml(study))
        found[model] = load_model(tmp_path / "vehicle.h5", ROTORPY).predict(flight)
        words = ("compare", ROTORPY, flight, "--model", tmp_path / "vehicle.h5", "-o", tmp_path / "gap.h5")
        gaps[model] = answered(*words)["gap"]
    assert found[name].score.r2_body.min() > 0.999 > found["none"].score.r2_body.min()
    assert found[name].force_rms.max() < 1e-6
    assert max(gaps[name]["floors"]) < 0.1
    assert max(gaps["none"]["floors"]) > 200


CRAZYPAD = Path(__file__).parents[3] / "configs" / "gap" / "crazypad_usd.yaml"
RATES = ", ".join(f"fixedFrequency.controller.{axis}Rate" for axis in ("roll", "pitch", "yaw"))
ASKED = (
    f"import.signals.setpoint_body_rate={{columns: [{RATES}], unit: deg/s, sign: [1, -1, 1]}}",
    'import.signals.setpoint_thrust={columns: [fixedFrequency.controller.cmd_thrust], unit: "1", scale: 1.52590219e-5}',
)


@pytest.mark.parametrize("name", ["normal_flight__E8_log00"])
def test_the_twin_is_nearer_than_the_setpoint(tmp_path, name):
    words = ("simulate", CRAZYPAD, path_of_log("real/crazypad_usd", name), "--autopilot", "crazyflie")
    said = run.summary(*words, "--set", ASKED[0], "--set", ASKED[1], "-o", tmp_path / "twin.h5")
    assert (said["asked"], said["thrust_from"], said["gains"]["source"]) == ("body_rate", "setpoint", "defaults")
    for channel in ("roll rate", "pitch rate"):
        own, asked, still = (said["rms"][each][channel] for each in ("vehicle", "setpoint", "nothing-moves"))
        assert own < asked < still
    assert said["vehicles"]["vehicle"]["channels"]["roll rate"]["cost"] < 200
