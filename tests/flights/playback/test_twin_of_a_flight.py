"""A real Crazyflie's rate setpoints flown again by the law of its firmware, nearer to it than what was asked."""

import json
from pathlib import Path

import pytest

from tests.builders.command_line import run
from tests.builders.recorded_flights import path_of_log

CONFIG = Path(__file__).parents[3] / "configs" / "gap" / "crazypad_usd.yaml"
RATES = ", ".join(f"fixedFrequency.controller.{axis}Rate" for axis in ("roll", "pitch", "yaw"))
ASKED = (
    f"import.signals.setpoint_body_rate={{columns: [{RATES}], unit: deg/s, sign: [1, -1, 1]}}",
    'import.signals.setpoint_thrust={columns: [fixedFrequency.controller.cmd_thrust], unit: "1", scale: 1.52590219e-5}',
)


@pytest.mark.parametrize("name", ["normal_flight__E8_log00"])
def test_the_twin_is_nearer_than_the_setpoint(tmp_path, name):
    words = ("simulate", CONFIG, path_of_log("real/crazypad_usd", name), "--autopilot", "crazyflie")
    result = run(*words, "--set", ASKED[0], "--set", ASKED[1], "-o", tmp_path / "twin.h5", "--json")
    assert result.exit_code == 0, result.stderr
    said = json.loads(result.stdout)
    assert (said["asked"], said["thrust_from"], said["gains"]["source"]) == ("body_rate", "setpoint", "defaults")
    for channel in ("roll rate", "pitch rate"):
        own, asked, still = (said["rms"][each][channel] for each in ("vehicle", "setpoint", "nothing-moves"))
        assert own < asked < still
    assert said["vehicles"]["vehicle"]["channels"]["roll rate"]["cost"] < 200
