"""The model that flights are compared with: the vehicle of the config, an identified model, or one with effects."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from cpfls_cli.artifacts.formats import MODEL
from cpfls_cli.artifacts.model_file import read_model
from cpfls_cli.artifacts.spec import Header
from cpfls_cli.artifacts.store import Artifact
from cpfls_cli.config.study import Study
from cpfls_cli.flights.same_vehicle import require_vehicle_of
from cpfls_cli.flights.sources import read_good
from cpfls_cli.identification.model import Model

_COPIED = ("weights", "coefficients", "rigid_body", "input_range", "visited")


def model_base(path: Path, study: Study) -> Artifact:
    """Read an identified model as the base of a comparison.

    Raises
    ------
    InputError
        If it was identified with another vehicle.
    """
    artifact = read_good(path, MODEL)
    require_vehicle_of(path, artifact, study)
    return artifact


def base_data(model: Artifact | None) -> dict[str, Any]:
    """Arrange a base as datasets.

    Parameters
    ----------
    model : Artifact or None
        None for the rigid body of the vehicle.
    """
    if model is None:
        return {"base/kind": np.array("rigid-body")}
    copied = {f"base/{name}": model.data[f"model/{name}"] for name in _COPIED}
    return {"base/kind": np.array("model"), "base/config": np.array(model.header.config), **copied}


def base_artifact(artifact: Artifact) -> Artifact | None:
    """Take the identified model out of an artifact that was made with one.

    Returns
    -------
    Artifact or None
        With what prediction needs; None for the rigid body of the vehicle.
    """
    if artifact.text("base/kind") == "rigid-body":
        return None
    header = Header(artifact.header.version, artifact.header.seed, artifact.text("base/config"))
    return Artifact(MODEL, header, {f"model/{name}": artifact.data[f"base/{name}"] for name in _COPIED})


def base_model(model: Artifact | None, path: Path) -> Model | None:
    """Rebuild the base.

    Parameters
    ----------
    path : Path
        For messages.

    Returns
    -------
    Model or None
        None for the rigid body of the vehicle.
    """
    return None if model is None else read_model(model, path)
