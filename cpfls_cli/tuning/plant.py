"""A vehicle in hover as the rate control of an autopilot meets it, from commands to body rates, and its noise."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product

import numpy as np

from cpfls_cli.arrays import Array, Numbers
from cpfls_cli.autopilots.law import Law, chain
from cpfls_cli.autopilots.motors import Motors
from cpfls_cli.errors import ComputationError
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.result import about, result
from cpfls_cli.simulation.closed_loop import flown_vehicle, given_turning, settled, turning_of
from cpfls_cli.simulation.model import SimulatedEffects, with_effects
from cpfls_cli.vehicle.motion import BODY_RATE, VEHICLE_STATES, VELOCITY, Vehicle
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.vehicle.values import ARRAYS, Tangent


@dataclass(frozen=True)
class AxisPlant:
    """Angular acceleration about one axis by the command of a law, in hover.

    ``(b + b_a s + b_s / (1 + s T_s)) exp(-s d) / (1 + s tau)``, over ``s + damping``.

    Attributes
    ----------
    gain : float, rad/s^2
        b: of a full command, when the rotors have reached their speeds.
    by_acceleration : float, rad/s
        b_a: by the acceleration of the rotors, which carry angular momentum.
    slow, slow_s : float, rad/s^2 and s
        b_s and T_s: what comes slowly on top of `gain`.
    damping : float, 1/s
    lag, delay : float, s
        tau and d: of the rotors behind the command.
    """

    gain: float
    by_acceleration: float
    slow: float
    slow_s: float
    damping: float
    lag: float
    delay: float

    def response(self, frequency: Array) -> Numbers:
        """Evaluate body rate by command, shape (frequency,), Hz."""
        s = 2j * np.pi * frequency
        torque = self.gain + self.by_acceleration * s + self.slow / (1 + s * self.slow_s)
        return np.asarray(torque * np.exp(-s * self.delay) / ((1 + s * self.lag) * (s + self.damping)))


@dataclass(frozen=True)
class Spread:
    """Ends of the intervals of what the control of an axis meets, by factors on it.

    Attributes
    ----------
    gain, lag, delay : tuple of float
        Lowest and highest factor on gain (with the other parts of torque), lag and delay.
    delayed : float
        Largest part of the lag that may be a delay instead, which no derivative of a law makes up for.
    trade : float
        Correlation of lag and delay; where it is below 0 their sum is known better than either, and the ends are those
        of both, of either and of the sum on the ellipse of their 95 % intervals.
    """

    gain: tuple[float, float] = (1.0, 1.0)
    lag: tuple[float, float] = (1.0, 1.0)
    delay: tuple[float, float] = (1.0, 1.0)
    delayed: float = 0.0
    trade: float = 0.0

    def corners(self, plant: AxisPlant) -> Iterator[AxisPlant]:
        """Give the plant as it was found, then with each choice of ends."""
        yield plant
        for gain, (lag, delay), delayed in product(
            dict.fromkeys(self.gain), self._late(plant), dict.fromkeys((0.0, self.delayed))
        ):
            if (gain, lag, delay, delayed) != (1.0, plant.lag, plant.delay, 0.0):
                yield replace(
                    plant,
                    gain=gain * plant.gain,
                    by_acceleration=gain * plant.by_acceleration,
                    slow=gain * plant.slow,
                    lag=(1 - delayed) * lag,
                    delay=delay + delayed * lag,
                )

    def _late(self, plant: AxisPlant) -> list[tuple[float, float]]:
        """Give lags with delays at their ends, s; of skewed intervals each quarter of the ellipse has its own sides."""
        found = np.array([plant.lag, plant.delay])
        # How far down, then up, both reach.
        reach = np.abs(np.array([self.lag, self.delay]).T - 1) * found
        if not (self.trade < 0 and reach.any(axis=0).all()):
            ends = product(dict.fromkeys(self.lag), dict.fromkeys(self.delay))
            return [(lag * plant.lag, delay * plant.delay) for lag, delay in ends]
        late = []
        for sign, sides in zip((-1, 1), reach, strict=True):
            both = max((sides**2).sum() + 2 * self.trade * sides.prod(), 1e-12) ** 0.5
            for share in ((1.0, self.trade), (self.trade, 1.0), (sides + self.trade * sides[::-1]) / both):
                moved = sign * np.array(share)
                lag, delay = np.maximum(found + moved * reach[(moved > 0).astype(int), (0, 1)], 0.0).tolist()
                late.append((lag, delay))
        return late


@dataclass(frozen=True)
class HoverPlant:
    """A vehicle in hover under a law.

    Attributes
    ----------
    axes : tuple of AxisPlant
        About x, y, z of the body.
    share : float
        Of the full thrust that hovers, in the units of the law.
    signal : float
        Of the motors, from 0 to 1, mean over them.
    drawn : tuple of tuple of AxisPlant
        Plants of each axis that are possible, in place of the ends of intervals; empty: those ends.
    """

    axes: tuple[AxisPlant, AxisPlant, AxisPlant]
    share: float
    signal: float
    spreads: tuple[Spread, ...] = field(default=(Spread(), Spread(), Spread()))
    drawn: tuple[tuple[AxisPlant, ...], ...] = ()

    def corners(self, axis: int) -> list[AxisPlant]:
        """Give the plants of an axis that flights leave possible, the one that was found first."""
        if self.drawn:
            return [self.axes[axis], *self.drawn[axis]]
        return list(self.spreads[axis].corners(self.axes[axis]))


def hover_plant(law: Law, vehicle: VehicleSettings, model: VehicleModel | None, rotor_lag: float) -> HoverPlant:
    """Linearise a vehicle in hover, or a model in its place, by the equations that fly it.

    `rotor_lag`: of speeds behind commands, s, where the model does not say. `ComputationError` where full thrust does
    not carry the weight, or idling rotors do.
    """
    held, effects = with_effects(model, SimulatedEffects())
    flown = vehicle if held is None else held.vehicle
    motors = Motors.of(law.mixer, law.curve, flown)
    whole = flown_vehicle(flown, held, effects)
    share = _hover_share(whole, held, motors)
    speed = np.full(len(flown.rotors), motors.speed_at(share))
    slope = motors.speed_slope(share)
    lag, delay, slow_s = _lags_and_delay(model, effects, rotor_lag)
    by_speed, by_acceleration, by_slow, by_rate = np.split(
        _slopes(whole, held, speed), len(speed) * np.arange(1, 4), axis=1
    )
    turned = slope * motors.mix[:, 1:]
    axes = tuple(
        AxisPlant(
            gain=float(by_speed[axis] @ turned[:, axis]),
            by_acceleration=float(by_acceleration[axis] @ turned[:, axis]),
            # A change of the speed changes its slow square by twice the speed.
            slow=float(by_slow[axis] @ (2 * speed * turned[:, axis])),
            slow_s=slow_s,
            damping=-float(by_rate[axis, axis]),
            lag=lag,
            delay=delay,
        )
        for axis in range(3)
    )
    return HoverPlant((axes[0], axes[1], axes[2]), share, motors.speed_at(share) / motors.speed_max)


def on_less(hover: HoverPlant, drained: float, law: Law, model: VehicleModel, rotor_lag: float) -> HoverPlant:
    """Let the gains of a vehicle in hover reach down to those on an empty battery, on which rotors turn slower.

    `drained`: speed by command on it, over that on the full one. `ComputationError` where it does not carry the weight.
    """
    slower = replace(model.vehicle, rotor_speed_max_rad_s=drained * model.vehicle.rotor_speed_max_rad_s)
    try:
        empty = hover_plant(law, slower, replace(model, vehicle=slower), rotor_lag)
    except ComputationError:
        raise ComputationError(
            "full thrust does not carry the weight on a battery that has lost as much of its voltage as "
            "simulation.closed_loop.battery_use says; make that smaller"
        ) from None
    left = [min(low.gain / full.gain, 1.0) for low, full in zip(empty.axes, hover.axes, strict=True)]
    spreads = [
        replace(each, gain=(part * each.gain[0], each.gain[1])) for part, each in zip(left, hover.spreads, strict=True)
    ]
    return replace(hover, spreads=(spreads[0], spreads[1], spreads[2]))


def _hover_share(flown: Vehicle, held: VehicleModel | None, motors: Motors) -> float:
    """Find the share of the full thrust at which nothing rises or falls."""
    # Slow to load for who reads gains alone.
    from scipy.optimize import brentq

    start, numbers = np.array((0.0,) * VEHICLE_STATES + flown.start), "mass_kg, thrust_factor_n_s2"

    def climb(share: float) -> float:
        speed = np.full(len(motors.mix), motors.speed_at(share))
        return float(settled(flown, held, start, speed)[VELOCITY][2])

    if climb(1.0) <= 0:
        raise ComputationError(
            f"vehicle: full thrust does not carry the weight; correct {numbers} or rotor_speed_max_rad_s"
        )
    if climb(0.0) >= 0:
        raise ComputationError(
            f"vehicle: rotors that idle carry more than the weight; correct {numbers} or rotor_speed_max_rad_s"
        )
    return float(brentq(climb, 0.0, 1.0, xtol=1e-15))


def _lags_and_delay(
    model: VehicleModel | None, effects: SimulatedEffects, rotor_lag: float
) -> tuple[float, float, float]:
    """Give lag, delay, and the time of slow actuation, s, of all between command and torque."""
    acting = [(one.effect.actuation, one) for one in effects.ordered if one.effect.actuation is not None]
    lags = [each.lag(one.values) for each, one in acting if each.lag is not None]
    delays = [one.values[one.effect.shapes[0].name] for each, one in acting if each.delay is not None]
    if model is None:
        return rotor_lag, 0.0, 1.0
    behind = model.response
    if model.commanded:
        return (lags[-1] if lags else 0.0), sum(delays), behind.slow_s
    # Behind speeds that are logged; these are behind their commands.
    return rotor_lag + behind.lag_s, behind.delay_s, behind.slow_s


def _slopes(flown: Vehicle, held: VehicleModel | None, speed: Array) -> Array:
    """Differentiate angular acceleration in hover, shape (3, 3 rotors + 3).

    By speeds, their accelerations, and slow squares of the rotors, and by body rate.
    """
    rotors, hovering = len(speed), (0.0,) * VEHICLE_STATES + flown.start
    # Slowness is that behind the present square, which a change of the speed alone leaves where it was.
    speeds, accelerations, squares = (
        Tangent(values[:, None], dict(enumerate(np.eye(rotors)[:, :, None], rotors * place)))
        for place, values in enumerate((speed, 0.0 * speed, speed**2))
    )
    rate = (Tangent(0.0, {3 * rotors + axis: 1.0}) for axis in range(3))
    state = (*hovering[: BODY_RATE.start], *rate, *hovering[BODY_RATE.stop :])
    turning = turning_of(flown, held)
    given = None if turning is None else given_turning(turning(hovering))
    turned = flown.derivative(flown.instant(state, speeds, accelerations, squares, ARRAYS), state, None, given)[
        BODY_RATE
    ]
    return np.array([[np.sum(each.by.get(place, 0.0)) for place in range(3 * rotors + 3)] for each in turned])


def spread_of(intervals: Mapping[str, tuple[float, float]], moment: str, factor: str) -> Spread:
    """Make the spread of an axis from intervals of constants, each as factors on what was found.

    Parameters
    ----------
    intervals : mapping of str to tuple of float
        By name of the constant; those that are not there are taken as they are.
    moment, factor : str
        Names of the moment of inertia, and of thrust or drag factor, that make the gain.
    """
    low, high = intervals.get(moment, (1.0, 1.0))
    weak, strong = intervals.get(factor, (1.0, 1.0))
    one = (1.0, 1.0)
    return Spread((weak / high, strong / low), intervals.get("lag", one), intervals.get("delay", one))


_WINDOW_S = 1.0
LEAST = 256
"""Samples in a window, and of a log."""
_FLOOR_SHARE = 0.25
"""Floor at a frequency: the median over so much of it on either side."""
_LINE_DB, _LOWEST_LINE_HZ, _FROM_THE_END = 10.0, 25.0, 0.95
_MOST_LINES = 2
_LEFT = 1e-3
"""Part of the power that a filter leaves, below which what is behind it does not show what was in front."""


@result
class Line:
    """A line of a spectrum."""

    hz: float = about("its frequency", unit="Hz")
    width_hz: float = about("its width", unit="Hz")
    above_db: float = about("over the floor around it", unit="dB")


@result
class Noise:
    """Spectrum of body rates, single-sided, mean over flights."""

    SHOWN = ("lines",)

    frequency: Array = about("as far as the logs show", "noise frequency", unit="Hz", brief=False)
    density: Array = about("of body rates", "noise frequency", "axis", unit="rad^2/s^2/Hz", frame="body", brief=False)

    @property
    def highest_hz(self) -> float:
        """Highest frequency that the flights show; what is above is folded below it, if the log has no filter."""
        return float(self.frequency[-1])

    def of_command(self, law: Law, axis: int) -> float:
        """Compute how much it makes the command about an axis jitter, root mean square.

        In shares of the full command, from 10 Hz on and as far as the flights show, without the answer of the vehicle.
        """
        shown = (self.frequency >= 10.0) & (self.frequency < 0.49 * law.rate_hz)
        gain = np.abs(law.response(axis, self.frequency[shown]).feedback)
        spacing = float(self.frequency[1] - self.frequency[0])
        return float(np.sqrt((gain**2 * self.density[shown, axis]).sum() * spacing))

    def before_filters(self, law: Law) -> Noise:
        """Give the noise in front of the law's filters of the gyroscope, from what was logged behind them."""
        back = np.exp(-2j * np.pi * self.frequency * law.period)
        left = np.stack([np.abs(chain(axis.measured, back, law.period)) ** 2 for axis in law.axes], axis=1)
        return replace(self, density=self.density / np.maximum(left, _LEFT))

    @cached_property
    def lines(self) -> tuple[Line, ...]:
        """Lines of 10 dB and more over the floor, the strongest first."""
        total = self.density.sum(axis=1)
        near = (np.abs(self.frequency - hz) <= max(_FLOOR_SHARE * hz, 5.0) for hz in self.frequency)
        floor = np.array([np.median(total[each]) for each in near])
        above = 10 * np.log10(np.maximum(total, 1e-30) / np.maximum(floor, 1e-30))
        inside = (self.frequency > _LOWEST_LINE_HZ) & (self.frequency < _FROM_THE_END * self.highest_hz)
        peaks = np.flatnonzero(inside[1:-1] & (above[1:-1] >= np.maximum(above[:-2], above[2:]))) + 1
        found: list[Line] = []
        for peak in sorted(peaks, key=lambda each: -total[each]):
            hz = float(self.frequency[peak])
            apart = all(abs(hz - each.hz) > max(each.width_hz, hz / 5) for each in found)
            if above[peak] >= _LINE_DB and apart and len(found) < _MOST_LINES:
                found.append(Line(hz=hz, width_hz=self._width(above, int(peak)), above_db=float(above[peak])))
        return tuple(found)

    def _width(self, above: Array, peak: int) -> float:
        """Give the width of a line where it is half its decibels above the floor, at least a tenth of it, Hz."""
        half = 0.5 * above[peak]
        left = peak - int(np.argmax(above[peak::-1] < half))
        right = peak + int(np.argmax(above[peak:] < half))
        return max(float(self.frequency[right] - self.frequency[left]), 0.1 * float(self.frequency[peak]))


def noise_of(flights: Sequence[tuple[Array, Array]]) -> Noise | None:
    """Estimate the spectrum of body rates by windows of a second; None where no flight is long enough.

    Parameters
    ----------
    flights : sequence of (array, array)
        Times, shape (time,), s, and body rates, shape (time, 3), rad/s, which may lack samples.
    """
    steps = [float(np.median(np.diff(time))) for time, _ in flights if len(time) > LEAST]
    rates = [1 / step for step in steps if step > 0]
    if not rates:
        return None
    slowest = min(rates)
    count = max(round(_WINDOW_S * slowest), LEAST)
    window = np.hanning(count)[:, None]
    scale = 2 / (slowest * float((window**2).sum()))
    spectra = []
    for time, rate in (part for flight in flights for part in _between_pauses(*flight)):
        even = np.arange(time[0], time[-1], 1 / slowest)
        values = np.stack([np.interp(even, time, column) for column in rate.T], axis=1)
        for begin in range(0, len(even) - count + 1, count // 2):
            part = values[begin : begin + count]
            spectra.append(scale * np.abs(np.fft.rfft(window * (part - part.mean(axis=0)), axis=0)) ** 2)
    if not spectra:
        return None
    frequency = np.fft.rfftfreq(count, 1 / slowest)
    return Noise(frequency=np.asarray(frequency[1:], dtype=float), density=np.mean(spectra, axis=0)[1:])


def _between_pauses(time: Array, rate: Array) -> Iterator[tuple[Array, Array]]:
    """Cut a log where it pauses longer than a window; a line over the pause would be a rate without noise."""
    pauses = np.flatnonzero(np.diff(time) > _WINDOW_S) + 1
    for part in zip(np.split(time, pauses), np.split(rate, pauses), strict=True):
        if len(part[0]) > LEAST:
            yield part
