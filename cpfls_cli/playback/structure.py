"""Which blocks a model of a vehicle holds: those that lower the playback error on flights kept aside."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType
from typing import Annotated, NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.blocks import mean_error
from cpfls_cli.effects.registry import CATALOGUE, THRUST_CURVE
from cpfls_cli.evolution.archive import comparable
from cpfls_cli.playback.evaluation import Group, JointNumbers
from cpfls_cli.playback.fit import (
    Fits,
    Fitted,
    FittedNumbers,
    FitWindows,
    Outlook,
    WindowSet,
    WindowSums,
    block_errors,
    fit,
    fit_parts,
    parts_of,
    stays_error,
    windows_of,
)
from cpfls_cli.playback.flight import PlaybackFlight
from cpfls_cli.playback.parameters import (
    INERTIA,
    LEARNED,
    PRODUCTS,
    FreeNumbers,
    Rules,
    blocks_of,
    needs_velocity,
    of_no_command,
)
from cpfls_cli.playback.settings import PlaybackSettings
from cpfls_cli.result import About
from cpfls_cli.rounding import ascending, at_most, less, smallest
from cpfls_cli.vehicle.settings import VehicleSettings

_SEARCH_STEPS, _SEARCH_TOLERANCE = 12, 2e-4
"""Of the fits that structures are compared by: a twentieth of what is worth a name is close enough."""

_STEPS, _TOLERANCE = 60, 3e-6
"""Of the fit that is kept."""

_VISIBLE = 0.02
"""Share of the error of the best that is worth a name: on long flights less is significant."""

_VISIBLE_OF_STAYS = 0.002
"""Most that is asked of a name, as a share of the error of "rate stays"."""

_FITTED = 2
"""Neighbours of a structure that are fitted, the best of those predicted to be no worse, and starts that are grown."""

_HOPEFUL = 2.0
"""Times what may be given up for fewer numbers, up to which a structure that is predicted to be so bad may be fitted:
what is predicted near the bound is right within a tenth or two."""

_PREDICTED = 1e-3
"""Share of the error that a further block is predicted to take away at least."""

_SLOW = "slow_actuation"
_ACTUATION = ("lag", "delay", _SLOW)
"""Blocks between command and rotor, in whose numbers the error is far from quadratic: each leads to a minimum of its
own, and what it gains is not predicted."""


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
        return JointNumbers(FreeNumbers(vehicle, self.blocks, self.rules), groups)


@dataclass(frozen=True)
class Judged:
    """A structure, fitted without each part of the flights and judged on it.

    Attributes
    ----------
    error : float
        Mean over windows of all parts; about 1.1 for rates that stay.
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

    def start(self, structure: Structure) -> dict[str, float]:
        """Give the values that the fit of another structure starts from."""
        free = self.fit.free
        known = free.named(self.fit.values)
        if structure.rules == self.structure.rules:
            return known
        other, again = replace(free.base, rules=structure.rules), structure.rules.of(self.structure.rules)
        for block in LEARNED.keys() & {*self.structure.blocks}:
            learned = np.array([known.pop(number.name) for number in free.base.of_block(block)])
            values = again @ learned.reshape(len(LEARNED[block]), -1, 2)
            known |= dict(zip((number.name for number in other.of_block(block)), values.ravel().tolist(), strict=True))
        return known

    def worse_than(self, other: Judged) -> tuple[float, float]:
        """Compare on the same blocks: mean difference, and its standard error."""
        difference = self.by_block - other.by_block
        return float(difference.mean()), float(mean_error(difference))


BASELINES = ("chosen", "best", "added", "everything", "nothing", "free")
"""What is listed of a choice, by its attributes."""


class TriedStructure(NamedTuple):
    """A structure of the Pareto front, or a baseline, judged on the flights kept aside."""

    name: Annotated[str, About("chosen, best, added, everything, nothing, free, held, or front")]
    blocks: Annotated[tuple[str, ...], About("its blocks", ("block",))]
    error: Annotated[float, About("mean error of the windows kept aside; about 1.1 for rates that stay")]
    worse: Annotated[float, About("error less that of the best")]
    uncertain: Annotated[float, About("standard error of that difference")]
    numbers: Annotated[int, About("free numbers")]
    condition_number: Annotated[float, About("of the numbers in their natural sizes")]


@dataclass(frozen=True)
class Choice:
    """What a search for the structure came to.

    `chosen` has the fewest numbers within one standard error of the best. `added` (named effects added to the stated
    vehicle alone), `everything` and `nothing` are baselines, None where the search was stopped before; `front` is not
    dominated in error, numbers and condition number, by number; `judged` are all structures, and `free` is what was
    chosen before the body was held.
    """

    chosen: Judged
    best: Judged
    added: Judged | None
    everything: Judged | None
    nothing: Judged
    front: tuple[Judged, ...]
    judged: tuple[Judged, ...]
    complete: bool
    free: Judged | None = None

    @property
    def evaluated(self) -> int:
        """How many structures were judged."""
        return len(self.judged)

    @property
    def tried(self) -> tuple[TriedStructure, ...]:
        """The baselines, then the front."""
        baselines = [(name, found) for name in BASELINES if (found := getattr(self, name)) is not None]
        return tuple(
            TriedStructure(name, own.structure.blocks, own.error, worse, uncertain, own.numbers, own.condition_number)
            for name, own in [*baselines, *(("front", own) for own in self.front)]
            for worse, uncertain in [own.worse_than(self.best)]
        )

    def judge(
        self, name: str, own: FittedNumbers, flights: Sequence[PlaybackFlight], settings: PlaybackSettings
    ) -> TriedStructure:
        """Judge numbers that another way found on the same windows."""
        windows = WindowSet(tuple(each for part in parts_of(flights, settings) for each in part))
        errors = windows.errors(own.free, own.values)
        worse = block_errors(errors) - self.best.by_block
        error, uncertain = float(np.concatenate(errors).mean()), float(mean_error(worse))
        return TriedStructure(name, own.free.base.chosen, error, float(worse.mean()), uncertain, len(own.values), 1.0)


Progress = Callable[[Sequence[Judged], int], None]
"""Takes the structures judged so far, and about how many there will be, after each new one; may raise the next."""


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


Kept = Mapping[Structure, Solution]
"""Structures that a stopped search has judged."""

Start = Mapping[str, float]
"""Values by name that a fit starts from."""


@dataclass
class _Bench:
    """Judges structures; remembers all, and starts each fit from the nearest that is known.

    What a stopped search has kept becomes known only when it is asked for, so that the fits after it start from where
    they would have started. `responses` are the blocks whose gain is not predicted: each is a start of its own.
    """

    vehicle: VehicleSettings
    parts: Sequence[Sequence[FitWindows]]
    progress: Progress
    expected: int
    kept: Kept
    responses: tuple[str, ...]
    known: dict[Structure, Judged] = field(default_factory=dict)
    _outlooks: dict[Structure, Outlook] = field(default_factory=dict)

    @cached_property
    def windows(self) -> WindowSet:
        """Windows of all parts."""
        return WindowSet(tuple(each for part in self.parts for each in part))

    @cached_property
    def part(self) -> IntArray:
        """Which part they are of."""
        return np.repeat(np.arange(len(self.parts)), [len(part) for part in self.parts])

    @cached_property
    def stays(self) -> float:
        """Error of rates that stay, over the windows of all parts."""
        errors = [stays_error(each) for each in self.windows.windows]
        return float(np.average(errors, weights=self.windows.counts))

    def judge_from(self, near: Judged, structure: Structure, outlook: Outlook) -> Judged:
        """Fit and judge a structure, from where the fit of another one predicts it, or from that fit."""
        # With its numbers taken out a fit is no better than it was.
        return self.judge(structure, outlook.start(structure.blocks), near.start(structure), enough=near.fit.loss)

    def judge(
        self, structure: Structure, *starts: Start, enough: float = -np.inf, first: VehicleSettings | None = None
    ) -> Judged:
        """Fit and judge a structure, from the best of some starts, or the first whose loss is not above `enough`.

        It is fitted to another vehicle before, if one is given `first`.
        """
        if structure not in self.known:
            kept = self.kept.get(structure)
            fits = self._fits(structure, starts, enough, first) if kept is None else self._rebuilt(structure, kept)
            whole, held, sums = fits
            self._outlooks[structure] = Outlook(sums, self.part)
            errors = [each for _, aside in held for each in aside]
            self.known[structure] = Judged(
                structure,
                float(np.concatenate(errors).mean()),
                block_errors(errors),
                len(whole.values),
                whole.condition_number,
                whole,
                tuple(fitted for fitted, _ in held),
            )
            if kept is None:
                self.progress(tuple(self.known.values()), max(self.expected, len(self.known)))
        return self.known[structure]

    def _fits(
        self, structure: Structure, starts: tuple[Start, ...], enough: float, first: VehicleSettings | None
    ) -> Fits:
        begun = starts or (self._nearest(structure),)
        if first is not None:
            free = structure.free(first)
            found = fit(free, self.windows.windows, begun[0], _SEARCH_STEPS, _SEARCH_TOLERANCE)
            begun = (free.named(found.values),)
        free = structure.free(self.vehicle)
        return fit_parts(free, self.windows, self.part, begun, _SEARCH_STEPS, _SEARCH_TOLERANCE, enough)

    def _rebuilt(self, structure: Structure, kept: Solution) -> Fits:
        free = structure.free(self.vehicle)
        whole, *without = (FittedNumbers(free, *each) for each in zip(kept.values, kept.losses, strict=True))
        sets = (WindowSet(tuple(part)) for part in self.parts)
        held = [(each, own.errors(free, each.values)) for each, own in zip(without, sets, strict=True)]
        sums = WindowSums(free, self.windows, whole.values)
        return Fitted(free, whole.values, whole.loss, kept.hessian), held, sums

    def _nearest(self, structure: Structure) -> Start:
        """Give the values of the known structure that differs in the fewest blocks; the better one of two."""
        asked = set(structure.blocks)

        def away(judged: Judged) -> int:
            other = judged.structure
            rules = structure.learns and other.learns and structure.rules != other.rules
            return len(asked ^ set(other.blocks)) + 2 * int(rules)

        known = ascending(self.known.values(), lambda each: each.error)
        return min(known, key=away).start(structure) if known else {}

    def outlooks(self, near: Judged, others: Sequence[Structure]) -> dict[Structure, Outlook]:
        """Give what predicts the errors of each of some structures from the fit of one."""
        like = [each for each in others if not each.learns or each.rules == near.structure.rules]
        alike = dict.fromkeys(like, self.outlook(near, [block for each in like for block in each.blocks]))
        return {each: alike.get(each) or self._from(near, each) for each in others}

    def outlook(self, near: Judged, blocks: Iterable[str]) -> Outlook:
        """Give what predicts the errors of structures of some blocks and its own, from the fit of one."""
        own = near.structure
        asked = tuple(dict.fromkeys((*own.blocks, *blocks)))
        if not self._outlooks[own].blocks.issuperset(asked):
            self._outlooks[own] = self._from(near, Structure(asked, own.rules))
        return self._outlooks[own]

    def _from(self, near: Judged, structure: Structure) -> Outlook:
        """Give what predicts the errors of a structure from the fit of another one."""
        free = structure.free(self.vehicle)
        absent = {number.name: number.absent for number in free.numbers}
        values = free.values(absent | near.start(structure))
        return Outlook(WindowSums(free, self.windows, values), self.part)


def tried_blocks(
    vehicle: VehicleSettings, flights: Sequence[PlaybackFlight], settings: PlaybackSettings
) -> tuple[str, ...]:
    """List the blocks that the flights can say anything of."""
    moves = all(flight.translates for flight in flights)
    left_out = {*settings.leave_out, *of_no_command(flight.commanded for flight in flights)}
    left_out |= {*LEARNED} if settings.quick else set()
    found = (block for block in blocks_of(vehicle) if block not in left_out)
    return tuple(block for block in found if moves or not needs_velocity(block))


def choose(
    vehicle: VehicleSettings,
    flights: Sequence[PlaybackFlight],
    settings: PlaybackSettings,
    progress: Progress,
    kept: Kept = MappingProxyType({}),
) -> Choice:
    """Search for the structure, from all blocks and from the stated vehicle, by what fits predict of other structures.

    Flights are those that train; `kept` holds the solutions of the same search, stopped before: it goes on to the same
    end.
    """
    blocks = tried_blocks(vehicle, flights, settings)
    # A first answer has one start, from which any response is added as other blocks are.
    responses = () if settings.quick else _ACTUATION
    bench = _Bench(vehicle, parts_of(flights, settings), progress, len(blocks), kept, responses)
    complete, added = True, None
    try:
        added = _grow(bench, blocks)
        _explore(bench, bench.judge(Structure(blocks), added.start(Structure(blocks))), blocks)
        if not settings.quick:
            _settle(bench, blocks)
    except SearchStoppedError:
        complete = False
    known, (judged, best, chosen) = bench.known, _preferred(bench)
    everything, nothing = known.get(Structure(blocks)), known[Structure(())]
    return Choice(chosen, best, added, everything, nothing, _front(judged), tuple(judged), complete)


_HELD = ("thrust_factor", "drag_factor", THRUST_CURVE.name, INERTIA, PRODUCTS)
"""Blocks that make up for a body that is off, if they can."""

_OF_A_LOOP = (_SLOW, *LEARNED)
"""Blocks that explain what an autopilot does against gusts."""


def choose_again(
    held: VehicleSettings, first: Choice, flights: Sequence[PlaybackFlight], settings: PlaybackSettings, stop: Progress
) -> Choice:
    """Search for the structure of a vehicle whose body is held, after a first search that found a wrong one.

    Only named effects are tried, and responses of the rotors that no autopilot makes. `stop` hears of the first search
    alone: it can go on from there.
    """
    settings = replace(settings, leave_out=(*settings.leave_out, *_HELD, *_OF_A_LOOP))
    found = choose(held, flights, settings, lambda *_: stop(first.judged, len(first.judged)))
    complete = first.complete and found.complete
    return replace(found, free=first.chosen, judged=(*first.judged, *found.judged), complete=complete)


def _grow(bench: _Bench, blocks: tuple[str, ...]) -> Judged:
    """Add named effects to the stated vehicle, with each kind of response of its rotors, and go on with the best."""
    named = tuple(block for block in blocks if block not in LEARNED)
    # A body that is free from the beginning is made so heavy that no torque that is not explained yet moves it, and
    # then no explanation is worth anything.
    open_ = bench.vehicle.unknown
    guessed = replace(bench.vehicle, unknown=tuple(name for name in open_ if name != INERTIA))
    kinds = ((), *((block,) for block in bench.responses if block in blocks))
    stated, *others = (bench.judge(Structure(kind), {}, first=guessed if INERTIA in open_ else None) for kind in kinds)
    # A response that gains nothing alone leads to no minimum of its own; it is judged again with the best.
    starts = [stated, *(each for each in others if _visibly_better(bench, each, stated))]
    grown = [_explore(bench, each, named) for each in starts]
    for present in ascending(grown, lambda each: each.error)[:_FITTED]:
        while True:
            grown.append(_explore(bench, present, named))
            if not _visibly_better(bench, grown[-1], present):
                break
            present = grown[-1]
    return smallest(grown, lambda each: each.error)


def _explore(bench: _Bench, centre: Judged, blocks: tuple[str, ...]) -> Judged:
    """Take blocks in or out as long as that is predicted to lower the error, then out as long as it hardly matters.

    The best and the simplest as predicted are fitted; the better of them, or the centre, comes back.
    """
    inside = centre.structure.blocks
    open_ = tuple(block for block in blocks if block in inside or block not in bench.responses)
    outlook = bench.outlook(centre, open_)
    errors: dict[Structure, Array] = {}

    def error(structure: Structure) -> float:
        if structure not in errors:
            errors[structure] = outlook.errors(structure.blocks)
        return float(errors[structure].mean())

    best = centre.structure
    while open_:
        other = smallest([_with(best, block, blocks) for block in open_], error)
        if not less(error(other), (1.0 - _PREDICTED) * error(best), error(best)):
            break
        best = other
    simplest = best
    while simplest.blocks:
        fewer = smallest(_fewer(simplest), error)
        if not _keeps_up(bench, errors[fewer], errors[best], 1.0):
            break
        simplest = fewer
    found = [bench.judge_from(centre, each, outlook) for each in (best, simplest)]
    return smallest([centre, *found], lambda each: each.error)


def _settle(bench: _Bench, blocks: tuple[str, ...]) -> None:
    """Explore what is near the best and the choice, then judge their neighbours, until nothing changes any more."""
    explored: set[Structure] = set()
    while True:
        present = _preferred(bench)[1:]
        pair = list({each.structure: each for each in present}.values())
        new = [each for each in pair if each.structure not in explored]
        for each in new:
            explored.add(each.structure)
            _explore(bench, each, blocks)
        if new and _changed(bench, *present):
            continue
        for each in pair:
            _judge_hopeful(bench, each, _fewer(each.structure), _HOPEFUL)
        _judge_more(bench, present[0], blocks)
        _judge_other(bench, _preferred(bench)[2], blocks)
        if not _changed(bench, *present):
            return


def _changed(bench: _Bench, best: Judged, choice: Judged) -> bool:
    """Tell whether the choice is another one, or the best is visibly better."""
    _, found, chosen = _preferred(bench)
    return chosen.structure != choice.structure or _visibly_better(bench, found, best)


def _visibly_better(bench: _Bench, one: Judged, other: Judged) -> bool:
    return bool(less(one.error + _visible(bench, one.error), other.error, other.error))


def _fewer(structure: Structure) -> list[Structure]:
    """List the structures with one block less."""
    return [_with(structure, block, structure.blocks) for block in structure.blocks]


def _with(structure: Structure, block: str, order: Sequence[str]) -> Structure:
    """Add a block, or take it out where it is in."""
    kept = set(structure.blocks) ^ {block}
    found = Structure(tuple(name for name in order if name in kept), structure.rules)
    return found if found.learns else Structure(found.blocks)


def _judge_more(bench: _Bench, best: Judged, blocks: tuple[str, ...]) -> None:
    """Judge structures with one block more than the best that are hopeful, and any with another response."""
    absent = [block for block in blocks if block not in best.structure.blocks]
    more = {block: _with(best.structure, block, blocks) for block in absent}
    _judge_hopeful(bench, best, [more[block] for block in absent if block not in _ACTUATION], 0.0)
    for block in _ACTUATION:
        if block in more:
            bench.judge(more[block])


def _judge_other(bench: _Bench, choice: Judged, blocks: tuple[str, ...]) -> None:
    """Judge the choice with other rules of what is learned, with an effect in its place, and with a plain response.

    What is learned can stand for several effects; none of them alone may then gain anything jointly with it. A slow
    part that overshoots is what a lag and a delay are together, and neither may gain anything alone.
    """
    structure = choice.structure
    plain = {*_ACTUATION} - {_SLOW}
    if _SLOW in structure.blocks and plain <= {*blocks}:
        kept = ({*structure.blocks} | plain) - {_SLOW}
        bench.judge(structure._replace(blocks=tuple(block for block in blocks if block in kept)))
    absent = [block for block in blocks if needs_velocity(block) and block not in (*structure.blocks, *LEARNED)]
    for learned in (block for block in structure.blocks if block in LEARNED):
        named = [_with(_with(structure, learned, blocks), effect, blocks) for effect in absent]
        _judge_hopeful(bench, choice, named, _HOPEFUL)
    if structure.learns:
        _judge_hopeful(bench, choice, [structure._replace(rules=rules) for rules in REMAINDERS], _HOPEFUL)


def _judge_hopeful(bench: _Bench, near: Judged, others: Sequence[Structure], most: float) -> None:
    """Judge the best few of some structures as predicted from a near one, where they are about as good as the best."""
    best = smallest(bench.known.values(), lambda each: each.error)
    new = [each for each in others if each not in bench.known]
    if not new:
        return
    outlooks = bench.outlooks(near, new)
    errors = {each: outlook.errors(each.blocks) for each, outlook in outlooks.items()}
    for each in ascending(new, lambda each: float(errors[each].mean()))[:_FITTED]:
        if _keeps_up(bench, errors[each], best.by_block, most):
            bench.judge_from(near, each, outlooks[each])


def _keeps_up(bench: _Bench, errors: Array, best: Array, most: float) -> bool:
    """Tell by block whether errors are worse than the best by less than `most` times what fewer numbers may cost."""
    worse, mean = errors - best, float(best.mean())
    return bool(less(worse.mean(), most * max(float(mean_error(worse)), _visible(bench, mean)), mean))


def _preferred(bench: _Bench) -> tuple[list[Judged], Judged, Judged]:
    """Sort what is judged by numbers, and give the best and the choice."""
    judged = sorted(ascending(bench.known.values(), lambda each: each.error), key=lambda each: each.numbers)
    best = smallest(judged, lambda each: each.error)
    return judged, best, _simplest(judged, best, _visible(bench, best.error))


def _visible(bench: _Bench, best: float) -> float:
    """Give how much worse than the best error is not visible."""
    return min(_VISIBLE * best, _VISIBLE_OF_STAYS * bench.stays)


def _simplest(judged: Sequence[Judged], best: Judged, visible: float) -> Judged:
    """Choose the fewest numbers within one standard error of the best, or not visibly worse."""
    for each in judged:
        worse, uncertain = each.worse_than(best)
        if at_most(worse, max(uncertain, visible), best.error):
            return each
    return best


def _front(judged: Sequence[Judged]) -> tuple[Judged, ...]:
    """Keep what nothing else beats in error, numbers and condition number."""
    values = comparable(np.array([(each.error, each.numbers, np.log10(each.condition_number)) for each in judged]))
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

    `start` is the same structure fitted to some of them.
    """
    windows = windows_of(flights, settings.horizon_s, settings.window_interval_s)
    known = start.free.named(start.values)
    return fit(structure.free(vehicle, groups), windows, known, _STEPS, _TOLERANCE), windows


def fitted_rotors(
    body: VehicleSettings, lag_s: float, flights: Sequence[PlaybackFlight], settings: PlaybackSettings
) -> tuple[Fitted, list[FitWindows]]:
    """Fit the torque that is always there, which trims a vehicle, to a body that is held with rotors that only lag."""
    windows = windows_of(flights, settings.horizon_s, settings.window_interval_s)
    blocks = tuple(name for name, each in CATALOGUE.items() if each.trims and name not in settings.leave_out)
    return fit(JointNumbers(FreeNumbers(body, blocks, lag_s=lag_s)), windows, {}, _STEPS, _TOLERANCE), windows
