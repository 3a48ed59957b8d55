"""Whether a residual is the air: gusts that neither setpoints nor the past predict; size and memory."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from weakref import ref

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.blocks import jackknife_error
from cpfls_cli.effects.signals import Signals
from cpfls_cli.estimation.estimate import first_stage_fit_by_run
from cpfls_cli.gap.balance.balance_system import System, floors, residual_along
from cpfls_cli.gap.balance.weak_flight import WeakFlight
from cpfls_cli.gap.residual.dependence import state_signals, without_actuation
from cpfls_cli.gap.settings import ERRORS, RARE, GapSettings
from cpfls_cli.playback.disturbance import RANGES, FoundGusts, gusts_in
from cpfls_cli.playback.flight import LoggedFlight
from cpfls_cli.playback.innovations import MOST_PREDICTED, ResidualInnovations, blows, residual_innovations
from cpfls_cli.playback.instruments import (
    GivenKind,
    InstrumentKind,
    Instruments,
    Repeats,
    held,
    instruments,
    past_setpoints,
)
from cpfls_cli.weak_form.windows import Windows, about_flight_mean

_PREDICTED = {"repeats": 1 / 2, "setpoints": 1 / 3, "past": MOST_PREDICTED}
"""Largest share of the residual, at 95 %, that instruments predict of the air. Other runs show all that is
repeatable, a linear answer to setpoints about two thirds of it."""

_WITNESSES: dict[GivenKind, tuple[InstrumentKind, ...]] = {
    "repeats": ("repeats", "past"),
    "setpoints": ("setpoints", "past"),
    "none": ("past",),
}
"""What identifies gusts, by the instruments of flights; each for channels that those before it leave open."""


@dataclass(frozen=True)
class Air:
    """Gusts in flights."""

    found: FoundGusts  # Of all channels; a bound where nothing separates gusts from what the model lacks.
    gusts_only: BoolArray  # Shape (6,): channels whose residual is gusts and noise, by instruments.
    split: BoolArray  # Shape (6,): channels whose gusts instruments size; what is repeatable is a gap above them.

    def floor(self, learned: Sequence[WeakFlight], flights: Sequence[WeakFlight]) -> Array:
        """Compute what gusts and noise do to averages over windows: standard deviation, 0 where none are split off.

        Gusts are as large as they were in the flights that they were found in. In others they are drawn anew, and the
        mean square of a Gauss-Markov process of memory m over a time T scatters by ``sqrt(2 m / T)`` of itself: there
        the floor is two such deviations larger, of both, which they exceed in about one flight of twenty.

        `learned`, `flights`: those that gusts were found in, and those that the floor is of.
        Result: shape (6,), N m and N.
        """
        windows = learned[0].windows
        gusts, noise = self._gusts(windows, np.zeros(1, int))[:, 0], self.noise(windows)
        seconds = (float(sum(len(f.signals.time) * f.signals.period for f in own)) for own in (learned, flights))
        seldom = 0.0 if flights is learned else sum(1 / each for each in seconds)
        total = np.zeros(6)
        for channel in np.flatnonzero(self.split):
            scatter = ERRORS * np.sqrt(2 * self.found.memory[channel] * seldom)
            total[channel] = gusts[channel] * (1 + scatter) + noise[channel] ** 2
        return np.sqrt(total)

    def lasting(self, windows: Windows, count: int) -> Array:
        """Compute how gusts and noise of windows correlate by how many windows they are apart, shape (6, window).

        `count`: windows of the flight. Result: as many of them as pass until less than one part in `count` of a gust
        is left.
        """
        memory = self.found.memory[self.split].max(initial=0.0) / windows.period
        most = memory * np.log(count) + len(windows.weight)
        apart = windows.hop * np.arange(min(count, 2 + int(most / windows.hop)))
        common = [
            np.pad(np.correlate(each, each, "full")[len(each) - 1 :], (0, apart[-1]))[apart]
            for each in (windows.weight, windows.slope)
        ]
        both = self._gusts(windows, apart) + self.found.noise @ common
        return np.asarray(np.where(self.split[:, None], both / both[:, :1], apart == 0))

    def around(self, flights: Sequence[WeakFlight], floor: Array) -> list[WeakFlight]:
        """Give flights a floor of gusts and noise, shape (6,), where these are split off, and how long they last."""
        floor = np.where(self.split, floor, 0.0)
        return [replace(f, air=floor * f.known, lasting=self.lasting(f.windows, len(f))) for f in flights]

    def _gusts(self, windows: Windows, apart: IntArray) -> Array:
        """Compute the mean product of gusts averaged over windows so many samples apart, shape (6, apart)."""
        within = np.arange(1 - len(windows.weight), len(windows.weight))
        seconds = windows.period * np.abs(apart[:, None] + within)
        decay = np.exp(-seconds / np.where(self.split, self.found.memory, 1.0)[:, None, None])
        weights = np.correlate(windows.weight, windows.weight, "full")
        return np.asarray(self.found.size[:, None] ** 2 * (decay @ weights))

    def noise(self, windows: Windows) -> Array:
        """Compute what noise does without gusts, shape (6,); infinite where none are split off."""
        alone = self.found.noise @ [(windows.weight**2).sum(), (windows.slope**2).sum()]
        return np.where(self.split, np.sqrt(alone), np.inf)


def known_motion(flights: Sequence[Signals]) -> Instruments:
    """Find what of flights was asked for from outside of their loops; a copy of a flight repeats none.

    Flights that were asked to stay where they are, and did, were asked for nothing that moves.
    """
    # A flight that holds itself would be freed only by the garbage collector.
    return flights[0].once((known_motion, *map(ref, flights)), lambda: _known_motion(flights))


def _known_motion(recorded: Sequence[Signals]) -> Instruments:
    flights = [LoggedFlight.of(each).playback for each in recorded]
    given = instruments(flights)
    if given.kind == "none" and all(held(flight) for flight in flights):
        given = replace(given, setpoints=tuple(np.ones((len(run), 1)) for run in given.flown), names=("position",))
    different = set(_without_copies(recorded))
    copies = {number for number, run in enumerate(given.runs) if run.flight not in different}
    known = tuple(
        {} if number in copies else {other: place for other, place in each.items() if other not in copies}
        for number, each in enumerate(given.repeats.places)
    )
    likeness = {pair: alike for pair, alike in given.repeats.likeness.items() if copies.isdisjoint(pair)}
    return replace(given, repeats=Repeats(known, likeness))


def _without_copies(flights: Sequence[Signals]) -> Iterator[int]:
    """Give the numbers of flights without copies: in a copy noise is repeatable, too."""
    for number, each in enumerate(flights):
        if not any(np.array_equal(each.body_rate, one.body_rate) for one in flights[:number]):
            yield number


def air(hypothesis: System, linear: Array, block: IntArray, given: Instruments, settings: GapSettings) -> Air | None:
    """Find gusts in the residual of flights under a hypothesis.

    The motion of the vehicle follows its setpoints, and is repeatable where these are; a gust is neither. Without
    either, the innovations of a gust correlate with nothing before them, nor does their size; those of an effect
    correlate with the motion that causes it.

    `linear`, shape (column,): coefficients of its base.
    `block`: shape (window,).
    `given`: of the same flights.
    None for flights that are too short or of several rates, and for too few of them that instruments know.
    """
    residual, known = hypothesis.residual_at(linear), np.all([flight.known for flight in hypothesis.flights], axis=0)
    sensors = floors(replace(hypothesis, flights=tuple(in_air(hypothesis.flights, np.zeros(6)))), linear)
    moved = np.mean(about_flight_mean(residual, hypothesis.flight_index) ** 2, axis=0) / sensors**2
    flown = _Residual(hypothesis, linear, residual, block, np.where(known, moved, 0.0), given, settings)
    bound = gusts_in(flown.sides, given, "none")
    if bound is None:
        return None
    found, (only, sized) = None, np.zeros((2, 6), dtype=bool)
    ends = {name: getattr(bound, name).copy() for name in (*RANGES, "noise")}
    for witness in _WITNESSES[given.kind]:
        own = gusts_in(flown.sides, given, witness)
        if own is None:
            continue
        own, like = flown.judged(own, only)
        like &= known & ~only
        # What is not repeatable is no effect's; what setpoints do not predict may be one's.
        size = ~sized & (like | (np.isfinite(own.size) & (witness == "repeats")))
        for name, values in ends.items():
            values[size] = getattr(own, name)[size]
        if found is None or like.sum() > only.sum():
            found = own
        only, sized = only | like, sized | size
        if only[known].all():
            break
    if found is None:
        return None
    ends |= {name: np.where(known, ends[name], np.nan) for name in RANGES}
    return Air(replace(found, **ends), only, known & sized)


@dataclass(frozen=True)
class _Residual:
    """The residual of flights under a hypothesis, and what is known of them."""

    hypothesis: System
    linear: Array
    residual: Array  # Shape (window, 6).
    block: IntArray  # Shape (window,).
    moved: Array  # Shape (6,): mean square, in squared floors of the sensors; 0 of a channel that is not known.
    given: Instruments
    settings: GapSettings

    @cached_property
    def sides(self) -> list[Array]:
        """Difference of both sides of the balance, of each run, shape (time, 2, 6)."""
        left = [residual_along(self.hypothesis, number, self.linear) for number in range(len(self.hypothesis.flights))]
        sides = []
        for run in self.given.runs:
            momentum, direct = left[run.flight].momentum, left[run.flight].direct
            assert momentum is not None, "a balance has both"
            sides.append(np.stack([momentum[run.part], -direct[run.part]], axis=1))
        return sides

    def judged(self, found: FoundGusts, others: BoolArray) -> tuple[FoundGusts, BoolArray]:
        """Mark channels that are gusts alone by a witness, jointly with those of `others`; add its shares."""
        witness = found.instrument_kind
        if witness == "past":
            new = self._innovations(found.noise)
            share, without = new.shares
            found = replace(found, predicted=share, predicted_without=without)
        only = np.isfinite(found.size) & _gusty(found, self.moved, _PREDICTED[witness])
        if witness == "past" and only.any():
            only &= ~new.grows(RARE)
        if witness == "repeats" or not only.any():
            return found, only
        # Nothing else than that all of it is air shows it where nothing was asked.
        blown = only | others if witness == "past" else np.isfinite(found.size)
        return found, only & blows(blown, np.asarray(self.residual.any(axis=0)))

    def _innovations(self, noise: Array) -> ResidualInnovations:
        """Take innovations of the residual, and what motion and rotors predict of them."""
        there = self.hypothesis.closely
        windows = there.flights[0].windows
        states = [state_signals(*pair) for pair in zip(there.flights, there.signals, strict=True)]
        names, before = _common(states)
        residual = there.residual_at(self.linear)
        own = [residual[there.flight_index == number] for number in range(len(states))]
        moving = np.isin(names, list(without_actuation(states[0])))
        return residual_innovations(windows, own, before, moving, noise, self.settings.block_s)


def _common(states: Sequence[dict[str, Array]]) -> tuple[list[str], list[Array]]:
    """Name the signals that all flights have, and stack those of each, shape (window, signal)."""
    names = [name for name in states[0] if all(name in state for state in states)]
    return names, [np.stack([state[name] for name in names], axis=1) for state in states]


def _gusty(found: FoundGusts, moved: Array, most: float) -> BoolArray:
    """Mark channels of which instruments surely predict less than a share, alone or with the others of a kind.

    Air turns a vehicle about every axis, and pushes it along every one: what is sure of all torques or all forces is
    believed of each of them of which it is more likely than not.

    `moved`, shape (6,): mean square of the residual, in squared floors of the sensors.
    """
    own = found.predicted + ERRORS * found.predicted_error < most
    for kind in (slice(3), slice(3, 6)):
        # Of a channel that moves no more than its sensors nothing is known.
        known = np.isfinite(found.predicted[kind]) & (moved[kind] > 1)
        weight = np.where(known, 1 / np.maximum(found.predicted_error[kind], np.finfo(float).tiny) ** 2, 0.0)
        weight /= max(weight.sum(), np.finfo(float).tiny)
        share, without = (
            np.nan_to_num(each[..., kind]) @ weight for each in (found.predicted, found.predicted_without)
        )
        if weight.any() and share + ERRORS * jackknife_error(without) < most:
            own[kind] |= found.predicted[kind] < most
    return own


def in_air(flights: Sequence[WeakFlight], floor: Array) -> list[WeakFlight]:
    """Give flights a floor of gusts and noise, shape (6,)."""
    return [replace(flight, air=floor * flight.known) for flight in flights]


def predicted_rows(given: Instruments, windows: Windows, rows: Sequence[Array]) -> list[Array]:
    """Predict rows of windows over runs, shape (window, ...), from setpoints; NaN for runs without.

    `rows`, each shape (window, ...): of each run.
    """
    asked = {number: values for number, values in _asked(given, windows).items() if len(rows[number])}
    found = first_stage_fit_by_run(asked, rows)
    return [found.get(number, np.full_like(own, np.nan)) for number, own in enumerate(rows)]


@lru_cache(maxsize=1)
def _asked(given: Instruments, windows: Windows) -> dict[int, Array]:
    """Average what was asked of runs before over windows, shape (window, column); the same for each step of a fit."""
    apart = max(1, windows.hop // 2)
    # What drifts, such as the charge of a battery, goes with the time, which knows nothing of gusts either.
    return {
        number: windows.average(
            np.hstack([past_setpoints(setpoint, windows.period, apart), np.c_[np.arange(len(setpoint))]])
        )
        for number, setpoint in enumerate(given.setpoints)
        if setpoint is not None and len(setpoint) >= len(windows.weight)
    }
