"""What turns a nano-drone below 2 Hz beside its rotors: candidates by repeated flights (docs/low-frequency-torque.md).

    python benchmarks/low_frequency_torque.py [NANODRONE] [NANOBENCH]
    python benchmarks/low_frequency_torque.py --training     without the path that is kept aside
    python benchmarks/low_frequency_torque.py --truth        simulated flights with flapping and nothing else missing

NANODRONE is what `benchmarks/nanodrone.py` reads, NANOBENCH the folder datasets/dataset of syediu/nanobench-iros2026
(commit 0ae7d68). Default are the folders nanodrone and nanobench in CPFLS_FLIGHTS; a vehicle whose folder is absent is
left out. Figures are drawn into docs/low-frequency-torque.svg where both are there.

Each run is held against the mean of the other runs of its path, which are its instruments (docs/closed-loop.md). All
candidates were chosen on the paths square and random; melon is kept aside, and numbers found on the others stand there
as they are. The paths random1 and random2 are one path flown at two speeds, and count as one.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.shared.measure import pin_threads, table

pin_threads()

import numpy as np
from matplotlib.figure import Figure

from benchmarks.shared.nanobench_files import INERTIA as NANOBENCH_INERTIA
from benchmarks.shared.nanobench_files import MASS as NANOBENCH_MASS
from benchmarks.shared.nanobench_files import commanded_flights, late_by_lag
from benchmarks.shared.nanodrone_files import (
    ARM,
    INERTIA,
    MASS,
    PERIOD,
    TEST,
    THRUST_FACTOR,
    TRAINING,
    VEHICLE,
    flights,
)
from cpfls_cli.arrays import Array
from cpfls_cli.blocks import jackknife_error
from cpfls_cli.playback.balances import band_windows
from cpfls_cli.playback.flight import PlaybackFlight
from cpfls_cli.playback.gusts import Gusts
from cpfls_cli.playback.instruments import Instruments, instruments
from cpfls_cli.playback.kernels import MeasuredMotion
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.report.canvas import GREY, line, plot, style_of
from cpfls_cli.rotations import rotation_matrix
from cpfls_cli.simulation.measured import measure
from cpfls_cli.simulation.settings import ClosedLoopSettings, SimulationSettings
from tests.builders.gusty_flights import EVERY, GUSTS, MEMORY_S, SMALL, STEP_S, path_of
from tests.builders.gusty_flights import Flight as Asked
from tests.builders.recorded_flights import FLIGHTS

OUTPUT = Path(__file__).resolve().parents[1] / "docs" / "low-frequency-torque.svg"
BANDS = {"0.3 to 1": (0.95, 2.6), "0.5 to 2": (0.5, 1.6), "1 to 3": (0.3, 0.8), "2 to 8": (0.12, 0.4)}
"""Windows in s by the frequencies in Hz that they pass, about."""
SLOW = ("0.3 to 1", "0.5 to 2", "1 to 3")
FAST = "2 to 8"
AXES = ("roll", "pitch")
BLOCK_S = 6.0
GRAVITY = 9.81
HOVER_SPEED = 4.35
"""Induced velocity of one rotor of either vehicle in hover, by momentum theory: 4.35 and 4.49 m/s."""
SPEEDS = np.array([0.8, 1.0, 1.3, 1.7, 2.2, 2.8, 3.6, 4.35, 6.0])
LAGS = np.array([0.0, 0.02, 0.04, 0.06, 0.09, 0.13])
ACROSS, CLIMBS = np.array([0.0, 0.7, 1.4, 2.4]), np.array([-0.8, 0.0, 0.8])
NAMED_CLIMBS = ("descent of 0.8 m/s", "level", "climb of 0.8 m/s")
"""Speeds across the rotors and climbs at which the moment of the flow is drawn, m/s."""
MIDDLES = (0.55, 1.0, 1.7, 4.0)
"""Of the bands, Hz."""
TRUE_FLAPPING, TRUE_S, WIDER = -1.0e-7, 60.0, 4.0
"""Of simulated flights: the coefficient, about that of the nano-drone, their length, and how much wider a path is."""
SMALLEST_FLOW = 0.1
"""m/s, that keeps the iteration of the induced velocity from dividing by nothing."""


class Run(NamedTuple):
    """A flight: torque of the rotors about roll and pitch, N m, and their thrust as a share of the weight."""

    path: str
    motion: MeasuredMotion
    torque: Array
    thrust: Array
    speed_sum: Array

    @property
    def air_velocity(self) -> Array:
        """Give the velocity in body axes, shape (time, 3), m/s."""
        return np.asarray(np.einsum("tji,tj->ti", self.motion.rotation, self.motion.velocity))

    @property
    def specific_force(self) -> Array:
        """Give the acceleration less gravity in body axes, shape (time, 3), m/s²."""
        felt = np.gradient(self.motion.velocity, PERIOD, axis=0) + np.array([0.0, 0.0, GRAVITY])
        return np.asarray(np.einsum("tji,tj->ti", self.motion.rotation, felt))


Column = Callable[[Run, int], Array]
"""A signal along a run, by axis: roll 0, pitch 1."""


def rotor_torque(run: Run, axis: int) -> Array:
    return run.torque[:, axis]


def damping(run: Run, axis: int) -> Array:
    return run.motion.rate[:, axis]


def sideways(values: Array, axis: int) -> Array:
    """Pick what raises the leading side where it is positive: y for roll, -x for pitch."""
    return values[:, 1] if axis == 0 else -values[:, 0]


def moving(run: Run, axis: int) -> Array:
    return sideways(run.air_velocity, axis)


def flapping(run: Run, axis: int) -> Array:
    return moving(run, axis) * run.speed_sum


def thrust_moving(run: Run, axis: int) -> Array:
    return moving(run, axis) * run.thrust


def tilt(run: Run, axis: int) -> Array:
    return run.motion.rotation[:, 2, 1] if axis == 0 else -run.motion.rotation[:, 2, 0]


def horizontal(run: Run) -> Array:
    return np.asarray(np.hypot(run.air_velocity[:, 0], run.air_velocity[:, 1]))


def climbing(run: Run) -> Array:
    return run.air_velocity[:, 2]


def wake(run: Run, hover: float) -> tuple[Array, Array]:
    """Compute the axial flow and the speed of the wake, by Glauert's momentum theory, shapes (time,), m/s."""
    axial, across = climbing(run), horizontal(run)
    induced = np.full(len(axial), hover)
    square = hover**2 * np.maximum(run.thrust, 0.1)
    for _ in range(40):
        induced = 0.5 * (induced + square / np.sqrt(across**2 + (axial + induced) ** 2 + SMALLEST_FLOW**2))
    # Momentum theory knows no flow that comes back: the wake is skewed by a right angle at most.
    through = np.maximum(axial + induced, 0.0)
    return through, np.hypot(across, through) + SMALLEST_FLOW


def skewed(hover: float, lag_s: float = 0.0, *, half: bool = True) -> Column:
    """Make thrust times the tangent of half the wake's skew angle, or its sine, behind a lag; m/s where slow."""

    def column(run: Run, axis: int) -> Array:
        through, speed = wake(run, hover)
        length = 0.5 * (speed + through) if half else speed
        return late_by_lag(moving(run, axis) * run.thrust * hover / length, lag_s)

    return column


def times(column: Column, factor: Callable[[Run], Array]) -> Column:
    return lambda run, axis: column(run, axis) * factor(run)


def behind(column: Column, lag_s: float) -> Column:
    return lambda run, axis: late_by_lag(column(run, axis), lag_s)


def along(values: Callable[[Run], Array]) -> Column:
    return lambda run, _: values(run)


def _place(number: int) -> Column:
    return along(lambda run: run.motion.position[:, number])


def _changing(column: Column) -> Column:
    return lambda run, axis: np.gradient(column(run, axis), PERIOD)


FLAPPING = (damping, flapping)
CANDIDATES: Mapping[str, tuple[Column, ...]] = {
    "damping alone": (damping,),
    "flapping, k_f Σω v": FLAPPING,
    "T v in its place": (damping, thrust_moving),
    "v in its place": (damping, moving),
    "+ drag above the centre of mass: lateral specific force": (
        *FLAPPING,
        lambda run, axis: sideways(run.specific_force, axis),
    ),
    "+ v |v|": (*FLAPPING, times(moving, horizontal)),
    "+ centre of mass aside: specific force along z": (*FLAPPING, along(lambda run: run.specific_force[:, 2])),
    "+ unlike rotors: thrust": (*FLAPPING, along(lambda run: run.thrust)),
    "+ vertical velocity": (*FLAPPING, along(climbing)),
    "+ other axis: velocity": (*FLAPPING, lambda run, axis: run.air_velocity[:, axis]),
    "+ other axis: rate": (*FLAPPING, lambda run, axis: run.motion.rate[:, 1 - axis]),
    "+ body gyroscopic, q r": (*FLAPPING, lambda run, axis: run.motion.rate[:, 1 - axis] * run.motion.rate[:, 2]),
    "+ yaw rate": (*FLAPPING, along(lambda run: run.motion.rate[:, 2])),
    "+ place in the room: x, y, z": (*FLAPPING, *(_place(number) for number in range(3))),
    "+ height times v": (*FLAPPING, times(moving, lambda run: run.motion.position[:, 2])),
    "+ tilt (frames; gravity)": (*FLAPPING, tilt),
    "+ lateral acceleration (late velocity)": (*FLAPPING, _changing(moving)),
    "+ change of torque (late rotors)": (*FLAPPING, _changing(rotor_torque)),
    "+ slow torque, 0.3 s": (*FLAPPING, behind(rotor_torque, 0.3)),
    "+ v_z τ": (*FLAPPING, times(rotor_torque, climbing)),
    "+ v_z v": (*FLAPPING, times(moving, climbing)),
    "+ flapping through a lag of 0.05 s": (*FLAPPING, behind(flapping, 0.05)),
    "+ flapping through a lag of 0.2 s": (*FLAPPING, behind(flapping, 0.2)),
    "skewed wake of one rotor, sine": (damping, skewed(HOVER_SPEED, half=False)),
    "skewed wake of one rotor, half angle": (damping, skewed(HOVER_SPEED)),
    "T v, T v v_z and T v |v|": (
        damping,
        thrust_moving,
        times(thrust_moving, climbing),
        times(thrust_moving, horizontal),
    ),
    "the three, and T v through 0.2 s": (
        damping,
        thrust_moving,
        times(thrust_moving, climbing),
        times(thrust_moving, horizontal),
        behind(thrust_moving, 0.2),
    ),
}


@dataclass(frozen=True)
class Vehicle:
    """Runs of a vehicle, its stated moment of inertia in kg m², and its weight in N.

    `groups` are paths that count as one, those that candidates are fitted to, and `aside` one that is not. Where rotor
    speeds are not `measured`, the scale of the torque is unknown, and the stated inertia stands.
    """

    name: str
    runs: tuple[Run, ...]
    inertia: float
    weight: float
    measured: bool
    groups: dict[str, tuple[str, ...] | None]
    aside: dict[str, tuple[str, ...] | None]

    def lever(self, gain: float) -> float:
        """Compute what a rad/s² is as a lever of the weight, mm."""
        return 1e3 * self.inertia / (gain if self.measured else 1.0) / self.weight

    @cached_property
    def paths(self) -> Mapping[str, tuple[tuple[Run, ...], Instruments]]:
        """Runs by path, with those that repeat each other."""
        found = {}
        for path in dict.fromkeys(run.path for run in self.runs):
            of_path = tuple(run for run in self.runs if run.path == path)
            given = instruments([_played(run) for run in of_path])
            if given.kind == "repeats":
                found[path] = (of_path, given)
        return found

    def products(self, columns: Sequence[Column], band: str, axis: int, paths: Sequence[str] | None = None) -> Array:
        """Sum products of the others' columns with the own ones, by block of the paths, shape (block, column, column).

        First the angular acceleration, then the torque of the rotors over the stated inertia, then the columns.
        """
        window, found = band_windows(PERIOD, *BANDS[band]), []
        for path, (runs, given) in self.paths.items():
            if paths is not None and path not in paths:
                continue
            signals = [
                np.column_stack(
                    [run.motion.rate[:, axis], run.torque[:, axis] / self.inertia, *(c(run, axis) for c in columns)]
                )
                for run in runs
            ]
            blocks: dict[int, Array] = {}
            for number, own in enumerate(signals):
                mine, theirs = _laid(window, own), _laid(window, given.repeats.others(number, signals))
                middles = np.arange(len(mine)) * window.hop + len(window.weight) // 2
                place = given.repeats.path(number, len(own))[1][middles]
                known = np.isfinite(theirs).all(axis=1) & np.isfinite(place)
                for block in np.unique(place[known] * PERIOD // BLOCK_S):
                    at = known & (place * PERIOD // BLOCK_S == block)
                    blocks[int(block)] = blocks.get(int(block), 0.0) + theirs[at].T @ mine[at]
            found += list(blocks.values())
        return np.array(found)


def _played(run: Run) -> PlaybackFlight:
    length = len(run.thrust)
    speed = np.ones((length, 4))
    return PlaybackFlight(name=run.path, motion=run.motion, speed=speed, hold="previous", stretches=(slice(0, length),))


def _laid(window: object, signals: Array) -> Array:
    return np.column_stack([window.derivative(signals[:, :1]), window.average(signals[:, 1:])])  # type: ignore[attr-defined]


def nanodrone(folder: Path, names: Sequence[str]) -> tuple[Run, ...]:
    """Read flights of the nano-drone benchmark, whose rotor speeds are measured."""
    return tuple(_by_speed(each.name.split("_")[0], each.motion, each.speed) for each in flights(folder, names))


def _by_speed(path: str, motion: MeasuredMotion, speed: Array) -> Run:
    front_right, back_right, back_left, front_left = THRUST_FACTOR * speed.T**2
    torque = ARM * np.stack(
        [back_left + front_left - front_right - back_right, back_right + back_left - front_right - front_left], axis=1
    )
    thrust = (front_right + back_right + back_left + front_left) / (MASS * GRAVITY)
    return Run(path, motion, torque, thrust, speed.sum(axis=1))


def simulated() -> tuple[Run, ...]:
    """Fly two paths four times by the package's autopilot in gusts, with the moment of flapping hubs."""
    gusts = Gusts(np.array([*np.multiply(GUSTS, INERTIA), *[0.0] * 3]), np.array([*MEMORY_S, *[1.0] * 3]))
    model = VehicleModel(vehicle=VEHICLE, gusts=gusts)
    loop = ClosedLoopSettings(effects={"flapping_moment": (TRUE_FLAPPING,)}, gusts=True, rotor_time_constant_s=0.02)
    noise = {"body_rate": SMALL.gyro_noise, "rotor_speed": 2.0}
    settings = SimulationSettings(mode="closed-loop", closed_loop=loop, noise=noise)
    found = []
    for path, draw in product(range(2), range(4)):
        asked = WIDER * path_of(Asked(SMALL, path=path), round(TRUE_S / STEP_S))[::EVERY]
        planned = dict(zip(("position", "velocity", "acceleration"), np.split(asked, 3, axis=1), strict=True))
        planned |= dict.fromkeys(("attitude", "attitude_rate", "attitude_acceleration"), np.zeros((len(asked), 3)))
        time, rng = PERIOD * np.arange(len(asked)), np.random.default_rng([path, draw])
        logged = measure(time, planned, VEHICLE, settings, rng, model=model).signals
        rotation = rotation_matrix(logged["attitude"])
        motion = MeasuredMotion(logged["position"], logged["velocity"], rotation, logged["body_rate"], PERIOD)
        found.append(_by_speed(f"path {path + 1}", motion, logged["rotor_speed"]))
    return tuple(found)


def nanobench(folder: Path) -> tuple[Run, ...]:
    """Read flights of NanoBench; the sum of the rotor speeds is one in proportion to the root of the thrust."""
    return tuple(
        Run(flight.path, flight.motion, flight.torque, share, np.sqrt(share))
        for flight in commanded_flights(folder)
        for share in (flight.thrust / (NANOBENCH_MASS * GRAVITY),)
    )


def solved(total: Array, target: Array, columns: Array) -> Array:
    """Solve for the coefficients of columns so that what is left of the target repeats nowhere in them."""
    return np.asarray(np.linalg.solve(columns.T @ total @ columns, columns.T @ total @ target))


def effectiveness(vehicle: Vehicle, band: str, axis: int, paths: Sequence[str] | None) -> tuple[Array, Array]:
    """Regress angular acceleration on torque, velocity and rate: 1/I over the stated, and the share; errors beside."""
    blocks = vehicle.products([thrust_moving, damping], band, axis, paths)
    size = blocks.shape[-1]
    target, columns = np.eye(size)[:, 0], np.eye(size)[:, 1:]

    def of(total: Array) -> Array:
        found = solved(total, target, columns)
        left = target - columns @ found
        return np.array([found[0], 1 - left @ total @ left / total[0, 0]])

    whole = blocks.sum(axis=0)
    return of(whole), jackknife_error(np.array([of(whole - block) for block in blocks]))


class Fit(NamedTuple):
    """Coefficients of columns, in rad/s² by their units, their errors, and where they were found."""

    gain: float
    coefficients: Array
    errors: Array


def _balanced(gain: float, size: int) -> tuple[Array, Array]:
    """Pick what turns the body beside its rotors, and the columns behind it."""
    return np.eye(size)[:, 0] - gain * np.eye(size)[:, 1], np.eye(size)[:, 2:]


def pooled(
    vehicle: Vehicle, columns: Sequence[Column], axis: int, groups: Iterable[Sequence[str] | None] | None = None
) -> Array:
    """Take products of the slow bands, each path and band in proportion to its angular acceleration."""
    chosen = list(vehicle.groups.values() if groups is None else groups)
    parts = [vehicle.products(columns, band, axis, paths) for band in SLOW for paths in chosen]
    return np.concatenate([part / part[:, 0, 0].sum() for part in parts])


def fitted(
    vehicle: Vehicle,
    columns: Sequence[Column],
    axis: int,
    gain: float,
    groups: Iterable[Sequence[str] | None] | None = None,
) -> Fit:
    """Fit columns to what turns the body beside its rotors, its inertia being that of fast motion."""
    blocks = pooled(vehicle, columns, axis, groups)
    target, picked = _balanced(gain, blocks.shape[-1])
    whole = blocks.sum(axis=0)
    left_out = np.array([solved(whole - block, target, picked) for block in blocks])
    return Fit(gain, solved(whole, target, picked), jackknife_error(left_out))


def explained(
    vehicle: Vehicle, columns: Sequence[Column], axis: int, fit: Fit, band: str, paths: Sequence[str] | None
) -> tuple[Array, Array]:
    """Tell the shares that a fit explains, of the angular acceleration and of what turns beside rotors, and errors."""
    blocks = vehicle.products(columns, band, axis, paths)
    target, picked = _balanced(fit.gain, blocks.shape[-1])
    left = target - picked @ fit.coefficients

    def of(total: Array) -> Array:
        missing = left @ total @ left
        return np.array([1 - missing / total[0, 0], 1 - missing / (target @ total @ target)])

    whole = blocks.sum(axis=0)
    return of(whole), jackknife_error(np.array([of(whole - block) for block in blocks]))


class Wake(NamedTuple):
    """A skewed wake: slope by speed, mm of lever per m/s, induced velocity in m/s and lag in s, errors beside."""

    slope: tuple[float, float]
    hover: tuple[float, float]
    lag_s: tuple[float, float]
    gain_of_skew: tuple[float, float]


def _lowest(values: Array, at: Array) -> float:
    """Find the minimum by a parabola through the lowest three."""
    best = int(np.clip(np.argmin(values), 1, len(at) - 2))
    curve = np.polyfit(at[best - 1 : best + 2], values[best - 1 : best + 2], 2)
    lowest = -curve[1] / (2 * curve[0]) if curve[0] > 0 else at[int(np.argmin(values))]
    return float(np.clip(lowest, at[0], at[-1]))


def _profile(
    vehicle: Vehicle, tried: Sequence[Column], axis: int, gain: float, at: Array
) -> tuple[float, float, Array]:
    """Find where the column lies that leaves least, its error, and what all leave: of all blocks, then less each."""
    blocks = pooled(vehicle, [damping, *tried], axis)

    def left(total: Array) -> Array:
        found = []
        for number in range(len(tried)):
            kept = [0, 1, 2, 3 + number]
            target, picked = _balanced(gain, 4)
            part = total[np.ix_(kept, kept)]
            rest = target - picked @ solved(part, target, picked)
            found.append(rest @ part @ rest / (target @ part @ target))
        return np.array(found)

    whole = blocks.sum(axis=0)
    left_out = np.array([left(whole - block) for block in blocks])
    error = jackknife_error(np.array([_lowest(each, at) for each in left_out]))
    return _lowest(left(whole), at), float(error), np.vstack([left(whole), left_out])


def skewed_wake(vehicle: Vehicle, axis: int, gain: float) -> Wake:
    """Find the numbers of a skewed wake, one after the other, until they stay."""
    hover, late = (2.0, 0.0), (0.03, 0.0)
    for _ in range(2):
        at, error, left = _profile(vehicle, [skewed(v, late[0]) for v in SPEEDS], axis, gain, np.log(SPEEDS))
        hover = (float(np.exp(at)), float(np.exp(at)) * error)
        late = _profile(vehicle, [skewed(hover[0], lag) for lag in LAGS], axis, gain, LAGS)[:2]
    gained = left[:, list(SPEEDS).index(HOVER_SPEED)] - left.min(axis=1)
    fit = fitted(vehicle, [damping, skewed(hover[0], late[0])], axis, gain)
    lever = vehicle.lever(gain)
    return Wake(
        (lever * fit.coefficients[1], lever * fit.errors[1]),
        hover,
        late,
        (float(gained[0]), float(jackknife_error(gained[1:]))),
    )


def rows_of_effectiveness(vehicle: Vehicle) -> Iterator[list[object]]:
    """Tell how well rotor torque seems to turn the body, by band, over what it does in fast motion."""
    for name, paths in vehicle.groups.items():
        for axis, title in enumerate(AXES):
            found = {band: effectiveness(vehicle, band, axis, paths) for band in BANDS}
            fast = found[FAST][0][0]
            cells = [
                f"{values[0] / fast:.2f} ± {errors[0] / fast:.2f} ({values[1]:.2f} ± {errors[1]:.2f})"
                for values, errors in found.values()
            ]
            yield [vehicle.name, name, title, *cells]


def rows_of_candidates(
    vehicle: Vehicle, gains: Sequence[float], wakes: Mapping[str, Sequence[Wake]]
) -> Iterator[list[object]]:
    """Tell what each candidate explains with one set of numbers, by path and band."""
    candidates = {name: (columns, columns) for name, columns in CANDIDATES.items()}
    for name, (roll, pitch) in wakes.items():
        columns = ((damping, skewed(each.hover[0], each.lag_s[0])) for each in (roll, pitch))
        candidates[f"skewed wake, speed and lag of {name}"] = (next(columns), next(columns))
    for name, by_axis in candidates.items():
        for axis, title in enumerate(AXES):
            fit = fitted(vehicle, by_axis[axis], axis, gains[axis])
            shares = [
                explained(vehicle, by_axis[axis], axis, fit, band, paths)
                for paths in (vehicle.groups | vehicle.aside).values()
                for band in SLOW
            ]
            numbers = zip(fit.coefficients[1:], fit.errors[1:], strict=True)
            yield [
                name,
                title,
                *(f"{share[0]:.2f} ± {error[0]:.2f} ({share[1]:.3f} ± {error[1]:.3f})" for share, error in shares),
                ", ".join(f"{value:.3g} ± {error:.2g}" for value, error in numbers),
            ]


def rows_of_wakes(vehicle: Vehicle, gains: Sequence[float], wakes: Sequence[Wake]) -> Iterator[list[object]]:
    """Tell the numbers of the skewed wake."""
    for axis, title in enumerate(AXES):
        slope, hover, late, gained = wakes[axis]
        yield [
            vehicle.name,
            title,
            f"{1e5 * vehicle.inertia / gains[axis]:.2f}",
            f"{slope[0]:.2f} ± {slope[1]:.2f}",
            f"{hover[0]:.2f} ± {hover[1]:.2f}",
            f"{1e3 * late[0]:.0f} ± {1e3 * late[1]:.0f}",
            f"{gained[0]:.4f} ± {gained[1]:.4f}",
        ]


def rows_of_climb(vehicle: Vehicle, gains: Sequence[float]) -> Iterator[list[object]]:
    """Tell by how much climb raises the effect of rotor torque, or lowers the moment of the flow: each alone, both."""
    columns = (damping, flapping, times(rotor_torque, climbing), times(flapping, climbing))
    for (name, paths), axis in product(vehicle.groups.items(), range(2)):
        cells = []
        for chosen in ((2,), (3,), (2, 3)):
            taken = [columns[number] for number in (0, 1, *chosen)]
            _, found, errors = fitted(vehicle, taken, axis, gains[axis], [paths])
            units = [gains[axis] / vehicle.inertia if number == 2 else found[1] for number in chosen]
            cells += [
                f"{value / unit:+.2f} ± {error / unit:.2f}"
                for value, error, unit in zip(found[2:], errors[2:], units, strict=True)
            ]
        yield [vehicle.name, name, AXES[axis], *cells]


def lever_by_speed(vehicle: Vehicle, axis: int, gain: float) -> tuple[Array, Array]:
    """Find the lever of the flow's moment at speeds and climbs, mm, and its errors, shapes (speed, climb)."""
    columns = [_hat(speed, climb) for speed in range(1, len(ACROSS)) for climb in range(len(CLIMBS))]
    fit = fitted(vehicle, [damping, *columns], axis, gain)
    scale = vehicle.lever(gain)
    shape = len(ACROSS) - 1, len(CLIMBS)
    return scale * fit.coefficients[1:].reshape(shape), scale * fit.errors[1:].reshape(shape)


def _hat(speed: int, climb: int) -> Column:
    """Make thrust along the velocity near one speed and climb, linear up to the next ones."""

    def column(run: Run, axis: int) -> Array:
        across = np.clip(horizontal(run), 0.05, ACROSS[-1])
        near = np.interp(across, ACROSS, np.eye(len(ACROSS))[speed])
        climbs = np.clip(climbing(run), CLIMBS[0], CLIMBS[-1])
        here = near * np.interp(climbs, CLIMBS, np.eye(len(CLIMBS))[climb])
        return np.asarray(moving(run, axis) / across * here * run.thrust)

    return column


def draw(vehicles: Sequence[Vehicle]) -> str:
    """Draw how well rotor torque seems to turn the bodies by frequency, and the moment of the flow by speed."""
    drone = vehicles[0]
    found, errors = lever_by_speed(drone, 1, inertia_gain(drone, 1))

    def fill(figure: Figure) -> None:
        left, right = figure.subplots(1, 2)
        rows = [(drone, "random"), *((each, name) for each in vehicles[1:] for name in each.groups)]
        for number, ((vehicle, name), axis) in enumerate((row, axis) for row in rows for axis in range(2)):
            by_band = [effectiveness(vehicle, band, axis, vehicle.groups[name]) for band in BANDS]
            fast = by_band[-1][0][0]
            style = style_of(number) | {"marker": "os"[axis], "markersize": 4, "capsize": 2}
            values, spreads = ([each[part][0] / fast for each in by_band] for part in (0, 1))
            left.errorbar(MIDDLES, values, spreads, label=f"{vehicle.name}, {AXES[axis]}", **style)
        line(left, np.array(MIDDLES), np.ones(len(MIDDLES)), color=GREY, linestyle="--", label="a rigid body")
        left.set(xscale="log", ylim=(0, 1.25), xlabel="frequency / Hz", ylabel="effect of rotor torque over 2 to 8 Hz")
        left.set_xticks(MIDDLES, [f"{each:g}" for each in MIDDLES], minor=False)
        left.minorticks_off()
        for climb, name in enumerate(NAMED_CLIMBS):
            style = style_of(climb) | {"marker": "o", "markersize": 4, "capsize": 2}
            right.errorbar(ACROSS[1:], found[:, climb], errors[:, climb], label=name, **style)
        right.set(
            xlim=(0, 2.6), ylim=(0, None), xlabel="speed / (m/s)", ylabel="lever of the flow's moment about pitch / mm"
        )
        for axes in (left, right):
            axes.legend(loc="lower right", fontsize="small")

    caption = "What rotor torque seems to do, and what it is spent on"
    description = (
        "On two vehicles rotor torque seems to turn the body ever less below 2 Hz, down to a fifth; and the moment of "
        "the flow about pitch by speed, which bends, and is larger in descent than in climb"
    )
    return plot("low-frequency-torque", caption, description, 3.6, fill).picture.svg


def inertia_gain(vehicle: Vehicle, axis: int) -> float:
    """Find by how much the body turns faster than its stated inertia says, in fast motion."""
    learned = [path for path in vehicle.paths if (path,) not in vehicle.aside.values()]
    blocks = vehicle.products([flapping, damping], FAST, axis, learned)
    size = blocks.shape[-1]
    return float(solved(blocks.sum(axis=0), np.eye(size)[:, 0], np.eye(size)[:, 1:])[0])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("nanodrone", type=Path, nargs="?", default=FLIGHTS / "nanodrone")
    parser.add_argument("nanobench", type=Path, nargs="?", default=FLIGHTS / "nanobench")
    parser.add_argument("--training", action="store_true", help="leave the path that is kept aside unread")
    parser.add_argument("--truth", action="store_true", help="simulated flights, and nothing else")
    given = parser.parse_args()
    if given.truth:
        groups: dict[str, tuple[str, ...] | None] = {"path 1": ("path 1",), "path 2": ("path 2",)}
        vehicles = [Vehicle("simulated", simulated(), INERTIA[0], MASS * GRAVITY, True, groups, {})]
    else:
        vehicles = list(_vehicles(given.nanodrone, given.nanobench, aside=not given.training))
    if not vehicles:
        sys.exit(f"{given.nanodrone} and {given.nanobench} are absent; see the head of this file")
    bands = [f"{band} Hz" for band in BANDS]
    rows = [row for vehicle in vehicles for row in rows_of_effectiveness(vehicle)]
    table("low_frequency_effectiveness", ["vehicle", "path", "axis", *bands], rows)
    wakes: dict[str, Sequence[Wake]] = {}
    wake_rows: list[list[object]] = []
    climb_rows: list[list[object]] = []
    for vehicle in vehicles:
        gains = [inertia_gain(vehicle, axis) for axis in range(2)]
        wakes[vehicle.name] = [skewed_wake(vehicle, axis, gains[axis]) for axis in range(2)]
        wake_rows += rows_of_wakes(vehicle, gains, wakes[vehicle.name])
        climb_rows += rows_of_climb(vehicle, gains)
        shown = [f"{path}, {band} Hz" for path in vehicle.groups | vehicle.aside for band in SLOW]
        print(f"\n{vehicle.name}")
        name = f"low_frequency_torque_{vehicle.name}"
        table(name, ["columns", "axis", *shown, "numbers"], list(rows_of_candidates(vehicle, gains, wakes)))
    print()
    columns = ["vehicle", "axis", "inertia, 1e-5 kg m²", "slope, mm per m/s", "induced, m/s", "lag, ms", "gain"]
    table("low_frequency_wake", columns, wake_rows)
    print()
    columns = ["vehicle", "path", "axis", "v_z τ alone", "v_z v alone", "v_z τ with v_z v", "v_z v with v_z τ"]
    table("low_frequency_climb", columns, climb_rows)
    if len(vehicles) == 2:
        OUTPUT.write_text(draw(vehicles) + "\n", encoding="utf-8")
        print(f"wrote {OUTPUT}")


def _vehicles(drone: Path, bench: Path, *, aside: bool) -> Iterator[Vehicle]:
    """Read the vehicles that are there."""
    if drone.is_dir():
        runs = nanodrone(drone, (*TRAINING, *TEST) if aside else TRAINING)
        groups: dict[str, tuple[str, ...] | None] = {"random": ("random1", "random2"), "square": ("square",)}
        kept: dict[str, tuple[str, ...] | None] = {"melon": ("melon",)} if aside else {}
        yield Vehicle("nano-drone", runs, INERTIA[0], MASS * GRAVITY, measured=True, groups=groups, aside=kept)
    if bench.is_dir():
        runs = nanobench(bench)
        weight = NANOBENCH_MASS * GRAVITY
        yield Vehicle("NanoBench", runs, NANOBENCH_INERTIA, weight, measured=False, groups={"all": None}, aside={})


if __name__ == "__main__":
    main()
