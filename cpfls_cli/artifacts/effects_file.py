"""Effects with all their numbers inside an artifact, enough to evaluate them again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.audit_file import audit_of
from cpfls_cli.artifacts.store import Artifact
from cpfls_cli.artifacts.tables import rows_of, table
from cpfls_cli.dynamics.equations_of_motion import InertiaModel
from cpfls_cli.effects.registry import CATALOGUE, VEHICLE_NUMBERS, effect
from cpfls_cli.gap.balance.weak_flight import Candidate
from cpfls_cli.gap.extended import ExtendedModel, FittedEffect
from cpfls_cli.gap.naming.results import Estimate, NamedEffect

_EFFECT = (("name", "kind", "sentence"), ("named", "p_value", "share", "selection_frequency"))
_COEFFICIENT = (("effect", "name", "unit"), ("value", "low", "high", "plausible_low", "plausible_high"))
_LINEAR = (("effect",), ("value",))
_SHAPE = (("effect", "name"), ("value",))
_PARAMETER = (("name", "unit"), ("value", "low", "high"))


def effects_data(
    effects: Sequence[NamedEffect], named: bool, parameters: Mapping[str, Estimate], linear: Array
) -> dict[str, Any]:
    """Arrange effects as datasets.

    Parameters
    ----------
    named : bool
        Whether the verdict names them.
    parameters : mapping of str to Estimate
        The vehicle's own numbers, as far as they are sure.
    linear : array, shape (parameter,)
        All of them, in the order of the catalogue.
    """
    heads = [{**vars(e), "kind": CATALOGUE[e.name].kind, "named": named} for e in effects]
    shapes = [(e.name, *item) for e in effects if e.candidate is not None for item in e.candidate.shape.items()]
    return {
        **table("effect", heads, *_EFFECT),
        **table("coefficient", [coefficient_row(e.name, c) for e in effects for c in e.coefficients], *_COEFFICIENT),
        **table("linear", [{"effect": e.name, "value": v} for e in effects for v in e.linear], *_LINEAR),
        **table("shape", [dict(zip(("effect", "name", "value"), row, strict=True)) for row in shapes], *_SHAPE),
        **table("parameter", _parameters(parameters, linear), *_PARAMETER),
    }


def coefficient_row(effect_name: str, estimate: Estimate) -> dict[str, Any]:
    """Describe a coefficient as a record."""
    low, high = estimate.plausible
    return {**vars(estimate), "effect": effect_name, "plausible_low": low, "plausible_high": high}


def effects_of(artifact: Artifact) -> list[NamedEffect]:
    """Rebuild the effects of an artifact.

    Raises
    ------
    InputError
        If this program does not know one of them.
    """
    return [_effect(row, artifact) for row in rows_of(artifact, "effect", *_EFFECT)]


def extended_of(artifact: Artifact, base: InertiaModel | None) -> ExtendedModel:
    """Rebuild the model with effects that an artifact holds."""
    fitted = (FittedEffect(e.candidate, e.linear) for e in effects_of(artifact) if e.candidate is not None)
    return ExtendedModel(base, artifact.array("parameter/value"), tuple(fitted), audit_of(artifact))


def _effect(row: Mapping[str, Any], artifact: Artifact) -> NamedEffect:
    name = row["name"]
    coefficients = [_estimate(c) for c in rows_of(artifact, "coefficient", *_COEFFICIENT) if c["effect"] == name]
    linear = [r["value"] for r in rows_of(artifact, "linear", *_LINEAR) if r["effect"] == name]
    shape = {r["name"]: r["value"] for r in rows_of(artifact, "shape", *_SHAPE) if r["effect"] == name}
    entry = effect(name)
    # Faults of sensors are repaired by the audit, and wrong numbers of the vehicle stand among the parameters.
    evaluated = entry.kind in ("wrench", "actuator") and len(shape) == len(entry.shapes)
    candidate = Candidate(entry, shape) if evaluated else None
    return NamedEffect(
        name,
        candidate,
        np.array(linear, dtype=float),
        tuple(coefficients),
        row["p_value"],
        row["share"],
        row["selection_frequency"],
        row["sentence"],
    )


def _estimate(row: Mapping[str, Any]) -> Estimate:
    plausible = (row["plausible_low"], row["plausible_high"])
    return Estimate(row["name"], row["unit"], row["value"], row["low"], row["high"], plausible)


def _parameters(known: Mapping[str, Estimate], linear: Array) -> list[dict[str, Any]]:
    """Take the interval from the estimate, and the number from the fit, which has those that are not sure too."""
    rows = []
    for coefficient, value in zip(VEHICLE_NUMBERS.coefficients, linear, strict=True):
        own = known.get(coefficient.name)
        low, high = (np.nan, np.nan) if own is None else (own.low, own.high)
        rows.append({"name": coefficient.name, "unit": coefficient.unit, "value": value, "low": low, "high": high})
    return rows
