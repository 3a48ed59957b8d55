"""One reading of all axes of a log: the columns, signs and frames with which its signals agree.

The gyroscope follows the derivative of the attitude, the acceleration over ground its lean, the climb the thrust, and
an accelerometer senses what carries the vehicle. With other axes each of them may fit as well, since names of axes are
free; so among the readings that explain the motion as well as the best, the one is taken that reads least otherwise
than it is named. A column that disagrees with all others is then the odd one, and not they. Where another reading
takes less than twice as much, the log does not tell.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
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
    fit_axes,
    fit_lean,
    handed,
    on_clock,
    rotations_of,
    slow,
    turning_of,
)

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

CLEAR: Final = 0.3  # Share of a signal that another has to explain to say something about it.
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
