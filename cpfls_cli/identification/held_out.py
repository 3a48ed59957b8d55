"""Errors of chromosomes on flights that are kept for the choice among them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.identification.chromosome import decode
from cpfls_cli.identification.data import TorqueSource
from cpfls_cli.identification.evaluator import Evaluator
from cpfls_cli.identification.samples import Ready, Samples


def held_out_errors(evaluator: Evaluator, kept: TorqueSource, chromosomes: IntArray) -> Array:
    """Judge chromosomes on data that neither trains nor judges the model in the end.

    Parameters
    ----------
    evaluator : Evaluator
        Solves each chromosome on the samples that it learns from.
    kept : TorqueSource
    chromosomes : array of int, shape (members, genes)

    Returns
    -------
    array, shape (members,)
        Mean squared error; of the torque in (N m)^2, or scaled by axis as the evaluator's own. Infinite where a
        chromosome has no finite model.
    """
    samples = replace(
        Samples.of(Ready(kept, evaluator.judge.ready.rigid), evaluator.structure, evaluator.judge.ranges),
        scale=evaluator.solver.learned.scale,
    )
    return np.array([_error(evaluator, samples, chromosome) for chromosome in chromosomes])


def _error(evaluator: Evaluator, samples: Samples, chromosome: IntArray) -> float:
    fit = evaluator.fit(chromosome)
    if fit is None:
        return float("inf")
    partitions = decode(evaluator.structure, chromosome.astype(float))
    squares, _ = samples.errors(partitions, fit.coefficients, fit.rigid_body)
    return float(squares[0]) / (3 * len(samples.ready.source))
