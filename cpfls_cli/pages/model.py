"""The page of a model, whoever found it: how far to trust it, what it is, how it was found and what it learned from."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import Any

from cpfls_cli import page
from cpfls_cli.artifacts.model import AnyModel
from cpfls_cli.artifacts.vehicle_model import FOUND_AS, Vehicle, name_of
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.inertia import INERTIA_PARAMETERS
from cpfls_cli.pages.gap import effect_title, unit_words
from cpfls_cli.pages.trust import learned_words, model_words, stopped_words
from cpfls_cli.report.content import Text, impossible, number, plain
from cpfls_cli.words import by_name, joined

WORDS: Mapping[str, Any] = {
    **by_name(impossible, learned_words, name_of, plain, stopped_words, unit_words),
    "FOUND_AS": FOUND_AS,
    "INERTIA_PARAMETERS": INERTIA_PARAMETERS,
    "effect_name": lambda name: "numbers refitted" if CATALOGUE[name].kind == "parameter" else effect_title(name),
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
