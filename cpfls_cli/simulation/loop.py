"""Autopilot, actuators and vehicle, closed to a loop that steps through time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array
from cpfls_cli.dynamics.equations_of_motion import identified_turning, rigid_turning
from cpfls_cli.dynamics.rigid_body import inertia_tensor
from cpfls_cli.effects.scales import hover_speed
from cpfls_cli.simulation.actuators import Actuators, Rotors
from cpfls_cli.simulation.autopilot import Autopilot
from cpfls_cli.simulation.battery import Battery
from cpfls_cli.simulation.flown_model import FlownModel
from cpfls_cli.simulation.missing_wrench import missing_wrench
from cpfls_cli.simulation.mixer import Mixer, mixer
from cpfls_cli.simulation.payload import payload
from cpfls_cli.simulation.plant import ATTITUDE, BODY_RATE, POSITION, VELOCITY, Plant, instant
from cpfls_cli.simulation.settings import ClosedLoopSettings
from cpfls_cli.vehicle.settings import VehicleSettings


@dataclass(frozen=True)
class Step:
    """What one step passes through.

    Attributes
    ----------
    change : array, shape (18,)
        Derivative of the state, in the middle of the step.
    rotors : Rotors
        In the middle of the step.
    demand : array, shape (rotor,), rad^2/s^2
        Squared speeds that the autopilot asked for, not clipped.
    """

    change: Array
    rotors: Rotors
    demand: Array


@dataclass
class Loop:
    """The midpoint rule with one evaluation a step.

    The middle of a step is reached with the derivative of the step before, so that the rule is of second order.

    Attributes
    ----------
    autopilot : Autopilot
    mixer : Mixer
    actuators : Actuators
    plant : Plant
    state : array, shape (18,)
    change : array, shape (18,)
        Derivative of the state in the step before.
    """

    autopilot: Autopilot
    mixer: Mixer
    actuators: Actuators
    plant: Plant
    state: Array
    change: Array

    def advance(self, number: int) -> Step:
        """Take one step.

        Parameters
        ----------
        number : int
            Steps done so far.
        """
        middle = self.state + 0.5 * self.actuators.step * self.change
        # The plan has the start before the middle of each step.
        wrench = _wrench(self.autopilot, number + 1, middle)
        rotors = self.actuators.advance(self.mixer.command(wrench))
        self.change = self.plant.derivative(middle, rotors)
        self.state = self.state + self.actuators.step * self.change
        return Step(self.change, rotors, self.mixer.demand(wrench))


def loop(
    vehicle: VehicleSettings,
    settings: ClosedLoopSettings,
    model: FlownModel,
    autopilot: Autopilot,
    state: Array,
    step: float,
    duration: float,
) -> Loop:
    """Put a vehicle at the start, its rotors as the autopilot wants them there.

    Parameters
    ----------
    vehicle : VehicleSettings
    settings : ClosedLoopSettings
    model : FlownModel
        What is flown.
    autopilot : Autopilot
    state : array, shape (18,)
    step, duration : float, s
    """
    mix = mixer(vehicle)
    speed = mix.command(_wrench(autopilot, 0, state))
    effects = model.effects
    missing = missing_wrench(effects, instant(vehicle, state, speed))
    load = effects.values("payload")
    hung = None if load is None else payload(load, vehicle.gravity_m_s2)
    turning = rigid_turning(inertia_tensor(vehicle)) if model.base is None else identified_turning(model.base)
    plant = Plant(vehicle, turning, missing, hung)
    change = plant.derivative(state, Rotors(speed, speed, speed, np.zeros_like(speed), 1.0))
    lag, delay, sag = (effects.values(name) or {} for name in ("motor_lag", "command_delay", "battery_sag"))
    actuators = Actuators(
        time_constant=lag.get("time_constant_s", settings.rotor_time_constant_s),
        delay=delay.get("delay_s", 0.0),
        exponent=sag.get("exponent", 0.0),
        battery=_battery(vehicle, settings, duration),
        step=step,
        speed=speed,
    )
    return Loop(autopilot, mix, actuators, plant, state, change)


def _wrench(autopilot: Autopilot, number: int, state: Array) -> Array:
    rotation = rotations.rotation_matrix(state[None, ATTITUDE])[0]
    return autopilot.wrench(number, state[POSITION], state[VELOCITY], rotation, state[BODY_RATE])


def _battery(vehicle: VehicleSettings, settings: ClosedLoopSettings, duration: float) -> Battery:
    hover = len(vehicle.rotors) * hover_speed(vehicle) ** 3
    return Battery(settings.battery_use, settings.battery_load, duration, hover)
