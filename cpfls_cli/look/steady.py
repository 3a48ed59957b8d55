"""Windows of a flight, means over them, and intervals of what is computed from them."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, runs
from cpfls_cli.autopilots.motors import ThrustCurve
from cpfls_cli.autopilots.registry import AUTOPILOTS
from cpfls_cli.blocks import FEWEST_BLOCKS, half_width, jackknife_covariance, leaving_out
from cpfls_cli.look.flight import LogFlight, Samples
from cpfls_cli.result import Estimate

WINDOW_S = 2.0
MOST_BLOCKS, PER_BLOCK = 10, 4
"""Blocks of a jackknife, of at least so many windows where there are enough of them."""
FEWEST_WINDOWS = 6
_RATE, _TILT = np.radians(40.0), np.radians(15.0)
"""Most root mean square of the body rates about roll and pitch, and mean rate about yaw; most mean tilt."""
_WHOLE = 0.7
"""Share of the samples expected in a window that it has to have."""


class Windows(NamedTuple):
    """Equally long windows of a flight in order of time, s."""

    begin: Array
    length_s: float

    def means(self, samples: Samples) -> Array:
        """Average a signal over each window, shape (window, channel); NaN where samples are missing."""
        values = samples.values.reshape(len(samples.time), -1)
        first, after = (np.searchsorted(samples.time, at) for at in (self.begin, self.begin + self.length_s))
        count = (after - first)[:, None]
        sums = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(np.nan_to_num(values), axis=0)])
        finite = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(np.isfinite(values), axis=0)])
        whole = (finite[after] - finite[first] == count) & (count > _WHOLE * self.length_s * samples.rate_hz)
        return np.where(whole, (sums[after] - sums[first]) / np.maximum(count, 1), np.nan)

    def keep(self, marked: BoolArray | slice) -> Windows:
        """Keep the windows that are marked, shape (window,), or in a slice."""
        return Windows(self.begin[marked], self.length_s)


def windows_of(flight: LogFlight, length_s: float = WINDOW_S) -> Windows:
    """Cut the usable stretches of a flight into windows that do not overlap."""
    begins = [
        np.arange(flight.time[first], flight.time[after - 1] - length_s + 1.5 / flight.rate_hz, length_s)
        for first, after in runs(flight.usable)
    ]
    return Windows(np.concatenate(begins) if begins else np.empty(0), length_s)


def on_clock(flight: LogFlight, values: Array) -> Samples:
    """Give a signal on the common clock as samples."""
    return Samples(flight.time, values)


def calm(flight: LogFlight, windows: Windows) -> BoolArray:
    """Tell in which windows the body hardly turns and, where attitude is known, hardly tilts, shape (window,)."""
    rate = windows.means(on_clock(flight, flight.body_rate))
    moving = windows.means(on_clock(flight, flight.body_rate[:, :2] ** 2)).sum(axis=1)
    tilt = windows.means(on_clock(flight, np.hypot(flight.attitude[:, 0], flight.attitude[:, 1])))[:, 0]
    return np.asarray((moving < _RATE**2) & (np.abs(rate[:, 2]) < _RATE) & ~(tilt > _TILT))


class Known(NamedTuple):
    """Numbers with what is known of their errors; `half`: of the 95 % interval."""

    value: Array
    half: Array
    covariance: Array
    blocks: int

    def estimate(self, index: int = 0) -> Estimate:
        """Give one of them with its interval."""
        return Estimate.around(self.value[index], self.half[index])

    def moved(self, matrix: Array) -> Known:
        """Map them linearly, shape (new, number)."""
        covariance = matrix @ self.covariance @ matrix.T
        half = half_width(np.sqrt(np.maximum(np.diag(covariance), 0.0)), self.blocks)
        return Known(matrix @ self.value, half, covariance, self.blocks)


def jackknifed(compute: Callable[[BoolArray], Array], count: int) -> Known | None:
    """Compute numbers from windows, and their errors without each block of neighbouring windows.

    Blocks hold what correlates from window to window. None where there are fewer than six windows, or a number is not
    finite without a block. `compute` takes which windows are kept to the numbers.
    """
    if count < FEWEST_WINDOWS:
        return None
    blocks = min(max(count // PER_BLOCK, FEWEST_BLOCKS), MOST_BLOCKS)
    value, left_out = leaving_out(compute, count, blocks)
    if not (np.isfinite(value).all() and np.isfinite(left_out).all()):
        return None
    covariance = jackknife_covariance(left_out)
    return Known(value, half_width(np.sqrt(np.diag(covariance)), blocks), covariance, blocks)


class StatedCurve(NamedTuple):
    """The thrust curve that an autopilot was given, by a parameter; no name and NaN where the log has none.

    `curve` is from commands as logged; `thrust`: whether those are shares of thrust, before that curve.
    """

    curve: ThrustCurve
    name: str
    value: float
    thrust: bool

    def thrusts(self, command: Array) -> Array:
        """Give shares of the full thrust for commands, as far as the autopilot knows."""
        return np.clip(command, 0.0, 1.0) if self.thrust else self.curve.thrust(command)


def number(flight: LogFlight, name: str) -> float | None:
    """Give a parameter of the autopilot as a number; None where the log has none."""
    try:
        return float(flight.parameters[name])
    except (KeyError, ValueError):
        return None


def stated_curve(flight: LogFlight) -> StatedCurve:
    """Take the thrust curve out of the parameters of a log; straight where it has none."""
    autopilot = AUTOPILOTS.get(flight.autopilot)
    found: dict[str, tuple[str, float]] = {}
    for role in ("expo", "low", "high"):
        parameter = autopilot.by_role(f"motors.{role}") if autopilot else None
        value = number(flight, parameter.name) if parameter else None
        if parameter and value is not None:
            found[role] = parameter.name, value * parameter.scale
    name, expo = found.get("expo", ("", np.nan))
    low, high = found.get("low", ("", 0.0))[1], found.get("high", ("", 1.0))[1]
    curve = ThrustCurve(expo if name else 0.0, low, high if high > low else 1.0, bool(autopilot and autopilot.series))
    # PX4 applies its curve behind what it logs there; what is asked of the mixer is thrust.
    asked = "actuator_motors" in flight.rotors.source or not flight.rotors.values.size
    rebuilt = flight.autopilot == "px4" and flight.rotors_source == "rebuilt"
    return StatedCurve(curve, name, expo, asked or rebuilt)
