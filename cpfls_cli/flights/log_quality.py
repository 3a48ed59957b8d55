"""What an import found wrong in a log and what it did about it, in words that file, page and terminal share."""

from __future__ import annotations

from types import MappingProxyType
from typing import Final

from cpfls_cli.flightlog.results import ImportedFlight, ImportReport

_DROPPED: Final = MappingProxyType(
    {
        "time_not_finite": "time stamp that is no number: rows dropped",
        "repeated_time": "repeated time: rows dropped",
        "backward_time": "backward time: rows dropped",
        "crop": "outside import.crop_s: rows dropped",
        "incomplete_ends": "before the first or after the last value of a column: rows dropped",
        "gap": "beyond a gap longer than import.gap_s: rows dropped",
    }
)


def found_and_done(report: ImportReport) -> dict[str, int]:
    """Count what was found in a log by reason and treatment, and leave out what was not.

    Returns
    -------
    dict of str to int
        Rows, then gaps, then values of all columns together.
    """
    rows = {_DROPPED[reason]: count for reason, count in report.dropped.items()}
    gaps = {f"gaps in the time stamps, up to {report.longest_gap_s:.3g} s: interpolated": report.gaps}
    values = {
        "missing: values interpolated": report.missing,
        "spikes: values interpolated": report.spikes,
        "suspected spikes: values reported only": report.suspected_spikes,
        "saturated: values reported only": report.saturated,
    }
    counts = rows | gaps | {what: sum(by_column.values()) for what, by_column in values.items()}
    return {what: count for what, count in counts.items() if count}


def missing_signals(flight: ImportedFlight) -> tuple[str, ...]:
    """Say which later stages will refuse a flight for what its log lacks, and which key would provide it."""
    sentences = []
    if flight.attitude is None:
        sentences.append(
            "the flight has no attitude, so reduce, identify and predict will refuse it: map one with"
            " import.signals.attitude or import.signals.quaternion"
        )
    if flight.attitude is None and flight.body_rate is None:
        sentences.append(
            "the flight has neither attitude nor body rates: only the balance of its rotors where it hovers can be read"
            " from it"
        )
    if flight.body_torque is None:
        sentences.append(
            "the flight has no torque, so identify will refuse it: map one with import.signals.body_torque, or"
            " rotors with import.signals.rotor_speed or rotor_command, and name it in import.torque_source"
        )
    return tuple(sentences)
