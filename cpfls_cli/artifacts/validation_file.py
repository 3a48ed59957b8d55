"""The evidence on a model as datasets of its artifact, and the draws behind its bands read back."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np

from cpfls_cli.artifacts.formats import MODEL
from cpfls_cli.artifacts.store import Artifact
from cpfls_cli.validation.bootstrap import Draws
from cpfls_cli.validation.validate import Validation

_DATASETS = frozenset(spec.path for spec in MODEL.datasets)
# Results by the field of the evidence that holds them, where the group of datasets has another name.
_GROUPS = {"draws": "uncertainty"}


def validation_data(evidence: Validation) -> dict[str, Any]:
    """Arrange the evidence on a model as the datasets of its artifact.

    Returns
    -------
    dict of str to array
        Every field of its results that the format knows.
    """
    data: dict[str, Any] = {}
    for result in fields(evidence):
        own, group = getattr(evidence, result.name), _GROUPS.get(result.name, result.name)
        if own is not None:
            named = {f"{group}/{field.name}": getattr(own, field.name) for field in fields(own)}
            data |= {path: _stored(value) for path, value in named.items() if path in _DATASETS}
    return data


def read_draws(artifact: Artifact) -> Draws | None:
    """Read the draws behind the bands of a model.

    Returns
    -------
    Draws or None
        None for a model without.
    """
    if "uncertainty/coefficients" not in artifact.data:
        return None
    return Draws(
        coefficients=artifact.array("uncertainty/coefficients"),
        rigid_body=artifact.array("uncertainty/rigid_body"),
        best_rigid_body=artifact.array("uncertainty/best_rigid_body"),
        blocks=int(artifact.number("uncertainty/blocks")),
        block_duration=artifact.number("uncertainty/block_duration"),
    )


def _stored(value: Any) -> Any:
    """Text as an array of text, also where there is none; truth as 0 and 1."""
    array = np.asarray(value)
    if isinstance(value, tuple) and not value:
        return array.astype("U1")
    return array.astype(np.uint8) if array.dtype == bool else array
