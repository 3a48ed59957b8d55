"""A periodic fuzzy system of one or two angles: its columns and coefficients, and checks of samples given to it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cpfls_cli.arrays import Array
from cpfls_cli.fuzzy.basis import (
    Basis,
    Consequents,
    InputRange,
    Memberships,
    Products,
    antecedent,
    basis,
    feature_count,
    features,
    map_input,
    row_products,
)
from cpfls_cli.rotations import wrapped

# The map of the full circle takes no range from the data.
_NO_RANGE = InputRange(0.0, 1.0)

# Blocks of this length stay in the cache of a processor and bound the memory of any number of samples.
_BLOCK = 2048


@dataclass(frozen=True)
class PeriodicStructure:
    """Partitions and consequents of a periodic system, ``f(q) = columns(q) @ coefficients``.

    Attributes
    ----------
    breakpoints : tuple of array, shape (functions,)
        One partition per input, of the angle modulo 2 pi over 2 pi; the first and the last function are one.
    consequents, harmonic_order, products
        See `feature_count`.
    """

    breakpoints: tuple[Array, ...]
    consequents: Consequents
    harmonic_order: int
    products: Products

    @property
    def inputs(self) -> int:
        """Number of input angles."""
        return len(self.breakpoints)

    @property
    def coefficients(self) -> int:
        """Number of coefficients: rules times features of a rule."""
        count = feature_count(self.inputs, self.consequents, self.harmonic_order, self.products)
        for partition in self.breakpoints:
            count *= max(len(partition) - 1, 1)
        return count

    def columns(self, angles: Array) -> Array:
        """Evaluate the columns alone.

        Parameters
        ----------
        angles : array, shape (samples, inputs), rad

        Returns
        -------
        array, shape (samples, coefficients)
        """
        rules, consequent = self._parts(angles)
        firing = rules[0].value
        for rule in rules[1:]:
            firing = row_products(firing, rule.value)
        return row_products(firing, consequent.value)

    def basis(self, angles: Array) -> Basis:
        """Evaluate the columns and their derivatives at angles, shape (samples, inputs), rad."""
        return basis(*self._parts(angles))

    def _parts(self, angles: Array) -> tuple[list[Memberships], Basis]:
        single = [wrapped(angle) for angle in angles.T]
        mapped = [map_input(angle, "full-circle", True, _NO_RANGE) for angle in single]
        rules = [
            antecedent(one, partition, circular=True) for one, partition in zip(mapped, self.breakpoints, strict=True)
        ]
        return rules, features(single, mapped, self.consequents, self.harmonic_order, self.products)


@dataclass(frozen=True)
class FitQuality:
    """Rank, conditioning and errors of a fit.

    Attributes
    ----------
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
        and `cross_validation_rms` does not show.
        """
        return self.rank / self.coefficients


@dataclass(frozen=True)
class PeriodicSystem:
    """A periodic fuzzy system, ``f(q) = columns(q) @ coefficients``.

    Attributes
    ----------
    coefficients : array, shape (coefficients,)
        Rule by rule, the rules of the second input fastest, in a rule feature by feature.
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


def as_angles(angles: npt.ArrayLike, inputs: int | None = None) -> Array:
    """Check input angles, shape (samples, 2), (samples, 1) or (samples,), rad, and give them one column per input."""
    given = _numbers("angles", angles)
    columns = given[:, None] if given.ndim == 1 else given
    expected = (
        "(samples, 1 or 2)" if inputs is None else f"(samples, {inputs}), or {_point_shape(inputs)} for one point"
    )
    if columns.ndim != 2 or columns.shape[1] not in ((1, 2) if inputs is None else (inputs,)):
        raise ValueError(f"angles: expected shape {expected}, got {given.shape}")
    return _finite("angles", columns)


def as_points(angles: npt.ArrayLike, inputs: int) -> tuple[Array, tuple[int, ...]]:
    """Check the angles, rad, at which a system is asked for; a single point needs no column of samples.

    Gives them with shape (samples, inputs), and the shape of one result for each point: (samples,), or () for a single
    one.
    """
    given = _numbers("angles", angles)
    if given.shape == _point_shape(inputs):
        return as_angles(given.reshape(1, inputs), inputs), ()
    columns = as_angles(given, inputs)
    return columns, (len(columns),)


def _point_shape(inputs: int) -> tuple[int, ...]:
    return () if inputs == 1 else (inputs,)


def as_values(values: npt.ArrayLike, samples: int) -> Array:
    """Check the values to fit, one for each sample."""
    given = _numbers("values", values)
    if given.shape != (samples,):
        raise ValueError(f"values: expected shape ({samples},), one value for each row of angles, got {given.shape}")
    return _finite("values", given)


def blocks(samples: int) -> Iterator[slice]:
    """Cut samples into blocks."""
    return (slice(start, min(start + _BLOCK, samples)) for start in range(0, samples, _BLOCK))


def _numbers(name: str, given: npt.ArrayLike) -> Array:
    try:
        numbers = np.asarray(given)
        if np.iscomplexobj(numbers):
            raise TypeError("these are complex")
        return numbers.astype(float)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name}: expected an array of real numbers ({error})") from error


def _finite(name: str, given: Array) -> Array:
    bad = np.argwhere(~np.isfinite(given))
    if len(bad):
        first = ", ".join(str(index) for index in bad[0])
        raise ValueError(f"{name}: {len(bad)} values are not finite, the first is {name}[{first}]; leave such rows out")
    return given
