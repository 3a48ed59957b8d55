"""A flight's own setpoints flown again: by the law of its autopilot and a simulated vehicle, beside the flight."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.autopilots.motors import Motors
from cpfls_cli.effects.signals import Signals
from cpfls_cli.errors import InputError
from cpfls_cli.playback.flight import LoggedFlight
from cpfls_cli.playback.gusts import GUST_AXES, Gusts
from cpfls_cli.playback.lack import DrawnLack, Lack
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.response.flown import estimated
from cpfls_cli.response.mismatch import Mismatch, mismatch
from cpfls_cli.response.spectra import Channel, FrequencyResponse, Stretch
from cpfls_cli.rounding import less
from cpfls_cli.simulation.closed_loop import Clock, LostVehicleError, Setpoints, clock_of, fly_setpoints
from cpfls_cli.simulation.model import SimulatedEffects, with_effects
from cpfls_cli.simulation.plant import ATTITUDE, BODY_RATE, POSITION, VELOCITY
from cpfls_cli.simulation.settings import ClosedLoopSettings
from cpfls_cli.vehicle.settings import VehicleSettings

RATES, ANGLES = ("roll rate", "pitch rate", "yaw rate"), ("roll", "pitch", "yaw")
VELOCITIES, LIFT = ("velocity x", "velocity y", "velocity z"), "thrust"
CHANNELS = (*RATES, *ANGLES, *VELOCITIES, LIFT)
UNITS = {**dict.fromkeys(RATES, "rad/s"), **dict.fromkeys(ANGLES, "rad"), **dict.fromkeys(VELOCITIES, "m/s")} | {
    LIFT: "m/s^2"
}
FRAMES = {**dict.fromkeys(RATES, "body"), **dict.fromkeys(ANGLES, "angles"), **dict.fromkeys(VELOCITIES, "world")} | {
    LIFT: "body"
}
ANGLE_LAW, RATE_LAW = "attitude", "body_rate"
"""Setpoints that a law may be given."""

WINDOW_S = 1.0
SURE = 3.0
"""Times what does not follow the setpoints, from which on a difference over a window is none of it."""
TOLD = 10 ** (1.0 / 20.0) - 1
"""Share of the motion from which on a difference is told: 1 dB, where it counts 20 in the cost of a response."""


class Asked(NamedTuple):
    """What a law is asked for along a flight, one entry for each stretch.

    Attributes
    ----------
    kind : str
        `ANGLE_LAW` or `RATE_LAW`.
    thrust_from : str
        ``setpoint``, or ``rotors`` where that of the flight's own rotors stands for it.
    """

    setpoints: tuple[Setpoints, ...]
    kind: str
    thrust_from: str


@dataclass(frozen=True)
class Air:
    """What pushes a vehicle beside its model: gusts, and what the model lacks, drawn for each stretch."""

    model: VehicleModel
    lack: Lack | None
    rng: np.random.Generator

    def drawn(self, clock: Clock) -> tuple[Array | None, DrawnLack | None]:
        """Draw both for the steps of an integration."""
        gusts, lack = self.model.gusts, self.lack
        push = None if gusts is None else gusts.drawn(self.rng, clock.step, clock.steps)
        return push, None if lack is None else lack.drawn(self.model, self.rng, clock.step, clock.steps)


@dataclass(frozen=True)
class TwinFlight:
    """A simulated vehicle along the setpoints of a flight.

    Attributes
    ----------
    values : array, shape (time, channel)
        Of `CHANNELS`, NaN behind a loss of the vehicle.
    position : array, shape (time, 3), m, world frame
        The same.
    lost_s : float
        When it was lost, on the clock of the flight; NaN where it was not.
    """

    values: Array
    position: Array
    lost_s: float


@dataclass(frozen=True)
class Comparison:
    """How far a simulated vehicle flies from a flight, by channel of `CHANNELS`.

    Attributes
    ----------
    rms : array, shape (channel,)
    floor : array, shape (channel,)
        Part of it that does not follow the setpoints: gusts, noise, and what no linear response shows.
    told : array, shape (channel,)
        Difference that is worth a word; NaN for a channel that is not judged in time.
    windows, follows : array, shape (window, channel)
        Root mean square difference of each window, and of the part of it that follows the setpoints.
    responses : tuple of FrequencyResponse or None
        From setpoint to channel, with the simulated one as model.
    mismatches : tuple of Mismatch or None
    """

    rms: Array
    floor: Array
    told: Array
    windows: Array
    follows: Array
    responses: tuple[FrequencyResponse | None, ...]
    mismatches: tuple[Mismatch | None, ...]


def asked_of(flight: LoggedFlight, settings: ClosedLoopSettings, vehicle: VehicleSettings, *, share: bool) -> Asked:
    """Give the setpoints of a flight to the law of `settings.autopilot`.

    Parameters
    ----------
    share : bool
        Whether a logged thrust setpoint is a share of the full thrust, in the units of the autopilot; else it is in N.

    Raises
    ------
    InputError
        If neither the attitude nor the body rate that was asked for is known, or nothing tells the thrust.
    """
    law = settings.law
    assert law is not None, "an autopilot is named"
    motors, parts = Motors.of(law.mixer, law.curve, vehicle), flight.parts
    lift = sum(rotor.thrust_factor_n_s2 for rotor in vehicle.rotors)

    def known(name: str) -> bool:
        return all(name in part.setpoints for part in parts)

    kind = ANGLE_LAW if known("attitude") and all(part.attitude is not None for part in parts) else RATE_LAW
    if not known(kind):
        raise InputError(
            f"{flight.name}: the config maps no setpoints that this log holds throughout, so no autopilot can be flown "
            "along it: log setpoints of attitude or body rates, and map them as setpoint_attitude (with attitude) or "
            "setpoint_body_rate in import.signals"
        )
    told = known("thrust")
    if not told and any(part.rotor_speed is None for part in parts):
        raise InputError(
            f"{flight.name}: neither a thrust setpoint nor rotor speeds tell the thrust: map setpoint_thrust or "
            "rotor_speed in import.signals"
        )

    def thrust(part: Signals) -> Array:
        if told and share:
            return part.setpoints["thrust"][:, 0]
        newton = part.setpoints["thrust"][:, 0] if told else lift_of(part)
        speeds = np.sqrt(np.maximum(newton, 0.0) / lift)
        return np.array([motors.share_of(float(speed)) for speed in speeds])

    def lift_of(part: Signals) -> Array:
        assert part.rotor_speed is not None, "checked above"
        factors = np.array([rotor.thrust_factor_n_s2 for rotor in vehicle.rotors])
        return np.asarray(part.rotor_speed**2 @ factors)

    made = [
        Setpoints(
            part.setpoints["attitude"] if kind == ANGLE_LAW else None,
            part.setpoints["body_rate"] if kind == RATE_LAW else None,
            thrust(part),
        )
        for part in parts
    ]
    return Asked(tuple(made), kind, "setpoint" if told else "rotors")


def measured_channels(flight: LoggedFlight) -> Array:
    """Give the `CHANNELS` of a flight, shape (time, channel), NaN where it does not know one."""
    return np.concatenate([_measured(part) for part in flight.parts])


def _measured(part: Signals) -> Array:
    values = np.full((len(part), len(CHANNELS)), np.nan)
    values[:, 0:3] = part.body_rate
    if part.attitude is not None:
        values[:, 3:6] = part.attitude
    if part.velocity is not None:
        values[:, 6:9] = part.velocity
    if part.specific_force is not None:
        values[:, 9] = part.specific_force[:, 2]
    elif part.acceleration is not None and part.attitude is not None:
        values[:, 9] = _lift(part.acceleration, part.attitude, part.vehicle.gravity_m_s2)
    return values


def _lift(acceleration: Array, attitude: Array, gravity: float) -> Array:
    """Give the specific force along body z, shape (time,), m/s^2."""
    up = rotations.rotation_matrix(attitude)[:, :, 2]
    return np.asarray(np.einsum("ti,ti->t", acceleration + np.array([0.0, 0.0, gravity]), up))


def baselines(flight: LoggedFlight, measured: Array) -> tuple[Array, Array]:
    """Give what knows no vehicle: the setpoints themselves, and a vehicle that stays as it begins; as `CHANNELS`."""
    asked, ends = np.full_like(measured, np.nan), np.cumsum([0, *(len(part) for part in flight.parts)])
    still = np.empty_like(measured)
    for part, (first, end) in zip(flight.parts, pairwise(ends.tolist()), strict=True):
        for name, place in (("body_rate", slice(0, 3)), ("attitude", slice(3, 6)), ("velocity", slice(6, 9))):
            if name in part.setpoints:
                asked[first:end, place] = part.setpoints[name]
        still[first:end] = measured[first]
    return asked, still


def fly_twin(
    flight: LoggedFlight,
    asked: Asked,
    vehicle: VehicleSettings,
    settings: ClosedLoopSettings,
    model: VehicleModel | None,
    effects: SimulatedEffects,
    progress: Callable[[int], None] = lambda _done: None,
    air: Air | None = None,
) -> TwinFlight:
    """Fly the setpoints of a flight, each stretch from the flight's own state on, without looking at the flight again.

    Parameters
    ----------
    model, effects
        As `with_effects` gives them.
    progress : callable
        Takes samples done.
    air : Air or None
        None for still air.
    """
    parts, positions, lost = [], [], np.nan
    for part, setpoints in zip(flight.parts, asked.setpoints, strict=True):
        values, places, where = _flown(part, setpoints, vehicle, settings, model, effects, air)
        parts.append(values)
        positions.append(places)
        lost = where if np.isnan(lost) else lost
        progress(sum(map(len, parts)))
    return TwinFlight(np.concatenate(parts), np.concatenate(positions), lost)


def _flown(
    part: Signals,
    setpoints: Setpoints,
    vehicle: VehicleSettings,
    settings: ClosedLoopSettings,
    model: VehicleModel | None,
    effects: SimulatedEffects,
    air: Air | None,
) -> tuple[Array, Array, float]:
    start = np.zeros(12)
    for place, values in (
        (POSITION, part.position),
        (VELOCITY, part.velocity),
        (ATTITUDE, part.attitude),
        (BODY_RATE, part.body_rate),
    ):
        start[place] = 0.0 if values is None else values[0]
    speed = None if part.rotor_speed is None else part.rotor_speed[0]
    values, places = np.full((len(part), len(CHANNELS)), np.nan), np.full((len(part), 3), np.nan)
    push, lacking = (None, None) if air is None else air.drawn(clock_of(part.time, settings))
    count, lost = len(part), np.nan
    while count > 1:
        time = part.time[:count]
        try:
            motion = fly_setpoints(
                time, setpoints, start, vehicle, settings, model, effects, push, speed=speed, lacking=lacking
            )
        except LostVehicleError as error:
            lost, count = float(part.time[error.sample]), error.sample
            continue
        state = motion.state
        angles, gravity = state[:, ATTITUDE], vehicle.gravity_m_s2
        lift = _lift(motion.change[:, VELOCITY], angles, gravity)
        if part.attitude is not None:
            # A full turn beside the flight's own is the same.
            angles = part.attitude[:count] + rotations.wrapped(angles - part.attitude[:count])
        values[:count] = np.column_stack([state[:, BODY_RATE], angles, state[:, VELOCITY], lift])
        places[:count] = state[:, POSITION]
        break
    return values, places, lost


def compared(
    flight: LoggedFlight,
    asked: Asked,
    measured: Array,
    simulated: Array,
    instruments: Callable[[Array], Array | None],
) -> Comparison:
    """Compare a simulated vehicle with a flight, in time and by frequency.

    By frequency both answer the same setpoints, through the same windows and instruments: what differs beyond the
    random error is the simulator's fault, whatever gusts there were. A difference in time is also that of gusts and
    noise: from what the responses differ by, and from the spectrum of the setpoints, follows how much of it the
    setpoints bring about; the rest is its floor.

    Parameters
    ----------
    measured, simulated : array, shape (time, channel)
    instruments : callable
        From a setpoint, shape (time,), to what moves the vehicle from outside, as `Stretch` takes it, or None.
    """
    away = measured - simulated
    period, rms = flight.parts[0].period, root_mean_square(away)
    responses: list[FrequencyResponse | None] = []
    mismatches: list[Mismatch | None] = []
    floor, follows = np.full(len(CHANNELS), np.nan), np.full_like(away, np.nan)
    for channel in range(len(CHANNELS)):
        given = _input_of(flight, asked, channel)
        known = np.isfinite(away[:, channel])
        if given is None or not known.any() or not np.ptp(given) > 0:
            responses.append(None)
            mismatches.append(None)
            continue
        parts = _stretches(flight, given, measured[:, channel], simulated[:, channel], instruments(given))
        found = estimated(parts, period)
        responses.append(found)
        mismatches.append(None if found is None else mismatch(found))
        clear = None if mismatches[-1] is None else mismatches[-1].band
        if found is not None and clear is not None:
            for part in parts:
                own = slice(part.start, part.start + len(part.input))
                follows[own, channel] = _following(found, clear, part.input, period)
            floor[channel] = np.sqrt(max(rms[channel] ** 2 - float(root_mean_square(follows)[channel] ** 2), 0.0))
    cut = windows(flight)
    return Comparison(
        rms,
        floor,
        np.where(np.isfinite(floor), TOLD * root_mean_square(measured, about_mean=True), np.nan),
        np.array([root_mean_square(away[part]) for part in cut]),
        np.array([root_mean_square(follows[part]) for part in cut]),
        tuple(responses),
        tuple(mismatches),
    )


def windows(flight: LoggedFlight) -> list[slice]:
    """Cut the samples of a flight into windows of `WINDOW_S`; none spans a pause, and what is left over is its own."""
    length = max(round(WINDOW_S / flight.parts[0].period), 2)
    ends = np.cumsum([0, *(len(part) for part in flight.parts)]).tolist()
    return [
        slice(start, min(start + length, end)) for first, end in pairwise(ends) for start in range(first, end, length)
    ]


def root_mean_square(values: Array, *, about_mean: bool = False) -> Array:
    """Take the root mean square of each column where it is known, NaN where nowhere."""
    known = np.isfinite(values)
    count = known.sum(axis=0)
    held = np.where(known, values, 0.0)
    if about_mean:
        held = np.where(known, held - held.sum(axis=0) / np.maximum(count, 1), 0.0)
    return np.asarray(np.sqrt(np.where(count, (held**2).sum(axis=0) / np.maximum(count, 1), np.nan)))


def _input_of(flight: LoggedFlight, asked: Asked, channel: int) -> Array | None:
    """Give the setpoint that a channel follows, shape (time,); None for one that follows none."""
    if channel < 2 * len(RATES):
        return np.concatenate([part.setpoints[asked.kind][:, channel % 3] for part in flight.parts])
    if CHANNELS[channel] == LIFT and asked.thrust_from == "setpoint":
        return np.concatenate([part.setpoints["thrust"][:, 0] for part in flight.parts])
    return None


def _stretches(
    flight: LoggedFlight, given: Array, measured: Array, simulated: Array, instrument: Array | None
) -> list[Stretch]:
    """Cut a channel into its stretches, up to where the simulated vehicle is lost."""
    found, first = [], 0
    for part in flight.parts:
        own = slice(first, first + len(part))
        first += len(part)
        known = np.isfinite(simulated[own]) & np.isfinite(measured[own])
        count = len(part) if known.all() else int(np.argmin(known))
        if count < 2:
            continue
        kept = slice(own.start, own.start + count)
        pair = Channel(measured[kept]), Channel(simulated[kept])
        found.append(Stretch(given[kept], *pair, None if instrument is None else instrument[kept], kept.start))
    return found


def _following(found: FrequencyResponse, clear: tuple[float, float], given: Array, period: float) -> Array:
    """Give the difference that the setpoint brings about because the responses differ, shape (time,).

    The setpoint passes through the difference of the responses, less what chance adds to it, in the band in which they
    are clear, Hz.
    """
    assert found.model is not None, "a simulated vehicle is given"
    apart = found.gain - found.model
    known = np.isfinite(apart) & (np.abs(apart) > 0) & (found.frequency >= clear[0]) & (found.frequency <= clear[1])
    if not known.any():
        return np.zeros(len(given))
    own = apart[known]
    chance = (np.abs(found.gain[known]) * found.random_error[known]) ** 2
    own = own * np.sqrt(np.maximum(1.0 - chance / np.abs(own) ** 2, 0.0))
    # As long again, so that the end does not answer the beginning.
    spectrum, frequency = np.fft.rfft(given - given.mean(), 2 * len(given)), np.fft.rfftfreq(2 * len(given), period)
    told = found.frequency[known]
    inside = (frequency >= told[0]) & (frequency <= told[-1])
    passed = np.zeros_like(spectrum)
    passed[inside] = spectrum[inside] * np.interp(np.log(frequency[inside]), np.log(told), own)
    return np.asarray(np.fft.irfft(passed)[: len(given)])


def is_apart(comparison: Comparison) -> BoolArray:
    """Mark the windows in which a channel is apart, shape (window, channel).

    There the difference is worth a word, and what of it follows the setpoints is more than all that does not; or the
    whole is far more than that.
    """
    follows, whole = (np.nan_to_num(each) for each in (comparison.follows, comparison.windows))
    floor, told = (np.nan_to_num(each, nan=np.inf) for each in (comparison.floor, comparison.told))
    return np.asarray(less(np.maximum(floor, told), follows) | less(np.maximum(SURE * floor, told), whole), dtype=bool)


DRAWS = 19
"""Flights in gusts: with so many the flight itself lies between the least and the most of them in 90 % of the time, and
one such flight in twenty is told to be none of them."""
_MOVED_BY = (0, 1, 2, 0, 1, 2, 3, 4, 5, 5)
"""Axis of the gusts that move each channel first."""


class InGusts(NamedTuple):
    """A flight beside vehicles in gusts, by channel of `CHANNELS`.

    Attributes
    ----------
    rms : array, shape (draw, channel)
        Root mean square by which each is off from the vehicle in still air; NaN in channels that are not held.
    low, high : array, shape (time, channel)
        Least and most of them at each instant.
    noise : array, shape (channel,)
        White noise that the flight has and they have not: they are given as much.
    beyond : array, shape (channel,)
        Whether the flight is farther off than gusts explain.
    lost : int
        How many overturn.
    """

    rms: Array
    low: Array
    high: Array
    noise: Array
    beyond: BoolArray
    lost: int


def fly_in_gusts(
    flight: LoggedFlight,
    asked: Asked,
    vehicle: VehicleSettings,
    settings: ClosedLoopSettings,
    models: Sequence[VehicleModel],
    effects: SimulatedEffects,
    lack: Lack | None,
    rng: np.random.Generator,
    progress: Callable[[int], None] = lambda _done: None,
) -> list[TwinFlight]:
    """Fly the setpoints of a flight by vehicles that may differ, each in gusts of its own and with what is lacking."""
    found = []
    for number, (model, own) in enumerate(zip(models, rng.spawn(len(models)), strict=True)):
        given = with_effects(model, effects)
        found.append(fly_twin(flight, asked, vehicle, settings, *given, air=Air(model, lack, own)))
        progress((number + 1) * len(flight.time))
    return found


def known_axes(gusts: Gusts | None, lack: Lack | None) -> BoolArray:
    """Mark the axes on which gusts, or what is lacking, are known, shape (6,)."""
    known = np.zeros(len(GUST_AXES), dtype=bool)
    if gusts is not None:
        known |= (gusts.size > 0) | (gusts.white > 0)
    if lack is not None:
        known[: len(lack.memory)] |= np.isfinite(lack.memory)
    return known


def in_gusts(
    measured: Array, still: Array, flown: Sequence[TwinFlight], blown: BoolArray, rng: np.random.Generator
) -> InGusts:
    """Hold a flight against vehicles that flew its setpoints in gusts.

    How far it is off from the vehicle in still air is set beside how far they are. If it is one of them, the channel in
    which it stands out most does so by more than the largest of theirs with a chance of one in all of them: logarithms
    of root mean squares are counted in their standard deviations.

    Parameters
    ----------
    measured, still : array, shape (time, channel)
    blown : array, shape (6,)
        Axes on which gusts, or what is lacking, are known.

    References
    ----------
    Barnard 1963 (Monte Carlo tests); Westfall and Young 1993 (the largest of several).
    """
    values = np.stack([each.values for each in flown])
    noise = _white(measured, values)
    values = values + noise * rng.standard_normal(values.shape)
    held = blown[list(_MOVED_BY)]
    held[6:8] = blown[3] & blown[4]  # in the world
    rms = np.array([root_mean_square(each) for each in (measured - still, *(values - still))])
    held &= np.isfinite(rms).all(axis=0)
    rms[:, ~held] = np.nan
    told = TOLD * root_mean_square(measured, about_mean=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        size = np.log(rms)
        standing = (size - size.mean(axis=0)) / size.std(axis=0)
        farthest = np.nanmax(standing[1:], initial=-np.inf)
        beyond = held & less(farthest, standing[0]) & less(told, rms[0])
    low, high = np.fmin.reduce(values), np.fmax.reduce(values)
    low[:, ~held], high[:, ~held] = np.nan, np.nan
    lost = sum(bool(np.isfinite(each.lost_s)) for each in flown)
    return InGusts(rms[1:], low, high, noise, np.asarray(beyond), lost)


def _white(measured: Array, flown: Array) -> Array:
    """Estimate white noise that a flight has beyond others, by third differences, shape (channel,)."""
    mine, theirs = (
        root_mean_square(np.diff(each, 3, axis=-2).reshape(-1, each.shape[-1])) for each in (measured, flown)
    )
    return np.asarray(np.sqrt(np.nan_to_num(np.maximum(mine**2 - theirs**2, 0.0)) / 20.0))
