"""Write a model as code or for a simulator; flights, replays, gaps and others for Foxglove or PlotJuggler."""

from __future__ import annotations

import keyword
import re
import sys
from collections.abc import Iterator, Mapping
from dataclasses import asdict, replace
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from cpfls_cli import store
from cpfls_cli.arguments import ExportAnywayOption
from cpfls_cli.artifacts.diagnosis import Extended
from cpfls_cli.artifacts.gate import InputFile, Origin, read_origin
from cpfls_cli.artifacts.identified import IdentifiedModel
from cpfls_cli.artifacts.model import AnyModel
from cpfls_cli.artifacts.output import check_output
from cpfls_cli.config.load import stored_study
from cpfls_cli.dynamics import CELLS, InertiaFunctions
from cpfls_cli.errors import InputError
from cpfls_cli.export.holding import Missing, Off, sized
from cpfls_cli.export.mcap_form import TIME, View, csv_text, mcap_bytes
from cpfls_cli.export.registry import FORMS, exported
from cpfls_cli.export.sheet import REFITTED, Sheet
from cpfls_cli.export.text import checked_identifier, identifier
from cpfls_cli.export.viewed import view_of
from cpfls_cli.flights.models import any_model, modelled
from cpfls_cli.pages.model import against, impossible_in_words, said_by
from cpfls_cli.playback.model import ModelEffect, VehicleModel, commanded_anew
from cpfls_cli.result import about, result
from cpfls_cli.stage import Run, kind_of, stage
from cpfls_cli.validation.trust import Trust

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
_BY_VOLTAGE = "multiply commands by (V/V_0)^(n/2) before they are passed, by {:.3g} where V is 90 % of V_0"
# What an autopilot states is no whole vehicle, so it is asked for by name.
_BY_SUFFIX = {form: ending for form, ending in ENDINGS.items() if form in VIEWERS or not FORMS[form].lacks}
# What the module imports besides the standard library: under such a name it would import itself.
_NAMED_AS_FILES = {"pyflyt": "a model of PyFlyt", "webots": "a PROTO of Webots"}
_IMPORTED = ("casadi", "jax", "numpy", "pegasus", "rotorpy")


@result
class Written:
    """Files for other programs."""

    dry_run: bool = about("whether nothing was written")
    format: str = about("that they are of")
    output: tuple[str, ...] = about("their names", "file")
    bytes: int = about("in all of them")
    sizes: Mapping[str, int] = about("bytes of each", brief=False)
    said: tuple[str, ...] = about("what a model is, and what the form does not hold", "sentence", brief=False)
    warnings: tuple[str, ...] = about("what speaks against using it", "warning", brief=False)
    view: View | None = None


@stage(Written, words={"TIME": TIME})
def export(
    run: Run,
    model: ModelArgument,
    format: FormatOption = None,  # the name of the option
    name: NameOption = None,
    anyway: ExportAnywayOption = False,
) -> Written:
    """Write a model, or what programs draw, in another form."""
    form = format.value if format else _form_of(run.output)
    if run.output.suffix != ENDINGS[form]:
        raise InputError(f"{run.output}: --format {form} writes a file that ends in {ENDINGS[form]}; name it so")
    return _drawn(run, model, form) if form in VIEWERS else _modelled(run, model, form, name, anyway=anyway)


def _modelled(run: Run, model: Path, form: str, name: str | None, *, anyway: bool) -> Written:
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


def _drawn(run: Run, artifact: Path, form: str) -> Written:
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
) -> Written:
    sizes = {str(path): len(each if isinstance(each, bytes) else each.encode()) for path, each in run.texts.items()}
    return Written(
        dry_run=run.dry_run,
        format=form,
        output=tuple(sizes),
        bytes=sum(sizes.values()),
        sizes=sizes,
        said=said,
        warnings=warnings,
        view=view,
    )


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


_SCORE_UNITS = {"mse": "(N m)^2", "max_error": "N m", "relative_error": "1", "r2": "1", "vaf": "1", "r2_body": "1"}


def sheet_of(path: Path, name: str, file: InputFile, *, force: bool, anyway: bool = False) -> Sheet:
    """Read any model; one that nobody should use, or whose search was stopped, needs `force` and is marked.

    Numbers that no vehicle has need `anyway`, which does for the others too.
    """
    record = any_model(path)
    sheet = _bare_sheet(path, record, read_origin(path))
    if isinstance(sheet.model.fuzzy, InertiaFunctions):
        _require_usable(sheet.model.fuzzy, path)
    if sheet.impossible and not anyway:
        raise InputError(
            f"{path}: impossible numbers, which no such vehicle has: {sheet.impossible}; --anyway exports them all the "
            "same, and says so in the first line"
        )
    force = force or anyway
    if not (sheet.complete or force):
        raise InputError(
            f"{path}: the search for this model did not come to its end ({sheet.stopped}); "
            f"`cpfls {record.MADE_BY} ... --resume` goes on, --anyway exports the model as it is, marked as "
            "incomplete"
        )
    if sheet.verdict == "do-not-use" and not force:
        raise InputError(f"{path}: its verdict is do-not-use; --anyway exports it, marked as such")
    return replace(sheet, name=name, file=path.name, sha256=file.sha256)


def bare_sheet(record: AnyModel, model: VehicleModel, origin: Origin) -> Sheet:
    """Put a model on a sheet that has no name yet."""
    return Sheet(
        "",
        model,
        tuple(said_by(record.MADE_BY, record, "usage")),
        origin,
        "",
        "",
        verdict=None if record.trust == Trust.NOT_JUDGED else str(record.trust),
        stopped=record.stopped or None,
        cautions=() if isinstance(record, IdentifiedModel) else (*origin.cautions, *against(record)),
        evidence=_evidence(record) if isinstance(record, IdentifiedModel) else {},
        impossible=impossible_in_words(record),
    )


def _require_usable(functions: InertiaFunctions, path: Path) -> None:
    """Refuse what no other program could evaluate."""
    where = f"{path}: model/fuzzy"
    if functions.visited.shape != (CELLS, CELLS):
        raise InputError(f"{where}/visited: is {functions.visited.shape}, not {(CELLS, CELLS)}; identify it again")
    for partition, peaks in zip(functions.structure.partitions, functions.partitions, strict=True):
        if not (np.all(np.diff(peaks) >= 0.0) and np.all((peaks >= 0.0) & (peaks <= 1.0))):
            raise InputError(f"{where}/partitions: those of {partition.name} make no partition; identify it again")


def _bare_sheet(path: Path, record: AnyModel, origin: Origin) -> Sheet:
    """Put a model on a sheet that has no name yet, without what no table of weights holds and without the wind."""
    model = commanded_anew(modelled(path, record))
    held = tuple(each for each in model.effects if each.name not in model.unsimulated)
    still = replace(model, effects=held, wind=(0.0, 0.0, 0.0))
    sheet = bare_sheet(record, still, origin)
    if isinstance(record, IdentifiedModel):
        return replace(sheet, warnings=tuple(_warnings(record, origin.config, path)))
    outside = tuple(_missing(record, model))
    floor = tuple(record.gap.floor.tolist()) if isinstance(record, Extended) else sheet.floor
    return replace(sheet, outside=outside, wind=model.wind, floor=floor)


def _missing(record: AnyModel, model: VehicleModel) -> Iterator[Missing]:
    """List effects that no table of weights holds, with their sizes along held-out flights where these are known."""
    known = {each.name: each for each in record.left_out} if isinstance(record, Extended) else {}
    for effect in (*model.filters, *model.along):
        title = _in_numbers(effect, model.full_voltage)
        if isinstance(record, Extended) and effect.name in known:
            own, floor = known[effect.name], record.gap.floor
            yield sized(title, own.wrench, floor, Off.of(own.ends), "along its held-out flights")
        else:
            supply = effect.effect.actuation and effect.effect.actuation.supply
            instead = _BY_VOLTAGE.format(supply(effect.values, 0.9)) if supply else None
            yield Missing(title, np.nan, np.nan, np.nan, None, instead=instead)


def _in_numbers(effect: ModelEffect, full_voltage: float) -> str:
    """Say what an effect is and which numbers it has, so that others can add it."""
    units = {each.name: "" if each.unit in ("", "1") else f" {each.unit}" for each in effect.known.numbers}
    numbers = ", ".join(f"{name} = {value:.4g}{units[name]}" for name, value in effect.values.items())
    if "voltage" in effect.known.needs and full_voltage != 1.0:
        numbers += f", V_0 = {full_voltage:.4g} V"
    title = REFITTED if effect.known.kind == "parameter" else effect.known.title
    return f"{title} ({effect.known.formula}; {numbers})"


def _evidence(record: IdentifiedModel) -> dict[str, Any]:
    """Say what an identified model was judged by, for JSON."""
    verdict, judged = record.verdict, record.judged
    counts = zip(judged.parts, judged.samples, judged.outside, strict=True)
    stated = None
    if verdict is not None:
        reasons = [{"reason": reason, "speaks": float(speaks)} for reason, speaks in verdict.reasons]
        stated = {"label": verdict.label, "region": verdict.region, "reasons": reasons}
    return {
        "stop_reason": record.stop_reason,
        "verdict": stated,
        "findings": record.findings,
        "judged": {
            "units": _SCORE_UNITS,
            "parts": {part: {"samples": int(samples), "outside": int(outside)} for part, samples, outside in counts},
            "models": {
                model: {
                    part: {measure: judged.of_axes(measure, model, part).tolist() for measure in judged.measures}
                    for part in judged.parts
                }
                for model in judged.models
            },
        },
    }


def _warnings(model: IdentifiedModel, config: str, path: object) -> Iterator[str]:
    """Say what speaks against flying with an identified model."""
    if not model.complete:
        yield "the model is incomplete, and marked as such: do not fly with it"
    if model.verdict is None:
        off = not stored_study(config, path).identification.validation.enabled
        why = "identification.validation.enabled was off when it was identified" if off else "it was not validated"
        yield (
            f"{path}: holds no verdict ({why}), so nothing says how far to trust it; run `cpfls identify` with "
            "identification.validation.enabled: true"
        )
    elif model.verdict.label == "do-not-use":
        against = [reason for reason, speaks in model.verdict.reasons if speaks < 0]
        yield ": ".join([f"{path}: its verdict is do-not-use, exported all the same", *against[:1]])
