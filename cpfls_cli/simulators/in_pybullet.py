"""URDF flown in PyBullet along a flight, with the forces of gym-pybullet-drones, whose package nobody can install.

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
from cpfls_cli.playback.course import Course
from cpfls_cli.playback.motion import State, ran_away
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
    """Fly URDF without shapes in PyBullet, with speeds kept from sample to sample, of rotors without lag.

    Parameters
    ----------
    model : SimulatorModel
        What was read from it.
    course : Course
        With rotors in the order of the file.
    damping : float or None
        Of all motion; None for PyBullet's own, which gym-pybullet-drones leaves as it is.

    Returns
    -------
    State
        Of the centre of mass, shape (run, horizon, ...); NaN from where a run ran away.
    """
    with _silent():
        import pybullet as bullet

        client = bullet.connect(bullet.DIRECT)
        with TemporaryDirectory() as folder:
            file = Path(folder, "vehicle.urdf")
            file.write_bytes(text)
            body = bullet.loadURDF(str(file), flags=bullet.URDF_USE_INERTIA_FROM_FILE, physicsClientId=client)
    try:
        bullet.setGravity(0, 0, -GRAVITY, client)
        if damping is not None:
            bullet.changeDynamics(body, -1, linearDamping=damping, angularDamping=damping, physicsClientId=client)
        most = model.speed_max
        return _flown(_Vehicle.of(bullet, client, body, model), course, np.inf if most is None else most.value)
    finally:
        bullet.disconnect(client)


class _Vehicle(NamedTuple):
    """A vehicle in PyBullet: links of its rotors, numbers that push it, and the frame in which PyBullet has it.

    Attributes
    ----------
    turned, lever : array, shape (3, 3) and (3,), m
        Axes of the first link's inertial, and from its centre to that of the whole mass, in the axes of the vehicle.
    """

    bullet: Any
    client: int
    body: int
    hubs: tuple[int, ...]
    turns: Array
    kf: float
    km: float
    drag: Array
    turned: Array
    lever: Array

    @classmethod
    def of(cls, bullet: Any, client: int, body: int, model: SimulatorModel) -> _Vehicle:
        infos = [bullet.getJointInfo(body, own, client) for own in range(bullet.getNumJoints(body, client))]
        links = {info[12].decode(): info[0] for info in infos}
        rotor, first = model.rotors[0], model.bodies[0]
        assert rotor.thrust is not None, "a file has it where it has rotors"
        assert rotor.node is not None, "rotors have the element of their numbers"
        drag = [float(rotor.node.attributes.get(f"drag_coeff_{axis}", 0.0)) for axis in ("xy", "xy", "z")]
        km = 0.0 if rotor.torque is None else rotor.torque.value
        return cls(
            *(bullet, client, body),
            hubs=tuple(links[own.name] for own in model.rotors),
            turns=np.array([own.spin for own in model.rotors]),
            kf=rotor.thrust.value,
            km=km,
            drag=np.array(drag),
            turned=first.turned,
            lever=model.centre - first.centre,
        )

    def put(self, state: State) -> None:
        """Start from a state of the centre of mass."""
        lever, spin = state.rotation @ self.lever, state.rotation @ state.rate
        angles = euler_angles((state.rotation @ self.turned)[None])[0]
        quaternion = self.bullet.getQuaternionFromEuler(angles)
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

    def push(self, speed: Array, state: State) -> None:
        """Take a step with speeds of the rotors, rad/s, from a state."""
        bullet, squares = self.bullet, speed**2
        for hub, force in zip(self.hubs, self.kf * squares, strict=True):
            bullet.applyExternalForce(self.body, hub, [0, 0, force], [0, 0, 0], bullet.LINK_FRAME, self.client)
        torque = [0, 0, -self.km * (self.turns @ squares)]
        bullet.applyExternalTorque(self.body, self.hubs[0], torque, bullet.LINK_FRAME, self.client)
        # Along the axes of the world, which is what gym-pybullet-drones does.
        drag = -speed.sum() * self.drag * state.velocity
        bullet.applyExternalForce(self.body, -1, drag, state.position, bullet.WORLD_FRAME, self.client)
        bullet.stepSimulation(self.client)


def _flown(vehicle: _Vehicle, course: Course, most: float) -> State:
    """Fly all runs; rotors turn at most so fast, rad/s."""
    steps, start, states = course.steps(_STEP_S), course.start, course.unknown
    vehicle.bullet.setTimeStep(course.period / steps, vehicle.client)
    for run, row in enumerate(np.minimum(course.commands, most)):
        vehicle.put(State(*(part[run] for part in start)))
        now = vehicle.state
        for step, speed in enumerate(row, 1):
            for _ in range(steps):
                vehicle.push(speed, now)
                now = vehicle.state
            if ran_away(now.rate):
                break
            if step % course.finer == 0:
                for part, own in zip(states, now, strict=True):
                    part[run, step // course.finer - 1] = own
    return states


@contextmanager
def _silent() -> Iterator[None]:
    """Keep what a library prints by itself, past Python, from where answers are read."""
    sys.stdout.flush()
    sys.stderr.flush()
    kept, nowhere = [os.dup(number) for number in (1, 2)], os.open(os.devnull, os.O_WRONLY)
    try:
        for number in (1, 2):
            os.dup2(nowhere, number)
        yield
    finally:
        ctypes.CDLL(None).fflush(None)
        for number, own in zip((1, 2), kept, strict=True):
            os.dup2(own, number)
            os.close(own)
        os.close(nowhere)
