"""Table 4 and Figure 5: what the reduced training sets keep."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from cpfls_cli.report.content import Block, Cell, Section, Table, Text
from cpfls_cli.report.figures.reduction import reduction_figure
from cpfls_cli.report.numbers import change, count, number, percent
from cpfls_cli.report.printed import TABLE_4
from cpfls_cli.report.source import Source, Sources

_HEADER = (
    "Set",
    "Samples",
    "Share",
    "Rank",
    "Condition number",
    "Change",
    "Random choice of equal size",
)
_PAPER = ("Paper: condition number", "Paper: change")
_Row = list[str | Cell]


def reduction_section(sources: Sources) -> Section | None:
    """Show the reduced training sets, beside the paper's where that is asked for.

    Returns
    -------
    Section or None
        None where no selection was given.

    References
    ----------
    Table 4 and Figure 5 of the paper.
    """
    if not sources.selections:
        return None
    blocks: list[Block] = list(_deficient(sources))
    blocks += [_table(sources), *_comments(sources)]
    flights = list(dict.fromkeys(selection.made_from("flight") for selection in sources.selections))
    for index, flight in enumerate(flights, start=1):
        group = [selection for selection in sources.selections if selection.made_from("flight") == flight]
        blocks.append(reduction_figure(f"figure-5-reduction-{index}", group))
    return Section("reduction", "Reduced training set", blocks)


def _deficient(sources: Sources) -> Iterator[Text]:
    for selection in sources.selections:
        rank, full = (int(selection.artifact.number(key)) for key in ("rank", "rank_full"))
        if rank < full:
            yield Text(
                f"{selection.label} is rank deficient: rank {rank}, where all samples reach {full}. Do not train "
                "on it; use another criterion or more samples.",
                "warning",
            )
        if full < selection.parameters:
            yield Text(
                f"The flight behind {selection.label} determines only {full} of {selection.parameters} parameters, "
                "however many samples are kept: condition numbers cover the determined directions only.",
                "warning",
            )


def _table(sources: Sources) -> Table:
    ours = [row for selection in sources.selections for row in _rows(selection)]
    # Selections from one flight share its full set, which then stands once.
    ours = [row for place, row in enumerate(ours) if row not in ours[:place]]
    rows = _beside_the_paper(ours) if sources.settings.paper else ours
    caption = (
        "Table 4. Condition number of the regressor with uniform partitions, all samples against reduced sets. Change "
        "is against the full set of the same flight; random is the median of random choices."
    )
    header = (*_HEADER, *(_PAPER if sources.settings.paper else ()))
    return Table("table-4-reduction", caption, header, rows)


def _beside_the_paper(ours: list[_Row]) -> list[_Row]:
    """Add the printed columns by number of samples, largest sets first; those that nobody repeats stand alone."""
    printed = {str(column.samples): [str(column.condition_number), change(column.change)] for column in TABLE_4}
    found = {_samples(row) for row in ours}
    rows = [[*row, *printed.get(_samples(row), ["", ""])] for row in ours]
    full = TABLE_4[0].samples
    rows += [
        [f"Paper, {'full set' if int(samples) == full else 'reduced'}", samples, percent(int(samples) / full), "", "",
         "", "", *columns]
        for samples, columns in printed.items() if samples not in found
    ]  # fmt: skip
    return sorted(rows, key=lambda row: -int(_samples(row)))


def _samples(row: _Row) -> str:
    return str(row[1])


def _rows(selection: Source) -> Iterator[_Row]:
    artifact = selection.artifact
    candidates, kept = artifact.number("candidates"), len(artifact.array("indices"))
    condition, full = artifact.number("condition_number"), artifact.number("condition_number_full")
    rank, rank_full = artifact.number("rank"), artifact.number("rank_full")
    yield [
        f"{selection.input_name('flight')}, full set",
        count(candidates),
        "100 %",
        f"{count(rank_full)} of {selection.parameters}",
        number(full, 5),
        "",
        "",
    ]
    yield [
        f"{selection.label}, {artifact.text('criterion')}",
        str(kept),
        percent(kept / candidates if candidates else float("nan")),
        Cell(f"{count(rank)} of {selection.parameters}", "warning" if rank < rank_full else "plain"),
        number(condition, 5),
        change(condition / full - 1) if rank == rank_full else "not comparable",
        number(_random(selection), 5),
    ]


def _random(selection: Source) -> float:
    draws = selection.artifact.array("random/condition_number")
    return float(np.median(draws)) if len(draws) else float("nan")


def _comments(sources: Sources) -> Iterator[Text]:
    for selection in sources.selections:
        artifact = selection.artifact
        condition, full = artifact.number("condition_number"), artifact.number("condition_number_full")
        if artifact.number("rank") < artifact.number("rank_full"):
            continue
        if condition < full:
            yield Text(
                f"{selection.label} is better conditioned than the full set: the paper's floor, that a reduced set "
                "cannot be, does not hold."
                if sources.settings.paper
                else f"{selection.label} is better conditioned than the full set."
            )
        if condition >= _random(selection):
            yield Text(f"{selection.label} is no better than a random choice of equal size.", "warning")
