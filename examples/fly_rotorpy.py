"""Fly an exported vehicle in RotorPy by its own controller, and log it as Parquet: see docs/simulators.md.

python examples/fly_rotorpy.py UAV_ROTORPY.py LOG.parquet
"""

import runpy
import sys

import numpy as np
import pyarrow as pa
import pyarrow.parquet
from rotorpy.controllers.quadrotor_control import SE3Control
from rotorpy.environments import Environment
from rotorpy.trajectories.lissajous_traj import TwoDLissajous
from rotorpy.vehicles.multirotor import Multirotor
from scipy.spatial.transform import Rotation

DURATION_S = 30.0
COLUMNS = {
    "w": ("p", "q", "r"),
    "x": ("x", "y", "z"),
    "v": ("vx", "vy", "vz"),
    "rotor_speeds": ("w1", "w2", "w3", "w4"),
}


def fly(numbers):
    """Give what RotorPy logs of a figure, from hover."""
    hover = np.full(4, np.sqrt(numbers["mass"] * 9.81 / (4 * numbers["k_eta"])))
    still = {name: np.zeros(3) for name in ("x", "v", "w", "wind")}
    start = still | {"q": np.array([0.0, 0.0, 0.0, 1.0]), "rotor_speeds": hover}
    vehicle = Multirotor(numbers, initial_state=start, control_abstraction="cmd_motor_speeds")
    path = TwoDLissajous(A=3.0, B=2.0, a=0.7, b=1.1, height=1.0)
    world = Environment(vehicle=vehicle, controller=SE3Control(numbers), trajectory=path, sim_rate=100)
    return world.run(t_final=DURATION_S, use_mocap=False, plot=False, animate_bool=False, verbose=False)


def main(uav, log):
    flown = fly(runpy.run_path(uav)["quad_params"])
    yaw, pitch, roll = Rotation.from_quat(flown["state"]["q"]).as_euler("ZYX").T
    columns = {"time": flown["time"], "roll": roll, "pitch": pitch, "yaw": yaw}
    for signal, names in COLUMNS.items():
        columns |= dict(zip(names, flown["state"][signal].T, strict=True))
    pyarrow.parquet.write_table(pa.table(columns), log)


if __name__ == "__main__":
    main(*sys.argv[1:])
