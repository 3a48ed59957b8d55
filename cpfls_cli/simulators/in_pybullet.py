"""URDF flown in PyBullet along a flight, with the forces of gym-pybullet-drones, which no package index has.

They are those of its ``BaseAviary.py`` with `Physics.PYB_DRAG`; see `cpfls_cli.simulators.urdf`.
"""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple
from xml.etree.ElementTree import tostring

import numpy as np
from defusedxml.ElementTree import fromstring

from cpfls_cli.arrays import Array
from cpfls_cli.playback.flight import State
from cpfls_cli.playback.player import Course
from cpfls_cli.rotations import euler_angles
from cpfls_cli.simulators.model import SimulatorModel
from cpfls_cli.simulators.urdf import GRAVITY

_STEP_S = 1 / 240
"""The longest step, which is the usual one there."""


def without_shapes(text: bytes) -> bytes:
    """Take out what is seen and what collides, whose meshes are elsewhere; inertia follows from none of it."""
    root = fromstring(text)
    for link in root.iter("link"):
        for shape in [child for child in link if child.tag in ("visual", "collision")]:
            link.remove(shape)
    return bytes(tostring(root))


def fly_pybullet(text: bytes, model: SimulatorModel, course: Course, damping: float | None = None) -> State:
    """Fly URDF without shapes in PyBullet, of rotors without lag; see `cpfls_cli.playback.player.Flies`.

    Parameters
    ----------
    model : SimulatorModel
        What was read from it.
    damping : float or None
        Of all motion; None for PyBullet's own, which gym-pybullet-drones leaves as it is.
    """
    with _silent():
        import pybullet as bullet

        client = bullet.connect(bullet.DIRECT)
    try:
        with _silent(), TemporaryDirectory() as folder:
            file = Path(folder, "vehicle.urdf")
            file.write_bytes(text)
            body = bullet.loadURDF(str(file), flags=bullet.URDF_USE_INERTIA_FROM_FILE, physicsClientId=client)
        bullet.setGravity(0, 0, -GRAVITY, client)
        if damping is not None:
            bullet.changeDynamics(body, -1, linearDamping=damping, angularDamping=damping, physicsClientId=client)
        first = model.bodies[0]
        return _flown(_Vehicle(bullet, client, body, first.turned, model.centre - first.centre), model, course)
    finally:
        bullet.disconnect(client)


class _Vehicle(NamedTuple):
    """A vehicle in PyBullet, which is where the inertial of its first link is.

    Attributes
    ----------
    turned, lever : array, shape (3, 3) and (3,), m
        Axes of that inertial, and from its centre to that of the whole mass, in the axes of the vehicle.
    """

    bullet: Any
    client: int
    body: int
    turned: Array
    lever: Array

    def put(self, state: State) -> None:
        """Start from a state of the centre of mass."""
        lever, spin = state.rotation @ self.lever, state.rotation @ state.rate
        quaternion = self.bullet.getQuaternionFromEuler(euler_angles((state.rotation @ self.turned)[None])[0])
        self.bullet.resetBasePositionAndOrientation(self.body, state.position - lever, quaternion, self.client)
        self.bullet.resetBaseVelocity(self.body, state.velocity - np.cross(spin, lever), spin, self.client)

    @property
    def state(self) -> State:
        """State of the centre of mass."""
        place, quaternion = self.bullet.getBasePositionAndOrientation(self.body, self.client)
        velocity, spin = map(np.array, self.bullet.getBaseVelocity(self.body, self.client))
        rotation = np.reshape(self.bullet.getMatrixFromQuaternion(quaternion), (3, 3)) @ self.turned.T
        lever = rotation @ self.lever
        return State(place + lever, velocity + np.cross(spin, lever), rotation, rotation.T @ spin)


def _flown(vehicle: _Vehicle, model: SimulatorModel, course: Course) -> State:
    bullet, client, body, *_ = vehicle
    infos = [bullet.getJointInfo(body, own, client) for own in range(bullet.getNumJoints(body, client))]
    links = {info[12].decode(): info[0] for info in infos}
    hubs = [links[rotor.name] for rotor in model.rotors]
    speeds = np.minimum(course.commands, np.inf if model.speed_max is None else model.speed_max.value)
    lifts = speeds**2 * [rotor.thrust.value if rotor.thrust else 0.0 for rotor in model.rotors]
    turns = speeds**2 @ [-rotor.spin * rotor.torque.value if rotor.torque else 0.0 for rotor in model.rotors]
    properties = model.rotors[0].node
    assert properties is not None, "rotors of URDF have the element of their numbers"
    # Along the axes of the world, which is what gym-pybullet-drones does.
    drag = -np.array([float(properties.attributes.get(f"drag_coeff_{axis}", 0.0)) for axis in ("xy", "xy", "z")])
    steps = course.steps(_STEP_S)
    bullet.setTimeStep(course.period / steps, client)

    def along(run: int) -> Iterator[State]:
        vehicle.put(State(*(part[run] for part in course.start)))
        now = vehicle.state
        for forces, turn, total in zip(lifts[run], turns[run], speeds[run].sum(axis=1), strict=True):
            for _ in range(steps):
                for hub, force in zip(hubs, forces, strict=True):
                    bullet.applyExternalForce(body, hub, [0, 0, force], [0, 0, 0], bullet.LINK_FRAME, client)
                bullet.applyExternalTorque(body, hubs[0], [0, 0, turn], bullet.LINK_FRAME, client)
                push = total * drag * now.velocity
                bullet.applyExternalForce(body, -1, push, now.position, bullet.WORLD_FRAME, client)
                bullet.stepSimulation(client)
                now = vehicle.state
            yield now

    return course.collected(map(along, range(len(speeds))))


@contextmanager
def _silent() -> Iterator[None]:
    """Keep what a library prints by itself, past Python, from where answers are read."""
    sys.stdout.flush()
    sys.stderr.flush()
    flush = ctypes.CDLL(None).fflush
    with open(os.devnull, "wb") as nowhere:
        kept = [os.dup(number) for number in (1, 2)]
        try:
            for number in (1, 2):
                os.dup2(nowhere.fileno(), number)
            try:
                yield
            finally:
                flush(None)
        finally:
            for number, own in zip((1, 2), kept, strict=True):
                os.dup2(own, number)
                os.close(own)
