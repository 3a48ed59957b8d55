"""Control the attitude with an identified model: the body torque under which its own error would die out.

python examples/computed_torque.py CONFIG TRAJECTORY.h5 MODEL.h5

Prints the root mean square error of roll, pitch and yaw, in degrees, of a controller that knows the model of
`cpfls identify`, and of feedback alone; both turn the exact rigid body of the config (held at its centre of mass).
"""

import sys
from itertools import pairwise
from pathlib import Path

import h5py
import numpy as np
from scipy.integrate import solve_ivp

from cpfls_cli import rotations, store
from cpfls_cli.artifacts.identified import IdentifiedModel
from cpfls_cli.config.load import load_study
from cpfls_cli.dynamics import coriolis_matrix, turning_law
from cpfls_cli.inertia import six_parameters

FREQUENCY, DAMPING = 2 * np.pi * np.array([1.2, 1.2, 0.5]), 1.0
BEGIN = np.array([0.1, -0.1, 0.1])


def computed_torque(model):
    """Command tau = D(q) v + C(q, q') q', with v the planned acceleration and feedback of the error."""

    def law(attitude, rate, wanted):
        inertia = model.inertia(attitude)
        return inertia.value[0] @ wanted[0] + coriolis_matrix(inertia, rate)[0] @ rate[0]

    return law


def follow(plan, law, inertia):
    """Give the attitude errors, rad, at the samples of a plan; commands are held from sample to sample."""
    turning, errors = turning_law(inertia), []
    attitude = plan["attitude"][:1] - BEGIN
    body_rate = rotations.body_rate(attitude, plan["attitude_rate"][:1])

    def slope(_, state, torque):
        attitude, body_rate = state[None, :3], state[None, 3:]
        acceleration = turning(attitude, body_rate).acceleration(torque)
        return np.concatenate([rotations.attitude_rate(attitude, body_rate)[0], acceleration[0]])

    for sample, ends in enumerate(pairwise(plan["time"])):
        planned, planned_rate, ahead = (plan[f"attitude{order}"][sample] for order in ("", "_rate", "_acceleration"))
        error, rate = rotations.wrapped(planned - attitude), rotations.attitude_rate(attitude, body_rate)
        wanted = ahead + FREQUENCY**2 * error + 2 * DAMPING * FREQUENCY * (planned_rate - rate)
        torque = rotations.body_torque(attitude, law(attitude, rate, wanted)[None])
        errors.append(error[0])
        state = np.concatenate([attitude[0], body_rate[0]])
        state = solve_ivp(slope, ends, state, args=(torque,), rtol=1e-8, atol=1e-10).y[None, :, -1]
        attitude, body_rate = state[:, :3], state[:, 3:]
    return np.array(errors)


def main(config, trajectory, model):
    with h5py.File(trajectory) as file:
        names = ("time", "attitude", "attitude_rate", "attitude_acceleration")
        plan = {name: file[name][:] for name in names}
    identified = store.read(Path(model), IdentifiedModel)[0].functions
    level = np.diagonal(identified.inertia(np.zeros((1, 3))).value[0])
    laws = {"model": computed_torque(identified), "feedback": lambda _, __, wanted: level * wanted[0]}
    inertia = six_parameters(load_study(Path(config)).vehicle.inertia_kg_m2)
    settled = len(plan["time"]) // 2
    for name, law in laws.items():
        error = np.degrees(follow(plan, law, inertia)[settled:])
        print(name, *(f"{size:.3g}" for size in np.sqrt(np.mean(error**2, axis=0))))


if __name__ == "__main__":
    main(*sys.argv[1:])
