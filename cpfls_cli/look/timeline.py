"""What happens in a log, in order of time: what the autopilot states, and what the signals show beyond doubt."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Final, Literal

import numpy as np
from scipy.ndimage import binary_dilation, median_filter, uniform_filter1d

from cpfls_cli.arrays import Array, BoolArray, runs
from cpfls_cli.flightlog.crash import BEYOND, HARD
from cpfls_cli.flightlog.names import is_of
from cpfls_cli.flightlog.recognised import Recognition
from cpfls_cli.flightlog.stretches import stands_still
from cpfls_cli.flightlog.topics import STAMP, YAW_RESETS, Topics
from cpfls_cli.flightlog.vocabulary import ARDUPILOT, BETAFLIGHT, PX4
from cpfls_cli.look.flight import LogFlight, Samples
from cpfls_cli.look.steady import FEWEST_WINDOWS, calm, on_clock, windows_of
from cpfls_cli.result import about, result
from cpfls_cli.units import STANDARD_GRAVITY

Severity = Literal["note", "warning", "danger"]
Message = tuple[float, str, str]

_FULL_SCALES_RAD_S: Final = tuple(np.radians([250.0, 500.0, 1000.0, 2000.0, 4000.0]).tolist())
_FULL_SCALES_G: Final = (2.0, 4.0, 8.0, 16.0, 24.0, 30.0, 32.0)
_UNITS: Final = {"gyroscope": "rad/s", "accelerometer": "m/s²"}
_OF_SCALE, _CLIPPED_ROWS = 0.02, 3
"""Share by which a largest reading may differ from a full scale, and rows in which it stays there, to be clipped."""

_ROUNDED, _STEP, _FULL, _FEWEST_PLATEAUS, _LIMIT_S, _LONG_S = 1e-4, 2e-3, 0.985, 3, 0.05, 2.0
"""Shares of full command: that of rounding, that of a step of pulses, and from which on the largest one is a limit;
plateaus of some rotors at a smaller one that make it one; and how long a rotor is there, and at one plateau that alone
makes it one, s."""

_LIES, _LIES_S, _HARD_S = -0.7, 1.0, 1.5
"""Force along the rotors, in gravity and over s, of what lies on its back; force of a hard landing, in gravity and
times the largest of its flight, and how long before the end of a flight it may come, s."""

_READS: Final = 0.12
"""By which an accelerometer at rest may differ from gravity, share of it: the largest offset by its data sheets."""

_UPSIDE_DOWN_S, _SAGS, _SAG_S, _SUDDEN, _SUDDEN_S = 0.2, 0.17, 0.25, 0.15, 1.0
"""How long it is on its back; shares of the voltage, from 4.2 to 3.5 V a cell, over s; and what is lost within s at the
end of a log that stops in the air."""

_CLIMBS_S: Final = 10.0
"""Between the autopilot's word for take-off or landing and a height that is surely none of the ground, s."""

_NEAR_S, _FALLS_BACK_S, _RESTARTS_S, _LONG_GAP_S, _PAUSE_S = 3.0, 0.1, 1.0, 0.1, 2.0
"""By which the autopilot's word for take-off and landing is near that of the signals; by which a clock surely falls
back, and one that starts anew; and from which on a gap in flight, and a pause outside, is worth a line, s."""

_AROUND_S, _AT_END_S, _LESS = 0.75, 0.1, 0.7
_IN_THE_AIR = "the log ends in the air"
"""Of a flight that signals leave out near the ground, and at the end of a log, s; and the share of what carries the
vehicle below which nothing does."""

_MOVES_M_S: Final = 0.5
"""Climb rate of what surely does not stand, though its estimate drifts."""

_TRAILS_S: Final = 3.0
"""After a flight that ended early, while what happens still belongs to it, s."""

_MOST_OF_A_KIND, _MOST_KEPT = 4, 12
"""Events of one kind that are listed one by one, and of those kinds that matter most."""

_NAV_STATES: Final = """
    manual, altitude, position, mission, hold, return, position slow, , , , acro, , descend, termination, offboard,
    stabilized, , take-off, land, follow, precision land, orbit, VTOL take-off
"""
_COPTER_MODES: Final = """
    Stabilize, Acro, AltHold, Auto, Guided, Loiter, RTL, Circle, , Land, , Drift, , Sport, Flip, AutoTune, PosHold,
    Brake, Throw, Avoid ADSB, Guided without GPS, Smart RTL, FlowHold, Follow, ZigZag, SystemId, Autorotate, Auto RTL,
    Turtle
"""
"""Modes in the order of their numbers, from 0; empty where a number has none."""

_PX4_ARMED: Final = 2
_LEVEL_MODES: Final = "acro, angle, horizon"
_COPTER_EVENTS: Final[Mapping[int, tuple[str, str]]] = {
    10: ("armed", "armed"),
    11: ("armed", "disarmed"),
    19: ("message", "GPS lost"),
    21: ("mode", "flip begins"),
    22: ("mode", "flip ends"),
    30: ("message", "AutoTune begins"),
    33: ("message", "AutoTune succeeds"),
    34: ("message", "AutoTune fails"),
    35: ("message", "AutoTune reaches a limit"),
    60: ("reset", "estimated height is reset"),
    62: ("reset", "estimated yaw is reset"),
}
_NOT_LANDED, _LANDED = 28, 18
_JUMP_DEG = 10.0  # From which on a reset of the yaw outweighs the turning of a flight.
_COPTER_ERRORS: Final = {
    2: "radio",
    3: "compass",
    5: "failsafe: radio",
    6: "failsafe: battery",
    7: "failsafe: GPS",
    8: "failsafe: ground station",
    9: "failsafe: fence",
    10: "mode change refused",
    11: "GPS glitch",
    12: "crash check: the autopilot takes it for crashed",
    15: "parachute",
    16: "estimator check: variance too large",
    17: "failsafe: estimator",
    18: "barometer glitch",
    19: "processor",
    21: "failsafe: terrain",
    23: "failsafe: terrain data",
    24: "estimator changes its lane",
    25: "thrust loss: more is asked of the rotors than they give",
    26: "failsafe: sensors",
    29: "failsafe: vibration",
    30: "internal error",
    31: "failsafe: dead reckoning",
}
_CRASHED, _THRUST_LOST = 12, 25
_FAILSAFE_PHASES: Final = {1: "radio lost", 2: "landing", 3: "landed", 4: "radio awaited", 6: "rescue by GPS"}
_BANNER: Final = re.compile(
    r"^(ArduCopter|APM:|PX4: |ChibiOS|NuttX|Frame: |New (mission|rally|fence)|Flight plan|GPS \d: (detected|probing)"
    r"|u-blox|fmuv|Param space|RC Protocol|RCOut:|(Arming|Disarming) motors|EKF\d IMU\d is using|[0-9a-f]{32}$"
    r"|\S+ [0-9A-F]{8} )"
)
"""What ArduPilot says at each start, and what its events say as well."""

_LOUD: Final = {"EMERGENCY", "ALERT", "CRITICAL", "ERROR", "WARNING", "EMERG", "CRIT", "ERR"}
_MOMENTS: Final[Mapping[str, tuple[str, Severity]]] = {
    "loss of control": ("loss of control", "danger"),
    "free fall": ("falls freely", "danger"),
    "impact": ("impact", "danger"),
    "rests with its rotors on": ("rests on something with its rotors on", "warning"),
    "rotors stop in the air": ("rotors stop in the air", "danger"),
}


@result
class Event:
    """Something that happens in a log."""

    time_s: float = about("when it happens or begins, from the first stamp of the log", unit="s")
    until_s: float = about("when it ends; missing for a moment", unit="s", gaps=True, default=np.nan)
    kind: str = about("what kind of event")
    text: str = about("what happens")
    severity: str = about("note, warning or danger", default="note")


def timeline(
    flight: LogFlight, topics: Topics, recognition: Recognition, messages: Sequence[Message] = ()
) -> tuple[Event, ...]:
    """List what happens in a log, in order; many of one kind are one.

    Messages of the autopilot to its pilot: s, how bad, text.
    """
    found = [
        *_flights(flight, topics, recognition),
        *_stated(flight.system, topics),
        *_yaw_resets(flight, topics),
        *_of_messages(messages),
        *_limits(flight, _TRAILS_S if recognition.flown.moments else 0.0),
        *_losses(flight, topics),
        *_misread(flight),
        *_on_its_back(flight, _TRAILS_S if recognition.flown.moments else 0.0),
        *_battery(flight),
    ]
    # What held before the log began is stamped before it.
    found = [replace(event, time_s=max(event.time_s, 0.0)) for event in found]
    # Whoever disarms with the rotors on stops the log as it flies, or as it touches down.
    last = next((event.time_s for event in found if event.kind == "end"), np.inf)
    if stops := [event for event in found if event.text == "disarmed" and abs(event.time_s - last) < _AT_END_S]:
        found = [_disarmed(event, flight) if event.kind == "end" else event for event in found if event not in stops]
    # On the ground a failsafe keeps it there.
    found = [
        replace(event, severity="note")
        if event.kind == "failsafe" and not flight.flown[np.abs(flight.time - event.time_s) < _NEAR_S].any()
        else event
        for event in found
    ]
    return tuple(sorted(_merged(found), key=lambda event: (event.time_s, event.kind)))


# Flights and how they end.


def _flights(flight: LogFlight, topics: Topics, recognition: Recognition) -> Iterator[Event]:
    lifts, lands = _land_detector(topics)
    ends = [(what, at + recognition.counted_from_s) for what, at in recognition.flown.moments]
    last, spans, air = float(flight.time[-1]), runs(flight.flown), recognition.flown.air_s
    # Rotors may be logged less often than rates.
    lately = flight.collective[np.isfinite(flight.collective)][-max(2, round(_AT_END_S * flight.rate_hz)) :]
    for number, (first, after) in enumerate(spans):
        before = spans[number - 1][1] if number else 0
        follows = spans[number + 1][0] if number + 1 < len(spans) else None
        begin, end = float(flight.time[first]), float(flight.time[after - 1])
        off, down = (begin, end) if len(air) != len(spans) else np.add(air[number], recognition.counted_from_s).tolist()
        off, down = min(begin, max(off, 0.0)), max(end, min(down, last))
        yield Event(time_s=off, until_s=down, kind="flown", text="flies")
        # What climbs far is surely off the ground long after it has left it, and is near it again long before.
        earliest = max(begin - _CLIMBS_S, flight.time[before - 1] if number else 0.0)
        latest = min(end + _CLIMBS_S, last if follows is None else flight.time[follows])
        lifted = max((at for at in lifts if earliest < at < begin + _NEAR_S), default=None)
        landed = min((at for at in lands if end - _NEAR_S < at <= max(latest, end + _NEAR_S)), default=None)
        if lifted is not None or (begin - float(flight.time[0]) > _AROUND_S and _rests(flight, slice(before, first))):
            yield Event(time_s=off if lifted is None else lifted, kind="take-off", text="takes off")
        if any(end - _NEAR_S <= at < end + _NEAR_S for _, at in ends):
            continue
        touch = _landing(flight, begin, end, down if landed is None else landed)
        stopped = touch.severity == "warning"
        if landed is not None or (last - end > _AROUND_S and _rests(flight, slice(after, follows), stopped)):
            yield touch
        elif last - end < _AT_END_S and lately.min(initial=np.inf) > _LESS * _carried_by(flight):
            text = f"{_IN_THE_AIR}{_voltage_lost(flight)}"
            yield Event(time_s=end, kind="end", text=text, severity="warning" if flight.system else "note")
    for what, at in ends:
        words, severity = _MOMENTS[what]
        yield Event(time_s=at, kind=what, text=words, severity=severity)


def _disarmed(end: Event, flight: LogFlight) -> Event:
    """Say of a log that ends with rotors on that it was disarmed; what climbs does not touch down."""
    late = flight.climb_rate[-max(2, round(_AT_END_S * flight.rate_hz)) :]
    climbs = late[np.isfinite(late)]
    if len(climbs) and float(np.median(climbs)) > _MOVES_M_S:
        return replace(end, text=f"{end.text}, disarmed")
    return replace(end, text=end.text.replace(_IN_THE_AIR, "disarmed as it flies or touches down"), severity="note")


def _landing(flight: LogFlight, begin: float, end: float, at: float) -> Event:
    sensor = flight.accelerometer
    if sensor is not None:
        felt = np.nan_to_num(np.linalg.norm(sensor.values, axis=1)) / STANDARD_GRAVITY
        rows = np.flatnonzero((sensor.time >= end - _HARD_S) & (sensor.time <= max(at, end) + _NEAR_S))
        sizes, before = felt[rows], felt[(sensor.time >= begin) & (sensor.time < end - _HARD_S)]
        # What its rotors make in flight is no ground.
        if sizes.max(initial=0.0) > max(HARD, BEYOND * before.max(initial=0.0)):
            # It is then that it touches the ground; the autopilot takes a while to be sure.
            touches, text = float(sensor.time[rows[sizes.argmax()]]), f"lands hard, with {sizes.max():.2g} g"
            return Event(time_s=touches, kind="landing", text=text, severity="warning")
    return Event(time_s=at, kind="landing", text="lands")


def _carried_by(flight: LogFlight) -> float:
    """Give the usual collective of flight; NaN where it is not known."""
    flown = flight.collective[flight.flown & np.isfinite(flight.collective)]
    return float(np.median(flown)) if len(flown) else np.nan


def _rests(flight: LogFlight, part: slice, stopped: bool = False) -> bool:
    """Tell whether rotors in a part of the log give much less than in flight, and it mostly keeps its height.

    What has `stopped` hard keeps it, whatever a climb rate of an accelerometer that reads wrong says.
    """
    with np.errstate(invalid="ignore"):
        less = flight.collective[part] < _LESS * _carried_by(flight)
    climbs = np.abs(flight.climb_rate[part][less])
    climbs = climbs[np.isfinite(climbs)]
    return bool(less.any()) and (stopped or not (len(climbs) > 0 and float(np.median(climbs)) > _MOVES_M_S))


def _land_detector(topics: Topics) -> tuple[list[float], list[float]]:
    """List the moments of take-off and of landing that the autopilot states."""
    time, landed = _field(topics, "vehicle_land_detected", "landed")
    lifts = time[1:][(landed[1:] == 0) & (landed[:-1] == 1)].tolist()
    lands = time[1:][(landed[1:] == 1) & (landed[:-1] == 0)].tolist()
    when, number = _field(topics, "EV", "Id")
    return lifts + when[number == _NOT_LANDED].tolist(), lands + when[number == _LANDED].tolist()


def _voltage_lost(flight: LogFlight) -> str:
    known = np.isfinite(flight.voltage)
    late = known & (flight.time > flight.time[-1] - _SUDDEN_S)
    if not late.any() or late.all():
        return ""
    before, last = float(np.median(flight.voltage[known & ~late])), float(flight.voltage[late][-1])
    return f", its voltage falls to {last:.1f} V at once" if last < (1 - _SUDDEN) * before else ""


# What the autopilot states.


def _field(topics: Topics, topic: str, *names: str) -> tuple[Array, Array]:
    """Give stamps and values of the first of some fields that a topic has; none where it has none."""
    fields = topics.get(topic, {})
    name = next((own for own in names if own in fields), None)
    if name is None or STAMP not in fields or len(fields[name]) != len(fields[STAMP]):
        return np.empty(0), np.empty(0)
    return np.asarray(fields[STAMP], dtype=float), np.asarray(fields[name], dtype=float)


def _changes(time: Array, values: Array) -> Iterator[tuple[float, float]]:
    """Give each new value and when it comes, the first one too."""
    fresh = np.flatnonzero(np.diff(values, prepend=np.nan) != 0)
    yield from zip(time[fresh].tolist(), values[fresh].tolist(), strict=True)


def _stated(system: str, topics: Topics) -> Iterator[Event]:
    if is_of(system, PX4):
        yield from _of_px4(topics)
    elif is_of(system, ARDUPILOT):
        yield from _of_ardupilot(topics)
    elif is_of(system, BETAFLIGHT):
        yield from _of_betaflight(topics)


def _of_px4(topics: Topics) -> Iterator[Event]:
    yield from _modes(_changes(*_field(topics, "vehicle_status", "nav_state")), _NAV_STATES)
    time, armed = _field(topics, "actuator_armed", "armed")
    if not len(time):
        time, states = _field(topics, "vehicle_status", "arming_state")
        armed = (states == _PX4_ARMED).astype(float)
    yield from _arming(_changes(time, armed))
    for at, on in _changes(*_field(topics, "vehicle_status", "failsafe")):
        if on:
            yield Event(time_s=at, kind="failsafe", text="failsafe", severity="danger")


def _yaw_resets(flight: LogFlight, topics: Topics) -> Iterator[Event]:
    """Say by how much an autopilot turns its estimate at once, which its reader has undone."""
    for at, turn in zip(*_field(topics, YAW_RESETS, "turn"), strict=True):
        flies = flight.flown[min(int(np.searchsorted(flight.time, at)), len(flight.time) - 1)]
        if flies and abs(np.degrees(turn)) > _JUMP_DEG:
            text = f"estimated yaw is reset by {np.degrees(turn):.0f} deg".replace("-", "−")
            text += ", which no gyroscope shows: it is undone"
            yield Event(time_s=float(at), kind="reset", text=text, severity="warning")


def _modes(changes: Iterator[tuple[float, float]], names: str) -> Iterator[Event]:
    known = [name.strip() for name in names.split(",")]
    for at, value in changes:
        number = int(value)
        name = known[number] if 0 <= number < len(known) else ""
        yield Event(time_s=at, kind="mode", text=f"mode {name or number}")


def _arming(changes: Iterator[tuple[float, float]]) -> Iterator[Event]:
    for number, (at, value) in enumerate(changes):
        text = "armed" if value else "disarmed"
        if value or number:
            yield Event(time_s=at, kind="armed", text=text if number else "armed when the log begins")


def _of_ardupilot(topics: Topics) -> Iterator[Event]:
    yield from _modes(_changes(*_field(topics, "MODE", "ModeNum", "Mode")), _COPTER_MODES)
    time, numbers = _field(topics, "EV", "Id")
    for at, number in zip(time.tolist(), numbers.tolist(), strict=True):
        if int(number) in _COPTER_EVENTS:
            kind, text = _COPTER_EVENTS[int(number)]
            yield Event(time_s=at, kind=kind, text=text)
    time, numbers = _field(topics, "ERR", "Subsys")
    codes = _field(topics, "ERR", "ECode")[1]
    for at, number, code in zip(time.tolist(), numbers.tolist(), codes.tolist(), strict=True):
        error = _COPTER_ERRORS.get(int(number))
        # Of 0 an error is over.
        if error is not None and code:
            kind = "failsafe" if error.startswith("failsafe") else "error"
            worst = kind == "failsafe" or number in (_CRASHED, _THRUST_LOST)
            yield Event(time_s=at, kind=kind, text=error, severity="danger" if worst else "warning")


def _of_betaflight(topics: Topics) -> Iterator[Event]:
    fields = topics.get("", {})
    time = np.asarray(fields.get("time", ()), dtype=float)
    flags = np.asarray(fields.get("flightModeFlags", ()), dtype=float).astype(np.int64)
    if len(flags) and len(flags) == len(time):
        since = time - time[0]
        yield from _arming(_changes(since, (flags & 1).astype(float)))
        level = np.where(flags & 2, 1.0, np.where(flags & 4, 2.0, 0.0))
        yield from _modes(_changes(since, level), _LEVEL_MODES)
    phase = np.asarray(fields.get("failsafePhase", ()), dtype=float)
    if len(phase) and len(phase) == len(time):
        for at, value in _changes(time - time[0], phase):
            if int(value) in _FAILSAFE_PHASES:
                text = f"failsafe: {_FAILSAFE_PHASES[int(value)]}"
                yield Event(time_s=at, kind="failsafe", text=text, severity="danger")


def _of_messages(messages: Sequence[Message]) -> Iterator[Event]:
    """Take what is worth a look: where it is said how bad it is, warnings; else all but what is said at each start."""
    for at, level, text in messages:
        if level in _LOUD or (not level and not _BANNER.match(text)):
            yield Event(time_s=at, kind="message", text=f"“{text}”", severity="warning" if level else "note")


# What signals show.


def _limits(flight: LogFlight, after_s: float) -> Iterator[Event]:
    yield from _clipped(flight.gyroscope_unfiltered or flight.gyroscope, _FULL_SCALES_RAD_S, "gyroscope")
    scales = tuple(STANDARD_GRAVITY * each for each in _FULL_SCALES_G)
    if flight.accelerometer is not None:
        yield from _clipped(flight.accelerometer, scales, "accelerometer")
    if len(flight.rotors.time) and flight.rotors_source and not flight.relative:
        yield from _at_limit(flight, after_s)


def _at_limit(flight: LogFlight, after_s: float) -> Iterator[Event]:
    """Find rotors that get all there is: full command, or a largest one that comes again and again as a plateau."""
    time, values = flight.rotors.time, flight.rotors.values
    most = min(float(np.nanmax(values)), 1.0)
    flown = _flown_or_after(flight, time, after_s)[:, None]
    full = (values >= most - _ROUNDED) & flown
    # Where all are there together, it is the crest of a climb.
    plateaus = list(_held(time, np.asarray(full.any(axis=1) & ~full.all(axis=1)), 0.0))
    long = (values[(time >= a) & (time <= b)] for a, b in plateaus if b - a >= _LONG_S)
    # Where nothing moves at all, as in a hover without noise, a rotor is at no limit.
    limits = len(plateaus) >= _FEWEST_PLATEAUS or any(np.ptp(each, axis=0).max() > _ROUNDED for each in long)
    if most < _FULL and not (limits and flight.rotors_source == "logged"):
        return
    width = max(1, round(_LIMIT_S / float(np.median(np.diff(time)))))
    for rotor, column in enumerate(((values >= most - _STEP) & flown).T):
        # What oscillates as it asks for more than there is is at its limit most of the time.
        held = list(_held(time, uniform_filter1d(column.astype(float), width) > 0.5, _LIMIT_S))
        if held:
            total, longest = sum(b - a for a, b in held), max(b - a for a, b in held)
            times = "once" if len(held) == 1 else f"{len(held)} times"
            more = "" if len(held) == 1 else f" in all, {longest:.2g} s at most"
            text = f"M{rotor + 1} at its upper limit {times}, {total:.2g} s{more}"
            yield Event(time_s=held[0][0], until_s=held[-1][1], kind="limit", text=text, severity="warning")


def _flown_or_after(flight: LogFlight, time: Array, after_s: float) -> BoolArray:
    """Mark where it flies, and right after, where a flight that failed goes on."""
    inside = np.zeros(len(time), dtype=bool)
    for first, after in runs(flight.flown):
        inside |= (time >= flight.time[first]) & (time <= flight.time[after - 1] + after_s)
    return inside


def _held(time: Array, marked: BoolArray, least_s: float) -> Iterator[tuple[float, float]]:
    """Give begin and end of what lasts so long."""
    step = float(np.median(np.diff(time)))
    for first, after in runs(marked):
        if after - first >= 2 and time[after - 1] - time[first] + step >= least_s:
            yield float(time[first]), float(time[after - 1])


def _clipped(sensor: Samples, scales: Sequence[float], name: str) -> Iterator[Event]:
    """Find where a sensor stays at the end of its range."""
    for axis, label in enumerate("xyz"):
        size = np.abs(sensor.values[:, axis])
        most = float(np.nanmax(size)) if np.isfinite(size).any() else 0.0
        if not any(abs(most / scale - 1) < _OF_SCALE for scale in scales):
            continue
        held = [(a, b) for a, b in runs(size >= most * (1 - 1e-6)) if b - a >= _CLIPPED_ROWS]
        if held:
            text = f"{name} {label} at the end of its range, {most:.3g} {_UNITS[name]}"
            end = float(sensor.time[held[-1][1] - 1])
            yield Event(
                time_s=float(sensor.time[held[0][0]]), until_s=end, kind="clipping", text=text, severity="warning"
            )


def _misread(flight: LogFlight) -> Iterator[Event]:
    reads, where = flight.reads_at_rest, "at rest"
    if not np.isfinite(reads):
        # What neither turns nor leans is not accelerated for long.
        windows = windows_of(flight)
        felt, leans = (windows.means(on_clock(flight, own)) for own in (flight.specific_force, flight.attitude))
        sizes = np.linalg.norm(felt, axis=1)[calm(flight, windows) & np.isfinite(felt + leans).all(axis=1)]
        reads = float(np.median(sizes)) / STANDARD_GRAVITY if len(sizes) >= FEWEST_WINDOWS else np.nan
        where = "in steady flight"
    if abs(reads - 1) > _READS:
        text = f"the accelerometer reads {reads:.2f} g {where}: calibrate it"
        yield Event(time_s=float(flight.time[0]), kind="calibration", text=text, severity="warning")


def _losses(flight: LogFlight, topics: Topics) -> Iterator[Event]:
    for begin, end in flight.gaps_s[(flight.gaps_s[:, 1] - flight.gaps_s[:, 0]) > _LONG_GAP_S].tolist():
        rows = (flight.time >= begin) & (flight.time <= end)
        if flight.flown[rows].any():
            text = f"no samples for {end - begin:.2g} s"
            yield Event(time_s=begin, until_s=end, kind="gap", text=text, severity="warning")
        elif end - begin > _PAUSE_S:
            yield Event(time_s=begin, until_s=end, kind="pause", text=f"nothing is logged for {end - begin:.0f} s")
    sensor = flight.gyroscope
    for first, after in runs(stands_still(sensor.time, sensor.values)):
        begin, end = float(sensor.time[first]), float(sensor.time[after - 1])
        if flight.flown[(flight.time >= begin) & (flight.time <= end)].any():
            text = f"the gyroscope repeats its last value for {end - begin:.2g} s"
            yield Event(time_s=begin, until_s=end, kind="gap", text=text, severity="warning")
    for name in ("IMU", "sensor_combined", "vehicle_angular_velocity", "vehicle_attitude"):
        time = np.asarray(topics.get(name, {}).get(STAMP, ()), dtype=float)
        back = np.flatnonzero(np.diff(time) < -_FALLS_BACK_S)
        if len(back):
            by = float(time[back[0]] - time[back[0] + 1])
            anew = ": it started anew" if by > _RESTARTS_S else ", and samples are out of order there"
            text = f"the clock of the log falls back by {by:.3g} s{anew}"
            yield Event(time_s=float(time[back[0]]), kind="restart", text=text, severity="warning")
            return
    yield from _counted(topics)


def _counted(topics: Topics) -> Iterator[Event]:
    """Read the counters of clipped readings that autopilots keep."""
    of_px4 = {f"accel_clipping[{axis}]": label for axis, label in enumerate("xyz")}
    of_ardupilot = {name: name for name in ("Clip0", "Clip1", "Clip2", "Clip")}
    for topic, names in (("VIBE", of_ardupilot), ("vehicle_imu_status", of_px4)):
        counted = {name: _field(topics, topic, name) for name in names}
        rises = {name: np.diff(count) for name, (_, count) in counted.items() if len(count) > 1}
        rises = {name: own for name, own in rises.items() if (own > 0).any()}
        if rises:
            where = [(counted[name][0][:-1][own > 0], counted[name][0][1:][own > 0]) for name, own in rises.items()]
            each = ", ".join(f"{names[name]} {int(own[own > 0].sum())}" for name, own in rises.items())
            begin, end = min(float(a[0]) for a, _ in where), max(float(b[-1]) for _, b in where)
            text = f"accelerometers clip ({topic}: {each} times)"
            yield Event(time_s=begin, until_s=end, kind="clipping", text=text, severity="warning")


def _on_its_back(flight: LogFlight, after_s: float) -> Iterator[Event]:
    up = np.cos(flight.attitude[:, 0]) * np.cos(flight.attitude[:, 1])
    width = max(1, round(_LIES_S * flight.rate_hz))
    with np.errstate(invalid="ignore"):
        over = up < 0
        # By its attitude and by its weight.
        force = uniform_filter1d(-np.nan_to_num(flight.specific_force[:, 2]), width)
        lies = over & (force < _LIES * STANDARD_GRAVITY)
    for begin, end in _held(flight.time, lies, _LIES_S):
        yield Event(time_s=begin, until_s=end, kind="lies", text="lies on its back", severity="warning")
    flips = over & ~binary_dilation(lies, iterations=width) & _flown_or_after(flight, flight.time, after_s)
    for begin, end in _held(flight.time, flips, _UPSIDE_DOWN_S):
        yield Event(time_s=begin, until_s=end, kind="upside down", text="upside down")


def _battery(flight: LogFlight) -> Iterator[Event]:
    known = np.isfinite(flight.voltage) & flight.flown
    if not known.any():
        return
    # A spike of the meter is no sag.
    width = max(1, round(_SAG_S * flight.rate_hz))
    volts = median_filter(flight.voltage[known][:: max(1, width // 5)], 5)
    time = flight.time[known][:: max(1, width // 5)]
    first, least = float(np.quantile(volts[: max(1, len(volts) // 20)], 0.9)), int(np.argmin(volts))
    if volts[least] < (1 - _SAGS) * first:
        text = f"the battery sags to {volts[least]:.1f} V, from {first:.1f} V"
        yield Event(time_s=float(time[least]), kind="battery", text=text, severity="warning")


# Many of one kind.


def _merged(found: Sequence[Event]) -> Iterator[Event]:
    for kind in dict.fromkeys(event.kind for event in found):
        own = sorted((event for event in found if event.kind == kind), key=lambda event: event.time_s)
        if kind in ("message", "error", "failsafe"):
            for text in dict.fromkeys(event.text for event in own):
                same = [event for event in own if event.text == text]
                yield same[0] if len(same) == 1 else _as_one(same, f"{text}, {len(same)} times")
        elif len(own) <= (_MOST_KEPT if kind in _KEPT else _MOST_OF_A_KIND):
            yield from own
        else:
            yield _as_one(own, _in_words(kind, own))


def _as_one(many: Sequence[Event], text: str) -> Event:
    until = max(event.until_s if np.isfinite(event.until_s) else event.time_s for event in many)
    worst = max((event.severity for event in many), key=("note", "warning", "danger").index)
    return Event(time_s=many[0].time_s, until_s=until, kind=many[0].kind, text=text, severity=worst)


def _in_words(kind: str, many: Sequence[Event]) -> str:
    if kind == "mode":
        names = dict.fromkeys(event.text.removeprefix("mode ") for event in many)
        return f"the mode changes {len(many) - 1} times: {', '.join(names)}"
    lengths = [event.until_s - event.time_s for event in many]
    if kind == "pause":
        return f"nothing is logged {len(many)} times, for {sum(lengths):.0f} s in all"
    if kind == "gap":
        return f"{len(many)} gaps, {sum(lengths):.2g} s in all, {max(lengths):.2g} s at most"
    return f"{many[0].text}, {len(many)} times"


_MOVES: Final = ("flown", "take-off", "landing", "end", "impact", "loss of control", "free fall")
_KEPT: Final = frozenset((*_MOVES, "limit", "clipping", "armed", "reset"))
