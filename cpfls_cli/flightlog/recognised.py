"""A log's columns on their clocks, and what they are taken for so far, with the reason and the rivals of each guess."""

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Final, Literal, NamedTuple, get_args

import numpy as np
from scipy.ndimage import median_filter
from scipy.spatial.transform import Rotation

from cpfls_cli.arrays import Array
from cpfls_cli.errors import InputError
from cpfls_cli.flightlog.agreement import body_rate_from, fit_axes, handed, slow
from cpfls_cli.flightlog.airframe import MovedBy
from cpfls_cli.flightlog.conversion import as_mapped
from cpfls_cli.flightlog.flown import SHORTEST_FLIGHT_S, FlownPart, too_short
from cpfls_cli.flightlog.names import (
    OF_A_MATRIX,
    Named,
    column_groups,
    evenly_rising,
    named_signals,
    nameless_clock,
    without_names,
)
from cpfls_cli.flightlog.repair import increasing_rows
from cpfls_cli.flightlog.settings import ROTORS, UNITS_OF_SIGNAL, SignalMap, SignalName
from cpfls_cli.flightlog.topics import ROWS, STAMP, Topics, column_names, rows_clock
from cpfls_cli.units import KNOWN_UNITS, STANDARD_GRAVITY, UnitName, known_unit

if TYPE_CHECKING:
    from cpfls_cli.flightlog.rebuilt import Rebuilt

_TIME_NAMES: Final = re.compile(
    r"(ts?|time(_?stamp)?)([_ ]?[\[(]?([mun]?s|[mun]?sec|utc)[\])]?)?|tout|stamp|ticks?|sec(onds)?|millis?|mills|micros"
)
_TIME_UNITS: Final = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
# Columns of stamps that a message names, and the share of falls below which one that is called like them counts.
_REFUSED, _SELDOM = 3, 0.1
_STEPS_S = (2e-4, 0.5)  # Steps between stamps of logs of flights, s: 5 kHz to 2 Hz.
_SEVERAL = 3.0  # Times as often that other columns have to come to be preferred.
_PULSES = (800.0, 2300.0)  # Of receivers, us.
_AS_GRAVITY = 0.15  # Share by which what carries a multirotor is usually off gravity.
_SLOWEST_HZ = 0.5  # Below which a signal shows nothing of a flight.
_FEWEST_SAMPLES = 20  # For medians and rates.
# Time that stamps span over that which rows of one rate fill, up to which they are a clock with pauses.
_LARGEST_SPAN = 100
# Of rows without stamps: how many show their rate, Hz, which rates are a log's, and which share of the gyroscope the
# attitude explains. The rates are less than 57 times apart: with degrees taken for radians most logs are beyond them.
_FEWEST_ROWS, _ROWS_HZ, _TURNS_ALIKE = 200, (18.0, 1020.0), 0.8
_HALVES = 1.25  # Ratio of the rates of both halves up to which noise parts them.
# Standard deviation of a gyroscope in flight: below the first it reads rad/s, from the second on deg/s.
RADIANS_UP_TO, DEGREES_FROM = 2.0, 10.0
_GRID_HZ = 100.0  # Rate at which signals are compared, whose motion is below a tenth of it.


class LogTable:
    """Columns of a log by name, each on its own clock, and all of them on one."""

    def __init__(self, topics: Topics, units: Mapping[str, str]) -> None:
        self.topics, self.units = topics, units
        self.flat = set(topics) == {""}
        self.names = column_names(topics)
        samples = max(map(len, topics[""].values()), default=0) if self.flat else _FEWEST_SAMPLES
        if samples < _FEWEST_SAMPLES:
            raise InputError(f"holds only {samples} samples, too few for a flight")
        stamps = _flat_time(topics[""], units) if self.flat else ("", "s", "")
        self.time_column, self.time_unit, self.time_doubt = stamps
        if self.flat and (rows := rows_clock(self.time_column, topics[""])):
            self.topics = {"": {**topics[""], **rows}}
        if self.time_doubt:
            self._take_unit_of_motion()
        self.origin = float(next(filter(np.isfinite, self.clock("")))) if self.flat else 0.0
        self.grid = np.empty(0)

    def _take_unit_of_motion(self) -> None:
        """Correct a doubtful unit of stamps to the one in which positions change as velocities say."""
        named = {own.signal: own.group.columns for own in reversed(named_signals(column_groups(self.names), ""))}
        if not named.keys() >= {"position", "velocity"}:
            return
        (time, places), (_, speeds) = self.values(named["position"]), self.values(named["velocity"])
        if min(len(time), len(speeds)) < _FEWEST_SAMPLES or not speeds.std() > 0:
            return
        stated = _TIME_UNITS[self.time_unit]
        times = np.gradient(places, time, axis=0).std() / speeds.std() * stated
        step, (least, most) = float(np.median(np.diff(time))) / stated, _STEPS_S
        # Units are a thousand apart, and derivatives of positions noisy: steps have to be those of a log as well.
        fitting = (own for own, by in _TIME_UNITS.items() if 0.1 < times / by < 10 and least <= step * by <= most)
        unit = next(fitting, self.time_unit)
        if unit != self.time_unit:
            self.time_doubt += f": so it is taken to be in {unit}, in which positions change as velocities say"
            self.time_unit = unit

    def with_topic(self, topic: str, fields: Mapping[str, Array]) -> "LogTable":
        """Add a topic, which has stamps of its own."""
        more = copy(self)
        more.topics = {**self.topics, topic: fields}
        more.names = column_names(more.topics)
        return more

    def require_long_enough(self, span_s: float) -> None:
        """Refuse a log, or what of it holds a flight, that is too short to be one."""
        if span_s < SHORTEST_FLIGHT_S:
            raise InputError("; ".join(["holds " + too_short(span_s), *([self.time_doubt] if self.time_doubt else [])]))

    def parts(self, column: str) -> tuple[str, str]:
        """Split a column into topic and field."""
        if self.flat:
            return "", column
        topic, _, name = column.partition(".")
        return topic, name

    def clock(self, topic: str) -> Array:
        """Stamps of a topic, s."""
        if self.flat:
            factor = 1.0 if self.time_column in self.units else _TIME_UNITS[self.time_unit]
            return np.asarray(self.topics[""][self.time_column] * factor, dtype=float)
        return np.asarray(self.topics[topic].get(STAMP, np.empty(0)), dtype=float)

    def values(self, columns: Sequence[str]) -> tuple[Array, Array]:
        """Stamps and values of columns, rows without a value left out; all on the clock of the first one's topic."""
        topic = self.parts(columns[0])[0]
        if any(self.parts(column)[0] != topic for column in columns):
            clocks = [self.values((column,)) for column in columns]
            time = clocks[0][0] if all(len(own) for own, _ in clocks) else np.empty(0)
            each = [np.interp(time, own, values[:, 0]) if len(time) else time for own, values in clocks]
            return time, np.column_stack(each)
        time = self.clock(topic)
        if self.of_other_length(columns):
            return np.empty(0), np.empty((0, len(columns)))
        rows = np.column_stack([np.asarray(self.topics[topic][self.parts(c)[1]], dtype=float) for c in columns])
        kept, _ = increasing_rows(np.where(np.isfinite(rows).all(axis=1), time, np.nan))
        return time[kept], rows[kept]

    def of_other_length(self, columns: Sequence[str]) -> bool:
        """Check whether columns of one topic have more or fewer values than it has stamps."""
        topic = self.parts(columns[0])[0]
        return {len(self.topics[topic][self.parts(column)[1]]) for column in columns} != {len(self.clock(topic))}

    def without_spikes(self, columns: Sequence[str]) -> Array:
        """Values of columns, each the median of five neighbours: what rotors do takes longer."""
        return np.asarray(median_filter(self.values(columns)[1], size=(5, 1)), dtype=float)

    def on_grid(self, columns: Sequence[str], *, spikes: bool = True) -> Array:
        """Columns on the one clock; at its ends the nearest value."""
        time, values = self.values(columns)
        values = values if spikes else self.without_spikes(columns)
        return np.column_stack([np.interp(self.grid, time, column) for column in values.T])

    def stated_unit(self, column: str, signal: SignalName) -> UnitName | None:
        """Give the unit that the log states of a column, None where it states none or one that a signal cannot have."""
        stated = self.units.get(column, "")
        # Pulses in us are no time: their range makes them shares.
        unit = next((known for known in get_args(UnitName) if known == stated and known != "us"), None)
        return unit if unit is not None and KNOWN_UNITS[unit].si in UNITS_OF_SIGNAL[signal] else None

    def rate_hz(self, columns: Sequence[str]) -> float:
        """Median rate of the topic of a column."""
        time, _ = self.values(columns[:1])
        return 1 / float(np.median(np.diff(time))) if len(time) > 2 else 0.0


def _flat_time(fields: Mapping[str, Array], units: Mapping[str, str]) -> tuple[str, str, str]:
    """Find the column of stamps, which never falls and says by name or steps what it counts; and any doubt of that."""
    ranks: dict[str, int] = {}
    refused: list[str] = []
    paths = [re.split(r"(?=[/.])", name) for name in fields]
    groups = Counter("".join(path[:depth]) for path in paths for depth in range(len(path)))
    for name, values in fields.items():
        # In a struct, or a group of HDF5, what comes last says what it is; alone it is a unit, as in deg/sec.
        *path, last = re.split(r"(?=[/.])", name)
        lower = (last.lstrip("/.") if groups["".join(path)] > 1 else name).lower().removesuffix("[0]").strip()
        known = np.asarray(values, dtype=float)
        known = known[np.isfinite(known)]
        usual = _TIME_NAMES.fullmatch(lower)
        changes = len(known) > max(2, 0.5 * len(values)) and np.ptp(known) > 0
        named = usual or "time" in lower or "stamp" in lower
        back = _steps_back(name, values)
        if changes and back and named and float(np.mean(np.diff(known) < 0)) < _SELDOM:
            refused += [f"{back}: keep the rows of one flight, and leave out rows whose stamps are wrong"]
        if changes and not back and (named or units.get(name) == "s"):
            ranks[name] = 0 if lower in ("t", "time") else 1 if usual else 2 if named else 3
    # Of as good names the one that most columns are as long as.
    alike = Counter(len(values) for values in fields.values())
    for name in sorted(ranks, key=lambda name: (ranks[name], -alike[len(fields[name])])):
        step = float(np.median(np.diff(fields[name][np.isfinite(fields[name])])))
        if name in units:
            return name, "s", ""
        ending = re.search(r"(?:[_ \[(]|time)([num]?s)[\])]?$", name.lower())
        fitting = [unit for unit, factor in _TIME_UNITS.items() if _STEPS_S[0] <= step * factor <= _STEPS_S[1]]
        if ending or fitting:
            unit, doubt = ending[1] if ending else fitting[0], ""
            if fitting and unit not in fitting:
                doubt = f"{name} is said to be in {unit}, but steps of {step:.3g} are those of a flight in {fitting[0]}"
            elif step == 1:
                doubt = f"{name} rises by 1 from row to row, and may count rows or seconds: is import.time_unit right?"
            return name, unit, doubt
        if ranks[name] < 2:
            how = "log finer stamps" + (", or write one row for each stamp" if step == 0 else "")
            refused += [f"{name} rises by {step:.3g} between most rows, as no clock of a flight does: {how}"]
    clock = nameless_clock(fields)
    if clock is not None:
        return clock, "s", ""
    even = evenly_rising(fields)
    for name, step in even.items() if len(even) == 1 else ():
        for unit in (unit for unit, factor in _TIME_UNITS.items() if _STEPS_S[0] <= step * factor <= _STEPS_S[1]):
            return name, unit, f"{name} alone rises evenly, by {step:.3g}: taken for the stamps, in {unit}"
    by_hand = "write the config by hand (`cpfls config` prints every key)"
    if refused:
        raise InputError("; ".join([*refused[:_REFUSED], f"rename another one, or {by_hand}"]))
    if rows := _rows_by_motion(fields):
        doubt = f"it has no stamps: {rows} is taken for them, with which the attitude turns as the gyroscope reads"
        return rows, "s", doubt
    if matrix := without_names(fields):
        raise InputError(matrix)
    raise InputError(
        "no column of time stamps is recognised: it has to rise from row to row and be called t, time or timestamp;"
        f" rename it, or {by_hand}, with import.time_column = row / 100 where 100 rows come in a second"
    )


def _rows_by_motion(fields: Mapping[str, Array]) -> str:
    """Find how often rows without stamps come, at which the attitude turns as the gyroscope reads; empty if nowhere."""
    named = {own.signal: own for own in reversed(named_signals(column_groups((*fields,)), ""))}
    if not named.keys() >= {"attitude", "body_rate"}:
        return ""
    pair = named["attitude"], named["body_rate"]
    columns = [np.asarray(fields[column], dtype=float) for own in pair for column in own.group.columns]
    # The clock is one of all rows.
    if {*map(len, columns)} != {max(map(len, fields.values()))} or len(columns[0]) < _FEWEST_ROWS:
        return ""
    # A gyroscope of whole numbers may count what its sensor gives.
    if not np.isfinite(columns).all() or (named["body_rate"].unit is None and not np.mod(columns[3:], 1.0).any()):
        return ""
    angles, rates = (
        own.scale * np.column_stack(part) for own, part in zip(pair, (columns[:3], columns[3:]), strict=True)
    )
    degrees = named["attitude"].unit == "deg" or (named["attitude"].unit is None and np.abs(angles).max() > 2 * np.pi)
    turns = Rotation.from_euler("xyz", angles, degrees=degrees)
    # As if a hundred came in a second: what is slow is so many rows long then.
    turned, felt = slow(body_rate_from(turns, 1.0), _GRID_HZ), slow(rates, _GRID_HZ)
    fit = fit_axes(turned, felt)
    spread = float(np.sqrt(rates.var(axis=0).sum()))
    unit = named["body_rate"].unit or ("deg/s" if spread > DEGREES_FROM else "rad/s" if spread < RADIANS_UP_TO else "")
    hz = fit.gain * known_unit(unit).factor if unit else 0.0
    if not (fit.explained > _TURNS_ALIKE and _ROWS_HZ[0] < hz < _ROWS_HZ[1]):
        return ""
    # Rows that come more often in one half of the motion than in the other have no rate.
    done = np.cumsum((turned**2).sum(axis=1))
    half = int(np.searchsorted(done, 0.5 * done[-1]))
    early, late = (
        np.linalg.norm(felt[part]) / np.linalg.norm(turned[part]) for part in (slice(half), slice(half, None))
    )
    return f"{ROWS}{hz:.0f}" if max(early, late) < _HALVES * min(early, late) else ""


def _steps_back(name: str, values: Array) -> str:
    """Say how often stamps, shape (row,), fall, and where they do first; empty where they never do."""
    stamps = np.asarray(values, dtype=float)
    rows = np.flatnonzero(np.isfinite(stamps))
    known = stamps[rows]
    falls = np.flatnonzero(np.diff(known) < 0)
    if not len(falls):
        return ""
    first = falls[0]
    before, after = (str(each).removesuffix(".0") for each in known[first : first + 2].tolist())
    times = "once, at" if len(falls) == 1 else f"{len(falls)} times, first at"
    return f"{name} falls {times} row {rows[first + 1] + 1} of {len(values)}, from {before} to {after}"


def holding_values(log: LogTable, candidates: Sequence[Named]) -> dict[SignalName, list[Named]]:
    """Keep what has enough values that change, by signal."""
    kept: dict[SignalName, list[Named]] = {}
    for candidate in candidates:
        # The unit that a log states wins over the one that its kind is known for.
        unit = log.stated_unit(candidate.group.columns[0], candidate.signal)
        named = candidate if unit is None else replace(candidate, unit=unit, scale=1.0)
        time, values = log.values(named.group.columns)
        if named.signal in ROTORS and len(time) < _FEWEST_SAMPLES:
            # Outputs that are not there hold no numbers.
            enough = tuple(c for c in named.group.columns if len(log.values((c,))[0]) >= _FEWEST_SAMPLES)
            named = replace(named, group=replace(named.group, columns=enough or named.group.columns))
            time, values = log.values(named.group.columns)
        enough_rows = len(time) >= _FEWEST_SAMPLES and log.rate_hz(named.group.columns) >= _SLOWEST_HZ
        if named.signal == "body_rate" and not named.known and len(values) and _is_gravity(values):
            continue
        # Sticks have the names of angles too.
        if named.signal == "attitude" and len(values) and _PULSES[0] < values.min() and values.max() < _PULSES[1]:
            continue
        if enough_rows and float(np.ptp(values, axis=0).max()) > 0:
            kept.setdefault(named.signal, []).append(named)
    for found in kept.values():
        # Columns that the same kind of log is known for, and that come several times as often, go first.
        rates = {named: log.rate_hz(named.group.columns) for named in found if named.known}
        fastest = max(rates.values(), default=0.0)
        found.sort(key=lambda named: named in rates and rates[named] * _SEVERAL < fastest)
    return kept


def _is_gravity(values: Array) -> bool:
    """Tell what keeps nearly the length of gravity, in m/s^2 or g, as no gyroscope does: g may be its name."""
    lengths = np.linalg.norm(values, axis=1)
    length = float(np.median(lengths))
    alike = min(abs(length / size - 1) for size in (1.0, STANDARD_GRAVITY)) < _AS_GRAVITY
    return alike and float(lengths.std()) < _AS_GRAVITY * length


def make_grid(log: LogTable, candidates: Mapping[SignalName, Sequence[Named]]) -> None:
    """Lay one uniform clock over all signals of motion and rotors."""
    leading = {name: log.values(found[0].group.columns[:1])[0] for name, found in candidates.items()}
    clocks = [clock for name, clock in leading.items() if name != "voltage"] or [*leading.values()]
    rate = min(_GRID_HZ, max(1 / float(np.median(np.diff(clock))) for clock in clocks))
    begin, end = min(float(clock[0]) for clock in clocks), max(float(clock[-1]) for clock in clocks)
    log.require_long_enough(end - begin)
    rows = max(map(len, clocks))
    if (end - begin) * rate > _LARGEST_SPAN * rows:
        raise InputError(
            f"its stamps span {end - begin:.3g} s, but {rows} rows at {rate:.3g} Hz are {rows / rate:.3g} s: damaged,"
            " or not a clock; cut out the part that flies"
        )
    log.grid = np.arange(begin, end, 1 / rate)


# Whether the data decided, a name or the kind of log says so, or neither does.
Sure = Literal["data", "named", "guess"]


class Rival(NamedTuple):
    """Another guess that the data cannot part from the one that is taken."""

    text: str  # As it would stand in the config, such as ``unit: deg``.
    reason: str  # Why it is not ruled out.


@dataclass(frozen=True)
class Guess:
    """A signal of the log."""

    signal: SignalName
    columns: SignalMap
    reason: str
    sure: Sure
    rivals: tuple[Rival, ...] = ()
    rate_hz: float = 0.0  # Of rotors, samples in a second, pauses left out.
    kind: str = ""  # Kind of log that is known for such columns of rotors; empty where none is.

    @property
    def other_columns(self) -> Rival | None:
        """Columns that may be its own too, so that their number is a guess."""
        return next((rival for rival in self.rivals if rival.text.startswith("columns: [")), None)


class KeyChoice(NamedTuple):
    """A key of the section `import` that holds for the whole log."""

    key: str
    value: str
    reason: str
    sure: Sure
    rivals: tuple[Rival, ...] = ()


class Load(NamedTuple):
    """What the rotors carry in flight."""

    # Mean square of their speeds, or of commands taken for them, over the specific force that they hold: at equal
    # propellers it is as the mass.
    size: float
    # Whether an accelerometer senses that force; else it is gravity, and a flight that leans far looks heavier.
    sensed: bool
    steady: bool  # Whether it hovers, by what its rotors give from second to second: punches and dives are no load.
    voltage: float = float("nan")  # Of the battery in flight, V; NaN where the log does not hold it.


@dataclass(frozen=True, kw_only=True)
class Recognition:
    """What a log is taken for."""

    time_column: str  # As the section `import` takes them.
    time_unit: str
    signals: tuple[Guess, ...]
    choices: tuple[KeyChoice, ...]  # Frames, the order of a quaternion, what a command is.
    left_out: tuple[str, ...]  # Sentences on columns that look like a signal and are not mapped.
    unfollowed: tuple[SignalName, ...]  # Setpoints that are logged by name, and that the motion does not follow.
    flown: FlownPart
    rate_hz: float  # Of the clock.
    slowest_s: float  # Longest median step of a topic that is mapped, s; and without that of the voltage.
    slowest_but_voltage_s: float
    moved: MovedBy | None  # The rotors as the motion shows them.
    # Shape (time, rotor), or None; rotor speeds in flight in rad/s, or commands as shares of the largest speed.
    speeds: Array | None = field(repr=False)
    kind: str = ""  # Kind of log that is known for such columns of rotors; empty where none is.
    load: Load | None = None  # None where no columns are those of rotors.
    warnings: tuple[str, ...] = ()
    unused: tuple[str, ...] = ()  # All columns that are mapped to nothing, stamps left out.
    winged: bool = False  # Whether it is of a VTOL and flies on the wing for a part, which is cut.
    # Where the stretches of `flown` are counted from, s from the first stamp of a flat log, or of all topics.
    counted_from_s: float = 0.0
    # Commands of the rotors that take the place of logged ones.
    rebuilt: "Rebuilt | None" = field(default=None, repr=False)

    def signal(self, name: SignalName) -> Guess | None:
        """Give the guess for a signal; None where it is not recognised."""
        return next((guess for guess in self.signals if guess.signal == name), None)

    def choice(self, key: str) -> str | None:
        """Give the value of a choice; None where there was none to make."""
        return next((choice.value for choice in self.choices if choice.key == key), None)

    @property
    def rotors(self) -> int:
        """Number of rotors that the columns name; 0 where none do."""
        return max((len(guess.columns.names) for guess in self.signals if guess.signal in ROTORS), default=0)


@dataclass
class Seen:
    """A log, the part of it that is flown, and what has been found of it so far."""

    log: LogTable
    candidates: Mapping[SignalName, Sequence[Named]]
    part: slice
    level: Array | None
    guesses: dict[SignalName, Guess] = field(default_factory=dict)
    choices: dict[str, KeyChoice] = field(default_factory=dict)
    left_out: list[str] = field(default_factory=list)
    unfollowed: list[SignalName] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)

    @property
    def rate_hz(self) -> float:
        """Of the one clock."""
        return 1 / float(self.log.grid[1] - self.log.grid[0])

    @property
    def quaternion_order(self) -> Literal["wxyz", "xyzw"]:
        """Order of the columns of quaternions."""
        choice = self.choices.get("quaternion_order")
        return "xyzw" if choice is not None and choice.value == "xyzw" else "wxyz"

    @property
    def open_rotors(self) -> bool:
        """Whether other columns may be those of rotors too."""
        return any(self.guesses[name].other_columns is not None for name in ROTORS if name in self.guesses)

    def first(self, name: SignalName) -> Named | None:
        """Give the best candidate for a signal."""
        return next(iter(self.candidates.get(name, ())), None)

    def grid(self, named: Named) -> Array:
        """Give a candidate's columns in the part that is flown, in the unit that is stated."""
        return named.scale * self.log.on_grid(named.group.columns)[self.part]

    def mapped(self, guess: Guess) -> Array:
        """Give the columns of a guess in the part that is flown, as they are mapped, in SI."""
        columns = guess.columns
        values = self.log.on_grid(columns.columns, spikes=guess.signal not in ROTORS)[self.part]
        return known_unit(columns.unit).factor * as_mapped(values, columns)

    def take(
        self,
        named: Named,
        unit: UnitName,
        reason: str,
        sure: Sure,
        scale: float = 1.0,
        order: Sequence[int] | None = None,
        sign: Sequence[float] | None = None,
        rivals: tuple[Rival, ...] = (),
    ) -> None:
        """Take columns for a signal, in an order and with signs."""
        columns = named.group.columns
        mapped = SignalMap(
            columns=columns if order is None else tuple(columns[index] for index in order),
            unit=unit,
            scale=named.scale * scale,
            sign=None if sign is None or min(sign) > 0 else tuple(sign),
            required=named.signal != "voltage",
        )
        self.guesses[named.signal] = Guess(named.signal, mapped, reason, sure, rivals)

    def choose(self, key: str, value: str, reason: str, sure: Sure, *rivals: Rival) -> None:
        """Take a value of a key that holds for the whole log."""
        self.choices[key] = KeyChoice(key, value, reason, sure, rivals)

    def doubt(self, name: SignalName, *rivals: Rival) -> None:
        """Make a guess of what was known."""
        guess = self.guesses[name]
        self.guesses[name] = replace(guess, sure="guess", rivals=(*guess.rivals, *rivals))

    def disagree(self, named: Named, unit: str, by: str = "its size says") -> None:
        """Warn of columns that are in another unit than is said."""
        self.warnings.append(f"{named.group.pattern} is said to be in {named.unit}; {by} {unit}")

    def warn_of_mirrored(self, named: Named, order: Sequence[int], sign: Sequence[float], whose: str) -> None:
        """Warn of axes that are left-handed, unlike those of all others."""
        if handed(order, sign) > 0:
            return
        columns = [named.group.columns[index] for index, own in zip(order, sign, strict=True) if own < 0]
        what = f"{columns[0]} is opposite to all others" if len(columns) == 1 else "its axes are left-handed"
        self.warnings.append(f"{named.group.pattern}: {what}; taken as in {whose}")


def called(named: Named) -> str:
    """Say what a log calls columns."""
    pattern = named.group.pattern
    if named.known == OF_A_MATRIX:
        return f"{pattern} of {OF_A_MATRIX}"
    if any(letter.isalnum() for letter in pattern):
        return f"a log of {named.known} calls it {pattern}" if named.known else f"called {pattern}"
    return f"called {', '.join(named.group.columns)}"
