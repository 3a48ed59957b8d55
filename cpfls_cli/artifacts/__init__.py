"""Artifacts: the HDF5 files between the stages, their formats and their checks."""

from cpfls_cli.artifacts.check import check_artifact
from cpfls_cli.artifacts.formats import FLIGHT, FORMATS, MODEL, PREDICTION, SELECTION, TRAJECTORY, format_of
from cpfls_cli.artifacts.spec import SCHEMA_VERSION, ArtifactSpec, DatasetSpec
from cpfls_cli.artifacts.store import (
    Artifact,
    Header,
    InputFile,
    check_output,
    file_sha256,
    format_name,
    read_artifact,
    write_artifact,
    write_text,
)

__all__ = [
    "FLIGHT",
    "FORMATS",
    "MODEL",
    "PREDICTION",
    "SCHEMA_VERSION",
    "SELECTION",
    "TRAJECTORY",
    "Artifact",
    "ArtifactSpec",
    "DatasetSpec",
    "Header",
    "InputFile",
    "check_artifact",
    "check_output",
    "file_sha256",
    "format_name",
    "format_of",
    "read_artifact",
    "write_artifact",
    "write_text",
]
