"""What structures of a vehicle are judged by: parts kept aside in turn, and the errors there, computed or predicted."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.blocks import ENOUGH_BLOCKS
from cpfls_cli.errors import InputError
from cpfls_cli.gauss_newton import damped_step
from cpfls_cli.playback.fit import FitWindows, WindowSet, windows_of
from cpfls_cli.playback.flight import PlaybackFlight
from cpfls_cli.playback.groups import JointNumbers
from cpfls_cli.playback.parameters import SLOW
from cpfls_cli.playback.settings import PlaybackSettings
from cpfls_cli.words import joined

_STEP_S = 0.01
"""Longest step of the runs that structures are compared by; what is kept is fitted at all samples."""

_QUICK = 100
"""Windows of a quick search at most."""

_UNSEEN = 3.0
"""How many times as fast about an axis a part turns, at least, that is nothing like the others."""

_DAMPING = 1e-3
"""Share of the diagonal: that of the first step of a fit."""


def parts_of(flights: Sequence[PlaybackFlight], settings: PlaybackSettings) -> list[list[FitWindows]]:
    """Split flights into parts that are kept aside in turn: neighbours in their order, or pieces of each.

    Neighbours are kept aside together because flights of one kind usually stand side by side: what a model has to
    predict is a kind of flight that it has not seen. Pieces are taken of a single flight, and where a part turns about
    an axis about which hardly anything turns in the others: no model can be asked for what nothing identifies.
    `InputError` where a flight shows nothing that a model predicts, or all are too short.
    """
    flown = sum(len(flight) * flight.motion.period for flight in flights)
    most = min(settings.search_windows, _QUICK) if settings.quick else settings.search_windows
    interval = max(settings.window_interval_s, flown / most)
    windows = windows_of(flights, settings.horizon_s, interval, _STEP_S)
    for each in windows:
        if not each.loss.weight.any():
            raise InputError(
                f"{each.flight.name}: no body rate changes, and no attitude was measured, so that no prediction of a "
                "model can be judged; log body rates or attitude"
            )
    count = min(settings.folds, len(windows))
    ends = np.linspace(0, len(windows), count + 1).round().astype(int).tolist()
    together = [windows[start:end] for start, end in pairwise(ends)]
    if count > 1 and not _lacks_an_axis(together):
        return together
    cut = [_pieces(each, settings.folds) for each in windows]
    parts = [part for pieces in zip(*cut, strict=True) if (part := [piece for piece in pieces if len(piece.starts)])]
    if len(parts) < 2:
        raise InputError(
            f"{joined(flight.name for flight in flights)}: too short for a horizon of {settings.horizon_s:g} s to be "
            "judged; give longer flights, or set a shorter playback.horizon_s"
        )
    return parts


def _pieces(windows: FitWindows, count: int) -> list[FitWindows]:
    """Cut the windows of a flight; those that reach into the next piece are left out, so that none shares a sample."""
    pieces = np.array_split(windows.starts, count)
    ends = [*(piece[0] if len(piece) else np.inf for piece in pieces[1:]), np.inf]
    samples = windows.every * windows.horizon
    kept = [piece[piece + samples < end] for piece, end in zip(pieces, ends, strict=True)]
    return [replace(windows, starts=piece) for piece in kept]


def _lacks_an_axis(parts: Sequence[Sequence[FitWindows]]) -> bool:
    """Tell whether a part turns about an axis about which hardly anything turns in the others."""
    squares = np.array([sum((each.motion.rate**2).sum(axis=0) for each in part) for part in parts])
    samples = np.array([sum(len(each.motion.rate) for each in part) for part in parts])[:, None]
    others = np.sqrt((squares.sum(axis=0) - squares) / (samples.sum() - samples))
    return bool(np.any(np.sqrt(squares / samples) > _UNSEEN * others))


def block_errors(errors: Sequence[Array]) -> Array:
    """Take the means of errors by flight, which is what is independent; few of them are cut."""
    blocks = _blocks([len(each) for each in errors])
    pairs = zip(errors, blocks, strict=True)
    return np.array([each[own == block].mean() for each, own in pairs for block in range(own[-1] + 1)])


def _blocks(counts: Sequence[int]) -> list[IntArray]:
    """Say which block each window of a flight is in, from the numbers of the windows."""
    pieces = -(-ENOUGH_BLOCKS // len(counts))
    found = (np.array_split(np.zeros(count), min(pieces, count)) for count in counts)
    return [np.repeat(np.arange(len(own)), [len(piece) for piece in own]) for own in found]


@dataclass(frozen=True)
class Outlook:
    """Loss of free runs near values of numbers, to second order, by pieces of the flights; sums, in scales.

    A model with fewer numbers has the others at where they are absent, and one with more has them there at first: both
    are predicted by the step that a fit would take from there, without each part and then judged on it. Errors of the
    step make what is predicted too large rather than too small, as the loss grows by less than the square. Rao 1948
    (score test); Lawless and Singhal 1978 (subsets from one fit by its Hessian).
    """

    free: JointNumbers
    values: Array
    loss: Array
    gradient: Array
    hessian: Array
    count: IntArray
    part: IntArray

    @classmethod
    def of(cls, free: JointNumbers, values: Array, windows: WindowSet, part: IntArray) -> Outlook:
        """Evaluate runs and their derivatives once; pieces are the blocks of `block_errors`."""
        pieces, scale = _blocks(windows.counts.tolist()), free.scales
        errors = zip(pieces, windows.errors(free, values), strict=True)
        loss = [np.bincount(own, each) for own, each in errors]
        gradient, hessian = zip(*windows.derivatives(free, values, pieces), strict=True)
        return cls(
            free,
            values,
            np.concatenate(loss),
            np.concatenate(gradient) * scale,
            np.concatenate(hessian) * scale[:, None] * scale,
            np.concatenate([np.bincount(own) for own in pieces]),
            np.repeat(part, [len(own) for own in loss]),
        )

    @property
    def blocks(self) -> set[str]:
        """Blocks of the models that are predicted."""
        return {number.block for number in self.free.numbers}

    def errors(self, blocks: Collection[str]) -> Array:
        """Predict the mean errors of a model of some of the blocks, on each piece, shape (piece,)."""
        own, errors = self._own(blocks), np.empty(len(self.loss))
        for part, mean in enumerate(self._without):
            step, aside = self._step(mean, own), self.part == part
            slope = self.gradient[aside] + 0.5 * self.hessian[aside] @ step
            errors[aside] = (self.loss[aside] + slope @ step) / self.count[aside]
        return errors

    def start(self, blocks: Collection[str]) -> dict[str, float]:
        """Predict the values of the fit of a model of some of the blocks to all parts, by name."""
        step = self._step(self._mean(self.part >= 0), self._own(blocks))
        return self.free.named(self.values + self.free.scales * step)

    @cached_property
    def _without(self) -> list[tuple[Array, Array]]:
        """Gradient and Hessian of the mean objective without each part."""
        return [self._mean(self.part != part) for part in range(int(self.part.max()) + 1)]

    def _mean(self, kept: BoolArray) -> tuple[Array, Array]:
        prior, count = self.free.prior, self.count[kept].sum()
        gradient = self.gradient[kept].sum(axis=0) / count - prior.pull(self.values / self.free.scales)
        return gradient, self.hessian[kept].sum(axis=0) / count + np.diag(prior.precision)

    @cached_property
    def _room(self) -> tuple[Array, Array, Array]:
        """How far numbers are from where they are absent, and from their bounds, in scales."""
        free, scale = self.free, self.free.scales
        # Without shares of slow actuation its time constant says nothing.
        absent = [value if n.name == SLOW else n.absent for n, value in zip(free.numbers, self.values, strict=True)]
        gone, low, high = ((each - self.values) / scale for each in (np.array(absent), free.lows, free.highs))
        return gone, np.minimum(low, 0.0), np.maximum(high, 0.0)

    def _step(self, mean: tuple[Array, Array], own: BoolArray) -> Array:
        """Step to the fit of some of the numbers, the others absent, in scales, shape (number,)."""
        (gradient, hessian), (gone, low, high) = mean, self._room
        step = np.where(own, 0.0, gone)
        moved = (gradient + hessian @ step)[own]
        step[own] = damped_step(hessian[np.ix_(own, own)], moved, _DAMPING, low[own], high[own])
        return step

    def _own(self, blocks: Collection[str]) -> BoolArray:
        """Tell which numbers a model of some of the blocks has; what is not known of a vehicle every one has."""
        held = {*blocks, *self.free.base.vehicle.unknown}
        return np.array([number.block in held for number in self.free.numbers], dtype=bool)
