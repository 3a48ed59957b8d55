"""What an identification returns."""

from __future__ import annotations

from dataclasses import dataclass

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.evolution.state import History
from cpfls_cli.identification.baselines import Baseline
from cpfls_cli.identification.cross_validation import RidgeCurve
from cpfls_cli.identification.findings import Evidence
from cpfls_cli.identification.model import Model
from cpfls_cli.identification.search_run import StopReason, is_end


@dataclass(frozen=True)
class Front:
    """Non-dominated chromosomes of the whole search.

    Attributes
    ----------
    chromosomes : array of int, shape (members, genes)
    objectives : array, shape (members, 3)
    chosen : int
        The member that became the model.
    held_out : array, shape (members,), or None
        Mean squared errors on flights kept for the choice; None where the objectives alone decided.
    """

    chromosomes: IntArray
    objectives: Array
    chosen: int
    held_out: Array | None = None


@dataclass(frozen=True)
class Identification(Evidence):
    """Result of an identification: the model, the evidence on it, and what it has to confess.

    Attributes
    ----------
    model : Model
    front : Front
    history : History
    stop_reason : str
        Why the search ended: generations, converged, time-limit or interrupted.
    ridge : RidgeCurve or None
        For a rigid-body base: how the ridge weight was chosen.
    baselines : tuple of Baseline
        Fitted to the same samples.
    findings : tuple of str
        What failed or was not excited, in words.
    """

    model: Model
    front: Front
    history: History
    stop_reason: StopReason
    ridge: RidgeCurve | None
    baselines: tuple[Baseline, ...]
    findings: tuple[str, ...]

    @property
    def complete(self) -> bool:
        """Whether the search came to its end."""
        return is_end(self.stop_reason)
