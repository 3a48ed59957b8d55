"""Flights that a model is judged on, beside those that it learns from: their roles, and what of them is held out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import chain, count
from pathlib import Path

from cpfls_cli.artifacts.scores import TRAINING
from cpfls_cli.artifacts.spec import InputFile
from cpfls_cli.config.study import Study
from cpfls_cli.errors import ConfigError, InputError
from cpfls_cli.flights.choosing import choosing_roles
from cpfls_cli.flights.flight_source import flight_source
from cpfls_cli.flights.training import flight_roles
from cpfls_cli.identification.data import TorqueSource


def input_roles(
    flights: Sequence[Path], selection: Path | None, validate: Sequence[Path], choose_on: Sequence[Path] = ()
) -> dict[str, Path]:
    """Give the inputs of an identification their roles.

    Parameters
    ----------
    flights : sequence of Path
        That train.
    validate : sequence of Path
        That judge.
    choose_on : sequence of Path
        That the model is chosen on.
    """
    roles = flight_roles(flights) | ({"selection": selection} if selection else {}) | choosing_roles(choose_on)
    return roles | {f"validate-{number}": path for number, path in enumerate(validate, start=1)}


def held_out_parts(
    study: Study, rests: Mapping[str, TorqueSource], inputs: Mapping[str, InputFile], validate: Sequence[Path]
) -> dict[str, TorqueSource]:
    """Gather what is judged but not learned from, under names of their own.

    Parameters
    ----------
    rests : mapping of str to TorqueSource
        What of the flights that train is held out.
    inputs : mapping of str to InputFile
        By role, see `input_roles`.
    validate : sequence of Path
        Other flights.

    Raises
    ------
    ConfigError
        If a part was to be held out, and nothing is left for it.
    InputError
        If one of the flights trains too.
    """
    if study.identification.training_share < 1 and not rests:
        raise ConfigError(
            f"identification.embargo_s = {study.identification.embargo_s:g}: leaves nothing of the flight to be "
            "held out; lower it, or lower identification.training_share"
        )
    parts = dict(rests)
    learned = {file.sha256 for role, file in inputs.items() if role.startswith("flight")}
    for number, path in enumerate(validate, start=1):
        if inputs[f"validate-{number}"].sha256 in learned:
            raise InputError(f"--validate {path}: is the flight that trains; validate on another one")
        parts[_free_name(path.name, {TRAINING, *parts})] = flight_source(path)
    return parts


def _free_name(name: str, taken: set[str]) -> str:
    numbered = (f"{name} ({number})" for number in count(2))
    return next(candidate for candidate in chain([name], numbered) if candidate not in taken)
