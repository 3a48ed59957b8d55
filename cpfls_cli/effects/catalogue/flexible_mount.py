"""Flexible mount: a part of the vehicle turns on springs against the rest."""

from collections.abc import Mapping

import numpy as np

from cpfls_cli.effects.effect import Columns, Effect, Shape, of_axes
from cpfls_cli.effects.hooks import Body, second_order
from cpfls_cli.effects.signals import Signals
from cpfls_cli.filters import SecondOrder
from cpfls_cli.vehicle.motion import Carrier, Instant, Numbers, Pull
from cpfls_cli.vehicle.values import ZERO, Vector, add, plus, scaled, subtract, times


def _swing(shape: Mapping[str, float], period: float) -> SecondOrder:
    return second_order(shape["frequency_hz"], shape["damping"], period, (1.0, 0.0, 0.0))


def _columns(signals: Signals, shape: Mapping[str, float]) -> Columns:
    swing = _swing(shape, signals.period)
    momentum = np.zeros((len(signals), 6, 3))
    momentum[:, :3] = swing.along(signals.body_rate)[:, :, None] * np.diag(signals.vehicle.inertia_kg_m2[:3])
    return Columns(np.zeros_like(momentum), momentum)


def _pull(_see: Instant, p: Numbers, state: Vector, carrier: Carrier) -> Pull:
    """Turn the vehicle by what the springs give back.

    ``x'' + 2 zeta w x' + w^2 x = -omega'`` for the angles x of the sprung part against the vehicle, with ``omega' = (a
    + share (2 zeta w x' + w^2 x)) / (1 - share)``, a being the angular acceleration of the vehicle if it were stiff.
    """
    angle, rate, natural = state[:3], state[3:], 2 * np.pi * p["frequency_hz"]
    spring = add(scaled(2 * p["damping"] * natural, rate), scaled(natural**2, angle))
    shares = [p[f"share_{axis}"] for axis in "xyz"]
    turning = tuple(
        plus(stiff, times(share, given)) / (1 - share)
        for share, stiff, given in zip(shares, carrier.turning, spring, strict=True)
    )
    swing = tuple(-plus(*each) for each in zip(turning, spring, strict=True))
    return Pull(ZERO, subtract(turning, carrier.turning), (*rate, *swing))


EFFECT = Effect(
    name="flexible_mount",
    order=225,
    title="a part of the vehicle on springs",
    kind="wrench",
    formula="M = d/dt (share I s^2/(s^2 + 2 zeta W s + W^2) omega), W = 2 pi f, for each axis",
    sentence="A part of the vehicle swings on springs and does not follow fast rotation.",
    coefficients=of_axes("share_{}", "1", 0.0, 0.8, "share of the inertia about {} that is on springs"),
    needs=frozenset({"body_rate", "torque"}),
    excitation="roll and pitch sweeps through the resonance, from 0.5 to 8 Hz, then hands off for a second",
    rivals={
        "payload": "sweep roll and pitch from 1 to 8 Hz in hover: a load on a cable swings below 1 Hz only",
        "parameter_error": "compare slow with fast torque: a wrong inertia acts in both",
        "linear_damping": "sweep at two frequencies: damping grows with the rate, springs ring at their own frequency",
    },
    source="two bodies on a spring, e.g. Meirovitch, Elements of Vibration Analysis",
    columns=_columns,
    shapes=(
        Shape("frequency_hz", "Hz", (1.2, 1.5, 1.9, 2.4, 3.0, 3.8, 4.8, 6.5), "frequency with the rest held still"),
        Shape("damping", "1", (0.02, 0.1, 0.3), "their damping ratio", first=0.1),
    ),
    rate_derivative=True,
    filters=_swing,
    carried=Body(_pull, (0.0,) * 6),
)
