"""Four quadrotors as their makers describe them: what the controller and the judged model believe."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

GRAVITY = 9.81
AIR_DENSITY = 1.225


@dataclass(frozen=True)
class Vehicle:
    """A quadrotor: SI units, body frame x forward, y left, z up; rotor positions relative to the centre of mass."""

    name: str
    mass: float
    inertia: tuple[float, float, float]
    rotors: tuple[tuple[float, float, float], ...]
    spin: tuple[int, int, int, int]
    thrust_factor: float
    torque_factor: float
    rotor_radius: float

    @property
    def hubs(self):
        """Array, shape (3, 4), m."""
        return np.array(self.rotors, dtype=float).T

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
        return float(np.sqrt(self.mass * GRAVITY / (4 * self.thrust_factor)))

    @property
    def induced_speed(self):
        """Air speed through a hovering rotor by momentum theory, m/s."""
        disc = np.pi * self.rotor_radius**2
        return float(np.sqrt(self.mass * GRAVITY / 4 / (2 * AIR_DENSITY * disc)))

    def allocation(self):
        """Map squared rotor speeds to thrust and body torque, shape (4, 4)."""
        x, y, _ = self.hubs
        k, b = self.thrust_factor, self.torque_factor
        return np.array([k * np.ones(4), k * y, -k * x, -b * np.array(self.spin, dtype=float)])

    def as_dict(self):
        """Give plain numbers for a file."""
        return asdict(self) | {"gravity": GRAVITY}


def plus(arm, height):
    """Place four hubs ahead, right, behind and left."""
    return ((arm, 0.0, height), (0.0, -arm, height), (-arm, 0.0, height), (0.0, arm, height))


def cross(half, height):
    """Place four hubs on the corners of a square: front left, front right, rear right, rear left."""
    return ((half, half, height), (half, -half, height), (-half, -half, height), (-half, half, height))


SIXKG = Vehicle("sixkg", 6.0, (0.6, 0.6, 1.2), plus(0.3, 0.05), (1, -1, 1, -1), 121.5e-6, 2.7e-6, 0.20)
HUMMINGBIRD = Vehicle(
    "hummingbird", 0.5, (0.00365, 0.00368, 0.00703), cross(0.1202081528, 0.0), (-1, 1, -1, 1), 5.57e-6, 1.36e-7, 0.10
)
CRAZYFLIE = Vehicle(
    "crazyflie", 0.03, (1.43e-5, 1.43e-5, 2.89e-5), cross(0.0304, 0.008), (1, -1, 1, -1), 2.3e-8, 7.8e-10, 0.0231
)
XQUAD = Vehicle("xquad", 1.5, (0.0135, 0.0148, 0.0250), cross(0.159, 0.03), (-1, 1, -1, 1), 1.02e-5, 1.7e-7, 0.12)

VEHICLES = {vehicle.name: vehicle for vehicle in (SIXKG, HUMMINGBIRD, CRAZYFLIE, XQUAD)}
