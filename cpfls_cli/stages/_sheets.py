"""Any model as the sheet that exports are written from."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from cpfls_cli.artifacts.diagnosis import Extended
from cpfls_cli.artifacts.gate import InputFile, Origin, read_origin
from cpfls_cli.artifacts.identified import IdentifiedModel
from cpfls_cli.artifacts.model import AnyModel
from cpfls_cli.config.load import stored_study
from cpfls_cli.dynamics import CELLS, InertiaFunctions
from cpfls_cli.errors import InputError
from cpfls_cli.export.holding import Missing, Off, sized
from cpfls_cli.export.sheet import REFITTED, Sheet
from cpfls_cli.flights.models import any_model, modelled
from cpfls_cli.pages.model import against, impossible_in_words, worth_in_words
from cpfls_cli.playback.model import ModelEffect, VehicleModel
from cpfls_cli.validation.trust import Trust

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
        tuple(worth_in_words(record)),
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
    model = modelled(path, record)
    beside = model.unsimulated
    held = tuple(each for each in model.effects if each.name not in beside)
    still = replace(model, effects=held, wind=(0.0, 0.0, 0.0))
    sheet = bare_sheet(record, still, origin)
    if isinstance(record, IdentifiedModel):
        return replace(sheet, warnings=tuple(_warnings(record, origin.config, path)))
    outside = tuple(_missing(record, (*model.filters, *model.along)))
    floor = tuple(record.gap.floor.tolist()) if isinstance(record, Extended) else sheet.floor
    return replace(sheet, outside=outside, wind=model.wind, floor=floor)


def _missing(record: AnyModel, effects: tuple[ModelEffect, ...]) -> Iterator[Missing]:
    """List effects that no table of weights holds, with their sizes along held-out flights where these are known."""
    known = {each.name: each for each in record.left_out} if isinstance(record, Extended) else {}
    for effect in effects:
        if isinstance(record, Extended) and effect.name in known:
            own, floor = known[effect.name], record.gap.floor
            yield sized(_in_numbers(effect), own.wrench, floor, Off.of(own.ends), "along its held-out flights")
        else:
            yield Missing(_in_numbers(effect), np.nan, np.nan, np.nan, None)


def _in_numbers(effect: ModelEffect) -> str:
    """Say what an effect is and which numbers it has, so that others can add it."""
    units = {each.name: "" if each.unit in ("", "1") else f" {each.unit}" for each in effect.known.numbers}
    numbers = ", ".join(f"{name} = {value:.4g}{units[name]}" for name, value in effect.values.items())
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
