"""Cross-validation of one structure after the other on the same contiguous blocks."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from cpfls_cli.identification.cross_validation import SMALLEST_ERROR, RidgeChoice, ridge_curve, with_folds
from cpfls_cli.identification.data import TorqueData, TorqueSource, axis_scale, gathered
from cpfls_cli.identification.least_squares import SMALLEST_SINGULAR_SHARE
from cpfls_cli.identification.samples import Products, Ready, Samples
from cpfls_cli.identification.settings import Base, IdentificationSettings
from cpfls_cli.identification.solver import LARGEST_SQUARE, column_size
from cpfls_cli.regressor.motion import RIGID
from cpfls_cli.regressor.regressor import data_ranges, uniform_breakpoints
from cpfls_cli.regressor.structure import StructureSettings, model_structure

# Contiguous pieces that stand for a long flight.
_PIECES = 20
_MOST_PARAMETERS = 400

# The columns of a rigid body stand before those of any structure: the smallest will do.
_RIGID_ONLY = StructureSettings(harmonic_order=1, products="additive")


@dataclass(frozen=True)
class FoldResult:
    """Cross-validation of one structure.

    Attributes
    ----------
    error : float
        Mean squared error of the torque scaled by axis, over all blocks.
    standard_error : float
        Over blocks.
    ridge_weight : float
        Chosen on the same blocks; 0 without a ridge, infinite where the fuzzy part is off.
    """

    error: float
    standard_error: float
    ridge_weight: float


@dataclass(frozen=True)
class StructureFolds:
    """Data to learn from and to judge on, labelled by fold; a rigid body stands before the columns of every structure.

    Attributes
    ----------
    learned, judged : Samples
        Their structures are replaced by those that are asked for.
    choice : RidgeChoice
        Blocks, and ridge weights to try.
    base : Base
    rank_tolerance : float
    """

    learned: Samples
    judged: Samples
    choice: RidgeChoice
    base: Base
    rank_tolerance: float

    @classmethod
    def of(cls, training: TorqueSource, learned: TorqueSource, settings: IdentificationSettings) -> StructureFolds:
        """Take some of the samples where there are many, and label them.

        Raises
        ------
        SettingError
            If there are too few samples for the blocks.
        """
        validation = settings.validation
        structure = model_structure(_RIGID_ONLY)
        judges = _pieces(training, validation.samples)
        learns = judges if len(learned) == len(training) else _pieces(learned, validation.samples)
        ranges = data_ranges(structure, judges.motion.attitude)
        part, whole = (Samples.of(Ready(source, rigid=True), structure, ranges) for source in (learns, judges))
        part, choice = with_folds(part, whole, replace(settings.ridge, folds=validation.folds))
        scale = 1.0 / axis_scale(learns)
        own_scale = scale if settings.base == "rigid-body" else np.ones(3)
        judged = replace(choice.judged, scale=scale)
        return cls(replace(part, scale=own_scale), judged, choice, settings.base, settings.rank_tolerance)

    def rigid_body(self) -> FoldResult:
        """Cross-validate the rigid body alone."""
        products = self._products(_RIGID_ONLY)
        assert products is not None
        return self._plain(*products, slice(0, RIGID), np.inf)

    def structure(self, settings: StructureSettings) -> FoldResult | None:
        """Cross-validate a structure; None where the samples cannot tell its parameters, or it is not finite."""
        if model_structure(settings).parameters > min(_MOST_PARAMETERS, self._fewest_rows()):
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
        ranges = data_ranges(structure, np.concatenate([c.attitude for c in self.judged.ready]))
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
        spread = np.std(errors, ddof=1) / np.sqrt(len(errors))
        return FoldResult(float(np.average(errors, weights=judged.rows)), float(spread), weight)

    def _fewest_rows(self) -> int:
        samples = np.bincount(self.learned.label, minlength=self.learned.labels)
        return 3 * int(np.min(~self.choice.left_out @ samples))


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
