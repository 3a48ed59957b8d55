"""How far a closed loop can mislead a fit: bounds on the torque that a turn of the body takes.

A vehicle under an autopilot answers what disturbs it. Where its torque cancels a gust, more torque is seen than
rotation, and a fit of rotation on torque finds a body that is too heavy; where a gust turns the vehicle before it is
answered, more rotation is seen than torque, and a fit of torque on rotation finds one that is too light. The two
regressions enclose the body, band by band of frequency; where no gust blows and the model is right, they agree in all.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Annotated, NamedTuple

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.blocks import BLOCK_S, FEWEST_BLOCKS, contiguous, half_width, jackknife_error
from cpfls_cli.flightlog.stated_vehicle import SLOW_HZ
from cpfls_cli.inertia import EXPLAINED, rescaled
from cpfls_cli.playback.balances import BANDS, band_windows
from cpfls_cli.playback.flight import PlaybackFlight
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.playback.rotors import RotorResponse
from cpfls_cli.result import BODY, About
from cpfls_cli.rounding import largest, less
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.weak_form.windows import FEWEST_SAMPLES

_BANDS = BANDS[1:4]
"""Together they span what an autopilot answers late and what it answers in time, whatever its bandwidth."""
_FASTER = (0.05, 0.15)
"""Of the same kind, about 6 to 20 Hz: shown with the others, and in no bound, for rotors and frames answer there."""
_LAGS = (0.0, 0.01, 0.02, 0.05, 0.1)
"""Lags of rotors that are tried where none is known, s."""
ANY = 10.0
"""Factor either way from which on a body can be any."""
_TINY = np.finfo(float).tiny
_LEAVES_LESS = 0.5
"""Of what a model leaves unexplained: one without its effects that leaves less shows that it is wrong."""
_FORMULAS = 1.15
"""Factor by which lag and thrust of a formula move both bounds: a sagging battery or a filter did by up to 1.12."""
_PASSES = 2
"""By which a guess that is off a hundredfold has come to the middle of the bounds."""
_MOST_NOISE = 0.1
"""Of the power of a band that may be noise of the sensors: with more, the residual is the noise's error."""


def _by_axis(text: str, unit: str = "1") -> About:
    return About(text, ("axis",), unit=unit, frame=BODY, gaps=True)


class LoopBounds(NamedTuple):
    """Bounds on moments of inertia, in those of a model, from how its torque and the rotation go together.

    What is explained may be of a better model than that of the bounds.
    """

    low: Annotated[Array, _by_axis("least factor on the moment of inertia; 1 lies between both if the model is right")]
    high: Annotated[Array, _by_axis("largest factor on the moment of inertia")]
    explained: Annotated[Array, _by_axis("share of the rotation in a band that torque explains, the least")]
    band_hz: Annotated[Array, About("ends of bands, about", ("loop band", "2"), unit="Hz")] = np.zeros((0, 2))
    by_band: Annotated[
        Array, About("share of the rotation that torque explains", ("loop band", "axis"), frame=BODY, gaps=True)
    ] = np.zeros((0, 3))
    turning: Annotated[Array, _by_axis("body rate, root mean square", "rad/s")] = np.full(3, np.nan)
    missed: Annotated[
        Array, _by_axis("share explained by the model that was found, where rotors that only lag explain much more")
    ] = np.full(3, np.nan)
    lags_s: Annotated[
        Array, About("lag of these rotors, after the next shorter and before the next longer one tried", ("3",), "s")
    ] = np.zeros(3)

    @property
    def shows_loop(self) -> bool:
        """Whether so much of roll or pitch is left unexplained that numbers may be those of the loop."""
        return bool((self.explained[:2] < EXPLAINED).any()) and not self.misses

    @property
    def misses(self) -> bool:
        """Whether a model explains much less of roll or pitch than rotors that only lag."""
        return bool(np.isfinite(self.missed[:2]).any())

    @property
    def misses_alone(self) -> bool:
        """Whether that model is all that is wrong: rotors that only lag explain the flights, and so show no loop."""
        return self.misses and not (self.explained[:2] < EXPLAINED).any()

    @property
    def unexplained(self) -> bool:
        """Whether numbers of a fit may be none of the vehicle's: those of the loop, or of what explains no flight."""
        return self.shows_loop or self.misses

    @property
    def least(self) -> float:
        """What is explained about roll or pitch, the less of the two; infinite where neither is known."""
        return float(np.nanmin([*self.explained[:2], np.inf]))

    def up_to(self, highest_hz: float) -> LoopBounds:
        """Leave out the fastest band, which no bound rests on, where most of it is above a frequency, Hz."""
        shown = self.by_band.copy()
        shown[-1:][np.sqrt(self.band_hz[-1:].prod(axis=1)) > highest_hz] = np.nan
        return self._replace(by_band=shown)


def loop_bounds(model: VehicleModel, flights: Sequence[PlaybackFlight]) -> LoopBounds:
    """Bound the moments of inertia that the flights of a closed loop allow, in those of a model.

    With ``t`` the model's torque and ``h`` the torque that its inertia takes along the motion, both in a band, ``<t, h>
    / <h, h>`` and ``<t, t> / <t, h>`` are the factors by which torque on rotation and rotation on torque want the
    inertia changed. A disturbance that the torque opposes and that turns the vehicle its own way leaves the true factor
    between them. The torque is taken without slow actuation: a torque that fades by itself is how an autopilot that
    cancels gusts looks. The widest bounds of all bands in which motion is above noise, with 95 % of the scatter
    over blocks. Frisch 1934 (bounds by regression both ways); Forssell and Ljung 1999 (closed-loop identification
    revisited).
    """
    model = replace(model, response=replace(model.response, slow_roll_pitch=0.0, slow_yaw=0.0))
    found = bounds_between([_balanced(model, flight, part) for flight in flights for part in flight.stretches])
    rates = np.concatenate([flight.motion.rate[part] for flight in flights for part in flight.stretches])
    return found._replace(turning=np.sqrt((rates**2).mean(axis=0)))


def loop_and_plain(model: VehicleModel, vehicle: VehicleSettings, flights: Sequence[PlaybackFlight]) -> LoopBounds:
    """Bound as `loop_bounds` does, and judge flights by what explains them best: a model, or rotors that only lag.

    A model that was found and is wrong explains little of flights that show the vehicle well. The bounds are then those
    of the rotors, in the stated moments of inertia, about yaw in their ratio to the drag factor; an end is not finite
    where any body would do.
    """
    found = loop_bounds(model, flights)
    if not found.shows_loop:
        return found
    known = np.isfinite(found.by_band[:, :2])
    tried = enumerate(_plain_bounds(vehicle, flights))
    plain = [(at, bounds) for at, bounds in tried if np.isfinite(bounds.by_band[:, :2])[known].all()]
    at, best = largest([(0, found), *plain], lambda each: each[1].least)
    better = found._replace(explained=best.explained, by_band=best.by_band)
    left = 1 - found.explained[:2]
    far = (left > 1 - EXPLAINED) & less(1 - best.explained[:2], _LEAVES_LESS * left)
    if best.shows_loop and not far.any():
        return better
    low, high = _of_any_guess(vehicle, _LAGS[at], flights, best)
    lags = np.array([_LAGS[max(at - 1, 0)], _LAGS[at], (*_LAGS, 2 * _LAGS[-1])[at + 1]])
    return better._replace(missed=found.explained, low=low, high=high, lags_s=lags)


def shows_loop_anyhow(vehicle: VehicleSettings, flights: Sequence[PlaybackFlight], logged_hz: float) -> bool:
    """Tell before any search whether no body can be found, because the rotors are logged too slowly.

    They are where motors are logged below `SLOW_HZ`, and with no lag of the rotors the torque explains the rotation
    about roll and pitch. Neither depends on the size of the inertia.

    Parameters
    ----------
    logged_hz : float, Hz
        How often the logs hold the rotors.
    """
    if logged_hz >= SLOW_HZ:
        return False
    return all(bounds.shows_loop for bounds in _plain_bounds(vehicle, flights))


def _plain_bounds(vehicle: VehicleSettings, flights: Sequence[PlaybackFlight]) -> Iterator[LoopBounds]:
    for lag in _LAGS:
        yield loop_bounds(VehicleModel(vehicle=vehicle, response=RotorResponse(lag_s=lag)), flights)


def _of_any_guess(
    vehicle: VehicleSettings, lag_s: float, flights: Sequence[PlaybackFlight], bounds: LoopBounds
) -> tuple[Array, Array]:
    """Bound around the middle of bounds once more: a body that is far off, or out of proportion, hides those there are.

    In the stated moments of inertia, with what lag and thrust of a formula add; an end that any body has is not finite.
    """
    middle = np.ones(3)
    for _ in range(_PASSES):
        middle = middle * np.nan_to_num(np.sqrt(bounds.low * bounds.high), nan=1.0)
        moved = replace(vehicle, inertia_kg_m2=rescaled(vehicle.inertia_kg_m2, middle))
        bounds = loop_bounds(VehicleModel(vehicle=moved, response=RotorResponse(lag_s=lag_s)), flights)
    low = np.where(bounds.low > 1 / ANY, middle * bounds.low / _FORMULAS, np.nan)
    return low, np.where(bounds.high < ANY, middle * bounds.high * _FORMULAS, np.nan)


class BalancedTorque(NamedTuple):
    """A stretch of the torque that acts, and of what a model's turn takes: a momentum's change and what adds to it.

    Attributes
    ----------
    torque, direct : array, shape (time, 3), N m, body frame
    momentum : array, shape (time, 3), N m s, body frame
    period : float, s
    """

    torque: Array
    momentum: Array
    direct: Array
    period: float


def bounds_between(stretches: Sequence[BalancedTorque]) -> LoopBounds:
    """Bound the factors that stretches allow; see `loop_bounds`."""
    low, high, explained = np.full(3, np.nan), np.full(3, np.nan), np.full(3, np.nan)
    by_band = np.full((len(_BANDS) + 1, 3), np.nan)
    for index, band in enumerate((*_BANDS, _FASTER)):
        sums = np.array([block for stretch in stretches for block in _sums(stretch, *band)])
        if len(sums) < FEWEST_BLOCKS:
            continue
        total = sums.sum(axis=0)
        seen = (total[:, 3:] < _MOST_NOISE * total[:, [0, 2]]).all(axis=1)
        lighter, heavier = np.where(seen, _factors(total), np.nan)
        by_band[index] = np.where(seen, _explained(total), np.nan)
        if band == _FASTER:
            continue
        half = half_width(jackknife_error(np.log(_factors(total - sums))), len(sums))
        low, high = np.fmin(low, lighter * np.exp(-half[0])), np.fmax(high, heavier * np.exp(half[1]))
        explained = np.fmin(explained, by_band[index])
    bands_hz = 1 / np.array([(long_s, short_s) for short_s, long_s in (*_BANDS, _FASTER)])
    return LoopBounds(np.maximum(low, 1 / ANY), np.minimum(high, ANY), explained, bands_hz, by_band)


def _factors(sums: Array) -> Array:
    """Divide sums of products to the factors that torque on rotation and rotation on torque want, shape (2, ..., 3).

    A torque that goes against the rotation leaves any body.
    """
    torque, both, turning = _without_noise(sums)
    both = np.maximum(both, _TINY)
    # A divisor that small would make a factor beyond any, or beyond all numbers.
    factors = [both / np.maximum(turning, both / ANY), torque / np.maximum(both, torque / ANY)]
    return np.maximum(factors, 1 / ANY)


def _explained(sums: Array) -> Array:
    """Compute the share of the rotation that a torque explains, of any size: their squared correlation."""
    torque, both, turning = _without_noise(sums)
    most = np.sqrt(torque) * np.sqrt(turning)
    return np.asarray((np.clip(both, 0.0, most) / most) ** 2)


def _without_noise(sums: Array) -> tuple[Array, Array, Array]:
    torque, both, turning, noise_of_torque, noise_of_turning = np.moveaxis(sums, -1, 0)
    # Blocks without motion hold noise alone, and less of it than is taken off.
    return np.maximum(torque - noise_of_torque, _TINY), both, np.maximum(turning - noise_of_turning, _TINY)


def _balanced(model: VehicleModel, flight: PlaybackFlight, stretch: slice) -> BalancedTorque:
    rate = flight.motion.rate[stretch]
    momentum = rate @ model.body.inertia
    torque = wrench_during(model, flight, stretch)[:, :3]
    return BalancedTorque(torque, momentum, np.cross(rate, momentum), flight.motion.period)


def _sums(stretch: BalancedTorque, short_s: float, long_s: float) -> Iterator[Array]:
    """Sum products of torque and of what the rotation takes over blocks of windows, shape (axis, 5).

    The last two are noise: white noise is as large in windows of alternating sign, where motion vanishes.
    """
    torque, momentum, direct, period = stretch
    if short_s < FEWEST_SAMPLES * period:
        return
    band = band_windows(period, short_s, long_s)
    count = band.count(len(torque))
    if not count:
        return
    noise = band.alternating()
    (seen, turning), (unseen, trembling) = (
        (each.average(torque), each.balance(direct, momentum)) for each in (band, noise)
    )
    products = np.stack([seen**2, seen * turning, turning**2, unseen**2, trembling**2], axis=2)
    blocks = max(1, round(count * band.hop * period / BLOCK_S))
    number = contiguous(count, blocks)
    yield from (products[number == block].sum(axis=0) for block in range(blocks))


def wrench_during(model: VehicleModel, flight: PlaybackFlight, stretch: slice) -> Array:
    """Evaluate torque and force of rotors and effects at the samples of a stretch, shape (time, 6), N m and N, body."""
    return model.wrench(*during(model, flight, stretch))


def during(model: VehicleModel, flight: PlaybackFlight, stretch: slice) -> tuple[Array, Array, Array]:
    """Give air velocity, body rate and terms of the rotors at the samples of a stretch."""
    motion = flight.motion
    air = np.einsum("tji,tj->ti", motion.rotation[stretch], motion.velocity[stretch] - np.array(model.wind))
    rotor = model.response.terms_at_samples(flight.speed[stretch], motion.period, flight.hold)
    return air, motion.rate[stretch], rotor
