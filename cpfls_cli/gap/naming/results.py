"""Results of a diagnosis as typed objects, and the verdict that follows from them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.gap.balance.weak_flight import Candidate
from cpfls_cli.gap.settings import CLEAR, COUNTS, ERRORS, OFF, GapSettings


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


@dataclass(frozen=True)
class Estimate:
    """An estimated coefficient with its 95 % confidence interval, and the range that is possible on the vehicle."""

    name: str
    unit: str
    value: float
    low: float
    high: float
    plausible: tuple[float, float]

    @property
    def impossible(self) -> bool:
        """Whether it is surely beyond what is possible."""
        return self.high < self.plausible[0] or self.low > self.plausible[1]


@dataclass(frozen=True)
class NamedEffect:
    """An effect that is part of the diagnosis; other fields are described at `EffectGroup`.

    Attributes
    ----------
    candidate : Candidate or None
        None for faults of sensors, and for numbers of the vehicle.
    linear : array, shape (coefficient,)
        Of the columns; empty where the effect has none.
    coefficients : tuple of Estimate
        Physical coefficients, then shapes.
    """

    name: str
    candidate: Candidate | None
    linear: Array
    coefficients: tuple[Estimate, ...]
    p_value: float
    share: float
    selection_frequency: float
    sentence: str


@dataclass(frozen=True)
class Alternative:
    """An effect that the flights cannot tell from a named one; its fields are described at `AlternativeGroup`."""

    name: str
    instead_of: str
    relative_gain: float
    separated_by: str
    beside: str = ""


@dataclass(frozen=True)
class LikelySet:
    """A set of effects with how likely it is among those compared."""

    effects: tuple[str, ...]
    likely: float


@dataclass(frozen=True)
class Unexplained:
    """A channel with a gap that nothing in the catalogue explains; its fields are described at `UnexplainedGroup`."""

    axis: str
    floors: float
    signal: str | None
    share: float
    frequency_hz: float | None
    energy: str


@dataclass(frozen=True)
class NotExcited:
    """An effect that these flights could not show."""

    name: str
    reason: str


@dataclass(frozen=True)
class GapSize:
    """Gap of each channel on flights that the fit did not see: root mean square over windows, NaN where unknown.

    Attributes
    ----------
    value : array, shape (6,), N m and N
    floors : array, shape (6,)
    """

    value: Array
    floors: Array


@dataclass(frozen=True)
class Diagnosis:
    """Result of a diagnosis: the effects that a model misses.

    Attributes
    ----------
    closest : tuple of NamedEffect
        What explained most where the verdict names nothing.
    parameters : mapping of str to Estimate
        Relative errors of the vehicle's own numbers, refitted with the effects.
    share : float
        Of the gap above the floor that the effects take off the held-out flights; the least of `shares`, which are
        those of ``torque`` and of ``force``, where they have a gap.
    before, after : GapSize
        Of the model as it was and with the effects, on the held-out flights.
    floor : array, shape (6,), N m and N
    torque_alone : tuple of (str, float)
        First choices of a look at the torques alone, and the share that each would explain.
    notes, contradictions, differences : tuple of str
        Sentences: all that a reader should know; what of the log contradicts itself or its vehicle; and what differs
        between the flights that were learned from and those held out.
    sets : tuple of LikelySet
        The set that the search chose, and those with another effect in the place of one of it; most likely first.
    """

    verdict: GapVerdict
    effects: tuple[NamedEffect, ...]
    closest: tuple[NamedEffect, ...]
    alternatives: tuple[Alternative, ...]
    unexplained: tuple[Unexplained, ...]
    not_excited: tuple[NotExcited, ...]
    parameters: Mapping[str, Estimate]
    share: float
    before: GapSize
    after: GapSize
    floor: Array
    torque_alone: tuple[tuple[str, float], ...]
    notes: tuple[str, ...]
    contradictions: tuple[str, ...] = ()
    differences: tuple[str, ...] = ()
    shares: Mapping[str, float] = field(default_factory=dict)
    sets: tuple[LikelySet, ...] = ()


def verdict_of(
    effects: Sequence[NamedEffect],
    alternatives: Sequence[Alternative],
    unexplained: Sequence[Unexplained],
    shares: Sequence[float],
    stays: bool,
    excited: bool,
    settings: GapSettings,
) -> GapVerdict:
    """Derive the verdict from named effects, rivals and unexplained residuals.

    What closes the gap of the forces and leaves that of the torques has explained a part, and the other way round; so
    has an effect without which chance explains as much beside the others.

    Parameters
    ----------
    unexplained : sequence of Unexplained
        Where effects were found: of those, the ones that matter.
    shares : sequence of float
        Of the gap of torque or force above the floor that the effects take off flights not seen, where there is one.
    stays : bool
        Whether an axis keeps a clear gap.
    excited : bool
        Whether anything moved enough to show a gap.
    """
    if not effects:
        if unexplained:
            return GapVerdict.UNEXPLAINED
        return GapVerdict.NO_GAP if excited else GapVerdict.NOT_EXCITED
    if max(shares) < settings.partial_share:
        return GapVerdict.UNEXPLAINED
    by_chance = any(effect.p_value > settings.significance for effect in effects)
    if min(shares) < settings.named_share or unexplained or stays or by_chance:
        return GapVerdict.PARTIAL
    # What may be left without a name may be called by another one.
    main = {effect.name for effect in effects if effect.share >= 1 - settings.named_share}
    return GapVerdict.AMBIGUOUS if any(rival.instead_of in main for rival in alternatives) else GapVerdict.NAMED


def gap_stays(before: Array, after: Array, named_share: float, effects: int) -> bool:
    """Tell whether a relevant gap of the held-out flights about or along an axis is not reduced.

    Where several effects leave a clear gap, one may fill in for what the formula of another is off by.

    Parameters
    ----------
    before, after : array, shape (6,), floors
        With the vehicle's own numbers refitted, and with so many named effects.
    named_share : float
        Of the gap above the floor that has to go.
    """
    filled = effects > 1 and bool((after > CLEAR).any())
    largest = np.repeat([np.nanmax(before[kind], initial=0.0) for kind in (slice(0, 3), slice(3, 6))], 3)
    clear = (before > CLEAR) & (before**2 > COUNTS * largest**2)
    large = (after > ERRORS * CLEAR) & (after > OFF * before)
    return filled or bool((clear & (_is_left(after, before, named_share) | large)).any())


def matters(unexplained: Unexplained, before: Array, named_share: float) -> bool:
    """Tell whether an unexplained residual is a second cause, by what it follows, or more than a name may leave.

    Parameters
    ----------
    before : array, shape (6,), floors
        The gap of each channel without effects.
    named_share : float
        Of the gap above the floor that has to go.
    """
    follows = unexplained.signal is not None or unexplained.frequency_hz is not None
    kind = slice(0, 3) if unexplained.axis.startswith("torque") else slice(3, 6)
    largest = float(np.nanmax(before[kind], initial=1.0))
    second = follows and unexplained.share * unexplained.floors**2 > COUNTS * largest**2
    return second or bool(_is_left(np.array(unexplained.floors), np.array(largest), named_share))


def _is_left(after: Array, before: Array, named_share: float) -> BoolArray:
    """Tell of each channel whether it keeps a clear gap, and more of it than a name may leave."""
    return np.asarray((after > CLEAR) & (after**2 - 1 > (1 - named_share) * np.maximum(before**2 - 1, 0.0)))
