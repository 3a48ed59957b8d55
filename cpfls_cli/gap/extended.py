"""A model with effects: rigid body or identified model, evaluated, refitted with them, and judged on unseen flights."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.consistency.check import Audit
from cpfls_cli.dynamics import InertiaModel
from cpfls_cli.effects.signals import Signals
from cpfls_cli.errors import ComputationError, InputError
from cpfls_cli.gap.balance.balance_system import System, is_free, system
from cpfls_cli.gap.balance.refine import refined
from cpfls_cli.gap.balance.weak_flight import CHANNELS, Candidate, Preparation, WeakFlight, nuisance
from cpfls_cli.gap.naming.by_instruments import by_instruments, unidentified_axes
from cpfls_cli.gap.naming.estimate import Estimates, effect_sentence, fitted
from cpfls_cli.gap.naming.held_out import HeldOut, held_out
from cpfls_cli.gap.naming.noisy_rate import with_noisy_rate
from cpfls_cli.gap.naming.ranking import best_floor
from cpfls_cli.gap.naming.results import NamedEffect
from cpfls_cli.gap.residual.air import in_air, known_motion
from cpfls_cli.gap.settings import VISIBLE, GapSettings
from cpfls_cli.weak_form.windows import common_windows


class FittedEffect(NamedTuple):
    """An effect of a model with its linear coefficients."""

    candidate: Candidate
    linear: Array  # Shape (coefficient,): of its columns; empty where everything is in the shape.


@dataclass(frozen=True)
class ExtendedModel:
    """A model with effects; without any and with zero parameters it is the base."""

    base: InertiaModel | None  # None for the rigid body of the vehicle.
    # Shape (parameter,): relative errors of the vehicle's own numbers, in the order of the catalogue.
    parameters: Array
    effects: tuple[FittedEffect, ...] = ()
    audit: Audit | None = None  # Faults of the sensors, which are taken out of signals first.

    @classmethod
    def of(cls, base: InertiaModel | None, hypothesis: System, estimates: Estimates, audit: Audit) -> ExtendedModel:
        """Build the model that a fit found."""
        fitted = tuple(FittedEffect(*pair) for pair in zip(hypothesis.chosen, estimates.of_effect, strict=True))
        return cls(base, estimates.of_vehicle, fitted, audit)

    @property
    def chosen(self) -> tuple[Candidate, ...]:
        """Effects with their shapes."""
        return tuple(effect.candidate for effect in self.effects)

    @property
    def linear(self) -> Array:
        """Coefficients in the order of `System.base`."""
        return np.concatenate([self.parameters, *(e.linear for e in self.effects if is_free(e.candidate))])

    def repaired(self, signals: Signals) -> Signals:
        """Correct the signals for the faults of the sensors."""
        return signals if self.audit is None else self.audit.repaired(signals)

    def system(self, flights: Sequence[WeakFlight]) -> System:
        """Set up the balance of flights under the model's effects.

        `flights`: made with `base`, of repaired signals.
        Raises InputError if a flight lacks a signal that an effect needs.
        """
        for flight, candidate in product(flights, self.chosen):
            missing = candidate.effect.missing(flight.signals)
            if missing:
                lacking = ", ".join(each.replace("_", " ") for each in missing)
                name = candidate.effect.name
                raise InputError(f"{flight.name}: lacks {lacking}, which the model's effect {name} needs")
        return system([replace(flight, turns=np.ones_like(flight.turns)) for flight in flights], self.chosen)

    def residual(self, flights: Sequence[WeakFlight]) -> Array:
        """Compute the gap that the model leaves, shape (window, 6), N m and N."""
        hypothesis = self.system(flights)
        return hypothesis.residual_at(self.linear)


def plain(base: InertiaModel | None) -> ExtendedModel:
    """Make a model without effects."""
    return ExtendedModel(base, np.zeros(len(nuisance().effect.coefficients)))


@dataclass(frozen=True)
class Refit:
    """A refitted model with effects and its residuals on held-out flights."""

    model: ExtendedModel
    effects: tuple[NamedEffect, ...]  # With refitted numbers.
    estimates: Estimates
    unseen: HeldOut


def extend(
    training: Sequence[Signals],
    held: Sequence[Signals],
    effects: Sequence[NamedEffect],
    audit: Audit,
    settings: GapSettings,
    base: InertiaModel | None,
    gusty_floor: Array | None = None,
    first: Refit | None = None,
) -> Refit:
    """Refit a model together with effects and evaluate it on held-out flights.

    `effects`: to become part of the model; shapes start from theirs.
    `audit`: faults of the sensors that are repaired.
    `base`: None for the rigid body of the vehicle.
    `gusty_floor`, shape (6,), N m and N: noise floor with the gusts of the flights, above which the numbers come by
    instruments; None for no gusts.
    `first`: of the model as given, with which that of another vehicle is compared; None for that of the flights.
    Raises ComputationError if the gap on the held-out flights does not shrink in the channels that change.
    """
    prepared = Preparation(common_windows([*training, *held], settings), base, settings, audit)
    flights, logged, repaired = prepared.repaired(training), prepared.logged(held), prepared.repaired(held)
    if gusty_floor is not None:
        flights, logged, repaired = (in_air(each, gusty_floor) for each in (flights, logged, repaired))
    chosen = [effect.candidate for effect in effects if effect.candidate is not None]
    start = refined(flights, chosen, best_floor(system(flights, chosen)))
    floor = best_floor(start)
    found = fitted(flights, start.chosen, floor, settings)
    if gusty_floor is not None:
        given = known_motion(training)
        unidentified = unidentified_axes(found, given)
        flights, logged, repaired = ([f.as_stated(unidentified) for f in each] for each in (flights, logged, repaired))
        found = by_instruments(fitted(flights, start.chosen, floor, settings), given)
    hypothesis, estimates, *_ = with_noisy_rate(found)
    unseen = held_out(logged, repaired, hypothesis, estimates.linear, floor)
    if first is not None:
        unseen = replace(unseen, before=first.unseen.before, parameters=first.unseen.parameters)
    _require_smaller(unseen)
    model = ExtendedModel.of(base, hypothesis, estimates, audit)
    return Refit(model, tuple(renewed(effects, hypothesis, estimates)), estimates, unseen)


def _require_smaller(unseen: HeldOut) -> None:
    before, after = unseen.size(unseen.before).floors, unseen.size(unseen.after).floors
    moved = unseen.size(unseen.before - unseen.after).floors > VISIBLE
    if not moved.any():
        raise ComputationError("not extended: what is named changes no channel of the held-out flights by its noise")
    if (after[moved] ** 2).sum() >= (before[moved] ** 2).sum():
        sizes = ", ".join(f"{CHANNELS[c]} {before[c]:.3g} -> {after[c]:.3g} floors" for c in np.flatnonzero(moved))
        raise ComputationError(f"not extended: the gap on the held-out flights does not shrink: {sizes}")


def renewed(effects: Sequence[NamedEffect], hypothesis: System, estimates: Estimates) -> list[NamedEffect]:
    """Give effects the numbers of a fit."""
    fitted = {
        candidate.effect.name: (candidate, linear, numbers)
        for candidate, linear, numbers in zip(hypothesis.chosen, estimates.of_effect, estimates.effects, strict=True)
    }
    known = []
    for effect in effects:
        if effect.candidate is None:
            known.append(effect)
            continue
        candidate, linear, numbers = fitted[effect.name]
        sentence = effect_sentence(candidate.effect, numbers, hypothesis.vehicle)
        known.append(replace(effect, shape=candidate.shape, linear=linear, numbers=numbers, sentence=sentence))
    return known
