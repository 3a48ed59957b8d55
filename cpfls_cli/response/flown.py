"""Which responses flights and a model have: torque to angular acceleration, thrust to specific force, and others."""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import ClassVar

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.dynamics import positive_definite, turning_law
from cpfls_cli.effects.signals import Signals
from cpfls_cli.errors import InputError
from cpfls_cli.lag import delayed, lagged
from cpfls_cli.playback.flight import LoggedFlight
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.playback.rotors import Hold
from cpfls_cli.response.spectra import (
    NOT_JUDGED,
    ROTATION,
    ROTOR_SPEED,
    THRUST,
    Channel,
    FrequencyResponse,
    Mismatch,
    Stretch,
    frequency_response,
    judged_band,
    mismatch,
    response_word,
)
from cpfls_cli.result import about, part, result

# Gives the instruments of each flight, shape (time, column), NaN where there are none, for the inputs of all flights.
# The inputs, shape (time,), are those of one response. Of repeats they are the instruments for each other; setpoints do
# not depend on them.
InstrumentSource = Callable[[Sequence[Array]], Sequence[Array | None]]


NO_INSTRUMENTS = "none"
"""In the place of what the instruments are: nothing in the flights moves the vehicle independently of the gusts."""


@result
class VehicleResponse(FrequencyResponse, Mismatch):
    """One response of a vehicle, measured and of a model, and how far the model is off."""

    SHOWN: ClassVar[tuple[str, ...]] = ("word", *FrequencyResponse.SHOWN)

    of_vehicle: bool = about("1 where it is of the vehicle alone; 0 where of vehicle and autopilot together")

    @property
    def word(self) -> str:
        """The model judged by it: good, acceptable, not-acceptable; not-judged where nothing shows the vehicle."""
        return response_word(self.cost) if self.of_vehicle else NOT_JUDGED


@result
class Responses:
    """Frequency responses of a vehicle as flights show it, and of a model along the same flights.

    Roll, pitch and yaw: torque of the rotors to angular acceleration, body frame, in rad/s^2 per N m. Thrust: to
    specific force along z, in m/s^2 per N. Rotor speed: command to speed, of all rotors together. Roll rate, roll angle
    and others alike: setpoint to what follows it, of vehicle and autopilot.
    """

    FORMAT: ClassVar = "cpfls/response"

    model: str = about("the model: a file, or vehicle for that of /config")
    flights: tuple[str, ...] = about("names of the flights", "flight")
    instruments: str = about(
        "what moves the vehicle independently of gusts: repeats (the same path flown again), setpoints, or none"
    )
    responses: dict[str, VehicleResponse] = part()
    warnings: tuple[str, ...] = about("what to know about flights and model", "warning", default=())
    contradictions: tuple[str, ...] = about(
        "contradictions within the flights or with the vehicle", "contradiction", default=()
    )

    @property
    def has_instruments(self) -> bool:
        """Whether there are any; without, all responses are of vehicle and autopilot together."""
        return self.instruments != NO_INSTRUMENTS

    @property
    def words(self) -> dict[str, str]:
        """How good the model is by each response."""
        return {name: own.word for name, own in self.responses.items()}


def vehicle_responses(
    model: VehicleModel, flights: Sequence[LoggedFlight], instruments: InstrumentSource | None = None
) -> dict[str, VehicleResponse]:
    """Estimate all responses that flights show, with those of a model along the same flights.

    The input is what the rotors of the model give at the logged speeds, without lag, delay and effects. The model's
    output is its acceleration along the measured motion, with all of them, through the same windows and instruments:
    what a window does to a curve it does to both. A command of the rotors knows no gust that the speeds do not know, so
    the response of the speeds needs no instruments. What instruments do not move is estimated without.

    `flights`: of one sampling period.
    `instruments`: see `InstrumentSource`; None: of vehicle and autopilot together.
    Raises InputError if a flight lacks what the model needs, or all are too short for a window.
    """
    by_flight = [_of_flight(model, flight) for flight in flights]
    found: dict[str, list[Stretch]] = {}
    for name in dict.fromkeys(name for parts in by_flight for name in parts):
        own = [parts[name] for parts in by_flight if name in parts]
        # Repeats are instruments for each other: a flight that lacks the response leaves the others without.
        if instruments is not None and name != ROTOR_SPEED and len(own) == len(flights):
            given = _alike(instruments([np.concatenate([part.input for part in parts]) for parts in own]))
            own = [_with_instrument(*pair) for pair in zip(own, given, strict=True)]
        found[name] = [part for parts in own for part in parts]
    period = flights[0].parts[0].period
    estimates = {name: estimated(parts, period) for name, parts in found.items()}
    known = {name: _judged(name, each) for name, each in estimates.items() if each is not None}
    if not known:
        longest = max(len(part) for flight in flights for part in flight.parts) * period
        raise InputError(
            f"{', '.join(flight.name for flight in flights)}: the longest stretch without a pause is {longest:.3g} s, "
            "too short for a frequency response; give longer flights"
        )
    return known


def _judged(name: str, estimate: FrequencyResponse) -> VehicleResponse:
    # Speeds that follow their command feel no gust.
    of_vehicle = estimate.instrumented or name == ROTOR_SPEED
    return VehicleResponse(**vars(estimate), **vars(mismatch(estimate)), of_vehicle=of_vehicle)


def estimated(parts: Sequence[Stretch], period: float) -> FrequencyResponse | None:
    """Estimate a response with its instruments; without them where they do not move it, which then is said."""
    found = frequency_response(parts, period)
    if found is not None and (not found.instrumented or judged_band(found) is not None):
        return found
    return frequency_response([part._replace(instrument=None) for part in parts], period)


def _alike(given: Sequence[Array | None]) -> list[Array | None]:
    """Keep the instruments of those flights that have as many as most: one estimate takes the same for all."""
    columns = Counter(each.shape[1] for each in given if each is not None)
    usual = max(columns, key=lambda number: (columns[number], number), default=0)
    return [each if each is not None and each.shape[1] == usual else None for each in given]


def _with_instrument(parts: Sequence[Stretch], instrument: Array | None) -> list[Stretch]:
    """Hand the instruments of a flight on to its parts."""
    if instrument is None:
        return list(parts)
    ends = np.cumsum([0, *(len(part.input) for part in parts)]).tolist()
    # Of repeats the first known sample is the same place of the path.
    begin = int(np.argmax(np.isfinite(instrument).all(axis=1)))
    return [
        part._replace(instrument=instrument[first:end], start=first - begin)
        for part, (first, end) in zip(parts, pairwise(ends), strict=True)
    ]


def _of_flight(model: VehicleModel, flight: LoggedFlight) -> dict[str, list[Stretch]]:
    """List the stretches of a flight by response, in the order of its parts."""
    found: dict[str, list[Stretch]] = {}
    for signals in flight.parts:
        for name, stretch in _of_part(model, flight, signals):
            found.setdefault(name, []).append(stretch)
    return found


def _of_part(model: VehicleModel, flight: LoggedFlight, part: Signals) -> Iterator[tuple[str, Stretch]]:
    signals = model.repaired(part)
    model.require(signals, flight.name)
    acting = _in_air(model, model.acting(signals))
    rotors, wrench = _of_rotors(model, signals, flight.hold), model.wrench_along(acting)
    turning = _acceleration(model, acting, wrench[:, :3])
    for axis, name in enumerate(ROTATION):
        measured = Channel(integral=signals.body_rate[:, axis])
        yield name, Stretch(rotors[:, axis], measured, Channel(turning[:, axis]))
    felt = specific_force(signals)
    if felt is not None and signals.thrust is not None:
        yield THRUST, Stretch(rotors[:, 5], felt, Channel(wrench[:, 5] / model.vehicle.mass_kg))
    if signals.rotor_command is not None and signals.rotor_speed is not None:
        modelled = _speeds(model, signals.rotor_command, signals.period)
        for rotor, command in enumerate(signals.rotor_command.T):
            speed = Channel(signals.rotor_speed[:, rotor])
            yield ROTOR_SPEED, Stretch(command, speed, None if modelled is None else Channel(modelled[:, rotor]))
    yield from _of_autopilot(signals)


def _of_autopilot(signals: Signals) -> Iterator[tuple[str, Stretch]]:
    """List what follows a setpoint, which no model of the vehicle alone says."""
    followers = (("rate", "body_rate", signals.body_rate), ("angle", "attitude", signals.attitude))
    for word, setpoint, measured in followers:
        asked = signals.setpoints.get(setpoint)
        if asked is not None and measured is not None:
            # A heading goes round.
            for axis, name in enumerate(ROTATION[: 3 if word == "rate" else 2]):
                yield f"{name} {word}", Stretch(asked[:, axis], Channel(measured[:, axis]))


def _speeds(model: VehicleModel, command: Array, period: float) -> Array | None:
    """Give the speeds that follow commands, where the model knows a lag or a delay behind them."""
    response = model.response
    if not (model.commanded and (response.lag_s or response.delay_s)):
        return None
    hold = model.hold or "previous"
    return np.asarray(lagged(delayed(command, response.delay_s / period, hold), response.lag_s / period, hold).start)


def _in_air(model: VehicleModel, signals: Signals) -> Signals:
    """Take the air for still where a model depends on it and the flight does not know it."""
    if not model.feels_air or {"velocity", "attitude"} <= signals.available:
        return signals
    none = np.zeros((len(signals), 3))
    return replace(signals, velocity=none, attitude=none if signals.attitude is None else signals.attitude)


def _of_rotors(model: VehicleModel, signals: Signals, hold: Hold) -> Array:
    """Evaluate torque and thrust of the rotors at the logged speeds, or as stated, shape (time, 6)."""
    if signals.rotor_speed is None:
        return signals.wrench
    rotors = VehicleModel(vehicle=model.vehicle, effects=model.thrust_curve)
    still = np.zeros((len(signals), 3))
    terms = rotors.response.terms_at_samples(signals.rotor_speed, signals.period, hold)
    return rotors.wrench(still, still, terms)


def _acceleration(model: VehicleModel, signals: Signals, torque: Array) -> Array:
    """Compute the angular acceleration that a torque gives at the measured motion, shape (time, 3)."""
    if model.fuzzy is None:
        momentum = signals.body_rate @ model.body.inertia
        return np.asarray((torque - np.cross(signals.body_rate, momentum)) @ model.body.inverse)
    assert signals.attitude is not None, "what a model with inertia functions requires"
    turning = turning_law(model.fuzzy)(signals.attitude, signals.body_rate)
    turns = positive_definite(turning.inertia)
    return np.where(turns[:, None], turning.acceleration(torque), 0.0)


def specific_force(signals: Signals) -> Channel | None:
    """Give the specific force along body z: of the accelerometer, or else of the velocity without differentiating it.

    With the velocity v over the ground in body axes it is ``v_z' + (omega x v)_z + g R_zz``.
    """
    if signals.specific_force is not None:
        return Channel(signals.specific_force[:, 2])
    if signals.attitude is None:
        return None
    weight = signals.vehicle.gravity_m_s2 * signals.rotation[:, 2, 2]
    if signals.velocity is not None:
        velocity = signals.ground_velocity
        turned = signals.body_rate[:, 0] * velocity[:, 1] - signals.body_rate[:, 1] * velocity[:, 0]
        return Channel(turned + weight, velocity[:, 2])
    if signals.acceleration is not None:
        return Channel(np.einsum("ti,ti->t", signals.rotation[:, :, 2], signals.acceleration) + weight)
    return None
