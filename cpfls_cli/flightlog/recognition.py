"""What the columns of an unknown log are: signals, units, axes and frames, each with the reason for the guess."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.errors import InputError
from cpfls_cli.flightlog.agreement import AxisFit, first_derivative, fit_axes, second_derivative, slow
from cpfls_cli.flightlog.airframe import MovedBy, Parameters, airframe_from_motion
from cpfls_cli.flightlog.flown import Flown, find_flown
from cpfls_cli.flightlog.log_table import (
    ROTORS,
    LogTable,
    holding_values,
    make_grid,
    refuse_dead_rotors,
)
from cpfls_cli.flightlog.nameless import OF_A_MATRIX, nameless_signals
from cpfls_cli.flightlog.names import BY_HAND, Named, column_groups, named_signals
from cpfls_cli.flightlog.readings import (
    AS_NAMED,
    CLEAR,
    Order,
    Reading,
    Sign,
    Verdict,
    Witnesses,
    axes_price,
    euler_readings,
    read_axes,
    read_quaternion,
)
from cpfls_cli.flightlog.recognised import Choice, Guess, Recognition, Rival, Sure
from cpfls_cli.flightlog.rotor_columns import RotorColumns, find_rotors
from cpfls_cli.flightlog.settings import SignalMap, SignalName
from cpfls_cli.flightlog.topics import STAMP, Topics
from cpfls_cli.units import STANDARD_GRAVITY, UnitName, known_unit

_DEGREES = 180 / np.pi
_GOOD = 0.6
"""Share of a signal that another has to explain to overrule a name."""

_TOLERANCE, _TEN = 1.4, 10.0
"""Wind and clocks change a size by less than the first, and never from one unit of length to the next."""

_RADIANS_UP_TO, _DEGREES_FROM = 2.0, 10.0
"""Standard deviation of a gyroscope in flight: below the first it reads rad/s, from the second on deg/s."""

_LARGEST_ANGLE, _LARGEST_TILT = 6.6, 1.7
Row = tuple[float, UnitName, float]
"""Size that speaks for a unit, the unit, and the factor that makes it of what is logged."""

RATES: Final[tuple[Row, ...]] = ((1.0, "rad/s", 1.0), (_DEGREES, "deg/s", 1.0), (1000.0, "rad/s", 1e-3))
"""Sizes of a gyroscope beside the attitude's derivative."""

ANGLES: Final[tuple[Row, ...]] = (
    (1.0, "rad", 1.0),
    (1000.0, "rad", 1.0),
    (1 / _DEGREES, "deg", 1.0),
    (1000.0 / _DEGREES, "deg", 1.0),
)
"""Sizes of an acceleration over ground, in m or mm, beside that which gravity and a lean in rad make."""

SENSED: Final[tuple[Row, ...]] = (
    (STANDARD_GRAVITY, "m/s^2", 1.0),
    (1.0, "g", 1.0),
    (1000.0, "g", 1e-3),
    (2048.0, "g", 1 / 2048),
    (4096.0, "g", 1 / 4096),
)
"""Sizes of an accelerometer at hover."""

_NEAR_GRAVITY, _WEIGHT = 1.3, 1.15
_CLOSER = 0.4
"""What is left of a velocity in body axes, as a share of what is left in those of the world, that tells the former."""

_ALONG, _AGAINST = 0.3, -0.6
"""Correlations of one axis: below the first a column follows nothing, below the second it runs the other way."""

_TORQUE_HZ, _FOLLOWS = 6.0, 0.3
_LATE_S = (0.0, 0.03, 0.06, 0.09)
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
    seen = _Seen(log, candidates, _part(log, flown), level)
    seen.warnings += [] if log.time_doubt is None else [log.time_doubt]
    verdict = _read(seen)
    reading = None if verdict is None else verdict.best
    _tell_places(seen, reading)
    _tell_body_rate(seen, reading)
    _tell_acceleration(seen, reading)
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


@dataclass
class _Seen:
    """A log, the part of it that is flown, and what has been told of it so far."""

    log: LogTable
    candidates: Mapping[SignalName, Sequence[Named]]
    part: slice
    level: Array | None
    guesses: dict[SignalName, Guess] = field(default_factory=dict)
    choices: dict[str, Choice] = field(default_factory=dict)
    left_out: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)

    @property
    def rate_hz(self) -> float:
        """Of the one clock."""
        return 1 / float(self.log.grid[1] - self.log.grid[0])

    def first(self, name: SignalName) -> Named | None:
        """Give the best candidate for a signal."""
        return next(iter(self.candidates.get(name, ())), None)

    def grid(self, named: Named) -> Array:
        """Give a candidate's columns in the part that is flown, in the unit that is stated."""
        return named.scale * self.log.on_grid(named.group.columns)[self.part]

    def mapped(self, guess: Guess) -> Array:
        """Give the columns of a guess in the part that is flown, as they are mapped, in SI."""
        columns = guess.columns
        values = columns.scale * self.log.on_grid(columns.columns, spikes=guess.signal not in ROTORS)[self.part]
        return known_unit(columns.unit).factor * np.asarray(columns.sign or 1.0) * (values + columns.offset)

    def tell(
        self,
        named: Named,
        unit: UnitName,
        reason: str,
        sure: Sure,
        *,
        scale: float = 1.0,
        order: Sequence[int] | None = None,
        sign: Sequence[float] | None = None,
        rivals: tuple[Rival, ...] = (),
        required: bool = True,
    ) -> None:
        """Take columns for a signal, in an order and with signs."""
        columns = named.group.columns
        mapped = SignalMap(
            columns=columns if order is None else tuple(columns[index] for index in order),
            unit=unit,
            scale=named.scale * scale,
            sign=None if sign is None or min(sign) > 0 else tuple(sign),
            required=required,
        )
        guess = Guess(signal=named.signal, columns=mapped, reason=reason, sure=sure, rivals=rivals)
        self.guesses[named.signal] = guess

    def choose(self, key: str, value: str, reason: str, sure: Sure, *rivals: Rival) -> None:
        """Take a value of a key that holds for the whole log."""
        self.choices[key] = Choice(key, value, reason, sure, rivals)

    def doubt(self, name: SignalName, *rivals: Rival) -> None:
        """Make a guess of what was told."""
        guess = self.guesses[name]
        self.guesses[name] = replace(guess, sure="guess", rivals=(*guess.rivals, *rivals))


def _called(named: Named) -> str:
    pattern = named.group.pattern
    if named.known == OF_A_MATRIX:
        return f"{pattern} of {OF_A_MATRIX}"
    if any(letter.isalnum() for letter in pattern):
        return f"a log of {named.known} calls it {pattern}" if named.known else f"called {pattern}"
    return f"called {', '.join(named.group.columns)}"


def _nearest(size: float, rows: Sequence[Row]) -> Row:
    return min(rows, key=lambda row: abs(np.log(size / row[0])))


# What an attitude is held against, and the reading of its axes.


def _moving(seen: _Seen) -> Array | None:
    position, velocity = seen.first("position"), seen.first("velocity")
    if position is not None:
        return second_derivative(seen.grid(position), seen.rate_hz)
    return None if velocity is None else first_derivative(seen.grid(velocity), seen.rate_hz)


def _lift(seen: _Seen) -> Array | None:
    """Give what grows with the thrust: the rotors' level squared, or the size of what an accelerometer senses."""
    if seen.level is not None:
        return np.asarray(seen.level[seen.part] ** 2)
    for named in seen.candidates.get("acceleration", ()):
        size = np.linalg.norm(seen.grid(named), axis=1)
        if any(1 / _NEAR_GRAVITY < float(np.median(size)) / level < _NEAR_GRAVITY for level, _, _ in SENSED):
            return np.asarray(size)
    return None


def _witnesses(seen: _Seen) -> Witnesses:
    gyro, sensed = seen.first("body_rate"), 0.0
    for named in seen.candidates.get("acceleration", ()):
        values = seen.grid(named)
        if abs(float(np.median(values[:, 2]))) > _GOOD * float(np.median(np.linalg.norm(values, axis=1))):
            sensed = float(np.sign(np.median(values[:, 2])))
            break
    bodies = {_BODY_OF[str(named.frame)] for found in seen.candidates.values() for named in found[:1] if named.frame}
    known = bodies.pop() if len(bodies) == 1 else None
    measured = None if gyro is None else seen.grid(gyro)
    return Witnesses(seen.rate_hz, measured, _moving(seen), _lift(seen), sensed, known)


def _read(seen: _Seen) -> Verdict | None:
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


def _read_euler(seen: _Seen, named: Named) -> Verdict:
    time, values = seen.log.values(named.group.columns)
    unit, reason, sure, rivals = _angle_unit(named, named.scale * values)
    if named.unit not in (None, unit):
        seen.warnings.append(f"{named.group.pattern} is said to be in {named.unit}; its size says {unit}")
    for _ in range(2):
        angles = named.scale * known_unit(unit).factor * values
        readings = euler_readings(angles, time, seen.log.grid[seen.part])
        verdict = read_axes(readings, _witnesses(seen))
        best = verdict.best
        if best.lean is None:
            break
        _, decided, _ = _nearest(best.lean.gain * (1 if unit == "rad" else 1 / _DEGREES), ANGLES)
        if rivals:
            # Gravity and the lean make the acceleration.
            reason, sure, rivals = f"{reason}; in {decided} the lean explains the acceleration", "data", ()
        elif named.unit is None or decided == unit or best.place_share < _GOOD:
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
        return "deg", f"{_called(named)}, which would be rad, and reaches {tilt:.3g}, so these are degrees", "data", ()
    if named.unit is not None:
        return named.unit, f"{_called(named)}, which is in {named.unit}", "named", ()
    if tilt > _LARGEST_TILT or turn > 20 * _LARGEST_ANGLE:
        return "deg", f"{_called(named)}; reaches {max(tilt, turn):.3g}, so these are degrees", "data", ()
    rival = Rival("unit: deg", f"a flight that never leans by more than {tilt:.2g} degrees would read the same")
    rivals = () if turn > 1.0 and turn <= _LARGEST_ANGLE and tilt > 0.1 else (rival,)
    return "rad", f"{_called(named)}; leans by {tilt:.2g} at most", "data" if not rivals else "guess", rivals


def _tell_quaternion(seen: _Seen, named: Named, verdict: Verdict) -> None:
    best, own = verdict.best, verdict.best.attitude
    order = "xyzw" if own.scalar_last else "wxyz"
    told = best.explained > CLEAR
    data = f"its derivative explains {100 * best.explained:.0f} % of the gyroscope"
    turned = " when turned from world-to-body, as logged, to body-to-world" if own.inverse else ""
    reason = f"of length 1; {_called(named)}" + (f"; {data}{turned}" if told else "")
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


def _doubt_reading(seen: _Seen, verdict: Verdict) -> None:
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


# The gyroscope.


def _tell_body_rate(seen: _Seen, reading: Reading | None) -> None:
    named = seen.first("body_rate")
    if named is None:
        return
    fit, stated = None if reading is None else reading.rates, named.unit
    if fit is not None and fit.explained > CLEAR:
        size, unit, scale = _nearest(fit.gain, RATES)
        agrees = bool(abs(np.log(fit.gain / size)) < np.log(_TOLERANCE))
        if stated is not None and known_unit(stated).factor != known_unit(unit).factor * scale:
            if agrees:
                seen.warnings.append(f"{named.group.pattern} is said to be in {stated}; its size says {unit}")
            else:
                unit, scale = stated, 1.0
        if not agrees:
            seen.warnings.append(
                f"{named.group.pattern} is {fit.gain:.3g} times as large as the attitude's derivative, which no unit"
                " makes: is the unit of the stamps right?"
            )
        seen.tell(
            named,
            unit,
            _rates_in_words(named, fit, unit, scale),
            "data" if agrees else "guess",
            scale=scale,
            order=fit.order,
            sign=fit.sign,
        )
        _doubt_rates(seen, named, fit)
        return
    values = seen.grid(named)
    spread = float(np.sqrt(values.var(axis=0).sum()))
    between = _RADIANS_UP_TO <= spread <= _DEGREES_FROM
    unit = stated or ("deg/s" if spread > _DEGREES_FROM else "rad/s")
    rivals = (Rival("unit: deg/s", f"a spread of {spread:.2g} is possible in both"),) if between and not stated else ()
    size_in_words = f"a spread of {spread:.2g} in flight" if stated is None else f"which is in {stated}"
    turned = "" if named.sign is None else "; signs as that log has them"
    against = "no attitude that turns is there to hold it against"
    if fit is not None:
        against = f"the derivative of the attitude explains only {100 * fit.explained:.0f} % of it"
        seen.warnings.append(
            f"{named.group.pattern}: {against}; one of the two is late, of other axes, or full of noise, and the axes"
            " are taken as named"
        )
    sure: Sure = "guess" if rivals or fit is not None else "named"
    reason = f"{_called(named)}, {size_in_words}{turned}; {against}"
    seen.tell(named, unit, reason, sure, sign=named.sign, rivals=rivals)


def _rates_in_words(named: Named, fit: AxisFit, unit: str, scale: float) -> str:
    axes = "" if fit.is_as_named else ", with its axes in this order and with these signs"
    better = f"{fit.times_better:.1f} times better than in any other order or with other signs"
    gain = f"{fit.gain:.3g}"
    large = "as large" if gain == "1" else f"{gain} times as large"
    size = f" and is {large}, so it is in {unit}" if scale == 1.0 else f", in thousandths of {unit}"
    return f"{_called(named)}; follows the attitude's derivative{axes} ({100 * fit.explained:.0f} %, {better}){size}"


def _doubt_rates(seen: _Seen, named: Named, fit: AxisFit) -> None:
    """Warn of axes of a gyroscope that are not as the others."""
    columns = [named.group.columns[index] for index in fit.order]
    if axes_price(fit.order, fit.sign) and np.prod(fit.sign) * np.linalg.det(np.eye(3)[list(fit.order)]) < 0:
        reversed_ = [column for column, own in zip(columns, fit.sign, strict=True) if own < 0]
        what = f"{', '.join(reversed_)} runs against all others" if len(reversed_) == 1 else "its axes are left-handed"
        seen.warnings.append(f"{named.group.pattern}: {what}, and is taken as the attitude has it")
    loose = [c for c, own in zip(columns, fit.along, strict=True) if not own > _ALONG]
    if loose and max(fit.along) > _GOOD:
        seen.warnings.append(f"{', '.join(loose)}: does not follow the attitude's derivative as the other axes do")
        seen.doubt("body_rate", Rival("leave body_rate out", f"{', '.join(loose)} follows nothing that is logged"))


# Position and velocity.


def _tell_places(seen: _Seen, reading: Reading | None) -> None:
    position, velocity = seen.first("position"), seen.first("velocity")
    relative = None
    if velocity is not None and position is not None:
        derived = first_derivative(seen.grid(position), seen.rate_hz)
        measured = slow(seen.grid(velocity), seen.rate_hz)
        relative = fit_axes(slow(derived, seen.rate_hz), measured)
        if reading is not None:
            in_body = reading.attitude.rotation.inv().apply(derived)
            body = fit_axes(slow(in_body, seen.rate_hz), measured)
            if body.explained > _GOOD and 1 - body.explained < _CLOSER * (1 - relative.explained):
                seen.left_out.append(
                    f"{velocity.group.pattern}: a velocity in body axes (the position's derivative explains"
                    f" {100 * body.explained:.0f} % there, {100 * relative.explained:.0f} % in the world);"
                    " import.signals takes velocities of the world"
                )
                velocity = None
    tilt = None if reading is None or reading.lean is None else reading
    if position is not None:
        _tell_place(seen, position, ("m", "mm"), tilt, None)
    if velocity is not None:
        _tell_place(seen, velocity, ("m/s", "mm/s"), tilt, relative)


def _tell_place(
    seen: _Seen,
    named: Named,
    units: tuple[UnitName, UnitName],
    tilt: Reading | None,
    relative: AxisFit | None,
) -> None:
    stated, place = named.unit, seen.guesses.get("position")
    unit: UnitName = stated or units[0]
    sure: Sure = "named"
    rivals: tuple[Rival, ...] = ()
    reason = _called(named)
    follows = relative is not None and relative.explained > CLEAR
    gain = float("nan") if tilt is None or tilt.lean is None else tilt.lean.gain
    if follows and relative is not None and stated is None and place is not None:
        # What it is in follows from the position, whatever else is logged in other units.
        small = known_unit(place.columns.unit).factor / relative.gain < 0.03
        unit, sure = units[1] if small else units[0], place.sure
    elif tilt is not None and stated is None:
        unit = units[1] if gain > 100 else units[0]
        sure = "data" if 1 / _TEN < gain / (1000 if unit == units[1] else 1) < _TEN else "guess"
        reason += (
            f"; tilt and gravity explain {100 * tilt.place_share:.0f} % of the acceleration in {unit.split('/')[0]}"
        )
    elif stated is None:
        spread = float(np.ptp(seen.grid(named), axis=0).max())
        sure = "data" if spread < 50 else "guess"
        reason += f"; ranges over {spread:.3g}"
        rivals = () if sure == "data" else (Rival(f"unit: {units[1]}", "no attitude that leans speaks against it"),)
    else:
        reason += f", which is in {stated}"
        # The lean was held against the velocity only where there is no position.
        leans = tilt is not None and tilt.place_share > _GOOD and (named.signal == "position" or place is None)
        if leans and tilt is not None and not 1 / _TEN < gain * known_unit(stated).factor < _TEN:
            unit, sure = units[gain > 100], "data" if gain > 100 else "guess"
            reason += f"; tilt and gravity explain {100 * tilt.place_share:.0f} % of the acceleration in {unit}"
            seen.warnings.append(
                f"{named.group.pattern} is said to be in {stated}; by tilt and gravity it is in {unit}"
            )
    order, sign = AS_NAMED if tilt is None else (tilt.place_order, tilt.place_sign)
    if named.signal == "velocity" and follows and relative is not None:
        reason += f"; the position's derivative explains {100 * relative.explained:.0f} % of it"
        order, sign = _behind(relative, order, sign)
    if (order, sign) != AS_NAMED:
        reason += "; turned into the axes of the attitude, as the tilt asks for"
    seen.tell(named, unit, reason, sure, order=order, sign=sign, rivals=rivals)
    _warn_of_mirrored(seen, named, order, sign)


def _behind(relative: AxisFit, order: Order, sign: Sign) -> tuple[Order, Sign]:
    """Put the axes of a velocity, as they lie to those of the position, behind those of the position."""
    own = [-one if along < _AGAINST else one for one, along in zip(relative.sign, relative.along, strict=True)]
    return tuple(relative.order[index] for index in order), tuple(
        own[index] * one for index, one in zip(order, sign, strict=True)
    )


def _warn_of_mirrored(seen: _Seen, named: Named, order: Sequence[int], sign: Sequence[float]) -> None:
    if np.prod(sign) * np.linalg.det(np.eye(3)[list(order)]) > 0:
        return
    columns = [named.group.columns[index] for index, own in zip(order, sign, strict=True) if own < 0]
    what = f"{columns[0]} runs against all others" if len(columns) == 1 else "its axes are left-handed"
    seen.warnings.append(f"{named.group.pattern}: {what}, and is taken as the rest of the log has it")


# The accelerometer.


def _tell_acceleration(seen: _Seen, reading: Reading | None) -> None:
    for named in seen.candidates.get("acceleration", ()):
        if _take_acceleration(seen, named, reading):
            return


def _take_acceleration(seen: _Seen, named: Named, reading: Reading | None) -> bool:
    values, stated = seen.grid(named), named.unit
    vertical = float(np.median(values[:, 2]))
    carried = _carried(seen, reading)
    fitting, at_hover = (
        [row for row in SENSED if 1 / _NEAR_GRAVITY < abs(vertical) / (weight * row[0]) < _NEAR_GRAVITY]
        for weight in (carried, 1.0)
    )
    sensed = next((row for row in fitting if row[1] == (stated or row[1])), fitting[0] if fitting else None)
    world = _world_acceleration(seen)
    along_world = None
    if world is not None:
        ground = np.array([1.0, 1.0, 0.0 if sensed else 1.0])
        along_world = fit_axes(slow(ground * world, seen.rate_hz, 1.0), slow(ground * values, seen.rate_hz, 1.0))
    if sensed is not None:
        # In body axes next to nothing is sensed along x and y in flight; over ground the world's axes have it all.
        of_body = named.frame in ("FLU", "FRD")
        if along_world is not None and along_world.as_named > _GOOD and along_world.gain > 0.5 and not of_body:
            seen.left_out.append(
                f"{named.group.pattern}: an acceleration of the world with gravity in it (the motion explains"
                f" {100 * along_world.as_named:.0f} %), which import.signals has no word for"
            )
            return False
        _tell_sensed(seen, named, vertical, carried, sensed, reading)
        if at_hover and sensed not in at_hover:
            other = at_hover[0][1]
            seen.doubt(
                "acceleration", Rival(f"unit: {other}", f"at hover it would be {other}; are stamps in their unit?")
            )
        return True
    if along_world is None or along_world.explained < CLEAR:
        seen.left_out.append(
            f"{named.group.pattern}: no gravity is in it (z has a median of {vertical:.3g}), and the motion over"
            " ground does not explain it"
        )
        return False
    unit: UnitName = "g" if abs(np.log(along_world.gain * STANDARD_GRAVITY)) < np.log(2) else "m/s^2"
    reason = (
        f"{_called(named)}; the motion over ground explains {100 * along_world.explained:.0f} %, in"
        f" {stated or unit}, and no gravity is in it"
    )
    seen.tell(named, stated or unit, reason, "data")
    words = "the acceleration has no gravity in it and follows the motion"
    seen.choose("acceleration_frame", "world", words, "data")
    return True


def _carried(seen: _Seen, reading: Reading | None) -> float:
    """Give how many times its weight the rotors carry, by the motion; 1 where that says nothing."""
    position = seen.first("position")
    if position is None or reading is None or reading.lean is None:
        return 1.0
    moving = second_derivative(seen.grid(position), seen.rate_hz) / (1000.0 if reading.lean.gain > 100 else 1.0)
    up = reading.place_sign[2] * (1.0 if reading.world == "ENU" else -1.0)
    size = np.linalg.norm(moving + np.array([0.0, 0.0, up * STANDARD_GRAVITY]), axis=1)
    return float(np.median(size)) / STANDARD_GRAVITY


def _world_acceleration(seen: _Seen) -> Array | None:
    position, velocity = seen.first("position"), seen.guesses.get("velocity")
    if velocity is not None:
        return first_derivative(seen.log.on_grid(velocity.columns.columns)[seen.part], seen.rate_hz)
    return None if position is None else second_derivative(seen.grid(position), seen.rate_hz)


def _tell_sensed(
    seen: _Seen, named: Named, vertical: float, carried: float, sensed: Row, reading: Reading | None
) -> None:
    _, unit, scale = sensed
    up = "FLU" if vertical > 0 else "FRD"
    told = None if reading is None or reading.lean is None else reading.body
    body = told or (named.frame if named.frame in ("FLU", "FRD") else None)
    weight = "gravity" if 1 / _WEIGHT < carried < _WEIGHT else f"{carried:.2g} times gravity, as it moves"
    reason = f"{_called(named)}; z has a median of {vertical:.3g} in flight: {weight}, in {unit}"
    if named.unit not in (None, unit):
        seen.warnings.append(f"{named.group.pattern} is said to be in {named.unit}; its size says {unit}")
    if body is None or body == up:
        seen.tell(named, unit, reason, "data", scale=scale)
    else:
        reason += f", and points the wrong way for {body}, so it is gravity that is logged, not what carries it"
        others = (
            Rival("sign: [1, -1, -1]", "where its y and z point the other way than those of all others"),
            Rival("sign: [1, 1, -1]", "where its z alone does; a push or a lean on the ground along x and y decides"),
        )
        seen.tell(named, unit, reason, "guess", scale=scale, sign=(-1.0, -1.0, -1.0), rivals=others)
    words = f"gravity stays in z (median {vertical:.3g}) in flight"
    seen.choose("acceleration_frame", "body-specific-force", words, "data")
    if body is None:
        points = "up" if up == "FLU" else "down"
        words = f"the accelerometer reads {vertical:.3g} along z, so z points {points}"
        # Some log gravity itself, which points down.
        other = Rival("body_frame: FLU", "where the accelerometer logs gravity, not what carries the vehicle")
        seen.choose("body_frame", up, words, *(("data",) if up == "FLU" else ("guess", other)))


# Frames.


def _tell_frames(seen: _Seen, reading: Reading | None) -> None:
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


def _tell_wrench(seen: _Seen) -> None:
    """Take torque and thrust where the log has no rotors; beside rotors they are what a controller asked for."""
    torque, thrust, rate = seen.first("body_torque"), seen.first("thrust"), seen.guesses.get("body_rate")
    if torque is None:
        return
    if seen.guesses.keys() & set(ROTORS) or rate is None:
        seen.left_out.append(f"{torque.group.pattern}: looks like a torque that is asked for; the rotors say more")
        return
    turning = first_derivative(seen.log.on_grid(rate.columns.columns)[seen.part], seen.rate_hz)
    shares = [_follows(turning, seen.grid(torque), late, seen.rate_hz) for late in _LATE_S]
    share = max(shares, key=min)
    if not min(share) > _FOLLOWS:
        seen.left_out.append(f"{torque.group.pattern}: looks like a torque, and the motion does not follow it")
        return
    reason = (
        f"{_called(torque)}; the angular acceleration follows it (correlation {share[0]:.2f} about roll,"
        f" {share[1]:.2f} about pitch); a commanded one is what a controller asked for"
    )
    scale = () if torque.unit else (Rival("unit: N mm", "inertia, which no log states, makes the scale"),)
    seen.tell(torque, torque.unit or "N m", reason, "named" if torque.unit else "guess", rivals=scale)
    if thrust is not None:
        level = f"{float(np.median(seen.grid(thrust))):.3g}"
        seen.tell(thrust, "N", f"{_called(thrust)}; {level} in flight, which has to be the weight in N", "guess")


def _follows(turning: Array, torque: Array, late_s: float, rate_hz: float) -> list[float]:
    """Correlate angular acceleration with a torque some time before, about roll and pitch."""
    steps = round(late_s * rate_hz)
    own = slow(turning[steps:], rate_hz, _TORQUE_HZ)
    other = slow(torque[: len(torque) - steps], rate_hz, _TORQUE_HZ)
    still = own.std(axis=0) * other.std(axis=0) == 0
    return [0.0 if still[axis] else float(np.corrcoef(own[:, axis], other[:, axis])[0, 1]) for axis in range(2)]


def _tell_voltage(seen: _Seen) -> None:
    voltage = seen.first("voltage")
    if voltage is None:
        return
    level = float(np.median(seen.grid(voltage)))
    scale = 1e-3 if voltage.unit is None and level > 1000 else 1.0
    reason = f"{_called(voltage)}; {level * scale:.3g} V in flight"
    seen.tell(voltage, "V", reason, "named", scale=scale, required=False)


def _tell_rotors(seen: _Seen, rotors: RotorColumns) -> tuple[Array | None, MovedBy | None]:
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


def _doubt_columns(seen: _Seen) -> None:
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


def _gathered(seen: _Seen, flown: Flown, speeds: Array | None, moved: MovedBy | None, kind: str) -> Recognition:
    log = seen.log
    signals = tuple(seen.guesses[name] for name in _ORDER if name in seen.guesses)
    rates = {guess.signal: log.rate_hz(guess.columns.columns) for guess in signals}
    # An accelerometer is often logged faster than all that matters more.
    clocked = [guess for guess in signals if guess.signal not in ("voltage", "acceleration")] or list(signals)
    base = max(clocked, key=lambda guess: rates[guess.signal])
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
