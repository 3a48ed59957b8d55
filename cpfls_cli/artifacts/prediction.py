"""The artifact of a prediction along a flight."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.artifacts.spec import BODY, EULER, Format, Record, dataset, record

if TYPE_CHECKING:
    from cpfls_cli.identification.judge import Score
    from cpfls_cli.identification.model import Model
    from cpfls_cli.regressor.motion import Motion
    from cpfls_cli.validation.bootstrap import Draws


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
        "measured_torque",
        "generalised torque that the model is held against",
        "time",
        "axis",
        units="N m",
        frame=EULER,
        default=None,
    )
    error: Array | None = dataset(
        "error", "measured minus model torque", "time", "axis", units="N m", frame=EULER, default=None
    )
    held_against: str | None = dataset(
        "held_against",
        "of a whole vehicle, what measured_torque is: motion, which takes it with the model's inertia, or recorded",
        default=None,
    )
    force: Array | None = dataset(
        "force", "force of a whole vehicle, without weight", "time", "axis", units="N", frame=BODY, default=None
    )
    measured_force: Array | None = dataset(
        "measured_force",
        "force that the motion takes, without weight",
        "time",
        "axis",
        units="N",
        frame=BODY,
        default=None,
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

    @classmethod
    def of(cls, model: Model, time: Array, motion: Motion, measured: Array | None, draws: Draws | None) -> Self:
        """Predict along a flight.

        Parameters
        ----------
        time : array, shape (time,), s
        measured : array, shape (time, 3), N m, or None
            Generalised torque of the flight; None where it holds none.
        draws : Draws or None
            Of the bootstrap; None for a model without bands.
        """
        from cpfls_cli.rotations import body_torque
        from cpfls_cli.validation.bands import inertia_band, torque_band

        torque = model.torque(motion)
        inertia_low, inertia_high = (None, None) if draws is None else inertia_band(model, draws, motion.attitude)
        torque_low, torque_high = (None, None) if draws is None else torque_band(model, draws, motion)
        return cls(
            time=time,
            attitude=motion.attitude,
            torque=torque,
            body_torque=body_torque(motion.attitude, torque),
            measured_torque=measured,
            error=None if measured is None else measured - torque,
            inertia=model.inertia(motion.attitude).value,
            inertia_low=inertia_low,
            inertia_high=inertia_high,
            torque_low=torque_low,
            torque_high=torque_high,
            coriolis=model.coriolis(motion.attitude, motion.rate),
            outside=model.outside(motion.attitude),
        )

    @property
    def outside_count(self) -> int:
        """Samples outside the attitudes that training visited."""
        return int(np.sum(self.outside))

    @property
    def vertical_count(self) -> int:
        """Samples near a vertical pitch, at which body torque is not judged."""
        from cpfls_cli.dynamics.rigid_body import vertical

        return int(np.sum(vertical(self.attitude)))

    @cached_property
    def not_positive_definite(self) -> int:
        """Samples at which no body has the inertia matrix."""
        from cpfls_cli.dynamics.rigid_body import not_positive_definite

        return int(np.sum(not_positive_definite(self.inertia, self.attitude)))

    @cached_property
    def score(self) -> Score | None:
        """How well the torque of the flight is predicted; None where the flight holds none."""
        from cpfls_cli.identification.data import TorqueData
        from cpfls_cli.identification.judge import score
        from cpfls_cli.regressor.motion import Motion

        if self.measured_torque is None:
            return None
        # A score looks at attitude and torque only.
        nothing = np.zeros_like(self.attitude)
        return score(TorqueData(self.time, Motion(self.attitude, nothing, nothing), self.measured_torque), self.torque)

    @property
    def body_torque_rms(self) -> Array | None:
        """Root mean square error of the torque about the body axes, shape (3,), N m; None where nothing is known."""
        from cpfls_cli.dynamics.rigid_body import vertical
        from cpfls_cli.rotations import body_torque

        if self.error is None:
            return None
        usable = ~vertical(self.attitude)
        return _rms(body_torque(self.attitude[usable], self.error[usable]))

    @property
    def force_rms(self) -> Array | None:
        """The same of the force, N."""
        if self.force is None or self.measured_force is None:
            return None
        return _rms(self.measured_force - self.force)

    @property
    def summary(self) -> dict[str, Any]:
        """The prediction for machines."""
        score = self.score
        summary: dict[str, Any] = {
            "samples": len(self.time),
            "mse": None if score is None else float(np.mean(score.mse)),
            "relative_error": None if score is None else score.worst_relative_error,
            "outside": self.outside_count,
            "not_positive_definite": self.not_positive_definite,
        }
        if score is not None:
            summary |= {"r2": score.r2.tolist(), "r2_body": score.r2_body.tolist()}
        if self.held_against is not None:
            rms, force = self.body_torque_rms, self.force_rms
            summary |= {
                "held_against": self.held_against,
                "body_torque_rms": None if rms is None else rms.tolist(),
                "force_rms": None if force is None else force.tolist(),
            }
        return summary


def _rms(values: Array) -> Array:
    return np.asarray(np.sqrt(np.mean(values**2, axis=0)))
