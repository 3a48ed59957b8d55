"""Wake of the own rotors: sideways flow carries it over the rear of the vehicle, which loses lift there."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.effects import scales
from cpfls_cli.effects.catalogue.vertical_descent import induced_velocity
from cpfls_cli.effects.effect import Coefficient, Effect
from cpfls_cli.vehicle.motion import Instant, Numbers, Wrench
from cpfls_cli.vehicle.settings import VehicleSettings


def _lever(linear: Array, error: Array, vehicle: VehicleSettings) -> BoolArray:
    """Check whether the lost lift can have the moment: it acts within the arms."""
    largest = scales.arm(vehicle) * max(float((linear + 2 * error)[0]), 0.0)
    return np.array([True, *(np.abs(linear[1:]) - 2 * error[1:] <= largest)])


def _acts(see: Instant, p: Numbers) -> Wrench:
    x, y, _ = see.air_velocity
    square, rotors = x**2 + y**2, len(see.vehicle.rotors)
    down = see.functions.total(induced_velocity(see)) / rotors
    whole = see.functions.sqrt(square + down**2)
    share = see.functions.sqrt(square) / whole
    moment = (p["c_M"] + p["c_B"] * share) * see.thrust / whole
    return Wrench((moment * y, -moment * x, 0), (0, 0, -p["c_F"] * see.thrust * share))


EFFECT = Effect(
    name="own_wake",
    order=55,
    title="wake of its own rotors on rear rotors and body",
    kind="wrench",
    formula="F_z = -c_F T sin X,  M = (c_M + c_B sin X) T sin X (u_y, -u_x, 0)/|u|,  tan X = |u|/v_i, "
    "v_i = sqrt(T_h/(2 rho pi R^2))",
    sentence="In forward flight the wake of the front rotors is carried over the rear ones and the body, which lose "
    "lift: the nose rises.",
    coefficients=(
        Coefficient("c_F", "1", 0.0, 0.3, "share of the thrust that is lost in fast flight"),
        Coefficient("c_M", "m", 0.0, 0.3, "moment per thrust in fast flight, of rotors in the wake", scales.arm),
        Coefficient("c_B", "m", 0.0, 0.3, "the same of the body, over which the wake moves with the speed", scales.arm),
    ),
    needs=frozenset({"velocity", "rotor_speed", "rotor_radius"}),
    excitation="level legs at two speeds, one twice the other, forward and sideways",
    rivals={
        "flapping_moment": "log acceleration, and fly legs at two speeds above that of the wake: its moment stays, "
        "that of the hubs keeps growing",
        "rotor_drag": "log acceleration: the wake takes lift, the drag acts against the motion",
        "parasitic_drag": "log acceleration, and fly legs at two speeds, one twice the other",
        "rolling_moment": "fly forward and sideways: the wake lifts the side that is ahead",
    },
    source="skewed wake of momentum theory (Leishman, Principles of Helicopter Aerodynamics, section 3.5)",
    lever=_lever,
    acts=_acts,
)
