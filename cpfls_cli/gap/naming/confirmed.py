"""Which names stand on the flights that they were found in, and on those that no fit has seen; and if both agree."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.blocks import mean_error
from cpfls_cli.gap.balance.balance_system import system
from cpfls_cli.gap.balance.refine import fit
from cpfls_cli.gap.balance.weak_flight import CHANNELS, Candidate, WeakFlight
from cpfls_cli.gap.naming.estimate import (
    NamedFit,
    channel_weight,
    estimates,
    fitted,
    free_estimates,
    nothing_by_size,
    size_in_floors,
    sized,
)
from cpfls_cli.gap.naming.held_out import HeldOut, held_out
from cpfls_cli.gap.naming.leftover import leftover
from cpfls_cli.gap.naming.ranking import RankedStep, block_index
from cpfls_cli.gap.naming.results import Estimate, Unexplained
from cpfls_cli.gap.settings import CLEAR, ERRORS, NOISE, OFF, VISIBLE, GapSettings
from cpfls_cli.rounding import ascending, largest, levelled, smallest, tied


class Refusal(NamedTuple):
    """An effect that is no name, and why, as the end of a sentence.

    Attributes
    ----------
    in_the_way : bool
        Whether others are to be looked for without it: on a bound it may stand for what another one is.
    """

    name: str
    reason: str
    in_the_way: bool = False

    @property
    def sentence(self) -> str:
        """The whole sentence."""
        return f"{self.name} explains part of the gap, but is not named: {self.reason}"


def earned(
    flights: Sequence[WeakFlight], chosen: Sequence[Candidate], floor: Array, settings: GapSettings
) -> tuple[NamedFit, list[Refusal]]:
    """Fit chosen effects, and refit without those that have not earned a name on the flights that they were found in.

    These are effects whose size does not differ from zero, which are not told, and effects that sit on a bound.
    """
    found, refusals = fitted(flights, chosen, floor, settings), []
    while found.hypothesis.chosen:
        out = nothing_by_size(found)
        if not out:
            refusal = on_bound(found)
            if refusal is None:
                break
            refusals.append(refusal)
            out = [refusal.name]
        found = found.without(out)
    return found, refusals


def on_bound(found: NamedFit) -> Refusal | None:
    """Find an effect whose main number sits on a bound, or any number that is surely asked for beyond one.

    Zero is not such a bound: many coefficients cannot be less.
    """
    chosen, effects = found.hypothesis.chosen, found.estimates.effects
    for (effect, _), numbers in zip(chosen, effects, strict=True):
        shapes = [shape.name for shape in effect.shapes]
        at_ends = [
            any(bound and number.low <= bound <= number.high for bound in number.plausible)
            for number in numbers
            if number.name in shapes
        ]
        if len(shapes) > 1 and all(at_ends):
            return Refusal(effect.name, f"{' and '.join(shapes)} may all be at the bounds of what is possible", True)
    free = None
    for index, (effect, _) in enumerate(chosen):
        sizes = sized(effect, effects[index])
        bounds = {
            number.name: f"{bound:.3g} {number.unit}"
            for number in sizes
            for bound in number.plausible
            if bound and tied(np.array(number.value), np.array(bound))
        }
        if not bounds:
            continue
        free = free or free_estimates(found)
        says = "would surely be beyond what is possible"
        told = [number.name for number in free.effects[index] if number.name in bounds and number.impossible]
        if not told:
            says = "sits on the bound of what is possible"
            told = [name for name in _main(found, index, sizes) if name in bounds]
        if told:
            return Refusal(effect.name, f"its {told[0]} {says}, {bounds[told[0]]}", True)
    return None


def _main(found: NamedFit, index: int, sizes: Sequence[Estimate]) -> list[str]:
    """Name the coefficient that explains most; all numbers where they are not coefficients of columns."""
    candidate, linear = found.hypothesis.chosen[index], found.estimates.of_effect[index]
    names = [coefficient.name for coefficient in candidate.effect.coefficients]
    if not names or candidate.effect.physical is not None or len(linear) != len(names):
        return [number.name for number in sizes]
    columns = found.hypothesis.columns(candidate) * linear / found.floor[:, None]
    return [names[int(np.argmax(levelled((columns**2).sum(axis=(0, 1)))))]]


class Judgement(NamedTuple):
    """Effects with what they leave of the flights held out."""

    found: NamedFit
    held_out: HeldOut


@dataclass(frozen=True)
class Judge:
    """Judges fits on held-out flights.

    Attributes
    ----------
    logged, repaired : sequence of WeakFlight
        The held-out flights as logged, and after repair of the sensors.
    floor : array, shape (6,)
        Of the training flights.
    """

    training: Sequence[WeakFlight]
    logged: Sequence[WeakFlight]
    repaired: Sequence[WeakFlight]
    floor: Array
    settings: GapSettings
    rng: np.random.Generator

    def judge(self, found: NamedFit) -> Judgement:
        """Evaluate effects on the held-out flights, beside the model with its own numbers refitted."""
        linear = found.estimates.linear
        return Judgement(found, held_out(self.logged, self.repaired, found.hypothesis, linear, self.floor))

    def remainder(self, found: NamedFit) -> tuple[Unexplained, ...]:
        """Analyse what effects leave of the flights that they were found in."""
        return leftover(found, self.rng)

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
            return Refusal(
                worst,
                f"on the held-out flights it makes the {CHANNELS[channel]} worse, "
                f"{compared[worst].left[channel]:.2g} floors without it and {after[channel]:.2g} with it",
            )
        least = smallest(compared, lambda each: compared[each].visibly)
        if compared[least].visibly < VISIBLE**2:
            return Refusal(least, "on the held-out flights the gap is as small without it")
        return _filling(judgement, compared)

    def _without(self, judgement: Judgement, name: str) -> Without:
        """Leave an effect out and refit the others."""
        without = judgement.found.without([name])
        there = system(self.repaired, without.hypothesis.chosen)
        residual, unseen = there.left(without.estimates.linear), judgement.held_out
        squares = [((each / unseen.noise) ** 2) * unseen.known for each in (residual, unseen.after)]
        count = np.maximum(unseen.known.sum(axis=0), 1)
        difference, block = squares[0] - squares[1], block_index(there, self.settings)
        sums = np.array([difference[block == number].sum(axis=0) for number in np.unique(block)])
        spread = len(sums) * mean_error(sums) if len(sums) > 1 else np.zeros(6)
        left = np.sqrt(squares[0].sum(axis=0) / count)
        return Without(difference.sum(axis=0) / count, spread / count, left, there.gusty)


class Without(NamedTuple):
    """Held-out flights without one of the effects, the others refitted.

    Attributes
    ----------
    raised : array, shape (6,)
        Mean square of each channel beyond that with the effect, in squared floors.
    error : array, shape (6,)
        Standard error of it over blocks.
    left : array, shape (6,)
        Root mean square without it, in floors.
    gusts : array of bool, shape (6,)
        Channels whose floor holds gusts.
    """

    raised: Array
    error: Array
    left: Array
    gusts: BoolArray = np.zeros(6, dtype=bool)

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
        """Compute how much worse the effect makes channels that it leaves `after` floors in, as ratios; 0 if unsure."""
        surely = -self.raised > ERRORS * self.error
        worse = (after > CLEAR) & (after > (1 + OFF) * self.left) & surely
        return np.where(worse, after / np.maximum(self.left, 1e-9), 0.0)


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
        beside = max(beyond, *(one.seen[channel] for one in compared.values()))
        if off < OFF**2 * beside and (left > CLEAR or off < ERRORS * (NOISE - 1)):
            told = f"{left:.2g} floors are left with it" if left > CLEAR else f"it is {off**0.5:.2g} floors large"
            return Refusal(
                name,
                f"in the {CHANNELS[channel]} {told}, and it removes less than a hundredth of what the largest effect"
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
    seen = size_in_floors(start.hypothesis.left(fit(start.hypothesis, start.floor)), start.floor)
    held = last.held_out
    # Numbers of the vehicle that took up what only one of the roles has are wrong for the other.
    unseen = smallest(
        (held.size(each).floors for each in (held.before, held.parameters)), lambda each: float(np.nanmax(each))
    )
    names = [each.effect.name for each in first.found.hypothesis.chosen]
    there, here = (int(np.nan_to_num(each, nan=-1.0).argmax()) for each in (seen, unseen))
    if seen[there] > CLEAR and not unseen[here] > CLEAR:
        what = f" of what would be {' and '.join(names)}" if names else ""
        return (
            f"the training flights have a gap of {seen[there]:.2g} floors in the {CHANNELS[there]}{what}, and the"
            f" held-out flights have none ({unseen[here]:.2g} floors at most): something changed between them, or the"
            " held-out flights do not move in a way that shows it",
        )
    if unseen[here] > CLEAR and not seen[there] > CLEAR and not judge.remainder(last.found):
        return (
            f"the held-out flights have a gap of {unseen[here]:.2g} floors in the {CHANNELS[here]}, and the training"
            f" flights have none ({seen[there]:.2g} floors at most): something changed between them, or only the"
            " held-out flights move in a way that shows it; learn from one of them",
        )
    return _other_numbers(first, judge) if names else ()


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
    after = refit.left(own.linear)
    share = unseen.share_removed(unseen.parameters / unseen.noise, after / unseen.noise)
    if share < settings.named_share or size_in_floors(after * unseen.known, unseen.floor).max() > CLEAR:
        return ()
    pairs = (zip(there, here, strict=False) for there, here in zip(trained.effects, own.effects, strict=True))
    return tuple(
        f"{number.name} is {number.value:.3g} [{number.low:.3g}, {number.high:.3g}] {number.unit} in the"
        f" training flights and {other.value:.3g} [{other.low:.3g}, {other.high:.3g}] in the held-out ones"
        for number, other in chain.from_iterable(pairs)
        if number.name == other.name and (number.high < other.low or other.high < number.low)
    )
