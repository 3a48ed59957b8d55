"""A rigid body in Euler coordinates (intrinsic ZYX): inertia matrix, torque, regressor, possible inertias."""

from __future__ import annotations

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.inertia import MEASURED, body_torque_columns, symmetric
from cpfls_cli.regressor.motion import Motion
from cpfls_cli.vehicle.settings import VehicleSettings

VERTICAL = 0.1
"""|cos(pitch)| below which the nose points up or down, so that Euler angles hardly determine the body's axes."""

# Shares of the largest eigenvalue. Near a vertical pitch a body's own smallest one is not larger than the second.
_ROUNDING, _VERTICAL_ROUNDING = 1e-9, 0.01


def inertia_tensor(vehicle: VehicleSettings) -> Array:
    """Build the inertia tensor of a vehicle, shape (3, 3), kg m^2, body frame."""
    return symmetric(vehicle.inertia_kg_m2)


def inertia_matrix(attitude: Array, inertia: Array) -> Array:
    """Transform the inertia tensor to the Euler coordinates, ``J = W^T I W``.

    Parameters
    ----------
    attitude : array, shape (time, 3), rad
    inertia : array, shape (3, 3), kg m^2, body frame

    Returns
    -------
    array, shape (time, 3, 3), kg m^2

    References
    ----------
    Equations (14) and (15) of the paper for a diagonal tensor; method.md section 2.
    """
    W = rotations.euler_rate_matrix(attitude)
    matrix: Array = W.swapaxes(1, 2) @ inertia @ W
    return matrix


def inertia_matrix_gradient(attitude: Array, inertia: Array) -> Array:
    """Differentiate J by each Euler angle, ``dJ/dq_k = (dW/dq_k)^T I W + W^T I (dW/dq_k)``.

    Parameters
    ----------
    attitude : array, shape (time, 3), rad
    inertia : array, shape (3, 3), kg m^2, body frame

    Returns
    -------
    array, shape (time, 3, 3, 3), kg m^2/rad
        Entry [n, k, i, j] is dJ_ij/dq_k at sample n.
    """
    W = rotations.euler_rate_matrix(attitude)
    # The gradient by one angle is the derivative along a motion of unit rate in that angle alone.
    unit_rates = np.broadcast_to(np.eye(3)[:, None], (3, *attitude.shape))
    dW = np.ascontiguousarray(rotations.euler_rate_matrix_derivative(attitude, unit_rates).swapaxes(0, 1))
    half = dW.swapaxes(2, 3) @ inertia @ W[:, None]
    gradient: Array = half + half.swapaxes(2, 3)
    return gradient


def newton_euler_torque(attitude: Array, attitude_rate: Array, attitude_acceleration: Array, inertia: Array) -> Array:
    """Compute the generalised torque, N m, from the body rates, ``tau = W^T (I omegad + omega x I omega)``.

    It is on the Euler coordinates; `rotations.body_torque` turns it into the body's. Equations (2) to (4) of the paper
    give the same; method.md section 2.
    """
    body = body_torque(attitude, attitude_rate, attitude_acceleration, inertia)
    return rotations.generalised_torque(attitude, body)


def body_torque(attitude: Array, attitude_rate: Array, attitude_acceleration: Array, inertia: Array) -> Array:
    """Compute the torque about the body axes, ``I omegad + omega x I omega``, of what `newton_euler_torque` takes.

    Returns
    -------
    array, shape (time, 3), N m, body frame
        Finite at every attitude, also where the pitch is +-90 degrees and J(q) is singular.

    References
    ----------
    method.md section 2.
    """
    omega = rotations.body_rate(attitude, attitude_rate)
    alpha = rotations.body_acceleration(attitude, attitude_rate, attitude_acceleration)
    return np.asarray(alpha @ inertia.T + rotations.cross(omega, omega @ inertia.T))


def rigid_columns(motion: Motion) -> Array:
    """Write the generalised torque as a matrix times the six elements of the inertia tensor.

    Returns
    -------
    array, shape (samples, 3, 6)
        Multiplies (Ixx, Iyy, Izz, Ixy, Ixz, Iyz) in kg m^2 and gives N m.
    """
    omega = rotations.body_rate(motion.attitude, motion.rate)
    alpha = rotations.body_acceleration(motion.attitude, motion.rate, motion.acceleration)
    W = rotations.euler_rate_matrix(motion.attitude)
    columns: Array = W.swapaxes(1, 2) @ body_torque_columns(omega, alpha)
    return columns


def vertical(attitude: Array) -> BoolArray:
    """Flag attitudes near a pitch of +-90 degrees, where the inertia matrix of every body is all but singular.

    Parameters
    ----------
    attitude : array, shape (samples, 3), rad
    """
    return np.asarray(np.abs(np.cos(attitude[:, 1])) < VERTICAL)


def not_positive_definite(matrices: Array, attitude: Array) -> BoolArray:
    """Flag inertia matrices that are not positive definite, with a tolerance near a vertical pitch.

    Parameters
    ----------
    matrices : array, shape (samples, 3, 3), kg m^2
    attitude : array, shape (samples, 3), rad
    """
    eigenvalues = np.linalg.eigvalsh(matrices)
    tolerance = np.where(vertical(attitude), _VERTICAL_ROUNDING, _ROUNDING)
    return np.asarray(eigenvalues[:, 0] < -tolerance * np.abs(eigenvalues).max(axis=1, initial=0.0))


def positive_definite(matrices: Array) -> BoolArray:
    """Flag finite matrices that are positive definite, by leading minors (Sylvester): ten times as fast as eigenvalues.

    Parameters
    ----------
    matrices : array, shape (samples, 3, 3)
    """
    first, minor = matrices[:, 0, 0], matrices[:, 0, 0] * matrices[:, 1, 1] - matrices[:, 0, 1] ** 2
    finite = np.asarray(np.isfinite(matrices).all(axis=(1, 2)), dtype=bool)
    whole = np.linalg.det(np.where(finite[:, None, None], matrices, 0.0))
    return np.asarray(finite & (first > 0) & (minor > 0) & (whole > 0))


def why_unphysical(inertia: Array) -> str | None:
    """Explain why six inertia parameters cannot be those of a body; None for a possible one.

    Parameters
    ----------
    inertia : array, shape (6,), kg m^2
        Ixx, Iyy, Izz, Ixy, Ixz, Iyz.
    """
    smallest, middle, largest = np.linalg.eigvalsh(symmetric(inertia))
    moments = f"principal moments {smallest:.3g} {middle:.3g} {largest:.3g} kg m^2"
    if smallest < 0 or largest == 0:
        return f"is not positive definite ({moments})"
    # Measured moments of a flat body exceed the limit by noise alone.
    if largest > MEASURED * (smallest + middle):
        return f"breaks the triangle inequality ({moments})"
    return None
