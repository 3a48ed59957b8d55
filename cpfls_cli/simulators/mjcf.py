"""MJCF of MuJoCo: bodies with inertials or geoms, and actuators that push at sites.

A control times gain times gear is force and torque in the axes of the site (MuJoCo, XML reference, ``actuator``). Most
files have thrusts in N for controls: they state no thrust over squared speed. Where two numbers of the file,
``ctrl_rotor`` and ``ctrl_power`` as `cpfls export` writes them, say that controls are squared speeds, they do: then
the third and the sixth number of gear, times gain, are thrust and yaw torque over squared speed. Else only the ratio of
the two is the vehicle's.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field, replace
from os.path import isfile
from pathlib import Path

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.rotations import rotation_matrix
from cpfls_cli.simulators.document import Node, Stated, read_xml
from cpfls_cli.simulators.model import Body, Rotor, SimulatorModel, of_quaternion, part_of, pose, turning, unit

_TURNING = ("hinge", "slide", "ball")
_SMALL = 1e-9
CANNOT = (
    "drag of rotors, ground effect and a delay: no attribute of an actuator",
    "the speed of rotors: controls are thrusts unless the file says what they stand for",
)
_AXES = {"pos": 3, "quat": 4, "euler": 3, "axisangle": 4, "xyaxes": 6, "zaxis": 3}
"""Attributes that place an element, with how many numbers each has."""
_COMPILED = "or give what MuJoCo's compiler makes of the file (mj_saveLastXML)"
_UNREAD = ("frame", "replicate", "attach", "composite", "flexcomp")
"""Elements in a body that may have mass and are not read."""


@dataclass
class _File:
    """What holds for all elements: defaults by class, units of angles."""

    root: Node
    degrees: bool = True
    order: str = "xyz"
    from_geoms: str = "auto"
    total_mass: float = 0.0
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
            self._masses(compiler)
            if len(self.order) != 3 or set(self.order.lower()) - set("xyz"):
                raise compiler.error(f"eulerseq is {self.order!r}; write three of x, y, z, X, Y, Z")
        for default in self.root.all("default"):
            # There is one main class, whatever its sections are called and how many there are.
            self._default(default, self.defaults.get("main", {}), "main")

    def _masses(self, compiler: Node) -> None:
        """Take in what the compiler does to masses, or refuse it."""
        own = compiler.attributes
        if "settotalmass" in own:
            self.total_mass = compiler.number("settotalmass").value
        for name in ("boundmass", "boundinertia"):
            if name in own and compiler.number(name).value > 0:
                raise compiler.error(
                    f"{name} changes parts that are too light, which is not read here; remove it, {_COMPILED}"
                )
        if own.get("balanceinertia") == "true":
            raise compiler.error(
                f"balanceinertia changes moments that no body has; correct those, and remove it, {_COMPILED}"
            )

    def _include(self, node: Node) -> None:
        assert node.parent is not None
        file = node.file.parent / node.attributes.get("file", "")
        if not isfile(file):
            raise node.error(f"includes {node.attributes.get('file')!r}, which is not there; put it next to this file")
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
        name = "main" if usual == "main" and node.parent is self.root else node.attributes.get("class", usual)
        own = {tag: dict(values) for tag, values in above.items()}
        for child in node.children:
            if child.tag != "default":
                own[_shared(child.tag)] = own.get(_shared(child.tag), {}) | child.attributes
        self.defaults[name] = own
        for child in node.all("default"):
            self._default(child, own, name)

    def of(self, node: Node, childclass: str) -> dict[str, str]:
        """Give the attributes of an element with those that it has by default."""
        usual = self.defaults.get(node.attributes.get("class", childclass), self.defaults.get("main", {}))
        return {**usual.get(_shared(node.tag), {}), **node.attributes}

    def placed(self, node: Node, attributes: Mapping[str, str]) -> Array:
        """Give the pose of an element in that of its body, shape (4, 4)."""
        held = {name: _floats(node, attributes, name, {count}) for name, count in _AXES.items() if name in attributes}
        place = held.get("pos", [0.0, 0.0, 0.0])
        radians = np.pi / 180 if self.degrees else 1.0
        turn = np.eye(3)
        if "quat" in held:
            turn = of_quaternion(unit(node, "quat", held["quat"]))
        elif "euler" in held:
            for axis, angle in zip(self.order, held["euler"], strict=True):
                (one,) = rotation_matrix(np.array([[radians * angle * (each == axis.lower()) for each in "xyz"]]))
                turn = turn @ one if axis.islower() else one @ turn
        elif "axisangle" in held:
            *axis_of, angle = held["axisangle"]
            half = 0.5 * radians * angle
            turn = of_quaternion([np.cos(half), *(np.sin(half) * unit(node, "axisangle", axis_of))])
        elif "xyaxes" in held:
            x = unit(node, "xyaxes", held["xyaxes"][:3])
            y = unit(node, "xyaxes", np.array(held["xyaxes"][3:]) - x * (x @ held["xyaxes"][3:]))
            turn = np.column_stack([x, y, np.cross(x, y)])
        elif "zaxis" in held:
            turn = _upward(unit(node, "zaxis", held["zaxis"]))
        return pose(turn, place)


def _shared(tag: str) -> str:
    """Name the defaults of an element: all actuators have the same."""
    return "motor" if tag == "general" else tag


def _upward(axis: Array) -> Array:
    across = np.cross([0.0, 0.0, 1.0], axis)
    if np.linalg.norm(across) < _SMALL:
        return np.diag([1.0, np.sign(axis[2]), np.sign(axis[2])])
    quaternion = np.array([1 + axis[2], *across])
    return of_quaternion(quaternion / np.linalg.norm(quaternion))


def _stated(node: Node, own: Mapping[str, str], name: str, counts: Collection[int], usual: str = "") -> list[Stated]:
    """Read numbers of an attribute of an element, its class or MuJoCo itself, as many as there may be."""
    numbers = node.numbers(name, usual=own.get(name, usual))
    if len(numbers) not in counts:
        wanted = f"{min(counts)}" if len(counts) == 1 else f"{min(counts)} to {max(counts)}"
        raise node.error(f"{name} has {len(numbers)} numbers; write {wanted}")
    return numbers


def _floats(node: Node, own: Mapping[str, str], name: str, counts: Collection[int], usual: str = "") -> list[float]:
    return [each.value for each in _stated(node, own, name, counts, usual)]


def read_mjcf(file: Path) -> SimulatorModel:
    """Read MJCF of a vehicle; InputError if there is no body that flies, or it is not one rigid body."""
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
    mass = sum(body.mass.value for body in bodies)
    if whole.total_mass > 0 and mass > 0:
        bodies = [_times(body, whole.total_mass / mass) for body in bodies]
        notes.append(f"the compiler's settotalmass makes it {whole.total_mass:g} kg, and inertias in proportion")
    rotors = tuple(_rotors(whole, root, sites, notes))
    if root.first("option") and any(node.attributes.get("density", "0") != "0" for node in root.all("option")):
        notes.append("MuJoCo's own fluid drags the body (option density); no number of a rotor")
    return SimulatorModel(root.attributes.get("model", flying[0].name), "mjcf", tuple(bodies), rotors, CANNOT,
                          tuple(notes), tuple(whole.files))  # fmt: skip


def _times(body: Body, share: float) -> Body:
    """Scale mass and inertia of a part."""
    mass, *entries = (
        replace(each, value=share * each.value, scale=each.scale / share) for each in (body.mass, *body.entries)
    )
    return replace(body, mass=mass, inertia=share * body.inertia, entries=tuple(entries))


def _gather(whole: _File, body: Node, placed: Array, above: str, bodies: list[Body], sites: dict[str, Array]) -> None:
    """Collect what has mass, and the sites, of a body and those below it, in the frame of the first."""
    named = body.attributes.get("childclass", above)
    for unread in body.all(*_UNREAD):
        raise unread.error(f"is not read here; write what is in it, {_COMPILED}")
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
    own = whole.placed(inertial, inertial.attributes)
    return part_of(body.name, inertial.number("mass"), entries, placed, own, place, inertial)


def _geom(whole: _File, geom: Node, placed: Array, named: str) -> Body | None:
    own = whole.of(geom, named)
    stated = _stated(geom, own, "mass", {1})[0] if "mass" in own else None
    if stated is not None and stated.value == 0:
        return None
    kind, size = own.get("type", "sphere"), _floats(geom, own, "size", range(4))
    solid, count = _SOLIDS.get(kind, (_box, 4))
    if "mesh" in own or "fromto" in own or own.get("shellinertia") == "true" or len(size) < count:
        raise geom.error(
            f"its mass follows from a {'mesh' if 'mesh' in own else kind}, which is not read here; give the body an "
            "<inertial> with pos, mass and diaginertia, as MuJoCo's compiler prints them"
        )
    if not min(size[:count]) > 0:
        raise geom.error(f"its size is {' '.join(f'{each:g}' for each in size)}; write numbers above 0")
    volume, per_mass = solid(*size, *[0.0] * (3 - len(size)))
    density = _floats(geom, own, "density", {1}, "1000")[0]
    mass = stated or Stated(density * volume, f"{geom.where}: from its density and size")
    at = placed @ whole.placed(geom, own)
    turned = at[:3, :3]
    return Body(geom.name or kind, mass, at[:3, 3], mass.value * turned @ np.diag(per_mass) @ turned.T, turned, turned)


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
    "box": (_box, 3),
    "ellipsoid": (_ellipsoid, 3),
    "cylinder": (_cylinder, 2),
    "capsule": (_capsule, 2),
    "sphere": (lambda radius, *_: _ellipsoid(radius, radius, radius), 1),
}
"""Volume and moments over mass of what a geom may be, and of how many numbers."""


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
        gear = [*_stated(node, own, "gear", range(1, 7), "1"), *[Stated(0.0, node.where)] * 6][:6]
        gain = _floats(node, own, "gainprm", range(1, 11), "1")[0]
        damps = own.get("gaintype") == "affine" or own.get("biastype") == "affine"
        pushes = abs(gain * gear[2].value) > _SMALL
        if own.get("site") in sites and pushes and not damps and (squared or not powers):
            pushing.append((node, own, gear, gain, squared))
    places = {tuple(np.round(sites[own["site"]][:2, 3], 6)) for _, own, *_ in pushing}
    if len(pushing) < 2 or len(places) < 2:
        notes.append("states no rotors: its actuators push and turn the body at one point")
        return
    for node, own, gear, gain, squared in pushing:
        yield _rotor(node, own, gear, gain, squared, sites[own["site"]])


def _rotor(node: Node, own: Mapping[str, str], gear: list[Stated], gain: float, squared: bool, site: Array) -> Rotor:
    force, turn = gear[2], gear[5]
    limited = "ctrlrange" in own and own.get("ctrllimited") != "false"
    limits = _floats(node, own, "ctrlrange", {2}) if limited else [-np.inf, np.inf]
    clamped = "forcerange" in own and own.get("forcelimited") != "false"
    forces = np.clip(gain * np.array(limits), *(_floats(node, own, "forcerange", {2}) if clamped else (None, None)))
    # Controls are above 0, but for those that may only be below.
    sign, most = (1.0, forces[1]) if limits[1] > 0 else (-1.0, forces[0])
    along = float(np.sign(sign * gain * force.value))
    words = f"{node.where}, gear and gain"
    lagging = None
    if own.get("dyntype") in ("filter", "filterexact"):
        lagging = _stated(node, own, "dynprm", range(1, 11), "1")[0]
        if not lagging.value > 0:
            raise node.error(f"dynprm is {lagging.value:g}; write a time constant above 0")
    thrust, torque = (replace(_sized(each, gain), where=words) for each in (force, turn))
    ratio = _sized(turn, 1 / force.value)
    turns = abs(ratio.value) > _SMALL
    top = limits[1] if limits[1] > 0 else -limits[0]
    return Rotor(
        node.name or own["site"],
        node.where,
        site[:3, 3],
        site[:3, 2] * along,
        int(-np.sign(turn.value / force.value)) if turns else 0,
        thrust=thrust if squared else None,
        torque=torque if squared and turns else None,
        ratio=replace(ratio, where=words) if turns and not squared else None,
        speed_max=Stated(float(np.sqrt(max(top, 0.0))), f"{node.where}, ctrlrange") if squared and limited else None,
        most=Stated(abs(float(force.value * most)), f"{node.where}, limits")
        if np.isfinite(most) and not squared
        else None,
        lag_up=lagging,
        lag_down=lagging,
        turn=replace(turn, where=words) if turns else None,
        node=node,
    )


def _sized(stated: Stated, factor: float) -> Stated:
    """Give the size of a number times a factor, and how the file has it."""
    value = abs(factor * stated.value)
    return replace(stated, value=value, scale=stated.value / value if value else 1.0)
