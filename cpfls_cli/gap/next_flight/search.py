"""Search for the path along which rivals differ most, within the room that a vehicle has."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.effects.signals import Signals
from cpfls_cli.gap.balance.balance_system import system
from cpfls_cli.gap.balance.weak_flight import WeakFlight
from cpfls_cli.gap.naming.ranking import block_index
from cpfls_cli.gap.next_flight.logged import Logging, planned_signals
from cpfls_cli.gap.next_flight.room import HarmonicPath, Room
from cpfls_cli.gap.next_flight.separation import DRAWS, FEW_DRAWS, Answer, Evidence, Question, answered
from cpfls_cli.rounding import ascending, less


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
