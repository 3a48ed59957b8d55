"""Command `init`: look into logs, and propose a config for them with the reason of every guess."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from cpfls_cli.artifacts.job import Job, check_outputs, take_inputs
from cpfls_cli.artifacts.output import write_text
from cpfls_cli.errors import InputError
from cpfls_cli.flightlog.proposal import KnownLog, known_log, propose
from cpfls_cli.logs.formats import log_contents
from cpfls_cli.pages.proposal import Stated, answer, config_text, summary
from cpfls_cli.report.outcome import Outcome


def run(job: Job, logs: Sequence[Path], stated: Stated) -> Outcome:
    """Write a commented config for logs of one vehicle.

    Parameters
    ----------
    job : Job
        Its study is not used.
    logs : sequence of Path
        One at least; the first one leads.
    stated : Stated
        Mass and arm length, where they are said.

    Raises
    ------
    InputError
        If a log cannot be read, nothing in it flies or is recognised, or the logs are of two vehicles.
    """
    take_inputs(job, {f"log-{number}": log for number, log in enumerate(logs)})
    check_outputs(job, job.output)
    known = []
    for number, log in enumerate(logs):
        job.progress(number, len(logs), log.name)
        known.append(_known(log))
    proposal = propose(known, stated.mass_kg, stated.arm_m)
    if not job.dry_run:
        write_text(job.output, config_text(proposal, stated))
    return Outcome(summary(proposal, stated, str(job.output)), tuple(answer(proposal, stated, str(job.output))))


def _known(log: Path) -> KnownLog:
    own = log_contents(log)
    try:
        return known_log(str(log), own.topics, own.units, own.parameters, own.system)
    except InputError as error:
        raise InputError(f"{log}: {error}") from None
