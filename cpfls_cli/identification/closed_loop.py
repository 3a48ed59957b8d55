"""What an autopilot's loop does to the torque of flights: freed of it where instruments identify it, else bounded.

An autopilot answers gusts with torque, so least squares of torque on motion finds a mixture of vehicle and autopilot.
Another run of the same path has the same motion asked for, and another gust, and a setpoint from outside of the loop
knows of no gust: they are the instruments. Where there are none, past windows are: they know nothing of the innovations
of a gust.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array, BoolArray, runs, stretches
from cpfls_cli.dynamics import rigid_columns, vertical, why_unphysical
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.identification.data import Flights, TorqueData, TorqueSource, axis_scale, gathered, sample_times
from cpfls_cli.inertia import INERTIA_ENTRIES, KNOWN, VISIBLE
from cpfls_cli.playback.constants import Constants, find_constants
from cpfls_cli.playback.flight import MeasuredMotion, PlaybackFlight
from cpfls_cli.playback.instruments import InstrumentKind, Instruments, instruments
from cpfls_cli.playback.loop import BalancedTorque, LoopBounds, bounds_between
from cpfls_cli.playback.parameters import INERTIA, PRODUCTS, blocks_of
from cpfls_cli.regressor.regressor import RIGID, Motion
from cpfls_cli.vehicle.rotors import rotor_demand
from cpfls_cli.vehicle.settings import VehicleSettings

_UNIFORM = 1e-3
"""Share of a sampling period by which clocks of one study differ at most."""
_PAUSE = 0.5
"""Share of a sampling period by which a step is longer where time pauses."""
_SLOWEST_S = 0.1
"""Sampling period above which no log shows a body."""
_SCALED = 3
"""Times that least squares are scaled by the torque that they free: what learns from it is scaled so."""
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
    def possible(self) -> bool:
        """Whether there is such a body, known to a factor of two about roll and pitch, and samples to learn from."""
        known = bool(self.identified[:2].all()) and len(self.learned) > 0
        return known and why_unphysical(self.rigid_body) is None

    @property
    def contradicts(self) -> bool:
        """Whether instruments find another body than least squares: off by their interval, and visibly."""
        with np.errstate(invalid="ignore", divide="ignore"):
            off = np.abs(np.log(self.least_squares[:3] / self.rigid_body[:3]))
        return bool((~(off <= np.maximum(self.half, VISIBLE)) & self.identified).any())


def freed_torque(training: TorqueSource, learned: TorqueSource) -> FreedTorque | None:
    """Free the torque of flights of the loop by other runs of a path, by setpoints, or by past windows.

    The body is that of `find_constants`, whose instruments know no gust, with damping and a constant torque estimated
    jointly; about yaw it stays as least squares has it where they do not identify it, and past windows never do. The
    torque becomes what it was, and what that body takes more than the one of least squares: least squares of it gives
    the body of the instruments.

    Flights without instruments are left out. So where there are such, the rest is taken only if least squares of all
    shows the loop, or instruments find another body; setpoints, which identify less than repeats, only then. Where they
    identify no body, or there are none, and least squares shows the loop, past windows are the instruments.

    None where nothing identifies roll and pitch to a factor of two, or finds no body; where no instruments, for long
    enough, are there and the flights do not show the loop; and of flights that stay in their files. Söderström and
    Stoica 2002 (instrumental variables in closed loop); Pintelon and Schoukens 2012 (repeats).
    """
    flights = training.flights if isinstance(training, Flights) else (training,)
    parts = [flight for flight in flights if isinstance(flight, TorqueData)]
    period = _common_period(parts)
    if period is None or len(parts) < len(flights):
        return None
    every = range(len(parts))
    least_squares = _least_squares(gathered(training, np.arange(len(training))), axis_scale(training))
    if why_unphysical(least_squares) is not None:
        return None
    vehicle = VehicleSettings(inertia_kg_m2=tuple(least_squares.tolist()))
    flown = tuple(_driven(vehicle, parts, period))
    given = instruments(flown)
    given, flown = replace(given, flown=tuple(map(_not_vertical, given.flown))), tuple(map(_not_vertical, flown))
    # Of effects those that take no rotors: these are nobody's.
    tried = (INERTIA, PRODUCTS, *(name for name, effect in CATALOGUE.items() if not effect.needs))
    others = [block for block in blocks_of(vehicle) if block not in tried]
    shows_loop = loop_along(training, lambda motion: rigid_columns(motion) @ least_squares).shows_loop
    if given.kind != "none" and (found := find_constants(vehicle, given.flown, given, others)):
        freed = _freed(training, learned, parts, found, sorted(given.flights), given)
        repeated = given.kind == "repeats" and not freed.alone
        if freed.possible and (repeated or shows_loop or freed.contradicts):
            return freed
    if not shows_loop:
        return None
    past = find_constants(vehicle, flown, replace(given, flown=flown), others, past=True)
    by_past = None if past is None else _freed(training, learned, parts, past, every)
    return by_past if by_past is not None and by_past.possible else None


def _freed(
    training: TorqueSource,
    learned: TorqueSource,
    parts: Sequence[TorqueData],
    found: Constants,
    known: Sequence[int],
    given: Instruments | None = None,
) -> FreedTorque:
    """Give flights that instruments know, by their numbers, the torque of the body that these identify, or the past."""
    number = np.repeat(np.arange(len(parts)), [len(part) for part in parts])
    samples, inertia = gathered(training, np.flatnonzero(np.isin(number, known))), found.fitted.model.body.inertia
    columns, freed = rigid_columns(samples.motion), samples
    for _ in range(_SCALED):
        least_squares = _least_squares(samples, axis_scale(freed))
        rigid_body = np.array([inertia[entry] for entry in INERTIA_ENTRIES])
        if not _known_to_two(found.half)[2]:
            rigid_body[list(_OF_YAW)] = least_squares[list(_OF_YAW)]
        freed = replace(samples, torque=samples.torque + columns @ (rigid_body - least_squares))
    chosen = np.flatnonzero(np.isin(freed.time, sample_times(learned)))
    return FreedTorque(
        training=freed,
        learned=freed if len(learned) == len(training) else freed[chosen],
        rigid_body=rigid_body,
        least_squares=least_squares,
        half=found.half,
        runs=found.used.runs or len(known),
        paths=0 if given is None else len(given.repeats.paths()),
        alone=len(parts) - len(known),
        flights=len(parts),
        instrument_kind="past" if given is None else given.kind,
        setpoints=given.names if given is not None and given.kind == "setpoints" else (),
    )


def _least_squares(samples: TorqueData, scale: Array) -> Array:
    """Find inertia parameters by least squares of a torque, scaled by axis."""
    columns, torque = rigid_columns(samples.motion) / scale[:, None], samples.torque / scale
    return np.asarray(np.linalg.lstsq(columns.reshape(-1, RIGID), torque.ravel(), rcond=_ROUNDING)[0])


def _driven(vehicle: VehicleSettings, parts: Sequence[TorqueData], period: float) -> Iterator[PlaybackFlight]:
    """Give flights with rotor speeds by which any vehicle would have their torque, where they are not vertical."""
    flights = []
    for part in parts:
        known = ~vertical(part.motion.attitude)
        torque = np.where(known[:, None], rotations.body_torque(part.motion.attitude, part.torque), 0.0)
        square = rotor_demand(vehicle, np.zeros(len(part)), torque).squared_speed
        flights.append(replace(_flown(part, period), speed=square))
    most = max(float(np.abs(flight.speed).max()) for flight in flights)
    return (replace(flight, speed=np.sqrt(most + flight.speed)) for flight in flights)


def _not_vertical(flight: PlaybackFlight) -> PlaybackFlight:
    """Leave out where the nose points up or down."""
    known = ~vertical(rotations.euler_angles(flight.motion.rotation))
    return replace(flight, stretches=tuple(slice(*run) for run in runs(known)))


def source_of(
    freed: FreedTorque | None, training: TorqueSource, learned: TorqueSource
) -> tuple[TorqueSource, TorqueSource]:
    """Give what parameters and their errors are learned from: the torque that instruments know, or as measured."""
    return (training, learned) if freed is None else (freed.training, freed.learned)


def _common_period(parts: Sequence[TorqueData]) -> float | None:
    """Give the sampling period of flights that are uniform in time; None where they differ, or are slow."""
    steps = [np.diff(part.time) for part in parts]
    if not steps or not all(map(len, steps)):
        return None
    period = float(np.median(steps[0]))
    if period > _SLOWEST_S:
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
