"""What a model predicts of torque and inertia along a flight, and how far it is off."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, ClassVar, Literal

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.dynamics.equations_of_motion import coriolis_matrix
from cpfls_cli.dynamics.inertia_functions import InertiaFunctions
from cpfls_cli.dynamics.rigid_body import not_positive_definite, vertical
from cpfls_cli.identification.data import TorqueData
from cpfls_cli.identification.judge import ScoreSums
from cpfls_cli.regressor.motion import Motion
from cpfls_cli.result import about, result
from cpfls_cli.rotations import body_torque
from cpfls_cli.validation.bands import inertia_band, torque_band
from cpfls_cli.validation.bootstrap import Draws

_BODY, _EULER = "body (FLU)", "Euler angles (intrinsic ZYX)"


def _along(text: str, *axes: str, **more: Any) -> Any:
    """Describe what has a value for each sample."""
    return about(text, "time", *axes, brief=False, **more)


@result
class AlongFlight:
    """Torque, inertia matrix and Coriolis matrix of a model along a flight."""

    FORMAT: ClassVar = "cpfls/prediction"
    STREAMED: ClassVar = "time"

    samples: int = about("samples of the flight", default=0)
    outside: int = about("of them outside the attitudes that training visited", default=0)
    vertical: int = about("of them near a vertical pitch, at which body torque is not judged", default=0)
    not_positive_definite: int = about("of them at which no body has the inertia matrix", default=0)
    mse: float | None = about("mean squared error of the torque", unit="(N m)^2", default=None)
    relative_error: float | None = about("largest error over largest torque, of the worst axis", default=None)
    r2: Array | None = about("share of the torque's variance explained", "axis", frame=_EULER, gaps=True, default=None)
    r2_body: Array | None = about("the same of body torque", "axis", frame=_BODY, gaps=True, default=None)
    held_against: Literal["motion", "recorded"] | None = about(
        "of a whole vehicle, what measured_torque is: motion, which takes it with the model's inertia, or recorded",
        default=None,
    )
    body_torque_rms: Array | None = about(
        "root mean square error of body torque, of a whole vehicle", "axis", unit="N m", frame=_BODY, default=None
    )
    force_rms: Array | None = about(
        "root mean square error of the force, of a whole vehicle", "axis", unit="N", frame=_BODY, default=None
    )
    seen: str = about("what the model learned from the flight", default="")
    condition_number: float | None = about(
        "of the coefficients, where one rule holds everywhere and all of them are known", default=None
    )
    warnings: tuple[str, ...] = about("what to know about model and flight", "warning", default=())
    contradictions: tuple[str, ...] = about("contradictions within the flight", "contradiction", default=())
    begins_s: float = about(
        "stamp of the log's own clock at time 0; not finite where there is none",
        unit="s",
        gaps=True,
        default=float("nan"),
    )
    time: Array = _along("time from the first sample", unit="s")
    attitude: Array = _along("roll, pitch, yaw of the flight", "axis", unit="rad", frame=_EULER)
    torque: Array = _along("generalised torque of the model", "axis", unit="N m", frame=_EULER)
    body_torque: Array = _along("body torque of the model", "axis", unit="N m", frame=_BODY)
    measured_torque: Array | None = _along(
        "generalised torque that the model is held against", "axis", unit="N m", frame=_EULER, default=None
    )
    error: Array | None = _along("measured minus model torque", "axis", unit="N m", frame=_EULER, default=None)
    force: Array | None = _along(
        "force of a whole vehicle, without weight", "axis", unit="N", frame=_BODY, default=None
    )
    measured_force: Array | None = _along(
        "force that the motion takes, without weight", "axis", unit="N", frame=_BODY, default=None
    )
    inertia: Array = _along("inertia matrix D_ij(q)", "axis", "axis", unit="kg m^2", frame=_EULER)
    inertia_low: Array | None = _along(
        "lower end of its 95 % band", "axis", "axis", unit="kg m^2", frame=_EULER, default=None
    )
    inertia_high: Array | None = _along(
        "upper end of its 95 % band", "axis", "axis", unit="kg m^2", frame=_EULER, default=None
    )
    torque_low: Array | None = _along(
        "lower end of the 95 % band of the model torque", "axis", unit="N m", frame=_EULER, default=None
    )
    torque_high: Array | None = _along(
        "upper end of the 95 % band of the model torque", "axis", unit="N m", frame=_EULER, default=None
    )
    coriolis: Array = _along("C(q, qd) by Christoffel symbols", "axis", "axis", unit="kg m^2/s", frame=_EULER)
    extrapolates: BoolArray = _along("1 where the attitude lies outside the region that training visited")

    @classmethod
    def of(
        cls, model: InertiaFunctions, time: Array, motion: Motion, measured: Array | None, draws: Draws | None
    ) -> AlongFlight:
        """Predict along a flight, whose generalised torque, shape (time, 3), N m, is None where it holds none."""
        torque, inertia = model.torque(motion), model.inertia(motion.attitude)
        bands: dict[str, Any] = {}
        if draws is not None:
            low, high = inertia_band(model, draws, motion.attitude, inertia.value)
            least, most = torque_band(model, draws, motion, torque)
            bands = {"inertia_low": low, "inertia_high": high, "torque_low": least, "torque_high": most}
        return cls(
            time=time,
            attitude=motion.attitude,
            torque=torque,
            body_torque=body_torque(motion.attitude, torque),
            measured_torque=measured,
            error=None if measured is None else measured - torque,
            inertia=inertia.value,
            coriolis=coriolis_matrix(inertia, motion.rate),
            extrapolates=model.outside(motion.attitude),
            **bands,
        )

    def part(self, samples: slice) -> AlongFlight:
        """Take some of the samples."""
        length = len(self.time)
        own = {name: value for name, value in vars(self).items() if isinstance(value, np.ndarray)}
        changes: dict[str, Any] = {name: value[samples] for name, value in own.items() if len(value) == length}
        return replace(self, **changes)


class Totals:
    """What is found along a flight, part by part."""

    def __init__(self) -> None:
        """Begin with no samples."""
        self.samples = self.outside = self.vertical = self.not_positive_definite = 0
        self._score, self._judged = ScoreSums(), False
        self._body_torque, self._force = _Squares(), _Squares()

    def with_next(self, part: AlongFlight) -> AlongFlight:
        """Add the samples that follow, and give them with what is known of all until there."""
        steep = vertical(part.attitude)
        self.samples += len(part.time)
        self.outside += int(np.sum(part.extrapolates))
        self.vertical += int(np.sum(steep))
        self.not_positive_definite += int(np.sum(not_positive_definite(part.inertia, part.attitude)))
        if part.measured_torque is not None:
            # A score looks at attitude and torque only.
            nothing = np.zeros_like(part.attitude)
            data = TorqueData(part.time, Motion(part.attitude, nothing, nothing), part.measured_torque)
            self._score.add(data, part.torque)
            self._judged = True
        if part.error is not None and part.held_against is not None:
            self._body_torque.add(body_torque(part.attitude[~steep], part.error[~steep]))
        if part.force is not None and part.measured_force is not None:
            self._force.add(part.measured_force - part.force)
        found: dict[str, Any] = {}
        if self._judged:
            score = self._score.score()
            found = {"mse": float(np.mean(score.mse)), "relative_error": score.worst_relative_error}
            found |= {"r2": score.r2, "r2_body": score.r2_body}
        return replace(
            part,
            samples=self.samples,
            outside=self.outside,
            vertical=self.vertical,
            not_positive_definite=self.not_positive_definite,
            body_torque_rms=self._body_torque.root_mean,
            force_rms=self._force.root_mean,
            **found,
        )


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
