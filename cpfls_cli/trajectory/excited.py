"""Test signals of a known band that are added to a path in space: multisines and sweeps, from rest to rest."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from math import ceil, comb

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.errors import SettingError
from cpfls_cli.trajectory.planning import MOTION, Trajectory, along
from cpfls_cli.trajectory.profile import Holds, covering
from cpfls_cli.trajectory.settings import ExciteSettings

_DERIVATIVES = 7
_WAVES = 16
"""Sine waves of the pop of a base move without holds, by which an excitation begins and ends."""

_FADES = 0.125
"""Share of the excitation in which it rises, and in which it falls."""

_PERIODS_OF_FADE = 4.0
"""Of the lowest frequency: no fade is longer."""

_LEAST_LINES = 5
"""Frequencies of an axis with which a multisine is one."""

_LEAST_PERIODS = 4.0
"""Of the lowest frequency, that a sweep of one axis takes at least."""

_RESOLUTION = 32
"""Samples in a period of the fastest wave, where a peak is looked for."""

_CLIPPINGS, _CLIPPED_AT = 100, 0.8
"""Steps that lower a crest factor, and the share of the peak at which each clips."""

_STEADY_YAW = 0.01
"""Change of yaw in rad from which on roll and pitch are no directions in space."""


@dataclass(frozen=True)
class AddedMotion:
    """A motion that excites chosen axes, to be added to a path.

    Attributes
    ----------
    axes : tuple of str
    signals : array, shape (excited, 7, time)
        Signal of each axis, of peak 1: an angle of yaw, or the double integral of an acceleration; with derivatives.
    directions : array, shape (excited, 3), m/s^2, world frame
        Acceleration for a tilt of tangent 1; zero of yaw.
    sizes : array, shape (excited,), rad
        Largest tilt that each asks for in hover, and largest yaw.
    crest : tuple of float
        Crest factor of each, peak over root mean square, without the fades.
    """

    axes: tuple[str, ...]
    signals: Array
    directions: Array
    sizes: Array
    crest: tuple[float, ...]

    @property
    def motion(self) -> Array:
        """Position that it adds and its derivatives up to the pop, shape (7, time, 3), m and s, world frame."""
        return np.asarray(np.einsum("a,adt,ax->dtx", np.tan(self.sizes), self.signals, self.directions))

    @property
    def heading(self) -> Array:
        """Yaw that it adds, its rate and its acceleration, shape (3, time), rad and s."""
        turning = ~self.directions.any(axis=1)
        return np.asarray(np.einsum("a,adt->dt", self.sizes * turning, self.signals[:, :3]))

    def of_sizes(self, sizes: Array) -> AddedMotion:
        """Make it smaller or larger; the sizes in rad, shape (excited,)."""
        return replace(self, sizes=sizes)

    def onto(self, path: Trajectory, gravity: float) -> Trajectory:
        """Add it to a path, which it was made for.

        Parameters
        ----------
        gravity : float, m/s^2

        Raises
        ------
        ComputationError
            If both together ask for free fall, where the attitude is not defined.
        """
        own = np.stack([getattr(path, name) for name in MOTION])
        heading = np.stack([path.yaw, path.yaw_rate, path.yaw_acceleration])
        flown = along(path.time, own + self.motion, heading + self.heading, gravity)
        return Trajectory(duration=path.duration, legs=path.legs, maxima=path.maxima, runs=path.runs, **flown)


def added_motion(settings: ExciteSettings, path: Trajectory, gravity: float) -> AddedMotion:
    """Make the excitation of a path, of the size asked for.

    A tilt by the angle u accelerates sideways by ``g tan(u)``, so position moves by the double integral of the
    signal; yaw is the signal itself. Amplitudes fall as 1/f, so that the rates of all frequencies are equal.

    Parameters
    ----------
    path : Trajectory
        One run, without excitation.
    gravity : float, m/s^2

    Raises
    ------
    SettingError
        If roll or pitch is excited while the path turns in yaw, or the path is too short for the band; it names the
        key of the section `trajectory`.
    """
    _refuse_turning(settings, path)
    signals, crest = [], []
    for number, axis in enumerate(settings.axes):
        lift = 0 if axis == "yaw" else 2
        signal = _of_axis(settings, number, path.time, path.duration, lift)
        signals.append(signal / np.abs(signal[lift]).max())
        crest.append(_crest(settings, number, path.duration))
    directions = gravity * np.array([_direction(axis, float(path.yaw[0])) for axis in settings.axes])
    sizes = np.full(len(settings.axes), settings.size_rad)
    return AddedMotion(settings.axes, np.stack(signals), directions, sizes, tuple(crest))


def _refuse_turning(settings: ExciteSettings, path: Trajectory) -> None:
    tilting = [axis for axis in settings.axes if axis in ("roll", "pitch")]
    if tilting and np.ptp(path.yaw) > _STEADY_YAW:
        message = f"turns the path in yaw, so {' and '.join(tilting)} excited along with it would change places"
        raise SettingError("yaw_turn_rad", f"{message}; set it to 0, and no yaw_rad in waypoints")


def _direction(axis: str, yaw: float) -> Array:
    """Direction in space that an axis is excited in, shape (3,): to the right, ahead or up; none of yaw."""
    sine, cosine = np.sin(yaw), np.cos(yaw)
    ways = {"roll": (sine, -cosine, 0.0), "pitch": (cosine, sine, 0.0), "vertical": (0.0, 0.0, 1.0)}
    return np.array(ways.get(axis, (0.0, 0.0, 0.0)))


def _of_axis(settings: ExciteSettings, number: int, time: Array, duration: float, lift: int) -> Array:
    """Signal of an axis, integrated `lift` times, with six derivatives, at rest at both ends."""
    if settings.signal == "multisine":
        order = lines_of(settings, number, duration)
        return _faded(multisine(order, duration, time, lift), time, 0.0, duration, settings)
    length = duration / len(settings.axes)
    if length * settings.band_hz[0] < _LEAST_PERIODS:
        least = _LEAST_PERIODS / settings.band_hz[0]
        raise SettingError(
            "excite.band_hz",
            f"begins below what fits {length:.4g} s, the sweep of one axis: a sweep takes {least:.4g} s or more for "
            "each axis; raise the lowest frequency or trajectory.duration_s, or excite fewer axes",
        )
    begin = number * length
    return _faded(sweep(settings, length, time - begin, lift), time, begin, length, settings)


def lines_of(settings: ExciteSettings, number: int, duration: float) -> IntArray:
    """List the periods in the duration of the waves of one axis: all in the band, dealt out among the axes in turn.

    `number` is that of the axis among those excited; `SettingError` where there are too few for a multisine.
    """
    low, high = settings.band_hz
    lines: IntArray = np.arange(ceil(low * duration - 1e-9), int(high * duration + 1e-9) + 1)
    axes = len(settings.axes)
    if len(lines) < _LEAST_LINES * axes:
        least = _LEAST_LINES * axes / (high - low)
        raise SettingError(
            "excite.band_hz",
            f"has {len(lines)} of the frequencies whose periods fit {duration:.4g} s, but a multisine needs "
            f"{_LEAST_LINES} for each axis; widen it, or fly {least:.3g} s or longer",
        )
    return lines[number::axes]


def multisine(order: IntArray, duration: float, time: Array, lift: int = 0) -> Array:
    """Evaluate a sum of cosines of amplitudes as 1/f, with phases of a low crest factor, and six derivatives.

    `order`: periods in the duration, ascending; `lift`: how often it is integrated, after its peak was made 1. Shape
    (7, time).
    """
    amplitude = 1.0 / order
    phase = _phases(tuple(order.tolist()))
    once = np.exp(1j * (2 * np.pi / duration * np.multiply.outer(_period(order, duration), order) + phase))
    peak = np.abs((once @ amplitude).real).max()
    frequency = 2 * np.pi / duration * order
    waves = np.exp(1j * (np.multiply.outer(time, frequency) + phase))
    orders = np.arange(_DERIVATIVES) - lift
    weights = amplitude[:, None] * (1j * frequency[:, None]) ** orders / peak
    values: Array = (waves @ weights).real.T
    return values


@lru_cache(maxsize=32)
def _phases(order: tuple[int, ...]) -> Array:
    """Choose phases of a low crest factor: Schroeder's, improved by clipping the peaks and keeping the amplitudes.

    Schroeder 1970, Synthesis of low-peak-factor signals and binary sequences with low autocorrelation, IEEE
    Transactions on Information Theory 16: ``phase_k = -2 pi sum_(j < k) (k - j) p_j`` for shares of power p. Van der
    Ouderaa, Schoukens and Renneboog 1988, Peak factor minimization using a time-frequency domain swapping algorithm,
    IEEE Transactions on Instrumentation and Measurement 37.
    """
    lines = np.array(order)
    count = _RESOLUTION * order[-1]
    amplitude = 1.0 / lines
    power = amplitude**2 / (amplitude**2).sum()
    phase = best = -2 * np.pi * np.concatenate([[0.0], np.cumsum(np.cumsum(power))[:-1]])
    lowest = np.inf
    for _ in range(_CLIPPINGS):
        spectrum = np.zeros(count // 2 + 1, dtype=complex)
        spectrum[lines] = amplitude * np.exp(1j * phase)
        values = np.fft.irfft(spectrum)
        peak = float(np.abs(values).max())
        if peak < lowest:
            lowest, best = peak, phase
        phase = np.angle(np.fft.rfft(np.clip(values, -_CLIPPED_AT * peak, _CLIPPED_AT * peak))[lines])
    return best


def _period(order: IntArray, duration: float) -> Array:
    """Divide the duration of a multisine so that its fastest wave is resolved, s."""
    count = _RESOLUTION * int(order[-1])
    times: Array = duration / count * np.arange(count, dtype=np.float64)
    return times


def sweep(settings: ExciteSettings, length: float, time: Array, lift: int = 0) -> Array:
    """Evaluate a sine whose frequency goes through the band in `length` s, amplitude as 1/f, and six derivatives.

    Time is since its beginning; `lift`: how often it is integrated, as a wave of the frequency at each time is, 0 or 2,
    after its peak at the lowest frequency was made 1. Shape (7, time).
    """
    low, high = settings.band_hz
    inside = np.clip(time, 0.0, length)
    rate = (high - low) / length if settings.signal == "sweep-linear" else np.log(high / low) / length
    linear = settings.signal == "sweep-linear"
    turns = _power(low, rate, inside, 1.0, linear=linear)
    begun = low * inside + 0.5 * rate * inside**2 if linear else low * np.expm1(rate * inside) / rate
    # Phase and its derivatives up to the sixth: the integral of the frequency.
    phase = 2 * np.pi * np.concatenate([begun[None], turns[:-1]])
    # A double integral turns the sign.
    scale = low * (-1.0) ** (lift // 2) / (2 * np.pi) ** lift
    amplitude = scale * _power(low, rate, inside, -1.0 - lift, linear=linear)
    return _product(amplitude, _turning(phase).imag)


def _power(low: float, rate: float, time: Array, power: float, *, linear: bool) -> Array:
    """Power of the frequency of a sweep with its derivatives, shape (7, time)."""
    frequency = low + rate * time if linear else low * np.exp(rate * time)
    if not linear:
        return np.stack([(power * rate) ** order * frequency**power for order in range(_DERIVATIVES)])
    falling = np.cumprod([1.0, *(power - np.arange(_DERIVATIVES - 1))])
    return np.stack([falling[n] * rate**n * frequency ** (power - n) for n in range(_DERIVATIVES)])


def _turning(phase: Array) -> Array:
    """Derive ``exp(i phase)`` from the derivatives of the phase: ``z' = i phase' z``, by Leibniz."""
    values = [np.exp(1j * phase[0])]
    for order in range(_DERIVATIVES - 1):
        values.append(1j * sum(comb(order, k) * phase[k + 1] * values[order - k] for k in range(order + 1)))
    return np.stack(values)


def _product(first: Array, second: Array) -> Array:
    """Derive a product from the derivatives of its factors, by Leibniz."""
    return np.stack([sum(comb(n, k) * first[k] * second[n - k] for k in range(n + 1)) for n in range(len(first))])


def _faded(signal: Array, time: Array, begin: float, length: float, settings: ExciteSettings) -> Array:
    """Let a signal rise from rest and fall to rest, as a base move does."""
    fade = fade_time(settings.band_hz[0], length)
    unit = covering(1.0, fade / _WAVES, Holds())
    window = (unit.sample(time - begin) - unit.sample(time - begin - length + fade)).T
    return np.asarray(_product(window, signal))


def fade_time(low: float, length: float) -> float:
    """Time in which an excitation rises, and in which it falls, s.

    Parameters
    ----------
    low : float, Hz
        Its lowest frequency.
    length : float, s
        Of the excitation, fades among it.
    """
    return min(_FADES * length, _PERIODS_OF_FADE / low)


def _crest(settings: ExciteSettings, number: int, duration: float) -> float:
    """Crest factor of the signal of an axis, before it is faded."""
    if settings.signal == "multisine":
        order = lines_of(settings, number, duration)
        values = multisine(order, duration, _period(order, duration))[0]
    else:
        length = duration / len(settings.axes)
        count = _RESOLUTION * ceil(settings.band_hz[1] * length)
        values = sweep(settings, length, length / count * np.arange(count, dtype=np.float64))[0]
    return float(np.abs(values).max() / np.sqrt(np.mean(values**2)))
