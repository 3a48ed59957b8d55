"""Stage `export`: an identified model as JSON, C or Python, for use without this program."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

import cpfls_cli
from cpfls_cli.artifacts.extended_file import is_extended
from cpfls_cli.artifacts.formats import MODEL
from cpfls_cli.artifacts.job import Job, take_inputs
from cpfls_cli.artifacts.model_file import read_model
from cpfls_cli.artifacts.output import check_output, write_text
from cpfls_cli.artifacts.store import Artifact
from cpfls_cli.commands.export_names import form_of, outputs_of, prefix_of
from cpfls_cli.config.load import parse_config
from cpfls_cli.errors import InputError
from cpfls_cli.export.c_form import c_source
from cpfls_cli.export.evidence import evidence_of
from cpfls_cli.export.json_form import json_text
from cpfls_cli.export.points import reference_points
from cpfls_cli.export.python_form import python_source
from cpfls_cli.export.sheet import Provenance, Sheet
from cpfls_cli.flights.sources import read_good
from cpfls_cli.identification.excitation import CELLS
from cpfls_cli.identification.model import Model
from cpfls_cli.report.outcome import Outcome

_SEED = 1


def run(job: Job, model: Path, form: str | None, name: str | None) -> Outcome:
    """Write a model in another form.

    Parameters
    ----------
    job : Job
        Its study is not used: a model holds its own.
    form : {"json", "c", "python"} or None
        None takes the suffix of the output.
    name : str or None
        Prefix of the names in C, name of the model in JSON; None takes the name of the output.
    """
    form = form or form_of(job.output)
    prefix = prefix_of(job.output, form, name)
    outputs = outputs_of(job.output, form)
    files = [take_inputs(replace(job, output=output), {"model": model})["model"] for output in outputs]
    # The file that was asked for first: a message about its folder is to name it.
    for output in reversed(outputs):
        check_output(output, job.force)
    sheet = _sheet(model, prefix, files[0].sha256)
    if not sheet.evidence.complete and not job.force:
        raise InputError(
            f"{model}: the search for this model did not come to its end ({sheet.evidence.stop_reason or 'unknown'}); "
            "`cpfls identify ... --resume` goes on, --force exports the model as it is, marked as incomplete"
        )
    texts = _texts(sheet, form, outputs)
    if not job.dry_run:
        for path, text in texts.items():
            write_text(path, text)
    return _outcome(sheet, form, texts, job.dry_run, tuple(_warnings(sheet, model)))


def _sheet(path: Path, name: str, sha256: str) -> Sheet:
    if is_extended(path):
        raise InputError(
            f"{path}: is a model with effects (made by `cpfls extend` or `cpfls gap`), which export cannot write; "
            "export the model that was given to that command with --model"
        )
    artifact = read_good(path, MODEL)
    model = _usable(read_model(artifact, path), path)
    return Sheet(name, model, artifact.text("model/base"), _provenance(artifact, path, sha256), evidence_of(artifact))


def _usable(model: Model, path: Path) -> Model:
    """Refuse what no other program could evaluate."""
    if model.visited.shape != (CELLS, CELLS):
        raise InputError(f"{path}: model/visited: is {model.visited.shape}, not {(CELLS, CELLS)}; identify it again")
    for partition, peaks in zip(model.structure.partitions, model.partitions, strict=True):
        if not (np.all(np.diff(peaks) >= 0.0) and np.all((peaks >= 0.0) & (peaks <= 1.0))):
            raise InputError(f"{path}: model/weights: those of {partition.name} make no partition; identify it again")
    return model


def _provenance(artifact: Artifact, path: Path, sha256: str) -> Provenance:
    config = parse_config(artifact.header.config, f"{path}: /config")
    return Provenance(path.name, sha256, artifact.header, config, cpfls_cli.__version__)


def _texts(sheet: Sheet, form: str, outputs: list[Path]) -> dict[Path, str]:
    points = reference_points(sheet.model, np.random.default_rng(_SEED))
    if form == "json":
        return {outputs[0]: json_text(sheet, points)}
    if form == "python":
        return {outputs[0]: python_source(sheet, points, outputs[0].name)}
    written = c_source(sheet, points, outputs[1].stem)
    return {outputs[0]: written.header, outputs[1]: written.source}


def _warnings(sheet: Sheet, model: Path) -> Iterator[str]:
    """Say what speaks against flying with this model."""
    verdict = sheet.evidence.verdict
    if not sheet.evidence.complete:
        yield "the model is incomplete, and marked as such: do not fly with it"
    if verdict is None:
        identification = sheet.provenance.config.get("identification") or {}
        off = not (identification.get("validation") or {}).get("enabled", True)
        why = "identification.validation.enabled was off when it was identified" if off else "it was not validated"
        yield f"{model}: holds no verdict: {why}; nothing says how far to trust it; `cpfls identify` it with it on"
    elif verdict.label == "do-not-use":
        against = [reason for reason, speaks in verdict.reasons if speaks < 0]
        yield ": ".join([f"{model}: its verdict is do-not-use, exported all the same", *against[:1]])


def _outcome(sheet: Sheet, form: str, texts: Mapping[Path, str], dry_run: bool, warnings: tuple[str, ...]) -> Outcome:
    evidence = sheet.evidence
    sizes = {str(path): len(text.encode()) for path, text in texts.items()}
    summary = {
        "dry_run": dry_run,
        "format": form,
        "name": sheet.name,
        "output": list(sizes),
        "bytes": sum(sizes.values()),
        "complete": evidence.complete,
        "verdict": evidence.verdict.label if evidence.verdict else None,
        "parameters": sheet.model.structure.parameters,
        "fuzzy": sheet.fuzzy,
        "rigid_body": sheet.rigid,
        "region_share": float(np.mean(sheet.model.visited)),
    }
    verb = "would be written" if dry_run else "written"
    lines = [f"{path}: {verb} ({size} bytes)" for path, size in sizes.items()]
    lines.append(f"training visited {summary['region_share']:.1%} of the circle of roll and pitch")
    lines.append(f"verdict: {evidence.verdict.label if evidence.verdict else 'none'}")
    return Outcome(summary, tuple(lines), warnings)
