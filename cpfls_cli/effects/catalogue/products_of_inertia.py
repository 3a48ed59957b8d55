"""Products of inertia: the principal axes are not the body axes."""

from __future__ import annotations

from cpfls_cli.effects import scales
from cpfls_cli.effects.effect import Coefficient, Effect
from cpfls_cli.inertia import INERTIA_PARAMETERS, symmetric
from cpfls_cli.vehicle.motion import Instant, Numbers, Wrench
from cpfls_cli.vehicle.values import apply, cross, scaled


def _acts(see: Instant, p: Numbers) -> Wrench:
    xy, xz, yz = (p[name] for name in INERTIA_PARAMETERS[3:])
    turned = scaled(-1, apply(((0, xy, xz), (xy, 0, yz), (xz, yz, 0)), see.body_rate))
    return Wrench(cross(see.body_rate, turned), momentum=turned)


EFFECT = Effect(
    name="products_of_inertia",
    order=190,
    title="products of inertia",
    quantity="products",
    kind="wrench",
    formula="M = -(d/dt (dI omega) + omega x dI omega),  dI off the diagonal",
    sentence="The mass is distributed unevenly, so rotation about one axis turns the vehicle about another.",
    coefficients=tuple(
        Coefficient(name, "kg m^2", -0.25, 0.25, f"entry {name} of the inertia tensor, added", scales.smallest_inertia)
        for name in INERTIA_PARAMETERS[3:]
    ),
    needs=frozenset(),
    excitation="roll, pitch and yaw rates at the same time",
    rivals={
        "imu_misalignment": "compare roll on pitch with pitch on roll: products have one sign, misalignment has two",
        "rotor_gyroscopic": "repeat the roll rates with the yaw effort reversed: products stay",
        "rotor_mismatch": "apply yaw effort at constant roll and pitch: rotors that differ then change the lift",
        "wind": "turn in yaw without rolling or pitching",
    },
    source="Newton-Euler equations; RotorPy and PX4 sih.cpp (Ixy, Ixz, Iyz)",
    rate_derivative=True,
    in_vehicle=lambda parts, _, linear: parts._replace(inertia=parts.inertia + symmetric([0.0, 0.0, 0.0, *linear])),
    acts=_acts,
)
