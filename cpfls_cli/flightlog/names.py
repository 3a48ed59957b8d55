"""What names of columns say by the tables of `vocabulary`, and which columns of a matrix without names move alike."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache, cached_property
from itertools import product
from typing import TYPE_CHECKING, Final, Literal, cast

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.flightlog import agreement, vocabulary
from cpfls_cli.flightlog.settings import ROTORS, SETPOINTS, UNITS_OF_SIGNAL, SignalName
from cpfls_cli.flightlog.vocabulary import (
    AIMED,
    ASKED,
    CRAZYFLIE,
    KIN,
    MEANINGS,
    NOT_MEASURED,
    PX4,
    RATE_WORDS,
    WISHED,
    WRITTEN,
    Meaning,
)
from cpfls_cli.rounding import largest
from cpfls_cli.units import KNOWN_UNITS, STANDARD_GRAVITY, UnitName, known_unit

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

_MEASURED: Final = tuple(own for own in vocabulary.KNOWN if own.signal in UNITS_OF_SIGNAL.keys() - SETPOINTS.keys())
Kind = Literal["xyz", "wxyz", "angles", "numbers", "one"]


# What MATLAB, Simulink and ROS call the numbers of whatever they log.
_HOLDERS = frozenset({"data", "signals", "value", "values"})


@dataclass(frozen=True)
class ColumnGroup:
    """Columns whose names differ in an axis or a number alone."""

    pattern: str  # The name with ``*`` in place of the axis or the number.
    kind: Kind  # In what the columns differ.
    columns: tuple[str, ...]  # In the order of axes or numbers, of a quaternion w, x, y, z.

    @property
    def axis(self) -> str:
        """What the name of the first column has in place of the star, in lower case."""
        before, _, after = self.pattern.partition("*")
        return self.columns[0].removeprefix(before).removesuffix(after).lower()

    @property
    def pqr(self) -> bool:
        """Whether the columns differ in p, q and r."""
        return self.kind == "angles" and self.axis == "p"

    @cached_property
    def ending(self) -> str:
        """The unit at the end of the name or in brackets, as it is written; empty where there is none."""
        before, star, after = self.pattern.partition("*")
        bracket = re.search(r"[\[(]([^\[\]()*]*[A-Za-z%][^\[\]()*]*)[\])]$", after if star else before)
        if bracket:
            return bracket[0] if _symbols(bracket[1]) in WRITTEN else ""
        name = after if any(letter.isalnum() for letter in after) else before.rstrip("[(")
        # The axis stands before what follows the star, and a letter that stands before the star may be a name.
        starts = [found.start() for found in re.finditer(r"[_ ]|(?<=[a-z])(?=[A-Z])|^", name)]
        for start in starts if name is after else starts[1:]:
            text = name[start:].strip("_ ")
            if _symbols(text) in WRITTEN and (name is after or len(text) > 1):
                return name[start:]
        return ""

    @cached_property
    def words(self) -> tuple[str, ...]:
        """Words of the pattern in lower case, without numbers and without the unit at its end."""
        before, _, after = self.pattern.rpartition(self.ending) if self.ending else (self.pattern, "", "")
        return words_of(f"{before} {after}")

    @property
    def derivative(self) -> bool:
        """Whether the name is that of a derivative."""
        return _first_hand(self.words)[-1:] == ("dot",)

    @cached_property
    def last_words(self) -> tuple[str, ...]:
        """Words of the last part of a path that has any: a structure ``output`` may hold whatever was measured."""
        parts = map(words_of, reversed(self.pattern.removesuffix(self.ending).split("/")))
        return next((words for words in parts if {*words} - _HOLDERS), ())


def words_of(text: str) -> tuple[str, ...]:
    """List the words of a name in lower case, without numbers, of which some are written in many ways."""
    parts = re.findall(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+|\d+", text.replace("*", " "))
    words = " ".join(part.lower() for part in parts if not part.isdecimal())
    for pattern, one in vocabulary.ONE_WORD.items():
        words = re.sub(pattern, one, words)
    return tuple(words.split())


def _first_hand(words: tuple[str, ...]) -> tuple[str, ...]:
    """Leave out what was done to a signal where it ends a name, which does not say what the signal is."""
    while len(words) > 1 and words[-1] in vocabulary.SECOND_HAND:
        words = words[:-1]
    return words


@cache
def _symbols(text: str) -> str:
    """Write a unit as `SPELLINGS` do, such as rad/s for rad_per_sec."""
    text = re.sub(r"([a-z]{2})([A-Z])", r"\1_\2", text.strip("[]()_ ")).lower().replace("²", "2")
    parts = re.split(r"[/_ .·^]+|(?<=[a-z])per(?=[a-z])", text)
    for full, symbol in vocabulary.IN_FULL.items():
        parts = [symbol if re.fullmatch(full, part) else part for part in parts]
    joined = "/".join(part for part in parts if part not in ("", "per"))
    return joined.replace("s/2", "s2").replace("s/-", "s-")


@dataclass(frozen=True)
class Named:
    """Columns that may be a signal, by their name."""

    signal: SignalName
    group: ColumnGroup
    rank: float  # Smaller ones come first.
    unit: UnitName | None = None  # That the name or the kind of log states.
    scale: float = 1.0  # Factor on the logged numbers, which makes them this unit.
    frame: str | None = None  # Axes that the kind of log is known for.
    known: str = ""  # The kind of log whose documentation says so; empty where only words of the name do.
    sign: tuple[float, ...] | None = None  # Of each column in that frame; None for +1 everywhere.

    @property
    def by_axes(self) -> bool:
        """Whether nothing but axes in their names makes the columns a place."""
        return self.rank >= _BY_AXES

    @property
    def is_of_unknown_place(self) -> bool:
        """Whether no word says that the columns are a place, and some may say what else."""
        return bool(self.signal == "position" and not self.known and self.group.words) and not any(
            words & {*self.group.words} for words in _PLACE_WORDS
        )


_ON_A_WING = 0.4  # Rad.
# What to do where names do not tell what columns hold.
BY_HAND: Final = "use common names (gyro_x, roll, rpm_1), or write import.signals of a config by hand"
# In small letters, in capitals, and each part with a capital, as in frontLeft and FrontLeft.
_CASES: Final[tuple[Callable[[str], str], ...]] = (
    str,
    str.upper,
    str.title,
    lambda axis: axis.title().replace("_", ""),
    lambda axis: axis[0] + axis.title().replace("_", "")[1:],
)
_FAMILIES: Final = tuple(
    dict.fromkeys((cast("Kind", kind), tuple(map(case, axes))) for kind, axes in vocabulary.FAMILIES for case in _CASES)
)
_SHORTEST_NUMBERED, _LONGEST_NUMBERED = 3, 16


def column_groups(names: Mapping[str, object] | tuple[str, ...]) -> tuple[ColumnGroup, ...]:
    """Find columns whose names differ in an axis or a number alone, and leave every other one as its own group."""
    known = dict.fromkeys(names)
    # roll, pitch, yaw and p, q, r have one pattern, a star alone, and are two groups.
    found = dict.fromkeys((*_of_axes(known), *_numbered(known)))
    return (*found, *(ColumnGroup(name, "one", (name,)) for name in known))


_BEHIND_AXES = ("dot", "ddot", "rate", "vel", "acc", "gyro")


def _of_axes(names: Mapping[str, None]) -> Iterator[ColumnGroup]:
    """Look for the columns of the other axes wherever the first one is in a name, whatever the case of a letter."""
    cases = Counter(map(str.lower, names))
    # What is there in small letters and in capitals is two things.
    folded = {name.lower(): name for name in names if cases[name.lower()] == 1}
    for name, (kind, axes) in product(names, _FAMILIES):
        for found in re.finditer(re.escape(axes[0]), name):
            before, after = name[: found.start()], name[found.end() :]
            # An axis ends a word, but in xdot and its kind; a letter of angles, and a place, is a word of its own.
            ends = not after or not after[0].islower() or (kind == "xyz" and after.startswith(_BEHIND_AXES))
            begins = (
                not before
                or not before[-1].isalpha()
                or (kind == "numbers" and before[-1].islower() != axes[0][0].islower())
            )
            if (kind == "angles" and len(axes[0]) > 1) or (ends and (begins or kind in ("xyz", "wxyz"))):
                columns = tuple(f"{before}{axis}{after}" for axis in axes)
                # A letter alone is of another thing in capitals, as a rotation R is.
                apart = any(map(str.isalpha, before + after)) or len(axes[0]) > 1
                mixed = folded if apart and name.lower() in folded else {}
                columns = tuple(own if own in names else mixed.get(own.lower(), "") for own in columns)
                # Among P, Q, R and X, Y, Z there are R, P, Y too.
                others = axes[0] in "rR" and {f"{before}{own}{after}" for own in "qQxX"} & names.keys()
                if all(columns) and not others:
                    yield ColumnGroup(f"{before}*{after}", kind, columns)


def _numbered(names: Mapping[str, None]) -> Iterator[ColumnGroup]:
    groups: dict[str, dict[int, str]] = {}
    for name in names:
        topic, dot, rest = name.partition(".")
        if dot and f"{topic}[1].{rest}" in names:
            # The first instance of a topic bears no number.
            groups.setdefault(f"{topic}[*].{rest}", {})[0] = name
        for found in re.finditer(r"(?<!\d)\d{1,9}(?!\d)", name):
            groups.setdefault(f"{name[: found.start()]}*{name[found.end() :]}", {})[int(found.group())] = name
    for pattern, columns in groups.items():
        numbers = sorted(columns)
        unbroken = numbers == list(range(numbers[0], numbers[0] + len(numbers)))
        if unbroken and numbers[0] in (0, 1) and _SHORTEST_NUMBERED <= len(numbers) <= _LONGEST_NUMBERED:
            yield ColumnGroup(pattern, "numbers", tuple(columns[number] for number in numbers))


_BY_WORDS, _SECOND, _OF_OTHER_INSTANCE, _BY_AXES = 100.0, 10.0, 50.0, 1000.0
_AXES_OF_A_BODY = 3
_OF_A_POSE = ("attitude", "quaternion", "velocity")
_PLACE_WORDS = tuple(own.words for own in MEANINGS if own.signal == "position")


def named_signals(groups: tuple[ColumnGroup, ...], system: str = "") -> tuple[Named, ...]:
    """List what groups of columns may be by name, what a kind of log is known for first; without a system any."""
    known = [named for group in groups for named in _known_to_systems(group, system)]
    names = {column for group in groups for column in group.columns}
    held = {(named.known, named.group.columns) for named in known}
    # What is asked for counts too where its name has more than a topic and an axis, as nobody else names it.
    held |= {
        (own.system, own.columns)
        for own in vocabulary.KNOWN
        if re.search(r"\.[a-z]*[A-Z_]", own.columns[0]) and names >= {*own.columns}
    }
    of_kind = Counter(kind for kind, _ in held)
    # A log that does not say what wrote it is of a kind by two names at least: motor[0] alone has many authors.
    found = [named for named in known if system or of_kind[named.known] > 1]
    by_words = [named for group in groups for named in _by_words(group)]
    # Motors next to what is asked of them are measured, and nobody says in what.
    asked = {frozenset(own.group.words) - ASKED - AIMED for own in by_words if {*own.group.words} & (ASKED | AIMED)}
    found += [own for own in by_words if own.signal != "rotor_command" or {*own.group.words} not in asked]
    # Of what has an attitude or a velocity the axes are a place.
    poses = {word for own in found if own.signal in _OF_A_POSE for word in own.group.words}.union(*_PLACE_WORDS)
    found = [
        replace(own, rank=own.rank - _BY_AXES + _SECOND) if own.by_axes and {*own.group.words} <= poses else own
        for own in found
    ]
    if lists_all(system):
        # Words would find parameters and allocations.
        found = [named for named in found if named.known or named.signal not in (*ROTORS, "voltage")]
    best: dict[tuple[SignalName, tuple[str, ...]], Named] = {}
    for named in sorted(found, key=lambda named: named.rank):
        best.setdefault((named.signal, named.group.columns), named)
    return tuple(best.values())


def lists_all(system: str) -> bool:
    """Tell whether all that drives rotors, and all that is asked for, is in `KNOWN` for logs of a system.

    A fork under a name of its own (``Betaflight, as NAME``) has columns of its own.
    """
    return ", as " not in system and any(is_of(system, known) for known in (PX4, *KIN))


def is_of(system: str, known: str) -> bool:
    """Tell whether a log was written by a program or its kin."""
    return system.startswith((known, *KIN.get(known, ())))


def _known_to_systems(group: ColumnGroup, system: str) -> Iterator[Named]:
    for rank, known in enumerate(_MEASURED):
        of_other = system and not is_of(system, known.system)
        angles = known.signal != "attitude" or (group.kind == "angles" and not group.pqr)
        # On its card a Crazyflie puts the name of an event before that of a variable.
        patterns = (group.pattern, group.pattern.partition(".")[2] if system.startswith(CRAZYFLIE) else "")
        suits = [own.signal for own in MEANINGS if own.signal == known.signal and _suits(own, group)]
        if not of_other and angles and known.columns[0] in patterns and suits:
            yield Named(suits[0], group, float(rank), known.unit, known.scale, known.frame, known.system, known.sign)


def _suits(meaning: Meaning, group: ColumnGroup) -> bool:
    count = len(group.columns)
    enough = count >= meaning.number if meaning.signal in ROTORS else count == meaning.number
    return enough and group.kind in meaning.kinds


def _by_words(group: ColumnGroup, *, wished: bool = False) -> Iterator[Named]:
    """List what the words of a name and a unit in it suggest: measurements, or what is wished where a word says so."""
    words = tuple(word for word in group.words if not (wished and word in WISHED))
    rank = _BY_WORDS + len(words)
    if not wished:
        rank += _SECOND * sum(word in vocabulary.SECOND_HAND for word in words)
        rank += _OF_OTHER_INSTANCE * bool(re.search(r"\[\d+\]\.", group.pattern))
    before, _, after = group.pattern.partition("*")
    squared = bool(re.search(r"[a-z]2($|_)", f"{before}{after}")) or bool({"squared", "sq"} & {*words})
    for meaning in () if wished and words == group.words else MEANINGS:
        signal, stated, ending = meaning.signal, _stated_unit(group, meaning.signal), group.ending
        # A name that ends in a unit, and in none of the signal, is of something else.
        other = bool(ending) and stated is None and (len(ending.strip("_ ")) > 1 or ending == "_m")
        # Per cent of a battery are its charge.
        other |= signal == "voltage" and stated is not None and stated[0] != "V"
        allowed = vocabulary.ALLOWED.get(signal, frozenset()) | (WISHED if wished else frozenset())
        allowed |= ASKED | AIMED if signal in ROTORS else frozenset()
        named = _SETPOINT_OF.get(signal) if wished else None if squared and signal in ROTORS else signal
        if named is None or other or not _suits(meaning, group) or (NOT_MEASURED - allowed) & {*words}:
            continue
        if signal == "body_rate" and not meaning.last if wished and group.pqr else _means(meaning, group, words):
            fast = not wished and any(signal in vocabulary.IN_RADIANS.get(word, ()) for word in words)
            usual: UnitName | None = "rad/s" if fast else "1" if signal == "quaternion" else None
            place = signal != "position" or group.kind == "numbers" or _is_called_place(meaning, group)
            yield Named(named, group, rank + (0.0 if place else _BY_AXES), *(stated or (usual, 1.0)))


def height_columns(names: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], float]]:
    """List single columns that words call a height, each with the factor that makes it m."""
    for name in names:
        group = ColumnGroup(name, "one", (name,))
        stated = _stated_unit(group, "position") if group.ending else ("m", 1.0)
        if (
            {*group.words} & {"alt", "altitude", "height"}
            and {*group.words} <= vocabulary.HEIGHT
            and stated is not None
        ):
            yield (name,), known_unit(stated[0]).factor * stated[1]


def only_of_airplanes(columns: Mapping[str, Array]) -> list[str]:
    """List an airspeed and an angle to it that stays small in flight, as on a wing; none where one is missing."""
    words = {name: {*ColumnGroup(name, "one", (name,)).words} - vocabulary.WITH_AIRPLANE for name in columns}
    alone = {name: own.pop() for name, own in words.items() if len(own) == 1}
    found = [next((name for name, own in alone.items() if own in known), "") for known in vocabulary.AIRPLANE_WORDS]
    if not all(found):
        return []
    speed, angle = np.abs(np.array([columns[name] for name in found], dtype=float))
    # A multirotor that measures the wind has it from any side.
    flies = angle[np.isfinite(angle) & (speed > 0.5 * np.max(speed, initial=0.0, where=np.isfinite(speed)))]
    most = _ON_A_WING if np.max(flies, initial=0.0) < 2 * np.pi else np.degrees(_ON_A_WING)
    return found if len(flies) and np.quantile(flies, 0.9) < most else []


_SETPOINT_OF: Final[Mapping[SignalName, SignalName]] = {
    **{measured: name for name, measured in SETPOINTS.items()},
    "quaternion": "setpoint_attitude",
}


def wished_signals(groups: tuple[ColumnGroup, ...]) -> list[Named]:
    """List what groups of columns may be a setpoint of: a word says that it is one, the others what of."""
    # Three components of a quaternion follow an attitude too, at half of its size.
    of_quaternions = {column for group in groups if group.kind == "wxyz" for column in group.columns}
    own = (group for group in groups if group.kind == "wxyz" or not of_quaternions & {*group.columns})
    return sorted((named for group in own for named in _by_words(group, wished=True)), key=lambda named: named.rank)


def _stated_unit(group: ColumnGroup, signal: SignalName) -> tuple[UnitName, float] | None:
    """Give the unit that a name states for a signal, at its end or as a word, and the factor that makes it."""
    words = (_symbols(word) for word in group.words if word in vocabulary.A_WORD)
    for text in (_symbols(group.ending), *words):
        for own in (WRITTEN.get(text), WRITTEN.get(f"{text}/s")):
            # Of a rate "deg" is deg/s.
            if own is not None and KNOWN_UNITS[own[0]].si in UNITS_OF_SIGNAL[signal]:
                return own
    return None


def _means(meaning: Meaning, group: ColumnGroup, words: tuple[str, ...]) -> bool:
    """Tell whether words mean a signal; positions, rotors and angles have ways of their own."""
    own, signal = {*words}, meaning.signal
    if meaning.last:
        words = _first_hand(words)
    # A name that ends in the unit of a rate or of a speed is one.
    ending = WRITTEN.get(_symbols(group.ending))
    ends_in_speed = ending is not None and KNOWN_UNITS[ending[0]].si == "rad/s"
    if own & meaning.never:
        return False
    if signal in ROTORS:
        return _means_rotors(signal, group, own, ends_in_speed)
    if signal == "position" and group.kind != "numbers":
        return _has_axes_of_places(group)
    if group.kind == "angles" and signal in ("attitude", "body_rate"):
        turns = ends_in_speed or bool(own & (RATE_WORDS | {"speed"}))
        if signal == "body_rate" and meaning.last:
            return not group.pqr and bool({*words[-meaning.last :]} & meaning.words)
        if signal == "body_rate":
            return turns or group.pqr
        # What is asked about an axis is no angle, but a structure of outputs may hold some; letters need a word.
        part = {*words_of(group.pattern.rpartition("/")[2])}
        asked = part & {*ASKED, "out"} or {*group.last_words} & ASKED - {"output"}
        letters = len(group.axis) == 1 and not own & meaning.words and group.columns != ("R", "P", "Y")
        return not (turns or group.pqr or letters or asked)
    if signal == "voltage" and "bat" in own:
        return ending is not None and ending[0] == "V"
    return bool({*words[-meaning.last :]} & meaning.words)


def _means_rotors(signal: SignalName, group: ColumnGroup, own: set[str], ends_in_speed: bool) -> bool:
    """Tell whether words mean what drives rotors, or how fast they turn."""
    last, many = {*group.last_words}, len(group.columns) > _AXES_OF_A_BODY
    # A part of a path that is called output may hold whatever was measured.
    asked = bool(last & ASKED or own & (AIMED | {"pwm"}))
    if asked and not many and own & RATE_WORDS:
        return False
    # Three columns of the letter w, or in the unit of a rate, are the axes of a gyroscope.
    turning = last - AIMED - ASKED == {"w"} and (asked or len(own) == 1)
    counted = last - AIMED - ASKED == {"n"} and asked
    fast = bool(own & vocabulary.FAST) or (many and (turning or counted or ends_in_speed))
    field = {*words_of(group.pattern.rpartition(".")[2])}
    motors = {"m"} in (last - AIMED, field - AIMED) or bool(vocabulary.MOTORS & own and not vocabulary.TELEMETRY & own)
    if signal == "rotor_speed":
        return fast and not asked
    return bool(last & ASKED) or "pwm" in own or (asked if fast else motors)


def _has_axes_of_places(group: ColumnGroup) -> bool:
    before, _, after = group.pattern.partition("*")
    begins = re.search(r"(^|[^A-Za-z])([Pp]|[Pp]os)?$", before) or (
        before[-1].islower() and group.columns[0][len(before)].isupper()
    )
    return bool(begins) and not after[:1].isalpha()


def _is_called_place(meaning: Meaning, group: ColumnGroup) -> bool:
    """Tell axes that are alone behind a path, or stand with words of places only."""
    part = re.split(r"[/.]", group.pattern)[-1]
    return {*words_of(part.removesuffix(group.ending))} - WISHED <= meaning.words


# Attitude, rates, accelerometer and rotors are as many and more; what is narrower is another matrix.
_FEWEST_COLUMNS = 12
_STEPS_S, _EVEN = (2e-4, 0.2), 0.05  # Steps of a clock in s, and the share of them by which they differ on the mean.
_UNIT_LENGTH = 0.02  # By which the length of a quaternion is off 1, in single precision or filtered.
# Share that a derivative has to explain, and the ratio of sizes, where no name speaks for it.
_FOLLOWS, _NEAR = 0.8, 1.3
# Level in rad/s, or more in another unit, of every rotor in flight, and the ratio of their levels.
_SLOWEST_ROTOR, _ROTORS_ALIKE = 50.0, 1.3
_SIZE = 0.1  # Share by which an accelerometer may be off what carries the vehicle.
_RATE_HZ = 100.0  # Rate to which a fast matrix is thinned: every pair of runs is compared.
OF_A_MATRIX: Final = "a matrix without names"


def even_step(values: Array) -> float:
    """Give the step by which numbers rise evenly from row to row; 0 where they do not."""
    steps = np.diff(np.asarray(values, dtype=float)[np.isfinite(values)])
    if len(steps) < 2 or steps.min() <= 0:
        return 0.0
    step = float(np.median(steps))
    # A pause of the recording counts as one step.
    return step if float(np.minimum(np.abs(steps - step), step).mean()) < _EVEN * step else 0.0


def evenly_rising(columns: Mapping[str, Array]) -> dict[str, float]:
    """Give the steps of columns that may be a clock: alone by its name, and no count of rows or of anything else."""
    groups = column_groups(columns)
    others = {name for group in groups if group.kind in ("xyz", "angles") for name in group.columns}
    for group in groups:
        unit = WRITTEN.get(_symbols(group.ending))
        others |= {*group.columns} if {*group.words} & vocabulary.NO_CLOCK or (unit and unit[0] != "us") else set()
    steps = {name: even_step(values) for name, values in columns.items() if name not in others}
    return {name: step for name, step in steps.items() if step not in (0.0, 1.0)}


def nameless_clock(columns: Mapping[str, Array]) -> str | None:
    """Find the column of a matrix without names that counts seconds in even steps."""
    return next((name for name in _of_matrix(columns) if _STEPS_S[0] <= even_step(columns[name]) <= _STEPS_S[1]), None)


def _of_matrix(columns: Mapping[str, Array]) -> list[str]:
    """List the columns of the widest matrix, ``name[0]`` and on, in their order; none where it is narrow."""
    wide: dict[str, list[str]] = {}
    for name in columns:
        if name.endswith("]"):
            wide.setdefault(name.rpartition("[")[0], []).append(name)
    longest = max(wide.values(), key=len, default=[])
    return longest if len(longest) >= _FEWEST_COLUMNS else []


def without_names(columns: Mapping[str, object] | tuple[str, ...]) -> str:
    """Say what to do with columns that numbers in brackets alone tell apart; empty where names say more."""
    names = tuple(columns)
    if (
        len(names) <= _AXES_OF_A_BODY + 1
        or len({name.rpartition("[")[0] for name in names}) > 1
        or names[0][-1:] != "]"
    ):
        return ""
    what = f"{OF_A_MATRIX} ({names[0]} to {names[-1]})"
    return f"{what}: save each of its columns under a name, such as time, roll, pitch, yaw, p, q, r, m1, m2, m3, m4"


def nameless_signals(columns: Mapping[str, Array], time: Array) -> tuple[Named, ...]:
    """Find attitude, rates, accelerometer, position, velocity and rotors among columns without names, on a clock, s.

    An attitude is four neighbours of length 1, and what its derivative explains are the rates; gravity shows the
    accelerometer, a derivative the velocity, in the axes of the world or of the body, and four large and like numbers
    are rotors. Without an attitude nothing is found.
    """
    names, step = _of_matrix(columns), float(np.median(np.diff(time))) if len(time) > 2 else 1.0
    if not step > 0:
        # Stamps of parameters, all written at once, are no clock.
        return ()
    every = max(1, round(1 / (_RATE_HZ * step)))
    table = np.column_stack([np.asarray(columns[name], dtype=float)[::every] for name in names]) if names else None
    if table is None or not np.isfinite(table).all():
        return ()
    grid = np.arange(time[0], time[-1], every * step)[: len(table)]
    table, rate_hz = table[: len(grid)], 1 / float(grid[1] - grid[0])
    taken: dict[int, Named] = {}

    def runs(length: int) -> _Runs:
        """List the runs of neighbours of which none is taken and each changes."""
        firsts = range(table.shape[1] - length + 1)
        free = [first for first in firsts if not taken.keys() & {*range(first, first + length)}]
        every_run = ((first, table[:, first : first + length]) for first in free)
        return [(first, values) for first, values in every_run if float(np.ptp(values, axis=0).min()) > 0]

    def take(signal: SignalName, first: int, length: int) -> None:
        own = tuple(names[first : first + length])
        group = ColumnGroup(f"columns {own[0]} to {own[-1]}", "numbers", own)
        taken.update(dict.fromkeys(range(first, first + length), Named(signal, group, 0.0, known=OF_A_MATRIX)))

    attitude = _matrix_attitude(runs, time[::every][: len(grid)], grid, rate_hz)
    if attitude is None:
        return ()
    first, rotation, rates = attitude
    take("quaternion", first, 4)
    take("body_rate", rates, 3)
    carried: tuple[float, ...] = (STANDARD_GRAVITY,)
    if (places := _matrix_places(runs(3), rotation, rate_hz)) is not None:
        # The usual size of what carries the vehicle, z of the position upward and downward.
        moving = agreement.second_derivative(table[:, places[0] : places[0] + 3], rate_hz)
        forces = (moving + np.array([0.0, 0.0, up * STANDARD_GRAVITY]) for up in (1.0, -1.0))
        carried = tuple(float(np.median(np.linalg.norm(force, axis=1))) for force in forces)
        take("position", places[0], 3)
        take("velocity", places[1], 3)
    sensed = []
    for first, values in runs(3):
        # Of the size of what carries the vehicle, nearly all of it in the third.
        middle, size = np.median(np.abs(values), axis=0), float(np.median(np.linalg.norm(values, axis=1)))
        sensed += [(min(abs(size / own - 1) for own in carried), first)] if middle[:2].max() < 0.3 * middle[2] else []
    if sensed and min(sensed)[0] < _SIZE:
        take("acceleration", min(sensed)[1], 3)
    for first, values in runs(4):
        middle = np.median(values, axis=0)
        if values.min() >= 0 and middle.min() > _SLOWEST_ROTOR and middle.max() < _ROTORS_ALIKE * middle.min():
            take("rotor_speed", first, 4)
            break
    return tuple(dict.fromkeys(taken.values()))


_Runs = list[tuple[int, Array]]


def _matrix_attitude(
    runs: Callable[[int], _Runs], time: Array, grid: Array, rate_hz: float
) -> tuple[int, Rotation, int] | None:
    """Find the quaternion whose derivative explains three other columns best."""
    found = []
    rates = [(first, agreement.slow(values, rate_hz)) for first, values in runs(3)]
    for (first, values), order, inverse in product(runs(4), ("xyzw", "wxyz"), (False, True)):
        if float(np.quantile(np.abs(np.linalg.norm(values, axis=1) - 1), 0.95)) > _UNIT_LENGTH:
            continue
        rotation = agreement.on_clock(agreement.rotations_of(values, order, inverse), time, grid)
        turning = agreement.turning_of(rotation, rate_hz)
        for other, measured in rates:
            if turning is not None and (other + 3 <= first or other >= first + 4):
                share = agreement.fit_axes(turning, measured).as_named
                found += [(share, first, rotation, other)] if share > _FOLLOWS else []
    return largest(found, lambda own: own[0])[1:] if found else None


def _matrix_places(runs: _Runs, rotation: Rotation, rate_hz: float) -> tuple[int, int] | None:
    """Find three columns whose derivative, as it is or turned into the body, three others are."""
    found = []
    measured = [(first, agreement.slow(values, rate_hz)) for first, values in runs]
    for place, values in runs:
        derived = agreement.first_derivative(values, rate_hz)
        references = [agreement.slow(own, rate_hz) for own in (derived, rotation.inv().apply(derived))]
        for (speed, own), reference in product(measured, references):
            fit = agreement.fit_axes(reference, own) if abs(speed - place) >= 3 else None
            if fit is not None and 1 / _NEAR < fit.gain < _NEAR and fit.as_named > _FOLLOWS:
                found.append((fit.as_named, place, speed))
    return largest(found, lambda own: own[0])[1:] if found else None
