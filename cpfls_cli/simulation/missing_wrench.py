"""The wrench that effects of the catalogue add to a vehicle, at one instant."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.effects.effect import Columns
from cpfls_cli.effects.signals import Signals
from cpfls_cli.simulation.flown_effects import FlownEffect, FlownEffects

_OTHERWISE = frozenset({"payload", "motor_lag", "command_delay", "battery_sag", "channel_delay"})


@dataclass(frozen=True)
class MissingWrench:
    """Columns of effects times their coefficients, ``direct + d/dt momentum``.

    The momentum of the catalogue's effects is linear in body rates and rotor speeds, so that its derivative adds to
    the inertia and couples the body to the acceleration of the rotors.

    Attributes
    ----------
    flown : tuple of FlownEffect
    added_inertia : array, shape (3, 3), kg m^2
        Minus the momentum by body rate.
    rotor_coupling : array, shape (3, rotor), kg m^2
        Momentum by rotor speed.
    """

    flown: tuple[FlownEffect, ...]
    added_inertia: Array
    rotor_coupling: Array

    def direct(self, signals: Signals) -> Array:
        """Evaluate what acts at once.

        Parameters
        ----------
        signals : Signals
            Of one instant.

        Returns
        -------
        array, shape (6,), N m and N, body frame
        """
        total = np.zeros(6)
        for one in sorted(self.flown, key=_takes_all_forces):
            felt = _with_force(signals, total[3:]) if _takes_all_forces(one) else signals
            total += _columns(one, felt).direct[0] @ one.acting
        return total


def missing_wrench(effects: FlownEffects, hover: Signals) -> MissingWrench:
    """Prepare the effects that have columns; payload and actuation have a state of their own and are left out.

    Parameters
    ----------
    effects : FlownEffects
    hover : Signals
        One instant, of any motion.
    """
    flown = tuple(one for one in effects.flown if one.effect.columns and one.effect.name not in _OTHERWISE)
    rates = [replace(hover, body_rate=rate[None]) for rate in np.eye(3)]
    by_rate = _slopes(flown, rates, replace(hover, body_rate=np.zeros((1, 3))))
    speeds = np.eye(len(hover.vehicle.rotors))
    by_speed = _slopes(
        flown, [hover.with_rotor_speed(speed[None]) for speed in speeds], hover.with_rotor_speed(0 * speeds[:1])
    )
    return MissingWrench(flown, -by_rate, by_speed)


def _slopes(flown: tuple[FlownEffect, ...], moved: list[Signals], still: Signals) -> Array:
    """Change of the angular momentum with each unit step, shape (3, step)."""
    return np.stack([_momentum(flown, signals) - _momentum(flown, still) for signals in moved], axis=1)


def _momentum(flown: tuple[FlownEffect, ...], signals: Signals) -> Array:
    total = np.zeros(3)
    for one in flown:
        momentum = _columns(one, signals).momentum
        if momentum is not None:
            total += momentum[0, :3] @ one.acting
    return total


def _takes_all_forces(one: FlownEffect) -> bool:
    """Tell whether an effect has a lever for what the other effects pull, as an offset centre of mass has."""
    return one.effect.name == "com_offset"


def _with_force(signals: Signals, force: Array) -> Signals:
    return replace(signals, specific_force=(signals.wrench[:, 3:] + force) / signals.vehicle.mass_kg)


def _columns(one: FlownEffect, signals: Signals) -> Columns:
    assert one.effect.columns is not None, "chosen so"
    shape: Mapping[str, float] = one.shape
    return one.effect.columns(signals, shape)
