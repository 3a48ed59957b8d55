"""How an extended model was found: the effects in it, and what the gap becomes with them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from cpfls_cli.artifacts.extended import ExtendedRecord
from cpfls_cli.artifacts.playback import by_horizon
from cpfls_cli.inertia import INERTIA_PARAMETERS
from cpfls_cli.pages.effects import coefficients_table, intervals_figure, named_sentences, parameters_table, titles
from cpfls_cli.pages.gap import gap_sizes_figure, gap_table
from cpfls_cli.pages.playback import against_rivals, playback_figure, trust_sentences
from cpfls_cli.pages.source import Source, Sources
from cpfls_cli.pages.trust import trust_words
from cpfls_cli.report.content import Block, Facts, Folded, Heading, Table, Text
from cpfls_cli.report.numbers import number, sentence
from cpfls_cli.words import joined


def details(extended: Source[ExtendedRecord]) -> Iterator[Block]:
    """Say what the gap of an extended model becomes, and about which axes it gets worse."""
    rest: list[Block] = [_gap_table(extended, 1), *_played(extended.record)]
    yield Folded("the gap and the playback before and after", rest)
    yield from (Text(warning, "warning") for warning in warnings(extended.record))


def title(record: ExtendedRecord) -> str:
    """Say what an extended model is."""
    return f"the model with {_by(record)}."


def grounds(record: ExtendedRecord) -> Iterator[str]:
    """Say how far to trust an extended model, what it was extended by, and how its largest gap changes."""
    yield from _trusted(record)
    yield from named_sentences(record.effects.named)
    yield _shrunk(record)


def _trusted(record: ExtendedRecord) -> list[str]:
    return trust_sentences(record.trust, by_horizon(record.playback), None, record.audit.contradiction)


def _played(record: ExtendedRecord) -> Iterator[Text]:
    yield from map(Text, against_rivals(by_horizon(record.playback)))


def _shrunk(record: ExtendedRecord) -> str:
    before, after = (float(np.nanmax(floors)) for floors in (record.gap.before_floors, record.gap.after_floors))
    return f"On held-out flights its largest gap is {number(after, 2)} noise floors; it was {number(before, 2)}."


def worth(record: ExtendedRecord) -> Iterator[str]:
    """Say what a model that is used elsewhere is worth, and what has to be repaired in the signals that it is given."""
    if trust_words(record.trust).tone != "warning":
        yield _trusted(record)[0]
    yield _shrunk(record)
    yield from (
        f"Not in the model, to be repaired in the signals that it is given: {fault}"
        for fault in (*record.audit.settled, *record.audit.faults)
    )


def cautions(record: ExtendedRecord) -> Iterator[str]:
    """Say what speaks against an extended model, wherever it is taken."""
    if trust_words(record.trust).tone == "warning":
        yield from _trusted(record)
    yield from map(sentence, warnings(record))


def model_with(label: str, record: ExtendedRecord) -> str:
    """Say which effects the model of a file has in it."""
    return f"{label}: {title(record)}"


def warnings(record: ExtendedRecord) -> list[str]:
    """Warn of axes that the extension serves ill, although it serves the whole well."""
    gap = record.gap
    return [
        f"held out, {gap.channel[index]}: the gap grows, {gap.before_floors[index]:.3g} -> "
        f"{gap.after_floors[index]:.3g} floors, although the sum over all channels shrinks"
        for index in gap.worse_axes
    ]


def _by(record: ExtendedRecord) -> str:
    return joined(titles(record.effects.names()) or ["nothing"])


def extension_blocks(extended: Source[ExtendedRecord], index: int, sources: Sources) -> Iterator[Block]:
    """Show an extended model; what stands in its diagnosis is not shown again."""
    record = extended.record
    yield Heading(extended.label)
    yield Facts(
        [
            (
                "Built on",
                "the rigid body of the vehicle" if record.vehicle.inertia_functions is None else "an identified model",
            ),
            ("Extended by", _by(record)),
            ("Thrust, relative to the vehicle", number(record.thrust_scale, 5)),
        ]
    )
    yield _inertia_table(extended, index)
    yield coefficients_table(f"extended-coefficients-{index}", record.effects)
    yield _gap_table(extended, index)
    yield from (Text(warning, "warning") for warning in warnings(record))
    if sources.by_hash(extended.made_from("diagnosis")) is None:
        yield from _figures(record, index)


def _inertia_table(extended: Source[ExtendedRecord], index: int) -> Table:
    record = extended.record
    given = [*extended.vehicle.inertia_kg_m2, *[0.0] * 6][:6]
    # Without a rigid body underneath, the six numbers are what the model gets on top of its own.
    whole = record.vehicle.inertia_functions is None
    before = [number(value) if whole else "" for value in given]
    rows = [list(row) for row in zip(INERTIA_PARAMETERS, before, map(number, record.inertia), strict=True)]
    header = ("kg m²", "Vehicle", "Extended model" if whole else "Added")
    return Table(f"extended-inertia-{index}", "Inertia, refitted with the effects.", header, rows)


def _gap_table(extended: Source[ExtendedRecord], index: int) -> Table:
    caption = f"Gap of {extended.label} on held-out flights, refitted together."
    return gap_table(f"extended-gap-{index}", extended.record.gap, caption)


def _figures(record: ExtendedRecord, index: int) -> Iterator[Block]:
    if record.gap.known:
        yield gap_sizes_figure(f"extended-gap-sizes-{index}", record.gap)
    yield from _played(record)
    drawn = (
        record.playback
        and playback_figure(
            f"extended-prediction-error-{index}", record.playback.by_horizon, "the model with the effects"
        ),
        intervals_figure(f"extended-intervals-{index}", record.effects),
    )
    yield from (plot for plot in drawn if plot)
    if record.effects.parameter.name:
        yield parameters_table(f"extended-parameters-{index}", record.effects)
