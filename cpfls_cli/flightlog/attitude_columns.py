"""How the attitude of a log is read, and all axes with it: quaternion or angles, held against all that moves.

The gyroscope follows the derivative of the attitude, the acceleration over ground its lean, the climb the thrust, and
an accelerometer senses what carries the vehicle. With other axes each of them may fit as well, since names of axes are
free; so among the readings that explain the motion as well as the best, the one is taken that reads least otherwise
than it is named. A column that disagrees with all others is then the odd one, and not they. Where another reading
takes less than twice as much, the log does not tell.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import permutations, product
from typing import TYPE_CHECKING, Final, Literal

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.flightlog.agreement import (
    AS_NAMED,
    AxisFit,
    Ground,
    LeanFit,
    Order,
    Sign,
    first_derivative,
    fit_axes,
    fit_lean,
    handed,
    on_clock,
    rotations_of,
    second_derivative,
    slow,
    turning_of,
)
from cpfls_cli.flightlog.names import Named
from cpfls_cli.flightlog.recognised import Rival, Seen, Sure, called
from cpfls_cli.flightlog.settings import SignalName
from cpfls_cli.flightlog.vocabulary import ANGLES, SENSED, Row
from cpfls_cli.units import UnitName, known_unit

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

CLEAR: Final = 0.3  # Share of a signal that another has to explain to say something about it.
GOOD = 0.6  # Share of a signal that another has to explain to overrule a name.
NEAR_GRAVITY = 1.3  # Ratio to gravity of what is gravity in some unit, since a vehicle pushes.
# Shares by which a reading may explain less, or fly less upright, than the best and still be as good.
_AS_GOOD_RATES, _AS_GOOD_LEAN, _AS_LEVEL = 0.02, 0.1, 0.2
_ODD_ENOUGH = 2  # Price from which the columns of a quaternion are tried in every order and with every sign.
Body = Literal["FLU", "FRD"]


@dataclass(frozen=True)
class Attitude:
    """A way to read the columns of an attitude."""

    rotation: Rotation
    # Which columns are w, x, y, z (x, y, z, w where `scalar_last`), or roll, pitch and yaw, and their signs.
    order: Order
    sign: Sign
    price: int  # What of it is otherwise than named: 1 for a usual convention, else 1 for each column.
    inverse: bool = False
    scalar_last: bool = False

    @property
    def upright(self) -> float:
        """Mean size of the vertical part of the body's third axis: near 1 for what flies level."""
        return abs(self.level)

    @property
    def level(self) -> float:
        """Mean vertical part of the body's third axis: negative where the axes of body and world are of two kinds."""
        return float(self.rotation.as_matrix()[:, 2, 2].mean())


@dataclass(frozen=True)
class Witnesses:
    """What an attitude is held against."""

    rate_hz: float
    gyroscope: Array | None  # Shape (time, 3), or None; in any unit and any axes.
    # Shape (time, 3), or None; acceleration over ground, in any unit and axes; the third is vertical.
    moving: Array | None
    lift: Array | None  # Shape (time,), or None; what grows with the thrust.
    sensed: float  # Sign of what an accelerometer reads along its third axis; 0 without one.
    known: str | None  # Body axes that the kind of log is known for.

    @cached_property
    def turning(self) -> Array | None:
        """What is slow of the gyroscope: filtered once, however many readings it is held against."""
        return None if self.gyroscope is None else slow(self.gyroscope, self.rate_hz)

    @cached_property
    def ground(self) -> Ground | None:
        """What is slow of the acceleration over ground."""
        return None if self.moving is None else Ground.of(self.moving, self.rate_hz)


@dataclass(frozen=True)
class Reading:
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

    @property
    def world(self) -> str:
        """Axes of the world."""
        return "ENU" if (self.body == "FLU") == (self.attitude.level > 0) else "NED"


@dataclass(frozen=True)
class TakenReading:
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


def euler_readings(angles: Array, time: Array, grid: Array) -> Iterator[Attitude]:
    """Go through roll, pitch and yaw with every sign, as named first, and with roll and pitch swapped.

    Parameters
    ----------
    angles : array, shape (sample, 3), rad
    """
    from scipy.spatial.transform import Rotation

    # A pitch that is positive with the nose up, a heading like that of a compass, or both, are conventions.
    usual = ((1.0, 1.0, 1.0), (1.0, -1.0, 1.0), (1.0, 1.0, -1.0), (1.0, -1.0, -1.0), (-1.0, 1.0, 1.0))
    signs = (*usual, *(own for own in product((1.0, -1.0), repeat=3) if own not in usual))
    for order in ((0, 1, 2), (1, 0, 2)):
        for sign in signs:
            rotation = Rotation.from_euler("ZYX", (np.asarray(sign) * angles[:, order])[:, ::-1])
            price = (0 if sign == usual[0] else 1 if sign in usual else 2) + 2 * (order != (0, 1, 2))
            yield Attitude(on_clock(rotation, time, grid), order, sign, price)


def quaternion_readings(values: Array, named: bool, time: Array, grid: Array) -> Iterator[Attitude]:
    """Go through the usual ways to read four columns: of body to world and the inverse, w first and w last.

    Parameters
    ----------
    named : bool
        Whether their names say which is w: then they are in the order w, x, y, z, or its names are one off.
    """
    plain: Sign = (1.0, 1.0, 1.0, 1.0)
    for inverse in (False, True):
        for order, scalar_last, price in (
            (((0, 1, 2, 3), False, 0), ((3, 0, 1, 2), False, 1), ((1, 2, 3, 0), False, 1))
            if named
            else (((0, 1, 2, 3), False, 0), ((0, 1, 2, 3), True, 0))
        ):
            rotation = rotations_of(values[:, order], "xyzw" if scalar_last else "wxyz", inverse)
            back: Sign = (-1.0, -1.0, -1.0, 1.0) if scalar_last else (1.0, -1.0, -1.0, -1.0)
            yield Attitude(
                on_clock(rotation, time, grid), order, back if inverse else plain, price + inverse, inverse, scalar_last
            )


def permuted_quaternions(values: Array, time: Array, grid: Array, most: int) -> Iterator[Attitude]:
    """Go through four columns in every order and with every sign that costs no more than a price."""
    squares = (values**2).mean(axis=0)
    upright = {
        order: abs(squares[order[0]] + squares[order[3]] - squares[order[1]] - squares[order[2]])
        for order in permutations(range(4))
    }
    for order, own in upright.items():
        for rest in product((1.0, -1.0), repeat=3):
            mirrored = min(rest.count(-1.0), 4 - rest.count(-1.0))
            price = _changed(order, (1.0,) * 4) + mirrored
            if own > max(upright.values()) - _AS_LEVEL and 0 < price <= most:
                sign = (1.0, *rest)
                rotation = rotations_of(values[:, order] * sign, "wxyz")
                yield Attitude(on_clock(rotation, time, grid), order, sign, price, rest == (-1.0, -1.0, -1.0))


def read_axes(usual: Iterable[Attitude], witnesses: Witnesses) -> TakenReading:
    """Choose among ways to read an attitude the one that needs least to be otherwise than named."""
    tried = list(usual)
    upright = max(attitude.upright for attitude in tried)
    readings = [own for a in tried if a.upright > upright - _AS_LEVEL for own in _readings(a, witnesses)]
    rates = max(reading.explained for reading in readings)
    good = [own for own in readings if rates < CLEAR or own.explained > rates - _AS_GOOD_RATES]
    lean = max(reading.place_share for reading in good)
    good = [own for own in good if lean < CLEAR or own.place_share > lean - _AS_GOOD_LEAN]
    good.sort(key=lambda own: (own.price, own.columns))
    best = good[0]
    tied = (own for own in good[1:] if own.price < max(2 * best.price, 1) and own.differs(best))
    return TakenReading(best, tuple(tied), tuple(readings))


def read_quaternion(values: Array, named: bool, time: Array, grid: Array, witnesses: Witnesses) -> TakenReading:
    """Read four columns as usual, or in another order and with other signs where that leaves less to explain away."""
    verdict = read_axes(quaternion_readings(values, named, time, grid), witnesses)
    if verdict.best.price < _ODD_ENOUGH:
        return verdict
    more = permuted_quaternions(values, time, grid, verdict.best.price)
    found = read_axes((*(own.attitude for own in verdict.others[::2]), *more), witnesses)
    return replace(found, others=(*verdict.others, *found.others))


def _readings(attitude: Attitude, witnesses: Witnesses) -> Iterator[Reading]:
    """Read an attitude with the body's third axis up, and down."""
    rates = lean = None
    if witnesses.turning is not None and (turning := turning_of(attitude.rotation, witnesses.rate_hz)) is not None:
        rates = fit_axes(turning, witnesses.turning)
    if witnesses.ground is not None:
        lean = fit_lean(attitude.rotation, witnesses.ground, witnesses.rate_hz, witnesses.lift)
    bodies: tuple[Body, Body] = ("FLU", "FRD")
    for body in bodies:
        order, sign, share = AS_NAMED[0], AS_NAMED[1], 0.0
        if lean is not None and lean.explained > CLEAR:
            order, sign, share = _place_axes(lean, body, attitude.level)
        turned = [(order, sign)] if rates is None else [(order, sign), (rates.order, rates.sign)]
        reversed_ = witnesses.sensed * (1.0 if body == "FLU" else -1.0) < 0
        price = attitude.price + sum(axes_price(*own) for own in turned) + reversed_ + (attitude.level < 0)
        price += 2 * (witnesses.known is not None and witnesses.known != body)
        columns = _changed(attitude.order, attitude.sign) + sum(_changed(*own) for own in turned) + 3 * reversed_
        told = lean if share else None
        yield Reading(attitude, body, rates, told, order, sign, share, price, columns)


def _place_axes(lean: LeanFit, body: Body, level: float) -> tuple[Order, Sign, float]:
    """Give order and signs of a position's columns in the attitude's world, the cheapest that the lean allows."""
    up = 1.0 if body == "FLU" else -1.0
    options = []
    for (first, second), (along, across) in product(((0, 1), (1, 0)), product((1.0, -1.0), repeat=2)):
        share = lean.shares[((first, second), (up * along, up * across))]
        # The world's third axis points up where that of the body does, as the vehicle is level.
        vertical = lean.rises * up * float(np.sign(level)) or handed((first, second, 2), (along, across, 1.0))
        options.append(((first, second, 2), (along, across, vertical), share))
    good = [own for own in options if own[2] > lean.explained - _AS_GOOD_RATES]
    return min(good, key=lambda own: axes_price(own[0], own[1]))


_DEGREES = 180 / np.pi
# Angles in rad beyond which numbers are degrees: somewhat more than a full turn, and than a lean of a quarter turn.
_LARGEST_ANGLE, _LARGEST_TILT = 6.6, 1.7
_NEAR: Final = 0.2  # Part of a turn, rad, that an angle moves between two samples where it jumps by a full turn.
# Body axes of logs whose other axes are these.
BODY_OF: Final = {"FLU": "FLU", "ENU": "FLU", "FRD": "FRD", "NED": "FRD"}
_SIGNALS_OF: Final[Mapping[str, tuple[SignalName, ...]]] = {
    "attitude": ("quaternion", "attitude"),
    "body_rate": ("body_rate",),
    "position": ("position", "velocity"),
}
_DECIDES = "a flight with one known lean, turn or climb, or the documentation of the log, decides"


def nearest(size: float, rows: Sequence[Row]) -> Row:
    """Give the row of the nearest size."""
    return min(rows, key=lambda row: abs(np.log(size / row[0])))


def over_ground(seen: Seen) -> Array | None:
    """Derive the acceleration over ground from the position, or else from the velocity."""
    position, velocity = seen.first("position"), seen.first("velocity")
    if position is not None:
        return second_derivative(seen.grid(position), seen.rate_hz)
    return None if velocity is None else first_derivative(seen.grid(velocity), seen.rate_hz)


def read_attitude(seen: Seen) -> TakenReading | None:
    """Read the attitude and all axes with it; None without one."""
    euler = seen.first("attitude")
    for named in seen.candidates.get("quaternion", ()):
        if euler is not None and euler.known and not named.known:
            break
        time, values = seen.log.values(named.group.columns)
        if float(np.median(np.abs(np.linalg.norm(values, axis=1) - 1))) < 0.05:
            grid, named_by_axes = seen.log.grid[seen.part], named.group.kind == "wxyz"
            verdict = read_quaternion(values, named_by_axes, time, grid, _witnesses(seen))
            _take_quaternion(seen, named, verdict)
            return verdict
    return None if euler is None else _read_euler(seen, euler)


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
    bodies = {BODY_OF[str(named.frame)] for found in seen.candidates.values() for named in found[:1] if named.frame}
    known = bodies.pop() if len(bodies) == 1 else None
    measured = None if gyro is None else seen.grid(gyro)
    return Witnesses(seen.rate_hz, measured, over_ground(seen), _lift(seen), sensed, known)


def _read_euler(seen: Seen, named: Named) -> TakenReading:
    time, values = seen.log.values(named.group.columns)
    grid = seen.log.grid[seen.part]
    flown = (time >= grid[0]) & (time <= grid[-1])
    unit, reason, sure, rivals = _angle_unit(named, named.scale * values[flown if flown.any() else slice(None)])
    if named.unit not in (None, unit):
        seen.disagree(named, unit)
    for _ in range(2):
        angles = named.scale * known_unit(unit).factor * values
        readings = euler_readings(angles, time, grid)
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
            seen.warnings.append(f"{named.group.pattern} is said to be in {unit}; by the lean, it is in {decided}")
            reason, sure = f"{reason}; judged by what the lean explains, in {decided}", "data"
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
    seen.take(named, unit, reason, sure, order=best.attitude.order, sign=best.attitude.sign, rivals=rivals)
    return verdict


def _angle_unit(named: Named, values: Array) -> tuple[UnitName, str, Sure, tuple[Rival, ...]]:
    largest = np.quantile(np.abs(values), 0.999, axis=0)
    tilt, turn = float(largest[:2].max()), float(largest[2])
    if named.unit == "rad" and tilt > _LARGEST_ANGLE:
        return "deg", f"{called(named)}, which would be rad, but reaches {tilt:.3g}, so these are degrees", "data", ()
    if named.unit is not None:
        return named.unit, f"{called(named)}, which is in {named.unit}", "named", ()
    jumps = np.abs(np.diff(values, axis=0))
    if largest.max() < _LARGEST_ANGLE and (np.abs(jumps - 2 * np.pi) < _NEAR).any():
        return "rad", f"{called(named)}; jumps by a full turn in rad", "data", ()
    if tilt > _LARGEST_TILT or turn > 20 * _LARGEST_ANGLE:
        return "deg", f"{called(named)}; reaches {max(tilt, turn):.3g}, so these are degrees", "data", ()
    rival = Rival("unit: deg", f"a flight that never leans more than {tilt:.2g} degrees would look the same")
    rivals = () if turn > 1.0 and turn <= _LARGEST_ANGLE and tilt > 0.1 else (rival,)
    return "rad", f"{called(named)}; leans {tilt:.2g} at most", "data" if not rivals else "guess", rivals


def _take_quaternion(seen: Seen, named: Named, verdict: TakenReading) -> None:
    best, own = verdict.best, verdict.best.attitude
    order = "xyzw" if own.scalar_last else "wxyz"
    told = best.explained > CLEAR
    data = f"its derivative explains {100 * best.explained:.0f} % of the gyroscope"
    turned = " when turned from world-to-body, as logged, to body-to-world" if own.inverse else ""
    reason = f"of length 1; {called(named)}" + (f"; {data}{turned}" if told else "")
    if own.order != (0, 1, 2, 3):
        held = ", ".join(named.group.columns[index] for index in own.order)
        reason += f"; judged by their values, {held} are w, x, y, z"
    seen.take(named, "1", reason, "data" if told else "named", order=own.order, sign=own.sign)
    others = [other for other in verdict.others if other.attitude.scalar_last != own.scalar_last]
    if named.group.kind == "wxyz":
        seen.choose("quaternion_order", order, "the columns are named by w, x, y, z", "named")
        return
    if not others:
        seen.choose("quaternion_order", order, "in the other order, the vehicle would not stay level", "data")
        return
    share = max(other.explained for other in others)
    lean = max(other.place_share for other in others)
    if told and share < best.explained - 0.05:
        seen.choose("quaternion_order", order, f"{data}; in the other order, {100 * share:.0f} %", "data")
    elif best.lean is not None and lean < best.place_share - 0.2:
        share_of_lean = f"({100 * best.place_share:.0f} %)"
        words = f"only in this order does the lean explain the acceleration {share_of_lean}"
        seen.choose("quaternion_order", order, words, "data")
    elif named.known:
        seen.choose("quaternion_order", order, f"a log of {named.known}", "named")
    elif not verdict.tied and min(other.price for other in others) > best.price:
        words = "in the other order, more columns would have to differ from their names"
        seen.choose("quaternion_order", order, words, "data")
    else:
        rival = "xyzw" if order == "wxyz" else "wxyz"
        why = "the vehicle stays level in both, and no gyroscope tells them apart"
        seen.choose("quaternion_order", order, "the more usual one", "guess", Rival(f"quaternion_order: {rival}", why))


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
            for signal in _SIGNALS_OF[name]:
                if signal in seen.guesses:
                    columns = [seen.candidates[signal][0].group.columns[index] for index in order]
                    signs = f", sign: {[int(own) for own in sign]}" if min(sign) < 0 else ""
                    text = f"columns: [{', '.join(columns)}]{signs}"
                    seen.doubt(signal, Rival(text, f"the log agrees as well with other columns turned; {_DECIDES}"))
        if other.body != best.body and "body_frame" not in doubted:
            doubted.add("body_frame")
            for key, readings in (("body_frame", (other.body, best.body)), ("world_frame", (other.world, best.world))):
                choice, reason = seen.choices[key], f"the log agrees as well; {_DECIDES}"
                # The accelerometer may have chosen the other reading, and then this one is the rival.
                rivals = [Rival(f"{key}: {value}", reason) for value in readings if value != choice.value][:1]
                known = [rival.text for rival in choice.rivals]
                rivals = [*choice.rivals, *(rival for rival in rivals if rival.text not in known)]
                seen.choose(key, choice.value, choice.reason, "guess" if rivals else choice.sure, *rivals)
