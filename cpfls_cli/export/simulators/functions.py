"""A vehicle as pure functions of state, rotor speeds and parameters, in CasADi and in JAX, and flown in both."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.effects.polynomial import FACTORS
from cpfls_cli.export.course import Course
from cpfls_cli.export.holding import Held, Holds
from cpfls_cli.export.source import fill_template
from cpfls_cli.export.text import comment_lines, comment_text, filled, number
from cpfls_cli.export.vehicle_forms import common_words
from cpfls_cli.identification.model import Model
from cpfls_cli.inertia import six_parameters
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.playback.motion import State

if TYPE_CHECKING:
    from cpfls_cli.export.vehicle_sheet import VehicleSheet


def casadi_text(sheet: VehicleSheet, _held: Held, told: Sequence[str], file: str) -> str:
    """Write a vehicle as a module of functions for CasADi; parameters as those of the other targets."""
    return _functions(sheet, told, file, jax=False)


def jax_text(sheet: VehicleSheet, _held: Held, told: Sequence[str], file: str) -> str:
    """Write a vehicle as a module of functions for JAX; parameters as those of the other targets."""
    return _functions(sheet, told, file, jax=True)


def whole(model: VehicleModel) -> tuple[Held, Holds]:
    """Take what functions hold of a vehicle, which is everything that is a sum of weights."""
    return Held.whole(model), lambda weights: weights


def _functions(sheet: VehicleSheet, told: Sequence[str], file: str, *, jax: bool) -> str:
    model, weights = sheet.model, sheet.weights
    words = common_words(sheet)
    fuzzy = model.fuzzy
    assert fuzzy is None or isinstance(fuzzy, Model), "a whole vehicle is that of an identified model, or rigid"
    rules = np.zeros(0) if fuzzy is None or not fuzzy.coefficients.any() else fuzzy.coefficients
    inertia = six_parameters(model.vehicle.inertia_kg_m2) if fuzzy is None else fuzzy.rigid_body
    first = [model.body.mass, model.body.gravity, *inertia.tolist(), float(words["lag"]), float(words["slow"])]
    words |= {"momentum": fuzzy is not None, "fuzzy": len(rules) > 0, "rule_count": len(rules)}
    words |= _rule_words(fuzzy) if fuzzy and len(rules) else {}
    words |= {
        "jax": jax,
        "source": comment_text(file),
        "facts": comment_lines(told),
        "row_rows": _whole(weights.row),
        "term_rows": _whole(weights.term),
        "rotor_rows": _whole(weights.rotor),
        "parameter_rows": filled(", ".join(map(number, [*first, *weights.weight.tolist(), *rules.tolist()])), 4),
        "factor_rows": filled(", ".join(f"[{first}, {second}]" for first, second in FACTORS.tolist()), 4),
        "peak_rows": [] if sheet.remainder is None else sheet.remainder.breakpoints.tolist(),
    }
    return fill_template("functions.py.j2", words)


def _rule_words(fuzzy: Model) -> dict[str, Any]:
    structure, settings = fuzzy.structure, fuzzy.structure.settings
    pairs = zip(structure.partitions, fuzzy.partitions, strict=True)
    return {
        "rule_peaks": {partition.name: peaks.tolist() for partition, peaks in pairs},
        "ranges": [[float(each.minimum), float(each.width)] for each in fuzzy.ranges],
        "circular": structure.circular,
        "data_range": settings.input_map == "data-range",
        "harmonic": settings.consequents == "harmonic",
        "tensor": settings.products == "tensor",
        "rule_order": settings.harmonic_order,
    }


def _whole(values: IntArray) -> str:
    return filled(", ".join(map(str, values.tolist())), 4)


def _executed(text: str) -> dict[str, Any]:
    module: dict[str, Any] = {"__name__": "exported"}
    exec(compile(text, "exported", "exec"), module)
    return module


def fly_casadi(text: str, course: Course) -> State:
    """Fly an exported vehicle in CasADi.

    Parameters
    ----------
    text : str
        Of the module.

    Returns
    -------
    State
        At the samples behind each start, shape (run, horizon, ...).
    """
    module, flight = _executed(text), course.flight
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
    """Fly an exported vehicle in JAX; parameters and result as `fly_casadi`."""
    import jax

    with jax.enable_x64(True):
        module, flight = _executed(text), course.flight
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
