"""The actuator chain from the commanded wrench to the rotors: allocation, lag, links of effects, battery."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from math import prod, sqrt

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.effects.actuation import DelayLine
from cpfls_cli.effects.hooks import Link, RotorMotion
from cpfls_cli.effects.scales import hover_speed
from cpfls_cli.lag import HeldLag
from cpfls_cli.playback.rotors import RotorResponse
from cpfls_cli.simulation.model import SimulatedEffects
from cpfls_cli.simulation.settings import ClosedLoopSettings
from cpfls_cli.vehicle.rotors import rotor_demand
from cpfls_cli.vehicle.settings import VehicleSettings

# Of a squared speed, in parts of the largest.
_ROUNDING = 1e-12
# Share of the full battery: what a load takes beyond it would turn rotors backwards.
_LOWEST_VOLTAGE = 0.05


@dataclass(frozen=True)
class Mixer:
    """Allocate a wrench; where a rotor cannot follow, yaw gives way first, and the rest is clipped.

    Attributes
    ----------
    inverse : array, shape (4, rotor)
        Squared speeds for one unit of thrust and of each torque.
    limit : float, rad^2/s^2
        Largest squared speed.
    """

    inverse: Array
    limit: float

    def demand(self, wrench: Array) -> Array:
        """Compute the squared speeds that a wrench, shape (4,), asks for, whether possible or not, rad^2/s^2."""
        return np.asarray(wrench @ self.inverse)

    def command(self, wrench: Array) -> Array:
        """Compute the possible rotor speeds, shape (rotor,), rad/s, nearest to a wrench, shape (4,)."""
        limit, share = self.limit, 1.0
        upright_all, yaw_all = wrench[:3] @ self.inverse[:3], wrench[3] * self.inverse[3]
        # Four numbers take NumPy longer than Python.
        by_rotor = list(zip(upright_all.tolist(), yaw_all.tolist(), strict=True))
        for upright, yaw in by_rotor:
            # What yaw does not change by more than rounding sets no limit.
            if abs(yaw) > _ROUNDING * limit:
                share = min(share, (limit - upright if yaw > 0 else upright) / abs(yaw))
        share = max(share, 0.0)
        return np.array([sqrt(min(max(upright + share * yaw, 0.0), limit)) for upright, yaw in by_rotor])


def mixer(vehicle: VehicleSettings) -> Mixer:
    """Invert the allocation of a vehicle.

    Raises
    ------
    ComputationError
        If the rotors cannot produce thrust, roll, pitch and yaw independently.
    """
    units = np.eye(4)
    inverse = rotor_demand(vehicle, units[:, 0], units[:, 1:]).squared_speed
    return Mixer(inverse, vehicle.rotor_speed_max_rad_s**2)


@dataclass(frozen=True)
class Battery:
    """Voltage as a share of the full battery, ``V = 1 - use t / T - load (P / P_hover - 1)`` with P ~ sum w_i^3.

    Attributes
    ----------
    use : float
        Share lost by the end of the flight.
    load : float
        Share lost under twice the hover power.
    duration : float, s
        T.
    hover_cubed : float, rad^3/s^3
        Sum of the cubed rotor speeds in hover.
    """

    use: float
    load: float
    duration: float
    hover_cubed: float

    def voltage(self, time: float, rotor_speed: Array) -> float:
        """Compute the voltage some time after take-off, s, at rotor speeds, shape (rotor,), rad/s."""
        power = float((rotor_speed**3).sum()) / self.hover_cubed
        return max(1 - self.use * time / self.duration - self.load * (power - 1), _LOWEST_VOLTAGE)


@dataclass(frozen=True)
class Rotors:
    """Rotors in the middle of a step.

    Attributes
    ----------
    command : array, shape (rotor,), rad/s
    lagged : array, shape (rotor,), rad/s
        The command after the lag.
    measured : array, shape (rotor,), rad/s
        Speed that is logged: at the end of the chain.
    speed, acceleration : array, shape (rotor,), rad/s and rad/s^2
        What acts: the same, or later where the model of a whole vehicle says so.
    slow : array, shape (rotor,), rad^2/s^2
        Squared speed that slow actuation has come to.
    voltage : float
        Share of the full battery.
    """

    command: Array
    lagged: Array
    measured: Array
    speed: Array
    acceleration: Array
    slow: Array
    voltage: float

    @classmethod
    def settled(cls, speed: Array) -> Rotors:
        """Turn at constant speeds, with a full battery."""
        return cls(speed, speed, speed, speed, np.zeros_like(speed), speed**2, 1.0)


@dataclass
class Response:
    """Delay, lag and slow actuation of the model of a whole vehicle, behind the speed that is logged.

    Attributes
    ----------
    lag, slow : HeldLag
        Of speeds in rad/s, and of squared speeds in rad^2/s^2.
    step : float, s
    """

    delay: DelayLine
    lag: HeldLag
    slow: HeldLag
    step: float

    @classmethod
    def of(cls, response: RotorResponse, step: float, speed: Array) -> Response:
        """Begin as if the rotors had long turned at a speed, shape (rotor,), rad/s."""
        lag, slow = HeldLag(response.lag_s / step, speed), HeldLag(response.slow_s / step, speed**2)
        return cls(DelayLine(response.delay_s / step), lag, slow, step)

    def advance(self, measured: RotorMotion) -> tuple[RotorMotion, Array]:
        """Take one step, exactly for speeds that stay the same during it.

        Parameters
        ----------
        measured : RotorMotion
            In the middle of the step.

        Returns
        -------
        acting : RotorMotion
        slow : array, shape (rotor,), rad^2/s^2
        """
        acting = self.delay(measured)
        if self.lag.ratio > 0:
            acting = _behind(self.lag, acting.speed, self.step)
        return acting, self.slow.middle(acting.speed**2)


def _behind(lag: HeldLag, wanted: Array, step: float) -> RotorMotion:
    """Take one step of rotors behind a lag."""
    reached = lag.middle(wanted)
    return RotorMotion(reached, (wanted - reached) / (lag.ratio * step))


@dataclass
class Actuators:
    """First-order lag, then the links of effects, then what the battery leaves; the state moves on with each step.

    Attributes
    ----------
    lag : HeldLag
        Of the commanded speeds, rad/s.
    supplies : tuple of callable
        Factors on the speed at a voltage.
    step : float, s
    response : Response
        Of the model of a whole vehicle.
    steps : int
        Taken so far.
    """

    lag: HeldLag
    links: tuple[Link, ...]
    supplies: tuple[Callable[[float], float], ...]
    battery: Battery
    step: float
    response: Response
    steps: int = 0

    def advance(self, command: Array) -> Rotors:
        """Take one step, exactly for a command that stays the same during it.

        Parameters
        ----------
        command : array, shape (rotor,), rad/s
            In the middle of the step, as is what is returned.
        """
        lagged = motion = _behind(self.lag, command, self.step)
        self.steps += 1
        for link in self.links:
            motion = link(motion)
        voltage = self.battery.voltage((self.steps - 0.5) * self.step, motion.speed)
        factor = prod(supply(voltage) for supply in self.supplies)
        measured = RotorMotion(factor * motion.speed, factor * motion.acceleration)
        acting, slow = self.response.advance(measured)
        return Rotors(command, lagged.speed, measured.speed, acting.speed, acting.acceleration, slow, voltage)


def actuators(
    effects: SimulatedEffects,
    response: RotorResponse,
    vehicle: VehicleSettings,
    settings: ClosedLoopSettings,
    speed: Array,
    step: float,
    duration: float,
) -> Actuators:
    """Build the actuator chain of a vehicle with its effects.

    Parameters
    ----------
    response : RotorResponse
        Behind the speeds that are logged.
    speed : array, shape (rotor,), rad/s
        At the start.
    step, duration : float, s
    """
    listed = effects.ordered
    acting = [(one.effect.actuation, one.values) for one in listed if one.effect.actuation is not None]
    lags = [each.lag(values) for each, values in acting if each.lag is not None]
    hover = len(vehicle.rotors) * hover_speed(vehicle) ** 3
    return Actuators(
        lag=HeldLag((lags[-1] if lags else settings.rotor_time_constant_s) / step, speed),
        links=tuple(each.link(values, step) for each, values in acting if each.link is not None),
        supplies=tuple(partial(each.supply, values) for each, values in acting if each.supply is not None),
        battery=Battery(settings.battery_use, settings.battery_load, duration, hover),
        step=step,
        response=Response.of(response, step, speed),
    )
