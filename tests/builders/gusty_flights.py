"""Flights of a quadrotor under its autopilot in gusts, by dynamics of their own: nothing of the package flies them."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import butter, lfilter, sosfiltfilt

from cpfls_cli.compiling import compiled, part
from cpfls_cli.effects.signals import Signals
from cpfls_cli.identification.data import TorqueData
from cpfls_cli.playback.flight import LoggedFlight, MeasuredMotion, PlaybackFlight
from cpfls_cli.regressor.regressor import Motion
from cpfls_cli.rotations import attitude_acceleration, attitude_rate, euler_angles, generalised_torque
from cpfls_cli.vehicle.settings import VehicleSettings
from tests.builders.vehicles import alike

STEP_S, EVERY = 2e-3, 5
GRAVITY = 9.81
CALM, GUSTS, STORM = (0.0, 0.0, 0.0), (3.4, 5.1, 2.0), (8.0, 8.0, 4.0)
"""Angular acceleration by gusts, rad/s^2: none, what real flights of a nano-drone show, and twice that."""

MEMORY_S = np.array([0.31, 1.18, 0.5])
ONE, MIXED = ((1.0, 1.0),), ((0.3, 0.15), (0.4, 1.0), (0.3, 5.0))
"""Of the torque of gusts: shares of their variance, and factors on the memory of each."""
SPINS = np.array([-1, 1, -1, 1])


class Truth(NamedTuple):
    """What flies: rotors as an X, front right first, in SI."""

    mass: float
    inertia: tuple[float, float, float]
    arm: float
    thrust_factor: float
    drag_factor: float
    lag_s: float
    damping: float
    drag: float
    gyro_noise: float = 0.01
    speed_noise: float = 0.001
    rotor_drag: float = 0.0
    rotor_inertia: float = 0.0

    @property
    def places(self):
        """Hubs, shape (4, 2), m."""
        return self.arm / np.sqrt(2) * np.array([(1, -1), (-1, -1), (-1, 1), (1, 1)])

    @property
    def mixer(self):
        """Thrust and torque of unit squared speeds, shape (4, 4)."""
        x, y = self.places.T
        force = np.full(4, self.thrust_factor)
        return np.array([force, force * y, -force * x, -SPINS * self.drag_factor])

    @property
    def vehicle(self):
        """The same as a section `vehicle`."""
        places = [(*place, spin) for place, spin in zip(self.places.tolist(), SPINS.tolist(), strict=True)]
        rotors = alike(places, self.thrust_factor, self.drag_factor)
        inertia = (*self.inertia, 0.0, 0.0, 0.0)
        return VehicleSettings(mass_kg=self.mass, inertia_kg_m2=inertia, rotors=rotors, rotor_speed_max_rad_s=1e4)


SMALL = Truth(0.045, (3.7e-5, 4.2e-5, 6.6e-5), 0.046, 2.0e-8, 1.2e-10, 0.02, 3e-6, 0.02)
LARGE = Truth(1.5, (0.018, 0.02, 0.034), 0.17, 8.5e-6, 1.36e-7, 0.03, 3e-3, 0.3)


class Flight(NamedTuple):
    """What is flown: a vehicle in gusts on a path; each number of a path, and of a draw of gusts, is another one.

    A path has frequencies of 0.8 Hz at most, and if asked for a shake of its acceleration up to `reach`, and a heading
    that swings by about `swing` in rad. Of the rotors their speeds are logged, or the commands alone. Gusts have one
    memory, or several, and may be smoothed over some seconds.
    """

    truth: Truth
    gusts: tuple[float, float, float] = CALM
    path: int = 0
    draw: int = 0
    bandwidth: float = 12.0
    reach: float = 0.0
    swing: float = 0.0
    commands: bool = False
    memories: tuple[tuple[float, float], ...] = ONE
    smooth_s: float = 0.0


def gusty_flights(flights, seconds=30.0):
    """Fly all flights at once, as long as each other; the bandwidth of the attitude loop is in rad/s."""
    samples = round(seconds / STEP_S)
    rngs = [np.random.default_rng([flight.path, flight.draw]) for flight in flights]
    path = np.stack([path_of(flight, samples) for flight in flights], axis=1)
    pushes = [_pushes(rng, samples, flight) * flight.gusts for rng, flight in zip(rngs, flights, strict=True)]
    shoves = [memory(rng, samples, np.ones(3)) * 0.06 * max(f.gusts) for rng, f in zip(rngs, flights, strict=True)]
    noise = [f.truth.gyro_noise * rng.standard_normal((samples, 3)) for rng, f in zip(rngs, flights, strict=True)]
    logs = flown_along(flights, path, *(np.stack(each, axis=1) for each in (pushes, shoves, noise)))
    for number, (rng, flight) in enumerate(zip(rngs, flights, strict=True)):
        *motion, speed, command, up = (np.ascontiguousarray(log[:, number]) for log in logs)
        noisy = speed + flight.truth.speed_noise * speed.mean() * rng.standard_normal(speed.shape)
        yield PlaybackFlight(
            name=f"gusty-{number}",
            motion=MeasuredMotion(*motion, STEP_S * EVERY),
            speed=command if flight.commands else noisy,
            hold="linear",
            stretches=(slice(0, len(noisy)),),
            setpoints={
                "position": path[::EVERY, number, :3],
                "velocity": path[::EVERY, number, 3:6],
                "attitude": np.stack(
                    [-np.arcsin(up[:, 1]), np.arctan2(up[:, 0], up[:, 2]), path[::EVERY, number, 9]], axis=1
                ),
            },
        )


def _pushes(rng, samples, flight):
    """Draw gusts of unit size about the axes, shape (samples, 3)."""
    total = sum(np.sqrt(share) * memory(rng, samples, factor * MEMORY_S) for share, factor in flight.memories)
    if not flight.smooth_s:
        return total
    keep = np.exp(-STEP_S / flight.smooth_s)
    smooth = lfilter([1 - keep], [1, -keep], total, axis=0)
    return smooth / smooth.std(axis=0)


def memory(rng, samples, memory_s):
    """Draw an Ornstein-Uhlenbeck process of unit size, shape (samples, 3)."""
    keep = np.exp(-STEP_S / memory_s)
    drawn = rng.standard_normal((samples, 3)) * np.sqrt(1 - keep**2)
    return np.stack([lfilter([1.0], [1.0, -k], column) for k, column in zip(keep, drawn.T, strict=True)], axis=1)


def path_of(flight, samples):
    """Draw position, velocity, acceleration and heading that a flight is asked for, shape (samples, 10)."""
    return _path(flight.path, flight.reach, flight.swing, samples)


@lru_cache(8)
def _path(number, reach, swing, samples):
    rng = np.random.default_rng([1000, number])
    turns = 2 * np.pi * np.linspace(0.08, 0.8, 9)
    size = rng.uniform(0.5, 1.0, (3, 9)) * 0.035 / (turns / 2 / np.pi) ** 1.2 * np.array([[1.0], [1.0], [0.5]])
    path = _sines(rng, turns, size, samples)
    if reach:
        turns = 2 * np.pi * np.geomspace(0.8, reach, 25)
        path += _sines(rng, turns, 0.35 / turns**2 * np.ones((3, 1)), samples)
    heading = np.zeros((samples, 1))
    if swing:
        turns = 2 * np.pi * np.geomspace(0.1, 3.0, 12)
        size = swing / turns**0.5 * np.ones((1, 1))
        heading = _sines(np.random.default_rng([2000, number]), turns, size, samples)[:, :1]
    return np.hstack([path, heading])


def _sines(rng, turns, size, samples):
    """Add sines of random phases: value, first and second derivative, shape (samples, 9)."""
    waves = -1j * size * np.exp(1j * rng.uniform(0, 2 * np.pi, (len(size), len(turns))))
    waves = np.vstack([(1j * turns) ** power * waves for power in range(3)])
    # Products of blocks and steps: sines of each sample took nine tenths of the time of a flight.
    blocks, steps = (
        np.exp(1j * STEP_S * np.outer(each, turns)) for each in (np.arange(0, samples, 128), np.arange(128))
    )
    return ((waves * blocks[:, None]) @ steps.T).real.swapaxes(1, 2).reshape(-1, len(waves))[:samples]


def flown_along(flights, path, pushes, shoves, noise):
    """Integrate each flight; give motion with the measured rate, speed, command and wanted up, flights second."""
    # Of each flight without gaps, so that one form of the loop is compiled.
    logs = np.empty((len(flights), -(-len(path) // EVERY), 29))
    for number, (truth, *_, bandwidth) in enumerate(flight[:5] for flight in flights):
        hover, outer = truth.mass * GRAVITY / 4 / truth.thrust_factor, min(2.0, bandwidth / 6)
        of_rotors = truth.rotor_drag, truth.rotor_inertia
        body = np.array([truth.mass, truth.lag_s, truth.damping, truth.drag, *truth.inertia, *of_rotors])
        pilot = np.array([outer**2, 1.6 * outer, 0.05 * hover, 4 * hover, *(bandwidth * np.array([1.0, 1.0, 0.4]))])
        result = (np.ascontiguousarray(each[:, number]) for each in (path, pushes, shoves, noise))
        _integrated(body, pilot, truth.mixer, np.linalg.inv(truth.mixer), hover**0.5, *result, logs[number])
    parts = np.split(logs.swapaxes(0, 1), [3, 6, 15, 18, 22, 26], axis=2)
    return [part.reshape(*part.shape[:2], 3, 3) if part.shape[2] == 9 else part for part in parts]


# Loops over numbers: they compile in a third of the time that arithmetic of arrays takes.
@compiled
def _integrated(body, pilot, mixer, unmix, hover, path, pushes, shoves, noise, logs):
    """Fly one flight into its log."""
    position, velocity, turn = path[0, :3].copy(), path[0, 3:6].copy(), np.eye(3)
    rate, measured, wanted, wrench = np.zeros(3), np.empty(3), np.empty(3), np.empty(4)
    speed, command, squared, hubs = np.full(4, hover), np.empty(4), np.empty(4), np.empty(4)
    faster = np.empty(4)
    for now in range(len(path)):
        for axis in range(3):
            measured[axis] = rate[axis] + noise[now, axis]
        _ask(body, pilot, path[now], position, velocity, turn, measured, wanted, wrench)
        for rotor in range(4):
            square = 0.0
            for row in range(4):
                square += unmix[rotor, row] * wrench[row]
            command[rotor] = np.sqrt(min(max(square, pilot[2]), pilot[3]))
        if now % EVERY == 0:
            _write(logs[now // EVERY], position, velocity, turn, measured, speed, command, wanted)
        for rotor in range(4):
            before = speed[rotor]
            speed[rotor] += STEP_S / body[1] * (command[rotor] - before)
            squared[rotor] = 0.5 * (before**2 + speed[rotor] ** 2)
            faster[rotor] = (speed[rotor] - before) / STEP_S
        for row in range(4):
            wrench[row] = 0.0
            for rotor in range(4):
                wrench[row] += mixer[row, rotor] * squared[rotor]
        for rotor in range(4):
            wrench[3] += np.sign(mixer[3, rotor]) * body[8] * faster[rotor]
        _hubs(body, mixer, squared, hubs)
        _move(body, wrench, hubs, pushes[now], shoves[now], position, velocity, turn, rate)


@part
def _ask(body, pilot, path, position, velocity, turn, measured, up, wrench):
    """Ask for the direction of the thrust, and for thrust and torque."""
    for axis in range(3):
        pull = path[6 + axis] + pilot[0] * (path[axis] - position[axis])
        up[axis] = min(max(pull + pilot[1] * (path[3 + axis] - velocity[axis]), -6.0), 6.0)
    up[2] += GRAVITY
    wrench[0] = body[0] * (up[0] * turn[0, 2] + up[1] * turn[1, 2] + up[2] * turn[2, 2])
    length = np.sqrt(up[0] ** 2 + up[1] ** 2 + up[2] ** 2)
    for axis in range(3):
        up[axis] /= length
    # The heading is asked for by itself, so the vehicle leans about an axis of the level plane.
    lean = np.empty(3)
    _cross(up, turn[:, 2], lean)
    for axis in range(3):
        error = -(turn[0, axis] * lean[0] + turn[1, axis] * lean[1] + turn[2, axis] * lean[2])
        if axis == 2:
            error = np.sin(path[9]) * turn[0, 0] - np.cos(path[9]) * turn[1, 0]
        loop = pilot[4 + axis]
        wrench[1 + axis] = body[4 + axis] * (loop**2 * error - 1.4 * loop * measured[axis])


@part
def _hubs(body, mixer, squared, hubs):
    """Sum what hubs drag in proportion to the speed of their rotors: alone, times x, times y, times x^2 + y^2."""
    hubs[:] = 0.0
    for rotor in range(4):
        x, y = -mixer[2, rotor] / mixer[0, rotor], mixer[1, rotor] / mixer[0, rotor]
        drag = body[7] * np.sqrt(squared[rotor])
        hubs[0] += drag
        hubs[1] += drag * x
        hubs[2] += drag * y
        hubs[3] += drag * (x**2 + y**2)


@part
def _move(body, wrench, hubs, push, shove, position, velocity, turn, rate):
    """Take one step; force and air are those in the middle of it."""
    mass, damping, drag = body[0], body[2], body[3]
    midway, once, twice, spun, air = np.empty((3, 3)), np.empty(3), np.empty(3), np.empty(3), np.empty(2)
    for row in range(3):
        _cross(turn[row], rate, midway[row])
        for axis in range(3):
            midway[row, axis] = turn[row, axis] + 0.5 * STEP_S * midway[row, axis]
    for axis in range(3):
        force = midway[axis, 2] * wrench[0]
        for level in range(2):
            air[level] = (
                midway[0, level] * velocity[0] + midway[1, level] * velocity[1] + midway[2, level] * velocity[2]
            )
            force -= midway[axis, level] * drag * air[level]
            force -= midway[axis, level] * (hubs[0] * air[level] + rate[2] * (hubs[1] if level else -hubs[2]))
        once[axis] = force / mass + shove[axis]
    once[2] -= GRAVITY
    for axis in range(3):
        position[axis] += STEP_S * (velocity[axis] + 0.5 * STEP_S * once[axis])
        velocity[axis] += STEP_S * once[axis]
        one, other = (axis + 1) % 3, (axis + 2) % 3
        gyroscopic = (body[4 + other] - body[4 + one]) * rate[one] * rate[other]
        own = hubs[1] * air[1] - hubs[2] * air[0] + hubs[3] * rate[2] if axis == 2 else 0.0
        spun[axis] = (wrench[1 + axis] - damping * rate[axis] - own - gyroscopic) / body[4 + axis] + push[axis]
    for axis in range(3):
        begun = rate[axis]
        rate[axis] += STEP_S * spun[axis]
        spun[axis] = STEP_S * (begun + 0.5 * STEP_S * spun[axis])
    for row in range(3):
        _cross(turn[row], spun, once)
        _cross(once, spun, twice)
        for axis in range(3):
            turn[row, axis] += once[axis] + 0.5 * twice[axis]
        _cross(twice, spun, once)
        for axis in range(3):
            turn[row, axis] += once[axis] / 6


@part
def _cross(left, right, product):
    for axis in range(3):
        one, other = (axis + 1) % 3, (axis + 2) % 3
        product[axis] = left[one] * right[other] - left[other] * right[one]


@part
def _write(log, position, velocity, turn, measured, speed, command, up):
    for axis in range(3):
        log[axis], log[3 + axis], log[15 + axis], log[26 + axis] = (
            position[axis],
            velocity[axis],
            measured[axis],
            up[axis],
        )
        for column in range(3):
            log[6 + 3 * axis + column] = turn[axis, column]
    for rotor in range(4):
        log[18 + rotor], log[22 + rotor] = speed[rotor], command[rotor]


def logged(flight, vehicle, *, commanded=False):
    """Give a flight as one that was read, of a vehicle that a config states; of the rotors commands alone are known."""
    motion, samples = flight.motion, len(flight)
    signals = Signals(
        time=motion.period * np.arange(samples),
        body_rate=motion.rate,
        vehicle=vehicle,
        name=flight.name,
        attitude=euler_angles(motion.rotation),
        velocity=motion.velocity,
        position=motion.position,
        rotor_speed=flight.speed,
        commanded=commanded,
        setpoints=flight.setpoints,
    )
    return LoggedFlight((signals,), flight.hold, "measured rotor speeds", ())


def torque_samples(flight, truth, lowpass_hz=12.0, *, asked=False):
    """Give the torque of a flight's rotors and the motion that was measured, both behind one low-pass.

    If asked for, with its setpoints.
    """
    motion = flight.motion
    filtered = butter(2, lowpass_hz, output="sos", fs=1 / motion.period)
    rate, torque = (
        sosfiltfilt(filtered, values, axis=0) for values in (motion.rate, flight.speed**2 @ truth.mixer[1:].T)
    )
    attitude, time = euler_angles(motion.rotation), motion.period * np.arange(len(flight))
    of_angles = (
        attitude_rate(attitude, rate),
        attitude_acceleration(attitude, rate, CubicSpline(time, rate).derivative()(time)),
    )
    setpoints = flight.setpoints if asked else {}
    return TorqueData(time, Motion(attitude, *of_angles), generalised_torque(attitude, torque), setpoints)
