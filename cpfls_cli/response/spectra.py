"""Frequency responses by averages over windows of several lengths, with instruments: of the vehicle, not of its loop.

A vehicle under an autopilot flies in a loop: its rotors answer what disturbs its motion. The usual estimate
``S_uy / S_uu`` then shows a mixture of vehicle and autopilot. An instrument z moves the vehicle and knows nothing of
the disturbance, such as a logged setpoint or the same path flown again: ``S_zy / S_zu`` is of the vehicle alone.
`mismatch` is how far the response of a model is from that.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from math import ceil, floor, log10
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from cpfls_cli.arrays import Array, BoolArray, ComplexArray, IntArray, Numbers, runs, stretches
from cpfls_cli.estimation.estimate import fits_of_others
from cpfls_cli.estimation.spectra import coherence
from cpfls_cli.result import about, part, result
from cpfls_cli.rounding import at_most

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
    apart = _floored_decibels(ratio) ** 2 + _PHASE * np.degrees(np.angle(ratio)) ** 2
    chosen = np.unique(np.linspace(0, len(frequency) - 1, _MOST_POINTS).round().astype(int))
    weight = (1.58 * (1 - np.exp(-response.clearness[part][chosen]))) ** 2
    cost = 20.0 * float((weight * apart[chosen]).mean())
    off = (20.0 * apart > ACCEPTABLE) & (np.abs(ratio - 1) > _SURE * response.random_error[part])
    return Mismatch(cost=cost, band=band, deviations=tuple(_deviations(frequency, ratio, off)))


def _floored_decibels(ratio: ComplexArray) -> Array:
    return np.asarray(20 * np.log10(np.maximum(np.abs(ratio), _LEAST)))


def _deviations(frequency: Array, ratio: ComplexArray, off: BoolArray) -> list[Deviation]:
    """Cut a band into stretches in which a model is right, too strong, too weak, late or early."""
    gain, phase = _floored_decibels(ratio), np.degrees(np.angle(ratio))
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
    gain = float(10 ** (_floored_decibels(ratio).mean() / 20))
    # Angles are averaged as directions: those at half a turn have either sign.
    phase = float(np.degrees(np.angle(np.exp(1j * np.angle(ratio)).mean())))
    return Deviation(low=float(frequency[0]), high=float(frequency[-1]), right=right, gain=gain, phase=phase)


_LENGTHS = 5  # Windows of so many lengths, from the shortest to the longest by equal ratios.
_LONGEST_S = 20.0
_SHORTEST_S = 1.0
_FEWEST_SAMPLES = 16  # Of a window: fewer do not follow its curve.
_FEWEST_WINDOWS = 5  # Lengths of the longest window that all flights together have: fewer say nothing of the error.
_PERIODS, _FEWEST_PERIODS = 8.0, 2.0
"""Of a frequency in windows that identify it, and in the longest: within fewer, lower ones leak in by some per cent."""
_OVERLAP = 0.75
_PER_DECADE = 24
_LOWEST_HZ = 0.1
_HIGHEST_HZ = 100.0
_OF_SAMPLING = 0.2
"""Highest frequency, share of that of sampling: above it a straight line between samples is no signal any more."""
_MOST_BLOCKS = 40  # Of windows, in which combinations of instruments are found apart: more cost time.
_NEIGHBOURS = 2  # Blocks of half a window: windows of those further away have no sample in common.
_RIDGE = 1e-6  # Share of the power of a column of instruments, so that two equal ones leave something to solve.
_ROUNDING = 1e-9
_TINY = np.finfo(float).tiny


class Channel(NamedTuple):
    """A signal, or the derivative of one that is never differentiated, or the sum of both."""

    values: Array | None = None  # Shape (time,).
    integral: Array | None = None  # Shape (time,): of which the derivative is meant, unit times s.

    def cut(self, part: slice) -> Channel:
        """Take a part of it."""
        return Channel(*(None if each is None else each[part] for each in self))


class Stretch(NamedTuple):
    """Signals without a pause, evenly sampled."""

    input: Array  # Shape (time,).
    output: Channel
    model: Channel | None = None  # What a model gives for the output.
    # Shape (time, column): NaN where there is none. None: the input, which is right where nothing disturbs the output.
    instrument: Array | None = None
    start: int = 0  # First sample, counted from where the path begins that a flight has in common with its repeats.


def decibels(gain: Numbers) -> Array:
    """Give the magnitude of a gain, dB; NaN where it is 0 or not known."""
    size = np.abs(gain)
    return np.asarray(20 * np.log10(size, where=size > 0, out=np.full(size.shape, np.nan)))


def degrees(gain: Numbers) -> Array:
    """Give the phase of a gain, from -180 to 180; NaN where it is 0 or not known."""
    return np.where(np.abs(gain) > 0, np.degrees(np.angle(gain)), np.nan)


def _shown(form: Callable[[Numbers], Array], name: str) -> property:
    """Make a property that gives a gain of a response in a form; NaN where it has none."""

    def shown(response: FrequencyResponse) -> Array:
        own = getattr(response, name)
        return form(np.full_like(response.gain, np.nan) if own is None else own)

    return property(shown)


@result
class FrequencyResponse:
    """A frequency response and how far to trust it."""

    SHOWN: ClassVar[tuple[str, ...]] = (
        *("magnitude_db", "phase_deg", "model_magnitude_db", "model_phase_deg"),
        *("direct_magnitude_db", "direct_phase_deg"),
    )

    instrumented: bool = about("1 where it was estimated with instruments, in all flights")
    frequency: Array = about("evenly spread on a logarithmic scale", "frequency", unit="Hz")
    gain: ComplexArray = about(
        "output over input; not finite where no window identifies it", "frequency", unit="SI", gaps=True, brief=False
    )
    model: ComplexArray | None = about(
        "the same of the model, by the same windows and instruments", "frequency", unit="SI", gaps=True, brief=False
    )
    direct: ComplexArray = about("the measured one without instruments", "frequency", unit="SI", gaps=True, brief=False)
    coherence_input: Array = about("share of the input that the instruments explain; 1 without", "frequency", gaps=True)
    coherence_output: Array = about(
        "share of the output that the instruments explain; without, the input", "frequency", gaps=True
    )
    random_error: Array = about(
        "standard error of the measured gain over the gain; in radians that of the phase", "frequency", gaps=True
    )
    averages: Array = about("windows that count as independent", "frequency", gaps=True)

    magnitude_db, phase_deg = _shown(decibels, "gain"), _shown(degrees, "gain")
    """Magnitude in dB and phase from -180 to 180 degrees of the measured response, shape (frequency,)."""
    model_magnitude_db, model_phase_deg = _shown(decibels, "model"), _shown(degrees, "model")
    """The same of the model; NaN without one."""
    direct_magnitude_db, direct_phase_deg = _shown(decibels, "direct"), _shown(degrees, "direct")
    """The same without instruments."""

    @property
    def columns(self) -> dict[str, Array]:
        """All that is known by frequency, shape (frequency,), by names with units."""
        plain = ("coherence_input", "coherence_output", "random_error", "averages")
        return {name: getattr(self, name) for name in (*FrequencyResponse.SHOWN, *plain)}

    @property
    def coherence(self) -> Array:
        """The smaller of both coherences, shape (frequency,): an estimate is no better than its weaker half."""
        return np.minimum(self.coherence_input, self.coherence_output)

    @property
    def clearness(self) -> Array:
        """The coherence that counts, shape (frequency,)."""
        return clearness(self.coherence, self.random_error, self.averages, self.instrumented)


def frequency_response(stretches: Sequence[Stretch], period: float) -> FrequencyResponse | None:
    """Estimate ``G = S_zy / S_zu`` over windows of five lengths, weighed at each frequency by their random errors.

    Windows are Hann's, blind to a constant and to a drift; a derivative is moved onto the window by parts. Of several
    instruments those combinations are taken, frequency by frequency, that follow the input. They are found in windows
    of other parts of the path, in all flights alike: else many instruments, or a repeat that is an instrument for what
    is one for it, would find the disturbance again. With e = y - G u the random error is
    ``sqrt(S_ee / (2 n |G|^2 S_uu g^2))``, g^2 the coherence of instrument and input; with the input for instrument it
    is Bendat and Piersol's ``sqrt((1 - g^2) / (2 n g^2))``.

    `stretches`: all with a model, or none; all with as many instruments, or none. One without them among others that
    have some is left out.
    `period`: s.
    None where no stretch is long enough.
    Reference: Tischler and Remple, *Aircraft and Rotorcraft System Identification*, chapters 7 and 10 (random error;
    composite windows: spectra are averaged with the squares of ``(error / least error)^-4``); Bendat and Piersol,
    *Random Data*; Angrist, Imbens and Krueger 1999 (instruments found without the sample that they are used in).
    """
    instrumented = any(stretch.instrument is not None for stretch in stretches)
    usable = [part for stretch in stretches for part in _known(stretch, instrumented)]
    lengths = _lengths(usable, period)
    if not lengths:
        return None
    top = min(_OF_SAMPLING / period, _HIGHEST_HZ)
    lowest = max(_FEWEST_PERIODS / ((lengths[-1] - 1) * period), _LOWEST_HZ)
    # Numbers of one scale for all flights, so that curves of several can be put side by side.
    steps = range(ceil(_PER_DECADE * log10(lowest) - _ROUNDING), floor(_PER_DECADE * log10(top) + _ROUNDING) + 1)
    frequency = np.array([10.0 ** (step / _PER_DECADE) for step in steps])
    if not len(frequency):
        return None
    found = []
    for length in lengths:
        fewest = _FEWEST_PERIODS if length == lengths[-1] else _PERIODS
        known = frequency >= fewest / ((length - 1) * period) * (1 - _ROUNDING)
        if known.any():
            analysis = _Analysis.of(length, period, frequency[known])
            found.append(_spectra(usable, analysis, known, instrumented))
    return _of_spectra(frequency, _composite(found), instrumented)


def _known(stretch: Stretch, instrumented: bool) -> Iterator[Stretch]:
    """Cut out where the instruments are known."""
    if not instrumented:
        yield stretch
    elif stretch.instrument is not None:
        for first, after in runs(np.asarray(np.isfinite(stretch.instrument).all(axis=1))):
            part = slice(first, after)
            model = None if stretch.model is None else stretch.model.cut(part)
            yield Stretch(
                stretch.input[part], stretch.output.cut(part), model, stretch.instrument[part], stretch.start + first
            )


def _lengths(stretches: Sequence[Stretch], period: float) -> list[int]:
    """Choose the lengths of the windows in samples, the shortest first."""
    samples = [len(stretch.input) for stretch in stretches]
    longest = min(max(samples, default=0), sum(samples) // _FEWEST_WINDOWS, round(_LONGEST_S / period) + 1)
    shortest = max(round(_SHORTEST_S / period) + 1, _FEWEST_SAMPLES)
    return (
        [] if longest < shortest else np.unique(np.geomspace(shortest, longest, _LENGTHS).round().astype(int)).tolist()
    )


class _Analysis(NamedTuple):
    """Windows of one length times waves: what signals and integrals are multiplied with, shape (length, frequency)."""

    wave: Array
    slope: Array
    hop: int
    correlation: Array

    @classmethod
    def of(cls, length: int, period: float, frequency: Array) -> _Analysis:
        """Make them: ``w(t) (exp(-j 2 pi f t) - a - b t)``, with a and b such that constants and drifts vanish."""
        place = np.linspace(-0.5, 0.5, length)
        time, duration = place * (length - 1) * period, (length - 1) * period
        window = np.cos(np.pi * place) ** 2
        window_slope = -np.pi / duration * np.sin(2 * np.pi * place)
        wave = np.exp(-2j * np.pi * time[:, None] * frequency)
        plain = np.stack([np.ones(length), time], axis=1)
        seen = np.linalg.solve(plain.T @ (window[:, None] * plain), plain.T @ (window[:, None] * wave))
        left = wave - plain @ seen
        slope = window_slope[:, None] * left + window[:, None] * (-2j * np.pi * frequency * wave - seen[1])
        hop = max(1, round((1 - _OVERLAP) * length))
        overlaps = [float(window[lag:] @ window[: length - lag]) for lag in range(0, length, hop)]
        # Of unit power: spectra of windows of several lengths are averaged.
        size = np.sqrt((np.abs(window[:, None] * left) ** 2).sum(axis=0))
        return cls(window[:, None] * left / size, slope / size, hop, (np.array(overlaps) / overlaps[0]) ** 2)

    def of_values(self, values: Array) -> Array:
        """Transform a signal, shape (window, frequency)."""
        return self._applied(values, self.wave)

    def of_channel(self, channel: Channel) -> Array:
        """Transform a channel, shape (window, frequency), its derivative by parts."""
        direct = 0.0 if channel.values is None else self.of_values(channel.values)
        by_parts = 0.0 if channel.integral is None else -self._applied(channel.integral, self.slope)
        return np.asarray(direct + by_parts)

    def _applied(self, values: Array, wave: Array) -> Array:
        # A constant goes first: windows are blind to it, rounding is not.
        frames = sliding_window_view(values - values.mean(), len(wave))[:: self.hop]
        return np.asarray(frames @ wave.real + 1j * (frames @ wave.imag))

    def independent(self, windows: int) -> float:
        """Count the windows that would scatter as much if they did not overlap (Welch 1967)."""
        lags = np.arange(1, min(len(self.correlation), windows))
        return windows / (1 + 2 * float(((1 - lags / windows) * self.correlation[lags]).sum()))


class _Spectra(NamedTuple):
    """Power and cross spectra over windows of one length or several, shape (frequency,); NaN where not known."""

    zz: Array
    zu: ComplexArray
    zy: ComplexArray
    uu: Array
    yy: Array
    uy: ComplexArray
    zm: ComplexArray
    averages: Array


def _spectra(stretches: Sequence[Stretch], analysis: _Analysis, known: BoolArray, instrumented: bool) -> _Spectra:
    """Average over windows of one length, at the frequencies that they identify."""
    length = len(analysis.wave)
    long = [stretch for stretch in stretches if len(stretch.input) >= length]
    u = np.concatenate([analysis.of_values(stretch.input) for stretch in long])
    y = np.concatenate([analysis.of_channel(stretch.output) for stretch in long])
    modelled = [analysis.of_channel(stretch.model) for stretch in long if stretch.model is not None]
    m = np.concatenate(modelled) if modelled else np.full_like(y, np.nan)
    z = _instrument(long, analysis, u) if instrumented else u
    count = sum(analysis.independent((len(stretch.input) - length) // analysis.hop + 1) for stretch in long)
    whole = []
    for first, second in ((z, z), (z, u), (z, y), (u, u), (y, y), (u, y), (z, m)):
        values = np.full(len(known), np.nan, dtype=complex)
        values[known] = (first.conj() * second).mean(axis=0)
        whole.append(values)
    zz, zu, zy, uu, yy, uy, zm = whole
    averages = np.where(known, count, np.nan)
    return _Spectra(zz.real, zu, zy, uu.real, yy.real, uy, zm, averages)


def _instrument(stretches: Sequence[Stretch], analysis: _Analysis, u: Array) -> Array:
    """Transform the instruments and join them to one, shape (window, frequency)."""
    each = []
    for stretch in stretches:
        assert stretch.instrument is not None, "what has none was left out"
        each.append(np.stack([analysis.of_values(column) for column in stretch.instrument.T], axis=2))
    z = np.concatenate(each)
    if z.shape[2] == 1:
        return np.asarray(z[:, :, 0])
    z = z / np.sqrt(np.maximum((np.abs(z) ** 2).mean(axis=0), _TINY))
    number = _blocks(stretches, analysis)
    blocks = int(number.max()) + 1
    power = np.array([np.einsum("nfk,nfl->fkl", z[number == b].conj(), z[number == b]) for b in range(blocks)])
    cross = np.array([np.einsum("nfk,nf->fk", z[number == b].conj(), u[number == b]) for b in range(blocks)])
    weights = fits_of_others(power, cross[..., None], _RIDGE * len(z), _NEIGHBOURS)[..., 0]
    return np.asarray(np.einsum("nfk,nfk->nf", z, weights[number]))


def _blocks(stretches: Sequence[Stretch], analysis: _Analysis) -> IntArray:
    """Tell which block of the path each window begins in, shape (window,)."""
    length = len(analysis.wave)
    starts = [stretch.start + np.arange(0, len(stretch.input) - length + 1, analysis.hop) for stretch in stretches]
    begin = np.concatenate(starts)
    begin = begin - begin.min()
    return np.asarray(begin // max(length // 2 + 1, int(begin.max()) // _MOST_BLOCKS + 1), dtype=np.int64)


def _composite(found: Sequence[_Spectra]) -> _Spectra:
    """Average spectra over the lengths of windows, the surer ones with more weight (see `frequency_response`)."""
    if len(found) == 1:
        return found[0]
    error = np.array([_random_error(each) for each in found])
    seen = np.isfinite([each.averages for each in found])
    known = np.where(seen & np.isfinite(error), np.maximum(error, _TINY), np.inf)
    least = known.min(axis=0)
    # Where no length has a finite error all count alike.
    some = np.isfinite(least)
    weight = np.where(some, np.where(some, least, 1.0) / known, seen) ** 8
    weight = weight / np.maximum(weight.sum(axis=0), _TINY)
    joined = (np.where(weight > 0, weight * np.array(values), 0.0).sum(axis=0) for values in zip(*found, strict=True))
    return _Spectra(*joined)


def _random_error(spectra: _Spectra) -> Array:
    """Estimate the standard error of the gain over the gain, shape (frequency,); see `frequency_response`."""
    with np.errstate(divide="ignore", invalid="ignore"):
        gain = spectra.zy / spectra.zu
        rest = spectra.yy - 2 * (gain.conj() * spectra.uy).real + np.abs(gain) ** 2 * spectra.uu
        strength = spectra.uu * coherence(spectra.zu, spectra.zz * spectra.uu, spectra.averages)
        found = np.sqrt(np.maximum(rest, 0.0) / (2 * spectra.averages * np.abs(gain) ** 2 * strength))
    # Where nothing of the input is the instrument's anything is possible.
    return np.asarray(np.where(strength == 0.0, np.inf, found))


def _of_spectra(frequency: Array, spectra: _Spectra, instrumented: bool) -> FrequencyResponse:
    with np.errstate(divide="ignore", invalid="ignore"):
        gain, model, direct = spectra.zy / spectra.zu, spectra.zm / spectra.zu, spectra.uy / spectra.uu
    return FrequencyResponse(
        frequency=frequency,
        gain=gain,
        model=None if np.isnan(model).all() else model,
        direct=direct,
        coherence_input=coherence(spectra.zu, spectra.zz * spectra.uu, spectra.averages),
        coherence_output=coherence(spectra.zy, spectra.zz * spectra.yy, spectra.averages),
        random_error=_random_error(spectra),
        averages=spectra.averages,
        instrumented=instrumented,
    )
