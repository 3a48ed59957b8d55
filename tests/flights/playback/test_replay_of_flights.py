"""`cpfls replay` on flights of others, with the shipped configs of the vehicles: what each log lets be played back."""

import json
from pathlib import Path

import pytest

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
