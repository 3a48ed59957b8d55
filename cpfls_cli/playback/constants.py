"""Constants of a vehicle from what moves it and knows nothing of its gusts: balances in bands, with instruments.

Torque and force of a model are held against what the motion takes, averaged over smooth windows of several lengths. An
autopilot answers gusts with torque, so torque and gust go together, and least squares finds a mixture of vehicle and
autopilot. The same balance in another run of the same path has the same torque asked for, and another gust: it is the
instrument, and what is left of a balance must not go with it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, ClassVar, NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.blocks import contiguous, half_width, jackknife_covariance, jackknife_error, mean_error
from cpfls_cli.inertia import EXPLAINED, KNOWN, VISIBLE
from cpfls_cli.playback.balances import BANDS, OVERLAP, Balances, Sums, fitting_bands
from cpfls_cli.playback.fit import Fitted, Uncertainty
from cpfls_cli.playback.flight import PlaybackFlight
from cpfls_cli.playback.groups import JointNumbers
from cpfls_cli.playback.instruments import FOLDS, Instruments, ToldBy
from cpfls_cli.playback.parameters import DRAG, INERTIA, LEARNED, LOG_INERTIA, FreeNumbers, blocks_of, needs_velocity
from cpfls_cli.playback.past import PastBalances
from cpfls_cli.playback.table import Airflow
from cpfls_cli.result import About, about, part, result
from cpfls_cli.vehicle.settings import VehicleSettings

ENOUGH_BLOCKS = 8
"""Whose scatter tells an error by instruments."""
_LONGEST_S = 8.0
"""Length from which on a run tells something in all bands."""
_FLAT = 0.85
"""Izz over the sum of Ixx and Iyy of a multirotor: 1 for a flat body, and no body has more."""
_NOT_TRIED = "slow_actuation"
"""It answers for whatever is slow, and is no constant of the vehicle."""
_STEPS, _SETTLED = 12, 1e-3
"""Of an estimate, and natural sizes of a step that is none any more."""
_LEAST = 1e-6
"""Of the power of a band that is never taken for what comes again."""
_FARTHEST = 1.0
"""Natural sizes of a step."""
STRONG = 10.0
"""F statistic of an instrument below which it is weak, and its interval no interval."""
_APART = 3.0
"""Standard errors by which bands may differ on a moment of inertia."""
_WORTH = 3.0
"""Standard errors by which a block has to lower what is left of balances kept aside."""


class Explained(NamedTuple):
    """What a model explains of the rotation that comes again, by band and body axis.

    Attributes
    ----------
    share : array, shape (band, 3)
        ``1 - sum r r' / sum h h'`` over runs and others, r what is left and h what the rotation takes.
    used : array of bool, shape (band,)
        Whether the constants rest on it.
    total, error : array, shape (3,)
        Share in all bands that they rest on, weighed by what they tell, and its standard error.
    bands_hz : tuple of (float, float)
        Ends of the bands, about.
    """

    share: Array
    used: BoolArray
    total: Array
    error: Array
    bands_hz: tuple[tuple[float, float], ...]


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
    """Constants that instruments tell.

    Attributes
    ----------
    fitted : Fitted
    spread : Uncertainty
    explained : Explained
    told_by : str
        "repeats", "setpoints", or "past", which is what was before.
    """

    fitted: Fitted
    spread: Uncertainty
    explained: Explained
    told_by: ToldBy

    @cached_property
    def half(self) -> Array:
        """Half of the 95 % intervals of the logarithms of the moments of inertia, (3,); infinite where unknown."""
        places = [self.fitted.free.index[name] for name in LOG_INERTIA]
        half = half_width(np.sqrt(np.diag(self.spread.covariance))[places], self.spread.blocks)
        return np.where(self.spread.determined[places], half, np.inf)

    @property
    def tells(self) -> bool:
        """Whether the moments of inertia about roll and pitch are known to a factor of two."""
        return bool((2 * self.half[:2] <= np.log(KNOWN)).all())

    def contradict(self, inertia: Array) -> bool:
        """Tell whether a body, shape (3, 3), is another one about roll or pitch: off by its interval, and visibly."""
        own = np.diag(self.fitted.model.body.inertia)[:2]
        off = np.abs(np.log(np.diag(inertia)[:2] / own))
        return bool((off > np.maximum(self.half[:2], VISIBLE)).any())


def used_instruments(given: Instruments, constants: Constants) -> UsedInstruments:
    """Say of constants which instruments they rest on, and how much of the rotation they explain."""
    past, explained = constants.told_by == "past", constants.explained
    return UsedInstruments(
        kind=constants.told_by,
        setpoints=() if past else given.names,
        repeats=() if past else tuple(Repeat(*pair, float(alike)) for pair, alike in given.repeats.likeness.items()),
        bands=tuple(
            ExplainedBand(*ends, share, bool(used))
            for ends, share, used in zip(explained.bands_hz, explained.share, explained.used, strict=True)
        ),
        explained=explained.total,
        explained_error=explained.error,
    )


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

    @cached_property
    def weights(self) -> Array:
        """Inverse variance of what does not come again, shape (band, 3), for windows that overlap."""
        own, crossed = (each.sum(axis=0)[:, :, 0, 0] for each in (self.sums.own, self.sums.crossed))
        count = self.sums.windows.sum(axis=0)[:, None]
        left = np.maximum(own - np.maximum(crossed, 0.0), _LEAST * own) / np.maximum(count, 1)
        return np.where(self.bands[:, None], (1 - OVERLAP) / np.maximum(left, np.finfo(float).tiny), 0.0)

    @cached_property
    def reliance(self) -> Array:
        """Share of what other runs say of the motion that is so, shape (band, 3): the rest is their own gusts."""
        crossed, others = (each.sum(axis=0)[:, :, -1, -1] for each in (self.sums.crossed, self.sums.others))
        return np.asarray(np.clip(crossed / np.where(others > 0, others, np.inf), 0.0, 1.0))

    @cached_property
    def weighed(self) -> Array:
        """Products with other runs, weighed and summed over bands and axes, shape (block, 2 + number, 2 + number)."""
        return np.asarray(np.einsum("ka,bkapq->bpq", self.weights * self.reliance, self.sums.crossed))

    def weigh(self, sums: Array, power: int) -> Array:
        """Weigh products, with so many of other runs, and sum all of them, shape (2 + number, 2 + number)."""
        return np.asarray(np.einsum("ka,kapq->pq", self.weights * self.reliance**power, sums.sum(axis=0)))

    def information(self, weighed: Array) -> Array:
        """Add what was believed before to weighed sums, shape (number, number)."""
        return np.asarray(weighed[1:-1, 1:-1] + np.diag(1.0 / self.free.spreads**2))

    def step(self, weighed: Array, places: IntArray | None = None) -> Array:
        """Estimate numbers, all but those held or some, as steps in natural sizes; 0 for others, shape (number,)."""
        places = self.places if places is None else places
        before = (self.values - self.free.starts) / self.free.scales / self.free.spreads**2
        step = np.zeros(len(self.values))
        rows = np.ix_(places, places)
        step[places] = -np.linalg.solve(self.information(weighed)[rows], (weighed[1:-1, 0] + before)[places])
        return step

    @property
    def named(self) -> dict[str, float]:
        """Values of the numbers, by name."""
        return self.free.named(self.values)

    def left(self, places: IntArray) -> Array:
        """Sum what comes again and is left, of blocks kept aside in turn, shape (block,)."""
        total, parts = self.weighed.sum(axis=0), contiguous(len(self.weighed), FOLDS)
        left = np.zeros(len(self.weighed))
        for fold in range(FOLDS):
            aside = parts == fold
            moved = np.concatenate([[1.0], self.step(total - self.weighed[aside].sum(axis=0), places), [0.0]])
            left[aside] = np.einsum("p,bpq,q->b", moved, self.weighed[aside], moved)
        return left


def find_constants(
    vehicle: VehicleSettings, flights: Sequence[PlaybackFlight], given: Instruments, leave_out: Sequence[str] = ()
) -> Constants | None:
    """Estimate the constants of a vehicle from flights that repeat each other, or whose setpoints are known.

    Numbers that are not known are free, and the moments of inertia; blocks of others join one by one while they lower
    what is left of balances that were kept aside. The slowest band is left out, and the next, where the faster ones
    tell the moments of inertia, and it disagrees with them or the model does not explain 90 % of the rotation in it
    that comes again: the model lacks something there, which no constant may stand for.

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

    Returns
    -------
    Constants or None
        None where nothing tells how the flights were moved apart from gusts, for too short a time or too slow a log,
        and where the inertia is not to be sought.

    References
    ----------
    Söderström and Stoica 2002 (instrumental variables in closed loop); Pintelon and Schoukens 2012 (repeats).
    """
    return _found(vehicle, Balances(given.flown, given), _tried(vehicle, flights, leave_out))


def constants_of_past(
    vehicle: VehicleSettings, flights: Sequence[PlaybackFlight], given: Instruments, leave_out: Sequence[str] = ()
) -> Constants | None:
    """Estimate the constants of a vehicle from flights that show its loop, by what was before.

    As `find_constants`, in what is new along the flights, and in what of that was foretold fast and slowly. What is
    slow goes wherever it disagrees or is not explained, and a moment is told only where it is known to a tenth how much
    of the rotation that was foretold is explained: nothing from outside of the loop stands for it.

    Parameters
    ----------
    vehicle, flights, given, leave_out
        As of `find_constants`; the flights need no instruments.

    References
    ----------
    Holtz-Eakin, Newey and Rosen 1988 (quasi-differences, with the past as instrument).
    """
    return _found(vehicle, PastBalances(given.flown, given), _tried(vehicle, flights, leave_out))


def _found(vehicle: VehicleSettings, balances: Balances, tried: Sequence[str]) -> Constants | None:
    """Estimate the constants by what some balances know."""
    periods = {flight.motion.period for flight in balances.flights}
    if len(periods) > 1 or len(fitting_bands(max(periods))) < len(BANDS) - 1:
        return None
    blocks = [block for block in (*vehicle.unknown, *tried) if block == INERTIA or block in vehicle.unknown]
    setting = _Setting(vehicle, balances)
    free = setting.free(blocks)
    if not balances.path or LOG_INERTIA[0] not in free.index or balances.longest_s < _LONGEST_S:
        return None
    # Of drag factor and moment of inertia about yaw only the ratio is known: both would drift along it.
    held = {DRAG} if {DRAG, LOG_INERTIA[2]} <= set(free.index) else set()
    problem = _problem(setting, np.ones(len(balances.bands), dtype=bool), blocks, tried, held)
    if len(problem.sums.crossed) < ENOUGH_BLOCKS:
        return None
    for slowest in range(len(balances.bands_hz) - 1, 0, -1):
        faster = problem.bands.copy()
        faster[slowest] = False
        fast = _problem(setting, faster, blocks, tried, held)
        alike = _agree(fast, problem) and _explains(problem, slowest)
        if alike or not (balances.of_past or _tells(fast)):
            break
        problem = fast
    return _constants(problem, "past" if balances.of_past else balances.given.kind)


def _problem(
    setting: _Setting, bands: BoolArray, blocks: Sequence[str], tried: Sequence[str], held: Set[str]
) -> _Problem:
    """Estimate what is asked for in some bands, and choose what else is worth it."""
    return _chosen(setting, _settled(setting, blocks, bands, {}, held), tried)


def _tells(problem: _Problem) -> bool:
    """Whether the moments of inertia about roll and pitch are known to a factor of two."""
    if problem.held & {*LOG_INERTIA[:2]}:
        return False
    left_out = _moments_left_out(problem)
    return bool((2 * half_width(jackknife_error(left_out), len(left_out)) <= np.log(KNOWN)).all())


def _agree(fast: _Problem, more: _Problem) -> bool:
    """Tell whether a slower band leaves the moments of inertia about roll and pitch where the faster ones have them."""
    moved = np.array([more.named[name] - fast.named[name] for name in LOG_INERTIA[:2]])
    error = jackknife_error(_moments_left_out(more) - _moments_left_out(fast))
    return bool((np.abs(moved) <= _APART * error).all())


def _explains(problem: _Problem, band: int) -> bool:
    """Tell whether a model explains 90 % of roll and pitch that come again in a band, as far as is known."""
    share, error = _explained(problem)
    return bool((share[band, :2] + error[band, :2] >= EXPLAINED).all())


def _moments_left_out(problem: _Problem) -> Array:
    """Estimate logarithms of the moments about roll and pitch without each block, but for a constant, (block, 2)."""
    places = [problem.free.index[name] for name in LOG_INERTIA[:2]]
    return np.asarray(_left_out(problem)[:, places] * problem.free.scales[places])


def _left_out(problem: _Problem) -> Array:
    """Estimate numbers without each block, as steps in natural sizes, shape (block, number)."""
    total = problem.weighed.sum(axis=0)
    return np.array([problem.step(total - block) for block in problem.weighed])


class _Setting(NamedTuple):
    """What constants are sought in."""

    vehicle: VehicleSettings
    balances: Balances

    def free(self, blocks: Sequence[str]) -> JointNumbers:
        """Give the numbers of some blocks."""
        chosen = tuple(block for block in blocks if block not in self.vehicle.unknown)
        return JointNumbers(FreeNumbers(self.vehicle, chosen, Airflow(np.zeros(0), 0)))

    def problem(self, free: JointNumbers, values: Array, bands: BoolArray, held: Set[str]) -> _Problem:
        """Take the balances at values of the numbers."""
        return _Problem(free, self.balances.sums(free.base, values), values, bands, self.balances.bands_hz, held)


def _tried(vehicle: VehicleSettings, flights: Sequence[PlaybackFlight], leave_out: Sequence[str]) -> tuple[str, ...]:
    """List the blocks that are constants of a vehicle and that the flights can tell of."""
    translates = all(flight.translates for flight in flights)
    return tuple(
        block
        for block in blocks_of(vehicle)
        if block not in (*leave_out, *LEARNED, _NOT_TRIED) and (translates or not needs_velocity(block))
    )


def _chosen(setting: _Setting, problem: _Problem, tried: Sequence[str]) -> _Problem:
    """Add the block that lowers most what is left, and estimate again, until none does."""
    while True:
        taken = _blocks(problem.free)
        others = [block for block in tried if block not in taken]
        best = _best_block(setting, problem, taken, others)
        if best is None:
            return problem
        more = _settled(setting, [*taken, best], problem.bands, problem.named, problem.held & {DRAG})
        if not len(_of_blocks(more, [best])):
            return problem
        problem = more


def _best_block(setting: _Setting, problem: _Problem, taken: Sequence[str], others: Sequence[str]) -> str | None:
    """Find the block with which least is left of what was kept aside; None where none is worth it."""
    free = setting.free([*taken, *others])
    values = free.values({number.name: number.absent for number in free.numbers} | problem.named)
    every = setting.problem(free, values, problem.bands, problem.held)
    left, found = every.left(_of_blocks(every, taken)), []
    for block in dict.fromkeys(number.block for number in free.numbers):
        if block not in taken:
            gain = left - every.left(_of_blocks(every, [*taken, block]))
            if gain.mean() > _WORTH * mean_error(gain):
                found.append((gain.sum(), block))
    return max(found)[1] if found else None


def _of_blocks(problem: _Problem, blocks: Sequence[str]) -> IntArray:
    """Give the estimated numbers of some blocks."""
    return np.array([place for place in problem.places if problem.free.numbers[place].block in blocks], dtype=np.int64)


def _settled(
    setting: _Setting, blocks: Sequence[str], bands: BoolArray, known: Mapping[str, float], held: Set[str]
) -> _Problem:
    """Step to the numbers at which nothing that is left goes with other runs, within bounds.

    What instruments hardly tell is held with the numbers that are held anyway, where it was believed to be.
    """
    free = setting.free(blocks)
    values = free.values(known)
    problem = setting.problem(free, values, bands, held)
    absent = free.values({name: free.numbers[place].absent for name, place in free.index.items()})
    # The weakest first: apart from a number that nothing tells, nothing tells the others either.
    while len(problem.places) and (strength := _f_statistics(problem)).min() < STRONG:
        weakest = int(problem.places[np.argmin(strength)])
        values[weakest] = absent[weakest]
        held = held | {free.numbers[weakest].name}
        problem = replace(problem, held=held)
    for _ in range(_STEPS):
        problem = setting.problem(free, values, bands, held)
        step = np.clip(problem.step(problem.weighed.sum(axis=0)), -_FARTHEST, _FARTHEST)
        moved = np.clip(values + step * free.scales, free.lows, free.highs)
        if LOG_INERTIA[2] in held and INERTIA in setting.vehicle.unknown:
            moved[free.index[LOG_INERTIA[2]]] = _of_a_flat_body(free, moved)
        if (np.abs(moved - values) <= _SETTLED * free.scales).all():
            break
        values = moved
    return problem


def _of_a_flat_body(free: JointNumbers, values: Array) -> float:
    """Give the number of Izz that goes with those of Ixx and Iyy: a wrong one would turn the body as it rolls."""
    started = np.array(free.base.vehicle.inertia_kg_m2[:3])
    roll, pitch = started[:2] * np.exp(values[[free.index[name] for name in LOG_INERTIA[:2]]])
    return float(np.log(_FLAT * (roll + pitch) / started[2]))


def _blocks(free: JointNumbers) -> tuple[str, ...]:
    return tuple(dict.fromkeys(number.block for number in free.numbers))


def _explained(problem: _Problem) -> tuple[Array, Array]:
    """Compute the share of the rotation that comes again that a model explains, and its error, shape (band, 3)."""
    return _shares(problem.sums.crossed[:, : len(problem.bands_hz)])


def _shares(crossed: Array) -> tuple[Array, Array]:
    def share(sums: Array) -> Array:
        return np.asarray(1.0 - sums[..., 0, 0] / np.where(sums[..., -1, -1] == 0, np.nan, sums[..., -1, -1]))

    return share(crossed.sum(axis=0)), jackknife_error(share(crossed.sum(axis=0) - crossed))


def _constants(problem: _Problem, told_by: ToldBy) -> Constants:
    """Gather the numbers of a solved problem, and how far they scatter over the blocks of the path.

    What instruments hardly tell scatters by what was believed before, however it scatters over the blocks.
    """
    free, places, total = problem.free, problem.places, problem.weighed.sum(axis=0)
    told = np.zeros(len(free.numbers), dtype=bool)
    told[places] = _f_statistics(problem) >= STRONG
    if DRAG in problem.held or told_by == "past":
        # Where only gusts turn it, what was before finds 1.2 to 1.8 times the moment about yaw, and nothing shows that.
        told[free.index[LOG_INERTIA[2]]] = False
    explained, error = _explained_in_all(problem)
    # What was before has to show that the model explains it: nothing else does.
    seen = (error <= 1 - EXPLAINED) | (told_by != "past")
    for name, enough in zip(LOG_INERTIA, seen & (explained + error >= EXPLAINED), strict=True):
        # Where much comes again that is not explained, a moment may stand for what is missing.
        if name in free.index and not enough:
            told[free.index[name]] = False
    without = _left_out(problem)
    covariance = np.diag(np.where(told, 0.0, free.spreads**2)) + jackknife_covariance(without)
    share, _ = _explained(problem)
    fitted = Fitted(free, problem.values, float(1 - share[0, :2].mean()), problem.information(total))
    spread = Uncertainty(covariance * np.outer(free.scales, free.scales), len(without), told)
    used = problem.bands[: len(problem.bands_hz)]
    return Constants(fitted, spread, Explained(share, used, explained, error, problem.bands_hz), told_by)


def _explained_in_all(problem: _Problem) -> tuple[Array, Array]:
    """Compute the share of what comes again that is explained in all used bands together, and its error, (3,)."""
    bands = slice(0, len(problem.bands_hz))
    return _shares(np.einsum("ka,bkapq->bapq", problem.weights[bands], problem.sums.crossed[:, bands]))


def _f_statistics(problem: _Problem) -> Array:
    """Tell how strongly other runs tell each number apart from all others, the F statistic, shape (estimated,)."""
    rows = np.ix_(1 + problem.places, 1 + problem.places)
    sums = problem.sums
    crossed, own, others = (
        problem.weigh(each, power)[rows] for each, power in ((sums.crossed, 1), (sums.own, 0), (sums.others, 2))
    )
    # Each number's column without what other columns have of it, as other runs say.
    apart = np.linalg.pinv(crossed)
    told = np.einsum("pk,pq,qk->k", apart, crossed, apart)
    noisy = np.einsum("pk,pq,qk->k", apart, own, apart) * np.einsum("pk,pq,qk->k", apart, others, apart)
    share = np.minimum(np.where(told > 0, told**2, 0.0) / np.maximum(noisy, np.finfo(float).tiny), 1 - _LEAST)
    windows = (1 - OVERLAP) * problem.sums.windows[:, problem.bands].sum()
    return np.asarray(windows * share / (1 - share))
