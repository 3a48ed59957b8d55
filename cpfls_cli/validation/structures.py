"""Structures near that of a model, compared with it by cross-validation over contiguous blocks."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.blocks import mean_error
from cpfls_cli.errors import SettingError
from cpfls_cli.fuzzy.basis import InputMap
from cpfls_cli.identification.data import TorqueData, TorqueSource, axis_scale, gathered
from cpfls_cli.identification.samples import Products, Ready, Samples
from cpfls_cli.identification.settings import Base, IdentificationSettings
from cpfls_cli.identification.solver import (
    LARGEST_SQUARE,
    SMALLEST_ERROR,
    RidgeChoice,
    column_size,
    ridge_curve,
    with_folds,
)
from cpfls_cli.least_squares import SMALLEST_SINGULAR_SHARE
from cpfls_cli.regressor.regressor import RIGID, data_ranges, uniform_breakpoints
from cpfls_cli.regressor.structure import StructureSettings, model_structure
from cpfls_cli.result import about

# Choices on both sides of those that are usual: the paper's five functions, the second order by default.
_FUNCTIONS = (1, 3, 5, 7)
_SEESAW_FUNCTIONS = 5
_INPUT_MAPS: tuple[InputMap, ...] = ("full-circle", "data-range")
_HARMONIC_ORDERS = (1, 2, 3)

# Contiguous pieces that stand for a long flight.
_PIECES = 20
_MOST_PARAMETERS = 400

# The columns of a rigid body stand before those of any structure: the smallest will do.
_RIGID_ONLY = StructureSettings(harmonic_order=1, products="additive")

RIGID_BODY_NAME = "rigid body"


def candidate_structures(model: StructureSettings) -> tuple[StructureSettings, ...]:
    """List a structure, and those that differ from it in one choice; the same model is listed once.

    The choices are the number of membership functions, the input map, and the consequents: the triangle wave, or
    harmonics up to the first, second or third order.
    """
    structure = StructureSettings(**{field.name: getattr(model, field.name) for field in fields(StructureSettings)})
    different: dict[tuple[Any, ...], StructureSettings] = {}
    for settings in (structure, *_changed(structure)):
        different.setdefault(_identity(settings), settings)
    return tuple(different.values())


def structure_name(settings: StructureSettings) -> str:
    """Name a structure in one line, as ``harmonic 2 tensor, 1 function, full-circle``."""
    harmonic = settings.consequents == "harmonic"
    consequents = f"harmonic {settings.harmonic_order}" if harmonic else "seesaw"
    counts = settings.membership_functions
    number = str(counts) if isinstance(counts, int) else "-".join(map(str, counts))
    functions = f"{number} function" + ("" if counts == 1 else "s")
    classic = ", classic" if settings.structure == "fls" else ""
    return f"{consequents} {settings.products}, {functions}, {settings.input_map}{classic}"


def _changed(structure: StructureSettings) -> Iterator[StructureSettings]:
    for functions in _FUNCTIONS:
        yield replace(structure, membership_functions=functions)
    products = structure.products if structure.consequents == "seesaw" else "additive"
    seesaw = replace(structure, consequents="seesaw", products=products, membership_functions=_SEESAW_FUNCTIONS)
    for settings in (structure, seesaw):
        for input_map in _INPUT_MAPS:
            yield replace(settings, input_map=input_map)
    # One rule where consequents were not harmonic, for harmonics need no more.
    one_rule: dict[str, Any] = {"structure": "cpfls", "products": "tensor", "membership_functions": 1}
    harmonic = {"consequents": "harmonic", **(one_rule if structure.consequents == "seesaw" else {})}
    for order in _HARMONIC_ORDERS:
        yield replace(structure, harmonic_order=order, **harmonic)


def _identity(settings: StructureSettings) -> tuple[Any, ...]:
    """Identify a structure by the settings that change its model."""
    harmonic = settings.consequents == "harmonic"
    one_rule = settings.membership_functions == 1
    return (
        settings.structure,
        settings.consequents,
        settings.harmonic_order if harmonic else None,
        settings.products,
        settings.membership_functions,
        None if harmonic and one_rule else settings.input_map,
    )


@dataclass(frozen=True)
class FoldResult:
    """Cross-validation of one structure.

    The error is the mean squared one of the torque scaled by axis over all blocks, the standard error over blocks; the
    ridge weight is chosen on the same blocks, 0 without a ridge, infinite where the fuzzy part is off.
    """

    error: float
    standard_error: float
    ridge_weight: float


@dataclass(frozen=True)
class StructureFolds:
    """Data to learn from and to judge on, labelled by fold; a rigid body stands before the columns of every structure.

    The structures of the data are replaced by those that are asked for; `choice` holds blocks and ridge weights to try.
    """

    learned: Samples
    judged: Samples
    choice: RidgeChoice
    base: Base
    rank_tolerance: float

    @classmethod
    def of(cls, training: TorqueSource, learned: TorqueSource, settings: IdentificationSettings) -> StructureFolds:
        """Thin out the samples where there are many, and label them by fold.

        SettingError if there are too few samples for the blocks.
        """
        validation = settings.validation
        structure = model_structure(_RIGID_ONLY)
        judges = _pieces(training, validation.samples)
        learns = judges if len(learned) == len(training) else _pieces(learned, validation.samples)
        ranges = data_ranges(structure, judges.motion.attitude)
        part, whole = (Samples.of(Ready(source, rigid=True), structure, ranges) for source in (learns, judges))
        part, choice = with_folds(part, whole, replace(settings.ridge, folds=validation.folds))
        scale = 1.0 / axis_scale(learns)
        learned_scale = scale if settings.base == "rigid-body" else np.ones(3)
        judged = replace(choice.judged, scale=scale)
        return cls(replace(part, scale=learned_scale), judged, choice, settings.base, settings.rank_tolerance)

    def rigid_body(self) -> FoldResult:
        """Cross-validate the rigid body alone."""
        products = self._products(_RIGID_ONLY)
        assert products is not None
        return self._plain(*products, slice(0, RIGID), np.inf)

    def structure(self, settings: StructureSettings) -> FoldResult | None:
        """Cross-validate a structure; None where the samples do not identify its parameters, or it is not finite."""
        samples = np.bincount(self.learned.label, minlength=self.learned.labels)
        fewest_rows = 3 * int(np.min(~self.choice.left_out @ samples))
        if model_structure(settings).parameters > min(_MOST_PARAMETERS, fewest_rows):
            return None
        products = self._products(settings)
        if products is None:
            return None
        if self.base == "none":
            return self._plain(*products, slice(RIGID, None), 0.0)
        learned, judged = products
        curve = ridge_curve(learned, judged, self.choice.left_out, self.choice.weights, column_size(learned.sum()))
        return FoldResult(
            *(float(values[curve.chosen]) for values in (curve.error, curve.standard_error, curve.weight))
        )

    def _products(self, settings: StructureSettings) -> tuple[Products, Products] | None:
        structure = model_structure(settings)
        ranges = data_ranges(structure, np.concatenate([attitude for attitude, _ in self.judged.ready]))
        partitions = uniform_breakpoints(structure)
        learned, judged = (
            replace(samples, structure=structure, ranges=ranges).products(partitions)
            for samples in (self.learned, self.judged)
        )
        usable = max(np.max(np.abs(learned.gram)), np.max(np.abs(judged.gram))) <= LARGEST_SQUARE
        return (learned, judged) if usable else None

    def _plain(self, learned: Products, judged: Products, columns: slice, weight: float) -> FoldResult:
        """Cross-validate some columns without a ridge."""
        errors = [
            _fold_error(learned.sum(~left_out), judged, fold, columns, self.rank_tolerance)
            for fold, left_out in enumerate(self.choice.left_out)
        ]
        spread = mean_error(np.array(errors))
        return FoldResult(float(np.average(errors, weights=judged.rows)), float(spread), weight)


def _pieces(source: TorqueSource, most: int) -> TorqueData:
    """Gather contiguous pieces, evenly spread, of a source that has too many samples."""
    samples = len(source)
    if samples <= most:
        return gathered(source, np.arange(samples))
    starts = np.arange(_PIECES) * samples // _PIECES
    return gathered(source, (starts[:, None] + np.arange(most // _PIECES)).ravel())


def _fold_error(learned: Products, judged: Products, fold: int, columns: slice, rank_tolerance: float) -> float:
    """Mean squared error on one block of the parameters of minimum norm."""
    values, vectors = np.linalg.eigh(learned.gram[0, columns, columns])
    kept = values > max(rank_tolerance, SMALLEST_SINGULAR_SHARE) ** 2 * max(values[-1], 0.0)
    basis = vectors[:, kept]
    x = basis @ ((basis.T @ learned.moment[0, columns]) / values[kept])
    explained = 2.0 * judged.moment[fold, columns] @ x - x @ judged.gram[fold, columns, columns] @ x
    square = judged.square[fold]
    return float(max(square - explained, SMALLEST_ERROR * square) / judged.rows[fold])


@dataclass(frozen=True, eq=False)
class StructureComparison:
    """Structures and the error of each on blocks that it did not learn from; none where samples are too few."""

    name: tuple[str, ...] = about(
        "structures compared by cross-validation over blocks; the rigid body first", "candidate"
    )
    parameters: IntArray = about("linear parameters of the fuzzy part", "candidate")
    error: Array = about("mean squared error of scaled torque, held-out blocks", "candidate")
    standard_error: Array = about("its standard error over blocks", "candidate")
    ridge_weight: Array = about(
        "chosen on the same blocks; 0 without a ridge, infinite: fuzzy part off", "candidate", gaps=True
    )
    own: BoolArray = about("1 for the structure of this model", "candidate")


def compare_structures(
    training: TorqueSource, learned: TorqueSource, settings: IdentificationSettings
) -> StructureComparison:
    """Cross-validate the rigid body alone, the structure of the settings, and those that differ in one choice.

    All have equidistant partitions: nothing is searched for, so a structure whose partitions matter looks worse here
    than a search would leave it, the model's own as well. The ridge weight of a fuzzy part over a rigid body is chosen
    by the one-standard-error rule on the same blocks; without a rigid body the coefficients are those of minimum norm.
    A structure is left out where it has more than 400 parameters, or more than the rows that a fold learns from. Of
    more than `validation.samples` training samples, as many in contiguous pieces judge; parameters are learned from
    `learned`. Empty where the samples are too few for the folds and the time left out around them.
    """
    try:
        folds = StructureFolds.of(training, learned, settings)
    except SettingError:
        return _comparison([])
    first, *others = candidate_structures(settings)
    rows = [(RIGID_BODY_NAME, 0, False, folds.rigid_body())]
    for structure in (first, *others):
        result = folds.structure(structure)
        if result is not None:
            rows.append((structure_name(structure), model_structure(structure).parameters, structure is first, result))
    return _comparison(rows)


def _comparison(rows: list[tuple[str, int, bool, FoldResult]]) -> StructureComparison:
    results = [result for *_, result in rows]
    return StructureComparison(
        name=tuple(name for name, *_ in rows),
        parameters=np.array([parameters for _, parameters, *_ in rows], dtype=np.int64),
        error=np.array([result.error for result in results], dtype=float),
        standard_error=np.array([result.standard_error for result in results], dtype=float),
        ridge_weight=np.array([result.ridge_weight for result in results], dtype=float),
        own=np.array([own for *_, own, _ in rows], dtype=bool),
    )
