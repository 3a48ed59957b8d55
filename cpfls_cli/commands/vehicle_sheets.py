"""Any model as the sheet that exports are written from."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from cpfls_cli.artifacts.extended import FUZZY_INERTIA, ExtendedRecord
from cpfls_cli.artifacts.model import ModelRecord
from cpfls_cli.artifacts.spec import InputFile, rows_of
from cpfls_cli.artifacts.store import holds, read_record
from cpfls_cli.artifacts.vehicle_model import VehicleGroup, VehicleRecord
from cpfls_cli.config.load import parse_config, validate
from cpfls_cli.config.study import Study
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.errors import InputError
from cpfls_cli.export.holding import Missing, Off, sized
from cpfls_cli.export.sheet import Sheet
from cpfls_cli.identification.model import Model
from cpfls_cli.identification.visited import CELLS
from cpfls_cli.inertia import six_parameters
from cpfls_cli.pages.export import identified_evidence, identified_warnings, identified_worth
from cpfls_cli.pages.extended import worth_in_words
from cpfls_cli.pages.vehicle_model import worth_in_words as vehicle_worth
from cpfls_cli.playback.model import VehicleModel


def sheet_of(path: Path, name: str, file: InputFile, *, force: bool) -> Sheet:
    """Read any model.

    Parameters
    ----------
    name : str
        An identifier.
    force : bool
        Take a model that says itself that nobody should use it, and one whose search was stopped; both are marked.

    Raises
    ------
    InputError
        If it is no good model, or one that needs `force`.
    """
    if holds(path, VehicleRecord):
        sheet = _vehicle_sheet(path, read_record(path, VehicleRecord))
    elif holds(path, ExtendedRecord):
        sheet = _extended_sheet(path, read_record(path, ExtendedRecord))
    else:
        record = read_record(path, ModelRecord)
        model = VehicleModel(vehicle=record.study.vehicle, fuzzy=_usable(record.rebuilt(path), path))
        sheet = replace(identified_sheet(record, model), warnings=tuple(identified_warnings(record, path)))
    if not (sheet.complete or force):
        raise InputError(
            f"{path}: the search for this model did not come to its end ({sheet.stopped or 'unknown'}); "
            "`cpfls identify ... --resume` goes on, --force exports the model as it is, marked as incomplete"
        )
    if sheet.verdict == "do-not-use" and not force:
        raise InputError(f"{path}: its verdict is do-not-use; --force exports it all the same, marked so")
    return replace(sheet, name=name, file=path.name, sha256=file.sha256)


def study_of(sheet: Sheet) -> Study:
    """Give the study that a model was made with."""
    source = f"{sheet.file}: /config"
    return validate(parse_config(sheet.origin.config, source), source)


def identified_sheet(record: ModelRecord, model: VehicleModel) -> Sheet:
    """Put an identified model on a sheet that has no name yet."""
    return Sheet(
        "",
        model,
        tuple(identified_worth(record)),
        record.origin,
        "",
        "",
        verdict=record.verdict_label,
        stopped=None if record.complete else record.stop_reason,
        evidence=identified_evidence(record),
    )


def _usable(model: Model, path: Path) -> Model:
    """Refuse what no other program could evaluate."""
    if model.visited.shape != (CELLS, CELLS):
        raise InputError(f"{path}: model/visited: is {model.visited.shape}, not {(CELLS, CELLS)}; identify it again")
    for partition, peaks in zip(model.structure.partitions, model.partitions, strict=True):
        if not (np.all(np.diff(peaks) >= 0.0) and np.all((peaks >= 0.0) & (peaks <= 1.0))):
            raise InputError(f"{path}: model/weights: those of {partition.name} make no partition; identify it again")
    return model


def _vehicle_sheet(path: Path, record: VehicleRecord) -> Sheet:
    model, outside = _whole(path, record.vehicle), tuple(_unsized(record.vehicle.not_held))
    still, worth = replace(model, wind=(0.0, 0.0, 0.0)), tuple(vehicle_worth(record))
    return Sheet("", still, worth, record.origin, "", "", record.verdict, outside=outside, wind=model.wind)


def _extended_sheet(path: Path, record: ExtendedRecord) -> Sheet:
    if record.vehicle is None:
        raise InputError(
            f"{path}: was made before models with effects could be exported; make it again with `cpfls extend` or "
            "`cpfls gap`"
        )
    model = _whole(path, record.vehicle)
    wind, still = model.wind, replace(model, wind=(0.0, 0.0, 0.0))
    if FUZZY_INERTIA in record.vehicle.not_held:
        still = replace(still, fuzzy=_refitted(path, record, model))
    worth, outside = tuple(worth_in_words(record)), tuple(_sized(record, record.vehicle.not_held))
    floor = tuple(record.gap.floor.tolist())
    return Sheet("", still, worth, record.origin, "", "", outside=outside, wind=wind, floor=floor)


def _whole(path: Path, group: VehicleGroup) -> VehicleModel:
    try:
        return group.vehicle_model()
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _refitted(path: Path, record: ExtendedRecord, model: VehicleModel) -> Model:
    """Give an identified inertia with what the refit adds to the rigid body under it."""
    identified = record.base.rebuilt(path)
    assert identified is not None, "the inertia of a vehicle is constant"
    source = f"{path.name}: /config"
    stated = validate(parse_config(record.origin.config, source), source).vehicle
    added = six_parameters(model.vehicle.inertia_kg_m2) - six_parameters(stated.inertia_kg_m2)
    return replace(_usable(identified, path), rigid_body=identified.rigid_body + added)


def _sized(record: ExtendedRecord, names: tuple[str, ...]) -> Iterator[Missing]:
    """List the effects that no table of weights holds, with their sizes along the held-out flights."""
    known = {} if record.left_out is None else {row["name"]: row for row in rows_of(record.left_out)}
    for name in names:
        if name in known:
            size, ends = (np.array(known[name][key]) for key in ("wrench", "ends"))
            title = _in_numbers(record, name)
            yield sized(title, size, record.gap.floor, Off.of(ends), "along its held-out flights")
        elif name != FUZZY_INERTIA:
            yield from _unsized((name,))


def _unsized(names: tuple[str, ...]) -> Iterator[Missing]:
    for name in names:
        yield Missing(CATALOGUE[name].title if name in CATALOGUE else name, np.nan, np.nan, np.nan, None)


def _in_numbers(record: ExtendedRecord, name: str) -> str:
    """Say what an effect is and which numbers it has, so that others can add it."""
    (effect,) = (each for each in record.effects.named if each.name == name)
    units = {"": "", "1": ""}
    numbers = ", ".join(
        f"{each.name} = {each.value:.4g}{units.get(each.unit, f' {each.unit}')}" for each in effect.coefficients
    )
    return f"{CATALOGUE[name].title} ({CATALOGUE[name].formula}; {numbers})"
