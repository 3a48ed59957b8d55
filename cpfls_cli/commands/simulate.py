"""Stage `simulate`: fly a trajectory, with the exact vehicle, in closed loop, or with a model that controls it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.formats import FLIGHT, TRAJECTORY
from cpfls_cli.artifacts.job import Job, begin, finish_data
from cpfls_cli.artifacts.spec import InputFile
from cpfls_cli.commands import tracking
from cpfls_cli.commands.model_in_flight import model_in_flight
from cpfls_cli.config.study import Study, generator, settings_of
from cpfls_cli.errors import ComputationError, InputError
from cpfls_cli.flights.sources import read_with
from cpfls_cli.pages.flown import closed_loop_outcome, effect_record, exact_outcome, noise_record, violation_sentence
from cpfls_cli.report.outcome import Outcome, nothing_written
from cpfls_cli.simulation import SimulatedModel, measure, simulate, simulated_effects

_TURNED = ("attitude", "attitude_rate", "attitude_acceleration")
_MOVED = ("position", "velocity", "acceleration")


def run(job: Job, trajectory: Path, model: Path | None = None, mode: str | None = None) -> Outcome:
    """Simulate a flight along a trajectory and write it.

    Parameters
    ----------
    model : Path or None
        In mode closed-loop flown in place of the vehicle of the config: one with effects, or an identified one. Without
        a mode an identified one, with which the attitude of that vehicle is controlled.
    mode : str or None
        Of the command line, which the config has too; None where it gives none.

    Raises
    ------
    InputError
        If an effect is unknown or has impossible values, or the model is of another vehicle.
    ComputationError
        If a rotor would have to do what it cannot, unless `simulation.infeasible` is ``report``, or a flight in closed
        loop loses its path.
    """
    if model is not None and mode is None:
        job = replace(job, study=_with_a_model(job.study))
    if job.study.simulation.mode == "computed-torque":
        return tracking.run(job, trajectory, _required(model))
    closed = job.study.simulation.mode == "closed-loop"
    if model is not None and not closed:
        raise InputError(
            f"{model}: no model is flown in mode inverse; leave the mode out to control the vehicle with it, or add "
            "--mode closed-loop to fly it"
        )
    inputs = begin(job, {"trajectory": trajectory} | ({} if model is None else {"model": model}))
    time, planned = _plan(trajectory, closed)
    flown = SimulatedModel() if model is None else model_in_flight(model, job.study)
    with settings_of("simulation", job.study):
        flown.with_effects(simulated_effects(job.study.simulation.closed_loop.effects, job.study.vehicle))
    if job.dry_run:
        return nothing_written(job)
    if closed:
        return _closed_loop(job, inputs, time, planned, flown)
    return _inverse(job, inputs, time, planned, trajectory)


def _with_a_model(study: Study) -> Study:
    """Let a model control the attitude, where nothing else is said."""
    if study.simulation.mode != "inverse":
        return study
    with settings_of("simulation", study):
        return study.model_copy(update={"simulation": replace(study.simulation, mode="computed-torque")})


def _required(model: Path | None) -> Path:
    if model is None:
        raise InputError("simulation.mode = computed-torque: controls the attitude with a model; add --model MODEL")
    return model


def _plan(trajectory: Path, closed: bool) -> tuple[Array, dict[str, Array]]:
    """Read times and signals of a plan; without any translation the vehicle is held at its centre of mass."""
    source = read_with(trajectory, TRAJECTORY, "time", *_TURNED)
    held = not any(name in source.data for name in _MOVED)
    if held and closed:
        raise InputError(
            f"{trajectory}: turns a vehicle that is held at its centre of mass; no autopilot flies it. Leave mode "
            "closed-loop out, or plan a path in space"
        )
    needed = _TURNED if held else _TURNED + _MOVED
    source = read_with(trajectory, TRAJECTORY, "time", *needed)
    return source.array("time"), {name: source.array(name) for name in needed}


def _inverse(
    job: Job, inputs: Mapping[str, InputFile], time: Array, planned: dict[str, Array], trajectory: Path
) -> Outcome:
    with settings_of("simulation", job.study):
        flight = simulate(planned, job.study.vehicle, job.study.simulation, generator(job.study, "simulate"))
    problems = tuple(violation_sentence(violation, time) for violation in flight.violations)
    if problems and job.study.simulation.infeasible == "stop":
        remedy = "fly gentler, change the vehicle, or set simulation.infeasible: report"
        raise ComputationError("\n".join([*problems, f"{trajectory}: no flight was written; {remedy}"]))
    finish_data(job, FLIGHT, {"time": time, **flight.signals, **noise_record(flight.noise_std)}, inputs)
    return exact_outcome(flight, time, problems)


def _closed_loop(
    job: Job, inputs: Mapping[str, InputFile], time: Array, planned: dict[str, Array], model: SimulatedModel
) -> Outcome:
    rng = generator(job.study, "simulate")
    flight = measure(time, planned, job.study.vehicle, job.study.simulation, rng, job.progress, model)
    records = {**noise_record(flight.noise_std), **effect_record(flight.effects)}
    finish_data(job, FLIGHT, {"time": time, **flight.signals, **records}, inputs)
    return closed_loop_outcome(flight, time)
