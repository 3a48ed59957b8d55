"""crazyflow and drone-models: a section of physical parameters of their first-principles dynamics, in TOML.

Their equations, as published with them (``first_principles/model.py``): with rotor speeds n in rpm, each rotor lifts by
``rpm2thrust[0] + rpm2thrust[1] n + rpm2thrust[2] n^2`` and turns the body by ``rpm2torque`` alike, ``mixing_matrix``
times ``(L, L, 1)`` has their levers and turns, ``drag_matrix v`` is the drag at the centre of mass, and
``dn/dt = c0 (m - n) + c1 (m^2 - n^2)`` up and with c2 and c3 down, by ``rotor_dyn_coef``, m being the command.

A study has thrust and torque by squared speed alone: the thrust of hover, and the torque whose slope is that in hover,
for there the torques of the rotors cancel. The whole curve is corrected.
"""

from __future__ import annotations

from dataclasses import replace
from math import sqrt
from pathlib import Path

import numpy as np

from cpfls_cli.errors import InputError
from cpfls_cli.simulators.document import Stated
from cpfls_cli.simulators.literals import Numbers, toml_numbers
from cpfls_cli.simulators.model import GRAVITY, Rotor, SimulatorModel, of_one_body
from cpfls_cli.units import RPM

CANNOT = (
    "its centre of mass, and how high its rotors are: mixing_matrix and L are in the plane of that",
    "what differs between its rotors: it has one curve for all",
)


def read_crazyflow(file: Path, section: str) -> SimulatorModel:
    """Read a section of parameters, the only one where none is named.

    InputError if it has no such section, or several and none is named.
    """
    numbers = toml_numbers(file)
    sections = [str(name) for name in numbers.below() if "mass" in numbers.below(name)]
    if not sections:
        raise InputError(
            f"{file}: has no section that states a mass; give drone_models/data/params.toml, or one like it"
        )
    if section not in sections and (section or len(sections) > 1):
        raise InputError(f"{file}: has the vehicles {', '.join(sections)}; name one of them, as {file}:{sections[0]}")
    name = section or sections[0]
    rows = [numbers.row(name, "J", row, count=3) for row in range(3)]
    entries = [replace(rows[i][j], also=(rows[j][i],) if i != j else ()) for i, j in _INERTIA]
    body = of_one_body(
        numbers.need(name, "mass"), entries, "mixing_matrix and L are from the centre of mass: there is no other"
    )
    rotors, notes = _rotors(numbers, name, body.mass.value * GRAVITY)
    return SimulatorModel(name, "crazyflow", (body,), rotors, CANNOT, notes, (file,))


_INERTIA = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


def _rotors(numbers: Numbers, name: str, weight: float) -> tuple[tuple[Rotor, ...], tuple[str, ...]]:
    count = numbers.count(name, "mixing_matrix", 0)
    if not count or not weight > 0:
        raise InputError(f"{numbers.file}: {name} has no mixing_matrix of rotors, or no mass above 0; write both")
    mixing = [numbers.row(name, "mixing_matrix", row, count=count) for row in range(3)]
    length = numbers.need(name, "L").value
    thrust, torque, dynamics = (
        numbers.row(name, key, count=wide)
        for key, wide in (("rpm2thrust", 3), ("rpm2torque", 3), ("rotor_dyn_coef", 4))
    )
    hover = _speed_at(thrust, weight / count)
    limit = numbers.get(name, "thrust_max")
    most = None if limit is None else Stated(_speed_at(thrust, limit.value) / RPM, f"{limit.where}, by rpm2thrust")
    drags = [numbers.need(name, "drag_matrix", axis, axis) for axis in range(2)]
    ends = [Stated(each.value, each.where, each.span, name=each.name) for each in drags]
    along = -count * hover / RPM
    drag = replace(ends[0], value=ends[0].value / along, scale=along, also=(ends[1],))
    rotors = tuple(
        Rotor(
            f"rotor {index + 1}",
            mixing[0][index].where,
            np.array([-length * mixing[1][index].value, length * mixing[0][index].value, 0.0]),
            np.array([0.0, 0.0, 1.0]),
            # It has the sign of the torque on the body, which turns against the rotor.
            -int(np.sign(mixing[2][index].value)),
            thrust=_square(thrust, hover),
            torque=_square(torque, hover, slope=True),
            speed_max=most,
            most=limit,
            lag_up=_lag(dynamics[:2], hover),
            lag_down=_lag(dynamics[2:], hover),
            drag=drag,
            turn=mixing[2][index],
            place=tuple(
                replace(own, value=sign * length * own.value, scale=sign / length)
                for own, sign in ((mixing[1][index], -1.0), (mixing[0][index], 1.0))
            ),
        )
        for index in range(count)
    )
    linear = thrust[0].value != 0 or thrust[1].value != 0
    curve = f"thrust and torque are those of hover, at {hover:.0f} rpm; the file has curves, which are kept in shape"
    return rotors, (curve,) if linear else ()


def _speed_at(curve: list[Stated], thrust: float) -> float:
    """Give the speed of a thrust, rpm."""
    still, linear, square = (each.value for each in curve)
    inner = linear**2 + 4 * square * (thrust - still)
    if not square > 0 or inner < 0:
        raise InputError(f"{curve[2].where}: no speed lifts {thrust:.3g} N by this curve; write a number above 0 there")
    return (sqrt(inner) - linear) / (2 * square)


def _square(curve: list[Stated], hover: float, *, slope: bool = False) -> Stated:
    """Give the factor of squared speed in rad/s that has the value of a curve in hover, or its slope."""
    still, linear, square = (each.value for each in curve)
    whole = still + linear * hover if not slope else linear * hover / 2
    value, main = (square + whole / hover**2) * RPM**2, curve[2]
    if not value > 0:
        raise InputError(f"{main.where}: the curve is not above 0 in hover; correct it there")
    rest = tuple(each for each in curve[:2] if each.value != 0)
    return Stated(value, f"{main.where}, in hover", main.span, main.value / value, name=main.name, also=rest)


def _lag(rates: list[Stated], hover: float) -> Stated | None:
    """Give the time constant about hover; its numbers are rates."""
    parts = [rates[0].value, 2 * hover * rates[1].value]
    if not sum(parts) > 0:
        return None
    main, other = rates if parts[0] >= parts[1] else rates[::-1]
    value = 1 / sum(parts)
    rest = (other,) if other.value != 0 else ()
    return Stated(value, f"{main.where}, in hover", main.span, main.value * value, -1, main.name, rest)
