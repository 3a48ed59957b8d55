"""A model as JSON: every parameter with its name, unit and meaning, and words that are enough to evaluate it."""

from __future__ import annotations

from typing import Any

from cpfls_cli.artifacts.model import ModelRecord
from cpfls_cli.artifacts.scores import JudgedGroup
from cpfls_cli.artifacts.spec import BODY, EULER, WORLD
from cpfls_cli.dynamics.rigid_body import VERTICAL
from cpfls_cli.export.points import Expected
from cpfls_cli.export.sheet import EXPORTER, Sheet, rule_labels, rules_along
from cpfls_cli.export.source import visited_rows
from cpfls_cli.export.text import strict_json
from cpfls_cli.fuzzy.inputs import InputRange
from cpfls_cli.fuzzy.membership import Z_FUNCTION
from cpfls_cli.identification.visited import CELLS
from cpfls_cli.inertia import INERTIA_PARAMETERS
from cpfls_cli.regressor.structure import Block

FORMAT, VERSION = "cpfls/model-json", 1
_ANGLES = ("roll", "pitch")

_CONVENTIONS = {
    "q": f"roll, pitch, yaw in rad; {EULER}: R = Rz(yaw) Ry(pitch) Rx(roll) turns body vectors into the world frame",
    "qd": "rates of q, rad/s",
    "qdd": "accelerations of q, rad/s^2",
    "body_frame": f"{BODY}: x forward, y left, z up",
    "world_frame": WORLD,
    "torque": "generalised torque on q, N m: D(q) qdd + C(q, qd) qd",
    "D": "inertia matrix on q, kg m^2, symmetric: fuzzy functions plus W^T I W",
    "C": "Coriolis matrix, kg m^2/s: C_ij = 1/2 sum_k (dD_ij/dq_k + dD_ik/dq_j - dD_jk/dq_i) qd_k",
    "W": "body rates = W qd, W = [[1, 0, -sin p], [0, cos r, sin r cos p], [0, -sin r, cos r cos p]]",
    "body_torque": f"W^-T torque, N m; the Euler angles tell little of it where |cos(pitch)| < {VERTICAL}",
}

HOW_TO_EVALUATE = (
    "Each of fuzzy.functions is the entry of D at [row, column] and at the transposed place: the sum over its rules of "
    "firing * (coefficients of the rule . features); D12 is zero. To D comes W^T I W, I from rigid_body.tensor.",
    "s(q) is the triangle wave with s(0) = 0, s(pi/2) = 1, s(pi) = 0, s(3 pi/2) = -1. With the input map data-range, "
    "x = (s - minimum) / width by fuzzy.inputs is the input of memberships and of seesaw consequents. With "
    "full-circle, memberships take x = (q mod 2 pi) / 2 pi, seesaw consequents take s. Structure fls: q wrapped to "
    "[-pi, pi) in place of s, and with full-circle both inputs are q / 2 pi + 1/2.",
    f"Breakpoints b are peaks. Between two, u = (x - b1) / (b2 - b1): the left function falls by {Z_FUNCTION}, the "
    "right one is 1 minus that; x beyond the ends counts as the end. Structure cpfls: rule 1 fires by the first "
    "function plus the last, the others by their own; one function alone fires by 1. The firing of two inputs is "
    "multiplied, the rule index of pitch runs fastest.",
    "Features of one input: 1 and its own, which are the seesaw consequent input, or sin q .. sin nq, cos q .. cos nq "
    "with n = harmonic_order. Of two inputs: 1, those of roll, those of pitch (additive), or all products of (1, "
    "roll's) and (1, pitch's), pitch's running fastest (tensor).",
    "reference_points hold states with the results; their errors compare with scale (of D, C, torque, body torque).",
)

_SCORE_UNITS = {"mse": "(N m)^2", "max_error": "N m", "relative_error": "1", "r2": "1", "vaf": "1", "r2_body": "1"}


def json_text(sheet: Sheet, points: Expected) -> str:
    """Write a model as strict JSON.

    Returns
    -------
    str
        In ASCII; null in place of what is not finite.
    """
    record = sheet.record
    document = {
        "format": FORMAT,
        "format_version": VERSION,
        "name": sheet.name,
        "complete": record.complete,
        "stop_reason": record.stop_reason or None,
        "verdict": _verdict(record),
        "findings": record.findings,
        "conventions": _CONVENTIONS,
        "how_to_evaluate": HOW_TO_EVALUATE,
        "structure": _structure(sheet),
        "fuzzy": _fuzzy(sheet),
        "rigid_body": _rigid_body(sheet),
        "excited_region": _region(sheet),
        "judged": {"units": _SCORE_UNITS, **_judged(record.judged)},
        "provenance": _provenance(sheet),
        "reference_points": _points(points),
    }
    return strict_json(document)


def _structure(sheet: Sheet) -> dict[str, Any]:
    structure, settings = sheet.model.structure, sheet.model.structure.settings
    return {
        "structure": settings.structure,
        "input_map": settings.input_map,
        "consequents": settings.consequents,
        "harmonic_order": settings.harmonic_order if settings.consequents == "harmonic" else None,
        "products": settings.products,
        "base": sheet.record.model.base,
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
        "share": sheet.region_share,
        "rows": visited_rows(sheet.model),
    }


def _verdict(record: ModelRecord) -> dict[str, Any] | None:
    if record.verdict is None or record.verdict.label is None:
        return None
    reasons = [{"reason": reason, "speaks": float(speaks)} for reason, speaks in record.verdict.reasons]
    return {"label": record.verdict.label, "region": record.verdict.region or "", "reasons": reasons}


def _judged(judged: JudgedGroup) -> dict[str, Any]:
    counts = zip(judged.parts, judged.samples, judged.outside, strict=True)
    return {
        "parts": {part: {"samples": int(samples), "outside": int(outside)} for part, samples, outside in counts},
        "models": {
            model: {
                part: {measure: judged.of_axes(measure, model, part).tolist() for measure in judged.measures}
                for part in judged.parts
            }
            for model in judged.models
        },
    }


def _provenance(sheet: Sheet) -> dict[str, Any]:
    header = sheet.record.origin
    return {
        "model": {"name": sheet.file, "sha256": sheet.sha256},
        "cpfls_version": header.version,
        "exported_by_cpfls_version": EXPORTER,
        "seed": header.seed,
        "inputs": {role: vars(source) for role, source in header.inputs.items()},
        "config": sheet.config,
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
