"""Inputs of an identification: flights that train, flights that a model is chosen on, and what judges it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import chain, count
from pathlib import Path

from cpfls_cli.artifacts.gate import format_name, read_origin
from cpfls_cli.artifacts.spec import InputFile
from cpfls_cli.config.study import Study
from cpfls_cli.errors import ConfigError, InputError
from cpfls_cli.flights.flight import Flight
from cpfls_cli.flights.flight_source import flight_source
from cpfls_cli.flights.training import flight_roles
from cpfls_cli.identification.data import TorqueSource, joined
from cpfls_cli.identification.scores import TRAINING
from cpfls_cli.logs.formats import is_log


def input_roles(
    flights: Sequence[Path], selection: Path | None, validate: Sequence[Path], choose_on: Sequence[Path] = ()
) -> dict[str, Path]:
    """Give the inputs of an identification their roles."""
    roles = flight_roles(flights) | ({"selection": selection} if selection else {})
    return roles | numbered_roles("choose-on", choose_on) | numbered_roles("validate", validate)


def numbered_roles(role: str, flights: Sequence[Path]) -> dict[str, Path]:
    """Give flights of one role numbers: ``choose-on-1``, ``choose-on-2`` and so on."""
    return {f"{role}-{number}": path for number, path in enumerate(flights, start=1)}


def hashes_of(path: Path, file: InputFile) -> tuple[str, ...]:
    """Give the hashes that a flight is known by: that of its file, and that of the log that it was imported from."""
    log = None if is_log(path) else read_origin(path).inputs.get("log")
    return (file.sha256,) if log is None else (file.sha256, log.sha256)


def once(given: Mapping[str, Path], inputs: Mapping[str, InputFile]) -> tuple[dict[str, Path], list[str]]:
    """Leave out copies of a flight; one that is of today and of the reference is refused."""
    known: dict[str, str] = {}
    kept, warnings = {}, []
    for role, path in given.items():
        hashes = hashes_of(path, inputs[role])
        same = next((known[each] for each in hashes if each in known), None)
        if same is None:
            kept[role] = path
            known.update(dict.fromkeys(hashes, role))
        elif same.partition("-")[0] != role.partition("-")[0]:
            also = "" if given[same].name == path.name else f", as {given[same]}"
            raise InputError(
                f"{path}: is both a flight of today and one of the reference (--reference){also}; leave it out of one"
            )
        else:
            warnings.append(f"{path.name}: is given twice, also as {given[same].name}; counted once")
    return kept, warnings


def log_formats(paths: Sequence[Path]) -> set[str]:
    """Gather the endings, in small letters, of the logs among some files, and of those that flights were made from."""
    known = {path.suffix.lstrip(".").lower() for path in paths if is_log(path)}
    flights = (path for path in paths if format_name(path) == Flight.FORMAT)
    made = (read_origin(path).inputs.get("log") for path in flights)
    return known | {"" if log is None else log.format.lower() for log in made}


def known_by(paths: Mapping[str, Path], inputs: Mapping[str, InputFile]) -> list[tuple[str, tuple[str, ...]]]:
    """List flights once each: file name, and the hashes that it is known by."""
    return list(dict.fromkeys((inputs[role].name, hashes_of(path, inputs[role])) for role, path in paths.items()))


def choosing_source(flights: Sequence[Path], inputs: Mapping[str, InputFile]) -> TorqueSource | None:
    """Open the flights to choose on, None where there are none; a model was fitted to what is another input too."""
    for role, path in numbered_roles("choose-on", flights).items():
        others = {other: file for other, file in inputs.items() if other != role}
        same = next((other for other, file in others.items() if file.sha256 == inputs[role].sha256), None)
        if same is not None:
            raise InputError(f"--choose-on {path}: {_USED[same.partition('-')[0]]}; choose on another flight")
    return joined([flight_source(path) for path in flights]) if flights else None


_USED = {
    "flight": "is a training flight",
    "selection": "is the selection, not a flight",
    "validate": "judges (--validate)",
    "choose": "is given twice",
}


def held_out_parts(
    study: Study, rests: Mapping[str, TorqueSource], inputs: Mapping[str, InputFile], validate: Sequence[Path]
) -> dict[str, TorqueSource]:
    """Gather what is judged but not learned from, under names of their own: rests of flights that train, and others."""
    if study.identification.training_share < 1 and not rests:
        raise ConfigError(
            f"identification.embargo_s = {study.identification.embargo_s:g}: leaves nothing of the flight to be "
            "held out; lower it, or lower identification.training_share"
        )
    parts = dict(rests)
    learned = {file.sha256 for role, file in inputs.items() if role.startswith("flight")}
    for role, path in numbered_roles("validate", validate).items():
        if inputs[role].sha256 in learned:
            raise InputError(f"--validate {path}: is the training flight; validate on another one")
        names = chain([path.name], (f"{path.name} ({number})" for number in count(2)))
        parts[next(name for name in names if name not in {TRAINING, *parts})] = flight_source(path)
    return parts
