"""The torque of a rigid body by equations (2) to (4) of the paper, in Euler coordinates throughout."""

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.dynamics import inertia_matrix, inertia_matrix_gradient


def torque(attitude, attitude_rate, attitude_acceleration, inertia):
    """Generalised, ``tau = J qdd + (dJ/dt) qd - 1/2 grad_q (qd^T J qd)``, shape (time, 3), N m."""
    qd = attitude_rate
    dJ = inertia_matrix_gradient(attitude, inertia)
    inertial = rotations.multiply(inertia_matrix(attitude, inertia), attitude_acceleration)
    return inertial + np.einsum("nkij,nk,nj->ni", dJ, qd, qd) - 0.5 * np.einsum("nkij,ni,nj->nk", dJ, qd, qd)
