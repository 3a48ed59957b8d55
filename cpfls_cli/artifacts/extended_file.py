"""A model with effects, read back from its artifact."""

from __future__ import annotations

from pathlib import Path

from cpfls_cli.artifacts.base_file import base_artifact, base_model
from cpfls_cli.artifacts.effects_file import extended_of
from cpfls_cli.artifacts.formats import EXTENDED
from cpfls_cli.artifacts.store import format_name
from cpfls_cli.config.study import Study
from cpfls_cli.flights.same_vehicle import require_vehicle_of
from cpfls_cli.flights.sources import read_good
from cpfls_cli.gap.extended import ExtendedModel


def is_extended(path: Path) -> bool:
    """Tell whether a file is a model with effects."""
    return path.is_file() and format_name(path) == EXTENDED.format


def read_extended(path: Path, study: Study) -> ExtendedModel:
    """Read a model with effects.

    Raises
    ------
    InputError
        If the file is not one, or was made with another vehicle.
    """
    artifact = read_good(path, EXTENDED)
    require_vehicle_of(path, artifact, study)
    return extended_of(artifact, base_model(base_artifact(artifact), path))
