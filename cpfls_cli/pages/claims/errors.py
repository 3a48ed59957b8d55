"""The claim that the relative torque error is below 10 %."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.scores import MODEL, TRAINING
from cpfls_cli.pages.claims.claim import Claim
from cpfls_cli.pages.printed import PRINTED_RELATIVE_ERROR
from cpfls_cli.pages.source import Sources
from cpfls_cli.pages.swept import joined_sweeps
from cpfls_cli.report.numbers import percent

_CLAIM = Claim(
    name="Relative error",
    where="Sections 10, 11",
    words="typical torque identification error is <10% … the relative torque error being uniformly <10%",
    rule="Largest error over largest torque, worst axis, on the flight learned from. Pass: below 10 % for every cpFLS "
    "model of this report.",
    paper="< 10 %",
)


def error_claim(sources: Sources) -> Claim:
    """Hold the relative errors of all models against the paper's bound."""
    errors = np.concatenate([np.zeros(0), *_errors(sources)])
    if not len(errors):
        return _CLAIM.lacks("a model or a sweep", "cpfls identify CONFIG flight.h5 -o model.h5")
    largest, typical = float(np.max(errors)), float(np.median(errors))
    seen = f"{len(errors)} models, median {percent(typical, 2)}."
    ours = f"at most {percent(largest, 2)}"
    return _CLAIM.decided(largest < PRINTED_RELATIVE_ERROR, ours, f"{seen} {_elsewhere(sources)}".strip())


def _errors(sources: Sources) -> Iterator[Array]:
    for sweep in joined_sweeps(sources.sweeps):
        for setting in sweep.settings:
            if setting.structure == "cpfls":
                # A run without a model reaches no error at all.
                yield np.nan_to_num(setting.relative_error[:, 0], nan=np.inf)
    for model in sources.models:
        if model.config["identification"]["structure"] == "cpfls":
            yield np.array([model.record.judged.worst(MODEL, TRAINING)[0]])


def _elsewhere(sources: Sources) -> str:
    """Say what the claim leaves out: flights that the models did not learn from."""
    found = [
        f"{percent(scores.worst(MODEL, part)[0], 2)} on {part}"
        for scores in (model.record.judged for model in sources.models)
        for part in scores.parts
        if part != TRAINING
    ]
    return f"On what was not learned from: {', '.join(found)}." if found else ""
