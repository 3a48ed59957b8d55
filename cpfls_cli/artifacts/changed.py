"""The artifact of what has changed about a vehicle between reference flights and those of today."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.artifacts.spec import Format, Record, columns_of, dataset, group, record, rows_of

if TYPE_CHECKING:
    from cpfls_cli.changes.judge import Change, Found
    from cpfls_cli.changes.numbers import FlightNumbers


CANNOT_TELL = "CANNOT TELL"
"""The verdict where no change would have shown, or a log is wrong."""

_BY_CHANCE = ("late", "answer", "unbalance", "swing", "battery")
"""Kinds of which a good flight can hold too little."""

_OF_LOADS = ("rotor ", "mass", "centre of mass")
"""Changes one of which has to have a size where loads are compared, by the beginnings of their names."""

CABLE = "load on a cable"
"""The change that has a length."""


@record
class FoundGroup:
    """Changes that were found, each in what the others leave."""

    cause: tuple[str, ...] = dataset("what changed, as a key: rotor M3", "found")
    unit: tuple[str, ...] = dataset("unit of its sizes", "found")
    belief: Array = dataset("how sure that is beside others in its place", "found")


@record
class SizesGroup:
    """Sizes of the changes that were found: of some there are several, by axis or rotor."""

    found: IntArray = dataset("index of the change", "size", into="found")
    value: Array = dataset("by how much, in its unit", "size")
    low: Array = dataset("lower end of its 95 % interval", "size")
    high: Array = dataset("upper end", "size")


@record
class AlikeGroup:
    """Changes that would look alike."""

    found: IntArray = dataset("index of the change in whose place it could be", "alike", into="found")
    cause: tuple[str, ...] = dataset("what it would be", "alike")
    belief: Array = dataset("how sure that is", "alike")


@record
class ShowsGroup:
    """What would show."""

    cause: tuple[str, ...] = dataset("change that is looked for", "cause")
    unit: tuple[str, ...] = dataset("unit of its size", "cause")
    smallest: Array = dataset("smallest size that shows with 90 %; not finite where none does", "cause", gaps=True)


@record
class FoundRecord(Record):
    """What an artifact of changes holds, however many times flights were held against others."""

    number: tuple[str, ...] = dataset("numbers that all flights tell: kind, and rotor, axis or sensor", "number")
    unit: tuple[str, ...] = dataset("unit of each number", "number")
    false_alarm: float = dataset("probability below which the vehicle is said to have changed")
    named_from: float = dataset("belief from which on a change is named, and not one of several")
    found: FoundGroup = group()
    size: SizesGroup = group()
    alike: AlikeGroup = group()
    shows: ShowsGroup = group()
    warning: tuple[str, ...] = dataset("what to know about the flights", "warning")
    unlike: tuple[str, ...] = dataset(
        "where logs state another board, version or range of outputs than the first", "unlike", default=()
    )
    ranges: tuple[str, ...] = dataset(
        "flights whose commands are shares of another range than the first flight's", "ranges", default=()
    )

    @property
    def loads_show(self) -> bool:
        """Whether a rotor, a mass or its centre would have shown, where loads are compared."""
        if not any(name.startswith("load ") for name in self.number):
            return True
        sizes = zip(self.shows.cause, self.shows.smallest.tolist(), strict=True)
        return any(cause.startswith(_OF_LOADS) and np.isfinite(size) for cause, size in sizes)

    @property
    def has_size(self) -> bool:
        """Whether what is looked for would have shown: where loads are compared, a change of these."""
        return self.loads_show and bool(np.isfinite(self.shows.smallest).any())

    @property
    def cable_length(self) -> float:
        """Length of the cable of a load, m; NaN where nothing tells it."""
        return float("nan")

    @property
    def named(self) -> BoolArray:
        """Whether each change that was found is named, shape (found,)."""
        return np.asarray(self.found.belief >= self.named_from)

    def sizes(self, index: int) -> list[tuple[float, float, float]]:
        """Give the sizes of a change that was found with their intervals, in its unit."""
        own = self.size.found == index
        return [tuple(row) for row in np.stack([self.size.value, self.size.low, self.size.high], axis=1)[own].tolist()]

    def others(self, index: int) -> list[tuple[str, float]]:
        """List what would look alike, and how sure each is."""
        rows = zip(self.alike.found, self.alike.cause, self.alike.belief.tolist(), strict=True)
        return [(cause, belief) for of, cause, belief in rows if of == index]

    def cause(self, index: int) -> dict[str, Any]:
        """Tell a change that was found to machines."""
        return {
            "name": self.found.cause[index],
            "named": bool(self.named[index]),
            "belief": float(self.found.belief[index]),
            "unit": self.found.unit[index],
            "sizes": [dict(zip(("value", "low", "high"), each, strict=True)) for each in self.sizes(index)],
            "alike": dict(self.others(index)),
            **({"cable_m": self.cable_length} if self.found.cause[index] == CABLE else {}),
        }


@record
class ChangedRecord(FoundRecord):
    """The artifact `cpfls/changed`."""

    FORMAT: ClassVar = Format(
        "cpfls/changed",
        "what has changed about a vehicle between reference flights and flights of today",
        "changed",
        ("today", "since"),
    )

    today: tuple[str, ...] = dataset("names of today's flights, in the order given", "today")
    before: tuple[str, ...] = dataset("names of the reference flights", "before")
    commanded: bool = dataset("1 where loads are of commands, 0 where they are of speeds that were measured")
    mean: Array = dataset("mean of the reference flights, in its unit", "number")
    deviation: Array = dataset("what flights of one day differ by from it where nothing changed", "number")
    apart: Array = dataset("today's flights less the mean; loads at the reference's voltage", "today", "number")
    scatter: Array = dataset("reference flights less the mean, alike", "before", "number")
    hover: float = dataset("what the loads of all rotors have in common of that, logarithm", gaps=True)
    hover_deviation: float = dataset("what that differs by where nothing changed", gaps=True)
    cable: Array = dataset(
        "length of the cable that fits best what swings, if anything does", "today", units="m", gaps=True
    )
    p_value: float = dataset("probability that flights of an unchanged vehicle look as much like any change")
    by_flight: Array = dataset("the same of each flight of today alone", "today")
    limit: Array | None = dataset(
        "deviations beyond which the mean of today's flights is in no number where nothing changed, but for the rate "
        "of false alarms",
        "number",
        default=None,
    )
    reversed: tuple[str, ...] = dataset(
        "numbers that every reference flight has, and that a flight of today has turned round, or as nothing",
        "reversed",
        default=(),
    )
    missing: tuple[str, ...] = dataset(
        "other numbers that every reference flight has, and not every one of today", "missing", default=()
    )
    undetermined: tuple[str, ...] = dataset(
        "ratios among these that are likelier zero or reversed today than what they are in the reference",
        "undetermined",
        default=(),
    )
    contradiction: tuple[str, ...] = dataset(
        "what of the flights contradicts itself or its vehicle", "contradiction", default=()
    )
    since_flight: int = dataset("index of the flight of today from which on it looks most as if it had changed")
    fewest: int | None = dataset(
        "reference flights that tell what flights of the vehicle differ by; of fewer, what is usual stands for it",
        default=None,
    )

    @classmethod
    def of(
        cls,
        change: Change,
        today: Sequence[FlightNumbers],
        before: Sequence[FlightNumbers],
        units: Mapping[str, str],
        warnings: Sequence[str],
        contradictions: Sequence[str],
        *,
        false_alarm: float,
        named_from: float,
        fewest: int,
        unlike: Sequence[str] = (),
        ranges: Sequence[str] = (),
    ) -> Self:
        """Arrange a change, with the units of its numbers and causes by name."""
        hover, hover_deviation = _in_common(change, today)
        return cls(
            today=tuple(flight.name for flight in today),
            before=tuple(flight.name for flight in before),
            commanded=today[0].commanded,
            number=change.names,
            unit=tuple(units[name] for name in change.names),
            mean=change.reference.mean,
            deviation=change.deviation,
            apart=change.apart,
            scatter=change.reference.apart(before)[0],
            hover=hover,
            hover_deviation=hover_deviation,
            cable=np.array([flight.cable_m for flight in today]),
            p_value=change.p_value,
            by_flight=change.by_flight,
            since_flight=change.since,
            limit=change.limit,
            reversed=change.reversed,
            missing=change.missing,
            undetermined=change.undetermined,
            contradiction=tuple(contradictions),
            false_alarm=false_alarm,
            named_from=named_from,
            fewest=fewest,
            unlike=tuple(unlike),
            ranges=tuple(ranges),
            **found_groups(change.found, change.shows, units),
            warning=tuple(warnings),
        )

    @property
    def changed(self) -> bool:
        """Whether the vehicle is said to have changed: never not where a number is beyond its limit."""
        return self.p_value <= self.false_alarm or bool(self.reversed) or bool(self.beyond.any())

    @property
    def furthest(self) -> Array:
        """Deviations by which the mean of today's flights is off in each number, shape (number,)."""
        return np.asarray(self.apart.mean(axis=0) / self.deviation)

    @property
    def beyond(self) -> BoolArray:
        """Whether the mean of today's flights is beyond the limit of each number, shape (number,)."""
        return np.asarray(np.abs(self.furthest) > (np.inf if self.limit is None else self.limit))

    @property
    def loads_differ(self) -> float:
        """By which share a load differs within the reference at most; 0 of one flight."""
        loads = [name.startswith("load ") for name in self.number]
        return float(np.expm1(np.ptp(self.scatter[:, loads], axis=0).max(initial=0.0)))

    @property
    def short_of(self) -> int:
        """How many more reference flights would tell what flights differ by, which is assumed without them."""
        return max((self.fewest or 0) - len(self.before), 0)

    @property
    def verdict(self) -> str:
        """What is said first: that nothing changed only of good logs, and where a change would have shown."""
        if self.changed:
            return "CHANGED"
        if self.contradiction or self.undetermined or not self.has_size:
            return CANNOT_TELL
        return "NO CHANGE SEEN" if self.short_of or self.lost or self.ranges else "NO CHANGE"

    @property
    def lost(self) -> list[str]:
        """Numbers that today's flights lack, and not by the chance of a flight that holds too little of them."""
        return [name for name in self.missing if name.split()[0] not in _BY_CHANCE]

    @property
    def since(self) -> int | None:
        """Index of today's flight from which on it is changed; None where it is not."""
        return self.since_flight if self.changed else None

    @property
    def hover_changed(self) -> bool:
        """Whether hover needs another thrust than in the reference, beyond 95 % of what it differs by."""
        return bool(abs(self.hover) > 1.96 * self.hover_deviation)

    @property
    def cable_length(self) -> float:
        """Length of the cable of a load, m, over all flights of today; NaN where none tells it."""
        known = self.cable[np.isfinite(self.cable)]
        return float(np.median(known)) if len(known) else np.nan

    @property
    def summary(self) -> dict[str, Any]:
        """What changed for machines."""
        since = self.since
        return {
            "verdict": self.verdict,
            "changed": self.changed,
            "reference_flights_lacking": self.short_of,
            "beyond_limit": [name for name, is_beyond in zip(self.number, self.beyond, strict=True) if is_beyond],
            "reversed": list(self.reversed),
            "missing": list(self.missing),
            "undetermined": list(self.undetermined),
            "stated_otherwise": list(self.unlike),
            "other_ranges": list(self.ranges),
            "contradictions": list(self.contradiction),
            "p": self.p_value,
            "by_flight": dict(zip(self.today, self.by_flight.tolist(), strict=True)),
            "since": None if since is None else self.today[since],
            "causes": [self.cause(index) for index in range(len(self.found.cause))],
            "shows": rows_of(self.shows),
            "reference_flights": list(self.before),
            "numbers": {
                name: {
                    "unit": self.unit[index],
                    "reference": float(self.mean[index]),
                    "deviation": float(self.deviation[index]),
                    "limit": None if self.limit is None else float(self.limit[index] * self.deviation[index]),
                    "today": (self.mean[index] + self.apart[:, index]).tolist(),
                }
                for index, name in enumerate(self.number)
            },
            "warnings": list(self.warning),
        }


def _in_common(change: Change, today: Sequence[FlightNumbers]) -> tuple[float, float]:
    loads = np.array([name.startswith("load ") for name in change.names])
    if not loads.any():
        return np.nan, np.nan
    apart, covariance = change.reference.apart(today)
    mean = loads / loads.sum()
    return float((apart @ mean).mean()), float(np.sqrt(mean @ covariance @ mean))


def found_groups(found: Sequence[Found], shows: Mapping[str, float], units: Mapping[str, str]) -> dict[str, Any]:
    """Arrange changes that were found, and what would show, with the units of causes by name."""
    sizes = [(index, size) for index, each in enumerate(found) for size in each.sizes]
    alike = [(index, *other) for index, each in enumerate(found) for other in each.alike]
    return {
        "found": FoundGroup(
            cause=tuple(each.cause.name for each in found),
            unit=tuple(each.cause.unit for each in found),
            belief=np.array([each.belief for each in found]),
        ),
        "size": columns_of(
            SizesGroup, (size for _, size in sizes), found=np.array([index for index, _ in sizes], dtype=np.int64)
        ),
        "alike": AlikeGroup(
            found=np.array([index for index, _, _ in alike], dtype=np.int64),
            cause=tuple(cause for _, cause, _ in alike),
            belief=np.array([belief for _, _, belief in alike]),
        ),
        "shows": ShowsGroup(
            cause=tuple(shows),
            unit=tuple(units[name] for name in shows),
            smallest=np.array(list(shows.values())),
        ),
    }
