"""The state of a search as datasets, and back, bit by bit."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from cpfls_cli.arrays import IntArray
from cpfls_cli.artifacts.formats import CHECKPOINT
from cpfls_cli.artifacts.records import Artifact
from cpfls_cli.evolution.archive import Archive, Evaluation
from cpfls_cli.evolution.history import History
from cpfls_cli.evolution.state import EvolutionState

_SEAL = "sha256"


def state_data(state: EvolutionState) -> dict[str, Any]:
    """Arrange the state of a search as the datasets of a checkpoint.

    Parameters
    ----------
    state : EvolutionState

    Returns
    -------
    dict of str to array
    """
    results = state.archive.results
    data = {
        "generation": state.index,
        "generator": np.array(json.dumps(state.rng.bit_generator.state)),
        "population/genes": state.genes.astype(np.uint16),
        "population/objectives": state.objectives,
        "population/subpopulation": state.subpopulations,
        "archive/submitted": state.archive.submitted.astype(np.uint16),
        "archive/genes": results.genes.astype(np.uint16),
        "archive/objectives": results.objectives,
        **{f"history/{name}": values for name, values in vars(state.history).items()},
    }
    return {**data, _SEAL: np.array(_seal(data))}


def state_of(artifact: Artifact) -> EvolutionState:
    """Rebuild the state of a search.

    Parameters
    ----------
    artifact : Artifact
        A good checkpoint.

    Returns
    -------
    EvolutionState
        Equal to the one that was stored, down to the last bit.

    Raises
    ------
    ValueError
        If the datasets are not those that were written.
    """
    data = artifact.data
    if artifact.text(_SEAL) != _seal(data):
        raise ValueError("its datasets were changed after it was written (sha256 differs)")
    rng = np.random.default_rng()
    rng.bit_generator.state = json.loads(artifact.text("generator"))
    archived = Evaluation(_genes(data["archive/genes"]), data["archive/objectives"])
    return EvolutionState(
        int(data["generation"]),
        _genes(data["population/genes"]),
        data["population/objectives"],
        data["population/subpopulation"],
        Archive.of(_genes(data["archive/submitted"]), archived),
        History(data["history/evaluations"], data["history/best"], data["history/front_size"]),
        rng,
    )


def _genes(stored: Any) -> IntArray:
    return np.asarray(stored, dtype=np.int64)


def _seal(data: Mapping[str, Any]) -> str:
    """Hash the datasets in the order of the format."""
    digest = hashlib.sha256()
    for spec in CHECKPOINT.datasets:
        if spec.path != _SEAL:
            value = np.asarray(data[spec.path])
            digest.update(str(value).encode() if value.ndim == 0 else np.ascontiguousarray(value).data)
    return digest.hexdigest()
