"""A constant torque: bent arms, tilted motors."""

from __future__ import annotations

from cpfls_cli.effects import scales
from cpfls_cli.effects.effect import Effect, of_axes
from cpfls_cli.vehicle.motion import Instant, Numbers, Wrench


def _acts(_see: Instant, p: Numbers) -> Wrench:
    return Wrench(tuple(p[f"M_{axis}"] for axis in "xyz"))


EFFECT = Effect(
    name="torque_bias",
    order=210,
    title="constant torque",
    kind="wrench",
    formula="M = (M_x, M_y, M_z)",
    sentence="Something always turns the vehicle to the same side, as a bent arm or a tilted motor does.",
    coefficients=of_axes("M_{}", "N m", -0.15, 0.15, "torque about {}", scales.arm_weight),
    needs=frozenset(),
    excitation="none: it is always there",
    rivals={
        "com_offset": "change the thrust: a bias stays, the torque of an offset grows with thrust",
        "rotor_mismatch": "change the thrust and apply yaw effort",
        "wind": "turn in yaw: a bias turns with the vehicle, the wind does not",
        "euler_axis_torque": "tilt: the wrong convention vanishes in level flight",
    },
    source="SkyFlow (thrust axis misalignment)",
    trims=True,
    acts=_acts,
)
