"""Commands that print and write nothing: `info` and `check` of an artifact, `config`, the catalogue of `effects`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cpfls_cli.artifacts.store import Outline, findings_of, read_outline
from cpfls_cli.config.keys import commented_default
from cpfls_cli.config.load import load_study, validate
from cpfls_cli.config.study import resolved, resolved_yaml
from cpfls_cli.effects.effect import Coefficient, Effect, Shape
from cpfls_cli.effects.registry import CATALOGUE, effect
from cpfls_cli.errors import ConfigError
from cpfls_cli.report.content import Block, Facts, Listing, Table, Text
from cpfls_cli.report.outcome import Outcome
from cpfls_cli.vehicle.settings import VehicleSettings


def info(path: Path) -> Outcome:
    """Describe an artifact: where it comes from and what it holds."""
    artifact = read_outline(path)
    header = artifact.header
    datasets = {name: _describe_dataset(artifact, name) for name in artifact.shapes}
    summary = {
        "file": str(path),
        "format": artifact.spec.format,
        "cpfls_version": header.version,
        "seed": header.seed,
        "inputs": {role: vars(source) for role, source in header.inputs.items()},
        "datasets": datasets,
    }
    return Outcome(summary, description(artifact))


def description(artifact: Outline) -> tuple[Block, ...]:
    """Tell where an artifact comes from and what it holds, dataset by dataset."""
    header = artifact.header
    origin = [("made by", f"cpfls {header.version}, seed {header.seed}")]
    origin += [(role, f"{source.name} (sha256 {source.sha256[:12]})") for role, source in header.inputs.items()]
    rows = [_dataset_row(name, _describe_dataset(artifact, name)) for name in artifact.shapes]
    columns = ("Dataset", "Shape", "Unit", "What it holds")
    table = Table("datasets", "", columns, rows, frozenset(range(len(columns))), frozenset({3}))
    return Text(f"{artifact.spec.format}: {artifact.spec.description}"), Facts(origin), table


def _describe_dataset(artifact: Outline, name: str) -> dict[str, Any]:
    spec = artifact.spec.dataset(name)
    assert spec is not None, "the format names it"
    entry = {
        "shape": list(artifact.shapes[name]),
        "units": spec.units,
        "description": spec.description,
        "frame": spec.frame,
    }
    return entry | ({"value": np.asarray(artifact.values[name]).tolist()} if name in artifact.values else {})


def _dataset_row(name: str, entry: dict[str, Any]) -> list[str]:
    shape = "x".join(str(length) for length in entry["shape"]) or "scalar"
    value = entry.get("value", [])
    shown = ", ".join(filter(None, value)) if isinstance(value, list) else str(value)
    return [name, shape, entry["units"], f"{entry['description']}{': ' if shown else ''}{shown}"]


def check(path: Path) -> Outcome:
    """Check an artifact against its format; the exit code is 1 where it does not keep to it."""
    spec, findings = findings_of(path)
    summary = {"file": str(path), "format": spec.format, "good": not findings, "findings": findings}
    sentences = [f"{path}: {finding}" for finding in findings] or [f"{path}: good ({spec.format})"]
    return Outcome(summary, tuple(map(Text, sentences)), exit_code=int(bool(findings)))


def config(path: Path | None, sections: Sequence[str], overrides: Sequence[str], seed: int | None) -> Outcome:
    """Show a resolved config, or a commented default.

    Parameters
    ----------
    path : Path or None
        None shows the commented default.
    sections : sequence of str
        Only these, and the seed.

    Raises
    ------
    ConfigError
        If the default is asked for together with overrides, sections or a seed.
    """
    if path is None:
        if sections or overrides or seed is not None:
            raise ConfigError("--section, --set and --seed need a CONFIG; without one the commented default is printed")
        return Outcome(resolved(validate({}, "default")), (Listing("Default config", commented_default()),))
    study = load_study(path, overrides, seed, sweep=True)
    return Outcome(resolved(study, sections), (Listing("Resolved config", resolved_yaml(study, sections)),))


def effects(name: str | None) -> Outcome:
    """List the effects, or describe one in full; ranges are those of the default vehicle.

    Parameters
    ----------
    name : str or None
        Identifier; None lists all.

    Raises
    ------
    InputError
        If there is no such effect.
    """
    if name is None:
        entries = [_describe_effect(entry) for entry in CATALOGUE.values()]
        rows = [[entry.name, entry.kind, entry.title] for entry in CATALOGUE.values()]
        table = Table("effects", "", ("Effect", "Kind", "What it is"), rows, frozenset({0, 1, 2}))
        hint = Text("`cpfls effects NAME` tells everything on one.")
        return Outcome({"vehicle": _vehicle_name(), "effects": entries}, (table, hint))
    chosen = effect(name)
    return Outcome({"vehicle": _vehicle_name(), **_describe_effect(chosen)}, tuple(_effect_blocks(chosen)))


def _vehicle_name() -> str:
    vehicle = VehicleSettings()
    return f"default, {vehicle.mass_kg:g} kg with {len(vehicle.rotors)} rotors"


def _describe_effect(entry: Effect) -> dict[str, Any]:
    return {
        "name": entry.name,
        "title": entry.title,
        "kind": entry.kind,
        "formula": entry.formula,
        "sentence": entry.sentence,
        "coefficients": [_describe_coefficient(coefficient) for coefficient in _whole(entry).coefficients],
        "shapes": [vars(shape) for shape in _whole(entry).shapes],
        "needs": sorted(entry.needs),
        "seen_in": "sensors alone" if entry.columns is None else "torque and force",
        "excitation": entry.excitation,
        "rivals": dict(entry.rivals),
        "source": entry.source,
    }


def _whole(entry: Effect) -> Effect:
    """Give an effect with all numbers that the last fit of a diagnosis finds."""
    return entry.exact or entry


def _describe_coefficient(coefficient: Coefficient) -> dict[str, Any]:
    low, high = coefficient.bounds(VehicleSettings())
    described = {"name": coefficient.name, "unit": coefficient.unit, "meaning": coefficient.meaning}
    return {**described, "low": low, "high": high}


def _effect_blocks(entry: Effect) -> Iterator[Block]:
    yield Text(f"{entry.name}: {entry.title} ({entry.kind})")
    facts = [("", entry.sentence), ("formula", entry.formula)]
    facts.append(("needs", ", ".join(sorted(entry.needs)) or "rates and torque alone"))
    facts += [("coefficient", _coefficient_text(coefficient)) for coefficient in _whole(entry).coefficients]
    facts += [("shape", _shape_text(shape)) for shape in _whole(entry).shapes]
    if entry.coefficients:
        facts.append(("", f"Ranges are for the vehicle: {_vehicle_name()}."))
    facts.append(("excitation", entry.excitation))
    facts += [("looks like", f"{rival}; to tell: {flight}") for rival, flight in entry.rivals.items()]
    yield Facts([*facts, ("source", entry.source)])


def _coefficient_text(coefficient: Coefficient) -> str:
    low, high = coefficient.bounds(VehicleSettings())
    return f"{coefficient.name} from {low:.3g} to {high:.3g}{_unit(coefficient.unit)}: {coefficient.meaning}"


def _shape_text(shape: Shape) -> str:
    return f"{shape.name} from {shape.grid[0]:g} to {shape.grid[-1]:g}{_unit(shape.unit)}: {shape.meaning}"


def _unit(unit: str) -> str:
    return "" if unit == "1" else f" {unit}"
