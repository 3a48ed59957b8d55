"""What to know of a model before it is used: unfinished, judged unfit, or not judged at all."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from cpfls_cli.artifacts.store import Artifact


def trust_notes(model: Artifact, path: Path) -> Iterator[str]:
    """Say what speaks against the use of an identified model.

    Parameters
    ----------
    model : Artifact
        In the format of identified models.

    Yields
    ------
    str
        A sentence each; none for a model that was searched for to the end and judged fit.
    """
    if "search/complete" in model.data and not model.number("search/complete"):
        yield f"{path}: is incomplete: its search was stopped; `cpfls identify --resume` goes on"
    if "verdict/label" not in model.data:
        yield f"{path}: has no verdict and no bands; `cpfls identify` with identification.validation.enabled adds them"
    elif model.text("verdict/label") == "do-not-use":
        yield f"{path}: its verdict is: do not use; {model.texts('verdict/reason')[0]}"
