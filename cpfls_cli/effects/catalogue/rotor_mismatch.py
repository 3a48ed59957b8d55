"""Rotors that pull or drag differently from what the model says."""

from collections.abc import Mapping

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.effects.effect import Coefficient, Effect
from cpfls_cli.vehicle.motion import Instant, Numbers, Wrench
from cpfls_cli.vehicle.rotors import gain_modes, opposite_pairs
from cpfls_cli.vehicle.settings import VehicleSettings


def gains(vehicle: VehicleSettings, differences: Array) -> Array:
    """Assign each difference to the weaker rotor of its pair.

    `differences`, shape (2,): the first two coefficients.
    Result: shape (rotor,); relative error of each thrust, at most 0; on vehicles without two opposite pairs, the
    patterns themselves.
    """
    pairs = opposite_pairs(vehicle)
    patterns = gain_modes(vehicle) @ differences
    if len(pairs) != 2 or len(vehicle.rotors) != 4:
        return np.asarray(patterns)
    loss = np.zeros(len(vehicle.rotors))
    for pair, difference in zip(pairs, differences, strict=True):
        loss[pair[0] if difference < 0 else pair[1]] = -abs(difference)
    return loss


def _describe(vehicle: VehicleSettings, values: Mapping[str, float]) -> str:
    """Name the weak rotor; a strong opposite one looks the same."""
    differences = np.array([values.get(f"difference_{mode}", 0.0) for mode in (1, 2)])
    loss = gains(vehicle, differences).tolist()
    other = {rotor: pair[1 - pair.index(rotor)] for pair in opposite_pairs(vehicle) for rotor in pair}
    if len(other) != len(loss):
        weak = loss.index(min(loss))
        return f"M{weak + 1} pulls least, {-100 * loss[weak]:.2g} % less than modelled." if any(loss) else ""
    return " ".join(
        f"M{weak + 1} pulls {-100 * loss[weak]:.2g} % less than modelled, or M{other[weak] + 1} as much more."
        for weak in range(len(loss))
        if loss[weak] < 0
    )


def _accounts(_number: str, values: Mapping[str, float]) -> float:
    return sum(abs(value) for name, value in values.items() if name.startswith("difference"))


def _acts(see: Instant, p: Numbers) -> Wrench:
    functions, drag = see.functions, see.rotor_drag
    first, second = (functions.rotors(mode) for mode in gain_modes(see.vehicle).T.tolist())
    gain = first * p["difference_1"] + second * p["difference_2"]
    # A propeller that pulls less drags less.
    yaw = functions.total(drag * (p["drag_imbalance"] - see.spins * gain))
    # What one spin has more than the other scales roll and pitch torque like a wrong inertia: only the force shows it.
    lift = p["lift_imbalance"] * functions.total(see.spins * see.rotor_thrust)
    return Wrench((0, 0, yaw), (0, 0, lift), at_hubs=(0, 0, gain * see.rotor_thrust))


EFFECT = Effect(
    name="rotor_mismatch",
    order=200,
    title="rotors that differ",
    quantity="scales",
    kind="wrench",
    formula="dT_i = kappa_i T_i,  M = sum r_i x dT_i z,  M_z += sum (delta - s_i kappa_i) b_i w_i^2",
    sentence="One rotor pulls less than its opposite: a worn propeller, a weak motor.",
    coefficients=(
        Coefficient(
            "difference_1",
            "1",
            -0.5,
            0.5,
            "share of thrust that the first rotor of the first opposite pair pulls more than the other",
        ),
        Coefficient("difference_2", "1", -0.5, 0.5, "the same of the second opposite pair"),
        Coefficient(
            "drag_imbalance", "1", -0.5, 0.5, "clockwise rotors drag this much more than modelled, the others less"
        ),
        Coefficient(
            "lift_imbalance",
            "1",
            -0.25,
            0.25,
            "counter-clockwise rotors pull this much more, the others less; force only",
        ),
    ),
    needs=frozenset({"rotor_speed"}),
    excitation="yaw effort to both sides, and changes of thrust",
    rivals={
        "com_offset": "apply yaw effort: it loads one pair of rotors more than the other",
        "torque_bias": "change the thrust and apply yaw effort",
        "parameter_error": "apply yaw effort at constant roll and pitch",
    },
    source="rotor by rotor thrust factors in quad_race_env (tudelft) and SkyFlow",
    describe=_describe,
    accounts=_accounts,
    acts=_acts,
)
