"""Actuation that comes late: filtered or shifted, with the change of wrench that follows."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.effects.hooks import Link, RotorMotion
from cpfls_cli.effects.signals import Signals
from cpfls_cli.filters import SecondOrder
from cpfls_cli.lag import delayed

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


@dataclass
class DelayLine:
    """Rotors behind a delay, step by step, in straight lines; before the first have arrived they keep their speed."""

    steps: float  # Delay in steps, at least 0.
    past: list[RotorMotion] = field(default_factory=list)  # What is still under way.

    def __call__(self, rotors: RotorMotion) -> RotorMotion:
        """Take up the rotors of a step, and give those that arrive."""
        if self.steps == 0:
            return rotors
        self.past.append(rotors)
        whole = int(self.steps)
        del self.past[: max(len(self.past) - whole - 2, 0)]
        first, second = self.past[0], self.past[min(1, len(self.past) - 1)]
        if len(self.past) < whole + 2:
            return RotorMotion(first.speed, np.zeros_like(first.speed))
        share = self.steps - whole
        return RotorMotion(*((1 - share) * new + share * old for old, new in zip(first, second, strict=True)))


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

    def link(self, values: Mapping[str, float], step: float) -> Link:
        """Filter speeds and accelerations of the rotors, which were settled before the first step."""
        passing = self._passing(values, step)
        state: list[Array] = []

        def link(rotors: RotorMotion) -> RotorMotion:
            now = np.concatenate([rotors.speed, rotors.acceleration])
            if not state:
                state.append(passing.settled(np.concatenate([rotors.speed, np.zeros_like(rotors.acceleration)])))
            passed, state[0] = passing.step(now, state[0])
            return RotorMotion(*np.split(passed, 2))

        return link
