"""The page of a model, whoever found it: how far to trust it, what it is, how it was found and what it learned from."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.identified import IdentifiedRecord
from cpfls_cli.artifacts.model import InertiaFunctionsGroup, ModelRecord, ResponseGroup
from cpfls_cli.artifacts.parameters import name_of
from cpfls_cli.artifacts.rebuilt import model_effects
from cpfls_cli.artifacts.spec import rows_of
from cpfls_cli.artifacts.vehicle_model import VehicleRecord
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.inertia import INERTIA_PARAMETERS
from cpfls_cli.pages.effects import effect_title, unit_words
from cpfls_cli.pages.source import Source, Sources
from cpfls_cli.pages.trust import model_words, stopped_words, trust_facts
from cpfls_cli.report.content import Block, Box, Facts, Heading, Table, impossible, in_short
from cpfls_cli.report.numbers import number, plain, whole_percent
from cpfls_cli.words import joined


class _Kind(NamedTuple):
    """How the page of a model goes on by who found it: what it is, what its trust rests on, what was found.

    Attributes
    ----------
    title, grounds : callable
        Of a record: what the model is, and the sentences behind the word of trust.
    details : callable
        Of a source: what stands below the box.
    worth, cautions : callable
        Of a record: what it is worth that is used elsewhere, and what speaks against that.
    """

    title: Callable[[Any], str]
    grounds: Callable[[Any], Iterator[str]]
    details: Callable[[Source[Any]], Iterator[Block]]
    worth: Callable[[Any], Iterator[str]]
    cautions: Callable[[Any], Iterator[str]]


_PAGES = {"identified": "identification", "extended": "extended", "vehicle": "vehicle_model"}
"""Modules of `pages` by the kind of a model; one is loaded when a model of its kind is met."""


_REASONS = 3


def _kind_of(record: ModelRecord) -> _Kind:
    page = import_module(f"cpfls_cli.pages.{_PAGES[record.FORMAT.kind]}")
    return _Kind(page.title, page.grounds, page.details, page.worth, page.cautions)


def answer(model: Source[Any]) -> Iterator[Block]:
    """Say how far to trust a model and why, what was found and how well it does, and what to distrust."""
    box = trust_box(model)
    # The reasons of a verdict are many.
    judged = isinstance(model.record, IdentifiedRecord) and model.record.validated
    yield from in_short(box, _REASONS, "every reason of the verdict") if judged else [box]
    yield from _kind_of(model.record).details(model)


def trust_box(model: Source[Any]) -> Box:
    """Say how far to trust a model, and why."""
    record = model.record
    kind, words = _kind_of(record), model_words(record)
    stopped = stopped_words(record)
    title = f"{model.label}: {f'{stopped}; ' if stopped else ''}{kind.title(record)}"
    return Box(words.short.upper(), title, list(kind.grounds(record)), words.tone)


def cautions_of(record: ModelRecord, path: object) -> tuple[str, ...]:
    """Say what speaks against the use of a model, wherever it is used; what it rests on itself included.

    Parameters
    ----------
    path : Path or str
        As the model is called in the sentences.
    """
    said = [] if record.header is None else list(record.header.cautions)
    if record.stopped:
        said.append(f"{path}: is incomplete: its search was {stopped_words(record)}")
    return (*said, *(f"{path}: {each}" for each in against(record)))


def against(record: ModelRecord) -> Iterator[str]:
    """Say what speaks against a model itself."""
    return _kind_of(record).cautions(record)


def impossible_in_words(record: ModelRecord) -> str:
    """List the numbers of a model that no such vehicle has, with their values; empty where all can be."""
    moments = zip(INERTIA_PARAMETERS, record.vehicle.inertia.tolist(), strict=True)
    known = {f"inertia.{name}": (value, "kg m^2") for name, value in moments}
    if isinstance(record, VehicleRecord):
        known |= {row["name"]: (row["value"], row["unit"]) for row in rows_of(record.found)}
    shown = ((name_of(name), *known[name]) for name in record.impossible)
    return joined(f"{name} {number(value, 3)} {unit}".removesuffix(" 1") for name, value, unit in shown)


def worth_in_words(record: ModelRecord) -> Iterator[str]:
    """Say what a model that is used elsewhere is worth."""
    return _kind_of(record).worth(record)


def model_blocks(model: Source[Any], index: int, sources: Sources) -> Iterator[Block]:
    """Say what a model is, part by part."""
    yield from [Heading(model.label)] if len(sources.of_kind(ModelRecord)) > 1 else []
    yield Facts(facts(model.record))
    if model.record.vehicle.effect.name:
        yield _effects_table(f"model-effects-{index}", model.record)


def facts(record: ModelRecord) -> list[tuple[str, str]]:
    """Say how far to trust a model, what it learned from, and what it is made of."""
    vehicle, repair = record.vehicle, record.vehicle.repair
    moments = zip(INERTIA_PARAMETERS, vehicle.inertia.tolist(), strict=True)
    rigid = " ".join(_marked(record, f"inertia.{name}", f"{name} {number(value)}") for name, value in moments if value)
    rows = [
        *trust_facts(record),
        ("Mass", f"{plain(vehicle.mass)} kg"),
        ("Inertia, kg m²", rigid if vehicle.inertia_functions is None else _functions(vehicle.inertia_functions)),
        ("Rotors", _rotors(record)),
        ("Their response", _response(vehicle.response)),
        ("Effects", joined(map(_effect, vehicle.effect.name)) if vehicle.effect.name else "none"),
    ]
    if vehicle.remainder is not None:
        size = vehicle.remainder.coefficients.size
        rows.append(("Learned, without a name", f"{size} coefficients over the direction of the airflow"))
    if vehicle.wind is not None:
        rows.append(("Steady wind of its flights, m/s", " ".join(number(value, 3) for value in vehicle.wind)))
    if vehicle.gusts is not None:
        rows.append(("Gusts of its flights, N m", " ".join(number(value, 3) for value in vehicle.gusts.torque)))
        rows.append(("Their force, N", " ".join(number(value, 3) for value in vehicle.gusts.force)))
    if repair is not None and (repair.settled or repair.faults):
        rows.append(("Taken out of the sensors first", " ".join((*repair.settled, *repair.faults))))
    return rows


def _functions(inertia: InertiaFunctionsGroup) -> str:
    kind = {"cpfls": "continuous periodic fuzzy system", "fls": "classic TSK fuzzy system"}[inertia.structure]
    body = " ".join(
        f"{name} {number(value)}"
        for name, value in zip(INERTIA_PARAMETERS, inertia.rigid_body.tolist(), strict=True)
        if value
    )
    under = f"on a rigid body {body}" if body else "alone"
    visited = whole_percent(float(np.mean(inertia.visited)))
    return (
        f"functions of roll and pitch, a {kind} of {len(inertia.coefficients)} coefficients {under}; {visited} of all "
        "roll and pitch was visited"
    )


def _marked(record: ModelRecord, name: str, shown: str) -> str:
    """Strike a number through that no vehicle has."""
    return impossible(shown) if name in record.impossible else shown


def _rotors(record: ModelRecord) -> str:
    rotors = record.vehicle.rotor
    thrust, drag = (
        _marked(record, name, _range(values))
        for name, values in (("thrust_factor", rotors.thrust_factor), ("drag_factor", rotors.drag_factor))
    )
    square = "w²" if not rotors.thrust_linear else f"w² + {number(rotors.thrust_linear, 3)} w_h w"
    return (
        f"{len(rotors.spin)}; thrust {thrust} N s² and drag {drag} N m s² "
        f"times {square}, to {plain(rotors.speed_max)} rad/s"
    )


def _range(values: Array) -> str:
    low, high = number(float(values.min()), 4), number(float(values.max()), 4)
    return low if low == high else f"{low} to {high}"


def _response(response: ResponseGroup) -> str:
    parts = [("delay", response.delay_s), ("lag", response.lag_s)]
    told = [f"{name} {number(1e3 * seconds, 3)} ms" for name, seconds in parts if seconds]
    slow = [("roll and pitch", response.slow_roll_pitch), ("yaw", response.slow_yaw)]
    told += [
        f"{whole_percent(abs(share))} of the torque of {axes} {'back' if share > 0 else 'gone'} within "
        f"{number(response.slow_s, 3)} s"
        for axes, share in slow
        if share
    ]
    return f"{joined(told)}, behind {'commands alone' if response.commanded else 'any speed'}" if told else "at once"


def _effect(name: str) -> str:
    return "numbers refitted" if CATALOGUE[name].kind == "parameter" else effect_title(name)


def _effects_table(name: str, record: ModelRecord) -> Table:
    rows = []
    for effect in model_effects(record.vehicle.effect):
        known = {each.name: each for each in effect.known.numbers}
        for index, (label, value) in enumerate(effect.values.items()):
            words = f"{label}: {known[label].meaning}" if label in known else label
            unit = unit_words(known[label].unit) if label in known else ""
            shown = _marked(record, f"{effect.name}.{label}", number(value))
            rows.append([_effect(effect.name) if index == 0 else "", words, shown, unit])
    header = ("Effect", "Number", "Value", "Unit")
    return Table(name, "The numbers of its effects.", header, rows, frozenset({0, 1, 3}), frozenset({1}))
