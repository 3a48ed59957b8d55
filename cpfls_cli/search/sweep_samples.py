"""The samples that the settings of a sweep learn from, each set of them chosen once."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from cpfls_cli.artifacts.job import Job
from cpfls_cli.artifacts.spec import InputFile
from cpfls_cli.config.overrides import Variant
from cpfls_cli.config.study import Study, generator, settings_of
from cpfls_cli.flights.training import SplitFlights, TrainingData, split_training, uniform_regressor
from cpfls_cli.identification.data import gathered
from cpfls_cli.reduction.survey import survey
from cpfls_cli.reduction.training_set import check_streamed, reduce_streamed
from cpfls_cli.regressor.structure import StructureSettings


class SweepSamples:
    """Training data by setting; what two settings have in common is made once.

    Parameters
    ----------
    job : Job
        A dry run only checks that samples could be chosen.
    inputs : mapping of str to InputFile
        By role; the flights among them.
    """

    def __init__(self, job: Job, flights: Sequence[Path], inputs: Mapping[str, InputFile]) -> None:
        self._job, self._flights, self._inputs = job, flights, inputs
        self._splits: dict[Any, SplitFlights] = {}
        self._data: dict[Any, TrainingData] = {}

    def of(self, variant: Variant) -> TrainingData:
        """Choose the samples of a setting, as `cpfls reduce` would.

        Raises
        ------
        ComputationError, ConfigError
            See `cpfls_cli.reduction`.
        """
        study = variant.study
        cut = (study.identification.training_share, study.identification.embargo_s)
        if cut not in self._splits:
            self._splits[cut] = split_training(self._flights, study, self._inputs)
        split = self._splits[cut]
        if not variant.reduced:
            training = split.training
            return TrainingData(training, training, split.rests, split.training_indices)
        key = (*cut, study.reduction, *(getattr(study.identification, f.name) for f in fields(StructureSettings)))
        if key not in self._data:
            self._data[key] = self._reduced(split, study, variant.name)
        return self._data[key]

    def _shown(self, name: str) -> Callable[[int, int], None]:
        """Show how many samples are chosen; the bar is for the searches."""
        return lambda done, most: self._job.progress(0, 1, f"choosing samples: {name}, {done} of {most}")

    def _reduced(self, split: SplitFlights, study: Study, name: str) -> TrainingData:
        training, settings, rng = split.training, study.reduction, generator(study, "reduce")
        with settings_of("reduction", study):
            surveyed = survey(uniform_regressor(training, study), settings.rank_tolerance)
            if self._job.dry_run:
                check_streamed(surveyed, settings, rng)
                return TrainingData(training, training, split.rests, split.training_indices)
            chosen = np.sort(reduce_streamed(surveyed, settings, rng, self._shown(name)).indices)
        return TrainingData(training, gathered(training, chosen), split.rests, split.training_indices[chosen])
