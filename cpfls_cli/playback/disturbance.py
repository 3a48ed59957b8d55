"""How large gusts are and how long they last, by the non-repeatable part of a balance of torque and force.

Along a flight, what a model's torque and force lack of what the motion takes is gust, noise, and what the model lacks.
The last is repeatable in other runs of the path, or follows what was asked for; the first two do not. Their power by
frequency is that of a Gauss-Markov process, with the white noise of gyroscope and velocity, which a derivative makes
grow with frequency, and that of the rotor speeds.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType
from typing import ClassVar, NamedTuple

import numpy as np
import numpy.typing as npt

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.blocks import BLOCK_S, ENOUGH_BLOCKS, block_length, contiguous, half_width, jackknife_error, mean_error
from cpfls_cli.estimation.estimate import FOLDS, fits_of_others
from cpfls_cli.estimation.spectra import GaussMarkov, most_likely
from cpfls_cli.inertia import INERTIA_PARAMETERS
from cpfls_cli.playback.flight import PlaybackFlight
from cpfls_cli.playback.gusts import GUST_AXES, GustAxis, Gusts
from cpfls_cli.playback.innovations import MOST_PREDICTED, PER_WINDOW, blows, residual_innovations
from cpfls_cli.playback.instruments import InstrumentKind, Instruments
from cpfls_cli.playback.lack import AxisLack, Lack, lack_of
from cpfls_cli.playback.loop import during, wrench_during
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.result import about, part
from cpfls_cli.weak_form.windows import FEWEST_SAMPLES, Windows, windows

_Complex = npt.NDArray[np.complex128]

_PIECE_S, _SHORTEST_S = 8.0, 3.0
"""Pieces whose power is taken by frequency: several times what gusts remember; the shortest that show anything."""
_RUN_SHARE = 0.4
"""Of the longest run, that a piece may take."""
_OVERLAP = 0.75
_TOP_HZ, _TOP_SHARE = 6.0, 0.2
"""Highest frequency, and the share of the sampling rate that it stays below: above, rotors and sensors have a say."""
_MEMORY_S = (0.05, 8.0)
"""What a gust may remember: below, it is white like noise within the band; above, a piece does not see it end."""
_BEGIN_S = (0.2, 1.0)
_EDGE = 1.02
"""Factor from a bound of the memory within which it lies on the bound."""
_BLOCKS = 16
"""Into which flights are cut, unless blocks get longer than pieces or shorter than what a piece mostly sees."""
_KNOWN, _SEEN = 3.0, 0.1
"""Ratio of the ends of an interval up to which a size is known, and the least share of the residual that it has."""
_LAG_S, _LAGS, _RIDGE = 0.1, 5, 1e-6
"""What was asked for is answered within half a second."""
_NEW_S, _RARE = 0.4, 0.01
"""Past windows that are asked, and how surely innovations may grow with them."""
_FAR, _NOISE, _AT_END = 12.0, 3.0, 1e-3
"""Logarithms: of factors by which powers may be off where they begin, noise upwards, and what is near a bound."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FoundGusts:
    """Gusts in flights by body axis, torque then force, with 95 % intervals; white noise as of `Gusts`.

    Attributes
    ----------
    noise : array, shape (axis, 2)
        Variance of the white noise with them, and of that which a derivative is taken of, as of samples; in no file.
    predicted_without : array, shape (block, axis)
        What is predicted without each block, for its errors; in no file.
    """

    SHOWN: ClassVar = ("name",)

    size: Array = about("standard deviation, N m or N; not finite where it is not known", "gust", unit="SI", gaps=True)
    low: Array = about("lower end of its 95 % interval; 0 where it is not known", "gust", unit="SI", gaps=True)
    high: Array = about(
        "upper end; where no size is known that of all that is left, and not finite where the body is not known either",
        "gust",
        unit="SI",
        gaps=True,
    )
    memory: Array = about("time in which a gust falls to 37 %", "gust", unit="s", gaps=True)
    memory_low: Array = about("lower end of its 95 % interval", "gust", unit="s", gaps=True)
    memory_high: Array = about("upper end of it", "gust", unit="s", gaps=True)
    instrument_kind: InstrumentKind = about(
        "what separates gusts from what a model lacks: repeats, setpoints, past, none"
    )
    predicted: Array = about(
        "share of the residual that repeats or setpoints predict; by the past, of its innovations", "gust", gaps=True
    )
    alone: BoolArray | None = about("whether all that is left of a gap is gusts and noise", "gust", default=None)
    white: Array | None = about(
        "white noise with it, as of a step of 1 s, N m s^0.5 or N s^0.5", "gust", unit="SI", gaps=True, default=None
    )
    lack: Lack | None = part(default=None)
    noise: Array = field(default_factory=lambda: np.zeros((0, 2)))
    predicted_without: Array = field(default_factory=lambda: np.zeros((0, 0)))

    @property
    def name(self) -> tuple[str, ...]:
        """Axes: roll, pitch, yaw, x, y, z."""
        return GUST_AXES[: len(self.size)]

    def axes(self, inertia: Array, mass: float) -> tuple[GustAxis, ...]:
        """Give each axis as the acceleration of a body of these inertia parameters, kg m^2, and this mass, kg."""
        bodies = np.append(inertia[:3], [mass] * 3)[: len(self.size)]
        sizes = (self.size / bodies, self.low / bodies, self.high / bodies)
        columns = (*sizes, self.memory, self.memory_low, self.memory_high)
        return tuple(map(GustAxis, GUST_AXES, *(column.tolist() for column in columns)))

    @property
    def predicted_error(self) -> Array:
        """Standard errors of the shares that are predicted, shape (axis,)."""
        return jackknife_error(self.predicted_without)

    @property
    def gusts(self) -> Gusts | None:
        """The gusts that are known, none on other axes; None where no size is."""
        return Gusts.known(self.size, self.memory, self.white) if np.isfinite(self.size).any() else None


RANGES = ("size", "low", "high", "memory", "memory_low", "memory_high")
"""Sizes and memories with their intervals, by their names in `FoundGusts`."""


class _Powers(NamedTuple):
    """Power of what is not repeatable.

    `power` of that and `whole` of all residuals are sums over the `pieces` of a block, shape (block, axis, frequency),
    squared units of torque and force; `left` is that of all residuals, shape (piece, axis, frequency).
    """

    power: Array
    whole: Array
    pieces: IntArray
    left: Array


class _Band(NamedTuple):
    """Pieces of flights, and waves of the frequencies in rad/s that they are taken apart into."""

    pieces: Windows
    turns: Array
    waves: Windows

    @classmethod
    def of(cls, period: float, length_s: float) -> _Band:
        pieces = windows(period, length_s, _OVERLAP)
        size, top = len(pieces.weight), min(_TOP_HZ, _TOP_SHARE / period)
        hertz = np.arange(int(top * size * period) + 1) / (size * period)
        return cls(pieces, 2 * np.pi * hertz, pieces.modulated(hertz))


def _left(band: Windows, flight: PlaybackFlight, sides: Array) -> Array:
    """Take what both sides of a balance differ by over windows, shape (time, 2, axis) to (window, axis, ...)."""
    return band.balance(-sides[:, 1], sides[:, 0], flight.stretches)


def find_gusts(
    model: VehicleModel,
    given: Instruments,
    determined: Mapping[str, bool] = MappingProxyType({}),
    *,
    identified: bool = True,
) -> FoundGusts | None:
    """Find sizes and memories of gusts in flights of a vehicle that is known; None for too short ones or several rates.

    The power of what is not repeatable is ``s^2 G(w; m) + a A(w) + b B(w)``: that of a Gauss-Markov process of size s
    and memory m seen through the pieces, of white noise through their derivative, and of white noise. All four numbers
    are fitted by Whittle's likelihood (1953); their errors come from the scatter of its slopes over pieces of the runs
    (White 1982; Uhlenbeck and Ornstein 1930).

    The constants have to be those of the vehicle: a wrong body is answered with gusts. Without repeats gusts are
    identified by the past; where that does not identify them, all residuals are counted, and no size is known. Nothing
    is known about an axis whose moment of inertia is not `determined`, and of forces where the thrust factor is not.
    `identified`: whether something identified the constants too. Those of a fit may be mixed with the loop, even where
    torque explains nearly all of the rotation, by as much as the gusts are: then they are not asked, and there is a
    bound.
    """
    rows = 6 if all(flight.translates for flight in given.flown) else 3
    sides = [_sides(model, flight)[..., :rows] for flight in given.flown]
    by_flight = [_wrench_of_parts(model, flight) for flight in given.flown]
    parts = {name: [each[name][:, :rows] for each in by_flight] for name in by_flight[0]}
    by_past = given.kind == "none" and identified
    found = gusts_in(sides, given, "past" if by_past else given.kind if identified else "none", parts)
    if found is None:
        return None
    bound = gusts_in(sides, given, "none") if by_past else None
    if bound is not None:
        found = _by_past(found, bound, given, sides)
    bodies = [f"inertia.{name}" for name in INERTIA_PARAMETERS[:3]] + ["thrust_factor"] * 3
    open_ = [not determined.get(name, True) for name in bodies[:rows]]
    for name in (*RANGES, "white"):
        getattr(found, name)[open_] = np.nan
    if found.lack is not None:
        for columns in (found.lack.share, found.lack.rest, found.lack.memory):
            columns[open_] = np.nan
    return found


def _by_past(found: FoundGusts, bound: FoundGusts, given: Instruments, sides: Sequence[Array]) -> FoundGusts:
    """Give gusts where past windows predict neither the innovations of the residual nor their size; else the bound.

    Air turns a vehicle about every axis, and pushes it where flights know their velocity.
    """
    period = given.flown[0].motion.period
    seen = windows(period, max(_NEW_S, FEWEST_SAMPLES * period), 1 - 1 / PER_WINDOW)
    left, signals_seen = [], []
    for flight, own in zip(given.flown, sides, strict=True):
        motion = flight.motion
        moves = [motion.rate, motion.rotation[:, 2], *([motion.velocity] if len(found.size) > 3 else [])]
        signals = np.hstack([flight.speed**2, *moves])
        for own_part in (each for each in flight.stretches if seen.count(each.stop - each.start)):
            left.append(seen.balance(-own[own_part, 1], own[own_part, 0]))
            signals_seen.append(seen.average(signals[own_part]))
    if not left:
        return bound
    moving = np.arange(signals_seen[0].shape[1]) >= given.flown[0].speed.shape[1]
    new = residual_innovations(seen, left, signals_seen, moving, found.noise)
    predicted, without = new.shares
    little = predicted + half_width(jackknife_error(without), len(without)) < MOST_PREDICTED
    gusty = np.isfinite(found.size) & little & ~new.grows(_RARE)
    if not blows(gusty, np.ones_like(gusty)):
        return bound
    ends = {name: np.where(gusty, getattr(found, name), getattr(bound, name)) for name in RANGES}
    white = None if found.white is None else np.where(gusty, found.white, np.nan)
    return replace(replace(found, **ends), predicted=predicted, predicted_without=without, white=white)


def _wrench_of_parts(model: VehicleModel, flight: PlaybackFlight) -> dict[str, Array]:
    """Evaluate torque and force of each part of a model in the flow of a flight, shapes (time, 6).

    The body does not turn and all rotors turn alike: what is in proportion to rates and commands, which answer what is
    played, would excite itself, and the flights identify it as numbers.
    """
    alike = np.sqrt((flight.speed**2).mean(axis=1, keepdims=True)) * np.ones(flight.speed.shape[1])
    flow = replace(flight, speed=alike, motion=flight.motion._replace(rate=np.zeros_like(flight.motion.rate)))
    found = [model.wrench_by_part(*during(model, flow, stretch)) for stretch in flight.stretches]
    return {name: np.concatenate([each[name] for each in found]) for name in found[0]}


def gusts_in(
    sides: Sequence[Array],
    given: Instruments,
    instrument_kind: InstrumentKind,
    parts: Mapping[str, Sequence[Array]] = MappingProxyType({}),
) -> FoundGusts | None:
    """Find sizes and memories of gusts in what both sides of a balance differ by; see `find_gusts`.

    Parameters
    ----------
    sides : sequence of array, shape (time, 2, axis), N m s and N m, N s and N
        For each run momentum, and what changes it.
    given : Instruments
        Of these runs.
    instrument_kind : str
        Which instruments to take.
    parts : mapping of str to sequence of array, shape (time, axis), N m and N
        For each run what parts of the model give; the residual is compared with them to show what the model lacks.

    Returns
    -------
    FoundGusts or None
        None for flights that are too short or of several rates.
    """
    period = given.flown[0].motion.period
    longest = max((part.stop - part.start for flight in given.flown for part in flight.stretches), default=0) * period
    length = min(_PIECE_S, max(_RUN_SHARE * longest, _SHORTEST_S))
    if length > longest or any(flight.motion.period != period for flight in given.flown):
        return None
    band = _Band.of(period, length)
    powers = _powers(sides, given, band, instrument_kind)
    if len(powers.pieces) < ENOUGH_BLOCKS:
        return None
    runs = min((len(others) + 1 for others in given.repeats.places if others), default=1)
    # Runs of a path are compared with each other, so a gust counts several times.
    shared = np.sqrt(2 * runs / (2 * runs - 1)) if instrument_kind == "repeats" else 1.0
    axes = [_Axis(band, power, powers.pieces) for power in powers.power.swapaxes(0, 1)]
    columns = np.array([axis.bound() if instrument_kind == "none" else axis.found(shared) for axis in axes])
    white = np.array([np.nan if instrument_kind == "none" else axis.white for axis in axes])
    lack = None
    if parts and instrument_kind in ("repeats", "setpoints"):
        rows = zip(axes, powers.left.swapaxes(0, 1), _predicted_parts(parts, given, band, instrument_kind), strict=True)
        lack = Lack.of(tuple(parts), [axis.lack(power, own) for axis, power, own in rows])
    predicted, without = _share_predicted(powers)
    none = np.full(len(axes), np.nan) if instrument_kind == "none" else 1.0
    ends = dict(zip(RANGES, columns.T[: len(RANGES)], strict=True))
    return FoundGusts(
        **ends,
        instrument_kind=instrument_kind,
        noise=columns[:, len(RANGES) :],
        predicted=none * predicted,
        predicted_without=none * (predicted + shared * (without - predicted)),
        white=white,
        lack=lack,
    )


def _share_predicted(powers: _Powers) -> tuple[Array, Array]:
    """Compute the shares of all that is left which instruments predict, shape (axis,), and without each block."""
    both = np.where(np.arange(powers.power.shape[2]) > 0, 2.0, 1.0)
    kept, whole = powers.power @ both, powers.whole @ both
    # An axis that a flight does not know has nothing that could be predicted.
    whole = np.where(whole.any(axis=0), whole, np.nan)
    without = 1 - (kept.sum(axis=0) - kept) / (whole.sum(axis=0) - whole)
    return 1 - kept.sum(axis=0) / whole.sum(axis=0), without


def _powers(sides: Sequence[Array], given: Instruments, band: _Band, instrument_kind: InstrumentKind) -> _Powers:
    """Take the power of the non-repeatable residual, by block of a run."""
    left = [_left(band.waves, flight, own) for flight, own in zip(given.flown, sides, strict=True)]
    if instrument_kind == "repeats":
        expected = [_left(band.waves, flight, given.repeats.others(n, sides)) for n, flight in enumerate(given.flown)]
    elif instrument_kind == "setpoints":
        expected = _expected(given, left, band)
    else:
        expected = [np.zeros_like(own) for own in left]
    period = given.flown[0].motion.period
    seen = sum(len(own) for own in left) * band.pieces.hop * period
    block_s = block_length(seen, _PIECE_S, BLOCK_S, _BLOCKS)
    sums, count, each_left = [], [], []
    for flight, own, known in zip(given.flown, left, expected, strict=True):
        there = np.isfinite(known).all(axis=(1, 2))
        both = np.stack([(own * np.conj(own - known)).real[there], np.abs(own[there]) ** 2], axis=1)
        block = (band.pieces.middles(flight.stretches)[there] - len(band.pieces.weight) // 2) * period // block_s
        each_left.append(both[:, 1])
        numbers, windows = np.unique(block, return_counts=True)
        sums += [both[block == each].sum(axis=0) for each in numbers]
        count += windows.tolist()
    power, whole = np.reshape(sums, (len(count), 2, *left[0].shape[1:])).swapaxes(0, 1)
    return _Powers(power, whole, np.array(count, dtype=np.int64), np.concatenate(each_left))


def _predicted_parts(
    parts: Mapping[str, Sequence[Array]], given: Instruments, band: _Band, instrument_kind: InstrumentKind
) -> _Complex:
    """Give parts of a model as instruments predict them, shape (axis, piece, part, frequency)."""
    values = [np.stack(own, axis=2) for own in zip(*parts.values(), strict=True)]
    flat = [own.reshape(len(own), -1) for own in values]
    if instrument_kind == "repeats":
        flat = [given.repeats.others(number, flat) for number in range(len(flat))]
    laid = [band.waves.average(columns, flight.stretches) for flight, columns in zip(given.flown, flat, strict=True)]
    if instrument_kind == "setpoints":
        laid = _expected(given, laid, band)
    known = np.concatenate([each[np.isfinite(each).all(axis=(1, 2))] for each in laid])
    return known.reshape(len(known), values[0].shape[1], len(parts), -1).swapaxes(0, 1)


def _sides(model: VehicleModel, flight: PlaybackFlight) -> Array:
    """Evaluate momentum, and torque and force that change it, body frame, shape (time, 2, 6)."""
    motion, inertia, mass = flight.motion, model.body.inertia, model.vehicle.mass_kg
    velocity = np.einsum("tji,tj->ti", motion.rotation, motion.velocity)
    momentum = np.hstack([motion.rate @ inertia, mass * velocity])
    sides = np.zeros((len(flight), 2, 6))
    sides[:, 0] = momentum
    for stretch in flight.stretches:
        sides[stretch, 1] = wrench_during(model, flight, stretch)
    sides[:, 1, :3] -= np.cross(motion.rate, momentum[:, :3])
    sides[:, 1, 3:] -= np.cross(motion.rate, momentum[:, 3:])
    sides[:, 1, 3:] -= mass * model.vehicle.gravity_m_s2 * motion.rotation[:, 2]
    return sides


def _expected(given: Instruments, left: Sequence[Array], band: _Band) -> list[Array]:
    """Predict the residual from the setpoints, each part of the flights by a fit to the others; NaN elsewhere.

    A delay of the setpoints is a turn of its phase.
    """
    late = np.exp(-1j * _LAG_S * np.outer(np.arange(_LAGS), band.turns))
    numbers = [number for number, own in enumerate(left) if given.setpoints[number] is not None and len(own)]
    if not numbers:
        return [np.nan * own for own in left]
    asked = np.concatenate(
        [band.waves.average(np.asarray(given.setpoints[n]), given.flown[n].stretches) for n in numbers]
    )
    instrument = (asked[:, :, None] * late).reshape(len(asked), -1, len(band.turns)).swapaxes(1, 2)
    instrument = instrument / np.maximum(np.sqrt((np.abs(instrument) ** 2).mean(axis=(0, 1))), np.finfo(float).tiny)
    own = np.concatenate([left[number] for number in numbers])
    expected, part = np.zeros_like(own), contiguous(len(own), FOLDS)
    parts = [part == fold for fold in range(FOLDS)]
    for axis in range(own.shape[1]):
        power = (np.abs(own[:, axis]) ** 2).mean(axis=0)
        # Of an axis that a flight does not know all is 0, and so is what is expected.
        weighed = np.conj(instrument) / np.where(power > 0, power, 1.0)[:, None]
        ztz = np.array([np.einsum("pfc,pfd->cd", weighed[at], instrument[at], optimize=True).real for at in parts])
        ztx = np.array([np.einsum("pfc,pf->c", weighed[at], own[at, axis]).real for at in parts])[..., None]
        size = np.trace(ztz, axis1=1, axis2=2)
        ridge = _RIDGE * (size.sum() - size) / ztz.shape[1]
        for at, fit in zip(parts, fits_of_others(ztz, ztx, ridge[:, None, None]), strict=True):
            expected[at, axis] = instrument[at] @ fit[:, 0]
    ends = np.cumsum([len(left[number]) for number in numbers])[:-1]
    found = dict(zip(numbers, np.split(expected, ends), strict=True))
    return [found.get(number, np.nan * own) for number, own in enumerate(left)]


class _Axis:
    """The non-repeatable part about one axis, and the process that has this power."""

    def __init__(self, band: _Band, power: Array, count: IntArray) -> None:
        self._period = band.pieces.period
        self._power, self._count = power, count
        self._mean = power.sum(axis=0) / count.sum()
        # Power of white noise, as acceleration and through a derivative.
        self._noise = np.array([(np.abs(kernel) ** 2).sum(axis=0) for kernel in (band.waves.weight, band.waves.slope)])
        self._process = GaussMarkov.seen_by(band.pieces.weight, self._period, band.turns)

    def bound(self) -> Array:
        """Give the size of all that is left, as columns of `FoundGusts`."""
        scale = len(self._process.lags) * self._noise[0, 0]
        blocks = (self._power[:, 0] + 2 * self._power[:, 1:].sum(axis=1)) / self._count / scale
        largest = blocks.mean() + half_width(mean_error(blocks), len(blocks))
        return np.array([np.nan, 0.0, np.sqrt(max(largest, 0.0)), *[np.nan] * 5])

    def found(self, shared: float) -> Array:
        """Give size and memory with their intervals, as columns of `FoundGusts`; the bound where they are not known.

        Errors are larger than the scatter of blocks by the factor `shared`.
        """
        numbers, free = self._fit
        half = half_width(shared * self._errors(numbers, free) * [0.5, 1.0], len(self._count))
        size, memory = float(np.exp(0.5 * numbers[0])), float(np.exp(numbers[1]))
        inside = _EDGE * _MEMORY_S[0] < memory < _MEMORY_S[1] / _EDGE
        everything = self.bound()
        if not inside or 2 * half[0] > np.log(_KNOWN) or size**2 < _SEEN * everything[2] ** 2:
            return everything
        ends = np.clip([memory * np.exp(-half[1]), memory * np.exp(half[1])], *_MEMORY_S)
        return np.array([size, size * np.exp(-half[0]), size * np.exp(half[0]), memory, *ends, *np.exp(numbers[2:])])

    @property
    def white(self) -> float:
        """White noise, as of a step of a second."""
        return float(np.sqrt(np.exp(self._fit[0][2]) * self._period))

    def lack(self, power: Array, parts: _Complex) -> AxisLack:
        """Find what the model lacks, in power of the residual by piece and its parts as they are predicted."""
        known = self._expected(self._fit[0])[0]
        both = np.where(np.arange(parts.shape[2]) > 0, 2.0, 1.0)
        squares = np.abs(parts) ** 2 @ both / (len(self._process.lags) * self._noise[0, 0])
        return lack_of(power, squares, known, self._process, _MEMORY_S)

    @cached_property
    def _fit(self) -> tuple[Array, BoolArray]:
        """Maximise the likelihood over logarithms of squared size, memory and two noises; which are on no bound."""
        powers = self._mean.max() / self._process.alike.sum(axis=1).max(), *(self._mean[-1] / self._noise[:, -1])
        # Of an axis that a flight does not know all is 0.
        begin = np.log(np.maximum(powers, np.sqrt(np.finfo(float).tiny)))
        low = np.array([begin[0] - _FAR, np.log(_MEMORY_S[0]), *(begin[1:] - _FAR)])
        high = np.array([begin[0] + _FAR, np.log(_MEMORY_S[1]), *(begin[1:] + _NOISE)])

        def spectrum(numbers: Array) -> tuple[Array, Callable[[Array], Array]]:
            expected, slopes = self._expected(numbers)
            return expected, lambda slope: slopes @ slope[0]

        starts = [np.array([begin[0], np.log(memory), *(begin[1:] - 1.0)]) for memory in _BEGIN_S]
        best = most_likely(spectrum, self._mean[None], starts, list(zip(low, high, strict=True)))
        return best, ((best > low + _AT_END) & (best < high - _AT_END))

    def _expected(self, numbers: Array) -> tuple[Array, Array]:
        """Give the power by frequency, shape (frequency,), and its derivatives by the numbers, shape (4, frequency)."""
        size, memory, *noises = np.exp(numbers)
        shape, longer = self._process.power(memory)
        white = (noise * each for noise, each in zip(noises, self._noise, strict=True))
        parts = np.array([size * shape, size * longer, *white])
        return parts[[0, 2, 3]].sum(axis=0), parts

    def _errors(self, numbers: Array, free: BoolArray) -> Array:
        """Compute standard errors of squared size and memory, as logarithms, by the scatter of slopes over blocks."""
        expected, slopes = self._expected(numbers)
        slopes = slopes[free] / expected
        scores = (self._power / expected - self._count[:, None]) @ slopes.T / self._count.sum()
        moved = np.linalg.lstsq(slopes @ slopes.T, scores.T, rcond=None)[0]
        errors, blocks = np.full(len(numbers), np.inf), len(self._count)
        # Slopes at the numbers that are fitted to them scatter less than at the true ones.
        errors[free] = np.sqrt(blocks / (blocks - free.sum()) * (moved**2).sum(axis=1))
        return errors[:2]
