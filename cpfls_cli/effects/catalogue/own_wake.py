"""Wake of the own rotors: sideways flow carries it over the rear of the vehicle, which loses lift there."""

from collections.abc import Mapping

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.effects import scales
from cpfls_cli.effects.catalogue.vertical_descent import induced_velocity
from cpfls_cli.effects.effect import Coefficient, Columns, Effect
from cpfls_cli.effects.signals import Signals
from cpfls_cli.vehicle.settings import VehicleSettings


def _columns(signals: Signals, _shape: Mapping[str, float]) -> Columns:
    across = signals.air_velocity[:, :2]
    speed = np.linalg.norm(across, axis=1)
    carried = across / np.sqrt(speed**2 + induced_velocity(signals).mean() ** 2)[:, None]
    share = np.linalg.norm(carried, axis=1)
    thrust = signals.wrench[:, 5]
    direct = np.zeros((len(signals), 6, 3))
    direct[:, 5, 0] = -thrust * share
    direct[:, :2, 1] = thrust[:, None] * np.column_stack([carried[:, 1], -carried[:, 0]])
    direct[:, :2, 2] = direct[:, :2, 1] * share[:, None]
    return Columns(direct)


def _lever(linear: Array, error: Array, vehicle: VehicleSettings) -> BoolArray:
    """Check whether the lost lift can have the moment: it acts within the arms."""
    largest = scales.arm(vehicle) * max(float((linear + 2 * error)[0]), 0.0)
    return np.array([True, *(np.abs(linear[1:]) - 2 * error[1:] <= largest)])


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
    columns=_columns,
    lever=_lever,
)
