"""Command `export`: any model as JSON, C or Python, or as a vehicle for simulators and for libraries."""

from __future__ import annotations

import keyword
import re
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from cpfls_cli.artifacts.job import Job, check_outputs, take_inputs
from cpfls_cli.artifacts.model import ModelRecord
from cpfls_cli.artifacts.output import write_texts
from cpfls_cli.artifacts.store import read_record
from cpfls_cli.commands.vehicle_sheets import require_usable, sheet_of, whole_of
from cpfls_cli.errors import InputError
from cpfls_cli.export.holding import Missing
from cpfls_cli.export.json_form import json_text
from cpfls_cli.export.points import reference_points
from cpfls_cli.export.registry import TARGETS, exported, tabled
from cpfls_cli.export.sheet import Sheet
from cpfls_cli.export.source import c_source, python_source
from cpfls_cli.export.text import checked_identifier, identifier
from cpfls_cli.export.vehicle_forms import vehicle_c, vehicle_json, vehicle_python
from cpfls_cli.export.vehicle_sheet import VehicleSheet
from cpfls_cli.identification.model import Model
from cpfls_cli.identification.visited import CELLS
from cpfls_cli.pages.export import export_answer, vehicle_export_answer
from cpfls_cli.report.outcome import Outcome

_SEED = 1
_LANGUAGES = {"json": "JSON", "c": "C", "python": "Python"}
ENDINGS = {"json": ".json", "c": ".c", "python": ".py"} | {form: target.ending for form, target in TARGETS.items()}
# What the module imports beside the standard library: under such a name it would import itself.
_IMPORTED = ("casadi", "jax", "numpy", "rotorpy")


def run(job: Job, model: Path, form: str | None, name: str | None) -> Outcome:
    """Write a model in another form.

    Parameters
    ----------
    job : Job
        Its study is not used: a model holds its own.
    form : {"json", "c", "python"}, a word of `TARGETS`, or None
        None takes the suffix of the output.
    name : str or None
        Prefix of the names in C, name of the model in JSON and XML; None takes the name of the output.
    """
    form = form or _form_of(job.output)
    prefix = _prefix_of(job.output, form, name)
    outputs = _outputs_of(job.output, form)
    source = take_inputs(job, {"model": model})["model"]
    # The file that was asked for first: a message about its folder is to name it.
    check_outputs(job, *reversed(outputs))
    if form in TARGETS:
        return _for_target(job, sheet_of(model, prefix, source, force=job.force), form)
    if whole_of(model) is not None:
        sheet, missing = tabled(sheet_of(model, prefix, source, force=job.force), _LANGUAGES[form])
        return _of_vehicle(job, sheet, form, _vehicle_texts(sheet, form, outputs), sheet.told, missing)
    identified = _sheet(model, prefix, source.sha256, job)
    sizes = _written(job, _texts(identified, form, outputs))
    summary = _summary(job, form, prefix, sizes) | _of_model(identified)
    return Outcome(summary, tuple(export_answer(identified.record, model, sizes, dry_run=job.dry_run)))


def _for_target(job: Job, sheet: VehicleSheet, form: str) -> Outcome:
    """Write a vehicle for a simulator or a library."""
    made = exported(sheet, form, job.output.name)
    return _of_vehicle(job, sheet, form, {job.output: made.text}, [*sheet.told, *made.told], made.missing)


def _of_vehicle(
    job: Job,
    sheet: VehicleSheet,
    form: str,
    texts: dict[Path, str],
    told: Sequence[str],
    missing: Sequence[Missing],
) -> Outcome:
    sizes = _written(job, texts)
    summary = {
        **_summary(job, form, sheet.name, sizes),
        "rotors": sheet.model.rotors,
        "weights": len(sheet.weights),
        "effects": [effect.name for effect in sheet.model.effects],
        "learned": sheet.remainder is not None,
        "missing": [asdict(each) for each in missing],
    }
    return Outcome(summary, tuple(vehicle_export_answer(told, sizes, job.dry_run)))


def _written(job: Job, texts: dict[Path, str]) -> dict[str, int]:
    """Write files, and give the bytes of each."""
    if not job.dry_run:
        write_texts(texts)
    return {str(path): len(text.encode()) for path, text in texts.items()}


def _summary(job: Job, form: str, name: str, sizes: dict[str, int]) -> dict[str, Any]:
    return {
        "dry_run": job.dry_run,
        "format": form,
        "name": name,
        "output": list(sizes),
        "bytes": sum(sizes.values()),
    }


def _of_model(sheet: Sheet) -> dict[str, Any]:
    return {
        "complete": sheet.record.complete,
        "verdict": sheet.record.verdict_label,
        "parameters": sheet.model.structure.parameters,
        "fuzzy": sheet.fuzzy,
        "rigid_body": sheet.rigid,
        "region_share": sheet.region_share,
    }


def _sheet(path: Path, name: str, sha256: str, job: Job) -> Sheet:
    record = read_record(path, ModelRecord)
    if not record.complete and not job.force:
        raise InputError(
            f"{path}: the search for this model did not come to its end ({record.stop_reason or 'unknown'}); "
            "`cpfls identify ... --resume` goes on, --force exports the model as it is, marked as incomplete"
        )
    require_usable(path, record.verdict_label, force=job.force)
    return Sheet(name, _usable(record.rebuilt(path), path), record, path.name, sha256)


def _usable(model: Model, path: Path) -> Model:
    """Refuse what no other program could evaluate."""
    if model.visited.shape != (CELLS, CELLS):
        raise InputError(f"{path}: model/visited: is {model.visited.shape}, not {(CELLS, CELLS)}; identify it again")
    for partition, peaks in zip(model.structure.partitions, model.partitions, strict=True):
        if not (np.all(np.diff(peaks) >= 0.0) and np.all((peaks >= 0.0) & (peaks <= 1.0))):
            raise InputError(f"{path}: model/weights: those of {partition.name} make no partition; identify it again")
    return model


def _texts(sheet: Sheet, form: str, outputs: list[Path]) -> dict[Path, str]:
    points = reference_points(sheet.model, np.random.default_rng(_SEED))
    if form == "json":
        return {outputs[0]: json_text(sheet, points)}
    if form == "python":
        return {outputs[0]: python_source(sheet, points, outputs[0].name)}
    written = c_source(sheet, points, outputs[1].stem)
    return {outputs[0]: written.header, outputs[1]: written.source}


def _vehicle_texts(sheet: VehicleSheet, form: str, outputs: list[Path]) -> dict[Path, str]:
    if form == "json":
        return {outputs[0]: vehicle_json(sheet)}
    if form == "python":
        return {outputs[0]: vehicle_python(sheet, outputs[0].name)}
    written = vehicle_c(sheet, outputs[1].stem)
    return {outputs[0]: written.header, outputs[1]: written.source}


def _form_of(output: Path) -> str:
    """Choose a form by the suffix of a file.

    Returns
    -------
    str

    Raises
    ------
    InputError
    """
    for form, ending in ENDINGS.items():
        if output.suffix == ending:
            return form
    told: dict[str, str] = {}
    for form, ending in ENDINGS.items():
        told.setdefault(ending, form)
    endings = ", ".join(f"{ending} ({form})" for ending, form in told.items())
    raise InputError(f"{output}: the ending tells no form; end the name in one of {endings}")


def _prefix_of(output: Path, form: str, name: str | None) -> str:
    """Choose the prefix of the names in source code.

    Parameters
    ----------
    name : str or None
        What was asked for.

    Raises
    ------
    InputError
    """
    if name is None:
        return identifier(output.stem)
    if ENDINGS[form] == ".py":
        raise InputError(f"--name {name}: a module of Python is called as its file is; leave --name out, or rename -o")
    return checked_identifier(name)


def _outputs_of(output: Path, form: str) -> list[Path]:
    """Name the files to be written, the one that needs the others last.

    Raises
    ------
    InputError
    """
    ending = ENDINGS[form]
    if output.suffix != ending:
        raise InputError(f"{output}: --format {form} writes a file that ends in {ending}; name it so")
    if ending == ".py" and not _importable(output.stem):
        raise InputError(
            f"{output}: Python cannot import a module of this name; use letters, digits and _, no digit first, none of "
            f"its own words or modules, not {', '.join(_IMPORTED[:-1])} or {_IMPORTED[-1]}, such as "
            f"{identifier(output.stem)}_model.py"
        )
    if form != "c":
        return [output]
    if not re.fullmatch(r"[A-Za-z0-9_.+-]+", output.stem):
        raise InputError(f"{output}: C includes its header by name; use letters, digits and any of _ . + - in it")
    return [output.with_suffix(".h"), output]


def _importable(stem: str) -> bool:
    return stem.isidentifier() and not keyword.iskeyword(stem) and stem not in {*_IMPORTED, *sys.stdlib_module_names}
