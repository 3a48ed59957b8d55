"""Flights of a quadrotor under its autopilot in gusts, by dynamics of their own: nothing of the package flies them."""

from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import butter, lfilter, sosfiltfilt

from cpfls_cli.effects.signals import Signals
from cpfls_cli.identification.data import TorqueData
from cpfls_cli.playback.flight import LoggedFlight, PlaybackFlight
from cpfls_cli.playback.kernels import MeasuredMotion
from cpfls_cli.regressor.motion import Motion
from cpfls_cli.rotations import attitude_acceleration, attitude_rate, euler_angles, generalised_torque
from cpfls_cli.vehicle.settings import RotorSettings, VehicleSettings

STEP_S, EVERY = 2e-3, 5
GRAVITY, UP = 9.81, np.array([0.0, 0.0, 9.81])
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
        rotors = tuple(
            RotorSettings(
                position_m=(float(x), float(y), 0.0),
                spin=int(spin),
                thrust_factor_n_s2=self.thrust_factor,
                drag_factor_n_m_s2=self.drag_factor,
            )
            for (x, y), spin in zip(self.places, SPINS, strict=True)
        )
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
    shoves = [_memory(rng, samples, np.ones(3)) * 0.06 * max(f.gusts) for rng, f in zip(rngs, flights, strict=True)]
    noise = [f.truth.gyro_noise * rng.standard_normal((samples, 3)) for rng, f in zip(rngs, flights, strict=True)]
    logs = _flown(flights, path, *(np.stack(each, axis=1) for each in (pushes, shoves, noise)))
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
    total = sum(np.sqrt(share) * _memory(rng, samples, factor * MEMORY_S) for share, factor in flight.memories)
    if not flight.smooth_s:
        return total
    keep = np.exp(-STEP_S / flight.smooth_s)
    smooth = lfilter([1 - keep], [1, -keep], total, axis=0)
    return smooth / smooth.std(axis=0)


def _memory(rng, samples, memory_s):
    """Draw an Ornstein-Uhlenbeck process of unit size, shape (samples, 3)."""
    keep = np.exp(-STEP_S / memory_s)
    drawn = rng.standard_normal((samples, 3)) * np.sqrt(1 - keep**2)
    return np.stack([lfilter([1.0], [1.0, -k], column) for k, column in zip(keep, drawn.T, strict=True)], axis=1)


def path_of(flight, samples):
    """Draw position, velocity, acceleration and heading that a flight is asked for, shape (samples, 10)."""
    rng = np.random.default_rng([1000, flight.path])
    turns = 2 * np.pi * np.linspace(0.08, 0.8, 9)
    size = rng.uniform(0.5, 1.0, (3, 9)) * 0.035 / (turns / 2 / np.pi) ** 1.2 * np.array([[1.0], [1.0], [0.5]])
    path = _sines(rng, turns, size, samples)
    if flight.reach:
        turns = 2 * np.pi * np.geomspace(0.8, flight.reach, 25)
        path += _sines(rng, turns, 0.35 / turns**2 * np.ones((3, 1)), samples)
    heading = np.zeros((samples, 1))
    if flight.swing:
        turns = 2 * np.pi * np.geomspace(0.1, 3.0, 12)
        size = flight.swing / turns**0.5 * np.ones((1, 1))
        heading = _sines(np.random.default_rng([2000, flight.path]), turns, size, samples)[:, :1]
    return np.hstack([path, heading])


def _sines(rng, turns, size, samples):
    """Add sines of random phases: value, first and second derivative, shape (samples, 9)."""
    phase = np.arange(samples)[:, None, None] * STEP_S * turns + rng.uniform(0, 2 * np.pi, (len(size), len(turns)))
    sine, cosine = size * np.sin(phase), size * np.cos(phase)
    return np.hstack([sine.sum(axis=2), (turns * cosine).sum(axis=2), -(turns**2 * sine).sum(axis=2)])


_CROSS = np.array([[0, 0, 0, 0, 0, -1, 0, 1, 0], [0, 0, 1, 0, 0, 0, -1, 0, 0], [0, -1, 0, 1, 0, 0, 0, 0, 0]], float)
_ONE, _LEVEL, _ALONG_Z = np.eye(3), np.array([1.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])


def _skew(vector):
    """Arrange vectors as matrices of the cross product, shape (flights, 3, 3)."""
    return (vector @ _CROSS).reshape(-1, 3, 3)


def _clipped(values, low, high):
    """Limit values as `numpy.clip` does, which takes longer to begin than to end."""
    return np.minimum(np.maximum(values, low), high)


def _flown(flights, path, pushes, shoves, noise):
    """Integrate all flights side by side; give motion with the measured rate, speed, command and wanted up."""
    truths, bandwidth = [flight.truth for flight in flights], np.array([[flight.bandwidth] for flight in flights])
    mass, lag, damping, drag = (
        np.array([[getattr(truth, name)] for truth in truths]) for name in ("mass", "lag_s", "damping", "drag")
    )
    inertia, mixer = np.array([truth.inertia for truth in truths]), np.array([truth.mixer for truth in truths])
    unmix, hover = np.linalg.inv(mixer), np.array([[t.mass * GRAVITY / 4 / t.thrust_factor] for t in truths])
    outer, loop = np.minimum(2.0, bandwidth / 6), bandwidth * np.array([1.0, 1.0, 0.4])
    near, follow, stiff, damped = outer**2, 1.6 * outer, loop**2, 1.4 * loop
    least, most, towards = 0.05 * hover, 4 * hover, STEP_S / lag
    position, velocity = path[0, :, :3], path[0, :, 3:6]
    turn, rate, speed = np.tile(np.eye(3), (len(flights), 1, 1)), np.zeros_like(position), np.tile(np.sqrt(hover), 4)
    logs = []
    for now in range(len(path)):
        measured = rate + noise[now]
        wanted = path[now, :, 6:9] + near * (path[now, :, :3] - position)
        wanted = _clipped(wanted + follow * (path[now, :, 3:6] - velocity), -6.0, 6.0) + UP
        up = wanted / np.sqrt((wanted**2).sum(axis=1, keepdims=True))
        # The heading is asked for by itself, so the vehicle leans about an axis of the level plane.
        lean = _skew(up) @ turn[:, :, 2, None]
        error = -(turn.transpose(0, 2, 1) @ lean)[:, :, 0]
        error[:, 2] = np.sin(path[now, :, 9]) * turn[:, 0, 0] - np.cos(path[now, :, 9]) * turn[:, 1, 0]
        torque = inertia * (stiff * error - damped * measured)
        thrust = mass * (wanted * turn[:, :, 2]).sum(axis=1, keepdims=True)
        squared = (unmix @ np.concatenate([thrust, torque], axis=1)[:, :, None])[:, :, 0]
        command = np.sqrt(_clipped(squared, least, most))
        if now % EVERY == 0:
            logs.append([position, velocity, turn, measured, speed, command, up])
        before, speed = speed, speed + towards * (command - speed)
        wrench = (mixer @ (0.5 * (before**2 + speed**2))[:, :, None])[:, :, 0]
        across = _skew(rate)
        gyroscopic = (across @ (inertia * rate)[:, :, None])[:, :, 0]
        spin_up = (wrench[:, 1:] - damping * rate - gyroscopic) / inertia + pushes[now]
        # In the middle of the step, as all that turns and pushes is.
        midway = turn @ (_ONE + 0.5 * STEP_S * across)
        force = -drag * (velocity[:, None] @ midway)[:, 0] * _LEVEL + wrench[:, :1] * _ALONG_Z
        faster = (midway @ force[:, :, None])[:, :, 0] / mass + shoves[now] - UP
        position, velocity = position + STEP_S * (velocity + 0.5 * STEP_S * faster), velocity + STEP_S * faster
        angle = STEP_S * (rate + 0.5 * STEP_S * spin_up)
        small = _skew(angle)
        twice = small @ small
        turn = turn @ (_ONE + small + 0.5 * twice + twice @ small / 6)
        rate = rate + STEP_S * spin_up
    return [np.array(each) for each in zip(*logs, strict=True)]


def logged(flight, vehicle, *, commanded=False):
    """Give a flight as one that was read, of a vehicle that a config states; of the rotors commands alone are known."""
    motion, samples = flight.motion, len(flight)
    signals = Signals(
        time=motion.period * np.arange(samples),
        body_rate=motion.rate,
        vehicle=vehicle,
        attitude=euler_angles(motion.rotation),
        velocity=motion.velocity,
        position=motion.position,
        rotor_speed=flight.speed,
        commanded=commanded,
        setpoints=flight.setpoints,
    )
    return LoggedFlight(flight.name, (signals,), flight.hold, "measured rotor speeds", ())


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
