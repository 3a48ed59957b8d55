"""Fit a periodic fuzzy system to samples by one linear least-squares problem."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from cpfls_cli.arrays import Array
from cpfls_cli.errors import SettingError
from cpfls_cli.fuzzy.partition import breakpoints, uniform_weights
from cpfls_cli.fuzzy.periodic_settings import PeriodicSettings
from cpfls_cli.fuzzy.periodic_structure import PeriodicStructure
from cpfls_cli.fuzzy.periodic_system import FitQuality, PeriodicSystem
from cpfls_cli.fuzzy.ridge import RidgeSolution, solve_ridge
from cpfls_cli.fuzzy.samples import as_angles, as_values, blocks

# Two functions share one rule, as one function does.
_COUNTS = {1: (1, *range(3, 22)), 2: (1, *range(3, 8))}
_SAMPLES_PER_COEFFICIENT = 3
# Columns are computed twice rather than kept above this many numbers, 64 MB.
_MOST_KEPT = 8_000_000


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
    settings : PeriodicSettings, optional
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

    def rows() -> Iterator[tuple[Array, Array]]:
        return ((structure.columns(checked[block]), wanted[block]) for block in blocks(len(checked)))

    kept = list(rows()) if len(checked) * structure.coefficients <= _MOST_KEPT else None
    weight = settings.ridge_weight * len(checked)
    solution = solve_ridge(rows if kept is None else lambda: iter(kept), weight, settings.rank_tolerance)
    return PeriodicSystem(structure, _in_unit(solution, unit), _quality(solution, len(checked), unit))


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


def _in_unit(solution: RidgeSolution, unit: float) -> Array:
    with np.errstate(over="ignore"):
        coefficients: Array = solution.coefficients * unit
    if not np.all(np.isfinite(coefficients)):
        raise ValueError(f"values: up to {unit:g} in size, the coefficients overflow; scale the values down")
    return coefficients


def _structure(settings: PeriodicSettings, samples: int, inputs: int) -> PeriodicStructure:
    if settings.membership_functions is None:
        candidates = [_with(settings, (count,) * inputs) for count in _COUNTS[inputs]]
        affordable = [one for one in candidates if _SAMPLES_PER_COEFFICIENT * one.coefficients <= samples]
        chosen = affordable[-1] if affordable else candidates[0]
    else:
        chosen = _with(settings, _per_input(settings.membership_functions, inputs))
    if samples < max(chosen.coefficients if settings.ridge_weight == 0 else 1, 1):
        raise ValueError(
            f"angles: {samples} samples do not determine the {chosen.coefficients} coefficients of this system: "
            f"expected shape ({chosen.coefficients} or more, {inputs}); give more samples, fewer "
            "membership_functions, a lower harmonic_order, or a ridge_weight above 0"
        )
    return chosen


def _per_input(functions: int | tuple[int, ...], inputs: int) -> tuple[int, ...]:
    counts = (functions,) * inputs if isinstance(functions, int) else functions
    if len(counts) != inputs:
        message = f"membership_functions = {functions}: expected {inputs} numbers, one for each column of angles"
        raise SettingError("membership_functions", message)
    return counts


def _with(settings: PeriodicSettings, functions: tuple[int, ...]) -> PeriodicStructure:
    partitions = tuple(breakpoints(uniform_weights(count)) for count in functions)
    return PeriodicStructure(partitions, settings.consequents, settings.harmonic_order, settings.products)


def _quality(solution: RidgeSolution, samples: int, unit: float) -> FitQuality:
    residual_rms = float(np.sqrt(solution.residual_square / samples)) * unit
    left = 1.0 - solution.effective_coefficients / samples
    return FitQuality(
        samples=samples,
        coefficients=len(solution.coefficients),
        rank=solution.rank,
        condition_number=solution.condition_number,
        effective_coefficients=solution.effective_coefficients,
        residual_rms=residual_rms,
        cross_validation_rms=residual_rms / left if left > 0 else float("inf"),
    )
