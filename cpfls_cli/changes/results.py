"""What flights say of changes of their vehicle: since reference flights, and over many flights in time."""

from typing import ClassVar

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.result import Estimate, about, part, result

CANNOT_TELL = "CANNOT TELL"  # The verdict where no change could have been detected, or a log is wrong.
# Kinds of which a good flight can hold too little.
_BY_CHANCE = ("delay", "lag", "unbalance", "swing", "axes", "battery")
_OF_THRUST = ("rotor ", "mass", "centre of mass")
"""Changes one of which has to have a size where shares of thrust are compared, by the beginnings of their names."""

_OF_AIR = ("gusts", "lean")  # Kinds that go with the weather.
CABLE = "load on a cable"  # The change that has a length.


@result
class Alike:
    """A change that would look alike."""

    name: str = about("what it would be, as a key")
    belief: float = about("how sure that is")


@result
class Found:
    """A change that was found, in what the others leave."""

    name: str = about("what changed, as a key: rotor M3")
    named: bool = about("whether it is named, and not one of several that look alike")
    belief: float = about("how sure that is against others in its place; of one rotor with pairs it is one of")
    unit: str = about("unit of its sizes")
    cable_m: float | None = about("length of the cable of a load", unit="m", gaps=True, default=None)
    sizes: tuple[Estimate, ...] = part()
    alike: tuple[Alike, ...] = part()

    @property
    def of_air(self) -> bool:
        """Whether it is the air that changed, and nothing of the vehicle."""
        return self.name.partition(" ")[0] in _OF_AIR


@result
class Shows:
    """The smallest change of a kind that shows."""

    cause: str = about("change that is looked for")
    unit: str = about("unit of its size")
    smallest: float = about("smallest size that shows with 90 %; not finite where none does", gaps=True)


@result
class Number:
    """A number that all flights have."""

    name: str = about("kind, and rotor, axis or sensor: thrust M3")
    unit: str = about("its unit; 1 of the logarithm of a ratio")
    reference: float = about("mean of the reference flights")


@result
class Compared:
    """What flights say of their vehicle against a reference."""

    p: float = about("probability that flights of an unchanged vehicle look as much changed")
    false_alarm: float = about("probability below which the vehicle is said to have changed")
    reversed: tuple[str, ...] = about("what is reversed or zero, and is not in the reference", "reversed", default=())
    contradictions: tuple[str, ...] = about("what contradicts itself or its vehicle", "contradiction", default=())
    stated_otherwise: tuple[str, ...] = about(
        "where logs state another board, version or range of outputs than the first", "unlike", default=()
    )
    other_ranges: tuple[str, ...] = about(
        "flights whose commands are shares of another range than the first flight's", "ranges", default=()
    )
    numbers: tuple[Number, ...] = part()
    shows: tuple[Shows, ...] = part()
    warnings: tuple[str, ...] = about("what to know about the flights", "warning", default=())

    @property
    def thrust_shows(self) -> bool:
        """Whether a rotor, a mass or its centre has a detection limit, where shares of thrust are compared."""
        if not any(each.name.startswith("thrust ") for each in self.numbers):
            return True
        return any(each.cause.startswith(_OF_THRUST) and np.isfinite(each.smallest) for each in self.shows)

    @property
    def has_size(self) -> bool:
        """Whether what is looked for has a detection limit: where shares of thrust are compared, a change of these."""
        return self.thrust_shows and any(np.isfinite(each.smallest) for each in self.shows)


@result
class NumberToday(Number):
    """A number of today's flights against the reference; shares of thrust at the voltage of the reference."""

    deviation: float = about("what flights of one day differ by from the reference where nothing changed")
    limit: float = about("how far the mean of today is off at most where nothing changed, but for false alarms")
    today: Array = about("of each flight of today", "today")
    before: Array = about("of each reference flight", "before", brief=False)

    @property
    def deviations(self) -> float:
        """Deviations by which the mean of today's flights is off."""
        return float((self.today.mean() - self.reference) / self.deviation)

    @property
    def beyond(self) -> bool:
        """Whether the mean of today's flights is beyond its limit."""
        return abs(self.deviations) > self.limit / self.deviation


@result
class Changed(Compared):
    """What has changed about a vehicle between reference flights and flights of today."""

    FORMAT: ClassVar = "cpfls/changed"
    SHOWN: ClassVar = ("verdict", "changed", "since", "reference_flights_lacking", "beyond_limit")

    today: tuple[str, ...] = about("names of today's flights, in the order given", "today")
    reference_flights: tuple[str, ...] = about("names of the reference flights", "before")
    commanded: bool = about("whether shares of thrust are of commands, and not of speeds that were measured")
    by_flight: Array = about("the probability `p` of each flight of today alone", "today")
    since_flight: int = about("index of the flight of today from which on it looks most as if it had changed", least=0)
    hover: float = about("mean share of thrust, today less the reference, logarithm", gaps=True)
    hover_deviation: float = about("what that differs by where nothing changed", gaps=True)
    fewest: int = about("reference flights that say what flights differ by; of fewer, what is usual replaces that")
    missing: tuple[str, ...] = about(
        "other numbers that every reference flight has, and not every one of today", "missing", default=()
    )
    undetermined: tuple[str, ...] = about(
        "ratios among these that are likelier zero or reversed today than what they are in the reference",
        "undetermined",
        default=(),
    )
    numbers: tuple[NumberToday, ...] = part()
    causes: tuple[Found, ...] = part()

    @property
    def changed(self) -> bool:
        """Whether the vehicle is said to have changed: never not where a number is beyond its limit."""
        return self.p <= self.false_alarm or bool(self.reversed) or bool(self.beyond_limit)

    @property
    def beyond_limit(self) -> list[str]:
        """Numbers of which the mean of today's flights is beyond its limit."""
        return [each.name for each in self.numbers if each.beyond]

    @property
    def thrusts_differ(self) -> float:
        """By how much a share of thrust differs within the reference at most; 0 of one flight."""
        shares = [np.ptp(each.before) for each in self.numbers if each.name.startswith("thrust ")]
        return float(np.expm1(max(shares, default=0.0)))

    @property
    def reference_flights_lacking(self) -> int:
        """How many more reference flights would say what flights differ by, which is assumed without them."""
        return max(self.fewest - len(self.reference_flights), 0)

    @property
    def verdict(self) -> str:
        """What is said first: that nothing changed only of good logs, and where a change could have been detected."""
        if self.changed:
            return "CHANGED"
        if self.contradictions or self.undetermined or not self.has_size:
            return CANNOT_TELL
        return "NO CHANGE SEEN" if self.reference_flights_lacking or self.lost or self.other_ranges else "NO CHANGE"

    @property
    def lost(self) -> list[str]:
        """Numbers that today's flights lack, and not by the chance of a flight that holds too little of them."""
        return [name for name in self.missing if name.split()[0] not in _BY_CHANCE]

    @property
    def since(self) -> str | None:
        """Today's flight from which on it is changed; None where it is not."""
        return self.today[self.since_flight] if self.changed else None

    @property
    def hover_changed(self) -> bool:
        """Whether hover needs another thrust than in the reference, beyond 95 % of what it differs by."""
        return abs(self.hover) > 1.96 * self.hover_deviation


@result
class NumberInTime(Number):
    """A number over the flights; shares of thrust at the voltage of the reference."""

    values: Array = about("of each flight", "flight")
    deviation: Array = about("what each flight differs by from the reference where nothing changed", "flight", least=0)
    limit: float = about("deviations beyond which no flight is where nothing changed, but for false alarms")

    @property
    def deviations(self) -> Array:
        """Deviations by which each flight is off the reference, shape (flight,)."""
        return np.asarray((self.values - self.reference) / self.deviation)


@result
class FlightInTime:
    """A flight of a trend."""

    flight: str = about("its name")
    flown_at_s: float = about("when it was flown, since 1970 began (UTC), where the log has that", unit="s", gaps=True)
    reference: bool = about("whether it is one of the reference")
    part: int = about("number of change points up to it, and one", least=1)
    beyond: tuple[str, ...] = about("numbers that are beyond their limits", "beyond")


@result
class Shift:
    """A change point: the flights from it on against those from the one before."""

    since: str = about("first flight that is changed")
    flight: int = about("its number, from 1", least=1)
    flown_at_s: float = about("when it was flown", unit="s", gaps=True)
    p: float = about("probability that flights of an unchanged vehicle look as much like any change that is known")
    deviations: Array = about("by how much each number changes, in deviations", "number")
    causes: tuple[Found, ...] = part()


@result
class Trend(Compared):
    """Numbers of many flights of a vehicle in time, and where they change."""

    FORMAT: ClassVar = "cpfls/trend"
    SHOWN: ClassVar = ("verdict", "changed", "reference_flights")

    order: str = about("what the order is by: date, name, or given", default="given")
    left_out: tuple[str, ...] = about("flights that lack some of the numbers", "left out", default=())
    flights: tuple[FlightInTime, ...] = part()
    numbers: tuple[NumberInTime, ...] = part()
    shifts: tuple[Shift, ...] = part()

    @property
    def changed(self) -> bool:
        """Whether anything is said to have changed: never not where a flight is beyond a limit."""
        return bool(self.shifts) or bool(self.reversed) or any(each.beyond for each in self.flights)

    @property
    def verdict(self) -> str:
        """What is said first: that nothing changed only of good logs, and where a change could have been detected."""
        if self.changed:
            return "CHANGED"
        return CANNOT_TELL if self.contradictions or self.other_ranges or not self.has_size else "NO CHANGE"

    @property
    def reference_flights(self) -> list[str]:
        """Names of the first flights, which are the reference."""
        return [each.flight for each in self.flights if each.reference]

    @property
    def deviations(self) -> Array:
        """Deviations by which each flight is off the reference, shape (flight, number)."""
        return np.stack([each.deviations for each in self.numbers], axis=1)
