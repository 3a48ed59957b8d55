"""`cpfls replay` on flights of others, with the shipped configs of the vehicles: what each log lets be played back."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from cpfls_cli.config.load import load_study
from cpfls_cli.consistency.check import check
from cpfls_cli.flights.playback import flights_to_play
from tests.builders.command_line import run
from tests.builders.recorded_flights import path_of_log

CONFIGS = Path(__file__).parents[3] / "configs" / "gap"
SIGNALS = ("body_rate", "attitude", "velocity", "position")


def replayed(config, folder, name, output):
    words = ("replay", CONFIGS / f"{config}.yaml", "vehicle", path_of_log(folder, name), "-o", output, "--every", "5")
    result = run(*words, "--json")
    assert result.exit_code == 0, result.stderr
    return json.loads(result.stdout)


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
