"""Stage `reduce`: pick the samples of a flight that are worth learning from."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.formats import FLIGHT, SELECTION
from cpfls_cli.artifacts.records import Artifact
from cpfls_cli.config.study import Study
from cpfls_cli.errors import ComputationError
from cpfls_cli.identification.data import split_flight
from cpfls_cli.reduction.baseline import random_selections
from cpfls_cli.reduction.greedy import check_reducible, reduce
from cpfls_cli.reduction.selection import Selection
from cpfls_cli.regressor.regressor import Regressor, data_ranges, uniform_breakpoints
from cpfls_cli.regressor.structure import model_structure
from cpfls_cli.stages.job import Job, Outcome, begin, finish
from cpfls_cli.stages.sources import read_with
from cpfls_cli.stages.study import generator, settings_of
from cpfls_cli.stages.training import MOTION, flight_motion

RANDOM_DRAWS = 20


def run(job: Job, flight: Path) -> Outcome:
    """Select samples of a flight and write their indices.

    Parameters
    ----------
    job : Job
    flight : Path

    Returns
    -------
    Outcome
    """
    started = begin(job, {"flight": flight})
    source = read_with(flight, FLIGHT, "time", *MOTION)
    with _naming(flight), settings_of("reduction", job.study):
        Q = _regressor(source, job.study)
        if started.dry_run is not None:
            check_reducible(Q, job.study.reduction)
            return started.dry_run
        selection = reduce(Q, job.study.reduction, job.progress)
        random = _random(Q, len(selection.indices), job.study)
    finish(job, SELECTION, _data(selection, len(Q), random), started.inputs)
    return _outcome(selection, len(Q), random, job.study.reduction.condition_number)


@contextmanager
def _naming(flight: Path) -> Iterator[None]:
    try:
        yield
    except ComputationError as error:
        raise ComputationError(f"{flight}: {error}") from None


def _regressor(flight: Artifact, study: Study) -> Array:
    """Regressor of the part of a flight that trains, at uniform partitions."""
    training = split_flight(flight.array("time"), study.identification.training_share, 0.0).training
    motion = flight_motion(flight)[training]
    structure = model_structure(study.identification)
    return Regressor(structure, motion, data_ranges(structure, motion.attitude)).matrix(uniform_breakpoints(structure))


def _random(Q: Array, size: int, study: Study) -> Array:
    """Condition numbers of random choices of equal size: what any rule must beat."""
    rng = generator(study, "reduce")
    draws = random_selections(Q, size, RANDOM_DRAWS, rng, study.reduction.rank_tolerance)
    return np.array([draw.condition_number for draw in draws])


def _data(selection: Selection, candidates: int, random: Array) -> dict[str, Any]:
    return {
        "indices": selection.indices,
        "trace/condition_number": selection.condition_number_trace,
        "trace/singular_value_min": selection.singular_value_min_trace,
        "trace/singular_value_max": selection.singular_value_max_trace,
        "rank": selection.rank,
        "rank_full": selection.rank_full,
        "condition_number": selection.condition_number,
        "condition_number_full": selection.condition_number_full,
        "candidates": candidates,
        "criterion": np.array(selection.criterion),
        "stop_reason": np.array(selection.stop_reason),
        "random/condition_number": random,
    }


def _outcome(selection: Selection, candidates: int, random: Array, target: float | None) -> Outcome:
    summary = {
        "samples": candidates,
        "selected": len(selection.indices),
        "criterion": selection.criterion,
        "rank": selection.rank,
        "rank_full": selection.rank_full,
        "condition_number": selection.condition_number,
        "condition_number_full": selection.condition_number_full,
        "condition_number_random": float(np.median(random)),
        "stop_reason": selection.stop_reason,
        "stalled": selection.stalled,
    }
    lines = (
        f"{len(selection.indices)} of {candidates} samples by {selection.criterion}, rank {selection.rank} of "
        f"{selection.rank_full}",
        f"condition number {selection.condition_number:.5g} (all samples {selection.condition_number_full:.5g}, random "
        f"choice of equal size {np.median(random):.5g})",
    )
    return Outcome(summary, lines, tuple(_warnings(selection, candidates, target)))


def _warnings(selection: Selection, candidates: int, target: float | None) -> Iterator[str]:
    if selection.stalled:
        yield "the rule stalled below full rank: do not train on this selection; use sigma_min, A or D"
    if target is not None and selection.condition_number > target:
        all_in = len(selection.indices) == candidates
        limit = "all samples are in" if all_in else "reduction.size stopped the selection; raise it or set it to null"
        yield (
            f"the target reduction.condition_number = {target:g} is not reached, the selection has"
            f" {selection.condition_number:.5g}: {limit}"
        )
