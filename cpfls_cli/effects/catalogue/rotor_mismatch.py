"""Rotors that pull or drag differently from what the model says."""

from collections.abc import Mapping

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.effects.effect import Coefficient, Effect
from cpfls_cli.rounding import largest
from cpfls_cli.vehicle.motion import Instant, Numbers, Wrench
from cpfls_cli.vehicle.rotors import gain_modes, opposite_pairs
from cpfls_cli.vehicle.settings import VehicleSettings

_DIFFERENCES = ("difference_1", "difference_2", "difference_3", "difference_4")


def gains(vehicle: VehicleSettings, differences: Array) -> Array:
    """Say which rotors pull less, or more, where as few as possible differ.

    Of a quadrotor it is the weaker rotor of each pair; of another vehicle the one that alone comes nearest.

    `differences`, shape (pattern,): of the patterns of `gain_modes`.
    Result: shape (rotor,); relative error of each thrust.
    """
    pairs, modes = opposite_pairs(vehicle), gain_modes(vehicle)
    found = np.zeros(len(vehicle.rotors))
    if len(pairs) == 2 and len(found) == 4:
        for pair, difference in zip(pairs, differences, strict=True):
            found[pair[0] if difference < 0 else pair[1]] = -abs(difference)
        return found
    pattern, of_one = modes @ differences, np.maximum(np.diag(_shown(vehicle)), 1e-9)
    # Of two that come as near the weak one.
    rotors = sorted(range(len(found)), key=lambda rotor: pattern[rotor] > 0)
    nearest = largest(rotors, lambda rotor: pattern[rotor] ** 2 / of_one[rotor])
    found[nearest] = pattern[nearest] / of_one[nearest]
    return found


def _shown(vehicle: VehicleSettings) -> Array:
    """Compute what the patterns show of one rotor that differs by 1, shape (rotor, rotor that differs)."""
    modes = gain_modes(vehicle)
    return np.asarray(modes @ np.linalg.pinv(modes))


def _describe(vehicle: VehicleSettings, values: Mapping[str, float]) -> str:
    """Name the weak rotor, and the strong one that looks the same."""
    shown, count = _shown(vehicle), gain_modes(vehicle).shape[1]
    off = gains(vehicle, np.array([values.get(name, 0.0) for name in _DIFFERENCES[:count]])).tolist()
    sentences = []
    for rotor, own in enumerate(off):
        alike = np.flatnonzero(np.abs(shown + shown[:, [rotor]]).max(axis=0) < 1e-6).tolist()
        less, more = ("less", "more") if own < 0 else ("more", "less")
        mirrored = "".join(f", or M{other + 1} as much {more}" for other in alike)
        sentences += [f"M{rotor + 1} pulls {abs(100 * own):.2g} % {less} than modelled{mirrored}."] if own else []
    pairs = len(off) == 4 and len(opposite_pairs(vehicle)) == 2
    return " ".join(sentences if pairs else (f"If one rotor alone differs: {each}" for each in sentences))


def _accounts(_number: str, values: Mapping[str, float], _vehicle: VehicleSettings) -> float:
    return sum(abs(value) for name, value in values.items() if name.startswith("difference"))


def _across(vehicle: VehicleSettings) -> Array:
    """Compute the arms about x and y of the thrust that one spin has more than the other, shape (2, rotor), m.

    Of an X each spin is on a diagonal: what it has more turns roll into pitch. A part along all arms about an axis
    scales the torque about it as a wrong inertia does, and is left out: of a plus nothing else is there.
    """
    x, y, _ = np.array([rotor.position_m for rotor in vehicle.rotors]).T
    spins = np.array([float(rotor.spin) for rotor in vehicle.rotors])
    arms = np.array([y, -x])
    own = (spins * arms**2).sum(axis=1) / np.maximum((arms**2).sum(axis=1), np.finfo(float).tiny)
    across = spins * arms - own[:, None] * arms
    return np.where(np.abs(across) > 1e-9 * np.abs(arms).max(), across, 0.0)


def _acts(see: Instant, p: Numbers) -> Wrench:
    functions, drag = see.functions, see.rotor_drag
    modes = (functions.rotors(mode) for mode in gain_modes(see.vehicle).T.tolist())
    gain = sum(mode * p[name] for mode, name in zip(modes, _DIFFERENCES, strict=False))
    # A propeller that pulls less drags less.
    yaw = functions.total(drag * (p["drag_imbalance"] - see.spins * gain))
    lift = p["lift_imbalance"] * functions.total(see.spins * see.rotor_thrust)
    roll, pitch = (
        p["lift_imbalance"] * functions.total(functions.rotors(arms) * see.rotor_thrust)
        for arms in _across(see.vehicle).tolist()
    )
    return Wrench((roll, pitch, yaw), (0, 0, lift), at_hubs=(0, 0, gain * see.rotor_thrust))


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
            "share of thrust that the first rotor of the first opposite pair pulls more than the other; of other"
            " vehicles than quadrotors, growth along x",
        ),
        Coefficient("difference_2", "1", -0.5, 0.5, "the same of the second opposite pair, or along y"),
        Coefficient(
            "drag_imbalance", "1", -0.5, 0.5, "clockwise rotors drag this much more than modelled, the others less"
        ),
        Coefficient(
            "lift_imbalance",
            "1",
            -0.25,
            0.25,
            "counter-clockwise rotors pull this much more, the others less; in an X this turns roll into pitch",
            by_force=True,
        ),
        # One weak rotor of many is a sum of four patterns.
        Coefficient("difference_3", "1", -0.5, 0.5, "from six rotors on, growth along x with the spin"),
        Coefficient("difference_4", "1", -0.5, 0.5, "the same along y"),
    ),
    optional=2,
    needs=frozenset({"rotor_speed"}),
    excitation="yaw effort to both sides, and changes of thrust",
    rivals={
        "com_offset": "apply yaw effort: it loads one pair of rotors more than the other",
        "torque_bias": "change the thrust and apply yaw effort",
        "parameter_error": "apply yaw effort at constant roll and pitch",
        "products_of_inertia": "apply yaw effort at constant roll and pitch: rotors that differ then change the lift",
    },
    source="rotor by rotor thrust factors in quad_race_env (tudelft) and SkyFlow",
    describe=_describe,
    accounts=_accounts,
    acts=_acts,
)
