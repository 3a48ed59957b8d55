"""Find where a model and flights disagree."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import ceil
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from cpfls_cli.arguments import FlightsArgument, ModelOption
from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.artifacts.diagnosis import Disagreement
from cpfls_cli.artifacts.gate import format_name
from cpfls_cli.artifacts.identified import IdentifiedModel
from cpfls_cli.artifacts.job import Job, Progress, go_on
from cpfls_cli.artifacts.model import MODEL_FLIGHT, LearnedFlight, as_inputs
from cpfls_cli.config.check import no_body
from cpfls_cli.config.study import Study, generator
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.effects.signals import GIVEN, Signals, recorded
from cpfls_cli.errors import ConfigError
from cpfls_cli.flights.models import is_found, learned_by, read_model
from cpfls_cli.flights.recordings import FlightSet, read_flights
from cpfls_cli.flights.training import known_by, numbered_roles
from cpfls_cli.gap.balance.weak_flight import CHANNELS
from cpfls_cli.gap.compare import compare as compare_flights
from cpfls_cli.gap.residual.dependence import HeatMap
from cpfls_cli.gap.whole_vehicle import of_vehicle
from cpfls_cli.pages.gap import channel_unit, channel_words
from cpfls_cli.pages.gap_words import GAP_WORDS, playback_drawn, repeatability_drawn
from cpfls_cli.pages.trust import seen_warnings
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.report.canvas import Axes, Drawn, Figure, in_columns, line, plain_ticks, stacked
from cpfls_cli.report.content import Command, plain
from cpfls_cli.stage import Run, stage
from cpfls_cli.stages._numbers import to_fly, why_no_body_found, with_numbers
from cpfls_cli.words import did_you_mean

if TYPE_CHECKING:
    from matplotlib.collections import PatchCollection

_STRETCHES, _SIGNALS, _COLUMNS, _LEVELS = 5, 4, 2, 8
_BLUE, _SHADE = "#1b4f8a", "#f3d9b8"
_LABEL = {"facecolor": "white", "edgecolor": "none", "pad": 0.8}
_SIGNAL_UNITS = {
    "time": "s",
    "body rate": "rad/s",
    "roll": "rad",
    "pitch": "rad",
    "yaw": "rad",
    "air velocity": "m/s",
    "speed": "m/s",
    "horizontal speed": "m/s",
    "vertical speed": "m/s",
    "height": "m",
    "rotor speed": "rad/s",
    "thrust": "N",
    "rotor torque": "N m",
    "voltage": "share of full",
}


def _draw_gap(r: Disagreement, figure: Figure) -> None:
    """Draw the gap of each channel over all flights, one after another."""
    residual, known = r.residual, r.sizes.known
    offset = _offsets(residual.flight, residual.time)
    time, value = residual.time + offset[residual.flight], residual.value / r.sizes.floor
    parts = [residual.flight == index for index in np.unique(residual.flight)]
    panels = stacked(figure, len(known))
    for axes, index in zip(panels, known, strict=True):
        for part in parts:
            line(axes, time[part], value[part, index], color=_BLUE, linewidth=0.9)
        axes.axhspan(-1.0, 1.0, color="#dddddd", zorder=0)
        _mark_stretches(axes, r, CHANNELS[index], offset)
        for part in parts[1:]:
            axes.axvline(time[part][0], color="black", linewidth=0.7, linestyle=(0, (4, 2)))
        axes.set(xlim=(time.min(), time.max()), title=channel_words(CHANNELS[index]))
    figure.supylabel("gap, noise floors", fontsize=9.5)
    panels[-1].set_xlabel("time, s; flights one after another")


def _offsets(flight: IntArray, clock: Array) -> Array:
    """Put the clocks of flights one after another: give for each flight what is to be added to its clock, s."""
    offset, end = np.zeros(int(flight.max(initial=-1)) + 1), 0.0
    for index in range(len(offset)):
        times = clock[flight == index]
        if len(times):
            offset[index] = end - times[0]
            end += times[-1] - times[0] + (times[-1] - times[0]) / max(len(times) - 1, 1)
    return offset


def _mark_stretches(axes: Axes, r: Disagreement, channel: str, offset: Array) -> None:
    for rank, each in enumerate(r.worst[:_STRETCHES], start=1):
        if each.channel != channel:
            continue
        first = each.start_s + offset[each.flight]
        length = each.end_s - each.start_s
        axes.axvspan(first, first + length, color=_SHADE, zorder=0)
        place: dict[str, Any] = {"ha": "center", "va": "top", "fontsize": 8.5, "zorder": 5, "bbox": _LABEL}
        axes.text(first + length / 2, 0.97, str(rank), transform=axes.get_xaxis_transform(), **place)


def _draw_dependence(r: Disagreement, figure: Figure) -> None:
    """Draw the share of each channel's gap that its best signals explain, each alone."""
    channels = r.followed_channels
    panels = in_columns(figure, len(channels), _COLUMNS)
    for axes, channel in zip(panels.flat, channels, strict=False):
        best = [each for each in r.dependence if each.channel == channel][:_SIGNALS]
        rows, shares = np.arange(len(best))[::-1], np.clip([each.r2 for each in best], 0.0, 1.0)
        colours = [_BLUE if each.sure else "white" for each in best]
        axes.barh(rows, shares, height=0.66, color=colours, edgecolor=_BLUE)
        axes.set_yticks(rows, [each.signal for each in best])
        axes.set(axisbelow=True, xlim=(0.0, 1.0))
        axes.grid(visible=False, axis="y")
        axes.set_title(channel_words(channel))
    for column in range(min(_COLUMNS, len(channels))):
        last = panels[(len(channels) - 1 - column) // _COLUMNS, column]
        last.set_xlabel("share of variance explained")
        last.tick_params(labelbottom=True)


def _draw_heat_map(r: Disagreement, figure: Figure) -> None:
    """Draw the mean gap over the two signals that explain it best."""
    from matplotlib.colors import BoundaryNorm
    from matplotlib.ticker import MaxNLocator

    assert r.heat_map is not None, "asked before"
    found: HeatMap = r.heat_map
    mean, edges = found.mean.T, (found.first_edge, found.second_edge)
    largest = float(np.nanmax(np.abs(mean), initial=1e-12))
    limits = MaxNLocator(_LEVELS, symmetric=True).tick_values(-largest, largest)
    axes = figure.subplots()
    axes.set_facecolor("white")
    mesh = axes.pcolormesh(*edges, np.ma.masked_invalid(mean), cmap="PuOr", norm=BoundaryNorm(limits, 256))
    axes.add_collection(_hatched(*edges, mean < 0))
    bar = figure.colorbar(mesh, ax=axes, ticks=limits)
    bar.ax.set_yticklabels([plain(float(limit), smallest=1e-4) for limit in limits])
    bar.set_label(f"mean gap, {channel_unit(found.channel)}")
    axes.grid(visible=False)
    axes.set(xlabel=_signal_words(found.signals[0]), ylabel=_signal_words(found.signals[1]))
    for axis in (axes.xaxis, axes.yaxis):
        plain_ticks(axis)


def _hatched(first: Array, second: Array, marked: BoolArray) -> PatchCollection:
    """Hatch cells, so that a sign is seen without colour."""
    from matplotlib.collections import PatchCollection
    from matplotlib.patches import Rectangle

    cells = [
        Rectangle((first[column], second[row]), first[column + 1] - first[column], second[row + 1] - second[row])
        for row, column in np.argwhere(marked)
    ]
    return PatchCollection(cells, facecolor="none", edgecolor="#6b6b6b", linewidth=0.0, hatch="////")


def _signal_words(signal: str) -> str:
    """Name a signal with its unit."""
    unit = _SIGNAL_UNITS.get(signal) or _SIGNAL_UNITS.get(signal.rsplit(" ", 1)[0])
    return f"{signal}, {unit}" if unit else signal


FIGURES = {
    "repeatable": repeatability_drawn(lambda r: (r.repeatability, None)),
    "gap-over-time": Drawn(
        "Gap of each channel over time in noise floors",
        lambda r: 0.7 + 1.1 * len(r.sizes.known),
        _draw_gap,
        lambda r: r.sizes.known,
    ),
    "dependence": Drawn(
        "Share of the gap explained by each signal, by channel",
        lambda r: 0.6 + 1.25 * ceil(len(r.followed_channels) / _COLUMNS),
        _draw_dependence,
        lambda r: r.followed_channels,
    ),
    "heat-map": Drawn(
        "Mean gap over the two signals that explain it best",
        3.9,
        _draw_heat_map,
        lambda r: r.followed_channels and r.heat_map is not None,
    ),
    "playback": playback_drawn(),
}


@stage(Disagreement, title="Where they disagree", figures=FIGURES, words=GAP_WORDS, study=True)
def compare(run: Run, flights: FlightsArgument, model: ModelOption = None) -> Disagreement | None:
    """Compare a model with flights: the gap by axis, time and state."""
    roles = numbered_roles("flight", flights)
    inputs = run.take(roles | ({} if model is None else {"model": model}))
    check_ignored(run.study)
    for why in no_body(run.study):
        run.note(why)
    with_numbers(run, "compare", model, whole=model is not None and is_found(model))
    read, learned = read_flights(flights, run.study), learned_by(model)
    base = VehicleModel(vehicle=run.study.vehicle) if model is None else read_model(model, run.study)
    given = replace(read, flights=tuple(of_vehicle(read.flights, base)))
    if run.dry_run:
        return None
    files = known_by(roles, inputs)
    given = with_seen(given, model, learned, files)
    found = compared(run.study, given, base, progress_of(run.progress))
    found = learned_from(run, replace(found, files=tuple(files)), learned)
    run.next.append(_next(run, found, flights, model))
    return found


def _next(run: Run, found: Disagreement, flights: Sequence[Path], model: Path | None) -> Command:
    if found.audit.contradictions:
        return to_correct(run)
    if not found.sizes.above_noise:
        return to_fly(run)
    if not found.is_base(run.study.vehicle):
        return to_gap(run, flights, model)
    return go_on(run, "diagnose", run.output, output=run.sibling("diagnosis.h5"))


def to_correct(job: Job) -> Command:
    """Give the command that shows how a log is read: something of that is wrong."""
    return "cpfls", "config", job.config, "--section", "import"


def to_gap(job: Job, flights: Sequence[Path], model: Path | None) -> Command:
    """Give the command that names what is missing, from the model on where `cpfls gap` can start from it."""
    if job.found is not None and why_no_body_found(job, job.found):
        return to_fly(job)
    starts = model is not None and (is_found(model) or format_name(model) == IdentifiedModel.FORMAT)
    given: Sequence[str | Path] = ("--model", model) if model is not None and starts else ()
    return go_on(job, "gap", *flights, *given, output=job.sibling("gap"))


def with_seen(
    given: FlightSet, model: Path | None, learned: Sequence[LearnedFlight], judged: Sequence[LearnedFlight]
) -> FlightSet:
    """Say of flights which of them the model that is held against them learned from."""
    seen = () if model is None else seen_warnings(model.name, learned, judged)
    return replace(given, warnings=(*seen, *given.warnings))


def learned_from(run: Run, found: Disagreement, learned: Sequence[LearnedFlight], of: str = "") -> Disagreement:
    """Take the flights that the model learned from as inputs of a comparison."""
    run.take_also(as_inputs(MODEL_FLIGHT, learned), of)
    return replace(found, learned=tuple(learned))


def compared(
    study: Study,
    given: FlightSet,
    model: VehicleModel,
    progress: Callable[[float, str], None],
    whole: Sequence[Signals] = (),
) -> Disagreement:
    """Compare a model with flights; rotors are held against `whole` ones, where there are more than these."""
    rng = generator(study, "compare")
    found = compare_flights(given.flights, model, study.gap, rng, progress, whole=whole)
    return Disagreement(
        **vars(found),
        warnings=(*found.audit.filtered, *given.warnings),
        base=model,
        recorded=recorded(given.flights, [GIVEN] * len(given.flights)),
    )


def check_ignored(study: Study) -> None:
    """Refuse names in `gap.ignore` that no effect has."""
    for name in study.gap.ignore:
        if name not in CATALOGUE:
            hint = did_you_mean(name, CATALOGUE, "`cpfls effects` lists all")
            raise ConfigError(f"gap.ignore = {name}: no such effect ({hint})")


def progress_of(progress: Progress, start: float = 0.0, end: float = 1.0) -> Callable[[float, str], None]:
    """Show a part of the work, from one share of the whole to another, on the progress of a job."""
    return lambda done, note: progress(start + (end - start) * done, 1, note)
