"""What an autopilot's loop does to the torque of flights: freed of it where instruments identify it, else bounded.

An autopilot answers gusts with torque, so least squares of torque on motion finds a mixture of vehicle and autopilot.
Another run of the same path has the same motion asked for, and another gust, and a setpoint from outside of the loop
knows of no gust: they are the instruments. Where there are none, past windows are: they know nothing of the innovations
of a gust.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array, BoolArray, IntArray, runs, stretches
from cpfls_cli.blocks import ENOUGH_BLOCKS, block_length, half_width, jackknife_error
from cpfls_cli.dynamics import rigid_columns, vertical, why_unphysical
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.estimation.estimate import Normal, Prior, one_step
from cpfls_cli.estimation.first_stage import FOLDS, first_stage_fit_by_run
from cpfls_cli.identification.data import (
    Flights,
    OtherTorque,
    TorqueData,
    TorqueSource,
    axis_scale,
    gathered,
    sample_times,
)
from cpfls_cli.inertia import INERTIA_ENTRIES, KNOWN, VISIBLE
from cpfls_cli.playback.constants import find_constants
from cpfls_cli.playback.flight import MeasuredMotion, PlaybackFlight
from cpfls_cli.playback.instruments import InstrumentKind, Instruments, instruments, past_setpoints
from cpfls_cli.playback.loop import BalancedTorque, LoopBounds, bounds_between
from cpfls_cli.playback.parameters import INERTIA, PRODUCTS, blocks_of
from cpfls_cli.regressor.regressor import RIGID, Motion
from cpfls_cli.vehicle.rotors import rotor_demand
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.weak_form.windows import FEWEST_SAMPLES, windows

_UNIFORM = 1e-3
"""Share of a sampling period by which clocks of one study differ at most."""
_PAUSE = 0.5
"""Share of a sampling period by which a step is longer where time pauses."""
_SLOW_S = 0.8
"""Window whose average is taken off, which leaves what is faster than about 1.5 Hz: gusts are slower, and most of what
a model of the inertia lacks. What a body takes is fast."""
_APART_S = 0.04
"""Between the setpoints that predict a sample: the answer of a vehicle is slower."""
_MOST = 5e7
"""Numbers that predict, of all samples: 400 MB, an hour at 100 Hz."""
_MOSTLY = 0.5
_ROUNDING = 1e-12
_OF_YAW = (2, 4, 5)
"""Places of Izz, Ixz and Iyz among the inertia parameters."""


@dataclass(frozen=True)
class FreedTorque:
    """Samples of flights with instruments, with the torque that they take where no gust acts.

    `training`, `learned`: of those parts what the instruments know; `rigid_body`, `least_squares`: inertia parameters,
    kg m^2, by instruments, and by least squares of the torque as measured; `half`: half of the 95 % intervals of the
    logarithms of the moments of inertia by instruments; `runs` that repeat each other along `paths`, or with setpoints
    of no common path; `alone`: flights without instruments, of all `flights`; `instrument_kind`: "repeats",
    "setpoints", or "past", which are past windows.
    """

    training: TorqueSource
    learned: TorqueSource
    rigid_body: Array
    least_squares: Array
    half: Array
    runs: int
    paths: int
    alone: int
    flights: int
    instrument_kind: InstrumentKind
    setpoints: tuple[str, ...] = ()

    @property
    def identified(self) -> BoolArray:
        """Axes, shape (3,), whose moment of inertia the instruments identify to a factor of two."""
        return _known_to_two(self.half)

    @property
    def contradicts(self) -> bool:
        """Whether instruments find another body than least squares: off by their interval, and visibly."""
        with np.errstate(invalid="ignore", divide="ignore"):
            off = np.abs(np.log(self.least_squares[:3] / self.rigid_body[:3]))
        return bool((~(off <= np.maximum(self.half, VISIBLE)) & self.identified).any())


def freed_torque(training: TorqueSource, learned: TorqueSource) -> FreedTorque | None:
    """Free the torque of flights of what instruments do not know: other runs of a path, or setpoints; or by the past.

    Flights that have none are left out. So where there are such, the rest is taken only if least squares of it shows
    the loop in all, or instruments find another body; setpoints, which identify less than repeats, only then.

    With ``A`` the columns of a rigid body along a run, ``tau`` its torque, both as far as they are fast, and ``A'``,
    ``tau'`` what instruments know of them, the inertia parameters x solve ``sum A^T (tau' - A' x) = 0``: gusts and
    noise of a run do not go with that. Of runs of a path it is the mean of what the others have at the same places; of
    setpoints the first-stage fit of the other flights. Then ``sum A'^T (tau - A x) = 0``, for what is predicted errs
    alike in many blocks. The torque becomes what the rigid body takes along the run's own motion and what is known of
    the fast rest, ``tau' - A' x``, as far as A does not hold it. Least squares of it gives the rigid body of the
    instruments again, and an inertia that depends on attitude as far as instruments know of it. Where they know most of
    what a rigid body leaves, slow or fast, it is no gust, and nothing is freed by them.

    Where that is so, or there are none, and least squares shows the loop, the body is identified by past windows,
    though not about yaw (`find_constants`). The torque becomes what it was, and what that body takes more than the
    other.

    None where nothing identifies roll and pitch to a factor of two, or finds no body; where no instruments, for long
    enough, are there and the flights do not show the loop; and of flights that stay in their files. Söderström and
    Stoica 2002 (instrumental variables in closed loop); Pintelon and Schoukens 2012 (repeats).
    """
    flights = training.flights if isinstance(training, Flights) else (training,)
    parts = [flight for flight in flights if isinstance(flight, TorqueData)]
    period = _common_period(parts)
    if period is None or len(parts) < len(flights):
        return None
    given = instruments([_flown(part, period) for part in parts])
    by_instruments = None if given.kind == "none" else _by_instruments(training, learned, parts, given)
    return by_instruments or _by_past(training, learned, parts, given)


def _by_instruments(
    training: TorqueSource, learned: TorqueSource, parts: Sequence[TorqueData], given: Instruments
) -> FreedTorque | None:
    """Free the torque of flights by repeats or setpoints."""
    period, scale = given.flown[0].motion.period, 1.0 / axis_scale(training)
    whole = _laid(parts, scale)
    rows = [whole[run.flight][run.part] for run in given.runs]
    runs = _runs(given, rows, period)
    repeated = given.kind == "repeats"
    crossed = _crossed(runs, repeated=repeated)
    if len(crossed) < ENOUGH_BLOCKS:
        return None
    least_squares, _ = _solved(_by_block([(run.rows, run.rows, run.block) for run in runs]))
    if _share_known(given, [each @ np.append(-least_squares, 1.0) for each in rows], runs, period) > _MOSTLY:
        return None
    rigid_body, half = _solved(crossed)
    if not _known_to_two(half)[2]:
        # What is hardly known would shake what is: about yaw the body stays as least squares has it.
        runs = [run._replace(others=run.others * [[1.0], [1.0], [0.0]]) for run in runs]
        rigid_body, conditional = _solved(_crossed(runs, repeated=repeated), least_squares)
        half = np.array([*conditional[:2], half[2]])
    if why_unphysical(rigid_body) is not None:
        return None
    starts = np.cumsum([0, *(len(part) for part in parts)])
    begins = [starts[run.flight] + run.part.start for run in given.runs]
    places = np.concatenate([begins[run.number] + run.samples for run in runs])
    freed = replace(gathered(training, places), torque=_freed(runs, rigid_body) / scale)
    every = len(learned) == len(training)
    found = FreedTorque(
        training=freed,
        learned=freed if every else freed[np.flatnonzero(np.isin(freed.time, sample_times(learned)))],
        rigid_body=rigid_body,
        least_squares=least_squares,
        half=half,
        runs=len(runs),
        paths=len(given.repeats.paths()),
        alone=len(parts) - len({given.runs[run.number].flight for run in runs}),
        flights=len(parts),
        instrument_kind=given.kind,
        setpoints=() if repeated else given.names,
    )
    if not (found.identified[:2].all() and len(found.learned)):
        return None
    taken = (repeated and not found.alone) or found.contradicts or _shows_loop(training, least_squares)
    return found if taken else None


def _by_past(
    training: TorqueSource, learned: TorqueSource, parts: Sequence[TorqueData], given: Instruments
) -> FreedTorque | None:
    """Free the torque of flights that show the loop by past windows."""
    rows = np.concatenate(_laid(parts, 1.0 / axis_scale(training)))
    least_squares, _ = _solved(np.einsum("tap,taq->pq", rows[:, :, :-1], rows)[None])
    if why_unphysical(least_squares) is not None or not _shows_loop(training, least_squares):
        return None
    vehicle = VehicleSettings(inertia_kg_m2=tuple(least_squares.tolist()))
    flights = _driven(vehicle, parts, given.flown[0].motion.period)
    # Of effects those that take no rotors: these are nobody's.
    tried = (INERTIA, PRODUCTS, *(name for name, effect in CATALOGUE.items() if not effect.needs))
    others = [block for block in blocks_of(vehicle) if block not in tried]
    found = find_constants(vehicle, flights, replace(given, flown=flights), others, past=True)
    if found is None or not found.identified:
        return None
    inertia, yaw = found.fitted.model.body.inertia, list(_OF_YAW)
    rigid_body = np.array([inertia[entry] for entry in INERTIA_ENTRIES])
    # Past windows do not identify it.
    rigid_body[yaw] = least_squares[yaw]
    if why_unphysical(rigid_body) is not None:
        return None

    def freed(data: TorqueData) -> Array:
        return np.asarray(data.torque + rigid_columns(data.motion) @ (rigid_body - least_squares))

    whole, part, count = OtherTorque(training, freed), OtherTorque(learned, freed), len(parts)
    return FreedTorque(whole, part, rigid_body, least_squares, found.half, count, 0, 0, count, "past")


def _driven(vehicle: VehicleSettings, parts: Sequence[TorqueData], period: float) -> tuple[PlaybackFlight, ...]:
    """Give flights with rotor speeds by which any vehicle would have their torque, where they are not vertical."""
    flights = []
    for part in parts:
        known = ~vertical(part.motion.attitude)
        torque = np.where(known[:, None], rotations.body_torque(part.motion.attitude, part.torque), 0.0)
        square = rotor_demand(vehicle, np.zeros(len(part)), torque).squared_speed
        flights.append(replace(_flown(part, period), speed=square, stretches=tuple(slice(*run) for run in runs(known))))
    most = max(float(np.abs(flight.speed).max()) for flight in flights)
    return tuple(replace(flight, speed=np.sqrt(most + flight.speed)) for flight in flights)


def _laid(parts: Sequence[TorqueData], scale: Array) -> list[Array]:
    """Join columns of the rigid body and the torque, scaled by axis, of each flight, shape (samples, 3, 7)."""
    return [
        np.concatenate([rigid_columns(part.motion), part.torque[:, :, None]], axis=2) * scale[:, None] for part in parts
    ]


def _shows_loop(training: TorqueSource, rigid_body: Array) -> bool:
    return loop_along(training, lambda motion: rigid_columns(motion) @ rigid_body).shows_loop


def source_of(
    freed: FreedTorque | None, training: TorqueSource, learned: TorqueSource
) -> tuple[TorqueSource, TorqueSource]:
    """Give what parameters and their errors are learned from: the torque that instruments know, or as measured."""
    return (training, learned) if freed is None else (freed.training, freed.learned)


class _Run(NamedTuple):
    """Samples of a run, and what instruments know of them; rows scaled by axis, shape (samples, 3, 7).

    `rows`: columns of the rigid body, last the torque; `own`, `others`: what of these is fast, of the run itself and as
    instruments know it; `block`: path, and number of the block along it.
    """

    number: int
    samples: IntArray
    rows: Array
    own: Array
    others: Array
    block: IntArray


def _freed(runs: Sequence[_Run], rigid_body: Array) -> Array:
    """Give the torque that a rigid body takes, and what is known of the rest and no body takes, shape (samples, 3)."""
    columns = np.concatenate([run.rows[:, :, :-1] for run in runs])
    rest = np.concatenate([run.others for run in runs]) @ np.append(-rigid_body, 1.0)
    flat = columns.reshape(-1, RIGID)
    taken = np.linalg.lstsq(flat, rest.ravel(), rcond=_ROUNDING)[0]
    return np.asarray(columns @ (rigid_body - taken) + rest)


def _common_period(parts: Sequence[TorqueData]) -> float | None:
    """Give the sampling period of flights that are uniform in time; None where they differ, or are slow."""
    steps = [np.diff(part.time) for part in parts]
    if not steps or not all(map(len, steps)):
        return None
    period = float(np.median(steps[0]))
    if period * FEWEST_SAMPLES > _SLOW_S:
        return None
    return period if all(np.allclose(step, period, rtol=_UNIFORM, atol=0.0) for step in steps) else None


def _flown(part: TorqueData, period: float) -> PlaybackFlight:
    """Give what shows the path of a flight: how it turns, and what was asked of it."""
    attitude, none = part.motion.attitude, np.zeros((len(part), 3))
    rate = rotations.body_rate(attitude, part.motion.rate)
    return PlaybackFlight(
        name="",
        motion=MeasuredMotion(none, none, rotations.rotation_matrix(attitude), rate, period),
        speed=np.zeros((len(part), 0)),
        hold="linear",
        stretches=(slice(0, len(part)),),
        has_velocity=False,
        has_position=False,
        setpoints={name: asked for name, asked in part.setpoints.items() if np.isfinite(asked).all()},
    )


def _runs(given: Instruments, rows: Sequence[Array], period: float) -> list[_Run]:
    """Join the rows of runs and what instruments know of them, where all are known."""
    fast = [_fast(each, period) for each in rows]
    known_rest = _known(given, fast, period, fast=True)
    if not known_rest:
        return []
    paths = {number: given.repeats.path(number, len(rows[number])) for number in known_rest}
    length = block_length(sum(len(rows[first]) for first in {first for first, _ in paths.values()}) * period) / period
    found = []
    for number, others in known_rest.items():
        first, place = paths[number]
        known = np.isfinite(others + fast[number]).all(axis=(1, 2)) & np.isfinite(place)
        along = (place[known] // length).astype(np.int64)
        block = np.column_stack([np.full(len(along), first), along])
        both = fast[number][known], others[known]
        if known.any():
            found.append(_Run(number, np.flatnonzero(known), rows[number][known], *both, block))
    return found


def _known(given: Instruments, values: Sequence[Array], period: float, *, fast: bool = False) -> dict[int, Array]:
    """Give what instruments know of the values, or of their fast part, of runs by number; NaN where it is nothing."""
    if given.kind == "repeats":
        repeated = sorted(number for path in given.repeats.paths() for number in path)
        return {number: given.repeats.others(number, values) for number in repeated}
    apart, asked, known = max(1, round(_APART_S / period)), [], {}
    for number, setpoint in enumerate(given.setpoints):
        if setpoint is not None:
            columns = past_setpoints(setpoint, period, apart)
            asked.append(_fast(columns, period) if fast else columns)
            own = values[number].reshape(len(setpoint), -1)
            known[number] = np.isfinite(asked[-1]).all(axis=1) & np.isfinite(own).all(axis=1)
    width = asked[0].shape[1] if asked else 0
    rows_known, every = sum(int(there.sum()) for there in known.values()), sum(len(values[number]) for number in known)
    if rows_known <= FOLDS * width or every * width > _MOST:
        return {}
    there_asked = {number: each[there] for each, (number, there) in zip(asked, known.items(), strict=True)}
    predicted = first_stage_fit_by_run(there_asked, {number: values[number][there] for number, there in known.items()})
    found = {number: np.full_like(values[number], np.nan) for number in known}
    for number, there in known.items():
        found[number][there] = predicted[number]
    return found


def _share_known(given: Instruments, rest: Sequence[Array], runs: Sequence[_Run], period: float) -> float:
    """Compute the share of a rest about roll and pitch, shape (time, 3), that instruments know."""
    known = _known(given, [each[:, :2] for each in rest], period)
    own, there = ([values[run.number][run.samples, :2] for run in runs] for values in (rest, known))
    square = sum(float(np.sum(each**2)) for each in own)
    return sum(float(np.sum(mine * theirs)) for mine, theirs in zip(own, there, strict=True)) / (square or 1.0)


def _fast(values: Array, period: float) -> Array:
    """Take from values what a long window sees around them, shape (time, ...); NaN at the ends."""
    window, found = windows(period, _SLOW_S, 1.0), np.full_like(values, np.nan)
    half, count = len(window.weight) // 2, window.count(len(values))
    if count:
        found[half : half + count] = values[half : half + count] - window.average(values)
    return found


def _crossed(runs: Sequence[_Run], *, repeated: bool) -> Array:
    """Sum the products of runs with what instruments know of them; see `freed_torque`."""
    pairs = ((run.own, run.others, run.block) for run in runs)
    return _by_block(pairs if repeated else ((others, own, block) for own, others, block in pairs))


def _by_block(rows: Iterable[tuple[Array, Array, IntArray]]) -> Array:
    """Sum the products of rigid-body columns with all of other rows, by block of the path, shape (block, 6, 7)."""
    found: dict[tuple[int, int], Array] = {}
    for first, second, block in rows:
        for path, along in np.unique(block, axis=0).tolist():
            here = (block == (path, along)).all(axis=1)
            product = np.einsum("tap,taq->pq", first[here, :, :-1], second[here])
            found[path, along] = found.get((path, along), 0.0) + product
    return np.array(list(found.values()))


def _solved(crossed: Array, held: Array | None = None) -> tuple[Array, Array]:
    """Solve for inertia parameters but those held of yaw, with half of the 95 % intervals of log moments, (3,)."""
    found, error = np.zeros(RIGID) if held is None else held.copy(), np.full(RIGID, np.nan)
    free = np.array([number for number in range(RIGID) if held is None or number not in _OF_YAW])
    found[free] = 0.0
    rest = crossed[:, :, RIGID] - crossed[:, :, :RIGID] @ found
    normal = Normal(crossed[:, free[:, None], free], rest[:, free])
    found[free], without = one_step(normal, Prior.none(len(free)), np.zeros(len(free)))
    error[free] = jackknife_error(without)
    moments = np.where(found[:3] > 0, found[:3], np.nan)
    return found, np.nan_to_num(half_width(error[:3], len(crossed)) / moments, nan=np.inf)


def _known_to_two(half: Array) -> BoolArray:
    return np.asarray(2 * half <= np.log(KNOWN))


def loop_along(training: TorqueSource, torque: Callable[[Motion], Array]) -> LoopBounds:
    """Bound by which factors a loop may have misled a model, from its torque of a motion and the one measured."""
    return bounds_between([stretch for data in training.chunks() for stretch in _stretches(data, torque)])


def _stretches(data: TorqueData, torque: Callable[[Motion], Array]) -> Iterator[BalancedTorque]:
    """Cut samples where their time pauses and where the nose points up or down."""
    steps = np.diff(data.time)
    if not len(steps):
        return
    period, known = float(np.median(steps)), ~vertical(data.motion.attitude)
    number = np.concatenate([[1], 1 + np.cumsum(np.abs(steps - period) > _PAUSE * period)]) * known
    takes = torque(data.motion)
    for part in (slice(*found) for found in stretches(number) if number[found[0]]):
        attitude = data.motion.attitude[part]
        measured, modelled = (rotations.body_torque(attitude, each[part]) for each in (data.torque, takes))
        yield BalancedTorque(measured, np.zeros_like(measured), modelled, period)
