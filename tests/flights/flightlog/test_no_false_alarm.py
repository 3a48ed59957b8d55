"""Logs of other people that no zero-phase filter has seen are not called filtered, and what is at rest is found."""

import numpy as np
import pytest

from cpfls_cli.flightlog.importing import read_signals
from cpfls_cli.flightlog.settings import ImportSettings, SignalMap
from tests.builders.recorded_flights import columns_of_log

ARPL = {
    "body_rate": SignalMap(columns=("wx", "wy", "wz"), unit="rad/s"),
    "rotor_command": SignalMap(columns=("u1", "u2", "u3", "u4"), unit="1"),
}
PAD = {
    "position": SignalMap(columns=tuple(f"stateEstimate.{axis}" for axis in "xyz"), unit="m"),
    "velocity": SignalMap(columns=tuple(f"stateEstimate.v{axis}" for axis in "xyz"), unit="m/s"),
    "rotor_command": SignalMap(columns=tuple(f"motor.m{rotor}" for rotor in range(1, 5)), unit="1", scale=1.5e-5),
}
LEE = {
    "attitude": SignalMap(columns=tuple(f"ctrlLee_rpy{axis}" for axis in "xyz"), unit="rad"),
    "body_rate": SignalMap(columns=tuple(f"ctrlLee_omega{axis}" for axis in "xyz"), unit="rad/s"),
    "position": SignalMap(columns=tuple(f"stateEstimateZ_{axis}" for axis in "xyz"), unit="m"),
}
EXACT = {
    "attitude": SignalMap(columns=("phi", "theta", "psi"), unit="rad"),
    "body_rate": SignalMap(columns=("wx", "wy", "wz"), unit="rad/s"),
    "rotor_speed": SignalMap(columns=("om1", "om2", "om3", "om4"), unit="rad/s"),
}


def report(folder, name, signals):
    return read_signals(columns_of_log(folder, name), ImportSettings(signals=signals, torque_source=None)).report


@pytest.mark.parametrize(
    ("folder", "name", "signals"),
    [
        ("real/arpl_crazyflie_1khz", "log10_35_65s", ARPL),
        ("real/arpl_crazyflie_1khz", "log15_55_90s", ARPL),
        ("real/crazypad_com", "normal_flight__E9_log00", PAD),
        ("real/crazyswarm2_lee", "log119", LEE),
        ("real/crazyswarm2_lee", "log149", LEE),
        ("real/crazyswarm2_lee", "log45", LEE),
        ("rotorpy", "none", EXACT),
        ("rotorpy", "drag", EXACT),
    ],
)
def test_none_is_called_filtered_slow_or_dead(folder, name, signals):
    found = report(folder, name, signals)
    assert found.cut_off_hz == {}
    assert not any(word in text for text in found.warnings for word in ("updated", "does not change", "clipped"))


@pytest.mark.parametrize("name", ["normal_flight__E9_log00", "add_weight_W3_near_M3__E9_log00"])
def test_the_ground_before_and_between_the_flights_of_a_crazyflie_is_found(name):
    (warning,) = [text for text in report("real/crazypad_com", name, PAD).warnings if "stands at 0 on all" in text]
    height = columns_of_log("real/crazypad_com", name)
    begin, end = (float(word) for word in warning.partition("crop_s: [")[2].partition("]")[0].split(", "))
    flown = (height["t"] > begin + 2) & (height["t"] < end - 4)
    assert np.median(height["stateEstimate.z"][flown]) > 0.2
