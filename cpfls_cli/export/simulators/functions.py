"""A vehicle as pure functions of state, rotor speeds and parameters, in CasADi and in JAX, and flown in both."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.export.course import Course
from cpfls_cli.export.holding import Held
from cpfls_cli.export.sheet import Sheet
from cpfls_cli.export.source import executed, python_source
from cpfls_cli.playback.motion import State


def casadi_text(sheet: Sheet, _held: Held, told: Sequence[str], file: str) -> str:
    """Write a vehicle as a module of functions for CasADi; parameters as those of the other targets."""
    return python_source(sheet, file, "casadi", told)


def jax_text(sheet: Sheet, _held: Held, told: Sequence[str], file: str) -> str:
    """Write a vehicle as a module of functions for JAX; parameters as those of the other targets."""
    return python_source(sheet, file, "jax", told)


def fly_casadi(text: str, course: Course) -> State:
    """Fly an exported vehicle in CasADi; see `Target.fly`."""
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
    """Fly an exported vehicle in JAX; see `Target.fly`."""
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
    start = course.start
    state = np.hstack([part.reshape(len(course.starts), -1) for part in start])
    path = np.empty((course.horizon, *state.shape))
    for k in range(course.horizon):
        state = path[k] = step(state, terms[course.starts + k])
    path = path.swapaxes(0, 1)
    rotation = path[:, :, 6:15].reshape(*path.shape[:2], 3, 3)
    return State(path[:, :, :3], path[:, :, 3:6], rotation, path[:, :, 15:])
