"""How often `cpfls trend` finds a change where there is none, and where and how often it finds one of each size.

Numbers are drawn, not flown: those of the paper's quadrotor from day to day (loads, vibration and delays, ten numbers),
normal, of the scatter that is usual or half, one and a half or twice that, which the program does not know. A row
is said to have changed at p = 0.01, against chance for as many rows (95 %). A step is of one number,
from the flight on at two thirds of a row, in its usual deviations.
"""

from __future__ import annotations

import numpy as np

from benchmarks.shared.measure import program, table
from cpfls_cli.arrays import Array
from cpfls_cli.changes.judge import FALSE_ALARM
from cpfls_cli.changes.reference import Reference
from cpfls_cli.changes.trend import Row, change_points
from tests.builders.drawn_numbers import DEVIATION, NAMES, QUAD, flights

SCATTERS = (0.5, 1.0, 1.5, 2.0)
FLIGHTS = (10, 30)
STEPS = (2.0, 3.0, 4.0, 6.0)
MOVED = NAMES.index("delay roll")


def found(count: int, rng: np.random.Generator, scatter: float = 1.0, step: float = 0.0) -> tuple[float, list[int]]:
    """Search a row of flights, a number of which moves at two thirds of it."""
    change: Array = step * DEVIATION * (np.arange(len(NAMES)) == MOVED)
    row = flights(count, rng, change, since=2 * count // 3, scatter=scatter)
    return change_points(Row.of(row, Reference.of(row[: count // 2], NAMES, QUAD), QUAD), rng)


def main(rows: int = 100, seed: int = 2029) -> None:
    rng = np.random.default_rng(seed)
    low, high = np.quantile(rng.binomial(rows, FALSE_ALARM, 100_000) / rows, [0.025, 0.975])
    alarms = []
    for count in FLIGHTS:
        each = ([found(count, rng, own)[0] <= FALSE_ALARM for _ in range(rows)] for own in SCATTERS)
        alarms.append([str(count), *(f"{np.mean(own):.2%}" for own in each)])
    print(f"False alarms of {rows} rows each; by chance {low:.2%} to {high:.2%}.\n")
    table("false alarms", ["flights", *(f"scatter {own:g}" for own in SCATTERS)], alarms)
    steps = []
    for count in FLIGHTS:
        cells = [str(count)]
        for step in STEPS:
            starts = [found(count, rng, step=step)[1] for _ in range(rows // 2)]
            right = np.mean([each == [2 * count // 3] for each in starts])
            cells.append(f"{np.mean([bool(each) for each in starts]):.0%}, {right:.0%}")
        steps.append(cells)
    print(f"\nFound, and found at its flight and nowhere else, of {rows // 2} rows each.\n")
    table("steps", ["flights", *(f"{step:g} deviations" for step in STEPS)], steps)


if __name__ == "__main__":
    program(main)
