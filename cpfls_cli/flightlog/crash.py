"""How a flight ends before its time: impact, tumble, on its back, rotors that stop in the air."""

from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Final, Literal, NamedTuple

import numpy as np
from scipy.ndimage import binary_closing, binary_dilation, binary_opening, correlate1d

from cpfls_cli.arrays import Array, BoolArray, IntArray, runs
from cpfls_cli.units import STANDARD_GRAVITY

ALIVE = 0.02  # Share of the largest command below which rotors stand.
# For how long it rests at least, the rate below which it does, however it shakes, and in all, by which it would turn by
# some 10 degrees; and that above which it surely flies.
_REST_S, _CALM_RAD_S, _TURNED_RAD_S, LIVELY_RAD_S = 1.5, 0.5, 0.15, 0.05
SLOW_S = 0.5  # Means over so long hold no vibration.
# Of gravity: size of the force that carries a vehicle at rest, its share along the thrust below which no rotor does,
# more than 60 degrees off, and the mean force from which on it climbs or turns.
_WEIGHT, _OFF_THRUST, _LIFTS = (0.8, 1.2), 0.5, 1.05
_SENSES = (0.7, 2.0)  # Of gravity: the median force of a log, by which an accelerometer and its unit are believed.
# For how long no rotor that carries the weight can be above its vehicle, which would fall 88 m meanwhile; and the share
# of the time with rotors on that is so where an attitude is wrong throughout.
_OVER_S, _OVER = 3.0, 0.2
# Difference between rotors that turns every vehicle, as a share of the largest command and of what is usual; the rate
# below which it does not turn, as a share of what is usual and by itself.
_STUCK, _STUCK_TIMES, _OF_RATE, _HARDLY_RAD_S = 0.15, 6.0, 0.3, 0.1
# Norm of the differences of four rotors, which have none to spare, from their mean; the rate below which something else
# than they must hold it; the cosine between weight and rotors of what leans; and the share of the largest rotor that
# all others are below where it works alone.
_HELD_FOUR, _HELD_RAD_S, _LEANS, _ALONE = 0.4, 2.0, 0.95, 0.25
# Before the end of a stretch, where a crash is looked for; flight before that, which shows what it does in flight; and
# the time from its last wild motion to the end, in which no pilot has recovered.
_LAST_S, _FEWEST_S, _AT_ONCE_S = 10.0, 5.0, 2.0
# After the end of a stretch, where its crash may go on, and until when a vehicle that crashed lies.
_THEN_S, _LIES_S = 1.0, 3.0
# Times the largest of the flight before, and sizes at least, the last in gravity, that no rotor makes.
BEYOND, _WILD_RAD_S, _WILD_RAD_S2, HARD = 1.5, 5.0, 100.0, 3.0
# Rate and lean beyond those of the flight before, at least, by which control is lost where a rotor is at its limit, as
# a share of the largest command.
_STRAINED_RAD_S, _STRAINED_RAD, _AT_LIMIT = 1.0, 0.5, 0.95
# Over which the turning of a vehicle is held against its rotors, and the share of it that they leave where it does not
# follow them.
_TURN_S, _NOT_FOLLOWED = 0.1, 0.7
# Force in gravity that a vehicle feels in free fall at most, for how long, and the height that it loses in a second, m.
_FALLS, _FALL_S, _DROP_M = 0.3, 0.2, 1.0
# Share of its weight in flight, below which what it feels to the end of a log is no ground.
_HARDLY_CARRIED = 0.7
# Descent that is no flight, and for how long: 75 m.
_PLUNGES_M_S, _PLUNGE_S = 25.0, 3.0


@dataclass(frozen=True, kw_only=True)
class Signs:
    """What a log holds on whether the vehicle flies, on a uniform clock."""

    time: Array  # Shape (time,), s; as it is said.
    rotors: Array | None = None  # Shape (time, rotor), or None; commands or speeds as shares, 0 where they stand.
    height: Array | None = None  # Shape (time,), m, or None; upward.
    body_rate: Array | None = None  # Shape (time, 3), rad/s; or None
    # Shape (time,), or None; cosine of the lean; of either sign, as frames of logs have it.
    upright: Array | None = None
    force: Array | None = None  # Shape (time, 3), body frame, or None; of an accelerometer, in m/s^2 or in g.

    @property
    def period(self) -> float:
        """Sampling period, s."""
        return float(self.time[1] - self.time[0])

    @cached_property
    def level(self) -> Array | None:
        """Mean of the rotors, shape (time,)."""
        return None if self.rotors is None else np.nan_to_num(self.rotors.mean(axis=1))

    @cached_property
    def rate(self) -> Array | None:
        """Body rate without what it reads at rest, shape (time, 3), rad/s."""
        return None if self.body_rate is None else self.body_rate - np.median(self.body_rate, axis=0)

    @cached_property
    def turning(self) -> Array | None:
        """Size of that rate, shape (time,), rad/s."""
        return None if self.rate is None else np.asarray(np.linalg.norm(self.rate, axis=1))

    @cached_property
    def slow(self) -> Array | None:
        """Size of what is slow of it, shape (time,), rad/s."""
        if self.rate is None:
            return None
        return np.asarray(np.linalg.norm(averaged(self.rate, self.period, SLOW_S), axis=1))

    @cached_property
    def felt(self) -> Array | None:
        """What an accelerometer feels, shape (time, 3), in weights; None where it does not feel about one."""
        if self.force is None:
            return None
        size = float(np.median(np.linalg.norm(self.force, axis=1)))
        units = (unit for unit in (STANDARD_GRAVITY, 1.0) if _SENSES[0] < size / unit < _SENSES[1])
        return next((self.force / unit for unit in units), None)

    def slower(self, most_hz: float) -> "Signs":
        """Take no more samples a second than are asked for; of each few the first."""
        every = max(1, int(1 / (most_hz * self.period)))
        held = {each.name: getattr(self, each.name) for each in fields(self)}
        return replace(self, **{name: own[::every] for name, own in held.items() if own is not None})


# How a flight ends before its time, and how that is said of its moment, s.
MOMENTS: Final = {
    "loss of control": "loss of control at {:.1f} s",
    "free fall": "it falls freely from {:.1f} s on",
    "impact": "impact at {:.1f} s",
    "rests with its rotors on": "from {:.1f} s on it rests on something, with its rotors on",
    "rotors stop in the air": "the rotors stop in the air at {:.1f} s",
}


def upright_of(attitude: Array | None, quaternion: Array | None, order: Literal["wxyz", "xyzw"]) -> Array | None:
    """Give the cosine of the lean by roll, pitch, yaw, rad, or else by a quaternion; None without both."""
    if attitude is not None:
        return np.asarray(np.cos(attitude[:, 0]) * np.cos(attitude[:, 1]))
    if quaternion is None:
        return None
    across = quaternion[:, 1:3] if order == "wxyz" else quaternion[:, :2]
    return np.asarray(1 - 2 * (across**2).sum(axis=1) / np.maximum((quaternion**2).sum(axis=1), 1e-12))


def averaged(values: Array, period: float, seconds: float) -> Array:
    """Average values, shape (time,) or (time, column), over so many s around each sample."""
    width = max(1, round(seconds / period))
    if len(values) < width:
        return np.broadcast_to(values.mean(axis=0), values.shape)
    window = np.ones(width) / width
    return np.asarray(correlate1d(np.asarray(values, dtype=float), window, axis=0, mode="mirror"))


def smoothed(marked: BoolArray, period: float, shortest_s: float) -> BoolArray:
    """Fill short pauses, then drop short stretches."""
    width = max(1, round(shortest_s / period))
    around = np.pad(marked, width, mode="edge")
    window = np.ones(width, dtype=np.bool_)
    return np.asarray(binary_opening(binary_closing(around, window), window)[width:-width], dtype=np.bool_)


class Resting(NamedTuple):
    """Where something else than its rotors carries a vehicle that may fly, and where it lies on its side or back."""

    carried: BoolArray
    lies: BoolArray
    plunges: int = -1  # First sample of a fall that it does not fly out of; -1 where there is none.


def resting(signs: Signs, active: BoolArray) -> Resting:
    """Mark where a vehicle whose rotors turn is carried by something else than them.

    Rotors push along one axis of the body: where the accelerometer feels the weight along another one while the vehicle
    hardly turns, it lies on its side or back. Without an accelerometer it lies where it is more than 90 degrees over.
    It also rests where its rotors ask it to turn and it does not. What falls as no flight does flies no more.
    """
    nowhere = np.zeros(len(active), dtype=bool)
    if signs.slow is None or signs.rate is None or not active.any():
        return Resting(nowhere, nowhere)
    held = active & _held_four(signs)
    free = active & ~held
    if not free.any():
        return Resting(held, nowhere)
    lively = free & (signs.slow > LIVELY_RAD_S)
    flies = lively if lively.sum() * signs.period > _FEWEST_S else free
    turned = averaged(signs.rate, signs.period, _REST_S)
    calm = averaged(signs.slow, signs.period, _REST_S) < _CALM_RAD_S
    calm &= np.linalg.norm(turned, axis=1) < _TURNED_RAD_S
    off, pulled, lifts = _off_its_feet(signs, flies)
    hits = np.zeros(len(flies), dtype=bool) if signs.felt is None else np.linalg.norm(signs.felt, axis=1) > HARD
    for first, after in runs(active):
        # What is lifted later, and hits nothing before, has flown on its back, with rotors that turn the other way.
        unhit = first + int(np.argmax(np.append(hits[first:after], True)))
        pulled[first : first + np.flatnonzero(np.append(True, lifts[first:unhit]))[-1]] = False
    lies = pulled | (calm & off)
    rests = lies | (calm & active & _stuck(signs, flies))
    window = np.ones(max(1, round(_REST_S / signs.period)), dtype=bool)
    # A mean over a time says as much of all of it.
    carried = held | binary_dilation(binary_opening(rests, window[: len(window) // 2 + 1]), window)
    plunges = _plunges(signs, active)
    carried |= (plunges >= 0) & (np.arange(len(active)) >= plunges)
    for first, after in runs(active):
        begin = _tumbles_from(signs, flies, first, after)
        carried[begin:after] |= (after - begin) * signs.period > _LIES_S
    return Resting(np.asarray(carried, dtype=bool), np.asarray(lies, dtype=bool), plunges)


def _plunges(signs: Signs, active: BoolArray) -> int:
    step = max(1, round(SLOW_S / signs.period))
    if signs.height is None or len(active) <= step:
        return -1
    falls = active[step:] & (signs.height[:-step] - signs.height[step:] > _PLUNGES_M_S * step * signs.period)
    long = (first for first, after in runs(falls) if (after - first) * signs.period > _PLUNGE_S - SLOW_S)
    return next(long, -1)


def _tumbles_from(signs: Signs, flies: BoolArray, first: int, after: int) -> int:
    """Give the sample from which a vehicle that was high turns over near the ground and never leaves it again."""
    if signs.height is None or signs.upright is None:
        return after
    high = signs.height[first:after] > signs.height[first] + _DROP_M
    over = averaged(_turned_up(signs.upright, flies), signs.period, _FALL_S)[first:after] < 0
    over[: np.flatnonzero(np.append(True, high))[-1]] = False
    return first + int(np.argmax(np.append(over & high.any(), True)))


def turns_over(signs: Signs, active: BoolArray) -> bool:
    """Tell whether by its attitude a vehicle is again and again on its back, and feels its weight along its rotors.

    No flight does; a vehicle that stands while its gyroscope drifts or its attitude is wrong does.
    """
    if signs.felt is None or signs.upright is None or not active.any():
        return False
    thrust = np.median(signs.felt[active], axis=0)
    along = averaged(signs.felt @ thrust / max(float(np.linalg.norm(thrust)), _WEIGHT[0]), signs.period, SLOW_S)
    # A controller turns its rotors down where it takes itself for upside down.
    on = active if signs.level is None else signs.level > ALIVE
    impossible = on & (_turned_up(signs.upright, active) < 0) & (along > _WEIGHT[0]) & (along < _WEIGHT[1])
    long = sum(after - first for first, after in runs(impossible) if (after - first) * signs.period >= _OVER_S)
    return long > _OVER * int(on.sum())


def _off_its_feet(signs: Signs, flies: BoolArray) -> tuple[BoolArray, BoolArray, BoolArray]:
    """Mark where something else than rotors carries the weight if calm, where in any case, and where rotors lift."""
    if signs.felt is not None:
        felt = averaged(signs.felt, signs.period, _REST_S)
        size = np.linalg.norm(felt, axis=1)
        # Nothing but rotors pushes with more than the weight for long, but where it hits; and it starts on its feet.
        hit = averaged(np.linalg.norm(signs.felt, axis=1) > HARD, signs.period, 2 * _REST_S) > 0
        lifts = flies & (size > _LIFTS) & ~hit
        first = np.flatnonzero(flies)[: max(1, round(_LIES_S / signs.period))]
        ways = [np.median(felt[each], axis=0) for each in ((lifts,) if lifts.any() else ()) + (first, flies)]
        unit = np.array(ways) / np.maximum(np.linalg.norm(ways, axis=1), 1e-12)[:, None]
        # Two of the three agree: one alone is wrong where an accelerometer reads too much, or a log begins turned over.
        thrust = ways[int(np.argmax((unit @ unit.T > _OFF_THRUST).sum(axis=1)))]
        along = felt @ thrust / np.maximum(size * float(np.linalg.norm(thrust)), 1e-12)
        weight = (size > _WEIGHT[0]) & (size < _WEIGHT[1])
        # No rotor pulls: what feels its weight from the side of its rotors lies on its back, however it rocks.
        return weight & (along < _OFF_THRUST), weight & (along < -_OFF_THRUST), lifts & (along > _OFF_THRUST)
    up = np.zeros(len(flies)) if signs.upright is None else _turned_up(signs.upright, flies)
    nowhere = np.zeros(len(flies), dtype=bool)
    return np.asarray(averaged(up, signs.period, _REST_S) < 0), nowhere, nowhere


def _turned_up(upright: Array, flies: BoolArray | slice) -> Array:
    return np.asarray(upright * (np.sign(np.median(upright[flies])) or 1.0))


def _unlike(rotors: Array) -> Array:
    """Give rotors against their mean, as shares also where a config calls speeds so."""
    mean = rotors.mean(axis=1, keepdims=True)
    return np.asarray(np.nan_to_num(rotors - mean) / max(1.0, float(np.nanquantile(mean, 0.98))))


def _held_four(signs: Signs) -> BoolArray:
    """Mark where four rotors ask for a turn that none can fly without, of a vehicle that leans or hangs on one of them.

    What flies level feels its weight along its rotors, and may be trimmed for a weight off its centre or a weak rotor.
    """
    if signs.rotors is None or signs.rotors.shape[1] != 4 or signs.felt is None or signs.slow is None:
        return np.zeros(len(signs.time), dtype=bool)
    asked = np.linalg.norm(averaged(_unlike(signs.rotors), signs.period, SLOW_S), axis=1) > _HELD_FOUR
    felt = averaged(signs.felt, signs.period, _REST_S)
    weight = np.linalg.norm(felt, axis=1)
    held = (weight > _WEIGHT[0]) & (weight < _WEIGHT[1]) & (averaged(signs.slow, signs.period, _REST_S) < _HELD_RAD_S)
    largest = np.sort(averaged(np.nan_to_num(signs.rotors), signs.period, SLOW_S), axis=1)
    held &= (np.abs(felt[:, 2]) < _LEANS * weight) | (largest[:, -2] < _ALONE * largest[:, -1])
    # What has lost two of its rotors falls over within that time.
    long = np.ones(max(1, round(_LIES_S / signs.period)), dtype=bool)
    return np.asarray(binary_opening(smoothed(asked & held, signs.period, SLOW_S), long), dtype=bool)


def _stuck(signs: Signs, flies: BoolArray) -> BoolArray:
    if signs.rotors is None or signs.slow is None:
        return np.zeros(len(flies), dtype=bool)
    unlike = _unlike(signs.rotors)
    asked = np.linalg.norm(averaged(unlike - np.median(unlike[flies], axis=0), signs.period, _REST_S), axis=1)
    turns = averaged(signs.slow, signs.period, _REST_S)
    hardly = turns < min(_HARDLY_RAD_S, _OF_RATE * float(np.median(turns[flies])))
    stuck = (asked > max(_STUCK, _STUCK_TIMES * float(np.median(asked[flies])))) & hardly
    if signs.height is not None:
        # High above where it was lowest it hovers with rotors that have become unlike.
        stuck &= signs.height < float(np.quantile(signs.height, 0.02)) + _DROP_M
    return np.asarray(stuck)


def ended_early(signs: Signs, rests: Resting, part: tuple[int, int]) -> dict[str, int]:
    """Give the samples of what ended a stretch of flight before its time; none where it landed, or the log ends.

    A crash is a motion beyond all that the flight before held, from which it does not recover: right after it the
    vehicle rests, its rotors stop, or the log ends.
    """
    first, after = part
    if after == rests.plunges:
        return {"loss of control": after}
    rests_then = bool(rests.carried[after : after + 1].any())
    lies_then = rests_then or bool(rests.lies[after : after + round(_LIES_S / signs.period)].any())
    marked = _beyond_flight(signs, part, lies_then=lies_then)
    if rests_then and marked[0][: after - first].any():
        # What shakes it when it has come to rest ends no flight; what brings it there does.
        until = after - first + round(_TURN_S / signs.period)
        marked = marked[0][:until], marked[1][:until], marked[2][:until]
    troubled, hits, strained = (first + np.flatnonzero(own) for own in marked)
    stops = _stops_in_the_air(signs, part)
    lost = len(troubled) > 0 and (after - troubled[-1]) * signs.period < _AT_ONCE_S
    if lost and (_last_burst(troubled, signs.period) - after) * signs.period >= _FALL_S:
        # What falls since its rotors stopped hits the ground later, and lost nothing by that.
        lost = not stops and not (signs.level is not None and signs.level[after : troubled[-1]].max() < ALIVE)
    # Who flips and lands, ends the log in a flip, or flies on as before has lost nothing.
    ignores = lost and not _recovers(signs, part) and _ignores_rotors(signs, part, int(troubled[0]))
    if lost and (len(hits) or lies_then or ignores):
        return _crash(signs, troubled, hits, strained)
    if rests_then:
        return {"rests with its rotors on": after}
    if stops:
        # It ends a fall, or has a force that its flight never had.
        struck = [hit for fall, hit in _falls(signs) if 0 <= (fall - after) * signs.period < _THEN_S]
        size = np.zeros(0) if signs.felt is None else np.linalg.norm(signs.felt, axis=1)
        least = max(HARD, BEYOND * float(size[slice(*part)].max(initial=0.0)))
        struck += (after + np.flatnonzero(size[after : after + round(_LIES_S / signs.period)] > least)).tolist()
        return {"rotors stop in the air": after} | ({"impact": min(struck)} if struck else {})
    return {}


def _crash(signs: Signs, troubled: IntArray, hits: IntArray, strained: IntArray) -> dict[str, int]:
    """Say where a crash began: where it hit, or lost control before that."""
    begin = _last_burst(troubled, signs.period)
    struck = hits[(hits - begin) * signs.period > -_AT_ONCE_S / 2]
    at_once = len(struck) > 0 and (struck[0] - begin) * signs.period < _FALL_S
    begin = min(begin, int(struck[0])) if at_once else begin
    origin = _last_burst(np.append(strained[strained < begin], begin), signs.period)
    for fall, hit in _falls(signs):
        if fall < origin and abs(hit - origin) * signs.period < _AT_ONCE_S / 2:
            return {"free fall": fall, "impact": hit}
    hit_ground = {"impact": int(struck[0])} if len(struck) else {}
    return {"impact": begin} if at_once and origin == begin else {"loss of control": origin} | hit_ground


def _last_burst(samples: IntArray, period: float) -> int:
    """Give the first sample of the last of those that follow each other at once."""
    apart = np.flatnonzero(np.diff(samples) * period > _AT_ONCE_S)
    return int(samples[apart[-1] + 1 if len(apart) else 0])


def _before(signs: Signs, part: tuple[int, int]) -> slice:
    """Give the flight before the end of a stretch, which shows what it does in flight."""
    first, after = part
    return slice(first, after - min(round(_LAST_S / signs.period), (after - first) // 2))


def _recovers(signs: Signs, part: tuple[int, int]) -> bool:
    """Tell whether a vehicle still flies where the log ends, and turns and leans there as it did before.

    What turns less than nearly ever before lies on the ground.
    """
    if part[1] < len(signs.time) or signs.turning is None or signs.upright is None:
        return False
    before, end = _before(signs, part), slice(part[1] - max(1, round(_FALL_S / signs.period)), None)
    up, turns, most = _turned_up(signs.upright, before), signs.turning[before], float(signs.turning[end].max())
    moves = most >= LIVELY_RAD_S and most >= np.quantile(turns, 0.01)
    return bool(moves and most <= turns.max() and up[end].min() >= up[before].min())


def _beyond_flight(signs: Signs, part: tuple[int, int], *, lies_then: bool) -> tuple[BoolArray, BoolArray, BoolArray]:
    """Mark near the end of a stretch what flight before never had: motion, force, motion with a rotor at its limit."""
    first, after = part
    before = _before(signs, part)
    # Rotors may drop at the impact.
    stop = min(len(signs.time), after + round(_THEN_S / signs.period))
    late = np.arange(first, stop) >= before.stop
    nothing = np.zeros(stop - first, dtype=bool)
    # What lies afterwards, or is upside down where the log ends, flew no more, however short it flew.
    ends = len(signs.time) - after < round(_THEN_S / signs.period)
    over = ends and signs.upright is not None and _turned_up(signs.upright, before)[-1] < 0
    fewest = _REST_S if lies_then or over else _FEWEST_S
    if signs.turning is None or signs.body_rate is None or (before.stop - first) * signs.period < fewest:
        return nothing, nothing, nothing

    def beyond(values: Array, least: float) -> BoolArray:
        most = float(np.max(values[before]))
        return np.asarray(late & (values[first:stop] > max(BEYOND * most, least)), dtype=bool)

    spins = np.linalg.norm(np.gradient(signs.body_rate, signs.period, axis=0), axis=1)
    wild, strained = beyond(signs.turning, _WILD_RAD_S), beyond(signs.turning, _STRAINED_RAD_S)
    if signs.upright is not None:
        up = _turned_up(signs.upright, slice(before.stop))
        strained |= beyond(np.arccos(np.clip(up, -1.0, 1.0)), _STRAINED_RAD)
    if signs.rotors is not None:
        strained &= (signs.rotors[first:stop] >= _AT_LIMIT * float(np.nanmax(signs.rotors))).any(axis=1)
    hard = nothing if signs.felt is None else beyond(np.linalg.norm(signs.felt, axis=1), HARD)
    # A touchdown jolts too; but then the vehicle stands on its feet.
    wild = wild | hard | beyond(spins, _WILD_RAD_S2) if lies_then else wild
    return wild, hard, nothing if signs.rotors is None else strained


def _ignores_rotors(signs: Signs, part: tuple[int, int], troubled: int) -> bool:
    """Tell whether a vehicle turns near the end of a stretch otherwise than its rotors turned it before."""
    if signs.rotors is None or signs.body_rate is None:
        return False
    first, after = part
    begin = max(first, troubled - round(_AT_ONCE_S / signs.period))
    if (begin - first) * signs.period < _FEWEST_S - _AT_ONCE_S:
        return False
    turned = np.gradient(averaged(signs.body_rate, signs.period, _TURN_S), signs.period, axis=0)
    driven = averaged(np.nan_to_num(signs.rotors) ** 2, signs.period, _TURN_S)
    # Motors and propellers follow a command late.
    late = np.vstack([driven[:1]] * round(_TURN_S / signs.period) + [driven])[: len(driven)]
    columns = np.column_stack([np.ones(len(driven)), driven, late])
    found = np.linalg.lstsq(columns[first:begin], turned[first:begin], rcond=None)[0]
    left = turned[begin:after] - columns[begin:after] @ found
    return bool((left**2).sum() > _NOT_FOLLOWED * (turned[begin:after] ** 2).sum())


def _stops_in_the_air(signs: Signs, part: tuple[int, int]) -> bool:
    """Tell whether rotors stop at the end of a stretch while the vehicle is high, or feels itself fall."""
    after = part[1]
    if signs.level is None or after >= len(signs.time):
        return False
    second = slice(after, after + max(1, round(1.0 / signs.period)))
    if signs.level[second].min() >= ALIVE:
        return _falls_to_the_end(signs, part)
    if signs.height is not None and float(signs.height[after] - signs.height[second].min()) > _DROP_M:
        return True
    if signs.felt is not None:
        light = np.linalg.norm(signs.felt[second], axis=1) < _FALLS
        return any((b - a) * signs.period >= _FALL_S for a, b in runs(light))
    return False


def _falls_to_the_end(signs: Signs, part: tuple[int, int]) -> bool:
    """Tell whether a vehicle whose rotors idle feels much less than its weight until the log ends: nothing carries it.

    Its drag and rotors that idle give it some of its weight back. In flight it may feel more than its weight, as it
    turns and climbs, and less for as long in dives that it flew out of.
    """
    first, after = part
    if signs.felt is None or (len(signs.felt) - after) * signs.period < _FALL_S:
        return False
    size = np.linalg.norm(signs.felt, axis=1)
    light = _HARDLY_CARRIED * min(1.0, float(np.median(size[first:after])))
    dives = runs(averaged(size[first:after], signs.period, _FALL_S) < light)
    longest = max((end - begin for begin, end in dives), default=0)
    return bool(size[after:].mean() < light and len(size) - after > longest)


def _falls(signs: Signs) -> list[tuple[int, int]]:
    """List where it falls freely, and where each fall ends with a jolt."""
    if signs.felt is None:
        return []
    size, most = np.linalg.norm(signs.felt, axis=1), round(_FALL_S / signs.period)
    long = [(first, after) for first, after in runs(size < _FALLS) if after - first >= most]
    jolts = [(first, after + np.flatnonzero(size[after : after + most] > HARD)) for first, after in long]
    return [(first, int(own[0])) for first, own in jolts if len(own)]
