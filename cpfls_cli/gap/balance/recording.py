"""A flight with its name, and the windows that flights share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from cpfls_cli.effects.signals import Signals
from cpfls_cli.errors import InputError
from cpfls_cli.gap.balance.windows import Windows, windows
from cpfls_cli.gap.settings import GapSettings

_FEWEST_WINDOWS = 16
_SAME_RATE = 1e-3
"""Relative difference of sampling periods that clocks of one logger have, and that no floor shows."""


@dataclass(frozen=True)
class Recording:
    """A flight and its name."""

    name: str
    signals: Signals


def common_windows(recordings: Sequence[Recording], settings: GapSettings) -> Windows:
    """Make the windows that all flights share.

    Raises
    ------
    InputError
        If a flight is too short or has another sampling period than the first.
    """
    period = recordings[0].signals.period
    for recording in recordings:
        other = recording.signals.period
        if abs(other - period) > _SAME_RATE * period:
            raise InputError(
                f"{recording.name}: sampled at {1 / other:.6g} Hz, {recordings[0].name} at {1 / period:.6g} Hz; set "
                "import.rate_hz to one rate for all flights"
            )
    shortest = min(recordings, key=lambda recording: len(recording.signals))
    if settings.window_s > len(shortest.signals) * period:
        raise InputError(
            f"gap.window_s = {settings.window_s:g}: longer than {shortest.name}, {len(shortest.signals) * period:.3g} s"
        )
    own = windows(period, settings.window_s, settings.overlap)
    for recording in recordings:
        if own.count(len(recording.signals)) < _FEWEST_WINDOWS:
            raise InputError(
                f"{recording.name}: {len(recording.signals) * period:.3g} s are too short; "
                f"{_FEWEST_WINDOWS} windows of gap.window_s = {settings.window_s:g} s are needed"
            )
    return own
