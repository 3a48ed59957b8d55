"""What templates of identified models know: their errors as tables, their numbers as rows."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from markupsafe import Markup

from cpfls_cli import page
from cpfls_cli.artifacts.identified import IdentifiedModel
from cpfls_cli.identification.data import TRAINING
from cpfls_cli.identification.findings import AXES
from cpfls_cli.identification.identify import MODEL, RIGID_BODY, Judged
from cpfls_cli.inertia import six_parameters
from cpfls_cli.pages.comparison import COMPARISON_WORDS
from cpfls_cli.pages.identified_figures import (
    ENTRIES,
    PREDICTORS,
    STEP_ROWS,
    entry_of,
    first_objective,
    has_partitions,
    residuals_of,
    weight_words,
)
from cpfls_cli.pages.model import WORDS as MODEL_WORDS
from cpfls_cli.report.content import ROUNDING, count, number, percent, printed, probability, r_squared, with_interval
from cpfls_cli.report.source import Source
from cpfls_cli.rounding import at_most
from cpfls_cli.validation.bands import band
from cpfls_cli.validation.replay import StepErrors
from cpfls_cli.validation.validate import Curves, RoundTrip
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.words import by_name

_MODELS = {
    MODEL: "model",
    RIGID_BODY: "rigid body",
    "constant-inertia": "constant inertia",
    "torque-zero": "no torque",
    "uniform-partitions": "no search: uniform partitions",
}
"""The judged models in words."""
_SCORES = (
    "Judged on",
    "Model",
    "MSE, (N m)²",
    "Largest error, N m",
    "Relative error",
    *(f"R² {axis}" for axis in AXES),
)
_ROWS = (
    "system",
    "training points",
    "population",
    "generations",
    "evaluations",
    "MSE of the chosen model, (N m)²",
    "largest error of the chosen model, N m",
    "its condition number",
    "relative error",
)
_SIGNIFICANT = 0.01
"""As in the reasons of the verdict."""
_SAME = 1e-9


def _table_5(models: Sequence[Source[IdentifiedModel]]) -> Markup:
    """Tabulate how models were found and how well they fit: Table 5 of the paper."""
    columns = map(_column, models)
    return page.table(["Quantity", *(model.label for model in models)], list(zip(_ROWS, *columns, strict=True)))


def _column(model: Source[IdentifiedModel]) -> list[str]:
    r, settings, judged = model.record, model.config["identification"], model.record.judged
    return [
        {"cpfls": "cpFLS", "fls": "FLS"}[settings["structure"]] + (" on rigid body" if r.on_rigid_body else ""),
        str(r.learned),
        str(settings["population"]) if r.searched else "no search",
        str(settings["generations"]) if r.searched else "no search",
        count(r.evaluations),
        number(float(np.mean(judged.of_axes("mse", MODEL, TRAINING))), 3),
        number(float(np.max(judged.of_axes("max_error", MODEL, TRAINING))), 3),
        number(r.condition_number, 5),
        percent(judged.worst(MODEL, TRAINING)[0]),
    ]


def _scores(judged: Judged, parts: Iterable[str], models: Iterable[str], columns: Sequence[int]) -> Markup:
    """Tabulate some columns of the errors of some models on some parts."""
    rows = [_row(judged, part, name) for part in parts for name in models if name in judged.models]
    return page.table([_SCORES[at] for at in columns], [[row[at] for at in columns] for row in rows], (0, 1))


def _row(judged: Judged, part: str, name: str) -> list[str]:
    return [
        part if name == MODEL else "",
        _MODELS.get(name, name),
        number(float(np.mean(judged.of_axes("mse", name, part))), 3),
        number(float(np.max(judged.of_axes("max_error", name, part))), 3),
        _with_axis(*judged.worst(name, part)),
        *(
            page.toned(r_squared(each), "warning" if each < 0 else "plain")
            for each in judged.of_axes("r2_body", name, part)
        ),
    ]


def _with_axis(relative: float, axis: str, but: str = "") -> str:
    """Write the largest relative error with the axis that it is about, unless that is known or it is rounding."""
    return f"{percent(relative)} ({axis})" if relative > ROUNDING and axis != but else percent(relative)


def _winners(judged: Judged, part: str) -> dict[str, list[str]]:
    """List the axes about which the model is better, the rigid body is, and they are equal."""
    found: dict[str, list[str]] = {"model": [], "rigid-body": [], "tie": []}
    for axis, winner in zip(AXES, judged.winners(part), strict=True):
        found[winner].append(axis)
    return {winner: axes for winner, axes in found.items() if axes}


def _whiteness(r: IdentifiedModel) -> Iterator[tuple[str, list[str]]]:
    """Say of the residuals about each axis whether they are white noise about 0; nothing of those that are rounding."""
    residuals = residuals_of(r)
    for axis, name in enumerate(AXES):
        known = residuals.autocorrelation[np.isfinite(residuals.autocorrelation[:, axis]), axis]
        if not known.size:
            yield name, []
            continue
        chance, biased = float(residuals.ljung_box[axis]), float(residuals.mean_p[axis])
        white, centred = chance >= _SIGNIFICANT, not biased < _SIGNIFICANT
        conclusion = ("white" if white else "not white") + ("" if centred else ", not 0 in the mean")
        yield (
            name,
            [
                number(float(known[0]), 3),
                percent(float(np.mean(np.abs(known) > residuals.band))),
                probability(chance),
                number(float(residuals.mean[axis]), 3),
                probability(biased) if np.isfinite(biased) else number(biased),
                page.toned(conclusion, "plain" if white and centred else "warning"),
            ],
        )


def _followed(r: IdentifiedModel) -> Iterator[tuple[str, list[str | None]]]:
    """Write the largest correlation of the residuals about each axis with each signal, and its lag."""
    residuals = residuals_of(r)
    for name, by_axis in zip(residuals.input, residuals.correlation.transpose(0, 2, 1), strict=True):
        yield name, [_strongest(values, residuals.input_lag, residuals.band) for values in by_axis]


def _strongest(values: np.ndarray[Any, Any], lag: np.ndarray[Any, Any], noise: float) -> str | None:
    if not np.isfinite(values).any():
        return None
    at = int(np.nanargmax(np.abs(values)))
    text = f"{values[at]:+.2f} at {lag[at]:.2g}".replace("-", "−")
    return page.toned(f"{text} ◂", "warning") if abs(values[at]) > 2 * noise else text


def _inertia_bands(r: IdentifiedModel, vehicle: VehicleSettings) -> Iterator[tuple[float, list[str], bool]]:
    """Give of each inertia parameter the stated value, those found, and whether it lies in the first interval."""
    draws = r.uncertainty
    assert draws is not None, "asked only of models that hold them"
    pairs = [(r.rigid_body, draws.best_rigid_body)]
    pairs += [(r.functions.rigid_body, draws.rigid_body)] if r.on_rigid_body else []
    columns = [(value, *band(value, drawn, draws.blocks)) for value, drawn in pairs]
    for at, stated in enumerate(six_parameters(vehicle.inertia_kg_m2).tolist()):
        found = [tuple(float(side[at]) for side in column) for column in columns]
        written = ([printed(each) for each in with_interval(*one)] for one in found)
        yield (
            stated,
            [f"{value} ({low} … {high})" for value, low, high in written],
            found[0][1] <= stated <= found[0][2],
        )


def _round_trip(round_trip: RoundTrip) -> list[str]:
    """Say of each entry of D(q) in what share of the visited points a second identification was within the band."""
    shares = ((entry, float(entry_of(round_trip.inside, entry))) for entry in ENTRIES)
    return [f"{entry} {percent(share)}" for entry, share in shares if np.isfinite(share)]


def _same_as_rigid(curves: Curves, curve: int) -> bool:
    """Tell whether a model is its rigid body along a curve, up to rounding."""
    values, rigid = curves.inertia[curve], curves.rigid_body[curve]
    near = _SAME * float(np.abs(rigid).max(initial=0.0))
    return np.allclose(values, rigid, rtol=0.0, atol=near, equal_nan=True)


def _steps(steps: StepErrors) -> Iterator[list[str]]:
    """Write the errors of the predictors after some times, all axes together; the least are marked."""
    last = len(steps.horizon) - 1
    sizes = [scale * np.sqrt(np.sum(getattr(steps, quantity) ** 2, axis=2)) for quantity, _, scale in STEP_ROWS]
    for step in sorted({0, (last + 1) // 5, (last + 1) // 2, last}):
        for row, predictor in enumerate(steps.model):
            first = [f"{number(float(steps.horizon[step]), 3)} s", count(steps.samples[step])] if row == 0 else ["", ""]
            yield [*first, PREDICTORS.get(predictor, predictor), *(_least(size[:, step], row) for size in sizes)]


def _least(errors: np.ndarray[Any, Any], row: int) -> str:
    text = number(float(errors[row]), 3)
    is_least = np.isfinite(errors[row]) and at_most(errors[row], np.nanmin(errors))
    return page.toned(f"{text} ◂", "good") if is_least else text


def _chromosome(r: IdentifiedModel) -> list[list[str]]:
    """Write of each partition its weights and the breakpoints that they encode."""
    structure = r.functions.structure
    parts = zip(structure.partitions, structure.weight_slices(), r.functions.partitions, strict=True)
    return [
        [own.name, " ".join(map(count, r.weights[genes])), " ".join(number(float(peak), 5) for peak in peaks)]
        for own, genes, peaks in parts
    ]


WORDS: Mapping[str, Any] = {
    **MODEL_WORDS,
    **COMPARISON_WORDS,
    **by_name(_chromosome, _followed, _inertia_bands, _same_as_rigid, _scores, _table_5, _whiteness, _winners),
    **by_name(_with_axis, at_most, count, first_objective, has_partitions, r_squared, weight_words),
    "AXES": AXES,
    "MODEL": MODEL,
    "MODELS": _MODELS,
    "RIGID_BODY": RIGID_BODY,
    "TRAINING": TRAINING,
    "round_trip_words": _round_trip,
    "steps_rows": _steps,
}
"""What templates of identified models know, of one and of several."""
