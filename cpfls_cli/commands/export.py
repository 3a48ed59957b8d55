"""Command `export`: any model as JSON or C, or as a vehicle for simulators and for libraries."""

from __future__ import annotations

import keyword
import re
import sys
from dataclasses import asdict
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from cpfls_cli.artifacts.job import Job, check_outputs, take_inputs
from cpfls_cli.artifacts.output import write_files
from cpfls_cli.commands.vehicle_sheets import sheet_of
from cpfls_cli.errors import InputError
from cpfls_cli.export.registry import FORMS, Exported, exported
from cpfls_cli.export.sheet import Sheet
from cpfls_cli.export.text import checked_identifier, identifier
from cpfls_cli.pages.export import export_answer
from cpfls_cli.report.outcome import Outcome

VIEWERS = {"mcap": ".mcap", "csv": ".csv"}
"""What is drawn by other programs, which is no model."""
ENDINGS = {form: chosen.ending for form, chosen in FORMS.items()} | VIEWERS
# What the module imports beside the standard library: under such a name it would import itself.
_IMPORTED = ("casadi", "jax", "numpy", "rotorpy")


def run(job: Job, model: Path, form: str | None, name: str | None, *, anyway: bool = False) -> Outcome:
    """Write a model in another form."""
    form = form or _form_of(job.output)
    if job.output.suffix != ENDINGS[form]:
        raise InputError(f"{job.output}: --format {form} writes a file that ends in {ENDINGS[form]}; name it so")
    if form in VIEWERS:
        return import_module("cpfls_cli.commands.viewers").run(job, model, form)  # type: ignore[no-any-return]
    prefix = _prefix_of(job.output, form, name)
    outputs = _outputs_of(job.output, form)
    source = take_inputs(job, {"model": model})["model"]
    # The file that was asked for first: a message about its folder is to name it.
    check_outputs(job, *reversed(outputs))
    sheet = sheet_of(model, prefix, source, force=job.force, anyway=anyway)
    made = exported(sheet, form, job.output.name)
    texts = dict(zip(outputs, made.texts.values(), strict=True))
    if not job.dry_run:
        write_files(texts)
    sizes = {str(path): len(text.encode()) for path, text in texts.items()}
    answer = export_answer([*sheet.told, *made.told], sheet.warnings, sizes, job.dry_run)
    return Outcome(_summary(job, form, sheet, made, sizes), tuple(answer))


def _summary(job: Job, form: str, sheet: Sheet, made: Exported, sizes: dict[str, int]) -> dict[str, Any]:
    identified = sheet.identified
    return {
        "dry_run": job.dry_run,
        "format": form,
        "name": sheet.name,
        "output": list(sizes),
        "bytes": sum(sizes.values()),
        "complete": sheet.complete,
        "verdict": sheet.verdict,
        "cautions": list(sheet.cautions),
        "impossible": sheet.impossible or None,
        "rotors": sheet.model.rotors,
        "weights": len(sheet.weights),
        "effects": [effect.name for effect in sheet.model.effects],
        "learned": sheet.model.remainder is not None,
        "missing": [asdict(each) for each in made.missing],
        "parameters": identified and identified.structure.parameters,
        "fuzzy": sheet.rules is not None,
        "rigid_body": bool(sheet.rigid_body.any()),
        "region_share": identified and float(np.mean(identified.visited)),
    }


def _form_of(output: Path) -> str:
    """Choose a form by the suffix of a file."""
    if output.suffix == ".py":
        raise InputError(f"{output}: rotorpy, casadi and jax write Python; name one of them with --format")
    for form, ending in ENDINGS.items():
        if output.suffix == ending:
            return form
    first: dict[str, str] = {}
    for form, ending in ENDINGS.items():
        if ending != ".py":
            first.setdefault(ending, form)
    endings = ", ".join(f"{ending} ({form})" for ending, form in first.items())
    raise InputError(f"{output}: its suffix names no form; give the name one of the suffixes {endings}")


def _prefix_of(output: Path, form: str, name: str | None) -> str:
    """Choose the prefix of the names in source code."""
    if name is None:
        return identifier(output.stem)
    if ENDINGS[form] == ".py":
        raise InputError(f"--name {name}: a Python module is named after its file; leave --name out, or rename -o")
    return checked_identifier(name)


def _outputs_of(output: Path, form: str) -> list[Path]:
    """Name the files to be written, the one that needs the others last."""
    stem = output.stem
    importable = (
        stem.isidentifier() and not keyword.iskeyword(stem) and stem not in {*_IMPORTED, *sys.stdlib_module_names}
    )
    if output.suffix == ".py" and not importable:
        raise InputError(
            f"{output}: Python cannot import a module of this name; use letters, digits and _, no digit first, none of "
            f"its own words or modules, not {', '.join(_IMPORTED[:-1])} or {_IMPORTED[-1]}, such as "
            f"{identifier(output.stem)}_model.py"
        )
    if not FORMS[form].also:
        return [output]
    if not re.fullmatch(r"[A-Za-z0-9_.+-]+", output.stem):
        raise InputError(f"{output}: C includes its header by name; use letters, digits and any of _ . + - in it")
    return [output.with_suffix(FORMS[form].also), output]
