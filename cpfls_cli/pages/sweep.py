"""The page of a sweep: the errors of each setting, and how far its seeds lie apart."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.sweep import SettingRuns, SweepRecord, spread
from cpfls_cli.pages.identification import SQUARED_TORQUE, TORQUE
from cpfls_cli.pages.source import Source
from cpfls_cli.report.canvas import plain_ticks, plot, style_of
from cpfls_cli.report.content import Block, Folded, Plot, Table, Text
from cpfls_cli.report.numbers import number, percent

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_DIGITS = 3
_SETTINGS_SHOWN = 9
_DEVIATION = "standard deviation of the"
_DECADE = 10.0
_TICKS = 4
_ROWS: tuple[tuple[str, Callable[[SettingRuns], str]], ...] = (
    ("system", lambda s: {"cpfls": "cpFLS", "fls": "FLS"}[s.structure]),
    ("training points", lambda s: str(s.samples)),
    ("population × generations", lambda s: f"{s.population} × {s.generations}"),
    ("runs", lambda s: str(s.runs)),
    (f"best run: MSE, {SQUARED_TORQUE}", lambda s: _best(s, s.mse[:, 0])),
    (f"best run: largest error, {TORQUE}", lambda s: _best(s, s.max_error[:, 0])),
    ("best run: condition number", lambda s: _best(s, s.condition_number)),
    (f"mean MSE, {SQUARED_TORQUE}", lambda s: _mean(s.mse[:, 0])),
    (f"{_DEVIATION} MSE, {SQUARED_TORQUE}", lambda s: _deviation(s.mse[:, 0])),
    (f"mean largest error, {TORQUE}", lambda s: _mean(s.max_error[:, 0])),
    (f"{_DEVIATION} largest error, {TORQUE}", lambda s: _deviation(s.max_error[:, 0])),
    ("mean condition number", lambda s: _mean(s.condition_number)),
    (f"{_DEVIATION} condition number", lambda s: _deviation(s.condition_number)),
    ("mean relative error", lambda s: percent(spread(s.relative_error[:, 0]).mean)),
)
"""Quantities of the large table, and how each is shown of a setting."""


def answer(sweep: Source[SweepRecord]) -> Iterator[Block]:
    """Say how many runs are finished, mean and spread of each setting, and what to distrust."""
    record = sweep.record
    settings = f"{len(record.settings)} setting{'s' if len(record.settings) > 1 else ''}"
    yield Text(f"{_finished(sweep)}, {settings}; mean and standard deviation of the training part")
    yield _short_table("settings", record.settings[:_SETTINGS_SHOWN])
    others = record.settings[_SETTINGS_SHOWN:]
    if others:
        yield Folded(f"{len(others)} more settings", [_short_table("more-settings", others)])
    if record.without_model:
        yield Text(
            f"{record.without_model} of {len(record.run)} runs found no finite model; all means leave them out",
            "warning",
        )


def _short_table(name: str, settings: Sequence[SettingRuns]) -> Table:
    rows = [
        [
            setting.name,
            *(
                shown(values)
                for values in (setting.mse[:, 0], setting.max_error[:, 0], setting.condition_number)
                for shown in (_mean, lambda each: "" if np.isnan(spread(each).variance) else _deviation(each))
            ),
        ]
        for setting in settings
    ]
    header = ("Setting", f"MSE, {SQUARED_TORQUE}", "±", f"Largest error, {TORQUE}", "±", "Condition number", "±")
    return Table(name, "", header, rows)


def _finished(sweep: Source[SweepRecord]) -> str:
    planned = len(sweep.record.settings) * int(sweep.config["sweep"]["seeds"])
    return f"{len(sweep.record.run)} of {planned} runs"


def joined_sweeps(sweeps: Sequence[Source[SweepRecord]]) -> list[Source[SweepRecord]]:
    """Take sweeps of equal settings and inputs as one, in the order of the first of each, unless they share a seed."""
    joined: list[Source[SweepRecord]] = []
    for sweep in sweeps:
        index = next((index for index, other in enumerate(joined) if other.record.joins(sweep.record)), None)
        if index is None:
            joined.append(sweep)
        else:
            joined[index] = _joined(joined[index], sweep)
    return joined


def _joined(first: Source[SweepRecord], second: Source[SweepRecord]) -> Source[SweepRecord]:
    seeds = sum(int(sweep.config["sweep"]["seeds"]) for sweep in (first, second))
    config = {**first.config, "sweep": {**first.config["sweep"], "seeds": seeds}}
    record = first.record.joined(second.record)
    return replace(first, label=f"{first.label} and {second.label}", record=record, config=config)


def sweep_blocks(sweep: Source[SweepRecord], index: int) -> Iterator[Block]:
    """Show the settings of a sweep beside each other: Table 5 of the paper."""
    # Table 5 holds more than the one that a terminal has room for.
    yield from (block for block in answer(sweep) if not isinstance(block, Table | Folded))
    if not sweep.record.complete:
        yield Text(
            f"Unfinished: {_finished(sweep)} of {sweep.label}. The same command with --resume goes on.", "warning"
        )
    yield _table(sweep, index)
    yield replicates_figure(f"replicates-{index}", sweep)
    yield from _held_out(sweep, index)
    yield Text(
        f"Every setting was searched with the same seeds, from {sweep.record.origin.seed} on. "
        "cpfls reduce and cpfls identify with the overrides of a setting and --seed make each model again."
    )


def _table(sweep: Source[SweepRecord], index: int) -> Table:
    settings = sweep.record.settings
    rows = [[title, *(shown(setting) for setting in settings)] for title, shown in _ROWS]
    caption = (
        f"Results of {sweep.label} on the whole training part. The best run of a setting is that of the smallest mean "
        "squared error; mean and standard deviation are over its seeds; the variance is the square of the standard "
        "deviation shown."
    )
    return Table(f"table-5-replicates-{index}", caption, ["Quantity", *(setting.name for setting in settings)], rows)


def _best(setting: SettingRuns, values: Array) -> str:
    return number(setting.best_of(values), _DIGITS)


def _mean(values: Array) -> str:
    return number(spread(values).mean, _DIGITS)


def _deviation(values: Array) -> str:
    return number(spread(values).deviation, 2)


def _both(values: Array) -> str:
    return _mean(values) if np.isnan(spread(values).variance) else f"{_mean(values)} ± {_deviation(values)}"


def _held_out(sweep: Source[SweepRecord], index: int) -> Iterator[Block]:
    """Show how good the models are on what they were not learned from."""
    for number_of, part in enumerate(sweep.record.part[1:], start=1):
        rows = [
            [
                setting.name,
                str(setting.runs),
                *(_both(values[:, number_of]) for values in (setting.mse, setting.max_error, setting.relative_error)),
            ]
            for setting in sweep.record.settings
        ]
        header = ("Setting", "Runs", f"MSE, {SQUARED_TORQUE}", f"Largest error, {TORQUE}", "Relative error")
        caption = f"Models of {sweep.label} on {part}: mean ± standard deviation over the seeds."
        yield Table(f"held-out-{index}-{number_of}", caption, header, rows)


def replicates_figure(name: str, sweep: Source[SweepRecord]) -> Plot:
    """Draw mean squared error and condition number of every run, in a row for each setting."""
    settings = sweep.record.settings

    def draw(figure: Figure) -> None:
        errors, conditions = figure.subplots(1, 2, sharey=True)
        for row, setting in enumerate(reversed(settings)):
            _dots(errors, row, setting.mse[:, 0])
            _dots(conditions, row, setting.condition_number)
        errors.set_yticks(range(len(settings)), [setting.name for setting in reversed(settings)])
        errors.set_ylim(-0.6, len(settings) - 0.4)
        errors.set_xlabel("MSE, (N m)²")
        conditions.set_xlabel("condition number")
        for axes in (errors, conditions):
            axes.grid(visible=False, axis="y")
            axes.tick_params(axis="y", length=0)
            _scale(axes)

    caption = (
        f"Runs of {sweep.label}: each circle is the model of one seed, judged on the training part; the upright line "
        "is the mean of the setting."
    )
    description = "Mean squared error and condition number by setting, one circle for each seed"
    return plot(name, caption, description, 0.9 + 0.36 * len(settings), draw)


def _dots(axes: Axes, row: int, values: Array) -> None:
    """Draw runs side by side in their order, so that equal values do not hide each other."""
    offsets = np.linspace(0.22, -0.22, len(values)) if len(values) > 1 else np.zeros(len(values))
    axes.plot(values, row + offsets, "o", markersize=4.5, markerfacecolor="none", color=style_of(0)["color"])
    mean = spread(values).mean
    if np.isfinite(mean):
        axes.vlines(mean, row - 0.34, row + 0.34, color="black", linewidth=2.2, zorder=1)


def _scale(axes: Axes) -> None:
    """Take a logarithmic scale where values differ by more than a decade."""
    from matplotlib.ticker import MaxNLocator

    values = np.concatenate([line.get_xdata() for line in axes.lines]) if axes.lines else np.zeros(0)
    known = values[np.isfinite(values) & (values > 0)]
    if len(known) and known.max() > _DECADE * known.min():
        axes.set_xscale("log")
    else:
        axes.xaxis.set_major_locator(MaxNLocator(_TICKS))
        plain_ticks(axes.xaxis)
