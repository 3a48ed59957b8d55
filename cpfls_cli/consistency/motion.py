"""Position, velocity, accelerations and thrust held against each other: which two contradict each other."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.blocks import BLOCK_S, ENOUGH_BLOCKS, block_length, contiguous, half_width, jackknife_error, serial_error
from cpfls_cli.consistency.channels import AXES, SAME, TWICE, axes_apart
from cpfls_cli.consistency.findings import UP, Finding, off_clock
from cpfls_cli.effects.signals import Signals
from cpfls_cli.flightlog.agreement import Ground, first_derivative, fit_lean, second_derivative
from cpfls_cli.rotations import cross
from cpfls_cli.rounding import largest, less
from cpfls_cli.units import STANDARD_GRAVITY
from cpfls_cli.weak_form.windows import Windows, blocks_of, folds
from cpfls_cli.words import joined

# Filters and drag make a fifth; a third of gravity is neither a bias nor a tilt of a sensor.
_SCALE_OFF, _GRAVITY_OFF_M_S2 = 0.2, 3.0
# From here on a delay costs more force than noise does, and a turn more than the mounting of a sensor.
_DELAY_OFF_S = 0.005
TURNED_RAD = np.radians(3.0)
# A jackknife over few blocks has heavy tails.
_JACKKNIFE_SIGMAS = 6.0
ANOTHER_NORTH = np.radians(20.0)
"""Turn about the vertical from which on a world has another north; 23 real flights are turned by 4 degrees at most."""

# Share of what moves in both that agreement asks for, and the ratio within which scales of axes are one.
_SHARED, _ONE_SCALE = 0.5, 1.05
# Ratio to what the lean makes of gravity that wind and noise never make, and the length of a flight that identifies it.
_ANOTHER_LENGTH, _LEAST_OF_LEAN_S = 10.0, 5.0
LATEST_S = 0.3  # Longest delay of an estimator or of telemetry.
_COULD_BE_LATE, _LEAVES_LESS, _PER_HOP = 0.5, 0.5, 4
"""Share of a turn that a delay could be, share of what a delay leaves that a turn has to leave at most, and delays that
are tried from one window to the next."""

_LEAST = {"velocity": 0.1, "acceleration": 0.2, "specific_force": 0.2}
"""Offsets that calibrated sensors do not have, m/s and m/s^2: of an accelerometer 2 % of gravity."""
OFFSET_M_S2 = 0.1  # Standard deviation of what a calibrated accelerometer is off by all along a flight: 10 mg.
_CHANCE = 1e-5  # That scatter of blocks makes one: a dozen are looked at, and slow errors scatter less than others.
_APART = 0.5  # Share of an offset by which that of a half of the flight, or against the thrust, may be another.

_QUARTER = np.array([[0.0, 1.0], [-1.0, 0.0]])
TINY = 1e-100  # Square of what does not move.


class MotionChannel(NamedTuple):
    """A channel of the motion."""

    words: str  # What it is called.
    keys: str  # What of the config says how it is read.
    units: Mapping[str, float] = {}  # Units that logs hold it in by mistake, in SI.
    without: str = ""  # What follows where it is left out; empty for one that is never mended or left out.


_ACCELERATIONS = {
    "g": STANDARD_GRAVITY,
    "ft/s^2": 0.3048,
    "cm/s^2": 0.01,
    "mm/s^2": 0.001,
    "mg": STANDARD_GRAVITY / 1000,
}
_NO_FORCE = "the force is taken from other channels, if there are any"
CHANNELS = {
    "position": MotionChannel(
        "position", "import.signals.position", {"mm": 0.001, "cm": 0.01, "ft": 0.3048, "m where mm is stated": 1000.0}
    ),
    "velocity": MotionChannel(
        "velocity",
        "import.signals.velocity and import.world_frame",
        {"km/h": 1 / 3.6, "ft/s": 0.3048, "cm/s": 0.01, "mm/s": 0.001, "m/s where mm/s is stated": 1000.0},
        "effects of the air are not tested",
    ),
    "acceleration": MotionChannel(
        "acceleration", "import.signals.acceleration and import.acceleration_frame", _ACCELERATIONS, _NO_FORCE
    ),
    "specific_force": MotionChannel(
        "accelerometer",
        "import.signals.acceleration, import.acceleration_frame and import.body_frame",
        _ACCELERATIONS,
        _NO_FORCE,
    ),
    "thrust": MotionChannel("thrust of the rotors", "vehicle.rotors"),
}
"""Channels of the motion, by field of `Signals`."""


class Sure(NamedTuple):
    """A number with its standard error, by so many blocks."""

    value: float
    error: float
    blocks: int

    def beyond(self, size: float) -> bool:
        """Check whether it is surely not zero, and larger than a size."""
        return abs(self.value) > max(size, _JACKKNIFE_SIGMAS * self.error)

    @property
    def half(self) -> float:
        """Half of its 95 % interval."""
        return float(half_width(np.array(self.error), self.blocks))


_NOT_KNOWN = Sure(0.0, np.inf, 2)


class Pair(NamedTuple):
    """Two channels that show one motion, and the standard deviation from which on it moves."""

    first: str
    second: str
    floor: float

    @property
    def words(self) -> str:
        """Both by their names."""
        return " and ".join(self.channels)

    @property
    def channels(self) -> tuple[str, str]:
        """Names of the two."""
        return CHANNELS[self.first].words, CHANNELS[self.second].words

    @property
    def exact(self) -> bool:
        """Whether only sensors decide whether the two agree, and no model."""
        return "thrust" not in self

    def finding(self, what: str, size: float, unit: str = "", *, contradiction: bool = True) -> Finding:
        """Say what is wrong between the two."""
        keys = dict.fromkeys(CHANNELS[name].keys for name in (self.first, self.second))
        return Finding(what, f"check {', '.join(keys)}", self.channels, size, unit, contradiction)


@dataclass(frozen=True)
class PairCheck:
    """Two channels held against each other."""

    pair: Pair
    first: Array  # Shape (window, 3): what should be the same.
    second: Array  # Alike.
    scale: Array  # Shape (3,): of the second against the first along each axis.
    r2: Array  # Shape (3,): share of what moves in both.
    delay: Sure  # Of the second against the first, s.
    turn: Sure  # Of the second against the first about the vertical, rad.
    hop_s: float  # From one window to the next, s.
    problems: tuple[Finding, ...] = field(default=())  # What is wrong between the two; empty where nothing is.
    agrees: bool = False  # Whether what moves moves together.

    @property
    def moving(self) -> BoolArray:
        """The axes along which the first moves by more than noise, shape (3,)."""
        return np.asarray(self.first.std(axis=0) > self.pair.floor)

    @property
    def visible(self) -> BoolArray:
        """The axes along which one of the two moves by more than noise, shape (3,)."""
        return np.asarray(self.moving | (self.second.std(axis=0) > self.pair.floor))


class Offset(NamedTuple):
    """A constant by which the second of a pair exceeds the first."""

    pair: Pair
    in_body: bool  # Whether it is one in axes of the body.
    values: Array  # Shape (flight, axis).
    sure: BoolArray  # Alike: which are no chance, and nothing that looks like a constant.
    names: Sequence[str]

    @property
    def sizes(self) -> dict[int, tuple[float, float]]:
        """The smallest and the largest along each axis that has one."""
        own = {i: self.values[sure, i] for i, sure in enumerate(self.sure.T) if sure.any()}
        return {i: (float(values.min()), float(values.max())) for i, values in own.items()}

    @property
    def flights(self) -> list[str]:
        """Names of the flights that have one."""
        return [name for name, sure in zip(self.names, self.sure, strict=True) if np.any(sure)]


class _Constant(NamedTuple):
    """By how much a channel exceeds another in one flight, each shape (axis,)."""

    value: Array
    error: Array
    halves: Array  # Shape (half, axis).
    mean: Array  # Of what is compared.
    unexplained: float


_PAIRS = (
    Pair("position", "velocity", 0.2),
    Pair("velocity", "acceleration", 0.5),
    Pair("velocity", "specific_force", 0.5),
    Pair("acceleration", "specific_force", 0.5),
    Pair("thrust", "velocity", 0.5),
    Pair("thrust", "acceleration", 0.5),
    Pair("thrust", "specific_force", 0.5),
)


def checked(flights: Sequence[Signals], windows: Windows, channel: str | None = None) -> tuple[PairCheck, ...]:
    """Compare channels with the derivatives of others.

    `channel`: the one that is compared with the others; None for all pairs.
    """
    pairs = [pair for pair in _PAIRS if channel is None or channel in pair]
    return tuple(check for pair in pairs if (check := _checked(pair, flights, windows)) is not None)


def against_lean(part: Signals) -> Iterator[Finding]:
    """Say which of position and velocity no lean makes of gravity in their unit, where the lean explains them."""
    from scipy.spatial.transform import Rotation

    if part.attitude is None or len(part) * part.period < _LEAST_OF_LEAN_S:
        return
    rotation, rate_hz = Rotation.from_matrix(part.rotation), 1 / part.period
    for name, order in (("position", second_derivative), ("velocity", first_derivative)):
        values = _reading(name, part)
        if values is None:
            continue
        fit = fit_lean(rotation, Ground.of(order(values, rate_hz), rate_hz), rate_hz)
        if fit.explained > _SHARED and not 1 / _ANOTHER_LENGTH < fit.gain < _ANOTHER_LENGTH:
            what = f"the {CHANNELS[name].words} is {fit.gain:.3g} times what tilt and gravity make it"
            yield Finding(what, f"check import.signals.{name}.unit", (CHANNELS[name].words, "attitude"), fit.gain)


def by_thrust(checks: Sequence[PairCheck]) -> list[PairCheck]:
    """Select what is compared with the thrust in world axes."""
    return [check for check in checks if check.pair.first == "thrust" and check.pair.second != "specific_force"]


def _checked(pair: Pair, flights: Sequence[Signals], windows: Windows) -> PairCheck | None:
    rows = [(signals, row) for signals in flights if (row := _row(pair, signals, windows)) is not None]
    if not rows:
        return None
    first, second, change = (np.concatenate(part) for part in zip(*(row for _, row in rows), strict=True))
    index = np.repeat(np.arange(len(rows)), [len(row[0]) for _, row in rows])
    block = blocks_of(index, np.concatenate([windows.centres(signals.time) for signals, _ in rows]), BLOCK_S)
    a, b, slope = (part - part.mean(axis=0) for part in (first, second, change))
    shared, power, other_power = ((x * y).sum(axis=0) for x, y in ((a, b), (a, a), (b, b)))
    moves = (power > TINY) & (other_power > TINY)
    check = PairCheck(
        pair,
        first,
        second,
        # Noise on either side pulls one regression down and the other up; their geometric mean lies between.
        scale=np.sign(shared) * np.sqrt(np.divide(other_power, power, out=np.zeros(3), where=moves)),
        r2=np.divide(shared**2, power * other_power, out=np.zeros(3), where=moves),
        delay=_late(a - b, slope, block),
        turn=_turned(a, b, slope, block),
        hop_s=windows.hop * windows.period,
    )
    problems = tuple(_problems(check))
    together = bool(check.moving.any() and (check.r2[check.moving] > _SHARED).all())
    return replace(check, problems=problems, agrees=together and not problems)


def _row(pair: Pair, signals: Signals, windows: Windows) -> tuple[Array, Array, Array] | None:
    """Average both channels over windows, and the derivative of one that is averaged as it is."""
    first, second = _reading(pair.first, signals), _reading(pair.second, signals)
    if first is None or second is None or not windows.count(len(signals)):
        return None
    if pair.first == "position":
        return windows.derivative(first), windows.average(second), windows.derivative(second)
    if signals.attitude is None and ("specific_force" in pair or "thrust" in pair):
        return None
    # What is fixed to the body is compared there, where its delay is that of the sensor alone.
    into = _in_body if pair.second == "specific_force" else _in_world
    (one, early), (other, late) = into(pair.first, first, signals, windows), into(pair.second, second, signals, windows)
    change = late if late is not None else early
    assert change is not None, "the velocity is not compared with itself"
    return one, other, change


def _reading(name: str, signals: Signals) -> Array | None:
    """Give a channel; of thrust the specific force by the rotors alone, since a stated one may hold anything."""
    if name != "thrust":
        reading: Array | None = getattr(signals, name)
        return reading
    if signals.thrust is None or signals.rotor_speed is None:
        return None
    return np.asarray(signals.thrust[:, None] / signals.vehicle.mass_kg * [0.0, 0.0, 1.0])


def _in_world(name: str, values: Array, signals: Signals, windows: Windows) -> tuple[Array, Array | None]:
    """Average the acceleration that a channel shows, in world axes, and its derivative where it can be had."""
    if name == "velocity":
        return windows.derivative(values), None
    if name == "thrust":
        values = np.einsum("tij,tj->ti", signals.rotation, values) - signals.vehicle.gravity_m_s2 * UP
    return windows.average(values), windows.derivative(values)


def _in_body(name: str, values: Array, signals: Signals, windows: Windows) -> tuple[Array, Array | None]:
    """Average the specific force that a channel shows, in body axes, and its derivative where it can be had."""
    if name == "velocity":
        speed = signals.ground_velocity
        held = np.cross(signals.body_rate, speed) + signals.vehicle.gravity_m_s2 * signals.rotation[:, 2]
        return windows.derivative(speed) + windows.average(held), None
    if name == "acceleration":
        values = np.einsum("tji,tj->ti", signals.rotation, values + signals.vehicle.gravity_m_s2 * UP)
    return windows.average(values), windows.derivative(values)


def _regressed(columns: Array, right: Array, block: IntArray) -> Array:
    """Fit columns, shape (window, axis, column), to a right side: all blocks, then without each, (fit, column)."""
    normal, every = folds(columns, right, block), np.arange(columns.shape[2])
    return np.concatenate([normal.fit(every)[0].T, normal.solve(every)[0][..., 0]])


def _sure(fits: Array) -> Sure:
    return Sure(float(fits[0]), float(jackknife_error(fits[1:])), len(fits) - 1)


def _late(apart: Array, slope: Array, block: IntArray) -> Sure:
    """Fit the delay of one against the other."""
    return _sure(_regressed(slope[:, :, None], apart, block)[:, 0]) if block.any() and slope.any() else _NOT_KNOWN


def _turned(a: Array, b: Array, slope: Array, block: IntArray) -> Sure:
    """Fit the turn of one about the vertical against the other, jointly with its delay; a jackknife over blocks.

    In a steady circle what is late is turned: where most of a turn could be a delay, nothing is known of it.
    """
    columns = np.stack([a[:, :2], a[:, :2] @ _QUARTER, slope[:, :2]], axis=2)
    _, across, late = (columns**2).sum(axis=(0, 1))
    shared = float((columns[..., 1] * columns[..., 2]).sum()) ** 2
    if not block.any() or min(across, late) <= 0 or shared > _COULD_BE_LATE * across * late:
        return _NOT_KNOWN
    fits = _regressed(columns, b[:, :2], block)
    return _sure(fits[:, 1] / np.where(fits[:, 0], fits[:, 0], TINY))


def offsets(checks: Sequence[PairCheck], flights: Sequence[Signals], windows: Windows) -> Iterator[Offset]:
    """Find channels with a constant that the derivative of position or velocity does not have.

    It is a number of each flight, in axes of the world or of the body, whichever leaves less; fitted jointly with
    scales and axes that are off, a delay, and a lever from the centre of mass. In blocks of an eighth of a flight slow
    errors count. A velocity that is rotated a little, and an attitude that leans, make one as well: the first is
    bounded by the mean velocity, and of the second the thrust knows.

    `checks`: of these flights.
    """
    least = ENOUGH_BLOCKS * block_length(0.0)
    long = [each for each in flights if each.attitude is not None and len(each) * each.period >= least]
    for check in checks:
        pair, wrong = check.pair, any(each.contradiction for each in check.problems)
        known = [each for each in long if _row(pair, each, windows) is not None]
        if wrong or not known or pair.first not in ("position", "velocity"):
            continue
        fits = [_constants(pair, each, windows) for each in known]
        left = {body: sum(fit[body].unexplained for fit in fits) for body in fits[0]}
        body = bool(less(left[True], left.get(False, np.inf)))
        judged = zip(fits, known, strict=True)
        sure = np.array([_is_sure(pair, fit[body], each, windows, in_body=body) for fit, each in judged])
        if sure.any():
            yield Offset(pair, body, np.array([fit[body].value for fit in fits]), sure, [each.name for each in known])


def _constants(pair: Pair, signals: Signals, windows: Windows) -> dict[bool, _Constant]:
    """Fit the constant of one flight in axes of the world and, true, of the body."""
    rows = _row(pair, signals, windows)
    assert rows is not None, "both are logged"
    first, second, slope = rows
    turn, spin = signals.rotation, cross(signals.body_rate[:, None], np.eye(3)).swapaxes(1, 2)
    own = np.broadcast_to(np.eye(3), (len(first), 3, 3))
    if pair.second == "specific_force":
        frames, lever = {True: own}, windows.balance(spin @ spin, spin)
    else:
        frames = {False: own, True: windows.average(turn)}
        lever = (windows.average if pair.first == "position" else windows.derivative)(turn @ spin)
    # What is compared holds no error of the channel, which would explain itself.
    scale = np.einsum("ij,wk->wijk", np.eye(3), first - first.mean(axis=0)).reshape(len(first), 3, 9)
    columns = np.concatenate([scale, slope[:, :, None], lever, *frames.values()], axis=2)
    parts = contiguous(len(first), ENOUGH_BLOCKS)
    blocks, halves = (folds(columns, second - first, own) for own in (parts, contiguous(len(first), 2)))
    found = {}
    for body, last in zip(frames, range(columns.shape[2] - 3 * len(frames), columns.shape[2], 3), strict=True):
        chosen = np.r_[:13, last : last + 3]
        value, left = blocks.fit(chosen)
        without, halved = (each.solve(chosen)[0][:, -3:, 0] for each in (blocks, halves))
        apart = np.einsum("wji,wj->wi", frames[body], second - first)
        means = np.array([apart[parts != number].mean(axis=0) for number in range(ENOUGH_BLOCKS)])
        # Scales explain away what noise of a position moves, and with it how far the mean of that scatters.
        error = np.hypot(serial_error(without), serial_error(means))
        found[body] = _Constant(value[-3:, 0], error, halved, first.mean(axis=0), float(left.sum()))
    return found


def _is_sure(pair: Pair, fit: _Constant, signals: Signals, windows: Windows, *, in_body: bool) -> BoolArray:
    """Check which constants are large, significant, and those of both halves and against the thrust, shape (axis,)."""
    size = np.abs(fit.value)
    least = _LEAST[pair.second] + TURNED_RAD * np.linalg.norm(fit.mean) * (pair.first == "position")
    sure = size > np.maximum(least, half_width(fit.error, ENOUGH_BLOCKS, 1 - _CHANCE))
    sure &= np.abs(fit.halves - fit.value).max(axis=0) < _APART * size
    if pair.first == "velocity" and sure[:2].any():
        thrust = Pair("thrust", *pair[1:])
        known = _row(thrust, signals, windows) is not None
        shared = _constants(thrust, signals, windows)[in_body].value if known else np.zeros(3)
        # Along the thrust its own size is not known so well, and no lean shows.
        sure[:2] &= (np.abs(shared - fit.value) < _APART * size)[:2]
    return np.asarray(sure)


def _problems(check: PairCheck) -> Iterator[Finding]:
    """Say what is wrong between two channels: axes, or else scale, gravity, clock and heading."""
    pair = check.pair
    frames = list(axes_apart(pair.words, check.first, check.second, pair.floor))
    late_s, alike = _most_alike(check, np.flatnonzero(check.moving)) if frames else (0.0, 0.0)
    if alike > SAME:
        if pair.exact:
            yield pair.finding(f"in {pair.words}, the second is {off_clock(late_s)}", late_s, "s", contradiction=False)
        return
    if frames:
        yield from (pair.finding(what, correlation) for what, correlation in frames)
        return
    yield from _scales_off(check)
    offset = check.second.mean(axis=0) - check.first.mean(axis=0)
    # A thrust may be off by as much as a wrong factor makes it.
    most = _GRAVITY_OFF_M_S2 if pair.exact else STANDARD_GRAVITY / 2
    for axis, own in zip(AXES, offset.tolist(), strict=True):
        if pair.first != "position" and abs(own) > most:
            what = f"{pair.words} differ by {own:.1f} m/s^2 along {axis}, as if one included gravity"
            yield pair.finding(what, own, "m/s^2")
    if pair.exact and check.visible.any() and check.delay.beyond(_DELAY_OFF_S):
        late = off_clock(check.delay.value, check.delay.half)
        what = f"in {pair.words}, the second is {late}"
        yield pair.finding(what, check.delay.value, "s", contradiction=False)
    if pair.exact and pair.second != "specific_force" and _is_turned(check):
        angle = float(np.arctan(check.turn.value))
        what = f"{pair.words} are rotated relative to each other by {abs(np.degrees(angle)):.0f} deg about the vertical"
        yield pair.finding(what, angle, "rad", contradiction=bool(abs(angle) > ANOTHER_NORTH))


def _most_alike(check: PairCheck, axes: IntArray) -> tuple[float, float]:
    """Find the delay, s, with which both move most alike along axes, and the least of their correlations then.

    It decides whether axes differ, in quarters of a hop; `PairCheck.delay` is the estimate. What swings at one
    frequency and is late by a quarter of its period looks like another axis, and by a half reversed.
    """
    index = np.arange(len(check.first))
    most = min(int(_PER_HOP * LATEST_S / check.hop_s), len(index))

    def alike(steps: int) -> float:
        places = index + steps / _PER_HOP
        inside = (places >= 0) & (places <= index[-1])
        moved = np.column_stack([np.interp(places[inside], index, check.second[:, axis]) for axis in axes])
        return _correlation(check.first[inside][:, axes], moved)

    if not len(axes) or not most:
        return 0.0, 0.0
    # In a steady circle late and early are the same; and estimates are late.
    late, early = (largest([sign * size for size in range(1, most + 1)], alike) for sign in (1, -1))
    best = late if alike(late) > SAME else largest([late, early], alike)
    return best / _PER_HOP * check.hop_s, alike(best)


def _correlation(first: Array, second: Array) -> float:
    """Give the least correlation of columns with their like."""
    with np.errstate(invalid="ignore", divide="ignore"):
        pairs = zip(first.T, second.T, strict=True)
        return float(min(np.nan_to_num(np.corrcoef(one, other)[0, 1]) for one, other in pairs))


def _is_turned(check: PairCheck) -> bool:
    """Check whether a turn about the vertical leaves less between two than any delay does."""
    plane = np.array([0, 1])
    if not check.visible[plane].all() or not check.turn.beyond(TURNED_RAD):
        return False
    angle = np.arctan(check.turn.value)
    turned = check.first[:, :2] * np.cos(angle) + check.first[:, :2] @ _QUARTER * np.sin(angle)
    _, late = _most_alike(check, plane)
    return 1 - _correlation(turned, check.second[:, :2]) < _LEAVES_LESS * (1 - late)


def _scales_off(check: PairCheck) -> Iterator[Finding]:
    """Say which axes have scales that are off whichever side the noise is on, together where one mistake makes them."""
    # Model and vehicle may differ by a missing effect; only what no effect does counts against the thrust.
    allowed = 1 + (_SCALE_OFF if check.pair.exact else TWICE - 1)
    known = (check.r2 > SAME**2) & check.visible
    root = np.sqrt(np.where(known, check.r2, 1.0))
    either = np.array([check.scale * root, check.scale / root])
    off = np.flatnonzero(known & ((either > allowed).all(axis=0) | (either < 1 / allowed).all(axis=0)))
    scales = check.scale[off].tolist()
    axes = [AXES[axis] for axis in off]
    if scales and 0 < max(scales) < _ONE_SCALE * min(scales):
        yield _of_scale(check.pair, axes, float(np.median(scales)))
    else:
        yield from (_of_scale(check.pair, [axis], scale) for axis, scale in zip(axes, scales, strict=True))


def _of_scale(pair: Pair, axes: Sequence[str], scale: float) -> Finding:
    lengths = CHANNELS["position"].units.items() if pair.first == "position" else ()
    unit = next((unit for unit, metres in lengths if 1 / _ONE_SCALE < scale / metres < _ONE_SCALE), "")
    asked = f": is the position in {unit}" if unit else ""
    what = f"the scales of {pair.words} along {joined(axes)} differ by a factor of {scale:#.3g}{asked}"
    return pair.finding(what, scale, contradiction=not 1 / TWICE < scale < TWICE)
