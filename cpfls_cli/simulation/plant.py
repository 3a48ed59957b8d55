"""The simulated vehicle: a vehicle of the config, or a model in its place, with effects and bodies that it carries."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.dynamics import turning_law
from cpfls_cli.inertia import symmetric
from cpfls_cli.simulation.model import SimulatedEffect, SimulatedEffects
from cpfls_cli.vehicle.motion import (
    ATTITUDE,
    BODY_RATE,
    VEHICLE_STATES,
    Acting,
    Carried,
    Turning,
    Vehicle,
    rotor_wrench,
)
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.vehicle.stepping import Flat, Machine, Memory
from cpfls_cli.vehicle.tracing import Symbol
from cpfls_cli.vehicle.values import ZERO, Each, Vector, add

if TYPE_CHECKING:
    from cpfls_cli.playback.model import VehicleModel

TURNING_NUMBERS = 12
"""Of `turning_of`."""


def flown_vehicle(vehicle: VehicleSettings, model: VehicleModel | None, effects: SimulatedEffects) -> Vehicle:
    """Set up a vehicle, or the model in its place, with effects on top of those of the model."""
    flown = vehicle if model is None else model.vehicle
    own = (Acting("rotors", rotor_wrench),) if model is None else model.parts
    winds = [one.effect.air(one.values) for one in effects.listed if one.effect.air is not None]
    return Vehicle(
        flown,
        (*own, *(_acting(one) for one in effects.listed if one.effect.acts is not None and one.effect.carried is None)),
        tuple(_carried(one) for one in effects.ordered if one.effect.carried is not None),
        add(ZERO, *winds),
        symmetric(flown.inertia_kg_m2) if model is None or model.fuzzy is None else None,
    )


def _acting(one: SimulatedEffect) -> Acting:
    assert one.effect.acts is not None, "chosen so"
    return Acting(one.effect.name, one.effect.acts, one.values, one.effect.of_all_forces)


def _carried(one: SimulatedEffect) -> Carried:
    body = one.effect.carried
    assert body is not None, "chosen so"
    return Carried(body.pull, body.start, one.values)


def turning_of(vehicle: Vehicle, model: VehicleModel | None) -> Callable[[Flat], Flat] | None:
    """Give inverse inertia and direct torque in a state, where the inertia depends on the attitude; None elsewhere.

    They are evaluated apart from what is traced.
    """
    if model is None or model.fuzzy is None:
        return None
    law, added = turning_law(model.fuzzy), vehicle.added_inertia

    def numbers(state: Flat) -> Flat:
        turning = law(np.array([state[ATTITUDE]]), np.array([state[BODY_RATE]]))
        return (*np.linalg.inv(turning.inertia[0] + added).ravel().tolist(), *turning.direct[0].tolist())

    return numbers


def given_turning(numbers: Vector) -> Turning:
    """Arrange the numbers of `turning_of`."""
    return Turning((numbers[:3], numbers[3:6], numbers[6:9]), numbers[9:])


class Plant:
    """A vehicle whose derivative is evaluated state by state.

    Attributes
    ----------
    start : array, shape (state,)
        At rest at the origin, with the bodies that it carries.
    """

    def __init__(self, vehicle: Vehicle, model: VehicleModel | None) -> None:
        self._turning = turning_of(vehicle, model)
        rotors, extra = len(vehicle.settings.rotors), 0 if self._turning is None else TURNING_NUMBERS
        self.start = np.array([*[0.0] * VEHICLE_STATES, *vehicle.start])
        states = len(self.start)

        def build(_memory: Memory, given: tuple[Symbol, ...]) -> Vector:
            state, push, rest = given[:states], given[states : states + 6], given[states + 6 :]
            speed, acceleration, slow = (Each(rest[rotors * n : rotors * (n + 1)]) for n in range(3))
            instant = vehicle.instant(state, speed, acceleration, slow)
            turning = given_turning(rest[3 * rotors :]) if extra else None
            return vehicle.derivative(instant, state, push, turning)

        self._machine = Machine.of(build, states + 6 + 3 * rotors + extra)

    def derivative(
        self, state: Array, speed: Array, acceleration: Array, slow: Array, push: Array | None = None
    ) -> Array:
        """Differentiate the state, shape (state,).

        Parameters
        ----------
        speed, acceleration, slow : array, shape (rotor,), rad/s, rad/s^2 and rad^2/s^2
            Of the rotors; squared speed that slow actuation has come to.
        push : array, shape (6,), N m and N, body frame, or None
            Of gusts.
        """
        push = np.zeros(6) if push is None else push
        numbers = tuple(state.tolist())
        turning = () if self._turning is None else self._turning(numbers)
        parts = (each.tolist() for each in (push, speed, acceleration, slow))
        return np.array(self._machine.advance((*numbers, *(x for part in parts for x in part), *turning)))

    def settled(self, state: Array, speed: Array, push: Array | None = None) -> Array:
        """Differentiate the state with rotors that have long turned at a speed; parameters as of `derivative`."""
        return self.derivative(state, speed, np.zeros_like(speed), speed**2, push)
