"""What a model holds as evidence of how far to trust it."""

from __future__ import annotations

from cpfls_cli.artifacts.spec import BODY, EULER, NO_FRAME, DatasetSpec


def _spec(path: str, dimensions: tuple[str, ...], units: str, frame: str, text: str, gaps: bool = False) -> DatasetSpec:
    return DatasetSpec(path, dimensions, units, frame, text, required=False, gaps=gaps)


_CURVE = ("curve", "point", "axis", "axis")
_BY_LAG = ("lag", "axis")

_STRUCTURES = (
    _spec("structures/name", ("candidate",), "text", NO_FRAME, "structures compared by cross-validation over blocks"),
    _spec("structures/parameters", ("candidate",), "1", NO_FRAME, "linear parameters of the fuzzy part"),
    _spec("structures/error", ("candidate",), "1", NO_FRAME, "mean squared error of scaled torque, held-out blocks"),
    _spec("structures/standard_error", ("candidate",), "1", NO_FRAME, "its standard error over blocks"),
    _spec("structures/ridge_weight", ("candidate",), "1", NO_FRAME, "chosen; infinite: fuzzy part off", gaps=True),
    _spec("structures/own", ("candidate",), "1", NO_FRAME, "1 for the structure of this model"),
)

_RESIDUALS = (
    _spec("residuals/part", (), "text", NO_FRAME, "part whose residuals are examined"),
    _spec("residuals/samples", (), "1", NO_FRAME, "residuals examined"),
    _spec("residuals/available", (), "1", NO_FRAME, "residuals of the whole part"),
    _spec("residuals/mean", ("axis",), "N m", EULER, "constant torque that the model lacks", gaps=True),
    _spec("residuals/mean_p", ("axis",), "1", EULER, "p-value of a mean of 0: small where it is not", gaps=True),
    _spec("residuals/lag", ("lag",), "s", NO_FRAME, "lags of the autocorrelation, from one sample on"),
    _spec("residuals/autocorrelation", _BY_LAG, "1", EULER, "of the torque error", gaps=True),
    _spec("residuals/band", (), "1", NO_FRAME, "1.96 / sqrt(samples): holds 95 % of the lags of white noise"),
    _spec("residuals/ljung_box", ("axis",), "1", EULER, "p-value of Ljung and Box: small where not white", gaps=True),
    _spec("residuals/exact", ("axis",), "1", EULER, "1 where errors are rounding, which is never white"),
    _spec("residuals/input", ("input",), "text", NO_FRAME, "signals that errors are correlated with"),
    _spec("residuals/input_lag", ("input_lag",), "s", NO_FRAME, "positive: the error follows the input"),
    _spec("residuals/correlation", ("input", "input_lag", "axis"), "1", EULER, "of error and input", gaps=True),
    _spec("residuals/histogram_edge", ("edge", "axis"), "N m", EULER, "edges of the bins"),
    _spec("residuals/histogram_count", ("bin", "axis"), "1", EULER, "errors in each bin"),
    _spec("residuals/normal_quantile", ("quantile",), "1", NO_FRAME, "quantiles of the standard normal distribution"),
    _spec("residuals/quantile", ("quantile", "axis"), "N m", EULER, "the same quantiles of the errors"),
)

_UNCERTAINTY = (
    _spec("uncertainty/blocks", (), "1", NO_FRAME, "contiguous blocks of samples that were drawn"),
    _spec("uncertainty/block_duration", (), "s", NO_FRAME, "duration of a block"),
    _spec("uncertainty/coefficients", ("draw", "parameter"), "kg m^2", EULER, "coefficients of each bootstrap draw"),
    _spec("uncertainty/rigid_body", ("draw", "6"), "kg m^2", BODY, "rigid body under the fuzzy part, each draw"),
    _spec("uncertainty/best_rigid_body", ("draw", "6"), "kg m^2", BODY, "rigid body that fits best, each draw"),
    _spec("curves/name", ("curve",), "text", NO_FRAME, "over roll, over pitch"),
    _spec("curves/attitude", ("curve", "point", "axis"), "rad", EULER, "attitudes along each curve"),
    _spec("curves/inertia", _CURVE, "kg m^2", EULER, "D_ij(q) of the model"),
    _spec("curves/low", _CURVE, "kg m^2", EULER, "lower end of its 95 % band"),
    _spec("curves/high", _CURVE, "kg m^2", EULER, "upper end of its 95 % band"),
    _spec("curves/rigid_body", _CURVE, "kg m^2", EULER, "D_ij(q) of the rigid body that fits best"),
    _spec("curves/outside", ("curve", "point"), "1", NO_FRAME, "1 outside the attitudes that training visited"),
    _spec("round_trip/inertia", _CURVE, "kg m^2", EULER, "D_ij(q) identified from a simulation of the model"),
    _spec("round_trip/inside", ("axis", "axis"), "1", EULER, "share of visited points within the band", gaps=True),
)

_STEPS = (
    _spec("steps/part", (), "text", NO_FRAME, "part that measured torques are replayed on"),
    _spec("steps/model", ("predictor",), "text", NO_FRAME, "the model, the rigid body, nothing moves"),
    _spec("steps/samples", ("horizon",), "1", NO_FRAME, "samples replayed"),
    _spec("steps/horizon", ("horizon",), "s", NO_FRAME, "the same as time"),
    _spec("steps/windows", (), "1", NO_FRAME, "windows replayed"),
    _spec("steps/lost", ("predictor", "horizon"), "1", NO_FRAME, "windows in which a predictor ran away"),
    _spec("steps/attitude", ("predictor", "horizon", "axis"), "rad", BODY, "root mean square error", gaps=True),
    _spec("steps/body_rate", ("predictor", "horizon", "axis"), "rad/s", BODY, "root mean square error", gaps=True),
)

_PHYSICS = (
    _spec("physics/cells", (), "1", NO_FRAME, "cells of roll and pitch that training visited"),
    _spec("physics/indefinite", (), "1", NO_FRAME, "of them where D(q) is not positive definite"),
    _spec("physics/smallest_eigenvalue", (), "kg m^2", EULER, "smallest eigenvalue of D(q) over these cells"),
    _spec("physics/worst_attitude", ("2",), "rad", EULER, "roll and pitch where it is smallest"),
    _spec("physics/energy", (), "1", NO_FRAME, "largest size of qd^T (dD/dt - 2 C) qd over its own terms: rounding"),
    _spec("period/parts", ("period_part",), "text", NO_FRAME, "parts judged one period (2 pi in roll and pitch) away"),
    _spec("period/mse", ("period_part", "axis"), "(N m)^2", EULER, "mean squared torque error there"),
    _spec("period/max_error", ("period_part", "axis"), "N m", EULER, "largest torque error there"),
)

_VERDICT = (
    _spec(
        "verdict/label",
        (),
        "text",
        NO_FRAME,
        "good-for-control, good-inside-region, not-better-than-rigid-body, do-not-use",
    ),
    _spec("verdict/region", (), "text", NO_FRAME, "region of attitudes that the verdict is about, in words"),
    _spec("verdict/reason", ("reason",), "text", NO_FRAME, "what speaks for it and against it"),
    _spec("verdict/speaks", ("reason",), "1", NO_FRAME, "1 for the model, -1 against it, 0 neither"),
)

VALIDATION = (*_STRUCTURES, *_RESIDUALS, *_UNCERTAINTY, *_STEPS, *_PHYSICS, *_VERDICT)
"""All optional: a model may have been made without a validation."""
