"""The gap on held-out flights, of the model as given and of the model with effects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.errors import InputError
from cpfls_cli.gap.balance.balance_system import (
    System,
    channel_size,
    floors,
    known_size,
    scatter_size,
    scatter_variance,
    system,
)
from cpfls_cli.gap.balance.refine import fit
from cpfls_cli.gap.balance.weak_flight import WeakFlight
from cpfls_cli.gap.naming.results import GapSize
from cpfls_cli.gap.settings import CLEAR, COUNTS, VISIBLE
from cpfls_cli.rounding import largest


@dataclass(frozen=True)
class HeldOut:
    """Residuals of held-out flights under three models.

    Attributes
    ----------
    before : array, shape (window, 6), N m and N
        Of the model as given, on signals as logged.
    parameters : array, shape (window, 6)
        Of the model with its own numbers refitted on the training flights.
    after : array, shape (window, 6)
        Of the model with effects.
    floor : array, shape (6,)
    known : array of bool, shape (window, 6)
    noise : array, shape (window, 6)
        Floor of each window with the scatter that belongs to the effects.
    most_noise : array, shape (6,)
        Mean square of each channel in squared floors up to which it is noise.
    unlearned : mapping of str to float
        Effects of which these flights ask for a number that no flight learned from shows, such as that of a faster
        descent, with the share of the windows that do; nothing is judged there.
    """

    before: Array
    parameters: Array
    after: Array
    floor: Array
    known: BoolArray
    noise: Array
    most_noise: Array
    unlearned: Mapping[str, float]

    def size(self, residual: Array) -> GapSize:
        """Compute the root mean square of a residual, shape (window, 6), by channel."""
        return GapSize(known_size(residual, self.known), known_size(residual / self.noise, self.known))

    def shares(self, *, as_given: bool = False) -> dict[str, float]:
        """Compute the shares of the gap above the noise floor that the effects remove.

        Parameters
        ----------
        as_given : bool
            Of the gap of the model as given, on signals as logged; else of what its own numbers leave.

        Returns
        -------
        dict
            Of ``torque`` and of ``force``, where each is a part of the gap that counts; of the better one where neither
            does.
        """
        before, after = (self.before if as_given else self.parameters) / self.noise, self.after / self.noise
        kinds = [slice(0, 3), slice(3, 6)]
        sizes = [_above(before[:, kind], self.known[:, kind], self.most_noise[kind]) for kind in kinds]
        each = [self.share_removed(before, after, kind) for kind in kinds]
        of_kind = dict(zip(("torque", "force"), each, strict=True))
        clear = {
            name: share
            for (name, share), kind, size in zip(of_kind.items(), kinds, sizes, strict=True)
            if size > COUNTS * sum(sizes) and np.sqrt(np.mean(before[:, kind] ** 2, axis=0)).max() > CLEAR
        }
        better = largest(of_kind, lambda name: of_kind[name])
        return clear or {better: of_kind[better]}

    def share_removed(self, before: Array, after: Array, channels: slice = slice(None)) -> float:
        """Compute the share of a gap, shape (window, 6), in floors, that was removed above the noise.

        0 where nothing is gained; only what is known counts.
        """
        before, after, known = before[:, channels], after[:, channels], self.known[:, channels]
        gone = float(((before**2 - after**2) * known).sum())
        remaining = _above(after, known, self.most_noise[channels])
        return max(0.0, gone / (gone + remaining)) if gone > 0 else 0.0

    def removed_by_numbers(self, least: float) -> Array:
        """Compute the share of each channel's gap that refitted numbers of the vehicle remove, shape (6,).

        0 below visibility, and where no gap is: a mean square of `least` squared floors.
        """
        before, after = self.before / self.noise, self.parameters / self.noise
        rows = np.maximum(self.known.sum(axis=0), 1)
        gone = ((before**2 - after**2) * self.known).sum(axis=0) / rows
        each = [self.share_removed(before, after, slice(c, c + 1)) for c in range(before.shape[1])]
        gap = (before**2 * self.known).sum(axis=0) / rows > least
        return np.where(gap & (gone > VISIBLE**2), each, 0.0)


def _above(residual: Array, known: BoolArray, most_noise: Array) -> float:
    """Sum the squares of the channels above their noise, in squared floors."""
    return float(np.maximum((residual**2 * known).sum(axis=0) - most_noise * known.sum(axis=0), 0.0).sum())


def held_out(
    logged: Sequence[WeakFlight],
    repaired: Sequence[WeakFlight],
    fitted: System,
    linear: Array,
    floor: Array,
) -> HeldOut:
    """Apply a fitted hypothesis to held-out flights, and the model with its own numbers refitted beside it.

    Parameters
    ----------
    logged, repaired : sequence of WeakFlight
        The flights as logged, and after repair of the sensors.
    fitted : System
        Of the training flights.
    linear : array, shape (column,)
    floor : array, shape (6,)
        Of the training flights, above which the effects scatter there.

    Raises
    ------
    InputError
        If they lack a signal that the effects need.
    """
    raw, plain, full = system(logged), system(repaired), system(repaired, fitted.chosen)
    if not all(full.can(candidate) for candidate in (*full.free, *full.chosen)):
        raise InputError("the held-out flights lack a signal that a named effect needs; hold out others")
    # What needs a coefficient whose column is zero in all that was learned from.
    beyond = {
        each.effect.name: (full.columns(each)[..., ~fitted.columns(each).any(axis=(0, 1))] != 0).any(axis=2)
        for each in full.chosen
    }
    known = full.known & ~np.any([np.zeros_like(full.known), *beyond.values()], axis=0)
    here, own = floors(full, linear), system(fitted.flights)
    scatter = scatter_size(scatter_variance(fitted), fitted.left(linear), floor)
    return HeldOut(
        raw.residual,
        plain.left(fit(own, channel_size(own.residual))),
        full.left(linear),
        here,
        known,
        np.sqrt(here**2 + scatter * scatter_variance(full)),
        full.most_noise,
        {name: share for name, there in beyond.items() if (share := float(there.any(axis=1).mean()))},
    )
