"""The artifact of a flight, simulated or measured."""

from __future__ import annotations

from typing import ClassVar

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.artifacts.spec import BODY, EULER, WORLD, Format, Record, dataset, group, record


@record
class QualityGroup:
    """What an import found in its log, and what was done about it."""

    reason: tuple[str, ...] | None = dataset(
        "reason", "what was found in the log, and what was done", "reason", default=None
    )
    count: IntArray | None = dataset("count", "rows, gaps or values by reason", "reason", default=None)
    warning: tuple[str, ...] | None = dataset("warning", "what to know about the log", "warning", default=None)


@record
class DelayGroup:
    """Delay of motion behind command, and its estimate."""

    value: float = dataset("value", "delay of motion behind command, taken out", units="s")
    tried: Array | None = dataset("tried", "delays tried by the estimate", "tried", units="s", default=None)
    r2: Array | None = dataset("r2", "R2 of the rigid body by delay, axes together", "tried", default=None)


@record
class NoiseGroup:
    """Noise that a simulation added."""

    signal: tuple[str, ...] = dataset("signal", "signals with added noise", "noisy")
    std: Array = dataset("std", "standard deviation added", "noisy", "axis", units="SI")


@record
class FlownEffectsGroup:
    """Effects that a simulation flew beyond its model."""

    name: tuple[str, ...] = dataset("name", "what was flown beyond the model, by value", "flown")
    value: Array = dataset("value", "the true value of each", "flown", units="SI")


@record
class TrackingGroup:
    """Attitude controllers that were compared on a flight."""

    controller: tuple[str, ...] = dataset("controller", "model, rigid-body, pd, vehicle: the model flies", "controller")
    time: Array = dataset("time", "samples of the plan; the flight ends where it was lost", "tracked", units="s")
    error: Array = dataset(
        "error", "planned less flown angles", "controller", "tracked", "axis", units="rad", frame=EULER, gaps=True
    )
    settled_from: float = dataset(
        "settled_from", "when the initial error has died down, from the first sample", units="s"
    )
    rms: Array = dataset(
        "rms",
        "root mean square error; not finite where lost",
        "controller",
        "axis",
        units="rad",
        frame=EULER,
        gaps=True,
    )
    settled_rms: Array = dataset(
        "settled_rms",
        "the same of the samples after that time",
        "controller",
        "axis",
        units="rad",
        frame=EULER,
        gaps=True,
    )
    max_error: Array = dataset("max_error", "largest error", "controller", "axis", units="rad", frame=EULER, gaps=True)
    settled_max: Array = dataset(
        "settled_max", "largest error after that time", "controller", "axis", units="rad", frame=EULER, gaps=True
    )
    torque_rms: Array = dataset(
        "torque_rms", "root mean square of the torque", "controller", "axis", units="N m", frame=BODY, gaps=True
    )
    clipped: Array = dataset("clipped", "share of the commands clipped to the largest torque", "controller")
    lost_at: Array = dataset("lost_at", "time of a loss; not finite where none", "controller", units="s", gaps=True)
    control_rate: float = dataset("control_rate", "commands in a second", units="1/s")
    outside: BoolArray = dataset("outside", "1 where the flight leaves what the model's training visited", "time")
    not_positive_definite: int = dataset("not_positive_definite", "samples of the flight where no body has the D(q)")


@record
class FlightRecord(Record):
    """The artifact `cpfls/flight`."""

    FORMAT: ClassVar = Format(
        "cpfls/flight",
        "a flight, simulated or measured; a source that lacks a signal leaves it out",
        "simulate, import",
        ("trajectory", "model", "log"),
    )

    time: Array = dataset("time", "time from the first sample", "time", units="s")
    attitude: Array | None = dataset(
        "attitude", "roll, pitch, yaw q", "time", "axis", units="rad", frame=EULER, default=None
    )
    attitude_rate: Array | None = dataset(
        "attitude_rate", "Euler rates qd", "time", "axis", units="rad/s", frame=EULER, default=None
    )
    attitude_acceleration: Array | None = dataset(
        "attitude_acceleration", "Euler accelerations qdd", "time", "axis", units="rad/s^2", frame=EULER, default=None
    )
    body_rate: Array | None = dataset(
        "body_rate", "body rates p, q, r", "time", "axis", units="rad/s", frame=BODY, default=None
    )
    torque: Array | None = dataset(
        "torque", "generalised torque, W^T body_torque", "time", "axis", units="N m", frame=EULER, default=None
    )
    body_torque: Array | None = dataset(
        "body_torque", "torque about the body axes", "time", "axis", units="N m", frame=BODY, default=None
    )
    thrust: Array | None = dataset("thrust", "total thrust along body z", "time", units="N", frame=BODY, default=None)
    position: Array | None = dataset("position", "position", "time", "axis", units="m", frame=WORLD, default=None)
    velocity: Array | None = dataset("velocity", "velocity", "time", "axis", units="m/s", frame=WORLD, default=None)
    acceleration: Array | None = dataset(
        "acceleration", "acceleration", "time", "axis", units="m/s^2", frame=WORLD, default=None
    )
    specific_force: Array | None = dataset(
        "specific_force",
        "what an accelerometer senses: +g along z in hover",
        "time",
        "axis",
        units="m/s^2",
        frame=BODY,
        default=None,
    )
    rotor_speed: Array | None = dataset(
        "rotor_speed", "rotor speeds", "time", "rotor", units="rad/s", frame=BODY, gaps=True, default=None
    )
    rotor_command: Array | None = dataset(
        "rotor_command",
        "commands to the rotors; rad/s if simulated, else aligned, filtered, in import.signals.rotor_command.unit",
        "time",
        "rotor",
        units="SI",
        frame=BODY,
        default=None,
    )
    voltage: Array | None = dataset(
        "voltage",
        "of the battery: V; share of the full one if simulated or where import.signals.voltage.unit is 1",
        "time",
        units="SI",
        default=None,
    )
    quality: QualityGroup | None = group("quality", default=None)
    delay: DelayGroup | None = group("delay", default=None)
    noise: NoiseGroup | None = group("noise", default=None)
    effects: FlownEffectsGroup | None = group("effects", default=None)
    tracking: TrackingGroup | None = group("tracking", default=None)
