"""What an identification has to confess, in words."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from cpfls_cli.identification.excitation import RuleExcitation
from cpfls_cli.identification.fit import Fit
from cpfls_cli.identification.judge import Score

HARDLY_EXCITED_R2 = 0.5


def findings(fit: Fit, excitation: RuleExcitation, scores: Mapping[str, Mapping[str, Score]]) -> list[str]:
    """Say in words what failed or was not excited.

    Parameters
    ----------
    fit : Fit
    excitation : RuleExcitation
    scores : mapping
        By part, then by model.

    Returns
    -------
    list of str
    """
    return [*_rank(fit), *_silent_rules(excitation), *_fuzzy_part_off(fit), *_axes(scores), *_beaten(scores)]


def _rank(fit: Fit) -> Iterator[str]:
    parameters = fit.system.row_space.shape[1]
    if fit.system.rank < parameters:
        yield f"rank {fit.system.rank} of {parameters}: the minimum-norm solution was taken"


def _silent_rules(excitation: RuleExcitation) -> Iterator[str]:
    silent = [name for name, excited in zip(excitation.name, excitation.excited, strict=True) if not excited]
    if silent:
        yield f"{len(silent)} of {len(excitation.name)} rules not excited: {', '.join(silent)}"


def _fuzzy_part_off(fit: Fit) -> Iterator[str]:
    if np.isinf(fit.ridge_weight):
        yield "cross-validation switched the fuzzy part off: the data hold no evidence beyond the rigid body"


def _axes(scores: Mapping[str, Mapping[str, Score]]) -> Iterator[str]:
    explained = scores["training"]["rigid-body"].r2_body
    for axis, r2 in zip(("roll", "pitch", "yaw"), explained, strict=True):
        if not r2 > HARDLY_EXCITED_R2:
            yield (
                f"{axis} is hardly excited: the motion explains less than half of its torque in training (R2 of the "
                f"rigid body {r2:.2f}); do not trust this axis"
            )


def _beaten(scores: Mapping[str, Mapping[str, Score]]) -> Iterator[str]:
    """Name the parts of the data on which a simpler model is better."""
    rivals = {
        "rigid-body": "the rigid body with six inertia parameters",
        "uniform-partitions": "the same structure with uniform partitions and no search",
    }
    for part, by_model in scores.items():
        for rival, words in rivals.items():
            ours = by_model["model"].mse.sum()
            if rival in by_model and by_model[rival].mse.sum() < ours * (1 - 1e-9):
                yield f"{part}: {words} is better (mean squared error {_ratio(by_model[rival], ours)} of the model's)"


def _ratio(rival: Score, ours: float) -> str:
    return f"{rival.mse.sum() / ours:.3g}"
