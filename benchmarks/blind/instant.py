"""Everything the physics of one moment can see and change, for all flights of a batch."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import ClassVar

import numpy as np


@dataclass
class Instant:
    """Fields end with the axis of flights; ``thrust``, ``side``, ``force`` and ``torque`` are changed by the terms."""

    time: float
    x: np.ndarray
    v: np.ndarray
    q: np.ndarray
    w: np.ndarray
    R: np.ndarray
    speed: np.ndarray
    speed_rate: np.ndarray
    spin: np.ndarray
    hubs: np.ndarray
    wind: np.ndarray
    hub_air: np.ndarray
    thrust: np.ndarray
    side: np.ndarray
    force: np.ndarray
    torque: np.ndarray
    mass: np.ndarray
    inverse_inertia: np.ndarray
    acceleration: np.ndarray | None = None
    spin_up: np.ndarray | None = None


class Term:
    """A piece of physics that some flights of the batch have.

    ``stage`` says when it acts: ``thrust`` (rescales rotor thrust), ``hub`` (forces in the rotor planes),
    ``body`` (forces and torques of the body) or ``coupled`` (bodies that need the acceleration of the craft).
    """

    stage = "body"
    states = 0
    state = None
    kinds: ClassVar = {}
    """All of them by the name of the effect, in the order in which they act."""

    def __init_subclass__(cls):
        Term.kinds[re.sub(r"(?<!^)([A-Z])", r"_\1", cls.__name__).lower()] = cls

    def __init__(self, rows, parameters, vehicles, rngs):
        self.rows = np.asarray(rows)
        self.vehicles = vehicles
        self.rngs = rngs
        for key in parameters[0]:
            setattr(self, key, np.stack([np.asarray(p[key], dtype=float) for p in parameters], axis=-1))
        self.prepare()

    def of(self, name):
        """Collect a property of the vehicles, shape (rows,)."""
        return np.array([getattr(v, name) for v in self.vehicles])

    def prepare(self):
        """Set up states, where there are any, and random sequences."""
        self.state = np.zeros((self.states, len(self.rows))) if self.states else None

    def apply(self, now, r):
        """Add to the forces of this moment in the rows of the term; set ``self.rate`` if it has a state."""
        raise NotImplementedError
