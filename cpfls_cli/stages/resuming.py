"""What searches and sweeps share where they are to be resumed."""

from __future__ import annotations

from pathlib import Path

from cpfls_cli.artifacts.formats import MODEL
from cpfls_cli.artifacts.reading import format_name, read_artifact
from cpfls_cli.artifacts.spec import ArtifactSpec
from cpfls_cli.artifacts.sweep_formats import SWEEP
from cpfls_cli.errors import InputError

_COMPLETE = {MODEL.format: "search/complete", SWEEP.format: "complete"}


def nothing_to_resume(left: Path, output: Path, spec: ArtifactSpec) -> InputError:
    """Say why there is nothing to resume.

    Parameters
    ----------
    left : Path
        What a stopped command leaves, and did not.
    output : Path
        What the command is for.
    spec : ArtifactSpec
        Of the output.

    Returns
    -------
    InputError
    """
    if _is_complete(output, spec):
        return InputError(f"{output}: is complete; nothing to resume")
    return InputError(f"{left}: no such file, so nothing to resume; start without --resume")


def _is_complete(output: Path, spec: ArtifactSpec) -> bool:
    if not output.is_file() or format_name(output) != spec.format:
        return False
    return bool(read_artifact(output, spec).data.get(_COMPLETE[spec.format], True))
