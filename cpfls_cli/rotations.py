"""Attitude kinematics: Euler angles roll, pitch, yaw (intrinsic ZYX), body frame FLU, world frame z up."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import Array


def rotation_matrix(attitude: Array) -> Array:
    """Rotate body vectors into the world frame, ``R = Rz(yaw) Ry(pitch) Rx(roll)``.

    Parameters
    ----------
    attitude : array, shape (time, 3), rad
        Roll, pitch and yaw.

    Returns
    -------
    array, shape (time, 3, 3)
        ``v_world = R @ v_body``.
    """
    (sr, cr), (sp, cp), (sy, cy) = ((np.sin(a), np.cos(a)) for a in attitude.T)
    rows = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
    return np.array(rows).transpose(2, 0, 1)


def cross(first: Array, second: Array) -> Array:
    """Compute the cross product along the last axis.

    Parameters
    ----------
    first, second : array, shape (..., 3)
        Of shapes that broadcast.

    Returns
    -------
    array, shape (..., 3)
    """
    (a, b, c), (u, v, w) = ((each[..., 0], each[..., 1], each[..., 2]) for each in (first, second))
    along = b * w - c * v
    product = np.empty((*along.shape, 3))
    product[..., 0] = along
    product[..., 1] = c * u - a * w
    product[..., 2] = a * v - b * u
    return product


def euler_angles(rotation: Array) -> Array:
    """Extract roll, pitch and yaw from rotation matrices.

    Parameters
    ----------
    rotation : array, shape (time, 3, 3)
        Body to world, ``Rz(yaw) Ry(pitch) Rx(roll)``.

    Returns
    -------
    array, shape (time, 3), rad
    """
    roll = np.arctan2(rotation[:, 2, 1], rotation[:, 2, 2])
    pitch = np.arctan2(-rotation[:, 2, 0], np.hypot(rotation[:, 2, 1], rotation[:, 2, 2]))
    return np.stack([roll, pitch, np.arctan2(rotation[:, 1, 0], rotation[:, 0, 0])], axis=1)


def euler_rate_matrix(attitude: Array) -> Array:
    """Build the matrix that maps Euler rates to body rates, ``omega = W(q) qd``.

    Parameters
    ----------
    attitude : array, shape (time, 3), rad

    Returns
    -------
    array, shape (time, 3, 3)
        W, singular where the pitch is +-90 degrees.
    """
    (sr, cr), (sp, cp) = ((np.sin(a), np.cos(a)) for a in attitude.T[:2])
    W = np.zeros((len(attitude), 3, 3))
    W[:, 0, 0] = 1.0
    W[:, 0, 2] = -sp
    W[:, 1, 1] = cr
    W[:, 1, 2] = sr * cp
    W[:, 2, 1] = -sr
    W[:, 2, 2] = cr * cp
    return W


def euler_rate_matrix_derivative(attitude: Array, attitude_rate: Array) -> Array:
    """Differentiate W(q) along the motion.

    Parameters
    ----------
    attitude : array, shape (time, 3), rad
    attitude_rate : array, shape (..., time, 3), rad/s

    Returns
    -------
    array, shape (..., time, 3, 3), 1/s
        dW/dt.
    """
    (sr, cr), (sp, cp) = ((np.sin(a), np.cos(a)) for a in attitude.T[:2])
    roll_rate, pitch_rate = attitude_rate[..., 0], attitude_rate[..., 1]
    dW = np.zeros((*roll_rate.shape, 3, 3))
    dW[..., 0, 2] = -cp * pitch_rate
    dW[..., 1, 1] = -sr * roll_rate
    dW[..., 1, 2] = cr * cp * roll_rate - sr * sp * pitch_rate
    dW[..., 2, 1] = -cr * roll_rate
    dW[..., 2, 2] = -sr * cp * roll_rate - cr * sp * pitch_rate
    return dW


def body_rate(attitude: Array, attitude_rate: Array) -> Array:
    """Convert Euler rates to body rates.

    Parameters
    ----------
    attitude : array, shape (time, 3), rad
    attitude_rate : array, shape (time, 3), rad/s

    Returns
    -------
    array, shape (time, 3), rad/s, body frame
    """
    return multiply(euler_rate_matrix(attitude), attitude_rate)


def body_acceleration(attitude: Array, attitude_rate: Array, attitude_acceleration: Array) -> Array:
    """Convert Euler accelerations to the derivative of the body rates, ``W qdd + (dW/dt) qd``.

    Parameters
    ----------
    attitude, attitude_rate, attitude_acceleration : array, shape (time, 3), rad, rad/s, rad/s^2

    Returns
    -------
    array, shape (time, 3), rad/s^2, body frame
    """
    turning = multiply(euler_rate_matrix_derivative(attitude, attitude_rate), attitude_rate)
    return multiply(euler_rate_matrix(attitude), attitude_acceleration) + turning


def attitude_rate(attitude: Array, body_rate: Array) -> Array:
    """Convert body rates to Euler rates, ``qd = W(q)^-1 omega``.

    Parameters
    ----------
    attitude : array, shape (time, 3), rad
    body_rate : array, shape (..., time, 3), rad/s, body frame

    Returns
    -------
    array, shape (..., time, 3), rad/s
        Not finite where the pitch is exactly +-90 degrees.
    """
    (sr, cr), (sp, cp) = ((np.sin(a), np.cos(a)) for a in attitude.T[:2])
    p, q, r = (body_rate[..., axis] for axis in range(3))
    with np.errstate(divide="ignore", invalid="ignore"):
        yaw_rate = (sr * q + cr * r) / cp
        return np.stack([p + sp * yaw_rate, cr * q - sr * r, yaw_rate], axis=-1)


def attitude_acceleration(attitude: Array, body_rate: Array, body_acceleration: Array) -> Array:
    """Convert the derivative of the body rates to Euler accelerations, ``W^-1 (omegad - (dW/dt) qd)``.

    Parameters
    ----------
    attitude : array, shape (time, 3), rad
    body_rate, body_acceleration : array, shape (time, 3), rad/s and rad/s^2, body frame

    Returns
    -------
    array, shape (time, 3), rad/s^2
        Not finite where the pitch is exactly +-90 degrees.
    """
    rate = attitude_rate(attitude, body_rate)
    turning = multiply(euler_rate_matrix_derivative(attitude, rate), rate)
    return attitude_rate(attitude, body_acceleration - turning)


def generalised_torque(attitude: Array, body_torque: Array) -> Array:
    """Convert a body torque to the generalised torque on the Euler coordinates, ``tau = W^T tau_body``.

    Parameters
    ----------
    attitude : array, shape (time, 3), rad
    body_torque : array, shape (time, 3), N m, body frame

    Returns
    -------
    array, shape (time, 3), N m
    """
    return multiply(euler_rate_matrix(attitude).swapaxes(1, 2), body_torque)


def body_torque(attitude: Array, torque: Array) -> Array:
    """Convert a generalised torque on the Euler coordinates to the body torque, ``W^-T tau``.

    Parameters
    ----------
    attitude : array, shape (time, 3), rad
    torque : array, shape (time, 3), N m

    Returns
    -------
    array, shape (time, 3), N m, body frame
        Not finite where the pitch is exactly +-90 degrees.
    """
    (sr, cr), (sp, cp) = ((np.sin(a), np.cos(a)) for a in attitude.T[:2])
    t1, t2, t3 = torque.T
    with np.errstate(divide="ignore", invalid="ignore"):
        along = (t3 + sp * t1) / cp
    return np.column_stack([t1, cr * t2 + sr * along, -sr * t2 + cr * along])


def multiply(matrices: Array, vectors: Array) -> Array:
    """Multiply a matrix with a vector at every sample.

    Parameters
    ----------
    matrices : array, shape (time, 3, 3)
    vectors : array, shape (time, 3)

    Returns
    -------
    array, shape (time, 3)
    """
    product: Array = np.einsum("nij,nj->ni", matrices, vectors)
    return product


def wrapped(angle: Array) -> Array:
    """Wrap angles of any shape, rad, to [-pi, pi)."""
    return np.asarray(np.mod(angle + np.pi, 2 * np.pi) - np.pi, dtype=float)
