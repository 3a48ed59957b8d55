"""Flights for the gap workflow: artifacts or logs, as signals on one clock each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.ndimage import find_objects, label

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.flight import FlightRecord
from cpfls_cli.artifacts.store import read_record
from cpfls_cli.config.load import parse_config, validate
from cpfls_cli.config.study import Study
from cpfls_cli.effects.signals import Signals
from cpfls_cli.errors import InputError
from cpfls_cli.flightlog.smoothing import body_rate_of
from cpfls_cli.flights.imported import commanded_speed, imported, log_findings
from cpfls_cli.flights.same_vehicle import require_same_vehicle
from cpfls_cli.gap.balance.windows import Recording
from cpfls_cli.logs.formats import is_log

_LOGGED = ("attitude", "velocity", "position", "acceleration", "specific_force")
_UNIFORM = 0.01


@dataclass(frozen=True)
class Flights:
    """Flights and what to know about them."""

    recordings: tuple[Recording, ...]
    warnings: tuple[str, ...]


@dataclass(frozen=True)
class _Source:
    """A flight as it was read; `units` are those of the import that made it."""

    name: str
    signals: Mapping[str, Array]
    units: Mapping[str, str]
    warnings: tuple[str, ...]


def read_flights(paths: Sequence[Path], study: Study) -> Flights:
    """Read flights, and import those that are logs.

    Parameters
    ----------
    paths : sequence of Path
        Artifacts of the format ``cpfls/flight``, or logs that the section `import` describes.

    Raises
    ------
    InputError
        If a flight is of another vehicle, has no actuation, or is not uniform in time.
    """
    sources = [_log(path, study) if is_log(path) else _artifact(path, study) for path in paths]
    made = [_recording(source, study) for source in sources]
    recordings, said = _with_voltage([recording for recording, _ in made], sources)
    notes = [f"{source.name}: {w}" for source, (_, own) in zip(sources, made, strict=True) for w in own]
    return Flights(tuple(recordings), (*notes, *said))


def _log(path: Path, study: Study) -> _Source:
    flight = imported(path, study)
    done = tuple(f"{what} ({count})" for what, count in log_findings(flight.report).items())
    return _Source(
        path.name, FlightRecord.of_import(flight, {}).signals, _units(study), (*done, *flight.report.warnings)
    )


def _artifact(path: Path, study: Study) -> _Source:
    flight = read_record(path, FlightRecord)
    source = f"{path}: /config"
    own = validate(parse_config(flight.origin.config, source), source)
    require_same_vehicle(path, own.vehicle, study.vehicle)
    return _Source(path.name, flight.signals, _units(own) if flight.made_from("log") else {}, ())


def _units(study: Study) -> dict[str, str]:
    return {name: signal.unit for name, signal in study.import_.signals.items()}


def _recording(source: _Source, study: Study) -> tuple[Recording, tuple[str, ...]]:
    data, warnings = _known_part(source)
    time = data["time"]
    steps = np.diff(time)
    if len(time) < 2 or np.ptp(steps) > _UNIFORM * np.median(steps):
        raise InputError(f"{source.name}: its samples are not evenly spaced in time; import it with import.rate_hz")
    rate = body_rate_of(time, data.get("attitude"), data.get("body_rate"))
    if rate is None:
        rate = np.zeros((len(time), 3))
        warnings += ("neither body rates nor attitude; taken as level and at rest, so only the balance is judged",)
    optional: dict[str, Any] = {name: data.get(name) for name in _LOGGED}
    signals = Signals(
        time=time,
        body_rate=rate,
        vehicle=study.vehicle,
        voltage=data.get("voltage"),
        ground_height_m=study.gap.ground_height_m,
        **optional,
    )
    return Recording(source.name, _actuated(signals, source, data, study)), warnings


def _actuated(signals: Signals, source: _Source, data: Mapping[str, Array], study: Study) -> Signals:
    speed, commanded = data.get("rotor_speed"), False
    if speed is None:
        unit = source.units.get("rotor_command", "rad/s")
        speed = commanded_speed(data.get("rotor_command"), unit, study.vehicle.rotor_speed_max_rad_s)
        commanded = True
    rotors = len(study.vehicle.rotors)
    if speed is not None and speed.shape[1] != rotors:
        raise InputError(f"{source.name}: has {speed.shape[1]} rotors, vehicle.rotors of the config has {rotors}")
    if speed is None and "body_torque" not in data:
        raise InputError(
            f"{source.name}: has no rotor_speed, rotor_command or body_torque, so there is nothing to compare its "
            "motion with; name their columns in import.signals"
        )
    if speed is not None:
        return replace(signals, rotor_speed=speed, commanded=commanded)
    return replace(signals, stated_torque=data["body_torque"], stated_thrust=data.get("thrust"), commanded=True)


def _known_part(source: _Source) -> tuple[dict[str, Array], tuple[str, ...]]:
    """Keep the longest stretch in which everything is known."""
    count = len(source.signals["time"])
    known = np.ones(count, dtype=bool)
    for values in source.signals.values():
        known &= np.isfinite(values.reshape(count, -1)).all(axis=1)
    if known.all() and count:
        return dict(source.signals), source.warnings
    runs = [found[0] for found in find_objects(label(known)[0])]
    if not runs:
        raise InputError(f"{source.name}: no sample at which all of its signals are known")
    best = max(runs, key=lambda run: run.stop - run.start)
    time = source.signals["time"][best]
    said = f"only {time[0]:.2f} s to {time[-1]:.2f} s are used, the longest stretch in which all signals are known"
    return {name: values[best] for name, values in source.signals.items()}, (*source.warnings, said)


def _with_voltage(
    recordings: Sequence[Recording], sources: Sequence[_Source]
) -> tuple[list[Recording], tuple[str, ...]]:
    """Take a voltage in V as a share of the largest of all flights."""
    full = [_largest_volts(r.signals, s) for r, s in zip(recordings, sources, strict=True)]
    if not any(full):
        return list(recordings), ()
    scaled = [_share(r, max(full)) if volts else r for r, volts in zip(recordings, full, strict=True)]
    return scaled, (f"voltage: the largest of these flights, {max(full):.3g} V, is taken for that of a full battery",)


def _largest_volts(signals: Signals, source: _Source) -> float:
    in_volts = source.units.get("voltage", "1") != "1"
    return float(signals.voltage.max()) if in_volts and signals.voltage is not None else 0.0


def _share(recording: Recording, full: float) -> Recording:
    signals = recording.signals
    assert signals.voltage is not None, "its largest value was taken"
    return replace(recording, signals=replace(signals, voltage=signals.voltage / full))
