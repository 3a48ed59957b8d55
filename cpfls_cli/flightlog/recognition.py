"""What the columns of an unknown log are: signals, units, axes and frames, each with the reason for the guess."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.errors import InputError
from cpfls_cli.flightlog.agreement import first_derivative, slow
from cpfls_cli.flightlog.airframe import MovedBy, Parameters, airframe_from_motion
from cpfls_cli.flightlog.flown import Flown, find_flown
from cpfls_cli.flightlog.log_table import LogTable, holding_values, make_grid, refuse_dead_rotors
from cpfls_cli.flightlog.motion_columns import (
    GOOD,
    NEAR_GRAVITY,
    nearest,
    over_ground,
    tell_acceleration,
    tell_body_rate,
    tell_places,
)
from cpfls_cli.flightlog.nameless import nameless_signals
from cpfls_cli.flightlog.names import BY_HAND, Named, column_groups, named_signals
from cpfls_cli.flightlog.readings import (
    CLEAR,
    Reading,
    Verdict,
    Witnesses,
    euler_readings,
    read_axes,
    read_quaternion,
)
from cpfls_cli.flightlog.recognised import Recognition, Rival, Seen, Sure, called
from cpfls_cli.flightlog.rotor_columns import RotorColumns, find_rotors
from cpfls_cli.flightlog.settings import ROTORS, SignalName
from cpfls_cli.flightlog.topics import STAMP, Topics
from cpfls_cli.flightlog.vocabulary import ANGLES, SENSED
from cpfls_cli.rounding import largest
from cpfls_cli.units import UnitName, known_unit

_DEGREES = 180 / np.pi
_LARGEST_ANGLE, _LARGEST_TILT = 6.6, 1.7
"""Angles in rad beyond which numbers are degrees: somewhat more than a full turn, and than a lean of a quarter turn."""

_TORQUE_HZ, _FOLLOWS = 6.0, 0.3
"""Below which a torque is compared with the angular acceleration, and the correlation from which on that follows it."""

_LATE_S = (0.0, 0.03, 0.06, 0.09)
"""By which motors and propellers follow a command, s."""

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
_WITH_BODY = {"body_rate", "acceleration", "attitude", "quaternion"}
_BODY_OF: Final = {"FLU": "FLU", "ENU": "FLU", "FRD": "FRD", "NED": "FRD"}
_UP: Final = {"FLU": "up", "FRD": "down"}
_SIGNALS_OF: Final[Mapping[str, tuple[SignalName, ...]]] = {
    "attitude": ("quaternion", "attitude"),
    "body_rate": ("body_rate",),
    "position": ("position", "velocity"),
}
_DECIDES = "a flight of which one lean, turn or climb is known, or the documentation of the log, decides"


def recognise(topics: Topics, units: Mapping[str, str], parameters: Parameters, system: str) -> Recognition:
    """Propose what the columns of a log are.

    Parameters
    ----------
    topics : mapping from topic to mapping from field to array, shape (sample,)
        As a reader gives them: stamps of topics in s, a flat log as one topic without a name.
    units : mapping from column to str
        That the log states.
    parameters : mapping
        Of the autopilot, or of a header.
    system : str
        What wrote the log; empty where that is not known.

    Raises
    ------
    InputError
        If nothing in the log is recognised, or nothing in it flies.
    """
    log = LogTable(topics, units)
    named = named_signals(column_groups(log.names), system)
    candidates = holding_values(log, named)
    if not candidates and log.flat:
        candidates = holding_values(log, nameless_signals(topics[""], log.clock("")))
    if not candidates:
        shown = ", ".join(log.names[:12]) + (", ..." if len(log.names) > 12 else "")
        raise InputError(f"no column is recognised as a signal of a flight (columns: {shown}): {BY_HAND}")
    refuse_dead_rotors(log, named, candidates)
    make_grid(log, candidates)
    rotors = find_rotors({name: _with_values(log, candidates.get(name, ())) for name in ROTORS}, parameters, system)
    level = _level(log, rotors)
    flown = _find_flown(log, candidates, level)
    if not flown.flies:
        raise InputError(flown.reasons[0])
    seen = Seen(log, candidates, _part(log, flown), level)
    seen.warnings += [] if log.time_doubt is None else [log.time_doubt]
    verdict = _read(seen)
    reading = None if verdict is None else verdict.best
    tell_places(seen, reading)
    tell_body_rate(seen, reading)
    tell_acceleration(seen, reading)
    _tell_frames(seen, reading)
    if verdict is not None:
        _doubt_reading(seen, verdict)
    _tell_voltage(seen)
    speeds, moved = _tell_rotors(seen, rotors)
    _tell_wrench(seen)
    _doubt_columns(seen)
    driving = rotors.speed or rotors.command
    return _gathered(seen, flown, speeds, moved, "" if driving is None else driving.kind)


def _with_values(log: LogTable, candidates: Sequence[Named]) -> list[tuple[Named, Array, Array]]:
    groups = [(named, named.group.columns) for named in candidates]
    return [(named, log.values(columns)[0], log.without_spikes(columns)) for named, columns in groups]


def _level(log: LogTable, rotors: RotorColumns) -> Array | None:
    """Give the mean of the rotors' commands or speeds on the clock; 0 where they stand."""
    found = rotors.command or rotors.speed
    if found is None:
        return None
    values = log.on_grid(found.columns.columns, spikes=False)
    level = (found.columns.scale * values + found.columns.offset).mean(axis=1)
    largest = max(1.0, float(np.quantile(level, 0.98))) if rotors.command is None else 1.0
    return np.asarray(level / largest)


def _find_flown(log: LogTable, candidates: Mapping[SignalName, Sequence[Named]], level: Array | None) -> Flown:
    position, gyro = (next(iter(candidates.get(name, ())), None) for name in ("position", "body_rate"))
    height = rate = None
    if position is not None:
        height = position.scale * log.on_grid(position.group.columns)[:, 2] / (1000 if position.unit == "mm" else 1)
    if gyro is not None:
        values = log.on_grid(gyro.group.columns)
        factor = gyro.scale / (_DEGREES if gyro.unit == "deg/s" else 1.0)
        rate = factor * np.linalg.norm(values - np.median(values, axis=0), axis=1)
    return find_flown(log.grid - log.grid[0], level, height, rate)


def _part(log: LogTable, flown: Flown) -> slice:
    begin, end = flown.span_s or (0.0, np.inf)
    inside = np.flatnonzero((log.grid - log.grid[0] >= begin) & (log.grid - log.grid[0] <= end))
    return slice(int(inside[0]), int(inside[-1]) + 1)


# What an attitude is held against, and the reading of its axes.


def _lift(seen: Seen) -> Array | None:
    """Give what grows with the thrust: the rotors' level squared, or the size of what an accelerometer senses."""
    if seen.level is not None:
        return np.asarray(seen.level[seen.part] ** 2)
    for named in seen.candidates.get("acceleration", ()):
        size = np.linalg.norm(seen.grid(named), axis=1)
        if any(1 / NEAR_GRAVITY < float(np.median(size)) / level < NEAR_GRAVITY for level, _, _ in SENSED):
            return np.asarray(size)
    return None


def _witnesses(seen: Seen) -> Witnesses:
    gyro, sensed = seen.first("body_rate"), 0.0
    for named in seen.candidates.get("acceleration", ()):
        values = seen.grid(named)
        if abs(float(np.median(values[:, 2]))) > GOOD * float(np.median(np.linalg.norm(values, axis=1))):
            sensed = float(np.sign(np.median(values[:, 2])))
            break
    bodies = {_BODY_OF[str(named.frame)] for found in seen.candidates.values() for named in found[:1] if named.frame}
    known = bodies.pop() if len(bodies) == 1 else None
    measured = None if gyro is None else seen.grid(gyro)
    return Witnesses(seen.rate_hz, measured, over_ground(seen), _lift(seen), sensed, known)


def _read(seen: Seen) -> Verdict | None:
    """Read the attitude and all axes with it; None without one."""
    euler = seen.first("attitude")
    for named in seen.candidates.get("quaternion", ()):
        if euler is not None and euler.known and not named.known:
            break
        time, values = seen.log.values(named.group.columns)
        if float(np.median(np.abs(np.linalg.norm(values, axis=1) - 1))) < 0.05:
            grid, named_by_axes = seen.log.grid[seen.part], named.group.kind == "wxyz"
            verdict = read_quaternion(values, named_by_axes, time, grid, _witnesses(seen))
            _tell_quaternion(seen, named, verdict)
            return verdict
    return None if euler is None else _read_euler(seen, euler)


def _read_euler(seen: Seen, named: Named) -> Verdict:
    time, values = seen.log.values(named.group.columns)
    unit, reason, sure, rivals = _angle_unit(named, named.scale * values)
    if named.unit not in (None, unit):
        seen.disagree(named, unit)
    for _ in range(2):
        angles = named.scale * known_unit(unit).factor * values
        readings = euler_readings(angles, time, seen.log.grid[seen.part])
        verdict = read_axes(readings, _witnesses(seen))
        best = verdict.best
        if best.lean is None:
            break
        _, decided, _ = nearest(best.lean.gain * (1 if unit == "rad" else 1 / _DEGREES), ANGLES)
        if rivals:
            # Gravity and the lean make the acceleration.
            reason, sure, rivals = f"{reason}; in {decided} the lean explains the acceleration", "data", ()
        elif named.unit is None or decided == unit or best.place_share < GOOD:
            break
        else:
            seen.warnings.append(f"{named.group.pattern} is said to be in {unit}; by the lean it is in {decided}")
            reason, sure = f"{reason}, and by what the lean explains in {decided}", "data"
        if decided == unit:
            break
        unit = decided
    told = best.rates is not None and best.rates.as_named > CLEAR
    if told and best.rates is not None:
        flipped = [axis for axis, own in zip(("roll", "pitch", "yaw"), best.attitude.sign, strict=True) if own < 0]
        turned = f" with {' and '.join(flipped)} reversed" if flipped else ""
        share = f"; the derivative explains {100 * best.rates.as_named:.0f} % of the gyroscope{turned}"
        at = reason.find("; in ")
        reason = reason + share if at < 0 else reason[:at] + share + reason[at:]
    if not told and best.lean is None and sure == "data":
        # A range tells the unit, and nothing here the axes.
        sure = "named"
    seen.tell(named, unit, reason, sure, order=best.attitude.order, sign=best.attitude.sign, rivals=rivals)
    return verdict


def _angle_unit(named: Named, values: Array) -> tuple[UnitName, str, Sure, tuple[Rival, ...]]:
    largest = np.quantile(np.abs(values), 0.999, axis=0)
    tilt, turn = float(largest[:2].max()), float(largest[2])
    if named.unit == "rad" and tilt > _LARGEST_ANGLE:
        return "deg", f"{called(named)}, which would be rad, and reaches {tilt:.3g}, so these are degrees", "data", ()
    if named.unit is not None:
        return named.unit, f"{called(named)}, which is in {named.unit}", "named", ()
    if tilt > _LARGEST_TILT or turn > 20 * _LARGEST_ANGLE:
        return "deg", f"{called(named)}; reaches {max(tilt, turn):.3g}, so these are degrees", "data", ()
    rival = Rival("unit: deg", f"a flight that never leans by more than {tilt:.2g} degrees would read the same")
    rivals = () if turn > 1.0 and turn <= _LARGEST_ANGLE and tilt > 0.1 else (rival,)
    return "rad", f"{called(named)}; leans by {tilt:.2g} at most", "data" if not rivals else "guess", rivals


def _tell_quaternion(seen: Seen, named: Named, verdict: Verdict) -> None:
    best, own = verdict.best, verdict.best.attitude
    order = "xyzw" if own.scalar_last else "wxyz"
    told = best.explained > CLEAR
    data = f"its derivative explains {100 * best.explained:.0f} % of the gyroscope"
    turned = " when turned from world-to-body, as logged, to body-to-world" if own.inverse else ""
    reason = f"of length 1; {called(named)}" + (f"; {data}{turned}" if told else "")
    if own.order != (0, 1, 2, 3):
        held = ", ".join(named.group.columns[index] for index in own.order)
        reason += f"; by what they do {held} are w, x, y, z"
    seen.tell(named, "1", reason, "data" if told else "named", order=own.order, sign=own.sign)
    others = [other for other in verdict.others if other.attitude.scalar_last != own.scalar_last]
    if named.group.kind == "wxyz":
        seen.choose("quaternion_order", order, "the columns are named by w, x, y, z", "named")
        return
    if not others:
        seen.choose("quaternion_order", order, "in the other order the vehicle would not stay level", "data")
        return
    share = max(other.explained for other in others)
    lean = max(other.place_share for other in others)
    if told and share < best.explained - 0.05:
        seen.choose("quaternion_order", order, f"{data}, in the other order {100 * share:.0f} %", "data")
    elif best.lean is not None and lean < best.place_share - 0.2:
        share_of_lean = f"({100 * best.place_share:.0f} %)"
        words = f"in this order alone the lean explains the acceleration {share_of_lean}"
        seen.choose("quaternion_order", order, words, "data")
    elif named.known:
        seen.choose("quaternion_order", order, f"a log of {named.known}", "named")
    elif not verdict.tied and min(other.price for other in others) > best.price:
        words = "in the other order more columns would have to be other than named"
        seen.choose("quaternion_order", order, words, "data")
    else:
        rival = "xyzw" if order == "wxyz" else "wxyz"
        why = "in both the vehicle stays level, and no gyroscope parts them"
        seen.choose("quaternion_order", order, "the more usual one", "guess", Rival(f"quaternion_order: {rival}", why))


def _doubt_reading(seen: Seen, verdict: Verdict) -> None:
    """Say which columns are not what they are named, and make guesses of what other readings take otherwise."""
    best = verdict.best
    if best.attitude.order not in ((0, 1, 2), (0, 1, 2, 3)):
        signal: SignalName = "quaternion" if "quaternion" in seen.guesses else "attitude"
        words = "w, x, y, z" if signal == "quaternion" else "roll, pitch, yaw"
        held = ", ".join(seen.guesses[signal].columns.columns)
        agrees = "so the log agrees with itself, and as named it does not"
        seen.warnings.append(f"{held} are taken for {words}: {agrees}")
    doubted: set[str] = set()
    for other in verdict.tied:
        for name, (order, sign) in other.maps.items():
            if (order, sign) == best.maps[name] or name in doubted:
                continue
            doubted.add(name)
            for signal in _SIGNALS_OF[name]:
                if signal in seen.guesses:
                    columns = [seen.candidates[signal][0].group.columns[index] for index in order]
                    signs = f", sign: {[int(own) for own in sign]}" if min(sign) < 0 else ""
                    text = f"columns: [{', '.join(columns)}]{signs}"
                    seen.doubt(signal, Rival(text, f"the log agrees as well, with other columns turned; {_DECIDES}"))
        if other.body != best.body and "body_frame" not in doubted:
            doubted.add("body_frame")
            for key, value in (("body_frame", other.body), ("world_frame", other.world)):
                choice, reason = seen.choices[key], f"the log agrees as well; {_DECIDES}"
                seen.choose(key, choice.value, choice.reason, "guess", Rival(f"{key}: {value}", reason))


# Frames.


def _tell_frames(seen: Seen, reading: Reading | None) -> None:
    """Choose the frames: from the lean, from the accelerometer, from the kind of log, or as usual."""
    leading = [found[0] for found in seen.candidates.values() if found]
    bodies = {_BODY_OF.get(str(named.frame)) for named in leading} - {None}
    known = next((named.known for named in leading if named.frame), "")
    if reading is not None and reading.lean is not None:
        share = f"leaning explains {100 * reading.place_share:.0f} % of the acceleration"
        seen.choose("body_frame", reading.body, f"{share} with body z {_UP[reading.body]}", "data")
        if bodies and reading.body not in bodies:
            words = ", ".join(map(str, bodies))
            seen.warnings.append(f"a log of {known} is in {words}, and its motion says {reading.body}")
    elif bodies:
        seen.choose("body_frame", min(map(str, bodies)), f"a log of {known}", "named")
    elif "body_frame" not in seen.choices and seen.guesses.keys() & _WITH_BODY:
        rival = Rival("body_frame: FRD", "nothing in the log tells y left, z up from y right, z down")
        seen.choose("body_frame", "FLU", "taken as the usual one", "guess", rival)
    if not seen.guesses.keys() & {"position", "velocity", "attitude", "quaternion"}:
        return
    body = seen.choices.get("body_frame")
    world = {"FLU": "ENU", "FRD": "NED"}["FLU" if body is None else body.value]
    reason = "z of the world points where z of the level body does; x and y of it matter to no model"
    if reading is not None and reading.lean is not None and reading.world != world:
        world, reason = reading.world, "z of the world points the other way than z of the level body"
    seen.choose("world_frame", world, reason, "guess" if body is None else body.sure)


# What drives it.


def _tell_wrench(seen: Seen) -> None:
    """Take torque and thrust where the log has no rotors; beside rotors they are what a controller asked for."""
    torque, thrust, rate = seen.first("body_torque"), seen.first("thrust"), seen.guesses.get("body_rate")
    if torque is None:
        return
    if seen.guesses.keys() & set(ROTORS) or rate is None:
        seen.left_out.append(f"{torque.group.pattern}: looks like a torque that is asked for; the rotors say more")
        return
    turning = first_derivative(seen.log.on_grid(rate.columns.columns)[seen.part], seen.rate_hz)
    shares = [_follows(turning, seen.grid(torque), late, seen.rate_hz) for late in _LATE_S]
    share = largest(shares, min)
    if not min(share) > _FOLLOWS:
        seen.left_out.append(f"{torque.group.pattern}: looks like a torque, and the motion does not follow it")
        return
    reason = (
        f"{called(torque)}; the angular acceleration follows it (correlation {share[0]:.2f} about roll,"
        f" {share[1]:.2f} about pitch); a commanded one is what a controller asked for"
    )
    scale = () if torque.unit else (Rival("unit: N mm", "inertia, which no log states, makes the scale"),)
    seen.tell(torque, torque.unit or "N m", reason, "named" if torque.unit else "guess", rivals=scale)
    if thrust is not None:
        level = f"{float(np.median(seen.grid(thrust))):.3g}"
        seen.tell(thrust, "N", f"{called(thrust)}; {level} in flight, which has to be the weight in N", "guess")


def _follows(turning: Array, torque: Array, late_s: float, rate_hz: float) -> list[float]:
    """Correlate angular acceleration with a torque some time before, about roll and pitch."""
    steps = round(late_s * rate_hz)
    own = slow(turning[steps:], rate_hz, _TORQUE_HZ)
    other = slow(torque[: len(torque) - steps], rate_hz, _TORQUE_HZ)
    still = own.std(axis=0) * other.std(axis=0) == 0
    return [0.0 if still[axis] else float(np.corrcoef(own[:, axis], other[:, axis])[0, 1]) for axis in range(2)]


def _tell_voltage(seen: Seen) -> None:
    voltage = seen.first("voltage")
    if voltage is None:
        return
    level = float(np.median(seen.grid(voltage)))
    scale = 1e-3 if voltage.unit is None and level > 1000 else 1.0
    reason = f"{called(voltage)}; {level * scale:.3g} V in flight"
    seen.tell(voltage, "V", reason, "named", scale=scale, required=False)


def _tell_rotors(seen: Seen, rotors: RotorColumns) -> tuple[Array | None, MovedBy | None]:
    seen.left_out += rotors.left_out
    seen.warnings += rotors.warnings
    speeds = None
    for found in (rotors.command, rotors.speed):
        if found is not None:
            seen.guesses[found.guess.signal] = found.guess
            speeds = seen.mapped(found.guess)
            if found is rotors.command and rotors.command_is is not None and rotors.command_is.value == "thrust":
                speeds = np.sqrt(np.maximum(speeds, 0.0))
    if rotors.command_is is not None:
        seen.choices[rotors.command_is.key] = rotors.command_is
    rate = seen.guesses.get("body_rate")
    if speeds is None or rate is None:
        return speeds, None
    body = seen.mapped(rate)
    if seen.choices["body_frame"].value == "FRD":
        body = body * np.array([1.0, -1.0, -1.0])
    moved = airframe_from_motion(body, speeds, seen.rate_hz, rotors.speed is None)
    if moved is not None and "guess" in (rate.sure, seen.choices["body_frame"].sure):
        # Whose axes are not known says left for right.
        moved = replace(moved, clear=False, airframe=replace(moved.airframe, sure="guess"))
    return speeds, moved


def _doubt_columns(seen: Seen) -> None:
    """Make a guess of signals of which a column never changes, or two hold the same numbers."""
    for name, guess in tuple(seen.guesses.items()):
        values = dict(zip(guess.columns.columns, seen.log.values(guess.columns.columns)[1].T, strict=True))
        still = [column for column, own in values.items() if len(values) > 1 and not np.ptp(own) > 0]
        twice = [
            f"{one} and {other}"
            for index, one in enumerate(values)
            for other in list(values)[index + 1 :]
            if one not in still and np.array_equal(values[one], values[other])
        ]
        odd = [*(f"{column} never changes" for column in still), *(f"{pair} hold the same numbers" for pair in twice)]
        if odd:
            seen.warnings.append(f"{name}: {'; '.join(odd)}")
            seen.doubt(name)


def _gathered(seen: Seen, flown: Flown, speeds: Array | None, moved: MovedBy | None, kind: str) -> Recognition:
    log = seen.log
    signals = tuple(seen.guesses[name] for name in _ORDER if name in seen.guesses)
    rates = {guess.signal: log.rate_hz(guess.columns.columns) for guess in signals}
    # An accelerometer is often logged faster than all that matters more.
    clocked = [guess for guess in signals if guess.signal not in ("voltage", "acceleration")] or list(signals)
    base = largest(clocked, lambda guess: rates[guess.signal])
    time_column, unit = log.time_column, log.time_unit
    begin = log.clock("")[0] if log.flat else 0.0
    if not log.flat:
        topic = log.parts(base.columns.columns[0])[0]
        time_column, unit = f"{topic}.{STAMP}", "us"
        begin = float(log.clock(topic)[0])
    if flown.span_s is not None:
        # import.crop_s counts from the first stamp of the clock.
        off = float(log.grid[0]) - float(begin)
        flown = replace(flown, span_s=(max(0.0, round(flown.span_s[0] + off, 2)), round(flown.span_s[1] + off, 2)))
    return Recognition(
        time_column=time_column,
        time_unit=unit,
        signals=signals,
        choices=tuple(seen.choices.values()),
        left_out=tuple(seen.left_out),
        flown=flown,
        rate_hz=rates[base.signal],
        slowest_s=max(1 / rates[guess.signal] for guess in signals),
        slowest_but_voltage_s=max(1 / rates[guess.signal] for guess in signals if guess.signal != "voltage"),
        kind=kind,
        moved=moved,
        speeds=speeds,
        warnings=tuple(seen.warnings),
    )
