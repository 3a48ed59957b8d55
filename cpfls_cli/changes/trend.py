"""When a vehicle changed: many flights in time, and the flights from which on their numbers are others."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.changes.judge import beyond_chance, judged
from cpfls_cli.changes.numbers import KINDS, FlightNumbers, unit_of
from cpfls_cli.changes.reference import (
    EACH_TEST,
    FALSE_ALARM,
    FEWEST,
    Reference,
    either,
    expected_covariance,
    furthest,
    kinds_of,
    learned_covariance,
    number_limits,
)
from cpfls_cli.changes.results import FlightInTime, NumberInTime, Shift, Trend
from cpfls_cli.errors import InputError
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.words import joined

if TYPE_CHECKING:
    from ruptures import KernelCPD

_DRAWS = 1000  # Rows of unchanged flights that chance is drawn from.
_AT_ONCE = 3  # Change points whose gain is shared when a row is held against chance.


def trend(
    flights: Sequence[FlightNumbers], vehicle: VehicleSettings, rng: np.random.Generator, reference: int | None = None
) -> Trend:
    """Find the flights from which on a vehicle is another one; numbers and limits of each flight with it.

    Numbers are whitened by the covariance of flights that follow each other, which a change between two of them hardly
    touches. Change points are those of least squares with a penalty for each (PELT), the one that rows of an unchanged
    vehicle exceed at the rate of false alarms: the same number of flights, drawn, whitened and searched alike.

    `flights`: in time order.
    `reference`: how many of the first flights are the reference: by default half of them, or those before the first
    change, and at least three.
    Raises InputError if there are fewer flights than the reference and one more, or ruptures is not installed.
    Reference: Killick, Fearnhead and Eckley 2012, Optimal detection of changepoints with a linear computational cost,
    JASA 107(500). Truong, Oudre and Vayatis 2020, Selective review of offline change point detection methods, Signal
    Processing 167.
    """
    names, kept = most_complete(flights)
    without = [flight for flight in flights if not any(flight is each for each in kept)]
    turned = [(flight.name, [name for name in flight.reversed if name in names]) for flight in without]
    if len(kept) < (reference or FEWEST) + 1:
        raise InputError(
            f"flights with the same numbers: {len(kept)}, and a trend needs {(reference or FEWEST) + 1} at least, "
            "those of the reference and one more"
        )
    first = reference or max(FEWEST, len(kept) // 2)
    learned = Reference.of(kept[:first], names, vehicle)
    row = Row.of(kept, learned, vehicle)
    of_points, starts = change_points(row, rng)
    if reference is None and starts:
        first = max(FEWEST, min(first, starts[0]))
    held = Reference.of(kept[:first], names, vehicle)
    apart, deviation = _apart(held, kept)
    deviations, asked = apart / deviation, len(kept) - first
    limit = number_limits(held.freedom, asked)
    return Trend(
        p=either(of_points, furthest(deviations[first:], held.freedom, asked)),
        false_alarm=FALSE_ALARM,
        reversed=tuple(f"{name}: {joined(which)} reversed, or nothing" for name, which in turned if which),
        left_out=tuple(flight.name for flight in without),
        flights=tuple(
            FlightInTime(
                flight=flight.name,
                flown_at_s=flight.flown_at_s,
                reference=at < first,
                part=1 + sum(start <= at for start in starts),
                beyond=tuple(name for name, is_beyond in zip(names, beyond, strict=True) if is_beyond),
            )
            for at, (flight, beyond) in enumerate(zip(kept, np.abs(deviations) > limit, strict=True))
        ),
        numbers=tuple(
            NumberInTime(
                name=name,
                unit=unit_of(name),
                reference=float(held.mean[at]),
                values=held.mean[at] + apart[:, at],
                deviation=deviation[:, at],
                limit=float(limit[at]),
            )
            for at, name in enumerate(names)
        ),
        shifts=tuple(_shifts(row, kept, starts, vehicle, rng, apart, deviation)),
        shows=judged(kept[first : first + 1], held, vehicle, rng).shows,
    )


def most_complete(flights: Sequence[FlightNumbers]) -> tuple[tuple[str, ...], list[FlightNumbers]]:
    """Choose the numbers, and the flights that have all of them, such that they are the most together."""
    every = list(dict.fromkeys(name for flight in flights for name in flight.values))
    if {flight.commanded for flight in flights} == {True, False}:
        every = [name for name in every if not name.startswith("thrust ")]
    count = {name: sum(name in flight.values for flight in flights) for name in every}
    best: tuple[tuple[str, ...], list[FlightNumbers]] = ((), [])
    for least in sorted(set(count.values()), reverse=True):
        names = tuple(name for name in every if count[name] >= least)
        kept = [flight for flight in flights if all(name in flight.values for name in names)]
        if len(names) * len(kept) > len(best[0]) * len(best[1]):
            best = names, kept
    if not best[0]:
        raise InputError("the flights have no number in common; import the same signals")
    return best


def _shifts(
    row: Row,
    flights: Sequence[FlightNumbers],
    starts: Sequence[int],
    vehicle: VehicleSettings,
    rng: np.random.Generator,
    apart: Array,
    deviation: Array,
) -> Iterator[Shift]:
    """Judge the flights from each change point on against those before, with the scatter that is left in all parts."""
    inside = np.vstack([part - part.mean(axis=0) for part in np.split(row.values, starts)])
    scatter, freedom = learned_covariance(inside, float(len(inside) - len(starts) - 1), row.expected, row.names)
    bounds = [0, *starts, len(flights)]
    for before, start, end in zip(bounds, bounds[1:], bounds[2:], strict=False):
        # What flights after it have in common by chance, as those of one day, is no less than what one has.
        covariance = scatter * (1 + 1 / (start - before))
        own = replace(Reference.of(flights[before:start], row.names, vehicle), covariance=covariance, freedom=freedom)
        change = judged(flights[start:end], own, vehicle, rng)
        step = apart[start:end].mean(axis=0) - apart[before:start].mean(axis=0)
        yield Shift(
            since=flights[start].name,
            flight=start + 1,
            flown_at_s=flights[start].flown_at_s,
            p=change.p,
            deviations=step / deviation[start:end].mean(axis=0),
            causes=change.found,
        )


def _apart(reference: Reference, flights: Sequence[FlightNumbers]) -> tuple[Array, Array]:
    """Compute how far each flight is from the reference, and by how much one usually is, shape (flight, number)."""
    each = [reference.apart([flight]) for flight in flights]
    deviation = np.array([np.sqrt(np.diag(covariance)) for _, covariance in each])
    return np.vstack([apart for apart, _ in each]), deviation


@dataclass(frozen=True)
class Row:
    """Flights one after another, and what is expected of such a row."""

    names: tuple[str, ...]
    values: Array  # Shape (flight, number).
    expected: Array  # Shape (number, number): covariance of a flight before any is seen.
    # Shape (flight, number): standard deviation of what numbers of a kind have in common by the voltage, whose effect
    # is not known well.
    voltage: Array
    noise: Array  # Shape (flight, number): standard deviation by which a flight is less certain than others.
    # Shape (flight, number): standard deviation of what is not known for how agile a flight is flown; half of its
    # variance numbers of a kind have in common.
    agility: Array
    turned: Array  # Shape (flight, number): the same by turning, which all of a flight have in common.

    @classmethod
    def of(cls, flights: Sequence[FlightNumbers], reference: Reference, vehicle: VehicleSettings) -> Row:
        """Gather what a row is held against."""
        names = reference.names
        lower = np.log([flight.voltage / reference.voltage for flight in flights])
        known = np.where(np.isfinite(lower), lower, 0.0)
        expected = expected_covariance(flights, names, vehicle)
        measured = np.array([[flight.errors[name] for name in names] for flight in flights]) ** 2
        return cls(
            names,
            _apart(reference, flights)[0],
            expected,
            voltage=np.outer(known, reference.voltage_error),
            noise=np.sqrt(np.maximum(measured - measured.mean(axis=0), 0.0)),
            agility=np.outer(reference.more_agile(flights), reference.agility_error),
            turned=reference.turned_more(flights),
        )

    def covariance(self, values: Array) -> tuple[Array, Array]:
        """Learn the covariance of a row from its differences, and give its degrees of freedom."""
        steps = len(values) - 1
        # Each flight is in two of them.
        freedom = 2 * steps**2 / (3 * steps - 1)
        differences = np.diff(values, axis=0) * np.sqrt(0.5 * freedom / steps)
        return learned_covariance(differences, freedom, self.expected, self.names)

    def whitened(self, values: Array) -> Array:
        """Turn a row into one of numbers that do not go together, of variance 1."""
        root = np.linalg.cholesky(self.covariance(values)[0])
        return np.ascontiguousarray(np.linalg.solve(root, values.T).T)

    def unchanged(self, rng: np.random.Generator, count: int) -> Iterator[Array]:
        """Draw such rows of unchanged vehicles: of each kind its covariance (inverse Wishart), then the flights."""
        covariance, freedom = self.covariance(self.values)
        root, size = np.linalg.cholesky(covariance), len(covariance)
        kind = np.unique([list(KINDS).index(each) for each in kinds_of(self.names)], return_inverse=True)[1]
        for _ in range(count):
            drawn = np.empty((size, len(self.values)))
            for own in (kind == each for each in range(kind.max() + 1)):
                # Bartlett's decomposition of a Wishart matrix.
                many, left = own.sum(), freedom[own][0]
                lower = np.tril(rng.normal(size=(many, many)), -1)
                lower += np.diag(np.sqrt(rng.chisquare(left + many - 1 - np.arange(many))))
                white = np.linalg.solve(lower.T, rng.normal(size=(many, len(self.values))))
                drawn[own] = np.sqrt(left) * (root[np.ix_(own, own)] @ white)
            noise = rng.normal(size=self.noise.shape) * self.noise
            noise += rng.normal() * self.turned
            noise += np.sqrt(0.5) * (rng.normal(size=size) + rng.normal(size=size)[kind]) * self.agility
            yield drawn.T + rng.normal(size=size)[kind] * self.voltage + noise


def change_points(row: Row, rng: np.random.Generator) -> tuple[float, list[int]]:
    """Find change points, and how probable the clearest of them are where nothing changed."""
    chance = np.array([_gain(row.whitened(drawn)) for drawn in row.unchanged(rng, _DRAWS)])
    white = row.whitened(row.values)
    p_value = beyond_chance(chance, _gain(white))
    if p_value > EACH_TEST:
        return p_value, []
    penalty = float(np.quantile(chance, 1 - EACH_TEST))
    return p_value, [int(each) for each in _search(white).predict(pen=penalty)[:-1]]


def _gain(white: Array) -> float:
    """Compute by how much change points lower the sum of squares, each: of one, two or three the most."""
    search = _search(white)
    sums = np.vstack([np.zeros(white.shape[1]), np.cumsum(white, axis=0)])

    def explained(bounds: Sequence[int]) -> float:
        """Give what means of parts take off the sum of squares about 0."""
        ends = [0, *bounds]
        return float(((np.diff(sums[ends], axis=0) ** 2).sum(axis=1) / np.diff(ends)).sum())

    counts = range(min(_AT_ONCE, len(white) - 1), 0, -1)
    whole = explained([len(white)])
    return max((explained(search.predict(n_bkps=count)) - whole) / count for count in counts)


def _search(white: Array) -> KernelCPD:
    # Of a linear kernel: least squares.
    return load_ruptures()(kernel="linear", min_size=1).fit(white)


def load_ruptures() -> type[KernelCPD]:
    """Load the search for change points."""
    from ruptures import KernelCPD

    return KernelCPD  # type: ignore[no-any-return]
