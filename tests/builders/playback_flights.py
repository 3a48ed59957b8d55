"""Flights with a known truth for playback: a vehicle flown in closed loop and logged with noise, and RotorPy's."""

import hashlib
import pickle
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from cpfls_cli.config.unknown import with_guesses
from cpfls_cli.effects.scales import hover_speed
from cpfls_cli.playback.flight import MeasuredMotion, PlaybackFlight
from cpfls_cli.playback.model import ModelEffect, Remainder, VehicleModel
from cpfls_cli.playback.rotors import RotorResponse
from cpfls_cli.playback.windows import Rotors
from cpfls_cli.rotations import rotation_matrix
from cpfls_cli.vehicle.rotors import allocation_matrix
from cpfls_cli.vehicle.settings import RotorSettings, VehicleSettings
from cpfls_cli.vehicle.tracing import Graph, array_symbols, traced_in_two
from tests.builders.recorded_flights import columns_of_log
from tests.builders.vehicles import OPEN_FACTORS, alike

KINDS = ("multisine", "steps", "figure")
STATED = VehicleSettings(
    mass_kg=0.8,
    inertia_kg_m2=(0.0040, 0.0044, 0.0075),
    rotor_speed_max_rad_s=1500.0,
    rotors=alike(((0.12, -0.11, 1), (-0.12, -0.11, -1), (-0.12, 0.11, 1), (0.12, 0.11, -1)), 6e-6, 1.4e-7, height=0.02),
)
FINE_STEP_S = 0.01
MOTOR_S = 0.03
"""Time in which rotors of a flight with measured speeds follow their commands, before the model's own lag."""
_FLOWN = {}


@dataclass(frozen=True, kw_only=True)
class Noise:
    """Standard deviations of the noise of a log, SI, and its time constant where it is coloured."""

    rate: float = 0.0
    attitude: float = 0.0
    velocity: float = 0.0
    position: float = 0.0
    speed: float = 0.0
    time_constant_s: float = 0.0

    def drawn(self, size, values, period, rng):
        """Draw noise of the shape of some values, with the same deviation whatever its colour."""
        keep = np.exp(-period / self.time_constant_s) if self.time_constant_s else 0.0
        settle = int(20 * self.time_constant_s / period)
        white = rng.standard_normal((settle + len(values), *values.shape[1:]))
        return size * lfilter([np.sqrt(1 - keep**2)], [1.0, -keep], white, axis=0)[settle:]


MIDDLING = Noise(rate=0.02, attitude=0.003, velocity=0.02, position=0.003, speed=2.0)


def truth(vehicle=STATED):
    """Put lag, damping, drag, flapping and wrong constants into a stated vehicle, all at once."""
    inertia = np.array(vehicle.inertia_kg_m2) * [1.2, 0.85, 1.1]
    rotors = tuple(
        replace(
            rotor, thrust_factor_n_s2=0.92 * rotor.thrust_factor_n_s2, drag_factor_n_m_s2=1.2 * rotor.drag_factor_n_m_s2
        )
        for rotor in vehicle.rotors
    )
    return VehicleModel(
        vehicle=replace(vehicle, inertia_kg_m2=tuple(inertia.tolist()), rotors=rotors),
        response=RotorResponse(lag_s=0.035),
        effects=(
            ModelEffect("linear_damping", {}, 2.0 * inertia),
            ModelEffect("rotor_drag", {}, np.array([1.2e-4])),
            ModelEffect("flapping_moment", {}, np.array([7e-6])),
        ),
    )


TRUE_BLOCKS = ("inertia", "thrust_factor", "drag_factor", "lag", "linear_damping", "rotor_drag", "flapping_moment")
"""What `truth` has, as blocks of a fit."""


def pushed(vehicle=STATED):
    """Put a force that has no name in the place of the drag: sideways in forward flight, and a lift to one side."""
    model, hover = truth(vehicle), hover_speed(vehicle)
    effects = tuple(effect for effect in model.effects if effect.name != "rotor_drag")
    # By row of the force: constant, sine and cosine of the direction; by speed times rotor speed, and by its square.
    shares = np.zeros((3, 3, 2))
    shares[0, 1:, 0] = 0.12, -0.25
    shares[1, 1] = -0.1, -0.06
    shares[2, :, 0] = 0.25, 0.0, 0.2
    coefficients = vehicle.mass_kg * shares * [1 / hover, 1.0]
    remainder = Remainder(
        breakpoints=np.array([0.0, 1.0]), harmonic_order=1, rows=np.array([3, 4, 5]), coefficients=coefficients
    )
    return replace(model, effects=effects, remainder=remainder)


ADDED_KG, ADDED_AT = 0.05 * STATED.mass_kg, np.array([0.04, 0.03])
"""A weight 5 cm off the centre."""


def loaded():
    """Add a point mass to `truth`, in the plane of its centre of mass."""
    known, mass = truth(), STATED.mass_kg
    x, y = ADDED_AT
    added = ADDED_KG * mass / (ADDED_KG + mass) * np.array([y * y, x * x, x * x + y * y])
    inertia = tuple((np.array(known.vehicle.inertia_kg_m2) + added).tolist())
    offset = ModelEffect("com_offset", {}, ADDED_KG * ADDED_AT / (mass + ADDED_KG))
    vehicle = replace(known.vehicle, mass_kg=mass + ADDED_KG, inertia_kg_m2=inertia)
    return replace(known, vehicle=vehicle, effects=(*known.effects, offset))


def nothing_known(vehicle=STATED):
    """Keep mass and geometry of a vehicle, with guesses of the rest as a config that leaves it null has."""
    rotors = [{"position_m": rotor.position_m, "spin": rotor.spin, **OPEN_FACTORS} for rotor in vehicle.rotors]
    known = {"mass_kg": vehicle.mass_kg, "rotor_speed_max_rad_s": vehicle.rotor_speed_max_rad_s}
    guessed = with_guesses({"vehicle": {**known, "inertia_kg_m2": [None] * 3, "rotors": rotors}})["vehicle"]
    return VehicleSettings(
        **known,
        inertia_kg_m2=tuple(guessed["inertia_kg_m2"]),
        rotors=tuple(RotorSettings(**rotor) for rotor in guessed["rotors"]),
        unknown=tuple(guessed["unknown"]),
    )


def true_numbers(vehicle=STATED):
    """Name the numbers of `truth` as a fit does, SI."""
    model, (rotor, *_) = truth(vehicle), truth(vehicle).vehicle.rotors
    damping, (drag,), (flapping,) = (effect.coefficients for effect in model.effects)
    return {
        **dict(zip(("inertia.Ixx", "inertia.Iyy", "inertia.Izz"), model.vehicle.inertia_kg_m2, strict=False)),
        "thrust_factor": rotor.thrust_factor_n_s2,
        "drag_factor": rotor.drag_factor_n_m_s2,
        "lag.time_constant_s": model.response.lag_s,
        **dict(zip((f"linear_damping.d_{axis}" for axis in "xyz"), damping.tolist(), strict=True)),
        "rotor_drag.k_d": float(drag),
        "flapping_moment.k_f": float(flapping),
    }


def judged(numbers):
    """Divide the numbers of the yaw axis, whose scale motion hardly shows, by its inertia."""
    of_yaw = ("drag_factor", "linear_damping.d_z")
    return {
        f"{name} / Izz" if name in of_yaw else name: value / (numbers["inertia.Izz"] if name in of_yaw else 1.0)
        for name, value in numbers.items()
    }


def flown(model, kinds=KINDS, *, stated=STATED, duration_s=20.0, rate_hz=100.0, hold="previous", noise=None, seed=0):
    """Fly a model once for each kind of excitation, by an autopilot that knows the stated vehicle alone.

    Between samples the rotor speeds of the log are what `hold` says, so that the model's own response is all there is
    between them and the torque. The motion is integrated by Runge-Kutta of fourth order in steps of 10 ms or
    less, which are off by less than 4e-5 rad/s and 1e-5 of any other signal, SI.
    """
    rng = np.random.default_rng(seed)
    period = 1 / rate_hz
    time = period * np.arange(round(duration_s * rate_hz))
    states, speeds = _flown_once(model, stated, planned(kinds, time, rng), period, hold)
    return [
        logged(f"{kind}-{seed}-{number}", states[:, number], speeds[:, number], period, hold, noise or Noise(), rng)
        for number, kind in enumerate(kinds)
    ]


def _flown_once(model, stated, plan, period, hold):
    """Fly, or remember the flight: tests log the same one with other noise."""
    key = hashlib.sha256(pickle.dumps((model, stated, plan, period, hold))).digest()
    if key not in _FLOWN:
        _FLOWN[key] = _Fleet(model, stated, plan, period, hold).flown(len(plan.held))
    return _FLOWN[key]


class Plan(NamedTuple):
    """What an autopilot is asked for, shape (time, flight, 3), or (time, flight): heading, share of position held."""

    position: np.ndarray
    velocity: np.ndarray
    heading: np.ndarray
    held: np.ndarray
    kick: np.ndarray
    """Angular acceleration that is added, rad/s^2."""


def planned(kinds, time, rng):
    """Plan several flights."""
    plans = [reference(kind, time, rng) for kind in kinds]
    return Plan(*(np.stack(part, axis=1) for part in zip(*plans, strict=True)))


def reference(kind, time, rng):
    """Plan one flight; its details are drawn."""
    zero, ones = np.zeros((len(time), 3)), np.ones(len(time))
    if kind == "figure":
        phase = np.cumsum(np.linspace(0.5, 1.4, len(time))) * (time[1] - time[0]) + rng.uniform(0, 2 * np.pi)
        size = rng.uniform(2.0, 3.0, 3) * [1.0, 0.6, 0.25]
        position = size * np.stack([np.sin(phase), np.sin(2 * phase), np.cos(phase)], axis=1)
        return position, np.gradient(position, time, axis=0), 1.2 * np.sin(0.7 * phase), ones, zero
    if kind == "steps":
        part = (time / 1.1).astype(int)
        velocity = rng.uniform(-1.0, 1.0, (part[-1] + 1, 3)) * [3.8, 3.8, 1.5]
        return zero, velocity[part], rng.uniform(-1.0, 1.0, part[-1] + 1)[part], 0.0 * ones, zero
    if kind != "multisine":
        raise ValueError(f"no kind of flight is called {kind}")
    frequency = np.geomspace(0.3, 5.0, 7)[:, None] * rng.uniform(0.85, 1.15, (7, 3))
    phase = rng.uniform(0, 2 * np.pi, (7, 3))
    kick = np.sin(2 * np.pi * frequency * time[:, None, None] + phase).sum(axis=1) * [5.0, 5.0, 4.0]
    return np.sin(0.7 * time)[:, None] * [0.6, 0.6, 0.8], zero, 0.0 * ones, ones, kick


class _Fleet:
    """Several flights of one model at a time, each with its own plan."""

    def __init__(self, model, stated, plan, period, hold):
        self.model, self.plan, self.period, self.hold = model, plan, period, hold
        self.autopilot = Autopilot(stated)
        self.rotors, self.flights = model.rotors, plan.held.shape[1]
        # Delayed speeds jump within a sample: a step ends there.
        even = np.linspace(0.0, 1.0, int(np.ceil(period / FINE_STEP_S - 1e-9)) + 1)
        self.marks = np.unique(np.append(even, np.round(model.response.delay_s / period % 1.0, 9)))
        self.ends = np.cumsum([3, 3, 4, 3, self.rotors])
        self.weight = np.array([0.0, 0.0, model.vehicle.gravity_m_s2])
        self.still = np.zeros((self.flights, self.rotors))
        # As the model gives it to the last bit, its operations recorded once: in a quarter of the time.
        graph = Graph()
        air, rate, rotors = (
            graph.inputs(name, 3, rotors=self.rotors * (name == "rotors")) for name in ("air", "rate", "rotors")
        )
        wrench = replace(model.flown, functions=array_symbols(self.rotors)).wrench(air, rate, Rotors(*rotors))
        self.wrench = traced_in_two(graph, ("none", ()), {"air": air, "rate": rate, "rotors": rotors}, wrench)(())

    def flown(self, samples):
        """Give states and logged rotor speeds at all samples, time first."""
        state = np.zeros((self.flights, self.ends[-1] + self.rotors))
        state[:, 9] = 1.0
        state[:, :3], state[:, 3:6] = self.plan.position[0], self.plan.velocity[0]
        # A model knows nothing of what was before a log, and takes the rotors to have settled at its first speeds.
        first = self.command(0, state) if self.hold == "previous" else self.autopilot.hover
        state[:, self.ends[3] : self.ends[4]], state[:, self.ends[4] :] = first, first**2
        states, self.log = (
            np.empty((samples, *state.shape)),
            np.full((samples + 2, self.flights, self.rotors), self.autopilot.hover),
        )
        for sample in range(samples):
            command = self.command(sample, state)
            if self.hold == "previous":
                self.log[sample] = command
            else:
                now = self.log[sample]
                self.log[sample + 1] = now + (command - now) * (1 - np.exp(-self.period / MOTOR_S))
            states[sample] = state
            for begin, end in pairwise(self.marks):
                state = self.advanced(state, sample + begin, end - begin)
        return states, self.log[:samples]

    def advanced(self, state, at, share):
        """Take one step of Runge-Kutta; `at` and `share` count samples."""
        h, early = self.period * share, 1e-6 * share
        # A step that begins or ends where speeds jump has those between.
        first = self.slopes(state, at + early)
        second = self.slopes(state + 0.5 * h * first, at + 0.5 * share)
        third = self.slopes(state + 0.5 * h * second, at + 0.5 * share)
        fourth = self.slopes(state + h * third, at + share - early)
        state = state + h / 6 * (first + 2 * second + 2 * third + fourth)
        state[:, 6:10] /= np.sqrt((state[:, 6:10] ** 2).sum(axis=1, keepdims=True))
        return state

    def driven(self, at):
        """Give the logged speed that is under way to the rotors, and its change in time."""
        at = max(at - self.model.response.delay_s / self.period, 0.0)
        before = int(at)
        value = self.log[before]
        if self.hold == "previous":
            return value, self.still
        change = self.log[before + 1] - value
        return value + (at - before) * change, change / self.period

    def slopes(self, state, at):
        """Give the derivatives of position, velocity, attitude, rate, acting speed and slow squared speed."""
        velocity, quaternion, rate = state[:, 3:6], state[:, 6:10], state[:, 10:13]
        acting, slow = state[:, self.ends[3] : self.ends[4]], state[:, self.ends[4] :]
        response, body = self.model.response, self.model.body
        driven, change = self.driven(at)
        if response.lag_s:
            change = (driven - acting) / response.lag_s
        else:
            acting = driven
        rotation = _rotation(quaternion)
        air = (velocity[:, None] @ rotation)[:, 0]
        wrench = self.wrench(tuple(air.T), tuple(rate.T), (acting.T, change.T, slow.T))
        torque, force = (np.stack(np.broadcast_arrays(*each), axis=1) for each in wrench)
        angular = (torque - _cross(rate, rate @ body.inertia)) @ body.inverse
        acceleration = (rotation @ force[:, :, None])[:, :, 0] / body.mass - self.weight
        slowly, turning = (acting**2 - slow) / response.slow_s, _turning(quaternion, rate)
        return np.concatenate([velocity, acceleration, turning, angular, change, slowly], axis=1)

    def command(self, sample, state):
        """Ask for rotor speeds."""
        position, velocity, quaternion, rate = state[:, :3], state[:, 3:6], state[:, 6:10], state[:, 10:13]
        return self.autopilot.speeds(self.plan, sample, position, velocity, quaternion, rate)


PULL = np.array([[-7.0, -7.0, 6.0], [7.0, 7.0, 14.0]])
"""Least and largest acceleration that an autopilot asks of thrust, m/s^2, world frame."""


class Autopilot:
    """Asks for rotor speeds as a cascade of velocity, attitude and rate does, of a stated vehicle."""

    def __init__(self, stated):
        self.stated, thrusts = stated, allocation_matrix(stated)
        self.inverse = np.linalg.pinv(thrusts)
        self.hover = np.sqrt(stated.mass_kg * stated.gravity_m_s2 / thrusts[0].sum())

    def speeds(self, plan, sample, position, velocity, quaternion, rate):
        """Ask for speeds of several flights, shape (flight, rotor), rad/s; quaternions x, y, z, w."""
        stated = self.stated
        pull = 2.5 * (plan.velocity[sample] - velocity) + [0.0, 0.0, stated.gravity_m_s2]
        pull += 1.8 * plan.held[sample][:, None] * (plan.position[sample] - position)
        # Rotors have to be left for the torques: no steep tilts, no hard turns of the heading.
        pull = np.clip(pull, *PULL)
        rotation = _rotation(quaternion)
        turned = np.swapaxes(_upright(pull, plan.heading[sample]), 1, 2) @ rotation
        error = 0.5 * (turned[:, [2, 0, 1], [1, 2, 0]] - turned[:, [1, 2, 0], [2, 0, 1]])
        wanted = 14.0 * (-5.0 * error * [1.0, 1.0, 0.5] - rate) * [1.0, 1.0, 0.5] + plan.kick[sample]
        wanted[:, 2] = np.clip(wanted[:, 2], -8.0, 8.0)
        thrust = stated.mass_kg * np.einsum("bi,bi->b", pull, rotation[:, :, 2])
        squared = np.column_stack([thrust, wanted * np.array(stated.inertia_kg_m2[:3])]) @ self.inverse.T
        return np.sqrt(np.clip(squared, (0.3 * self.hover) ** 2, (1.7 * self.hover) ** 2))


def _bilinear(shape, factors):
    """Make a function of two arrays of vectors, of which NumPy takes three steps for any number of them.

    `factors` holds rows of four: which entry of the value, of the first and of the second vector, and the factor.
    """
    table = np.zeros(shape)
    for entry, first, second, factor in factors:
        table[first, second, entry] += factor
    table = table.reshape(-1, shape[2])

    def product(one, other):
        return (one[:, :, None] * other[:, None]).reshape(len(one), -1) @ table

    return product


_cross = _bilinear(
    (3, 3, 3), [(0, 1, 2, 1.0), (0, 2, 1, -1.0), (1, 2, 0, 1.0), (1, 0, 2, -1.0), (2, 0, 1, 1.0), (2, 1, 0, -1.0)]
)
# Derivatives of quaternions x, y, z, w of bodies that turn.
_turning = _bilinear(
    (4, 3, 4),
    [
        (0, 3, 0, 0.5), (0, 1, 2, 0.5), (0, 2, 1, -0.5), (1, 3, 1, 0.5), (1, 2, 0, 0.5), (1, 0, 2, -0.5),
        (2, 3, 2, 0.5), (2, 0, 1, 0.5), (2, 1, 0, -0.5), (3, 0, 0, -0.5), (3, 1, 1, -0.5), (3, 2, 2, -0.5),
    ],
)  # fmt: skip
_squares = _bilinear(
    (4, 4, 9),
    [
        (0, 1, 1, -2.0), (0, 2, 2, -2.0), (1, 0, 1, 2.0), (1, 2, 3, -2.0), (2, 0, 2, 2.0), (2, 1, 3, 2.0),
        (3, 0, 1, 2.0), (3, 2, 3, 2.0), (4, 0, 0, -2.0), (4, 2, 2, -2.0), (5, 1, 2, 2.0), (5, 0, 3, -2.0),
        (6, 0, 2, 2.0), (6, 1, 3, -2.0), (7, 1, 2, 2.0), (7, 0, 3, 2.0), (8, 0, 0, -2.0), (8, 1, 1, -2.0),
    ],
)  # fmt: skip


_ONE = np.eye(3)


def _rotation(quaternion):
    """Give the matrices of unit quaternions x, y, z, w."""
    return _squares(quaternion, quaternion).reshape(-1, 3, 3) + _ONE


def _upright(pull, heading):
    """Orient bodies whose z axes point along a pull."""
    up = pull / np.sqrt((pull * pull).sum(axis=1, keepdims=True))
    forward = _cross(np.stack([-np.sin(heading), np.cos(heading), 0 * heading], axis=1), up)
    forward /= np.sqrt((forward * forward).sum(axis=1, keepdims=True))
    return np.stack([forward, _cross(up, forward), up], axis=2)


def logged(name, states, speed, period, hold, noise, rng):
    """Log states (position, velocity, quaternion x, y, z, w, rate) with noise."""

    def noisy(values, size):
        return np.ascontiguousarray(values + noise.drawn(size, values, period, rng))

    turn = Rotation.from_quat(states[:, 6:10]) * Rotation.from_rotvec(noisy(np.zeros((len(states), 3)), noise.attitude))
    motion = MeasuredMotion(
        noisy(states[:, :3], noise.position),
        noisy(states[:, 3:6], noise.velocity),
        turn.as_matrix(),
        noisy(states[:, 10:13], noise.rate),
        period,
    )
    measured = noisy(speed, noise.speed)
    return PlaybackFlight(name=name, motion=motion, speed=measured, hold=hold, stretches=(slice(0, len(states)),))


ROTORPY = VehicleSettings(
    mass_kg=0.5,
    inertia_kg_m2=(0.00365, 0.00368, 0.00703),
    rotor_speed_max_rad_s=1500.0,
    rotors=alike(((1, 1, -1), (1, -1, 1), (-1, -1, -1), (-1, 1, 1)), 5.57e-6, 1.36e-7, 0.1202081528),
)
ROTORPY_HIDDEN = {
    "none": (),
    "com": (ModelEffect("com_offset", {}, np.array([0.010, -0.006])),),
    "drag": (
        ModelEffect("rotor_drag", {}, np.array([1.19e-4])),
        ModelEffect("inflow", {}, np.array([2.32e-4])),
        ModelEffect("translational_lift", {}, np.array([3.39e-3])),
        ModelEffect("parasitic_drag", {}, np.array([0.005, 0.005, 0.010, 0.0, 0.0, 0.0])),
    ),
}
"""What each flight of RotorPy hides, as its origin states."""


def rotorpy_flight(name):
    """Read a flight of RotorPy, with its measured rotor speeds; skip the test where it is absent."""
    log = columns_of_log("rotorpy", name)

    def columns(*names):
        return np.ascontiguousarray(np.stack([log[column] for column in names], axis=1))

    motion = MeasuredMotion(
        columns("x", "y", "z"),
        columns("vx", "vy", "vz"),
        np.ascontiguousarray(rotation_matrix(columns("phi", "theta", "psi"))),
        columns("wx", "wy", "wz"),
        0.01,
    )
    speed = columns("om1", "om2", "om3", "om4")
    return PlaybackFlight(name=name, motion=motion, speed=speed, hold="linear", stretches=(slice(0, len(speed)),))


def rotorpy_truth(name):
    """Give the model that flew."""
    return VehicleModel(vehicle=ROTORPY, effects=ROTORPY_HIDDEN[name])


def mean_errors(found, signal):
    """Mean norms of errors of a signal, shape (prediction, horizon)."""
    return np.array([own.signals[signal].mae for own in found.models.values()])
