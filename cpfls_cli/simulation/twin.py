"""Simulated vehicles along the setpoints of a flight, compared with it: in time, by frequency, and in gusts."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, NamedTuple

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array, BoolArray, ComplexArray
from cpfls_cli.autopilots.motors import Motors
from cpfls_cli.autopilots.registry import AUTOPILOTS
from cpfls_cli.effects.signals import Signals
from cpfls_cli.errors import InputError
from cpfls_cli.playback.flight import LoggedFlight, contradictions_of, stretches_of
from cpfls_cli.playback.gusts import GUST_AXES, Gusts
from cpfls_cli.playback.instruments import instruments
from cpfls_cli.playback.lack import DrawnLack, Lack
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.response.flown import estimated
from cpfls_cli.response.spectra import (
    NOT_ACCEPTABLE,
    Channel,
    FrequencyResponse,
    Mismatch,
    Stretch,
    mismatch,
    response_word,
)
from cpfls_cli.result import about, part, result
from cpfls_cli.rounding import less
from cpfls_cli.simulation.closed_loop import Clock, ClosedLoop, LostVehicleError, Setpoints, clock_of, fly_setpoints
from cpfls_cli.simulation.model import with_effects
from cpfls_cli.simulation.settings import ClosedLoopSettings
from cpfls_cli.vehicle.motion import ATTITUDE, BODY_RATE, POSITION, VELOCITY
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


class Asked(NamedTuple):
    """What a law is asked for along a flight, one entry for each stretch.

    Attributes
    ----------
    kind : str
        `ANGLE_LAW` or `RATE_LAW`.
    thrust_from : str
        ``setpoint``, or ``rotors`` where that of the flight's own rotors takes its place.
    """

    setpoints: tuple[Setpoints, ...]
    kind: str
    thrust_from: str


@dataclass(frozen=True)
class Air:
    """What pushes a vehicle apart from its model: gusts, and what the model lacks, drawn for each stretch."""

    model: VehicleModel
    lack: Lack | None
    rng: np.random.Generator

    def drawn(self, clock: Clock) -> tuple[Array | None, DrawnLack | None]:
        """Draw both for the steps of an integration."""
        gusts, lack = self.model.gusts, self.lack
        push = None if gusts is None else gusts.drawn(self.rng, clock.step, clock.steps)
        return push, None if lack is None else lack.drawn(self.model, self.rng, clock.step, clock.steps)


def asked_of(flight: LoggedFlight, settings: ClosedLoopSettings, vehicle: VehicleSettings, *, share: bool) -> Asked:
    """Give the setpoints of a flight to the law of `settings.autopilot`.

    Parameters
    ----------
    share : bool
        Whether a logged thrust setpoint is a share of the full thrust, in the units of the autopilot; else it is in N.

    Raises
    ------
    InputError
        If neither the attitude nor the body rate that was asked for is known, or nothing gives the thrust.
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
    thrust_known = known("thrust")
    if not thrust_known and any(part.rotor_speed is None for part in parts):
        raise InputError(
            f"{flight.name}: neither a thrust setpoint nor rotor speeds give the thrust: map setpoint_thrust or "
            "rotor_speed in import.signals"
        )

    def thrust(part: Signals) -> Array:
        if thrust_known and share:
            return part.setpoints["thrust"][:, 0]
        newton = part.setpoints["thrust"][:, 0] if thrust_known else lift_of(part)
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
    return Asked(tuple(made), kind, "setpoint" if thrust_known else "rotors")


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
    asked, still = np.full_like(measured, np.nan), np.empty_like(measured)
    for stretch, own in zip(flight.parts, stretches_of(flight.parts), strict=True):
        for name, place in (("body_rate", slice(0, 3)), ("attitude", slice(3, 6)), ("velocity", slice(6, 9))):
            if name in stretch.setpoints:
                asked[own, place] = stretch.setpoints[name]
        still[own] = measured[own.start]
    return asked, still


def fly_twin(
    loop: ClosedLoop,
    flight: LoggedFlight,
    asked: Asked,
    progress: Callable[[int], None] = lambda _done: None,
    air: Air | None = None,
) -> TwinVehicle:
    """Fly the setpoints of a flight, each stretch from the flight's own state on, without looking at the flight again.

    Its motion is that of `CHANNELS`, NaN behind a loss of the vehicle; they are not compared yet.

    Parameters
    ----------
    progress : callable
        Takes samples done.
    air : Air or None
        None for still air.
    """
    parts, positions, lost = [], [], np.nan
    for stretch, setpoints in zip(flight.parts, asked.setpoints, strict=True):
        values, places, where = _flown(loop, stretch, setpoints, air)
        parts.append(values)
        positions.append(places)
        lost = where if np.isnan(lost) else lost
        progress(sum(map(len, parts)))
    simulated, position = np.concatenate(parts), np.concatenate(positions)
    return TwinVehicle(lost_s=lost, simulated=simulated, position=position, channels={})


def _flown(loop: ClosedLoop, part: Signals, setpoints: Setpoints, air: Air | None) -> tuple[Array, Array, float]:
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
    push, lacking = (None, None) if air is None else air.drawn(clock_of(part.time, loop.settings))
    count, lost = len(part), np.nan
    while count > 1:
        time = part.time[:count]
        try:
            motion = fly_setpoints(loop, time, setpoints, start, push, speed=speed, lacking=lacking)
        except LostVehicleError as error:
            lost, count = float(part.time[error.sample]), error.sample
            continue
        state = motion.state
        angles, gravity = state[:, ATTITUDE], loop.vehicle.gravity_m_s2
        lift = _lift(motion.change[:, VELOCITY], angles, gravity)
        if part.attitude is not None:
            # A full turn from the flight's own is the same.
            angles = part.attitude[:count] + rotations.wrapped(angles - part.attitude[:count])
        values[:count] = np.column_stack([state[:, BODY_RATE], angles, state[:, VELOCITY], lift])
        places[:count] = state[:, POSITION]
        break
    return values, places, lost


def fly_in_gusts(
    loop: ClosedLoop,
    flight: LoggedFlight,
    asked: Asked,
    models: Sequence[VehicleModel],
    lack: Lack | None,
    rng: np.random.Generator,
    progress: Callable[[int], None] = lambda _done: None,
) -> list[TwinVehicle]:
    """Fly the setpoints of a flight by vehicles that may differ, each in gusts of its own and with what is lacking."""
    found = []
    for number, (model, own) in enumerate(zip(models, rng.spawn(len(models)), strict=True)):
        held, effects = with_effects(model, loop.effects)
        flown = replace(loop, model=held, effects=effects)
        found.append(fly_twin(flown, flight, asked, air=Air(model, lack, own)))
        progress((number + 1) * len(flight.time))
    return found


SETPOINT, STAYS = "setpoint", "nothing-moves"
"""Predictions without a vehicle: the setpoints themselves, and a vehicle that stays as it begins."""
WINDOW_S = 1.0
_SURE = 3.0
"""Times what does not follow the setpoints, from which on a difference over a window is none of it."""
_LEAST = 10 ** (1.0 / 20.0) - 1
"""Share of the motion from which on a difference counts: 1 dB, where it counts 20 in the cost of a response."""
DRAWS = 19
"""Flights in gusts: with so many the flight itself lies between the least and the most of them in 90 % of the time, and
one such flight in twenty is taken for none of them."""
_MOVED_BY = (0, 1, 2, 0, 1, 2, 3, 4, 5, 5)
"""Axis of the gusts that move each channel first."""
_CHANNELS = (
    "roll rate, pitch rate, yaw rate: rad/s, body; roll, pitch, yaw: rad; velocity x, y, z: m/s, world; thrust: "
    "specific force along z, m/s^2, body"
)


@result
class TwinChannel(Mismatch):
    """How far a simulated vehicle is from a flight in one channel, in time and by frequency."""

    SHOWN: ClassVar[tuple[str, ...]] = ("word", "apart_share", "parts")

    rms: float = about("root mean square of measured less simulated", unit="SI", gaps=True)
    floor: float = about(
        "part of it that does not follow the setpoints: gusts, noise, and what is not linear", unit="SI", gaps=True
    )
    first_apart_s: float = about("when it is apart first, on the clock of the flight", unit="s", gaps=True)
    frequency: Array = about("of the answers to the setpoints", "frequency", unit="Hz", brief=False)
    gain: ComplexArray = about("of the flight, channel over setpoint", "frequency", unit="SI", gaps=True, brief=False)
    model: ComplexArray = about("of the simulated vehicle", "frequency", unit="SI", gaps=True, brief=False)
    random_error: Array = about(
        "standard error of the measured gain over the gain; in radians that of the phase",
        "frequency",
        gaps=True,
        brief=False,
    )
    difference: Array = about(
        "root mean square of measured less simulated, by window", "window", unit="SI", gaps=True, brief=False
    )
    follows: Array = about(
        "of the part that follows the setpoints: the error of the simulated vehicle",
        "window",
        unit="SI",
        gaps=True,
        brief=False,
    )
    apart: BoolArray = about("1 where they are apart beyond gusts and noise", "window", brief=False)

    @property
    def word(self) -> str:
        """The vehicle judged by frequency: good, acceptable, not-acceptable; not-judged."""
        return response_word(self.cost)

    @property
    def judged(self) -> bool:
        """Whether it is judged by frequency."""
        return bool(np.isfinite(self.cost))

    @property
    def apart_share(self) -> float:
        """Share of the windows in which they are apart."""
        return float(self.apart.mean()) if len(self.apart) else 0.0

    @property
    def parts(self) -> bool:
        """Whether the vehicle parts from the flight, in time or by frequency."""
        return self.word == NOT_ACCEPTABLE or bool(self.apart.any())


@result
class TwinVehicle:
    """A simulated vehicle along the setpoints of a flight."""

    lost_s: float = about("when it overturned; not finite where it did not", unit="s", gaps=True)
    simulated: Array = about("its motion", "sample", "channel", unit="SI", gaps=True, brief=False)
    position: Array = about("its position", "sample", "axis", unit="m", frame="world", gaps=True, brief=False)
    channels: Mapping[str, TwinChannel] = part()

    @property
    def parted(self) -> list[str]:
        """Channels in which it parts from the flight."""
        return [name for name, own in self.channels.items() if own.parts]

    @property
    def judged(self) -> list[str]:
        """Channels in which it is judged by frequency."""
        return [name for name, own in self.channels.items() if own.judged]


@result
class ChannelInGusts:
    """One channel of a flight against vehicles that the model allows, each in gusts of its own."""

    SHOWN: ClassVar[tuple[str, ...]] = ("rms_in_gusts",)

    rms: float = about("by which the flight is off from the model in still air, root mean square", unit="SI")
    drawn: Array = about("by which each vehicle in gusts is", "draw", unit="SI", brief=False)
    noise: float = about("white noise that the flight has, and they are given", unit="SI")
    inside_share: float = about(
        "share of the time in which the flight is between the least and most of them", gaps=True
    )
    beyond: bool = about("whether the flight is farther off than they are")
    low: Array = about("least of them", "sample", unit="SI", gaps=True, brief=False)
    high: Array = about("most of them", "sample", unit="SI", gaps=True, brief=False)

    @property
    def rms_in_gusts(self) -> tuple[float, float]:
        """The least and the most by which a vehicle in gusts is off."""
        return float(self.drawn.min()), float(self.drawn.max())


@result
class InGusts:
    """A flight against vehicles in gusts, in the channels that known gusts move."""

    vehicle: str = about("the model that they are drawn from")
    flights: int = about("how many fly")
    lost: int = about("how many overturn")
    channels: Mapping[str, ChannelInGusts] = part()

    @property
    def beyond(self) -> list[str]:
        """Channels in which the flight is farther from the model than gusts explain."""
        return [name for name, own in self.channels.items() if own.beyond]


@result
class TwinGains:
    """Parameters of the autopilot, and where they come from."""

    SHOWN: ClassVar[tuple[str, ...]] = ("values",)

    source: str = about("stated (in the config), log, simulation (that made the flight) or defaults")
    name: tuple[str, ...] = about("parameters by the autopilot's own names", "gain", brief=False)
    value: Array = about("in the autopilot's own units", "gain", unit="SI", brief=False)

    @property
    def values(self) -> dict[str, float]:
        """The value of each parameter."""
        return dict(zip(self.name, self.value.tolist(), strict=True))


@result
class Twin:
    """The setpoints of a flight flown by its autopilot's law and simulated vehicles, compared with the flight."""

    FORMAT: ClassVar[str] = "cpfls/twin"
    SHOWN: ClassVar[tuple[str, ...]] = ("rms", "movement")

    flight: str = about("name of the flight")
    autopilot: str = about("whose law flies")
    asked: str = about("what the law is asked for: attitude or body_rate, as logged")
    thrust_from: str = about("setpoint, or rotors: the thrust that the flight's own rotors gave takes its place")
    gains: TwinGains = part()
    left_out: tuple[str, ...] = about("parts of the autopilot's law that are not simulated", "left_out")
    rotor_lag_s: float = about("time constant of the simulated rotors behind their command", unit="s")
    instruments: str = about("what moves the vehicle independently of gusts: repeats, setpoints or none")
    channel: tuple[str, ...] = about(_CHANNELS, "channel", brief=False)
    time: Array = about("on the clock of the flight", "sample", unit="s", brief=False)
    begins: float = about("stamp of the log at time 0; not finite where it has none", unit="s", gaps=True, brief=False)
    measured: Array = about("of the flight", "sample", "channel", unit="SI", gaps=True, brief=False)
    measured_position: Array | None = about(
        "of the flight", "sample", "axis", unit="m", frame="world", gaps=True, brief=False, default=None
    )
    setpoint: Array = about("of the flight", "sample", "channel", unit="SI", gaps=True, brief=False)
    moved: Array = about("root mean square of the flight about its mean", "channel", unit="SI", gaps=True, brief=False)
    setpoint_rms: Array = about(
        "root mean square of measured less setpoint", "channel", unit="SI", gaps=True, brief=False
    )
    still_rms: Array = about("the same of what stays as it begins", "channel", unit="SI", gaps=True, brief=False)
    window_start: Array = about("beginnings of the windows of a second", "window", unit="s", brief=False)
    vehicles: Mapping[str, TwinVehicle] = part()
    in_gusts: InGusts | None = part(default=None)
    warnings: tuple[str, ...] = about("what to know about flight and vehicles", "warning")
    contradictions: tuple[str, ...] = about("within the flight, or with the vehicle", "contradiction", default=())

    @property
    def judged(self) -> TwinVehicle:
        """The vehicle that is judged: the last one."""
        return list(self.vehicles.values())[-1]

    @property
    def movement(self) -> dict[str, float]:
        """Root mean square of the flight about its mean, by channel."""
        return dict(zip(self.channel, self.moved.tolist(), strict=True))

    @property
    def rms(self) -> dict[str, dict[str, float]]:
        """Root mean square of measured less predicted, by prediction and channel."""
        alone = {SETPOINT: self.setpoint_rms, STAYS: self.still_rms}
        return {
            **{name: {each: own.rms for each, own in one.channels.items()} for name, one in self.vehicles.items()},
            **{name: dict(zip(self.channel, values.tolist(), strict=True)) for name, values in alone.items()},
        }


def twin_of(
    flight: LoggedFlight,
    asked: Asked,
    flown: Mapping[str, TwinVehicle],
    settings: ClosedLoopSettings,
    gains: TwinGains,
    warnings: Sequence[str],
    air: InGusts | None = None,
) -> Twin:
    """Compare simulated vehicles, by name, with a flight."""
    measured, moved_by = measured_channels(flight), instruments([flight.playback])
    setpoint, still = baselines(flight, measured)
    positions = [each.position for each in flight.parts if each.position is not None]

    def moves(given: Array) -> Array | None:
        return moved_by.by_flight([given])[0]

    return Twin(
        flight=flight.name,
        autopilot=settings.autopilot,
        asked=asked.kind,
        thrust_from=asked.thrust_from,
        gains=gains,
        left_out=AUTOPILOTS[settings.autopilot].left_out,
        rotor_lag_s=settings.rotor_time_constant_s,
        instruments=moved_by.kind,
        channel=CHANNELS,
        time=flight.time,
        begins=flight.parts[0].begins,
        measured=measured,
        measured_position=np.concatenate(positions) if len(positions) == len(flight.parts) else None,
        setpoint=setpoint,
        moved=root_mean_square(measured, about_mean=True),
        setpoint_rms=root_mean_square(measured - setpoint),
        still_rms=root_mean_square(measured - still),
        window_start=np.array([flight.time[each.start] for each in windows(flight)]),
        vehicles={
            name: replace(one, channels=compared(flight, asked, measured, one.simulated, moves))
            for name, one in flown.items()
        },
        in_gusts=air,
        warnings=tuple(warnings),
        contradictions=contradictions_of([flight]),
    )


def compared(
    flight: LoggedFlight, asked: Asked, measured: Array, simulated: Array, instrument: Callable[[Array], Array | None]
) -> dict[str, TwinChannel]:
    """Compare a simulated vehicle with a flight by channel, shape (time, channel), in time and by frequency.

    By frequency both answer the same setpoints, through the same windows and instruments (`instrument` takes a setpoint
    to what moves the vehicle from outside, as `Stretch` takes it): what differs beyond the random error is the
    simulator's error, whatever gusts there were. A difference in time is also that of gusts and noise: from what the
    responses differ by, and from the spectrum of the setpoints, follows how much of it the setpoints bring about; the
    rest is its floor.
    """
    cut = windows(flight)

    def found(index: int) -> TwinChannel:
        own, other = measured[:, index], simulated[:, index]
        estimate, judged, follows = _answers(flight, _input_of(flight, asked, index), own, other, instrument)
        rms = float(root_mean_square(own - other))
        following, floor, least = np.full_like(own, np.nan), np.nan, np.nan
        if follows is not None:
            following = follows
            floor = float(np.sqrt(max(rms**2 - float(root_mean_square(following)) ** 2, 0.0)))
            least = _LEAST * float(root_mean_square(own, about_mean=True))
        difference, followed = (
            np.array([root_mean_square(values[each]) for each in cut]) for values in (own - other, following)
        )
        apart = _is_apart(difference, followed, floor, least)
        first = np.flatnonzero(apart)
        unknown = np.zeros(0, dtype=complex)
        return TwinChannel(
            **vars(judged),
            rms=rms,
            floor=floor,
            first_apart_s=float(flight.time[cut[first[0]].start]) if len(first) else np.nan,
            frequency=np.zeros(0) if estimate is None else estimate.frequency,
            gain=unknown if estimate is None else estimate.gain,
            model=unknown if estimate is None or estimate.model is None else estimate.model,
            random_error=np.zeros(0) if estimate is None else estimate.random_error,
            difference=difference,
            follows=followed,
            apart=apart,
        )

    return {name: found(index) for index, name in enumerate(CHANNELS)}


def _answers(
    flight: LoggedFlight,
    given: Array | None,
    measured: Array,
    simulated: Array,
    instrument: Callable[[Array], Array | None],
) -> tuple[FrequencyResponse | None, Mismatch, Array | None]:
    """Estimate how both answer a setpoint, and the difference that it brings about, shape (time,), where that is clear.

    NaN between stretches; None where nothing is clear.
    """
    away = measured - simulated
    if given is None or not np.isfinite(away).any() or not np.ptp(given) > 0:
        return None, Mismatch(cost=np.nan), None
    period = flight.parts[0].period
    parts = _stretches(flight, given, measured, simulated, instrument(given))
    estimate = estimated(parts, period)
    judged = Mismatch(cost=np.nan) if estimate is None else mismatch(estimate)
    if estimate is None or judged.band is None:
        return estimate, judged, None
    follows = np.full_like(away, np.nan)
    for each in parts:
        follows[each.start : each.start + len(each.input)] = _following(estimate, judged.band, each.input, period)
    return estimate, judged, follows


def _is_apart(difference: Array, follows: Array, floor: float, least: float) -> BoolArray:
    """Mark the windows in which a channel is apart, shape (window,).

    There the difference counts, and what of it follows the setpoints is more than all that does not; or the whole is
    far more than that.
    """
    if not np.isfinite(floor):
        return np.zeros(len(difference), dtype=bool)
    follows, whole = np.nan_to_num(follows), np.nan_to_num(difference)
    return np.asarray(less(max(floor, least), follows) | less(max(_SURE * floor, least), whole), dtype=bool)


def windows(flight: LoggedFlight) -> list[slice]:
    """Cut the samples of a flight into windows of `WINDOW_S`; none spans a pause, and what is left over is its own."""
    length = max(round(WINDOW_S / flight.parts[0].period), 2)
    return [
        slice(start, min(start + length, own.stop))
        for own in stretches_of(flight.parts)
        for start in range(own.start, own.stop, length)
    ]


def root_mean_square(values: Array, *, about_mean: bool = False) -> Array:
    """Take the root mean square over time where it is known, NaN where nowhere."""
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
    found = []
    for own in stretches_of(flight.parts):
        known = np.isfinite(simulated[own]) & np.isfinite(measured[own])
        count = len(known) if known.all() else int(np.argmin(known))
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
    clear_hz = found.frequency[known]
    inside = (frequency >= clear_hz[0]) & (frequency <= clear_hz[-1])
    passed = np.zeros_like(spectrum)
    passed[inside] = spectrum[inside] * np.interp(np.log(frequency[inside]), np.log(clear_hz), own)
    return np.asarray(np.fft.irfft(passed)[: len(given)])


def known_axes(gusts: Gusts | None, lack: Lack | None) -> BoolArray:
    """Mark the axes on which gusts, or what is lacking, are known, shape (6,)."""
    known = np.zeros(len(GUST_AXES), dtype=bool)
    if gusts is not None:
        known |= (gusts.size > 0) | (gusts.white > 0)
    if lack is not None:
        known[: len(lack.memory)] |= np.isfinite(lack.memory)
    return known


def in_gusts(
    measured: Array,
    still: Array,
    flown: Sequence[TwinVehicle],
    blown: BoolArray,
    rng: np.random.Generator,
    vehicle: str = "",
) -> InGusts:
    """Compare a flight with vehicles that flew its setpoints in gusts.

    How far it is off from the vehicle in still air is compared with how far they are. If it is one of them, the channel
    in which it is farthest off is so by more than the largest of theirs with a chance of one in all of them: logarithms
    of root mean squares are counted in their standard deviations.

    Parameters
    ----------
    measured, still : array, shape (time, channel)
    blown : array, shape (6,)
        Axes on which gusts, or what is lacking, are known.
    vehicle : str
        Name of the model that they are drawn from.

    References
    ----------
    Barnard 1963 (Monte Carlo tests); Westfall and Young 1993 (the largest of several).
    """
    values = np.stack([each.simulated for each in flown])
    noise = _white(measured, values)
    values = values + noise * rng.standard_normal(values.shape)
    held = blown[list(_MOVED_BY)]
    held[6:8] = blown[3] & blown[4]  # in the world
    rms = np.array([root_mean_square(each) for each in (measured - still, *(values - still))])
    held &= np.isfinite(rms).all(axis=0)
    least = _LEAST * root_mean_square(measured, about_mean=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        size = np.log(np.where(held, rms, np.nan))
        standing = (size - size.mean(axis=0)) / size.std(axis=0)
        farthest = np.nanmax(standing[1:], initial=-np.inf)
        beyond = held & less(farthest, standing[0]) & less(least, rms[0])
    low, high = np.fmin.reduce(values), np.fmax.reduce(values)
    return InGusts(
        vehicle=vehicle,
        flights=len(flown),
        lost=sum(bool(np.isfinite(each.lost_s)) for each in flown),
        channels={
            CHANNELS[at]: ChannelInGusts(
                rms=float(rms[0, at]),
                drawn=rms[1:, at],
                noise=float(noise[at]),
                inside_share=_inside(measured[:, at], low[:, at], high[:, at]),
                beyond=bool(beyond[at]),
                low=low[:, at],
                high=high[:, at],
            )
            for at in np.flatnonzero(held)
        },
    )


def _inside(own: Array, low: Array, high: Array) -> float:
    """Give the share of the time in which values are between others, where both are known."""
    known = np.isfinite(own) & np.isfinite(low)
    return float(((low <= own) & (own <= high))[known].mean()) if known.any() else np.nan


def _white(measured: Array, flown: Array) -> Array:
    """Estimate white noise that a flight has beyond others, by third differences, shape (channel,)."""
    mine, theirs = (
        root_mean_square(np.diff(each, 3, axis=-2).reshape(-1, each.shape[-1])) for each in (measured, flown)
    )
    return np.asarray(np.sqrt(np.nan_to_num(np.maximum(mine**2 - theirs**2, 0.0)) / 20.0))
