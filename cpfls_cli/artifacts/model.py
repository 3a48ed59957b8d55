"""What every model of a vehicle answers, whoever found it."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from cpfls_cli.artifacts.learned import LearnedFlight
from cpfls_cli.inertia import INERTIA_PARAMETERS, beyond_any_body, more_than_others
from cpfls_cli.validation.trust import Trust

if TYPE_CHECKING:
    from cpfls_cli.playback.model import VehicleModel


def of_no_body(model: VehicleModel) -> tuple[str, ...]:
    """Name the moments of inertia of a vehicle that are those of no body of its mass between its rotors."""
    vehicle = model.vehicle
    pairs = zip(INERTIA_PARAMETERS[:3], vehicle.inertia_kg_m2, strict=False)
    moments = {f"inertia.{name}": value for name, value in pairs}
    excess = {f"inertia.{name}" for name in more_than_others(list(moments.values()))}
    hubs = np.array([rotor.position_m for rotor in vehicle.rotors])
    wrong = {*beyond_any_body(vehicle.mass_kg, hubs, moments), *excess}
    return tuple(name for name in moments if name in wrong)


class AnyModel:
    """What every model of a vehicle answers, whoever found it."""

    MADE_BY: ClassVar[str]
    """Command that makes it."""
    if TYPE_CHECKING:
        # Of a result it is a field, whose kind the class says that has it.
        model: VehicleModel

    @property
    def learned_from(self) -> tuple[LearnedFlight, ...]:
        """Flights that it was found in, those of what it was built on among them."""
        return ()

    @property
    def chosen_on(self) -> frozenset[str]:
        """Hashes of the flights that it was chosen on, among several."""
        return frozenset()

    @property
    def trust(self) -> str:
        """How far to trust it, a word of `Trust`; of a file by a newer program possibly another."""
        return Trust.NOT_JUDGED

    @property
    def judged_as(self) -> dict[str, str]:
        """How far to trust it, by what it is judged as; the word of the last is that of whoever takes it elsewhere."""
        return {"": self.trust}

    @property
    def stopped(self) -> str:
        """Why the search for it ended before its end; empty where it did not."""
        return ""

    @property
    def impossible(self) -> tuple[str, ...]:
        """Numbers of it that no such vehicle has, by the names of a fit."""
        return ()
