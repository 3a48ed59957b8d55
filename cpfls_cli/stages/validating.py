"""The evidence on a model that `identify` has found, with progress, and what is said of it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from cpfls_cli.identification.data import TorqueSource
from cpfls_cli.identification.results import Identification
from cpfls_cli.stages.job import Job
from cpfls_cli.stages.study import generator, settings_of
from cpfls_cli.stages.training import TrainingData
from cpfls_cli.validation.validate import Validation, validate
from cpfls_cli.validation.verdict import Verdict

_SIGNS = {1: "+", -1: "-", 0: " "}


def evidence_on(
    job: Job, result: Identification, data: TrainingData, held_out: Mapping[str, TorqueSource]
) -> Validation | None:
    """Gather the evidence on a model.

    Parameters
    ----------
    job : Job
    result : Identification
    data : TrainingData
    held_out : mapping of str to TorqueSource
        What nothing was learned from, by name.

    Returns
    -------
    Validation or None
        None where it is not asked for, or where somebody waits for a search to stop.
    """
    settings = job.study.identification
    if not settings.validation.enabled or result.stop_reason == "interrupted":
        return None
    generations = settings.generations + 1
    with settings_of("identification", job.study):
        return validate(
            data.training,
            data.learned,
            held_out,
            settings,
            result,
            generator(job.study, "validate"),
            lambda note: job.progress(generations, generations, note),
        )


def verdict_summary(verdict: Verdict | None) -> dict[str, Any] | None:
    """Arrange a verdict for programs.

    Parameters
    ----------
    verdict : Verdict or None

    Returns
    -------
    dict or None
    """
    if verdict is None:
        return None
    reasons = zip(verdict.reason, verdict.speaks, strict=True)
    told = [{"text": text, "speaks": speaks} for text, speaks in reasons]
    return {"label": verdict.label, "region": verdict.region, "reasons": told}


def verdict_lines(verdict: Verdict | None) -> list[str]:
    """Say a verdict to people: what it is, where, and what speaks for the model (+) and against it (-).

    Parameters
    ----------
    verdict : Verdict or None

    Returns
    -------
    list of str
    """
    if verdict is None:
        return []
    lines = [f"verdict: {verdict.label.replace('-', ' ')}; {verdict.region}"]
    return lines + [f"  {_SIGNS[speaks]} {text}" for text, speaks in zip(verdict.reason, verdict.speaks, strict=True)]
