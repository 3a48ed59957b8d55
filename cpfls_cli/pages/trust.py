"""How far to trust a model, whether it has seen a flight, and what is said of logs that contradict themselves."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator, Sequence
from math import isfinite
from typing import NamedTuple

from cpfls_cli.artifacts.model import AnyModel, LearnedFlight
from cpfls_cli.consistency.findings import as_contradiction
from cpfls_cli.report.content import Tone, sentence
from cpfls_cli.validation.trust import Trust
from cpfls_cli.words import joined


class Words(NamedTuple):
    """A word of trust as people read it: in a cell of a table or, in capitals, before a box; and as a sentence."""

    short: str
    sentence: str
    tone: Tone


_WORDS: dict[str, Words] = {
    Trust.SIMULATION: Words("good for simulation and control", "Good for simulation and control", "good"),
    Trust.CONTROL: Words("good for control", "Good for control", "good"),
    Trust.INSIDE: Words(
        "good inside its region", "Good inside the region that training visited, and only there", "note"
    ),
    Trust.NOT_JUDGED: Words("not judged", "Not judged", "note"),
    Trust.LACKING: Words(
        "constants of the vehicle, which lacks an effect", "Constants of the vehicle, but it lacks an effect", "note"
    ),
    Trust.NOT_CONTROL: Words("not for control", "Predicts, but is not for control", "warning"),
    Trust.NOT_DETERMINED: Words("constants not determined", "Its constants are not determined", "warning"),
    Trust.LOOP: Words(
        "not judged: the flights show the loop", "Not judged: these flights show the loop, not the vehicle", "warning"
    ),
    Trust.RIGID_BODY: Words("no better than a rigid body", "Not better than the rigid body", "warning"),
    Trust.DO_NOT_USE: Words("do not use", "Do not use it", "warning"),
}

_TONES: tuple[Tone, ...] = ("plain", "good", "note", "warning")


def trust_words(trust: str) -> Words:
    """Put a word of trust as people read it; one that a newer program wrote stands as it is."""
    return _WORDS.get(trust, Words(trust, trust, "note"))


def model_words(model: AnyModel) -> Words:
    """Put how far to trust a model; of one that is judged as a forecast and as the vehicle both, in the worse tone."""
    words = [trust_words(word) for word in dict.fromkeys(model.judged_as.values())]
    if len(words) == 1:
        return words[0]
    said = [(name, trust_words(word)) for name, word in model.judged_as.items()]
    tone = max((each.tone for _, each in said), key=_TONES.index)
    return Words(
        "; ".join(f"{name} {each.short}" for name, each in said),
        "; ".join(f"{name}: {each.sentence[:1].lower()}{each.sentence[1:]}" for name, each in said),
        tone,
    )


def stopped_words(model: AnyModel) -> str:
    """Say why the search for a model ended before its end, and how to go on; empty where it did not."""
    reason = model.stopped
    said = reason if reason in ("", "interrupted") else f"stopped ({reason.replace('-', ' ')})"
    return said and f"{said}, go on with `cpfls {model.MADE_BY} ... --resume`"


def learned_words(model: AnyModel) -> str:
    """Name the flights that a model learned from, each with the part of it."""
    flights = [_with_part(flight) for flight in model.learned_from]
    return joined(flights) if flights else "the file does not say"


def _with_part(flight: LearnedFlight) -> str:
    part = "" if flight.samples is None else f", {_part(flight) if not flight.whole else f'{flight.of} samples'}"
    return f"{flight.name} (sha256 {flight.sha256[:12]}{part})"


def seen_warnings(model: str, learned: Sequence[LearnedFlight], judged: Iterable[LearnedFlight]) -> Iterator[str]:
    """Warn of flights that judge a model and that it has learned from, or from a part of them."""
    for own in judged:
        flight = next((each for each in learned if each.shared_with(own)), None)
        if flight is not None:
            what, it = ("it", "it") if flight.whole else (_part(flight), "that")
            begin, end = flight.shared_with(own) or (0.0, 0.0)
            if isfinite(begin) and (begin, end) != (own.begins, own.ends):
                what, it = f"{begin:.1f} to {end:.1f} s of its log", "that"
            yield f"{own.name}: {model} has learned from {what}, so {it} says nothing about unseen flights"


def _part(flight: LearnedFlight) -> str:
    return f"its first {flight.samples} of {flight.of} samples"


def contradicted(first: str) -> str:
    """Say before anything else that a log contradicts itself or its config, and where it does so first."""
    return sentence(as_contradiction(sentence(first)))


NOTHING_COMES = (
    "Nothing is searched, for nothing found could be used. Correct what is wrong, in the section `import` of the "
    "config or in `vehicle`, or leave that flight out; --anyway searches all the same."
)
"""What to do about logs that contradict themselves."""


def tell_before_search(contradictions: Sequence[str]) -> None:
    """Say at once, above the progress, that what a long search finds cannot be used."""
    if contradictions:
        logging.getLogger("cpfls_cli").warning("%s No model found in it can be used.", contradicted(contradictions[0]))
