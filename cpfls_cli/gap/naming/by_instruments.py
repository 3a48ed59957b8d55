"""Numbers of a hypothesis in gusts, by what was asked: a loop that answers gusts does not mix into them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import chain, product
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.blocks import jackknife_error
from cpfls_cli.effects.catalogue.parameter_error import NUMBERS
from cpfls_cli.effects.effect import Effect
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.gap.balance.balance_system import system
from cpfls_cli.gap.balance.refine import fit_within_bounds, shape_columns
from cpfls_cli.gap.balance.weak_flight import Candidate, dense
from cpfls_cli.gap.naming.estimate import Estimates, NamedFit, estimates_of, nothing_by_size, places_of
from cpfls_cli.gap.naming.ranking import known_before
from cpfls_cli.gap.naming.results import Estimate
from cpfls_cli.gap.residual.air import predicted_rows
from cpfls_cli.playback.constants import ENOUGH_BLOCKS, STRONG
from cpfls_cli.playback.instruments import Instruments
from cpfls_cli.playback.newness import PER_WINDOW, news


class _Source(NamedTuple):
    """What a source of knowledge tells of numbers.

    `products`, shape (block, number + 1, number + 1): of what is known of each number, and of what is left, with what
    they move.
    `numbers`, shape (number,): those that are free, that it tells, and that no source before it does.
    """

    products: Array
    numbers: BoolArray


def by_instruments(found: NamedFit, given: Instruments) -> NamedFit:
    """Fit a hypothesis anew to what instruments know of its flights.

    With X what each number moves along a run, r what is left, and Z what instruments know of X, the numbers change by d
    with ``sum Z^T (r - X d) = 0``. A gust goes with X, which the loop moves to answer it, and not with Z. Numbers that
    instruments hardly tell stay as they were, and all do where the flights are too short to tell errors. Bounds count
    as standard deviations of a normal prior, as in the search.

    Reference: Söderström and Stoica 2002 (instrumental variables in closed loop); Staiger and Stock 1997 (weak
    instruments).
    """
    at, moved = found, np.zeros(len(found.values), dtype=bool)
    # Shapes are followed where they go; a few steps are enough, and one where there are none.
    for _ in range(PER_WINDOW):
        sources = _sources(at, given)
        if not sources:
            break
        values, left_out = _stepped(at, sources)
        shapes = slice(len(at.estimates.linear), None)
        step, error = np.abs(values - at.values)[shapes], jackknife_error(left_out)[shapes]
        hypothesis = at.hypothesis.with_shapes(values[shapes]) if len(step) else at.hypothesis
        moved = np.any([numbers for _, numbers in sources], axis=0)
        at = at._replace(hypothesis=hypothesis, estimates=estimates_of(hypothesis, values, left_out))
        if np.all(10 * step <= error):
            break
    return at._replace(estimates=_with_unidentified(found, at.estimates, moved))


def _stepped(found: NamedFit, sources: Sequence[_Source]) -> tuple[Array, Array]:
    """Move numbers to where what is left has nothing of what is known of them; and with each block left out."""
    values, prior = found.values, known_before(found.hypothesis)
    change, without = np.zeros(len(values)), np.zeros((len(sources[0].products), len(values)))
    for products, numbers in sources:
        kept = products[:, :-1][:, numbers]
        # What those before it have moved is no longer left.
        right = kept[:, :, -1] - kept[:, :, :-1] @ change
        kept = np.concatenate([kept[:, :, :-1][:, :, numbers], right[..., None]], axis=2)
        # Of all blocks, and without each.
        sums = np.concatenate([kept.sum(axis=0, keepdims=True), kept.sum(axis=0) - kept])
        matrix, right = sums[:, :, :-1] + np.diag(prior[numbers]), sums[:, :, -1] - (prior * values)[numbers]
        scale = np.sqrt(np.abs(np.diagonal(matrix, axis1=1, axis2=2)))
        matrix = matrix / (scale[:, :, None] * scale[:, None, :])
        solved = np.linalg.solve(matrix, (right / scale)[..., None])[..., 0] / scale
        change[numbers], without[:, numbers] = solved[0], solved[1:]
    # The only number of an effect may be 0: then there is none.
    shapes = [
        (0.0 if len(each.effect.shapes) == 1 else shape.grid[0], shape.grid[-1])
        for each in found.hypothesis.chosen
        for shape in each.effect.shapes
    ]
    ends = np.array([(-np.inf, np.inf)] * len(found.estimates.linear) + shapes)
    return np.clip(values + change, *ends.T), np.clip(values + without, *ends.T)


def unidentified_axes(found: NamedFit, given: Instruments) -> BoolArray:
    """Mark the body axes, shape (3,), of whose inertia instruments tell nothing: a fit shows that of the loop."""
    told, vehicle = np.zeros(3, dtype=bool), found.hypothesis.places[0][1]
    for _, numbers in _sources(found, given):
        told |= numbers[vehicle][:3]
    return ~told


def significant_effects(found: NamedFit, given: Instruments) -> list[tuple[Candidate, float]]:
    """Keep the effects that are not 0 by what instruments tell, and what an effect holds where all else of it may be 0.

    Where an effect is 0, what is left without it does not go with what instruments know of it. That is asked at its
    shapes instead of whether its numbers may be 0, which instruments may tell badly from each other: a drag from the
    wind that it acts in. With each comes how likely chance makes what they show of it. One that they do not tell is
    asked by its interval, and its chance is NaN.

    Reference: Anderson and Rubin 1949 (a test that weak instruments do not mislead); Hotelling 1931.
    """
    sources, nothing, values = _sources(found, given), nothing_by_size(found), found.values
    stand, every = list[tuple[Candidate, float]](), np.arange(len(values))
    for candidate, places in zip(found.hypothesis.chosen, places_of(found.hypothesis), strict=True):
        effect, (linear, shapes) = candidate.effect, (every[place] for place in places)
        chance = _chance_of(sources, linear, shapes, values)
        if chance > found.settings.significance if np.isfinite(chance) else effect.name in nothing:
            continue
        for held in (CATALOGUE[name] for name in effect.holds):
            known = {number.name for number in held.numbers}
            beyond = np.concatenate([linear, shapes])[[number.name not in known for number in effect.numbers]]
            if _chance_of(sources, beyond, shapes[:0], values) > found.settings.significance:
                candidate = Candidate(held, {shape.name: candidate.shape[shape.name] for shape in held.shapes})
        stand.append((candidate, chance))
    return stand


def _chance_of(sources: Sequence[_Source], own: IntArray, shapes: IntArray, values: Array) -> float:
    """Compute the probability of what all sources show of numbers that they know if these are 0, shapes as they are.

    A source is asked of a number that another one tells as well. NaN where none knows any of them.
    """
    chances = list[float]()
    asked = np.isin(np.arange(len(values)), own)
    for products, numbers in sources:
        flown = products[products.any(axis=(1, 2))]
        known, others = asked & (_strength(np.diagonal(flown, axis1=1, axis2=2)[:, :-1]) > STRONG), numbers & ~asked
        others[shapes] = False
        if known.any() and len(flown) >= ENOUGH_BLOCKS + known.sum():
            chances.append(_chance(flown, known, others, values))
    return len(chances) * min(chances, default=np.nan)


def _chance(crossed: Array, own: BoolArray, others: BoolArray, values: Array) -> float:
    """Compute the probability of what instruments show of an effect if its own numbers are 0, others free."""
    from scipy.special import fdtrc

    scale = np.sqrt(np.maximum(np.abs(np.diagonal(crossed.sum(axis=0))), np.finfo(float).tiny))[:-1]
    products = crossed[:, :-1, :-1] / np.outer(scale, scale)
    right = crossed[:, :-1, -1] / scale + products[:, :, own] @ (values * scale)[own]
    whole = products.sum(axis=0)
    free = whole[np.ix_(others, others)]
    left = right - products[:, :, others] @ np.linalg.solve(free, right.sum(axis=0)[others])
    each = left[:, own] - left[:, others] @ np.linalg.solve(free.T, whole[np.ix_(own, others)].T)
    blocks, count = each.shape
    size = each.sum(axis=0) @ np.linalg.solve(np.atleast_2d(np.cov(each.T)), each.mean(axis=0))
    return float(fdtrc(count, blocks - count, size * (blocks - count) / (count * (blocks - 1))))


def untold(before: NamedFit, after: NamedFit) -> list[Effect]:
    """List effects whose numbers instruments hardly tell, and left as they were."""
    numbers = zip(after.hypothesis.chosen, before.estimates.effects, after.estimates.effects, strict=True)
    return [each.effect for each, was, now in numbers if was is now]


def predictable_residual(found: NamedFit, given: Instruments) -> Array:
    """Multiply what is left with what was known of it before, by block: 0 but for chance where nothing is missing."""
    _, runs = _known_windows(found, given)
    products = np.concatenate([rows[..., -1] * known[..., -1] for rows, known, _ in runs])
    block = np.concatenate([block for _, _, block in runs])
    return np.array([products[block == number].sum() for number in np.unique(block)])


def _sources(found: NamedFit, given: Instruments) -> list[_Source]:
    """List what tells numbers: what was asked; and what was before those that this does not tell, and what is late.

    Of the vehicle only those of the config: where it is measured, and what couples the rates, shows where several axes
    turn at once, which instruments hardly tell. A linear answer to setpoints tells lateness by far worse.
    """
    hypothesis, prior, sources = found.hypothesis, known_before(found.hypothesis), list[_Source]()
    weight = np.tile(found.floor, (len(hypothesis.residual), 1))
    free = ~fit_within_bounds(hypothesis, weight, of_vehicle=True)[1] & hypothesis.base.any(axis=(0, 1))
    vehicle, of_vehicle = hypothesis.places[0]
    free[of_vehicle] &= np.isin([each.name for each in vehicle.effect.coefficients], list(NUMBERS))
    late = np.array([each.effect.late for each in hypothesis.chosen for _ in each.effect.shapes], dtype=bool)
    left, early = np.append(free, np.ones_like(late)), np.append(np.ones_like(free), ~late)
    windows = _known_windows(found, given)
    blocks = np.unique(np.concatenate([run.block for run in chain(*windows)]))
    for place, runs in enumerate(windows):
        products = np.zeros((len(blocks), len(left) + 1, len(left) + 1))
        for (row, number), (rows, known, block) in product(enumerate(blocks), runs):
            own = block == number
            # As of windows half of which overlap.
            products[row] += np.einsum("wck,wcl->kl", known[own], rows[own], optimize=True) * (2 / PER_WINDOW)
        flown = products[products.any(axis=(1, 2))]
        if len(flown) >= ENOUGH_BLOCKS:
            # What a bound tells better than these flights is not told by them.
            numbers = left & (np.diagonal(flown.sum(axis=0))[:-1] > prior) & (early | (place > 0))
            numbers = _strong(flown, numbers)
            sources.append(_Source(products, numbers))
            left = left & ~numbers
    return sources


def _strong(crossed: Array, numbers: BoolArray) -> BoolArray:
    """Leave the numbers that are told each beside all others; of those that are not, the weakest goes first.

    Of what is known of each number, and of what it moves, that counts which no other explains.

    Reference: Sanderson and Windmeijer 2016 (the strength of instruments of one number beside others).
    """
    alone = _strength(np.diagonal(crossed, axis1=1, axis2=2)[:, :-1])
    kept = np.flatnonzero(numbers & (alone > STRONG))
    while len(kept):
        own = crossed[:, kept[:, None], kept]
        scale = np.sqrt(np.diagonal(own.sum(axis=0)))
        own = own / np.outer(scale, scale)
        inverse = np.linalg.pinv(own.sum(axis=0))
        inverse_alone = np.diag(inverse)
        beside = np.einsum("ij,bjk,ki->bi", inverse / inverse_alone[:, None], own, inverse / inverse_alone)
        unclear = kept[_strength(beside) <= STRONG]
        if not len(unclear):
            break
        kept = kept[kept != unclear[np.argmin(alone[unclear])]]
    return np.isin(np.arange(len(numbers)), kept)


def _strength(products: Array) -> Array:
    """Compute how sure it is over blocks that each number goes with what is known of it, as F; 0 where it does not.

    Of the product of these two, shape (block, number).
    """
    error = np.sqrt(len(products)) * products.std(axis=0, ddof=1)
    return np.asarray(np.square(np.maximum(products.sum(axis=0), 0.0) / np.where(error > 0, error, np.inf)))


def _with_unidentified(before: NamedFit, after: Estimates, moved: BoolArray) -> Estimates:
    """Keep the intervals of effects and numbers of the vehicle that instruments do not tell."""
    (vehicle, of_vehicle), *_ = before.hypothesis.places
    parameters = _identified_numbers(vehicle.effect, moved[of_vehicle], before.estimates.parameters, after.parameters)
    effects, places = [], places_of(before.hypothesis)
    pairs = zip(before.hypothesis.chosen, places, before.estimates.effects, after.effects, strict=True)
    for (effect, _), (linear, shapes), was, now in pairs:
        own = np.concatenate([moved[linear], moved[shapes]])
        of_columns = now if effect.physical else _identified_numbers(effect, own, was, now)
        effects.append(of_columns if own.any() else was)
    return replace(after, effects=tuple(effects), parameters=parameters)


def _identified_numbers(
    effect: Effect, told: BoolArray, was: Sequence[Estimate], now: Sequence[Estimate]
) -> tuple[Estimate, ...]:
    """Take the numbers of an effect that are told, and leave the others as they were."""
    names = {number.name for number, there in zip(effect.numbers, told, strict=False) if there}
    stood = {number.name: number for number in was if number.name not in names}
    return tuple(stood.get(number.name, number) for number in now)


class _Windows(NamedTuple):
    """Windows of a run in floors: what each number moves and last what is left, and what is known of that.

    `rows`, `known`: shape (window, 6, number + 1); `block`: shape (window,).
    """

    rows: Array
    known: Array
    block: IntArray


def _known_windows(found: NamedFit, given: Instruments) -> tuple[list[_Windows], list[_Windows]]:
    """Lay windows over runs, and beside them what instruments know; and what was before."""
    hypothesis, linear = found.hypothesis, found.estimates.linear
    windows = dense(hypothesis.flights[0].windows)
    there = system([replace(flight, windows=windows, seen={}) for flight in hypothesis.flights], hypothesis.chosen)
    columns = [there.base, shape_columns(there, linear), there.left(linear)[..., None]]
    rows = np.concatenate(columns, axis=2) / found.floor[:, None]
    own, middles, of_path, of_run = [], [], [], []
    length = found.settings.block_s / windows.period
    for number, run in enumerate(given.runs):
        begins = windows.hop * np.arange((there.flight_index == run.flight).sum())
        inside = (begins >= run.part.start) & (begins + len(windows.weight) <= run.part.stop)
        own.append(rows[there.flight_index == run.flight][inside])
        middles.append(begins[inside] - run.part.start + len(windows.weight) // 2)
        path, place = given.repeats.path(number, len(given.flown[number]))
        # Runs of one path know of each other, but not of what was before.
        of_path.append(path + len(given.runs) * (place[middles[-1]] // length))
        of_run.append(-1.0 - number - len(given.runs) * (middles[-1] // length))
    known = predicted_rows(given, windows, own) if given.kind == "setpoints" else _in_other_runs(given, own, middles)
    new, foretold, _ = news(own, [run[..., -1] for run in own], [run[..., :-1] for run in own])
    return _known_windows_of(own, known, of_path), _known_windows_of(new, foretold, of_run)


def _known_windows_of(rows: Sequence[Array], known: Sequence[Array], blocks: Sequence[Array]) -> list[_Windows]:
    """Take windows of which something is known, and their blocks; of a shorter list of windows these are the last."""
    windows = []
    for mine, theirs, block in zip(rows, known, blocks, strict=True):
        last = block[len(block) - len(mine) :]
        told = np.isfinite(theirs).all(axis=(1, 2)) & np.isfinite(last)
        windows.append(_Windows(mine[told], theirs[told], last[told].astype(np.int64)))
    return windows


def _in_other_runs(given: Instruments, rows: Sequence[Array], middles: Sequence[IntArray]) -> list[Array]:
    """Average what the other runs have at the same places of the path, shape (window, ...); NaN where there is none."""
    known = []
    for number, (own, middle) in enumerate(zip(rows, middles, strict=True)):
        total, count = np.zeros_like(own), np.zeros(len(own))
        for other, places in given.repeats.beside[number].items():
            place, flat = places[middle], rows[other].reshape(len(rows[other]), -1)
            inside = (place >= middles[other][0]) & (place <= middles[other][-1]) if len(flat) else place < 0
            moved = [np.interp(place[inside], middles[other], column) for column in flat.T]
            total[inside] += np.stack(moved, axis=1).reshape(-1, *own.shape[1:])
            count += inside
        known.append(np.where(count[:, None, None] > 0, total / np.maximum(count, 1)[:, None, None], np.nan))
    return known
