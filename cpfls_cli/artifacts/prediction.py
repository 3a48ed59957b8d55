"""The artifact of a prediction along a flight."""

from __future__ import annotations

from typing import ClassVar

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.artifacts.spec import BODY, EULER, Format, Record, dataset, record


@record
class PredictionRecord(Record):
    """The artifact `cpfls/prediction`."""

    FORMAT: ClassVar = Format(
        "cpfls/prediction",
        "torque, inertia matrix and Coriolis matrix of a model along a flight",
        "predict",
        ("model", "flight"),
    )

    time: Array = dataset("time", "time from the first sample", "time", units="s")
    attitude: Array = dataset("attitude", "roll, pitch, yaw of the flight", "time", "axis", units="rad", frame=EULER)
    torque: Array = dataset("torque", "generalised torque of the model", "time", "axis", units="N m", frame=EULER)
    body_torque: Array = dataset("body_torque", "body torque of the model", "time", "axis", units="N m", frame=BODY)
    measured_torque: Array | None = dataset(
        "measured_torque", "generalised torque of the flight", "time", "axis", units="N m", frame=EULER, default=None
    )
    error: Array | None = dataset(
        "error", "measured minus model torque", "time", "axis", units="N m", frame=EULER, default=None
    )
    inertia: Array = dataset("inertia", "inertia matrix D_ij(q)", "time", "axis", "axis", units="kg m^2", frame=EULER)
    inertia_low: Array | None = dataset(
        "inertia_low", "lower end of its 95 % band", "time", "axis", "axis", units="kg m^2", frame=EULER, default=None
    )
    inertia_high: Array | None = dataset(
        "inertia_high", "upper end of its 95 % band", "time", "axis", "axis", units="kg m^2", frame=EULER, default=None
    )
    torque_low: Array | None = dataset(
        "torque_low",
        "lower end of the 95 % band of the model torque",
        "time",
        "axis",
        units="N m",
        frame=EULER,
        default=None,
    )
    torque_high: Array | None = dataset(
        "torque_high",
        "upper end of the 95 % band of the model torque",
        "time",
        "axis",
        units="N m",
        frame=EULER,
        default=None,
    )
    coriolis: Array = dataset(
        "coriolis", "C(q, qd) by Christoffel symbols", "time", "axis", "axis", units="kg m^2/s", frame=EULER
    )
    outside: BoolArray = dataset("outside", "1 where the attitude lies outside the excited region", "time")
