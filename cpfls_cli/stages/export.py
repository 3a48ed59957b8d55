"""Write a model as code or for a simulator; flights, replays, gaps and others for Foxglove or PlotJuggler."""

from __future__ import annotations

import keyword
import re
import sys
from dataclasses import asdict
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from cpfls_cli import store
from cpfls_cli.arguments import ExportAnywayOption
from cpfls_cli.artifacts.output import check_output
from cpfls_cli.errors import InputError
from cpfls_cli.export.mcap_form import TIME, View, csv_text, mcap_bytes
from cpfls_cli.export.registry import FORMS, exported
from cpfls_cli.export.text import checked_identifier, identifier
from cpfls_cli.export.viewed import view_of
from cpfls_cli.stage import Run, kind_of, stage
from cpfls_cli.stages._sheets import sheet_of

Formats = StrEnum(
    "Formats",
    "json c sdf px4 crazyflow urdf ardupilot mjcf rotorpy pegasus pyflyt webots crazyflie betaflight px4params casadi "
    "jax mcap csv",
)
ModelArgument = Annotated[
    Path,
    typer.Argument(
        metavar="MODEL",
        help="Made by `cpfls identify`, `extend` or `vehicle`; for .mcap and .csv a flight, replay, "
        "disagreement, diagnosis or response.",
    ),
]
FormatOption = Annotated[
    Formats | None,
    typer.Option(
        "--format",
        help="json: every parameter, with names and units; c: C99 source and header, no dependencies; "
        "sdf (Gazebo), px4 (its Gazebo, with the airframe), mjcf (MuJoCo), urdf "
        "(gym-pybullet-drones, Isaac), crazyflow (and drone-models), ardupilot (a frame of its SITL), rotorpy, "
        "pegasus (Isaac Sim), pyflyt, webots, casadi, jax: the vehicle for a simulator or a library; crazyflie "
        "(lines of its header), betaflight (mmix), px4params (CA_ROTOR): what an autopilot states of it; mcap "
        "(Foxglove), csv (PlotJuggler): what a flight, replay, gap or response holds, on the log's own clock; default: "
        "by the suffix of FILE (.json, .c, .xml, .sdf, .urdf, .toml, .proto, .mcap, .csv).",
    ),
]
NameOption = Annotated[
    str | None,
    typer.Option(
        "--name",
        metavar="NAME",
        help="Prefix of the names in C, name in JSON and XML, but not for PyFlyt and Webots; default: from the name of "
        "FILE.",
    ),
]
VIEWERS = {"mcap": ".mcap", "csv": ".csv"}
"""What is drawn by other programs, which is no model."""
ENDINGS = {form: chosen.ending for form, chosen in FORMS.items()} | VIEWERS
# What an autopilot states is no whole vehicle, so it is asked for by name.
_BY_SUFFIX = {form: ending for form, ending in ENDINGS.items() if form in VIEWERS or not FORMS[form].lacks}
# What the module imports beside the standard library: under such a name it would import itself.
_NAMED_AS_FILES = {"pyflyt": "a model of PyFlyt", "webots": "a PROTO of Webots"}
_IMPORTED = ("casadi", "jax", "numpy", "pegasus", "rotorpy")


@stage(dict, words={"TIME": TIME})
def export(
    run: Run,
    model: ModelArgument,
    format: FormatOption = None,  # the name of the option
    name: NameOption = None,
    anyway: ExportAnywayOption = False,
) -> dict[str, Any]:
    """Write a model, or what programs draw, in another form."""
    form = format.value if format else _form_of(run.output)
    if run.output.suffix != ENDINGS[form]:
        raise InputError(f"{run.output}: --format {form} writes a file that ends in {ENDINGS[form]}; name it so")
    return _drawn(run, model, form) if form in VIEWERS else _modelled(run, model, form, name, anyway=anyway)


def _modelled(run: Run, model: Path, form: str, name: str | None, *, anyway: bool) -> dict[str, Any]:
    """Write a model."""
    prefix, outputs = _prefix_of(run.output, form, name), _outputs_of(run.output, form)
    source = run.take({"model": model})["model"]
    for output in outputs[:-1]:
        check_output(output, run.force, run.inputs)
    sheet = sheet_of(model, prefix, source, force=run.force, anyway=anyway)
    made = exported(sheet, form, run.output.name)
    run.texts |= zip(outputs, made.texts.values(), strict=True)
    identified = sheet.identified
    run.also = {
        "name": sheet.name,
        "complete": sheet.complete,
        "verdict": sheet.verdict,
        "cautions": sheet.cautions,
        "impossible": sheet.impossible or None,
        "rotors": sheet.model.rotors,
        "weights": len(sheet.numbers),
        "effects": [effect.name for effect in sheet.model.effects],
        "learned": sheet.model.remainder is not None,
        "parameters": None if identified is None else identified.structure.parameters,
        "fuzzy": sheet.rules is not None,
        "rigid_body": bool(sheet.rigid_body.any()),
        "region_share": None if identified is None else float(np.mean(identified.visited)),
        "missing": [asdict(each) for each in made.missing],
    }
    return _written(run, form, (*sheet.remarks, *made.remarks), sheet.warnings)


def _drawn(run: Run, artifact: Path, form: str) -> dict[str, Any]:
    """Write the quantities of an artifact over the clock of its log."""
    run.take({"artifact": artifact})
    given, origin = store.read(artifact, kind_of(artifact))
    view = view_of(artifact, given, origin.config)
    run.texts[run.output] = mcap_bytes(view) if form == "mcap" else csv_text(view)
    tracks = [
        {
            "name": each.path,
            "unit": each.unit,
            "frame": each.frame,
            "samples": len(each.time),
            "first_s": float(np.min(each.time, initial=np.inf)),
            "values": list(each.values),
            "axes": each.axes,
        }
        for each in view.tracks
    ]
    run.also = {"on_log_clock": view.on_log_clock, "tracks": tracks, "curves": [curve.name for curve in view.curves]}
    return _written(run, form, view=view)


def _written(
    run: Run, form: str, said: tuple[str, ...] = (), warnings: tuple[str, ...] = (), view: View | None = None
) -> dict[str, Any]:
    sizes = {str(path): len(each if isinstance(each, bytes) else each.encode()) for path, each in run.texts.items()}
    made = {"dry_run": run.dry_run, "format": form, "output": list(sizes), "bytes": sum(sizes.values())}
    run.also = made | run.also
    return made | {"sizes": sizes, "said": said, "warnings": warnings, "view": view}


def _form_of(output: Path) -> str:
    """Choose a form by the suffix of a file."""
    if output.suffix == ".py":
        raise InputError(f"{output}: rotorpy, pegasus, casadi and jax write Python; name one of them with --format")
    for form, ending in _BY_SUFFIX.items():
        if output.suffix == ending:
            return form
    first: dict[str, str] = {}
    for form, ending in _BY_SUFFIX.items():
        if ending != ".py":
            first.setdefault(ending, form)
    endings = ", ".join(f"{ending} ({form})" for ending, form in first.items())
    raise InputError(f"{output}: its suffix names no form; give the name one of the suffixes {endings}")


def _prefix_of(output: Path, form: str, name: str | None) -> str:
    """Choose the prefix of the names in source code."""
    if name is None:
        return identifier(output.stem)
    whole = "a Python module" if ENDINGS[form] == ".py" else _NAMED_AS_FILES.get(form)
    if whole is not None:
        raise InputError(f"--name {name}: {whole} is named after its file; leave --name out, or rename -o")
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
