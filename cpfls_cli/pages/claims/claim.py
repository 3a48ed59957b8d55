"""One claim of the paper and how it fared."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum


class Verdict(StrEnum):
    """How a claim fared."""

    PASS = "PASS"
    FAIL = "FAIL"
    UNDECIDED = "UNDECIDED"
    NOT_MEASURED = "NOT MEASURED"


@dataclass(frozen=True)
class Claim:
    """One claim of the paper and how it fared.

    Attributes
    ----------
    name : str
        In a few words.
    where : str
        Section of the paper.
    words : str
        The paper's own.
    rule : str
        What is measured, and what counts as a pass; stated without the outcome.
    paper : str
        The paper's number.
    why : str
        One or two sentences.
    """

    name: str
    where: str
    words: str
    rule: str
    paper: str
    ours: str = "—"
    verdict: Verdict = Verdict.NOT_MEASURED
    why: str = ""

    def decided(self, passed: bool, ours: str, why: str) -> Claim:
        """Add a number and what it says."""
        return replace(self, verdict=Verdict.PASS if passed else Verdict.FAIL, ours=ours, why=why)

    def undecided(self, ours: str, why: str) -> Claim:
        """Add a number that does not settle the claim."""
        return replace(self, verdict=Verdict.UNDECIDED, ours=ours, why=why)

    def lacks(self, what: str, command: str) -> Claim:
        """Say what is missing to measure it, and the command that makes it."""
        return replace(self, why=f"Missing: {what}. Made by: {command}")
