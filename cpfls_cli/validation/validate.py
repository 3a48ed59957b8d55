"""Gather the evidence on how far to trust an identified model."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from cpfls_cli.dynamics.equations_of_motion import Predictor
from cpfls_cli.identification.closed_loop import told_by
from cpfls_cli.identification.data import TorqueSource
from cpfls_cli.identification.identify import TRAINING, Identification, model_evaluator
from cpfls_cli.identification.settings import IdentificationSettings
from cpfls_cli.validation.bands import definite_share
from cpfls_cli.validation.bootstrap import Draws, bootstrap
from cpfls_cli.validation.curves import Curves, RoundTrip, curves, round_trip
from cpfls_cli.validation.grounds import MODEL, RIGID_BODY, Grounds
from cpfls_cli.validation.paired import compare_torque, mean_missing_torque, with_constant
from cpfls_cli.validation.physical import PeriodErrors, Physics, one_period_away, physical_sense
from cpfls_cli.validation.replay import StepErrors, replay_steps
from cpfls_cli.validation.residuals import ResidualAnalysis, examine_residuals
from cpfls_cli.validation.structures import StructureComparison, compare_structures
from cpfls_cli.validation.verdict import Verdict, beside_loop, verdict

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
    draws : Draws
        Of the block bootstrap.
    curves : Curves
        D_ij(q) with their bands.
    round_trip : RoundTrip
        What is identified from a simulation of the model.
    steps : StepErrors
        Measured torques replayed, on the same part as the residuals, by the predictors as they are.
    period : PeriodErrors or None
        None where inputs do not go all the way round.
    """

    structures: StructureComparison | None
    residuals: ResidualAnalysis
    draws: Draws
    curves: Curves
    round_trip: RoundTrip
    steps: StepErrors
    physics: Physics
    period: PeriodErrors | None
    verdict: Verdict


def validate(
    training: TorqueSource,
    learned: TorqueSource,
    held_out: Mapping[str, TorqueSource],
    settings: IdentificationSettings,
    result: Identification,
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
    asked, model = settings.validation, result.model
    part, source = next(iter(held_out.items()), (TRAINING, training))
    drawing, examining, simulating = rng.spawn(3)
    tell("compares structures")
    told = told_by(result.freed, training, learned)
    structures = compare_structures(*told, settings) if asked.structures else None
    tell("draws bands")
    draws = bootstrap(model_evaluator(*told, settings), told[0], model, result.fit, asked, drawing)
    drawn = curves(model, draws, result.rigid_body, training)
    tell("identifies its own simulation")
    again = round_trip(*told, settings, model, drawn, simulating)
    tell("replays measured torques")
    predictors: dict[str, Predictor] = {MODEL: model, RIGID_BODY: result.rigid_body}
    steps = replay_steps(part, source, predictors, asked.horizon_samples, asked.windows)
    residuals = examine_residuals(part, source, model.torque, asked.lags)
    physics = physical_sense(model, examining)
    period = one_period_away(model, {TRAINING: training, **held_out})
    torques = {MODEL: model.torque, RIGID_BODY: result.baselines[0].torque}
    missing = {name: mean_missing_torque(training, torque) for name, torque in torques.items()}
    ours, theirs = (with_constant(torques[name], missing[name]) for name in (MODEL, RIGID_BODY))
    grounds = Grounds(
        identification=result,
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
    judged = beside_loop(verdict(grounds), result.loop)
    return Validation(structures, residuals, draws, drawn, again, steps, physics, period, judged)
