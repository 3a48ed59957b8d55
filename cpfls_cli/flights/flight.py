"""Flights as their files hold them: simulated ones with what is known of their truth, and which kind a file is."""

from __future__ import annotations

from collections.abc import Container, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.gate import Origin, read_origin
from cpfls_cli.errors import InputError
from cpfls_cli.flightlog.results import Flight, Imported
from cpfls_cli.result import about, part, result
from cpfls_cli.store import read

if TYPE_CHECKING:
    from cpfls_cli.simulation.measured import MeasuredFlight, SimulatedFlight
    from cpfls_cli.simulation.model import SimulatedEffects
    from cpfls_cli.vehicle.rotors import RotorViolation

MOTION = ("attitude", "attitude_rate", "attitude_acceleration")
"""Fields of trajectories and flights that hold Euler angles and their derivatives."""


@result
class Noise:
    """Noise that was added to a signal."""

    std: Array = about("standard deviation of each channel", "channel", unit="SI")


@result
class Tracking:
    """How far an autopilot was off its path."""

    position_rms_m: float = about("root mean square of the distance", unit="m")
    position_max_m: float = about("largest distance", unit="m")
    attitude_rms_rad: Array = about("root mean square of roll, pitch, yaw", "axis", unit="rad")

    @classmethod
    def of(cls, flight: MeasuredFlight) -> Self:
        """Compare the motion of a simulated flight with its plan."""
        away = np.linalg.norm(flight.position_error, axis=1)
        return cls(
            position_rms_m=float(np.sqrt(np.mean(away**2))),
            position_max_m=float(away.max()),
            attitude_rms_rad=np.sqrt(np.mean(flight.attitude_error**2, axis=0)),
        )


@result
class Infeasible:
    """Samples at which a rotor was asked for what it cannot do."""

    rotor: int = about("number of the rotor, from 1")
    kind: str = about("``negative squared speed`` or ``above the limit``")
    first_s: float = about("first of them", unit="s")
    last_s: float = about("last of them", unit="s")
    samples: int = about("how many, which need not be all between")
    worst: float = about("squared speed that is farthest off", unit="rad^2/s^2")

    @classmethod
    def of(cls, violation: RotorViolation, time: Array) -> Self:
        """Describe them by the times of samples."""
        return cls(
            rotor=violation.rotor + 1,
            kind=violation.kind,
            first_s=float(time[violation.first]),
            last_s=float(time[violation.last]),
            samples=violation.count,
            worst=violation.worst,
        )


@result
class Simulated(Flight):
    """A simulated flight, and what is known of its truth."""

    SHOWN: ClassVar = ("samples", "max_torque", "setpoints", "noise")

    noise_std: Mapping[str, Noise] = part()
    infeasible: tuple[Infeasible, ...] = part()
    effects: Mapping[str, float] = about("true values of what was flown beyond the model, by `effect.coefficient`")
    tracking: Tracking | None = part(default=None)

    @classmethod
    def of(cls, time: Array, flight: SimulatedFlight) -> Self:
        """Describe a flight of the exact vehicle, or one in closed loop as logged."""
        signals: dict[str, Any] = dict(flight.signals)
        return cls(
            time=time,
            noise_std={name: Noise(std=np.atleast_1d(std)) for name, std in flight.noise_std.items()},
            infeasible=tuple(Infeasible.of(one, time) for one in flight.violations),
            effects={},
            **signals,
        )

    @property
    def samples(self) -> int:
        """Samples of the flight."""
        return len(self.time)

    @property
    def noise(self) -> list[str]:
        """Signals with added noise."""
        return sorted(self.noise_std)


def read_whole(path: Path) -> tuple[Imported | Simulated, Origin]:
    """Read a flight with all that is known of it, and where it comes from."""
    return read(path, Imported) if "log" in read_origin(path).inputs else read(path, Simulated)


def require_signals(path: Path, held: Container[str], *needed: str) -> None:
    """Refuse a flight that lacks what is needed."""
    missing = [name for name in needed if name not in held]
    if missing:
        raise InputError(f"{path}: lacks {', '.join(missing)}; this stage needs {', '.join(needed)}")


def values_of(effects: SimulatedEffects) -> dict[str, float]:
    """Give the values of effects by ``effect.coefficient``; an effect without numbers is 1."""
    return {
        name: value
        for flown in effects.listed
        for name, value in (
            {f"{flown.effect.name}.{entry}": value for entry, value in flown.values.items()} or {flown.effect.name: 1.0}
        ).items()
    }
