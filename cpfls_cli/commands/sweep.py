"""Command `sweep`: identify with several settings, and with several seeds each."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path

from cpfls_cli.artifacts.job import Job, check_outputs, finish, header_of, take_inputs
from cpfls_cli.commands.stopped import stopped
from cpfls_cli.flights.inputs import input_roles
from cpfls_cli.flights.same_vehicle import other_vehicles
from cpfls_cli.identification.search import is_end
from cpfls_cli.pages.source import source_of
from cpfls_cli.pages.sweep import answer
from cpfls_cli.report.content import Text
from cpfls_cli.report.outcome import Outcome, nothing_written
from cpfls_cli.search.resumable import SearchOptions, Watch
from cpfls_cli.search.sweep_runs import PartialSweep, finish_runs, sweep_plan


def run(
    job: Job,
    flights: Sequence[Path],
    validate: Sequence[Path],
    options: SearchOptions,
    choose_on: Sequence[Path] = (),
) -> Outcome:
    """Run every setting of a sweep with every seed."""
    options.require_workers()
    inputs = take_inputs(job, input_roles(flights, None, validate, choose_on))
    partial = PartialSweep.beside(job.output, header_of(job.study, inputs))
    before = partial.take_up(resume=options.resume, force=job.force)
    check_outputs(job, job.output, replaceable=options.resume and partial.output_may_be_replaced())
    plan = sweep_plan(job, flights, validate, inputs, choose_on)
    others = other_vehicles([*choose_on, *validate], job.study)
    if job.dry_run:
        return nothing_written(job)
    clock, watch = time.perf_counter(), Watch(job, options.time_limit_s)
    with partial.kept():
        runs, reason = finish_runs(job, plan, partial.runs(plan, before), partial, options, watch)
        record = finish(job, plan.record(runs), inputs)
    if is_end(reason):
        partial.remove()
    seconds = round(time.perf_counter() - clock, 3)
    summary = {"runs": len(runs), "runs_in_all": plan.runs, **record.summary, "seconds": seconds}
    blocks = (*(Text(sentence, "warning") for sentence in others), *answer(source_of(job, record)))
    to_report = ("cpfls", "report", job.config, job.output, "-o", job.beside("report.html"))
    return stopped(Outcome(summary, blocks, next=(to_report,)), reason, watch.signal, job.output)
