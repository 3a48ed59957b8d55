"""A model from its artifact, as the simulation flies it."""

from __future__ import annotations

from pathlib import Path

from cpfls_cli.artifacts.extended import ExtendedRecord
from cpfls_cli.artifacts.store import holds
from cpfls_cli.commands.compare import base_of
from cpfls_cli.config.study import Study
from cpfls_cli.effects.registry import VEHICLE_NUMBERS
from cpfls_cli.errors import InputError, SettingError
from cpfls_cli.flights.same_vehicle import read_of_vehicle
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
    if not holds(path, ExtendedRecord):
        return SimulatedModel(base_of(path, study).rebuilt(path))
    record = read_of_vehicle(path, ExtendedRecord, study)
    try:
        return simulated_model(record.base.rebuilt(path), _fitted(record), study.vehicle)
    except SettingError as error:
        name = error.key.rsplit(".", 1)[-1]
        raise InputError(f"{path}: its effect {name} cannot be flown: {error}") from None


def _fitted(record: ExtendedRecord) -> dict[str, dict[str, float]]:
    """Take the values of all effects; refitted numbers of the vehicle are those of all that is flown."""
    effects = {effect.name: {c.name: c.value for c in effect.coefficients} for effect in record.effects.effects()}
    return {**effects, VEHICLE_NUMBERS.name: record.effects.parameter.values}
