"""The artifact of many flights of a vehicle in time: numbers, their band, and where they change."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.artifacts.changed import CANNOT_TELL, FoundRecord, found_groups
from cpfls_cli.artifacts.spec import Format, dataset, group, record, rows_of

if TYPE_CHECKING:
    from cpfls_cli.changes.trend import Trend


@record
class ShiftGroup:
    """Change points: flights from which on the vehicle is another one, each beside the flights before."""

    start: IntArray = dataset("index of the first flight that is changed", "shift", into="flight")
    p_value: Array = dataset(
        "probability that flights of an unchanged vehicle look as much like any of the changes that are known", "shift"
    )


@record
class TrendRecord(FoundRecord):
    """The artifact `cpfls/trend`."""

    FORMAT: ClassVar = Format(
        "cpfls/trend", "numbers of many flights of a vehicle in time, and where they change", "trend", ("flight",)
    )

    flight: tuple[str, ...] = dataset("names of the flights, in time order", "flight")
    flown_at: Array = dataset(
        "when each was flown, since 1970 began (UTC), where the log tells", "flight", units="s", gaps=True
    )
    order: str = dataset("what the order is by: date, name, or given")
    reference: int = dataset("number of flights, the first ones, that are the reference")
    mean: Array = dataset("mean of the reference flights, in its unit", "number")
    apart: Array = dataset("each flight less the mean; loads at the reference's voltage", "flight", "number")
    deviation: Array = dataset(
        "what a flight differs by from the mean where nothing changed", "flight", "number", least=0.0
    )
    limit: float = dataset(
        "deviations beyond which no number of any flight is where nothing changed, but for the rate of false alarms"
    )
    p_value: float = dataset("probability that as many flights of an unchanged vehicle look as much as if it changed")
    reversed: tuple[str, ...] = dataset(
        "flights that have numbers of the others turned round, or as nothing, and which", "reversed", default=()
    )
    contradiction: tuple[str, ...] = dataset(
        "what of the flights contradicts itself or its vehicle", "contradiction", default=()
    )
    shift: ShiftGroup = group()
    shifts: IntArray = dataset(
        "index of the change point of each change that was found", "found", path="found/shift", into="shift"
    )

    @classmethod
    def of(
        cls,
        trend: Trend,
        flown_at: Sequence[float],
        order: str,
        units: Mapping[str, str],
        warnings: Sequence[str],
        contradictions: Sequence[str],
        *,
        false_alarm: float,
        named_from: float,
        unlike: Sequence[str] = (),
        ranges: Sequence[str] = (),
    ) -> Self:
        """Arrange a trend, with the units of its numbers and causes by name."""
        found = [(index, each) for index, shift in enumerate(trend.shifts) for each in shift.change.found]
        return cls(
            flight=tuple(flight.name for flight in trend.flights),
            flown_at=np.array(flown_at),
            order=order,
            reference=trend.reference,
            number=trend.names,
            unit=tuple(units[name] for name in trend.names),
            mean=trend.mean,
            apart=trend.apart,
            deviation=trend.deviation,
            limit=trend.limit,
            p_value=trend.p_value,
            reversed=trend.reversed,
            contradiction=tuple(contradictions),
            false_alarm=false_alarm,
            named_from=named_from,
            shift=ShiftGroup(
                start=np.array([shift.start for shift in trend.shifts], dtype=np.int64),
                p_value=np.array([shift.change.p_value for shift in trend.shifts]),
            ),
            shifts=np.array([index for index, _ in found], dtype=np.int64),
            unlike=tuple(unlike),
            ranges=tuple(ranges),
            **found_groups([each for _, each in found], trend.shows, units),
            warning=tuple(warnings),
        )

    @property
    def changed(self) -> bool:
        """Whether anything is said to have changed: never not where a flight is beyond a limit."""
        return len(self.shift.start) > 0 or bool(self.reversed) or bool(self.beyond.any())

    @property
    def verdict(self) -> str:
        """What is said first: that nothing changed only of good logs, and where a change would have shown."""
        if self.changed:
            return "CHANGED"
        return CANNOT_TELL if self.contradiction or self.ranges or not self.has_size else "NO CHANGE"

    @property
    def values(self) -> Array:
        """Numbers of each flight, loads at the reference's voltage, shape (flight, number)."""
        return np.asarray(self.mean + self.apart)

    @property
    def beyond(self) -> BoolArray:
        """Whether each number is beyond its limits, shape (flight, number); those of the reference made them."""
        return np.asarray(np.abs(self.apart) > self.limit * self.deviation)

    @property
    def parts(self) -> list[tuple[int, int]]:
        """Flights between change points, first and one after the last, the part before the first among them."""
        bounds = [0, *self.shift.start.tolist(), len(self.flight)]
        return list(pairwise(bounds))

    def causes(self, shift: int) -> list[int]:
        """List the changes that were found at a change point."""
        return [int(index) for index in np.flatnonzero(self.shifts == shift)]

    def moved(self, shift: int) -> Array:
        """Compute by how much numbers change at a change point, in deviations, shape (number,)."""
        (first, start), (_, end) = self.parts[shift], self.parts[shift + 1]
        step = self.apart[start:end].mean(axis=0) - self.apart[first:start].mean(axis=0)
        return np.asarray(step / self.deviation[start:end].mean(axis=0))

    @property
    def rows(self) -> Iterator[dict[str, Any]]:
        """The flights one by one: name, date, whether it is of the reference, after how many change points."""
        for index, name in enumerate(self.flight):
            yield {
                "flight": name,
                "flown_at_s": float(self.flown_at[index]),
                "reference": index < self.reference,
                "part": int((self.shift.start <= index).sum()) + 1,
                "numbers": dict(zip(self.number, self.values[index].tolist(), strict=True)),
                "beyond": [self.number[at] for at in np.flatnonzero(self.beyond[index])],
            }

    @property
    def summary(self) -> dict[str, Any]:
        """The trend for machines."""
        return {
            "verdict": self.verdict,
            "changed": self.changed,
            "p": self.p_value,
            "order": self.order,
            "reference_flights": list(self.flight[: self.reference]),
            "limit": self.limit,
            "reversed": list(self.reversed),
            "contradictions": list(self.contradiction),
            "shifts": [
                {
                    "since": self.flight[start],
                    "flight": start + 1,
                    "flown_at_s": float(self.flown_at[start]),
                    "p": float(self.shift.p_value[index]),
                    "causes": [self.cause(at) for at in self.causes(index)],
                    "deviations": dict(zip(self.number, self.moved(index).tolist(), strict=True)),
                }
                for index, start in enumerate(self.shift.start.tolist())
            ],
            "shows": rows_of(self.shows),
            "numbers": {
                name: {
                    "unit": self.unit[index],
                    "reference": float(self.mean[index]),
                    "deviation": float(self.deviation[-1, index]),
                }
                for index, name in enumerate(self.number)
            },
            "flights": list(self.rows),
            "warnings": list(self.warning),
        }
