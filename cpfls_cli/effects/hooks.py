"""Hooks of an effect other than its columns: its place in the closed loop, and its test by the sensor audit."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.effects.signals import Signals
from cpfls_cli.vehicle.settings import VehicleSettings


class RotorMotion(NamedTuple):
    """Rotors in the middle of a step.

    `speed`: shape (rotor,), rad/s; `acceleration`: shape (rotor,), rad/s^2.
    """

    speed: Array
    acceleration: Array


Link = Callable[[RotorMotion], RotorMotion]
"""A link of the actuator chain; called once in each step, it may keep a state."""


@dataclass(frozen=True, kw_only=True)
class Actuation:
    """Where an effect acts between the command and the rotors; a flight with it logs commands, not rotor speeds.

    `lag`: ``lag(values) -> float``: time constant in s that replaces that of the rotors.
    `link`: ``link(values, step) -> Link`` after the lag, for steps of `step` seconds; made anew for each flight.
    `delay`: ``delay(values) -> float``: the same link as one number, where it is a pure delay in s.
    `supply`: ``supply(values, voltage) -> float``: factor on the rotor speed at a share of the full voltage, which is
    logged.
    """

    lag: Callable[[Mapping[str, float]], float] | None = None
    link: Callable[[Mapping[str, float], float], Link] | None = None
    delay: Callable[[Mapping[str, float]], float] | None = None
    supply: Callable[[Mapping[str, float], float], float] | None = None


class PhysicalNumbers(NamedTuple):
    """How linear coefficients are written as physical ones, which are not linear in the columns.

    `of`: ``of(linear) -> physical``, NaN where the data left one open; `linear`: the reverse.
    """

    of: Callable[[Array], Array]
    linear: Callable[[Array], Array]


class VehicleParts(NamedTuple):
    """What effects become in the model of a whole vehicle.

    `inertia`, shape (3, 3), kg m^2: added to that of the vehicle.
    `wind`: m/s, world frame.
    `effects`: those without a place of their own: name, shape, linear coefficients.
    """

    vehicle: VehicleSettings
    inertia: Array
    wind: tuple[float, float, float] = (0.0, 0.0, 0.0)
    effects: tuple[tuple[str, Mapping[str, float], Array], ...] = ()


class Carrier(NamedTuple):
    """The vehicle that carries a body.

    `mass`: kg.
    `inertia`: shape (3, 3), kg m^2, body frame.
    `rotation`, shape (3, 3): body to world.
    `body_rate`: shape (3,), rad/s, body frame.
    `acceleration`, shape (3,), m/s^2, world frame: without the carried body.
    `turning`, shape (3,), rad/s^2, body frame: the same.
    """

    mass: float
    inertia: Array
    rotation: Array
    body_rate: Array
    acceleration: Array
    turning: Array


class Pull(NamedTuple):
    """Acceleration of the carrier by a carried body, and the derivative of its state.

    `acceleration`: shape (3,), m/s^2, world frame.
    `turning`: shape (3,), rad/s^2, body frame.
    `change`, shape (state,): derivative of the state of the body.
    """

    acceleration: Array
    turning: Array
    change: Array


class CarriedBody(Protocol):
    """A body with a state of its own on the vehicle."""

    @property
    def start(self) -> Array:
        """State at the start, shape (state,)."""
        ...

    def pull(self, carrier: Carrier, state: Array) -> Pull:
        """Compute the pull on a carrier."""
        ...


class TrueMotion(NamedTuple):
    """True motion at the samples of a simulated flight.

    `time`: shape (time,), s.
    `rotation`, shape (time, 3, 3): body to world.
    `body_rate`: shape (time, 3), rad/s, body frame.
    `body_acceleration`: shape (time, 3), rad/s^2, body frame.
    """

    time: Array
    rotation: Array
    body_rate: Array
    body_acceleration: Array

    @property
    def period(self) -> float:
        """Sampling period, s."""
        return float(self.time[1] - self.time[0])


@dataclass(frozen=True, kw_only=True)
class SensorLog:
    """How the log of a sensor differs from the truth.

    `change`: ``change(signals, motion, values) -> dict``: the signals that are logged differently, by name, without
    noise.
    `does`: the same in words, for refusals.
    """

    change: Callable[[Mapping[str, Array], TrueMotion, Mapping[str, float]], dict[str, Array]]
    does: str = "needs measured rotor speeds"


def gyroscope_log(reading: Callable[[Array, Array], Array]) -> SensorLog:
    """Log body rates as ``reading(rate, numbers)``, both of three axes."""

    def change(signals: Mapping[str, Array], _: TrueMotion, values: Mapping[str, float]) -> dict[str, Array]:
        return {"body_rate": np.asarray(reading(signals["body_rate"], np.array(list(values.values()))))}

    return SensorLog(change=change)


class ReadingError(NamedTuple):
    """Error of a sensor of three axes, ``reading(t) = matrix @ truth(t - delay) + offset``."""

    delay: float = 0.0
    offset: Array = np.zeros(3)
    matrix: Array = np.eye(3)


class FaultFit(NamedTuple):
    """Estimated numbers of a fault.

    `value`, `error`, shape (number,): with standard errors.
    `pull`, shape (number,): how far noise of the sensor can have pulled the value at most.
    `known`, shape (number,): what the motion identifies.
    `blocks`: of time that scattered the values.
    """

    value: Array
    error: Array
    pull: Array
    known: BoolArray
    blocks: int


@dataclass(frozen=True, kw_only=True)
class SensorTest:
    """How the sensor audit tests a fault, says what it found, and repairs it.

    `estimate`: numbers of the regression of the gyroscope on the attitude: ``bias``, ``scale``, ``misalignment`` or
    ``delay``; else ``estimate(flights) -> FaultFit``, None where the flights do not identify it.
    `labels`: names of the numbers in findings, in the order of the effect's coefficients, then shapes.
    `smallest`: size below which a fault moves no torque by more than the noise of a window, so that nothing is to
    repair.
    `smallest_samples`: the same in sampling periods, for a time.
    `number`: ``number(label, value) -> str``: a number in words.
    `found`: sentence with ``{}`` for the numbers.
    `nothing`: sentence where no number is named.
    `error`: ``error(values) -> ReadingError`` that is taken out of `signal`; values in the order of `labels`.
    `signal`: field of `Signals`, shape (time, 3).
    `integrated`: whether an attitude that is integrated from the gyroscope would not show the fault.
    """

    estimate: str | Callable[[Sequence[Signals]], FaultFit | None]
    smallest: float
    number: Callable[[str, float], str]
    found: str
    nothing: str
    error: Callable[[Array], ReadingError]
    labels: tuple[str, ...] = ("x", "y", "z")
    smallest_samples: float = 0.0
    signal: str = "body_rate"
    integrated: bool = False
