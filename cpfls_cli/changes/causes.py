"""What can have changed about a vehicle, and what each change does to the numbers of a flight."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.changes.reference import load_directions
from cpfls_cli.vehicle.settings import VehicleSettings


@dataclass(frozen=True)
class Cause:
    """A change and its directions in the numbers of a flight.

    Attributes
    ----------
    name : str
        What changed, as a key: ``rotor M3``.
    directions : array, shape (number, size)
        Of each size of it, the first of which is told, for as much as is usual where it happens.
    usual : float
        The first size, in its unit, where it happens: standard deviation of a normal prior.
    unit : str
    prior : float
        Beside the others.
    losses : int
        Of the first so many sizes: nearly always above 0. What is damaged pulls less, and no load is lighter than none.
    told : int
        Of the first so many sizes: they have the unit of the cause.
    """

    name: str
    directions: Array
    usual: float
    unit: str
    prior: float = 1.0
    losses: int = 0
    told: int = 1

    @property
    def rotors(self) -> frozenset[str]:
        """Rotors that changed, by name."""
        first, *rest = self.name.split()
        return frozenset(rest) - {"and"} if first in ("rotor", "rotors") else frozenset()

    def holds(self, other: Cause) -> bool:
        """Tell whether another change is this one with something more: a rotor and a second one."""
        return bool(self.rotors) and self.rotors < other.rotors


_LOSS = 0.15
"""Share of thrust that a damaged propeller lacks."""

_OF_YAW = 0.2
"""By how much its drag changes by another share than its thrust, of that share."""

_RARER = 0.5
"""Prior of two rotors beside that of one."""

_SHAKES = 0.5
"""Logarithm of vibration beside the reference, of something that came loose or out of balance."""

_OF_AXIS = 0.5
"""Of that, by how much each axis differs from the others."""

_HEAVIER = 0.1
_OFF_CENTRE = 0.1
"""Of the arm: by how much a centre of mass moves."""

_ALONE = {
    "turn": (0.1, "1"),
    "unbalance": (1.0, "1"),
    "follow": (0.2, "1"),
    "late": (0.01, "s"),
    "answer": (0.01, "s"),
    "felt": (0.5, "m/s^2"),
    "gusts": (0.7, "1"),
    "lean": (0.7, "m/s^2"),
    "drift": (0.05, "rad/s"),
    "battery": (0.05, "1"),
}
"""Of kinds of which each number stands for itself: how much it changes where it does, and its unit."""

_ALIKE = {"late": 0.3, "answer": 0.5, "gusts": 0.5}
"""Kinds of which all numbers change at once, and the share of that by which each does so by itself."""

_AT_ONCE = ("lean", "drift")
"""Kinds of which all numbers change at once, each by itself."""


def causes(names: Sequence[str], vehicle: VehicleSettings) -> list[Cause]:
    """List what can have changed, as far as the numbers show it."""
    return list(_causes(names, vehicle))


def _causes(names: Sequence[str], vehicle: VehicleSettings) -> Iterator[Cause]:
    place = {name: index for index, name in enumerate(names)}

    def direction(changes: dict[str, float]) -> Array:
        column = np.zeros(len(names))
        for name, value in changes.items():
            if name in place:
                column[place[name]] = value
        return column

    def loads(of: Array) -> Array:
        return direction({f"load M{index + 1}": value for index, value in enumerate(of)})

    def of_kind(kind: str) -> list[str]:
        return [name for name in names if name.split()[0] == kind]

    vibrations = of_kind("vibration")
    # All axes alike, and each by itself.
    shakes = [
        _SHAKES * direction(dict.fromkeys(vibrations, 1.0)),
        *(_SHAKES * _OF_AXIS * direction({name: 1.0}) for name in vibrations),
    ]
    if of_kind("load"):
        own = load_directions(vehicle)
        arms = np.array([rotor.position_m[:2] for rotor in vehicle.rotors])
        arm = float(np.linalg.norm(arms, axis=1).mean())
        yaw = loads(own.yaw)
        lever = arms[:, ::-1] ** 2 / np.maximum((arms**2).sum(axis=0)[::-1], 1e-12)
        single = []
        for index in range(len(vehicle.rotors)):
            # It turns the body less too, as far as it drives roll and pitch.
            weaker = direction({"follow roll": -lever[index, 0], "follow pitch": -lever[index, 1]})
            loss = _LOSS * (loads(own.rotor[index]) + weaker)
            single.append(loss)
            beside = [_LOSS * _OF_YAW / len(arms) * yaw, *shakes]
            yield Cause(f"rotor M{index + 1}", np.stack([loss, *beside], axis=1), _LOSS, "1", losses=1)
        pairs = list(combinations(range(len(single)), 2))
        for one, other in pairs:
            columns = [single[one], single[other], _LOSS * _OF_YAW / len(arms) * yaw, *shakes]
            yield Cause(
                f"rotors M{one + 1} and M{other + 1}", np.stack(columns, axis=1), _LOSS, "1", _RARER, losses=2, told=2
            )
        moved = [_OFF_CENTRE * arm * loads(each) for each in own.offset]
        yield Cause("mass", np.stack([_HEAVIER * loads(own.mass), *moved], axis=1), _HEAVIER, "1")
        if of_kind("swing"):
            hangs = _HEAVIER * (loads(own.mass) + direction({"swing": 1.0}))
            yield Cause("load on a cable", np.stack([hangs, *moved], axis=1), _HEAVIER, "1", losses=1)
        yield Cause("centre of mass", np.stack(moved, axis=1), _OFF_CENTRE * arm, "m", told=2)
        yield Cause("hover", _HEAVIER * loads(own.mass)[:, None], _HEAVIER, "1")
        for index, (x, y) in enumerate(arms):
            # In hover hardly another thing than a rotor that pulls less.
            hangs = _HEAVIER * loads(own.mass + x * own.offset[0] + y * own.offset[1])
            yield Cause(f"weight near M{index + 1}", hangs[:, None], _HEAVIER, "1", 1 / len(arms), losses=1)
        yield Cause("torque about z", _OF_YAW * yaw[:, None], _OF_YAW, "1")
    if vibrations:
        yield Cause("vibration", np.stack(shakes, axis=1), _SHAKES, "1")
    for kind, (usual, unit) in _ALONE.items():
        each = [usual * direction({name: 1.0}) for name in of_kind(kind)]
        if each and kind in _ALIKE:
            columns = [np.sum(each, axis=0), *(_ALIKE[kind] * column for column in each)]
            yield Cause(kind, np.stack(columns, axis=1), usual, unit)
        elif each and kind in _AT_ONCE:
            yield Cause(kind, np.stack(each, axis=1), usual, unit, told=len(each))
        else:
            for name, column in zip(of_kind(kind), each, strict=True):
                yield Cause(name, column[:, None], usual, unit)
            if each and kind == "turn":
                yield Cause("all motors", np.sum(each, axis=0)[:, None], usual, unit)
