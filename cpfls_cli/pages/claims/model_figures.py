"""Figures 5 to 7 of the paper: the reduction, the partitions, the torque error."""

from __future__ import annotations

import numpy as np

from cpfls_cli.artifacts.scores import MODEL, TRAINING
from cpfls_cli.fuzzy.membership import breakpoints
from cpfls_cli.pages.claims.compared import ComparedFigure, agreement, not_shown, reading
from cpfls_cli.pages.printed import PRINTED_BREAKPOINTS, PRINTED_RELATIVE_ERROR, PRINTED_WEIGHTS, TABLE_4
from cpfls_cli.pages.source import Sources
from cpfls_cli.report.numbers import change, number, percent

_GENES = 4
_DRAWN = TABLE_4[2]
_PRECISION = 1e-5
"""One unit in the last digit of the printed breakpoints."""


def reduction_compared(sources: Sources) -> ComparedFigure:
    """Compare Figure 5: the condition number while samples are chosen."""
    title = f"5: condition number, {_DRAWN.samples} samples"
    printed = f"{_DRAWN.condition_number}, {change(_DRAWN.change)} against all samples"
    fitting = [s for s in sources.selections if len(s.artifact.array("indices")) == _DRAWN.samples]
    if not fitting:
        return not_shown(title, printed, f"Missing: a selection of {_DRAWN.samples} samples.")
    artifact = fitting[0].artifact
    condition, full = artifact.number("condition_number"), artifact.number("condition_number_full")
    grown = condition / full - 1.0
    agrees = abs(grown - _DRAWN.change) < PRINTED_RELATIVE_ERROR
    why = (
        "The curve falls to a level and stays there; the level is another than the paper's, because the path and "
        "so the full set is, and because the choice exchanges samples and is not bound to the rule of section 8, "
        "which does not start."
    )
    return ComparedFigure(title, printed, f"{number(condition, 5)}, {change(grown)}", agreement(agrees), why)


def partitions_compared() -> ComparedFigure:
    """Compare Figure 6: the printed partitions with the printed weights, as they are decoded here."""
    weights = np.array(PRINTED_WEIGHTS, dtype=float).reshape(-1, _GENES)
    decoded = np.concatenate([breakpoints(row)[1:-1] for row in weights])
    off = float(np.max(np.abs(decoded - PRINTED_BREAKPOINTS)))
    agrees = off <= _PRECISION
    why = (
        "A check of how the paper is read, not of any model: its printed weights, decoded as here, give its printed "
        "breakpoints. Partitions of our models come from other searches on another flight and need not be equal."
    )
    printed = "18 breakpoints of 24 printed weights"
    ours = f"the paper's weights, decoded: largest difference {number(off, 1)}"
    return ComparedFigure("6: partitions", printed, ours, reading(agrees), why)


def error_compared(sources: Sources) -> ComparedFigure:
    """Compare Figure 7: the torque error."""
    title, printed = "7: torque error", "below 10 % of the torque along the training path"
    shown = [
        model
        for prediction in sources.predictions
        if (model := sources.by_hash(prediction.made_from("model"))) is not None
        and model.made_from("flight") == prediction.made_from("flight")
    ]
    if not shown:
        return not_shown(title, printed, "Missing: a prediction along the flight that its model learned from.")
    largest, axis = shown[0].record.judged.worst(MODEL, TRAINING)
    agrees = largest < PRINTED_RELATIVE_ERROR
    why = "Relative to the largest torque of each axis; the absolute errors belong to torques of other sizes."
    return ComparedFigure(title, printed, f"at most {percent(largest, 2)} ({axis})", agreement(agrees), why)
