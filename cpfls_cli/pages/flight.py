"""The page of a flight: what was flown, what was repaired, what it lacks; and of its vehicle; Figure 4."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.flight import FlightRecord
from cpfls_cli.identification.scores import AXES
from cpfls_cli.inertia import INERTIA_PARAMETERS
from cpfls_cli.pages.source import Source, Sources
from cpfls_cli.report.canvas import legend_above, line, plot, stacked, style_of
from cpfls_cli.report.content import HASH_SHOWN, Block, Facts, Folded, Heading, Plot, Section, Table, Text
from cpfls_cli.report.numbers import UNKNOWN, count, number, plain, whole_percent
from cpfls_cli.units import SPEED_UNITS
from cpfls_cli.words import joined

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from cpfls_cli.flightlog.results import ImportReport

_LACKS = {
    "attitude": "the flight has no attitude, so reduce, identify and predict will refuse it: map one with"
    " import.signals.attitude or import.signals.quaternion",
    "rotation": "the flight has neither attitude nor body rates: only the balance of its rotors where it hovers can be"
    " read from it",
    "torque": "the flight has no torque, so identify will refuse it: map one with import.signals.body_torque, or"
    " rotors with import.signals.rotor_speed or rotor_command, and name it in import.torque_source;"
    " cpfls vehicle and replay need rotors instead",
}
_NO_TORQUE_BUT_ROTORS = (
    "the flight has rotors and no torque: cpfls vehicle and replay take it as it is; identify will refuse it until"
    " import.torque_source names rotor-speed or rotor-command, which needs the factors of the rotors as numbers"
)
_TURN = 360.0
_ORIGINS = {"trajectory": "simulated along", "log": "imported from", "model": "with"}


def answer(flight: Source[FlightRecord], index: int = 1) -> Iterator[Block]:
    """Say where a flight comes from, how large it is, what was done to it and what it lacks."""
    record = flight.record
    yield Facts(list(_facts(flight)))
    findings = {} if record.quality is None else record.quality.findings
    if findings:
        rows = [[reason, count(times)] for reason, times in findings.items()]
        caption = f"What was found in the log of {flight.label}."
        table = Table(f"quality-{index}", caption, ("What: what was done", "Count"), rows)
        yield Folded("what was found in the log, and done about it", [table], shown=True)
    yield from _rotor_torque(flight)
    yield from _effects(flight)
    warnings = () if record.quality is None else record.quality.warning or ()
    for warning in dict.fromkeys((*warnings, *missing_signals(record))):
        yield Text(warning, "warning")


def missing_signals(flight: FlightRecord) -> tuple[str, ...]:
    """Say which later commands will refuse a flight for what it lacks, and which key of the config would provide it."""
    rotors = flight.rotor_speed is not None or flight.rotor_command is not None
    sentences = _LACKS | ({"torque": _NO_TORQUE_BUT_ROTORS} if rotors else {})
    return tuple(sentences[name] for name in flight.lacks)


def import_blocks(report: ImportReport) -> Iterator[Block]:
    """Say of an import what its flight does not hold: the rows of the log, and how well the delay is determined."""
    lost, cropped = (report.dropped.get(reason, 0) for reason in ("gap", "crop"))
    share = whole_percent(lost / max(report.samples_read - cropped, 1))
    kept = " of what import.crop_s keeps" if cropped else ""
    left_out = f"; {lost} of these, {share}{kept}, are beyond a gap and left out" if lost else ""
    yield Text(f"{report.samples} samples at {report.rate_hz:.4g} Hz from {report.samples_read} rows{left_out}")
    if report.delay is not None:
        r2 = " ".join(f"{value:.3f}" for value in report.delay.r2)
        yield Text(f"R² of the rigid body about the body axes at the delay that was estimated: {r2}")


def autopilot_text(position_rms_m: float, position_max_m: float, attitude_rms_rad: Sequence[float]) -> Text:
    """Say how far an autopilot was off its path."""
    degrees = " ".join(f"{np.degrees(rms):.2g}" for rms in attitude_rms_rad)
    away = f"{position_rms_m:.3g} m rms, {position_max_m:.3g} m at most"
    return Text(f"off the path by {away}; attitude by {degrees} deg rms (roll pitch yaw)")


def _facts(flight: Source[FlightRecord]) -> Iterator[tuple[str, str]]:
    record = flight.record
    inputs = flight.header.inputs.items()
    origins = (f"{_ORIGINS.get(role, role)} {file.name} (sha256 {file.sha256[:HASH_SHOWN]})" for role, file in inputs)
    yield "Source", ", ".join(origins)
    duration = float(record.time[-1] - record.time[0]) if len(record.time) else 0.0
    rate = (len(record.time) - 1) / duration if duration > 0 else float("nan")
    yield "Samples", f"{len(record.time)} over {duration:.2f} s, {number(rate)} per second"
    if record.torque is not None:
        shown = (f"{number(value)} {axis}" for value, axis in zip(record.largest_torque, AXES, strict=True))
        yield "Largest torque, N m", ", ".join(shown)
    if record.delay is not None:
        r2, told = record.delay.best_r2, "as the config states"
        if r2 is not None:
            told = f"estimated from this flight (pooled R² of the rigid body there {r2:.3f})"
        yield "Delay taken out", f"{1e3 * record.delay.value:.1f} ms of motion behind command, {told}"
    if record.setpoints_known:
        yield "Setpoints", ", ".join(_setpoints(record))
    yield "Noise added", _noise(flight)


def _setpoints(record: FlightRecord) -> Iterator[str]:
    """Name the setpoints; of one that is not known in all of the flight, say in how much of it."""
    samples = len(record.time)
    for name, known in record.setpoints_known.items():
        yield name.replace("_", " ") + ("" if known == samples else f" (at {known} of {samples} samples)")


def _noise(flight: Source[FlightRecord]) -> str:
    noise = flight.record.noise
    if noise is None:
        return "none" if flight.made_from("trajectory") else "none; this is a recording"
    words = [f"{name} {' '.join(plain(v) for v in row)}" for name, row in zip(noise.signal, noise.std, strict=True)]
    return f"{'; '.join(words)} (standard deviation by axis, SI units)"


def _rotor_torque(flight: Source[FlightRecord]) -> Iterator[Text]:
    """Say how the body torque was computed, where an import took it from the rotors."""
    settings: Mapping[str, Any] = flight.config["import"] if flight.made_from("log") else {"torque_source": None}
    source = settings["torque_source"]
    if source == "rotor-speed":
        yield Text("body torque: of vehicle.rotors at their measured speeds")
    elif source == "rotor-command" and settings["signals"]["rotor_command"]["unit"] in SPEED_UNITS:
        yield Text("body torque: of vehicle.rotors, commanded speeds taken for speeds")
    elif source == "rotor-command":
        largest = f"{flight.vehicle.rotor_speed_max_rad_s:g} rad/s"
        yield Text(f"body torque: of vehicle.rotors, speed = command * vehicle.rotor_speed_max_rad_s ({largest})")


def _effects(flight: Source[FlightRecord]) -> Iterator[Text]:
    """List the effects that were flown beyond the model, where a flight in closed loop could have any."""
    if flight.made_from("trajectory") and flight.config["simulation"]["mode"] == "closed-loop":
        effects = {} if flight.record.effects is None else flight.record.effects.by_name
        model = flight.header.inputs.get("model")
        own = ", those of the model among them" if model is not None else ""
        yield Text(f"effects{own}: {', '.join(f'{name} = {value:g}' for name, value in effects.items()) or 'none'}")


def flight_blocks(flight: Source[FlightRecord], index: int, sources: Sources) -> Iterator[Block]:
    """Show a flight, its figures but for those of its path."""
    record, label, name = flight.record, flight.label, f"figure-3-flight-{index}"
    yield Heading(label)
    yield from answer(flight, index)
    if record.attitude is not None and sources.by_hash(flight.made_from("trajectory")) is None:
        # On the circle where angles go round it: they would run off any other figure.
        if record.turns and record.attitude_rate is not None:
            yield rotation_figure(name, label, record)
        else:
            yield attitude_figure(name, label, record)
    if record.torque is not None:
        yield torque_figure(f"figure-4-torque-{index}", label, record.time, record.torque)


def attitude_figure(name: str, label: str, flown: Any) -> Plot:
    """Show roll and pitch of a flight."""
    largest = np.degrees(np.abs(flown.attitude[:, :2]).max(axis=0))
    caption = f"Figure 3. Roll and pitch of {label}; they stay within ±{largest[0]:.1f}° and ±{largest[1]:.1f}°."
    return plot(name, caption, "Roll and pitch angle over time", 2.7, partial(draw_attitude, flown))


def rotation_figure(name: str, label: str, flown: Any) -> Plot:
    """Show attitude and Euler rates of full rotations."""
    degrees = np.degrees(flown.attitude)
    turns = ", ".join(f"{axis} {np.ptp(degrees[:, index]) / _TURN:.1f}" for index, axis in enumerate(AXES))
    caption = f"Attitude and Euler rates of {label}; range in turns: {turns}."
    description = "Roll, pitch and yaw on the circle, and their rates, over time"
    return plot(name, caption, description, 4.6, partial(draw_rotation, flown))


def draw_attitude(r: Any, figure: Figure) -> None:
    """Draw roll and pitch of a path or a flight: Figure 3 of the paper."""
    axes = figure.subplots()
    for index, axis in enumerate(AXES[:2]):
        line(axes, r.time, np.degrees(r.attitude[:, index]), label=axis, **style_of(index))
    axes.set_xlabel("time, s")
    axes.set_ylabel("angle, °")
    legend_above(axes)


def draw_rotation(r: Any, figure: Figure) -> None:
    """Draw attitude and Euler rates of full rotations, angles on the circle."""
    angles, rates = stacked(figure, 2)
    for index, axis in enumerate(AXES):
        style = style_of(index)
        wrapped = np.mod(np.degrees(r.attitude[:, index]), _TURN)
        # Without the strokes where an angle goes round.
        seams = np.flatnonzero(np.abs(np.diff(wrapped)) > _TURN / 2) + 1
        for part_number, part in enumerate(np.split(np.arange(len(r.time)), seams)):
            line(angles, r.time[part], wrapped[part], label=axis if part_number == 0 else None, **style)
        line(rates, r.time, r.attitude_rate[:, index], **style)
    angles.set_yticks([0, 90, 180, 270, 360])
    angles.set_ylabel("angle on the circle, °")
    rates.set_ylabel("Euler rate, rad/s")
    rates.set_xlabel("time, s")
    legend_above(angles)


def torque_figure(name: str, label: str, time: Array, torque: Array) -> Plot:
    """Draw the generalised torque of a flight, one panel per axis: Figure 4 of the paper."""

    def draw(figure: Figure) -> None:
        panels = stacked(figure, 3)
        for index, (axes, axis) in enumerate(zip(panels, AXES, strict=True)):
            line(axes, time, torque[:, index], **style_of(0))
            axes.set_title(f"torque on {axis}")
            axes.set_ylabel("N m")
        panels[-1].set_xlabel("time, s")

    caption = f"Figure 4. Generalised torque on the Euler angles along {label}."
    return plot(name, caption, "Generalised torque on roll, pitch and yaw over time", 4.6, draw)


def vehicle_section(sources: Sources) -> Section:
    """Show the vehicle of the study: Table 3 of the paper."""
    caption = (
        "The vehicle of the study config. A range means that the rotors differ; the arm is the distance of a "
        "rotor from the z axis."
    )
    blocks: list[Block] = [Table("table-3-vehicle", caption, ("Quantity", "Study"), list(_vehicle_rows(sources)))]
    unknown = sources.vehicle.unknown
    if unknown:
        names = joined(name.replace("_", " ") for name in unknown)
        blocks.append(Text(f"Guesses stand here for what the config leaves open: {names}.", "warning"))
    other = [source.label for source in sources.all if source.vehicle != sources.vehicle]
    if other:
        blocks.append(Text(f"Made with another vehicle than this one: {', '.join(other)}.", "warning"))
    return Section("stated-vehicle", "Vehicle", blocks)


def _vehicle_rows(sources: Sources) -> Iterator[tuple[str, str]]:
    vehicle = sources.vehicle
    yield "gravity g, m/s²", plain(vehicle.gravity_m_s2)
    yield "mass m, kg", plain(vehicle.mass_kg)
    yield "rotors", str(len(vehicle.rotors))
    yield "arm l, m", _range([float(np.hypot(*rotor.position_m[:2])) for rotor in vehicle.rotors])
    yield "thrust factor k, N s²", _range([rotor.thrust_factor_n_s2 for rotor in vehicle.rotors])
    yield "drag factor b, N m s²", _range([rotor.drag_factor_n_m_s2 for rotor in vehicle.rotors])
    for name, moment in zip(INERTIA_PARAMETERS, vehicle.inertia_kg_m2, strict=False):
        yield f"{name}, kg m²", plain(moment)
    if not sources.only_gap:
        times = [source.record.time for source in sources.flights or sources.trajectories]
        durations = [float(time[-1] - time[0]) for time in times if len(time)]
        yield "flight time T, s", _range(durations) if times else UNKNOWN


def _range(values: Sequence[float]) -> str:
    low, high = (plain(float(f"{value:.4g}")) for value in (min(values), max(values)))
    return low if low == high else f"{low} … {high}"
