"""Models on the same data: which were judged on what, their errors and inertia, and what their configs differ in."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from markupsafe import Markup

from cpfls_cli import page
from cpfls_cli.artifacts.identified import IdentifiedModel
from cpfls_cli.artifacts.vehicle_model import FOUND_AS, Parameter, Vehicle
from cpfls_cli.config.load import flat_keys
from cpfls_cli.identification.data import TRAINING
from cpfls_cli.identification.findings import AXES
from cpfls_cli.identification.identify import MODEL, RIGID_BODY
from cpfls_cli.pages.trust import trust_words
from cpfls_cli.report.content import ROUNDING, UNKNOWN, count, number, percent, r_squared
from cpfls_cli.report.source import Source, Sources
from cpfls_cli.rounding import less
from cpfls_cli.validation.validate import Curves
from cpfls_cli.words import by_name, joined

_OVERALL = (
    "Model",
    "Verdict",
    "Parameters",
    "Condition number",
    "Largest error, N m",
    "Relative error, worst axis",
    "R², worst axis",
)
_TIE = 1.0 + 1e-6
FLOOR_TICK = "< 10⁻⁷"
"""How an error is written that is below the rounding of the torque, in per cent."""
_MOST_KEYS = 30
_LONGEST = 60
_ABSENT = "not there"
# What a page looks like does not change a model.
_LEFT_OUT = ("report",)
BEYOND = "beyond both intervals"

_Model = Source[IdentifiedModel]


@dataclass(frozen=True)
class JudgedOn:
    """One part of the data, what each model calls it, and the models judged on it: only those can be ranked.

    `hashes` are of the flights that it is taken from.
    """

    names: tuple[str, ...]
    hashes: tuple[str, ...]
    models: tuple[_Model, ...]

    @property
    def title(self) -> str:
        """What it is called, with the flights of a part whose name says nothing of them."""
        return " or ".join(dict.fromkeys(self.names))

    @property
    def learned_only(self) -> bool:
        """Whether models learned from this part: errors there are no prediction."""
        return set(self.names) == {TRAINING}

    @property
    def pairs(self) -> list[tuple[_Model, str]]:
        """Each model with what it calls the part."""
        return list(zip(self.models, self.names, strict=True))


def judged_on(models: Sequence[_Model]) -> list[JudgedOn]:
    """Group what models were judged on by the data themselves, not by their names, in the order of appearance."""
    groups: dict[tuple[str, ...], JudgedOn] = {}
    for model in models:
        for name, identity, hashes in _parts(model):
            known = groups.get(identity, JudgedOn((), hashes, ()))
            groups[identity] = JudgedOn((*known.names, name), hashes, (*known.models, model))
    return list(groups.values())


def compared_parts(models: Sequence[_Model]) -> list[JudgedOn]:
    """List the parts that two models or more were judged on."""
    return [part for part in judged_on(models) if len(part.models) > 1]


def compared_curves(models: Sequence[_Model]) -> list[tuple[str, list[tuple[str, Curves]]]]:
    """List curves of attitudes along which the inertia of two models or more is known, with their labels."""
    curves = [(model.label, model.record.curves) for model in models if model.record.curves is not None]
    names = dict.fromkeys(name for _, entries in curves for name in entries.name)
    along = ((name, [(label, entries) for label, entries in curves if name in entries.name]) for name in names)
    return [(name, compared) for name, compared in along if len(compared) > 1]


def _parts(model: _Model) -> list[tuple[str, tuple[str, ...], tuple[str, ...]]]:
    """Name each part, what distinguishes it from all others, and the flights that it is taken from."""
    inputs = model.header.inputs
    learned = tuple(file.sha256 for role, file in inputs.items() if role.split("-")[0] == "flight")
    others = sorted((role for role in inputs if role.startswith("validate-")), key=lambda role: int(role.split("-")[1]))
    settings = model.config["identification"]
    split = (f"{settings['training_share']:g}", f"{settings['embargo_s']:g}")
    names = model.record.judged.parts
    of_training = names[: len(names) - len(others)]
    hashes = [(inputs[role].sha256,) for role in others]
    return [(name, (name, *learned, *split), learned) for name in of_training] + [
        (name, sha256, sha256) for name, sha256 in zip(names[len(of_training) :], hashes, strict=True)
    ]


def _judged_alone(models: Sequence[_Model]) -> str:
    """Say which model was judged on what that no other was, each model once."""
    by_label: dict[str, list[JudgedOn]] = {}
    for part in judged_on(models):
        if len(part.models) == 1:
            by_label.setdefault(part.models[0].label, []).append(part)
    return "; ".join(
        f"{label} on {joined(part.title for part in own)} ({_hashes_words(*(part.hashes for part in own))})"
        for label, own in by_label.items()
    )


def _hashes_words(*flights: Sequence[str]) -> str:
    return "sha256 " + joined(sha256[:12] for hashes in flights for sha256 in hashes)


_Line = tuple[Sequence[str], Sequence[float], Sequence[str]]
"""A row of a table: words, and what is compared, as numbers and as they are shown."""


def _overall(part: JudgedOn) -> Markup:
    """Tabulate the worst errors of the models and rigid bodies that were judged on a part."""
    lines: list[_Line] = [(_words(model), *_worst(model, MODEL, name)) for model, name in part.pairs]
    lines += [((label, "", "6", UNKNOWN), *_worst(model, RIGID_BODY, name)) for label, model, name in _bodies(part)]
    return page.table(_OVERALL, _marked(lines), (0, 1))


def _by_axis(part: JudgedOn) -> Markup:
    """Tabulate their errors by axis."""
    lines: list[_Line] = [((model.label,), *_axes(model, MODEL, name)) for model, name in part.pairs]
    lines += [((label,), *_axes(model, RIGID_BODY, name)) for label, model, name in _bodies(part)]
    return page.table(["Model", *(f"{axis}, N m" for axis in AXES)], _marked(lines))


def _marked(lines: Sequence[_Line]) -> Iterator[list[str]]:
    # Below rounding nobody is better than another.
    best = np.fmax(np.fmin.reduce([errors for _, errors, _ in lines]) * _TIE, ROUNDING)
    for words, errors, shown in lines:
        rows = zip(shown, errors, best, strict=True)
        yield [*words, *(page.toned(f"{text} ◂", "good") if error <= least else text for text, error, least in rows)]


def _words(model: _Model) -> tuple[str, ...]:
    record = model.record
    size = (count(record.parameters), number(record.condition_number, 4))
    return (model.label, trust_words(record.trust).short, *size)


def _bodies(part: JudgedOn) -> list[tuple[str, _Model, str]]:
    """Name each rigid body once: models that learned from the same samples have the same."""
    owners: dict[tuple[str, ...], list[tuple[_Model, str]]] = {}
    for model, name in part.pairs:
        shown = (*_worst(model, RIGID_BODY, name)[1], *_axes(model, RIGID_BODY, name)[1])
        owners.setdefault(shown, []).append((model, name))
    if len(owners) == 1:
        return [("rigid body", *part.pairs[0])]
    return [(f"rigid body of {joined(model.label for model, _ in who)}", *who[0]) for who in owners.values()]


def _worst(model: _Model, kind: str, part: str) -> tuple[tuple[float, ...], tuple[str, ...]]:
    """Gather what is compared over all axes; R² as what it lacks, so that the least is the best of every column."""
    judged = model.record.judged
    r2 = judged.worst_r2(kind, part)
    largest, relative = float(np.max(judged.of_axes("max_error", kind, part))), judged.worst(kind, part)[0]
    return (largest, relative, 1.0 - r2), (number(largest, 3), percent(relative), r_squared(r2))


def _axes(model: _Model, kind: str, part: str) -> tuple[tuple[float, ...], tuple[str, ...]]:
    judged = model.record.judged
    error, share = np.sqrt(judged.of_axes("mse", kind, part)), judged.nrmse(kind, part)
    shown = (f"{number(float(e), 3)} ({percent(float(s))})" for e, s in zip(error, share, strict=True))
    return tuple(map(float, error)), tuple(shown)


COMPARISON_WORDS: Mapping[str, Any] = {
    **by_name(_by_axis, compared_curves, compared_parts, _judged_alone, _overall),
    "FLOOR_TICK": FLOOR_TICK,
    "MOST_KEYS": _MOST_KEYS,
    "differing_keys": lambda models: differences([model.config for model in models]),
    "hashes": _hashes_words,
}
"""What the template of several identified models knows (`identify_compared.md.j2`)."""


def differences(configs: Sequence[Mapping[str, Any]]) -> list[tuple[str, list[str]]]:
    """List the dotted keys of resolved studies whose values differ, with the value in each; long values are cut."""
    kept = [{name: own for name, own in config.items() if name not in _LEFT_OUT} for config in configs]
    flat = [dict(flat_keys(config)) for config in kept]
    keys = dict.fromkeys(key for one in flat for key in one)
    by_key = {key: [config.get(key, _ABSENT) for config in flat] for key in keys}
    return [(key, list(map(_short, values))) for key, values in by_key.items() if len(set(map(str, values))) > 1]


def _short(value: Any) -> str:
    names = {None: "null", True: "true", False: "false"}
    text = names[value] if value is None or isinstance(value, bool) else str(value)
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 1]}…"


def compared_constants(vehicles: Sequence[Source[Vehicle]]) -> Iterator[tuple[Parameter, bool, list[str]]]:
    """Give each constant of several vehicles, whether two of its values lie apart, and all of them in words."""
    for constants in _constants(vehicles):
        known = [each for each in constants if each is not None]
        yield known[0], _apart(known), list(map(_with_interval, constants))


def differing(sources: Sources) -> tuple[str, ...] | None:
    """Name the constants of vehicles that differ beyond their intervals; None of fewer than two vehicles."""
    if len(sources.vehicles) < 2:
        return None
    return tuple(own.name for own, apart, _ in compared_constants(sources.vehicles) if apart)


def _constants(vehicles: Sequence[Source[Vehicle]]) -> Iterator[list[Parameter | None]]:
    """Give each constant that one vehicle or more has, of all of them."""
    listed = [{key: each for key, each in vehicle.record.parameters.items() if each.needed} for vehicle in vehicles]
    yield from ([own.get(key) for own in listed] for key in FOUND_AS if any(key in own for own in listed))


def _apart(known: Sequence[Parameter]) -> bool:
    """Tell whether two numbers lie beyond the intervals of each other; one that was not fitted is known exactly."""
    spans = [
        (each.value, each.value) if each.low is None or each.high is None else (each.low, each.high)
        for each in known
        if each.value is not None
    ]
    ends = [(low, high) for low, high in spans if low is not None and high is not None]
    return any(bool(less(one[1], two[0])) or bool(less(two[1], one[0])) for one, two in combinations(ends, 2))


def _with_interval(parameter: Parameter | None) -> str:
    if parameter is None or parameter.value is None:
        return UNKNOWN
    value = number(parameter.value, 4)
    if parameter.low is None or parameter.high is None:
        return f"{value} ({parameter.identified})"
    span = f"{value}, {number(parameter.low, 3)} to {number(parameter.high, 3)}"
    return span if parameter.determined else f"({span})"
