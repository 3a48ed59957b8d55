"""Models of every structure with random coefficients, states that hurt, and sheets to export."""

from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
import yaml

from cpfls_cli.artifacts.gate import InputFile, Origin
from cpfls_cli.artifacts.identified import IdentifiedModel
from cpfls_cli.dynamics import CELLS, InertiaFunctions
from cpfls_cli.export.points import expected, reference_run
from cpfls_cli.export.sheet import Sheet
from cpfls_cli.fuzzy.basis import InputRange, breakpoints
from cpfls_cli.identification.identify import Judged
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.regressor.regressor import Motion
from cpfls_cli.regressor.structure import StructureSettings, model_structure
from cpfls_cli.stages.export import bare_sheet
from cpfls_cli.validation.verdict import Reason, Verdict
from cpfls_cli.vehicle.settings import VehicleSettings

MEASURES = ("mse", "max_error", "relative_error", "r2", "vaf", "r2_body")
PAPER = {"consequents": "seesaw", "products": "additive", "membership_functions": 5, "input_map": "data-range"}
RIGID = np.array([0.6, 0.5, 1.2, 0.02, -0.03, 0.01])
VEHICLE = VehicleSettings()


@dataclass(frozen=True)
class Case:
    """A structure, and how its model is drawn."""

    settings: dict
    rigid: bool = False
    fuzzy: bool = True
    zero_width: bool = False
    still: bool = False


CASES = {
    "paper": Case(PAPER),
    "default": Case({}),
    "rigid body alone": Case({}, rigid=True, fuzzy=False),
    "rigid body, rules": Case({"membership_functions": (2, 3, 4, 7, 1, 15)}, rigid=True),
    "classic, data-range": Case({**PAPER, "structure": "fls"}),
    "classic, full-circle, tensor": Case(
        {**PAPER, "structure": "fls", "input_map": "full-circle", "products": "tensor"}
    ),
    "classic, two functions": Case({**PAPER, "structure": "fls", "membership_functions": 2}, rigid=True),
    "seesaw, full-circle, tensor": Case({"consequents": "seesaw", "membership_functions": 4}),
    "seesaw, one function": Case({"consequents": "seesaw", "membership_functions": 1}),
    "harmonic, data-range": Case({"input_map": "data-range", "membership_functions": 7, "products": "additive"}),
    "harmonic, data-range, one rule": Case({"input_map": "data-range", "membership_functions": 2}),
    "harmonic, two functions": Case({"harmonic_order": 1, "membership_functions": 2, "products": "additive"}),
    "harmonic 8": Case({"harmonic_order": 8, "membership_functions": 3}),
    "zero width": Case({**PAPER, "membership_functions": (3, 4, 5, 6, 7, 8)}, zero_width=True),
    "zero width, circle": Case({"membership_functions": 9, "products": "additive"}, zero_width=True, rigid=True),
    "zero width, classic": Case({**PAPER, "structure": "fls", "input_map": "full-circle"}, zero_width=True),
    "a flight without motion": Case(PAPER, still=True),
    "nothing at all": Case(PAPER, fuzzy=False),
}


def model_of(case: Case, seed: int = 0) -> InertiaFunctions:
    rng = np.random.default_rng(seed)
    structure = model_structure(StructureSettings(**case.settings))
    partitions = []
    for part in structure.weight_slices():
        weights = rng.integers(1, 2**16, part.stop - part.start)
        if case.zero_width and len(weights) > 1:
            weights[rng.integers(0, len(weights), len(weights) // 2)] = 0
            weights[rng.integers(0, len(weights))] = 5
        partitions.append(breakpoints(weights.astype(float)))
    low, high = np.sort(rng.uniform(-0.9, 0.9, (2, 2)), axis=1)
    ranges = [InputRange(low[0], low[0] if case.still else low[1]), InputRange(high[0], high[1])]
    coefficients = rng.normal(0, 1, structure.parameters) * case.fuzzy
    visited = rng.random((CELLS, CELLS)) < 0.3
    return InertiaFunctions(structure, tuple(ranges), tuple(partitions), coefficients, RIGID * case.rigid, visited)


def states(model: InertiaFunctions, count: int, seed: int = 0) -> Motion:
    """Draw states over several turns; a quarter of the angles are seams, breakpoints, zeros, or next to them."""
    rng = np.random.default_rng(seed)
    attitude = rng.uniform(-20, 20, (count, 3))
    turns = 2 * np.pi * rng.integers(-3, 4, (count, 2))
    for axis in (0, 1):
        picked = rng.choice(_special(model, axis), count) + np.where(rng.random(count) < 0.5, turns[:, axis], 0.0)
        nudged = np.nextafter(picked, rng.choice([-np.inf, np.inf], count))
        own = np.where(rng.random(count) < 0.5, picked, nudged)
        attitude[:, axis] = np.where(rng.random(count) < 0.25, own, attitude[:, axis])
    return Motion(attitude, rng.normal(0, 3, (count, 3)), rng.normal(0, 10, (count, 3)))


def _special(model: InertiaFunctions, axis: int) -> np.ndarray:
    places = [0.0, -0.0, *(np.arange(-8, 9) * np.pi / 2)]
    data = model.ranges[axis]
    for partition, peaks in zip(model.structure.partitions, model.partitions, strict=True):
        if partition.input == axis:
            scaled = data.minimum + peaks * data.width
            places += [*(2 * np.pi * peaks), *(2 * np.pi * (peaks - 0.5))]
            places += [*scaled, *(0.5 * np.pi * scaled), *(np.pi - 0.5 * np.pi * scaled)]
    return np.array(places)


@contextmanager
def short_runs():
    """Write runs of three steps for an export to test itself by, where nobody runs that: half of the time of it."""
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setattr("cpfls_cli.export.points.reference_run", partial(reference_run, steps=3))
        yield


def sheet_of(model: InertiaFunctions, **changes) -> Sheet:
    """Put a model on a sheet with evidence in plain words, or with what a test wants."""
    given = {
        "name": "vehicle",
        "file": "model.h5",
        "stop_reason": "generations",
        "findings": ("two of five rules are not excited",),
        "verdict": verdict_of("good-inside-region", "up to 30 degrees", ("it predicts other flights", 1)),
        "source": "flight.h5",
        "config": {"seed": 1, "identification": {"structure": "cpfls"}},
        **changes,
    }
    inputs = {"flight": InputFile(given["source"], "0" * 64, "cpfls/flight")}
    vehicle = VehicleModel(vehicle=VEHICLE, fuzzy=model)
    others = dict.fromkeys(own.name for own in fields(IdentifiedModel))
    shown = {"findings": given["findings"], "stop_reason": given["stop_reason"], "verdict": given["verdict"]}
    made = IdentifiedModel(**others | shown | {"model": vehicle, "judged": _judged()})
    origin = Origin(stage="identify", seed=1, config=yaml.safe_dump(given["config"]), inputs=inputs, version="0.1.0")
    return replace(bare_sheet(made, vehicle, origin), name=given["name"], file=given["file"], sha256="a" * 64)


def verdict_of(label: str, region: str, *reasons: tuple[str, int]) -> Verdict:
    """Make a verdict with its reasons and what they speak for."""
    return Verdict(label, region, tuple(Reason(*each) for each in reasons))


def _judged() -> Judged:
    scores = {"relative_error": [0.1, np.nan, 0.2], "r2": [0.9, -np.inf, 0.5]}
    measures = {name: np.array([[scores.get(name, [1.0, 2.0, 3.0])]]) for name in MEASURES}
    samples, outside = np.array([100]), np.array([0])
    return Judged(models=("model",), parts=("training",), samples=samples, outside=outside, **measures)


def wanted_of(model: InertiaFunctions, motion: Motion, step: int = 1000) -> SimpleNamespace:
    """Ask the library, in parts that stay in the cache."""
    parts = [vars(expected(model, motion[slice(start, start + step)])) for start in range(0, len(motion), step)]
    names = ("inertia", "coriolis", "torque", "body", "inside", "scale")
    return SimpleNamespace(**{name: np.concatenate([part[name] for part in parts]) for name in names})


def errors(found, wanted) -> dict:
    """Largest errors over all states, each relative to the size of the terms of its sum."""
    pairs = (("D", wanted.inertia), ("C", wanted.coriolis), ("torque", wanted.torque), ("body", wanted.body))
    return {
        name: float(np.max(np.abs(found[name] - value).reshape(len(value), -1).max(axis=1) / wanted.scale[:, index]))
        for index, (name, value) in enumerate(pairs)
    }
