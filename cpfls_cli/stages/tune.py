"""Find gains for an autopilot that keep their margins with every vehicle that flights, or a log, leave possible."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import prod
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from cpfls_cli.arguments import AutopilotChoice
from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.gate import format_name
from cpfls_cli.artifacts.vehicle_model import DELAY, DRAG, FOUND_AS, INERTIA, LAG, THRUST, Vehicle, name_of
from cpfls_cli.autopilots.law import AXES
from cpfls_cli.autopilots.parameters import Autopilot
from cpfls_cli.autopilots.registry import AUTOPILOTS
from cpfls_cli.config.study import Study
from cpfls_cli.errors import InputError
from cpfls_cli.export.parameter_files import parameter_file
from cpfls_cli.flightlog.results import Flight, Imported
from cpfls_cli.flights.models import found_vehicle, is_found, is_model, read_anew
from cpfls_cli.flights.recordings import read_whole
from cpfls_cli.flights.training import numbered_roles
from cpfls_cli.logs.formats import about_flight, log_contents, read_log
from cpfls_cli.look.effectiveness import effectiveness
from cpfls_cli.look.flight import TOO_SLOW, LogFlight
from cpfls_cli.look.gains import HOLDS, LogGains, TunedGains, tuned_gains
from cpfls_cli.look.reading import read_flight
from cpfls_cli.look.vibration import Change, vibration_of
from cpfls_cli.pages.trust import trust_words
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.report.canvas import (
    BASELINE,
    GREY,
    Axes,
    Drawn,
    Figure,
    band,
    legend_over,
    line,
    logarithmic,
    plain_ticks,
    stacked,
    style_of,
)
from cpfls_cli.report.content import UNKNOWN
from cpfls_cli.stage import Run, stage
from cpfls_cli.stages._numbers import missing_flight, with_numbers
from cpfls_cli.tuning.gains import PROPOSED, AskedMargins, Gains, ParameterRow, gains_for_vehicle
from cpfls_cli.tuning.plant import LEAST, Noise, Spread, noise_of, spread_of
from cpfls_cli.validation.trust import GOOD, Trust
from cpfls_cli.words import few, joined

_ASSUMED_LAG, _ASSUMED_DELAYED = (0.7, 1.3), 0.5
_ASSUMED_GAIN = (0.8, 1.25)
_WRITTEN = "written, for the ground station"
_PROPOSED: dict[str, Any] = {**style_of(0), "linewidth": 1.8, "zorder": 3}
_OTHER: dict[str, Any] = {"color": GREY, "linewidth": 1.4, "linestyle": "--", "zorder": 2}
_WORST: dict[str, Any] = {**style_of(1), "linewidth": 1.0, "zorder": 2.5}


def _curves(r: Gains, axis: int) -> Iterator[tuple[str, Array, Array, Array, dict[str, Any]]]:
    """Give the loops of an axis that are drawn: name, frequency, decibels and degrees, and style."""
    sets = {name: r.sets[name] for name in (r.before, PROPOSED)}
    loops = [(name, own.frequency, own.axes[axis].loop) for name, own in sets.items()]
    worst = sets[PROPOSED].axes[axis].loop_worst
    loops.append(("proposed, worst vehicle", sets[PROPOSED].frequency, worst))
    for (name, frequency, loop), style in zip(loops, (_OTHER, _PROPOSED, _WORST), strict=True):
        phase = np.degrees(np.unwrap(np.angle(loop)))
        # It begins between -360 and 0.
        yield name, frequency, 20 * np.log10(np.abs(loop)), phase - 360.0 * np.ceil(phase[0] / 360.0), style


def _bode(axis: int, r: Gains, figure: Figure) -> None:
    """Draw gain and phase of the loop of an axis, cut at the command."""
    upper, lower = stacked(figure, 2)
    for name, frequency, decibels, phase, style in _curves(r, axis):
        line(upper, frequency, decibels, label=name, **style)
        lower.plot(frequency, phase, label=name, **style)
    upper.axhline(0.0, **BASELINE)
    lower.axhline(-180.0, **BASELINE)
    upper.set_ylim(-40.0, 40.0)
    lower.set(ylim=(-360.0, 0.0), yticks=[-360, -270, -180, -90, 0])
    upper.set_ylabel("dB")
    lower.set_ylabel("degrees")
    low, high = r.sets[PROPOSED].frequency[[0, -1]]
    lower.set(xlim=(low, high), xlabel="Hz")
    logarithmic(lower, low, high)
    legend_over(figure, upper)


def _nichols(axis: int, r: Gains, figure: Figure) -> None:
    """Draw gain over phase of the loop of an axis, with the asked margin."""
    axes: Axes = figure.subplots()
    for name, _, decibels, phase, style in _curves(r, axis):
        axes.plot(phase, decibels, label=name, **style)
    # Loops at the edge of a balanced disk margin: |S - T| = 2 / alpha.
    turn = np.exp(1j * np.linspace(0.0, 2 * np.pi, 181)) / np.tan(np.radians(r.disk_required_deg) / 2)
    edge = (1 - turn) / (1 + turn)
    degrees = np.degrees(np.angle(edge)) % 360.0 - 360.0
    axes.fill(degrees, 20 * np.log10(np.abs(edge)), facecolor="#e4e4e4", edgecolor=GREY, label="asked margin: stay out")
    axes.plot([-180.0], [0.0], marker="+", color="black", linestyle="none", markersize=9)
    axes.set(xlim=(-300.0, -60.0), ylim=(-30.0, 30.0), xticks=[-270, -225, -180, -135, -90], xlabel="degrees")
    axes.set_ylabel("dB")
    legend_over(figure, axes)


def _steps(r: Gains, figure: Figure) -> None:
    """Draw the angle after a step of its setpoint."""
    panels = stacked(figure, len(AXES))
    for axis, axes in enumerate(panels):
        for name, style in ((r.before, _OTHER), (PROPOSED, _PROPOSED)):
            line(axes, 1e3 * r.sets[name].time, r.sets[name].axes[axis].step, label=name, **style)
        own, time = r.sets[PROPOSED].axes[axis], 1e3 * r.sets[PROPOSED].time
        label = "proposed, vehicles that are possible"
        band(axes, time, own.step_low, own.step_high, color="#c9c9c9", label=label)
        axes.axhline(1.0, **BASELINE)
        axes.set(ylim=(-0.1, 1.7), ylabel=AXES[axis])
        plain_ticks(axes.yaxis)
    panels[-1].set_xlabel("ms")
    legend_over(figure, panels[0])


def _noise(r: Gains, figure: Figure) -> None:
    """Draw the spectrum of the gyroscope and its lines."""
    noise = r.noise
    assert noise is not None, "drawn where there is one"
    axes: Axes = figure.subplots()
    for axis, title in enumerate(AXES):
        line(axes, noise.frequency, 10 * np.log10(noise.density[:, axis]), label=title, **style_of(axis))
    for each in noise.lines:
        axes.axvline(each.hz, **BASELINE)
    axes.set(xlabel="Hz", ylabel="dB (rad²/s² per Hz)")
    legend_over(figure, axes)


def _drawn(description: str, height: float, draw: Callable[[Any, Figure], None], part: str = "parameters") -> Drawn:
    return Drawn(description, height, draw, lambda r: getattr(r, part, None))


FIGURES = {
    **{
        f"bode-{each}": _drawn(f"Bode plot of the loop of {each}", 4.4, partial(_bode, at))
        for at, each in enumerate(AXES)
    },
    **{
        f"nichols-{each}": _drawn(f"Nichols chart of the loop of {each}", 3.6, partial(_nichols, at))
        for at, each in enumerate(AXES)
    },
    "step": _drawn("Step of the angle, by axis", 4.6, _steps),
    "noise": _drawn("Spectrum of the gyroscope", 2.8, _noise, "noise"),
}


@stage(
    Gains,
    title="Gains for an autopilot",
    figures=FIGURES,
    words={
        "HOLDS": HOLDS,
        "TOO_SLOW": TOO_SLOW,
        "general": lambda value: f"{value:.6g}" if np.isfinite(value) else UNKNOWN,
        "finite": np.isfinite,
    },
    study=lambda given: given["model"] is not None,
    output=Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="FILE", help="File to write; of a LOG parameters that change.", show_default=False
        ),
    ],
)
def tune(
    run: Run,
    config: Annotated[
        Path, typer.Argument(metavar="CONFIG|LOG", help="Study config (YAML); or a log, alone.", show_default=False)
    ],
    model: Annotated[
        Path | None,
        typer.Argument(metavar="VEHICLE", help="With CONFIG: vehicle, made by `cpfls vehicle`.", show_default=False),
    ] = None,
    autopilot: Annotated[
        AutopilotChoice | None,
        typer.Option("--autopilot", help="With CONFIG: whose control law and parameters; a LOG says it."),
    ] = None,
    flight: Annotated[
        list[Path] | None,
        typer.Option(
            "--flight", metavar="LOG", help="Log with today's parameters and the gyroscope's noise; any number."
        ),
    ] = None,
    gain_margin: Annotated[
        float, typer.Option("--gain-margin", metavar="DB", min=0.5, max=30.0, help="At least.")
    ] = 6.0,
    phase_margin: Annotated[
        float, typer.Option("--phase-margin", metavar="DEG", min=5.0, max=85.0, help="At least.")
    ] = 45.0,
    disk_margin: Annotated[
        float,
        typer.Option("--disk-margin", metavar="DEG", min=5.0, max=85.0, help="Phase, with gain off too; at least."),
    ] = 35.0,
) -> Gains | LogGains | None:
    """Find gains of a vehicle, or of what one log shows of it."""
    asked = AskedMargins(gain_margin, phase_margin, disk_margin)
    if model is not None:
        if not run.writes or autopilot is None:
            raise typer.BadParameter("with a config and a vehicle, -o FILE and --autopilot are needed, too")
        return _of_vehicle(run, model, AUTOPILOTS[autopilot.value], flight or (), asked)
    if autopilot is not None or flight:
        raise InputError(f"{config}: with a log alone leave --autopilot and --flight out; the log says both")
    if config.suffix.lower() in {".yaml", ".yml"}:
        raise InputError(
            f"{config}: is a config, not a log; a config needs the vehicle that `cpfls vehicle` found, too"
        )
    return _of_log(run, config, asked)


def _of_vehicle(
    run: Run, model: Path, autopilot: Autopilot, flights: Sequence[Path], asked: AskedMargins
) -> Gains | None:
    """Find gains of a vehicle that was found, and have a file of parameters written with them."""
    run.take({"model": model} | numbered_roles("flight", flights))
    record = _trusted(run, model)
    with_numbers(run, "tune", model, whole=True)
    vehicle = read_anew(model, run.study)
    logs = [_read(each, run.study) for each in flights]
    known, refused = _todays(autopilot, logs)
    if run.dry_run:
        return None
    today = {} if known is None else known.of(autopilot)
    noise = _noise_of(autopilot, autopilot.of_log(today) if today else autopilot.defaults(), logs)
    rotor_lag = run.study.simulation.closed_loop.rotor_time_constant_s
    spreads, assumed = _spreads(record, vehicle, rotor_lag)
    use = run.study.simulation.closed_loop.battery_use
    drained = _drained(vehicle, 1 - use)
    if drained < 1:
        assumed.append(
            f"battery: margins hold from the fullest one of the flights to one at {100 * (1 - use):.3g} % of its "
            "voltage (simulation.closed_loop.battery_use)"
        )
    gains = gains_for_vehicle(
        autopilot,
        vehicle,
        spreads,
        vehicle=model.name,
        rotor_lag=rotor_lag,
        signals=run.study.import_.rotor_command_is == "speed",
        drained=drained,
        today=today,
        system="" if known is None else known.system,
        noise=noise,
        asked=asked,
    )
    unheard = [] if noise is not None or not flights else _unheard(run.study, logs)
    what = f"gains of cpfls for {model.name}, see {run.output.name}"
    suffix, text = parameter_file(autopilot, gains.firmware, what, gains.parameters)
    run.write_text(run.output.with_suffix(suffix), text, _WRITTEN)
    run.next.append(("cpfls", "report", run.config, model, run.output, "-o", run.output.with_suffix(".html")))
    return replace(gains, warnings=(*refused, *assumed, *gains.warnings, *unheard))


def _of_log(run: Run, log: Path, asked: AskedMargins) -> LogGains | None:
    """Find gains from one log alone, and have those that change written where a file is named."""
    # Of a log alone only the file for the ground station is written.
    asked_for, run.writes = run.output if run.writes else None, False
    contents = log_contents(log)
    with about_flight(log):
        flight = read_flight(log.name, contents.topics, contents.units, contents.parameters, contents.system)
    if run.dry_run:
        return None
    for each in contents.warnings:
        run.note(f"{log}: {each}")
    vibration = vibration_of(flight)
    filters = () if vibration is None else vibration.changes
    gains = tuned_gains(flight, effectiveness(flight), asked)
    rows = _changed(gains, flight, filters) if gains.changes or filters else {}
    if asked_for is not None and rows:
        what = f"gains of cpfls from {flight.name}"
        suffix, text = parameter_file(AUTOPILOTS[gains.autopilot], gains.version, what, rows)
        run.write_text(asked_for.with_suffix(suffix), text, _WRITTEN)
    elif asked_for is not None:
        run.say(f"{asked_for}: not written, nothing changes")
    return LogGains(**vars(gains), filters=filters)


def _changed(gains: TunedGains, flight: LogFlight, filters: Sequence[Change]) -> dict[str, ParameterRow]:
    """Give the parameters that change as a file has them; filters whose ranges are not known are left to the pilot."""
    autopilot = AUTOPILOTS[gains.autopilot]
    names = autopilot.firmware.names(flight.system)
    known = {names.get(each.name, each.name): each for each in autopilot.parameters}
    changes = [(row.parameter, row.today, row.proposed) for row in gains.changes]
    changes += [(each.parameter, each.now, each.proposed) for each in filters if each.parameter in known]
    return {name: ParameterRow.of(known[name], today, proposed, proposed) for name, today, proposed in changes}


@dataclass(frozen=True)
class _Log:
    """What a log, or a flight that was imported from one, holds of its autopilot, and its body rate, rad/s.

    `column`: the one that holds the body rate about x.
    """

    name: str
    system: str
    parameters: Mapping[str, float | str]
    time: Array
    rate: Array
    column: str

    def of(self, autopilot: Autopilot) -> dict[str, float]:
        """Give the parameters of a law."""
        return autopilot.in_log(self.parameters)


def _read(flight: Path, study: Study) -> _Log:
    """Read a log, or what an imported flight keeps of its log, which is low-passed and so shows no noise."""
    nothing = (np.zeros(0), np.zeros((0, 3)), "")
    if format_name(flight) == Flight.FORMAT:
        kept, _ = read_whole(flight)
        if not isinstance(kept, Imported) or not kept.parameters:
            return _Log(flight.name, "", {}, *nothing)
        return _Log(flight.name, kept.system, kept.parameters, *nothing)
    contents = log_contents(flight, ())
    rates = _rates(flight, study) if _maps_rates(study) else nothing
    return _Log(flight.name, contents.system, contents.parameters, *rates)


def _rates(flight: Path, study: Study) -> tuple[Array, Array, str]:
    """Read times and body rates of a log, as it has them, and the column of the first."""
    read = read_log(flight, study.import_)
    mapped = {str(name): given for name, given in read.settings.signals.items()}.get("body_rate")
    stamps = read.columns.get(read.settings.time_column or "timestamp")
    if mapped is None or stamps is None:
        return np.zeros(0), np.zeros((0, 3)), ""
    columns = [read.columns[name] for name in mapped.columns]
    factor = np.pi / 180 if "deg" in str(mapped.unit) else 1.0
    seconds = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}[read.settings.time_unit]
    rate = factor * np.stack(columns, axis=1)
    known = np.isfinite(rate).all(axis=1) & np.isfinite(stamps)
    return seconds * stamps[known], rate[known], mapped.columns[0]


def _maps_rates(study: Study) -> bool:
    return "body_rate" in {str(name) for name in study.import_.signals}


def _unheard(study: Study, logs: Sequence[_Log]) -> Iterator[str]:
    """Say why logs show no noise."""
    if not _maps_rates(study):
        yield "noise is not read: the config has no import.signals.body_rate (`cpfls init LOG` proposes it)"
    elif all(not log.column and not len(log.time) for log in logs):
        yield "noise is not read: imported flights are low-passed and resampled; name the log itself with --flight too"
    else:
        yield f"noise is not read: no log holds {LEAST} samples and a second of body rates without a pause"


def _todays(autopilot: Autopilot, logs: Sequence[_Log]) -> tuple[_Log | None, list[str]]:
    """Find the log that holds today's parameters, and say why others do not."""
    firmware, refused = autopilot.firmware, list[str]()
    for log in logs:
        if not firmware.wrote(log.system):
            refused.append(f"{log.name}: written by {log.system}, so its parameters are not those of {autopilot.title}")
        elif firmware.too_old(log.system):
            refused.append(f"{log.name}: written by {log.system}; {firmware.older}, so its parameters are not used")
        elif log.of(autopilot):
            return log, refused
    if not logs:
        return None, []
    instead = f"gains are compared with the defaults of {firmware.title}, and the file is for that version"
    return None, [*refused, instead if refused else f"no log holds gains of {autopilot.title}; {instead}"]


def _noise_of(autopilot: Autopilot, values: Mapping[str, float], logs: Sequence[_Log]) -> Noise | None:
    """Estimate the noise of the gyroscope in front of the filters of the law."""
    noise = noise_of([(log.time, log.rate) for log in logs])
    behind = [log.column.startswith(autopilot.filtered) for log in logs if log.column]
    return noise.before_filters(autopilot.law(values)) if noise is not None and all(behind) else noise


def _trusted(run: Run, model: Path) -> Vehicle:
    """Read a vehicle that is good for control at least, and refuse others with the flight that is missing."""
    if not is_found(model):
        what = "an identified model" if is_model(model) else "no model"
        raise InputError(f"{model}: is {what}; gains need a vehicle that `cpfls vehicle` found")
    record = found_vehicle(model)
    if record.verdict not in GOOD:
        good = trust_words(Trust.CONTROL).short
        open_ = [name_of(name) for name in record.not_determined]
        weak = f"; not identified: {few(open_)}" if open_ else ""
        raise InputError(
            f"{model}: {trust_words(record.verdict).short}{weak}. Gains need a vehicle that is {good} at least: a "
            f"body that is too heavy gives gains that are too high. {_missing(run, record)}; or `cpfls tune LOG`, from "
            "a log of the autopilot alone"
        )
    return record


def _missing(run: Run, record: Vehicle) -> str:
    """Say which flight would make a vehicle good."""
    judged = record.held_out is not None or record.instruments is not None or record.forecast is not None
    if record.verdict is Trust.NOT_JUDGED and not judged:
        return "The flight that is missing: one that is kept aside to judge it, `cpfls vehicle` with --held-out FLIGHT"
    return missing_flight(run, record)


def _ratio_by_bounds(record: Vehicle) -> tuple[float, float] | None:
    """Give the bounds on Izz over the drag factor, in what was found, where a body by bounds leaves one open."""
    low, high = float(record.loop.low[2]), float(record.loop.high[2])
    open_ = {FOUND_AS[INERTIA[2]], FOUND_AS[DRAG]} & {*record.not_determined}
    return (low, high) if record.by_bounds and open_ and np.isfinite(low * high) else None


def _spreads(record: Vehicle, model: VehicleModel, rotor_lag: float) -> tuple[tuple[Spread, ...], list[str]]:
    """Give what flights leave open of each axis, and say what is assumed where they do not identify it."""
    known = record.parameters
    intervals, stated, assumed = {}, list[str](), list[str]()
    of_yaw = _ratio_by_bounds(record)
    for key in (*INERTIA[:3], THRUST, DRAG, LAG, DELAY):
        each = known[key]
        # What else flights leave open is open here too, for nothing else is known of it; but of a drag factor that is
        # open together with Izz the ratio is.
        whole = key == DRAG and (of_yaw or FOUND_AS[INERTIA[2]] in record.not_determined)
        used = each.determined or not (key in INERTIA or whole)
        if used and each.value and each.low is not None and each.high is not None:
            # Of commands that are not a log's the delay is longer, by what is known. An end at or below zero says no
            # more than that the number is small.
            longer = model.response.delay_s - each.value if key == DELAY else 0.0
            ends = ((end + longer) / (each.value + longer) for end in (each.low, each.high))
            low, high = (max(end, 0.1) for end in ends)
            intervals[key] = low, high
        elif key == INERTIA[2] and of_yaw:
            # About yaw the bounds are those of the ratio that control meets.
            intervals[key] = of_yaw
        elif key in INERTIA[:3] and FOUND_AS[key] in record.not_determined:
            intervals[key] = _ASSUMED_GAIN
            stated.append(each.name)
    if stated:
        assumed.append(f"{joined(stated)}: not identified by flights; as stated, from a fifth less to a quarter more")
    if not model.commanded:
        assumed.append(
            "speeds were measured, so no flight shows how the rotors follow their commands: "
            f"{1e3 * rotor_lag:.3g} ms of simulation.closed_loop.rotor_time_constant_s are assumed, 30 % either way, "
            "up to half of it a delay; margins hold where that does: log commands to know it"
        )
        intervals[LAG] = _ASSUMED_LAG
    named = {"lag": intervals.get(LAG, (1.0, 1.0)), "delay": intervals.get(DELAY, (1.0, 1.0))} | intervals
    axes = [spread_of(named, INERTIA[axis], DRAG if axis == 2 else THRUST) for axis in range(3)]
    names = [each.name for each in record.numbers]
    late = [names.index(FOUND_AS[key]) for key in (LAG, DELAY) if FOUND_AS[key] in names]
    delayed = 0.0 if model.commanded else _ASSUMED_DELAYED
    if model.commanded and LAG in intervals and DELAY not in intervals:
        # A delay as short as a lag is open acts like it, and no flight separates them.
        delayed = min(max(intervals[LAG][1] - 1, 0.0), _ASSUMED_DELAYED)
        assumed.append(
            f"delay: flights show a lag alone; up to {100 * delayed:.2g} % of it, by its interval, may be a delay, and "
            "margins hold there too"
        )
    trade = float(record.correlation[late[0], late[1]]) if len(late) > 1 else 0.0
    return tuple(replace(each, delayed=delayed, trade=trade) for each in axes), assumed


def _drained(model: VehicleModel, voltage: float) -> float:
    """Give the speed of a rotor by its command at a share of the full voltage, over that at the full one."""
    acting = [(one.effect.actuation, one.values) for one in model.filters]
    return prod(float(known.supply(values, voltage)) for known, values in acting if known and known.supply)
