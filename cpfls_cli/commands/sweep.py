"""Stage `sweep`: identify with several settings, and with several seeds each."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from cpfls_cli.artifacts.formats import SWEEP
from cpfls_cli.artifacts.job import Job, finish_data, header_of, take_inputs
from cpfls_cli.artifacts.output import check_output
from cpfls_cli.artifacts.spec import InputFile
from cpfls_cli.artifacts.state_file import StoppedSearch
from cpfls_cli.artifacts.sweep_rows import RUN, Rows, run_row, sweep_data, with_row
from cpfls_cli.commands.stopped import stopped
from cpfls_cli.config.study import generator, settings_of
from cpfls_cli.errors import InputError
from cpfls_cli.flights.judging import input_roles
from cpfls_cli.flights.same_vehicle import other_vehicles
from cpfls_cli.identification.identify import Identification, identify
from cpfls_cli.identification.search import NothingFoundError, SearchStep, StopReason, is_end
from cpfls_cli.inertia import six_parameters
from cpfls_cli.pages.sweep_words import sweep_outcome
from cpfls_cli.report.outcome import Outcome, nothing_written
from cpfls_cli.search.checkpoint import Checkpoint
from cpfls_cli.search.resumable import Resumable, SearchOptions, Watch
from cpfls_cli.search.sweep_partial import PartialSweep
from cpfls_cli.search.sweep_plan import SweepPlan, sweep_plan

_END: StopReason = "generations"


def run(
    job: Job,
    flights: Sequence[Path],
    validate: Sequence[Path],
    options: SearchOptions,
    choose_on: Sequence[Path] = (),
) -> Outcome:
    """Run every setting of a sweep with every seed.

    Parameters
    ----------
    flights : sequence of Path
        That train.
    validate : sequence of Path
        Other flights to judge the models on; nothing is learned from them.
    options : SearchOptions
        How each search is run; the time limit is for all of them together.
    choose_on : sequence of Path
        Other flights to choose models on, for settings with `identification.choice: held-out`.
    """
    options.require_one_place()
    inputs = take_inputs(job, input_roles(flights, None, validate, choose_on))
    partial = PartialSweep.beside(job.output, header_of(job.study, inputs))
    left = partial.take_up(resume=options.resume, force=job.force)
    check_output(job.output, job.force or (options.resume and partial.output_may_be_replaced()))
    plan = sweep_plan(job, flights, validate, inputs, choose_on)
    others = other_vehicles([*choose_on, *validate], job.study)
    if job.dry_run:
        return nothing_written(job)
    clock, watch = time.perf_counter(), Watch(job, options.time_limit_s)
    with partial.kept():
        rows, reason = _all_runs(job, plan, partial.rows(plan, left), partial, inputs, options, watch)
        data = sweep_data(plan, rows)
        finish_data(job, SWEEP, data, inputs)
    if is_end(reason):
        partial.remove()
    outcome = sweep_outcome(data, plan.runs, time.perf_counter() - clock)
    outcome = replace(outcome, warnings=(*others, *outcome.warnings))
    return stopped(outcome, reason, watch.signal, job.output)


def _all_runs(
    job: Job,
    plan: SweepPlan,
    rows: Rows,
    partial: PartialSweep,
    inputs: Mapping[str, InputFile],
    options: SearchOptions,
    watch: Watch,
) -> tuple[Rows, StopReason]:
    """Go on from the first run that is not finished, and keep every run as soon as it is."""
    for number in range(len(rows[f"{RUN}seed"]), plan.runs):
        if (reason := watch.should_stop()) is not None:
            return rows, reason
        header = header_of(plan.study(number), {**inputs, "selection": plan.setting(number).selection})
        search = _resumable(Checkpoint.beside(job.output, header), options.resume)
        with plan.naming(number):
            result = _identified(job, plan, number, search, options, watch)
        if not is_end(result.stop_reason):
            return rows, result.stop_reason
        rows = with_row(rows, run_row(plan, number, None if isinstance(result, NothingFoundError) else result))
        partial.write(plan, rows)
        search.end(result.stop_reason)
    return rows, _END


def _resumable(checkpoint: Checkpoint, resume: bool) -> Resumable:
    """Go on within a run, unless its checkpoint is of the run before, or damaged; from its start it ends the same."""
    left: StoppedSearch | None = None
    if resume and checkpoint.path.exists():
        try:
            left = checkpoint.read()
        except InputError:
            left = None
    return Resumable(checkpoint, left)


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
    before, own, total = plan.work(number), plan.setting(number).work, plan.work(plan.runs)
    name = f"run {number + 1} of {plan.runs}: {plan.setting(number).variant.name}, seed {plan.seed(number)}"

    def show(step: SearchStep) -> None:
        share = (step.generation + step.share) / (step.generations + 1)
        best = "" if step.best is None else f"  best error {step.best[0]:.3g}"
        job.progress(before + own * share, total, f"{name}, generation {step.generation} of {step.generations}{best}")

    return show
