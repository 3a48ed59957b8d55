"""A model as JSON: every parameter with its name, unit and meaning, and words that are enough to evaluate it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from cpfls_cli.dynamics import CELLS, VERTICAL, InertiaFunctions
from cpfls_cli.export.points import PERIOD, traced_wrench, units_of
from cpfls_cli.export.sheet import EXPORTER, GUST_RECIPE, Sheet, base_of, rule_labels
from cpfls_cli.export.source import attitudes_of, points_of, response_of, run_of, visited_rows
from cpfls_cli.export.text import strict_json
from cpfls_cli.fuzzy.basis import Z_FUNCTION
from cpfls_cli.inertia import INERTIA_PARAMETERS, symmetric
from cpfls_cli.playback.gusts import Gusts
from cpfls_cli.regressor.structure import Block
from cpfls_cli.result import BODY, EULER, WORLD
from cpfls_cli.vehicle.tracing import PYTHON

_WHITE = ("torque_white_n_m_sqrt_s", "force_white_n_sqrt_s")
FORMAT, VERSION = "cpfls/model-json", 3
_ANGLES = ("roll", "pitch")

_CONVENTIONS = {
    "body_frame": f"{BODY}: x forward, y left, z up",
    "world_frame": WORLD,
    "position, velocity": "world frame, m and m/s",
    "rotation": "matrix R that turns body vectors into the world frame",
    "rate": "omega, body frame, rad/s",
    "air": "velocity through the air, body frame, m/s: R^T (velocity - wind)",
    "speed": "of the rotors, rad/s",
}
_ON_ATTITUDE = {
    "q": f"roll, pitch, yaw in rad; {EULER}: R = Rz(yaw) Ry(pitch) Rx(roll) turns body vectors into the world frame",
    "qd": "rates of q, rad/s",
    "qdd": "accelerations of q, rad/s^2",
    "torque": "generalised torque on q, N m: D(q) qdd + C(q, qd) qd",
    "D": "inertia matrix on q, kg m^2, symmetric: fuzzy functions plus W^T I W",
    "C": "Coriolis matrix, kg m^2/s: C_ij = 1/2 sum_k (dD_ij/dq_k + dD_ik/dq_j - dD_jk/dq_i) qd_k",
    "W": "body rates = W qd, W = [[1, 0, -sin p], [0, cos r, sin r cos p], [0, -sin r, cos r cos p]]",
    "body_torque": f"W^-T torque, N m; the Euler angles hardly determine it where |cos(pitch)| < {VERTICAL}",
}

HOW_TO_EVALUATE_INERTIA = (
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
    "Where v' and omega' are asked for, inertia stands for B = W^-T D W^-1 at the attitude. The step is taken with the "
    "angular momentum L = B omega in the place of omega: L' = torque - W^-T ((dW/dt)^T L - 1/2 grad (qd^T D qd)), grad "
    "by q, qd = W^-1 omega; L_m = L + h/2 L', and omega_m = inverse B L_m with the B of R_m; L + h L' likewise.",
    "reference_points hold states with the results; their errors compare with scale (of D, C, torque, body torque).",
)

HOW_TO_EVALUATE = (
    "wrench gives torque in N m and force in N, x y z, of air, rate and rotor: its lines in their order, then its six "
    "components, in arithmetic of Python with sqrt, exp, sin, cos, atan2, floor and abs, indices from 0. Names are "
    "those of numbers, and learned are the coefficients of the learned part; rotor are the terms of the rotors, in the "
    "order of terms_of_rotors. A line that begins with # names the part that the next ones are of.",
    "Terms of the rotors over the step from sample k to k + 1 of length h: 1; mean w of the speed that acts; w^2; its "
    "change over the step / h; z - w^2. The logged speed, late by delay_s with straight lines between samples, is x; "
    "before the first sample it is the first. lag_s > 0: tau w' + w = x, exactly, for x a straight line between "
    "samples, or constant over a step where speeds are held; it starts at the first x. Without lag w is x, for held "
    "speeds changing at samples. Slow actuation: slow_s z' + z = w^2, w^2 constant over each step, z the mean over the "
    "step; it starts at the first w^2.",
    "v' = (0, 0, -gravity) + R force / mass; omega' = inverse inertia (torque - omega x inertia omega). One step of "
    "length h, midpoint rule: with the accelerations at the state, v_m = v + h/2 v', omega_m = omega + h/2 omega', R_m "
    "= R exp(h/2 [omega]x); with the accelerations there, position + h v_m, v + h v', omega + h omega', R exp(h "
    "[omega_m]x). The terms of the rotors are constant over a step.",
    "reference_wrenches and reference_runs hold what cpfls computes; errors compare with scale.",
)


def json_text(sheet: Sheet, remarks: Sequence[str] = ()) -> str:
    """Write a model, and what it is good for, as strict JSON in ASCII; null for what is not finite, or not there."""
    found, vehicle = sheet.identified, sheet.model.vehicle
    points, runs, attitudes = sheet.references
    document = {
        "format": FORMAT,
        "format_version": VERSION,
        "name": sheet.name,
        "complete": sheet.complete,
        "stop_reason": sheet.stopped,
        "verdict": None if sheet.verdict is None else {"label": sheet.verdict},
        "cautions": list(sheet.cautions),
        "findings": [],
        "usage": [*sheet.usage, *remarks],
        "conventions": _CONVENTIONS if found is None else _CONVENTIONS | _ON_ATTITUDE,
        "how_to_evaluate": HOW_TO_EVALUATE if found is None else (*HOW_TO_EVALUATE_INERTIA, *HOW_TO_EVALUATE),
        "mass_kg": vehicle.mass_kg,
        "gravity_m_s2": vehicle.gravity_m_s2,
        "inertia_kg_m2": symmetric(sheet.rigid_body) if found is None else None,
        **(dict.fromkeys(_OF_ATTITUDE) if found is None else _over_attitude(found)),
        "rotors": sheet.model.rotors,
        "response": response_of(sheet),
        "effects": {
            effect.name: {"coefficients": effect.coefficients, "shape": dict(effect.shape), "values": effect.values}
            for effect in sheet.model.effects
        },
        "terms_of_rotors": sheet.rotor_terms,
        "gusts": None
        if sheet.model.gusts is None
        else {**_gusts(sheet.model.gusts), "frame": BODY, "how_to_play": GUST_RECIPE},
        **_wrench(sheet),
        "judged": None,
        "provenance": {
            "model": {"name": sheet.file, "sha256": sheet.sha256},
            "cpfls_version": sheet.origin.version,
            "exported_by_cpfls_version": EXPORTER,
            "seed": sheet.origin.seed,
            "inputs": {role: vars(source) for role, source in sheet.origin.inputs.items()},
            "config": sheet.config,
        },
        "period_s": PERIOD,
        "reference_points": attitudes_of(attitudes),
        "reference_wrenches": points_of(points),
        "reference_runs": [run_of(run) for run in runs],
    }
    return strict_json({**document, **sheet.evidence})


def _wrench(sheet: Sheet) -> dict[str, Any]:
    """Give the numbers of what acts, their units, and what it makes of them."""
    traced, learned = traced_wrench(sheet.model), sheet.model.remainder
    lines, components = traced.written(PYTHON)
    units = units_of(sheet.model)
    return {
        "numbers": {name: {"value": value, "unit": units[name]} for name, value in sheet.needed(traced).items()},
        "learned": None
        if learned is None
        else {
            "breakpoints": learned.breakpoints,
            "harmonic_order": learned.harmonic_order,
            "coefficients": np.ravel(learned.coefficients),
        },
        "wrench": {"lines": lines, "components": components},
    }


_OF_ATTITUDE = ("structure", "fuzzy", "rigid_body", "excited_region")


def _over_attitude(model: InertiaFunctions) -> dict[str, Any]:
    region = {
        "description": "'#' where training visited roll and pitch; a line for each roll, pitch along it, from -180 deg",
        "cell_deg": 360 / CELLS,
        "share": np.mean(model.visited),
        "rows": visited_rows(model),
    }
    tensor = dict(zip(INERTIA_PARAMETERS, model.rigid_body.tolist(), strict=True))
    rigid_body = {"unit": "kg m^2", "frame": BODY, "tensor": tensor}
    return dict(zip(_OF_ATTITUDE, (_structure(model), _fuzzy(model), rigid_body, region), strict=True))


def _structure(model: InertiaFunctions) -> dict[str, Any]:
    structure, settings = model.structure, model.structure.settings
    return {
        "structure": settings.structure,
        "input_map": settings.input_map,
        "consequents": settings.consequents,
        "harmonic_order": settings.harmonic_order if settings.consequents == "harmonic" else None,
        "products": settings.products,
        "base": base_of(model),
        "membership_functions": {p.name: p.functions for p in structure.partitions},
        "parameters": structure.parameters,
    }


def _gusts(gusts: Gusts) -> dict[str, Any]:
    names = ("torque_n_m", "force_n"), ("torque_memory_s", "force_memory_s"), _WHITE
    return {
        name: part.tolist()
        for pair, values in zip(names, gusts, strict=True)
        for name, part in zip(pair, values.reshape(2, 3), strict=True)
    }


def _fuzzy(model: InertiaFunctions) -> dict[str, Any]:
    return {
        "inputs": {
            name: {"minimum": data.minimum, "maximum": data.maximum, "width": data.width}
            for name, data in zip(_ANGLES, model.ranges, strict=True)
        },
        "breakpoints": {p.name: b for p, b in zip(model.structure.partitions, model.partitions, strict=True)},
        "unit": "kg m^2",
        "functions": {block.function.name: _function(model, block) for block in model.structure.blocks},
    }


def _function(model: InertiaFunctions, block: Block) -> dict[str, Any]:
    structure, function = model.structure, block.function
    labels = rule_labels(block, structure) if block.partitions else ["constant"]
    coefficients = model.coefficients[block.columns].reshape(block.rules, block.features)
    return {
        "row": function.row,
        "column": function.column,
        "inputs": [_ANGLES[angle] for angle in function.inputs],
        "rules_per_input": [structure.partitions[i].rules(circular=structure.circular) for i in block.partitions],
        "rules": [{"rule": label, "coefficients": own} for label, own in zip(labels, coefficients, strict=True)],
    }
