"""One proposal for several logs of one vehicle: the same signals for all, what differs, and the vehicle itself."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from math import ceil, floor, log10, sqrt
from typing import Final, Literal

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.errors import InputError, about
from cpfls_cli.flightlog.airframe import Airframe, named_airframe, stated_airframe, usual_airframe
from cpfls_cli.flightlog.recognised import Guess, KeyChoice, Load, Recognition, Rival
from cpfls_cli.flightlog.recognition import recognise
from cpfls_cli.flightlog.repair import common_rate, same_rate
from cpfls_cli.flightlog.settings import ROTORS, SETPOINTS, ColumnMap, SignalMap, SignalName
from cpfls_cli.flightlog.stated_vehicle import Parameters, plain, stated_vehicle, vehicles_apart
from cpfls_cli.flightlog.topics import ROWS, Topics, column_names
from cpfls_cli.units import UnitName, known_unit
from cpfls_cli.vehicle_limits import IN_ROOM, room, thrust_number
from cpfls_cli.words import joined

_SURENESS: Final = ("data", "named", "guess")
_STEPS_BRIDGED = 2.5  # Steps of the slowest topic that a gap may have: one sample of it may be lost.
_WAY: Final = {1: "counter-clockwise", -1: "clockwise", 0: "?"}
# Gap that is bridged in any log, and the step of a voltage from which on it is left out, not all gaps made long.
_LEAST_GAP_S, _SLOWEST_VOLTAGE_S = 0.1, 0.5
# Share of the range of commands by which its ends may differ: a stick is calibrated anew to a few us.
_SAME_RANGE: Final = 0.01
_ROOM = 1.2  # By which a limit of the rotor speeds lies above the fastest one that is logged.
# Share by which an arm that is given may differ from the places that a log states: both are rounded.
_SAME_ARM: Final = 0.05
_SAME_ROWS: Final = 1.1  # Ratio of the rates of rows in two logs of one logger.
DECIDES_ROTORS: Final = "a log with more motion, or a look at the vehicle, decides"
# Ratio of loads up to which two flights may be of one mass: by rotor speeds and an accelerometer; otherwise, since
# batteries empty, and who leans looks heavier. By commands three flights of one Crazyflie differ by 1.06.
_ALIKE: Final = {True: 1.06, False: 1.12}
_NOTED: Final = ("SYS_AUTOSTART", "MPC_THR_HOVER", "THR_MDL_FAC", "MOT_THST_HOVER", "MOT_THST_EXPO", "MOT_SPIN_MIN")


@dataclass(frozen=True)
class KnownLog:
    """A log and what it is taken for."""

    name: str  # For messages.
    recognition: Recognition
    parameters: Parameters  # That it states.
    system: str  # What wrote it; empty where that is not known.
    columns: frozenset[str]  # Names of all of its columns.
    of_file: tuple[str, ...] = ()  # Faults of the file, and what its reader left out.


def known_log(name: str, topics: Topics, units: Mapping[str, str], parameters: Parameters, system: str) -> KnownLog:
    """Recognise a log, as its reader gives it."""
    recognition = recognise(topics, units, parameters, system)
    derived = () if recognition.rebuilt is None else recognition.rebuilt.columns
    return KnownLog(name, recognition, parameters, system, frozenset((*column_names(topics), *derived)))


@dataclass(frozen=True, kw_only=True)
class Proposal:
    """What a config is to say of logs and their vehicle."""

    logs: tuple[KnownLog, ...]  # The first one leads.
    time_column: str | None  # The clock of all of them; None for that of each log's fastest topic.
    time_unit: str
    signals: tuple[Guess, ...]  # That hold for all of them.
    choices: tuple[KeyChoice, ...]
    # Of one log; of several each takes what flies in it. None where none is to be cut.
    crop_s: tuple[float, float] | Literal["flown"] | None
    crops: Mapping[str, tuple[float, float] | None]  # Of each log.
    rate_hz: float | None  # One rate for all logs, Hz; None where they have one.
    gap_s: float  # Longest step that has to be bridged, s.
    airframe: Airframe | None  # None where neither parameters nor motion show the rotors.
    rotors: int  # Number of rotors; 0 where no columns are theirs.
    speed_max: float  # Round number above the largest rotor speed, rad/s.
    facts: tuple[str, ...]  # What else the logs state.
    equal: tuple[str, ...]  # Names of the logs whose rotors carry what those of the first one do.
    warnings: tuple[str, ...]

    @property
    def first(self) -> Recognition:
        """What the first log is taken for."""
        return self.logs[0].recognition

    @property
    def has_rotors(self) -> bool:
        """Whether columns say what the rotors do, and not parameters alone where they are."""
        return any(guess.signal in ROTORS for guess in self.signals)

    @property
    def states_torque(self) -> bool:
        """Whether a torque of the log takes the place of rotors."""
        return any(guess.signal == "body_torque" for guess in self.signals)

    @property
    def share_of_speed(self) -> bool:
        """Whether nothing but commands that are shares says what the rotors do."""
        units = {guess.signal: guess.columns.unit for guess in self.signals}
        return "rotor_speed" not in units and units.get("rotor_command") == "1"


def propose(
    logs: Sequence[KnownLog],
    mass_kg: float | None,
    arm_m: float | None,
    *,
    thrust_factor: float | None = None,
    scale_to_arm: bool = False,
) -> Proposal:
    """Make one proposal of what each of several logs is taken for; logs of two vehicles are refused.

    The arm is from the middle to a rotor, m; places that a log states are scaled to it where that is asked for. With a
    mass and a thrust factor, N s^2, commands show the largest speed of the rotors.
    """
    winged = next((one for one in logs if one.recognition.winged), None)
    if winged is not None and len(logs) > 1:
        # One crop suits no two logs, and what flies in a log is known by its rotors alone.
        raise InputError(
            f"{winged.name}: flies on the wing for a part, which is cut in seconds: run cpfls init for it alone"
        )
    for other in logs[1:]:
        _require_same_vehicle(logs[0], other)
    signals = _merged_signals(logs)
    slowest = max(one.recognition.slowest_s for one in logs)
    others = max(one.recognition.slowest_but_voltage_s for one in logs)
    if slowest > max(_SLOWEST_VOLTAGE_S, others):
        # A voltage that would make gaps of all signals long is left out.
        signals, slowest = tuple(guess for guess in signals if guess.signal != "voltage"), others
    if mass_kg is not None and arm_m is not None:
        signals = tuple(_by_weight(guess, logs[0].recognition.speeds, mass_kg, arm_m) for guess in signals)
    airframe, doubts = airframe_of(logs)
    if airframe is not None and arm_m is not None:
        if airframe.in_metres and not scale_to_arm:
            # Who asks knows which of the two is right.
            if abs(arm_m - airframe.arm_m) > _SAME_ARM * airframe.arm_m:
                raise InputError(
                    f"{logs[0].name}: --arm is {arm_m:g} m, but {airframe.reason} put the rotors {airframe.arm_m:.3g} m"
                    " from the middle: leave --arm out to take these, or add --scale-to-arm to scale them to yours"
                )
        else:
            airframe = airframe.with_arm(arm_m)
    stated = logs[0].parameters
    noted = (f"{key} = {plain(stated[key])}" for key in _NOTED if key in stated)
    rates = [one.recognition.rate_hz for one in logs]
    apart = _of_other_load(logs)
    crops = {one.name: one.recognition.flown.span_s for one in logs}
    warnings = [f"{one.name}: {warning}" for one in logs for warning in (*one.of_file, *one.recognition.warnings)]
    doubts = [*doubts, *_two_masses(logs, mass_kg)]
    return Proposal(
        logs=tuple(logs),
        time_column=_time_column(logs),
        time_unit=logs[0].recognition.time_unit,
        signals=signals,
        choices=_merged_choices(logs),
        crop_s=crops[logs[0].name] if len(logs) == 1 else "flown" if any(crops.values()) else None,
        crops=crops,
        rate_hz=None if same_rate(rates) else common_rate(rates),
        gap_s=max(_LEAST_GAP_S, _rounded_up(_STEPS_BRIDGED * slowest)),
        airframe=airframe,
        rotors=len(airframe.rotors) if airframe else max(one.recognition.rotors for one in logs),
        speed_max=_speed_max(logs, signals, mass_kg, thrust_factor),
        facts=(*([f"written by {logs[0].system}"] if logs[0].system else []), *noted),
        equal=tuple(one.name for one in logs if all(one is not other for other in apart)),
        warnings=tuple(dict.fromkeys((*warnings, *doubts))),
    )


def _require_same_vehicle(first: KnownLog, other: KnownLog) -> None:
    """Refuse two logs whose parameters, systems or rotors say that they are of two vehicles."""
    differing = vehicles_apart(*(stated_vehicle(one.system, one.parameters) for one in (first, other)))
    counts = first.recognition.rotors, other.recognition.rotors
    if counts[0] != counts[1] and 0 not in counts:
        differing.append(f"{counts[0]} and {counts[1]} rotors")
    moved = [one.recognition.moved for one in (first, other)]
    if all(found is not None and found.clear for found in moved):
        orders = [[(r.name, r.spin) for r in found.airframe.rotors] for found in moved if found is not None]
        if orders[0] != orders[1]:
            differing.append("judged by the motion, the rotors are numbered or turn differently")
    if differing:
        shown = "; ".join(differing[:3])
        raise InputError(
            f"{first.name} and {other.name} are of different vehicles ({shown}): run cpfls init for each of them"
        )


def _time_column(logs: Sequence[KnownLog]) -> str | None:
    """Give the clock that suits all logs."""
    first = logs[0]
    rows_hz = [float(one.recognition.time_column.partition(ROWS)[2] or 0) for one in logs]
    if max(rows_hz) < _SAME_ROWS * min(rows_hz):
        # Of one logger: the motion shows its rate within some per cent.
        return first.recognition.time_column
    if all(first.recognition.time_column in {*one.columns, one.recognition.time_column} for one in logs):
        wrong = [one for one in logs if one.recognition.time_unit != first.recognition.time_unit]
    else:
        # Every topic has stamps of its own.
        wrong = [one for one in logs if "." not in one.recognition.time_column]
        if not wrong:
            return None
    if not wrong:
        return first.recognition.time_column
    clocks = [f"{one.recognition.time_column} in {one.recognition.time_unit}" for one in (first, wrong[-1])]
    odd = {one.name: (one.recognition.time_column, one.recognition.time_unit) for one in wrong}
    way = _way_on([(one, odd.get(one.name)) for one in logs])
    raise InputError(
        f"{first.name} and {wrong[-1].name}: the stamps are {clocks[0]} and {clocks[1]}, so one config cannot suit"
        f" both: {way}"
    )


def _merged_signals(logs: Sequence[KnownLog]) -> tuple[Guess, ...]:
    merged = []
    for name in dict.fromkeys(guess.signal for one in logs for guess in one.recognition.signals):
        found = [(one, guess) for one in logs if (guess := one.recognition.signal(name)) is not None]
        surest = min(found, key=lambda entry: _SURENESS.index(entry[1].sure))
        if name in SETPOINTS:
            surest, found = _setpoint_of_all(surest, found)
        lacking = [one for one in logs if not set(surest[1].columns.columns) <= one.columns]
        others = {guess.columns: one.name for one, guess in found if one in lacking}
        _require_same_map(name, surest, [(one, guess) for one, guess in found if one not in lacking])
        merged.append(_standing_in(surest[1], others, [one.name for one in lacking]))
    order = {guess.signal: number for number, guess in enumerate(logs[0].recognition.signals)}
    return tuple(sorted(merged, key=lambda guess: order.get(guess.signal, len(order))))


def _setpoint_of_all(
    surest: tuple[KnownLog, Guess], found: Sequence[tuple[KnownLog, Guess]]
) -> tuple[tuple[KnownLog, Guess], list[tuple[KnownLog, Guess]]]:
    """Keep the logs whose setpoint is mapped alike, or stands in; who flew in another mode is no other vehicle."""
    first, kept = surest
    columns, kind = set(kept.columns.columns), known_unit(kept.columns.unit).si
    shared, rivals = [], []
    for one, guess in found:
        stands_in = not columns <= one.columns and known_unit(guess.columns.unit).si == kind
        if stands_in or guess.columns == kept.columns:
            shared.append((one, guess))
        else:
            rivals.append(Rival(f"columns: [{', '.join(guess.columns.columns)}]", f"what {one.name} follows"))
    own = replace(kept, sure="guess", rivals=(*kept.rivals, *rivals)) if rivals else kept
    return (first, own), [(one, own if one is first else guess) for one, guess in shared]


def _standing_in(guess: Guess, others: Mapping[SignalMap, str], lacking: Sequence[str]) -> Guess:
    """Let other columns stand in where logs lack those of a guess; a signal that some lack altogether is optional."""
    if not lacking:
        return guess
    maps = tuple(ColumnMap(**{each.name: getattr(own, each.name) for each in fields(ColumnMap)}) for own in others)
    required = guess.columns.required and {*lacking} <= {*others.values()}
    columns = replace(guess.columns, otherwise=maps, required=required)
    reason = f"{guess.reason}; these columns are missing in {', '.join(lacking)}"
    return replace(guess, columns=columns, reason=reason)


def _require_same_map(
    name: SignalName, surest: tuple[KnownLog, Guess], others: Sequence[tuple[KnownLog, Guess]]
) -> None:
    """Refuse two maps of a signal that both logs are sure of; ranges of commands may be next to the same."""
    first, kept = surest
    own = replace(kept.columns, required=True)
    read = []
    for one, guess in others:
        columns = replace(guess.columns, required=True)
        apart = np.abs(np.subtract(_span(columns), _span(own))).max()
        if columns.unit == own.unit == "1" and apart < _SAME_RANGE * np.ptp(_span(own)):
            columns = replace(columns, scale=own.scale, offset=own.offset)
        read += [(one, columns)] if "guess" not in (guess.sure, kept.sure) else []
    second, columns = next(((one, columns) for one, columns in read if columns != own), (first, own))
    if columns != own:
        maps = [
            f"{', '.join(each.columns)} in {_unit_in_words(each)} (sign {each.sign or 'as logged'}) in {one.name}"
            for one, each in ((first, own), (second, columns))
        ]
        raise InputError(
            f"{first.name} and {second.name}: {name} is {maps[0]} and {maps[1]}, so one config cannot suit both:"
            f" {_way_on(read)}"
        )


def _span(columns: SignalMap) -> tuple[float, float]:
    """Give the logged numbers that are 0 and 1."""
    return -columns.offset / columns.scale, (1 - columns.offset) / columns.scale


def _unit_in_words(columns: SignalMap) -> str:
    if columns.unit == "1" and columns.offset:
        low, high = _span(columns)
        return f"shares from {low:.6g} to {high:.6g}"
    return columns.unit + (f" x {columns.scale:.4g}" if columns.scale != 1.0 else "")


def _way_on(read: Sequence[tuple[KnownLog, object]]) -> str:
    """Say which logs to leave out where most are read alike, and else to look into each by itself."""
    kinds = [[one for one, value in read if value == kind] for kind in dict.fromkeys(value for _, value in read)]
    most, *others = sorted(kinds, key=len, reverse=True)
    if len(most) == max(map(len, others), default=0):
        return "run cpfls init for each of them"
    odd = [one for own in others for one in own]
    reads, them = ("reads", "it") if len(odd) == 1 else ("read", "them")
    return (
        f"{joined([one.name for one in odd])} {reads} differently from {joined([one.name for one in most])}: leave"
        f" {them} out, or run cpfls init for {them} separately"
    )


def _merged_choices(logs: Sequence[KnownLog]) -> tuple[KeyChoice, ...]:
    merged = []
    for key in dict.fromkeys(choice.key for one in logs for choice in one.recognition.choices):
        found = [(one, choice) for one in logs for choice in one.recognition.choices if choice.key == key]
        first, kept = min(found, key=lambda entry: _SURENESS.index(entry[1].sure))
        for one, choice in found:
            if choice.value != kept.value and "guess" not in (choice.sure, kept.sure):
                read = [(log, own.value) for log, own in found if own.sure != "guess"]
                raise InputError(
                    f"{first.name} and {one.name}: import.{key} would be {kept.value} for one and {choice.value}"
                    f" for the other: {_way_on(read)}"
                )
        merged.append(kept)
    return tuple(merged)


def _by_weight(guess: Guess, speeds: Array | None, mass_kg: float, arm_m: float) -> Guess:
    """Let the mass that rotors carry decide between rad/s and rpm, where the size of their speeds does not."""
    if guess.signal != "rotor_speed" or speeds is None or [rival.text for rival in guess.rivals] != ["unit: rpm"]:
        return guess
    units: tuple[UnitName, UnitName] = ("rad/s", "rpm")
    sizes = {unit: known_unit(unit).factor * speeds for unit in units}
    numbers = {unit: thrust_number(mass_kg, room(arm_m, speeds.shape[1]), own) for unit, own in sizes.items()}
    fitting = [unit for unit, own in numbers.items() if IN_ROOM.usual[0] < own < IN_ROOM.usual[1]]
    if len(fitting) != 1:
        return guess
    columns = replace(guess.columns, unit=fitting[0])
    reason = f"{guess.reason}; in {fitting[0]}, propellers that fit between the arms carry the mass at hover"
    return replace(guess, columns=columns, reason=reason, sure="data", rivals=())


def _two_masses(logs: Sequence[KnownLog], mass_kg: float | None) -> list[str]:
    """Say where the rotors of two logs carry unlike loads: one mass suits only one of them."""
    loads = _by_load(logs)
    if len(loads) < 2:
        return []
    (light, first), *_, (heavy, last) = loads
    ratio, measured = heavy.size / light.size, first.recognition.signal("rotor_speed") is not None
    if not _apart(light, heavy, measured):
        return []
    more, what = f"{100 * (ratio - 1):.0f} %", "squared speeds" if measured else "squared commands"
    masses = "" if mass_kg is None else f", {mass_kg * ratio:.3g} kg if the other weighs {mass_kg:.3g} kg"
    battery = "" if measured else ", or its battery is lower"
    return [
        f"{first.name} and {last.name}: in flight the {what} of the rotors are {more} higher in {last.name}, so with"
        f" equal propellers it weighs {more} more{masses}{battery}: one vehicle.mass_kg cannot suit both; run cpfls"
        " init for each of them with its own --mass"
    ]


def _by_load(logs: Sequence[KnownLog]) -> list[tuple[Load, KnownLog]]:
    """Sort logs by what their rotors carry; none where that is known by speeds of some and commands of others.

    What squared commands, or speeds without an accelerometer, show of a flight that does not hover is how it is flown.
    """
    measured = {one.name: one.recognition.signal("rotor_speed") is not None for one in logs}
    loads = [(one.recognition.load, one) for one in logs]
    known = [
        (load, one) for load, one in loads if load is not None and (load.steady or (load.sensed and measured[one.name]))
    ]
    return sorted(known, key=lambda each: (each[0].size, each[1].name)) if len({*measured.values()}) == 1 else []


def _apart(light: Load, heavy: Load, measured: bool) -> bool:
    # A battery of so much less carries so much less at equal commands, where the autopilot does not make up for it.
    emptier = light.voltage / heavy.voltage if not measured and light.voltage > heavy.voltage else 1.0
    return heavy.size > _ALIKE[measured and light.sensed and heavy.sensed] * emptier**2 * light.size


def _of_other_load(logs: Sequence[KnownLog]) -> list[KnownLog]:
    """List the logs whose loads a step parts from that of the first log; a battery that empties makes no step."""
    measured = logs[0].recognition.signal("rotor_speed") is not None
    groups: list[list[KnownLog]] = []
    before: Load | None = None
    for load, one in _by_load(logs):
        if before is None or _apart(before, load, measured):
            groups.append([])
        groups[-1].append(one)
        before = load
    own = next((group for group in groups if any(one is logs[0] for one in group)), None)
    return [] if own is None else [one for group in groups if group is not own for one in group]


def airframe_of(logs: Sequence[KnownLog]) -> tuple[Airframe | None, list[str]]:
    """Take the rotors that parameters state, else those that the motion shows, and hold the one against the other."""
    with about(logs[0].name, InputError):
        own = (stated_airframe(one.parameters, one.recognition.rotors) for one in logs)
        stated = next((found for found in own if found is not None), None)
    moved = [one.recognition.moved for one in logs if one.recognition.moved is not None]
    best = max(moved, key=lambda found: (found.clear, sum(found.explained)), default=None)
    driving = [guess.columns.names for guess in logs[0].recognition.signals if guess.signal in ROTORS]
    named = named_airframe(driving[0], best) if driving else None
    if best is not None and best.clear and stated is None:
        shown = best.airframe
        alike = named is None or [rotor.name for rotor in named.rotors] == [rotor.name for rotor in shown.rotors]
        off = f"the rotors are taken from {shown.reason}, which contradicts {'' if named is None else named.reason}"
        return shown, [] if alike else [f"{off}; {DECIDES_ROTORS}"]
    taken = stated or named or usual_airframe(logs[0].recognition.kind, logs[0].recognition.rotors)
    if best is None:
        return taken, []
    says = f"{best.airframe.reason}: {', '.join(f'{r.name} {_WAY[r.spin]}' for r in best.airframe.rotors)}"
    doubt = f"the positions and spins of the rotors are a guess from {says}; {DECIDES_ROTORS}"
    if taken is None:
        return best.airframe, [doubt]
    orders = [[(rotor.name, rotor.spin) for rotor in own.rotors] for own in (taken, best.airframe)]
    differ = orders[0] != orders[1] and all(rotor.name for rotor in taken.rotors)
    if differ and taken.is_guess and best.by_axes:
        # What is usual is a guess too, and nothing in this log speaks for it.
        return best.airframe, [doubt]
    if taken.is_guess and best.clear and not differ:
        return replace(taken, reason=f"{taken.reason}; {best.airframe.reason}", sure="data"), []
    contradicts = f"the rotors are taken from {taken.reason}, which contradicts {says}"
    return taken, [contradicts] if differ and best.clear else []


def _speed_max(
    logs: Sequence[KnownLog], signals: Sequence[Guess], mass_kg: float | None, thrust_factor: float | None
) -> float:
    """Round up what is somewhat above the largest speed; commands show it by the thrust factor, or 1000 is taken."""
    largest, units = 0.0, {guess.signal: guess.columns.unit for guess in signals}
    unit = units.get("rotor_speed", units.get("rotor_command", "1"))
    for one in logs if unit != "1" else ():
        if one.recognition.speeds is not None:
            guessed = one.recognition.signal("rotor_speed")
            changed = guessed is not None and guessed.columns.unit == "rad/s" and unit == "rpm"
            own = float(np.quantile(np.abs(one.recognition.speeds), 0.999))
            largest = max(largest, own * (known_unit("rpm").factor if changed else 1.0))
    load, rotors = logs[0].recognition.load, logs[0].recognition.rotors
    if not largest and load is not None and mass_kg is not None and thrust_factor is not None:
        # Rotors that turn at their shares of it carry the mass.
        return float(f"{sqrt(mass_kg / (rotors * thrust_factor * load.size)):.4g}")
    return _rounded_up(_ROOM * largest) if largest else 1000.0


def _rounded_up(value: float) -> float:
    """Round up to two digits."""
    unit = 10.0 ** (floor(log10(value)) - 1)
    return float(f"{ceil(value / unit - 1e-9) * unit:.6g}")
