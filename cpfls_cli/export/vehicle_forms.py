"""A whole vehicle as C99, as a module of Python and as JSON: one table of weights, and the same small code for all."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.spec import BODY, WORLD
from cpfls_cli.effects.polynomial import FACTORS
from cpfls_cli.export.sheet import EXPORTER
from cpfls_cli.export.source import CSource, fill_template
from cpfls_cli.export.text import c_row, comment_lines, comment_text, filled, number, python_rows, strict_json
from cpfls_cli.export.vehicle_sheet import (
    PERIOD,
    ReferencePoints,
    ReferenceRun,
    VehicleSheet,
    reference_points,
    reference_run,
)
from cpfls_cli.fuzzy.membership import Z_FUNCTION

FORMAT, VERSION = "cpfls/vehicle-json", 1
_SEED = 1
_FASTEST_PERIOD = 1e-3
_SHORTEST_S = 1e-5

_CONVENTIONS = {
    "body_frame": f"{BODY}: x forward, y left, z up",
    "world_frame": WORLD,
    "position, velocity": "world frame, m and m/s",
    "rotation": "matrix R that turns body vectors into the world frame",
    "rate": "omega, body frame, rad/s",
    "air": "velocity through the air, body frame, m/s: R^T (velocity - wind)",
    "speed": "of the rotors, rad/s",
}

HOW_TO_EVALUATE = (
    "Row k of (torque x y z in N m, force x y z in N) is the sum over all weights of that row of weight * term of the "
    "motion * term of the rotors, both by their index from 0 in the lists of their names.",
    "Terms of the motion are 1; u v w p q r, the components of air and rate; their products; |u| u, |u| v, |u| w with "
    "the length |u| of air; |p| p, |q| q, |r| r; then for each column c of the learned part c U and c U^2, U = "
    "sqrt(u^2 + v^2).",
    "Columns of the learned part: with the angle a = atan2(v, u) and x = (a mod 2 pi) / 2 pi, the membership functions "
    "have their peaks at the breakpoints b. Between two, u = (x - b1) / (b2 - b1): the left function falls by "
    f"{Z_FUNCTION}, the right one is 1 minus that. Rule 1 fires by the first function plus the last, the others by "
    "their own; one breakpoint alone is one rule that fires by 1. Columns run over rules, then over features: 1 and "
    "sin a .. sin n a, cos a .. cos n a with n = harmonic_order, or where that is 0 the triangle wave s with s(0) = 0, "
    "s(pi/2) = 1, s(pi) = 0, s(3 pi/2) = -1. Column times firing.",
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
    "reference_points and reference_runs hold what cpfls computes; errors compare with scale.",
)


def vehicle_c(sheet: VehicleSheet, stem: str) -> CSource:
    """Write a vehicle as C99.

    Parameters
    ----------
    stem : str
        Name of both files without ``.c`` and ``.h``.
    """
    points, runs = _references(sheet)
    weights = zip(*(column.tolist() for column in sheet.weights), strict=True)
    peaks = _peaks(sheet)
    words = {
        **common_words(sheet),
        "source": comment_text(f"{stem}.c"),
        "header": comment_text(f"{stem}.h"),
        "history": int(sheet.model.response.delay_s / _FASTEST_PERIOD * (1 + 1e-9)) + 2,
        "inertia_rows": [c_row(row) for row in sheet.model.body.inertia],
        "inverse_rows": [c_row(row) for row in sheet.model.body.inverse],
        "factor_rows": filled(", ".join(f"{{{first}, {second}}}" for first, second in FACTORS.tolist()), 4),
        "weights": [f"{{{row}, {term}, {rotor}, R({number(weight)})}}," for row, term, rotor, weight in weights],
        "peaks": len(peaks),
        "rules": max(len(peaks) - 1, 1),
        "features": 1 + (2 * _order(sheet) or 1),
        "peak_rows": filled(c_row(peaks), 4),
        "points": [_c_braces(list(points_of(points, index).values()), 4) for index in range(len(points.air))],
        "runs": [_c_run(run) for run in runs],
        "steps": len(runs[0].rotor),
    }
    return CSource(fill_template("vehicle.c.j2", words), fill_template("vehicle.h.j2", words))


def vehicle_python(sheet: VehicleSheet, file: str) -> str:
    """Write a vehicle as a module of Python.

    Parameters
    ----------
    file : str
        Name of the file.
    """
    points, runs = _references(sheet)
    weights = zip(*(column.tolist() for column in sheet.weights), strict=True)
    words = {
        **common_words(sheet),
        "source": comment_text(file),
        "inertia_rows": python_rows(sheet.model.body.inertia, 4),
        "inverse_rows": python_rows(sheet.model.body.inverse, 4),
        "factor_rows": filled(", ".join(f"[{first}, {second}]" for first, second in FACTORS.tolist()), 8),
        "weights": [f"[{row}, {term}, {rotor}, {number(weight)}]," for row, term, rotor, weight in weights],
        "peak_rows": python_rows(_peaks(sheet), 4),
        "points": [_python_entries(points_of(points, index)) for index in range(len(points.air))],
        "runs": [_python_entries(_run_of(run)) for run in runs],
    }
    return fill_template("vehicle.py.j2", words)


def vehicle_json(sheet: VehicleSheet) -> str:
    """Write a vehicle as strict JSON."""
    points, runs = _references(sheet)
    vehicle, response = sheet.model.vehicle, sheet.model.response
    document = {
        "format": FORMAT,
        "format_version": VERSION,
        "name": sheet.name,
        "worth": list(sheet.worth),
        "conventions": _CONVENTIONS,
        "how_to_evaluate": HOW_TO_EVALUATE,
        "mass_kg": vehicle.mass_kg,
        "gravity_m_s2": vehicle.gravity_m_s2,
        "inertia_kg_m2": sheet.model.body.inertia,
        "rotors": sheet.model.rotors,
        "response": {
            "delay_s": response.delay_s,
            "lag_s": _acting(response.lag_s),
            "slow_s": _acting(response.slow_s),
        },
        "effects": {
            effect.name: {"coefficients": effect.coefficients, "shape": dict(effect.shape)}
            for effect in sheet.model.effects
        },
        "terms_of_motion": sheet.terms,
        "terms_of_rotors": sheet.rotor_terms,
        "factors_of_products": FACTORS.tolist(),
        "weights": {name: column.tolist() for name, column in sheet.weights._asdict().items()},
        "learned": None
        if sheet.remainder is None
        else {"breakpoints": _peaks(sheet), "harmonic_order": sheet.remainder.harmonic_order},
        "provenance": {
            "model": {"name": sheet.file, "sha256": sheet.sha256},
            "cpfls_version": sheet.origin.version,
            "exported_by_cpfls_version": EXPORTER,
            "seed": sheet.origin.seed,
            "inputs": {role: vars(source) for role, source in sheet.origin.inputs.items()},
            "config": sheet.config,
        },
        "period_s": PERIOD,
        "reference_points": [points_of(points, index) for index in range(len(points.air))],
        "reference_runs": [_run_of(run) for run in runs],
    }
    return strict_json(document)


def _references(sheet: VehicleSheet) -> tuple[ReferencePoints, tuple[ReferenceRun, ReferenceRun]]:
    rng = np.random.default_rng(_SEED)
    points = reference_points(sheet.model, rng)
    return points, (reference_run(sheet.model, rng, "linear"), reference_run(sheet.model, rng, "previous"))


def common_words(sheet: VehicleSheet) -> dict[str, Any]:
    """Gather what both languages ask for."""
    vehicle, response = sheet.model.vehicle, sheet.model.response
    return {
        "name": sheet.name,
        "macro": sheet.name.upper(),
        "facts": comment_lines(sheet.facts),
        "model_sha256": sheet.sha256,
        "rotors": sheet.model.rotors,
        "terms": sheet.terms,
        "factors": FACTORS,
        "mass": number(vehicle.mass_kg),
        "gravity": number(vehicle.gravity_m_s2),
        "delay": number(response.delay_s),
        "lag": number(_acting(response.lag_s)),
        "slow": number(_acting(response.slow_s)),
        "learned": sheet.remainder is not None,
        "order": _order(sheet),
        "period": number(PERIOD),
    }


def _acting(time_constant: float) -> float:
    """Write time constants that `cpfls_cli.playback.rotors` takes for none as 0."""
    return time_constant if time_constant >= _SHORTEST_S else 0.0


def _order(sheet: VehicleSheet) -> int:
    return 0 if sheet.remainder is None else sheet.remainder.harmonic_order


def _peaks(sheet: VehicleSheet) -> Array:
    return np.zeros(0) if sheet.remainder is None else sheet.remainder.breakpoints


def points_of(points: ReferencePoints, index: int) -> dict[str, Array]:
    """Give one of the states with what the model gives there, by name."""
    return {name: values[index] for name, values in points._asdict().items()}


def _run_of(run: ReferenceRun) -> dict[str, Any]:
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


def _c_run(run: ReferenceRun) -> str:
    parts = list(_run_of(run).values())
    return _c_braces(parts, 4)


def _c_braces(values: Any, indent: int) -> str:
    """Write nested lists of numbers in braces, one part to a line."""
    parts = [f"{int(part)}," if isinstance(part, bool) else _c_part(part, indent + 4) for part in values]
    blank = " " * indent
    return "\n".join(
        [f"{blank}{{", *(part if part.startswith(" ") else f"{blank}    {part}" for part in parts), f"{blank}}},"]
    )


def _c_part(part: Sequence[Any] | Array, indent: int) -> str:
    if isinstance(part, np.ndarray) and part.ndim == 1:
        return filled(f"{{{c_row(part)}}},", indent)
    return _c_braces(part, indent)


def _python_entries(entries: dict[str, Any]) -> str:
    lines = [filled(f'"{name}": {_plain(values)!r},', 8) for name, values in entries.items()]
    return "\n".join(["    {", *lines, "    },"])


def _plain(values: Any) -> Any:
    if isinstance(values, list):
        return [_plain(value) for value in values]
    return values.tolist() if isinstance(values, np.ndarray) else values
