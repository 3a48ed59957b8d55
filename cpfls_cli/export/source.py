"""A model as source code without dependencies: C99, which needs its mathematics only, and Python, which needs NumPy."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined

from cpfls_cli.arrays import Array
from cpfls_cli.dynamics.rigid_body import VERTICAL, vertical
from cpfls_cli.export.points import Expected
from cpfls_cli.export.sheet import Sheet, rule_labels, rules_along
from cpfls_cli.export.text import c_row, c_rows, comment_lines, comment_text, filled, literal_text, number, python_rows
from cpfls_cli.identification.model import Model
from cpfls_cli.identification.visited import CELLS
from cpfls_cli.inertia import symmetric
from cpfls_cli.regressor.structure import ModelStructure

_OUTSIDE, _VERTICAL = 1, 4


@dataclass(frozen=True)
class CSource:
    """C source code."""

    source: str
    header: str


def c_source(sheet: Sheet, points: Expected, stem: str) -> CSource:
    """Write a model as C99.

    Parameters
    ----------
    points : Expected
        For the self-test.
    stem : str
        Name of both files without ``.c`` and ``.h``.
    """
    words = {
        **_common_words(sheet),
        "source": comment_text(f"{stem}.c"),
        "header": comment_text(f"{stem}.h"),
        **_c_tables(sheet.model),
        "points": [_c_point(points, index) for index in range(len(points))],
    }
    return CSource(fill_template("model.c.j2", words), fill_template("model.h.j2", words))


def _c_tables(model: Model) -> dict[str, Any]:
    structure = model.structure
    packed = np.packbits(model.visited, axis=1)
    return {
        "partitions": [
            {
                "label": p.name,
                "table": f"{p.function}_{('roll', 'pitch')[p.input]}",
                "functions": p.functions,
                "rows": filled(c_row(peaks), 4),
            }
            for p, peaks in zip(structure.partitions, model.partitions, strict=True)
        ],
        "rules": {
            p.name: f"rules_of(&{name}_input, {p.function}_{name}, {p.functions})"
            for p in structure.partitions
            for name in (("roll", "pitch")[p.input],)
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
        "rigid_rows": [c_row(row) for row in symmetric(model.rigid_body)],
        "visited_rows": [", ".join(f"0x{byte:02x}" for byte in row) for row in packed],
        "cell_bytes": packed.shape[1],
    }


def _c_point(points: Expected, index: int) -> str:
    motion = points.motion[index : index + 1]
    vectors = [motion.attitude[0], motion.rate[0], motion.acceleration[0]]
    matrices = [points.inertia[index], points.coriolis[index], np.array([points.torque[index], points.body[index]])]
    parts = [_braced(v) for v in vectors] + [_matrix(m) for m in matrices] + [_braced(points.scale[index])]
    flags = (0 if points.inside[index] else _OUTSIDE) | (_VERTICAL if vertical(motion.attitude)[0] else 0)
    return "    {\n" + "\n".join(filled(f"{part},", 8) for part in parts) + f"\n        {flags}u\n    }},"


def _braced(values: Array) -> str:
    return f"{{{c_row(values)}}}"


def _matrix(values: Array) -> str:
    return "{ " + ", ".join(_braced(row) for row in values) + " }"


def python_source(sheet: Sheet, points: Expected, file: str) -> str:
    """Write a model as a module of Python.

    Parameters
    ----------
    points : Expected
        For the self-test.
    file : str
        Name of the file.
    """
    label = sheet.record.verdict_label
    words = {
        **_common_words(sheet),
        "source": comment_text(file),
        "verdict_label": None if label is None else ascii(label),
        **_python_tables(sheet.model),
        "points": [_python_point(points, index) for index in range(len(points))],
    }
    return fill_template("model.py.j2", words)


def visited_rows(model: Model) -> list[str]:
    """Draw the region that training visited.

    Returns
    -------
    list of str
        ``#`` for a visited cell, ``.`` for another; a line for each roll.
    """
    return ["".join(row) for row in np.where(model.visited, "#", ".")]


def _python_tables(model: Model) -> dict[str, Any]:
    structure = model.structure
    return {
        "partitions": [
            {"label": partition.name, "rows": python_rows(peaks, 8)}
            for partition, peaks in zip(structure.partitions, model.partitions, strict=True)
        ],
        "blocks": [
            {
                "name": block.function.name,
                "rows": python_rows(model.coefficients[block.columns].reshape(block.rules, block.features), 8),
            }
            for block in structure.blocks
            if block.partitions
        ],
        "rigid_body": python_rows(symmetric(model.rigid_body), 4),
        "visited_rows": visited_rows(model),
    }


def _python_point(points: Expected, index: int) -> str:
    motion = points.motion[index : index + 1]
    entries = {
        "q": motion.attitude[0],
        "qd": motion.rate[0],
        "qdd": motion.acceleration[0],
        "D": points.inertia[index],
        "C": points.coriolis[index],
        "torque": points.torque[index],
        "body": points.body[index],
        "scale": points.scale[index],
    }
    lines = [filled(f'"{name}": {values.tolist()!r},', 8) for name, values in entries.items()]
    return "\n".join(["    {", *lines, f'        "inside": {bool(points.inside[index])},', "    },"])


def fill_template(template: str, words: dict[str, Any]) -> str:
    """Fill a template with all that it asks for.

    Parameters
    ----------
    template : str
        Name of its file.
    """
    environment = Environment(
        loader=PackageLoader("cpfls_cli.export"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,
    )
    return environment.get_template(template).render(words)


def _common_words(sheet: Sheet) -> dict[str, Any]:
    """Gather what all languages ask for: names, numbers, and which parts of the code the structure needs."""
    return {
        "name": sheet.name,
        "macro": sheet.name.upper(),
        "banner": comment_lines(sheet.banner),
        "facts": comment_lines(sheet.facts),
        "complete": sheet.record.complete,
        "verdict_label": literal_text(sheet.record.verdict_label or "none"),
        "model_sha256": sheet.sha256,
        "vertical": VERTICAL,
        "cells": CELLS,
        "cell_deg": 360 // CELLS,
        "fuzzy": sheet.fuzzy,
        "rigid": sheet.rigid,
        "constant": number(sheet.model.coefficients[0]),
        **_structure_words(sheet.model.structure),
        "ranges": [{"minimum": number(r.minimum), "width": number(r.width)} for r in sheet.model.ranges],
    }


def _structure_words(structure: ModelStructure) -> dict[str, Any]:
    settings = structure.settings
    harmonic, data_range = settings.consequents == "harmonic", settings.input_map == "data-range"
    rules_used = any(block.rules > 1 for block in structure.blocks)
    mapped = not harmonic or rules_used
    features = {len(block.partitions): block.features for block in structure.blocks}
    return {
        "circular": structure.circular,
        "data_range": data_range,
        "harmonic": harmonic,
        "tensor": settings.products == "tensor",
        "order": settings.harmonic_order,
        "rules_used": rules_used,
        "seesaw_used": structure.circular and mapped and (data_range or not harmonic),
        "features_1": features[1],
        "features_2": features[2],
        "features_text": _features_text(structure),
        "pitch_rules": {
            block.function.name: rules_along(structure, block.partitions[-1])
            for block in structure.blocks
            if len(block.partitions) > 1
        },
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
