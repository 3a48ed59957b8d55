"""Rotors whose shafts are not parallel to body z: a twisted or bent arm, a motor mounted askew."""

from __future__ import annotations

from collections.abc import Mapping
from math import degrees

import numpy as np

from cpfls_cli.effects.effect import Coefficient, Effect
from cpfls_cli.vehicle.motion import Instant, Numbers, Wrench
from cpfls_cli.vehicle.rotors import gain_modes, opposite_pairs
from cpfls_cli.vehicle.settings import VehicleSettings

_PATTERN = {
    "1": "of the first rotor of the first opposite pair over that of the other; of other vehicles growth along x",
    "2": "the same of the second opposite pair, or along y",
    "3": "from six rotors on, growth along x with the spin",
    "4": "the same along y",
}
_WAYS = {"twist": "tilt anticlockwise around the vehicle (its arm twists)", "bend": "tilt outwards (its arm bends)"}


def _acts(see: Instant, p: Numbers) -> Wrench:
    hubs = np.array([rotor.position_m[:2] for rotor in see.vehicle.rotors])
    arms = np.linalg.norm(hubs, axis=1, keepdims=True)
    # A rotor in the middle, but for rounding, has no arm.
    outwards = np.where(arms > 1e-9 * arms.max(), hubs / np.maximum(arms, np.finfo(float).tiny), 0.0)
    # What all rotors of one spin lean alike about z more than the others is a wrong drag factor.
    patterns = {"all": np.ones(len(hubs)), **dict(zip(_PATTERN, gain_modes(see.vehicle).T, strict=False))}
    x, y = see.functions.rotors([0.0] * len(hubs)), see.functions.rotors([0.0] * len(hubs))
    for name, pattern in patterns.items():
        for kind, way in (("twist", outwards @ [[0.0, 1.0], [-1.0, 0.0]]), ("bend", outwards)):
            lean = (pattern[:, None] * way).T.tolist()
            x, y = (
                old + see.functions.rotors(new) * p[f"{kind}_{name}"] for old, new in zip((x, y), lean, strict=True)
            )
    drag = see.spins * see.rotor_drag
    reaction = (-see.functions.total(x * drag), -see.functions.total(y * drag), 0)
    return Wrench(reaction, at_hubs=(x * see.rotor_thrust, y * see.rotor_thrust, 0))


def _describe(vehicle: VehicleSettings, values: Mapping[str, float]) -> str:
    """Say how much a rotor of a pair leans more than the other."""
    pairs = opposite_pairs(vehicle)
    if len(pairs) != 2 or len(vehicle.rotors) != 4:
        pairs = ()
    ways = {"twist": ("anticlockwise", "clockwise"), "bend": ("outwards", "inwards")}
    leans = []
    for name, value in values.items():
        kind, which = name.split("_")
        way = f"{abs(degrees(value)):.1f} deg {ways[kind][value < 0]}"
        leans += [f"All rotors lean {way}"] if which == "all" else []
        opposite = pairs[int(which) - 1 : int(which)] if which != "all" else ()
        leans += [f"M{first + 1} leans {way} more than M{second + 1}" for first, second in opposite]
    return f"{'; '.join(leans)}." if leans else ""


def _accounts(number: str, values: Mapping[str, float], vehicle: VehicleSettings) -> float:
    """Leave to Izz over yaw torque what tilts of one spin against the other show: a third of the others, or less."""
    twists = sum(abs(value) for name, value in values.items() if name.startswith("twist"))
    levers = (
        np.hypot(*rotor.position_m[:2]) * rotor.thrust_factor_n_s2 / rotor.drag_factor_n_m_s2
        for rotor in vehicle.rotors
    )
    return twists / 3 * max(levers, default=0.0) if number == "inertia_z" else 0.0


EFFECT = Effect(
    name="rotor_tilt",
    order=197,
    title="tilted rotors",
    kind="wrench",
    formula="F = sum T_i e_i,  M = sum r_i x T_i e_i - s_i b_i w_i^2 e_i,  e_i = twist_i (z x u_i) + bend_i u_i,"
    "  u_i = r_i / |r_i|",
    sentence="A rotor is tilted: its arm is twisted or bent, or its motor is mounted askew.",
    coefficients=(
        Coefficient("twist_all", "rad", -0.2, 0.2, "tilt of all rotors anticlockwise around the vehicle"),
        *(
            Coefficient(f"{kind}_{which}", "rad", -0.2, 0.2, f"{way}, {pattern}")
            for which, pattern in _PATTERN.items()
            for kind, way in _WAYS.items()
        ),
    ),
    optional=4,
    moves=True,
    needs=frozenset({"rotor_speed"}),
    excitation="yaw effort to both sides, changes of thrust, and roll and pitch, with the accelerometer in the log",
    rivals={
        "rotor_mismatch": "log the force: rotors that drag differently push to no side",
        "torque_bias": "change the thrust: a bias stays, the torque of tilted rotors grows with thrust",
        "mounting": "apply roll, pitch and yaw effort: what is askew as a whole tilts all rotors alike",
        "com_offset": "apply roll and pitch effort with yaw free: tilted rotors turn the vehicle about z",
    },
    source="canted rotors of omnidirectional vehicles (Brescianini and D'Andrea 2016), to first order in the angles",
    describe=_describe,
    accounts=_accounts,
    acts=_acts,
)
