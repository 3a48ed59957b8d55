"""Several configurations of a vehicle at once: numbers that they share, numbers of their own, and what differs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.effects.registry import CENTRE_OF_MASS
from cpfls_cli.inertia import INERTIA_PARAMETERS
from cpfls_cli.playback.flight import PlaybackFlight
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.playback.parameters import AS_STATED, COUNTED, INERTIA, MASS, Layout, Number, Numbered, Physical

CENTRE = tuple(f"{CENTRE_OF_MASS.name}.{coefficient.name}" for coefficient in CENTRE_OF_MASS.coefficients)
"""Numbers of a fit that say where the centre of mass is, ahead and to the left."""

OF_A_WEIGHT = (MASS, CENTRE_OF_MASS.name, INERTIA)
"""Blocks that an added weight changes."""


class Group(NamedTuple):
    """A configuration of the vehicle, and the blocks of numbers that it has of its own."""

    name: str
    differs: tuple[str, ...]


@dataclass(frozen=True)
class JointLayout(Numbered):
    """The numbers of several configurations: those of the vehicle of the config, then what others have of their own.

    Attributes
    ----------
    base : Layout
    groups : tuple of Group
    """

    base: Layout
    groups: tuple[Group, ...]

    @cached_property
    def _layouts(self) -> dict[str, Layout]:
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
                for number in self._layouts[group.name].numbers
                if number.block in group.differs
            ),
        )

    def values(self, known: Mapping[str, float]) -> Array:
        """Start from known values; a number of a group from that of the base, or from the stated one."""
        found = [known.get(n.name, known.get(n.name.rpartition(": ")[2], n.start)) for n in self.numbers]
        return np.array(found, dtype=float)

    def of_flight(self, flight: PlaybackFlight) -> tuple[Layout, IntArray]:
        """Give the layout of the vehicle of a flight, and where its numbers stand among these."""
        return self._layouts[flight.group], self._places(flight.group)

    def _places(self, group: str) -> IntArray:
        numbers = self._layouts[group].numbers
        return np.array([self._place(group, number.name) for number in numbers], dtype=np.int64)

    def _place(self, group: str, name: str) -> int:
        if name.startswith(COUNTED):
            return self.index[name.replace(COUNTED, INERTIA)]
        return self.index[own if (own := f"{group}: {name}") in self.index else name]

    def physical(self, values: Array) -> dict[str, Physical]:
        """Give all numbers as people know them, in order."""
        found = self.base.physical(values[: len(self.base.numbers)])
        for group in self.groups:
            layout = self._layouts[group.name]
            own = layout.physical(values[self._places(group.name)])
            pairs = zip(layout.numbers, own.items(), strict=True)
            found |= {
                f"{group.name}: {name}": known for number, (name, known) in pairs if number.block in group.differs
            }
        return found

    def model(self, values: Array, group: str = "") -> VehicleModel:
        """Build the model of a configuration."""
        return self._layouts[group].model(values[self._places(group)])

    def differences(self, values: Array) -> dict[str, Physical]:
        """Say what differs between each group and the vehicle of the config: an added mass, its place, and the rest.

        A mass at a place moves the centre of mass, ``m' c' = m c + (m' - m) p``.
        """
        base, found = self.base.physical(values[: len(self.base.numbers)]), {}
        mass = self.base.vehicle.mass_kg
        for group in self.groups:
            own = self._layouts[group.name].physical(values[self._places(group.name)])
            added = own[MASS].value - mass if MASS in own else 0.0
            if MASS in own:
                found[f"{group.name}: added mass"] = Physical(added, "kg")
            if MASS in own and CENTRE_OF_MASS.name in group.differs:
                for name, axis in zip(CENTRE, "xy", strict=True):
                    before = base[name].value if name in base else 0.0
                    place = (own[MASS].value * own[name].value - mass * before) / added if added else np.nan
                    found[f"{group.name}: place of the added mass, {axis}"] = Physical(place, "m")
            inertia = self._layouts[group.name].inertia(values[self._places(group.name)])
            if INERTIA in group.differs:
                difference = inertia - self.base.inertia(values[: len(self.base.numbers)])
                for name, moment in zip(INERTIA_PARAMETERS, np.diag(difference).tolist(), strict=False):
                    found[f"{group.name}: added {name}"] = Physical(moment, "kg m^2")
            for name, known in own.items():
                block = name.split(".")[0]
                if block in group.differs and block not in OF_A_WEIGHT:
                    before = base[name].value if name in base else 0.0
                    found[f"{group.name}: {name} less that of the config"] = Physical(known.value - before, known.unit)
        return found
