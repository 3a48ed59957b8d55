"""Physics of gym-pybullet-drones, from its formulas: Bullet's own damping, drag, ground effect, downwash."""

from __future__ import annotations

import numpy as np

from .instant import Term
from .turning import to_body


class BulletDamping(Term):
    """Bullet slows every body, with a rate of 0.04 (1 + speed) in its motion and in its rotation."""

    def apply(self, now, r):
        v, w = to_body(now.R[:, :, r], now.v[:, r]), now.w[:, r]
        inertia = np.array([vehicle.inertia for vehicle in self.vehicles]).T
        now.force[:, r] -= self.damping * self.of("mass") * (1 + np.sqrt((v * v).sum(0))) * v
        now.torque[:, r] -= self.damping * inertia * (1 + np.sqrt((w * w).sum(0))) * w


class BulletDrag(Term):
    """Drag at the centre of mass: the sum of the rotor speeds times the velocity, by the axes of the world."""

    def apply(self, now, r):
        drag = np.stack((self.across, self.across, self.along)) * now.speed[:, r].sum(0) * now.v[:, r]
        now.force[:, r] -= to_body(now.R[:, :, r], drag)


class BulletGround(Term):
    """Each rotor gains ``G (R / 4 z)^2`` of its thrust."""

    stage = "thrust"

    def apply(self, now, r):
        radius = self.of("rotor_radius")
        height = now.x[2, r] + (now.R[2][:, r][:, None] * now.hubs[:, :, r]).sum(0)
        now.thrust[:, r] *= 1 + self.gain * (radius / (4 * np.maximum(height, 0.9 * radius))) ** 2


class BulletDownwash(Term):
    """Another drone flies above and wanders over this one, which its wake presses down."""

    def apply(self, now, r):
        aside = self.sway * np.hypot(np.sin(0.9 * now.time + self.phase), np.sin(1.4 * now.time))
        peak = 2267.18 * (self.of("rotor_radius") / (4 * self.above)) ** 2
        width = 0.16 * self.above - 0.11
        now.force[2, r] -= peak * np.exp(-0.5 * (aside / width) ** 2)
