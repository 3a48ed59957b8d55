"""Open questions of a diagnosis: unexplained residuals, and effects too small for a name or not shown at all."""

from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from dataclasses import replace

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.blocks import FEWEST_BLOCKS, half_width, mean_error
from cpfls_cli.effects.effect import Columns, Effect
from cpfls_cli.effects.registry import CATALOGUE, VEHICLE_NUMBERS
from cpfls_cli.effects.signals import Signals
from cpfls_cli.gap.balance.balance_system import System, is_free, residual_along, system, window_noise
from cpfls_cli.gap.balance.refine import fit_within_bounds, least_squares
from cpfls_cli.gap.balance.weak_flight import CHANNELS, Candidate, WeakFlight
from cpfls_cli.gap.naming.estimate import Estimates, NamedFit, channel_weight, estimates_of, size_in_floors, within
from cpfls_cli.gap.naming.odds import likely, log_odds, more_residual, names_of
from cpfls_cli.gap.naming.ranking import RankedStep, candidates_of, rank_effects, scoring_matrix
from cpfls_cli.gap.naming.results import Alternative, Estimate, NamedEffect, NotExcited, Unexplained
from cpfls_cli.gap.naming.search import of_motion
from cpfls_cli.gap.residual.dependence import joined_states, rank_dependence, state_signals, without_actuation
from cpfls_cli.gap.residual.narrow_band import NarrowBand, narrow_band
from cpfls_cli.gap.settings import CHANCE, CLEAR, COUNTS, ERRORS, RARE, VISIBLE, GapSettings
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.weak_form.resampling import folds

_USUAL_OF_BOUND = 0.2  # A coefficient that is large but not unheard of, as a share of its bound.
_SHARES = (0.0, 0.01, 0.03, 0.1, 0.3, 1.0)
"""Of that size, which effects without a name may have: none, and about half a decade apart."""


def unexplained_channels(found: NamedFit, rng: np.random.Generator) -> tuple[Unexplained, ...]:
    """List the channels with an unexplained residual: size, dependence on signals, narrow band, energy."""
    hypothesis, settings, block = found.hypothesis, found.settings, found.block
    residual = hypothesis.residual_at(found.estimates.linear)
    noise = window_noise(hypothesis, residual, found.floor)
    sizes = size_in_floors(residual, noise)
    states = joined_states([state_signals(f, s) for f, s in zip(hypothesis.flights, hypothesis.signals, strict=True)])
    dependence = rank_dependence(
        residual / noise, hypothesis.flight_index, block, without_actuation(states), settings.shifts, rng
    )
    # The largest of each channel.
    dependent = {d.channel: d for d in reversed(dependence) if d.p_value <= settings.significance and d.r2 > COUNTS}
    band = _band(found, rng)
    rates = hypothesis.by_flight(lambda flight, _: flight.windows.average(flight.signals.body_rate))
    # A force turns nothing.
    directions = [*energy_directions(residual[:, :3], rates, block), *["neither"] * 3]
    unexplained = []
    for place, (channel, size, energy) in enumerate(zip(CHANNELS, sizes.tolist(), directions, strict=True)):
        follows, rings = dependent.get(channel), band if band and band.channel == channel else None
        if size > CLEAR or (size**2 > hypothesis.most_noise[place] and (follows or rings)):
            signal, share = (follows.signal, follows.r2) if follows else (None, 0.0)
            frequency = None
            if rings:
                share, frequency, energy = max(share, rings.share), rings.frequency_hz, rings.energy
            unexplained.append(Unexplained(channel, size, signal, share, frequency, energy))
    return tuple(unexplained)


def _band(found: NamedFit, rng: np.random.Generator) -> NarrowBand | None:
    """Search for a narrow band that counts, with windows dense enough to exclude aliases."""
    hypothesis, settings = found.hypothesis, found.settings
    flights = [flight.closely for flight in hypothesis.flights]
    along = (residual_along(hypothesis, number, found.estimates.linear) for number in range(len(flights)))
    rows = [flight.averaged(residual) for flight, residual in zip(flights, along, strict=True)]
    rates = [flight.windows.average(flight.signals.body_rate) for flight in flights]
    hop_s = flights[0].windows.hop * flights[0].windows.period
    band = narrow_band(rows, rates, hop_s, settings.shifts, rng, settings.significance, least=COUNTS)
    return band if band and band.p_value <= settings.significance else None


def energy_directions(torque: Array, body_rate: Array, block: IntArray) -> list[str]:
    """Say of each axis whether torque and body rate, shape (window, 3), feed or drain energy, or surely neither.

    By the sign of the mean power ``M omega`` against its scatter over blocks of windows.
    """
    numbers = np.unique(block)
    if len(numbers) < FEWEST_BLOCKS:
        return ["neither"] * torque.shape[1]
    power = (torque - torque.mean(axis=0)) * (body_rate - body_rate.mean(axis=0))
    means = np.array([power[block == number].mean(axis=0) for number in numbers])
    # Any of the axes, at the rate of errors of names.
    mean, seldom = means.mean(axis=0), 0.5 * RARE / means.shape[1]
    sure = np.abs(mean) > half_width(mean_error(means), len(means), 1 - seldom)
    return ["neither" if not s else "feeds" if m > 0 else "drains" for m, s in zip(mean, sure, strict=True)]


def with_unnamed(
    found: NamedFit, last: RankedStep, effects: Sequence[Effect], instead: Set[str], rng: np.random.Generator
) -> tuple[Estimates, tuple[str, ...], tuple[str, ...]]:
    """Widen the intervals of named effects by what is too small for a name.

    Every vehicle has a little of every effect: a drag of the fuselage that shows in no channel on its own still takes
    its part from the drag of the rotors. And a formula that is right in slow flight bends in fast flight. So named
    effects are fitted together with all others and with their bends, these normal about 0 with a share of their usual
    size as standard deviation. How likely each share is, none among them, blocks that no fit saw decide. Intervals are
    those of the mean of these fits and of the named effects alone, both.

    `last` is the look that ended the search, `effects` are those to be tried, and `instead` rivals, which may be there
    in the place of named effects and are no small ones next to them. With the estimates come the unnamed effects that
    explain more than chance, and bends that are a part of the gap that counts: the formula is another one.

    Reference: Yao, Vehtari, Simpson and Gelman 2018 (averages of Bayesian predictive distributions).
    """
    flights, named, settings = found.hypothesis.flights, found.hypothesis.chosen, found.settings
    if not named:
        return found.estimates, (), ()
    step, counting = last, tuple[str, ...]()
    if names_of(named) != names_of(last.hypothesis.chosen):
        step = rank_effects(flights, named, effects, settings, rng)
    vehicle, contain = found.hypothesis.vehicle, names_of(named).union(instead, *(each.effect.holds for each in named))
    others = [
        (each.candidate, usual_size(each.candidate.effect, vehicle, len(each.coefficients)))
        for each in step.ranking
        if _is_other(each.candidate.effect, contain)
    ]
    chosen = _beyond_chance(step, effects, settings, rng)
    # A formula bends by as much as it is; one that is 0 does not.
    pairs = [(each, np.abs(size)) for each, size in zip(named, found.estimates.of_effect, strict=True) if size.all()]
    sizes = {bend.name: (bend, size) for each, size in pairs for bend in bends_of([each], flights)}
    bends = [bend for bend, _ in sizes.values()]
    if bends:
        bent = rank_effects(flights, chosen, bends, settings, rng)
        least = COUNTS * rank_effects(flights, (), (), settings, None, floor=bent.floor).above_floor
        large = (each for each in bent.ranking if each.gain > max(least, bent.least_gain()))
        counting = tuple(each.candidate.effect.name for each in large if bent.p_value(each.gain) <= RARE)
        others += [(each.candidate, sizes[each.candidate.effect.name][1]) for each in bent.ranking]
        chosen = _beyond_chance(bent, bends, settings, rng)
    unnamed = tuple(each.effect.name for each in chosen[len(named) :])
    if not others:
        return found.estimates, unnamed, counting
    return _averaged(found.estimates, *_with_others(found, others, step)), unnamed, counting


def _is_other(effect: Effect, named: Set[str]) -> bool:
    """Check whether an effect adds torque and force of its own to those of named effects and of what these contain."""
    return effect.kind == "wrench" and not {effect.name, *effect.holds} & named


def _with_others(
    found: NamedFit, others: Sequence[tuple[Candidate, Array]], step: RankedStep
) -> tuple[list[Estimates], Array]:
    """Fit named effects together with others for each of `_SHARES`, and say how likely each is, shape (share,).

    `others`: each with the usual size of its linear coefficients.
    """
    hypothesis, shapes = found.hypothesis, found.hypothesis.shape_values
    arranged = scoring_matrix(hypothesis, [each for each, _ in others], found.floor)
    weight = channel_weight(hypothesis, found.floor) / found.floor
    matrix, own = arranged.matrix / weight[..., None], len(arranged.base)
    normal = folds(matrix, hypothesis.residual / found.floor / weight, step.block)
    usual = np.concatenate([size for _, size in others])
    ends = np.array([(shape.grid[0], shape.grid[-1]) for shape in hypothesis.shapes]).reshape(-1, 2)

    def numbers(fitted_rows: Array) -> Array:
        """Give coefficients and shapes, shape (..., number), of a fit whose shapes are steps."""
        linear, steps = np.split(fitted_rows[..., :own], [own - len(shapes)], axis=-1)
        return np.concatenate([linear, np.clip(shapes + steps, *ends.T)], axis=-1)

    fits, errors = list[Estimates](), list[Array]()
    for share in _SHARES:
        with np.errstate(divide="ignore"):
            known = np.append(arranged.prior[:own], (share * usual) ** -2.0)
        # What has no size is left out.
        columns = np.flatnonzero(np.isfinite(known))
        informed = replace(normal, prior=known)
        (values, _), (left_out, error) = informed.fit(columns), informed.solve(columns)
        fits.append(estimates_of(hypothesis, numbers(values[:, 0]), numbers(left_out[..., 0])))
        errors.append(error[:, 0])
    # What formulas are off by is what others are fitted to.
    return fits, likely([log_odds(more_residual(error, errors[0]), 0.0) for error in errors[1:]])


def _averaged(own: Estimates, fits: Sequence[Estimates], chances: Array) -> Estimates:
    """Widen the intervals of numbers by what fits with other effects change, and by their larger errors."""

    def widened(number: Estimate, there: Sequence[Estimate]) -> Estimate:
        values = np.array([each.value for each in there])
        half = np.array([each.high for each in there]) - values
        if len(there) < len(_SHARES) or not np.isfinite(half).all():
            return number
        apart = values - values[0]
        mean = float(chances @ apart)
        # 95 % intervals are about as many errors wide as Student's t says, so they are added in squares.
        wider = np.maximum(half**2 - half[0] ** 2, 0.0) + (ERRORS * (apart - mean)) ** 2
        more = float(np.sqrt(chances @ wider))
        low, high = (
            number.value + mean + way * np.hypot(end - number.value, more)
            for way, end in ((-1, number.low), (1, number.high))
        )
        return within(replace(number, low=min(number.low, float(low)), high=max(number.high, float(high))))

    effects = []
    for place, numbers in enumerate(own.effects):
        known = [{each.name: each for each in fit.effects[place]} for fit in fits]
        effects.append(tuple(widened(n, [fit[n.name] for fit in known if n.name in fit]) for n in numbers))
    return replace(own, effects=tuple(effects))


def bends_of(named: Sequence[Candidate], flights: Sequence[WeakFlight]) -> list[Effect]:
    """Make effects of the bends of each formula in the air velocity u, over speed and over height.

    Over speed it is the formula times ``|u|^2 / (|u|^2 + U^2)``, U being the root mean square of u over the flights,
    bounded because powers hang on the fastest seconds of a flight; over height the formula times the height above the
    lowest point of the flights, in their range.
    """
    flown = [flight.signals for flight in flights if "velocity" in flight.signals.available]
    usual = float(np.mean(np.concatenate([_squared_speed(signals) for signals in flown]))) if flown else np.inf
    over: dict[str, Callable[[Signals], Array]] = {
        "speed": lambda signals: _squared_speed(signals) / (_squared_speed(signals) + usual)
    }
    heights = [_height(signals) for signals in flown if "height" in signals.available]
    low, high = (float(end(np.concatenate(heights))) if heights else 0.0 for end in (np.min, np.max))
    if high > low:
        over["height"] = lambda signals: (_height(signals) - low) / (high - low)
    effects = [each.effect for each in named if each.effect.kind == "wrench" and "velocity" in each.effect.needs]
    plain = [effect for effect in effects if not (effect.shapes or effect.physical)]
    return [_bend(effect, name, by) for effect in plain for name, by in over.items()]


def _squared_speed(signals: Signals) -> Array:
    return np.asarray((signals.air_velocity**2).sum(axis=1))


def _height(signals: Signals) -> Array:
    assert signals.position is not None, "a bend over height declares its need"
    return signals.position[:, 2]


def _bend(effect: Effect, over: str, by: Callable[[Signals], Array]) -> Effect:
    def columns(signals: Signals, shape: Mapping[str, float]) -> Columns:
        assert effect.columns is not None
        return Columns(effect.columns(signals, shape).direct * by(signals)[:, None, None])

    either = tuple(replace(each, low=-each.high) for each in effect.coefficients)
    name, needs = f"a bend of {effect.name} over {over}", effect.needs | ({over} & {"height"})
    return replace(effect, name=name, columns=columns, coefficients=either, needs=needs)


def _beyond_chance(
    step: RankedStep, effects: Sequence[Effect], settings: GapSettings, rng: np.random.Generator
) -> list[Candidate]:
    """Add effects to the chosen ones as long as one explains more than chance, and more than noise."""
    flights, chosen = step.hypothesis.flights, list(step.hypothesis.chosen)
    for _ in range(settings.effects_max):
        more = (each for each in step.ranking if each.candidate.effect in effects and step.p_value(each.gain) <= CHANCE)
        gains = ((each, of_motion(each.gain, step, system(flights, each.chosen))) for each in more)
        added = next((each for each, gain in gains if step.p_value(gain) <= CHANCE), None)
        if added is None:
            break
        chosen.append(added.candidate)
        step = rank_effects(flights, chosen, effects, settings, rng)
    return chosen


def not_excited(hypothesis: System, effects: Sequence[Effect], floor: Array) -> tuple[NotExcited, ...]:
    """List the effects that could be present unseen above a floor, shape (6,), with the reason."""
    # The vehicle's own numbers are free in every fit, so beyond themselves they never show.
    names = names_of([*hypothesis.free, *hypothesis.chosen])
    reasons = ((effect.name, _reason(hypothesis, effect, floor)) for effect in effects if effect.name not in names)
    return tuple(NotExcited(name, reason) for name, reason in reasons if reason)


_RADIUS = "rotor radius"  # A signal that comes from the config, not from a log.


def untried(hypothesis: System, named: Sequence[NamedEffect], settings: GapSettings) -> tuple[Alternative, ...]:
    """List the rivals of named effects that the flights lack signals for: what was not tried is not beaten.

    Effects that the user ignores are not listed.
    """
    rivals = []
    for effect in named:
        for name in (name for name in CATALOGUE[effect.name].rivals if name not in settings.ignore):
            missing, to_log = _lacked(hypothesis, CATALOGUE[name])
            if missing and not {"command", "measured_rotor_speed"} & {*missing}:
                logged = [name for name in to_log if name != _RADIUS]
                asked = [f"log {' and '.join(logged)}"] if logged else []
                asked += ["state rotors.radius_m in the config"] if _RADIUS in to_log else []
                separated_by = f"{' and '.join(asked)} (not tried without that)"
                rivals.append(Alternative(name, effect.name, np.nan, separated_by))
    return tuple(rivals)


def not_separated(found: NamedFit, wrong: NamedEffect | None) -> Iterator[Alternative]:
    """List the rivals of wrong numbers of the vehicle that, with these as stated, leave no surely larger residual.

    Under a vehicle that hardly changes its speed a load on a cable does not swing, and is more weight; in gusts its
    swing may not show.
    """
    if wrong is None:
        return
    hypothesis, floor = found.hypothesis, found.floor
    named = np.array([each.name in wrong.coefficients for each in VEHICLE_NUMBERS.coefficients])
    stated = [replace(flight, turns=flight.turns * ~named) for flight in hypothesis.flights]

    def squares(there: System) -> Array:
        """Sum the squared residual of each block, squared floors."""
        rows = (there.residual_at(fit_within_bounds(there, floor)[0]) / floor) ** 2
        return np.array([rows[found.block == number].sum() for number in np.unique(found.block)])

    def alike(candidate: Candidate) -> bool:
        more = squares(system(stated, [*hypothesis.chosen, candidate])) - own
        return len(more) < 2 or bool(more.mean() <= ERRORS * mean_error(more))

    own = squares(hypothesis)
    for name, separated_by in VEHICLE_NUMBERS.rivals.items():
        effect = CATALOGUE[name]
        untried = name in {*found.settings.ignore, *names_of(hypothesis.chosen)} or effect.columns is None
        tried = [] if untried else filter(hypothesis.can, candidates_of([effect]))
        if any(alike(each) for each in tried if is_free(each)):
            yield Alternative(name, wrong.name, 1.0, separated_by)


def _lacked(hypothesis: System, effect: Effect) -> tuple[Sequence[str], Sequence[str]]:
    """Name the signals that an effect needs and no flight has, and what a log has to hold for them."""
    missing = [effect.missing(signals) for signals in hypothesis.signals]
    if not all(missing):
        return (), ()
    return missing[0], [name.replace("_", " ") for name in hypothesis.signals[0].to_log(missing[0])]


def _reason(hypothesis: System, effect: Effect, floor: Array) -> str:
    missing, to_log = _lacked(hypothesis, effect)
    if "command" in missing:
        return "rotor speeds are measured, so nothing between command and speed shows"
    if missing:
        return f"the flights lack {', '.join(to_log)}"
    if effect.columns is None:
        return ""
    shape = {shape.name: shape.grid[len(shape.grid) // 2] for shape in effect.shapes}
    columns = hypothesis.columns(Candidate(effect, shape))
    base, tested = ((rows / floor[:, None]).reshape(-1, rows.shape[2]) for rows in (hypothesis.base, columns))
    beyond = (tested - base @ least_squares(base, tested)).reshape(columns.shape)
    new = beyond * usual_size(effect, hypothesis.vehicle, columns.shape[2])
    # The best channel of the best coefficient decides.
    if np.sqrt((new**2).mean(axis=0)).max(initial=0.0) >= VISIBLE:
        return ""
    return f"it would not show; {effect.excitation}"


def usual_size(effect: Effect, vehicle: VehicleSettings, width: int) -> Array:
    """Size linear coefficients, so many as `width`, that are large but not unheard of, shape (width,)."""
    bounds = [max(abs(bound) for bound in c.bounds(vehicle)) for c in effect.coefficients]
    if not bounds:
        return np.ones(width)
    if effect.physical is not None:
        return np.abs(effect.physical.linear(_USUAL_OF_BOUND * np.array(bounds)))
    return _USUAL_OF_BOUND * np.array(bounds)[:width]
