"""A vehicle as URDF: for gym-pybullet-drones, with the properties that it reads, and for Isaac Sim and Isaac Lab.

URDF itself has mass, inertia and places. In gym-pybullet-drones rotor i pushes kf n^2 at prop_i_link with n in rpm, the
body turns by km (-n_0^2 + n_1^2 - n_2^2 + n_3^2), and drag is (drag_coeff_xy, drag_coeff_xy, drag_coeff_z) times the
velocity times the sum of the rotor speeds in rad/s, along the axes of the world; those of the body, along which a
vehicle has its drag, are alike where it is level. `fly_urdf` is these equations, not PyBullet.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from xml.etree import ElementTree

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.effects.scales import arm
from cpfls_cli.export.holding import FOUR, Held, Holds, constant_body, held_by, of_a_body, require_two_each_way
from cpfls_cli.export.numbers import numbers_of, places, spins
from cpfls_cli.export.sheet import Sheet
from cpfls_cli.export.simulators.sdf import written
from cpfls_cli.export.text import number, xml_text
from cpfls_cli.inertia import INERTIA_ENTRIES, symmetric
from cpfls_cli.playback.flight import State
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.playback.player import Course, fly_body
from cpfls_cli.simulators.model import ENTRIES
from cpfls_cli.units import RPM
from cpfls_cli.vehicle.motion import Instant, Wrench
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.vehicle.values import scaled

OTHERWISE = "drag along the axes of the world, where the vehicle has it along those of its body"
_GRAVITY = 9.8
"""Of gym-pybullet-drones, which has its gravity in its code."""
_TURNS = np.array([-1.0, 1.0, -1.0, 1.0])
_HEIGHT_SHARE, _RADIUS_M, _KMH = 0.2, 0.05, 30.0
"""Of the cylinder that collides, in arms; of a rotor that nobody knows the size of; and a speed that only limits."""


def urdf_held(model: VehicleModel) -> tuple[Held, Holds]:
    """Take what gym-pybullet-drones flies of a vehicle."""
    require_two_each_way(model, "gym-pybullet-drones")
    numbers = numbers_of(model, _wrenches, alike=True)
    body = of_a_body(constant_body(model))._replace(gravity=_GRAVITY)
    return held_by(model, numbers.holds, body, numbers), numbers.holds


def _wrenches(see: Instant) -> Mapping[str, Wrench]:
    """Write the drag of gym-pybullet-drones for a unit of its coefficients."""
    x, y, z = scaled(-see.functions.total(see.rotor_speed), see.air_velocity)
    return {"drag_xy": Wrench(force=(x, y, 0)), "drag_z": Wrench(force=(0, 0, z))}


def order_of(vehicle: VehicleSettings) -> IntArray:
    """Give the rotor of the config that is each propeller: the ways they turn alternate."""
    turns = spins(vehicle)
    order = np.empty(FOUR, dtype=np.int64)
    order[0::2], order[1::2] = np.flatnonzero(turns < 0), np.flatnonzero(turns > 0)
    return order


def urdf_text(sheet: Sheet, held: Held, remarks: Sequence[str], _file: str) -> str:
    """Write a vehicle as URDF, with what it does not hold."""
    order, hubs = order_of(sheet.model.vehicle), places(sheet.model, alike=True)
    root = ElementTree.Element("robot", name=sheet.name)
    root.append(ElementTree.Comment(xml_text(sheet.said(remarks, _use(order)))))
    rotors = " ".join(str(rotor + 1) for rotor in order.tolist())
    ElementTree.SubElement(root, "properties", _properties(sheet, held) | {"rotors": rotors})
    add_body(root, held, arm(sheet.model.vehicle))
    for propeller, rotor in enumerate(order.tolist()):
        add_point(root, f"prop{propeller}", hubs[rotor])
    add_point(root, "center_of_mass", np.zeros(3))
    return written(root)


def add_body(root: ElementTree.Element, held: Held, length: float) -> None:
    """Add the link with mass and inertia, a flat cylinder of arms of a length in m."""
    body = _link(root, "base_link", np.zeros(3), held.body.mass, held.body.inertia)
    size = {"radius": number(length), "length": number(_HEIGHT_SHARE * length)}
    for part in ("visual", "collision"):
        shape = ElementTree.SubElement(body, part)
        ElementTree.SubElement(shape, "origin", rpy="0 0 0", xyz="0 0 0")
        ElementTree.SubElement(ElementTree.SubElement(shape, "geometry"), "cylinder", size)


def _use(order: IntArray) -> tuple[str, ...]:
    listed = ", ".join(f"prop{propeller} is rotor {rotor + 1}" for propeller, rotor in enumerate(order.tolist()))
    return (
        f"Of the config {listed}: two ways of turning alternate. gym-pybullet-drones reads files of its own names: put "
        "this in the place of gym_pybullet_drones/assets/cf2x.urdf and take DroneModel.CF2X with Physics.PYB_DRAG. "
        "Its Physics.DYN reads arm and moments alone and knows no drag, so take another.",
        "Isaac Sim, Isaac Lab and Aerial Gym import mass, inertia and places of links; their own actuators have to "
        "push: force kf n^2 along z of prop_i_link, n in rpm, and torque km n^2 about it; merge fixed joints.",
    )


def _properties(sheet: Sheet, held: Held) -> dict[str, str]:
    """Give what gym-pybullet-drones reads besides the links."""
    found, vehicle = held.numbers, sheet.model.vehicle
    radii = [rotor.radius_m or _RADIUS_M for rotor in vehicle.rotors]
    most = FOUR * found["thrust"] * vehicle.rotor_speed_max_rad_s**2 / (held.body.mass * _GRAVITY)
    numbers = {
        "arm": arm(vehicle),
        "kf": found["thrust"] / RPM**2,
        "km": found["yaw"] / RPM**2,
        "thrust2weight": most,
        "max_speed_kmh": _KMH,
        "gnd_eff_coeff": 0.0,
        "prop_radius": float(np.mean(radii)),
        "drag_coeff_xy": found["drag_xy"],
        "drag_coeff_z": found["drag_z"],
        **{f"dw_coeff_{place}": 0.0 for place in (1, 2, 3)},
    }
    return {name: number(value) for name, value in numbers.items()}


def _link(root: ElementTree.Element, name: str, place: Array, mass: float, inertia: Array) -> ElementTree.Element:
    link = ElementTree.SubElement(root, "link", name=name)
    inertial = ElementTree.SubElement(link, "inertial")
    ElementTree.SubElement(inertial, "origin", rpy="0 0 0", xyz=" ".join(map(number, place)))
    ElementTree.SubElement(inertial, "mass", value=number(mass))
    entries = zip(ENTRIES, INERTIA_ENTRIES, strict=True)
    ElementTree.SubElement(inertial, "inertia", {entry: number(inertia[at]) for entry, at in entries})
    return link


def add_point(root: ElementTree.Element, name: str, place: Array) -> None:
    """Add a link without mass where a force acts: PyBullet pushes at the centre of its mass."""
    _link(root, f"{name}_link", place, 0.0, np.zeros((3, 3)))
    joint = ElementTree.SubElement(root, "joint", name=f"{name}_joint", type="fixed")
    ElementTree.SubElement(joint, "parent", link="base_link")
    ElementTree.SubElement(joint, "child", link=f"{name}_link")


def fly_urdf(text: str, course: Course, *, own: bool = True) -> State:
    """Fly an exported vehicle by the published equations of gym-pybullet-drones; see `Otherwise.fly`.

    Drag acts along the axes of the world, as there, or along those of the body.
    """
    root = ElementTree.fromstring(text)
    attributes = next(root.iter("properties")).attrib
    order = np.array([int(word) - 1 for word in attributes["rotors"].split()])
    kf, km, across, along = (float(attributes[name]) for name in ("kf", "km", "drag_coeff_xy", "drag_coeff_z"))
    links = {link.get("name"): link for link in root.iter("link")}
    body = {each.tag: each.attrib for each in links["base_link"].iter()}
    mass, inertia = float(body["mass"]["value"]), symmetric([float(body["inertia"][name]) for name in ENTRIES])
    origins = [next(links[f"prop{place}_link"].iter("origin")).get("xyz", "") for place in range(FOUR)]
    hubs = np.array([[float(word) for word in origin.split()] for origin in origins])
    drag = np.array([across, across, along])

    def push(speed: Array, air: Array, _rate: Array, rotation: Array) -> tuple[Array, Array]:
        squares = (RPM * speed[:, order]) ** 2
        force = (kf * squares)[..., None] * [0.0, 0.0, 1.0]
        torque = np.cross(hubs, force).sum(axis=1)
        torque[:, 2] += km * (squares @ _TURNS)
        turned = drag * air
        if own:
            turned = np.einsum("nji,nj->ni", rotation, drag * np.einsum("nij,nj->ni", rotation, air))
        return torque, force.sum(axis=1) - speed.sum(axis=1, keepdims=True) * turned

    return fly_body(course, mass, inertia, push, 0.0)
