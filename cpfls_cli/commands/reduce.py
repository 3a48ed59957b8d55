"""Command `reduce`: pick the samples of flights that are worth learning from."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from cpfls_cli.artifacts.job import Job, begin, finish, go_on
from cpfls_cli.artifacts.selection import SelectionRecord
from cpfls_cli.config.study import generator, settings_of
from cpfls_cli.errors import ComputationError, ConfigError, about
from cpfls_cli.flights.training import flight_roles, split_training, uniform_regressor
from cpfls_cli.pages.selection import answer
from cpfls_cli.pages.source import source_of
from cpfls_cli.reduction.survey import survey
from cpfls_cli.reduction.training_set import check_streamed, random_streamed, reduce_streamed
from cpfls_cli.report.outcome import Outcome, nothing_written

RANDOM_DRAWS = 20


def run(job: Job, flights: Sequence[Path]) -> Outcome:
    """Select samples of flights and write their indices."""
    inputs = begin(job, flight_roles(flights))
    split = split_training(flights, job.study, inputs, torque=False)
    settings, rng = job.study.reduction, generator(job.study, "reduce")
    with _naming(flights), settings_of("reduction", job.study):
        surveyed = survey(uniform_regressor(split.training, job.study), settings.rank_tolerance)
        if job.dry_run:
            check_streamed(surveyed, settings, rng)
            return nothing_written(job)
        selection = reduce_streamed(surveyed, settings, rng, job.progress)
        draws = random_streamed(surveyed, len(selection.indices), RANDOM_DRAWS, rng)
    random = np.array([draw.condition_number for draw in draws])
    indices = split.training_indices[selection.indices]
    record = finish(job, SelectionRecord.of(selection, indices, surveyed.samples, random), inputs)
    to_identify = go_on(job, "identify", *flights, "--selection", job.output, output=job.beside("model.h5"))
    return Outcome(record.summary, tuple(answer(source_of(job, record))), next=(to_identify,))


@contextmanager
def _naming(flights: Sequence[Path]) -> Iterator[None]:
    names = " ".join(str(path) for path in flights)
    try:
        with about(names, ConfigError, ComputationError):
            yield
    except np.linalg.LinAlgError:
        # Numbers that a damaged file holds, of sizes that overflow in products.
        raise ComputationError(
            f"{names}: the regressor has numbers too far apart in size to choose samples; look at the flight's largest "
            "values with `cpfls info`"
        ) from None
