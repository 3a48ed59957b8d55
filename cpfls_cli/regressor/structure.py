"""Structure of a model: inputs, partitions, rules and coefficients of each inertia function."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Le
from typing_extensions import Doc

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.errors import SettingError
from cpfls_cli.fuzzy.basis import Consequents, InputMap, Products, feature_count
from cpfls_cli.result import part
from cpfls_cli.settings import Settings

ROLL, PITCH = 0, 1
FunctionCount = Annotated[int, Ge(1), Le(15)]


@dataclass(frozen=True)
class InertiaFunction:
    """One unknown function of the inertia matrix.

    Attributes
    ----------
    name : str
        ``D13`` and so on.
    row, column : int
        Its place in J; the transposed place holds the same function.
    inputs : tuple of int
        Angles it depends on: 0 roll, 1 pitch; none for a constant.
    """

    name: str
    row: int
    column: int
    inputs: tuple[int, ...]


INERTIA_FUNCTIONS = (
    InertiaFunction("D11", 0, 0, ()),
    InertiaFunction("D13", 0, 2, (PITCH,)),
    InertiaFunction("D22", 1, 1, (ROLL,)),
    InertiaFunction("D23", 1, 2, (ROLL, PITCH)),
    InertiaFunction("D33", 2, 2, (ROLL, PITCH)),
)
"""Equations (14) and (15); D12 is zero."""

_PLACES = tuple((function.name, angle) for function in INERTIA_FUNCTIONS for angle in function.inputs)
"""Partitions: function and input of each."""


@dataclass(frozen=True, kw_only=True)
class StructureSettings(Settings):
    """Structure of the fuzzy part of a model."""

    structure: Annotated[
        Literal["cpfls", "fls"], Doc("cpfls: continuous periodic (first and last rule joined); fls: classic TSK system")
    ] = "cpfls"
    input_map: Annotated[
        InputMap, Doc("full-circle: angle modulo 2 pi; data-range: seesaw scaled over the training data")
    ] = "full-circle"
    consequents: Annotated[Consequents, Doc("seesaw: the paper's triangle wave; harmonic: sines and cosines")] = (
        "harmonic"
    )
    harmonic_order: Annotated[int, Ge(1), Le(8), Doc("highest harmonic of harmonic consequents")] = 2
    products: Annotated[Products, Doc("additive: features of two inputs side by side; tensor: all their products")] = (
        "tensor"
    )
    membership_functions: Annotated[
        FunctionCount | tuple[FunctionCount, FunctionCount, FunctionCount, FunctionCount, FunctionCount, FunctionCount],
        Doc("per input, 1 to 15; or six numbers for D13(pitch) D22(roll) D23(roll) D23(pitch) D33(roll) D33(pitch)"),
    ] = 1

    def __post_init__(self) -> None:
        """Refuse combinations that no system has."""
        if self.structure == "fls" and self.consequents == "harmonic":
            raise SettingError("consequents", "the classic system (structure: fls) has linear consequents; use seesaw")


@dataclass(frozen=True)
class Partition:
    """One fuzzy partition of a model, of an inertia function over an input: 0 roll, 1 pitch."""

    function: str
    input: int
    functions: int

    @property
    def name(self) -> str:
        """Name such as ``D23(pitch)``."""
        return f"{self.function}({('roll', 'pitch')[self.input]})"

    def rules(self, *, circular: bool) -> int:
        """Count the rules along its input: on a circle the first and the last function are one."""
        return max(self.functions - 1, 1) if circular else self.functions

    @property
    def weights(self) -> int:
        """Number of weights, that is genes, that encode it."""
        return self.functions - 1


@dataclass(frozen=True)
class Block:
    """Coefficients of one inertia function.

    Attributes
    ----------
    partitions : tuple of int
        Indices of its partitions, in the order of its inputs.
    features : int
        Coefficients per rule.
    columns : slice
        Where its coefficients stand among all.
    """

    function: InertiaFunction
    partitions: tuple[int, ...]
    rules: int
    features: int
    columns: slice


@dataclass(frozen=True)
class ModelStructure:
    """Partitions and blocks of coefficients of the fuzzy part of a model; see `model_structure`."""

    settings: StructureSettings = part()

    @property
    def parameter_names(self) -> list[str]:
        """Inertia function, rule and feature of each coefficient."""
        return [
            f"{block.function.name} rule {rule + 1} c{feature}"
            for block in self.blocks
            for rule in range(block.rules)
            for feature in range(block.features)
        ]

    @cached_property
    def partitions(self) -> tuple[Partition, ...]:
        """In the order of the genes: D13(pitch), D22(roll), D23(roll), D23(pitch), D33(roll), D33(pitch)."""
        counts = _function_counts(self.settings)
        return tuple(Partition(*place, number) for place, number in zip(_PLACES, counts, strict=True))

    @cached_property
    def blocks(self) -> tuple[Block, ...]:
        """In the order of the coefficients: D11, D13, D22, D23, D33."""
        return tuple(_blocks(self.settings, self.partitions))

    @property
    def parameters(self) -> int:
        """Number of linear parameters."""
        return sum(block.rules * block.features for block in self.blocks)

    @property
    def genes(self) -> int:
        """Number of weights of all partitions."""
        return sum(partition.weights for partition in self.partitions)

    @property
    def circular(self) -> bool:
        """Whether the first and the last rule are one."""
        return self.settings.structure == "cpfls"

    def weight_slices(self) -> Iterator[slice]:
        """Yield where each partition's weights stand among the genes."""
        start = 0
        for partition in self.partitions:
            yield slice(start, start + partition.weights)
            start += partition.weights

    @cached_property
    def alike(self) -> tuple[tuple[IntArray, IntArray], ...]:
        """Partitions of equal numbers of functions, and their weights among the genes, shape (partitions, weights)."""
        slices, counts = list(self.weight_slices()), np.array([partition.weights for partition in self.partitions])
        groups = (np.flatnonzero(counts == count) for count in np.unique(counts))
        return tuple((group, np.array([np.r_[slices[i]] for i in group], dtype=np.int64)) for group in groups)

    @cached_property
    def inner(self) -> tuple[BoolArray, Array, IntArray]:
        """How inner breakpoints follow from weights: whose partition is theirs, which lie left of them; the partition.

        The first two of shape (inner breakpoints, genes).
        """
        slices = enumerate(self.weight_slices())
        ends = [(i, own, k) for i, own in slices for k in range(1, own.stop - own.start)]
        own, counted = np.zeros((len(ends), self.genes), dtype=np.bool_), np.zeros((len(ends), self.genes))
        for row, (_, genes, k) in enumerate(ends):
            own[row, genes], counted[row, genes.start : genes.start + k] = True, 1.0
        return own, counted, np.array([i for i, _, _ in ends], dtype=np.int64)


def model_structure(settings: StructureSettings) -> ModelStructure:
    """Count out the partitions, rules and coefficients of a model.

    References
    ----------
    Paper section 5; method.md section 5: 113 parameters for five functions, circular, seesaw consequents.
    """
    own = {each.name: getattr(settings, each.name) for each in fields(StructureSettings)}
    return ModelStructure(StructureSettings(**own | {"membership_functions": _function_counts(settings)}))


def _function_counts(settings: StructureSettings) -> tuple[int, ...]:
    """Count the membership functions of each partition."""
    counts = settings.membership_functions
    return (counts,) * len(_PLACES) if isinstance(counts, int) else counts


def _blocks(settings: StructureSettings, partitions: tuple[Partition, ...]) -> Iterator[Block]:
    start = 0
    circular = settings.structure == "cpfls"
    for function in INERTIA_FUNCTIONS:
        of_function = tuple(i for i, partition in enumerate(partitions) if partition.function == function.name)
        rules = 1
        for i in of_function:
            rules *= partitions[i].rules(circular=circular)
        features = 1
        if of_function:
            features = feature_count(len(of_function), settings.consequents, settings.harmonic_order, settings.products)
        yield Block(function, of_function, rules, features, slice(start, start + rules * features))
        start += rules * features
