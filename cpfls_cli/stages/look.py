"""Say what one ordinary log can answer, with nothing else known of the vehicle: one page for each log.

Without -o the answer is printed; with it, FOLDER gets a page and a result for each log.
"""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from cpfls_cli.chart import Axis, Chart, span
from cpfls_cli.errors import ComputationError, InputError
from cpfls_cli.logs.formats import LogContents, log_flights, suffixes_in_words
from cpfls_cli.look.effectiveness import AxisPlant
from cpfls_cli.look.flight import AXES
from cpfls_cli.look.look import Look, look_at
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


def _balance(r: Look) -> str:
    """Draw the share of thrust of each rotor against the mean."""
    rows = [] if r.balance is None else [row for row in r.balance.rotors if row.share is not None]
    if not rows:
        return ""
    values, low, high = (
        np.array([100 * (getattr(row.share, end) - 1) for row in rows]) for end in ("value", "low", "high")
    )
    x = np.array([float(row.rotor) for row in rows])
    chart = Chart(
        "balance",
        "Share of each rotor against the mean, in per cent, with 95 % intervals",
        Axis("rotor", 0.4, x.max() + 0.6, names={at: f"M{at:.0f}" for at in x}),
        Axis("above the mean, %", *span(values, low, high, zero=True)),
    )
    chart.bars("", x, values, 0, low=low, high=high)
    expected = np.array([100 * (row.expected - 1) for row in rows])
    if np.abs(expected).max() > 0.5:
        chart.points("equal rotors", x, expected, "g")
    return str(chart)


def _effectiveness(r: Look) -> str:
    """Draw angular acceleration per full command over frequency, by instruments and by least squares."""
    shown = [plant for plant in (r.plants or {}).values() if plant.identified]
    if not shown:
        return ""
    seen = [np.minimum(plant.input_coherence, plant.output_coherence) > _SEEN for plant in shown]
    tops = [plant.model_gain for plant in shown]
    frequency = np.concatenate([plant.frequency for plant in shown])
    chart = Chart(
        "effectiveness",
        "Angular acceleration per full command over frequency",
        Axis("frequency, Hz", float(frequency.min()), float(frequency.max()), log=True),
        Axis("rad/s² per full command", 0.0, 1.6 * max(float(np.nanmax(each)) for each in tops)),
    )
    for plant, clear in zip(shown, seen, strict=True):
        _curves(chart, plant, clear)
    return str(chart)


def _curves(chart: Chart, plant: AxisPlant, clear: np.ndarray) -> None:
    style = AXES.index(plant.axis)
    spread = np.exp(np.minimum(1.96 * plant.gain_error, np.log(_MOST_FACTOR)))
    gain = np.where(clear & (spread < _MOST_FACTOR), plant.gain, np.nan)
    chart.points(
        f"{plant.axis}, points", plant.frequency, gain, style, low=gain / spread, high=gain * spread, key=False
    )
    chart.line(plant.axis, plant.frequency, plant.model_gain, style)
    chart.line(f"{plant.axis}, least squares", plant.frequency, plant.direct_gain, style, kind="dashed thin", key=False)


def _step(r: Look) -> str:
    """Draw the answer of the body rate to a step of its setpoint."""
    shown = [loop for loop in (r.loops or {}).values() if loop.measured]
    if not shown:
        return ""
    lows, highs = [loop.step_low for loop in shown], [loop.step_high for loop in shown]
    late = max([loop.by_step.half_s.value for loop in shown if loop.by_step is not None], default=np.inf)
    end = min(float(shown[0].time[-1]), max(_LEAST_STEP_S, _HALVES * late))
    inside = shown[0].time <= end
    low, high = span(*(each.step[inside] for each in shown), *(each[inside] for each in (*lows, *highs)), [0.0, 1.2])
    chart = Chart(
        "step",
        "Body rate after a step of its setpoint, as a share of the step",
        Axis("time after the step, s", 0.0, end),
        Axis("share of the step", max(low, -0.5), min(high, 2.0)),
    )
    chart.mark(y=1.0)
    for loop in shown:
        style = AXES.index(loop.axis)
        time, step, least, most = (each[inside] for each in (loop.time, loop.step, loop.step_low, loop.step_high))
        chart.line(loop.axis, time, step, style, low=least, high=most)
        if getattr(loop, "law_explains", False) and len(loop.law_step) == len(loop.time):
            chart.line(f"{loop.axis}, by law", time, loop.law_step[inside], style, kind="dashed thin", key=False)
    return str(chart)


def _response(r: Look) -> str:
    """Draw the gain from rate setpoint to body rate."""
    shown = [loop for loop in (r.loops or {}).values() if loop.measured]
    if not shown:
        return ""
    inside = [(loop.frequency > 0) & (loop.frequency <= loop.clear_hz) for loop in shown]
    frequency = np.concatenate([loop.frequency[part] for loop, part in zip(shown, inside, strict=True)])
    chart = Chart(
        "response",
        "Body rate over rate setpoint, by frequency",
        Axis("frequency, Hz", float(frequency.min()), float(frequency.max()), log=True),
        Axis("gain", 0.0, 2.0),
    )
    chart.mark(y=1.0)
    for loop, part in zip(shown, inside, strict=True):
        spread = np.exp(1.96 * loop.gain_error[part])
        gain, style = loop.gain[part], AXES.index(loop.axis)
        chart.line(loop.axis, loop.frequency[part], gain, style, low=gain / spread, high=gain * spread)
    return str(chart)


def _map(r: Look) -> str:
    """Draw the power of the gyroscope over frequency and throttle."""
    v = r.vibration
    if v is None or not v.map_db.size or not np.isfinite(v.map_db).any():
        return ""
    # Below, the vehicle moves as a whole, which would hide what vibrates.
    inside = v.map_hz >= _VIBRATES_HZ
    if not np.isfinite(v.map_db[:, inside]).any():
        return ""
    hz, shown = v.map_hz[inside], v.map_db[:, inside]
    high = float(np.nanpercentile(shown, 99.5))
    half = 0.5 * (v.map_collective[1] - v.map_collective[0])
    chart = Chart(
        "vibration-map",
        "Power of the gyroscope over frequency and throttle: the darker, the stronger",
        Axis("frequency, Hz", float(hz[0]), float(hz[-1])),
        Axis("throttle, share of full", float(v.map_collective[0] - half), float(v.map_collective[-1] + half)),
    )
    chart.map(shown, high - _DECIBELS, high)
    return str(chart)


def _spectra(r: Look) -> str:
    """Draw the spectra of the gyroscope, before and after filters."""
    every = {} if r.vibration is None else r.vibration.spectra
    shown = [each for name, each in every.items() if name.startswith("gyroscope")]
    if not shown:
        return ""
    densities = [np.degrees(np.sqrt(each.density.mean(axis=1))) for each in shown]
    inside = [each.frequency > 1.0 for each in shown]
    chart = Chart(
        "spectra",
        "Spectrum of the gyroscope, mean of its axes",
        Axis("frequency, Hz", 1.0, max(float(each.frequency[-1]) for each in shown), log=True),
        Axis("deg/s per √Hz", *_decades(*(d[i] for d, i in zip(densities, inside, strict=True))), log=True),
    )
    names = {
        "gyroscope before filters": "before filters",
        "gyroscope": "after filters" if len(shown) > 1 else "as logged",
    }
    for index, (each, density, part) in enumerate(zip(shown, densities, inside, strict=True)):
        chart.line(names[each.signal], each.frequency[part], density[part], "g" if index and len(shown) > 1 else 0)
    for line in () if r.vibration is None else r.vibration.lines:
        chart.mark(f"{line.hz:.0f}", x=line.hz)
    return str(chart)


def _decades(*values: np.ndarray) -> tuple[float, float]:
    every = np.concatenate(values)
    every = every[np.isfinite(every) & (every > 0)]
    return (
        (float(10 ** np.floor(np.log10(every.min()))), float(10 ** np.ceil(np.log10(every.max()))))
        if len(every)
        else (0.1, 1.0)
    )


def _thrust(r: Look) -> str:
    """Draw specific force over the collective command."""
    shape = None if r.hover is None else r.hover.shape
    if shape is None or not len(shape.collective):
        return ""
    chart = Chart(
        "thrust",
        "Specific force along the rotors' axis over the collective command",
        Axis("throttle, share of full", *span(shape.collective)),
        Axis("specific force, m/s²", *span(shape.specific_force, zero=True)),
        table=False,
    )
    chart.points("", shape.collective, shape.specific_force, 0)
    level = np.linspace(*span(shape.collective, room=0.0), 50)
    middle = float(np.median(shape.specific_force / shape.collective**shape.exponent.value))
    chart.line(f"exponent {shape.exponent.value:.2f}", level, middle * level**shape.exponent.value, 1)
    return str(chart)


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


FIGURES = {
    "traces": _traces,
    "balance": _balance,
    "effectiveness": _effectiveness,
    "step": _step,
    "response": _response,
    "vibration-map": _map,
    "spectra": _spectra,
    "thrust": _thrust,
}


@stage(Look, figures=FIGURES, folder=True)
def look(
    run: Run,
    logs: Annotated[list[Path], typer.Argument(metavar="LOG...", help=f"Flight logs: {suffixes_in_words()}.")],
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
            return {name: _one(run, path.name, flights[0], done, total)}
        except InputError as error:
            # It is a log, but holds nothing to look at.
            raise ComputationError(f"{path}: {str(error).removeprefix(f'{path.name}: ')}") from None
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
