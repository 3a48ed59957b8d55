"""A cascaded controller that knows only the nominal vehicle: position, attitude, rate, mixing."""

from __future__ import annotations

import numpy as np

from .turning import cross, to_body
from .vehicles import GRAVITY

LARGEST_TILT = np.radians(25)


class Controller:
    """Fly many craft at once, each with its own slightly wrong gains."""

    def __init__(self, vehicles, rngs, period):
        n = len(vehicles)
        self.period = period
        self.mass = np.array([v.mass for v in vehicles])
        self.inertia = np.array([v.inertia for v in vehicles]).T
        self.unmix = np.moveaxis(np.array([np.linalg.pinv(v.allocation(), rcond=1e-12) for v in vehicles]), 0, 2).copy()
        self.hover = np.array([v.hover_speed for v in vehicles]) ** 2
        self.yaw_limit = 0.4 * np.array([v.count * v.torque_factor for v in vehicles]) * self.hover
        nominal = np.array([1.1, 1.9, 0.25, 20.0, 7.5, 5.0, 4.0])
        gains = np.array([nominal * rng.uniform(0.88, 1.12, nominal.size) for rng in rngs]).T
        self.position_gain, self.velocity_gain, self.integral_gain = gains[:3]
        self.tilt_gain, self.rate_gain, self.yaw_gain, self.yaw_rate_gain = gains[3:]
        self.position_integral = np.zeros((3, n))
        self.attitude_integral = np.zeros((3, n))

    def thrust_vector(self, x, v, reference):
        """Ask for a force in the world frame (per mass)."""
        wrong = reference[:3] - x
        self.position_integral = np.clip(self.position_integral + wrong * self.period, -12, 12)
        asked = reference[6:9] + self.position_gain * wrong + self.velocity_gain * (reference[3:6] - v)
        # Height is held tighter than place, for flight near the ground.
        asked[2] += 2.0 * self.position_gain * wrong[2] + self.velocity_gain * (reference[5] - v[2])
        asked += self.integral_gain * self.position_integral
        asked[2] += 5.0 * self.integral_gain * self.position_integral[2]
        asked[2] = np.clip(asked[2] + GRAVITY, 0.35 * GRAVITY, 1.8 * GRAVITY)
        side = np.sqrt(asked[0] ** 2 + asked[1] ** 2) + 1e-9
        asked[:2] *= np.minimum(1.0, np.tan(LARGEST_TILT) * asked[2] / side)
        return asked

    def attitude_error(self, R, asked, yaw, tilt):
        """Compare body axes with those asked for; small rotation in the body frame."""
        up = to_body(R, asked)
        up = up / np.sqrt((up * up).sum(0))
        # The body z axis must turn onto `up`: rotation vector z x up; the dither adds to it.
        roll_pitch = np.stack((-up[1], up[0])) + tilt
        ahead = to_body(R, np.stack((np.cos(yaw), np.sin(yaw), np.zeros_like(yaw))))
        return np.stack((roll_pitch[0], roll_pitch[1], np.arctan2(ahead[1], ahead[0])))

    def command(self, x, v, R, w, reference):
        """Give the rotor speeds, shape (rotor, flights), rad/s."""
        asked = self.thrust_vector(x, v, reference)
        error = self.attitude_error(R, asked, reference[9], reference[11:13])
        self.attitude_integral = np.clip(self.attitude_integral + error * self.period, -0.5, 0.5)
        rate = -w
        rate[2] = reference[10] - w[2]
        turn = np.stack((self.tilt_gain, self.tilt_gain, self.yaw_gain)) * (error + 0.4 * self.attitude_integral)
        turn += np.stack((self.rate_gain, self.rate_gain, self.yaw_rate_gain)) * rate
        torque = self.inertia * turn + cross(w, self.inertia * w)
        torque[2] = np.clip(torque[2], -self.yaw_limit, self.yaw_limit)
        thrust = self.mass * asked[2] / np.maximum(R[2, 2], 0.6)
        squared = np.einsum("ijn,jn->in", self.unmix, np.concatenate((thrust[None], torque)))
        return np.sqrt(np.clip(squared, 0.12 * self.hover, 2.4 * self.hover))
