"""What was asked of an autopilot: columns of setpoints and sticks, held against what was measured."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.flightlog.agreement import correlations, slow
from cpfls_cli.flightlog.conversion import as_mapped, attitude_from_quaternion
from cpfls_cli.flightlog.names import column_groups, is_of, lists_all, wished_signals
from cpfls_cli.flightlog.recognised import Guess, LogTable, Rival, Seen
from cpfls_cli.flightlog.repair import unwrap_angles
from cpfls_cli.flightlog.settings import SETPOINTS, SignalMap, SignalName
from cpfls_cli.flightlog.stated_vehicle import Parameters
from cpfls_cli.flightlog.topics import hold_asked
from cpfls_cli.flightlog.vocabulary import ARDUPILOT, CRAZYFLIE, KNOWN
from cpfls_cli.units import UnitName, known_unit

_FEWEST_SAMPLES = 20
_FEWEST_COMPARED = 100  # Of the one clock, a second of flight.
# Correlations from which on what is measured follows what is asked for, and runs against it.
_FOLLOWS, _OPPOSES = 0.6, -0.8
_MOVES = 0.25  # As large as what is measured from which on a setpoint moves: one that stays shows nothing of a drift.
_LATE_S = (0.0, 0.05, 0.1, 0.2, 0.4, 0.8)  # By which a vehicle follows, s.
_MOTION_HZ = 5.0  # Below which a vehicle follows anything; above there is the noise of sensors.
_HELD_S = 0.1
# As large or as small as what is measured that a setpoint may be; a loop follows with an error, not with a factor.
_TIMES, _TIMES_BY_WORDS = 3.0, 1.6
_LARGEST_ANGLE = 4 * np.pi  # In rad; larger ones are degrees.
_BOUND = 0.15  # Of a turn that an error spreads at most; one that is drawn at random does over 0.29.
_FULL = 1.05  # Share of full deflection, or of the largest thrust, up to which one is believed.
# What setpoints may be in where no name says it.
_UNITS: Final[dict[SignalName, tuple[UnitName, ...]]] = {
    "setpoint_position": ("m", "mm"),
    "setpoint_velocity": ("m/s", "mm/s"),
    "setpoint_attitude": ("rad", "deg"),
    "setpoint_body_rate": ("rad/s", "deg/s"),
}
_REFERENCE: Final = "a reference may be a second measurement instead of a setpoint"
_RC_MAP: Final = ("RCMAP_ROLL", "RCMAP_PITCH", "RCMAP_YAW", "RCMAP_THROTTLE")


class _Candidate(NamedTuple):
    """Columns that may be a setpoint, as they would be mapped, and why they may be, in words."""

    signal: SignalName
    columns: SignalMap
    called: str
    # Whether a kind of log is known for them, so that unit and signs are; else only words of the name say it.
    known: bool
    units: tuple[UnitName, ...] = ()  # That it may be in, where none is stated.
    doubts: tuple[str, ...] = ()  # Why they may be something else, however well they are followed.


def take_setpoints(seen: Seen, parameters: Parameters, system: str) -> None:
    """Take columns for setpoints that what was measured follows, and for sticks and thrust those of known logs."""
    candidates = list(_of_known_logs(seen.log, parameters, system))
    if not lists_all(system):
        known = {column for own in candidates for column in own.columns.columns}
        candidates += [own for own in _by_words(seen) if not known & {*own.columns.columns}]
    for name in SETPOINTS:
        judged = [_judged(seen, own) for own in candidates if own.signal == name and _changes(seen.log, own)]
        taken = [own for own in judged if isinstance(own, Guess)]
        if taken:
            # The first that is sure; what a controller is given stands before what it makes of it.
            seen.guesses[name] = min(taken, key=lambda guess: guess.sure == "guess")
        elif judged:
            seen.left_out += [own for own in judged if isinstance(own, str)]
            seen.unfollowed.append(name)


def _of_known_logs(log: LogTable, parameters: Parameters, system: str) -> Iterator[_Candidate]:
    # On its card a Crazyflie puts the name of an event before that of a variable.
    events = tuple(f"{topic}." for topic in log.topics) if system.startswith(CRAZYFLIE) else ("",)
    for name, row in ((name, row) for row in KNOWN for name in SETPOINTS if name == row.signal):
        own = row.columns
        if row.system == ARDUPILOT and name == "sticks":
            # On the channels that its parameters name.
            given = zip((parameters.get(key) for key in _RC_MAP), own, strict=True)
            own = tuple(usual if stated is None else f"RCIN.C{int(float(stated))}" for stated, usual in given)
        for event in () if system and not is_of(system, row.system) else events:
            columns = tuple(f"{event}{column}" for column in own)
            if {*columns} <= {*log.names}:
                mapped = SignalMap(
                    columns=columns,
                    unit=row.unit or "1",
                    scale=row.scale,
                    offset=row.offset,
                    sign=row.sign,
                    required=False,
                )
                mapped = _in_stated_unit(log, name, mapped)
                yield _Candidate(name, mapped, f"a log of {row.system} calls it so", True)


def _in_stated_unit(log: LogTable, signal: SignalName, mapped: SignalMap) -> SignalMap:
    """Let the unit that a log states win over the one that its kind is known for."""
    unit = log.stated_unit(mapped.columns[0], signal) if len(mapped.columns) == 3 else None
    return mapped if unit is None else replace(mapped, unit=unit, scale=1.0, offset=0.0)


def _by_words(seen: Seen) -> Iterator[_Candidate]:
    groups = column_groups(seen.log.names)
    measured = seen.guesses.get("attitude")
    axes = () if measured is None else measured.columns.columns
    # A matrix of angles that is asked for begins as the measured one does.
    held = next((own.columns for own in groups if own.kind == "numbers" and {*own.columns} == {*axes}), ())
    ahead = [held.index(column) for column in axes if held]
    for named in wished_signals(groups):
        columns, unit = named.group.columns, named.unit
        if named.group.kind == "wxyz" and seen.quaternion_order == "xyzw":
            columns = (*columns[1:], columns[0])
        if named.signal == "setpoint_attitude" and named.group.kind == "numbers" and len(columns) == len(ahead):
            columns = tuple(columns[place] for place in ahead)
        units = _UNITS.get(named.signal, ())
        if unit is None and not units:
            seen.left_out.append(f"{named.group.pattern}: looks like a commanded thrust, but in no stated unit")
            continue
        mapped = SignalMap(columns=columns, unit=unit or units[0], scale=named.scale, required=False)
        if len(columns) == 4 and (turned := seen.guesses.get("quaternion")) is not None:
            # As the attitude: its inverse, or in other axes.
            mapped = replace(mapped, sign=turned.columns.sign)
        mapped = _in_stated_unit(seen.log, named.signal, mapped)
        units = () if unit is not None or mapped.columns[0] in seen.log.units else units
        doubts = (_REFERENCE,) if {"ref", "reference"} & {*named.group.words} else ()
        yield _Candidate(named.signal, mapped, f"called {named.group.pattern}", False, units, doubts)


def _what(own: _Candidate) -> str:
    return SETPOINTS[own.signal].replace("_", " ")


def _changes(log: LogTable, own: _Candidate) -> bool:
    values = [log.values((column,))[1] for column in own.columns.columns]
    return all(len(one) >= _FEWEST_SAMPLES for one in values) and any(np.ptp(one) > 0 for one in values)


def _judged(seen: Seen, own: _Candidate) -> Guess | str:
    """Make a guess of a candidate, or say why it is none."""
    # In the part that is flown, as it would be mapped, in SI; NaN where absent.
    samples = (seen.log.values((column,)) for column in own.columns.columns)
    held = [hold_asked(time, values[:, 0], seen.log.grid[seen.part], _HELD_S) for time, values in samples]
    asked = known_unit(own.columns.unit).factor * as_mapped(np.column_stack(held), own.columns)
    if own.signal in ("setpoint_thrust", "sticks"):
        return _by_range(own, asked)
    measured, columns, what = _measured(seen, own.signal), ", ".join(own.columns.columns), _what(own)
    if measured is None:
        against = f"there is no {what} to compare it with"
        if own.known:
            return Guess(own.signal, own.columns, f"{own.called}; {against}", "named")
        return f"{columns}: looks like a setpoint of the {what}, but {against}"
    if own.signal == "setpoint_attitude":
        asked = _as_angles(seen, own, asked, measured)
    factors = tuple(known_unit(unit).factor for unit in own.units) or (1.0,)
    fit = _follow(measured, asked, seen.rate_hz, factors)
    if fit.followed.any():
        return _by_motion(own, fit)
    return (
        f"{columns}: looks like a setpoint of the {what}, which does not follow it; if gusts are "
        f"why, state it as import.signals.{own.signal}"
    )


def _by_range(own: _Candidate, asked: Array) -> Guess | str:
    """Judge shares by their range; nothing that is measured is in their unit."""
    columns, known = ", ".join(own.columns.columns), asked[np.isfinite(asked)]
    if not len(known):
        return f"{columns}: {own.called}, but it is absent in flight"
    largest = float(np.quantile(np.abs(known), 0.999))
    what = "the largest thrust" if own.signal == "setpoint_thrust" else "full deflection"
    if own.columns.unit == "1" and largest > _FULL:
        return f"{columns}: {own.called}, but reaches {largest:.3g} times {what}"
    if own.signal == "setpoint_thrust" and not float(np.median(known)) > 0:
        return f"{columns}: {own.called}, but it does not lift"
    unit = f"shares of {what}" if own.columns.unit == "1" else f"in {own.columns.unit}"
    return Guess(own.signal, own.columns, f"{own.called}; {unit}, {largest:.2g} at most", "named")


def _by_motion(own: _Candidate, fit: "_Following") -> Guess | str:
    """Judge a setpoint that is followed: its unit by the size, its signs by the direction."""
    columns, mapped, gain, what = own.columns.columns, own.columns, fit.gain, _what(own)
    axes = columns if len(columns) == len(fit.along) else ("roll", "pitch", "yaw")
    opposed = [axis for axis, against in zip(axes, fit.opposed, strict=True) if against]
    if opposed and (own.known or axes is not columns):
        return f"{', '.join(columns)}: {own.called}, but the {what} runs against {', '.join(opposed)}"
    if own.units:
        unit = min(own.units, key=lambda each: abs(np.log(gain / known_unit(each).factor)))
        mapped, gain = replace(mapped, unit=unit), gain / known_unit(unit).factor
    most = _TIMES if own.known else _TIMES_BY_WORDS
    if not 1 / most < gain < most:
        size = f"the {what} is {gain:.2g} times as large, which no unit explains"
        return f"{', '.join(columns)}: {own.called}; {size}"
    if opposed:
        mapped = replace(mapped, sign=tuple(-1.0 if against else 1.0 for against in fit.opposed))
    share = f"{float(np.mean(np.abs(fit.along[fit.followed | fit.opposed]))):.2f}"
    turned = f" with {', '.join(opposed)} reversed" if opposed else ""
    size = f", in {mapped.unit} by its size" if own.units else ""
    free = fit.moves & ~fit.followed & ~fit.opposed
    loose = [axis for axis, neither in zip(axes, free, strict=True) if neither]
    doubts = [*own.doubts, *([f"the measured motion does not follow {', '.join(loose)}"] if loose else [])]
    rivals = tuple(Rival(f"leave {own.signal} out", doubt) for doubt in doubts)
    reason = f"{own.called}; the {what} follows it{turned} (correlation {share}){size}"
    return Guess(own.signal, mapped, reason, "guess" if rivals else "data", rivals)


def _measured(seen: Seen, signal: SignalName) -> Array | None:
    """Give what a setpoint is one of in the part that is flown, in SI and the axes of the log."""
    quaternion = seen.guesses.get("quaternion")
    if signal == "setpoint_attitude" and quaternion is not None:
        return attitude_from_quaternion(seen.mapped(quaternion), seen.quaternion_order)
    guess = seen.guesses.get(SETPOINTS[signal])
    if guess is None:
        return None
    values = seen.mapped(guess)
    return np.column_stack([unwrap_angles(v) for v in values.T]) if signal == "setpoint_attitude" else values


def _as_angles(seen: Seen, own: _Candidate, asked: Array, measured: Array) -> Array:
    """Give an attitude that is asked for as angles in the unit that is stated, within half a turn of those measured."""
    is_quaternion = asked.shape[1] > measured.shape[1]
    known = np.isfinite(asked).all(axis=1) & (asked.any(axis=1) | (not is_quaternion))
    angles, turn = np.full_like(measured, np.nan), 2 * np.pi
    if not known.any():
        return angles
    angles[known] = attitude_from_quaternion(asked[known], seen.quaternion_order) if is_quaternion else asked[known]
    if own.units and not is_quaternion and float(np.max(np.abs(asked[known]))) > _LARGEST_ANGLE:
        turn = 360.0
    near = measured * turn / (2 * np.pi)
    error = np.mod(angles - near + turn / 2, turn) - turn / 2
    # What has nothing to do with an attitude that turns round and round is within half a turn of it as well.
    bound = np.nanstd(error, axis=0) < _BOUND * turn
    free = np.column_stack([unwrap_angles(own, turn) for own in angles.T])
    return np.asarray(np.where(bound, near + error, free))


class _Following(NamedTuple):
    """How what is measured follows what was asked for, axis by axis."""

    along: Array = np.zeros(3)  # Shape (3,); correlation; 0 where one of the two does not move.
    moves: BoolArray = np.zeros(3, dtype=bool)  # Shape (3,); whether the setpoint does.
    gain: float = 1.0  # Measured over asked for, of the axes that are followed; of others that oppose, its size.

    @property
    def followed(self) -> BoolArray:
        """Axes that follow, shape (3,)."""
        return np.asarray(self.along > _FOLLOWS, dtype=bool)

    @property
    def opposed(self) -> BoolArray:
        """Axes that run the other way, shape (3,)."""
        return np.asarray(self.along < _OPPOSES, dtype=bool)


def _follow(measured: Array, asked: Array, rate_hz: float, factors: tuple[float, ...]) -> _Following:
    """Correlate what is measured with what was asked for some time before, as late as it follows best.

    Both are of shape (time, 3), the latter NaN where nothing is; one of the factors makes it as large as the former.
    """
    smooth, known = slow(measured, rate_hz, _MOTION_HZ), np.isfinite(asked)
    # In the same band, or what asks for a short move is larger than what follows it.
    share = slow(known.astype(float), rate_hz, _MOTION_HZ)
    within = slow(np.where(known, asked, 0.0), rate_hz, _MOTION_HZ) / np.maximum(share, 0.5)
    within[share < 0.5] = np.nan
    tried = (_at_delay(smooth, within, round(late * rate_hz), factors) for late in _LATE_S)
    return max(tried, key=lambda own: float(np.sum(np.abs(own.along))))


def _at_delay(measured: Array, asked: Array, steps: int, factors: tuple[float, ...]) -> _Following:
    late, earlier = measured[steps:], asked[: len(asked) - steps]
    known = np.isfinite(earlier).all(axis=1)
    if known.sum() < _FEWEST_COMPARED:
        return _Following()
    late, earlier = (own[known] - own[known].mean(axis=0) for own in (late, earlier))
    spread, flown, shared = ((a * b).mean(axis=0) for a, b in ((earlier, earlier), (late, late), (late, earlier)))
    along = correlations(late, earlier)
    best = int(np.argmax(along))
    if not along[best] > 0:
        return _Following(moves=np.asarray(spread > 0, dtype=bool))
    gain = float(shared[best] / spread[best])
    factor = min(factors, key=lambda each: abs(np.log(gain / each)))
    moves = np.asarray(factor**2 * spread > _MOVES**2 * flown, dtype=bool)
    found = _Following(np.where(moves, along, 0.0), moves)
    sure = found.followed | found.opposed
    return found._replace(gain=float(np.abs(shared[sure]).sum() / spread[sure].sum()) if sure.any() else 1.0)
