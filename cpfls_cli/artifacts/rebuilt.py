"""What numerics work with, made again of what records hold: models of vehicles, audits of sensors.

It stands apart from the records, because who only reads one waits for no numerics.
"""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from cpfls_cli.artifacts.audit import AuditGroup, AuditRepairGroup
from cpfls_cli.artifacts.model import USUAL, EffectsGroup, InertiaFunctionsGroup, VehicleGroup
from cpfls_cli.artifacts.spec import rows_of
from cpfls_cli.consistency.audit import Audit
from cpfls_cli.consistency.repairs import ChannelRepair
from cpfls_cli.dynamics.inertia_functions import InertiaFunctions
from cpfls_cli.effects.registry import effect
from cpfls_cli.errors import InputError, SettingError
from cpfls_cli.fuzzy.inputs import InputRange
from cpfls_cli.playback.model import ModelEffect, VehicleModel
from cpfls_cli.playback.table import Remainder
from cpfls_cli.regressor.structure import StructureSettings, model_structure


def vehicle_model(group: VehicleGroup) -> VehicleModel:
    """Rebuild the model of a vehicle."""
    remainder = group.remainder
    return VehicleModel(
        vehicle=group.vehicle(),
        response=group.response.response(),
        thrust_linear=group.rotor.thrust_linear,
        effects=model_effects(group.effect),
        remainder=None
        if remainder is None
        else Remainder(
            breakpoints=remainder.breakpoints,
            harmonic_order=remainder.harmonic_order,
            rows=remainder.rows.astype(np.int64),
            coefficients=remainder.coefficients,
        ),
        wind=(0.0, 0.0, 0.0) if group.wind is None else tuple(group.wind.tolist()),
        fuzzy=None if group.inertia_functions is None else inertia_functions(group.inertia_functions),
        commanded=group.response.commanded,
        hold=None if group.response.hold == USUAL else group.response.hold,  # type: ignore[arg-type]
        repairs=None if group.repair is None else audit(group.repair),
        gusts=None if group.gusts is None else group.gusts.gusts(),
    )


def model_effects(group: EffectsGroup) -> tuple[ModelEffect, ...]:
    """Rebuild the effects of the catalogue in a model."""
    return tuple(ModelEffect(effect(name).name, group.shape_of(name), group.linear_of(name)) for name in group.name)


def inertia_functions(group: InertiaFunctionsGroup) -> InertiaFunctions:
    """Rebuild an inertia over attitude."""
    given = {own.name: getattr(group, own.name) for own in fields(StructureSettings)}
    functions = tuple(group.membership_functions.tolist())
    try:
        structure = model_structure(StructureSettings(**given | {"membership_functions": functions}))
    except SettingError as error:
        raise InputError(f"vehicle/inertia_functions/{error}") from None
    names = np.array(group.partition)
    partitions = tuple(np.asarray(group.breakpoints[names == each.name]) for each in structure.partitions)
    peaks = [len(each) for each in partitions]
    wanted = [each.functions for each in structure.partitions]
    if peaks != wanted or len(group.coefficients) != structure.parameters:
        raise InputError(
            f"vehicle/inertia_functions holds {peaks} breakpoints and {len(group.coefficients)} coefficients; its "
            f"structure needs {wanted} and {structure.parameters}"
        )
    roll, pitch = (InputRange(*map(float, row)) for row in group.input_range)
    return InertiaFunctions(
        structure, (roll, pitch), partitions, group.coefficients, group.rigid_body, group.visited.astype(bool)
    )


def audit(group: AuditGroup) -> Audit:
    """Rebuild the audit of sensors, as far as repairs need it."""
    return Audit(
        group.findings,
        group.untested_because,
        group.warning,
        group.note,
        repairs=() if group.repair is None else _repairs(group.repair),
        contradictions=group.contradiction or (),
    )


def _repairs(group: AuditRepairGroup) -> tuple[ChannelRepair, ...]:
    rows = rows_of(group)
    for row in rows:
        row |= {name: bool(row[name]) for name in ("dropped", "in_body")} | {"matrix": np.array(row["matrix"])}
    return tuple(ChannelRepair(**row) for row in rows)
