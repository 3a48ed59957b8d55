"""What is played back along a flight: a model made ready with its free runs and what they know of the past; courses.

A course is what a simulator flies along: where runs start, and the commands of rotors between samples.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from math import ceil

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.effects.signals import Signals
from cpfls_cli.playback.flight import FASTEST, LoggedFlight, MeasuredMotion, PlaybackFlight, State, playback_flight
from cpfls_cli.playback.model import VehicleModel, wrench_along
from cpfls_cli.playback.rotors import RotorResponse
from cpfls_cli.playback.windows import Flown, RunErrors, Runs, Steps, errors_of_runs, exponential, rotation_errors
from cpfls_cli.result import about, result


@result
class Observer:
    """Observes torque and force that a model misses, about and along the body axes.

    The model takes one step from each measured sample. What it misses of a step is the torque and force e that must
    have acted over it in addition to its own. They are taken for a disturbance d, which is followed from 0 on over the
    steps h of the past, about and along each axis with a rate r and a memory T,

        d' = exp(-h / T) (d + (1 - exp(-r h)) (e - d)).

    It is an observer whose rate and velocity are corrected to what was measured at each sample, and whose second gain
    integrates the disturbance. From the start on nothing is observed: ``d' = exp(-h / T) d`` acts on the body.
    """

    rate: Array = about(
        "at which what the model misses is taken up: torque x y z, force x y z", "6", unit="1/s", frame="body (FLU)"
    )
    memory_s: Array = about(
        "time constant with which the disturbance fades", "6", unit="s", frame="body (FLU)", least=0.0
    )
    past_s: float = about("how much of the flight before a start is used", unit="s")

    def samples(self, period: float) -> int:
        """Count the steps of the past."""
        return round(self.past_s / period)

    def weights(self, period: float) -> Array:
        """Weigh the steps of the past, the latest last: the disturbance is their sum, shape (step, 6)."""
        gain, keep = 1.0 - np.exp(-period * self.rate), np.exp(-period / self.memory_s)
        later = np.arange(self.samples(period))[::-1, None]
        return np.asarray(keep * gain * (keep * (1.0 - gain)) ** later)

    def fading(self, period: float, horizon: int) -> Array:
        """Give the share of the disturbance that lasts, over each step of a run, shape (horizon, 6)."""
        return np.asarray(np.exp(-period * np.arange(horizon)[:, None] / self.memory_s))


def past_of(flight: PlaybackFlight, starts: IntArray, samples: int) -> tuple[IntArray, Array]:
    """List the steps before each start, and which of them are in its stretch: earlier ones hold nothing of it.

    Parameters
    ----------
    starts : array of int, shape (run,)
    samples : int
        Steps of the past.

    Returns
    -------
    steps : array of int, shape (run, samples)
        Samples at which they begin, the latest last; the first of the stretch where there is none.
    known : array, shape (run, samples)
        1, or 0.
    """
    begins = np.zeros(len(starts), dtype=np.int64)
    for stretch in flight.stretches:
        begins[(starts >= stretch.start) & (starts < stretch.stop)] = stretch.start
    steps = starts[:, None] + np.arange(-samples, 0)
    return np.maximum(steps, begins[:, None]), (steps >= begins[:, None]).astype(float)


@dataclass(frozen=True)
class Player:
    """A model made ready to be played back along one flight.

    `rotor`: terms of the rotors over each step, shape (time, 1 + 4 rotors); `along`: what acts over each step on top,
    stated or evaluated along the measured motion, shape (time, 6), N m and N; `wind` in m/s, world frame; `observer`:
    what runs know of the past, of constant inertia alone; None: nothing but the state that they start from.
    """

    flown: Flown
    rotor: Array
    along: Array | None = None
    wind: tuple[float, float, float] = (0.0, 0.0, 0.0)
    observer: Observer | None = None

    def steps(self, samples: IntArray, push: Array | None = None) -> Steps:
        """Take the rotors over steps that begin at samples, shape (step, run).

        Parameters
        ----------
        push : array, shape (step, run, 6), N m and N, or None
            On top of what is known along the flight.
        """
        along = None if self.along is None else self.along[samples]
        return Steps(self.rotor[samples], push if along is None else along if push is None else along + push)

    def wrench(self, flight: PlaybackFlight) -> Array:
        """Evaluate torque and force along the measured motion, shape (time, 6), N m and N, body frame."""
        motion = flight.motion
        air = np.einsum("tji,tj->ti", motion.rotation, motion.velocity - self.wind)
        wrench = wrench_along(self.flown, air, motion.rate, self.rotor)
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
    model, stated = model.driven_by(parts[0]) if parts else model, flight.wrench
    if stated is not None:
        stated = replace(flight, speed=stated).rotor_terms(*model.response.times)[:, 1:7]
    return Player(
        flown=model.flown,
        rotor=flight.rotor_terms(*model.response.times),
        along=_along(model, stated, parts),
        wind=model.wind,
    )


def _along(model: VehicleModel, stated: Array | None, parts: Sequence[Signals]) -> Array | None:
    """Give what acts over each step that is not simulated, shape (time, 6); None for nothing."""
    if stated is None and not model.along:
        return None
    at_samples = (model.other_wrench(part) for part in parts)
    # Means over each step; the last one has no end.
    means = [0.5 * (own + np.concatenate([own[1:], own[-1:]])) for own in at_samples]
    total = np.asarray(sum(each for each in (stated, np.concatenate(means) if means else None) if each is not None))
    return model.with_lever(total)


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
    slowed = (one for one in model.filters if one.effect.is_lag)
    filtered = any(not one.effect.missing(part) for one in slowed for part in repaired)
    # What a filter leaves of a speed that stays until the next sample is nearer to a straight line.
    made = playback_flight(parts, "linear" if filtered else model.hold_of(parts[0], flight.hold))
    return replace(made, group=flight.group), player_of(model, made, parts)


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
    count = len(state.rate)
    path = Runs(MeasuredMotion(*state, period), np.arange(count), translates=True).fly(
        model.flown, Steps(rotor[None, :count])
    )
    ends = (path.position[-1].T, path.velocity[-1].T, path.rotation[-1].transpose(2, 0, 1), path.rate[-1].T)
    stopped = path.diverged >= 0
    return State(*(np.where(stopped.reshape(-1, *[1] * (end.ndim - 1)), np.nan, end) for end in ends))


def apart(first: RunErrors, second: RunErrors) -> Array:
    """Compute how far runs end from each other: mean norms of position, velocity, attitude and rate, shape (4,), SI."""
    return np.asarray(np.linalg.norm(second.errors[:, -1] - first.errors[:, -1], axis=2).mean(axis=0))


def free_runs(player: Player, flight: PlaybackFlight, starts: IntArray, horizon: int) -> RunErrors:
    """Play a model back from samples of a flight.

    Parameters
    ----------
    starts : array of int, shape (run,)
        Ascending.
    horizon : int
        Samples.
    """
    still, push = in_the_air(flight, player.wind), None
    if player.observer is not None:
        push = observed(player, flight, starts) * player.observer.fading(still.motion.period, horizon)[:, None]
    steps = player.steps(starts + np.arange(horizon)[:, None], push)
    return errors_of_runs(player.flown, Runs(still.motion, starts, flight.translates), steps)


def missed_before(player: Player, flight: PlaybackFlight, starts: IntArray, samples: int) -> Array:
    """Give what a model misses of the steps before each start, shape (run, samples, 6), N m and N, body frame.

    0 where there is none.
    """
    steps, known = past_of(flight, starts, samples)
    first = int(steps.min(initial=int(starts.min())))
    taken = np.arange(first, int(starts.max()))
    missed = np.zeros((len(taken) + 1, 6))
    if len(taken):
        errors = free_runs(replace(player, observer=None), flight, taken, 1).errors[:, 0]
        body, period, rotation = player.flown.body, flight.motion.period, flight.motion.rotation[taken]
        missed[:-1, :3] = -errors[:, 3] @ body.inertia / period
        if flight.translates:
            missed[:-1, 3:] = -body.mass / period * np.einsum("tji,tj->ti", rotation, errors[:, 1])
    return np.asarray(missed[steps - first] * known[:, :, None])


def observed(player: Player, flight: PlaybackFlight, starts: IntArray) -> Array:
    """Observe the disturbance at each start from samples up to it alone, shape (run, 6), N m and N, body frame.

    Starts ascend. Where a stretch begins later than the past that is asked for, it is observed from what there is.
    """
    observer, period = player.observer, flight.motion.period
    assert observer is not None
    missed = missed_before(player, flight, starts, observer.samples(period))
    return np.asarray(np.einsum("rsa,sa->ra", missed, observer.weights(period)))


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
    flight: PlaybackFlight, starts: IntArray, horizon: int, *, moves: bool, fading_s: float = np.inf, every: int = 1
) -> RunErrors:
    """Predict that the whole state stays what it was, or that velocity does and rates stay or fade.

    `moves`: attitude and position follow rates and velocity; rates fade with the time constant `fading_s`; `every`:
    samples of a step.
    """
    motion, after = flight.motion, every * np.arange(1, horizon + 1)
    elapsed = (after * motion.period)[:, None, None]
    share = np.exp(-elapsed / fading_s)
    begin = State(*(each[starts] for each in motion[:4]))
    position, held, rate = begin.position[None], begin.rotation[None], begin.rate * share
    if moves:
        position = position + elapsed * begin.velocity
        # How far it has turned: of one that fades, as far as the rate at the start does in a shorter time.
        turned = (elapsed if np.isinf(fading_s) else fading_s * (1.0 - share)) * begin.rate
        held = held @ _turns(turned.reshape(-1, 3)).reshape(*rate.shape, 3)
    at = after[:, None] + starts
    errors = less_measured(State(position, begin.velocity, np.broadcast_to(held, (*rate.shape, 3)), rate), motion, at)
    return RunErrors(errors.swapaxes(0, 1), np.full(len(starts), -1))


def _turns(vector: Array) -> Array:
    """Compute the rotations by vectors, rad, shape (samples, 3) to (samples, 3, 3)."""
    return np.stack(exponential(tuple(vector.T)), axis=1).reshape(-1, 3, 3)


def less_measured(state: State, motion: MeasuredMotion, at: IntArray) -> Array:
    """Compare states with what was measured at samples, shape (..., 4, 3): in the order and sense of `RunErrors`."""
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
    by_entry = (np.ascontiguousarray(np.moveaxis(each.reshape(-1, 3, 3), 0, -1)) for each in (measured, predicted))
    return np.asarray(rotation_errors(*by_entry).T.reshape(measured.shape[:-1]))


_CLOCKS = 1e-3
"""Share of a sampling period by which the clock of a log is off at most."""


@dataclass(frozen=True)
class Course:
    """Runs along the logged rotor speeds of a flight, from states that were measured.

    Attributes
    ----------
    starts : array of int, shape (run,)
        Ascending samples of the flight.
    horizon : int
        Samples that each run goes.
    finer : int
        Steps of a simulator between two samples.
    gravity : float, m/s^2
        Of the world, where no file of the vehicle says it.
    """

    flight: PlaybackFlight
    starts: IntArray
    horizon: int
    finer: int = 1
    gravity: float = 9.81

    @property
    def period(self) -> float:
        """Length of a step of a simulator, s."""
        return self.flight.motion.period / self.finer

    @property
    def start(self) -> State:
        """Measured states that the runs start from."""
        return State(*(part[self.starts] for part in self.flight.motion[:4]))

    @property
    def commands(self) -> Array:
        """Mean of the logged speeds over each step of a simulator, shape (run, horizon * finer, rotor), rad/s."""
        along = _finer_speed(self.flight, self.finer)
        after = np.concatenate([along[1:], along[-1:]])
        mean = 0.5 * (along + after) if self.flight.hold == "linear" else along
        steps = self.finer * self.starts[:, None] + np.arange(self.horizon * self.finer)
        return np.asarray(mean[steps])

    def lagged(self, response: RotorResponse) -> Array:
        """Give the speeds at which rotors that lag turn at the starts, shape (run, rotor)."""
        flight = self.finer_flight
        terms = flight.of_speeds(response.terms_at_samples)
        return np.asarray(terms[self.finer * self.starts, 1 : 1 + flight.speed.shape[1]])

    @property
    def finer_flight(self) -> PlaybackFlight:
        """The flight at the steps of a simulator; between samples its motion is that of the sample before."""
        motion, finer = self.flight.motion, self.finer
        position, velocity, rotation, rate = (np.repeat(part, finer, axis=0) for part in motion[:4])
        own = MeasuredMotion(position, velocity, rotation, rate, self.period)
        stretches = tuple(slice(finer * part.start, finer * part.stop) for part in self.flight.stretches)
        return replace(self.flight, motion=own, speed=_finer_speed(self.flight, finer), stretches=stretches)

    def steps(self, longest_s: float) -> int:
        """Count the equal steps in a step of the course, none of them longer than this but by errors of clocks."""
        return max(1, ceil((1.0 - _CLOCKS) * self.period / longest_s))

    def collected(self, runs: Iterable[Iterable[State]]) -> State:
        """Collect what runs pass through after each step; see `Flies`."""
        vector = len(self.starts), self.horizon, 3
        states = State(*(np.full(shape, np.nan) for shape in (vector, vector, (*vector, 3), vector)))
        for run, path in enumerate(runs):
            for step, now in enumerate(path, 1):
                if not (np.abs(now.rate) < FASTEST).all():
                    break
                if step % self.finer == 0:
                    for part, own in zip(states, now, strict=True):
                        part[run, step // self.finer - 1] = own
        return states

    def errors(self, states: State) -> Array:
        """Compare runs with what was measured, shape (run, horizon, 4, 3), as `RunErrors` does."""
        return less_measured(states, self.flight.motion, self.starts[:, None] + 1 + np.arange(self.horizon))


Flies = Callable[[Course, bool], State]
"""From a course whose rotors are in the order of a file, and whether they lag behind its speeds, which are kept from
step to step, to states of the centre of mass at the samples behind each start, shape (run, horizon, ...); NaN from
where a run ran away."""

Wrench = Callable[[Array, Array, Array, Array], tuple[Array, Array]]
"""From rotor speeds, velocity through the air, body rate and attitude (body to world) of each run to torque and force,
body frame, (run, 3)."""


def fly_body(course: Course, mass: float, inertia: Array, wrench: Wrench, lag: float) -> State:
    """Fly a rigid body by the published equations of a target, semi-implicit; see `Otherwise.fly`.

    Parameters
    ----------
    inertia : array, shape (3, 3), kg m^2
    lag : float, s
        Of the rotors behind their commands; 0 for none.
    """
    period, gravity = course.period, np.array([0.0, 0.0, -course.gravity])
    speed, state = course.lagged(RotorResponse(lag_s=lag)), course.start
    rows, keep = [], np.exp(-period / lag) if lag else 0.0
    for step, command in enumerate(course.commands.swapaxes(0, 1), 1):
        speed = speed if lag else command
        air = np.einsum("nji,nj->ni", state.rotation, state.velocity)
        torque, force = wrench(speed, air, state.rate, state.rotation)
        linear = np.einsum("nij,nj->ni", state.rotation, force) / mass + gravity
        moment = torque - rotations.cross(state.rate, state.rate @ inertia)
        velocity, rate = state.velocity + period * linear, state.rate + period * np.linalg.solve(inertia, moment.T).T
        turned = state.rotation @ _turns(period * rate)
        state = State(state.position + period * velocity, velocity, turned, rate)
        speed = keep * speed + (1.0 - keep) * command
        if step % course.finer == 0:
            rows.append(state)
    return State(*(np.stack(parts, axis=1) for parts in zip(*rows, strict=True)))


def _finer_speed(flight: PlaybackFlight, finer: int) -> Array:
    """Give the logged speeds at the steps of a simulator: on straight lines, or what they were."""
    if flight.hold == "previous":
        return np.repeat(flight.speed, finer, axis=0)
    parts = []
    for part in flight.stretches:
        speed = flight.speed[part]
        after = np.concatenate([speed[1:], speed[-1:]])
        share = (np.arange(finer) / finer)[:, None]
        parts.append((speed[:, None] + share * (after - speed)[:, None]).reshape(-1, speed.shape[1]))
    return np.concatenate(parts)
