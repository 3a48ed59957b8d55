"""What models predict of six fast flights of NeuroBEM, each held out once, compared with BEM+NN.

    python -m benchmarks.neurobem DATA [--unknown] [--held-out NAME]...
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

import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.shared.flight_csv import write_flight
from benchmarks.shared.found_vehicles import constants_unknown, learned
from benchmarks.shared.measure import program, table
from benchmarks.shared.neurobem_files import INERTIA, MASS, VEHICLE, Segment, segments
from benchmarks.shared.playback_scores import HORIZON, Runs, free_runs, nothing_moves, rate_stays, score
from cpfls_cli.arrays import Array
from cpfls_cli.errors import InputError
from cpfls_cli.playback.flight import PlaybackFlight
from cpfls_cli.playback.model import VehicleModel

COLUMNS = (
    *("held out", "model", "ω sum", "of rate stays", "R sum", "v sum", "p sum", "windows", "diverged"),
    *(f"RMSE M_{axis} N m" for axis in "xyz"),
    *(f"RMSE F_{axis} N" for axis in "xyz"),
)
UNKNOWN = ("",) * 6
PARTS = {"F_xy": [3, 4], "F_z": [5], "M_xy": [0, 1], "M_z": [2]}
"""Axes of the wrench that NeuroBEM prints one error of."""


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
    torque, force = np.split(model.wrench(velocity, motion.rate, centred), 2, axis=1)
    acceleration = (torque - np.cross(motion.rate, motion.rate @ body.inertia)) @ body.inverse
    stated = inertia * acceleration + np.cross(motion.rate, inertia * motion.rate)
    return np.hstack([stated, MASS / body.mass * force])


def main(data: Path, *, unknown: bool = False, held_out: list[str] | None = None, write: Path | None = None) -> None:
    try:
        found = segments(data)
    except InputError as error:
        sys.exit(f"{error}\nget them: git clone https://github.com/RCL-NUS/NeuroMHE")
    if write is not None:
        for each in found:
            write_flight(write, each.flight, each.wrench[:, 3:] / MASS)
        return
    stated, rows = constants_unknown(VEHICLE) if unknown else VEHICLE, []
    off: dict[str, list[Array]] = {}
    for test in [each for each in found if not held_out or each.flight.name in held_out]:
        training = [other.flight for other in found if other is not test]
        models = {"stated rigid body": VehicleModel(vehicle=VEHICLE), **learned(stated, training, baselines=False)}
        rows += rows_of(test, models)
        off.setdefault("nothing acts", []).append(test.wrench)
        off.setdefault("BEM+NN", []).append(test.hybrid - test.wrench)
        for name, model in models.items():
            kind = "vehicle found" if name.startswith("vehicle") else name
            off.setdefault(kind, []).append(wrench_of(model, test.flight) - test.wrench)
    name = "neurobem_unknown" if unknown else "neurobem"
    table(name, COLUMNS, rows)
    print("\nAll segments together, as NeuroBEM prints it: root mean square, N and N m.\n")
    columns = ("model", *(f"RMSE {part}" for part in PARTS))
    table(f"{name}_published", columns, [[each, *_by_part(errors)] for each, errors in off.items()])


def _by_part(errors: Sequence[Array]) -> Iterator[float]:
    flat = np.concatenate(errors)
    yield from (float(np.sqrt(np.mean(flat[:, axes] ** 2))) for axes in PARTS.values())


def rows_of(test: Segment, models: Mapping[str, VehicleModel]) -> list[list[object]]:
    """Play the baselines, BEM+NN and the models back on the segment that is held out."""
    flight = test.flight
    runs = {
        "nothing moves": (nothing_moves(flight), None),
        "rate stays": (rate_stays(flight), None),
        "BEM+NN along the path": (along_the_path(test), test.hybrid),
    }
    runs |= {name: (free_runs(model, flight), wrench_of(model, flight)) for name, model in models.items()}
    reference = float(score([runs["rate stays"][0]]).sums[3])
    return [row(name, test, own, reference, wrench) for name, (own, wrench) in runs.items()]


if __name__ == "__main__":
    program(main)
