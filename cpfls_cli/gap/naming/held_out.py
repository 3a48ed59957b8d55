"""The gap on held-out flights, of the model as given and with effects; which names it confirms; and if both agree."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.blocks import mean_error
from cpfls_cli.effects.catalogue.parameter_error import NUMBERS, shown
from cpfls_cli.effects.registry import VEHICLE_NUMBERS
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
from cpfls_cli.gap.balance.refine import fit, least_squares
from cpfls_cli.gap.balance.weak_flight import CHANNELS, WeakFlight
from cpfls_cli.gap.naming.estimate import NamedFit, Refusal, channel_weight, estimates, on_bound, size_in_floors
from cpfls_cli.gap.naming.open_questions import bends_of, unexplained_channels
from cpfls_cli.gap.naming.ranking import RankedStep, block_index, rank_effects, unbeaten
from cpfls_cli.gap.naming.results import GapSize
from cpfls_cli.gap.settings import CLEAR, COUNTS, ERRORS, NOISE, OFF, VISIBLE
from cpfls_cli.rounding import apart, ascending, largest, levelled, smallest
from cpfls_cli.words import spoken


@dataclass(frozen=True)
class HeldOut:
    """Residuals of held-out flights under three models."""

    before: Array  # Shape (window, 6), N m and N: of the model as given, on signals as logged.
    # Shape (window, 6): of the model with its own numbers refitted on the training flights, its inertia in gusts with
    # the effects.
    parameters: Array
    after: Array  # Shape (window, 6): of the model with effects.
    floor: Array  # Shape (6,).
    known: BoolArray  # Shape (window, 6).
    noise: Array  # Shape (window, 6): floor of each window with the scatter that belongs to the effects.
    most_noise: Array  # Shape (6,): mean square of each channel in squared floors up to which it is noise.
    # Effects of which these flights ask for a number that no flight learned from shows, such as that of a faster
    # descent, with the share of the windows that do; nothing is judged there.
    unlearned: Mapping[str, float]
    # Shape (window, 6): of the model with effects and numbers as given, all else refitted; None in gusts, where a fit
    # takes the numbers of the loop.
    stated: Array | None = None

    def size(self, residual: Array) -> GapSize:
        """Compute the root mean square of a residual, shape (window, 6), by channel."""
        return GapSize(known_size(residual, self.known), known_size(residual / self.noise, self.known))

    def shares(self, *, as_given: bool = False) -> dict[str, float]:
        """Compute the shares of the gap above the noise floor that the effects remove.

        `as_given`: of the gap of the model as given, on signals as logged; else of that with its own parameters
        refitted.
        Result: of ``torque`` and of ``force``, where each is a part of the gap that counts; of the better one where
        neither does.
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

    @property
    def closed_by_numbers(self) -> bool:
        """Whether the gap of the model as given is clear, and none with its own numbers refitted."""
        given, own = (self.size(each).floors for each in (self.before, self.parameters))
        return bool((given > CLEAR).any() and not (own > CLEAR).any())

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
        removed = [self._removed(self.before, self.parameters, least)]
        if self.stated is not None and not (self.size(self.after).floors > CLEAR).any():
            # What effects do may hide what numbers do; where no gap is left, for else numbers fill in for formulas:
            # what is wrong about one axis moves what an effect does about all.
            removed.append(self._removed(self.stated, self.after, least))
        return np.asarray(np.max(removed, axis=0))

    def _removed(self, before: Array, after: Array, least: float) -> Array:
        before, after = before / self.noise, after / self.noise
        rows = np.maximum(self.known.sum(axis=0), 1)
        gone = ((before**2 - after**2) * self.known).sum(axis=0) / rows
        each = [self.share_removed(before, after, slice(c, c + 1)) for c in range(before.shape[1])]
        gap = (before**2 * self.known).sum(axis=0) / rows > least
        return np.where(gap & (gone > VISIBLE**2), each, 0.0)


def _above(residual: Array, known: BoolArray, most_noise: Array) -> float:
    """Sum the squares of the channels above their noise, in squared floors."""
    return float(np.maximum((residual**2 * known).sum(axis=0) - most_noise * known.sum(axis=0), 0.0).sum())


def held_out(
    logged: Sequence[WeakFlight], repaired: Sequence[WeakFlight], fitted: System, linear: Array, floor: Array
) -> HeldOut:
    """Apply a fitted hypothesis to held-out flights, and the model with its own parameters refitted.

    `logged`, `repaired`: the flights as logged, and after repair of the sensors.
    `fitted`: of the training flights.
    `linear`: shape (column,).
    `floor`, shape (6,): of the training flights, above which the effects scatter there.
    Raises InputError if they lack a signal that the effects need.
    """
    repaired = fitted.shown_in(repaired)
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
    numbers = _own_numbers(own, linear[: own.base.shape[2]]) if full.gusty.any() else fit(own, floor)
    scatter = scatter_size(scatter_variance(fitted), fitted.residual_at(linear), floor)
    return HeldOut(
        raw.residual,
        plain.residual_at(numbers),
        full.residual_at(linear),
        here,
        known,
        np.sqrt(here**2 + scatter * scatter_variance(full)),
        full.most_noise,
        {name: share for name, there in beyond.items() if (share := float(there.any(axis=1).mean()))},
        None if full.gusty.any() else full.residual_at(_with_stated(fitted, floor)),
    )


def _with_stated(fitted: System, floor: Array) -> Array:
    """Refit all but the vehicle's numbers of the config, which are as it states them, shape (column,)."""
    numbers, own = np.zeros(fitted.base.shape[2]), [each.name for each in VEHICLE_NUMBERS.coefficients]
    free = np.append(~np.isin(own, list(NUMBERS)), np.ones(len(numbers) - len(own), dtype=bool))
    matrix = (fitted.base[..., free] / floor[:, None]).reshape(fitted.residual.size, -1)
    numbers[free] = least_squares(matrix, (fitted.residual / floor).reshape(-1))
    return numbers


def _own_numbers(own: System, with_effects: Array) -> Array:
    """Refit the vehicle's own numbers without effects in gusts, shape (column,).

    Inertia and couplings of rates stay those with effects: a fit takes those of the loop, which do what effects do.
    """
    of_loop, size = shown(np.zeros(3, dtype=bool)) == 0, channel_size(own.residual)
    numbers = np.where(of_loop, with_effects, 0.0)
    matrix, left = own.base[..., ~of_loop] / size[:, None], own.residual_at(numbers) / size
    numbers[~of_loop] = least_squares(matrix.reshape(left.size, -1), left.reshape(-1))
    return numbers


class Judgement(NamedTuple):
    """Effects with their residual on held-out flights."""

    found: NamedFit
    held_out: HeldOut


@dataclass(frozen=True)
class Judge:
    """Judges fits on held-out flights."""

    training: Sequence[WeakFlight]
    logged: Sequence[WeakFlight]  # Held out, as logged.
    repaired: Sequence[WeakFlight]  # The same, after repair of the sensors.
    rng: np.random.Generator

    def judge(self, found: NamedFit) -> Judgement:
        """Evaluate effects on the held-out flights, and the model with its own parameters refitted."""
        linear = found.estimates.linear
        return Judgement(found, held_out(self.logged, self.repaired, found.hypothesis, linear, found.floor))

    def unknown(self, unseen: HeldOut) -> Array:
        """Compute what effects leave of each channel where that is clear, relative to the motion, shape (6,)."""
        after, moved = unseen.size(unseen.after), system(self.repaired).by_flight(lambda flight, _: flight.motion)
        motion = known_size(moved, unseen.known)
        return np.where(after.floors > CLEAR, after.value / np.where(motion > 0, motion, 1e-12), 0.0)

    def confirmed(self, first: Judgement) -> tuple[Judgement, list[Refusal]]:
        """Drop effects one by one that the held-out flights do not confirm: first what harms, then what is not needed.

        Nothing is chosen by these flights; names only go.
        """
        judgement, refusals = first, []
        while (refusal := self._refused(judgement)) is not None:
            refusals.append(refusal)
            judgement = self.judge(judgement.found.without([refusal.name]))
        return judgement, refusals

    def _refused(self, judgement: Judgement) -> Refusal | None:
        # What was dropped may have held another effect within what is possible.
        beyond = on_bound(judgement.found)
        names = [each.effect.name for each in judgement.found.hypothesis.chosen]
        if beyond is not None or not names:
            return beyond
        compared = {name: self._without(judgement, name) for name in names}
        after = judgement.held_out.size(judgement.held_out.after).floors
        harm = {name: one.worsened(after) for name, one in compared.items()}
        worst = largest(harm, lambda name: float(harm[name].max()))
        if harm[worst].any():
            channel = int(np.argmax(harm[worst]))
            without, with_it = apart(compared[worst].left[channel], after[channel], 2)
            return Refusal(
                worst,
                f"on the held-out flights it makes the {CHANNELS[channel]} worse, "
                f"{without} floors without it and {with_it} with it",
                harms=True,
            )
        least = smallest(compared, lambda each: compared[each].visibly)
        if compared[least].visibly < VISIBLE**2:
            return Refusal(least, "on the held-out flights the gap is as small without it")
        return _bent(judgement, compared) or _filling(judgement, compared)

    def harmed(self, judgement: Judgement, before: Judgement) -> bool:
        """Check whether what a fit has more than one before makes a channel surely and visibly worse."""
        after = judgement.held_out.size(judgement.held_out.after).floors
        return bool(self._compared(judgement, before.found, before.held_out.after).worsened(after).any())

    def _without(self, judgement: Judgement, name: str) -> Without:
        """Leave an effect out and refit the others."""
        without = judgement.found.without([name])
        there = system(without.hypothesis.shown_in(self.repaired), without.hypothesis.chosen)
        return self._compared(judgement, without, there.residual_at(without.estimates.linear))

    def _compared(self, judgement: Judgement, without: NamedFit, residual: Array) -> Without:
        """Compare a fit with the residual, shape (window, 6), that another one leaves of the same flights."""
        there = system(without.hypothesis.shown_in(self.repaired), without.hypothesis.chosen)
        unseen = judgement.held_out
        squares = [((each / unseen.noise) ** 2) * unseen.known for each in (residual, unseen.after)]
        count = np.maximum(unseen.known.sum(axis=0), 1)
        difference, block = squares[0] - squares[1], block_index(there, without.settings)
        sums = np.array([difference[block == number].sum(axis=0) for number in np.unique(block)])
        spread = len(sums) * mean_error(sums) if len(sums) > 1 else np.zeros(6)
        left = np.sqrt(squares[0].sum(axis=0) / count)
        return Without(difference.sum(axis=0) / count, spread / count, left, there.gusty)


class Without(NamedTuple):
    """Held-out flights without one of the effects, the others refitted."""

    raised: Array  # Shape (6,): mean square of each channel beyond that with the effect, in squared floors.
    error: Array  # Shape (6,): standard error of it over blocks.
    left: Array  # Shape (6,): root mean square without it, in floors.
    gusts: BoolArray = np.zeros(6, dtype=bool)  # Shape (6,): channels whose floor holds gusts.

    @property
    def seen(self) -> Array:
        """By how much the gap of each channel is larger without it; what is below the floor without it is noise.

        The floor of gusts that are drawn anew is above most of them: below it counts what is surely larger.
        """
        surely = self.gusts & (self.raised > ERRORS * self.error)
        return np.where((self.left > 1.0) | surely, self.raised, 0.0)

    @property
    def visibly(self) -> float:
        """By how much the gap is larger without it, squared floors."""
        return float(self.seen.max())

    def worsened(self, after: Array) -> Array:
        """Compute how much worse the effect makes channels with `after` floors, as ratios; 0 if unsure."""
        surely = -self.raised > ERRORS * self.error
        worse = (after > CLEAR) & (after > (1 + OFF) * self.left) & surely
        return np.where(worse, after / np.maximum(self.left, 1e-9), 0.0)


def _bent(judgement: Judgement, compared: Mapping[str, Without]) -> Refusal | None:
    """Find an effect that another named one, whose formula bends over speed or height, surely explains more without.

    Of several the smallest.
    """
    hypothesis, _, _, settings = judgement.found
    for name in ascending(compared, lambda each: compared[each].visibly):
        others = [each for each in hypothesis.chosen if each.effect.name != name]
        bends = bends_of(others, hypothesis.flights)
        if not bends:
            continue
        own = next(each for each in hypothesis.chosen if each.effect.name == name)
        step = rank_effects(hypothesis.flights, others, bends, settings, None, also=(own,))
        scored = next(each for each in step.ranking if each.candidate.effect.name == name)
        best = step.ranking[0]
        # One that is refused for another reason is compared with nothing.
        if best.gain > scored.gain > -np.inf and not unbeaten(best, [scored], step.above_floor):
            return Refusal(name, f"{best.candidate.effect.title} explains surely more in its place")
    return None


def _filling(judgement: Judgement, compared: dict[str, Without]) -> Refusal | None:
    """Find an effect that may fill what the formula of a larger one is off by, `OFF` of it.

    Where the large one acts; elsewhere what it is off by is of second order. Where all fits to the noise, formulas are
    off by no more than an error of the floor hides.
    """
    floors = judgement.held_out.size(judgement.held_out.after).floors
    beyond = OFF**2 * max(one.visibly for one in compared.values())
    for name in ascending(compared, lambda each: compared[each].visibly):
        channel, off = int(np.argmax(levelled(compared[name].seen))), compared[name].visibly
        left = float(floors[channel])
        most = max(beyond, *(one.seen[channel] for one in compared.values()))
        if off < OFF**2 * most and (left > CLEAR or off < ERRORS * (NOISE - 1)):
            size = f"{left:.2g} floors remain with it" if left > CLEAR else f"it is {off**0.5:.2g} floors large"
            return Refusal(
                name,
                f"in the {CHANNELS[channel]} {size}, and it removes less than a hundredth of what the largest effect"
                " does: the error of that one's formula looks the same",
            )
    return None


def differences(first: Judgement, last: Judgement, start: RankedStep, judge: Judge) -> tuple[str, ...]:
    """Say what differs between the flights that were learned from and those held out, where one model cannot fit both.

    `first` is all that was found in training, `last` what the held-out flights confirm, and `start` the look without
    effects. There is no sentence where the flights agree, in a gap or in none.
    """
    if last.found.hypothesis.chosen:
        return _other_numbers(first, judge)
    learned, held = start.hypothesis.residual_at(fit(start.hypothesis, start.floor)) / start.floor, last.held_out
    # Numbers of the vehicle that took up what only one of the roles has are wrong for the other.
    left = smallest((held.before, held.parameters), lambda each: float(np.nanmax(held.size(each).floors)))
    seen, unseen = size_in_floors(learned, np.ones(6)), held.size(left).floors
    names = [each.effect.title for each in first.found.hypothesis.chosen]
    there, here = (int(np.nan_to_num(each, nan=-1.0).argmax()) for each in (seen, unseen))
    in_training = _squares(learned, start.hypothesis.known, start.block)
    in_held = _squares(left / held.noise, held.known, block_index(system(judge.repaired), first.found.settings))
    surely = [_surely_differ(*of_channel) for of_channel in zip(in_training.T, in_held.T, strict=True)]
    if seen[there] > CLEAR and not unseen[here] > CLEAR and surely[there]:
        what = f" of what would be {' and '.join(names)}" if names else ""
        return (
            f"the training flights have a gap of {seen[there]:.2g} floors in the {CHANNELS[there]}{what}, and the"
            f" held-out flights have none ({unseen[here]:.2g} floors at most): something changed between them, or the"
            " held-out flights do not move in a way that shows it",
        )
    if (
        unseen[here] > CLEAR
        and not seen[there] > CLEAR
        and surely[here]
        and not unexplained_channels(last.found, judge.rng)
    ):
        return (
            f"the held-out flights have a gap of {unseen[here]:.2g} floors in the {CHANNELS[here]}, and the training"
            f" flights have none ({seen[there]:.2g} floors at most): something changed between them, or only the"
            " held-out flights move in a way that shows it; learn from one of them",
        )
    return _other_numbers(first, judge) if names else ()


def _squares(residual: Array, known: BoolArray, block: IntArray) -> Array:
    """Compute the mean square of each channel in each block, shape (block, 6); NaN where no window knows it."""
    each = (block == number for number in np.unique(block))
    return np.array([known_size(residual[own], known[own]) ** 2 for own in each])


def _surely_differ(one: Array, other: Array) -> bool:
    """Check whether means over blocks differ by more than these scatter; a single block scatters as the others do."""
    one, other = (each[np.isfinite(each)] for each in (one, other))
    if not len(one) or not len(other):
        return False
    widths = [float(np.std(each, ddof=1)) for each in (one, other) if len(each) > 1] or [0.0]
    error = np.hypot(widths[0] / np.sqrt(len(one)), widths[-1] / np.sqrt(len(other)))
    return bool(abs(one.mean() - other.mean()) > ERRORS * error)


def _other_numbers(first: Judgement, judge: Judge) -> tuple[str, ...]:
    """Say that the same effects explain the held-out flights with other numbers, if they do."""
    hypothesis, trained, settings = first.found.hypothesis, first.found.estimates, first.found.settings
    unseen = first.held_out
    # Where no flight was learned from, other numbers do not mean that the flights differ.
    if unseen.unlearned or min(unseen.shares().values()) >= settings.named_share:
        return ()
    # Shapes are held: a load that swings from another start would ask for another cable, and is the same load.
    refit = system(judge.repaired, hypothesis.chosen)
    own = estimates(refit, channel_weight(refit, unseen.floor), block_index(refit, settings))
    after = refit.residual_at(own.linear)
    share = unseen.share_removed(unseen.parameters / unseen.noise, after / unseen.noise)
    if share < settings.named_share or size_in_floors(after * unseen.known, unseen.floor).max() > CLEAR:
        return ()
    pairs = (zip(there, here, strict=False) for there, here in zip(trained.effects, own.effects, strict=True))
    return tuple(
        f"{spoken(number.name)} is {number.value:.3g} [{number.low:.3g}, {number.high:.3g}] {number.unit} in the"
        f" training flights and {other.value:.3g} [{other.low:.3g}, {other.high:.3g}] in the held-out ones"
        for number, other in chain.from_iterable(pairs)
        if number.name == other.name and (number.high < other.low or other.high < number.low)
    )
