"""Command `spread`: vehicles drawn from what flights say of one, for simulators that fly many."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from cpfls_cli.artifacts.job import Job, check_outputs, take_inputs
from cpfls_cli.artifacts.output import write_files
from cpfls_cli.commands.vehicle_sheets import sheet_of
from cpfls_cli.errors import ComputationError, InputError, about
from cpfls_cli.export.samples import Samples, require_ending
from cpfls_cli.export.text import identifier
from cpfls_cli.flights.models import any_model, found_vehicle, is_found, is_model
from cpfls_cli.pages.export import spread_answer, spread_summary
from cpfls_cli.playback.spread import Estimates, drawn, require_sure
from cpfls_cli.report.content import Text
from cpfls_cli.report.outcome import Outcome


def run(job: Job, model: Path, count: int, seed: int, *, anyway: bool = False) -> Outcome:
    """Draw vehicles, and write them."""
    ending = require_ending(str(job.output), job.output.suffix)
    source = take_inputs(job, {"model": model})["model"]
    check_outputs(job, job.output)
    if is_model(model) and not is_found(model):
        raise InputError(
            f"{model}: is a model of `cpfls {any_model(model).MADE_BY}`, which holds no covariance of its numbers; "
            "`cpfls vehicle` finds a vehicle with one"
        )
    record = found_vehicle(model)
    sheet = sheet_of(model, identifier(model.stem), source, force=job.force, anyway=anyway)
    with about(model, InputError, ComputationError):
        require_sure(known := Estimates.of(record))
        if job.dry_run:
            return _nothing_written(job, model, count)
        spread = drawn(sheet.model, known, count, np.random.default_rng(seed))
    numbers = {number.name: number for number in known.numbers}
    samples = Samples(
        sheet=sheet,
        spread=spread,
        numbers=numbers,
        seed=seed,
        untold=record.not_determined,
        held=record.guessed,
    )
    written = samples.written(ending)
    write_files({job.output: written})
    summary = {"dry_run": False, "output": str(job.output), "bytes": len(written), **spread_summary(samples)}
    return Outcome(summary, tuple(spread_answer(samples, job.output, len(written))))


def _nothing_written(job: Job, model: Path, count: int) -> Outcome:
    line = Text(f"{job.output}: would be written; {count} vehicles would be drawn from {model}")
    return Outcome({"dry_run": True, "output": str(job.output)}, (line,))
