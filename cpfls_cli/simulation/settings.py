"""Settings of the simulation."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Literal

from annotated_types import Ge
from typing_extensions import Doc

from cpfls_cli.settings import Settings

NoisySignal = Literal[
    "attitude",
    "attitude_rate",
    "attitude_acceleration",
    "torque",
    "position",
    "velocity",
    "acceleration",
    "rotor_speed",
]


@dataclass(frozen=True, kw_only=True)
class SimulationSettings(Settings):
    """What a simulated flight gets beside the vehicle's exact dynamics."""

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
