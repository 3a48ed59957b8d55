"""The mission to fly where flights show the loop, in gusts: moments of inertia by regression, and by its runs.

    python benchmarks/mission_in_gusts.py [DRAWS]

`cpfls trajectory CONFIG --hover 30 --excite roll,pitch --repeat 4`, flown by the autopilot of
`benchmarks/closed_loop.py` with two vehicles in three levels of gusts. Everything but the inertia is known; factors of
what is found over the true one, in the band of the signal, least to largest of all draws.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.shared.measure import pin_threads, table

pin_threads()

from cpfls_cli.arrays import Array
from tests.builders.gusty_flights import CALM, GUSTS, LARGE, SMALL, STORM, Flight
from tests.builders.missions_in_gusts import found, mission_of

DRAWS = 6
VEHICLES = {"45 g": SMALL, "1.5 kg": LARGE}


def main(draws: int) -> None:
    rows = []
    for name, truth in VEHICLES.items():
        mission = mission_of(truth)
        levels = (CALM, GUSTS, STORM)
        all_at_once = found(mission, [Flight(truth, gusts, draw=draw) for gusts in levels for draw in range(draws)])
        for gusts, factors in zip(levels, all_at_once.reshape(len(levels), draws, 3, 2), strict=True):
            ends = [_ends(factors[:, way, axis]) for way in range(3) for axis in range(2)]
            rows.append([name, ", ".join(f"{gust:g}" for gust in gusts), *ends])
    ways = ("rotation on torque", "torque on rotation", "other runs")
    header = ["vehicle", "gusts, rad/s²", *(f"{way}: {axis}" for way in ways for axis in ("Ixx", "Iyy"))]
    table("mission_in_gusts", header, rows)


def _ends(values: Array) -> str:
    return f"{values.min():.2f} to {values.max():.2f}"


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else DRAWS)
