"""Vehicles as their makers describe them: what the controller and the judged model believe."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

GRAVITY = 9.81
AIR_DENSITY = 1.225


@dataclass(frozen=True)
class Vehicle:
    """A multirotor: SI units, body frame x forward, y left, z up; rotor positions relative to the centre of mass.

    ``shares`` scales the thrust factor of each rotor: a rotor in the wake of another one pulls less.
    """

    name: str
    mass: float
    inertia: tuple[float, float, float]
    rotors: tuple[tuple[float, float, float], ...]
    spin: tuple[int, ...]
    thrust_factor: float
    torque_factor: float
    rotor_radius: float
    shares: tuple[float, ...] = ()

    @property
    def hubs(self):
        """Array, shape (3, rotor), m."""
        return np.array(self.rotors, dtype=float).T

    @property
    def count(self):
        """Number of rotors."""
        return len(self.spin)

    @property
    def thrust_factors(self):
        """Thrust over squared speed of each rotor, N s^2."""
        return self.thrust_factor * np.array(self.shares or (1.0,) * self.count)

    @property
    def height(self):
        """Mean height of the hubs, m."""
        return float(self.hubs[2].mean())

    @property
    def arm(self):
        """Distance of a hub from the yaw axis, m."""
        return float(np.hypot(*self.hubs[:2, 0]))

    @property
    def weight(self):
        """Weight, N."""
        return self.mass * GRAVITY

    @property
    def hover_speed(self):
        """Rotor speed that carries the weight, rad/s."""
        return float(np.sqrt(self.mass * GRAVITY / self.thrust_factors.sum()))

    @property
    def induced_speed(self):
        """Air speed through a hovering rotor by momentum theory, m/s."""
        disc = np.pi * self.rotor_radius**2
        return float(np.sqrt(self.mass * GRAVITY / self.count / (2 * AIR_DENSITY * disc)))

    def allocation(self):
        """Map squared rotor speeds to thrust and body torque, shape (4, rotor)."""
        x, y, _ = self.hubs
        k, b = self.thrust_factors, self.torque_factor
        return np.array([k, k * y, -k * x, -b * np.array(self.spin, dtype=float)])

    def as_dict(self):
        """Give plain numbers for a file."""
        return asdict(self) | {"gravity": GRAVITY, "thrust_factors": self.thrust_factors.tolist()}


def plus(arm, height):
    """Place four hubs ahead, right, behind and left."""
    return ((arm, 0.0, height), (0.0, -arm, height), (-arm, 0.0, height), (0.0, arm, height))


def cross(half, height):
    """Place four hubs on the corners of a square: front left, front right, rear right, rear left."""
    return ((half, half, height), (half, -half, height), (-half, -half, height), (-half, half, height))


def ring(arm, height, count):
    """Place hubs evenly on a circle, the first half a step left of ahead."""
    angle = 2 * np.pi * (np.arange(count) + 0.5) / count
    return tuple((arm * float(np.cos(a)), arm * float(np.sin(a)), height) for a in angle)


SIXKG = Vehicle("sixkg", 6.0, (0.6, 0.6, 1.2), plus(0.3, 0.05), (1, -1, 1, -1), 121.5e-6, 2.7e-6, 0.20)
HUMMINGBIRD = Vehicle(
    "hummingbird", 0.5, (0.00365, 0.00368, 0.00703), cross(0.1202081528, 0.0), (-1, 1, -1, 1), 5.57e-6, 1.36e-7, 0.10
)
CRAZYFLIE = Vehicle(
    "crazyflie", 0.03, (1.43e-5, 1.43e-5, 2.89e-5), cross(0.0304, 0.008), (1, -1, 1, -1), 2.3e-8, 7.8e-10, 0.0231
)
XQUAD = Vehicle("xquad", 1.5, (0.0135, 0.0148, 0.0250), cross(0.159, 0.03), (-1, 1, -1, 1), 1.02e-5, 1.7e-7, 0.12)
HEXAROTOR = Vehicle(
    "hexarotor", 2.5, (0.034, 0.036, 0.061), ring(0.275, 0.03, 6), (1, -1, 1, -1, 1, -1), 1.1e-5, 1.9e-7, 0.127
)
COAXIAL = Vehicle(
    "coaxial", 4.0, (0.060, 0.066, 0.105), (*cross(0.2, 0.05), *cross(0.2, -0.02)),
    (-1, 1, -1, 1, 1, -1, 1, -1), 1.4e-5, 2.6e-7, 0.14, (1.0,) * 4 + (0.85,) * 4,
)  # fmt: skip
_PER_RPM = 60 / (2 * np.pi)
CF2X = Vehicle(
    "cf2x", 0.027, (1.4e-5, 1.4e-5, 2.17e-5), cross(0.0397 / np.sqrt(2), 0.0), (-1, 1, -1, 1),
    3.16e-10 * _PER_RPM**2, 7.94e-12 * _PER_RPM**2, 2.31348e-2,
)  # fmt: skip
"""The Crazyflie 2.x of gym-pybullet-drones, whose factors are per squared revolutions per minute."""

STUDIED = {vehicle.name: vehicle for vehicle in (SIXKG, HUMMINGBIRD, CRAZYFLIE, XQUAD, HEXAROTOR, COAXIAL)}
VEHICLES = STUDIED | {CF2X.name: CF2X}
