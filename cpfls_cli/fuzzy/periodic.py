"""Continuous periodic fuzzy systems: evaluated with their gradients, and fitted to samples."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, replace
from numbers import Integral, Real
from typing import Annotated, Any, TypeGuard

import numpy as np
import numpy.typing as npt
from annotated_types import Ge, Lt
from typing_extensions import Doc

from cpfls_cli.arrays import Array
from cpfls_cli.errors import SettingError
from cpfls_cli.fuzzy.basis import (
    Basis,
    Consequents,
    InputRange,
    Memberships,
    Products,
    antecedent,
    basis,
    breakpoints,
    feature_count,
    features,
    map_input,
    row_products,
    uniform_weights,
)
from cpfls_cli.least_squares import SMALLEST_SINGULAR_SHARE, Triangle
from cpfls_cli.rotations import wrapped
from cpfls_cli.settings import Settings

# The map of the full circle takes no range from the data.
_NO_RANGE = InputRange(0.0, 1.0)

# Blocks of this length stay in the cache of a processor and bound the memory of any number of samples.
_BLOCK = 4096


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


# Two functions share one rule, as one function does.
_COUNTS = {1: (1, *range(3, 22)), 2: (1, *range(3, 8))}
_SAMPLES_PER_COEFFICIENT = 3


@dataclass(frozen=True, kw_only=True)
class PeriodicSettings(Settings):
    """Structure and regularisation of a fitted periodic system."""

    membership_functions: Annotated[
        int | tuple[int, ...] | None,
        Doc("functions of each input, or one number per input; null: what the samples carry, up to 7 (one input: 21)"),
    ] = None
    consequents: Annotated[Consequents, Doc("what each rule adds up: sines and cosines, or the paper's seesaw")] = (
        "harmonic"
    )
    harmonic_order: Annotated[int, Ge(1), Doc("highest harmonic of each rule (consequents: harmonic)")] = 1
    products: Annotated[Products, Doc("whether the features of two inputs are joined or multiplied")] = "tensor"
    ridge_weight: Annotated[float, Ge(0), Doc("weight of the squared coefficients, per sample")] = 0.0
    rank_tolerance: Annotated[
        float, Ge(SMALLEST_SINGULAR_SHARE), Lt(1), Doc("singular values below this share of the largest count as zero")
    ] = 1e-6

    def __post_init__(self) -> None:
        """Refuse what no system can have: these settings are written in Python, where no config is checked."""
        # A list is what one writes first; nothing but this sets a field of a frozen instance.
        object.__setattr__(self, "membership_functions", _counts(self.membership_functions))
        if self.consequents not in ("harmonic", "seesaw"):
            raise SettingError("consequents", f"consequents = {self.consequents!r}: give 'harmonic' or 'seesaw'")
        if self.products not in ("additive", "tensor"):
            raise SettingError("products", f"products = {self.products!r}: give 'additive' or 'tensor'")
        if not _is_count(self.harmonic_order):
            message = f"harmonic_order = {self.harmonic_order!r}: give a whole number of 1 or more"
            raise SettingError("harmonic_order", message)
        if not (isinstance(self.ridge_weight, Real) and 0 <= self.ridge_weight < float("inf")):
            raise SettingError("ridge_weight", f"ridge_weight = {self.ridge_weight!r}: give a number of 0 or more")
        if not (isinstance(self.rank_tolerance, Real) and SMALLEST_SINGULAR_SHARE <= self.rank_tolerance < 1):
            message = (
                f"rank_tolerance = {self.rank_tolerance!r}: give a number from {SMALLEST_SINGULAR_SHARE:g} to below 1"
            )
            raise SettingError("rank_tolerance", message)


def _is_count(value: object) -> TypeGuard[Integral]:
    return isinstance(value, Integral) and not isinstance(value, bool) and int(value) >= 1


def _counts(functions: object) -> int | tuple[int, ...] | None:
    if functions is None:
        return None
    several = isinstance(functions, list | tuple)
    given = list(functions) if isinstance(functions, list | tuple) else [functions]
    counts = [int(count) for count in given if _is_count(count)]
    if len(counts) < max(len(given), 1):
        message = f"membership_functions = {functions!r}: give whole numbers of 1 or more, one or one for each input"
        raise SettingError("membership_functions", message)
    return tuple(counts) if several else counts[0]


def fit_periodic(
    angles: npt.ArrayLike, values: npt.ArrayLike, settings: PeriodicSettings | None = None, **keys: Any
) -> PeriodicSystem:
    """Fit a periodic fuzzy system of one or two angles, ``min |columns(q) c - y|^2 + samples w |c|^2``.

    The partitions are equidistant, so that the problem is linear in the coefficients c.

    Parameters
    ----------
    angles : array-like, shape (samples, 2), (samples, 1) or (samples,), rad
        Any number of turns.
    values : array-like, shape (samples,)
        What the system shall give there; its unit is that of the output.
    **keys
        Single settings by name, in place of those of `settings`.

    Raises
    ------
    ValueError
        Wrong shapes, values that are not finite, fewer samples than coefficients without a ridge weight, a setting
        that no system can have.
    TypeError
        `settings` of another type, or a key that is none.

    References
    ----------
    Equations (6)-(9), (12); method.md sections 4 and 5.
    """
    settings = _settings(settings, keys)
    checked = as_angles(angles)
    wanted, unit = _scaled(as_values(values, len(checked)))
    structure = _structure(settings, len(checked), checked.shape[1])

    triangle = Triangle.of((structure.columns(checked[block]), wanted[block]) for block in blocks(len(checked)))
    found = triangle.solve(settings.rank_tolerance)
    kept = found.singular_values[: found.rank] ** 2
    # Of each direction that the samples determine a ridge weight leaves a share.
    share = kept / (kept + settings.ridge_weight * len(checked))
    coefficients = found.row_space.T @ (share * (found.row_space @ found.coefficients))
    residual_rms = np.sqrt(triangle.square(coefficients) / len(checked)) * unit
    unspent = 1.0 - share.sum() / len(checked)
    quality = FitQuality(
        samples=len(checked),
        coefficients=found.parameters,
        rank=found.rank,
        condition_number=found.condition_number,
        effective_coefficients=float(share.sum()),
        residual_rms=float(residual_rms),
        cross_validation_rms=float(residual_rms / unspent) if unspent > 0 else float("inf"),
    )
    return PeriodicSystem(structure, _in_unit(coefficients, unit), quality)


def _settings(settings: object, keys: Mapping[str, Any]) -> PeriodicSettings:
    if settings is not None and not isinstance(settings, PeriodicSettings):
        raise TypeError(
            f"settings: expected PeriodicSettings(...), got {type(settings).__name__}; or name single settings, "
            "as in fit_periodic(angles, values, harmonic_order=2)"
        )
    known = [field.name for field in fields(PeriodicSettings)]
    unknown = sorted(set(keys) - set(known))
    if unknown:
        raise TypeError(f"{unknown[0]}: is no key of PeriodicSettings; use {', '.join(known)}")
    return replace(settings or PeriodicSettings(), **keys)


def _scaled(values: Array) -> tuple[Array, float]:
    """Divide by a power of two, which costs no digit: the squares of very large and very small values do not fit."""
    largest = float(np.max(np.abs(values), initial=0.0))
    unit = float(np.ldexp(1.0, np.frexp(largest)[1] - 1)) if largest else 1.0
    return values / unit, unit


def _in_unit(coefficients: Array, unit: float) -> Array:
    with np.errstate(over="ignore"):
        found = coefficients * unit
    if not np.all(np.isfinite(found)):
        raise ValueError(f"values: up to {unit:g} in size, the coefficients overflow; scale the values down")
    return found


def _structure(settings: PeriodicSettings, samples: int, inputs: int) -> PeriodicStructure:
    if settings.membership_functions is None:
        candidates = [_with(settings, (count,) * inputs) for count in _COUNTS[inputs]]
        affordable = [one for one in candidates if _SAMPLES_PER_COEFFICIENT * one.coefficients <= samples]
        chosen = affordable[-1] if affordable else candidates[0]
    else:
        functions = settings.membership_functions
        counts = (functions,) * inputs if isinstance(functions, int) else functions
        if len(counts) != inputs:
            message = f"membership_functions = {functions}: expected {inputs} numbers, one for each column of angles"
            raise SettingError("membership_functions", message)
        chosen = _with(settings, counts)
    if samples < max(chosen.coefficients if settings.ridge_weight == 0 else 1, 1):
        raise ValueError(
            f"angles: {samples} samples do not determine the {chosen.coefficients} coefficients of this system: "
            f"expected shape ({chosen.coefficients} or more, {inputs}); give more samples, fewer "
            "membership_functions, a lower harmonic_order, or a ridge_weight above 0"
        )
    return chosen


def _with(settings: PeriodicSettings, functions: tuple[int, ...]) -> PeriodicStructure:
    partitions = tuple(breakpoints(uniform_weights(count)) for count in functions)
    return PeriodicStructure(partitions, settings.consequents, settings.harmonic_order, settings.products)
