"""A flight as its file holds it, simulated or imported from a log; a source that lacks a signal leaves it out."""

from __future__ import annotations

from collections.abc import Container, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.gate import Origin, read_origin
from cpfls_cli.errors import InputError
from cpfls_cli.flightlog.results import ImportedFlight, ImportReport
from cpfls_cli.flightlog.settings import SETPOINTS
from cpfls_cli.regressor.regressor import Motion
from cpfls_cli.result import BODY, EULER, WORLD, About, about, described_fields, part, result
from cpfls_cli.store import read

if TYPE_CHECKING:
    from cpfls_cli.simulation.measured import MeasuredFlight, SimulatedFlight
    from cpfls_cli.simulation.model import SimulatedEffects
    from cpfls_cli.vehicle.rotors import RotorViolation

MOTION = ("attitude", "attitude_rate", "attitude_acceleration")
"""Fields of trajectories and flights that hold Euler angles and their derivatives."""


def _signal(text: str, *axes: str, **more: Any) -> Any:
    return about(text, "time", *axes, default=None, brief=False, **more)


@result
class Flight:
    """A flight: its signals on one clock."""

    FORMAT: ClassVar = "cpfls/flight"
    STREAMED: ClassVar = "time"
    MADE_BY: ClassVar = "simulate or import"

    time: Array = about("time from the first sample", "time", unit="s", ascends=True, brief=False)
    attitude: Array | None = _signal("roll, pitch, yaw q", "axis", unit="rad", frame=EULER)
    attitude_rate: Array | None = _signal("Euler rates qd", "axis", unit="rad/s", frame=EULER)
    attitude_acceleration: Array | None = _signal("Euler accelerations qdd", "axis", unit="rad/s^2", frame=EULER)
    body_rate: Array | None = _signal("body rates p, q, r", "axis", unit="rad/s", frame=BODY)
    torque: Array | None = _signal("generalised torque, W^T body_torque", "axis", unit="N m", frame=EULER)
    body_torque: Array | None = _signal("torque about the body axes", "axis", unit="N m", frame=BODY)
    thrust: Array | None = _signal("total thrust along body z", unit="N", frame=BODY)
    position: Array | None = _signal("position", "axis", unit="m", frame=WORLD)
    velocity: Array | None = _signal("velocity", "axis", unit="m/s", frame=WORLD)
    acceleration: Array | None = _signal("acceleration", "axis", unit="m/s^2", frame=WORLD)
    specific_force: Array | None = _signal(
        "what an accelerometer senses: +g along z in hover", "axis", unit="m/s^2", frame=BODY
    )
    rotor_speed: Array | None = _signal("rotor speeds", "rotor", unit="rad/s", frame=BODY, gaps=True)
    rotor_command: Array | None = _signal(
        "commands to the rotors; rad/s if simulated, else aligned, filtered, in import.signals.rotor_command.unit",
        "rotor",
        unit="SI",
        frame=BODY,
    )
    voltage: Array | None = _signal(
        "of the battery: V; share of the full one if simulated or where import.signals.voltage.unit is 1", unit="SI"
    )
    setpoint_position: Array | None = _signal(
        "position setpoint; not finite where there is none", "axis", unit="m", frame=WORLD, gaps=True
    )
    setpoint_velocity: Array | None = _signal("velocity setpoint", "axis", unit="m/s", frame=WORLD, gaps=True)
    setpoint_attitude: Array | None = _signal("roll, pitch, yaw setpoints", "axis", unit="rad", frame=EULER, gaps=True)
    setpoint_body_rate: Array | None = _signal("body rate setpoints", "axis", unit="rad/s", frame=BODY, gaps=True)
    setpoint_thrust: Array | None = _signal(
        "thrust setpoint: N, or share of the largest where import.signals.setpoint_thrust.unit is 1",
        unit="SI",
        frame=BODY,
        gaps=True,
    )
    sticks: Array | None = _signal(
        "roll, pitch, yaw and, where it counts alike, throttle of the pilot, shares of full deflection as logged",
        "stick",
        gaps=True,
    )
    begins: float = about("stamp of the log's own clock at time 0", unit="s", gaps=True, default=np.nan)

    @classmethod
    def about_signals(cls) -> dict[str, About]:
        """Describe time and the signals that a flight can hold, by name."""
        known = ((own.name, own.about) for own in described_fields(Flight) if own.name != "begins")
        return {name: described for name, described in known if described}

    @property
    def signals(self) -> dict[str, Array]:
        """Time and the signals that it holds, by the names of the fields."""
        return {name: values for name in self.about_signals() if (values := getattr(self, name)) is not None}

    @property
    def setpoints(self) -> dict[str, int]:
        """Samples at which each setpoint that it holds is known, by the names of `SETPOINTS`."""
        held = {short: values for name, short in SETPOINTS.items() if (values := getattr(self, name)) is not None}
        known = {name: np.isfinite(values.reshape(len(values), -1)).all(axis=1) for name, values in held.items()}
        return {name: int(np.sum(own)) for name, own in known.items()}

    @property
    def motion(self) -> Motion:
        """Euler angles and their derivatives, of a flight that holds all of `MOTION`."""
        assert self.attitude is not None, "the flight has no attitude"
        assert self.attitude_rate is not None, "the flight has no Euler rates"
        assert self.attitude_acceleration is not None, "the flight has no Euler accelerations"
        return Motion(self.attitude, self.attitude_rate, self.attitude_acceleration)

    @property
    def max_torque(self) -> list[float]:
        """Largest generalised torque on roll, pitch and yaw, N m; empty where it holds no torque."""
        return [] if self.torque is None else np.max(np.abs(self.torque), axis=0).tolist()

    @property
    def turns(self) -> bool:
        """Whether roll or pitch goes round the circle."""
        if self.attitude is None or self.attitude_rate is None:
            return False
        return bool(np.ptp(self.attitude[:, :2], axis=0).max() > 2 * np.pi)

    @property
    def has_rotors(self) -> bool:
        """Whether speeds of rotors, or commands to them, are known."""
        return self.rotor_speed is not None or self.rotor_command is not None

    @property
    def lacks(self) -> tuple[str, ...]:
        """What later commands will miss: ``attitude``, ``rotation`` (of any kind), ``torque``."""
        missing = {
            "attitude": self.attitude is None,
            "rotation": self.attitude is None and self.body_rate is None,
            "torque": self.torque is None and self.body_torque is None,
        }
        return tuple(name for name, lacking in missing.items() if lacking)


@result
class Imported(Flight, ImportReport):
    """A flight imported from a log, and what the import did."""

    SHOWN: ClassVar = ("max_torque", "setpoints", "delay_r2")

    contradictions: tuple[str, ...] = about(
        "what contradicts itself, or the vehicle of the config", "contradiction", default=()
    )

    @classmethod
    def of(cls, flight: ImportedFlight) -> Self:
        """Put signals and report of an import together."""
        report = flight.report
        names = [name for name in cls.about_signals() if name not in SETPOINTS]
        asked = {name: flight.setpoints[short] for name, short in SETPOINTS.items() if short in flight.setpoints}
        if "setpoint_thrust" in asked:
            asked["setpoint_thrust"] = asked["setpoint_thrust"][:, 0]
        given: dict[str, Any] = {name: getattr(flight, name) for name in names} | asked | vars(report)
        return cls(**given, begins=report.first_stamp_s + report.span_s[0])

    @property
    def delay_r2(self) -> Array | None:
        """Share of the torque explained about each body axis at the delay; None where the config states the delay."""
        return None if self.delay is None else self.delay.r2


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
