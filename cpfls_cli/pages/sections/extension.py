"""Models with the effects that they missed in them."""

from __future__ import annotations

from collections.abc import Iterator

from cpfls_cli.inertia import INERTIA_PARAMETERS
from cpfls_cli.pages.figures.gap_sizes import gap_sizes_figure
from cpfls_cli.pages.figures.intervals import intervals_figure
from cpfls_cli.pages.figures.replay import has_replay, replay_figure
from cpfls_cli.pages.gap_words import joined, known_channels, titles_of
from cpfls_cli.pages.sections.gap_tables import coefficients_table, gap_table, parameters_table
from cpfls_cli.pages.source import Source, Sources, section_of_each
from cpfls_cli.report.content import Block, Facts, Heading, Section, Table
from cpfls_cli.report.numbers import number


def extension_section(sources: Sources) -> Section | None:
    """Show the extended models; what stands in their diagnosis is not shown again.

    Returns
    -------
    Section or None
        None where none was given.
    """
    return section_of_each(
        "extension",
        "The extended model",
        sources.extensions,
        lambda extended, index: _extension(extended, index, sources.by_hash(extended.made_from("diagnosis")) is None),
    )


def _extension(extended: Source, index: int, alone: bool) -> Iterator[Block]:
    artifact = extended.artifact
    base = {"rigid-body": "the rigid body of the vehicle", "model": "an identified model"}
    yield Heading(extended.label)
    yield Facts(
        [
            ("Built on", base.get(artifact.text("base/kind"), artifact.text("base/kind"))),
            ("Extended by", joined(titles_of(extended) or ["nothing"])),
            ("Thrust, relative to the vehicle", number(artifact.number("thrust_scale"), 5)),
        ]
    )
    yield _inertia(extended, index)
    yield coefficients_table(f"extended-coefficients-{index}", extended)
    yield gap_table(
        f"extended-gap-{index}", extended, f"Gap of {extended.label} on held-out flights, refitted together."
    )
    if alone:
        yield from _figures(extended, index)


def _inertia(extended: Source, index: int) -> Table:
    artifact = extended.artifact
    given = [*extended.vehicle.inertia_kg_m2, *[0.0] * 6][:6]
    # Without a rigid body underneath, the six numbers are what the model gets on top of its own.
    own = artifact.text("base/kind") == "rigid-body"
    before = [number(value) if own else "" for value in given]
    rows = [list(row) for row in zip(INERTIA_PARAMETERS, before, map(number, artifact.array("inertia")), strict=True)]
    header = ("kg m²", "Vehicle", "Extended model" if own else "Added")
    return Table(f"extended-inertia-{index}", "Inertia, refitted with the effects.", header, rows)


def _figures(extended: Source, index: int) -> Iterator[Block]:
    if known_channels(extended, "gap/before_floors"):
        yield gap_sizes_figure(f"extended-gap-sizes-{index}", extended)
    if has_replay(extended):
        yield replay_figure(f"extended-prediction-error-{index}", extended, "on held-out flights")
    drawn = intervals_figure(f"extended-intervals-{index}", extended)
    yield from [] if drawn is None else [drawn]
    if extended.artifact.texts("parameter/name"):
        yield parameters_table(f"extended-parameters-{index}", extended)
