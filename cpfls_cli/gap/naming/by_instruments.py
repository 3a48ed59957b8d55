"""Numbers of a hypothesis in gusts, by what was asked: a loop that answers gusts does not mix into them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.effects.catalogue.parameter_error import NUMBERS
from cpfls_cli.effects.effect import Effect
from cpfls_cli.gap.balance.balance_system import System, system
from cpfls_cli.gap.balance.refine import fit_within_bounds, refined, shape_columns
from cpfls_cli.gap.balance.weak_flight import PER_WINDOW, dense
from cpfls_cli.gap.naming.earned import NamedFit, fitted, nothing_by_size
from cpfls_cli.gap.naming.estimate import Estimates, estimates_of
from cpfls_cli.gap.naming.ranking import more_left, rank_effects, surely
from cpfls_cli.gap.naming.results import Alternative
from cpfls_cli.gap.naming.scoring import information
from cpfls_cli.gap.naming.search import alternative
from cpfls_cli.gap.residual.air import foretold_rows
from cpfls_cli.gap.settings import CHANCE, GapSettings
from cpfls_cli.playback.constants import ENOUGH_BLOCKS, STRONG
from cpfls_cli.playback.instruments import Instruments


class _Run(NamedTuple):
    """Windows of a run in floors: what each number moves and last what is left, and what is known of that.

    Attributes
    ----------
    rows, known : array, shape (window, 6, number + 1)
    block : array of int, shape (window,)
    """

    rows: Array
    known: Array
    block: IntArray


def by_instruments(found: NamedFit, given: Instruments, floor: Array, settings: GapSettings) -> NamedFit:
    """Fit a hypothesis anew to what instruments know of its flights.

    With X what each number moves along a run, r what is left, and Z what instruments know of X, the numbers change by d
    with ``sum Z^T (r - X d) = 0``. A gust goes with X, which the loop moves to answer it, and not with Z. Numbers that
    instruments hardly tell stay as they were. Bounds count as standard deviations of a normal prior, as in the search.

    Parameters
    ----------
    given : Instruments
        Of the same flights.
    floor : array, shape (6,)

    Returns
    -------
    NamedFit
        The same effects; as it was where the flights are too short to tell errors.

    References
    ----------
    Söderström and Stoica 2002 (instrumental variables in closed loop); Staiger and Stock 1997 (weak instruments).
    """
    hypothesis, linear = found.hypothesis, found.estimates.linear
    crossed, moving = _products(found, given, floor, settings)
    if len(crossed) < ENOUGH_BLOCKS:
        return found
    kept = crossed[:, np.append(moving, False)][:, :, np.append(moving, True)]
    values, prior = np.concatenate([linear, hypothesis.shape_values]), _prior(hypothesis)[moving]
    whole = kept.sum(axis=0)
    change, *without = (_solved(sums, values[moving], prior) for sums in (whole, *(whole - kept)))
    left_out = np.tile(values, (len(crossed), 1))
    left_out[:, moving] += without
    values[moving] += change
    there = hypothesis.with_shapes(values[len(linear) :]) if len(hypothesis.shapes) else hypothesis
    return NamedFit(there, found.block, _told(found, estimates_of(there, values, left_out), moving))


def untold_axes(found: NamedFit, given: Instruments, floor: Array, settings: GapSettings) -> BoolArray:
    """Mark the body axes of whose inertia instruments tell nothing, shape (3,): in gusts a fit shows that of the loop.

    Parameters
    ----------
    found : NamedFit
    given : Instruments
        Of the same flights.
    floor : array, shape (6,)
    """
    crossed, moving = _products(found, given, floor, settings)
    return ~moving[found.hypothesis.places[0][1]][:3] | (len(crossed) < ENOUGH_BLOCKS)


def may_be_nothing(found: NamedFit, given: Instruments, floor: Array, settings: GapSettings) -> list[str]:
    """Name the effects that may be 0 by what instruments tell.

    Where an effect is 0, what is left without it does not go with what instruments know of it. That is asked at its
    shapes instead of whether its numbers may be 0, which instruments may tell badly from each other: a drag from the
    wind that it acts in. One that they do not tell is asked by its interval.

    Parameters
    ----------
    found : NamedFit
        By instruments.
    given : Instruments
        Of the same flights.
    floor : array, shape (6,)

    References
    ----------
    Anderson and Rubin 1949 (a test that weak instruments do not mislead); Hotelling 1931.
    """
    crossed, moving = _products(found, given, floor, settings)
    nothing, places = nothing_by_size(found), {candidate.key: place for candidate, place in found.hypothesis.places}
    values = np.append(found.estimates.linear, found.hypothesis.shape_values)
    first, names = len(found.estimates.linear), []
    for candidate in found.hypothesis.chosen:
        shapes = slice(first, first := first + len(candidate.effect.shapes))
        own = np.zeros_like(moving)
        own[places.get(candidate.key, slice(0))] = True
        own, others = own & moving, ~own & moving
        others[shapes] = False
        told = own.any() and len(crossed) >= ENOUGH_BLOCKS + own.sum()
        absent = _chance(crossed, own, others, values) > CHANCE if told else candidate.effect.name in nothing
        names += [candidate.effect.name] if absent else []
    return names


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


def untold_actuation(before: NamedFit, after: NamedFit) -> list[str]:
    """Name those of them on the actuation that a loop is taken for."""
    own = (effect for effect in untold(before, after) if effect.kind == "actuator")
    return [effect.name for effect in own if effect.actuation is None or effect.late]


def told_apart(
    found: NamedFit, effects: Sequence[Effect], given: Instruments, floor: Array, settings: GapSettings
) -> tuple[NamedFit, tuple[Alternative, ...]]:
    """Decide by instruments what lies between command and rotors: what was found, or one effect of no more numbers.

    In gusts a fit of all motion takes the loop for the rotors, and a lag for a delay. What the right one leaves has
    nothing that instruments know. Of those that they cannot tell apart the one with the fewest numbers is named, and of
    as many the first of the catalogue, which is the usual one.

    Parameters
    ----------
    found : NamedFit
        By instruments.
    effects : sequence of Effect
        That the search tried.

    Returns
    -------
    NamedFit
        With the effect that leaves least.
    tuple of Alternative
        Those that leave as little.
    """
    chosen, flights = found.hypothesis.chosen, found.hypothesis.flights
    between = [each.effect for each in chosen if each.effect.late]
    if not between:
        return found, ()
    most, _ = own = _usual_first(between)
    others = [each for each in chosen if not each.effect.late]
    fits = {own: (between, found)}
    for effect in effects:
        if effect.late and len(effect.shapes) <= most and _usual_first([effect]) != own:
            for scored in rank_effects(flights, others, [effect], settings, None, floor=floor).ranking:
                start = refined(flights, scored.chosen, floor).chosen
                told = by_instruments(fitted(flights, start, floor, settings), given, floor, settings)
                fits[_usual_first([effect])] = [effect], told
    left = {place: _reproduced(fits[place][1], given, floor, settings) for place in sorted(fits)}
    best, *further = left
    for place in further:
        best = place if surely(more_left(left[best], left[place])) else best
    # With more numbers a rival would have to leave less.
    alike = [place for place in left if place[0] <= best[0] and not surely(more_left(left[place], left[best]))]
    (named, *_), told = fits[best]
    rivals = [fits[place][0] for place in alike if place != best]
    return told, tuple(alternative(named, other, 1.0, *(each.name for each in beside)) for *beside, other in rivals)


def _usual_first(between: Sequence[Effect]) -> tuple[int, tuple[int, ...]]:
    """Order what lies between command and rotors: fewer numbers first, then as in the catalogue."""
    return sum(len(each.shapes) for each in between), tuple(each.order for each in between)


def _reproduced(found: NamedFit, given: Instruments, floor: Array, settings: GapSettings) -> Array:
    """Multiply what is left with what instruments know of it, by block: 0 but for chance where nothing is missing."""
    total: dict[int, float] = {}
    for run in _runs(found.hypothesis, found.estimates.linear, given, floor, settings):
        for block in np.unique(run.block):
            own = run.block == block
            total[block] = total.get(block, 0.0) + float((run.rows[own, :, -1] * run.known[own, :, -1]).sum())
    return np.array([total[block] for block in sorted(total)])


def _products(found: NamedFit, given: Instruments, floor: Array, settings: GapSettings) -> tuple[Array, BoolArray]:
    """Multiply what instruments know of each number, and of what is left, with what they move, by block.

    Returns
    -------
    array, shape (block, number + 1, number + 1)
    array of bool, shape (number,)
        Of numbers that are free, and that instruments tell.
    """
    moving = _movable(found.hypothesis, floor)
    runs = list(_runs(found.hypothesis, found.estimates.linear, given, floor, settings))
    blocks = np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *(run.block for run in runs)]))
    if len(blocks) < ENOUGH_BLOCKS:
        return np.zeros((len(blocks), len(moving) + 1, len(moving) + 1)), moving
    crossed = np.array([sum(_crossed(run, run.block == block) for run in runs) for block in blocks])
    return crossed, moving & (_strength(crossed) > STRONG)


def _movable(hypothesis: System, floor: Array) -> BoolArray:
    """Mark numbers that are free, coefficients of the base and then shapes, shape (number,).

    Of the vehicle only those of the config: where it is measured, and what couples the rates, shows where several axes
    turn at once, which instruments hardly tell.
    """
    _, held = fit_within_bounds(hypothesis, np.tile(floor, (len(hypothesis.residual), 1)), of_vehicle=True)
    free = ~held & hypothesis.base.any(axis=(0, 1))
    of_vehicle = hypothesis.places[0][1]
    free[of_vehicle] &= np.isin([each.name for each in hypothesis.free[0].effect.coefficients], list(NUMBERS))
    return np.concatenate([free, np.ones(len(hypothesis.shapes), dtype=bool)])


def _strength(crossed: Array) -> Array:
    """Compute how sure it is over blocks that each number goes with what is known of it, as F; 0 where it does not."""
    each = np.diagonal(crossed[:, :-1, :-1], axis1=1, axis2=2)
    error = np.sqrt(len(each)) * each.std(axis=0, ddof=1)
    return np.asarray(np.square(np.maximum(each.sum(axis=0), 0.0) / np.where(error > 0, error, np.inf)))


def _prior(hypothesis: System) -> Array:
    """Give the information that bounds are, shape (number,)."""
    places = [
        information(candidate.effect, place.stop - place.start, hypothesis.vehicle)
        for candidate, place in hypothesis.places
    ]
    return np.array([*np.concatenate(places), *(1.0 / np.ptp(shape.grid) ** 2 for shape in hypothesis.shapes)])


def _solved(sums: Array, values: Array, prior: Array) -> Array:
    """Solve for the change of numbers at values, of products, shape (number, number + 1)."""
    matrix, right = sums[:, :-1] + np.diag(prior), sums[:, -1] - prior * values
    scale = np.sqrt(np.abs(np.diag(matrix)))
    return np.asarray(np.linalg.solve(matrix / np.outer(scale, scale), right / scale) / scale)


def _crossed(run: _Run, of_block: BoolArray) -> Array:
    """Sum products of what is known of each number and what all of them move, as of windows half of which overlap."""
    known, rows = run.known[of_block], run.rows[of_block]
    return np.asarray(np.einsum("wck,wcl->kl", known, rows, optimize=True) * (2 / PER_WINDOW))


def _told(before: NamedFit, after: Estimates, moved: BoolArray) -> Estimates:
    """Keep the intervals of effects and numbers of the vehicle that instruments do not tell."""
    hypothesis = before.hypothesis
    places = {candidate.key: place for candidate, place in hypothesis.places}
    first, effects = hypothesis.base.shape[2], []
    for candidate, *both in zip(hypothesis.chosen, before.estimates.effects, after.effects, strict=True):
        shapes = slice(first, first := first + len(candidate.effect.shapes))
        own = moved[places.get(candidate.key, slice(0))], moved[shapes]
        effects.append(both[bool(np.concatenate(own).any())])
    names = [each.name for each in hypothesis.free[0].effect.coefficients]
    told = {name for name, there in zip(names, moved, strict=False) if there}
    own_numbers = {each.name: each for each in before.estimates.parameters}
    parameters = tuple(each if each.name in told else own_numbers.get(each.name, each) for each in after.parameters)
    return replace(after, effects=tuple(effects), parameters=parameters)


def _runs(hypothesis: System, linear: Array, given: Instruments, floor: Array, settings: GapSettings) -> Iterator[_Run]:
    """Lay windows over runs, and beside them what instruments know."""
    windows = dense(hypothesis.flights[0].windows)
    there = system([replace(flight, windows=windows, seen={}) for flight in hypothesis.flights], hypothesis.chosen)
    columns = [there.base, shape_columns(there, linear), there.left(linear)[..., None]]
    rows = np.concatenate(columns, axis=2) / floor[:, None]
    own, middles = [], []
    for run in given.runs:
        begins = windows.hop * np.arange((there.flight_index == run.flight).sum())
        inside = (begins >= run.part.start) & (begins + len(windows.weight) <= run.part.stop)
        own.append(rows[there.flight_index == run.flight][inside])
        middles.append(begins[inside] - run.part.start + len(windows.weight) // 2)
    known = foretold_rows(given, windows, own) if given.kind == "setpoints" else _beside(given, own, middles)
    length = settings.block_s / windows.period
    for number, (mine, theirs, middle) in enumerate(zip(own, known, middles, strict=True)):
        path, place = given.repeats.path(number, len(given.flown[number]))
        told = np.isfinite(theirs).all(axis=(1, 2)) & np.isfinite(place[middle])
        along = (place[middle[told]] // length).astype(np.int64)
        yield _Run(mine[told], theirs[told], path + len(given.runs) * along)


def _beside(given: Instruments, rows: Sequence[Array], middles: Sequence[IntArray]) -> Iterator[Array]:
    """Average what the other runs have at the same places of the path, shape (window, ...); NaN where there is none."""
    for number, (own, middle) in enumerate(zip(rows, middles, strict=True)):
        total, count = np.zeros_like(own), np.zeros(len(own))
        for other, places in given.repeats.beside[number].items():
            place, flat = places[middle], rows[other].reshape(len(rows[other]), -1)
            inside = (place >= middles[other][0]) & (place <= middles[other][-1]) if len(flat) else place < 0
            moved = [np.interp(place[inside], middles[other], column) for column in flat.T]
            total[inside] += np.stack(moved, axis=1).reshape(-1, *own.shape[1:])
            count += inside
        yield np.where(count[:, None, None] > 0, total / np.maximum(count, 1)[:, None, None], np.nan)
