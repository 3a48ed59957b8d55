"""Disturbances that no catalogue lists."""

from __future__ import annotations

import numpy as np

from .instant import Term
from .rotor_terms import at_time, coloured
from .turning import cross, to_body


class MagneticTorque(Term):
    """Torque that varies over the place, like a compass near iron."""

    def apply(self, now, r):
        x, y = now.x[0, r] / self.length, now.x[1, r] / self.length
        now.torque[:, r] += self.torque * np.stack((np.sin(x + 0.4), np.cos(y), np.sin(x - y)))


class YawCogging(Term):
    """Torque periodic in five times the yaw angle."""

    def apply(self, now, r):
        yaw = np.arctan2(now.R[1, 0, r], now.R[0, 0, r])
        now.torque[:, r] += self.torque * np.stack((np.sin(5 * yaw), np.cos(5 * yaw + 1), np.sin(5 * yaw + 2)))


class GustTurbulence(Term):
    """Random torque with a Dryden-like spectrum."""

    def prepare(self):
        self.noise = np.stack([coloured(rng, 3, 0.4) for rng in self.rngs], axis=2)

    def apply(self, now, r):
        now.torque[:, r] += self.torque * at_time(self.noise, now.time)


class StickSlipGimbal(Term):
    """A gimballed mass held by dry friction: it turns along until it slips."""

    states = 6

    def apply(self, now, r):
        angle, rate = self.state[:3], self.state[3:]
        slip = now.w[:, r] - rate
        grip = 1 + 0.8 * np.exp(-((slip / 0.15) ** 2))
        friction = self.friction * np.tanh(slip / 0.03) * grip
        inertia = self.friction / 1.2
        self.rate = np.concatenate((rate, friction / inertia - 6.0 * angle))
        now.torque[:, r] -= friction


class ThermalDrift(Term):
    """Torque that grows with the square of time."""

    def apply(self, now, r):
        now.torque[:, r] += self.torque * (max(now.time, 0.0) / 30) ** 2


class AttitudeProduct(Term):
    """Torque from products of roll and pitch."""

    def apply(self, now, r):
        lean_x, lean_y = now.R[2, 0, r], now.R[2, 1, r]
        now.torque[:, r] += self.torque * np.stack((lean_x * lean_y, lean_y**2 - lean_x**2, lean_x**2)) / 0.03


class WallEffect(Term):
    """Pull towards walls that stand along x, fading with the distance."""

    def apply(self, now, r):
        distance = np.abs((now.x[0, r] - self.place + 6) % 12 - 6)
        direction = np.stack((np.zeros(len(r)), np.ones(len(r)), np.zeros(len(r))))
        body = to_body(now.R[:, :, r], direction)
        now.torque[:, r] += self.torque * np.exp(-distance / 1.2) * body


class SlidingBattery(Term):
    """A loose battery slides between two stops when pushed hard enough: the torque jumps."""

    def prepare(self):
        self.state = np.zeros((2, len(self.rows)))
        self.side = np.ones((2, len(self.rows)))

    def apply(self, now, r):
        push = now.w[[1, 0]][:, r]
        flips = np.abs(push) > 0.45
        self.side = np.where(flips, np.sign(push), self.side)
        self.rate = 12.0 * (self.side - self.state)
        now.torque[:2, r] += self.torque[:2] * self.state * now.thrust[:, r].sum(0) / self.of("weight")


class CyclicSwirl(Term):
    """The swirl of the rotors' wakes, carried aside, meets one arm after the other as the flow turns."""

    def apply(self, now, r):
        air = now.hub_air[:2, :, r].mean(1)
        aside = np.sqrt((air**2).sum(0))
        angle = 4 * np.arctan2(air[1], air[0])
        carried = aside / (aside + self.of("induced_speed")) * now.thrust[:, r].sum(0) / self.of("weight")
        now.torque[:, r] += self.torque * carried * np.stack((np.sin(angle), np.cos(angle), np.cos(angle + 1)))


class WakeOnBody(Term):
    """Sideways flow carries the rotors' wakes over the body, so that their download moves off the centre."""

    def apply(self, now, r):
        air = now.hub_air[:2, :, r].mean(1)
        aside = np.sqrt((air**2).sum(0))
        force = np.zeros((3, len(r)))
        force[2] = -self.loss * now.thrust[:, r].sum(0) * aside / (aside + self.of("induced_speed"))
        place = np.zeros_like(force)
        place[:2] = -self.of("arm") * air / (aside + 0.5 * self.of("induced_speed"))
        now.force[:, r] += force
        now.torque[:, r] += cross(place, force)


class FlexibleArm(Term):
    """Arms with the motors turn on springs against the body: a share of the inertia swings with its own mode."""

    stage = "coupled"

    states = 6

    def apply(self, now, r):
        angle, rate = self.state[:3], self.state[3:]
        natural = 2 * np.pi * self.frequency
        spring = natural**2 * angle + 2 * self.damping * natural * rate
        # The arms are part of the inertia, and swing as `angle'' = -spin_up - spring`.
        turned = (now.spin_up[:, r] + self.share * spring) / (1 - self.share)
        now.spin_up[:, r] = turned
        self.rate = np.concatenate((rate, -turned - spring))


class DragOverHeight(Term):
    """Drag in the rotor plane that grows with the height, as in air that is stiller near the ground."""

    stage = "hub"

    def apply(self, now, r):
        height = np.maximum(now.x[2, r], 0.0)
        now.side[:, :, r] -= self.drag * height / (height + 60.0) * now.speed[:, r] * now.hub_air[:2, :, r]


class GustField(Term):
    """Air that stands still in gusts fixed in space, felt through the drag of the rotors."""

    stage = "hub"

    def prepare(self):
        # Wave number, direction and phase of four waves, shape (3, 4, rows).
        low, high = [[0.3], [0.0], [0.0]], [[1.0], [2 * np.pi], [2 * np.pi]]
        self.waves = np.stack([rng.uniform(low, high, (3, 4)) for rng in self.rngs], axis=2)

    def apply(self, now, r):
        number, way, phase = self.waves
        along = number * (np.cos(way) * now.x[0, r] + np.sin(way) * now.x[1, r])
        blow = np.sqrt(0.5) * self.gust * np.sin(along + phase)
        wind = np.stack(((blow * np.cos(way)).sum(0), (blow * np.sin(way)).sum(0), np.zeros(len(r))))
        air = now.hub_air[:2, :, r] - to_body(now.R[:, :, r], wind)[:2, None]
        now.side[:, :, r] -= self.drag * now.speed[:, r] * air


class PropellerChange(Term):
    """One propeller loses a piece in mid-flight."""

    stage = "thrust"

    def prepare(self):
        self.which = self.rotor.astype(int)

    def apply(self, now, r):
        now.thrust[self.which, r] *= 1 - self.loss * (now.time > self.when)
