"""Flights of the gap workflow: artifacts or logs imported, signals on one clock each, and which are held out."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from math import nan
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, stretches
from cpfls_cli.artifacts.gate import InputFile, Origin, read_origin
from cpfls_cli.autopilots.registry import AUTOPILOTS
from cpfls_cli.config.load import stored_study
from cpfls_cli.config.study import Study, settings_of
from cpfls_cli.consistency.check import check
from cpfls_cli.consistency.findings import Finding, contradictions
from cpfls_cli.consistency.rotors import meant_unit
from cpfls_cli.effects.signals import Signals, stretch_of
from cpfls_cli.errors import ComputationError, ConfigError, CpflsError, InputError
from cpfls_cli.flightlog.bandwidth import between_updates, is_fast
from cpfls_cli.flightlog.importing import import_log
from cpfls_cli.flightlog.results import Imported
from cpfls_cli.flightlog.settings import SETPOINTS
from cpfls_cli.flightlog.smoothing import body_rate_of
from cpfls_cli.flightlog.stated_vehicle import FAST_HZ, SLOW_HZ, log_faster, shown_slowly, stated_vehicle
from cpfls_cli.flightlog.stretches import SILENT
from cpfls_cli.flights.same_vehicle import require_same_vehicle
from cpfls_cli.gap.settings import GapSettings
from cpfls_cli.logs.formats import LogColumns, is_log, read_log
from cpfls_cli.simulation.model import Simulated
from cpfls_cli.store import read as read_result
from cpfls_cli.units import SPEED_UNITS
from cpfls_cli.vehicle.rotors import AXES, body_wrench, require_control, rotor_demand
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.weak_form.windows import common_windows


def imported(log: Path, study: Study) -> Imported:
    """Import a log in memory."""
    read = read_log(log, study.import_)
    study = study.model_copy(update={"import_": read.settings})
    with _naming(log), settings_of("import", study):
        flight = import_log(
            read.columns,
            study.import_,
            rotor_torque=_rotor_torque(study),
            # The delay is a parameter too: the part of the flight that is held out must not choose it.
            delay_share=study.identification.training_share,
            stamped_hz=read.stamped_hz,
        )
    stamp = read.begins + flight.first_stamp_s
    return replace(
        flight,
        warnings=(*flight.warnings, *read.warnings),
        flown_at=read.flown_at,
        first_stamp_s=stamp,
        begins=stamp + flight.span_s[0],
        system=read.system,
        parameters=_parameters(read),
        stated=stated_vehicle(read.system, read.parameters),
    )


def _parameters(read: LogColumns) -> dict[str, float]:
    """Take the parameters of the control law that flew, if it is a known one."""
    own = (each for each in AUTOPILOTS.values() if each.firmware.wrote(read.system))
    return next((found for each in own if (found := each.in_log(read.parameters))), {})


@contextmanager
def _naming(log: Path) -> Iterator[None]:
    try:
        yield
    except CpflsError as error:
        raise type(error)("\n".join(f"{log}: {line}" for line in str(error).splitlines())) from None


def _rotor_torque(study: Study) -> Callable[[Imported], Array]:
    """Make the body torque of the rotors from their speeds, or from commands taken for speeds."""

    def torque(signals: Imported) -> Array:
        if study.import_.torque_source == "rotor-speed":
            speed = signals.rotor_speed
        else:
            unit = study.import_.signals["rotor_command"].unit
            speed = commanded_speed(signals.rotor_command, unit, study.vehicle.rotor_speed_max_rad_s)
        rotors = len(study.vehicle.rotors)
        if speed is None or speed.shape[1] != rotors:
            raise InputError(
                f"import.signals names {0 if speed is None else speed.shape[1]} rotors, vehicle.rotors has {rotors}"
            )
        return body_wrench(study.vehicle, speed).body_torque

    return torque


def commanded_speed(command: Array | None, unit: str, speed_max: float) -> Array | None:
    """Take a command in 0..1, shape (time, rotor), as a share of the largest speed, rad/s; speeds stay as they are."""
    if command is None or unit in SPEED_UNITS:
        return command
    if unit != "1":
        raise InputError(
            f"import.signals.rotor_command.unit = {unit}: torque_source rotor-command needs commands in 0..1 (unit 1, "
            "with scale and offset) or rotor speeds (rad/s, rpm)"
        )
    return command * speed_max


_LOGGED = ("attitude", "velocity", "position", "acceleration", "specific_force")
_INTEGRALS = ("velocity", "position")  # So smooth that straight lines between updates come near to them.
_UNIFORM = 0.01
_PAUSE = 1.5
"""Step over the usual one from which on the clock has paused."""
FEWEST = 8
"""Samples of a stretch, which effects with derivatives need."""
# A charger fills a cell to a few percent more than is usual; a cell of 3 V that is taken for a share is more.
_FULL = 1.5


@dataclass(frozen=True)
class FlightSet:
    """Flights on one clock each, and what to know about them."""

    flights: tuple[Signals, ...]
    warnings: tuple[str, ...]


@dataclass(frozen=True)
class ReadFlight:
    """A flight as it was read.

    `flown_at`: when the log begins, s since 1970 began (UTC), NaN where it does not say, and of an artifact;
    `updated_hz`: updates a second of signals that its log has more rows than; `repeated`: those of them whose rows
    repeat the last one; `begins`: stamp of the log's own clock at
    time 0, s, NaN where there is none; `stated`: what the log says of its vehicle, as `stated_vehicle`; `system`: what
    wrote the log, such as ``PX4``, with its version where it is known.
    """

    name: str
    signals: Mapping[str, Array]
    units: Mapping[str, str]
    warnings: tuple[str, ...]
    flown_at: float = nan
    updated_hz: Mapping[str, float] = field(default_factory=dict)
    repeated: tuple[str, ...] = ()
    begins: float = nan
    stated: Mapping[str, str] = field(default_factory=dict)
    system: str = ""

    def spans(self, *names: str) -> tuple[float, ...]:
        """Give the spans over which rows average a signal, s, one after another; none if it is as fast as they are.

        Motion of a frequency f shows sinc(f span) times where rows repeat updates, which come late by half the span as
        well, and its square times where they lie on straight lines between them.
        """
        name = next((each for each in names if each in self.updated_hz), None)
        return () if name is None else (1 / self.updated_hz[name],) * (1 if name in self.repeated else 2)


class ReadAlone(NamedTuple):
    """One flight that was read by itself.

    `full_voltage`: what its voltages are shares of, V, 1 where it states shares; `contradictions`: what of the flight
    contradicts itself or its vehicle, but for numbers that cancel between flights.
    """

    flight: ReadFlight
    signals: Signals
    full_voltage: float
    warnings: tuple[str, ...]
    contradictions: tuple[str, ...]


def read_flights(paths: Sequence[Path], study: Study) -> FlightSet:
    """Read flights, and import those that are logs."""
    read = [read_flight(path, study) for path in paths]
    made = [_longest_stretch(flight, study) for flight in read]
    full = max((largest_volts(flight, own.units) for own, (flight, _) in zip(read, made, strict=True)), default=0.0)
    flights = tuple(of_full_battery(flight, own.units, full) for own, (flight, _) in zip(read, made, strict=True))
    warnings = [f"{flight.name}: {w}" for flight, about in made for w in about]
    note = f"voltage: the largest of these flights, {full:.3g} V, is taken as that of a full battery"
    return FlightSet(flights, (*warnings, *([note] if full else [])))


def read_alone(path: Path, study: Study) -> ReadAlone:
    """Read one flight, and hold it against itself and its vehicle."""
    flight = read_flight(path, study)
    signals, about = _longest_stretch(flight, study)
    volts = largest_volts(signals, flight.units)
    found = [each for each in check_flight(flight, study) if each.contradiction]
    wrong = contradictions(each for each in found if not each.of_constants)
    about = (*about, *(each.sentence for each in found if each.of_constants))
    return ReadAlone(flight, of_full_battery(signals, flight.units, volts), volts or 1.0, about, wrong)


def read_flight(path: Path, study: Study) -> ReadFlight:
    """Read a flight, or import it if it is a log."""
    if is_log(path):
        return read_import(path.name, [imported(path, study)], study)
    flight, origin = read_whole(path)
    own = ReadFlight(path.name, flight.signals, units_of(path, origin, study), (), begins=flight.begins)
    if isinstance(flight, Imported):
        # What the import said of the log is said once; what was not measured is none of it.
        silent = tuple(words for words in flight.warnings if SILENT in words)
        own = replace(own, warnings=silent, stated=flight.stated, system=flight.system)
        return replace(own, updated_hz=flight.updated_hz, repeated=flight.repeated)
    return own


def read_whole(path: Path) -> tuple[Imported | Simulated, Origin]:
    """Read a flight with all that is known of it, and where it comes from."""
    return read_result(path, Imported) if "log" in read_origin(path).inputs else read_result(path, Simulated)


def read_import(name: str, parts: Sequence[Imported], study: Study) -> ReadFlight:
    """Join the parts of a log that were imported: several are on the clock of the log, one on a clock of its own."""
    for part in parts:
        _require_speeds(name, part, study)
    first = parts[0]
    slowest = min(parts, key=lambda each: min(each.updated_hz.values(), default=np.inf))
    signals, begins = [part.signals for part in parts], first.first_stamp_s
    notes: tuple[str, ...] = ()
    if len(parts) == 1:
        done = (f"{what} ({count})" for what, count in first.findings.items())
        joined, begins, notes = signals[0], first.begins, (*done, *first.warnings)
    else:
        shared = [each for each in signals[0] if all(each in own for own in signals)]
        for own, part in zip(signals, parts, strict=True):
            own["time"] = own["time"] + part.span_s[0]
        joined = {each: np.concatenate([own[each] for own in signals]) for each in shared}
    known = (first.stated, first.system)
    updated = (slowest.updated_hz, slowest.repeated)
    return ReadFlight(name, joined, _units(study), notes, first.flown_at, *updated, begins, *known)


def _require_speeds(log: str, part: Imported, study: Study) -> None:
    """Refuse speeds of rotors in a unit in which no vehicle flies, where another one carries it."""
    for name in ("rotor_speed", "rotor_command"):
        columns, speed = study.import_.signals.get(name), getattr(part, name)
        if columns is None or speed is None or columns.unit not in SPEED_UNITS:
            continue
        flown = np.isfinite(speed).all(axis=1)
        attitude = None if part.attitude is None else part.attitude[flown]
        meant = meant_unit(study.vehicle, speed[flown], attitude, columns.unit)
        if meant is not None:
            raise ConfigError(
                f"{log}: import.signals.{name}.unit = {columns.unit}: in flight the rotors would carry "
                f"{meant.lifts_as_declared:.3g} times the weight of {study.vehicle.mass_kg:g} kg, which no vehicle "
                f"does; {meant.unit}? then it is {meant.lifts:.3g} times"
            )


def units_of(path: Path, made: Origin, study: Study) -> Mapping[str, str]:
    """Give the units that the import of a flight read, empty for one that was simulated."""
    made_by = stored_study(made.config, path)
    require_same_vehicle(path, made_by.vehicle, study.vehicle)
    return _units(made_by) if "log" in made.inputs else {}


def _units(study: Study) -> dict[str, str]:
    return {name: signal.unit for name, signal in study.import_.signals.items()}


def _longest_stretch(flight: ReadFlight, study: Study) -> tuple[Signals, tuple[str, ...]]:
    known, warnings = _known_part(flight)
    signals, notes = signals_of(flight, known, study)
    if signals.rotor_speed is not None:
        require_rotors(study)
    hz = 1 / (signals.rotor_span_s or signals.period)
    slow = ""
    if signals.rotor_speed is not None and hz < SLOW_HZ:
        slow = (
            f"the {shown_slowly(hz)}: what is faster or small cannot be found; to find it,"
            f" {log_faster('rotors and body rates', FAST_HZ, flight.system)}"
        )
    notes = (*warnings, *notes, *doubts_on_voltage(known, flight.units))
    return replace(signals, slow_rotors=slow), notes


def require_rotors(study: Study) -> None:
    """Refuse a vehicle of the config that cannot have flown what its rotors are said to have driven."""
    try:
        require_control(study.vehicle)
    except ComputationError as error:
        raise ConfigError(str(error)) from None


def signals_of(flight: ReadFlight, known: Mapping[str, Array], study: Study) -> tuple[Signals, tuple[str, ...]]:
    """Arrange a stretch of a flight for the evaluation of effects, and say what was taken for granted.

    Time and signals are all known; setpoints that are not known in all of it are left out.
    """
    signals, notes = _of_motion(flight, known, study)
    actuated, of_rotors = _actuated(signals, flight, known, study)
    return _between_updates(actuated, flight), (*notes, *of_rotors)


def _between_updates(signals: Signals, flight: ReadFlight) -> Signals:
    """Put rotors that were logged rarely on straight lines: no controller holds a command for so long."""
    if signals.rotor_speed is None:
        return signals
    rarely = {name: hz for name, hz in flight.updated_hz.items() if not is_fast(hz)}

    def lines(name: str, values: Array) -> Array:
        held = name in rarely and name in flight.repeated
        return between_updates(values, 1 / (rarely[name] * signals.period)) if held else values

    name, command = "rotor_command" if signals.commanded else "rotor_speed", signals.rotor_command
    return replace(
        signals,
        rotor_speed=lines(name, signals.rotor_speed),
        # Commands that came late would make the lag of measured speeds shorter.
        rotor_command=None if command is None else lines("rotor_command", command),
        rotor_span_s=1 / rarely[name] if name in rarely else 0.0,
    )


def _of_motion(flight: ReadFlight, known: Mapping[str, Array], study: Study) -> tuple[Signals, tuple[str, ...]]:
    time = known["time"]
    notes: tuple[str, ...] = ()
    steps = np.diff(time)
    if len(time) < 2 or np.ptp(steps) > _UNIFORM * np.median(steps):
        raise InputError(f"{flight.name}: its samples are not evenly spaced in time; import it with import.rate_hz")
    rate = body_rate_of(time, known.get("attitude"), known.get("body_rate"))
    if rate is None:
        rate = np.zeros((len(time), 3))
        notes = ("neither body rates nor attitude; taken as level and at rest, so only the balance is judged",)
    optional: dict[str, Any] = {name: known.get(name) for name in _LOGGED}
    optional |= {
        name: between_updates(known[name], 1 / (flight.updated_hz[name] * float(np.median(steps))))
        for name in _INTEGRALS
        if name in known and name in flight.repeated
    }
    asked = {short: known[name] for name, short in SETPOINTS.items() if name in known}
    made = Signals(
        time=time,
        body_rate=rate,
        vehicle=study.vehicle,
        name=flight.name,
        begins=flight.begins,
        voltage=None if doubts_on_voltage(known, flight.units) else known.get("voltage"),
        ground_height_m=study.gap.ground_height_m,
        setpoints={name: own.reshape(len(time), -1) for name, own in asked.items() if np.isfinite(own).all()},
        attitude_spans=flight.spans("attitude", "quaternion"),
        body_rate_spans=flight.spans("body_rate"),
        **optional,
    )
    return made, notes


def _actuated(
    signals: Signals, flight: ReadFlight, known: Mapping[str, Array], study: Study
) -> tuple[Signals, tuple[str, ...]]:
    speed, commanded = known.get("rotor_speed"), False
    if speed is None:
        unit = flight.units.get("rotor_command", "rad/s")
        speed = commanded_speed(known.get("rotor_command"), unit, study.vehicle.rotor_speed_max_rad_s)
        commanded = True
    rotors = len(study.vehicle.rotors)
    if speed is not None and speed.shape[1] != rotors:
        raise InputError(f"{flight.name}: has {speed.shape[1]} rotors, but vehicle.rotors of the config has {rotors}")
    if speed is None and "body_torque" not in known:
        raise InputError(
            f"{flight.name}: has no rotor_speed, rotor_command or body_torque, so there is nothing to compare its "
            "motion with; name their columns in import.signals"
        )
    if speed is not None:
        command = _own_command(flight, known, study)
        return replace(signals, rotor_speed=speed, commanded=commanded, rotor_command=command), ()
    by_wrench = _by_wrench(known, study.vehicle)
    if by_wrench is None:
        torque, thrust = known["body_torque"], known.get("thrust")
        return replace(signals, stated_torque=torque, stated_thrust=thrust, commanded=True), ()
    speed, backward = by_wrench
    notes = ["rotor commands are those that give its thrust and torque by the four rotors of the config"]
    if backward:
        notes.append(f"a rotor would have to push down at {backward} of {len(speed)} samples, and stands still there")
    return replace(signals, rotor_speed=speed, commanded=True), tuple(notes)


def _by_wrench(known: Mapping[str, Array], vehicle: VehicleSettings) -> tuple[Array, int] | None:
    """Find the commands behind thrust and torque, shape (time, rotor), rad/s, of four rotors, which leave no choice.

    The factors of thrust only scale them. At the samples that are counted a rotor would have to push down.
    """
    of_factors = {"thrust_factor", "drag_factor"} & set(vehicle.unknown)
    if "thrust" not in known or len(vehicle.rotors) != len(AXES) or of_factors:
        return None
    try:
        squared = rotor_demand(vehicle, known["thrust"], known["body_torque"]).squared_speed
    except ComputationError:
        return None
    return np.sqrt(np.maximum(squared, 0.0)), int((squared < 0).any(axis=1).sum())


def _own_command(flight: ReadFlight, known: Mapping[str, Array], study: Study) -> Array | None:
    """Give the commands of rotors whose speeds were measured, where they are speeds or shares of the largest."""
    command, unit = known.get("rotor_command"), flight.units.get("rotor_command", "rad/s")
    if "rotor_speed" not in known or command is None or command.shape != known["rotor_speed"].shape:
        return None
    with suppress(InputError):
        return commanded_speed(command, unit, study.vehicle.rotor_speed_max_rad_s)
    return None


def _known_part(flight: ReadFlight) -> tuple[dict[str, Array], tuple[str, ...]]:
    """Keep the longest stretch in which everything is known."""
    best, note = longest_known(flight.name, all_known(flight.signals), flight.signals["time"])
    return {name: values[best] for name, values in flight.signals.items()}, (*flight.warnings, *note)


def all_known(signals: Mapping[str, Array]) -> BoolArray:
    """Mark the samples at which every signal is known; what was asked for may be absent."""
    count = len(signals["time"])
    known = np.ones(count, dtype=bool)
    for values in (values for name, values in signals.items() if name not in SETPOINTS):
        known &= np.isfinite(values.reshape(count, -1)).all(axis=1)
    return known


def known_stretches(name: str, known: BoolArray, time: Array) -> list[slice]:
    """List the stretches without a pause in which everything is known: what of a flight can be used."""
    steps = np.diff(time)
    paused = steps > _PAUSE * np.median(steps) if len(steps) else np.zeros(0, dtype=bool)
    number = np.concatenate([[1], 1 + np.cumsum(paused)])[: len(known)] * known
    long = [slice(*part) for part in stretches(number) if number[part[0]] and part[1] - part[0] >= FEWEST]
    if not long:
        wanted = f"{FEWEST} consecutive samples" if known.any() else "sample"
        raise InputError(f"{name}: no {wanted} at which all of its signals are known")
    return long


def longest_known(name: str, known: BoolArray, time: Array) -> tuple[slice, tuple[str, ...]]:
    """Find the longest of the `known_stretches`, and say so where it is not all of the flight."""
    best = max(known_stretches(name, known, time), key=lambda run: run.stop - run.start)
    if best.stop - best.start == len(known):
        return best, ()
    first, last = time[best.start], time[best.stop - 1]
    note = f"only {first:.2f} s to {last:.2f} s are used, the longest stretch in which all signals are known"
    return best, (note,)


def doubts_on_voltage(signals: Mapping[str, Array], units: Mapping[str, str]) -> tuple[str, ...]:
    """Say why a voltage is that of no battery in flight, and is not used; nothing where it may be or is not known."""
    known = signals.get("voltage", np.zeros(0))
    known = known[np.isfinite(known)]
    empty, most = int((known <= 0).sum()), float(known.max(initial=0.0))
    if empty:
        return (
            f"voltage is 0 or less at {empty} of {len(known)} samples, so it is not used: drop these rows, or check "
            "import.signals.voltage",
        )
    if not in_volts(units) and most > _FULL:
        return (
            f"voltage is up to {most:.3g} times that of a full battery, so it is not used: set "
            "import.signals.voltage.unit to V if it is in V",
        )
    return ()


def check_flight(flight: ReadFlight, study: Study, *, driven: bool = True) -> tuple[Finding, ...]:
    """Hold a flight against itself and its vehicle; alone where nothing drives it, or not `driven`."""
    try:
        known, _ = _known_part(flight)
        signals, _ = _of_motion(flight, known, study)
    except InputError:
        return ()
    if driven:
        with suppress(InputError):
            signals = _actuated(signals, flight, known, study)[0]
    return check([signals], study.gap)


def in_volts(units: Mapping[str, str]) -> bool:
    """Tell whether a flight states its voltage in V, and no share of the full battery."""
    return units.get("voltage", "1") != "1"


def largest_volts(signals: Signals, units: Mapping[str, str]) -> float:
    """Give the largest voltage of a flight, V; 0 where it states none in V."""
    return float(signals.voltage.max()) if in_volts(units) and signals.voltage is not None else 0.0


def of_full_battery(signals: Signals, units: Mapping[str, str], full: float) -> Signals:
    """Take a voltage in V as a share of that of a full battery."""
    volts = largest_volts(signals, units)
    return replace(signals, voltage=np.asarray(signals.voltage) / full, full_voltage=full) if volts else signals


@dataclass(frozen=True)
class FlightSplit:
    """Flights to learn from, flights to judge on, and why; all flights as they were given, whole."""

    training: tuple[Signals, ...]
    held_out: tuple[Signals, ...]
    sentence: str
    whole: tuple[Signals, ...]


def split_flights(given: Sequence[Signals], held_out: Sequence[Signals], settings: GapSettings) -> FlightSplit:
    """Split flights for learning and judging.

    If none are held out, the last third of the flights is, or of one flight its last third.
    """
    if held_out:
        common_windows([*given, *held_out], settings)
        sentence = f"held out as asked: {_names(held_out)}"
        return FlightSplit(tuple(given), tuple(held_out), sentence, (*given, *held_out))
    if len(given) > 1:
        common_windows(given, settings)
        first = len(given) - max(1, len(given) // 3)
        training, last = tuple(given[:first]), tuple(given[first:])
        sentence = f"no flight was held out by name, so the last third of them was: {_names(last)}"
        return FlightSplit(training, last, sentence, tuple(given))
    return _thirds(given[0], settings)


def seen_twice(given: Iterable[InputFile]) -> tuple[str, ...]:
    """Warn of files that stand for two flights."""
    learned: dict[str, str] = {}
    warnings = []
    for file in given:
        if file.sha256 in learned:
            warnings.append(f"{file.name}: is given twice, also as {learned[file.sha256]}")
        learned[file.sha256] = file.name
    return tuple(warnings)


def _thirds(flight: Signals, settings: GapSettings) -> FlightSplit:
    # A flight whose windows are refused as a whole is refused for another reason than its length.
    common_windows([flight], settings)
    cut = 2 * len(flight) // 3
    parts = {" (first two thirds)": slice(0, cut), " (last third)": slice(cut, None)}
    training, last = (replace(stretch_of(flight, part), name=flight.name + which) for which, part in parts.items())
    try:
        common_windows([training, last], settings)
    except InputError as error:
        raise InputError(
            f"{flight.name}: the only flight is too short to hold out a third of it; give more flights, or --held-out "
            f"FLIGHT: {error}"
        ) from None
    sentence = f"there is only one flight, so its last third was held out: {last.name}"
    return FlightSplit((training,), (last,), sentence, (flight,))


def _names(flights: Sequence[Signals]) -> str:
    return ", ".join(flight.name for flight in flights)
