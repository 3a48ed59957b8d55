"""The control law that flew, as far as a log states it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, Numbers
from cpfls_cli.autopilots.law import Law, chain
from cpfls_cli.autopilots.registry import AUTOPILOTS
from cpfls_cli.estimation.spectra import FEWEST_BLOCKS, block_spectra, cut_blocks, smoothed, transforms, window_starts
from cpfls_cli.look.flight import LogFlight

_WINDOW_S, _SLOW_WINDOW_S, _SLOW_HZ = 2.0, 4.0, 150.0
"""Windows, those of slow logs, and the rate of the clock below which a log is one."""
_OF_CLOCK = 0.065
_FOLLOWS = 0.9
"""Least share of what the setpoint leaves of the command that goes with the body rate: less, and rounding of the body
rate makes the feedback seem smaller by as much."""
_MOST_DB, _MOST_DEG = 3.0, 20.0
"""By which the feedback that flew may differ from the stated one, so that margins of the latter count: about half of
those that are usually asked for."""
_AROUND, _TINY = 1.5, float(np.finfo(float).tiny)
"""Frequencies around a crossover that decide its margins, a factor to both sides."""


class FlownFeedback(NamedTuple):
    """The feedback about one axis as it flew, over that of the stated law, by frequency in Hz.

    Frequencies are those at which the command is seen to follow the body rate.
    """

    frequency: Array
    over: Numbers

    def near(self, hz: float) -> tuple[float, float] | None:
        """Give size, as a ratio, and phase, rad, around a crossover; None where the log does not show them."""
        inside = np.abs(np.log(self.frequency / hz)) < np.log(_AROUND)
        if not inside.any():
            return None
        return float(np.median(np.abs(self.over[inside]))), float(np.median(np.angle(self.over[inside])))

    def fits(self, hz: float) -> bool:
        """Whether margins of the stated law count at a crossover; so they do where the log does not show it."""
        found = self.near(hz)
        if found is None:
            return True
        return bool(abs(20 * np.log10(found[0])) < _MOST_DB and abs(np.degrees(found[1])) < _MOST_DEG)


def flown_law(flight: LogFlight) -> Law | None:
    """Make the law of the parameters in a log; None where it states no gains, or those of a version of other scales."""
    autopilot = AUTOPILOTS.get(flight.autopilot)
    if autopilot is None or autopilot.firmware.gains_differ(flight.system):
        return None
    logged = autopilot.in_log(flight.parameters)
    return autopilot.law(autopilot.of_log(logged)) if logged else None


def gyroscope_filters(law: Law | None, axis: int, frequency: Array) -> Numbers:
    """Evaluate the filters that a logged body rate has passed, shape (frequency,); 1 where they are not known."""
    if law is None:
        return np.ones(len(frequency), dtype=complex)
    return chain(law.axes[axis].measured, np.exp(-2j * np.pi * frequency * law.period), law.period)


def flown_feedback(flight: LogFlight, axis: int, law: Law) -> FlownFeedback | None:
    """Estimate the feedback that flew: how the command follows the body rate where the setpoint is held equal.

    The autopilot makes the command of setpoint and body rate alone, so least squares of the command on both, frequency
    by frequency, is unbiased by gusts. None where too little is usable.
    """
    signals = (flight.rate_setpoint[:, axis], flight.body_rate[:, axis], flight.command[:, axis])
    usable = flight.usable & np.isfinite(np.stack(signals)).all(axis=0)
    length = round((_WINDOW_S if flight.rate_hz > _SLOW_HZ else _SLOW_WINDOW_S) * flight.rate_hz)
    begins = window_starts(usable, length)
    frequency = np.asarray(np.fft.rfftfreq(length, 1 / flight.rate_hz), dtype=float)
    inside = (frequency > 2.5 / length * flight.rate_hz) & (frequency < _OF_CLOCK * flight.rate_hz)
    if len(begins) < 2 or not inside.any():
        return None
    parts = [transforms(np.nan_to_num(each), begins, length, 1 / flight.rate_hz)[0] for each in signals]
    spectra = block_spectra(parts, cut_blocks((np.abs(parts[2]) ** 2).sum(axis=1)), frequency, inside)
    if len(spectra.windows) < FEWEST_BLOCKS:
        return None
    total = smoothed(spectra.total[None], axis=1)[0]
    # Of body rate and command, what goes with the setpoint is taken off.
    rest = total[:, 1:, 1:] - total[:, 1:, :1] * total[:, :1, 1:] / np.maximum(total[:, :1, :1].real, _TINY)
    powers = rest[:, 0, 0].real * rest[:, 1, 1].real
    clear = (powers > _TINY) & (np.abs(rest[:, 0, 1]) ** 2 > _FOLLOWS * powers)
    seen = spectra.frequency[clear]
    # The logged body rate has passed filters that are part of the law's feedback.
    stated = law.response(axis, seen).feedback / gyroscope_filters(law, axis, seen)
    return FlownFeedback(seen, -rest[clear, 0, 1] / rest[clear, 0, 0].real / stated)
