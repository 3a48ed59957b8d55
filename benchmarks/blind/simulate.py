"""Integrate many closed-loop flights at once: midpoint rule for the body, exact rotors, held commands."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from . import turning
from .control import Controller
from .drive import Drive
from .instant import Instant
from .missions import STEP
from .rotor_terms import LEAD_IN
from .terms import STAGES, build
from .vehicles import GRAVITY

DT = 0.002
CONTROL_EVERY = 2
LEAD_HEIGHT = 0.8
LOG_EVERY = round(STEP / DT)
_COMES_AGAIN = frozenset({"gains", "gust_field"})
"""What is drawn once for all flights of a path."""


@dataclass(frozen=True)
class FlightPlan:
    """One flight to simulate: who flies what, and what is hidden in it; ``again`` counts flights of the same path."""

    vehicle: Any
    plant: Any
    mission: Any
    hidden: dict
    wind: np.ndarray
    seed: tuple
    again: int = 0

    def generator(self, purpose):
        """Give random numbers that depend on the flight and the purpose alone."""
        again = [self.again] if self.again and purpose not in _COMES_AGAIN else []
        return np.random.default_rng([*self.seed, *purpose.encode(), *again])


class Fleet:
    """State and physics of a batch of flights."""

    def __init__(self, plans, height=0.0):
        plants = [plan.plant for plan in plans]
        self.mass = np.array([p.mass for p in plants])
        self.inertia = np.moveaxis(np.array([p.inertia for p in plants]), 0, 2).copy()
        self.inverse = np.moveaxis(np.linalg.inv(np.array([p.inertia for p in plants])), 0, 2).copy()
        self.hubs = np.moveaxis(np.array([p.hubs for p in plants]), 0, 2).copy()
        self.k, self.b, self.spin = (
            np.array([getattr(p, name) for p in plants]).T.copy() for name in ("thrust_factor", "torque_factor", "spin")
        )
        self.origin = np.array([p.origin for p in plants]).T.copy()
        self.wind = np.array([plan.wind for plan in plans], dtype=float).T.copy()
        self.euler_axis = np.array([p.euler_axis for p in plants])
        self.terms = build(plans)
        self.with_state = [t for stage in STAGES for t in self.terms[stage] if t.state is not None]
        start = np.array([plan.mission.position[0] for plan in plans]).T
        start[2] += height
        yaw = np.array([plan.mission.yaw[0] for plan in plans])
        self.y = np.concatenate((start, np.zeros_like(start), turning.from_yaw(yaw), np.zeros_like(start)))

    def instant(self, time, y, speed, speed_rate):
        """Look at one moment, before any force but rotor thrust."""
        x, v, q, w = y[:3], y[3:6], y[6:10], y[10:13]
        R = turning.matrix(q)
        air = turning.to_body(R, v - self.wind)
        hub_air = air[:, None] + turning.cross(w[:, None], self.hubs)
        n = y.shape[1]
        zeros = np.zeros((3, n))
        return Instant(
            time, x, v, q, w, R, speed, speed_rate, self.spin, self.hubs, self.wind, hub_air,
            self.k * speed**2, np.zeros((2, len(speed), n)), zeros, zeros.copy(), self.mass, self.inverse,
        )  # fmt: skip

    def rates(self, time, y, speed, speed_rate):
        """Differentiate the state: forces at the hubs, forces on the body, then coupled bodies."""
        now = self.instant(time, y, speed, speed_rate)
        for stage in ("thrust", "hub", "body"):
            for term in self.terms[stage]:
                term.apply(now, term.rows)
        self.add_rotors(now)
        now.acceleration = turning.to_world(now.R, now.force) / self.mass
        now.acceleration[2] -= GRAVITY
        stiff = turning.cross(now.w, np.einsum("ijn,jn->in", self.inertia, now.w))
        now.spin_up = np.einsum("ijn,jn->in", self.inverse, now.torque - stiff)
        for term in self.terms["coupled"]:
            term.apply(now, term.rows)
        return np.concatenate((now.v, now.acceleration, turning.quaternion_rate(now.q, now.w), now.spin_up)), now

    def add_rotors(self, now):
        """Sum the hub forces and the reaction torques of the rotors."""
        x, y, z = self.hubs
        fx, fy = now.side
        torque = np.empty((3, x.shape[1]))
        torque[0] = (y * now.thrust - z * fy).sum(0)
        torque[1] = (z * fx - x * now.thrust).sum(0)
        torque[2] = (x * fy - y * fx - self.b * self.spin * now.speed**2).sum(0)
        if self.euler_axis.any():
            r = np.flatnonzero(self.euler_axis)
            torque[:, r] = along_euler_axes(now.R[:, :, r], torque[:, r])
        now.torque += torque
        now.force[0] += fx.sum(0)
        now.force[1] += fy.sum(0)
        now.force[2] += now.thrust.sum(0)

    def advance(self, time, drive, target, first):
        """Take one midpoint step; ``first`` holds the rates at its start."""
        saved = [term.state for term in self.with_state]
        for term in self.with_state:
            term.state = term.state + DT / 2 * term.rate
        drive.half_step(target)
        second, _ = self.rates(time + DT / 2, self.y + DT / 2 * first, drive.speed, drive.rate(target))
        self.y = self.y + DT * second
        self.y[6:10] /= np.sqrt((self.y[6:10] ** 2).sum(0))
        for term, state in zip(self.with_state, saved, strict=True):
            term.state = state + DT * term.rate
            if hasattr(term, "renew"):
                term.renew()
        drive.half_step(target)


def along_euler_axes(R, torque):
    """Turn Euler-axis torques into body torques: the inverse transpose of W."""
    s_pitch = -R[2, 0]
    c_pitch = np.sqrt(1 - s_pitch**2)
    s_roll, c_roll = R[2, 1] / c_pitch, R[2, 2] / c_pitch
    tx, ty, tz = torque
    lifted = (tz + tx * s_pitch) / c_pitch
    # Solves W' m = torque with W = [[1, 0, -sp], [0, cr, sr cp], [0, -sr, cr cp]].
    return np.stack((tx, c_roll * ty + s_roll * lifted, -s_roll * ty + c_roll * lifted))


def simulate(plans, duration, lead_in=LEAD_IN):
    """Fly all plans together; their vehicles have the same number of rotors.

    Returns a dict of arrays (flights, time, ...) sampled at 100 Hz: true state, accelerations, rotor speeds, commands,
    voltage. The craft fly a short lead-in that is not recorded.
    """
    fleet = Fleet(plans, LEAD_HEIGHT * np.clip(3 * lead_in / LEAD_IN - 1, 0, 1))
    vehicles = [plan.vehicle for plan in plans]
    drive = Drive([plan.plant for plan in plans], vehicles, DT)
    control = Controller(vehicles, [plan.generator("gains") for plan in plans], CONTROL_EVERY * DT)
    references = np.stack([plan.mission.table() for plan in plans], axis=2)
    count = round(duration / STEP) + 1
    log = {name: np.empty((count, rows or vehicles[0].count, len(plans))) for name, rows in _RECORD.items()}
    lead = round(lead_in / DT)
    noise = [plan.generator("senses") for plan in plans]
    senses = np.stack([rng.standard_normal((count + lead // LOG_EVERY + 1, 9)).astype(np.float32) for rng in noise], 2)
    command = drive.speed
    for step in range(-lead, (count - 1) * LOG_EVERY + 1):
        time = step * DT
        if step % CONTROL_EVERY == 0:
            command = _fly(control, fleet.y, _reference(references, time), senses[(step + lead) // LOG_EVERY])
        target = drive.receive(step, command)
        first, now = fleet.rates(time, fleet.y, drive.speed, drive.rate(target))
        if step >= 0 and step % LOG_EVERY == 0:
            _record(log, step // LOG_EVERY, fleet, first, drive, command, now)
        fleet.advance(time, drive, target, first)
        drive.discharge()
    return {name: np.moveaxis(values, 2, 0) for name, values in log.items()}


_RECORD = {
    "x": 3, "v": 3, "a": 3, "q": 4, "w": 3, "spin_up": 3, "speed": None, "command": None, "volt": 1,
}  # fmt: skip


def _reference(table, time):
    place = max(time, 0.0) / STEP
    low = min(int(place), len(table) - 2)
    share = place - low
    out = (1 - share) * table[low] + share * table[low + 1]
    if time < 0:
        # The craft comes down from above, to find its balance clear of the ground.
        out[2] += LEAD_HEIGHT * np.clip(-3 * time / LEAD_IN - 1, 0, 1)
        out[3:9] = 0.0
        out[5] = -3 * LEAD_HEIGHT / LEAD_IN * (1 < -3 * time / LEAD_IN < 2)
        out[10] = 0.0
        out[11:13] *= 1 + time / LEAD_IN
    return out


def _fly(control, y, reference, noise):
    """Let the controller see the state with a little noise."""
    x = y[:3] + 0.002 * noise[:3]
    v = y[3:6] + 0.01 * noise[3:6]
    w = y[10:13] + 0.002 * noise[6:9]
    return control.command(x, v, turning.matrix(y[6:10]), w, reference)


def _record(log, place, fleet, first, drive, command, now):
    """Write one sample; position, velocity and acceleration are those of the nominal centre."""
    w, spin_up, origin = now.w, first[10:13], fleet.origin
    arm = turning.cross(w, origin)
    log["x"][place] = now.x + turning.to_world(now.R, origin)
    log["v"][place] = now.v + turning.to_world(now.R, arm)
    log["a"][place] = first[3:6] + turning.to_world(now.R, turning.cross(spin_up, origin) + turning.cross(w, arm))
    log["q"][place], log["w"][place], log["spin_up"][place] = now.q, w, spin_up
    log["speed"][place], log["command"][place], log["volt"][place] = drive.speed, command, drive.volt
