"""Vertical descent: vortex ring, turbulent wake and windmill brake change the thrust."""

from collections.abc import Mapping

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.effects import scales
from cpfls_cli.effects.effect import Coefficient, Columns, Effect, Shape, a_few_percent, thrust_wrench
from cpfls_cli.effects.signals import Signals
from cpfls_cli.vehicle.settings import VehicleSettings

_AIR_DENSITY = 1.225  # kg/m^3, at sea level and 15 degrees.
# Ratios of descent: the end of the data, knots where their curves bend, where thrust shakes, and ends of the states.
_LARGEST_RATIO = 2.5
_KNOTS = (0.0, 0.5, 1.0, 1.25, 1.6, 2.0, 2.5)
_SHAKING = (0.5, 1.7)
_STATES = ((0.5, "normal working state"), (1.6, "vortex ring"), (2.0, "turbulent wake"), (np.inf, "windmill brake"))


def induced_velocity(signals: Signals) -> Array:
    """Compute the velocity that each rotor gives the air in hover, ``v_h = sqrt(T_h / (2 rho pi R^2))``.

    `signals`: with radii of the rotors.
    Result: shape (rotor,), m/s.
    Reference: Leishman, Principles of Helicopter Aerodynamics: momentum theory of the hovering rotor.
    """
    factors = np.array([rotor.thrust_factor_n_s2 for rotor in signals.vehicle.rotors])
    thrust = factors * scales.hover_speed(signals.vehicle) ** 2
    return np.asarray(np.sqrt(thrust / (2 * _AIR_DENSITY * np.pi * signals.radii**2)))


def descent_ratio(signals: Signals) -> Array:
    """Compute the speed of descent of each hub over its induced velocity, ``x_i = max(-u_iz / v_h, 0)``.

    Result: shape (time, rotor); at most 2.5: no data of the sources reaches further.
    """
    ratio = -signals.hub_velocity[..., 2] / induced_velocity(signals)
    return np.asarray(np.clip(ratio, 0.0, _LARGEST_RATIO))


def descent_state(ratio: float) -> str:
    """Name the state of a rotor in descent by the speed of descent over the induced velocity."""
    return next(state for limit, state in _STATES if ratio <= limit)


def thrust_basis(ratio: Array) -> Array:
    """Evaluate a hat function for each knot: 1 there, 0 at its neighbours and beyond, and 0 without descent.

    Hats are local, so that a ratio that no flight has reached says nothing about the others.

    `ratio`: shape (...); Result: shape (..., 6).
    """
    hats = [np.interp(ratio, _KNOTS, unit) for unit in np.eye(len(_KNOTS))[1:]]
    return np.stack(hats, axis=-1)


def _gated_thrust(signals: Signals, shape: Mapping[str, float]) -> Array:
    # Forward flight leaves the wake behind: how fast is enough, no two sources agree on.
    sideways = np.linalg.norm(signals.hub_velocity[..., :2], axis=-1) / induced_velocity(signals)
    return np.asarray(signals.rotor_thrust * np.exp(-((sideways / shape["sideways"]) ** 2)))


def _columns(signals: Signals, shape: Mapping[str, float]) -> Columns:
    change = _gated_thrust(signals, shape)[..., None] * thrust_basis(descent_ratio(signals))
    return Columns(np.stack([thrust_wrench(signals.hubs, change[..., n]) for n in range(change.shape[2])], axis=2))


def _scatter(signals: Signals, shape: Mapping[str, float]) -> Array:
    ratio = descent_ratio(signals)
    shaken = _gated_thrust(signals, shape) * ((ratio > _SHAKING[0]) & (ratio < _SHAKING[1]))
    levers = np.column_stack([signals.hubs[:, 1], -signals.hubs[:, 0], np.zeros(len(signals.hubs))])
    per_thrust = np.concatenate([levers, np.tile([0.0, 0.0, 1.0], (len(levers), 1))], axis=1)
    return np.asarray(shaken**2 @ per_thrust**2)


def _name(knot: float) -> str:
    return f"f_{knot:g}".replace(".", "_")


def _describe(_vehicle: VehicleSettings, values: Mapping[str, float]) -> str:
    """Name the state in which the thrust changes most."""
    changes = {knot: values[_name(knot)] for knot in _KNOTS[1:] if _name(knot) in values}
    if not changes:
        return ""
    ratio = max(changes, key=lambda knot: abs(changes[knot]))
    size = f"{abs(100 * changes[ratio]):.2g} % {'less' if changes[ratio] < 0 else 'more'} thrust"
    return f"Strongest in the state called {descent_state(ratio)}: {size} at {ratio:g} times the induced velocity."


EFFECT = Effect(
    name="vertical_descent",
    order=110,
    title="vertical descent (vortex ring to windmill brake)",
    kind="wrench",
    formula="dT_i = T_i exp(-(u_xy/(s v_h))^2) f(x_i),  f linear between knots, f(0) = 0,  x_i = max(-u_iz/v_h, 0)",
    sentence="A vehicle that sinks into its own wake loses thrust and shakes; sinking faster, it gains thrust.",
    coefficients=tuple(
        Coefficient(_name(knot), "1", -0.8, 1.5, f"share of thrust gained at x = {knot:g}") for knot in _KNOTS[1:]
    ),
    needs=frozenset({"velocity", "rotor_speed", "rotor_radius"}),
    excitation="vertical descents in steps up to twice the induced velocity, then the same with forward speed",
    rivals={
        "inflow": "climb as well as descend: in a climb only inflow acts",
        "battery_sag": "repeat the descent with a full and with an empty battery",
        "rotor_mismatch": "repeat the descent with forward speed: the mismatch stays",
    },
    source="Bauersfeld et al. 2021, NeuroBEM, eq. 19; Bangura and Mahony (0.5 < x < 2); the sources disagree in sign",
    columns=_columns,
    accounts=a_few_percent,
    shapes=(Shape("sideways", "1", (0.4, 0.7, 1.0, 1.5), "sideways speed over v_h that blows the effect away"),),
    scatter=_scatter,
    describe=_describe,
)
