"""What a vehicle is exported for: the simulators and libraries, what each holds, how it is written and flown."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
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
    left = tuple(missing(sheet.model, held, holds, np.array(sheet.floor), sheet.outside))
    told = tuple(each.sentence for each in left)
    if sum(each.off is not None for each in left) > 1:
        off = together(sheet.model, held).sentence
        told = (*told, f"{target.title} ends {off} off in all after half a second about hover.")
    told = told or (f"{target.title} holds all of it.",)
    return Exported(target.write(sheet, held, [*sheet.facts, "", *told], file), held, left, told)


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
