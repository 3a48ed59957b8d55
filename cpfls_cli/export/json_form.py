"""A model as JSON: every parameter with its name, unit and meaning."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from cpfls_cli.artifacts.spec import BODY
from cpfls_cli.export.json_words import CONVENTIONS, HOW_TO_EVALUATE, SCORE_UNITS
from cpfls_cli.export.points import Expected
from cpfls_cli.export.python_form import visited_rows
from cpfls_cli.export.sheet import Evidence, Provenance, Sheet
from cpfls_cli.export.tables import rule_labels, rules_along
from cpfls_cli.fuzzy.inputs import InputRange
from cpfls_cli.identification.excitation import CELLS
from cpfls_cli.inertia import INERTIA_PARAMETERS
from cpfls_cli.regressor.structure import Block

FORMAT, VERSION = "cpfls/model-json", 1
_ANGLES = ("roll", "pitch")


def json_text(sheet: Sheet, points: Expected) -> str:
    """Write a model as strict JSON.

    Returns
    -------
    str
        In ASCII; null in place of what is not finite.
    """
    evidence = sheet.evidence
    document = {
        "format": FORMAT,
        "format_version": VERSION,
        "name": sheet.name,
        "complete": evidence.complete,
        "stop_reason": evidence.stop_reason or None,
        "verdict": _verdict(evidence),
        "findings": evidence.findings,
        "conventions": CONVENTIONS,
        "how_to_evaluate": HOW_TO_EVALUATE,
        "structure": _structure(sheet),
        "fuzzy": _fuzzy(sheet),
        "rigid_body": _rigid_body(sheet),
        "excited_region": _region(sheet),
        "judged": {"units": SCORE_UNITS, **evidence.judged},
        "provenance": _provenance(sheet.provenance),
        "reference_points": _points(points),
    }
    return f"{_written(document, 0)}\n"


def _structure(sheet: Sheet) -> dict[str, Any]:
    structure, settings = sheet.model.structure, sheet.model.structure.settings
    return {
        "structure": settings.structure,
        "input_map": settings.input_map,
        "consequents": settings.consequents,
        "harmonic_order": settings.harmonic_order if settings.consequents == "harmonic" else None,
        "products": settings.products,
        "base": sheet.base,
        "membership_functions": {p.name: p.functions for p in structure.partitions},
        "parameters": structure.parameters,
    }


def _fuzzy(sheet: Sheet) -> dict[str, Any]:
    model = sheet.model
    return {
        "inputs": {name: _range(r) for name, r in zip(_ANGLES, model.ranges, strict=True)},
        "breakpoints": {p.name: b for p, b in zip(model.structure.partitions, model.partitions, strict=True)},
        "unit": "kg m^2",
        "functions": {block.function.name: _function(sheet, block) for block in model.structure.blocks},
    }


def _range(data: InputRange) -> dict[str, float]:
    return {"minimum": data.minimum, "maximum": data.maximum, "width": data.width}


def _function(sheet: Sheet, block: Block) -> dict[str, Any]:
    structure, function = sheet.model.structure, block.function
    labels = rule_labels(block, structure) if block.partitions else ["constant"]
    coefficients = sheet.model.coefficients[block.columns].reshape(block.rules, block.features)
    return {
        "row": function.row,
        "column": function.column,
        "inputs": [_ANGLES[angle] for angle in function.inputs],
        "rules_per_input": [rules_along(structure, partition) for partition in block.partitions],
        "rules": [{"rule": label, "coefficients": own} for label, own in zip(labels, coefficients, strict=True)],
    }


def _rigid_body(sheet: Sheet) -> dict[str, Any]:
    values = dict(zip(INERTIA_PARAMETERS, sheet.model.rigid_body.tolist(), strict=True))
    return {"unit": "kg m^2", "frame": BODY, "tensor": values}


def _region(sheet: Sheet) -> dict[str, Any]:
    return {
        "description": "'#' where training visited roll and pitch; a line for each roll, pitch along it, from -180 deg",
        "cell_deg": 360 / CELLS,
        "share": float(np.mean(sheet.model.visited)),
        "rows": visited_rows(sheet.model),
    }


def _verdict(evidence: Evidence) -> dict[str, Any] | None:
    if evidence.verdict is None:
        return None
    reasons = [{"reason": reason, "speaks": speaks} for reason, speaks in evidence.verdict.reasons]
    return {"label": evidence.verdict.label, "region": evidence.verdict.region, "reasons": reasons}


def _provenance(provenance: Provenance) -> dict[str, Any]:
    header = provenance.header
    return {
        "model": {"name": provenance.file, "sha256": provenance.sha256},
        "cpfls_version": header.version,
        "exported_by_cpfls_version": provenance.exporter,
        "seed": header.seed,
        "inputs": {role: vars(source) for role, source in header.inputs.items()},
        "config": provenance.config,
    }


def _points(points: Expected) -> list[dict[str, Any]]:
    motion = points.motion
    columns = {
        "q": motion.attitude,
        "qd": motion.rate,
        "qdd": motion.acceleration,
        "D": points.inertia,
        "C": points.coriolis,
        "torque": points.torque,
        "body_torque": points.body,
        "scale": points.scale,
        "inside": points.inside,
    }
    return [{name: values[index] for name, values in columns.items()} for index in range(len(points))]


def _written(value: Any, depth: int) -> str:
    """Write a value: mappings and lists of them over many lines, lists of numbers in one."""
    blank = " " * (depth + 1)
    if isinstance(value, Mapping) and value:
        entries = [f"{blank}{json.dumps(_text(str(k)))}: {_written(v, depth + 1)}" for k, v in value.items()]
        return "{\n" + ",\n".join(entries) + "\n" + " " * depth + "}"
    if isinstance(value, list | tuple) and any(isinstance(item, Mapping | str) for item in value):
        return "[\n" + ",\n".join(blank + _written(item, depth + 1) for item in value) + "\n" + " " * depth + "]"
    return json.dumps(_plain(value), allow_nan=False)


def _plain(value: Any) -> Any:
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return _text(value) if isinstance(value, str) else value


def _text(text: str) -> str:
    """Replace halves of characters, which names of files may hold and strict readers refuse."""
    return text.encode("utf-8", "replace").decode("utf-8")
