"""Rotations of many flights at once: components first, flights last."""

from __future__ import annotations

import numpy as np


def stacked(*parts):
    """Stack equal shapes over a new first axis: `np.stack` takes longer to look at few numbers than to copy them."""
    out = np.empty((len(parts), *parts[0].shape))
    for own, part in zip(out, parts, strict=True):
        own[:] = part
    return out


def cross(a, b):
    """Cross product over the first axis."""
    ax, ay, az = a
    bx, by, bz = b
    return stacked(ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx)


def matrix(q):
    """Rotate body to world: quaternion (w, x, y, z), shape (4, flights), to shape (3, 3, flights)."""
    w, x, y, z = q
    out = np.empty((3, 3, q.shape[1]))
    xx, yy, zz = x * x, y * y, z * z
    xy, xz, yz = x * y, x * z, y * z
    wx, wy, wz = w * x, w * y, w * z
    out[0, 0] = 1 - 2 * (yy + zz)
    out[1, 1] = 1 - 2 * (xx + zz)
    out[2, 2] = 1 - 2 * (xx + yy)
    out[0, 1] = 2 * (xy - wz)
    out[1, 0] = 2 * (xy + wz)
    out[0, 2] = 2 * (xz + wy)
    out[2, 0] = 2 * (xz - wy)
    out[1, 2] = 2 * (yz - wx)
    out[2, 1] = 2 * (yz + wx)
    return out


def to_world(R, a):
    """Turn body vectors into the world frame."""
    return np.einsum("ijn,jn->in", R, a)


def to_body(R, a):
    """Turn world vectors into the body frame."""
    return np.einsum("jin,jn->in", R, a)


def quaternion_rate(q, w):
    """Differentiate the quaternion for a body rate."""
    s, x, y, z = q
    p, qq, r = w
    return 0.5 * stacked(
        -x * p - y * qq - z * r, s * p + y * r - z * qq, s * qq + z * p - x * r, s * r + x * qq - y * p
    )


def from_yaw(yaw):
    """Quaternion of a level craft with this yaw."""
    zero = np.zeros_like(yaw)
    return np.stack((np.cos(yaw / 2), zero, zero, np.sin(yaw / 2)))


def euler(q):
    """Roll, pitch and unwrapped yaw (ZYX); time is the last axis of q, shape (4, time)."""
    w, x, y, z = q
    roll = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = np.arcsin(np.clip(2 * (w * y - z * x), -1, 1))
    yaw = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return np.stack((roll, pitch, np.unwrap(yaw)))
