"""What gyroscope, attitude, rotors and motion say of each other, and their clocks, before any torque."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import reduce
from typing import Self

import numpy as np
from scipy.special import stdtr

from cpfls_cli.arrays import Array, runs
from cpfls_cli.blocks import blocks_of_time, half_width, mean_error
from cpfls_cli.consistency.channels import BODY_AXES, TURNING_RAD_S, gyroscope_apart, least_noise
from cpfls_cli.consistency.findings import (
    UP,
    AuditFinding,
    ChannelRepair,
    FaultNumber,
    Finding,
    in_ms,
    off_clock,
    shifted,
)
from cpfls_cli.consistency.gyroscope import DelayScan, GyroFit, fit_gyro, kinematics, scan
from cpfls_cli.consistency.majority import Settled, set_apart, settled
from cpfls_cli.consistency.rotors import thrust_is_known, weighed
from cpfls_cli.effects.effect import Effect
from cpfls_cli.effects.hooks import FaultFit, SensorTest
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.effects.signals import Signals, stretch_of
from cpfls_cli.errors import ComputationError, SettingError
from cpfls_cli.flightlog.importing import estimate_delay
from cpfls_cli.flightlog.results import DelayEstimate
from cpfls_cli.flightlog.stretches import stands_still
from cpfls_cli.lag import fit_delay
from cpfls_cli.weak_form.windows import FEWEST_WINDOWS, Windows
from cpfls_cli.weak_form.windows import windows as windows_of
from cpfls_cli.words import joined

# Above the motion of a multirotor and below most of the noise of its derivative.
_LOWPASS_HZ, _SHARE_OF_RATE = 8.0, 0.2
_DELAY_MAX_S = 0.2  # Rotors of the largest multirotors follow within a fifth of a second.
_SMALLEST_R2 = 0.3  # A rigid body that explains less of the torque leaves the delay to chance.
_FEWEST_WINDOWS = 24  # That a fit of five numbers wants.
_ROTORS_OFF_S = 0.008  # Filters before a gyroscope, and a flow that lags behind a rotor, are a few milliseconds.
_TRIED = 0.005 * np.arange(-48.0, 49.0)  # Delays, s: telemetry comes up to a quarter of a second late.
_SCATTER_S, _SCATTER = 0.004, 0.2  # Estimates of one clock scatter by less than this, or by less than this share of it.
_FEWEST_SHIFTS = 4  # Two halves of one flight about roll and pitch.
# Share of the torque that is left where no shift can do better, and share of that which a shift has to leave at most.
_NEXT_TO_NOTHING, _HALF = 0.01, 0.5
# Step of an attitude that no gyroscope of a flight is off by within a window, and share of windows that are without.
_JUMP_RAD, _BUT_FOR_JUMPS = 0.17, 0.9
_NEAR_TURN = 0.05  # Turns.
_DONE = "corrected before the balance"


def actuation_delay(flights: Sequence[Signals]) -> tuple[str, ...]:
    """Say by which delay the motion follows commands or a logged torque; nothing if unknown.

    Median over the flights, and all of their 95 % intervals.
    Behind measured speeds nothing has to come late: what looks so may be an autopilot that answers gusts.
    """
    driven = [signals for signals in flights if signals.commanded or signals.rotor_speed is None]
    estimates = [estimate for signals in driven if (estimate := _delay_behind(signals)) is not None]
    if not estimates:
        return ()
    delay = float(np.median([estimate.delay_s for estimate in estimates]))
    low, high = min(own.low_s for own in estimates), max(own.high_s for own in estimates)
    whom = "commands" if driven[0].commanded else "logged torque"
    bound = any(estimate.at_bound for estimate in estimates)
    by = f"at least {1000 * delay:.0f} ms" if bound else in_ms(delay, low, high)
    return (f"The motion follows the {whom} by {by}.",)


def _delay_behind(signals: Signals) -> DelayEstimate | None:
    if signals.torque is None:
        return None
    lowpass = min(_LOWPASS_HZ, _SHARE_OF_RATE / signals.period)
    try:
        estimate = estimate_delay(
            signals.time, signals.body_rate, signals.torque, delay_max_s=_DELAY_MAX_S, lowpass_hz=lowpass
        )
    except (ComputationError, SettingError):
        return None
    return estimate if estimate.pooled_r2 > _SMALLEST_R2 else None


def attitude_on_clock(found: FaultNumber, along: Sequence[str] = ()) -> tuple[ChannelRepair, ...]:
    """Put an attitude that comes after the gyroscope onto its clock.

    Rotors do not decide which of the two is late: they may be late over the wire of either, and a loop answers gusts.

    `found`: delay of the gyroscope behind the attitude, s.
    `along`: channels that are late with the attitude.
    """
    who = "attitude and motion are" if along else "the attitude is"
    off = off_clock(-found.value, 0.5 * (found.high - found.low))
    finding = _off_clock(f"{who} {off}", "correct the clock in the log", "attitude", -found.value)
    first = ChannelRepair("attitude", delay_s=-found.value).with_finding(finding, f"This is {_DONE}")
    return (first, *(ChannelRepair(name, delay_s=-found.value) for name in along))


def rotors_on_clock(flights: Sequence[Signals], windows: Windows) -> ChannelRepair | None:
    """Put measured rotor speeds that are late or early against the gyroscope onto its clock.

    Telemetry of speed controllers comes late. Every half of a flight has to say the same about roll and about pitch,
    and a shift has to halve the residual at least: on real flights whose clocks agree, drag and damping explain the
    torque as well with any shift. Yaw says nothing, because rotors that speed up turn the vehicle ahead of their drag.

    None where nothing is wrong, or nobody knows.
    """
    # Commands, which a lag lies behind, are left out.
    measured = [each for each in flights if each.rotor_speed is not None and not each.commanded]
    cut = ((each, slice(*ends)) for each in measured for ends in ((0, len(each) // 2), (len(each) // 2, None)))
    found = [shift for each, half in cut for shift in _shifts(stretch_of(each, half), windows)]
    if len(found) < _FEWEST_SHIFTS:
        return None
    delay = float(np.median(found))
    if abs(delay) < _ROTORS_OFF_S or np.abs(np.array(found) - delay).max() > max(_SCATTER_S, _SCATTER * abs(delay)):
        return None
    half_s = float(half_width(mean_error(np.array(found)), len(found)))
    what = f"the rotor speeds are {off_clock(delay, half_s)}"
    finding = _off_clock(what, "correct their clock in the log", "rotors", delay)
    return ChannelRepair("rotor_speed", delay_s=delay).with_finding(finding, f"They are {_DONE}")


def _off_clock(what: str, remedy: str, channel: str, delay: float) -> Finding:
    what, held = f"{what}, judged by the gyroscope", (channel, "gyroscope")
    return Finding(what, remedy, held, delay, "s", contradiction=False, repairable=True)


def _shifts(half: Signals, windows: Windows) -> Iterator[float]:
    """Estimate by how much the rotors are late about roll and pitch, s; 0 for no sure shift, nothing for no hint.

    Their torque is explained by angular acceleration, rate, air velocity and a constant, about each axis on its own: an
    inertia that is wrong, a damping or a drag that is missing shifts no clock.
    """
    assert half.torque is not None, "rotors turn"
    torque, rate = half.torque[:, :2], half.body_rate
    if windows.count(len(half)) < _FEWEST_WINDOWS or not np.ptp(torque, axis=0).all():
        return
    air = half.ground_velocity if "velocity" in half.available else np.zeros((len(half), 0))
    turning, turned, moved = windows.derivative(rate), windows.average(rate), windows.average(air)
    motion = np.stack([np.column_stack([turning[:, axis], turned[:, axis], moved]) for axis in range(2)], axis=1)

    def shifted_torque(delay: float) -> tuple[Array, Array]:
        return motion, windows.average(shifted(torque, half.time, delay))

    found = fit_delay(_TRIED, shifted_torque, blocks_of_time(len(motion), windows.hop * windows.period), each=True)
    as_logged, least = found.unexplained[len(_TRIED) // 2], found.unexplained.min(axis=0)
    if as_logged.max() < _NEXT_TO_NOTHING:
        yield from (0.0, 0.0)
        return
    sure = found.inside & (least < _HALF * as_logged)
    for axis in np.flatnonzero(least <= 1 - _SMALLEST_R2):
        yield float(found.delay[axis]) if sure[axis] else 0.0


# Largest probability of chance, after Holm over all that is tested: an audit that cries wolf is not read.
_SIGNIFICANCE = 1e-3
# Share of the size that matters which must be exceeded significantly: a jackknife over two dozen blocks has heavier
# tails than Student's t where few of them are informative, and what it then calls significant is small.
_SHARE_EXCEEDED = 0.5


@dataclass(frozen=True)
class CheckedFault:
    """An effect that the audit tests, with its estimate."""

    effect: Effect
    fit: FaultFit

    @property
    def test(self) -> SensorTest:
        """Test of the effect."""
        assert self.effect.test is not None, "chosen so"
        return self.effect.test

    def smallest(self, period: float) -> float:
        """Compute the smallest relevant size at a sampling period in s."""
        return max(self.test.smallest, self.test.smallest_samples * period)


def findings(faults: Sequence[CheckedFault], period: float) -> tuple[AuditFinding, ...]:
    """Test faults of sensors.

    A number is named when its size matters, and Student's t of what exceeds the possible pull of noise and half of
    that size stays significant after Holm's correction over all numbers that the motion identifies.

    `period`: sampling period, s. Reference: Holm 1979.
    """
    known_faults = [fault for fault in faults if fault.fit.known.any()]
    if not known_faults:
        return ()
    known = np.concatenate([fault.fit.known for fault in known_faults])
    p_values = np.ones(len(known))
    p_values[known] = _holm(np.concatenate([_chance(fault, period) for fault in known_faults])[known])
    by_fault = np.split(p_values, np.cumsum([len(fault.fit.known) for fault in known_faults])[:-1])
    return tuple(_finding(fault, chance, period) for fault, chance in zip(known_faults, by_fault, strict=True))


def _chance(fault: CheckedFault, period: float) -> Array:
    fit = fault.fit
    floor = fit.pull + _SHARE_EXCEEDED * fault.smallest(period)
    excess = np.maximum(np.abs(fit.value) - floor, 0.0) / np.maximum(fit.error, np.finfo(float).tiny)
    return np.asarray(2 * stdtr(fit.blocks - 1, -excess))


def _holm(p_values: Array) -> Array:
    order = np.argsort(p_values)
    stepped = np.maximum.accumulate(p_values[order] * np.arange(len(order), 0, -1))
    adjusted = np.empty_like(p_values)
    adjusted[order] = np.minimum(stepped, 1.0)
    return adjusted


def _finding(fault: CheckedFault, p_values: Array, period: float) -> AuditFinding:
    fit, test = fault.fit, fault.test
    reach = half_width(fit.error, fit.blocks) + fit.pull
    named = fit.known & (p_values < _SIGNIFICANCE) & (np.abs(fit.value) > fault.smallest(period))
    numbers = tuple(
        FaultNumber(
            label,
            float(fit.value[i]),
            "" if number.unit == "1" else number.unit,
            float(fit.value[i] - reach[i]),
            float(fit.value[i] + reach[i]),
            bool(named[i]),
        )
        for i, (label, number) in enumerate(zip(test.labels, fault.effect.numbers, strict=True))
        if fit.known[i]
    )
    parts = [test.number(each.name, each.value) for each in numbers if each.named]
    sentence = test.found.format(", ".join(parts)) if parts else test.nothing
    return AuditFinding(fault.effect.name, numbers, float(p_values[fit.known].min()), bool(parts), sentence)


# Agreement that no independent attitude reaches, rad/s in a window; every fault of practical size is larger.
_ROUNDING = 1e-4
# An independent attitude leaves at least the gyroscope's own noise; this share of it is left by one that contains it.
_SHARE_OF_NOISE = 0.3
# About twice the most that 23 real flights show, or more: rad/s, a share, rad, s.
_SLOWER, _FILTERED_FROM, _NEARER = (8, 4), 0.05, 0.7
"""Times the usual length of windows in which the motion is slow; the logarithm of a ratio of sizes that is looked at,
and the share of it that a filter leaves there at most: an error of scale leaves all."""

_FILTERED = "its size against the attitude nears 1 in slow motion, so one of the two is behind a filter"
_COARSE = "attitude or gyroscope is logged too slowly for windows of gap.window_s"
_GROSS = {"bias": 0.1, "scale": 0.12, "misalignment": np.radians(8.0), "delay": 0.016}


@dataclass(frozen=True)
class Gyroscope:
    """The gyroscope held against the attitude."""

    faults: tuple[CheckedFault, ...] = ()  # What is identified.
    untested: Mapping[str, str] = field(default_factory=dict)  # Faults that cannot, with the reason.
    fit: GyroFit | None = None
    apart: tuple[Finding, ...] = ()  # That the two do not show one motion in one unit.

    @classmethod
    def unjudged(cls, reason: str, apart: tuple[Finding, ...] = ()) -> Self:
        """Say why none of its faults is identified."""
        return cls(untested=dict.fromkeys(_of_gyroscope(), reason), apart=apart)

    def named(self, estimate: str, windows: Windows) -> AuditFinding | None:
        """Find the fault of a kind, such as the delay of the gyroscope against the attitude, if it is significant."""
        named = (each for each in findings(self.faults, windows.period) if each.named)
        return next((each for each in named if _estimate(each.name) == estimate), None)

    def findings(self, windows: Windows) -> tuple[Finding, ...]:
        """Say what is wrong with the gyroscope, far beyond what sensors of multirotors show."""
        found = findings(self.faults, windows.period)
        if self.apart:
            scaled = any(each.named and _estimate(each.name) == "scale" for each in found)
            return tuple(replace(each, repairable=scaled) for each in self.apart)
        return tuple(gross for each in found if (gross := _gross(each)) is not None)


@dataclass(frozen=True)
class Sensors:
    """What the sensors of flights say of each other."""

    gyroscope: Gyroscope  # Once a late attitude is set right.
    clocks: tuple[ChannelRepair, ...]  # What sets an attitude that is late or turned, and late rotors, right.
    flights: tuple[Signals, ...]  # On one clock.
    motion: Settled  # What a majority says of the channels of the motion.
    findings: tuple[Finding, ...]  # What is wrong.


def sensors_of(flights: Sequence[Signals], windows: Windows) -> Sensors:
    """Hold the sensors of flights with the same hardware, at the sampling period of the windows, against each other."""
    gyroscope, dropped = _gyroscope(flights, windows), tuple[Finding, ...]()
    late = gyroscope.named("delay", windows)
    # The one that comes after the other is late: sensors, filters and wires delay a log, and nothing makes it early.
    clocks: tuple[ChannelRepair, ...] = ()
    if late and late.coefficients[0].value < 0:
        clocks = _attitude_on_clock(late.coefficients[0], flights, windows)
        flights = _repaired(clocks, flights)
        gyroscope = _gyroscope(flights, windows)
        late = gyroscope.named("delay", windows)
    askew = gyroscope.named("misalignment", windows)
    turned = None if askew is None else _attitude_on_axes(askew, flights)
    if turned is not None:
        clocks, flights = (*clocks, turned), _repaired((turned,), flights)
        gyroscope = _gyroscope(flights, windows)
        late = gyroscope.named("delay", windows)
    elif askew is not None and (along := _accelerometer_on_axes(askew, flights)) is not None:
        clocks, flights = (*clocks, along), _repaired((along,), flights)
    # A gyroscope that is late is set right by what names its delay.
    delay = late.coefficients[0].value if late else 0.0
    ahead = [replace(each, body_rate=shifted(each.body_rate, each.time, delay)) for each in flights]
    rotors = rotors_on_clock(ahead, windows)
    if rotors is not None:
        apart = set_apart(flights, flights, _repaired((rotors,), flights), windows)
        if apart and rotors.finding is not None:
            why = f", which {joined(apart)} contradict, so nothing is corrected"
            remedy = f"check the clocks of {joined(rotors.finding.channels)}"
            what = f"{rotors.finding.what}{why}"
            dropped = (replace(rotors.finding, what=what, remedy=remedy, repairable=False),)
        else:
            clocks, flights = (*clocks, rotors), _repaired((rotors,), flights)
    motion = settled(flights if thrust_is_known(flights) else [weighed(signals) for signals in flights], windows)
    mended = [repair.finding for repair in clocks if repair.finding is not None]
    wrong = (*gyroscope.findings(windows), *mended, *dropped, *motion.findings)
    return Sensors(gyroscope, clocks, tuple(flights), motion, wrong)


def _repaired(repairs: Sequence[ChannelRepair], flights: Sequence[Signals]) -> list[Signals]:
    return [reduce(lambda s, each: each.applied(s), repairs, signals) for signals in flights]


def _attitude_on_clock(found: FaultNumber, flights: Sequence[Signals], windows: Windows) -> tuple[ChannelRepair, ...]:
    """Set a late attitude right, and with it the motion where it alone sets them apart: they came over one wire."""
    ways = attitude_on_clock(found), attitude_on_clock(found, ("position", "velocity", "acceleration"))
    alone, both = (_repaired(each, flights) for each in ways)
    along = set_apart(flights, flights, alone, windows) and not set_apart(flights, alone, both, windows)
    return ways[1 if along else 0]


def _attitude_on_axes(fault: AuditFinding, flights: Sequence[Signals]) -> ChannelRepair | None:
    """Turn an attitude whose axes are not those of the gyroscope, where the thrust is along the gyroscope's.

    As of a camera whose axes of the body were drawn askew: what the attitude takes for the thrust leans as it does.
    Every half of a flight has to say so, since a drag, a wind and an acceleration depend on where it flies.

    `fault`: rotation of the gyroscope against the attitude.
    """
    test = CATALOGUE[fault.name].test
    assert test is not None, "found by it"
    turn = fault.named_values(test.labels)
    lean, across = np.array([turn[1], -turn[0]]), list[Array]()
    for flight in flights:
        if flight.velocity is None or flight.attitude is None:
            return None
        felt = np.gradient(flight.velocity, flight.period, axis=0) + flight.vehicle.gravity_m_s2 * UP
        felt = np.einsum("tij,ti->tj", flight.rotation, felt)
        for half in np.array_split(felt[:, :2] / felt[:, 2].mean(), 2):
            if not abs(lean @ half.mean(axis=0) - lean @ lean) < _HALF * (lean @ lean):
                return None
        # In still air this is more precise than the gyroscope is, in gusts less.
        moved = np.column_stack([flight.ground_velocity[:, :2], np.ones(len(felt))])
        across.append(np.linalg.lstsq(moved, felt[:, :2] / felt[:, 2].mean(), rcond=None)[0][-1])
    x, y = np.mean(across, axis=0)
    ends = {each.name: (each.low, each.high) for each in fault.coefficients}
    turn[:2] = [np.clip(own, *ends.get(axis, (0.0, 0.0))) for axis, own in zip(test.labels[:2], (-y, x), strict=True)]
    words = ", ".join(
        test.number(axis, -each) for axis, each in zip("xyz", turn, strict=True) if abs(each) >= test.smallest
    )
    finding = Finding(
        f"the attitude is rotated relative to the vehicle, {words}, judged by the gyroscope and the thrust",
        "align the body axes of the attitude with those of the vehicle",
        ("attitude", "gyroscope", "thrust"),
        float(np.abs(turn).max()),
        "rad",
        contradiction=False,
        repairable=True,
    )
    matrix = np.asarray(np.linalg.inv(test.error(turn).matrix), dtype=np.float64)
    return ChannelRepair("attitude", matrix=matrix).with_finding(finding, f"This is {_DONE}")


def _accelerometer_on_axes(fault: AuditFinding, flights: Sequence[Signals]) -> ChannelRepair | None:
    """Turn an accelerometer that is askew as the gyroscope is, as in one IMU.

    Every half of every flight has to say so: turned, it leans off what velocity and attitude feel by less than half.

    `fault`: rotation of the gyroscope against the attitude.
    """
    test = CATALOGUE[fault.name].test
    assert test is not None, "found by it"
    matrix = np.asarray(np.linalg.inv(test.error(fault.named_values(test.labels)).matrix), dtype=np.float64)
    for flight in flights:
        if flight.specific_force is None or flight.velocity is None or flight.attitude is None:
            return None
        felt = np.gradient(flight.velocity, flight.period, axis=0) + flight.vehicle.gravity_m_s2 * UP
        felt = np.einsum("tij,ti->tj", flight.rotation, felt)
        for half in np.array_split(
            np.stack([flight.specific_force, flight.specific_force @ matrix.T]) - felt, 2, axis=1
        ):
            logged, turned = np.linalg.norm(half[:, :, :2].mean(axis=1), axis=1)
            if not turned < _HALF * logged:
                return None
    finding = Finding(
        "the accelerometer is rotated as the gyroscope is, judged by velocity and attitude",
        "align the axes of the IMU with those of the vehicle",
        ("accelerometer", "gyroscope", "velocity"),
        contradiction=False,
        repairable=True,
    )
    return ChannelRepair("specific_force", matrix=matrix).with_finding(finding, f"This is {_DONE}")


def _gross(fault: AuditFinding) -> Finding | None:
    """Say what is wrong where it is more than sensors of multirotors show."""
    named = [number for number in fault.coefficients if number.named]
    if not named:
        return None
    estimate, largest = str(_estimate(fault.name)), max(named, key=lambda number: abs(number.value))
    if abs(largest.value) <= _GROSS[estimate]:
        return None
    # A clock that runs fast or slow does so about all axes, and nothing else in a log of both shows it.
    alike = estimate == "scale" and len(named) == 3 and max(own.low for own in named) < min(own.high for own in named)
    return Finding(
        f"{fault.sentence[0].lower()}{fault.sentence[1:-1]}",
        f"check import.signals.body_rate{', or, as it is alike about all axes, the clock of the log' if alike else ''}",
        ("gyroscope", "attitude"),
        largest.value,
        largest.unit,
        contradiction=estimate != "delay",
        repairable=True,
    )


def _estimate(name: str) -> object:
    test = CATALOGUE[name].test
    assert test is not None, "the audit tests what has a test"
    return test.estimate


def _live(flight: Signals) -> list[Signals]:
    """Cut out where gyroscope or attitude repeat their last value, which is no motion."""
    still = stands_still(flight.time, flight.body_rate)
    if flight.attitude is not None:
        still |= stands_still(flight.time, flight.attitude)
    return [stretch_of(flight, slice(first, after)) for first, after in runs(~still)] or [flight]


def _gyroscope(flights: Sequence[Signals], windows: Windows) -> Gyroscope:
    if all(signals.attitude is None for signals in flights):
        return Gyroscope.unjudged("the log has no attitude to check the gyroscope against")
    flights = [live for signals in flights for live in _live(signals)]
    cut = [motion for signals in flights if (motion := kinematics(signals, windows)) is not None]
    if not cut:
        return Gyroscope.unjudged("the flights are too short")
    scanned = scan(cut)
    unlike, scaled = gyroscope_apart(scanned.seen, scanned.read)
    filtered = _is_filtered(flights, windows, scanned)
    apart = (*unlike, *(() if filtered else scaled))
    if unlike and (jumps := _jumps(flights, windows, scanned)):
        return Gyroscope.unjudged("the attitude jumps", jumps)
    if unlike:
        return Gyroscope.unjudged("the axes of the gyroscope and the attitude do not match", apart)
    if _agrees_to_rounding(flights, windows):
        return Gyroscope.unjudged(
            "the attitude agrees with the gyroscope to rounding, as if it were integrated from it"
        )
    fit = fit_gyro(cut, scanned)
    if fit is None:
        return Gyroscope.unjudged("the flights are too short", apart)
    fits = {name: fit.of(str(test.estimate)) for name, test in _of_gyroscope().items()}
    still = "the flights barely rotate, so it would not show"
    untested = {name: still for name, numbers in fits.items() if not numbers.known.any()}
    if filtered:
        untested |= {name: _FILTERED for name, test in _of_gyroscope().items() if test.estimate == "scale"}
    # What averages for as long as a window leaves nothing of the motion that a window shows.
    coarse = max(max(sum(each.attitude_spans), sum(each.body_rate_spans)) for each in flights)
    if coarse >= len(windows.weight) * windows.period:
        untested |= {name: _COARSE for name, test in _of_gyroscope().items() if test.estimate == "scale"}
    noise = least_noise([signals.body_rate for signals in flights]) * np.sqrt((windows.weight**2).sum())
    if np.sqrt(fit.variance.max()) < _SHARE_OF_NOISE * noise:
        derived = "the attitude contains the gyroscope's own noise, so it was integrated from it and would not show it"
        untested |= {name: derived for name, test in _of_gyroscope().items() if test.integrated}
    faults = (CheckedFault(CATALOGUE[name], numbers) for name, numbers in fits.items() if name not in untested)
    return Gyroscope(tuple(faults), untested, fit, apart)


def _jumps(flights: Sequence[Signals], windows: Windows, scanned: DelayScan) -> tuple[Finding, ...]:
    """Find where the attitude turns at once and the gyroscope does not, if both are one motion but for that.

    As of an estimator that resets its yaw. A step shows in a window by the step times the weight where it is.
    """
    cut = [(each, motion) for each in flights if (motion := kinematics(each, windows)) is not None]
    flight = np.repeat(np.arange(len(cut)), [len(motion.rate) for _, motion in cut])
    time = np.concatenate([motion.centres for _, motion in cut])
    steps = (scanned.seen - scanned.read) * windows.period / windows.weight.max()
    left, found = np.ones(len(steps), dtype=bool), list[Finding]()
    while left.mean() >= _BUT_FOR_JUMPS:
        size = np.where(left, np.abs(steps).max(axis=1), 0.0)
        if size.max() <= _JUMP_RAD:
            break
        at = int(size.argmax())
        left &= (flight != flight[at]) | (np.abs(time - time[at]) > len(windows.weight) * windows.period)
        found.append(_jump(cut[flight[at]][0], float(time[at]), 0.5 * len(windows.weight) * windows.period))
    if left.mean() < _BUT_FOR_JUMPS or gyroscope_apart(scanned.seen[left], scanned.read[left])[0]:
        return ()
    return tuple(found)


def _jump(flight: Signals, about_s: float, half_s: float) -> Finding:
    """Measure a jump of the attitude at about a time of a flight: what it turns by in a window beyond the gyroscope."""
    from scipy.spatial.transform import Rotation

    assert flight.attitude is not None, "it jumps"
    inside = np.flatnonzero(np.abs(flight.time - about_s) <= half_s)
    turned = Rotation.from_euler("ZYX", flight.attitude[inside, ::-1])
    beyond = (turned[:-1].inv() * turned[1:]).as_rotvec() - flight.period * flight.body_rate[inside[:-1]]
    size, at = beyond.sum(axis=0), flight.time[inside[np.linalg.norm(beyond, axis=1).argmax()]]
    axis = int(np.abs(size).argmax())
    where = f"body {BODY_AXES[axis]} at {at:.1f} s{f' of {flight.name}' if flight.name else ''}"
    what = f"the attitude jumps by {np.degrees(size[axis]):.0f} deg about {where}, which the gyroscope does not show"
    remedy = (
        "keep what is before it or after it by import.crop_s, in s from the first stamp of the log: an estimator that "
        "resets its yaw jumps so"
    )
    turns = abs(size[axis]) / (2 * np.pi)
    if turns > 0.5 + _NEAR_TURN:
        # No attitude jumps by more than half a turn, and no angle makes another jump of its derivative than full turns.
        what = (
            f"the body rate turns by {np.degrees(-size[axis]):.0f} deg about {where}, which the attitude does not show"
        )
        remedy = "a gyroscope at its limit or a spike: keep what is before it or after it by import.crop_s"
        if abs(turns - round(turns)) < _NEAR_TURN:
            remedy = (
                "it is derived from an angle that jumps by a full turn: leave body_rate out, which the attitude gives"
            )
    return Finding(what, remedy, ("attitude", "gyroscope"), float(size[axis]), "rad")


def _agrees_to_rounding(flights: Sequence[Signals], windows: Windows) -> bool:
    """Check whether the rates by gyroscope and attitude are one, as they are logged."""
    logged = (kinematics(replace(each, attitude_spans=(), body_rate_spans=()), windows) for each in flights)
    apart = np.concatenate([motion.rate - motion.gyro_rate(0.0) for motion in logged if motion is not None])
    return bool(np.sqrt((apart**2).mean()) < _ROUNDING)


def _is_filtered(flights: Sequence[Signals], windows: Windows, scanned: DelayScan) -> bool:
    """Check whether gyroscope and attitude differ in size as a filter of one makes them: in fast motion alone."""
    gain = _gains(scanned)
    off = (np.abs(gain) > _FILTERED_FROM) & (scanned.seen.std(axis=0) > TURNING_RAD_S)
    if not off.any():
        return False
    for times in _SLOWER:
        longer = windows_of(windows.period, times * len(windows.weight) * windows.period, 0.5)
        cut = [motion for signals in flights if (motion := kinematics(signals, longer)) is not None]
        if sum(len(motion.rate) for motion in cut) >= FEWEST_WINDOWS:
            return bool((np.abs(_gains(scan(cut))[off]) < _NEARER * np.abs(gain[off])).all())
    return False


def _gains(scanned: DelayScan) -> Array:
    """Give the logarithm of the size of the gyroscope's rate over that of the attitude's, shape (3,)."""
    read, seen = np.maximum([scanned.read.std(axis=0), scanned.seen.std(axis=0)], np.finfo(float).tiny)
    return np.asarray(np.log(read / seen))


def _of_gyroscope() -> dict[str, SensorTest]:
    """List the effects whose numbers are those of the regression of the gyroscope."""
    return {
        name: effect.test
        for name, effect in CATALOGUE.items()
        if effect.test is not None and isinstance(effect.test.estimate, str)
    }
