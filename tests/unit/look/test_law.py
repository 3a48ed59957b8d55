"""The feedback that flew against the stated law, of flights whose controller is written down here."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from cpfls_cli.autopilots.registry import AUTOPILOTS
from cpfls_cli.look.law import flown_feedback, flown_law
from cpfls_cli.look.vibration import vibration_of
from tests.builders.looked import looked_flight

RATE, COUNT = 1000, 40_000
STATED = {
    "p_roll": 50.0, "i_roll": 80.0, "d_roll": 40.0, "looptime": 1000.0, "pid_process_denom": 1.0,
    "gyro_lpf1_dyn_min_hz": 80.0, "gyro_lpf2_static_hz": 0.0, "dterm_lpf1_dyn_min_hz": 100.0,
    "dterm_lpf2_static_hz": 0.0,
}  # fmt: skip


def low_pass(values, hz):
    share = 1 / (1 + RATE / (2 * np.pi * hz))
    return lfilter([share], [1, share - 1], values)


def flown(d=40.0, rounding=0.0, kicked=4.0):
    """A roll in gusts whose PID is that of Betaflight, in its own scales."""
    rng = np.random.default_rng(3)
    gusts, asked = kicked * rng.standard_normal(COUNT), low_pass(12 * rng.standard_normal(COUNT), 3.0)
    measured = np.degrees(low_pass(low_pass(gusts + asked, 20.0), 80.0))
    error = np.degrees(asked) - measured
    slope = low_pass(np.diff(measured, prepend=0.0) * RATE, 100.0)
    command = (0.032029 * 50 * error + 0.244381 * 80 * np.cumsum(error) / RATE - 0.000529 * d * slope) / 1000
    if rounding:
        measured = np.round(measured / rounding) * rounding
    log, three = looked_flight("betaflight", STATED), np.zeros((COUNT, 3))
    axes = {"rate_setpoint": asked, "body_rate": np.radians(measured), "command": command}
    signals = {name: three + np.stack([own, 0 * own, 0 * own], axis=1) for name, own in axes.items()}
    whole = np.ones(COUNT, dtype=bool)
    return replace(log, rate_hz=float(RATE), time=np.arange(COUNT) / RATE, flown=whole, usable=whole, **signals)


@pytest.mark.parametrize("hz", [5.0, 15.0, 30.0])
def test_the_stated_law_fits_what_it_flew(hz):
    log = flown()
    feedback = flown_feedback(log, 0, flown_law(log))
    ratio, turned = feedback.near(hz)
    assert ratio == pytest.approx(1, abs=0.03)
    assert turned == pytest.approx(0, abs=0.03)
    assert feedback.fits(hz)


def test_twice_the_derivative_is_another_law():
    log = flown(d=80.0)
    feedback, hz = flown_feedback(log, 0, flown_law(log)), 30.0
    ratio, turned = feedback.near(hz)
    s, z = 2j * np.pi * hz, np.exp(2j * np.pi * hz / RATE)
    share = 1 / (1 + RATE / (2 * np.pi * 100.0))
    once, twice = (
        0.032029 * 50 + 0.244381 * 80 / s + 0.000529 * d * RATE * (1 - 1 / z) * share / (1 + (share - 1) / z)
        for d in (40.0, 80.0)
    )
    assert ratio == pytest.approx(abs(twice / once), rel=0.1)
    assert turned == pytest.approx(np.angle(twice / once), abs=0.1)
    assert not feedback.fits(hz)
    assert feedback.fits(2.0)


def test_what_rounding_hides_is_not_judged():
    log = flown(rounding=4.0, kicked=0.1)
    feedback = flown_feedback(log, 0, flown_law(log))
    # What is shown seems smaller by a tenth at most.
    assert (np.abs(feedback.over) > 0.85).all()
    assert feedback.near(50.0) is None
    assert feedback.fits(50.0)


def test_older_names_and_kinds_of_filters_are_read_once():
    header = {
        "rollPID": "45,40,25", "dterm_filter_type": 1.0, "dterm_lpf_hz": 100.0, "dterm_notch_hz": 260.0,
        "dterm_notch_cutoff": 160.0, "gyro_lowpass_hz": 90.0, "gyro_notch_hz": "400,200",
        "gyro_notch_cutoff": "300,100", "looptime": 125.0, "pid_process_denom": 1.0,
    }  # fmt: skip
    log = replace(looked_flight("betaflight", system="Betaflight 3.1.3"), parameters=header)
    own = flown_law(log).axes[0]
    assert [(each.kind, each.hz) for each in own.slope] == [("notch", 260.0), ("second", 100.0)]
    assert [(each.kind, each.hz) for each in own.measured] == [("notch", 400.0), ("notch", 200.0), ("first", 90.0)]
    stages = [each.stage for each in vibration_of(log).filters]
    assert (stages.count("measured"), stages.count("slope")) == (3, 2)
    new = AUTOPILOTS["betaflight"].law({"dterm_lpf1_type": 2.0, "dterm_lpf1_dyn_min_hz": 100.0})
    assert [round(each.hz) for each in new.axes[0].slope] == [155, 155, 150]
    assert flown_law(replace(log, system="Betaflight 3.0.1")) is None
