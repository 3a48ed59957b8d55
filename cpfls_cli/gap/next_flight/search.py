"""Search for the path along which rivals differ most, within the room that a vehicle has."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.dynamics import InertiaModel
from cpfls_cli.effects.effect import Effect
from cpfls_cli.effects.signals import Signals
from cpfls_cli.gap.balance.balance_system import floors, system
from cpfls_cli.gap.balance.weak_flight import WeakFlight, weak_flight
from cpfls_cli.gap.naming.ranking import block_index
from cpfls_cli.gap.next_flight.rivals import (
    DRAWS,
    FEW_DRAWS,
    Answer,
    Evidence,
    Question,
    SizedEffect,
    answered,
    gathered,
    physical_values,
)
from cpfls_cli.gap.next_flight.room import HarmonicPath, Room
from cpfls_cli.gap.residual.air import Air
from cpfls_cli.gap.settings import GapSettings
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.rounding import ascending, less
from cpfls_cli.simulation.inverse import measure, noisy, squared_speeds
from cpfls_cli.simulation.settings import ClosedLoopSettings, SimulationSettings
from cpfls_cli.trajectory.planning import Trajectory
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.weak_form.windows import windows

_BATTERY_USE = 0.2  # Share of its voltage that the battery loses over the flight.
_OPTIONAL = ("attitude", "position", "velocity", "acceleration", "specific_force", "voltage")
_CARRIES = {
    "attitude": ("attitude",),
    "velocity": ("attitude", "velocity"),
    "height": ("attitude", "position"),
    "force": ("attitude", "acceleration"),
    "voltage": ("voltage",),
}
"""Signals that a log may lack, and those that carry what effects need."""


def needed_signals(effects: Iterable[Effect]) -> frozenset[str]:
    """List the signals that a log may lack and that effects need."""
    return frozenset(signal for effect in effects for need in effect.needs for signal in _CARRIES.get(need, ()))


def logged_signals(signals: Signals) -> frozenset[str]:
    """List the signals of a log that another may lack."""
    return frozenset(name for name in _OPTIONAL if getattr(signals, name) is not None)


@dataclass(frozen=True)
class Logging:
    """What will be logged, with which noise, and how it is looked at."""

    signals: frozenset[str]  # Of `attitude`, `position`, `velocity`, `acceleration`, `specific_force`, `voltage`.
    commanded: bool  # Whether commands are logged in place of rotor speeds.
    floor: Array  # Shape (6,), N m and N: standard deviation of window averages by noise.
    settings: GapSettings
    base: InertiaModel | None = None  # Of the model that misses something; None for the rigid body of the vehicle.
    off: float = 0.0  # What formulas are off by, see `formulas_off`.
    air: Air | None = None  # Gusts that are to be expected, in the floor too; None for still air.

    def gathered(self, question: Question, flights: Sequence[WeakFlight]) -> Evidence:
        """Gather what flights would say on a question."""
        return gathered(question, flights, self.floor, self.settings, self.off)

    def weak(self, signals: Signals) -> WeakFlight:
        """Arrange a flight for the balance."""
        settings = self.settings
        shared = windows(signals.period, settings.window_s, settings.overlap)
        flight = weak_flight(signals, shared, self.base, settings.force, settings.axes, self.floor)
        return flight if self.air is None else self.air.around([flight], self.floor)[0]


def planned_signals(planned: Trajectory, room: Room, logging: Logging) -> Signals:
    """Compute what would be logged along a plan by a vehicle without any effect and without noise."""
    speed = np.sqrt(np.maximum(squared_speeds(vars(planned), room.vehicle), 0.0))
    voltage = 1 - _BATTERY_USE * planned.time / planned.duration
    return _signals(planned.time, vars(planned), speed, voltage, room.vehicle, logging)


def _signals(
    time: Array,
    motion: Mapping[str, Array],
    rotor_speed: Array,
    voltage: Array | None,
    vehicle: VehicleSettings,
    logging: Logging,
) -> Signals:
    """Make signals of what will be logged, with what an ideal accelerometer senses."""
    signals = Signals(
        time=time,
        body_rate=motion["body_rate"],
        vehicle=vehicle,
        name="next flight",
        attitude=motion["attitude"],
        position=motion["position"],
        velocity=motion["velocity"],
        acceleration=motion["acceleration"],
        rotor_speed=rotor_speed,
        voltage=voltage,
        commanded=logging.commanded,
        ground_height_m=logging.settings.ground_height_m,
    )
    upward = np.array([0.0, 0.0, vehicle.gravity_m_s2])
    felt = np.einsum("tji,tj->ti", signals.rotation, motion["acceleration"] + upward)
    dropped = {name: None for name in _OPTIONAL if name not in logging.signals}
    return replace(signals, **{"specific_force": felt} | dropped)


def expected_floor(
    room: Room, logging: Logging, noise: SimulationSettings, period: float, rng: np.random.Generator
) -> Array:
    """Estimate the floors that noise of known size will have, along a random path, shape (6,), N m and N.

    `logging`: its floor is not used; `noise`: noise of each signal; `period`: of the log, s.
    """
    exact = planned_signals(room.planned(room.drawn(rng), period), room, logging)
    names = ("attitude", "body_rate", "position", "velocity", "acceleration", "rotor_speed")
    logged: dict[str, Any] = noisy(
        {name: values for name in names if (values := getattr(exact, name)) is not None}, noise, rng
    )[0]
    balance = system([logging.weak(replace(exact, specific_force=None, **logged))])
    return floors(balance, np.zeros(balance.base.shape[2]))


def flown_signals(
    planned: Trajectory,
    effects: Sequence[SizedEffect],
    vehicle: VehicleSettings,
    logging: Logging,
    settings: ClosedLoopSettings,
) -> Signals:
    """Fly a plan in closed loop and log it without noise.

    `effects`: that the flown vehicle has and the autopilot does not know.
    `settings`: their effects are not flown.
    Raises SettingError if an effect has values that no vehicle has.
    Raises ComputationError if the vehicle leaves the path or overturns.
    """
    hidden: dict[str, tuple[float, ...] | dict[str, float]] = {
        each.candidate.effect.name: dict(physical_values(each)) for each in effects
    }
    loop = SimulationSettings(mode="closed-loop", closed_loop=replace(settings, effects=hidden))
    # Without noise nothing is drawn.
    rng = np.random.default_rng(0)
    model = None if logging.base is None else VehicleModel(vehicle=vehicle, fuzzy=logging.base)
    flight = measure(planned.time, vars(planned), vehicle, loop, rng, model=model)
    logged = flight.signals
    speed = logged["rotor_command"] if "rotor_speed" not in logged else logged["rotor_speed"]
    return _signals(planned.time, logged, speed, logged.get("voltage"), vehicle, logging)


@dataclass(frozen=True)
class Goal:
    """What the next flight has to show, given what is known from others."""

    questions: tuple[Question, ...]
    known: tuple[Evidence, ...]  # What the flights already flown say on each question; no blocks without such flights.
    room: Room
    logging: Logging

    def answers(self, signals: Signals | None, draws: int = DRAWS) -> tuple[Answer, ...]:
        """Judge what the known flights say together with one along given signals; None: with themselves once more."""
        if signals is None:
            evidence = [known.after(known) for known in self.known]
        else:
            there = [self.logging.weak(signals)]
            fresh = [self.logging.gathered(each, there) for each in self.questions]
            evidence = [one.after(known) for one, known in zip(fresh, self.known, strict=True)]
        of_effect: dict[str, list[int]] = {}
        for index, question in enumerate(self.questions):
            of_effect.setdefault(question.true.candidate.effect.name, []).append(index)
        answers = {
            index: answer
            for asked in of_effect.values()
            for index, answer in zip(asked, answered([evidence[each] for each in asked], draws), strict=True)
        }
        return tuple(answers[index] for index in range(len(self.questions)))

    def score(self, path: HarmonicPath) -> float:
        """Score a path: logarithm of one over how likely a wrong set is after it, on average over the true ones."""
        answers = self.answers(planned_signals(self.room.planned(path), self.room, self.logging), FEW_DRAWS)
        effects = {question.true.candidate.effect.name for question in self.questions}
        return float(np.log(len(effects) / sum(answer.likely for answer in answers)))


def goal(questions: Sequence[Question], flights: Sequence[WeakFlight], room: Room, logging: Logging) -> Goal:
    """Set up what the next flight has to show.

    `flights`: that are there already.
    """

    def known(question: Question) -> Evidence:
        """Gather what the flights already flown say; nothing where they lack a signal of an effect in question."""
        rival = [] if question.rival is None else [question.rival]
        effects = [question.true.candidate.effect, *rival, *(each.candidate.effect for each in question.besides)]
        if flights and all(any(not effect.missing(flight.signals) for flight in flights) for effect in effects):
            return logging.gathered(question, flights)
        return Evidence.none(1 + int(block_index(system(flights), logging.settings).max()) if flights else 0)

    return Goal(tuple(questions), tuple(known(each) for each in questions), room, logging)


@dataclass(frozen=True)
class NextFlight:
    """The best path that was found."""

    path: HarmonicPath
    # Drawn at random within the same room, from the worst to the best; the best was improved.
    random: tuple[HarmonicPath, ...]
    history: Array  # Shape (iteration,): scores in the course of the search.


def next_flight(
    asked: Goal, rng: np.random.Generator, progress: Callable[[int, int, str], None] = lambda _done, _total, _note: None
) -> NextFlight:
    """Search for the most informative path.

    The best of some random paths is changed at random as long as that helps, by steps that shrink to nothing.

    `progress`: takes paths done, paths in all, and a note.
    Reference: Atkinson and Fedorov 1975, The design of experiments for discriminating between two rival models,
    Biometrika 62 (T-optimality).
    """
    settings, room = asked.room.settings.next_flight, asked.room
    total = settings.starts + settings.iterations
    scored = []
    for number in range(settings.starts):
        path = room.drawn(rng)
        scored.append((asked.score(path), path))
        progress(number + 1, total, f"best random path {max(score for score, _ in scored):.3f}")
    scored = ascending(scored, lambda pair: pair[0])
    best, path = scored[-1]
    history = []
    for number in range(settings.iterations):
        trial = room.fitted(_changed(path, 1 - number / settings.iterations, room, rng))
        score = asked.score(trial)
        best, path = (score, trial) if less(best, score) else (best, path)
        history.append(best)
        progress(settings.starts + number + 1, total, f"best path {best:.3f}")
    return NextFlight(path, tuple(path for _, path in scored), np.array(history))


def _changed(path: HarmonicPath, step: float, room: Room, rng: np.random.Generator) -> HarmonicPath:
    """Change all axes, or one, in proportion to their velocities, or draw one anew: each as often."""
    axes, kind = np.arange(4)[:, None], rng.integers(3)
    chosen = axes == rng.integers(4) if kind else axes >= 0
    if kind > 1:
        other = room.drawn(rng)
        pairs = ((getattr(other, name), getattr(path, name)) for name in ("order", "cosine", "sine"))
        order, cosine, sine = (np.where(chosen, anew, old) for anew, old in pairs)
        return replace(path, order=order, cosine=cosine, sine=sine)
    speed = np.sqrt(((path.cosine**2 + path.sine**2) * path.order**2).mean(axis=1, keepdims=True))
    cosine, sine = step * rng.standard_normal((2, *path.cosine.shape)) * speed / path.order * chosen
    moved = replace(path, cosine=path.cosine + cosine, sine=path.sine + sine).resting()
    return moved.scaled(np.exp(step * rng.standard_normal(4) * chosen[:, 0]))
