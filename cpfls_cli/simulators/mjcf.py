"""MJCF of MuJoCo: bodies with inertials or geoms, and actuators that push at sites.

A control times gain times gear is force and torque in the axes of the site (MuJoCo, XML reference, ``actuator``). Most
files have thrusts in N for controls: they state no thrust over squared speed. Where two numbers of the file,
``ctrl_rotor`` and ``ctrl_power`` as `cpfls export` writes them, say that controls are squared speeds, they do.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.simulators.document import Node, Stated, read_xml
from cpfls_cli.simulators.model import Body, Rotor, SimulatorModel, of_quaternion, part_of, pose, rotated, turning

_TURNING = ("hinge", "slide", "ball")
_SMALL = 1e-9
CANNOT = (
    "drag of rotors, ground effect and a delay: no attribute of an actuator",
    "the speed of rotors: controls are thrusts unless the file says what they stand for",
)
_AXES = ("pos", "quat", "euler", "axisangle", "xyaxes", "zaxis")


@dataclass
class _File:
    """What holds for all elements: defaults by class, units of angles."""

    root: Node
    degrees: bool = True
    order: str = "xyz"
    from_geoms: str = "auto"
    defaults: dict[str, dict[str, dict[str, str]]] = field(default_factory=dict)
    files: dict[Path, None] = field(default_factory=dict)

    def read(self) -> None:
        """Take in the included files, the compiler's settings and the defaults."""
        self.files[self.root.file] = None
        for node in list(self.root.walk()):
            if node.tag == "include" and node.parent is not None:
                self._include(node)
        for compiler in (node for node in self.root.walk() if node.tag == "compiler"):
            self.degrees = compiler.attributes.get("angle", "degree" if self.degrees else "radian") == "degree"
            self.order = compiler.attributes.get("eulerseq", self.order)
            self.from_geoms = compiler.attributes.get("inertiafromgeom", self.from_geoms)
        for default in self.root.all("default"):
            self._default(default, {}, "main")

    def _include(self, node: Node) -> None:
        assert node.parent is not None
        file = node.file.parent / node.attributes.get("file", "")
        if not file.is_file():
            raise node.error(f"includes {node.attributes.get('file')!r}, which is not there; put it beside this file")
        if file in self.files:
            raise node.error(f"includes {file.name} again; remove that <include>")
        self.files[file] = None
        for child in read_xml(file).children:
            child.parent = node.parent
            node.parent.children.append(child)
            for below in list(child.walk()):
                if below.tag == "include":
                    self._include(below)

    def _default(self, node: Node, above: Mapping[str, dict[str, str]], usual: str) -> None:
        name = node.attributes.get("class", usual)
        own = {tag: dict(values) for tag, values in above.items()}
        for child in node.children:
            if child.tag != "default":
                own[child.tag] = own.get(child.tag, {}) | child.attributes
        self.defaults[name] = own
        for child in node.all("default"):
            self._default(child, own, name)

    def of(self, node: Node, childclass: str) -> dict[str, str]:
        """Give the attributes of an element with those that it has by default."""
        usual = self.defaults.get(node.attributes.get("class", childclass), self.defaults.get("main", {}))
        return {**usual.get(node.tag, {}), **node.attributes}

    def placed(self, node: Node, attributes: Mapping[str, str]) -> Array:
        """Give the pose of an element in that of its body, shape (4, 4)."""
        held = {name: _floats(node, name, attributes[name]) for name in _AXES if name in attributes}
        place = held.get("pos", [0.0, 0.0, 0.0])
        unit = np.pi / 180 if self.degrees else 1.0
        turn = np.eye(3)
        if "quat" in held:
            turn = of_quaternion(held["quat"])
        elif "euler" in held:
            for axis, angle in zip(self.order, held["euler"], strict=True):
                one = rotated([unit * angle if each == axis.lower() else 0.0 for each in "xyz"])
                turn = turn @ one if axis.islower() else one @ turn
        elif "axisangle" in held:
            *axis_of, angle = held["axisangle"]
            half = 0.5 * unit * angle
            turn = of_quaternion([np.cos(half), *(np.sin(half) * np.array(axis_of) / np.linalg.norm(axis_of))])
        elif "xyaxes" in held:
            x = np.array(held["xyaxes"][:3]) / np.linalg.norm(held["xyaxes"][:3])
            y = np.array(held["xyaxes"][3:]) - x * (x @ held["xyaxes"][3:])
            y = y / np.linalg.norm(y)
            turn = np.column_stack([x, y, np.cross(x, y)])
        elif "zaxis" in held:
            turn = _upward(np.array(held["zaxis"]))
        return pose(turn, place)


def _upward(axis: Array) -> Array:
    axis = axis / np.linalg.norm(axis)
    across = np.cross([0.0, 0.0, 1.0], axis)
    if np.linalg.norm(across) < _SMALL:
        return np.diag([1.0, np.sign(axis[2]), np.sign(axis[2])])
    return of_quaternion([1 + axis[2], *across])


def _floats(node: Node, name: str, text: str) -> list[float]:
    try:
        return [float(word) for word in text.split()]
    except ValueError:
        raise node.error(f"{name} = {text!r} is not numbers; write numbers there") from None


def read_mjcf(file: Path) -> SimulatorModel:
    """Read MJCF of a vehicle.

    Raises
    ------
    InputError
        If there is no body that flies, or it is not one rigid body.
    """
    root = read_xml(file)
    whole, notes = _File(root), list[str]()
    whole.read()
    flying = [
        body
        for world in root.all("worldbody")
        for body in world.all("body")
        if body.first("freejoint") or any(joint.attributes.get("type") == "free" for joint in body.all("joint"))
    ]
    if not flying:
        raise root.error("no body has a <freejoint>, so none flies; add it to that of the vehicle")
    if len(flying) > 1:
        names = ", ".join(body.name for body in flying)
        raise root.error(f"several bodies have a <freejoint>: {names}; give a file with one vehicle alone")
    bodies, sites = list[Body](), dict[str, Array]()
    _gather(whole, flying[0], np.eye(4), "main", bodies, sites)
    if not bodies:
        raise flying[0].error("has no mass; write <inertial> with pos, mass and diaginertia")
    rotors = tuple(_rotors(whole, root, sites, notes))
    if root.first("option") and any(node.attributes.get("density", "0") != "0" for node in root.all("option")):
        notes.append("MuJoCo's own fluid drags the body (option density); no number of a rotor")
    return SimulatorModel(root.attributes.get("model", flying[0].name), "mjcf", tuple(bodies), rotors, CANNOT,
                          tuple(notes), tuple(whole.files))  # fmt: skip


def _gather(whole: _File, body: Node, placed: Array, above: str, bodies: list[Body], sites: dict[str, Array]) -> None:
    """Collect what has mass, and the sites, of a body and those below it, in the frame of the first."""
    named = body.attributes.get("childclass", above)
    inertial = body.first("inertial")
    if inertial is not None and whole.from_geoms != "true":
        bodies.append(_inertial(whole, body, inertial, placed))
    elif whole.from_geoms != "false":
        bodies += (own for geom in body.all("geom") if (own := _geom(whole, geom, placed, named)))
    for site in body.all("site"):
        sites[site.name] = placed @ whole.placed(site, whole.of(site, named))
    for child in body.all("body"):
        joints = [joint for joint in child.all("joint") if joint.attributes.get("type", "hinge") in _TURNING]
        if joints:
            raise turning(joints[0], f"the body {child.name}")
        _gather(whole, child, placed @ whole.placed(child, child.attributes), named, bodies, sites)


def _inertial(whole: _File, body: Node, inertial: Node, placed: Array) -> Body:
    at = placed @ whole.placed(inertial, inertial.attributes)
    entries: tuple[Stated, ...] = ()
    if "fullinertia" in inertial.attributes:
        entries = tuple(inertial.numbers("fullinertia", 6))
        # In the order of MuJoCo: the three moments, then xy, xz, yz, which is that of all arrays of six here.
    elif "diaginertia" in inertial.attributes:
        still = Stated(0.0, f"{inertial.where}: diaginertia has no products")
        entries = (*inertial.numbers("diaginertia", 3), still, still, still)
    else:
        raise inertial.error("has no diaginertia and no fullinertia; write one of them")
    place = inertial.numbers("pos", 3) if "pos" in inertial.attributes else []
    return part_of(body.name, inertial.number("mass"), entries, at, place, inertial)


def _geom(whole: _File, geom: Node, placed: Array, named: str) -> Body | None:
    own = whole.of(geom, named)
    stated = own.get("mass")
    if stated is not None and _floats(geom, "mass", stated) == [0.0]:
        return None
    kind, size = own.get("type", "sphere"), _floats(geom, "size", own.get("size", ""))
    if kind == "mesh" or "mesh" in own or "fromto" in own or kind not in _SOLIDS or not size:
        raise geom.error(
            f"its mass follows from a {'mesh' if 'mesh' in own else kind}, which is not read here; give the body an "
            "<inertial> with pos, mass and diaginertia, as MuJoCo's compiler prints them"
        )
    volume, per_mass = _SOLIDS[kind](*size, *[0.0] * (3 - len(size)))
    if stated is not None:
        # Of the class, where not of the geom itself.
        mass = geom.number("mass") if "mass" in geom.attributes else Stated(float(stated), geom.where)
    else:
        density = _floats(geom, "density", own.get("density", "1000"))[0]
        mass = Stated(density * volume, f"{geom.where}: from its density and size")
    at = placed @ whole.placed(geom, own)
    turned = at[:3, :3]
    return Body(geom.name or kind, mass, at[:3, 3], mass.value * turned @ np.diag(per_mass) @ turned.T, turned)


def _box(x: float, y: float, z: float) -> tuple[float, list[float]]:
    return 8 * x * y * z, [(y * y + z * z) / 3, (x * x + z * z) / 3, (x * x + y * y) / 3]


def _ellipsoid(x: float, y: float, z: float) -> tuple[float, list[float]]:
    return 4 / 3 * np.pi * x * y * z, [(y * y + z * z) / 5, (x * x + z * z) / 5, (x * x + y * y) / 5]


def _cylinder(radius: float, half: float, _: float) -> tuple[float, list[float]]:
    across = radius**2 / 4 + half**2 / 3
    return 2 * np.pi * radius**2 * half, [across, across, radius**2 / 2]


def _capsule(radius: float, half: float, _: float) -> tuple[float, list[float]]:
    tube, ends = 2 * np.pi * radius**2 * half, 4 / 3 * np.pi * radius**3
    share = ends / (tube + ends)
    across = (1 - share) * (radius**2 / 4 + half**2 / 3)
    across += share * (0.4 * radius**2 + half**2 + 0.75 * half * radius)
    return tube + ends, [across, across, (1 - share) * radius**2 / 2 + share * 0.4 * radius**2]


_SOLIDS = {
    "box": _box,
    "ellipsoid": _ellipsoid,
    "cylinder": _cylinder,
    "capsule": _capsule,
    "sphere": lambda radius, *_: _ellipsoid(radius, radius, radius),
}


def _rotors(whole: _File, root: Node, sites: Mapping[str, Array], notes: list[str]) -> Iterator[Rotor]:
    """Give the actuators that push along z of a site away from the others, as rotors."""
    actuators = [node for own in root.all("actuator") for node in own.children if node.tag in ("motor", "general")]
    custom = {node.name: node for own in root.all("custom") for node in own.all("numeric")}
    powers = [int(each.value) for each in custom["ctrl_power"].numbers("data")] if "ctrl_power" in custom else []
    if powers and len(powers) != len(actuators):
        raise custom["ctrl_power"].error(f"has {len(powers)} numbers for {len(actuators)} actuators; correct it")
    pushing = []
    for index, node in enumerate(actuators):
        own = whole.of(node, "main")
        squared = bool(powers) and powers[index] == 2
        gear = np.array(_floats(node, "gear", own.get("gear", "1")) + [0.0] * 6)[:6]
        damps = own.get("gaintype") == "affine" or own.get("biastype") == "affine"
        if own.get("site") in sites and abs(gear[2]) > _SMALL and not damps and (squared or not powers):
            pushing.append((node, own, gear, squared))
    places = {tuple(np.round(sites[own["site"]][:2, 3], 6)) for _, own, _, _ in pushing}
    if len(pushing) < 2 or len(places) < 2:
        notes.append("states no rotors: its actuators push and turn the body at one point")
        return
    for node, own, gear, squared in pushing:
        yield _rotor(node, own, gear, squared, sites[own["site"]])


def _rotor(node: Node, own: Mapping[str, str], gear: Array, squared: bool, site: Array) -> Rotor:
    gain = _floats(node, "gainprm", own.get("gainprm", "1"))[0]
    push, turn = float(gain * gear[2]), float(gear[5] / gear[2])
    words = f"{node.where}, gear and gain"
    limits = _floats(node, "ctrlrange", own["ctrlrange"]) if "ctrlrange" in own else None
    most = None if limits is None or squared else Stated(push * limits[1], f"{node.where}, ctrlrange")
    lag = own.get("dynprm") if own.get("dyntype") in ("filter", "filterexact") else None
    lagging = None if lag is None else Stated(_floats(node, "dynprm", lag)[0], f"{node.where}, dynprm")
    return Rotor(
        node.name or own["site"],
        node.where,
        site[:3, 3],
        site[:3, 2] * np.sign(push),
        int(-np.sign(turn)) if abs(turn) > _SMALL else 0,
        thrust=Stated(push, words) if squared else None,
        ratio=Stated(abs(turn), words),
        most=most,
        lag_up=lagging,
        lag_down=lagging,
        node=node,
    )
