"""Models played back along flights: free runs from many samples, their errors by horizon, and what beats them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.dynamics.equations_of_motion import InertiaModel, momentum_form
from cpfls_cli.effects.polynomial import STATE_TERMS, state_terms
from cpfls_cli.playback.flight import PlaybackFlight
from cpfls_cli.playback.kernels import Body, Motion, Terms, errors_of_runs
from cpfls_cli.playback.model import (
    Remainder,
    VehicleModel,
    airflow_of,
    remainder_terms,
    used_terms,
    weights_by_step,
    wrench_of,
)
from cpfls_cli.playback.motion import State
from cpfls_cli.playback.motion import step as step_of_rigid_body
from cpfls_cli.playback.rotors import Hold, RotorResponse, rotor_terms_by_step
from cpfls_cli.regressor.regressor import InertiaValues

SIGNALS = ("position", "velocity", "attitude", "body_rate")
"""What errors are of, in the order of the compiled runs."""

MODEL, NOTHING_MOVES, RATE_STAYS, STATED = "model", "nothing-moves", "rate-stays", "stated"
PREDICTIONS = (MODEL, NOTHING_MOVES, RATE_STAYS, STATED)
"""The model; the whole state stays; rates and velocity stay; the rigid body and the rotors that the config states."""

_BATCH = 100_000
"""Steps of free runs at a time, which bounds the memory."""

_FASTEST = 300.0
_TINY = 1e-12


@dataclass(frozen=True)
class ReplayOptions:
    """How flights are played back.

    Attributes
    ----------
    horizon_s : float
        Longest horizon, s.
    every : int
        Samples from one begin to the next.
    hold : {"linear", "previous"} or None
        What a speed is between samples; None for what is usual.
    """

    horizon_s: float = 0.5
    every: int = 1
    hold: Hold | None = None


@dataclass(frozen=True)
class Player:
    """A model made ready to be played back along one flight.

    Attributes
    ----------
    table : array, shape (6, terms, 1 + 4 rotors)
        Torque and force by term of the motion and term of the rotors.
    rotor : array, shape (time, 1 + 4 rotors)
        Terms of the rotors over each step.
    body : Body
    along : array, shape (time, 6), N m and N, or None
        What acts over each step beside: stated, or evaluated along the measured motion.
    remainder : Remainder or None
    fuzzy : InertiaModel or None
        Stands in the place of the inertia of `body`.
    wind : tuple of float, m/s, world frame
    """

    table: Array
    rotor: Array
    body: Body
    along: Array | None = None
    remainder: Remainder | None = None
    fuzzy: InertiaModel | None = None
    wind: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def feels_air(self) -> bool:
        """Whether torque or force depend on the velocity through the air."""
        airs = [index for index, term in enumerate(STATE_TERMS) if set("uvw") & set(term)]
        return self.remainder is not None or bool(np.any(self.table[:, airs]))

    def step_weights(self, part: slice) -> tuple[Terms, Array]:
        """Evaluate the weights of the terms of the motion over each step of a part of the flight.

        Returns
        -------
        terms : Terms
            Those in use, the constant always.
        weights : array, shape (time, 6, active)
        """
        found = used_terms(self.table, airflow_of(self.remainder))
        used = found._replace(active=np.union1d([0], found.active).astype(np.int64))
        weights = weights_by_step(self.table, used, self.rotor[part])
        if self.along is not None:
            weights[:, :, 0] += self.along[part]
        return used, weights

    def wrench(self, flight: PlaybackFlight) -> Array:
        """Evaluate torque and force along the measured motion, shape (time, 6), N m and N, body frame."""
        motion = flight.motion
        air = np.einsum("tji,tj->ti", motion.rotation, motion.velocity - self.wind)
        terms = np.hstack([state_terms(air, motion.rate), remainder_terms(self.remainder, air)])
        wrench = wrench_of(self.table, terms, self.rotor)
        return wrench if self.along is None else wrench + self.along


def player_of(model: VehicleModel, flight: PlaybackFlight) -> Player:
    """Make a model ready for a flight.

    Parameters
    ----------
    model : VehicleModel
        A flight without rotor speeds plays what its log states, late by the response of the model's rotors.
    """
    return Player(
        table=model.weights,
        rotor=rotor_terms_along(flight, model.response),
        body=model.body,
        along=stated_along(flight, model.response),
        remainder=model.remainder,
        fuzzy=model.fuzzy,
        wind=model.wind,
    )


def rotor_terms_along(flight: PlaybackFlight, response: RotorResponse) -> Array:
    """Evaluate the terms of the rotors over each step, stretch by stretch, shape (time, 1 + 4 rotors)."""
    return np.concatenate([_late(flight.speed[part], flight, response) for part in flight.stretches])


def stated_along(flight: PlaybackFlight, response: RotorResponse) -> Array | None:
    """Evaluate the stated torque and force over each step, shape (time, 6); None of a flight with rotor speeds."""
    wrench = flight.wrench
    if wrench is None:
        return None
    return np.concatenate([_late(wrench[part], flight, response)[:, 1:7] for part in flight.stretches])


def _late(values: Array, flight: PlaybackFlight, response: RotorResponse) -> Array:
    terms = rotor_terms_by_step(
        values, flight.motion.period, flight.hold, response.delay_s, response.lag_s, response.slow_s
    )
    return np.asarray(terms, dtype=float)


def one_step(model: VehicleModel, state: State, rotor: Array, period: float) -> State:
    """Take one step of any model, by the rule of its free runs.

    Parameters
    ----------
    rotor : array, shape (samples, 1 + 4 rotors)
        See `VehicleModel.rotor_terms`.
    period : float, s

    Returns
    -------
    State
        Not a number where an inertia that depends on the attitude is none of a body.
    """
    if model.fuzzy is None:
        return step_of_rigid_body(model, state, rotor, period)
    if any(model.wind):
        # Seen from the air there is no wind.
        wind = np.array(model.wind)
        still = replace(model, wind=(0.0, 0.0, 0.0))
        after = one_step(still, state._replace(velocity=state.velocity - wind), rotor, period)
        return after._replace(position=after.position + period * wind, velocity=after.velocity + wind)
    player = Player(table=model.weights, rotor=rotor, body=model.body, remainder=model.remainder, fuzzy=model.fuzzy)
    used, weights = player.step_weights(slice(None))
    return _FuzzyRuns(player, model.fuzzy, Motion(*state, period), used, weights, translates=True).one_step()


class Runs(NamedTuple):
    """Errors of free runs.

    Attributes
    ----------
    errors : array, shape (run, horizon, 4, 3)
        Predicted less measured position, velocity, rotation vector (body frame) and rate.
    diverged : array of int, shape (run,)
        Step at which a run was stopped; -1 for those that went on.
    """

    errors: Array
    diverged: IntArray


def apart(first: Runs, second: Runs) -> Array:
    """Compute how far runs end from each other: mean norms of position, velocity, attitude and rate, shape (4,), SI."""
    return np.asarray(np.linalg.norm(second.errors[:, -1] - first.errors[:, -1], axis=2).mean(axis=0))


def free_runs(player: Player, flight: PlaybackFlight, starts: IntArray, horizon: int) -> Runs:
    """Play a model back from samples of a flight.

    Parameters
    ----------
    starts : array of int, shape (run,)
        Ascending.
    horizon : int
        Samples.
    """
    first, part = int(starts[0]), slice(int(starts[0]), int(starts[-1]) + horizon + 1)
    motion = _part(in_the_air(flight, player.wind).motion, part)
    used, weights = player.step_weights(part)
    errors = np.empty((len(starts), horizon, 4, 3))
    if player.fuzzy is None:
        moved = errors_of_runs(motion, player.body, used, weights, starts - first, flight.translates, errors)
        return Runs(errors, moved)
    runs = _FuzzyRuns(player, player.fuzzy, motion, used, weights, flight.translates)
    return Runs(errors, runs.written(starts - first, errors))


def in_the_air(flight: PlaybackFlight, wind: tuple[float, float, float]) -> PlaybackFlight:
    """See a flight from the air, which moves with a steady wind: the errors of runs are the same there."""
    if not any(wind):
        return flight
    motion = flight.motion
    gone = motion.period * np.arange(len(flight))[:, None] * wind
    return replace(
        flight, motion=motion._replace(position=motion.position - gone, velocity=motion.velocity - np.array(wind))
    )


def still_runs(flight: PlaybackFlight, starts: IntArray, horizon: int, *, rate_stays: bool) -> Runs:
    """Predict that the whole state stays what it was, or that rates and velocity do and the vehicle goes on with them.

    Parameters
    ----------
    starts : array of int, shape (run,)
    horizon : int
        Samples.
    rate_stays : bool
        Whether attitude and position follow the rates and the velocity of the start.
    """
    motion, moves = flight.motion, float(rate_stays)
    velocity, rate, held = motion.velocity[starts], motion.rate[starts], motion.rotation[starts]
    turn = rotations.turns(moves * motion.period * rate)
    errors = np.empty((len(starts), horizon, 4, 3))
    for step in range(horizon):
        at = starts + step + 1
        held = held @ turn if rate_stays else held
        gone = moves * (step + 1) * motion.period * velocity
        errors[:, step, 0] = motion.position[starts] + gone - motion.position[at]
        errors[:, step, 1] = velocity - motion.velocity[at]
        errors[:, step, 2] = rotation_vectors(motion.rotation[at], held)
        errors[:, step, 3] = rate - motion.rate[at]
    return Runs(errors, np.full(len(starts), -1))


def _part(motion: Motion, part: slice) -> Motion:
    return Motion(motion.position[part], motion.velocity[part], motion.rotation[part], motion.rate[part], motion.period)


def rotation_vectors(measured: Array, predicted: Array) -> Array:
    """Compute the rotations from measured to predicted attitudes.

    Parameters
    ----------
    measured, predicted : array, shape (..., 3, 3)
        Body to world.

    Returns
    -------
    array, shape (..., 3), rad
        In the measured body frame; its length is the geodesic distance.
    """
    away = measured.swapaxes(-1, -2) @ predicted
    skew = 0.5 * np.stack(
        [away[..., 2, 1] - away[..., 1, 2], away[..., 0, 2] - away[..., 2, 0], away[..., 1, 0] - away[..., 0, 1]],
        axis=-1,
    )
    sine: Array = np.sqrt((skew**2).sum(axis=-1))
    cosine: Array = 0.5 * (away[..., 0, 0] + away[..., 1, 1] + away[..., 2, 2] - 1.0)
    angle = np.arctan2(sine, cosine)
    vector = skew * np.expand_dims(np.where(sine > _TINY, angle / np.maximum(sine, _TINY), 1.0), -1)
    # Half a turn: the axis does not show in the skew part, its length is all that is used.
    half_turn = np.asarray((sine <= _TINY) & (cosine < 0.0), dtype=bool)
    return np.asarray(np.where(np.expand_dims(half_turn, -1), [np.pi, 0.0, 0.0], vector))


class _Fuzzy(NamedTuple):
    """A model in Euler coordinates at the attitudes of the runs.

    Attributes
    ----------
    rate : array, shape (run, 3), rad/s
        That has the momentum.
    direct : array, shape (run, 3), N m
        Torque that the motion takes beside the change of momentum.
    exists : array of bool, shape (run,)
        False where no body has the inertia.
    """

    rate: Array
    direct: Array
    exists: BoolArray


class _BodyInertia(NamedTuple):
    """Inertia at the attitudes of the runs, and the matrices from rate to momentum, ``W^-T J W^-1``."""

    attitude: Array
    values: InertiaValues
    matrices: Array


class _State(NamedTuple):
    """Free runs in momentum form: no inertia that depends on the attitude has to be differentiated in time."""

    position: Array
    velocity: Array
    rotation: Array
    momentum: Array


@dataclass(frozen=True)
class _FuzzyRuns:
    """Free runs under an inertia that depends on the attitude, all at once, by the step rule of the compiled ones."""

    player: Player
    fuzzy: InertiaModel
    motion: Motion
    used: Terms
    weights: Array
    translates: bool

    def written(self, starts: IntArray, errors: Array) -> IntArray:
        """Simulate, write the errors, and give the steps at which runs diverged."""
        motion, diverged = self.motion, np.full(len(starts), -1)
        state, rate, now = self._begun(starts)
        for step in range(errors.shape[1]):
            with np.errstate(all="ignore"):
                moved, after = self._step(state, rate, now, self.weights[starts + step])
            fastest = np.maximum(np.abs(after.rate).max(axis=1), np.abs(moved.velocity).max(axis=1))
            good = (diverged < 0) & after.exists & (fastest < _FASTEST)
            # A run that no body flies stands still from there on, as that of a rigid body does.
            diverged[(diverged < 0) & ~good] = step
            state = _State(*(_kept(good, new, old) for new, old in zip(moved, state, strict=True)))
            rate, now = _kept(good, after.rate, rate), after
            at = starts + step + 1
            errors[:, step, 0] = state.position - motion.position[at]
            errors[:, step, 1] = state.velocity - motion.velocity[at]
            errors[:, step, 2] = rotation_vectors(motion.rotation[at], state.rotation)
            errors[:, step, 3] = rate - motion.rate[at]
        return diverged

    def one_step(self) -> State:
        """Take one step from each sample; not a number where it meets an attitude at which no body has the inertia."""
        state, rate, now = self._begun(np.arange(len(self.motion.rate)))
        with np.errstate(all="ignore"):
            moved, after = self._step(state, rate, now, self.weights)
        parts = (moved.position, moved.velocity, moved.rotation, after.rate)
        return State(*(_kept(after.exists, part, np.full_like(part, np.nan)) for part in parts))

    def _begun(self, starts: IntArray) -> tuple[_State, Array, _Fuzzy]:
        motion = self.motion
        rate, rotation = motion.rate[starts], motion.rotation[starts]
        momentum = rotations.multiply(np.nan_to_num(self._body_inertia(rotation).matrices), rate)
        state = _State(motion.position[starts], motion.velocity[starts], rotation, momentum)
        return state, rate, self._fuzzy(state.rotation, state.momentum)

    def _step(self, state: _State, rate: Array, now: _Fuzzy, weights: Array) -> tuple[_State, _Fuzzy]:
        period = self.motion.period
        middle = self._moved(state, state, rate, now.direct, weights, 0.5 * period)
        there = self._fuzzy(middle.rotation, middle.momentum)
        end = self._moved(state, middle, there.rate, there.direct, weights, period)
        after = self._fuzzy(end.rotation, end.momentum)
        return end, after._replace(exists=now.exists & there.exists & after.exists)

    def _moved(self, start: _State, at: _State, rate: Array, direct: Array, weights: Array, interval: float) -> _State:
        """Move a state for an interval with the derivatives at another one."""
        air = np.einsum("nji,nj->ni", at.rotation, at.velocity)
        terms = np.hstack([state_terms(air, rate), remainder_terms(self.player.remainder, air)])[:, self.used.active]
        wrench = np.einsum("nka,na->nk", weights, terms)
        momentum = start.momentum + interval * (wrench[:, :3] - direct)
        rotation = start.rotation @ rotations.turns(interval * rate)
        if not self.translates:
            return _State(start.position, start.velocity, rotation, momentum)
        acceleration = rotations.multiply(at.rotation, wrench[:, 3:]) / self.player.body.mass
        acceleration[:, 2] -= self.player.body.gravity
        position = start.position + interval * at.velocity
        return _State(position, start.velocity + interval * acceleration, rotation, momentum)

    def _fuzzy(self, rotation: Array, momentum: Array) -> _Fuzzy:
        inertia = self._body_inertia(rotation)
        exists = _positive_definite(inertia.matrices)
        safe = np.where(exists[:, None, None], inertia.matrices, np.eye(3))
        rate: Array = np.asarray(np.linalg.solve(safe, momentum[..., None])[..., 0], dtype=float)
        _, direct = momentum_form(inertia.attitude, rate, inertia.values)
        return _Fuzzy(rate, direct, exists)

    def _body_inertia(self, rotation: Array) -> _BodyInertia:
        attitude = rotations.euler_angles(np.nan_to_num(rotation))
        values = self.fuzzy.inertia(attitude)
        axes = [rotations.attitude_rate(attitude, np.broadcast_to(axis, attitude.shape)) for axis in np.eye(3)]
        inverse = np.stack(axes, axis=2)
        return _BodyInertia(attitude, values, inverse.swapaxes(1, 2) @ values.value @ inverse)


def _kept(good: BoolArray, new: Array, old: Array) -> Array:
    return np.where(good.reshape(-1, *[1] * (new.ndim - 1)), new, old)


def _positive_definite(matrices: Array) -> BoolArray:
    """Flag positive definite matrices by their leading minors (Sylvester); what is not finite is none."""
    first, minor = matrices[:, 0, 0], matrices[:, 0, 0] * matrices[:, 1, 1] - matrices[:, 0, 1] ** 2
    finite = np.asarray(np.isfinite(matrices).all(axis=(1, 2)), dtype=bool)
    whole = np.linalg.det(np.where(finite[:, None, None], matrices, 0.0))
    return np.asarray(finite & (first > 0) & (minor > 0) & (whole > 0))


@dataclass(frozen=True)
class Played:
    """A flight and what is played back along it.

    Attributes
    ----------
    flight : PlaybackFlight
    model, stated : Player
    """

    flight: PlaybackFlight
    model: Player
    stated: Player

    def runs(self, prediction: str, starts: IntArray, horizon: int) -> Runs:
        """Predict from samples of the flight.

        Parameters
        ----------
        prediction : str
            Of `PREDICTIONS`.
        starts : array of int, shape (run,)
            Ascending.
        horizon : int
            Samples.
        """
        if prediction in (NOTHING_MOVES, RATE_STAYS):
            return still_runs(self.flight, starts, horizon, rate_stays=prediction == RATE_STAYS)
        return free_runs(self.model if prediction == MODEL else self.stated, self.flight, starts, horizon)

    @property
    def knows(self) -> dict[str, bool]:
        """Whether errors of each signal are known."""
        flight = self.flight
        return {
            "body_rate": True,
            "attitude": flight.has_attitude,
            "velocity": flight.translates,
            "position": flight.translates and flight.has_position,
        }


@dataclass(frozen=True)
class SignalErrors:
    """Errors of one signal over all windows of the flights that know it.

    Attributes
    ----------
    mae : array, shape (prediction, horizon)
        Mean of the norms; of attitudes the geodesic distance, rad.
    rms : array, shape (prediction, horizon, 3)
        Root mean square by axis.
    """

    mae: Array
    rms: Array


@dataclass(frozen=True)
class Windows:
    """Where runs started, and how far off they were.

    Attributes
    ----------
    flight : array of int, shape (window,)
    start : array of int, shape (window,)
        Sample of the flight.
    size : array, shape (prediction, window), rad/s
        Mean norm of the error of the body rate over the horizon.
    diverged : array of int, shape (prediction, window)
        Step at which a run was stopped; -1 for those that went on.
    """

    flight: IntArray
    start: IntArray
    size: Array
    diverged: IntArray

    def worst(self, horizon: int, count: int) -> list[int]:
        """List the windows in which the model is farthest off, without overlap, the worst first.

        Parameters
        ----------
        horizon : int
            Samples.
        count : int
            At most.
        """
        chosen: list[int] = []
        for index in np.argsort(-self.size[0], kind="stable"):
            here = self.flight[chosen] == self.flight[index]
            if not np.any(here & (np.abs(self.start[chosen] - self.start[index]) <= horizon)):
                chosen.append(int(index))
            if len(chosen) == count:
                break
        return chosen

    def typical(self, horizon: int, count: int) -> list[int]:
        """List windows one after another that are as far off as the middle one of all such stretches is.

        Parameters
        ----------
        horizon : int
            Samples.
        count : int
            Windows, at most.
        """
        stretches = [part for flight in np.unique(self.flight) for part in self._stretches(int(flight), horizon, count)]
        sizes = np.array([self.size[0, part].mean() for part in stretches])
        return stretches[int(np.argsort(sizes, kind="stable")[(len(sizes) - 1) // 2])]

    def _stretches(self, flight: int, horizon: int, count: int) -> Iterator[list[int]]:
        """Tile a flight with windows, each the first that begins behind the one before."""
        tiles: list[int] = []
        for index in np.flatnonzero(self.flight == flight):
            if not tiles or self.start[index] >= self.start[tiles[-1]] + horizon:
                tiles.append(int(index))
        yield from (tiles[first : first + count] for first in range(0, max(len(tiles) - count + 1, 1), count))


@dataclass(frozen=True)
class Replay:
    """Predictions of flights, their errors by horizon and window.

    Attributes
    ----------
    errors : mapping of str to SignalErrors or None
        By signal; None where no flight knows it.
    windows : Windows
    """

    errors: Mapping[str, SignalErrors | None]
    windows: Windows


_OUTER = 0.05


@dataclass(frozen=True)
class Region:
    """Where a model predicts body rates better than what knows no model.

    Attributes
    ----------
    share : float
        Of the windows.
    speed : array, shape (2,), m/s, or None
        Of the flight at the begin of nine tenths of these windows; None where a flight does not know it.
    rate : array, shape (2,), rad/s
    """

    share: float
    speed: Array | None
    rate: Array


def where_better(flights: Sequence[Played], windows: Windows) -> Region | None:
    """Find the speeds and rates at which a model is better; None where it is nowhere."""
    model, *rivals = windows.size[:3]
    better = model < np.min(rivals, axis=0)
    if not better.any():
        return None
    motions = [played.flight.motion for played in flights]
    places = [windows.start[better & (windows.flight == index)] for index in range(len(flights))]

    def span(signals: Sequence[Array]) -> Array:
        sizes = [np.linalg.norm(signal[at], axis=1) for signal, at in zip(signals, places, strict=True)]
        return np.asarray(np.quantile(np.concatenate(sizes), [_OUTER, 1 - _OUTER]))

    known = all(played.knows["velocity"] for played in flights)
    speed = span([motion.velocity for motion in motions]) if known else None
    return Region(float(better.mean()), speed, span([motion.rate for motion in motions]))


@dataclass
class _Sums:
    """Sums over the windows so far."""

    horizon: int
    count: dict[str, int] = field(default_factory=lambda: dict.fromkeys(SIGNALS, 0))
    norm: Array = field(init=False)
    square: Array = field(init=False)

    def __post_init__(self) -> None:
        self.norm = np.zeros((4, len(PREDICTIONS), self.horizon))
        self.square = np.zeros((4, len(PREDICTIONS), self.horizon, 3))

    def add(self, prediction: int, errors: Array, knows: Mapping[str, bool]) -> None:
        """Add the errors of a batch, shape (run, horizon, 4, 3)."""
        norms = np.sqrt(np.einsum("nhsa,nhsa->nhs", errors, errors)).sum(axis=0)
        squares = np.einsum("nhsa,nhsa->hsa", errors, errors)
        for row, signal in enumerate(SIGNALS):
            if knows[signal]:
                self.norm[row, prediction] += norms[:, row]
                self.square[row, prediction] += squares[:, row]
                self.count[signal] += len(errors) if prediction == 0 else 0

    def errors(self) -> dict[str, SignalErrors | None]:
        """Take the means."""
        return {
            signal: SignalErrors(self.norm[row] / count, np.sqrt(self.square[row] / count)) if count else None
            for row, (signal, count) in enumerate(self.count.items())
        }


def replay(
    flights: Sequence[Played], horizon: int, every: int, progress: Callable[[float], None] = lambda _: None
) -> Replay:
    """Play a model and what it has to beat back along flights.

    Parameters
    ----------
    flights : sequence of Played
        Of one sampling period.
    horizon, every : int
        Samples.
    progress : callable
        Takes the share that is done.

    Raises
    ------
    InputError
        If a flight is shorter than the horizon.

    References
    ----------
    The metric of arXiv 2512.14450: mean norms of errors by horizon, and their sums.
    """
    starts = [played.flight.starts(horizon, every) for played in flights]
    sums, parts, done, total = _Sums(horizon), [], 0, sum(map(len, starts))
    for index, played in enumerate(flights):
        for batch in _batches(starts[index], max(1, _BATCH // horizon)):
            parts.append(_added(sums, played, batch, index))
            done += len(batch)
            progress(done / total)
    joined = [np.concatenate(columns, axis=-1) for columns in zip(*parts, strict=True)]
    return Replay(sums.errors(), Windows(*joined))


def _batches(starts: IntArray, size: int) -> Iterator[IntArray]:
    return (starts[first : first + size] for first in range(0, len(starts), size))


def _added(sums: _Sums, played: Played, starts: IntArray, flight: int) -> tuple[IntArray, IntArray, Array, IntArray]:
    """Add a batch to the sums; give the columns of `Windows`."""
    size = np.empty((len(PREDICTIONS), len(starts)))
    diverged = np.empty(size.shape, dtype=np.int64)
    knows = played.knows
    model: Runs | None = None
    for row, prediction in enumerate(PREDICTIONS):
        again = model if prediction == STATED and played.stated is played.model else None
        runs = again or played.runs(prediction, starts, sums.horizon)
        model = runs if prediction == MODEL else model
        sums.add(row, runs.errors, knows)
        size[row] = np.linalg.norm(runs.errors[:, :, SIGNALS.index("body_rate")], axis=2).mean(axis=1)
        diverged[row] = runs.diverged
    return np.full(len(starts), flight), starts, size, diverged


@dataclass(frozen=True)
class Drawn:
    """Runs of the model beside the flight, their starts included.

    Attributes
    ----------
    measured, model : array, shape (run, horizon + 1, 3), rad/s, body frame
    measured_position, model_position : array, shape (run, horizon + 1, 3), m, world frame, or None
        None where position is not played back.
    """

    measured: Array
    model: Array
    measured_position: Array | None
    model_position: Array | None


def drawn_runs(played: Played, starts: IntArray, horizon: int) -> Drawn:
    """Give what the model and the flight do from samples on.

    Parameters
    ----------
    starts : array of int, shape (run,)
        Ascending.
    horizon : int
        Samples.
    """
    errors = played.runs(MODEL, starts, horizon).errors
    samples = starts[:, None] + np.arange(horizon + 1)
    rate, position = played.flight.motion.rate[samples], played.flight.motion.position[samples]
    if not played.knows["position"]:
        return Drawn(rate, _predicted(rate, errors[:, :, 3]), None, None)
    return Drawn(rate, _predicted(rate, errors[:, :, 3]), position, _predicted(position, errors[:, :, 0]))


def _predicted(measured: Array, errors: Array) -> Array:
    predicted = measured.copy()
    predicted[:, 1:] += errors
    return predicted
