"""Settings of an attitude path of full rotations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Gt, Le
from typing_extensions import Doc

from cpfls_cli.settings import Settings

_Turns = Annotated[int, Ge(-10_000), Le(10_000)]
_Torque = Annotated[float, Gt(0)]


@dataclass(frozen=True, kw_only=True)
class RotationSettings(Settings):
    """Describe a periodic path on which roll, pitch and yaw turn through complete circles.

    Every limit holds at all times for each component: those on rate and acceleration for the Euler angles and for
    the body alike.
    """

    turns: Annotated[
        tuple[_Turns, _Turns, _Turns] | None,
        Doc("complete turns of roll, pitch and yaw over the duration, negative backwards; null chooses them"),
    ] = None
    frequency_max_hz: Annotated[
        float, Gt(0), Doc("highest frequency of the harmonics that are superposed on the turns, Hz")
    ] = 0.5
    rate_max_rad_s: Annotated[float, Gt(0), Doc("largest rate of an Euler angle and of the body, rad/s")] = 6.0
    acceleration_max_rad_s2: Annotated[
        float, Gt(0), Doc("largest acceleration of an Euler angle and of the body, rad/s^2")
    ] = 12.0
    torque_max_n_m: Annotated[
        tuple[_Torque, _Torque, _Torque] | None,
        Doc("largest torque on the body about x, y, z that the motion may ask for, N m; null: no limit"),
    ] = None
    starts: Annotated[int, Ge(1), Doc("random paths of an optimised path, the best of which is improved")] = 10
    iterations: Annotated[int, Ge(0), Doc("steps of gradient descent that improve an optimised path")] = 400
