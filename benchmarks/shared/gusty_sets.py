"""Sets of flights in gusts under an autopilot, flown as a kind of instrument needs them; not flown by the package."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import islice

import numpy as np

from benchmarks.shared.measure import count, mean_and_ends
from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.blocks import half_width
from cpfls_cli.playback.constants import find_constants
from cpfls_cli.playback.flight import PlaybackFlight
from cpfls_cli.playback.instruments import Instruments, Repeats, instruments
from cpfls_cli.playback.parameters import LOG_INERTIA
from cpfls_cli.vehicle.settings import VehicleSettings
from tests.builders.gusty_flights import CALM, GUSTS, LARGE, SMALL, STORM, Flight, gusty_flights

VEHICLES = {"45 g": SMALL, "1.5 kg": LARGE}
LEVELS = (CALM, GUSTS, STORM)
KINDS = ("repeats", "setpoints", "past")
"""Paths flown again and again; paths flown once with their position setpoint; paths flown once and no setpoint."""
RUNS, REPEATED, PATHS = 4, 2, 3
MOMENTS = "Ixx | Iyy | interval ±, % | holds the truth | determined"


def words(gusts: Sequence[float]) -> str:
    """Write the sizes of gusts about the axes, rad/s^2."""
    return ", ".join(f"{size:g}" for size in gusts)


def flown_sets(
    flown: Flight, kind: str, draws: int, seconds: float, repeated: int = REPEATED
) -> Iterator[list[PlaybackFlight]]:
    """Fly another set of paths and gusts for each draw; logs of one kind alone hold the setpoints."""
    paths, runs = (repeated, RUNS) if kind == "repeats" else (PATHS, 1)
    asked = [
        flown._replace(path=paths * draw + path, draw=runs * draw + run)
        for draw in range(draws)
        for path in range(paths)
        for run in range(runs)
    ]
    flights = gusty_flights(asked, seconds)
    for _ in range(draws):
        own = list(islice(flights, paths * runs))
        yield own if kind == "setpoints" else [replace(flight, setpoints={}) for flight in own]


def instruments_of(kind: str, flights: Sequence[PlaybackFlight]) -> Instruments:
    """Give the instruments that the flights of a kind have."""
    given = instruments(list(flights))
    # Paths of the same frequencies may come near each other, which is no repeat that was asked for.
    return given if kind == "repeats" else replace(given, repeats=Repeats(tuple({} for _ in given.runs), {}))


def found_moments(vehicle: VehicleSettings, kind: str, flights: list[PlaybackFlight]) -> tuple[Array, Array, BoolArray]:
    """Find moments of inertia about roll and pitch, from starts twice too large.

    Returns
    -------
    ratio, half : array, shape (2,)
        Moment over the true one, and half width of the interval of its logarithm.
    determined : array of bool, shape (2,)
    """
    moments = tuple(2 * moment for moment in vehicle.inertia_kg_m2[:3])
    begun = replace(vehicle, inertia_kg_m2=(*moments, 0.0, 0.0, 0.0), unknown=("inertia",))
    given = instruments_of(kind, flights)
    found = find_constants(begun, flights, given, past=kind == "past")
    if found is None:
        return np.ones(2), np.ones(2), np.zeros(2, dtype=bool)
    places = [found.fitted.free.index[name] for name in LOG_INERTIA[:2]]
    error = np.sqrt(np.diag(found.spread.covariance))[places]
    ratio = 2 * np.exp(found.fitted.values[places])
    return ratio, half_width(error, found.spread.blocks), found.spread.determined[places]


def cells_of_moments(vehicle: VehicleSettings, kind: str, sets: Sequence[list[PlaybackFlight]]) -> list[str]:
    """Summarise the moments of several sets in the columns of `MOMENTS`."""
    found = [found_moments(vehicle, kind, flights) for flights in sets]
    ratio, half, identified = (np.array([each[part] for each in found]) for part in range(3))
    return [
        *(mean_and_ends(ratio[identified[:, axis], axis]) for axis in range(2)),
        f"{100 * np.median(half[identified]):.1f}" if identified.any() else "—",
        count((np.abs(np.log(ratio)) <= half)[identified]),
        count(identified),
    ]
