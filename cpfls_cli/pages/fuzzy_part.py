"""The fuzzy part of models: its partitions and coefficients, and the rules excited."""

from __future__ import annotations

from collections.abc import Iterator
from math import ceil
from typing import TYPE_CHECKING, Literal

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.identified import IdentifiedModel
from cpfls_cli.dynamics.inertia_functions import InertiaFunctions
from cpfls_cli.fuzzy.membership import join_ends, memberships
from cpfls_cli.inertia import INERTIA_PARAMETERS
from cpfls_cli.pages.source import Source
from cpfls_cli.report.canvas import in_columns, plot, style_of
from cpfls_cli.report.content import Block, Facts, Folded, Heading, Plot, Table, Text
from cpfls_cli.report.numbers import count, number, percent

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_POINTS = np.linspace(0.0, 1.0, 401)
_COLUMNS = 2
_CLOSE = 0.05


def partitions_blocks(model: Source[IdentifiedModel], index: int) -> Iterator[Block]:
    """Show the partitions of a model (Figure 6 of the paper) and its parameters."""
    record = model.record
    if record.fuzzy_part_off:
        yield Text(f"The fuzzy part of {model.label} is off: no membership function takes part in it.", "note")
    elif max(len(peaks) for peaks in _breakpoints(record.functions).values()) > 1:
        yield partitions_figure(f"figure-6-partitions-{index}", model)
    else:
        yield Text(f"{model.label} has one rule per input: its one membership function is 1 everywhere.", "note")
    yield Folded(f"Chromosome, breakpoints, inertia and coefficients of {model.label}", list(_tables(record, index)))


def _breakpoints(model: InertiaFunctions) -> dict[str, Array]:
    """Group the breakpoints of a model by partition."""
    return {own.name: peaks for own, peaks in zip(model.structure.partitions, model.partitions, strict=True)}


def _tables(record: IdentifiedModel, index: int) -> Iterator[Table]:
    weights = [count(weight) for weight in record.weights]
    rows = []
    for name, peaks in _breakpoints(record.functions).items():
        genes, weights = weights[: len(peaks) - 1], weights[len(peaks) - 1 :]
        rows.append([name, " ".join(genes), " ".join(number(float(peak), 5) for peak in peaks)])
    header: tuple[str, ...] = ("Partition", "Weights (16 bit)", "Breakpoints")
    yield Table(f"chromosome-{index}", "Chromosome and the partitions that it encodes.", header, rows)
    rows = [
        [name, number(float(under)) if record.on_rigid_body else "none", number(float(alone))]
        for name, under, alone in zip(INERTIA_PARAMETERS, record.functions.rigid_body, record.rigid_body, strict=True)
    ]
    header = ("kg m²", "Under the fuzzy part", "Rigid body alone")
    yield Table(f"inertia-{index}", "Inertia found by least squares.", header, rows)
    coefficients = zip(record.functions.structure.parameter_names, record.functions.coefficients, strict=True)
    rows = [[name, number(float(value), 5)] for name, value in coefficients]
    caption = "Coefficients of the rule consequents, kg m²."
    yield Table(f"coefficients-{index}", caption, ("Coefficient", "Value"), rows)


def rules_blocks(model: Source[IdentifiedModel], index: int) -> Iterator[Block]:
    """Show what of a model the data determine."""
    record, rules = model.record, model.record.rules
    yield Heading(model.label)
    yield Facts(
        [
            ("Rules excited", f"{int(np.sum(rules.excited))} of {len(rules.name)}"),
            ("Rank of the solved system", f"{record.rank} of {len(record.singular_values)}"),
            ("Condition number", f"{number(record.condition_number, 5)} over the kept singular values"),
        ]
    )
    if rules.excited.all():
        yield Text("Every rule fires in training, and the data determine most of its coefficients.")
        return
    rows = [
        [rules.name[rule], number(float(rules.firing[rule]), 3), percent(float(rules.determined[rule]))]
        for rule in np.flatnonzero(~rules.excited)
    ]
    caption = (
        "Rules that are not excited: largest firing strength in training, and the share of the rule's coefficients "
        "that the data determine. What the model says there is not learned."
    )
    if model.record.fuzzy_part_off:
        caption += " The fuzzy part is off, so the model uses none of them."
    yield Table(f"silent-rules-{index}", caption, ("Rule", "Largest firing", "Determined"), rows)


def partitions_figure(name: str, model: Source[IdentifiedModel]) -> Plot:
    """Draw the membership functions (equation 8) of all partitions: Figure 6 of the paper."""
    partitions = _breakpoints(model.record.functions)
    joined = model.config["identification"]["structure"] == "cpfls"
    rows = ceil(len(partitions) / _COLUMNS)

    def draw(figure: Figure) -> None:
        panels = in_columns(figure, len(partitions), _COLUMNS, share_y=True)
        for axes, (title, peaks) in zip(panels.flat, partitions.items(), strict=False):
            _draw_partition(axes, peaks, joined)
            axes.set_title(title)
        for axes in panels[:, 0]:
            axes.set_ylabel("membership")
        for axes in panels[-1]:
            axes.set_xlabel("input, scaled to 0 .. 1")

    circle = "; the first and the last are one function (1), which closes the circle" if joined else ""
    caption = f"Figure 6. Membership functions of the partitions of {model.label}, numbered at their peaks{circle}."
    return plot(name, caption, "Membership functions of each fuzzy partition on the interval 0 to 1", 1.75 * rows, draw)


def _draw_partition(axes: Axes, peaks: Array, joined: bool) -> None:
    # The peaks themselves belong to the grid, or a narrow function would lose its top.
    points = np.union1d(_POINTS, peaks)
    values = memberships(points, peaks).value
    values = join_ends(values) if joined else values
    for function in range(values.shape[1]):
        axes.plot(points, values[:, function], **style_of(function))
    axes.set_ylim(0.0, 1.18)
    axes.set_yticks([0.0, 0.5, 1.0])
    for index, peak in enumerate(peaks):
        function_number = index % values.shape[1] + 1
        colour = style_of(function_number - 1)["color"]
        axes.text(peak, 1.03, str(function_number), ha=_side(peaks, index), fontsize=8, color=colour)


def _side(peaks: Array, index: int) -> Literal["left", "center", "right"]:
    """Keep the numbers of two close peaks apart."""
    if index + 1 < len(peaks) and peaks[index + 1] - peaks[index] < _CLOSE:
        return "right"
    return "left" if index > 0 and peaks[index] - peaks[index - 1] < _CLOSE else "center"
