"""What a model is worth, taken out of its artifact."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from cpfls_cli.artifacts.store import Artifact
from cpfls_cli.export.sheet import Evidence, Verdict

_MEASURES = ("mse", "max_error", "relative_error", "r2", "vaf", "r2_body")


def evidence_of(artifact: Artifact) -> Evidence:
    """Take the scores, the findings and the verdict out of a model artifact.

    Parameters
    ----------
    artifact : Artifact
        Of the format ``cpfls/model``.
    """
    data = artifact.data
    return Evidence(
        bool(data.get("search/complete", 1)),
        str(data.get("search/stop_reason", "")),
        _judged(artifact),
        tuple(artifact.texts("findings")),
        _verdict(artifact) if "verdict/label" in data else None,
    )


def _judged(artifact: Artifact) -> Mapping[str, Any]:
    measures = [measure for measure in _MEASURES if f"judged/{measure}" in artifact.data]
    tables = {measure: artifact.array(f"judged/{measure}") for measure in measures}
    parts = artifact.texts("judged/parts")
    return {
        "parts": {
            part: {"samples": int(samples), "outside": int(outside)}
            for part, samples, outside in zip(
                parts, artifact.array("judged/samples"), artifact.array("judged/outside"), strict=True
            )
        },
        "models": {
            model: {
                part: {measure: table[row, column].tolist() for measure, table in tables.items()}
                for column, part in enumerate(parts)
            }
            for row, model in enumerate(artifact.texts("judged/models"))
        },
    }


def _verdict(artifact: Artifact) -> Verdict:
    data = artifact.data
    reasons = [str(reason) for reason in data.get("verdict/reason", ())]
    # Each of these datasets is optional by itself.
    speaks = np.asarray(data.get("verdict/speaks", np.zeros(len(reasons))), dtype=float)
    weighed = tuple(zip(reasons, speaks.tolist(), strict=False))
    return Verdict(artifact.text("verdict/label"), str(data.get("verdict/region", "")), weighed)
