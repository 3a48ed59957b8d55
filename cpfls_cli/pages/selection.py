"""The page of a selection: what the reduced training set keeps."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.selection import SelectionRecord
from cpfls_cli.pages.source import Source, Sources
from cpfls_cli.report.canvas import BASELINE, legend_above, plot, style_of
from cpfls_cli.report.content import Block, Cell, Heading, Plot, Section, Table, Text
from cpfls_cli.report.numbers import change, count, number, percent
from cpfls_cli.rounding import at_most, less

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_HEADER = ("Set", "Samples", "Share", "Rank", "Condition number", "Change", "Random choice of equal size")
_Row = list[str | Cell]


def answer(selection: Source[SelectionRecord]) -> Iterator[Block]:
    """Say what was selected, how good it is, and what to distrust."""
    record = selection.record
    yield Text(
        f"{len(record.indices)} of {record.candidates} samples by {record.criterion}, rank {record.rank} of "
        f"{record.rank_full}"
    )
    yield Text(
        f"condition number {number(record.condition_number, 5)} (all samples "
        f"{number(record.condition_number_full, 5)}, random choice of equal size {number(record.random_median, 5)})"
    )
    yield from (Text(sentence, "warning") for sentence in _warnings(selection))


def _warnings(selection: Source[SelectionRecord]) -> Iterator[str]:
    record, target = selection.record, selection.config["reduction"]["condition_number"]
    if record.deficient:
        yield (
            f"{selection.label} is rank deficient: rank {record.rank}, where all samples reach {record.rank_full}; do "
            "not train on it, use another reduction.criterion or more samples"
        )
    # All samples are the only choice of their size.
    elif len(record.indices) < record.candidates and at_most(record.random_median, record.condition_number):
        yield f"{selection.label} is no better than a random choice of equal size"
    if target is not None and less(target, record.condition_number):
        yield (
            f"the target reduction.condition_number = {target:g} is not reached, the selection has "
            f"{number(record.condition_number, 5)}: {_limit(record)}"
        )


def _limit(record: SelectionRecord) -> str:
    if record.stop_reason == "pool":
        return "all samples of the pool are in; raise reduction.pool"
    if len(record.indices) == record.candidates:
        return "all samples are in"
    return "reduction.size stopped the selection; raise it or set it to null"


def reduction_section(sources: Sources) -> Section | None:
    """Show the reduced training sets, if any: Table 4 and Figure 5 of the paper."""
    selections = sources.selections
    if not selections:
        return None
    blocks: list[Block] = []
    for selection in selections:
        blocks += [Heading(selection.label)] if len(selections) > 1 else []
        blocks += answer(selection)
        full, parameters = selection.record.rank_full, selection.parameters
        if full < parameters:
            undetermined = (
                f"The flight behind {selection.label} determines only {full} of {parameters} parameters, however many "
                "samples are kept: condition numbers cover the determined directions only."
            )
            blocks.append(Text(undetermined, "warning"))
    blocks.append(_table(selections))
    for selection in selections:
        record = selection.record
        if not record.deficient and less(record.condition_number, record.condition_number_full):
            blocks.append(Text(f"{selection.label} is better conditioned than the full set."))
    flights = list(dict.fromkeys(selection.made_from("flight") for selection in selections))
    for index, flight in enumerate(flights, start=1):
        group = [selection for selection in selections if selection.made_from("flight") == flight]
        blocks.append(reduction_figure(f"figure-5-reduction-{index}", group))
    return Section("reduction", "Reduced training set", blocks)


def _table(selections: Sequence[Source[SelectionRecord]]) -> Table:
    rows = [row for selection in selections for row in _rows(selection)]
    # Selections from one flight share its full set, which then stands once.
    rows = [row for index, row in enumerate(rows) if row not in rows[:index]]
    caption = (
        "Table 4. Condition number of the regressor with uniform partitions, all samples against reduced sets. Change "
        "is against the full set of the same flight; random is the median of random choices."
    )
    return Table("table-4-reduction", caption, _HEADER, rows)


def _rows(selection: Source[SelectionRecord]) -> Iterator[_Row]:
    record = selection.record
    kept, parameters = len(record.indices), selection.parameters
    all_samples = [f"{selection.input_name('flight')}, full set", count(record.candidates), "100 %"]
    yield [*all_samples, f"{record.rank_full} of {parameters}", number(record.condition_number_full, 5), "", ""]
    yield [
        f"{selection.label}, {record.criterion}",
        str(kept),
        percent(kept / record.candidates if record.candidates else float("nan")),
        Cell(f"{record.rank} of {parameters}", "warning" if record.deficient else "plain"),
        number(record.condition_number, 5),
        "not comparable" if record.deficient else change(record.condition_number / record.condition_number_full - 1),
        number(record.random_median, 5),
    ]


def reduction_figure(name: str, selections: Sequence[Source[SelectionRecord]]) -> Plot:
    """Draw condition number and extreme singular values after each sample selected from one flight: Figure 5."""

    def draw(figure: Figure) -> None:
        upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
        for index, selection in enumerate(selections):
            _draw_condition(upper, selection, index)
            _draw_singular_values(lower, selection, index)
        for value in sorted({s.record.condition_number_full for s in selections}):
            upper.axhline(value, label=f"full set, {value:.0f}", **BASELINE)
        upper.set_ylabel("condition number")
        lower.set_ylabel("singular value")
        lower.set_xlabel("selected samples")
        for axes in (upper, lower):
            axes.set_yscale("log")
            legend_above(axes, columns=2)

    caption = (
        f"Figure 5. Condition number (above) and smallest and largest singular value (below) after each sample taken "
        f"from {selections[0].input_name('flight')}. The curve begins where the selection reaches full rank; a cross "
        "is the median of random choices of equal size."
    )
    return plot(name, caption, "Condition number over the number of selected samples, on a log scale", 5.0, draw)


def _draw_condition(axes: Axes, selection: Source[SelectionRecord], index: int) -> None:
    record, trace = selection.record, selection.record.trace.condition_number
    label = f"{record.criterion}, {len(trace)} samples{', rank deficient' if record.deficient else ''}"
    known = np.where(np.isfinite(trace), trace, np.nan)
    axes.plot(_sizes(trace), known, label=label, **style_of(index))
    random = record.random_median
    if np.isfinite(random):
        word = "random choice" if index == 0 else None
        axes.plot([len(trace)], [random], "x", color=style_of(index)["color"], markersize=7, label=word)


def _draw_singular_values(axes: Axes, selection: Source[SelectionRecord], index: int) -> None:
    colour = style_of(index)["color"]
    trace = selection.record.trace
    curves = ((trace.singular_value_max, "largest", "-"), (trace.singular_value_min, "smallest", (0, (4, 1.5))))
    for values, word, dashes in curves:
        shown = np.where(values > 0, values, np.nan)
        label = word if index == 0 else None
        axes.plot(_sizes(values), shown, color=colour, linestyle=dashes, label=label)


def _sizes(trace: Array) -> Array:
    """Count the samples that are selected at each point of a curve."""
    return np.arange(1, len(trace) + 1, dtype=float)
