"""RotorPy: the dictionary of numbers that its ``Multirotor`` takes, in a module of Python that is read, not executed.

Its equations, as published with it (``multirotor.py``): with rotor speeds w in rad/s and velocities u of the hubs
through the air, ``k_eta w^2 + k_h (u_x^2 + u_y^2)`` is the thrust along z, ``rotor_directions k_m w^2`` the torque on
the body about z, ``-w (k_d u_x, k_d u_y, k_z u_z)`` the drag of a rotor, ``-k_flap w (u_y, -u_x, 0)`` its flapping
moment, and ``-|v| (c_Dx v_x, c_Dy v_y, c_Dz v_z)`` the drag of the frame; speeds follow commands with ``tau_m``.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.errors import InputError
from cpfls_cli.simulators.document import Stated
from cpfls_cli.simulators.literals import Numbers, python_numbers
from cpfls_cli.simulators.model import Rotor, SimulatorModel, of_one_body

CANNOT = ("its centre of mass: rotor_pos is from there", "what differs between its rotors: it has one number for all")
_ENTRIES = ("Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")


def read_rotorpy(file: Path) -> SimulatorModel:
    """Read a module with RotorPy's dictionary.

    InputError if it does anything else than state numbers, or has none or several such dictionaries.
    """
    numbers = python_numbers(file)
    names = [str(name) for name in numbers.below() if {"mass", "k_eta"} <= set(numbers.below(name))]
    if len(names) != 1:
        many = f"several dictionaries with mass and k_eta, {', '.join(names)}; keep one" if names else ""
        raise InputError(
            f"{file}: has {many or 'no dictionary with mass and k_eta, as quad_params of RotorPy; give one'}"
        )
    (name,) = names
    body = of_one_body(
        numbers.need(name, "mass"),
        [numbers.need(name, entry) for entry in _ENTRIES],
        "rotor_pos is from the centre of mass",
    )
    effects = {
        effect: {own: _or_zero(numbers, name, key) for own, key in known.rotorpy.items()}
        for effect, known in CATALOGUE.items()
        if known.rotorpy
    }
    return SimulatorModel(name, "rotorpy", (body,), _rotors(numbers, name), CANNOT, (), (file,), effects=effects)


def _or_zero(numbers: Numbers, name: str, key: str) -> Stated:
    absent = Stated(0.0, f"{numbers.file.name}: {name} has no {key}, for which RotorPy takes 0", name=f"{name}.{key}")
    return numbers.get(name, key) or absent


def _rotors(numbers: Numbers, name: str) -> tuple[Rotor, ...]:
    keys = numbers.below(name, "rotor_pos")
    directions = numbers.row(name, "rotor_directions", count=len(keys))
    thrust, lag = numbers.need(name, "k_eta"), numbers.need(name, "tau_m")
    if lag.value < 0:
        raise InputError(f"{lag.where} is {lag.value:g}; write a time constant in s, 0 for none")
    if not thrust.value > 0:
        raise InputError(f"{thrust.where} is {thrust.value:g}; write a number above 0")
    found = []
    for key, direction in zip(keys, directions, strict=True):
        hub = numbers.row(name, "rotor_pos", key, count=3)
        if abs(direction.value) != 1:
            raise InputError(f"{direction.where} is {direction.value:g}; write 1 or -1")
        found.append(
            Rotor(
                str(key),
                hub[0].where,
                np.array([each.value for each in hub]),
                np.array([0.0, 0.0, 1.0]),
                # It has the sign of the torque on the body, which turns against the rotor.
                -int(direction.value),
                thrust=thrust,
                torque=numbers.need(name, "k_m"),
                speed_max=numbers.need(name, "rotor_speed_max"),
                lag_up=lag,
                lag_down=lag,
                drag=_or_zero(numbers, name, "k_d"),
                turn=direction,
                place=tuple(hub),
            )
        )
    return tuple(found)
