"""MJCF flown in MuJoCo itself along a flight: by its integrator and step, its limits of controls and all its actuators.

Contact is left out, for a log does not say where the ground of the file is.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.playback.flight import State
from cpfls_cli.playback.player import Course
from cpfls_cli.playback.rotors import RotorResponse
from cpfls_cli.simulators.model import Rotor, SimulatorModel


class Controls(NamedTuple):
    """What each actuator takes: a factor times a power of the speed of a rotor, which is -1 for none."""

    rotor: IntArray
    power: IntArray
    factor: Array

    def of(self, speed: Array, model: Any) -> Array:
        """Give the controls for speeds of the rotors within the limits of a model, shape (..., actuator)."""
        asked = np.asarray(self.factor * speed[..., self.rotor] ** self.power)
        limited = model.actuator_ctrllimited.astype(bool)
        asked[..., limited] = np.clip(asked[..., limited], *model.actuator_ctrlrange[limited].T)
        return asked


def compiled(file: Path, folder: Path) -> Any:
    """Compile MJCF whose meshes and pictures are next to another file, in this folder."""
    import mujoco

    spec = mujoco.MjSpec.from_file(str(file))
    spec.modelfiledir = str(folder.resolve())
    return spec.compile()


def fly_mujoco(model: Any, course: Course, controls: Controls, *, lags: bool) -> State:
    """Fly the body with a free joint of a compiled MJCF (`mujoco.MjModel`); see `cpfls_cli.playback.player.Flies`.

    Where rotors do not lag, filters of actuators are at their controls at once.
    """
    import mujoco

    off, stated, flags = mujoco.mjtDisableBit, model.opt.timestep, model.opt.disableflags
    steps = course.steps(stated)
    data, body, start = mujoco.MjData(model), _Body.of(model), course.start
    asked, filtered = controls.of(course.commands, model), np.flatnonzero(model.actuator_actadr >= 0)
    begun, times = asked[:, 0, filtered], model.actuator_dynprm[filtered, 0]
    # Speeds are lines between samples, and their squares are none.
    fine = course.finer_flight
    fine = replace(fine, speed=controls.of(fine.speed, model))
    controlled = replace(course, flight=fine, starts=course.finer * course.starts, finer=1)
    for lag in np.unique(times) if lags else ():
        begun[:, times == lag] = controlled.lagged(RotorResponse(lag_s=float(lag)))[:, filtered[times == lag]]

    def along(run: int) -> Iterator[State]:
        mujoco.mj_resetData(model, data)
        body.put(data, State(*(part[run] for part in start)))
        data.act[:] = begun[run]
        for control in asked[run]:
            data.ctrl[:] = control
            data.act[:] = data.act if lags else control[filtered]
            mujoco.mj_step(model, data, nstep=steps)
            yield body.taken(data)

    # MuJoCo writes a file into the working folder of a run that ran away.
    mujoco.set_mju_user_warning(lambda _: None)
    try:
        model.opt.disableflags = flags | int(off.mjDSBL_CONTACT) | int(off.mjDSBL_AUTORESET)
        model.opt.timestep = course.period / steps
        return course.collected(map(along, range(len(asked))))
    finally:
        # The next flight may have another rate.
        model.opt.timestep, model.opt.disableflags = stated, flags
        mujoco.set_mju_user_warning(None)


class _Body(NamedTuple):
    """Where the body with the free joint is in the arrays of MuJoCo, and its centre of mass in its frame, m.

    A rate times `lever` is the velocity of the centre by turning, as the cross product is.
    """

    place: slice
    move: slice
    centre: Array
    lever: Array

    @classmethod
    def of(cls, model: Any) -> _Body:
        import mujoco

        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        (joint,) = np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE)
        body, place, move = (int(own[joint]) for own in (model.jnt_bodyid, model.jnt_qposadr, model.jnt_dofadr))
        centre = data.xmat[body].reshape(3, 3).T @ (data.subtree_com[body] - data.xpos[body])
        return cls(slice(place, place + 7), slice(move, move + 6), centre, np.cross(np.eye(3), centre))

    def put(self, data: Any, state: State) -> None:
        """Start from a state of the centre of mass."""
        import mujoco

        mujoco.mju_mat2Quat(quaternion := np.empty(4), state.rotation.ravel())
        velocity = state.velocity - state.rotation @ (state.rate @ self.lever)
        data.qpos[self.place] = *(state.position - state.rotation @ self.centre), *quaternion
        data.qvel[self.move] = *velocity, *state.rate

    def taken(self, data: Any) -> State:
        """Give the state of the centre of mass."""
        import mujoco

        place, moves = data.qpos[self.place], data.qvel[self.move]
        mujoco.mju_quat2Mat(turned := np.empty(9), place[3:])
        rotation = turned.reshape(3, 3)
        velocity, rate = moves[:3], moves[3:]
        moved = velocity + rotation @ (rate @ self.lever)
        return State(place[:3] + rotation @ self.centre, moved, rotation, rate)


def controls_of(made: Any, model: SimulatorModel, thrusts: Array) -> Controls:
    """Find what the actuators of a compiled MJCF take from the speeds of its rotors.

    Squared speeds; where the file has thrusts for controls, those that make these thrusts, and where it names a rotor
    and a power for each control, these.

    Parameters
    ----------
    thrusts : array, shape (rotor,), N s^2
        Thrust over squared speed.
    """
    import mujoco

    data = mujoco.MjData(made)
    mujoco.mj_forward(made, data)
    known = Controls(np.full(made.nu, -1), np.zeros(made.nu, dtype=np.int64), np.zeros(made.nu))
    owners = [_actuator(made, rotor) for rotor in model.rotors]
    for index, (own, rotor) in enumerate(zip(owners, model.rotors, strict=True)):
        site = made.actuator_trnid[own, 0]
        body = data.xmat[made.body_rootid[made.site_bodyid[site]]].reshape(3, 3)
        up = (body.T @ data.site_xmat[site].reshape(3, 3))[2, 2]
        thrust = up * made.actuator_gainprm[own, 0] * made.actuator_gear[own, 2]
        known.rotor[own], known.power[own] = index, 2
        known.factor[own] = 1.0 if rotor.thrust is not None else thrusts[index] / thrust
    if all(mujoco.mj_name2id(made, mujoco.mjtObj.mjOBJ_NUMERIC, f"ctrl_{name}") >= 0 for name in ("rotor", "power")):
        rotor, power = (made.numeric(f"ctrl_{name}").data.astype(int) for name in ("rotor", "power"))
        indices = {rotor[own]: index for index, own in enumerate(owners)}
        for own in (own for own in range(made.nu) if rotor[own] in indices):
            known.rotor[own], known.power[own], known.factor[own] = indices[rotor[own]], power[own], 1.0
    return known


def _actuator(made: Any, rotor: Rotor) -> int:
    """Find the actuator of a rotor, which without a name is called by its site."""
    import mujoco

    own = mujoco.mj_name2id(made, mujoco.mjtObj.mjOBJ_ACTUATOR, rotor.name)
    if own >= 0:
        return int(own)
    site = mujoco.mj_name2id(made, mujoco.mjtObj.mjOBJ_SITE, rotor.name)
    return int(np.flatnonzero((made.actuator_trnid[:, 0] == site) & (made.actuator_gear[:, 2] != 0.0))[0])
