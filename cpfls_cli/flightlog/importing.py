"""The import of a flight: read, align, filter, derive."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from math import pi
from typing import Any

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array
from cpfls_cli.errors import ComputationError, InputError, SettingError
from cpfls_cli.flightlog.alignment import align_commands, apply_rotor_lag
from cpfls_cli.flightlog.bandwidth import cut_offs, slow_signals, warn_of_cut_offs, warn_of_slow
from cpfls_cli.flightlog.conversion import (
    drop_absent_signals,
    first_stamp,
    select_columns,
    setpoints_to_program_frames,
    to_program_frames,
)
from cpfls_cli.flightlog.flown import flown_crop, warn_of_end
from cpfls_cli.flightlog.repair import (
    SignalTable,
    crop_and_order,
    fill,
    find_signal_spikes,
    longest_stretch,
    make_continuous,
    mask_impossible,
)
from cpfls_cli.flightlog.results import ImportedFlight, ImportReport, LogSignals
from cpfls_cli.flightlog.settings import SETPOINTS, ImportSettings
from cpfls_cli.flightlog.smoothing import body_rate_of, derivative, low_pass
from cpfls_cli.flightlog.stretches import (
    count_values,
    refuse_steep_pitch,
    rotors_at_rest,
    warn_of_angles,
    warn_of_dead,
    warn_of_rest,
    warn_of_values,
)
from cpfls_cli.flightlog.topics import hold_asked, previous_rows

_STEEPEST_PITCH = pi / 2 - pi / 180
_LARGEST_REFINEMENT = 10  # Rows of the result for one of the log: more hold nothing new.
_SHORTEST_PERIOD_S = 1e-6
_FASTEST_HZ = 40e3  # Above the 32 kHz at which the fastest gyroscopes are read.
_FEWEST_SAMPLES = 10  # Of which a flight can be told.
_ALIASING = "the log is downsampled without import.lowpass_hz below half the new rate: noise aliases into the flight"


def import_log(
    columns: Mapping[str, Array],
    settings: ImportSettings,
    *,
    rotor_torque: Callable[[LogSignals], Array] | None = None,
    delay_share: float = 1.0,
    stamped_hz: Mapping[str, float] | None = None,
) -> ImportedFlight:
    """Turn the columns of a log into a flight.

    Parameters
    ----------
    columns : mapping from str to array, shape (sample,)
        The log.
    rotor_torque : callable, optional
        Body torque, array of shape (time, 3), N m, FLU, from the signals of the rotors; called where
        `torque_source` names the rotors.
    delay_share : float
        Leading share of the flight that an estimate of the delay may look at.
    stamped_hz : mapping from str to float, optional
        See `slow_signals`.
    """
    signals = apply_rotor_lag(read_signals(columns, settings, stamped_hz), settings.rotor_command_lag_s)
    if settings.torque_source in ("rotor-speed", "rotor-command"):
        if rotor_torque is None:
            raise InputError(f"import.torque_source = {settings.torque_source} needs a vehicle")
        signals = replace(signals, body_torque=rotor_torque(signals))
    return derive_flight(align_commands(signals, settings, delay_share), settings)


def read_signals(
    columns: Mapping[str, Array], settings: ImportSettings, stamped_hz: Mapping[str, float] | None = None
) -> LogSignals:
    """Read the mapped columns of a log, drop bad rows, repair bad values, and resample to one uniform clock.

    The result has the log's median rate, time from 0, neither shifted nor filtered. A torque that the rotors are to
    give is still None.
    """
    mapped = drop_absent_signals(columns, settings)
    # What was asked for may be absent at any time: it decides on no row.
    settings = replace(mapped, signals={name: own for name, own in mapped.signals.items() if name not in SETPOINTS})
    read, broken = mask_impossible(SignalTable(*select_columns(columns, mapped)), mapped)
    crop, cut = flown_crop(read, settings) if settings.crop_s == "flown" else (settings.crop_s, ())
    settings = replace(settings, crop_s=crop)
    table, dropped = crop_and_order(read, settings)
    cut = warn_of_end(table, settings) if mapped.crop_s != "flown" else cut
    asked, table = (
        SignalTable(table.time, {name: own for name, own in table.signals.items() if (name in SETPOINTS) == setpoint})
        for setpoint in (True, False)
    )
    table = make_continuous(table)
    spikes = find_signal_spikes(table, settings)
    masked = {name: np.where(spikes[name], np.nan, values) for name, values in table.signals.items()}
    repaired = table if settings.spike_deviations is None else SignalTable(table.time, masked)
    present = np.isfinite(np.hstack(list(repaired.signals.values())))
    rows, incomplete_ends, beyond_gap = longest_stretch(table.time, present, settings)
    table, repaired = table.rows(rows), repaired.rows(rows)
    resting = rotors_at_rest(table, settings)
    counts = count_values(table, {name: marked[rows] for name, marked in spikes.items()}, resting, settings)
    clock, rate_hz = _uniform_clock(table.time)
    on_clock = {name: fill(table.time, values, clock) for name, values in repaired.signals.items()}
    refuse_steep_pitch(on_clock)
    setpoints, unknown = _setpoints(asked, clock, mapped)
    slow = slow_signals(table, stamped_hz)
    filtered = cut_offs(on_clock, rate_hz, slow)
    warnings = (
        *(*cut, *broken, *warn_of_values(counts), *warn_of_dead(table, tuple(counts["saturated"]), settings)),
        *(*warn_of_rest(table, resting, settings), *warn_of_slow(slow, rate_hz), *warn_of_cut_offs(filtered, settings)),
        *([f"{beyond_gap} rows beyond a gap are not used"] if beyond_gap else []),
        *(*_warn_of_clock(rate_hz, settings), *warn_of_angles(read.signals), *unknown),
    )
    report = ImportReport(
        samples_read=len(read.time),
        samples=len(clock),
        dropped=dropped | {"incomplete_ends": incomplete_ends, "gap": beyond_gap},
        missing=counts["missing"],
        spikes=counts["spikes"],
        suspected_spikes=counts["suspected_spikes"],
        saturated=counts["saturated"],
        gaps=int((np.diff(table.time) > 1.5 * np.median(np.diff(table.time))).sum()),
        longest_gap_s=float(np.diff(table.time).max()),
        span_s=(float(clock[0]), float(clock[-1])),
        first_stamp_s=first_stamp(columns, mapped),
        crop_s=crop if isinstance(crop, tuple) else None,
        log_rate_hz=rate_hz,
        rate_hz=rate_hz,
        cut_off_hz=filtered,
        updated_hz={signal.name: signal.rate_hz for signal in slow},
        warnings=warnings,
        parameters={},
        stated={},
    )
    converted = to_program_frames(on_clock, settings)
    if "attitude" in setpoints and "attitude" in converted:
        # A full turn beside the vehicle's own is the same.
        away = rotations.wrapped(setpoints["attitude"] - converted["attitude"])
        setpoints["attitude"] = converted["attitude"] + away
    return LogSignals(time=clock - clock[0], setpoints=setpoints, report=report, **converted)


def _setpoints(asked: SignalTable, clock: Array, settings: ImportSettings) -> tuple[dict[str, Array], list[str]]:
    """Put what was asked for on a clock; what is nowhere known is left out, with a sentence."""
    held = {
        name: np.column_stack([hold_asked(asked.time, column, clock, settings.gap_s) for column in values.T])
        for name, values in asked.signals.items()
    }
    known = {name: values for name, values in held.items() if np.isfinite(values).all(axis=1).any()}
    left = [f"signal {name} is left out: it holds no setpoint in the part that is kept" for name in held.keys() - known]
    return setpoints_to_program_frames(known, settings), left


def _uniform_clock(time: Array) -> tuple[Array, float]:
    period = float(np.median(np.diff(time)))
    if period < _SHORTEST_PERIOD_S or (time[-1] - time[0]) / period > _LARGEST_REFINEMENT * len(time):
        raise InputError(
            f"import.time_column: the median step is {period:.3g} s in {time[-1] - time[0]:.3g} s of {len(time)} rows,"
            " which no log has; check import.time_unit and import.time_column"
        )
    # A whole number of periods that rounding made a little short must not lose its last sample.
    samples = int((time[-1] - time[0]) / period * (1 + 1e-9) + 1e-6) + 1
    return time[0] + period * np.arange(samples), 1 / period


def _warn_of_clock(rate_hz: float, settings: ImportSettings) -> list[str]:
    unit = settings.time_unit
    words = f"{rate_hz:.3g} rows a second, which no sensor of a vehicle gives: is import.time_unit = {unit} right"
    return [words] if rate_hz >= _FASTEST_HZ else []


def derive_flight(signals: LogSignals, settings: ImportSettings) -> ImportedFlight:
    """Filter all signals alike and derive rates, accelerations and torques.

    One filter for every signal keeps the torque equation: its linear part holds between filtered signals as it did
    between the raw ones. The result is interpolated to `rate_hz` last. Setpoints stay as they were asked for.

    Parameters
    ----------
    signals : LogSignals
        With the body torque, aligned.

    References
    ----------
    Section 1 of the method's description.
    """
    filtered: dict[str, Any] = {
        name: low_pass(values, signals.report.log_rate_hz, settings.lowpass_hz, settings.lowpass_order)
        for name, values in signals.arrays.items()
    }
    smooth = replace(signals, **filtered)
    arrays = smooth.arrays | _derived(smooth)
    time, setpoints = smooth.time, dict(smooth.setpoints)
    report = replace(signals.report, lowpass_hz=settings.lowpass_hz)
    if settings.rate_hz is not None:
        from scipy.interpolate import CubicSpline

        time = _clock(time, settings.rate_hz, report.log_rate_hz)
        arrays = {name: CubicSpline(smooth.time, values)(time) for name, values in arrays.items()}
        previous = previous_rows(smooth.time, time)
        setpoints = {name: values[previous] for name, values in setpoints.items()}
        warnings, cutoff = report.warnings, settings.lowpass_hz
        if settings.rate_hz < report.log_rate_hz * 0.99 and (cutoff is None or cutoff >= settings.rate_hz / 2):
            warnings += (_ALIASING,)
        report = replace(report, rate_hz=settings.rate_hz, samples=len(time), warnings=warnings)
    return ImportedFlight(time=time, setpoints=setpoints, report=report, **arrays)


def _clock(time: Array, rate_hz: float, log_rate_hz: float) -> Array:
    samples = int(time[-1] * rate_hz + 1e-6) + 1
    if rate_hz > _LARGEST_REFINEMENT * log_rate_hz or samples < _FEWEST_SAMPLES:
        raise SettingError(
            "rate_hz",
            f"does not suit {time[-1]:.4g} s of flight at {log_rate_hz:.4g} Hz; at most {_LARGEST_REFINEMENT} times the"
            f" log's rate and at least {_FEWEST_SAMPLES} samples are possible",
        )
    return np.arange(samples) / rate_hz


def _derived(signals: LogSignals) -> dict[str, Array]:
    derived: dict[str, Array] = {}
    body_rate = body_rate_of(signals.time, signals.attitude, signals.body_rate)
    if body_rate is not None:
        derived["body_rate"] = body_rate
    if signals.attitude is None or body_rate is None:
        return derived
    steep = np.flatnonzero(np.abs(signals.attitude[:, 1]) > _STEEPEST_PITCH)
    if len(steep):
        raise ComputationError(
            f"pitch comes within a degree of +-90 degrees at {signals.time[steep[0]]:.3f} s of the flight, where"
            " Euler rates are not defined: cut that part off with import.crop_s"
        )
    attitude_rate = rotations.attitude_rate(signals.attitude, body_rate)
    derived |= {"attitude_rate": attitude_rate, "attitude_acceleration": derivative(signals.time, attitude_rate)}
    if signals.body_torque is not None:
        derived["torque"] = rotations.generalised_torque(signals.attitude, signals.body_torque)
    return derived
