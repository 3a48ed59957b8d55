"""The state of a search as datasets, and back, bit by bit."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from cpfls_cli.arrays import IntArray
from cpfls_cli.artifacts.formats import CHECKPOINT
from cpfls_cli.artifacts.store import Artifact
from cpfls_cli.evolution.archive import Archive, Evaluation
from cpfls_cli.evolution.state import EvolutionState, History
from cpfls_cli.identification.search import Unfinished

_BEFORE_ALL = -1
_SEAL = "sha256"


@dataclass(frozen=True)
class StoppedSearch:
    """What a search left.

    Attributes
    ----------
    state : EvolutionState or None
        After its last generation; None if not even the initial population was evaluated.
    unfinished : Unfinished
        What was evaluated of the generation after it.
    """

    state: EvolutionState | None
    unfinished: Unfinished


def state_data(state: EvolutionState) -> dict[str, Any]:
    """Arrange the state of a search as the datasets of a checkpoint."""
    data = {
        "generation": state.index,
        "generator": np.array(json.dumps(state.rng.bit_generator.state)),
        "population/genes": state.genes.astype(np.uint16),
        "population/objectives": state.objectives,
        "population/subpopulation": state.subpopulations,
        **_evaluated("archive", state.archive.submitted, state.archive.results),
        **{f"history/{name}": values for name, values in vars(state.history).items()},
    }
    return with_unfinished(data, Unfinished(state.genes[:0], Evaluation(state.genes[:0], state.objectives[:0])))


def nothing_data(unfinished: Unfinished) -> dict[str, Any]:
    """Arrange a search that has not evaluated its initial population.

    Parameters
    ----------
    unfinished : Unfinished
        What it has evaluated of it.
    """
    genes, objectives = unfinished.submitted[:0], unfinished.evaluation.objectives[:0]
    data = {
        "generation": _BEFORE_ALL,
        "generator": np.array("null"),
        "population/genes": genes.astype(np.uint16),
        "population/objectives": objectives,
        "population/subpopulation": np.arange(0),
        **_evaluated("archive", genes, Evaluation(genes, objectives)),
        **{f"history/{name}": values for name, values in vars(History.empty(objectives.shape[1])).items()},
    }
    return with_unfinished(data, unfinished)


def with_unfinished(data: Mapping[str, Any], unfinished: Unfinished) -> dict[str, Any]:
    """Add what was evaluated of the next generation to the datasets of a checkpoint."""
    added = {**data, **_evaluated("unfinished", unfinished.submitted, unfinished.evaluation)}
    return {**added, _SEAL: np.array(_seal(added))}


def stopped_search(artifact: Artifact) -> StoppedSearch:
    """Rebuild what a search left.

    Parameters
    ----------
    artifact : Artifact
        A good checkpoint.

    Returns
    -------
    StoppedSearch
        Equal to what was stored, down to the last bit.

    Raises
    ------
    ValueError
        If the datasets are not those that were written.
    """
    data = artifact.data
    if artifact.text(_SEAL) != _seal(data):
        raise ValueError("its datasets were changed after it was written (sha256 differs)")
    unfinished = Unfinished(*_evaluations(data, "unfinished"))
    return StoppedSearch(_state(data) if data["generation"] > _BEFORE_ALL else None, unfinished)


def _state(data: Mapping[str, Any]) -> EvolutionState:
    rng = np.random.default_rng()
    rng.bit_generator.state = json.loads(str(data["generator"]))
    return EvolutionState(
        int(data["generation"]),
        _genes(data["population/genes"]),
        data["population/objectives"],
        data["population/subpopulation"],
        Archive.of(*_evaluations(data, "archive")),
        History(data["history/evaluations"], data["history/best"], data["history/front_size"]),
        rng,
    )


def _evaluated(group: str, submitted: IntArray, evaluation: Evaluation) -> dict[str, Any]:
    return {
        f"{group}/submitted": submitted.astype(np.uint16),
        f"{group}/genes": evaluation.genes.astype(np.uint16),
        f"{group}/objectives": evaluation.objectives,
    }


def _evaluations(data: Mapping[str, Any], group: str) -> tuple[IntArray, Evaluation]:
    return _genes(data[f"{group}/submitted"]), Evaluation(_genes(data[f"{group}/genes"]), data[f"{group}/objectives"])


def _genes(stored: Any) -> IntArray:
    return np.asarray(stored, dtype=np.int64)


def _seal(data: Mapping[str, Any]) -> str:
    """Hash the datasets in the order of the format."""
    digest = hashlib.sha256()
    for spec in CHECKPOINT.datasets:
        if spec.path != _SEAL:
            value = np.asarray(data[spec.path])
            digest.update(str(value).encode() if value.ndim == 0 else value.tobytes())
    return digest.hexdigest()
