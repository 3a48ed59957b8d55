"""Several controllers that follow one plan, each with its own vehicle: their motion, its signals and its scores."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from math import ceil

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.control.controllers import Controller, Gains, Plan, TorqueActuators
from cpfls_cli.dynamics.equations_of_motion import TurningLaw
from cpfls_cli.dynamics.integration import advance
from cpfls_cli.errors import SettingError

_STEPS_BETWEEN_REPORTS = 100
_ROUNDING = 1e-6
# Seen from the side of the plan: a vehicle that leapt over the vertical has a cosine below zero.
_VERTICAL = 0.02


@dataclass(frozen=True)
class Sensing:
    """Noise of what the controllers measure, the same for all of them.

    Attributes
    ----------
    attitude, body_rate : array, shape (control, 3), rad and rad/s
    """

    attitude: Array
    body_rate: Array


@dataclass(frozen=True)
class Tracked:
    """Motion and torques of the vehicles at the instants of control; NaN where one was lost.

    Attributes
    ----------
    attitude, body_rate : array, shape (controller, control, 3), rad and rad/s
    body_torque, torque_before : array, shape (controller, control, 3), N m, body frame
        That acts from the instant on, and that acted up to it.
    clipped : array of bool, shape (controller, control)
        Where a command was larger than the actuators can do.
    """

    attitude: Array
    body_rate: Array
    body_torque: Array
    torque_before: Array
    clipped: BoolArray


@dataclass(frozen=True)
class AttitudeLoop:
    """Plant, gains, actuators and sensors of the control loop.

    Attributes
    ----------
    sensing : Sensing or None
        None for exact measurements.
    integration_rate : float, Hz
    """

    plant: TurningLaw
    gains: Gains
    actuators: TorqueActuators
    sensing: Sensing | None
    integration_rate: float


def track(
    plan: Plan,
    controllers: Sequence[Controller],
    loop: AttitudeLoop,
    initial_error: Array,
    initial_torque: Array,
    progress: Callable[[float, int], None] = lambda _done, _total: None,
) -> Tracked:
    """Simulate all controllers along a plan.

    A vehicle is lost where an angle is off by more than 90 degrees, its pitch reaches the vertical, or its state is not
    finite; the others go on.

    Parameters
    ----------
    initial_error : array, shape (3,), rad
        Planned less flown angles at the start; the Euler rates are those of the plan.
    initial_torque : array, shape (3,), N m, body frame
        That acts before the first command.
    progress : callable
        Takes steps done and steps in all.

    Raises
    ------
    SettingError
        If the vehicle is lost before it starts.
    """
    vehicles, instants = len(controllers), len(plan)
    state = np.tile(start_of(plan, initial_error), (vehicles, 1))
    torque = np.tile(initial_torque, (vehicles, 1))
    lag = loop.actuators.time_constant
    # A lag is followed in two or more steps of its time constant.
    fastest = max(loop.integration_rate, 2 / lag if lag > 0 else 0.0)
    steps = max(ceil(plan.period * fastest - _ROUNDING), 1)
    record = np.full((instants, vehicles, 12), np.nan)
    clipped = np.zeros((instants, vehicles), dtype=bool)
    # A vehicle that is lost may reach infinity before the next instant, where it is noticed.
    with np.errstate(all="ignore"):
        for instant in range(instants):
            state[_lost(state, plan.attitude[instant])] = np.nan
            flown = np.flatnonzero(~np.isnan(state[:, 0]))
            if not flown.size:
                break
            alive, before = state[flown], torque[flown]
            asked = _commands(plan, instant, [controllers[index].law for index in flown.tolist()], loop, alive)
            command = loop.actuators.clipped(asked)
            clipped[instant, flown] = (command != asked).any(axis=1)
            acting = partial(loop.actuators.torque, before, command)
            record[instant, flown] = np.concatenate([alive, acting(0.0), before], axis=1)
            state[flown] = advance(loop.plant, alive, acting, plan.period, steps)
            torque[flown] = acting(plan.period)
            if instant % _STEPS_BETWEEN_REPORTS == 0:
                progress(instant, instants)
    attitude, body_rate, body_torque, torque_before = np.split(record.swapaxes(0, 1), 4, axis=2)
    return Tracked(attitude, body_rate, body_torque, torque_before, clipped.T)


def start_of(plan: Plan, initial_error: Array) -> Array:
    """Compute the state in which a flight begins, with the Euler rates of the plan.

    Parameters
    ----------
    initial_error : array, shape (3,), rad
        Planned less flown angles.

    Returns
    -------
    array, shape (1, 6)
        Attitude in rad, body rate in rad/s.

    Raises
    ------
    SettingError
        If a vehicle would count as lost there.
    """
    attitude = plan.attitude[:1] - initial_error
    state = np.concatenate([attitude, rotations.body_rate(attitude, plan.rate[:1])], axis=1)
    if _lost(state, plan.attitude[0]).any():
        raise SettingError(
            "computed_torque.initial_error_rad",
            "a vehicle that is off by 90 degrees, or has a vertical pitch, is lost before it starts; make it smaller",
        )
    return np.asarray(state)


def _lost(state: Array, planned: Array) -> BoolArray:
    attitude = state[:, :3]
    off = ~(np.abs(rotations.wrapped(planned - attitude)) < 0.5 * np.pi).all(axis=1)
    upright = np.cos(attitude[:, 1]) * np.sign(np.cos(planned[1]))
    return np.asarray(off | ~(upright > _VERTICAL) | ~np.isfinite(state).all(axis=1))


def _commands(
    plan: Plan, instant: int, laws: Sequence[Callable[..., Array]], loop: AttitudeLoop, state: Array
) -> Array:
    """Compute the body torques that the controllers command for what they measure, shape (vehicle, 3)."""
    attitude, body_rate = state[:, :3], state[:, 3:]
    if loop.sensing is not None:
        attitude = attitude + loop.sensing.attitude[instant]
        body_rate = body_rate + loop.sensing.body_rate[instant]
    rate = rotations.attitude_rate(attitude, body_rate)
    feedback = loop.gains.feedback(rotations.wrapped(plan.attitude[instant] - attitude), plan.rate[instant] - rate)
    wanted = plan.acceleration[instant]
    torque = [law(*measured, wanted) for law, *measured in zip(laws, attitude, rate, feedback, strict=True)]
    return rotations.body_torque(attitude, np.array(torque).reshape(-1, 3))


def flown_signals(plan: Plan, tracked: Tracked, controller: int, plant: TurningLaw) -> dict[str, Array]:
    """Extract the signals of one vehicle at the samples of the plan, up to where it was lost.

    Torques are the mean of what acts before and after each command, and accelerations what they do to the vehicle: on
    straight lines between samples they push as the torques do that are held from command to command.

    Parameters
    ----------
    controller : int
        Index.

    Returns
    -------
    dict of str to array
        `time`, `attitude`, `attitude_rate`, `attitude_acceleration`, `body_rate`, `torque`, `body_torque`.
    """
    known = np.isfinite(tracked.attitude[controller, :: plan.parts]).all(axis=1)
    kept = slice(0, int(np.sum(known)) * plan.parts, plan.parts)
    attitude, body_rate = tracked.attitude[controller, kept], tracked.body_rate[controller, kept]
    body_torque = 0.5 * (tracked.body_torque + tracked.torque_before)[controller, kept]
    # Nothing is known of what acted before the flight.
    body_torque[0] = tracked.body_torque[controller, 0]
    acceleration = plant(attitude, body_rate).acceleration(body_torque)
    return {
        "time": plan.time[kept],
        "attitude": attitude,
        "attitude_rate": rotations.attitude_rate(attitude, body_rate),
        "attitude_acceleration": rotations.attitude_acceleration(attitude, body_rate, acceleration),
        "body_rate": body_rate,
        "torque": rotations.generalised_torque(attitude, body_torque),
        "body_torque": body_torque,
    }


@dataclass(frozen=True)
class Scores:
    """Tracking errors at the samples of the plan, described at `TrackingGroup`; NaN where a vehicle was lost."""

    error: Array
    settled_from: float
    rms: Array
    settled_rms: Array
    max_error: Array
    settled_max: Array
    torque_rms: Array
    clipped: Array
    lost_at: Array


def scores(plan: Plan, tracked: Tracked, settling_time: float) -> Scores:
    """Compute the tracking errors and the effort of controllers.

    Parameters
    ----------
    settling_time : float, s
        In which a perfect controller forgets an initial error.
    """
    error = rotations.wrapped(plan.attitude - tracked.attitude)
    alive = np.all(np.isfinite(error), axis=2)
    lost_at = np.where(alive.all(axis=1), np.nan, plan.time[np.argmin(alive, axis=1)])
    sampled = error[:, :: plan.parts]
    since = plan.time[:: plan.parts] - plan.time[0]
    settled_from = min(settling_time, 0.5 * float(since[-1]))
    settled = sampled[:, since >= settled_from]
    return Scores(
        error=sampled,
        settled_from=settled_from,
        rms=_rms(sampled),
        settled_rms=_rms(settled),
        max_error=np.max(np.abs(sampled), axis=1),
        settled_max=np.max(np.abs(settled), axis=1),
        torque_rms=_rms(tracked.body_torque),
        clipped=np.sum(tracked.clipped, axis=1) / np.maximum(np.sum(alive, axis=1), 1),
        lost_at=lost_at,
    )


def _rms(values: Array) -> Array:
    return np.asarray(np.sqrt(np.mean(values**2, axis=1)))
