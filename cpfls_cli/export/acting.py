"""What acts on a model, part by part: evaluated along motions, and traced with its numbers by name."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from copy import copy
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.inertia import INERTIA_PARAMETERS, six_parameters
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.vehicle.motion import Acting, Instant, about_centre
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.vehicle.tracing import SYMBOLS, Graph, Language, Symbol, used, written
from cpfls_cli.vehicle.values import ARRAYS, ZERO, Each, Functions, Value, Vector, add, scaled, zero

LEARNED = "learned[{}]"
"""Name of a coefficient of the learned part."""
_OF_ROTORS = {"linear": "rad/s", "slow_roll_pitch": "1", "slow_yaw": "1"}
_FACTORS = {"thrust_factor": ("thrust_factor_n_s2", "N s^2"), "drag_factor": ("drag_factor_n_m_s2", "N m s^2")}


def parts_of(
    acting: Iterable[Acting], vehicle: VehicleSettings, motion: Sequence[Value], functions: Functions = SYMBOLS
) -> Iterator[tuple[str, Vector]]:
    """Give torque and force of each part, six components, those with levers for the forces of the others last.

    `motion`: vectors of air velocity and body rate, then of the rotors speeds, accelerations and slow squared speeds.
    """
    air, rate, speed, turning, slow = motion
    seen = Instant(vehicle, speed, air, rate, turning, slow_square=slow, functions=functions)
    # The momentum of rotors changes with their accelerations.
    spun = Instant(vehicle, turning, functions=functions)
    force = ZERO
    for one in sorted(acting, key=lambda each: each.of_all_forces):
        felt = replace(seen, force=force) if one.of_all_forces else seen
        wrench = one.wrench(felt)
        torque, push = about_centre(felt, wrench)
        if not all(map(zero, wrench.momentum)):
            torque = add(torque, one.wrench(spun).momentum)
        force = add(force, push)
        yield one.name, (*torque, *push)


def parts_along(model: VehicleModel, air: Array, rate: Array, rotor: Array) -> dict[str, Array]:
    """Evaluate each part along a motion, shape (time, 6), N m and N, body frame.

    Air velocity and rate are in m/s and rad/s, body frame; rotors as of `RotorResponse.terms_by_step`.
    """
    speed, square, turning, slow = rotor[:, 1:].T.reshape(4, model.rotors, -1)
    motion = (tuple(air.T), tuple(rate.T), speed, turning, slow + square)
    return {
        name: np.stack([np.broadcast_to(np.asarray(x, dtype=float), len(air)) for x in wrench], axis=1)
        for name, wrench in parts_of(model.parts, model.vehicle, motion, ARRAYS)
    }


def wrench_along(model: VehicleModel, air: Array, rate: Array, rotor: Array) -> Array:
    """Evaluate torque and force along a motion, shape (time, 6), N m and N, body frame; see `parts_along`."""
    return np.asarray(sum(parts_along(model, air, rate, rotor).values()), dtype=float)


def numbers_of(model: VehicleModel) -> dict[str, float]:
    """Give the numbers of all that acts by name: of rotors, of effects, coefficients of the learned part."""
    found = {
        f"rotor_{place}_{name}": float(getattr(rotor, field))
        for place, rotor in enumerate(model.vehicle.rotors, 1)
        for name, (field, _) in _FACTORS.items()
    }
    found |= {f"{one.name}_{name}": float(value) for one in model.parts for name, value in one.numbers.items()}
    learned = () if model.remainder is None else np.ravel(model.remainder.coefficients).tolist()
    return found | {LEARNED.format(place): value for place, value in enumerate(learned)}


def units_of(model: VehicleModel) -> dict[str, str]:
    """Give the units of numbers by name."""
    units = {"mass": "kg", "gravity": "m/s^2"} | dict.fromkeys(INERTIA_PARAMETERS, "kg m^2")
    units |= {f"rotors_{name}": unit for name, unit in _OF_ROTORS.items()}
    for place in range(1, model.rotors + 1):
        units |= {f"rotor_{place}_{name}": unit for name, (_, unit) in _FACTORS.items()}
    for one in model.effects:
        units |= {f"{one.name}_{each.name}": each.unit for each in one.known.coefficients}
        units |= {f"{one.name}_{each.name}": each.unit for each in one.known.shapes}
    return units


class Traced(NamedTuple):
    """Torque and force of a model by symbols, six components in the body frame, and where each part begins."""

    graph: Graph
    wrench: Vector
    parts: dict[int, str]

    @property
    def used(self) -> set[str]:
        """Names of what it needs."""
        return used(self.graph, self.wrench)

    def written(self, language: Language) -> tuple[list[str], list[str]]:
        """Write lines, and what they make of torque and force."""
        return written(self.graph, self.wrench, language, self.parts)


def traced_wrench(model: VehicleModel, *, shares: bool = False) -> Traced:
    """Trace torque and force with numbers by name; those that are 0 are left out.

    `shares`: whether each part is multiplied with a number, see `share_of`.
    """
    graph, values = Graph(), numbers_of(model)

    def named(name: str) -> Symbol:
        return graph.node("input", name)

    def number(name: str) -> Value:
        return named(name) if values[name] else 0

    air, rate = (tuple(named(f"{name}[{axis}]") for axis in range(3)) for name in ("air", "rate"))
    count = model.rotors
    speed, square, turning, slow = (
        tuple(named(f"rotor[{1 + kind * count + rotor}]") for rotor in range(count)) for kind in range(4)
    )
    risen = [late + squared for late, squared in zip(slow, square, strict=True)]
    for one, squared, late, whole in zip(speed, square, slow, risen, strict=True):
        graph.given(squared, "*", one.place, one.place)
        graph.given(late, "-", whole.place, squared.place)
    motion = (air, rate, Each(speed), Each(turning), Each(risen))
    if model.remainder is not None:
        shape = model.remainder.coefficients.shape
        learned = [named(LEARNED.format(place)) for place in range(model.remainder.coefficients.size)]
        symbols = np.array(learned, dtype=object).reshape(shape)
        model = replace(model, remainder=replace(model.remainder, coefficients=symbols))
    acting = [replace(one, numbers={name: number(f"{one.name}_{name}") for name in one.numbers}) for one in model.parts]
    total: Vector = (0,) * 6
    places = {len(graph.nodes): "rotors"}
    for name, wrench in parts_of(acting, _by_name(model.vehicle, named), motion):
        total = add(total, scaled(named(share_of(name)), wrench) if shares else wrench)
        begun = next(reversed(places))
        places[begun] = name
        places[len(graph.nodes)] = ""
    return Traced(graph, total, places)


def share_of(part: str) -> str:
    """Name the number that a part is multiplied with."""
    return f"share_of_{part}"


def _by_name(vehicle: VehicleSettings, named: Callable[[str], Symbol]) -> VehicleSettings:
    """Put symbols in the place of numbers that differ between vehicles of a kind."""
    made = copy(vehicle)
    rotors = []
    for place, rotor in enumerate(vehicle.rotors, 1):
        own = copy(rotor)
        for name, (field, _) in _FACTORS.items():
            object.__setattr__(own, field, named(f"rotor_{place}_{name}"))
        rotors.append(own)
    inertia = zip(INERTIA_PARAMETERS, six_parameters(vehicle.inertia_kg_m2), strict=True)
    changed = {
        "rotors": tuple(rotors),
        "mass_kg": named("mass"),
        "gravity_m_s2": named("gravity"),
        "inertia_kg_m2": tuple(named(name) if value else 0 for name, value in inertia),
    }
    for name, value in changed.items():
        object.__setattr__(made, name, value)
    return made
