"""The sections of a report with what the paper prints beside them: Tables 3, 4 and 5, and the peaks of the path."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
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
from cpfls_cli.identification.replicates import Setting
from cpfls_cli.identification.scores import MODEL, TRAINING, Judged
from cpfls_cli.report.content import Block, Cell, Folded, Plot, Section, Table, Text
from cpfls_cli.report.numbers import UNKNOWN, change, number, percent
from cpfls_cli.stages.sweep import joined_sweeps

_LACKS_SWEEP = Text(
    "Not shown, because no sweep was given: Table 5 with its means over several seeds; made by: cpfls sweep CONFIG "
    "flight.h5 -o sweep.h5.",
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
    """Put beside a section what the paper prints of it."""
    blocks: list[Block] = list(_blocks(section.blocks, sources))
    if section.name == "summary" and not sources.sweeps:
        blocks.append(_LACKS_SWEEP)
    return replace(section, blocks=blocks)


def _blocks(given: Sequence[Block], sources: PaperSources) -> Iterator[Block]:
    sweeps = [sweep.record.settings for sweep in joined_sweeps(sources.sweeps)]
    shown = [settings for settings in sweeps if not compares_readings(settings)]
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
            case Table() if _is_of(block, "sweep", "Quantity"):
                printed = printed_beside(shown[int(block.name.split("-")[1]) - 1])
                yield _replicates(block, printed)
                if any(printed):
                    yield _PAPER_NOTE
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
    """Put all columns of Table 5 beside the models, where no sweep repeats them."""
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


def _replicates(table: Table, printed: Sequence[PrintedColumn | None]) -> Table:
    """Put a row of the paper below each of ours that it has too."""
    if not any(printed):
        return table
    rows: list[Sequence[str | Cell]] = []
    for row in table.cells:
        rows.append(row)
        if (shown := _PRINTED_ROWS.get(row[_QUANTITY].text)) is not None:
            rows.append(["· paper", *(shown(column) if column else UNKNOWN for column in printed)])
    return replace(table, rows=rows)


_PRINTED_ROWS = {
    "system": lambda p: p.system,
    "training points": lambda p: str(p.samples),
    "population × generations": lambda p: f"{p.population} × {p.generations}",
    "runs": lambda _: "10",
    "best run: MSE, (N m)²": lambda p: p.mse,
    "best run: largest error, N m": lambda p: p.max_error,
    "best run: condition number": lambda p: p.condition_number,
    "mean MSE, (N m)²": lambda p: p.mse_of_runs[0],
    "standard deviation of the MSE, (N m)²": lambda p: p.mse_of_runs[1],
    "mean largest error, N m": lambda p: p.max_error_of_runs[0],
    "standard deviation of the largest error, N m": lambda p: p.max_error_of_runs[1],
    "mean condition number": lambda p: p.condition_number_of_runs[0],
    "standard deviation of the condition number": lambda p: p.condition_number_of_runs[1],
    "mean relative error": lambda _: RELATIVE_ERROR,
}
"""What is shown of a printed column beside each quantity of a sweep."""


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
