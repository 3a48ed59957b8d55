"""Extension: named effects become part of a model, everything refitted together, and judged on unseen flights."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.dynamics.equations_of_motion import InertiaModel
from cpfls_cli.errors import ComputationError
from cpfls_cli.gap.balance.balance_system import System, system
from cpfls_cli.gap.balance.recording import Recording, common_windows
from cpfls_cli.gap.balance.refine import refined
from cpfls_cli.gap.balance.weak_flight import CHANNELS
from cpfls_cli.gap.extended import ExtendedModel, FittedEffect
from cpfls_cli.gap.naming.estimate import Estimates, weighted_estimates
from cpfls_cli.gap.naming.held_out import HeldOut, judged_unseen
from cpfls_cli.gap.naming.results import NamedEffect
from cpfls_cli.gap.naming.scatter import scatter_size, scatter_variance
from cpfls_cli.gap.naming.search import best_floor, block_index
from cpfls_cli.gap.naming.told_effect import told_effect
from cpfls_cli.gap.sensors.audit import Audit
from cpfls_cli.gap.sensors.preparation import Preparation
from cpfls_cli.gap.settings import GapSettings

_TOUCHED = 0.2
"""Root mean square in floors by which effects and refit move a channel, from which on it has to get better."""

_CLEAR = 1.5
"""Root mean square in floors of a gap that is there."""

_WORSE = 1.2
"""Ratio from which on a gap has grown."""


@dataclass(frozen=True)
class Extension:
    """A model with effects and how it does.

    Attributes
    ----------
    model : ExtendedModel
    effects : tuple of NamedEffect
        With refitted numbers.
    found : Estimates
    unseen : HeldOut
    """

    model: ExtendedModel
    effects: tuple[NamedEffect, ...]
    found: Estimates
    unseen: HeldOut


def extend(
    training: Sequence[Recording],
    held: Sequence[Recording],
    effects: Sequence[NamedEffect],
    audit: Audit,
    settings: GapSettings,
    base: InertiaModel | None,
) -> Extension:
    """Refit a model together with effects.

    Parameters
    ----------
    training, held : sequence of Recording
    effects : sequence of NamedEffect
        To become part of the model; shapes start from theirs.
    audit : Audit
        Faults of the sensors that are repaired.
    settings : GapSettings
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
    hypothesis = refined(flights, chosen, best_floor(system(flights, chosen)))
    floor = best_floor(hypothesis)
    found = weighted_estimates(hypothesis, floor, block_index(hypothesis, settings))
    left = hypothesis.residual - hypothesis.base @ found.linear
    scatter = scatter_size(scatter_variance(hypothesis), left, floor)
    unseen = judged_unseen(held, prepared, hypothesis, found.linear, scatter)
    _require_smaller(unseen)
    fitted = tuple(FittedEffect(*pair) for pair in zip(hypothesis.chosen, found.of_effect, strict=True))
    width = len(found.linear) - sum(len(linear) for linear in found.of_effect)
    model = ExtendedModel(base, found.linear[:width], fitted, audit)
    return Extension(model, tuple(_renewed(effects, hypothesis, found)), found, unseen)


def _require_smaller(unseen: HeldOut) -> None:
    before, after = unseen.size(unseen.before).floors, unseen.size(unseen.after).floors
    moved = unseen.size(unseen.before - unseen.after).floors > _TOUCHED
    if not moved.any():
        raise ComputationError("not extended: what is named changes no channel of the held-out flights by its noise")
    if (after[moved] ** 2).sum() >= (before[moved] ** 2).sum():
        grown = ", ".join(f"{CHANNELS[c]} {before[c]:.3g} -> {after[c]:.3g} floors" for c in np.flatnonzero(moved))
        raise ComputationError(f"not extended: the gap on the held-out flights does not shrink: {grown}")


def worse_axes(before: Array, after: Array) -> list[int]:
    """List the axes about which a clear gap grows.

    Parameters
    ----------
    before, after : array, shape (6,), floors
    """
    return [int(c) for c in np.flatnonzero((before[:3] > _CLEAR) & (after[:3] > _WORSE * before[:3]))]


def _renewed(effects: Sequence[NamedEffect], hypothesis: System, found: Estimates) -> list[NamedEffect]:
    fitted = {
        candidate.effect.name: (candidate, linear, numbers)
        for candidate, linear, numbers in zip(hypothesis.chosen, found.of_effect, found.effects, strict=True)
    }
    renewed = []
    for effect in effects:
        if effect.candidate is None:
            renewed.append(effect)
            continue
        candidate, linear, numbers = fitted[effect.name]
        told = told_effect(candidate.effect, numbers, hypothesis.flights[0].signals.vehicle)
        renewed.append(replace(effect, candidate=candidate, linear=linear, coefficients=numbers, sentence=told))
    return renewed
