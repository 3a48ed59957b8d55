"""A quadrotor flown in MuJoCo, whose rigid body is not ours, and logged as the flights of our own simulator are."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.playback.flight import PlaybackFlight
from cpfls_cli.vehicle.settings import RotorSettings, VehicleSettings
from tests.builders.playback_flights import KINDS, MIDDLING, Autopilot, Plan, logged, planned

VEHICLE = VehicleSettings(
    mass_kg=1.3,
    inertia_kg_m2=(0.0118, 0.0142, 0.0231),
    rotor_speed_max_rad_s=1100.0,
    rotors=tuple(
        RotorSettings(position_m=(x, y, 0.0), spin=spin, thrust_factor_n_s2=1.15e-5, drag_factor_n_m_s2=1.9e-7)
        for x, y, spin in ((0.16, -0.14, 1), (-0.16, -0.14, -1), (-0.16, 0.14, 1), (0.16, 0.14, -1))
    ),
)
LAG_S = 0.028
PERIOD, _FINE = 0.01, 10
"""Period of the log in s, and steps of MuJoCo in it."""


def _scene() -> str:
    """Describe the body: each rotor a site that pushes along z, and turns against its spin."""
    sites, motors = [], []
    for number, rotor in enumerate(VEHICLE.rotors):
        lever = -rotor.spin * rotor.drag_factor_n_m_s2 / rotor.thrust_factor_n_s2
        sites.append(f'<site name="r{number}" pos="{" ".join(map(str, rotor.position_m))}"/>')
        motors.append(f'<motor site="r{number}" gear="0 0 1 0 0 {lever:.12g}"/>')
    inertia = " ".join(map(str, VEHICLE.inertia_kg_m2))
    return f"""
    <mujoco>
      <option timestep="{PERIOD / _FINE}" integrator="RK4" gravity="0 0 -{VEHICLE.gravity_m_s2}"/>
      <worldbody><body><freejoint/>
        <inertial pos="0 0 0" mass="{VEHICLE.mass_kg}" diaginertia="{inertia}"/>
        {"".join(sites)}
      </body></worldbody>
      <actuator>{"".join(motors)}</actuator>
    </mujoco>"""


def mujoco_flights(seed: int, times: int, duration_s: float = 20.0) -> list[PlaybackFlight]:
    """Fly each kind of excitation some times; logged are the commanded rotor speeds, with noise as all else."""
    rng, kinds = np.random.default_rng(seed), KINDS * times
    plan = planned(kinds, PERIOD * np.arange(round(duration_s / PERIOD)), rng)
    names = [f"mujoco-{kind}-{number}" for number, kind in enumerate(kinds)]
    return [logged(name, *_flown(plan, number), PERIOD, "previous", MIDDLING, rng) for number, name in enumerate(names)]


def _flown(plans: Plan, number: int) -> tuple[Array, Array]:
    """Fly one plan: position, velocity, quaternion x, y, z, w and rate at the samples, and commanded rotor speeds."""
    plan = Plan(*(part[:, number : number + 1] for part in plans))
    model = mujoco.MjModel.from_xml_string(_scene())
    data, autopilot = mujoco.MjData(model), Autopilot(VEHICLE)
    data.qpos[:3], data.qvel[:3] = plan.position[0, 0], plan.velocity[0, 0]
    thrust = np.array([rotor.thrust_factor_n_s2 for rotor in VEHICLE.rotors])
    halfway = np.exp(-PERIOD / _FINE / 2 / LAG_S)
    states, commands, acting = [], [], None
    for sample in range(len(plan.held)):
        # MuJoCo counts velocity in the world, rate in the body, and quaternions from their scalar.
        state = _rolled(data.qpos, data.qvel)
        command = autopilot.speeds(plan, sample, *(part[None] for part in np.split(state, [3, 6, 10])))[0]
        acting = command if acting is None else acting
        states.append(state), commands.append(command)
        for _ in range(_FINE):
            between = command + (acting - command) * halfway
            acting = command + (between - command) * halfway
            data.ctrl[:] = thrust * between**2
            mujoco.mj_step(model, data)
    return np.array(states), np.array(commands)


def _rolled(place: Sequence[float], moved: Sequence[float]) -> Array:
    return np.concatenate([place[:3], moved[:3], np.roll(place[3:7], -1), moved[3:6]])
