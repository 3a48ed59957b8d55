"""Flights of vehicles that change: hovers with gentle legs in gusts; nothing of the package flies them."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from scipy.signal import lfilter

from cpfls_cli.arrays import Array
from cpfls_cli.compiling import compiled
from cpfls_cli.effects.signals import Signals
from cpfls_cli.rotations import euler_angles
from cpfls_cli.vehicle.settings import RotorSettings, VehicleSettings

STEP_S, EVERY = 2e-3, 5
SECONDS, SETTLES_S, RESTS_S = 30.0, 3.0, 1.6
"""Of a flight: what is logged, what is flown before, and what is logged on the ground."""

GRAVITY = 9.81
MEMORY_S = np.array([0.31, 1.18, 0.5])
_HUB = 0.15
"""Height of a rotor over the centre of mass, share of the arm."""


class Kind(NamedTuple):
    """A type of vehicle, in SI; rotors stand in a circle, the first on the right of the nose, and go to the right."""

    name: str
    rotors: int
    mass: float
    inertia: tuple[float, float, float]
    arm: float
    thrust_factor: float
    drag_factor: float
    lag: float
    air: float
    """Force by speed through the air, N s/m."""
    gusts: tuple[float, float, float]
    """Angular acceleration by them, rad/s^2."""
    wind: float
    """Its standard deviation from day to day along an axis, m/s."""
    volts: float
    by_voltage: float
    """Power of the voltage that thrust goes with."""
    bandwidth: float = 12.0
    """Of the autopilot's loop of attitude, rad/s."""
    integral: float = 0.0
    """Of its error over the angle itself, 1/s."""

    @property
    def places(self) -> Array:
        """Hubs, shape (rotor, 2), m."""
        angle = -np.pi / self.rotors * (1 + 2 * np.arange(self.rotors))
        return self.arm * np.stack([np.cos(angle), np.sin(angle)], axis=1)

    @property
    def spins(self) -> Array:
        """1 turns counter-clockwise, shape (rotor,)."""
        return np.asarray(1 - 2 * (np.arange(self.rotors) % 2), dtype=float)

    @property
    def hover(self) -> float:
        """Squared speed of a rotor, rad^2/s^2."""
        return self.mass * GRAVITY / self.rotors / self.thrust_factor


QUAD = Kind(
    "quadrotor, 1.5 kg", 4, 1.5, (0.018, 0.02, 0.034), 0.17, 8.5e-6, 1.36e-7, 0.03, 0.3, (2.0, 2.0, 0.7), 1.0, 16.8, 1.0
)
HEXA = Kind(
    "hexarotor, 2.4 kg", 6, 2.4, (0.04, 0.045, 0.08), 0.27, 1.1e-5, 1.9e-7, 0.035, 0.5, (1.5, 1.5, 0.5), 1.0, 22.2, 1.0
)
NANO = Kind(
    "nano, 32 g", 4, 0.032, (1.6e-5, 1.6e-5, 2.9e-5), 0.046, 2e-8, 1.2e-10, 0.05, 0.02, (5.0, 5.0, 1.5), 0.5, 4.2, 1.0,
    bandwidth=8.0, integral=1.0,
)  # fmt: skip


class Body(NamedTuple):
    """What flies on one day."""

    mass: float
    inertia: Array
    centre: Array
    """Of mass, along x and y, m."""
    thrust: Array
    drag: Array
    """Factors of each rotor."""
    lag: float
    late: float
    """s."""
    air: float
    gusts: float
    """Next to those of the type."""
    wind: Array
    """Along x and y, m/s."""
    turn_bias: Array
    turn_gain: Array
    """Of the gyroscope."""
    felt_bias: Array
    """Of the accelerometer, m/s^2."""
    unbalance: Array
    """Of each rotor, kg m."""
    charge: float
    sag: float
    """Of the battery: voltage at rest and what a hover draws from it, shares of a full one."""


def vehicle_of(kind: Kind, rng: np.random.Generator) -> tuple[VehicleSettings, Body]:
    """Draw a vehicle and what its config says of it, which is off by what configs are off by."""
    body = Body(
        mass=kind.mass * rng.normal(1.0, 0.02),
        inertia=np.array(kind.inertia) * rng.normal(1.0, 0.08, 3),
        centre=rng.normal(0.0, 0.02, 2) * kind.arm,
        thrust=kind.thrust_factor * rng.normal(1.0, 0.03, kind.rotors),
        drag=kind.drag_factor * rng.normal(1.0, 0.05, kind.rotors),
        lag=kind.lag * rng.normal(1.0, 0.1),
        late=0.008 * rng.uniform(0.75, 1.25),
        air=kind.air * rng.lognormal(0.0, 0.2),
        gusts=1.0,
        wind=np.zeros(2),
        turn_bias=rng.normal(0.0, 0.005, 3),
        turn_gain=rng.normal(1.0, 0.01, 3),
        felt_bias=rng.normal(0.0, 0.1, 3),
        unbalance=kind.mass / kind.hover * rng.lognormal(0.0, 0.4, kind.rotors),
        charge=1.0,
        sag=0.08 * rng.lognormal(0.0, 0.2),
    )
    rotors = tuple(
        RotorSettings(
            position_m=(float(x), float(y), 0.0),
            spin=1 if spin > 0 else -1,
            thrust_factor_n_s2=kind.thrust_factor,
            drag_factor_n_m_s2=kind.drag_factor,
        )
        for (x, y), spin in zip(kind.places, kind.spins, strict=True)
    )
    vehicle = VehicleSettings(
        mass_kg=kind.mass, inertia_kg_m2=kind.inertia, rotors=rotors, rotor_speed_max_rad_s=10 * kind.hover**0.5
    )
    return vehicle, body


class Trim(NamedTuple):
    """What days differ by: standard deviations."""

    thrust: float
    """Of each rotor, a share."""
    centre: float
    """m."""


def day_of(kind: Kind, body: Body, trim: Trim, rng: np.random.Generator) -> Body:
    """Draw what a vehicle that nobody changed is on another day."""
    return body._replace(
        centre=body.centre + rng.normal(0.0, trim.centre, 2),
        thrust=body.thrust * rng.normal(1.0, trim.thrust, kind.rotors),
        drag=body.drag * rng.normal(1.0, trim.thrust, kind.rotors),
        gusts=body.gusts * rng.lognormal(0.0, 0.3),
        wind=body.wind + rng.normal(0.0, kind.wind, 2),
        turn_bias=body.turn_bias + rng.normal(0.0, 0.003, 3),
        felt_bias=body.felt_bias + rng.normal(0.0, 0.03, 3),
        unbalance=body.unbalance * rng.lognormal(0.0, 0.1, kind.rotors),
        charge=rng.uniform(0.92, 1.0),
        sag=body.sag * rng.normal(1.0, 0.05),
    )


def flown(kind: Kind, vehicle: VehicleSettings, body: Body, seed: list[int], pace: float = 1.0) -> dict[str, Signals]:
    """Fly once, legs in a time divided by the pace; give the flight with its commands alone, and with speeds too."""
    rng = np.random.default_rng(seed)
    samples = round((SECONDS + SETTLES_S) / STEP_S)
    # A battery that is loaded for each flight, in air that changes from flight to flight.
    body = body._replace(charge=body.charge - rng.uniform(0.0, 0.03), gusts=body.gusts * rng.lognormal(0.0, 0.1))
    gusts = body.gusts * np.array(kind.gusts)
    push = _remembered(rng, samples, MEMORY_S) * gusts
    shove = _remembered(rng, samples, np.ones(3)) * 0.06 * gusts.max()
    noise = 0.01 * rng.standard_normal((samples, 3))
    places = np.column_stack([kind.places - body.centre, np.full(kind.rotors, _HUB * kind.arm)])
    x, y = kind.places.T
    force = np.full(kind.rotors, kind.thrust_factor)
    unmix = np.linalg.pinv(np.array([force, force * y, -force * x, -kind.spins * kind.drag_factor]))
    log = _fly(
        *(legs(rng, samples, pace), push, shove, noise),
        *(body.mass, body.inertia, places, body.thrust, body.drag, kind.spins, body.lag, round(body.late / STEP_S)),
        *(body.air, body.wind, body.turn_bias, body.turn_gain, body.charge, body.sag, kind.by_voltage),
        *(kind.mass, np.array(kind.inertia), unmix, kind.hover, kind.bandwidth, kind.integral),
    )
    settled = log[round(SETTLES_S / STEP_S / EVERY) :]
    return dict(_logged(vehicle, body, places, settled, rng))


def _logged(
    vehicle: VehicleSettings, body: Body, places: Array, log: Array, rng: np.random.Generator
) -> list[tuple[str, Signals]]:
    """Log what was flown, with a vibration at the rotors' frequencies, after a rest on the ground."""
    felt, rate = log[:, 15:18], log[:, 18:21]
    attitude = euler_angles(log[:, 6:15].reshape(-1, 3, 3))
    speed, command, phase = np.split(log[:, 22:], 3, axis=1)
    force = body.unbalance * speed**2
    for index, (x, y, z) in enumerate(places):
        along, across = np.cos(phase[:, index]), np.sin(phase[:, index])
        felt[:, :2] += (force[:, index, None] / body.mass) * np.stack([along, across], axis=1)
        # Torque of that force, integrated over its turn.
        sway = np.stack([z * along, z * across, -x * along - y * across], axis=1)
        rate += (force[:, index] / speed[:, index])[:, None] * sway / body.inertia
    rate = body.turn_gain * rate + body.turn_bias + 0.01 * rng.standard_normal(rate.shape)
    felt = felt + body.felt_bias + 0.1 * rng.standard_normal(felt.shape)
    attitude = attitude + 0.002 * rng.standard_normal(attitude.shape)
    speed = speed * (1 + 0.003 * rng.standard_normal(speed.shape))
    rest = round(RESTS_S / STEP_S / EVERY)

    def after(values: Array, ground: object) -> Array:
        return np.concatenate([np.broadcast_to(np.asarray(ground), (rest, *values.shape[1:])), values])

    still = [0.0, 0.0, 0.0]
    common: dict[str, Any] = {
        "time": STEP_S * EVERY * np.arange(rest + len(log)),
        "vehicle": vehicle,
        "attitude": after(attitude, still),
        "body_rate": after(rate, body.turn_bias) + 0.0,
        "specific_force": after(felt, [0.0, 0.0, GRAVITY]),
        "voltage": after(log[:, 21], body.charge),
    }
    speeds, commands = after(speed, 0.0), after(command, 0.0)
    return [
        ("commands", Signals(**common, rotor_speed=commands, commanded=True, name="flight")),
        ("speeds", Signals(**common, rotor_speed=speeds, rotor_command=commands, name="flight")),
    ]


def legs(rng: np.random.Generator, samples: int, pace: float = 1.0) -> Array:
    """Draw position, velocity and acceleration of legs of least jerk between hovers, shape (samples, 9)."""
    time = STEP_S * np.arange(samples)
    path, place, start = np.zeros((samples, 9)), np.array([0.0, 0.0, 1.0]), 2.0
    path[:, :3] = place
    while start < time[-1]:
        goal = np.array([*rng.uniform(-0.8, 0.8, 2), 1.0 + rng.uniform(-0.2, 0.2)])
        lasts = rng.uniform(2.5, 3.5) / pace
        share = np.clip((time - start) / lasts, 0.0, 1.0)[:, None]
        step = goal - place
        path[:, :3] += step * share**3 * (10 - 15 * share + 6 * share**2)
        path[:, 3:6] += step * 30 * share**2 * (1 - share) ** 2 / lasts
        path[:, 6:] += step * 60 * share * (1 - share) * (1 - 2 * share) / lasts**2
        place, start = goal, start + lasts + rng.uniform(1.0, 2.5) / pace
    return path


def _remembered(rng: np.random.Generator, samples: int, memory_s: Array) -> Array:
    """Draw an Ornstein-Uhlenbeck process of unit size that has run for a while, shape (samples, 3)."""
    keep = np.exp(-STEP_S / memory_s)
    drawn = rng.standard_normal((samples, 3)) * np.sqrt(1 - keep**2)
    drawn[0] /= np.sqrt(1 - keep**2)
    return np.stack([lfilter([1.0], [1.0, -k], column) for k, column in zip(keep, drawn.T, strict=True)], axis=1)


@compiled
def _in_body(turn: Array, vector: Array) -> Array:
    return np.array([turn[0, a] * vector[0] + turn[1, a] * vector[1] + turn[2, a] * vector[2] for a in range(3)])


@compiled
def _in_world(turn: Array, vector: Array) -> Array:
    return np.array([turn[a, 0] * vector[0] + turn[a, 1] * vector[1] + turn[a, 2] * vector[2] for a in range(3)])


@compiled
def _cross(a: Array, b: Array) -> Array:
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


@compiled
def _turned(turn: Array, angle: Array) -> Array:
    """Turn about body axes by a small angle, to second order."""
    columns = np.zeros((3, 3))
    for row in range(3):
        across = _cross(turn[row], angle)
        columns[row] = turn[row] + across + 0.5 * _cross(across, angle)
    return columns


@compiled
def _fly(
    path: Array, push: Array, shove: Array, noise: Array,
    mass: float, inertia: Array, places: Array, thrust: Array, drag: Array, spins: Array, lag: float, late: int,
    air: float, wind: Array, turn_bias: Array, turn_gain: Array, charge: float, sag: float, by_voltage: float,
    known_mass: float, known_inertia: Array, unmix: Array, hover: float, bandwidth: float, integral: float,
) -> Array:  # fmt: skip
    """Integrate; each row logs position, velocity, rotation, felt force, rate, voltage, speeds, commands, phases."""
    rotors, samples = len(thrust), len(path)
    log = np.zeros(((samples + 4) // 5, 22 + 3 * rotors))
    position, velocity = path[0, :3].copy(), path[0, 3:6].copy()
    turn, rate, felt = np.eye(3), np.zeros(3), np.array([0.0, 0.0, 9.81])
    speed, phase, squared = np.full(rotors, hover**0.5), np.zeros(rotors), np.full(rotors, hover)
    asked = np.full((late + 1, rotors), hover)
    stiff, damped = bandwidth**2 * np.array([1.0, 1.0, 0.16]), 1.4 * bandwidth * np.array([1.0, 1.0, 0.4])
    wrench, summed, torque = np.zeros(4), np.zeros(3), np.zeros(3)
    for now in range(samples):
        voltage = charge - sag * ((speed**2 / hover) ** 1.5).sum() / rotors - 0.0005 * now * 2e-3
        measured = turn_gain * rate + turn_bias + noise[now]
        pull = 4.0 * (path[now, :3] - position) + 3.2 * (path[now, 3:6] - velocity)
        wanted = np.minimum(np.maximum(path[now, 6:9] + pull, -6.0), 6.0)
        wanted[2] += 9.81
        up = wanted / np.sqrt((wanted**2).sum())
        error = -_in_body(turn, _cross(up, turn[:, 2]))
        error[2] = -turn[1, 0]
        summed += integral * 2e-3 * error
        wrench[0] = known_mass * (wanted * turn[:, 2]).sum()
        wrench[1:] = known_inertia * (stiff * (error + summed) - damped * measured)
        for rotor in range(rotors):
            squared[rotor] = min(max((unmix[rotor] * wrench).sum(), 0.05 * hover), 4.0 * hover)
        if now % 5 == 0:
            row = log[now // 5]
            row[:3], row[3:6], row[15:18], row[18:21], row[21] = position, velocity, felt, rate, voltage
            for axis in range(3):
                row[6 + 3 * axis : 9 + 3 * axis] = turn[axis]
            row[22 : 22 + rotors], row[22 + rotors : 22 + 2 * rotors] = speed, np.sqrt(squared)
            row[22 + 2 * rotors :] = phase
        asked[now % (late + 1)] = squared
        pushed, torque[:] = 0.0, 0.0
        for rotor in range(rotors):
            arrived = asked[(now + 1) % (late + 1), rotor] * voltage**by_voltage
            before = speed[rotor]
            speed[rotor] += 2e-3 / lag * (np.sqrt(arrived) - before)
            mean = 0.5 * (before**2 + speed[rotor] ** 2)
            phase[rotor] += spins[rotor] * 2e-3 * 0.5 * (before + speed[rotor])
            lift = thrust[rotor] * mean
            pushed += lift
            torque[0] += places[rotor, 1] * lift
            torque[1] -= places[rotor, 0] * lift
            torque[2] -= spins[rotor] * drag[rotor] * mean
        spin_up = (torque - _cross(rate, inertia * rate)) / inertia + push[now]
        through = _in_body(turn, velocity - np.array([wind[0], wind[1], 0.0]))
        force = np.array([-air * through[0], -air * through[1], pushed]) / mass
        felt = force + _in_body(turn, shove[now])
        faster = _in_world(turn, felt)
        faster[2] -= 9.81
        position += 2e-3 * (velocity + 1e-3 * faster)
        velocity += 2e-3 * faster
        turn = _turned(turn, 2e-3 * (rate + 1e-3 * spin_up))
        rate += 2e-3 * spin_up
    return log
