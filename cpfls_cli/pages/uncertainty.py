"""How sure the inertia of models is: bands of D(q) over attitude and of the inertia parameters."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, runs
from cpfls_cli.artifacts.identified import IdentifiedModel
from cpfls_cli.inertia import INERTIA_PARAMETERS
from cpfls_cli.pages.source import Source
from cpfls_cli.report.canvas import BASELINE, band, legend_over, named, plain_ticks, plot, style_of
from cpfls_cli.report.content import Block, Cell, Heading, Plot, Table, Text
from cpfls_cli.report.numbers import number, percent, printed, with_interval
from cpfls_cli.validation.bands import band as interval
from cpfls_cli.validation.bootstrap import Draws
from cpfls_cli.validation.validate import Curves, RoundTrip

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

OUTSIDE_WORDS = "Where training was not, a band says what the structure does, not what the vehicle does."
"""What a band is where training was not."""

MISFIT_WORDS = "Where the errors are misfit of the structure and not noise, a band need not hold the truth."
"""What a band leaves out."""

_ENTRIES = ("D22", "D33", "D23", "D11", "D12", "D13")
_COLUMNS = 3
_AGAIN = {**style_of(1), "linewidth": 1.2}
_VISITED = "#eef3e6"
_ROOM = 0.6
_LEAST = 0.02
_SAME = 1e-9
_BAND = "95 % band of"


def uncertainty_blocks(model: Source[IdentifiedModel], index: int) -> Iterator[Block]:
    """Show the bands of a model, where it holds any."""
    record = model.record
    yield Heading(model.label)
    if record.uncertainty is not None:
        yield _parameters(model, record.uncertainty, index)
    if record.curves is not None:
        for curve in range(len(record.curves.name)):
            yield inertia_curves_figure(
                f"inertia-curves-{index}-{curve + 1}", model.label, record.curves, curve, record.round_trip
            )
    if record.round_trip is not None:
        yield Text(_round_trip_sentence(record.round_trip))


def _parameters(model: Source[IdentifiedModel], draws: Draws, index: int) -> Table:
    record = model.record
    pairs = [(record.rigid_body, draws.best_rigid_body)]
    pairs += [(record.functions.rigid_body, draws.rigid_body)] if record.on_rigid_body else []
    columns = [(value, *interval(value, drawn, draws.blocks)) for value, drawn in pairs]
    stated = [*model.vehicle.inertia_kg_m2, *[0.0] * 6][:6]
    rows: list[list[str | Cell]] = []
    for parameter, name in enumerate(INERTIA_PARAMETERS):
        cells = []
        for column in columns:
            middle, *ends = map(printed, with_interval(*(float(side[parameter]) for side in column)))
            cells.append(f"{middle} ({' … '.join(ends)})")
        low, high = float(columns[0][1][parameter]), float(columns[0][2][parameter])
        inside = low <= stated[parameter] <= high
        conclusion = Cell("inside" if inside else "outside ◂", "plain" if inside else "warning")
        rows.append([name, number(stated[parameter]), *cells, conclusion])
    under = ["Under the fuzzy part"] if record.on_rigid_body else []
    header = ["kg m²", "Stated in the config", "Rigid body that fits best", *under, "Stated value"]
    caption = (
        f"Inertia parameters of {model.label} with 95 % intervals, from a bootstrap of {draws.blocks} contiguous "
        f"blocks of {number(draws.block_duration, 2)} s. The last column says whether the stated value lies in the "
        "interval of the rigid body that fits best."
    )
    last = len(header) - 1
    words, sentences = frozenset({0, last}), frozenset(range(2, last))
    return Table(f"inertia-bands-{index}", caption, header, rows, words, sentences)


def _round_trip_sentence(round_trip: RoundTrip) -> str:
    shares = [(entry, float(_entry_of(round_trip.inside, entry))) for entry in _ENTRIES]
    shown = ", ".join(f"{entry} {percent(share)}" for entry, share in shares if np.isfinite(share))
    return (
        "Round trip: the model was simulated along its training motion, with errors as large as its own, and "
        "identified again (dashed). Share of the visited points where that lies within the band: "
        f"{shown or 'none was visited'}. About 95 % is what a band of 95 % promises; much less says that the band is "
        "too narrow."
    )


def inertia_curves_figure(name: str, label: str, curves: Curves, curve: int, round_trip: RoundTrip | None) -> Plot:
    """Draw the six entries of D(q) along one curve of attitudes, with what a second identification gave."""
    word = curves.name[curve]
    again = None if round_trip is None else round_trip.inertia[curve]

    def draw(figure: Figure) -> None:
        panels = _panels(figure, word)
        for axes, entry in zip(panels, _ENTRIES, strict=True):
            _draw_entry(axes, curves, curve, entry, again)
        legend_over(figure, panels[0])

    values, rigid = curves.inertia[curve], curves.rigid_body[curve]
    is_same = np.allclose(values, rigid, rtol=0.0, atol=_SAME * float(np.abs(rigid).max(initial=0.0)), equal_nan=True)
    same = " This model is that rigid body, so the grey line lies under its own." if is_same else ""
    dashed = " Dashed: identified again from a simulation of the model itself." if again is not None else ""
    caption = (
        f"D(q) of {label} {word}, with 95 % bands; grey: the rigid body that fits best. Shaded green: where "
        f"training was. {OUTSIDE_WORDS} {MISFIT_WORDS}{same}{dashed}"
    )
    return plot(name, caption, f"Six entries of the inertia matrix {word}, with bands", 4.5, draw)


def _panels(figure: Figure, word: str) -> list[Axes]:
    """Make a plot for each entry of D(q)."""
    panels = figure.subplots(len(_ENTRIES) // _COLUMNS, _COLUMNS, sharex=True)
    for axes, entry in zip(panels.flat, _ENTRIES, strict=True):
        axes.set_title(entry)
        plain_ticks(axes.yaxis)
    panels[-1, 1].set_xlabel(f"{word.removeprefix('over ')}, °")
    figure.supylabel("kg m²", fontsize=9.5)
    return list(panels.flat)


def _entry_of(values: Array, entry: str) -> Array:
    """Take an entry such as D23 out of matrices of shape (..., 3, 3)."""
    return np.asarray(values[..., int(entry[1]) - 1, int(entry[2]) - 1])


def _keep_scale(axes: Axes, shown: Sequence[Array], curves: Sequence[Curves]) -> None:
    """Show some values in full and no more: a band that opens where training was not would flatten everything."""
    # Of the whole matrices, so that rounding of an entry that is zero is not drawn large.
    largest = max(float(np.abs(each.inertia).max(initial=1e-12)) for each in curves)
    known = np.concatenate([curve[np.isfinite(curve)] for curve in shown])
    if known.size:
        low, high = float(known.min()), float(known.max())
        room = max(_ROOM * (high - low), _LEAST * largest) / 2
        axes.set_ylim(low - room, high + room)


def _along(curves: Curves, curve: int, entry: str) -> tuple[Array, BoolArray, Array, Array, Array, Array]:
    """Give along a curve its angle in degrees, where training was, an entry of D(q), its band and the rigid body's."""
    attitude = np.degrees(curves.attitude[curve])
    angle = attitude[:, int(np.argmax(np.ptp(attitude, axis=0)))]
    matrices = (curves.inertia, curves.low, curves.high, curves.rigid_body)
    values, low, high, rigid = (_entry_of(matrix[curve], entry) for matrix in matrices)
    return angle, ~curves.outside[curve], values, low, high, rigid


def _draw_entry(axes: Axes, curves: Curves, curve: int, entry: str, again: Array | None) -> None:
    from matplotlib.ticker import MaxNLocator

    angle, visited, values, low, high, rigid = _along(curves, curve, entry)
    for first, after in runs(visited):
        axes.axvspan(angle[first], angle[after - 1], color=_VISITED, label="training was here", zorder=0)
    band(axes, angle, low, high, color="#9db8d6", alpha=0.7, label="95 % band")
    axes.plot(angle, rigid, label="rigid body", **{**BASELINE, "linewidth": 1.6})
    axes.plot(angle, values, label="model", **{**style_of(0), "linewidth": 1.6})
    if again is not None:
        axes.plot(angle, _entry_of(again, entry), label="identified again", **_AGAIN)
    axes.set_xlim(angle[0], angle[-1])
    axes.xaxis.set_major_locator(MaxNLocator(5, steps=[1, 1.5, 2, 3, 4.5, 5, 6, 9, 10]))
    _keep_scale(axes, [rigid, values, low[visited], high[visited]], [curves])


def compared_curves_figure(name: str, models: Sequence[tuple[str, Curves]], word: str) -> Plot:
    """Draw the six entries of D(q) of several models along their curves "over roll" or "over pitch"."""

    def draw(figure: Figure) -> None:
        panels = _panels(figure, word)
        for axes, entry in zip(panels, _ENTRIES, strict=True):
            shown = [_draw_model(axes, *model, index, entry, word) for index, model in enumerate(models)]
            _keep_scale(axes, shown, [curves for _, curves in models])
        curves = [(handle, label) for handle, label in zip(*named(panels[0]), strict=True) if _BAND not in label]
        figure.legend(*zip(*curves, strict=True), loc="outside upper left", ncols=3)

    caption = (
        f"D(q) of {', '.join(label for label, _ in models)} {word}, each with its 95 % band, along the attitudes that "
        "its own training visited; grey: the rigid body that fits best to the first. Where two bands do not overlap, "
        f"the flights tell the models apart. {OUTSIDE_WORDS} {MISFIT_WORDS}"
    )
    return plot(name, caption, f"Six entries of the inertia matrices of several models {word}", 4.6, draw)


def _draw_model(axes: Axes, label: str, curves: Curves, index: int, entry: str, word: str) -> Array:
    """Draw one model; give the values that must be seen in full."""
    curve = curves.name.index(word)
    angle, visited, values, low, high, rigid = _along(curves, curve, entry)
    style = style_of(index)
    band(axes, angle, low, high, color=style["color"], alpha=0.16, label=f"{_BAND} {label}")
    axes.plot(angle, values, label=label, **{**style, "linewidth": 1.6})
    if index == 0:
        axes.plot(angle, rigid, label="rigid body", **BASELINE)
    return np.concatenate([values, low[visited], high[visited]])
