"""What the JSON of a model says of its own numbers: conventions, and how to evaluate it."""

from __future__ import annotations

from cpfls_cli.artifacts.spec import BODY, EULER, WORLD
from cpfls_cli.dynamics.rigid_body import VERTICAL

CONVENTIONS = {
    "q": f"roll, pitch, yaw in rad; {EULER}: R = Rz(yaw) Ry(pitch) Rx(roll) turns body vectors into the world frame",
    "qd": "rates of q, rad/s",
    "qdd": "accelerations of q, rad/s^2",
    "body_frame": f"{BODY}: x forward, y left, z up",
    "world_frame": WORLD,
    "torque": "generalised torque on q, N m: D(q) qdd + C(q, qd) qd",
    "D": "inertia matrix on q, kg m^2, symmetric: fuzzy functions plus W^T I W",
    "C": "Coriolis matrix, kg m^2/s: C_ij = 1/2 sum_k (dD_ij/dq_k + dD_ik/dq_j - dD_jk/dq_i) qd_k",
    "W": "body rates = W qd, W = [[1, 0, -sin p], [0, cos r, sin r cos p], [0, -sin r, cos r cos p]]",
    "body_torque": f"W^-T torque, N m; the Euler angles tell little of it where |cos(pitch)| < {VERTICAL}",
}

HOW_TO_EVALUATE = (
    "Each of fuzzy.functions is the entry of D at [row, column] and at the transposed place: the sum over its rules of "
    "firing * (coefficients of the rule . features); D12 is zero. To D comes W^T I W, I from rigid_body.tensor.",
    "s(q) is the triangle wave with s(0) = 0, s(pi/2) = 1, s(pi) = 0, s(3 pi/2) = -1. With the input map data-range, "
    "x = (s - minimum) / width by fuzzy.inputs is the input of memberships and of seesaw consequents. With "
    "full-circle, memberships take x = (q mod 2 pi) / 2 pi, seesaw consequents take s. Structure fls: q wrapped to "
    "[-pi, pi) in place of s, and with full-circle both inputs are q / 2 pi + 1/2.",
    "Breakpoints b are peaks. Between two, u = (x - b1) / (b2 - b1): the left function falls by 1 - 2 u^2 up to "
    "u = 1/2 and 2 (1 - u)^2 after it, the right one is 1 minus that; x beyond the ends counts as the end. Structure "
    "cpfls: rule 1 fires by the first function plus the last, the others by their own; one function alone fires by 1. "
    "The firing of two inputs is multiplied, the rule index of pitch runs fastest.",
    "Features of one input: 1 and its own, which are the seesaw consequent input, or sin q .. sin nq, cos q .. cos nq "
    "with n = harmonic_order. Of two inputs: 1, those of roll, those of pitch (additive), or all products of (1, "
    "roll's) and (1, pitch's), pitch's running fastest (tensor).",
    "reference_points hold states with the results; their errors compare with scale (of D, C, torque, body torque).",
)

SCORE_UNITS = {"mse": "(N m)^2", "max_error": "N m", "relative_error": "1", "r2": "1", "vaf": "1", "r2_body": "1"}
