"""Parameters for autopilots in the files that their ground stations load."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from cpfls_cli.artifacts.gains import GainsRecord, ParameterRow
from cpfls_cli.autopilots.parameters import Autopilot
from cpfls_cli.autopilots.registry import AUTOPILOTS

_FLOAT = 9
"""Type of MAVLink, as QGroundControl writes it."""


def parameter_file(record: GainsRecord, name: str) -> tuple[str, str]:
    """Write the proposed parameters for the ground station of their autopilot.

    Parameters
    ----------
    name : str
        Of the artifact, for the first line.

    Returns
    -------
    suffix : str
        Of such files.
    text : str

    References
    ----------
    QGroundControl, Parameters; Mission Planner, parameter files; Betaflight CLI; cflib, param_file_helper.
    """
    about = f"gains of cpfls for {record.vehicle_name}, see {name}"
    return file_of(AUTOPILOTS[record.autopilot], record.firmware or "", about, record.rows)


def file_of(autopilot: Autopilot, version: str, about: str, rows: Sequence[ParameterRow]) -> tuple[str, str]:
    """Write parameters for the ground station of an autopilot: the suffix of such files, and the text.

    Parameters
    ----------
    version : str
        Of the firmware; empty for the one whose documented ranges are known.
    """
    form = _FORMS[autopilot.name]
    head = [
        f"# For {_version(autopilot, version)}.",
        f"# {autopilot.title}: {about}",
        *(f"# {each}" for each in form.how),
    ]
    lines = form.lines(rows)
    if autopilot.firmware.too_old(version):
        # Older versions have no sliders.
        lines = (each for each in lines if each not in _SLIDERS)
    return form.suffix, "\n".join([*head, *lines]) + "\n"


def _version(autopilot: Autopilot, version: str) -> str:
    """Name the version of the firmware that the file is for, and whose documented ranges it has."""
    known = autopilot.firmware.title
    own = version or known
    return own if own == known else f"{own}, as the log says; documented ranges and defaults are those of {known}"


def _comments(rows: Sequence[ParameterRow], line: Callable[[ParameterRow], str]) -> Iterator[str]:
    for row in rows:
        yield f"# {comment(row)}"
        yield line(row)


def comment(row: ParameterRow) -> str:
    """Say what a parameter is, what it was, and what its documentation allows."""
    unit = f" ({row.unit})" if row.unit else ""
    before = f"now {row.today:.6g}" if np.isfinite(row.today) else f"default {row.default:.6g}"
    most = f"{row.high:.6g}" if np.isfinite(row.high) else "no limit given"
    cut = f"; {row.wanted:.4g} was wanted, which is outside" if row.clipped else ""
    return f"{row.meaning}{unit}: {before}; documented range {row.low:.6g} to {most}{cut}"


def _qgroundcontrol(rows: Sequence[ParameterRow]) -> Iterator[str]:
    yield "# Vehicle-Id Component-Id Name Value Type"
    yield from _comments(rows, lambda row: f"1\t1\t{row.name}\t{_value(row)}\t{_FLOAT}")


def _mission_planner(rows: Sequence[ParameterRow]) -> Iterator[str]:
    yield from _comments(rows, lambda row: f"{row.name},{_value(row)}")


_SLIDERS = ("# own values in place of the sliders", "set simplified_pids_mode = OFF")


def _betaflight(rows: Sequence[ParameterRow]) -> Iterator[str]:
    yield from _SLIDERS
    yield from _comments(rows, lambda row: f"set {row.name} = {round(row.proposed)}")
    yield "save"


def _crazyflie(rows: Sequence[ParameterRow]) -> Iterator[str]:
    yield "type: persistent_param_state"
    yield "version: '1'"
    yield "params:"
    for row in rows:
        yield f"  # {comment(row)}"
        yield f"  {row.name}:"
        yield f"    default_value: {row.default:.9g}"
        yield "    is_stored: true"
        yield f"    stored_value: {_value(row)}"


def _value(row: ParameterRow) -> str:
    return f"{row.proposed:.9g}"


class _Form(NamedTuple):
    suffix: str
    how: tuple[str, ...]
    lines: Callable[[Sequence[ParameterRow]], Iterator[str]]


_FORMS = {
    "px4": _Form(
        ".params", ("QGroundControl: Vehicle Configuration, Parameters, Tools, Load from file",), _qgroundcontrol
    ),
    "ardupilot": _Form(".param", ("Mission Planner: Config, Full Parameter List, Load from file",), _mission_planner),
    "betaflight": _Form(".txt", ("Betaflight Configurator: CLI, Load from file",), _betaflight),
    "crazyflie": _Form(".yaml", ("cfclient: Parameters, Load; or cflib, ParamFileHelper",), _crazyflie),
}
