"""How far the motion follows the commands, or the measured rotors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cpfls_cli.effects.signals import Signals
from cpfls_cli.errors import ComputationError, SettingError
from cpfls_cli.flightlog.alignment import estimate_delay
from cpfls_cli.flightlog.results import DelayEstimate

# Above the motion of a multirotor and below most of the noise of its derivative.
_LOWPASS_HZ = 8.0
_SHARE_OF_RATE = 0.2
_DELAY_MAX_S = 0.2
# A rigid body that explains less leaves the delay to chance.
_SMALLEST_R2 = 0.3


@dataclass(frozen=True)
class ActuationDelay:
    """Delay of the motion behind the torque that the log tells, for information.

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
    """Estimate how late the motion follows the torque, flight by flight.

    Returns
    -------
    ActuationDelay or None
        None where no flight tells.
    """
    told = [(signals.commanded, found) for signals in flights if (found := _estimate(signals)) is not None]
    if not told:
        return None
    delays = [found.delay_s for _, found in told]
    commanded = told[0][0]
    delay = float(np.median(delays))
    whom = "commands" if commanded else "measured rotors"
    bound = "at least" if any(found.at_bound for _, found in told) else "about"
    sentence = f"The motion follows the {whom} by {bound} {1000 * delay:.0f} ms."
    return ActuationDelay(commanded, delay, float(np.ptp(delays)), sentence)


def _estimate(signals: Signals) -> DelayEstimate | None:
    if signals.torque is None:
        return None
    lowpass = min(_LOWPASS_HZ, _SHARE_OF_RATE / signals.period)
    try:
        found = estimate_delay(
            signals.time, signals.body_rate, signals.torque, delay_max_s=_DELAY_MAX_S, lowpass_hz=lowpass
        )
    except (ComputationError, SettingError):
        return None
    return found if found.pooled_r2 > _SMALLEST_R2 else None
