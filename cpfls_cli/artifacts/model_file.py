"""A model as an artifact: written after identification, read back for prediction."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.artifacts.store import Artifact
from cpfls_cli.config.load import parse_config, validate
from cpfls_cli.errors import InputError
from cpfls_cli.fuzzy.inputs import InputRange
from cpfls_cli.identification.evaluator import decode
from cpfls_cli.identification.identify import Identification
from cpfls_cli.identification.model import Model
from cpfls_cli.regressor.structure import ModelStructure, model_structure

_MEASURES = ("mse", "max_error", "relative_error", "r2", "vaf", "r2_body")


def model_data(result: Identification, base: str, learned: IntArray) -> dict[str, Any]:
    """Arrange an identification as the datasets of a model artifact.

    Parameters
    ----------
    base : str
        ``none`` or ``rigid-body``.
    learned : array of int
        Indices of the samples that trained.
    """
    return {
        **_model(result, base),
        **_solution(result),
        **_search(result),
        **_judged(result),
        "training/indices": learned,
        "findings": np.array(result.findings, dtype="U") if result.findings else np.array([], dtype="U1"),
    }


def read_model(artifact: Artifact, path: object) -> Model:
    """Rebuild a model from its artifact.

    Parameters
    ----------
    path : Path
        For messages.

    Raises
    ------
    InputError
        If the artifact's own config and its numbers do not fit each other.
    """
    source = f"{path}: /config"
    study = validate(parse_config(artifact.header.config, source), source)
    structure = model_structure(study.identification)
    weights, coefficients = artifact.array("model/weights"), artifact.array("model/coefficients")
    if len(weights) != structure.genes or len(coefficients) != structure.parameters:
        raise InputError(
            f"{path}: holds {len(weights)} weights and {len(coefficients)} coefficients; its config asks for "
            f"{structure.genes} and {structure.parameters}"
        )
    roll, pitch = (InputRange(*(float(value) for value in row)) for row in artifact.array("model/input_range"))
    return Model(
        structure,
        (roll, pitch),
        decode(structure, weights),
        coefficients,
        artifact.array("model/rigid_body"),
        artifact.array("model/visited").astype(bool),
    )


def _model(result: Identification, base: str) -> dict[str, Any]:
    model = result.model
    names = [p.name for p, b in zip(model.structure.partitions, model.partitions, strict=True) for _ in b]
    return {
        "model/weights": result.front.chromosomes[result.front.chosen],
        "model/partition": np.array(names),
        "model/breakpoints": np.concatenate(model.partitions),
        "model/coefficients": model.coefficients,
        "model/parameter": np.array(list(_parameter_names(model.structure))),
        "model/rigid_body": model.rigid_body,
        "model/base": np.array(base),
        "model/input_range": np.array([[r.minimum, r.maximum] for r in model.ranges]),
        "model/visited": model.visited.astype(np.uint8),
        "model/ridge_weight": result.fit.ridge_weight,
    }


def _parameter_names(structure: ModelStructure) -> Iterator[str]:
    for block in structure.blocks:
        for rule in range(block.rules):
            for feature in range(block.features):
                yield f"{block.function.name} rule {rule + 1} c{feature}"


def _solution(result: Identification) -> dict[str, Any]:
    data: dict[str, Any] = {
        "solve/singular_values": result.system.singular_values,
        "solve/rank": result.system.rank,
        "solve/condition_number": result.system.condition_number,
        "solve/parameters": result.system.parameters,
        "rules/name": np.array(result.excitation.name),
        "rules/firing": result.excitation.firing,
        "rules/determined": result.excitation.determined,
        "rules/excited": result.excitation.excited.astype(np.uint8),
    }
    if result.ridge is not None:
        data |= {
            "ridge/weight": result.ridge.weight,
            "ridge/error": result.ridge.error,
            "ridge/standard_error": result.ridge.standard_error,
        }
    return data


def _search(result: Identification) -> dict[str, Any]:
    return {
        "front/chromosomes": result.front.chromosomes,
        "front/objectives": result.front.objectives,
        "front/chosen": result.front.chosen,
        **({} if result.front.held_out is None else {"front/held_out": result.front.held_out}),
        "history/evaluations": result.history.evaluations,
        "history/best": result.history.best,
        "history/front_size": result.history.front_size,
        "search/stop_reason": np.array(result.stop_reason),
        "search/complete": np.uint8(result.complete),
    }


def _judged(result: Identification) -> dict[str, Any]:
    parts = list(result.scores)
    models = list(result.scores["training"])
    by_name = {baseline.name: baseline.parameters for baseline in result.baselines}

    def table(measure: str) -> Array:
        return np.array([[getattr(result.scores[part][model], measure) for part in parts] for model in models])

    return {
        "judged/models": np.array(models),
        "judged/parts": np.array(parts),
        "judged/samples": np.array([result.samples[part] for part in parts]),
        "judged/outside": np.array([result.outside[part] for part in parts]),
        **{f"judged/{measure}": table(measure) for measure in _MEASURES},
        "baselines/rigid_body": by_name["rigid-body"],
        "baselines/constant_inertia": by_name["constant-inertia"],
    }
