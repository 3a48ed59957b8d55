"""The runs of a sweep as datasets, one row each."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from cpfls_cli.identification.identify import Identification
from cpfls_cli.search.sweep_plan import SweepPlan, SweptSetting

Rows = dict[str, Any]
"""Datasets by path; the first axis is the run."""

RUN = "run/"
COMPLETE = "complete"


def sweep_data(plan: SweepPlan, rows: Rows) -> dict[str, Any]:
    """Arrange a sweep as the datasets of its artifact.

    Parameters
    ----------
    rows : dict of str to array
        Of the runs that are finished.
    """
    return {**_settings(plan), **rows, COMPLETE: np.uint8(len(rows[f"{RUN}seed"]) == plan.runs)}


def no_rows(plan: SweepPlan) -> Rows:
    """Begin a sweep of which no run is finished."""
    return {path: values[None][:0] for path, values in run_row(plan, 0, None).items()}


def with_row(rows: Rows, row: Mapping[str, Any]) -> Rows:
    """Add a run.

    Parameters
    ----------
    row : mapping of str to array
        See `run_row`.
    """
    return {path: np.concatenate([values, row[path][None]]) for path, values in rows.items()}


def run_row(plan: SweepPlan, run: int, result: Identification | None) -> dict[str, Any]:
    """Arrange one run.

    Parameters
    ----------
    result : Identification or None
        None where no chromosome gave a finite model.

    Returns
    -------
    dict of str to array
        Without an axis for the run.
    """
    chromosome = np.full(max(setting.genes for setting in plan.settings), -1, dtype=np.int32)
    scores = np.full((3, len(plan.parts)), np.nan)
    condition_number, generations, evaluations = np.nan, 0, 0
    if result is not None:
        chosen = result.front.chromosomes[result.front.chosen]
        chromosome[: len(chosen)] = chosen
        for place, part in enumerate(plan.parts):
            if part in result.scores:
                scores[:, place] = _measures(result, part)
        condition_number = result.system.condition_number
        generations, evaluations = len(result.history.evaluations) - 1, result.history.evaluations[-1]
    return {
        "run/setting": np.int64(run % len(plan.settings)),
        "run/seed": np.int64(plan.seed(run)),
        "run/generations": np.int64(generations),
        "run/evaluations": np.int64(evaluations),
        "run/mse": scores[0],
        "run/max_error": scores[1],
        "run/relative_error": scores[2],
        "run/condition_number": np.float64(condition_number),
        "run/chromosome": chromosome,
    }


def _measures(result: Identification, part: str) -> tuple[float, float, float]:
    score = result.scores[part]["model"]
    return float(np.mean(score.mse)), float(np.max(score.max_error)), score.worst_relative_error


def _settings(plan: SweepPlan) -> dict[str, Any]:
    columns = [_setting(setting) for setting in plan.settings]
    listed = {name: np.array([column[name] for column in columns]) for name in columns[0]}
    return {**{f"setting/{name}": values for name, values in listed.items()}, "part": np.array(plan.parts)}


def _setting(setting: SweptSetting) -> dict[str, Any]:
    study = setting.variant.study
    return {
        "name": setting.variant.name,
        "overrides": json.dumps(list(setting.variant.overrides), ensure_ascii=False),
        "structure": study.identification.structure,
        "samples": len(setting.data.learned),
        "criterion": study.reduction.criterion if setting.variant.reduced else "all",
        "selection": setting.selection.sha256,
        "population": study.identification.population,
        "generations": study.identification.generations,
    }
