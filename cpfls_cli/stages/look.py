"""Say what one ordinary log can answer, with nothing else known of the vehicle: one page for each log.

Without -o the answer is printed; with it, FOLDER gets a page and a result for each log.
"""

from __future__ import annotations

import shlex
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from cpfls_cli.errors import ComputationError, InputError
from cpfls_cli.logs.formats import LogContents, about_flight, log_flights, suffixes_in_words
from cpfls_cli.look.balance import RotorBalance
from cpfls_cli.look.effectiveness import AxisPlant
from cpfls_cli.look.flight import AXES
from cpfls_cli.look.look import Look, look_at
from cpfls_cli.look.loop import AxisLoop
from cpfls_cli.look.vibration import Spectrum
from cpfls_cli.report.canvas import BASELINE, GREY, Axes, Drawn, Figure, band, legend_above, logarithmic, style_of
from cpfls_cli.stage import Run, stage, unique_names
from cpfls_cli.traces import traces

_SEEN = 0.15
"""Coherence below which a point of a frequency response is left out."""
_DECIBELS = 30.0
_VIBRATES_HZ = 20.0
_LEAST_STEP_S, _HALVES = 0.2, 10.0
"""Time that a step is shown: at least, and in times until half of it."""
_MOST_FACTOR = 10.0
"""Intervals wider than this factor are not drawn."""
_LEAST_EXPECTED = 0.5
"""Per cent from the mean from which on it is drawn what equal rotors would have."""
_ENDS, _FAINT = ("value", "low", "high"), 0.18


def _balanced(r: Look) -> list[RotorBalance]:
    return [] if r.balance is None else [row for row in r.balance.rotors if row.share is not None]


def _balance(r: Look, figure: Figure) -> None:
    """Draw the share of thrust of each rotor against the mean."""
    rows, axes = _balanced(r), figure.subplots()
    value, low, high = (np.array([100 * (getattr(row.share, end) - 1) for row in rows]) for end in _ENDS)
    rotor, expected = np.array([row.rotor for row in rows]), np.array([100 * (row.expected - 1) for row in rows])
    axes.bar(rotor, value, 0.6, label="share", color=style_of(0)["color"])
    axes.errorbar(rotor, value, [value - low, high - value], fmt="none", ecolor="black", label="95 %")
    if np.abs(expected).max() > _LEAST_EXPECTED:
        axes.plot(rotor, expected, "o", color=GREY, label="equal rotors")
        legend_above(axes)
    axes.set_axisbelow(True)
    axes.set_xticks(rotor, [f"M{at}" for at in rotor])
    axes.set_ylabel("above the mean, %")


def _identified(r: Look) -> list[AxisPlant]:
    return [plant for plant in (r.plants or {}).values() if plant.identified]


def _effectiveness(r: Look, figure: Figure) -> None:
    """Draw angular acceleration per full command over frequency, by instruments and by least squares."""
    axes, shown = figure.subplots(), _identified(r)
    for number, plant in enumerate(shown):
        seen = np.minimum(plant.input_coherence, plant.output_coherence) > _SEEN
        spread = np.exp(np.minimum(1.96 * plant.gain_error, np.log(_MOST_FACTOR)))
        gain = np.where(seen & (spread < _MOST_FACTOR), plant.gain, np.nan)
        style, ends = style_of(AXES.index(plant.axis)), [gain - gain / spread, gain * spread - gain]
        axes.errorbar(plant.frequency, gain, ends, fmt="o", markersize=3, linewidth=1, color=style["color"])
        axes.plot(plant.frequency, plant.model_gain, label=plant.axis, **style)
        axes.plot(plant.frequency, plant.direct_gain, label=None if number else "least squares", **BASELINE)
    axes.set_ylim(0.0, 1.6 * max(float(np.nanmax(plant.model_gain)) for plant in shown))
    axes.set_ylabel("rad/s² per full command")
    _over_frequency(axes)


def _over_frequency(axes: Axes) -> None:
    low, high = axes.dataLim.intervalx
    logarithmic(axes, low, high)
    axes.set(xlim=(low, high), xlabel="frequency, Hz")
    if len(axes.get_legend_handles_labels()[1]) > 1:
        legend_above(axes, 3)


def _measured(r: Look) -> list[AxisLoop]:
    return [loop for loop in (r.loops or {}).values() if loop.measured]


def _step(r: Look, figure: Figure) -> None:
    """Draw the answer of the body rate to a step of its setpoint."""
    axes, shown = figure.subplots(), _measured(r)
    late = max([loop.by_step.half_s.value for loop in shown if loop.by_step is not None], default=np.inf)
    end = min(float(shown[0].time[-1]), max(_LEAST_STEP_S, _HALVES * late))
    axes.axhline(1.0, **BASELINE)
    for loop in shown:
        style = style_of(AXES.index(loop.axis))
        inside = loop.time <= end
        time, step, least, most = (each[inside] for each in (loop.time, loop.step, loop.step_low, loop.step_high))
        band(axes, time, least, most, color=style["color"], alpha=_FAINT)
        axes.plot(time, step, label=loop.axis, **style)
        if getattr(loop, "law_explains", False) and len(loop.law_step) == len(loop.time):
            axes.plot(time, loop.law_step[inside], label=f"{loop.axis}, by law", color=style["color"], linewidth=0.7)
    low, high = axes.get_ylim()
    axes.set(ylim=(max(low, -0.5), min(high, 2.0)), xlabel="time after the step, s", ylabel="share of the step")
    legend_above(axes, 3)


def _response(r: Look, figure: Figure) -> None:
    """Draw the gain from rate setpoint to body rate."""
    axes = figure.subplots()
    for loop in _measured(r):
        inside = (loop.frequency > 0) & (loop.frequency <= loop.clear_hz)
        frequency, gain, spread = loop.frequency[inside], loop.gain[inside], np.exp(1.96 * loop.gain_error[inside])
        style = style_of(AXES.index(loop.axis))
        band(axes, frequency, gain / spread, gain * spread, color=style["color"], alpha=_FAINT)
        axes.plot(frequency, gain, label=loop.axis, **style)
    axes.axhline(1.0, **BASELINE)
    axes.set(ylim=(0.0, 2.0), ylabel="gain")
    _over_frequency(axes)


def _mapped(r: Look) -> bool:
    # Below, the vehicle moves as a whole, which would hide what vibrates.
    return r.vibration is not None and bool(
        np.isfinite(r.vibration.map_db[:, r.vibration.map_hz >= _VIBRATES_HZ]).any()
    )


def _map(r: Look, figure: Figure) -> None:
    """Draw the power of the gyroscope over frequency and throttle."""
    v, axes = r.vibration, figure.subplots()
    assert v is not None, "asked before"
    inside = v.map_hz >= _VIBRATES_HZ
    hz, shown = v.map_hz[inside], v.map_db[:, inside]
    high, half = float(np.nanpercentile(shown, 99.5)), 0.5 * (v.map_collective[1] - v.map_collective[0])
    axes.imshow(
        shown,
        cmap="Blues",
        vmin=high - _DECIBELS,
        vmax=high,
        aspect="auto",
        origin="lower",
        interpolation="nearest",
        extent=(hz[0], hz[-1], v.map_collective[0] - half, v.map_collective[-1] + half),
    )
    axes.grid(visible=False)
    axes.set(xlabel="frequency, Hz", ylabel="throttle, share of full")


def _of_gyroscope(r: Look) -> list[Spectrum]:
    every = {} if r.vibration is None else r.vibration.spectra
    return [each for name, each in every.items() if name.startswith("gyroscope")]


def _spectra(r: Look, figure: Figure) -> None:
    """Draw the spectra of the gyroscope, before and after filters."""
    axes, shown = figure.subplots(), _of_gyroscope(r)
    names = {
        "gyroscope before filters": "before filters",
        "gyroscope": "after filters" if len(shown) > 1 else "as logged",
    }
    for index, each in enumerate(shown):
        inside, style = each.frequency > 1.0, BASELINE if index else style_of(0)
        density = np.degrees(np.sqrt(each.density.mean(axis=1)))
        axes.plot(each.frequency[inside], density[inside], label=names[each.signal], **style)
    for line in () if r.vibration is None else r.vibration.lines:
        axes.axvline(line.hz, **BASELINE)
        axes.text(line.hz, 1.0, f"{line.hz:.0f}", transform=axes.get_xaxis_transform(), ha="center", fontsize=8.5)
    axes.set(yscale="log", ylabel="deg/s per √Hz")
    _over_frequency(axes)


def _thrust(r: Look, figure: Figure) -> None:
    """Draw specific force over the collective command."""
    shape = None if r.hover is None else r.hover.shape
    assert shape is not None, "asked before"
    axes, exponent = figure.subplots(), shape.exponent.value
    axes.plot(shape.collective, shape.specific_force, "o", color=style_of(0)["color"], markersize=3)
    level = np.linspace(shape.collective.min(), shape.collective.max(), 50)
    middle = float(np.median(shape.specific_force / shape.collective**exponent))
    axes.plot(level, middle * level**exponent, label=f"exponent {exponent:.2f}", **style_of(1))
    axes.set_ylim(bottom=0.0)
    axes.set(xlabel="throttle, share of full", ylabel="specific force, m/s²")
    legend_above(axes)


_PANELS = {
    "rate, deg/s": ("rate", "rate_asked"),
    "attitude, deg": ("attitude",),
    "rotor command": ("rotors",),
    "height, m": ("height",),
    "battery, V": ("voltage",),
}


def _traces(r: Look) -> str:
    """Draw signals over the whole log."""
    tracks = r.tracks or {}
    panels = {label: [tracks[name] for name in names if name in tracks] for label, names in _PANELS.items()}
    return traces({label: own for label, own in panels.items() if own}, r.events)


def _drawn(description: str, draw: Callable[[Look, Figure], None], holds: Callable[[Look], object]) -> Drawn:
    """Make a figure of a card."""
    return Drawn(description, 2.9, draw, holds, 4.8)


FIGURES = {
    "traces": _traces,
    "balance": _drawn("Share of each rotor against the mean, in per cent", _balance, _balanced),
    "effectiveness": _drawn("Angular acceleration per full command over frequency", _effectiveness, _identified),
    "step": _drawn("Body rate after a step of its setpoint, as a share of the step", _step, _measured),
    "response": _drawn("Body rate over rate setpoint, by frequency", _response, _measured),
    "vibration-map": _drawn(
        "Power of the gyroscope over frequency and throttle: the darker, the stronger", _map, _mapped
    ),
    "spectra": _drawn("Spectrum of the gyroscope, mean of its axes", _spectra, _of_gyroscope),
    "thrust": _drawn(
        "Specific force along the rotors' axis over the collective command",
        _thrust,
        lambda r: r.hover and r.hover.shape and len(r.hover.shape.collective),
    ),
}


@stage(Look, figures=FIGURES, folder=True)
def look(
    run: Run, logs: Annotated[list[Path], typer.Argument(metavar="LOG", help=f"Flight logs: {suffixes_in_words()}.")]
) -> dict[str, Look] | None:
    """Look into logs, each by itself."""
    named = unique_names(logs)
    for name, path in named.items():
        if path.is_dir():
            raise InputError(f"{path}: is a folder; give its logs: cpfls look {shlex.quote(str(path))}/*")
        run.take({"log": path}, name)
    if run.dry_run:
        return None
    found: dict[str, Look] = {}
    for done, (name, path) in enumerate(named.items()):
        try:
            found |= _every(run, name, path, done, len(named))
        except (InputError, ComputationError) as error:
            if len(named) == 1:
                raise
            found[name] = Look(name=path.name, refused=str(error).removeprefix(f"{path}: "))
    if all(each.refused for each in found.values()):
        raise ComputationError("; ".join(f"{each.name}: {each.refused}" for each in found.values()))
    if run.output is None:
        run.next.append(("cpfls", "look", *logs, "-o", "look"))
    return found


def _every(run: Run, name: str, path: Path, done: int, total: int) -> dict[str, Look]:
    """Look at each flight that a file holds."""
    run.progress(done, total, f"reads {path.name}")
    flights, found = log_flights(path), dict[str, Look]()
    if len(flights) == 1:
        try:
            with about_flight(path):
                return {name: _one(run, path.name, flights[0], done, total)}
        except InputError as error:
            # It is a log, but holds nothing to look at.
            raise ComputationError(str(error)) from None
    for number, contents in enumerate(flights, 1):
        own, title = f"{name}-flight-{number}", f"{path.name}, flight {number} of {len(flights)}"
        run.take({"log": path}, own)
        try:
            found[own] = _one(run, title, contents, done, total)
        except InputError as error:
            found[own] = Look(name=title, refused=str(error).removeprefix(f"{title}: "))
    return found


def _one(run: Run, title: str, contents: LogContents, done: int, total: int) -> Look:
    return look_at(
        title,
        contents.topics,
        contents.units,
        contents.parameters,
        contents.system,
        messages=contents.messages,
        flown_at=contents.flown_at,
        warnings=contents.warnings,
        progress=lambda what: run.progress(done, total, f"{title}: {what}"),
    )
