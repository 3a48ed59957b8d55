"""The clocks of rotors, gyroscope and attitude, held against each other."""

from collections.abc import Iterator, Sequence

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.blocks import blocks_of_time, half_width, mean_error
from cpfls_cli.consistency.findings import FaultNumber, Finding, in_ms, off_clock
from cpfls_cli.consistency.repairs import ChannelRepair, shifted
from cpfls_cli.effects.signals import Signals, stretch_of
from cpfls_cli.errors import ComputationError, SettingError
from cpfls_cli.flightlog.importing import estimate_delay
from cpfls_cli.flightlog.results import DelayEstimate
from cpfls_cli.lag import fit_delay
from cpfls_cli.weak_form.windows import Windows

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
_DONE = "corrected before the balance"


def actuation_delay(flights: Sequence[Signals]) -> tuple[str, ...]:
    """Say by which delay the motion follows commands or a logged torque; nothing if unknown.

    Median over the flights, and all of their 95 % intervals.
    Behind measured speeds nothing has to come late: what looks so may be an autopilot that answers gusts.
    """
    driven = [signals for signals in flights if signals.commanded or signals.rotor_speed is None]
    estimates = [estimate for signals in driven if (estimate := _estimate(signals)) is not None]
    if not estimates:
        return ()
    delay = float(np.median([estimate.delay_s for estimate in estimates]))
    low, high = min(own.low_s for own in estimates), max(own.high_s for own in estimates)
    whom = "commands" if driven[0].commanded else "logged torque"
    bound = any(estimate.at_bound for estimate in estimates)
    by = f"at least {1000 * delay:.0f} ms" if bound else in_ms(delay, low, high)
    return (f"The motion follows the {whom} by {by}.",)


def _estimate(signals: Signals) -> DelayEstimate | None:
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
    what = f"{who} {off_clock(-found.value, 0.5 * (found.high - found.low))}, judged by the gyroscope"
    finding = _off_clock(what, "correct the clock in the log", ("attitude", "gyroscope"), -found.value)
    first = ChannelRepair("attitude", delay_s=-found.value).with_finding(finding, f"This is {_DONE}")
    return (first, *(ChannelRepair(name, delay_s=-found.value) for name in along))


def rotors_on_clock(flights: Sequence[Signals], windows: Windows) -> ChannelRepair | None:
    """Put measured rotor speeds that are late or early against the gyroscope onto its clock.

    Telemetry of speed controllers comes late. Every half of a flight has to say the same about roll and about pitch,
    and a shift has to halve what is left at least: on real flights whose clocks agree, drag and damping explain the
    torque as well with any shift. Yaw says nothing, because rotors that speed up turn the vehicle ahead of their drag.

    None where nothing is wrong, or nobody knows.
    """
    found = [shift for half in _halves(flights) for shift in _shifts(half, windows)]
    if len(found) < _FEWEST_SHIFTS:
        return None
    delay = float(np.median(found))
    if abs(delay) < _ROTORS_OFF_S or np.abs(np.array(found) - delay).max() > max(_SCATTER_S, _SCATTER * abs(delay)):
        return None
    half_s = float(half_width(mean_error(np.array(found)), len(found)))
    what = f"the rotor speeds are {off_clock(delay, half_s)}, judged by the gyroscope"
    finding = _off_clock(what, "correct their clock in the log", ("rotors", "gyroscope"), delay)
    return ChannelRepair("rotor_speed", delay_s=delay).with_finding(finding, f"They are {_DONE}")


def _off_clock(what: str, remedy: str, channels: tuple[str, ...], delay: float) -> Finding:
    return Finding(what, remedy, channels, delay, "s", contradiction=False, repairable=True)


def _halves(flights: Sequence[Signals]) -> Iterator[Signals]:
    """Cut the flights with measured rotor speeds into halves; commands, which a lag lies behind, are left out."""
    for signals in flights:
        if signals.rotor_speed is not None and not signals.commanded:
            middle = len(signals) // 2
            yield from (stretch_of(signals, part) for part in (slice(0, middle), slice(middle, None)))


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
