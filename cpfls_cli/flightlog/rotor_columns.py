"""Which columns drive the rotors or say how fast they turn, in which unit, and which of them are connected."""

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import product
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, IntArray, runs
from cpfls_cli.errors import InputError
from cpfls_cli.flightlog.names import Named
from cpfls_cli.flightlog.recognised import Guess, KeyChoice, LogTable, Rival, Sure
from cpfls_cli.flightlog.settings import SignalMap
from cpfls_cli.flightlog.stated_vehicle import (
    AIRPLANE,
    FAST_HZ,
    MOTORS,
    NO_MULTIROTOR,
    SLOW_HZ,
    VTOL_TYPES,
    Parameters,
    count_by_form,
    lifting_rotors,
    log_faster,
    stated_count,
    whole,
)
from cpfls_cli.flightlog.topics import logged_hz
from cpfls_cli.flightlog.vocabulary import AIMED, ARDUPILOT, ASKED, BETAFLIGHT, CRAZYFLIE, PARROT, PX4, RANGES
from cpfls_cli.units import SPEED_UNITS, UnitName
from cpfls_cli.words import joined

_FEWEST = 3  # Rotors of a multirotor.
# Times as often that commands have to come to be preferred to measured speeds, or rebuilt ones to logged ones.
FASTER = 2.0
_USUAL_POLE_PAIRS = 7
_RPM_FROM = 4000.0  # Faster than rotors turn in rad/s; the smallest reach 3000.
_FEWEST_SAMPLES = 20  # For medians and rates.
_MIXED = ("controller.cmd_thrust", "controller.cmd_roll", "controller.cmd_pitch", "controller.cmd_yaw")
# Of M1 to M4 the factors of these columns: power_distribution_quadrotor.c of the firmware.
_CRAZYFLIE_MIXER = ((1.0, -0.5, 0.5, 1.0), (1.0, -0.5, -0.5, -1.0), (1.0, 0.5, -0.5, 1.0), (1.0, 0.5, 0.5, -1.0))
# Means of so long, s; least command that counts, and least spread of the changes of their logarithms.
_MEAN_S, _IDLE, _LEAST_SPREAD = 0.5, 0.05, 0.02
# Powers that are between those of a thrust and of a speed, or near them, and what divides these; least correlation.
_POWERS, _BETWEEN, _CORRELATED = (0.35, 1.4), float(np.sqrt(0.5)), 0.9
_ORTHOGONAL = 1e-2  # Median by which products of the rows of a rotation matrix are off those of the unit matrix.
_SAME = 0.02  # Part of the largest one's spread below which an output is not connected to a motor.
# Share of the changes of the others below which an output is moved by hand or by a timer, and not by a controller.
_SELDOM = 0.1
# Share of its range from its least up to which an output stands, and beyond which it drives; how long the motors have
# to stand for it to be known from which on, s, and the share away from it that no motor has then.
_AT_REST, _DRIVES, _STANDS_S, _AWAY = 0.02, 0.25, 1.0, 0.25
# Correlation with the others below which an output does not rise with them, and how many times as far as the others it
# swings then, within s: about one axis, a rotor of a hexarotor does twice as much as another.
_RISES, _SWINGS, _SWING_S = 0.3, 2.5, 0.25
_SURFACES = "before take-off one is off and the others stand in their middle"
_FEWEST_BESIDE = 4  # Rotors of those whose columns hold more.
_BELOW = 0.5  # Share of how far a collective rises above nothing by which none falls below it.
_PX4_MOTORS = range(101, 113)  # Values of *_FUNCn of PX4 that are its motors.
_RANGES = (
    ("MOT_PWM_MIN", "MOT_PWM_MAX"),
    ("Q_M_PWM_MIN", "Q_M_PWM_MAX"),
    ("Q_THR_MIN_PWM", "Q_THR_MAX_PWM"),
    ("PWM_MIN", "PWM_MAX"),
    ("PWM_MAIN_MIN", "PWM_MAIN_MAX"),
)
_USUAL_PULSES = "the usual pulses: a guess, since neither MOT_PWM_MIN, MOT_PWM_MAX nor RC3_MIN, RC3_MAX is in the log"


class RotorColumns(NamedTuple):
    """All that a log says of its rotors."""

    speed: Guess | None = None
    command: Guess | None = None
    command_is: KeyChoice | None = None  # What a command of unit 1 is a share of; None without one.
    left_out: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()

    @property
    def driving(self) -> Guess | None:
        """What drives the vehicle: measured speeds, or else commands."""
        return self.speed or self.command


Found = tuple[Named, Array, Array]  # A candidate, its stamps in s and its values, shape (sample, rotor).


def find_rotors(found: Mapping[str, Sequence[Found]], parameters: Parameters, system: str) -> RotorColumns:
    """Choose the columns of rotor speeds and of rotor commands, from candidates for both, the best first."""
    # Electric speeds, whose pole pairs have to be known, come behind mechanical ones.
    speeds = sorted(found["rotor_speed"], key=lambda entry: _is_electric(entry[0]))
    (speed, odd), (command, others) = (
        next((own for each in candidates if (own := _guess(each, parameters))[0] is not None), (None, []))
        for candidates in (speeds, found["rotor_command"])
    )
    left_out = [*odd, *others]
    if speed is not None and command is not None:
        columns, counts = command.columns.columns, [len(own.columns.columns) for own in (speed, command)]
        if speed.rate_hz * FASTER < command.rate_hz:
            left_out.append(f"{left_for_commands(speed)}; the commands come at {command.rate_hz:.3g} Hz")
            speed = None
        elif counts[0] != counts[1]:
            left_out.append(f"{columns[0]} and the columns with it: {counts[1]} commands, {counts[0]} rotors")
            command = None
    warnings = [each for own in (speed, command) if own is not None for each in too_slow(own, system, parameters)]
    if speed is None and command is None:
        driven = [_connected(own, parameters).others.items() for own in found["rotor_command"]]
        if surfaces := [column for own in driven for column, why in own if why == _SURFACES]:
            raise InputError(f"a log of {AIRPLANE} or its like ({joined(surfaces)}: {_SURFACES}), {NO_MULTIROTOR}")
        warnings += [warning for own in found["rotor_command"] for warning in _beyond_commands(own, parameters)][:1]
    shares = None if command is None or command.columns.unit != "1" else command
    logged = {name for named, *_ in found["rotor_command"] for name in named.group.columns}
    power = None if shares is None or speed is None else _power(found, speed, shares)
    command_is = None if shares is None else _meaning(shares, logged, parameters, system, power)
    return RotorColumns(speed, command, command_is, tuple(left_out), tuple(warnings))


def left_for_commands(speed: Guess) -> str:
    """Say which measured speeds are left out for commands that come more often."""
    return f"{speed.columns.columns[0]} and the columns with it: rotor speeds at {speed.rate_hz:.3g} Hz"


def find_mixed(log: LogTable) -> RotorColumns | None:
    """Take what goes into the mixer of a Crazyflie for the commands of its motors; None where a log lacks it."""
    ending = _MIXED[0]
    begin = next((name.removesuffix(ending) for name in log.names if name.endswith(ending)), None)
    columns = tuple(f"{begin}{name}" for name in _MIXED)
    if begin is None or not set(columns) <= {*log.names}:
        return None
    time, values = log.values(columns)
    if len(time) < _FEWEST_SAMPLES or not np.ptp(values, axis=0).max() > 0:
        return None
    reason = (
        "the input of a Crazyflie's mixer, 16 bits; the firmware makes each motor's command from it: thrust, half of"
        " roll and pitch, and yaw, with the signs of its place"
    )
    mapped = SignalMap(columns=columns, unit="1", scale=1 / 65536, mixer=_CRAZYFLIE_MIXER)
    said = "a Crazyflie mixes thrusts, before it compensates for the battery"
    older = Rival("rotor_command_is: speed", "before 2022 the firmware passed what it had mixed to the motors")
    command = Guess("rotor_command", mapped, reason, "named", rate_hz=logged_hz(time), kind=CRAZYFLIE)
    command_is = KeyChoice("rotor_command_is", "thrust", said, "named", (older,))
    return RotorColumns(None, command, command_is, warnings=tuple(too_slow(command, CRAZYFLIE, {})))


TOO_SLOW = "the rotors are logged at"  # With which the warning begins.


def too_slow(guess: Guess, system: str, parameters: Parameters) -> Iterator[str]:
    """Say of rotors that are logged too slowly how to log them faster."""
    if guess.rate_hz < SLOW_HZ:
        yield (
            f"{TOO_SLOW} {guess.rate_hz:.3g} Hz ({guess.columns.columns[0]}): too slow for motors that"
            f" respond within some 50 ms; {log_faster('them', FAST_HZ, system, parameters=parameters)}"
        )


def _beyond_commands(found: Found, parameters: Parameters) -> Iterator[str]:
    """Say where columns that are else commands of rotors hold numbers that no command is."""
    named, time, values = found
    beyond = (values < min(own.low for own in RANGES)) | (values > max(own.high for own in RANGES))
    kept = ~beyond.any(axis=1)
    if kept.all() or kept.sum() < _FEWEST_SAMPLES or _guess((named, time[kept], values[kept]), parameters)[0] is None:
        return
    row = int(np.argmin(kept))
    index = int(np.argmax(np.abs(values).max(axis=0)))
    yield (
        f"{', '.join(named.group.columns)} look like commands of rotors except {named.group.columns[index]}, which"
        f" reaches {values[np.argmax(np.abs(values[:, index])), index]:.3g}: no command is that large, from"
        f" {time[row] - time[0]:.4g} s after the first stamp on; take the rows from there on out of the log, and run"
        " cpfls init again"
    )


def _is_electric(named: Named) -> bool:
    return "erpm" in named.group.pattern.lower()


def _guess(found: Found, parameters: Parameters) -> tuple[Guess | None, list[str]]:
    """Take columns that are connected in the unit that is stated or fits, and say which move and drive no motor."""
    named, time, values = found
    chosen = _connected(found, parameters)
    if len(chosen.outputs) < _FEWEST:
        return None, []
    columns, values = tuple(named.group.columns[index] for index in chosen.outputs), values[:, chosen.outputs]
    is_speed = named.signal == "rotor_speed"
    # What turns the other way may count downward.
    turns = np.median(values, axis=0) if is_speed else values.max(axis=0)
    sign = tuple(float(value) for value in np.where(turns < 0, -1.0, 1.0))
    values = values if is_speed else values * sign
    guess = _speed_unit(named, values, parameters) if is_speed else _command_unit(named, values, parameters, chosen)
    if guess is None or (guess.columns.offset and min(sign) < 0):
        return None, []
    sure, rivals = guess.sure, guess.rivals
    still = [column for column in named.group.columns if column not in (*columns, *chosen.others)]
    if len(columns) == _FEWEST and still and not chosen.stated:
        every = f"columns: [{', '.join(named.group.columns)}]"
        sure, rivals = "guess", (*rivals, Rival(every, f"if {', '.join(still)}, which never changes, is a rotor's"))
    if chosen.doubtful:
        every = f"columns: [{', '.join((*columns, *chosen.doubtful))}]"
        words = f"if {joined(chosen.doubtful)}, which do not rise with the others and swing further, are no servos"
        sure, rivals = "guess", (Rival(every, words), *rivals)
    mapped = replace(guess.columns, columns=columns, sign=sign if min(sign) < 0 else None)
    guess = replace(guess, columns=mapped, sure=sure, rivals=rivals, rate_hz=logged_hz(time))
    return guess, [f"{column}: {why}" for column, why in chosen.others.items()]


class _Connected(NamedTuple):
    """The outputs that drive motors, in the order of the motors."""

    outputs: list[int]
    stated: bool  # Whether parameters name them.
    others: dict[str, str]  # By column; what moves and is no motor, and why.
    # Range of the outputs that their own parameters state, and the names of these.
    span: tuple[float, float, str] | None = None
    doubtful: tuple[str, ...] = ()  # Outputs of `others` that may be motors all the same.


def _is_rotation(values: Array) -> bool:
    """Tell the nine numbers of a rotation matrix, whose rows have length 1 at right angles, by row or by column."""
    if values.shape[1] != np.size(np.eye(3)):
        return False
    matrices = values.reshape(-1, 3, 3)
    return bool(np.median(np.abs(matrices @ matrices.transpose(0, 2, 1) - np.eye(3))) < _ORTHOGONAL)


def _connected(found: Found, parameters: Parameters) -> _Connected:
    """Find the motors among outputs: by their functions, by the frame's number, or because they move together."""
    named, time, values = found
    if _is_rotation(values):
        return _Connected([], False, {})
    spread = values.std(axis=0)
    moving = [index for index, own in enumerate(spread) if own > _SAME * float(spread.max()) > 0]

    def but(why: str, motors: Sequence[int], moving: Sequence[int]) -> dict[str, str]:
        return {named.group.columns[index]: f"it moves, but {why}" for index in moving if index not in motors}

    functions = _functions(named, parameters)
    for motors, span in functions:
        if {*motors} <= {*range(values.shape[1])} and len({*motors} & {*moving}) >= _FEWEST:
            return _Connected(motors, True, but("no function of a motor", motors, moving), span)
    lifting = lifting_rotors(parameters) if named.known == PX4 and "output" not in named.group.pattern else []
    if _FEWEST <= len(lifting) <= values.shape[1]:
        return _Connected(lifting, True, {})
    if functions:
        # The motors are connected elsewhere.
        return _Connected([], True, {})
    odd = _other_functions(named, parameters, moving)
    odd |= _driven_apart(time, values, [index for index in moving if index not in odd])
    kept = [index for index in moving if index not in odd]
    others = {named.group.columns[index]: why for index, why in odd.items()}
    if not parameters and named.signal == "rotor_command" and _surfaces(time, values[:, kept]):
        return _Connected([], True, dict.fromkeys([named.group.columns[index] for index in kept], _SURFACES))
    count = stated_count(parameters) or count_by_form(parameters, len(kept))
    if named.known in (PX4, ARDUPILOT) and count is not None and {*range(count)} <= {*kept}:
        motors = list(range(count))
        return _Connected(motors, True, others | but(f"the frame has {count} motors", motors, kept))
    apart = _swung_apart(time, values, kept)
    servos = tuple(named.group.columns[index] for index in apart)
    others |= dict.fromkeys(servos, "it does not rise with the others and swings further: a servo?")
    return _Connected([index for index in kept if index not in apart], False, others, doubtful=servos)


def _surfaces(time: Array, values: Array) -> bool:
    """Tell whether all outputs but one, which is off, stand away from their least: surfaces and a throttle."""
    changed = np.flatnonzero((values != values[:1]).any(axis=1))
    if values.shape[1] <= _FEWEST or not len(changed) or time[changed[0]] - time[0] < _STANDS_S:
        return False
    begins = (values[0] - values.min(axis=0)) / np.maximum(np.ptp(values, axis=0), 1e-12)
    # A throttle that is off is below all surfaces; an output that only rises from a hover is not.
    off = values[0, np.argmin(begins)] - values.min() <= _AT_REST * np.ptp(values)
    begins = np.sort(begins)
    return bool(off and begins[0] <= _AT_REST < begins[1] and np.median(begins[1:]) > _AWAY)


def _swung_apart(time: Array, values: Array, kept: Sequence[int]) -> list[int]:
    """List outputs that swing far and not with the rest, which lifts: surfaces among motors, where nothing says so."""
    rows = max(1, round(_SWING_S / float(np.median(np.diff(time)))))
    if len(kept) <= _FEWEST_BESIDE or len(time) < _FEWEST_SAMPLES + rows:
        return []
    own = values[:, kept]
    changes = own[rows:] - own[:-rows]
    sizes = np.quantile(np.abs(changes), 0.9, axis=0)
    apart = []
    for index in np.flatnonzero((sizes > _SWINGS * np.median(sizes)) & (np.median(sizes) > 0)).tolist():
        common = np.median(np.delete(own, index, axis=1), axis=1)
        if np.ptp(common) == 0 or np.corrcoef(common, own[:, index])[0, 1] < _RISES:
            apart.append(kept[index])
    return apart if len(kept) - len(apart) >= _FEWEST_BESIDE else []


def _other_functions(named: Named, parameters: Parameters, moving: Sequence[int]) -> dict[int, str]:
    """List outputs of an ArduPilot that have another function than a motor."""
    if named.known != ARDUPILOT or named.signal != "rotor_command":
        return {}
    keys = {f"{prefix}{index + 1}_FUNCTION": index for index in moving for prefix in ("SERVO", "RC")}
    numbers = {key: whole(parameters, key) or 0 for key in keys}
    return {
        index: f"it moves, but {key} = {numbers[key]}: no motor"
        for key, index in keys.items()
        if numbers[key] not in (0, *MOTORS)
    }


def _functions(named: Named, parameters: Parameters) -> list[tuple[list[int], tuple[float, float, str] | None]]:
    """List by each group of parameters that give outputs a function the outputs of motors, from 0, and their range."""
    if named.signal != "rotor_command":
        return []
    found: dict[str, dict[int, int]] = {}
    if named.known == ARDUPILOT:
        for prefix, output in product(("SERVO", "RC"), range(1, len(named.group.columns) + 1)):
            number = whole(parameters, f"{prefix}{output}_FUNCTION")
            if number in MOTORS:
                found.setdefault(prefix, {})[MOTORS.index(number)] = output - 1
    elif named.known == PX4 and "output" in named.group.pattern:
        for name in sorted(parameters):
            own = re.fullmatch(r"(\w+)_FUNC(\d+)", name)
            number = whole(parameters, name) if own else None
            if own and number is not None and number in _PX4_MOTORS:
                found.setdefault(own[1], {})[number] = int(own[2]) - 1
        if not found and whole(parameters, "MAV_TYPE") in VTOL_TYPES:
            # Before 1.13 a VTOL names the outputs of the rotors that carry it by their digits.
            digits = str(whole(parameters, "VT_MOT_ID") or "")
            found["VT_MOT"] = {number: int(digit) - 1 for number, digit in enumerate(digits) if digit != "0"}
    motors = {prefix: [own[number] for number in sorted(own)] for prefix, own in found.items()}
    return [(own, _span(prefix, own, parameters)) for prefix, own in motors.items() if len(own) >= _FEWEST]


def _span(prefix: str, outputs: Sequence[int], parameters: Parameters) -> tuple[float, float, str] | None:
    """Give the range that PX4 states of each output, where it is that of all motors."""
    ends = {tuple(float(parameters.get(f"{prefix}_{end}{own + 1}", 0)) for end in ("MIN", "MAX")) for own in outputs}
    low, high = ends.pop() if len(ends) == 1 else (0.0, 0.0)
    return (low, high, f"{prefix}_MIN and _MAX of the log") if low < high else None


def _driven_apart(time: Array, values: Array, moving: Sequence[int]) -> dict[int, str]:
    """List outputs that do not move as a motor does, with the reason: a camera, a gimbal or a landing gear.

    What drives a motor changes as often as what drives the others, and stands at its least while they do before they
    fly.
    """
    if len(moving) <= _FEWEST:
        return {}
    own = values[:, moving]
    changes = (np.diff(own, axis=0) != 0).mean(axis=0)
    odd = {
        moving[index]: f"it moves, but changes in {100 * share:.2g} % of the rows where the others do in"
        f" {100 * float(np.median(changes)):.2g} %: no motor"
        for index, share in enumerate(changes)
        if share < _SELDOM * float(np.median(changes))
    }
    most = max(_FEWEST, (len(moving) + 1) // 2)
    driven = (own - own.min(axis=0)) / np.ptp(own, axis=0)
    stands = np.zeros(len(time), dtype=bool)
    # Before they first drive: a controller that lost its vehicle may hold one motor at full and all others at rest.
    for first, after in runs((driven <= _AT_REST).sum(axis=1) >= most):
        before = not ((driven[:first] > _DRIVES).sum(axis=1) >= most).any()
        stands[first:after] = before and time[after - 1] - time[first] >= _STANDS_S
    if stands.any():
        level = np.median(driven[stands], axis=0)
        odd |= {
            moving[index]: "it keeps above its lowest value while the motors are off: no motor"
            for index, share in enumerate(level)
            if share > _AWAY and moving[index] not in odd
        }
    return odd if len(moving) - len(odd) >= _FEWEST else {}


def _in_unit(
    named: Named, unit: UnitName, scale: float, reason: str, sure: Sure, *rivals: Rival, offset: float = 0.0
) -> Guess:
    mapped = SignalMap(columns=named.group.columns, unit=unit, scale=scale, offset=offset)
    return Guess(named.signal, mapped, reason, sure, rivals, kind=named.known)


def _speed_unit(named: Named, values: Array, parameters: Parameters) -> Guess:
    size = np.abs(values)
    level = float(np.median(size[size >= 0.3 * float(size.max())]))
    called = f"called {named.group.pattern}, {level:.4g} in flight"
    if _is_electric(named):
        factor = 100.0 if named.known == BETAFLIGHT else 1.0
        poles = float(parameters.get("motor_poles", 0) or 0)
        if poles:
            reason = f"{called}: electrical speed, divided by motor_poles {poles:.0f} / 2 of the header"
            return _in_unit(named, "rpm", factor / (poles / 2), reason, "named")
        rival = Rival(f"scale: {factor / 6:.6g}", "six pole pairs; the log does not say how many the motors have")
        reason = f"{called}: electrical speed, divided by 7 pole pairs, a usual number"
        return _in_unit(named, "rpm", factor / _USUAL_POLE_PAIRS, reason, "guess", rival)
    if named.unit is not None:
        return _in_unit(named, named.unit, named.scale, f"{called}: {named.unit} by its name", "named")
    if level > _RPM_FROM:
        return _in_unit(named, "rpm", 1.0, f"{called}: faster than any rotor in rad/s", "data")
    return _in_unit(named, "rad/s", 1.0, called, "guess", Rival("unit: rpm", f"a level of {level:.4g} fits both"))


def _command_unit(named: Named, values: Array, parameters: Parameters, chosen: _Connected) -> Guess | None:
    """Tell the unit of commands: parameters and the name first, then the first of `RANGES` that holds the numbers."""
    low, high = float(values.min()), float(np.quantile(values, 0.999))
    called = f"called {named.group.pattern}, up to {high:.4g}"
    stated = chosen.span or _stated_range(named, parameters)
    # Pulses are stated of outputs that send numbers in another way too, such as DShot.
    driven = values[values > 0]
    if stated is not None and len(driven) and stated[0] <= float(np.median(driven)) <= stated[1]:
        begin, end, where = stated
        reason, scale = f"{called}: {begin:g} to {end:g} by {where}", 1 / (end - begin)
        sure: Sure = "guess" if where == _USUAL_PULSES else "named"
        return _in_unit(named, "1", scale, reason, sure, offset=-begin / (end - begin))
    if named.known in (CRAZYFLIE, PARROT) and 1 < high <= 1 / named.scale:
        return _in_unit(named, "1", named.scale, f"{called}: of {1 / named.scale:.0f}, as on a {named.known}", "named")
    words = {*named.group.words}
    if named.unit in SPEED_UNITS or words & {"om", "omega", "omcmd", "rpm", "rads", "speed", "rad", "w", "n"}:
        unit = named.unit or ("rpm" if high > _RPM_FROM else "rad/s")
        rivals = () if named.unit or unit == "rpm" else (Rival("unit: rpm", "its size fits both"),)
        sure = "guess" if rivals else "named"
        return _in_unit(named, unit, named.scale, f"{called}: a commanded speed", sure, *rivals)
    if named.unit == "1" and named.scale != 1.0 and named.known not in (CRAZYFLIE, PARROT):
        return _in_unit(named, "1", named.scale, f"{called}: per cent by its name", "named")
    least, most = np.quantile(values.mean(axis=1), (0.1, 0.9))
    if not named.known and not words & {"motor", "motors", "rotor", "rotors"} and least < -_BELOW * most:
        # What carries a vehicle does not swing about nothing: these are asked of its axes.
        return None
    own = next((own for own in RANGES if low >= own.low and own.high_from < high <= own.high), None)
    if own is None:
        return None
    clear = own.clear == "always" or (own.clear == "of commands" and bool(words & (ASKED | AIMED)))
    others = [Rival(*own.rival)] if own.rival else []
    if not (clear or named.unit == "us" or "pwm" in words):
        others += [Rival(f"unit: {unit}", f"if it is a speed, up to {high:.4g}") for unit in ("rad/s", "rpm")]
    sure = "data" if clear and not others else "guess"
    return _in_unit(named, "1", own.scale, f"{called}: {own.words}", sure, *others, offset=own.offset)


def _stated_range(named: Named, parameters: Parameters) -> tuple[float, float, str] | None:
    """Give the range of outputs that the log's parameters state."""
    if named.known == BETAFLIGHT and "motorOutput" in parameters:
        low, high = (float(part) for part in str(parameters["motorOutput"]).split(",")[:2])
        return low, high, "motorOutput of the header"
    for low_name, high_name in _RANGES:
        low, high = (float(parameters.get(name, 0) or 0) for name in (low_name, high_name))
        if 500 < low < high and ("output" in named.group.pattern or named.known == ARDUPILOT):
            return low, high, f"{low_name} and {high_name} of the log"
    if named.known == ARDUPILOT:
        # Where both are 0, and before they were, motors have the range of the throttle's stick.
        stick = whole(parameters, "RCMAP_THROTTLE") or 3
        low, high = (float(parameters.get(f"RC{stick}_{end}", 0) or 0) for end in ("MIN", "MAX"))
        where = f"RC{stick}_MIN and RC{stick}_MAX of the log, since MOT_PWM_MIN and MOT_PWM_MAX are not set"
        if 500 < low < high:
            return low, high, where
        return 1000.0, 2000.0, _USUAL_PULSES
    return None


def _power(found: Mapping[str, Sequence[Found]], speed: Guess, command: Guess) -> float | None:
    """Find the power of commands that measured speeds grow with, by changes of means over longer than a rotor's lag.

    A battery that sags falls out of changes. None where speeds do not follow commands, as a lag or noise has it.
    """

    def means(guess: Guess) -> tuple[IntArray, Array]:
        own = next(each for each in found[guess.signal] if {*guess.columns.columns} <= {*each[0].group.columns})
        columns = [own[0].group.columns.index(column) for column in guess.columns.columns]
        window, counts = np.unique((own[1] // _MEAN_S).astype(int), return_counts=True)
        begins = np.cumsum(counts) - counts
        values = np.abs(own[2][:, columns] * guess.columns.scale + guess.columns.offset)
        return window, np.add.reduceat(values, begins, axis=0) / counts[:, None]

    (turned, speeds), (asked, commands) = means(speed), means(command)
    _, first, second = np.intersect1d(turned, asked, return_indices=True)
    running = (commands[second].min(axis=1) > _IDLE) & (speeds[first].min(axis=1) > 0)
    next_one = np.diff(turned[first][running]) == 1
    x, y = (np.diff(np.log(each[running]), axis=0)[next_one].ravel() for each in (commands[second], speeds[first]))
    if len(x) < _FEWEST_SAMPLES or x.std() < _LEAST_SPREAD or y.std() == 0 or np.corrcoef(x, y)[0, 1] < _CORRELATED:
        return None
    power = float(y.std() / x.std())
    return power if _POWERS[0] < power < _POWERS[1] else None


def _meaning(
    command: Guess, logged: Collection[str], parameters: Parameters, system: str, power: float | None
) -> KeyChoice:
    """Tell whether a command is a share of thrust or of speed, by what other columns of commands there are too."""

    def choose(value: str, reason: str, *rivals: Rival, sure: Sure = "named") -> KeyChoice:
        return KeyChoice("rotor_command_is", value, reason, sure, rivals)

    if command.kind == CRAZYFLIE:
        if "motor.m" not in command.columns.columns[0]:
            return choose("speed", "pwm.* of a Crazyflie is what the motors get")
        if any("pwm.m" in name for name in logged):
            said = "motor.m* of a Crazyflie that logs pwm.m* too are thrusts, before it compensates for the battery"
            return choose("thrust", said)
        before = "of firmware before November 2022 they are thrusts, before it compensates for the battery"
        said = "motor.m* of a Crazyflie are what the motors get, by its firmware since November 2022"
        return choose("speed", said, Rival("rotor_command_is: thrust", before))
    if command.kind == PARROT:
        return choose("thrust", "MathWorks' model makes the commands of a Parrot minidrone of thrusts")
    if parameters.get("THR_MDL_FAC") is not None:
        value = float(parameters["THR_MDL_FAC"])
        said = f"THR_MDL_FAC is {value:g}"
        if value >= 0.9:
            return choose("thrust", f"{said}: the autopilot treats commands as shares of thrust")
        if value <= 0.1:
            return choose("speed", f"{said}: the autopilot passes commands on as they are")
        rival = Rival("rotor_command_is: thrust", f"{said}, which lies between the two")
        return choose("speed", f"{said}, between speed (0) and thrust (1)", rival, sure="guess")
    if "MOT_THST_EXPO" in parameters or system.startswith("Ardu"):
        return choose("speed", "RCOU is what the motors get, after the autopilot's own thrust curve")
    if power is not None:
        meant, other = ("thrust", "speed") if power < _BETWEEN else ("speed", "thrust")
        said = f"measured speeds grow with the commands to the power of {power:.2g}: 1 for a speed, 0.5 for a thrust"
        # Motors that idle at a command of 0 have powers between.
        return choose(meant, said, Rival(f"rotor_command_is: {other}", "idling motors change the power"), sure="guess")
    rival = Rival("rotor_command_is: thrust", "the log does not say which")
    reason = f"as with most motor controllers{f' ({system})' if system else ''}"
    return choose("speed", reason, rival, sure="guess")
