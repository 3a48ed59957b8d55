"""Where the rotors of a vehicle are and how they turn: from the parameters in a log, or from its motion."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import permutations, product
from math import hypot
from typing import Final, NamedTuple

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.blocks import blocks_of_time, half_width, jackknife_error
from cpfls_cli.errors import InputError
from cpfls_cli.flightlog.names import words_of
from cpfls_cli.flightlog.smoothing import derivative, low_pass
from cpfls_cli.flightlog.stated_vehicle import LAYOUTS, USUAL, Parameters, is_open, lifting_rotors, stated_frame
from cpfls_cli.lag import delayed, lagged
from cpfls_cli.rounding import largest

# Below which torque and angular acceleration are compared: a controller answers slower, and noise is above.
_ACCELERATION_HZ = 12.0
# A band above that of most gusts and of a controller's answer to them: there the rotors are the cause of motion.
_FAST_HZ = (6.0, 20.0)
_LAGS_S = (0.0, 0.02, 0.04, 0.07, 0.1)
# Time constants of motors, from the smallest to those of large vehicles, and delays of telemetry; near enough.
_SHIFTS_S = (-0.06, -0.04, -0.02, 0.02, 0.04, 0.06)
_CORNERS: Final = {
    "front left": (1.0, 1.0),
    "front right": (1.0, -1.0),
    "rear right": (-1.0, -1.0),
    "rear left": (-1.0, 1.0),
}
_ENDS: Final = {"front": (1.0, 0.0), "right": (0.0, -1.0), "rear": (-1.0, 0.0), "left": (0.0, 1.0)}
# What CA_ROTOR*_KM of PX4 is unless changed: of some versions a log has only those that are.
_PX4_KM: Final = 0.05
_ROUNDED = 1e-9  # Below which a place along an axis is 0.
_TURNS = ("roll", "pitch", "yaw")
_LEAST_EXPLAINED = 0.05  # Share of the acceleration about one axis that chance does not explain.
# Sum of the shares of roll and pitch that rotors in their places explain, and how many times that of other places.
_LEAST_OF_BOTH, _LEAST_TIMES = 0.2, 1.3
# How much a rotor by itself has to push as the layout has it, as a part of what they do on the mean.
_LEAST_OF_MEAN = 0.2
_PREFER_X = 1.3  # Few vehicles are a plus: one has to explain that much more than an X.


class RotorPlace(NamedTuple):
    """Where a rotor is and how it turns."""

    name: str  # Such as ``front left``; empty where its numbers alone are known.
    direction: tuple[float, float]  # x forward and y left, of length 1 where only the direction is known.
    spin: int  # 1 counter-clockwise seen from above, -1 clockwise; 0 where that is not known.
    height_m: float = 0.0  # Of the hub above the point that the parameters count from.


@dataclass(frozen=True)
class Airframe:
    """The rotors of a vehicle, in the order of the log."""

    rotors: tuple[RotorPlace, ...]
    in_metres: bool  # Whether the places are lengths; False where they are directions.
    reason: str  # Where that is known from.
    # Whether parameters state it, the motion shows it clearly, it is what a kind of log has unless changed, or the
    # motion only suggests it.
    sure: str
    moment_ratio_m: float | None = None  # Drag factor over thrust factor that the parameters state.
    scaled: bool = False  # Whether its places are those of an arm that was given.

    @property
    def is_guess(self) -> bool:
        """Whether other places, or other ways to turn, are not ruled out."""
        return self.sure in ("usual", "guess")

    @property
    def is_asked(self) -> bool:
        """Whether too little speaks for it to be taken without a look at the vehicle."""
        return self.sure == "guess"

    @property
    def arm_m(self) -> float:
        """Mean distance of the rotors from the middle, m where the places are lengths."""
        return float(np.mean([hypot(*rotor.direction) for rotor in self.rotors]))

    def with_arm(self, arm_m: float) -> "Airframe":
        """Give the same rotors at a distance from the middle; the mean distance where they differ."""
        factor = arm_m / self.arm_m
        rotors = tuple(
            r._replace(
                direction=(factor * r.direction[0], factor * r.direction[1]),
                height_m=factor * r.height_m * self.in_metres,
            )
            for r in self.rotors
        )
        return replace(self, rotors=rotors, in_metres=True, scaled=True)


def stated_airframe(parameters: Parameters, rotors: int = 0) -> Airframe | None:
    """Read the rotors that the parameters of an autopilot state; None where they state none.

    Rotors that cannot turn the vehicle about all of its axes are refused. The log's columns show so many rotors; 0
    where they show none.
    """
    found, frame = _of_px4(parameters), stated_frame(parameters, rotors)
    if found is None and frame is not None:
        found = _laid_out(*frame, "usual" if is_open(frame[0], parameters) else "stated")
    if found is not None:
        _require_control(found)
    return found


def _of_px4(parameters: Parameters) -> Airframe | None:
    lifting = lifting_rotors(parameters)
    if not lifting or "CA_ROTOR0_PX" not in parameters:
        return None
    rotors, ratios = [], []
    moments = [float(parameters.get(f"CA_ROTOR{index}_KM", _PX4_KM)) for index in lifting]
    if sum(map(np.sign, moments)):
        # As many turn either way: a moment that is absent is not the usual one, and its spin is not known.
        moments = [float(parameters.get(f"CA_ROTOR{index}_KM", 0.0)) for index in lifting]
    for index, ratio in zip(lifting, moments, strict=True):
        x, y, z = (float(parameters.get(f"CA_ROTOR{index}_P{axis}", 0.0)) for axis in "XYZ")
        # Of PX4: y to the right, z down, and a positive moment for a rotor that turns counter-clockwise.
        rotors.append(RotorPlace(_name(x, -y), (x, 0.0 - y), int(np.sign(ratio)), 0.0 - z))
        ratios.append(abs(ratio))
    reason = "CA_ROTOR*_PX, _PY and the signs of _KM in the log"
    return Airframe(tuple(rotors), True, reason, "stated", float(np.mean(ratios)))


def _name(x: float, y: float) -> str:
    along = "front" if x > _ROUNDED else "rear" if x < -_ROUNDED else ""
    across = "left" if y > _ROUNDED else "right" if y < -_ROUNDED else ""
    return f"{along} {across}".strip()


def _laid_out(frame: str, reason: str, sure: str) -> Airframe:
    rotors = tuple(RotorPlace(_name(x, y), (x, y), spin) for x, y, spin in LAYOUTS[frame])
    return Airframe(rotors, False, reason, sure)


def usual_airframe(kind: str, rotors: int) -> Airframe | None:
    """Give the rotors as a kind of log numbers them if nothing is changed; None where that is not known."""
    frame = USUAL.get(kind, {}).get(rotors)
    if frame is None:
        return None
    return _laid_out(frame, f"the numbers that {kind} gives the motors of this frame unless changed: {frame}", "usual")


def named_airframe(columns: Sequence[str], moved: "MovedBy | None") -> Airframe | None:
    """Read the rotors that the names of columns place, as ``motor_FL``; which way they turn the motion may show."""
    words = [{"rear" if word == "back" else word for word in words_of(column)} for column in columns]
    short = {"".join(part[0] for part in name.split()): name for name in _CORNERS}
    short |= {"bl": "rear left", "br": "rear right"}
    found = [[name for key, name in short.items() if key in own or {*name.split()} <= own] for own in words]
    places = [own[0] for own in found if own]
    if {*places} != {*_CORNERS} or len(places) != len(columns):
        return None
    shown = {} if moved is None or not moved.by_axes else {own.name: own.spin for own in moved.airframe.rotors}
    spins = shown if [*shown] == places else {}
    rotors = tuple(RotorPlace(name, _CORNERS[name], spins.get(name, 0)) for name in places)
    return Airframe(rotors, False, "the names of their columns", "stated")


def _require_control(airframe: Airframe) -> None:
    """Refuse rotors that leave thrust and the torques about the three axes dependent on each other."""
    rows = np.array([[1.0, r.direction[1], -r.direction[0], -float(r.spin)] for r in airframe.rotors]).T
    scale = np.abs(rows).max(axis=1, keepdims=True)
    for row, axis in ((1, "roll"), (2, "pitch"), (3, "yaw")):
        others = np.delete(rows, row, axis=0) / np.maximum(np.delete(scale, row, axis=0), _ROUNDED)
        own = rows[row] / max(float(scale[row, 0]), _ROUNDED)
        left = own - others.T @ np.linalg.lstsq(others.T, own, rcond=None)[0]
        if float(np.linalg.norm(left)) < 1e-6:
            raise InputError(
                f"{airframe.reason}: these {len(airframe.rotors)} rotors cannot turn the vehicle about {axis} by"
                " themselves; correct the parameters in the autopilot, or state vehicle.rotors by hand"
            )


_Explained = tuple[float, float, float]  # Shares of the angular acceleration about roll, pitch and yaw.


class _RotorLayout(NamedTuple):
    rotors: tuple[RotorPlace, ...]
    form: str
    weights: Array  # What each rotor does about roll, pitch and yaw, shape (axis, rotor).


@cache
def _layouts() -> tuple[_RotorLayout, ...]:
    """List how four rotors can be numbered, in an X and in a plus, and which pair turns which way."""
    found = []
    for form, places in (("X", _CORNERS), ("plus", _ENDS)):
        length = hypot(*next(iter(places.values())))
        named = [(name, (x / length, y / length), (-1) ** index) for index, (name, (x, y)) in enumerate(places.items())]
        for order, first in product(permutations(named), (1, -1)):
            rotors = tuple(RotorPlace(name, direction, first * spin) for name, direction, spin in order)
            (x, y), spins = np.array([own.direction for own in rotors]).T, [-float(own.spin) for own in rotors]
            found.append(_RotorLayout(rotors, form, np.array([y, -x, spins])))
    return tuple(found)


class MovedBy(NamedTuple):
    """Four rotors as the motion shows them, and how clearly."""

    airframe: Airframe
    # Share of the angular acceleration about roll, pitch and yaw that they explain.
    explained: _Explained
    by_axes: bool  # Whether every axis says it.
    clear: bool  # Whether every rotor by itself says it too.


# Part of a direction up to which a rotor lies on an axis: arms of an H or of a stretched X are no plus.
_ON_AN_AXIS = 0.2


def place_of(direction: tuple[float, float]) -> str:
    """Name the place of a rotor; a small part of its direction along an axis is ignored."""
    least = _ON_AN_AXIS * hypot(*direction)
    x, y = (part if abs(part) > least else 0.0 for part in direction)
    return _name(x, y)


def airframe_from_motion(body_rate: Array, speed: Array, rate_hz: float, is_command: bool) -> MovedBy | None:
    """Find out which of four rotors is where and which way it turns, from what the vehicle does.

    The angular acceleration about each axis is regressed on the rotors' torque in every numbering of an X and of a
    plus; the one that explains most is taken. Where that is not clear, slow gusts and the answer to them may hide it:
    then what is fast alone may say it, as a guess. None for another number of rotors, or where nothing is explained.

    Body rates are of shape (time, 3), rad/s, FLU; speeds of shape (time, 4), in any unit that is a share of the speed;
    motors follow commands later.
    """
    if speed.shape[1] != 4 or len(speed) < 5 * rate_hz or not speed.any():
        return None
    tried = [_shares(*each) for each in _driven(body_rate, speed, rate_hz, is_command)]
    shares, weights = largest(tried, lambda found: max(sum(share) for _, share in found[0]))
    layout, explained, by_axes = _chosen(shares, ("X", "plus"))
    if not by_axes:
        layout, explained, by_axes = _chosen(shares, ("X",))
    # Columns that are of other moments than those next to them, or of something else than these rotors, may explain a
    # part of the motion in some layout; but then single ones push the wrong way.
    alike = layout.weights * weights
    least = _LEAST_OF_MEAN * np.abs(alike).mean(axis=1, keepdims=True)
    clear = by_axes and bool((alike > least)[layout.weights != 0].all())
    band = ""
    if not by_axes and rate_hz / 5 > 2 * _FAST_HZ[0]:
        fast = [_shares(*each)[0] for each in _driven(body_rate, speed, rate_hz, is_command, *_FAST_HZ)]
        # Of each layout what it explains about each axis with the lag that suits this axis best.
        best = ((same[0][0], np.max([own for _, own in same], axis=0).tolist()) for same in zip(*fast, strict=True))
        quick = _chosen([(layout, (x, y, z)) for layout, (x, y, z) in best], ("X",))
        if quick[2]:
            (layout, explained, by_axes), band = quick, f" above {_FAST_HZ[0]:g} Hz"
    if sum(explained[:2]) < 2 * _LEAST_EXPLAINED:
        return None
    words = ", ".join(f"{100 * share:.0f} % of {axis}" for share, axis in zip(explained, _TURNS, strict=True))
    form = "an X" if layout.form == "X" else "a plus"
    reason = f"the motion: as {form} in this order, the rotors explain {words} acceleration{band}"
    return MovedBy(Airframe(layout.rotors, False, reason, "data" if clear else "guess"), explained, by_axes, clear)


def _chosen(
    shares: Sequence[tuple[_RotorLayout, _Explained]], forms: tuple[str, ...]
) -> tuple[_RotorLayout, _Explained, bool]:
    """Choose the layout that explains most, and tell whether another numbering comes near."""
    own = [found for found in shares if found[0].form in forms]
    layout, explained = largest(own, lambda found: sum(found[1]) * (_PREFER_X if found[0].form == "X" else 1.0))
    places = [rotor.name for rotor in layout.rotors]
    others = max(sum(share[:2]) for other, share in own if [rotor.name for rotor in other.rotors] != places)
    clear = sum(explained[:2]) > max(_LEAST_OF_BOTH, _LEAST_TIMES * others) and explained[2] > _LEAST_EXPLAINED
    return layout, explained, clear


def explained_by_rotors(body_rate: Array, speed: Array, rate_hz: float, is_command: bool) -> float:
    """Give the share of the angular acceleration that rotors explain, wherever they are, the mean of the three axes.

    Body rates are in any unit and axes, the rest is as in `airframe_from_motion`.
    """
    if not speed.any():
        return 0.0
    shares = [0.0]
    for wanted, rotors in _driven(body_rate, speed, rate_hz, is_command):
        left = wanted - rotors @ np.linalg.lstsq(rotors, wanted, rcond=None)[0]
        total = (wanted**2).sum(axis=0)
        shares.append(float(np.mean(1 - np.divide((left**2).sum(axis=0), total, out=np.ones(3), where=total > 0))))
    return max(shares)


def turns_by_rotors(flights: Iterable[tuple[Array, Array, float, bool]]) -> tuple[Array, Array]:
    """Find which way each rotor by itself turns the body about z, by least squares with its squared speed.

    Parameters
    ----------
    flights : iterable of (body rate, speed, rate, whether speeds are commands)
        As in `airframe_from_motion`, of any number of rotors.

    Returns
    -------
    turns, half : array, shape (rotor,)
        Above 0 counter-clockwise, as parts of what rotors do on the mean, with halves of 95 % intervals by jackknife.
    """
    squares, products = [], []
    for body_rate, speed, rate_hz, is_command in flights:
        tried = [(rotors, wanted[:, 2]) for wanted, rotors in _driven(body_rate, speed, rate_hz, is_command)]
        rotors, wanted = largest(tried, lambda each: float(np.linalg.norm(np.linalg.qr(each[0])[0].T @ each[1])))
        number = blocks_of_time(len(wanted), 1 / rate_hz)
        for block in (number == each for each in range(number[-1] + 1)):
            squares.append(rotors[block].T @ rotors[block])
            products.append(rotors[block].T @ wanted[block])
    own, together = np.sum(squares, axis=0), np.sum(products, axis=0)
    turns = np.linalg.lstsq(own, together, rcond=None)[0]
    size = np.abs(turns).mean()
    without = [
        np.linalg.lstsq(own - square, together - product, rcond=None)[0]
        for square, product in zip(squares, products, strict=True)
    ]
    half = half_width(jackknife_error(np.array(without)), len(without))
    return np.asarray(turns / size), np.asarray(half / size)


def _driven(
    body_rate: Array, speed: Array, rate_hz: float, is_command: bool, lowest_hz: float = 0.0, highest_hz: float = 0.0
) -> Iterator[tuple[Array, Array]]:
    """Give a band of the angular acceleration and of what drives it, with every lag and shift of rotors."""
    cutoff = min(highest_hz or _ACCELERATION_HZ, rate_hz / 5)

    def in_band(values: Array) -> Array:
        return values - low_pass(values, rate_hz, lowest_hz, 2) if lowest_hz else values

    rate = low_pass(body_rate, rate_hz, cutoff, 2)
    acceleration = in_band(derivative(np.arange(len(rate)) / rate_hz, rate))
    squared = (speed / np.mean(speed)) ** 2
    # Motors follow a command late, fast ones by up to half a cycle; stamps of a measured speed may be late or early.
    lags = _LAGS_S[bool(lowest_hz) :] if is_command else _LAGS_S[:3]
    moved = [lagged(squared, rate_hz * lag).start for lag in lags]
    if not (is_command or lowest_hz):
        # Of what is fast such a shift is half a cycle, and turns its sign.
        moved += [delayed(squared, rate_hz * seconds) for seconds in _SHIFTS_S]
    edge = max(1, len(rate) // 50)
    inner = slice(edge, len(rate) - edge)
    # What turning itself does to the acceleration, and a constant torque, are not the work of the rotors.
    basis = np.linalg.qr(np.column_stack([np.ones(len(rate[inner])), rate[inner]]))[0]
    for own in moved:
        wanted, rotors = (
            values[inner] - basis @ (basis.T @ values[inner])
            for values in (acceleration, in_band(low_pass(own, rate_hz, cutoff, 2)))
        )
        yield wanted, rotors


def _shares(wanted: Array, rotors: Array) -> tuple[list[tuple[_RotorLayout, _Explained]], Array]:
    """Give what every layout explains, and how each rotor pushes where none ties them together, shape (axis, rotor)."""
    together, own, total = rotors.T @ wanted, rotors.T @ rotors, (wanted**2).sum(axis=0)
    weights = np.array([layout.weights for layout in _layouts()])
    along, power = np.einsum("lar,ra->la", weights, together), np.einsum("lar,rs,las->la", weights, own, weights)
    shares = np.where(along > 0, along, 0.0) ** 2 / np.where(power * total > 0, power * total, np.inf)
    results = [(layout, (x, y, z)) for layout, (x, y, z) in zip(_layouts(), shares.tolist(), strict=True)]
    return results, np.asarray(np.linalg.lstsq(own, together, rcond=None)[0].T, dtype=float)
