"""What the paper prints in numbers outside Table 5."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class PrintedSet:
    """One column of Table 4 as printed.

    Attributes
    ----------
    change : float
        Against the full set.
    """

    samples: int
    condition_number: int
    change: float


TABLE_4 = (
    PrintedSet(5487, 56254, 0.0),
    PrintedSet(2743, 56805, 0.0098),
    PrintedSet(1170, 59771, 0.0625),
    PrintedSet(685, 68934, 0.2254),
)
"""Table 4 of the paper; the full set first."""

PRINTED_PEAKS = {
    "pop": 2.0 * math.pi,
    "crackle": 2.0,
    "snap": 1.0,
    "jerk": 1.0,
    "acceleration": 2.0,
    "velocity": 8.0,
    "displacement": 64.0,
}
"""Section 10: largest derivatives of the base move with P = 1 s, by name."""

PRINTED_MOVE_S = 16.0
PRINTED_JERK_INTEGRAL = 8.0
"""Section 10: how long the base move takes, and the integral of its absolute jerk in m/s^2."""

PRINTED_RELATIVE_ERROR = 0.1
"""Sections 10 and 11: no relative torque error reaches it."""

PRINTED_CONTRIBUTION, PRINTED_SHARE = 0.8, 0.2
"""Section 10: what the chosen samples keep of the condition, and what share of all samples they are at most."""

PRINTED_SEESAW = {0.0: 0.0, 0.5: 1.0, 1.0: 0.0, 1.5: -1.0}
"""Equation (11): the seesaw by angle, in half turns."""

PRINTED_WEIGHTS = (
    3157, 31387, 59087, 34526, 61856, 23999, 31983, 5100, 21985, 53525, 13592, 15164,
    41416, 52669, 17091, 8246, 27195, 36846, 42384, 27934, 32215, 55957, 57320, 24610,
)  # fmt: skip
"""Section 10: the selected chromosome, six partitions of four weights."""

PRINTED_BREAKPOINTS = (
    0.024633, 0.26954, 0.7306, 0.50315, 0.69836, 0.95851, 0.21085, 0.72421, 0.85457,
    0.34681, 0.78784, 0.93095, 0.20241, 0.47664, 0.79209, 0.18939, 0.51835, 0.85532,
)  # fmt: skip
"""Section 10: the breakpoints that these weights stand for, three of each partition."""
