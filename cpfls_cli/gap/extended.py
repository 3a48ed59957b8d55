"""A model with effects: rigid body or identified model, evaluated, refitted with them, and judged on unseen flights."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.consistency.audit import Audit
from cpfls_cli.dynamics.equations_of_motion import InertiaModel
from cpfls_cli.effects.effect import Columns
from cpfls_cli.effects.signals import Signals
from cpfls_cli.errors import ComputationError, InputError
from cpfls_cli.gap.balance.balance_system import System, is_free, scatter_size, scatter_variance, system
from cpfls_cli.gap.balance.refine import refined
from cpfls_cli.gap.balance.weak_flight import (
    CHANNELS,
    Balance,
    Candidate,
    WeakFlight,
    nuisance,
    rotation_balance,
    translation_balance,
)
from cpfls_cli.gap.naming.estimate import Estimates, effect_sentence, weighted_estimates
from cpfls_cli.gap.naming.held_out import HeldOut, judged_unseen
from cpfls_cli.gap.naming.ranking import best_floor, block_index
from cpfls_cli.gap.naming.results import NamedEffect
from cpfls_cli.gap.preparation import Preparation
from cpfls_cli.gap.settings import VISIBLE, GapSettings
from cpfls_cli.weak_form.windows import Recording, common_windows


class FittedEffect(NamedTuple):
    """An effect of a model with its linear coefficients.

    Attributes
    ----------
    linear : array, shape (coefficient,)
        Of its columns; empty where everything is in the shape.
    """

    candidate: Candidate
    linear: Array


@dataclass(frozen=True)
class ExtendedModel:
    """A model with effects; without any and with zero parameters it is the base.

    Attributes
    ----------
    base : InertiaModel or None
        None for the rigid body of the vehicle.
    parameters : array, shape (parameter,)
        Relative errors of the vehicle's own numbers, in the order of the catalogue.
    audit : Audit or None
        Faults of the sensors, which are taken out of signals first.
    """

    base: InertiaModel | None
    parameters: Array
    effects: tuple[FittedEffect, ...] = ()
    audit: Audit | None = None

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

        Parameters
        ----------
        flights : sequence of WeakFlight
            Made with `base`, of repaired signals.

        Raises
        ------
        InputError
            If a flight lacks a signal that an effect needs.
        """
        for flight in flights:
            _require(flight.signals, self.chosen, flight.name)
        return system(flights, self.chosen)

    def residual(self, flights: Sequence[WeakFlight]) -> Array:
        """Compute the gap that the model leaves.

        Returns
        -------
        array, shape (window, 6), N m and N
        """
        hypothesis = self.system(flights)
        return np.asarray(hypothesis.residual - hypothesis.base @ self.linear)


def plain(base: InertiaModel | None) -> ExtendedModel:
    """Make a model without effects."""
    return ExtendedModel(base, np.zeros(len(nuisance().effect.coefficients)))


def inertial_torque(signals: Signals, model: InertiaModel | None) -> Array:
    """Compute the body torque that the motion takes.

    Parameters
    ----------
    signals : Signals
        With the faults of sensors taken out.
    model : InertiaModel or None
        None for the rigid body of the vehicle.

    Returns
    -------
    array, shape (time, 3), N m, body frame
    """
    return _at_samples(rotation_balance(signals, model), signals.time)


def inertial_force(signals: Signals) -> Array:
    """Compute the force that the motion takes, without weight.

    Parameters
    ----------
    signals : Signals
        With `has_force`, and the faults of sensors taken out.

    Returns
    -------
    array, shape (time, 3), N, body frame
    """
    return _at_samples(translation_balance(signals), signals.time)


def _at_samples(balance: Balance, time: Array) -> Array:
    return Columns(balance.direct[:, :, None], balance.momentum[:, :, None]).at_samples(np.ones(1), time)


def _require(signals: Signals, chosen: Sequence[Candidate], name: str) -> None:
    for candidate in chosen:
        missing = candidate.effect.missing(signals)
        if missing:
            lacking = ", ".join(each.replace("_", " ") for each in missing)
            raise InputError(f"{name}: lacks {lacking}, which the model's effect {candidate.effect.name} needs")


@dataclass(frozen=True)
class Refit:
    """A refitted model with effects and its residuals on held-out flights.

    Attributes
    ----------
    effects : tuple of NamedEffect
        With refitted numbers.
    """

    model: ExtendedModel
    effects: tuple[NamedEffect, ...]
    estimates: Estimates
    unseen: HeldOut


def extend(
    training: Sequence[Recording],
    held: Sequence[Recording],
    effects: Sequence[NamedEffect],
    audit: Audit,
    settings: GapSettings,
    base: InertiaModel | None,
) -> Refit:
    """Refit a model together with effects and evaluate it on held-out flights.

    Parameters
    ----------
    effects : sequence of NamedEffect
        To become part of the model; shapes start from theirs.
    audit : Audit
        Faults of the sensors that are repaired.
    base : InertiaModel or None
        None for the rigid body of the vehicle.

    Raises
    ------
    ComputationError
        If the gap on the held-out flights does not shrink in the channels that change.
    """
    prepared = Preparation(common_windows([*training, *held], settings), base, settings, audit)
    flights = prepared.repaired(training)
    chosen = [effect.candidate for effect in effects if effect.candidate is not None]
    start = refined(flights, chosen, best_floor(system(flights, chosen)))
    floor = best_floor(start)
    hypothesis, estimates = weighted_estimates(start, floor, block_index(start, settings))
    residual = hypothesis.residual - hypothesis.base @ estimates.linear
    scatter = scatter_size(scatter_variance(hypothesis), residual, floor)
    held_out = judged_unseen(held, prepared, hypothesis, estimates.linear, scatter)
    _require_smaller(held_out)
    fitted = tuple(FittedEffect(*pair) for pair in zip(hypothesis.chosen, estimates.of_effect, strict=True))
    width = len(estimates.linear) - sum(len(linear) for linear in estimates.of_effect)
    model = ExtendedModel(base, estimates.linear[:width], fitted, audit)
    return Refit(model, tuple(_renewed(effects, hypothesis, estimates)), estimates, held_out)


def _require_smaller(held_out: HeldOut) -> None:
    before, after = held_out.size(held_out.before).floors, held_out.size(held_out.after).floors
    moved = held_out.size(held_out.before - held_out.after).floors > VISIBLE
    if not moved.any():
        raise ComputationError("not extended: what is named changes no channel of the held-out flights by its noise")
    if (after[moved] ** 2).sum() >= (before[moved] ** 2).sum():
        sizes = ", ".join(f"{CHANNELS[c]} {before[c]:.3g} -> {after[c]:.3g} floors" for c in np.flatnonzero(moved))
        raise ComputationError(f"not extended: the gap on the held-out flights does not shrink: {sizes}")


def _renewed(effects: Sequence[NamedEffect], hypothesis: System, estimates: Estimates) -> list[NamedEffect]:
    fitted = {
        candidate.effect.name: (candidate, linear, numbers)
        for candidate, linear, numbers in zip(hypothesis.chosen, estimates.of_effect, estimates.effects, strict=True)
    }
    renewed = []
    for effect in effects:
        if effect.candidate is None:
            renewed.append(effect)
            continue
        candidate, linear, numbers = fitted[effect.name]
        sentence = effect_sentence(candidate.effect, numbers, hypothesis.flights[0].signals.vehicle)
        renewed.append(replace(effect, candidate=candidate, linear=linear, coefficients=numbers, sentence=sentence))
    return renewed
