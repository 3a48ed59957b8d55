"""The artifact of a diagnosis: which physical effect a model misses."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Self

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.artifacts.audit import AuditGroup
from cpfls_cli.artifacts.comes_again import ComesAgainGroup
from cpfls_cli.artifacts.disturbance import DisturbanceGroup
from cpfls_cli.artifacts.gap_effects import (
    GapChangeGroup,
    NamedEffectsGroup,
    PlaybackChangeGroup,
    StretchGroup,
    above_noise,
    effect_summary,
)
from cpfls_cli.artifacts.gap_flights import (
    HELD_OUT,
    TRAINING,
    FlightsGroup,
    NotExcitedGroup,
)
from cpfls_cli.artifacts.learned import MODEL_FLIGHT, LearnedFlight, LearnedGroup, learned_in
from cpfls_cli.artifacts.model import VehicleGroup
from cpfls_cli.artifacts.spec import BODY, Format, Record, columns_of, dataset, group, group_of, record, rows_of
from cpfls_cli.gap.naming.results import Alternative, LikelySet, Unexplained
from cpfls_cli.playback.gusts import GustAxis

if TYPE_CHECKING:
    from cpfls_cli.gap.before_after import BeforeAfter
    from cpfls_cli.gap.diagnose import DiagnosisRun
    from cpfls_cli.gap.extended import ExtendedModel
    from cpfls_cli.gap.naming.held_out import HeldOut
    from cpfls_cli.playback.model import VehicleModel
    from cpfls_cli.weak_form.windows import Recording

KINDS = ("torque", "force")

_PHYSICS = ("wrench", "actuator")
"""Kinds of effects that torque and force show; sensors and numbers of the vehicle are told on other grounds."""

_PLUS = " + "


@record
class AlternativeGroup:
    """Effects that the flights cannot tell from a named one."""

    name: tuple[str, ...] = dataset("effects that the flights cannot tell from a named one", "alternative")
    instead_of: tuple[str, ...] = dataset("the named one", "alternative")
    relative_gain: Array = dataset(
        "what it explains over what the named one explains; NaN where it could not be tried", "alternative", gaps=True
    )
    separated_by: tuple[str, ...] = dataset("the flight, or the signal, that would tell", "alternative")
    beside: tuple[str, ...] | None = dataset(
        "another effect that is not named and without which it would not do; empty for none",
        "alternative",
        default=None,
    )

    def rows(self) -> list[Alternative]:
        """List effects that could be named instead."""
        return [Alternative(**row) for row in rows_of(self)]


@record
class LikelySetGroup:
    """Sets of effects, each with how likely it is among those compared."""

    effects: tuple[str, ...] = dataset("effects of a set, joined by a plus sign; most likely first", "set")
    likely: Array = dataset("probability among the sets compared, by what each leaves of blocks that no fit saw", "set")

    @classmethod
    def of(cls, sets: Sequence[LikelySet]) -> Self:
        """Arrange sets."""
        return columns_of(cls, sets, effects=tuple(_PLUS.join(each.effects) for each in sets))

    def rows(self) -> list[LikelySet]:
        """List sets."""
        pairs = zip(self.effects, self.likely.tolist(), strict=True)
        return [LikelySet(tuple(names.split(_PLUS)), likely) for names, likely in pairs]


@record
class UnexplainedGroup:
    """Channels with a gap that nothing in the catalogue explains."""

    axis: tuple[str, ...] = dataset("channels with a gap that nothing in the catalogue explains", "unexplained")
    floors: Array = dataset("root mean square of what is left, in floors", "unexplained")
    signal: tuple[str, ...] = dataset("signal that it depends on most; empty for none", "unexplained")
    share: Array = dataset("share of what is left that signal or narrow band explains", "unexplained")
    frequency: Array = dataset("of a narrow band that stands out", "unexplained", units="Hz", gaps=True)
    energy: tuple[str, ...] = dataset("feeds, drains or neither", "unexplained")

    @classmethod
    def of(cls, unexplained: Sequence[Unexplained]) -> Self:
        """Arrange channels whose gap nothing explains."""
        signals = tuple(each.signal or "" for each in unexplained)
        frequencies = np.array([each.frequency_hz for each in unexplained], dtype=float)
        return columns_of(cls, unexplained, signal=signals, frequency=frequencies)

    def unexplained(self) -> list[Unexplained]:
        """Rebuild what is not explained."""
        rows = rows_of(self)
        for row in rows:
            frequency = row.pop("frequency")
            row |= {"signal": row["signal"] or None, "frequency_hz": None if np.isnan(frequency) else frequency}
        return [Unexplained(**row) for row in rows]


@record
class TorqueAloneGroup:
    """First choices of a look at the torques alone."""

    name: tuple[str, ...] = dataset("first choices of a look at the torques alone", "torque_alone")
    share: Array = dataset("share of the gap that each would explain", "torque_alone")


@record
class ResidualChangeGroup:
    """Gap of each held-out window, before and after."""

    time: Array = dataset("middle of each held-out window, on the clock of its flight", "window", units="s")
    flight: IntArray = dataset("index of its flight", "window", into="flight")
    before: Array = dataset(
        "gap of the model as given, N m and N", "window", "channel", units="SI", frame=BODY, gaps=True
    )
    parameters: Array = dataset(
        "gap with only its numbers refitted", "window", "channel", units="SI", frame=BODY, gaps=True
    )
    after: Array = dataset("gap with the effects", "window", "channel", units="SI", frame=BODY, gaps=True)

    @classmethod
    def of(cls, unseen: HeldOut, change: BeforeAfter) -> Self:
        """Arrange the gap of held-out windows."""
        parts = {"before": unseen.before, "parameters": unseen.parameters, "after": unseen.after}
        known = {name: np.where(unseen.known, rows, np.nan) for name, rows in parts.items()}
        return cls(time=change.centres, flight=change.flight_index, **known)


@record
class WhitenessGroup:
    """Autocorrelation of the gap on held-out windows."""

    lag: Array = dataset("distance of windows that do not overlap", "lag", units="s")
    before: Array = dataset("autocorrelation of the gap of the model as given", "lag", "channel", gaps=True)
    after: Array = dataset("autocorrelation of the gap with the effects", "lag", "channel", gaps=True)
    p_value_before: Array = dataset("probability that noise is as correlated, by Ljung and Box", "channel", gaps=True)
    p_value_after: Array = dataset("the same with the effects", "channel", gaps=True)

    @classmethod
    def of(cls, change: BeforeAfter) -> Self:
        """Arrange autocorrelations."""
        before, after = change.white_before, change.white_after
        return cls(
            lag=np.asarray(change.lag_s * np.arange(1, len(before.autocorrelation) + 1), dtype=float),
            before=before.autocorrelation,
            after=after.autocorrelation,
            p_value_before=before.p_value,
            p_value_after=after.p_value,
        )

    @property
    def summary(self) -> dict[str, Any]:
        """How white the gap is, for machines."""
        return {"p_value_before": self.p_value_before.tolist(), "p_value_after": self.p_value_after.tolist()}


@record
class PictureGroup:
    """Stretch of a held-out flight in which model and flight disagree most."""

    flight: str = dataset("held-out flight of the stretch in which model and flight disagreed most")
    channel: str = dataset("channel of the stretch")
    time: Array = dataset("on the clock of the flight", "moment", units="s")
    measured: Array = dataset("torque or force that the measured motion takes", "moment", units="SI", frame=BODY)
    before: Array = dataset("simulated, model as given", "moment", units="SI", frame=BODY)
    after: Array = dataset("simulated, with the effects", "moment", units="SI", frame=BODY)

    @classmethod
    def of(cls, change: BeforeAfter, held: Sequence[Recording]) -> Self:
        """Arrange the stretch with the largest gap."""
        return group_of(cls, change.picture, flight=held[change.picture.flight].name)


@record
class FreeRunsGroup:
    """Free runs of a held-out stretch."""

    flight: str = dataset("held-out flight of the stretch whose free runs went astray most")
    axis: int = dataset("body axis on which they did: 0, 1, 2 for x, y, z")
    time: Array = dataset("on the clock of the flight", "run_sample", units="s")
    restart: Array = dataset("times at which each free run starts from the measured rate", "run", units="s")
    measured: Array = dataset("body rates", "run_sample", "axis", units="rad/s", frame=BODY)
    before: Array = dataset("simulated, model as given", "run_sample", "axis", units="rad/s", frame=BODY)
    after: Array = dataset("simulated, with the effects", "run_sample", "axis", units="rad/s", frame=BODY)

    @classmethod
    def of(cls, change: BeforeAfter, held: Sequence[Recording]) -> Self:
        """Arrange the stretch whose free runs went astray most."""
        run, recording = change.run, held[change.run.flight]
        runs, samples, _ = run.measured.shape
        time = recording.signals.time[run.first : run.first + runs * samples]
        rates = {name: getattr(run, name).reshape(-1, 3) for name in ("measured", "before", "after")}
        return cls(flight=recording.name, axis=run.axis, time=time, restart=time[::samples], **rates)


class LargestGap(NamedTuple):
    """Where the gap of the model as given is largest on the held-out flights.

    Attributes
    ----------
    channels : list of str
        With a gap above noise, largest first, in floors.
    flight : str
        Empty where no stretch stands out, and then the next three are not known.
    start_s, end_s : float
        Of the stretch in which the first channel is worst, on the clock of the flight.
    floors : float
        Root mean square there.
    share_of_time : float
        In which the first channel is above noise.
    """

    channels: list[str]
    flight: str
    start_s: float
    end_s: float
    floors: float
    share_of_time: float


@record
class DiagnosisRecord(Record):
    """The artifact `cpfls/diagnosis`."""

    FORMAT: ClassVar = Format(
        "cpfls/diagnosis",
        "which physical effect a model misses, judged on flights that the fit did not see",
        "diagnose, gap",
        ("disagreement", "flight-1", "held-out-1", "model-flight-1"),
    )

    verdict: str = dataset("NAMED, PARTIAL, AMBIGUOUS, UNEXPLAINED, FLIGHTS_DIFFER, NO_GAP or NOT_EXCITED")
    share: float = dataset("part of the held-out gap above the floor that the effects take off")
    split: str = dataset("which flights were for training and which were held out, and why")
    effects: NamedEffectsGroup = group("")
    alternative: AlternativeGroup = group()
    unexplained: UnexplainedGroup = group()
    torque_alone: TorqueAloneGroup = group()
    gap: GapChangeGroup = group()
    playback: PlaybackChangeGroup | None = group(default=None)
    stretch: StretchGroup | None = group(default=None)
    residual: ResidualChangeGroup = group()
    whiteness: WhitenessGroup | None = group(default=None)
    picture: PictureGroup | None = group(default=None)
    run: FreeRunsGroup | None = group(default=None)
    not_excited: NotExcitedGroup = group()
    audit: AuditGroup = group("")
    note: tuple[str, ...] = dataset("what a reader should know", "note")
    contradiction: tuple[str, ...] = dataset(
        "contradictions within the log or with its vehicle, including numbers that no vehicle has",
        "impossible",
        path="impossible",
        default=(),
    )
    warning: tuple[str, ...] = dataset("what to know about the flights", "warning", default=())
    base: VehicleGroup = group()
    flights: FlightsGroup = group("")
    difference: tuple[str, ...] | None = dataset(
        "what differs between the training and the held-out flights", "difference", default=None
    )
    shares: Array | None = dataset(
        "the share of torque and of force; NaN where there is no gap, or no name",
        "2",
        path="share_by_kind",
        gaps=True,
        default=None,
    )
    learned: LearnedGroup | None = group(default=None)
    again_before: ComesAgainGroup | None = group("comes_again_before", default=None)
    again_after: ComesAgainGroup | None = group("comes_again_after", default=None)
    disturbance: DisturbanceGroup | None = group(default=None)
    sets: LikelySetGroup | None = group("effect_set", default=None)

    @classmethod
    def of(
        cls,
        diagnosed: DiagnosisRun,
        change: BeforeAfter,
        model: ExtendedModel,
        training: Sequence[Recording],
        held: Sequence[Recording],
        split: str,
        warnings: Sequence[str],
        base: VehicleModel,
    ) -> Self:
        """Arrange a diagnosis; `split` says why these flights trained, `base` is the model that misses something."""
        diagnosis = diagnosed.diagnosis
        effects, named = diagnosis.effects or diagnosis.closest, bool(diagnosis.effects)
        alone = diagnosis.torque_alone
        return cls(
            verdict=str(diagnosis.verdict),
            share=diagnosis.share,
            split=split,
            effects=NamedEffectsGroup.of(effects, named, diagnosis.parameters, model.parameters),
            alternative=columns_of(AlternativeGroup, diagnosis.alternatives),
            unexplained=UnexplainedGroup.of(diagnosis.unexplained),
            torque_alone=TorqueAloneGroup(
                name=tuple(name for name, _ in alone), share=np.fromiter((share for _, share in alone), float)
            ),
            gap=GapChangeGroup.of(diagnosis.before, diagnosis.after, diagnosis.floor),
            playback=PlaybackChangeGroup.of_pairs(change.played, change.playback),
            stretch=columns_of(StretchGroup, change.stretches),
            residual=ResidualChangeGroup.of(diagnosed.held_out, change),
            whiteness=WhitenessGroup.of(change),
            picture=PictureGroup.of(change, held),
            run=FreeRunsGroup.of(change, held),
            not_excited=columns_of(NotExcitedGroup, diagnosis.not_excited),
            audit=AuditGroup.of(diagnosed.audit),
            note=diagnosis.notes,
            contradiction=diagnosis.contradictions,
            warning=tuple(warnings),
            base=VehicleGroup.of(base),
            flights=FlightsGroup.of([*training, *held], [TRAINING] * len(training) + [HELD_OUT] * len(held)),
            difference=diagnosis.differences,
            shares=np.array([diagnosis.shares.get(kind, np.nan) for kind in KINDS]),
            again_before=ComesAgainGroup.of(change.again_before),
            again_after=ComesAgainGroup.of(change.again_after),
            disturbance=None if diagnosed.air is None else DisturbanceGroup.of(diagnosed.air.found, diagnosed.air.told),
            sets=LikelySetGroup.of(diagnosis.sets),
        )

    @property
    def model_learned_from(self) -> tuple[LearnedFlight, ...]:
        """Flights that the model with the gap learned from."""
        return learned_in(self.origin.inputs, self.learned, MODEL_FLIGHT)

    @property
    def learned_from(self) -> tuple[LearnedFlight, ...]:
        """Flights that the effects were found in; of one flight alone a part, where its rest was held out."""
        inputs = self.origin.inputs
        files = [file for role, file in inputs.items() if role.startswith("flight-")]
        lengths = np.diff([*self.flights.each.first, len(self.flights.signals.time)]).tolist()
        training = lengths[: self.flights.each.role.count(TRAINING)]
        halved = len(files) == 1 and not any(role.startswith("held-out") for role in inputs)
        whole = [sum(lengths)] if halved else training
        return tuple(map(LearnedFlight.in_file, files, training, whole))

    @property
    def effects_of_motion(self) -> tuple[str, ...]:
        """Effects that the verdict names and that torque and force show, by identifier."""
        return self.effects.names(*_PHYSICS)

    @property
    def forces_decide(self) -> bool:
        """Whether the torques alone would name another effect first than torque and force together."""
        alone, named = self.torque_alone.name, self.effects_of_motion
        return bool(alone and named and self.gap.has_force and alone[0] not in named)

    @property
    def largest_gap(self) -> LargestGap | None:
        """Where the gap of the model as given is largest on the held-out flights; None where all is within noise."""
        gap, above = self.gap, above_noise(self.gap.before_floors)
        order = [index for index in np.argsort(-np.nan_to_num(gap.before_floors), kind="stable") if above[index]]
        if not order:
            return None
        first, channels = order[0], [gap.channel[index] for index in order]
        windows = self.residual.before[:, first] / gap.floor[first]
        share = float(above_noise(np.abs(windows)).mean())
        stretches = [] if self.stretch is None else self.stretch.first(len(self.stretch.channel))
        for flight, start, end, channel, floors in stretches:
            if channel == channels[0]:
                return LargestGap(channels, self.flights.names(HELD_OUT)[flight], start, end, floors, share)
        return LargestGap(channels, "", np.nan, np.nan, np.nan, share)

    @property
    def inertia(self) -> Array:
        """Inertia parameters of the model, kg m^2, with the errors of its moments that are named."""
        numbers = {each.name: each.value for effect in self.effects.named for each in effect.coefficients}
        return self.base.inertia * [*(1 + numbers.get(f"inertia_{axis}", 0.0) for axis in "xyz"), 1.0, 1.0, 1.0]

    @property
    def gusts(self) -> tuple[GustAxis, ...]:
        """Gusts that are all that is left of the flights, by axis; none where nothing tells."""
        return self._gusts(alone=True)

    @property
    def gusts_beside(self) -> tuple[GustAxis, ...]:
        """Gusts beside which something else is left, by axis; none where nothing tells."""
        return self._gusts(alone=False)

    def _gusts(self, *, alone: bool) -> tuple[GustAxis, ...]:
        found = self.disturbance
        if found is None or found.alone is None or self.contradiction:
            return ()
        pairs = zip(found.axes(self.inertia, self.base.mass), found.alone, strict=True)
        return tuple(axis for axis, own in pairs if own == alone and np.isfinite(axis.size))

    @property
    def only_gusts(self) -> bool:
        """Whether a gap is left of which it is known that it does not come again."""
        left = above_noise(self.gap.after_floors).any() and not self.contradiction
        return bool(left) and self.again_after is not None and self.again_after.nothing

    @property
    def remarks(self) -> tuple[str, ...]:
        """Notes on the diagnosis itself, without what the sensors say about each other."""
        told = {*self.audit.warning, *self.audit.note, *self.contradiction, *(self.difference or ())}
        return tuple(note for note in self.note if note not in told)

    @property
    def summary(self) -> dict[str, Any]:
        """The diagnosis for machines."""
        where = self.largest_gap
        return {
            "verdict": self.verdict,
            "contradictions": list(self.contradiction),
            "share": self.share,
            "share_by_kind": None if self.shares is None else dict(zip(KINDS, self.shares.tolist(), strict=True)),
            "differences": list(self.difference or ()),
            "effects": [effect_summary(effect) for effect in self.effects.named],
            "closest": [effect_summary(effect) for effect in self.effects.closest],
            "alternatives": rows_of(self.alternative),
            "sets": [vars(each) | {"effects": list(each.effects)} for each in self.sets.rows()] if self.sets else [],
            "unexplained": [vars(each) for each in self.unexplained.unexplained()],
            "not_excited": self.not_excited.summary,
            "where": where and where._asdict(),
            "gap_before": self.gap.summary_before,
            "gap_after": self.gap.summary_after,
            "comes_again": self.again_before
            and self.again_after
            and {"before": self.again_before.summary, "after": self.again_after.summary},
            "disturbance": self.disturbance and self.disturbance.summary(self.inertia, self.base.mass),
            "playback": self.playback and self.playback.summary,
            "whiteness": self.whiteness and self.whiteness.summary,
            "torque_alone": rows_of(self.torque_alone),
            "audit": self.audit.summary,
            "parameters": self.effects.parameter.summary,
            "split": self.split,
            "notes": list(self.note),
            "warnings": list(self.warning),
        }
