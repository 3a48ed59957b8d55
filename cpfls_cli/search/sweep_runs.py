"""The runs of a sweep: settings, samples, seeds and their order; each is kept as soon as it is finished."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from cpfls_cli.artifacts.job import Job, origin_before
from cpfls_cli.artifacts.spec import InputFile
from cpfls_cli.config.load import parse_config
from cpfls_cli.config.overrides import Variant, variants
from cpfls_cli.config.study import Study, generator, settings_of
from cpfls_cli.errors import ComputationError, ConfigError, InputError, about
from cpfls_cli.flights.inputs import choosing_source, held_out_parts
from cpfls_cli.flights.training import SplitFlights, TrainingData, split_training, uniform_regressor
from cpfls_cli.identification.data import TorqueSource, gathered
from cpfls_cli.identification.identify import TRAINING, Identification, identify
from cpfls_cli.identification.replicates import ALL_SAMPLES, Setting, Sweep, replicate
from cpfls_cli.identification.search import NothingFoundError, SearchStep, StopReason, is_end, require_flights
from cpfls_cli.inertia import six_parameters
from cpfls_cli.reduction.selection import Selection
from cpfls_cli.reduction.survey import survey
from cpfls_cli.reduction.training_set import check_streamed, reduce_streamed
from cpfls_cli.regressor.structure import StructureSettings
from cpfls_cli.search.checkpoint import Checkpoint, KeptFile, StoppedSearch, differences
from cpfls_cli.search.resumable import Resumable, SearchOptions, Watch
from cpfls_cli.store import Origin, write

# Work of an evaluation that does not grow with the samples, in samples.
_FIXED_WORK = 1000
_FAILURES = (ConfigError, ComputationError)
"""What is said with the part of a sweep in which it came about."""


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
        self._data: dict[Any, tuple[TrainingData, float]] = {}
        self._selections: dict[Any, Selection] = {}

    def of(self, variant: Variant) -> tuple[TrainingData, float]:
        """Choose the samples of a setting, as `cpfls reduce` would, and give their condition number."""
        study = variant.study
        cut = (study.identification.training_share, study.identification.embargo_s)
        if cut not in self._splits:
            self._splits[cut] = split_training(self._flights, study, self._inputs)
        split = self._splits[cut]
        regressor = (*cut, *(getattr(study.identification, f.name) for f in fields(StructureSettings)))
        key = (*regressor, study.reduction if variant.reduced else None)
        if key not in self._data:
            self._data[key] = self._chosen(split, variant, regressor)
        return self._data[key]

    def _shown(self, name: str) -> Callable[[int, int], None]:
        """Show how many samples are chosen; the bar is for the searches."""
        return lambda done, most: self._job.progress(0, 1, f"choosing samples: {name}, {done} of {most}")

    def _chosen(self, split: SplitFlights, variant: Variant, regressor: tuple[Any, ...]) -> tuple[TrainingData, float]:
        study, training = variant.study, split.training
        settings, rng = study.reduction, generator(study, "reduce")
        everything = TrainingData(training, training, split.rests, split.training_indices, split.parts)
        with settings_of("reduction", study):
            surveyed = survey(uniform_regressor(training, study), settings.rank_tolerance)
            if not variant.reduced:
                return everything, surveyed.condition_number
            if self._job.dry_run:
                check_streamed(surveyed, settings, rng)
                return everything, surveyed.condition_number
            # A smaller size is the beginning of a larger one: Table 5 takes three of one rule.
            rule = (*regressor, replace(settings, size=settings.pool))
            known = self._selections.get(rule)
            selection = known.beginning(settings.size) if known and settings.size else None
            if selection is None:
                selection = reduce_streamed(surveyed, settings, rng, self._shown(variant.name))
                self._selections[rule] = selection
        chosen, condition = np.sort(selection.indices), selection.condition_number
        data = TrainingData(
            training, gathered(training, chosen), split.rests, split.training_indices[chosen], split.parts
        )
        return data, condition if np.isfinite(condition) else float("nan")


@dataclass(frozen=True)
class SweptSetting:
    """One setting of a sweep with all that its runs have in common.

    Attributes
    ----------
    uniform_condition_number : float
        Of the samples learned from, at uniform partitions; NaN below the rank of all.
    held_out : mapping of str to TorqueSource
        What is judged beside the training part, by name.
    kept : TorqueSource or None
        What its model is chosen on, beside its objectives.
    """

    variant: Variant
    data: TrainingData
    uniform_condition_number: float
    held_out: Mapping[str, TorqueSource]
    kept: TorqueSource | None

    @property
    def criterion(self) -> str:
        """What chooses its samples."""
        return self.variant.study.reduction.criterion if self.variant.reduced else ALL_SAMPLES

    @property
    def selection(self) -> InputFile:
        """The samples learned from, as if they were a file."""
        digest = hashlib.sha256(self.data.indices.astype("<i8").tobytes())
        return InputFile(f"samples of '{self.variant.name}'", digest.hexdigest(), Selection.FORMAT)

    @property
    def without_runs(self) -> Setting:
        """What is known of it before its first run is finished."""
        settings = self.variant.study.identification
        return Setting(
            name=self.variant.name,
            overrides=self.variant.overrides,
            structure=settings.structure,
            samples=len(self.data.learned),
            criterion=self.criterion,
            selection=self.selection.sha256,
            population=settings.population,
            generations=settings.generations,
            judged_on=settings.judged_on,
            ranking=settings.ranking,
            uniform_condition_number=self.uniform_condition_number,
            largest_torque=max(float(np.max(np.abs(data.torque))) for data in self.data.training.chunks()),
            replicates=(),
        )

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

    @cached_property
    def without_runs(self) -> Sweep:
        """The sweep before its first run is finished."""
        settings = tuple(setting.without_runs for setting in self.settings)
        return Sweep(parts=self.parts, complete=False, settings=settings)

    def work(self, runs: int) -> int:
        """Tell roughly how long so many runs take."""
        return sum(self.setting(run).work for run in range(runs))

    def naming(self, run: int) -> AbstractContextManager[None]:
        """Name the run in which something failed."""
        return about(f"sweep setting '{self.setting(run).variant.name}', seed {self.seed(run)}", *_FAILURES)


def sweep_plan(
    job: Job,
    flights: Sequence[Path],
    validate: Sequence[Path],
    inputs: Mapping[str, InputFile],
    choose_on: Sequence[Path] = (),
) -> SweepPlan:
    """Gather the settings of a sweep, and choose the samples of each."""
    samples, settings, kept = SweepSamples(job, flights, inputs), [], choosing_source(choose_on, inputs)
    for variant in variants(job.study):
        with about(f"sweep setting '{variant.name}'", *_FAILURES):
            data, condition_number = samples.of(variant)
            held_out = held_out_parts(variant.study, data.rests, inputs, validate)
            settings.append(SweptSetting(variant, data, condition_number, held_out, _kept(variant, kept)))
    if kept is not None and all(setting.kept is None for setting in settings):
        raise InputError("--choose-on: no setting of the sweep has identification.choice: held-out; leave it out")
    parts = dict.fromkeys([TRAINING, *(part for setting in settings for part in setting.held_out)])
    seeds = tuple((job.study.seed + number) % 2**63 for number in range(job.study.sweep.seeds))
    return SweepPlan(tuple(settings), seeds, tuple(parts))


def _kept(variant: Variant, kept: TorqueSource | None) -> TorqueSource | None:
    choice = variant.study.identification.choice
    chosen_on = kept if choice == "held-out" else None
    with settings_of("identification", variant.study):
        require_flights(choice, given=chosen_on is not None)
    return chosen_on


_SECTIONS = ("reduction", "identification", "sweep")
_SEEDS = "sweep.seeds"
_END: StopReason = "generations"


@dataclass(frozen=True)
class PartialSweep(KeptFile):
    """Where a sweep leaves its finished runs."""

    WORK: ClassVar = "sweep"
    SUFFIX: ClassVar = ".partial"
    OUTPUT: ClassVar = Sweep

    def take_up(self, *, resume: bool, force: bool) -> Sweep | None:
        """Read what a stopped sweep left, where it is to go on; None for one that starts, `force` to give it up."""
        Checkpoint.beside(self.output, self.header).require_own()
        if not resume:
            self.require_permission(force=force)
            return None
        stopped, origin = self._read(Sweep)
        self._require_same(differences(origin, self.header, _keys(origin), _keys(self.header)))
        return stopped

    def begin(self, plan: SweepPlan, stopped: Sweep | None) -> Sweep:
        """Take the runs that are finished, and keep them from here on."""
        begun = plan.without_runs
        if stopped is not None:
            self._require_same_plan(plan, stopped, begun)
            # More seeds than those that are finished may be asked for now.
            begun = replace(stopped, complete=stopped.runs == plan.runs)
        self.write(begun)
        return begun

    def write(self, sweep: Sweep) -> None:
        """Replace what was there by these finished runs, or leave it as it was."""
        write(self.path, sweep, self.header)

    def _require_same_plan(self, plan: SweepPlan, stopped: Sweep, begun: Sweep) -> None:
        differing = [f"{path} differs" for path in stopped.differing_settings(begun)]
        if stopped.runs > plan.runs:
            differing.append(f"{_SEEDS} = {len(plan.seeds)}, but {stopped.runs} runs are finished")
        self._require_same(differing)


def _keys(header: Origin) -> dict[str, Any]:
    """List the keys that a sweep depends on, with dots; more seeds only add to it."""
    config = parse_config(header.config, "/config")
    return {"seed": config["seed"]} | {
        f"{section}.{key}": value
        for section in _SECTIONS
        for key, value in config.get(section, {}).items()
        if f"{section}.{key}" != _SEEDS
    }


def finish_runs(
    job: Job, plan: SweepPlan, sweep: Sweep, partial: PartialSweep, options: SearchOptions, watch: Watch
) -> tuple[Sweep, StopReason]:
    """Go on from the first run that is not finished, keep each as soon as it is, and say why no more of them are."""
    for number in range(sweep.runs, plan.runs):
        if (reason := watch.should_stop()) is not None:
            return sweep, reason
        inputs = {**partial.header.inputs, "selection": plan.setting(number).selection}
        checkpoint = Checkpoint.beside(job.output, origin_before(plan.study(number), inputs))
        search = Resumable(checkpoint, _left_within_a_run(checkpoint) if options.resume else None)
        with plan.naming(number):
            found = _identified(job, plan, number, search, options, watch)
        if not is_end(found.stop_reason):
            return sweep, found.stop_reason
        run = replicate(plan.seed(number), plan.parts, None if isinstance(found, NothingFoundError) else found)
        sweep = sweep.with_run(number % len(plan.settings), run, complete=number + 1 == plan.runs)
        partial.write(sweep)
        search.end(found.stop_reason)
    return sweep, _END


def _left_within_a_run(checkpoint: Checkpoint) -> StoppedSearch | None:
    """Read the checkpoint of a run; none of the run before, nor a damaged one: from its start a run ends the same."""
    if not checkpoint.path.exists():
        return None
    try:
        return checkpoint.read()
    except InputError:
        return None


def _identified(
    job: Job, plan: SweepPlan, number: int, search: Resumable, options: SearchOptions, watch: Watch
) -> Identification | NothingFoundError:
    setting, study = plan.setting(number), plan.study(number)
    shown = _shown(job, plan, number)
    shown(SearchStep(0, study.identification.generations, 0.0, None))
    try:
        with settings_of("identification", study):
            return identify(
                setting.data.training,
                setting.data.learned,
                setting.held_out,
                study.identification,
                generator(study, "identify"),
                search.run(options, watch, shown),
                six_parameters(study.vehicle.inertia_kg_m2),
                setting.kept,
            )
    except NothingFoundError as error:
        return error


def _shown(job: Job, plan: SweepPlan, number: int) -> Callable[[SearchStep], None]:
    """Show the progress of a run on that of the sweep, by the work that each takes."""
    before, work, total = plan.work(number), plan.setting(number).work, plan.work(plan.runs)
    name = f"run {number + 1} of {plan.runs}: {plan.setting(number).variant.name}, seed {plan.seed(number)}"

    def show(step: SearchStep) -> None:
        share = (step.generation + step.share) / (step.generations + 1)
        best = "" if step.best is None else f"  best error {step.best[0]:.3g}"
        job.progress(before + work * share, total, f"{name}, generation {step.generation} of {step.generations}{best}")

    return show
