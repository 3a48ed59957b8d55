"""Results of the gap workflow: what a model misses, which effect it is, and the model that has it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.gate import InputFile
from cpfls_cli.artifacts.model import AnyModel, LearnedFlight
from cpfls_cli.consistency.check import Audit
from cpfls_cli.effects.signals import HELD_OUT, TRAINING, RecordedFlight, Signals, in_roles, names_of, recorded
from cpfls_cli.gap.balance.weak_flight import CHANNELS
from cpfls_cli.gap.before_after import FreeRuns, LeftOut, PlaybackChange, ResidualChange, WorstWindows
from cpfls_cli.gap.compare import Comparison
from cpfls_cli.gap.naming.results import BODY, NAMES_EFFECTS, Conclusion, Estimate, GapChange, GapSize, NamedEffect
from cpfls_cli.gap.residual.dependence import GapStretch
from cpfls_cli.gap.residual.repeated import Repeatability
from cpfls_cli.gap.settings import CLEAR
from cpfls_cli.inertia import more_than_others, six_parameters
from cpfls_cli.playback.disturbance import FoundGusts
from cpfls_cli.playback.gusts import GustAxis
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.result import about, part, result
from cpfls_cli.simulators.results import Corrected
from cpfls_cli.validation.trust import capped, trust_by_playback
from cpfls_cli.vehicle.settings import VehicleSettings

if TYPE_CHECKING:
    from cpfls_cli.gap.before_after import BeforeAfter
    from cpfls_cli.gap.diagnose import DiagnosisRun


_TAKES_OFF = 0.05
"""Share of a gap from which on refitted numbers of the vehicle are said to take some of it off."""


class _OfGap:
    """What has a gap before and after."""

    if TYPE_CHECKING:
        gap: GapChange

    @property
    def gap_before(self) -> dict[str, Any]:
        """The gap of the model as given, for machines: lists over x, y, z."""
        return GapSize(self.gap.before, self.gap.before_floors).as_summary

    @property
    def gap_after(self) -> dict[str, Any]:
        """The gap with the effects, for machines: lists over x, y, z."""
        return GapSize(self.gap.after, self.gap.after_floors).as_summary


@result
class Diagnosis(Conclusion, _OfGap):
    """Which physical effect a model misses, judged on flights that the fit did not see."""

    FORMAT: ClassVar = "cpfls/diagnosis"
    SHOWN: ClassVar = ("where", "gap_before", "gap_after", "repeatability", "disturbance", "parameters")

    repeatability_before: Repeatability | None = part(None, brief=False)
    repeatability_after: Repeatability | None = part(None, brief=False)
    air: FoundGusts | None = part(None, brief=False)
    playback: PlaybackChange | None = part(None)
    worst: tuple[GapStretch, ...] = part((), brief=False)
    residual: ResidualChange = part(brief=False)
    picture: WorstWindows | None = part(None, brief=False)
    run: FreeRuns | None = part(None, brief=False)
    audit: Audit = part()
    split: str = about("which flights were for training and which were held out, and why")
    warnings: tuple[str, ...] = about("what to know about the flights", "flight_note")
    seen: tuple[str, ...] = about(
        "flights that are given twice, and flights that judge a model that learned from them", "seen", default=()
    )
    base: VehicleModel = part(brief=False)
    recorded: Mapping[str, RecordedFlight] = part(brief=False)
    learned: tuple[LearnedFlight, ...] = part((), brief=False)
    """Flights that its base learned from."""
    files: tuple[LearnedFlight, ...] = part((), brief=False)
    """Files of the flights that it learned from itself."""
    corrected: Corrected | None = part(None)
    """The simulator's file that its vehicle is from, with what was found put into it."""
    refused: str = about("why no model with the effects is written; empty where one is", default="", brief=False)

    @classmethod
    def of(
        cls,
        diagnosed: DiagnosisRun,
        change: BeforeAfter,
        training: Sequence[Signals],
        held: Sequence[Signals],
        split: str,
        warnings: Sequence[str],
        base: VehicleModel,
    ) -> Diagnosis:
        """Put it together: `split` says why these flights trained, `base` is the model that misses something."""
        air = diagnosed.air
        return cls(
            **vars(diagnosed.diagnosis),
            repeatability_before=change.repeatability_before,
            repeatability_after=change.repeatability_after,
            air=None if air is None else replace(air.found, alone=air.gusts_only),
            playback=change.playback,
            worst=change.stretches,
            residual=change.residual,
            picture=change.picture,
            run=change.run,
            audit=diagnosed.audit,
            split=split,
            warnings=tuple(warnings),
            base=base,
            recorded=recorded([*training, *held], [TRAINING] * len(training) + [HELD_OUT] * len(held)),
        )

    def learned_from(self, inputs: Mapping[str, InputFile]) -> tuple[LearnedFlight, ...]:
        """Flights that the effects were found in; of one flight alone a part, where its rest was held out.

        Parameters
        ----------
        inputs : mapping of str to InputFile
            Of its file, by role.
        """
        files = [file for role, file in inputs.items() if role.startswith("flight-")]
        training, everything = (
            [len(each.time) for each in in_roles(self.recorded, *roles)] for roles in ([TRAINING], [])
        )
        halved = len(files) == 1 and not any(role.startswith("held-out") for role in inputs)
        known = {own.sha256: own for own in self.files}
        learned = map(LearnedFlight.in_file, files, training, [sum(everything)] if halved else training)
        return tuple(known.get(own.sha256, own)._replace(samples=own.samples, of=own.of) for own in learned)

    @property
    def kept(self) -> str:
        """Why no model holds the effects that are named; empty where one does, and where none is named."""
        return self.refused.removeprefix("not extended: ") if self.verdict in NAMES_EFFECTS else ""

    @property
    def where(self) -> dict[str, Any] | None:
        """Where the gap of the model as given is largest on the held-out flights; None where all is within noise.

        Channels with a gap above noise, largest first, and the worst stretch of the first one, on the clock of the
        flight, whose name is empty where none stands out.
        """
        floors = self.gap.before_floors
        order = [index for index in np.argsort(-np.nan_to_num(floors), kind="stable") if floors[index] > CLEAR]
        if not order:
            return None
        windows = self.residual.before[:, order[0]] / self.gap.floor[order[0]]
        first = CHANNELS[order[0]]
        worst = next((each for each in self.worst if each.channel == first), None)
        names = names_of(self.recorded, HELD_OUT)
        return {
            "channels": [CHANNELS[index] for index in order],
            "flight": "" if worst is None else names[worst.flight],
            "start_s": np.nan if worst is None else worst.start_s,
            "end_s": np.nan if worst is None else worst.end_s,
            "floors": np.nan if worst is None else worst.rms_floors,
            "share_of_time": float((np.abs(windows) > CLEAR).mean()),
        }

    @property
    def repeatability(self) -> dict[str, Repeatability] | None:
        """The repeatable part of the gap, before and after; None where no flight repeats another."""
        if self.repeatability_before is None or self.repeatability_after is None:
            return None
        return {"before": self.repeatability_before, "after": self.repeatability_after}

    @property
    def disturbance(self) -> dict[str, Any] | None:
        """Gusts by axis, for machines, as torque or force and as accelerations."""
        air, columns = self.air, ("size", "low", "high", "memory", "memory_low", "memory_high")
        if air is None:
            return None
        return {
            "instrument_kind": air.instrument_kind,
            "axes": {
                axis.name: {
                    "unit": "N m" if axis.turns else "N",
                    "alone": None if air.alone is None else bool(air.alone[number]),
                    "predicted": float(air.predicted[number]),
                    **{
                        name if place < 3 else f"{name}_s": float(getattr(air, name)[number])
                        for place, name in enumerate(columns)
                    },
                    "acceleration": {
                        "unit": "rad/s^2" if axis.turns else "m/s^2",
                        **{name: getattr(axis, name) for name in columns[:3]},
                    },
                }
                for number, axis in enumerate(self.gust_axes)
            },
        }

    @property
    def inertia(self) -> Array:
        """Inertia parameters of the model, kg m^2, with the errors of its moments that are named."""
        numbers = {number.name: number.value for effect in self.effects for number in effect.numbers}
        errors = [1 + numbers.get(f"inertia_{axis}", 0.0) for axis in "xyz"]
        return np.asarray(six_parameters(self.base.vehicle.inertia_kg_m2) * [*errors, 1.0, 1.0, 1.0])

    @property
    def gust_axes(self) -> list[GustAxis]:
        """All axes of the gusts, as accelerations; none where they are not known."""
        return [] if self.air is None else list(self.air.axes(self.inertia, self.base.vehicle.mass_kg))

    @property
    def gusts(self) -> tuple[GustAxis, ...]:
        """Gusts that are all of the residual, by axis; none where they are not identified."""
        return self._gusts(alone=True)

    @property
    def partial_gusts(self) -> tuple[GustAxis, ...]:
        """Gusts that are a part of the residual, by axis; none where they are not identified."""
        return self._gusts(alone=False)

    def _gusts(self, *, alone: bool) -> tuple[GustAxis, ...]:
        if self.air is None or self.air.alone is None or self.contradictions:
            return ()
        pairs = zip(self.gust_axes, self.air.alone, strict=True)
        return tuple(axis for axis, own in pairs if own == alone and np.isfinite(axis.size))

    @property
    def only_gusts(self) -> bool:
        """Whether a gap remains that is known not to be repeatable."""
        left = (self.gap.after_floors > CLEAR).any() and not self.contradictions
        return bool(left) and self.repeatability_after is not None and self.repeatability_after.nothing

    @property
    def numbers_take_off(self) -> bool:
        """Whether the vehicle's own numbers, refitted, take a visible part of a gap off."""
        rows = (self.residual.parameters, self.residual.before)
        left, given = (np.sqrt(np.nansum(each**2, axis=0)) for each in rows)
        return bool(((left < (1 - _TAKES_OFF) * given) & (self.gap.before_floors > CLEAR)).any())

    @property
    def remarks(self) -> tuple[str, ...]:
        """Notes on the diagnosis itself, without what the sensors say about each other."""
        said = {*self.audit.warnings, *self.audit.notes, *self.contradictions, *self.differences}
        return tuple(note for note in self.notes if note not in said)


@result
class Disagreement(Comparison):
    """Where a model and flights disagree, with the flights."""

    FORMAT: ClassVar = "cpfls/disagreement"
    SHOWN: ClassVar = ("flights", "gap", "stretches")

    warnings: tuple[str, ...] = about("what to know about the flights", "flight_note")
    base: VehicleModel = part(brief=False)
    recorded: Mapping[str, RecordedFlight] = part(brief=False)
    learned: tuple[LearnedFlight, ...] = part((), brief=False)
    """Flights that its base learned from."""
    files: tuple[LearnedFlight, ...] = part((), brief=False)
    """Files of its own flights."""

    @property
    def flights(self) -> list[str]:
        """Names of the flights."""
        return names_of(self.recorded)

    @property
    def stretches(self) -> list[dict[str, Any]]:
        """Stretches of time with the largest gap, for machines."""
        return [each._asdict() | {"flight": self.flights[each.flight]} for each in self.worst]

    def is_base(self, stated: VehicleSettings) -> bool:
        """Tell whether it was made with the vehicle of a config and no effects, which `cpfls diagnose` starts from."""
        # Guesses of the config, once they stand in a model, are numbers like others.
        own, wanted = ({**vars(each), "unknown": ()} for each in (self.base.vehicle, stated))
        return self.base.is_rigid_body and own == wanted


@result
class Extended(AnyModel, _OfGap):
    """A model with the effects that it missed in it, refitted together."""

    FORMAT: ClassVar = "cpfls/extended"
    MADE_BY: ClassVar = "extend"
    SHOWN: ClassVar = ("trust", "gap_before", "gap_after", "warnings")

    model: VehicleModel = part()
    learned_from: tuple[LearnedFlight, ...] = part(default=())
    """Flights that it was found in, those of its base among them."""
    inertia: Array = about(
        "Ixx Iyy Izz Ixy Ixz Iyz: of the rigid body, or what the model gets", "6", unit="kg m^2", frame=BODY
    )
    thrust_scale: float = about("thrust over that of the vehicle in the config")
    effects: tuple[NamedEffect, ...] = part()
    vehicle_numbers: tuple[Estimate, ...] = part(brief=False)
    gap: GapChange = part(brief=False)
    playback: PlaybackChange | None = part(default=None)
    left_out: tuple[LeftOut, ...] = part(default=(), brief=False)
    """Effects that no vehicle for other programs holds."""

    @property
    def contradictions(self) -> tuple[str, ...]:
        """Contradictions within the flights that it was found in."""
        return () if self.model.repairs is None else self.model.repairs.contradictions

    @property
    def trust(self) -> str:
        """What playback on flights held out says of it, as far as they do not contradict themselves."""
        return capped(trust_by_playback(self.playback), self.contradictions)

    @property
    def impossible(self) -> tuple[str, ...]:
        """Moments of inertia that are more than the other two together; others are as stated, or as they were found."""
        return tuple(f"inertia.{name}" for name in more_than_others(self.inertia.tolist()))

    @property
    def warnings(self) -> tuple[str, ...]:
        """Axes that the extension serves ill, although it serves the whole well."""
        gap = self.gap
        return tuple(
            f"held out, {CHANNELS[index]}: the gap grows, {gap.before_floors[index]:.3g} -> "
            f"{gap.after_floors[index]:.3g} floors, although the sum over all channels shrinks"
            for index in gap.worse_axes
        )
