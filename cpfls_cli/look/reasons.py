"""Why effectiveness or a loop is not known: short facts, all in one place."""

from __future__ import annotations

from cpfls_cli.arrays import BoolArray, runs

NO_COMMAND = "what acts about the axis is not logged"
NO_SETPOINT = "no rate setpoint is logged"
NO_STICK = "no stick is logged that moves, so that setpoints may come from the state"
AT_REST = "the stick rests, so that setpoints may come from the state"
TOO_SLOW = "logged too slowly"
NOT_MOVED = "the instrument moves the vehicle too little"
NO_MODEL = "no model of a multirotor fits"
TOO_WIDE = "the interval is too wide"
_WINDOWS = 9.5
"""Length of a whole flight that has 18 windows overlapping by half: six blocks of three."""


def needed_s(window_s: float) -> float:
    """Give the usable seconds that windows of a length need."""
    return _WINDOWS * window_s


def too_little(usable: BoolArray, rate_hz: float, window_s: float) -> str:
    """Say how much of a log is usable in pieces that hold a window, and how much is needed; or that it moves little."""
    pieces = [(after - first) / rate_hz for first, after in runs(usable)]
    whole, needed = sum(piece for piece in pieces if piece >= window_s), needed_s(window_s)
    if whole >= needed:
        return NOT_MOVED
    return f"{whole:.0f} s are usable in pieces of at least {window_s:.0f} s; {needed:.0f} s are needed"
