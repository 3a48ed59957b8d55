"""Moment at the hubs that flapping blades give in translation; its sign is open."""

from __future__ import annotations

from cpfls_cli.effects import scales
from cpfls_cli.effects.effect import Coefficient, Effect
from cpfls_cli.vehicle.motion import Instant, Numbers, Wrench


def _acts(see: Instant, p: Numbers) -> Wrench:
    x, y, _ = (see.functions.total(see.rotor_speed * each) for each in see.hub_velocity)
    return Wrench((-p["k_f"] * y, p["k_f"] * x, 0))


EFFECT = Effect(
    name="flapping_moment",
    order=50,
    title="flapping hub moment",
    rotorpy={"k_f": "k_flap"},
    kind="wrench",
    formula="M = -k_f sum w_i (u_iy, -u_ix, 0)",
    sentence="In forward flight the blades flap and tilt the nose up or down, without a force of their own.",
    coefficients=(Coefficient("k_f", "kg m/rad", -1.0, 1.0, "moment per rotor speed and air speed", scales.arm_drag),),
    needs=frozenset({"velocity", "rotor_speed"}),
    excitation="forward and sideways flight at several speeds",
    rivals={
        "rotor_drag": "log acceleration, so that the force is seen; or turn in yaw while flying fast",
        "wind": "fly legs in opposite directions",
        "parasitic_drag": "fly legs at two speeds, one twice the other",
        "com_offset": "balance the vehicle on its side, which shows the height of its centre of mass",
    },
    source="RotorPy multirotor.py (M_flap, nose down); Bauersfeld et al. 2021, NeuroBEM, eq. 17 (nose up)",
    acts=_acts,
)
