"""The import of a flight: read, align, filter, derive."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from math import ceil
from typing import Any

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array
from cpfls_cli.blocks import blocks_of_time
from cpfls_cli.errors import ComputationError, InputError, SettingError
from cpfls_cli.flightlog import bandwidth, conversion, repair, stretches
from cpfls_cli.flightlog.flown import flown_crop, warn_of_end
from cpfls_cli.flightlog.repair import SignalTable
from cpfls_cli.flightlog.results import DelayEstimate, Imported
from cpfls_cli.flightlog.settings import MOTION, SETPOINTS, ImportSettings
from cpfls_cli.flightlog.smoothing import body_rate_of, derivative, low_pass
from cpfls_cli.flightlog.topics import hold_asked, previous_rows
from cpfls_cli.inertia import body_torque_columns
from cpfls_cli.lag import delayed, fit_delay, lagged

_LARGEST_REFINEMENT = 10  # Rows of the result for one of the log: more hold nothing new.
_SHORTEST_PERIOD_S = 1e-6
_FASTEST_HZ = 40e3  # Above the 32 kHz at which the fastest gyroscopes are read.
_FEWEST_SAMPLES = 10  # Of which a flight can be made.
_COMMANDS = ("body_torque", "thrust", "rotor_command")
# Below which most of the torque is other than that of a rigid body, and the delay is not to be trusted.
_POOR_R2 = 0.5
_STEP = 0.02  # Between delays that are tried, of the shortest period that the filter passes.
_ROUNDING = 1e-9  # Share of a step between delays, and of a torque that does not change.
_SMALLEST_WINDOW = 50  # Samples for nine numbers, and for a delay.
_ALIASING = "the log is downsampled without import.lowpass_hz below half the new rate: noise aliases into the flight"


def import_log(
    columns: Mapping[str, Array],
    settings: ImportSettings,
    *,
    rotor_torque: Callable[[Imported], Array] | None = None,
    delay_share: float = 1.0,
    stamped_hz: Mapping[str, float] | None = None,
) -> Imported:
    """Turn the columns of a log into a flight.

    Where `torque_source` names the rotors, `rotor_torque` gives the body torque, shape (time, 3), N m, FLU, from their
    signals. An estimate of the delay looks at the leading `delay_share` of it. `stamped_hz`: see `slow_signals`.
    """
    signals = apply_rotor_lag(read_signals(columns, settings, stamped_hz), settings.rotor_command_lag_s)
    if settings.torque_source in ("rotor-speed", "rotor-command"):
        if rotor_torque is None:
            raise InputError(f"import.torque_source = {settings.torque_source} needs a vehicle")
        signals = replace(signals, body_torque=rotor_torque(signals))
    return derive_flight(align_commands(signals, settings, delay_share), settings)


def read_signals(
    columns: Mapping[str, Array], settings: ImportSettings, stamped_hz: Mapping[str, float] | None = None
) -> Imported:
    """Read the mapped columns of a log, drop bad rows, repair bad values, and resample to one uniform clock.

    The result has the log's median rate, time from 0, neither shifted nor filtered. A torque that the rotors are to
    give is still None.
    """
    mapped = conversion.drop_absent_signals(columns, settings)
    # What was asked for may be absent at any time: it decides on no row.
    settings = replace(mapped, signals={name: own for name, own in mapped.signals.items() if name not in SETPOINTS})
    stamps, selected, first_stamp_s = conversion.select_columns(columns, mapped)
    read, broken = repair.mask_impossible(SignalTable(stamps, selected), mapped)
    crop, cut = flown_crop(read, settings) if settings.crop_s == "flown" else (settings.crop_s, ())
    table, dropped = repair.crop_and_order(read, settings := replace(settings, crop_s=crop))
    cut = warn_of_end(table, settings) if mapped.crop_s != "flown" else cut
    asked, table = (
        SignalTable(table.time, {name: own for name, own in table.signals.items() if (name in SETPOINTS) == setpoint})
        for setpoint in (True, False)
    )
    # Jumps that are not motion: full turns of roll and yaw, and signs of a quaternion.
    ways = {"attitude": repair.continuous_attitude, "quaternion": repair.align_quaternion_signs}
    table = SignalTable(table.time, {name: ways.get(name, np.asarray)(own) for name, own in table.signals.items()})
    spikes = repair.find_signal_spikes(table, settings)
    masked = {name: np.where(spikes[name], np.nan, values) for name, values in table.signals.items()}
    repaired = table if settings.spike_deviations is None else SignalTable(table.time, masked)
    upright, steep = stretches.near_vertical(repaired, settings)
    present = np.isfinite(np.hstack([*repaired.signals.values(), upright]))
    rows, left = repair.longest_stretch(table.time, present, settings)
    table, repaired, scattered = _on_regular_stamps(table.rows(rows), repaired.rows(rows), flat=not stamped_hz)
    resting = stretches.rotors_at_rest(table, settings)
    slow = bandwidth.slow_signals(table, stamped_hz)
    spikes, updated_hz = {name: own[rows] for name, own in spikes.items()}, {own.name: own.rate_hz for own in slow}
    counts = stretches.count_values(table, spikes, resting, settings, updated_hz)
    clock, rate_hz, hurried = _uniform_clock(table.time, settings.time_unit)
    on_clock = {name: repair.fill(table.time, values, clock) for name, values in repaired.signals.items()}
    stretches.refuse_steep_pitch(on_clock)
    converted: dict[str, Any] = {**conversion.to_program_frames(on_clock, settings)}
    setpoints, unknown = _setpoints(asked, clock, mapped, converted.get("attitude"))
    filtered = bandwidth.cut_offs(on_clock, rate_hz, slow)
    dead = stretches.warn_of_dead(table, counts["saturated"], settings)
    warnings = (
        *(*cut, *broken, *stretches.warn_of_values(counts), *dead, *stretches.warn_of_rest(table, resting, settings)),
        *(*bandwidth.warn_of_slow(slow, rate_hz), *bandwidth.warn_of_cut_offs(filtered, settings)),
        *([f"{left['gap']} rows beyond a gap are not used"] if left["gap"] else []),
        *(*steep, *scattered, *hurried, *stretches.warn_of_angles(read.signals), *unknown),
    )
    return Imported(
        time=clock - clock[0],
        **converted | setpoints,
        samples_read=len(read.time),
        samples=len(clock),
        dropped={reason: rows for reason, rows in (dropped | left).items() if rows},
        **counts,
        gaps=int((np.diff(table.time) > 1.5 * np.median(np.diff(table.time))).sum()),
        longest_gap_s=float(np.diff(table.time).max()),
        span_s=(float(clock[0]), float(clock[-1])),
        first_stamp_s=first_stamp_s,
        crop_s=crop if isinstance(crop, tuple) else None,
        log_rate_hz=rate_hz,
        rate_hz=rate_hz,
        cut_off_hz=filtered,
        updated_hz={signal.name: signal.rate_hz for signal in slow},
        repeated=tuple(signal.name for signal in slow if signal.between == "repeated"),
        warnings=warnings,
        parameters={},
        stated={},
    )


def _on_regular_stamps(
    table: SignalTable, repaired: SignalTable, *, flat: bool
) -> tuple[SignalTable, SignalTable, list[str]]:
    """Undo what the stamps of a flat log scatter by; those of topics are regular by now."""
    motion = [own for name, own in repaired.signals.items() if flat and name in MOTION]
    time, scattered = repair.regular_stamps(table.time, motion)
    return replace(table, time=time), replace(repaired, time=time), scattered


def _setpoints(
    asked: SignalTable, clock: Array, settings: ImportSettings, attitude: Array | None
) -> tuple[dict[str, Array], list[str]]:
    """Put what was asked for on a clock; what is nowhere known is left out, with a sentence."""
    held = {
        name: np.column_stack([hold_asked(asked.time, column, clock, settings.gap_s) for column in values.T])
        for name, values in asked.signals.items()
    }
    known = {name: values for name, values in held.items() if np.isfinite(values).all(axis=1).any()}
    left = [f"signal {name} is left out: it holds no setpoint in the part that is kept" for name in held.keys() - known]
    own = conversion.setpoints_to_program_frames(known, settings)
    if "attitude" in own and attitude is not None:
        # A full turn away from the vehicle's own is the same.
        own["attitude"] = attitude + rotations.wrapped(own["attitude"] - attitude)
    found: dict[str, Array] = {name: own[short] for name, short in SETPOINTS.items() if short in own}
    return found | {name: found[name][:, 0] for name in ("setpoint_thrust",) if name in found}, left


def _uniform_clock(time: Array, unit: str) -> tuple[Array, float, list[str]]:
    """Lay a clock over stamps, and say where its rate is none of a log."""
    period, span = float(np.median(np.diff(time))), float(time[-1] - time[0])
    if period < _SHORTEST_PERIOD_S or span / period > _LARGEST_REFINEMENT * len(time):
        raise InputError(
            f"import.time_column: the median step is {period:.3g} s in {span:.3g} s of {len(time)} rows, which no log"
            " has; check import.time_unit and import.time_column"
        )
    # A whole number of periods that rounding made a little short must not lose its last sample.
    samples, rate_hz = int(span / period * (1 + 1e-9) + 1e-6) + 1, 1 / period
    words = f"{rate_hz:.3g} rows a second, which no sensor of a vehicle gives: is import.time_unit = {unit} right"
    return time[0] + period * np.arange(samples), rate_hz, [words] if rate_hz >= _FASTEST_HZ else []


def derive_flight(signals: Imported, settings: ImportSettings) -> Imported:
    """Filter all signals alike, derive rates, accelerations and torques, and interpolate to `rate_hz` last.

    One filter for every signal keeps the torque equation: its linear part holds between filtered signals as it did
    between the raw ones (section 1 of the method's description). Setpoints stay as they were asked for.
    """
    filtered: dict[str, Any] = {
        name: low_pass(values, signals.log_rate_hz, settings.lowpass_hz, settings.lowpass_order)
        for name, values in signals.measured.items()
    }
    smooth = replace(signals, **filtered, lowpass_hz=settings.lowpass_hz)
    arrays: dict[str, Any] = smooth.measured | _derived(smooth)
    if settings.rate_hz is None:
        return replace(smooth, **arrays)
    from scipy.interpolate import CubicSpline

    time = _clock(smooth.time, settings.rate_hz, smooth.log_rate_hz)
    arrays = {name: CubicSpline(smooth.time, values)(time) for name, values in arrays.items()}
    previous = previous_rows(smooth.time, time)
    arrays |= {name: values[previous] for name, values in smooth.asked.items()}
    warnings, cutoff = smooth.warnings, settings.lowpass_hz
    if settings.rate_hz < smooth.log_rate_hz * 0.99 and (cutoff is None or cutoff >= settings.rate_hz / 2):
        warnings += (_ALIASING,)
    return replace(smooth, time=time, rate_hz=settings.rate_hz, samples=len(time), warnings=warnings, **arrays)


def _clock(time: Array, rate_hz: float, log_rate_hz: float) -> Array:
    samples = int(time[-1] * rate_hz + 1e-6) + 1
    if rate_hz > _LARGEST_REFINEMENT * log_rate_hz or samples < _FEWEST_SAMPLES:
        raise SettingError(
            "rate_hz",
            f"does not suit {time[-1]:.4g} s of flight at {log_rate_hz:.4g} Hz; at most {_LARGEST_REFINEMENT} times the"
            f" log's rate and at least {_FEWEST_SAMPLES} samples are possible",
        )
    return np.arange(samples) / rate_hz


def _derived(signals: Imported) -> dict[str, Array]:
    body_rate = body_rate_of(signals.time, signals.attitude, signals.body_rate)
    derived = {} if body_rate is None else {"body_rate": body_rate}
    if signals.attitude is None or body_rate is None:
        return derived
    steep = np.flatnonzero(np.abs(signals.attitude[:, 1]) > stretches.STEEPEST_PITCH)
    if len(steep):
        raise ComputationError(
            f"{stretches.VERTICAL.format(signals.time[steep[0]], ' of the flight')}: cut that part off with"
            " import.crop_s, or set import.gap_rule to longest-part; a spike is interpolated with"
            " import.spike_deviations"
        )
    attitude_rate = rotations.attitude_rate(signals.attitude, body_rate)
    derived |= {"attitude_rate": attitude_rate, "attitude_acceleration": derivative(signals.time, attitude_rate)}
    if signals.body_torque is not None:
        derived["torque"] = rotations.generalised_torque(signals.attitude, signals.body_torque)
    return derived


# Commands aligned with the motion: the lag of the rotors, and the delay between torque command and motion.


def align_commands(signals: Imported, settings: ImportSettings, delay_share: float = 1.0) -> Imported:
    """Shift torque, thrust and rotor commands by the delay, given or estimated, and drop the samples before it.

    Measured rotor speeds are motion and stay, unless the torque is computed from them. The signals are not yet
    filtered, and an estimate looks at a leading share of their samples.
    """
    estimate = None
    if settings.delay_s == "estimate":
        body_rate = body_rate_of(signals.time, signals.attitude, signals.body_rate)
        if body_rate is None or signals.body_torque is None:
            raise SettingError("delay_s", "needs a torque, and body rates or an attitude")
        filtered = (settings.delay_max_s, settings.lowpass_hz, settings.lowpass_order)
        estimate = estimate_delay(signals.time, body_rate, signals.body_torque, *filtered, share=delay_share)
    delay = estimate.delay_s if estimate else float(settings.delay_s)
    warnings = signals.warnings + (_warnings(estimate) if estimate else ())
    aligned = replace(signals, delay_s=delay, delay=estimate, warnings=warnings)
    return _shifted(aligned, delay, settings.torque_source == "rotor-speed")


def _warnings(estimate: DelayEstimate) -> tuple[str, ...]:
    low, high = 1e3 * estimate.low_s, 1e3 * estimate.high_s
    open_ = f"the estimated delay is hardly determined, {low:.0f} to {high:.0f} ms; state import.delay_s"
    poor = f"at the estimated delay, a rigid body explains only {estimate.pooled_r2:.2f} of the torque"
    holds = {
        "the estimated delay is the longest one tried; raise import.delay_max_s": estimate.at_bound,
        open_: not estimate.at_bound and estimate.high_s > estimate.delays[-1],
        poor: estimate.pooled_r2 < _POOR_R2,
        "at the estimated delay, a moment of inertia is negative; check signs and axes": estimate.inertia[:3].min() < 0,
    }
    return tuple(sentence for sentence, so in holds.items() if so)


def _shifted(signals: Imported, delay: float, speeds_command: bool) -> Imported:
    if delay == 0:
        return signals
    period = signals.time[1] - signals.time[0]
    first = int(np.ceil(delay / period - 1e-9))
    if first > len(signals.time) - 2:
        raise SettingError("delay_s", f"longer than the flight, {signals.time[-1]:.4g} s")
    time = signals.time[first:]
    cut: dict[str, Any] = {name: values[first:] for name, values in signals.signals.items()}
    for name in (*_COMMANDS, "rotor_speed") if speeds_command else _COMMANDS:
        if name in cut:
            # A cubic overshoots the steps of a command; it stays within what was commanded.
            values = signals.measured[name]
            moved = np.clip(delayed(values, delay / period), values.min(axis=0), values.max(axis=0))
            cut[name] = moved[first:]
    begin, end = signals.span_s
    cut["time"] = time - time[0]
    return replace(signals, samples=len(time), span_s=(begin + float(time[0]), end), **cut)


def estimate_delay(
    time: Array,
    body_rate: Array,
    body_torque: Array,
    delay_max_s: float = 0.2,
    lowpass_hz: float | None = None,
    lowpass_order: int = 4,
    share: float = 1.0,
) -> DelayEstimate:
    """Estimate the delay at which a rigid body explains most of the torque.

    Both sides of ``tau(t - delay) = I omegad + omega x I omega + constant`` go through the same low-pass filter.
    For evenly spaced delays up to the longest, the six inertia parameters and a constant torque about each axis are
    regressed on one common window, each axis scaled by its own standard deviation (section 8 of the method's
    description).

    On a uniform clock, s; rate and torque, commanded or of the rotors, of shape (time, 3), rad/s and N m, body frame.
    Only the leading `share` of the samples is looked at, so that data held out for a test stay unseen.
    """
    time, *pair = (own[: round(share * len(own))] for own in (time, body_rate, body_torque))
    if len(time) < 2:
        raise ComputationError("the delay cannot be estimated: fewer than two samples are in the part used for it")
    period = time[1] - time[0]
    rate, torque = (low_pass(own, 1 / period, lowpass_hz, lowpass_order) for own in pair)
    coarse = period * max(1, int(_STEP / (lowpass_hz * period)) if lowpass_hz else 1)
    window = _window(time, delay_max_s + coarse, lowpass_hz)
    count = max(1, ceil(delay_max_s / coarse - _ROUNDING))
    # One step further at both ends, so that a delay near none, or near the longest, lies between two.
    tried = delay_max_s / count * np.arange(-1, count + 2)
    scale = torque[window].std(axis=0)
    scale[scale <= _ROUNDING * np.abs(torque[window]).max(axis=0)] = 0.0
    if not scale.any():
        raise ComputationError("the delay cannot be estimated: the torque is constant")
    scale[scale == 0] = np.inf
    columns = body_torque_columns(rate, derivative(time, rate))[window] / scale[:, None]
    columns = columns - columns.mean(axis=0)

    def moved(delay: float) -> tuple[Array, Array]:
        return columns, delayed(torque, delay / period)[window] / scale

    found = fit_delay(tried, moved, blocks_of_time(window.stop - window.start, period), pooled=True)
    delay = float(np.clip(found.delay, 0.0, delay_max_s))
    own = moved(delay)[1]
    own = own - own.mean(axis=0)
    inertia = np.linalg.lstsq(columns.reshape(-1, 6), own.ravel(), rcond=None)[0]
    acting = own.any(axis=0)
    unexplained = ((own - columns @ inertia) ** 2).sum(axis=0)[acting] / (own**2).sum(axis=0)[acting]
    r2 = np.ones(3)
    r2[acting] = 1 - unexplained
    return DelayEstimate(
        delay_s=delay,
        low_s=min(max(float(found.delay - found.half), 0.0), delay),
        high_s=max(float(found.delay + found.half), delay),
        r2=r2,
        pooled_r2=float(1 - np.prod(unexplained) ** (1 / len(unexplained))),
        inertia=inertia,
        delays=tried[1:-1],
        curve=1 - found.unexplained[1:-1],
        at_bound=bool(found.delay >= delay_max_s),
    )


def _window(time: Array, longest_s: float, lowpass_hz: float | None) -> slice:
    """Leave out the filter's transients and, at the start, the longest delay that is tried."""
    edge = 0.0 if lowpass_hz is None else 0.5 / lowpass_hz
    first, last = np.searchsorted(time, [time[0] + longest_s + edge, time[-1] - edge]).tolist()
    if last - first < _SMALLEST_WINDOW:
        raise SettingError(
            "delay_max_s",
            f"too long to estimate a delay on {time[-1] - time[0]:.3g} s of flight: {max(last - first, 0)} samples"
            f" remain, and at least {_SMALLEST_WINDOW} are needed",
        )
    return slice(first, last)


def apply_rotor_lag(signals: Imported, time_constant: float) -> Imported:
    """Replace rotor commands by their first-order response in tau s, ``tau w' + w = u``, u held between samples."""
    command = signals.rotor_command
    if command is None or time_constant == 0:
        return signals
    ratio = time_constant / (signals.time[1] - signals.time[0])
    return replace(signals, rotor_command=lagged(command, ratio, "previous").start)
