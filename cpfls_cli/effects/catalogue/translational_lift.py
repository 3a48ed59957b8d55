"""Translational lift: thrust grows with the air speed in the rotor plane."""

from cpfls_cli.effects import scales
from cpfls_cli.effects.effect import Coefficient, Effect
from cpfls_cli.vehicle.motion import Instant, Numbers, Wrench


def _acts(see: Instant, p: Numbers) -> Wrench:
    x, y, _ = see.hub_velocity
    return Wrench(at_hubs=(0, 0, p["k_h"] * (x**2 + y**2)))


EFFECT = Effect(
    name="translational_lift",
    order=80,
    title="translational lift",
    rotorpy={"k_h": "k_h"},
    kind="wrench",
    formula="dT_i = k_h (u_ix^2 + u_iy^2),  M = sum r_i x dT_i z",
    sentence="Rotors pull more in fast level flight, because they meet fresh air.",
    coefficients=(
        Coefficient(
            "k_h", "N s^2/m^2", 0.0, 2.0, "thrust gained per squared air speed", scales.lift_at_ten_metres_per_second
        ),
    ),
    needs=frozenset({"velocity"}),
    excitation="fast flight while yawing; with the force known, straight flight at several speeds",
    rivals={
        "parasitic_drag": "log acceleration: the lift acts along body z, the drag against the motion",
        "inflow": "fly level and fast, without climbing",
    },
    source="RotorPy multirotor.py (k_h)",
    acts=_acts,
)
