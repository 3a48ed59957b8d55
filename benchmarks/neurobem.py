"""Print what models predict of six fast flights of NeuroBEM, each held out once, beside BEM+NN.

    python -m benchmarks.neurobem DATA [--unknown] [--held-out NAME ...]
    python -m benchmarks.neurobem DATA --write FOLDER         the segments as CSV, and nothing else

DATA is a clone of RCL-NUS/NeuroMHE (commit 64e184c), or any folder with its files bemnn*.mat in it or below it. They
hold test segments of NeuroBEM (Bauersfeld et al. 2021) with the torques and forces that its model BEM+NN gives.

Every fourth sample is taken, 100 Hz. From each sample models are played back over 50 steps by the measured rotor
speeds; sums are over h = 1 to 50 of the mean error. Learned is on the five other segments.

BEM+NN is no simulation: it is given the measured state at every sample, history of rates included. Its row turns the
body by its torques along the measured path. Torque and force are held against what the motion takes, by the logged
accelerations and the stated mass and inertia; a model with another inertia enters with the acceleration that it gives.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.shared.flight_csv import write_flight
from benchmarks.shared.found_vehicles import constants_unknown, learned
from benchmarks.shared.measure import table
from benchmarks.shared.neurobem_files import INERTIA, MASS, VEHICLE, Segment, segments
from benchmarks.shared.playback_scores import HORIZON, Runs, free_runs, nothing_moves, rate_stays, score
from cpfls_cli.arrays import Array
from cpfls_cli.errors import InputError
from cpfls_cli.playback.flight import PlaybackFlight
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.vehicle.settings import VehicleSettings

COLUMNS = (
    *("held out", "model", "ω sum", "of rate stays", "R sum", "v sum", "p sum", "windows", "diverged"),
    *(f"RMSE M_{axis} N m" for axis in "xyz"),
    *(f"RMSE F_{axis} N" for axis in "xyz"),
)
UNKNOWN = ("",) * 6


def models(training: Sequence[PlaybackFlight], stated: VehicleSettings) -> Mapping[str, VehicleModel]:
    """Give the models that are played back, by name; those that learn see the training segments alone."""
    return {"stated rigid body": VehicleModel(vehicle=VEHICLE), **learned(stated, training, baselines=False)}


def our_rows(
    training: Sequence[PlaybackFlight], test: Segment, stated: VehicleSettings = VEHICLE
) -> list[list[object]]:
    """Play the baselines, BEM+NN and the models back on the segment that is held out."""
    flight = test.flight
    stays = rate_stays(flight)
    reference = float(score([stays]).sums[3])
    rows = [
        row("nothing moves", test, nothing_moves(flight), reference, None),
        row("rate stays", test, stays, reference, None),
        row("BEM+NN along the path", test, along_the_path(test), reference, test.hybrid),
    ]
    for name, model in models(training, stated).items():
        rows.append(row(name, test, free_runs(model, flight), reference, wrench_of(model, flight)))
    return rows


def row(name: str, test: Segment, runs: Runs, reference: float, wrench: Array | None) -> list[object]:
    """Arrange the sums of the errors, and how far torque and force are off."""
    found = score([runs])
    position, velocity, attitude, rate = ("" if np.isnan(value) else float(value) for value in found.sums)
    assert isinstance(rate, float)
    off = UNKNOWN if wrench is None else np.sqrt(np.mean((wrench - test.wrench) ** 2, axis=0)).tolist()
    sums = (rate, rate / reference, attitude, velocity, position, found.windows, found.diverged)
    return [test.flight.name, name, *sums, *off]


def along_the_path(test: Segment, horizon: int = HORIZON) -> Runs:
    """Turn the body from every sample on by given torques, with the rates of the measured path in the equation."""
    motion, inertia = test.flight.motion, np.array(INERTIA)
    given = (test.hybrid[:, :3] - np.cross(motion.rate, inertia * motion.rate)) / inertia
    starts, period = test.flight.starts(horizon, 1), motion.period
    errors = np.full((len(starts), horizon, 4, 3), np.nan)
    rate, rotation = motion.rate[starts].copy(), Rotation.from_matrix(motion.rotation[starts])
    for step in range(horizon):
        at = starts + step + 1
        change = 0.5 * period * (given[at - 1] + given[at])
        rotation = rotation * Rotation.from_rotvec(period * (rate + 0.5 * change))
        rate += change
        errors[:, step, 2] = (Rotation.from_matrix(motion.rotation[at]).inv() * rotation).as_rotvec()
        errors[:, step, 3] = rate - motion.rate[at]
    return Runs(errors)


def wrench_of(model: VehicleModel, flight: PlaybackFlight) -> Array:
    """Compute torque and force at the samples of a flight, shape (time, 6), scaled to the stated mass and inertia."""
    motion, inertia, body = flight.motion, np.array(INERTIA), model.body
    velocity = np.einsum("tji,tj->ti", motion.rotation, motion.velocity)
    rotor = model.response.terms_by_step(flight.speed, motion.period, flight.hold)
    # Terms are means over the step that begins at a sample; the mean with the step before lies at the sample.
    centred = 0.5 * (rotor + np.concatenate([rotor[:1], rotor[:-1]]))
    torque, force = np.split(model.table.wrench(velocity, motion.rate, centred), 2, axis=1)
    acceleration = (torque - np.cross(motion.rate, motion.rate @ body.inertia)) @ body.inverse
    stated = inertia * acceleration + np.cross(motion.rate, inertia * motion.rate)
    return np.hstack([stated, MASS / body.mass * force])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path, metavar="DATA", help="folder of the segments")
    parser.add_argument("--unknown", action="store_true", help="learn from mass and geometry alone")
    parser.add_argument("--held-out", nargs="*", metavar="NAME", help="hold out these segments alone")
    parser.add_argument("--write", type=Path, metavar="FOLDER", help="write the segments as CSV, and stop")
    given = parser.parse_args()
    stated = constants_unknown(VEHICLE) if given.unknown else VEHICLE
    try:
        found = segments(given.data)
    except InputError as error:
        sys.exit(f"{error}\nget them: git clone https://github.com/RCL-NUS/NeuroMHE")
    if given.write is not None:
        for each in found:
            write_flight(given.write, each.flight, each.wrench[:, 3:] / MASS)
        return
    rows = []
    for test in found if given.held_out is None else [each for each in found if each.flight.name in given.held_out]:
        rows += our_rows([other.flight for other in found if other is not test], test, stated)
    table("neurobem_unknown" if given.unknown else "neurobem", COLUMNS, rows)


if __name__ == "__main__":
    main()
