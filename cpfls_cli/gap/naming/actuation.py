"""Lags, delays and filters between command and rotors in gusts: a loop that answers these looks alike."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.effects.effect import Effect
from cpfls_cli.gap.balance.refine import refined
from cpfls_cli.gap.balance.weak_flight import Candidate
from cpfls_cli.gap.naming.by_instruments import by_instruments, predictable_residual, unidentified
from cpfls_cli.gap.naming.estimate import NamedFit, fitted
from cpfls_cli.gap.naming.ranking import chance_of_ranks, more_residual, rank_effects
from cpfls_cli.gap.naming.results import Alternative, Estimate
from cpfls_cli.gap.naming.search import alternative
from cpfls_cli.gap.settings import CHANCE, ERRORS, OFF
from cpfls_cli.playback.instruments import Instruments

_Names = tuple[str, ...]


class ActuationFit(NamedTuple):
    """Lags between command and rotors: the fit with the set that leaves the least residual."""

    found: NamedFit
    chances: dict[str, float]  # P-value of each effect of the set.
    alike: tuple[Alternative, ...]  # Sets that leave as little.


def decided_by_instruments(found: NamedFit, effects: Sequence[Effect], given: Instruments) -> ActuationFit:
    """Decide by instruments which lags lie between command and rotors.

    In gusts a fit of all motion takes the loop for the rotors, and a lag for a delay. Effects of one number are tried
    alone and together: both are named where each is significant conditional on the other, else one that is significant.
    Where the past predicts the residual of these, more numbers are tried: it predicts nothing under the right set; and
    where a delay has no lag with it, because no rotor follows at once: a drive of second order is late like a delay.
    Of sets that leave as little the one with the fewest numbers is named, and of as many the first of the catalogue,
    which is the usual one. `found` is a fit by instruments, and `effects` are those that the search tried.
    """
    lags = [each for each in effects if each.is_lag and found.hypothesis.can(Candidate(each, {}))]
    # A clock is no part of the vehicle: its shift is asked where the search found one.
    shifted = {each.effect.name for each in found.hypothesis.chosen}
    tried = {each.name: each for each in lags if each.actuation or each.name in shifted}
    if not tried:
        return ActuationFit(found, {}, ())
    sets = _Sets(found, tried, given)
    best, rivals = sets.usual()
    more = sum(len(each.effect.shapes) for each in found.hypothesis.chosen if each.effect.is_lag)
    for count in range(2, max(2, more) + 1):
        if best and (sets.count(best) == count or sets.is_lacking(best)):
            untried = [each for each in sets.all if sets.count(each) == count and each not in sets.predictable]
            rivals += sets.fit(untried)
            best = sets.least([best, *(names for names in rivals if sets.count(names) == count and names != best)])
    alike = []
    lacking = bool(best) and sets.is_lacking(best)
    for names in rivals:
        # More numbers are a rival where they leave nothing and the named ones something.
        if sets.count(names) > sets.count(best) and not (lacking and not sets.is_predictable(names)):
            continue
        gone, new = [name for name in best if name not in names], [name for name in names if name not in best]
        if gone and new and not sets.surely_more(names, best):
            *jointly, last = new
            alike.append(alternative(tried[gone[0]], tried[last], 1.0, *jointly))
    # One number is judged by its own size, several by how much less they leave.
    less = chance_of_ranks(more_residual(sets.predictable[()], sets.predictable[best]))
    chances = {name: sets.chance_of(own[0]) if len(own) == 1 else less for name, own in sets.numbers(best).items()}
    return ActuationFit(sets._fit(best, together=True) or sets.fits[best], chances, tuple(alike))


@dataclass
class _Sets:
    """Sets of lags by their names, each fitted by instruments jointly with all other effects."""

    found: NamedFit
    effects: Mapping[str, Effect]
    given: Instruments
    # Of the sets that were tried and whose numbers instruments identify.
    fits: dict[_Names, NamedFit] = field(default_factory=dict)
    # Products of the residual of each with its prediction from the past, shape (block,).
    predictable: dict[_Names, Array] = field(default_factory=dict)

    @property
    def all(self) -> list[_Names]:
        """One effect or two, as in the catalogue."""
        every = (names for count in (1, 2) for names in combinations(self.effects, count))
        return sorted(every, key=lambda names: [self.effects[name].order for name in names])

    def count(self, names: _Names) -> int:
        """Count the numbers of a set."""
        return sum(len(self.effects[name].shapes) for name in names)

    def usual(self) -> tuple[_Names, list[_Names]]:
        """Choose among effects of one number: those that are significant jointly, else one, or none."""
        self.fit([()])
        plain = [names for names in self.all if self.count(names) == len(names)]
        rate = self.found.settings.significance
        significant = [names for names in self.fit(plain) if set(names) == self._needed(names, rate)]
        together = [names for names in significant if len(names) > 1]
        if together:
            # Conditional on the right one alone any other is 0.
            return together[0], together
        # What is needed jointly with the others does without them.
        needed = {name for names in self.fits if len(names) > 1 for name in self._needed(names, rate)}
        rivals = [names for names in significant if needed.issuperset(names)] or significant
        # No rotor follows at once, so that a lag alone is open wherever it leaves as little; and where a lag is no less
        # than anybody has, but may be 0, so is what does without it.
        usual = next(iter(self.effects))
        alone = [each for each in significant if each == (usual,) or not self._refuted(each, rate)]
        alone = [each for each in alone if each not in rivals]
        return self.least(rivals or [()]), [*rivals, *alone]

    def fit(self, tried: Sequence[_Names]) -> list[_Names]:
        """Fit sets; the names of those whose numbers instruments identify come back."""
        for names in tried:
            if (fit := self._fit(names)) is not None:
                self.fits[names], self.predictable[names] = fit, predictable_residual(fit, self.given)
        return [names for names in tried if names in self.fits]

    def _fit(self, names: _Names, *, together: bool = False) -> NamedFit | None:
        """Fit a set; None where instruments do not identify it. The errors are conditional where sets are compared."""
        hypothesis, _, floor, settings = self.found
        flights = hypothesis.flights
        chosen = [each for each in hypothesis.chosen if not each.effect.is_lag]
        for effect in (self.effects[name] for name in names):
            (scored,) = rank_effects(flights, chosen, [effect], settings, None, floor=floor).ranking
            chosen = list(refined(flights, scored.chosen, floor).chosen)
        before = fitted(flights, chosen, floor, settings)
        after = by_instruments(before, self.given, together=together)
        return None if any(each.is_lag for each in unidentified(before, after)) else after

    def is_predictable(self, names: _Names) -> bool:
        """Check whether the past predicts the residual of a set, which makes an answer more careful."""
        return self._more(self.predictable[names], CHANCE)

    def is_lacking(self, names: _Names) -> bool:
        """Check whether a set lacks a number: the past predicts its residual, or its rotors follow at once."""
        return (self.count(names) == 1 and next(iter(self.effects)) not in names) or self.is_predictable(names)

    def surely_more(self, one: _Names, other: _Names, tried: int = 1) -> bool:
        """Check whether it surely leaves more than another; the right one leaves nothing, and less than that chance.

        `tried`: how many others there are, at the rate of errors of all.
        """
        residual = (self.predictable[names] * (self.predictable[names].sum() > 0) for names in (one, other))
        return self._more(more_residual(*residual), self.found.settings.significance / tried)

    def _more(self, residual: Array, rate: float) -> bool:
        """Check whether a residual is more than chance, and more than formulas are off by."""
        return chance_of_ranks(residual) < rate and bool(residual.sum() > OFF**2 * self.predictable[()].sum())

    def least(self, tried: Sequence[_Names]) -> _Names:
        """Choose the first that no later one leaves surely less than."""
        first, *further = tried
        for names in further:
            first = names if self.surely_more(first, names, len(further)) else first
        return first

    def numbers(self, names: _Names) -> dict[str, tuple[Estimate, ...]]:
        """Give the numbers of each effect of a set."""
        fit = self.fits[names]
        pairs = zip(fit.hypothesis.chosen, fit.estimates.effects, strict=True)
        return {candidate.effect.name: numbers for candidate, numbers in pairs if candidate.effect.name in names}

    def _needed(self, names: _Names, rate: float) -> set[str]:
        """Name the effects whose only number is significant at a rate.

        Jointly with others it is enough of the usual effect that it is not less than anybody has.
        """
        usual = next(iter(self.effects)) if len(names) > 1 else ""
        own = {name: number for name, (number, *_) in self.numbers(names).items()}
        least = {name: self.effects[name].shapes[0].grid[0] for name in own}
        return {n for n, one in own.items() if (one.value >= least[n] if n == usual else self.chance_of(one) <= rate)}

    def _refuted(self, names: _Names, rate: float) -> bool:
        """Check whether another effect is significant conditional on those of a set."""
        joint = [each for each in self.fits if set(names) < set(each)]
        others = (number for each in joint for name, (number, *_) in self.numbers(each).items() if name not in names)
        return any(self.chance_of(number) <= rate for number in others)

    def chance_of(self, number: Estimate) -> float:
        """Compute the p-value of a time by its interval and the error of the log's clock.

        When a sample was taken is known to one sampling period, and where in it is anybody's guess.
        """
        from scipy.special import erfc

        period = self.given.flown[0].motion.period
        error = np.hypot((number.high - number.value) / ERRORS, period / np.sqrt(12))
        return float(erfc(number.value / error / np.sqrt(2)))
