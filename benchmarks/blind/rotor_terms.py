"""Forces at the hubs: what the air does to each rotor."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.signal import lfilter

from .instant import Term
from .turning import cross

LOG_RATE = 100
LEAD_IN = 6.0

# Thrust over hover thrust of a rotor in vertical descent at fixed speed, from published flow computations.
_RATIO = PchipInterpolator(
    [-1.0, 0.0, 0.5, 1.0, 1.2, 1.4, 1.6, 2.0, 2.6], [1, 1, 1.01, 0.92, 0.82, 0.85, 0.91, 1.36, 1.5]
)
_GRID = np.linspace(-1.0, 2.6, 361)
_TABLE = _RATIO(_GRID)


def coloured(rng, channels, correlation, seconds=40.0):
    """Draw unit-variance noise at 100 Hz with a first-order correlation time, shape (time, channels)."""
    keep = np.exp(-1 / (LOG_RATE * correlation))
    white = rng.standard_normal((round((seconds + 10 * correlation) * LOG_RATE), channels))
    return lfilter([np.sqrt(1 - keep**2)], [1, -keep], white, axis=0)[-round(seconds * LOG_RATE) :]


def at_time(table, time):
    """Interpolate a 100 Hz table that starts with the lead-in."""
    place = (time + LEAD_IN) * LOG_RATE
    low = min(int(place), len(table) - 2)
    share = place - low
    return (1 - share) * table[low] + share * table[low + 1]


class RotorDrag(Term):
    """H-force: each hub is dragged in its plane in proportion to rotor speed and air speed."""

    stage = "hub"

    def apply(self, now, r):
        now.side[:, :, r] -= self.drag * now.speed[:, r] * now.hub_air[:2, :, r]


class FlappingMoment(Term):
    """Hub spring moment of the flapped disc: flapping angle mu / (1 - mu^2 / 2) along the air velocity."""

    def apply(self, now, r):
        vx, vy = now.hub_air[0][:, r], now.hub_air[1][:, r]
        tip = now.speed[:, r] * self.of("rotor_radius")
        grow = 1 / (1 - 0.5 * (vx * vx + vy * vy) / tip**2)
        lean = self.moment * now.speed[:, r] * grow
        now.torque[0, r] -= (lean * vy).sum(0)
        now.torque[1, r] += (lean * vx).sum(0)


class RollingMoment(Term):
    """The advancing blade lifts more: a moment along the air velocity with the sign of the spin."""

    def apply(self, now, r):
        roll = self.moment * now.spin[:, r] * now.speed[:, r]
        now.torque[:2, r] -= (roll * now.hub_air[:2, :, r]).sum(1)


class RotorPlaneDamping(Term):
    """The disc lags behind a turning mast by 16 / (Lock number * rotor speed) per rate; the thrust leans with it."""

    stage = "hub"

    def apply(self, now, r):
        lean = 16 / (self.lock_number * now.speed[:, r]) * now.thrust[:, r]
        now.side[0][:, r] -= lean * now.w[1, r]
        now.side[1][:, r] += lean * now.w[0, r]


class Inflow(Term):
    """Thrust falls in proportion to rotor speed and axial air speed at the hub."""

    stage = "thrust"

    def apply(self, now, r):
        now.thrust[:, r] -= self.gain * now.speed[:, r] * now.hub_air[2][:, r]


class InflowMomentum(Term):
    """Inflow where the induced velocity adjusts to the axial speed by momentum theory."""

    stage = "thrust"

    def apply(self, now, r):
        axial, hover = now.hub_air[2][:, r], self.of("induced_speed")
        half = np.maximum(axial, -0.6 * hover) / 2
        change = axial + np.sqrt(half**2 + hover**2) - half - hover
        now.thrust[:, r] -= 1.6 * self.gain * now.speed[:, r] * change


class TranslationalLift(Term):
    """Sideways flow lowers the induced velocity (Glauert), so the rotor gains thrust."""

    stage = "thrust"

    def apply(self, now, r):
        hover = self.of("induced_speed")
        half = (now.hub_air[0][:, r] ** 2 + now.hub_air[1][:, r] ** 2) / 2
        induced = np.sqrt(np.sqrt(half**2 + hover**4) - half)
        now.thrust[:, r] += self.gain * now.speed[:, r] * (hover - induced)


class GroundEffect(Term):
    """Cheeseman and Bennett at each hub: T / (1 - G (R / 4 z)^2)."""

    stage = "thrust"

    def nearness(self, now):
        """Give hub height over rotor radius, shape (rotor, rows)."""
        r = self.rows
        height = now.x[2, r] + (now.R[2][:, r][:, None] * now.hubs[:, :, r]).sum(0)
        return np.maximum(height / self.of("rotor_radius"), 0.9)

    def apply(self, now, r):
        loss = np.minimum(self.gain / (16 * self.nearness(now) ** 2), 0.6)
        now.thrust[:, r] /= 1 - loss


class GroundExponential(GroundEffect):
    """A ground effect that fades like exp(-z / 1.2 R) instead."""

    def apply(self, now, r):
        now.thrust[:, r] *= 1 + 0.25 * self.gain * np.exp(-self.nearness(now) / 1.2)


class VerticalDescent(Term):
    """Vortex ring to windmill: mean thrust by a computed table, random thrust inside 0.5 < x < 1.7."""

    stage = "thrust"

    def prepare(self):
        self.noise = np.stack([coloured(rng, self.vehicles[0].count, 0.05) for rng in self.rngs], axis=2)

    def apply(self, now, r):
        hover = self.of("induced_speed")
        air = now.hub_air[:, :, r]
        x = -air[2] / hover
        # Forward speed blows the ring away.
        stays = np.exp(-(air[0] ** 2 + air[1] ** 2) / (0.55 * hover) ** 2)
        mean = np.interp(x, _GRID, _TABLE) - 1
        gate = 1 / ((1 + np.exp(-(x - 0.5) / 0.05)) * (1 + np.exp((x - 1.7) / 0.05)))
        now.thrust[:, r] *= 1 + stays * (self.mean * mean + self.jitter * gate * at_time(self.noise, now.time))


class RotorInterference(Term):
    """Rotors behind others (in the direction of flight) lose thrust in their wake."""

    stage = "thrust"

    def apply(self, now, r):
        air = now.hub_air[:2, :, r].mean(1)
        speed = np.sqrt((air**2).sum(0)) + 1e-9
        behind = -(now.hubs[:2, :, r] * (air / speed)[:, None]).sum(0) / self.of("arm")
        share = np.maximum(behind, 0) ** 2 * speed / (speed + self.of("induced_speed"))
        now.thrust[:, r] *= 1 - self.loss * share


class ThrustTilt(Term):
    """Motors mounted askew: each thrust leans by a fixed small angle, and the reaction with it."""

    stage = "hub"

    def apply(self, now, r):
        now.side[:, :, r] += self.lean * now.thrust[:, r]
        reaction = self.of("torque_factor") * now.spin[:, r] * now.speed[:, r] ** 2
        now.torque[:2, r] -= (self.lean * reaction).sum(1)


class LooseArm(Term):
    """One arm twists on a spring, driven by the turning of the body; its thrust leans along."""

    stage = "hub"

    def prepare(self):
        self.state = np.zeros((2, len(self.rows)))
        self.which = self.rotor.astype(int)

    def apply(self, now, r):
        angle, rate = self.state
        hub = now.hubs[:2, self.which, r] / self.of("arm")
        driven = (hub * now.w[:2, r]).sum(0) + 0.5 * now.w[2, r]
        natural = 2 * np.pi * self.frequency
        pull = self.drive * natural**2 * driven
        self.rate = np.stack((rate, pull - 2 * self.damping * natural * rate - natural**2 * angle))
        lean = now.thrust[self.which, r] * angle
        now.side[0, self.which, r] -= hub[1] * lean
        now.side[1, self.which, r] += hub[0] * lean


class RotorGyroscopic(Term):
    """Spinning rotors resist being turned: -w x h."""

    def apply(self, now, r):
        momentum = np.zeros((3, len(r)))
        momentum[2] = self.inertia * (now.spin[:, r] * now.speed[:, r]).sum(0)
        now.torque[:, r] -= cross(now.w[:, r], momentum)


class RotorAcceleration(Term):
    """Speeding a rotor up turns the body the other way."""

    def apply(self, now, r):
        now.torque[2, r] -= self.inertia * (now.spin[:, r] * now.speed_rate[:, r]).sum(0)
