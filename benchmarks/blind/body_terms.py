"""Forces and torques on the body, and bodies that hang on it."""

from __future__ import annotations

import numpy as np

from .instant import Term
from .turning import cross, to_body, to_world
from .vehicles import GRAVITY


class LinearDamping(Term):
    """Torque against the body rate."""

    def apply(self, now, r):
        now.torque[:, r] -= self.damping * now.w[:, r]


class QuadraticDamping(Term):
    """Torque against the square of the body rate."""

    def apply(self, now, r):
        w = now.w[:, r]
        now.torque[:, r] -= self.damping * np.abs(w) * w


class CubicDamping(Term):
    """Torque against the cube of the body rate."""

    def apply(self, now, r):
        now.torque[:, r] -= self.damping * now.w[:, r] ** 3


class StribeckDamping(Term):
    """Damping that is strongest at small rates, like a sticking bearing."""

    def apply(self, now, r):
        w = now.w[:, r]
        now.torque[:, r] -= self.damping * np.tanh(w / 0.1) * (0.25 + 0.75 * np.exp(-np.abs(w) / 0.4))


class ParasiticDrag(Term):
    """Fuselage drag |v|^(n-1) v at a centre of pressure."""

    def apply(self, now, r):
        air = to_body(now.R[:, :, r], now.v[:, r] - now.wind[:, r])
        speed = np.sqrt((air * air).sum(0)) + 1e-9
        force = -self.drag * speed ** (self.power - 1) * air
        now.force[:, r] += force
        now.torque[:, r] += cross(self.centre, force)


class ParasiticPower(ParasiticDrag):
    """The same with another power."""


class TorqueBias(Term):
    """A constant torque."""

    def apply(self, now, r):
        now.torque[:, r] += self.torque


class Payload(Term):
    """A mass on a massless cable: spherical pendulum, cable tension pulls at the attachment."""

    stage = "coupled"

    def prepare(self):
        n = len(self.rows)
        self.state = np.zeros((6, n))
        self.state[2] = -1.0
        swing = np.array([rng.uniform(-0.05, 0.05, 2) for rng in self.rngs]).T
        self.state[:2] = swing
        self.renew()

    def renew(self):
        """Keep the cable direction a unit vector and its rate across it."""
        n = self.state[:3] / np.sqrt((self.state[:3] ** 2).sum(0))
        self.state[:3] = n
        self.state[3:] -= n * (n * self.state[3:]).sum(0)

    def apply(self, now, r):
        R = now.R[:, :, r]
        n, rate = self.state[:3], self.state[3:]
        w = now.w[:, r]
        rigid = now.acceleration[:, r] + to_world(
            R, cross(now.spin_up[:, r], self.point) + cross(w, cross(w, self.point))
        )
        n_body = to_body(R, n)
        lever = cross(self.point, n_body)
        turn = np.einsum("ijn,jn->in", now.inverse_inertia[:, :, r], lever)
        soft = 1 / now.mass[r] + (lever * turn).sum(0)
        along = self.length * (rate**2).sum(0) - (rigid * n).sum(0) - GRAVITY * n[2]
        tension = self.mass * along / (1 + self.mass * soft)
        now.acceleration[:, r] += n * tension / now.mass[r]
        now.spin_up[:, r] += turn * tension
        moved = rigid + tension * (n / now.mass[r] + to_world(R, cross(turn, self.point)))
        pull = -moved
        pull[2] -= GRAVITY
        pull -= n * (pull * n).sum(0)
        self.rate = np.concatenate((rate, pull / self.length - n * (rate**2).sum(0) - self.damping * rate))


class FuelSlosh(Term):
    """Liquid in a tank: a mass on springs in the body's x-y plane, with its own mode."""

    stage = "coupled"

    states = 4

    def apply(self, now, r):
        R = now.R[:, :, r]
        place, rate = self.state[:2], self.state[2:]
        w = now.w[:, r]
        felt = now.acceleration[:, r].copy()
        felt[2] += GRAVITY
        point = np.stack((np.zeros_like(self.height), np.zeros_like(self.height), self.height))
        felt = to_body(R, felt) + cross(now.spin_up[:, r], point) + cross(w, cross(w, point))
        natural = 2 * np.pi * self.frequency
        spring = natural**2 * place + 2 * self.damping * natural * rate
        self.rate = np.concatenate((rate, -spring - felt[:2]))
        # At rest in the tank the liquid is part of the craft; what remains is its motion and, aside, its weight.
        force = np.zeros((3, len(r)))
        force[:2] = -self.mass * self.rate[2:]
        weight = np.zeros((3, len(r)))
        weight[2] = -self.mass * felt[2]
        aside = np.stack((place[0], place[1], self.height))
        torque = cross(aside, force) + cross(np.stack((place[0], place[1], 0 * place[0])), weight)
        now.acceleration[:, r] += to_world(R, force) / now.mass[r]
        now.spin_up[:, r] += np.einsum("ijn,jn->in", now.inverse_inertia[:, :, r], torque)
