"""The vehicle, once: its accelerations from its state, its rotors and its numbers, and what adds to them.

An effect is one function, `Acting.acts`, of what it sees (`Instant`) and of its numbers by name. A body that the
vehicle carries, with a state of its own, is one too (`Carried.pull`). Both are written for any kind of numbers
(`values`), so that whatever needs the vehicle follows from them: `tracing` makes plain Python of it for simulation.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.vehicle.tracing import SYMBOLS
from cpfls_cli.vehicle.values import (
    ZERO,
    Functions,
    Value,
    Vector,
    add,
    apply,
    cross,
    dot,
    plus,
    scaled,
    subtract,
    times,
    transposed,
    zero,
)

_LEVEL = ((1, 0, 0), (0, 1, 0), (0, 0, 1))
POSITION, VELOCITY, ATTITUDE, BODY_RATE = (slice(3 * n, 3 * n + 3) for n in range(4))
VEHICLE_STATES = 12
"""Places in the state: position and velocity in the world, attitude as roll, pitch and yaw, body rate; the states of
carried bodies follow."""


class Numbers(dict[str, Any]):
    """Numbers of an effect by name; those that are not there are 0."""

    def __missing__(self, name: str) -> int:
        return 0


class Wrench(NamedTuple):
    """What an effect does to the body: ``torque + sum r_i x F_i + d/dt momentum`` and ``force + sum F_i``.

    Attributes
    ----------
    torque, force : vector, N m and N, body frame
    at_hubs : vector of values by rotor, N, body frame
        F_i.
    momentum : vector, N m s, body frame
        Linear in body rate and rotor speeds.
    """

    torque: Vector = ZERO
    force: Vector = ZERO
    at_hubs: Vector = ZERO
    momentum: Vector = ZERO


_GEOMETRY = ("hubs", "spins", "radii")
"""Of an `Instant`, what its state does not change."""


@dataclass(frozen=True)
class Instant:
    """What effects see: vectors in the body frame, SI, rotors as a value by rotor.

    `air_velocity` is that of the centre of mass through the air; `rotation`: body to world; `attitude`: roll, pitch,
    yaw; `height` above the ground; `slow_square`: squared speed that slow actuation has come to; `force`: of all that
    has no lever for it; `thrust_scale`, `drag_scale`: ratios of the factors to those of `vehicle`.
    """

    vehicle: VehicleSettings
    rotor_speed: Value
    air_velocity: Vector = ZERO
    body_rate: Vector = ZERO
    rotor_acceleration: Value = 0
    rotation: Sequence[Vector] = _LEVEL
    attitude: Vector = ZERO
    height: Value = 0
    slow_square: Value = 0
    force: Vector = ZERO
    thrust_scale: Value = 1
    drag_scale: Value = 1
    functions: Functions = field(default=SYMBOLS)

    @cached_property
    def hubs(self) -> Vector:
        """Hub positions relative to the centre of mass, components of values by rotor, m, body frame."""
        return tuple(self._by_rotor(*(rotor.position_m[axis] for rotor in self.vehicle.rotors)) for axis in range(3))

    @cached_property
    def spins(self) -> Value:
        """Spin directions, +1 counter-clockwise from above."""
        return self._by_rotor(*(float(rotor.spin) for rotor in self.vehicle.rotors))

    @cached_property
    def radii(self) -> Value:
        """Radii of the propellers, m."""
        return self._by_rotor(*(rotor.radius_m for rotor in self.vehicle.rotors))

    @cached_property
    def hub_velocity(self) -> Vector:
        """Velocity of the hubs through the air, components of values by rotor, m/s, body frame."""
        return add(self.air_velocity, cross(self.body_rate, self.hubs))

    @cached_property
    def hub_height(self) -> Value:
        """Height of the hubs above the ground, m."""
        return plus(self.height, dot(self.rotation[2], self.hubs))

    @cached_property
    def thrust_factors(self) -> Value:
        """Thrust of each rotor for a unit of its squared speed, N s^2."""
        return self._by_rotor(*(rotor.thrust_factor_n_s2 for rotor in self.vehicle.rotors)) * self.thrust_scale

    @cached_property
    def drag_factors(self) -> Value:
        """Size of the reaction torque of each rotor for a unit of its squared speed, N m s^2."""
        return self._by_rotor(*(rotor.drag_factor_n_m_s2 for rotor in self.vehicle.rotors)) * self.drag_scale

    @cached_property
    def rotor_thrust(self) -> Value:
        """Thrust of each rotor by the square of its speed, N."""
        return self.thrust_factors * self.rotor_speed**2

    @cached_property
    def rotor_drag(self) -> Value:
        """Size of the reaction torque of each rotor by the square of its speed, N m."""
        return self.drag_factors * self.rotor_speed**2

    @cached_property
    def thrust(self) -> Value:
        """Thrust of all rotors by the squares of their speeds, N."""
        return self.functions.total(self.rotor_thrust)

    @cached_property
    def rotor_torque(self) -> Vector:
        """Torque of the rotors by the squares of their speeds, N m, body frame."""
        return self.torque_of(self.rotor_thrust, self.rotor_drag)

    def torque_of(self, thrust: Value, drag: Value) -> Vector:
        """Sum the torques of thrusts and reactions of the rotors, N and N m by rotor."""
        total, (x, y, _) = self.functions.total, self.hubs
        return total(y * thrust), -total(x * thrust), -total(self.spins * drag)

    def moved(self, **changes: Any) -> Instant:
        """Give the same vehicle in another state, without working out again where its rotors are."""
        other = replace(self, **changes)
        other.__dict__.update({name: self.__dict__[name] for name in _GEOMETRY if name in self.__dict__})
        return other

    def _by_rotor(self, *values: Any) -> Value:
        return self.functions.rotors(values)


Acts = Callable[[Instant, Numbers], Wrench]


@dataclass(frozen=True)
class Acting:
    """An effect with its numbers.

    Attributes
    ----------
    acts : callable
        ``acts(instant, numbers) -> Wrench``.
    of_all_forces : bool
        Whether it has a lever for the forces of all others, `Instant.force`.
    """

    name: str
    acts: Acts
    numbers: Mapping[str, Value] = field(default_factory=dict)
    of_all_forces: bool = False

    def wrench(self, instant: Instant) -> Wrench:
        """Evaluate it."""
        return self.acts(instant, Numbers(self.numbers))


@dataclass(frozen=True)
class Carrier:
    """The vehicle that carries a body, without it.

    Attributes
    ----------
    acceleration : vector, m/s^2, world frame
    turning : vector, rad/s^2, body frame
    inverse : rows of a matrix, 1/(kg m^2), body frame
        Of the inertia.
    """

    acceleration: Vector
    turning: Vector
    inverse: Sequence[Vector]


class Pull(NamedTuple):
    """Acceleration of the carrier by a carried body, and the derivative of its state.

    Attributes
    ----------
    acceleration : vector, m/s^2, world frame
    turning : vector, rad/s^2, body frame
    change : vector
        Derivative of the state of the body.
    """

    acceleration: Vector
    turning: Vector
    change: Vector


@dataclass(frozen=True)
class Carried:
    """A body with a state of its own on the vehicle.

    Attributes
    ----------
    pull : callable
        ``pull(instant, numbers, state, carrier) -> Pull``; it may depend on the acceleration that it causes.
    start : tuple of float
        Its state at the start.
    """

    pull: Callable[[Instant, Numbers, Vector, Carrier], Pull]
    start: tuple[float, ...]
    numbers: Mapping[str, Value] = field(default_factory=dict)


class Turning(NamedTuple):
    """How a vehicle turns whose inertia depends on its attitude, ``inertia omega' + direct``.

    Attributes
    ----------
    inverse : rows of a matrix, 1/(kg m^2), body frame
        Of the inertia, with what effects add to it.
    direct : vector, N m, body frame
    """

    inverse: Sequence[Vector]
    direct: Vector


@dataclass(frozen=True)
class Vehicle:
    """A vehicle in the air: ``m v' = R F + m g``, ``(I + dI) omega' = M - omega x I omega``.

    Attributes
    ----------
    acting : tuple of Acting
        The rotors among them.
    wind : vector, m/s, world frame
    inertia : array, shape (3, 3), kg m^2, or None
        None where it depends on the attitude.
    """

    settings: VehicleSettings
    acting: tuple[Acting, ...]
    carried: tuple[Carried, ...] = ()
    wind: Vector = ZERO
    inertia: Array | None = None

    @property
    def start(self) -> tuple[float, ...]:
        """States of the carried bodies at the start."""
        return tuple(value for body in self.carried for value in body.start)

    @cached_property
    def added_inertia(self) -> Array:
        """What momentum by body rate adds to the inertia, shape (3, 3), kg m^2."""
        still = SYMBOLS.rotors([0.0] * len(self.settings.rotors))
        columns = [self._momentum(Instant(self.settings, still, body_rate=tuple(axis))) for axis in np.eye(3).tolist()]
        return -np.array(columns, dtype=float).T

    def _momentum(self, instant: Instant) -> Vector:
        return add(ZERO, *(one.wrench(instant).momentum for one in self.acting if one.name in self._with_momentum))

    @cached_property
    def _with_momentum(self) -> frozenset[str]:
        # Powers of 2, whose sums with any signs are not 0.
        rotors = SYMBOLS.rotors([2.0**rotor for rotor in range(len(self.settings.rotors))])
        moving = Instant(self.settings, rotors, (1.0, 2.0, 3.0), (1.0, 2.0, 3.0), height=1.0, force=(1.0, 2.0, 3.0))
        return frozenset(one.name for one in self.acting if not all(map(zero, one.wrench(moving).momentum)))

    def instant(
        self, state: Vector, speed: Value, acceleration: Value, slow_square: Value, functions: Functions = SYMBOLS
    ) -> Instant:
        """See what effects see in a state."""
        attitude = state[ATTITUDE]
        rotation = rotation_rows(attitude, functions)
        return Instant(
            self.settings,
            speed,
            air_velocity=apply(transposed(rotation), subtract(state[VELOCITY], self.wind)),
            body_rate=state[BODY_RATE],
            rotor_acceleration=acceleration,
            rotation=rotation,
            attitude=attitude,
            height=state[POSITION][2],
            slow_square=slow_square,
            functions=functions,
        )

    def wrench(self, instant: Instant) -> tuple[Vector, Vector]:
        """Sum torque and force of all that acts, N m and N, body frame, without weight."""
        torque, force = total_wrench(self.acting, instant)
        return add(torque, self._momentum(_spun(instant))), force

    def wrench_by_part(self, instant: Instant) -> dict[str, Vector]:
        """Give torque and force of each effect alone, N m and N, body frame, by name."""
        spun = _spun(instant)
        found = {name: (*torque, *force) for name, (torque, force) in wrench_by_part(self.acting, instant).items()}
        for one in self.acting:
            if one.name in self._with_momentum:
                torque = add(found[one.name][:3], one.wrench(spun).momentum)
                found[one.name] = (*torque, *found[one.name][3:])
        return found

    def derivative(self, instant: Instant, state: Vector, push: Vector | None, turning: Turning | None) -> Vector:
        """Differentiate the state.

        Parameters
        ----------
        push : vector of 6, N m and N, body frame, or None
            Of gusts.
        turning : Turning or None
            Where the inertia depends on the attitude.
        """
        torque, force = self.wrench(instant)
        if push is not None:
            torque, force = add(torque, push[:3]), add(force, push[3:])
        rate, settings = instant.body_rate, self.settings
        if turning is None:
            assert self.inertia is not None, "an inertia that depends on the attitude comes with each step"
            rows = _rows(self.inertia)
            inverse = np.asarray(np.linalg.inv(self.inertia + self.added_inertia), dtype=float)
            turning = Turning(_rows(inverse), cross(rate, apply(rows, rate)))
        lifted = scaled(1 / settings.mass_kg, apply(instant.rotation, force))
        acceleration = add(lifted, (0, 0, -settings.gravity_m_s2))
        turned = apply(turning.inverse, subtract(torque, turning.direct))
        changes: list[Value] = []
        first = VEHICLE_STATES
        for body in self.carried:
            own = state[first : first + len(body.start)]
            pull = body.pull(instant, Numbers(body.numbers), own, Carrier(acceleration, turned, turning.inverse))
            acceleration, turned = add(acceleration, pull.acceleration), add(turned, pull.turning)
            changes.extend(pull.change)
            first += len(own)
        turn = attitude_rate(instant.attitude, rate, instant.functions)
        return (*state[VELOCITY], *acceleration, *turn, *turned, *changes)


def _spun(instant: Instant) -> Instant:
    """Turn rotors by their accelerations, with which their momentum changes; that of the body is inertia."""
    return instant.moved(rotor_speed=instant.rotor_acceleration, air_velocity=ZERO, body_rate=ZERO)


def total_wrench(acting: Iterable[Acting], instant: Instant) -> tuple[Vector, Vector]:
    """Sum torque and force of effects, N m and N, body frame, but for what momentum adds."""
    acting = tuple(acting)
    parts = [one.wrench(instant) for one in acting if not one.of_all_forces]
    torque, force = about_centre(instant, Wrench(*(add(ZERO, *(part[place] for part in parts)) for place in range(3))))
    # What has a lever for all forces comes last.
    felt = replace(instant, force=force)
    levers = [one.wrench(felt).torque for one in acting if one.of_all_forces]
    return add(torque, *levers), force


def about_centre(instant: Instant, wrench: Wrench) -> tuple[Vector, Vector]:
    """Sum a wrench with its forces at the hubs to torque and force, but for what momentum adds."""
    total = instant.functions.total
    torque = add(wrench.torque, map(total, cross(instant.hubs, wrench.at_hubs)))
    return torque, add(wrench.force, map(total, wrench.at_hubs))


def wrench_by_part(acting: Iterable[Acting], instant: Instant) -> dict[str, tuple[Vector, Vector]]:
    """Give torque and force of each effect alone, by name."""
    acting = tuple(acting)
    felt = replace(instant, force=total_wrench(acting, instant)[1])
    levers = {one.name: (one.wrench(felt).torque, ZERO) for one in acting if one.of_all_forces}
    return {one.name: levers.get(one.name) or total_wrench([one], instant) for one in acting}


def rotor_wrench(instant: Instant, numbers: Numbers) -> Wrench:
    """Compute what the rotors give: thrust and reaction by squared speeds, and what comes slowly behind a change.

    Parameters
    ----------
    numbers : Numbers
        ``slow_roll_pitch`` and ``slow_yaw``, shares of the torque of the slow squared speed less that of the present
        one.
    """
    square = instant.rotor_speed**2
    torque: Vector = (0, 0, -instant.functions.total(instant.spins * instant.drag_factors * square))
    level, turn = numbers["slow_roll_pitch"], numbers["slow_yaw"]
    if not (zero(level) and zero(turn)):
        late = instant.slow_square - square
        x, y, z = instant.torque_of(instant.thrust_factors * late, instant.drag_factors * late)
        torque = add(torque, (times(level, x), times(level, y), times(turn, z)))
    return Wrench(torque, at_hubs=(0, 0, instant.thrust_factors * square))


def rotation_rows(attitude: Vector, functions: Functions) -> tuple[Vector, ...]:
    """Build the rotation from body to world, ``Rz(yaw) Ry(pitch) Rx(roll)``, by rows."""
    (sr, sp, sy), (cr, cp, cy) = map(functions.sin, attitude), map(functions.cos, attitude)
    return (
        (cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
        (sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr),
        (-sp, cp * sr, cp * cr),
    )


def attitude_rate(attitude: Vector, body_rate: Vector, functions: Functions) -> Vector:
    """Convert body rates to Euler rates, rad/s."""
    (sr, sp), (cr, cp) = map(functions.sin, attitude[:2]), map(functions.cos, attitude[:2])
    p, q, r = body_rate
    yaw_rate = (sr * q + cr * r) / cp
    return p + sp * yaw_rate, cr * q - sr * r, yaw_rate


def _rows(matrix: Array) -> tuple[Vector, ...]:
    return tuple(map(tuple, matrix.tolist()))
