"""Vertical descent: vortex ring, turbulent wake and windmill brake change the thrust."""

from collections.abc import Mapping

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.effects import scales
from cpfls_cli.effects.effect import Coefficient, Effect, Shape, a_few_percent
from cpfls_cli.effects.signals import Signals
from cpfls_cli.vehicle.motion import Instant, Numbers, Wrench
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.vehicle.values import Value

# kg/m^3, at sea level and 15 degrees.
_AIR_DENSITY = 1.225
# Ratios of descent: knots where their curves bend, where thrust shakes, and ends of the states.
_KNOTS = (0.0, 0.5, 1.0, 1.25, 1.6, 2.0, 2.5)
_SHAKING = (0.5, 1.7)
_STATES = ((0.5, "normal working state"), (1.6, "vortex ring"), (2.0, "turbulent wake"), (np.inf, "windmill brake"))


def induced_velocity(see: Instant) -> Value:
    """Compute the velocity that each rotor gives the air in hover, ``v_h = sqrt(T_h / (2 rho pi R^2))``, m/s.

    Leishman, Principles of Helicopter Aerodynamics: momentum theory of the hovering rotor.
    """
    thrust = scales.weight(see.vehicle) / see.functions.total(see.thrust_factors) * see.thrust_factors
    return see.functions.sqrt(thrust / (2 * _AIR_DENSITY * np.pi * see.radii**2))


def descent_state(ratio: float) -> str:
    """Name the state of a rotor in descent by the speed of descent over the induced velocity."""
    return next(state for limit, state in _STATES if ratio <= limit)


def _ratios(see: Instant, p: Numbers) -> tuple[Value, Value]:
    """Compute speed of descent over induced velocity, by rotor, and the share that sideways speed leaves of the effect.

    Forward flight leaves the wake behind: how fast is enough, no two sources agree on.
    """
    still = 1 / induced_velocity(see)
    x, y, z = (each * still for each in see.hub_velocity)
    return -z, see.functions.exp(-(p["sideways"] ** -2) * (x**2 + y**2))


def _acts(see: Instant, p: Numbers) -> Wrench:
    ratio, gate = _ratios(see, p)
    gains = [0, *(p[_name(knot)] for knot in _KNOTS[1:])]
    # No data of the sources reaches further than the last knot.
    gain = gains[-1]
    for first in range(len(_KNOTS) - 2, -1, -1):
        slope = (gains[first + 1] - gains[first]) / (_KNOTS[first + 1] - _KNOTS[first])
        line = gains[first] + slope * (ratio - _KNOTS[first])
        gain = see.functions.where(ratio < _KNOTS[first + 1], line, gain)
    gain = see.functions.where(ratio > 0.0, gain, 0.0)
    return Wrench(at_hubs=(0, 0, see.rotor_thrust * gate * gain))


def _scatter(signals: Signals, shape: Mapping[str, float]) -> Array:
    see = signals.instants
    ratio, gate = _ratios(see, Numbers(shape))
    shaken = (see.rotor_thrust * gate * ((ratio > _SHAKING[0]) & (ratio < _SHAKING[1]))).T
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
    accounts=a_few_percent,
    shapes=(Shape("sideways", "1", (0.4, 0.7, 1.0, 1.5), "sideways speed over v_h that blows the effect away"),),
    scatter=_scatter,
    describe=_describe,
    acts=_acts,
)
