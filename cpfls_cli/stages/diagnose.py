"""Name the physical effect that a model misses."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np

from cpfls_cli.arguments import DisagreementArgument, HeldOutOption
from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.artifacts.diagnosis import Diagnosis, Disagreement
from cpfls_cli.artifacts.gate import InputFile
from cpfls_cli.artifacts.job import Job, go_on
from cpfls_cli.artifacts.model import MODEL_FLIGHT, LearnedFlight, as_inputs
from cpfls_cli.config.study import Study, generator
from cpfls_cli.config.unknown import is_of_guesses
from cpfls_cli.consistency.channels import BODY_AXES
from cpfls_cli.effects.registry import VEHICLE_NUMBERS
from cpfls_cli.errors import InputError
from cpfls_cli.flights.recordings import FlightSplit, read_flights, seen_twice, split_flights
from cpfls_cli.flights.same_vehicle import read_result_of_vehicle
from cpfls_cli.flights.training import known_by, numbered_roles, refuse_seen
from cpfls_cli.gap.before_after import FreeRuns, PlaybackChange, before_after
from cpfls_cli.gap.diagnose import diagnose as diagnose_flights
from cpfls_cli.gap.naming.causes import of_thrust
from cpfls_cli.gap.naming.results import GapVerdict
from cpfls_cli.gap.whole_vehicle import known_already
from cpfls_cli.pages.gap import (
    BEFORE,
    MEASURED,
    channel_unit,
    channel_words,
    hidden_gaps,
    intervals_drawn,
    keep_in_view,
    leaves_view,
    marked,
    sizes_drawn,
    wrong_numbers,
)
from cpfls_cli.pages.gap_words import GAP_WORDS, playback_drawn, repeatability_drawn
from cpfls_cli.pages.playback import SIGNALS, axis_words, draw_errors, errors_height
from cpfls_cli.pages.trust import seen_warnings
from cpfls_cli.playback.errors import AFTER, CONTROL_HORIZON
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.report.canvas import GREY, Axes, Drawn, Figure, legend_over, plain_ticks, stacked
from cpfls_cli.report.content import Command
from cpfls_cli.report.source import Source
from cpfls_cli.rounding import less
from cpfls_cli.stage import Run, stage
from cpfls_cli.stages._numbers import to_fly
from cpfls_cli.stages.compare import check_ignored, progress_of, to_correct
from cpfls_cli.validation.trust import Trust, trust_by_playback
from cpfls_cli.words import by_name, joined

_VISIBLE = 0.05  # Share of the error without a model by which a playback has to grow to be called worse.


def _curves(run: FreeRuns) -> dict[str, Array]:
    return {"measured": run.measured, "before": run.before, "after": run.after}


def _draw_free_runs(r: Diagnosis, figure: Figure) -> None:
    """Draw measured and simulated body rates over the stretch in which they disagreed most."""
    run = r.run
    assert run is not None, "asked before"
    curves = _curves(run)
    parts = np.split(np.arange(len(run.time)), np.searchsorted(run.time, run.restart[1:] - 1e-9))
    panels = stacked(figure, len(BODY_AXES) + 1)
    for axes, start in product(panels, run.restart):
        axes.axvline(start, color=GREY, linewidth=1.2, linestyle=(0, (1, 1.5)), zorder=0.5)
    for index, (axes, axis) in enumerate(zip(panels, BODY_AXES, strict=False)):
        about = {key: values[:, index] for key, values in curves.items()}
        _draw_runs(axes, run.time, about, parts, f"body rate about {axis}")
        keep_in_view(axes, (about["measured"], about["after"]), about["before"])
    errors = {key: curves[key][:, run.axis] - run.measured[:, run.axis] for key in ("before", "after")}
    _draw_runs(panels[-1], run.time, errors, parts, f"simulated less measured about {BODY_AXES[run.axis]}")
    panels[-1].axhline(0.0, color="black", linewidth=0.8)
    legend_over(figure, panels[0])
    panels[-1].set_xlabel("time, s")


def _draw_runs(axes: Axes, time: Array, curves: dict[str, Array], runs: Sequence[IntArray], title: str) -> None:
    labels = {"measured": "measured", "before": "simulated before", "after": "simulated after"}
    styles = {"measured": MEASURED, "before": BEFORE, "after": marked(len(time) // len(runs))}
    for index, rows in enumerate(runs):
        for key, values in curves.items():
            axes.plot(time[rows], values[rows], label=labels[key] if index == 0 else None, **styles[key])
    plain_ticks(axes.yaxis)
    axes.set_title(title)
    axes.set_ylabel("rad/s")


def _leaving(run: FreeRuns) -> list[str]:
    """Name the axes about which the model as given runs away from the figure."""
    rates = [{key: values[:, index] for key, values in _curves(run).items()} for index in range(len(BODY_AXES))]
    pairs = zip(BODY_AXES, rates, strict=True)
    return [axis for axis, own in pairs if leaves_view((own["measured"], own["after"]), own["before"])]


def _draw_picture(r: Diagnosis, figure: Figure) -> None:
    """Draw the channel with the largest gap over the stretch in which it is largest."""
    picture = r.picture
    assert picture is not None, "asked before"
    axes = figure.subplots()
    axes.plot(picture.time, picture.measured, label="measured", **MEASURED)
    axes.plot(picture.time, picture.before, label="simulated before", **BEFORE)
    axes.plot(picture.time, picture.after, label="simulated after", **marked(len(picture.time)))
    keep_in_view(axes, (picture.measured, picture.after), picture.before)
    plain_ticks(axes.yaxis)
    axes.set_ylabel(f"{channel_words(picture.channel)}, {channel_unit(picture.channel)}")
    axes.set_xlabel("time, s")
    legend_over(figure, axes)


def _wrong(r: Diagnosis, source: Source) -> tuple[int, list[str]]:
    """Count wrong numbers, and say how far they are off, and from what: what was taken where the config has null."""
    guessed = any(map(is_of_guesses, source.header.cautions))
    taken = "the guess" if guessed else "the vehicle that was found"
    found, by_place = wrong_numbers(r.effects), dict[str, list[str]]()
    of_model = "model" in source.header.inputs and r.base.vehicle != source.vehicle
    numbers = [number for each in r.effects if each.name == VEHICLE_NUMBERS.name for number in each.numbers]
    follow = of_thrust(numbers)
    said = {name: words for name, words in found.items() if name not in follow}
    if follow:
        shows = joined([found[name].partition(" ")[0] for name in follow])
        said["thrust_scale"] += f" (as the ratio of {shows} to the rotor torque shows too)"
    for name, words in said.items():
        quantity = "thrust_factor" if name == "thrust_scale" else name.rpartition("_")[0]
        found_before = quantity in source.vehicle.unknown or of_model
        by_place.setdefault(taken if found_before else "the config", []).append(words)
    return len(said), [f"{joined(words)} against {place}" for place, words in by_place.items()]


def _farther_off(playback: PlaybackChange) -> list[str]:
    """List the signals that the model with the effects plays back visibly worse than the model as given."""
    return [
        SIGNALS[signal][0]
        for signal, end in playback.at_end.items()
        if less(end.before + _VISIBLE * end.without_model, end.after)
    ]


def loses_in(playback: PlaybackChange, *, gusts: bool) -> str:
    """Say in what a model with the effects is worse than none, so that it is not to be taken; empty for nothing.

    Of rates it is what its file is trusted by; in gusts no playback has what their rotors answer.
    """
    if playback.at_end and all(end.worse for end in playback.at_end.values()):
        return "all that is played back"
    do_not = not gusts and trust_by_playback(playback) is Trust.DO_NOT_USE
    return f"body rate within {CONTROL_HORIZON:g} s" if do_not else ""


FIGURES = {
    "repeatable": repeatability_drawn(lambda r: (r.repeatability_before, r.repeatability_after)),
    "free-runs": Drawn(
        "Body rates about three axes, measured and simulated before and after, over time",
        6.4,
        _draw_free_runs,
        lambda r: r.run is not None and r.run.measured.any(),
    ),
    "gap-picture": Drawn(
        "The channel with the largest gap over time, measured and simulated",
        2.9,
        _draw_picture,
        lambda r: r.picture is not None,
    ),
    "gap-sizes": sizes_drawn(lambda r: r.gap),
    "playback": playback_drawn(),
    "intervals": intervals_drawn(lambda r: [*r.effects, *r.closest]),
    "flown": Drawn(
        "Mean error by horizon of a simulator's file, as given and as corrected",
        lambda r: errors_height(r.corrected.flown),
        lambda r, figure: draw_errors(r.corrected.flown, figure, names={AFTER: "as corrected"}),
        lambda r: r.corrected and r.corrected.flown and len(r.corrected.flown.horizon_s) > 1 and r.corrected.changes,
    ),
}
WORDS = {
    **GAP_WORDS,
    **by_name(_farther_off, hidden_gaps, _leaving, loses_in),
    "axes": BODY_AXES,
    "finite": np.isfinite,
    "gust_words": axis_words,
    "of_guesses": is_of_guesses,
    "unplayed": lambda playback: [words for name, (words, *_) in SIGNALS.items() if name not in playback.signals],
    "wrong_numbers": _wrong,
}


@stage(Diagnosis, title="What the model misses", figures=FIGURES, words=WORDS, study=True)
def diagnose(run: Run, disagreement: DisagreementArgument, held_out: HeldOutOption = None) -> Diagnosis | None:
    """Name what a model misses, judged on flights that the fit did not see."""
    held_out = held_out or []
    inputs = run.take({"disagreement": disagreement} | numbered_roles("held-out", held_out))
    check_ignored(run.study)
    compared, origin = read_result_of_vehicle(disagreement, Disagreement, run.study)
    if not compared.is_base(run.study.vehicle):
        raise InputError(
            f"{disagreement}: was made with a model that has effects already, or numbers of its own; `cpfls diagnose` "
            "names what a base model misses, so compare without --model, or with an identified model"
        )
    flights = {role: file for role, file in origin.inputs.items() if role.startswith("flight")}
    learned = compared.learned
    unseen = known_by(numbered_roles("held-out", held_out), inputs)
    # A file of an older version knows its flights by no more than their hashes.
    refuse_seen(compared.files or map(LearnedFlight.in_file, flights.values()), unseen)
    held, study = read_flights(held_out, run.study), run.study
    given = [each.flight(study.vehicle, study.gap.ground_height_m) for each in compared.recorded.values()]
    split = split_flights(given, held.flights, study.gap)
    if run.dry_run:
        return None
    found = diagnosed(study, split, (*compared.warnings, *held.warnings), compared.base, progress_of(run.progress))
    found = learned_from(run, replace(found, files=compared.files), flights, learned, unseen, model=disagreement.name)
    to_extend = go_on(run, "extend", run.output, output=run.sibling("extended.h5"))
    to_report = ("cpfls", "report", run.config, disagreement, run.output, "-o", run.sibling("report.html"))
    run.next.append(next_command(run, found, to_extend, to_report, run.output))
    return found


def next_command(job: Job, found: Diagnosis, named: Command, unnamed: Command, diagnosis: Path) -> Command:
    """Give the command that goes on by the verdict: for a gap with a name, or for one without."""
    if found.contradictions:
        return to_correct(job)
    match found.verdict:
        case GapVerdict.NAMED | GapVerdict.PARTIAL:
            # A model that is not to be taken is not gone on with.
            played = found.playback
            left = played is not None and (
                bool(loses_in(played, gusts=any(found.gusts))) or (_farther_off(played) and not any(found.gusts))
            )
            return unnamed if left else named
        case GapVerdict.AMBIGUOUS:
            return go_on(job, "trajectory", "--for", diagnosis, output=job.sibling("path.h5"))
        case GapVerdict.NO_GAP | GapVerdict.NOT_EXCITED:
            return to_fly(job)
    return unnamed


def learned_from(
    run: Run,
    found: Diagnosis,
    flights: dict[str, InputFile],
    learned: Sequence[LearnedFlight],
    held_out: Sequence[LearnedFlight],
    *,
    model: str,
    of: str = "",
) -> Diagnosis:
    """Take the flights of a disagreement, and those that its model learned from, as inputs of a diagnosis.

    Of those held out it is said where the model has learned from them; `model` and `of` name the disagreement that the
    model is of, and the diagnosis among the results of the run.
    """
    run.take_also({**flights, **as_inputs(MODEL_FLIGHT, learned)}, of)
    seen = (*seen_twice(flights.values()), *seen_warnings(f"the model of {model}", learned, held_out))
    return replace(found, learned=tuple(learned), seen=seen)


def diagnosed(
    study: Study,
    split: FlightSplit,
    warnings: Sequence[str],
    base: VehicleModel,
    progress: Callable[[float, str], None],
) -> Diagnosis:
    """Diagnose flights; of a base with effects of its own, those that come on top."""
    model, settings = base.fuzzy, replace(study.gap, ignore=(*study.gap.ignore, *known_already(base)))
    rng, parts = generator(study, "diagnose"), (split.training, split.held_out)
    found = diagnose_flights(*parts, settings, rng, whole=split.whole, model=model, progress=progress)
    change = before_after(*parts, found.held_out, found.model(model), settings, base)
    return Diagnosis.of(found, change, *parts, split.sentence, warnings, base)
