"""The artifact of a vehicle found in flights: a model, what was free in it, and how it was chosen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.artifacts.disturbance import DisturbanceGroup
from cpfls_cli.artifacts.learned import LearnedGroup
from cpfls_cli.artifacts.model import ModelRecord, VehicleGroup, of_no_body
from cpfls_cli.artifacts.parameters import DRAG, FOUND_AS, GUESSES, INERTIA, is_learned, parameters_of
from cpfls_cli.artifacts.playback import HeldOutGroup, by_horizon
from cpfls_cli.artifacts.spec import BODY, Format, columns_of, dataset, group, group_of, record, rows_of
from cpfls_cli.inertia import EXPLAINED
from cpfls_cli.playback.errors import FADING
from cpfls_cli.response.mismatch import NOT_ACCEPTABLE, NOT_JUDGED, ROTATION, THRUST, response_word
from cpfls_cli.validation.trust import GOOD, Trust, capped, trust_by_playback

if TYPE_CHECKING:
    # Reading a record does not need the compiled loops that play a vehicle back.
    from cpfls_cli.playback.constants import Constants
    from cpfls_cli.playback.history import Observer
    from cpfls_cli.playback.instruments import Instruments
    from cpfls_cli.playback.loop import LoopBounds
    from cpfls_cli.playback.structure import Choice
    from cpfls_cli.playback.vehicle import FoundVehicle
    from cpfls_cli.response.flown import VehicleResponse


@record
class FoundNumbersGroup:
    """The numbers that were free, with 95 % intervals."""

    name: tuple[str, ...] = dataset("block and number", "found")
    unit: tuple[str, ...] = dataset("empty for a ratio", "found")
    value: Array = dataset("estimate", "found", units="SI")
    low: Array = dataset("lower end of the 95 % interval", "found", units="SI")
    high: Array = dataset("upper end of the 95 % interval", "found", units="SI")
    stated: Array = dataset("in /config; not finite where no config does", "found", units="SI", gaps=True)
    determined: BoolArray = dataset("1 where the flights say more than what was believed before", "found")
    at_bound: BoolArray = dataset("1 where it lies on a bound, so the interval says little", "found")
    possible: BoolArray | None = dataset("0 where no such vehicle has the estimate", "found", default=None)


@record
class TradesGroup:
    """Pairs of numbers that the flights cannot tell apart."""

    first: tuple[str, ...] = dataset("one number", "trade")
    second: tuple[str, ...] = dataset("the other", "trade")
    correlation: Array = dataset("of the two estimates", "trade")


@record
class SharesGroup:
    """How much each part of the model does along the training flights."""

    name: tuple[str, ...] = dataset("rotors, an effect, or remainder", "part")
    torque: Array = dataset("root mean square", "part", "axis", units="N m", frame=BODY)
    force: Array = dataset("root mean square", "part", "axis", units="N", frame=BODY)


@record
class StructuresTriedGroup:
    """Structures of the Pareto front and the baselines, each judged on the flights kept aside."""

    name: tuple[str, ...] = dataset("chosen, best, greedy, everything, nothing, or front", "structure")
    blocks: tuple[str, ...] = dataset("its blocks, one space between two", "structure")
    error: Array = dataset("mean error of the windows kept aside; about 1.1 for rates that stay", "structure")
    worse: Array = dataset("error less that of the best", "structure")
    uncertain: Array = dataset("standard error of that difference", "structure")
    numbers: IntArray = dataset("free numbers", "structure")
    condition_number: Array = dataset("of the numbers in their natural sizes", "structure")

    @classmethod
    def of(cls, choice: Choice) -> Self:
        """Arrange a choice."""
        baselines = ("chosen", "best", "greedy", "everything", "nothing")
        listed = [*((name, getattr(choice, name)) for name in baselines), *(("front", each) for each in choice.front)]
        differences = [judged.worse_than(choice.best) for _, judged in listed]
        return columns_of(
            cls,
            (judged for _, judged in listed),
            name=tuple(name for name, _ in listed),
            blocks=tuple(" ".join(judged.structure.blocks) for _, judged in listed),
            worse=np.array([worse for worse, _ in differences]),
            uncertain=np.array([uncertain for _, uncertain in differences]),
        )


@record
class DifferencesGroup:
    """What other configurations have that the vehicle has not, with 95 % intervals."""

    name: tuple[str, ...] = dataset("configuration, and what differs", "difference")
    unit: tuple[str, ...] = dataset("of the difference", "difference")
    value: Array = dataset("estimate", "difference", units="SI")
    low: Array = dataset("lower end of the 95 % interval", "difference", units="SI")
    high: Array = dataset("upper end of the 95 % interval", "difference", units="SI")


@record
class LoopGroup:
    """How far an autopilot that answers what disturbs the vehicle may have misled the fit, about each body axis."""

    low: Array = dataset("factor on the moment of inertia", "axis", frame=BODY, gaps=True)
    high: Array = dataset("factor on the moment of inertia", "axis", frame=BODY, gaps=True)
    explained: Array = dataset(
        "share of the rotation in a band that torque explains, the least", "axis", frame=BODY, gaps=True
    )
    shown: bool = dataset("1 where so little is explained that the numbers may be those of the loop")
    band_hz: Array | None = dataset("ends of bands, about", "loop band", "end", units="Hz", default=None)
    by_band: Array | None = dataset(
        "share of the rotation that torque explains", "loop band", "axis", frame=BODY, gaps=True, default=None
    )
    turning: Array | None = dataset(
        "body rate, root mean square", "axis", units="rad/s", frame=BODY, gaps=True, default=None
    )
    missed: Array | None = dataset(
        "explained by the model that was found, where that of rotors that only lag is much more, and in the others",
        "axis",
        frame=BODY,
        gaps=True,
        default=None,
    )

    @classmethod
    def of(cls, bounds: LoopBounds) -> Self:
        """Arrange bounds."""
        return group_of(cls, bounds, shown=bounds.shows_loop)

    @property
    def misses(self) -> bool:
        """Whether what was found explains much less of roll or pitch than rotors that only lag."""
        return self.missed is not None and bool(np.isfinite(self.missed[:2]).any())


@record
class InstrumentsGroup:
    """What told how the flights were moved, apart from gusts: other runs of a path, setpoints, or what was before."""

    kind: str = dataset("repeats, setpoints, or past, which is what was before")
    setpoint: tuple[str, ...] = dataset("signals asked for from outside of the loop", "setpoint")
    first: IntArray = dataset(
        "a run that repeats another: a flight, or a part of one, counted from 0", "repeat", least=0
    )
    second: IntArray = dataset("the other", "repeat", least=0)
    likeness: Array = dataset("correlation of the two along their path", "repeat")
    low: Array = dataset("lower end, about", "band", units="Hz")
    high: Array = dataset("upper end, about", "band", units="Hz")
    explained: Array = dataset(
        "share of the rotation that comes again that the constants explain", "band", "axis", frame=BODY
    )
    total: Array = dataset("the same in all used bands, weighed by what they tell", "axis", frame=BODY)
    error: Array = dataset("standard error of that", "axis", frame=BODY)
    used: BoolArray = dataset("1 where the constants rest on the band; others lack an effect", "band")

    @classmethod
    def of(cls, given: Instruments, constants: Constants) -> Self:
        """Arrange instruments, and what they say of the constants."""
        past, ends = constants.told_by == "past", np.array(constants.explained.bands_hz)
        likeness = {} if past else given.repeats.likeness
        pairs = list(likeness)
        return group_of(
            cls,
            constants.explained,
            kind=constants.told_by,
            setpoint=() if past else given.names,
            first=np.array([first for first, _ in pairs], dtype=np.int64),
            second=np.array([second for _, second in pairs], dtype=np.int64),
            likeness=np.array(list(likeness.values()), dtype=float),
            low=ends[:, 0],
            high=ends[:, 1],
            explained=constants.explained.share,
        )

    @property
    def runs(self) -> int:
        """Runs that repeat another."""
        return len({*self.first.tolist(), *self.second.tolist()})

    @property
    def lacks(self) -> bool:
        """Whether less than 90 % of what comes again about roll or pitch is explained, by more than chance."""
        return self.lacks_below is not None or bool((self.total + self.error < EXPLAINED)[:2].any())

    @property
    def lacks_below(self) -> float | None:
        """Frequency in Hz below which the vehicle answers with something that the constants lack; None for nowhere."""
        return None if self.used.all() else float(self.low[self.used].min())

    @property
    def summary(self) -> dict[str, Any]:
        """The instruments for machines."""
        return {
            "kind": self.kind,
            "setpoints": list(self.setpoint),
            "repeats": [
                {"runs": [int(first), int(second)], "correlation": float(alike)}
                for first, second, alike in zip(self.first, self.second, self.likeness, strict=True)
            ],
            "bands": [
                {"hz": [float(low), float(high)], "explained": explained.tolist(), "used": bool(used)}
                for low, high, explained, used in zip(self.low, self.high, self.explained, self.used, strict=True)
            ],
            "explained": self.total.tolist(),
            "explained_error": self.error.tolist(),
        }


@record
class ResponsesGroup:
    """How far the model is from the frequency responses that its flights show (see `cpfls response`)."""

    name: tuple[str, ...] = dataset("roll, pitch, yaw, thrust", "response")
    cost: Array = dataset("J; not finite where the flights do not show it", "response", gaps=True)
    low: Array = dataset("from this frequency", "response", units="Hz", gaps=True)
    high: Array = dataset("to this one", "response", units="Hz", gaps=True)

    @classmethod
    def of(cls, responses: Mapping[str, VehicleResponse], *, instrumented: bool) -> Self:
        """Arrange those about the body axes and of thrust; only those that instruments move, where they have to."""
        own = {
            name: each
            for name, each in responses.items()
            if name in (*ROTATION, THRUST) and (each.instrumented or not instrumented)
        }
        ends = np.array([each.band or (np.nan, np.nan) for each in own.values()]).reshape(-1, 2)
        costs = np.array([each.cost for each in own.values()])
        return cls(name=tuple(own), cost=costs, low=ends[:, 0], high=ends[:, 1])

    @property
    def _turning(self) -> list[str]:
        """Words on roll and pitch, where there are any."""
        costs = zip(self.name, self.cost.tolist(), strict=True)
        return [response_word(cost) for name, cost in costs if name in ROTATION[:2]]

    @property
    def off(self) -> bool:
        """Whether the model is not acceptable about roll or pitch."""
        return NOT_ACCEPTABLE in self._turning

    @property
    def judged(self) -> bool:
        """Whether roll and pitch are judged, both."""
        return len(self._turning) == len(ROTATION[:2]) and NOT_JUDGED not in self._turning

    @property
    def summary(self) -> dict[str, Any]:
        """The responses for machines."""
        return {
            name: {
                "word": response_word(cost),
                "cost": cost,
                "band_hz": [low, high] if np.isfinite(low) else None,
            }
            for name, cost, low, high in zip(
                self.name, self.cost.tolist(), self.low.tolist(), self.high.tolist(), strict=True
            )
        }


@record
class ObserverGroup:
    """The observer by which the forecast uses the past: of a disturbance until a run starts."""

    past: float = dataset("how much of the flight before a start its numbers were fitted with", units="s")
    rate: Array = dataset(
        "at which what the model misses is taken up: torque x y z, force x y z", "6", units="1/s", frame=BODY
    )
    memory: Array = dataset("time constant with which the disturbance fades", "6", units="s", frame=BODY, least=0.0)

    @classmethod
    def of(cls, observer: Observer) -> Self:
        """Arrange an observer."""
        return cls(past=observer.past_s, rate=observer.rate, memory=observer.memory_s)

    @property
    def summary(self) -> dict[str, Any]:
        """The observer for machines."""
        return {"past_s": self.past, "rate_1_s": self.rate.tolist(), "memory_s": self.memory.tolist()}


@record
class VehicleRecord(ModelRecord):
    """The artifact `cpfls/model` of a vehicle found in flights."""

    FORMAT: ClassVar = Format(
        "cpfls/model", "a vehicle found in flights", "vehicle", ("flight", "held-out"), kind="vehicle"
    )

    found: FoundNumbersGroup = group()
    trade: TradesGroup = group()
    structure: StructuresTriedGroup = group()
    loop: LoopGroup = group()
    instruments: InstrumentsGroup | None = group(default=None)
    responses: ResponsesGroup | None = group(default=None)
    forecast: VehicleGroup | None = group(default=None, apart=True)
    history: ObserverGroup | None = group(default=None)
    held_out: HeldOutGroup | None = group(default=None)
    fading_s: float | None = dataset(FADING, units="s", default=None)
    share: SharesGroup = group()
    airspeed: float = dataset("speed in the rotor plane that 95 % of the training samples stay below", units="m/s")
    evaluated: int = dataset("structures that were judged")
    complete: bool = dataset("1 where the search ran to the end")
    blocks: int = dataset("blocks of windows that the intervals come from")
    warning: tuple[str, ...] = dataset("what to know about the flights", "warning")
    guess: tuple[str, ...] | None = dataset(
        "numbers of /vehicle that are still guesses: no flight determines them", "guess", default=None
    )
    full_speed: float | None = dataset(
        "largest speed of a rotor, assumed, where commands are shares of it; thrust and drag factor go with it",
        units="rad/s",
        default=None,
    )
    rotors_told: float | None = dataset(
        "how often the logs tell the rotors, the slowest of them", units="Hz", default=None
    )
    logged_by: tuple[str, ...] | None = dataset(
        "what wrote the logs, each once; none where they do not say", "system", default=None
    )
    difference: DifferencesGroup | None = group(default=None)
    contradiction: tuple[str, ...] | None = dataset(
        "contradictions within the flights or with the vehicle", "contradiction", default=None
    )
    disturbance: DisturbanceGroup | None = group(default=None)
    correlation: Array | None = dataset(
        "of the estimates in /found; of what is positive, of its logarithm", "found", "found", default=None
    )

    @classmethod
    def of(
        cls,
        found: FoundVehicle,
        held_out: HeldOutGroup | None,
        warnings: Sequence[str],
        contradictions: Sequence[str] | None = None,
        learned: LearnedGroup | None = None,
        responses: Mapping[str, VehicleResponse] | None = None,
        *,
        fading_s: float | None = None,
        rotors_told: float | None = None,
        logged_by: Sequence[str] = (),
        commanded: bool,
        shares: bool = False,
    ) -> Self:
        """Arrange a vehicle that was found, and how well it predicts flights that it was not found in."""
        return cls(
            vehicle=VehicleGroup.of(replace(found.model, commanded=commanded)),
            learned=learned,
            found=columns_of(FoundNumbersGroup, found.numbers),
            trade=columns_of(TradesGroup, found.trades),
            structure=StructuresTriedGroup.of(found.choice),
            loop=LoopGroup.of(found.loop),
            instruments=None if found.constants is None else InstrumentsGroup.of(found.instruments, found.constants),
            responses=ResponsesGroup.of(responses, instrumented=found.constants is not None) if responses else None,
            forecast=None if found.forecast is None else VehicleGroup.of(replace(found.forecast, commanded=commanded)),
            history=None if found.history is None else ObserverGroup.of(found.history),
            held_out=held_out,
            fading_s=fading_s,
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
            full_speed=found.model.vehicle.rotor_speed_max_rad_s if shares else None,
            rotors_told=rotors_told,
            logged_by=tuple(logged_by) or None,
            difference=columns_of(DifferencesGroup, found.differences) if found.differences else None,
            contradiction=None if contradictions is None else tuple(contradictions),
            disturbance=None if found.gusts is None else DisturbanceGroup.of(found.gusts),
            correlation=found.correlation,
        )

    @property
    def trust(self) -> str:
        """What it is as the vehicle: whoever takes it elsewhere takes its constants."""
        return self.verdict

    @property
    def judged_as(self) -> dict[str, str]:
        """How far to trust it as a forecast along logged rotor speeds, and as the vehicle."""
        return {"forecast": self.forecast_verdict, "vehicle": self.verdict}

    @property
    def stopped(self) -> str:
        """Why the search for it ended before its end; empty where it did not."""
        return "" if self.complete else "interrupted"

    @property
    def verdict(self) -> Trust:
        """How far to trust its constants, where the flights neither contradict themselves nor show the loop.

        Where instruments tell them, by what they explain of the motion that comes again; else by playback, as far as
        they are told at all. No word is good where the frequency response about roll or pitch is off.
        """
        against = self.contradiction or ()
        off = self.responses is not None and self.responses.off
        told = self.tells_turning and not set(FOUND_AS.values()) & set(self.on_bound)
        if self.instruments is None:
            told = told and self.tells_yaw and not self.loop.misses
            return capped(self._by_playback, against, loop=self.loop.shown, lacks=off, told=told)
        lacks = off or self.instruments.lacks
        seen = lacks or (self.responses is not None and self.responses.judged)
        word = Trust.SIMULATION if seen else Trust.NOT_JUDGED
        return capped(word, against, lacks=lacks, told=told)

    @property
    def tells_turning(self) -> bool:
        """Whether the moments of inertia about roll and pitch are told, or known, and on no bound."""
        return not {FOUND_AS[key] for key in INERTIA[:2]} & set(self.untold)

    @property
    def tells_yaw(self) -> bool:
        """Whether the moment of inertia about yaw is told, or its ratio to the drag factor."""
        drag, moment = FOUND_AS[DRAG], FOUND_AS[INERTIA[2]]
        ratios = {frozenset(pair) for pair in zip(self.trade.first, self.trade.second, strict=True)}
        return moment not in self.untold or frozenset((drag, moment)) in ratios

    @property
    def named(self) -> tuple[str, ...]:
        """Numbers of the fit that mean something by themselves, those of a learned remainder left out."""
        return tuple(name for name in self.found.name if not is_learned(name))

    @property
    def on_bound(self) -> tuple[str, ...]:
        """Numbers that lie on a bound of what is tried, and are not just zero."""
        return tuple(
            row["name"] for row in rows_of(self.found) if row["at_bound"] and row["value"] and row["name"] in self.named
        )

    @property
    def untold(self) -> tuple[str, ...]:
        """Numbers that the flights do not tell: not determined, on a bound, of no vehicle, or guesses still."""
        open_ = {row["name"] for row in rows_of(self.found) if not row["determined"]}
        open_ |= {*self.on_bound, *self.impossible}
        guessed = (FOUND_AS[key] for name in self.guess or () for key in GUESSES[name])
        return (*(name for name in self.named if name in open_), *(key for key in guessed if key not in self.named))

    @property
    def impossible(self) -> tuple[str, ...]:
        """Numbers that were found and that no such vehicle has."""
        wrong = {row["name"] for row in rows_of(self.found) if not row.get("possible", True)}
        wrong |= {*of_no_body(self.vehicle)}
        return tuple(name for name in self.named if name in wrong)

    @property
    def unreal(self) -> tuple[str, ...]:
        """Moments of inertia about roll and pitch that its forecast turns by and that are on a bound, or of no body."""
        wrong = {*self.on_bound, *of_no_body(self.forecast or self.vehicle)}
        turning = (FOUND_AS[key] for key in INERTIA[:2])
        return tuple(name for name in turning if name in wrong and name in self.named)

    @property
    def _by_playback(self) -> Trust:
        return capped(trust_by_playback(by_horizon(self.held_out)), self.contradiction or ())

    @property
    def forecast_verdict(self) -> Trust:
        """What playback on flights held out says of it as a forecast along logged rotor speeds.

        No word is good where the body that turns in it is none, or its frequency response about roll or pitch is off:
        what merely stops turning predicts rates as well for a while.
        """
        doubted = bool(self.unreal) or (self.responses is not None and self.responses.off)
        return Trust.NOT_CONTROL if doubted and self._by_playback in GOOD else self._by_playback

    @property
    def numbers(self) -> int:
        """How many numbers were looked for, guesses among them."""
        return len({*self.named, *self.untold})

    @property
    def summary(self) -> dict[str, Any]:
        """The vehicle for machines."""
        numbers = {row.pop("name"): row for row in rows_of(self.found)}
        return {
            **self.vehicle.summary,
            # Its effects were chosen among those that the table of weights holds.
            "not_held": [],
            "verdict": self.verdict,
            "forecast_verdict": self.forecast_verdict,
            "not_determined": list(self.untold),
            "full_speed_rad_s": self.full_speed,
            "rotors_told_hz": self.rotors_told,
            **self.provenance,
            "parameters": {row.pop("key"): row for row in (each._asdict() for each in parameters_of(self))},
            "numbers": numbers,
            "differences": {}
            if self.difference is None
            else {row.pop("name"): row for row in rows_of(self.difference)},
            "trades": [list(row.values()) for row in rows_of(self.trade)],
            "loop": {
                "shown": self.loop.shown,
                "found_explains_less": self.loop.misses,
                **{name: getattr(self.loop, name).tolist() for name in ("low", "high", "explained")},
            },
            "instruments": None if self.instruments is None else self.instruments.summary,
            "responses": None if self.responses is None else self.responses.summary,
            "disturbance": None
            if self.disturbance is None
            else self.disturbance.summary(self.vehicle.inertia, self.vehicle.mass),
            "history": None if self.history is None else self.history.summary,
            "structures": rows_of(self.structure),
            "held_out": None if self.held_out is None else self.held_out.summary,
            "fading_s": self.fading_s,
            "shares": {row.pop("name"): row for row in rows_of(self.share)},
            "evaluated": self.evaluated,
            "complete": self.complete,
            "contradictions": list(self.contradiction or ()),
            "warnings": list(self.warning),
        }
