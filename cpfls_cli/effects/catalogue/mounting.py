"""An autopilot mounted askew: its sensors have other axes than the airframe with its rotors."""

from __future__ import annotations

from collections.abc import Mapping
from math import degrees

from cpfls_cli.effects.effect import Effect, of_axes
from cpfls_cli.inertia import symmetric
from cpfls_cli.vehicle.motion import Instant, Numbers, Wrench
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.vehicle.values import add, apply, cross, subtract


def _acts(see: Instant, p: Numbers) -> Wrench:
    turn, rate = tuple(p[f"theta_{axis}"] for axis in "xyz"), see.body_rate
    inertia = symmetric(see.vehicle.inertia_kg_m2).tolist()
    # -dI omega with dI = [theta]x I - I [theta]x, the inertia as the turned axes have it.
    momentum = subtract(apply(inertia, cross(turn, rate)), cross(turn, apply(inertia, rate)))
    torque = add(cross(turn, see.rotor_torque), cross(rate, momentum))
    return Wrench(torque, cross(turn, (0, 0, see.thrust)), momentum=momentum)


def _describe(_vehicle: VehicleSettings, values: Mapping[str, float]) -> str:
    turns = ", ".join(f"{degrees(value):+.1f} deg about {name[-1]}" for name, value in values.items())
    return f"Seen from the autopilot the airframe is turned, {turns}." if turns else ""


EFFECT = Effect(
    name="mounting",
    order=195,
    title="askew mounting of the autopilot",
    kind="wrench",
    formula="F = theta x (0, 0, T),  M = theta x M_rotors - (d/dt (dI omega) + omega x dI omega),"
    "  dI = [theta]x I - I [theta]x",
    sentence="The autopilot is mounted askew, so its accelerometer and gyroscope have other axes than the rotors.",
    coefficients=of_axes("theta_{}", "rad", -0.2, 0.2, "turn of the airframe about {} of the autopilot"),
    needs=frozenset({"force"}),
    excitation="climbs and descents, with yaw turns, roll and pitch",
    rivals={
        "products_of_inertia": "log the force: products of inertia leave it alone",
        "wind": "turn in yaw: what is askew turns with the vehicle, the wind does not",
        "torque_bias": "log the force: a constant torque leaves it alone",
    },
    source="first order of a rotation of Newton-Euler equations; PX4 SENS_BOARD_X_OFF, ArduPilot AHRS_TRIM_X",
    rate_derivative=True,
    describe=_describe,
    acts=_acts,
)
