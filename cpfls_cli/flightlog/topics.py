"""Topics of a log, each with a clock of its own, resampled to the clock of one of them."""

import re
from collections.abc import Mapping
from dataclasses import replace
from math import inf, pi

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.errors import InputError
from cpfls_cli.flightlog.bandwidth import is_fast
from cpfls_cli.flightlog.conversion import columns_in_words, present_choices
from cpfls_cli.flightlog.repair import align_quaternion_signs, increasing_rows, regular_stamps, unwrap_angles
from cpfls_cli.flightlog.settings import COMMANDS, MOTION, SETPOINTS, ImportSettings, SignalMap
from cpfls_cli.units import known_unit

Topics = Mapping[str, Mapping[str, Array]]
STAMP = "timestamp"  # The field of a topic that holds its time stamps.
REBUILT = "rebuilt"  # The topic of commands of rotors that are rebuilt (`flightlog.rebuilt`).
# The topic that a reader adds, of turns of the estimated yaw that it has undone: when, and `turn`, rad.
YAW_RESETS = "yaw_resets"
ROWS = "row / "  # With which stamps of rows that come so many times a second begin.
_ROWS_HZ = re.compile(r"row */ *(\d*[1-9]\d*(?:\.\d+)?)")
_ANGLES_THAT_JUMP = (0, 2)
# Of its usual steps for which a setpoint stays: the next one may be lost, and behind two nobody asks for it.
_STEPS_HELD = 3
# Share of the steps that none of the others is so many times as long as, unless it is a pause.
_MOST_STEPS, _PAUSE_STEPS = 0.9, 2.5
_ON_TIME = 0.01
_THINNED = 1.5  # Times as fast that a topic has to be for its thinning to matter.
# Stamps are rounded, so a pause of exactly the allowed length must pass.
_ROUNDING = 1 + 1e-9


def rows_clock(name: str, columns: Mapping[str, Array]) -> dict[str, Array]:
    """Compute the stamps, s, that ``row / 100`` names, of rows that come 100 times a second; nothing of other names."""
    rate = _ROWS_HZ.fullmatch(name)
    rows = max(map(len, columns.values()), default=0)
    return {name: np.arange(rows) / float(rate[1])} if rate and name not in columns else {}


def column_names(topics: Topics) -> tuple[str, ...]:
    """Name all columns of a log: ``topic.field``, or the field alone where the log is flat."""
    return tuple(f"{topic}.{field}" if topic else field for topic, fields in topics.items() for field in fields)


def topic_and_field(column: str) -> tuple[str, str]:
    """Split ``topic.field`` or ``topic[instance].field``, where 0 needs no number; without a field that is empty."""
    topic, _, field = column.partition(".")
    return re.sub(r"\[0\]$", "", topic), field


def on_one_clock(
    topics: Topics, units: Mapping[str, str], settings: ImportSettings
) -> tuple[dict[str, Array], ImportSettings, tuple[str, ...]]:
    """Put the mapped columns of all topics on the clock that `time_column` names; a flat log is on one already.

    Between two samples a command (torque, thrust, of rotors) keeps the previous value, and what is measured is
    interpolated linearly, quaternions with one sign and roll and yaw without full turns. Inside a pause of a topic
    longer than `gap_s` the values are absent. A setpoint is held as `hold_asked` does.

    Topics have stamps in s from one origin; units are those that the log states, and stamps that have one are in s.
    Given back are the mapped columns that exist, stamps in `time_unit`, the others by name only, as empty arrays; the
    settings with the columns that the log has and the name of the clock; and warnings.
    """
    if "" in topics:
        columns, time = topics[""], settings.time_column
        if time is None:
            raise InputError(
                "import.time_column = null takes the stamps of a topic, but this log has no topics: name the column of"
                f" its stamps; {columns_in_words(columns)}"
            )
        stated = {time: columns[time]} if time in units else rows_clock(time, columns)
        converted = {name: own / known_unit(settings.time_unit).factor for name, own in stated.items()}
        chosen = present_choices(columns, settings)
        return {**columns, **converted}, chosen, _say_choices(settings, chosen)
    mapped = [(column, *topic_and_field(column)) for column in settings.mapped_columns]
    chosen = present_choices({column for column, topic, field in mapped if field in topics.get(topic, {})}, settings)
    chosen = _with_clock(topics, chosen)
    resampled, warnings = _resampled(topics, chosen)
    resampled[str(chosen.time_column)] /= known_unit(settings.time_unit).factor
    return resampled, chosen, (*_say_choices(settings, chosen), *warnings)


def _say_choices(settings: ImportSettings, chosen: ImportSettings) -> tuple[str, ...]:
    """Say which signals are not of the columns that are named first."""
    first = {name: signal.columns[0] for name, signal in settings.signals.items()}
    return tuple(
        f"{name} is taken from {', '.join(signal.columns)}: the log lacks some of {first[name]} and its kind"
        for name, signal in chosen.signals.items()
        if signal.columns[0] != first[name]
    )


def _with_clock(topics: Topics, settings: ImportSettings) -> ImportSettings:
    """Name the stamps that are the clock; those of the fastest mapped topic where the settings leave it open."""
    if settings.time_column is not None:
        base, stamp = topic_and_field(settings.time_column)
        if len(topics.get(base, {}).get(stamp, ())) and stamp.startswith(STAMP):
            return settings
    clocked = [signal for name, signal in settings.signals.items() if name not in SETPOINTS]
    mapped = [topic_and_field(column)[0] for signal in clocked for column in signal.columns]
    steps = {topic: _step(topics[topic][STAMP]) for topic in mapped if STAMP in topics.get(topic, {})}
    # Some topics have stamps that stand still.
    steps = {topic: step for topic, step in steps.items() if 0 < step < inf}
    fastest, held = f"{min(steps, key=steps.__getitem__)}.{STAMP}" if steps else None, column_names(topics)
    if settings.time_column is None and fastest:
        return replace(settings, time_column=fastest)
    if settings.time_column is None:
        raise InputError(f"import.signals: the log has none of the mapped topics; {columns_in_words(held)}")
    example = f", such as {fastest}" if fastest else ""
    raise InputError(
        f"import.time_column = {settings.time_column!r}: in this log every topic has its own stamps; name those of the"
        f" fastest mapped one{example}, or null for them; {columns_in_words(held)}"
    )


def _resampled(topics: Topics, settings: ImportSettings) -> tuple[dict[str, Array], tuple[str, ...]]:
    columns = {name: np.empty(0) for name in column_names(topics)}
    base, stamp = topic_and_field(str(settings.time_column))
    clocks = {topic: fields.get(stamp, fields[STAMP]) for topic, fields in topics.items() if STAMP in fields}
    used, warnings = {base}, list[str]()
    smooth = [_continuous(name, signal, topics) for name, signal in settings.signals.items() if name in MOTION]
    for topic, time in clocks.items():
        own = [values for each in smooth for column, values in each.items() if topic_and_field(column)[0] == topic]
        motion = [values for values in own if len(values) == len(time)]
        clocks[topic], scattered = regular_stamps(time, motion, f" of topic {topic}")
        warnings += scattered
    target = clocks[base]
    columns[str(settings.time_column)] = target.copy()
    for name, signal in settings.signals.items():
        asked = name in SETPOINTS
        # A setpoint comes as seldom as it likes: it stays until the next one.
        unfit = None if signal.required else _unfit(signal, topics, clocks, base, inf if asked else settings.gap_s)
        if unfit:
            warnings.append(f"signal {name} is left out: {unfit}")
            left = {".".join(topic_and_field(column)) for column in signal.columns} | {*signal.columns}
            columns = {column: values for column, values in columns.items() if column not in left}
            continue
        for column, values in _continuous(name, signal, topics).items():
            topic = topic_and_field(column)[0]
            columns[column] = values
            if asked:
                columns[column] = hold_asked(clocks[topic], values, target, settings.gap_s)
                continue
            used.add(topic)
            if topic != base:
                if _step(clocks[topic]) > settings.gap_s:
                    slow = _slowness(topic, clocks[topic], settings.gap_s)
                    raise InputError(f"{slow}: raise import.gap_s, or leave its signals out of import.signals")
                hold = name in COMMANDS and is_fast(_values_hz(clocks[topic], values))
                columns[column] = interpolate(clocks[topic], values, target, settings.gap_s, hold=hold)
    step, steps = _step(clocks[base]), {topic: _step(clocks[topic]) for topic in sorted(used)}
    warnings += [
        f"topic {topic} ({1 / own:.4g} Hz) is downsampled to the clock of {base} ({1 / step:.4g} Hz), which aliases its"
        f" noise into the flight: name the faster one in import.time_column"
        for topic, own in steps.items()
        if 0 < own * _THINNED < step
    ]
    return columns, tuple(warnings)


def _unfit(signal: SignalMap, topics: Topics, clocks: Mapping[str, Array], base: str, limit_s: float) -> str | None:
    """Say why a signal that a log may lack is as good as lacking in it; None if it is not."""
    parts = [topic_and_field(column) for column in signal.columns]
    values = [topics[topic][field] for topic, field in parts if field in topics.get(topic, {})]
    if values and not any(np.any(own[np.isfinite(own)]) for own in values):
        return "its columns are 0 or absent throughout"
    slow = [topic for topic, _ in parts if topic != base and topic in clocks and _step(clocks[topic]) > limit_s]
    return _slowness(slow[0], clocks[slow[0]], limit_s) if slow else None


def _continuous(name: str, signal: SignalMap, topics: Topics) -> dict[str, Array]:
    """Select the existing columns of a signal, with angles unwrapped and quaternion signs aligned."""
    parts = {column: topic_and_field(column) for column in signal.columns}
    existing = {
        column: topics[topic][field] for column, (topic, field) in parts.items() if field in topics.get(topic, {})
    }
    of_one_topic = len({topic for topic, _ in parts.values()}) == 1 and len(existing) == len(parts)
    if name == "quaternion" and of_one_topic:
        return dict(zip(existing, align_quaternion_signs(np.column_stack(list(existing.values()))).T, strict=True))
    if name == "attitude":
        turn = 2 * pi / abs(signal.scale * known_unit(signal.unit).factor)
        jumping = {column for axis, column in enumerate(signal.columns) if axis in _ANGLES_THAT_JUMP}
        return {column: unwrap_angles(v, turn) if column in jumping else v for column, v in existing.items()}
    return existing


def _slowness(topic: str, time: Array, gap_s: float) -> str:
    return f"topic {topic} has a sample only every {_step(time):.3g} s (median), longer than import.gap_s = {gap_s:g}"


def stamped_rates(topics: Topics, settings: ImportSettings) -> dict[str, float]:
    """Count how often a second each signal was logged, by its topic's stamps; a flat log has no rates."""
    rates: dict[str, float] = {}
    for name, signal in settings.signals.items():
        topic, field = topic_and_field(signal.columns[0])
        own = topics.get(topic, {})
        if topic and name not in SETPOINTS and field in own and STAMP in own:
            rates[name] = _values_hz(own[STAMP], own[field])
    return rates


def _values_hz(time: Array, values: Array) -> float:
    return logged_hz(_present(time, np.asarray(values, dtype=float))[0])


def logged_hz(time: Array) -> float:
    """Count how often a second there is a sample, by stamps, s; lost ones, and pauses as before arming, are left out.

    A pause is far longer than most steps; of fewer than two stamps the rate is 0.
    """
    steps = np.diff(time)
    if not len(steps):
        return 0.0
    usual = float(np.quantile(steps, _MOST_STEPS, method="lower"))
    return float(1 / steps[steps <= _PAUSE_STEPS * usual].mean())


def _step(time: Array) -> float:
    return float(np.median(np.diff(time))) if len(time) > 1 else float("inf")


def interpolate(time: Array, values: Array, target: Array, longest_s: float, *, hold: bool = False) -> Array:
    """Interpolate linearly, or hold the previous value, between samples of finite value that are near enough.

    NaN before the first sample, after the last, and in steps longer than `longest_s`, s. All arrays have one axis,
    stamps and targets are in s.
    """
    time, values = _present(time, values)
    if not len(time):
        return np.full(len(target), np.nan)
    after = np.searchsorted(time, target, side="left")
    nearest = np.minimum(after, len(time) - 1)
    between = (after > 0) & (after < len(time))
    near = np.diff(time, prepend=time[0])[nearest] <= longest_s * _ROUNDING
    previous = np.maximum(np.searchsorted(time, target, side="right") - 1, 0)
    found = values[previous] if hold else np.interp(target, time, values)
    return np.where((time[nearest] == target) | (between & near), found, np.nan)


def hold_asked(time: Array, values: Array, target: Array, gap_s: float) -> Array:
    """Hold what was asked for until it is asked for again, for three of its usual steps, and for `gap_s`, at most.

    What comes before the first sample by no more than that has its value: the log began between two. Arguments and
    result are those of `interpolate`, and `gap_s` is the longest step between measurements that is bridged, s.
    """
    time, values = _present(time, values)
    if not len(time):
        return np.full(len(target), np.nan)
    held_s = max(gap_s, _STEPS_HELD * _step(time) if len(time) > 1 else 0.0) * _ROUNDING
    previous = previous_rows(time, target)
    return np.where(np.abs(target - time[previous]) <= held_s, values[previous], np.nan)


def previous_rows(time: Array, target: Array) -> IntArray:
    """Find the last row of stamps, s, at each target, s, or before it, the first row before them all.

    A target's clock may have been computed: what is a hundredth of its step late counts as on time.
    """
    late = _ON_TIME * _step(target) if len(target) > 1 else 0.0
    return np.asarray(np.maximum(np.searchsorted(time, target + late, side="right") - 1, 0))


def _present(time: Array, values: Array) -> tuple[Array, Array]:
    finite = np.isfinite(values)
    rows, _ = increasing_rows(time[finite])
    return time[finite][rows], values[finite][rows]
