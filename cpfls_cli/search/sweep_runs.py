"""The runs of a sweep one after the other: each kept as soon as it is finished, so that a stopped sweep goes on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

from cpfls_cli.artifacts.job import Job, header_of
from cpfls_cli.artifacts.spec import Header
from cpfls_cli.artifacts.store import write_record
from cpfls_cli.artifacts.sweep import RunGroup, SweepRecord
from cpfls_cli.config.load import parse_config
from cpfls_cli.config.study import generator, settings_of
from cpfls_cli.errors import InputError
from cpfls_cli.identification.identify import Identification, identify
from cpfls_cli.identification.search import NothingFoundError, SearchStep, StopReason, is_end
from cpfls_cli.inertia import six_parameters
from cpfls_cli.search.checkpoint import Checkpoint, Leftover, StoppedSearch, differences
from cpfls_cli.search.resumable import Resumable, SearchOptions, Watch
from cpfls_cli.search.sweep_plan import SweepPlan

_SECTIONS = ("reduction", "identification", "sweep")
_SEEDS = "sweep.seeds"
_END: StopReason = "generations"


@dataclass(frozen=True)
class PartialSweep(Leftover):
    """Where a sweep leaves its finished runs."""

    WORK: ClassVar = "sweep"
    SUFFIX: ClassVar = ".partial"
    OUTPUT: ClassVar = SweepRecord

    def take_up(self, *, resume: bool, force: bool) -> SweepRecord | None:
        """Read what a stopped sweep left, where the sweep is to go on.

        Parameters
        ----------
        force : bool
            Allow it to be given up.

        Returns
        -------
        SweepRecord or None
            None for a sweep that starts.
        """
        Checkpoint.beside(self.output, self.header).require_own()
        if not resume:
            self.require_permission(force=force)
            return None
        stopped = self._read(SweepRecord)
        old, new = _keys(stopped.origin), _keys(self.header)
        self._require_same(differences(stopped.origin, self.header, old, new))
        return stopped

    def runs(self, plan: SweepPlan, stopped: SweepRecord | None) -> RunGroup:
        """Take the runs that are finished, and keep them from here on."""
        runs = plan.no_runs if stopped is None else stopped.run
        if stopped is not None:
            self._require_same_plan(plan, stopped)
        self.write(plan, runs)
        return runs

    def write(self, plan: SweepPlan, runs: RunGroup) -> None:
        """Replace what was there by these finished runs, or leave it as it was."""
        write_record(self.path, plan.record(runs).with_header(self.header))

    def _require_same_plan(self, plan: SweepPlan, stopped: SweepRecord) -> None:
        differing = [f"{path} differs" for path in stopped.differing_settings(plan.record(plan.no_runs))]
        if len(stopped.run) > plan.runs:
            differing.append(f"{_SEEDS} = {len(plan.seeds)}, but {len(stopped.run)} runs are finished")
        self._require_same(differing)


def _keys(header: Header) -> dict[str, Any]:
    """List the keys that a sweep depends on, with dots; more seeds only add to it."""
    config = parse_config(header.config, "/config")
    return {"seed": config["seed"]} | {
        f"{section}.{key}": value
        for section in _SECTIONS
        for key, value in config.get(section, {}).items()
        if f"{section}.{key}" != _SEEDS
    }


def finish_runs(
    job: Job, plan: SweepPlan, runs: RunGroup, partial: PartialSweep, options: SearchOptions, watch: Watch
) -> tuple[RunGroup, StopReason]:
    """Go on from the first run that is not finished, and keep every run as soon as it is.

    Returns
    -------
    RunGroup
        All that are finished in the end.
    StopReason
        Why no more of them are.
    """
    for number in range(len(runs), plan.runs):
        if (reason := watch.should_stop()) is not None:
            return runs, reason
        inputs = {**partial.header.inputs, "selection": plan.setting(number).selection}
        checkpoint = Checkpoint.beside(job.output, header_of(plan.study(number), inputs))
        search = Resumable(checkpoint, _left_within_a_run(checkpoint) if options.resume else None)
        with plan.naming(number):
            result = _identified(job, plan, number, search, options, watch)
        if not is_end(result.stop_reason):
            return runs, result.stop_reason
        model = None if isinstance(result, NothingFoundError) else result
        runs = runs.with_run(number % len(plan.settings), plan.seed(number), plan.parts, model)
        partial.write(plan, runs)
        search.end(result.stop_reason)
    return runs, _END


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
