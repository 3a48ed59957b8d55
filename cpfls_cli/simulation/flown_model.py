"""A model that is flown: how it turns, and the effects that it has with their values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from cpfls_cli.dynamics.equations_of_motion import InertiaModel
from cpfls_cli.errors import SettingError
from cpfls_cli.simulation.flown_effects import FlownEffect, FlownEffects, flown_effects, refuse_conflict
from cpfls_cli.vehicle.settings import VehicleSettings

_OWN_NUMBERS = "parameter_error"


@dataclass(frozen=True)
class FlownModel:
    """A vehicle as a model has it.

    Attributes
    ----------
    base : InertiaModel or None
        None for the rigid body of the vehicle.
    effects : FlownEffects
    """

    base: InertiaModel | None = None
    effects: FlownEffects = field(default_factory=FlownEffects)

    def with_effects(self, asked: FlownEffects) -> FlownModel:
        """Add effects to those of the model; errors of the vehicle's own numbers add up.

        Raises
        ------
        SettingError
            If the model has one of them already, or two of them do not go together.
        """
        own = {one.effect.name: one for one in self.effects.flown}
        for one in asked.flown:
            name = one.effect.name
            own[name] = _added(own[name], one) if name in own else one
        together = FlownEffects(tuple(own.values()))
        refuse_conflict(together)
        return FlownModel(self.base, together)


def flown_model(
    base: InertiaModel | None, fitted: Mapping[str, Mapping[str, float]], vehicle: VehicleSettings
) -> FlownModel:
    """Fly a model with its effects.

    Parameters
    ----------
    base : InertiaModel or None
        None for the rigid body of the vehicle.
    fitted : mapping
        By name of the effect: its values by name.
    vehicle : VehicleSettings

    Raises
    ------
    InputError
        If there is no such effect.
    SettingError
        If a value is missing or impossible, or effects do not go together.
    """
    return FlownModel(base, flown_effects(fitted, vehicle))


def _added(own: FlownEffect, asked: FlownEffect) -> FlownEffect:
    name = own.effect.name
    if name != _OWN_NUMBERS:
        has = ", ".join(f"{key} = {value:.4g}" for key, value in own.values.items())
        raise SettingError(f"closed_loop.effects.{name}", f"the model has it already{': ' + has if has else ''}")
    return FlownEffect(own.effect, {key: value + asked.values[key] for key, value in own.values.items()})
