"""Results of an import: the signals on one clock, the flight derived from them, and the report."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from cpfls_cli.arrays import Array
from cpfls_cli.result import about, part, result

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


@dataclass(frozen=True, kw_only=True, eq=False)
class ImportedFlight:
    """Signals of a log on a uniform clock, in SI, body frame FLU, world frame ENU; None where the log lacks one.

    Shapes are (time, 3), of thrust and voltage (time,), of rotors (time, rotor); the flight's file describes each
    (`flights.flight.Flight`). What is derived with an attitude is None until then.
    """

    time: Array  # Shape (time,), s, from 0.
    attitude: Array | None = None  # Roll, pitch, yaw, rad; roll and yaw without jumps of a full turn.
    body_rate: Array | None = None
    body_torque: Array | None = None
    thrust: Array | None = None
    position: Array | None = None
    velocity: Array | None = None
    acceleration: Array | None = None  # Over ground.
    specific_force: Array | None = None  # What an accelerometer senses, R^T (a + g e_z).
    rotor_speed: Array | None = None
    rotor_command: Array | None = None  # In the SI unit of the signal's `unit`.
    voltage: Array | None = None  # V, or 1 as a share of the full battery's.
    # What was asked for, by the names of `SETPOINTS`, shape (time, column), neither shifted nor filtered; NaN where
    # nothing was.
    setpoints: Mapping[str, Array]
    report: ImportReport
    # Derived: Euler rates W^-1 omega, rad/s, their derivatives, and the generalised torque on the Euler coordinates,
    # W^T tau_body, N m.
    attitude_rate: Array | None = None
    attitude_acceleration: Array | None = None
    torque: Array | None = None

    @property
    def arrays(self) -> dict[str, Array]:
        """Signals that there are, by name, without the setpoints."""
        held = {name: own for name, own in vars(self).items() if name not in ("time", "setpoints", "report")}
        return {name: held[name] for name in sorted(held) if held[name] is not None}
