"""Everything about a model that goes into an export: the vehicle, where it comes from, what it is good for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.gate import Origin
from cpfls_cli.config.load import parse_config
from cpfls_cli.dynamics import InertiaFunctions
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.export.holding import Missing, identified_of
from cpfls_cli.export.points import (
    Expected,
    ReferencePoints,
    ReferenceRun,
    Traced,
    attitude_points,
    numbers_of,
    reference_points,
    runs_of,
)
from cpfls_cli.gap.balance.weak_flight import CHANNELS
from cpfls_cli.inertia import INERTIA_PARAMETERS, six_parameters
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.regressor.structure import Block, ModelStructure
from cpfls_cli.version import __version__

EXPORTER = __version__
"""Version of the program that exports."""

DO_NOT_USE = "DO NOT USE: this is the verdict on the model, which was exported nevertheless."

GUST_RECIPE = (
    "Torque and force of gusts act on the body in addition to those of the model, about and along its axes. Each is x, "
    "at first size * n, and after every step h: x = k x + size sqrt(1 - k^2) n, k = exp(-h / memory), n a new normal "
    "number; to x the white part adds white / sqrt(h) times another n in every step."
)
"""How to play gusts, which no equation of an export holds."""

LACK_RECIPE = (
    "What the model lacks is repeatable, and as large as shares of its parts: torque or force on each axis is x times "
    "the root of rest^2 + the sum of (share * what that part of the model gives there now)^2, of a body that does not "
    "turn and rotors that turn alike, at the root mean square of their speeds, with x as of a gust of size 1 and this "
    "memory."
)
"""How to play what a model lacks."""

_SEED = 1
REFITTED = "refitted numbers of the vehicle"


@dataclass(frozen=True)
class Sheet:
    """A model, ready to be written in any form, in still air.

    `name`: prefix of all names in source code; `usage`: paragraphs that say what it is good for; `verdict`: in a word;
    `stopped`: why its search did not come to its end; `evidence`: what it was judged by, for JSON; `outside`: effects
    of the artifact that are no sums of weights; `wind` of the flights that it was made with, m/s, world frame, and
    their noise `floor`, N m and N, NaN where unknown; `warnings`: what speaks against using it, on the screen alone;
    `cautions`: at the top of every file; `impossible`: its numbers that no such vehicle has, in the first line of every
    file.
    """

    name: str
    model: VehicleModel
    usage: tuple[str, ...]
    origin: Origin
    file: str
    sha256: str
    verdict: str | None = None
    stopped: str | None = None
    evidence: Mapping[str, Any] = field(default_factory=dict)
    outside: tuple[Missing, ...] = ()
    wind: tuple[float, float, float] = (0.0, 0.0, 0.0)
    floor: tuple[float, ...] = (np.nan,) * 6
    warnings: tuple[str, ...] = ()
    cautions: tuple[str, ...] = ()
    impossible: str = ""

    @property
    def identified(self) -> InertiaFunctions | None:
        """The identified model that its inertia over attitude is that of; None for a constant inertia."""
        return identified_of(self.model)

    @property
    def rigid_body(self) -> Array:
        """Inertia of the rigid body, under the fuzzy part where there is one, shape (6,), kg m^2."""
        found = self.identified
        return six_parameters(self.model.vehicle.inertia_kg_m2) if found is None else found.rigid_body

    @property
    def rules(self) -> InertiaFunctions | None:
        """The identified model where its fuzzy part does anything, or is all there is."""
        found = self.identified
        return found if found and (found.coefficients.any() or not found.rigid_body.any()) else None

    @property
    def complete(self) -> bool:
        """Whether the search for it came to its end."""
        return self.stopped is None

    @cached_property
    def numbers(self) -> dict[str, float]:
        """Numbers of all that acts that are not 0, by name."""
        return {name: value for name, value in numbers_of(self.model).items() if value}

    def needed(self, traced: Traced) -> dict[str, float]:
        """Give the numbers that torque and force need, by name, but for the learned part."""
        used, vehicle = traced.used, self.model.vehicle
        known = {"mass": vehicle.mass_kg, "gravity": vehicle.gravity_m_s2}
        known |= dict(zip(INERTIA_PARAMETERS, self.rigid_body.tolist(), strict=True)) | self.numbers
        return {name: value for name, value in known.items() if name in used and "[" not in name}

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

    @cached_property
    def references(self) -> tuple[ReferencePoints, tuple[ReferenceRun, ...], Expected | None]:
        """What the library computes, for an export to test itself: torque and force, runs, and torque over attitude."""
        rng, found = np.random.default_rng(_SEED), self.identified
        attitudes = None if found is None else attitude_points(found, np.random.default_rng(_SEED))
        return reference_points(self.model, rng), runs_of(self.model, rng), attitudes

    @property
    def facts(self) -> list[str]:
        """Paragraphs that say what the model is, what it is good for and where it comes from."""
        return [*self.remarks, "", *self._origin()]

    def said(self, remarks: Sequence[str], use: Sequence[str] = ()) -> list[str]:
        """Give the paragraphs with which a file begins: facts, what it does not hold, how it is used."""
        return [*self.facts, "", *remarks, *(["", *use] if use else [])]

    @property
    def remarks(self) -> list[str]:
        """What must not be overlooked, what the model is and what it is good for."""
        return [*self._marks(), *self.cautions, *self._structure(), *self.usage]

    def _marks(self) -> Iterator[str]:
        if self.impossible:
            yield f"IMPOSSIBLE NUMBERS, which no such vehicle has: {self.impossible}."
        if self.stopped is not None:
            why = f" ({self.stopped})" if self.stopped else ""
            yield f"INCOMPLETE MODEL: its search did not run to the end{why}. Do not fly with it."
        if self.verdict == "do-not-use":
            yield DO_NOT_USE

    def _structure(self) -> Iterator[str]:
        model, response = self.model, self.model.response
        yield (
            f"Vehicle: {model.vehicle.mass_kg:.6g} kg, {model.rotors} rotors; delay {response.delay_s:.4g} s, "
            f"lag {response.lag_s:.4g} s, slow actuation {response.slow_roll_pitch:.4g} (roll, pitch) and "
            f"{response.slow_yaw:.4g} (yaw) within {response.slow_s:.4g} s; "
            + "".join(f"{one.coefficients[0]:.4g} of the thrust in hover linear; " for one in model.thrust_curve)
            + f"{len(self.numbers)} numbers of torque and force."
        )
        if model.effects:
            known = [CATALOGUE[effect.name] for effect in model.effects]
            # What corrects the numbers of the vehicle is refitted with every effect, whether or not they were wrong.
            titles = [REFITTED if each.kind == "parameter" else each.title for each in known]
            yield f"Effects: {', '.join(dict.fromkeys(titles))}."
        if model.remainder is not None:
            rows = ", ".join(CHANNELS[row] for row in model.remainder.rows)
            yield f"Learned, without a name: {rows} over the direction of the airflow."
        if model.gusts is not None:
            size, memory, white = (", ".join(f"{value:.4g}" for value in values) for values in model.gusts)
            yield (
                f"Gusts of its flights, not played here, {', '.join(CHANNELS)}: standard deviations {size} (N m, N); "
                f"memories {memory} s; white {white} (N m s^0.5, N s^0.5). {GUST_RECIPE}"
            )
        if self.identified is not None:
            yield _inertia_in_words(self.identified, fuzzy=self.rules is not None)

    def _origin(self) -> Iterator[str]:
        header = self.origin
        yield f"Model: {self.file}, sha256 {self.sha256}"
        yield f"Made by cpfls {header.version}, seed {header.seed}; exported by cpfls {EXPORTER}"
        for role, source in header.inputs.items():
            yield f"From {role}: {source.name}, sha256 {source.sha256}"


def _inertia_in_words(model: InertiaFunctions, *, fuzzy: bool) -> str:
    settings, structure = model.structure.settings, model.structure
    order = f" of order {settings.harmonic_order}" if settings.consequents == "harmonic" else ""
    functions = ", ".join(f"{partition.name} {partition.functions}" for partition in structure.partitions)
    off = "" if fuzzy else " The fuzzy part is off: this is a rigid body."
    return (
        f"Inertia over attitude: {settings.structure}, {settings.input_map} inputs, {settings.consequents} "
        f"consequents{order}, {settings.products} products; membership functions {functions}; {structure.parameters} "
        f"coefficients; base {base_of(model)}.{off} Training visited {float(np.mean(model.visited)):.1%} of the circle "
        "of roll and pitch."
    )


def base_of(model: InertiaFunctions) -> str:
    """Tell what lies under the fuzzy part: ``rigid-body`` or ``none``."""
    return "rigid-body" if model.rigid_body.any() else "none"


def rule_labels(block: Block, structure: ModelStructure) -> list[str]:
    """Name the rules of an inertia function by their places along its inputs."""
    names = [("roll", "pitch")[angle] for angle in block.function.inputs]
    last = structure.partitions[block.partitions[-1]].rules(circular=structure.circular)
    if len(names) == 1:
        return [f"{names[0]} {rule}" for rule in range(block.rules)]
    return [f"{names[0]} {rule // last}, {names[1]} {rule % last}" for rule in range(block.rules)]
