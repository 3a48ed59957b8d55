"""A flight that effects are evaluated on, with what follows from its signals, and as results of a gap hold it."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any, Self, TypeVar, cast

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array
from cpfls_cli.result import BODY, WORLD, about, described_fields, result
from cpfls_cli.vehicle.motion import Instant
from cpfls_cli.vehicle.rotors import BodyWrench, allocation_matrix, body_wrench
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.vehicle.values import ARRAYS, Value

_T = TypeVar("_T")
_SHORTEST = 8  # Samples up to which a signal is taken as it is.
_OF_MOTION = (
    *("rotation", "ground_velocity", "air_velocity"),
    *("hubs", "spins", "radii", "allocation", "hub_velocity", "hub_height"),
)
"""Cached properties that no rotor speed changes."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Signals:
    """A flight on a uniform clock, in SI, body frame FLU, world z up."""

    time: Array  # Shape (time,), s.
    body_rate: Array  # Shape (time, 3), rad/s, body frame.
    vehicle: VehicleSettings
    name: str = ""  # Of its file, with the part of it where one flight was split.
    begins: float = np.nan  # Stamp of the log's own clock at time 0, s; NaN where there is none.
    slow_rotors: str = ""  # What cannot be found where its log holds the rotors rarely, and the remedy; else empty.
    # Spans, s, over which rows average these one after another where they are logged slower: the time between updates,
    # twice where rows lie on straight lines between them.
    attitude_spans: tuple[float, ...] = ()
    body_rate_spans: tuple[float, ...] = ()
    rotor_span_s: float = 0.0  # Between updates of rotors that are logged slower: rows lie on straight lines between.
    attitude: Array | None = None  # Shape (time, 3), rad: roll, pitch, yaw.
    velocity: Array | None = None  # Shape (time, 3), m/s, world frame: relative to the ground.
    position: Array | None = None  # Shape (time, 3), m, world frame.
    acceleration: Array | None = None  # Shape (time, 3), m/s^2, world frame.
    # Shape (time, 3), m/s^2, body frame: what an accelerometer senses; with attitude it follows from the acceleration
    # too.
    specific_force: Array | None = None
    rotor_speed: Array | None = None  # Shape (time, rotor), rad/s: measured, or commanded where `commanded`.
    commanded: bool = False  # Whether actuation is what was asked for, not what was measured.
    # Shape (time, rotor), rad/s: what was asked for, where speeds were measured too.
    rotor_command: Array | None = None
    stated_torque: Array | None = None  # Shape (time, 3), N m, body frame: torque of a log that has no rotor speeds.
    stated_thrust: Array | None = None  # Shape (time,), N: thrust of such a log.
    voltage: Array | None = None  # Shape (time,): as a fraction of the full battery.
    full_voltage: float = 1.0  # V: what it is a fraction of; 1 where the log states fractions.
    ground_height_m: float = 0.0  # Height of the ground in the world frame.
    wind: Array | None = None  # Shape (3,), m/s, world frame: None for still air.
    # Shape (time, 6), N m and N, body frame: torque and force of a known model beyond the squares of its rotor speeds.
    known_wrench: Array | None = None
    # Each shape (time, column): what was asked of the autopilot and of its loops, where it is known at all samples:
    # ``position`` and ``velocity`` in the world frame, m and m/s; ``attitude`` as roll, pitch, yaw, rad; ``body_rate``,
    # rad/s, body frame; ``thrust``, one column, in N or as a share of the largest, as logged; ``sticks`` as roll,
    # pitch, yaw, throttle, shares of full deflection as logged. Each stays until the next sample.
    setpoints: Mapping[str, Array] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.time)

    @property
    def period(self) -> float:
        """Sampling period, s."""
        return float(self.time[1] - self.time[0])

    @cached_property
    def available(self) -> frozenset[str]:
        """Names of the signals that effects can need and the flight has."""
        radius = all(rotor.radius_m is not None for rotor in self.vehicle.rotors)
        signals = {
            # A log without gyroscope and attitude is taken as at rest: it holds the balance and no motion.
            "body_rate": bool(self.body_rate.any()),
            "attitude": self.attitude is not None,
            "velocity": self.velocity is not None and self.attitude is not None,
            "height": self.position is not None and self.attitude is not None,
            "rotor_speed": self.rotor_speed is not None,
            "measured_rotor_speed": self.rotor_speed is not None and not self.commanded,
            "command": self.commanded,
            "torque": self.torque is not None,
            "thrust": self.thrust is not None,
            "voltage": self.voltage is not None,
            "rotor_radius": radius,
            "force": self.has_force,
        }
        return frozenset(name for name, known in signals.items() if known)

    def to_log(self, missing: Iterable[str]) -> tuple[str, ...]:
        """Name what a log has to hold for signals that are not available; world axes take the attitude, too.

        `missing`: names that `available` lacks.
        """
        in_world = {"velocity": self.velocity, "height": self.position}
        wanted = {name for name in missing if name not in in_world or in_world[name] is None}
        if self.attitude is None and in_world.keys() & set(missing):
            wanted.add("attitude")
        return tuple(sorted(wanted))

    @property
    def has_force(self) -> bool:
        """Whether the force balance can be written down."""
        known = self.specific_force is not None or (
            self.attitude is not None and (self.acceleration is not None or self.velocity is not None)
        )
        return known and self.thrust is not None

    @cached_property
    def torque(self) -> Array | None:
        """Body torque of the rotors, shape (time, 3), N m."""
        if self.rotor_speed is None:
            return self.stated_torque
        return self._of_rotors.body_torque

    @cached_property
    def thrust(self) -> Array | None:
        """Thrust along body z, shape (time,), N."""
        if self.rotor_speed is None:
            return self.stated_thrust
        return self._of_rotors.thrust

    @cached_property
    def _of_rotors(self) -> BodyWrench:
        return body_wrench(self.vehicle, self.speed, self.allocation)

    @cached_property
    def wrench(self) -> Array:
        """Torque and force of the rotors, and of a known model, shape (time, 6); unknown parts are 0."""
        wrench = np.zeros((len(self), 6)) if self.known_wrench is None else self.known_wrench.copy()
        if self.torque is not None:
            wrench[:, :3] += self.torque
        if self.thrust is not None:
            wrench[:, 5] += self.thrust
        return wrench

    @cached_property
    def force(self) -> Array:
        """Force on the vehicle without weight, shape (time, 3), N, body frame.

        As measured, or else the thrust of the rotors alone.
        """
        mass, gravity = self.vehicle.mass_kg, self.vehicle.gravity_m_s2
        if self.specific_force is not None:
            return np.asarray(mass * self.specific_force)
        if self.attitude is not None and self.acceleration is not None:
            felt = np.einsum("tji,tj->ti", self.rotation, self.acceleration)
            return np.asarray(mass * (felt + gravity * self.rotation[:, 2]))
        return self.wrench[:, 3:]

    @cached_property
    def speed(self) -> Array:
        """Rotor speeds, shape (time, rotor), rad/s."""
        assert self.rotor_speed is not None, "an effect that needs rotor speeds declares so"
        return self.rotor_speed

    @cached_property
    def rotation(self) -> Array:
        """Body to world, shape (time, 3, 3)."""
        assert self.attitude is not None, "an effect that needs the attitude declares so"
        return rotations.rotation_matrix(self.attitude)

    @cached_property
    def ground_velocity(self) -> Array:
        """Velocity of the centre of mass over the ground, shape (time, 3), m/s, body frame."""
        assert self.velocity is not None, "an effect that needs velocity declares so"
        return np.asarray(np.einsum("tji,tj->ti", self.rotation, self.velocity))

    @cached_property
    def air_velocity(self) -> Array:
        """Velocity of the centre of mass through the air, shape (time, 3), m/s, body frame."""
        return self.ground_velocity if self.wind is None else self.ground_velocity - self.wind @ self.rotation

    @cached_property
    def instants(self) -> Instants:
        """See what effects see, at all samples."""
        return Instants(self)

    @cached_property
    def of_motion(self) -> dict[Hashable, Array]:
        """Keep what effects derive from the motion alone, for the same flight with other rotor speeds."""
        return {}

    @cached_property
    def hubs(self) -> Array:
        """Hub positions relative to the centre of mass, shape (rotor, 3), m, body frame."""
        return np.array([rotor.position_m for rotor in self.vehicle.rotors])

    @cached_property
    def allocation(self) -> Array:
        """Thrust and body torque of squared rotor speeds, shape (4, rotor)."""
        return allocation_matrix(self.vehicle)

    @cached_property
    def spins(self) -> Array:
        """Spin directions, shape (rotor,), +1 counter-clockwise from above."""
        return np.array([float(rotor.spin) for rotor in self.vehicle.rotors])

    @cached_property
    def rotor_thrust(self) -> Array:
        """Thrust of each rotor, shape (time, rotor), N."""
        return np.asarray(self.speed**2 * [rotor.thrust_factor_n_s2 for rotor in self.vehicle.rotors])

    @cached_property
    def hub_velocity(self) -> Array:
        """Velocity of each hub through the air, ``v + omega x r_i``, shape (time, rotor, 3), m/s, body frame."""
        return np.asarray(self.air_velocity[:, None] + rotations.cross(self.body_rate[:, None], self.hubs[None]))

    @cached_property
    def hub_height(self) -> Array:
        """Height of each hub above the ground, shape (time, rotor), m."""
        assert self.position is not None, "an effect that needs the height declares so"
        above = np.einsum("tj,rj->tr", self.rotation[:, 2], self.hubs)
        climb = None if self.velocity is None else self.velocity[:, 2]
        height = fused(self.position[:, 2], climb, self.period) if len(self) > _SHORTEST else self.position[:, 2]
        return np.asarray(height[:, None] - self.ground_height_m + above)

    @cached_property
    def radii(self) -> Array:
        """Radius of each propeller, shape (rotor,), m."""
        return np.array([rotor.radius_m for rotor in self.vehicle.rotors], dtype=float)

    def __getstate__(self) -> dict[str, object]:
        """Leave what was made of the flight to whoever gets a copy: it holds references, which no process can send."""
        return {name: value for name, value in self.__dict__.items() if name != "made"}

    def once(self, key: Hashable, make: Callable[[], _T]) -> _T:
        """Make what follows from the flight, or give what was made before: no stage of a workflow makes it again.

        `key`: who makes it, and all that it depends on other than the flight.
        """
        made = self.__dict__.setdefault("made", {})
        if key not in made:
            made[key] = make()
        return cast(_T, made[key])

    def with_rotor_speed(self, rotor_speed: Array) -> Signals:
        """Exchange the rotor speeds.

        `rotor_speed`: shape (time, rotor), rad/s.
        """
        changed = replace(self, rotor_speed=rotor_speed)
        # What the motion alone gives is not computed again for each of a search's thousand lags.
        changed.__dict__.update({name: getattr(self, name) for name in _OF_MOTION if name in self.__dict__})
        changed.__dict__["of_motion"] = self.of_motion
        return changed


class _Taken:
    """An attribute of `Instants` that follows from its signals, when it is asked for, and is kept."""

    def __init__(self, make: Callable[[Signals], Value]) -> None:
        self._make = make

    def __set_name__(self, _owner: type, name: str) -> None:
        self._name = name

    def __get__(self, instance: Any, _owner: type) -> Any:
        found = instance.__dict__[self._name] = self._make(instance.signals)
        return found


class Instants(Instant):
    """What effects see at all samples of a flight, as far as it is known; arrays by rotor have the rotors first.

    Thrust and torque of the rotors are as stated where their speeds are not known, with what else is known.
    """

    def __init__(self, signals: Signals) -> None:
        self.__dict__.update(signals=signals, vehicle=signals.vehicle, functions=ARRAYS)

    air_velocity: Any = _Taken(lambda signals: tuple(signals.air_velocity.T))
    body_rate: Any = _Taken(lambda signals: tuple(signals.body_rate.T))
    attitude: Any = _Taken(lambda signals: tuple(_known(signals.attitude).T))
    rotation: Any = _Taken(lambda signals: tuple(map(tuple, np.moveaxis(signals.rotation, 0, 2))))
    force: Any = _Taken(lambda signals: tuple(signals.force.T))
    thrust: Any = _Taken(lambda signals: signals.wrench[:, 5])
    rotor_torque: Any = _Taken(lambda signals: tuple(signals.wrench[:, :3].T))
    rotor_speed: Any = _Taken(lambda signals: signals.speed.T)
    rotor_thrust: Any = _Taken(lambda signals: signals.rotor_thrust.T)
    hub_height: Any = _Taken(lambda signals: signals.hub_height.T)
    hub_velocity: Any = _Taken(lambda signals: tuple(np.moveaxis(signals.hub_velocity, (0, 1, 2), (2, 1, 0))))


def _known(values: Array | None) -> Array:
    assert values is not None, "an effect that needs it declares so"
    return values


def stretch_of(signals: Signals, part: slice) -> Signals:
    """Take a part of a flight, with its clock."""
    values: dict[str, Any] = {each.name: getattr(signals, each.name) for each in fields(signals)}
    cut: dict[str, Any] = {name: value[part] for name, value in values.items() if isinstance(value, np.ndarray)}
    return replace(signals, **cut, setpoints={name: value[part] for name, value in signals.setpoints.items()})


def as_slow_as_rotors(signals: Signals) -> Signals:
    """Average motion as straight lines between rare updates average rotors, so that both show alike what is slow."""
    if not signals.rotor_span_s:
        return signals
    from scipy.ndimage import convolve1d

    wide = signals.rotor_span_s / signals.period
    weight = np.maximum(0.0, 1.0 - np.abs(np.arange(-int(wide), int(wide) + 1)) / wide)
    names = ("body_rate", "attitude", "velocity", "position", "acceleration", "specific_force")
    known = {name: values for name in names if (values := getattr(signals, name)) is not None}
    if "attitude" in known:
        # Where sensors were aligned, angles jump by full turns.
        known["attitude"] = np.unwrap(known["attitude"], axis=0)
    changed: dict[str, Any] = {
        name: convolve1d(values, weight / weight.sum(), axis=0, mode="nearest") for name, values in known.items()
    }
    return replace(signals, **changed)


def fused(values: Array, rate: Array | None, period: float) -> Array:
    """Take the noise out of a signal by its measured derivative, each weighed by its own noise.

    Minimises ``sum (x - values)^2 / s^2 + sum (x' - rate)^2 / r^2`` with s and r from third differences. What is curved
    in a noisy signal, such as a thrust over a height, is biased by its variance; that of the average is not.

    `values`: shape (time,); `rate`, shape (time,), per second: None: the signal as it is; `period`: s.
    """
    if rate is None:
        return values
    own, slope = white_noise(values), white_noise(rate) * period
    if own == 0.0:
        return values
    # Loaded where it is needed: who reads a model waits for nothing of scipy.
    from scipy.linalg import solveh_banded

    # A step is the mean of the rates at its ends, whose noise is less by the square root of 2.
    stiff = (own / max(slope / np.sqrt(2), 1e-6 * own)) ** 2
    step = 0.5 * period * (rate[1:] + rate[:-1])
    bands = np.ones((2, len(values)))
    bands[1, :-1] += stiff
    bands[1, 1:] += stiff
    bands[0, 1:] = -stiff
    right = values.copy()
    right[1:] += stiff * step
    right[:-1] -= stiff * step
    return np.asarray(solveh_banded(bands, right))


def white_noise(values: Array) -> Array:
    """Estimate the standard deviation of white noise from third differences, shape (time, ...) to (...)."""
    return np.asarray(np.sqrt(np.mean(np.diff(values, 3, axis=0) ** 2, axis=0) / 20))


GIVEN, TRAINING, HELD_OUT = "given", "training", "held-out"  # Roles of flights: of a comparison, and of a diagnosis.


@result
class RecordedFlight:
    """The signals of a flight."""

    name: str = about("file name, with the part of it where one flight was split")
    role: str = about("given, training or held-out")
    commanded: bool = about("whether actuation is commanded, not measured")
    begins: float = about(
        "stamp of the log's own clock at time 0 of the flight; not finite where there is none", unit="s", gaps=True
    )
    slow_rotors: str = about("what rotors that are logged rarely do not show, and the remedy", default="")
    attitude_spans: tuple[float, ...] = about(
        "over which rows average an attitude that is logged slower, one after another", "span", unit="s", default=()
    )
    body_rate_spans: tuple[float, ...] = about("the same of body rates", "rate span", unit="s", default=())
    rotor_span_s: float = about(
        "time between updates of rotors that are logged slower, 0 of others", unit="s", default=0.0
    )
    time: Array = about("time on the clock of the flight", "sample", unit="s")
    body_rate: Array = about("body rates p, q, r, as logged", "sample", "axis", unit="rad/s", frame=BODY)
    attitude: Array | None = about(
        "roll, pitch, yaw", "sample", "axis", unit="rad", frame="Euler angles (intrinsic ZYX)", default=None
    )
    velocity: Array | None = about("velocity", "sample", "axis", unit="m/s", frame=WORLD, default=None)
    position: Array | None = about("position", "sample", "axis", unit="m", frame=WORLD, default=None)
    acceleration: Array | None = about("acceleration", "sample", "axis", unit="m/s^2", frame=WORLD, default=None)
    specific_force: Array | None = about(
        "what an accelerometer senses", "sample", "axis", unit="m/s^2", frame=BODY, default=None
    )
    rotor_speed: Array | None = about(
        "rotor speeds, measured or commanded", "sample", "rotor", unit="rad/s", frame=BODY, default=None
    )
    stated_torque: Array | None = about(
        "torque of a log without rotor speeds", "sample", "axis", unit="N m", frame=BODY, default=None
    )
    stated_thrust: Array | None = about(
        "thrust of such a log, along body z", "sample", unit="N", frame=BODY, default=None
    )
    voltage: Array | None = about("of the battery, as a share of the full one", "sample", default=None)
    setpoint_position: Array | None = about(
        "position setpoint, by which runs in one flight are found",
        "sample",
        "axis",
        unit="m",
        frame=WORLD,
        default=None,
    )

    @classmethod
    def of(cls, flight: Signals, role: str) -> Self:
        """Take the signals of a flight."""
        held: dict[str, Any] = {each.name: getattr(flight, each.name, None) for each in described_fields(cls)}
        return cls(**held | {"role": role, "setpoint_position": flight.setpoints.get("position")})

    @property
    def signals(self) -> dict[str, Array]:
        """Known signals but the time, by name."""
        return {name: own for name, own in vars(self).items() if name != "time" and isinstance(own, np.ndarray)}

    def flight(self, vehicle: VehicleSettings, ground_height_m: float) -> Signals:
        """Rebuild the flight, with its vehicle and the height of the ground."""
        held = dict(vars(self))
        del held["role"]
        position = held.pop("setpoint_position")
        asked = {} if position is None else {"position": position}
        return Signals(**held, vehicle=vehicle, ground_height_m=ground_height_m, setpoints=asked)


def recorded(flights: Iterable[Signals], roles: Iterable[str]) -> dict[str, RecordedFlight]:
    """Hold flights by number."""
    pairs = enumerate(zip(flights, roles, strict=True), start=1)
    return {f"flight-{number}": RecordedFlight.of(*pair) for number, pair in pairs}


def in_roles(flights: Mapping[str, RecordedFlight], *roles: str) -> Sequence[RecordedFlight]:
    """List the flights in these roles; all if none is named."""
    return [each for each in flights.values() if not roles or each.role in roles]


def names_of(flights: Mapping[str, RecordedFlight], *roles: str) -> list[str]:
    """List the names of the flights in these roles; of all if none is named."""
    return [each.name for each in in_roles(flights, *roles)]
