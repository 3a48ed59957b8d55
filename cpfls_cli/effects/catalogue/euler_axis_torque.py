"""Rotor torque taken for the generalised torque on the Euler angles."""

from __future__ import annotations

from cpfls_cli.effects.effect import Effect
from cpfls_cli.vehicle.motion import Instant, Numbers, Wrench
from cpfls_cli.vehicle.values import subtract


def _acts(see: Instant, _p: Numbers) -> Wrench:
    (sr, sp), (cr, cp) = map(see.functions.sin, see.attitude[:2]), map(see.functions.cos, see.attitude[:2])
    x, y, z = see.rotor_torque
    along = (z + sp * x) / cp
    return Wrench(subtract((x, cr * y + sr * along, cr * along - sr * y), see.rotor_torque))


EFFECT = Effect(
    name="euler_axis_torque",
    order=230,
    title="torque about Euler instead of body axes",
    kind="wrench",
    formula="M = (W^-T - 1) M_rot",
    sentence="The log gives torques about the axes of the Euler angles, but the model takes them for body axes; these "
    "differ as soon as the vehicle tilts.",
    needs=frozenset({"attitude", "torque"}),
    excitation="roll, pitch and yaw torque at large tilt",
    rivals={
        "torque_bias": "fly level: the wrong convention vanishes there",
        "products_of_inertia": "fly level: the wrong convention vanishes there",
    },
    source="definition of the generalised torque, tau = W^T M",
    acts=_acts,
)
