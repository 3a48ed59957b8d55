"""Gather the evidence on how far to trust an identified model."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.dynamics import InertiaFunctions, Predictor, inertia_matrix
from cpfls_cli.errors import ComputationError
from cpfls_cli.identification.closed_loop import source_of
from cpfls_cli.identification.data import TRAINING, OtherTorque, TorqueData, TorqueSource
from cpfls_cli.identification.identify import Identification, model_evaluator
from cpfls_cli.identification.settings import IdentificationSettings
from cpfls_cli.inertia import symmetric
from cpfls_cli.regressor.structure import PITCH, ROLL
from cpfls_cli.result import EULER, about, result
from cpfls_cli.rotations import wrapped
from cpfls_cli.validation.bands import Draws, Physics, bootstrap, definite_share, inertia_band, physical_sense
from cpfls_cli.validation.evidence import (
    MODEL,
    RIGID_BODY,
    Evidence,
    compare_torque,
    mean_missing_torque,
    with_constant,
)
from cpfls_cli.validation.replay import StepErrors, replay_steps
from cpfls_cli.validation.residuals import ResidualAnalysis, TimeBlocks, examine_residuals, time_blocks
from cpfls_cli.validation.structures import StructureComparison, compare_structures
from cpfls_cli.validation.verdict import Verdict, verdict, with_loop

Tell = Callable[[str], None]
"""Takes the name of the next step, for the progress display."""


@dataclass(frozen=True)
class Validation:
    """The evidence on one model.

    Attributes
    ----------
    structures : StructureComparison or None
        Other structures by cross-validation; None where not asked for.
    residuals : ResidualAnalysis
        What the model leaves of the torque on held-out data, or in training where nothing was held out.
    uncertainty : Draws
        Of the block bootstrap.
    curves : Curves
        D_ij(q) with their bands.
    round_trip : RoundTrip
        What is identified from a simulation of the model.
    steps : StepErrors
        Measured torques replayed, on the same part as the residuals, by the predictors as they are.
    """

    structures: StructureComparison | None
    residuals: ResidualAnalysis
    uncertainty: Draws
    curves: Curves
    round_trip: RoundTrip
    steps: StepErrors
    physics: Physics
    verdict: Verdict


def validate(
    training: TorqueSource,
    learned: TorqueSource,
    held_out: Mapping[str, TorqueSource],
    settings: IdentificationSettings,
    found: Identification,
    rng: np.random.Generator,
    tell: Tell = lambda _: None,
) -> Validation:
    """Gather the evidence on a model.

    Residuals and prediction by horizon are examined on the first part that was held out, in training where none was.
    The verdict rests on all parts, whatever their order.

    Parameters
    ----------
    training, learned : TorqueSource
        What the model was identified from: the whole training part, and the samples of it that parameters were
        learned from.
    held_out : mapping of str to TorqueSource
        Data that nothing was learned from, by name.
    tell : callable, optional
        Called with the name of each step.
    """
    asked, model = settings.validation, found.model
    part, source = next(iter(held_out.items()), (TRAINING, training))
    drawing, _, simulating = rng.spawn(3)
    tell("compares structures")
    freed_data = source_of(found.freed, training, learned)
    structures = compare_structures(*freed_data, settings) if asked.structures else None
    tell("draws bands")
    draws = bootstrap(model_evaluator(*freed_data, settings), freed_data[0], model, found.fit, asked, drawing)
    drawn = curves(model, draws, found.rigid_body, training)
    tell("identifies its own simulation")
    again = round_trip(*freed_data, settings, model, drawn, simulating)
    tell("replays measured torques")
    predictors: dict[str, Predictor] = {MODEL: model, RIGID_BODY: found.rigid_body}
    steps = replay_steps(part, source, predictors, asked.horizon_samples, asked.windows)
    residuals = examine_residuals(part, source, model.torque, asked.lags)
    physics = physical_sense(model)
    torques = {MODEL: model.torque, RIGID_BODY: found.baselines[0].torque}
    missing = {name: mean_missing_torque(training, torque) for name, torque in torques.items()}
    ours, theirs = (with_constant(torques[name], missing[name]) for name in (MODEL, RIGID_BODY))
    evidence = Evidence(
        identification=found,
        torque={name: compare_torque(judged, ours, theirs) for name, judged in held_out.items()},
        steps=steps,
        replayed={
            name: replay_steps(name, judged, predictors, asked.horizon_samples, asked.windows, missing)
            for name, judged in (held_out or {TRAINING: training}).items()
        },
        residuals=residuals,
        physics=physics,
        r2_min=asked.r2_min,
        band=drawn.relative_width,
        definite=definite_share(model, draws),
    )
    judged = with_loop(verdict(evidence), found.loop, by_past=found.freed is not None)
    return Validation(structures, residuals, draws, drawn, again, steps, physics, judged)


POINTS = 181
"""Every two degrees of a whole turn."""

# A flight that stays within this range would be a speck on the whole turn.
_SMALL_RANGE = np.deg2rad(60.0)
_MARGIN_SHARE = 0.25
_SMALLEST_MARGIN = np.deg2rad(2.0)

# Of a long flight every so many samples are enough to say where it was.
_LOOKED_AT = 100_000

# Share of the largest inertia that rounding may take a curve out of a band of no width.
_ROUNDING = 1e-6


def _along_curves(text: str) -> Any:
    """Describe D(q) along the curves."""
    return about(text, "curve", "point", "axis", "axis", unit="kg m^2", frame=EULER, brief=False)


@result
class Curves:
    """D(q) along two curves of attitudes, with its 95 % bands.

    Of a model without a rigid body below it a band is, where training was not, what the structure does, not what the
    vehicle does.
    """

    name: tuple[str, ...] = about("over roll, over pitch", "curve", brief=False)
    attitude: Array = about(
        "attitudes along each curve", "curve", "point", "axis", unit="rad", frame=EULER, brief=False
    )
    inertia: Array = _along_curves("D_ij(q) of the model")
    low: Array = _along_curves("lower end of its 95 % band")
    high: Array = _along_curves("upper end of its 95 % band")
    rigid_body: Array = _along_curves("D_ij(q) of the rigid body that fits best")
    outside: BoolArray = about("1 outside the attitudes that training visited", "curve", "point", brief=False)

    @property
    def relative_width(self) -> Array:
        """Widest band of D11, D22 and D33 over the value itself, where training was, shape (3,)."""
        moments = np.diagonal(self.inertia, axis1=2, axis2=3)
        width = np.diagonal(self.high - self.low, axis1=2, axis2=3)
        ratio = np.divide(width, np.abs(moments), out=np.full_like(width, np.inf), where=moments != 0)
        return np.asarray(np.max(ratio[~self.outside], axis=0, initial=0.0))


def curves(model: InertiaFunctions, draws: Draws, best_rigid_body: Array, training: TorqueSource) -> Curves:
    """Evaluate a model over roll, at the median pitch of the training data, and over pitch, at their median roll.

    Each curve runs from -180 to 180 degrees; where training kept within 60 degrees, over what it visited and a quarter
    of that on both sides.
    """
    every = len(training) // _LOOKED_AT + 1
    visited = wrapped(np.concatenate([data.motion.attitude[::every, :2] for data in training.chunks()]))
    attitude = np.stack([_along(visited, angle) for angle in (ROLL, PITCH)])
    flat, shape = attitude.reshape(-1, 3), (*attitude.shape[:2], 3, 3)
    low, high = inertia_band(model, draws, flat)
    return Curves(
        name=("over roll", "over pitch"),
        attitude=attitude,
        inertia=model.inertia(flat).value.reshape(shape),
        low=low.reshape(shape),
        high=high.reshape(shape),
        rigid_body=inertia_matrix(flat, symmetric(best_rigid_body)).reshape(shape),
        outside=model.outside(flat).reshape(attitude.shape[:2]),
    )


def _along(visited: Array, angle: int) -> Array:
    """Attitudes along a curve, shape (points, 3)."""
    attitude = np.zeros((POINTS, 3))
    attitude[:, :2] = np.median(visited, axis=0)
    attitude[:, angle] = np.linspace(*_ends(visited[:, angle]), POINTS)
    return attitude


def _ends(angle: Array) -> tuple[float, float]:
    lowest, highest = float(np.min(angle)), float(np.max(angle))
    if highest - lowest >= _SMALL_RANGE:
        return -np.pi, np.pi
    margin = max(_MARGIN_SHARE * (highest - lowest), _SMALLEST_MARGIN)
    return lowest - margin, highest + margin


def simulated_torque(source: TorqueSource, model: InertiaFunctions, blocks: TimeBlocks, factor: Array) -> OtherTorque:
    """Take the motion of a source with the torque of a model, and what it missed as noise, times a factor by block."""

    def simulated(data: TorqueData) -> Array:
        predicted = model.torque(data.motion)
        return predicted + factor[blocks.number(data.time), None] * (data.torque - predicted)

    return OtherTorque(source, simulated)


@result
class RoundTrip:
    """D(q) identified again from torque that the model gave."""

    inertia: Array = _along_curves("D_ij(q) identified from a simulation of the model")
    inside: Array = about(
        "share of visited points within the band; not known of an entry that is zero",
        "axis",
        "axis",
        frame=EULER,
        gaps=True,
    )


def round_trip(
    training: TorqueSource,
    learned: TorqueSource,
    settings: IdentificationSettings,
    model: InertiaFunctions,
    curves: Curves,
    rng: np.random.Generator,
) -> RoundTrip:
    """Identify a model again from torque that it gave itself.

    The torque of the model along the training motion gets the model's own errors as noise, those of each block of
    samples times +1 or -1: noise as strong and as correlated as in the flight, none where the model misses nothing. It
    is larger than the errors by what the fit has followed of it. Nothing is integrated in time: the motion is the
    recorded one, and only the torque is evaluated anew.

    The partitions are the model's: a search would find others that fit as well, and the question here is whether the
    samples determine the inertia, not the breakpoints. The ridge weight is chosen anew, and its pull towards a rigid
    body is shared by both models: a model that it pulled too far comes back all the same. `ComputationError` where the
    simulation gives no finite model.
    """
    again = _identified_again(_simulated(training, learned, settings, model, rng), settings, model)
    inertia = again.inertia(curves.attitude.reshape(-1, 3)).value.reshape(curves.inertia.shape)
    return RoundTrip(inertia=inertia, inside=_inside(inertia, curves))


def _simulated(
    training: TorqueSource,
    learned: TorqueSource,
    settings: IdentificationSettings,
    model: InertiaFunctions,
    rng: np.random.Generator,
) -> tuple[TorqueSource, TorqueSource]:
    blocks = time_blocks(training, settings.validation.block_s)
    rows, parameters = 3 * len(learned), len(model.coefficients)
    strength = np.sqrt(rows / max(rows - parameters, 1))
    factor = strength * rng.choice([-1.0, 1.0], len(blocks.starts) + 1)
    whole = simulated_torque(training, model, blocks, factor)
    return whole, whole if learned is training else simulated_torque(learned, model, blocks, factor)


def _identified_again(
    sources: tuple[TorqueSource, TorqueSource], settings: IdentificationSettings, model: InertiaFunctions
) -> InertiaFunctions:
    solver = model_evaluator(*sources, settings).solver
    fit = solver.fit(model.partitions)
    if fit is None:
        raise ComputationError("identifying the simulation of the model gives no finite model")
    exact, _ = solver.exact(model.partitions, fit)
    return replace(model, coefficients=exact.coefficients, rigid_body=exact.rigid_body)


def _inside(inertia: Array, curves: Curves) -> Array:
    visited, slack = ~curves.outside, _ROUNDING * float(np.max(np.abs(curves.inertia)))
    inside = (inertia >= curves.low - slack) & (inertia <= curves.high + slack)
    zero = np.all(curves.inertia == 0.0, axis=(0, 1)) & np.all(inertia == 0.0, axis=(0, 1))
    if not visited.any():
        return np.full((3, 3), np.nan)
    return np.where(zero, np.nan, np.mean(inside[visited], axis=0))
