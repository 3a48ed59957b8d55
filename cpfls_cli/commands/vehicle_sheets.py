"""Any model as the sheet of a whole vehicle, which targets are written from."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.extended import FUZZY_INERTIA, ExtendedRecord
from cpfls_cli.artifacts.model import ModelRecord
from cpfls_cli.artifacts.spec import InputFile, rows_of
from cpfls_cli.artifacts.store import holds, read_record
from cpfls_cli.artifacts.vehicle_model import VehicleRecord
from cpfls_cli.config.load import parse_config, validate
from cpfls_cli.config.study import Study
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.errors import InputError
from cpfls_cli.export.holding import Missing, Off, sized
from cpfls_cli.export.sheet import DO_NOT_USE
from cpfls_cli.export.vehicle_sheet import VehicleSheet
from cpfls_cli.identification.model import Model
from cpfls_cli.identification.visited import CELLS
from cpfls_cli.inertia import INERTIA_ENTRIES, six_parameters
from cpfls_cli.pages.extended import worth_in_words
from cpfls_cli.pages.vehicle_model import worth_in_words as vehicle_worth
from cpfls_cli.playback.model import VehicleModel

_STEEP = 0.1


def whole_of(path: Path) -> type[VehicleRecord | ExtendedRecord] | None:
    """Tell which record of a whole vehicle a file holds; None for an identified model, or something else."""
    return next((kind for kind in (VehicleRecord, ExtendedRecord) if holds(path, kind)), None)


def sheet_of(path: Path, name: str, file: InputFile, *, force: bool) -> VehicleSheet:
    """Read any model as a whole vehicle.

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
    kind = whole_of(path)
    return _identified(path, name, file, force) if kind is None else _whole(path, kind, name, file, force)


def study_of(sheet: VehicleSheet) -> Study:
    """Give the study that a model was made with."""
    source = f"{sheet.file}: /config"
    return validate(parse_config(sheet.origin.config, source), source)


def require_usable(path: Path, verdict: str | None, *, force: bool) -> str:
    """Refuse a model that should not be used, or mark it.

    Returns
    -------
    str
        The mark; empty for any other model.

    Raises
    ------
    InputError
    """
    if verdict != "do-not-use":
        return ""
    if not force:
        raise InputError(f"{path}: its verdict is do-not-use; --force exports it all the same, marked so")
    return DO_NOT_USE


def _whole(
    path: Path, kind: type[VehicleRecord | ExtendedRecord], name: str, file: InputFile, force: bool
) -> VehicleSheet:
    record = read_record(path, kind)
    if record.vehicle is None:
        raise InputError(
            f"{path}: was made before models with effects could be exported; make it again with `cpfls extend` or "
            "`cpfls gap`"
        )
    mark, worth, floor = "", tuple[str, ...](), (np.nan,) * 6
    if isinstance(record, ExtendedRecord):
        worth, floor = tuple(worth_in_words(record)), tuple(record.gap.floor.tolist())
    else:
        mark, worth = require_usable(path, record.verdict, force=force), tuple(vehicle_worth(record))
    try:
        model = record.vehicle.vehicle_model()
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    wind, model = model.wind, replace(model, wind=(0.0, 0.0, 0.0))
    outside = _outside(record)
    if isinstance(record, ExtendedRecord) and FUZZY_INERTIA in record.vehicle.not_held:
        model = _over_attitude(path, record, model)
    return VehicleSheet(name, model, worth, record.origin, path.name, file.sha256, outside, wind, floor, mark)


def _outside(record: VehicleRecord | ExtendedRecord) -> tuple[Missing, ...]:
    """List the parts of a model that no table of weights holds, with their sizes along the held-out flights."""
    assert record.vehicle is not None, "refused before"
    group = record.left_out if isinstance(record, ExtendedRecord) else None
    found = {} if group is None else {row["name"]: row for row in rows_of(group)}
    listed = []
    for name in record.vehicle.not_held:
        if name in found and isinstance(record, ExtendedRecord):
            size, ends = (np.array(found[name][key]) for key in ("wrench", "ends"))
            title = _in_numbers(record, name)
            listed.append(sized(title, size, record.gap.floor, Off.of(ends), "along its held-out flights"))
        elif name != FUZZY_INERTIA:
            title = CATALOGUE[name].title if name in CATALOGUE else name
            listed.append(Missing(title, np.nan, np.nan, np.nan, None))
    return tuple(listed)


def _in_numbers(record: ExtendedRecord, name: str) -> str:
    """Say what an effect is and which numbers it has, so that others can add it."""
    (effect,) = (each for each in record.effects.named if each.name == name)
    units = {"": "", "1": ""}
    numbers = ", ".join(
        f"{each.name} = {each.value:.4g}{units.get(each.unit, f' {each.unit}')}" for each in effect.coefficients
    )
    return f"{CATALOGUE[name].title} ({CATALOGUE[name].formula}; {numbers})"


def _over_attitude(path: Path, record: ExtendedRecord, model: VehicleModel) -> VehicleModel:
    """Put an identified inertia under what the refit adds to it."""
    identified = record.base.rebuilt(path)
    assert identified is not None, "the inertia of a vehicle is constant"
    source = f"{path.name}: /config"
    stated = validate(parse_config(record.origin.config, source), source).vehicle
    vehicles = (model.vehicle, stated)
    refitted, given = (np.array(six_parameters(vehicle.inertia_kg_m2), dtype=float) for vehicle in vehicles)
    fuzzy = replace(identified, rigid_body=identified.rigid_body + (refitted - given))
    return replace(model, vehicle=replace(model.vehicle, inertia_kg_m2=_mean_inertia(path, fuzzy)), fuzzy=fuzzy)


def _identified(path: Path, name: str, file: InputFile, force: bool) -> VehicleSheet:
    record = read_record(path, ModelRecord)
    if not record.complete and not force:
        raise InputError(
            f"{path}: the search for this model did not come to its end ({record.stop_reason or 'unknown'}); "
            "`cpfls identify ... --resume` goes on, --force exports the model as it is, marked as incomplete"
        )
    mark = require_usable(path, record.verdict_label, force=force)
    if not record.complete:
        mark = f"INCOMPLETE MODEL: its search did not come to its end. Do not fly with it. {mark}".rstrip()
    identified = record.rebuilt(path)
    worth = (f"Verdict: {record.verdict_label or 'none'}.", "Rotors, mass and all forces are those of the config.")
    vehicle = replace(record.study.vehicle, inertia_kg_m2=_mean_inertia(path, identified))
    model = VehicleModel(vehicle=vehicle, fuzzy=identified)
    return VehicleSheet(name, model, worth, record.origin, path.name, file.sha256, mark=mark)


def _mean_inertia(path: Path, model: Model) -> tuple[float, float, float, float, float, float]:
    """Average the inertia over the attitudes that training visited, in body axes, for targets that hold but one."""
    cell = 2 * np.pi / CELLS
    roll, pitch = ((np.argwhere(model.visited) + 0.5) * cell - np.pi).T
    attitude = np.column_stack([roll, pitch, np.zeros_like(roll)])
    attitude = attitude[np.abs(np.cos(attitude[:, 1])) > _STEEP]
    axes = [rotations.attitude_rate(attitude, np.broadcast_to(axis, attitude.shape)) for axis in np.eye(3)]
    inverse = np.stack(axes, axis=2)
    tensors: Array = inverse.swapaxes(1, 2) @ model.inertia(attitude).value @ inverse
    mean = tensors.mean(axis=0)
    if not (len(tensors) and np.linalg.eigvalsh(mean).min() > 0):
        raise InputError(
            f"{path}: its {FUZZY_INERTIA}, averaged where training went, is that of no body; identify it again"
        )
    xx, yy, zz, xy, xz, yz = (float(mean[entry]) for entry in INERTIA_ENTRIES)
    return xx, yy, zz, xy, xz, yz
