"""Wrong numbers of the vehicle: moments of inertia and scale of the thrust."""

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.effects import scales
from cpfls_cli.effects.effect import Coefficient, Columns, Effect, of_axes
from cpfls_cli.effects.hooks import SensorLog, TrueMotion
from cpfls_cli.effects.signals import Signals
from cpfls_cli.vehicle.motion import Instant, Numbers, Wrench
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.vehicle.values import add, cross

_THRUST_SCALE = 6  # Places among the coefficients.
# A tenth and four times of what is stated: farther off the number was not measured but mistyped.
_BOUNDS = (-0.9, 3.0)
_COUPLED = (
    "coupling of the two other rates beyond that of the moments of inertia, which a wrong scale of the rotor torque"
    " leaves"
)
_MEASURED = "where acceleration or velocity is measured, relative to the centre of mass; seen in force only"
_MEASURING_POINT = ("reference_x", "reference_y", "reference_z")
NUMBERS = {
    "inertia_x": "the inertia about x",
    "inertia_y": "the inertia about y",
    "inertia_z": "the inertia about z",
    "thrust_scale": "the thrust",
}
"""Coefficients that are numbers of the config, in words."""


def inertia_correction(values: Array, vehicle: VehicleSettings) -> Array:
    """Compute what relative errors add to the inertia tensor, shape (3, 3), kg m^2.

    `values`, shape (10,): the coefficients.
    """
    return np.diag(values[:3] * np.array(vehicle.inertia_kg_m2[:3]))


def shown(turns: BoolArray) -> Array:
    """Mark the coefficients that a flight can show: inertia and coupling only about axes that turn.

    `turns`, shape (3,): whether the vehicle turns about x, y, z; Result: shape (10,); 1 or 0.
    """
    return np.concatenate([turns, turns, np.ones(4)]).astype(float)


class Change(NamedTuple):
    """Coefficients as ``offset + matrix @ u``, with bounds of u that hold for every vehicle."""

    offset: Array  # Shape (10,).
    matrix: Array  # Shape (10, 10): columns of numbers that stay as they are, are zero.
    low: Array  # Shape (10,).
    high: Array  # Shape (10,).


def physical(vehicle: VehicleSettings, shown: BoolArray, least: BoolArray) -> Change:
    """Write the coefficients by numbers whose bounds no vehicle exceeds.

    Two moments of inertia differ by no more than the third, so a coupling C by axis, of moments of inertia M, has
    ``M + C`` and ``M - C``, both of which are above zero. Rates show either by the scale of the rotor torque about this
    axis alone, so the bounds hold axis by axis.

    `shown`, shape (3,): axes whose inertia the flights show.
    `least`, shape (3,): axes that are held at the least inertia, without coupling.
    """
    moments = np.array(vehicle.inertia_kg_m2[:3])
    moved = shown & ~least
    offset, matrix = np.zeros(10), np.zeros((10, 10))
    offset[:3] = np.where(moved, -1.0, np.where(shown, _BOUNDS[0], 0.0))
    matrix[:3, :6] = 0.5 * moved[:, None] * np.tile(np.eye(3), 2)
    for axis in np.flatnonzero(shown):
        after, later = (axis + 1) % 3, (axis + 2) % 3
        mean = 0.5 * (moments[after] + moments[later])
        offset[3 + axis] = (moments[after] * (1 + offset[after]) - moments[later] * (1 + offset[later])) / mean
        matrix[3 + axis] = (moments[after] * matrix[after] - moments[later] * matrix[later]) / mean
        if moved[axis]:
            matrix[3 + axis, [axis, 3 + axis]] += np.array([0.5, -0.5]) * moments[axis] / mean
    matrix[6:, 6:] = np.eye(4)
    bounds = np.array([known.bounds(vehicle) for known in EFFECT.coefficients])
    bounds[:6] = 0.0, 1 + _BOUNDS[1]
    return Change(offset, matrix, *bounds.T)


def too_light(values: Array) -> BoolArray:
    """Mark axes whose inertia is below the least, shape (3,)."""
    return np.asarray(values[:3] < _BOUNDS[0])


def _columns(signals: Signals, _shape: Mapping[str, float]) -> Columns:
    moments = np.array(signals.vehicle.inertia_kg_m2[:3])
    rate, turning = signals.body_rate, moments * signals.body_rate
    # omega x each axis, in columns.
    before = rotations.cross(rate[:, None], np.eye(3)).swapaxes(1, 2)
    momentum = np.zeros((len(signals), 6, 10))
    direct = np.zeros_like(momentum)
    momentum[:, [0, 1, 2], [0, 1, 2]] = -turning
    direct[:, :3, :3] = -before * turning[:, None]
    after, later = [1, 2, 0], [2, 0, 1]
    coupling = 0.5 * (moments[after] + moments[later]) * rate[:, after] * rate[:, later]
    direct[:, [0, 1, 2], [3, 4, 5]] = -coupling
    direct[:, 5, _THRUST_SCALE] = signals.wrench[:, 5]
    # A point at r moves with omega' x r + omega x (omega x r) beyond the centre of mass.
    momentum[:, 3:, 7:] = signals.vehicle.mass_kg * before
    twice = rate[:, :, None] * rate[:, None] - (rate**2).sum(axis=1)[:, None, None] * np.eye(3)
    direct[:, 3:, 7:] = signals.vehicle.mass_kg * twice
    return Columns(direct, momentum)


def with_thrust(rows: Array, thrust: Array) -> Array:
    """Exchange the thrust in averaged columns, shape (window, 6, 10), for another one in N, shape (window,)."""
    rows = rows.copy()
    rows[:, 5, _THRUST_SCALE] = thrust
    return rows


def _log(signals: Mapping[str, Array], motion: TrueMotion, values: Mapping[str, float]) -> dict[str, Array]:
    """Log position, velocity and acceleration of a point of the body, ``v + omega x r`` and so on."""
    point = np.array([values.get(name, 0.0) for name in _MEASURING_POINT])
    moving = np.cross(motion.body_rate, point)
    turning = np.cross(motion.body_acceleration, point) + np.cross(motion.body_rate, moving)
    added = {"position": np.tile(point, (len(moving), 1)), "velocity": moving, "acceleration": turning}
    return {name: signals[name] + rotations.multiply(motion.rotation, more) for name, more in added.items()}


def _describe(vehicle: VehicleSettings, values: Mapping[str, float]) -> str:
    """Say which mass does the same as a scale of the thrust: acceleration shows the ratio of the two alone."""
    scale = 1 + values.get("thrust_scale", -1.0)
    if scale <= 0:
        return ""
    mass = vehicle.mass_kg / scale
    return f"A mass of {mass:.3g} kg instead, {mass - vehicle.mass_kg:+.2g} kg, would do the same."


def _acts(see: Instant, p: Numbers) -> Wrench:
    moments, rate = see.vehicle.inertia_kg_m2[:3], see.body_rate
    turned = tuple(-p[f"inertia_{axis}"] * own * each for axis, own, each in zip("xyz", moments, rate, strict=True))
    (x, y, z), (p_x, p_y, p_z) = moments, rate
    means = 0.5 * (y + z) * p_y * p_z, 0.5 * (z + x) * p_z * p_x, 0.5 * (x + y) * p_x * p_y
    coupled = tuple(-p[f"coupling_{axis}"] * each for axis, each in zip("xyz", means, strict=True))
    force = (0, 0, p["thrust_scale"] * see.thrust)
    return Wrench(add(coupled, cross(rate, turned)), force, momentum=turned)


EFFECT = Effect(
    name="parameter_error",
    order=280,
    title="wrong inertia or thrust scale",
    quantity="scales",
    kind="parameter",
    formula="M = -(d/dt (dI omega) + omega x dI omega) - g_i I omega_j omega_k,  dI = diag(e_i I_ii);  F_z = e_T T",
    sentence="The vehicle is as modelled, but one of its numbers is wrong. Rates and rotor speeds show only the ratio "
    "of inertia to rotor torque; the force balance shows the scale of the thrust.",
    coefficients=(
        *of_axes("inertia_{}", "1", *_BOUNDS, "true I{0}{0} over that of the model, less 1"),
        *of_axes("coupling_{}", "1", -3.0, 3.0, _COUPLED),
        Coefficient("thrust_scale", "1", *_BOUNDS, "true thrust over that of the model, less 1; seen in force only"),
        *(replace(each, of_log=True) for each in of_axes("reference_{}", "m", -1.0, 1.0, _MEASURED, scales.arm)),
    ),
    needs=frozenset({"torque"}),
    excitation="roll, pitch and yaw sweeps; hover, with a known mass, for the thrust",
    rivals={
        "battery_sag": "compare the start with the end of a flight: a wrong parameter stays",
        "gyro_scale": "compare the gyro with the attitude: a wrong inertia leaves them equal",
        "rotor_mismatch": "apply yaw effort at constant roll and pitch",
        "rotor_acceleration": "compare slow with fast yaw: a wrong Izz acts in both",
        "motor_lag": "compare slow with fast torque: a wrong inertia acts in both",
        "thrust_slope": "roll and pitch at little and at much thrust: a wrong inertia stays",
        "payload": "accelerate and stop, then wait for some swings: a wrong mass, or thrust, does not swing",
    },
    source="Newton-Euler equations",
    columns=_columns,
    log=SensorLog(change=_log),
    acts=_acts,
    describe=_describe,
)
