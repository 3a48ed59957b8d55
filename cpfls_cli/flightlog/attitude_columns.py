"""How the attitude of a log is read, and all axes with it: quaternion or angles, held against all that moves.

The gyroscope follows the derivative of the attitude, the acceleration over ground its lean, the climb the thrust, and
an accelerometer senses what carries the vehicle. With other axes each of them may fit as well, since names of axes are
free; so among the readings that explain the motion as well as the best, the one is taken that reads least otherwise
than it is named. A column that disagrees with all others is then the odd one, and not they. Where another reading
takes less than twice as much, the log does not show which.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import permutations, product
from typing import TYPE_CHECKING, Final, Literal, NamedTuple

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.flightlog import agreement
from cpfls_cli.flightlog.agreement import AS_NAMED, AxisFit, Ground, LeanFit, Order, Sign, handed
from cpfls_cli.flightlog.names import Named
from cpfls_cli.flightlog.recognised import Rival, Seen, Sure, called
from cpfls_cli.flightlog.settings import SignalName
from cpfls_cli.flightlog.vocabulary import Row, sizes
from cpfls_cli.units import UnitName, known_unit

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

CLEAR: Final = 0.3  # Share of a signal that another has to explain to say something about it.
GOOD = 0.6  # Share of a signal that another has to explain to overrule a name.
NEAR_GRAVITY = 1.3  # Ratio to gravity of what is gravity in some unit, since a vehicle pushes.
# Shares by which a reading may explain less, or fly less upright, than the best and still be as good.
_AS_GOOD_RATES, _AS_GOOD_LEAN, _AS_LEVEL = 0.02, 0.1, 0.2
_ODD_ENOUGH = 2  # Price from which the columns of a quaternion are tried in every order and with every sign.
_DEGREES = 180 / np.pi
_ANGLES, SENSED = sizes("attitude"), sizes("sensed")
# Angles in rad beyond which numbers are degrees: somewhat more than a full turn, and than a lean of a quarter turn; and
# the turn of a second.
_LARGEST_ANGLE, _LARGEST_TILT, _FASTEST_TURN = 6.6, 1.7, 4 * np.pi
_NEAR: Final = 0.2  # Part of a turn, rad, that an angle moves between two samples where it jumps by a full turn.
BODY_OF: Final = {"FLU": "FLU", "ENU": "FLU", "FRD": "FRD", "NED": "FRD"}  # Body axes of logs with these other axes.
_SIGNALS_OF: Final[Mapping[str, tuple[SignalName, ...]]] = {
    "attitude": ("quaternion", "attitude"),
    "body_rate": ("body_rate",),
    "position": ("position", "velocity"),
}
_DECIDES = "a flight with one known lean, turn or climb, or the documentation of the log, decides"
Body = Literal["FLU", "FRD"]


class Attitude(NamedTuple):
    """A way to read the columns of an attitude."""

    rotation: Rotation
    # Mean vertical part of the body's third axis: near 1 in size for what flies level, negative where the axes of body
    # and world are of two kinds.
    level: float
    # Which columns are w, x, y, z (x, y, z, w where `scalar_last`), or roll, pitch and yaw, and their signs.
    order: Order
    sign: Sign
    price: int  # What of it is otherwise than named: 1 for a usual convention, else 1 for each column.
    inverse: bool = False
    scalar_last: bool = False


class Witnesses(NamedTuple):
    """What an attitude is held against."""

    time: Array  # Stamps of the attitude, s, and the clock that it is put on.
    grid: Array
    rate_hz: float
    turning: Array | None  # Shape (time, 3), or None; what is slow of the gyroscope, in any unit and any axes.
    ground: Ground | None  # What is slow of the acceleration over ground; the third axis is vertical.
    lift: Array | None  # Shape (time,), or None; what grows with the thrust.
    sensed: float  # Sign of what an accelerometer reads along its third axis; 0 without one.
    known: str | None  # Body axes that the kind of log is known for.
    free: bool  # Whether the attitude is none that the kind of log is known for.

    def read(self, rotation: Rotation, order: Order, sign: Sign, price: int, *kind: bool) -> Attitude:
        """Make a way to read columns of what they make."""
        own = agreement.on_clock(rotation, self.time, self.grid)
        return Attitude(own, float(own.as_matrix()[:, 2, 2].mean()), order, sign, price, *kind)


class Reading(NamedTuple):
    """An attitude, what its third axis points to, and the axes with which all other signals agree with it."""

    attitude: Attitude
    body: Body
    rates: AxisFit | None  # None where the vehicle hardly turns, or has no gyroscope.
    lean: LeanFit | None  # None where the lean explains too little of the motion over ground.
    place_order: Order  # Of the position's columns.
    place_sign: Sign
    place_share: float  # Share of the acceleration over ground that the lean explains with them.
    price: int  # What of all signals is read otherwise than named.
    columns: int  # How many columns that takes.

    @property
    def maps(self) -> dict[str, tuple[Order, Sign]]:
        """Order and signs of the columns of attitude, gyroscope and position."""
        own = self.attitude
        rates = AS_NAMED if self.rates is None else (self.rates.order, self.rates.sign)
        return {"attitude": (own.order, own.sign), "body_rate": rates, "position": (self.place_order, self.place_sign)}

    def differs(self, other: Reading) -> bool:
        """Tell whether another reading makes something else of the log."""
        return (self.maps, self.body, self.attitude.scalar_last) != (other.maps, other.body, other.attitude.scalar_last)

    @property
    def explained(self) -> float:
        """Share of the gyroscope that the attitude's derivative explains; 0 where there is nothing to explain."""
        return 0.0 if self.rates is None else self.rates.explained

    def beats_all(self, witnesses: Witnesses) -> bool:
        """Tell whether it is as named, and no other reading of angles can be so much better that it would be taken.

        No share is above 1, and every other way to read three angles has a price.
        """
        follows = self.explained > 1 - _AS_GOOD_RATES
        leans = witnesses.ground is None or self.place_share > 1 - _AS_GOOD_LEAN
        return self.price == 0 and follows and leans and abs(self.attitude.level) > 1 - _AS_LEVEL

    @property
    def world(self) -> str:
        """Axes of the world."""
        return "ENU" if (self.body == "FLU") == (self.attitude.level > 0) else "NED"


class TakenReading(NamedTuple):
    """The reading that is taken, and others that the data do not part from it."""

    best: Reading
    tied: tuple[Reading, ...]  # With other maps, at less than twice the price: too near to be ruled out.
    others: tuple[Reading, ...]  # All that were tried, the best one of each attitude.


def axes_price(order: Sequence[int], sign: Sequence[float]) -> int:
    """Give what it costs to read three axes in another order or with other signs.

    0 as named, 1 for a turn that keeps the third axis vertical (FLU and FRD, ENU and NED, half a turn) or for one
    mirrored column, 2 for other turns or one such turn and a mirrored column, and so on.
    """
    if (tuple(order), tuple(sign)) == AS_NAMED:
        return 0
    if handed(order, sign) > 0:
        return 1 if order[2] == 2 else 2
    mirrored = ([-own if index == axis else own for index, own in enumerate(sign)] for axis in range(3))
    return 1 + min(axes_price(order, flipped) for flipped in mirrored)


def _changed(order: Sequence[int], sign: Sequence[float]) -> int:
    return sum(place != index or own < 0 for index, (place, own) in enumerate(zip(order, sign, strict=True)))


def euler_readings(angles: Array, witnesses: Witnesses, named: bool = True) -> Iterator[Attitude]:
    """Go through angles, rad, with every sign: as named first, roll and pitch swapped, and of a matrix yaw first."""
    from scipy.spatial.transform import Rotation

    # A pitch that is positive with the nose up, a heading like that of a compass, or both, are conventions.
    usual = ((1.0, 1.0, 1.0), (1.0, -1.0, 1.0), (1.0, 1.0, -1.0), (1.0, -1.0, -1.0), (-1.0, 1.0, 1.0))
    signs = (*usual, *(own for own in product((1.0, -1.0), repeat=3) if own not in usual))
    for order, sign in product(((0, 1, 2), (1, 0, 2), *([] if named else [(2, 1, 0)])), signs):
        rotation = Rotation.from_euler("ZYX", (np.asarray(sign) * angles[:, order])[:, ::-1])
        price = (0 if sign == usual[0] else 1 if sign in usual else 2) + (0, 2, 1)[order[0]]
        yield witnesses.read(rotation, order, sign, price)


def quaternion_readings(values: Array, named: bool, witnesses: Witnesses) -> Iterator[Attitude]:
    """Go through the usual ways to read four columns: of body to world and the inverse, w first and w last.

    Where their names say which is w, they are in the order w, x, y, z, or its names are one off.
    """
    odd, as_named = (((3, 0, 1, 2), False, 1), ((1, 2, 3, 0), False, 1)), (0, 1, 2, 3)
    ways = ((as_named, False, 0), *odd) if named else ((as_named, False, 0), (as_named, True, 0))
    for inverse, (order, scalar_last, price) in product((False, True), ways):
        rotation = agreement.rotations_of(values[:, order], "xyzw" if scalar_last else "wxyz", inverse)
        back: Sign = (-1.0, -1.0, -1.0, 1.0) if scalar_last else (1.0, -1.0, -1.0, -1.0)
        yield witnesses.read(rotation, order, back if inverse else (1.0,) * 4, price + inverse, inverse, scalar_last)
    if witnesses.known and witnesses.free:
        # An attitude in FRD and NED where the kind of log has the others in FLU, or the other way round.
        for scalar_last in (False,) if named else (False, True):
            turned: Sign = (1.0, -1.0, -1.0, 1.0) if scalar_last else (1.0, 1.0, -1.0, -1.0)
            rotation = agreement.rotations_of(values * turned, "xyzw" if scalar_last else "wxyz")
            yield witnesses.read(rotation, as_named, turned, 1, False, scalar_last)


def permuted_quaternions(values: Array, witnesses: Witnesses, most: int) -> Iterator[Attitude]:
    """Go through four columns in every order and with every sign that costs no more than a price."""
    squares = (values**2).mean(axis=0)
    upright = {order: abs(squares @ np.array([1, -1, -1, 1])[np.argsort(order)]) for order in permutations(range(4))}
    for order, rest in product(upright, product((1.0, -1.0), repeat=3)):
        price = _changed(order, (1.0,) * 4) + min(rest.count(-1.0), 4 - rest.count(-1.0))
        if upright[order] > max(upright.values()) - _AS_LEVEL and 0 < price <= most:
            sign = (1.0, *rest)
            rotation = agreement.rotations_of(values[:, order] * sign, "wxyz")
            yield witnesses.read(rotation, order, sign, price, rest == (-1.0, -1.0, -1.0))


def read_axes(usual: Iterable[Attitude], witnesses: Witnesses) -> TakenReading:
    """Choose among ways to read an attitude the one that needs least to be otherwise than named."""
    tried = list(usual)
    upright = max(abs(attitude.level) for attitude in tried)
    readings = [own for a in tried if abs(a.level) > upright - _AS_LEVEL for own in _readings(a, witnesses)]
    rates = max(reading.explained for reading in readings)
    good = [own for own in readings if rates < CLEAR or own.explained > rates - _AS_GOOD_RATES]
    lean = max(reading.place_share for reading in good)
    good = [own for own in good if lean < CLEAR or own.place_share > lean - _AS_GOOD_LEAN]
    best, *rest = sorted(good, key=lambda own: (own.price, own.columns))
    tied = (own for own in rest if own.price < max(2 * best.price, 1) and own.differs(best))
    return TakenReading(best, tuple(tied), tuple(readings))


def read_quaternion(values: Array, named: bool, witnesses: Witnesses) -> TakenReading:
    """Read four columns as usual, or in another order and with other signs where that leaves less to explain away."""
    verdict = read_axes(quaternion_readings(values, named, witnesses), witnesses)
    if verdict.best.price < _ODD_ENOUGH:
        return verdict
    more = permuted_quaternions(values, witnesses, verdict.best.price)
    found = read_axes((*(own.attitude for own in verdict.others[::2]), *more), witnesses)
    return found._replace(others=(*verdict.others, *found.others))


def _readings(attitude: Attitude, witnesses: Witnesses) -> Iterator[Reading]:
    """Read an attitude with the body's third axis up, and down."""
    rates = lean = None
    turning = None if witnesses.turning is None else agreement.turning_of(attitude.rotation, witnesses.rate_hz)
    if turning is not None and witnesses.turning is not None:
        rates = agreement.fit_axes(turning, witnesses.turning)
    if witnesses.ground is not None:
        lean = agreement.fit_lean(attitude.rotation, witnesses.ground, witnesses.rate_hz, witnesses.lift)
    bodies: tuple[tuple[Body, float], ...] = (("FLU", 1.0), ("FRD", -1.0))
    for body, up in bodies:
        order, sign, share = *AS_NAMED, 0.0
        if lean is not None and lean.explained > CLEAR:
            order, sign, share = _place_axes(lean, up, attitude.level)
        turned = [(order, sign)] if rates is None else [(order, sign), (rates.order, rates.sign)]
        reversed_ = witnesses.sensed * up < 0
        price = attitude.price + sum(axes_price(*own) for own in turned) + reversed_ + (attitude.level < 0)
        # A gyroscope of a known kind of log is in its axes: what is otherwise is the attitude.
        odd = body != witnesses.known or (
            witnesses.free and rates is not None and (rates.order, rates.sign) != AS_NAMED
        )
        price += 2 * (witnesses.known is not None and odd)
        columns = _changed(attitude.order, attitude.sign) + sum(_changed(*own) for own in turned) + 3 * reversed_
        yield Reading(attitude, body, rates, lean if share else None, order, sign, share, price, columns)


def _place_axes(lean: LeanFit, up: float, level: float) -> tuple[Order, Sign, float]:
    """Give order and signs of a position's columns in the attitude's world, the cheapest that the lean allows."""
    options = []
    for (first, second), (along, across) in product(((0, 1), (1, 0)), product((1.0, -1.0), repeat=2)):
        # The world's third axis points up where that of the body does, as the vehicle is level.
        vertical = lean.rises * up * float(np.sign(level)) or handed((first, second, 2), (along, across, 1.0))
        share = lean.shares[((first, second), (up * along, up * across))]
        options.append(((first, second, 2), (along, across, vertical), share))
    good = [own for own in options if own[2] > lean.explained - _AS_GOOD_RATES]
    return min(good, key=lambda own: axes_price(own[0], own[1]))


def nearest(size: float, rows: Sequence[Row]) -> Row:
    """Give the row of the nearest size."""
    return min(rows, key=lambda row: abs(np.log(size / row.size)))


def read_attitude(seen: Seen) -> TakenReading | None:
    """Read the attitude and all axes with it; None without one."""
    euler = seen.first("attitude")
    for named in seen.candidates.get("quaternion", ()):
        if euler is not None and euler.known and not named.known:
            break
        time, values = seen.log.values(named.group.columns)
        lengths = np.linalg.norm(values, axis=1)
        # Integers of some scale are a quaternion too where their length stays.
        if (length := float(np.median(lengths))) > 0 and float(np.median(np.abs(lengths / length - 1))) < 0.05:
            # Rows of zeros are of a sensor that is not ready.
            held = lengths > 0
            witnesses = _witnesses(seen, time[held], bool(named.known))
            verdict = read_quaternion(values[held] / length, named.group.kind == "wxyz", witnesses)
            # Any four numbers that hardly change have one length; of another length than 1, the motion has to agree.
            best = verdict.best
            if abs(length - 1) < 0.05 or (best.place_share if best.rates is None else best.explained) > CLEAR:
                _take_quaternion(seen, named, verdict)
                return verdict
    return None if euler is None else _read_euler(seen, euler)


def _witnesses(seen: Seen, time: Array, of_kind: bool = True) -> Witnesses:
    gyro, sensed, lift = seen.first("body_rate"), 0.0, None if seen.level is None else seen.level[seen.part] ** 2
    position, velocity, rate_hz = seen.first("position"), seen.first("velocity"), seen.rate_hz
    for values in map(seen.grid, seen.candidates.get("acceleration", ())):
        sizes = np.linalg.norm(values, axis=1)
        size, vertical = float(np.median(sizes)), float(np.median(values[:, 2]))
        if not sensed and abs(vertical) > GOOD * size:
            sensed = float(np.sign(vertical))
        if lift is None and any(1 / NEAR_GRAVITY < size / level < NEAR_GRAVITY for level, *_ in SENSED):
            lift = sizes
    bodies = {BODY_OF[str(named.frame)] for found in seen.candidates.values() for named in found[:1] if named.frame}
    moving = None
    if position is not None:
        moving = agreement.second_derivative(seen.grid(position), rate_hz)
    elif velocity is not None:
        moving = agreement.first_derivative(seen.grid(velocity), rate_hz)
    return Witnesses(
        time,
        seen.log.grid[seen.part],
        rate_hz,
        None if gyro is None else agreement.slow(seen.grid(gyro), rate_hz),
        None if moving is None else Ground.of(moving, rate_hz),
        lift,
        sensed,
        bodies.pop() if len(bodies) == 1 else None,
        not of_kind,
    )


def _read_euler(seen: Seen, named: Named) -> TakenReading:
    time, values = seen.log.values(named.group.columns)
    witnesses = _witnesses(seen, time, bool(named.known))
    flown = (time >= witnesses.grid[0]) & (time <= witnesses.grid[-1])
    flown = flown if flown.any() else np.ones(len(time), dtype=bool)
    unit, reason, sure, rivals = angle_unit(named, named.scale * values[flown], time[flown])
    if named.unit not in (None, unit):
        seen.disagree(named, unit)
    for _ in range(2):
        angles = named.scale * known_unit(unit).factor * values
        ways = euler_readings(angles, witnesses, named.group.kind != "numbers")
        as_named = next(ways)
        verdict = read_axes([as_named], witnesses)
        if not verdict.best.beats_all(witnesses):
            verdict = read_axes([as_named, *ways], witnesses)
        best = verdict.best
        if best.lean is None:
            break
        _, decided, _ = nearest(best.lean.gain * (1 if unit == "rad" else 1 / _DEGREES), _ANGLES)
        if rivals:
            # Gravity and the lean make the acceleration.
            reason, sure, rivals = f"{reason}; in {decided} the lean explains the acceleration", "data", ()
        elif named.unit is None or decided == unit or best.place_share < GOOD:
            break
        else:
            seen.warnings.append(f"{named.group.pattern} is said to be in {unit}; by the lean, it is in {decided}")
            reason, sure = f"{reason}; judged by what the lean explains, in {decided}", "data"
        if decided == unit:
            break
        unit = decided
    if best.rates is not None and best.rates.as_named > CLEAR:
        flipped = [axis for axis, own in zip(("roll", "pitch", "yaw"), best.attitude.sign, strict=True) if own < 0]
        turned = f" with {' and '.join(flipped)} reversed" if flipped else ""
        share = f"; the derivative explains {100 * best.rates.as_named:.0f} % of the gyroscope{turned}"
        before, at, after = reason.partition("; in ")
        reason = f"{before}{share}{at}{after}"
    elif best.lean is None and sure == "data":
        # A range shows the unit, and nothing here the axes.
        sure = "named"
    seen.take(named, unit, reason, sure, order=best.attitude.order, sign=best.attitude.sign, rivals=rivals)
    return verdict


def angle_unit(named: Named, values: Array, time: Array) -> tuple[UnitName, str, Sure, tuple[Rival, ...]]:
    """Give the unit of roll, pitch and yaw, shape (time, 3), with the reason, how sure it is, and its rivals."""
    largest = np.quantile(np.abs(values), 0.999, axis=0)
    tilt, turn = float(largest[:2].max()), float(largest[2])
    if named.unit == "rad" and tilt > _LARGEST_ANGLE:
        return "deg", f"{called(named)}, which would be rad, but reaches {tilt:.3g}, so these are degrees", "data", ()
    if named.unit is not None:
        return named.unit, f"{called(named)}, which is in {named.unit}", "named", ()
    jumps = np.abs(np.diff(values, axis=0))
    if largest.max() < _LARGEST_ANGLE and (np.abs(jumps - 2 * np.pi) < _NEAR).any():
        return "rad", f"{called(named)}; jumps by a full turn in rad", "data", ()
    turned = np.abs(np.interp(time + 1.0, time, values[:, 2]) - values[:, 2])
    spins = turn > _LARGEST_ANGLE and float(np.quantile(turned, 0.95)) > _FASTEST_TURN
    if tilt > _LARGEST_TILT or turn > 20 * _LARGEST_ANGLE or spins:
        return "deg", f"{called(named)}; reaches {max(tilt, turn):.3g}, so these are degrees", "data", ()
    rival = Rival("unit: deg", f"a flight that never leans more than {tilt:.2g} degrees would look the same")
    rivals = () if turn > 1.0 and turn <= _LARGEST_ANGLE and tilt > 0.1 else (rival,)
    return "rad", f"{called(named)}; leans {tilt:.2g} at most", "data" if not rivals else "guess", rivals


def _take_quaternion(seen: Seen, named: Named, verdict: TakenReading) -> None:
    best, own = verdict.best, verdict.best.attitude
    order = "xyzw" if own.scalar_last else "wxyz"
    clear = best.explained > CLEAR
    data = f"its derivative explains {100 * best.explained:.0f} % of the gyroscope"
    turned = " when turned from world-to-body, as logged, to body-to-world" if own.inverse else ""
    reason = f"of one length; {called(named)}" + (f"; {data}{turned}" if clear else "")
    if own.order != (0, 1, 2, 3):
        held = ", ".join(named.group.columns[index] for index in own.order)
        reason += f"; judged by their values, {held} are w, x, y, z"
    seen.take(named, "1", reason, "data" if clear else "named", order=own.order, sign=own.sign)
    others = [other for other in verdict.others if other.attitude.scalar_last != own.scalar_last]
    rivals: tuple[Rival, ...] = ()
    sure: Sure = "data"
    if named.group.kind == "wxyz":
        words, sure = "the columns are named by w, x, y, z", "named"
    elif not others:
        words = "in the other order, the vehicle would not stay level"
    elif clear and (share := max(other.explained for other in others)) < best.explained - 0.05:
        words = f"{data}; in the other order, {100 * share:.0f} %"
    elif best.lean is not None and max(other.place_share for other in others) < best.place_share - 0.2:
        words = f"only in this order does the lean explain the acceleration ({100 * best.place_share:.0f} %)"
    elif named.known:
        words, sure = f"a log of {named.known}", "named"
    elif not verdict.tied and min(other.price for other in others) > best.price:
        words = "in the other order, more columns would have to differ from their names"
    else:
        words, sure = "the more usual one", "guess"
        why = "the vehicle stays level in both, and no gyroscope distinguishes them"
        rivals = (Rival(f"quaternion_order: {'xyzw' if order == 'wxyz' else 'wxyz'}", why),)
    seen.choose("quaternion_order", order, words, sure, *rivals)


def doubt_reading(seen: Seen, verdict: TakenReading) -> None:
    """Say which columns are not what they are named, and make guesses of what other readings take otherwise."""
    best = verdict.best
    if best.attitude.order not in ((0, 1, 2), (0, 1, 2, 3)):
        signal: SignalName = "quaternion" if "quaternion" in seen.guesses else "attitude"
        words = "w, x, y, z" if signal == "quaternion" else "roll, pitch, yaw"
        held = ", ".join(seen.guesses[signal].columns.columns)
        agrees = "this way the log agrees with itself; as named it does not"
        seen.warnings.append(f"{held} are taken for {words}: {agrees}")
    doubted: set[str] = set()
    for other in verdict.tied:
        for name, (order, sign) in other.maps.items():
            if (order, sign) == best.maps[name] or name in doubted:
                continue
            doubted.add(name)
            signs = f", sign: {[int(own) for own in sign]}" if min(sign) < 0 else ""
            for signal in (own for own in _SIGNALS_OF[name] if own in seen.guesses):
                columns = [seen.candidates[signal][0].group.columns[index] for index in order]
                text = f"columns: [{', '.join(columns)}]{signs}"
                seen.doubt(signal, Rival(text, f"the log agrees as well with other columns turned; {_DECIDES}"))
        if other.body != best.body and "body_frame" not in doubted:
            doubted.add("body_frame")
            for key, readings in (("body_frame", (other.body, best.body)), ("world_frame", (other.world, best.world))):
                choice, reason = seen.choices[key], f"the log agrees as well; {_DECIDES}"
                # The accelerometer may have chosen the other reading, and then this one is the rival.
                more = [Rival(f"{key}: {value}", reason) for value in readings if value != choice.value][:1]
                known = [rival.text for rival in choice.rivals]
                rivals = (*choice.rivals, *(rival for rival in more if rival.text not in known))
                seen.choose(key, choice.value, choice.reason, "guess" if rivals else choice.sure, *rivals)
