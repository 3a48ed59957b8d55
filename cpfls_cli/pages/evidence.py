"""What a model holds as evidence of how far to trust it."""

from __future__ import annotations

from typing import Literal

from cpfls_cli.pages.source import Source
from cpfls_cli.report.content import Tone

# One dataset of each part of the evidence; the others come with it.
_KEYS = {
    "verdict": "verdict/label",
    "structures": "structures/name",
    "residuals": "residuals/autocorrelation",
    "uncertainty": "uncertainty/best_rigid_body",
    "curves": "curves/inertia",
    "round_trip": "round_trip/inertia",
    "steps": "steps/body_rate",
    "physics": "physics/cells",
    "period": "period/mse",
}
# As in `cpfls predict`.
_WELL_CONDITIONED = 100.0

Part = Literal[
    "verdict", "structures", "residuals", "uncertainty", "curves", "round_trip", "steps", "physics", "period"
]

VERDICTS: dict[str, tuple[str, Tone]] = {
    "good-for-control": ("Good for control", "good"),
    "good-inside-region": ("Good inside the region that training visited, and only there", "note"),
    "not-better-than-rigid-body": ("Not better than the rigid body", "warning"),
    "do-not-use": ("Do not use it", "warning"),
}
"""Labels of a verdict in words."""

SHORT_VERDICTS = {
    "good-for-control": "good for control",
    "good-inside-region": "good inside its region",
    "not-better-than-rigid-body": "no better than a rigid body",
    "do-not-use": "do not use",
}
"""The same for a cell of a table."""


def has(model: Source, part: Part) -> bool:
    """Tell whether a model holds a part of the evidence."""
    return _KEYS[part] in model.artifact.data


def validated(model: Source) -> bool:
    """Tell whether any evidence was gathered for a model."""
    return any(key in model.artifact.data for key in _KEYS.values())


def verdict_words(model: Source) -> tuple[str, Tone]:
    """Say a verdict in words.

    Parameters
    ----------
    model : Source
        With a verdict.

    Returns
    -------
    tone : {"plain", "note", "good", "warning"}
    """
    label = model.artifact.text("verdict/label")
    return VERDICTS.get(label, (label, "note"))


def complete(model: Source) -> bool:
    """Tell whether the search for a model came to its end."""
    return "search/complete" not in model.artifact.data or model.artifact.number("search/complete") != 0


def same_everywhere(model: Source) -> bool:
    """Tell whether one rule acts at all attitudes, and training went all the way round in roll and in pitch."""
    visited = model.artifact.array("model/visited") != 0
    return not model.searched and all(bool(visited.any(axis=angle).all()) for angle in (0, 1))


def known_everywhere(model: Source) -> bool:
    """Tell whether the one rule of a model is known well enough to hold where training was not."""
    rank, parameters, condition = (
        model.artifact.number(f"solve/{key}") for key in ("rank", "parameters", "condition_number")
    )
    return same_everywhere(model) and rank == parameters and condition <= _WELL_CONDITIONED
