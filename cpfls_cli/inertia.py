"""The six parameters of an inertia tensor: their names, their entries, and what they multiply in a torque."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from cpfls_cli.arrays import Array

INERTIA_PARAMETERS = ("Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")
"""Names in the order of every array of six; the last three are entries of the tensor, not products of inertia."""

INERTIA_ENTRIES = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
"""Row and column of each of the six."""

EXPLAINED = 0.9
"""Share of a rotation that torque has to explain for its moment of inertia to be identified: two regressions agree to a
tenth then, less than a fifth of the usual gain margin of 6 dB."""

KNOWN = 2.0
"""Ratio of the ends of an interval from which on a moment of inertia, or what is positive like it, is not known."""

FLAT = 0.85
"""Izz over the sum of Ixx and Iyy of a multirotor: 1 for a flat body, and no body has more."""

MEASURED = 1.1
"""What a largest moment may have over the sum of the others: moments are measured, not exact."""

VISIBLE = np.log(1.05)
"""Logarithm of a ratio of moments of inertia that matters."""


def symmetric(parameters: Sequence[float] | Array) -> Array:
    """Build a symmetric matrix from its six parameters.

    Parameters
    ----------
    parameters : array or sequence, shape (6,) or (3,)
        In the order of `INERTIA_PARAMETERS`; off-diagonal entries that are left out are zero.
    """
    matrix = np.zeros((3, 3))
    rows, columns = np.array(INERTIA_ENTRIES[: len(parameters)]).T
    matrix[rows, columns] = matrix[columns, rows] = parameters
    return matrix


def six_parameters(inertia: Sequence[float] | Array) -> Array:
    """Extend three moments of inertia, or six parameters, kg m^2, to six in the order of `INERTIA_PARAMETERS`."""
    parameters = np.zeros(len(INERTIA_PARAMETERS))
    parameters[: len(inertia)] = inertia
    return parameters


def rescaled(inertia: Sequence[float], factors: Array) -> tuple[float, float, float, float, float, float]:
    """Multiply the moments of an inertia by factors, its other entries so that it stays positive definite."""
    roots = np.sqrt(factors)
    rows, columns = np.array(INERTIA_ENTRIES).T
    xx, yy, zz, xy, xz, yz = (six_parameters(inertia) * roots[rows] * roots[columns]).tolist()
    return xx, yy, zz, xy, xz, yz


_ROUNDING = 1e-9
"""Share of a moment of inertia that is rounding."""

_WIDER = 1.25
"""Radius of gyration, in distances of the farthest hub, beyond which is no multirotor: mass all in the hubs gives 1."""


def beyond_any_body(mass: float, hubs: Array, moments: Mapping[str, float]) -> dict[str, float]:
    """Find moments of inertia that no multirotor has, for what it weighs and where its rotors are.

    Parameters
    ----------
    mass : float, kg
    hubs : array, shape (rotor, 3), m
        Relative to the centre of mass.
    moments : mapping of str to float, kg m^2
        By the names of a fit, such as ``inertia.Ixx``; others are left out of account.

    Returns
    -------
    dict of str to float, kg m^2
        By name, the largest that can be.
    """
    squares = np.asarray(hubs) ** 2
    largest = mass * _WIDER**2 * (squares.sum(axis=1, keepdims=True) - squares).max(axis=0)
    limits = dict(zip((f"inertia.{name}" for name in INERTIA_PARAMETERS), largest.tolist(), strict=False))
    return {name: limit for name, limit in limits.items() if moments.get(name, 0.0) > limit}


def more_than_others(moments: Sequence[float] | Array) -> tuple[str, ...]:
    """Name the moments of inertia, of three, that are more than the other two together, which no body has."""
    whole = sum(moments[:3])
    named = zip(INERTIA_PARAMETERS, moments, strict=False)
    return tuple(name for name, moment in list(named)[:3] if moment > MEASURED * (whole - moment))


def nearest_body(inertia: Array, margin: float = 0.0) -> Array:
    """Give the nearest inertia of a body: each principal moment is less, by a margin, than the sum of the others.

    Parameters
    ----------
    inertia : array, shape (3, 3), kg m^2
    margin : float, kg m^2

    Returns
    -------
    array, shape (3, 3), kg m^2
        The very same where a body has it.
    """
    moments, axes = np.linalg.eigh(inertia)
    excess = moments[2] - moments[0] - moments[1] + margin
    if excess <= 0.0:
        return inertia
    # A little more than a third of the excess each, so that rounding brings none of it back.
    third = excess / 3.0 + _ROUNDING * moments[2]
    return np.asarray((axes * (moments + third * np.array([1.0, 1.0, -1.0]))) @ axes.T)


def symmetric_columns(vectors: Array) -> Array:
    """Write ``S v`` with a symmetric S as a matrix times the six elements of S.

    Parameters
    ----------
    vectors : array, shape (time, 3)
        v.

    Returns
    -------
    array, shape (time, 3, 6)
        Multiplies the elements in the order of `INERTIA_PARAMETERS`.
    """
    columns = np.zeros((len(vectors), 3, len(INERTIA_ENTRIES)))
    for parameter, (row, column) in enumerate(INERTIA_ENTRIES):
        columns[:, row, parameter] = vectors[:, column]
        columns[:, column, parameter] = vectors[:, row]
    return columns


def body_torque_columns(body_rate: Array, body_acceleration: Array) -> Array:
    """Write ``I omegad + omega x I omega`` as a matrix times the six elements of the inertia tensor I.

    Parameters
    ----------
    body_rate : array, shape (time, 3), rad/s, body frame
        omega.
    body_acceleration : array, shape (time, 3), rad/s^2, body frame
        omegad.

    Returns
    -------
    array, shape (time, 3, 6), 1/s^2, body frame
        Multiplies (Ixx, Iyy, Izz, Ixy, Ixz, Iyz) in kg m^2 and gives the body torque in N m.

    References
    ----------
    method.md section 2.
    """
    gyroscopic = np.cross(body_rate[:, :, None], symmetric_columns(body_rate), axis=1)
    columns: Array = symmetric_columns(body_acceleration) + gyroscopic
    return columns
