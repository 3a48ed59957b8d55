"""Fly a planned motion under an autopilot, with what the model of the vehicle lacks."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import cos

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array
from cpfls_cli.errors import ComputationError
from cpfls_cli.simulation.autopilot import Autopilot
from cpfls_cli.simulation.clock import between, clock_of
from cpfls_cli.simulation.flown_model import FlownModel
from cpfls_cli.simulation.loop import Step, loop
from cpfls_cli.simulation.plant import ATTITUDE, BODY_RATE, CABLE, POSITION, STATES, VELOCITY
from cpfls_cli.simulation.reference import reference
from cpfls_cli.simulation.settings import ClosedLoopSettings
from cpfls_cli.vehicle.settings import VehicleSettings

_STEPS_BETWEEN_REPORTS = 100
_REMEDY = "fly gentler, make the effects smaller, or change the frequencies of simulation.closed_loop"


@dataclass(frozen=True)
class FlownMotion:
    """What happened, at the samples of the plan.

    Attributes
    ----------
    state, change : array, shape (time, 18)
        State of the plant and its derivative.
    told, followed, speed : array, shape (time, rotor), rad/s
        Command, command after the lag, and rotor speed.
    voltage : array, shape (time,)
        Share of the full battery.
    demand : array, shape (time, rotor), rad^2/s^2
        Squared speeds that the autopilot asked for, not clipped.
    """

    state: Array
    change: Array
    told: Array
    followed: Array
    speed: Array
    voltage: Array
    demand: Array


def fly(
    time: Array,
    planned: Mapping[str, Array],
    vehicle: VehicleSettings,
    settings: ClosedLoopSettings,
    model: FlownModel,
    progress: Callable[[float, int], None],
) -> FlownMotion:
    """Integrate a flight.

    Parameters
    ----------
    time : array, shape (time,), s
        Uniform.
    planned : mapping of str to array
        `attitude`, `attitude_rate`, `attitude_acceleration`, `position`, `velocity`, `acceleration`, shape
        (time, 3) each.
    vehicle : VehicleSettings
    settings : ClosedLoopSettings
    model : FlownModel
        What is flown.
    progress : callable
        Takes steps done and steps in all.

    Raises
    ------
    ComputationError
        If the plan is not sampled uniformly, or the vehicle leaves the path or overturns.
    """
    clock = clock_of(time, settings.integration_rate_hz)
    autopilot = Autopilot(vehicle, settings, reference(planned, time, clock.instants))
    flight = loop(vehicle, settings, model, autopilot, _start(planned), clock.step, float(time[-1] - time[0]))
    states, steps = [flight.state], []
    # A vehicle that is lost may reach infinity before the next sample, where it is told.
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        for number in range(clock.steps):
            steps.append(flight.advance(number))
            if (number + 1) % clock.parts == 0:
                sample = len(states)
                _refuse_lost(flight.state, planned["position"][sample], time[sample], settings.deviation_max_m)
                states.append(flight.state)
            if number % _STEPS_BETWEEN_REPORTS == 0:
                progress(number, clock.steps)
    progress(clock.steps, clock.steps)
    return _sampled(np.array(states), steps, clock.parts)


def _start(planned: Mapping[str, Array]) -> Array:
    state = np.zeros(STATES)
    state[POSITION], state[VELOCITY] = planned["position"][0], planned["velocity"][0]
    state[ATTITUDE] = planned["attitude"][0]
    state[CABLE] = 0.0, 0.0, -1.0
    state[BODY_RATE] = rotations.body_rate(planned["attitude"][:1], planned["attitude_rate"][:1])[0]
    return state


def _refuse_lost(state: Array, planned: Array, time: float, limit: float) -> None:
    if not np.isfinite(state).all():
        raise ComputationError(f"the flight is out of control at t = {time:g} s: {_REMEDY}")
    roll, pitch, _ = state[ATTITUDE]
    if cos(roll) * cos(pitch) <= 0:
        raise ComputationError(f"the vehicle tilts over 90 degrees at t = {time:g} s: {_REMEDY}")
    away = float(np.linalg.norm(state[POSITION] - planned))
    if away > limit:
        raise ComputationError(
            f"the vehicle is {away:.3g} m away from the path at t = {time:g} s (limit "
            f"simulation.closed_loop.deviation_max_m = {limit:g}): {_REMEDY}"
        )


def _sampled(states: Array, steps: Sequence[Step], parts: int) -> FlownMotion:
    """Bring what is known in the middle of steps to the samples."""
    change, demand = ([getattr(step, name) for step in steps] for name in ("change", "demand"))
    rotors = [step.rotors for step in steps]
    told, followed, speed, voltage = (
        between(np.array([getattr(one, name) for one in rotors]))[::parts]
        for name in ("told", "followed", "speed", "voltage")
    )
    change_, demand_ = (between(np.array(values))[::parts] for values in (change, demand))
    return FlownMotion(states, change_, told, followed, speed, voltage, demand_)
