"""Results of a diagnosis as typed objects, and the verdict that follows from them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.effects.registry import CATALOGUE, effect
from cpfls_cli.gap.balance.weak_flight import Candidate
from cpfls_cli.gap.residual.rotor_loss import RotorLoss
from cpfls_cli.gap.settings import CLEAR, COUNTS, ERRORS, OFF, VISIBLE, GapSettings
from cpfls_cli.result import about, part, result

BODY = "body (FLU)"
_EVALUATED = ("wrench", "actuator")
"""Kinds of effects that are part of a model; faults of sensors are repaired, numbers of the vehicle refitted."""


class GapVerdict(StrEnum):
    """Verdict on a gap."""

    NAMED = "NAMED"
    PARTIAL = "PARTIAL"
    AMBIGUOUS = "AMBIGUOUS"
    UNEXPLAINED = "UNEXPLAINED"
    CONTRADICTED = "CONTRADICTED"
    FLIGHTS_DIFFER = "FLIGHTS_DIFFER"
    NO_GAP = "NO_GAP"
    NOT_EXCITED = "NOT_EXCITED"


NAMES_EFFECTS = (GapVerdict.NAMED, GapVerdict.PARTIAL, GapVerdict.AMBIGUOUS)
"""Verdicts whose effects a model can be given."""


@dataclass(frozen=True)
class Estimate:
    """An estimated number with its 95 % confidence interval, and the range that is possible on the vehicle."""

    name: str = about("of the number")
    unit: str = about("1 for a share, or an error relative to the number of the model")
    value: float = about("estimate", unit="SI")
    low: float = about("lower end of the 95 % interval", unit="SI", gaps=True)
    high: float = about("upper end of the 95 % interval", unit="SI", gaps=True)
    plausible: tuple[float, float] = about("least and largest value that is physically possible", "2", gaps=True)

    @property
    def impossible(self) -> bool:
        """Whether it is surely beyond what is possible."""
        return self.high < self.plausible[0] or self.low > self.plausible[1]


@result
class NamedEffect:
    """An effect with all its numbers, enough to evaluate it."""

    SHOWN: ClassVar = ("coefficients",)

    name: str = about("identifier, see `cpfls effects`")
    shape: Mapping[str, float] = about("what it depends on nonlinearly", unit="SI", brief=False)
    linear: Array = about("coefficients of its columns", "number", unit="SI", ragged=True, brief=False)
    numbers: tuple[Estimate, ...] = part(brief=False)
    p_value: float = about("probability that chance explains as much, over the whole catalogue")
    share: float = about("part of the gap above the floor that returns without it")
    sentence: str = about("what it means, in plain words")
    identified: bool = about(
        "whether the flights identify its numbers; in gusts a fit that no instruments support shows the loop too",
        default=True,
    )

    @property
    def coefficients(self) -> dict[str, Estimate]:
        """Physical coefficients, then shapes, by name."""
        return {each.name: each for each in self.numbers}

    @property
    def kind(self) -> str:
        """Wrench, actuator, sensor or parameter."""
        return CATALOGUE[self.name].kind

    @property
    def of_log(self) -> bool:
        """Whether the audit of the sensors tests it: then it is a fault of the log, whatever it is in a model."""
        return CATALOGUE[self.name].test is not None

    @property
    def candidate(self) -> Candidate | None:
        """The effect with its shapes; None for faults of sensors, and for numbers of the vehicle."""
        shape = dict(self.shape)
        entry = effect(self.name).form(len(self.linear), shape)
        return Candidate(entry, shape) if entry.kind in _EVALUATED and len(shape) == len(entry.shapes) else None


@dataclass(frozen=True)
class Alternative:
    """An effect that the flights cannot separate from a named one."""

    name: str = about("identifier of the effect")
    instead_of: str = about("the named one")
    relative_gain: float = about(
        "what it explains over what the named one explains; NaN where it could not be tried", gaps=True
    )
    separated_by: str = about("the flight, or the signal, that separates them")
    jointly_with: str = about("another effect that is not named and that it needs; empty for none", default="")


@dataclass(frozen=True)
class LikelySet:
    """A set of effects with how likely it is among those compared."""

    effects: tuple[str, ...] = about("its effects", "effect")
    likely: float = about("probability among the sets compared, by the residual of blocks that no fit saw")


@dataclass(frozen=True)
class Unexplained:
    """A channel with a gap that nothing in the catalogue explains."""

    axis: str = about("the channel")
    floors: float = about("root mean square of its residual, in floors")
    signal: str | None = about("signal that it depends on most")
    share: float = about("share of the residual that signal or narrow band explains")
    frequency_hz: float | None = about("of a significant narrow band", unit="Hz")
    energy: str = about("feeds, drains or neither")


@dataclass(frozen=True)
class NotExcited:
    """An effect that these flights could not show."""

    name: str = about("identifier of the effect")
    reason: str = about("signals that are lacking, or the flight that would show it")


class GapSize(NamedTuple):
    """Gap of each channel on flights that the fit did not see: root mean square over windows, NaN where unknown."""

    value: Array  # Shape (6,), N m and N.
    floors: Array  # Shape (6,).

    @property
    def as_summary(self) -> dict[str, Any]:
        """Torque and force over x, y, z for machines."""
        pairs = {"torque_n_m": (self.value, 0), "floors": (self.floors, 0)}
        pairs |= {"force_n": (self.value, 3), "force_floors": (self.floors, 3)}
        return {name: values[first : first + 3] for name, (values, first) in pairs.items()}


@result
class GapChange:
    """Gap of each channel on held-out flights, before and after: torque about x, y, z, then force along x, y, z."""

    before: Array = about("root mean square of the model as given", "6", unit="SI", frame=BODY, gaps=True)
    after: Array = about("the same with the effects", "6", unit="SI", frame=BODY, gaps=True)
    floor: Array = about("noise floor of the held-out flights", "6", unit="SI", frame=BODY, gaps=True)
    before_floors: Array = about("gap of the model as given, in floors", "6", frame=BODY, gaps=True)
    after_floors: Array = about("gap with the effects, in floors", "6", frame=BODY, gaps=True)

    @classmethod
    def of(cls, before: GapSize, after: GapSize, floor: Array) -> Self:
        """Arrange the gap before and after; the floor has shape (6,), N m and N."""
        return cls(
            before=before.value,
            after=after.value,
            floor=np.where(np.isfinite(before.value), floor, np.nan),
            before_floors=before.floors,
            after_floors=after.floors,
        )

    @property
    def known(self) -> list[int]:
        """Indices of the channels whose gap is known."""
        return np.flatnonzero(np.isfinite(self.before_floors)).tolist()

    @property
    def has_force(self) -> bool:
        """Whether the gap of any force is known."""
        return any(index >= 3 for index in self.known)

    @property
    def loud(self) -> list[int]:
        """Indices of the channels that are above noise before or after; of none the largest."""
        above = (self.before_floors > CLEAR) | (self.after_floors > CLEAR)
        loud = [index for index in self.known if above[index]]
        return loud or ([int(np.nanargmax(self.before_floors))] if self.known else [])

    @property
    def grown(self) -> BoolArray:
        """Channels whose gap is above noise and larger with the effects than without, shape (6,)."""
        return np.asarray((self.after_floors > CLEAR) & (self.after_floors > (1 + COUNTS) * self.before_floors))

    @property
    def worse_axes(self) -> list[int]:
        """Indices of the axes about which a clear gap grows by more than formulas are off by."""
        before, after = self.before_floors[:3], self.after_floors[:3]
        return [int(c) for c in np.flatnonzero((before > CLEAR) & (after > (1 + OFF) * before))]


@result
class ByKind:
    """A share of torque and one of force; NaN where there is no gap, or no name."""

    torque: float = about("of the torque", gaps=True)
    force: float = about("of the force", gaps=True)


@result
class Conclusion:
    """What a diagnosis concludes: the effects that a model misses."""

    verdict: str = about("NAMED, PARTIAL, AMBIGUOUS, UNEXPLAINED, CONTRADICTED, FLIGHTS_DIFFER, NO_GAP or NOT_EXCITED")
    contradictions: tuple[str, ...] = about(
        "contradictions within the log or with its vehicle, including numbers that no vehicle has", "contradicted"
    )
    share: float = about("part of the held-out gap above the floor that the effects take off: the least by kind")
    share_by_kind: ByKind = part()
    differences: tuple[str, ...] = about("what differs between the training and the held-out flights", "difference")
    rotor_losses: tuple[RotorLoss, ...] = part(default=())
    effects: tuple[NamedEffect, ...] = part()
    closest: tuple[NamedEffect, ...] = part()
    alternatives: tuple[Alternative, ...] = part()
    sets: tuple[LikelySet, ...] = part()
    unexplained: tuple[Unexplained, ...] = part()
    not_excited: tuple[NotExcited, ...] = part()
    vehicle_numbers: tuple[Estimate, ...] = part(brief=False)
    gap: GapChange = part(brief=False)
    notes: tuple[str, ...] = about("what a reader should know", "remark")

    @property
    def parameters(self) -> dict[str, Estimate]:
        """Numbers of the vehicle, refitted with the effects, by name: relative errors where their unit is 1."""
        return {each.name: each for each in self.vehicle_numbers}

    @property
    def effects_of_motion(self) -> tuple[str, ...]:
        """Effects that the verdict names and that torque and force show, by identifier."""
        return tuple(each.name for each in self.effects if each.kind in _EVALUATED)

    @property
    def rivals(self) -> dict[str, list[Alternative]]:
        """Effects that could be named instead, by the named one."""
        found: dict[str, list[Alternative]] = {}
        for rival in self.alternatives:
            found.setdefault(rival.instead_of, []).append(rival)
        return found


def verdict_of(
    effects: Sequence[NamedEffect],
    alternatives: Sequence[Alternative],
    remains: bool,
    shares: Sequence[float],
    excited: bool,
    settings: GapSettings,
) -> GapVerdict:
    """Derive the verdict from named effects, rivals and the gap that remains.

    What closes the gap of the forces and leaves that of the torques has explained a part, and the other way round; so
    has an effect that is not significant jointly with the others.

    `remains`: whether a gap does, with effects as `gap_remains` says.
    `shares`: of the gap of torque or force above the floor that the effects take off flights not seen, where there is
    one.
    `excited`: whether anything moved enough to show a gap.
    """
    if not effects:
        if remains:
            return GapVerdict.UNEXPLAINED
        return GapVerdict.NO_GAP if excited else GapVerdict.NOT_EXCITED
    if max(shares) < settings.partial_share:
        return GapVerdict.UNEXPLAINED
    by_chance = any(effect.p_value > settings.significance for effect in effects)
    if min(shares) < settings.named_share or remains or by_chance:
        return GapVerdict.PARTIAL
    # What may be left without a name may be called by another one.
    main = {effect.name for effect in effects if abs(effect.share) >= 1 - settings.named_share}
    return GapVerdict.AMBIGUOUS if any(rival.instead_of in main for rival in alternatives) else GapVerdict.NAMED


def gap_remains(
    before: Array, after: Array, remainder: Sequence[Unexplained], named_share: float, effects: int
) -> bool:
    """Decide whether a gap remains with what is named: the one gate between NAMED and PARTIAL.

    A gap is above `CLEAR` floors. It remains where a channel keeps more of it than names may leave, or several times
    that limit and more than a formula may be off by; with several effects wherever there is one, because one may fill
    in for what the formula of another is off by. A residual that depends on a signal, or has a narrow band, is a second
    cause where that part of it counts and is visible.

    `before`, `after`, shape (6,), floors: on held-out flights, with the vehicle's own parameters refitted, and with so
    many named effects.
    `remainder`: residuals of the training flights.
    `named_share`: of the gap above the floor that has to go.
    """
    large = (after > ERRORS * CLEAR) & (after > OFF * before)
    kept = (effects > 1) | large | (after**2 - 1 > (1 - named_share) * np.maximum(before**2 - 1, 0.0))
    return bool(((after > CLEAR) & kept).any()) or any(_second_cause(each, before) for each in remainder)


def _second_cause(unexplained: Unexplained, before: Array) -> bool:
    kind = slice(0, 3) if unexplained.axis.startswith("torque") else slice(3, 6)
    part = unexplained.share * unexplained.floors**2
    return part > max(COUNTS * float(np.nanmax(before[kind], initial=1.0)) ** 2, VISIBLE**2)
