"""Structures compared by cross-validation over contiguous blocks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.errors import SettingError
from cpfls_cli.identification.data import TorqueSource
from cpfls_cli.identification.settings import IdentificationSettings
from cpfls_cli.regressor.structure import model_structure
from cpfls_cli.validation.candidates import candidates, structure_name
from cpfls_cli.validation.structure_folds import FoldResult, StructureFolds

RIGID_BODY = "rigid body"


@dataclass(frozen=True)
class StructureComparison:
    """Structures and the error of each on blocks that it did not learn from.

    Attributes
    ----------
    name : tuple of str
        The rigid body first; none where the samples are too few for the folds.
    parameters : array of int, shape (candidates,)
        Linear parameters of the fuzzy part.
    error : array, shape (candidates,)
        Mean squared error of the torque scaled by axis, on held-out blocks.
    standard_error : array, shape (candidates,)
        Its standard error over the blocks.
    ridge_weight : array, shape (candidates,)
        Chosen on the same blocks; 0 without a ridge, infinite where the fuzzy part is off.
    own : array of bool, shape (candidates,)
        Which is the structure of the model.
    """

    name: tuple[str, ...]
    parameters: IntArray
    error: Array
    standard_error: Array
    ridge_weight: Array
    own: BoolArray


def compare_structures(
    training: TorqueSource, learned: TorqueSource, settings: IdentificationSettings
) -> StructureComparison:
    """Cross-validate structures that differ from the settings' in one choice, and the rigid body alone.

    All have equidistant partitions: nothing is searched for, so a structure whose partitions matter looks worse here
    than a search would leave it, the model's own as well. The ridge weight of a fuzzy part over a rigid body is chosen
    by the one-standard-error rule on the same blocks; without a rigid body the coefficients are those of minimum norm.
    A structure is left out where it has more than 400 parameters, or more than the rows that a fold learns from.

    Parameters
    ----------
    training : TorqueSource
        Judges; of more than `validation.samples` samples, as many in contiguous pieces.
    learned : TorqueSource
        The samples of it that parameters are learned from.
    settings : IdentificationSettings

    Returns
    -------
    StructureComparison
        Empty where the samples are too few for the folds and the time left out around them.
    """
    try:
        folds = StructureFolds.of(training, learned, settings)
    except SettingError:
        return _comparison([])
    own = candidates(settings)[0]
    rows = [(RIGID_BODY, 0, False, folds.rigid_body())]
    for other in candidates(settings):
        result = folds.structure(other)
        if result is not None:
            rows.append((structure_name(other), model_structure(other).parameters, other == own, result))
    return _comparison(rows)


def _comparison(rows: list[tuple[str, int, bool, FoldResult]]) -> StructureComparison:
    results = [result for *_, result in rows]
    return StructureComparison(
        name=tuple(name for name, *_ in rows),
        parameters=np.array([parameters for _, parameters, *_ in rows], dtype=np.int64),
        error=np.array([result.error for result in results], dtype=float),
        standard_error=np.array([result.standard_error for result in results], dtype=float),
        ridge_weight=np.array([result.ridge_weight for result in results], dtype=float),
        own=np.array([own for *_, own, _ in rows], dtype=bool),
    )
