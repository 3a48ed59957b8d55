"""All flights as one linear system: what is left, what stays free, and what each candidate would explain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.effects.signals import Signals
from cpfls_cli.gap.balance.weak_flight import Candidate, WeakFlight, actuated, nuisance


@dataclass(frozen=True)
class System:
    """The balance of all flights under a hypothesis; windows of all flights one after another.

    Attributes
    ----------
    flights : tuple of WeakFlight
    chosen : tuple of Candidate
        Effects of the hypothesis.
    signals : tuple of Signals
        Of each flight, with the actuator effects among `chosen` applied.
    cache : dict
        Columns by effect and shape.
    """

    flights: tuple[WeakFlight, ...]
    chosen: tuple[Candidate, ...]
    signals: tuple[Signals, ...]
    cache: dict[tuple[str, tuple[float, ...]], Array] = field(default_factory=dict, repr=False)

    def columns(self, candidate: Candidate) -> Array:
        """Evaluate a candidate; a flight that lacks a signal it needs has zeros.

        Returns
        -------
        array, shape (window, 6, coefficient)
        """
        key = (candidate.effect.name, tuple(candidate.shape.values()))
        if key not in self.cache:
            self.cache[key] = self._evaluate(candidate)
        return self.cache[key]

    @cached_property
    def residual(self) -> Array:
        """What inertia and rotors leave, without the effects of unit coefficient; shape (window, 6)."""
        pairs = zip(self.flights, self.signals, strict=True)
        left = np.concatenate([flight.averaged(flight.residual(signals)) for flight, signals in pairs])
        for candidate in self.chosen:
            if candidate.effect.kind == "wrench" and candidate.effect.unit_coefficient:
                left = left - self.columns(candidate)[..., 0]
        return left

    @cached_property
    def base(self) -> Array:
        """Columns that are free: the vehicle's parameters, then the chosen effects; shape (window, 6, column)."""
        return np.concatenate([self.columns(candidate) for candidate in self.free], axis=2)

    @cached_property
    def rotor_wrench(self) -> Array:
        """Torque and force of the rotors, averaged over the windows; shape (window, 6)."""
        pairs = zip(self.flights, self.signals, strict=True)
        return np.concatenate([flight.windows.average(signals.wrench) * flight.known for flight, signals in pairs])

    @property
    def free(self) -> tuple[Candidate, ...]:
        """Candidates with columns in `base`, in their order."""
        return (nuisance(), *(candidate for candidate in self.chosen if is_free(candidate)))

    @cached_property
    def flight_index(self) -> IntArray:
        """Number of the flight of each window, shape (window,)."""
        return np.repeat(np.arange(len(self.flights)), [len(flight) for flight in self.flights])

    def can(self, candidate: Candidate) -> bool:
        """Tell whether any flight has the signals that a candidate needs."""
        return any(not candidate.effect.missing(signals) for signals in self.signals)

    def _evaluate(self, candidate: Candidate) -> Array:
        rows = [
            None if candidate.effect.missing(signals) else flight.rows(candidate, signals)
            for flight, signals in zip(self.flights, self.signals, strict=True)
        ]
        width = max((there.shape[2] for there in rows if there is not None), default=0)
        return np.concatenate(
            [
                np.zeros((len(flight), 6, width)) if there is None else there
                for flight, there in zip(self.flights, rows, strict=True)
            ]
        )


def system(flights: Sequence[WeakFlight], chosen: Sequence[Candidate] = ()) -> System:
    """Set up the balance of flights under a hypothesis."""
    signals = tuple(actuated(flight.signals, chosen) for flight in flights)
    return System(tuple(flights), tuple(chosen), signals)


def is_free(candidate: Candidate) -> bool:
    """Tell whether an effect has columns with free coefficients."""
    return candidate.effect.kind == "wrench" and not candidate.effect.unit_coefficient
