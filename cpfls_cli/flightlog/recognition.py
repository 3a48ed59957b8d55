"""What the columns of an unknown log are: signals, units, axes and frames, each with the reason for the guess."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from typing import Final

import numpy as np

from cpfls_cli.arrays import Array, runs
from cpfls_cli.errors import InputError
from cpfls_cli.flightlog import motion_columns, recognised
from cpfls_cli.flightlog.agreement import correlations, first_derivative, slow
from cpfls_cli.flightlog.airframe import MovedBy, airframe_from_motion
from cpfls_cli.flightlog.attitude_columns import BODY_OF, Reading, doubt_reading, read_attitude
from cpfls_cli.flightlog.conversion import as_mapped
from cpfls_cli.flightlog.crash import Signs, upright_of
from cpfls_cli.flightlog.flown import SHORTEST_FLIGHT_S, FlownPart, find_flown, rotor_shares
from cpfls_cli.flightlog.names import (
    BY_HAND,
    ColumnGroup,
    Named,
    column_groups,
    height_columns,
    is_of,
    named_signals,
    nameless_signals,
    only_of_airplanes,
    without_names,
    words_of,
)
from cpfls_cli.flightlog.rebuilt import with_rebuilt
from cpfls_cli.flightlog.recognised import Load, LogTable, Recognition, Rival, Seen, called
from cpfls_cli.flightlog.repair import SignalTable
from cpfls_cli.flightlog.rotor_columns import Found, RotorColumns, find_mixed, find_rotors
from cpfls_cli.flightlog.setpoint_columns import take_setpoints
from cpfls_cli.flightlog.settings import ROTORS, SETPOINTS, SignalName
from cpfls_cli.flightlog.stated_vehicle import (
    AIRPLANE,
    NO_MULTIROTOR,
    Parameters,
    VehicleKind,
    forward_flight,
    refuse_disarmed,
    refuse_other_vehicle,
)
from cpfls_cli.flightlog.stretches import live_rows
from cpfls_cli.flightlog.topics import STAMP, Topics
from cpfls_cli.flightlog.vocabulary import FAMILIES, KNOWN, OF_TRACKS
from cpfls_cli.rounding import largest
from cpfls_cli.units import STANDARD_GRAVITY, known_unit
from cpfls_cli.words import joined, some

_DEGREES = 180 / np.pi
# Below which a torque is compared with the angular acceleration, and the correlation from which on that follows it.
_TORQUE_HZ, _FOLLOWS = 6.0, 0.3
_FASTEST_RAD_S = 40.0  # Rate that no gyroscope of a multirotor reads: 2000 deg/s are 35 rad/s.
_LATE_S = (0.0, 0.03, 0.06, 0.09)  # By which motors and propellers follow a command, s.
_ORDER: Final[tuple[SignalName, ...]] = (
    "quaternion",
    "attitude",
    "body_rate",
    "acceleration",
    "position",
    "velocity",
    "rotor_speed",
    "rotor_command",
    "body_torque",
    "thrust",
    "voltage",
)
_SIGNS = {"position", "body_rate", "acceleration", "attitude", "quaternion"}  # What shows flight, with the rotors.
# Share by which the squared speeds of rotors, averaged over seconds, vary in a flight that hovers and cruises: the
# specific force of a lean of 30 degrees is 15 % above gravity.
_STEADY: Final = 0.15
_WITH_BODY = {"body_rate", "acceleration", "attitude", "quaternion"}
# Names of one axis, of angles or in space; a P or Q may be a power or a torque.
_AXES: Final = {
    axis for kind, axes in FAMILIES for axis in axes if axis in "xyz" or (len(axis) > 1 and kind == "angles")
}
_BATTERY_V = (2.5, 80.0)  # From one cell that is empty to more than a large vehicle has.
_ON_EARTH: Final = (("lat", "latitude"), ("lon", "lng", "long", "longitude"))
_SHOWN = 4  # Groups of columns that are named where others are taken for the same.
_UP: Final = {"FLU": "up", "FRD": "down"}


def recognise(topics: Topics, units: Mapping[str, str], parameters: Parameters, system: str) -> Recognition:
    """Propose what the columns of a log are; refuse one in which nothing is recognised or flies, or no multirotor.

    The arguments are as a reader gives them (`logs.formats.LogContents`): stamps of topics in s, a flat log as one
    topic without a name.
    """
    kind = refuse_other_vehicle(topics, parameters, system)
    log = LogTable(topics, units)
    named = named_signals(column_groups(log.names), system)
    candidates = recognised.holding_values(log, named)
    if not candidates and log.flat:
        candidates = recognised.holding_values(log, nameless_signals(topics[""], log.clock("")))
    odd = _of_other_length(log, named)
    if not candidates:
        raise InputError(f"{odd}; write as many of each" if odd else _nothing_found(log, named, system))
    dead = [own for own in named if own.signal in ROTORS and len(log.values(own.group.columns[:1])[0])]
    if dead and not candidates.keys() & {*ROTORS}:
        raise InputError(f"no flight in it: the rotors ({dead[0].group.pattern}) never change")
    log, candidates, ended = _live_part(log, candidates)
    recognised.make_grid(log, candidates)
    candidates = motion_columns.without_other_axes(log, candidates)
    candidates = motion_columns.without_euler_rates(log, candidates)
    rotors = find_rotors(_of_rotors(log, candidates), parameters, system)
    rotors = rotors if rotors.driving else find_mixed(log) or rotors
    if rotors.driving is None and log.flat and (only := only_of_airplanes(log.topics[""])):
        raise InputError(f"a log of {AIRPLANE} ({joined(only)}), {NO_MULTIROTOR}")
    log, rotors, rebuilt = with_rebuilt(log, rotors, parameters, system)
    shares = None
    if rotors.driving:
        # Commands or speeds on the clock, shape (time, rotor), as shares; 0 where rotors stand.
        own = rotors.command or rotors.driving
        logged = as_mapped(log.on_grid(own.columns.columns, spikes=False), own.columns)
        shares = rotor_shares(logged, shares=own is rotors.command)
    flown = find_flown(signs := _signs(log, candidates, shares, system)).within(ended, (0.0, float(signs.time[-1])))
    if not flown.flies:
        unlike = {name: f"{found[0].group.pattern}, in numbers of no rotors," for name, found in candidates.items()}
        names = [unlike[name] if name in ROTORS else name.replace("_", " ") for name in candidates]
        held = f"holds {joined(names)} alone: "
        raise InputError(held * (signs.rotors is signs.height is signs.rate is None) + flown.reasons[0])
    refuse_disarmed(topics)
    carried = flown if kind is None else _hover_of(log, kind, flown)
    winged, flown = carried.span_s != flown.span_s, carried
    seen = Seen(log, candidates, _part(log, flown), None if shares is None else shares.mean(axis=1))
    seen.warnings += [] if kind is None else [flown.reasons[-1]]
    seen.warnings += [words for words in (log.time_doubt, odd) if words]
    motion_columns.position_by_velocity(seen)
    verdict = read_attitude(seen)
    if verdict is not None and motion_columns.gyroscope_first(seen, verdict.best, rotors.driving):
        verdict = read_attitude(seen)
    reading = None if verdict is None else verdict.best
    motion_columns.take_places(seen, reading)
    motion_columns.take_body_rate(seen, reading)
    any(motion_columns.take_acceleration(seen, named, reading) for named in candidates.get("acceleration", ()))
    _take_frames(seen, reading)
    if verdict is not None:
        doubt_reading(seen, verdict)
    _take_voltage(seen)
    speeds, moved = _take_rotors(seen, rotors)
    _take_wrench(seen)
    _doubt_columns(seen)
    take_setpoints(seen, parameters, system)
    _list_unused(seen)
    taken = _gathered(seen, flown, speeds, moved)
    return replace(taken, winged=winged, rebuilt=rebuilt, kind=rotors.driving.kind if rotors.driving else "")


def _of_rotors(log: LogTable, candidates: Mapping[SignalName, Sequence[Named]]) -> dict[str, list[Found]]:
    # Three columns of omega are a gyroscope where nothing else is.
    turning = [own.group.columns for own in candidates.get("body_rate", ())[:1]]
    return {
        name: [
            (own, log.values(own.group.columns)[0], log.without_spikes(own.group.columns))
            for own in candidates.get(name, ())
            if own.group.columns not in turning
        ]
        for name in ROTORS
    }


def _of_other_length(log: LogTable, named: Sequence[Named]) -> str:
    """Name the columns of a flat log that would be signals, had they a value for each stamp."""
    columns = dict.fromkeys(column for own in named for column in own.group.columns)
    # A few numbers are of a calibration or its like.
    long = [name for name in columns if log.flat and 2 * len(log.topics[""][name]) > len(log.clock(""))]
    odd = [name for name in long if log.of_other_length((name,))]
    return f"more or fewer values than stamps ({log.time_column}), and left out: {some(odd, _SHOWN)}" if odd else ""


def _nothing_found(log: LogTable, named: Sequence[Named], system: str) -> str:
    """Say why a log without a column that is recognised is refused."""
    named = [own for own in named if own.signal != "voltage"]
    clocks = [time for own in named if len(time := log.values(own.group.columns[:1])[0])]
    if clocks:
        log.require_long_enough(max(float(time[-1] - time[0]) for time in clocks))
        names = some(list(dict.fromkeys(own.group.pattern for own in named)), _SHOWN)
        return f"no flight in it: {names} never change, or hold too few samples for a flight"
    if system and not log.flat:
        return f"holds only {some([*log.topics], _SHOWN)}: no gyroscope, attitude or outputs, so no flight"
    words = {word for name in log.names if name != log.time_column for word in words_of(name)}
    if words <= OF_TRACKS and all(words & {*axis} for axis in _ON_EARTH):
        return (
            f"a track of positions ({some([*log.names], _SHOWN)}) holds no motion of the body: give the autopilot's log"
        )
    if matrix := without_names(log.names):
        return matrix
    alone = {name: ColumnGroup(name, "one", (name,)).words for name in log.names}
    lone = [name for name, own in alone.items() if own and {*own} <= _AXES and not re.search(r"\d", name)]
    parts = f"{some(lone, _SHOWN)}: single axes, and a signal takes all three; " if lone else ""
    shown = ", ".join(log.names[:12]) + (", ..." if len(log.names) > 12 else "")
    return f"no column is recognised as a signal of a flight (columns: {shown}): {parts}{BY_HAND}"


def _live_part(
    log: LogTable, candidates: dict[SignalName, list[Named]]
) -> tuple[LogTable, dict[SignalName, list[Named]], str]:
    """Leave out where sources of a flat log have ended and their columns go on in straight lines; say so."""
    if not log.flat:
        return log, candidates, ""
    fields, clock = log.topics[""], log.clock("")
    leading = {
        str(name): np.column_stack([np.asarray(fields[column], dtype=float) for column in found[0].group.columns])
        for name, found in candidates.items()
    }
    live, ended = live_rows(SignalTable(clock, leading), float(clock[0]))
    if ended:
        origin, log = log.origin, LogTable({"": {name: values[live] for name, values in fields.items()}}, log.units)
        log.origin = origin
        candidates = recognised.holding_values(log, [named for found in candidates.values() for named in found])
    return log, candidates, ended


def _signs(log: LogTable, candidates: Mapping[SignalName, Sequence[Named]], rotors: Array | None, system: str) -> Signs:
    """Gather what shows flight by the names of columns, before axes and frames are known."""
    first = {name: found[0] for name, found in candidates.items() if found and name in _SIGNS}
    values = {name: named.scale * log.on_grid(named.group.columns) for name, named in first.items()}
    height, rate, angles = values.get("position"), values.get("body_rate"), values.get("attitude")
    if height is not None:
        up = -1.0 if first["position"].frame == "NED" or first["position"].group.axis == "n" else 1.0
        stated = first["position"].unit or motion_columns.length_unit(height, 1 / float(log.grid[1] - log.grid[0]))
        height = up * known_unit(stated).factor * height[:, 2]
    elif rotors is None:
        # A height that no config takes still says what flies.
        known = [(row.columns, row.scale) for row in KNOWN if row.signal == "height" and is_of(system, row.system)]
        found = next((own for own in (*known, *height_columns(log.names)) if {*own[0]} <= {*log.names}), None)
        height = None if found is None else found[1] * log.on_grid(found[0])[:, 0]
    if angles is not None and (first["attitude"].unit == "deg" or float(np.abs(angles).max()) > 2 * np.pi):
        angles = angles / _DEGREES
    if rate is not None:
        unit, fast = first["body_rate"].unit, float(np.quantile(np.abs(rate), 0.99)) > _FASTEST_RAD_S
        size = _DEGREES if unit == "deg/s" or (unit is None and fast) else 1.0
        if unit is None and fast and angles is not None:
            # Counts of a sensor, too, are neither.
            size = motion_columns.size_by_angles(rate, angles, 1 / float(log.grid[1] - log.grid[0])) or size
        rate = rate / size
    ordered = "quaternion" in first and (first["quaternion"].group.kind == "wxyz" or first["quaternion"].known)
    return Signs(
        time=log.grid - log.grid[0],
        rotors=rotors,
        height=height,
        body_rate=rate,
        upright=upright_of(angles, values["quaternion"] if ordered else None, "wxyz"),
        force=values.get("acceleration"),
    )


def _part(log: LogTable, flown: FlownPart) -> slice:
    begin, end = flown.span_s or (0.0, np.inf)
    time = log.grid - log.grid[0]
    return slice(int(np.searchsorted(time, begin)), int(np.searchsorted(time, end, "right")))


def _hover_of(log: LogTable, kind: VehicleKind, flown: FlownPart) -> FlownPart:
    """Keep what a VTOL flies on its rotors alone, the longest of it; a log that does not tell is kept as it is."""
    forward = forward_flight(log.topics, log.grid)
    what = f"{kind.what} ({kind.reason}), which is a multirotor in hover alone"
    if forward is None:
        return replace(flown, reasons=(*flown.reasons, f"{what}; the log does not say when it hovers"))
    part = _part(log, flown)
    hovers = [(first + part.start, after + part.start) for first, after in runs(~forward[part])]
    time = log.grid - log.grid[0]
    first, after = max(hovers, key=lambda own: own[1] - own[0], default=(0, 1))
    begin, end = float(time[first]), float(time[after - 1])
    if end - begin < SHORTEST_FLIGHT_S:
        raise InputError(f"a log of {what}, and it hovers for {end - begin:.3g} s of this one at a time")
    if not forward[part].any():
        return replace(flown, reasons=(*flown.reasons, f"{what}, and it hovers throughout"))
    reason = f"{what}: its hover from {begin:.1f} to {end:.1f} s is used, and no flight on the wing"
    return replace(flown, span_s=(round(begin, 2), round(end, 2)), reasons=(*flown.reasons, reason))


def _take_frames(seen: Seen, reading: Reading | None) -> None:
    """Choose the frames: from the lean, from the accelerometer, from the kind of log, or as usual."""
    leading = [found[0] for found in seen.candidates.values() if found]
    bodies = {BODY_OF.get(str(named.frame)) for named in leading} - {None}
    known = next((named.known for named in leading if named.frame), "")
    if reading is not None and reading.lean is not None:
        share = f"leaning explains {100 * reading.place_share:.0f} % of the acceleration"
        seen.choose("body_frame", reading.body, f"{share} with body z {_UP[reading.body]}", "data")
        if bodies and reading.body not in bodies:
            words = ", ".join(map(str, bodies))
            seen.warnings.append(f"a log of {known} is in {words}, but its motion says {reading.body}")
    elif bodies:
        seen.choose("body_frame", min(map(str, bodies)), f"a log of {known}", "named")
    elif "body_frame" not in seen.choices and seen.guesses.keys() & _WITH_BODY:
        rival = Rival("body_frame: FRD", "nothing in the log distinguishes y left, z up from y right, z down")
        seen.choose("body_frame", "FLU", "taken as the usual one", "guess", rival)
    if not seen.guesses.keys() & {"position", "velocity", "attitude", "quaternion"}:
        return
    body = seen.choices.get("body_frame")
    world = {"FLU": "ENU", "FRD": "NED"}["FLU" if body is None else body.value]
    reason = "z of the world points the same way as z of the level body; its x and y matter to no model"
    if reading is not None and reading.lean is not None and reading.world != world:
        world, reason = reading.world, "z of the world is opposite to z of the level body"
    seen.choose("world_frame", world, reason, "guess" if body is None else body.sure)


def _take_voltage(seen: Seen) -> None:
    """Take the first column that may be the voltage of a battery, and not its charge in per cent."""
    for voltage in seen.candidates.get("voltage", ()):
        level = float(np.median(seen.grid(voltage)))
        scale = 1e-3 if voltage.unit is None and level > 1000 else 1.0
        whole = voltage.unit is None and bool(np.all(np.mod(seen.log.values(voltage.group.columns)[1], 1) == 0))
        if _BATTERY_V[0] < level * scale < _BATTERY_V[1] and (scale < 1.0 or not whole):
            seen.take(voltage, "V", f"{called(voltage)}; {level * scale:.3g} V in flight", "named", scale)
            return


def _take_wrench(seen: Seen) -> None:
    """Take torque and thrust where the log has no rotors; with rotors they are what a controller asked for."""
    torque, thrust, rate = seen.first("body_torque"), seen.first("thrust"), seen.guesses.get("body_rate")
    if torque is None:
        return
    if seen.guesses.keys() & set(ROTORS) or rate is None:
        seen.left_out.append(f"{torque.group.pattern}: looks like a commanded torque; the rotors say more")
        return
    turning = first_derivative(seen.log.on_grid(rate.columns.columns)[seen.part], seen.rate_hz)
    shares = []
    for steps in (round(late * seen.rate_hz) for late in _LATE_S):
        # Some time after the torque.
        pair = (turning[steps:], seen.grid(torque)[: len(turning) - steps])
        shares.append(correlations(*(slow(each, seen.rate_hz, _TORQUE_HZ) for each in pair))[:2].tolist())
    roll, pitch = largest(shares, min)
    if not min(roll, pitch) > _FOLLOWS:
        seen.left_out.append(f"{torque.group.pattern}: looks like a torque, but the motion does not follow it")
        return
    reason = (
        f"{called(torque)}; the angular acceleration follows it (correlation {roll:.2f} about roll, {pitch:.2f} about"
        " pitch); a commanded torque is only what a controller asked for"
    )
    scale = () if torque.unit else (Rival("unit: N mm", "the scale follows from the inertia, which no log states"),)
    seen.take(torque, torque.unit or "N m", reason, "named" if torque.unit else "guess", rivals=scale)
    if thrust is not None:
        level = f"{float(np.median(seen.grid(thrust))):.3g}"
        seen.take(thrust, "N", f"{called(thrust)}; {level} in flight, which must be the weight in N", "guess")


def _take_rotors(seen: Seen, rotors: RotorColumns) -> tuple[Array | None, MovedBy | None]:
    seen.left_out += rotors.left_out
    seen.warnings += rotors.warnings
    speeds, rate = None, seen.guesses.get("body_rate")
    for found in filter(None, (rotors.command, rotors.speed)):
        seen.guesses[found.signal] = found
        speeds = seen.mapped(found)
        if found is rotors.command and rotors.command_is is not None and rotors.command_is.value == "thrust":
            speeds = np.sqrt(np.maximum(speeds, 0.0))
    if rotors.command_is is not None:
        seen.choices[rotors.command_is.key] = rotors.command_is
    if speeds is None or rate is None:
        return speeds, None
    body = seen.mapped(rate) * ((1.0, -1.0, -1.0) if seen.choices["body_frame"].value == "FRD" else 1.0)
    moved = airframe_from_motion(body, speeds, seen.rate_hz, rotors.speed is None)
    if moved is not None and ("guess" in (rate.sure, seen.choices["body_frame"].sure) or seen.open_rotors):
        # Whose axes are not known says left for right.
        moved = moved._replace(clear=False, airframe=replace(moved.airframe, sure="guess"))
    return speeds, moved


def _load(seen: Seen, speeds: Array) -> Load | None:
    power, frame = (speeds**2).mean(axis=1), seen.choices.get("acceleration_frame")
    sensed = frame is not None and frame.value == "body-specific-force" and "acceleration" in seen.guesses
    force = np.abs(seen.mapped(seen.guesses["acceleration"])[:, 2]) if sensed else np.full(len(power), STANDARD_GRAVITY)
    known = np.isfinite(power) & np.isfinite(force)
    whole = float(force[known].sum())
    if not whole or not power[known].any():
        return None
    seconds = max(1, round(seen.rate_hz))
    means = power[known][: int(known.sum()) // seconds * seconds].reshape(-1, seconds).mean(axis=1)
    steady = len(means) > 1 and float(means.std()) < _STEADY * float(means.mean())
    voltage = seen.guesses.get("voltage")
    volts = float("nan") if voltage is None else float(np.median(seen.mapped(voltage)))
    return Load(float(power[known].sum()) / whole, sensed, steady, volts)


def _doubt_columns(seen: Seen) -> None:
    """Make a guess of signals of which a column never changes, or two hold the same numbers."""
    for name, guess in tuple(seen.guesses.items()):
        values = dict(zip(guess.columns.columns, seen.log.values(guess.columns.columns)[1].T, strict=True))
        still = [column for column, own in values.items() if len(values) > 1 and not np.ptp(own) > 0]
        odd = [f"{column} never changes" for column in still]
        for one, two in combinations(values, 2):
            same = one not in still and np.array_equal(values[one], values[two])
            odd += [f"{one} and {two} have the same values"] if same else []
        if odd:
            seen.warnings.append(f"{name}: {'; '.join(odd)}")
            seen.doubt(name)


def _list_unused(seen: Seen) -> None:
    """Name the columns that are by their names as good a signal of the motion as those that are taken."""
    used = {column for guess in seen.guesses.values() for column in guess.columns.columns}
    said = [words.partition(": ")[0] for words in seen.left_out]
    for name, found in seen.candidates.items():
        if name not in _WITH_BODY | {"position", "velocity"}:
            continue
        unused = [own.group for own in found if not used & {*own.group.columns} and own.group.pattern not in said]
        groups = [words for group in unused if (words := ", ".join(group.columns)) not in said]
        if groups:
            seen.left_out.append(f"{some(groups, _SHOWN, '; ')}: also {name} by name; not used")


def _gathered(seen: Seen, flown: FlownPart, speeds: Array | None, moved: MovedBy | None) -> Recognition:
    log = seen.log
    signals = tuple(seen.guesses[name] for name in _ORDER if name in seen.guesses)
    asked = tuple(seen.guesses[name] for name in SETPOINTS if name in seen.guesses)
    rates = {guess.signal: log.rate_hz(guess.columns.columns) for guess in signals}
    # An accelerometer is often logged faster than all that matters more.
    clocked = [guess for guess in signals if guess.signal not in ("voltage", "acceleration")] or list(signals)
    base = largest(clocked, lambda guess: rates[guess.signal])
    time_column, unit, begin = log.time_column, log.time_unit, log.origin
    if not log.flat:
        topic = log.parts(base.columns.columns[0])[0]
        time_column, unit, begin = f"{topic}.{STAMP}", "us", float(log.clock(topic)[0])
    if flown.span_s is not None:
        # import.crop_s counts from the first stamp of the clock.
        first, last = (round(own + (float(log.grid[0]) - begin), 2) for own in flown.span_s)
        flown = replace(flown, span_s=(max(0.0, first), last))
    used = {time_column, *(column for guess in (*signals, *asked) for column in guess.columns.columns)}
    used |= set() if log.flat else {f"{topic}.{STAMP}" for topic in log.topics}
    return Recognition(
        time_column=time_column,
        time_unit=unit,
        signals=(*signals, *asked),
        choices=tuple(seen.choices.values()),
        left_out=tuple(seen.left_out),
        unfollowed=tuple(seen.unfollowed),
        flown=flown,
        rate_hz=rates[base.signal],
        slowest_s=max(1 / rates[guess.signal] for guess in signals),
        slowest_but_voltage_s=max(
            (1 / rates[own.signal] for own in signals if own.signal != "voltage"), default=np.inf
        ),
        moved=moved,
        speeds=speeds,
        load=None if speeds is None or seen.open_rotors else _load(seen, speeds),
        warnings=tuple(seen.warnings),
        unused=tuple(name for name in log.names if name not in used),
        counted_from_s=float(log.grid[0]) - log.origin,
    )
