"""What an identification returns."""

from __future__ import annotations

from dataclasses import dataclass

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.identification.baselines import Baseline
from cpfls_cli.identification.cross_validation import RidgeCurve
from cpfls_cli.identification.findings import Evidence
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
class Identification(Evidence):
    """Result of an identification: the model, the evidence on it, and what it has to confess.

    Attributes
    ----------
    model : Model
    front : Front
    history : History
    ridge : RidgeCurve or None
        For a rigid-body base: how the ridge weight was chosen.
    baselines : tuple of Baseline
        Fitted to the same samples.
    findings : tuple of str
        What failed or was not excited, in words.
    """

    model: Model
    front: Front
    history: History
    ridge: RidgeCurve | None
    baselines: tuple[Baseline, ...]
    findings: tuple[str, ...]
