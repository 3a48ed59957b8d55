"""States with what acts on the vehicle there, which an export carries to test itself."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from copy import copy
from dataclasses import dataclass, replace
from math import ceil
from typing import NamedTuple

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.dynamics import CELLS, InertiaFunctions, body_inertia, body_torque, coriolis_matrix
from cpfls_cli.effects.scales import arm, hover_speed
from cpfls_cli.inertia import INERTIA_PARAMETERS, six_parameters, symmetric
from cpfls_cli.playback.flight import State
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.playback.player import one_step
from cpfls_cli.playback.rotors import Hold
from cpfls_cli.regressor.regressor import InertiaValues, Motion, Regressor
from cpfls_cli.vehicle.motion import Acting, Instant, about_centre
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.vehicle.tracing import SYMBOLS, Graph, Language, Symbol, used, written
from cpfls_cli.vehicle.values import ARRAYS, ZERO, Each, Functions, Value, Vector, add, scaled, zero

LEARNED = "learned[{}]"
"""Name of a coefficient of the learned part."""
_OF_ROTORS = {"slow_roll_pitch": "1", "slow_yaw": "1"}
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


POINTS = 8
"""States at which an export is compared with the library."""

PERIOD = 0.01
"""Length of the steps of the runs that an export tests itself with, s."""

_TORQUE, _FORCE = slice(0, 3), slice(3, 6)
# Rates in rad/s and accelerations in rad/s^2 of a lively flight; |cos(pitch)| from which on single precision agrees.
_RATE, _ACCELERATION, _UPRIGHT = 3.0, 10.0, 0.2
# Steps behind the delay, share that speeds differ from hover by, and seconds in which they change by their own size.
_STEPS, _SPREAD, _SECOND = 12, 0.2, 1.0


@dataclass(frozen=True)
class Expected:
    """What a model gives along a motion.

    `scale`: sizes of the terms that D, C, torque and body torque are sums of, which their rounding errors are relative
    to, shape (samples, 4).
    """

    motion: Motion
    inertia: Array
    coriolis: Array
    torque: Array
    body: Array
    inside: BoolArray
    scale: Array

    def __len__(self) -> int:
        """Count the samples."""
        return len(self.motion)


def expected(model: InertiaFunctions, motion: Motion) -> Expected:
    """Compute what an export has to give along a motion; the rigid body's torque is about body axes, always finite."""
    q, qd, qdd = motion.attitude, motion.rate, motion.acceleration
    inertia = model.inertia(q)
    fuzzy = Regressor(model.structure, motion, model.ranges).torque(model.partitions, model.coefficients)
    rigid = body_torque(q, qd, qdd, symmetric(model.rigid_body))
    return Expected(
        motion,
        inertia.value,
        coriolis_matrix(inertia, qd),
        model.torque(motion),
        rigid + rotations.body_torque(q, fuzzy),
        ~model.outside(q),
        _scale(inertia, motion, bool(fuzzy.any())),
    )


def _scale(inertia: InertiaValues, motion: Motion, fuzzy: bool) -> Array:
    samples = len(motion)
    size, slope = (np.abs(a).reshape(samples, -1).max(axis=1) for a in (inertia.value, inertia.gradient))
    speed, push = (np.abs(a).max(axis=1) for a in (motion.rate, motion.acceleration))
    torque = size * push + slope * speed**2
    upright = np.abs(np.cos(motion.attitude[:, 1])) if fuzzy else np.ones(samples)
    scale = np.column_stack([size, slope * speed, torque, torque / upright])
    return np.where(scale > 0.0, scale, 1.0)


def attitude_points(model: InertiaFunctions, rng: np.random.Generator) -> Expected:
    """Draw a few states, half of them where training went, and compute what the model gives there.

    They lie in the middle of cells, away from a vertical pitch, so that single precision agrees as well.
    """
    centres = (np.arange(CELLS) + 0.5) * (2.0 * np.pi / CELLS) - np.pi
    upright = np.abs(np.cos(centres)) > _UPRIGHT
    cells = list(_cells(model.visited & upright, rng)) + list(_cells(np.broadcast_to(upright, (CELLS, CELLS)), rng))
    places = np.array(cells[-POINTS:])
    attitude = np.column_stack([centres[places], rng.uniform(-np.pi, np.pi, POINTS)])
    attitude[0, :2] += 2.0 * np.pi
    rate = rng.uniform(-_RATE, _RATE, (POINTS, 3))
    return expected(model, Motion(attitude, rate, rng.uniform(-_ACCELERATION, _ACCELERATION, (POINTS, 3))))


def _cells(allowed: BoolArray, rng: np.random.Generator) -> Iterator[tuple[int, int]]:
    places = np.argwhere(allowed)
    for index in rng.permutation(len(places))[:POINTS]:
        yield int(places[index, 0]), int(places[index, 1])


class ReferencePoints(NamedTuple):
    """States, what the model gives there, and the sizes of the terms that it is a sum of."""

    air: Array
    rate: Array
    rotor: Array
    wrench: Array
    scale: Array


class ReferenceRun(NamedTuple):
    """A run along logged rotor speeds, rad/s, step by step.

    `rotor`: terms of the rotors over each step, shape (step, 1 + 4 rotors); `states`: before the first step and after
    each; `condition`: largest condition number of an inertia over attitude on the way, which magnifies rounding, 1 for
    a constant one.
    """

    hold: Hold
    speed: Array
    rotor: Array
    states: State
    condition: float = 1.0

    @property
    def scale(self) -> Array:
        """Sizes of position, velocity, rotation and rate that errors compare with, shape (4,), at least that of 1."""
        return self.condition * np.array([max(float(np.abs(part).max()), 1.0) for part in self.states])

    @property
    def rotor_scale(self) -> Array:
        """Sizes of the terms of the rotors: 1, speeds, squares, accelerations, slowness; shape (5,)."""
        fastest = float(self.speed.max())
        return np.array([1.0, fastest, fastest**2, fastest / PERIOD, fastest**2])


def reference_points(model: VehicleModel, rng: np.random.Generator, count: int = POINTS) -> ReferencePoints:
    """Draw states, and compute what the model gives there."""
    air, rate = rng.normal(0.0, 3.0, (2, count, 3))
    speed = _speeds(model, rng, count)
    turning = rng.normal(0.0, speed.mean() / _SECOND, speed.shape)
    slow = _speeds(model, rng, count) ** 2 - speed**2
    rotor = np.hstack([np.ones((count, 1)), speed, speed**2, turning, slow])
    parts = parts_along(model, air, rate, rotor).values()
    return ReferencePoints(air, rate, rotor, np.asarray(sum(parts)), part_sizes(model, parts))


def part_sizes(model: VehicleModel, parts: Collection[Array]) -> Array:
    """Sum the sizes of parts, shape (samples, 6), which rounding errors of torque and force are relative to.

    Forces of rotors cancel in a torque, so that its size is also that of the forces at the end of the arm.
    """
    torque, force = (np.asarray(sum(np.abs(part[:, own]).max(axis=1) for part in parts)) for own in (_TORQUE, _FORCE))
    sizes = np.repeat(np.stack([torque + arm(model.vehicle) * force, force], axis=1), 3, axis=1)
    return np.where(sizes > 0.0, sizes, 1.0)


def reference_run(model: VehicleModel, rng: np.random.Generator, hold: Hold, steps: int = _STEPS) -> ReferenceRun:
    """Fly along rotor speeds at random, beginning from some state, until long after the delay."""
    steps += ceil(model.response.delay_s / PERIOD)
    speed = _speeds(model, rng, steps + 1)
    rotor = model.response.terms_by_step(speed, PERIOD, hold)[:-1]
    place, velocity, rate, attitude = rng.uniform(-1.0, 1.0, (4, 1, 3))
    path = [State(place, velocity, rotations.rotation_matrix(attitude), rate)]
    for row in rotor:
        path.append(one_step(model, path[-1], row[None], PERIOD))
    states = State(*(np.concatenate(parts) for parts in zip(*path, strict=True)))
    if model.fuzzy is None or not np.isfinite(states.rate).all():
        return ReferenceRun(hold, speed, rotor, states)
    _, tensors = body_inertia(model.fuzzy, rotations.euler_angles(states.rotation))
    return ReferenceRun(hold, speed, rotor, states, float(np.linalg.cond(tensors).max()))


def runs_of(model: VehicleModel, rng: np.random.Generator) -> tuple[ReferenceRun, ...]:
    """Fly twice; without the runs in which the inertia over attitude becomes that of no body."""
    runs = (reference_run(model, rng, "linear"), reference_run(model, rng, "previous"))
    return tuple(run for run in runs if np.isfinite(run.states.rate).all())


def _speeds(model: VehicleModel, rng: np.random.Generator, count: int) -> Array:
    around = rng.uniform(1.0 - _SPREAD, 1.0 + _SPREAD, (count, model.rotors))
    return np.asarray(hover_speed(model.vehicle) * around)
