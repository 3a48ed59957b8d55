"""Constants in gusts by instruments: moments of inertia over the true ones, and how often their intervals hold them.

    python benchmarks/instruments.py [DRAWS]

Two vehicles of 45 g and 1.5 kg in three levels of gusts, on a path with sines of up to 5 Hz, 40 s long: flown four
times without setpoints in the log, or three paths once with the position that was asked for. The search begins at
moments twice too large. Nothing of the package flies them.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.shared.measure import pin_threads, table

pin_threads()

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.blocks import half_width
from cpfls_cli.playback.constants import find_constants
from cpfls_cli.playback.flight import PlaybackFlight
from cpfls_cli.playback.instruments import Repeats, instruments
from cpfls_cli.playback.parameters import LOG_INERTIA
from tests.builders.gusty_flights import CALM, GUSTS, LARGE, SMALL, STORM, Flight, Truth, gusty_flights

DRAWS = 6
VEHICLES = {"45 g": SMALL, "1.5 kg": LARGE}
RUNS, PATHS, REACH_HZ, SECONDS = 4, 3, 5.0, 40.0


def main(draws: int) -> None:
    rows = []
    for name, truth in VEHICLES.items():
        for gusts in (CALM, GUSTS, STORM):
            for kind in ("repeats", "setpoints"):
                found = [_found(truth, kind, _flown(truth, gusts, kind, draw)) for draw in range(draws)]
                ratio, half, told = (np.array([each[part] for each in found]) for part in range(3))
                inside = np.abs(np.log(ratio)) <= half
                rows.append(
                    [
                        name,
                        ", ".join(f"{gust:g}" for gust in gusts),
                        kind,
                        *(_ends(ratio[told[:, axis], axis]) for axis in range(2)),
                        f"{100 * np.median(half[told]):.1f}" if told.any() else "—",
                        f"{int(inside[told].sum())} of {int(told.sum())}",
                        f"{int(told.sum())} of {told.size}",
                    ]
                )
    header = ["vehicle", "gusts, rad/s²", "instrument", "Ixx", "Iyy", "interval ±, %", "holds the truth", "determined"]
    table("instruments", header, rows)


def _flown(truth: Truth, gusts: tuple[float, float, float], kind: str, draw: int) -> list[PlaybackFlight]:
    """Fly one path again and again, or several once."""
    if kind == "repeats":
        asked = [Flight(truth, gusts, draw, RUNS * draw + run, reach=REACH_HZ) for run in range(RUNS)]
        return [replace(flight, setpoints={}) for flight in gusty_flights(asked, SECONDS)]
    asked = [Flight(truth, gusts, PATHS * draw + path, draw, reach=REACH_HZ) for path in range(PATHS)]
    return list(gusty_flights(asked, SECONDS))


def _found(truth: Truth, kind: str, flights: list[PlaybackFlight]) -> tuple[Array, Array, BoolArray]:
    """Give moments about roll and pitch over the true ones, half of their intervals, and whether they are told."""
    moments = tuple(2 * moment for moment in truth.inertia)
    begun = replace(truth.vehicle, inertia_kg_m2=(*moments, 0.0, 0.0, 0.0), unknown=("inertia",))
    given = instruments(flights)
    if kind == "setpoints":
        # Paths of the same frequencies may come near each other; here only what was asked for is to tell.
        given = replace(given, repeats=Repeats(tuple({} for _ in given.runs), {}))
    found = find_constants(begun, flights, given)
    if found is None:
        return np.ones(2), np.ones(2), np.zeros(2, dtype=bool)
    places = [found.fitted.free.index[name] for name in LOG_INERTIA[:2]]
    error = np.sqrt(np.diag(found.spread.covariance))[places]
    told = found.spread.determined[places]
    return 2 * np.exp(found.fitted.values[places]), half_width(error, found.spread.blocks), told


def _ends(values: Array) -> str:
    """Give the mean and the ends over the draws; a dash where none tells it."""
    return f"{values.mean():.3f} ({values.min():.2f} to {values.max():.2f})" if len(values) else "—"


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else DRAWS)
