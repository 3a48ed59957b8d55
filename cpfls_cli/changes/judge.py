"""Whether flights of today are those of an unchanged vehicle, and which change they show."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator, Sequence
from functools import cache
from itertools import chain
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.changes.causes import Cause, causes
from cpfls_cli.changes.numbers import KINDS, FlightNumbers, unit_of
from cpfls_cli.changes.reference import (
    EACH_TEST,
    FALSE_ALARM,
    FEWEST,
    Reference,
    common_numbers,
    either,
    furthest,
    kinds_of,
    number_limits,
)
from cpfls_cli.changes.results import CABLE, Alike, Changed, Found, NumberToday, Shows
from cpfls_cli.errors import InputError
from cpfls_cli.result import Estimate
from cpfls_cli.vehicle.settings import VehicleSettings

NAMED = 0.95  # Share of the belief from which on a change is named; below, it is one of several that look alike.
LISTED = 0.03  # Share of the belief from which on a change is said to look alike.
_MOST = 3  # Changes at once.
_LOSES = 0.95  # Probability that what is damaged pulls less, and not more.
_NEARER = 0.5  # Share of the usual ratio below which one is likelier nothing, whatever its error is.
_ANY = 10.0  # Times what is usual: a prior so wide says nothing of a size.
_WIDTHS = ((1.0, 0.9), (_ANY, 0.1))
"""Times what is usual, and how probable a size is drawn so wide. With the usual width alone a change would count the
less the larger it is, for large numbers of an unchanged vehicle, a t, are rare by a power of their size alone."""

_DRAWS, _POWER = 2000, 0.9
_SHOWN, _SIZES = 100, np.geomspace(0.05, 3.0, 28)
"""Draws and sizes, in what is usual of a change, for the smallest that shows: neighbours differ by a sixth. One of
which three times what is usual does not show is not found."""

_IN_COMMON = 0.8
"""Share of their variance that flights of a day have in common where chance is drawn: another share makes a search over
starts find as much by chance, or less."""

_NODES, _MOST_NODES = 8, 256
"""Of the scatter of one kind, and at most so many of kinds that go together: densities within 3 %."""

_FARTHEST = 20.0  # Deviations up to which densities are right.
_NONE = np.arange(0)
_HALF_WIDTH = 1.96


class Judged(NamedTuple):
    """What flights say against a reference, as `Changed`, with their numbers as arrays."""

    # Shape (flight, number): numbers of each of today's flights less those of the reference, shares of thrust at its
    # voltage.
    apart: Array
    deviation: Array  # Shape (number,).
    limit: Array  # Shape (number,): in deviations.
    p: float
    by_flight: Array
    since: int
    found: tuple[Found, ...]
    shows: tuple[Shows, ...]


def changed(
    today: Sequence[FlightNumbers], before: Sequence[FlightNumbers], vehicle: VehicleSettings, rng: np.random.Generator
) -> Changed:
    """Hold flights of today against reference flights.

    Each change that is possible is a normal distribution of its sizes against that of unchanged flights, a multivariate
    t; its evidence is the ratio of both densities. It may be there from any flight of today on. The largest evidence
    counts, against the largest that unchanged flights have, searched alike. Besides, each number is held against its
    own limit, whatever is known to change it. The only threshold is the rate of false alarms, half of it for each test.

    `today`, `before`: at least one each; today's of one day. Raises InputError if the flights have no number in common.
    """
    names = common_numbers([*before, *today])
    if not names:
        raise InputError("flights of today and of the reference have no number in common; import the same signals")
    if {flight.commanded for flight in [*before, *today]} == {True, False}:
        names = tuple(name for name in names if not name.startswith("thrust "))
    reference = Reference.of(before, names, vehicle)
    own = judged(today, reference, vehicle, rng, range(len(today)))
    lost = [name for name in common_numbers(before) if not all(name in flight.values for flight in today)]
    turned = tuple(name for name in lost if any(name in flight.reversed for flight in today))
    missing = tuple(name for name in lost if name not in turned)
    nothing = tuple(name for name in missing if any(_likelier_nothing(name, flight, before) for flight in today))
    hover, hover_deviation = _in_common(reference, today)
    mean, scatter = reference.mean, reference.apart(before)[0]
    columns = (mean, own.deviation, own.limit * own.deviation, (mean + own.apart).T, (mean + scatter).T)
    keys = ("reference", "deviation", "limit", "today", "before")
    return Changed(
        p=own.p,
        false_alarm=FALSE_ALARM,
        reversed=turned,
        numbers=tuple(
            NumberToday(name=name, unit=unit_of(name), **dict(zip(keys, row, strict=True)))
            for name, *row in zip(names, *columns, strict=True)
        ),
        shows=own.shows,
        today=tuple(flight.name for flight in today),
        reference_flights=tuple(flight.name for flight in before),
        commanded=today[0].commanded,
        by_flight=own.by_flight,
        since_flight=own.since,
        hover=hover,
        hover_deviation=hover_deviation,
        fewest=FEWEST,
        missing=missing,
        undetermined=nothing,
        causes=own.found,
    )


def _in_common(reference: Reference, today: Sequence[FlightNumbers]) -> tuple[float, float]:
    """Compute the mean share of thrust today less that of the reference, logarithm, and its standard deviation."""
    shares = np.array([name.startswith("thrust ") for name in reference.names])
    if not shares.any():
        return np.nan, np.nan
    apart, covariance = reference.apart(today)
    mean = shares / shares.sum()
    return float((apart @ mean).mean()), float(np.sqrt(mean @ covariance @ mean))


def _likelier_nothing(name: str, flight: FlightNumbers, before: Sequence[FlightNumbers]) -> bool:
    """Check whether a ratio that may be zero is nearer to that than to what it is in the reference.

    One that is badly identified, as in a quiet hover, agrees with the reference as well as with zero.
    """
    usual = float(np.mean([own.values[name] for own in before]))
    # The scale of a gyroscope is the inverse of the ratio that is fitted.
    ratio = np.exp(-usual if name.startswith("scale ") else usual)
    return any(own.name == name and own.ratio < _NEARER * ratio for own in flight.unsure)


def judged(
    today: Sequence[FlightNumbers],
    reference: Reference,
    vehicle: VehicleSettings,
    rng: np.random.Generator,
    starts: Sequence[int] = (0,),
) -> Judged:
    """Hold flights of today against a reference, as `changed`.

    `starts`: flights from which on it may be changed, up to the last: the clearest one counts, as it does in
    chance.
    """
    names = reference.names
    apart, covariance = reference.apart(today)
    listed, kinds = causes(names, vehicle), kinds_of(names)
    limit = number_limits(reference.freedom, len(starts))

    def held(flights: Sequence[FlightNumbers], asked: int) -> _Held:
        """Hold flights against what they, and no others of today, can be off by."""
        rows, own = reference.apart(flights)
        space = _Space(own, reference.freedom, listed, kinds)
        mean = space.whitened(rows.mean(axis=0))
        return _Held(
            space,
            mean,
            float(space.strongest(mean[:, None])[0]),
            furthest(space.deviations(mean), reference.freedom, asked),
        )

    of_starts = [held(today[start:], len(starts)) for start in starts]
    drawn = drawn_by_chance(rng, kinds, reference.freedom, [len(today) - start for start in starts], _DRAWS)
    most = np.array([own.space.strongest(rows) for own, rows in zip(of_starts, drawn, strict=True)])
    chance, alone = np.sort(most.max(axis=0)), np.sort(most[-1])
    best = max(range(len(starts)), key=lambda at: (-of_starts[at].p_value(chance), of_starts[at].evidence))
    p_value, since, found = of_starts[best].p_value(chance), starts[best], list[tuple[Cause, Found]]()
    known = [flight.cable_m for flight in today if np.isfinite(flight.cable_m)]
    cable = float(np.median(known)) if known else np.nan
    if p_value <= FALSE_ALARM:
        found = _found(of_starts[best], chance, cable)
    if found:
        since = _since(of_starts[best].space, apart, [cause for cause, _ in found], starts)
        found = _found(of_starts[list(starts).index(since)], chance, cable) or found
    space, threshold, first = of_starts[0].space, float(np.quantile(chance, 1 - EACH_TEST)), dict[str, int]()
    for index in space.searched:
        first.setdefault(listed[index].name, index)
    sizes = {index: space.shows(index, threshold, limit, drawn[0][:, :_SHOWN]) for index in first.values()}
    return Judged(
        apart,
        np.sqrt(np.diag(covariance)),
        limit,
        p_value,
        np.array([held([flight], 1).p_value(alone) for flight in today]),
        since,
        tuple(each for _, each in found),
        tuple(Shows(cause=listed[at].name, unit=listed[at].unit, smallest=size) for at, size in sizes.items()),
    )


def drawn_by_chance(
    rng: np.random.Generator, kinds: Sequence[str], freedom: Array, counts: Sequence[int], draws: int
) -> Array:
    """Draw means of so many of the last flights of an unchanged day, whitened, shape (count, number, draw).

    Each kind has a scatter of its own to be off by; numbers of two kinds do not go together.
    """
    _, first, kind = np.unique([list(KINDS).index(each) for each in kinds], return_index=True, return_inverse=True)
    scale = np.sqrt(freedom[first] / rng.chisquare(freedom[first], (draws, len(first))))[:, kind]
    day, own = rng.normal(size=(2, draws, len(kind)))
    means, total, flights = [], np.zeros_like(own), 0
    for count in sorted(counts):
        # The mean of so many of them, of which some are in the mean before.
        total, flights = total + np.sqrt(count - flights) * rng.normal(size=own.shape), count
        means.append((scale * (np.sqrt(_IN_COMMON) * day + np.sqrt(1 - _IN_COMMON) * total / count)).T)
    order = np.argsort(np.argsort(counts, kind="stable"), kind="stable")
    return np.array(means)[order]


def beyond_chance(chance: Array, value: float) -> float:
    """Compute how probable a value of at least this size is, held against draws of chance."""
    return float((1 + (chance >= value).sum()) / (1 + len(chance)))


_Part = tuple[Array, list[IntArray], IntArray]
"""Directions, the numbers of each kind that they move, and which of them are losses."""


class _Space:
    """Densities of numbers under no change and under each one, as mixtures of normal ones."""

    def __init__(self, covariance: Array, freedom: Array, listed: Sequence[Cause], kinds: Sequence[str]) -> None:
        self.listed, self.freedom = listed, freedom.tolist()
        self.root = np.linalg.cholesky(covariance)
        self.deviation = np.sqrt(np.diag(covariance))
        own = np.array([np.array(kinds) == kind for kind in dict.fromkeys(kinds)])
        self.of_kind, self.numbers = own, list(map(np.flatnonzero, own))
        self.white = [self.whitened(cause.directions) for cause in listed]
        self.searched = [index for index, cause in enumerate(listed) if cause.searched]
        self.prior = np.log([cause.prior for cause in listed])
        self.searched_prior = np.log([listed[index].searched for index in self.searched])
        self._parted: dict[tuple[bytes, int], list[tuple[list[IntArray], IntArray]]] = {}

    def whitened(self, apart: Array) -> Array:
        """Turn numbers into such that do not go together, of variance 1, along the first axis."""
        return np.asarray(np.linalg.solve(self.root, apart))

    def deviations(self, rows: Array) -> Array:
        """Turn whitened numbers back into deviations of each, along the first axis."""
        return np.asarray(((self.root @ rows).T / self.deviation).T)

    def ways(self, name: str) -> list[int]:
        """List the ways in which a change shows."""
        return [index for index, cause in enumerate(self.listed) if cause.name == name]

    def strongest(self, rows: Array) -> Array:
        """Compute the logarithm of the largest evidence of a change, shape (row,)."""
        return np.asarray((self.evidence(rows, self.searched) + self.searched_prior[:, None]).max(axis=0))

    def evidence(self, rows: Array, of: Sequence[int], given: Array | None = None) -> Array:
        """Compute the logarithm of the evidence of changes, without what was believed before, shape (cause, row).

        `rows`, shape (number, row): whitened.
        `given`, shape (number, size): whitened directions of changes that are there anyway.
        """
        base = rows[:, :0] if given is None else given
        known: dict[tuple[bytes, ...], Array] = {}

        def density(key: tuple[bytes, ...], part: _Part) -> Array:
            if key not in known:
                known[key] = self._density(rows, *part)
            return known[key]

        without = self._moved(base, _NONE)

        def gained(own: Array, losses: int) -> Array:
            moved = self._moved(np.hstack([base, own]), base.shape[1] + np.arange(losses))
            total = np.zeros(rows.shape[1])
            # What neither moves is as likely with a change as without.
            for one, other, sign in ((moved, without, 1), (without, moved, -1)):
                for key in (key for key in one if key not in other):
                    total += sign * density(key, one[key])
            return total

        widths = np.log([[share] for _, share in _WIDTHS])
        return np.array(
            [
                _total(widths + [gained(width * self.white[index], self.listed[index].losses) for width, _ in _WIDTHS])
                for index in of
            ]
        )

    def _density(self, rows: Array, directions: Array, kinds: Sequence[IntArray], losses: IntArray) -> Array:
        """Compute the logarithm of the density of whitened rows, but for what all have in common, shape (row,)."""
        return _total(self._posterior(rows, directions, kinds, losses)[0])

    def _moved(self, directions: Array, losses: IntArray) -> dict[tuple[bytes, ...], _Part]:
        """Part numbers into such that no direction moves together, by what distinguishes them.

        `losses`, shape (loss,): directions whose sizes are nearly always above 0.
        """
        found: dict[tuple[bytes, ...], _Part] = {}
        for kinds, columns in self._parts(directions):
            own, lost = directions[:, columns], np.flatnonzero((columns[:, None] == losses).any(axis=1))
            found[np.concatenate(kinds).tobytes(), own.tobytes(), lost.tobytes()] = own, kinds, lost
        return found

    def _parts(self, directions: Array) -> list[tuple[list[IntArray], IntArray]]:
        """Part the kinds into such that no direction moves together: the numbers of each kind, and the directions."""
        moves = self.of_kind @ (directions != 0.0)
        # Directions of many sizes, and of many rows, move the same.
        key = moves.tobytes(), moves.shape[1]
        if key not in self._parted:
            self._parted[key] = list(self._linked(moves))
        return self._parted[key]

    def _linked(self, moves: BoolArray) -> Iterator[tuple[list[IntArray], IntArray]]:
        linked = np.eye(len(moves), dtype=bool) | (moves @ moves.T)
        for _ in range(len(moves).bit_length()):
            linked = linked @ linked
        for part in np.unique(linked, axis=0):
            yield [self.numbers[kind] for kind in np.flatnonzero(part)], np.flatnonzero(moves[part].any(axis=0))

    def _posterior(
        self, rows: Array, directions: Array, kinds: Sequence[IntArray], losses: IntArray
    ) -> tuple[Array, Array, Array]:
        """Integrate over sizes, at nodes of how far each kind scatters relative to what was learned.

        Each kind is a multivariate t of its own: it is independent of how the others scatter.

        `rows`, shape (number, row): whitened.
        `losses`, shape (loss,): directions whose sizes are nearly always above 0.
        Result `logarithm`, shape (node, row): of the density, with the weight of the node, but for what all have in
        common.
        Result `mean`: shape (node, size, row).
        Result `covariance`: shape (node, size, size).
        """
        precise, weights = _scatters(tuple(self.freedom[own[0]] for own in kinds))

        def over_kinds(each: Sequence[Array]) -> Array:
            return np.asarray((precise @ np.reshape(each, (len(each), -1))).reshape(len(precise), *each[0].shape))

        moves = [directions[own] for own in kinds]
        precision = np.eye(directions.shape[1]) + over_kinds([own.T @ own for own in moves])
        shown = over_kinds([own.T @ rows[numbers] for own, numbers in zip(moves, kinds, strict=True)])
        covariance = np.asarray(np.linalg.inv(precision), dtype=float)
        mean = covariance @ shown
        logarithm = over_kinds([(rows[own] ** 2).sum(axis=0) for own in kinds])
        logarithm -= (shown * mean).sum(axis=1)
        size = np.linalg.slogdet(precision)[1] - np.log(precise) @ [len(own) for own in kinds]
        logarithm = (weights - 0.5 * size)[:, None] - 0.5 * logarithm
        if len(losses):
            logarithm += _losing(mean[:, losses], np.diagonal(covariance, axis1=1, axis2=2)[:, losses])
        return logarithm, mean, covariance

    def sizes(self, row: Array, chosen: Sequence[int], of: int) -> tuple[Estimate, ...]:
        """Estimate the sizes of one of several changes that are there, in its unit.

        Any reported size counts as as likely; a prior of what is usual would draw large ones in.
        """
        first = sum(self.white[index].shape[1] for index in chosen[: chosen.index(of)])
        own = np.arange(first, first + self.listed[of].reported)
        directions = np.hstack([self.white[index] for index in chosen])
        directions[:, own] *= _ANY
        moved = [kinds for kinds, columns in self._parts(directions) if np.isin(own, columns).any()]
        logarithm, means, covariance = self._posterior(row[:, None], directions, list(chain(*moved)), _NONE)
        share = np.exp(logarithm - logarithm.max())
        share /= share.sum()
        means, variances = means[:, own, 0], np.diagonal(covariance, axis1=1, axis2=2)[:, own]
        mean = (share * means).sum(axis=0)
        error = np.sqrt((share * (variances + (means - mean) ** 2)).sum(axis=0))
        cause = self.listed[of]
        shown = _ANY * cause.usual * (mean + np.outer([0.0, -_HALF_WIDTH, _HALF_WIDTH], error))
        ends = (map(cause.size, each) for each in shown.T)
        return tuple(Estimate(value=value, low=low, high=high) for value, low, high in ends)

    def shows(self, index: int, threshold: float, limit: Array, drawn: Array) -> float:
        """Find the smallest size of a change that shows with 90 %, in its unit; infinite where none does.

        By its evidence, or by any number beyond its limit.
        """
        cause = self.listed[index]

        def is_enough(size: float) -> bool:
            rows = drawn + size * self.white[index][:, :1]
            clear = self.evidence(rows, [index])[0] + np.log(cause.searched) >= threshold
            beyond = (np.abs(self.deviations(rows)) > limit[:, None]).any(axis=0)
            return bool(np.mean(clear | beyond) >= _POWER)

        first = bisect_left(_SIZES, x=True, key=is_enough)
        return cause.size(_SIZES[first] * cause.usual) if first < len(_SIZES) else float("inf")


class _Held(NamedTuple):
    """Flights that are held against what they can be off by."""

    space: _Space
    mean: Array  # Shape (number,): whitened.
    evidence: float  # Logarithm of the largest evidence of a change.
    furthest: float  # At most how probable it is that any number is as far off.

    def p_value(self, chance: Array) -> float:
        """Compute how probable it is that an unchanged vehicle looks as much changed, by either test."""
        return either(beyond_chance(chance, self.evidence), self.furthest)


def _total(logarithm: Array) -> Array:
    """Add up densities over nodes, shape (row,)."""
    most = logarithm.max(axis=0)
    share = logarithm - most
    return np.asarray(most + np.log(np.exp(share, out=share).sum(axis=0)))


@cache
def _scatters(freedom: tuple[float, ...]) -> tuple[Array, Array]:
    """Give nodes of the precision of each kind, shape (node, kind), and the logarithms of their weights, shape (node,).

    Inverse chi-squared distributions of so many degrees of freedom, by the trapezoidal rule over their logarithms, from
    three deviations below what was learned to the scatter that numbers far off ask for.
    """
    count = min(_NODES, int(_MOST_NODES ** (1 / len(freedom))))
    each = []
    for own in freedom:
        near = 3 * np.sqrt(2 / own)
        logarithms = np.linspace(-np.log1p(near), np.log1p(max(near, _FARTHEST**2 / own)), count)
        weights = -own / 2 * (logarithms + np.expm1(-logarithms))
        each.append((np.exp(-logarithms), weights - np.log(np.exp(weights).sum())))
    precise, weights = (np.stack(np.meshgrid(*nodes, indexing="ij"), axis=-1) for nodes in zip(*each, strict=True))
    return precise.reshape(-1, len(freedom)), weights.sum(axis=-1).ravel()


def _losing(mean: Array, variance: Array) -> Array:
    """Compute the logarithm of what the sign of losses adds to a density, shape (scale, row).

    Of two losses as if they were independent.

    `mean`: shape (scale, loss, row); `variance`, shape (scale, loss): of the size of each.
    """
    from scipy.special import ndtr

    above = ndtr(mean / np.sqrt(variance)[:, :, None])
    return np.asarray(np.log(2 * (1 - _LOSES) + 2 * (2 * _LOSES - 1) * above).sum(axis=1))


def _found(held: _Held, chance: Array, cable: float) -> list[tuple[Cause, Found]]:
    """Name one change after another while each is significant conditional on the others.

    Where something is off and no change by itself explains it, the first counts on credit: two at once hide each
    other.
    """
    space, row, _, _ = held

    @cache
    def believed(*there: int) -> Array:
        return _beliefs(space, row, there)

    chosen: list[int] = []
    while len(chosen) < _MOST:
        evidence = _evidence_given(space, row, space.searched, chosen) + space.searched_prior
        best = int(np.argmax(evidence))
        if chosen and beyond_chance(chance, float(evidence[best])) > EACH_TEST:
            break
        chosen.append(space.searched[best])
        # What came first was chosen for what the others do too.
        for _ in range(2 * len(chosen)):
            others = chosen[1:]
            beliefs = believed(*sorted(others))
            of_name = _by_name(space, beliefs)
            most = max(of_name, key=lambda name: of_name[name])
            chosen = [*others, max(space.ways(most), key=lambda at: beliefs[at])]
    if len(chosen) == 1 and beyond_chance(chance, held.evidence) > EACH_TEST:
        return []
    found = []
    for index in chosen:
        beliefs = believed(*sorted({*chosen} - {index}))
        cause, of_name = space.listed[index], _by_name(space, beliefs)
        order = sorted(of_name, key=lambda name: -of_name[name])
        listed = (name for name in order if name != cause.name and of_name[name] >= LISTED)
        sure = float(sum(belief for other, belief in zip(space.listed, beliefs, strict=True) if cause.holds(other)))
        # The way that leaves most open.
        widest = max(space.ways(cause.name), key=lambda at: space.white[at].shape[1])
        sizes = space.sizes(row, [widest if other == index else other for other in chosen], widest)
        made = Found(
            name=cause.name,
            named=sure >= NAMED,
            belief=sure,
            unit=cause.unit,
            cable_m=cable if cause.name == CABLE else None,
            sizes=sizes,
            alike=tuple(Alike(name=name, belief=of_name[name]) for name in listed),
        )
        found.append((cause, made))
    return found


def _by_name(space: _Space, beliefs: Array) -> dict[str, float]:
    """Add up the belief in each change over the ways in which it shows."""
    of_name = {cause.name: 0.0 for cause in space.listed}
    for cause, belief in zip(space.listed, beliefs.tolist(), strict=True):
        of_name[cause.name] += belief
    return of_name


def _beliefs(space: _Space, row: Array, there: Sequence[int]) -> Array:
    """Compute the belief in each change given those that are there, shape (cause,)."""
    evidence = _evidence_given(space, row, range(len(space.listed)), there) + space.prior
    share = np.exp(evidence - evidence.max())
    return np.asarray(share / share.sum())


def _since(space: _Space, apart: Array, found: Sequence[Cause], starts: Sequence[int]) -> int:
    """Find the flight before which flights are nearest to the reference, and from which on to each other.

    Along what was found: what else flights of a day have in common says nothing of it.
    """
    along = np.hstack([space.whitened(cause.directions[:, : cause.reported]) for cause in found])
    shown = space.whitened(apart.T).T @ np.linalg.svd(along, full_matrices=False)[0]

    def apart_from(start: int) -> float:
        after = shown[start:]
        return float((shown[:start] ** 2).sum() + ((after - after.mean(axis=0)) ** 2).sum())

    return min(starts, key=apart_from)


def _evidence_given(space: _Space, row: Array, of: Sequence[int], there: Sequence[int]) -> Array:
    """Compute the logarithm of the evidence of changes given those that are there, shape (cause,)."""
    given = np.hstack([space.white[index] for index in there]) if there else None
    names = {space.listed[index].name for index in there}
    rotors = frozenset[str]().union(*(space.listed[index].rotors for index in there))
    causes_of = [space.listed[index] for index in of]
    known = [cause.name in names or bool(cause.rotors & rotors) for cause in causes_of]
    return np.where(known, -np.inf, space.evidence(row[:, None], of, given)[:, 0])
