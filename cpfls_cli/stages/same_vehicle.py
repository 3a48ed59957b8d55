"""Flights and models of one vehicle: what differs is said."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

from cpfls_cli.artifacts.records import Artifact
from cpfls_cli.config.load import parse_config, validate
from cpfls_cli.config.study import Study
from cpfls_cli.errors import InputError
from cpfls_cli.vehicle.settings import VehicleSettings


def require_same_vehicle(path: Path, own: VehicleSettings, wanted: VehicleSettings) -> None:
    """Refuse a file that was made with another vehicle than that of the config.

    Parameters
    ----------
    path : Path
    own : VehicleSettings
        Of the file.
    wanted : VehicleSettings
        Of the config.

    Raises
    ------
    InputError
        Naming the keys that differ.
    """
    different = [f.name for f in fields(own) if getattr(own, f.name) != getattr(wanted, f.name)]
    if different:
        first = different[0]
        values = "" if first == "rotors" else f" ({getattr(own, first)} there, {getattr(wanted, first)} in the config)"
        keys = ", ".join([f"vehicle.{first}{values}", *(f"vehicle.{name}" for name in different[1:])])
        raise InputError(
            f"{path}: was made with another vehicle; not the same: {keys}; use the config of that vehicle, or make the "
            "file again"
        )


def require_vehicle_of(path: Path, artifact: Artifact, study: Study) -> None:
    """Refuse an artifact that was made with another vehicle than that of the config.

    Parameters
    ----------
    path : Path
    artifact : Artifact
    study : Study

    Raises
    ------
    InputError
    """
    source = f"{path}: /config"
    own = validate(parse_config(artifact.header.config, source), source)
    require_same_vehicle(path, own.vehicle, study.vehicle)
