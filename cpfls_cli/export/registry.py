"""What a vehicle is exported for: the simulators and libraries, what each holds, how it is written and flown."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from importlib import import_module

import numpy as np

from cpfls_cli.errors import InputError, install_command
from cpfls_cli.export.course import Course
from cpfls_cli.export.holding import Held, Holds, Missing, missing, together
from cpfls_cli.export.simulators.functions import casadi_text, fly_casadi, fly_jax, jax_text, whole
from cpfls_cli.export.simulators.mjcf import fly_mjcf, mjcf_held, mjcf_text
from cpfls_cli.export.simulators.rotorpy import fly_rotorpy, rotorpy_held, rotorpy_text
from cpfls_cli.export.simulators.sdf import fly_sdf, sdf_held, sdf_text
from cpfls_cli.export.vehicle_sheet import VehicleSheet
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.playback.motion import State

Write = Callable[[VehicleSheet, Held, Sequence[str], str], str]


@dataclass(frozen=True)
class Target:
    """A simulator or library that a vehicle is exported for.

    Attributes
    ----------
    title : str
    ending : str
        Of its files.
    package : str
        That flies it; empty where this program does.
    step_s : float
        Longest step that it is flown with; infinite where it takes the flight's own.
    levels : int
        Flights, each with half the step of the one before, that a step of no length follows from; 0 for a target that
        takes the very steps of a playback.
    held : callable
        From a vehicle to what the target flies of it, and to how it takes weights.
    write, fly : callable
    """

    title: str
    ending: str
    package: str
    step_s: float
    levels: int
    held: Callable[[VehicleModel], tuple[Held, Holds]]
    write: Write
    fly: Callable[[str, Course], State]


TARGETS = {
    "mjcf": Target("MuJoCo", ".xml", "mujoco", 1e-3, 4, mjcf_held, mjcf_text, fly_mjcf),
    "sdf": Target("Gazebo's motor model", ".sdf", "", 1e-3, 4, sdf_held, sdf_text, fly_sdf),
    "rotorpy": Target("RotorPy", ".py", "rotorpy", np.inf, 4, rotorpy_held, rotorpy_text, fly_rotorpy),
    "casadi": Target("CasADi", ".py", "casadi", np.inf, 0, whole, casadi_text, fly_casadi),
    "jax": Target("JAX", ".py", "jax", np.inf, 0, whole, jax_text, fly_jax),
}
"""By the word of ``--format``."""


@dataclass(frozen=True)
class Exported:
    """A vehicle as a target takes it.

    Attributes
    ----------
    text : str
        Of the file.
    held : Held
    missing : tuple of Missing
    told : tuple of str
        What the target does not hold, in words.
    """

    text: str
    held: Held
    missing: tuple[Missing, ...]
    told: tuple[str, ...]


def exported(sheet: VehicleSheet, form: str, file: str) -> Exported:
    """Write a vehicle for a target.

    Parameters
    ----------
    form : str
        Of `TARGETS`.
    file : str
        Name of the file.

    Raises
    ------
    InputError
        If the target cannot hold the vehicle at all.
    """
    target = TARGETS[form]
    try:
        held, holds = target.held(sheet.model)
    except InputError as error:
        raise InputError(f"{sheet.file}: {error}") from None
    left, told = _left(sheet, held, holds, target.title)
    return Exported(target.write(sheet, held, [*sheet.facts, "", *told], file), held, left, told)


def tabled(sheet: VehicleSheet, title: str) -> tuple[VehicleSheet, tuple[Missing, ...]]:
    """Take what a table of weights holds of a vehicle.

    Parameters
    ----------
    title : str
        Of the language that it is written in.

    Returns
    -------
    sheet : VehicleSheet
        That says what is left out.
    missing : tuple of Missing
    """
    model = replace(sheet.model, fuzzy=None)
    left, told = _left(sheet, Held.whole(model), lambda weights: weights, title)
    return replace(sheet, model=model, worth=(*sheet.worth, *told)), left


def _left(sheet: VehicleSheet, held: Held, holds: Holds, title: str) -> tuple[tuple[Missing, ...], tuple[str, ...]]:
    """List what is left of a vehicle, and say so."""
    about_hover = missing(sheet.model, held, holds, np.array(sheet.floor), sheet.wind)
    left = (*about_hover, *sheet.outside)
    told = tuple(each.sentence for each in left)
    if len(about_hover) - any(sheet.wind) > 1:
        off = together(sheet.model, held).sentence
        told = (*told, f"{title} ends {off} off in all after half a second about hover.")
    return left, told or (f"{title} holds all of it.",)


def require_package(form: str) -> None:
    """Refuse to fly with a package that is not installed.

    Raises
    ------
    InputError
        With the command that installs it.
    """
    package = TARGETS[form].package
    try:
        import_module(package or "cpfls_cli")
    except ImportError:
        raise InputError(
            f"--format {form}: flying it needs the package {package}; {install_command('simulators')}"
        ) from None
