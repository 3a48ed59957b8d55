"""The way from a command to the rotors: lag, delay, and the voltage that is left."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import exp, floor

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.simulation.battery import Battery


@dataclass(frozen=True)
class Rotors:
    """Rotors in the middle of a step.

    Attributes
    ----------
    told : array, shape (rotor,), rad/s
        The command.
    followed : array, shape (rotor,), rad/s
        The command after the lag.
    speed, acceleration : array, shape (rotor,), rad/s and rad/s^2
        What the rotors do: late by the delay, slower on an empty battery.
    voltage : float
        Share of the full battery.
    """

    told: Array
    followed: Array
    speed: Array
    acceleration: Array
    voltage: float


@dataclass
class Actuators:
    """First-order lag, then a pure delay, then ``speed (V/V_0)^(n/2)``; the state moves on with each step.

    Attributes
    ----------
    time_constant : float, s
    delay : float, s
    exponent : float
        n; 0 for rotors that do not feel the battery.
    battery : Battery
    step : float, s
    speed : array, shape (rotor,), rad/s
        After the lag, at the start of the next step.
    past : list of tuple of array
        Speed and acceleration after the lag in the middle of each step so far.
    """

    time_constant: float
    delay: float
    exponent: float
    battery: Battery
    step: float
    speed: Array
    past: list[tuple[Array, Array]] = field(default_factory=list)

    def advance(self, told: Array) -> Rotors:
        """Take one step, exactly for a command that stays the same during it.

        Parameters
        ----------
        told : array, shape (rotor,), rad/s
            In the middle of the step.

        Returns
        -------
        Rotors
            In the middle of the step.
        """
        half = exp(-0.5 * self.step / self.time_constant)
        followed = told + half * (self.speed - told)
        self.past.append((followed, (told - followed) / self.time_constant))
        self.speed = told + half**2 * (self.speed - told)
        time = (len(self.past) - 0.5) * self.step
        speed, acceleration = self._delayed()
        voltage = self.battery.voltage(time, speed)
        factor = voltage ** (self.exponent / 2)
        return Rotors(told, followed, factor * speed, factor * acceleration, voltage)

    def _delayed(self) -> tuple[Array, Array]:
        place = len(self.past) - 1 - self.delay / self.step
        if place <= 0:
            return self.past[0][0], np.zeros_like(self.speed) if self.delay else self.past[0][1]
        first = floor(place)
        if first == place:
            return self.past[first]
        share = place - first
        (before, before_rate), (after, after_rate) = self.past[first], self.past[first + 1]
        return (1 - share) * before + share * after, (1 - share) * before_rate + share * after_rate
