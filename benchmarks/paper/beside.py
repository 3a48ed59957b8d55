"""The sections of a report with what the paper prints next to them: Tables 3, 4 and 5, and the peaks of the path."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from benchmarks.paper.claims import PaperSources, Settings, compares_readings
from benchmarks.paper.printed import (
    LEAST_TORQUE,
    PRINTED_DURATION_S,
    PRINTED_PEAKS,
    PRINTED_VEHICLE,
    RELATIVE_ERROR,
    SMALLEST_MAX_ERROR,
    TABLE_4,
    TABLE_5,
    PrintedColumn,
)
from benchmarks.paper.replicates import Setting, Spread, Sweep, joined_sweeps
from cpfls_cli.identification.data import TRAINING
from cpfls_cli.identification.identify import MODEL, Judged
from cpfls_cli.report.content import UNKNOWN, Block, Cell, Folded, Plot, Section, Table, Text, change, number, percent
from cpfls_cli.report.source import Source

_LACKS_SWEEP = Text(
    "Not shown, because no searches were given: Table 5 with its means over several seeds; made by: make reproduce.",
    "note",
)
_PAPER_NOTE = Text(
    "Ours above, the paper's below, over ten runs each. It says “variance” where it must mean the standard deviation: "
    "a variance of 0.0001 about a mean of 0.0008 would be a deviation of 0.01. Compare how figures change from setting "
    "to setting, and relative errors: its absolute errors belong to torques of more than 1.5 N m, and its condition "
    "numbers to a path that it does not define in full.",
    "note",
)
_NUMBERED = re.compile(r"Figure \d")
"""How the caption of a figure begins that has the number of one of the paper."""
_FLOOR = " is better conditioned than the full set"
_SAMPLES, _QUANTITY = 1, 0


def with_the_paper(section: Section, sources: PaperSources) -> Section:
    """Put next to a section what the paper prints of it."""
    blocks: list[Block] = list(_blocks(section.blocks, sources))
    if section.name == "summary" and not sources.sweeps:
        blocks.append(_LACKS_SWEEP)
    return replace(section, blocks=blocks)


def _blocks(given: Sequence[Block], sources: PaperSources) -> Iterator[Block]:
    sweeps = [sweep.record.settings for sweep in joined_sweeps(sources.sweeps)]
    in_sweeps = any(any(printed_beside(settings)) for settings in sweeps)
    for block in given:
        match block:
            case Folded():
                yield replace(block, blocks=list(_blocks(block.blocks, sources)))
            case Table(name="table-3-vehicle"):
                printed = [*PRINTED_VEHICLE, *["0"] * (len(block.rows) - len(PRINTED_VEHICLE) - 1), PRINTED_DURATION_S]
                yield _with_column(block, printed)
            case Table() if _is_of(block, "trajectory", "Derivative"):
                caption = f"{block.caption} The paper prints its maxima for intervals of P = 1 s.".lstrip()
                printed = [number(PRINTED_PEAKS[row[_QUANTITY].text]) for row in block.cells]
                yield replace(_with_column(block, printed), caption=caption)
            case Table() if _is_of(block, "reduce", "Set"):
                yield _table_4(block)
            case Text(text=text) if text.endswith(f"{_FLOOR}."):
                floor = "the paper's floor, that a reduced set cannot be, does not hold"
                yield Text(f"{text.removesuffix('.')}: {floor}.")
            case Table() if _is_of(block, "comparison" if len(sources.models) > 1 else "identify", "Quantity"):
                yield block if in_sweeps else _all_columns(block)
                yield Text(_scale_sentence(sources), "note")
            case Plot(caption=caption) if _NUMBERED.match(caption):
                yield replace(block, see=("figures-of-the-paper", "What the paper's shows."))
            case _:
                yield block


def _is_of(table: Table, stage: str, first: str) -> bool:
    """Whether a table is that of a stage whose first column is called so."""
    return table.name.startswith(f"{stage}-") and str(table.header[0]) == first


def _with_column(table: Table, printed: Sequence[str]) -> Table:
    rows = [[*row, value] for row, value in zip(table.rows, printed, strict=True)]
    return replace(table, header=[*table.header, "Paper"], rows=rows)


def _table_4(table: Table) -> Table:
    """Add the printed columns by number of samples, largest sets first; those that nobody repeats stand alone."""
    printed = {str(column.samples): [str(column.condition_number), change(column.change)] for column in TABLE_4}
    shown = {row[_SAMPLES].text for row in table.cells}
    rows = [[*row, *map(Cell, printed.get(row[_SAMPLES].text, ["", ""]))] for row in table.cells]
    full = TABLE_4[0].samples
    rows += [
        list(map(Cell, [f"Paper, {'full set' if int(samples) == full else 'reduced'}", samples,
                        percent(int(samples) / full), "", "", "", "", *columns]))
        for samples, columns in printed.items() if samples not in shown
    ]  # fmt: skip
    header = [*table.header, "Paper: condition number", "Paper: change"]
    return replace(table, header=header, rows=sorted(rows, key=lambda row: -int(row[_SAMPLES].text)))


def _all_columns(table: Table) -> Table:
    """Put all columns of Table 5 next to the models, where no sweep repeats them."""
    columns = [_printed(column) for column in TABLE_5]
    rows = [[*row, *(column[index] for column in columns)] for index, row in enumerate(table.rows)]
    header = [*table.header, *["Paper"] * len(columns)]
    return replace(table, header=header, rows=rows, sentences=frozenset(range(1, len(header))))


def _printed(column: PrintedColumn) -> list[str]:
    size = [str(value) for value in (column.samples, column.population, column.generations)]
    return [column.system, *size, UNKNOWN, column.mse, column.max_error, column.condition_number, RELATIVE_ERROR]


def _scale_sentence(sources: PaperSources) -> str:
    """Compare the size of the torques: the paper prints absolute errors, and its torques must have been larger."""
    ours = max(_largest_torque(model.record.judged) for model in sources.models)
    return (
        f"Compare the relative errors, not MSE and largest error: the largest torque here is {number(ours, 2)} N m, "
        f"whereas an error of {SMALLEST_MAX_ERROR} N m that is below 10 % means more than {number(LEAST_TORQUE, 2)} "
        "N m in the paper. Its condition numbers belong to its own training path, which it does not define in full."
    )


def _largest_torque(judged: Judged) -> float:
    with np.errstate(divide="ignore", invalid="ignore"):
        torque = judged.of_axes("max_error", MODEL, TRAINING) / judged.of_axes("relative_error", MODEL, TRAINING)
    return float(np.max(torque[np.isfinite(torque)], initial=0.0))


def replicates(sources: PaperSources) -> Iterator[Section]:
    """Show the searches that compare no readings, a row of the paper below each of ours that it has too."""
    found = (sweep for sweep in joined_sweeps(sources.sweeps) if not compares_readings(sweep.record.settings))
    for number_, sweep in enumerate(found, 1):
        yield Section(f"searches-{number_}", f"Searches of {sweep.label}", list(_of_sweep(sweep, number_)))


def _of_sweep(sweep: Source[Sweep], number_: int) -> Iterator[Block]:
    settings = sweep.record.settings
    printed = printed_beside(settings)
    rows: list[Sequence[str | Cell]] = []
    for name, ours, paper in _QUANTITIES:
        rows.append([name, *map(ours, settings)])
        if any(printed) and paper is not None:
            rows.append(["· paper", *(paper(column) if column else UNKNOWN for column in printed)])
    caption = (
        "On the whole training part. The best run of a setting is that of the smallest mean squared error; mean and "
        "standard deviation are over its seeds, from "
        f"{min(int(seed) for setting in settings for seed in setting.seeds)} on."
    )
    yield Table(f"searches-{number_}-table", caption, ["Quantity", *(each.name for each in settings)], rows)
    lost = sum(int(np.sum(np.isnan(each.of("mse")))) for each in settings)
    if lost:
        yield Text(f"{lost} of {sweep.record.runs} runs found no finite model; all means leave them out.", "warning")
    if any(printed):
        yield _PAPER_NOTE


def _mean(values: Spread) -> str:
    return number(values.mean, 3)


def _deviation(values: Spread) -> str:
    return number(values.standard_deviation, 2)


def _best(name: str) -> Callable[[Setting], str]:
    """Give a number of the best run of a setting, on the training part."""
    return lambda own: UNKNOWN if own.best is None else number(np.atleast_1d(getattr(own.best, name))[0], 3)


_QUANTITIES: tuple[tuple[str, Callable[[Setting], str], Callable[[PrintedColumn], str] | None], ...] = (
    ("system", lambda s: s.structure.replace("fls", "FLS"), lambda p: p.system),
    ("training points", lambda s: str(s.samples), lambda p: str(p.samples)),
    ("population × generations", lambda s: f"{s.population} × {s.generations}",
     lambda p: f"{p.population} × {p.generations}"),
    ("runs", lambda s: str(s.runs), lambda _: "10"),
    ("best run: MSE, (N m)²", _best("mse"), lambda p: p.mse),
    ("best run: largest error, N m", _best("max_error"), lambda p: p.max_error),
    ("best run: condition number", _best("condition_number"), lambda p: p.condition_number),
    ("mean MSE, (N m)²", lambda s: _mean(s.mse), lambda p: p.mse_of_runs[0]),
    ("standard deviation of the MSE, (N m)²", lambda s: _deviation(s.mse), lambda p: p.mse_of_runs[1]),
    ("mean largest error, N m", lambda s: _mean(s.max_error), lambda p: p.max_error_of_runs[0]),
    ("standard deviation of the largest error, N m", lambda s: _deviation(s.max_error),
     lambda p: p.max_error_of_runs[1]),
    ("mean condition number", lambda s: _mean(s.condition_number), lambda p: p.condition_number_of_runs[0]),
    ("standard deviation of the condition number", lambda s: _deviation(s.condition_number),
     lambda p: p.condition_number_of_runs[1]),
    ("mean relative error", lambda s: percent(s.relative_error.mean), lambda _: RELATIVE_ERROR),
)  # fmt: skip
"""What is shown of each setting, and what of a printed column."""


def printed_beside(settings: Settings) -> list[PrintedColumn | None]:
    """Find the column of the paper that each setting repeats: of equal size too where there is one, else the first."""
    columns: dict[int, PrintedColumn] = {}
    for exact in (True, False):
        for index, setting in enumerate(settings):
            free = (column for column in TABLE_5 if column not in columns.values() and _fits(setting, column, exact))
            if index not in columns and (column := next(free, None)) is not None:
                columns[index] = column
    return [columns.get(index) for index in range(len(settings))]


def _fits(setting: Setting, column: PrintedColumn, exact: bool) -> bool:
    keys = ("structure", "samples", "population", "generations") if exact else ("structure", "samples")
    return all(getattr(setting, key) == getattr(column, key) for key in keys)
