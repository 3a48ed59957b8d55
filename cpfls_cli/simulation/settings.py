"""Settings of the simulation."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Annotated, Literal

from annotated_types import Ge, Gt, Le
from typing_extensions import Doc

from cpfls_cli.autopilots.law import Law
from cpfls_cli.autopilots.registry import AUTOPILOTS, AutopilotName
from cpfls_cli.errors import InputError, SettingError
from cpfls_cli.settings import Settings

NoisySignal = Literal[
    "attitude",
    "attitude_rate",
    "attitude_acceleration",
    "torque",
    "body_torque",
    "position",
    "velocity",
    "acceleration",
    "rotor_speed",
    "body_rate",
    "rotor_command",
    "voltage",
]

# Inverse dynamics has body rates that follow from the attitude, and nothing is commanded.
_NO_SENSOR = frozenset({"body_rate", "rotor_command", "voltage"})
"""What a flight in mode inverse lacks."""


@dataclass(frozen=True, kw_only=True)
class ClosedLoopSettings(Settings):
    """The autopilot, the actuators, and what the flown vehicle has that its model lacks."""

    effects: Annotated[
        dict[str, tuple[float, ...] | dict[str, float]],
        Doc("effects to fly by name (`cpfls effects`): a list of coefficients, then shapes, or values by name"),
    ] = field(default_factory=dict)
    gusts: Annotated[
        bool, Doc("play the gusts that the model of `--model` holds, which `cpfls vehicle` found in its flights")
    ] = False
    rotor_time_constant_s: Annotated[
        float, Gt(0), Doc("time in which the rotors reach 63 % of a step, s; the effect motor_lag replaces it")
    ] = 0.05
    integration_rate_hz: Annotated[
        float,
        Gt(0),
        Le(1e5),
        Doc("steps of the integration in a second, at least one for each sample of the trajectory"),
    ] = 500.0
    autopilot: Annotated[
        Literal["cpfls", AutopilotName],
        Doc(
            "who flies: cpfls, with an attitude control that knows the vehicle; or the attitude and rate control of an "
            "autopilot below the same position control"
        ),
    ] = "cpfls"
    autopilot_parameters: Annotated[
        dict[str, float], Doc("its parameters by its own names; others at their defaults")
    ] = field(default_factory=dict)
    position_frequency_hz: Annotated[float, Gt(0), Doc("natural frequency of the position control, Hz")] = 0.25
    position_damping: Annotated[float, Gt(0), Doc("damping of the position control, 1 is critical")] = 0.9
    attitude_frequency_hz: Annotated[float, Gt(0), Doc("natural frequency of roll and pitch control, Hz")] = 1.2
    attitude_damping: Annotated[float, Gt(0), Doc("damping of the attitude control, 1 is critical")] = 0.8
    yaw_frequency_hz: Annotated[float, Gt(0), Doc("natural frequency of the yaw control, Hz")] = 0.5
    battery_use: Annotated[
        float, Ge(0), Le(0.9), Doc("share of its voltage that the battery loses by the end; for battery_sag")
    ] = 0.2
    battery_load: Annotated[
        float, Ge(0), Le(0.5), Doc("share of its voltage that the battery loses under twice the hover power")
    ] = 0.02
    deviation_max_m: Annotated[float, Gt(0), Doc("distance from the path at which the flight is given up, m")] = 50.0

    def __post_init__(self) -> None:
        """Refuse parameters that the autopilot has not, or parameters without an autopilot."""
        if self.autopilot == "cpfls" and self.autopilot_parameters:
            raise SettingError("autopilot_parameters", "are those of px4 and others; name one as closed_loop.autopilot")
        try:
            _ = self.law
        except InputError as error:
            raise SettingError("autopilot_parameters", str(error)) from None

    @cached_property
    def law(self) -> Law | None:
        """The control law of the autopilot; None for cpfls's own."""
        return None if self.autopilot == "cpfls" else AUTOPILOTS[self.autopilot].law(self.autopilot_parameters)


@dataclass(frozen=True, kw_only=True)
class SimulationSettings(Settings):
    """How a flight is simulated, and what it gets besides the vehicle's exact dynamics."""

    mode: Annotated[
        Literal["inverse", "closed-loop"],
        Doc("inverse: the torques of the planned motion itself; closed-loop: an autopilot flies it, sensors log it"),
    ] = "inverse"
    noise: Annotated[
        dict[NoisySignal, Annotated[float, Ge(0)]],
        Doc("standard deviation of white noise by signal, in SI units; none if empty"),
    ] = field(default_factory=dict)
    relative_noise: Annotated[
        dict[NoisySignal, Annotated[float, Ge(0)]],
        Doc("the same as a share of each channel's own standard deviation, 0.05 is 5 %"),
    ] = field(default_factory=dict)
    infeasible: Annotated[
        Literal["stop", "report"],
        Doc(
            "a rotor asked for negative squared speed or more than its limit: stop, or go on with a gap in rotor_speed"
        ),
    ] = "stop"
    closed_loop: Annotated[ClosedLoopSettings, Doc("for mode closed-loop")] = ClosedLoopSettings()

    def __post_init__(self) -> None:
        """Refuse what a mode cannot do: effects, gusts, or noise of sensors that it lacks.

        Nor does it take noise both of body and of generalised torque, of which one follows from the other.
        """
        for key in ("noise", "relative_noise"):
            self._check_noise(key, {str(name) for name in getattr(self, key)})
        if self.mode != "closed-loop" and self.closed_loop.effects:
            raise SettingError("closed_loop.effects", "effects are flown in closed loop only; add --mode closed-loop")
        if self.mode != "closed-loop" and self.closed_loop.gusts:
            raise SettingError("closed_loop.gusts", "gusts are flown in closed loop only; add --mode closed-loop")

    def _check_noise(self, key: str, signals: set[str]) -> None:
        if "body_torque" in signals and "torque" in {*self.noise, *self.relative_noise}:
            raise SettingError(key, "body_torque: torque has noise too, and one follows from the other; remove one")
        if self.mode != "inverse" and "body_torque" in signals:
            raise SettingError(key, f"body_torque: in mode {self.mode} it follows from torque; give torque the noise")
        extra = ", ".join(sorted(_NO_SENSOR & signals))
        if extra and self.mode == "inverse":
            raise SettingError(key, f"{extra}: only a flight in mode closed-loop has this sensor")
