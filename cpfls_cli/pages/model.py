"""The page of a model, whoever found it: how far to trust it, what it is, how it was found and what it learned from."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from importlib import import_module
from typing import Any, NamedTuple

from cpfls_cli import page
from cpfls_cli.artifacts.identified import IdentifiedModel
from cpfls_cli.artifacts.model import AnyModel
from cpfls_cli.artifacts.parameters import FOUND_AS, name_of
from cpfls_cli.artifacts.vehicle_model import Vehicle
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.inertia import INERTIA_PARAMETERS
from cpfls_cli.pages.effects import effect_title, unit_words
from cpfls_cli.pages.source import Source, Sources
from cpfls_cli.pages.trust import learned_words, model_words, stopped_words
from cpfls_cli.report.content import Block, Box, Heading, Text, impossible
from cpfls_cli.report.numbers import number, plain
from cpfls_cli.words import joined


class _Kind(NamedTuple):
    """Words on a model that was not found as a whole vehicle: what it is, what its trust rests on.

    Attributes
    ----------
    title, grounds : callable
        Of a record: what the model is, and the sentences behind the word of trust.
    worth, cautions : callable
        Of a record: what it is worth that is used elsewhere, and what speaks against that.
    """

    title: Callable[[Any], str]
    grounds: Callable[[Any], Iterator[str]]
    worth: Callable[[Any], Iterator[str]]
    cautions: Callable[[Any], Iterator[str]]


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


def _kind_of(record: Any) -> _Kind:
    own = import_module(f"cpfls_cli.pages.{'identification' if isinstance(record, IdentifiedModel) else 'extended'}")
    return _Kind(own.title, own.grounds, own.worth, own.cautions)


def answer(model: Source[Any]) -> Iterator[Block]:
    """Say of a model that is no result yet how far to trust it and why, and what was found."""
    yield trust_box(model)
    yield from import_module("cpfls_cli.pages.extended").details(model)


def trust_box(model: Source[Any]) -> Box:
    """Say how far to trust a model, and why."""
    record = model.record
    kind, words = _kind_of(record), model_words(record)
    stopped = stopped_words(record)
    title = f"{model.label}: {f'{stopped}; ' if stopped else ''}{kind.title(record)}"
    return Box(words.short.upper(), title, list(kind.grounds(record)), words.tone)


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


def vehicle_words(vehicle: object, part: str) -> list[str]:
    """Say one part of what is said of a vehicle that was found, sentence by sentence (`said_of_vehicle.md.j2`)."""
    own = import_module("cpfls_cli.stages.vehicle").WORDS
    blocks = page.blocks(page.words("said_of_vehicle", vehicle, added=own, part=part))
    return [block.text for block in blocks if isinstance(block, Text)]


def slow_words(vehicle: Vehicle) -> str:
    """Say of logs too slow for what a flight is asked to show that no flight helps before they are faster, and how."""
    return " ".join(vehicle_words(vehicle, "slow"))


def against(record: AnyModel) -> list[str]:
    """Say what speaks against a model itself."""
    return vehicle_words(record, "against") if isinstance(record, Vehicle) else list(_kind_of(record).cautions(record))


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
    return vehicle_words(record, "usage") if isinstance(record, Vehicle) else list(_kind_of(record).worth(record))


def model_blocks(model: Source[Any], index: int, sources: Sources) -> Iterator[Block]:
    """Say what a model is, part by part."""
    yield from [Heading(model.label)] if len(recorded_models(sources)) > 1 else []
    yield from page.blocks(page.words("model_part", model.record, added=WORDS), prefix=f"model-{index}-")


def recorded_models(sources: Sources) -> list[Source[Any]]:
    """List the models that are no results yet: those say themselves what they are."""
    return [source for source in sources.of_kind(AnyModel) if not isinstance(source.record, Vehicle)]
