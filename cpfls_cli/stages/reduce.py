"""Stage `reduce`: pick the samples of a flight that are worth learning from."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.formats import SELECTION
from cpfls_cli.config.study import Study
from cpfls_cli.errors import ComputationError
from cpfls_cli.identification.data import TorqueSource
from cpfls_cli.reduction.baseline import random_streamed
from cpfls_cli.reduction.selection import Selection
from cpfls_cli.reduction.streamed import check_streamed, reduce_streamed
from cpfls_cli.reduction.survey import survey
from cpfls_cli.regressor.regressor import Regressor, data_ranges, joined_ranges, uniform_breakpoints
from cpfls_cli.regressor.structure import model_structure
from cpfls_cli.stages.job import Job, Outcome, begin, finish
from cpfls_cli.stages.study import generator, settings_of
from cpfls_cli.stages.training import flight_roles, split_training

RANDOM_DRAWS = 20

# Samples whose regressor is written out at a time.
_BLOCK = 4096


def run(job: Job, flights: Sequence[Path]) -> Outcome:
    """Select samples of flights and write their indices."""
    started = begin(job, flight_roles(flights))
    split = split_training(flights, job.study, started.inputs, torque=False)
    settings, rng = job.study.reduction, generator(job.study, "reduce")
    with _naming(flights), settings_of("reduction", job.study):
        surveyed = survey(uniform_regressor(split.training, job.study), settings.rank_tolerance)
        if started.dry_run is not None:
            check_streamed(surveyed, settings, rng)
            return started.dry_run
        selection = reduce_streamed(surveyed, settings, rng, job.progress)
        draws = random_streamed(surveyed, len(selection.indices), RANDOM_DRAWS, rng)
    random = np.array([draw.condition_number for draw in draws])
    indices = split.training_indices[selection.indices]
    finish(job, SELECTION, _data(replace(selection, indices=indices), surveyed.samples, random), started.inputs)
    return _outcome(selection, surveyed.samples, random, settings.condition_number)


@contextmanager
def _naming(flights: Sequence[Path]) -> Iterator[None]:
    try:
        yield
    except ComputationError as error:
        raise ComputationError(f"{' '.join(str(path) for path in flights)}: {error}") from None


def uniform_regressor(training: TorqueSource, study: Study) -> Callable[[], Iterator[Array]]:
    """Write out the regressor at uniform partitions, block by block.

    Parameters
    ----------
    training : TorqueSource
        The parts of flights that train.

    Returns
    -------
    callable
        Gives the blocks in the order of the samples, as often as it is called.
    """
    structure = model_structure(study.identification)
    partitions = uniform_breakpoints(structure)
    ranges = joined_ranges(data_ranges(structure, data.motion.attitude) for data in training.chunks())

    def blocks() -> Iterator[Array]:
        for data in training.chunks():
            for start in range(0, len(data), _BLOCK):
                yield Regressor(structure, data.motion[start : start + _BLOCK], ranges).matrix(partitions)

    return blocks


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
        "exchanges": selection.exchanges,
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
        "exchanges": selection.exchanges,
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
        yield "the rule stalled below full rank: do not train on this selection; use another reduction.criterion"
    if target is not None and selection.condition_number > target:
        limit = "reduction.size stopped the selection; raise it or set it to null"
        if selection.stop_reason == "pool":
            limit = "all samples of the pool are in; raise reduction.pool"
        elif len(selection.indices) == candidates:
            limit = "all samples are in"
        yield (
            f"the target reduction.condition_number = {target:g} is not reached, the selection has"
            f" {selection.condition_number:.5g}: {limit}"
        )
