"""Rolling moment: the advancing blades lift more than the retreating ones."""

from __future__ import annotations

from cpfls_cli.effects import scales
from cpfls_cli.effects.effect import Coefficient, Effect
from cpfls_cli.vehicle.motion import Instant, Numbers, Wrench


def _acts(see: Instant, p: Numbers) -> Wrench:
    x, y, _ = (see.functions.total(see.spins * see.rotor_speed * each) for each in see.hub_velocity)
    return Wrench((-p["mu"] * x, -p["mu"] * y, 0))


EFFECT = Effect(
    name="rolling_moment",
    order=60,
    title="rolling moment of the rotors",
    quantity="rolling",
    kind="wrench",
    formula="M = -mu sum s_i w_i (u_ix, u_iy, 0)",
    sentence="Each rotor rolls about its direction of flight; the rotors cancel unless one spin sense turns faster.",
    coefficients=(Coefficient("mu", "kg m/rad", 0.0, 0.5, "moment per rotor speed and air speed", scales.arm_drag),),
    needs=frozenset({"velocity", "rotor_speed"}),
    excitation="fast forward flight with yaw effort",
    rivals={
        "rotor_gyroscopic": "hold yaw effort in straight flight, without roll or pitch rate",
        "flapping_moment": "reverse the yaw effort at constant speed: only the rolling moment reverses",
    },
    source="PX4 gazebo_motor_model.cpp (with the sign of the spin; the older RotorS model leaves it out)",
    acts=_acts,
)
