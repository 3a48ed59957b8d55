"""Everything about a whole vehicle that goes into an export: its table of weights, words, and runs to test it with."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from math import ceil
from typing import Any, NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.artifacts.spec import Header
from cpfls_cli.config.load import parse_config
from cpfls_cli.effects.polynomial import STATE_TERMS, state_terms
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.effects.scales import hover_speed
from cpfls_cli.export.holding import Missing
from cpfls_cli.export.sheet import EXPORTER
from cpfls_cli.playback.model import Remainder, VehicleModel, remainder_terms
from cpfls_cli.playback.motion import State, step
from cpfls_cli.playback.rotors import Hold
from cpfls_cli.rotations import rotation_matrix

POINTS = 8
"""States at which an export is compared with the library."""

_STEPS = 12
PERIOD = 0.01
"""Length of the steps of the runs that an export tests itself with, s."""
_SPREAD = 0.2
_SECOND = 1.0
_ROWS = ("torque x", "torque y", "torque z", "force x", "force y", "force z")


class Weights(NamedTuple):
    """The weights that are not zero: entry by entry its row, its term of the motion, its term of the rotors.

    Attributes
    ----------
    row, term, rotor : array of int, shape (entry,)
        Row 0 to 2 of torque, 3 to 5 of force.
    weight : array, shape (entry,), SI
    """

    row: IntArray
    term: IntArray
    rotor: IntArray
    weight: Array

    def __len__(self) -> int:
        return len(self.weight)


class ReferencePoints(NamedTuple):
    """States, what the model gives there, and the sizes of the terms that it is a sum of.

    Attributes
    ----------
    air, rate : array, shape (point, 3)
    rotor : array, shape (point, 1 + 4 rotors)
    wrench, scale : array, shape (point, 6)
    """

    air: Array
    rate: Array
    rotor: Array
    wrench: Array
    scale: Array


class ReferenceRun(NamedTuple):
    """A run along logged rotor speeds, step by step.

    Attributes
    ----------
    hold : {"linear", "previous"}
    speed : array, shape (step + 1, rotor), rad/s
    rotor : array, shape (step, 1 + 4 rotors)
        Terms of the rotors over each step.
    states : State
        Before the first step and after each.
    """

    hold: Hold
    speed: Array
    rotor: Array
    states: State

    @property
    def scale(self) -> Array:
        """Sizes of position, velocity, rotation and rate that errors compare with, shape (4,), at least that of 1."""
        return np.array([max(float(np.abs(part).max()), 1.0) for part in self.states])

    @property
    def rotor_scale(self) -> Array:
        """Sizes of the terms of the rotors: 1, speeds, squares, accelerations, slowness; shape (5,)."""
        fastest = float(self.speed.max())
        return np.array([1.0, fastest, fastest**2, fastest / PERIOD, fastest**2])


@dataclass(frozen=True)
class VehicleSheet:
    """A whole vehicle, ready to be written in any form.

    Attributes
    ----------
    name : str
        Prefix of all names in source code, an identifier.
    model : VehicleModel
        Of constant inertia.
    worth : tuple of str
        Paragraphs that say what it is worth.
    origin : Header
        Of the artifact that it was read from.
    file, sha256 : str
        Name, without its folder, and hash of the artifact.
    outside : tuple of Missing
        Parts of the artifact that the model does not hold: effects that are no sums of weights.
    wind : tuple of float, m/s, world frame
        Of the flights that it was made with; the model is in still air.
    floor : tuple of float, length 6, N m and N
        Noise floors of the flights that it was made with; NaN where unknown.
    mark : str
        What must not be overlooked; empty for nothing.
    """

    name: str
    model: VehicleModel
    worth: tuple[str, ...]
    origin: Header
    file: str
    sha256: str
    outside: tuple[Missing, ...] = ()
    wind: tuple[float, float, float] = (0.0, 0.0, 0.0)
    floor: tuple[float, ...] = (np.nan,) * 6
    mark: str = ""

    @cached_property
    def weights(self) -> Weights:
        """The weights that are not zero."""
        row, term, rotor = (places.astype(np.int64) for places in np.nonzero(self.model.weights))
        return Weights(row, term, rotor, self.model.weights[row, term, rotor])

    @property
    def remainder(self) -> Remainder | None:
        """The learned part."""
        return self.model.remainder

    @property
    def terms(self) -> list[str]:
        """Names of the terms of the motion."""
        columns = range((self.model.term_count - len(STATE_TERMS)) // 2)
        return [*STATE_TERMS, *(f"{name} c{column}" for column in columns for name in ("U", "U^2"))]

    @property
    def rotor_terms(self) -> list[str]:
        """Names of the terms of the rotors."""
        numbers = range(1, self.model.rotors + 1)
        return [
            "1",
            *(form.format(number) for form in ("w{0}", "w{0}^2", "w{0}'", "z{0} - w{0}^2") for number in numbers),
        ]

    @property
    def config(self) -> Mapping[str, Any]:
        """The resolved study."""
        return parse_config(self.origin.config, f"{self.file}: /config")

    @property
    def facts(self) -> list[str]:
        """Paragraphs that say what the model is, what it is worth and where it comes from."""
        return [*self.told, "", *self._origin()]

    @property
    def told(self) -> list[str]:
        """What it is and what it is worth."""
        return [*([self.mark] if self.mark else []), *self._structure(), *self.worth]

    def _structure(self) -> Iterator[str]:
        model, response = self.model, self.model.response
        yield (
            f"Vehicle: {model.vehicle.mass_kg:.6g} kg, {model.rotors} rotors; delay {response.delay_s:.4g} s, "
            f"lag {response.lag_s:.4g} s, slow actuation {response.slow_roll_pitch:.4g} (roll, pitch) and "
            f"{response.slow_yaw:.4g} (yaw) within {response.slow_s:.4g} s; law of the rotors w^2 + "
            f"{model.thrust_linear:.4g} w_hover w; {len(self.weights)} weights."
        )
        if model.effects:
            yield f"Effects: {', '.join(CATALOGUE[effect.name].title for effect in model.effects)}."
        if self.remainder is not None:
            rows = ", ".join(_ROWS[row] for row in self.remainder.rows)
            yield f"Learned, without a name: {rows} over the direction of the airflow."

    def _origin(self) -> Iterator[str]:
        header = self.origin
        yield f"Model: {self.file}, sha256 {self.sha256}"
        yield f"Made by cpfls {header.version}, seed {header.seed}; exported by cpfls {EXPORTER}"
        for role, source in header.inputs.items():
            yield f"From {role}: {source.name}, sha256 {source.sha256}"


def reference_points(model: VehicleModel, rng: np.random.Generator, count: int = POINTS) -> ReferencePoints:
    """Draw states, and compute what the model gives there."""
    air, rate = rng.normal(0.0, 3.0, (2, count, 3))
    speed = _speeds(model, rng, count)
    turning = rng.normal(0.0, speed.mean() / _SECOND, speed.shape)
    slow = _speeds(model, rng, count) ** 2 - speed**2
    rotor = np.hstack([np.ones((count, 1)), speed, speed**2, turning, slow])
    return ReferencePoints(air, rate, rotor, model.wrench(air, rate, rotor), term_sizes(model, air, rate, rotor))


def term_sizes(model: VehicleModel, air: Array, rate: Array, rotor: Array) -> Array:
    """Sum the sizes of the terms of torque and force, which their rounding errors are relative to.

    Parameters
    ----------
    air, rate : array, shape (samples, 3), m/s and rad/s, body frame
    rotor : array, shape (samples, 1 + 4 rotors)

    Returns
    -------
    array, shape (samples, 6)
        Above zero.
    """
    terms = np.abs(np.hstack([state_terms(air, rate), remainder_terms(model.remainder, air)]))
    sizes = np.einsum("ta,kau,tu->tk", terms, np.abs(model.weights), np.abs(rotor), optimize=True)
    return np.where(sizes > 0.0, sizes, 1.0)


def reference_run(model: VehicleModel, rng: np.random.Generator, hold: Hold, steps: int = _STEPS) -> ReferenceRun:
    """Fly along rotor speeds at random, beginning from some state, until long after the delay."""
    steps += ceil(model.response.delay_s / PERIOD)
    speed = _speeds(model, rng, steps + 1)
    rotor = model.rotor_terms(speed, PERIOD, hold)[:-1]
    place, velocity, rate, attitude = rng.uniform(-1.0, 1.0, (4, 1, 3))
    start = State(place, velocity, rotation_matrix(attitude), rate)
    path = [start]
    for row in rotor:
        path.append(step(model, path[-1], row[None], PERIOD))
    return ReferenceRun(hold, speed, rotor, State(*(np.concatenate(parts) for parts in zip(*path, strict=True))))


def _speeds(model: VehicleModel, rng: np.random.Generator, count: int) -> Array:
    around = rng.uniform(1.0 - _SPREAD, 1.0 + _SPREAD, (count, model.rotors))
    return np.asarray(hover_speed(model.vehicle) * around)
