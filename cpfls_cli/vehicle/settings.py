"""Settings of a multirotor: mass, inertia and a list of rotors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from annotated_types import Gt, MinLen
from typing_extensions import Doc

from cpfls_cli.errors import SettingError
from cpfls_cli.inertia import symmetric
from cpfls_cli.settings import Settings

_Moment = Annotated[float, Gt(0)]
Unknown = Literal["thrust_factor", "drag_factor", "inertia"]
"""Numbers of a vehicle that hardly anybody knows, and that flights identify."""


@dataclass(frozen=True, kw_only=True)
class RotorSettings(Settings):
    """Describe one rotor whose thrust points along body z."""

    position_m: Annotated[
        tuple[float, float, float], Doc("hub relative to the centre of mass, m; body frame x forward, y left, z up")
    ] = (0.3, 0.0, 0.0)
    spin: Annotated[
        Literal[1, -1],
        Doc("1 turns counter-clockwise seen from above, -1 clockwise; the body feels -spin * b * speed^2 about z"),
    ] = 1
    thrust_factor_n_s2: Annotated[float, Gt(0), Doc("thrust over squared speed k, N s^2")] = 121.5e-6
    drag_factor_n_m_s2: Annotated[float, Gt(0), Doc("reaction torque over squared speed b, N m s^2")] = 2.7e-6
    radius_m: Annotated[Annotated[float, Gt(0)] | None, Doc("radius of the propeller, m; null if not known")] = None


_QUAD_PLUS = (
    RotorSettings(position_m=(0.3, 0.0, 0.0), spin=1),
    RotorSettings(position_m=(0.0, -0.3, 0.0), spin=-1),
    RotorSettings(position_m=(-0.3, 0.0, 0.0), spin=1),
    RotorSettings(position_m=(0.0, 0.3, 0.0), spin=-1),
)


@dataclass(frozen=True, kw_only=True)
class VehicleSettings(Settings):
    """Describe a multirotor; the defaults are the quadrotor of Table 3 of the paper."""

    gravity_m_s2: Annotated[float, Gt(0), Doc("gravitational acceleration, m/s^2")] = 9.81
    mass_kg: Annotated[float, Gt(0), Doc("mass, kg")] = 6.0
    inertia_kg_m2: Annotated[
        tuple[_Moment, _Moment, _Moment] | tuple[_Moment, _Moment, _Moment, float, float, float],
        Doc("inertia tensor, kg m^2: Ixx, Iyy, Izz, or Ixx, Iyy, Izz, Ixy, Ixz, Iyz with the sign of the entry"),
    ] = (0.6, 0.6, 1.2)
    rotors: Annotated[tuple[RotorSettings, ...], MinLen(1), Doc("the rotors, one entry each")] = _QUAD_PLUS
    rotor_speed_max_rad_s: Annotated[float, Gt(0), Doc("largest speed of a rotor, rad/s")] = 1000.0
    unknown: Annotated[
        tuple[Unknown, ...],
        Doc("numbers above that are guesses, for `cpfls vehicle` to find; a null in their place says the same"),
    ] = ()

    def __post_init__(self) -> None:
        """Refuse an inertia of which a moment is not positive, or that is not positive definite."""
        if len(self.inertia_kg_m2) not in (3, 6):
            raise SettingError("inertia_kg_m2", "give 3 moments of inertia, or 3 moments and 3 off-diagonal entries")
        if not min(self.inertia_kg_m2[:3]) > 0:
            raise SettingError("inertia_kg_m2", "the moments of inertia Ixx, Iyy, Izz must be greater than 0")
        smallest = np.linalg.eigvalsh(symmetric(self.inertia_kg_m2)).min()
        if not smallest > 0:
            message = f"is not positive definite (smallest principal moment {smallest:.6g}); lower Ixy, Ixz or Iyz"
            raise SettingError("inertia_kg_m2", message)
