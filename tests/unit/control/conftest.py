"""A plan with all its derivatives, and a loop around a rigid body."""

import numpy as np
import pytest

from cpfls_cli.control.controllers import TorqueActuators, gains, plan_of
from cpfls_cli.control.track import AttitudeLoop
from cpfls_cli.dynamics.equations_of_motion import turning_law
from cpfls_cli.inertia import symmetric

PARAMETERS = np.array([0.6, 0.7, 1.2, 0.02, -0.03, 0.01])
INERTIA = symmetric(PARAMETERS)
FREQUENCY, DAMPING = (1.2, 1.0, 0.6), 0.7
AMPLITUDE, SWING = np.array([0.4, -0.3, 0.9]), np.array([2.0, 1.5, 1.1])


@pytest.fixture
def inertia():
    return INERTIA


@pytest.fixture
def make_plan():
    """Swing about all axes, told at so many samples in a second, controlled as often as asked."""

    def make(duration=3.0, rate=50.0, control_rate=None, yaw=0.0):
        time = np.arange(round(duration * rate) + 1) / rate
        phase = time[:, None] * SWING
        planned = {
            "attitude": AMPLITUDE * np.sin(phase) + np.array([0.0, 0.0, yaw]),
            "attitude_rate": AMPLITUDE * SWING * np.cos(phase),
            "attitude_acceleration": -AMPLITUDE * SWING**2 * np.sin(phase),
        }
        return plan_of(time, planned, control_rate or rate)

    return make


@pytest.fixture
def make_loop():
    def make(plant=None, actuators=None, sensing=None, integration_rate=400.0):
        plant = turning_law(PARAMETERS) if plant is None else plant
        return AttitudeLoop(plant, gains(FREQUENCY, DAMPING), actuators or TorqueActuators(), sensing, integration_rate)

    return make
