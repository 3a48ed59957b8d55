"""From the columns of a log to signals on one uniform clock, in SI and the program's frames."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.flightlog.angles import refuse_steep_pitch, warn_of_angles
from cpfls_cli.flightlog.clock import longest_stretch
from cpfls_cli.flightlog.columns import select_columns
from cpfls_cli.flightlog.conversion import to_program_frames
from cpfls_cli.flightlog.presence import of_present_signals
from cpfls_cli.flightlog.quality import count_values, warn_of_values
from cpfls_cli.flightlog.repair import fill
from cpfls_cli.flightlog.results import ImportReport, LogSignals
from cpfls_cli.flightlog.settings import ImportSettings
from cpfls_cli.flightlog.table import (
    Table,
    find_table_spikes,
    in_order_and_cropped,
    made_continuous,
    without,
)


def read_signals(columns: Mapping[str, Array], settings: ImportSettings) -> LogSignals:
    """Read the mapped columns of a log, drop and repair what is bad, and put all on one uniform clock.

    Parameters
    ----------
    columns : mapping from str to array, shape (sample,)
        The log.
    settings : ImportSettings
        The section `import`.

    Returns
    -------
    LogSignals
        At the log's median rate, time from 0; neither shifted nor filtered. A torque that the rotors are to
        give is still None.

    Raises
    ------
    SettingError
        If the crop leaves fewer than two rows.
    InputError
        If columns are missing, too few signals are left, a gap is too long, the clock goes backward and stays
        behind, or the pitch is larger than any pitch.
    """
    settings = of_present_signals(columns, settings)
    read = Table(*select_columns(columns, settings))
    table, dropped = in_order_and_cropped(read, settings)
    table = made_continuous(table)
    spikes = find_table_spikes(table, settings)
    repaired = table if settings.spike_deviations is None else without(table, spikes)
    stretch = longest_stretch(table.time, np.isfinite(repaired.columns()), settings)
    dropped |= {"incomplete_ends": stretch.incomplete_ends, "gap": stretch.beyond_gap}
    table, repaired = table.rows(stretch.rows), repaired.rows(stretch.rows)
    counts = count_values(table, {name: marked[stretch.rows] for name, marked in spikes.items()}, settings)
    clock, rate_hz = _uniform_clock(table.time)
    on_clock = {name: fill(table.time, values, clock) for name, values in repaired.signals.items()}
    refuse_steep_pitch(on_clock)
    gaps, longest_gap_s = _gaps(table.time)
    report = ImportReport(
        samples_read=len(read.time),
        samples=len(clock),
        dropped=dropped,
        missing=counts.missing,
        spikes=counts.spikes,
        suspected_spikes=counts.suspected_spikes,
        saturated=counts.saturated,
        gaps=gaps,
        longest_gap_s=longest_gap_s,
        span_s=(float(clock[0]), float(clock[-1])),
        log_rate_hz=rate_hz,
        rate_hz=rate_hz,
        warnings=(*warn_of_values(counts), *_warn_of_gap(stretch.beyond_gap), *warn_of_angles(read.signals)),
    )
    return LogSignals(time=clock - clock[0], report=report, **to_program_frames(on_clock, settings))


def _uniform_clock(time: Array) -> tuple[Array, float]:
    period = float(np.median(np.diff(time)))
    # A whole number of periods that rounding made a little short must not lose its last sample.
    samples = int((time[-1] - time[0]) / period * (1 + 1e-9) + 1e-6) + 1
    return time[0] + period * np.arange(samples), 1 / period


def _gaps(time: Array) -> tuple[int, float]:
    steps = np.diff(time)
    return int((steps > 1.5 * np.median(steps)).sum()), float(steps.max())


def _warn_of_gap(rows: int) -> list[str]:
    return [f"{rows} rows beyond a gap are not used"] if rows else []
