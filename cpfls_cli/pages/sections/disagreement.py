"""Where models and flights disagree: axis, time, signals."""

from __future__ import annotations

from collections.abc import Iterator

from cpfls_cli.pages.figures.dependence import dependence_figure, heat_map_figure
from cpfls_cli.pages.figures.replay import has_replay, replay_figure
from cpfls_cli.pages.figures.residual_time import STRETCHES, residual_time_figure
from cpfls_cli.pages.gap_words import channel_unit, channel_words, known_channels, whole_percent
from cpfls_cli.pages.source import Source, Sources, section_of_each
from cpfls_cli.report.content import Block, Cell, Heading, Section, Table, Text
from cpfls_cli.report.numbers import number

_ABOVE_NOISE = 1.0


def disagreement_section(sources: Sources) -> Section | None:
    """Show where models and flights disagree.

    Returns
    -------
    Section or None
        None where no disagreement was given.
    """
    return section_of_each("disagreement", "Where they disagree", sources.disagreements, _disagreement)


def _disagreement(disagreement: Source, index: int) -> Iterator[Block]:
    yield Heading(disagreement.label)
    yield _axes(disagreement, index)
    if not known_channels(disagreement, "gap/floors"):
        return
    yield Heading("When")
    yield residual_time_figure(f"gap-over-time-{index}", disagreement)
    if disagreement.artifact.texts("stretch/channel"):
        yield _stretches(disagreement, index)
    yield Heading("What it follows")
    yield from _signals(disagreement, index)
    if has_replay(disagreement):
        yield Heading("What a simulation makes of it")
        yield replay_figure(f"replay-{index}", disagreement, "on all flights")


def _axes(disagreement: Source, index: int) -> Table:
    artifact = disagreement.artifact
    keys = ("rms", "floor", "floors", "share")
    columns = [artifact.array(f"gap/{key}") for key in keys]
    rows: list[list[str | Cell]] = []
    for place, channel in known_channels(disagreement, "gap/rms"):
        rms, floor, floors, share = (float(column[place]) for column in columns)
        size = Cell(number(floors, 3), "warning" if floors > _ABOVE_NOISE else "plain")
        words = [channel_words(channel), channel_unit(channel)]
        rows.append([*words, number(rms, 3), number(floor, 3), size, whole_percent(share)])
    flights = ", ".join(artifact.texts("flight/name"))
    caption = (
        f"Gap between what the measured motion takes and what the model provides, root mean square over {flights}. "
        "Floor: what noise alone would leave. Share: of the torque or force that moves the vehicle. Marked: above "
        "noise."
    )
    header = ("Channel", "Unit", "Gap", "Noise floor", "In floors", "Share")
    return Table(f"gap-by-axis-{index}", caption, header, rows, frozenset({0, 1}))


def _stretches(disagreement: Source, index: int) -> Table:
    artifact = disagreement.artifact
    flights = artifact.texts("flight/name")
    numbers = (artifact.array(f"stretch/{key}")[:STRETCHES] for key in ("flight", "start", "end", "floors"))
    channels = artifact.texts("stretch/channel")[:STRETCHES]
    rows = [
        [str(rank), flights[int(flight)], channel_words(channel), f"{start:.1f} … {end:.1f}", number(floors, 3)]
        for rank, (flight, start, end, floors, channel) in enumerate(zip(*numbers, channels, strict=True), start=1)
    ]
    caption = "The stretches in which the gap is largest, on the clock of each flight."
    header = ("Rank", "Flight", "Channel", "Time, s", "In floors")
    return Table(f"stretches-{index}", caption, header, rows, frozenset({0, 1, 2}))


def _signals(disagreement: Source, index: int) -> Iterator[Block]:
    artifact = disagreement.artifact
    floors, told = artifact.array("gap/floors"), set(artifact.texts("dependence/channel"))
    known = known_channels(disagreement, "gap/floors")
    above = [channel for place, channel in known if floors[place] > _ABOVE_NOISE and channel in told]
    if not above:
        yield Text("No channel has a gap above noise, so there is nothing to follow.")
        return
    yield dependence_figure(f"dependence-{index}", disagreement, above)
    if "heat_map/mean" in artifact.data:
        yield heat_map_figure(f"heat-map-{index}", disagreement)
