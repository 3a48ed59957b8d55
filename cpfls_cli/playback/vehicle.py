"""A whole vehicle found in flights: structure, numbers with intervals, and what the flights cannot separate."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import field, replace
from types import MappingProxyType
from typing import Annotated, NamedTuple

import numpy as np
from scipy.linalg import block_diag

from cpfls_cli.arrays import Array
from cpfls_cli.blocks import half_width
from cpfls_cli.effects.registry import CATALOGUE, CENTRE_OF_MASS, SUPPLY
from cpfls_cli.inertia import FLAT, INERTIA_PARAMETERS, KNOWN, MEASURED, beyond_any_body, more_than_others, rescaled
from cpfls_cli.playback.constants import Constants, UsedInstruments, find_constants
from cpfls_cli.playback.disturbance import FoundGusts, find_gusts
from cpfls_cli.playback.evaluation import OF_A_WEIGHT, Group, JointNumbers
from cpfls_cli.playback.fit import Fitted, Uncertainty, uncertainty
from cpfls_cli.playback.flight import PlaybackFlight
from cpfls_cli.playback.history_fit import find_history
from cpfls_cli.playback.instruments import Instruments, instruments
from cpfls_cli.playback.loop import ANY, LoopBounds, loop_and_plain
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.playback.parameters import INERTIA, LAG, ROOM, Difference, FoundNumber, Physical, interval
from cpfls_cli.playback.player import Observer
from cpfls_cli.playback.settings import PlaybackSettings
from cpfls_cli.playback.structure import (
    Kept,
    Progress,
    TriedStructure,
    choose,
    choose_again,
    fitted_rotors,
    fitted_to_all,
)
from cpfls_cli.playback.weight import CommandedThrust, carrying_weight, widened_by_law
from cpfls_cli.result import About, about, part, result
from cpfls_cli.vehicle.rotors import with_factors
from cpfls_cli.vehicle.settings import VehicleSettings

_TRADED = 0.95
"""Size of a correlation from which on two numbers trade against each other."""


_OF_TURNING = ("inertia.", "products.", "drag_factor")
"""Numbers that are known only as far as the torques are that turn the vehicle."""

_AT_BOUND = 1e-6
"""Natural sizes from a bound up to which a number lies on it: the fit puts it there to rounding."""

_STEP = 1e-5
"""Of central differences, in natural sizes."""


class Trade(NamedTuple):
    """Two numbers of which the flights identify only a combination."""

    first: Annotated[str, About("one number")]
    second: Annotated[str, About("the other")]
    correlation: Annotated[float, About("of the two estimates")]


class Share(NamedTuple):
    """How much a part of the model does along the training flights."""

    name: Annotated[str, About("rotors, an effect, or remainder")]
    wrench: Annotated[
        Array, About("root mean square of torque (N m), then force (N)", ("6",), unit="SI", frame="body (FLU)")
    ]


@result
class VehicleFit:
    """What was found."""

    model: VehicleModel = part()
    numbers: tuple[FoundNumber, ...] = part()
    shares: tuple[Share, ...] = part()
    """Of rotors, named effects and learned remainder."""
    airspeed_m_s: float = about("speed in the rotor plane that 95 % of the training samples stay below", unit="m/s")
    trades: tuple[Trade, ...] = part()
    correlation: Array = about(
        "of the estimates; of what is positive, of its logarithm", "number", "number", brief=False
    )
    structures: tuple[TriedStructure, ...] = part()
    evaluated: int = about("structures that were judged")
    complete: bool = about("1 where the search ran to the end")
    blocks: int = about("blocks of windows that the intervals come from")
    guessed: tuple[str, ...] = about(
        "numbers of the vehicle that are still guesses: no flight determines them", "guess", default=()
    )
    differences: tuple[Difference, ...] = part(default=())
    """What other configurations have that the vehicle of the config has not."""
    loop: LoopBounds = part()
    """How far the loop may have misled the fit."""
    instruments: UsedInstruments | None = part(default=None)
    """What moved the flights apart from gusts, where the model and its numbers rest on it."""
    forecast: VehicleModel | None = part(default=None)
    """What forecasts the flights, loop and all, where the model is the vehicle alone."""
    disturbance: FoundGusts | None = part(default=None)
    """Gusts, where the numbers are those of the vehicle; the model holds what is known of them."""
    history: Observer | None = part(default=None)
    """By which the forecast uses the past; None where that is no better on flights kept aside, is not asked for, or the
    search was stopped."""
    sources: Instruments | None = None
    """All that identifies how the flights were moved, apart from gusts; in no file, as what follows."""
    others: Mapping[str, VehicleModel] = field(default_factory=dict)
    """Other configurations, by name of the group."""

    @property
    def by_bounds(self) -> bool:
        """Whether its body is held in the middle of bounds, see `held_by_bounds`."""
        return self.loop.misses and self.instruments is None


_AS_COMMANDED = CommandedThrust()


def find_vehicle(
    vehicle: VehicleSettings,
    flights: Sequence[PlaybackFlight],
    settings: PlaybackSettings,
    progress: Progress,
    kept: Kept = MappingProxyType({}),
    commands: CommandedThrust = _AS_COMMANDED,
) -> VehicleFit:
    """Find structure and numbers of a vehicle in training flights, those of other configurations too; see `choose`.

    `commands`: how the thrust of their commands goes; they are those of a full battery already.
    """
    own = [flight for flight in flights if not flight.group]
    begun, sensed = carrying_weight(vehicle, own)
    flown = {flight.group for flight in flights}
    groups = tuple(Group(group.name, group.differs or OF_A_WEIGHT) for group in settings.groups if group.name in flown)
    choice, given = choose(begun, own, settings, progress, kept), instruments(own)
    fitted, windows = fitted_to_all(choice.chosen.structure, begun, flights, settings, choice.chosen.fit, groups)
    loop = loop_and_plain(fitted.model, begun, own)
    constants = _identified(begun, own, given, settings, loop, fitted.model)
    held, forecast = Held(begun, (), (), loop), None
    apart = loop.misses and not loop.misses_alone and constants is None
    if loop.misses and constants is None:
        held = held_by_bounds(begun, loop, tuple(found_numbers(fitted, uncertainty(fitted, windows))))
        if loop.misses_alone:
            choice = choose_again(held.vehicle, choice, own, settings, progress)
            fitted, windows = fitted_to_all(
                choice.chosen.structure, held.vehicle, flights, settings, choice.chosen.fit, groups
            )
    tried = choice.tried
    if constants is not None:
        solved, spread, forecast = constants.fitted, constants.spread, fitted.model
    elif apart:
        solved, along = fitted_rotors(held.vehicle, loop.lags_s[1], own, settings)
        spread, forecast = uncertainty(solved, along), fitted.model
        tried = (*tried, choice.judge("held", solved, own, settings))
    else:
        solved, spread = fitted, uncertainty(fitted, windows)
    model = commands.whole(solved.model)
    of_fit = bodily(begun, (*held.numbers, *found_numbers(solved, spread)))
    numbers = tuple(widened_by_law((*sensed, *commands.numbers, *of_fit), commands))
    if constants is None:
        numbers = tuple(widened_by_loop(numbers, held.loop))
    gusts: FoundGusts | None = None
    if constants is not None or not loop.unexplained:
        determined = {number.name: number.determined for number in numbers}
        gusts = find_gusts(model, given, determined, identified=constants is not None)
    (shares, airspeed), correlation = _shares(model, own), estimate_correlation(solved, spread)
    past = choice.complete and settings.history_s and not settings.quick
    return VehicleFit(
        model=replace(model, gusts=None if gusts is None else gusts.gusts),
        numbers=numbers,
        shares=shares,
        airspeed_m_s=airspeed,
        trades=(*held.trades, *_trades(solved.free.physical(solved.values), correlation)),
        # What was sensed, or is held, goes with no number of the fit.
        correlation=block_diag(np.eye(len((*sensed, *commands.numbers))), held.correlation, correlation),
        structures=tried,
        evaluated=choice.evaluated,
        complete=choice.complete,
        blocks=spread.blocks,
        guessed=tuple(sorted(set(vehicle.unknown) - set(begun.unknown) - {number.name for number in sensed})),
        # A body by bounds that is not the fit's is not what the fit's other configurations differ from.
        differences=tuple(differences(fitted, uncertainty(fitted, windows))) if groups and not apart else (),
        loop=held.loop,
        instruments=None if constants is None else constants.used,
        forecast=None if forecast is None else commands.whole(forecast),
        disturbance=gusts,
        history=find_history(choice.chosen, fitted, own, settings) if past else None,
        sources=given,
        others={group.name: commands.whole(fitted.free.at(fitted.values, group.name).model) for group in groups},
    )


def _identified(
    vehicle: VehicleSettings,
    flights: Sequence[PlaybackFlight],
    given: Instruments,
    settings: PlaybackSettings,
    loop: LoopBounds,
    fitted: VehicleModel,
) -> Constants | None:
    """Give the constants that instruments identify, where the fit is not the vehicle's as well."""
    constants = find_constants(vehicle, flights, given, settings.leave_out)
    if loop.unexplained and (constants is None or not constants.identified):
        constants = find_constants(vehicle, flights, given, settings.leave_out, past=True)
    if constants is None or not constants.identified:
        return None
    # Where instruments find the same body the fit is the vehicle's, and takes more from the flights.
    return constants if loop.unexplained or constants.contradict(fitted.body.inertia, loop.low, loop.high) else None


class Held(NamedTuple):
    """A vehicle whose body is held, its numbers that were open before, and the loop's bounds on the body."""

    vehicle: VehicleSettings
    numbers: tuple[FoundNumber, ...]
    trades: tuple[Trade, ...]
    loop: LoopBounds

    @property
    def correlation(self) -> Array:
        """Correlate the numbers: those that trade, entirely."""
        names = [number.name for number in self.numbers]
        traded = [{trade.first, trade.second} for trade in self.trades]
        pairs = [[one == other or {one, other} in traded for one in names] for other in names]
        return np.reshape(np.array(pairs, dtype=float), (len(names), len(names)))


def held_by_bounds(vehicle: VehicleSettings, loop: LoopBounds, fitted: Sequence[FoundNumber]) -> Held:
    """Hold the body of a vehicle in the middle of its bounds, where a fit explains no flight.

    Moments of inertia stay as stated where all of these lie between their bounds. About yaw the bounds are those of the
    drag factor where that is not known, or of its ratio to the moment, which is then that of a flat body. The thrust
    factor is that of the fit, for it carries the weight. Numbers are given as exact, for the loop widens them to the
    bounds (`widened_by_loop`); what has none is open by a factor of ten.
    """
    found, rotor = {number.name: number for number in fitted}, vehicle.rotors[0]
    open_thrust, open_drag, open_body = (name in vehicle.unknown for name in ("thrust_factor", "drag_factor", INERTIA))
    thrust = found["thrust_factor"].value / rotor.thrust_factor_n_s2 if open_thrust else 1.0
    low, high = np.array([loop.low, loop.high]) * [thrust, thrust, 1.0]
    bounded, middle = np.isfinite(low * high), np.nan_to_num(np.sqrt(low * high), nan=1.0)
    of_body, moved = bounded & [True, True, not open_drag], np.ones(3)
    stays = not open_body and not (((low > 1) | (high < 1)) & [True, True, not open_drag]).any()
    if not stays:
        moved = np.where(of_body, middle, 1.0)
        if not of_body[2]:
            moved[2] = FLAT * (moved * vehicle.inertia_kg_m2[:3])[:2].sum() / vehicle.inertia_kg_m2[2]
    inertia = rescaled(vehicle.inertia_kg_m2, moved)
    drag = float(moved[2] / middle[2]) if open_drag and bounded[2] else 1.0
    ratio = [*moved[:2], moved[2] / drag]
    # One end alone says no more than that what is stated is off.
    low, high = np.where(bounded, [low / ratio, high / ratio], np.nan)
    loop, traded = loop._replace(low=low, high=high), False
    numbers = []
    if open_thrust:
        numbers.append(found["thrust_factor"])
    if open_drag:
        exact = bool(bounded[2]) and stays
        numbers.append(_held_at("drag_factor", "N m s^2", drag * rotor.drag_factor_n_m_s2, exact=exact))
    if not stays:
        stated = [np.nan] * 3 if open_body else vehicle.inertia_kg_m2[:3]
        rows = zip(INERTIA_PARAMETERS, inertia, stated, of_body.tolist(), strict=False)
        numbers += [_held_at(f"inertia.{name}", "kg m^2", value, own, exact=exact) for name, value, own, exact in rows]
        # Of two numbers that are open by a factor of ten, by how much their ratio is.
        known = np.log(ANY) / np.hypot(np.log(ANY), np.log(high[2] / low[2]) / 2)
        traded = open_drag and known > _TRADED
    if loop.lags_s[1] and not loop.misses_alone:
        shorter, lag, longer = loop.lags_s.tolist()
        numbers.append(FoundNumber(LAG, "s", lag, shorter, longer, np.nan, False, False))
    body = replace(with_factors(vehicle, thrust, drag), inertia_kg_m2=inertia, unknown=())
    trades = (Trade("drag_factor", "inertia.Izz", float(known)),) if traded else ()
    return Held(body, tuple(numbers), trades, loop)


def _held_at(name: str, unit: str, value: float, stated: float = np.nan, *, exact: bool = False) -> FoundNumber:
    factor = 1.0 if exact else ANY
    return FoundNumber(name, unit, value, value / factor, value * factor, stated, exact, False)


def _shares(model: VehicleModel, flights: Sequence[PlaybackFlight]) -> tuple[tuple[Share, ...], float]:
    """Evaluate the parts of a model along the measured motion, and the speed in the rotor plane."""
    squares: dict[str, Array] = {}
    speeds, samples = [], 0
    for flight in flights:
        velocity = np.einsum("tji,tj->ti", flight.motion.rotation, flight.motion.velocity)
        speeds.append(np.hypot(velocity[:, 0], velocity[:, 1]))
        for stretch in flight.stretches:
            rotor = model.response.terms_by_step(flight.speed[stretch], flight.motion.period, flight.hold)
            samples += len(rotor)
            for name, own in model.wrench_by_part(velocity[stretch], flight.motion.rate[stretch], rotor).items():
                squares[name] = squares.get(name, 0.0) + (own**2).sum(axis=0)
    shares = tuple(Share(name, np.sqrt(square / samples)) for name, square in squares.items())
    return shares, float(np.quantile(np.concatenate(speeds), 0.95))


def found_numbers(fitted: Fitted, spread: Uncertainty) -> Iterator[FoundNumber]:
    """Turn the numbers of a fit into physical ones, their intervals by the derivatives of that."""
    free, values = fitted.free, fitted.values
    physical = free.physical(values)
    stated = free.physical(free.starts)
    half = half_width(np.sqrt(np.diag(_covariance(free.physical, fitted, spread))), spread.blocks)
    own = half_width(np.sqrt(np.diag(spread.covariance)), spread.blocks)
    for place, (number, (name, found)) in enumerate(zip(free.numbers, physical.items(), strict=True)):
        span = _AT_BOUND * number.scale
        bound = min(values[place] - number.low, number.high - values[place]) <= span
        ends = interval(found.value, float(half[place]), positive=found.positive)
        low, high = np.clip(ends, *_bounds(free, values, place)).tolist()
        known = stated[name].value if found.stated else np.nan
        wide = high > KNOWN * low if found.positive else own[place] > number.believed
        determined = spread.determined[place] and not wide
        yield FoundNumber(name, found.unit, found.value, low, high, known, bool(determined), bool(bound))


def bodily(vehicle: VehicleSettings, numbers: Sequence[FoundNumber]) -> Iterator[FoundNumber]:
    """Call inertia and drag factor not determined where a moment of inertia is larger than that of any such body.

    Speeds that are partly noise state torques that turn nothing, and those that answer a gust turn nothing either: a
    fit then makes the body heavier, however narrow its intervals. All three moments and the drag factor share that. A
    moment that is more than the other two together, stated ones included, is not determined itself, and neither is what
    no vehicle of this mass and these rotors has: a centre of mass beyond the hubs, or a coefficient beyond all that a
    fit tries on such a vehicle, which it comes to where it is counted by an inertia that is too large.
    """
    hubs = np.array([rotor.position_m for rotor in vehicle.rotors])
    values = {number.name: number.value for number in numbers}
    heavy = beyond_any_body(vehicle.mass_kg, hubs, values)
    pairs = zip(INERTIA_PARAMETERS[:3], vehicle.inertia_kg_m2, strict=False)
    excess = more_than_others([values.get(f"inertia.{name}", stated) for name, stated in pairs])
    impossible = {*heavy, *(f"inertia.{name}" for name in excess), *_beyond_any(vehicle, numbers)}
    for number in numbers:
        possible = number.name not in impossible
        wrong = not possible or (heavy and number.name.startswith(_OF_TURNING))
        yield number._replace(determined=False, possible=possible) if wrong else number


def _beyond_any(vehicle: VehicleSettings, numbers: Sequence[FoundNumber]) -> Iterator[str]:
    """Name the coefficients of effects that no such vehicle has."""
    hubs = np.array([rotor.position_m for rotor in vehicle.rotors])
    of_centre = (each.name for each in CENTRE_OF_MASS.coefficients)
    farthest = dict(zip(of_centre, np.abs(hubs).max(axis=0).tolist(), strict=False))
    for number in numbers:
        block, _, name = number.name.partition(".")
        known = CATALOGUE[block].coefficients if block in CATALOGUE else ()
        for low, high in (each.bounds(vehicle) for each in known if each.name == name):
            ends = (-farthest[name], farthest[name]) if block == CENTRE_OF_MASS.name else (ROOM * low, ROOM * high)
            if not MEASURED * ends[0] <= number.value <= MEASURED * ends[1]:
                yield number.name


def widened_by_loop(numbers: Sequence[FoundNumber], loop: LoopBounds) -> Iterator[FoundNumber]:
    """Widen the intervals of inertia and drag factor by what the loop leaves open.

    About yaw torque and inertia are known by their ratio: what makes Izz larger makes the drag factor smaller. Where
    the flights show the loop, or a body is held by bounds, nothing else is determined but the thrust factor, which
    carries the weight, for every effect answers with the loop, or with a body that is off. Bounds of flights that show
    the loop determine no body. They are in moments of inertia of the model whose numbers these are.
    """
    low, high = np.fmin(loop.low, 1.0), np.fmax(loop.high, 1.0)
    factors = {f"inertia.{name}": ends for name, *ends in zip(INERTIA_PARAMETERS[:3], low, high, strict=True)}
    factors["drag_factor"] = [1 / high[2], 1 / low[2]]
    carries = {"thrust_factor", *(number.name for number in numbers if number.name.startswith(SUPPLY.name))}
    for number in numbers:
        below, above = (float(factor) for factor in factors.get(number.name, (1.0, 1.0)))
        ends = number.low * below, number.high * above
        if loop.misses and number.name == LAG:
            # What fits a body that is off is another lag than the one that explains most.
            ends = min(ends[0], float(loop.lags_s[0])), max(ends[1], float(loop.lags_s[2]))
        known = ends[1] <= KNOWN * ends[0] if number.name in factors else not loop.misses
        identified = number.name in carries or (known and not loop.shows_loop)
        yield number._replace(low=ends[0], high=ends[1], determined=number.determined and identified)


def within_samples(numbers: Sequence[FoundNumber], rotors_hz: float) -> Iterator[FoundNumber]:
    """Mark a lag as not determined where it is shorter than the sampling period of the rotors.

    Such a lag may be the time from a change to the sample that shows it.
    """
    for number in numbers:
        shorter = number.name == LAG and number.value * rotors_hz < 1
        yield number._replace(determined=False) if shorter else number


def _covariance(physical: Callable[[Array], Mapping[str, Physical]], fitted: Fitted, spread: Uncertainty) -> Array:
    """Turn the covariance of a fit into that of what follows from its numbers."""
    values = fitted.values
    slopes = []
    for place, step in enumerate(_STEP * fitted.free.scales * np.eye(len(values))):
        ahead, behind = physical(values + step), physical(values - step)
        slopes.append([(ahead[name].value - behind[name].value) / (2 * step[place]) for name in ahead])
    # The shape is that of no numbers too, where the vehicle as stated is the best.
    by_number = np.reshape(slopes, (len(values), len(physical(values))))
    return np.asarray(by_number.T @ spread.covariance @ by_number)


def differences(fitted: Fitted, spread: Uncertainty) -> Iterator[Difference]:
    """Say what differs between configurations, with 95 % intervals."""
    half = half_width(np.sqrt(np.diag(_covariance(fitted.free.differences, fitted, spread))), spread.blocks)
    for (name, found), width in zip(fitted.free.differences(fitted.values).items(), half.tolist(), strict=True):
        yield Difference(name, found.unit, found.value, found.value - width, found.value + width)


def _bounds(free: JointNumbers, values: Array, place: int) -> tuple[float, float]:
    """Give the bounds of a number as people know it, the others being what they are."""
    number, ends = free.numbers[place], []
    for bound in (number.low, number.high):
        at = values.copy()
        at[place] = bound
        ends.append(list(free.physical(at).values())[place].value if np.isfinite(bound) else bound)
    return min(ends), max(ends)


def estimate_correlation(fitted: Fitted, spread: Uncertainty) -> Array:
    """Correlate the estimates of numbers as people know them, shape (number, number)."""
    covariance = _covariance(fitted.free.physical, fitted, spread)
    deviation = np.sqrt(np.diag(covariance))
    # A number on a bound is the same in all blocks, so that it correlates with no other.
    correlation = covariance / np.maximum(np.outer(deviation, deviation), np.finfo(float).tiny)
    np.fill_diagonal(correlation, 1.0)
    return np.asarray(correlation)


def _trades(names: Iterable[str], correlation: Array) -> Iterator[Trade]:
    """Name pairs of numbers, as people know them, whose estimates go together."""
    known = list(names)
    for first, second in np.argwhere(np.triu(np.abs(correlation) > _TRADED, 1)).tolist():
        yield Trade(known[first], known[second], float(correlation[first, second]))
