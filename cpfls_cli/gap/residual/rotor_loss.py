"""A rotor that pulls less from a moment of a flight on: a propeller that lost a piece, a motor that weakened."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.effects.effect import Columns
from cpfls_cli.gap.balance.balance_system import System
from cpfls_cli.gap.settings import ERRORS, GapSettings
from cpfls_cli.result import Estimate, about, part, result
from cpfls_cli.rounding import ROUNDING


@result
class RotorLoss:
    """A rotor that pulls less than before, from a moment of a flight on."""

    flight: str = about("name of the flight")
    rotor: int = about("number of the rotor, from 1")
    time_s: float = about("from when on, on the clock of the flight", unit="s")
    loss: Estimate = part()

    @property
    def sentence(self) -> str:
        """What happened, and when."""
        value, low, high = (100 * each for each in (self.loss.value, self.loss.low, self.loss.high))
        return (
            f"in {self.flight} M{self.rotor} pulls {value:.2g} % [{low:.2g}, {high:.2g}] less from {self.time_s:.1f} s"
            " on: look for a propeller that lost a piece, or a motor that weakened"
        )


def rotor_losses(
    system: System,
    linear: Array,
    floor: Array,
    settings: GapSettings,
    rng: np.random.Generator,
    above_chance: float = ERRORS**4,
) -> Iterator[RotorLoss]:
    """Find rotors that lose thrust at one moment of a flight.

    From each moment on, but in the first and the last block of a flight, each rotor may pull less, and all the time its
    thrust may be wrong by a share. What a loss explains of the residual is compared with what it explains of the same
    residual without it, shifted in time, which has the memory of gusts and of whatever else is missing. What no single
    rotor does, such as an emptier battery or a load that shifts, is none.

    Parameters
    ----------
    system : System
        Flights under what was named.
    linear : array, shape (column,)
        Of its `base`.
    floor : array, shape (6,), N m and N
    above_chance : float
        Times that a loss has to explain more than any of those does; as usual it is four times as large.
    """
    residual = system.residual_at(linear) / floor
    for number, (flight, signals) in enumerate(zip(system.flights, system.signals, strict=True)):
        # A propeller that lost a piece may drag as before.
        known = flight.known & np.isin(np.arange(6), (0, 1, 5))
        if signals.rotor_speed is None or known.sum() < 2:
            continue
        time = flight.windows.centres(signals.time)
        within = (time > time[0] + settings.block_s) & (time < time[-1] - settings.block_s)
        thrust, roll, pitch, _ = signals.allocation[:, None] * signals.speed**2
        nothing = np.zeros_like(thrust)
        direct = np.stack([roll, pitch, nothing, nothing, nothing, thrust], axis=1)
        own = (flight.averaged(Columns(direct)) / floor[:, None])[:, known]
        rows = residual[system.flight_index == number][:, known]
        found = _step(rows, own, within, settings, rng, above_chance) if within.any() else None
        if found is not None:
            rotor, moment, loss = found
            yield RotorLoss(flight=flight.name, rotor=rotor + 1, time_s=float(time[moment]), loss=loss)


def _step(
    rows: Array, own: Array, within: BoolArray, settings: GapSettings, rng: np.random.Generator, above_chance: float
) -> tuple[int, int, Estimate] | None:
    """Find the rotor and the window from which on a loss explains most; None where that is chance, or no single rotor.

    `rows`, shape (window, channel), floors: a residual; `own`, shape (window, channel, rotor): thrust in it; `within`,
    shape (window,): where a loss may begin.
    """
    always = np.linalg.qr(own.reshape(-1, own.shape[2]))[0].reshape(own.shape)

    def without_constant(values: Array) -> Array:
        """Take off what a share that is wrong all the time explains, of values, shape (window, channel, ...)."""
        return np.asarray(values - np.tensordot(always, np.tensordot(always, values, ((0, 1), (0, 1))), (2, 0)))

    def from_each(values: Array) -> Array:
        """Sum over each window within and all behind it, and over channels."""
        return np.cumsum(values.sum(axis=1)[::-1], axis=0)[::-1][within]

    # Products of what rotors give from each window on, without what they give all the time: (window, rotor, rotor).
    taken = from_each(always[..., None] * own[:, :, None])
    products = from_each(own[..., None] * own[:, :, None]) - np.einsum("wqa,wqb->wab", taken, taken)
    squares = np.einsum("waa->wa", products)
    # A rotor that does not turn from then on, or never does, identifies nothing.
    squares = np.where(squares > ROUNDING * (own**2).sum(axis=(0, 1)), squares, np.inf)
    left = without_constant(rows)
    seen = from_each(own * left[..., None])
    gains = np.where(seen < 0, seen**2 / squares, 0.0)
    moment, rotor = np.unravel_index(int(np.argmax(gains)), gains.shape)
    first = int(np.flatnonzero(within)[moment])
    lost = own[..., rotor] * (np.arange(len(rows)) >= first)[:, None]
    shares = seen[:, rotor] / squares[:, rotor]
    without = left - without_constant(lost) * shares[moment]
    shifts = rng.integers(1, len(rows), settings.shifts)
    shifted = without_constant(np.stack([np.roll(without, by, axis=0) for by in shifts], axis=2))
    chance = from_each(own[..., None] * shifted[:, :, None])
    most = (chance**2 / squares[..., None]).max()
    if gains[moment, rotor] <= above_chance * most:
        return None
    any_rotor = seen[moment] @ np.linalg.lstsq(products[moment], seen[moment], rcond=None)[0]
    if gains[moment, rotor] < settings.named_share * any_rotor:
        return None
    # Windows about the moment see both; and it may have been whenever a loss explains as much but for chance.
    apart = np.abs(np.arange(len(rows)) - first) > 1
    matrix = np.concatenate([own, lost[..., None]], axis=2)[apart].reshape(-1, own.shape[2] + 1)
    loss = -np.linalg.lstsq(matrix, rows[apart].ravel(), rcond=None)[0][-1]
    as_good = shares[gains[:, rotor] >= gains[moment, rotor] - most]
    by_chance = np.sqrt((chance[moment, rotor] ** 2).mean()) / squares[moment, rotor]
    half = ERRORS * by_chance + 0.5 * np.ptp(as_good)
    return int(rotor), first, Estimate.around(loss, half)
