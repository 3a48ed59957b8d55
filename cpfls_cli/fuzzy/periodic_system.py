"""A periodic fuzzy system with its coefficients: a continuous function of one or two angles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cpfls_cli.arrays import Array
from cpfls_cli.fuzzy.periodic_structure import PeriodicStructure
from cpfls_cli.fuzzy.samples import as_points, blocks


@dataclass(frozen=True)
class FitQuality:
    """How well the samples determine a system, and how well it fits them.

    Attributes
    ----------
    samples : int
    coefficients : int
        Number of coefficients of the system.
    rank : int
        Number of directions of the coefficients that the samples determine.
    condition_number : float
        Largest over smallest kept singular value of the columns.
    effective_coefficients : float
        What the fit spends: the rank, or less with a ridge weight.
    residual_rms : float
        Root mean square of the residuals.
    cross_validation_rms : float
        Estimate of the root mean square error on new samples of the same spread and noise, noise included:
        ``residual_rms / (1 - effective_coefficients / samples)``. Infinite where the fit spends every sample.

    References
    ----------
    Golub, Heath, Wahba, Generalized cross-validation as a method for choosing a good ridge parameter (1979).
    """

    samples: int
    coefficients: int
    rank: int
    condition_number: float
    effective_coefficients: float
    residual_rms: float
    cross_validation_rms: float

    @property
    def determined(self) -> float:
        """Share of the coefficients that the samples determine, ``rank / coefficients``.

        Below 1 the system is the smallest of many that fit as well: where no samples were, its values mean nothing,
        and `cross_validation_rms` does not tell.
        """
        return self.rank / self.coefficients


@dataclass(frozen=True)
class PeriodicSystem:
    """A periodic fuzzy system, ``f(q) = columns(q) @ coefficients``.

    Attributes
    ----------
    structure : PeriodicStructure
    coefficients : array, shape (coefficients,)
        Rule by rule, the rules of the second input fastest, in a rule feature by feature.
    quality : FitQuality
    """

    structure: PeriodicStructure
    coefficients: Array
    quality: FitQuality

    @property
    def breakpoints(self) -> tuple[Array, ...]:
        """Where the membership functions of each input have their peaks, shape (functions,), share of a turn."""
        return self.structure.breakpoints

    def __call__(self, angles: npt.ArrayLike) -> Array:
        """Evaluate the system.

        Parameters
        ----------
        angles : array-like, shape (samples, inputs), or (inputs,) for a single point, rad
            Any number of turns; shape (samples,), or a number, too where there is one input.

        Returns
        -------
        array, shape (samples,), or () for a single point
        """
        checked, outer = as_points(angles, self.structure.inputs)
        output = np.empty(len(checked))
        for rows in blocks(len(checked)):
            output[rows] = self.structure.columns(checked[rows]) @ self.coefficients
        return output.reshape(outer)

    def gradient(self, angles: npt.ArrayLike) -> Array:
        """Differentiate the system by its inputs, in closed form.

        Parameters
        ----------
        angles : array-like, rad
            Of the shapes that a call takes.

        Returns
        -------
        array, shape (samples, inputs), or (inputs,) for a single point, 1/rad
        """
        checked, outer = as_points(angles, self.structure.inputs)
        output = np.empty(checked.shape)
        for rows in blocks(len(checked)):
            output[rows] = (self.structure.basis(checked[rows]).gradient @ self.coefficients).T
        return output.reshape(*outer, self.structure.inputs)
