"""Constants in gusts by instruments: moments of inertia over the true ones, and how often their intervals hold them.

    python benchmarks/instruments.py [DRAWS]

Two vehicles of 45 g and 1.5 kg in three levels of gusts, 40 s a flight: two paths flown four times each without
setpoints in the log, or three paths once, with the position that was asked for or without, so that what was before has
to tell; paths of 0.8 Hz at most, and with sines of up to 5 Hz. Gusts fade by one memory, by three of 0.15, 1 and 5
times that (mixed), or have a rate (smooth). The search begins at moments twice too large. Nothing of the package flies
them.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.shared.measure import pin_threads, table

pin_threads()

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.blocks import half_width
from cpfls_cli.playback.constants import constants_of_past, find_constants
from cpfls_cli.playback.flight import PlaybackFlight
from cpfls_cli.playback.instruments import Repeats, instruments
from cpfls_cli.playback.parameters import LOG_INERTIA
from cpfls_cli.vehicle.settings import VehicleSettings
from tests.builders.gusty_flights import CALM, GUSTS, LARGE, MIXED, SMALL, STORM, Flight, Truth, gusty_flights

DRAWS = 20
VEHICLES = {"45 g": SMALL, "1.5 kg": LARGE}
RUNS, REPEATED, PATHS, SECONDS = 4, 2, 3, 40.0
REACHES_HZ = (0.0, 5.0)
KINDS = ("repeats", "setpoints", "past")
SMOOTH_S = 0.1
"""Time constant that takes the edge off gusts, so that they have a rate."""


def main(draws: int) -> None:
    rows = []
    for name, truth in VEHICLES.items():
        for flown in _asked(truth):
            for kind in KINDS:
                found = [found_moments(truth.vehicle, kind, flights) for flights in _sets(flown, kind, draws)]
                gusts = ", ".join(f"{gust:g}" for gust in flown.gusts) + _process(flown)
                rows.append([name, gusts, f"{flown.reach or 0.8:g}", kind])
                rows[-1] += _cells(*(np.array([each[part] for each in found]) for part in range(3)))
                print(" | ".join(rows[-1]), file=sys.stderr, flush=True)
    header = ["vehicle", "gusts, rad/s²", "path up to, Hz", "instrument", "Ixx", "Iyy", "interval ±, %"]
    table("instruments", [*header, "holds the truth", "determined"], rows)


def _cells(ratio: Array, half: Array, told: BoolArray) -> list[str]:
    inside = np.abs(np.log(ratio)) <= half
    return [
        *(ends(ratio[told[:, axis], axis]) for axis in range(2)),
        f"{100 * np.median(half[told]):.1f}" if told.any() else "—",
        f"{int(inside[told].sum())} of {int(told.sum())}",
        f"{int(told.sum())} of {told.size}",
    ]


def _asked(truth: Truth) -> Iterator[Flight]:
    """List the gusts and paths that a vehicle flies in; gusts of several memories, and smooth ones, in one size."""
    for gusts in (CALM, GUSTS, STORM):
        yield from (Flight(truth, gusts, reach=reach) for reach in REACHES_HZ)
    for reach in REACHES_HZ:
        yield Flight(truth, GUSTS, reach=reach, memories=MIXED)
        yield Flight(truth, GUSTS, reach=reach, smooth_s=SMOOTH_S)


def _process(flown: Flight) -> str:
    return ", mixed" if flown.memories == MIXED else ", smooth" if flown.smooth_s else ""


def _sets(flown: Flight, kind: str, draws: int) -> Iterator[list[PlaybackFlight]]:
    """Fly paths again and again, or several once; another set of paths and gusts for each draw."""
    paths, runs = (REPEATED, RUNS) if kind == "repeats" else (PATHS, 1)
    asked = [
        flown._replace(path=paths * draw + path, draw=runs * draw + run)
        for draw in range(draws)
        for path in range(paths)
        for run in range(runs)
    ]
    flights = gusty_flights(asked, SECONDS)
    for _ in range(draws):
        yield list(islice(flights, paths * runs))


def found_moments(vehicle: VehicleSettings, kind: str, flights: list[PlaybackFlight]) -> tuple[Array, Array, BoolArray]:
    """Give moments about roll and pitch over the true ones, half of their intervals, and whether they are told."""
    moments = tuple(2 * moment for moment in vehicle.inertia_kg_m2[:3])
    begun = replace(vehicle, inertia_kg_m2=(*moments, 0.0, 0.0, 0.0), unknown=("inertia",))
    if kind != "setpoints":
        flights = [replace(flight, setpoints={}) for flight in flights]
    given = instruments(flights)
    if kind != "repeats":
        # Paths of the same frequencies may come near each other; here they are not to tell.
        given = replace(given, repeats=Repeats(tuple({} for _ in given.runs), {}))
    found = (constants_of_past if kind == "past" else find_constants)(begun, flights, given)
    if found is None:
        return np.ones(2), np.ones(2), np.zeros(2, dtype=bool)
    places = [found.fitted.free.index[name] for name in LOG_INERTIA[:2]]
    error = np.sqrt(np.diag(found.spread.covariance))[places]
    told = found.spread.determined[places]
    return 2 * np.exp(found.fitted.values[places]), half_width(error, found.spread.blocks), told


def ends(values: Array) -> str:
    """Give the mean and the ends over the draws; a dash where none tells it."""
    return f"{values.mean():.3f} ({values.min():.2f} to {values.max():.2f})" if len(values) else "—"


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else DRAWS)
