"""What a sweep runs: settings, the samples of each, seeds, and their order."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from cpfls_cli.artifacts.formats import SELECTION
from cpfls_cli.artifacts.job import Job
from cpfls_cli.artifacts.spec import InputFile
from cpfls_cli.config.overrides import Variant, variants
from cpfls_cli.config.study import Study, settings_of
from cpfls_cli.errors import ComputationError, ConfigError, InputError
from cpfls_cli.flights.choosing import choosing_source
from cpfls_cli.flights.judging import held_out_parts
from cpfls_cli.flights.training import TrainingData
from cpfls_cli.identification.data import TorqueSource
from cpfls_cli.identification.identify import TRAINING
from cpfls_cli.identification.search import require_flights
from cpfls_cli.regressor.structure import model_structure
from cpfls_cli.search.sweep_samples import SweepSamples

# Work of an evaluation that does not grow with the samples, in samples.
_FIXED_WORK = 1000


@dataclass(frozen=True)
class SweptSetting:
    """One setting of a sweep with all that its runs have in common.

    Attributes
    ----------
    held_out : mapping of str to TorqueSource
        What is judged beside the training part, by name.
    kept : TorqueSource or None
        What its model is chosen on, beside its objectives.
    """

    variant: Variant
    data: TrainingData
    held_out: Mapping[str, TorqueSource]
    kept: TorqueSource | None

    @property
    def selection(self) -> InputFile:
        """The samples learned from, as if they were a file."""
        digest = hashlib.sha256(self.data.indices.astype("<i8").tobytes())
        return InputFile(f"samples of '{self.variant.name}'", digest.hexdigest(), SELECTION.format)

    @property
    def genes(self) -> int:
        """Weights of its chromosomes."""
        return model_structure(self.variant.study.identification).genes

    @property
    def work(self) -> int:
        """Roughly how long a run takes, beside other settings."""
        settings = self.variant.study.identification
        evaluations = settings.population * (1 + settings.generation_gap * settings.generations)
        return round(evaluations * (len(self.data.learned) + _FIXED_WORK))


@dataclass(frozen=True)
class SweepPlan:
    """All runs of a sweep: every setting with the first seed, then every setting with the next.

    Attributes
    ----------
    parts : tuple of str
        What models are judged on; the training part first.
    """

    settings: tuple[SweptSetting, ...]
    seeds: tuple[int, ...]
    parts: tuple[str, ...]

    @property
    def runs(self) -> int:
        """Number of runs."""
        return len(self.settings) * len(self.seeds)

    def setting(self, run: int) -> SweptSetting:
        """Give the setting of a run."""
        return self.settings[run % len(self.settings)]

    def seed(self, run: int) -> int:
        """Give the seed of a run."""
        return self.seeds[run // len(self.settings)]

    def study(self, run: int) -> Study:
        """Give the study of a run."""
        return self.setting(run).variant.study.model_copy(update={"seed": self.seed(run)})

    def work(self, runs: int) -> int:
        """Tell roughly how long so many runs take."""
        return sum(self.setting(run).work for run in range(runs))

    @contextmanager
    def naming(self, run: int) -> Iterator[None]:
        """Say in which run something failed."""
        with naming(f"sweep setting '{self.setting(run).variant.name}', seed {self.seed(run)}"):
            yield


def sweep_plan(
    job: Job,
    flights: Sequence[Path],
    validate: Sequence[Path],
    inputs: Mapping[str, InputFile],
    choose_on: Sequence[Path] = (),
) -> SweepPlan:
    """Gather the settings of a sweep, and choose the samples of each.

    Parameters
    ----------
    flights : sequence of Path
        That train.
    validate : sequence of Path
        That only judge.
    inputs : mapping of str to InputFile
        By role.
    choose_on : sequence of Path
        That models are chosen on, in settings whose choice is `held-out`.

    Raises
    ------
    InputError, ConfigError, ComputationError
        If a flight is not good, or samples of a setting cannot be chosen.
    """
    samples, settings, kept = SweepSamples(job, flights, inputs), [], choosing_source(choose_on, inputs)
    for variant in variants(job.study):
        with naming(f"sweep setting '{variant.name}'"):
            data = samples.of(variant)
            held_out = held_out_parts(variant.study, data.rests, inputs, validate)
            settings.append(SweptSetting(variant, data, held_out, _kept(variant, kept)))
    if kept is not None and all(setting.kept is None for setting in settings):
        raise InputError("--choose-on: no setting of the sweep has identification.choice: held-out; leave it out")
    parts = dict.fromkeys([TRAINING, *(part for setting in settings for part in setting.held_out)])
    seeds = tuple((job.study.seed + number) % 2**63 for number in range(job.study.sweep.seeds))
    return SweepPlan(tuple(settings), seeds, tuple(parts))


def _kept(variant: Variant, kept: TorqueSource | None) -> TorqueSource | None:
    choice = variant.study.identification.choice
    own = kept if choice == "held-out" else None
    with settings_of("identification", variant.study):
        require_flights(choice, given=own is not None)
    return own


@contextmanager
def naming(what: str) -> Iterator[None]:
    """Say where something failed."""
    try:
        yield
    except (ComputationError, ConfigError) as error:
        raise type(error)(f"{what}: {error}") from None
