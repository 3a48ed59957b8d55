"""Play a model back along flights: how far off its motion is by horizon, and what it has to beat."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from cpfls_cli.arguments import EveryOption, FlightsArgument, HistoryOption, HoldOption, HorizonOption, PlayedArgument
from cpfls_cli.arrays import Array
from cpfls_cli.consistency.channels import BODY_AXES
from cpfls_cli.errors import InputError
from cpfls_cli.flights.models import holds_forecast, is_vehicle, learned_by, read_fading, read_model, read_observer
from cpfls_cli.flights.playback import flights_to_play, model_notes, played
from cpfls_cli.flights.recordings import seen_twice
from cpfls_cli.flights.training import known_by, numbered_roles
from cpfls_cli.pages.gap import MEASURED, keep_in_view
from cpfls_cli.pages.playback import ERRORS, WORDS, draw_errors, errors_height
from cpfls_cli.pages.trust import seen_warnings
from cpfls_cli.playback.errors import NOTHING_MOVES, STATED
from cpfls_cli.playback.flight import LoggedFlight
from cpfls_cli.playback.player import Observer, past_of
from cpfls_cli.playback.replay import USUAL, Playback, Played, Replay, playback
from cpfls_cli.playback.replay import replay as played_back
from cpfls_cli.playback.settings import VEHICLE
from cpfls_cli.report.canvas import HELD, Axes, Drawn, Figure, legend_over, line, plain_ticks, stacked, style_of
from cpfls_cli.stage import Run, stage
from cpfls_cli.stages._numbers import with_numbers

_FORECAST = "{}: its forecast along logged rotor speeds is played, loop included; its constants are a different model"
_PLAYED: dict[str, Any] = {**style_of(1), "linestyle": "-", "zorder": 3}
_SHOWN_WORST = 3


def _errors(r: Playback, figure: Figure) -> None:
    draw_errors(r, figure, (STATED,) if r.played == VEHICLE else ())


def _pair(axes: Axes, time: Sequence[Array], measured: Sequence[Array], model: Sequence[Array]) -> None:
    """Draw runs of the flight and of the model."""
    for at, (when, flown, predicted) in enumerate(zip(time, measured, model, strict=True)):
        labels = ("flight", "playback") if at == 0 else (None, None)
        line(axes, when, flown, label=labels[0], **MEASURED)
        line(axes, when, predicted, label=labels[1], **_PLAYED)
    keep_in_view(axes, list(measured), np.concatenate(model))


def _worst(r: Playback, figure: Figure) -> None:
    """Draw the body rates of flight and model in the windows in which the model is worst."""
    shown = r.worst[:_SHOWN_WORST]
    grid = figure.subplots(len(BODY_AXES), len(shown), sharex=True, squeeze=False)
    time = np.concatenate([[0.0], r.horizon_s])
    for column, run in enumerate(shown):
        grid[0][column].set_title(f"{column + 1}: {run.flight}, {run.start_s:.2f} s")
        for row, axes in enumerate(grid[:, column]):
            _pair(axes, [time], [run.measured[:, row]], [run.model[:, row]])
            axes.set_ylabel(BODY_AXES[row] if column == 0 else "")
    figure.supxlabel("time from the start, s", fontsize=9.5)
    figure.supylabel("body rate, rad/s", fontsize=9.5)
    legend_over(figure, grid[0][0])


def _panels(r: Playback) -> list[tuple[str, Array, Array]]:
    """List what is drawn of a stretch: of each panel its title, the flight and the model, shape (run, sample)."""
    own = r.drawn
    found = [
        (f"rate about {axis}, rad/s", own.measured[:, :, at], own.model[:, :, at]) for at, axis in enumerate(BODY_AXES)
    ]
    if own.measured_position is not None and own.model_position is not None:
        both = own.measured_position, own.model_position
        found += [(f"position {axis}, m", both[0][:, :, at], both[1][:, :, at]) for at, axis in enumerate("xyz")]
    return found


def _drawn(r: Playback, figure: Figure) -> None:
    """Draw a stretch of a flight and its playback, which begins anew after each horizon."""
    time = r.drawn.start_s[:, None] + np.concatenate([[0.0], r.horizon_s])
    panels = stacked(figure, len(_panels(r)))
    for axes, (title, measured, model) in zip(panels, _panels(r), strict=True):
        _pair(axes, list(time), list(measured), list(model))
        axes.set_title(title)
    panels[-1].set_xlabel("time, s")
    legend_over(figure, panels[0])


def _where(r: Playback, figure: Figure) -> None:
    """Draw how far off the model is over the time of each flight."""
    panels = list(figure.subplots(len(r.flights), 1, squeeze=False)[:, 0])
    for index, (axes, flight) in enumerate(zip(panels, r.flights, strict=True)):
        own = r.window_flight == index
        nothing, model = (r.errors_of(name)[own] for name in (NOTHING_MOVES, r.judged))
        line(axes, r.window_start[own], nothing, label=WORDS["who"][NOTHING_MOVES], **HELD)
        line(axes, r.window_start[own], model, label=WORDS["who"][r.judged], **style_of(0))
        keep_in_view(axes, [nothing], model)
        axes.set_ylim(bottom=0.0)
        plain_ticks(axes.yaxis)
        axes.set(title=flight.name, ylabel="error, rad/s")
    panels[-1].set_xlabel("start of the window, s")
    legend_over(figure, panels[0])


def _several(r: Playback) -> bool:
    """Tell whether there is a horizon to draw over."""
    return len(r.horizon_s) > 1


FIGURES = {
    "errors": Drawn(ERRORS, errors_height, _errors, _several),
    "worst": Drawn("Body rates of flight and playback in the worst windows", 5.0, _worst, _several),
    "drawn": Drawn("A flight and its playback over time", lambda r: 0.8 + 1.25 * len(_panels(r)), _drawn, _several),
    "where": Drawn("Error of the body rate over the time of each flight", lambda r: 0.9 + 1.3 * len(r.flights), _where),
}


@stage(Playback, title="Played back along flights", figures=FIGURES, words=WORDS, study=True)
def replay(
    run: Run,
    model: PlayedArgument,
    flights: FlightsArgument,
    horizon: HorizonOption = None,
    every: EveryOption = 1,
    hold: HoldOption = None,
    history: HistoryOption = None,
) -> Playback | None:
    """Play a model back along flights and sum up its errors by horizon."""
    between: Any = None if hold is None else hold.value
    horizon, history = horizon or 0.5, history or 0.0
    roles = numbered_roles("flight", flights)
    inputs = run.take(({} if is_vehicle(model) else {"model": model}) | roles)
    with_numbers(run, "replay", model, whole=not is_vehicle(model))
    to_play = read_model(model, run.study, forecast=True)
    observer = read_observer(model, history) if history > 0 else None
    given = flights_to_play(flights, run.study, between)
    fading_s = read_fading(model)
    pairs = [replace(played(to_play, flight, run.study.vehicle), fading_s=fading_s) for flight in given]
    samples = _samples(horizon, given[0], "--horizon")
    if observer is not None:
        _samples(observer.past_s, given[0], "--history")
        pairs = [replace(pair, model=replace(pair.model, observer=observer)) for pair in pairs]
    for each in pairs:
        each.flight.starts(samples, every)
    if run.dry_run:
        return None
    found = played_back(pairs, samples, every, lambda done: run.progress(done, 1))
    warnings = [
        *seen_twice(inputs[role] for role in roles),
        *seen_warnings(model.name, learned_by(model), known_by(roles, inputs)),
        *(warning for flight in given for warning in flight.warnings),
        *([_FORECAST.format(model.name)] if holds_forecast(model) else []),
        *([] if observer is None else _past_notes(observer, pairs, found)),
        *model_notes(model.name, to_play, given),
    ]
    asked = {"played": model.name, "asked_s": horizon, "every": every, "hold": between or USUAL, "history_s": history}
    return playback(asked, given, pairs, found, warnings)


def _past_notes(observer: Observer, pairs: Iterable[Played], found: Replay) -> Iterator[str]:
    """Say where there is less of the past than was asked for."""
    short = 0
    for index, pair in enumerate(pairs):
        starts = found.start[found.flight == index]
        samples = observer.samples(pair.flight.motion.period)
        short += int(np.sum(past_of(pair.flight, starts, samples)[1].sum(axis=1) < samples))
    if short:
        yield (
            f"{short} of {len(found.start)} windows begin less than {observer.past_s:g} s after the start of a "
            f"stretch and use what past there is"
        )


def _samples(time_s: float, flight: LoggedFlight, option: str) -> int:
    period = flight.parts[0].period
    if time_s < 0.5 * period:
        raise InputError(f"{option} {time_s:g} s is shorter than a sample of {flight.name}, {period:.4g} s")
    return round(time_s / period)
