"""The page of a model, whoever found it: how far to trust it, what it is, how it was found and what it learned from."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from importlib import import_module
from typing import Any, NamedTuple

from cpfls_cli import page
from cpfls_cli.artifacts.model import AnyModel, LearnedFlight, part_learned
from cpfls_cli.artifacts.vehicle_model import FOUND_AS, Vehicle, name_of
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.inertia import INERTIA_PARAMETERS
from cpfls_cli.pages.gap import effect_title, unit_words
from cpfls_cli.report.content import Text, Tone, impossible, number, plain
from cpfls_cli.validation.verdict import Trust
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

KnownBy = Iterable[tuple[str, Collection[str]]]
"""Flights by file name, each with the hashes of its file and of its log."""


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


def seen_warnings(model: str, learned: Sequence[LearnedFlight], judged: KnownBy) -> Iterator[str]:
    """Warn of flights that judge a model and that it has learned from.

    Parameters
    ----------
    judged : iterable of (str, collection of str)
        Of each flight its file name, and the SHA-256 of the file and of the log that it was imported from.
    """
    for name, hashes in judged:
        flight = part_learned(learned, hashes)
        if flight is not None:
            what, it = ("it", "it") if flight.whole else (_part(flight), "that")
            yield f"{name}: {model} has learned from {what}, so {it} says nothing about unseen flights"


def _part(flight: LearnedFlight) -> str:
    return f"its first {flight.samples} of {flight.of} samples"


def _effect_name(name: str) -> str:
    return "numbers refitted" if CATALOGUE[name].kind == "parameter" else effect_title(name)


WORDS: Mapping[str, Any] = {
    "FOUND_AS": FOUND_AS,
    "INERTIA_PARAMETERS": INERTIA_PARAMETERS,
    "effect_name": _effect_name,
    "impossible": impossible,
    "learned_words": learned_words,
    "name_of": name_of,
    "plain": plain,
    "stopped_words": stopped_words,
    "unit_words": unit_words,
    "words_of": model_words,
}
"""What templates of models know (`model_parts.md.j2`)."""


def cautions_of(record: AnyModel, path: object, cautions: tuple[str, ...] = ()) -> tuple[str, ...]:
    """Say what speaks against the use of a model, wherever it is used; what it rests on itself included.

    Parameters
    ----------
    path : Path or str
        As the model is called in the sentences.
    cautions : tuple of str
        Of its file.
    """
    said = list(cautions)
    if record.stopped:
        said.append(f"{path}: is incomplete: its search was {stopped_words(record)}")
    return (*said, *(f"{path}: {each}" for each in against(record)))


def said_by(stage: str, given: Any, part: str) -> list[str]:
    """Say one part of what a stage says of its models, sentence by sentence (`said_of_vehicle.md.j2`, for example)."""
    own = import_module(f"cpfls_cli.stages.{stage}").WORDS
    blocks = page.blocks(page.words(f"said_of_{stage}", given, added=own, part=part))
    return [block.text for block in blocks if isinstance(block, Text)]


def slow_words(vehicle: Vehicle) -> str:
    """Say of logs too slow for what a flight is asked to show that no flight helps before they are faster, and how."""
    return " ".join(said_by("vehicle", vehicle, "slow"))


def against(record: AnyModel) -> list[str]:
    """Say what speaks against a model itself."""
    return said_by(record.MADE_BY, record, "against")


def impossible_in_words(record: AnyModel) -> str:
    """List the numbers of a model that no such vehicle has, with their values; empty where all can be."""
    moments = zip(INERTIA_PARAMETERS, record.model.vehicle.inertia_kg_m2, strict=False)
    known = {f"inertia.{name}": (value, "kg m^2") for name, value in moments}
    if isinstance(record, Vehicle):
        known |= {name: (own.value, own.unit) for name, own in record.found.items()}
    shown = ((name_of(name), *known[name]) for name in record.impossible)
    return joined(f"{name} {number(value, 3)} {unit}".removesuffix(" 1") for name, value, unit in shown)


def worth_in_words(record: AnyModel) -> list[str]:
    """Say what a model that is used elsewhere is worth."""
    return said_by(record.MADE_BY, record, "usage")
