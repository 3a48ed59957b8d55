"""The part of a log in which the vehicle flies: not on the ground, not idling, not disarmed."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import binary_closing, binary_opening

from cpfls_cli.arrays import Array, BoolArray, runs
from cpfls_cli.errors import SettingError
from cpfls_cli.flightlog.clock import increasing_rows
from cpfls_cli.flightlog.names import BY_HAND
from cpfls_cli.flightlog.repair import SignalTable, fill
from cpfls_cli.flightlog.settings import ROTORS, ImportSettings

_OF_HOVER = 0.6
"""Share of the level at hover below which rotors idle."""

_OF_LARGEST = 0.5
"""Share of the largest level above which rotors carry the vehicle."""

_SHORT_S = 1.0
"""Shorter pauses are part of a flight, and shorter flights none."""

_OF_HEIGHT, _LEAST_HEIGHT = 0.1, 0.05
"""Above the ground it flies: as a share of the highest, and in m."""

_MARGIN_S = 0.5
"""Left out after take-off and before landing, where the ground pushes."""

_STILL_RAD_S, _SOFT_RAD_S, _STILL_M = 0.005, 0.02, 0.3
"""Below the first a vehicle stands, whatever an estimate of its height does; below the second it has to move."""

_ALIVE = 0.02
"""Share of the largest command below which rotors stand."""

_TURNS_RAD_S, _OF_TURNING = 0.2, 0.3
"""Rate, also as a share of that in flight, from which on what idles falls or flips, and does not stand."""

_MOST_CLOCK_HZ = 50.0
"""Rate that is enough to find a flight."""

_FEWEST_ROWS = 10
"""Of which it can be told."""


@dataclass(frozen=True)
class FlownPart:
    """What of a log is a flight.

    Attributes
    ----------
    span_s : tuple of float or None
        Begin and end, s from the log's first stamp; None where all of it flies.
    reasons : tuple of str
        What was cut, where, and how that was told; what else flies and is left out.
    flies : bool
        False where nothing in it flies.
    """

    span_s: tuple[float, float] | None
    reasons: tuple[str, ...]
    flies: bool = True


def rotor_level(speeds: Array, *, shares: bool) -> Array:
    """Average speeds or commands of rotors, shape (time, rotor), as a share of their largest unless they are shares."""
    level = speeds.mean(axis=1)
    return np.asarray(level if shares else level / max(1.0, float(np.quantile(level, 0.98))))


def turning_size(body_rate: Array) -> Array:
    """Give the size of a body rate, shape (time, 3), without what it reads at rest."""
    return np.asarray(np.linalg.norm(body_rate - np.median(body_rate, axis=0), axis=1))


def flown_crop(table: SignalTable, settings: ImportSettings) -> tuple[tuple[float, float] | None, tuple[str, ...]]:
    """Find the longest stretch of a log that is flown, by the signals that a config maps, and say what that cuts.

    Raises
    ------
    SettingError
        If nothing in it flies.
    """
    rows, _ = increasing_rows(table.time)
    table = table.rows(rows)
    if len(table.time) < _FEWEST_ROWS:
        return None, ()
    step = max(float(np.median(np.diff(table.time))), 1 / _MOST_CLOCK_HZ)
    clock = np.arange(table.time[0], table.time[-1], step)
    known = {
        name: fill(table.time, table.signals[name], clock)
        for name in ("rotor_command", "rotor_speed", "position", "body_rate")
        if name in table.signals and np.isfinite(table.signals[name]).any(axis=0).all()
    }
    level = height = None
    name = next((name for name in ROTORS if name in known), None)
    if name is not None:
        level = rotor_level(known[name], shares=settings.signals[name].unit == "1")
    if "position" in known:
        height = known["position"][:, 2] * (1.0 if settings.world_frame == "ENU" else -1.0)
    flown = find_flown(clock, level, height, turning_size(known["body_rate"]) if "body_rate" in known else None)
    if not flown.flies:
        raise SettingError("crop_s", f"flown: {flown.reasons[0]}")
    return flown.span_s, flown.reasons


def find_flown(time: Array, level: Array | None, height: Array | None, rate: Array | None) -> FlownPart:
    """Find the longest stretch of a log that is flown.

    Parameters
    ----------
    time : array, shape (time,), s
        Uniform, from 0.
    level : array, shape (time,), or None
        Mean of the rotors' commands or speeds, 0 where they stand.
    height : array, shape (time,), m, or None
        Upward.
    rate : array, shape (time,), rad/s, or None
        Size of the body rate.
    """
    clock_hz = 1 / float(time[1] - time[0])
    every = max(1, int(clock_hz / _MOST_CLOCK_HZ))
    time = time[::every]
    level, height, rate = (None if values is None else values[::every] for values in (level, height, rate))
    period = float(time[1] - time[0])
    active, told = _active(level, height, rate, period)
    if active is None:
        return FlownPart(None, (told,), flies=False)
    if not active.any():
        return FlownPart(None, (f"no flight in it: {told} throughout",), flies=False)
    if _still(active, height, rate):
        return FlownPart(None, ("no flight in it: the vehicle neither turns nor moves",), flies=False)
    return _longest(time, active, told, level)


def _active(
    level: Array | None, height: Array | None, rate: Array | None, period: float
) -> tuple[BoolArray | None, str]:
    """Mark the samples in which the vehicle flies, and say how that is told."""
    if level is not None:
        level = np.nan_to_num(level)
        largest = float(np.quantile(level, 0.98))
        if largest < _ALIVE:
            return None, "no flight in it: the rotors stand still throughout"
        hover = float(np.median(level[level > _OF_LARGEST * largest]))
        carrying = level > _OF_HOVER * hover
        told = f"the rotors are below {100 * _OF_HOVER:.0f} % of their hover level"
        if rate is not None and carrying.any():
            # In free fall and in flips rotors idle too, but then the vehicle turns.
            window = max(1, round(_SHORT_S / period))
            turns = np.sqrt(np.convolve(rate**2, np.ones(window) / window, mode="same"))
            lively = turns > max(_TURNS_RAD_S, _OF_TURNING * float(np.median(turns[carrying])))
            first, last = np.flatnonzero(carrying)[[0, -1]]
            carrying[first:last] |= ((level > _ALIVE) & lively)[first:last]
            told += ", with hardly any rotation"
        turning = _smoothed(carrying, period)
        if height is None or not turning.any() or turning.all():
            return turning, told
        return _off_the_ground(turning, height, period), told + ", or it is on the ground"
    if height is not None and float(np.ptp(height)) > 2 * _LEAST_HEIGHT:
        ground = float(np.quantile(height, 0.02))
        above = height - ground > max(_LEAST_HEIGHT, _OF_HEIGHT * float(np.ptp(height)))
        starts_there = abs(float(np.median(height[: max(1, round(_SHORT_S / period))])) - ground) < _LEAST_HEIGHT
        return (_smoothed(above, period) if starts_there else np.ones(len(height), dtype=bool)), "it is on the ground"
    if rate is None:
        return (
            None,
            f"no rotors, no height and no rates are recognised, so flight cannot be told from standing: {BY_HAND}",
        )
    quiet = _quiet(rate, period)
    return ~quiet, "it does not turn at all"


def _off_the_ground(turning: BoolArray, height: Array, period: float) -> BoolArray:
    """Take away what turns its rotors on the ground that it stands on before."""
    first = int(np.argmax(turning))
    if first < _SHORT_S / period:
        return turning
    ground = float(np.median(height[max(0, first - round(1 / period)) : first]))
    highest = float(np.quantile(np.abs(height - ground)[turning], 0.95))
    if highest < 2 * _LEAST_HEIGHT:
        return turning
    risen = np.abs(height - ground) > max(_LEAST_HEIGHT, _OF_HEIGHT * highest)
    off = np.zeros_like(turning)
    # Between the first and the last moment above it a flight may well come down to the height of its ground.
    for first, after in runs(turning):
        high = first + np.flatnonzero(risen[first:after])
        if len(high):
            off[high[0] : high[-1] + 1] = True
    return _smoothed(off, period)


def _quiet(rate: Array, period: float) -> BoolArray:
    window = max(1, round(_SHORT_S / period))
    level = np.sqrt(np.convolve(rate**2, np.ones(window) / window, mode="same"))
    return np.asarray(level < max(_STILL_RAD_S, 0.05 * float(np.quantile(level, 0.9))), dtype=bool)


def _smoothed(marked: BoolArray, period: float) -> BoolArray:
    """Fill short pauses, then drop short stretches."""
    width = max(1, round(_SHORT_S / period))
    around = np.pad(marked, width, mode="edge")
    window = np.ones(width, dtype=np.bool_)
    return np.asarray(binary_opening(binary_closing(around, window), window)[width:-width], dtype=np.bool_)


def _still(active: BoolArray, height: Array | None, rate: Array | None) -> bool:
    moves = height is not None and float(np.ptp(height[active])) > _STILL_M
    if rate is None:
        return height is not None and not moves
    turning = float(np.sqrt(np.mean(rate[active] ** 2)))
    return turning < _STILL_RAD_S or (turning < _SOFT_RAD_S and height is not None and not moves)


def _longest(time: Array, active: BoolArray, told: str, level: Array | None) -> FlownPart:
    stretches = runs(active)
    first, after = max(stretches, key=lambda part: part[1] - part[0])
    begin, end = float(time[first]), float(time[after - 1])
    margin = min(_MARGIN_S, (end - begin) / 10)
    reasons = []
    if first > 0:
        begin += margin
        reasons.append(f"the first {begin:.1f} s are cut: {_how(level, slice(0, first), told)}")
    if after < len(time):
        end -= margin
        last = float(time[-1]) - end
        reasons.append(f"the last {last:.1f} s are cut: {_how(level, slice(after, None), told)}")
    others = [part for part in stretches if part[0] != first]
    if others:
        words = ", ".join(f"{time[a]:.1f} to {time[b - 1]:.1f} s" for a, b in others)
        reasons.append(f"it also flies at {words}; import.crop_s takes one stretch, the longest")
    whole = not reasons or (first == 0 and after == len(time))
    return FlownPart(None if whole else (round(begin, 2), round(end, 2)), tuple(reasons))


def _how(level: Array | None, part: slice, told: str) -> str:
    if level is None:
        return told
    return "the rotors stand still" if float(np.quantile(np.nan_to_num(level)[part], 0.9)) < _ALIVE else told
