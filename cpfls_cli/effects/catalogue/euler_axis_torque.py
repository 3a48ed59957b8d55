"""Rotor torque taken for the generalised torque on the Euler angles."""

from collections.abc import Mapping

from cpfls_cli import rotations
from cpfls_cli.effects.effect import Columns, Effect, torque_column
from cpfls_cli.effects.signals import Signals


def _columns(signals: Signals, _shape: Mapping[str, float]) -> Columns:
    assert signals.attitude is not None, "declared among the needs"
    torque = signals.wrench[:, :3]
    return torque_column(rotations.body_torque(signals.attitude, torque) - torque)


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
    columns=_columns,
)
