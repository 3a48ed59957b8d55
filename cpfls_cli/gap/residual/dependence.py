"""Which signal a residual follows, judged on unseen blocks, its worst stretches and its mean over two signals."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from typing import Annotated, NamedTuple

import numpy as np
from numpy.polynomial import chebyshev
from scipy.ndimage import binary_closing, uniform_filter1d

from cpfls_cli.arrays import Array, IntArray, runs
from cpfls_cli.blocks import FEWEST_BLOCKS
from cpfls_cli.effects.signals import Signals
from cpfls_cli.gap.balance.weak_flight import CHANNELS, WeakFlight
from cpfls_cli.gap.settings import CHANCE
from cpfls_cli.result import About, about, result
from cpfls_cli.rounding import ascending
from cpfls_cli.weak_form.windows import about_flight_mean, folds, mirror_shifted

_DEGREE = 4  # Of curves, and of waves around a circle: what formulas leave out is hardly more crooked.
OUTER_PERCENT = 0.5  # Of a signal at either end, where a few windows would decide.
ANGLES = ("roll", "yaw")  # Signals that come back after a full turn.


class Dependence(NamedTuple):
    """Share of a channel of the residual that one signal alone explains."""

    channel: Annotated[str, About("channel of the gap")]
    signal: Annotated[str, About("signal that the gap is explained with, alone")]
    r2: Annotated[
        float,
        About(
            "share of the variance about the mean of each flight that a curve over the signal explains on blocks that "
            "its fit did not see; negative where it is worse than none"
        ),
    ]
    p_value: Annotated[float, About("probability that chance does as well with any signal")]

    @property
    def sure(self) -> bool:
        """Whether it is no chance."""
        return self.p_value < CHANCE and self.r2 > 0


def rank_dependence(
    residual: Array,
    flight_index: IntArray,
    block: IntArray,
    state: Mapping[str, Array],
    shifts: int,
    rng: np.random.Generator,
) -> tuple[Dependence, ...]:
    """Rank what each signal alone explains of each channel.

    The curve is a quartic polynomial of the scaled signal, for roll and yaw four harmonics. Curve and residual are
    taken about their mean over each flight, so that differences between flights, of which there are few, explain
    nothing. Neighbouring windows are alike, which makes tests for independent rows useless: here the residual of each
    flight is shifted in time against the signals (`mirror_shifted`), and the best share of all channels and signals is
    what chance has to offer (family-wise).

    `residual`, shape (window, 6), N m and N, or floors: a channel that a flight lacks is 0 all through it.
    `flight_index`: shape (window,).
    `block`, shape (window,): from 0, without gaps; left out one by one.
    `state`, each shape (window,): not a number where a flight lacks the signal; it is judged on the other flights.
    `shifts`: number of draws of chance.
    Result: largest share first; channels without residual and signals that stand still are left out.
    Reference: Winkler et al. 2014, permutation inference with the largest statistic; Politis and Romano 1992, circular
    blocks.
    """
    shifted = mirror_shifted(residual, flight_index, shifts, rng)
    draws = np.concatenate([about_flight_mean(residual, flight_index)[..., None], shifted], axis=2)
    shares: list[tuple[int, str, Array]] = []
    for channels, rows, names in _where_known(residual, flight_index, state):
        curves = {name: curve for name in names if (curve := _curve(name, state[name][rows])).size}
        if not curves or len(np.unique(block[rows])) < FEWEST_BLOCKS:
            continue
        columns, drawn = np.concatenate(list(curves.values()), axis=1), draws[np.ix_(rows, channels)]
        columns = about_flight_mean(columns, flight_index[rows])
        normal = folds(columns[:, None], drawn.reshape(len(rows), 1, -1), block[rows])
        total, end = np.maximum(normal.square.sum(axis=0), np.finfo(float).tiny), 0
        for name, curve in curves.items():
            left = normal.solve(np.arange(end, end := end + curve.shape[1]))[1].sum(axis=0)
            share = (1 - left / total).reshape(drawn.shape[1:])
            shares += [(int(channel), name, by_draw) for channel, by_draw in zip(channels, share, strict=True)]
    if not shares:
        return ()
    chance = np.max([share[1:] for _, _, share in shares], axis=0)
    ranked = [
        Dependence(CHANNELS[channel], name, float(share[0]), float((1 + (chance >= share[0]).sum()) / (1 + shifts)))
        for channel, name, share in shares
    ]
    return tuple(ascending(ranked, lambda one: -one.r2))


def _where_known(
    residual: Array, flight_index: IntArray, state: Mapping[str, Array]
) -> Iterator[tuple[IntArray, IntArray, list[str]]]:
    """Group channels by the flights that have them, and signals by the windows: channels, windows with both, signals.

    All signals that the same windows have are fitted to products of all of them.
    """
    flights, number = np.unique(flight_index, return_inverse=True)
    present = np.array([(residual[number == f] != 0).any(axis=0) for f in range(len(flights))])
    alike: dict[bytes, list[str]] = {}
    for name, signal in state.items():
        alike.setdefault(np.isfinite(signal).tobytes(), []).append(name)
    for names, pattern in product(alike.values(), np.unique(present, axis=1).T):
        channels = np.flatnonzero((present == pattern[:, None]).all(axis=0))
        rows = np.flatnonzero(pattern[number] & np.isfinite(state[names[0]]))
        if len(rows):
            yield channels, rows, names


def _curve(name: str, signal: Array) -> Array:
    if name in ANGLES:
        turns = np.multiply.outer(signal, np.arange(1, _DEGREE + 1))
        return np.concatenate([np.sin(turns), np.cos(turns)], axis=1)
    low, high = np.percentile(signal, [OUTER_PERCENT, 100 - OUTER_PERCENT])
    if not high > low:
        return np.zeros((len(signal), 0))
    # Beyond the outer percents the curve stays constant, or a few windows would decide a quartic.
    scaled = np.clip(2 * (signal - low) / (high - low) - 1, -1, 1)
    return np.asarray(chebyshev.chebvander(scaled, _DEGREE)[:, 1:])


def state_signals(flight: WeakFlight, signals: Signals) -> dict[str, Array]:
    """Average the signals of motion and actuation over the windows of a flight.

    `signals`: of the flight, as measured or with actuator effects applied.
    Result: SI units; velocities through the air in the body frame, angles within half a turn.
    """
    averaged = {"time": flight.windows.centres(signals.time) - signals.time[0]}
    for name, values in _instantaneous(signals):
        averaged[name] = flight.windows.average(values)
    return averaged | {name: (averaged[name] + np.pi) % (2 * np.pi) - np.pi for name in ANGLES if name in averaged}


def joined_states(states: Sequence[Mapping[str, Array]]) -> dict[str, Array]:
    """Concatenate the states of several flights, NaN where a flight lacks a signal.

    `states`, each shape (window,): of each flight.
    """
    names = dict.fromkeys(name for state in states for name in state)
    return {
        name: np.concatenate([state.get(name, np.full(len(state["time"]), np.nan)) for state in states])
        for name in names
    }


def without_actuation(state: Mapping[str, Array]) -> dict[str, Array]:
    """Drop the signals of the rotors.

    The controller answers every disturbance with the rotors, and their noise is noise of the residual, so that a
    residual nearly always follows their torque, whichever its cause. Causes are looked for among the other signals.

    `state`: each shape (window,).
    """
    return {name: values for name, values in state.items() if not name.startswith(("rotor", "thrust"))}


def _instantaneous(signals: Signals) -> Iterator[tuple[str, Array]]:
    """Name the signals of motion and actuation, sample by sample."""
    yield from _axes("body rate", signals.body_rate)
    if signals.attitude is not None:
        # A turn through half a turn must not average to zero.
        yield from zip(("roll", "pitch", "yaw"), np.unwrap(signals.attitude, axis=0).T, strict=True)
    if signals.velocity is not None:
        if signals.attitude is not None:
            yield from _axes("air velocity", signals.air_velocity)
        yield "speed", np.linalg.norm(signals.velocity, axis=1)
        yield "horizontal speed", np.linalg.norm(signals.velocity[:, :2], axis=1)
        yield "vertical speed", signals.velocity[:, 2]
    if signals.position is not None:
        yield "height", signals.position[:, 2] - signals.ground_height_m
    if signals.rotor_speed is not None:
        for number, speed in enumerate(signals.rotor_speed.T, start=1):
            yield f"rotor speed {number}", speed
    if signals.thrust is not None:
        yield "thrust", signals.thrust
    if signals.torque is not None:
        yield from _axes("rotor torque", signals.torque)
    if signals.voltage is not None:
        yield "voltage", signals.voltage


def _axes(name: str, values: Array) -> Iterator[tuple[str, Array]]:
    for axis, column in zip("xyz", values.T, strict=True):
        yield f"{name} {axis}", column


_WORST_SHARE = 0.1  # Of the time is called worst.
_LONGEST_PAUSE_S = 1.0
"""With pauses up to this long in it, over which the residual is averaged: a zero crossing makes no gap small."""


class GapStretch(NamedTuple):
    """A stretch of a flight with a large gap."""

    flight: Annotated[int, About("index of the flight")]
    start_s: Annotated[float, About("on the clock of the flight", unit="s")]
    end_s: Annotated[float, About("on the clock of the flight", unit="s")]
    channel: Annotated[str, About("channel of the gap")]
    rms_floors: Annotated[float, About("root mean square of the gap there, in floors")]


def stretches(
    residual: Array, centres: Array, flight_index: IntArray, level: float = 2.0, most: int = 5
) -> tuple[GapStretch, ...]:
    """Find the stretches of time in which the gap is largest.

    Windows whose root mean square over their neighbours is above the level and among the largest tenth of the channel;
    runs with short pauses between them are one stretch.

    `residual`: shape (window, 6), floors.
    `centres`, shape (window,), s: middle of each window.
    `flight_index`: shape (window,).
    `level`: least root mean square, in floors.
    `most`: largest number per channel.
    Result: largest first.
    """
    largest = []
    for channel in range(residual.shape[1]):
        of_channel = list(_of_channel(channel, residual[:, channel], centres, flight_index, level))
        largest += ascending(of_channel, lambda stretch: -stretch.rms_floors)[:most]
    return tuple(ascending(largest, lambda stretch: -stretch.rms_floors))


def _of_channel(
    channel: int, residual: Array, centres: Array, flight_index: IntArray, level: float
) -> Iterator[GapStretch]:
    flights = [np.flatnonzero(flight_index == flight) for flight in np.unique(flight_index)]
    hops = [float(np.ptp(centres[rows[:2]])) for rows in flights]
    pauses = [round(_LONGEST_PAUSE_S / hop) if hop else 0 for hop in hops]
    # What is averaged over neighbours has no zero crossings; the filter's running sum can end below 0 by rounding.
    size = [
        np.sqrt(np.maximum(uniform_filter1d(residual[rows] ** 2, max(1, pause), mode="nearest"), 0.0))
        for rows, pause in zip(flights, pauses, strict=True)
    ]
    least = max(level, float(np.quantile(np.concatenate(size), 1 - _WORST_SHARE)))
    for rows, local, hop, pause in zip(flights, size, hops, pauses, strict=True):
        above = local >= least
        joined = binary_closing(np.pad(above, pause), np.ones(pause + 1, dtype=bool))[pause : pause + len(above)]
        for run in runs(above | joined):
            inside = rows[slice(*run)]
            rms = float(np.sqrt(np.mean(residual[inside] ** 2)))
            start, end = float(centres[inside[0]]) - hop / 2, float(centres[inside[-1]]) + hop / 2
            yield GapStretch(int(flight_index[rows[0]]), start, end, CHANNELS[channel], rms)


@result
class HeatMap:
    """Mean gap of a channel in the cells of a grid over two signals."""

    channel: str = about("channel with the largest gap in floors")
    signals: tuple[str, ...] = about("the two signals that explain it best", "2")
    first_edge: Array = about("edges of the cells along the first signal", "edge", unit="SI", brief=False)
    second_edge: Array = about("edges of the cells along the second signal", "edge", unit="SI", brief=False)
    mean: Array = about(
        "mean gap in each cell, N m or N; NaN in empty ones", "first", "second", unit="SI", gaps=True, brief=False
    )
    count: Array = about("windows in each cell", "first", "second", brief=False)


def heat_map(
    channel: str, residual: Array, signals: tuple[str, str], states: Mapping[str, Array], bins: int = 12
) -> HeatMap:
    """Average a residual over the cells of two signals.

    The outer cells also take the half per cent of windows beyond each end of the grid, so that a few windows do not
    stretch it.

    `residual`, shape (window,): of the channel.
    `states`, each shape (window,): by signal; windows where one is not a number are left out.
    `bins`: cells along each signal.
    """
    first, second = (states[name] for name in signals)
    known = np.isfinite(residual) & np.isfinite(first) & np.isfinite(second)
    values = [first[known], second[known]]
    edges = [_edges(each, bins) for each in values]
    across, along = (np.clip(each, own[0], own[-1]) for own, each in zip(edges, values, strict=True))
    count = np.histogram2d(across, along, edges)[0]
    total = np.histogram2d(across, along, edges, weights=residual[known])[0]
    mean = np.divide(total, count, out=np.full_like(count, np.nan), where=count > 0)
    return HeatMap(channel=channel, signals=signals, first_edge=edges[0], second_edge=edges[1], mean=mean, count=count)


def _edges(signal: Array, bins: int) -> Array:
    if not len(signal):
        return np.linspace(0.0, 1.0, bins + 1)
    low, high = np.percentile(signal, [OUTER_PERCENT, 100 - OUTER_PERCENT])
    # A signal that does not change needs cells of some width, too.
    return np.linspace(low, high if high > low else low + max(1e-9, 1e-9 * abs(low)), bins + 1)
