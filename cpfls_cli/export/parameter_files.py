"""Parameters for autopilots in the files that their ground stations load."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple

import numpy as np

from cpfls_cli.autopilots.parameters import Autopilot
from cpfls_cli.export.text import number
from cpfls_cli.tuning.gains import ParameterRow

Rows = Mapping[str, ParameterRow]
"""Parameters by name."""

_INTEGER, _FLOAT = 6, 9
"""Types of MAVLink, as QGroundControl writes them."""

QGROUNDCONTROL_HEAD = "# Vehicle-Id Component-Id Name Value Type"


def qgroundcontrol_line(name: str, value: float) -> str:
    """Write a parameter for QGroundControl; whole numbers are those that come as integers."""
    return f"1\t1\t{name}\t{number(value, '.9g')}\t{_INTEGER if isinstance(value, int) else _FLOAT}"


def parameter_file(autopilot: Autopilot, version: str, about: str, rows: Rows) -> tuple[str, str]:
    """Write parameters for the ground station of an autopilot: the suffix of such files, and the text.

    Parameters
    ----------
    version : str
        Of the firmware; empty for the one whose documented ranges are known.
    about : str
        What they are, for the first lines.

    References
    ----------
    QGroundControl, Parameters; Mission Planner, parameter files; Betaflight CLI; cflib, param_file_helper.
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


def _comments(rows: Rows, line: Callable[[str, ParameterRow], str]) -> Iterator[str]:
    for name, row in rows.items():
        yield f"# {_comment(row)}"
        yield line(name, row)


def _comment(row: ParameterRow) -> str:
    """Say what a parameter is, what it was, and what its documentation allows."""
    unit = f" ({row.unit})" if row.unit else ""
    before = f"now {row.today:.6g}" if np.isfinite(row.today) else f"default {row.default:.6g}"
    most = f"{row.high:.6g}" if np.isfinite(row.high) else "no limit given"
    cut = f"; {row.wanted:.4g} was wanted, which is outside" if row.clipped else ""
    return f"{row.meaning}{unit}: {before}; documented range {row.low:.6g} to {most}{cut}"


def _qgroundcontrol(rows: Rows) -> Iterator[str]:
    yield QGROUNDCONTROL_HEAD
    yield from _comments(rows, lambda name, row: qgroundcontrol_line(name, float(row.proposed)))


def _mission_planner(rows: Rows) -> Iterator[str]:
    yield from _comments(rows, lambda name, row: f"{name},{_value(row)}")


_SLIDERS = ("# own values in place of the sliders", "set simplified_pids_mode = OFF")


def _betaflight(rows: Rows) -> Iterator[str]:
    yield from _SLIDERS
    yield from _comments(rows, lambda name, row: f"set {name} = {round(row.proposed)}")
    yield "save"


def _crazyflie(rows: Rows) -> Iterator[str]:
    yield "type: persistent_param_state"
    yield "version: '1'"
    yield "params:"
    for name, row in rows.items():
        yield f"  # {_comment(row)}"
        yield f"  {name}:"
        yield f"    default_value: {number(row.default, '.9g')}"
        yield "    is_stored: true"
        yield f"    stored_value: {_value(row)}"


def _value(row: ParameterRow) -> str:
    return number(row.proposed, ".9g")


class _Form(NamedTuple):
    suffix: str
    how: tuple[str, ...]
    lines: Callable[[Rows], Iterator[str]]


_FORMS = {
    "px4": _Form(
        ".params", ("QGroundControl: Vehicle Configuration, Parameters, Tools, Load from file",), _qgroundcontrol
    ),
    "ardupilot": _Form(".param", ("Mission Planner: Config, Full Parameter List, Load from file",), _mission_planner),
    "betaflight": _Form(".txt", ("Betaflight Configurator: CLI, Load from file",), _betaflight),
    "crazyflie": _Form(".yaml", ("cfclient: Parameters, Load; or cflib, ParamFileHelper",), _crazyflie),
}
