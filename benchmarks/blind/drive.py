"""From commanded to true rotor speeds: transport delay, lag of motor and rotor, voltage of the battery."""

from __future__ import annotations

import numpy as np

LONGEST_DELAY = 0.12


class Notch:
    """Takes a band out of the commands of some flights: ``(s^2 + w^2) / (s^2 + 2 width w s + w^2)``."""

    def __init__(self, notches, hover, rotors, dt):
        self.rows = np.array([row for row, notch in enumerate(notches) if notch], dtype=int)
        natural = 2 * np.pi * np.array([notch[0] for notch in notches if notch])
        width = np.array([notch[1] for notch in notches if notch])
        # Bilinear transform, with its frequency kept.
        c = natural / np.tan(natural * dt / 2)
        whole = c**2 + 2 * width * natural * c + natural**2
        self.over = np.stack((c**2 + natural**2, 2 * (natural**2 - c**2))) / whole
        self.last = (c**2 - 2 * width * natural * c + natural**2) / whole
        start = np.tile(hover[self.rows], (rotors, 1))
        self.put, self.got = [start, start], [start, start]

    def passed(self, command):
        """Filter one step of commands."""
        if not len(self.rows):
            return command
        now = command[:, self.rows]
        same, middle = self.over
        got = same * (now + self.put[1]) + middle * (self.put[0] - self.got[0]) - self.last * self.got[1]
        self.put, self.got = [now, self.put[0]], [got, self.got[0]]
        out = command.copy()
        out[:, self.rows] = got
        return out


class Drive:
    """Rotor speeds of a batch; exact between two steps for a held command."""

    def __init__(self, plants, vehicles, dt):
        def collect(name):
            return np.array([getattr(p, name) for p in plants])

        self.dt = dt
        rotors = vehicles[0].count
        self.hover = np.array([v.hover_speed for v in vehicles])
        self.lag_up, self.lag_down = collect("lag_up"), collect("lag_down")
        self.keep_up, self.keep_down = np.exp(-dt / 2 / self.lag_up), np.exp(-dt / 2 / self.lag_down)
        self.behind = collect("delay") / dt
        self.exponent, self.depth = collect("sag_exponent"), collect("sag_depth")
        self.start, self.load = collect("sag_start"), collect("sag_load")
        self.curve, self.carrying = collect("curve"), collect("carrying")
        self.second = np.array([i for i, p in enumerate(plants) if p.resonance], dtype=int)
        self.natural = np.array([p.resonance[0] for p in plants if p.resonance])
        self.ratio = np.array([p.resonance[1] for p in plants if p.resonance])
        self.notch = Notch([p.notch for p in plants], self.hover, rotors, dt)
        self.speed = np.tile(self.hover, (rotors, 1))
        self.extra = np.zeros((rotors, len(self.second)))
        self.past = np.tile(self.hover, (int(LONGEST_DELAY / dt) + 2, rotors, 1))
        self.used = self.start.copy()
        self.volt = 1 - self.depth * self.start - self.load

    def receive(self, step, command):
        """Take a command; return what arrives at the motor controllers now."""
        command = self.notch.passed(command)
        length = len(self.past)
        self.past[step % length] = command
        whole = self.behind.astype(int)
        share = self.behind - whole
        flights = np.arange(command.shape[1])
        newer = self.past[(step - whole) % length, :, flights].T
        older = self.past[(step - whole - 1) % length, :, flights].T
        arrived = (1 - share) * newer + share * older
        arrived = np.where(self.exponent > 0, arrived * self.volt**self.exponent, arrived)
        squares = (1 - self.curve) * arrived**2 + self.curve * self.carrying * arrived
        return np.where(self.curve == 0, arrived, np.sqrt(np.maximum(squares, 0.0)))

    def rate(self, target):
        """Rotor acceleration, rad/s^2."""
        lag = np.where(target > self.speed, self.lag_up, self.lag_down)
        out = (target - self.speed) / lag
        if len(self.second):
            out[:, self.second] = self.extra
        return out

    def half_step(self, target):
        """Advance the rotors by half a step."""
        keep = np.where(target > self.speed, self.keep_up, self.keep_down)
        before = self.speed
        self.speed = target + (before - target) * keep
        if len(self.second):
            self._oscillate(before[:, self.second], target[:, self.second])

    def _oscillate(self, before, target):
        """Advance second-order rotors (underdamped) exactly."""
        h, wn, zeta = self.dt / 2, self.natural, self.ratio
        wd = wn * np.sqrt(1 - zeta**2)
        decay, c, s = np.exp(-zeta * wn * h), np.cos(wd * h), np.sin(wd * h)
        off, rate = before - target, self.extra
        swing = (rate + zeta * wn * off) / wd
        self.speed[:, self.second] = target + decay * (off * c + swing * s)
        self.extra = decay * (rate * c - (wn**2 * off + zeta * wn * rate) / wd * s)

    def discharge(self):
        """Let the battery feel the power of the rotors for one step; a load drop and an emptying cell."""
        power = ((self.speed / self.hover) ** 3).mean(0)
        self.used += power * self.dt / 30.0
        self.volt = 1 - self.depth * (self.used + 0.35 * self.used**2) / 1.35 - self.load * power
