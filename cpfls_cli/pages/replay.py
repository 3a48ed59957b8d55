"""The page of a replay: to which horizon a model predicts motion better than nothing does, and where it is worst."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from cpfls_cli.arrays import Array, runs
from cpfls_cli.artifacts.replay import (
    ErrorsByHorizon,
    HeldOutGroup,
    PlaybackGroup,
    ReplayRecord,
    SignalErrorGroup,
    behind_both,
    better_to,
    like_fading,
    lost_to,
    played_row,
    played_words,
    rival_row,
    rival_rows,
    row_of,
)
from cpfls_cli.pages.gap import AXES, MEASURED, keep_in_view
from cpfls_cli.pages.sensors import contradicted
from cpfls_cli.pages.source import Source, Sources
from cpfls_cli.playback.replay import (
    AFTER,
    BEFORE,
    MODEL,
    NOTHING_MOVES,
    RATE_FADES,
    RATE_STAYS,
    STATED,
    WITH_PAST,
)
from cpfls_cli.playback.settings import VEHICLE
from cpfls_cli.report.canvas import (
    BASELINE,
    GREY,
    HELD,
    legend_over,
    line,
    plain_ticks,
    plot,
    stacked,
    style_of,
)
from cpfls_cli.report.content import Block, Box, Cell, Facts, Folded, Heading, Plot, Table, Text
from cpfls_cli.report.numbers import number, sentence, whole_percent
from cpfls_cli.rounding import less, tied
from cpfls_cli.validation.trust import Trust
from cpfls_cli.words import joined

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_WORDS = {
    MODEL: "the model",
    AFTER: "with the effects",
    NOTHING_MOVES: "nothing moves",
    RATE_STAYS: "rate stays",
    RATE_FADES: "rate fades",
    STATED: "stated vehicle",
    BEFORE: "as given",
    WITH_PAST: "with the past",
}
"""What is said of predictions, in the order in which they are shown."""

_SIGNALS = {
    "body_rate": ("body rate", "rad/s", 1.0),
    "attitude": ("attitude", "°", 180.0 / np.pi),
    "velocity": ("velocity", "m/s", 1.0),
    "position": ("position", "m", 1.0),
}
_JUDGED: dict[str, Any] = {**style_of(0), "linewidth": 2.0, "zorder": 3}
_AS_STATED: dict[str, Any] = {"color": GREY, "linestyle": "-", "linewidth": 0.9}
_STYLES = {
    MODEL: _JUDGED,
    AFTER: _JUDGED,
    NOTHING_MOVES: HELD,
    RATE_STAYS: BASELINE,
    RATE_FADES: {"color": GREY, "linestyle": (0, (5, 1.5, 1, 1.5)), "linewidth": 1.2},
    STATED: _AS_STATED,
    BEFORE: _AS_STATED,
    WITH_PAST: {**style_of(2), "linewidth": 2.0, "zorder": 4},
}
_PLAYED: dict[str, Any] = {**style_of(1), "linestyle": "-", "zorder": 3}
_SHOWN_WORST = 3
_SAID = 2
_POSITIONS = ("x", "y", "z")


def answer(replay: Source[ReplayRecord], index: int = 1) -> Iterator[Block]:
    """Say to which horizon a model is better than what it has to beat, by how much, and where it is worst."""
    yield verdict_box(replay)
    yield from _grounds(replay.record, index)


def _grounds(record: ReplayRecord, index: int) -> Iterator[Block]:
    yield Folded("Errors by horizon", [errors_table(record, index)], shown=True)
    yield from _worst(record, index)


def _worst(record: ReplayRecord, index: int) -> Iterator[Block]:
    yield Folded("Where it is farthest off", [_worst_table(record, index)], shown=True)
    yield from (Text(words, "warning") for words in (*_diverged(record), *record.warning))


def verdict_box(replay: Source[ReplayRecord]) -> Box:
    """Say to which horizon a model is better than what it has to beat, and by how much."""
    record = replay.record
    rivals = _rivals(record)
    wrong = record.contradiction or ()
    sentences = [*beside_rivals(record), *_beside_stated(record)]
    model = played_row(record)
    better = {name: bool(less(*group.total[[model, rival]])) for name, (group, rival) in rivals.items()}
    moving = [name for name, (group, rival) in rivals.items() if group.total[rival] > 0]
    name = played_words(record.played)
    if not moving:
        return Box("REPLAY", sentence(f"{name} cannot be judged: the flight shows no motion"), sentences)
    good = all(better[name] for name in moving)
    signals = joined(_SIGNALS[name][0] for name in moving if better[name] == good)
    title = f"{name} predicts {'better' if good else 'worse'} than what it has to beat"
    whole = sentence(f"{title}, summed over all horizons to {_seconds(record.horizon_s[-1])}: {signals}")
    if wrong:
        return Box("REPLAY", contradicted(wrong[0]), [*map(sentence, wrong[1:]), whole, *sentences], "warning")
    return Box("REPLAY", whole, sentences, "good" if good else "warning")


def beside_rivals(errors: ErrorsByHorizon) -> list[str]:
    """Say of each signal to which horizon a model is better than what it has to beat, one sentence each."""
    return [_sentence(errors, name, group, rival) for name, (group, rival) in _rivals(errors).items()]


def playback_text(playback: PlaybackGroup | None) -> Iterator[Text]:
    """Say the same of a playback, one paragraph for each signal; nothing where there is none."""
    if playback is not None:
        yield from (Text(each) for each in beside_rivals(playback))


def beside_past(errors: ErrorsByHorizon, past_s: float) -> Iterator[str]:
    """Say how much smaller errors are where the flight before each start is known as well, in one sentence, if any."""
    if WITH_PAST not in errors.prediction:
        return
    rows = [played_row(errors), row_of(errors, WITH_PAST)]
    totals = [(_SIGNALS[name][0], group.total[rows]) for name, group in errors.errors.items() if group]
    changes = joined(
        f"{words} {whole_percent(abs(float(1 - with_past / model)))} {'smaller' if with_past < model else 'larger'}"
        for words, (model, with_past) in totals
        if model > 0
    )
    yield f"With {number(past_s, 2)} s of the past (`cpfls replay --history`) the errors add up to: {changes}."


def playback_words(trust: str, held: PlaybackGroup | None, contradictions: Sequence[str] | None) -> Iterator[str]:
    """Say what a model is good for, to which horizon, and where; by playback along flights held out alone.

    Parameters
    ----------
    held : PlaybackGroup or None
        None where no flight was held out.
    contradictions : sequence of str or None
        What no verdict can stand beside.
    """
    if contradictions:
        first, *others = contradictions
        yield f"Do not use it. {contradicted(first)}"
        yield from map(sentence, others)
    elif held is None:
        yield "No flight was held out, so it is open what the model is good for; --held-out FLIGHT tells."
    elif trust == Trust.SIMULATION:
        reached = min(better_to(held, "body_rate"), better_to(held, "velocity"))
        yield f"Good for simulation and for control to {number(reached, 2)} s{_region(held)}."
    elif trust == Trust.CONTROL:
        reached = better_to(held, "body_rate")
        yield f"Good for control of the attitude: it predicts body rates to {number(reached, 2)} s{_region(held)}."
    elif trust == Trust.NOT_CONTROL:
        yield f"Not for control: it {joined(lost_words(held))}."
    else:
        yield (
            "Do not use it: on held-out flights its body-rate errors add up to more than those of a baseline without a "
            "model."
        )


def lost_words(held: ErrorsByHorizon) -> list[str]:
    """Say where a model loses to what knows no model: where control lives, or in motion over all horizons."""
    lost, faded = lost_to(held), like_fading(held)
    said = [
        f"loses in {_SIGNALS[signal][0]} to “{_WORDS[rival]}” {_between(low, high)}{_by_chance(held, signal)}"
        for signal, (rival, low, high) in lost.items()
    ]
    if faded is not None and "body_rate" not in lost:
        beyond = _by_chance(held, "body_rate")
        said.append(f"is no better in body rate at {_seconds(faded)} than “{_WORDS[RATE_FADES]}”{beyond}")
    behind = behind_both(held)
    if behind:
        motion = joined(_SIGNALS[signal][0] for signal in behind)
        said.append(f"is worse in {motion} than “nothing moves” and “rate stays” both")
    return said


def _by_chance(held: ErrorsByHorizon, signal: str) -> str:
    group = held.errors[signal]
    return "" if group is None or group.chance is None else ", chance aside"


def _between(low: float, high: float) -> str:
    return f"from {low:.2g} to {_seconds(high)}" if low < high else f"at {_seconds(high)}"


def _region(held: PlaybackGroup) -> str:
    """Say at which speeds and rates it is better than what knows no model."""
    region = held.better if isinstance(held, HeldOutGroup) else None
    if region is None:
        return ""
    spans = [("speeds", region.speed, "m/s"), ("rates", region.rate, "rad/s")]
    known = joined(
        f"{name} of {number(span[0], 2)} to {number(span[1], 2)} {unit}"
        for name, span, unit in spans
        if span is not None
    )
    share = whole_percent(region.share)
    return f", at {known}, where most of the windows lie in which its body rates are better ({share} of all)"


def _rivals(record: ErrorsByHorizon) -> dict[str, tuple[SignalErrorGroup, int]]:
    """Pair each signal with what a model has to beat in it: the best of those that know no model."""
    known = {name: group for name, group in record.errors.items() if group is not None}
    return {name: (group, rival_row(record, group)) for name, group in known.items()}


def _sentence(record: ErrorsByHorizon, name: str, group: SignalErrorGroup, rival: int) -> str:
    words, (model, other) = _SIGNALS[name][0].capitalize(), group.total[[played_row(record), rival]]
    if other == 0:
        return f"{words}: “{_WORDS[record.prediction[rival]]}” has no error, because the flight shows no motion."
    if less(model, other):
        much = f"over all horizons its errors are {whole_percent(float(1 - model / other))} smaller"
    else:
        much = f"over all horizons its errors are {number(float(model / other), 3)} times as large"
    return f"{words}: {_where(record, group, rival)}; {much}."


def _where(record: ErrorsByHorizon, group: SignalErrorGroup, rival: int) -> str:
    """Say at which horizons the model is better: at the longest stretches of them, where they are many."""
    better = less(group.mae[played_row(record)], group.mae[rival])
    longest = sorted(sorted(runs(better), key=lambda run: run[0] - run[1])[:_SAID])
    horizon = [_seconds(value) for value in record.horizon_s]
    stretches = [f"{horizon[a]} to {horizon[b - 1]}" if a + 1 < b else horizon[a] for a, b in longest]
    other = f"“{_WORDS[record.prediction[rival]]}”"
    if better.all():
        return f"better than {other} at every horizon to {horizon[-1]}"
    return f"better than {other} at {joined(stretches)}" if stretches else f"better than {other} at no horizon"


def _seconds(value: float) -> str:
    return f"{value:.3g} s"


def _beside_stated(record: ReplayRecord) -> Iterator[str]:
    if record.played != VEHICLE:
        model, stated = record.body_rate.total[[played_row(record), row_of(record, STATED)]]
        share = whole_percent(float(model / stated)) if stated > 0 else "—"
        yield f"The errors of its body rates are {share} of those of the vehicle that the config states."


def _diverged(record: ReplayRecord) -> Iterator[str]:
    for row in _shown(record):
        count, prediction = int(record.diverged[row]), record.prediction[row]
        if count:
            who, where = _WORDS[prediction], ""
            if prediction == MODEL:
                who, where = played_words(record.played), f", first {_first_lost(record)}"
            yield (
                f"{who}: runs away in {count} of {record.windows} windows{where}; a run is stopped there and counts as "
                "it stood"
            )


def _first_lost(record: ReplayRecord) -> str:
    index = int(np.flatnonzero(np.isfinite(record.window.diverged))[0])
    begin, after = record.window.start[index], record.window.diverged[index]
    flight = record.flight.name[record.window.flight[index]]
    return f"in {flight} from {begin:.2f} s after {after:.3g} s"


def _shown(record: ErrorsByHorizon) -> list[int]:
    """List the rows of the predictions that are shown, as they are: the stated vehicle once."""
    twice = [STATED] if record.played == VEHICLE else []
    return [record.prediction.index(name) for name in _WORDS if name in record.prediction and name not in twice]


def errors_table(record: ErrorsByHorizon, index: int) -> Table:
    """Show the errors of all predictions after the first horizon, a fifth of the longest, the longest; and sums."""
    last = len(record.horizon_s) - 1
    chosen = sorted({0, max((last + 1) // 5 - 1, 0), last})
    rows: list[list[str | Cell]] = []
    model = played_row(record)
    for name, (group, rival) in _rivals(record).items():
        words, unit, scale = _SIGNALS[name]
        for row in _shown(record):
            values = [*(scale * group.mae[row, chosen]), scale * group.total[row]]
            worse = row == model and not less(*group.total[[model, rival]])
            cells = [number(float(value), 3) for value in values]
            rows.append(
                [
                    f"{words}, {unit}" if row == model else "",
                    _WORDS[record.prediction[row]],
                    *cells[:-1],
                    Cell(cells[-1], "warning" if worse else "plain"),
                ]
            )
    header = ("Error of", "Prediction", *(f"After {_seconds(record.horizon_s[h])}" for h in chosen), "Sum")
    caption = (
        f"Mean error of {played_words(record.played)} over {record.windows} windows of {joined(record.flown)}, played "
        "back without correction; sum over all horizons."
    )
    return Table(f"replay-{index}", caption, header, rows, frozenset({0, 1}))


def _worst_table(record: ReplayRecord, index: int) -> Table:
    window, compared = record.window, (played_row(record), row_of(record, NOTHING_MOVES))
    rows = [
        [
            str(rank),
            record.flight.name[window.flight[at]],
            f"{window.start[at]:.2f}",
            *(number(float(window.error[row, at]), 3) for row in compared),
        ]
        for rank, at in enumerate(record.worst.window, start=1)
    ]
    caption = (
        "The windows in which the body rate is farthest off, mean over the horizon in rad/s; none overlaps another."
    )
    header = ("Worst", "Flight", "From, s", "The model", "Nothing moves")
    return Table(f"replay-worst-{index}", caption, header, rows, frozenset({0, 1}))


def told_at(replay: ReplayRecord, sources: Sources) -> str | None:
    """Find the vehicle whose errors on the flights held out are those of a replay: they are told once."""
    for vehicle in sources.vehicles:
        held = vehicle.record.held_out
        if held is not None and held.flown == replay.flown and _same_errors(held, replay):
            return vehicle.label
    return None


def _same_errors(first: ErrorsByHorizon, second: ErrorsByHorizon) -> bool:
    groups = zip(first.errors.values(), second.errors.values(), strict=True)
    # A vehicle may be judged with the past as well.
    both = [name for name in first.prediction if name in second.prediction]
    own, others = ([errors.prediction.index(name) for name in both] for errors in (first, second))
    return all(
        a is b
        if a is None or b is None
        else a.mae.shape[1] == b.mae.shape[1] and bool(tied(a.mae[own], b.mae[others]).all())
        for a, b in groups
    )


def replay_blocks(replay: Source[ReplayRecord], index: int, sources: Sources) -> Iterator[Block]:
    """Show how a model predicts the motion of flights."""
    record, told = replay.record, told_at(replay.record, sources)
    yield Heading(replay.label)
    yield Facts(_facts(record))
    if told is not None:
        yield Text(f"Its errors by horizon are those of {told} on the flights held out, shown there.", "note")
    yield from _grounds(record, index) if told is None else _worst(record, index)
    if len(record.horizon_s) > 1:
        if told is None:
            yield horizon_figure(f"replay-errors-{index}", record)
        yield worst_figure(f"replay-worst-windows-{index}", record)
        yield drawn_figure(f"replay-drawn-{index}", record)
    yield where_figure(f"replay-where-{index}", record)


def _facts(record: ReplayRecord) -> list[tuple[str, str]]:
    flight = record.flight
    words = {"linear": "a straight line between samples", "previous": "held between samples"}
    driven = [
        f"{name}: {count} windows, driven by {actuation}, {words[hold]}"
        for name, count, actuation, hold in zip(flight.name, flight.windows, flight.actuation, flight.hold, strict=True)
    ]
    every = "every sample" if record.every == 1 else f"one in {record.every} samples"
    return [
        ("Played back", played_words(record.played)),
        ("Along", "; ".join(driven)),
        ("From", f"{every}, for {_seconds(record.horizon_s[-1])}"),
        *([] if record.history_s is None else [("With the past", f"{_seconds(record.history_s)} before each start")]),
    ]


def prediction_words(prediction: str) -> str:
    """Say what predicts."""
    return _WORDS[prediction]


def signal_scale(signal: str) -> tuple[str, str, float]:
    """Give the name of a signal, the unit that people read, and by what errors in SI are multiplied for it."""
    return _SIGNALS[signal]


def playback_figure(name: str, record: ErrorsByHorizon) -> Plot | None:
    """Draw the mean error over the horizon; None of a single one, or of flights that show no motion."""
    moves = any(group.total[rival] > 0 for group, rival in _rivals(record).values())
    return horizon_figure(name, record) if moves and len(record.horizon_s) > 1 else None


def horizon_figure(name: str, record: ErrorsByHorizon) -> Plot:
    """Draw the mean error over the horizon, beside what a model has to beat."""
    groups = _rivals(record)

    def draw(figure: Figure) -> None:
        panels = stacked(figure, len(groups))
        for axes, (signal, (group, _)) in zip(panels, groups.items(), strict=True):
            words, unit, scale = _SIGNALS[signal]
            values = scale * group.mae
            for row in reversed(_shown(record)):
                prediction = record.prediction[row]
                line(axes, record.horizon_s, values[row], label=_WORDS[prediction], **_STYLES[prediction])
            top = 1.6 * float(values[[played_row(record), *rival_rows(record)]].max())
            axes.set_ylim(0.0, min(top, 1.06 * float(values.max())) or 1.0)
            axes.set_title(f"{words}, {unit}")
        panels[-1].set_xlabel("horizon, s")
        legend_over(figure, panels[0])

    caption = (
        f"Mean error of {played_words(record.played)} after so many seconds without correction. Grey: what it has to "
        "beat. A curve that leaves the top of a panel is farther off than the panel is high."
    )
    return plot(
        name, caption, "Mean error by horizon, of the model and of what it has to beat", 0.9 + 1.7 * len(groups), draw
    )


def worst_figure(name: str, record: ReplayRecord) -> Plot:
    """Draw the body rates of flight and model in the windows in which the model is worst."""
    worst, window = record.worst, record.window
    shown = range(min(_SHOWN_WORST, len(worst.window)))
    time = np.concatenate([[0.0], record.horizon_s])

    def draw(figure: Figure) -> None:
        grid = figure.subplots(len(AXES), len(shown), sharex=True, squeeze=False)
        for column in shown:
            at = worst.window[column]
            flight = record.flight.name[window.flight[at]]
            grid[0][column].set_title(f"{column + 1}: {flight}, {window.start[at]:.2f} s")
            for row, axes in enumerate(grid[:, column]):
                measured, model = worst.measured[column, :, row], worst.model[column, :, row]
                line(axes, time, measured, label="flight", **MEASURED)
                line(axes, time, model, label="playback", **_PLAYED)
                keep_in_view(axes, [measured], model)
                axes.set_ylabel(AXES[row] if column == 0 else "")
        figure.supxlabel("time from the start, s", fontsize=9.5)
        figure.supylabel("body rate, rad/s", fontsize=9.5)
        legend_over(figure, grid[0][0])

    caption = "Body rates in the windows in which the model is farthest off: the flight, and its playback."
    return plot(name, caption, "Body rates of flight and playback in the worst windows", 5.0, draw)


def drawn_figure(name: str, record: ReplayRecord) -> Plot:
    """Draw a stretch of a flight beside its playback, which begins anew after each horizon."""
    drawn, window = record.drawn, record.window
    flight = record.flight.name[window.flight[drawn.window[0]]]
    times = window.start[drawn.window][:, None] + np.concatenate([[0.0], record.horizon_s])
    panels_of: list[tuple[str, Array, Array]] = [
        (f"rate about {axis}, rad/s", drawn.measured[:, :, index], drawn.model[:, :, index])
        for index, axis in enumerate(AXES)
    ]
    if drawn.measured_position is not None and drawn.model_position is not None:
        measured_position, model_position = drawn.measured_position, drawn.model_position
        panels_of += [
            (f"position {axis}, m", measured_position[:, :, index], model_position[:, :, index])
            for index, axis in enumerate(_POSITIONS)
        ]

    def draw(figure: Figure) -> None:
        panels = stacked(figure, len(panels_of))
        for axes, (title, measured, model) in zip(panels, panels_of, strict=True):
            for run, time in enumerate(times):
                labels = ("flight", "playback") if run == 0 else (None, None)
                line(axes, time, measured[run], label=labels[0], **MEASURED)
                line(axes, time, model[run], label=labels[1], **_PLAYED)
            keep_in_view(axes, [measured], model)
            axes.set_title(title)
        panels[-1].set_xlabel("time, s")
        legend_over(figure, panels[0])

    caption = (
        f"A stretch of {flight} beside its playback, which restarts from the flight after each horizon. Of all such "
        "stretches half are better and half are worse."
    )
    return plot(name, caption, "A flight beside its playback over time", 0.8 + 1.25 * len(panels_of), draw)


def where_figure(name: str, record: ReplayRecord) -> Plot:
    """Draw how far off the model is over the time of each flight."""
    window, rows = record.window, [row_of(record, NOTHING_MOVES), played_row(record)]

    def draw(figure: Figure) -> None:
        panels = list(figure.subplots(len(record.flight.name), 1, squeeze=False)[:, 0])
        for index, (axes, flight) in enumerate(zip(panels, record.flight.name, strict=True)):
            own = window.flight == index
            nothing, model = (window.error[row, own] for row in rows)
            line(axes, window.start[own], nothing, label=_WORDS[NOTHING_MOVES], **HELD)
            line(axes, window.start[own], model, label=_WORDS[MODEL], **style_of(0))
            keep_in_view(axes, [nothing], model)
            axes.set_ylim(bottom=0.0)
            plain_ticks(axes.yaxis)
            axes.set_title(flight)
            axes.set_ylabel("error, rad/s")
        panels[-1].set_xlabel("start of the window, s")
        legend_over(figure, panels[0])

    caption = "Where the model is good: mean error of the body rate over the horizon, by the start of the window."
    return plot(
        name, caption, "Error of the body rate over the time of each flight", 0.9 + 1.3 * len(record.flight.name), draw
    )
