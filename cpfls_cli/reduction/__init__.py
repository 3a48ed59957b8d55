"""Reduction of a training set to the samples worth learning from."""

from __future__ import annotations

from cpfls_cli.reduction.selection import Selection, StopReason, Subset
from cpfls_cli.reduction.settings import CriterionName, ReductionSettings
from cpfls_cli.reduction.survey import Chunks, Survey, survey
from cpfls_cli.reduction.training_set import (
    check_reducible,
    check_streamed,
    random_selections,
    random_streamed,
    reduce,
    reduce_streamed,
)

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
