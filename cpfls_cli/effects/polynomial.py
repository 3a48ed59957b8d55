"""Effects as polynomials of motion and rotor speeds, so that one compiled loop evaluates any of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import combinations_with_replacement, product

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.effects import scales
from cpfls_cli.effects.effect import Effect
from cpfls_cli.effects.signals import Signals
from cpfls_cli.vehicle.settings import VehicleSettings

_AXES = "uvwpqr"
_PAIRS = (*combinations_with_replacement(range(3), 2), *product(range(3), range(3, 6)))
_PAIRS = (*_PAIRS, *((first + 3, second + 3) for first, second in combinations_with_replacement(range(3), 2)))
FACTORS = np.array(_PAIRS)
"""Indices of the two factors of each product among air velocity u v w and body rate p q r, shape (21, 2)."""

STATE_TERMS = (
    "1",
    *_AXES,
    *(_AXES[first] + _AXES[second] for first, second in _PAIRS),
    *(f"|u| {axis}" for axis in "uvw"),
    *(f"|{axis}| {axis}" for axis in "pqr"),
)
"""Terms of the motion: constant, linear, products, and speed times velocity, rate times rate with its sign."""

_PROBES = 900  # More than the products of 34 terms of the motion with 17 of eight rotors, which are fitted to them.
# Shares of the largest value: the residual of an effect that is a polynomial, and a weight that is 0, but for rounding.
_EXACT, _NEGLIGIBLE = 1e-9, 1e-10


def state_terms(velocity: Array, rate: Array) -> Array:
    """Evaluate the terms of the motion.

    `velocity`, shape (time, 3), m/s, body frame: through the air.
    `rate`: shape (time, 3), rad/s, body frame.
    Result: shape (time, 34); in the order of `STATE_TERMS`, SI.
    """
    motion = np.hstack([velocity, rate])
    speed = np.linalg.norm(velocity, axis=1, keepdims=True)
    products = motion[:, FACTORS[:, 0]] * motion[:, FACTORS[:, 1]]
    return np.hstack([np.ones((len(motion), 1)), motion, products, speed * velocity, np.abs(rate) * rate])


def rotor_terms(speed: Array, acceleration: Array) -> Array:
    """Evaluate the terms of the rotors: 1, then speeds, squared speeds and accelerations of all of them.

    `speed`: shape (time, rotor), rad/s.
    `acceleration`: shape (time, rotor), rad/s^2.
    Result: shape (time, 1 + 3 rotors).
    """
    return np.hstack([np.ones((len(speed), 1)), speed, speed**2, acceleration])


@dataclass(frozen=True)
class Probe:
    """Motions and rotor speeds at random, and their terms, for one vehicle."""

    signals: Signals
    # Shape (time, rotor): rotor speeds as shares of the one at which the vehicle hovers; the same for all vehicles of
    # as many rotors.
    share: Array
    rotor: Array
    state: Array

    @property
    def turning(self) -> list[int]:
        """Terms of the rotors that the motions hold: all but the accelerations."""
        return [index for index in range(self.rotor.shape[1]) if np.any(self.rotor[:, index])]

    @cached_property
    def joint(self) -> tuple[Array, Array, Array]:
        """Products of the terms in their own sizes, their pseudo-inverse, and the sizes."""
        joint, inverse, scale = _joint(self.state.tobytes(), self.share.tobytes(), len(self.state))
        rotors = self.share.shape[1]
        sizes = scales.hover_speed(self.signals.vehicle) ** np.repeat([0.0, 1.0, 2.0], [1, rotors, rotors])
        return joint, inverse, scale * np.tile(sizes, self.state.shape[1])

    @classmethod
    @lru_cache(maxsize=8)
    def of(cls, vehicle: VehicleSettings) -> Probe:
        """Draw motions of the size that the vehicle has; what they are inverted by is worked out once for each."""
        rng = np.random.default_rng(0)
        rotors = len(vehicle.rotors)
        share = rng.uniform(0.5, 1.5, (_PROBES, rotors))
        speed = scales.hover_speed(vehicle) * share
        signals = Signals(
            time=np.arange(_PROBES, dtype=float),
            body_rate=rng.uniform(-2.0, 2.0, (_PROBES, 3)),
            vehicle=vehicle,
            attitude=rng.uniform(-1.0, 1.0, (_PROBES, 3)),
            velocity=rng.uniform(-3.0, 3.0, (_PROBES, 3)),
            position=rng.uniform(1.0, 2.0, (_PROBES, 3)),
            rotor_speed=speed,
        )
        terms = rotor_terms(speed, np.zeros_like(speed))
        return cls(signals, share, terms, state_terms(signals.air_velocity, signals.body_rate))


@lru_cache(maxsize=16)
def _joint(state: bytes, share: bytes, probes: int) -> tuple[Array, Array, Array]:
    """Work out `Probe.joint` once for all vehicles of as many rotors, with speeds as shares of that of hovering."""
    terms, speed = (np.frombuffer(values).reshape(probes, -1) for values in (state, share))
    turning = np.hstack([np.ones((probes, 1)), speed, speed**2])
    products = (terms[:, :, None] * turning[:, None]).reshape(probes, -1)
    scale = np.sqrt(np.mean(products**2, axis=0))
    return products / scale, np.asarray(np.linalg.pinv(products / scale)), scale


def polynomial(known: Effect, probe: Probe, shape: Mapping[str, float]) -> Array | None:
    """Find the polynomial that an effect is, from its columns at random motions.

    `shape`: its nonlinear parameters.
    Result: shape (coefficient, 6, state terms, rotor terms); torque and force for a unit of each coefficient, SI, body
    frame; None if the effect is not such a polynomial.
    """
    if known.columns is None or known.kind != "wrench" or known.missing(probe.signals):
        return None
    columns = known.columns(probe.signals, shape)
    direct = fitted_terms(columns.direct, probe)
    if direct is None or columns.momentum is None:
        return direct
    # A momentum of the rotors alone changes with their acceleration; one of the body is inertia, and no wrench.
    momentum = fitted_terms(columns.momentum, probe)
    rotors = len(probe.signals.vehicle.rotors)
    if momentum is None or np.any(momentum[:, :, 1:]) or np.any(momentum[:, :, :, 1 + rotors :]):
        return None
    direct[..., 1 + 2 * rotors :] += momentum[..., 1 : 1 + rotors]
    return direct


def fitted_terms(columns: Array, probe: Probe) -> Array | None:
    """Find the weights that columns of torque and force along a probe are.

    `columns`: shape (time, 6, coefficient).
    Result: shape (coefficient, 6, state terms, rotor terms); None where they leave anything.
    """
    joint, inverse, scale = probe.joint
    values = columns.reshape(len(columns), -1)
    weights = inverse @ values
    size = np.abs(weights).max(axis=0, initial=0.0)
    left = np.abs(values - joint @ weights).max(axis=0, initial=0.0)
    if np.any(left > _EXACT * np.abs(values).max(axis=0, initial=0.0)):
        return None
    weights[np.abs(weights) < _NEGLIGIBLE * size] = 0.0
    found = np.zeros((*columns.shape[1:], probe.state.shape[1], probe.rotor.shape[1]))
    used = probe.turning
    found[..., used] = (weights / scale[:, None]).T.reshape(*columns.shape[1:], probe.state.shape[1], len(used))
    return np.moveaxis(found, 1, 0)
