"""Several configurations of a vehicle at once: numbers that they share, numbers of their own, and what differs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.effects.registry import CENTRE_OF_MASS
from cpfls_cli.estimation.estimate import Prior
from cpfls_cli.inertia import INERTIA_PARAMETERS
from cpfls_cli.playback.evaluation import VehicleAt
from cpfls_cli.playback.flight import PlaybackFlight
from cpfls_cli.playback.parameters import AS_STATED, COUNTED, INERTIA, MASS, FreeNumbers, Number, Physical

CENTRE = tuple(f"{CENTRE_OF_MASS.name}.{coefficient.name}" for coefficient in CENTRE_OF_MASS.coefficients)
"""Numbers of a fit that say where the centre of mass is, ahead and to the left."""

PRIOR = 1e-5
"""Weight of what is believed before the flights, so small that it decides only what they do not identify."""

OF_A_WEIGHT = (MASS, CENTRE_OF_MASS.name, INERTIA)
"""Blocks that an added weight changes."""


class Group(NamedTuple):
    """A configuration of the vehicle, and the blocks of numbers that it has of its own."""

    name: str
    differs: tuple[str, ...]


@dataclass(frozen=True)
class JointNumbers:
    """The free numbers of all configurations: those of the vehicle of the config, then what others have of theirs."""

    base: FreeNumbers
    groups: tuple[Group, ...] = ()

    @cached_property
    def _by_group(self) -> dict[str, FreeNumbers]:
        found = {"": self.base}
        for group in self.groups:
            more = [block for block in group.differs if block not in self.base.blocks]
            if INERTIA in group.differs:
                more.append(COUNTED if INERTIA in self.base.blocks else AS_STATED)
            found[group.name] = replace(self.base, chosen=(*self.base.chosen, *more))
        return found

    @cached_property
    def numbers(self) -> tuple[Number, ...]:
        """All numbers."""
        return (
            *self.base.numbers,
            *(
                replace(number, name=f"{group.name}: {number.name}")
                for group in self.groups
                for number in self._by_group[group.name].numbers
                if number.block in group.differs
            ),
        )

    @cached_property
    def index(self) -> dict[str, int]:
        """Place of each number by name."""
        return {number.name: place for place, number in enumerate(self.numbers)}

    @cached_property
    def starts(self) -> Array:
        """Stated numbers, shape (number,)."""
        return self._column("start")

    @cached_property
    def scales(self) -> Array:
        """Natural sizes of changes, shape (number,)."""
        return self._column("scale")

    @cached_property
    def lows(self) -> Array:
        """Lower bounds, shape (number,)."""
        return self._column("low")

    @cached_property
    def highs(self) -> Array:
        """Upper bounds, shape (number,)."""
        return self._column("high")

    @cached_property
    def spreads(self) -> Array:
        """Standard deviations of what is believed before, in scales, shape (number,)."""
        return self._column("spread")

    @cached_property
    def prior(self) -> Prior:
        """What is believed before flights are seen, in scales."""
        return Prior(self.starts / self.scales, self.spreads / np.sqrt(PRIOR))

    def _column(self, name: str) -> Array:
        return np.array([getattr(number, name) for number in self.numbers], dtype=float)

    def named(self, values: Array) -> dict[str, float]:
        """Name values."""
        return dict(zip(self.index, values.tolist(), strict=True))

    def values(self, known: Mapping[str, float]) -> Array:
        """Start from known values; a number of a group from that of the base, or from the stated one."""
        found = [known.get(n.name, known.get(n.name.rpartition(": ")[2], n.start)) for n in self.numbers]
        return np.array(found, dtype=float)

    def of_flight(self, flight: PlaybackFlight) -> tuple[FreeNumbers, IntArray]:
        """Give the numbers of the vehicle of a flight, and where they stand among these."""
        return self._by_group[flight.group], self._places[flight.group]

    @cached_property
    def _places(self) -> dict[str, IntArray]:
        return {
            group: np.array([self._place(group, number.name) for number in free.numbers], dtype=np.int64)
            for group, free in self._by_group.items()
        }

    def _place(self, group: str, name: str) -> int:
        if name.startswith(COUNTED):
            return self.index[name.replace(COUNTED, INERTIA)]
        return self.index[own if (own := f"{group}: {name}") in self.index else name]

    def at(self, values: Array, group: str = "") -> VehicleAt:
        """Give the vehicle of a configuration at values of all numbers."""
        return VehicleAt(self._by_group[group], values[self._places[group]])

    def physical(self, values: Array) -> dict[str, Physical]:
        """Give all numbers as people know them, in order."""
        found = self.at(values).physical
        for group in self.groups:
            at = self.at(values, group.name)
            pairs = zip(at.free.numbers, at.physical.items(), strict=True)
            found |= {
                f"{group.name}: {name}": known for number, (name, known) in pairs if number.block in group.differs
            }
        return found

    def differences(self, values: Array) -> dict[str, Physical]:
        """Say what differs between each group and the vehicle of the config: an added mass, its place, and the rest.

        A mass at a place moves the centre of mass, ``m' c' = m c + (m' - m) p``.
        """
        stated, found = self.at(values), dict[str, Physical]()
        base, mass = stated.physical, self.base.vehicle.mass_kg
        for group in self.groups:
            at = self.at(values, group.name)
            own = at.physical
            before = {name: base[name].value if name in base else 0.0 for name in own}
            if MASS in own:
                added = own[MASS].value - mass
                found[f"{group.name}: added mass"] = Physical(added, "kg")
                for name, axis in zip(CENTRE, "xy", strict=True) if CENTRE_OF_MASS.name in group.differs else ():
                    place = (own[MASS].value * own[name].value - mass * before[name]) / added if added else np.nan
                    found[f"{group.name}: place of the added mass, {axis}"] = Physical(place, "m")
            if INERTIA in group.differs:
                difference = np.diag(at.inertia - stated.inertia).tolist()
                for name, moment in zip(INERTIA_PARAMETERS, difference, strict=False):
                    found[f"{group.name}: added {name}"] = Physical(moment, "kg m^2")
            for name, known in own.items():
                block = name.split(".")[0]
                if block in group.differs and block not in OF_A_WEIGHT:
                    away = Physical(known.value - before[name], known.unit)
                    found[f"{group.name}: {name} less that of the config"] = away
        return found
