"""How a model was identified: its errors beside its baselines, what it is worth, the search and its Pareto front."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from cpfls_cli import page
from cpfls_cli.artifacts.identified import IdentifiedModel
from cpfls_cli.identification.scores import AXES, MODEL, RIGID_BODY, TRAINING, Judged
from cpfls_cli.inertia import INERTIA_PARAMETERS
from cpfls_cli.pages.source import Source, Sources
from cpfls_cli.pages.trust import model_words, stopped_words, trust_words
from cpfls_cli.report.canvas import legend_above, plain_ticks, plot, stacked, style_of
from cpfls_cli.report.content import Block, Cell, Heading, Plot, Section, Table, Text
from cpfls_cli.report.numbers import ROUNDING, count, number, percent, r_squared, sentence
from cpfls_cli.validation.trust import Trust

if TYPE_CHECKING:
    from matplotlib.figure import Figure

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

_SPEAKS = {1: "For it", -1: "Against it"}
_SIGNS = {1: "for", -1: "against"}
_SCORES = (
    "Judged on",
    "Model",
    f"MSE, {SQUARED_TORQUE}",
    f"Largest error, {TORQUE}",
    "Relative error",
    *(f"R² {axis}" for axis in AXES),
)
_ROWS = (
    "system",
    "training points",
    "population",
    "generations",
    "evaluations",
    f"MSE of the chosen model, {SQUARED_TORQUE}",
    f"largest error of the chosen model, {TORQUE}",
    "its condition number",
    "relative error",
)
_MEASURES: tuple[tuple[str, str, Callable[[float], str]], ...] = (
    ("mse", f"MSE, {SQUARED_TORQUE}", lambda value: number(value, 3)),
    ("max_error", f"Largest error, {TORQUE}", lambda value: number(value, 3)),
    ("relative_error", "Relative error", percent),
    ("r2", "R²", r_squared),
    ("r2_body", "R² of body torque", r_squared),
)


def title(record: IdentifiedModel) -> str:
    """Say what an identified model is."""
    return f"an identified model {'on a rigid body' if record.on_rigid_body else 'without a rigid body'}."


def grounds(record: IdentifiedModel) -> Iterator[str]:
    """Say how far to trust an identified model, where, and why; or how to find out."""
    if not record.validated:
        yield (
            "It holds only its scores: no bands, no residuals, no verdict. To add them, identify it again with "
            "identification.validation.enabled: true: cpfls identify CONFIG FLIGHT... -o MODEL --set "
            "identification.validation.enabled=true."
        )
        return
    yield sentence(trust_words(record.trust).sentence)
    if record.verdict is not None:
        yield from [sentence(f"Region: {record.verdict.region}")] if record.verdict.region else []
        for reason, speaks in record.verdict.reasons:
            yield f"{_SPEAKS.get(speaks, 'To know')}: {sentence(reason)}"


def worth(record: IdentifiedModel) -> Iterator[str]:
    """Say what an identified model is worth that is used elsewhere."""
    verdict, judged = record.verdict, record.judged
    if verdict is None:
        yield "Verdict: none; the model holds no validation."
    else:
        yield f"Verdict: {verdict.label}. {verdict.region or ''}".rstrip()
        for reason, speaks in verdict.reasons:
            yield f"- {_SIGNS.get(speaks, 'note')}: {reason}"
    for part in judged.parts if MODEL in judged.models else ():
        worst, r2 = judged.worst(MODEL, part)[0], judged.worst_r2(MODEL, part)
        error = f"largest error {worst:.3g} of the largest torque"
        yield f"Judged on {part} ({judged.samples_of(part)} samples), worst axis: {error}, R2 {r2:.4f}"
    for finding in record.findings:
        yield f"Finding: {finding}"
    yield "Rotors, mass and all forces are those of the config."


def cautions(record: IdentifiedModel) -> Iterator[str]:
    """Say what speaks against an identified model, wherever it is taken."""
    words = trust_words(record.trust)
    if record.verdict is not None and words.tone == "warning":
        yield ": ".join([f"its verdict is: {words.short}", *(reason for reason, _ in record.verdict.reasons[:1])])


def unjudged(record: IdentifiedModel, path: object) -> Iterator[Text]:
    """Say of an identified model that nothing says how far to trust it."""
    if record.trust == Trust.NOT_JUDGED:
        yield Text(
            f"{path}: has no verdict and no bands; `cpfls identify` with identification.validation.enabled adds them",
            "warning",
        )


def solution(model: Source[IdentifiedModel]) -> Iterator[Text]:
    """Say how many parameters were found from how much, how the search ended, and the rigid body beside them."""
    record = model.record
    evaluations = record.history.evaluations
    yield Text(
        f"{record.parameters} parameters from {len(record.training_indices)} samples; rank {record.rank}, condition "
        f"number {number(record.condition_number, 5)}; {evaluations[-1]} evaluations"
    )
    if record.stop_reason == "converged":
        stall = model.config["identification"]["stall_generations"]
        yield Text(
            f"converged after generation {len(evaluations) - 1}: no objective improved enough "
            f"(identification.stall_generations = {stall})"
        )
    held_out = record.pareto_front.held_out
    if held_out is not None:
        yield Text(
            f"chosen among {len(held_out)} on the flights kept for it, mean squared error "
            f"{number(float(np.min(held_out)), 3)}"
        )
    pairs = zip(INERTIA_PARAMETERS, record.rigid_body, strict=True)
    moments = " ".join(f"{name} {number(float(value))}" for name, value in pairs)
    yield Text(f"rigid body that fits best, kg m²: {moments}")


def scores_table(model: Source[IdentifiedModel], index: int) -> Table:
    """Show the errors of a model and its baselines on every part of the data."""
    caption = (
        f"{model.label} beside the rigid body with six inertia parameters, a constant inertia and no torque at all, "
        "and where there is something to search for, the same structure without a search."
    )
    legend = (
        "MSE: mean over the axes. Relative error: largest error over largest torque, worst axis. R²: share of the "
        "variance of the body torque explained."
    )
    judged = model.record.judged
    rows = [_row(judged, part, name) for part in judged.parts for name in judged.models]
    return Table(f"headline-{index}", caption, _SCORES, rows, frozenset({0, 1}), legend=legend)


def _row(judged: Judged, part: str, name: str) -> list[str | Cell]:
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


def verdict_line(model: Source[IdentifiedModel]) -> Text:
    """Say in one line how far to trust a model, and whether its search came to its end."""
    record = model.record
    incomplete = (
        ""
        if record.complete
        else f" The search is incomplete ({record.stop_reason or 'stopped'}): this is the best so far, and --resume "
        "goes on."
    )
    if record.verdict is None:
        reason = "no verdict, because the evidence was not gathered (identification.validation.enabled)"
        return Text(f"{model.label}: {reason}.{incomplete}", "warning" if incomplete else "note")
    words = trust_words(record.trust)
    where = f" Region: {record.verdict.region.rstrip('.')}." if record.verdict.region else ""
    return Text(f"{model.label}: {words.sentence}.{where}{incomplete}", "warning" if incomplete else words.tone)


def identification_section(sources: Sources) -> Section | None:
    """Show the models beside each other, and their baselines; None where no model was given.

    References
    ----------
    Table 5 of the paper.
    """
    if not sources.models:
        return None
    blocks: list[Block] = [_table(sources)]
    for index, model in enumerate(sources.models, start=1):
        blocks += _baselines(model, index)
    return Section("identification", "Identification", blocks)


def _table(sources: Sources) -> Table:
    columns = [_column(model) for model in sources.models]
    header = ["Quantity", *(model.label for model in sources.models)]
    rows = [[name, *(column[index] for column in columns)] for index, name in enumerate(_ROWS)]
    caption = (
        "Table 5. Results of the identification on the whole training part: mean squared error over the axes, largest "
        "error and condition number of the selected model, and its largest error over the largest torque (worst axis)."
    )
    return Table("table-5-identification", caption, header, rows, sentences=frozenset(range(1, len(header))))


def _column(model: Source[IdentifiedModel]) -> list[str]:
    record, settings, judged = model.record, model.config["identification"], model.record.judged
    return [
        {"cpfls": "cpFLS", "fls": "FLS"}[settings["structure"]] + (" on rigid body" if record.on_rigid_body else ""),
        str(len(record.training_indices)),
        str(settings["population"]) if record.searched else "no search",
        str(settings["generations"]) if record.searched else "no search",
        count(record.history.evaluations[-1]),
        number(float(np.mean(judged.of_axes("mse", MODEL, TRAINING))), 3),
        number(float(np.max(judged.of_axes("max_error", MODEL, TRAINING))), 3),
        number(record.condition_number, 5),
        percent(judged.worst(MODEL, TRAINING)[0]),
    ]


def _baselines(model: Source[IdentifiedModel], index: int) -> Iterator[Block]:
    judged = model.record.judged
    yield Heading(f"{model.label} and its baselines")
    yield Text(
        "By axis of the Euler angles; the last column is about the axes of the body. All are fitted to the same "
        "samples. Marked: the rigid body has the smaller mean squared error there."
    )
    header = ("Model", "Axis", *(title for _, title, _ in _MEASURES))
    for part_number, part in enumerate(judged.parts, start=1):
        rows = [row for name in judged.models for row in _rows(judged, part, name)]
        caption = f"{model.label} on {part}, {judged.samples_of(part)} samples."
        yield Table(f"baselines-{index}-{part_number}", caption, header, rows, frozenset({0, 1}))
    lost = [part for part in judged.parts if "rigid-body" in judged.winners(part)]
    if lost:
        yield Text(
            f"The rigid body beats {model.label} about at least one axis on: {', '.join(lost)}. Where it does, use the "
            "rigid body.",
            "warning",
        )


def _rows(judged: Judged, part: str, name: str) -> Iterator[list[str | Cell]]:
    for axis, axis_name in enumerate(AXES):
        values = [Cell(shown(float(judged.of_axes(measure, name, part)[axis]))) for measure, _, shown in _MEASURES]
        if name == RIGID_BODY and judged.winner(part, axis) == "rigid-body":
            values[0] = Cell(f"{values[0].text} ◂", "warning")
        yield [MODELS.get(name, name) if axis == 0 else "", axis_name, *values]


def search_blocks(model: Source[IdentifiedModel], index: int) -> Iterator[Block]:
    """Show how a model was found."""
    if not model.record.searched:
        yield Text(
            f"No search: one chromosome. {model.label} has one rule per input, so there is no partition to search for.",
            "note",
        )
        return
    if model.record.fuzzy_part_off:
        yield Text(
            f"The fuzzy part of {model.label} is off, so all chromosomes may give one and the same model, and the "
            "search decides nothing.",
            "note",
        )
    yield convergence_figure(f"convergence-{index}", model)
    yield front_figure(f"pareto-front-{index}", model)


def convergence_figure(name: str, model: Source[IdentifiedModel]) -> Plot:
    """Draw the best of each objective found so far, by generation."""
    history = model.record.history
    generation = np.arange(len(history.best))
    error, unit = _first_objective(model.record)
    titles = (f"smallest {error}", "smallest largest error", "smallest condition number")
    units = (unit, "N m", "pure number")

    def draw(figure: Figure) -> None:
        from matplotlib.ticker import MaxNLocator

        panels = stacked(figure, len(titles))
        for axes, title, unit, best in zip(panels, titles, units, history.best.T, strict=True):
            axes.plot(generation, np.where(np.isfinite(best), best, np.nan), marker="o", markersize=3, **style_of(0))
            axes.set_title(title)
            axes.set_ylabel(unit)
            plain_ticks(axes.yaxis)
        panels[-1].set_xlabel("generation")
        panels[-1].xaxis.set_major_locator(MaxNLocator(integer=True))

    caption = (
        f"Search of {model.label}: the best value of each objective found so far, each possibly by another chromosome; "
        f"{history.evaluations[-1]} chromosomes were evaluated."
    )
    return plot(name, caption, f"Best {error}, largest error and condition number by generation", 4.6, draw)


def front_figure(name: str, model: Source[IdentifiedModel]) -> Plot:
    """Draw the members of the Pareto front and mark the chosen one."""
    objectives, chosen = model.record.pareto_front.objectives, model.record.pareto_front.chosen
    error, unit = _first_objective(model.record)
    others = np.arange(len(objectives)) != chosen
    mark: dict[str, Any] = {"markersize": 9, "markerfacecolor": "none", "markeredgewidth": 2}

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        shown = objectives[others]
        axes.plot(shown[:, 2], shown[:, 0], "o", color=style_of(0)["color"], markersize=5, label="not dominated")
        axes.plot(*objectives[chosen, [2, 0]], "D", color=style_of(1)["color"], label="chosen", **mark)
        axes.set_xlabel("condition number")
        axes.set_ylabel(f"{error}, {unit}")
        plain_ticks(axes.yaxis)
        axes.set_xscale("log")
        legend_above(axes)

    members = f"{len(objectives)} member{'s' if len(objectives) > 1 else ''}"
    rule = model.config["identification"]["choice"]
    caption = (
        f"Pareto front of {model.label}, {members}: {error} against condition number, as the search saw "
        f"them. The third objective, the largest error, is not shown, so a member may look dominated "
        f"here. The chosen one follows the rule {rule}."
    )
    return plot(name, caption, f"Scatter of {error} against condition number, the chosen member marked", 3.0, draw)


def _first_objective(record: IdentifiedModel) -> tuple[str, str]:
    """Name the error that the search minimised, and its unit.

    Over a rigid body it is the error on blocks left out in turn, every axis divided by its own scale.
    """
    if record.on_rigid_body:
        return "cross-validated error", "scaled torque²"
    return "mean squared error", "(N m)²"


def _scores(judged: Judged, parts: Iterable[str], models: Iterable[str], columns: Sequence[int]) -> str:
    """Tabulate some columns of the errors of some models on some parts, for a template."""
    rows = [_row(judged, part, name) for part in parts for name in models if name in judged.models]
    cells = [[row[at] for at in columns] for row in rows]
    shown = [[page.toned(each.text, each.tone) if isinstance(each, Cell) else each for each in row] for row in cells]
    return page.table([_SCORES[at] for at in columns], shown, (0, 1))


WORDS: Mapping[str, Any] = {
    "MODEL": MODEL,
    "RIGID_BODY": RIGID_BODY,
    "grounds": grounds,
    "scores": _scores,
    "stopped_words": stopped_words,
    "title": title,
    "words_of": model_words,
}
"""What the template of an identified model knows."""
