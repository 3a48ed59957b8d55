"""Estimate how a vehicle answers its rotors, by frequency, and say where a model answers as it does."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from cpfls_cli.arguments import FlightsArgument, JudgedOption
from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.job import check_outputs
from cpfls_cli.artifacts.output import refuse_own
from cpfls_cli.flights.models import is_found, learned_by, read_model
from cpfls_cli.flights.playback import flights_to_play, model_notes
from cpfls_cli.flights.recordings import seen_twice
from cpfls_cli.flights.training import known_by, numbered_roles
from cpfls_cli.pages.gap import MEASURED
from cpfls_cli.pages.trust import contradicted, seen_warnings
from cpfls_cli.playback.flight import LoggedFlight, contradictions_of
from cpfls_cli.playback.instruments import Instruments, instruments
from cpfls_cli.playback.settings import VEHICLE
from cpfls_cli.report.canvas import (
    BASELINE,
    GREY,
    HELD,
    Axes,
    Drawn,
    Figure,
    band,
    legend_above,
    legend_over,
    logarithmic,
    plain_ticks,
    style_of,
)
from cpfls_cli.report.content import Command, Text
from cpfls_cli.response.flown import Responses, VehicleResponse, vehicle_responses
from cpfls_cli.response.spectra import (
    ACCEPTABLE,
    COHERENT,
    GOOD,
    NOT_ACCEPTABLE,
    NOT_JUDGED,
    ROTATION,
    ROTOR_SPEED,
    THRUST,
    decibels,
    degrees,
)
from cpfls_cli.stage import Run, stage
from cpfls_cli.stages._numbers import to_fly, with_numbers
from cpfls_cli.stages.compare import to_correct, to_gap
from cpfls_cli.words import by_name

_FOLLOWERS = (*(f"{axis} rate" for axis in ROTATION), *(f"{axis} angle" for axis in ROTATION[:2]))
_KINDS = {
    THRUST: ("thrust of the rotors to specific force along z", "m/s² per N"),
    ROTOR_SPEED: ("command of the rotors to speed", "rad/s per rad/s"),
    **dict.fromkeys(ROTATION, ("torque of the rotors to angular acceleration", "rad/s² per N m")),
    **{name: (f"setpoint to {name}, of vehicle and autopilot", "rad per rad") for name in _FOLLOWERS},
}
"""From what to what each response is, and in which unit."""
_ROOM_DB, _ROOM_DEG = 12.0, 45.0
_MODEL: dict[str, Any] = {**style_of(1), "linewidth": 1.6, "zorder": 3}
_UNEXCITED: dict[str, Any] = {"color": GREY, "linewidth": 0.8, "zorder": 1.5}
_DIGITS = 9


def hz_behind(own: VehicleResponse, angle: float) -> float | None:
    """Find the frequency, Hz, from which on a response lags by an angle in degrees; None where nowhere."""
    assert own.band is not None, "it is asked of what shows"
    inside = (own.frequency >= own.band[0]) & (own.frequency <= own.band[1]) & np.isfinite(own.phase_deg)
    phase = np.unwrap(own.phase_deg[inside], period=360)
    behind = np.flatnonzero(phase < -angle)
    if not len(behind):
        return None
    around = slice(max(int(behind[0]) - 1, 0), int(behind[0]) + 1)
    return float(np.exp(np.interp(angle, -phase[around], np.log(own.frequency[inside][around]))))


def median_of(values: Array, own: VehicleResponse) -> float:
    """Take the median over the band that is judged."""
    assert own.band is not None, "it is asked of what shows"
    inside = values[(own.frequency >= own.band[0]) & (own.frequency <= own.band[1]) & np.isfinite(values)]
    return float(np.median(inside)) if len(inside) else float("nan")


def _draw(name: str, r: Responses, figure: Figure) -> None:
    """Draw one response: magnitude, phase and coherence over the logarithm of the frequency."""
    own = r.responses[name]
    shown = own.clearness > COHERENT
    half = 2 * np.where(shown, own.random_error, np.nan)
    upper, middle, lower = figure.subplots(3, 1, sharex=True, height_ratios=(3, 3, 2))
    _curves(upper, own, decibels, 20 * np.log10(1 + half), _ROOM_DB)
    _curves(middle, own, degrees, np.degrees(half), _ROOM_DEG)
    upper.set_ylabel(f"dB ({_KINDS[name][1]})")
    middle.set_ylabel("degrees")
    lower.plot(own.frequency, own.coherence_output, label="output", **MEASURED)
    if own.instrumented:
        lower.plot(own.frequency, own.coherence_input, label="input", **HELD)
        lower.plot(own.frequency, own.clearness, label="by random error", **_MODEL)
        legend_above(lower)
    lower.axhline(COHERENT, **BASELINE)
    lower.set(ylim=(0.0, 1.05), ylabel="coherence", xlabel="Hz")
    logarithmic(lower, own.frequency[0], own.frequency[-1])
    legend_over(figure, upper)


def _curves(axes: Axes, own: VehicleResponse, part: Any, half: Array, room: float) -> None:
    """Draw the magnitude or the phase of one response, with half the width of its band."""
    shown, nothing = own.clearness > COHERENT, np.full_like(own.gain, np.nan)
    measured, direct, model = map(part, (own.gain, own.direct, nothing if own.model is None else own.model))
    clear = np.where(shown, measured, np.nan)
    if shown.any():
        band(axes, own.frequency, clear - half, clear + half, color="#c9c9c9", label="95 %")
    axes.plot(*_unbroken(own.frequency, measured), label="not excited", **_UNEXCITED)
    if own.instrumented:
        axes.plot(*_unbroken(own.frequency, np.where(shown, direct, np.nan)), label="without instruments", **HELD)
    axes.plot(*_unbroken(own.frequency, clear), label="vehicle", **MEASURED)
    axes.plot(*_unbroken(own.frequency, np.where(shown, model, np.nan)), label="model", **_MODEL)
    plain_ticks(axes.yaxis)
    seen = np.concatenate([clear, np.where(shown, model, np.nan)])
    seen = seen[np.isfinite(seen)]
    if len(seen):
        axes.set_ylim(float(seen.min()) - room, float(seen.max()) + room)


def _unbroken(frequency: Array, values: Array) -> tuple[Array, Array]:
    """Lift the pen where a phase goes round."""
    jumps = np.flatnonzero(np.abs(np.diff(values)) > 180) + 1
    return np.insert(frequency, jumps, frequency[jumps]), np.insert(values, jumps, np.nan)


def _bode(name: str) -> Drawn:
    words = f"Bode plot of {name}: {_KINDS[name][0]}, measured and of the model"
    return Drawn(words, 5.6, partial(_draw, name), lambda r: name in r.responses)


@stage(
    Responses,
    title="Frequency responses",
    figures={name.replace(" ", "-"): _bode(name) for name in _KINDS},
    words={**by_name(contradicted, hz_behind, median_of), "kinds": _KINDS.__getitem__, "limits": (GOOD, ACCEPTABLE)},
    study=True,
)
def response(
    run: Run,
    flights: FlightsArgument,
    model: JudgedOption = None,
    table: Annotated[Path | None, typer.Option("--csv", metavar="FILE", help="Write the curves as CSV, too.")] = None,
) -> Responses | None:
    """Estimate frequency responses with the instruments that the flights hold, and those of a model."""
    roles = numbered_roles("flight", flights)
    inputs = run.take(({} if model is None else {"model": model}) | roles)
    with_numbers(run, "response", model, whole=model is not None and is_found(model))
    if table is not None:
        refuse_own(table, run.output)
        check_outputs(run, table)
    name = VEHICLE if model is None else model.name
    judged = read_model(Path(VEHICLE) if model is None else model, run.study)
    given = flights_to_play(flights, run.study)
    if run.dry_run:
        return None
    moved_by = instruments([flight.playback for flight in given])
    found = Responses(
        model=name,
        flights=tuple(flight.name for flight in given),
        instruments=moved_by.kind,
        responses=vehicle_responses(judged, given, moved_by.by_flight),
        warnings=(
            *seen_twice(inputs[role] for role in roles),
            *seen_warnings(name, learned_by(model), known_by(roles, inputs)),
            *(warning for flight in given for warning in flight.warnings),
            *model_notes(name, judged, given),
            *_left_out(moved_by, given),
        ),
        contradictions=contradictions_of(given),
    )
    run.next.append(_next(run, found, flights, model))
    if table is not None:
        run.texts[table] = _csv(found)
        run.said.append(Text(f"{table}: written, the curves as CSV"))
    return found


def _next(run: Run, found: Responses, flights: Sequence[Path], model: Path | None) -> Command:
    """Give the command that goes on: a flight that can be judged, what a model lacks, or the model handed over."""
    words = set(found.words.values())
    if found.contradictions:
        return to_correct(run)
    if not found.has_instruments or words <= {NOT_JUDGED}:
        return to_fly(run)
    if NOT_ACCEPTABLE not in words and model is not None:
        return "cpfls", "export", model, "-o", run.sibling(f"{model.stem}.c")
    return to_gap(run, flights, model)


def _left_out(moved_by: Instruments, flights: Sequence[LoggedFlight]) -> Iterator[str]:
    """Say which flights hold no instrument where others do: they identify nothing of the vehicle."""
    lacks = {
        "repeats": "no other of these flights flies its path",
        "setpoints": "it holds no setpoint from outside of its loops",
    }
    for number, flight in enumerate(flights):
        if moved_by.kind in lacks and number not in moved_by.flights:
            yield f"{flight.name}: {lacks[moved_by.kind]}, so its response to torque is left out"


def _csv(r: Responses) -> str:
    """Write one line for each response and frequency that a window identifies; empty where not known."""
    lines = []
    for name, own in r.responses.items():
        header = ",".join(["response", "frequency_hz", *own.columns])
        columns = np.column_stack([own.frequency, *own.columns.values()])[np.isfinite(own.magnitude_db)]
        lines += [
            ",".join([name, *(f"{value:.{_DIGITS}g}" if np.isfinite(value) else "" for value in row)])
            for row in columns
        ]
    return "\n".join([header, *lines]) + "\n"
