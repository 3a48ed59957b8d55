"""Flights in gusts under an autopilot: bounds by regression both ways, and how often the truth lies between them.

    python benchmarks/closed_loop.py [DRAWS]

Two vehicles of 45 g and 1.5 kg, three levels of gusts, three bandwidths of the attitude loop; two flights of 30 s a
draw, noise of gyroscope and rotor speeds among it. The model is the true one, so 1 has to lie between the bounds.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.shared.measure import pin_threads, table

pin_threads()

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.playback.loop import loop_bounds
from cpfls_cli.playback.model import VehicleModel
from tests.builders.gusty_flights import CALM, GUSTS, LARGE, SMALL, STORM, Flight, gusty_flights

DRAWS = 20
VEHICLES = {"45 g": SMALL, "1.5 kg": LARGE}
BANDWIDTHS = (6.0, 12.0, 25.0)
ROUNDING = 0.005
"""Of the integration of the flights, whose steps are 2 ms."""


def main(draws: int) -> None:
    sets = [(name, gusts, loop) for name in VEHICLES for gusts in (CALM, GUSTS, STORM) for loop in BANDWIDTHS]
    pairs = [(draw, path) for draw in range(draws) for path in (2 * draw, 2 * draw + 1)]
    # All at once: a step of many flights takes hardly longer than one of a few.
    flown = gusty_flights(
        [Flight(VEHICLES[name], gusts, path, draw, loop) for name, gusts, loop in sets for draw, path in pairs]
    )
    rows = []
    for name, gusts, loop in sets:
        model = VehicleModel(vehicle=VEHICLES[name].vehicle)
        found = [loop_bounds(model, [next(flown), next(flown)]) for _ in range(draws)]
        low, high = (np.array([getattr(each, end) for each in found]) for end in ("low", "high"))
        seen, inside = np.isfinite(low), (low <= 1 + ROUNDING) & (high >= 1 - ROUNDING)
        explained = np.median([each.explained[:2] for each in found], axis=0)
        rows.append(
            [
                name,
                ", ".join(f"{gust:g}" for gust in gusts),
                f"{loop:g}",
                *(_ends(low[:, axis], high[:, axis]) for axis in range(3)),
                f"{explained[0]:.2f}, {explained[1]:.2f}",
                f"{int(inside[seen].sum())} of {int(seen.sum())}",
                f"{sum(each.shows_loop for each in found)} of {draws}",
            ]
        )
    header = ["vehicle", "gusts, rad/s²", "loop, rad/s", "Ixx", "Iyy", "Izz", "explained", "truth inside", "loop shown"]
    table("closed_loop", header, rows)


def _ends(low: Array, high: Array) -> str:
    """Give the medians of bounds; a dash where no draw shows the axis."""
    seen = np.isfinite(low)
    return f"{np.median(low[seen]):.2f} to {np.median(high[seen]):.2f}" if seen.any() else "—"


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else DRAWS)
