"""Slope of the thrust: thrust that does not go with the square of the command."""

from cpfls_cli.effects import scales
from cpfls_cli.effects.effect import Coefficient, Effect, Shape
from cpfls_cli.vehicle.motion import Instant, Numbers, Wrench


def _acts(see: Instant, p: Numbers) -> Wrench:
    # As it is in hover, so that neither the mass nor the thrust factor is another one.
    carrying = (1 + p["thrust_scale"]) * see.functions.total(see.thrust_factors)
    apart = p["linear"] * (
        see.rotor_speed * (see.functions.sqrt(scales.weight(see.vehicle) / carrying) - see.rotor_speed)
    )
    thrust, yaw = see.thrust_factors * apart, -see.functions.total(see.spins * see.drag_factors * apart)
    # What thrust over weight is off by scales the force; of torques it scales the inertia.
    return Wrench((0, 0, yaw), (0, 0, p["thrust_scale"] * see.functions.total(thrust)), at_hubs=(0, 0, thrust))


EFFECT = Effect(
    name="thrust_slope",
    order=285,
    title="thrust curve of the commands (no square)",
    kind="wrench",
    formula="dT_i = a k (w_h w_i - w_i^2), drag torque alike;  M = sum r_i x dT_i z,  F_z = (1 + e) sum dT_i,  "
    "w_h^2 = m g / ((1 + e) sum k)",
    sentence="Thrust rises less steeply with the commands than their square, or more steeply. The torque that turns "
    "the vehicle is then less, or more, than the config says, as if its inertia were another one.",
    coefficients=(
        Coefficient("linear", "1", -1.0, 1.0, "share of the hover thrust that goes with the command, not its square"),
    ),
    shapes=(
        Shape(
            "thrust_scale",
            "1",
            (-0.9, 0.0, 3.0),
            "true thrust over that of the model, less 1, by which it hovers at another command",
            first=0.0,
            follows=lambda known: known["thrust_scale"],
        ),
    ),
    optional=1,
    # Measured speeds have the square of blades; torque alone shows the slope in hover, that of a wrong inertia.
    needs=frozenset({"rotor_speed", "command", "force"}),
    excitation="climbs and drops, with roll and pitch at much and at little thrust",
    rivals={
        "parameter_error": "roll and pitch at much and at little thrust: a wrong inertia stays",
        "inflow": "change the thrust quickly: inflow acts only once the vehicle climbs",
    },
    source="thrust of commands as of PX4 (THR_MDL_FAC), Betaflight (thrust_linear) and Crazyflie: a square and a line",
    tried_last=True,
    acts=_acts,
)
