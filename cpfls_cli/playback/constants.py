"""Constants of a vehicle from what moves it and knows nothing of its gusts: balances in bands, with instruments.

Torque and force of a model are held against what the motion takes, averaged over smooth windows of several lengths. An
autopilot answers gusts with torque, so torque and gust correlate, and least squares finds a mixture of vehicle and
autopilot. The same balance in another run of the same path has the same torque asked for, and another gust: it is the
instrument, and the residual of a balance must not correlate with it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, ClassVar, NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.blocks import ENOUGH_BLOCKS, contiguous, half_width, jackknife_covariance, jackknife_error, mean_error
from cpfls_cli.estimation.estimate import FOLDS, Normal, Prior, conditional_strength, one_step, solve
from cpfls_cli.flightlog.stated_vehicle import SLOW_HZ
from cpfls_cli.inertia import EXPLAINED, FLAT, KNOWN, VISIBLE
from cpfls_cli.playback.balances import BANDS, OVERLAP, Balances, PastBalances, Sums, fitting_bands
from cpfls_cli.playback.evaluation import JointNumbers
from cpfls_cli.playback.fit import Fitted, Uncertainty
from cpfls_cli.playback.flight import PlaybackFlight
from cpfls_cli.playback.instruments import Instruments
from cpfls_cli.playback.parameters import (
    DRAG,
    INERTIA,
    LEARNED,
    LOG_INERTIA,
    FreeNumbers,
    blocks_of,
    needs_velocity,
    of_no_command,
)
from cpfls_cli.result import About, about, part, result
from cpfls_cli.vehicle.settings import VehicleSettings

_LONGEST_S = 8.0
"""Length from which on a run identifies something in all bands."""
_NOT_TRIED = "slow_actuation"
"""It answers for whatever is slow, and is no constant of the vehicle."""
_STEPS, _SETTLED = 12, 1e-3
"""Of an estimate, and natural sizes of a step that is none any more."""
_LEAST = 1e-6
"""Share of the power of a band that is never taken for repeatable."""
STRONG = 10.0
"""F statistic of an instrument below which it is weak, and its interval no interval."""
_APART = 3.0
"""Standard errors by which bands may differ on a moment of inertia."""
_WORTH = 3.0
"""Standard errors by which a block has to lower the residual of balances kept aside."""


class Repeat(NamedTuple):
    """Two runs that fly the same path: flights, or parts of one."""

    first: Annotated[int, About("a run that repeats another, counted from 0", least=0)]
    second: Annotated[int, About("the other", least=0)]
    correlation: Annotated[float, About("of the two along their path")]


class ExplainedBand(NamedTuple):
    """A band of frequency, and what constants explain of the repeatable rotation in it."""

    low_hz: Annotated[float, About("lower end, about", unit="Hz")]
    high_hz: Annotated[float, About("upper end, about", unit="Hz")]
    explained: Annotated[
        Array, About("share of the repeatable rotation that the constants explain", ("axis",), frame="body (FLU)")
    ]
    used: Annotated[bool, About("1 where the constants rest on the band; others lack an effect")]


@result
class UsedInstruments:
    """What identifies how the flights were moved, apart from gusts: other runs of a path, setpoints, or the past."""

    SHOWN: ClassVar = ("lacks",)

    kind: str = about("repeats, setpoints, or past")
    setpoints: tuple[str, ...] = about("signals asked for from outside of the loop", "setpoint", default=())
    repeats: tuple[Repeat, ...] = part(default=())
    bands: tuple[ExplainedBand, ...] = part()
    explained: Array = about("the share in all used bands, weighed by what they say", "axis", frame="body (FLU)")
    explained_error: Array = about("standard error of that", "axis", frame="body (FLU)")

    @property
    def runs(self) -> int:
        """Runs that repeat another."""
        return len({each for pair in self.repeats for each in (pair.first, pair.second)})

    @property
    def lacks(self) -> bool:
        """Whether less than 90 % of what is repeatable about roll or pitch is explained, by more than chance."""
        explained = self.explained + self.explained_error
        return self.lacks_below is not None or bool((explained < EXPLAINED)[:2].any())

    @property
    def lacks_below(self) -> float | None:
        """Frequency in Hz below which the vehicle answers with something that the constants lack; None for nowhere."""
        used = [band.low_hz for band in self.bands if band.used]
        return None if len(used) == len(self.bands) else min(used)


@dataclass(frozen=True)
class Constants:
    """Constants that instruments identify."""

    fitted: Fitted
    spread: Uncertainty
    used: UsedInstruments

    @cached_property
    def half(self) -> Array:
        """Half of the 95 % intervals of the logarithms of the moments of inertia, (3,); infinite where unknown."""
        places = [self.fitted.free.index[name] for name in LOG_INERTIA]
        half = half_width(np.sqrt(np.diag(self.spread.covariance))[places], self.spread.blocks)
        return np.where(self.spread.determined[places], half, np.inf)

    @property
    def identified(self) -> bool:
        """Whether the moments of inertia about roll and pitch are known to a factor of two."""
        return bool((2 * self.half[:2] <= np.log(KNOWN)).all())

    def contradict(self, inertia: Array, low: Array, high: Array) -> bool:
        """Check whether a body, shape (3, 3), is another one about roll or pitch: off by its interval, and visibly.

        `low`, `high`: factors on its moments, shape (3,), between which torque and rotation leave the vehicle's own.
        What is none of these is no body of the vehicle, and contradicts none.
        """
        own = np.diag(self.fitted.model.body.inertia)[:2]
        apart, half = np.log(own / np.diag(inertia)[:2]), self.half[:2]
        possible = (apart + half >= np.log(low[:2])) & (apart - half <= np.log(high[:2]))
        return bool((np.abs(apart) > np.maximum(half, VISIBLE)).any() and possible.all())


@dataclass(frozen=True)
class _Problem:
    """Balances at values of the numbers, the bands in which they are estimated, and numbers that are held."""

    free: JointNumbers
    sums: Sums
    values: Array
    bands: BoolArray
    bands_hz: tuple[tuple[float, float], ...]
    held: Set[str]

    @cached_property
    def places(self) -> IntArray:
        """Numbers that are estimated."""
        return np.flatnonzero([number.name not in self.held for number in self.free.numbers])

    @property
    def blocks(self) -> list[str]:
        """Blocks of the numbers."""
        return list(dict.fromkeys(number.block for number in self.free.numbers))

    def places_of(self, blocks: Sequence[str]) -> IntArray:
        """Give the estimated numbers of some blocks."""
        return self.places[[self.free.numbers[place].block in blocks for place in self.places]]

    @cached_property
    def weights(self) -> Array:
        """Inverse variance of the non-repeatable part, shape (band, 3), for windows that overlap."""
        own, repeatable = (each.sum(axis=0)[:, :, 0, 0] for each in (self.sums.xtx, self.sums.ztx))
        count = self.sums.windows.sum(axis=0)[:, None]
        left = np.maximum(own - np.maximum(repeatable, 0.0), _LEAST * own) / np.maximum(count, 1)
        return np.where(self.bands[:, None], (1 - OVERLAP) / np.maximum(left, np.finfo(float).tiny), 0.0)

    @cached_property
    def weighed(self) -> Array:
        """ZtX, weighed and summed over bands and axes, shape (block, 2 + number, 2 + number).

        Of what instruments say of the motion only a share is so, the rest is the other runs' own gusts.
        """
        ztx, ztz = (each.sum(axis=0)[:, :, -1, -1] for each in (self.sums.ztx, self.sums.ztz))
        reliance = np.clip(ztx / np.where(ztz > 0, ztz, np.inf), 0.0, 1.0)
        return np.asarray(np.einsum("ka,bkapq->bpq", self.weights * reliance, self.sums.ztx))

    def normal(self, places: IntArray, weighed: Array | None = None) -> Normal:
        """Give the normal equations of some numbers, in natural sizes."""
        weighed, rows = self.weighed if weighed is None else weighed, 1 + places
        return Normal(weighed[:, rows[:, None], rows], -weighed[:, rows, 0])

    def prior(self, places: IntArray) -> Prior:
        """Give what is known of some numbers before, in natural sizes."""
        return Prior((self.free.starts / self.free.scales)[places], self.free.spreads[places])

    @cached_property
    def strength(self) -> Array:
        """Conditional F statistic of each estimated number."""
        return conditional_strength(self.normal(self.places), Prior.none(len(self.places)))

    def left_out(self, places: IntArray, weighed: Array | None = None) -> Array:
        """Give steps of some numbers without each block, in natural sizes, shape (block, number)."""
        at = (self.values / self.free.scales)[places]
        moved = one_step(self.normal(places, weighed), self.prior(places), at)[1] - at
        steps = np.zeros((len(moved), len(self.values)))
        steps[:, places] = moved
        return steps

    @cached_property
    def moments(self) -> tuple[Array, Array]:
        """Logarithms of the moments about roll and pitch, and how they move without each block, (block, 2)."""
        places = [self.free.index[name] for name in LOG_INERTIA[:2]]
        return self.values[places], (self.left_out(self.places) * self.free.scales)[:, places]

    @property
    def identifies(self) -> bool:
        """Whether the moments of inertia about roll and pitch are known to a factor of two."""
        _, moved = self.moments
        narrow = 2 * half_width(jackknife_error(moved), len(moved)) <= np.log(KNOWN)
        return not self.held & {*LOG_INERTIA[:2]} and bool(narrow.all())

    def agrees(self, other: _Problem) -> bool:
        """Check whether other bands have the moments of inertia about roll and pitch where these have them."""
        (own, moved), (others, others_moved) = self.moments, other.moments
        return bool((np.abs(others - own) <= _APART * jackknife_error(others_moved - moved)).all())

    def explains(self, band: int) -> bool:
        """Check whether 90 % of the repeatable roll and pitch in a band are explained, as far as is known."""
        share, error = self.explained
        return bool((share[band, :2] + error[band, :2] >= EXPLAINED).all())

    def left(self, places: IntArray) -> Array:
        """Sum the repeatable residual of blocks kept aside in turn, with some numbers estimated, shape (block,)."""
        part = contiguous(len(self.weighed), FOLDS)
        by_fold = np.array([self.weighed[part == fold].sum(axis=0) for fold in range(FOLDS)])
        steps = self.left_out(places, by_fold)[part]
        moved = np.column_stack([np.ones(len(steps)), steps, np.zeros(len(steps))])
        return np.asarray(np.einsum("bp,bpq,bq->b", moved, self.weighed, moved))

    @cached_property
    def explained(self) -> tuple[Array, Array]:
        """Share of the repeatable rotation that is explained, and its error, shape (band, 3)."""
        return _shares(self.sums.ztx[:, : len(self.bands_hz)])


def find_constants(
    vehicle: VehicleSettings,
    flights: Sequence[PlaybackFlight],
    given: Instruments,
    leave_out: Sequence[str] = (),
    *,
    past: bool = False,
) -> Constants | None:
    """Estimate the constants of a vehicle from flights that repeat each other, or whose setpoints are known.

    Numbers that are not known are free, and the moments of inertia; blocks of others join one by one while they lower
    the residual of balances that were kept aside. The slowest band is left out, and the next, where the faster ones
    identify the moments of inertia, and it disagrees with them or the model does not explain 90 % of the repeatable
    rotation in it: the model lacks something there, which no constant may stand for.

    Parameters
    ----------
    vehicle : VehicleSettings
        Where to begin.
    flights : sequence of PlaybackFlight
        With rotor speeds.
    given : Instruments
        Of these flights.
    leave_out : sequence of str
        Blocks that are not tried.
    past : bool
        Whether the past is the instrument, of innovations, for flights that show their loop. Slow ones go wherever they
        disagree or are not explained, and a moment is identified only where it is known to a tenth how much of the
        predicted rotation is explained: nothing from outside of the loop stands for it.

    Returns
    -------
    Constants or None
        None where nothing shows how the flights were moved apart from gusts, for too short a time or too slow a log,
        where the inertia is not to be sought, and by the past where rotors are logged below `SLOW_HZ`.

    References
    ----------
    Söderström and Stoica 2002 (instrumental variables in closed loop); Pintelon and Schoukens 2012 (repeats);
    Holtz-Eakin, Newey and Rosen 1988 (quasi-differences, with the past as instrument).
    """
    if past and any(flight.rotor_span_s * SLOW_HZ > 1 for flight in flights):
        # What is faster than their updates folds into what is slower, and the past predicts that, too.
        return None
    balances = (PastBalances if past else Balances)(given.flown, given)
    periods = {flight.motion.period for flight in balances.flights}
    if len(periods) > 1 or len(fitting_bands(max(periods))) < len(BANDS) - 1:
        return None
    translates = all(flight.translates for flight in flights)
    left_out = {*leave_out, *LEARNED, _NOT_TRIED, *of_no_command(flight.commanded for flight in flights)}
    tried = [
        block for block in blocks_of(vehicle) if block not in left_out and (translates or not needs_velocity(block))
    ]
    blocks = [block for block in (*vehicle.unknown, *tried) if block == INERTIA or block in vehicle.unknown]
    search = _Search(vehicle, balances, blocks, tried)
    free = search.free(blocks)
    if not balances.path or LOG_INERTIA[0] not in free.index or balances.longest_s < _LONGEST_S:
        return None
    # Of drag factor and moment of inertia about yaw only the ratio is known: both would drift along it.
    held = {DRAG} if {DRAG, LOG_INERTIA[2]} <= set(free.index) else set()
    found = search.chosen(np.ones(len(balances.bands), dtype=bool), held)
    if len(found.sums.ztx) < ENOUGH_BLOCKS:
        return None
    for slowest in range(len(balances.bands_hz) - 1, 0, -1):
        faster = found.bands.copy()
        faster[slowest] = False
        fast = search.chosen(faster, held, found)
        if (fast.agrees(found) and found.explains(slowest)) or not (past or fast.identifies):
            break
        found = fast
    return _constants(found, balances)


class _Search(NamedTuple):
    """What constants are sought in: blocks of numbers that are estimated anyway, and others that are tried."""

    vehicle: VehicleSettings
    balances: Balances
    asked: Sequence[str]
    tried: Sequence[str]

    def free(self, blocks: Sequence[str]) -> JointNumbers:
        """Give the numbers of some blocks."""
        chosen = tuple(block for block in blocks if block not in self.vehicle.unknown)
        return JointNumbers(FreeNumbers(self.vehicle, chosen))

    def problem(self, free: JointNumbers, values: Array, bands: BoolArray, held: Set[str]) -> _Problem:
        """Take the balances at values of the numbers."""
        return _Problem(free, self.balances.sums(free.base, values), values, bands, self.balances.bands_hz, held)

    def chosen(self, bands: BoolArray, held: Set[str], begun: _Problem | None = None) -> _Problem:
        """Estimate numbers in some bands, and add the block that lowers the residual most until none does.

        Of what was found in more bands the blocks are in already: by fewer a lag and a delay are hardly two.
        """
        blocks, known = (self.asked, {}) if begun is None else (begun.blocks, begun.free.named(begun.values))
        found = self.solved(blocks, bands, known, held)
        while best := self._best_block(found):
            more = self.solved([*found.blocks, best], bands, found.free.named(found.values), found.held & {DRAG})
            if not len(more.places_of([best])):
                break
            found = more
        return found

    def _best_block(self, found: _Problem) -> str:
        """Find the block with which least is left of what was kept aside; empty where none is worth it."""
        taken, named = found.blocks, found.free.named(found.values)
        free = self.free([*taken, *(block for block in self.tried if block not in taken)])
        values = free.values({number.name: number.absent for number in free.numbers} | named)
        every = self.problem(free, values, found.bands, found.held)
        left, gains = every.left(every.places_of(taken)), [(0.0, "")]
        for block in every.blocks:
            if block not in taken:
                gain = left - every.left(every.places_of([*taken, block]))
                if gain.mean() > _WORTH * mean_error(gain):
                    gains.append((float(gain.sum()), block))
        return max(gains)[1]

    def solved(self, blocks: Sequence[str], bands: BoolArray, known: Mapping[str, float], held: Set[str]) -> _Problem:
        """Solve the balances for all numbers but those held, within bounds.

        What instruments hardly identify is held with the numbers that are held anyway, where it was believed to be.
        """
        free = self.free(blocks)
        values = free.values(known)
        problem, at = self.problem(free, values, bands, held), values.copy()
        # The weakest first: conditional on a number that nothing identifies, nothing identifies the others either.
        while len(problem.places) and problem.strength.min() < STRONG:
            weakest = free.numbers[problem.places[np.argmin(problem.strength)]]
            values[free.index[weakest.name]] = weakest.absent
            held = held | {weakest.name}
            problem = replace(problem, held=held)
        places, scales = problem.places, free.scales[problem.places]

        def equations(natural: Array) -> Normal:
            nonlocal problem, at
            moved = values.copy()
            moved[places] = natural * scales
            if LOG_INERTIA[2] in held and INERTIA in self.vehicle.unknown:
                moved[free.index[LOG_INERTIA[2]]] = _of_a_flat_body(free, moved)
            if not np.allclose(moved, at, rtol=1e-12, atol=0.0):
                problem, at = self.problem(free, moved, bands, held), moved
            return problem.normal(places)

        if len(places):
            bounds = free.lows[places] / scales, free.highs[places] / scales
            solve(equations, values[places] / scales, problem.prior(places), bounds, steps=_STEPS, settled=_SETTLED)
        return problem


def _of_a_flat_body(free: JointNumbers, values: Array) -> float:
    """Give the number of Izz that goes with those of Ixx and Iyy: a wrong one would turn the body as it rolls."""
    started = np.array(free.base.vehicle.inertia_kg_m2[:3])
    roll, pitch = started[:2] * np.exp(values[[free.index[name] for name in LOG_INERTIA[:2]]])
    return float(np.log(FLAT * (roll + pitch) / started[2]))


def _shares(ztx: Array) -> tuple[Array, Array]:
    """Compute the share of the repeatable rotation that is explained, and its error, over blocks."""

    def share(sums: Array) -> Array:
        return np.asarray(1.0 - sums[..., 0, 0] / np.where(sums[..., -1, -1] == 0, np.nan, sums[..., -1, -1]))

    return share(ztx.sum(axis=0)), jackknife_error(share(ztx.sum(axis=0) - ztx))


def _constants(problem: _Problem, balances: Balances) -> Constants:
    """Gather the numbers of a solved problem, and how far they scatter over the blocks of the path.

    What instruments hardly identify scatters by what was believed before, however it scatters over the blocks.
    """
    free, past, given = problem.free, balances.of_past, balances.given
    known = np.zeros(len(free.numbers), dtype=bool)
    known[problem.places] = problem.strength >= STRONG
    if DRAG in problem.held or past:
        # Where only gusts turn it, the past finds 1.2 to 1.8 times the moment about yaw, and nothing shows that.
        known[free.index[LOG_INERTIA[2]]] = False
    bands = slice(0, len(problem.bands_hz))
    in_all = np.einsum("ka,bkapq->bapq", problem.weights[bands], problem.sums.ztx[:, bands])
    explained, error = _shares(in_all)
    # The past has to show that the model explains it: nothing else does.
    seen = (error <= 1 - EXPLAINED) | (not past)
    for name, enough in zip(LOG_INERTIA, seen & (explained + error >= EXPLAINED), strict=True):
        # Where much of what is repeatable is not explained, a moment may stand for what is missing.
        if name in free.index and not enough:
            known[free.index[name]] = False
    left_out = problem.left_out(problem.places)
    covariance = np.diag(np.where(known, 0.0, free.spreads**2)) + jackknife_covariance(left_out)
    share, _ = problem.explained
    every = np.arange(len(free.numbers))
    hessian = problem.normal(every).information.sum(axis=0) + np.diag(problem.prior(every).precision)
    return Constants(
        Fitted(free, problem.values, float(1 - share[0, :2].mean()), hessian),
        Uncertainty(covariance * np.outer(free.scales, free.scales), len(left_out), known),
        UsedInstruments(
            kind="past" if past else given.kind,
            setpoints=() if past else given.names,
            repeats=() if past else tuple(Repeat(*pair, float(r)) for pair, r in given.repeats.likeness.items()),
            bands=tuple(
                ExplainedBand(*ends, own, bool(used))
                for ends, own, used in zip(problem.bands_hz, share, problem.bands[bands], strict=True)
            ),
            explained=explained,
            explained_error=error,
        ),
    )
