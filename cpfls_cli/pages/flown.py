"""What the stage `simulate` says of a flight, and what it writes beside the signals."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.report.outcome import Outcome
from cpfls_cli.simulation import MeasuredFlight, SimulatedEffects, SimulatedFlight
from cpfls_cli.vehicle.rotors import RotorViolation


def exact_outcome(flight: SimulatedFlight, time: Array, problems: tuple[str, ...]) -> Outcome:
    """Describe a flight of the exact vehicle.

    Parameters
    ----------
    time : array, shape (time,), s
    problems : tuple of str
        Demands that no rotor can meet, in words.
    """
    largest = _largest(flight.signals)
    summary = {**_summary(flight, time), "max_torque": largest}
    return Outcome(summary, (_first_line(time, largest),), problems)


def closed_loop_outcome(flight: MeasuredFlight, time: Array) -> Outcome:
    """Describe a flight in closed loop.

    Parameters
    ----------
    time : array, shape (time,), s
    """
    tracking = _tracking(flight)
    record = dict(_effect_rows(flight.effects))
    largest = _largest(flight.signals)
    summary = {**_summary(flight, time), "max_torque": largest, "tracking": tracking, "effects": record}
    flown = ", ".join(f"{name} = {value:g}" for name, value in record.items()) or "none"
    lines = (_first_line(time, largest), _tracking_line(**tracking), f"effects: {flown}")
    return Outcome(summary, lines, tuple(f"{violation_sentence(v, time)}; clipped" for v in flight.violations))


def _tracking(flight: MeasuredFlight) -> dict[str, Any]:
    away = np.linalg.norm(flight.position_error, axis=1)
    return {
        "position_rms_m": _rms(away),
        "position_max_m": float(away.max()),
        "attitude_rms_rad": [_rms(error) for error in flight.attitude_error.T],
    }


def _tracking_line(position_rms_m: float, position_max_m: float, attitude_rms_rad: list[float]) -> str:
    degrees = " ".join(f"{np.degrees(rms):.2g}" for rms in attitude_rms_rad)
    away = f"{position_rms_m:.3g} m rms, {position_max_m:.3g} m at most"
    return f"off the path by {away}; attitude by {degrees} deg rms (roll pitch yaw)"


def violation_sentence(violation: RotorViolation, time: Array) -> str:
    """Say what a rotor was asked for that it cannot do.

    Parameters
    ----------
    time : array, shape (time,), s
    """
    start, end = time[violation.first], time[violation.last]
    return (
        f"rotor {violation.rotor + 1}: {violation.kind} asked for at {samples(violation.count)} from {start:.2f} s to "
        f"{end:.2f} s (worst squared speed {violation.worst:.6g} rad^2/s^2)"
    )


def samples(count: int) -> str:
    """Count samples in words."""
    return f"{count} sample{'' if count == 1 else 's'}"


def noise_record(noise_std: Mapping[str, Array]) -> dict[str, Any]:
    """Arrange the noise of signals with three axes as datasets.

    Returns
    -------
    dict of str to array
        Empty without noise.
    """
    names = [name for name, std in noise_std.items() if np.shape(std) == (3,)]
    if not names:
        return {}
    return {"noise/signal": np.array(names), "noise/std": np.array([noise_std[name] for name in names])}


def effect_record(effects: SimulatedEffects) -> dict[str, Any]:
    """Arrange the effects that were flown as datasets: the truth, for who wants to compare.

    Returns
    -------
    dict of str to array
        Empty without effects.
    """
    rows = list(_effect_rows(effects))
    if not rows:
        return {}
    names, values = zip(*rows, strict=True)
    return {"effects/name": np.array(names), "effects/value": np.array(values)}


def _effect_rows(effects: SimulatedEffects) -> Iterator[tuple[str, float]]:
    for one in effects.listed:
        name = one.effect.name
        # An effect without numbers is there once.
        yield from [(f"{name}.{entry}", value) for entry, value in one.values.items()] or [(name, 1.0)]


def _summary(flight: SimulatedFlight | MeasuredFlight, time: Array) -> dict[str, Any]:
    return {
        "samples": len(time),
        "noise": sorted(flight.noise_std),
        "infeasible": [
            {"rotor": v.rotor + 1, "kind": v.kind, "first_s": float(time[v.first]), "samples": v.count}
            for v in flight.violations
        ],
    }


def _largest(signals: Mapping[str, Array]) -> list[float]:
    return [float(value) for value in np.max(np.abs(signals["torque"]), axis=0)]


def _first_line(time: Array, largest: Sequence[float]) -> str:
    return "{} samples; largest generalised torque {:.4g} {:.4g} {:.4g} N m (roll pitch yaw)".format(
        len(time), *largest
    )


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
