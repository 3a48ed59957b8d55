"""RotorPy's dictionary flown in RotorPy itself along a flight."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from cpfls_cli.playback.course import Course
from cpfls_cli.playback.motion import State, ran_away
from cpfls_cli.playback.rotors import RotorResponse
from cpfls_cli.simulators.literals import Numbers, python_numbers
from cpfls_cli.simulators.model import SimulatorModel


def quad_params(file: Path, model: SimulatorModel) -> dict[str, Any]:
    """Make the dictionary that `Multirotor` takes of a module that is not executed, without the noise of motors."""
    found = _nested(python_numbers(file), model.name)
    return dict(found) | {"num_rotors": len(model.rotors), "motor_noise_std": 0.0}


def _nested(numbers: Numbers, *key: str | int) -> Any:
    below = numbers.below(*key)
    if not below:
        return numbers.need(*key).value
    found = {name: _nested(numbers, *key, name) for name in below}
    return np.array(list(found.values())) if isinstance(below[0], int) else found


def fly_rotorpy(parameters: dict[str, Any], course: Course, *, lags: bool, **integrator: Any) -> State:
    """Fly RotorPy's `Multirotor`, with commanded speeds kept from sample to sample.

    Parameters
    ----------
    course : Course
        With rotors in the order of the dictionary.
    lags : bool
        Whether motors lag behind the speeds; else they are there at once.
    integrator : dict
        What `scipy.integrate.solve_ivp` takes; RotorPy's own where there is none.

    Returns
    -------
    State
        Shape (run, horizon, ...); NaN from where a run ran away.
    """
    from rotorpy.vehicles.multirotor import Multirotor
    from scipy.spatial.transform import Rotation

    flown = Multirotor(parameters, control_abstraction="cmd_motor_speeds", integrator_kwargs=integrator or None)
    begun = course.lagged(RotorResponse(lag_s=parameters["tau_m"]))
    start, states = course.start, course.unknown
    for run, commands in enumerate(course.commands):
        now = flown.initial_state | {
            "x": start.position[run],
            "v": start.velocity[run],
            "q": Rotation.from_matrix(start.rotation[run]).as_quat(),
            "w": start.rate[run],
            "rotor_speeds": begun[run],
        }
        for step, speed in enumerate(commands, 1):
            now["rotor_speeds"] = now["rotor_speeds"] if lags else speed
            now = flown.step(now, {"cmd_motor_speeds": speed}, course.period)
            if step % course.finer:
                continue
            if ran_away(now["w"]):
                break
            reached = now["x"], now["v"], Rotation.from_quat(now["q"]).as_matrix(), now["w"]
            for part, own in zip(states, reached, strict=True):
                part[run, step // course.finer - 1] = own
    return states
