"""What a model holds as evidence of how far to trust it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.artifacts.spec import BODY, EULER, dataset, group_of, record

if TYPE_CHECKING:
    from cpfls_cli.validation.validate import Validation

G = TypeVar("G")

_CURVE = ("curve", "point", "axis", "axis")


@record
class StructuresGroup:
    """Structures compared by cross-validation over blocks."""

    name: tuple[str, ...] = dataset("structures compared by cross-validation over blocks", "candidate")
    parameters: IntArray = dataset("linear parameters of the fuzzy part", "candidate")
    error: Array = dataset("mean squared error of scaled torque, held-out blocks", "candidate")
    standard_error: Array = dataset("its standard error over blocks", "candidate")
    ridge_weight: Array = dataset("chosen; infinite: fuzzy part off", "candidate", gaps=True)
    own: BoolArray = dataset("1 for the structure of this model", "candidate")


@record
class ResidualsGroup:
    """Torque errors on one part of the data: mean, whiteness, correlation with inputs, distribution."""

    part: str = dataset("part whose residuals are examined")
    samples: int = dataset("residuals examined")
    available: int | None = dataset("residuals of the whole part", default=None)
    mean: Array | None = dataset(
        "constant torque that the model lacks", "axis", units="N m", frame=EULER, gaps=True, default=None
    )
    mean_p: Array | None = dataset(
        "p-value of a mean of 0: small where it is not", "axis", frame=EULER, gaps=True, default=None
    )
    lag: Array = dataset("lags of the autocorrelation, from one sample on", "lag", units="s")
    autocorrelation: Array = dataset("of the torque error", "lag", "axis", frame=EULER, gaps=True)
    band: float = dataset("1.96 / sqrt(samples): holds 95 % of the lags of white noise")
    ljung_box: Array = dataset("p-value of Ljung and Box: small where not white", "axis", frame=EULER, gaps=True)
    exact: BoolArray = dataset("1 where errors are rounding, which is never white", "axis", frame=EULER)
    input: tuple[str, ...] = dataset("signals that errors are correlated with", "input")
    input_lag: Array = dataset("positive: the error follows the input", "input_lag", units="s")
    correlation: Array = dataset("of error and input", "input", "input_lag", "axis", frame=EULER, gaps=True)
    histogram_edge: Array = dataset("edges of the bins", "edge", "axis", units="N m", frame=EULER)
    histogram_count: IntArray = dataset("errors in each bin", "bin", "axis", frame=EULER)
    normal_quantile: Array = dataset("quantiles of the standard normal distribution", "quantile")
    quantile: Array = dataset("the same quantiles of the errors", "quantile", "axis", units="N m", frame=EULER)


@record
class UncertaintyGroup:
    """Bootstrap draws of the parameters."""

    blocks: int = dataset("contiguous blocks of samples that were drawn")
    block_duration: float = dataset("duration of a block", units="s")
    coefficients: Array = dataset(
        "coefficients of each bootstrap draw", "draw", "rule_coefficient", units="kg m^2", frame=EULER
    )
    rigid_body: Array = dataset("rigid body under the fuzzy part, each draw", "draw", "6", units="kg m^2", frame=BODY)
    best_rigid_body: Array = dataset("rigid body that fits best, each draw", "draw", "6", units="kg m^2", frame=BODY)


@record
class CurvesGroup:
    """D(q) of the model along two curves of attitudes, with its 95 % bands."""

    name: tuple[str, ...] = dataset("over roll, over pitch", "curve")
    attitude: Array = dataset("attitudes along each curve", "curve", "point", "axis", units="rad", frame=EULER)
    inertia: Array = dataset("D_ij(q) of the model", *_CURVE, units="kg m^2", frame=EULER)
    low: Array = dataset("lower end of its 95 % band", *_CURVE, units="kg m^2", frame=EULER)
    high: Array = dataset("upper end of its 95 % band", *_CURVE, units="kg m^2", frame=EULER)
    rigid_body: Array = dataset("D_ij(q) of the rigid body that fits best", *_CURVE, units="kg m^2", frame=EULER)
    outside: BoolArray = dataset("1 outside the attitudes that training visited", "curve", "point")


@record
class RoundTripGroup:
    """D(q) identified again from a simulation of the model."""

    inertia: Array = dataset("D_ij(q) identified from a simulation of the model", *_CURVE, units="kg m^2", frame=EULER)
    inside: Array = dataset("share of visited points within the band", "axis", "axis", frame=EULER, gaps=True)


@record
class StepsGroup:
    """Replays of measured torques over several steps, beside the rigid body and no motion."""

    part: str = dataset("part that measured torques are replayed on")
    model: tuple[str, ...] = dataset("the model, the rigid body, nothing moves", "predictor")
    samples: IntArray = dataset("samples replayed", "horizon")
    horizon: Array = dataset("the same as time", "horizon", units="s")
    windows: int = dataset("windows replayed")
    lost: IntArray | None = dataset("windows in which a predictor ran away", "predictor", "horizon", default=None)
    attitude: Array = dataset(
        "root mean square error", "predictor", "horizon", "axis", units="rad", frame=BODY, gaps=True
    )
    body_rate: Array = dataset(
        "root mean square error", "predictor", "horizon", "axis", units="rad/s", frame=BODY, gaps=True
    )


@record
class PhysicsGroup:
    """Whether D(q) could be a body's."""

    cells: int = dataset("cells of roll and pitch that training visited")
    indefinite: int = dataset("of them where D(q) is not positive definite")
    smallest_eigenvalue: float = dataset("smallest eigenvalue of D(q) over these cells", units="kg m^2", frame=EULER)
    worst_attitude: Array = dataset("roll and pitch where it is smallest", "2", units="rad", frame=EULER)
    energy: float = dataset("largest size of qd^T (dD/dt - 2 C) qd over its own terms: rounding")


@record
class PeriodGroup:
    """Scores one period away in roll and pitch."""

    parts: tuple[str, ...] = dataset("parts judged one period (2 pi in roll and pitch) away", "period_part")
    mse: Array = dataset("mean squared torque error there", "period_part", "axis", units="(N m)^2", frame=EULER)
    max_error: Array = dataset("largest torque error there", "period_part", "axis", units="N m", frame=EULER)


@record
class VerdictGroup:
    """How far to trust the model, and why."""

    label: str | None = dataset(
        "good-for-control, good-inside-region, shows-the-loop, not-better-than-rigid-body, do-not-use", default=None
    )
    region: str | None = dataset("region of attitudes that the verdict is about, in words", default=None)
    reason: tuple[str, ...] | None = dataset("what speaks for it and against it", "reason", default=None)
    speaks: Array | None = dataset("1 for the model, -1 against it, 0 neither", "reason", default=None)

    @property
    def reasons(self) -> list[tuple[str, int]]:
        """What speaks for the model (1), against it (-1) or neither (0), what decided first."""
        reason = self.reason or ()
        speaks = [0] * len(reason) if self.speaks is None else [int(sign) for sign in self.speaks]
        return list(zip(reason, speaks, strict=False))

    @property
    def summary(self) -> dict[str, Any]:
        """The verdict for machines."""
        reasons = [{"text": text, "speaks": speaks} for text, speaks in self.reasons]
        return {"label": self.label, "region": self.region or "", "reasons": reasons}


def evidence_groups(evidence: Validation) -> dict[str, Any]:
    """Arrange the evidence on a model as groups of datasets by the names that its record has for them."""
    results: tuple[tuple[str, type[Any], object], ...] = (
        ("structures", StructuresGroup, evidence.structures),
        ("residuals", ResidualsGroup, evidence.residuals),
        ("uncertainty", UncertaintyGroup, evidence.draws),
        ("curves", CurvesGroup, evidence.curves),
        ("round_trip", RoundTripGroup, evidence.round_trip),
        ("steps", StepsGroup, evidence.steps),
        ("physics", PhysicsGroup, evidence.physics),
        ("period", PeriodGroup, evidence.period),
        ("verdict", VerdictGroup, evidence.verdict),
    )
    return {name: group_of(kind, result) for name, kind, result in results if result is not None}
