"""A load that swings on a cable under the vehicle."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy import signal

from cpfls_cli.arrays import Array
from cpfls_cli.effects import scales
from cpfls_cli.effects.effect import Coefficient, Columns, Effect, Shape, stack, wrench
from cpfls_cli.effects.signals import Signals


def swing(signals: Signals, length: float, damping: float) -> Array:
    """Compute the horizontal swing of a load, ``e'' + c e' + (g / L) e = -v' / L``.

    Solved as the filter ``-(s / L) / (s^2 + c s + g / L)`` of the velocity, which is taken as linear between samples,
    so that nothing is differentiated. The cable starts at rest.

    Parameters
    ----------
    signals : Signals
        With velocity.
    length : float, m
        L.
    damping : float, 1/s
        c.

    Returns
    -------
    array, shape (time, 2)
        Horizontal distance from the vehicle over the length of the cable, world frame; for small swings.
    """
    assert signals.velocity is not None, "declared among the needs"
    gravity = signals.vehicle.gravity_m_s2
    transfer = (np.array([-1 / length, 0.0]), np.array([1.0, damping, gravity / length]))
    numerator, a, _ = signal.cont2discrete(transfer, signals.period, method="foh")
    b = numerator.ravel()
    velocity = signals.velocity[:, :2]
    start = signal.lfilter_zi(b, a)[:, None] * velocity[0]
    return np.asarray(signal.lfilter(b, a, velocity, axis=0, zi=start)[0])


def _columns(signals: Signals, shape: Mapping[str, float]) -> Columns:
    swung = swing(signals, shape["length_m"], shape["damping_1_s"])
    cable = np.column_stack([swung, -np.ones(len(swung))])
    cable /= np.linalg.norm(cable, axis=1, keepdims=True)
    pull = np.einsum("tji,tj->ti", signals.rotation, cable * _gravity_felt(signals)[:, None])
    below = np.array([0.0, 0.0, -1.0])
    return Columns(stack(wrench(np.cross(below, pull)), wrench(force=pull)))


def _gravity_felt(signals: Signals) -> Array:
    gravity = np.full(len(signals), signals.vehicle.gravity_m_s2)
    # A climbing vehicle pulls harder on its cable; without accelerations the cable carries the weight alone.
    return gravity if signals.acceleration is None else gravity + signals.acceleration[:, 2]


EFFECT = Effect(
    name="payload",
    title="load on a cable",
    kind="wrench",
    formula="M = m_p r_a (-z) x R^T t,  F = m_p R^T t,  t = (g + a_z) (e_x, e_y, -1)/|.|,  e'' + c e' + g/L e = -a/L",
    sentence="A load on a cable swings under the vehicle and pulls it to and fro after each change of speed.",
    coefficients=(
        Coefficient("mass_times_attachment", "kg m", 0.0, 1.0, "mass times depth of the hook", scales.arm_mass),
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
        Shape("length_m", "m", (0.3, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0), "length of the cable"),
        Shape("damping_1_s", "1/s", (0.05, 0.2, 0.6), "damping of the swing"),
    ),
)
