"""The numbers that the paper prints."""

from __future__ import annotations

import math
from dataclasses import dataclass

PRINTED_VEHICLE = ("9.81", "6", "4", "0.3", "121.5 × 10⁻⁶", "2.7 × 10⁻⁶", "0.6", "0.6", "1.2")
PRINTED_DURATION_S = "55"
"""Table 3 of the paper: gravity, mass, rotors, arm, thrust and drag factor, moments of inertia; the flight time."""


@dataclass(frozen=True)
class PrintedSet:
    """One column of Table 4 as printed, with its change against the full set."""

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


@dataclass(frozen=True)
class PrintedColumn:
    """One column of Table 5 as printed: the selected model, and mean and "variance" of ten runs."""

    system: str
    structure: str
    samples: int
    population: int
    generations: int
    mse: str
    max_error: str
    condition_number: str
    mse_of_runs: tuple[str, str]
    max_error_of_runs: tuple[str, str]
    condition_number_of_runs: tuple[str, str]


def _column(
    system: str, samples: int, size: tuple[int, int], selected: tuple[str, str, str], *runs: tuple[str, str]
) -> PrintedColumn:
    structure = "cpfls" if system == "cpFLS" else "fls"
    return PrintedColumn(system, structure, samples, *size, *selected, *runs)


_FULL_SEARCH = (500, 200)
TABLE_5 = (
    _column(
        "FLS [14]", 5487, _FULL_SEARCH, ("0.0007", "0.1531", "2707.1"),
        ("0.0008", "0.0001"), ("0.1845", "0.0324"), ("3815.5", "1701.2"),
    ),
    _column(
        "cpFLS", 5487, _FULL_SEARCH, ("0.0008", "0.1771", "5506.4"),
        ("0.0009", "0.0001"), ("0.1977", "0.0330"), ("7342.8", "8493.5"),
    ),
    _column(
        "cpFLS", 2743, _FULL_SEARCH, ("0.0009", "0.1786", "3399.4"),
        ("0.0010", "0.0001"), ("0.2912", "0.2568"), ("5651.6", "5259.3"),
    ),
    _column(
        "cpFLS", 1170, _FULL_SEARCH, ("0.0009", "0.1648", "4145.9"),
        ("0.0010", "0.0002"), ("0.2329", "0.0540"), ("6953.7", "5274.6"),
    ),
    _column(
        "cpFLS", 685, _FULL_SEARCH, ("0.0008", "0.1952", "4262.2"),
        ("0.0012", "0.0003"), ("0.2968", "0.1020"), ("5368.1", "2434.5"),
    ),
    _column(
        "cpFLS", 685, (75, 25), ("0.0008", "0.2080", "3032.0"),
        ("0.0011", "0.0002"), ("0.2408", "0.0382"), ("5202.9", "2039.3"),
    ),
)  # fmt: skip
"""Table 5 of the paper, column by column."""

RELATIVE_ERROR = "< 10 %"
"""What the text says of the relative error of all columns."""

SMALLEST_MAX_ERROR = 0.1531
"""In N m, of Table 5."""

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

PRINTED_PERIOD_S = 1.0
PRINTED_MOVE_S = 16.0
PRINTED_JERK_INTEGRAL = 8.0
"""Section 10: P, how long the base move takes, and the integral of its absolute jerk in m/s^2."""

PRINTED_RELATIVE_ERROR = 0.1
"""Sections 10 and 11: no relative torque error reaches it."""

LEAST_TORQUE = SMALLEST_MAX_ERROR / PRINTED_RELATIVE_ERROR
"""In N m; errors that are less than a tenth of the torques tell how large these are at least."""

TYPICAL_MSE, TYPICAL_MAX_ERROR = 1e-3, 0.2
"""Section 10: what the errors of a typical model stay below, (N m)^2 and N m."""

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
