"""What an identification has to confess, in words."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from cpfls_cli.identification.excitation import RuleExcitation
from cpfls_cli.identification.fit import Fit
from cpfls_cli.identification.judge import Score
from cpfls_cli.identification.least_squares import LeastSquares

HARDLY_EXCITED_R2 = 0.5
NAMED = 8
RIVALS = {
    "rigid-body": "the rigid body with six inertia parameters",
    "constant-inertia": "a constant inertia matrix",
    "uniform-partitions": "the same structure with uniform partitions and no search",
}


def findings(
    fit: Fit,
    system: LeastSquares,
    excitation: RuleExcitation,
    scores: Mapping[str, Mapping[str, Score]],
    outside: Mapping[str, int],
) -> list[str]:
    """Say in words what failed or was not excited.

    Parameters
    ----------
    fit : Fit
    system : LeastSquares
        The regressor of the model's parameters, without penalty.
    excitation : RuleExcitation
    scores : mapping
        By part, then by model.
    outside : mapping
        Samples outside the visited attitudes, by part.

    Returns
    -------
    list of str
    """
    return [
        *_rank(system),
        *_silent_rules(excitation),
        *_fuzzy_part_off(fit),
        *_axes(scores),
        *_beaten(scores),
        *_outside(outside),
    ]


def _rank(system: LeastSquares) -> Iterator[str]:
    parameters = system.row_space.shape[1]
    if system.rank < parameters:
        yield f"rank {system.rank} of {parameters}: the minimum-norm solution was taken"


def _silent_rules(excitation: RuleExcitation) -> Iterator[str]:
    silent = [name for name, excited in zip(excitation.name, excitation.excited, strict=True) if not excited]
    if silent:
        rest = f" and {len(silent) - NAMED} more" if len(silent) > NAMED else ""
        named = ", ".join(silent[:NAMED])
        yield f"{len(silent)} of {len(excitation.name)} rules not excited beyond the noise: {named}{rest}"


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
    """Name the parts of the data on which a simpler model explains more, all axes counted alike."""
    for part, by_model in scores.items():
        ours = by_model["model"]
        for rival, words in RIVALS.items():
            if rival in by_model and _unexplained(by_model[rival]) < _unexplained(ours) * (1 - 1e-9):
                shares = f"{_by_axis(by_model[rival])} of roll, pitch, yaw; the model {_by_axis(ours)}"
                yield f"{part}: {words} leaves less of the torque unexplained ({shares})"


def _by_axis(score: Score) -> str:
    return " ".join(f"{share:.2g}" for share in 1.0 - score.r2)


def _unexplained(score: Score) -> float:
    return float(np.nansum(1.0 - score.r2))


def _outside(outside: Mapping[str, int]) -> Iterator[str]:
    for part, samples in outside.items():
        if samples:
            yield f"{part}: {samples} samples lie outside the attitudes that training visited"
