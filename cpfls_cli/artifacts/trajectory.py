"""The artifact of a planned path."""

from __future__ import annotations

from typing import ClassVar

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.spec import BODY, EULER, WORLD, Format, Record, dataset, group, record


@record
class LegGroup:
    """Moves of the path."""

    begin: Array = dataset("begin", "when each move leaves its rest", "leg", units="s")
    end: Array = dataset("end", "when each move is at rest again", "leg", units="s")
    displacement: Array = dataset("displacement", "displacement of each move", "leg", "axis", units="m", frame=WORLD)
    limited_by: tuple[str, ...] = dataset(
        "limited_by", "derivatives that reach their limit; empty where a move was not planned under limits", "leg"
    )


@record
class TrajectoryRecord(Record):
    """The artifact `cpfls/trajectory`."""

    FORMAT: ClassVar = Format(
        "cpfls/trajectory",
        "a planned path with all its derivatives and the attitude that flies it; "
        "without a position the vehicle is held at its centre of mass and only turns",
        "trajectory",
        ("waypoints",),
    )

    time: Array = dataset("time", "time from the first sample", "time", units="s")
    position: Array | None = dataset("position", "position", "time", "axis", units="m", frame=WORLD, default=None)
    velocity: Array | None = dataset("velocity", "velocity", "time", "axis", units="m/s", frame=WORLD, default=None)
    acceleration: Array | None = dataset(
        "acceleration", "acceleration", "time", "axis", units="m/s^2", frame=WORLD, default=None
    )
    jerk: Array | None = dataset(
        "jerk", "third derivative of position", "time", "axis", units="m/s^3", frame=WORLD, default=None
    )
    snap: Array | None = dataset(
        "snap", "fourth derivative of position", "time", "axis", units="m/s^4", frame=WORLD, default=None
    )
    crackle: Array | None = dataset(
        "crackle", "fifth derivative of position", "time", "axis", units="m/s^5", frame=WORLD, default=None
    )
    pop: Array | None = dataset(
        "pop", "sixth derivative of position", "time", "axis", units="m/s^6", frame=WORLD, default=None
    )
    yaw: Array = dataset("yaw", "planned yaw", "time", units="rad", frame=EULER)
    yaw_rate: Array = dataset("yaw_rate", "derivative of yaw", "time", units="rad/s", frame=EULER)
    yaw_acceleration: Array = dataset(
        "yaw_acceleration", "second derivative of yaw", "time", units="rad/s^2", frame=EULER
    )
    attitude: Array = dataset("attitude", "roll, pitch, yaw q", "time", "axis", units="rad", frame=EULER)
    attitude_rate: Array = dataset("attitude_rate", "Euler rates qd", "time", "axis", units="rad/s", frame=EULER)
    attitude_acceleration: Array = dataset(
        "attitude_acceleration", "Euler accelerations qdd", "time", "axis", units="rad/s^2", frame=EULER
    )
    body_rate: Array = dataset("body_rate", "body rates p, q, r", "time", "axis", units="rad/s", frame=BODY)
    leg: LegGroup | None = group("leg", default=None)
