"""Centre of mass off the point that the hub positions are measured from."""

from dataclasses import replace

from cpfls_cli.effects import scales
from cpfls_cli.effects.effect import Coefficient, Effect, a_few_percent
from cpfls_cli.vehicle.motion import Instant, Numbers, Wrench
from cpfls_cli.vehicle.values import cross, scaled


def _acts(see: Instant, p: Numbers) -> Wrench:
    return Wrench(scaled(-1, cross(tuple(p[f"c_{axis}"] for axis in "xyz"), see.force)))


_EFFECT = Effect(
    name="com_offset",
    order=180,
    title="offset of the centre of mass",
    quantity="centre",
    kind="wrench",
    formula="M = -c x F,  F the force without weight, as measured, or else the thrust",
    sentence="The centre of mass is not where the model has it, so thrust tilts the vehicle.",
    coefficients=(
        Coefficient("c_x", "m", -0.4, 0.4, "true centre of mass, forward of that of the model", scales.arm),
        Coefficient("c_y", "m", -0.4, 0.4, "true centre of mass, left of that of the model", scales.arm),
    ),
    needs=frozenset({"thrust"}),
    excitation="changes of thrust: climbs, descents, hard stops",
    rivals={
        "torque_bias": "change the thrust: a bias stays, the torque of an offset grows with thrust",
        "rotor_mismatch": "apply yaw effort: it loads one pair of rotors more than the other",
        "wind": "turn in yaw, and change the thrust",
    },
    source="geometry; RotorPy (hub positions relative to the centre of mass)",
    of_all_forces=True,
    accounts=a_few_percent,
    acts=_acts,
)

# Height alone is the moment of a flapping disc; with the other two it is the third number of one cause.
_HEIGHT = Coefficient(
    "c_z", "m", -0.4, 0.4, "true centre of mass, above that of the model; shown by forces across the rotors", scales.arm
)
_EXACT = replace(_EFFECT, coefficients=(*_EFFECT.coefficients, _HEIGHT), columns=None)
EFFECT = replace(_EFFECT, exact=_EXACT, added="flapping_moment")
