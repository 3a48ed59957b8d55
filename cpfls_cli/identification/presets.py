"""Presets: values of the search's keys that hold where a config leaves the keys out."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final, Literal

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
