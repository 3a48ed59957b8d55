"""Parts of a log that measure no flight: bad values, rotors at rest or below zero, columns dead, clipped or still."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from math import ceil, floor, pi
from typing import Any, Final

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, runs
from cpfls_cli.errors import InputError
from cpfls_cli.flightlog.repair import SMALLEST_SHARE_KEPT, SignalTable, count_saturated
from cpfls_cli.flightlog.settings import ROTORS, ImportSettings, SignalMap
from cpfls_cli.rounding import less
from cpfls_cli.units import KNOWN_UNITS
from cpfls_cli.words import joined

_SHORTEST_REST_S = 0.5  # Shorter ones are those of a throttle that is cut in flight.
# A speed that is measured, or a command that was filtered, may undershoot zero a little.
_UNDERSHOOT = 0.01
_MOST_LISTED = 3
# A sensor at its limit stays there for several samples, and far longer than at the level just before it; the peak of a
# slow signal that is rounded stays too, but longer at the level before.
_CLIPPED_SAMPLES = 5
_CLIPPED_TO_NEXT = 3
# By signal: no sensor of a multirotor has its limit lower. A common smallest range of a gyroscope is 125 deg/s.
_LOWEST_LIMIT = {"body_rate": 1.0, "attitude_rate": 1.0, "acceleration": 15.0, "rotor_command": 0.0}
_UPDATES = 3  # In a row at an extreme, from which on that is no chance.
_MEASURED = frozenset(
    {"attitude", "quaternion", "body_rate", "attitude_rate", "position", "velocity", "acceleration", "rotor_speed"}
)
_SHORTEST_PAUSE_S = 0.5  # Shorter ones are bridged like gaps.
_FEWEST_IN_PAUSE = 20
SILENT: Final = "its source was silent there"
_USUAL_STEPS = 10  # Times the usual step between updates, and so many rows, from which on a source was silent.
# Signals that are never straight lines while they are measured.
_WITNESSES = {"body_rate", "acceleration", "rotor_speed", "rotor_command"}
_STRAIGHT = 1e-3  # Bend of a straight line by the rounding of a file, as a share of the largest.
_NEVER_SATURATED = {"quaternion", "voltage"}
# A quarter turn, and a margin for noise and filters.
_LARGEST_PITCH = pi / 2 + 0.05
STEEPEST_PITCH = pi / 2 - pi / 180
"""Pitch beyond which Euler rates are not used, rad."""
VERTICAL: Final = "pitch comes within a degree of +-90 degrees at {:.3f} s{}, where Euler rates are not defined"
_FULL_TURN = 7.0  # Somewhat more than a full turn, rad.
_ANGLE_QUANTILE = 0.99


def rotors_at_rest(table: SignalTable, settings: ImportSettings) -> dict[str, BoolArray]:
    """Mark the rows, by signal, in which no rotor turns: all of them at zero or below, or at their smallest value."""
    return {
        name: _at_rest(table.time, table.signals[name], settings.saturation_samples)
        for name in ROTORS
        if name in table.signals
    }


def _at_rest(time: Array, values: Array, samples: int) -> BoolArray:
    lowest = np.maximum(np.nanmin(values, axis=0), 0.0)
    resting = np.asarray((values <= lowest).all(axis=1), dtype=bool)
    kept = np.zeros(len(time), dtype=bool)
    # Commands that never change are a matter of dead columns.
    for first, after in [] if np.ptp(values) == 0 else runs(resting):
        if after - first >= samples and time[after - 1] - time[first] >= _SHORTEST_REST_S:
            kept[first:after] = True
    return kept


def warn_of_rest(table: SignalTable, resting: Mapping[str, BoolArray], settings: ImportSettings) -> Iterator[str]:
    """Say where rotors rest by `rotors_at_rest`, which crop leaves the longest flight, and where they turn backward."""
    for name, signal in settings.signals.items():
        if name not in resting:
            continue
        time, values, rest = table.time, table.signals[name], resting[name]
        if rest.any():
            low, high = float(np.nanmin(values[rest])), float(np.nanmax(values[rest]))
            level = _shown(low, signal) if low == high else f"{low:.4g} to {_shown(high, signal)}"
            yield (
                f"{name} stands at {level} on all rotors {_when(time, rest)}: on the ground, or falling, and not part"
                f" of a flight; {_crop(time, rest)}"
            )
        backward = (values < -_UNDERSHOOT * np.nanmax(np.abs(values))).any(axis=1)
        if backward.any():
            lowest = np.nanmin(values, axis=0)
            column = signal.names[int(np.argmin(lowest))]
            yield (
                f"{name} is below zero in {backward.sum()} of {len(backward)} rows, down to"
                f" {_shown(float(lowest.min()), signal)} in column {column}, but no rotor turns backward: where the"
                f" vehicle rests, cut it off with import.crop_s; otherwise check import.signals.{name}.scale, offset"
                " and sign"
            )


def _shown(value: float, signal: SignalMap) -> str:
    unit = KNOWN_UNITS[signal.unit].si
    return f"{value:.4g}" if unit == "1" else f"{value:.4g} {unit}"


def _when(time: Array, marked: BoolArray) -> str:
    stretches = [f"from {time[first]:.2f} s to {time[after - 1]:.2f} s" for first, after in runs(marked)]
    more = len(stretches) - _MOST_LISTED
    listed = ", ".join(stretches[:_MOST_LISTED])
    return f"{listed} and in {more} more stretches" if more > 0 else listed


def _crop(time: Array, rest: BoolArray) -> str:
    flown = ((time[first], time[after - 1]) for first, after in runs(~rest))
    begin, end = max(flown, key=lambda part: float(part[1] - part[0]), default=(0.0, 0.0))
    if end - begin < SMALLEST_SHARE_KEPT * (time[-1] - time[0]):
        return "there is hardly anything else in the log"
    return f"import.crop_s: [{ceil(100 * begin) / 100:g}, {floor(100 * end) / 100:g}] keeps the longest part without it"


def warn_of_dead(table: SignalTable, known: Iterable[str], settings: ImportSettings) -> Iterator[str]:
    """Name columns that are constant, or, unless they are known to be, clipped, or that stand still for a while."""
    for name, signal in settings.signals.items():
        values = table.signals[name]
        by_column = dict(zip(signal.names, values.T, strict=True))
        constant = [column for column, own in by_column.items() if np.nanmax(own) == np.nanmin(own)]
        if constant:
            subject, others = ("columns", "do") if len(constant) > 1 else ("column", "does")
            yield (
                f"{subject} {', '.join(constant)} of import.signals.{name} {others} not change in {len(values)} rows:"
                " dead, or never updated; map what changes, or leave the signal out"
            )
        for column in (each for each in by_column if each not in {*constant, *known}):
            own = by_column[column]
            # A rotor's command has no lower limit.
            signs = () if name not in _LOWEST_LIMIT else (1.0,) if name in ROTORS else (1.0, -1.0)
            limits = (sign * np.nanmax(sign * own) for sign in signs if clipped(sign * own, _LOWEST_LIMIT[name]))
            limit = next(limits, None)
            if limit is not None:
                count = int((own == limit).sum())
                yield f"column {column} is clipped at {_shown(limit, signal)}, for {count} samples: the rest is lost"
        if name in _MEASURED and len(constant) < len(by_column):
            known_rest = name in ROTORS and _at_rest(table.time, values, settings.saturation_samples)
            moves = np.broadcast_to(np.logical_not(known_rest), len(values))
            yield from _warn_of_pause(name, table.time[moves], values[moves])


def clipped(values: Array, lowest_limit: float) -> bool:
    """Tell whether a channel, shape (sample,), is clipped at its largest value, believed from a limit on."""
    levels = np.unique(values[np.isfinite(values)])
    if len(levels) < 2 or levels[-1] < lowest_limit:
        return False
    highest = values == levels[-1]
    crowded = highest.sum() > _CLIPPED_TO_NEXT * (values == levels[-2]).sum()
    return bool(crowded and max(after - first for first, after in runs(highest)) >= _CLIPPED_SAMPLES)


def _warn_of_pause(name: str, time: Array, values: Array) -> Iterator[str]:
    """Warn of stretches in which a measured signal does not change."""
    known = np.isfinite(values).all(axis=1)
    time, marked = time[known], stands_still(time[known], values[known])
    if marked.any():
        each = "rotor" if name in ROTORS else "axis"
        yield (
            f"{name} does not change on any {each} {_when(time, marked)}: {SILENT}, and the last value was repeated;"
            " cut it off with import.crop_s"
        )


def stands_still(time: Array, values: Array) -> BoolArray:
    """Mark where a measured signal does not change on any axis for far longer than between its updates.

    What is written with few digits and then goes on by no more than the last of them was within it, not silent.
    """
    same = (np.diff(values, axis=0) == 0).all(axis=1)
    levels = (np.unique(column[np.isfinite(column)]) for column in values.T)
    digit = np.array([np.diff(own).min(initial=np.inf) for own in levels])
    updates = np.flatnonzero(~same)
    usual = float(np.median(np.diff(updates))) if len(updates) > _FEWEST_IN_PAUSE else np.inf
    marked = np.zeros(len(time), dtype=bool)
    for first, last in runs(same):
        # Steps from row to row: the row after the last one is still the same.
        enough = last - first + 1 >= max(_FEWEST_IN_PAUSE, _USUAL_STEPS * usual)
        enough &= bool(time[last] - time[first] >= _SHORTEST_PAUSE_S)
        then = np.abs(values[last + 1 : last + 2] - values[last])
        marked[first : last + 1] = enough and (not len(then) or less(digit, then, np.abs(values[last])).any())
    return marked


def live_rows(table: SignalTable, origin: float) -> tuple[slice, str]:
    """Find the rows in which sources measure, and say which end or begin there; empty where all rows are live.

    Columns of a source that has ended may be extrapolated: straight lines, which noise never draws. Signals of sensors
    and rotors are asked; what a slow source draws from update to update is as short everywhere. Times are said from an
    origin on.
    """
    first, after, ends, begins = 0, len(table.time), [], []
    for name in _WITNESSES & table.signals.keys():
        begin, end = _extrapolated(table.time, table.signals[name], alone=name not in ROTORS)
        begins += [name] if begin else []
        ends += [name] if end < len(table.time) else []
        first, after = max(first, begin), min(after, end)
    if after - first < _FEWEST_IN_PAUSE or not (ends or begins):
        return slice(0, len(table.time)), ""
    words = [
        f"{joined(sorted(names))} run in straight lines {side}, where their source was silent"
        for names, side in (
            (begins, f"before {table.time[first] - origin:.1f} s"),
            (ends, f"from {table.time[after - 1] - origin:.1f} s on"),
        )
        if names
    ]
    return slice(first, after), "; ".join(words)


def _extrapolated(time: Array, values: Array, *, alone: bool) -> tuple[int, int]:
    """Find the first live row and the one after the last; rotors may ramp, so they have to leave their range too."""
    nothing = (0, len(time))
    if len(time) < 2 * _FEWEST_IN_PAUSE or not np.isfinite(values).all() or not (np.diff(time) > 0).all():
        return nothing
    slopes = np.diff(values, axis=0) / np.diff(time)[:, None]
    bends = np.abs(np.diff(slopes, axis=0))
    straight = np.all(bends <= _STRAIGHT * np.quantile(bends, 0.98, axis=0), axis=1)
    lines = runs(straight)
    inner = [after - first for first, after in lines if first > 0 and after < len(straight)]
    usual = float(np.median(inner)) if inner else 0.0
    found = list(nothing)
    for side, (first, after) in enumerate((lines[:1] + lines[-1:]) if lines else []):
        at_edge = first == 0 if side == 0 else after == len(straight)
        long = after - first >= max(_FEWEST_IN_PAUSE, _USUAL_STEPS * usual)
        long &= bool(time[after] - time[first] >= _SHORTEST_PAUSE_S)
        moves = bool((np.abs(slopes[first:after]).max(axis=0) > 0).all())
        # The corner itself is the last row that was measured.
        rest, line = values[after + 1 :] if side == 0 else values[: first + 1], values[first : after + 2]
        if at_edge and long and moves and len(rest):
            leaves = (np.abs(line - rest.mean(axis=0)).max(axis=0) > 2 * np.ptp(rest, axis=0)).any()
            found[side] = (after + 1 if side == 0 else first + 1) if alone or leaves else found[side]
    return found[0], found[1]


def count_values(
    table: SignalTable,
    spikes: Mapping[str, BoolArray],
    resting: Mapping[str, BoolArray],
    settings: ImportSettings,
    updated_hz: Mapping[str, float],
) -> dict[str, Any]:
    """Count bad values of each column of what is kept, by what they are in an `ImportReport`; others are left out.

    Where no rotor turns is not saturated; nor is a quaternion at hover (1), or a coarse voltage, or what rows repeat
    between two updates, which are `updated_hz` apart in signals that are slower than the rows.
    """
    step_s = float(np.median(np.diff(table.time))) if len(table.time) > 1 else 0.0

    def saturated(name: str, values: Array) -> int:
        repeated = _UPDATES / (updated_hz[name] * step_s) if name in updated_hz and step_s else 0.0
        length = max(settings.saturation_samples, ceil(repeated))
        return count_saturated(values, length, rest=0.0 if name in rotors else None)

    def by_column(signals: Mapping[str, Array | BoolArray], count: Callable[[str, Any], int]) -> dict[str, int]:
        counts = {
            column: count(name, values)
            for name, signal in settings.signals.items()
            if name in signals
            for column, values in zip(signal.names, signals[name].T, strict=True)
        }
        return {column: number for column, number in counts.items() if number}

    repaired = settings.spike_deviations is not None
    rotors = {name: np.where(rest[:, None], np.nan, table.signals[name]) for name, rest in resting.items()}
    others = {name: signal for name, signal in table.signals.items() if name not in _NEVER_SATURATED | rotors.keys()}
    found = by_column(spikes, lambda _, column: int(column.sum()))
    return {
        "missing": by_column(table.signals, lambda _, column: int(np.isnan(column).sum())),
        "spikes": found if repaired else {},
        "suspected_spikes": {} if repaired else found,
        "saturated": by_column(rotors, saturated) | by_column(others, saturated),
    }


def warn_of_values(counts: Mapping[str, Mapping[str, int]]) -> tuple[str, ...]:
    """Describe the columns whose suspicious values are used unchanged."""
    saturated = (
        f"column {column} stays at its extreme for {count} samples in all: saturated?"
        for column, count in counts["saturated"].items()
    )
    suspected = (
        f"{count} suspected {'spike' if count == 1 else 'spikes'} in column {column}, used as logged: set"
        " import.spike_deviations to interpolate"
        for column, count in counts["suspected_spikes"].items()
    )
    return (*saturated, *suspected)


def refuse_steep_pitch(signals: Mapping[str, Array]) -> None:
    """Refuse an attitude, shape (time, 3), rad, whose pitch exceeds a quarter turn, which such angles cannot."""
    largest = float(np.abs(signals["attitude"][:, 1]).max()) if "attitude" in signals else 0.0
    if largest > _LARGEST_PITCH:
        raise InputError(
            f"attitude reaches {largest:.3g} rad of pitch, but no pitch is larger than a quarter turn, 1.57 rad: is"
            " import.signals.attitude.unit deg? Otherwise check the order of its columns, and for spikes"
            " (import.spike_deviations)"
        )


def near_vertical(table: SignalTable, settings: ImportSettings) -> tuple[Array, list[str]]:
    """Mark rows near a vertical pitch with NaN, shape (time, 1), where they are to be a gap; and compose a warning."""
    attitude, quaternion = table.signals.get("attitude"), table.signals.get("quaternion")
    pitch = np.zeros(len(table.time)) if attitude is None else np.nan_to_num(attitude[:, 1])
    if attitude is None and quaternion is not None:
        w, x, y, z = np.roll(quaternion, settings.quaternion_order == "xyzw", axis=1).T
        squared = np.maximum((quaternion**2).sum(axis=1), np.finfo(float).tiny)
        pitch = np.arcsin(np.clip(np.nan_to_num(2 * (w * y - z * x) / squared), -1.0, 1.0))
    steep = table.time[np.abs(pitch) > STEEPEST_PITCH]
    until = np.append(steep, np.inf)[np.searchsorted(steep, table.time)]
    since = np.append(-np.inf, steep)[np.searchsorted(steep, table.time, side="right")]
    near = np.minimum(until - table.time, table.time - since) <= settings.gap_s
    # What is beyond a quarter turn is an angle in another unit; a nose that is always up leaves nothing.
    if settings.gap_rule == "stop" or not steep.size or np.abs(pitch).max() > _LARGEST_PITCH or (~near).sum() < 2:
        return np.zeros((len(near), 1)), []
    said = f"{VERTICAL.format(steep[0], '')}: {near.sum()} rows around that are a gap"
    return np.where(near, np.nan, 0.0)[:, None], [said]


def warn_of_angles(signals: Mapping[str, Array]) -> tuple[str, ...]:
    """Warn of roll or yaw, rad, beyond a full turn where no gyroscope confirms their unit; absent values are NaN."""
    if "attitude" not in signals or {"body_rate", "attitude_rate"} & signals.keys():
        return ()
    # A single spike says nothing about the unit.
    roll, _, yaw = np.nanquantile(np.abs(signals["attitude"]), _ANGLE_QUANTILE, axis=0)
    return tuple(
        f"attitude reaches {angle:.3g} rad of {name}: is import.signals.attitude.unit deg? (fine if the angle keeps"
        " counting over full turns)"
        for name, angle in (("roll", float(roll)), ("yaw", float(yaw)))
        if angle > _FULL_TURN
    )
