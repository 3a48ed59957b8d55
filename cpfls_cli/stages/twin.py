"""Fly a flight's own setpoints by its autopilot's law and simulated vehicles: `cpfls simulate` along a flight."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from cpfls_cli.artifacts.gate import read_origin
from cpfls_cli.artifacts.job import go_on
from cpfls_cli.autopilots.registry import AUTOPILOTS
from cpfls_cli.config.load import stored_study
from cpfls_cli.config.study import Study, generator, settings_of
from cpfls_cli.errors import ComputationError, InputError, about
from cpfls_cli.flightlog.results import Imported
from cpfls_cli.flights.models import found_vehicle, is_found, learned_by, read_anew
from cpfls_cli.flights.playback import flights_to_play, model_notes
from cpfls_cli.flights.recordings import read_whole
from cpfls_cli.flights.training import known_by
from cpfls_cli.logs.formats import is_log, log_contents
from cpfls_cli.pages.gap import MEASURED
from cpfls_cli.pages.trust import contradicted, seen_warnings
from cpfls_cli.playback.flight import LoggedFlight
from cpfls_cli.playback.lack import Lack
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.playback.settings import VEHICLE
from cpfls_cli.playback.spread import drawn
from cpfls_cli.report.canvas import (
    BASELINE,
    HELD,
    Drawn,
    Figure,
    band,
    legend_over,
    line,
    logarithmic,
    plain_ticks,
    stacked,
    style_of,
)
from cpfls_cli.response.spectra import decibels, degrees
from cpfls_cli.simulation.closed_loop import ClosedLoop
from cpfls_cli.simulation.model import played_gusts, simulated_effects, with_effects
from cpfls_cli.simulation.settings import ClosedLoopSettings
from cpfls_cli.simulation.twin import (
    DRAWS,
    UNITS,
    Asked,
    InGusts,
    Twin,
    TwinChannel,
    TwinGains,
    TwinVehicle,
    asked_of,
    fly_in_gusts,
    fly_twin,
    in_gusts,
    known_axes,
    measured_channels,
    twin_of,
)
from cpfls_cli.stage import Run, stage
from cpfls_cli.stages._flight import STILL_AIR
from cpfls_cli.stages._numbers import with_numbers
from cpfls_cli.stages.compare import to_gap
from cpfls_cli.words import by_name

_CPFLS = "cpfls"
_SHOWN_S = 6.0
_BEFORE: dict[str, Any] = {**style_of(2), "linewidth": 1.4, "zorder": 3}
_AFTER: dict[str, Any] = {**style_of(1), "linewidth": 1.4, "zorder": 3.5}


def _named(vehicle: str) -> str:
    """Name a simulated vehicle in a sentence."""
    return "the vehicle of the config" if vehicle == VEHICLE else vehicle


def _unit(channel: str) -> str:
    return UNITS[channel].replace("^2", "²")


def _styles(r: Twin) -> list[dict[str, Any]]:
    """Draw the last vehicle as the one after, others as those before."""
    return [*[_BEFORE] * (len(r.vehicles) - 1), _AFTER]


def _shown(r: Twin) -> list[int]:
    """List the channels that are worth drawing: those judged, or the rates."""
    return [r.channel.index(name) for name in r.judged.judged] or [0, 1, 2]


def stretch_of(r: Twin) -> tuple[list[str], float]:
    """Choose the channels, and the middle, s, of the stretch that is drawn: where the vehicles are farthest apart."""
    first = next(iter(r.vehicles.values())).channels
    names = [r.channel[index] for index in _shown(r) if index < 6][:6]
    follows = np.array([first[name].follows for name in names])
    away = follows if np.isfinite(follows).any() else np.array([first[name].difference for name in names])
    moved = np.array([r.movement[name] for name in names])
    away = np.nan_to_num(away.T) / np.maximum(moved, 1e-12)
    window, worst = np.unravel_index(int(np.argmax(away)), away.shape)
    axis = r.channel.index(names[int(worst)]) % 3
    rows = [r.channel[at] for at in (axis, axis + 3) if np.isfinite(r.moved[at])]
    return rows, float(r.window_start[window]) + 0.5


def _stretch(r: Twin, figure: Figure) -> None:
    """Draw flight and vehicles around the second in which they are farthest apart for what they move."""
    rows, middle = stretch_of(r)
    shown = np.abs(r.time - middle) <= _SHOWN_S / 2
    blown = blown_of(r)
    panels = stacked(figure, len(rows) + len(blown))
    for axes, name in zip(panels, rows, strict=False):
        index = r.channel.index(name)
        line(axes, r.time[shown], r.measured[shown, index], label="flight", **MEASURED)
        if np.isfinite(r.setpoint[shown, index]).any():
            line(axes, r.time[shown], r.setpoint[shown, index], label="setpoint", **BASELINE)
        for (vehicle, own), style in zip(r.vehicles.items(), _styles(r), strict=True):
            line(axes, r.time[shown], own.simulated[shown, index], label=_named(vehicle), **style)
        axes.set_ylabel(f"{name}, {_unit(name)}")
    for axes, name in zip(panels[len(rows) :], blown, strict=True):
        assert r.in_gusts is not None, "some are held"
        # How far the flight is off from the last vehicle, within what vehicles in gusts are.
        index, gusty = r.channel.index(name), r.in_gusts.channels[name]
        still = r.judged.simulated[shown, index]
        band(axes, r.time[shown], gusty.low[shown] - still, gusty.high[shown] - still, color="#c9c9c9")
        style = MEASURED | {"linewidth": 1.4}
        line(axes, r.time[shown], r.measured[shown, index] - still, label="flight", **style)
        axes.set_ylabel(f"difference, {_unit(name)}")
    panels[-1].set_xlabel("s")
    legend_over(figure, panels[0])


def blown_of(r: Twin) -> list[str]:
    """Name the channel of the stretch that is drawn that gusts are known of, in a list that may be empty."""
    return [name for name in stretch_of(r)[0][:1] if r.in_gusts is not None and name in r.in_gusts.channels]


def _frequency(r: Twin, figure: Figure) -> None:
    """Draw how much stronger and earlier the simulated vehicles answer, by frequency."""
    names = [r.channel[index] for index in _shown(r)[:3]]
    panels = figure.subplots(2, len(names), sharex=True, sharey="row", squeeze=False)
    every = np.concatenate([own.frequency for one in r.vehicles.values() for own in one.channels.values()])
    steps = (1,) if len(names) > 2 else (1, 2, 5)
    for column, name in enumerate(names):
        for number, ((vehicle, own), style) in enumerate(zip(r.vehicles.items(), _styles(r), strict=True)):
            if own.channels[name].band is not None:
                _ratio(panels[:, column], own.channels[name], _named(vehicle), style, first=number == 0)
        panels[0, column].set_title(name)
        panels[1, column].set_xlabel("Hz")
        logarithmic(panels[1, column], every.min(), every.max(), steps)
    panels[0, 0].set_ylabel("simulated over flight, dB")
    panels[1, 0].set_ylabel("degrees")
    legend_over(figure, panels[0, 0])


def _ratio(panels: Any, own: TwinChannel, name: str, style: dict[str, Any], *, first: bool) -> None:
    assert own.band is not None, "it is judged"
    inside = (own.frequency >= own.band[0]) & (own.frequency <= own.band[1])
    ratio, scatter = (own.model / own.gain)[inside], 2 * own.random_error[inside]
    halves = (20 * np.log10(1 + scatter), np.degrees(scatter))
    for axes, values, half in zip(panels, (decibels(ratio), degrees(ratio)), halves, strict=True):
        if first:
            band(axes, own.frequency[inside], -half, half, color="#c9c9c9", label="95 %")
            axes.axhline(0.0, **HELD)
        axes.plot(own.frequency[inside], values, label=name, **style)
        plain_ticks(axes.yaxis)


def _seconds(r: Twin, figure: Figure) -> None:
    """Draw second by second how much of the difference is the simulator's."""
    names = [r.channel[index] for index in _shown(r) if index < 6][:3]
    panels = stacked(figure, len(names))
    for axes, name in zip(panels, names, strict=True):
        axes.axhline(r.judged.channels[name].floor, label="gusts and noise", **BASELINE)
        for (vehicle, own), style in zip(r.vehicles.items(), _styles(r), strict=True):
            line(axes, r.window_start + 0.5, own.channels[name].follows, label=_named(vehicle), **style)
        axes.set_ylabel(f"{name}, {_unit(name)}")
        axes.set_ylim(bottom=0.0)
    panels[-1].set_xlabel("s")
    legend_over(figure, panels[0])


def _is_judged(r: Twin) -> bool:
    return bool(r.judged.judged)


@stage(
    Twin,
    title="Does the simulator fly like the vehicle",
    figures={
        "stretch": Drawn("Flight and simulated vehicles over time", lambda r: 6.0 if blown_of(r) else 4.4, _stretch),
        "frequency": Drawn("Simulated over flown answer by frequency", 4.6, _frequency, _is_judged),
        "time": Drawn("Difference by second", 4.4, _seconds, _is_judged),
    },
    words={
        **by_name(blown_of, contradicted, _named, stretch_of, _unit),
        "finite": np.isfinite,
        "law_of": lambda name: AUTOPILOTS[name].title if name in AUTOPILOTS else name,
    },
    study=True,
)
def twin(run: Run, path: Path, model: Path | None = None) -> Twin | None:
    """Fly the setpoints of a flight again, and say where simulated vehicles part from it."""
    inputs = run.take({"flight": path} | ({} if model is None else {"model": model}))
    with_numbers(run, "simulate", model)
    study, (settings, gains) = run.study, with_autopilot(run.study, path)
    (flight,) = flights_to_play([path], study)
    with settings_of("simulation", study):
        effects = simulated_effects(settings.effects, study.vehicle)
        vehicles = _vehicles(study, model)
        played_gusts(list(vehicles.values())[-1], settings.gusts)
    possible = _possible(model, vehicles[model.name], study) if settings.gusts and model is not None else None
    try:
        asked = asked_of(flight, settings, study.vehicle, share=_thrust_is_share(path, study))
    except InputError as error:
        words = " ".join(map(str, go_on(run, "gap", path, output=run.sibling("gap"))))
        raise InputError(f"{error}. Without setpoints `{words}` says where the model of the config differs") from None
    if run.dry_run:
        return None
    flown: dict[str, TwinVehicle] = {}
    total = (len(vehicles) + DRAWS * settings.gusts) * len(flight.time)
    for number, (name, own) in enumerate(vehicles.items()):
        before = number * len(flight.time)
        flown[name] = fly_twin(
            ClosedLoop(study.vehicle, settings, *with_effects(own, effects)),
            flight,
            asked,
            lambda done, before=before: run.progress(before + done, total),  # type: ignore[misc]
        )
    loop = ClosedLoop(study.vehicle, settings, None, effects)
    air = None if possible is None else _in_gusts(run, loop, flight, asked, possible, flown)
    warnings = [
        *seen_warnings(VEHICLE if model is None else model.name, learned_by(model), known_by({"flight": path}, inputs)),
        *flight.warnings,
        *(note for name, own in vehicles.items() if own is not None for note in model_notes(name, own, [flight])),
        *_notes(settings, asked, gains),
    ]
    found = twin_of(flight, asked, flown, settings, gains, warnings, air)
    _go_on(run, found, path, model)
    if not settings.gusts and any(own is not None and own.gusts is not None for own in vehicles.values()):
        run.say(STILL_AIR)
    return found


def _possible(path: Path, model: VehicleModel | None, study: Study) -> tuple[Sequence[VehicleModel], Lack | None]:
    """Draw vehicles that the flights of a model allow, as `cpfls spread` does; of other models there is only one."""
    assert model is not None, "it is the model that holds the gusts"
    if not is_found(path):
        return [model] * DRAWS, None
    with about(path, InputError, ComputationError):
        spread = drawn(model, found_vehicle(path), DRAWS, generator(study, "spread"))
    return spread.models, spread.lack


def _in_gusts(
    run: Run,
    loop: ClosedLoop,
    flight: LoggedFlight,
    asked: Asked,
    possible: tuple[Sequence[VehicleModel], Lack | None],
    flown: Mapping[str, TwinVehicle],
) -> InGusts:
    """Fly possible vehicles in gusts, with what the model lacks, and compare the flight with them."""
    (models, lack), rng, count = possible, generator(run.study, "simulate"), len(flight.time)
    before = len(flown) * count

    def progress(done: int) -> None:
        run.progress(before + done, before + DRAWS * count)

    gusty = fly_in_gusts(loop, flight, asked, models, lack, rng, progress)
    name, still = list(flown.items())[-1]
    return in_gusts(measured_channels(flight), still.simulated, gusty, known_axes(models[0].gusts, lack), rng, name)


def _vehicles(study: Study, model: Path | None) -> dict[str, VehicleModel | None]:
    """List what is simulated: the vehicle of the config, and a model; a config with open numbers has no vehicle."""
    stated: dict[str, VehicleModel | None] = {VEHICLE: None}
    if model is None:
        return stated
    given: dict[str, VehicleModel | None] = {model.name: read_anew(model, study)}
    return given if study.vehicle.unknown else stated | given


def with_autopilot(study: Study, path: Path) -> tuple[ClosedLoopSettings, TwinGains]:
    """Find whose law flies, and its gains: as stated, of the log, of the simulation that made the flight, or usual."""
    settings = study.simulation.closed_loop
    made = None if is_log(path) else stored_study(read_origin(path).config, path).simulation.closed_loop
    by_simulation = made is not None and "log" not in read_origin(path).inputs and made.autopilot != _CPFLS
    name = settings.autopilot
    if name == _CPFLS and by_simulation and made is not None:
        name = made.autopilot
    if name == _CPFLS:
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
    gains = TwinGains(source=source, name=tuple(values), value=np.array(list(values.values()), dtype=float))
    with settings_of("simulation", study):
        return replace(settings, autopilot=name, autopilot_parameters=values), gains


def _parameters(path: Path) -> Mapping[str, float | str]:
    """Read what a log, or a flight that was imported from one, knows of its autopilot."""
    if is_log(path):
        return log_contents(path, ()).parameters
    kept, _ = read_whole(path)
    return kept.parameters if isinstance(kept, Imported) else {}


def _thrust_is_share(path: Path, study: Study) -> bool:
    """Tell whether a thrust setpoint is a share of the full thrust: a log's as its map says, a simulation logs N."""
    if not is_log(path):
        header = read_origin(path)
        if "log" not in header.inputs:
            return False
        study = stored_study(header.config, path)
    thrust = study.import_.signals.get("setpoint_thrust")
    return thrust is not None and thrust.unit == "1"


def _notes(settings: ClosedLoopSettings, asked: Asked, gains: TwinGains) -> Iterator[str]:
    title = AUTOPILOTS[settings.autopilot].title
    if gains.source == "defaults":
        yield (
            f"the gains are the defaults of {title}: give the log itself where it holds its parameters, or state them "
            "with --set simulation.closed_loop.autopilot_parameters={NAME: VALUE}"
        )
    if asked.thrust_from == "rotors":
        yield "no thrust setpoint is known: the thrust that the flight's own rotors gave takes its place"


def _go_on(run: Run, found: Twin, path: Path, model: Path | None) -> None:
    """Name the command that goes on: what the vehicle that parts lacks, or the model handed over."""
    if (found.in_gusts is not None and found.in_gusts.beyond) or found.judged.parted:
        run.next.append(to_gap(run, [path], model))
    elif model is not None:
        run.next.append(("cpfls", "export", model, "-o", run.sibling(f"{model.stem}.c")))
