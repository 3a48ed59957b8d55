"""Fly a trajectory, exactly or in closed loop; or a flight's own setpoints, to see where simulator and it part."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cpfls_cli.arguments import FlownArgument
from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.gate import format_name
from cpfls_cli.artifacts.job import require_numbers
from cpfls_cli.autopilots.law import AXES
from cpfls_cli.config.check import no_body
from cpfls_cli.config.study import generator, settings_of
from cpfls_cli.effects.registry import effect as find
from cpfls_cli.effects.scales import hover_speed
from cpfls_cli.errors import ComputationError, InputError
from cpfls_cli.flightlog.results import MOTION, Flight
from cpfls_cli.flights.path import PlannedPath
from cpfls_cli.logs.formats import is_log
from cpfls_cli.report.content import Outcome
from cpfls_cli.simulation.inverse import LimitCycle, limit_cycle, measure
from cpfls_cli.simulation.inverse import simulate as fly_exactly
from cpfls_cli.simulation.model import Simulated, played_gusts, simulated_effects, with_effects
from cpfls_cli.simulation.settings import ClosedLoopSettings
from cpfls_cli.stage import Run, stage, stage_named
from cpfls_cli.stages._flight import FIGURES, STILL_AIR, WORDS, infeasible_sentence
from cpfls_cli.store import read
from cpfls_cli.vehicle.settings import VehicleSettings

if TYPE_CHECKING:
    from cpfls_cli.playback.model import VehicleModel

_MOVED = ("position", "velocity", "acceleration")
_EFFECT_FORM = "write NAME=VALUE[,VALUE...] or NAME.coefficient=VALUE, see `cpfls effects NAME`"


def option_overrides(
    mode: str | None, effect: Sequence[str] | None, gusts: bool, autopilot: str | None, **_: Any
) -> list[str]:
    """Write options as overrides of the config, which its file then holds."""
    given: dict[str, list[float] | dict[str, float]] = {}
    for text in effect or ():
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


@stage(Simulated, title="Flight", figures=FIGURES, words=WORDS, study=True, overrides=option_overrides)
def simulate(
    run: Run,
    trajectory: FlownArgument,
    model: Annotated[
        Path | None,
        typer.Option(
            "--model",
            metavar="MODEL",
            help="Fly this model of `cpfls identify`, `extend` or `vehicle` in closed loop in place of the vehicle of "
            "the config. Effects given come on top. Along a FLIGHT: fly both it and the vehicle of the config.",
        ),
    ] = None,
    mode: Annotated[
        str | None,
        typer.Option(
            "--mode",
            metavar="MODE",
            help="inverse: torques of the planned motion itself; closed-loop: an autopilot flies it, sensors log it. "
            "Overrides simulation.mode.",
        ),
    ] = None,
    effect: Annotated[  # noqa: ARG001  # the config has it
        list[str] | None,
        typer.Option(
            "--effect",
            metavar="NAME=VALUE[,VALUE...]",
            help="Fly with an effect of `cpfls effects`, in closed loop: its coefficients, then shapes; or "
            "NAME.coefficient=VALUE; may be repeated.",
        ),
    ] = None,
    gusts: Annotated[  # noqa: ARG001
        bool,
        typer.Option(
            "--gusts",
            help="Fly in the gusts that the model of `cpfls vehicle` holds, in closed loop. Along a FLIGHT: with it "
            "fly vehicles that the model allows, each in gusts of its own, to see what gusts explain.",
        ),
    ] = False,
    autopilot: Annotated[  # noqa: ARG001
        str | None,
        typer.Option(
            "--autopilot",
            metavar="NAME",
            help="px4, ardupilot, betaflight or crazyflie: its own control law flies, in closed loop; along a FLIGHT "
            "with the gains of its log.",
        ),
    ] = None,
) -> Simulated | Outcome | None:
    """Simulate a flight along a trajectory, or along the setpoints of a flight."""
    if is_log(trajectory) or format_name(trajectory) == Flight.FORMAT:
        if mode not in (None, "closed-loop"):
            raise InputError(f"{trajectory}: --mode {mode}: along a flight all is flown in closed loop; leave it out")
        return stage_named("twin").run(run, path=trajectory, model=model)
    if model is not None and mode is None:
        with settings_of("simulation", run.study):
            closed_loop = replace(run.study.simulation, mode="closed-loop")
        run.study = run.study.model_copy(update={"simulation": closed_loop})
    for why in no_body(run.study):
        run.note(why)
    _take_numbers(run, model)
    closed = run.study.simulation.mode == "closed-loop"
    if model is not None and not closed:
        raise InputError(f"{model}: no model is flown in mode inverse; leave the mode out, or add --mode closed-loop")
    run.take({"trajectory": trajectory} | ({} if model is None else {"model": model}))
    time, planned = _plan(trajectory, closed)
    flown = None if model is None else import_module("cpfls_cli.flights.models").read_anew(model, run.study)
    with settings_of("simulation", run.study):
        with_effects(flown, simulated_effects(run.study.simulation.closed_loop.effects, run.study.vehicle))
        played_gusts(flown, run.study.simulation.closed_loop.gusts)
    if run.dry_run:
        return None
    return _closed_loop(run, time, planned, flown) if closed else _inverse(run, time, planned, trajectory)


def _take_numbers(run: Run, model: Path | None) -> None:
    """Take what the config leaves open from a model; without one nothing is loaded that reads models."""
    if model is None:
        require_numbers(run, "simulate", whole=False)
        return
    import_module("cpfls_cli.stages._numbers").with_numbers(run, "simulate", model)


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


def _inverse(run: Run, time: Array, planned: dict[str, Array], trajectory: Path) -> Simulated:
    with settings_of("simulation", run.study):
        flight = fly_exactly(time, planned, run.study.vehicle, run.study.simulation, generator(run.study, "simulate"))
    if flight.infeasible and run.study.simulation.infeasible == "stop":
        problems = [infeasible_sentence(each) for each in flight.infeasible]
        gently = "fly more gently, change the vehicle, or set simulation.infeasible: report"
        # What turns about its centre of mass, and is held there, carries no weight.
        remedy = (_too_heavy(run.study.vehicle) if {*_MOVED} <= planned.keys() else "") or gently
        raise ComputationError("\n".join([*problems, f"{trajectory}: no flight was written; {remedy}"]))
    run.go_on("reduce", run.output, output=run.sibling("selection.h5"))
    return flight


def _too_heavy(vehicle: VehicleSettings) -> str:
    """Say what to check of a vehicle that its rotors cannot carry; empty for one that can hover."""
    hover, most = hover_speed(vehicle), vehicle.rotor_speed_max_rad_s
    if hover <= most:
        return ""
    return (
        f"the rotors lift {100 * (most / hover) ** 2:.2g} % of the weight at most, so nothing can be flown: check"
        " mass_kg, rotor_speed_max_rad_s and thrust_factor_n_s2 of the vehicle"
    )


def _closed_loop(run: Run, time: Array, planned: dict[str, Array], model: VehicleModel | None) -> Simulated:
    study, rng = run.study, generator(run.study, "simulate")
    if heavy := _too_heavy(study.vehicle if model is None else model.vehicle):
        raise ComputationError(heavy)
    flight = measure(time, planned, study.vehicle, study.simulation, rng, run.progress, model)
    if (cycle := limit_cycle(flight, planned)) is not None:
        run.caution(_oscillates(cycle, study.simulation.closed_loop))
    if model is not None and model.gusts is not None and not study.simulation.closed_loop.gusts:
        run.say(STILL_AIR)
    # No gap is measured against a body that is none.
    if run.found is None or not import_module("cpfls_cli.stages._numbers").why_no_body_found(run, run.found):
        run.go_on("gap", run.output, output=run.sibling("gap"))
    return flight


def _oscillates(cycle: LimitCycle, settings: ClosedLoopSettings) -> str:
    """Say that a loop oscillates at the limits of its rotors, and which setting to lower."""
    own = "yaw_frequency_hz" if AXES[cycle.axis] == "yaw" else "attitude_frequency_hz"
    key, remedy = f"{own} = {getattr(settings, own):g}", "lower it"
    if settings.law is not None:
        key, remedy = "autopilot_parameters", f"lower the gains of {settings.autopilot}; `cpfls tune` finds some"
    return (
        f"{AXES[cycle.axis]} oscillates at {cycle.frequency_hz:.2g} Hz at the limits of the rotors (a limit cycle): its"
        f" body rate is {cycle.off:.3g} rad/s rms off the plan, which has {cycle.planned:.3g}, and a rotor is asked for"
        f" what it cannot do at {100 * cycle.limited:.2g} % of the samples; simulation.closed_loop.{key}: {remedy}"
    )
