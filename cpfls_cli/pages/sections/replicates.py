"""Table 5: how good models are, and how far apart the seeds of each setting lie."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.identification.judge import spread
from cpfls_cli.pages.figures.replicates import replicates_figure
from cpfls_cli.pages.source import Sources
from cpfls_cli.pages.swept import Sweep, joined_sweeps, printed_beside, repeats_table_5
from cpfls_cli.pages.swept_setting import SweptSetting
from cpfls_cli.pages.table_5 import RELATIVE_ERROR, PrintedColumn
from cpfls_cli.report.content import Block, Section, Table, Text
from cpfls_cli.report.numbers import UNKNOWN, number, percent

# Units are not torn apart at the end of a line.
TORQUE, SQUARED = "N\N{NO-BREAK SPACE}m", "(N\N{NO-BREAK SPACE}m)²"
_DIGITS = 3
_DEVIATION = "standard deviation of the"
_Row = tuple[str, Callable[[SweptSetting], str], Callable[[PrintedColumn], str] | None]


def replicates_section(sources: Sources) -> Section | None:
    """Show the settings of sweeps beside each other and beside the paper's.

    Returns
    -------
    Section or None
        None where no sweep was given.

    References
    ----------
    Table 5 of the paper.
    """
    if not sources.sweeps:
        return None
    sweeps, paper = joined_sweeps(sources.sweeps), sources.settings.paper
    blocks = [block for index, sweep in enumerate(sweeps, start=1) for block in _sweep(sweep, index, paper)]
    return Section("replicates", "Replicates of the search", blocks)


def _sweep(sweep: Sweep, index: int, paper: bool) -> Iterator[Block]:
    settings = sweep.settings
    runs = sum(setting.runs for setting in settings)
    if not sweep.complete:
        yield Text(
            f"Unfinished: {runs} of {len(settings) * sweep.planned_seeds} runs of {sweep.label}. The same command with "
            "--resume goes on.",
            "warning",
        )
    yield _table(sweep, index, settings, paper)
    if paper and repeats_table_5(sweep.sources):
        yield Text(_PAPER_NOTE, "note")
    yield replicates_figure(f"replicates-{index}", sweep.label, settings)
    yield from _held_out(sweep, index, settings)
    first = min(source.artifact.header.seed for source in sweep.sources)
    yield Text(
        f"Every setting was searched with the same seeds, from {first} on. "
        "cpfls reduce and cpfls identify with the overrides of a setting and --seed find each model again."
    )


_PAPER_NOTE = (
    "Ours above, the paper's below, over ten runs each. It says “variance” where it must mean the standard deviation: "
    "a variance of 0.0001 about a mean of 0.0008 would be a deviation of 0.01. Compare how figures change from setting "
    "to setting, and relative errors: its absolute errors belong to torques of more than 1.5 N m, and its condition "
    "numbers to a path that it does not define in full."
)


def _table(sweep: Sweep, index: int, settings: list[SweptSetting], paper: bool) -> Table:
    printed = printed_beside(settings) if paper else [None for _ in settings]
    rows: list[list[str]] = []
    for title, ours, theirs in _rows():
        rows.append([title, *(ours(setting) for setting in settings)])
        if theirs is not None and any(printed):
            rows.append(["· paper", *(theirs(column) if column else UNKNOWN for column in printed)])
    numbered = "Table 5. " if repeats_table_5(sweep.sources) else ""
    caption = (
        f"{numbered}Results of {sweep.label} on the whole training part. The best run of a setting is that of the "
        "smallest mean squared error; mean and standard deviation are over its seeds; the "
        "variance is the square of the standard deviation shown."
    )
    return Table(f"table-5-replicates-{index}", caption, ["Quantity", *(setting.name for setting in settings)], rows)


def _rows() -> Iterator[_Row]:
    yield "system", lambda s: {"cpfls": "cpFLS", "fls": "FLS"}[s.structure], lambda p: p.system
    yield "training points", lambda s: str(s.samples), lambda p: str(p.samples)
    yield "population × generations", lambda s: f"{s.population} × {s.generations}", _size
    yield "runs", lambda s: str(s.runs), lambda _: "10"
    yield f"best run: MSE, {SQUARED}", lambda s: _best(s, s.mse[:, 0]), lambda p: p.mse
    yield f"best run: largest error, {TORQUE}", lambda s: _best(s, s.max_error[:, 0]), lambda p: p.max_error
    yield "best run: condition number", lambda s: _best(s, s.condition_number), lambda p: p.condition_number
    yield f"mean MSE, {SQUARED}", lambda s: _mean(s.mse[:, 0]), lambda p: p.mse_of_runs[0]
    yield f"{_DEVIATION} MSE, {SQUARED}", lambda s: _deviation(s.mse[:, 0]), lambda p: p.mse_of_runs[1]
    yield f"mean largest error, {TORQUE}", lambda s: _mean(s.max_error[:, 0]), lambda p: p.max_error_of_runs[0]
    yield (
        f"{_DEVIATION} largest error, {TORQUE}",
        lambda s: _deviation(s.max_error[:, 0]),
        lambda p: p.max_error_of_runs[1],
    )
    yield "mean condition number", lambda s: _mean(s.condition_number), lambda p: p.condition_number_of_runs[0]
    yield (
        f"{_DEVIATION} condition number",
        lambda s: _deviation(s.condition_number),
        lambda p: p.condition_number_of_runs[1],
    )
    yield "mean relative error", lambda s: percent(spread(s.relative_error[:, 0]).mean), lambda _: RELATIVE_ERROR


def _size(column: PrintedColumn) -> str:
    return f"{column.population} × {column.generations}"


def _best(setting: SweptSetting, values: Array) -> str:
    return number(setting.best_of(values), _DIGITS)


def _mean(values: Array) -> str:
    return number(spread(values).mean, _DIGITS)


def _deviation(values: Array) -> str:
    return number(spread(values).deviation, 2)


def _held_out(sweep: Sweep, index: int, settings: list[SweptSetting]) -> Iterator[Block]:
    """Show what the models are worth on what they were not learned from."""
    for place, part in enumerate(sweep.parts[1:], start=1):
        measures = ("mse", "max_error", "relative_error")
        rows = [
            [setting.name, str(setting.runs), *(_both(getattr(setting, key)[:, place]) for key in measures)]
            for setting in settings
        ]
        header = ("Setting", "Runs", f"MSE, {SQUARED}", f"Largest error, {TORQUE}", "Relative error")
        caption = f"Models of {sweep.label} on {part}: mean ± standard deviation over the seeds."
        yield Table(f"held-out-{index}-{place}", caption, header, rows)


def _both(values: Array) -> str:
    found = spread(values)
    if np.isnan(found.variance):
        return number(found.mean, _DIGITS)
    return f"{number(found.mean, _DIGITS)} ± {number(found.deviation, 2)}"
