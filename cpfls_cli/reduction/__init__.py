"""Reduction of a training set to the samples worth learning from."""

from __future__ import annotations

from cpfls_cli.reduction.baseline import random_selections, random_streamed
from cpfls_cli.reduction.greedy import check_reducible, reduce
from cpfls_cli.reduction.selection import Selection, StopReason, Subset
from cpfls_cli.reduction.settings import CriterionName, ReductionSettings
from cpfls_cli.reduction.streamed import check_streamed, reduce_streamed
from cpfls_cli.reduction.survey import Chunks, Survey, survey

__all__ = [
    "Chunks",
    "CriterionName",
    "ReductionSettings",
    "Selection",
    "StopReason",
    "Subset",
    "Survey",
    "check_reducible",
    "check_streamed",
    "random_selections",
    "random_streamed",
    "reduce",
    "reduce_streamed",
    "survey",
]
