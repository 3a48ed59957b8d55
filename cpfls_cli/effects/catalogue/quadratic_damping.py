"""Rotational damping that grows with the square of the rate."""

from __future__ import annotations

from cpfls_cli.effects import scales
from cpfls_cli.effects.effect import Effect, of_axes
from cpfls_cli.vehicle.motion import Instant, Numbers, Wrench


def _acts(see: Instant, p: Numbers) -> Wrench:
    braked = ((p[f"d_{axis}"], rate) for axis, rate in zip("xyz", see.body_rate, strict=True))
    return Wrench(tuple(-damping * see.functions.absolute(rate) * rate for damping, rate in braked))


EFFECT = Effect(
    name="quadratic_damping",
    order=20,
    title="quadratic rotational damping",
    kind="wrench",
    formula="M = -(d_x |p| p, d_y |q| q, d_z |r| r)",
    sentence="The air brakes fast rotation more than slow rotation, as it does a flat plate.",
    coefficients=of_axes("d_{}", "N m s^2/rad^2", 0.0, 1.0, "damping about {}", scales.MOMENTS),
    needs=frozenset(),
    excitation="roll, pitch and yaw rate sweeps at a small and at a large amplitude",
    rivals={
        "linear_damping": "repeat the same rate sweep at twice the amplitude",
        "rotor_plane_damping": "repeat the same rate sweep at twice the amplitude",
    },
    source="OS4 dinamica.m (friction torque of the body); flat-plate estimate",
    acts=_acts,
)
