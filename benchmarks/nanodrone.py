"""What models predict of the nano-drone benchmark's test flights, compared with the models that are published.

    python -m benchmarks.nanodrone DATA [--unknown]
    python -m benchmarks.nanodrone DATA --history             a forecast that uses 0.5 s of the past, and without it
    python -m benchmarks.nanodrone DATA --repeats             moments of inertia by runs of each path, and of all
    python -m benchmarks.nanodrone DATA --write FOLDER        the prepared flights as CSV, and nothing else

DATA is a clone of idsia-robotics/nanodrone-sysid-benchmark, branch model_export (commit ac439db), or a folder with its
files side by side; shared/nanodrone_files.py prepares them. Needs pyarrow (extra `parquet`).

From every sample of the flights melon 1, 4 and 5, models are played back over 50 steps of 10 ms by the measured rotor
speeds of the sample before each step. Learned is on the flights square, multisine (which the benchmark calls chirp) and
random alone; with --unknown from mass and geometry, inertia and factors of the rotors being guesses.

"nothing moves" has to give 0.0796, 0.3588 and 0.8777 rad/s at h = 1, 10 and 50. The benchmark says 0.3596 and 0.8837,
since its script lays the flights end to end and holds the last windows of a flight against the beginning of the next.
Rows "their way" are counted like that, and are those to compare with the published rows.

With --history no structure is searched for: blocks of one that was found (`BLOCKS`) are fitted to the training flights,
and then the observer of their forecast; both are counted as above, and as `nonlinear_benchmarks` (NanoDrone) does: runs
from 50 samples after the begin of each flight on, errors averaged by flight. Its flights are prepared by others.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import groupby
from pathlib import Path

import numpy as np

from benchmarks.shared.flight_csv import write_flight
from benchmarks.shared.found_vehicles import constants_unknown, fitted_blocks, learned
from benchmarks.shared.measure import program, table
from benchmarks.shared.nanodrone_files import STATED, TEST, TRAINING, VEHICLE, flights
from benchmarks.shared.playback_scores import (
    SHOWN,
    SIGNALS,
    SYMBOLS,
    Runs,
    as_published,
    by_run,
    free_runs,
    nothing_moves,
    rate_stays,
    runs_with_past,
    score,
)
from cpfls_cli.errors import InputError
from cpfls_cli.playback.constants import find_constants
from cpfls_cli.playback.flight import PlaybackFlight
from cpfls_cli.playback.instruments import instruments
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.playback.vehicle import found_numbers

# Of position, velocity, attitude, body rate: h = 1, 10, 50, and the sum over h = 1 to 50. Printed by the notebook
# results/model_comparison.ipynb of the benchmark's branch main (commit 2d921b5) and in arXiv 2512.14450.
PUBLISHED = {
    "published: nothing moves": (
        0.0143, 0.143, 0.6797, 17.7878, 0.0329, 0.3182, 1.4749, 38.9241,
        0.0071, 0.0692, 0.3041, 8.2138, 0.0796, 0.3596, 0.8837, 29.0866,
    ),
    "published: physics": (
        0.0013, 0.0126, 0.1269, 2.3223, 0.008, 0.057, 0.5781, 10.6232,
        0.0011, 0.0205, 0.2544, 5.1013, 0.0796, 0.3596, 0.8837, 29.0866,
    ),
    "published: MLP": (
        0.0032, 0.0305, 0.1712, 4.0519, 0.0116, 0.089, 0.572, 12.5809,
        0.0022, 0.0331, 0.2268, 6.0591, 0.1138, 0.5949, 0.9005, 35.5735,
    ),
    "published: hybrid": (
        0.0016, 0.0166, 0.1119, 2.3625, 0.0092, 0.0613, 0.5556, 10.4033,
        0.0027, 0.0376, 0.2306, 6.1534, 0.0912, 0.488, 0.5979, 28.9873,
    ),
    "published: LSTM": (
        0.0079, 0.039, 0.2572, 5.9711, 0.0247, 0.1175, 0.7407, 16.7207,
        0.0066, 0.0372, 0.2325, 5.6525, 0.1021, 0.4292, 1.2407, 35.8353,
    ),
}  # fmt: skip
BLOCKS = (
    "inertia", "thrust_factor", "drag_factor", "lag", "slow_actuation", "linear_damping", "quadratic_damping",
    "rotor_plane_damping", "rotor_drag", "parasitic_drag", "inflow", "rotor_acceleration", "rotor_mismatch",
    "torque_bias", "remainder",
)  # fmt: skip
MOMENTS = ("inertia.Ixx", "inertia.Iyy")
PAST = 50
"""Samples of the past that a forecast may use: the initialisation window of nonlinear_benchmarks."""
COLUMNS = (
    "model",
    *(f"{SYMBOLS[signal]} {column}" for signal in SIGNALS for column in (*(f"h={h}" for h in SHOWN), "sum")),
    "windows",
    "diverged",
)


def rows_with_past(training: Sequence[PlaybackFlight], test: Sequence[PlaybackFlight]) -> list[list[object]]:
    """Play a forecast back on the test flights without and with the past, counted in all ways."""
    model, observer = fitted_blocks(VEHICLE, training, BLOCKS, PAST * test[0].motion.period)
    runs = baselines(test) | {
        "without the past": [free_runs(model, flight) for flight in test],
        "with 0.5 s of the past": [runs_with_past(model, observer, flight) for flight in test],
    }
    rows = [row for name, each in runs.items() for row in rows_of(name, test, each)]
    for name, each in runs.items():
        found = by_run(each, PAST)
        rows.append([f"{name}, by flight", *by_signal(found.mae).ravel(), found.windows, found.diverged])
    return rows


def baselines(test: Sequence[PlaybackFlight]) -> dict[str, list[Runs]]:
    return {
        "nothing moves": [nothing_moves(flight) for flight in test],
        "rate stays": [rate_stays(flight) for flight in test],
    }


def rows_of_repeats(training: Sequence[PlaybackFlight]) -> Iterator[list[object]]:
    """Find the moments of inertia in the runs of each path, and in all flights."""
    kinds = {kind: list(own) for kind, own in groupby(training, lambda flight: flight.name.split("_")[0])}
    for name, flown in (*kinds.items(), ("all", list(training))):
        found = find_constants(replace(VEHICLE, unknown=("inertia",)), flown, instruments(flown))
        if found is None:
            yield [name, len(flown), *["not identified"] * 5]
            continue
        moments = [number for number in found_numbers(found.fitted, found.spread) if number.name in MOMENTS]
        used, bands = found.used, [band for band in found.used.bands if band.used]
        values = [
            f"{1e5 * each.value:.2f} ({1e5 * each.low:.2f} to {1e5 * each.high:.2f})"
            if each.determined
            else f"{1e5 * each.value:.2f}, not determined"
            for each in moments
        ]
        explained = [f"{used.explained[axis]:.2f} ± {used.explained_error[axis]:.2f}" for axis in range(2)]
        yield [name, len(flown), *values, f"{bands[-1].low_hz:g} to {bands[0].high_hz:g}", *explained]


def rows_of(name: str, test: Sequence[PlaybackFlight], runs: Sequence[Runs]) -> list[list[object]]:
    """Count runs within flights, and as the published script does."""
    rows: list[list[object]] = []
    for title, counted in ((name, runs), (f"{name}, their way", as_published(test, runs))):
        found = score(counted)
        rows.append([title, *by_signal(found.mae).ravel(), found.windows, found.diverged])
    return rows


def by_signal(mae: np.ndarray) -> np.ndarray:
    """Pick the published horizons and the sum, shape (signal, 4)."""
    return np.column_stack([mae[np.array(SHOWN) - 1].T, mae.sum(axis=0)])


def main(
    data: Path, *, unknown: bool = False, history: bool = False, repeats: bool = False, write: Path | None = None
) -> None:
    try:
        training, test = flights(data, TRAINING), flights(data, TEST)
    except InputError as error:
        sys.exit(
            f"{error}\nget it: git clone -b model_export https://github.com/idsia-robotics/nanodrone-sysid-benchmark"
        )
    if write is not None:
        for flight in (*training, *test):
            write_flight(write, flight)
    elif repeats:
        columns = "path | flights | Ixx, 1e-5 kg m² | Iyy, 1e-5 kg m² | band, Hz | roll explained | pitch explained"
        table("nanodrone_repeats", columns, list(rows_of_repeats(training)))
    elif history:
        table("nanodrone_history", COLUMNS, rows_with_past(training, test), digits=4)
    else:
        rows = [[name, *values, 19347, ""] for name, values in PUBLISHED.items()]
        found = learned(constants_unknown(VEHICLE) if unknown else VEHICLE, training)
        models = {"stated rigid body": VehicleModel(vehicle=STATED), **found}
        played = {name: [free_runs(model, flight) for flight in test] for name, model in models.items()}
        for name, runs in (baselines(test) | played).items():
            rows += rows_of(name, test, runs)
        table("nanodrone_unknown" if unknown else "nanodrone", COLUMNS, rows, digits=4)


if __name__ == "__main__":
    program(main)
