"""The page of a model: what was found, how good it is, and how far to trust it."""

from __future__ import annotations

from collections.abc import Iterator

from cpfls_cli.artifacts.model import ModelRecord
from cpfls_cli.report.content import Text


def trust_notes(model: ModelRecord, path: object) -> Iterator[Text]:
    """Say what speaks against the use of a model: its search was stopped, it was judged unfit, or not judged at all.

    Parameters
    ----------
    path : Path
        As the model is called in the sentences.
    """
    if not model.complete:
        yield Text(f"{path}: is incomplete: its search was stopped; `cpfls identify --resume` goes on", "warning")
    if model.verdict is None or model.verdict.label is None:
        yield Text(
            f"{path}: has no verdict and no bands; `cpfls identify` with identification.validation.enabled adds them",
            "warning",
        )
    elif model.verdict.label == "do-not-use":
        yield Text(f"{path}: its verdict is: do not use; {model.verdict.reasons[0][0]}", "warning")
