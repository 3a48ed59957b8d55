"""What numerics work with, made again of what records hold: models of vehicles, audits of sensors.

It stands apart from the records, because who only reads one waits for no numerics.
"""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from cpfls_cli.artifacts.audit import AuditGroup, AuditRepairGroup
from cpfls_cli.artifacts.model import USUAL, EffectsGroup, InertiaFunctionsGroup, VehicleGroup
from cpfls_cli.artifacts.spec import rows_of
from cpfls_cli.artifacts.vehicle_model import ObserverGroup, VehicleRecord
from cpfls_cli.consistency.audit import Audit
from cpfls_cli.consistency.repairs import ChannelRepair
from cpfls_cli.dynamics.inertia_functions import InertiaFunctions
from cpfls_cli.effects.registry import effect
from cpfls_cli.errors import InputError, SettingError
from cpfls_cli.fuzzy.inputs import InputRange
from cpfls_cli.playback.gusts import RANGES, GustRanges
from cpfls_cli.playback.history import Observer
from cpfls_cli.playback.lack import Lack
from cpfls_cli.playback.model import ModelEffect, VehicleModel
from cpfls_cli.playback.spread import Estimates
from cpfls_cli.playback.table import Remainder
from cpfls_cli.playback.vehicle import FoundNumber
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


def observer(group: ObserverGroup, past_s: float) -> Observer:
    """Rebuild the observer of a forecast that uses so much of the past."""
    return Observer(rate=group.rate, memory_s=group.memory, past_s=past_s)


def estimates(record: VehicleRecord) -> Estimates:
    """Rebuild what flights say of the numbers of a vehicle.

    Raises
    ------
    InputError
        If the artifact is of before correlations were written.
    """
    if record.correlation is None:
        raise InputError(
            "holds intervals of single numbers, but not how they go together: it was made by an earlier version; run "
            "`cpfls vehicle` again"
        )
    # Where instruments tell the constants no loop has widened their intervals.
    told, gusts = record.instruments is not None, record.disturbance
    loop = np.ones((2, 3)) if told else np.array([np.fmin(record.loop.low, 1.0), np.fmax(record.loop.high, 1.0)])
    return Estimates(
        numbers=[FoundNumber(**row) for row in rows_of(record.found)],
        correlation=record.correlation,
        blocks=record.blocks,
        loop=loop,
        gusts=None if gusts is None else GustRanges.of_known(*(getattr(gusts, name) for name in RANGES)),
        lack=None if gusts is None or gusts.lack is None else Lack(**vars(gusts.lack)),
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
