"""Reduction of a training set to the samples worth learning from."""

from __future__ import annotations

from cpfls_cli.reduction.baseline import random_selections
from cpfls_cli.reduction.greedy import check_reducible, reduce
from cpfls_cli.reduction.selection import Selection, StopReason, Subset
from cpfls_cli.reduction.settings import CriterionName, ReductionSettings

__all__ = [
    "CriterionName",
    "ReductionSettings",
    "Selection",
    "StopReason",
    "Subset",
    "check_reducible",
    "random_selections",
    "reduce",
]
