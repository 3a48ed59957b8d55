"""Whether flights of today are those of an unchanged vehicle, and which change they tell of."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.changes.causes import Cause, causes
from cpfls_cli.changes.numbers import FlightNumbers
from cpfls_cli.changes.reference import Reference, common_numbers, kinds_of
from cpfls_cli.errors import InputError
from cpfls_cli.vehicle.settings import VehicleSettings

FALSE_ALARM = 0.01
"""Probability at which flights of an unchanged vehicle are said to have changed."""

NAMED = 0.9
"""Share of the belief from which on a change is named; below, it is one of several that look alike."""

LISTED = 0.03
"""Share of the belief from which on a change is told to look alike."""

_MOST = 3
"""Changes at once."""

_LOSES = 0.95
"""Probability that what is damaged pulls less, and not more."""

_ANY = 10.0
"""Times what is usual: a prior so wide says nothing of a size."""

_DRAWS, _POWER = 2000, 0.9
_SHOWN, _SIZES = 100, np.geomspace(0.05, 3.0, 28)
"""Draws and sizes, in what is usual of a change, that tell which one shows: neighbours differ by a sixth. One of which
three times what is usual does not show cannot be told."""

_IN_COMMON = 0.8
"""Share of their variance that flights of a day have in common where chance is drawn."""

_SCALES, _TAILS = 6, (1e-3, 1e-3)
"""Points of the scales of a kind that densities are summed over, and what is left out at either end."""

_HALF_WIDTH = 1.96


class Size(NamedTuple):
    """A size with its 95 % interval, in the unit of its cause."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Found:
    """A change that was found.

    Attributes
    ----------
    sizes : tuple of Size
        Of each direction that has the unit of the cause: one, but for two rotors or axes.
    belief : float
        Share beside all others in its place; of one rotor with that of pairs it is one of.
    alike : tuple of (str, float)
        Others in its place, and their share.
    """

    cause: Cause
    sizes: tuple[Size, ...]
    belief: float
    alike: tuple[tuple[str, float], ...]


@dataclass(frozen=True)
class Change:
    """What today's flights say beside the reference.

    Attributes
    ----------
    apart : array, shape (flight, number)
        Numbers of each of today's flights less those of the reference, loads at its voltage.
    deviation : array, shape (number,)
        What flights of one day differ by where nothing changed.
    p_value : float
        Probability that an unchanged vehicle looks as much like any change; the smallest that can be told is one over
        the number of draws.
    by_flight : array, shape (flight,)
        The same of each flight alone.
    since : int
        Flight of today from which on it looks most as if it had changed.
    found : tuple of Found
        Empty where nothing changed.
    shows : mapping of str to float
        Smallest size of each change that shows with 90 %, in its unit; infinite where none does.
    """

    names: tuple[str, ...]
    reference: Reference
    apart: Array
    deviation: Array
    p_value: float
    by_flight: Array
    since: int
    found: tuple[Found, ...]
    shows: dict[str, float]


def changed(
    today: Sequence[FlightNumbers],
    before: Sequence[FlightNumbers],
    vehicle: VehicleSettings,
    rng: np.random.Generator,
) -> Change:
    """Hold flights of today against reference flights.

    Each change that is possible is a normal distribution of its sizes beside that of unchanged flights, a multivariate
    t of each kind of numbers; its evidence is the ratio of both densities. It may be there from any flight of today on.
    The largest evidence counts, against the largest that unchanged flights have, searched alike: the only threshold is
    the rate of false alarms.

    Parameters
    ----------
    today, before : sequence of FlightNumbers
        At least one each; today's of one day.

    Raises
    ------
    InputError
        If the flights have no number in common.
    """
    names = common_numbers([*before, *today])
    if not names:
        raise InputError("flights of today and of the reference tell no number in common; import the same signals")
    if {flight.commanded for flight in [*before, *today]} == {True, False}:
        names = tuple(name for name in names if not name.startswith("load "))
    return judged(today, Reference.of(before, names, vehicle), vehicle, rng, range(len(today)))


def judged(
    today: Sequence[FlightNumbers],
    reference: Reference,
    vehicle: VehicleSettings,
    rng: np.random.Generator,
    starts: Sequence[int] = (0,),
) -> Change:
    """Hold flights of today against a reference, as `changed`.

    Parameters
    ----------
    starts : sequence of int
        Flights from which on it may be changed, up to the last: the most telling one counts, as it does in chance.
    """
    names = reference.names
    apart, covariance = reference.apart(today)
    listed = causes(names, vehicle)
    space = _Space(covariance, reference.freedom, kinds_of(names), listed)
    since_each = np.array([apart[start:].mean(axis=0) for start in starts])
    drawn = space.drawn(rng, [len(today) - start for start in starts])
    most = space.evidence(drawn.reshape(-1, len(names))).max(axis=0).reshape(drawn.shape[:2])
    chance, alone = np.sort(most.max(axis=0)), np.sort(most[-1])
    evidence = space.evidence(np.vstack([since_each, apart])).max(axis=0)
    p_value = beyond_chance(chance, evidence[: len(starts)].max())
    best = int(np.argmax(evidence[: len(starts)]))
    found = _found(space, since_each[best], chance) if p_value <= FALSE_ALARM else ()
    threshold = float(np.quantile(chance, 1 - FALSE_ALARM))
    white = np.linalg.solve(space.root, drawn[0, :_SHOWN].T)
    return Change(
        names,
        reference,
        apart,
        np.sqrt(np.diag(covariance)),
        p_value,
        np.array([beyond_chance(alone, each) for each in evidence[len(starts) :]]),
        starts[best],
        found,
        {cause.name: space.shows(index, threshold, white) for index, cause in enumerate(listed)},
    )


def beyond_chance(chance: Array, value: float) -> float:
    """Tell how probable a value of at least this size is, held against draws of chance."""
    return float((1 + (chance >= value).sum()) / (1 + len(chance)))


class _Mixture(NamedTuple):
    """A density as a mixture over scales of the kinds that its directions touch, in logarithms.

    Attributes
    ----------
    weights : array, shape (scale, row)
        Logarithm of each part.
    means : array, shape (scale, size, row)
        Of sizes along the directions.
    covariances : array, shape (scale, size, size)
    """

    weights: Array
    means: Array
    covariances: Array

    @property
    def density(self) -> Array:
        """Logarithm of the density, shape (row,)."""
        most = self.weights.max(axis=0)
        return np.asarray(most + np.log(np.exp(self.weights - most).sum(axis=0)))


class _Space:
    """Densities of numbers under no change and under each one: of each kind a multivariate t with a scale of its own.

    So a change has to do with the kinds that it touches alone.
    """

    def __init__(self, covariance: Array, freedom: float, kinds: Sequence[str], listed: Sequence[Cause]) -> None:
        # Slow to load, and who reads a record computes nothing.
        from scipy.special import chdtri

        self.listed, self.freedom = listed, freedom
        self.kind = np.unique(kinds, return_inverse=True)[1]
        self.root = np.linalg.cholesky(covariance)
        square = np.geomspace(chdtri(freedom, 1 - _TAILS[0]), chdtri(freedom, _TAILS[1]), _SCALES)
        self.scales = freedom / square
        weight = 0.5 * freedom * (np.log(square / freedom) - square / freedom)
        self.weights = weight - np.log(np.exp(weight - weight.max()).sum()) - weight.max()
        self.white = [np.linalg.solve(self.root, cause.directions) for cause in listed]
        self.prior = np.log([cause.prior for cause in listed])

    def drawn(self, rng: np.random.Generator, counts: Sequence[int] = (1,), draws: int = _DRAWS) -> Array:
        """Draw means of so many of the last flights of an unchanged day, shape (count, draw, number).

        Each kind has a scatter of its own to be off by.
        """
        scale = np.sqrt(self.freedom / rng.chisquare(self.freedom, (draws, self.kind.max() + 1)))[:, self.kind]
        day, own = rng.normal(size=(2, draws, len(self.root)))
        means, total, flights = [], np.zeros_like(own), 0
        for count in sorted(counts):
            # The mean of so many of them, of which some are in the mean before.
            total, flights = total + np.sqrt(count - flights) * rng.normal(size=own.shape), count
            means.append(np.sqrt(_IN_COMMON) * day + np.sqrt(1 - _IN_COMMON) * total / count)
        order = np.argsort(np.argsort(counts, kind="stable"), kind="stable")
        return np.asarray(scale * (np.array(means)[order] @ self.root.T))

    def evidence(self, apart: Array, beside: Sequence[int] = ()) -> Array:
        """Compute the logarithm of the evidence of each change, shape (cause, row).

        Parameters
        ----------
        apart : array, shape (row, number)
        beside : sequence of int
            Changes that are there anyway.
        """
        rows = np.linalg.solve(self.root, apart.T)
        with_each = np.array([self._gain(rows, [*beside, index]) for index in range(len(self.listed))])
        return np.asarray(with_each - self._gain(rows, beside) + self.prior[:, None])

    def _gain(self, rows: Array, chosen: Sequence[int]) -> Array:
        """Compute the logarithm of the density of whitened rows with changes over that without any, shape (row,)."""
        if not chosen:
            return np.zeros(rows.shape[1])
        columns = np.hstack([self.white[index] for index in chosen])
        gain = np.zeros(rows.shape[1])
        for kinds, own in self._parts(columns):
            without = sum(
                self._mixture(rows, [kind], columns[:, :0], np.zeros(0, dtype=bool)).density for kind in kinds
            )
            gain += self._mixture(rows, kinds, columns[:, own], self._losses(chosen)[own]).density - without
        return gain

    def _losses(self, chosen: Sequence[int]) -> BoolArray:
        """Mark the directions of changes whose sizes are nearly always above 0."""
        each = [np.arange(self.white[index].shape[1]) < self.listed[index].losses for index in chosen]
        return np.concatenate(each)

    def _parts(self, columns: Array) -> list[tuple[list[int], BoolArray]]:
        """Part directions that have no kind in common: the kinds of each part, and the directions that touch them."""
        touches = np.array([(columns[self.kind == kind] != 0).any(axis=0) for kind in range(self.kind.max() + 1)])
        parts: list[tuple[list[int], BoolArray]] = []
        for column in touches.T:
            kinds = set(np.flatnonzero(column).tolist())
            apart = [part for part in parts if not kinds & set(part[0])]
            kinds = kinds.union(*(part[0] for part in parts if kinds & set(part[0])))
            parts = [*apart, (sorted(kinds), np.asarray(touches[sorted(kinds)].any(axis=0)))] if kinds else parts
        return parts

    def _mixture(self, rows: Array, kinds: Sequence[int], columns: Array, losses: BoolArray) -> _Mixture:
        """Compute the density of the numbers of kinds, but for what all have in common.

        Parameters
        ----------
        columns : array, shape (number, size)
            Whitened directions.
        losses : array, shape (size,)
            Those whose sizes are nearly always above 0.
        """
        own = [self.kind == kind for kind in kinds]
        scales = np.array(list(product(self.scales, repeat=len(own))))
        squares = np.array([(rows[each] ** 2).sum(axis=0) for each in own])
        along = np.array([columns[each].T @ rows[each] for each in own])
        gram = np.array([columns[each].T @ columns[each] for each in own])
        covariances: Array = np.linalg.inv(np.eye(columns.shape[1]) + np.einsum("sk,kij->sij", 1 / scales, gram))
        projected: Array = np.einsum("sk,kir->sir", 1 / scales, along)
        means: Array = covariances @ projected
        spread = np.log(scales) @ [each.sum() for each in own] - np.linalg.slogdet(covariances)[1]
        weights = np.array(list(product(self.weights, repeat=len(own)))).sum(axis=1) - 0.5 * spread
        exponent = (1 / scales) @ squares - (projected * means).sum(axis=1)
        return _Mixture(weights[:, None] - 0.5 * exponent + _losing(means, covariances, losses), means, covariances)

    def sizes(self, apart: Array, chosen: Sequence[int], of: int) -> tuple[Size, ...]:
        """Estimate the sizes of one of several changes that are there, in its unit.

        What is told of any size counts as as likely; a prior of what is usual would draw large ones in.
        """
        first = sum(self.white[index].shape[1] for index in chosen[: chosen.index(of)])
        told = slice(first, first + self.listed[of].told)
        columns = np.hstack([self.white[index] for index in chosen])
        columns[:, told] *= _ANY
        rows = np.linalg.solve(self.root, apart[:, None])
        kinds, own = next(part for part in self._parts(columns) if part[1][told].all())
        mixture = self._mixture(rows, kinds, columns[:, own], np.zeros(own.sum(), dtype=bool))
        share = np.exp(mixture.weights - mixture.density)
        at = np.searchsorted(np.flatnonzero(own), np.arange(told.start, told.stop))
        means, variances = mixture.means[:, at, 0], np.diagonal(mixture.covariances, axis1=1, axis2=2)[:, at]
        mean = (share * means).sum(axis=0)
        error = np.sqrt((share * (variances + (means - mean) ** 2)).sum(axis=0))
        cause = self.listed[of]
        shown = _ANY * cause.usual * (mean + np.outer([0.0, -_HALF_WIDTH, _HALF_WIDTH], error))
        return tuple(Size(*map(cause.size, each)) for each in shown.T)

    def shows(self, index: int, threshold: float, drawn: Array) -> float:
        """Find the smallest size of a change that shows with 90 %, in its unit; infinite where none does."""
        own, cause = self.white[index], self.listed[index]

        def is_enough(size: float) -> bool:
            evidence = self._gain(drawn + size * own[:, :1], [index]) + self.prior[index]
            return bool(np.mean(evidence >= threshold) >= _POWER)

        first = bisect_left(_SIZES, x=True, key=is_enough)
        return cause.size(_SIZES[first] * cause.usual) if first < len(_SIZES) else float("inf")


def _losing(means: Array, covariances: Array, losses: BoolArray) -> Array:
    """Compute the logarithm of what the sign of losses adds to a density, shape (scale, row).

    Of two losses as if neither told of the other.
    """
    if not losses.any():
        return np.zeros((len(means), means.shape[2]))
    from scipy.special import ndtr

    error = np.sqrt(np.diagonal(covariances, axis1=1, axis2=2)[:, losses])
    above = ndtr(means[:, losses] / error[:, :, None])
    return np.asarray(np.log(2 * (_LOSES * above + (1 - _LOSES) * (1 - above))).sum(axis=1))


def _found(space: _Space, apart: Array, chance: Array) -> tuple[Found, ...]:
    """Name one change after another while each explains more than chance beside the others."""
    chosen: list[int] = []
    while len(chosen) < _MOST:
        evidence = _beside(space, apart, chosen)
        best = int(np.argmax(evidence))
        if beyond_chance(chance, float(evidence[best])) > FALSE_ALARM:
            break
        chosen.append(best)
        # What came first was chosen for what the others do too.
        for index in [*chosen] * 2:
            others = [other for other in chosen if other != index]
            chosen = [*others, int(np.argmax(_beside(space, apart, others)))]
    found = []
    for index in chosen:
        evidence = _beside(space, apart, [other for other in chosen if other != index])
        share = np.exp(evidence - evidence.max())
        share /= share.sum()
        order = np.argsort(-share, kind="stable")
        alike = tuple(
            (space.listed[other].name, float(share[other]))
            for other in order
            if other != index and share[other] >= LISTED
        )
        own = space.listed[index]
        belief = sum(share[at] for at, other in enumerate(space.listed) if at == index or own.holds(other))
        found.append(Found(own, space.sizes(apart, chosen, index), float(belief), alike))
    return tuple(found)


def _beside(space: _Space, apart: Array, there: Sequence[int]) -> Array:
    """Compute the logarithm of the evidence of each change beside those that are there, shape (cause,)."""
    evidence = space.evidence(apart[None], there)[:, 0]
    rotors = frozenset[str]().union(*(space.listed[index].rotors for index in there))
    for index, cause in enumerate(space.listed):
        if index in there or cause.rotors & rotors:
            evidence[index] = -np.inf
    return evidence
