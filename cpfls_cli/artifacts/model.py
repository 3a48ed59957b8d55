"""The artifact of an identified model."""

from __future__ import annotations

from typing import ClassVar

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.artifacts.checkpoint import HistoryGroup
from cpfls_cli.artifacts.evidence import (
    CurvesGroup,
    PeriodGroup,
    PhysicsGroup,
    ResidualsGroup,
    RoundTripGroup,
    StepsGroup,
    StructuresGroup,
    UncertaintyGroup,
    VerdictGroup,
)
from cpfls_cli.artifacts.spec import BODY, EULER, Format, Record, dataset, group, record

_JUDGED = ("judged_model", "part", "axis")


@record
class ModelGroup:
    """The chosen model: partitions, coefficients, and the attitudes that training visited."""

    weights: Array = dataset("weights", "partition weights a_i of the chosen chromosome", "gene")
    partition: tuple[str, ...] = dataset("partition", "partition each breakpoint belongs to", "breakpoint")
    breakpoints: Array = dataset("breakpoints", "peaks of the membership functions on [0, 1]", "breakpoint")
    coefficients: Array = dataset(
        "coefficients", "coefficients of the rule consequents", "parameter", units="kg m^2", frame=EULER
    )
    parameter: tuple[str, ...] = dataset("parameter", "inertia function, rule and feature", "parameter")
    rigid_body: Array = dataset(
        "rigid_body", "Ixx Iyy Izz Ixy Ixz Iyz under the fuzzy part; zero for none", "6", units="kg m^2", frame=BODY
    )
    base: str = dataset("base", "none or rigid-body")
    input_range: Array = dataset("input_range", "minimum and maximum of roll and pitch inputs", "2", "2")
    visited: BoolArray = dataset(
        "visited", "cells of roll and pitch that training visited", "cell", "cell", frame=EULER
    )
    ridge_weight: float = dataset("ridge_weight", "chosen; infinite means the fuzzy part is off", gaps=True)


@record
class SolveGroup:
    """How well the training samples determine the coefficients."""

    singular_values: Array = dataset(
        "singular_values", "of the regressor of the parameters in use, without penalty", "value", units="SI"
    )
    rank: int = dataset("rank", "numerical rank")
    condition_number: float = dataset("condition_number", "over the kept singular values")
    parameters: int = dataset("parameters", "number of linear parameters in use")


@record
class RulesGroup:
    """Excitation of each rule in training."""

    name: tuple[str, ...] = dataset("name", "inertia function and rule", "rule")
    firing: Array = dataset("firing", "largest firing strength in training", "rule")
    determined: Array = dataset("determined", "share of the rule's coefficients that data determine", "rule")
    excited: BoolArray = dataset("excited", "1 where the rule is excited, else 0", "rule")


@record
class FrontGroup:
    """Pareto front of the search."""

    chromosomes: IntArray = dataset("chromosomes", "Pareto front, 16-bit weights", "member", "gene")
    objectives: Array = dataset(
        "objectives",
        "MSE (rigid-body base: cross-validated, scaled by axis), largest error, condition number",
        "member",
        "3",
        units="SI",
    )
    chosen: int = dataset("chosen", "index of the chosen member")
    held_out: Array | None = dataset(
        "held_out",
        "mean squared error on the flights kept for the choice; objective 1 of them",
        "member",
        units="SI",
        gaps=True,
        default=None,
    )


@record
class SearchGroup:
    """How the search ended."""

    stop_reason: str = dataset("stop_reason", "generations, converged, time-limit or interrupted")
    complete: bool = dataset("complete", "1 where the search came to its end, 0 where `--resume` goes on")


@record
class JudgedGroup:
    """Scores of the model and its baselines, by part of the data and axis."""

    models: tuple[str, ...] = dataset("models", "the model and its baselines", "judged_model")
    parts: tuple[str, ...] = dataset("parts", "training, held-out rest, other flights", "part")
    samples: IntArray = dataset("samples", "samples judged", "part")
    outside: IntArray = dataset("outside", "of them outside the attitudes that training visited", "part")
    mse: Array = dataset("mse", "mean squared torque error", *_JUDGED, units="(N m)^2", frame=EULER)
    max_error: Array = dataset("max_error", "largest torque error", *_JUDGED, units="N m", frame=EULER)
    relative_error: Array = dataset(
        "relative_error", "largest error over largest torque", *_JUDGED, frame=EULER, gaps=True
    )
    r2: Array = dataset("r2", "share of the torque's variance explained", *_JUDGED, frame=EULER, gaps=True)
    vaf: Array | None = dataset(
        "vaf",
        "the same without the mean of the error: variance accounted for",
        *_JUDGED,
        frame=EULER,
        gaps=True,
        default=None,
    )
    r2_body: Array = dataset(
        "r2_body", "the same for body torque, not near a pitch of +-90 deg", *_JUDGED, frame=BODY, gaps=True
    )


@record
class BaselinesGroup:
    """Inertia parameters of the baselines."""

    rigid_body: Array = dataset(
        "rigid_body", "six inertia parameters by least squares", "6", units="kg m^2", frame=BODY
    )
    constant_inertia: Array = dataset(
        "constant_inertia", "J11 J22 J33 J12 J13 J23, constant", "6", units="kg m^2", frame=EULER
    )


@record
class RidgeGroup:
    """Cross-validation of the ridge weight."""

    weight: Array = dataset("weight", "ridge weights tried", "tried", gaps=True)
    error: Array = dataset("error", "cross-validated error", "tried")
    standard_error: Array = dataset("standard_error", "its standard error", "tried")


@record
class ModelRecord(Record):
    """The artifact `cpfls/model`."""

    FORMAT: ClassVar = Format(
        "cpfls/model",
        "an identified model, how it was found and how it was judged",
        "identify",
        ("flight", "selection", "validate", "choose-on"),
    )

    model: ModelGroup = group("model")
    solve: SolveGroup = group("solve")
    rules: RulesGroup = group("rules")
    front: FrontGroup = group("front")
    history: HistoryGroup = group("history")
    search: SearchGroup | None = group("search", default=None)
    judged: JudgedGroup = group("judged")
    baselines: BaselinesGroup = group("baselines")
    ridge: RidgeGroup | None = group("ridge", default=None)
    training_indices: IntArray = dataset("training/indices", "samples of the flight that trained", "sample")
    findings: tuple[str, ...] = dataset("findings", "what failed or was not excited, in words", "finding")
    structures: StructuresGroup | None = group("structures", default=None)
    residuals: ResidualsGroup | None = group("residuals", default=None)
    uncertainty: UncertaintyGroup | None = group("uncertainty", default=None)
    curves: CurvesGroup | None = group("curves", default=None)
    round_trip: RoundTripGroup | None = group("round_trip", default=None)
    steps: StepsGroup | None = group("steps", default=None)
    physics: PhysicsGroup | None = group("physics", default=None)
    period: PeriodGroup | None = group("period", default=None)
    verdict: VerdictGroup | None = group("verdict", default=None)
