"""Vertical descent: vortex ring, turbulent wake and windmill brake change the thrust."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.special import eval_sh_legendre

from cpfls_cli.arrays import Array
from cpfls_cli.effects import scales
from cpfls_cli.effects.effect import Coefficient, Columns, Effect, thrust_wrench
from cpfls_cli.effects.signals import Signals

_AIR_DENSITY = 1.225
_LARGEST_RATIO = 2.5
_ORDER = 4
_STATES = ((0.5, "normal working state"), (1.6, "vortex ring"), (2.0, "turbulent wake"), (np.inf, "windmill brake"))


def induced_velocity(signals: Signals) -> Array:
    """Compute the velocity that each rotor gives the air in hover, ``v_h = sqrt(T_h / (2 rho pi R^2))``.

    Parameters
    ----------
    signals : Signals
        With radii of the rotors.

    Returns
    -------
    array, shape (rotor,), m/s

    References
    ----------
    Leishman, Principles of Helicopter Aerodynamics: momentum theory of the hovering rotor.
    """
    factors = np.array([rotor.thrust_factor_n_s2 for rotor in signals.vehicle.rotors])
    thrust = factors * scales.hover_speed(signals.vehicle) ** 2
    return np.asarray(np.sqrt(thrust / (2 * _AIR_DENSITY * np.pi * signals.radii**2)))


def descent_ratio(signals: Signals) -> Array:
    """Compute the speed of descent of each hub over its induced velocity, ``x_i = max(-u_iz / v_h, 0)``.

    Parameters
    ----------
    signals : Signals

    Returns
    -------
    array, shape (time, rotor)
        At most 2.5: no data of the sources reaches further.
    """
    ratio = -signals.hub_velocity[..., 2] / induced_velocity(signals)
    return np.asarray(np.clip(ratio, 0.0, _LARGEST_RATIO))


def descent_state(ratio: float) -> str:
    """Name the state of a rotor in descent.

    Parameters
    ----------
    ratio : float
        Speed of descent over induced velocity.

    Returns
    -------
    str
    """
    return next(state for limit, state in _STATES if ratio <= limit)


def thrust_basis(ratio: Array) -> Array:
    """Evaluate the columns, ``f_n(x) = t P_{n-1}(2t - 1)`` with ``t = x / 2.5`` and Legendre polynomials P.

    They span ``x, x^2, x^3, x^4``, vanish without descent, and are far less alike than the powers.

    Parameters
    ----------
    ratio : array, shape (...)

    Returns
    -------
    array, shape (..., 4)
    """
    scaled = np.asarray(ratio)[..., None] / _LARGEST_RATIO
    return np.asarray(scaled * eval_sh_legendre(np.arange(_ORDER), scaled))


def _columns(signals: Signals, _shape: Mapping[str, float]) -> Columns:
    # Forward flight leaves the wake behind: at v_h sideways a third of the effect is left, at 2 v_h nothing.
    sideways = np.linalg.norm(signals.hub_velocity[..., :2], axis=-1) / induced_velocity(signals)
    thrust = signals.rotor_thrust * np.exp(-(sideways**2))
    change = thrust[..., None] * thrust_basis(descent_ratio(signals))
    return Columns(np.stack([thrust_wrench(signals.hubs, change[..., n]) for n in range(_ORDER)], axis=2))


EFFECT = Effect(
    name="vertical_descent",
    title="vertical descent (vortex ring, turbulent wake, windmill brake)",
    kind="wrench",
    formula="dT_i = T_i exp(-(u_xy/v_h)^2) sum a_n t P_n-1(2t - 1),  t = x_i/2.5,  x_i = max(-u_iz/v_h, 0)",
    sentence="A vehicle that sinks into its own wake loses thrust and shakes; sinking faster, it gains thrust.",
    coefficients=tuple(
        Coefficient(f"a_{n + 1}", "1", -3.0, 3.0, f"share of thrust, polynomial of degree {n + 1}")
        for n in range(_ORDER)
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
)
