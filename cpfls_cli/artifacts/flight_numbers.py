"""The artifact of what one flight tells of its vehicle in numbers, made once and kept."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.flight import StatedGroup
from cpfls_cli.artifacts.spec import Format, Record, dataset, group, record

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from cpfls_cli.changes.numbers import FlightNumbers


@record
class FlightNumbersRecord(Record):
    """The artifact `cpfls/flight-numbers`."""

    FORMAT: ClassVar = Format(
        "cpfls/flight-numbers",
        "what one flight tells of its vehicle in numbers that other flights of it tell alike",
        "changed",
        ("flight",),
    )

    flight: str = dataset("name of the flight")
    number: tuple[str, ...] = dataset("its kind, and the rotor, axis or sensor that it is of: load M3", "number")
    unit: tuple[str, ...] = dataset("unit of each number", "number")
    value: Array = dataset("each number, in its unit", "number")
    error: Array = dataset("its standard error, over blocks of the flight, in its unit", "number", least=0.0)
    voltage: float = dataset(
        "mean of the battery in flight, V, or a share of a full one where the flight states that", gaps=True
    )
    duration: float = dataset("time that it flies, away from take-off and landing", units="s")
    period: float = dataset("time from sample to sample", units="s")
    commanded: bool = dataset("1 where the loads are of commands, 0 where they are of speeds that were measured")
    cable: float = dataset(
        "length of the cable that fits best what swings under it, if anything does", units="m", gaps=True
    )
    agility: float = dataset(
        "acceleration that it is flown with beside the mean, root mean square", units="m/s^2", gaps=True
    )
    flown_at: float = dataset("when it was flown, since 1970 began (UTC), where the log tells", units="s", gaps=True)
    code: str = dataset("hash of the code that computed it: other code computes it anew")
    reversed: tuple[str, ...] = dataset(
        "numbers whose ratio is zero or below, where another flight has its logarithm: a sensor or a rotor that is "
        "still, or turned round",
        "reversed",
        default=(),
    )
    unsure: tuple[str, ...] = dataset(
        "numbers whose ratio may be zero, so that they are not told", "unsure", default=()
    )
    unsure_ratio: Array | None = dataset("these ratios", "unsure", default=None)
    contradiction: tuple[str, ...] = dataset(
        "what of the flight contradicts itself or its vehicle", "contradiction", default=()
    )
    stated: StatedGroup | None = group(default=None)
    warning: tuple[str, ...] = dataset("what to know about the flight", "warning")

    @classmethod
    def of(
        cls,
        told: FlightNumbers,
        units: Sequence[str],
        period: float,
        flown_at: float,
        code: str,
        warnings: Sequence[str],
        contradictions: Sequence[str],
        stated: Mapping[str, str],
    ) -> Self:
        """Arrange the numbers of a flight."""
        return cls(
            flight=told.name,
            number=tuple(told.values),
            unit=tuple(units),
            value=np.array(list(told.values.values())),
            error=np.array([told.errors[name] for name in told.values]),
            voltage=told.voltage,
            duration=told.duration_s,
            period=period,
            commanded=told.commanded,
            cable=told.cable_m,
            agility=told.agility,
            flown_at=flown_at,
            code=code,
            reversed=told.reversed,
            unsure=tuple(told.unsure),
            unsure_ratio=np.array(list(told.unsure.values())),
            contradiction=tuple(contradictions),
            stated=StatedGroup.of(stated),
            warning=tuple(warnings),
        )

    @property
    def summary(self) -> dict[str, Any]:
        """The numbers for machines."""
        rows = zip(self.number, self.value.tolist(), self.error.tolist(), self.unit, strict=True)
        return {
            "flight": self.flight,
            "flown_at_s": self.flown_at,
            "duration_s": self.duration,
            "voltage": self.voltage,
            "commanded": self.commanded,
            "reversed": list(self.reversed),
            "contradictions": list(self.contradiction),
            "stated": {} if self.stated is None else self.stated.facts,
            "numbers": {name: {"value": value, "error": error, "unit": unit} for name, value, error, unit in rows},
        }
