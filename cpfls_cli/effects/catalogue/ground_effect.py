"""Ground effect: a rotor near the ground pulls more."""

from __future__ import annotations

from cpfls_cli.effects.effect import Effect, Shape, a_few_percent
from cpfls_cli.vehicle.motion import Instant, Numbers, Wrench

_SMALLEST_DENOMINATOR = 0.5  # Below this share the formula leaves its range: the thrust at most doubles.


def _acts(see: Instant, p: Numbers) -> Wrench:
    height = see.functions.largest(see.hub_height, 1e-3 * see.radii)
    ratio = (see.radii / (4 * height)) ** 2
    gain = 1 / see.functions.largest(1 - p["G"] * ratio, _SMALLEST_DENOMINATOR)
    return Wrench(at_hubs=(0, 0, see.rotor_thrust * (gain - 1)))


EFFECT = Effect(
    name="ground_effect",
    order=100,
    title="ground effect",
    kind="wrench",
    formula="dT_i = T_i (1 / (1 - G (R/4z_i)^2) - 1),  M = sum r_i x dT_i z",
    sentence="Near the ground the rotors pull more, the lower ones most, so the vehicle is levelled.",
    needs=frozenset({"height", "rotor_speed", "rotor_radius"}),
    excitation="slow hover and tilt at heights of one, two and four rotor radii",
    rivals={
        "payload": "repeat the same tilts far above the ground",
        "torque_bias": "repeat the same tilts far above the ground",
        "rotor_mismatch": "repeat the same tilts far above the ground",
        "parameter_error": "compare the thrust near the ground with that far above it",
    },
    source="Cheeseman and Bennett, R&M 3021 (G = 1); gym-pybullet-drones (G = 11.4 for a Crazyflie)",
    accounts=a_few_percent,
    shapes=(Shape("G", "1", (0.25, 0.5, 1.0, 2.0, 4.0, 7.0, 11.0, 16.0), "strength; 1 is a single rotor"),),
    acts=_acts,
)
