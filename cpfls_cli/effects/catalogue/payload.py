"""A load that swings on a cable under the vehicle."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.compiling import compiled, part
from cpfls_cli.effects import scales
from cpfls_cli.effects.effect import Coefficient, Columns, Effect, Shape, stack, wrench
from cpfls_cli.effects.hooks import Carrier, Pull
from cpfls_cli.effects.signals import Signals
from cpfls_cli.filters import parabolas
from cpfls_cli.rotations import cross
from cpfls_cli.vehicle.settings import VehicleSettings

# A cable of 0.3 m swings once in 1.1 s, 27 steps, which leave an error of a ten-thousandth.
_STEP_S = 0.04
# Half width of the parabolas: a tenth of the shortest swing, over which it hardly bends.
_SMOOTHING_S = 0.1
# Of the cable across, 30 degrees: a larger free swing at the start is a fit to something else.
_LARGEST_START = 0.5
# As many as the grid of lengths and the dampings and depths beside the best one.
_SWINGS_KEPT = 16
# Of the swing, over which its start is estimated: two tell it from the driven one, later ones have drifted apart.
_PERIODS = 2.0

_State = tuple[float, float, float, float, float, float]


@part
def _rate(state: _State, felt: Array, length: float, damping: float) -> _State:
    x, y, z, u, v, w = state
    a, b, c = felt[0], felt[1], felt[2]
    along = a * x + b * y + c * z
    centripetal = u * u + v * v + w * w
    return (
        u,
        v,
        w,
        -(a - x * along) / length - centripetal * x - damping * u,
        -(b - y * along) / length - centripetal * y - damping * v,
        -(c - z * along) / length - centripetal * z - damping * w,
    )


@part
def _moved(state: _State, rate: _State, step: float) -> _State:
    x, y, z, u, v, w = state
    a, b, c, d, e, f = rate
    return x + step * a, y + step * b, z + step * c, u + step * d, v + step * e, w + step * f


@part
def _unit(state: _State) -> _State:
    """Normalise the direction and project its rate onto the plane across it, against rounding."""
    x, y, z, u, v, w = state
    scale = 1.0 / np.sqrt(x * x + y * y + z * z)
    x, y, z = x * scale, y * scale, z * scale
    along = u * x + v * y + w * z
    return x, y, z, u - along * x, v - along * y, w - along * z


@compiled
def integrate(nodes: Array, middles: Array, step: float, length: float, damping: float) -> Array:
    """Integrate direction and rate of a cable from rest by the classical Runge-Kutta method.

    Parameters
    ----------
    nodes : array, shape (step, 3), m/s^2
        Acceleration of the hook plus gravity at each step, world frame.
    middles : array, shape (step - 1, 3), m/s^2
        Half a step later.
    step : float, s
    length : float, m
    damping : float, 1/s

    Returns
    -------
    array, shape (step, 6)
        Direction, then rate in 1/s.
    """
    state = (0.0, 0.0, -1.0, 0.0, 0.0, 0.0)
    states = np.zeros((len(nodes), 6))
    states[0, 2] = -1.0
    for number in range(len(middles)):
        first = _rate(state, nodes[number], length, damping)
        second = _rate(_moved(state, first, 0.5 * step), middles[number], length, damping)
        third = _rate(_moved(state, second, 0.5 * step), middles[number], length, damping)
        fourth = _rate(_moved(state, third, step), nodes[number + 1], length, damping)
        mean = _moved(_moved(_moved(first, second, 2.0), third, 2.0), fourth, 1.0)
        state = _unit(_moved(state, mean, step / 6.0))
        for index in range(6):
            states[number + 1, index] = state[index]
    return states


def swing(signals: Signals, length: float, damping: float, depth: float = 0.0) -> Array:
    """Integrate the swing of a load on a cable under a moving hook.

    ``n'' = -(a + g z)_across / L - |n'|^2 n - c n'`` for the direction n of the cable, with the part of the
    acceleration across it; integrated by the classical Runge-Kutta method. Large swings are slower than small ones,
    so no filter will do. The cable starts at rest.

    Parameters
    ----------
    signals : Signals
        With velocity.
    length : float, m
        L.
    damping : float, 1/s
        c.
    depth : float, m
        Of the hook below the centre of mass, with which it swings to and fro itself.

    Returns
    -------
    array, shape (time, 6)
        Direction of the cable from the hook, world frame, and its rate in 1/s.

    References
    ----------
    Equation of the spherical pendulum with a moving pivot.
    """
    from scipy.interpolate import CubicSpline

    stride = max(1, round(_STEP_S / signals.period))
    felt = felt_acceleration(signals, depth)
    nodes = np.ascontiguousarray(felt[::stride])
    middles = 0.5 * (felt[:-stride:stride] + felt[stride::stride])
    states = integrate(nodes, middles, stride * signals.period, length, damping)
    # A jump of the velocity, as at the end of a crash, throws it beyond all numbers: from there on it hangs at rest.
    states = np.where(np.isfinite(states).all(axis=1, keepdims=True), states, states[0])
    at = signals.time[::stride]
    # The samples beyond the last step are less than a step away.
    return np.asarray(CubicSpline(at, states)(signals.time))


def felt_acceleration(signals: Signals, depth: float) -> Array:
    """Add gravity to the acceleration of the hook, shape (time, 3), world frame.

    Parameters
    ----------
    signals : Signals
        With velocity.
    depth : float, m
        Of the hook below the centre of mass.
    """
    key, kept = "felt", signals.of_motion
    if key not in kept:
        _make_room(kept)
        kept[key] = np.stack(_felt(signals))
    level, by_depth = kept[key]
    return np.asarray(level + depth * by_depth)


def _felt(signals: Signals) -> tuple[Array, Array]:
    """Differentiate the motion of a hook at the centre of mass, and what each metre of depth adds."""
    assert signals.velocity is not None, "declared among the needs"
    below = np.einsum("tij,tj->ti", signals.rotation, cross(signals.body_rate, np.array([0.0, 0.0, -1.0])))
    if signals.acceleration is None:
        level = _smooth(signals, signals.velocity, 1)
    else:
        level = _smooth(signals, signals.acceleration)
    return level + np.array([0.0, 0.0, signals.vehicle.gravity_m_s2]), _smooth(signals, below, 1)


def _smooth(signals: Signals, values: Array, derivative: Literal[0, 1] = 0) -> Array:
    """Fit parabolas to stretches around each sample: a step of the swing is several samples, and noise averages out."""
    return parabolas(values, max(2, round(_SMOOTHING_S / signals.period)), derivative) / signals.period**derivative


def settled_swing(signals: Signals, length: float, damping: float, depth: float = 0.0) -> Array:
    """Add the free swing at the start, estimated from the force balance, to the driven swing.

    The horizontal pull on the vehicle is ``m_p g`` times the whole swing. Where forces are known, least squares find
    ``m_p`` and the two free swings of each direction, over two periods: later ones hold what has drifted apart since
    the start. Else the cable starts at rest.

    Parameters
    ----------
    signals : Signals
        With velocity.
    length : float, m
    damping : float, 1/s
    depth : float, m
        Of the hook.

    Returns
    -------
    array, shape (time, 2)
    """
    driven = _driven_swing(signals, length, damping, depth)
    if signals.acceleration is None or signals.thrust is None or signals.attitude is None:
        return driven
    mass = signals.vehicle.mass_kg
    pull = mass * signals.acceleration[:, :2] - signals.thrust[:, None] * signals.rotation[:, :2, 2]
    free = _free_swing(signals, length, damping)
    period = 2 * np.pi * np.sqrt(length / signals.vehicle.gravity_m_s2)
    early = slice(round(_PERIODS * period / signals.period))
    own = free[early]
    nothing = np.zeros_like(own)
    columns = np.concatenate(
        [
            np.column_stack([driven[early, 0], own, nothing, np.ones(len(own)), nothing[:, 0]]),
            np.column_stack([driven[early, 1], nothing, own, nothing[:, 0], np.ones(len(own))]),
        ]
    )
    solution = np.linalg.lstsq(columns, pull[early].T.reshape(-1), rcond=None)[0]
    start = solution[1:5] / solution[0] if solution[0] > 0 else np.zeros(4)
    if np.abs(start).max() > _LARGEST_START:
        return driven
    return np.asarray(driven + np.column_stack([free @ start[:2], free @ start[2:]]))


def _driven_swing(signals: Signals, length: float, damping: float, depth: float) -> Array:
    """Integrate the swing of a motion once, for any rotor speeds, shape (time, 2)."""
    key, kept = ("swing", length, damping, depth), signals.of_motion
    if key not in kept:
        _make_room(kept)
        kept[key] = swing(signals, length, damping, depth)[:, :2]
    return kept[key]


def _make_room(kept: dict[Hashable, Array]) -> None:
    """Keep all that a search tries, and no more: each is as long as the flight."""
    if len(kept) >= _SWINGS_KEPT:
        del kept[next(iter(kept))]


def _free_swing(signals: Signals, length: float, damping: float) -> Array:
    time = signals.time - signals.time[0]
    natural = np.sqrt(signals.vehicle.gravity_m_s2 / length)
    turn = np.sqrt(max(natural**2 - damping**2 / 4, 1e-6)) * time
    return np.asarray(np.exp(-0.5 * damping * time)[:, None] * np.column_stack([np.cos(turn), np.sin(turn)]))


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
    sentence="A load on a cable swings under the vehicle and pulls it back and forth after each change of speed.",
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
