"""What can have changed about a vehicle, and what each change does to the numbers of a flight."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.changes.reference import thrust_directions
from cpfls_cli.inertia import symmetric
from cpfls_cli.units import STANDARD_GRAVITY
from cpfls_cli.vehicle.settings import VehicleSettings


@dataclass(frozen=True)
class Cause:
    """A change and its directions in the numbers of a flight."""

    name: str  # What changed, as a key: ``rotor M3``. Of one name there are several where it can show in several ways.
    # Shape (number, size): of each size of it, the first of which is reported, for as much as is usual where it
    # happens.
    directions: Array
    usual: float  # The first size, in its unit, where it happens: standard deviation of a normal prior.
    unit: str
    prior: float = 1.0  # Of the belief in it, relative to the others.
    searched: float = 1.0  # The same where it is searched for; 0 where another way in which it shows replaces it.
    # Of the first so many sizes: nearly always above 0. What is damaged pulls less, and no load is lighter than none.
    losses: int = 0
    reported: int = 1  # How many of the first sizes have the unit of the cause.
    ratio: int = 0  # 1 where the size shows as the logarithm of 1 more than that, -1 where of 1 less; 0 where as it is.

    def size(self, shown: float) -> float:
        """Turn what shows of it into its size, in its unit."""
        return float(self.ratio * np.expm1(self.ratio * shown)) if self.ratio else float(shown)

    @property
    def rotors(self) -> frozenset[str]:
        """Rotors that changed, by name."""
        first, *rest = self.name.split()
        return frozenset(rest) - {"and"} if first in ("rotor", "rotors") else frozenset()

    def holds(self, other: Cause) -> bool:
        """Check whether another change is this one, or this one with something more: a second rotor, a place.

        What is heavier needs more thrust in hover, and off its centre it moves that.
        """
        of_mass = self.name in _SEEN_IN and other.name.startswith(_SEEN_IN[self.name])
        return self.name == other.name or of_mass or (bool(self.rotors) and self.rotors < other.rotors)


_SEEN_IN = {"mass": "weight near", "hover": "mass", "centre of mass": "mass"}
"""Changes that hold more than another, by the beginnings of their names."""

_LOSS = 0.15  # Share of thrust that a damaged propeller lacks.
_OF_YAW = 0.2  # By how much its drag changes by another share than its thrust, of that share.
_RARER = 0.5  # Prior of two rotors relative to that of one.
_SHAKES = 1.0  # Logarithm of vibration relative to the reference, of something that came loose or out of balance.
_OF_AXIS = 0.5  # Of that, by how much each axis differs from the others.
_DAMAGE_SHAKES = 0.8  # Probability that a rotor which pulls less shakes otherwise too.
_HEAVIER = 0.1
_IN_WASH = 0.5  # Probability that what hangs near a rotor takes of its thrust.
_ON_ARMS = (1 / 3, 2 / 3)  # Of the way from the middle to a rotor: places of a mass, and half way between two rotors.
_OFF_CENTRE = 0.1  # Of the arm: by how much a centre of mass moves.
_ALONE = {
    "turn": (0.1, "1"),
    "unbalance": (1.0, "1"),
    "gain": (0.2, "1"),
    "delay": (0.01, "s"),
    "lag": (0.01, "s"),
    "felt": (0.5, "m/s^2"),
    "gusts": (0.7, "1"),
    "lean": (0.7, "m/s^2"),
    "drift": (0.05, "rad/s"),
    "scale": (0.1, "1"),
    "battery": (0.05, "1"),
    "axes": (0.1, "rad"),
}
"""Of kinds of which each number is a cause: how much it changes where it does, and its unit."""

_FELT = {"axes x": {"felt y": STANDARD_GRAVITY}, "axes y": {"felt x": -STANDARD_GRAVITY}}
"""What the accelerometer that turns with the gyroscope feels of gravity, m/s^2 for 1 rad."""

_ALIKE = {"delay": 0.3, "lag": 0.5, "gusts": 0.5, "unbalance": 0.5}
"""Kinds of which all numbers change at once, and the share of that by which each does so by itself."""

_BY_LOOP = ("gain", "delay")
"""Kinds whose numbers hold how the loop answers gusts, which it may do otherwise with other motors."""

_ONE_TOO = ("unbalance",)
"""Of these the kinds of which one number can change as well: rotors that turn alike are hardly separated."""

_AT_ONCE = ("lean", "drift", "axes")  # Kinds of which all numbers change at once, each by itself.


def causes(names: Sequence[str], vehicle: VehicleSettings) -> list[Cause]:
    """List what can have changed, as far as the numbers show it."""
    numbers = _Numbers(names)
    found = [*_of_thrust(numbers, vehicle)] if numbers.of_kind("thrust") else []
    if numbers.of_kind("vibration"):
        found = [each for cause in found for each in _shaken_or_not(cause, numbers)]
        # Of each rotor the balance alone.
        each = float(len(vehicle.rotors))
        found.append(Cause("vibration", np.stack(numbers.shakes, axis=1), _SHAKES, "1", each, each))
    return [*found, *(cause for kind in _ALONE for cause in _of_kind(numbers, kind))]


class _Numbers:
    """Directions in numbers by their names."""

    def __init__(self, names: Sequence[str]) -> None:
        self.names = list(names)
        vibrations = self.of_kind("vibration")
        # All axes alike, and each by itself.
        self.shakes = [
            _SHAKES * self.direction(dict.fromkeys(vibrations, 1.0)),
            *(_SHAKES * _OF_AXIS * self.direction({name: 1.0}) for name in vibrations),
        ]

    def of_kind(self, kind: str) -> list[str]:
        """List the numbers of a kind."""
        return [name for name in self.names if name.split()[0] == kind]

    def direction(self, changes: Mapping[str, float]) -> Array:
        """Give what changes, shape (number,); what is not known is left out."""
        return np.array([changes.get(name, 0.0) for name in self.names])

    def thrusts(self, of: Array) -> Array:
        """Give the shares of thrust of all rotors."""
        return self.direction({f"thrust M{index + 1}": value for index, value in enumerate(of)})


def _of_thrust(numbers: _Numbers, vehicle: VehicleSettings) -> Iterator[Cause]:
    """List the causes that shares of thrust in hover show."""
    own, thrusts = thrust_directions(vehicle), numbers.thrusts
    arms = np.array([rotor.position_m[:2] for rotor in vehicle.rotors])
    arm = float(np.linalg.norm(arms, axis=1).mean())
    lever = arms[:, ::-1] ** 2 / np.maximum((arms**2).sum(axis=0)[::-1], 1e-12)
    yaw = [_LOSS * _OF_YAW / len(arms) * thrusts(own.yaw)]
    single = []
    for index, (roll, pitch) in enumerate(lever):
        # It turns the body less too, as far as it drives roll and pitch.
        weaker = numbers.direction({"gain roll": -roll, "gain pitch": -pitch})
        single.append(_LOSS * (thrusts(own.rotor[index]) + weaker))
        yield Cause(f"rotor M{index + 1}", np.stack([single[-1], *yaw], axis=1), _LOSS, "1", losses=1, ratio=-1)
    for one, other in combinations(range(len(single)), 2):
        columns = np.stack([single[one], single[other], *yaw], axis=1)
        yield Cause(
            f"rotors M{one + 1} and M{other + 1}", columns, _LOSS, "1", _RARER, _RARER, losses=2, reported=2, ratio=-1
        )
    moved, heavier = [_OFF_CENTRE * arm * thrusts(each) for each in own.offset], _HEAVIER * thrusts(own.mass)
    yield Cause("mass", np.stack([heavier, *moved], axis=1), _HEAVIER, "1", 0.5, ratio=1)
    places = [*(share * place for place in arms for share in _ON_ARMS), *map(sum, combinations(0.5 * arms, 2))]
    for place in places:
        columns = _HEAVIER * _hung(numbers, vehicle, place)[:, None]
        yield Cause("mass", columns, _HEAVIER, "1", 0.5 / len(places), 0.0, ratio=1)
    if numbers.of_kind("swing"):
        hangs = heavier + _HEAVIER * numbers.direction({"swing": 1.0})
        # Under the middle as likely as anywhere.
        for besides in ([], moved):
            swung = np.stack([hangs, *besides], axis=1)
            yield Cause("load on a cable", swung, _HEAVIER, "1", 0.5, 0.5, losses=1)
    yield Cause("centre of mass", np.stack(moved, axis=1), _OFF_CENTRE * arm, "m", reported=2)
    yield Cause("hover", heavier[:, None], _HEAVIER, "1", ratio=1)
    share = 1 / len(arms)
    for index, place in enumerate(arms):
        # In hover hardly another thing than a rotor that pulls less, and what hangs in its wash makes it do so.
        hung, prior = _HEAVIER * _hung(numbers, vehicle, place), (1 - _IN_WASH) * share
        weight = Cause(f"weight near M{index + 1}", hung[:, None], _HEAVIER, "1", prior, share, losses=1)
        yield weight
        both = np.stack([hung, single[index]], axis=1)
        yield replace(weight, directions=both, prior=_IN_WASH * share, searched=0.0, losses=2)
    yield Cause("torque about z", _OF_YAW * thrusts(own.yaw)[:, None], _OF_YAW, "1")


def _hung(numbers: _Numbers, vehicle: VehicleSettings, place: Array) -> Array:
    """Give what a mass does that is fixed at a place, shape (number,), for as much as the vehicle's.

    By the same number it adds to the weight, moves the centre of mass, and is turned about it.
    """
    own, (x, y) = thrust_directions(vehicle), place
    moments = np.diag(symmetric(vehicle.inertia_kg_m2)) / vehicle.mass_kg
    slower = dict(zip(("roll", "pitch", "yaw"), np.array([y * y, x * x, x * x + y * y]) / moments, strict=True))
    turned = numbers.direction({f"gain {axis}": -share for axis, share in slower.items()})
    return numbers.thrusts(own.mass + x * own.offset[0] + y * own.offset[1]) + turned


def _shaken_or_not(cause: Cause, numbers: _Numbers) -> Iterator[Cause]:
    """Give a change with and without another vibration.

    Rotors that turn otherwise shake otherwise, at whatever the log's rate makes of that, and damaged ones do mostly.
    """
    damaged = bool(cause.rotors)
    shakes = _DAMAGE_SHAKES if damaged else 0.5
    searched = (1 - shakes) * cause.searched if damaged else cause.searched
    yield replace(cause, prior=(1 - shakes) * cause.prior, searched=searched)
    directions = np.column_stack([cause.directions, *numbers.shakes])
    searched = shakes * cause.searched if damaged else 0.0
    yield replace(cause, prior=shakes * cause.prior, searched=searched, directions=directions)


def _of_kind(numbers: _Numbers, kind: str) -> Iterator[Cause]:
    """List the causes of single numbers of a kind."""
    usual, unit = _ALONE[kind]
    each = [usual * numbers.direction({name: 1.0} | _FELT.get(name, {})) for name in numbers.of_kind(kind)]
    if not each:
        return
    together = np.sum(each, axis=0)
    if kind in _ALIKE:
        columns = [together, *(_ALIKE[kind] * column for column in each)]
        alone = Cause(kind, np.stack(columns, axis=1), usual, unit)
        if kind == "lag":
            answers = [
                _ALONE[other][0] * numbers.direction({name: 1.0})
                for other in _BY_LOOP
                for name in numbers.of_kind(other)
            ]
            yield replace(alone, directions=np.stack([*columns, *answers], axis=1), prior=0.5, searched=0.5)
            alone = replace(alone, prior=0.5, searched=0.5)
        yield alone
    elif kind in _AT_ONCE:
        yield Cause(kind, np.stack(each, axis=1), usual, unit, reported=len(each))
    if kind in _ONE_TOO or kind not in (*_ALIKE, *_AT_ONCE):
        for name, column in zip(numbers.of_kind(kind), each, strict=True):
            yield Cause(name, column[:, None], usual, unit)
        if kind == "turn":
            yield Cause("all motors", together[:, None], usual, unit)
