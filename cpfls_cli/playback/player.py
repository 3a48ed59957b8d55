"""A model made ready to be played back along a flight, and its free runs from many samples."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.dynamics.equations_of_motion import InertiaModel, body_inertia, momentum_form
from cpfls_cli.dynamics.rigid_body import positive_definite
from cpfls_cli.effects.signals import Signals
from cpfls_cli.playback.flight import LoggedFlight, PlaybackFlight, motion_at, playback_flight
from cpfls_cli.playback.history import Observer, missed_wrench, past_of
from cpfls_cli.playback.kernels import FASTEST, Body, MeasuredMotion, Terms, errors_of_runs
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.playback.motion import State
from cpfls_cli.playback.rotors import RotorResponse
from cpfls_cli.playback.table import WrenchTable, lever_weights

_TINY = 1e-12
"""Sine of an angle, in rad, that is rounding: the axis does not show."""


@dataclass(frozen=True)
class Player:
    """A model made ready to be played back along one flight.

    Attributes
    ----------
    rotor : array, shape (time, 1 + 4 rotors)
        Terms of the rotors over each step.
    along : array, shape (time, 6), N m and N, or None
        What acts over each step beside: stated, or evaluated along the measured motion.
    fuzzy : InertiaModel or None
        Stands in the place of the inertia of `body`.
    wind : tuple of float, m/s, world frame
    observer : Observer or None
        What runs know of the past; None: nothing but the state that they start from. Of constant inertia alone.
    """

    table: WrenchTable
    rotor: Array
    body: Body
    along: Array | None = None
    fuzzy: InertiaModel | None = None
    wind: tuple[float, float, float] = (0.0, 0.0, 0.0)
    observer: Observer | None = None

    def step_weights(self, part: slice) -> tuple[Terms, Array]:
        """Evaluate the weights of the terms of the motion over each step of a part of the flight.

        Returns
        -------
        terms : Terms
            Those in use, the constant always.
        weights : array, shape (time, 6, active)
        """
        used, weights = self.table.by_step(self.rotor[part])
        if self.along is not None:
            weights[:, :, 0] += self.along[part]
        return used, weights

    def wrench(self, flight: PlaybackFlight) -> Array:
        """Evaluate torque and force along the measured motion, shape (time, 6), N m and N, body frame."""
        motion = flight.motion
        air = np.einsum("tji,tj->ti", motion.rotation, motion.velocity - self.wind)
        wrench = self.table.wrench(air, motion.rate, self.rotor)
        return wrench if self.along is None else wrench + self.along


def player_of(model: VehicleModel, flight: PlaybackFlight, parts: Sequence[Signals] = ()) -> Player:
    """Make a model ready for a flight.

    Parameters
    ----------
    model : VehicleModel
        A flight without rotor speeds plays what its log states, late by the response of the model's rotors.
    parts : sequence of Signals
        Stretches of the flight as the model meets them (`VehicleModel.acting`), along which effects that are no
        polynomials are evaluated; none for a model without such effects and a flight with rotor speeds.
    """
    response = model.response_to(parts[0]) if parts else model.response
    return Player(
        table=model.table,
        rotor=rotor_terms_along(flight, response),
        body=model.body,
        along=_along(model, stated_along(flight, response), parts),
        fuzzy=model.fuzzy,
        wind=model.wind,
    )


def _along(model: VehicleModel, stated: Array | None, parts: Sequence[Signals]) -> Array | None:
    """Give what acts over each step beside the table, shape (time, 6); None for nothing."""
    if stated is None and not model.along:
        return None
    beside = [_by_step(model.wrench_beside(part)) for part in parts]
    total = np.asarray(sum(each for each in (stated, np.concatenate(beside) if beside else None) if each is not None))
    return np.asarray(total + lever_weights(model.centre, total.T).T)


def _by_step(values: Array) -> Array:
    """Take the mean over each step, shape (time, 6); the last one has no end."""
    return np.asarray(0.5 * (values + np.concatenate([values[1:], values[-1:]])))


def made_ready(model: VehicleModel, flight: LoggedFlight) -> tuple[PlaybackFlight, Player]:
    """Make a flight and a model ready for each other.

    Faults of the sensors are taken out, and filters act on what drives the rotors. Effects that are polynomials of
    motion and rotor speeds are simulated with the state; all others, such as a payload, are evaluated along the
    measured motion.

    Raises
    ------
    InputError
        If the flight lacks a signal that an effect evaluated along it, a filter, or the inertia needs.
    """
    repaired = [model.repaired(part) for part in flight.parts]
    for part in repaired:
        model.require(part, flight.name)
    parts = [model.acting(part) for part in repaired]
    filtered = any(not one.effect.missing(part) for one in model.filters for part in repaired)
    # What a filter leaves of a speed that stays until the next sample is nearer to a straight line.
    made = playback_flight(flight.name, parts, "linear" if filtered else model.hold_of(parts[0], flight.hold))
    return replace(made, group=flight.group), player_of(model, made, parts)


def rotor_terms_along(flight: PlaybackFlight, response: RotorResponse) -> Array:
    """Evaluate the terms of the rotors over each step, stretch by stretch, shape (time, 1 + 4 rotors)."""
    parts = (flight.speed[part] for part in flight.stretches)
    return np.concatenate([response.terms_by_step(part, flight.motion.period, flight.hold) for part in parts])


def stated_along(flight: PlaybackFlight, response: RotorResponse) -> Array | None:
    """Evaluate the stated torque and force over each step, shape (time, 6); None of a flight with rotor speeds."""
    wrench = flight.wrench
    if wrench is None:
        return None
    parts = (wrench[part] for part in flight.stretches)
    return np.concatenate([response.terms_by_step(part, flight.motion.period, flight.hold)[:, 1:7] for part in parts])


def one_step(model: VehicleModel, state: State, rotor: Array, period: float) -> State:
    """Take one step of any model, by the rule of its free runs.

    Parameters
    ----------
    rotor : array, shape (samples, 1 + 4 rotors)
        See `RotorResponse.terms_by_step`.
    period : float, s

    Returns
    -------
    State
        NaN where an inertia that depends on the attitude is not positive definite.
    """
    if any(model.wind):
        # Seen from the air there is no wind.
        wind = np.array(model.wind)
        still = replace(model, wind=(0.0, 0.0, 0.0))
        after = one_step(still, state._replace(velocity=state.velocity - wind), rotor, period)
        return after._replace(position=after.position + period * wind, velocity=after.velocity + wind)
    player = Player(table=model.table, rotor=rotor, body=model.body, fuzzy=model.fuzzy)
    used, weights = player.step_weights(slice(None))
    return _MomentumRuns(player, MeasuredMotion(*state, period), used, weights, translates=True).one_step()


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
    if player.observer is not None:
        return _runs_with_past(player, player.observer, flight, starts, horizon)
    first, part = int(starts[0]), slice(int(starts[0]), int(starts[-1]) + horizon + 1)
    motion = motion_at(in_the_air(flight, player.wind).motion, part)
    used, weights = player.step_weights(part)
    errors = np.empty((len(starts), horizon, 4, 3))
    if player.fuzzy is None:
        moved = errors_of_runs(motion, player.body, used, weights, starts - first, flight.translates, errors)
        return Runs(errors, moved)
    runs = _MomentumRuns(player, motion, used, weights, flight.translates)
    return Runs(errors, runs.written(starts - first, errors))


_BATCH = 250
"""Runs with a past at a time: each has weights of its own, and those of so many stay in the cache."""


def _runs_with_past(player: Player, observer: Observer, flight: PlaybackFlight, starts: IntArray, horizon: int) -> Runs:
    """Play a model back from samples of a flight, pushed by the disturbance that was observed before each."""
    still = in_the_air(flight, player.wind)
    pushes = observed(player, flight, starts)
    fading = observer.fading(still.motion.period, horizon)
    parts = []
    for first in range(0, len(starts), _BATCH):
        own = starts[first : first + _BATCH]
        begin = int(own[0])
        used, by_sample = player.step_weights(slice(begin, int(own[-1]) + horizon + 1))
        # One window beside the other, as each is pushed by itself.
        samples = (own[:, None] + np.arange(horizon + 1)).ravel()
        weights = by_sample[samples - begin].reshape(len(own), horizon + 1, *by_sample.shape[1:])
        weights[:, :-1, :, 0] += pushes[first : first + _BATCH, None] * fading
        motion = motion_at(still.motion, samples)
        errors = np.empty((len(own), horizon, 4, 3))
        places = np.arange(len(own)) * (horizon + 1)
        flat = weights.reshape(-1, *weights.shape[2:])
        parts.append((errors, errors_of_runs(motion, player.body, used, flat, places, flight.translates, errors)))
    return Runs(*(np.concatenate(each) for each in zip(*parts, strict=True)))


def observed(player: Player, flight: PlaybackFlight, starts: IntArray) -> Array:
    """Observe the disturbance at each start, from samples up to it alone.

    Parameters
    ----------
    player : Player
        With an observer.
    starts : array of int, shape (run,)
        Ascending.

    Returns
    -------
    array, shape (run, 6), N m and N, body frame
        Where a stretch begins later than the past that is asked for, from what there is.
    """
    observer = player.observer
    assert observer is not None
    period = flight.motion.period
    steps, known = past_of(flight, starts, observer.samples(period))
    taken = np.arange(int(steps.min()), int(starts[-1]))
    missed = np.zeros((len(taken) + 1, 6))
    if len(taken):
        single = free_runs(replace(player, observer=None), flight, taken, 1).errors[:, 0]
        missed[:-1] = missed_wrench(flight, taken, single, player.body)
    weights = observer.weights(period)
    return np.asarray(np.einsum("rsa,rs,sa->ra", missed[steps - int(steps.min())], known, weights))


def in_the_air(flight: PlaybackFlight, wind: tuple[float, float, float]) -> PlaybackFlight:
    """See a flight from the air, which moves with a steady wind: the errors of runs are the same there."""
    if not any(wind):
        return flight
    motion = flight.motion
    gone = motion.period * np.arange(len(flight))[:, None] * wind
    return replace(
        flight, motion=motion._replace(position=motion.position - gone, velocity=motion.velocity - np.array(wind))
    )


def still_runs(
    flight: PlaybackFlight, starts: IntArray, horizon: int, *, moves: bool, fading_s: float = np.inf
) -> Runs:
    """Predict that the whole state stays what it was, or that velocity does and rates stay or fade.

    Parameters
    ----------
    starts : array of int, shape (run,)
    horizon : int
        Samples.
    moves : bool
        Whether attitude and position follow the rates and the velocity.
    fading_s : float, s
        Time constant with which rates fade.
    """
    motion = flight.motion
    velocity, rate, held = motion.velocity[starts], motion.rate[starts], motion.rotation[starts]
    errors = np.empty((len(starts), horizon, 4, 3))
    for step in range(horizon):
        elapsed = (step + 1) * motion.period
        share = np.exp(-elapsed / fading_s)
        if moves:
            # How far it has turned: of one that fades, as far as the rate at the start does in a shorter time.
            as_long = elapsed if np.isinf(fading_s) else fading_s * (1.0 - share)
            held = motion.rotation[starts] @ rotations.turns(as_long * rate)
        position = motion.position[starts] + (elapsed * velocity if moves else 0.0)
        errors[:, step] = less_measured(State(position, velocity, held, share * rate), motion, starts + step + 1)
    return Runs(errors, np.full(len(starts), -1))


def less_measured(state: State, motion: MeasuredMotion, at: IntArray) -> Array:
    """Compare states with what was measured at samples, shape (..., 4, 3): in the order and sense of `Runs.errors`."""
    turned = rotation_vectors(motion.rotation[at], state.rotation)
    position, velocity = state.position - motion.position[at], state.velocity - motion.velocity[at]
    return np.stack([position, velocity, turned, state.rate - motion.rate[at]], axis=-2)


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


class _Turned(NamedTuple):
    """How bodies turn at the attitudes of the runs.

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


class _State(NamedTuple):
    """Free runs in momentum form: no inertia that depends on the attitude has to be differentiated in time."""

    position: Array
    velocity: Array
    rotation: Array
    momentum: Array


@dataclass(frozen=True)
class _MomentumRuns:
    """Free runs under any inertia, one that depends on the attitude too, all at once, by the rule of the compiled ones.

    The compiled loops know a constant inertia alone, and are what thousands of runs are played by.
    """

    player: Player
    motion: MeasuredMotion
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
            good = (diverged < 0) & after.exists & (fastest < FASTEST)
            # A run that no body flies stands still from there on, as that of a rigid body does.
            diverged[(diverged < 0) & ~good] = step
            state = _State(*(_kept(good, new, old) for new, old in zip(moved, state, strict=True)))
            rate, now = _kept(good, after.rate, rate), after
            reached = State(state.position, state.velocity, state.rotation, rate)
            errors[:, step] = less_measured(reached, motion, starts + step + 1)
        return diverged

    def one_step(self) -> State:
        """Take one step from each sample; not a number where it meets an attitude at which no body has the inertia."""
        state, rate, now = self._begun(np.arange(len(self.motion.rate)))
        with np.errstate(all="ignore"):
            moved, after = self._step(state, rate, now, self.weights)
        parts = (moved.position, moved.velocity, moved.rotation, after.rate)
        return State(*(_kept(after.exists, part, np.full_like(part, np.nan)) for part in parts))

    def _begun(self, starts: IntArray) -> tuple[_State, Array, _Turned]:
        motion, fuzzy = self.motion, self.player.fuzzy
        rate, rotation = motion.rate[starts], motion.rotation[starts]
        if fuzzy is None:
            momentum = rate @ self.player.body.inertia
        else:
            momentum = rotations.multiply(np.nan_to_num(body_inertia(fuzzy, _finite_attitude(rotation))[1]), rate)
        state = _State(motion.position[starts], motion.velocity[starts], rotation, momentum)
        return state, rate, self._turned(rotation, momentum)

    def _step(self, state: _State, rate: Array, now: _Turned, weights: Array) -> tuple[_State, _Turned]:
        period = self.motion.period
        middle = self._moved(state, state, rate, now.direct, weights, 0.5 * period)
        there = self._turned(middle.rotation, middle.momentum)
        end = self._moved(state, middle, there.rate, there.direct, weights, period)
        after = self._turned(end.rotation, end.momentum)
        return end, after._replace(exists=now.exists & there.exists & after.exists)

    def _moved(self, start: _State, at: _State, rate: Array, direct: Array, weights: Array, interval: float) -> _State:
        """Move a state for an interval with the derivatives at another one."""
        air = np.einsum("nji,nj->ni", at.rotation, at.velocity)
        terms = self.player.table.terms(air, rate)[:, self.used.active]
        wrench = np.einsum("nka,na->nk", weights, terms)
        momentum = start.momentum + interval * (wrench[:, :3] - direct)
        rotation = start.rotation @ rotations.turns(interval * rate)
        if not self.translates:
            return _State(start.position, start.velocity, rotation, momentum)
        acceleration = rotations.multiply(at.rotation, wrench[:, 3:]) / self.player.body.mass
        acceleration[:, 2] -= self.player.body.gravity
        position = start.position + interval * at.velocity
        return _State(position, start.velocity + interval * acceleration, rotation, momentum)

    def _turned(self, rotation: Array, momentum: Array) -> _Turned:
        fuzzy = self.player.fuzzy
        if fuzzy is None:
            rate = np.asarray(momentum @ self.player.body.inverse)
            return _Turned(rate, np.cross(rate, momentum), np.ones(len(rate), dtype=bool))
        attitude = _finite_attitude(rotation)
        values, matrices = body_inertia(fuzzy, attitude)
        exists = positive_definite(matrices)
        safe = np.where(exists[:, None, None], matrices, np.eye(3))
        rate = np.asarray(np.linalg.solve(safe, momentum[..., None])[..., 0], dtype=float)
        return _Turned(rate, momentum_form(attitude, rate, values)[1], exists)


def _finite_attitude(rotation: Array) -> Array:
    return rotations.euler_angles(np.nan_to_num(rotation))


def _kept(good: BoolArray, new: Array, old: Array) -> Array:
    return np.where(good.reshape(-1, *[1] * (new.ndim - 1)), new, old)
