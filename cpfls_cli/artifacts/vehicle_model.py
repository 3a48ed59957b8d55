"""The artifact of a vehicle found in flights: a model, what was free in it, and how it was chosen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.artifacts.learned import LearnedGroup
from cpfls_cli.artifacts.model import ModelRecord, VehicleGroup
from cpfls_cli.artifacts.parameters import parameters_of
from cpfls_cli.artifacts.replay import HeldOutGroup, trust_by_playback
from cpfls_cli.artifacts.spec import BODY, Format, columns_of, dataset, group, record, rows_of
from cpfls_cli.validation.trust import Trust, capped

if TYPE_CHECKING:
    # Reading a record does not need the compiled loops that play a vehicle back.
    from cpfls_cli.playback.loop import LoopBounds
    from cpfls_cli.playback.structure import Choice
    from cpfls_cli.playback.vehicle import FoundVehicle


@record
class FoundNumbersGroup:
    """The numbers that were free, with 95 % intervals."""

    name: tuple[str, ...] = dataset("name", "block and number", "found")
    unit: tuple[str, ...] = dataset("unit", "empty for a ratio", "found")
    value: Array = dataset("value", "estimate", "found", units="SI")
    low: Array = dataset("low", "lower end of the 95 % interval", "found", units="SI")
    high: Array = dataset("high", "upper end of the 95 % interval", "found", units="SI")
    stated: Array = dataset("stated", "in /config; not finite where no config does", "found", units="SI", gaps=True)
    determined: BoolArray = dataset("determined", "1 where the flights say more than what was believed before", "found")
    at_bound: BoolArray = dataset("at_bound", "1 where it lies on a bound, so that the interval says little", "found")


@record
class TradesGroup:
    """Pairs of numbers that the flights cannot tell apart."""

    first: tuple[str, ...] = dataset("first", "one number", "trade")
    second: tuple[str, ...] = dataset("second", "the other", "trade")
    correlation: Array = dataset("correlation", "of the two estimates", "trade")


@record
class SharesGroup:
    """How much each part of the model does along the training flights."""

    name: tuple[str, ...] = dataset("name", "rotors, an effect, or remainder", "part")
    torque: Array = dataset("torque", "root mean square", "part", "axis", units="N m", frame=BODY)
    force: Array = dataset("force", "root mean square", "part", "axis", units="N", frame=BODY)


@record
class StructuresTriedGroup:
    """Structures of the Pareto front and the baselines, each judged on the flights kept aside."""

    name: tuple[str, ...] = dataset("name", "chosen, best, greedy, everything, nothing, or front", "structure")
    blocks: tuple[str, ...] = dataset("blocks", "its blocks, one space between two", "structure")
    error: Array = dataset("error", "mean error of the windows kept aside; about 1.1 for rates that stay", "structure")
    worse: Array = dataset("worse", "error less that of the best", "structure")
    uncertain: Array = dataset("uncertain", "standard error of that difference", "structure")
    numbers: IntArray = dataset("numbers", "free numbers", "structure")
    condition_number: Array = dataset("condition_number", "of the numbers in their natural sizes", "structure")

    @classmethod
    def of(cls, choice: Choice) -> Self:
        """Arrange a choice."""
        baselines = ("chosen", "best", "greedy", "everything", "nothing")
        listed = [*((name, getattr(choice, name)) for name in baselines), *(("front", each) for each in choice.front)]
        differences = [judged.worse_than(choice.best) for _, judged in listed]
        return cls(
            name=tuple(name for name, _ in listed),
            blocks=tuple(" ".join(judged.structure.blocks) for _, judged in listed),
            error=np.array([judged.error for _, judged in listed]),
            worse=np.array([worse for worse, _ in differences]),
            uncertain=np.array([uncertain for _, uncertain in differences]),
            numbers=np.array([judged.numbers for _, judged in listed], dtype=np.int64),
            condition_number=np.array([judged.condition_number for _, judged in listed]),
        )


@record
class DifferencesGroup:
    """What other configurations have that the vehicle has not, with 95 % intervals."""

    name: tuple[str, ...] = dataset("name", "configuration, and what differs", "difference")
    unit: tuple[str, ...] = dataset("unit", "of the difference", "difference")
    value: Array = dataset("value", "estimate", "difference", units="SI")
    low: Array = dataset("low", "lower end of the 95 % interval", "difference", units="SI")
    high: Array = dataset("high", "upper end of the 95 % interval", "difference", units="SI")


@record
class LoopGroup:
    """How far an autopilot that answers what disturbs the vehicle may have misled the fit, about each body axis."""

    low: Array = dataset("low", "factor on the moment of inertia", "axis", frame=BODY, gaps=True)
    high: Array = dataset("high", "factor on the moment of inertia", "axis", frame=BODY, gaps=True)
    explained: Array = dataset(
        "explained", "share of the rotation in a band that torque explains, the least", "axis", frame=BODY, gaps=True
    )
    shown: bool = dataset("shown", "1 where so little is explained that the numbers may be those of the loop")

    @classmethod
    def of(cls, bounds: LoopBounds) -> Self:
        """Arrange bounds."""
        return cls(**bounds._asdict(), shown=bounds.shows_loop)


@record
class VehicleRecord(ModelRecord):
    """The artifact `cpfls/model` of a vehicle found in flights."""

    FORMAT: ClassVar = Format(
        "cpfls/model", "a vehicle found in flights", "vehicle", ("flight", "held-out"), kind="vehicle"
    )

    found: FoundNumbersGroup = group("found")
    trade: TradesGroup = group("trade")
    structure: StructuresTriedGroup = group("structure")
    loop: LoopGroup = group("loop")
    held_out: HeldOutGroup | None = group("held_out", default=None)
    share: SharesGroup = group("share")
    airspeed: float = dataset(
        "airspeed", "speed in the rotor plane that 95 % of the training samples stay below", units="m/s"
    )
    evaluated: int = dataset("evaluated", "structures that were judged")
    complete: bool = dataset("complete", "1 where the search came to its end")
    blocks: int = dataset("blocks", "blocks of windows that the intervals come from")
    warning: tuple[str, ...] = dataset("warning", "what to know about the flights", "warning")
    guess: tuple[str, ...] | None = dataset(
        "guess", "numbers of /vehicle that are guesses still: no flight tells them", "guess", default=None
    )
    difference: DifferencesGroup | None = group("difference", default=None)
    contradiction: tuple[str, ...] | None = dataset(
        "contradiction", "what of the flights contradicts itself or the vehicle", "contradiction", default=None
    )

    @classmethod
    def of(
        cls,
        found: FoundVehicle,
        held_out: HeldOutGroup | None,
        warnings: Sequence[str],
        contradictions: Sequence[str] | None = None,
        learned: LearnedGroup | None = None,
        *,
        commanded: bool,
    ) -> Self:
        """Arrange a vehicle that was found, and how well it predicts flights that it was not found in."""
        return cls(
            vehicle=VehicleGroup.of(replace(found.model, commanded=commanded)),
            learned=learned,
            found=columns_of(
                FoundNumbersGroup,
                found.numbers,
                determined=np.array([number.determined for number in found.numbers], dtype=bool),
                at_bound=np.array([number.at_bound for number in found.numbers], dtype=bool),
            ),
            trade=columns_of(TradesGroup, found.trades),
            structure=StructuresTriedGroup.of(found.choice),
            loop=LoopGroup.of(found.loop),
            held_out=held_out,
            share=SharesGroup(
                name=tuple(share.name for share in found.shares),
                torque=np.array([share.wrench[:3] for share in found.shares]),
                force=np.array([share.wrench[3:] for share in found.shares]),
            ),
            airspeed=found.airspeed,
            evaluated=found.choice.evaluated,
            complete=found.choice.complete,
            blocks=found.blocks,
            warning=tuple(warnings),
            guess=found.guessed or None,
            difference=columns_of(DifferencesGroup, found.differences) if found.differences else None,
            contradiction=None if contradictions is None else tuple(contradictions),
        )

    @property
    def trust(self) -> str:
        """What playback on flights held out says of it."""
        return self.verdict

    @property
    def stopped(self) -> str:
        """Why the search for it ended before its end; empty where it did not."""
        return "" if self.complete else "interrupted"

    @property
    def verdict(self) -> Trust:
        """What playback on flights held out says of it, where they neither contradict themselves nor show the loop."""
        return capped(trust_by_playback(self.held_out), self.contradiction or (), loop=self.loop.shown)

    @property
    def summary(self) -> dict[str, Any]:
        """The vehicle for machines."""
        numbers = {row.pop("name"): row for row in rows_of(self.found)}
        return {
            **self.vehicle.summary,
            # Its effects were chosen among those that the table of weights holds.
            "not_held": [],
            "verdict": self.verdict,
            **self.provenance,
            "parameters": {row.pop("key"): row for row in (each._asdict() for each in parameters_of(self))},
            "numbers": numbers,
            "differences": {}
            if self.difference is None
            else {row.pop("name"): row for row in rows_of(self.difference)},
            "trades": [list(row.values()) for row in rows_of(self.trade)],
            "loop": {
                "shown": self.loop.shown,
                **{
                    name: [float(value) if np.isfinite(value) else None for value in getattr(self.loop, name)]
                    for name in ("low", "high", "explained")
                },
            },
            "structures": rows_of(self.structure),
            "held_out": None if self.held_out is None else self.held_out.summary,
            "shares": {row.pop("name"): row for row in rows_of(self.share)},
            "evaluated": self.evaluated,
            "complete": self.complete,
            "contradictions": list(self.contradiction or ()),
            "warnings": list(self.warning),
        }
