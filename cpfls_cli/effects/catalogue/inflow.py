"""Inflow: thrust falls where air flows through a rotor from above."""

from cpfls_cli.effects import scales
from cpfls_cli.effects.effect import Coefficient, Effect
from cpfls_cli.vehicle.motion import Instant, Numbers, Wrench


def _acts(see: Instant, p: Numbers) -> Wrench:
    return Wrench(at_hubs=(0, 0, -p["k_z"] * (see.rotor_speed * see.hub_velocity[2])))


EFFECT = Effect(
    name="inflow",
    order=70,
    title="inflow (thrust falls with axial speed)",
    rotorpy={"k_z": "k_z"},
    kind="wrench",
    formula="dT_i = -k_z w_i u_iz,  M = sum r_i x dT_i z",
    sentence="A rotor that moves up through the air pulls less, one that moves down pulls more.",
    coefficients=(
        Coefficient(
            "k_z", "N s^2/(m rad)", 0.0, 5.0, "thrust lost per rotor speed and axial speed", scales.drag_per_rotor_speed
        ),
    ),
    needs=frozenset({"velocity", "rotor_speed"}),
    excitation="climbs and descents at several speeds, with roll and pitch on the way",
    rivals={
        "linear_damping": "climb and descend while rolling: in hover the two are one column",
        "rotor_plane_damping": "climb and descend at constant attitude, and log acceleration",
        "vertical_descent": "climb as well as descend: in a climb only inflow acts",
    },
    source="RotorPy multirotor.py (k_z of the rotor drag matrix); PX4 data-driven-dynamics rotor_model.py",
    acts=_acts,
)
