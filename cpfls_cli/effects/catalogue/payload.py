"""A load that swings on a cable under the vehicle."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.effects import scales
from cpfls_cli.effects.effect import Coefficient, Columns, Effect, Shape, stack, wrench
from cpfls_cli.effects.hooks import Carrier, Pull
from cpfls_cli.effects.signals import Signals
from cpfls_cli.effects.swing import felt_acceleration, settled_swing
from cpfls_cli.rotations import cross
from cpfls_cli.vehicle.settings import VehicleSettings

# Square of the part of the cable across the vertical, 80 degrees: beyond, its length says nothing about its height.
_LARGEST_ACROSS = 0.97


def _columns(signals: Signals, shape: Mapping[str, float]) -> Columns:
    length = shape["length_m"]
    swung = settled_swing(signals, length, shape["damping_1_s"], shape["depth_m"])
    across = np.minimum((swung**2).sum(axis=1), _LARGEST_ACROSS)
    cable = np.column_stack([swung, -np.sqrt(1 - across)])
    rate = np.gradient(cable, signals.time, axis=0)
    tension = length * (rate**2).sum(axis=1) - (felt_acceleration(signals, shape["depth_m"]) * cable).sum(axis=1)
    pull = np.einsum("tji,tj->ti", signals.rotation, cable * tension[:, None])
    levers = (wrench(cross(hook, pull)) for hook in -np.eye(3)[::-1])
    return Columns(stack(*levers, wrench(force=pull)))


@dataclass(frozen=True)
class _Load:
    """The load in the closed loop, with mass and ``mass times hook`` as lever of its pull ``m_p t n``.

    State: direction n of the cable and its rate, ``n'' = -(a + g z)_across / L - |n'|^2 n - c n'`` with a the
    acceleration of the hook, and the tension per mass ``t = L |n'|^2 - (a + g z) . n``.
    """

    mass: float
    mass_times_hook: Array
    depth: float
    length: float
    damping: float
    gravity: float
    start: Array = field(default_factory=lambda: np.array([0.0, 0.0, -1.0, 0.0, 0.0, 0.0]))

    def pull(self, carrier: Carrier, state: Array) -> Pull:
        """Pull at a carrier whose acceleration depends on the pull; both are linear in the tension."""
        cable, rate = state[:3] / np.linalg.norm(state[:3]), state[3:]
        hook = np.array([0.0, 0.0, -self.depth])
        pulled = self.mass / carrier.mass * cable
        turned = np.asarray(np.linalg.solve(carrier.inertia, cross(self.mass_times_hook, carrier.rotation.T @ cable)))
        bent = cross(carrier.turning, hook) + cross(carrier.body_rate, cross(carrier.body_rate, hook))
        felt = carrier.acceleration + carrier.rotation @ bent
        felt[2] += self.gravity
        response = pulled + carrier.rotation @ cross(turned, hook)
        tension = (self.length * rate @ rate - felt @ cable) / (1 + response @ cable)
        felt = felt + tension * response
        across = felt - (felt @ cable) * cable
        swing = -across / self.length - (rate @ rate) * cable - self.damping * rate
        return Pull(tension * pulled, tension * turned, np.concatenate([rate, swing]))


def _carried(vehicle: VehicleSettings, values: Mapping[str, float]) -> _Load:
    lever = sum((value * np.array(_HOOK[name]) for name, value in values.items() if name in _HOOK), np.zeros(3))
    return _Load(
        values["mass"],
        lever,
        values.get("depth_m", 0.0),
        values["length_m"],
        values["damping_1_s"],
        vehicle.gravity_m_s2,
    )


# Where the coefficients have the hook.
_HOOK = {
    "mass_times_depth": (0.0, 0.0, -1.0),
    "mass_times_right": (0.0, -1.0, 0.0),
    "mass_times_behind": (-1.0, 0.0, 0.0),
}


def _accounts(number: str, _values: Mapping[str, float]) -> float:
    """Account for any error of the thrust: the load is carried."""
    return np.inf if number == "thrust_scale" else 0.05


EFFECT = Effect(
    name="payload",
    order=220,
    title="load on a cable",
    kind="wrench",
    formula="M = m_p r_a x R^T t,  F = m_p R^T t,  t = (g + a_z) (e_x, e_y, -1)/|.|,  e'' + c e' + g/L e = -a/L",
    sentence="A load on a cable swings under the vehicle and pulls it to and fro after each change of speed.",
    coefficients=(
        Coefficient("mass_times_depth", "kg m", 0.0, 1.0, "mass times depth of the hook", scales.arm_mass),
        Coefficient(
            "mass_times_right", "kg m", -0.3, 0.3, "mass times offset of the hook to the right", scales.arm_mass, True
        ),
        Coefficient(
            "mass_times_behind", "kg m", -0.3, 0.3, "mass times offset of the hook behind", scales.arm_mass, True
        ),
        Coefficient("mass", "kg", 0.0, 1.0, "mass of the load; only the force balance shows it", scales.mass),
    ),
    needs=frozenset({"velocity"}),
    excitation="accelerate and stop, then wait for some swings",
    rivals={
        "ground_effect": "repeat the flight far above the ground",
        "torque_bias": "wait after a stop: a load swings on at its own period",
        "com_offset": "wait after a stop: a load swings on at its own period",
        "rotor_drag": "wait after a stop: a load swings on at its own period",
    },
    source="equation of the driven pendulum",
    columns=_columns,
    shapes=(
        Shape(
            "length_m",
            "m",
            (0.3, 0.4, 0.5, 0.65, 0.8, 1.0, 1.25, 1.55, 1.9, 2.4, 3.1, 4.0),
            "length of the cable",
            # A light damping lets it swing all flight long, and a few per cent make it one swing late.
            valley=0.02,
        ),
        Shape("damping_1_s", "1/s", (0.05, 0.2, 0.6), "damping of the swing", first=0.2),
        Shape("depth_m", "m", (0.0, 0.1, 0.3), "depth of the hook below the centre of mass", first=0.0),
    ),
    carried=_carried,
    accounts=_accounts,
)
