"""The gap workflow in the summary: the verdict first, then the gap before and after."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from cpfls_cli.pages.gap_verdict import verdict_box
from cpfls_cli.pages.gap_words import channel_words, joined, sentence, titles_of
from cpfls_cli.pages.sections.gap_tables import gap_table
from cpfls_cli.pages.source import Source, Sources
from cpfls_cli.report.content import Block, Box, Facts, Heading, Text
from cpfls_cli.report.numbers import number

_SIGNIFICANT = 0.05


def gap_blocks(sources: Sources) -> Iterator[Block]:
    """Say what is missing, or where the gap is if nobody asked yet."""
    several = len(sources.diagnoses) > 1
    for index, diagnosis in enumerate(sources.diagnoses, start=1):
        yield from [Heading(diagnosis.label)] if several else []
        yield from _diagnosis(diagnosis, index)
    for extended in sources.extensions:
        if sources.by_hash(extended.made_from("diagnosis")) is None:
            yield _extension(extended)
    answered = {diagnosis.made_from("disagreement") for diagnosis in sources.diagnoses}
    for disagreement in sources.disagreements:
        if disagreement.sha256 not in answered:
            yield _disagreement(disagreement)
        yield from [Text(sentence(warning), "warning") for warning in disagreement.artifact.texts("warning")]


def _diagnosis(diagnosis: Source, index: int) -> Iterator[Block]:
    artifact = diagnosis.artifact
    yield verdict_box(diagnosis)
    caption = (
        "The gap on flights held out from the fit, root mean square. A floor is what noise alone would leave; a gap of "
        "about one floor is no gap."
    )
    yield gap_table(f"gap-{index}", diagnosis, caption)
    roles = {
        word: [
            name
            for name, role in zip(artifact.texts("flight/name"), artifact.texts("flight/role"), strict=True)
            if role == key
        ]
        for key, word in (("training", "Fitted to"), ("held-out", "Held out"))
    }
    yield Facts(
        [*((word, ", ".join(names)) for word, names in roles.items()), ("Why", sentence(artifact.text("split")))]
    )
    audit = artifact.texts("audit/note")
    yield from [Text(note, "note") for note in artifact.texts("note") if note not in audit]


def _extension(extended: Source) -> Box:
    titles = titles_of(extended)
    artifact = extended.artifact
    before, after = (float(np.nanmax(artifact.array(f"gap/{key}_floors"))) for key in ("before", "after"))
    shrunk = f"On held-out flights its largest gap is {number(after, 2)} noise floors; it was {number(before, 2)}."
    return Box("EXTENDED MODEL", f"{extended.label}: the model with {joined(titles or ['nothing'])}.", [shrunk])


def _disagreement(disagreement: Source) -> Box:
    artifact = disagreement.artifact
    floors = artifact.array("gap/floors")
    if not np.isfinite(floors).any():
        return Box("GAP", f"{disagreement.label}: no gap could be measured.", [], "warning")
    worst = int(np.nanargmax(floors))
    channel = artifact.texts("gap/channel")[worst]
    if floors[worst] <= 1.0:
        return Box("GAP", "Model and flights agree to the noise.", [], "good")
    title = f"The gap is largest in the {channel_words(channel)}: {number(floors[worst], 3)} noise floors."
    return Box("GAP", title, [*_follows(disagreement, channel), "Run `cpfls diagnose` to learn what is missing."])


def _follows(disagreement: Source, channel: str) -> Iterator[str]:
    artifact = disagreement.artifact
    columns = (artifact.texts("dependence/channel"), artifact.texts("dependence/signal"))
    sure = artifact.array("dependence/p_value") < _SIGNIFICANT
    signals = [signal for own, signal, certain in zip(*columns, sure, strict=True) if own == channel and certain]
    if signals:
        yield f"It follows {joined(signals[:2])} most."
