"""What a model misses: the picture, the gap before and after, the effects with their numbers."""

from __future__ import annotations

from collections.abc import Iterator

from cpfls_cli.pages.figures.free_runs import free_runs_figure
from cpfls_cli.pages.figures.gap_picture import gap_picture_figure
from cpfls_cli.pages.figures.gap_sizes import gap_sizes_figure
from cpfls_cli.pages.figures.intervals import intervals_figure
from cpfls_cli.pages.figures.replay import has_replay, replay_figure
from cpfls_cli.pages.figures.whiteness import whiteness_figure
from cpfls_cli.pages.gap_verdict import levels
from cpfls_cli.pages.gap_words import effect_title, joined, known_channels, titles_of
from cpfls_cli.pages.sections.gap_tables import coefficients_table, effects_table, parameters_table
from cpfls_cli.pages.source import Source, Sources, section_of_each
from cpfls_cli.report.content import Block, Heading, Section, Text


def diagnosis_section(sources: Sources) -> Section | None:
    """Show the diagnoses; their verdicts stand in the summary.

    Returns
    -------
    Section or None
        None where no diagnosis was given.
    """
    return section_of_each("diagnosis", "Before and after", sources.diagnoses, _diagnosis)


def _diagnosis(diagnosis: Source, index: int) -> Iterator[Block]:
    yield Heading(f"Measured and simulated, {diagnosis.label}")
    yield from _pictures(diagnosis, index)
    yield Heading("The gap on held-out flights")
    yield from _sizes(diagnosis, index)
    yield Heading("Effects and their numbers")
    yield from _effects(diagnosis, index)


def after_words(source: Source) -> str:
    """Say what the second model of a diagnosis is."""
    titles = titles_of(source)
    if titles:
        return f"with {joined(titles)}"
    closest = [effect_title(name) for name in source.artifact.texts("effect/name")]
    if closest:
        return f"with the closest effects, {joined(closest)}, which are not the answer"
    return "with nothing but the vehicle's own numbers refitted"


def _pictures(diagnosis: Source, index: int) -> Iterator[Block]:
    data, after = diagnosis.artifact.data, after_words(diagnosis)
    if "run/time" in data and diagnosis.artifact.array("run/measured").any():
        yield free_runs_figure(f"free-runs-{index}", diagnosis, after)
    else:
        lacking = (
            "have no body rates to simulate" if "run/time" in data else "are too short to simulate a stretch of them"
        )
        yield Text(f"The held-out flights {lacking}.", "note")
    if "picture/time" in data:
        yield gap_picture_figure(f"gap-picture-{index}", diagnosis, after)


def _sizes(diagnosis: Source, index: int) -> Iterator[Block]:
    if known_channels(diagnosis, "gap/before_floors"):
        yield gap_sizes_figure(f"gap-sizes-{index}", diagnosis)
    if has_replay(diagnosis):
        yield replay_figure(f"prediction-error-{index}", diagnosis, "on held-out flights")
    if "whiteness/lag" in diagnosis.artifact.data and len(diagnosis.artifact.array("whiteness/lag")) > 1:
        yield whiteness_figure(f"whiteness-{index}", diagnosis)


def _effects(diagnosis: Source, index: int) -> Iterator[Block]:
    artifact = diagnosis.artifact
    if artifact.texts("effect/name"):
        yield effects_table(f"effects-{index}", diagnosis)
    else:
        yield Text("No effect of the catalogue is named.")
    if artifact.texts("coefficient/name"):
        yield coefficients_table(f"coefficients-{index}", diagnosis)
        drawn = intervals_figure(f"intervals-{index}", diagnosis)
        yield from [] if drawn is None else [drawn]
    apart = levels(diagnosis)
    if apart:
        yield Text(apart, "note")
    if artifact.texts("parameter/name"):
        yield parameters_table(f"parameters-{index}", diagnosis)
