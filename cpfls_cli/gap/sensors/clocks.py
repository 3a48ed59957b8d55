"""The clocks of rotors, gyroscope and attitude: where two of them agree, the third is wrong."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.effects.signals import Signals
from cpfls_cli.errors import ComputationError, SettingError
from cpfls_cli.flightlog.alignment import estimate_delay
from cpfls_cli.flightlog.results import DelayEstimate
from cpfls_cli.gap.balance.windows import Windows
from cpfls_cli.gap.sensors.repairs import ChannelRepair, shifted

_LONGEST_S = 0.1
_STEPS = 41
# Above the motion of a multirotor and below most of the noise of its derivative.
_LOWPASS_HZ = 8.0
_SHARE_OF_RATE = 0.2
_DELAY_MAX_S = 0.2
# A rigid body that explains less of the torque leaves the delay to chance.
_SMALLEST_R2 = 0.3
# Missing effects shift the motion against the torque by about this much; a damping is allowed for.
_SURE_S = 0.002
_FEWEST_WINDOWS, _FEWEST_HALVES = 24, 2
_UNDECIDED = "Whether gyroscope or attitude is late these flights do not tell; the gyroscope is shifted."


@dataclass(frozen=True)
class ActuationDelay:
    """Delay of the motion behind the logged torque, for information.

    Attributes
    ----------
    commanded : bool
        Whether that torque was commanded, not measured.
    delay_s : float
        Median over the flights, s.
    spread_s : float
        Largest less smallest over the flights, s.
    sentence : str
    """

    commanded: bool
    delay_s: float
    spread_s: float
    sentence: str


def actuation_delay(flights: Sequence[Signals]) -> ActuationDelay | None:
    """Estimate the delay of the motion behind the torque, flight by flight.

    Returns
    -------
    ActuationDelay or None
        None where no flight tells.
    """
    estimates = [(signals.commanded, estimate) for signals in flights if (estimate := _estimate(signals)) is not None]
    if not estimates:
        return None
    delays = [estimate.delay_s for _, estimate in estimates]
    commanded = estimates[0][0]
    delay = float(np.median(delays))
    whom = "commands" if commanded else "measured rotors"
    bound = "at least" if any(estimate.at_bound for _, estimate in estimates) else "about"
    sentence = f"The motion follows the {whom} by {bound} {1000 * delay:.0f} ms."
    return ActuationDelay(commanded, delay, float(np.ptp(delays)), sentence)


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
    gyro_delay: float, flights: Sequence[Signals], windows: Windows
) -> tuple[tuple[ChannelRepair, ...], tuple[str, ...]]:
    """Put an attitude that is late against gyroscope and rotors onto their clock.

    Parameters
    ----------
    gyro_delay : float
        Of the gyroscope behind the attitude, s.
    flights : sequence of Signals
    windows : Windows

    Returns
    -------
    repairs : tuple of ChannelRepair
        Empty where the gyroscope is late, or where nobody knows.
    notes : tuple of str
        That nobody knows.
    """
    behind = rotor_clock(flights, windows)
    if len(behind) < _FEWEST_HALVES:
        return (), (_UNDECIDED,)
    delay, unsure = np.median(behind), max(_SURE_S, 2 * behind.std(ddof=1) / np.sqrt(len(behind)))
    if abs(delay - gyro_delay) + unsure < 0.5 * abs(gyro_delay):
        return (), ()
    if abs(delay) + unsure >= 0.5 * abs(gyro_delay):
        return (), (_UNDECIDED,)
    sentence = (
        f"The attitude is {'late' if gyro_delay < 0 else 'early'} by {abs(1000 * gyro_delay):.0f} ms, judged by "
        "gyroscope and rotors, which keep one time. It is set right before the balance; mend its clock in the log."
    )
    return (ChannelRepair("attitude", delay_s=-gyro_delay, sentence=sentence),), ()


def rotor_clock(flights: Sequence[Signals], windows: Windows) -> Array:
    """Estimate the delay of the gyroscope behind measured rotors, half flight by half flight.

    The torque at each delay is explained by angular acceleration, rate, air velocity and a constant, about each axis on
    its own: an inertia that is wrong, a damping or a drag that is missing shifts no clock.

    Returns
    -------
    array, shape (half,), s
        Halves that tell nothing are left out; empty for commands, which a lag lies behind.
    """
    halves = [
        delay
        for signals in flights
        if signals.rotor_speed is not None and not signals.commanded
        for part in (slice(0, len(signals) // 2), slice(len(signals) // 2, None))
        if (delay := _delay(signals, part, windows)) is not None
    ]
    return np.array(halves)


def _delay(signals: Signals, part: slice, windows: Windows) -> float | None:
    time, rate, torque = signals.time[part], signals.body_rate[part], signals.torque
    assert torque is not None, "rotors turn"
    if windows.count(len(time)) < _FEWEST_WINDOWS:
        return None
    delays = np.linspace(-_LONGEST_S, _LONGEST_S, _STEPS)
    air = signals.ground_velocity[part] if "velocity" in signals.available else np.zeros((len(time), 0))
    columns = (windows.derivative(rate), windows.average(rate), windows.average(air))
    explained = np.array([_explained(windows.average(shifted(torque[part], time, -each)), *columns) for each in delays])
    best = int(np.argmax(explained))
    if explained[best] < _SMALLEST_R2 or best in (0, _STEPS - 1):
        return None
    below, top, above = explained[best - 1 : best + 2]
    return float(delays[best] + 0.5 * (delays[1] - delays[0]) * (below - above) / (below - 2 * top + above))


def _explained(torque: Array, turning: Array, rate: Array, air: Array) -> float:
    """Give the share of the torque that the motion explains, all axes with equal weight."""
    shares = []
    for axis in range(3):
        right = torque[:, axis] - torque[:, axis].mean()
        left = np.column_stack([turning[:, axis], rate[:, axis], air])
        left = left - left.mean(axis=0)
        if right.any():
            rest = right - left @ np.linalg.lstsq(left, right, rcond=None)[0]
            shares.append(1 - (rest**2).sum() / (right**2).sum())
    return float(np.mean(shares)) if shares else 0.0
