"""Rotational damping in proportion to the rate."""

from cpfls_cli.effects import scales
from cpfls_cli.effects.effect import Effect, of_axes
from cpfls_cli.vehicle.motion import Instant, Numbers, Wrench


def _acts(see: Instant, p: Numbers) -> Wrench:
    return Wrench(tuple(-p[f"d_{axis}"] * rate for axis, rate in zip("xyz", see.body_rate, strict=True)))


EFFECT = Effect(
    name="linear_damping",
    order=10,
    title="linear rotational damping",
    kind="wrench",
    formula="M = -(d_x p, d_y q, d_z r)",
    sentence="The air brakes rotation in proportion to the rate.",
    coefficients=of_axes("d_{}", "N m s/rad", 0.0, 3.0, "damping about {}", scales.MOMENTS),
    needs=frozenset(),
    excitation="roll, pitch and yaw rate sweeps from 0.3 to 2 Hz at several amplitudes",
    rivals={
        "quadratic_damping": "repeat the same rate sweep at twice the amplitude",
        "rotor_plane_damping": "repeat the rate sweep at two thrusts: in hover the two are one column",
        "inflow": "climb and descend at constant attitude: only inflow changes the thrust",
        "rotor_drag": "fly forward and sideways, and log velocity: drag at the hubs brakes yaw like a damping",
        "motor_lag": "log measured rotor speeds; lag looks like negative damping",
        "command_delay": "log measured rotor speeds; a delay looks like negative damping",
    },
    source="PX4 sih.cpp (Ma = -KDW omega); simulator of ArduPilot (terminal rotation rate)",
    acts=_acts,
)
