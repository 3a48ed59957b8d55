"""The simulated vehicle: rigid body, rotors, the wrench of its effects, and bodies that it carries."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array
from cpfls_cli.dynamics.equations_of_motion import TurningLaw, turning_law
from cpfls_cli.effects.effect import Columns
from cpfls_cli.effects.hooks import CarriedBody, Carrier
from cpfls_cli.effects.signals import Signals, at_another_instant, feeling
from cpfls_cli.inertia import six_parameters
from cpfls_cli.simulation.actuators import Rotors
from cpfls_cli.simulation.model import SimulatedEffect, SimulatedEffects
from cpfls_cli.vehicle.settings import VehicleSettings

if TYPE_CHECKING:
    from cpfls_cli.playback.model import VehicleModel

POSITION, VELOCITY, ATTITUDE, BODY_RATE = (slice(3 * n, 3 * n + 3) for n in range(4))
VEHICLE_STATES = 12
"""Places in the state: position and velocity in the world, attitude as roll, pitch and yaw, body rate; the states of
carried bodies follow."""


@dataclass(frozen=True)
class EffectWrench:
    """Columns of effects times their coefficients, ``direct + d/dt momentum``.

    The momentum of the catalogue's effects is linear in body rates and rotor speeds, so that its derivative adds to
    the inertia and couples the body to the acceleration of the rotors.

    Attributes
    ----------
    added_inertia : array, shape (3, 3), kg m^2
        Minus the momentum by body rate.
    rotor_coupling : array, shape (3, rotor), kg m^2
        Momentum by rotor speed.
    """

    effects: tuple[SimulatedEffect, ...]
    added_inertia: Array
    rotor_coupling: Array

    def direct(self, signals: Signals) -> Array:
        """Evaluate the direct part of the wrench at one instant, shape (6,), N m and N, body frame."""
        total = np.zeros(6)
        for one in self.effects:
            if one.effect.kind == "wrench" and one.effect.apply is not None:
                signals = one.effect.apply(signals, one.shape)
        for one, acting in self._in_turn:
            felt = signals
            if one.effect.of_all_forces:
                felt = feeling(signals, (signals.wrench[:, 3:] + total[3:]) / signals.vehicle.mass_kg)
            total += _columns(one, felt).direct[0] @ acting
        return total

    @cached_property
    def _in_turn(self) -> list[tuple[SimulatedEffect, Array]]:
        """Effects with their coefficients; what has a lever for all forces comes last."""
        return [(one, one.acting) for one in sorted(self.effects, key=lambda each: each.effect.of_all_forces)]


def effect_wrench(chosen: SimulatedEffects, hover: Signals) -> EffectWrench:
    """Prepare the effects that are simulated by their columns; actuators and carried bodies have a state of their own.

    Parameters
    ----------
    hover : Signals
        One instant, of any motion.
    """
    effects = tuple(
        one
        for one in chosen.listed
        if one.effect.columns is not None
        and one.effect.carried is None
        and (one.effect.kind != "actuator" or one.effect.in_vehicle is not None)
    )
    rates = [replace(hover, body_rate=rate[None]) for rate in np.eye(3)]
    by_rate = _slopes(effects, rates, replace(hover, body_rate=np.zeros((1, 3))))
    speeds = np.eye(len(hover.vehicle.rotors))
    by_speed = _slopes(
        effects, [hover.with_rotor_speed(speed[None]) for speed in speeds], hover.with_rotor_speed(0 * speeds[:1])
    )
    return EffectWrench(effects, -by_rate, by_speed)


def _slopes(effects: tuple[SimulatedEffect, ...], moved: list[Signals], still: Signals) -> Array:
    """Change of the angular momentum with each unit step, shape (3, step)."""
    return np.stack([_momentum(effects, signals) - _momentum(effects, still) for signals in moved], axis=1)


def _momentum(effects: tuple[SimulatedEffect, ...], signals: Signals) -> Array:
    total = np.zeros(3)
    for one in effects:
        momentum = _columns(one, signals).momentum
        if momentum is not None:
            total += momentum[0, :3] @ one.acting
    return total


def _columns(one: SimulatedEffect, signals: Signals) -> Columns:
    assert one.effect.columns is not None, "chosen so"
    return one.effect.columns(signals, one.shape)


@dataclass(frozen=True)
class Plant:
    """``(I + dI) omega' = M - omega x I omega``, ``m v' = R F - m g``.

    Attributes
    ----------
    turning : callable
        Of the model.
    whole : VehicleModel or None
        Gives torque and force in place of the rotors alone; then `vehicle` is its own.
    """

    vehicle: VehicleSettings
    turning: TurningLaw
    wrench: EffectWrench
    carried: tuple[CarriedBody, ...]
    whole: VehicleModel | None = None

    def derivative(self, state: Array, rotors: Rotors, push: Array) -> Array:
        """Differentiate the state, shape (state,).

        Parameters
        ----------
        push : array, shape (6,), N m and N, body frame
            Of gusts.
        """
        body_rate = state[BODY_RATE]
        signals = at_another_instant(self._any_instant, _channels(state, rotors.speed))
        by_rotors = signals.wrench[0]
        if self.whole is not None:
            squared = rotors.speed**2
            terms = np.concatenate([[1.0], rotors.speed, squared, rotors.acceleration, rotors.slow - squared])
            by_rotors = self.whole.table.wrench(signals.air_velocity, signals.body_rate, terms[None])[0]
        wrench = np.asarray(by_rotors) + self.wrench.direct(signals) + push
        inertial = self.turning(state[None, ATTITUDE], body_rate[None])
        torque = wrench[:3] - inertial.direct[0] + self.wrench.rotor_coupling @ rotors.acceleration
        acceleration = signals.rotation[0] @ wrench[3:] / self.vehicle.mass_kg
        acceleration[2] -= self.vehicle.gravity_m_s2
        inertia = inertial.inertia[0] + self.wrench.added_inertia
        turning = np.asarray(np.linalg.solve(inertia, torque), dtype=float)
        change = np.zeros(len(state))
        first = VEHICLE_STATES
        for body in self.carried:
            states = slice(first, first + len(body.start))
            carrier = Carrier(self.vehicle.mass_kg, inertia, signals.rotation[0], body_rate, acceleration, turning)
            pull = body.pull(carrier, state[states])
            acceleration, turning = acceleration + pull.acceleration, turning + pull.turning
            change[states], first = pull.change, states.stop
        change[POSITION], change[VELOCITY] = state[VELOCITY], acceleration
        change[ATTITUDE] = rotations.attitude_rate(state[None, ATTITUDE], body_rate[None])[0]
        change[BODY_RATE] = turning
        return change

    @cached_property
    def _any_instant(self) -> Signals:
        """An instant that knows what follows from the vehicle alone."""
        return instant(self.vehicle, np.zeros(VEHICLE_STATES), np.zeros(len(self.vehicle.rotors)))


def plant_of(
    vehicle: VehicleSettings, model: VehicleModel | None, effects: SimulatedEffects, state: Array, speed: Array
) -> Plant:
    """Set up a vehicle, or the model in its place, with its effects.

    Parameters
    ----------
    state : array, shape (12,)
    speed : array, shape (rotor,), rad/s
        Any at which it flies.
    """
    flown = vehicle if model is None else model.vehicle
    carried = tuple(one.effect.carried(flown, one.values) for one in effects.ordered if one.effect.carried is not None)
    turning = turning_law(six_parameters(flown.inertia_kg_m2) if model is None or model.fuzzy is None else model.fuzzy)
    wrench = effect_wrench(effects, instant(flown, state, speed))
    return Plant(flown, turning, wrench, carried, None if model is None or model.is_rigid_body else model)


def instant(vehicle: VehicleSettings, state: Array, rotor_speed: Array) -> Signals:
    """Build the signals of one instant.

    Parameters
    ----------
    state : array, shape (state,)
    rotor_speed : array, shape (rotor,), rad/s
    """
    return Signals(time=np.zeros(1), vehicle=vehicle, **_channels(state, rotor_speed))


def _channels(state: Array, rotor_speed: Array) -> dict[str, Any]:
    row = state[None]
    return {
        "position": row[:, POSITION],
        "velocity": row[:, VELOCITY],
        "attitude": row[:, ATTITUDE],
        "body_rate": row[:, BODY_RATE],
        "rotor_speed": rotor_speed[None],
    }
