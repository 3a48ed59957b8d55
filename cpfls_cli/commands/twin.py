"""Command `simulate` along a flight: its own setpoints, its autopilot's law, a simulated vehicle beside it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.flight import FlightRecord
from cpfls_cli.artifacts.job import Job, begin, finish, go_on
from cpfls_cli.artifacts.store import read_header, read_record
from cpfls_cli.artifacts.twin import GainsGroup, TwinRecord, WindowsGroup
from cpfls_cli.autopilots.registry import AUTOPILOTS
from cpfls_cli.commands.compare import to_gap
from cpfls_cli.commands.numbers import with_numbers
from cpfls_cli.config.load import stored_study
from cpfls_cli.config.study import Study, generator, settings_of
from cpfls_cli.errors import ComputationError, InputError, about
from cpfls_cli.flights.inputs import known_by
from cpfls_cli.flights.models import found_vehicle, is_found, learned_by, read_model
from cpfls_cli.flights.playback import flights_to_play, model_notes
from cpfls_cli.logs.formats import is_log, log_contents
from cpfls_cli.pages.disturbance import still_air_text
from cpfls_cli.pages.source import source_of
from cpfls_cli.pages.trust import seen_warnings
from cpfls_cli.pages.twin import answer
from cpfls_cli.playback.flight import LoggedFlight, contradictions_of
from cpfls_cli.playback.instruments import instruments
from cpfls_cli.playback.lack import Lack
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.playback.settings import VEHICLE
from cpfls_cli.playback.spread import Estimates, drawn
from cpfls_cli.report.outcome import Command, Outcome, nothing_written
from cpfls_cli.simulation.model import SimulatedEffects, played_gusts, simulated_effects, with_effects
from cpfls_cli.simulation.settings import ClosedLoopSettings
from cpfls_cli.simulation.twin import (
    CHANNELS,
    DRAWS,
    Asked,
    Comparison,
    InGusts,
    TwinFlight,
    asked_of,
    baselines,
    compared,
    fly_in_gusts,
    fly_twin,
    in_gusts,
    is_apart,
    known_axes,
    measured_channels,
    root_mean_square,
    windows,
)

CPFLS = "cpfls"


def run(job: Job, path: Path, model: Path | None) -> Outcome:
    """Fly the setpoints of a flight again and write where simulated vehicles part from it."""
    inputs = begin(job, {"flight": path} | ({} if model is None else {"model": model}))
    job = with_numbers(job, "simulate", model)
    study, (settings, gains) = job.study, with_autopilot(job.study, path)
    (flight,) = flights_to_play([path], study)
    with settings_of("simulation", study):
        effects = simulated_effects(settings.effects, study.vehicle)
        vehicles = _vehicles(study, model)
        played_gusts(list(vehicles.values())[-1], settings.gusts)
    possible = _possible(model, vehicles[model.name], study) if settings.gusts and model is not None else None
    try:
        asked = asked_of(flight, settings, study.vehicle, share=_thrust_is_share(path, study))
    except InputError as error:
        instead = go_on(job, "gap", path, output=job.beside("gap"))
        words = " ".join(map(str, instead))
        raise InputError(f"{error}. Without setpoints `{words}` says where the model of the config differs") from None
    if job.dry_run:
        return nothing_written(job)
    flown: dict[str, TwinFlight] = {}
    total = (len(vehicles) + DRAWS * settings.gusts) * len(flight.time)
    for number, (name, own) in enumerate(vehicles.items()):
        before = number * len(flight.time)
        flown[name] = fly_twin(
            flight,
            asked,
            study.vehicle,
            settings,
            *with_effects(own, effects),
            lambda done, before=before: job.progress(before + done, total),  # type: ignore[misc]
        )
    air = None
    if possible is not None:
        air = _in_gusts(job, settings, flight, asked, effects, possible, list(flown.values())[-1], len(vehicles))
    warnings = [
        *seen_warnings(VEHICLE if model is None else model.name, learned_by(model), known_by({"flight": path}, inputs)),
        *flight.warnings,
        *(note for name, own in vehicles.items() if own is not None for note in model_notes(name, own, [flight])),
        *_notes(settings, asked, gains),
    ]
    record = finish(job, record_of(flight, asked, flown, settings, gains, warnings, air), inputs)
    silent = not settings.gusts and any(own is not None and own.gusts is not None for own in vehicles.values())
    calm = [still_air_text()] if silent else []
    return Outcome(
        record.summary, (*answer(source_of(job, record)), *calm), next=tuple(_next(job, record, path, model))
    )


def _possible(path: Path, model: VehicleModel | None, study: Study) -> tuple[Sequence[VehicleModel], Lack | None]:
    """Draw vehicles that the flights of a model allow, as `cpfls spread` does; of other models there is only one."""
    assert model is not None, "it is the model that holds the gusts"
    if not is_found(path):
        return [model] * DRAWS, None
    with about(path, InputError, ComputationError):
        spread = drawn(model, Estimates.of(found_vehicle(path)), DRAWS, generator(study, "spread"))
    return spread.models, spread.lack


def _in_gusts(
    job: Job,
    settings: ClosedLoopSettings,
    flight: LoggedFlight,
    asked: Asked,
    effects: SimulatedEffects,
    possible: tuple[Sequence[VehicleModel], Lack | None],
    still: TwinFlight,
    before: int,
) -> InGusts:
    """Fly possible vehicles in gusts, with what the model lacks, and hold the flight against them."""
    (models, lack), rng, count = possible, generator(job.study, "simulate"), len(flight.time)
    flown = fly_in_gusts(
        flight,
        asked,
        job.study.vehicle,
        settings,
        models,
        effects,
        lack,
        rng,
        lambda done: job.progress(before * count + done, (before + DRAWS) * count),
    )
    return in_gusts(measured_channels(flight), still.values, flown, known_axes(models[0].gusts, lack), rng)


def record_of(
    flight: LoggedFlight,
    asked: Asked,
    flown: Mapping[str, TwinFlight],
    settings: ClosedLoopSettings,
    gains: GainsGroup,
    warnings: list[str],
    air: InGusts | None = None,
) -> TwinRecord:
    """Compare simulated vehicles, by name, with a flight, and arrange all of it."""
    measured, moved_by = measured_channels(flight), instruments([flight.playback])
    setpoint, still = baselines(flight, measured)
    found = [
        compared(flight, asked, measured, one.values, lambda given: moved_by.beside([given])[0])
        for one in flown.values()
    ]
    predicted = [*(one.values for one in flown.values()), setpoint, still]
    arrays = {
        "measured": measured,
        "setpoint": setpoint,
        **_position(flight),
        "movement": root_mean_square(measured, about_mean=True),
        "rms": np.array([root_mean_square(measured - each) for each in predicted]),
    }
    return TwinRecord.of(
        flight,
        asked,
        flown,
        found,
        arrays,
        _windows(flight, found),
        air,
        channel=CHANNELS,
        autopilot=settings.autopilot,
        gains=gains,
        left_out=AUTOPILOTS[settings.autopilot].left_out,
        rotor_lag_s=settings.rotor_time_constant_s,
        instruments=moved_by.kind,
        warning=tuple(warnings),
        contradiction=contradictions_of([flight]) or None,
    )


def _position(flight: LoggedFlight) -> dict[str, Array]:
    known = [part.position for part in flight.parts if part.position is not None]
    return {"measured_position": np.concatenate(known)} if len(known) == len(flight.parts) else {}


def _windows(flight: LoggedFlight, found: list[Comparison]) -> WindowsGroup:
    return WindowsGroup(
        start=np.array([flight.time[part.start] for part in windows(flight)]),
        difference=np.array([one.windows for one in found]),
        follows=np.array([one.follows for one in found]),
        apart=np.array([is_apart(one) for one in found]),
    )


def _vehicles(study: Study, model: Path | None) -> dict[str, VehicleModel | None]:
    """List what is simulated: the vehicle of the config, and a model; a config with open numbers has no vehicle."""
    stated: dict[str, VehicleModel | None] = {VEHICLE: None}
    if model is None:
        return stated
    given: dict[str, VehicleModel | None] = {model.name: read_model(model, study)}
    return given if study.vehicle.unknown else stated | given


def with_autopilot(study: Study, path: Path) -> tuple[ClosedLoopSettings, GainsGroup]:
    """Find whose law flies, and its gains: as stated, of the log, of the simulation that made the flight, or usual."""
    settings = study.simulation.closed_loop
    made = None if is_log(path) else stored_study(read_header(path).config, path).simulation.closed_loop
    by_simulation = made is not None and "log" not in read_header(path).inputs and made.autopilot != CPFLS
    name = settings.autopilot
    if name == CPFLS and by_simulation and made is not None:
        name = made.autopilot
    if name == CPFLS:
        raise InputError(
            f"{path}: is no planned path (cpfls/trajectory); to fly what was asked of the vehicle in it, name the "
            f"autopilot whose law flew it: --autopilot {', '.join(AUTOPILOTS)}"
        )
    autopilot = AUTOPILOTS[name]
    values, source = autopilot.defaults() | dict(settings.autopilot_parameters), "stated"
    if not settings.autopilot_parameters:
        logged = autopilot.in_log(_parameters(path))
        if logged:
            values, source = autopilot.of_log(logged), "log"
        elif by_simulation and made is not None and made.autopilot == name:
            values, source = autopilot.defaults() | dict(made.autopilot_parameters), "simulation"
        else:
            source = "defaults"
    gains = GainsGroup(source=source, name=tuple(values), value=np.array(list(values.values()), dtype=float))
    with settings_of("simulation", study):
        return replace(settings, autopilot=name, autopilot_parameters=values), gains


def _parameters(path: Path) -> Mapping[str, float | str]:
    """Read what a log, or a flight that was imported from one, knows of its autopilot."""
    if is_log(path):
        return log_contents(path, ()).parameters
    kept = read_record(path, FlightRecord).autopilot
    return {} if kept is None else kept.parameters


def _thrust_is_share(path: Path, study: Study) -> bool:
    """Tell whether a thrust setpoint is a share of the full thrust: a log's as its map says, a simulation logs N."""
    if not is_log(path):
        header = read_header(path)
        if "log" not in header.inputs:
            return False
        study = stored_study(header.config, path)
    thrust = study.import_.signals.get("setpoint_thrust")
    return thrust is not None and thrust.unit == "1"


def _notes(settings: ClosedLoopSettings, asked: Asked, gains: GainsGroup) -> Iterator[str]:
    title = AUTOPILOTS[settings.autopilot].title
    if gains.source == "defaults":
        yield (
            f"the gains are the defaults of {title}: give the log itself where it holds its parameters, or state them "
            "with --set simulation.closed_loop.autopilot_parameters={NAME: VALUE}"
        )
    if asked.thrust_from == "rotors":
        yield "no thrust setpoint is known: the thrust that the flight's own rotors gave stands for it"


def _next(job: Job, record: TwinRecord, path: Path, model: Path | None) -> Iterator[Command]:
    """Give the command that goes on: what the vehicle that parts lacks, or the model handed over."""
    last = len(record.vehicle) - 1
    if record.beyond or any(record.parts(last, channel) for channel in range(len(record.channel))):
        yield to_gap(job, [path], model)
    elif model is not None:
        yield "cpfls", "export", model, "-o", job.beside(f"{model.stem}.c")
