"""The loop that flew: body rate by its setpoint, over frequency and as a step, and how far it is from unstable."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, Numbers
from cpfls_cli.autopilots.law import Law
from cpfls_cli.blocks import half_width, jackknife_error
from cpfls_cli.estimation.spectra import (
    FEWEST_BLOCKS,
    SHARED_BINS,
    BlockSpectra,
    block_spectra,
    cut_blocks,
    smoothed,
    transforms,
    window_starts,
)
from cpfls_cli.look.effectiveness import AxisPlant, PlantModel
from cpfls_cli.look.flight import AXES, NO_SETPOINT, TOO_SLOW, Exogenous, LogFlight, exogenous, too_little
from cpfls_cli.look.law import flown_law, gyroscope_filters
from cpfls_cli.result import Estimate, about, part, result

CLEAR = 0.2
"""Standard error of the gain's logarithm from which on the response is not measured any more."""
_WINDOW_S, _SHOWN_S, _SETTLES_S = 2.0, 0.6, (0.3, 0.5)
_TOP_HZ, _OF_CLOCK, _FADES = 60.0, 0.2, 1.6
"""Top of the band; the same, share of the clock; frequencies over which a cut step fades, by its end."""
_SLOWEST_HZ, _USUAL_LATE_S = 20.0, 0.04
_CERTAIN = 0.975
_AGREES = 0.05
"""Share of a step by which plant and law may leave the interval of the measured one."""
_HALF_POWER = 0.5**0.5
_TINY = float(np.finfo(float).tiny)
Z, X, Y = 0, 1, 2
_OVER_FREQUENCY = ("gain", "phase", "gain_error")
_OVER_TIME = ("step", "step_low", "step_high", "law_step")
_EMPTY = dict.fromkeys(("frequency", "time", *_OVER_FREQUENCY, *_OVER_TIME), np.zeros(0))
_NOTHING: dict[str, Any] = {"windows": 0, "clear_hz": np.nan, "law_explains": False, **_EMPTY}


@result
class StepNumbers:
    """What a step of the rate setpoint does."""

    overshoot: Estimate | None = part(default=None)
    """Share of the step; None where the response is not measured down to half its power, and a cut one overshoots."""
    rise_s: Estimate = part()
    """From a tenth to nine tenths."""
    half_s: Estimate = part()
    """Until half of it."""


@result
class AxisLoop:
    """The rate loop about one axis as it flew."""

    axis: str = about("roll, pitch or yaw")
    measured: bool = about("whether the response was measured")
    reason: str = about("why it was not; empty where it was")
    instrument: str = about("signal that moves the vehicle and knows nothing of gusts; empty where there is none")
    windows: int = about("windows of the response, overlapping by half")
    clear_hz: float = about("frequency up to which the response is measured", unit="Hz", gaps=True)
    bandwidth_hz: Estimate | None = part(default=None)
    by_step: StepNumbers | None = part(default=None)
    """Of the measured response, deconvolved."""
    law_explains: bool = about("whether the stated law with the plant steps as measured, over the measured band")
    frequency: np.ndarray = about("of the response", "frequency", unit="Hz", brief=False)
    gain: np.ndarray = about("of body rate by setpoint", "frequency", gaps=True, brief=False)
    phase: np.ndarray = about("of it, unwrapped", "frequency", unit="rad", gaps=True, brief=False)
    gain_error: np.ndarray = about("standard error of its logarithm", "frequency", gaps=True, brief=False)
    time: np.ndarray = about("of the step", "time", unit="s", brief=False)
    step: np.ndarray = about("body rate by a unit step of its setpoint", "time", gaps=True, brief=False)
    step_low: np.ndarray = about("lower end of its 95 % interval", "time", gaps=True, brief=False)
    step_high: np.ndarray = about("upper end of its 95 % interval", "time", gaps=True, brief=False)
    law_step: np.ndarray = about("of plant and law", "time", gaps=True, brief=False)

    @property
    def overshoot(self) -> Estimate | None:
        """Overshoot of the measured step."""
        return self.by_step.overshoot if self.by_step else None


def loops_of(flight: LogFlight, plants: tuple[AxisPlant, ...]) -> tuple[AxisLoop, ...]:
    """Measure the rate loops about all axes, and compute them from plant and law."""
    law = flown_law(flight)
    return tuple(_axis_loop(flight, axis, plants[axis], law) for axis in range(len(AXES)))


def _axis_loop(flight: LogFlight, axis: int, plant: AxisPlant, law: Law | None) -> AxisLoop:
    asked, rate = flight.rate_setpoint[:, axis], flight.body_rate[:, axis]
    usable = flight.usable & np.isfinite(asked) & np.isfinite(rate)
    chosen = _instruments(flight, axis, usable)
    length = round(_WINDOW_S * flight.rate_hz)
    time = np.arange(round(_SHOWN_S * flight.rate_hz)) / flight.rate_hz
    found, source, reason = None, "", chosen.reason
    for name, values in chosen.candidates:
        found, source = _response(flight, values, asked, rate, usable & np.isfinite(values), length), name
        if found is not None:
            break
        reason = too_little(usable & np.isfinite(values), flight.rate_hz, _WINDOW_S)
    every = _measured(found, time, length) if found else {}
    loop = PlantAndLaw.of(plant, law, axis) if found else None
    return AxisLoop(
        axis=AXES[axis],
        measured=found is not None,
        reason="" if found else reason,
        instrument=source if found else "",
        **_whole({**_NOTHING, **every, **(loop.fields(time, flight.rate_hz, length, every) if loop else {})}),
    )


def _instruments(flight: LogFlight, axis: int, usable: BoolArray) -> Exogenous:
    if not np.isfinite(flight.rate_setpoint[:, axis]).any():
        return Exogenous((), NO_SETPOINT)
    if 0.5 * flight.rate_hz < _SLOWEST_HZ:
        return Exogenous((), TOO_SLOW)
    return exogenous(flight, axis, usable)


def _whole(given: dict[str, Any]) -> dict[str, Any]:
    """Fill curves that are not known with NaN, so that all over one axis have one length."""
    curves = {"frequency": _OVER_FREQUENCY, "time": _OVER_TIME}
    unknown = {
        name: np.full(len(given[axis]), np.nan)
        for axis, names in curves.items()
        for name in names
        if not len(given[name])
    }
    return {**given, **unknown}


class _Response(NamedTuple):
    """Spectra of instrument, setpoint and rate, and up to which frequency they are clear."""

    spectra: BlockSpectra
    clear_hz: float

    def gains(self) -> Numbers:
        """Give the response of all blocks, then without each, shape (1 + block, frequency)."""
        total, blocks = self.spectra.total, self.spectra.cross
        sums = np.concatenate([total[None], total - blocks])
        below = sums[:, :, Z, X]
        return np.asarray(sums[:, :, Z, Y] / np.where(np.abs(below) > 0, below, _TINY))


def _response(
    flight: LogFlight, instrument: Array, asked: Array, rate: Array, usable: BoolArray, length: int
) -> _Response | None:
    """Take the spectra of a response; None where it is not clear from the first frequencies on."""
    early = round(_USUAL_LATE_S * flight.rate_hz)
    begins = window_starts(usable & np.concatenate([np.zeros(early, dtype=bool), usable[:-early]]), length)
    period = 1 / flight.rate_hz
    frequency = np.asarray(np.fft.rfftfreq(length, period), dtype=np.float64)
    inside = frequency <= min(_TOP_HZ, _OF_CLOCK * flight.rate_hz)
    if len(begins) < FEWEST_BLOCKS:
        return None
    # What entered a window is what left it: setpoints are taken earlier, and turned back.
    turned = np.exp(2j * np.pi * frequency * early * period)
    z, x = (
        transforms(np.nan_to_num(np.roll(each, early)), begins, length, period)[0] * turned
        for each in (instrument, asked)
    )
    y = transforms(np.nan_to_num(rate), begins, length, period)[0]
    power = np.abs(z[:, inside]).max(axis=1)
    spectra = block_spectra([z, x, y], cut_blocks(power), frequency, inside)
    if len(spectra.windows) < FEWEST_BLOCKS:
        return None
    coherence = np.minimum(spectra.coherence(Z, X), spectra.coherence(Z, Y))
    seen = np.maximum(smoothed(coherence), _TINY)
    unclear = np.flatnonzero((1 - seen) / (2 * seen * spectra.windows.sum() / SHARED_BINS) > CLEAR**2)
    unclear = unclear[unclear > 1]
    ends = float(spectra.frequency[unclear[0]] if len(unclear) else spectra.frequency[-1])
    return _Response(spectra, ends) if ends >= _FADES / _WINDOW_S * 2 else None


def _stepped(gains: Numbers, frequency: Array, ends: float, length: int, samples: int) -> Array:
    """Give steps of responses, shape (..., frequency), that fade out from where they are not known any more."""
    fading = np.clip((frequency / ends - 1) / (_FADES - 1), 0.0, 1.0)
    shown = gains * (0.5 + 0.5 * np.cos(np.pi * fading))
    shown[..., 0] = np.abs(shown[..., 1])
    whole = np.zeros((*gains.shape[:-1], length // 2 + 1), dtype=complex)
    whole[..., : gains.shape[-1]] = shown
    # What fades without a phase begins before the step.
    before = length // 8
    impulse = np.roll(np.fft.irfft(whole, length, axis=-1), before, axis=-1)
    return np.asarray(np.cumsum(impulse, axis=-1)[..., before : before + samples])


def _measured(found: _Response, time: Array, length: int) -> dict[str, Any]:
    """Give the fields of an `AxisLoop` that a measured response has."""
    gains, frequency, blocks = found.gains(), found.spectra.frequency, len(found.spectra.windows)
    steps = _stepped(gains, frequency, found.clear_hz, length, len(time))
    half = half_width(jackknife_error(steps[1:]), blocks)
    magnitude = np.log(np.maximum(np.abs(gains), _TINY))
    bandwidth = _jackknifed(np.array([_bandwidth(frequency, np.abs(each), found.clear_hz) for each in gains]))
    return {
        "windows": int(found.spectra.windows.sum()),
        "clear_hz": found.clear_hz,
        "bandwidth_hz": bandwidth,
        "by_step": _numbers(time, steps, bandwidth is not None),
        "frequency": frequency,
        "gain": np.abs(gains[0]),
        "phase": np.unwrap(np.angle(gains[0])),
        "gain_error": jackknife_error(magnitude[1:]),
        "time": time,
        "step": steps[0],
        "step_low": steps[0] - half,
        "step_high": steps[0] + half,
    }


def _jackknifed(values: Array) -> Estimate | None:
    """Give a number from its value and those without each block; None where it is not always there."""
    if not np.isfinite(values).all():
        return None
    return Estimate.around(values[0], float(half_width(jackknife_error(values[1:]), len(values) - 1)))


def _bandwidth(frequency: Array, gain: Array, ends: float) -> float:
    """Give the frequency at which a response has half its power; NaN where that is not below an end."""
    below = np.flatnonzero((gain < _HALF_POWER) & (frequency > 0))
    if not len(below) or frequency[below[0]] > ends:
        return np.nan
    at = below[0]
    # What is below it from the first frequency on does not cross it.
    if at == 0 or gain[at - 1] < _HALF_POWER:
        return np.nan
    share = (gain[at - 1] - _HALF_POWER) / max(gain[at - 1] - gain[at], _TINY)
    return float(frequency[at - 1] + share * (frequency[at] - frequency[at - 1]))


def _numbers(time: Array, steps: Array, whole: bool) -> StepNumbers | None:
    """Read overshoot, of whole responses, and times from steps, shape (1 + other, time)."""
    settled = steps[:, (time >= _SETTLES_S[0]) & (time <= _SETTLES_S[1])].mean(axis=1)
    level = np.where(settled > 0, settled, np.nan)

    def reached(share: float) -> Array:
        above = steps >= share * level[:, None]
        first = above.argmax(axis=1)
        rows = np.arange(len(steps))
        before = steps[rows, np.maximum(first - 1, 0)]
        part_ = (share * level - before) / np.where(first > 0, steps[rows, first] - before, 1.0)
        return np.where(above.any(axis=1), (first - 1 + np.where(first > 0, part_, 1.0)) * (time[1] - time[0]), np.nan)

    over = _jackknifed(steps.max(axis=1) - 1.0) if whole else None
    rise, half = _jackknifed(reached(0.9) - reached(0.1)), _jackknifed(reached(0.5))
    if rise is None or half is None:
        return None
    return StepNumbers(overshoot=over, rise_s=rise, half_s=half)


class PlantAndLaw(NamedTuple):
    """Plant and law of one axis: the plant that was found, then those that are possible, shape (1 + draw, 1) each."""

    plants: PlantModel
    law: Law
    axis: int

    @classmethod
    def of(cls, plant: AxisPlant, law: Law | None, axis: int) -> PlantAndLaw | None:
        """Take them where both are known."""
        if law is None or not plant.identified:
            return None
        every = np.concatenate([plant.parameters[None], plant.draws])
        return cls(PlantModel(*(every[:, [place]] for place in range(5))), law, axis)

    def closed(self, frequency: Array) -> Numbers:
        """Evaluate the logged body rate by its setpoint, shape (1 + draw, frequency)."""
        control, moved = self.law.response(self.axis, frequency), self.plants.rate(frequency)
        filters = gyroscope_filters(self.law, self.axis, frequency)
        return np.asarray(filters * moved * control.forward / (1 + moved * control.feedback))

    def steps(self, time: Array, rate_hz: float, length: int, ends: float = np.inf) -> Array:
        """Step the body rate, shape (1 + draw, time), over all frequencies or as a measurement shows it."""
        frequency = np.asarray(np.fft.rfftfreq(length, 1 / rate_hz)[1:], dtype=np.float64)
        frequency = frequency[frequency < min(0.45 * self.law.rate_hz, _FADES * ends)]
        response = self.closed(frequency)
        gains = np.concatenate([np.ones((len(response), 1)), response], axis=1)
        whole = np.concatenate([[0.0], frequency])
        return _stepped(gains, whole, min(ends, float(frequency[-1]) / _FADES), length, len(time))

    def fields(self, time: Array, rate_hz: float, length: int, measured: dict[str, Any]) -> dict[str, Any]:
        """Give the fields of an `AxisLoop` that plant and law have where they step as it was measured."""
        banded = self.steps(time, rate_hz, length, measured["clear_hz"])
        low, high = np.quantile(banded[1:], [1 - _CERTAIN, _CERTAIN], axis=0)
        room = np.hypot(0.5 * (measured["step_high"] - measured["step_low"]), 0.5 * (high - low))
        if (np.abs(banded[0] - measured["step"]) > room + _AGREES).any():
            return {}
        return {"law_explains": True, "law_step": self.steps(time, rate_hz, length)[0]}
