"""The page of a planned path: its moves and peaks, and what it asks of the vehicle."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.scores import AXES
from cpfls_cli.artifacts.trajectory import DERIVATIVES, ExcitedGroup, LegGroup, RunsGroup, TrajectoryRecord
from cpfls_cli.pages.next_flight import question_blocks
from cpfls_cli.pages.source import Source
from cpfls_cli.report.canvas import BASELINE, legend_above, line, plot, stacked, style_of
from cpfls_cli.report.content import Block, Folded, Plot, Table, Text
from cpfls_cli.report.numbers import number, plain
from cpfls_cli.trajectory.legs import Leg
from cpfls_cli.trajectory.planning import PlannedRotation, Trajectory
from cpfls_cli.vehicle.rotors import RotorViolation
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.words import joined

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from cpfls_cli.excitation.optimise import Excitation
    from cpfls_cli.simulation.inverse import Flyability, TooMuch

_UNITS = ("m/s⁶", "m/s⁵", "m/s⁴", "m/s³", "m/s²", "m/s", "m")
_MOVES_SHOWN = 20
_TURN = 360.0
_MINUTE = 60.0
_RUNS_SHOWN = 8


def answer(trajectory: Source[TrajectoryRecord], index: int = 1) -> Iterator[Block]:
    """Say what a path asks for: its peaks and its moves, or how a held vehicle turns."""
    record = trajectory.record
    if record.held:
        yield Text("the vehicle is held at its centre of mass and only turns")
        yield _turns(f"turns-{index}", trajectory)
        return
    if record.question is not None:
        yield from question_blocks(f"questions-{index}", record.question)
    if record.excited is not None:
        yield from _excited_blocks(record.excited)
    if record.run is not None:
        yield from _runs_blocks(record.run)
    peaks, alone = _peaks(f"peaks-{index}", trajectory), not (record.question or record.excited or record.run)
    yield peaks if alone else Folded("largest derivatives", [peaks], shown=True)
    if record.leg is not None and any(record.leg.limited_by):
        yield Folded("moves under limits", [_moves(f"legs-{index}", trajectory.label, record.leg)], shown=True)


def _runs_blocks(runs: RunsGroup) -> Iterator[Block]:
    """Say when the runs of a repeated path are flown, how long it takes, and why."""
    between = runs.begin[1] - runs.end[0]
    yield Text(
        f"The path is flown {len(runs.begin)} times, each run the same from rest to rest: {plain(runs.end[0])} s each, "
        f"{plain(between)} s between two runs to come back to the start and settle, {plain(runs.end[-1])} s "
        f"({runs.end[-1] / _MINUTE:.1f} min) in all. Runs begin at {_times(runs.begin)} s."
    )
    why = Text(
        "What every run shows again was asked for by the path; what differs between them is gusts and noise. The other "
        "runs know nothing of the gusts of this one, so each is an instrument for the others: it tells the vehicle "
        "from the loop."
    )
    yield Folded("why to repeat a path", [why], shown=True)


def _times(begins: Array) -> str:
    listed = [plain(value) for value in begins[:_RUNS_SHOWN]]
    return joined(listed) if len(begins) <= _RUNS_SHOWN else f"{', '.join(listed)}, ..."


_SIGNALS = {
    "multisine": ("a multisine", ", each at frequencies of its own,"),
    "sweep-linear": ("a linear sweep", ", one after the other,"),
    "sweep-logarithmic": ("a logarithmic sweep", ", one after the other,"),
}


def _excited_blocks(excited: ExcitedGroup) -> Iterator[Block]:
    """Say what a test signal excites, in which band, how far it moves the vehicle, and what made it smaller."""
    low, high = excited.band
    moved = np.linalg.norm(excited.position, axis=1).max()
    away = f"; it moves the vehicle by up to {number(moved, 2)} m" if moved else ""
    signal, apart = _SIGNALS[excited.signal]
    angles = [number(float(size), 3) for size in np.degrees(excited.size)]
    pairs = joined(f"{axis} {angle}" for axis, angle in zip(excited.axis, angles, strict=True))
    yield Text(
        f"Excited: {joined(excited.axis)}, by {signal}{apart if len(excited.axis) > 1 else ''} from {low:g} to "
        f"{high:g} Hz, {angles[0] if len(set(angles)) == 1 else pairs} degrees at most"
        f"{_VERTICAL if 'vertical' in excited.axis else ''}, at equal rates in the band (crest factor "
        f"{number(excited.crest.max(), 2)}){away}."
    )
    for limit in filter(None, dict.fromkeys(excited.limit)):
        axes = joined(axis for axis, reached in zip(excited.axis, excited.limit, strict=True) if reached == limit)
        yield Text(f"{axes}: excited less than asked for, because more would pass the limit on {limit}", "warning")


_VERTICAL = ", of vertical with as much acceleration as such a tilt"


def mission_blocks(files: Iterable[Path], forms: Sequence[str], record: TrajectoryRecord) -> list[Block]:
    """Name the files for autopilots, and say what each does with the path."""
    names = ", ".join(map(str, files))
    said = [f"written beside it: {names}"] if names else []
    if "px4" in forms:
        said.append(
            "PX4 flies the mission in its own time, by its own limits, at rest at each point: runs are alike, but do "
            "not take as long as those planned. Load it in QGroundControl, and check heights and the way back."
        )
    if "ardupilot" in forms:
        runs = 1 if record.run is None else len(record.run.begin)
        times = "once" if runs == 1 else f"{runs} times"
        said.append(
            f"ArduPilot makes the sweeps itself, in hover: switch to System ID mode {times} for each axis; the path of "
            "the artifact is not flown."
        )
    return [Text(sentence) for sentence in said]


def guessed_words(vehicle: VehicleSettings) -> list[str]:
    """Warn where what the rotors can was checked with guesses."""
    if not vehicle.unknown:
        return []
    return [
        f"{joined(name.replace('_', ' ') for name in vehicle.unknown)}: null in the config; what the path asks of the "
        "rotors was checked with guesses"
    ]


def plan_blocks(planned: PlannedRotation, demand: Flyability, excitation: Excitation | None) -> Iterator[Block]:
    """Say of a plan what its samples do not hold: how long it is, and what it asks of the vehicle between them."""
    yield Text(f"{len(planned.time)} samples over {planned.duration:g} s")
    if isinstance(planned, Trajectory):
        tilt, thrust = np.degrees(demand.tilt.max()), demand.thrust.max()
        yield Text(f"largest tilt {tilt:.3g} deg, largest thrust {thrust:.4g} N")
        if any(leg.limited_by for leg in planned.legs):
            jerk = ", ".join(f"{absolute_jerk(leg):.4g}" for leg in planned.legs[:_MOVES_SHOWN])
            yield Text(f"integral of |jerk| by move, m/s^2: {jerk}")
    if excitation is not None:
        yield Text(
            f"condition number of the model's regressor {excitation.condition_number:.4g}, uniform partitions; of "
            f"{len(excitation.random)} random paths the best had {excitation.random.min():.4g}, the median "
            f"{np.median(excitation.random):.4g}"
        )


def absolute_jerk(leg: Leg) -> float:
    """Integrate the absolute jerk of the axis that has most of it, m/s^2."""
    return max(profile.integral_of_absolute_jerk for profile in leg.profiles)


def demand_sentences(demand: Flyability, planned: PlannedRotation) -> tuple[str, ...]:
    """Say what a plan asks for beyond what the vehicle has, with its time and place; nothing where it can do it all."""
    return (
        *(_too_much(too_much, planned) for too_much in demand.too_much),
        *(violation_sentence(one, planned.time) + _place(one.first, planned) for one in demand.rotors),
    )


def violation_sentence(violation: RotorViolation, time: Array) -> str:
    """Say what a rotor was asked for that it cannot do."""
    start, end = time[violation.first], time[violation.last]
    return (
        f"M{violation.rotor + 1}: {violation.kind} asked for at {_samples(violation.count)} from {start:.2f} s to "
        f"{end:.2f} s (worst squared speed {violation.worst:.6g} rad^2/s^2)"
    )


def _too_much(too_much: TooMuch, planned: PlannedRotation) -> str:
    name, unit = too_much.what.split(", ")
    worst = f"{too_much.worst:.4g} {unit} at {planned.time[too_much.at]:.2f} s{_place(too_much.at, planned)}"
    start = f"from {planned.time[too_much.first]:.2f} s, {_samples(too_much.count)}"
    return f"{name} of up to {worst} asked for; the limit is {too_much.limit:.4g} {unit} (beyond it {start})"


def _samples(count: int) -> str:
    return f"{count} sample{'' if count == 1 else 's'}"


def _place(sample: int, planned: PlannedRotation) -> str:
    if isinstance(planned, Trajectory):
        return f", at x y z = {_written(planned.position[sample])} m"
    return f", at roll pitch yaw = {_written(np.degrees(planned.attitude[sample]) % _TURN)} deg"


def _written(values: Array) -> str:
    return " ".join(f"{value:.2f}" for value in values)


def path_blocks(trajectory: Source[TrajectoryRecord], index: int) -> Iterator[Block]:
    """Show a planned path with its figures."""
    record, label = trajectory.record, trajectory.label
    yield from answer(trajectory, index)
    if record.held:
        yield rotation_figure(f"figure-rotation-{index}", label, record.time, record.attitude, record.attitude_rate)
    else:
        yield derivatives_figure(f"figure-2-derivatives-{index}", trajectory)
        yield attitude_figure(f"figure-3-attitude-{index}", label, record.time, record.attitude)


def _peaks(name: str, trajectory: Source[TrajectoryRecord]) -> Table:
    peaks = trajectory.record.peaks()
    rows = []
    for derivative, unit in zip(DERIVATIVES, _UNITS, strict=True):
        # Above a snap that jumps there is nothing at the samples, and no bound between them.
        is_unbounded = derivative in ("crackle", "pop") and not peaks[derivative] and peaks["snap"]
        rows.append([derivative, unit, "no bound" if is_unbounded else number(peaks[derivative])])
    caption = f"Largest magnitude of each derivative at the samples of {trajectory.label}, along the path."
    return Table(name, caption, ("Derivative", "Unit", "Largest"), rows, frozenset({0, 1}))


def _moves(name: str, label: str, moves: LegGroup) -> Table:
    rows = []
    for index in range(min(len(moves.begin), _MOVES_SHOWN)):
        begin, length = moves.begin[index], float(np.linalg.norm(moves.displacement[index]))
        numbers = (begin, moves.end[index] - begin, length)
        rows.append([str(index + 1), *map(plain, numbers), moves.limited_by[index].replace(" ", ", ")])
    header = ("Move", "Begins, s", "Takes, s", "Length, m", "Limited by")
    caption = f"Moves of {label} under limits, and the derivatives that reach theirs."
    if len(moves.begin) > _MOVES_SHOWN:
        caption += f" The first {_MOVES_SHOWN} of {len(moves.begin)}."
    return Table(name, caption, header, rows, frozenset({0, 4}))


def _turns(name: str, trajectory: Source[TrajectoryRecord]) -> Table:
    record = trajectory.record
    rows = [
        [quantity, unit, *(number(value) for value in np.abs(values).max(axis=0))]
        for quantity, unit, values in (
            ("Euler rate", "rad/s", record.attitude_rate),
            ("body rate", "rad/s", record.body_rate),
            ("Euler acceleration", "rad/s²", record.attitude_acceleration),
        )
    ]
    caption = f"Largest rates and accelerations of {trajectory.label}; of body rates about x, y and z."
    return Table(name, caption, ("Quantity", "Unit", *AXES), rows, frozenset({0, 1}))


def path_figures(trajectory: Source[TrajectoryRecord]) -> tuple[Plot, ...]:
    """Draw a path: the derivatives (Figure 2) and the attitude (Figure 3), or the rotations of a held vehicle."""
    record, label = trajectory.record, trajectory.label
    if record.held:
        return (rotation_figure("rotation", label, record.time, record.attitude, record.attitude_rate),)
    return (
        derivatives_figure("derivatives", trajectory),
        attitude_figure("attitude", label, record.time, record.attitude),
    )


def figure_names(*, held: bool) -> tuple[str, ...]:
    """Name the figures that `path_figures` draws, before the path is planned."""
    return ("rotation",) if held else ("derivatives", "attitude")


def derivatives_figure(name: str, trajectory: Source[TrajectoryRecord]) -> Plot:
    """Draw pop to displacement over the first leg: Figure 2 of the paper."""
    leg, limits = trajectory.record.first_leg(), _limits(trajectory)

    def draw(figure: Figure) -> None:
        panels = stacked(figure, len(DERIVATIVES))
        for axes, derivative, unit in zip(panels, DERIVATIVES, _UNITS, strict=True):
            curve = leg.curves[derivative]
            line(axes, leg.time, curve, **style_of(0))
            jumps = "" if np.any(curve) else ": not limited, infinite where the derivative below jumps"
            axes.set_title(f"{derivative}{jumps}")
            axes.set_ylabel(unit)
            axes.axhline(0.0, color="#999999", linewidth=0.6)
            for limit in limits.get(derivative, ()):
                axes.axhline(limit, **BASELINE)
        panels[-1].set_xlabel("time, s")

    caption = (
        f"Figure 2. Derivatives of the displacement along the first leg of {trajectory.label}, from the sixth (pop) "
        "down to the displacement itself."
    )
    if limits:
        caption += " Grey: the limits that it was planned under."
    return plot(name, caption, "Seven curves over time: " + ", ".join(DERIVATIVES), 8.6, draw)


def _limits(trajectory: Source[TrajectoryRecord]) -> dict[str, tuple[float, float]]:
    """Limits along a straight leg, by derivative; those that are stated axis by axis are left out."""
    settings = trajectory.config.get("trajectory", {})
    stated = settings.get("limits", {})
    if settings.get("coordination") != "straight-line" or settings.get("displacement_measure") != "along-path":
        return {}
    return {key.split("_")[0]: (-value, value) for key, value in stated.items() if isinstance(value, float)}


def attitude_figure(name: str, label: str, time: Array, attitude: Array) -> Plot:
    """Draw roll and pitch of a path or a flight: Figure 3 of the paper."""
    degrees = np.degrees(attitude)

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for index, axis in enumerate(AXES[:2]):
            line(axes, time, degrees[:, index], label=axis, **style_of(index))
        axes.set_xlabel("time, s")
        axes.set_ylabel("angle, °")
        legend_above(axes)

    largest = np.abs(degrees[:, :2]).max(axis=0)
    caption = f"Figure 3. Roll and pitch of {label}; they stay within ±{largest[0]:.1f}° and ±{largest[1]:.1f}°."
    return plot(name, caption, "Roll and pitch angle over time", 2.7, draw)


def rotation_figure(name: str, label: str, time: Array, attitude: Array, rate: Array) -> Plot:
    """Draw attitude and Euler rates of full rotations, angles on the circle."""
    degrees = np.degrees(attitude)

    def draw(figure: Figure) -> None:
        angles, rates = stacked(figure, 2)
        for index, axis in enumerate(AXES):
            style = style_of(index)
            wrapped = np.mod(degrees[:, index], _TURN)
            # Without the strokes where an angle goes round.
            seams = np.flatnonzero(np.abs(np.diff(wrapped)) > _TURN / 2) + 1
            for part_number, part in enumerate(np.split(np.arange(len(time)), seams)):
                line(angles, time[part], wrapped[part], label=axis if part_number == 0 else None, **style)
            line(rates, time, rate[:, index], **style)
        angles.set_yticks([0, 90, 180, 270, 360])
        angles.set_ylabel("angle on the circle, °")
        rates.set_ylabel("Euler rate, rad/s")
        rates.set_xlabel("time, s")
        legend_above(angles)

    turns = ", ".join(f"{axis} {np.ptp(degrees[:, index]) / _TURN:.1f}" for index, axis in enumerate(AXES))
    caption = f"Attitude and Euler rates of {label}; range in turns: {turns}."
    return plot(name, caption, "Roll, pitch and yaw on the circle, and their rates, over time", 4.6, draw)
