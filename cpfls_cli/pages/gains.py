"""The page of gains: what they give with the vehicle, beside those of today, and where each number stands."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from cpfls_cli.artifacts.gains import DEFAULT, PROPOSED, GainsRecord, ParameterRow
from cpfls_cli.pages.source import Source
from cpfls_cli.report.canvas import BASELINE, GREY, band, legend_over, line, logarithmic, plain_ticks, plot, style_of
from cpfls_cli.report.content import Block, Box, Cell, Facts, Folded, Heading, Plot, Table, Text
from cpfls_cli.report.numbers import number, percent, sentence
from cpfls_cli.words import joined

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_BESIDE = {"today": "today's", DEFAULT: "the defaults"}
_PROPOSED: dict[str, Any] = {**style_of(0), "linewidth": 1.8, "zorder": 3}
_OTHER: dict[str, Any] = {"color": GREY, "linewidth": 1.4, "linestyle": "--", "zorder": 2}
_WORST: dict[str, Any] = {**style_of(1), "linewidth": 1.0, "zorder": 2.5}
_SHOWN_DB = (-40.0, 40.0)


def answer(gains: Source[GainsRecord], index: int = 1) -> Iterator[Block]:
    """Say what the gains give, whether they hold the margins, and how today's compare."""
    record = gains.record
    yield gains_box(record)
    yield _margins(record, index)
    yield from (Text(words, "warning") for words in record.warning)
    yield Folded("each parameter, today's value beside it", [_parameters(record, index)], shown=True)


def gains_box(record: GainsRecord) -> Box:
    """Say first what is proposed and whether it is as asked."""
    own, short = record.set_of.index(PROPOSED), record.falls_short(PROPOSED)
    fast = joined(f"{name} {number(float(record.bandwidth[own, axis]), 2)} Hz" for axis, name in enumerate(record.axis))
    title = f"{record.title}: the angle follows to {fast}"
    asked = f"disk {number(record.required, 3)}°"
    if short:
        told = f"{joined(short)}: less than the asked margin ({asked}) with some of {record.possible}"
    else:
        told = f"all axes keep the asked margin ({asked}) with {record.possible}"
    return Box("GAINS", sentence(title), [sentence(told), sentence(_beside(record))], "warning" if short else "good")


def _beside(record: GainsRecord) -> str:
    which = record.beside
    own, short = record.set_of.index(which), record.falls_short(which)
    unstable = [name for axis, name in enumerate(record.axis) if not np.isfinite(record.command_worst.gain[own, axis])]
    fast = joined(f"{name} {number(float(record.bandwidth[own, axis]), 2)} Hz" for axis, name in enumerate(record.axis))
    keeps = f"; {joined(short)} short of these margins" if short else "; the margins are kept"
    ends = f", {joined(unstable)} unstable with some" if unstable else ""
    return f"{_BESIDE.get(which, which)} give {fast}{keeps}{ends}"


def _margins(record: GainsRecord, index: int) -> Table:
    rows: list[list[str | Cell]] = []
    for own, which in enumerate(record.set_of):
        short = record.falls_short(which)
        for axis, name in enumerate(record.axis):
            command, angle = record.command_worst, record.angle_worst
            disk = float(min(command.disk[own, axis], angle.disk[own, axis]))
            rows.append(
                [
                    which,
                    name,
                    number(float(command.gain[own, axis]), 2),
                    number(float(command.phase[own, axis]), 2),
                    Cell(number(disk, 2), "warning" if name in short else "plain"),
                    number(float(record.bandwidth[own, axis]), 2),
                    percent(float(record.overshoot[own, axis]), 2),
                    number(1e3 * float(record.rise[own, axis]), 2),
                ]
            )
    header = ("Gains", "Axis", "dB", "Phase, °", "Disk, °", "Angle, Hz", "Overshoot", "Rise, ms")
    caption = f"The least margins with {record.possible}, and how fast the best guess is."
    legend = (
        "Possible vehicles: the best guess, and the corners of the intervals that flights leave. dB and phase: what "
        "the loop, cut at the command, bears of either alone. Disk: the phase that may be off while the gain is off "
        "by as much, cut at the command or at the angle, the less. Angle: where it follows at half power. Overshoot, "
        "rise: of a step."
    )
    return Table(f"gains-margins-{index}", caption, header, rows, frozenset({0, 1}), legend=legend)


def _parameters(record: GainsRecord, index: int) -> Table:
    known = bool(np.isfinite(record.parameter.today).any())
    rows: list[list[str | Cell]] = [
        [
            row.name,
            Cell(f"{row.proposed:.6g}", "warning" if row.clipped else "plain"),
            _plain(row.today) if known else _plain(row.default),
            f"{row.low:.6g} to {_plain(row.high)}",
            f"{row.meaning}{f', {row.unit}' if row.unit else ''}{_clipped(row)}",
        ]
        for row in record.rows
    ]
    header = ("Parameter", "Proposed", "Today" if known else "Default", "Documented range", "What it is")
    caption = f"Parameters of {record.title}. Ranges: {record.source[-1]}"
    return Table(f"gains-parameters-{index}", caption, header, rows, frozenset({0, 4}), frozenset({4}))


def _clipped(row: ParameterRow) -> str:
    return f"; {row.wanted:.4g} was wanted, which the range does not hold" if row.clipped else ""


def _plain(value: float) -> str:
    return f"{value:.6g}" if np.isfinite(value) else "—"


def gains_blocks(gains: Source[GainsRecord], index: int) -> Iterator[Block]:
    """Show gains on a page: margins, parameters, and the loops that they make."""
    record = gains.record
    yield Heading(gains.label)
    yield Facts(
        [
            ("Vehicle", record.vehicle_name),
            *((("Firmware", record.firmware),) if record.firmware else ()),
            ("Law", f"{record.source[0]}{f'; {record.rate:.6g} steps a second' if record.rate else ''}"),
            ("Left out of it", joined(record.left_out)),
            ("Hover", f"{percent(record.hover, 3)} of full thrust, motors at {percent(record.signal, 3)}"),
            (
                "Asked",
                f"{number(record.asked_gain, 3)} dB, {number(record.asked_phase, 3)}°, disk "
                f"{number(record.asked_disk, 3)}°; one disk of {number(record.required, 3)}° holds all three",
            ),
        ]
    )
    yield _margins(record, index)
    yield from (Text(words, "warning") for words in record.warning)
    yield _parameters(record, index)
    for axis, name in enumerate(record.axis):
        yield _bode(record, axis, f"gains-bode-{name}-{index}")
        yield _nichols(record, axis, f"gains-nichols-{name}-{index}")
    yield _steps(record, f"gains-step-{index}")
    if record.noise is not None:
        yield _noise(record, f"gains-noise-{index}")


def _bode(record: GainsRecord, axis: int, name: str) -> Plot:
    title = record.axis[axis]

    def draw(figure: Figure) -> None:
        upper, lower = figure.subplots(2, 1, sharex=True)
        for which, style in ((record.beside, _OTHER), (PROPOSED, _PROPOSED)):
            row = record.row(which, axis)
            line(upper, record.frequency, record.loop.magnitude[row], label=which, **style)
            lower.plot(record.frequency, _unwrapped(record.loop.phase[row]), label=which, **style)
        row = record.row(PROPOSED, axis)
        line(upper, record.frequency, record.loop_worst.magnitude[row], label="proposed, worst vehicle", **_WORST)
        lower.plot(record.frequency, _unwrapped(record.loop_worst.phase[row]), **_WORST)
        upper.axhline(0.0, **BASELINE)
        lower.axhline(-180.0, **BASELINE)
        upper.set_ylim(*_SHOWN_DB)
        lower.set_ylim(-360.0, 0.0)
        lower.set_yticks([-360, -270, -180, -90, 0])
        upper.set_ylabel("dB")
        lower.set_ylabel("degrees")
        _hertz(lower, record)
        legend_over(figure, upper)

    caption = f"{title.capitalize()}: the loop, cut at the command."
    return plot(name, caption, f"Bode plot of the loop of {title}", 4.4, draw)


def _nichols(record: GainsRecord, axis: int, name: str) -> Plot:
    title = record.axis[axis]

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for which, style in ((record.beside, _OTHER), (PROPOSED, _PROPOSED)):
            row = record.row(which, axis)
            axes.plot(_unwrapped(record.loop.phase[row]), record.loop.magnitude[row], label=which, **style)
        row = record.row(PROPOSED, axis)
        worst = record.loop_worst
        axes.plot(_unwrapped(worst.phase[row]), worst.magnitude[row], label="proposed, worst vehicle", **_WORST)
        ring = _disk(record.required)
        axes.fill(ring[0], ring[1], facecolor="#e4e4e4", edgecolor=GREY, label="asked margin: stay out")
        axes.plot([-180.0], [0.0], marker="+", color="black", linestyle="none", markersize=9)
        axes.set_xlim(-300.0, -60.0)
        axes.set_ylim(-30.0, 30.0)
        axes.set_xticks([-270, -225, -180, -135, -90])
        axes.set_xlabel("degrees")
        axes.set_ylabel("dB")
        legend_over(figure, axes)

    caption = f"{title.capitalize()}: Nichols chart of the loop; the cross is where it becomes unstable."
    return plot(name, caption, f"Nichols chart of the loop of {title}", 3.6, draw)


def _disk(phase: float) -> tuple[np.ndarray, np.ndarray]:
    """Give the loops at the edge of a balanced disk margin, degrees and dB: ``|S - T| = 2 / alpha``."""
    turn = np.exp(1j * np.linspace(0.0, 2 * np.pi, 181)) / np.tan(np.radians(phase) / 2)
    loop = (1 - turn) / (1 + turn)
    return np.degrees(np.angle(loop)) % 360.0 - 360.0, 20 * np.log10(np.abs(loop))


def _steps(record: GainsRecord, name: str) -> Plot:
    def draw(figure: Figure) -> None:
        panels = figure.subplots(3, 1, sharex=True)
        for axis, axes in enumerate(panels):
            for which, style in ((record.beside, _OTHER), (PROPOSED, _PROPOSED)):
                line(axes, 1e3 * record.time, record.step[record.row(which, axis)], label=which, **style)
            row = record.row(PROPOSED, axis)
            band(
                axes,
                1e3 * record.time,
                record.step_low[row],
                record.step_high[row],
                color="#c9c9c9",
                label="proposed, vehicles that are possible",
            )
            axes.axhline(1.0, **BASELINE)
            axes.set_ylim(-0.1, 1.7)
            axes.set_ylabel(record.axis[axis])
            plain_ticks(axes.yaxis)
        panels[-1].set_xlabel("ms")
        legend_over(figure, panels[0])

    return plot(
        name, "The angle after a step of the asked one, in parts of it.", "Step of the angle, by axis", 4.6, draw
    )


def _noise(record: GainsRecord, name: str) -> Plot:
    noise = record.noise
    assert noise is not None, "drawn where there is one"

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for axis, title in enumerate(record.axis):
            line(axes, noise.frequency, 10 * np.log10(noise.density[:, axis]), label=title, **style_of(axis))
        for hz in noise.line:
            axes.axvline(hz, **BASELINE)
        axes.set_xlabel("Hz")
        axes.set_ylabel("dB (rad²/s² per Hz)")
        legend_over(figure, axes)

    caption = "Noise of the gyroscope as logged; grey lines: what stands out by 10 dB and more."
    return plot(name, caption, "Spectrum of the gyroscope", 2.8, draw)


def _hertz(axes: Axes, record: GainsRecord) -> None:
    axes.set_xlim(float(record.frequency[0]), float(record.frequency[-1]))
    axes.set_xlabel("Hz")
    logarithmic(axes, [tick for tick in (0.1, 1.0, 10.0, 100.0, 1000.0) if tick <= record.frequency[-1]])


def _unwrapped(phase: np.ndarray) -> np.ndarray:
    """Join the turns of a phase, degrees, so that it begins between -360 and 0."""
    joined_up = np.unwrap(phase, period=360)
    return np.asarray(joined_up - 360.0 * np.ceil(joined_up[0] / 360.0))
