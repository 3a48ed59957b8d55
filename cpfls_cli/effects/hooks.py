"""Hooks of an effect other than its columns: its place in the closed loop, and its test by the sensor audit."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.effects.signals import Signals
from cpfls_cli.filters import SecondOrder
from cpfls_cli.lag import delayed
from cpfls_cli.vehicle.motion import Carrier, Instant, Numbers, Pull
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.vehicle.stepping import Memory, RotorMotion
from cpfls_cli.vehicle.values import Value, Vector

Link = Callable[[RotorMotion, Mapping[str, float], Memory], RotorMotion]
"""A link of the actuator chain, of its values; it keeps in the memory what the next step needs."""


@dataclass(frozen=True, kw_only=True)
class Actuation:
    """Where an effect acts between the command and the rotors; a flight with it logs commands, not rotor speeds."""

    # ``lag(values) -> float``: time constant in s that replaces that of the rotors.
    lag: Callable[[Mapping[str, float]], float] | None = None
    link: Link | None = None  # ``link(rotors, values, memory) -> RotorMotion`` after the lag, at each step.
    # ``delay(values) -> float``: the same link as one number, where it is a pure delay in s.
    delay: Callable[[Mapping[str, float]], float] | None = None
    # ``supply(values, voltage)``: factor on the rotor speed at a share of the full voltage, which is logged.
    supply: Callable[[Mapping[str, float], Value], Value] | None = None


class PhysicalNumbers(NamedTuple):
    """How linear coefficients are written as physical ones, which are not linear in the columns."""

    of: Callable[[Array], Array]  # ``of(linear) -> physical``, NaN where the data left one open.
    linear: Callable[[Array], Array]  # The reverse.


class VehicleParts(NamedTuple):
    """What effects become in the model of a whole vehicle."""

    vehicle: VehicleSettings
    inertia: Array  # Shape (3, 3), kg m^2: added to that of the vehicle.
    wind: tuple[float, float, float] = (0.0, 0.0, 0.0)  # M/s, world frame.
    # Those without a place of their own: name, shape, linear coefficients.
    effects: tuple[tuple[str, Mapping[str, float], Array], ...] = ()


class Body(NamedTuple):
    """A body with a state of its own on the vehicle."""

    # ``pull(see, p, state, carrier) -> Pull``, see `Carried`.
    pull: Callable[[Instant, Numbers, Vector, Carrier], Pull]
    start: tuple[float, ...]  # Its state at the start.


class TrueMotion(NamedTuple):
    """True motion at the samples of a simulated flight."""

    time: Array  # Shape (time,), s.
    rotation: Array  # Shape (time, 3, 3): body to world.
    body_rate: Array  # Shape (time, 3), rad/s, body frame.
    body_acceleration: Array  # Shape (time, 3), rad/s^2, body frame.

    @property
    def period(self) -> float:
        """Sampling period, s."""
        return float(self.time[1] - self.time[0])


@dataclass(frozen=True, kw_only=True)
class SensorLog:
    """How the log of a sensor differs from the truth."""

    # ``change(signals, motion, values) -> dict``: the signals that are logged differently, by name, without noise.
    change: Callable[[Mapping[str, Array], TrueMotion, Mapping[str, float]], dict[str, Array]]
    does: str = "needs measured rotor speeds"  # The same in words, for refusals.


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
    """Estimated numbers of a fault."""

    value: Array  # Shape (number,).
    error: Array  # Standard errors, shape (number,).
    pull: Array  # Shape (number,): how far noise of the sensor can have pulled the value at most.
    known: BoolArray  # Shape (number,): what the motion identifies.
    blocks: int  # Of time that scattered the values.


@dataclass(frozen=True, kw_only=True)
class SensorTest:
    """How the sensor audit tests a fault, says what it found, and repairs it."""

    # Numbers of the regression of the gyroscope on the attitude: ``bias``, ``scale``, ``misalignment`` or ``delay``;
    # else ``estimate(flights) -> FaultFit``, None where the flights do not identify it.
    estimate: str | Callable[[Sequence[Signals]], FaultFit | None]
    # Size below which a fault moves no torque by more than the noise of a window, so that nothing is to repair.
    smallest: float
    number: Callable[[str, float], str]  # ``number(label, value) -> str``: a number in words.
    found: str  # Sentence with ``{}`` for the numbers.
    nothing: str  # Sentence where no number is named.
    # ``error(values) -> ReadingError`` that is taken out of `signal`; values in the order of `labels`.
    error: Callable[[Array], ReadingError]
    # Names of the numbers in findings, in the order of the effect's coefficients, then shapes.
    labels: tuple[str, ...] = ("x", "y", "z")
    smallest_samples: float = 0.0  # The same in sampling periods, for a time.
    signal: str = "body_rate"  # Field of `Signals`, shape (time, 3).
    integrated: bool = False  # Whether an attitude that is integrated from the gyroscope would not show the fault.


_HIGHEST = 0.45  # Frequency of a filter over that of the sampling, above which it is taken to be there.


def second_order(frequency: float, damping: float, period: float, upper: tuple[float, float, float]) -> SecondOrder:
    """Make a filter of its natural frequency in Hz, zeta, the sampling period in s, and (a, b, c)."""
    return SecondOrder.of(min(frequency * period, _HIGHEST), damping, upper)


def with_actuation(signals: Signals, change: Callable[[Array], Array]) -> Signals:
    """Change the rotor speeds, or the stated torque and thrust of a flight without rotor speeds.

    `change`: from a signal to the changed one, time first.
    """
    if signals.rotor_speed is not None:
        return signals.with_rotor_speed(change(signals.rotor_speed))
    torque = None if signals.stated_torque is None else change(signals.stated_torque)
    thrust = None if signals.stated_thrust is None else change(signals.stated_thrust)
    return replace(signals, stated_torque=torque, stated_thrust=thrust)


def shifted(signals: Signals, shape: Mapping[str, float]) -> Signals:
    """Shift what drives the rotors by a delay of ``delay_s``."""
    return with_actuation(signals, lambda values: delayed(values, shape["delay_s"] / signals.period))


@dataclass(frozen=True)
class CommandFilter:
    """A second-order filter between command and rotors, with the functions that an effect is made of."""

    damping: str  # Name of the shape that is zeta; the other one is ``frequency_hz``.
    upper: tuple[float, float, float]  # (a, b, c) of `SecondOrder`.

    def _passing(self, shape: Mapping[str, float], period: float) -> SecondOrder:
        return second_order(shape["frequency_hz"], shape[self.damping], period, self.upper)

    def apply(self, signals: Signals, shape: Mapping[str, float]) -> Signals:
        """Filter what drives the rotors of a flight."""
        return with_actuation(signals, self._passing(shape, signals.period).along)

    def link(self, rotors: RotorMotion, values: Mapping[str, float], memory: Memory) -> RotorMotion:
        """Filter speeds and accelerations of the rotors."""
        return memory.filtered(self._passing(values, memory.step), rotors)
