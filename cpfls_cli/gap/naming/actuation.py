"""What lies between command and rotors in gusts: a loop that answers them looks as late."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.effects.effect import Effect
from cpfls_cli.gap.balance.refine import refined
from cpfls_cli.gap.balance.weak_flight import Candidate
from cpfls_cli.gap.naming.by_instruments import by_instruments, predictable_residual, untold
from cpfls_cli.gap.naming.estimate import NamedFit, fitted
from cpfls_cli.gap.naming.odds import chance_of_ranks, more_residual
from cpfls_cli.gap.naming.ranking import rank_effects
from cpfls_cli.gap.naming.results import Alternative, Estimate
from cpfls_cli.gap.naming.search import alternative
from cpfls_cli.gap.settings import CHANCE, ERRORS, OFF
from cpfls_cli.playback.instruments import Instruments

_Names = tuple[str, ...]


class ActuationFit(NamedTuple):
    """What lies between command and rotors: fits with the set that leaves least, and with none.

    `chances`: how likely chance makes each effect of the set; `alike`: sets that leave as little.
    """

    found: NamedFit
    without: NamedFit
    chances: dict[str, float]
    alike: tuple[Alternative, ...]


def decided_by_instruments(found: NamedFit, effects: Sequence[Effect], given: Instruments) -> ActuationFit:
    """Decide by instruments what lies between command and rotors.

    In gusts a fit of all motion takes the loop for the rotors, and a lag for a delay. Effects of one number are tried
    alone and together: both stand where each is surely not 0 beside the other, else one that is surely not 0. Where
    these leave something that was known before, more numbers are tried: the right set leaves nothing. Of those that
    cannot be told apart the one with the fewest numbers is named, and of as many the first of the catalogue, which is
    the usual one. `found` is a fit by instruments, and `effects` are those that the search tried.
    """
    late = [each for each in effects if each.late and found.hypothesis.can(Candidate(each, {}))]
    # A clock is no part of the vehicle: its shift is asked where the search found one.
    shifted = {each.effect.name for each in found.hypothesis.chosen}
    tried = {each.name: each for each in late if each.actuation or each.name in shifted}
    if not tried:
        return ActuationFit(found, found, {}, ())
    sets = _Sets(found, tried, given)
    best, rivals = sets.usual()
    more = sum(len(each.effect.shapes) for each in found.hypothesis.chosen if each.effect.late)
    for count in range(2, max(2, more) + 1):
        if best and (sets.count(best) == count or sets.leaves(best)):
            rivals += sets.tell([names for names in sets.all if sets.count(names) == count and names not in sets.left])
            best = sets.least([best, *(names for names in rivals if sets.count(names) == count)])
    alike = []
    for names in [*rivals, *sets.beside(best)]:
        if sets.count(names) > sets.count(best) and not sets.lacks(best, names):
            continue
        gone, new = [name for name in best if name not in names], [name for name in names if name not in best]
        if best and new and not sets.surely_more(names, best):
            *beside, last = new if gone else names
            alike.append(alternative(tried[(gone or best)[0]], tried[last], 1.0, *beside))
    # Of one number its own size tells, of several that so much less is left.
    less = chance_of_ranks(more_residual(sets.left[()], sets.left[best]))
    chances = {name: sets.chance_of(own[0]) if len(own) == 1 else less for name, own in sets.numbers(best).items()}
    return ActuationFit(sets.fits[best], sets.fits[()], chances, tuple(alike))


@dataclass
class _Sets:
    """Sets of effects between command and rotors by their names, each fitted by instruments beside all other effects.

    `fits`: of the sets that were tried, and whose numbers instruments tell.
    `left`: what of what each leaves was known before.
    """

    found: NamedFit
    effects: Mapping[str, Effect]
    given: Instruments
    fits: dict[_Names, NamedFit] = field(default_factory=dict)
    left: dict[_Names, Array] = field(default_factory=dict)

    @property
    def all(self) -> list[_Names]:
        """One effect or two, as in the catalogue."""
        every = (names for count in (1, 2) for names in combinations(self.effects, count))
        return sorted(every, key=lambda names: [self.effects[name].order for name in names])

    def count(self, names: _Names) -> int:
        """Count the numbers of a set."""
        return sum(len(self.effects[name].shapes) for name in names)

    def usual(self) -> tuple[_Names, list[_Names]]:
        """Choose among effects of one number: those that are surely not 0 beside each other, else one, or none."""
        self.tell([()])
        plain = [names for names in self.all if self.count(names) == len(names)]
        rate = self.found.settings.significance
        told = [names for names in self.tell(plain) if set(names) == self._needed(names, rate)]
        together = [names for names in told if len(names) > 1]
        if together:
            # Beside the right one alone any other is 0.
            return together[0], together
        # What is needed beside the others does without them.
        beside = {name for names in self.fits if len(names) > 1 for name in self._needed(names, rate)}
        rivals = [names for names in told if beside.issuperset(names)] or told
        return self.least(rivals or [()]), rivals

    def tell(self, tried: Sequence[_Names]) -> list[_Names]:
        """Fit sets; of those whose numbers instruments tell the names come back."""
        for names in tried:
            if (fit := self._fit(names)) is not None:
                self.fits[names], self.left[names] = fit, predictable_residual(fit, self.given)
        return [names for names in tried if names in self.fits]

    def _fit(self, names: _Names) -> NamedFit | None:
        hypothesis, _, floor, settings = self.found
        flights = hypothesis.flights
        chosen = [each for each in hypothesis.chosen if not each.effect.late]
        for effect in (self.effects[name] for name in names):
            (scored,) = rank_effects(flights, chosen, [effect], settings, None, floor=floor).ranking
            chosen = list(refined(flights, scored.chosen, floor).chosen)
        before = fitted(flights, chosen, floor, settings)
        after = by_instruments(before, self.given)
        return None if any(each.late for each in untold(before, after)) else after

    def leaves(self, names: _Names) -> bool:
        """Tell whether a set leaves something that was known before, which makes an answer more careful."""
        return self._more(self.left[names], CHANCE)

    def beside(self, best: _Names) -> list[_Names]:
        """List sets of effects of one number that hold a set and another effect."""
        return [names for names in self.fits if set(best) < set(names) and self.count(names) == len(names)]

    def lacks(self, best: _Names, names: _Names) -> bool:
        """Tell whether a set may lack what one with more numbers has: what it leaves, or a number beside its own."""
        if set(best) < set(names):
            return self._needed(names, CHANCE) == set(names)
        return self.leaves(best) and not self.leaves(names)

    def surely_more(self, one: _Names, other: _Names) -> bool:
        """Tell whether one leaves surely more than another; the right one leaves nothing, and less than that chance."""
        left = (self.left[names] * (self.left[names].sum() > 0) for names in (one, other))
        return self._more(more_residual(*left), self.found.settings.significance)

    def _more(self, left: Array, rate: float) -> bool:
        """Tell whether what is left is more than nothing, and more than formulas are off by."""
        return chance_of_ranks(left) < rate and bool(left.sum() > OFF**2 * self.left[()].sum())

    def least(self, tried: Sequence[_Names]) -> _Names:
        """Choose the first that no later one leaves surely less than."""
        first, *further = tried
        for names in further:
            first = names if self.surely_more(first, names) else first
        return first

    def numbers(self, names: _Names) -> dict[str, tuple[Estimate, ...]]:
        """Give the numbers of each effect of a set."""
        fit = self.fits[names]
        told = zip(fit.hypothesis.chosen, fit.estimates.effects, strict=True)
        return {candidate.effect.name: numbers for candidate, numbers in told if candidate.effect.name in names}

    def _needed(self, names: _Names, rate: float) -> set[str]:
        """Name the effects whose only number chance makes at most at a rate if it is 0, and within its bounds.

        Beside others it is enough of the usual effect that it is not less than anybody has.
        """
        needed, usual = set(), next(iter(self.effects)) if len(names) > 1 else ""
        for name, (number, *_) in self.numbers(names).items():
            if name == usual:
                stands = number.value >= self.effects[name].shapes[0].grid[0]
            else:
                stands = self.chance_of(number) <= rate
            if stands and number.value < number.plausible[1]:
                needed.add(name)
        return needed

    def chance_of(self, number: Estimate) -> float:
        """Compute how likely chance makes a time of its size if it is 0, by its interval and what a log is off by.

        When a sample was taken is known to one sampling period, and where in it is anybody's guess.
        """
        from scipy.special import erfc

        period = self.given.flown[0].motion.period
        error = np.hypot((number.high - number.value) / ERRORS, period / np.sqrt(12))
        return float(erfc(number.value / error / np.sqrt(2)))
