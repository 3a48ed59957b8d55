"""Actuation that comes late: filtered or shifted, with the change of wrench that follows."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from cpfls_cli.arrays import Array
from cpfls_cli.effects.signals import Signals
from cpfls_cli.filters import SecondOrder
from cpfls_cli.lag import delayed
from cpfls_cli.vehicle.stepping import Memory, RotorMotion

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
