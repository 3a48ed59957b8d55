"""The rigid body under the fuzzy inertia functions, linear in its six parameters."""

from __future__ import annotations

from cpfls_cli.arrays import Array
from cpfls_cli.dynamics.rigid_body import rigid_body_regressor
from cpfls_cli.regressor.motion import Motion

RIGID = 6
"""Inertia parameters of a rigid body."""


def rigid_columns(motion: Motion) -> Array:
    """Columns of the six inertia parameters Ixx, Iyy, Izz, Ixy, Ixz, Iyz in the generalised torque.

    Returns
    -------
    array, shape (samples, 3, 6)
    """
    return rigid_body_regressor(motion.attitude, motion.rate, motion.acceleration)
