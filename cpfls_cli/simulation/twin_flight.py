"""A flight's own setpoints flown again: by the law of its autopilot and a simulated vehicle."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array
from cpfls_cli.autopilots.motors import Motors
from cpfls_cli.effects.signals import Signals
from cpfls_cli.errors import InputError
from cpfls_cli.playback.flight import LoggedFlight
from cpfls_cli.playback.lack import DrawnLack, Lack
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.simulation.closed_loop import Clock, ClosedLoop, LostVehicleError, Setpoints, clock_of, fly_setpoints
from cpfls_cli.simulation.model import with_effects
from cpfls_cli.simulation.settings import ClosedLoopSettings
from cpfls_cli.vehicle.motion import ATTITUDE, BODY_RATE, POSITION, VELOCITY
from cpfls_cli.vehicle.settings import VehicleSettings

RATES, ANGLES = ("roll rate", "pitch rate", "yaw rate"), ("roll", "pitch", "yaw")
VELOCITIES, LIFT = ("velocity x", "velocity y", "velocity z"), "thrust"
CHANNELS = (*RATES, *ANGLES, *VELOCITIES, LIFT)
UNITS = {**dict.fromkeys(RATES, "rad/s"), **dict.fromkeys(ANGLES, "rad"), **dict.fromkeys(VELOCITIES, "m/s")} | {
    LIFT: "m/s^2"
}
FRAMES = {**dict.fromkeys(RATES, "body"), **dict.fromkeys(ANGLES, "angles"), **dict.fromkeys(VELOCITIES, "world")} | {
    LIFT: "body"
}
ANGLE_LAW, RATE_LAW = "attitude", "body_rate"
"""Setpoints that a law may be given."""


class Asked(NamedTuple):
    """What a law is asked for along a flight, one entry for each stretch.

    Attributes
    ----------
    kind : str
        `ANGLE_LAW` or `RATE_LAW`.
    thrust_from : str
        ``setpoint``, or ``rotors`` where that of the flight's own rotors takes its place.
    """

    setpoints: tuple[Setpoints, ...]
    kind: str
    thrust_from: str


@dataclass(frozen=True)
class Air:
    """What pushes a vehicle apart from its model: gusts, and what the model lacks, drawn for each stretch."""

    model: VehicleModel
    lack: Lack | None
    rng: np.random.Generator

    def drawn(self, clock: Clock) -> tuple[Array | None, DrawnLack | None]:
        """Draw both for the steps of an integration."""
        gusts, lack = self.model.gusts, self.lack
        push = None if gusts is None else gusts.drawn(self.rng, clock.step, clock.steps)
        return push, None if lack is None else lack.drawn(self.model, self.rng, clock.step, clock.steps)


@dataclass(frozen=True)
class TwinFlight:
    """A simulated vehicle along the setpoints of a flight.

    Attributes
    ----------
    values : array, shape (time, channel)
        Of `CHANNELS`, NaN behind a loss of the vehicle.
    position : array, shape (time, 3), m, world frame
        The same.
    lost_s : float
        When it was lost, on the clock of the flight; NaN where it was not.
    """

    values: Array
    position: Array
    lost_s: float


def asked_of(flight: LoggedFlight, settings: ClosedLoopSettings, vehicle: VehicleSettings, *, share: bool) -> Asked:
    """Give the setpoints of a flight to the law of `settings.autopilot`.

    Parameters
    ----------
    share : bool
        Whether a logged thrust setpoint is a share of the full thrust, in the units of the autopilot; else it is in N.

    Raises
    ------
    InputError
        If neither the attitude nor the body rate that was asked for is known, or nothing gives the thrust.
    """
    law = settings.law
    assert law is not None, "an autopilot is named"
    motors, parts = Motors.of(law.mixer, law.curve, vehicle), flight.parts
    lift = sum(rotor.thrust_factor_n_s2 for rotor in vehicle.rotors)

    def known(name: str) -> bool:
        return all(name in part.setpoints for part in parts)

    kind = ANGLE_LAW if known("attitude") and all(part.attitude is not None for part in parts) else RATE_LAW
    if not known(kind):
        raise InputError(
            f"{flight.name}: the config maps no setpoints that this log holds throughout, so no autopilot can be flown "
            "along it: log setpoints of attitude or body rates, and map them as setpoint_attitude (with attitude) or "
            "setpoint_body_rate in import.signals"
        )
    thrust_known = known("thrust")
    if not thrust_known and any(part.rotor_speed is None for part in parts):
        raise InputError(
            f"{flight.name}: neither a thrust setpoint nor rotor speeds give the thrust: map setpoint_thrust or "
            "rotor_speed in import.signals"
        )

    def thrust(part: Signals) -> Array:
        if thrust_known and share:
            return part.setpoints["thrust"][:, 0]
        newton = part.setpoints["thrust"][:, 0] if thrust_known else lift_of(part)
        speeds = np.sqrt(np.maximum(newton, 0.0) / lift)
        return np.array([motors.share_of(float(speed)) for speed in speeds])

    def lift_of(part: Signals) -> Array:
        assert part.rotor_speed is not None, "checked above"
        factors = np.array([rotor.thrust_factor_n_s2 for rotor in vehicle.rotors])
        return np.asarray(part.rotor_speed**2 @ factors)

    made = [
        Setpoints(
            part.setpoints["attitude"] if kind == ANGLE_LAW else None,
            part.setpoints["body_rate"] if kind == RATE_LAW else None,
            thrust(part),
        )
        for part in parts
    ]
    return Asked(tuple(made), kind, "setpoint" if thrust_known else "rotors")


def measured_channels(flight: LoggedFlight) -> Array:
    """Give the `CHANNELS` of a flight, shape (time, channel), NaN where it does not know one."""
    return np.concatenate([_measured(part) for part in flight.parts])


def _measured(part: Signals) -> Array:
    values = np.full((len(part), len(CHANNELS)), np.nan)
    values[:, 0:3] = part.body_rate
    if part.attitude is not None:
        values[:, 3:6] = part.attitude
    if part.velocity is not None:
        values[:, 6:9] = part.velocity
    if part.specific_force is not None:
        values[:, 9] = part.specific_force[:, 2]
    elif part.acceleration is not None and part.attitude is not None:
        values[:, 9] = _lift(part.acceleration, part.attitude, part.vehicle.gravity_m_s2)
    return values


def _lift(acceleration: Array, attitude: Array, gravity: float) -> Array:
    """Give the specific force along body z, shape (time,), m/s^2."""
    up = rotations.rotation_matrix(attitude)[:, :, 2]
    return np.asarray(np.einsum("ti,ti->t", acceleration + np.array([0.0, 0.0, gravity]), up))


def baselines(flight: LoggedFlight, measured: Array) -> tuple[Array, Array]:
    """Give what knows no vehicle: the setpoints themselves, and a vehicle that stays as it begins; as `CHANNELS`."""
    asked, ends = np.full_like(measured, np.nan), np.cumsum([0, *(len(part) for part in flight.parts)])
    still = np.empty_like(measured)
    for part, (first, end) in zip(flight.parts, pairwise(ends.tolist()), strict=True):
        for name, place in (("body_rate", slice(0, 3)), ("attitude", slice(3, 6)), ("velocity", slice(6, 9))):
            if name in part.setpoints:
                asked[first:end, place] = part.setpoints[name]
        still[first:end] = measured[first]
    return asked, still


def fly_twin(
    loop: ClosedLoop,
    flight: LoggedFlight,
    asked: Asked,
    progress: Callable[[int], None] = lambda _done: None,
    air: Air | None = None,
) -> TwinFlight:
    """Fly the setpoints of a flight, each stretch from the flight's own state on, without looking at the flight again.

    Parameters
    ----------
    progress : callable
        Takes samples done.
    air : Air or None
        None for still air.
    """
    parts, positions, lost = [], [], np.nan
    for part, setpoints in zip(flight.parts, asked.setpoints, strict=True):
        values, places, where = _flown(loop, part, setpoints, air)
        parts.append(values)
        positions.append(places)
        lost = where if np.isnan(lost) else lost
        progress(sum(map(len, parts)))
    return TwinFlight(np.concatenate(parts), np.concatenate(positions), lost)


def _flown(loop: ClosedLoop, part: Signals, setpoints: Setpoints, air: Air | None) -> tuple[Array, Array, float]:
    start = np.zeros(12)
    for place, values in (
        (POSITION, part.position),
        (VELOCITY, part.velocity),
        (ATTITUDE, part.attitude),
        (BODY_RATE, part.body_rate),
    ):
        start[place] = 0.0 if values is None else values[0]
    speed = None if part.rotor_speed is None else part.rotor_speed[0]
    values, places = np.full((len(part), len(CHANNELS)), np.nan), np.full((len(part), 3), np.nan)
    push, lacking = (None, None) if air is None else air.drawn(clock_of(part.time, loop.settings))
    count, lost = len(part), np.nan
    while count > 1:
        time = part.time[:count]
        try:
            motion = fly_setpoints(loop, time, setpoints, start, push, speed=speed, lacking=lacking)
        except LostVehicleError as error:
            lost, count = float(part.time[error.sample]), error.sample
            continue
        state = motion.state
        angles, gravity = state[:, ATTITUDE], loop.vehicle.gravity_m_s2
        lift = _lift(motion.change[:, VELOCITY], angles, gravity)
        if part.attitude is not None:
            # A full turn from the flight's own is the same.
            angles = part.attitude[:count] + rotations.wrapped(angles - part.attitude[:count])
        values[:count] = np.column_stack([state[:, BODY_RATE], angles, state[:, VELOCITY], lift])
        places[:count] = state[:, POSITION]
        break
    return values, places, lost


def fly_in_gusts(
    loop: ClosedLoop,
    flight: LoggedFlight,
    asked: Asked,
    models: Sequence[VehicleModel],
    lack: Lack | None,
    rng: np.random.Generator,
    progress: Callable[[int], None] = lambda _done: None,
) -> list[TwinFlight]:
    """Fly the setpoints of a flight by vehicles that may differ, each in gusts of its own and with what is lacking."""
    found = []
    for number, (model, own) in enumerate(zip(models, rng.spawn(len(models)), strict=True)):
        held, effects = with_effects(model, loop.effects)
        flown = replace(loop, model=held, effects=effects)
        found.append(fly_twin(flown, flight, asked, air=Air(model, lack, own)))
        progress((number + 1) * len(flight.time))
    return found
