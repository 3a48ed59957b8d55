"""All flights as one linear system: residual, free columns, columns of candidates, and noise."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.optimize import minimize_scalar

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.effects.effect import Columns, Shape
from cpfls_cli.effects.signals import Signals
from cpfls_cli.gap.balance.noise_floor import negligible, noise_floor
from cpfls_cli.gap.balance.weak_flight import Candidate, CandidateKey, WeakFlight, actuated, columns_of, nuisance
from cpfls_cli.gap.settings import CLEAR, NOISE
from cpfls_cli.vehicle.settings import VehicleSettings


@dataclass(frozen=True)
class System:
    """The balance of all flights under a hypothesis; windows of all flights one after another."""

    flights: tuple[WeakFlight, ...]
    chosen: tuple[Candidate, ...]  # Effects of the hypothesis.
    signals: tuple[Signals, ...]  # Of each flight, with the actuator effects among `chosen` applied.
    cache: dict[CandidateKey, Array] = field(default_factory=dict, repr=False)  # Columns by effect and shape.

    def columns(self, candidate: Candidate) -> Array:
        """Evaluate a candidate, shape (window, 6, coefficient); zeros for a flight that lacks a signal it needs."""
        if candidate.key not in self.cache:
            pairs = zip(self.flights, self.signals, strict=True)
            rows = [None if candidate.effect.missing(signals) else f.rows(candidate, signals) for f, signals in pairs]
            width = max((there.shape[2] for there in rows if there is not None), default=0)
            known = (np.zeros((len(f), 6, width)) if r is None else r for f, r in zip(self.flights, rows, strict=True))
            found = np.concatenate(list(known))
            self.cache[candidate.key] = found * self.turns if candidate.effect.kind == "parameter" else found
        return self.cache[candidate.key]

    @property
    def turns(self) -> Array:
        """Numbers of the vehicle, shape (parameter,), 1 for those that any flight can show: they are those of all."""
        return np.asarray(np.max([flight.turns for flight in self.flights], axis=0))

    def shown_in(self, flights: Sequence[WeakFlight]) -> list[WeakFlight]:
        """Hold other flights to what these show of the vehicle, also one that would not show it by itself."""
        return [replace(flight, turns=self.turns) for flight in flights]

    def by_flight(self, make: Callable[[WeakFlight, Signals], Array]) -> Array:
        """Compute rows from each flight and its signals, shape (window, ...)."""
        return np.concatenate(
            [make(flight, signals) for flight, signals in zip(self.flights, self.signals, strict=True)]
        )

    @cached_property
    def residual(self) -> Array:
        """Residual of inertial and rotor wrench, and of effects of unit coefficient; shape (window, 6)."""
        residual = self.by_flight(lambda flight, signals: flight.averaged(flight.residual(signals)))
        for candidate in self.fixed:
            residual = residual - self.columns(candidate)[..., 0]
        return residual

    def residual_at(self, linear: Array) -> Array:
        """Compute the residual with coefficients of `base`, shape (window, 6), N m and N."""
        return np.asarray(self.residual - self.base @ linear)

    @cached_property
    def base(self) -> Array:
        """Columns that are free: the vehicle's parameters, then the chosen effects; shape (window, 6, column)."""
        return np.concatenate([self.columns(candidate) for candidate in self.free], axis=2)

    @cached_property
    def places(self) -> tuple[tuple[Candidate, slice], ...]:
        """Candidates with columns in `base`, each with the place of its own."""
        widths = [self.columns(candidate).shape[2] for candidate in self.free]
        ends = np.cumsum(widths).tolist()
        return tuple((each, slice(end - width, end)) for each, width, end in zip(self.free, widths, ends, strict=True))

    @cached_property
    def noise(self) -> Array:
        """Noise like that of `base`, and of `residual` in the last column; shape (window, 6, column + 1)."""
        inertial = self.by_flight(lambda flight, _: flight.noise(flight.inertial)[..., None])
        return np.concatenate([*map(self._noise, self.free), inertial], axis=2)

    def _noise(self, candidate: Candidate) -> Array:
        def of_flight(flight: WeakFlight, signals: Signals) -> Array:
            if candidate.effect.missing(signals):
                return np.zeros((len(flight), 6, self.columns(candidate).shape[2]))
            return flight.noise(columns_of(candidate, signals))

        key = ("noise", *candidate.key)
        if key not in self.cache:
            found = self.by_flight(of_flight)
            self.cache[key] = found * self.turns if candidate.effect.kind == "parameter" else found
        return self.cache[key]

    @cached_property
    def rotor_wrench(self) -> Array:
        """Torque and force of the rotors, averaged over the windows; shape (window, 6)."""
        return self.by_flight(lambda flight, signals: flight.windows.average(signals.wrench) * flight.known)

    @property
    def vehicle(self) -> VehicleSettings:
        """The vehicle that flew."""
        return self.flights[0].signals.vehicle

    @property
    def shapes(self) -> list[Shape]:
        """Shapes of the chosen effects, in their order."""
        return [shape for candidate in self.chosen for shape in candidate.effect.shapes]

    @property
    def shape_values(self) -> Array:
        """Their values, shape (shape,)."""
        return np.array([candidate.shape[s.name] for candidate in self.chosen for s in candidate.effect.shapes])

    def with_shapes(self, values: Array) -> System:
        """Move the shapes of all chosen effects."""
        following = iter(values.tolist())
        chosen = tuple(each.at({s.name: next(following) for s in each.effect.shapes}) for each in self.chosen)
        before, after = ([each.key for each in own if each.effect.apply] for own in (self.chosen, chosen))
        if before != after:
            return system(self.flights, chosen)
        # Where nothing that changes signals moves, all other columns are what they were.
        stay = {each.key for each in (nuisance(), *chosen)}
        return replace(
            self, chosen=chosen, cache={key: own for key, own in self.cache.items() if {key, key[1:]} & stay}
        )

    def following(self, linear: Array) -> Array:
        """Give what coefficients, shape (column,), say of the shapes, within their bounds; NaN for nothing.

        An effect knows its own and those of the vehicle.
        """
        (vehicle, own), *_ = self.places
        of_vehicle = dict(zip((each.name for each in vehicle.effect.coefficients), linear[own], strict=True))
        places, values = {each.effect.name: place for each, place in self.places}, list[float]()
        for each in self.chosen:
            said = each.following(linear[places.get(each.effect.name, slice(0))], of_vehicle)
            values += [said.get(shape.name, np.nan) for shape in each.effect.shapes]
        return np.array(values)

    def followed(self, numbers: Array) -> Array:
        """Let shapes follow the coefficients, in rows of both, shape (row, number)."""
        columns = self.base.shape[2]
        said = np.array([self.following(row[:columns]) for row in numbers]).reshape(len(numbers), -1)
        return np.hstack([numbers[:, :columns], np.where(np.isnan(said), numbers[:, columns:], said)])

    @property
    def closely(self) -> System:
        """Average over windows so close that what they see can be followed in time."""
        return system([flight.closely for flight in self.flights], self.chosen)

    @property
    def fixed(self) -> tuple[Candidate, ...]:
        """Chosen candidates that are a part of the residual."""
        return tuple(each for each in self.chosen if each.effect.kind == "wrench" and each.effect.unit_coefficient)

    @property
    def free(self) -> tuple[Candidate, ...]:
        """Candidates with columns in `base`, in their order."""
        return (nuisance(), *(candidate for candidate in self.chosen if is_free(candidate)))

    @cached_property
    def flight_index(self) -> IntArray:
        """Number of the flight of each window, shape (window,)."""
        return np.repeat(np.arange(len(self.flights)), [len(flight) for flight in self.flights])

    @cached_property
    def known(self) -> BoolArray:
        """Which channels each window has, shape (window, 6)."""
        return np.concatenate([np.tile(flight.known, (len(flight), 1)) for flight in self.flights])

    @property
    def gusty(self) -> BoolArray:
        """Channels whose floor holds gusts, shape (6,)."""
        return np.asarray(np.any([flight.air > 0 for flight in self.flights], axis=0))

    @property
    def most_noise(self) -> Array:
        """Mean square in squared floors up to which the residual of each channel is noise, shape (6,).

        In gusts it is as much as a gap begins at: they are drawn anew in each flight, and known to a third.
        """
        return np.where(self.gusty, CLEAR**2, NOISE)

    def can(self, candidate: Candidate) -> bool:
        """Check whether any flight has the signals that a candidate needs."""
        return any(not candidate.effect.missing(signals) for signals in self.signals)


def system(flights: Sequence[WeakFlight], chosen: Sequence[Candidate] = ()) -> System:
    """Set up the balance of flights under a hypothesis."""
    signals = tuple(actuated(flight.signals, chosen) for flight in flights)
    return System(tuple(flights), tuple(chosen), signals)


def has_force(flights: Sequence[WeakFlight]) -> bool:
    """Check whether any flight has the force balance."""
    return any(flight.known[3:].any() for flight in flights)


def channel_size(rows: Array) -> Array:
    """Compute the root mean square of each channel, shape (6,); 1 for channels that no flight has."""
    return np.where(rows.any(axis=0), np.sqrt(np.mean(rows**2, axis=0)), 1.0)


def known_size(rows: Array, known: BoolArray) -> Array:
    """Compute the root mean square of each channel over the windows that know it, shape (6,); NaN where none does."""
    count = known.sum(axis=0)
    square = (rows**2 * known).sum(axis=0) / np.maximum(count, 1)
    return np.asarray(np.sqrt(np.where(count > 0, square, np.nan)))


def is_free(candidate: Candidate) -> bool:
    """Check whether an effect has columns with free coefficients."""
    return candidate.effect.kind == "wrench" and not candidate.effect.unit_coefficient


def floors(hypothesis: System, coefficients: Array) -> Array:
    """Estimate the noise floor of each channel over all flights, the air in it where that is known.

    `coefficients`, shape (column,): of `hypothesis.base`.
    Result: shape (6,), N m and N; 1 for channels that no flight has.
    """
    square, count = np.zeros(6), np.zeros(6)
    for number, flight in enumerate(hypothesis.flights):
        floor = noise_floor(residual_along(hypothesis, number, coefficients), flight.windows, flight.cut_off)
        floor = np.maximum(floor, flight.air)
        square += len(flight) * flight.known * floor**2
        count += len(flight) * flight.known
    noise = np.sqrt(square / np.maximum(count, 1))
    inertial = hypothesis.by_flight(lambda flight, _: flight.motion)
    return np.where(count > 0, np.maximum(noise, negligible(np.mean(inertial**2, axis=0))), 1.0)


def residual_along(hypothesis: System, number: int, coefficients: Array) -> Columns:
    """Compute the residual of a fitted hypothesis along one flight, sample by sample.

    `number`: of the flight; `coefficients`: shape (column,); Result: shape (time, 6).
    """
    flight, signals = hypothesis.flights[number], hypothesis.signals[number]
    residual = flight.residual(signals)
    direct, momentum = residual.direct, residual.momentum
    assert momentum is not None
    parts = [(candidate, coefficients[place]) for candidate, place in hypothesis.places]
    for candidate, linear in [*parts, *((candidate, np.ones(1)) for candidate in hypothesis.fixed)]:
        if not candidate.effect.missing(signals):
            columns = columns_of(candidate, signals)
            direct = direct - columns.direct @ linear
            momentum = momentum if columns.momentum is None else momentum - columns.momentum @ linear
    return Columns(direct * flight.known, momentum * flight.known)


def scatter_variance(hypothesis: System) -> Array:
    """Average over windows the variance of the random part of the chosen effects, for a unit of relative scatter.

    Result: shape (window, 6); zero where no effect scatters.
    """

    def of_flight(flight: WeakFlight, signals: Signals) -> Array:
        total = np.zeros((len(flight), 6))
        for effect, shape in hypothesis.chosen:
            if effect.scatter is not None and not effect.missing(signals):
                total += flight.windows.average(effect.scatter(signals, shape))
        return total * flight.known

    return hypothesis.by_flight(of_flight)


def scatter_size(variance: Array, residual: Array, floor: Array) -> float:
    """Estimate the relative scatter of effects, one number for all channels, by its likelihood in a residual.

    `variance`, shape (window, 6): for a unit of scatter.
    `residual`: shape (window, 6).
    `floor`: shape (6,).
    Result: mean square of the relative scatter over a window; 0 where stretches that should scatter are not
    significant.
    """
    expected = variance / floor**2
    scatters = expected.any(axis=0)
    if not scatters.any():
        return 0.0
    expected, square = expected[:, scatters], (residual / floor)[:, scatters] ** 2

    def scaled(size: float) -> tuple[Array, float]:
        """Give the shape of the variance, and its scale: a residual that is everywhere is no scatter."""
        shape = 1 + size * expected
        return shape, max(1.0, float(np.mean(square / shape)))

    def unlikely(size: float) -> float:
        shape, scale = scaled(size)
        return float(np.sum(np.log(shape * scale) + square / (shape * scale)))

    most = float(np.max(square[expected > 0] / expected[expected > 0]))
    size = float(minimize_scalar(unlikely, bounds=(0.0, most), method="bounded").x) if most > 0 else 0.0
    # One parameter more has to lower the information criterion (Schwarz 1978).
    return size * scaled(size)[1] if unlikely(0.0) - unlikely(size) > np.log(square.size) else 0.0


def window_noise(hypothesis: System, residual: Array, floor: Array) -> Array:
    """Add to the floor of each window what the chosen effects do there at random, shape (window, 6), N m and N.

    `residual`, shape (window, 6): of a fit; the size of the random part is read from it; `floor`: shape (6,).
    """
    variance = scatter_variance(hypothesis)
    return np.asarray(np.sqrt(floor**2 + scatter_size(variance, residual, floor) * variance))
