"""Which of the effects that a search chose have earned a name on the flights that they were found in."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.effects.effect import Columns, Effect
from cpfls_cli.effects.signals import Signals
from cpfls_cli.gap.balance.balance_system import System, system
from cpfls_cli.gap.balance.weak_flight import Candidate, WeakFlight
from cpfls_cli.gap.naming.estimate import Estimates, differs_from_zero, free_estimates, sized, weighted_estimates
from cpfls_cli.gap.naming.ranking import block_index
from cpfls_cli.gap.naming.results import Estimate
from cpfls_cli.gap.settings import GapSettings
from cpfls_cli.rounding import levelled, tied


class NamedFit(NamedTuple):
    """Effects that have earned their name on the training flights.

    Attributes
    ----------
    block : array of int, shape (window,)
    """

    hypothesis: System
    block: IntArray
    estimates: Estimates


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


def fitted(flights: Sequence[WeakFlight], chosen: Sequence[Candidate], floor: Array, settings: GapSettings) -> NamedFit:
    """Fit effects together within their bounds, shapes and all."""
    start = system(flights, chosen)
    block = block_index(start, settings)
    hypothesis, estimates = weighted_estimates(start, floor, block)
    return NamedFit(hypothesis, block, estimates)


def earned(
    flights: Sequence[WeakFlight], chosen: Sequence[Candidate], floor: Array, settings: GapSettings
) -> tuple[NamedFit, list[Refusal]]:
    """Fit chosen effects, and refit without those that have not earned a name on the flights that they were found in.

    These are effects whose size does not differ from zero, which are not told, and effects that sit on a bound.
    """
    found, refusals = fitted(flights, chosen, floor, settings), []
    while found.hypothesis.chosen:
        nothing = nothing_by_size(found)
        out = [candidate for candidate in found.hypothesis.chosen if candidate.effect.name in nothing]
        if not out:
            refused = on_bound(found, floor)
            if refused is None:
                break
            out, refusal = refused
            refusals.append(refusal)
        kept = [candidate for candidate in found.hypothesis.chosen if candidate not in out]
        found = fitted(flights, kept, floor, settings)
    return found, refusals


def nothing_by_size(found: NamedFit) -> list[str]:
    """Name the effects whose size does not differ from zero."""
    pairs = zip(found.hypothesis.chosen, found.estimates.effects, strict=True)
    return [each.effect.name for each, numbers in pairs if not differs_from_zero(each.effect, numbers)]


def on_bound(found: NamedFit, floor: Array) -> tuple[list[Candidate], Refusal] | None:
    """Find an effect whose main number sits on a bound, or any number that is surely asked for beyond one.

    Zero is not such a bound: many coefficients cannot be less.

    Parameters
    ----------
    floor : array, shape (6,)
    """
    chosen = found.hypothesis.chosen
    for candidate, estimates in zip(chosen, found.estimates.effects, strict=True):
        names = [shape.name for shape in candidate.effect.shapes]
        ends = (
            any(bound and number.low <= bound <= number.high for bound in number.plausible)
            for number in estimates
            if number.name in names
        )
        if len(names) > 1 and all(ends):
            says = f"{' and '.join(names)} may all be at the bounds of what is possible"
            return [candidate], Refusal(candidate.effect.name, says, True)
    reached = {
        index: own
        for index, candidate in enumerate(chosen)
        if (own := _reached(sized(candidate.effect, found.estimates.effects[index])))
    }
    if not reached:
        return None
    free = free_estimates(found.hypothesis, floor, found.block)
    for index, bounds in reached.items():
        name = chosen[index].effect.name
        beyond = [number.name for number in free.effects[index] if number.name in bounds and number.impossible]
        if beyond:
            says = f"its {beyond[0]} would surely be beyond what is possible, {bounds[beyond[0]]}"
            return [chosen[index]], Refusal(name, says, True)
        numbers = sized(chosen[index].effect, found.estimates.effects[index])
        main = [number.name for number in _main(found, index, numbers, floor) if number.name in bounds]
        if main:
            says = f"its {main[0]} sits on the bound of what is possible, {bounds[main[0]]}"
            return [chosen[index]], Refusal(name, says, True)
    return None


def _reached(numbers: Sequence[Estimate]) -> dict[str, str]:
    """Name the numbers that sit on a bound other than zero, and the bound."""
    found = {}
    for number in numbers:
        for bound in number.plausible:
            if bound and tied(np.array(number.value), np.array(bound)):
                found[number.name] = f"{bound:.3g} {number.unit}"
    return found


def _main(found: NamedFit, index: int, numbers: Sequence[Estimate], floor: Array) -> Sequence[Estimate]:
    """Keep the coefficient that explains most; all numbers where they are not coefficients of columns."""
    candidate = found.hypothesis.chosen[index]
    linear = found.estimates.of_effect[index]
    names = [coefficient.name for coefficient in candidate.effect.coefficients]
    if not names or candidate.effect.physical is not None or len(linear) != len(names):
        return numbers
    columns = found.hypothesis.columns(candidate) * linear / floor[:, None]
    largest = names[int(np.argmax(levelled((columns**2).sum(axis=(0, 1)))))]
    return [number for number in numbers if number.name == largest]


def bends_of(named: Sequence[Candidate], flights: Sequence[WeakFlight]) -> list[Effect]:
    """Make an effect of the bend of each formula in the air velocity u: the formula times ``|u|^2 / (|u|^2 + U^2)``.

    U is the root mean square of u over the flights. Bounded, because powers hang on the fastest seconds of a flight.
    """
    flown = [flight.signals for flight in flights if "velocity" in flight.signals.available]
    squared = [(signals.air_velocity**2).sum(axis=1) for signals in flown]
    usual = float(np.sqrt(np.mean(np.concatenate(squared)))) if squared else np.inf
    effects = (each.effect for each in named)
    of_speed = (each for each in effects if each.kind == "wrench" and "velocity" in each.needs)
    return [_bend(effect, usual) for effect in of_speed if not (effect.shapes or effect.physical)]


def _bend(effect: Effect, usual: float) -> Effect:
    def columns(signals: Signals, shape: Mapping[str, float]) -> Columns:
        assert effect.columns is not None
        squared = (signals.air_velocity**2).sum(axis=1)
        return Columns(effect.columns(signals, shape).direct * (squared / (squared + usual**2))[:, None, None])

    either = tuple(replace(each, low=-each.high) for each in effect.coefficients)
    return replace(effect, name=f"a bend of {effect.name} over speed", columns=columns, coefficients=either)
