"""The formats of all artifacts: group paths, units, frames and dimensions, in one place."""

from __future__ import annotations

from dataclasses import replace

from cpfls_cli.artifacts.gap_formats import DIAGNOSIS, DISAGREEMENT, EXTENDED
from cpfls_cli.artifacts.spec import BODY, EULER, NO_FRAME, WORLD, ArtifactSpec, DatasetSpec
from cpfls_cli.artifacts.sweep_formats import SWEEP
from cpfls_cli.artifacts.tracking_formats import TRACKING
from cpfls_cli.artifacts.validation_formats import VALIDATION

_TIME = DatasetSpec("time", ("time",), "s", NO_FRAME, "time from the first sample")
_ATTITUDE = (
    DatasetSpec("attitude", ("time", "axis"), "rad", EULER, "roll, pitch, yaw q"),
    DatasetSpec("attitude_rate", ("time", "axis"), "rad/s", EULER, "Euler rates qd"),
    DatasetSpec("attitude_acceleration", ("time", "axis"), "rad/s^2", EULER, "Euler accelerations qdd"),
)


def _vector(path: str, units: str, frame: str, description: str, required: bool = True) -> DatasetSpec:
    return DatasetSpec(path, ("time", "axis"), units, frame, description, required)


TRAJECTORY = ArtifactSpec(
    "cpfls/trajectory",
    "a planned path with all its derivatives and the attitude that flies it; without a position the vehicle is held at "
    "its centre of mass and only turns",
    "trajectory",
    (
        _TIME,
        _vector("position", "m", WORLD, "position", required=False),
        _vector("velocity", "m/s", WORLD, "velocity", required=False),
        _vector("acceleration", "m/s^2", WORLD, "acceleration", required=False),
        _vector("jerk", "m/s^3", WORLD, "third derivative of position", required=False),
        _vector("snap", "m/s^4", WORLD, "fourth derivative of position", required=False),
        _vector("crackle", "m/s^5", WORLD, "fifth derivative of position", required=False),
        _vector("pop", "m/s^6", WORLD, "sixth derivative of position", required=False),
        DatasetSpec("yaw", ("time",), "rad", EULER, "planned yaw"),
        DatasetSpec("yaw_rate", ("time",), "rad/s", EULER, "derivative of yaw"),
        DatasetSpec("yaw_acceleration", ("time",), "rad/s^2", EULER, "second derivative of yaw"),
        *_ATTITUDE,
        _vector("body_rate", "rad/s", BODY, "body rates p, q, r"),
        DatasetSpec("leg/begin", ("leg",), "s", NO_FRAME, "when each move leaves its rest", required=False),
        DatasetSpec("leg/end", ("leg",), "s", NO_FRAME, "when each move is at rest again", required=False),
        DatasetSpec("leg/displacement", ("leg", "axis"), "m", WORLD, "displacement of each move", required=False),
        DatasetSpec(
            "leg/limited_by",
            ("leg",),
            "text",
            NO_FRAME,
            "derivatives that reach their limit; empty where a move was not planned under limits",
            required=False,
        ),
    ),
    ("waypoints",),
)

FLIGHT = ArtifactSpec(
    "cpfls/flight",
    "a flight, simulated or measured; a source that lacks a signal leaves it out",
    "simulate, import",
    (
        _TIME,
        *(replace(spec, required=False) for spec in _ATTITUDE),
        _vector("body_rate", "rad/s", BODY, "body rates p, q, r", required=False),
        _vector("torque", "N m", EULER, "generalised torque, W^T body_torque", required=False),
        _vector("body_torque", "N m", BODY, "torque about the body axes", required=False),
        DatasetSpec("thrust", ("time",), "N", BODY, "total thrust along body z", required=False),
        _vector("position", "m", WORLD, "position", required=False),
        _vector("velocity", "m/s", WORLD, "velocity", required=False),
        _vector("acceleration", "m/s^2", WORLD, "acceleration", required=False),
        _vector("specific_force", "m/s^2", BODY, "what an accelerometer senses: +g along z in hover", required=False),
        DatasetSpec("rotor_speed", ("time", "rotor"), "rad/s", BODY, "rotor speeds", required=False, gaps=True),
        DatasetSpec(
            "rotor_command",
            ("time", "rotor"),
            "SI",
            BODY,
            "commands to the rotors; rad/s if simulated, else aligned, filtered, in import.signals.rotor_command.unit",
            required=False,
        ),
        DatasetSpec(
            "voltage",
            ("time",),
            "SI",
            NO_FRAME,
            "of the battery: V; share of the full one if simulated or where import.signals.voltage.unit is 1",
            required=False,
        ),
        DatasetSpec(
            "quality/reason",
            ("reason",),
            "text",
            NO_FRAME,
            "what was found in the log, and what was done",
            required=False,
        ),
        DatasetSpec("quality/count", ("reason",), "1", NO_FRAME, "rows, gaps or values by reason", required=False),
        DatasetSpec("quality/warning", ("warning",), "text", NO_FRAME, "what to know about the log", required=False),
        DatasetSpec("delay/value", (), "s", NO_FRAME, "delay of motion behind command, taken out", required=False),
        DatasetSpec("delay/tried", ("tried",), "s", NO_FRAME, "delays tried by the estimate", required=False),
        DatasetSpec(
            "delay/r2", ("tried",), "1", NO_FRAME, "R2 of the rigid body by delay, axes together", required=False
        ),
        DatasetSpec("noise/signal", ("noisy",), "text", NO_FRAME, "signals with added noise", required=False),
        DatasetSpec("noise/std", ("noisy", "axis"), "SI", NO_FRAME, "standard deviation added", required=False),
        DatasetSpec(
            "effects/name", ("flown",), "text", NO_FRAME, "what was flown beyond the model, by value", required=False
        ),
        DatasetSpec("effects/value", ("flown",), "SI", NO_FRAME, "the true value of each", required=False),
        *TRACKING,
    ),
    ("trajectory", "model", "log"),
)

SELECTION = ArtifactSpec(
    "cpfls/selection",
    "the samples of one flight that are worth learning from",
    "reduce",
    (
        DatasetSpec("indices", ("selected",), "1", NO_FRAME, "indices into the flight, in order of selection"),
        DatasetSpec(
            "trace/condition_number",
            ("selected",),
            "1",
            NO_FRAME,
            "condition number after each sample; infinite while rank deficient",
            gaps=True,
        ),
        DatasetSpec("trace/singular_value_min", ("selected",), "SI", NO_FRAME, "smallest singular value after each"),
        DatasetSpec("trace/singular_value_max", ("selected",), "SI", NO_FRAME, "largest singular value after each"),
        DatasetSpec("rank", (), "1", NO_FRAME, "numerical rank of the selection"),
        DatasetSpec("rank_full", (), "1", NO_FRAME, "numerical rank of all candidates"),
        DatasetSpec("condition_number", (), "1", NO_FRAME, "of the selection, over the kept rank", gaps=True),
        DatasetSpec("condition_number_full", (), "1", NO_FRAME, "of all candidates, over the kept rank"),
        DatasetSpec("candidates", (), "1", NO_FRAME, "number of samples that could be selected"),
        DatasetSpec("criterion", (), "text", NO_FRAME, "the rule, as in reduction.criterion"),
        DatasetSpec("exchanges", (), "1", NO_FRAME, "samples that were replaced by others on the way", required=False),
        DatasetSpec("stop_reason", (), "text", NO_FRAME, "why the selection ended"),
        DatasetSpec(
            "random/condition_number", ("draw",), "1", NO_FRAME, "of random selections of equal size", gaps=True
        ),
    ),
    ("flight",),
)

_OBJECTIVES = "MSE (rigid-body base: cross-validated, scaled by axis), largest error, condition number"
_HISTORY = (
    DatasetSpec("history/evaluations", ("generation",), "1", NO_FRAME, "chromosomes evaluated so far"),
    DatasetSpec("history/best", ("generation", "3"), "SI", NO_FRAME, "best of each objective so far", gaps=True),
    DatasetSpec("history/front_size", ("generation",), "1", NO_FRAME, "members of the Pareto front so far"),
)
_JUDGED = ("judged_model", "part", "axis")

MODEL = ArtifactSpec(
    "cpfls/model",
    "an identified model, how it was found and how it was judged",
    "identify",
    (
        DatasetSpec("model/weights", ("gene",), "1", NO_FRAME, "partition weights a_i of the chosen chromosome"),
        DatasetSpec("model/partition", ("breakpoint",), "text", NO_FRAME, "partition each breakpoint belongs to"),
        DatasetSpec("model/breakpoints", ("breakpoint",), "1", NO_FRAME, "peaks of the membership functions on [0, 1]"),
        DatasetSpec("model/coefficients", ("parameter",), "kg m^2", EULER, "coefficients of the rule consequents"),
        DatasetSpec("model/parameter", ("parameter",), "text", NO_FRAME, "inertia function, rule and feature"),
        DatasetSpec(
            "model/rigid_body", ("6",), "kg m^2", BODY, "Ixx Iyy Izz Ixy Ixz Iyz under the fuzzy part; zero for none"
        ),
        DatasetSpec("model/base", (), "text", NO_FRAME, "none or rigid-body"),
        DatasetSpec("model/input_range", ("2", "2"), "1", NO_FRAME, "minimum and maximum of roll and pitch inputs"),
        DatasetSpec("model/visited", ("cell", "cell"), "1", EULER, "cells of roll and pitch that training visited"),
        DatasetSpec("model/ridge_weight", (), "1", NO_FRAME, "chosen; infinite means the fuzzy part is off", gaps=True),
        DatasetSpec(
            "solve/singular_values",
            ("value",),
            "SI",
            NO_FRAME,
            "of the regressor of the parameters in use, without penalty",
        ),
        DatasetSpec("solve/rank", (), "1", NO_FRAME, "numerical rank"),
        DatasetSpec("solve/condition_number", (), "1", NO_FRAME, "over the kept singular values"),
        DatasetSpec("solve/parameters", (), "1", NO_FRAME, "number of linear parameters in use"),
        DatasetSpec("rules/name", ("rule",), "text", NO_FRAME, "inertia function and rule"),
        DatasetSpec("rules/firing", ("rule",), "1", NO_FRAME, "largest firing strength in training"),
        DatasetSpec(
            "rules/determined", ("rule",), "1", NO_FRAME, "share of the rule's coefficients that data determine"
        ),
        DatasetSpec("rules/excited", ("rule",), "1", NO_FRAME, "1 where the rule is excited, else 0"),
        DatasetSpec("front/chromosomes", ("member", "gene"), "1", NO_FRAME, "Pareto front, 16-bit weights"),
        DatasetSpec(
            "front/objectives",
            ("member", "3"),
            "SI",
            NO_FRAME,
            _OBJECTIVES,
        ),
        DatasetSpec("front/chosen", (), "1", NO_FRAME, "index of the chosen member"),
        DatasetSpec(
            "front/held_out",
            ("member",),
            "SI",
            NO_FRAME,
            "mean squared error on the flights kept for the choice; objective 1 of them",
            required=False,
            gaps=True,
        ),
        *_HISTORY,
        DatasetSpec(
            "search/stop_reason",
            (),
            "text",
            NO_FRAME,
            "generations, converged, time-limit or interrupted",
            required=False,
        ),
        DatasetSpec(
            "search/complete",
            (),
            "1",
            NO_FRAME,
            "1 where the search came to its end, 0 where `--resume` goes on",
            required=False,
        ),
        DatasetSpec("judged/models", ("judged_model",), "text", NO_FRAME, "the model and its baselines"),
        DatasetSpec("judged/parts", ("part",), "text", NO_FRAME, "training, held-out rest, other flights"),
        DatasetSpec("judged/samples", ("part",), "1", NO_FRAME, "samples judged"),
        DatasetSpec("judged/outside", ("part",), "1", NO_FRAME, "of them outside the attitudes that training visited"),
        DatasetSpec("judged/mse", _JUDGED, "(N m)^2", EULER, "mean squared torque error"),
        DatasetSpec("judged/max_error", _JUDGED, "N m", EULER, "largest torque error"),
        DatasetSpec("judged/relative_error", _JUDGED, "1", EULER, "largest error over largest torque", gaps=True),
        DatasetSpec("judged/r2", _JUDGED, "1", EULER, "share of the torque's variance explained", gaps=True),
        DatasetSpec(
            "judged/vaf",
            _JUDGED,
            "1",
            EULER,
            "the same without the mean of the error: variance accounted for",
            required=False,
            gaps=True,
        ),
        DatasetSpec(
            "judged/r2_body", _JUDGED, "1", BODY, "the same for body torque, not near a pitch of +-90 deg", gaps=True
        ),
        DatasetSpec("baselines/rigid_body", ("6",), "kg m^2", BODY, "six inertia parameters by least squares"),
        DatasetSpec("baselines/constant_inertia", ("6",), "kg m^2", EULER, "J11 J22 J33 J12 J13 J23, constant"),
        DatasetSpec("ridge/weight", ("tried",), "1", NO_FRAME, "ridge weights tried", required=False, gaps=True),
        DatasetSpec("ridge/error", ("tried",), "1", NO_FRAME, "cross-validated error", required=False),
        DatasetSpec("ridge/standard_error", ("tried",), "1", NO_FRAME, "its standard error", required=False),
        DatasetSpec("training/indices", ("sample",), "1", NO_FRAME, "samples of the flight that trained"),
        DatasetSpec("findings", ("finding",), "text", NO_FRAME, "what failed or was not excited, in words"),
        *VALIDATION,
    ),
    ("flight", "selection", "validate", "choose-on"),
)

CHECKPOINT = ArtifactSpec(
    "cpfls/checkpoint",
    "a search that has not come to its end: all that its next generation depends on",
    "identify, sweep",
    (
        DatasetSpec("generation", (), "1", NO_FRAME, "generations bred; 0: initial population, -1: not even that"),
        DatasetSpec(
            "generator",
            (),
            "text",
            NO_FRAME,
            "state of the random generator, one for all subpopulations, as JSON; null at -1",
        ),
        DatasetSpec("population/genes", ("individual", "gene"), "1", NO_FRAME, "chromosomes, 16-bit weights"),
        DatasetSpec("population/objectives", ("individual", "3"), "SI", NO_FRAME, _OBJECTIVES, gaps=True),
        DatasetSpec("population/subpopulation", ("individual",), "1", NO_FRAME, "label of the subpopulation"),
        DatasetSpec(
            "archive/submitted", ("evaluation", "gene"), "1", NO_FRAME, "chromosomes as bred, in order of evaluation"
        ),
        DatasetSpec("archive/genes", ("evaluation", "gene"), "1", NO_FRAME, "what local search made of them"),
        DatasetSpec("archive/objectives", ("evaluation", "3"), "SI", NO_FRAME, _OBJECTIVES, gaps=True),
        *_HISTORY,
        DatasetSpec(
            "unfinished/submitted",
            ("unfinished", "gene"),
            "1",
            NO_FRAME,
            "chromosomes of the next generation that are evaluated, where the search was stopped within it",
        ),
        DatasetSpec("unfinished/genes", ("unfinished", "gene"), "1", NO_FRAME, "what local search made of them"),
        DatasetSpec("unfinished/objectives", ("unfinished", "3"), "SI", NO_FRAME, _OBJECTIVES, gaps=True),
        DatasetSpec("sha256", (), "text", NO_FRAME, "of the bytes of all datasets above, in this order"),
    ),
    ("flight", "selection", "validate", "choose-on"),
)

_MATRIX = ("time", "axis", "axis")

PREDICTION = ArtifactSpec(
    "cpfls/prediction",
    "torque, inertia matrix and Coriolis matrix of a model along a flight",
    "predict",
    (
        _TIME,
        DatasetSpec("attitude", ("time", "axis"), "rad", EULER, "roll, pitch, yaw of the flight"),
        _vector("torque", "N m", EULER, "generalised torque of the model"),
        _vector("body_torque", "N m", BODY, "body torque of the model"),
        _vector("measured_torque", "N m", EULER, "generalised torque of the flight", required=False),
        _vector("error", "N m", EULER, "measured minus model torque", required=False),
        DatasetSpec("inertia", ("time", "axis", "axis"), "kg m^2", EULER, "inertia matrix D_ij(q)"),
        DatasetSpec("inertia_low", _MATRIX, "kg m^2", EULER, "lower end of its 95 % band", required=False),
        DatasetSpec("inertia_high", _MATRIX, "kg m^2", EULER, "upper end of its 95 % band", required=False),
        _vector("torque_low", "N m", EULER, "lower end of the 95 % band of the model torque", required=False),
        _vector("torque_high", "N m", EULER, "upper end of the 95 % band of the model torque", required=False),
        DatasetSpec("coriolis", ("time", "axis", "axis"), "kg m^2/s", EULER, "C(q, qd) by Christoffel symbols"),
        DatasetSpec("outside", ("time",), "1", NO_FRAME, "1 where the attitude lies outside the excited region"),
    ),
    ("model", "flight"),
)

FORMATS = (TRAJECTORY, FLIGHT, SELECTION, MODEL, CHECKPOINT, SWEEP, PREDICTION, DISAGREEMENT, DIAGNOSIS, EXTENDED)
"""Every artifact format, in the order of the pipeline."""


def format_of(name: str) -> ArtifactSpec | None:
    """Look up a format by the value of the root attribute ``format``."""
    return next((spec for spec in FORMATS if spec.format == name), None)
