"""Flights to be played back, all their stretches, and any file of a model as what plays them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.config.study import Study
from cpfls_cli.consistency.check import check
from cpfls_cli.consistency.findings import contradictions, doubts
from cpfls_cli.consistency.rotors import beyond_belief
from cpfls_cli.effects.signals import Signals, as_slow_as_rotors
from cpfls_cli.errors import CpflsError, InputError
from cpfls_cli.flightlog.repair import common_rate, same_rate
from cpfls_cli.flightlog.results import Imported
from cpfls_cli.flightlog.settings import SETPOINTS
from cpfls_cli.flights.recordings import (
    FEWEST,
    ReadFlight,
    all_known,
    doubts_on_voltage,
    imported,
    known_stretches,
    largest_volts,
    of_full_battery,
    read_flight,
    read_import,
    require_rotors,
    signals_of,
)
from cpfls_cli.logs.formats import is_log
from cpfls_cli.playback.errors import MOTION
from cpfls_cli.playback.flight import LoggedFlight
from cpfls_cli.playback.model import VehicleModel, commanded_anew
from cpfls_cli.playback.player import made_ready, player_of
from cpfls_cli.playback.replay import Played
from cpfls_cli.playback.rotors import Hold
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.words import joined

_ACTUATION = ("rotor_speed", "rotor_command", "body_torque")
_OPTIONAL = ("acceleration", "specific_force", "voltage", "thrust", "rotor_command")
_MOST_PARTS = 50


def flights_to_play(paths: Sequence[Path], study: Study, hold: Hold | None = None) -> tuple[LoggedFlight, ...]:
    """Read flights of one rate, and import those that are logs; `hold` is what a speed is between samples, or usual."""
    read = [
        read_import(path.name, _parts(path, study), study) if is_log(path) else read_flight(path, study)
        for path in paths
    ]
    pairs = [(_flight(flight, study, hold), flight.units) for flight in read]
    full = max(largest_volts(part, units) for flight, units in pairs for part in flight.parts)
    flights = [
        replace(flight, parts=tuple(of_full_battery(part, units, full) for part in flight.parts))
        for flight, units in pairs
    ]
    first = flights[0]
    rates = [1 / flight.parts[0].period for flight in flights]
    for flight, rate in zip(flights[1:], rates[1:], strict=True):
        if not same_rate([rates[0], rate]):
            raise InputError(
                f"{flight.name}: sampled at {rate:.4g} Hz, {first.name} at {rates[0]:.4g} Hz, but all flights need the"
                f" same rate: use --set import.rate_hz={common_rate(rates):g} for logs, and import flights again with"
                " it"
            )
    stated = doubts(beyond_belief(study.vehicle))
    return (replace(first, warnings=(*stated, *first.warnings)), *flights[1:])


def _parts(path: Path, study: Study) -> list[Imported]:
    """Import all parts of a log between its long gaps, in time."""
    longest = _importing(study, gap_rule="longest-part")
    first = imported(path, longest)
    # A delay that is estimated is estimated once, on the longest part.
    others = _importing(longest, delay_s=first.delay_s)
    parts, left = [first], _around(first, first.crop_s or (0.0, np.inf))
    while left and len(parts) < _MOST_PARTS:
        begin, end = left.pop(0)
        try:
            part = imported(path, _importing(others, crop_s=(begin, end)))
        except CpflsError:
            # Too little is left there to be a flight.
            continue
        parts.append(part)
        left += _around(part, (begin, end))
    return sorted(parts, key=lambda part: part.span_s[0])


def _importing(study: Study, **changes: Any) -> Study:
    return study.model_copy(update={"import_": replace(study.import_, **changes)})


def _around(part: Imported, crop: tuple[float, float]) -> list[tuple[float, float]]:
    """List what a part leaves of a log before and behind itself, where it has a gap there."""
    if not part.dropped.get("gap"):
        return []
    begin, end = part.span_s
    apart = 0.5 / part.log_rate_hz
    return [(a, b) for a, b in ((crop[0], begin - apart), (end + apart, crop[1])) if b - a > FEWEST * apart]


def _flight(flight: ReadFlight, study: Study, hold: Hold | None) -> LoggedFlight:
    actuation = next((name for name in _ACTUATION if name in flight.signals), None)
    if actuation is None:
        raise InputError(
            f"{flight.name}: has no rotor_speed, rotor_command or body_torque, so nothing drives a playback; name "
            "their columns in import.signals"
        )
    if actuation != "body_torque":
        require_rotors(study)
    driven = {name: flight.signals[name] for name in ("time", *MOTION, actuation) if name in flight.signals}
    stretches = known_stretches(flight.name, all_known(driven), driven["time"])
    made = [signals_of(flight, _known(flight, actuation, part), study) for part in stretches]
    parts = tuple(signals for signals, _ in made)
    findings = check(parts, study.gap)
    warnings = [
        *flight.warnings,
        *made[0][1],
        *_warnings(flight, stretches, parts[0]),
        *doubts_on_voltage(flight.signals, flight.units),
        *doubts(findings),
    ]
    # What rotors that are logged rarely do is known averaged alone, and so is the motion that it is compared with.
    slow = parts[0].rotor_span_s
    parts = tuple(as_slow_as_rotors(part) for part in parts)
    if slow:
        warnings.append(f"motion is averaged as rotors are that are known every {slow:.2g} s; errors are those of it")
    usual: Hold = "linear" if actuation == "rotor_speed" or slow else "previous"
    words = {
        "rotor_speed": "measured rotor speeds",
        "rotor_command": "rotor commands",
        "body_torque": "stated torque and thrust" if parts[0].thrust is not None else "stated torque",
    }
    named = tuple(f"{flight.name}: {warning}" for warning in warnings)
    wrong = contradictions(finding.of(flight.name) for finding in findings)
    shares = actuation == "rotor_command" and flight.units.get(actuation) == "1"
    updated = flight.updated_hz.get(actuation)
    about = (words[actuation], named, wrong)
    return LoggedFlight(parts, hold or usual, *about, shares=shares, updated_hz=updated, system=flight.system)


def _known(flight: ReadFlight, actuation: str, part: slice) -> dict[str, Array]:
    """Cut out a stretch, with what is known in all of it and what was asked for."""
    names = [name for name in ("time", *MOTION, actuation) if name in flight.signals]
    optional = [name for name in _OPTIONAL if name in flight.signals and np.isfinite(flight.signals[name][part]).all()]
    asked = [name for name in SETPOINTS if name in flight.signals]
    return {name: flight.signals[name][part] for name in (*names, *optional, *asked)}


def _warnings(flight: ReadFlight, stretches: Sequence[slice], signals: Signals) -> list[str]:
    warnings = []
    used, samples = sum(part.stop - part.start for part in stretches), len(flight.signals["time"])
    if len(stretches) > 1 or used < samples:
        warnings.append(
            f"{len(stretches)} stretches without a pause, {used} of {samples} samples; no window spans two of them"
        )
    lacks = [name for name in ("attitude", "velocity") if getattr(signals, name) is None]
    if signals.rotor_speed is None and signals.stated_thrust is None:
        lacks.append("thrust")
    if lacks:
        warnings.append(f"lacks {' and '.join(lacks)}, so only rotation is played back")
    return warnings


def played(model: VehicleModel, flight: LoggedFlight, stated: VehicleSettings) -> Played:
    """Make a flight and a model ready for playback, with the vehicle that the config states to compare with."""
    # A log of another rate holds commands for another time than those that the model was found in.
    along, player = made_ready(commanded_anew(model, flight.held_s), flight)
    if model.is_rigid_body and model.vehicle == stated and model.fuzzy is None:
        return Played(along, player, player)
    # The stated vehicle has no lag and no filter.
    logged = flight.playback
    as_logged = replace(along, speed=logged.speed, wrench=logged.wrench, hold=logged.hold)
    return Played(along, player, player_of(VehicleModel(vehicle=stated), as_logged))


def model_notes(name: str, model: VehicleModel, flights: Sequence[LoggedFlight]) -> Iterator[str]:
    """Say what a model of this name does to flights, and what it lacks in them."""
    audit = model.repairs
    for repair in () if audit is None else (*audit.settled, *(finding.sentence for finding in audit.named)):
        yield f"{name} takes a fault of the sensors out of the flights first: {repair}"
    still = [flight.name for flight in flights if model.feels_air and not flight.playback.translates]
    if still:
        yield f"{name} depends on the velocity through the air, which is taken as 0 in {joined(still)}"
