"""Fly an exported vehicle in MuJoCo by a controller that knows the stated one, and log it: see docs/simulators.md.

python examples/fly_mujoco.py UAV.xml STUDY.yaml LOG.h5

In the place of a study that leaves numbers open, name the vehicle.h5 that `cpfls vehicle` found.
"""

import sys

import h5py
import mujoco
import numpy as np
import yaml

BEGIN_S, END_S, EVERY = 5.0, 45.0, 10
STIFF, DAMPED = np.array([60.0, 60.0, 1.5]), np.array([14.0, 14.0, 2.0])
ROTOR = ("position_m", "spin", "thrust_factor_n_s2", "drag_factor_n_m_s2")
NOISE = {"attitude": 0.003, "rate": 0.005, "position": 0.02, "velocity": 0.05, "speed": 1.0}


def reference(time):
    """Position, velocity, acceleration and yaw: waves of three frequencies."""
    size, pace = np.array([3.0, 2.5, 1.5]), np.array([0.7, 0.55, 0.4])
    slow, fast = pace * time, 2.3 * pace * time
    place = size * (np.sin(slow) + 0.2 * np.sin(fast))
    velocity = size * pace * (np.cos(slow) + 0.46 * np.cos(fast))
    acceleration = -size * pace**2 * (np.sin(slow) + 1.06 * np.sin(fast))
    return place, velocity, acceleration, 1.2 * np.sin(0.3 * time)


class Controller:
    """Rotor speeds that follow the reference: a geometric controller on the numbers of a study."""

    def __init__(self, vehicle):
        self.mass, self.inertia = vehicle["mass_kg"], np.diag(vehicle["inertia_kg_m2"][:3])
        rows = []
        for rotor in vehicle["rotors"]:
            (x, y, _), k = rotor["position_m"], rotor["thrust_factor_n_s2"]
            rows.append([k, y * k, -x * k, -rotor["spin"] * rotor["drag_factor_n_m_s2"]])
        self.allocation = np.linalg.inv(np.array(rows).T)

    def __call__(self, time, position, velocity, rotation, rate):
        place, pace, acceleration, yaw = reference(time)
        wanted = acceleration + 4.0 * (place - position) + 3.2 * (pace - velocity) + [0.0, 0.0, 9.81]
        up = wanted / np.linalg.norm(wanted)
        left = np.cross(up, [np.cos(yaw), np.sin(yaw), 0.0])
        left /= np.linalg.norm(left)
        attitude = np.column_stack([np.cross(left, up), left, up])
        apart = 0.5 * (attitude.T @ rotation - rotation.T @ attitude)
        error = np.array([apart[2, 1], apart[0, 2], apart[1, 0]])
        # Rotors turn the vehicle about its vertical axis by their drag alone, which is weak.
        torque = self.inertia @ (-STIFF * error - DAMPED * rate) + np.cross(rate, self.inertia @ rate)
        squares = self.allocation @ [self.mass * wanted @ rotation[:, 2], *torque]
        return np.sqrt(np.maximum(squares, 0.0))


def fly(model, controller):
    """Give time, state and rotor speeds at every tenth step, once the vehicle is on its way."""
    data, rows = mujoco.MjData(model), []
    rotor = model.numeric("ctrl_rotor").data.astype(int)
    power = model.numeric("ctrl_power").data
    begin = round(BEGIN_S / model.opt.timestep)
    for step in range(round(END_S / model.opt.timestep)):
        mujoco.mju_quat2Mat(turned := np.empty(9), data.qpos[3:7])
        rotation, rate = turned.reshape(3, 3), data.qvel[3:].copy()
        speed = controller(data.time, data.qpos[:3], data.qvel[:3], rotation, rate)
        if step % EVERY == 0 and step >= begin:
            roll, pitch = np.arctan2(rotation[2, 1], rotation[2, 2]), -np.arcsin(rotation[2, 0])
            attitude = roll, pitch, np.arctan2(rotation[1, 0], rotation[0, 0])
            rows.append([data.time, *attitude, *rate, *data.qpos[:3], *data.qvel[:3], *speed])
        data.ctrl[:] = speed[rotor] ** power
        mujoco.mj_step(model, data)
    return np.array(rows)


def known(study):
    """Read the numbers of a vehicle: of a study, or as `cpfls vehicle` found them."""
    if h5py.is_hdf5(study):
        with h5py.File(study) as file:
            held = file["model/vehicle"]
            # A table within the table of the rotors: three lines of each.
            places = held["rotors/position_m/values"][()].reshape(-1, 3)
            columns = [places, *(held[f"rotors/{name}"][()] for name in ROTOR[1:])]
            rotors = [dict(zip(ROTOR, each, strict=True)) for each in zip(*(c.tolist() for c in columns), strict=True)]
            inertia, mass = held["inertia_kg_m2"][()].tolist(), float(held["mass_kg"][()])
            return {"mass_kg": mass, "inertia_kg_m2": inertia, "rotors": rotors}
    with open(study, encoding="utf-8") as stream:
        vehicle = yaml.safe_load(stream)["vehicle"]
    if None in (vehicle["inertia_kg_m2"] or [None]) or any(
        None in [r[key] for key in ROTOR] for r in vehicle["rotors"]
    ):
        sys.exit(f"{study}: leaves numbers of the vehicle open; name the vehicle.h5 that `cpfls vehicle` found instead")
    return vehicle


def main(uav, study, log):
    vehicle = known(study)
    rows = fly(mujoco.MjModel.from_xml_path(uav), Controller(vehicle))
    noise = np.repeat([0.0, *NOISE.values()], [1, 3, 3, 3, 3, rows.shape[1] - 13])
    rows += noise * np.random.default_rng(1).standard_normal(rows.shape)
    names = ["time", "roll", "pitch", "yaw", "p", "q", "r", "x", "y", "z", "vx", "vy", "vz"]
    with h5py.File(log, "w") as file:
        for name, column in zip([*names, *(f"w{i}" for i in range(1, rows.shape[1] - 12))], rows.T, strict=True):
            file[name] = column


if __name__ == "__main__":
    main(*sys.argv[1:])
