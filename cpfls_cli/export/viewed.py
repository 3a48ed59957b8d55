"""What is to be drawn of each kind of artifact: its quantities over the clock of the log, measured and of a model."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.diagnosis import Diagnosis, Disagreement
from cpfls_cli.config.load import stored_study
from cpfls_cli.config.study import Study
from cpfls_cli.effects.signals import HELD_OUT, RecordedFlight
from cpfls_cli.errors import InputError
from cpfls_cli.export.mcap_form import (
    ANGLES,
    AXES,
    BODY_FRAME,
    DIFFERENCE,
    MEASURED,
    MODEL,
    SETPOINT,
    WORLD_FRAME,
    Curve,
    Pose,
    Track,
    View,
)
from cpfls_cli.flightlog.results import Flight, Imported
from cpfls_cli.gap.balance.weak_flight import CHANNELS
from cpfls_cli.playback.replay import Playback
from cpfls_cli.response.flown import Responses
from cpfls_cli.result import BODY, EULER, WORLD, About, described_fields
from cpfls_cli.simulation.twin import FRAMES, UNITS, Twin
from cpfls_cli.units import known_unit

_ASKED = "setpoint_"
_FRAMES = {"body": BODY, "angles": EULER, "world": WORLD}
_OF_CONFIG = ("rotor_command", "voltage", "setpoint_thrust")
"""Signals whose unit is that of the import."""


def view_of(path: Path, given: Any, config: str) -> View:
    """Gather what is to be drawn of an artifact that was made with a config; InputError if there is nothing."""
    study = stored_study(config, path)
    for kind, made in _KINDS.items():
        if isinstance(given, kind):
            return replace(made(given, study), title=path.name, stamps=_stamps(study))
    *others, last = (kind.FORMAT for kind in _KINDS)
    raise InputError(
        f"{path}: is a {given.FORMAT}, which holds nothing over time; .mcap and .csv take {', '.join(others)} "
        f"and {last}"
    )


def _stamps(study: Study) -> tuple[str, float] | None:
    """Name the column of the log that holds its stamps, where they are in another unit than s."""
    name, unit = study.import_.time_column, study.import_.time_unit
    return None if name is None or unit == "s" or "." in name else (name, known_unit(unit).factor)


def _log_time(time: Array, begins: float) -> Array:
    return np.asarray(time + begins if np.isfinite(begins) else time)


def _axes(about: About, values: Array) -> tuple[str, ...]:
    if values.ndim == 1:
        return ()
    if values.shape[1] == len(AXES) and about.axes[1:] == ("axis",):
        return ANGLES if about.frame == EULER else AXES
    return tuple(str(number + 1) for number in range(values.shape[1]))


def _signals(
    flight: str, time: Array, signals: Mapping[str, Array], abouts: Mapping[str, About], units: Mapping[str, str]
) -> Iterator[Track]:
    """Join each setpoint with what it is a setpoint of, where both have one unit."""
    for name, values in signals.items():
        own = name.removeprefix(_ASKED)
        unit = units.get(name, abouts[name].unit)
        if own != name and own in signals and units.get(own, abouts[own].unit) == unit:
            continue
        asked = signals.get(_ASKED + own)
        joined = own == name and asked is not None and units.get(_ASKED + own, abouts[_ASKED + own].unit) == unit
        held = {SETPOINT if own != name else MEASURED: values}
        if joined and asked is not None:
            held[SETPOINT] = asked.reshape(values.shape)
        about = abouts[name]
        yield Track(
            name=own,
            time=time,
            values=held,
            unit=unit,
            frame=about.frame,
            description=about.text,
            flight=flight,
            axes=_axes(about, values),
        )


def _pose(child: str, time: Array, attitude: Array | None, position: Array | None) -> list[Pose]:
    if attitude is None:
        return []
    return [Pose(child, time, np.full_like(attitude, np.nan) if position is None else position, attitude)]


def _of_flight(given: Flight, study: Study) -> View:
    time = _log_time(given.time, given.begins)
    signals = {name: values for name, values in given.signals.items() if name != "time"}
    # Units that only the import knows.
    units = {"rotor_command": "rad/s"}
    if isinstance(given, Imported):
        units = {str(name): str(own.unit) for name, own in study.import_.signals.items() if name in _OF_CONFIG}
    return View(
        tuple(_signals("", time, signals, Flight.about_signals(), units)),
        poses=_pose(BODY_FRAME, time, given.attitude, given.position),
        on_log_clock=bool(np.isfinite(given.begins)),
    )


def _of_replay(given: Playback, _study: Study) -> View:
    begins = {flight.name: flight.begins_s for flight in given.flights}
    several, period = len(given.flights) > 1, float(given.horizon_s[0])

    def run(name: str, flight: str, starts: Array, runs: Mapping[str, Array], unit: str, about: str) -> Track:
        """Put runs one after another; the last sample of a run is the first one of the next."""
        known = {what: own[:, :-1].reshape(-1, own.shape[2]) for what, own in runs.items()}
        known[DIFFERENCE] = known[MEASURED] - known[MODEL]
        times = starts[:, None] + period * np.arange(len(given.horizon_s))
        order = np.argsort(times.ravel(), kind="stable")
        return Track(
            name=name,
            time=_log_time(times.ravel()[order], begins[flight]),
            values={what: own[order] for what, own in known.items()},
            unit=unit,
            frame=BODY if unit == "rad/s" else WORLD,
            description=about,
            flight=_short(flight) if several else "",
            axes=AXES,
        )

    drawn, about = given.drawn, "runs of the model one after another, each from a measured state"
    rates = {MEASURED: drawn.measured, MODEL: drawn.model}
    tracks = [run("body_rate", drawn.flight, drawn.start_s, rates, "rad/s", about)]
    if drawn.measured_position is not None and drawn.model_position is not None:
        positions = {MEASURED: drawn.measured_position, MODEL: drawn.model_position}
        tracks.append(run("position", drawn.flight, drawn.start_s, positions, "m", about))
    for number, worst in enumerate(given.worst, 1):
        own = {MEASURED: worst.measured[None], MODEL: worst.model[None]}
        about = f"the run in which the model is off most, number {number}"
        start = np.array([worst.start_s])
        tracks.append(run(f"worst_{number}/body_rate", worst.flight, start, own, "rad/s", about))
    for index, flight in enumerate(given.flights):
        at = np.flatnonzero(given.window_flight == index)
        tracks.append(
            Track(
                name="error_from_here",
                time=_log_time(given.window_start[at], flight.begins_s),
                values={name: given.errors_of(name)[at] for name in given.models},
                unit="rad/s",
                frame=BODY,
                description="mean norm of the error of the body rate over the horizon of a run that begins here",
                flight=_short(flight.name) if several else "",
            )
        )
    curves = [
        Curve(
            name=f"error_{signal}",
            over="horizon_s",
            x=given.horizon_s,
            values={name: given.of(name, signal).mae for name in given.models},
            description=f"mean error of {signal} by horizon, SI",
        )
        for signal in given.signals
    ]
    on_log_clock = bool(np.isfinite(list(begins.values())).any())
    return View(tracks, curves, on_log_clock=on_log_clock)


def _short(name: str) -> str:
    """Name a flight by its file without ending, in one word."""
    stem, _, part = name.partition(" (")
    return Path(stem).stem + (f"_{part.rstrip(')').replace(' ', '_')}" if part else "")


_ABOUT = {each.name: each.about for each in described_fields(RecordedFlight) if each.about}


def _flown(flights: Mapping[str, RecordedFlight]) -> Iterator[tuple[str, RecordedFlight]]:
    """List flights, each with its name for a track."""
    for own in flights.values():
        yield _short(own.name) if len(flights) > 1 else "", own


def _windows(flight: str, time: Array, values: Mapping[str, Array], about: str) -> Iterator[Track]:
    """Give gaps of windows, torque and force apart."""
    for name, unit, first in (("gap_torque", "N m", 0), ("gap_force", "N", 3)):
        own = {what: gaps[:, first : first + 3] for what, gaps in values.items()}
        if any(np.isfinite(gaps).any() for gaps in own.values()):
            yield Track(
                name=name, time=time, values=own, unit=unit, frame=BODY, description=about, flight=flight, axes=AXES
            )


def _of_disagreement(given: Disagreement, _study: Study) -> View:
    tracks: list[Track] = []
    floor, residual = given.sizes.floor, given.residual
    for index, (name, flight) in enumerate(_flown(given.recorded)):
        tracks += _signals(name, _log_time(flight.time, flight.begins), flight.signals, _ABOUT, {})
        at = np.flatnonzero(residual.flight == index)
        values = {DIFFERENCE: residual.value[at], "floor": np.broadcast_to(floor, (len(at), len(CHANNELS)))}
        about = "what inertia and rotors leave of the motion, mean over a window; measured less model"
        tracks += _windows(name, _log_time(residual.time[at], flight.begins), values, about)
    return View(tracks, on_log_clock=_on_log_clock(given.recorded))


def _on_log_clock(flights: Mapping[str, RecordedFlight]) -> bool:
    return any(np.isfinite(own.begins) for own in flights.values())


def _of_diagnosis(given: Diagnosis, _study: Study) -> View:
    tracks: list[Track] = []
    places: dict[str, tuple[str, float]] = {}
    held, residual = 0, given.residual
    for name, flight in _flown(given.recorded):
        places[flight.name] = name, flight.begins
        tracks += _signals(name, _log_time(flight.time, flight.begins), flight.signals, _ABOUT, {})
        if flight.role != HELD_OUT:
            continue
        at = np.flatnonzero(residual.flight == held)
        held += 1
        values = {"before": residual.before[at], "after": residual.after[at]}
        about = "gap of held-out windows, model as given and with the effects; measured less model"
        tracks += _windows(name, _log_time(residual.time[at], flight.begins), values, about)
    if given.run is not None:
        name, begin = places.get(given.run.flight, ("", np.nan))
        own = {MEASURED: given.run.measured, "before": given.run.before, "after": given.run.after}
        about = "free runs from measured rates, model as given and with the effects"
        tracks.append(
            Track(
                name="run/body_rate",
                time=_log_time(given.run.time, begin),
                values=own,
                unit="rad/s",
                frame=BODY,
                description=about,
                flight=name,
                axes=AXES,
            )
        )
    return View(tracks, on_log_clock=_on_log_clock(given.recorded))


def _of_response(given: Responses, _study: Study) -> View:
    curves = [
        Curve(
            name=name.replace(" ", "_"),
            over="frequency_hz",
            x=own.frequency,
            values=own.columns,
            description=f"frequency response: {name}",
        )
        for name, own in given.responses.items()
    ]
    return View((), curves)


def _of_twin(given: Twin, _study: Study) -> View:
    time, names = _log_time(given.time, given.begins), _vehicle_names(list(given.vehicles))
    vehicles = dict(zip(names, given.vehicles.values(), strict=True))
    tracks = []
    for index, channel in enumerate(given.channel):
        measured = given.measured[:, index]
        own = {MEASURED: measured, SETPOINT: given.setpoint[:, index]}
        own |= {name: each.simulated[:, index] for name, each in vehicles.items()}
        if given.in_gusts is not None and channel in given.in_gusts.channels:
            gusty = given.in_gusts.channels[channel]
            own |= {"gusts_low": gusty.low, "gusts_high": gusty.high}
        tracks.append(
            Track(
                name=channel.replace(" ", "_"),
                time=time,
                values={**own, DIFFERENCE: measured - given.judged.simulated[:, index]},
                unit=UNITS[channel],
                frame=_FRAMES[FRAMES[channel]],
                description=f"{channel} of the flight, and of vehicles simulated along its setpoints",
            )
        )
    poses = [
        pose for name, each in vehicles.items() for pose in _pose(name, time, each.simulated[:, 3:6], each.position)
    ]
    measured_pose = _pose(BODY_FRAME, time, given.measured[:, 3:6], given.measured_position)
    on_clock = bool(np.isfinite(given.begins))
    return View(tracks, poses=[*measured_pose, *poses], on_log_clock=on_clock)


def _vehicle_names(vehicles: Sequence[str]) -> list[str]:
    """Name simulated vehicles; a model whose file has the same name as something else here is named apart."""
    names, taken = [], {MEASURED, SETPOINT, DIFFERENCE, BODY_FRAME, WORLD_FRAME}
    for vehicle in vehicles:
        name = _short(vehicle)
        names.append(f"{name}_model" if name in taken else name)
        taken.add(name)
    return names


_KINDS: dict[Any, Callable[[Any, Study], View]] = {
    Flight: _of_flight,
    Playback: _of_replay,
    Disagreement: _of_disagreement,
    Diagnosis: _of_diagnosis,
    Responses: _of_response,
    Twin: _of_twin,
}
