"""Table 5 and the baselines: how good the models are, and what else would have done."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from cpfls_cli.pages.judged import AXES, MODEL, RIGID_BODY, TRAINING, Judged, judged
from cpfls_cli.pages.source import Source, Sources
from cpfls_cli.pages.swept import repeats_table_5
from cpfls_cli.pages.table_5 import PRINTED, RELATIVE_ERROR, SMALLEST_MAX_ERROR, PrintedColumn
from cpfls_cli.report.content import Block, Cell, Heading, Section, Table, Text
from cpfls_cli.report.numbers import UNKNOWN, count, number, percent, r_squared

# Units are not torn apart at the end of a line.
TORQUE, SQUARED = "N\N{NO-BREAK SPACE}m", "(N\N{NO-BREAK SPACE}m)²"
_ROWS = (
    "system",
    "training points",
    "population",
    "generations",
    "evaluations",
    f"MSE of the chosen model, {SQUARED}",
    f"largest error of the chosen model, {TORQUE}",
    "its condition number",
    "relative error",
)
_RELATIVE_BOUND = 0.1
_MEASURES: tuple[tuple[str, str, Callable[[float], str]], ...] = (
    ("mse", f"MSE, {SQUARED}", lambda value: number(value, 3)),
    ("max_error", f"Largest error, {TORQUE}", lambda value: number(value, 3)),
    ("relative_error", "Relative error", percent),
    ("r2", "R²", r_squared),
    ("r2_body", "R² of body torque", r_squared),
)


def identification_section(sources: Sources) -> Section | None:
    """Show the models beside each other, the paper's, and their baselines.

    Returns
    -------
    Section or None
        None where no model was given.

    References
    ----------
    Table 5 of the paper.
    """
    if not sources.models:
        return None
    blocks: list[Block] = [_table(sources)]
    if sources.settings.paper:
        blocks.append(Text(_scale_sentence(sources), "note"))
    for index, model in enumerate(sources.models, start=1):
        blocks += _baselines(model, index)
    return Section("identification", "Identification", blocks)


def _table(sources: Sources) -> Table:
    columns = [_column(model) for model in sources.models]
    header = ["Quantity", *(model.label for model in sources.models)]
    elsewhere = repeats_table_5(sources.sweeps)
    if sources.settings.paper and not elsewhere:
        columns += [_printed(column) for column in PRINTED]
        header += ["Paper"] * len(PRINTED)
    rows = [[name, *(column[place] for column in columns)] for place, name in enumerate(_ROWS)]
    caption = (
        "Results of the identification on the whole training part: mean squared error over the axes, largest error and "
        "condition number of the selected model, and its largest error over the largest torque (worst axis)."
    )
    numbered = caption if elsewhere else f"Table 5. {caption}"
    return Table("table-5-identification", numbered, header, rows, sentences=frozenset(range(1, len(header))))


def _column(model: Source) -> list[str]:
    artifact, settings, scores = model.artifact, model.config["identification"], judged(model)
    return [
        {"cpfls": "cpFLS", "fls": "FLS"}[settings["structure"]]
        + (" on rigid body" if artifact.text("model/base") == "rigid-body" else ""),
        str(len(artifact.array("training/indices"))),
        str(settings["population"]) if model.searched else "no search",
        str(settings["generations"]) if model.searched else "no search",
        count(artifact.array("history/evaluations")[-1]),
        number(float(np.mean(scores.of("mse", MODEL, TRAINING))), 3),
        number(float(np.max(scores.of("max_error", MODEL, TRAINING))), 3),
        number(artifact.number("solve/condition_number"), 5),
        percent(scores.worst(MODEL, TRAINING)[0]),
    ]


def _printed(column: PrintedColumn) -> list[str]:
    size = [str(value) for value in (column.samples, column.population, column.generations)]
    return [column.system, *size, UNKNOWN, column.mse, column.max_error, column.condition_number, RELATIVE_ERROR]


def _scale_sentence(sources: Sources) -> str:
    """Compare the size of the torques: the paper prints absolute errors, and its torques must have been larger."""
    ours = max(_largest_torque(judged(model)) for model in sources.models)
    theirs = SMALLEST_MAX_ERROR / _RELATIVE_BOUND
    return (
        f"Compare the relative errors, not MSE and largest error: the largest torque here is {number(ours, 2)} N m, "
        f"whereas an error of {SMALLEST_MAX_ERROR} N m that is below 10 % means more than {number(theirs, 2)} N m in "
        "the paper. Its condition numbers belong to its own training path, which it does not define in full."
    )


def _largest_torque(scores: Judged) -> float:
    with np.errstate(divide="ignore", invalid="ignore"):
        torque = scores.of("max_error", MODEL, TRAINING) / scores.of("relative_error", MODEL, TRAINING)
    return float(np.max(torque[np.isfinite(torque)], initial=0.0))


def _baselines(model: Source, index: int) -> Iterator[Block]:
    scores = judged(model)
    yield Heading(f"{model.label} and its baselines")
    yield Text(
        "By axis of the Euler angles; the last column is about the axes of the body. All are fitted to the same "
        "samples. Marked: the rigid body has the smaller mean squared error there."
    )
    header = ("Model", "Axis", *(title for _, title, _ in _MEASURES))
    for number_of, part in enumerate(scores.parts, start=1):
        samples = int(scores.samples[number_of - 1])
        rows = [row for name in scores.models for row in _rows(scores, part, name)]
        caption = f"{model.label} on {part}, {samples} samples."
        yield Table(f"baselines-{index}-{number_of}", caption, header, rows, frozenset({0, 1}))
    lost = [part for part in scores.parts if "rigid-body" in scores.winners(part)]
    if lost:
        yield Text(
            f"The rigid body beats {model.label} about at least one axis on: {', '.join(lost)}. Where it does, use the "
            "rigid body.",
            "warning",
        )


def _rows(scores: Judged, part: str, name: str) -> Iterator[list[str | Cell]]:
    for axis, word in enumerate(AXES):
        values = [Cell(shown(float(scores.of(key, name, part)[axis]))) for key, _, shown in _MEASURES]
        if name == RIGID_BODY and scores.winner(part, axis) == "rigid-body":
            values[0] = Cell(f"{values[0].text} ◂", "warning")
        yield [name if axis == 0 else "", word, *values]
