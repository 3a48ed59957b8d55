"""What is said of a model wherever it is spoken of: what was found, how good it is, and how far to trust it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from cpfls_cli.artifacts.identified import IdentifiedRecord
from cpfls_cli.artifacts.scores import AXES, MODEL, RIGID_BODY, JudgedGroup
from cpfls_cli.inertia import INERTIA_PARAMETERS
from cpfls_cli.pages.source import Source
from cpfls_cli.report.content import Block, Box, Cell, Table, Text, Tone
from cpfls_cli.report.numbers import ROUNDING, number, percent, r_squared, sentence

TORQUE, SQUARED_TORQUE = "N\N{NO-BREAK SPACE}m", "(N\N{NO-BREAK SPACE}m)²"
"""Units that are not torn apart at the end of a line."""

MODELS = {
    MODEL: "model",
    RIGID_BODY: "rigid body",
    "constant-inertia": "constant inertia",
    "torque-zero": "no torque",
    "uniform-partitions": "no search: uniform partitions",
}
"""The judged models in words."""

SHORT_VERDICTS = {
    "good-for-control": "good for control",
    "good-inside-region": "good inside its region",
    "not-better-than-rigid-body": "no better than a rigid body",
    "do-not-use": "do not use",
}
"""Labels of a verdict for a cell of a table."""

_VERDICTS: dict[str, tuple[str, Tone]] = {
    "good-for-control": ("Good for control", "good"),
    "good-inside-region": ("Good inside the region that training visited, and only there", "note"),
    "not-better-than-rigid-body": ("Not better than the rigid body", "warning"),
    "do-not-use": ("Do not use it", "warning"),
}
_SPEAKS = {1: "For it", -1: "Against it"}
_SCORES = (
    "Judged on",
    "Model",
    f"MSE, {SQUARED_TORQUE}",
    f"Largest error, {TORQUE}",
    "Relative error",
    *(f"R² {axis}" for axis in AXES),
)


def answer(model: Source[IdentifiedRecord]) -> Iterator[Block]:
    """Say what was found, how good it is beside its baselines, how far to trust it and where, and what to distrust."""
    yield from solution(model)
    yield scores_table(model, 1)
    yield from verdict(model)
    yield from (Text(finding, "warning") for finding in model.record.findings)


def solution(model: Source[IdentifiedRecord]) -> Iterator[Text]:
    """Say how many parameters were found from how much, how the search ended, and the rigid body beside them."""
    record = model.record
    solve, evaluations = record.solve, record.history.evaluations
    yield Text(
        f"{solve.parameters} parameters from {len(record.training_indices)} samples; rank {solve.rank}, condition "
        f"number {number(solve.condition_number, 5)}; {evaluations[-1]} evaluations"
    )
    if record.stop_reason == "converged":
        stall = model.config["identification"]["stall_generations"]
        yield Text(
            f"converged after generation {len(evaluations) - 1}: no objective improved enough "
            f"(identification.stall_generations = {stall})"
        )
    held_out = record.front.held_out
    if held_out is not None:
        yield Text(
            f"chosen among {len(held_out)} on the flights kept for it, mean squared error "
            f"{number(float(np.min(held_out)), 3)}"
        )
    pairs = zip(INERTIA_PARAMETERS, record.baselines.rigid_body, strict=True)
    moments = " ".join(f"{name} {number(float(value))}" for name, value in pairs)
    yield Text(f"rigid body that fits best, kg m²: {moments}")


def scores_table(model: Source[IdentifiedRecord], index: int) -> Table:
    """Show the errors of a model and its baselines on every part of the data.

    Parameters
    ----------
    index : int
        Number of the model on the page, from 1.
    """
    caption = (
        f"{model.label} beside the rigid body with six inertia parameters, a constant inertia and no torque at all, "
        "and where there is something to search for, the same structure without a search. MSE: mean over the axes. "
        "Relative error: largest error over largest torque, worst axis. R²: share of the variance of the body torque "
        "explained."
    )
    judged = model.record.judged
    rows = [_row(judged, part, name) for part in judged.parts for name in judged.models]
    return Table(f"headline-{index}", caption, _SCORES, rows, frozenset({0, 1}))


def _row(judged: JudgedGroup, part: str, name: str) -> list[str | Cell]:
    relative, axis = judged.worst(name, part)
    return [
        part if name == MODEL else "",
        MODELS.get(name, name),
        number(float(np.mean(judged.of_axes("mse", name, part))), 3),
        number(float(np.max(judged.of_axes("max_error", name, part))), 3),
        f"{percent(relative)} ({axis})" if relative > ROUNDING else percent(relative),
        *(
            Cell(r_squared(value), "warning" if value < 0 else "plain")
            for value in judged.of_axes("r2_body", name, part)
        ),
    ]


def verdict(model: Source[IdentifiedRecord]) -> Iterator[Block]:
    """Say how far to trust a model, where, and why; or how to find out."""
    record = model.record
    if record.verdict is not None and record.verdict.label is not None:
        words, tone = _verdict_words(record.verdict.label)
        region = [sentence(f"Region: {record.verdict.region}")] if record.verdict.region else []
        reasons = [f"{_SPEAKS.get(speaks, 'To know')}: {sentence(reason)}" for reason, speaks in record.verdict.reasons]
        yield Box("VERDICT", words, [*region, *reasons], tone)
    elif not record.validated:
        yield Text(
            f"{model.label} holds its scores only: no bands, no residuals, no verdict. To add them, identify it again "
            "with identification.validation.enabled: true: cpfls identify CONFIG FLIGHT... -o MODEL --set "
            "identification.validation.enabled=true.",
            "note",
        )


def verdict_line(model: Source[IdentifiedRecord]) -> Text:
    """Say in one line how far to trust a model, and whether its search came to its end."""
    record = model.record
    incomplete = (
        ""
        if record.complete
        else f" The search is incomplete ({record.stop_reason or 'stopped'}): this is the best so far, and --resume "
        "goes on."
    )
    if record.verdict is None or record.verdict.label is None:
        reason = "no verdict, because the evidence was not gathered (identification.validation.enabled)"
        return Text(f"{model.label}: {reason}.{incomplete}", "warning" if incomplete else "note")
    words, tone = _verdict_words(record.verdict.label)
    where = f" Region: {record.verdict.region.rstrip('.')}." if record.verdict.region else ""
    return Text(f"{model.label}: {words}.{where}{incomplete}", "warning" if incomplete else tone)


def _verdict_words(label: str) -> tuple[str, Tone]:
    return _VERDICTS.get(label, (label, "note"))


def trust_notes(model: IdentifiedRecord, path: object) -> Iterator[Text]:
    """Say what speaks against the use of a model: its search was stopped, it was judged unfit, or not judged at all.

    Parameters
    ----------
    path : Path
        As the model is called in the sentences.
    """
    if not model.complete:
        yield Text(f"{path}: is incomplete: its search was stopped; `cpfls identify --resume` goes on", "warning")
    if model.verdict is None or model.verdict.label is None:
        yield Text(
            f"{path}: has no verdict and no bands; `cpfls identify` with identification.validation.enabled adds them",
            "warning",
        )
    elif model.verdict.label == "do-not-use":
        yield Text(f"{path}: its verdict is: do not use; {model.verdict.reasons[0][0]}", "warning")
