"""URDF: links with inertials and joints, with motor plugins of Gazebo or the ``properties`` of gym-pybullet-drones.

Plugins are those of SDF, each in an element ``gazebo``, and the joints of their rotors turn. The equations of
gym-pybullet-drones, as published with it (``BaseAviary.py``): with rotor speeds n in rpm, ``kf n^2`` is the thrust
along z at the centre of mass of ``prop0_link`` to ``prop3_link``, the body turns about z by
``km (-n0^2 + n1^2 - n2^2 + n3^2)``, the other way round for the racer, ``thrust2weight`` is the largest thrust of all
rotors over the weight, and drag is ``drag_coeff_xy``, ``drag_coeff_z`` times the velocity times the sum of the rotor
speeds in rad/s.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.errors import InputError
from cpfls_cli.rotations import rotation_matrix
from cpfls_cli.simulators.document import Node, Stated, read_xml
from cpfls_cli.simulators.model import ENTRIES, Body, Rotor, SimulatorModel, part_of, pose, turning
from cpfls_cli.simulators.sdf import CANNOT as CANNOT_OF_PLUGINS
from cpfls_cli.simulators.sdf import MOTOR, in_order, no_motor, not_in_file, rotor_of, text_of
from cpfls_cli.units import RPM

GRAVITY = 9.8
"""Of gym-pybullet-drones, in whose weight `thrust2weight` counts."""
_PROPELLER = re.compile(r"prop(\d+)_link")
_SPINS = (1, -1, 1, -1)
CANNOT = (
    "how fast rotors follow their commands: gym-pybullet-drones has rotors without lag",
    "the direction in which rotors turn: gym-pybullet-drones has it in its code, and the racer's the other way round",
)


def read_urdf(file: Path) -> SimulatorModel:
    """Read URDF of a vehicle; without motor plugins or the properties of gym-pybullet-drones it states no rotors.

    InputError if the vehicle is not one rigid body, or a plugin states what it does not take.
    """
    root, notes = read_xml(file), list[str]()
    links = {link.name: link for link in root.all("link")}
    if not links:
        raise root.error("has no <link>; give the file of a vehicle")
    plugins = [node for own in root.all("gazebo") for node in own.all("plugin")]
    found = [("", each) for each in plugins if MOTOR.search(each.attributes.get("filename", ""))]
    motors = [each for _, each in in_order(found)]
    # Other plugins of ROS name joints too.
    if not motors and any(text_of(each, "jointName") and each.first("motorNumber") for each in plugins):
        raise no_motor(file, plugins)
    placed = _placed(root, links, motors)
    bodies = tuple(_body(links[name], placed[name], notes) for name in placed)
    if motors:
        # Gazebo, too, counts a link without inertial as none.
        named = dict(zip(placed, bodies, strict=True))
        rotors = tuple(rotor_of(each, named.get(text_of(each, "linkName"))) for each in motors)
        return SimulatorModel(root.name, "urdf-gazebo", bodies, rotors, CANNOT_OF_PLUGINS, (), (file,))
    with_mass = [body for body in bodies if body.mass.value > 0]
    properties = next((node for node in root.walk() if node.tag == "properties"), None)
    if properties is None or "kf" not in properties.attributes:
        notes.append("states no rotors: it has no <properties> with kf and km, as gym-pybullet-drones reads them")
        rotors = ()
    else:
        rotors = _rotors(file, root, properties, bodies)
        # PyBullet takes the mass of the first link for the weight.
        if len(with_mass) > 1:
            notes.append("several links have mass; gym-pybullet-drones takes that of the first for the weight")
    return SimulatorModel(root.name, "urdf", bodies, rotors, CANNOT, tuple(notes), (file,))


def _placed(root: Node, links: dict[str, Node], motors: Sequence[Node]) -> dict[str, Array]:
    """Give the pose of each link in the one that all rotors hang on, or in the first, shape (4, 4)."""
    joints = root.all("joint")
    own = {joint.name: joint for joint in joints}
    spinning = [text_of(each, "jointName") for each in motors]
    for motor, name in zip(motors, spinning, strict=True):
        if name not in own:
            raise not_in_file(motor)
    children = {_link_of(joint, "child"): joint for joint in joints}
    first = next((name for name in links if name not in children), None)
    if first is None:
        raise root.error("every link is the child of a joint; one has to be the first")
    found, open_ = {first: np.eye(4)}, [first]
    while open_:
        above = open_.pop(0)
        for joint in joints:
            child = _link_of(joint, "child")
            if _link_of(joint, "parent") != above or child in found:
                continue
            if child not in links:
                raise joint.error(f"its child {child!r} is not in the file; correct <child>")
            if joint.name not in spinning and _turns(joint):
                raise turning(joint, f"the joint {joint.name}")
            found[child] = found[above] @ _origin(joint.first("origin"))
            open_.append(child)
    loose = [name for name in links if name not in found]
    if loose:
        raise links[loose[0]].error(f"the link {loose[0]} hangs on no joint; add one, or remove it")
    chains = [[*_up(children, _link_of(own[name], "parent"))] for name in spinning]
    # Arms that are links of their own hang on one.
    base = next((link for link in chains[0] if all(link in each for each in chains)), first) if chains else first
    return {name: np.linalg.inv(found[base]) @ place for name, place in found.items()}


def _up(children: Mapping[str, Node], link: str) -> Iterator[str]:
    """Give a link, and those that it hangs on, the nearest first."""
    while link:
        yield link
        link = _link_of(children[link], "parent") if link in children else ""


def _turns(joint: Node) -> bool:
    limit, kind = joint.first("limit"), joint.attributes.get("type")
    if limit is None or kind not in ("revolute", "prismatic"):
        return kind != "fixed"
    # An end that is not stated is 0.
    return any(limit.number(end).value for end in ("lower", "upper") if end in limit.attributes)


def _link_of(joint: Node, end: str) -> str:
    node = joint.first(end)
    return "" if node is None else node.attributes.get("link", "")


def _origin(node: Node | None) -> Array:
    if node is None:
        return np.eye(4)
    xyz, rpy = (
        [each.value for each in node.numbers(name, 3)] if name in node.attributes else [0.0] * 3
        for name in ("xyz", "rpy")
    )
    return pose(rotation_matrix(np.array([rpy]))[0], xyz)


def _body(link: Node, placed: Array, notes: list[str]) -> Body:
    inertial = link.first("inertial")
    mass_node, inertia_node = (None if inertial is None else inertial.first(tag) for tag in ("mass", "inertia"))
    if inertial is None or mass_node is None:
        notes.append(f"{link.where} states no mass, and counts as none; PyBullet takes 1 kg: write a mass of 0")
        nothing = Stated(0.0, f"{link.where}: states no mass")
        return Body(link.name, nothing, placed[:3, 3], np.zeros((3, 3)), placed[:3, :3], placed[:3, :3])
    mass = mass_node.number("value")
    if inertia_node is None:
        raise inertial.error("has a mass and no <inertia>; write ixx to izz")
    entries = tuple(
        inertia_node.number(entry)
        if entry in inertia_node.attributes
        else Stated(0.0, f"{inertia_node.where}: no {entry}")
        for entry in ENTRIES
    )
    own = inertial.first("origin")
    place = own.numbers("xyz", 3) if own is not None and "xyz" in own.attributes else []
    return part_of(link.name, mass, entries, placed, _origin(own), place, inertial)


def _rotors(file: Path, root: Node, properties: Node, bodies: tuple[Body, ...]) -> tuple[Rotor, ...]:
    found = {int(own[1]): body for body in bodies if (own := _PROPELLER.fullmatch(body.name))}
    if sorted(found) != list(range(len(_SPINS))):
        raise InputError(
            f"{file}: gym-pybullet-drones pushes at prop0_link to prop3_link, and the file has "
            f"{', '.join(sorted(body.name for body in found.values())) or 'none of them'}; name the links of its four "
            "rotors so"
        )
    thrust = properties.number("kf", scale=1 / RPM**2)
    torque = properties.number("km", scale=1 / RPM**2) if "km" in properties.attributes else None
    for name, stated in (("kf", thrust), ("km", torque)):
        if stated is not None and not stated.value > 0:
            raise properties.error(f"{name} is {properties.attributes[name]}; write a number above 0")
    speed, drag = None, None
    if "thrust2weight" in properties.attributes:
        share = properties.number("thrust2weight")
        # Mass of the first link, as BaseAviary takes it.
        most = (
            share.value * next((each.mass.value for each in bodies if each.mass.value > 0), 0.0) * GRAVITY / len(_SPINS)
        )
        words = f"{share.where}: from kf, mass and 9.8 m/s^2"
        speed = Stated(float(np.sqrt(max(most, 0.0) / thrust.value)), words)
    if "drag_coeff_xy" in properties.attributes:
        drag = properties.number("drag_coeff_xy")
    turn = -1 if "racer" in (root.name, file.stem) else 1
    return tuple(
        Rotor(
            found[place].name,
            found[place].mass.where,
            found[place].centre,
            np.array([0.0, 0.0, 1.0]),
            turn * spin,
            thrust=thrust,
            torque=torque,
            speed_max=speed,
            drag=drag,
            node=properties,
        )
        for place, spin in enumerate(_SPINS)
    )
