"""What is said of logs that contradict themselves, before a search and after it."""

from __future__ import annotations

import logging
from collections.abc import Sequence

from cpfls_cli.consistency.findings import as_contradiction
from cpfls_cli.report.content import sentence


def contradicted(first: str) -> str:
    """Say before anything else that a log contradicts itself or its config, and where it does so first."""
    return sentence(as_contradiction(sentence(first)))


NOTHING_COMES = (
    "Nothing is searched, for nothing found could be used. Correct what is wrong, in the section `import` of the "
    "config or in `vehicle`, or leave that flight out; --anyway searches all the same."
)
"""What to do about logs that contradict themselves."""


def tell_before_search(contradictions: Sequence[str]) -> None:
    """Say at once, above the progress, that what a long search finds cannot be used."""
    if contradictions:
        logging.getLogger("cpfls_cli").warning("%s No model found in it can be used.", contradicted(contradictions[0]))
