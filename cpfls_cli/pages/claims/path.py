"""The claim about the base move: its peaks, its time and its integral of jerk."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.integrate import trapezoid

from cpfls_cli.pages.claims.claim import Claim
from cpfls_cli.pages.printed import PRINTED_JERK_INTEGRAL, PRINTED_MOVE_S, PRINTED_PEAKS
from cpfls_cli.pages.source import Source
from cpfls_cli.report.numbers import number, percent

_TOLERANCE = 0.01
_PRINTED = PRINTED_PEAKS | {"time": PRINTED_MOVE_S, "integral of jerk": PRINTED_JERK_INTEGRAL}
_CLAIM = Claim(
    name="Base move",
    where="Section 10",
    words="maximum … pop = 2π … crackle = 2 … snap = 1 … jerk = 1 … acceleration = 2 … velocity = 8 … displacement = "
    "64[m], within time = 16[sec]. The integral of absolute jerk is 8",
    rule="The same nine numbers of the first move of the path. Pass: none differs by more than 1 %.",
    paper="0 %",
)


def move_claim(trajectories: Sequence[Source]) -> Claim:
    """Hold the first move of a path against the numbers that the paper prints."""
    along = [trajectory for trajectory in trajectories if not trajectory.record.held]
    if not along:
        return _CLAIM.lacks("a trajectory", "cpfls trajectory CONFIG -o trajectory.h5")
    # Where several paths are shown, the first one is that of training.
    found = move_numbers(along[0])
    off = {name: abs(found[name] / value - 1.0) for name, value in _PRINTED.items()}
    worst = max(off, key=lambda name: off[name])
    why = f"{along[0].label}, at its samples: {', '.join(f'{name} {number(v, 4)}' for name, v in found.items())}."
    return _CLAIM.decided(off[worst] <= _TOLERANCE, f"{percent(off[worst], 2)} ({worst})", why)


def move_numbers(trajectory: Source) -> dict[str, float]:
    """Measure the first move of a path: its peaks by derivative, its time and its integral of absolute jerk."""
    leg = trajectory.record.first_leg()
    peaks = {name: float(np.max(np.abs(leg.curves[name]))) for name in PRINTED_PEAKS}
    taken = float(leg.time[-1] - leg.time[0])
    return peaks | {"time": taken, "integral of jerk": float(trapezoid(np.abs(leg.curves["jerk"]), leg.time))}
