"""Gusts: a torque and a force along each body axis that nothing the vehicle does moves."""

from __future__ import annotations

import numpy as np

from .instant import Term
from .missions import STEP
from .rotor_terms import LEAD_IN, at_time, coloured
from .vehicles import CRAZYFLIE

GUSTS = (0, 1, 2)
"""Levels: none, as real flights of a nano-drone show it, and twice that."""

_SPIN_UP = np.array([3.4, 5.1, 2.0])
"""Angular acceleration of a nano-drone at level 1, standard deviation by body axis, rad/s^2."""
_PUSH = 0.06
"""Acceleration along each axis for one rad/s^2 of the largest angular acceleration, m/s^2."""
_MEMORY = np.array([0.31, 1.18, 0.5, 1.0, 1.0, 1.0])
"""Time constants of torque and force, s."""
_SHORTEST = 0.16
"""Arm of a vehicle that level 1 leans by 4 degrees against an attitude loop of 20 rad/s^2 per rad, m."""
_SIZE_RATIO, _MEMORY_RATIO = 1.25, 1.5
"""By how much the size and the memory of a set differ from these at most."""


def gusts(vehicle, level, rng):
    """Draw size, N m and N, and memory, s, of the gusts of a set, three of torque and three of force.

    The same air turns a vehicle less the longer its arms are: a gust pushes with the area of the vehicle, which turns
    it in proportion to `area arm / inertia` and shoves it in proportion to `area / mass`, and both go with 1 / arm.
    Below 0.16 m they stay as they are there: by the slow loops of this study a nano-drone would lean by 14 degrees.
    """
    smaller = CRAZYFLIE.arm / max(vehicle.arm, _SHORTEST)
    size = level * smaller * np.append(_SPIN_UP, [_PUSH * _SPIN_UP.max()] * 3)
    size = size * _SIZE_RATIO ** rng.uniform(-1, 1, 6) * np.append(vehicle.inertia, [vehicle.mass] * 3)
    return {"size": size.tolist(), "memory": (_MEMORY * _MEMORY_RATIO ** rng.uniform(-1, 1, 6)).tolist()}


class Gusts(Term):
    """Ornstein-Uhlenbeck torque and force along the body axes."""

    def prepare(self):
        self.air = np.stack([_drawn(*each) for each in zip(self.size.T, self.memory.T, self.rngs, strict=True)], axis=2)

    def apply(self, now, r):
        blow = at_time(self.air, now.time)
        now.torque[:, r] += blow[:3]
        now.force[:, r] += blow[3:]


def blown(plan, samples):
    """Give the gusts of a flight at the samples of its log, shape (time, 6), N m and N; 0 in still air."""
    if "gusts" not in plan.hidden:
        return np.zeros((samples, 6))
    first = round(LEAD_IN / STEP)
    return _drawn(**plan.hidden["gusts"], rng=plan.generator("gusts"))[first : first + samples]


def _drawn(size, memory, rng):
    return np.hstack([coloured(rng, 1, own) for own in memory]) * size
