"""The reproduction of the paper: its claims one by one, and its figures next to those of the page."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from benchmarks.paper.claims import (
    CONTINUITY_CLAIM,
    CONTRIBUTION_CLAIM,
    DECOMPOSITION_TIME_CLAIM,
    EVALUATION_TIME_CLAIM,
    FLOOR_CLAIM,
    MOVE_CLAIM,
    RELATIVE_ERROR_CLAIM,
    Claim,
    ClaimVerdict,
    Measurement,
    PaperSources,
)
from benchmarks.paper.printed import (
    LEAST_TORQUE,
    PRINTED_BREAKPOINTS,
    PRINTED_RELATIVE_ERROR,
    PRINTED_SEESAW,
    PRINTED_WEIGHTS,
    SMALLEST_MAX_ERROR,
    TABLE_4,
)
from benchmarks.paper.readings import readings_blocks
from benchmarks.paper.search_claims import (
    CLASSIC_CLAIM,
    CONVERGENCE_CLAIM,
    RANKING_CLAIM,
    REDUCED_CLAIMS,
    SMALLER_SEARCH_CLAIM,
    TYPICAL_CONDITION_CLAIM,
    TYPICAL_ERRORS_CLAIM,
)
from cpfls_cli.flightlog.results import MOTION
from cpfls_cli.flights.prediction import AlongFlight
from cpfls_cli.fuzzy.basis import breakpoints, seesaw
from cpfls_cli.identification.data import TRAINING
from cpfls_cli.identification.findings import AXES
from cpfls_cli.identification.identify import MODEL
from cpfls_cli.regressor.regressor import Motion
from cpfls_cli.report.canvas import line, plot, stacked, style_of
from cpfls_cli.report.content import (
    UNKNOWN,
    Block,
    Cell,
    Folded,
    Plot,
    Section,
    Table,
    Text,
    Tone,
    change,
    number,
    percent,
)
from cpfls_cli.report.source import Source

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CLAIMS: tuple[Claim, ...] = (
    RELATIVE_ERROR_CLAIM,
    TYPICAL_ERRORS_CLAIM,
    TYPICAL_CONDITION_CLAIM,
    *REDUCED_CLAIMS,
    SMALLER_SEARCH_CLAIM,
    CONVERGENCE_CLAIM,
    RANKING_CLAIM,
    CLASSIC_CLAIM,
    CONTINUITY_CLAIM,
    EVALUATION_TIME_CLAIM,
    DECOMPOSITION_TIME_CLAIM,
    CONTRIBUTION_CLAIM,
    FLOOR_CLAIM,
    MOVE_CLAIM,
)
"""The claims of the paper, in the order of the questions that a reader has."""

Agreement = Literal["agrees", "differs", "read as printed", "cannot be compared", "not shown"]

_TONES: dict[ClaimVerdict, Tone] = {
    ClaimVerdict.PASS: "good",
    ClaimVerdict.FAIL: "warning",
    ClaimVerdict.UNDECIDED: "note",
    ClaimVerdict.NOT_MEASURED: "note",
}
_GENES = 4
_DRAWN = TABLE_4[2]
_PRECISION = 1e-5
"""One unit in the last digit of the printed breakpoints."""

_Measured = Sequence[tuple[Claim, Measurement]]


def reproduction_section(sources: PaperSources) -> Section:
    """Check the claims of sections 8, 10 and 11 of the paper and compare its Figures 1 to 7."""
    measured = [(claim, claim.measure(sources)) for claim in CLAIMS]
    answer, grounds = readings_blocks(sources, CLAIMS)
    blocks: list[Block] = [
        Text(_count(measured), "note"),
        *answer,
        _claims(measured),
        *grounds,
        _rules(),
        _figures(compared_figures(sources)),
        seesaw_figure("figure-1-seesaw"),
        *(_error_figure("figure-7-error", *own) for own in _along_own_flights(sources)[:1]),
    ]
    return Section("reproduction", "Reproduction of the paper", blocks)


def _count(measured: _Measured) -> str:
    counts = Counter(measurement.verdict for _, measurement in measured)
    shown = ", ".join(f"{counts[verdict]} {verdict}" for verdict in ClaimVerdict if counts[verdict])
    return (
        f"{len(measured)} claims of the paper: {shown}. The rules were set before anything was measured. UNDECIDED: "
        "the seeds do not settle it. NOT MEASURED: the line says what is missing and what makes it."
    )


def _claims(measured: _Measured) -> Table:
    rows: list[list[str | Cell]] = [
        [
            f"{claim.name}: “{claim.words}” ({claim.where})",
            Cell(measurement.verdict, _TONES[measurement.verdict]),
            measurement.ours,
            claim.paper,
            measurement.why,
        ]
        for claim, measurement in measured
    ]
    header = ("Claim, in the paper's words", "Verdict", "Ours", "Paper's", "Why")
    every = frozenset(range(len(header)))
    return Table("claims", "The claims of the paper, one by one.", header, rows, every, every - {1})


def _rules() -> Folded:
    table = Table(
        "claim-rules",
        "How each claim is measured. Mean squared errors are of the whole training part.",
        ("Claim", "Measured, and what passes"),
        [[claim.name, claim.rule] for claim in CLAIMS],
        frozenset({0, 1}),
        frozenset({1}),
    )
    return Folded("What is measured for each claim, and what passes", [table])


@dataclass(frozen=True)
class ComparedFigure:
    """A figure of the paper and ours: what the paper's text says of it in numbers, and the same of ours.

    Read as printed: the paper's own numbers, decoded as here, agree with each other. It says nothing of any model.
    """

    title: str
    paper: str
    ours: str
    agreement: Agreement
    why: str


def compared_figures(sources: PaperSources) -> list[ComparedFigure]:
    """Compare Figures 1 to 7 with what the paper's text says of its own."""
    return [
        seesaw_compared(),
        _derivatives_compared(sources),
        _attitude_compared(sources),
        _torque_compared(sources),
        _reduction_compared(sources),
        partitions_compared(),
        _error_compared(sources),
    ]


def _figures(figures: Sequence[ComparedFigure]) -> Table:
    rows: list[list[str | Cell]] = [
        [f"Figure {f.title}", f.paper, f.ours, Cell(f.agreement, "plain" if f.agreement == "agrees" else "note"), f.why]
        for f in figures
    ]
    header = ("Figure", "The paper's text", "Ours", "Agreement", "Why")
    caption = (
        "The figures of the paper beside those of this page that have their numbers. The paper gives pictures and no "
        "data, so what is compared is what its text says of them."
    )
    every = frozenset(range(len(header)))
    return Table("figures-of-the-paper", caption, header, rows, every, every - {3})


def _agreement(agrees: bool) -> Agreement:
    return "agrees" if agrees else "differs"


def _reading(agrees: bool) -> Agreement:
    """Tell whether printed numbers agree with each other as they are decoded here, whatever was identified."""
    return "read as printed" if agrees else "differs"


def _not_shown(title: str, printed: str, why: str) -> ComparedFigure:
    return ComparedFigure(title, printed, UNKNOWN, "not shown", why)


def seesaw_compared() -> ComparedFigure:
    """Compare Figure 1: the seesaw."""
    angles, printed = np.pi * np.array(list(PRINTED_SEESAW)), np.array(list(PRINTED_SEESAW.values()))
    off = float(np.max(np.abs(seesaw(angles)[0] - printed)))
    agrees = off < 1e-12
    why = (
        "A check of how the paper is read, not of any model. Equation (11) as printed has a condition that no angle "
        "meets (3π/2 < q > π/2); read as between them it is this curve."
    )
    values = ", ".join(f"{value:g} at {angle:g}π" for angle, value in PRINTED_SEESAW.items())
    return ComparedFigure("1: seesaw", values, f"largest difference {number(off, 2)}", _reading(agrees), why)


def _derivatives_compared(sources: PaperSources) -> ComparedFigure:
    """Compare Figure 2: the derivatives of the base move."""
    move = MOVE_CLAIM.measure(sources)
    printed = "peaks 2π, 2, 1, 1, 2, 8, 64; 16 s; integral of |jerk| 8 m/s²"
    title = "2: pop to displacement"
    if move.verdict == ClaimVerdict.NOT_MEASURED:
        return _not_shown(title, printed, move.why)
    agrees = move.verdict == ClaimVerdict.PASS
    why = (
        "The move is defined in full, with all its numbers."
        if agrees
        else "The path is planned under other limits than P = 1 s."
    )
    return ComparedFigure(title, printed, f"largest difference {move.ours}", _agreement(agrees), why)


def _attitude_compared(sources: PaperSources) -> ComparedFigure:
    """Compare Figure 3: roll and pitch."""
    title, printed = "3: roll and pitch", "about 55 s; no angle in the text"
    moving = [trajectory.record for trajectory in sources.trajectories if trajectory.record.position is not None]
    if not moving:
        return _not_shown(title, printed, "Missing: a trajectory.")
    time, attitude = moving[0].time, np.degrees(moving[0].attitude)
    largest = np.max(np.abs(attitude[:, :2]), axis=0)
    ours = f"{time[-1] - time[0]:.2f} s; up to {largest[0]:.1f}° and {largest[1]:.1f}°"
    why = (
        "The paper gives the moves, the yaw turn and the number of samples, but neither the number of moves nor their "
        "pauses; equation (18) is used in its physical form, as the printed one lacks a square root."
    )
    return ComparedFigure(title, printed, ours, "cannot be compared", why)


def _torque_compared(sources: PaperSources) -> ComparedFigure:
    """Compare Figure 4: the torques."""
    title = "4: torques"
    printed = f"more than {number(LEAST_TORQUE, 2)} N m (an error of {SMALLEST_MAX_ERROR} N m is below 10 %)"
    torques = [flight.record.torque for flight in sources.flights if flight.record.torque is not None]
    if not torques:
        return _not_shown(title, printed, "Missing: a flight.")
    largest = float(np.max(np.abs(torques[0])))
    agrees = largest > LEAST_TORQUE
    why = (
        "Along the printed path the vehicle of Table 3 tilts little and needs little torque; where the paper's larger "
        "torques come from it does not say, so only relative errors can be compared."
    )
    return ComparedFigure(title, printed, f"up to {number(largest, 2)} N m", _agreement(agrees), "" if agrees else why)


def _reduction_compared(sources: PaperSources) -> ComparedFigure:
    """Compare Figure 5: the condition number while samples are chosen."""
    title = f"5: condition number, {_DRAWN.samples} samples"
    printed = f"{_DRAWN.condition_number}, {change(_DRAWN.change)} against all samples"
    fitting = [source.record for source in sources.selections if len(source.record.indices) == _DRAWN.samples]
    if not fitting:
        return _not_shown(title, printed, f"Missing: a selection of {_DRAWN.samples} samples.")
    condition, full = fitting[0].condition_number, fitting[0].condition_number_full
    grown = condition / full - 1.0
    agrees = abs(grown - _DRAWN.change) < PRINTED_RELATIVE_ERROR
    why = (
        "The curve falls to a level and stays there; the level is another than the paper's, because the path and "
        "so the full set is, and because nothing keeps a reduced set from being better conditioned than the full one."
    )
    return ComparedFigure(title, printed, f"{number(condition, 5)}, {change(grown)}", _agreement(agrees), why)


def partitions_compared() -> ComparedFigure:
    """Compare Figure 6: the printed partitions with the printed weights, as they are decoded here."""
    weights = np.array(PRINTED_WEIGHTS, dtype=float).reshape(-1, _GENES)
    decoded = np.concatenate([breakpoints(row)[1:-1] for row in weights])
    off = float(np.max(np.abs(decoded - PRINTED_BREAKPOINTS)))
    agrees = off <= _PRECISION
    why = (
        "A check of how the paper is read, not of any model: its printed weights, decoded as here, give its printed "
        "breakpoints. Partitions of our models come from other searches on another flight and need not be equal."
    )
    printed = "18 breakpoints of 24 printed weights"
    ours = f"the paper's weights, decoded: largest difference {number(off, 1)}"
    return ComparedFigure("6: partitions", printed, ours, _reading(agrees), why)


def _along_own_flights(sources: PaperSources) -> list[tuple[Source, Source]]:
    """List models with the flights that they learned from, where both are given."""
    pairs = ((model, sources.by_hash(model.made_from("flight"))) for model in sources.models)
    return [(model, flight) for model, flight in pairs if flight is not None]


def _error_compared(sources: PaperSources) -> ComparedFigure:
    """Compare Figure 7: the torque error."""
    title, printed = "7: torque error", "below 10 % of the torque along the training path"
    shown = _along_own_flights(sources)
    if not shown:
        return _not_shown(title, printed, "Missing: a model and the flight that it learned from.")
    largest, axis = shown[0][0].record.judged.worst(MODEL, TRAINING)
    agrees = largest < PRINTED_RELATIVE_ERROR
    why = "Relative to the largest torque of each axis; the absolute errors belong to torques of other sizes."
    return ComparedFigure(title, printed, f"at most {percent(largest, 2)} ({axis})", _agreement(agrees), why)


def _error_figure(name: str, model: Source, flight: Source) -> Plot:
    """Draw Figure 7: the torque error of a model along a flight."""
    own = flight.record
    motion = Motion(*(own.signals[each] for each in MOTION))
    error = AlongFlight.of(model.record.functions, own.time, motion, own.torque, None).error

    def draw(figure: Figure) -> None:
        panels = stacked(figure, len(AXES))
        for index, (axes, axis) in enumerate(zip(panels, AXES, strict=True)):
            line(axes, own.time, error[:, index], **style_of(0))
            axes.set_title(f"error on {axis}")
            axes.set_ylabel("N m")
        panels[-1].set_xlabel("time, s")

    caption = f"Figure 7. Torque error (flight minus model) of {model.label} along {flight.label}."
    return plot(name, caption, "Torque error on roll, pitch and yaw over time", 4.6, draw)


def seesaw_figure(name: str) -> Plot:
    """Draw Figure 1: the piecewise linear seesaw of equation (11) over two turns, with the values that are printed."""
    half_turns = np.linspace(-1.0, 3.0, 801)

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        line(axes, half_turns, seesaw(np.pi * half_turns)[0], **style_of(0))
        axes.plot(list(PRINTED_SEESAW), list(PRINTED_SEESAW.values()), "o", color=style_of(1)["color"])
        axes.set_xlabel("angle, π rad")
        axes.set_ylabel("seesaw")

    caption = (
        "Figure 1. The seesaw of equation (11) over two turns: equal where an angle and 2π meet. Dots: the values that "
        "the equation prints at the quarters of a turn. It takes each value twice in a turn."
    )
    return plot(name, caption, "A triangle wave between -1 and 1 over two turns", 2.3, draw)
