"""What a figure draws as small tables, and both as HTML."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from markupsafe import Markup, escape

from cpfls_cli.arrays import Array
from cpfls_cli.errors import visible
from cpfls_cli.report.canvas import evenly_spread
from cpfls_cli.report.content import STRUCK, Panel, Picture, Series, Table
from cpfls_cli.report.numbers import number, plain

_CODE = re.compile("`([^`]+)`")
_COLUMNS = 12
_DIGITS = 4
_SMALL = 1e-4


def with_code(text: str) -> Markup:
    """Escape a sentence, set what stands between backticks in it as code, and strike numbers that no vehicle has."""
    return Markup(STRUCK.sub(r"<s>\1</s>", _CODE.sub(r"<code>\1</code>", str(escape(visible(text))))))


def figure_html(picture: Picture) -> str:
    """Write a figure for the page of a result, its numbers folded away."""
    tables = figure_tables(picture.panels)
    if not tables:
        return picture.svg
    numbers = "".join(map(_table_html, tables))
    return f'<div class="plot">{picture.svg}</div><details><summary>Numbers</summary>{numbers}</details>'


def _table_html(table: Table) -> str:
    head = "".join(f'<th scope="col">{with_code(name)}</th>' for name in table.header)
    rows = "".join(
        f'<tr><th scope="row">{with_code(first.text)}</th>'
        f"{''.join(f'<td>{with_code(cell.text)}</td>' for cell in rest)}</tr>"
        for first, *rest in table.cells
    )
    caption = f"<caption>{with_code(table.caption)}</caption>" if table.caption else ""
    head = f"<thead><tr>{head}</tr></thead>"
    return f'<div class="table" tabindex="0"><table>{caption}{head}<tbody>{rows}</tbody></table></div>'


@dataclass
class _Side:
    """Curves over the same x, side by side."""

    panel: Panel
    x: Array
    titles: list[str] = field(default_factory=list)
    columns: list[list[str]] = field(default_factory=list)
    drawn: list[int] = field(default_factory=list)

    def takes(self, panel: Panel, x: Array, more: int) -> bool:
        """Tell whether a curve over this x belongs here too."""
        same_axis = panel.x_label == self.panel.x_label and panel.x_names == self.panel.x_names
        return same_axis and len(self.columns) + more <= _COLUMNS and np.array_equal(x, self.x)


def figure_tables(panels: Sequence[Panel]) -> list[Table]:
    """Write the data of a figure as tables of at most 25 rows, curves over the same x side by side."""
    sides: list[_Side] = []
    for panel in panels:
        data = [series for series in panel.series if series.form != "mark"]
        for index, series in enumerate(data):
            name = series.label or (f"curve {index + 1}" if len(data) > 1 else "")
            _place(sides, panel, series, name)
    tables = [_table(side) for side in sides]
    marks = [row for panel in panels for row in _marks(panel)]
    if marks:
        shown = [marks[index] for index in evenly_spread(len(marks))]
        more = f": {len(shown)} of {len(marks)}" if len(shown) < len(marks) else ""
        tables.append(Table("", f"Levels and spans{more}.", ("Panel", "What", "x", "y"), shown))
    return tables


def _place(sides: list[_Side], panel: Panel, series: Series, name: str) -> None:
    x, columns = _shown(series)
    side = next((side for side in sides if side.takes(panel, x, len(columns))), None)
    if side is None:
        side = _Side(panel, x)
        sides.append(side)
    side.titles += [", ".join(filter(None, (panel.title, *words))) for words in _words(panel, series, name)]
    side.columns += [[_word(value, panel.y_names) for value in column] for column in columns]
    side.drawn.append(len(series.x))


def _shown(series: Series) -> tuple[Array, list[Array]]:
    """Pick the rows of a table: x, and the columns of this series."""
    if series.spread is not None and series.form == "line":
        rows = evenly_spread(len(series.spread[0]))
        return series.spread[0][rows], [series.spread[1][rows]]
    rows = evenly_spread(len(series.x))
    columns = (None if series.form == "band" else series.y, series.low, series.high, series.value)
    return series.x[rows], [column[rows] for column in columns if column is not None]


def _words(panel: Panel, series: Series, name: str) -> Iterator[tuple[str, ...]]:
    if series.form != "band":
        yield (name, panel.y_label)
    for end in ("low", "high") if series.low is not None else ():
        yield (name, end, panel.y_label)
    if series.value is not None:
        yield ("value",)


def _table(side: _Side) -> Table:
    rows = [
        [side.panel.x_names.get(float(x)) or plain(_positive(x), smallest=_SMALL), *cells]
        for x, *cells in zip(side.x, *side.columns, strict=True)
    ]
    fewest, most = min(side.drawn), max(side.drawn)
    drawn = f"{most}" if fewest == most else f"{fewest} to {most}"
    caption = f"{len(rows)} of {drawn} points that are drawn of each curve." if most > len(rows) else ""
    return Table("", caption, [side.panel.x_label or "x", *side.titles], rows)


def _marks(panel: Panel) -> Iterator[list[str]]:
    for mark in panel.series:
        # A zero line without a name says nothing.
        if mark.form == "mark" and (mark.label or np.any(mark.y[np.isfinite(mark.y)]) or np.isfinite(mark.x).all()):
            x, y = (_range(ends, names) for ends, names in ((mark.x, panel.x_names), (mark.y, panel.y_names)))
            yield [panel.title or panel.y_label, mark.label, x, y]


def _range(ends: Array, names: Mapping[float, str]) -> str:
    if np.isinf(ends).any():
        return "edge to edge"
    low, high = _word(ends[0], names), _word(ends[-1], names)
    return low if low == high else f"{low} … {high}"


def _word(value: float, names: Mapping[float, str]) -> str:
    return names.get(float(value)) or number(_positive(value), _DIGITS)


def _positive(value: float) -> float:
    """Drop the sign of a zero."""
    return float(value) + 0.0
