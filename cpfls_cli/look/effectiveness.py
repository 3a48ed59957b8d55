"""Control effectiveness about each axis: angular acceleration per unit of command, by instruments, over frequency.

Under an autopilot the command answers what disturbs the vehicle, and least squares finds a mixture of vehicle and
autopilot. A setpoint that the pilot makes moves the vehicle and knows nothing of gusts: it is the instrument.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, Numbers
from cpfls_cli.blocks import half_width, jackknife_error
from cpfls_cli.estimation.estimate import Bounds, Fit, Normal, Prior, estimate, positive_ratio, solve
from cpfls_cli.estimation.spectra import (
    FEWEST_BLOCKS,
    SHARED_BINS,
    SMOOTHED_BINS,
    BlockSpectra,
    block_spectra,
    cut_blocks,
    eroded,
    smoothed,
    transforms,
    window_starts,
    without_slow,
)
from cpfls_cli.look.flight import (
    AXES,
    NO_COMMAND,
    NO_MODEL,
    NOT_MOVED,
    TOO_SLOW,
    TOO_WIDE,
    LogFlight,
    exogenous,
    needed_s,
    too_little,
)
from cpfls_cli.look.law import flown_law, gyroscope_filters
from cpfls_cli.result import Estimate, about, part, result

STRONG = 25.0
"""F statistic of an instrument below which its estimate may fall back to that of the loop: benchmarks/look_study.py."""
NARROW, NARROW_DELAY_S = 0.4, 0.02
"""Half widths, of the logarithm of effectiveness and of the delay, above which it is not called identified."""
GAIN_FLOOR, DELAY_FLOOR_S = 0.02, 5e-4
"""Half widths that no interval is below: of straight lines between samples, clocks and the model's shape."""
_WINDOW_S, _SLOW_WINDOW_S, _WINDOWS = (1.0, 2.0), (2.0, 4.0), 25.0
"""Shortest and longest windows, and how often they fit into a flight between."""
_SLOW_HZ, _TOP_HZ, _PERIODS = 150.0, 40.0, 2.0
"""Rate of the common clock below which windows are longer; top of the band; periods of its foot in a window."""
_SLOW_S = 0.3
"""Slower motion is left out."""
_OF_CLOCK = 0.1
"""Top of the band, share of the rate of the clock, which is twice that of the slower signal: cubic splines between
samples keep all of what moves at a fifth of their rate."""
_LEAST_TOP_HZ = 4.0
"""Top of the band below which no loop of a multirotor is seen."""
_AT_HZ = (0.6, 0.8, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0)
_DELAY_UNIT_S, _MOST_DELAY_S, _LEAST_DELAY = 0.01, 0.3, 0.05
_LAG_SHARE, _LAG_SPREAD = 1.0, 1.2
"""Before: logarithm of lag over delay behind the rotors' commands, rotors of all sizes with their filters."""
_DAMPING, _DAMPING_SPREAD = 1.0, 1.0
"""Before: damping of multirotors, 1/s, and spread of its logarithm."""
_TIGHT = 0.05
_LEAD_S, _LEAD_SPREAD = 0.07, 1.2
"""Before: lead of yaw by the rotors' own angular momentum, J / (2 k omega) of a rotor whose drag is k omega^2: 0.02 s
for one of 5 cm, 0.2 s for one of 25 cm."""
_FLOOR, _OPEN = 1e-6, 300.0
_BY_CHANCE = 4.0
"""F statistic of one frequency that chance reaches once in fifty."""
_SURELY = 0.5
"""Share of what the instrument says of the command that is not chance, within the band."""
_SEEN = 1e-4
"""Share of an instrument's largest power below which it is rounding and what leaks from slower motion."""
_USUAL_DELAY_S, _LATEST_S = 0.012, 0.1
_USUAL_LEFT = 2.0
"""Power over its median that noise of one level has in a window, with room: 1.44 the mean of an exponential one."""
_TINY = float(np.finfo(float).tiny)
_DRAWS, _SEED = 200, 65
_NORMAL = 1.96
"""Standard deviations of half a 95 % interval."""
_YAW = 2

Z, U, Y, A, J, V = range(6)
"""Signals of the spectra: instrument, command, body rate and its two derivatives, derivative of the command."""


class PlantModel(NamedTuple):
    """Body rate by command, ``b (1 + s L) exp(-s tau) / ((1 + s T) (s + d))``; numbers or columns of shape (draw, 1).

    `gain` b in rad/s^2 per full command; `delay` tau, `lag` T and `lead` L, by the angular momentum of accelerated
    rotors, 0 but about yaw, in s; `damping` d in 1/s.
    """

    gain: float | Array
    delay: float | Array
    lag: float | Array
    damping: float | Array
    lead: float | Array

    @classmethod
    def of(cls, values: Array, at_hz: float) -> PlantModel:
        """Read it from estimated numbers, shape (..., number)."""
        x = np.moveaxis(values, -1, 0)
        total = _DELAY_UNIT_S * x[1]
        lag, damping = total / (1 + np.exp(-x[2])), np.exp(x[3])
        lead = np.exp(x[4]) if len(x) > 4 else np.zeros_like(lag)
        plain = cls(1.0, total - lag, lag, damping, lead)
        return plain._replace(gain=np.exp(x[0]) / np.abs(plain.acceleration(at_hz)))

    def acceleration(self, frequency: float | Array) -> Numbers:
        """Evaluate angular acceleration by command, Hz."""
        s = 2j * np.pi * frequency
        return np.asarray(self.torque(frequency) * s / (s + self.damping))

    def torque(self, frequency: float | Array) -> Numbers:
        """Evaluate angular acceleration by command where no rotation damps it."""
        return np.asarray(self.push(frequency) / (1 + 2j * np.pi * frequency * self.lag))

    def push(self, frequency: float | Array) -> Numbers:
        """Evaluate the same in front of the lag."""
        s = 2j * np.pi * frequency
        return np.asarray(self.gain * (1 + s * self.lead) * np.exp(-s * self.delay))

    def rate(self, frequency: float | Array) -> Numbers:
        """Evaluate body rate by command, Hz."""
        return np.asarray(self.torque(frequency) / (2j * np.pi * frequency + self.damping))


@result
class AxisPlant:
    """How the vehicle turns about one axis by what the autopilot commands.

    Its numbers are of the vehicle from the command to the body rate in front of the gyroscope's filters where the log
    states these, else behind them; its curves are of the body rate as logged. The delay is all that lies between a
    logged command and its effect, so that a loop of it and a law needs no further step of computing or holding.
    """

    SHOWN = ("identified",)

    axis: str = about("roll, pitch or yaw")
    verdict: str = about("identified, weak, or none")
    reason: str = about("why it is not identified; empty where it is")
    instrument: str = about("signal that moves the vehicle and knows nothing of gusts; empty where there is none")
    at_hz: float = about("frequency of the effectiveness", unit="Hz", gaps=True)
    band_hz: np.ndarray = about("lowest and highest frequency of the estimate", "end", unit="Hz", gaps=True)
    windows: int = about("windows of the estimate, overlapping by half")
    strength: float = about("F statistic of the instrument, conditional on all other numbers", gaps=True)
    coherence: float = about("of instrument and command, median over the band", gaps=True)
    effectiveness: Estimate | None = part(default=None)
    total_delay: Estimate | None = part(default=None)
    """Delay and lag of torque behind the command at that frequency, s."""
    least_squares: Estimate | None = part(default=None)
    bound: Estimate | None = part(default=None)
    frequency: np.ndarray = about("of the curves", "frequency", unit="Hz", brief=False)
    gain: np.ndarray = about(
        "angular acceleration per full command", "frequency", unit="rad/s^2", gaps=True, brief=False
    )
    phase: np.ndarray = about("of it, unwrapped", "frequency", unit="rad", gaps=True, brief=False)
    gain_error: np.ndarray = about("standard error of its logarithm", "frequency", gaps=True, brief=False)
    model_gain: np.ndarray = about("of the model", "frequency", unit="rad/s^2", gaps=True, brief=False)
    model_phase: np.ndarray = about("of the model", "frequency", unit="rad", gaps=True, brief=False)
    direct_gain: np.ndarray = about("by least squares", "frequency", unit="rad/s^2", gaps=True, brief=False)
    direct_phase: np.ndarray = about("by least squares", "frequency", unit="rad", gaps=True, brief=False)
    input_coherence: np.ndarray = about("of instrument and command", "frequency", gaps=True, brief=False)
    output_coherence: np.ndarray = about("of instrument and body rate", "frequency", gaps=True, brief=False)
    parameters: np.ndarray = about(
        "gain rad/s^2, delay s, lag s, damping 1/s, lead s of the model", "number", gaps=True, brief=False
    )
    draws: np.ndarray = about("the same of plants that the log leaves possible", "draw", "number", brief=False)

    @property
    def identified(self) -> bool:
        """Whether the numbers are of the vehicle, and sure enough to be used."""
        return self.verdict == "identified"

    @property
    def model(self) -> PlantModel:
        """The plant that was found."""
        return PlantModel(*(float(each) for each in self.parameters))

    @property
    def possible(self) -> PlantModel:
        """Plants that the log leaves possible, each number of shape (draw, 1)."""
        return PlantModel(*(self.draws[:, [place]] for place in range(self.draws.shape[1])))


def effectiveness(flight: LogFlight) -> tuple[AxisPlant, ...]:
    """Estimate the control effectiveness about each axis."""
    return tuple(axis_effectiveness(flight, axis) for axis in range(3))


def axis_effectiveness(flight: LogFlight, axis: int) -> AxisPlant:
    """Estimate the control effectiveness about one axis, by the first instrument that is exogenous and strong."""
    usable = flight.usable & np.isfinite(flight.command[:, axis]) & np.isfinite(flight.body_rate[:, axis])
    if reason := _unusable(flight, usable, bool(np.isfinite(flight.command[:, axis]).any())):
        return _none(AXES[axis], reason)
    chosen, law, known = exogenous(flight, axis, usable), flown_law(flight), usable
    best: AxisPlant | None = None
    for source, values in chosen.candidates:
        known = usable & np.isfinite(values)
        filters = partial(gyroscope_filters, law, axis)
        spectra = plant_spectra(flight, axis, values, known, filters)
        if spectra is not None:
            begun = _Model.begun(spectra, filters, axis == _YAW)
            spectra = plant_spectra(flight, axis, values, known, filters, begun)
        if spectra is None:
            continue
        found = _of_spectra(AXES[axis], source, spectra, filters(spectra.frequency))
        if best is None or found.strength > best.strength:
            best = found
        if best.strength >= STRONG:
            break
    left = eroded(known, round(_SLOW_S * flight.rate_hz))
    return best or _none(AXES[axis], chosen.reason or too_little(left, flight.rate_hz, _window_s(flight)[0]))


def _unusable(flight: LogFlight, usable: BoolArray, commanded: bool) -> str:
    """Say why nothing can be estimated of an axis; empty where something may be."""
    if not commanded:
        return NO_COMMAND
    if _OF_CLOCK * flight.rate_hz < _LEAST_TOP_HZ:
        return TOO_SLOW
    shortest = _window_s(flight)[0]
    if usable.sum() < needed_s(shortest) * flight.rate_hz:
        return too_little(usable, flight.rate_hz, shortest)
    return ""


class _Model(NamedTuple):
    """A plant near the one that is sought: numbers, the frequency of the effectiveness, and the slope of its phase."""

    values: Array
    at_hz: float
    late_s: float

    @classmethod
    def begun(cls, spectra: BlockSpectra, filters: Callable[[Array], Numbers], yaw: bool) -> _Model:
        """Estimate it roughly."""
        passed = filters(spectra.frequency)
        equations = _Equations(spectra, passed, _reference(spectra))
        values = _begun(equations, yaw)
        push = passed * PlantModel.of(values, equations.at_hz).push(spectra.frequency)
        # The slope of its phase over the band.
        turned, turn = np.unwrap(np.angle(push)), 2 * np.pi * spectra.frequency
        return cls(values, equations.at_hz, float(np.clip(-(turn @ turned) / (turn @ turn), 0.0, _LATEST_S)))


def plant_spectra(
    flight: LogFlight,
    axis: int,
    instrument: Array,
    usable: BoolArray,
    filters: Callable[[Array], Numbers],
    near: _Model | None = None,
) -> BlockSpectra | None:
    """Take spectra of instrument, command, body rate and angular acceleration; None where too little is usable.

    By the delay of the plant `near` windows of the command begin earlier: what entered a window is then what left it,
    and slow motion of other windows does not leak into the phase. Windows weigh by what it leaves in them: one flip
    does not outweigh a flight.
    """
    late = near.late_s if near else _USUAL_DELAY_S
    early, half = round(late * flight.rate_hz), round(_SLOW_S * flight.rate_hz)
    signals = (instrument, flight.command[:, axis], flight.body_rate[:, axis])
    instrument, command, rate = (without_slow(each, usable, half) for each in signals)
    usable = eroded(usable, half)
    if early:
        usable = usable & np.concatenate([np.zeros(early, dtype=bool), usable[:-early]])
    seconds = float(np.clip(usable.sum() / flight.rate_hz / _WINDOWS, *_window_s(flight)))
    length = round(seconds * flight.rate_hz)
    begins = window_starts(usable, length)
    frequency = np.asarray(np.fft.rfftfreq(length, 1 / flight.rate_hz), dtype=np.float64)
    inside = (frequency >= _PERIODS / seconds * (1 - 1e-9)) & (frequency <= min(_TOP_HZ, _OF_CLOCK * flight.rate_hz))
    if len(begins) < 2 or inside.sum() < 6:
        return None
    period = 1 / flight.rate_hz
    parts = [
        *transforms(instrument, begins, length, period),
        *transforms(rate, begins, length, period, 2),
        *transforms(np.roll(command, early), begins, length, period, 1),
    ]
    turned = np.exp(2j * np.pi * frequency * early * period)
    parts = [parts[Z], parts[4] * turned, *parts[1:4], parts[5] * turned]
    if near:
        weight = _calm([each[:, inside] for each in parts], near, filters(frequency[inside]), frequency[inside])
        parts = [each * np.sqrt(weight)[:, None] for each in parts]
    power = (np.abs(parts[Z][:, inside]) ** 2).sum(axis=1)
    if not power.sum() > 0:
        return None
    spectra = block_spectra(parts, cut_blocks(np.sqrt(power)), frequency, inside)
    return spectra if len(spectra.windows) >= FEWEST_BLOCKS else None


def _calm(parts: list[Numbers], near: _Model, filters: Numbers, frequency: Array) -> Array:
    """Weigh windows by what disturbs them, over what disturbs the calmer half: at most 1, shape (window,)."""
    terms = _terms(near.values, near.at_hz, filters, frequency)
    left = np.abs(sum(each * terms[:, place] for place, each in enumerate(parts[U:]))) ** 2
    usual = np.maximum(np.median(left, axis=0), _TINY)
    return np.asarray(1 / np.maximum((left / usual).mean(axis=1) / _USUAL_LEFT, 1.0))


def _window_s(flight: LogFlight) -> tuple[float, float]:
    return _SLOW_WINDOW_S if flight.rate_hz < _SLOW_HZ else _WINDOW_S


def _kept(spectra: Numbers, windows: int) -> Array:
    """Give the share of what the instrument says of the command that is not chance, shape (..., frequency)."""
    cross = np.abs(smoothed(spectra[..., Z, U])) ** 2
    parts = smoothed(spectra[..., Z, Z].real) * smoothed(spectra[..., U, U].real)
    coherence = np.minimum(cross / np.maximum(parts, _TINY), 1 - 1e-9)
    statistic = coherence / (1 - coherence) * windows * SMOOTHED_BINS / SHARED_BINS
    moves = smoothed(spectra[..., Z, Z].real)
    moves = moves >= _SEEN * moves.max(axis=-1, keepdims=True)
    return np.asarray(np.where(moves, np.maximum(1 - _BY_CHANCE / np.maximum(statistic, _TINY), 0.0), 0.0))


def _terms(values: Array, at_hz: float, filters: Numbers, frequency: Array) -> Numbers:
    model = PlantModel.of(values[..., None, :], at_hz)
    push = -filters * model._replace(lead=0.0).push(frequency)
    rest = (model.damping, 1 + model.damping * model.lag, model.lag, push * model.lead)
    return np.stack([push, *(np.broadcast_to(each, push.shape) for each in rest)], axis=-1)


class _Equations:
    """Equations of one axis: no instrument goes with ``T j + (1 + d T) a + d y - b (1 + s L) e^(-s tau) u``.

    Instruments are what the other blocks predict from the setpoint: a prediction by the same windows would follow the
    gusts again.
    """

    def __init__(self, spectra: BlockSpectra, filters: Numbers, at_hz: float) -> None:
        self.spectra, self.filters, self.at_hz = spectra, filters, at_hz
        self._seen = spectra.cross[:, :, Z, U:]
        self._windows = int(spectra.windows.sum())
        others = spectra.total - spectra.cross
        # Windows at the ends of a block share samples with its neighbours.
        others[1:] -= spectra.cross[:-1]
        others[:-1] -= spectra.cross[1:]
        cross, power = others[:, :, Z, U:], others[:, :, Z, Z].real
        predicted = smoothed(cross, axis=1) / np.maximum(smoothed(power, axis=1), _TINY)[..., None]
        # Where the instrument moves the command no more than by chance it says nothing.
        kept = _kept(others, self._windows)
        self._predicted = predicted * kept[..., None]
        cross, power = spectra.total[:, Z, U:, None], np.maximum(spectra.total[:, Z, Z].real, _TINY)[:, None, None]
        rest = spectra.total[:, U:, U:] - cross.conj() * cross.swapaxes(1, 2) / power
        shared = SHARED_BINS / SMOOTHED_BINS / self._windows
        self._chance = rest * (shared * (kept**2).mean(axis=0))[:, None, None]

    def terms(self, values: Array) -> Numbers:
        """Give the factors of the signals behind the instrument, shape (..., frequency, signal)."""
        return _terms(values, self.at_hz, self.filters, self.spectra.frequency)

    def __call__(self, values: Array) -> Normal:
        step, numbers = 1e-5, len(values)
        moved = values + step * np.concatenate([np.zeros((1, numbers)), np.eye(numbers), -np.eye(numbers)])
        terms = self.terms(moved)
        slopes = (terms[1 + numbers :] - terms[1 : 1 + numbers]) / (2 * step)
        weight = self._weight(terms[0])
        predicted = np.einsum("pfs,bfs->bpf", slopes, self._predicted).conj() * weight
        actual = np.einsum("qfs,bfs->bfq", slopes, self._seen)
        residual = (terms[0] * self._seen).sum(axis=2)[..., None]
        by_chance = np.einsum("fst,qft->qfs", self._chance, slopes) * weight[:, None]
        return Normal(
            (predicted @ actual).real,
            (predicted @ residual)[..., 0].real,
            np.tensordot(slopes.conj(), by_chance, ((1, 2), (1, 2))).real,
        )

    def _weight(self, terms: Numbers) -> Array:
        """Give the inverse variance of the disturbance for one window, shape (frequency,)."""
        parts = self.spectra.total[:, U:, U:] / self._windows
        rest = np.einsum("fi,fij,fj->f", terms.conj(), parts, terms).real
        least = _FLOOR * (np.abs(terms) ** 2 * np.einsum("fii->fi", parts).real).sum(axis=1)
        return np.asarray(2 / SHARED_BINS / np.exp(smoothed(np.log(np.maximum(rest, least)))))


def _prior(yaw: bool) -> Prior:
    """State what is known of multirotors before: nothing of effectiveness and delay, the order of the others."""
    mean = [0.0, 0.0, _LAG_SHARE, np.log(_DAMPING), *([np.log(_LEAD_S)] if yaw else [])]
    spread = [np.inf, np.inf, _LAG_SPREAD, _DAMPING_SPREAD, *([_LEAD_SPREAD] if yaw else [])]
    return Prior(np.array(mean), np.array(spread))


def _fitted(equations: _Equations, yaw: bool) -> Fit:
    """Fit the model."""
    prior = _prior(yaw)
    return estimate(equations, _begun(equations, yaw), prior, _bounds(prior))


def _bounds(prior: Prior) -> Bounds:
    low, high = np.full(len(prior.mean), -np.inf), np.full(len(prior.mean), np.inf)
    low[1], high[1] = _LEAST_DELAY, _MOST_DELAY_S / _DELAY_UNIT_S
    low[2:], high[2:] = prior.mean[2:] - 4 * prior.spread[2:], prior.mean[2:] + 4 * prior.spread[2:]
    return low, high


def _begun(equations: _Equations, yaw: bool) -> Array:
    """Estimate gain and delay with a shape that is all but held, begun at the best of a few delays."""
    prior = _prior(yaw)
    best = (np.inf, prior.mean)
    seen = equations.spectra.total[:, Z, U:]
    scale = np.maximum(equations.spectra.total[:, Z, Z].real, _TINY)
    sides = (-1.0, 0.0, 1.0)
    for delay, share, lead in product(np.arange(1.0, 16.0, 1.5), sides, sides if yaw else sides[:1]):
        shape = np.array([share, 0.0, *([lead] if yaw else [])])
        values = np.concatenate([[0.0, delay], prior.mean[2:] + shape * prior.spread[2:]])
        terms = equations.terms(values)
        parts = terms * seen
        follows, target = -(parts[:, 0] + parts[:, -1]), parts[:, 1:-1].sum(axis=1)
        weight = 1 / (np.abs(terms[:, 0]) ** 2 * scale)
        gain = float((weight * (follows.conj() * target).real).sum() / (weight * np.abs(follows) ** 2).sum())
        left = float((weight * np.abs(target - gain * follows) ** 2).sum())
        if gain > 0 and left < best[0]:
            best = (left, np.concatenate([[np.log(gain)], values[1:]]))
    tight = Prior(prior.mean, np.where(np.isfinite(prior.spread), _TIGHT, np.inf))
    return solve(equations, best[1], tight, _bounds(prior)).values


def _reference(spectra: BlockSpectra) -> float:
    """Choose the frequency where the log knows effectiveness best: in the middle of what the instrument moves."""
    clear = spectra.coherence(Z, U) * spectra.coherence(Z, Y)
    weight = _kept(spectra.total, int(spectra.windows.sum())) * clear / np.maximum(1 - clear, 0.02)
    middle = float(np.exp((weight * np.log(spectra.frequency)).sum() / max(float(weight.sum()), _TINY)))
    return min(_AT_HZ, key=lambda each: abs(np.log(each / middle)))


def _band(spectra: BlockSpectra) -> Array:
    """Give the frequencies between which the instrument moves the command by more than chance, shape (2,)."""
    kept = np.flatnonzero(_kept(spectra.total, int(spectra.windows.sum())) > _SURELY)
    return np.asarray(spectra.frequency[kept[[0, -1]]] if len(kept) else np.full(2, np.nan))


def _known_best(fit: Fit, spectra: BlockSpectra, at_hz: float) -> float:
    """Choose the frequency at which the effectiveness has the least error, whatever the model's shape is."""
    step = 1e-5 * np.concatenate([np.eye(len(fit.values)), -np.eye(len(fit.values))])
    inside = np.array([each for each in _AT_HZ if spectra.frequency[0] <= each <= spectra.frequency[-1]] or [at_hz])
    size = np.log(np.abs(PlantModel.of((fit.values + step)[:, None, :], at_hz).acceleration(inside)))
    slopes = np.diff(size.reshape(2, len(fit.values), -1)[::-1], axis=0)[0].T / 2e-5
    return float(inside[np.argmin([each @ fit.inverse @ each for each in slopes])])


def _of_spectra(axis: str, source: str, spectra: BlockSpectra, filters: Numbers) -> AxisPlant:
    yaw = axis == AXES[_YAW]
    middle = _reference(spectra)
    at_hz = _known_best(_fitted(_Equations(spectra, filters, middle), yaw), spectra, middle)
    equations = _Equations(spectra, filters, at_hz)
    fit = _fitted(equations, yaw)
    first = np.eye(len(fit.values))[0]
    half_gain, total = float(np.hypot(fit.half(first), GAIN_FLOOR)), _delay_at(fit, at_hz)
    verdict, reason = _judged(fit, half_gain, total)
    return AxisPlant(
        axis=axis,
        verdict=verdict,
        reason=reason,
        instrument=source,
        at_hz=at_hz,
        band_hz=_band(spectra),
        windows=int(spectra.windows.sum()),
        strength=float(fit.strength[0]),
        coherence=float(np.median(spectra.coherence(Z, U))),
        effectiveness=_exponential(fit.values[0], half_gain) if verdict == "identified" else None,
        total_delay=total if verdict == "identified" else None,
        least_squares=_direct(equations),
        bound=None if verdict == "identified" else _bound(equations, fit.values),
        draws=_drawn(fit, at_hz) if verdict == "identified" else np.zeros((0, 5)),
        **_curves(equations, fit),
    )


def _direct(equations: _Equations) -> Estimate:
    """Give the effectiveness by least squares of the acceleration on the command around its frequency."""
    spectra = equations.spectra
    cross = smoothed(np.concatenate([spectra.total[None], spectra.total - spectra.cross])[..., U, :], axis=1)
    near = int(np.argmin(np.abs(spectra.frequency - equations.at_hz)))
    ratio = np.abs(cross[:, near, A]) / np.maximum(np.abs(equations.filters[near] * cross[:, near, U]), _TINY)
    size = np.log(np.maximum(ratio, _TINY))
    return _exponential(size[0], float(half_width(jackknife_error(size[1:]), len(size) - 1)))


def _exponential(value: float, half: float) -> Estimate:
    # What is not known at all stays a number.
    low, high = np.exp(np.clip([value - half, value + half], -_OPEN, _OPEN))
    return Estimate(value=float(np.exp(value)), low=float(low), high=float(high))


def _delay_at(fit: Fit, at_hz: float) -> Estimate:
    """Give the delay of torque behind the command at a frequency, s: there it is known best."""

    def delay(values: Array) -> Array:
        model = PlantModel.of(values, 0.01)
        turn = 2 * np.pi * at_hz
        late = np.arctan(turn * model.lag) - np.arctan(turn * model.lead)
        return np.asarray(model.delay + late / turn)

    step = 1e-5 * np.eye(len(fit.values))
    direction = (delay(fit.values + step) - delay(fit.values - step)) / 2e-5
    value, half = float(delay(fit.values)), float(np.hypot(fit.half(direction), DELAY_FLOOR_S))
    return Estimate.around(value, half)


def _judged(fit: Fit, half_gain: float, total: Estimate) -> tuple[str, str]:
    if fit.strength[0] < STRONG:
        return "weak", NOT_MOVED
    if not fit.settled or (len(fit.values) <= 4 and total.high < 0):
        return "weak", NO_MODEL
    if half_gain > NARROW or total.half > NARROW_DELAY_S:
        return "weak", TOO_WIDE
    return "identified", ""


def _bound(equations: _Equations, values: Array) -> Estimate | None:
    """Give an interval of effectiveness that holds for a weak instrument, over all usual delays; None where none."""
    lows, highs = [], []
    for delay in (1.0, 2.5, 5.0, 8.0):
        at = values.copy()
        at[0], at[1] = 0.0, delay
        normal = equations(at)
        low, high = positive_ratio(normal.score[:, 0] + normal.information[:, 0, 0], normal.information[:, 0, 0])
        lows.append(low)
        highs.append(high)
    low, high = min(lows), max(highs)
    return Estimate(value=np.nan, low=low, high=high) if low > 0 or np.isfinite(high) else None


def _drawn(fit: Fit, at_hz: float) -> np.ndarray:
    """Draw plants that the log leaves possible, shape (draw, 5), as wide as Student's t of few blocks."""
    floor = np.zeros(len(fit.values))
    floor[:2] = GAIN_FLOOR / _NORMAL, DELAY_FLOOR_S / _DELAY_UNIT_S / _NORMAL
    variance, axes = np.linalg.eigh(fit.covariance + np.diag(floor**2))
    first = np.eye(len(fit.values))[0]
    wider = fit.half(first) / _NORMAL / float(np.sqrt(fit.covariance[0, 0]))
    normal = np.random.default_rng(_SEED).standard_normal((_DRAWS, len(fit.values)))
    draws = fit.values + wider * (normal * np.sqrt(np.maximum(variance, 0.0))) @ axes.T
    draws[:, 1] = np.maximum(draws[:, 1], _LEAST_DELAY)
    return np.stack([np.broadcast_to(each, _DRAWS) for each in PlantModel.of(draws, at_hz)], axis=1)


def _curves(equations: _Equations, fit: Fit) -> dict[str, Any]:
    spectra = equations.spectra
    gain, direct = spectra.gain(Z, U, A), spectra.gain(U, U, A)
    model = PlantModel.of(fit.values, equations.at_hz)
    fitted = equations.filters * model.acceleration(spectra.frequency)
    clear = np.minimum(spectra.coherence(Z, U), spectra.coherence(Z, Y))
    with np.errstate(divide="ignore"):
        error = np.sqrt((1 - clear) / (2 * np.maximum(clear, 1e-12) * max(int(spectra.windows.sum()), 1) * 0.6))
    return {
        "frequency": spectra.frequency,
        "gain": np.abs(gain),
        "phase": np.unwrap(np.angle(gain)),
        "gain_error": error,
        "model_gain": np.abs(fitted),
        "model_phase": np.unwrap(np.angle(fitted)),
        "direct_gain": np.abs(direct),
        "direct_phase": np.unwrap(np.angle(direct)),
        "input_coherence": spectra.coherence(Z, U),
        "output_coherence": spectra.coherence(Z, Y),
        "parameters": np.array([float(each) for each in model]),
    }


def _none(axis: str, reason: str) -> AxisPlant:
    curves = ("frequency", "gain", "phase", "gain_error", "model_gain", "model_phase", "direct_gain", "direct_phase")
    missing: dict[str, Any] = dict.fromkeys((*curves, "input_coherence", "output_coherence"), np.zeros(0))
    return AxisPlant(
        axis=axis,
        verdict="none",
        reason=reason,
        instrument="",
        at_hz=np.nan,
        band_hz=np.full(2, np.nan),
        windows=0,
        strength=np.nan,
        coherence=np.nan,
        **missing,
        parameters=np.full(5, np.nan),
        draws=np.zeros((0, 5)),
    )
