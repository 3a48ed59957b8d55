"""Attitude controllers: the plan that they follow, their laws, and the actuators that turn commands into torques."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import ceil, log, pi, sqrt

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.dynamics.equations_of_motion import TorqueModel
from cpfls_cli.errors import ComputationError, SettingError
from cpfls_cli.lag import after_step
from cpfls_cli.regressor.motion import Motion
from cpfls_cli.trajectory.planning import sample_interval

VERTICAL = 0.1
"""Smallest |cos(pitch)| of a plan: nearer to a vertical pitch, Euler angles do not tell which way to turn."""

_ROUNDING = 1e-6
# What is left of an initial error that has died down.
_SETTLED = 1e-6


@dataclass(frozen=True)
class Plan:
    """Planned attitude at the instants of control.

    Attributes
    ----------
    time : array, shape (control,), s
        Instants of control: every sample, and equal parts between.
    parts : int
        Instants from sample to sample.
    period : float, s
    attitude, rate, acceleration : array, shape (control, 3), rad and s
        Euler angles and their derivatives.
    """

    time: Array
    parts: int
    period: float
    attitude: Array
    rate: Array
    acceleration: Array

    def __len__(self) -> int:
        """Count the instants of control."""
        return len(self.time)


def plan_of(time: Array, planned: Mapping[str, Array], control_rate: float) -> Plan:
    """Interpolate a planned attitude to the instants of control.

    Between samples it is the polynomial of fifth order that has their angles, rates and accelerations.

    Parameters
    ----------
    time : array, shape (samples,), s
    planned : mapping of str to array
        `attitude`, `attitude_rate`, `attitude_acceleration`, shape (samples, 3) each.
    control_rate : float, Hz
        Raised to the next multiple of the rate of the samples.

    Raises
    ------
    SettingError
        If the control rate is lower than the rate of the samples.
    ComputationError
        If there are fewer than two samples, they are not uniform, or the pitch comes near +-90 degrees.
    """
    sample = sample_interval(time, "attitude control")
    if control_rate * sample < 1 - _ROUNDING:
        slow = f"lower than the {1 / sample:.6g} samples in a second of the trajectory"
        raise SettingError(
            "computed_torque.control_rate_hz", f"{slow}; set it to {ceil(1 / sample - _ROUNDING)} or more"
        )
    parts = ceil(control_rate * sample - _ROUNDING)
    q, qd, qdd = (planned[name] for name in ("attitude", "attitude_rate", "attitude_acceleration"))
    at = time
    if parts > 1:
        from scipy.interpolate import BPoly

        at = np.append((time[:-1, None] + sample * np.arange(parts) / parts).ravel(), time[-1])
        between = BPoly.from_derivatives(time, np.stack([q, qd, qdd], axis=1))
        q, qd, qdd = (between(at, nu=order) for order in range(3))
    _refuse_vertical(at, q[:, 1])
    return Plan(at, parts, sample / parts, q, qd, qdd)


def _refuse_vertical(time: Array, pitch: Array) -> None:
    steep = np.flatnonzero(np.abs(np.cos(pitch)) < VERTICAL)
    # A path that turns fast may leap over the vertical between two instants.
    leaps = np.flatnonzero(np.diff(np.sign(np.cos(pitch))))
    if steep.size or leaps.size:
        first = min([*steep[:1], *leaps[:1]])
        raise ComputationError(
            f"the planned pitch comes within {np.degrees(np.arcsin(VERTICAL)):.1f} degrees of the vertical at "
            f"t = {time[first]:g} s ({np.degrees(pitch[first]):.1f} degrees), where Euler angles are singular and no "
            "torque follows from a model in them; follow a trajectory with less pitch, such as trajectory.path: "
            "cube-diagonal"
        )


@dataclass(frozen=True)
class Gains:
    """Feedback gains that make the error of a perfect model a damped oscillation, ``e'' + Kd e' + Kp e = 0``.

    Attributes
    ----------
    frequency : array, shape (3,), rad/s
        Natural frequency of roll, pitch and yaw.
    ratio : float
        Damping, 1 is critical.
    """

    frequency: Array
    ratio: float

    def feedback(self, error: Array, rate_error: Array) -> Array:
        """Compute ``Kp e + Kd e'`` with ``Kp = omega^2`` and ``Kd = 2 zeta omega``.

        Parameters
        ----------
        error, rate_error : array, shape (..., 3), rad and rad/s
            Planned less flown.

        Returns
        -------
        array, shape (..., 3), rad/s^2
        """
        return np.asarray(self.frequency**2 * error + 2 * self.ratio * self.frequency * rate_error)

    @property
    def settling_time(self) -> float:
        """Time constant of the slowest mode times 13.8: an initial error has died down to about a millionth, s."""
        slowest = float(np.min(self.frequency))
        beyond = sqrt(max(self.ratio**2 - 1, 0.0))
        return -log(_SETTLED) / (slowest * (self.ratio - beyond))


def gains(natural_frequency: tuple[float, float, float], damping: float) -> Gains:
    """Make gains from the natural frequencies of roll, pitch and yaw, Hz, and their damping."""
    return Gains(2 * pi * np.array(natural_frequency), damping)


ControlLaw = Callable[[Array, Array, Array, Array], Array]
"""Takes attitude, Euler rates, feedback and planned Euler acceleration, shape (3,) each; gives generalised torque."""


@dataclass(frozen=True)
class Controller:
    """A control law with a name."""

    name: str
    law: ControlLaw


def computed_torque(model: TorqueModel) -> ControlLaw:
    """Make the law that commands a model's torque for the wanted motion, ``tau = D(q) v + C(q, qd) qd``.

    ``v = qdd_planned + Kd e' + Kp e`` in Euler coordinates.

    References
    ----------
    Spong, Hutchinson and Vidyasagar, Robot Modeling and Control, section 9.3 (inverse dynamics).
    """

    def law(attitude: Array, rate: Array, feedback: Array, acceleration: Array) -> Array:
        return np.asarray(model.torque(Motion(attitude[None], rate[None], (acceleration + feedback)[None]))[0])

    return law


def proportional_derivative(inertia: Array) -> ControlLaw:
    """Make the law of feedback alone, ``tau_i = D_ii (Kd e'_i + Kp e_i)`` with constant D_ii.

    Parameters
    ----------
    inertia : array, shape (3,), kg m^2
        D_ii.
    """

    def law(_attitude: Array, _rate: Array, feedback: Array, _acceleration: Array) -> Array:
        return np.asarray(inertia * feedback)

    return law


@dataclass(frozen=True)
class TorqueActuators:
    """Limit and first-order lag between a commanded torque and the torque that acts.

    Attributes
    ----------
    time_constant : float, s
        Of a first-order lag; 0 for none.
    torque_max : array, shape (3,), or None, N m, body frame
        Commands are clipped to it; None for no limit.
    """

    time_constant: float = 0.0
    torque_max: Array | None = None

    def clipped(self, command: Array) -> Array:
        """Clip commands, shape (vehicle, 3), N m, to what the actuators can do."""
        return command if self.torque_max is None else np.clip(command, -self.torque_max, self.torque_max)

    def torque(self, before: Array, command: Array, after: float) -> Array:
        """Compute the torque, shape (vehicle, 3), N m, some time after a command, s."""
        return after_step(before, command, after, self.time_constant)
