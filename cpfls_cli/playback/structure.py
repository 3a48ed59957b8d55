"""Which blocks a model of a vehicle holds: those that lower the playback error on flights kept aside."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType
from typing import Annotated, NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.blocks import mean_error
from cpfls_cli.evolution.archive import Evaluation
from cpfls_cli.evolution.engine import evolve
from cpfls_cli.evolution.ranking import comparable
from cpfls_cli.evolution.settings import EvolutionSettings
from cpfls_cli.playback.fit import (
    Fitted,
    FittedNumbers,
    FitWindows,
    fit,
    fit_parts,
    stays_error,
    window_errors,
    windows_of,
)
from cpfls_cli.playback.flight import PlaybackFlight
from cpfls_cli.playback.groups import Group, JointNumbers
from cpfls_cli.playback.judging import Outlook, block_errors, parts_of
from cpfls_cli.playback.parameters import INERTIA, LEARNED, FreeNumbers, blocks_of, needs_velocity
from cpfls_cli.playback.remainder import Airflow
from cpfls_cli.playback.settings import PlaybackSettings
from cpfls_cli.result import About
from cpfls_cli.rounding import ascending, at_most, less, smallest
from cpfls_cli.vehicle.settings import VehicleSettings

_SEARCH_STEPS, _SEARCH_TOLERANCE = 12, 1e-3
"""Of the fits that structures are compared by: a tenth of what is worth a name is close enough."""

_STEPS, _TOLERANCE = 60, 3e-5
"""Of the fit that is kept."""

_VISIBLE = 0.02
"""Share of the error of the best that is worth a name: on long flights less is significant."""

_VISIBLE_OF_STAYS = 0.002
"""Most that is asked of a name, as a share of the error of "rate stays"."""

_FORETOLD = 2
"""Blocks that are added for a trial at least: the best by what is foretold."""

_HOPELESS = 2.0
"""Times what may be given up for fewer numbers, from which on a structure that is foretold to be so bad is not fitted;
what is foretold near the bound is right within a tenth or two."""

_BENT = ("lag", "delay", "slow_actuation")
"""Blocks whose gain is no square of their numbers by far, so that none is foretold."""

_HALF = 2**15
"""Of a gene, from which on a block is in."""


class Rules(NamedTuple):
    """Partition and consequents of a remainder: rules over the circle, order of the harmonics (0: seesaw)."""

    number: int
    order: int

    @property
    def airflow(self) -> Airflow:
        """Equidistant rules."""
        return Airflow(np.linspace(0.0, 1.0, self.number + 1), self.order)


REMAINDERS = (Rules(1, 1), Rules(1, 2), Rules(1, 3), Rules(3, 1), Rules(4, 0))
"""Partitions of the remainder that are tried."""


class Structure(NamedTuple):
    """Blocks of a model, and the rules of its remainder, if that is one of them."""

    blocks: tuple[str, ...]
    rules: Rules = REMAINDERS[0]

    @property
    def learns(self) -> bool:
        """Whether it has a remainder."""
        return not LEARNED.keys().isdisjoint(self.blocks)

    def free(self, vehicle: VehicleSettings, groups: tuple[Group, ...] = ()) -> JointNumbers:
        """List its numbers, and what other configurations have of their own."""
        return JointNumbers(FreeNumbers(vehicle, self.blocks, self.rules.airflow), groups)


@dataclass(frozen=True)
class Judged:
    """A structure, fitted without each part of the flights and judged on it.

    Attributes
    ----------
    error : float
        Mean over windows of all parts; see `window_errors`.
    by_block : array, shape (block,)
        The same by flight, or by pieces of few flights; equal for all structures.
    condition_number : float
        Of the fit to all parts.
    fit : Fitted
        To all parts.
    without : tuple of FittedNumbers
        One a part that was kept aside.
    """

    structure: Structure
    error: float
    by_block: Array
    numbers: int
    condition_number: float
    fit: Fitted
    without: tuple[FittedNumbers, ...]

    def worse_than(self, other: Judged) -> tuple[float, float]:
        """Compare on the same blocks: mean difference, and its standard error."""
        difference = self.by_block - other.by_block
        return float(difference.mean()), float(mean_error(difference))


class TriedStructure(NamedTuple):
    """A structure of the Pareto front, or a baseline, judged on the flights kept aside."""

    name: Annotated[str, About("chosen, best, greedy, everything, nothing, or front")]
    blocks: Annotated[tuple[str, ...], About("its blocks", ("block",))]
    error: Annotated[float, About("mean error of the windows kept aside; about 1.1 for rates that stay")]
    worse: Annotated[float, About("error less that of the best")]
    uncertain: Annotated[float, About("standard error of that difference")]
    numbers: Annotated[int, About("free numbers")]
    condition_number: Annotated[float, About("of the numbers in their natural sizes")]


@dataclass(frozen=True)
class Choice:
    """What a search for the structure came to.

    Attributes
    ----------
    chosen : Judged
        The one with the fewest numbers within one standard error of the best.
    greedy, everything, nothing : Judged
        Baselines: blocks added one by one, all blocks, and the stated vehicle.
    front : tuple of Judged
        Not dominated in error, numbers and condition number, by number.
    evaluated : int
        Structures that were judged.
    complete : bool
        Whether the search came to its end.
    """

    chosen: Judged
    best: Judged
    greedy: Judged
    everything: Judged
    nothing: Judged
    front: tuple[Judged, ...]
    evaluated: int
    complete: bool

    @property
    def tried(self) -> tuple[TriedStructure, ...]:
        """The baselines, then the front."""
        baselines = [(name, getattr(self, name)) for name in ("chosen", "best", "greedy", "everything", "nothing")]
        return tuple(
            TriedStructure(
                name,
                each.structure.blocks,
                each.error,
                each.worse_than(self.best)[0],
                each.worse_than(self.best)[1],
                each.numbers,
                each.condition_number,
            )
            for name, each in [*baselines, *(("front", each) for each in self.front)]
        )


Progress = Callable[[Sequence[Judged], int], None]
"""Told the structures judged so far, and about how many there will be, after each new one; may raise the next."""


class SearchStoppedError(Exception):
    """Somebody asks the search to stop; what it has found so far is taken."""


class Solution(NamedTuple):
    """What the fits of a structure came to: to all parts first, then without each.

    Attributes
    ----------
    values : tuple of array, shape (number,)
    losses : tuple of float
    hessian : array, shape (number, number)
        Of the first.
    """

    values: tuple[Array, ...]
    losses: tuple[float, ...]
    hessian: Array


Objectives = tuple[float, float, float]
"""Error, numbers, and logarithm of the condition number."""

Kept = Mapping[Structure, Solution]
"""Structures that a stopped search has judged."""


@dataclass
class _Bench:
    """Judges structures; remembers all, and starts each fit from the nearest that is known.

    What a stopped search has kept becomes known only when it is asked for, so that the fits after it start from where
    they would have started.
    """

    vehicle: VehicleSettings
    parts: Sequence[Sequence[FitWindows]]
    progress: Progress
    expected: int
    kept: Kept
    known: dict[Structure, Judged] = field(default_factory=dict)
    foretold: dict[Structure, Objectives] = field(default_factory=dict)

    @cached_property
    def stays(self) -> float:
        """Error of rates that stay, over the windows of all parts."""
        windows = [each for part in self.parts for each in part]
        counts = [len(each.starts) for each in windows]
        return float(np.average([stays_error(each) for each in windows], weights=counts))

    def judge(self, structure: Structure, first: VehicleSettings | None = None) -> Judged:
        """Fit and judge a structure; fitted to another vehicle first, where one is given."""
        if structure not in self.known:
            kept = self.kept.get(structure)
            fits = self._fits(structure, first) if kept is None else _rebuilt(structure.free(self.vehicle), kept)
            self.known[structure] = self._judged(structure, *fits)
            if kept is None:
                self.progress(tuple(self.known.values()), max(self.expected, len(self.known)))
        return self.known[structure]

    def _fits(self, structure: Structure, first: VehicleSettings | None) -> tuple[Fitted, tuple[FittedNumbers, ...]]:
        known = self._known(structure)
        if first is not None:
            free = structure.free(first)
            windows = [each for part in self.parts for each in part]
            known |= free.named(fit(free, windows, known, _SEARCH_STEPS, _SEARCH_TOLERANCE).values)
        return fit_parts(structure.free(self.vehicle), self.parts, known, _SEARCH_STEPS, _SEARCH_TOLERANCE)

    def nearest(self, structure: Structure) -> Judged | None:
        """Find the known structure that differs in the fewest blocks; the better one of two."""
        asked = set(structure.blocks)

        def away(judged: Judged) -> int:
            other = judged.structure
            rules = structure.learns and other.learns and structure.rules != other.rules
            return len(asked ^ set(other.blocks)) + 2 * int(rules)

        known = ascending(self.known.values(), lambda each: each.error)
        return min(known, key=away, default=None)

    def _known(self, structure: Structure) -> dict[str, float]:
        """Give the values that a fit starts from."""
        near = self.nearest(structure)
        if near is None:
            return {}
        known = near.fit.free.named(near.fit.values)
        if near.structure.rules != structure.rules:
            known = {name: value for name, value in known.items() if name.split(".")[0] not in LEARNED}
        return known

    def objectives(self, structure: Structure) -> Objectives:
        """Give those of the fit, or as they are foretold of what is not fitted."""
        known = self.known.get(structure)
        return self.foretold[structure] if known is None else _objectives(known)

    def outlook(self, near: Judged, asked: Sequence[Structure]) -> Outlook:
        """Evaluate what foretells the errors of structures, as `Judged.by_block`, from the fit of another one."""
        both = (near.structure, *asked)
        blocks = tuple(dict.fromkeys(block for each in both for block in each.blocks))
        rules = next((each.rules for each in both if each.learns), near.structure.rules)
        union, known = Structure(blocks, rules).free(self.vehicle), near.fit.free.named(near.fit.values)
        values = union.values({number.name: number.absent for number in union.numbers} | known)
        return Outlook.of(union, values, self.parts)

    def _judged(self, structure: Structure, whole: Fitted, without: tuple[FittedNumbers, ...]) -> Judged:
        pairs = zip(without, self.parts, strict=True)
        errors = [each for fitted, kept in pairs for each in window_errors(fitted, kept)]
        by_block, joined = block_errors(errors), np.concatenate(errors)
        condition = whole.condition_number
        return Judged(structure, float(joined.mean()), by_block, len(whole.values), condition, whole, without)


def _rebuilt(free: JointNumbers, kept: Solution) -> tuple[Fitted, tuple[FittedNumbers, ...]]:
    whole, *without = (FittedNumbers(free, *each) for each in zip(kept.values, kept.losses, strict=True))
    return Fitted(free, whole.values, whole.loss, kept.hessian), tuple(without)


def tried_blocks(
    vehicle: VehicleSettings, flights: Sequence[PlaybackFlight], settings: PlaybackSettings
) -> tuple[str, ...]:
    """List the blocks that the flights can say anything of."""
    moves = all(flight.translates for flight in flights)
    found = (block for block in blocks_of(vehicle) if block not in settings.leave_out)
    return tuple(block for block in found if moves or not needs_velocity(block))


def choose(
    vehicle: VehicleSettings,
    flights: Sequence[PlaybackFlight],
    settings: PlaybackSettings,
    rng: np.random.Generator,
    progress: Progress,
    kept: Kept = MappingProxyType({}),
) -> Choice:
    """Search for the structure: all blocks, fewer and fewer of them, greedy addition, then the genetic algorithm.

    Parameters
    ----------
    vehicle : VehicleSettings
        As stated.
    flights : sequence of PlaybackFlight
        Training flights alone.
    kept : mapping of Structure to sequence of Solution
        Of the same search, stopped before; it goes on to the same end.

    Raises
    ------
    SearchStoppedError
        If it is stopped before all blocks were judged.
    """
    blocks = tried_blocks(vehicle, flights, settings)
    parts = parts_of(flights, settings)
    expected = 3 * len(blocks) + settings.population * (1 + settings.generations) // 4
    bench = _Bench(vehicle, parts, progress, expected, kept)
    nothing = bench.judge(Structure(()))
    # All blocks on the stated body first, or on a guessed one: a body that is free from the beginning is made so heavy
    # that no torque that is not explained yet moves it, and then no explanation is worth anything.
    if INERTIA in blocks:
        bench.judge(Structure(tuple(block for block in blocks if block != INERTIA)))
    guessed = replace(vehicle, unknown=tuple(name for name in vehicle.unknown if name != INERTIA))
    everything = bench.judge(Structure(blocks), guessed if INERTIA in vehicle.unknown else None)
    path, complete = [nothing], True
    try:
        shrunk = _shrunk(bench, everything) if len(blocks) > 1 else []
        path.extend(_greedy(bench, blocks, nothing))
        near = _neighbours(bench, smallest(bench.known.values(), lambda each: each.error))
        _evolve(bench, blocks, [*(each.structure for each in path), *shrunk, *near], settings, rng)
        _refine(bench, blocks)
    except SearchStoppedError:
        complete = False
    judged, best, chosen = _preferred(bench)
    return Choice(chosen, best, path[-1], everything, nothing, _front(judged), len(judged), complete)


def _greedy(bench: _Bench, blocks: tuple[str, ...], start: Judged) -> Iterator[Judged]:
    """Add the block that lowers the error most, until none lowers it by more than its standard error.

    Fitted are those of which most is foretold. Of others nothing can be, and what such a block gained before bounds
    what it may gain now, near enough; all of them are tried before it ends, because some gain only beside others.
    """
    present, gained, all_tried = start, dict.fromkeys(_BENT, np.inf), False
    yield present
    while promise := _promised(bench, present, gained, blocks):
        best, foretold = None, 0
        for block, gain in ascending(promise.items(), lambda each: -each[1]):
            if best and foretold >= _FORETOLD and less(gain, present.error - best.error, present.error):
                break
            foretold += block not in _BENT
            tried = bench.judge(_with(present.structure, block, blocks))
            gained[block] = present.error - tried.error
            if best is None or less(tried.error, best.error):
                best = tried
        assert best is not None
        better, uncertain = present.worse_than(best)
        if not at_most(better, uncertain, present.error):
            present, all_tried = best, False
            yield present
        elif all_tried:
            return
        else:
            gained, all_tried = dict.fromkeys(_BENT, np.inf), True


def _promised(bench: _Bench, present: Judged, gained: Mapping[str, float], blocks: tuple[str, ...]) -> dict[str, float]:
    """Say by how much each block that is not in lowers the error: as foretold, or what it gained where that is bent."""
    absent = {
        block: _with(present.structure, block, blocks) for block in blocks if block not in present.structure.blocks
    }
    asked = {block: each for block, each in absent.items() if block not in _BENT}
    outlook = bench.outlook(present, list(asked.values()))
    before = outlook.errors(present.structure.blocks).mean()
    gains = {block: float(before - outlook.errors(each.blocks).mean()) for block, each in asked.items()}
    return {block: gains.get(block, gained.get(block, np.inf)) for block in absent}


def _shrunk(bench: _Bench, everything: Judged) -> list[Structure]:
    """List structures without the block that is foretold to be missed least, one after another, and judge two of them.

    These are the best as foretold, and the simplest that is hardly worse.
    """
    structure, outlook = everything.structure, bench.outlook(everything, [])
    while len(structure.blocks) > 1:
        structure = smallest(_fewer(structure), lambda each: outlook.error(each.blocks))
        bench.foretold[structure] = outlook.objectives(structure.blocks)
    path = list(bench.foretold)
    errors = {each: outlook.errors(each.blocks) for each in path}
    best = smallest(path, lambda each: bench.objectives(each)[0])
    simplest = [each for each in path if _keeps_up(bench, errors[each], errors[best], 1.0)]
    for each in (best, *simplest[-1:]):
        bench.judge(each)
    return path


def _fewer(structure: Structure) -> list[Structure]:
    """List the structures with one block less."""
    return [_with(structure, block, structure.blocks) for block in structure.blocks]


def _with(structure: Structure, block: str, order: Sequence[str]) -> Structure:
    """Add a block, or take it out where it is in."""
    kept = set(structure.blocks) ^ {block}
    return Structure(tuple(name for name in order if name in kept), structure.rules)


def _neighbours(bench: _Bench, judged: Judged) -> list[Structure]:
    """List the structures with one block less, or with other rules of what is learned, and judge the hopeful."""
    structure = judged.structure
    fewer = _fewer(structure)
    other = [structure._replace(rules=rules) for rules in REMAINDERS] if structure.learns else []
    _judge_hopeful(bench, judged, fewer)
    for each in other:
        bench.judge(each)
    return [*fewer, *other]


def _judge_hopeful(bench: _Bench, near: Judged, others: Sequence[Structure]) -> None:
    """Judge those of some structures that are not foretold to be hopeless, from a near one that is judged."""
    best = smallest(bench.known.values(), lambda each: each.error)
    new = [each for each in others if each not in bench.known]
    if not new:
        return
    outlook = bench.outlook(near, new)
    for each in new:
        if _keeps_up(bench, outlook.errors(each.blocks), best.by_block, _HOPELESS):
            bench.judge(each)
        else:
            bench.foretold[each] = outlook.objectives(each.blocks)


def _keeps_up(bench: _Bench, errors: Array, best: Array, most: float) -> bool:
    """Tell by block whether errors are worse than the best by less than `most` times what fewer numbers may cost."""
    worse, mean = errors - best, float(best.mean())
    return bool(less(worse.mean(), most * max(float(mean_error(worse)), _visible(bench, mean)), mean))


def _named_instead(bench: _Bench, judged: Judged, blocks: tuple[str, ...]) -> None:
    """Judge the structures with an effect in the place of what is learned.

    What is learned can stand for several effects; none of them alone may then gain anything beside it.
    """
    structure = judged.structure
    absent = [block for block in blocks if needs_velocity(block) and block not in (*structure.blocks, *LEARNED)]
    for learned in (block for block in structure.blocks if block in LEARNED):
        named = [_with(_with(structure, learned, blocks), effect, blocks) for effect in absent]
        _judge_hopeful(bench, judged, named)


def _preferred(bench: _Bench) -> tuple[list[Judged], Judged, Judged]:
    """Sort what is judged by numbers, and give the best and the choice."""
    judged = sorted(ascending(bench.known.values(), lambda each: each.error), key=lambda each: each.numbers)
    best = smallest(judged, lambda each: each.error)
    return judged, best, _simplest(judged, best, _visible(bench, best.error))


def _visible(bench: _Bench, best: float) -> float:
    """Give how much worse than the best error is not visible."""
    return min(_VISIBLE * best, _VISIBLE_OF_STAYS * bench.stays)


def _refine(bench: _Bench, blocks: tuple[str, ...]) -> None:
    """Judge the neighbours of the best and of the choice, until no block is left that nothing speaks for.

    What is learned is then held against names, which takes many fits, for the choice alone.
    """
    asked: set[Structure] = set()
    held: set[Structure] = set()
    while True:
        new = [each for each in _preferred(bench)[1:] if each.structure not in asked]
        if not new:
            choice = _preferred(bench)[2]
            if choice.structure in held:
                return
            held.add(choice.structure)
            _named_instead(bench, choice, blocks)
            continue
        asked |= {each.structure for each in new}
        for each in new:
            _neighbours(bench, each)


def _evolve(
    bench: _Bench,
    blocks: tuple[str, ...],
    first: Sequence[Structure],
    settings: PlaybackSettings,
    rng: np.random.Generator,
) -> None:
    """Breed structures: a gene for each block, in its upper half for one that is in, and one for the remainder."""
    evolution = EvolutionSettings(
        population=settings.population,
        generations=settings.generations,
        recombination="single-point",
        mutated_bits=0.02,
    )

    def evaluate(genes: IntArray) -> Evaluation:
        return Evaluation(genes, np.array([_bred(bench, _decoded(chromosome, blocks)) for chromosome in genes]))

    ranked = ascending(dict.fromkeys(first), lambda each: bench.objectives(each)[0])
    initial = np.array([_encoded(each, blocks) for each in ranked[: settings.population]], dtype=np.int64)
    for _ in evolve(evaluate, len(blocks) + 1, evolution, rng, initial):
        pass


def _bred(bench: _Bench, structure: Structure) -> Objectives:
    """Give the objectives of a structure: of its fit, or as they are foretold where they are hopeless."""
    near = bench.nearest(structure)
    assert near is not None
    bent = not set(_BENT).isdisjoint(set(structure.blocks) - set(near.structure.blocks))
    if bent or (structure.learns and near.structure.learns and structure.rules != near.structure.rules):
        bench.judge(structure)
    else:
        _judge_hopeful(bench, near, [structure])
    return bench.objectives(structure)


def _objectives(judged: Judged) -> Objectives:
    return judged.error, float(judged.numbers), float(np.log10(judged.condition_number))


def _decoded(genes: IntArray, blocks: tuple[str, ...]) -> Structure:
    chosen = tuple(block for block, gene in zip(blocks, genes, strict=False) if gene >= _HALF)
    found = Structure(chosen, REMAINDERS[int(genes[-1]) * len(REMAINDERS) // (2 * _HALF)])
    return found if found.learns else Structure(chosen)


def _encoded(structure: Structure, blocks: tuple[str, ...]) -> list[int]:
    middle = [_HALF + _HALF // 2 if block in structure.blocks else _HALF // 2 for block in blocks]
    place = REMAINDERS.index(structure.rules)
    return [*middle, (2 * place + 1) * _HALF // len(REMAINDERS)]


def _simplest(judged: Sequence[Judged], best: Judged, visible: float) -> Judged:
    """Choose the fewest numbers within one standard error of the best, or not visibly worse."""
    for each in judged:
        worse, uncertain = each.worse_than(best)
        if at_most(worse, max(uncertain, visible), best.error):
            return each
    return best


def _front(judged: Sequence[Judged]) -> tuple[Judged, ...]:
    """Keep what nothing else beats in error, numbers and condition number."""
    values = comparable(np.array([_objectives(each) for each in judged]))
    beaten = [np.any(np.all(values <= row, axis=1) & np.any(values < row, axis=1)) for row in values]
    return tuple(each for each, lost in zip(judged, beaten, strict=True) if not lost)


def fitted_to_all(
    structure: Structure,
    vehicle: VehicleSettings,
    flights: Sequence[PlaybackFlight],
    settings: PlaybackSettings,
    start: Fitted,
    groups: tuple[Group, ...] = (),
) -> tuple[Fitted, list[FitWindows]]:
    """Fit a structure to all training flights, those of other configurations as well, with windows close together.

    Parameters
    ----------
    vehicle : VehicleSettings
        As stated.
    start : Fitted
        The same structure on some of them.
    groups : tuple of Group
        Other configurations.
    """
    windows = windows_of(flights, settings.horizon_s, settings.window_interval_s)
    known = start.free.named(start.values)
    return fit(structure.free(vehicle, groups), windows, known, _STEPS, _TOLERANCE), windows
