"""The sentence on an effect, with what its numbers say in words."""

from __future__ import annotations

from collections.abc import Sequence

from cpfls_cli.effects.effect import Effect
from cpfls_cli.gap.naming.results import Estimate
from cpfls_cli.vehicle.settings import VehicleSettings


def told_effect(effect: Effect, numbers: Sequence[Estimate], vehicle: VehicleSettings) -> str:
    """Say what a pilot understands of an effect as it was found.

    Parameters
    ----------
    effect : Effect
    numbers : sequence of Estimate
        Coefficients, then shapes.
    vehicle : VehicleSettings

    Returns
    -------
    str
        The sentence of the catalogue, and what the numbers that are surely not zero add to it.
    """
    sure = {number.name: number.value for number in numbers if number.low > 0 or number.high < 0}
    more = "" if effect.told is None else effect.told(vehicle, sure)
    return f"{effect.sentence} {more}".rstrip()
