"""Numbers of one flight that are alike in another flight of the same vehicle."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.blocks import ENOUGH_BLOCKS, contiguous, jackknife_error, leaving_out
from cpfls_cli.consistency.check import flown
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.effects.signals import Signals
from cpfls_cli.errors import InputError
from cpfls_cli.inertia import symmetric
from cpfls_cli.lag import DelayFit, delayed, fit_delay
from cpfls_cli.result import about, part, result
from cpfls_cli.weak_form.windows import FEWEST_SAMPLES, FEWEST_WINDOWS, Windows, windows

_LOAD = next(effect for effect in CATALOGUE.values() if "length_m" in {shape.name for shape in effect.shapes})
_SHAPES = {shape.name: shape for shape in _LOAD.shapes}
_CABLES = _SHAPES["length_m"].grid
_MASS = [each.name for each in _LOAD.coefficients].index("mass")
(_USUAL_DAMPING,) = _SHAPES["damping_1_s"].tried  # Of a load on a cable: lengths that are tried, m, and a damping, 1/s.

_AXES, _ROTATIONS = ("x", "y", "z"), ("roll", "pitch", "yaw")


@dataclass(frozen=True)
class Kind:
    """One kind of numbers."""

    unit: str  # Of a number; 1 for logarithms of ratios.
    # `apart`, `together`: Standard deviations from day to day of a vehicle that nobody changed: of each number by
    # itself, and of all numbers of the kind alike. What is usual where reference flights are too few.
    apart: float
    together: float
    # By how much numbers differ in flights that are flown e times as agile: standard deviation, half of its variance in
    # common.
    agile: float


KINDS: dict[str, Kind] = {
    "lag": Kind("s", 0.002, 0.002, 0.001),  # Of a rotor's speed behind its command.
    "battery": Kind("1", 0.02, 0.0, 0.01),  # Voltage that flight draws, share of a full one.
    "drift": Kind("rad/s", 0.01, 0.0, 0.005),  # Mean rate of the gyroscope less the attitude's.
    "felt": Kind("m/s^2", 0.05, 0.0, 0.05),  # Mean of the accelerometer, along z less gravity.
    "gain": Kind("1", 0.1, 0.1, 1.0),  # Angular acceleration over that of the rotors' torque, logarithm.
    "gusts": Kind("1", 0.2, 0.6, 0.6),  # Angular acceleration that rotors do not explain, RMS, logarithm.
    "delay": Kind("s", 0.002, 0.003, 0.03),  # Of the body's rotation behind the rotors.
    "lean": Kind("m/s^2", 0.3, 0.0, 0.1),  # Mean horizontal thrust over mass, world axes.
    "thrust": Kind("1", 0.02, 0.02, 0.01),  # Of a rotor over its share of the weight, logarithm.
    "scale": Kind("1", 0.01, 0.01, 0.02),  # Rate of the gyroscope over that of the attitude, logarithm.
    "swing": Kind("1", 0.02, 0.0, 0.02),  # Mass on a cable over that of the vehicle.
    "turn": Kind("1", 0.02, 0.02, 0.01),  # Squared speed of a rotor over its command, logarithm.
    "unbalance": Kind("1", 0.3, 0.2, 0.2),  # Acceleration that turns with a rotor, amplitude, logarithm.
    "vibration": Kind("1", 0.1, 0.25, 0.3),  # Root mean square above 20 Hz, logarithm.
    "axes": Kind("rad", 0.01, 0.0, 0.005),  # Angle of the gyroscope's axes from those of the attitude.
}
"""By the first word of a number's name; chance is drawn in this order."""

_SHORTEST_S = 4.0  # Of flight, below which it has no numbers.
_ABOVE_HZ, _ACROSS_HZ = 20.0, 3.0
"""Where vibration begins: above what a vehicle flies. Across its rotors the accelerometer feels the air alone, so that
what turns with them shows at whatever the log's rate makes of its frequency."""

_TURNING_S = 2.0  # Over which a torque about z is averaged, to see how it goes with the yaw rate.
_STEADY = 0.1  # Standard deviation of the yaw rate, rad/s, that identifies half of that: below, a flight turns evenly.
_TURNS_S, _ALIKE = 1.0, 0.03
"""Stretches over which what turns with a rotor adds up: rotors 1 Hz apart are separated. Of those that turn more alike
each has its share, by the squared size below which a difference of theirs counts as none."""

_WINDOW_S, _SWING_S = 0.12, 0.4
"""Length of windows over which rotation is averaged, and a swing. Below its bandwidth, 2 Hz or so, the loop's torque
answers gusts, and only above it does torque drive the body."""

_DELAYS: Array = 0.002 * np.arange(60.0)  # Tried, s, up to the longest of rotors and autopilot.
_CLEARLY = 3.0  # Standard errors beyond which a ratio is said to be below 0.
_ABOVE = 1.96
"""Standard errors by which a ratio is above 0 that has a logarithm: of exchanged rotors hardly any is left."""


@result
class NumberOfFlight:
    """A number of one flight."""

    name: str = about("its kind, and the rotor, axis or sensor that it is of: thrust M3")
    unit: str = about("its unit; 1 of the logarithm of a ratio")
    value: float = about("in its unit")
    error: float = about("its standard error, over blocks of the flight, in its unit", least=0)


@result
class UnsureRatio:
    """A ratio that may be zero, so that it has no logarithm."""

    name: str = about("of the number that it would be")
    ratio: float = about("as estimated")


@result
class StatedFact:
    """What a log states of its vehicle, by which flights of two vehicles are kept apart."""

    name: str = about("parameter of the frame and the rotors, or `written by`")
    value: str = about("as the log has it")


@result
class FlightNumbers:
    """What one flight says of its vehicle in numbers that other flights of it have alike."""

    FORMAT: ClassVar = "cpfls/flight-numbers"

    name: str = about("of the flight")
    duration_s: float = about("time that it flies, away from take-off and landing", unit="s")
    voltage: float = about("mean of the battery in flight, V, or share of a full one where the log has that", gaps=True)
    commanded: bool = about("whether shares of thrust are of commands, and not of speeds that were measured")
    cable_m: float = about(
        "length of the cable that fits best what swings, if anything does", unit="m", gaps=True, default=np.nan
    )
    agility: float = about(
        "acceleration that it is flown with, less its mean, root mean square", unit="m/s^2", gaps=True, default=np.nan
    )
    turning: float = about(
        "mean yaw rate whose torque against the air the shares of thrust hold", unit="rad/s", default=0.0
    )
    period_s: float = about("time from sample to sample", unit="s", gaps=True, default=np.nan)
    flown_at_s: float = about(
        "when it was flown, since 1970 began (UTC), where the log has that", unit="s", gaps=True, default=np.nan
    )
    code: str = about("hash of the code that computed it: other code computes it anew", default="")
    reversed: tuple[str, ...] = about(
        "numbers that are the logarithm of a ratio which is zero here, or clearly below: a sensor or a rotor that is "
        "still, or turned round",
        "reversed",
        default=(),
    )
    contradictions: tuple[str, ...] = about(
        "what of the flight contradicts itself or its vehicle", "contradiction", default=()
    )
    warnings: tuple[str, ...] = about("what to know about the flight", "warning", default=())
    numbers: tuple[NumberOfFlight, ...] = part()
    unsure: tuple[UnsureRatio, ...] = part(default=())
    stated: tuple[StatedFact, ...] = part(default=())

    @cached_property
    def values(self) -> dict[str, float]:
        """Numbers by name."""
        return {each.name: each.value for each in self.numbers}

    @cached_property
    def errors(self) -> dict[str, float]:
        """Their standard errors by name."""
        return {each.name: each.error for each in self.numbers}

    @cached_property
    def facts(self) -> dict[str, str]:
        """What its log states of the vehicle, by name."""
        return {each.name: each.value for each in self.stated}


def numbers_of(values: Mapping[str, float], errors: Mapping[str, float]) -> tuple[NumberOfFlight, ...]:
    """Arrange numbers and their standard errors by name."""
    rows = ((name, float(value), float(errors[name])) for name, value in values.items())
    return tuple(NumberOfFlight(name=name, unit=unit_of(name), value=value, error=error) for name, value, error in rows)


def unit_of(name: str) -> str:
    """Look up the unit of a number by its name."""
    return KINDS[name.split()[0]].unit


def flight_numbers(signals: Signals, full_voltage: float = 1.0, *, has_gyroscope: bool = False) -> FlightNumbers:
    """Compute the numbers of a flight.

    `full_voltage`: what its voltage is a share of, V; 1 for shares.
    `has_gyroscope`: whether the log holds body rates, though they never move.
    Raises InputError if the flight has no speeds or commands of single rotors, or flies for less than four seconds.
    """
    name = signals.name
    if signals.rotor_speed is None:
        raise InputError(
            f"{name}: has no rotor_speed or rotor_command, and what a rotor does shows nowhere else; name their columns"
            " in import.signals"
        )
    flies = in_flight(signals)
    duration = float(flies.sum() * signals.period)
    if not flies.any():
        raise InputError(f"{name}: {'; '.join(flown(signals).cut)}")
    if duration < _SHORTEST_S:
        raise InputError(
            f"{name}: flies for {duration:.2g} s of {len(signals) * signals.period:.3g} s, and {_SHORTEST_S:g} s are"
            f" the least{''.join(f'; {why}' for why in flown(signals).cut)}"
        )
    values: dict[str, float] = {}
    errors: dict[str, float] = {}
    below, unsure = [], {}
    cable, swing = _swing(signals, flies)
    for names, estimates, error, *ratios in (*_estimates(signals, flies, has_gyroscope), swing):
        for index, (each, value, apart) in enumerate(zip(names, estimates, error, strict=True)):
            if np.isfinite(value) and np.isfinite(apart):
                values[each], errors[each] = float(value), float(apart)
            elif np.isinf(value):
                below.append(each)
            elif ratios and np.isfinite(ratios[0][index]):
                unsure[each] = float(ratios[0][index])
    voltage = np.nan if signals.voltage is None else full_voltage * float(signals.voltage[flies].mean())
    agility = _agility(signals, flies)
    return FlightNumbers(
        name=name,
        duration_s=duration,
        voltage=voltage,
        commanded=signals.commanded,
        cable_m=cable,
        agility=agility,
        turning=_turning(signals, flies),
        period_s=signals.period,
        reversed=tuple(below),
        numbers=numbers_of(values, errors),
        unsure=tuple(UnsureRatio(name=name, ratio=ratio) for name, ratio in unsure.items()),
    )


def in_flight(signals: Signals) -> BoolArray:
    """Mark the samples at which a vehicle flies, shape (time,): what the import finds, of all stretches of it."""
    time = signals.time - signals.time[0]
    flies = np.zeros(len(time), dtype=bool)
    for begin, end in flown(signals).stretches_s:
        flies |= (time >= begin) & (time <= end)
    return flies


def _agility(signals: Signals, flies: BoolArray) -> float:
    """Compute how agile a flight is: acceleration that attitude and thrust ask for, about its mean.

    Of windows, so that noise counts little.
    """
    own, inside = _windows(signals, flies, _SWING_S)
    if signals.attitude is None or not inside.any():
        return float("nan")
    asked = own.average(_asked(signals, flies))[inside]
    return float(np.sqrt(((asked - asked.mean(axis=0)) ** 2).sum(axis=1).mean()))


def _asked(signals: Signals, flies: BoolArray) -> Array:
    """Give the acceleration that attitude and thrust ask for, shape (time, 3), m/s^2, world axes.

    Of a thrust that carries the vehicle on average, so that neither its mass nor its rotors' factors have to be known.
    """
    assert signals.thrust is not None, "rotor speeds are there"
    force = signals.rotation[:, :, 2] * signals.thrust[:, None]
    carried = max(float(force[flies, 2].mean()), 0.2 * float(signals.thrust[flies].mean()))
    return np.asarray(force * (signals.vehicle.gravity_m_s2 / carried if carried else 0.0))


_Numbers = tuple[list[str], Array, Array] | tuple[list[str], Array, Array, Array]
"""Names, values, errors, and of logarithms that a flight may lack the ratios that they are of."""


def _estimates(signals: Signals, flies: BoolArray, has_gyroscope: bool) -> Iterator[_Numbers]:
    rotors = [f"M{index + 1}" for index in range(len(signals.vehicle.rotors))]
    yield _averaged([f"thrust {name}" for name in rotors], *_thrust_shares(signals, flies))
    if signals.rotor_command is not None:
        # Squares, as thrust and drag are.
        both = np.stack([signals.speed**2, signals.rotor_command**2], axis=2)
        yield _averaged(
            [f"turn {name}" for name in rotors], both, flies, lambda means: np.log(means[:, 0] / means[:, 1])
        )
        yield _answer(signals, flies, rotors)
    turns, feels = has_gyroscope or bool(signals.body_rate.any()), signals.specific_force
    feels = signals.acceleration if feels is None else feels
    across = _ACROSS_HZ if signals.specific_force is not None else _ABOVE_HZ
    for sensor, values, above in (
        ("gyroscope", signals.body_rate if turns else None, (_ABOVE_HZ,) * 3),
        ("accelerometer", feels, (across, across, _ABOVE_HZ)),
    ):
        if values is not None and (squares := _above(values, signals.period, above)) is not None:
            names = [f"vibration {sensor} {axis}" for axis in _AXES]
            yield _averaged(names, squares, flies, lambda means: 0.5 * np.log(means))
    if signals.specific_force is not None:
        yield _averaged([f"felt {axis}" for axis in _AXES], _less_gravity(signals), flies, lambda means: means)
    if feels is not None and not signals.commanded:
        yield _unbalance(signals, feels, flies)
    if signals.attitude is not None:
        yield _averaged(["lean x", "lean y"], _asked(signals, flies)[:, :2], flies, lambda means: means)
    if turns:
        yield from _rotation(signals, flies)
    if signals.voltage is not None and signals.voltage[~flies].size:
        yield _drawn(signals, flies)


def _averaged(names: list[str], values: Array, flies: BoolArray, of: Callable[[Array], Array]) -> _Numbers:
    """Compute numbers of means over a flight, with their errors by blocks of it left out."""
    flown = values[flies]
    with np.errstate(divide="ignore", invalid="ignore"):
        whole, left_out = leaving_out(lambda kept: of(flown[kept].mean(axis=0)), len(flown), ENOUGH_BLOCKS)
        return names, whole, jackknife_error(left_out)


def _thrust_shares(signals: Signals, flies: BoolArray) -> tuple[Array, BoolArray, Callable[[Array], Array]]:
    """Give what each rotor is asked for over its share of what carries the vehicle, and its logarithm without turning.

    A vehicle that turns to one side for most of a flight needs a torque against the air; the share is that at no rate.
    Where it turns evenly the torque is not separated from the rotors' drag: see `_turning`.
    """
    vehicle = signals.vehicle
    factors = np.array([rotor.thrust_factor_n_s2 for rotor in vehicle.rotors])
    weight = vehicle.mass_kg * vehicle.gravity_m_s2
    carried = np.full(len(signals), weight)
    if signals.attitude is not None:
        carried /= np.maximum(signals.rotation[:, 2, 2], 0.2)
    shares = np.asarray(signals.speed**2 * factors * len(factors) / carried[:, None])
    inside, slow, rate = _slowly(signals, flies, shares)
    columns = (slow, slow * rate, rate, rate**2, np.ones_like(rate))
    both = shares, signals.body_rate[:, 2:]
    values = np.stack(np.broadcast_arrays(*both, *(inside[:, None] * each for each in columns)), axis=2)

    def straight(means: Array) -> Array:
        share, turning = means.T[:2]
        slowly, product, rate, square = means.T[2:6] / np.maximum(means.T[6], 1e-9)
        slope = (product - rate * slowly) / (square - rate**2 + _STEADY**2)
        return np.asarray(np.log(share - slope * turning))

    return values, flies, straight


def _slowly(signals: Signals, flies: BoolArray, values: Array) -> tuple[BoolArray, Array, Array]:
    """Average values and the yaw rate over two seconds, and mark where all of these are flown.

    The torque that accelerates is nothing then, however late the rotors are logged.
    """
    from scipy.ndimage import uniform_filter1d

    length = max(1, round(_TURNING_S / signals.period))
    share, slow, rate = (
        uniform_filter1d(each, length, axis=0, mode="constant")
        for each in (flies.astype(float), values, signals.body_rate[:, 2:])
    )
    return share > 1 - 1e-9, slow, rate


def _turning(signals: Signals, flies: BoolArray) -> float:
    """Give the mean yaw rate, as far as shares of thrust still hold the torque that it takes, rad/s."""
    inside, _, rate = _slowly(signals, flies, signals.speed)
    spread = rate[inside].var() if inside.any() else 0.0
    return float(signals.body_rate[flies, 2].mean() * _STEADY**2 / (spread + _STEADY**2))


def _above(values: Array, period: float, hertz: Sequence[float]) -> Array | None:
    """Square what is above a frequency along each axis, shape (time, 3); None where the log is too slow to hold it."""
    halves = [max(1, round(0.5 / (each * period))) for each in hertz]
    if 0.5 / period < 1.5 * _ABOVE_HZ or len(values) < 4 * max(halves) + 4:
        return None
    from scipy.signal import savgol_filter

    smooth = [savgol_filter(column, 2 * half + 1, 2) for column, half in zip(values.T, halves, strict=True)]
    return np.asarray((values - np.stack(smooth, axis=1)) ** 2)


def _unbalance(signals: Signals, feels: Array, flies: BoolArray) -> _Numbers:
    """Estimate the amplitude of what turns with each rotor, m/s^2, whatever the log's rate makes of its frequency.

    An unbalanced rotor pulls once a turn. Between samples it turns many times, but by its measured speed it is known
    where it stands at each sample (synchronous averaging).
    """
    length = max(round(_TURNS_S / signals.period), FEWEST_SAMPLES)
    count = len(signals) // length
    whole = slice(0, count * length)
    speed = signals.speed[whole]
    turned = np.exp(-1j * signals.period * (np.cumsum(speed, axis=0) - 0.5 * speed))
    # What moves slowly is seen by the edges of a stretch alone, which this window takes away.
    weight = np.sin(np.pi * (np.arange(length) + 0.5) / length) ** 2
    weighed = turned.reshape(count, length, -1) * (weight / weight.sum())[:, None]
    parts = np.einsum("btr,bta->bra", weighed, (feels[whole] - feels[flies].mean(axis=0)).reshape(count, length, 3))
    # Of rotors that turn alike each feels what the others do.
    alike = np.einsum("btr,bts->brs", weighed, turned.conj().reshape(count, length, -1))
    flown = np.asarray(flies[whole].reshape(count, length).all(axis=1))
    names = [f"unbalance M{index + 1}" for index in range(signals.speed.shape[1])]
    if flown.sum() < ENOUGH_BLOCKS:
        return [], np.zeros(0), np.zeros(0)
    power = 4 * (np.abs(np.linalg.solve(alike + _ALIKE * np.eye(len(names)), parts)) ** 2).sum(axis=2)
    return _averaged(names, power, flown, lambda means: 0.5 * np.log(means))


def _less_gravity(signals: Signals) -> Array:
    """Take gravity from what the accelerometer feels: on average a flight that ends where it began feels nothing else.

    With an attitude along axes that are level and turn with the heading, where no wind shows: it leans against it.
    """
    assert signals.specific_force is not None, "asked for"
    felt, gravity = signals.specific_force, signals.vehicle.gravity_m_s2
    if signals.attitude is not None:
        felt = np.einsum("tij,tj->ti", signals.rotation, felt)
        cosine, sine = np.cos(signals.attitude[:, 2]), np.sin(signals.attitude[:, 2])
        ahead, left = felt[:, 0], felt[:, 1]
        felt = np.stack([cosine * ahead + sine * left, cosine * left - sine * ahead, felt[:, 2]], axis=1)
    return np.asarray(felt - [0.0, 0.0, gravity])


def _answer(signals: Signals, flies: BoolArray, rotors: list[str]) -> _Numbers:
    """Estimate the lag of each rotor's speed behind its command, which no gust disturbs."""
    own, inside = _windows(signals, flies, _WINDOW_S)
    if inside.sum() < FEWEST_WINDOWS:
        return [], np.zeros(0), np.zeros(0)
    assert signals.rotor_command is not None, "asked for"
    found = _followed(own, inside, own.average(signals.speed), signals.rotor_command)
    return [f"lag {name}" for name in rotors], _known(found), found.error


def _windows(signals: Signals, flies: BoolArray, length_s: float) -> tuple[Windows, BoolArray]:
    """Lay windows over a flight, and mark those in which it flies throughout."""
    own = windows(signals.period, max(length_s, FEWEST_SAMPLES * signals.period), 0.5)
    known = own.average(flies.astype(float)) > 1 - 1e-9 if own.count(len(signals)) else np.zeros(0, dtype=bool)
    return own, known


def _rotation(signals: Signals, flies: BoolArray) -> Iterator[_Numbers]:
    """Estimate how rotation follows the rotors' torque: tracking gain, delay and residual."""
    own, inside = _windows(signals, flies, _WINDOW_S)
    if inside.sum() < FEWEST_WINDOWS:
        return
    inertia = symmetric(signals.vehicle.inertia_kg_m2)
    momentum = signals.body_rate @ inertia
    turned = own.balance(rotations.cross(signals.body_rate, momentum), momentum)
    assert signals.torque is not None, "rotor speeds are there"
    assert signals.thrust is not None, "rotor speeds are there"
    found = _followed(own, inside, turned, np.column_stack([signals.torque, signals.thrust]))
    ratios = np.diagonal(found.coefficients, axis1=1, axis2=2)
    with np.errstate(divide="ignore", invalid="ignore"):
        gains, gusts = _logarithms(ratios), 0.5 * np.log(found.residual) - np.log(np.diag(inertia))
        yield [f"gain {axis}" for axis in _ROTATIONS], gains[0], jackknife_error(gains[1:]), ratios[0]
        yield [f"delay {axis}" for axis in _ROTATIONS], _known(found), found.error
        yield [f"gusts {axis}" for axis in _ROTATIONS], gusts[0], jackknife_error(gusts[1:])
    if signals.attitude is not None:
        turns = _of_attitude(signals)
        # Of the gyroscope in the middle of two samples, for the attitude turns from one to the other.
        apart = 0.5 * (signals.body_rate[:-1] + signals.body_rate[1:]) - turns[1:]
        yield _averaged([f"drift {axis}" for axis in _AXES], apart, flies[1:] & flies[:-1], lambda means: means)
        yield from _scale(signals, turns, flies)


def _logarithms(ratios: Array) -> Array:
    """Take logarithms of ratios of a whole flight and without each block, shape (1 and block, ...).

    Of one that is clearly below 0 it is that of 0; of one that may be 0 it is not known.
    """
    error = jackknife_error(ratios[1:])
    below, above = ratios[0] < -_CLEARLY * error, (ratios[0] > _ABOVE * error) & (ratios > 0)
    with np.errstate(divide="ignore"):
        return np.log(np.where(above, ratios, np.where(below, 0.0, np.nan)))


def _known(found: DelayFit) -> Array:
    """Give delays, NaN where the longest that was tried is the best, be it without a block."""
    return np.where((np.vstack([found.delay, found.left_out]) < _DELAYS[-1]).all(axis=0), found.delay, np.nan)


def _followed(own: Windows, inside: BoolArray, turned: Array, drives: Array) -> DelayFit:
    """Fit what follows, averaged over windows, shape (window, axis), to what drives it, and its delay about each axis.

    Conditional on the other columns, and on those that nothing follows: of a weak rotor thrust turns the body too, and
    so does each torque about all axes.
    """
    there = turned[inside]

    def moved(delay: float) -> tuple[Array, Array]:
        driven = own.average(delayed(drives, delay / own.period))[inside, None]
        return np.broadcast_to(driven, (*there.shape, driven.shape[2])), there

    return fit_delay(_DELAYS, moved, contiguous(len(there), ENOUGH_BLOCKS), each=True)


def _of_attitude(signals: Signals) -> Array:
    """Compute the body rate that the attitude turns by, from the sample before to each, shape (time, 3)."""
    rotation = signals.rotation
    turned = np.einsum("tji,tjk->tik", rotation[:-1], rotation[1:])
    vector = 0.5 * np.stack(
        [turned[:, 2, 1] - turned[:, 1, 2], turned[:, 0, 2] - turned[:, 2, 0], turned[:, 1, 0] - turned[:, 0, 1]],
        axis=1,
    )
    return np.concatenate([vector[:1], vector]) / signals.period


def _scale(signals: Signals, turns: Array, flies: BoolArray) -> Iterator[_Numbers]:
    """Fit the attitude's rate, which is noisier, to the gyroscope's: its scale, a logarithm, and how it is turned.

    Of windows that no vibration passes, which the attitude does not hold.
    """
    own, inside = _windows(signals, flies, _SWING_S)
    if inside.sum() < FEWEST_WINDOWS:
        return
    x, y = (own.average(each)[inside] for each in (signals.body_rate, turns))
    x = x - x.mean(axis=0)

    def ratio(kept: BoolArray) -> Array:
        return np.asarray((x[kept] * y[kept]).sum(axis=0) / (x[kept] ** 2).sum(axis=0))

    def angles(kept: BoolArray) -> Array:
        # Small rotations about each axis jointly with scales, shape (window, axis, number): rates about two axes that
        # go together would be taken for a scale.
        own, other = (each[kept] - each[kept].mean(axis=0) for each in (x, y))
        turned = [np.cross(axis, own) for axis in np.eye(3)]
        columns = np.stack([*turned, *(axis * own for axis in np.eye(3))], axis=2)
        return np.asarray(np.linalg.lstsq(columns.reshape(-1, 6), other.ravel(), rcond=None)[0][:3])

    with np.errstate(invalid="ignore"):
        whole, left_out = leaving_out(ratio, len(x), ENOUGH_BLOCKS)
        scale = -_logarithms(np.vstack([whole, left_out]))
        yield [f"scale {axis}" for axis in _AXES], scale[0], jackknife_error(scale[1:]), whole
    if (whole > 0.5).all():
        angle, left_out = leaving_out(angles, len(x), ENOUGH_BLOCKS)
        yield [f"axes {axis}" for axis in _AXES], angle, jackknife_error(left_out)


def _swing(signals: Signals, flies: BoolArray) -> tuple[float, _Numbers]:
    """Regress the horizontal force on the pull of a load that swings under the vehicle, on the cable that fits best.

    Jointly with a constant force and a drag. What drives the swing is the vehicle's own motion, so a load shows by what
    comes a period later. The length of the cable, m, comes with it.
    """
    # Slow to load, and who reads a record computes nothing.
    from scipy.optimize import least_squares

    vehicle = signals.vehicle
    own, inside = _windows(signals, flies, _SWING_S)
    if signals.attitude is None or signals.velocity is None or inside.sum() < FEWEST_WINDOWS:
        return float("nan"), ([], np.zeros(0), np.zeros(0))
    asked = _asked(signals, flies)[:, :2]
    left = own.balance(-asked, signals.velocity[:, :2])[inside]
    drag = own.average(signals.velocity[:, :2])[inside]
    columns = _LOAD.columns
    assert columns is not None, "the load pulls"

    def pull(length: float, damping: float) -> Array:
        """Give the horizontal pull of a unit mass, shape (window, 2), m/s^2.

        With the thrust that carries it, of which nothing is left where it is fixed.
        """
        along = columns(signals, {"length_m": length, "damping_1_s": damping, "depth_m": 0.0}).direct[:, 3:, _MASS]
        return own.average(np.einsum("tij,tj->ti", signals.rotation, along)[:, :2] + asked)[inside]

    def unexplained(place: Array) -> Array:
        size, y, x = _pulled(left, drag, pull(*np.exp(place)))
        # What pushes is no load.
        return y - max(size, 0.0) * x

    start = min(
        (np.log([length, _USUAL_DAMPING]) for length in _CABLES), key=lambda at: float((unexplained(at) ** 2).sum())
    )
    low, high = np.log([_SHAPES[name].bounds(vehicle) for name in ("length_m", "damping_1_s")]).T
    found = least_squares(unexplained, start, bounds=(low, high), diff_step=[1e-3] * 2, xtol=1e-3, max_nfev=8)
    length, damping = np.exp(found.x)
    pulls = pull(length, damping)
    share, left_out = leaving_out(
        lambda kept: np.array(_pulled(left[kept], drag[kept], pulls[kept])[:1]), len(left), ENOUGH_BLOCKS
    )
    return float(length), (["swing"], share, jackknife_error(left_out))


def _pulled(left: Array, drag: Array, pull: Array) -> tuple[float, Array, Array]:
    """Fit a pull jointly with a constant and a drag along each axis: its size, and what these leave of both."""
    sides = []
    for axis in range(2):
        known = np.column_stack([np.ones(len(left)), drag[:, axis]])
        both = np.column_stack([left[:, axis], pull[:, axis]])
        sides.append(both - known @ np.linalg.lstsq(known, both, rcond=None)[0])
    y, x = np.concatenate(sides).T
    return float(x @ y / max(x @ x, 1e-300)), y, x


def _drawn(signals: Signals, flies: BoolArray) -> _Numbers:
    """Compare the voltage at rest, where the log has it, with that in flight."""
    assert signals.voltage is not None, "asked for"
    assert signals.thrust is not None, "rotor speeds are there"
    rests = signals.thrust < 0.05 * signals.thrust[flies].mean()
    if rests.sum() * signals.period < 1.0:
        return [], np.zeros(0), np.zeros(0)
    rest = float(np.median(signals.voltage[rests]))
    return _averaged(["battery sag"], signals.voltage[:, None], flies, lambda means: rest - means)
