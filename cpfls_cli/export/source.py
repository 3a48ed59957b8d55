"""A model as source code: C99 without dependencies, and modules of Python for CasADi and JAX."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, Literal

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined

from cpfls_cli.arrays import Array
from cpfls_cli.dynamics import CELLS, VERTICAL, InertiaFunctions, vertical
from cpfls_cli.export.points import (
    LEARNED,
    PERIOD,
    Expected,
    ReferencePoints,
    ReferenceRun,
    numbers_of,
    share_of,
    traced_wrench,
    units_of,
)
from cpfls_cli.export.sheet import Sheet, rule_labels
from cpfls_cli.export.text import c_row, c_rows, comment_lines, comment_text, filled, literal_text, number, python_rows
from cpfls_cli.inertia import INERTIA_PARAMETERS, symmetric
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.regressor.structure import ModelStructure
from cpfls_cli.vehicle.tracing import LIBRARY, C

_OUTSIDE, _VERTICAL = 1, 4
"""Flags of the header of C."""

_FASTEST_PERIOD = 1e-3
"""Shortest step in s that the history of speeds in C is long enough for by default."""


@dataclass(frozen=True)
class CSource:
    """C source code."""

    source: str
    header: str


def c_source(sheet: Sheet, stem: str, remarks: Sequence[str] = ()) -> CSource:
    """Write a model as C99, with further paragraphs in its head."""
    points, runs, attitudes = sheet.references
    traced, units, learned = traced_wrench(sheet.model), units_of(sheet.model), _learned(sheet.model)
    lines, wrench = traced.written(C)
    words = {
        **_common_words(sheet, remarks),
        "source": comment_text(f"{stem}.c"),
        "header": comment_text(f"{stem}.h"),
        "verdict_text": literal_text(sheet.verdict or "none"),
        "history": int(sheet.model.response.delay_s / _FASTEST_PERIOD * (1 + 1e-9)) + 2,
        "rigid_rows": [c_row(row) for row in symmetric(sheet.rigid_body)],
        "numbers": [(name, number(value), units[name]) for name, value in sheet.needed(traced).items()],
        "learned_rows": filled(c_row(learned), 4) if learned else "",
        "learned_count": len(learned),
        "wrench_lines": lines,
        "wrench": wrench,
        **({} if sheet.rules is None else _c_rules(sheet.rules)),
        **({} if sheet.identified is None else _c_visited(sheet.identified)),
        "points": [_c_braces(list(point.values()), 4) for point in points_of(points)],
        "attitude_points": [_c_braces(list(point.values()), 4) for point in _c_attitudes(attitudes)],
        "runs": [_c_braces(list(run_of(run).values()), 4) for run in runs],
        "steps": len(runs[0].rotor) if runs else 0,
    }
    return CSource(fill_template("model.c.j2", words), fill_template("model.h.j2", words))


def _c_rules(model: InertiaFunctions) -> dict[str, Any]:
    structure = model.structure
    circular = int(structure.circular)
    names = {p.name: ("roll", "pitch")[p.input] for p in structure.partitions}
    return {
        "partitions": [
            {
                "label": p.name,
                "table": f"{p.function}_{names[p.name]}",
                "functions": p.functions,
                "rows": filled(c_row(peaks), 4),
            }
            for p, peaks in zip(structure.partitions, model.partitions, strict=True)
        ],
        "rules": {
            p.name: f"rules_of({names[p.name]}_input.membership, {names[p.name]}_input.membership_slope, "
            f"{p.function}_{names[p.name]}, {p.functions}, {circular})"
            for p in structure.partitions
        },
        "blocks": [
            {
                "name": block.function.name,
                "rules": block.rules,
                "inputs": len(block.partitions),
                "rows": c_rows(
                    model.coefficients[block.columns].reshape(block.rules, block.features),
                    rule_labels(block, structure),
                ),
            }
            for block in structure.blocks
            if block.partitions
        ],
    }


def _c_visited(model: InertiaFunctions) -> dict[str, Any]:
    packed = np.packbits(model.visited, axis=1)
    rows = [", ".join(f"0x{byte:02x}" for byte in row) for row in packed]
    return {"visited_rows": rows, "cell_bytes": packed.shape[1]}


def _c_attitudes(points: Expected | None) -> list[dict[str, Any]]:
    """Arrange states with the flags that C gives there."""
    found = []
    for point in attitudes_of(points):
        inside, attitude = point.pop("inside"), point["q"][None]
        flags = (0 if inside else _OUTSIDE) | (_VERTICAL if vertical(attitude)[0] else 0)
        found.append({name: np.ravel(values) for name, values in point.items()} | {"status": flags})
    return found


def _c_braces(values: Any, indent: int) -> str:
    """Write nested lists of numbers in braces, one part to a line."""
    parts = [f"{int(part)}," if isinstance(part, int) else _c_part(part, indent + 4) for part in values]
    blank = " " * indent
    return "\n".join(
        [f"{blank}{{", *(part if part.startswith(" ") else f"{blank}    {part}" for part in parts), f"{blank}}},"]
    )


def _c_part(part: Sequence[Any] | Array, indent: int) -> str:
    if isinstance(part, np.ndarray) and part.ndim == 1:
        return filled(f"{{{c_row(part)}}},", indent)
    return _c_braces(part, indent)


def python_source(sheet: Sheet, file: str, library: Literal["casadi", "jax"], remarks: Sequence[str] = ()) -> str:
    """Write a model as a module of Python that computes with one library, with further paragraphs in its head."""
    rules, traced = sheet.rules, traced_wrench(sheet.model, shares=True)
    lines, wrench = traced.written(LIBRARY)
    coefficients = np.zeros(0) if rules is None else rules.coefficients
    parameters = _parameters(sheet, sheet.model, delayed=library == "jax")
    names = [*_KNOWN, *(name for name, _ in _named(sheet, sheet.model))]
    first_learned = len(names) - len(_shares(sheet)) - len(_learned(sheet.model))
    first_rule = len(names)
    used = traced.used
    needed = [(name, place) for place, name in enumerate(names) if name in used and "[" not in name]
    words = {
        **_common_words(sheet, remarks),
        "library": library,
        "source": comment_text(file),
        "verdict": None if sheet.verdict is None else ascii(sheet.verdict),
        "parameter_names": filled(", ".join(f'"{name}"' for name in names), 4),
        "first_learned": first_learned,
        "first_share": first_rule - len(_shares(sheet)),
        "first_rule": first_rule,
        "needed": needed,
        "wrench_lines": [*(["learned = p[_LEARNED]"] if _learned(sheet.model) else []), *lines],
        "wrench": wrench,
        "rule_count": len(coefficients),
        "parameter_rows": filled(", ".join(map(number, parameters)), 4),
        **({} if rules is None else _python_rules(rules)),
    }
    return fill_template("model.py.j2", words)


_KNOWN = ("mass", "gravity", *INERTIA_PARAMETERS, "lag", "slow")


def _learned(model: VehicleModel) -> list[float]:
    return [] if model.remainder is None else np.ravel(model.remainder.coefficients).tolist()


def _shares(sheet: Sheet) -> list[str]:
    return [one.name for one in sheet.model.parts]


def _named(sheet: Sheet, model: VehicleModel, parts: Sequence[str] | None = None) -> Iterator[tuple[str, float]]:
    """Give the numbers of a vehicle like that of a sheet by name, those of the learned part, and shares of parts."""
    values = numbers_of(model)
    for name in numbers_of(sheet.model):
        if name in sheet.numbers or name.startswith(_OF_LEARNED):
            yield name, values.get(name, 0.0)
    for part in _shares(sheet):
        yield share_of(part), float(parts is None or part in parts)


_OF_LEARNED = LEARNED.partition("{")[0]


def _parameters(
    sheet: Sheet, model: VehicleModel, parts: Sequence[str] | None = None, *, delayed: bool = True
) -> list[float]:
    """List the parameters of a vehicle; for functions of JAX, of which many may fly side by side, its delay too."""
    own = replace(sheet, model=model)
    rules, vehicle = own.rules, model.vehicle
    delay, *times = response_of(own).values()
    rule = [] if rules is None else rules.coefficients.tolist()
    known = [vehicle.mass_kg, vehicle.gravity_m_s2, *own.rigid_body.tolist(), *times]
    return [*known, *(value for _, value in _named(sheet, model, parts)), *rule, *([delay] if delayed else [])]


def jax_parameters(sheet: Sheet, models: Sequence[VehicleModel]) -> Array:
    """Give the parameters of vehicles like that of a sheet for its functions in JAX, shape (vehicle, parameter)."""
    return np.array([_parameters(sheet, each) for each in models])


def jax_parts(sheet: Sheet, parts: Sequence[str]) -> Array:
    """Give the parameters with which the functions in JAX give parts of a model alone, shape (part, parameter)."""
    return np.array([_parameters(sheet, sheet.model, [name]) for name in parts])


def _python_rules(model: InertiaFunctions) -> dict[str, Any]:
    structure = model.structure
    named = {
        block.function.name: {
            structure.partitions[place].input: model.partitions[place].tolist() for place in block.partitions
        }
        for block in structure.blocks
        if block.partitions
    }
    return {"rule_peaks": named, "coefficient_rows": python_rows(model.coefficients, 4)}


def visited_rows(model: InertiaFunctions) -> list[str]:
    """Draw the region that training visited, ``#`` for a visited cell, ``.`` for another; a line for each roll."""
    return ["".join(row) for row in np.where(model.visited, "#", ".")]


def fill_template(template: str, words: dict[str, Any]) -> str:
    """Fill a template with all that it asks for."""
    return _templates().get_template(template).render(words)


@cache
def _templates() -> Environment:
    """Keep what was made of templates: that takes longer than to fill them."""
    return Environment(
        loader=PackageLoader("cpfls_cli.export"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,
    )


def _common_words(sheet: Sheet, remarks: Sequence[str]) -> dict[str, Any]:
    """Gather what all languages ask for: names, numbers, and which parts of the code the model needs."""
    vehicle, rules = sheet.model.vehicle, sheet.rules
    return {
        "name": sheet.name,
        "macro": sheet.name.upper(),
        "facts": comment_lines([*sheet.facts, *(["", *remarks] if remarks else [])]),
        "complete": sheet.complete,
        "model_sha256": sheet.sha256,
        "attitude": sheet.identified is not None,
        "fuzzy": rules is not None,
        "rigid": bool(sheet.rigid_body.any()),
        "vertical": VERTICAL,
        "cells": CELLS,
        "cell_deg": 360 // CELLS,
        "rotors": sheet.model.rotors,
        "mass": number(vehicle.mass_kg),
        "gravity": number(vehicle.gravity_m_s2),
        **{name.removesuffix("_s"): number(value) for name, value in response_of(sheet).items()},
        "gusts": [[number(value) for value in values] for values in sheet.model.gusts or ()],
        "period": number(PERIOD),
        **({} if rules is None else _structure_words(rules)),
    }


def _structure_words(model: InertiaFunctions) -> dict[str, Any]:
    structure, settings = model.structure, model.structure.settings
    harmonic, data_range = settings.consequents == "harmonic", settings.input_map == "data-range"
    rules_used = any(block.rules > 1 for block in structure.blocks)
    features = {len(block.partitions): block.features for block in structure.blocks}
    return {
        "circular": structure.circular,
        "data_range": data_range,
        "harmonic": harmonic,
        "tensor": settings.products == "tensor",
        "rule_order": settings.harmonic_order if harmonic else 0,
        "rules_used": rules_used,
        "seesaw_used": structure.circular and (rules_used or not harmonic) and (data_range or not harmonic),
        "features_1": features[1],
        "features_2": features[2],
        "features_text": _features_text(structure),
        "pitch_rules": {
            block.function.name: structure.partitions[block.partitions[-1]].rules(circular=structure.circular)
            for block in structure.blocks
            if len(block.partitions) > 1
        },
        "constant": number(model.coefficients[0]),
        "ranges": [{"minimum": number(r.minimum), "width": number(r.width)} for r in model.ranges],
    }


def _features_text(structure: ModelStructure) -> list[str]:
    settings = structure.settings
    order = settings.harmonic_order
    single = "s, the triangle wave of the angle, as the inputs of the rules have it"
    if settings.consequents == "harmonic":
        single = f"sin q .. sin {order}q, cos q .. cos {order}q" if order > 1 else "sin q, cos q"
    elif not structure.circular:
        single = "x, the angle on the scale of the membership functions"
    pairs = "1, those of roll, those of pitch"
    if settings.products == "tensor":
        pairs = "all products of (1, those of roll) and (1, those of pitch), pitch running fastest"
    return comment_lines([f"one input: 1, {single};", f"two inputs: {pairs}."])


def response_of(sheet: Sheet) -> dict[str, float]:
    """Give delay, lag and slow actuation of the rotors, s; 0 for what `cpfls_cli.playback.rotors` takes for none."""
    response = sheet.model.response
    lag, slow = response.lag_s, response.slow_s
    return {"delay_s": response.delay_s, "lag_s": lag, "slow_s": slow}


def points_of(points: ReferencePoints) -> list[dict[str, Any]]:
    """Give the states with what the model gives there, by name."""
    columns = points._asdict()
    return [{name: values[index] for name, values in columns.items()} for index in range(len(points.air))]


def attitudes_of(points: Expected | None) -> list[dict[str, Any]]:
    """Give the states on Euler angles with what the model gives there, by name; none for a constant inertia."""
    if points is None:
        return []
    columns = {
        "q": points.motion.attitude,
        "qd": points.motion.rate,
        "qdd": points.motion.acceleration,
        "D": points.inertia,
        "C": points.coriolis,
        "torque": points.torque,
        "body_torque": points.body,
        "scale": points.scale,
        "inside": points.inside.tolist(),
    }
    return [{name: values[index] for name, values in columns.items()} for index in range(len(points))]


def run_of(run: ReferenceRun) -> dict[str, Any]:
    """Give the speeds of a run and where it ends, by name."""
    start, end = ([part[at] for part in run.states] for at in (0, -1))
    return {
        "held": run.hold == "previous",
        "speed": run.speed,
        "rotor": run.rotor[-1],
        "rotor_scale": run.rotor_scale,
        "scale": run.scale,
        "start": start,
        "end": end,
    }
