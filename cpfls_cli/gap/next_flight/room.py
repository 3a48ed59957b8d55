"""What a path may use of space and of the vehicle, and paths that use it up."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import null_space
from scipy.optimize import brentq

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.errors import ComputationError, SettingError
from cpfls_cli.rounding import ROUNDING, at_most
from cpfls_cli.simulation.inverse import ROTOR_SHARE, hover_squared, rotor_load
from cpfls_cli.trajectory.planning import Trajectory, along, sample_times
from cpfls_cli.trajectory.profile import LIMIT_NAMES
from cpfls_cli.trajectory.settings import TrajectorySettings
from cpfls_cli.vehicle.settings import VehicleSettings

_SLOPES = (0.5, 3.5)  # Powers of the frequency by which amplitudes fall: from shaking to drifting.


@dataclass(frozen=True)
class HarmonicPath:
    """Position and yaw over a duration, ``centre + sum_k cosine_k cos(w_k t) + sine_k sin(w_k t)``."""

    centre: Array  # Shape (4,), m and rad.
    order: IntArray  # Shape (4, harmonic): periods in the duration.
    cosine: Array  # Shape (4, harmonic), m and rad.
    sine: Array  # The same.
    duration: float  # S.

    def sample(self, time: Array) -> Array:
        """Evaluate position and yaw with six derivatives, shape (7, time, 4), m, rad and s.

        `time`: shape (time,), s.
        """
        frequency = 2 * np.pi / self.duration * self.order
        phase = np.multiply.outer(time, frequency).transpose(1, 0, 2)
        # Each derivative turns by a quarter of a period: cos -> -sin -> -cos -> sin.
        turns = (
            (self.cosine, self.sine),
            (self.sine, -self.cosine),
            (-self.cosine, -self.sine),
            (-self.sine, self.cosine),
        )
        sizes = [np.array(turns[power % len(turns)]) * frequency**power for power in range(1 + len(LIMIT_NAMES))]
        of_cosine, of_sine = np.stack(sizes, axis=-1)
        values = (np.cos(phase) @ of_cosine + np.sin(phase) @ of_sine).transpose(2, 1, 0)
        values[0] += self.centre
        return np.ascontiguousarray(values)

    def scaled(self, factor: float | Array) -> HarmonicPath:
        """Scale the path about the origin."""
        by_axis = np.broadcast_to(factor, (4,))[:, None]
        return replace(self, centre=self.centre * factor, cosine=self.cosine * by_axis, sine=self.sine * by_axis)

    def resting(self) -> HarmonicPath:
        """Take off what would leave velocity, acceleration, jerk, snap and the turning of yaw at the ends."""
        cosine, sine = np.empty_like(self.cosine), np.empty_like(self.sine)
        # With the snap the angular acceleration vanishes.
        highest = 1 + LIMIT_NAMES.index("snap")
        for axis, order in enumerate(self.order):
            scaled = order / order.max()
            for values, kept, first in ((self.cosine, cosine, 2), (self.sine, sine, 1)):
                space = null_space(np.stack([scaled**power for power in range(first, highest + 1, 2)]))
                kept[axis] = space @ (space.T @ values[axis])
        return replace(self, cosine=cosine, sine=sine)


def random_path(duration: float, frequency_max: float, harmonics: int, rng: np.random.Generator) -> HarmonicPath:
    """Draw a path of about unit size on each axis, about the origin.

    `duration`: s; `frequency_max`: Hz; `harmonics`: of each axis, fewer where the duration has no room for them.
    """
    highest = max(int(frequency_max * duration + 1e-9), 1)
    count = min(harmonics, highest)
    chances = 1.0 / np.arange(1, highest + 1)
    chances /= chances.sum()
    order = np.array([np.sort(rng.choice(highest, count, replace=False, p=chances)) + 1 for _ in range(4)])
    weight = order ** -rng.uniform(*_SLOPES, 4)[:, None]
    cosine, sine = weight * rng.standard_normal((2, 4, count))
    return HarmonicPath(np.zeros(4), order, cosine, sine, duration).resting()


def harmonic_trajectory(path: HarmonicPath, sample_time: float, gravity: float) -> Trajectory:
    """Sample a path with the attitude that flies it.

    `sample_time`: s.
    `gravity`: m/s^2.
    Raises ComputationError if the path asks for free fall, where the attitude is not defined.
    """
    time = sample_times(path.duration, sample_time)
    motion = path.sample(time)
    position, heading = motion[..., :3], motion[:3, :, 3]
    lengths = np.linalg.norm(np.concatenate([(position[0] - position[0, 0])[None], position[1:]]), axis=2).max(axis=1)
    maxima = dict(zip(("displacement", *LIMIT_NAMES), lengths.tolist(), strict=True))
    return Trajectory(
        duration=path.duration, legs=(), maxima=maxima, runs=(), **along(time, position, heading, gravity)
    )


TILT_MAX = np.radians(35.0)  # Largest tilt where the settings leave it open.
_HARMONICS = 10  # Waves of an axis, as many as a person could still fly.


@dataclass(frozen=True)
class Room:
    """Space, limits and rotors that a path may use."""

    half: Array  # Shape (3,), m: half of the box, less the vehicle's own size.
    middle: Array  # Shape (3,), m, world frame.
    settings: TrajectorySettings  # Limits, tilt and duration.
    vehicle: VehicleSettings
    period: float  # Between the samples that are looked at, s.

    def planned(self, path: HarmonicPath, period: float | None = None) -> Trajectory:
        """Sample a path, about the middle of the room."""
        there = replace(path, centre=path.centre + np.append(self.middle, 0.0))
        return harmonic_trajectory(there, period or self.period, self.vehicle.gravity_m_s2)

    def drawn(self, rng: np.random.Generator) -> HarmonicPath:
        """Draw a path that reaches a limit, each axis with a random share of what it can do alone."""
        settings = self.settings
        assert settings.duration_s is not None, "settings of this path have a duration"
        path = random_path(settings.duration_s, settings.next_flight.frequency_max_hz, _HARMONICS, rng)
        share, alone = rng.random(4), [self.fitted(path.scaled(own)) for own in np.eye(4)]
        cosine, sine = (
            np.stack([getattr(own, name)[axis] for axis, own in enumerate(alone)]) for name in ("cosine", "sine")
        )
        return self.fitted(replace(path, cosine=cosine, sine=sine).scaled(share))

    def fitted(self, path: HarmonicPath) -> HarmonicPath:
        """Scale a path until it reaches a limit, and put its middle into that of the room; it starts at yaw 0."""
        at = path.sample(np.arange(0.0, path.duration, self.period))[0]
        low, high = at.min(axis=0), at.max(axis=0)
        reach = np.maximum(0.5 * (high - low), 1e-12)
        centred = replace(path, centre=path.centre - np.array([*0.5 * (high + low)[:3], at[0, 3]]))
        # Half of a turn to either side shows every heading.
        largest = centred.scaled(float((np.array([*self.half, np.pi]) / reach).min()))
        return largest.scaled(self._share(largest))

    def _share(self, path: HarmonicPath) -> float:
        """Find the largest share of a path that keeps the limits on motion and rotors."""

        def beyond(share: float) -> float:
            # Free fall is infinitely far beyond.
            return min(self.share_of_limits(path.scaled(share)), 1.0 / ROUNDING) - 1.0

        return 1.0 if at_most(beyond(1.0), 0.0, 1.0) else float(brentq(beyond, 0.0, 1.0))

    def share_of_limits(self, path: HarmonicPath) -> float:
        """Compute the largest share of any limit on motion, tilt and rotors that a path takes."""
        try:
            planned = self.planned(path)
        except ComputationError:
            return np.inf
        signals = vars(planned)
        shares = []
        for key, limit in self.settings.limits.given.items():
            values = signals[key.split("_", 1)[0]]
            # Three limits hold by component, one holds along the path.
            taken = (
                np.abs(values / np.array(limit)) if isinstance(limit, tuple) else np.linalg.norm(values, axis=1) / limit
            )
            shares.append(float(taken.max()))
        tilt = np.arccos(np.clip(np.prod(np.cos(planned.attitude[:, :2]), axis=1), -1, 1)).max()
        shares.append(float(tilt) / (self.settings.tilt_max_rad or TILT_MAX))
        rotors = rotor_load(signals, self.vehicle)
        return max(*shares, rotors.fast, rotors.slow)


def room_of(settings: TrajectorySettings, vehicle: VehicleSettings, ground: float, period: float) -> Room:
    """Find the room that a vehicle has.

    `ground`: height of the ground, m.
    `period`: between the samples that are looked at, s.
    Raises SettingError if the vehicle does not fit into the box, or the box reaches into the ground.
    """
    asked = settings.next_flight
    size = 2 * max(float(np.hypot(*rotor.position_m[:2])) + (rotor.radius_m or 0.0) for rotor in vehicle.rotors)
    box = np.array(asked.box_m)
    half = 0.5 * (box - [size, size, 0.0])
    if (half[:2] <= 0).any():
        given = " ".join(f"{side:g}" for side in asked.box_m)
        message = f"is {given}, but the vehicle is {size:.3g} m across; give a box that it can move in"
        raise SettingError("next_flight.box_m", message)
    if asked.height_m < 0.5 * box[2]:
        message = (
            f"is {asked.height_m:g}, but the box around it, {box[2]:g} m high, would reach into the ground; raise it "
            f"to {0.5 * box[2]:g} or more, or lower next_flight.box_m"
        )
        raise SettingError("next_flight.height_m", message)
    hover = hover_squared(vehicle)
    most = ROTOR_SHARE * vehicle.rotor_speed_max_rad_s**2
    if (hover >= most).any():
        raise ComputationError(
            f"vehicle.rotor_speed_max_rad_s = {vehicle.rotor_speed_max_rad_s:g}: hovering takes "
            f"{np.sqrt(hover.max()):.4g} rad/s, which leaves the rotors no room to move the vehicle; check mass, "
            "thrust factors and the largest rotor speed"
        )
    return Room(half, np.array([0.0, 0.0, ground + asked.height_m]), settings, vehicle, period)
