"""What every stage gets and gives back, and the checks they share."""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np

import cpfls_cli
from cpfls_cli.artifacts.spec import ArtifactSpec
from cpfls_cli.artifacts.store import (
    Artifact,
    Header,
    InputFile,
    check_output,
    file_sha256,
    format_name,
    read_artifact,
    write_artifact,
)
from cpfls_cli.config.resolved import resolved_yaml
from cpfls_cli.config.study import Study
from cpfls_cli.errors import InputError


class Progress(Protocol):
    """Shows how far long work has come."""

    def __call__(self, done: int, total: int, note: str = "") -> None:
        """Take note that `done` of `total` steps are done."""
        ...


@dataclass(frozen=True)
class Job:
    """One run of a stage.

    Attributes
    ----------
    study : Study
    output : Path
    force : bool
        Replace an existing output.
    dry_run : bool
        Check everything, compute and write nothing.
    progress : Progress
    """

    study: Study
    output: Path
    force: bool
    dry_run: bool
    progress: Progress


@dataclass(frozen=True)
class Outcome:
    """What a stage has to say.

    Attributes
    ----------
    summary : mapping
        The object that `--json` prints.
    lines : tuple of str
        The same for people.
    warnings : tuple of str
    """

    summary: Mapping[str, Any]
    lines: tuple[str, ...] = ()
    warnings: tuple[str, ...] = field(default=())


def begin(job: Job, *inputs: Path) -> Outcome | None:
    """Check inputs and output of a job before anything is computed.

    Parameters
    ----------
    job : Job
    *inputs : Path

    Returns
    -------
    Outcome or None
        What a dry run says; None where the stage has to go on.

    Raises
    ------
    InputError
        If an input is missing, the output exists or cannot be written, or is one of the inputs.
    """
    for path in inputs:
        if not path.exists():
            raise InputError(f"{path}: no such file")
        if path.is_dir():
            raise InputError(f"{path}: is a folder, not a file")
        if job.output.exists() and path.samefile(job.output):
            raise InputError(f"{job.output}: is an input of this command; -o must name another file")
    check_output(job.output, job.force)
    if not job.dry_run:
        return None
    line = f"{job.output}: would be written; the config and all inputs are good"
    return Outcome({"dry_run": True, "output": str(job.output)}, (line,))


def finish(job: Job, spec: ArtifactSpec, data: Mapping[str, Any], inputs: Mapping[str, Path]) -> None:
    """Write the artifact of a stage.

    Parameters
    ----------
    job : Job
    spec : ArtifactSpec
    data : mapping of str to array
    inputs : mapping of str to Path
        By role.
    """
    header = Header(
        version=cpfls_cli.__version__,
        seed=job.study.seed,
        config=resolved_yaml(job.study),
        inputs={role: input_file(path) for role, path in inputs.items()},
    )
    write_artifact(job.output, Artifact(spec, header, data))


def input_file(path: Path) -> InputFile:
    """Describe an input file by name, hash and format.

    Parameters
    ----------
    path : Path

    Returns
    -------
    InputFile
    """
    return InputFile(path.name, file_sha256(path), format_name(path) or path.suffix.lstrip("."))


def read_with(path: Path, spec: ArtifactSpec, *needed: str) -> Artifact:
    """Read an artifact that must hold certain signals.

    Parameters
    ----------
    path : Path
    spec : ArtifactSpec
    *needed : str
        Dataset paths.

    Returns
    -------
    Artifact

    Raises
    ------
    InputError
        If one is missing or not finite; the message names the file and the signal.
    """
    artifact = read_artifact(path, spec)
    missing = [name for name in needed if name not in artifact.data]
    if missing:
        raise InputError(f"{path}: lacks {', '.join(missing)}; this stage needs {', '.join(needed)}")
    for name in needed:
        values = artifact.array(name)
        if len(values) != len(artifact.array(needed[0])) or len(values) == 0:
            raise InputError(f"{path}: {name} has {len(values)} samples, {needed[0]} {len(artifact.array(needed[0]))}")
        if not np.isfinite(values).all():
            first = int(np.argmin(np.isfinite(values.reshape(len(values), -1)).all(axis=1)))
            raise InputError(f"{path}: {name} is not finite at sample {first}")
    return artifact


def generator(study: Study, stage: str) -> np.random.Generator:
    """Make the random generator of a stage, so that stages draw independently of each other.

    Parameters
    ----------
    study : Study
    stage : str

    Returns
    -------
    numpy.random.Generator
    """
    return np.random.default_rng([study.seed, zlib.crc32(stage.encode())])
