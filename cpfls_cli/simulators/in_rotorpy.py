"""RotorPy's dictionary flown in RotorPy itself along a flight."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from cpfls_cli.playback.course import Course
from cpfls_cli.playback.motion import State
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
    """Fly RotorPy's `Multirotor`; see `cpfls_cli.playback.course.Flies`.

    Parameters
    ----------
    integrator : dict
        What `scipy.integrate.solve_ivp` takes; RotorPy's own where there is none.
    """
    from rotorpy.vehicles.multirotor import Multirotor
    from scipy.spatial.transform import Rotation

    more = {"integrator_kwargs": integrator} if integrator else {}
    flown = Multirotor(parameters, control_abstraction="cmd_motor_speeds", **more)
    # It limits commands, and not the speeds of a state that it is given.
    limited = np.clip(course.flight.speed, flown.rotor_speed_min, flown.rotor_speed_max)
    course = replace(course, flight=replace(course.flight, speed=limited))
    begun, start, commands = course.lagged(RotorResponse(lag_s=parameters["tau_m"])), course.start, course.commands

    def along(run: int) -> Iterator[State]:
        now = flown.initial_state | {
            "x": start.position[run],
            "v": start.velocity[run],
            "q": Rotation.from_matrix(start.rotation[run]).as_quat(),
            "w": start.rate[run],
            "rotor_speeds": begun[run],
        }
        for speed in commands[run]:
            now["rotor_speeds"] = now["rotor_speeds"] if lags else speed
            now = flown.step(now, {"cmd_motor_speeds": speed}, course.period)
            yield State(now["x"], now["v"], Rotation.from_quat(now["q"]).as_matrix(), now["w"])

    return course.collected(map(along, range(len(commands))))
