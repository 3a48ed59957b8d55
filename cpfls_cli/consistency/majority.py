"""Which channel of the motion is wrong where two contradict each other, by majority; it is set right or left out."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from itertools import product
from typing import Self

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.blocks import mean_error
from cpfls_cli.consistency.channels import AXES
from cpfls_cli.consistency.findings import ChannelRepair, Finding, is_derived, off_clock
from cpfls_cli.consistency.motion import (
    ANOTHER_NORTH,
    CHANNELS,
    LATEST_S,
    TINY,
    TURNED_RAD,
    Offset,
    PairCheck,
    by_thrust,
    checked,
    offsets,
)
from cpfls_cli.effects.signals import Signals
from cpfls_cli.flightlog.agreement import fit_axes
from cpfls_cli.rounding import largest, less
from cpfls_cli.units import STANDARD_GRAVITY
from cpfls_cli.weak_form.windows import FEWEST_WINDOWS, Windows
from cpfls_cli.words import joined

_ROUNDS = 3  # Channels that are mended one after the other: there are no more.
# Parts of the flights whose scatter says whether a reading surely fits better, and by how many standard errors.
_PARTS, _PARTS_SIGMAS = 16, 4.0
_SHAKEN_M_S2 = 0.5  # From sample to sample, which no filtered accelerometer scatters by.
_MOVES_M_S2 = 0.1  # Below this a vehicle hovers, and noise points anywhere.
# Of 23 real flights with attitude all correlate by 0.91 and more in the plane, turned by 4 degrees at most, and by 0.33
# and more along z.
_ONE_PLANE, _NOT_ONE_PLANE, _REVERSED = 0.8, 0.5, 0.6
_UNIT_ERROR, _THRUST_ERROR = 0.05, 0.25
"""Logarithm of what a unit may be off by against a sensor and against the thrust."""

_EXPLAINED = 0.8  # Share of a channel that other axes have to explain.
# Growth of the residual between two channels from which on a repair sets them apart; noise and a shift make less.
_APART = 1.2
_FORWARD_LEFT_UP = np.diag([1.0, -1.0, -1.0])
_DONE = "It is corrected before the balance"

_Read = tuple[ChannelRepair, tuple[str, ...]]  # A way to read a channel, and the mistakes that it takes.


@dataclass(frozen=True)
class Settled:
    """What a majority of the channels decides."""

    repairs: tuple[ChannelRepair, ...]
    checks: tuple[PairCheck, ...]  # Of the repaired flights.
    # That the world is upside down, turned or mirrored against thrust and attitude; None where it is not.
    against_thrust: Finding | None = None
    dropped: tuple[Finding, ...] = ()  # Of repairs that another channel contradicts, so that nothing is done.

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What is wrong; of what stays between thrust and motion, which a diagnosis is about, the way it points."""
        mended = (repair.finding for repair in self.repairs if repair.finding is not None)
        between_sensors = (problem for check in self.checks if check.pair.exact for problem in check.problems)
        world = () if self.against_thrust is None else (self.against_thrust,)
        return (*mended, *world, *self.dropped, *between_sensors)


@dataclass(frozen=True)
class _Compared:
    """Flights, and what their channels say of each other."""

    flights: tuple[Signals, ...]
    windows: Windows
    checks: tuple[PairCheck, ...]

    @classmethod
    def of(cls, flights: tuple[Signals, ...], windows: Windows) -> Self:
        return cls(flights, windows, checked(flights, windows))

    def with_position(self, repair: ChannelRepair) -> tuple[ChannelRepair, ...]:
        """Take the position along where it agrees with the velocity, so that its world is as wrong."""
        along = any((one.pair.first, one.pair.second) == ("position", "velocity") and one.agrees for one in self.checks)
        return (repair, replace(repair, channel="position")) if repair.channel == "velocity" and along else (repair,)

    def repaired(self, *repairs: ChannelRepair) -> tuple[Signals, ...]:
        return tuple(reduce(lambda s, each: each.applied(s), repairs, signals) for signals in self.flights)

    def checked(self, repair: ChannelRepair) -> tuple[PairCheck, ...]:
        """Compare a channel with the others once it is repaired: with those that no third one contradicts, if any."""
        disputed = _disputed(check for check in self.checks if repair.channel not in check.pair)
        each = checked(self.repaired(*self.with_position(repair)), self.windows, repair.channel)
        return tuple(check for check in each if disputed.isdisjoint(check.pair)) or each


def settled(flights: Sequence[Signals], windows: Windows) -> Settled:
    """Set right what contradicts more than it agrees with, or leave it out.

    Each two channels that show the same motion are compared. The one that contradicts most others, and of equals the
    one that agrees with fewest, is read in the ways that logs are usually wrong (unit, gravity, axes, clock). It is
    mended if it then contradicts nothing, and left out if nothing mends it and two others are against it.

    `flights`: with the sampling period of the windows, and a late attitude set right.
    """
    repairs: tuple[ChannelRepair, ...] = ()
    dropped: tuple[Finding, ...] = ()
    # What was made of the accelerometer is no second witness.
    own = tuple(replace(signals, acceleration=None) if is_derived(signals) else signals for signals in flights)
    now = _Compared.of(own, windows)
    against_thrust = _against_thrust(now.checks)
    if against_thrust is not None:
        # Judged by the thrust every channel of such a world is wrong.
        return Settled((), now.checks, against_thrust)
    for _ in range(_ROUNDS):
        found, dropped = _mended(now)
        if not found:
            break
        repairs = (*repairs, *found)
        now = _Compared.of(now.repaired(*found), windows)
    found = taken_off(now.flights, windows, now.checks)
    checks = checked(now.repaired(*found), windows) if found else now.checks
    return Settled((*repairs, *found), checks, dropped=dropped)


def taken_off(
    flights: Sequence[Signals], windows: Windows, checks: Sequence[PairCheck] | None = None
) -> tuple[ChannelRepair, ...]:
    """Take constant offsets off channels, where the checks of flights that are consistent else show some."""
    found = offsets(checked(flights, windows) if checks is None else checks, flights, windows)
    return tuple(map(_without, found))


def _without(found: Offset) -> ChannelRepair:
    unit, along = ("m/s" if found.pair.first == "position" else "m/s^2"), f"along {'body ' if found.in_body else ''}"
    words = joined(
        f"{' to '.join(dict.fromkeys(f'{size:+.2f}' for size in ends))} {unit} {along}{AXES[i]}"
        for i, ends in found.sizes.items()
    )
    of = "" if len(found.flights) == len(found.names) else f" in {joined(found.flights)}"
    channel, witness = CHANNELS[found.pair.second], CHANNELS[found.pair.first].words
    doubt = " (or that drifts)" if found.pair.first == "position" else ""
    what = f"the {channel.words} has a constant offset of {words}{of}, judged by the {witness}{doubt}"
    finding = Finding(what, f"check {channel.keys}", found.pair.channels, contradiction=False, repairable=True)
    repair = ChannelRepair(
        found.pair.second, offset="".join(AXES[i] for i in found.sizes), offset_in_body=found.in_body
    )
    return repair.with_finding(finding, f"In each flight with {witness} it is taken off by that")


def _against_thrust(checks: Sequence[PairCheck]) -> Finding | None:
    """Name a world whose channels agree, and all lie otherwise than thrust and attitude: drag and wind turn none."""
    against = by_thrust(checks)
    if not against or any(len(check.first) < FEWEST_WINDOWS for check in against):
        return None
    moved = [CHANNELS[check.pair.second].words for check in against]
    who, held = " and ".join(moved), ("thrust of the rotors", "attitude", *moved)
    up = [(check.first[:, 2], check.second[:, 2]) for check in against]
    if all(
        min(one.std(), other.std()) > _MOVES_M_S2 and np.corrcoef(one, other)[0, 1] < -_REVERSED for one, other in up
    ):
        what = f"along z, the thrust of the rotors is opposite to {who}"
        return Finding(what, "check import.world_frame and import.body_frame", held)
    turned, mirrored = zip(*(_about_the_vertical(check) for check in against), strict=True)
    if all(abs(turn) > _ONE_PLANE and abs(np.angle(turn)) > ANOTHER_NORTH for turn in turned):
        angle = float(np.angle(turned[0]))
        return Finding(
            f"judged by thrust and attitude, the axes of {who} are rotated by {np.degrees(angle):.0f} deg about the "
            "vertical",
            "check the yaw of import.signals.attitude (or quaternion), the order of x and y, and import.world_frame; "
            "if they are right, the yaw was estimated wrong, as by a compass near iron or currents",
            held,
            angle,
            "rad",
        )
    pairs = zip(turned, mirrored, strict=True)
    if all(abs(turn) < _NOT_ONE_PLANE and abs(mirror) > _ONE_PLANE for turn, mirror in pairs):
        return Finding(
            f"judged by thrust and attitude, the axes of {who} are mirrored",
            "check the order and signs of x and y, import.world_frame and import.body_frame",
            held,
        )
    return None


def _about_the_vertical(check: PairCheck) -> tuple[complex, complex]:
    """Correlate what moves in the plane, turned and mirrored, as numbers whose angle is that of the turn."""
    first, second = ((part - part.mean(axis=0)) @ np.array([1.0, 1.0j, 0.0]) for part in (check.first, check.second))
    if min(first.std(), second.std()) < _MOVES_M_S2:
        return 0j, 0j
    size = np.linalg.norm(first) * np.linalg.norm(second)
    return complex(np.vdot(first, second) / size), complex((first * second).sum() / size)


def _mended(now: _Compared) -> tuple[tuple[ChannelRepair, ...], tuple[Finding, ...]]:
    """Repair the first suspect that can be, and say of those before it which repair another channel contradicts."""
    dropped: list[Finding] = []
    for channel, sure in _suspects(now.checks):
        contradicted = (check.pair for check in now.checks if check.problems and channel in check.pair)
        witnesses = [
            CHANNELS[name].words for pair in contradicted for name in (pair.first, pair.second) if name != channel
        ]
        read = _read_rightly(now, channel)
        opposed = () if read is None else _opposed(now, read[0])
        if read is not None and opposed:
            dropped.append(_verdict(now, *read, witnesses, opposed))
        elif read is not None and (sure or read[0].is_mistake or _is_late(*read, witnesses)):
            return _outvoted(now, *read, witnesses), ()
        elif read is not None and _changed_to_thrust(now, read[0], lambda before, after: _surely_less(after, before)):
            return _outvoted(now, *read, [*witnesses, CHANNELS["thrust"].words]), ()
        # Noise on both sides can look like one contradiction, not like two.
        elif sure and read is None and len(set(witnesses)) > 1:
            return _of_fewest_mistakes(now) or (_left_out(now, channel, witnesses),), ()
    return (), tuple(dropped)


def _is_late(repair: ChannelRepair, mistakes: tuple[str, ...], witnesses: Sequence[str]) -> bool:
    """Check whether a channel does nothing but come after the position: no estimate is ahead of what it is made of."""
    return not mistakes and repair.delay_s > 0 and [*witnesses] == [CHANNELS["position"].words]


def _of_fewest_mistakes(now: _Compared) -> tuple[ChannelRepair, ...]:
    """Repair the velocity, or what it contradicts next to the position, where that takes the fewest mistakes.

    Between two others, it contradicts both where one of them is wrong as well. Each of the three is taken for right in
    turn, and the two others are read by it. Nothing is repaired where two ways take as few mistakes.
    """
    exact = {name for check in now.checks if check.problems and check.pair.exact for name in check.pair[:2]}
    sensors = exact - {"position", "velocity"}
    if len(exact) != 3 or len(sensors) != 1:
        return ()
    (sensor,) = sensors
    by_velocity = (("position", sensor), (sensor, "position"))
    by_position = (("velocity", sensor), (sensor, "position"))
    by_sensor = (("velocity", "position"), ("position", sensor))
    ways = [way for steps in (by_velocity, by_position, by_sensor) if (way := _mistakes(now, steps)) is not None]
    fewest = [repairs for count, repairs in ways if count == min(count for count, _ in ways)]
    return fewest[0] if len(fewest) == 1 else ()


def _mistakes(now: _Compared, steps: Sequence[tuple[str, str]]) -> tuple[int, tuple[ChannelRepair, ...]] | None:
    """Count the mistakes of channels that are read one after the other, each without a third; None where one is not.

    With the count comes the repair of the first that can be set right.
    """
    count, first, repairs = 0, tuple[ChannelRepair, ...](), tuple[ChannelRepair, ...]()
    for channel, third in steps:
        alone = _Compared.of(now.repaired(*repairs, ChannelRepair(third, dropped=True)), now.windows)
        exact = [check for check in alone.checks if check.pair.exact and check.problems]
        if not exact:
            continue
        read = _read_rightly(alone, channel)
        if read is None or _opposed(alone, read[0]):
            return None
        count += len(read[1]) + bool(read[0].delay_s)
        repairs = (*repairs, read[0])
        if CHANNELS[channel].without and not first:
            words = [CHANNELS[name].words for name in exact[0].pair[:2] if name != channel]
            first = _outvoted(alone, *read, words)
    return (count, first) if first else None


def _suspects(checks: Sequence[PairCheck]) -> list[tuple[str, bool]]:
    """List channels that can be mended, and whether each alone contradicts most, or as many and agrees with fewer."""
    # A contradiction between velocity and thrust alone may be what a model misses, and asks for no decision.
    asking = (
        check.pair for check in checks if check.problems and (check.pair.exact or check.pair.second != "velocity")
    )
    blamed = {name for pair in asking for name in (pair.first, pair.second)}
    against = {
        name: (
            sum(bool(check.problems) for check in checks if name in check.pair),
            -sum(check.agrees for check in checks if name in check.pair),
        )
        for name in blamed
    }
    mended = (name for name, channel in CHANNELS.items() if channel.without and name in blamed)
    ordered = sorted(mended, key=lambda name: against[name], reverse=True)
    return [(name, all(against[name] > against[other] for other in blamed - {name})) for name in ordered]


def _read_rightly(now: _Compared, channel: str) -> _Read | None:
    """Find the plainest reading of a channel that contradicts nothing, unless another one surely fits better."""
    known = all(signals.attitude is not None for signals in now.flights)
    best, least, mistakes = None, np.empty(0), 0
    for repair, what in _readings(channel):
        possible = (known or not repair.needs_attitude) and not _outweighs(now, repair)
        read = _tuned(now, repair, what) if possible else None
        if read is None:
            continue
        nearest = _clearest(now.checked(read[0]))
        rest = ((nearest.first - nearest.second) ** 2).sum(axis=1)
        number = len(read[1]) + bool(read[0].delay_s)
        better = best is None or (less(rest.sum(), least.sum()) if number <= mistakes else _surely_less(rest, least))
        if better:
            best, least, mistakes = read, rest, number
    return best


def _outweighs(now: _Compared, repair: ChannelRepair) -> bool:
    """Check whether an accelerometer that is said to lack gravity feels it: on average it carries the weight."""
    felt = [signals.specific_force for signals in now.flights if signals.specific_force is not None]
    if repair.channel != "specific_force" or not repair.gravity_m_s2 or not felt:
        return False
    along_z = float(np.concatenate(felt)[:, 2].mean() * repair.matrix[2, 2])
    return abs(along_z - repair.gravity_m_s2) < abs(along_z)


def _surely_less(after: Array, before: Array) -> bool:
    """Check whether squares are less by more than their scatter along the flights."""
    parts = np.array([part.sum() for part in np.array_split(before - after, _PARTS)])
    return bool(parts.mean() > _PARTS_SIGMAS * mean_error(parts))


def _changed_to_thrust(now: _Compared, repair: ChannelRepair, judge: Callable[[Array, Array], bool]) -> bool:
    """Judge squares of a channel against the thrust, the third clock and frame, before and after a repair."""
    repaired = now.repaired(*now.with_position(repair))
    before, after = (_off_the_thrust(each, repair.channel, now.windows) for each in (now.flights, repaired))
    return before is not None and after is not None and judge(before, after)


def _opposed(now: _Compared, repair: ChannelRepair) -> tuple[str, ...]:
    """Name the channels that know better than a repair: a position whose derivative is the velocity, and the thrust."""
    along = now.with_position(repair)
    if repair.in_body and len(along) > 1:
        # No derivative of a position is its velocity in body axes, nor is a position in body axes anything.
        return (CHANNELS["position"].words,)
    if any(signals.commanded for signals in now.flights):
        return ()
    return (CHANNELS["thrust"].words,) if _changed_to_thrust(now, repair, _surely_farther) else ()


def _surely_farther(before: Array, after: Array) -> bool:
    return bool(after.sum() > _APART * before.sum()) and _surely_less(before, after)


def _disputed(checks: Iterable[PairCheck]) -> set[str]:
    """List the channels of pairs that contradict each other."""
    return {name for check in checks if check.problems for name in (check.pair.first, check.pair.second)}


def set_apart(
    logged: Sequence[Signals], before: Sequence[Signals], after: Sequence[Signals], windows: Windows
) -> tuple[str, ...]:
    """Name the channels of the motion that a repair of a clock surely sets apart, of those that agree as logged."""
    names: dict[str, None] = {}
    disputed = _disputed(check for check in checked(logged, windows) if check.pair.exact)
    for one, other in zip(checked(before, windows), checked(after, windows), strict=True):
        rest, left = (((each.first - each.second) ** 2).sum(axis=1) for each in (one, other))
        if disputed.isdisjoint(one.pair) and _surely_farther(rest, left):
            names |= dict.fromkeys(one.pair.channels)
    return tuple(names)


def _off_the_thrust(flights: Sequence[Signals], channel: str, windows: Windows) -> Array | None:
    """Square what a drag leaves between thrust and a channel, shape (window,); None where there is no thrust."""
    against = [check for check in checked(flights, windows, channel) if check.pair.first == "thrust"]
    if not against:
        return None
    rest = against[0].second - against[0].first
    rest = rest - rest.mean(axis=0)
    velocities = [signals.velocity for signals in flights if signals.velocity is not None]
    if len(velocities) == len(flights):
        speed = np.concatenate([windows.average(velocity) for velocity in velocities])
        speed = speed - speed.mean(axis=0)
        rest = rest - speed * ((rest * speed).sum(axis=0) / np.maximum((speed**2).sum(axis=0), TINY))
    return np.asarray((rest**2).sum(axis=1))


def _readings(channel: str) -> Iterator[_Read]:
    """List the ways to read a channel, the nearest to what it is called first; as it is says nothing."""
    gravity, plain = STANDARD_GRAVITY, ChannelRepair(channel)
    yield plain, ()
    if channel == "specific_force":
        axes = {"": np.eye(3), "has its sign reversed": -np.eye(3), "has y and z reversed": _FORWARD_LEFT_UP}
        for (words, matrix), added in product(axes.items(), (0.0, gravity)):
            what = (*([words] if words else []), *(["lacks gravity"] if added else []))
            if what:
                yield replace(plain, matrix=matrix, gravity_m_s2=added), what
        return
    if channel == "acceleration":
        yield replace(plain, gravity_m_s2=-gravity), ("includes gravity",)
        yield replace(plain, gravity_m_s2=gravity), ("includes gravity, pointing down",)
    yield replace(plain, in_body=True), ("is in body axes",)
    if channel == "acceleration":
        yield replace(plain, in_body=True, gravity_m_s2=-gravity), ("is in body axes and includes gravity",)


def _tuned(now: _Compared, repair: ChannelRepair, what: tuple[str, ...]) -> _Read | None:
    """Find axes, unit and delay with which a reading contradicts nothing; None where there are none."""
    for step in (_with_axes, _with_unit, _with_turn, _with_delay):
        against = now.checked(repair)
        if not any(check.problems for check in against):
            break
        repair, more = step(repair, _clearest(against))
        what = (*what, *more)
    for _ in range(_ROUNDS if repair.delay_s else 0):
        if abs(repair.delay_s) > LATEST_S:
            # What does not move together has no delay, and a fit of one runs away.
            return None
        # Noise shrinks an estimate of a delay, so it is repeated.
        repair, _ = _with_delay(repair, _clearest(now.checked(repair)))
    against = now.checked(repair)
    # An accelerometer hardly moves in a gentle flight; what it shows of gravity is agreement enough.
    moves = repair.channel == "specific_force" or any(check.agrees for check in against)
    changed = bool(what) or repair.delay_s != 0
    return (repair, what) if changed and moves and not any(check.problems for check in against) else None


def _clearest(checks: Sequence[PairCheck]) -> PairCheck:
    """Choose the witness: the exact one that moves as the channel does, the thrust if there is no other."""
    exact = [check for check in checks if check.pair.exact]
    return largest(exact or checks, lambda check: float(check.r2.sum()))


def _sides(repair: ChannelRepair, check: PairCheck) -> tuple[Array, Array]:
    """Give what should be and what is."""
    return (check.first, check.second) if check.pair.second == repair.channel else (check.second, check.first)


def _with_axes(repair: ChannelRepair, check: PairCheck) -> _Read:
    if repair.channel == "specific_force" or repair.in_body:
        return repair, ()
    fit = fit_axes(*_sides(repair, check))
    if fit.is_as_named or fit.explained < _EXPLAINED:
        return repair, ()
    matrix = np.zeros((3, 3))
    matrix[np.arange(3), fit.order] = fit.sign
    names = ", ".join(("-" if sign < 0 else "") + AXES[axis] for axis, sign in zip(fit.order, fit.sign, strict=True))
    return replace(repair, matrix=matrix @ repair.matrix), (f"has {names} where x, y, z should be",)


def _with_unit(repair: ChannelRepair, check: PairCheck) -> _Read:
    should, reading = _sides(repair, check)
    if repair.channel != "specific_force":
        should, reading = should - should.mean(axis=0), reading - reading.mean(axis=0)
    squares = np.array([(should**2).sum(), (reading**2).sum()])
    if squares.min() < TINY:
        return repair, ()
    size = float(np.sqrt(squares[0] / squares[1]))
    correlation = abs(float((should * reading).sum())) / np.sqrt(squares[0] * squares[1] + TINY)
    # Noise on one side makes its size too large, by no more than the correlation allows.
    error = (_UNIT_ERROR if check.pair.exact else _THRUST_ERROR) - np.log(float(np.clip(correlation, 0.1, 1.0)))
    if abs(np.log(size)) < error:
        return repair, ()
    unit, factor = min(CHANNELS[repair.channel].units.items(), key=lambda each: abs(np.log(size / each[1])))
    if abs(np.log(size / factor)) > error:
        return repair, ()
    return replace(repair, matrix=factor * repair.matrix), (f"is in {unit}",)


def _with_turn(repair: ChannelRepair, check: PairCheck) -> _Read:
    if repair.channel == "specific_force" or not check.pair.exact:
        return repair, ()
    angle = float(np.arctan(check.turn.value)) * (1 if check.pair.second == repair.channel else -1)
    if abs(angle) < TURNED_RAD or check.turn.error > 0.1 * abs(angle):
        return repair, ()
    cos, sin = np.cos(angle), np.sin(angle)
    matrix = np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]]) @ repair.matrix
    return replace(repair, matrix=matrix), (f"is rotated by {np.degrees(angle):.0f} deg about the vertical",)


def _with_delay(repair: ChannelRepair, check: PairCheck) -> _Read:
    late = check.delay.value * (1 if check.pair.second == repair.channel else -1)
    return (replace(repair, delay_s=repair.delay_s + late) if check.pair.exact else repair), ()


def _verdict(
    now: _Compared, repair: ChannelRepair, what: Sequence[str], witnesses: Sequence[str], opposed: Sequence[str] = ()
) -> Finding:
    """Say what is wrong with a channel, and who opposes that it is set right."""
    channel, half_s = CHANNELS[repair.channel], _clearest(now.checked(repair)).delay.half
    clock = [f"is {off_clock(repair.delay_s, half_s)}"] if repair.delay_s else []
    with_others = not opposed and len(now.with_position(repair)) > 1
    who = "the world of velocity and position" if with_others else f"the {channel.words}"
    found, remedy = f"{who} {joined([*what, *clock])}, judged by the {joined(witnesses)}", f"check {channel.keys}"
    if opposed:
        verb = "contradicts" if len(opposed) == 1 else "contradict"
        found += f", which the {joined(opposed)} {verb}, so nothing is corrected"
    elif repair.channel == "acceleration" and repair.gravity_m_s2 and not repair.in_body:
        remedy = "correct the log, or leave import.signals.acceleration out, since the import takes no gravity from it"
    else:
        remedy = f"correct the log, or {channel.keys}"
    grave, held = bool(what) and _grave(repair.channel, now.checks), (channel.words, *witnesses, *opposed)
    return Finding(found, remedy, held, contradiction=grave, repairable=not opposed)


def _outvoted(
    now: _Compared, repair: ChannelRepair, what: Sequence[str], witnesses: Sequence[str]
) -> tuple[ChannelRepair, ...]:
    first, *others = now.with_position(repair)
    return (first.with_finding(_verdict(now, repair, what, witnesses), _DONE), *others)


def _grave(channel: str, checks: Sequence[PairCheck]) -> bool:
    """Check whether more than a delay or a small scale is wrong with a channel: in a hover a few ms look like axes."""
    return any(problem.contradiction for check in checks if channel in check.pair for problem in check.problems)


def shaken_in_words(flights: Sequence[Signals]) -> str:
    """Say of accelerometers that differ from sample to sample more than the motion does that vibration does so."""
    felt = [signals.specific_force for signals in flights if signals.specific_force is not None]
    # What is smooth lies between its neighbours.
    apart = np.concatenate([own[1:-1] - 0.5 * (own[:-2] + own[2:]) for own in felt])
    jumps, size = apart.std(axis=0) / np.sqrt(1.5), np.concatenate(felt).std(axis=0)
    worst = int(np.argmax(jumps))
    if jumps[worst] < max(_SHAKEN_M_S2, 0.5 * size[worst]):
        return ""
    often = f"one of {1 / flights[0].period:.3g} samples a second to the next"
    return (
        f"; along {AXES[worst]} it scatters by {jumps[worst]:.2g} m/s^2 from {often}, as vibration does that is logged"
        " too slowly: log it faster, or leave it out"
    )


def _left_out(now: _Compared, name: str, witnesses: Sequence[str]) -> ChannelRepair:
    channel = CHANNELS[name]
    finding = Finding(
        f"the {channel.words} contradicts the {joined(witnesses)}, and no error of unit, gravity, axes or "
        "delay explains it",
        f"check {channel.keys}{shaken_in_words(now.flights) if name == 'specific_force' else ''}",
        (channel.words, *witnesses),
        contradiction=_grave(name, now.checks),
        repairable=True,
    )
    return ChannelRepair(name, dropped=True).with_finding(finding, f"It is left out: {channel.without}")
