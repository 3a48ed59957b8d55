"""A vehicle for MuJoCo: a body with sites and actuators whose gears carry the weights, and a sphere that drags.

An actuator at a site measures the velocity along its gear and pushes along the same, so that any symmetric matrix from
velocities to torque and force is a few of them. MuJoCo has no squares of controls: a control is a rotor speed, or its
square, as two numbers in the file say of each.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.export.holding import Held, Holds, constant_body, held_by, of_a_body
from cpfls_cli.export.numbers import TERMS
from cpfls_cli.export.sheet import Sheet
from cpfls_cli.export.simulators.sdf import written
from cpfls_cli.export.text import number, xml_text
from cpfls_cli.playback.model import VehicleModel

STEP_S = 0.001
"""Step of the file; verification takes a whole number of steps of at most this."""

# A sphere in a fluid so thin that nothing but its own drag, which is counted up by as much, feels it.
_SPHERE_M, _DENSITY = 0.05, 1e-9
_DRAG = tuple(TERMS.index(("|u|", axis)) for axis in "uvw")
_LINEAR = slice(1, 7)
_FORCE_FIRST = [3, 4, 5, 0, 1, 2]
# Share of the largest eigenvalue up to which another one is rounding.
_ROUNDING = 1e-13


class _Actuator(NamedTuple):
    """An actuator: gear times gain times control, or times the velocity along the gear as well."""

    name: str
    site: str
    gear: Array
    gain: float
    rotor: int
    power: int
    damps: bool


def _holds(table: Array) -> Array:
    """Keep what actuators and a sphere in a fluid can do of a table of weights, shape (6, terms, 1 + 4 rotors)."""
    held, rotors = np.zeros_like(table), (table.shape[2] - 1) // 4
    columns = slice(0, 1 + 2 * rotors)
    held[:, 0, columns] = table[:, 0, columns]
    damping = table[_FORCE_FIRST, _LINEAR, columns]
    held[_FORCE_FIRST, _LINEAR, columns] = 0.5 * (damping + damping.swapaxes(0, 1))
    for axis, term in enumerate(_DRAG):
        held[3 + axis, term, 0] = np.mean([table[3 + other, each, 0] for other, each in enumerate(_DRAG)])
    return held


def mjcf_held(model: VehicleModel) -> tuple[Held, Holds]:
    """Take what MuJoCo flies of a vehicle; its filter acts on each control by itself."""
    return held_by(model, _holds, of_a_body(constant_body(model)), lags=True, squares=True), _holds


def mjcf_text(sheet: Sheet, held: Held, remarks: Sequence[str], _file: str) -> str:
    """Write a vehicle as MJCF, with what it does not hold."""
    root = ElementTree.Element("mujoco", model=sheet.name)
    root.append(ElementTree.Comment(xml_text(sheet.said(remarks, _USE))))
    drag = -float(held.weights[3, _DRAG[0], 0])
    option = {"timestep": number(STEP_S), "integrator": "RK4", "gravity": f"0 0 {number(-held.body.gravity)}"}
    ElementTree.SubElement(root, "option", option | ({"density": number(_DENSITY)} if drag else {}))
    actuators = list(_actuators(sheet.model, held.weights))
    custom = ElementTree.SubElement(root, "custom")
    for name, values in (("rotor", [a.rotor for a in actuators]), ("power", [a.power for a in actuators])):
        ElementTree.SubElement(custom, "numeric", name=f"ctrl_{name}", data=" ".join(map(str, values)))
    ElementTree.SubElement(custom, "numeric", name="rotor_lag_s", data=number(held.response.lag_s))
    _body(ElementTree.SubElement(root, "worldbody"), sheet, held, drag)
    list_of = ElementTree.SubElement(root, "actuator")
    for actuator in actuators:
        ElementTree.SubElement(list_of, "general", _attributes(actuator, held.response.lag_s))
    return written(root)


_USE = (
    "Controls: data.ctrl[:] = speed[rotor] ** power, with the rotor speeds in rad/s in the order of the config and the "
    "two arrays model.numeric('ctrl_rotor').data.astype(int) and model.numeric('ctrl_power').data; rotor is -1 and "
    "power is 0 for what needs no speed.",
    "The frame of the body is x forward, y left, z up, its origin the centre of mass. MuJoCo's wind acts on the drag "
    "sphere, not on the actuators.",
)


def _body(world: ElementTree.Element, sheet: Sheet, held: Held, drag: float) -> None:
    body, inertia = ElementTree.SubElement(world, "body", name=sheet.name), held.body.inertia
    ElementTree.SubElement(body, "freejoint", name=f"{sheet.name}_free")
    entries = (inertia[0, 0], inertia[1, 1], inertia[2, 2], inertia[0, 1], inertia[0, 2], inertia[1, 2])
    moments = " ".join(map(number, entries))
    ElementTree.SubElement(body, "inertial", pos="0 0 0", mass=number(held.body.mass), fullinertia=moments)
    ElementTree.SubElement(body, "site", name="centre", size="0.005")
    still = {"mass": "0", "contype": "0", "conaffinity": "0"}
    for index, rotor in enumerate(sheet.model.vehicle.rotors, 1):
        place = " ".join(map(number, rotor.position_m))
        ElementTree.SubElement(body, "site", name=f"rotor{index}", pos=place, size="0.005")
        disc = f"{number(rotor.radius_m or 0.05)} 0.002"
        ElementTree.SubElement(
            body, "geom", still | {"type": "cylinder", "pos": place, "size": disc, "rgba": "0 0 0 .3"}
        )
    sphere = still | {"type": "sphere", "size": number(_SPHERE_M)}
    if drag:
        # So thin a fluid, and so much drag in it, that the sphere carries none of it along.
        blunt = number(drag / (_DENSITY * np.pi * _SPHERE_M**2))
        sphere |= {"fluidshape": "ellipsoid", "fluidcoef": f"{blunt} {blunt} 0 0 0"}
    ElementTree.SubElement(body, "geom", sphere)


def _actuators(model: VehicleModel, weights: Array) -> Iterator[_Actuator]:
    """Give the actuators that do what weights say."""
    rotors = model.rotors
    columns = [(0, -1, 0), *((1 + power * rotors + i, i, power + 1) for power in (0, 1) for i in range(rotors))]
    for column, rotor, power in columns:
        name = f"rotor{rotor + 1}_power{power}" if power else "still"
        wrench = weights[_FORCE_FIRST, 0, column]
        if wrench.any():
            hub = np.zeros(3) if rotor < 0 else np.array(model.vehicle.rotors[rotor].position_m)
            gear = np.concatenate([wrench[:3], wrench[3:] - np.cross(hub, wrench[:3])])
            size = float(np.linalg.norm(gear))
            site = "centre" if rotor < 0 else f"rotor{rotor + 1}"
            yield _Actuator(f"{name}_force", site, gear / size, size, rotor, power, False)
        values, axes = np.linalg.eigh(weights[_FORCE_FIRST, _LINEAR, column])
        for k in np.flatnonzero(np.abs(values) > _ROUNDING * np.abs(values).max()).tolist():
            yield _Actuator(f"{name}_damping{k + 1}", "centre", axes[:, k], float(values[k]), rotor, power, True)


def _attributes(actuator: _Actuator, lag: float) -> dict[str, str]:
    by_velocity = f"0 0 {number(actuator.gain)}" if actuator.damps else number(actuator.gain)
    found = {"name": actuator.name, "site": actuator.site, "gear": " ".join(map(number, actuator.gear))}
    if not actuator.power:
        return found | {"gainprm": "0", "biastype": "affine", "biasprm": by_velocity}
    kind = {"gaintype": "affine"} if actuator.damps else {}
    filtered = {"dyntype": "filterexact", "dynprm": number(lag)} if lag else {}
    return found | kind | {"gainprm": by_velocity} | filtered
