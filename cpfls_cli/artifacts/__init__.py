"""Artifacts: the HDF5 files between the stages, their formats and their checks."""

from cpfls_cli.artifacts.check import check_artifact
from cpfls_cli.artifacts.formats import CHECKPOINT, FLIGHT, FORMATS, MODEL, PREDICTION, SELECTION, TRAJECTORY, format_of
from cpfls_cli.artifacts.gap_formats import DIAGNOSIS, DISAGREEMENT, EXTENDED
from cpfls_cli.artifacts.hashing import file_sha256
from cpfls_cli.artifacts.output import check_output, write_text
from cpfls_cli.artifacts.reading import format_name, read_artifact
from cpfls_cli.artifacts.records import Artifact, Header, InputFile
from cpfls_cli.artifacts.spec import SCHEMA_VERSION, ArtifactSpec, DatasetSpec
from cpfls_cli.artifacts.writing import write_artifact

__all__ = [
    "CHECKPOINT",
    "DIAGNOSIS",
    "DISAGREEMENT",
    "EXTENDED",
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
