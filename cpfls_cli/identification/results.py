"""What an identification returns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.identification.baselines import Baseline
from cpfls_cli.identification.cross_validation import RidgeCurve
from cpfls_cli.identification.excitation import RuleExcitation
from cpfls_cli.identification.fit import Fit
from cpfls_cli.identification.judge import Score
from cpfls_cli.identification.least_squares import LeastSquares
from cpfls_cli.identification.model import Model


@dataclass(frozen=True)
class History:
    """Course of the search.

    Attributes
    ----------
    evaluations : array of int, shape (generations + 1,)
        Chromosomes evaluated so far.
    best : array, shape (generations + 1, 3)
        Best of each objective so far.
    front_size : array of int, shape (generations + 1,)
        Members of the Pareto front so far.
    """

    evaluations: IntArray
    best: Array
    front_size: IntArray


@dataclass(frozen=True)
class Front:
    """Non-dominated chromosomes of the whole search.

    Attributes
    ----------
    chromosomes : array of int, shape (members, genes)
    objectives : array, shape (members, 3)
    chosen : int
        The member that became the model.
    """

    chromosomes: IntArray
    objectives: Array
    chosen: int


@dataclass(frozen=True)
class Identification:
    """Result of an identification.

    Attributes
    ----------
    model : Model
    fit : Fit
        The final model's linear parameters, solved in full precision.
    system : LeastSquares
        The regressor of the parameters that the model uses, without penalty: its rank and condition number.
    front : Front
    history : History
    excitation : RuleExcitation
    ridge : RidgeCurve or None
        For a rigid-body base: how the ridge weight was chosen.
    baselines : tuple of Baseline
        Fitted to the same samples.
    scores : mapping of str to mapping of str to Score
        By part of the data, then by model: ``model``, the baselines' names, and ``uniform-partitions``: the same
        structure without any search.
    samples : mapping of str to int
        Samples judged by part.
    outside : mapping of str to int
        How many of them lie outside the attitudes that training visited.
    findings : tuple of str
        What failed or was not excited, in words.
    """

    model: Model
    fit: Fit
    system: LeastSquares
    front: Front
    history: History
    excitation: RuleExcitation
    ridge: RidgeCurve | None
    baselines: tuple[Baseline, ...]
    scores: Mapping[str, Mapping[str, Score]]
    samples: Mapping[str, int]
    outside: Mapping[str, int]
    findings: tuple[str, ...]
