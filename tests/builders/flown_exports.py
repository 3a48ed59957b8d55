"""How exported vehicles are flown in their targets, from the text of the file and a course to states.

Targets that nobody can install are flown by their published equations.
"""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Callable
from typing import Any, NamedTuple
from xml.etree import ElementTree

import numpy as np
import yaml

from cpfls_cli import rotations
from cpfls_cli.arrays import Array
from cpfls_cli.dynamics import runge_kutta_step
from cpfls_cli.export.registry import Exported
from cpfls_cli.export.simulators.ardupilot import STEP_S, fly_ardupilot
from cpfls_cli.export.simulators.sdf import ENTRIES, SHORTEST_S, apart
from cpfls_cli.export.simulators.urdf import fly_urdf
from cpfls_cli.inertia import symmetric
from cpfls_cli.playback.flight import State
from cpfls_cli.playback.player import Course, fly_body
from cpfls_cli.playback.rotors import RotorResponse
from cpfls_cli.simulators import inside
from cpfls_cli.simulators.in_mujoco import Controls, fly_mujoco

_ARRAYS = "SCIPY_ARRAY_API"
_RPM = 30 / np.pi
_INTEGRATOR = {"method": "DOP853", "rtol": 1e-9, "atol": 1e-9}


def fly_mjcf(text: str, course: Course) -> State:
    """Fly an exported vehicle in MuJoCo."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(text)
    rotor, power = (model.numeric(f"ctrl_{name}").data.astype(int) for name in ("rotor", "power"))
    return fly_mujoco(model, course, Controls(rotor, power, np.ones(len(rotor))), lags=True)


def fly_sdf(text: str, course: Course) -> State:
    """Fly an exported vehicle by the published equations of the plugin."""
    model = ElementTree.fromstring(text).find("model")
    assert model is not None
    mass, inertia, hubs = _whole_body(model)
    motors = [{child.tag: child.text or "" for child in plugin} for plugin in model.iter("plugin")]

    def column(name: str) -> Array:
        return np.array([float(motor[name]) for motor in motors])

    thrust, drag, rolling = (
        column(name) for name in ("motorConstant", "rotorDragCoefficient", "rollingMomentCoefficient")
    )
    yaw = -np.array([1.0 if motor["turningDirection"] == "ccw" else -1.0 for motor in motors]) * column(
        "momentConstant"
    )
    lag = float(column("timeConstantUp")[0])

    def wrench(speed: Array, air: Array, rate: Array, _rotation: Array) -> tuple[Array, Array]:
        across = (air[:, None] + rotations.cross(rate[:, None], hubs)) * [1.0, 1.0, 0.0] * np.abs(speed)[..., None]
        up = [0.0, 0.0, 1.0]
        force = -drag[:, None] * across + (thrust * speed**2)[..., None] * up
        torque = rotations.cross(hubs, force) - rolling[:, None] * across + (yaw * thrust * speed**2)[..., None] * up
        return torque.sum(axis=1), force.sum(axis=1)

    # Without a lag the filter is at the command at once.
    return fly_body(course, mass, inertia, wrench, 0.0 if lag <= SHORTEST_S else lag)


def _whole_body(model: ElementTree.Element) -> tuple[float, Array, Array]:
    """Read mass, inertia about the centre of mass and places of the rotors from links."""
    masses, centres, own, hubs = [], [], [], []
    for link in model.iter("link"):
        place = np.array([float(word) for word in link.findtext("pose", "").split()[:3]])
        inner = np.array([float(word) for word in link.findtext("inertial/pose", "").split()[:3]])
        masses.append(float(link.findtext("inertial/mass", "")))
        centres.append(place + inner)
        own.append(symmetric([float(link.findtext(f"inertial/inertia/{entry}", "")) for entry in ENTRIES]))
        if link.get("name") != "base_link":
            hubs.append(place)
    centre = np.average(centres, axis=0, weights=masses)
    parts = zip(masses, centres, own, strict=True)
    inertia = sum(tensor + weight * apart(place - centre) for weight, place, tensor in parts)
    return float(sum(masses)), np.asarray(inertia), np.array(hubs) - centre


def fly_crazyflow(text: str, course: Course) -> State:
    """Fly an exported vehicle by the function of drone-models, by Runge-Kutta of order 4."""
    from scipy.spatial.transform import Rotation

    dynamics = _dynamics()
    (section,) = tomllib.loads(text).values()
    unused = {"thrust_min", "thrust_max"}
    given = {name: np.asarray(value) for name, value in section.items() if name not in unused}
    given |= {"J_inv": np.linalg.inv(given["J"])}
    rate = given["rotor_dyn_coef"][0]
    before = course.lagged(RotorResponse(lag_s=1.0 / rate if rate else 0.0))
    start, runs = course.start, len(course.starts)
    now = np.hstack([*(part.reshape(runs, -1) for part in start), _RPM * before])

    def parts(state: Array) -> list[Array]:
        position, velocity, rotation, turning, speed = np.split(state, [3, 6, 15, 18], axis=-1)
        return [position, velocity, _turned(rotation.reshape(*rotation.shape[:-1], 3, 3)), turning, speed]

    def slope(state: Array, command: Array) -> Array:
        position, velocity, rotation, turning, speed = parts(state)
        quaternion, speed = Rotation.from_matrix(rotation).as_quat(), speed if rate else command
        moved, _, faster, spun, wound = dynamics(position, quaternion, velocity, turning, command, speed, **given)
        turned = state[:, 6:15].reshape(runs, 3, 3) @ rotations.cross(np.eye(3), turning[:, None])
        return np.hstack([moved, faster, turned.reshape(runs, 9), spun, wound if rate else 0 * speed])

    rows = []
    for index, command in enumerate(_RPM * course.commands.swapaxes(0, 1), 1):
        now = runge_kutta_step(slope, now, (command, command, command), course.period)
        now[:, 6:15] = parts(now)[2].reshape(runs, 9)
        if index % course.finer == 0:
            rows.append(now)
    return State(*parts(np.stack(rows, axis=1))[:4])


def _dynamics() -> Any:
    """Load the function, which refuses a SciPy that was loaded for NumPy alone; it gets nothing else here."""
    before = os.environ.get(_ARRAYS)
    os.environ[_ARRAYS] = "1"
    try:
        from drone_models.first_principles import dynamics
    finally:
        os.environ.pop(_ARRAYS)
        os.environ.update({_ARRAYS: before} if before else {})
    return dynamics


def _turned(matrix: Array) -> Array:
    """Give the nearest rotations to matrices, shape (run, 3, 3)."""
    first, _, last = np.linalg.svd(matrix)
    return np.asarray(first @ last)


def fly_rotorpy(text: str, course: Course) -> State:
    """Fly an exported vehicle in RotorPy."""
    module = executed(text)
    return inside.fly_rotorpy(module["quad_params"], course, lags=module["ROTORS_LAG"], **_INTEGRATOR)


def fly_pegasus(text: str, course: Course) -> State:
    """Fly an exported vehicle by the published equations of Pegasus."""
    module = executed(text)
    curve, axes = module["THRUST_CURVE"], np.array(module["AXES"])
    thrust, yaw, turns = (np.array(curve[name]) for name in ("rotor_constant", "rolling_moment_coefficient", "rot_dir"))
    hubs, drag = np.array(module["POSITIONS"]), np.array(module["DRAG"])

    def wrench(speed: Array, air: Array, _rate: Array, _rotation: Array) -> tuple[Array, Array]:
        lifts = (thrust * speed**2)[..., None] * [0.0, 0.0, 1.0]
        torque = rotations.cross(hubs, lifts).sum(axis=1)
        torque[:, 2] += (yaw * speed**2) @ turns
        return torque, lifts.sum(axis=1) - drag * air

    return fly_body(course, module["MASS"], axes @ np.diag(module["MOMENTS"]) @ axes.T, wrench, 0.0)


def fly_webots(text: str, course: Course) -> State:
    """Fly an exported vehicle by the published equations of Webots' propellers."""

    def vectors(field: str) -> Array:
        return np.array([[float(word) for word in own.split()] for own in re.findall(rf"{field} (.*)", text)])

    hubs, thrust, torque = vectors("centerOfThrust"), vectors("thrustConstants"), vectors("torqueConstants")
    rows = re.search(r"inertiaMatrix \[\s*(.*)\s*(.*)\s*\]", text)
    assert rows is not None
    inertia = symmetric([float(word) for row in rows.groups() for word in row.split()])
    assert not thrust[:, 1].any()
    assert not torque[:, 1].any()
    # The example of Webots turns rotors that have a negative thrust constant backwards.
    ways = np.sign(thrust[:, 0])
    assert (np.abs(torque[:, 0]) * vectors("maxVelocity")[:, 0] ** 2 < vectors("maxTorque")[:, 0]).all()

    def wrench(speed: Array, _air: Array, _rate: Array, _rotation: Array) -> tuple[Array, Array]:
        signed = (ways * speed) * np.abs(speed)
        lifts = (thrust[:, 0] * signed)[..., None] * [0.0, 0.0, 1.0]
        moment = rotations.cross(hubs, lifts).sum(axis=1)
        moment[:, 2] -= signed @ torque[:, 0]
        return moment, lifts.sum(axis=1)

    return fly_body(course, float(vectors(" mass")[0, 0]), inertia, wrench, 0.0)


def fly_pyflyt(text: str, course: Course) -> State:
    """Fly an exported vehicle by the published equations of PyFlyt; the text is that of both files."""
    numbers, urdf = text.split("<?xml")
    given = yaml.safe_load(numbers)
    motor, drag = given["motor_params"], given["drag_params"]
    root = ElementTree.fromstring(urdf.split("?>", 1)[1])
    links = [link.find("inertial") for link in root.iter("link")]
    assert [joint.get("type") for joint in root.iter("joint")] == ["fixed"] * 5
    body, *points = [link for link in links if link is not None]
    entries = {entry: float(value) for entry, value in body.find("inertia").attrib.items()}  # type: ignore[union-attr]
    mass = float(body.find("mass").get("value"))  # type: ignore[union-attr, arg-type]
    # Links of motors are 0 to 3, in the order of the file, and that which drag acts on is 4.
    hubs = np.array([[float(word) for word in each.find("origin").get("xyz").split()] for each in points[:4]])  # type: ignore[union-attr]
    order = [int(rotor) - 1 for rotor in re.findall(r"motor\s+\d\s+is\s+rotor\s+(\d)", numbers.replace("#", ""))]
    most = np.sqrt(motor["total_thrust"] / (4 * motor["thrust_coef"]))
    turns = motor["torque_coef"] * np.array([-1.0, -1.0, 1.0, 1.0])
    assert drag["drag_coef_xyz"] == motor["noise_ratio"] == 0.0
    fastest = most / _RPM

    def wrench(speed: Array, _air: Array, rate: Array, _rotation: Array) -> tuple[Array, Array]:
        squares = (speed[:, order] / fastest * most) ** 2
        lifts = (motor["thrust_coef"] * squares)[..., None] * [0.0, 0.0, 1.0]
        torque = rotations.cross(hubs, lifts).sum(axis=1) - np.sign(rate) * drag["drag_coef_pqr"] * rate**2
        torque[:, 2] += squares @ turns
        return torque, lifts.sum(axis=1)

    # A time constant as long as its step has throttles at their commands at once.
    lag = 0.0 if motor["tau"] == 1 / 240 else motor["tau"]
    return fly_body(course, mass, symmetric([entries[name] for name in ENTRIES]), wrench, lag)


def text_of(form: str, made: Exported) -> str:
    """Give the text that a vehicle flies by: of PyFlyt that of both files."""
    return "".join(made.texts.values()) if form == "pyflyt" else made.text


def fly_casadi(text: str, course: Course) -> State:
    """Fly an exported vehicle in CasADi."""
    module, flight = executed(text), course.flight
    period = flight.motion.period
    made = module["functions"](period, flight.hold == "previous")
    parameters = np.array(module["PARAMETERS"])
    terms = []
    for speed in (flight.speed[part] for part in flight.stretches):
        memory = module["rotors_begin"](module["casadi"].DM(speed[0]), period)
        for now, following in zip(speed, [*speed[1:], speed[-1]], strict=True):
            memory, row = made["rotors"](memory, now, following, parameters)
            terms.append(np.array(row).ravel())
    step = made["step"].map(len(course.starts))
    columns = [np.repeat(parameters[:, None], len(course.starts), axis=1)]
    return _run(course, np.array(terms), lambda state, rotor: np.array(step(state.T, rotor.T, *columns)).T)


def fly_jax(text: str, course: Course) -> State:
    """Fly an exported vehicle in JAX."""
    import jax

    with jax.enable_x64(True):
        module, flight = executed(text), course.flight
        period, held = flight.motion.period, flight.hold == "previous"

        def along(memory: Any, pair: Any) -> Any:
            return module["rotors_step"](memory, *pair, period, held)

        parts = []
        for speed in (flight.speed[part] for part in flight.stretches):
            following = np.concatenate([speed[1:], speed[-1:]])
            begun = module["rotors_begin"](jax.numpy.array(speed[0]), period)
            parts.append(np.array(jax.lax.scan(along, begun, (speed, following))[1]))
        step = jax.jit(jax.vmap(lambda state, rotor: module["step"](state, rotor, period)))
        return _run(course, np.concatenate(parts), lambda state, rotor: np.array(step(state, rotor)))


def _run(course: Course, terms: Array, step: Callable[[Array, Array], Array]) -> State:
    """Take all runs through all steps, with states as rows of 18."""
    state = np.hstack([part.reshape(len(course.starts), -1) for part in course.start])
    path = np.empty((course.horizon, *state.shape))
    for k in range(course.horizon):
        state = path[k] = step(state, terms[course.starts + k])
    path = path.swapaxes(0, 1)
    return State(path[:, :, :3], path[:, :, 3:6], path[:, :, 6:15].reshape(*path.shape[:2], 3, 3), path[:, :, 15:])


def executed(text: str) -> dict[str, Any]:
    """Run exported Python, and give what it names."""
    module: dict[str, Any] = {"__name__": "exported"}
    exec(compile(text, "exported", "exec"), module)
    return module


class Flying(NamedTuple):
    """How a target is flown."""

    # States at the samples behind each start, shape (run, horizon, ...).
    fly: Callable[[str, Course], State]
    # What flies it; empty where this program does.
    package: str = ""
    # The longest step that it is flown with; infinite where it takes the flight's own.
    step_s: float = np.inf
    # Flights, each with half the step of the one before, that a step of no length follows from; 0 takes the very steps.
    levels: int = 4


FLYING = {
    "mjcf": Flying(fly_mjcf, "mujoco", 1e-3),
    "sdf": Flying(fly_sdf, step_s=1e-3),
    "px4": Flying(fly_sdf, step_s=1e-3),
    "crazyflow": Flying(fly_crazyflow, "drone_models", 2.5e-3),
    "urdf": Flying(fly_urdf, step_s=1e-3),
    "ardupilot": Flying(fly_ardupilot, step_s=STEP_S),
    "rotorpy": Flying(fly_rotorpy, "rotorpy"),
    "pegasus": Flying(fly_pegasus, step_s=1e-3),
    "pyflyt": Flying(fly_pyflyt, step_s=1e-3),
    "webots": Flying(fly_webots, step_s=1e-3),
    "casadi": Flying(fly_casadi, "casadi", levels=0),
    "jax": Flying(fly_jax, "jax", levels=0),
}
"""By the word of ``--format``."""
