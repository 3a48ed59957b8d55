"""The clocks of rotors, gyroscope and attitude: where two of them agree, the third is wrong."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.blocks import blocks_of_time, half_width, mean_error
from cpfls_cli.consistency.findings import FaultNumber, Finding, in_ms, off_clock
from cpfls_cli.consistency.gyroscope import LONGEST_DELAY_S
from cpfls_cli.consistency.repairs import ChannelRepair, shifted
from cpfls_cli.effects.signals import Signals
from cpfls_cli.errors import ComputationError, SettingError
from cpfls_cli.flightlog.importing import estimate_delay
from cpfls_cli.flightlog.results import DelayEstimate
from cpfls_cli.lag import DelayFit, fit_delay
from cpfls_cli.weak_form.windows import Windows
from cpfls_cli.words import capitalised

_STEP_S = 0.005  # Between delays that are tried.
# Above the motion of a multirotor and below most of the noise of its derivative.
_LOWPASS_HZ, _SHARE_OF_RATE = 8.0, 0.2
_DELAY_MAX_S = 0.2  # Rotors of the largest multirotors follow within a fifth of a second.
_SMALLEST_R2 = 0.3  # A rigid body that explains less of the torque leaves the delay to chance.
_SURE_S = 0.002  # Missing effects shift the motion against the torque by about this much; a damping is allowed for.
_FEWEST_WINDOWS, _FEWEST_HALVES = 24, 2  # Windows that a fit of five numbers wants, and estimates that have a scatter.
_ROTORS_OFF_S = 0.008  # Filters before a gyroscope, and a flow that lags behind a rotor, are a few milliseconds.
_TELEMETRY_S = 0.24  # Telemetry comes up to a quarter of a second late.
_SCATTER_S, _SCATTER = 0.004, 0.2  # Estimates of one clock scatter by less than this, or by less than this share of it.
_FEWEST_SHIFTS = 4  # Two halves of one flight about roll and pitch.
# Share of the torque that is left where no shift can do better, and share of that which a shift has to leave at most.
_NEXT_TO_NOTHING, _HALF = 0.01, 0.5
_DONE = "corrected before the balance"
_UNDECIDED = "these flights do not show whether the gyroscope or the attitude is late, and a log is late, not early"


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


def attitude_on_clock(
    found: FaultNumber, flights: Sequence[Signals], windows: Windows
) -> tuple[tuple[ChannelRepair, ...], tuple[str, ...]]:
    """Put an attitude that is late against the gyroscope onto its clock.

    Which of the two is late the rotors say. Where they do not, as commands or a loop that answers gusts, it is the one
    that comes after the other: a sensor, a filter or a wire makes a log late, and nothing makes it early.

    `found`: delay of the gyroscope behind the attitude, s.
    Result `repairs`: empty where the gyroscope is late.
    Result `notes`: that only this makes the gyroscope late.
    """
    gyro_delay, half_s = found.value, 0.5 * (found.high - found.low)
    behind = np.array([delay for half in _halves(flights, windows) if (delay := _behind(half)) is not None])
    agrees, lags = False, False
    if len(behind) >= _FEWEST_HALVES:
        delay, unsure = np.median(behind), max(_SURE_S, 2 * behind.std(ddof=1) / np.sqrt(len(behind)))
        agrees, lags = (abs(delay - late) + unsure < 0.5 * abs(gyro_delay) for late in (0.0, gyro_delay))
    if lags or (gyro_delay > 0 and not agrees):
        return (), () if lags else (f"{capitalised(_UNDECIDED)}, so the gyroscope is shifted.",)
    channels = ("gyroscope", "rotors") if agrees else ("gyroscope",)
    judged = "the gyroscope and the rotors, whose clocks agree" if agrees else f"the gyroscope: {_UNDECIDED}"
    what = f"the attitude is {off_clock(-gyro_delay, half_s)}, judged by {judged}"
    finding = _off_clock(what, "correct its clock in the log", ("attitude", *channels), -gyro_delay)
    return (ChannelRepair("attitude", delay_s=-gyro_delay).with_finding(finding, f"It is {_DONE}"),), ()


def rotors_on_clock(flights: Sequence[Signals], windows: Windows) -> ChannelRepair | None:
    """Put measured rotor speeds that are late or early against the gyroscope onto its clock.

    Telemetry of speed controllers comes late. Every half of a flight has to say the same about roll and about pitch,
    and a shift has to halve what is left at least: on real flights whose clocks agree, drag and damping explain the
    torque as well with any shift. Yaw says nothing, because rotors that speed up turn the vehicle ahead of their drag.

    None where nothing is wrong, or nobody knows.
    """
    found = [shift for half in _halves(flights, windows) for shift in _shifts(half)]
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


@dataclass(frozen=True)
class _Half:
    """Half of a flight: the torque of measured rotors, and what explains it about each axis.

    That is angular acceleration, rate, air velocity and a constant, about each axis on its own: an inertia that is
    wrong, a damping or a drag that is missing shifts no clock.
    """

    time: Array
    torque: Array
    motion: Array  # Shape (window, axis, column).
    windows: Windows

    def rotor_delay(self, most_s: float, axes: int, *, each: bool) -> DelayFit:
        """Estimate the delay of the rotors, to so many s either way, of all axes alike or of each."""
        motion, tried = self.motion[:, :axes], np.linspace(-most_s, most_s, 2 * round(most_s / _STEP_S) + 1)

        def moved(delay: float) -> tuple[Array, Array]:
            return motion, self.windows.average(shifted(self.torque[:, :axes], self.time, delay))

        block = blocks_of_time(len(motion), self.windows.hop * self.windows.period)
        return fit_delay(tried, moved, block, each=each)


def _halves(flights: Sequence[Signals], windows: Windows) -> Iterator[_Half]:
    """Cut the flights with measured rotor speeds into halves; commands, which a lag lies behind, are left out."""
    for signals in flights:
        if signals.rotor_speed is None or signals.commanded:
            continue
        assert signals.torque is not None, "rotors turn"
        middle = len(signals) // 2
        for part in (slice(0, middle), slice(middle, None)):
            rate = signals.body_rate[part]
            if windows.count(len(rate)) < _FEWEST_WINDOWS:
                continue
            air = signals.ground_velocity[part] if "velocity" in signals.available else np.zeros((len(rate), 0))
            turning, turned, moved = windows.derivative(rate), windows.average(rate), windows.average(air)
            columns = [np.column_stack([turning[:, axis], turned[:, axis], moved]) for axis in range(3)]
            yield _Half(signals.time[part], signals.torque[part], np.stack(columns, axis=1), windows)


def _shifts(half: _Half) -> Iterator[float]:
    """Estimate by how much the rotors are late about roll and pitch, s; 0 for no sure shift, nothing for no hint."""
    if not np.ptp(half.torque[:, :2], axis=0).all():
        return

    found = half.rotor_delay(_TELEMETRY_S, 2, each=True)
    as_logged, least = found.unexplained[len(found.unexplained) // 2], found.unexplained.min(axis=0)
    if as_logged.max() < _NEXT_TO_NOTHING:
        yield from (0.0, 0.0)
        return
    sure = found.inside & (least < _HALF * as_logged)
    for axis in np.flatnonzero(least <= 1 - _SMALLEST_R2):
        yield float(found.delay[axis]) if sure[axis] else 0.0


def _behind(half: _Half) -> float | None:
    """Estimate the delay of the gyroscope behind the rotors, s; all axes have equal weight."""
    found = half.rotor_delay(LONGEST_DELAY_S, 3, each=False)
    return -float(found.delay) if found.inside and found.unexplained.min() <= 1 - _SMALLEST_R2 else None
