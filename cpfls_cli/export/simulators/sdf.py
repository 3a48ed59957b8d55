"""A vehicle for Gazebo: SDF with a link and a multicopter motor model for each rotor, and the equations of that plugin.

The plugin's equations, as published with it: a rotor at speed w through the air v of its link, across its axis, gives

    thrust = motorConstant w^2,   yaw torque = -direction momentConstant thrust,
    drag = -|w| rotorDragCoefficient v,   rolling moment = -|w| rollingMomentCoefficient v,

and its speed follows the command by a first-order filter. `fly_sdf` is these equations, not Gazebo.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from xml.etree import ElementTree

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.export.holding import Held, Holds, constant_body, held_by, of_a_body
from cpfls_cli.export.numbers import numbers_of, places, spins
from cpfls_cli.export.sheet import Sheet
from cpfls_cli.export.text import number, xml_text
from cpfls_cli.inertia import INERTIA_ENTRIES
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.simulators.model import ENTRIES
from cpfls_cli.vehicle.motion import Instant, Wrench
from cpfls_cli.vehicle.values import Each, scaled

_PLUGIN = {"filename": "gz-sim-multicopter-motor-model-system", "name": "gz::sim::systems::MulticopterMotorModel"}
_ROTOR_SHARE = 1e-3
"""Share of the mass in the link of each rotor, which Gazebo needs; it is taken from the body."""

_SLOWER, _MARGIN = 10.0, 1.5
"""Rotors are drawn turning slower by the first; the second is the margin for what their links take from the inertia."""

_RADIUS_M = 0.05
"""Of a rotor that nobody knows the size of; it is drawn alone."""

SHORTEST_S = 1e-6
"""Lag of rotors that have none: the plugin divides by it."""


def sdf_held(model: VehicleModel) -> tuple[Held, Holds]:
    """Take what the motor model flies of a vehicle."""
    numbers = numbers_of(model, _wrenches, alike=False)
    # The links of the rotors take more from the sum of two moments of the body than from the third.
    heights = np.array([rotor.position_m[2] for rotor in model.vehicle.rotors])
    margin = 2.0 * _MARGIN * _ROTOR_SHARE * model.body.mass * float((heights**2).sum())
    body = of_a_body(constant_body(model), margin)
    return held_by(model, numbers.holds, body, numbers, lags=True), numbers.holds


def _wrenches(see: Instant) -> Mapping[str, Wrench]:
    """Write drag and rolling moment for a unit of the coefficient of each rotor."""
    x, y, _ = scaled(-see.rotor_speed, see.hub_velocity)
    found = {}
    for i, pair in enumerate(zip(x, y, strict=True)):
        alone = (Each(own if k == i else 0 for k in range(len(see.vehicle.rotors))) for own in pair)
        found[f"drag_{i + 1}"] = Wrench(at_hubs=(*alone, 0))
        found[f"rolling_{i + 1}"] = Wrench((*pair, 0))
    return found


def sdf_text(sheet: Sheet, held: Held, remarks: Sequence[str], _file: str) -> str:
    """Write a vehicle as SDF, with what it does not hold."""
    return written(sdf_root(sheet, held, remarks, _USE, sheet.name))


def written(root: ElementTree.Element) -> str:
    """Write a document of XML."""
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def sdf_root(
    sheet: Sheet, held: Held, remarks: Sequence[str], use: Sequence[str], namespace: str | None
) -> ElementTree.Element:
    """Build the document of a vehicle; without a namespace the topics are those of whatever spawns it."""
    root = ElementTree.Element("sdf", version="1.9")
    root.append(ElementTree.Comment(xml_text(sheet.said(remarks, [_spin_in_words(sheet, held), *use]))))
    model = ElementTree.SubElement(root, "model", name=sheet.name)
    hubs = places(sheet.model, alike=False)
    rotor = _rotor_inertia(sheet, held)
    mass = held.body.mass * (1.0 - len(hubs) * _ROTOR_SHARE)
    centre = -(_ROTOR_SHARE * held.body.mass / mass) * hubs.sum(axis=0)
    own = held.body.inertia - mass * apart(centre)
    for hub in hubs:
        own = own - rotor[0] * apart(hub) - np.diag(rotor[1])
    _link(model, "base_link", np.zeros(3), centre, mass, own)
    for i, hub in enumerate(hubs, 1):
        _link(model, f"rotor_{i}", hub, np.zeros(3), rotor[0], np.diag(rotor[1]))
        joint = ElementTree.SubElement(model, "joint", name=f"rotor_{i}_joint", type="revolute")
        ElementTree.SubElement(joint, "parent").text = "base_link"
        ElementTree.SubElement(joint, "child").text = f"rotor_{i}"
        axis = ElementTree.SubElement(joint, "axis")
        ElementTree.SubElement(axis, "xyz").text = "0 0 1"
        limit = ElementTree.SubElement(axis, "limit")
        ElementTree.SubElement(limit, "lower").text, ElementTree.SubElement(limit, "upper").text = "-1e16", "1e16"
    for i in range(1, len(hubs) + 1):
        plugin = ElementTree.SubElement(model, "plugin", _PLUGIN)
        if namespace is not None:
            ElementTree.SubElement(plugin, "robotNamespace").text = namespace
        for name, value in _motor(sheet, held, i).items():
            ElementTree.SubElement(plugin, name).text = value if isinstance(value, str) else number(value)
    return root


_USE = (
    "Commands: actuators messages on the topic /NAME/command/motor_speed, speeds in rad/s in the order of the config. "
    "The world must set gravity and a wind, which may be zero; the model needs no other plugin.",
)


def _spin_in_words(sheet: Sheet, held: Held) -> str:
    """Tell what Gazebo adds, because the links of the rotors turn."""
    mass, moments = _rotor_inertia(sheet, held)
    speed = sheet.model.vehicle.rotor_speed_max_rad_s / _SLOWER
    return (
        f"Gazebo adds what the rotor links of {mass:.3g} kg do by turning, at a tenth of the speed of the rotors: up "
        f"to {moments[2] * speed:.2g} N m for each rotor at a body rate of 1 rad/s."
    )


def _rotor_inertia(sheet: Sheet, held: Held) -> tuple[float, Array]:
    radii = [rotor.radius_m or _RADIUS_M for rotor in sheet.model.vehicle.rotors]
    mass = _ROTOR_SHARE * held.body.mass
    return mass, mass * float(np.mean(radii)) ** 2 * np.array([0.25, 0.25, 0.5])


def apart(place: Array) -> Array:
    """Inertia per mass of a point at a place."""
    return np.asarray(place @ place * np.eye(3) - np.outer(place, place))


def _link(model: ElementTree.Element, name: str, place: Array, centre: Array, mass: float, inertia: Array) -> None:
    link = ElementTree.SubElement(model, "link", name=name)
    ElementTree.SubElement(link, "pose").text = _pose(place)
    inertial = ElementTree.SubElement(link, "inertial")
    ElementTree.SubElement(inertial, "pose").text = _pose(centre)
    ElementTree.SubElement(inertial, "mass").text = number(mass)
    entries = ElementTree.SubElement(inertial, "inertia")
    for entry, place_of in zip(ENTRIES, INERTIA_ENTRIES, strict=True):
        ElementTree.SubElement(entries, entry).text = number(inertia[place_of])


def _pose(place: Array) -> str:
    return " ".join([*map(number, place), "0 0 0"])


def _motor(sheet: Sheet, held: Held, rotor: int) -> dict[str, str | float]:
    """Give the parameters of the plugin of one rotor."""
    numbers, lag = held.numbers, max(held.response.lag_s, SHORTEST_S)
    # A rotor that turns counter-clockwise turns the body clockwise.
    turns = "cw" if spins(sheet.model.vehicle)[rotor - 1] > 0 else "ccw"
    return {
        "jointName": f"rotor_{rotor}_joint",
        "linkName": f"rotor_{rotor}",
        "turningDirection": turns,
        "timeConstantUp": lag,
        "timeConstantDown": lag,
        "maxRotVelocity": sheet.model.vehicle.rotor_speed_max_rad_s,
        "motorConstant": numbers[f"thrust_{rotor}"],
        "momentConstant": numbers[f"yaw_{rotor}"] / numbers[f"thrust_{rotor}"],
        "commandSubTopic": "command/motor_speed",
        "motorNumber": str(rotor - 1),
        "rotorDragCoefficient": numbers[f"drag_{rotor}"],
        "rollingMomentCoefficient": numbers[f"rolling_{rotor}"],
        "rotorVelocitySlowdownSim": _SLOWER,
        "motorType": "velocity",
    }
