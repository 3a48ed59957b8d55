"""Command `import`: turn a log of somebody's flight into a flight artifact."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from cpfls_cli.artifacts.flight import FlightRecord
from cpfls_cli.artifacts.job import Job, begin, finish, go_on
from cpfls_cli.consistency.findings import contradictions
from cpfls_cli.consistency.numbers import beyond_belief
from cpfls_cli.flightlog.results import ImportReport
from cpfls_cli.flights.imported import imported, log_findings
from cpfls_cli.flights.recordings import check_flight, doubts_on_voltage, read_import
from cpfls_cli.pages.flight import answer, import_blocks, missing_signals
from cpfls_cli.pages.source import source_of
from cpfls_cli.report.content import Text
from cpfls_cli.report.outcome import Command, Outcome, nothing_written


def run(job: Job, log: Path) -> Outcome:
    """Import a log and write it as a flight."""
    inputs = begin(job, {"log": log})
    flight = imported(log, job.study)
    # An import is quick, and only the whole of it shows that every key suits the log.
    if job.dry_run:
        return nothing_written(job)
    record = FlightRecord.of_import(flight, log_findings(flight.report))
    read = read_import(log.name, [flight], job.study)
    findings = (*beyond_belief(job.study.vehicle), *check_flight(read, job.study))
    wrong = (*doubts_on_voltage(read.signals, read.units), *(finding.sentence for finding in findings))
    record = finish(job, record.with_warnings((*missing_signals(record), *wrong)), inputs)
    never = contradictions(findings)
    blocks = tuple(
        replace(block, always=True) if isinstance(block, Text) and block.text in never else block
        for block in (*import_blocks(flight.report), *answer(source_of(job, record)))
    )
    return Outcome(_summary(flight.report, record), blocks, next=tuple(_next(job, record)))


def _next(job: Job, record: FlightRecord) -> Iterator[Command]:
    """Give the command that learns from the flight: a whole vehicle of rotors alone, a model of a torque."""
    if not record.lacks:
        yield go_on(job, "identify", job.output, output=job.beside("model.h5"))
    elif record.rotor_speed is not None or record.rotor_command is not None:
        yield "cpfls", "vehicle", job.config, job.output, "-o", job.beside("vehicle.h5")


def _summary(report: ImportReport, record: FlightRecord) -> dict[str, Any]:
    return {
        "samples": report.samples,
        "samples_read": report.samples_read,
        "rate_hz": report.rate_hz,
        "log_rate_hz": report.log_rate_hz,
        "cut_off_hz": dict(report.cut_off_hz),
        "updated_hz": dict(report.updated_hz),
        "lowpass_hz": report.lowpass_hz,
        "span_s": list(report.span_s),
        "gaps": report.gaps,
        "longest_gap_s": report.longest_gap_s,
        "dropped": {reason: count for reason, count in report.dropped.items() if count},
        "missing": dict(report.missing),
        "spikes": dict(report.spikes),
        "suspected_spikes": dict(report.suspected_spikes),
        "saturated": dict(report.saturated),
        "delay_s": report.delay_s,
        "delay_r2": None if report.delay is None else [float(value) for value in report.delay.r2],
        "setpoints": record.setpoints_known,
        "signals": [name for name in record.signals if name != "time"],
    }
