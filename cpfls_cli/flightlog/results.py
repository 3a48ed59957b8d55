"""Results of an import: the signals on one clock, the flight derived from them, and the report."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from math import nan

from cpfls_cli.arrays import Array


@dataclass(frozen=True)
class DelayEstimate:
    """Delay between the torque command and the motion.

    Attributes
    ----------
    delay_s : float
        The delay whose rigid-body regression explains most of the torque.
    r2 : array, shape (3,)
        Share of the torque explained about each body axis, at that delay.
    pooled_r2 : float
        All axes together: 1 minus the geometric mean of what stays unexplained about each.
    inertia : array, shape (6,), kg m^2
        Ixx, Iyy, Izz, Ixy, Ixz, Iyz of the regression at that delay.
    delays : array, shape (delay,), s
        The delays tried.
    curve : array, shape (delay,)
        Pooled R2 at each of them.
    at_bound : bool
        True where the best delay is the longest one tried, so the true one may be longer.
    """

    delay_s: float
    r2: Array
    pooled_r2: float
    inertia: Array
    delays: Array
    curve: Array
    at_bound: bool


@dataclass(frozen=True, kw_only=True)
class ImportReport:
    """Report of an import: rows read and dropped, values repaired, filter and delay.

    Attributes
    ----------
    samples_read : int
        Rows of the log.
    samples : int
        Samples of the result.
    dropped : mapping from str to int
        Rows dropped, by reason: `time_not_finite`, `repeated_time`, `backward_time`, `crop`, `incomplete_ends`
        (before the first or after the last value of some column), `gap` (outside the part that is kept).
    missing, spikes : mapping from str to int
        Values of each column, in the part that is kept, that were absent or found to be spikes, and interpolated;
        columns without are left out. A spike in the first or the last row drops that row instead.
    suspected_spikes, saturated : mapping from str to int
        Values of each column that look like spikes, where none are to be interpolated, and values in long runs at the
        column's extremes; reported only, not changed.
    gaps : int
        Gaps in the time stamps (more than 1.5 times the median step) that were interpolated.
    cut_off_hz : mapping from str to float
        Cut-off of the low-pass filter that a signal of the log went through before it was logged, Hz, where one is
        seen; by the name in `import.signals`.
    updated_hz : mapping from str to float
        Updates a second of the signals that are updated slower than the log has rows; by the name in `import.signals`.
    longest_gap_s : float
        Longest step between time stamps in the part that is kept, s.
    span_s : tuple of float
        Begin and end of what is kept, s from the log's first time stamp.
    first_stamp_s : float
        That stamp on the log's own clock, s.
    crop_s : tuple of float or None
        Begin and end of the crop, as asked for or found; None without one.
    log_rate_hz, rate_hz : float
        Median rate of the log, and rate of the result.
    lowpass_hz : float or None
        Cut-off of the zero-phase filter that all signals went through.
    delay_s : float
        Delay by which the commands were shifted.
    delay : DelayEstimate or None
        How the delay was found, where it was estimated.
    warnings : tuple of str
        Plain sentences for the user.
    flown_at : float
        When the log begins, s since 1970 began (UTC); NaN where it does not tell.
    system : str
        What wrote the log, and its version; empty where it does not say.
    parameters : mapping from str to float
        Of the control law that flew, by the autopilot's own names.
    stated : mapping from str to str
        What the log says of its vehicle, as `stated_vehicle`.
    """

    samples_read: int
    samples: int
    dropped: Mapping[str, int]
    missing: Mapping[str, int]
    spikes: Mapping[str, int]
    suspected_spikes: Mapping[str, int]
    saturated: Mapping[str, int]
    gaps: int
    longest_gap_s: float
    span_s: tuple[float, float]
    first_stamp_s: float = 0.0
    crop_s: tuple[float, float] | None = None
    log_rate_hz: float
    rate_hz: float
    cut_off_hz: Mapping[str, float] = field(default_factory=dict)
    updated_hz: Mapping[str, float] = field(default_factory=dict)
    lowpass_hz: float | None = None
    delay_s: float = 0.0
    delay: DelayEstimate | None = None
    warnings: tuple[str, ...] = ()
    flown_at: float = nan
    system: str = ""
    parameters: Mapping[str, float] = field(default_factory=dict)
    stated: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class LogSignals:
    """Signals of a log on a uniform clock, in SI, body frame FLU, world frame ENU.

    Attributes
    ----------
    time : array, shape (time,), s
        Uniform, from 0.
    attitude : array, shape (time, 3), rad, or None
        Roll, pitch, yaw; roll and yaw without jumps of a full turn.
    body_rate : array, shape (time, 3), rad/s, body frame, or None
    body_torque : array, shape (time, 3), N m, body frame, or None
    thrust : array, shape (time,), N, along body z, or None
    position, velocity, acceleration : array, shape (time, 3), m, m/s, m/s^2, world frame, or None
    specific_force : array, shape (time, 3), m/s^2, body frame, or None
        What an accelerometer senses, `R^T (a + g e_z)`.
    rotor_speed : array, shape (time, rotor), rad/s, or None
    rotor_command : array, shape (time, rotor), SI unit of the signal's `unit`, or None
    voltage : array, shape (time,), V, or 1 as a share of the full battery's, or None
    setpoints : mapping of str to array, shape (time, column)
        What was asked for, by the names of `SETPOINTS`, neither shifted nor filtered; NaN where nothing was. Position,
        velocity, attitude and body rate as those above; thrust in N or as a share, and sticks, as logged.
    """

    time: Array
    attitude: Array | None = None
    body_rate: Array | None = None
    body_torque: Array | None = None
    thrust: Array | None = None
    position: Array | None = None
    velocity: Array | None = None
    acceleration: Array | None = None
    specific_force: Array | None = None
    rotor_speed: Array | None = None
    rotor_command: Array | None = None
    voltage: Array | None = None
    setpoints: Mapping[str, Array] = field(default_factory=dict)
    report: ImportReport = field(repr=False)

    @property
    def arrays(self) -> dict[str, Array]:
        """Signals that there are, by name, without the setpoints."""
        names = sorted({entry.name for entry in fields(self)} - {"time", "setpoints", "report"})
        return {name: getattr(self, name) for name in names if getattr(self, name) is not None}


@dataclass(frozen=True, kw_only=True)
class ImportedFlight(LogSignals):
    """A flight: the signals of the log, aligned and filtered, and what is derived from them.

    Attributes
    ----------
    attitude_rate : array, shape (time, 3), rad/s, or None
        Euler rates, ``W^-1 omega``; None without attitude.
    attitude_acceleration : array, shape (time, 3), rad/s^2, or None
        Derivative of the Euler rates.
    torque : array, shape (time, 3), N m, or None
        Generalised torque on the Euler coordinates, ``W^T tau_body``; None without attitude.
    """

    attitude_rate: Array | None = None
    attitude_acceleration: Array | None = None
    torque: Array | None = None
