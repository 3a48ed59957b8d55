"""Flights in closed loop by the control laws of autopilots."""

import numpy as np
import pytest

from cpfls_cli.errors import SettingError
from cpfls_cli.simulation.closed_loop import Setpoints, fly_setpoints
from cpfls_cli.simulation.measured import measure
from cpfls_cli.simulation.model import SimulatedEffects
from cpfls_cli.simulation.settings import ClosedLoopSettings, SimulationSettings
from tests.builders.autopilots import CROSS
from tests.builders.closed_loop_flights import planned


def flown(autopilot, seed=1, **parameters):
    time, plan = planned(1.5)
    loop = ClosedLoopSettings(autopilot=autopilot, autopilot_parameters=parameters, integration_rate_hz=400.0)
    settings = SimulationSettings(mode="closed-loop", noise={"body_rate": 0.01}, closed_loop=loop)
    return measure(time, plan, CROSS, settings, np.random.default_rng(seed))


@pytest.mark.parametrize("autopilot", ["px4", "ardupilot", "crazyflie"])
def test_an_autopilot_flies_a_path_with_its_own_law(autopilot):
    flight = flown(autopilot)
    assert np.abs(flight.position_error).max() < 0.3
    behind = flight.signals["setpoint_attitude"] - flight.signals["attitude"]
    # It follows the attitude that it is asked for late, and follows it.
    assert 0.01 < np.sqrt(np.mean(behind[:, :2] ** 2)) < 0.12


def test_noise_of_the_gyroscope_is_in_its_loop_and_drawn_again():
    one, other, again = flown("px4"), flown("px4", seed=2), flown("px4")
    np.testing.assert_array_equal(one.signals["rotor_speed"], again.signals["rotor_speed"])
    assert np.abs(one.signals["rotor_speed"] - other.signals["rotor_speed"]).max() > 0.1


def test_along_setpoints_the_law_reaches_what_it_is_asked_for():
    time = 0.01 * np.arange(101)
    settings = ClosedLoopSettings(autopilot="px4", rotor_time_constant_s=0.02)
    thrust = np.full(len(time), 0.6)
    step = np.where(time >= 0.2, 0.2, 0.0)[:, None] * [1.0, 0.0, 0.0]
    start = np.zeros(12)
    tilted = fly_setpoints(time, Setpoints(step, None, thrust), start, CROSS, settings, None, SimulatedEffects())
    assert tilted.state[-1, 6:9] == pytest.approx([0.2, 0.0, 0.0], abs=0.02)
    assert np.abs(tilted.state[:20, 6:12]).max() < 1e-9
    turned = fly_setpoints(time, Setpoints(None, step, thrust), start, CROSS, settings, None, SimulatedEffects())
    assert turned.state[-1, 9:12] == pytest.approx([0.2, 0.0, 0.0], abs=0.03)


def test_parameters_of_no_autopilot_are_refused():
    with pytest.raises(SettingError, match="name one as"):
        ClosedLoopSettings(autopilot_parameters={"MC_ROLLRATE_P": 0.1})
    with pytest.raises(SettingError, match="did you mean MC_ROLLRATE_P"):
        ClosedLoopSettings(autopilot="px4", autopilot_parameters={"MC_ROLRATE_P": 0.1})
