"""Settings of the identification: structure, search, its presets, base, validation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Annotated, Final, Literal

from annotated_types import Ge, Gt, Le
from typing_extensions import Doc

from cpfls_cli.errors import SettingError
from cpfls_cli.evolution.settings import EvolutionSettings
from cpfls_cli.regressor.structure import StructureSettings
from cpfls_cli.settings import Settings

Preset = Literal["fast", "paper"]

# Every key of the search is named, so that the paper's search stays what it is when defaults change.
_PAPER: Final = MappingProxyType(
    {
        "population": 75,
        "generations": 25,
        "subpopulations": 5,
        "migration_rate": 0.2,
        "migration_interval": 5,
        "generation_gap": 0.8,
        "crossover_rate": 0.8,
        "recombination": "single-point",
        "insertion_rate": 0.8,
        "selective_pressure": 1.5,
        "mutated_individuals": 0.04,
        "mutated_bits": 0.01,
        "ranking": "quantity-dominance",
        "first_objective_weight": 1,
        "reinsertion": "uniform",
        "stall_generations": None,
        "start": "random",
    }
)

PRESETS: Final[Mapping[Preset, Mapping[str, int | float | str | None]]] = MappingProxyType(
    {"fast": MappingProxyType({}), "paper": _PAPER}
)
"""By name; what a preset leaves out has the default of its key."""


Base = Literal["none", "rigid-body"]
JudgedOn = Literal["training", "learned"]
Choice = Literal["mse-below-median-condition", "mse", "max-error", "held-out"]


@dataclass(frozen=True, kw_only=True)
class RidgeSettings(Settings):
    """How the ridge weight of the fuzzy part is chosen (base: rigid-body)."""

    folds: Annotated[int, Ge(2), Le(20), Doc("contiguous blocks of the cross-validation")] = 5
    embargo_s: Annotated[float, Ge(0), Doc("time left out on both sides of a block, for the memory of filters")] = 0.1
    smallest: Annotated[float, Gt(0), Doc("smallest weight tried, per row of the scaled regressor")] = 1e-6
    largest: Annotated[float, Gt(0), Doc("largest weight tried below 'fuzzy part off'")] = 1e2
    count: Annotated[int, Ge(2), Le(200), Doc("number of weights tried")] = 17

    def __post_init__(self) -> None:
        """Refuse weights that do not ascend."""
        if not self.smallest < self.largest:
            raise SettingError("largest", f"must be greater than smallest, which is {self.smallest:g}")


@dataclass(frozen=True, kw_only=True)
class LocalSearchSettings(Settings):
    """Local refinement of every new chromosome by variable projection."""

    enabled: Annotated[bool, Doc("refine the partition weights of every new chromosome by nonlinear least squares")] = (
        True
    )
    evaluations: Annotated[int, Ge(1), Le(1000), Doc("model evaluations that one local search may spend")] = 4
    reinsert: Annotated[
        Literal["improved", "always"],
        Doc("which refined chromosomes replace the bred ones: those of a smaller first objective; always: the paper"),
    ] = "improved"


@dataclass(frozen=True, kw_only=True)
class ValidationSettings(Settings):
    """How far to trust the model: what is computed once it is found."""

    enabled: Annotated[bool, Doc("gather the evidence; without, the model holds its scores only")] = True
    folds: Annotated[int, Ge(2), Le(20), Doc("contiguous blocks of the cross-validation of structures")] = 5
    structures: Annotated[bool, Doc("compare other structures by cross-validation, without a search")] = True
    draws: Annotated[int, Ge(20), Le(5000), Doc("draws of the block bootstrap behind every band")] = 200
    block_s: Annotated[
        float | None, Gt(0), Doc("duration of a block that is drawn, s; null: a fortieth of the training part")
    ] = None
    horizon_samples: Annotated[int, Ge(1), Le(1000), Doc("longest window that measured torques are replayed over")] = 50
    windows: Annotated[int, Ge(1), Le(10000), Doc("windows replayed at most, evenly spread")] = 500
    lags: Annotated[int, Ge(1), Le(1000), Doc("lags of the autocorrelation of the residuals, in samples")] = 50
    samples: Annotated[
        int,
        Ge(100),
        Doc("samples that structures are compared on at most, in contiguous blocks; a long flight has more"),
    ] = 20000
    r2_min: Annotated[
        float, Gt(0), Le(1), Doc("R2 of body torque that a model good for control has on held-out data, each axis")
    ] = 0.8


@dataclass(frozen=True, kw_only=True)
class IdentificationSettings(StructureSettings, EvolutionSettings):
    """Structure of the model, search for its partitions, and how it is judged."""

    preset: Annotated[
        Preset, Doc("what keys of the search that are left out are: fast (the defaults), or the paper's operators")
    ] = "fast"
    base: Annotated[
        Base, Doc("none: fuzzy part only, the paper; rigid-body: six inertia parameters under a ridge-held fuzzy part")
    ] = "rigid-body"
    # The general algorithm knows no objective that matters more; here the error does (docs/evolution.md).
    first_objective_weight: Annotated[
        int,
        Ge(1),
        Le(1000),
        Doc("how often the mean squared error counts in quantity-dominance; the other objectives count once"),
    ] = 10
    choice: Annotated[
        Choice,
        Doc("which member of the Pareto front becomes the model; held-out: the best on the flights of --choose-on"),
    ] = "mse-below-median-condition"
    judged_on: Annotated[
        JudgedOn,
        Doc("what the search takes its errors from: the whole training part, or the samples learned from alone"),
    ] = "training"
    start: Annotated[
        Literal["random", "with-uniform"],
        Doc("initial population: all random, or random with the equidistant partitions among them"),
    ] = "with-uniform"
    rank_tolerance: Annotated[
        float,
        Gt(0),
        Le(1e-2),
        Doc("singular values below this share of the largest count as zero; the search cannot resolve less than 3e-7"),
    ] = 3e-7
    training_share: Annotated[
        float, Gt(0), Le(1), Doc("leading share of the flight that trains; the rest is held out")
    ] = 1.0
    embargo_s: Annotated[float, Ge(0), Doc("time between training and held-out part that is used by neither")] = 0.1
    local_search: Annotated[LocalSearchSettings, Doc("local refinement inside the genetic algorithm")] = (
        LocalSearchSettings()
    )
    ridge: Annotated[RidgeSettings, Doc("ridge weight of the fuzzy part (base: rigid-body)")] = RidgeSettings()
    validation: Annotated[ValidationSettings, Doc("evidence on how far to trust the model")] = ValidationSettings()

    def __post_init__(self) -> None:
        """Apply the rules of both parents."""
        StructureSettings.__post_init__(self)
        EvolutionSettings.__post_init__(self)
