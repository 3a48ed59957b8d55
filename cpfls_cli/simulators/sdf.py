"""SDF of Gazebo: links with inertials and poses, joints, includes, and one motor plugin for each rotor.

The plugins' equations, as published with them (gz-sim ``MulticopterMotorModel.cc``, PX4 ``gazebo_motor_model.cpp``):
at a speed w in rad/s, thrust is ``motorConstant w^2`` along z of the rotor's link at its centre of mass, the torque
``momentConstant`` times that against its turn, drag ``rotorDragCoefficient |w| v`` and a moment
``rollingMomentCoefficient |w| v`` against the velocity v across its axis. The joint turns slower by
``rotorVelocitySlowdownSim``, which the plugin takes out again, so that no number here depends on it.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from os.path import isdir, isfile
from pathlib import Path

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.errors import InputError
from cpfls_cli.rotations import rotation_matrix
from cpfls_cli.simulators.document import Node, Stated, read_xml
from cpfls_cli.simulators.model import ENTRIES, Body, Rotor, SimulatorModel, of_quaternion, part_of, pose, turning, unit

MOTOR = re.compile(r"multicopter-motor-model|gazebo_motor_model")
"""In the names of the files of the plugins: gz-sim's, PX4's and RotorS'."""
DEFAULTS = {
    "motorConstant": 8.54858e-06,
    "momentConstant": 0.016,
    "maxRotVelocity": 838.0,
    "timeConstantUp": 1 / 80,
    "timeConstantDown": 1 / 40,
    "rotorDragCoefficient": 1e-4,
    "rollingMomentCoefficient": 1e-6,
}
"""Of the plugins, where the file does not state a number."""
CANNOT = (
    "drag of the body, ground effect, a delay and the voltage: no element of the motor plugin",
    "a rotor's own gyroscopic torque: Gazebo makes it of the link, at a speed that rotorVelocitySlowdownSim divides",
)


class _Parts:
    """Links, joints, frames and plugins of a model and what it includes, with their poses."""

    def __init__(self, root: Node) -> None:
        self.links: dict[str, Node] = {}
        self.joints: dict[str, Node] = {}
        self.motors: list[tuple[str, Node]] = []
        self.plugins: list[Node] = []
        self.files: dict[Path, None] = {root.file: None}
        # Element, scope of the names that it refers to, frame of the model that it is in, frame that it starts from.
        self._frames: dict[str, tuple[Node, str, str, str]] = {}
        self._poses: dict[str, Array | None] = {"": np.eye(4)}
        self._add(root, "", "", 0)

    def _add(self, model: Node, scope: str, own: str, depth: int) -> None:
        """Add the parts of a model to those of a scope, placed in a frame of its own."""
        if depth > 8:
            raise model.error("includes itself; remove that <include>")
        for node in model.children:
            name = scope + node.name
            match node.tag:
                case "link":
                    self._named(node, name)
                    self.links[name] = node
                    self._frames[name] = node, scope, own, own
                case "joint":
                    self.joints[name] = node
                    self._frames[name] = node, scope, own, scope + text_of(node, "child")
                case "frame":
                    attached = node.attributes.get("attached_to", "")
                    self._frames[name] = node, scope, own, scope + attached if attached else own
                case "model":
                    self._frames[f"{name}::"] = node, scope, own, own
                    self._add(node, f"{name}::", f"{name}::", depth + 1)
                case "include":
                    self._include(node, scope, own, depth)
                case "plugin":
                    self.plugins.append(node)
                    if MOTOR.search(node.attributes.get("filename", "")):
                        self.motors.append((scope, node))

    def _named(self, node: Node, name: str) -> None:
        if name in self.links:
            raise node.error(f"a second link is named {name}; rename one")

    def _include(self, node: Node, scope: str, own: str, depth: int) -> None:
        file = _included(node)
        self.files[file] = None
        model = _model_of(read_xml(file))
        placed = (node if node.first("pose") else model), scope, own, own
        if node.attributes.get("merge", "false") in ("true", "1"):
            # Its parts are those of the scope, and where they are follows from a frame without a name.
            frame = f"{scope}<include {len(self._frames)}>"
            self._frames[frame] = placed
            self._add(model, scope, frame, depth + 1)
            return
        name = f"{scope}{text_of(node, 'name') or model.name}::"
        self._frames[name] = placed
        self._add(model, name, name, depth + 1)

    def pose(self, name: str) -> Array:
        """Give the pose of a link, a joint, a frame or a nested model in the frame of the model, shape (4, 4)."""
        if name not in self._poses:
            node, scope, model, usual = self._frames[name]
            self._poses[name] = None
            own = node.first("pose")
            asked = "" if own is None else own.attributes.get("relative_to", own.attributes.get("frame", ""))
            base = usual if not asked else model if asked == "__model__" else self._frame_named(node, scope, asked)
            self._poses[name] = self.pose(base) @ _pose(own)
        found = self._poses[name]
        if found is None:
            raise self._frames[name][0].error("its pose is relative to itself; correct relative_to there")
        return found

    def _frame_named(self, node: Node, scope: str, asked: str) -> str:
        if asked == "world":
            return scope
        for name in (scope + asked, f"{scope}{asked}::"):
            if name in self._frames:
                return name
        raise node.error(f"its pose is relative to {asked!r}, which the file does not have; correct relative_to there")


def _included(node: Node) -> Path:
    uri = text_of(node, "uri")
    name = uri.removeprefix("model://").removeprefix("file://")
    folders = [node.file.parent, node.file.parent.parent]
    for place in (folder / name for folder in folders if name):
        # Unlike methods of a path, these take names that no system has.
        if isfile(place):
            return place
        sdf = sorted(place.glob("*.sdf")) if isdir(place) else []
        model = [each for each in sdf if each.name == "model.sdf"] or sdf
        if len(model) == 1:
            return model[0]
    raise node.error(
        f"includes {uri!r}, which is not next to this file; put it there, or give what `gz sdf -p {node.file.name}` "
        "prints, which has all in it"
    )


def text_of(node: Node, tag: str) -> str:
    """Give the text of an element below; empty where there is none."""
    found = node.first(tag)
    return "" if found is None else found.text.strip()


def _pose(node: Node | None) -> Array:
    if node is None or not node.text.strip():
        return np.eye(4)
    if node.attributes.get("rotation_format") == "quat_xyzw":
        x, y, z, *turn = (each.value for each in node.numbers(count=7))
        return pose(of_quaternion(unit(node, "its quaternion", [turn[3], *turn[:3]])), (x, y, z))
    x, y, z, *rpy = (each.value for each in node.numbers(count=6))
    degrees = node.attributes.get("degrees", "false") in ("true", "1")
    return pose(rotation_matrix(np.array([rpy]) * (np.pi / 180 if degrees else 1.0))[0], (x, y, z))


def _model_of(root: Node) -> Node:
    """Find the one model with motors, or the only one."""
    places = [root, *root.all("world")]
    models = [model for place in places for model in place.all("model")]
    flying = [
        model
        for model in models
        if any(p.tag == "plugin" and MOTOR.search(p.attributes.get("filename", "")) for p in model.walk())
    ]
    if len(flying) == 1 or len(models) == 1:
        return (flying or models)[0]
    if not models:
        raise root.error("has no <model>; give the file of a vehicle")
    names = ", ".join(model.name for model in flying or models)
    raise InputError(f"{root.file}: holds several models: {names}; give a file with one vehicle alone")


def read_sdf(file: Path) -> SimulatorModel:
    """Read SDF of a vehicle with Gazebo's motor plugins.

    InputError if there is no motor plugin, or the vehicle is not one rigid body with rotors.
    """
    root = read_xml(file)
    model = _model_of(root)
    parts, notes = _Parts(model), list[str]()
    if not parts.motors:
        raise no_motor(file, parts.plugins)
    motors = in_order(parts.motors)
    spinning = {scope + text_of(plugin, "jointName"): scope for scope, plugin in motors}
    base = _base(parts, motors[0][0], motors[0][1])
    held = _rigid(parts, base, set(spinning), notes)
    inverse = np.asarray(np.linalg.inv(parts.pose(base)), dtype=float)
    bodies = tuple(_body(parts.links[name], name, inverse @ parts.pose(name), notes) for name in held)
    placed = {body.name: body for body in bodies}
    rotors = tuple(rotor_of(plugin, placed.get(scope + text_of(plugin, "linkName"))) for scope, plugin in motors)
    return SimulatorModel(model.name, "sdf", bodies, rotors, CANNOT, tuple(notes), tuple(parts.files))


def no_motor(file: Path, plugins: Sequence[Node]) -> InputError:
    """Make the error of a file none of whose plugins is known."""
    named = sorted({plugin.attributes.get("filename", "?") for plugin in plugins})
    return InputError(
        f"{file}: none of its plugins is a motor model that is known here ({', '.join(named) or 'it has none'}); known "
        "are gz-sim-multicopter-motor-model-system, libgazebo_motor_model.so and librotors_gazebo_motor_model.so"
    )


def in_order(motors: Sequence[tuple[str, Node]]) -> list[tuple[str, Node]]:
    """Sort motor plugins, each with the scope of the names in it, by the numbers of their motors.

    InputError if one has none, or that of another.
    """
    numbered: dict[float, tuple[str, Node]] = {}
    for scope, plugin in motors:
        node = plugin.first("motorNumber")
        if node is None:
            raise plugin.error("has no <motorNumber>; write which motor it is, from 0")
        number = node.number().value
        if number in numbered:
            raise node.error(
                f"motor {number:g} is that of the plugin in line {numbered[number][1].line}, too; write another number"
            )
        numbered[number] = scope, plugin
    return [numbered[number] for number in sorted(numbered)]


def not_in_file(plugin: Node) -> InputError:
    """Make the error of a motor plugin whose joint is not there."""
    return plugin.error(f"its joint {text_of(plugin, 'jointName')!r} is not in the file; correct <jointName>")


def _base(parts: _Parts, scope: str, plugin: Node) -> str:
    joint = parts.joints.get(scope + text_of(plugin, "jointName"))
    if joint is None:
        raise not_in_file(plugin)
    parent = scope + text_of(joint, "parent")
    if parent not in parts.links:
        raise joint.error(f"its parent {parent!r} is not in the file; correct <parent>")
    return parent


def _rigid(parts: _Parts, base: str, spinning: set[str], notes: list[str]) -> list[str]:
    """List the links that hang on the first one by joints that do not turn, and rotors."""
    held, open_ = [base], [base]
    ends = {}
    for name, joint in parts.joints.items():
        scope = name.removesuffix(joint.name)
        ends[name] = [scope + text_of(joint, end) for end in ("parent", "child")]
    while open_:
        link = open_.pop()
        for name, both in ends.items():
            other = next((end for end in both if end != link), link) if link in both else link
            if other in held or other not in parts.links:
                continue
            if name not in spinning and _turns(parts.joints[name]):
                raise turning(parts.joints[name], f"the joint {name}")
            held.append(other)
            open_.append(other)
    loose = [name for name in parts.links if name not in held]
    if loose:
        notes.append(f"hang on no joint, and are not counted: {', '.join(loose)}")
    return held


def _turns(joint: Node) -> bool:
    if joint.attributes.get("type") == "fixed":
        return False
    limits = [joint.first("axis", "limit", end) for end in ("lower", "upper")]
    return any(limit is None or limit.number().value != 0 for limit in limits)


def _body(link: Node, name: str, placed: Array, notes: list[str]) -> Body:
    inertial = link.first("inertial")
    mass_node = None if inertial is None else inertial.first("mass")
    if inertial is None or mass_node is None:
        notes.append(f"{link.where} states no mass, for which Gazebo takes 1 kg and moments of 1 kg m^2")
        mass = Stated(1.0, f"{link.where}: states no mass; Gazebo takes 1 kg")
        return Body(name, mass, placed[:3, 3], np.eye(3), placed[:3, :3], placed[:3, :3])
    stated = [inertial.first("inertia", entry) for entry in ENTRIES]
    entries = tuple(
        node.number() if node else Stated(float(index < 3), f"{link.where}: {entry} not stated; taken as Gazebo does")
        for index, (entry, node) in enumerate(zip(ENTRIES, stated, strict=True))
    )
    own = inertial.first("pose")
    place = own.numbers()[:3] if own is not None and own.text.strip() else []
    return part_of(name, mass_node.number(), entries, placed, _pose(own), place, inertial)


def rotor_of(plugin: Node, link: Body | None) -> Rotor:
    """Make the rotor of a motor plugin, of the link that it names.

    InputError if that is no part of the vehicle, or the plugin states a number that it does not take.
    """
    if link is None:
        raise plugin.error(f"its link {text_of(plugin, 'linkName')!r} is not a part of the vehicle; correct <linkName>")
    turn = plugin.first("turningDirection")
    if turn is None or turn.text.strip() not in ("ccw", "cw"):
        raise plugin.error(f"turningDirection is {text_of(plugin, 'turningDirection')!r}; write ccw or cw")
    spin = 1 if turn.text.strip() == "ccw" else -1
    if text_of(plugin, "motorType") not in ("", "velocity"):
        raise plugin.error(
            f"motorType is {text_of(plugin, 'motorType')!r}; the plugin knows velocity alone: write that"
        )
    found = {tag: _stated(plugin, tag) for tag in DEFAULTS}
    for tag in ("motorConstant", "momentConstant", "maxRotVelocity", "timeConstantUp", "timeConstantDown"):
        if not found[tag].value > 0:
            raise plugin.error(f"{tag} is {found[tag].value:g}; write a number above 0")
    return Rotor(
        link.name,
        f"{plugin.file.name} line {plugin.line}: motor plugin of {link.name}",
        link.centre,
        link.link[:, 2],
        spin,
        thrust=found["motorConstant"],
        ratio=found["momentConstant"],
        speed_max=found["maxRotVelocity"],
        lag_up=found["timeConstantUp"],
        lag_down=found["timeConstantDown"],
        drag=found["rotorDragCoefficient"],
        rolling=found["rollingMomentCoefficient"],
        turn=Stated(spin, turn.where, next(iter(turn.spans()), None)),
        node=plugin,
    )


def _stated(plugin: Node, tag: str) -> Stated:
    node = plugin.first(tag)
    if node is not None:
        number = node.number()
        return Stated(number.value, f"{node.file.name} line {node.line}: <{tag}>", number.span)
    return Stated(DEFAULTS[tag], f"{plugin.file.name} line {plugin.line}: no <{tag}>; the plugin takes its own default")
