"""Position, velocity, accelerations and thrust held against each other: which two contradict each other."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.blocks import jackknife_error
from cpfls_cli.consistency.axes import AXES, SAME, TWICE, axes_apart
from cpfls_cli.consistency.findings import Finding, joined
from cpfls_cli.effects.signals import Signals
from cpfls_cli.weak_form.resampling import BLOCK_S, blocks_of
from cpfls_cli.weak_form.windows import Windows

# Filters and drag make a fifth; a third of gravity is neither a bias nor a tilt of a sensor.
_SCALE_OFF, _GRAVITY_OFF_M_S2 = 0.2, 3.0
# From here on a delay costs more force than noise does, and a turn more than the mounting of a sensor.
_DELAY_OFF_S = 0.005
TURNED_RAD = np.radians(3.0)
# A jackknife over few blocks has heavy tails.
_SIGMAS = 6.0
ANOTHER_NORTH = np.radians(20.0)
"""Turn about the vertical from which on a world has another north; 23 real flights are turned by 4 degrees at most."""

# Share of what moves in both that agreement asks for, and the ratio within which scales of axes are one.
_TOGETHER, _ALIKE = 0.5, 1.05
_LENGTHS = {"mm": 0.001, "cm": 0.01, "ft": 0.3048}
"""Metres of units of length that a position is logged in."""
TINY = 1e-100
"""Square of what does not move."""


class ChannelMatch(NamedTuple):
    """How the derivative of one channel follows another, about one axis.

    Attributes
    ----------
    channels : str
    axis : str
    scale : float
        Of the second against the first.
    r2 : float
    delay_s : float
        Of the second against the first.
    offset : float
        Mean of the second less that of the first.
    """

    channels: str
    axis: str
    scale: float
    r2: float
    delay_s: float
    offset: float


class Sure(NamedTuple):
    """A number with its standard error."""

    value: float
    error: float

    def beyond(self, size: float) -> bool:
        """Tell whether it is surely not zero, and larger than a size."""
        return abs(self.value) > max(size, _SIGMAS * self.error)


class _Pair(NamedTuple):
    first: str
    second: str
    floor: float

    @property
    def words(self) -> str:
        return f"{NAMES[self.first]} and {NAMES[self.second]}"

    @property
    def channels(self) -> tuple[str, str]:
        return NAMES[self.first], NAMES[self.second]

    @property
    def remedy(self) -> str:
        keys = dict.fromkeys(KEYS[name] for name in self[:2])
        return f"check {', '.join(keys)}"

    @property
    def exact(self) -> bool:
        """Whether only sensors decide whether the two agree, and no model."""
        return "thrust" not in self


class PairCheck(NamedTuple):
    """Two channels held against each other.

    Attributes
    ----------
    pair : tuple of str and float
        The two, and what moves.
    first, second : array, shape (window, 3)
        What should be the same.
    matches : tuple of ChannelMatch
    delay : Sure
        Of the second against the first, s.
    turn : Sure
        Of the second against the first about the vertical, rad.
    problems : tuple of Finding
        What is wrong between the two; empty where nothing is.
    agrees : bool
        Whether what moves moves together.
    """

    pair: _Pair
    first: Array
    second: Array
    matches: tuple[ChannelMatch, ...]
    delay: Sure
    turn: Sure
    problems: tuple[Finding, ...]
    agrees: bool


NAMES = {
    "position": "position",
    "velocity": "velocity",
    "acceleration": "acceleration",
    "specific_force": "accelerometer",
    "thrust": "thrust of the rotors",
}
"""Channels of the motion in words."""

KEYS = {
    "position": "import.signals.position",
    "velocity": "import.signals.velocity and import.world_frame",
    "acceleration": "import.signals.acceleration and import.acceleration_frame",
    "specific_force": "import.signals.acceleration, import.acceleration_frame and import.body_frame",
    "thrust": "vehicle.rotors",
}
"""What of the config says how each is read."""

_PAIRS = (
    _Pair("position", "velocity", 0.2),
    _Pair("velocity", "acceleration", 0.5),
    _Pair("velocity", "specific_force", 0.5),
    _Pair("acceleration", "specific_force", 0.5),
    _Pair("thrust", "velocity", 0.5),
    _Pair("thrust", "acceleration", 0.5),
    _Pair("thrust", "specific_force", 0.5),
)


def _pushed(signals: Signals) -> Array | None:
    """Compute the specific force of thrust alone, in body axes; a stated thrust may hold anything."""
    if signals.thrust is None or signals.rotor_speed is None:
        return None
    return np.asarray(signals.thrust[:, None] / signals.vehicle.mass_kg * [0.0, 0.0, 1.0])


def _weight(signals: Signals) -> Array:
    return np.array([0.0, 0.0, signals.vehicle.gravity_m_s2])


_READ: Mapping[str, Callable[[Signals], Array | None]] = {
    "position": lambda signals: signals.position,
    "velocity": lambda signals: signals.velocity,
    "acceleration": lambda signals: signals.acceleration,
    "specific_force": lambda signals: signals.specific_force,
    "thrust": _pushed,
}


def checked(flights: Sequence[Signals], windows: Windows, channel: str | None = None) -> tuple[PairCheck, ...]:
    """Compare channels with the derivatives of others.

    Parameters
    ----------
    flights : sequence of Signals
    windows : Windows
    channel : str or None
        The one that is compared with the others; None for all pairs.
    """
    pairs = [pair for pair in _PAIRS if channel is None or channel in pair]
    return tuple(check for pair in pairs if (check := _checked(pair, flights, windows)) is not None)


def by_thrust(checks: Sequence[PairCheck]) -> list[PairCheck]:
    """Select what is compared with the thrust in world axes."""
    return [check for check in checks if check.pair.first == "thrust" and check.pair.second != "specific_force"]


def _checked(pair: _Pair, flights: Sequence[Signals], windows: Windows) -> PairCheck | None:
    rows = [(signals, row) for signals in flights if (row := _row(pair, signals, windows)) is not None]
    if not rows:
        return None
    first, second, change = (np.concatenate(part) for part in zip(*(row for _, row in rows), strict=True))
    index = np.repeat(np.arange(len(rows)), [len(row[0]) for _, row in rows])
    block = blocks_of(index, np.concatenate([windows.centres(signals.time) for signals, _ in rows]), BLOCK_S)
    a, b, slope = (part - part.mean(axis=0) for part in (first, second, change))
    matches = tuple(_matches(pair.words, a, b, slope, second.mean(axis=0) - first.mean(axis=0)))
    delay = _ratio(((a - b) * slope).sum(axis=1), (slope**2).sum(axis=1), block)
    turn = _ratio(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0], (a[:, :2] * b[:, :2]).sum(axis=1), block)
    moving = [i for i in range(3) if first[:, i].std() > pair.floor]
    together = bool(moving) and all(matches[i].r2 > _TOGETHER for i in moving)
    problems = tuple(_problems(pair, first, second, matches, delay, turn))
    return PairCheck(pair, first, second, matches, delay, turn, problems, together and not problems)


def _row(pair: _Pair, signals: Signals, windows: Windows) -> tuple[Array, Array, Array] | None:
    """Average both channels over windows, and the derivative of one that is averaged as it is."""
    first, second = _READ[pair.first](signals), _READ[pair.second](signals)
    if first is None or second is None or not windows.count(len(signals)):
        return None
    if pair.first == "position":
        return windows.derivative(first), windows.average(second), windows.derivative(second)
    if signals.attitude is None and ("specific_force" in pair or "thrust" in pair):
        return None
    # What is fixed to the body is compared there, where its delay is that of the sensor alone.
    into = _in_body if pair.second == "specific_force" else _in_world
    (one, early), (other, late) = (into(name, signals, windows) for name in pair[:2])
    change = late if late is not None else early
    assert change is not None, "the velocity is not compared with itself"
    return one, other, change


def _in_world(name: str, signals: Signals, windows: Windows) -> tuple[Array, Array | None]:
    """Average the acceleration that a channel shows, in world axes, and its derivative where it can be had."""
    values = _READ[name](signals)
    assert values is not None, "looked at before"
    if name == "velocity":
        return windows.derivative(values), None
    if name == "thrust":
        values = np.einsum("tij,tj->ti", signals.rotation, values) - _weight(signals)
    return windows.average(values), windows.derivative(values)


def _in_body(name: str, signals: Signals, windows: Windows) -> tuple[Array, Array | None]:
    """Average the specific force that a channel shows, in body axes, and its derivative where it can be had."""
    values = _READ[name](signals)
    assert values is not None, "looked at before"
    if name == "velocity":
        speed = signals.ground_velocity
        held = np.cross(signals.body_rate, speed) + signals.vehicle.gravity_m_s2 * signals.rotation[:, 2]
        return windows.derivative(speed) + windows.average(held), None
    if name == "acceleration":
        values = np.einsum("tji,tj->ti", signals.rotation, values + _weight(signals))
    return windows.average(values), windows.derivative(values)


def _matches(name: str, a: Array, b: Array, slope: Array, offset: Array) -> Iterator[ChannelMatch]:
    shared, first, second = ((x * y).sum(axis=0) for x, y in ((a, b), (a, a), (b, b)))
    moves = (first > TINY) & (second > TINY)
    # Noise on either side pulls one regression down and the other up; their geometric mean lies between.
    scale = np.sign(shared) * np.sqrt(np.divide(second, first, out=np.zeros(3), where=moves))
    r2 = np.divide(shared**2, first * second, out=np.zeros(3), where=moves)
    delay = ((a - b) * slope).sum(axis=0) / np.maximum((slope**2).sum(axis=0), TINY)
    for i, axis in enumerate(AXES):
        yield ChannelMatch(name, axis, float(scale[i]), float(r2[i]), float(delay[i]), float(offset[i]))


def _ratio(top: Array, bottom: Array, block: IntArray) -> Sure:
    """Divide two sums, with a jackknife over blocks."""
    tops, bottoms = np.bincount(block, top), np.bincount(block, bottom)
    if len(tops) < 2 or not bottoms.sum():
        return Sure(0.0, np.inf)
    left_out = (tops.sum() - tops) / np.where(bottoms.sum() == bottoms, 1.0, bottoms.sum() - bottoms)
    return Sure(float(tops.sum() / bottoms.sum()), float(jackknife_error(left_out)))


def _problems(
    pair: _Pair, first: Array, second: Array, matches: Sequence[ChannelMatch], delay: Sure, turn: Sure
) -> Iterator[Finding]:
    frames = axes_apart(pair.words, pair.channels, first, second, pair.floor, pair.remedy)
    if frames:
        yield from frames
        return
    # Model and vehicle may differ by a missing effect; only what no effect does counts against the thrust.
    allowed = _SCALE_OFF if pair.exact else TWICE - 1
    off = [each for each in matches if each.r2 > SAME**2 and _scale_off(each, allowed)]
    scales = [each.scale for each in off]
    if off and 0 < max(scales) < _ALIKE * min(scales):
        yield _of_scale(pair, [each.axis for each in off], float(np.median(scales)))
    else:
        yield from (_of_scale(pair, [each.axis], each.scale) for each in off)
    for each in matches:
        if pair.first != "position" and abs(each.offset) > _GRAVITY_OFF_M_S2:
            what = f"{each.channels} differ by {each.offset:.1f} m/s^2 along {each.axis}, as gravity would make them"
            yield Finding(what, pair.remedy, pair.channels, each.offset, "m/s^2")
    if pair.exact and delay.beyond(_DELAY_OFF_S):
        late = "late" if delay.value > 0 else "early"
        what = f"in {pair.words}, the second is {late} by {abs(1000 * delay.value):.0f} ms"
        yield Finding(what, pair.remedy, pair.channels, delay.value, "s", contradiction=False)
    if pair.exact and pair.second != "specific_force" and turn.beyond(TURNED_RAD):
        angle = float(np.arctan(turn.value))
        what = f"{pair.words} are turned against each other by {abs(np.degrees(angle)):.0f} deg about the vertical"
        yield Finding(what, pair.remedy, pair.channels, angle, "rad", contradiction=abs(angle) > ANOTHER_NORTH)


def _of_scale(pair: _Pair, axes: Sequence[str], scale: float) -> Finding:
    unit = next((unit for unit, metres in _LENGTHS.items() if 1 / _ALIKE < scale / metres < _ALIKE), "")
    asked = f": is the position in {unit}" if unit and pair.first == "position" else ""
    what = f"the scales of {pair.words} along {joined(axes)} differ by a factor of {scale:#.3g}{asked}"
    return Finding(what, pair.remedy, pair.channels, scale, contradiction=not 1 / TWICE < scale < TWICE)


def _scale_off(match: ChannelMatch, allowed: float) -> bool:
    """Tell whether the scale is off whichever side the noise is on."""
    either = (match.scale * np.sqrt(match.r2), match.scale / np.sqrt(match.r2))
    return all(each > 1 + allowed for each in either) or all(each < 1 / (1 + allowed) for each in either)
