"""The evidence on models: verdict, scores by axis, other structures, physical sense, and prediction by horizon."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.identified import IdentifiedModel
from cpfls_cli.identification.cross_validation import RidgeCurve
from cpfls_cli.identification.scores import AXES, MODEL
from cpfls_cli.pages.identification import TORQUE
from cpfls_cli.pages.model import trust_box
from cpfls_cli.pages.source import Source
from cpfls_cli.report.canvas import BASELINE, HELD, legend_above, legend_over, plain_ticks, plot, style_of
from cpfls_cli.report.content import Block, Cell, Facts, Heading, Plot, Table, Text
from cpfls_cli.report.numbers import count, number, percent, plain, r_squared
from cpfls_cli.rounding import at_most
from cpfls_cli.validation.physical import PeriodErrors, Physics
from cpfls_cli.validation.replay import StepErrors
from cpfls_cli.validation.structures import StructureComparison

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_ROUNDING = 1e-9
_DECADE = 10.0
_SCORES = (f"RMSE, {TORQUE}", "NRMSE", "R²", "VAF", f"Largest, {TORQUE}", "Relative")
_PREDICTORS = {"rigid-body": "rigid body", "nothing-moves": "nothing moves"}
_STEP_ROWS = (("attitude", "attitude, °", 180.0 / np.pi), ("body_rate", "body rate, rad/s", 1.0))
_STEP_AXES = ("about x", "about y", "about z")
_STEP_STYLES: dict[str, dict[str, Any]] = {
    "model": {**style_of(0), "linewidth": 1.8},
    "rigid-body": {**BASELINE, "linewidth": 1.6},
    "nothing-moves": HELD,
}


def validation_blocks(model: Source[IdentifiedModel], index: int) -> Iterator[Block]:
    """Show the verdict on a model and what it rests on."""
    record = model.record
    yield Heading(model.label)
    yield trust_box(model)
    yield _scores(model, index)
    if record.period is not None:
        yield _period(record, record.period, index)
    if record.physics is not None:
        yield _physics(record.physics)
    if record.ridge is not None:
        yield Text(ridge_sentence(record.ridge))
        yield _ridge_figure(f"ridge-curve-{index}", model, record.ridge)
    if record.structures is not None:
        yield _structures(record.structures, index)


def _scores(model: Source[IdentifiedModel], index: int) -> Table:
    judged = model.record.judged
    rows: list[list[str | Cell]] = []
    for part in judged.parts:
        by_axis = {measure: judged.of_axes(measure, MODEL, part) for measure in ("mse", "r2", "vaf", "max_error")}
        relative, share = judged.of_axes("relative_error", MODEL, part), judged.nrmse(MODEL, part)
        for axis, name in enumerate(AXES):
            mse, r2, vaf, largest = (float(values[axis]) for values in by_axis.values())
            rows.append(
                [
                    f"{part}, {judged.samples_of(part)} samples" if axis == 0 else "",
                    name,
                    number(float(np.sqrt(mse)), 3),
                    percent(float(share[axis])),
                    Cell(r_squared(r2), "warning" if r2 < 0 else "plain"),
                    r_squared(vaf),
                    number(largest, 3),
                    percent(float(relative[axis])),
                ]
            )
    caption = (
        f"Torque error of {model.label} by part and Euler axis. NRMSE: over the standard deviation of the torque. VAF: "
        "R² without the mean of the error. Relative: largest error over largest torque."
    )
    return Table(f"scores-{index}", caption, ("Part", "Axis", *_SCORES), rows, frozenset({0, 1}))


def _period(record: IdentifiedModel, period: PeriodErrors, index: int) -> Table:
    rows: list[list[str]] = []
    for part, mse, largest in zip(period.parts, period.mse, period.max_error, strict=True):
        here, largest_here = (record.judged.of_axes(measure, MODEL, part) for measure in ("mse", "max_error"))
        columns = (np.sqrt(here), np.sqrt(mse), largest_here, largest)
        rows += [
            [part if axis == 0 else "", name, *(number(float(column[axis]), 3) for column in columns)]
            for axis, name in enumerate(AXES)
        ]
    caption = (
        "The same attitudes, written one full turn further in roll and in pitch: the vehicle is the same, so a "
        "periodic model must predict the same. Root mean square and largest error, N m."
    )
    header = ("Part", "Axis", "RMSE here", "RMSE one period away", "Largest here", "Largest one period away")
    return Table(f"period-{index}", caption, header, rows, frozenset({0, 1}))


def _physics(physics: Physics) -> Facts:
    roll, pitch = np.degrees(physics.worst_attitude)
    smallest = number(physics.smallest_eigenvalue, 3)
    definite = "in all" if physics.indefinite == 0 else f"not in {physics.indefinite}"
    where = f"roll {plain(round(roll))}°, pitch {plain(round(pitch))}°"
    rounding = " (rounding)" if physics.energy < _ROUNDING else ""
    return Facts(
        [
            ("D(q) positive definite", f"{definite} of {physics.cells} cells of roll and pitch that training visited"),
            ("Smallest eigenvalue of D(q)", f"{smallest} kg m², at {where}"),
            ("Energy that C(q, qd) produces", f"{number(physics.energy, 2)} of its own terms{rounding}"),
        ]
    )


def ridge_sentence(ridge: RidgeCurve) -> str:
    """Say whether the flight holds evidence for an inertia that depends on attitude beyond a rigid body's."""
    off, best = ridge.error[np.isinf(ridge.weight)], int(np.argmin(ridge.error))
    if not off.size:
        return "The curve has no point without the fuzzy part, so it cannot say whether that part helps."
    alone, least, deviation = float(off[0]), ridge.error[best], ridge.standard_error[best]
    gain = 1.0 - least / off[0] if off[0] > 0 else 0.0
    if np.isinf(ridge.weight[best]) or gain <= 0:
        return (
            "On blocks that were left out no fuzzy part does better than the rigid body alone: this flight holds no "
            "evidence for an inertia that depends on attitude in any other way than a rigid body's does."
        )
    reduction = (
        f"On blocks that were left out, the best fuzzy part reduces the error of the rigid body by {percent(gain)}"
    )
    if alone - least <= deviation:
        return (
            f"{reduction}, which is within one standard error: the flight holds hardly any evidence for a fuzzy part."
        )
    ratio = float((alone - least) / deviation) if deviation > 0 else np.inf
    return f"{reduction}, {number(ratio, 2)} standard errors: the flight holds evidence for a fuzzy part."


def _ridge_figure(name: str, model: Source[IdentifiedModel], ridge: RidgeCurve) -> Plot:
    """Draw the cross-validated error (method.md section 8) over the ridge weight; the last point has no fuzzy part."""
    weight, error, taken = ridge.weight, ridge.error, model.record.ridge_weight
    finite = np.where(np.isfinite(weight), weight, np.finfo(float).max)
    chosen = len(weight) - 1 if np.isinf(taken) else int(np.argmin(np.abs(finite - taken)))
    # The point without a fuzzy part stands a decade beyond the largest weight.
    position = np.where(np.isfinite(weight), weight, 10.0 * weight[np.isfinite(weight)].max(initial=1e-9))
    mark: dict[str, Any] = {"markersize": 10, "markerfacecolor": "none", "markeredgewidth": 2}

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        style = {"color": style_of(0)["color"], "markersize": 4, "capsize": 3, "linewidth": 1.2}
        axes.errorbar(position, error, ridge.standard_error, fmt="o-", label="error ± one standard error", **style)
        axes.plot([position[chosen]], [error[chosen]], "D", color=style_of(1)["color"], label="chosen", **mark)
        axes.set_xscale("log")
        if error.min() > 0 and error.max() > _DECADE * error.min():
            axes.set_yscale("log", nonpositive="clip")
        else:
            plain_ticks(axes.yaxis)
        last = len(weight) - 1
        shown = [*range(0, last - 1, max(last // 6, 1)), last]
        axes.set_xticks(position[shown], [_weight_words(weight[index], 1) for index in shown])
        axes.minorticks_off()
        axes.set_xlabel("ridge weight on the fuzzy part")
        axes.set_ylabel("cross-validated error, scaled torque²")
        legend_above(axes)

    caption = (
        f"Ridge curve of {model.label}: error on blocks of the training flight that were left out in turn. The last "
        "point is the rigid body alone (fuzzy part off). The largest weight within one standard error of the best is "
        "taken."
    )
    return plot(name, caption, "Cross-validated error over the ridge weight, the chosen weight marked", 3.0, draw)


def _weight_words(weight: float, digits: int) -> str:
    return "fuzzy part off" if np.isinf(weight) else number(weight, digits)


def _structures(structures: StructureComparison, index: int) -> Table:
    rows: list[list[str | Cell]] = []
    for candidate, name in enumerate(structures.name):
        error, deviation = float(structures.error[candidate]), float(structures.standard_error[candidate])
        best = at_most(error, float(np.min(structures.error)))
        shown = f"{number(error, 4)} ± {number(deviation, 2)}{' ◂ least' if best else ''}"
        rows.append(
            [
                f"{name} (this model)" if structures.own[candidate] else name,
                count(structures.parameters[candidate]),
                Cell(shown, "good" if best else "plain"),
                _weight_words(float(structures.ridge_weight[candidate]), 2),
            ]
        )
    caption = (
        "Structures compared by cross-validation over contiguous blocks, without a search: mean squared error of the "
        "scaled torque on the blocks that were left out, ± one standard error. Differences within that are chance."
    )
    header = ("Structure", "Parameters", "Held-out error", "Ridge weight")
    return Table(f"structures-{index}", caption, header, rows, frozenset({0}), frozenset({0}))


def steps_blocks(model: Source[IdentifiedModel], index: int) -> Iterator[Block]:
    """Show how well a model predicts motion, where that was tried."""
    steps = model.record.steps
    assert steps is not None, "only models that hold them are shown"
    yield Heading(model.label)
    yield _steps_figure(f"steps-{index}", model.label, steps)
    yield _steps_table(steps, index)


def _steps_figure(name: str, label: str, steps: StepErrors) -> Plot:
    """Draw errors over the horizon on logarithmic axes, beside the rigid body and beside nothing that moves."""

    def draw(figure: Figure) -> None:
        grid = figure.subplots(len(_STEP_ROWS), len(_STEP_AXES), sharex=True, sharey="row")
        for panels, (quantity, title, scale) in zip(grid, _STEP_ROWS, strict=True):
            _draw_steps(panels, steps, scale * getattr(steps, quantity))
            panels[0].set_ylabel(title)
        for axes, axis in zip(grid[0], _STEP_AXES, strict=True):
            axes.set_title(axis)
        grid[-1][1].set_xlabel("horizon, s")
        legend_over(figure, grid[0][0])

    caption = (
        f"Root mean square error after so many seconds, with the measured torques of {steps.part} replayed through "
        f"{label} from {steps.windows} starts. Nothing moves: the prediction that attitude and body rate stay what "
        "they were; a model above that line is worse than it. Both axes are logarithmic."
    )
    return plot(name, caption, "Error of predicted attitude and body rate over the horizon, by axis", 4.4, draw)


def _draw_steps(panels: list[Axes], steps: StepErrors, errors: Array) -> None:
    from matplotlib.ticker import FuncFormatter

    for index, predictor in enumerate(steps.model):
        style = _STEP_STYLES.get(predictor, style_of(index + 1))
        for axes, column in zip(panels, errors[index].T, strict=True):
            positive = np.where(column > 0, column, np.nan)
            axes.plot(steps.horizon, positive, label=_PREDICTORS.get(predictor, predictor), **style)
    for axes in panels:
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.minorticks_off()
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_formatter(FuncFormatter(lambda value, _: plain(value, smallest=1e-3)))


def _steps_table(steps: StepErrors, index: int) -> Table:
    last = len(steps.horizon) - 1
    sizes = [scale * np.sqrt(np.sum(getattr(steps, quantity) ** 2, axis=2)) for quantity, _, scale in _STEP_ROWS]
    rows: list[list[str | Cell]] = []
    for step in sorted({0, (last + 1) // 5, (last + 1) // 2, last}):
        for row, predictor in enumerate(steps.model):
            cells = [_error_cell(size[:, step], row) for size in sizes]
            first = [f"{number(float(steps.horizon[step]), 3)} s", count(steps.samples[step])] if row == 0 else ["", ""]
            rows.append([*first, _PREDICTORS.get(predictor, predictor), *cells])
    caption = (
        f"Root mean square error after so much time on {steps.part}, all axes together. Marked: the least. — where a "
        "predictor could not be simulated over every window."
    )
    header = ("Horizon", "Samples", "Predictor", "Attitude, °", "Body rate, rad/s")
    return Table(f"steps-table-{index}", caption, header, rows, frozenset({0, 2}))


def _error_cell(errors: Array, row: int) -> Cell:
    text = number(float(errors[row]), 3)
    is_least = np.isfinite(errors[row]) and at_most(errors[row], np.nanmin(errors))
    return Cell(f"{text} ◂", "good") if is_least else Cell(text)
