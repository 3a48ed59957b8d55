"""Gains and their margins."""

from dataclasses import replace
from functools import cache

import control
import numpy as np
import pytest

from cpfls_cli.autopilots.motors import Motors
from cpfls_cli.autopilots.registry import AUTOPILOTS
from cpfls_cli.errors import ComputationError
from cpfls_cli.playback.model import ModelEffect, VehicleModel, commanded_anew
from cpfls_cli.playback.rotors import RotorResponse
from cpfls_cli.tuning.gains import AskedMargins, proposal_of, with_filters
from cpfls_cli.tuning.margins import (
    axis_loops,
    disk_of,
    evaluate,
    frequencies,
    is_stable,
    margins,
    moved_by,
    step_answer,
)
from cpfls_cli.tuning.plant import AxisPlant, Spread, hover_plant, noise_of, on_less, spread_of
from cpfls_cli.vehicle.rotors import allocation_matrix
from tests.builders.autopilots import CROSS

CERTAIN = Spread()
WIDE = Spread((0.85, 1.2), (0.8, 1.3), (1.0, 1.0))


USUAL = AskedMargins()
FREQUENCY = np.geomspace(0.002, 200.0, 2000)
S = 2j * np.pi * FREQUENCY


@cache
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
    _, sure = found("crazyflie")
    _, open_ = found("crazyflie", WIDE)
    _, more = found("crazyflie", asked=AskedMargins(6.0, 60.0, 35.0))
    _, late = found("crazyflie", lag=0.08)
    for other in (open_, more, late):
        assert other.roll.bandwidth_hz < 0.95 * sure.roll.bandwidth_hz


def test_one_disk_holds_all_margins_and_no_proposal_leaves_the_documented_range():
    assert np.degrees(2 * np.arctan(AskedMargins(6.0, 45.0, 35.0).disk / 2)) == pytest.approx(45.0)
    assert AskedMargins(12.0, 30.0, 20.0).disk == pytest.approx(2 * (10**0.6 - 1) / (10**0.6 + 1))
    parameter = AUTOPILOTS["ardupilot"].named("ATC_ANG_YAW_P")
    low, inside = proposal_of(parameter, 1.3), proposal_of(parameter, 4.567)
    assert (low.value, low.clipped) == (3.0, True)
    assert (inside.value, inside.clipped) == (4.57, False)


def test_a_line_in_the_noise_is_found_next_to_its_floor():
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


def test_margins_of_an_integrator_with_a_delay():
    gain, delay = 20.0, 0.02
    found = margins(FREQUENCY, gain * np.exp(-S * delay) / S)
    assert found.gain_db == pytest.approx(20 * np.log10(np.pi / (2 * gain * delay)), abs=0.02)
    assert found.phase_deg == pytest.approx(90 - np.degrees(gain * delay), abs=0.02)
    assert found.crossover_hz == pytest.approx(gain / (2 * np.pi), rel=1e-3)


def test_the_disk_margin_is_that_of_python_control():
    system = control.tf([30.0], [0.02, 1.0, 0.0])
    loop = 30.0 / (S * (0.02 * S + 1))
    expected, *_ = control.disk_margins(system, 2 * np.pi * FREQUENCY, skew=0.0)
    assert disk_of(loop) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("integrators", [1, 2, 3, 4])
@pytest.mark.parametrize("gain", [0.1, 1.0, 10.0, 100.0])
def test_a_loop_is_stable_where_its_closed_poles_are(integrators, gain):
    s = control.tf("s")
    system = gain * (1 + 0.2 / s) ** (integrators - 1) / (s * (0.05 * s + 1) ** 2)
    poles = control.feedback(system, 1).poles()
    loop = gain * (1 + 0.2 / S) ** (integrators - 1) / (S * (0.05 * S + 1) ** 2)
    assert is_stable(FREQUENCY, loop) == bool((poles.real < 0).all())


@pytest.mark.parametrize("name", AUTOPILOTS)
def test_a_rigid_vehicle_in_hover_turns_as_its_allocation_says(name):
    law = AUTOPILOTS[name].law()
    hover = hover_plant(law, CROSS, None, 0.03)
    share = CROSS.mass_kg * CROSS.gravity_m_s2 / (4 * 1.0e-5 * CROSS.rotor_speed_max_rad_s**2)
    assert hover.signal**2 == pytest.approx(share, rel=1e-6)
    changed = {}
    motors = Motors.of(law.mixer, law.curve, CROSS)
    for axis in range(3):
        ends = [motors.speeds(hover.share, sign * 1e-4 * np.eye(3)[axis]).speed for sign in (1, -1)]
        torque = allocation_matrix(CROSS)[1:] @ (ends[0] ** 2 - ends[1] ** 2) / 2e-4
        changed[axis] = torque[axis] / CROSS.inertia_kg_m2[axis]
    assert [each.gain for each in hover.axes] == pytest.approx(list(changed.values()), rel=1e-4)
    assert all((each.lag, each.delay, each.slow) == (0.03, 0.0, 0.0) for each in hover.axes)


def test_slow_actuation_damping_and_accelerating_rotors_are_those_of_their_formulas():
    law, plain = AUTOPILOTS["px4"].law(), hover_plant(AUTOPILOTS["px4"].law(), CROSS, None, 0.03)
    inertia, damping, rotor, slow = np.array(CROSS.inertia_kg_m2[:3]), np.array([1e-3, 2e-3, 3e-3]), 2e-5, (-0.4, 0.3)
    effects = (ModelEffect("linear_damping", {}, damping), ModelEffect("rotor_acceleration", {}, np.array([rotor])))
    model = VehicleModel(
        vehicle=CROSS, response=RotorResponse(slow_roll_pitch=slow[0], slow_yaw=slow[1]), effects=effects
    )
    hover = hover_plant(law, CROSS, model, 0.03)
    share, gain = np.array([slow[0], *slow]), np.array([axis.gain for axis in plain.axes])
    assert [axis.damping for axis in hover.axes] == pytest.approx(list(damping / inertia))
    # What comes back slowly is missing at once.
    assert [axis.gain for axis in hover.axes] == pytest.approx(list((1 - share) * gain))
    assert [axis.slow for axis in hover.axes] == pytest.approx(list(share * gain))
    # Yaw torque k_d w^2 and J_r dw/dt of each rotor have one sign.
    speed = hover.signal * CROSS.rotor_speed_max_rad_s
    yaw = gain[2] * rotor / (2 * CROSS.rotors[0].drag_factor_n_m_s2 * speed)
    assert [axis.by_acceleration for axis in hover.axes] == pytest.approx([0.0, 0.0, yaw])


def test_lag_and_delay_of_a_model_of_commands_are_those_of_the_rotors():
    response = RotorResponse(lag_s=0.05, delay_s=0.01)
    law = AUTOPILOTS["px4"].law()
    for commanded, expected in ((True, (0.05, 0.01)), (False, (0.08, 0.01))):
        model = VehicleModel(vehicle=CROSS, response=response, commanded=commanded)
        axis = hover_plant(law, CROSS, model, 0.03).axes[0]
        assert (axis.lag, axis.delay) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("mass_kg", "why"), [(5.0, "full thrust does not carry the weight"), (0.05, "rotors that idle carry more")]
)
def test_a_vehicle_that_hovers_nowhere_between_idle_and_full_thrust_is_refused(mass_kg, why):
    with pytest.raises(ComputationError, match=why):
        hover_plant(AUTOPILOTS["ardupilot"].law(), replace(CROSS, mass_kg=mass_kg), None, 0.03)


def test_intervals_become_the_corners_of_the_plant():
    plant = AxisPlant(100.0, 0.0, 0.0, 1.0, 0.0, 0.04, 0.0)
    corners = list(spread_of({"I": (0.9, 1.2), "k": (0.95, 1.05), "lag": (0.5, 1.5)}, "I", "k").corners(plant))
    assert (corners[0], len(corners)) == (plant, 5)
    assert sorted({each.gain for each in corners}) == pytest.approx([95 / 1.2, 100.0, 105 / 0.9])
    assert list(Spread().corners(plant)) == [plant]
    *_, late = Spread(lag=(0.5, 1.5), delayed=0.5).corners(plant)
    assert (late.lag, late.delay) == pytest.approx((0.03, 0.03))


def test_a_lag_and_a_delay_of_which_the_sum_is_known_are_not_both_at_their_longest():
    plant = AxisPlant(100.0, 0.0, 0.0, 1.0, 0.0, 0.03, 0.02)
    apart = Spread(lag=(0.5, 1.5), delay=(0.5, 1.5))
    assert max(each.lag + each.delay for each in apart.corners(plant)) == pytest.approx(0.075)
    trade = list(replace(apart, trade=-0.96).corners(plant))
    assert {round(1e3 * each.lag) for each in trade} >= {15, 45}
    assert {round(1e3 * each.delay) for each in trade} >= {10, 30}
    # Half widths of 15 and 10 ms, correlated by -0.96.
    assert max(each.lag + each.delay for each in trade) == pytest.approx(0.05 + 1e-3 * 37**0.5)
    # Each side of an interval that is skewed is reached.
    skewed = list(Spread(lag=(0.1, 2.0), delay=(0.5, 1.1), trade=-0.96).corners(plant))
    assert [min(each.lag for each in skewed), max(each.lag for each in skewed)] == pytest.approx([0.003, 0.06])
    assert [min(each.delay for each in skewed), max(each.delay for each in skewed)] == pytest.approx([0.01, 0.022])


@pytest.mark.parametrize("name", ["px4", "betaflight", "crazyflie"])
def test_gains_reach_down_to_those_on_an_emptier_battery(name):
    """On it the same command turns rotors slower, which hover at the speed that they always hover at."""
    law, model = AUTOPILOTS[name].law(), VehicleModel(vehicle=CROSS, response=RotorResponse(lag_s=0.03))
    hover = replace(hover_plant(law, CROSS, model, 0.03), spreads=(WIDE,) * 3)
    wider = on_less(hover, 0.9, law, model, 0.03)
    motors = Motors.of(law.mixer, law.curve, CROSS)
    share, less = hover.share, motors.share_of(motors.speed_at(hover.share) / 0.9)
    expected = 0.9 * motors.speed_slope(less) / motors.speed_slope(share)
    assert [each.gain for each in wider.spreads] == [pytest.approx((0.85 * expected, 1.2))] * 3
    assert (wider.axes, wider.share) == (hover.axes, hover.share)
    with pytest.raises(ComputationError, match="battery_use says; make that smaller"):
        on_less(hover, 0.5, law, model, 0.03)


def test_commands_of_an_autopilot_are_met_half_a_sample_of_the_log_later():
    """A log at 100 Hz holds commands for 10 ms, which on average makes them 5 ms late in it, not in flight."""
    law, response = AUTOPILOTS["px4"].law(), RotorResponse(lag_s=0.05, delay_s=0.01)
    model = VehicleModel(vehicle=CROSS, response=response, commanded=True, held_s=0.01)
    for anew in (commanded_anew(model), commanded_anew(commanded_anew(model))):
        axis = hover_plant(law, CROSS, anew, 0.03).axes[0]
        assert (axis.lag, axis.delay) == pytest.approx((0.05, 0.015))
    measured = replace(model, held_s=0.0)
    assert commanded_anew(measured) is measured


@pytest.mark.parametrize(("held_s", "lag", "delay"), [(0.01, 0.05, 0.01), (0.02, 0.05, 0.005), (0.05, 0.04, 0.0)])
def test_commands_of_another_log_are_late_by_half_of_its_own_sample(held_s, lag, delay):
    model = VehicleModel(vehicle=CROSS, response=RotorResponse(lag_s=0.05, delay_s=0.01), commanded=True, held_s=0.01)
    other = commanded_anew(model, held_s)
    assert (other.response.lag_s, other.response.delay_s) == pytest.approx((lag, delay))
    # Of commands that are of no log they are the same again, as far as a lag is not cut.
    back = commanded_anew(other).response
    assert back.lag_s + back.delay_s == pytest.approx(0.065)


@pytest.mark.parametrize("name", ["px4", "ardupilot", "crazyflie"])
def test_the_answer_to_a_step_is_that_of_the_closed_loop(name):
    law = AUTOPILOTS[name].law()
    hover = hover_plant(law, CROSS, None, 0.03)
    answer = step_answer(law, hover.axes)
    # A square wave of 20 s as the sum of its odd parts, each through the closed loop.
    count = np.arange(1, 4000, 2)
    frequency = count / 20.0
    closed = axis_loops(law, 0, moved_by(law, hover.axes[0], frequency), frequency).angle_closed
    waves = np.exp(2j * np.pi * np.outer(answer.time[::40], count) / 20.0)
    expected = 0.5 + 2 / np.pi * (waves * closed / (1j * count)).real.sum(axis=1)
    np.testing.assert_allclose(answer.angle[::40, 0], expected, atol=0.03)


def test_what_is_unstable_has_no_margins():
    law = AUTOPILOTS["px4"].law({"MC_ROLLRATE_P": 0.5, "MC_ROLLRATE_K": 3.0})
    found = evaluate(law, hover_plant(law, CROSS, None, 0.05))
    assert not found.roll.command.stable
    assert np.isnan(found.roll.command.gain_db)
    assert found.roll.command.disk_deg == 0.0
    assert found.yaw.command.stable
    assert frequencies(law)[-1] < 200.0


def test_no_gain_holds_nothing():
    found = margins(FREQUENCY, 0.0 * S)
    assert (found.stable, found.disk_deg) == (False, 0.0)
