"""Flights kept to choose a model on: neither learned from nor judged on in the end."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from cpfls_cli.artifacts.spec import InputFile
from cpfls_cli.errors import InputError
from cpfls_cli.flights.flight_source import flight_source
from cpfls_cli.identification.data import TorqueSource, joined

_ROLE = "choose-on"


def choosing_roles(flights: Sequence[Path]) -> dict[str, Path]:
    """Give flights to choose on their roles as inputs: ``choose-on-1``, ``choose-on-2`` and so on."""
    return {f"{_ROLE}-{number}": path for number, path in enumerate(flights, start=1)}


def choosing_source(flights: Sequence[Path], inputs: Mapping[str, InputFile]) -> TorqueSource | None:
    """Open the flights to choose on.

    Parameters
    ----------
    inputs : mapping of str to InputFile
        All inputs of the command by role.

    Returns
    -------
    TorqueSource or None
        None where there are none.

    Raises
    ------
    InputError
        If one of them is another input too: what was chosen on a flight has been fitted to it.
    """
    for role, path in choosing_roles(flights).items():
        others = {other: file for other, file in inputs.items() if other != role}
        same = next((other for other, file in others.items() if file.sha256 == inputs[role].sha256), None)
        if same is not None:
            raise InputError(f"--choose-on {path}: {_USED[same.partition('-')[0]]}; choose on another flight")
    return joined([flight_source(path) for path in flights]) if flights else None


_USED = {
    "flight": "is a flight that trains",
    "selection": "is the selection, no flight",
    "validate": "judges (--validate)",
    "choose": "is given twice",
}
