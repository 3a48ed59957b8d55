"""Read the artifacts that a stage needs, and refuse those that it cannot use."""

from __future__ import annotations

from pathlib import Path

from cpfls_cli.artifacts.check import check_artifact
from cpfls_cli.artifacts.spec import ArtifactSpec
from cpfls_cli.artifacts.store import Artifact, read_artifact
from cpfls_cli.errors import InputError


def read_with(path: Path, spec: ArtifactSpec, *needed: str) -> Artifact:
    """Read an artifact that must hold certain signals.

    Parameters
    ----------
    *needed : str
        Dataset paths.

    Raises
    ------
    InputError
        If one is missing or breaks the format; the message names the file and the signal.
    """
    artifact = read_good(path, spec)
    missing = [name for name in needed if name not in artifact.data]
    if missing:
        raise InputError(f"{path}: lacks {', '.join(missing)}; this stage needs {', '.join(needed)}")
    if any(artifact.array(name).size == 0 for name in needed):
        raise InputError(f"{path}: holds no samples")
    return artifact


def read_good(path: Path, spec: ArtifactSpec) -> Artifact:
    """Read an artifact that keeps to its format.

    Raises
    ------
    InputError
        Naming every dataset that has a wrong shape or kind, or is not finite where it must be.
    """
    artifact = read_artifact(path, spec)
    findings = check_artifact(artifact)
    if findings:
        raise InputError("\n".join(f"{path}: {finding}" for finding in findings))
    return artifact
