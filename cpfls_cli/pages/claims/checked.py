"""All claims, in the order of the questions that a reader has."""

from __future__ import annotations

from cpfls_cli.pages.claims.claim import Claim
from cpfls_cli.pages.claims.errors import error_claim
from cpfls_cli.pages.claims.path import move_claim
from cpfls_cli.pages.claims.reduction import reduction_claims
from cpfls_cli.pages.claims.searches import search_claims
from cpfls_cli.pages.claims.timing import timing_claims
from cpfls_cli.pages.source import Sources
from cpfls_cli.pages.swept import joined_sweeps


def claims_of(sources: Sources) -> list[Claim]:
    """Check the claims of the paper against what a report is about.

    Returns
    -------
    list of Claim
        Those without their artifact are in it too, as not measured.
    """
    return [
        error_claim(sources),
        *search_claims(joined_sweeps(sources.sweeps)),
        *timing_claims(sources.settings.evaluation_times),
        *reduction_claims(sources.selections),
        move_claim(sources.trajectories),
    ]
