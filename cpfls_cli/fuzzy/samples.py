"""Samples as they are given to a fit: checked, as columns of angles, block after block."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from cpfls_cli.arrays import Array

# Blocks of this length stay in the cache of a processor and bound the memory of any number of samples.
_BLOCK = 2048


def as_angles(angles: npt.ArrayLike, inputs: int | None = None) -> Array:
    """Check input angles and give them one column per input.

    Parameters
    ----------
    angles : array-like, shape (samples, 2), (samples, 1) or (samples,), rad
        Any number of turns.
    inputs : int, optional
        Number of inputs that a system has.

    Returns
    -------
    array, shape (samples, inputs), rad

    Raises
    ------
    ValueError
        Another shape, or a value that is not finite.
    """
    given = _numbers("angles", angles)
    columns = given[:, None] if given.ndim == 1 else given
    expected = (
        "(samples, 1 or 2)" if inputs is None else f"(samples, {inputs}), or {_point_shape(inputs)} for one point"
    )
    if columns.ndim != 2 or columns.shape[1] not in ((1, 2) if inputs is None else (inputs,)):
        raise ValueError(f"angles: expected shape {expected}, got {given.shape}")
    return _finite("angles", columns)


def as_points(angles: npt.ArrayLike, inputs: int) -> tuple[Array, tuple[int, ...]]:
    """Check the angles at which a system is asked for; a single point needs no column of samples.

    Parameters
    ----------
    angles : array-like, shape (samples, inputs) or (inputs,), rad; one input: (samples,) or () too
    inputs : int

    Returns
    -------
    columns : array, shape (samples, inputs), rad
    outer : tuple of int
        Shape of one result for each point: (samples,), or () for a single point.

    Raises
    ------
    ValueError
        Another shape, or a value that is not finite.
    """
    given = _numbers("angles", angles)
    if given.shape == _point_shape(inputs):
        return as_angles(given.reshape(1, inputs), inputs), ()
    columns = as_angles(given, inputs)
    return columns, (len(columns),)


def _point_shape(inputs: int) -> tuple[int, ...]:
    return () if inputs == 1 else (inputs,)


def as_values(values: npt.ArrayLike, samples: int) -> Array:
    """Check the values to fit.

    Parameters
    ----------
    values : array-like, shape (samples,)
    samples : int
        Number of input angles that they belong to.

    Returns
    -------
    array, shape (samples,)

    Raises
    ------
    ValueError
        Another shape, or a value that is not finite.
    """
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
        place = ", ".join(str(index) for index in bad[0])
        raise ValueError(f"{name}: {len(bad)} values are not finite, the first is {name}[{place}]; leave such rows out")
    return given
