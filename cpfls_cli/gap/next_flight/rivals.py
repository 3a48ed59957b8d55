"""The questions that a diagnosis, or a user, asks of the next flight, and how well it separates rivals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import permutations

import numpy as np
from scipy.optimize import brentq

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.effects.effect import Effect
from cpfls_cli.effects.registry import acting
from cpfls_cli.errors import InputError
from cpfls_cli.gap.balance.balance_system import System, is_free, system
from cpfls_cli.gap.balance.refine import fit, least_squares, refined
from cpfls_cli.gap.balance.weak_flight import Candidate, WeakFlight, nuisance
from cpfls_cli.gap.naming.open_questions import usual_size
from cpfls_cli.gap.naming.ranking import block_index, candidates_of, known_before, likely, log_odds
from cpfls_cli.gap.naming.results import Alternative, NamedEffect
from cpfls_cli.gap.settings import OFF, RARE, GapSettings
from cpfls_cli.rounding import ROUNDING, smallest
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.weak_form.windows import Windows

DRAWS, FEW_DRAWS = 200, 8
"""Draws of the noise for a probability to some per cent, and for comparing flights by the same draws."""


@dataclass(frozen=True)
class SizedEffect:
    """An effect with a value for each of its numbers."""

    candidate: Candidate
    linear: Array  # Shape (coefficient,): 1 where everything is in the shape.


@dataclass(frozen=True)
class Question:
    """Whether an effect would be separated from a rival, if it is the true one."""

    true: SizedEffect
    rival: Effect | None  # None: whether the effect shows at all, beyond the vehicle's own numbers.
    besides: tuple[SizedEffect, ...] = ()  # Effects that are there whichever is true; their coefficients are free.


@dataclass(frozen=True)
class Evidence:
    """What flights would say on a question, by the products of all columns that it takes over each block."""

    # Shape (block, column, column): in squared floors: the true effect, then base columns, then the rival at each point
    # of its grid.
    gram: Array
    base: IntArray  # Places of the columns that are free whichever is true.
    # Each : places of the rival's, one for each point of its grid; one empty array where there is no rival.
    rivals: tuple[IntArray, ...]
    unit: bool  # Whether the rival has the coefficient 1.
    off: float  # What formulas are off by, see `formulas_off`.
    noise: float = 1.0  # Variance of a sum of noise over windows, over that of windows that share none.
    known: int = 0  # Blocks, the first ones, that are flown already: their noise is what it is, and not drawn.

    @classmethod
    def none(cls, blocks: int) -> Evidence:
        """Make blocks that say nothing."""
        nowhere = np.zeros(0, dtype=int)
        return cls(np.zeros((blocks, 1, 1)), nowhere, (nowhere,), unit=False, off=0.0)

    def after(self, known: Evidence) -> Evidence:
        """Put blocks of other flights before these."""
        shape = (len(known.gram), *self.gram.shape[1:])
        gram = np.concatenate([np.broadcast_to(known.gram, shape), self.gram])
        return replace(self, gram=gram, known=len(known.gram))

    @cached_property
    def left(self) -> Array:
        """Least residual of the true effect under the rival, shape (block,), squared floors."""
        return min((self._left(rival) for rival in self.rivals), key=lambda left: float(left.sum()))

    @cached_property
    def off_by(self) -> float:
        """What formulas are off by, in squared floors."""
        return float(self.off * self._left(np.zeros(0, dtype=int)).sum())

    def _left(self, rival: IntArray) -> Array:
        total, weight = self.gram.sum(axis=0), np.zeros(self.gram.shape[1])
        weight[0] = 1.0
        free = self.base
        if self.unit and len(rival):
            weight[rival] = -1.0
        else:
            free = np.concatenate([free, rival])
        scale = np.sqrt(np.diag(total)[free])
        scale = np.where(scale > 0, scale, 1.0)
        values, vectors = np.linalg.eigh(total[np.ix_(free, free)] / np.outer(scale, scale))
        kept = values > 1e-10 * max(values.max(initial=0.0), 1e-300)
        along = (vectors.T @ ((total[free] @ weight) / scale))[kept] / values[kept]
        weight[free] -= vectors[:, kept] @ along / scale
        return np.asarray(np.maximum(np.einsum("i,bij,j->b", weight, self.gram, weight), 0.0))

    def odds(self, draw: Array, size: float = 1.0) -> Array:
        """Compute the logarithm of the rival's predictive density less that of the true effect, shape (block,).

        `draw`, shape (block,): of the noise in what the two differ by, in standard deviations.
        `size`: of the true effect, as a share of its own.
        """
        error = np.where(np.arange(len(self.left)) < self.known, 0.0, 2 * size * np.sqrt(self.noise * self.left))
        return log_odds(size**2 * self.left + error * draw, size**2 * self.off_by)


def formulas_off(hypothesis: System, floor: Array) -> float:
    """Estimate what formulas are off by, from the residual above the floor of the flights that effects were named in.

    `floor`: shape (6,), N m and N; Result: mean square, as a share of that of what the effects explain.
    """
    plain = system(hypothesis.flights)
    before, left = (float(((each.residual_at(fit(each, floor)) / floor) ** 2).sum()) for each in (plain, hypothesis))
    return float(np.clip((left - hypothesis.known.sum()) / max(before - left, ROUNDING), 0.0, OFF**2))


def gathered(
    question: Question, flights: Sequence[WeakFlight], floor: Array, settings: GapSettings, off: float = 0.0
) -> Evidence:
    """Gather what flights along known motions would say on a question.

    In gusts by innovations, as a diagnosis rejects rivals: what of a gust was there before says nothing.

    `flights`: their residuals are not used; `floor`: shape (6,), N m and N; `off`: see `formulas_off`.
    """
    balance, noise = system(flights), shared_noise(flights[0].windows)
    if flights[0].lasting.size:
        # Innovations share no noise, which is less than what is allowed for.
        known = balance.known.any(axis=0)
        floor, noise = floor * np.sqrt(balance.most_noise), 1 / float(balance.most_noise[known].min())
        balance = system([each.innovations for each in flights])
    free = [nuisance(), *(each.candidate for each in question.besides if is_free(each.candidate))]
    tried = [] if question.rival is None or question.rival.kind == "parameter" else candidates_of([question.rival])
    true = (balance.columns(question.true.candidate) @ question.true.linear)[..., None]
    parts = [true, *(balance.columns(each) for each in (*free, *tried))]
    ends = np.cumsum([part.shape[2] for part in parts])
    places = [np.arange(end - part.shape[2], end) for part, end in zip(parts, ends, strict=True)]
    matrix = np.concatenate(parts, axis=2) / floor[:, None]
    block = block_index(balance, settings)
    parts = [matrix[block == number].reshape(-1, int(ends[-1])) for number in range(block.max() + 1)]
    return Evidence(
        np.array([part.T @ part for part in parts]),
        np.concatenate(places[1 : 1 + len(free)]),
        tuple(places[1 + len(free) :]) or (np.zeros(0, dtype=int),),
        bool(tried) and tried[0].effect.unit_coefficient,
        off,
        noise,
    )


@dataclass(frozen=True)
class Answer:
    """What flights would say on a question."""

    evidence: Evidence
    # `own`, `likely`: How likely the true effect and the rival are expected to be after them, among all rivals of the
    # true one.
    own: float
    likely: float
    sure: float  # Probability that the rival is then so unlikely against the true effect that it is no rival.

    @property
    def settled(self) -> bool:
        """Whether the rival is expected to be no rival."""
        return self.likely < RARE * self.own

    @cached_property
    def least_size(self) -> float:
        """Share of the effect's size from which on it is settled, if linear in it; nan where no size is."""

        def beaten(size: float) -> float:
            own, other = _tables([self.evidence], FEW_DRAWS, size).mean(axis=0)
            return float(np.log(RARE) - np.log(other / own))

        largest = 1 / np.sqrt(ROUNDING)
        return float(brentq(beaten, 0.0, largest)) if beaten(largest) > 0 else np.nan


def answered(evidence: Sequence[Evidence], draws: int = DRAWS) -> list[Answer]:
    """Predict the table of how likely each set of effects is where one effect is true, over draws of the noise.

    `evidence`: on each of its rivals, of the same flights.
    """
    tables = _tables(evidence, draws)
    own, *others = tables.mean(axis=0).tolist()
    # What all draws say is not certain.
    sure = (0.5 + (tables[:, 1:] < RARE * tables[:, :1]).sum(axis=0)) / (1 + draws)
    return [Answer(*each) for each in zip(evidence, [own] * len(others), others, sure.tolist(), strict=True)]


def _tables(evidence: Sequence[Evidence], draws: int, size: float = 1.0) -> Array:
    """Draw how likely the true effect and each rival will be, shape (draw, 1 + rival); the same draws for all paths."""
    rng, blocks = np.random.default_rng(0), len(evidence[0].gram)
    drawn = rng.standard_normal((draws, len(evidence), blocks))
    return np.array([likely([e.odds(d, size) for e, d in zip(evidence, one, strict=True)]) for one in drawn])


def shared_noise(windows: Windows) -> float:
    """Compute the variance of a sum over windows, over that of windows without common samples."""
    weight, total = windows.weight, 1.0
    for shift in range(windows.hop, len(weight), windows.hop):
        total += 2 * float(weight[shift:] @ weight[:-shift]) / float(weight @ weight)
    return total


def require_visible(effects: Sequence[Effect], source: str, vehicle: VehicleSettings) -> None:
    """Refuse effects that no torque and no force shows.

    `source`: file or key that named them, for the message. Raises InputError: it names the effect and what shows it.
    """
    for effect in effects:
        if effect.columns is None:
            raise InputError(
                f"{source}: {effect.name} is a sensor fault, found from the sensors alone and not by a planned "
                f"flight; what shows it: {effect.excitation}"
            )
        if "rotor_radius" in effect.needs and any(rotor.radius_m is None for rotor in vehicle.rotors):
            raise InputError(
                f"{source}: {effect.name} needs vehicle.rotors.radius_m of every rotor; add it to the config"
            )
    actuators = [effect.name for effect in effects if "command" in effect.needs]
    measured = [effect.name for effect in effects if "measured_rotor_speed" in effect.needs]
    if actuators and measured:
        raise InputError(
            f"{source}: {actuators[0]} shows if commands are logged instead of rotor speeds, {measured[0]} if "
            "rotor speeds are measured; no single flight separates them. Log measured rotor speeds: they rule out "
            f"{actuators[0]}"
        )


def questions_between(effects: Sequence[Effect], vehicle: VehicleSettings) -> tuple[Question, ...]:
    """Ask for every two effects, either way, whether they would be separated at a usual size.

    One effect alone asks whether it shows at all.
    """
    sized = [usual(effect, vehicle) for effect in effects]
    alone = (Question(sized[0], None),) if len(sized) == 1 else ()
    asked = alone or (Question(true, rival.candidate.effect) for true, rival in permutations(sized, 2))
    return tuple(question for question in asked if _is_open(question))


def _is_open(question: Question) -> bool:
    """Check whether there is a question: an effect is also what holds it as a special case."""
    effect, rival = question.true.candidate.effect, question.rival
    return effect.kind != "parameter" and (rival is None or effect.name not in rival.holds)


def usual(effect: Effect, vehicle: VehicleSettings) -> SizedEffect:
    """Give an effect a size that is large but not unheard of."""
    candidate = Candidate(effect, {shape.name: shape.grid[len(shape.grid) // 2] for shape in effect.shapes})
    numbers = np.ones(len(effect.coefficients) or 1)
    width = len(numbers if effect.physical is None else effect.physical.linear(numbers))
    return SizedEffect(candidate, usual_size(effect, vehicle, width))


def open_questions(
    named: Sequence[NamedEffect],
    rivals: Sequence[Alternative],
    unseen: Sequence[Effect],
    flights: Sequence[WeakFlight],
    floor: Array,
    settings: GapSettings,
) -> tuple[Question, ...]:
    """Ask what a diagnosis left open: which of two rivals it is, and what its flights could not show.

    `unseen`: to show at a usual size; `flights`: of the diagnosis, repaired; `floor`: shape (6,), N m and N.
    """
    sized = {
        each.name: SizedEffect(each.candidate, each.linear if len(each.linear) else np.ones(1))
        for each in named
        if each.candidate is not None
    }
    questions, others, vehicle = [], [], flights[0].signals.vehicle
    for rival in rivals:
        one = sized[rival.instead_of]
        besides = tuple(each for name, each in sized.items() if name not in (rival.instead_of, rival.name))
        other = fitted_rival(flights, [each.candidate for each in besides], acting(rival.name, vehicle), floor)
        pair = (one, other.candidate.effect), (other, one.candidate.effect)
        questions += [Question(true, effect, besides) for true, effect in pair]
        others += [Question(true, each, besides) for true, known in pair for each in _alike(true, known, flights)]
    questions += [each for each in others if not _is_answered(each, flights, floor, settings)]
    once = {(each.true.candidate.effect.name, each.rival and each.rival.name): each for each in questions}
    asked = tuple(question for question in once.values() if _is_open(question))
    return (*asked, *(Question(usual(effect, vehicle), None) for effect in unseen))


def _alike(true: SizedEffect, rival: Effect, flights: Sequence[WeakFlight]) -> list[Effect]:
    """List what else looks like an effect by the catalogue, and must not take the place of the rival."""
    vehicle = flights[0].signals.vehicle
    others = (acting(name, vehicle) for name in true.candidate.effect.rivals if name != rival.name)
    known = (each for each in others if each.columns is not None and each.kind == true.candidate.effect.kind)
    return [each for each in known if not all(each.missing(flight.signals) for flight in flights)]


def _is_answered(question: Question, flights: Sequence[WeakFlight], floor: Array, settings: GapSettings) -> bool:
    """Check whether the flights that are there answer a question."""
    if all(question.true.candidate.effect.missing(flight.signals) for flight in flights):
        return False
    return answered([gathered(question, flights, floor, settings)])[0].settled


def fitted_effects(flights: Sequence[WeakFlight], chosen: Sequence[Candidate], floor: Array) -> tuple[SizedEffect, ...]:
    """Fit effects together on flights; what the flights leave open stays small against its bounds.

    `chosen`: their shapes are kept; `floor`: shape (6,), N m and N.
    """
    balance = system(flights, chosen)
    matrix = (balance.base / floor[:, None]).reshape(-1, balance.base.shape[2])
    prior = known_before(balance)[: balance.base.shape[2]]
    # Rows of the prior below those of the flights.
    matrix = np.concatenate([matrix, np.diag(np.sqrt(prior))])
    linear = least_squares(matrix, np.concatenate([(balance.residual / floor).reshape(-1), np.zeros(len(prior))]))
    by_name = {each.effect.name: linear[place] for each, place in balance.places}
    return tuple(SizedEffect(each, by_name.get(each.effect.name, np.ones(1))) for each in chosen)


def fitted_rival(
    flights: Sequence[WeakFlight], besides: Sequence[Candidate], rival: Effect, floor: Array
) -> SizedEffect:
    """Fit a rival in place of a named effect, at its best shape; at a usual size where the flights lack its signals.

    `besides`: the other named effects; `floor`: shape (6,), N m and N.
    """
    if all(rival.missing(flight.signals) for flight in flights):
        return usual(rival, flights[0].signals.vehicle)

    def error(candidate: Candidate) -> float:
        balance = system(flights, [*besides, candidate])
        return float(((balance.residual_at(fit(balance, floor)) / floor) ** 2).sum())

    best = smallest(candidates_of([rival]), error)
    return fitted_effects(flights, refined(flights, [*besides, best], floor).chosen, floor)[-1]


def physical_values(sized: SizedEffect) -> dict[str, float]:
    """Give the physical coefficients and shapes of an effect by name; those that are open are 0."""
    effect, shape = sized.candidate
    if effect.unit_coefficient:
        return dict(shape)
    physical = np.nan_to_num(sized.linear if effect.physical is None else effect.physical.of(sized.linear))
    names = (coefficient.name for coefficient in effect.coefficients)
    return {**dict(zip(names, physical.tolist(), strict=False)), **shape}
