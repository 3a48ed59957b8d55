"""Stage `import`: turn a log of somebody's flight into a flight artifact."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.formats import FLIGHT
from cpfls_cli.artifacts.job import Job, begin, finish_data
from cpfls_cli.config.study import Study, settings_of
from cpfls_cli.errors import CpflsError
from cpfls_cli.flightlog.importing import import_log
from cpfls_cli.flightlog.results import ImportedFlight
from cpfls_cli.flights.log_quality import found_and_done, missing_signals
from cpfls_cli.flights.rotor_torque import rotor_torque, rotor_torque_words
from cpfls_cli.logs.formats import read_log
from cpfls_cli.report.outcome import Outcome, nothing_written


def run(job: Job, log: Path) -> Outcome:
    """Import a log and write it as a flight.

    Parameters
    ----------
    log : Path
        In one of the formats of `cpfls_cli.logs`.

    Raises
    ------
    InputError
        If the log cannot be read or lacks columns that the config names.
    ConfigError
        If a key of the section `import` does not suit the log; the message names both.
    """
    inputs = begin(job, {"log": log})
    flight = _with_hints(imported(log, job.study))
    # An import is quick, and only the whole of it shows that every key suits the log.
    if job.dry_run:
        return nothing_written(job)
    finish_data(job, FLIGHT, {**flight_signals(flight), **_quality(flight), **_delay(flight)}, inputs)
    return _outcome(flight, job.study)


def imported(log: Path, study: Study) -> ImportedFlight:
    """Import a log in memory.

    Raises
    ------
    InputError
        If the log cannot be read or lacks columns that the config names.
    ConfigError
        If a key of the section `import` does not suit the log.
    """
    read = read_log(log, study.import_)
    with _naming(log), settings_of("import", study):
        flight = _import(read.columns, study)
    return _with_warnings(flight, read.warnings)


@contextmanager
def _naming(log: Path) -> Iterator[None]:
    try:
        yield
    except CpflsError as error:
        raise type(error)("\n".join(f"{log}: {line}" for line in str(error).splitlines())) from None


def _import(columns: dict[str, Array], study: Study) -> ImportedFlight:
    return import_log(
        columns,
        study.import_,
        rotor_torque=rotor_torque(study),
        # The delay is a parameter too: the part of the flight that is held out must not choose it.
        delay_share=study.identification.training_share,
    )


def _with_hints(flight: ImportedFlight) -> ImportedFlight:
    """Add to the warnings what later stages will miss."""
    return _with_warnings(flight, missing_signals(flight))


def _with_warnings(flight: ImportedFlight, warnings: tuple[str, ...]) -> ImportedFlight:
    return replace(flight, report=replace(flight.report, warnings=(*flight.report.warnings, *warnings)))


def flight_signals(flight: ImportedFlight) -> dict[str, Array]:
    """Arrange the signals of an import as datasets of a flight."""
    names = [spec.path for spec in FLIGHT.datasets if "/" not in spec.path]
    return {name: values for name in names if (values := getattr(flight, name)) is not None}


def _quality(flight: ImportedFlight) -> dict[str, Any]:
    counts = found_and_done(flight.report)
    quality: dict[str, Any] = {}
    if counts:
        quality["quality/reason"] = np.array(list(counts))
        quality["quality/count"] = np.array(list(counts.values()), dtype=np.int64)
    if flight.report.warnings:
        quality["quality/warning"] = np.array(flight.report.warnings)
    return quality


def _delay(flight: ImportedFlight) -> dict[str, Any]:
    delay: dict[str, Any] = {"delay/value": flight.report.delay_s}
    if flight.report.delay is not None:
        delay |= {"delay/tried": flight.report.delay.delays, "delay/r2": flight.report.delay.curve}
    return delay


def _outcome(flight: ImportedFlight, study: Study) -> Outcome:
    report = flight.report
    estimate = report.delay
    summary = {
        "samples": report.samples,
        "samples_read": report.samples_read,
        "rate_hz": report.rate_hz,
        "log_rate_hz": report.log_rate_hz,
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
        "delay_r2": None if estimate is None else [float(value) for value in estimate.r2],
        "signals": [name for name in flight_signals(flight) if name != "time"],
    }
    lines = [f"{report.samples} samples at {report.rate_hz:.4g} Hz from {report.samples_read} rows"]
    lines += [f"{what} ({count})" for what, count in found_and_done(report).items()]
    lines += rotor_torque_words(study)
    if estimate is not None:
        r2 = " ".join(f"{value:.3f}" for value in estimate.r2)
        lines.append(f"delay of motion behind command: {1e3 * report.delay_s:.1f} ms (R2 about body axes {r2})")
    return Outcome(summary, tuple(lines), report.warnings)
