"""Open questions of a diagnosis: unexplained residuals, and effects too small for a name or not shown at all."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.fft import irfft, next_fast_len, rfft, rfftfreq

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.blocks import FEWEST_BLOCKS, half_width, mean_error
from cpfls_cli.effects.effect import Columns, Effect
from cpfls_cli.effects.registry import CATALOGUE, VEHICLE_NUMBERS
from cpfls_cli.effects.signals import Signals
from cpfls_cli.gap.balance.balance_system import System, is_free, residual_along, system, window_noise
from cpfls_cli.gap.balance.noise_floor import CORRELATIONS
from cpfls_cli.gap.balance.refine import fit_within_bounds, least_squares
from cpfls_cli.gap.balance.weak_flight import CHANNELS, Candidate, WeakFlight
from cpfls_cli.gap.naming.by_instruments import holding
from cpfls_cli.gap.naming.estimate import (
    Estimates,
    NamedFit,
    channel_weight,
    estimates_of,
    fitted,
    size_in_floors,
    within,
)
from cpfls_cli.gap.naming.ranking import (
    RankedStep,
    candidates_of,
    likely,
    log_odds,
    more_residual,
    names_of,
    rank_effects,
    scoring_matrix,
)
from cpfls_cli.gap.naming.results import Alternative, Estimate, NamedEffect, NotExcited, Unexplained
from cpfls_cli.gap.naming.search import of_motion
from cpfls_cli.gap.residual.dependence import joined_states, rank_dependence, state_signals, without_actuation
from cpfls_cli.gap.settings import CHANCE, CLEAR, COUNTS, ERRORS, OFF, RARE, VISIBLE, GapSettings
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.weak_form.windows import folds

Energy = Literal["feeds", "drains", "neither"]

_LOBE_CYCLES = 2
"""Half width of the main lobe of a Hann taper, in reciprocals of the flight: slower is no band but a drift."""

_FINER = 4  # Frequencies for each reciprocal of the flight: between two, a line loses 2 % of its power.
LOWEST = _FINER * _LOBE_CYCLES  # First bin above those that the mean leaks into.
_MEDIAN_CYCLES = 24  # Width of the running median, six times a line's.


@dataclass(frozen=True)
class NarrowBand:
    """The most significant narrow band."""

    channel: str  # One of `CHANNELS`.
    frequency_hz: float
    share: float  # Of the variance of the channel, above the background.
    # Probability that noise with the same smooth spectrum has a band as prominent, at any frequency of any channel.
    p_value: float
    energy: Energy  # Whether the band feeds energy into the rotation about its axis, drains it, or neither for sure.
    power: float  # Mean of residual times body rate in the band, in the unit of the residual times rad/s; 0 for forces.
    power_error: float  # Its standard error.


def narrow_band(
    residual: Sequence[Array],
    body_rate: Sequence[Array],
    hop_s: float,
    draws: int,
    rng: np.random.Generator,
    significance: float = 1.0,
    least: float = 0.0,
) -> NarrowBand | None:
    """Search for one narrow band above the smooth spectrum of the residual.

    The periodogram over all flights is divided by its background; the largest ratio of all frequencies and channels is
    compared with that of noise drawn from the background. Rows from windows of 0.4 s at a hop of 0.2 s show lines up
    to 2.5 Hz, but those from 2.5 to 5 Hz look like 2.5 to 0 Hz; at a hop of an eighth of the window the windows let
    through nothing that could be mistaken, and lines are seen up to about two periods per window.

    `residual`, each shape (window, 6), N m and N, or floors: of each flight; a channel that a flight lacks is 0.
    `body_rate`, each shape (window, 3), rad/s: over the same windows.
    `hop_s`: from one window to the next, s.
    `draws`: of noise, at most.
    `significance`: largest p that anybody asks for: no noise is drawn once p has to be larger.
    `least`: share of the variance that a band has to exceed: no noise is drawn for less.
    None where no flight is long enough to have a background, all rows are 0, or the band is less.
    Reference: Besag and Clifford 1991, sequential Monte Carlo p-values.
    """
    kept = [number for number, rows in enumerate(residual) if len(rows) > 2 * _MEDIAN_CYCLES and rows.any()]
    if not kept:
        return None
    flights, rates = [residual[number] for number in kept], [body_rate[number] for number in kept]
    present = np.array([rows.any(axis=0) for rows in flights])
    channels = np.flatnonzero(present.any(axis=0))
    lengths = [len(rows) for rows in flights]
    on = grid(lengths, hop_s)
    power = pooled_power([rows[:, channels].T for rows in flights], on)
    smooth = background(power, on)
    prominence = _prominence(power, on)
    strongest, peak = (int(i) for i in np.unravel_index(prominence.argmax(), prominence.shape))
    lobe = slice(max(0, peak - LOWEST), peak + LOWEST + 1)
    share = float(np.maximum(power[strongest] - smooth[strongest], 0)[lobe].sum() / power[strongest].sum())
    if not share > least:
        return None
    drawn = reached = 0
    while drawn < draws and 1 + reached <= significance * (1 + draws):
        noise = noise_like(smooth, lengths, present[:, channels], on, rng)
        reached += int(_prominence(noise, on).max() >= prominence.max())
        drawn += 1
    channel, frequency = int(channels[strongest]), _between_bins(power[strongest], peak, on)
    mean, error = _mean_power(channel, frequency, hop_s, flights, rates)
    return NarrowBand(
        channel=CHANNELS[channel],
        frequency_hz=frequency,
        share=share,
        p_value=(1 + reached) / (1 + drawn),
        energy="neither" if not abs(mean) > ERRORS * error else "feeds" if mean > 0 else "drains",
        power=mean,
        power_error=error,
    )


def _prominence(power: Array, on: Grid) -> Array:
    """Divide by the background; 0 at frequencies that are part of the mean."""
    ratio = power / background(power, on)
    ratio[:, :LOWEST] = 0
    return np.asarray(ratio)


def _between_bins(power: Array, peak: int, on: Grid) -> float:
    """Place the peak on the parabola through the logarithms of three bins."""
    if not 0 < peak < len(power) - 1:
        return float(on.frequency[peak])
    left, middle, right = np.log(power[peak - 1 : peak + 2])
    bend = left - 2 * middle + right
    offset = 0.5 * (left - right) / bend if bend < 0 else 0.0
    return float(on.frequency[peak] + np.clip(offset, -1, 1) * on.frequency[1])


def _mean_power(
    channel: int, frequency: float, hop_s: float, residual: Sequence[Array], body_rate: Sequence[Array]
) -> tuple[float, float]:
    """Average residual times rate in the band over segments that resolve it, with the error of the mean."""
    if channel >= body_rate[0].shape[1]:
        return 0.0, 0.0
    length = int(np.ceil(2 * _LOBE_CYCLES / (frequency * hop_s)))
    taper = np.hanning(length + 2)[1:-1]
    wave = np.exp(-2j * np.pi * frequency * hop_s * np.arange(length)) * taper * 2 / taper.sum()
    found = []
    for rows, rate in zip(residual, body_rate, strict=True):
        both = np.stack([rows[:, channel], rate[:, channel]])
        segments = both[:, : len(rate) // length * length].reshape(2, -1, length)
        # Complex amplitudes in the band.
        first, second = (segments - segments.mean(axis=2, keepdims=True)) @ wave
        found.append((first * second.conj()).real / 2)
    products = np.concatenate(found)
    if len(products) < 2:
        return float(products.mean()) if len(products) else 0.0, float(np.inf)
    return float(products.mean()), float(mean_error(products))


@dataclass(frozen=True)
class Grid:
    """Frequencies of the periodograms, four to each reciprocal of the longest flight."""

    samples: int  # To which series are filled up with zeros.
    frequency: Array  # Shape (frequency,), Hz.


def grid(lengths: Sequence[int], period: float) -> Grid:
    """Choose the frequencies for series of different lengths.

    `period`: from one row to the next, s.
    """
    samples = next_fast_len(_FINER * max(lengths), real=True)
    return Grid(samples, rfftfreq(samples, period))


def pooled_power(series: Sequence[Array], on: Grid) -> Array:
    """Sum the periodograms of flights under a Hann taper, shape (..., frequency).

    `series`: each shape (..., time).
    """
    total: Array = np.zeros(())
    for values in series:
        taper = np.hanning(values.shape[-1] + 2)[1:-1]
        tapered = (values - values.mean(axis=-1, keepdims=True)) * taper
        total = total + np.abs(rfft(tapered, on.samples)) ** 2 / (taper**2).sum()
    return np.asarray(total)


def background(power: Array, on: Grid) -> Array:
    """Estimate the smooth spectrum under possible lines.

    The shape of a first-order autoregression times a running median over 24 reciprocals of the flight: the median does
    not see a line, and the shape keeps its edges straight.

    `power`: shape (..., frequency).
    Result: shape (..., frequency); of the median of the power, not of its mean.
    Reference: Mann and Lees 1996, robust estimation of background noise and signal detection.
    """
    turn = np.pi * on.frequency / on.frequency[-1]
    correlation = (power @ np.cos(turn) / power.sum(axis=-1))[..., None]
    # A background is no steeper, or it would be taken for a line at 0.
    correlation = np.clip(correlation, -CORRELATIONS[-1], CORRELATIONS[-1])
    shape = 1 / (1 - 2 * correlation * np.cos(turn) + correlation**2)
    return np.asarray(shape * _running_median(power / shape))


def _running_median(power: Array) -> Array:
    used = power[..., LOWEST:]
    half = min(_MEDIAN_CYCLES * _FINER // 2, used.shape[-1] - 1)
    padded = np.pad(used, [(0, 0)] * (used.ndim - 1) + [(half, half)], mode="reflect")
    # Neighbouring bins are alike, and so are neighbouring medians: a part of them is enough.
    step = 2 * _FINER
    values = np.median(sliding_window_view(padded, 2 * half + 1, axis=-1)[..., ::step, ::2], axis=-1)
    # In straight lines between them, constant beyond the ends.
    inside = np.clip((np.arange(power.shape[-1]) - LOWEST) / step, 0, values.shape[-1] - 1)
    left = np.minimum(inside.astype(int), max(0, values.shape[-1] - 2))
    right = np.minimum(left + 1, values.shape[-1] - 1)
    share = inside - left
    return np.asarray(values[..., left] * (1 - share) + values[..., right] * share)


def noise_like(smooth: Array, lengths: Sequence[int], present: BoolArray, on: Grid, rng: np.random.Generator) -> Array:
    """Draw noise with a background and no line, and pool its periodogram, shape (channel, frequency).

    `smooth`: shape (channel, frequency); `lengths`: of the flights; `present`: shape (flight, channel).
    """
    series = []
    for length, there in zip(lengths, present, strict=True):
        white = rfft(rng.standard_normal((len(smooth), on.samples)))
        series.append(irfft(white * np.sqrt(smooth), on.samples)[:, :length] * there[:, None])
    return pooled_power(series, on)


_USUAL_OF_BOUND = 0.2  # A coefficient that is large but not unheard of, as a share of its bound.


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
    chosen = _beyond_chance(step, effects, settings, rng)
    vehicle, contain = found.hypothesis.vehicle, names_of(named).union(*(each.effect.holds for each in named))
    # A rival that explains more than chance next to the named ones is no rival.
    contain |= instead - names_of(chosen)
    others = [
        (each.candidate, usual_size(each.candidate.effect, vehicle, len(each.coefficients)))
        for each in step.ranking
        if _is_other(each.candidate.effect, contain)
    ]
    # A formula bends by as much as it is; one that is 0 does not.
    pairs = [(each, np.abs(size)) for each, size in zip(named, found.estimates.of_effect, strict=True) if size.all()]
    sizes = {bend.name: (bend, size) for each, size in pairs for bend in bends_of([each], flights)}
    bends = [bend for bend, _ in sizes.values()]
    if bends:
        bent = rank_effects(flights, chosen, bends, settings, rng)
        least = COUNTS * rank_effects(flights, (), (), settings, None, floor=bent.floor).above_floor
        large = (each for each in bent.ranking if each.gain > max(least, bent.least_gain()))
        counting = tuple(each.candidate.effect.title for each in large if bent.p_value(each.gain) <= RARE)
        others += [(each.candidate, sizes[each.candidate.effect.name][1]) for each in bent.ranking]
        chosen = _beyond_chance(bent, bends, settings, rng)
    unnamed, small = chosen[len(named) :], names_of([each for each, _ in others])
    wider = _averaged(found.estimates, *_with_others(found, others, step)) if others else found.estimates
    # A lag is no torque or force of a usual size: it is there as it is, or not.
    as_they_are = [each for each in unnamed if each.effect.name not in small]
    if as_they_are:
        joint = fitted(flights, [*named, *as_they_are], found.floor, settings).estimates
        wider = holding(wider, replace(joint, effects=joint.effects[: len(named)]))
    return wider, tuple(each.effect.title for each in unnamed), counting


def _is_other(effect: Effect, named: Set[str]) -> bool:
    """Check whether an effect adds torque and force of its own to those of named effects and of what these contain."""
    return effect.kind == "wrench" and not {effect.name, *effect.holds} & named


def _with_others(
    found: NamedFit, others: Sequence[tuple[Candidate, Array]], step: RankedStep
) -> tuple[list[Estimates], Array]:
    """Fit named effects together with others of a share of their size, and say how likely each is, shape (share,).

    `others`: each with the usual size of its linear coefficients. The first share is none, the others are decades.
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
    for share in (0.0, OFF**2, OFF, 1.0):
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
        if len(there) < len(fits) or not np.isfinite(half).all():
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
    title = f"a bend of {effect.title} over {over}"
    return replace(effect, name=name, title=title, columns=columns, coefficients=either, needs=needs)


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
