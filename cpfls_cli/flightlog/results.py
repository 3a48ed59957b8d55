"""A flight as its file holds it, a source that lacks a signal leaves it out; and what an import did to make it."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, ClassVar, Final

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.flightlog.settings import SETPOINTS
from cpfls_cli.result import BODY, EULER, WORLD, About, about, described_fields, part, result

_DROPPED: Final = MappingProxyType(
    {
        "time_not_finite": "time stamp is not a number: rows dropped",
        "repeated_time": "repeated time: rows dropped",
        "backward_time": "backward time: rows dropped",
        "crop": "outside import.crop_s: rows dropped",
        "incomplete_ends": "before the first or after the last value of a column: rows dropped",
        "gap": "beyond a gap longer than import.gap_s: rows dropped",
    }
)


@result
class DelayEstimate:
    """Delay between the torque command and the motion."""

    delay_s: float = about("the delay whose rigid-body regression explains most of the torque", unit="s")
    r2: Array = about("share of the torque explained about each body axis, at that delay", "axis")
    pooled_r2: float = about("of all axes: 1 minus the geometric mean of what stays unexplained about each")
    inertia: Array = about(
        "Ixx, Iyy, Izz, Ixy, Ixz, Iyz of the regression at that delay", "moment", unit="kg m^2", brief=False
    )
    delays: Array = about("the delays tried", "delay", unit="s", brief=False)
    curve: Array = about("pooled R2 at each of them", "delay", brief=False)
    at_bound: bool = about("whether the best delay is the longest one tried, so the true one may be longer")
    low_s: float = about("lower end of its 95 % interval, by blocks", unit="s", gaps=True, default=float("nan"))
    high_s: float = about("upper end of it", unit="s", gaps=True, default=float("nan"))


@result
class ImportReport:
    """Report of an import: rows read and dropped, values repaired, filter and delay.

    Values are counted by column in the part that is kept; columns without any are left out.
    """

    samples_read: int = about("rows of the log")
    samples: int = about("samples of the result")
    dropped: Mapping[str, int] = about("rows dropped, by reason; the ends, where a column has no value, and gaps too")
    missing: Mapping[str, int] = about("values that were absent, and interpolated")
    spikes: Mapping[str, int] = about("spikes that were interpolated; one in the first or last row drops that row")
    suspected_spikes: Mapping[str, int] = about("values that look like spikes, where none are to be interpolated")
    saturated: Mapping[str, int] = about("values in long runs at the column's extremes; not changed")
    gaps: int = about("gaps in the time stamps, of more than 1.5 times the median step, that were interpolated")
    longest_gap_s: float = about("longest step between time stamps in the part that is kept", unit="s")
    span_s: tuple[float, float] = about("begin and end of what is kept, from the log's first time stamp", "2", unit="s")
    first_stamp_s: float = about("that stamp on the log's own clock", unit="s")
    crop_s: tuple[float, float] | None = about(
        "begin and end of the crop, as asked for or found; not finite where it has no end", "2", unit="s", gaps=True
    )
    log_rate_hz: float = about("median rate of the log", unit="Hz")
    rate_hz: float = about("rate of the result", unit="Hz")
    cut_off_hz: Mapping[str, float] = about("cut-off of the low-pass filter before the log, by signal", unit="Hz")
    updated_hz: Mapping[str, float] = about("updates a second of signals slower than the log's rows", unit="Hz")
    repeated: tuple[str, ...] = about("those of them whose rows repeat the last update", "signal", default=())
    lowpass_hz: float | None = about("cut-off of the zero-phase filter of all signals", unit="Hz", default=None)
    delay_s: float = about("delay by which the commands were shifted", unit="s", default=0.0)
    delay: DelayEstimate | None = part(default=None)
    warnings: tuple[str, ...] = about("plain sentences for the user", "warning", default=())
    flown_at: float = about("when the log begins, since 1970 began (UTC)", unit="s", gaps=True, default=float("nan"))
    system: str = about("what wrote the log, and its version; empty where it does not say", default="")
    parameters: Mapping[str, float] = about("of the control law that flew, by the autopilot's own names")
    stated: Mapping[str, str] = about("what the log says of its vehicle, as `stated_vehicle`")

    @property
    def findings(self) -> dict[str, int]:
        """What was found and done, with how often: rows by reason, then gaps, then values of all columns together."""
        rows = {_DROPPED[reason]: count for reason, count in self.dropped.items()}
        gaps = {f"gaps in the time stamps, up to {self.longest_gap_s:.3g} s: interpolated": self.gaps}
        values = {
            "missing: values interpolated": self.missing,
            "spikes: values interpolated": self.spikes,
            "suspected spikes: values reported only": self.suspected_spikes,
            "saturated: values reported only": self.saturated,
        }
        counts = rows | gaps | {what: sum(by_column.values()) for what, by_column in values.items()}
        return {what: count for what, count in counts.items() if count}


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

    @property
    def measured(self) -> dict[str, Array]:
        """What was measured or commanded, in the order of the alphabet."""
        return {name: own for name, own in sorted(self.signals.items()) if name not in ("time", *SETPOINTS)}

    @property
    def asked(self) -> dict[str, Array]:
        """What was asked for."""
        return {name: own for name, own in self.signals.items() if name in SETPOINTS}

    @property
    def delay_r2(self) -> Array | None:
        """Share of the torque explained about each body axis at the delay; None where the config states the delay."""
        return None if self.delay is None else self.delay.r2
