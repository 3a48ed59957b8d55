"""What to fly, and how, so that a log of an autopilot identifies the vehicle about an axis."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from cpfls_cli.autopilots.law import AXES
from cpfls_cli.result import about, result

_SECONDS = 20.0
_MODES = {
    "px4": ("Stabilized", "Acro"),
    "ardupilot": ("Stabilize", "Acro"),
    "betaflight": ("acro", "acro"),
    "crazyflie": ("attitude setpoints", "rate setpoints"),
}
"""Modes in which the stick is the setpoint of the attitude or of the rate: no position or height control moves it."""
_STICK, _BAND_HZ = {"roll": 0.4, "pitch": 0.4, "yaw": 0.6}, {"roll": (0.5, 4.0), "pitch": (0.5, 4.0), "yaw": (0.3, 2.0)}


@result
class Manoeuvre:
    """Moves of one stick that make a log identify the vehicle about that axis."""

    axis: str = about("roll, pitch or yaw")
    mode: str = about("of the autopilot, in which the stick is the setpoint")
    amplitude: float = about("share of the full stick, to both sides")
    lowest: float = about("slowest moves, there and back, in a second", unit="Hz")
    highest: float = about("fastest moves", unit="Hz")
    seconds: float = about("that moves take, slow ones first", unit="s")


def manoeuvres(autopilot: str, axes: Sequence[int]) -> Iterator[Manoeuvre]:
    """Say which sticks to move about axes, by an autopilot whose modes are known."""
    if autopilot in _MODES:
        for axis in axes:
            low, high = _BAND_HZ[AXES[axis]]
            yield Manoeuvre(
                axis=AXES[axis],
                mode=_MODES[autopilot][0],
                amplitude=_STICK[AXES[axis]],
                lowest=low,
                highest=high,
                seconds=_SECONDS,
            )
