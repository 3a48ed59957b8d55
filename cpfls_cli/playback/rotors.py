"""From logged rotor speeds to those that act: delay, lag and slow actuation, and the terms of the rotors by step."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from cpfls_cli.arrays import Array, Numbers
from cpfls_cli.lag import delayed, lagged
from cpfls_cli.result import about

Hold = Literal["linear", "previous"]
TimeOfResponse = Literal["delay_s", "lag_s", "slow_s"]

_STEP = 1e-30
"""Imaginary step of a derivative: so small that no digit is lost."""

_SHORTEST_S = 1e-5
"""Lag below which a held speed jumps: a hundredth of the shortest sample."""


@dataclass(frozen=True, kw_only=True)
class RotorResponse:
    """How rotors follow their logged speed."""

    delay_s: float = about("pure delay", unit="s", default=0.0)
    lag_s: float = about("time constant of the first-order lag; 0 for none", unit="s", default=0.0)
    slow_roll_pitch: float = about(
        "slow actuation: share by which roll and pitch torque of the rotors come back after a change; below 0: fade",
        default=0.0,
    )
    slow_yaw: float = about("the same of the yaw torque", default=0.0)
    slow_s: float = about("time constant with which they do", unit="s", default=0.5)

    @property
    def times(self) -> tuple[float, float, float]:
        """Delay, lag and slow time, s."""
        return self.delay_s, self.lag_s, self.slow_s

    def terms_by_step(
        self, speed: Array, period: float, hold: Hold, by: TimeOfResponse | None = None, *, slow: bool = True
    ) -> Array:
        """Evaluate the terms of the rotors over each step, or their derivatives by one of the times.

        Maybe without slowness; other parameters and shape as `rotor_terms_by_step`.
        """
        delay_s, lag_s, slow_s = self._moved(by)
        return _slope(rotor_terms_by_step(speed, period, hold, delay_s, lag_s, slow_s if slow else None), by)

    def terms_at_samples(self, speed: Array, period: float, hold: Hold, by: TimeOfResponse | None = None) -> Array:
        """Evaluate the terms at the samples themselves, where torque and force are asked for, or derivatives of them.

        A speed that stays until the next sample jumps there: taken is the middle of the jump. Parameters and shape as
        `terms_by_step`.
        """
        return _slope(_terms_at_samples(speed, period, hold, *self._moved(by)), by)

    def _moved(self, by: TimeOfResponse | None) -> list[complex]:
        times = {"delay_s": self.delay_s, "lag_s": self.lag_s, "slow_s": self.slow_s}
        return [time + 1j * _STEP if name == by else time for name, time in times.items()]


def _slope(terms: Numbers, by: TimeOfResponse | None) -> Array:
    return np.asarray(terms.real if by is None else terms.imag / _STEP, dtype=float)


def _terms_at_samples(speed: Array, period: float, hold: Hold, delay_s: Any, lag_s: Any, slow_s: Any) -> Numbers:
    mean, end, start = lagged(delayed(speed, delay_s / period, hold), lag_s / period, hold)
    jumps = hold == "previous" and np.real(lag_s) < _SHORTEST_S
    acting = 0.5 * (start + mean) if jumps else start
    slow = lagged(mean**2, slow_s / period, "previous").start
    change = (end - start) / period
    acceleration = 0.5 * (change + np.concatenate([change[:1], change[:-1]]))
    return np.hstack([np.ones((len(speed), 1)), acting, acting**2, acceleration, slow - acting**2])


def rotor_terms_by_step(speed: Array, period: float, hold: Hold, delay_s: Any, lag_s: Any, slow_s: Any) -> Numbers:
    """Evaluate the terms of the rotors over each step, shape (time, 1 + 4 rotors), of one stretch without pauses.

    1, means of the acting speeds, their squares, accelerations, and slow less present squared speeds. Delay, lag and
    slowness as in `RotorResponse`, or one that carries a derivative; None for no slowness, which is left 0.
    """
    mean, end, start = lagged(delayed(speed, delay_s / period, hold), lag_s / period, hold)
    squared = mean**2
    slow = squared if slow_s is None else lagged(squared, slow_s / period, "previous").mean
    return np.hstack([np.ones((len(speed), 1)), mean, squared, (end - start) / period, slow - squared])


def steady_terms(speed: Array) -> Array:
    """Evaluate the terms of rotors that keep their speeds, shape (vehicles, 1 + 4 rotors).

    Parameters
    ----------
    speed : array, shape (vehicles, rotor), rad/s
    """
    still = np.zeros_like(speed)
    return np.hstack([np.ones((len(speed), 1)), speed, speed**2, still, still])
