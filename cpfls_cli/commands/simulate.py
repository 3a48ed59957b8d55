"""Command `simulate`: fly a trajectory, with the exact vehicle or in closed loop."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.flight import MOTION, FlightRecord
from cpfls_cli.artifacts.job import Job, begin, finish, go_on, require_numbers
from cpfls_cli.artifacts.spec import InputFile
from cpfls_cli.artifacts.store import holds
from cpfls_cli.config.study import Study, generator, settings_of
from cpfls_cli.effects.registry import effect as find
from cpfls_cli.errors import ComputationError, InputError
from cpfls_cli.flights.path import PlannedPath
from cpfls_cli.logs.formats import is_log
from cpfls_cli.pages.disturbance import still_air_text
from cpfls_cli.pages.flight import answer, autopilot_text
from cpfls_cli.pages.source import source_of
from cpfls_cli.report.content import Text
from cpfls_cli.report.outcome import Outcome, nothing_written
from cpfls_cli.simulation.inverse import SimulatedFlight, simulate
from cpfls_cli.simulation.measured import MeasuredFlight, measure
from cpfls_cli.simulation.model import played_gusts, simulated_effects, with_effects
from cpfls_cli.stages._demand import violation_sentence
from cpfls_cli.store import read

if TYPE_CHECKING:
    from cpfls_cli.playback.model import VehicleModel

_MOVED = ("position", "velocity", "acceleration")
_EFFECT_FORM = "write NAME=VALUE[,VALUE...] or NAME.coefficient=VALUE, see `cpfls effects NAME`"


def run(job: Job, trajectory: Path, model: Path | None = None, mode: str | None = None) -> Outcome:
    """Simulate a flight along a trajectory, or along the setpoints of a flight, and write it."""
    if is_log(trajectory) or holds(trajectory, FlightRecord):
        if mode not in (None, "closed-loop"):
            raise InputError(f"{trajectory}: --mode {mode}: along a flight all is flown in closed loop; leave it out")
        return _along_flight(job, trajectory, model)
    if model is not None and mode is None:
        job = replace(job, study=_in_closed_loop(job.study))
    job = _with_numbers(job, model)
    closed = job.study.simulation.mode == "closed-loop"
    if model is not None and not closed:
        raise InputError(f"{model}: no model is flown in mode inverse; leave the mode out, or add --mode closed-loop")
    inputs = begin(job, {"trajectory": trajectory} | ({} if model is None else {"model": model}))
    time, planned = _plan(trajectory, closed)
    flown = None if model is None else import_module("cpfls_cli.flights.models").read_model(model, job.study)
    with settings_of("simulation", job.study):
        with_effects(flown, simulated_effects(job.study.simulation.closed_loop.effects, job.study.vehicle))
        played_gusts(flown, job.study.simulation.closed_loop.gusts)
    if job.dry_run:
        return nothing_written(job)
    if closed:
        return _closed_loop(job, inputs, time, planned, flown)
    return _inverse(job, inputs, time, planned, trajectory)


def _along_flight(job: Job, flight: Path, model: Path | None) -> Outcome:
    """Fly the setpoints of a flight again, as the stage does that has no command of its own."""
    stage = import_module("cpfls_cli.stage")
    given = {each.name: getattr(job, each.name) for each in fields(Job)}
    made: Outcome = stage.loaded("twin").run(stage.Run(**given), path=flight, model=model)
    # It has said them.
    job.cautions.clear()
    return made


def _with_numbers(job: Job, model: Path | None) -> Job:
    """Take what the config leaves open from a model; without one nothing is loaded that reads models."""
    if model is None:
        require_numbers(job, "simulate", whole=False)
        return job
    return import_module("cpfls_cli.commands.numbers").with_numbers(job, "simulate", model)  # type: ignore[no-any-return]


def _in_closed_loop(study: Study) -> Study:
    """Take the mode in which a model is flown, where nothing else is said."""
    with settings_of("simulation", study):
        return study.model_copy(update={"simulation": replace(study.simulation, mode="closed-loop")})


def _plan(trajectory: Path, closed: bool) -> tuple[Array, dict[str, Array]]:
    """Read times and signals of a plan; without any translation the vehicle is held at its centre of mass."""
    source, _ = read(trajectory, PlannedPath)
    if source.held and closed:
        raise InputError(
            f"{trajectory}: turns a vehicle that is held at its centre of mass; no autopilot flies it. Leave mode "
            "closed-loop out, or plan a path in space"
        )
    needed = MOTION if source.held else MOTION + _MOVED
    return source.time, {name: getattr(source, name) for name in needed}


def _inverse(
    job: Job, inputs: Mapping[str, InputFile], time: Array, planned: dict[str, Array], trajectory: Path
) -> Outcome:
    with settings_of("simulation", job.study):
        flight = simulate(planned, job.study.vehicle, job.study.simulation, generator(job.study, "simulate"))
    problems = [violation_sentence(violation, time) for violation in flight.violations]
    if problems and job.study.simulation.infeasible == "stop":
        remedy = "fly more gently, change the vehicle, or set simulation.infeasible: report"
        raise ComputationError("\n".join([*problems, f"{trajectory}: no flight was written; {remedy}"]))
    record = finish(job, FlightRecord.of_simulation({"time": time, **flight.signals}, flight.noise_std), inputs)
    warnings = (Text(problem, "warning") for problem in problems)
    to_reduce = go_on(job, "reduce", job.output, output=job.beside("selection.h5"))
    return Outcome(_summary(flight, record), (*answer(source_of(job, record)), *warnings), next=(to_reduce,))


def _closed_loop(
    job: Job, inputs: Mapping[str, InputFile], time: Array, planned: dict[str, Array], model: VehicleModel | None
) -> Outcome:
    rng = generator(job.study, "simulate")
    flight = measure(time, planned, job.study.vehicle, job.study.simulation, rng, job.progress, model)
    signals = {"time": time, **flight.signals}
    record = finish(job, FlightRecord.of_simulation(signals, flight.noise_std, flight.effects), inputs)
    errors = _path_errors(flight)
    effects = {} if record.effects is None else record.effects.by_name
    silent = model is not None and model.gusts is not None and not job.study.simulation.closed_loop.gusts
    calm = [still_air_text()] if silent else []
    clipped = (Text(f"{violation_sentence(one, time)}; clipped", "warning") for one in flight.violations)
    return Outcome(
        _summary(flight, record) | {"tracking": errors, "effects": effects},
        (autopilot_text(**errors), *calm, *answer(source_of(job, record)), *clipped),
        next=(go_on(job, "gap", job.output, output=job.beside("gap")),),
    )


def _summary(flight: SimulatedFlight | MeasuredFlight, record: FlightRecord) -> dict[str, Any]:
    infeasible = [
        {"rotor": v.rotor + 1, "kind": v.kind, "first_s": float(record.time[v.first]), "samples": v.count}
        for v in flight.violations
    ]
    noise = sorted(flight.noise_std)
    return {"samples": len(record.time), "noise": noise, "infeasible": infeasible, **record.summary}


def _path_errors(flight: MeasuredFlight) -> dict[str, Any]:
    away = np.linalg.norm(flight.position_error, axis=1)
    return {
        "position_rms_m": _rms(away),
        "position_max_m": float(away.max()),
        "attitude_rms_rad": [_rms(error) for error in flight.attitude_error.T],
    }


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def option_overrides(
    mode: str | None, effects: Sequence[str], *, gusts: bool = False, autopilot: str | None = None
) -> list[str]:
    """Write options as overrides of the config, which its artifact then holds."""
    given: dict[str, list[float] | dict[str, float]] = {}
    for text in effects:
        _add_effect(text, given)
    mode = "closed-loop" if (gusts or autopilot) and mode is None else mode
    chosen = [] if mode is None else [f"simulation.mode={mode}"]
    chosen += ["simulation.closed_loop.gusts=true"] if gusts else []
    chosen += [] if autopilot is None else [f"simulation.closed_loop.autopilot={autopilot}"]
    # JSON is YAML, and numbers keep all their digits.
    return [*chosen, *(f"simulation.closed_loop.effects.{name}={json.dumps(value)}" for name, value in given.items())]


def _add_effect(text: str, given: dict[str, list[float] | dict[str, float]]) -> None:
    key, _, written = text.partition("=")
    name, dot, entry = key.strip().partition(".")
    find(name)
    values = _numbers(text, written)
    before = given.get(name)
    if not dot and before is None:
        given[name] = values
        return
    if not dot or isinstance(before, list) or entry in (before or {}):
        raise InputError(f"--effect {text}: {name} is given twice; {_EFFECT_FORM}")
    if len(values) != 1 or not entry:
        raise InputError(f"--effect {text}: a coefficient takes one value; {_EFFECT_FORM}")
    given[name] = {**(before or {}), entry: values[0]}


def _numbers(text: str, written: str) -> list[float]:
    try:
        return [float(value) for value in written.split(",")] if written.strip() else []
    except ValueError:
        raise InputError(f"--effect {text}: {written} is not a number; {_EFFECT_FORM}") from None
