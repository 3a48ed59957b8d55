"""The artifact of a prediction along a flight."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.artifacts.flight import ClockGroup
from cpfls_cli.artifacts.spec import BODY, EULER, PART, Format, Record, dataset, group, record
from cpfls_cli.dynamics.equations_of_motion import coriolis_matrix
from cpfls_cli.dynamics.rigid_body import not_positive_definite, vertical
from cpfls_cli.identification.data import TorqueData
from cpfls_cli.identification.judge import Score, ScoreSums
from cpfls_cli.regressor.motion import Motion
from cpfls_cli.rotations import body_torque
from cpfls_cli.validation.bands import inertia_band, torque_band

if TYPE_CHECKING:
    from cpfls_cli.dynamics.inertia_functions import InertiaFunctions
    from cpfls_cli.validation.bootstrap import Draws


@record
class PredictionRecord(Record):
    """The artifact `cpfls/prediction`."""

    FORMAT: ClassVar = Format(
        "cpfls/prediction",
        "torque, inertia matrix and Coriolis matrix of a model along a flight",
        "predict",
        ("model", "flight"),
        compressed=True,
    )

    time: Array = dataset("time from the first sample", "time", units="s")
    attitude: Array = dataset("roll, pitch, yaw of the flight", "time", "axis", units="rad", frame=EULER)
    torque: Array = dataset("generalised torque of the model", "time", "axis", units="N m", frame=EULER)
    body_torque: Array = dataset("body torque of the model", "time", "axis", units="N m", frame=BODY)
    measured_torque: Array | None = dataset(
        "generalised torque that the model is held against", "time", "axis", units="N m", frame=EULER, default=None
    )
    error: Array | None = dataset("measured minus model torque", "time", "axis", units="N m", frame=EULER, default=None)
    held_against: str | None = dataset(
        "of a whole vehicle, what measured_torque is: motion, which takes it with the model's inertia, or recorded",
        default=None,
    )
    force: Array | None = dataset(
        "force of a whole vehicle, without weight", "time", "axis", units="N", frame=BODY, default=None
    )
    measured_force: Array | None = dataset(
        "force that the motion takes, without weight", "time", "axis", units="N", frame=BODY, default=None
    )
    inertia: Array = dataset("inertia matrix D_ij(q)", "time", "axis", "axis", units="kg m^2", frame=EULER)
    inertia_low: Array | None = dataset(
        "lower end of its 95 % band", "time", "axis", "axis", units="kg m^2", frame=EULER, default=None
    )
    inertia_high: Array | None = dataset(
        "upper end of its 95 % band", "time", "axis", "axis", units="kg m^2", frame=EULER, default=None
    )
    torque_low: Array | None = dataset(
        "lower end of the 95 % band of the model torque", "time", "axis", units="N m", frame=EULER, default=None
    )
    torque_high: Array | None = dataset(
        "upper end of the 95 % band of the model torque", "time", "axis", units="N m", frame=EULER, default=None
    )
    coriolis: Array = dataset("C(q, qd) by Christoffel symbols", "time", "axis", "axis", units="kg m^2/s", frame=EULER)
    outside: BoolArray = dataset("1 where the attitude lies outside the excited region", "time")
    clock: ClockGroup | None = group(default=None)

    @classmethod
    def of(
        cls, model: InertiaFunctions, time: Array, motion: Motion, measured: Array | None, draws: Draws | None
    ) -> Self:
        """Predict along a flight, whose generalised torque, shape (time, 3), N m, is None where it holds none."""
        torque, inertia = model.torque(motion), model.inertia(motion.attitude)
        inertia_low = inertia_high = torque_low = torque_high = None
        if draws is not None:
            inertia_low, inertia_high = inertia_band(model, draws, motion.attitude, inertia.value)
            torque_low, torque_high = torque_band(model, draws, motion, torque)
        return cls(
            time=time,
            attitude=motion.attitude,
            torque=torque,
            body_torque=body_torque(motion.attitude, torque),
            measured_torque=measured,
            error=None if measured is None else measured - torque,
            inertia=inertia.value,
            inertia_low=inertia_low,
            inertia_high=inertia_high,
            torque_low=torque_low,
            torque_high=torque_high,
            coriolis=coriolis_matrix(inertia, motion.rate),
            outside=model.outside(motion.attitude),
        )

    @cached_property
    def findings(self) -> Findings:
        """How well the flight is predicted, and where the model is not to be trusted."""
        findings = Findings()
        for start in range(0, len(self.time), PART):
            findings.add(self.part(slice(start, start + PART)))
        return findings

    def part(self, samples: slice) -> Self:
        """Take some of the samples."""
        own = {name: value[samples] for name, value in vars(self).items() if isinstance(value, np.ndarray)}
        changes: dict[str, Any] = own
        return replace(self, **changes)

    @property
    def summary(self) -> dict[str, Any]:
        """The prediction for machines."""
        return self.findings.summary


class Findings:
    """What is found along a flight, part by part.

    Attributes
    ----------
    samples : int
    outside : int
        Samples outside the attitudes that training visited.
    vertical : int
        Samples near a vertical pitch, at which body torque is not judged.
    not_positive_definite : int
        Samples at which no body has the inertia matrix.
    held_against : str or None
        As in the record.
    """

    def __init__(self) -> None:
        """Begin with no samples."""
        self.samples = self.outside = self.vertical = self.not_positive_definite = 0
        self.held_against: str | None = None
        self._score, self._judged = ScoreSums(), False
        self._body_torque, self._force = _Squares(), _Squares()

    def add(self, part: PredictionRecord) -> None:
        """Add the samples that follow."""
        steep = vertical(part.attitude)
        self.held_against = part.held_against
        self.samples += len(part.time)
        self.outside += int(np.sum(part.outside))
        self.vertical += int(np.sum(steep))
        self.not_positive_definite += int(np.sum(not_positive_definite(part.inertia, part.attitude)))
        if part.measured_torque is not None:
            # A score looks at attitude and torque only.
            nothing = np.zeros_like(part.attitude)
            data = TorqueData(part.time, Motion(part.attitude, nothing, nothing), part.measured_torque)
            self._score.add(data, part.torque)
            self._judged = True
        if part.error is not None:
            self._body_torque.add(body_torque(part.attitude[~steep], part.error[~steep]))
        if part.force is not None and part.measured_force is not None:
            self._force.add(part.measured_force - part.force)

    @property
    def score(self) -> Score | None:
        """How well the torque of the flight is predicted; None where the flight holds none."""
        return self._score.score() if self._judged else None

    @property
    def body_torque_rms(self) -> Array | None:
        """Root mean square error of the torque about the body axes, shape (3,), N m; None where nothing is known."""
        return self._body_torque.root_mean

    @property
    def force_rms(self) -> Array | None:
        """The same of the force, N."""
        return self._force.root_mean

    @property
    def summary(self) -> dict[str, Any]:
        """What is found, for machines."""
        score = self.score
        summary: dict[str, Any] = {
            "samples": self.samples,
            "mse": None if score is None else float(np.mean(score.mse)),
            "relative_error": None if score is None else score.worst_relative_error,
            "outside": self.outside,
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


class _Squares:
    """Sums for a root mean square by axis, part by part."""

    def __init__(self) -> None:
        self._sum, self._count = np.zeros(3), 0

    def add(self, values: Array) -> None:
        self._sum = self._sum + np.sum(values**2, axis=0)
        self._count += len(values)

    @property
    def root_mean(self) -> Array | None:
        return np.asarray(np.sqrt(self._sum / self._count)) if self._count else None
