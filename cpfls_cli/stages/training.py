"""Training data of a study: one flight, split, and where given reduced to a selection."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cpfls_cli.arrays import IntArray
from cpfls_cli.artifacts.formats import FLIGHT, SELECTION
from cpfls_cli.artifacts.hashing import file_sha256
from cpfls_cli.artifacts.records import Artifact
from cpfls_cli.config.study import Study
from cpfls_cli.errors import InputError
from cpfls_cli.identification.data import Split, TorqueData, split_flight
from cpfls_cli.regressor.motion import Motion
from cpfls_cli.stages.sources import read_good, read_with

MOTION = ("attitude", "attitude_rate", "attitude_acceleration")


@dataclass(frozen=True)
class TrainingData:
    """A flight and what of it trains.

    Attributes
    ----------
    flight : TorqueData
        The whole flight.
    split : Split
    learned : array of int, shape (samples,)
        Indices into the flight that parameters are learned from, ascending.
    """

    flight: TorqueData
    split: Split
    learned: IntArray


def flight_motion(flight: Artifact) -> Motion:
    """Take the motion of a flight.

    Parameters
    ----------
    flight : Artifact

    Returns
    -------
    Motion
    """
    attitude, rate, acceleration = (flight.array(name) for name in MOTION)
    return Motion(attitude, rate, acceleration)


def read_torque_data(path: Path) -> TorqueData:
    """Read a flight with its torque.

    Parameters
    ----------
    path : Path

    Returns
    -------
    TorqueData
    """
    flight = read_with(path, FLIGHT, "time", *MOTION, "torque")
    return TorqueData(flight.array("time"), flight_motion(flight), flight.array("torque"))


def read_training(path: Path, selection: Path | None, study: Study) -> TrainingData:
    """Read a flight and find what of it trains.

    Parameters
    ----------
    path : Path
    selection : Path, optional
        Made from this very flight.
    study : Study

    Returns
    -------
    TrainingData

    Raises
    ------
    InputError
        If the selection was made from another flight, or holds samples of the held-out part.
    """
    flight = read_torque_data(path)
    split = split_flight(flight.time, study.identification.training_share, study.identification.embargo_s)
    indices = np.arange(split.training.stop)
    if selection is not None:
        indices = _selected(path, selection, split.training.stop)
    return TrainingData(flight, split, indices)


def _selected(path: Path, selection: Path, training_end: int) -> IntArray:
    artifact = read_good(selection, SELECTION)
    source = artifact.header.inputs.get("flight")
    if source is None or source.sha256 != file_sha256(path):
        name = source.name if source else "an unknown flight"
        raise InputError(
            f"{selection}: was made from another flight ({name}, sha256 differs from {path}); "
            f"run `cpfls reduce` on {path}"
        )
    indices = np.unique(artifact.array("indices").astype(np.int64))
    if len(indices) == 0 or indices[0] < 0 or len(indices) != len(artifact.array("indices")):
        raise InputError(f"{selection}: indices is empty, negative or repeats itself; run `cpfls reduce` again")
    if indices[-1] >= training_end:
        raise InputError(
            f"{selection}: selects samples beyond the first {training_end} that train; "
            "identification.training_share has changed since: run `cpfls reduce` again"
        )
    return indices
