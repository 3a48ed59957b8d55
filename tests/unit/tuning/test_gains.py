"""Gains by asked margins."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.autopilots.registry import AUTOPILOTS
from cpfls_cli.tuning.gains import AskedMargins, proposal_of, with_filters
from cpfls_cli.tuning.margins import evaluate
from cpfls_cli.tuning.plant import Spread, hover_plant, noise_of
from tests.builders.autopilots import CROSS

CERTAIN = Spread()
WIDE = Spread((0.85, 1.2), (0.8, 1.3), (1.0, 1.0))


USUAL = AskedMargins()


def found(name, spread=CERTAIN, asked=USUAL, lag=0.03):
    autopilot = AUTOPILOTS[name]
    hover = replace(hover_plant(autopilot.law(), CROSS, None, lag), spreads=(spread,) * 3)
    proposals = with_filters(autopilot, autopilot.defaults(), hover, asked).proposals
    values = autopilot.defaults() | {each.parameter.name: each.value for each in proposals}
    return {each.parameter.name: each for each in proposals}, evaluate(autopilot.law(values), hover)


@pytest.mark.parametrize("name", AUTOPILOTS)
def test_the_asked_margins_hold_with_every_vehicle_that_is_possible(name):
    proposals, evaluation = found(name, WIDE)
    held = [axis for axis, word in enumerate(("roll", "pitch", "yaw")) if not _clipped(proposals, word)]
    assert {0, 1} <= set(held)
    for axis in held:
        own = evaluation.axes[axis]
        worst = own.command_worst
        # Gains have few digits.
        assert own.disk_deg > 44.5
        assert worst.phase_deg > 44.5
        assert worst.gain_db > 6.0
        assert own.overshoot < 0.1


def _clipped(proposals, axis):
    letters = {"roll": ("ROLL", "RLL", "roll"), "pitch": ("PITCH", "PIT", "pitch"), "yaw": ("YAW", "yaw")}[axis]
    return any(each.clipped for name, each in proposals.items() if any(word in name for word in letters))


def test_what_flights_leave_open_costs_gain():
    _, sure = found("px4")
    _, open_ = found("px4", WIDE)
    _, more = found("px4", asked=AskedMargins(6.0, 60.0, 35.0))
    _, late = found("px4", lag=0.08)
    for other in (open_, more, late):
        assert other.roll.bandwidth_hz < 0.95 * sure.roll.bandwidth_hz


def test_one_disk_holds_all_margins_that_are_asked_for():
    asked = AskedMargins(6.0, 45.0, 35.0)
    assert np.degrees(2 * np.arctan(asked.disk / 2)) == pytest.approx(45.0)
    assert AskedMargins(12.0, 30.0, 20.0).disk == pytest.approx(2 * (10**0.6 - 1) / (10**0.6 + 1))


def test_no_proposal_leaves_the_documented_range():
    parameter = AUTOPILOTS["ardupilot"].named("ATC_ANG_YAW_P")
    low, inside = proposal_of(parameter, 1.3), proposal_of(parameter, 4.567)
    assert (low.value, low.clipped) == (3.0, True)
    assert (inside.value, inside.clipped) == (4.57, False)


def test_a_line_in_the_noise_is_found_beside_its_floor():
    time = np.arange(0, 20, 1 / 500)
    rng = np.random.default_rng(1)
    rate = 0.02 * rng.standard_normal((len(time), 3)) + 0.05 * np.sin(2 * np.pi * 118.0 * time)[:, None]
    noise = noise_of([(time, rate)])
    (line,) = noise.lines
    assert line.hz == pytest.approx(118.0, abs=1.0)
    assert line.above_db > 10.0
    spacing = noise.frequency[1] - noise.frequency[0]
    assert np.sqrt(noise.density.sum(axis=0) * spacing) == pytest.approx(rate.std(axis=0), rel=0.05)
    quiet, loud = (noise.of_command(AUTOPILOTS["px4"].law({"MC_ROLLRATE_K": k}), 0) for k in (1.0, 2.0))
    assert loud == pytest.approx(2 * quiet)
    assert noise_of([(time[:20], rate[:20])]) is None


def test_a_log_that_pauses_is_as_noisy_as_before():
    time, rng = np.arange(0, 10, 1 / 400), np.random.default_rng(1)
    rate = 0.02 * rng.standard_normal((len(time), 3))
    whole = noise_of([(time, rate)])
    paused = noise_of([(time + 1e6 * (time > 5), rate)])
    assert paused.density.mean() == pytest.approx(whole.density.mean(), rel=0.05)
    assert noise_of([(np.zeros(len(time)), rate)]) is None
