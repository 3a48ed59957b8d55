"""The evidence on a model that `identify` has found, with progress, and what is said of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from cpfls_cli.artifacts.job import Job
from cpfls_cli.commands.stopped import FROM_SIGNAL
from cpfls_cli.config.study import generator, settings_of
from cpfls_cli.flights.training import TrainingData
from cpfls_cli.identification.data import TorqueSource
from cpfls_cli.identification.identify import Identification
from cpfls_cli.report.outcome import Outcome
from cpfls_cli.validation.validate import Validation, validate
from cpfls_cli.validation.verdict import Verdict

_SIGNS = {1: "+", -1: "-", 0: " "}


@dataclass(frozen=True)
class Gathered:
    """The evidence on a model, as far as somebody let it be gathered.

    Attributes
    ----------
    evidence : Validation or None
        None where it is not asked for, or where somebody waits for the program to stop.
    signal : int or None
        Number of the signal that stopped it.
    """

    evidence: Validation | None
    signal: int | None = None


class _StoppedError(Exception):
    """Somebody waits for the program to stop."""


def gather_evidence(
    job: Job, result: Identification, data: TrainingData, held_out: Mapping[str, TorqueSource]
) -> Gathered:
    """Gather the evidence on a model; an interrupt leaves the model without it.

    Parameters
    ----------
    held_out : mapping of str to TorqueSource
        What nothing was learned from, by name.
    """
    settings = job.study.identification
    if not settings.validation.enabled or result.stop_reason == "interrupted":
        return Gathered(None)
    rng, total = generator(job.study, "validate"), settings.generations + 1
    with job.deferred_interrupts() as interrupted, settings_of("identification", job.study):

        def tell(note: str) -> None:
            if interrupted() is not None:
                raise _StoppedError
            job.progress(total, total, note)

        try:
            return Gathered(validate(data.training, data.learned, held_out, settings, result, rng, tell))
        except _StoppedError:
            return Gathered(None, interrupted())


def without_evidence(outcome: Outcome, gathered: Gathered, output: Path) -> Outcome:
    """Add to what is said of a model that an interrupt left it without evidence.

    Parameters
    ----------
    output : Path
        The model.
    """
    if gathered.signal is None:
        return outcome
    note = (
        f"{output}: is complete but was not judged, because of the interrupt; the same command with --force judges it"
    )
    return replace(outcome, warnings=(*outcome.warnings, note), exit_code=FROM_SIGNAL + gathered.signal)


def verdict_summary(verdict: Verdict | None) -> dict[str, Any] | None:
    """Arrange a verdict for programs."""
    if verdict is None:
        return None
    reasons = zip(verdict.reason, verdict.speaks, strict=True)
    told = [{"text": text, "speaks": speaks} for text, speaks in reasons]
    return {"label": verdict.label, "region": verdict.region, "reasons": told}


def verdict_lines(verdict: Verdict | None) -> list[str]:
    """Say a verdict to people: what it is, where, and what speaks for the model (+) and against it (-)."""
    if verdict is None:
        return []
    lines = [f"verdict: {verdict.label.replace('-', ' ')}; {verdict.region}"]
    return lines + [f"  {_SIGNS[speaks]} {text}" for text, speaks in zip(verdict.reason, verdict.speaks, strict=True)]
