"""How far a model's frequency response is from a measured one: the cost by axis, and at which frequencies it is off."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, ComplexArray, stretches
from cpfls_cli.result import about, part, result
from cpfls_cli.rounding import at_most

if TYPE_CHECKING:
    # Who reads what was found waits for nothing that finds it.
    from cpfls_cli.response.spectra import FrequencyResponse

ROTATION, THRUST, ROTOR_SPEED = ("roll", "pitch", "yaw"), "thrust", "rotor speed"
"""Names of the responses of rotation and specific force, and of that of the rotors' speeds to their commands."""

COHERENT = 0.6  # Coherence above which a response is judged (Tischler and Remple).
ACCEPTABLE, GOOD = 100.0, 50.0  # Costs up to which a model is acceptable and good (Tischler and Remple).
_SURE_WINDOWS = 33  # With which a coherence of 0.6 leaves a random error of 10 %.
_STRONG = 10.0
"""F statistic from which on instruments are strong (Staiger and Stock 1997): weaker ones give the loop again."""
_MOST_POINTS = 20
_FEWEST_POINTS = 8  # Of a band that is judged: an octave.
_DIP = 2  # Points in which the coherence may dip without ending a band.
_PHASE = 0.01745  # Weight of a squared degree against a squared decibel: 7.6 degrees count as 1 dB.
_SURE = 2.0  # Random errors from which on a difference is none of chance.
_SHORTEST = 3  # Points of a stretch: a single one is scatter.
_LEAST = 1e-6  # Gain over another, to which a model that does nothing is set: decibels of nothing are none.


NOT_JUDGED, NOT_ACCEPTABLE = "not-judged", "not-acceptable"


def response_word(cost: float) -> str:
    """Judge a model by its cost J: good, acceptable, not-acceptable; not-judged where it is not known."""
    if not np.isfinite(cost):
        return NOT_JUDGED
    return "good" if at_most(cost, GOOD) else "acceptable" if at_most(cost, ACCEPTABLE) else NOT_ACCEPTABLE


@result
class Deviation:
    """Frequencies over which a model is right, or off in one way."""

    low: float = about("from this frequency", unit="Hz")
    high: float = about("to this one", unit="Hz")
    right: bool = about("1 where the model is right")
    gain: float = about("gain of the model over the measured one, geometric mean")
    phase: float = about("phase of the model less the measured one, mean", unit="deg")


@result
class Mismatch:
    """How far a model is from a measured response."""

    cost: float = about("J of the model; not finite where there is no model or no band", gaps=True)
    band: tuple[float, float] | None = about(
        "frequencies over which the coherence that counts is above 0.6: first and last", "2", unit="Hz", default=None
    )
    deviations: tuple[Deviation, ...] = part(default=())


def clearness(coherence: Array, random_error: Array, averages: Array, instrumented: bool) -> Array:
    """Give the coherence that counts: with instruments that of 33 windows with the same random error, where it is more.

    What gusts add to a flight takes coherence away, however many repeats average them out; a coherence of 0.6 means
    the random error of 10 % that it usually leaves. So it is where instruments are strong. Without instruments it
    is the share that may be the loop's.

    `coherence`, `random_error`, `averages`, shape (..., frequency): see `FrequencyResponse`.
    """
    if not instrumented:
        return coherence
    strong = (averages - 1) * coherence > _STRONG * (1 - coherence)
    return np.asarray(np.where(strong, np.fmax(coherence, 1 / (1 + 2 * _SURE_WINDOWS * random_error**2)), coherence))


def judged_band(response: FrequencyResponse) -> slice | None:
    """Find the widest band of `clearness` above 0.6, in which it may dip for a point or two; None for none."""
    clear = (response.clearness > COHERENT) & np.isfinite(response.gain)
    if response.model is not None:
        clear &= np.isfinite(response.model)
    ends = np.flatnonzero(clear)
    if not len(ends):
        return None
    groups = np.split(ends, np.flatnonzero(np.diff(ends) > _DIP + 1) + 1)
    best = max(groups, key=lambda group: int(group[-1] - group[0]))
    return slice(int(best[0]), int(best[-1]) + 1) if best[-1] - best[0] + 1 >= _FEWEST_POINTS else None


def mismatch(response: FrequencyResponse) -> Mismatch:
    """Compute ``J = 20 / n sum W ((d|G| in dB)^2 + 0.01745 (d arg G in degrees)^2)`` over the band that is judged.

    ``W = (1.58 (1 - exp(-g^2)))^2`` with the coherence g^2 that counts (`clearness`), over at most 20 frequencies,
    evenly spread on a logarithmic scale. A model is off where this sum, without W, is above 100 for one frequency
    alone, and by more than twice the random error.

    Reference: Tischler and Remple, *Aircraft and Rotorcraft System Identification*, chapter 11.
    """
    part = judged_band(response)
    if part is None:
        return Mismatch(cost=np.nan)
    frequency = response.frequency[part]
    band = float(frequency[0]), float(frequency[-1])
    if response.model is None:
        return Mismatch(cost=np.nan, band=band)
    ratio = response.model[part] / response.gain[part]
    # Squared differences in decibels and degrees.
    apart = _decibels(ratio) ** 2 + _PHASE * np.degrees(np.angle(ratio)) ** 2
    chosen = np.unique(np.linspace(0, len(frequency) - 1, _MOST_POINTS).round().astype(int))
    weight = (1.58 * (1 - np.exp(-response.clearness[part][chosen]))) ** 2
    cost = 20.0 * float((weight * apart[chosen]).mean())
    off = (20.0 * apart > ACCEPTABLE) & (np.abs(ratio - 1) > _SURE * response.random_error[part])
    return Mismatch(cost=cost, band=band, deviations=tuple(_deviations(frequency, ratio, off)))


def _decibels(ratio: ComplexArray) -> Array:
    return np.asarray(20 * np.log10(np.maximum(np.abs(ratio), _LEAST)))


def _deviations(frequency: Array, ratio: ComplexArray, off: BoolArray) -> list[Deviation]:
    """Cut a band into stretches in which a model is right, too strong, too weak, late or early."""
    gain, phase = _decibels(ratio), np.degrees(np.angle(ratio))
    # 1 too strong, -1 too weak, 2 early, -2 late.
    kinds = np.where(gain**2 >= _PHASE * phase**2, np.sign(gain), 2 * np.sign(phase)).astype(int)
    kind = _without_scatter(np.where(off, kinds, 0))
    return [_deviation(frequency[a:b], ratio[a:b], bool(kind[a] == 0)) for a, b in stretches(kind)]


def _without_scatter(kind: Array) -> Array:
    """Merge stretches that are too short into their longer neighbours, the shortest first."""
    kind = kind.copy()
    while True:
        found = stretches(kind)
        sizes = [after - first for first, after in found]
        shortest = int(np.argmin(sizes))
        if sizes[shortest] >= _SHORTEST or len(found) == 1:
            return kind
        neighbours = [index for index in (shortest - 1, shortest + 1) if 0 <= index < len(found)]
        longer = max(neighbours, key=lambda index: sizes[index])
        kind[slice(*found[shortest])] = kind[found[longer][0]]


def _deviation(frequency: Array, ratio: ComplexArray, right: bool) -> Deviation:
    gain = float(10 ** (_decibels(ratio).mean() / 20))
    # Angles are averaged as directions: those at half a turn have either sign.
    phase = float(np.degrees(np.angle(np.exp(1j * np.angle(ratio)).mean())))
    return Deviation(low=float(frequency[0]), high=float(frequency[-1]), right=right, gain=gain, phase=phase)
