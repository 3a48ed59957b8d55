"""The page of a diagnosis: which effect a model misses, how sure that is, and what the gap becomes with it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import product
from math import ceil
from typing import TYPE_CHECKING

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.artifacts.diagnosis import DiagnosisRecord, FreeRunsGroup, PictureGroup
from cpfls_cli.gap.settings import CLEAR
from cpfls_cli.pages.disagreement import lead
from cpfls_cli.pages.disturbance import gust_table, left_to_gusts
from cpfls_cli.pages.effects import (
    coefficients_table,
    effect_title,
    effects_table,
    intervals_figure,
    parameters_table,
    sets_table,
    share_words,
    titles,
)
from cpfls_cli.pages.first_screen import first_lines, first_screen, model_words, notes_on_flights
from cpfls_cli.pages.gap import (
    AXES,
    BEFORE,
    MEASURED,
    channel_unit,
    channel_words,
    gap_sizes_figure,
    gap_table,
    keep_in_view,
    leaves_view,
    marked,
)
from cpfls_cli.pages.model import trust_box
from cpfls_cli.pages.playback import against_rivals, playback_figure
from cpfls_cli.pages.repeats import again_blocks
from cpfls_cli.pages.sensors import sensor_warnings, sensors_answer, unseen_answer
from cpfls_cli.pages.source import Source, Sources
from cpfls_cli.report.canvas import GREY, in_columns, legend_over, plain_ticks, plot, stacked
from cpfls_cli.report.content import Block, Folded, Heading, Plot, Text
from cpfls_cli.report.numbers import sentence
from cpfls_cli.words import joined

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_BAND = 1.96


def answer(diagnosis: Source[DiagnosisRecord]) -> Iterator[Block]:
    """Say what a model misses, how sure that is, what the flights cannot show, and what to distrust."""
    record = diagnosis.record
    yield from first_lines(record, 1)
    decided = list(_forces_decide(record))
    yield from [Folded("why the forces decide", decided)] if decided else []
    yield from unseen_answer(record.not_excited)
    yield from sensors_answer(record.audit)
    yield from sensor_warnings(record.audit)


def gap_blocks(sources: Sources) -> Iterator[Block]:
    """Say what is missing, or where the gap is if nobody asked yet; notes on the flights come last, folded."""
    several = len(sources.diagnoses) > 1
    for index, diagnosis in enumerate(sources.diagnoses, start=1):
        yield from [Heading(diagnosis.label)] if several else []
        yield from first_screen(diagnosis.record, index)
        yield from (replace(each, text=sentence(each.text)) for each in sensor_warnings(diagnosis.record.audit))
    for extended in sources.extensions:
        if sources.by_hash(extended.made_from("diagnosis")) is None:
            yield trust_box(extended)
    answered = {diagnosis.made_from("disagreement") for diagnosis in sources.diagnoses}
    for disagreement in sources.disagreements:
        if disagreement.sha256 not in answered:
            yield from lead(disagreement)
    diagnoses = [diagnosis.record for diagnosis in sources.diagnoses]
    yield from notes_on_flights([*diagnoses, *(disagreement.record for disagreement in sources.disagreements)])


def _forces_decide(record: DiagnosisRecord) -> Iterator[Text]:
    """Explain why torque alone, and torque and force together, name different effects."""
    if record.forces_decide:
        alone, share = record.torque_alone.name[0], share_words(float(record.torque_alone.share[0]))
        yield Text(
            f"From the torques alone it would be {effect_title(alone)}, which explains {share} of their gap: about the "
            "body axes the two look alike. A force at the hubs or the fuselage also accelerates the vehicle, and "
            f"together with the forces the flights point to {joined(titles(record.effects_of_motion))}. Without an "
            "accelerometer or a velocity, only the first name could be given.",
            "note",
        )


def diagnosis_blocks(diagnosis: Source[DiagnosisRecord], index: int) -> Iterator[Block]:
    """Show what a diagnosis rests on; its verdict stands in the summary."""
    record = diagnosis.record
    yield from again_blocks(record.again_before, record.again_after, index, "diagnosed")
    yield Heading(f"Measured and simulated, {diagnosis.label}")
    after, run = model_words(record), record.run
    if run is None:
        yield Text("The held-out flights are too short to simulate a stretch of them.", "note")
    elif not run.measured.any():
        yield Text("The held-out flights have no body rates to simulate.", "note")
    else:
        yield free_runs_figure(f"free-runs-{index}", run, after, repaired=bool(record.audit.faults))
    if record.picture is not None:
        yield gap_picture_figure(f"gap-picture-{index}", record.picture, after)
    yield Heading("The gap on held-out flights")
    yield from _sizes(record, index)
    if record.disturbance is not None and (record.gusts or record.gusts_beside):
        yield Heading("Gusts")
        yield from [Text(left_to_gusts(record.gusts, record.disturbance.told_by))] if record.gusts else []
        axes = list(record.disturbance.axes(record.inertia, record.base.mass))
        yield gust_table(f"gusts-{index}", axes, record.disturbance)
    yield Heading("Effects and their numbers")
    yield from _effects(record, index)


def _sizes(record: DiagnosisRecord, index: int) -> Iterator[Block]:
    caption = (
        "The gap on flights held out from the fit, root mean square. A floor is what noise "
        f"{'and gusts' if record.gusts else 'alone'} would leave; a gap of up to {CLEAR:g} floors does not count."
    )
    yield gap_table(f"gap-{index}", record.gap, caption)
    if record.gap.known:
        yield gap_sizes_figure(f"gap-sizes-{index}", record.gap)
    if record.playback is not None:
        yield from (Text(each) for each in against_rivals(record.playback.by_horizon))
        drawn = playback_figure(f"prediction-error-{index}", record.playback.by_horizon, "the model with the effects")
        yield from [drawn] if drawn else []
    if record.whiteness is not None and len(record.whiteness.lag) > 1:
        yield whiteness_figure(f"whiteness-{index}", record)


def _effects(record: DiagnosisRecord, index: int) -> Iterator[Block]:
    effects = record.effects
    if effects.effect.name:
        yield effects_table(f"effects-{index}", effects)
        yield from [sets_table(f"sets-{index}", record.sets.rows())] if record.sets and record.sets.effects else []
    else:
        yield Text("No effect of the catalogue is named.")
    if effects.coefficient.name:
        yield coefficients_table(f"coefficients-{index}", effects)
        drawn = intervals_figure(f"intervals-{index}", effects)
        yield from [drawn] if drawn else []
    yield from _forces_decide(record)
    if effects.parameter.name:
        yield parameters_table(f"parameters-{index}", effects)


def free_runs_figure(name: str, run: FreeRunsGroup, after: str, *, repaired: bool) -> Plot:
    """Draw measured and simulated body rates over the stretch in which they disagreed most.

    Parameters
    ----------
    after : str
        What the second model is, for the caption.
    repaired : bool
        Whether faults of the sensors were taken out of the measured rates.
    """
    curves = {"measured": run.measured, "before": run.before, "after": run.after}
    parts = np.split(np.arange(len(run.time)), np.searchsorted(run.time, run.restart[1:] - 1e-9))
    rates = [{key: values[:, index] for key, values in curves.items()} for index in range(len(AXES))]

    def draw(figure: Figure) -> None:
        panels = stacked(figure, len(AXES) + 1)
        for axes, start in product(panels, run.restart):
            axes.axvline(start, color=GREY, linewidth=1.2, linestyle=(0, (1, 1.5)), zorder=0.5)
        for axes, about, axis in zip(panels, rates, AXES, strict=False):
            _draw_runs(axes, run.time, about, parts, f"body rate about {axis}")
            keep_in_view(axes, (about["measured"], about["after"]), about["before"])
        errors = {key: curves[key][:, run.axis] - run.measured[:, run.axis] for key in ("before", "after")}
        _draw_runs(panels[-1], run.time, errors, parts, f"simulated less measured about {AXES[run.axis]}")
        panels[-1].axhline(0.0, color="black", linewidth=0.8)
        legend_over(figure, panels[0])
        panels[-1].set_xlabel("time, s")

    astray = [
        axis
        for axis, about in zip(AXES, rates, strict=True)
        if leaves_view((about["measured"], about["after"]), about["before"])
    ]
    leaves = f" About {' and '.join(astray)} the model as given leaves the figure." if astray else ""
    faults = " Measured: the rates without the faults of the sensors; before: starts from the log as it is."
    caption = (
        f"{run.flight}, where the model as given was farthest off (about {AXES[run.axis]}). At each dotted line the "
        "simulation starts from the measured rates and then runs freely on the rotor speeds of the flight. Before: the "
        f"model as given; after: {after}.{faults if repaired else ''}{leaves}"
    )
    description = "Body rates about three axes, measured and simulated before and after, over time"
    return plot(name, caption, description, 6.4, draw)


def _draw_runs(axes: Axes, time: Array, curves: dict[str, Array], runs: Sequence[IntArray], title: str) -> None:
    labels = {"measured": "measured", "before": "simulated before", "after": "simulated after"}
    styles = {"measured": MEASURED, "before": BEFORE, "after": marked(len(time) // len(runs))}
    for index, rows in enumerate(runs):
        for key, values in curves.items():
            axes.plot(time[rows], values[rows], label=labels[key] if index == 0 else None, **styles[key])
    plain_ticks(axes.yaxis)
    axes.set_title(title)
    axes.set_ylabel("rad/s")


def gap_picture_figure(name: str, picture: PictureGroup, after: str) -> Plot:
    """Draw the channel with the largest gap over the stretch in which it is largest."""
    channel = channel_words(picture.channel)

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        axes.plot(picture.time, picture.measured, label="measured", **MEASURED)
        axes.plot(picture.time, picture.before, label="simulated before", **BEFORE)
        axes.plot(picture.time, picture.after, label="simulated after", **marked(len(picture.time)))
        keep_in_view(axes, (picture.measured, picture.after), picture.before)
        plain_ticks(axes.yaxis)
        axes.set_ylabel(f"{channel}, {channel_unit(picture.channel)}")
        axes.set_xlabel("time, s")
        legend_over(figure, axes)

    caption = (
        f"The {channel} of {picture.flight} where its gap is largest, averaged over smooth windows. Measured: what the "
        f"measured motion takes; before: what the model as given provides; after: {after}."
    )
    return plot(name, caption, f"{channel} over time, measured and simulated", 2.9, draw)


def whiteness_figure(name: str, record: DiagnosisRecord) -> Plot:
    """Draw the autocorrelation of the gap by channel, torques above forces, with the band of white noise."""
    white, gap = record.whiteness, record.gap
    assert white is not None, "asked for by the caller"
    steps = np.diff(record.residual.time)
    hop = float(np.median(steps[steps > 0])) if (steps > 0).any() else 1.0
    # Windows a lag apart share no sample.
    independent = len(record.residual.time) * hop / float(white.lag[0])
    band = _BAND / np.sqrt(max(independent, 1.0))
    rows = ceil(len(gap.known) / len(AXES))

    def draw(figure: Figure) -> None:
        panels = in_columns(figure, len(gap.known), len(AXES), share_y=True).ravel()[: len(gap.known)]
        for axes, index in zip(panels, gap.known, strict=True):
            axes.set_title(gap.channel[index])
            plain_ticks(axes.yaxis)
            axes.axhspan(-band, band, color="#e6e6e6", label="white noise", zorder=0)
            axes.axhline(0.0, color="#999999", linewidth=0.7)
            axes.plot(white.lag, white.before[:, index], label="before", **BEFORE)
            axes.plot(white.lag, white.after[:, index], label="after", **marked(len(white.lag)))
            axes.set_ylim(-1.05, 1.05)
        middle = min(len(AXES) * (rows - 1) + 1, len(panels) - 1)
        panels[middle].set_xlabel("distance in time, s")
        panels[0].set_ylabel("correlation")
        legend_over(figure, panels[0])

    caption = (
        "Correlation of the gap with itself some time later, on held-out flights. Noise stays within the grey band; "
        "a gap that keeps its sign for seconds has a cause."
    )
    return plot(name, caption, "Autocorrelation of the gap before and after, by channel", 0.9 + 1.6 * rows, draw)
