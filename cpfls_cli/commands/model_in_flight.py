"""A model from its artifact, as the simulation flies it."""

from __future__ import annotations

from pathlib import Path

from cpfls_cli.artifacts.base_file import base_artifact, base_model, model_base
from cpfls_cli.artifacts.effects_file import effects_of
from cpfls_cli.artifacts.extended_file import is_extended
from cpfls_cli.artifacts.formats import EXTENDED
from cpfls_cli.artifacts.store import Artifact
from cpfls_cli.config.study import Study
from cpfls_cli.effects.registry import VEHICLE_NUMBERS
from cpfls_cli.errors import InputError, SettingError
from cpfls_cli.flights.same_vehicle import require_vehicle_of
from cpfls_cli.flights.sources import read_good
from cpfls_cli.simulation import SimulatedModel, simulated_model


def model_in_flight(path: Path, study: Study) -> SimulatedModel:
    """Read the model that is to be flown.

    Parameters
    ----------
    path : Path
        A model with effects, or an identified one.

    Raises
    ------
    InputError
        If the file is neither, was made with another vehicle, or has an effect that cannot be flown.
    """
    if not is_extended(path):
        return SimulatedModel(base_model(model_base(path, study), path))
    artifact = read_good(path, EXTENDED)
    require_vehicle_of(path, artifact, study)
    try:
        return simulated_model(base_model(base_artifact(artifact), path), _fitted(artifact), study.vehicle)
    except SettingError as error:
        name = error.key.rsplit(".", 1)[-1]
        raise InputError(f"{path}: its effect {name} cannot be flown: {error}") from None


def _fitted(artifact: Artifact) -> dict[str, dict[str, float]]:
    """Take the values of all effects; refitted numbers of the vehicle are those of all that is flown."""
    effects = {e.name: {c.name: c.value for c in e.coefficients} for e in effects_of(artifact)}
    numbers = zip(artifact.texts("parameter/name"), artifact.array("parameter/value").tolist(), strict=True)
    return {**effects, VEHICLE_NUMBERS.name: dict(numbers)}
