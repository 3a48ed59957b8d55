"""Margins of loops, the vehicle in hover, and answers to steps."""

from dataclasses import replace

import control
import numpy as np
import pytest

from cpfls_cli.autopilots.motors import Motors
from cpfls_cli.autopilots.registry import AUTOPILOTS
from cpfls_cli.errors import ComputationError
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.playback.rotors import RotorResponse
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
from cpfls_cli.tuning.plant import AxisPlant, Spread, hover_plant, spread_of
from cpfls_cli.vehicle.rotors import allocation_matrix
from tests.builders.autopilots import CROSS

FREQUENCY = np.geomspace(0.002, 200.0, 2000)
S = 2j * np.pi * FREQUENCY


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


def test_lag_and_delay_of_a_model_of_commands_are_those_of_the_rotors():
    response = RotorResponse(lag_s=0.05, delay_s=0.01)
    law = AUTOPILOTS["px4"].law()
    for commanded, expected in ((True, (0.05, 0.01)), (False, (0.08, 0.01))):
        model = VehicleModel(vehicle=CROSS, response=response, commanded=commanded)
        axis = hover_plant(law, CROSS, model, 0.03).axes[0]
        assert (axis.lag, axis.delay) == pytest.approx(expected)


def test_a_vehicle_that_its_rotors_do_not_carry_is_refused():
    with pytest.raises(ComputationError, match="does not carry the weight"):
        hover_plant(AUTOPILOTS["px4"].law(), replace(CROSS, mass_kg=5.0), None, 0.03)


def test_intervals_become_the_corners_of_the_plant():
    plant = AxisPlant(100.0, 0.0, 0.0, 1.0, 0.0, 0.04, 0.0)
    intervals = {"I": (0.9, 1.2), "k": (0.95, 1.05), "lag": (0.5, 1.5)}
    spread = spread_of(intervals, "I", "k")
    corners = list(spread.corners(plant))
    assert corners[0] == plant
    assert len(corners) == 5
    assert sorted({each.gain for each in corners}) == pytest.approx([95 / 1.2, 100.0, 105 / 0.9])
    assert list(Spread().corners(plant)) == [plant]


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
