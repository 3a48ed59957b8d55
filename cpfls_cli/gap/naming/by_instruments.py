"""Parameters of a hypothesis in gusts, by instruments: a loop that answers gusts does not bias them."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import chain
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.blocks import ENOUGH_BLOCKS, jackknife_error
from cpfls_cli.effects.catalogue.parameter_error import NUMBERS, shown
from cpfls_cli.effects.effect import Effect, Shape
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.estimation.estimate import Normal, Prior, conditional_strength, one_step
from cpfls_cli.gap.balance.refine import fit_within_bounds, number_columns
from cpfls_cli.gap.balance.weak_flight import Candidate
from cpfls_cli.gap.naming.estimate import Estimates, NamedFit, estimates_of, nothing_by_size, places_of
from cpfls_cli.gap.naming.ranking import known_before
from cpfls_cli.gap.naming.results import Estimate
from cpfls_cli.gap.residual.air import predicted_rows
from cpfls_cli.playback.constants import STRONG
from cpfls_cli.playback.innovations import PER_WINDOW, innovations
from cpfls_cli.playback.instruments import Instruments

_Numbers = tuple[Estimate, ...]


class _Source(NamedTuple):
    """Products of instruments and regressors."""

    products: Array  # Shape (block, number + 1, number + 1): ZtX of each number, and Ztr in the last column.
    numbers: BoolArray  # Shape (number,): those that are free and that it identifies, and no source before it does.


def by_instruments(
    found: NamedFit, given: Instruments, held: BoolArray | None = None, *, together: bool = True
) -> NamedFit:
    """Fit a hypothesis anew by instruments.

    With the regressors X, the residual r and the prediction Z of X by instruments, the numbers change by d with
    ``sum Z^T (r - X d) = 0``. A gust correlates with X, which the loop moves to answer it, and not with Z. Weakly
    identified numbers stay as they were, but for inertia and couplings, which are those of the config then; all stay
    where the flights are too short for errors. So does a number of an effect with shapes that nothing identifies any
    more where a long step has taken it: its slopes were others. Bounds count as standard deviations of a normal prior,
    as in the search.

    `held`, shape (number,): numbers that stay.
    `together`: whether the error of a number holds those of the numbers that another source identifies, or the fit
    where nothing does, and one that is not identified jointly with these keeps its fit, where all intervals hold the
    conditional ones too; else each is conditional on them.

    Reference: Söderström and Stoica 2002 (instrumental variables in closed loop); Staiger and Stock 1997 (weak
    instruments); Newey and McFadden 1994, section 6 (errors of estimates in several steps).
    """
    stated = at = _of_config(found)
    held = np.zeros(len(found.values), dtype=bool) if held is None else held

    def jointly(every: list[_Source]) -> list[_Source]:
        return _strong_together(every, _is_lag(at)) if every and together else every

    conditional = _sources(at, given, held)
    sources = jointly(conditional)
    if not sources:
        return found
    moved, far = np.zeros((2, len(found.values)), dtype=bool)
    # Slopes of all others are the same wherever they come to.
    before, bends = None, np.zeros_like(moved)
    for own, curved in places_of(found.hypothesis):
        bends[own] = bends[curved] = bool(found.values[curved].size)
    # Shapes, and how long a residual lasts, are followed where they go; a few steps are enough.
    for _ in range(PER_WINDOW):
        values, left_out = _stepped(at, sources)
        # What follows from others is identified where they are.
        now = np.any([*(numbers for _, numbers in sources), (left_out != values).any(axis=0)], axis=0)
        if before is not None:
            # A number that no source identifies where it has come to is as uncertain as when one did.
            left_out[:, ~now] = before[:, ~now]
        moved, before = moved | now, left_out
        step, error, shapes = np.abs(values - at.values), jackknife_error(left_out), values[len(at.estimates.linear) :]
        far = np.where(now & bends, step > error, far)
        hypothesis = at.hypothesis.with_shapes(shapes) if len(shapes) else at.hypothesis
        last = at, sources
        at = at._replace(hypothesis=hypothesis, estimates=estimates_of(hypothesis, values, left_out))
        if np.all(10 * step <= error) or not (sources := jointly(_sources(at, given, held))):
            break
    if (lost := far & ~now & ~held).any():
        return by_instruments(found, given, held | lost, together=together)
    if (less := _below_zero(at) & moved).any():
        return by_instruments(_at_zero(found, less), given, held | less, together=together)
    if together:
        fit_error = np.where(stated.values == found.values, found.estimates.left_out - found.values, 0.0)
        _, joint = _stepped(*last, fit_error)
        joint[:, moved & ~now] = values[moved & ~now]
        joint[: len(left_out), moved & ~now] = left_out[:, moved & ~now]
        at = at._replace(estimates=estimates_of(at.hypothesis, values, joint, len(left_out)))
    dropped = np.any([each.numbers for each in conditional], axis=0) & ~moved
    numbers = _with_unidentified(stated, at.estimates, moved)
    if dropped.any():
        numbers = holding(numbers, by_instruments(found, given, held, together=False).estimates)
    return at._replace(estimates=numbers)


def _below_zero(found: NamedFit) -> BoolArray:
    """Mark coefficients of effects below 0 that cannot be, shape (number,)."""
    below, vehicle = np.zeros(len(found.values), dtype=bool), found.hypothesis.vehicle
    for (effect, _), (own, _) in zip(found.hypothesis.chosen, places_of(found.hypothesis), strict=True):
        least = [each.bounds(vehicle)[0] for each in effect.coefficients]
        if effect.physical is None and len(least) == len(found.values[own]):
            below[own] = (np.array(least) == 0.0) & (found.values[own] < 0.0)
    return below


def _at_zero(found: NamedFit, numbers: BoolArray) -> NamedFit:
    """Set coefficients, shape (number,), to 0 for good."""
    values, left_out = (np.where(numbers, 0.0, each) for each in (found.values, found.estimates.left_out))
    there = estimates_of(found.hypothesis, values, left_out)
    return found._replace(estimates=replace(there, parameters=found.estimates.parameters))


def holding(numbers: Estimates, others: Estimates) -> Estimates:
    """Widen the intervals of numbers of effects by those of another fit of them."""
    effects = []
    for own, there in zip(numbers.effects, others.effects, strict=True):
        other = {number.name: number for number in there}
        both = [(number, other.get(number.name, number)) for number in own]
        effects.append(tuple(replace(n, low=min(n.low, o.low), high=max(n.high, o.high)) for n, o in both))
    return replace(numbers, effects=tuple(effects))


def _of_config(found: NamedFit) -> NamedFit:
    """Set inertia and couplings of rates to what the config states: a fit gives them those of the loop.

    What instruments do not identify stays there; a coupling of the loop would bias the inertia that they do identify.
    """
    kept, linear = shown(np.zeros(3, dtype=bool)), found.estimates.linear.copy()
    linear[found.hypothesis.places[0][1]] *= kept
    numbers = zip(found.estimates.parameters, kept, strict=True)
    stated = tuple(each if keeps else replace(each, value=0.0, low=0.0, high=0.0) for each, keeps in numbers)
    return found._replace(estimates=replace(found.estimates, linear=linear, parameters=stated))


def _stepped(found: NamedFit, sources: Sequence[_Source], fit_error: Array | None = None) -> tuple[Array, Array]:
    """Move numbers to where instruments and residual do not correlate; and with each block left out.

    Shapes that follow from coefficients follow them.

    `fit_error`, shape (block, number): what the fit changes by without each of its blocks; None for errors of each
    source by itself.
    """
    values, prior = found.values, known_before(found.hypothesis)
    change, apart = np.zeros(len(values)), np.zeros((len(sources[0].products), len(values)))
    # Source by source a step does not overshoot as one of all together does.
    for products, numbers in sources:
        ztx, score = products[:, :-1, :-1][:, numbers], products[:, :-1, -1][:, numbers]
        # Without what those before it explain.
        normal = Normal(ztx[:, :, numbers], score - ztx @ change)
        step, left_out = one_step(normal, Prior.about_zero(prior[numbers]), values[numbers])
        change[numbers], apart[:, numbers] = step - values[numbers], left_out - step
    if fit_error is not None:
        apart = _apart(sources, values, prior, fit_error)
    without = change + apart
    shapes = [_ends(each.effect, shape) for each in found.hypothesis.chosen for shape in each.effect.shapes]
    ends = np.array([(-np.inf, np.inf)] * len(found.estimates.linear) + shapes)
    rows = found.hypothesis.followed(np.clip(values + np.vstack([change, without]), *ends.T))
    return rows[0], rows[1:]


def _ends(effect: Effect, shape: Shape) -> tuple[float, float]:
    """Bound a shape; the only number of an effect may be 0, where there is no effect."""
    return 0.0 if effect.numbers == (shape,) else shape.grid[0], shape.grid[-1]


def _apart(sources: Sequence[_Source], values: Array, prior: Array, fit_error: Array) -> Array:
    """Say what numbers change by without each block of the sources, then of the fit, whose numbers stay: all follow."""
    moving, equations = _together(sources)
    normal = Normal(equations[:, moving[:, None], moving], equations[:, moving, -1])
    step, left_out = one_step(normal, Prior.about_zero(prior[moving]), values[moving])
    apart, stay, total = np.zeros((len(left_out), len(values))), fit_error.copy(), equations.sum(axis=0)[moving]
    apart[:, moving], stay[:, moving] = left_out - step, 0.0
    stay[:, moving] = -np.linalg.solve(total[:, moving] + np.diag(prior[moving]), total[:, :-1] @ stay.T).T
    return np.vstack([apart, stay])


def _together(sources: Sequence[_Source]) -> tuple[IntArray, Array]:
    """List the numbers that sources identify, and stack the equations of each by its own source."""
    equations = np.zeros_like(sources[0].products[:, :-1])
    for products, numbers in sources:
        equations[:, numbers] = products[:, :-1][:, numbers]
    return np.flatnonzero(np.any([numbers for _, numbers in sources], axis=0)), equations


def _is_lag(found: NamedFit) -> BoolArray:
    """Mark the shapes of lags among all numbers, shape (number,)."""
    lags = [each.effect.is_lag for each in found.hypothesis.chosen for _ in each.effect.shapes]
    return np.append(np.zeros(len(found.estimates.linear), dtype=bool), np.array(lags, dtype=bool))


def with_lean(found: NamedFit, across: Array) -> NamedFit:
    """Let the thrust be larger by what a vehicle that leans against gusts takes for a lack of it.

    Against a gust that is fixed in the world it tilts by the gust over its weight, and as much of the gust is along its
    thrust, downwards on the mean; of one that is fixed in its body, as the drag of rotors is, nothing is.

    `across`: gusts along x and y, shape (2,), N; not finite where they are not known.
    """
    vehicle, parameters = found.hypothesis.flights[0].signals.vehicle, found.estimates.parameters
    lean = float(np.sum(across[np.isfinite(across)] ** 2)) / (vehicle.mass_kg * vehicle.gravity_m_s2) ** 2
    wider = (
        replace(each, high=each.high + lean * (1 + each.value)) if each.name == "thrust_scale" else each
        for each in parameters
    )
    return found._replace(estimates=replace(found.estimates, parameters=tuple(wider)))


def unidentified_axes(found: NamedFit, given: Instruments) -> BoolArray:
    """Mark the body axes, shape (3,), whose inertia instruments do not identify: a fit shows that of the loop."""
    vehicle = found.hypothesis.places[0][1]
    found_by = [each[vehicle][:3] for _, each in _sources(_of_config(found), given)]
    return np.asarray(~np.any([np.zeros(3, dtype=bool), *found_by], axis=0))


def significant_effects(found: NamedFit, given: Instruments, most: float) -> list[tuple[Candidate, float]]:
    """Keep the effects that are not 0 by instruments, and what an effect holds where all else of it may be 0.

    Where an effect is 0, the residual without it does not correlate with its instruments. That is tested at its shapes
    instead of whether its numbers may be 0, which instruments may separate badly: a drag from the wind that it acts in.
    With each comes the p-value, `most` at most; it is NaN for an effect without instruments, which is judged by its
    interval.

    Reference: Anderson and Rubin 1949 (a test that weak instruments do not mislead); Hotelling 1931.
    """
    sources, nothing, values = _sources(found, given), nothing_by_size(found), found.values
    significant, every = list[tuple[Candidate, float]](), np.arange(len(values))
    for candidate, places in zip(found.hypothesis.chosen, places_of(found.hypothesis), strict=True):
        effect, (linear, shapes) = candidate.effect, (every[place] for place in places)
        chance = _chance_of(sources, linear, shapes, values)
        if chance > most if np.isfinite(chance) else effect.name in nothing:
            continue
        for held in (CATALOGUE[name] for name in effect.holds):
            known = {number.name for number in held.numbers}
            beyond = np.concatenate([linear, shapes])[[number.name not in known for number in effect.numbers]]
            if _chance_of(sources, beyond, shapes[:0], values) > most:
                candidate = Candidate(held, {shape.name: candidate.shape[shape.name] for shape in held.shapes})
        significant.append((candidate, chance))
    return significant


def _chance_of(sources: Sequence[_Source], own: IntArray, shapes: IntArray, values: Array) -> float:
    """Compute the p-value of numbers over all sources if these are 0, shapes as they are.

    A source is asked of a number that another one identifies as well. NaN where none identifies any of them.
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


def _chance(ztx: Array, own: BoolArray, others: BoolArray, values: Array) -> float:
    """Compute the p-value of an effect by instruments if its own numbers are 0, others free."""
    from scipy.special import fdtrc

    scale = np.sqrt(np.maximum(np.abs(np.diagonal(ztx.sum(axis=0))), np.finfo(float).tiny))[:-1]
    products = ztx[:, :-1, :-1] / np.outer(scale, scale)
    right = ztx[:, :-1, -1] / scale + products[:, :, own] @ (values * scale)[own]
    whole = products.sum(axis=0)
    free = whole[np.ix_(others, others)]
    rest = right - products[:, :, others] @ np.linalg.solve(free, right.sum(axis=0)[others])
    each = rest[:, own] - rest[:, others] @ np.linalg.solve(free.T, whole[np.ix_(own, others)].T)
    blocks, count = each.shape
    size = each.sum(axis=0) @ np.linalg.solve(np.atleast_2d(np.cov(each.T)), each.mean(axis=0))
    return float(fdtrc(count, blocks - count, size * (blocks - count) / (count * (blocks - 1))))


def unidentified(before: NamedFit, after: NamedFit) -> list[Effect]:
    """List effects that instruments identify weakly, so that their numbers stayed as they were."""
    numbers = zip(after.hypothesis.chosen, before.estimates.effects, after.estimates.effects, strict=True)
    return [each.effect for each, was, now in numbers if [own.value for own in was] == [own.value for own in now]]


def predictable_residual(found: NamedFit, given: Instruments) -> Array:
    """Multiply the residual with its prediction from the past, by block: 0 but for chance where nothing is missing."""
    _, runs = _windows_of_runs(found, given)
    products = np.concatenate([rows[..., -1] * known[..., -1] for rows, known, _ in runs])
    block = np.concatenate([block for _, _, block in runs])
    return np.array([products[block == number].sum() for number in np.unique(block)])


def _sources(found: NamedFit, given: Instruments, held: BoolArray | None = None) -> list[_Source]:
    """List what identifies numbers: repeats or setpoints; and the past, for lags and what the first does not identify.

    Of the vehicle only the numbers of the config: the place of a sensor and the coupling of rates show where several
    axes turn at once, which instruments hardly identify. A linear answer to setpoints identifies lags far worse.
    """
    hypothesis, prior, sources = found.hypothesis, known_before(found.hypothesis), list[_Source]()
    weight = np.tile(found.floor, (len(hypothesis.residual), 1))
    free = ~fit_within_bounds(hypothesis, weight, of_vehicle=True)[1] & hypothesis.base.any(axis=(0, 1))
    vehicle, of_vehicle = hypothesis.places[0]
    free[of_vehicle] &= np.isin([each.name for each in vehicle.effect.coefficients], list(NUMBERS))
    own = np.isnan(hypothesis.following(found.estimates.linear))
    if held is not None:
        free, own = free & ~held[: len(free)], own & ~held[len(free) :]
    open_, early = np.append(free, own), ~_is_lag(found)
    windows = _windows_of_runs(found, given)
    blocks = np.unique(np.concatenate([run.block for run in chain(*windows)]))
    for place, runs in enumerate(windows):
        products = np.zeros((len(blocks), len(open_) + 1, len(open_) + 1))
        for rows, known, block in runs:
            for number in np.unique(block):
                z, x = (each[block == number].reshape(-1, len(open_) + 1) for each in (known, rows))
                # As of windows half of which overlap.
                products[np.searchsorted(blocks, number)] += z.T @ x * (2 / PER_WINDOW)
        flown = products[products.any(axis=(1, 2))]
        if len(flown) >= ENOUGH_BLOCKS:
            # What a bound identifies better than these flights is not identified by them.
            numbers = open_ & (np.diagonal(flown.sum(axis=0))[:-1] > prior) & (early | (place > 0))
            numbers = _strong(flown, numbers)
            sources.append(_Source(products, numbers))
            open_ = open_ & ~numbers
    return sources


def _strong_together(sources: list[_Source], lags: BoolArray) -> list[_Source]:
    """Keep of later sources the numbers that are identified where those of the others are free too; and lags.

    A fit of these would be the loop's.
    """
    # Each source has blocks of its own; of those of the others it has nothing, which is no scatter.
    flown = np.array([each.products.any(axis=(1, 2)) for each in sources])
    known, source = flown.any(axis=0), flown.argmax(axis=0)
    while True:
        moving, equations = _together(sources)
        normal = Normal(equations[:, moving[:, None], moving][known], equations[:, moving, -1][known])
        strength = conditional_strength(normal, Prior.none(len(moving)), source[known])
        unclear = np.flatnonzero((strength <= STRONG) & ~(sources[0].numbers | lags)[moving])
        if not len(unclear):
            return sources
        weakest = moving[unclear[np.argmin(strength[unclear])]]
        sources = [each._replace(numbers=each.numbers & (np.arange(len(each.numbers)) != weakest)) for each in sources]


def _strong(ztx: Array, numbers: BoolArray) -> BoolArray:
    """Keep the numbers that are identified jointly with all others; of those that are not, the weakest goes first.

    Reference: Sanderson and Windmeijer 2016 (conditional F of the instruments of one number).
    """
    alone = _strength(np.diagonal(ztx, axis1=1, axis2=2)[:, :-1])
    kept = np.flatnonzero(numbers & (alone > STRONG))
    while len(kept):
        normal = Normal(ztx[:, kept[:, None], kept], ztx[:, kept, -1])
        unclear = kept[conditional_strength(normal, Prior.none(len(kept))) <= STRONG]
        if not len(unclear):
            break
        kept = kept[kept != unclear[np.argmin(alone[unclear])]]
    return np.isin(np.arange(len(numbers)), kept)


def _strength(products: Array) -> Array:
    """Compute the F statistic of products of instruments and regressors, shape (block, number); 0 of negative ones."""
    error = np.sqrt(len(products)) * products.std(axis=0, ddof=1)
    return np.asarray(np.square(np.maximum(products.sum(axis=0), 0.0) / np.where(error > 0, error, np.inf)))


def _with_unidentified(before: NamedFit, after: Estimates, moved: BoolArray) -> Estimates:
    """Keep the intervals of effects and numbers of the vehicle that instruments do not identify."""
    (vehicle, of_vehicle), *_ = before.hypothesis.places

    def identified(effect: Effect, which: BoolArray, was: Sequence[Estimate], now: Sequence[Estimate]) -> _Numbers:
        names = {number.name for number, there in zip(effect.numbers, which, strict=False) if there}
        kept = {number.name: number for number in was if number.name not in names}
        return tuple(kept.get(number.name, number) for number in now)

    parameters = identified(vehicle.effect, moved[of_vehicle], before.estimates.parameters, after.parameters)
    effects, places = [], places_of(before.hypothesis)
    pairs = zip(before.hypothesis.chosen, places, before.estimates.effects, after.effects, strict=True)
    for (effect, _), (linear, shapes), was, now in pairs:
        own = np.concatenate([moved[linear], moved[shapes]])
        of_columns = now if effect.physical else identified(effect, own, was, now)
        effects.append(of_columns if own.any() else was)
    return replace(after, effects=tuple(effects), parameters=parameters)


class _Windows(NamedTuple):
    """Windows of a run in floors: regressors and last the residual, and what instruments predict of both."""

    rows: Array  # Shape (window, 6, number + 1).
    known: Array  # The same.
    block: IntArray  # Shape (window,).


def _windows_of_runs(found: NamedFit, given: Instruments) -> tuple[list[_Windows], list[_Windows]]:
    """Average regressors and residual of runs over windows, with their prediction by instruments; and by the past."""
    hypothesis, linear = found.hypothesis, found.estimates.linear
    there = hypothesis.closely
    windows = there.flights[0].windows
    # What shapes follow moves them after a step: a ratio of numbers that are hardly known bends too much within one.
    moving = number_columns(there, linear)[..., len(linear) :]
    rows = np.concatenate([there.base, moving, there.residual_at(linear)[..., None]], axis=2) / found.floor[:, None]
    own, middles, of_path, of_run = [], [], [], []
    length = found.settings.block_s / windows.period
    # Blocks of a run have consecutive numbers in time, as errors by neighbouring blocks take it.
    most = 1 + max(len(flown) for flown in given.flown) // length
    for number, run in enumerate(given.runs):
        begins = windows.hop * np.arange((there.flight_index == run.flight).sum())
        inside = (begins >= run.part.start) & (begins + len(windows.weight) <= run.part.stop)
        own.append(rows[there.flight_index == run.flight][inside])
        middles.append(begins[inside] - run.part.start + len(windows.weight) // 2)
        path, place = given.repeats.path(number, len(given.flown[number]))
        # Runs of one path know of each other, but not of past windows.
        of_path.append(path * most + place[middles[-1]] // length)
        of_run.append((number - len(given.runs)) * most + middles[-1] // length)
    known = predicted_rows(given, windows, own) if given.kind == "setpoints" else _in_other_runs(given, own, middles)
    new, predicted, _ = innovations(own, [run[..., -1] for run in own], [run[..., :-1] for run in own])
    return _predicted(own, known, of_path), _predicted(new, predicted, of_run)


def _predicted(rows: Sequence[Array], known: Sequence[Array], blocks: Sequence[Array]) -> list[_Windows]:
    """Take windows with a prediction, and their blocks; of a shorter list of windows these are the last."""
    windows = []
    for mine, theirs, block in zip(rows, known, blocks, strict=True):
        last = block[len(block) - len(mine) :]
        there = np.isfinite(theirs).all(axis=(1, 2)) & np.isfinite(last)
        windows.append(_Windows(mine[there], theirs[there], last[there].astype(np.int64)))
    return windows


def _in_other_runs(given: Instruments, rows: Sequence[Array], middles: Sequence[IntArray]) -> list[Array]:
    """Average what the other runs have at the same places of the path, shape (window, ...); NaN where there is none."""
    known = []
    for number, (own, middle) in enumerate(zip(rows, middles, strict=True)):
        total, count = np.zeros_like(own), np.zeros(len(own))
        for other, places in given.repeats.places[number].items():
            place, flat = places[middle], rows[other].reshape(len(rows[other]), -1)
            inside = (place >= middles[other][0]) & (place <= middles[other][-1]) if len(flat) else place < 0
            moved = [np.interp(place[inside], middles[other], column) for column in flat.T]
            total[inside] += np.stack(moved, axis=1).reshape(-1, *own.shape[1:])
            count += inside
        known.append(np.where(count[:, None, None] > 0, total / np.maximum(count, 1)[:, None, None], np.nan))
    return known
