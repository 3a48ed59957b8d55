"""A load that swings on a cable under the vehicle."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.compiling import compiled, part
from cpfls_cli.effects import scales
from cpfls_cli.effects.effect import Coefficient, Columns, Effect, Shape, stack, wrench
from cpfls_cli.effects.hooks import Body
from cpfls_cli.effects.signals import Signals
from cpfls_cli.rotations import cross
from cpfls_cli.vehicle.motion import Carrier, Instant, Numbers, Pull
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.vehicle.values import Vector, add, apply, dot, plus, scaled, subtract, transposed
from cpfls_cli.vehicle.values import cross as across

_STEP_S = 0.04  # A cable of 0.3 m swings once in 1.1 s, 27 steps, which leave an error of a ten-thousandth.
_SMOOTHING_S = 0.1  # Half width of the parabolas: a tenth of the shortest swing, over which it hardly bends.
# Of the cable across, 30 degrees: a larger free swing at the start is a fit to something else.
_LARGEST_START = 0.5
_AT_REST = np.zeros(4)
_NUDGE = 1e-4  # Of the start, for its derivatives: a swing bends by a thousandth of it over that.
_MOVES = 2  # Of Gauss and Newton over the first part; over each later one a single one, from so near.
_LONGER = 4  # Of a part over the one before: a start from two swings is not a swing off after eight.
# Squares left at the beginning, over those of a start found there: some swings in gusts identify a start no better.
_WORSE = 2.0
_SWINGS_KEPT = 32  # As many as the grid of lengths and the dampings and depths around the best one.
_PERIODS = 2.0  # Of the swing, over which its start is sought first: two separate it from the driven one.

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
def integrate(nodes: Array, middles: Array, step: float, length: float, damping: float, start: Array) -> Array:
    """Integrate direction and rate of a cable by the classical Runge-Kutta method.

    `nodes`, shape (step, 3), m/s^2: acceleration of the hook plus gravity at each step, world frame.
    `middles`, shape (step - 1, 3), m/s^2: half a step later.
    `step`: s.
    `length`: m.
    `damping`: 1/s.
    `start`, shape (6,): direction, then rate in 1/s, at the first step.
    Result: shape (step, 6); direction, then rate in 1/s.
    """
    state = (start[0], start[1], start[2], start[3], start[4], start[5])
    states = np.zeros((len(nodes), 6))
    for index in range(6):  # Written one by one: an assigned row takes numba most of the time of compiling.
        states[0, index] = state[index]
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
    """Integrate the swing of a load on a cable under a moving hook, from rest.

    ``n'' = -(a + g z)_across / L - |n'|^2 n - c n'`` for the direction n of the cable, with the part of the
    acceleration across it; integrated by the classical Runge-Kutta method. Large swings are slower than small ones,
    so no filter will do.

    `signals`: with velocity.
    `length`, m: L.
    `damping`, 1/s: c.
    `depth`, m: of the hook below the centre of mass, with which it swings to and fro itself.
    Result: shape (time, 6); direction of the cable from the hook, world frame, and its rate in 1/s.
    Reference: Equation of the spherical pendulum with a moving pivot.
    """
    return _at_samples(signals, _Way.of(signals, length, damping, depth).swing(_AT_REST))


def _at_samples(signals: Signals, states: Array) -> Array:
    from scipy.interpolate import CubicSpline

    # The samples beyond the last step are less than a step away.
    return np.asarray(CubicSpline(signals.time[:: _stride(signals)], states)(signals.time))


def _stride(signals: Signals) -> int:
    return max(1, round(_STEP_S / signals.period))


@dataclass(frozen=True)
class _Way:
    """The way of a hook in steps, under which a cable swings from any start."""

    felt: Array
    middles: Array
    step: float
    length: float
    damping: float
    gravity: float

    @classmethod
    def of(cls, signals: Signals, length: float, damping: float, depth: float) -> _Way:
        stride = _stride(signals)
        felt = felt_acceleration(signals, depth)
        middles = 0.5 * (felt[:-stride:stride] + felt[stride::stride])
        nodes, step = np.ascontiguousarray(felt[::stride]), stride * signals.period
        return cls(nodes, middles, step, length, damping, signals.vehicle.gravity_m_s2)

    @property
    def natural(self) -> float:
        """Frequency of small swings in rad/s."""
        return float(np.sqrt(self.gravity / self.length))

    def swing(self, start: Array) -> Array:
        """Integrate from a deflection along x and y and a rate of it, both in radians, the rate over the frequency."""
        across, rate = start[:2], start[2:] * self.natural
        height = 1 - across @ across
        # No load hangs there; it is at rest then, as what is lost.
        down = -np.sqrt(height) if height > 0 else np.nan
        first = np.array([*across, down, *rate, -(across @ rate) / down])
        states = integrate(self.felt, self.middles, self.step, self.length, self.damping, first)
        # A jump of the velocity, as at the end of a crash, throws it further than steps can follow: from there on it is
        # at rest.
        if np.abs(states[:, 3:]).max() * self.step < 1:
            return states
        lost = np.maximum.accumulate(~(np.abs(states[:, 3:]).max(axis=1) * self.step < 1))
        return np.where(lost[:, None], [0.0, 0.0, -1.0, 0.0, 0.0, 0.0], states)

    def pull(self, start: Array) -> Array:
        """Pull across the vertical for each kilogram of the load, shape (step, 2)."""
        states = self.swing(start)
        return _tension(self.length, states, self.felt)[:, None] * states[:, :2]


def _tension(length: float, states: Array, felt: Array) -> Array:
    """Tension of the cable for each kilogram of the load, shape (time,), m/s^2."""
    # Sums over rows of three take several times as long.
    x, y, z, *rates = states.T
    u, v, w = (rate * rate for rate in rates)
    return np.asarray(length * (u + v + w) - (felt[:, 0] * x + felt[:, 1] * y + felt[:, 2] * z))


def felt_acceleration(signals: Signals, depth: float) -> Array:
    """Add gravity to the acceleration of the hook, shape (time, 3), world frame.

    `signals`: with velocity; `depth`, m: of the hook below the centre of mass.
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
    from scipy.signal import savgol_filter

    length = 1 + 2 * max(2, round(_SMOOTHING_S / signals.period))
    return np.asarray(savgol_filter(values, length, 2, derivative, signals.period, axis=0))


def settled_swing(signals: Signals, length: float, damping: float, depth: float = 0.0) -> Array:
    """Integrate the swing from where the force balance says that it began.

    `signals`: with velocity. Without thrust and acceleration the cable starts at rest.
    `length`: m.
    `damping`: 1/s.
    `depth`, m: of the hook.
    Result: shape (time, 6); direction of the cable from the hook, world frame, and its rate in 1/s.
    """
    way, start = _Way.of(signals, length, damping, depth), _AT_REST
    if signals.acceleration is not None and signals.thrust is not None and signals.attitude is not None:
        start = _start(signals, way)
    if start is not _AT_REST:
        return _at_samples(signals, way.swing(start))
    key, kept = ("swing", length, damping, depth), signals.of_motion
    if key not in kept:
        _make_room(kept)
        kept[key] = way.swing(start)
    return _at_samples(signals, kept[key])


def _start(signals: Signals, way: _Way) -> Array:
    """Find the start from which a load pulls on the vehicle as the force balance says, by least squares.

    Of the horizontal forces mass and start of the load explain what a constant push and a drag do not. Two periods
    separate the start from the driven swing; from there the search goes on over four times as much, up to the whole
    flight, so that it never has to find its way among the swings of a load that has drifted apart. Where these show no
    load, as in a gust against it, it begins with four times as much. It ends where the beginning contradicts: what
    rings late is no swing at the start.

    Result: shape (4,); as `_Way.swing` takes it; at rest where nothing pulls like a load.
    """
    assert signals.acceleration is not None
    assert signals.thrust is not None
    assert signals.velocity is not None
    steps = slice(None, None, _stride(signals))
    tilt = signals.rotation[steps, :2, 2]
    needed = signals.vehicle.mass_kg * signals.acceleration[steps, :2] - signals.thrust[steps, None] * tilt
    balance = _Balance(way, needed, signals.velocity[steps, :2])
    starts, periods, first, most = [_AT_REST], _PERIODS, balance, np.inf
    while periods < _LONGER * balance.periods:
        part = balance.up_to(min(periods, balance.periods))
        start = part.start(starts[-1], _MOVES if len(starts) == 1 else 1)
        if start is not None and len(starts) == 1:
            first, most = part, _WORSE * part.left(start)
        if start is not None and first.left(start) <= most:
            starts.append(start)
        elif len(starts) > 1:
            break
        periods *= _LONGER
    return min(starts, key=balance.left) if len(starts) > 1 else _AT_REST


@dataclass(frozen=True)
class _Balance:
    """Horizontal forces that something but rotors and weight applies, and the velocity that a drag goes with."""

    way: _Way
    needed: Array
    velocity: Array

    @property
    def periods(self) -> float:
        """Number of small swings that it lasts."""
        return len(self.needed) * self.way.step * self.way.natural / (2 * np.pi)

    def up_to(self, periods: float) -> _Balance:
        steps = round(len(self.needed) * periods / self.periods)
        way = replace(self.way, felt=self.way.felt[:steps], middles=self.way.middles[: steps - 1])
        return _Balance(way, self.needed[:steps], self.velocity[:steps])

    def start(self, start: Array, moves: int) -> Array | None:
        """Move a start by Gauss and Newton; None beyond all bounds, or where no load explains the forces."""
        for _ in range(moves):
            pull = self.way.pull(start)
            bends = [(self.way.pull(start + _NUDGE * each) - pull) / _NUDGE for each in np.eye(4)]
            columns, needed = self._rows(pull, *bends)
            # Beyond all numbers where a jump of the velocity throws the load.
            mass, *change = _solved(columns, needed)[:5] if np.isfinite(columns).all() else (0.0,)
            if mass <= 0:
                return None
            start = start + np.array(change) / mass
            if np.linalg.norm(start[:2]) >= 1 or np.linalg.norm(start[2:]) >= 1:
                return None
        return start if np.abs(start).max() <= _LARGEST_START else None

    def left(self, start: Array) -> float:
        """Sum the squares that a load with this start leaves."""
        columns, needed = self._rows(self.way.pull(start))
        if not np.isfinite(columns).all():
            return np.inf
        return float(np.square(needed - columns @ _solved(columns, needed)).sum())

    def _rows(self, *pulls: Array) -> tuple[Array, Array]:
        pushes = [np.broadcast_to(each, self.needed.shape) for each in np.eye(2)]
        columns = [each.T.reshape(-1) for each in (*pulls, *pushes, self.velocity)]
        return np.stack(columns, axis=1), self.needed.T.reshape(-1)


def _solved(columns: Array, needed: Array) -> Array:
    return np.asarray(np.linalg.lstsq(columns, needed, rcond=None)[0])


def _make_room(kept: dict[Hashable, Array]) -> None:
    """Keep all that a search tries, and no more: each is as long as the flight."""
    if len(kept) >= _SWINGS_KEPT:
        del kept[next(iter(kept))]


def _columns(signals: Signals, shape: Mapping[str, float]) -> Columns:
    length, depth = shape["length_m"], shape["depth_m"]
    states = settled_swing(signals, length, shape["damping_1_s"], depth)
    tension = _tension(length, states, felt_acceleration(signals, depth))
    pull = np.einsum("tji,tj->ti", signals.rotation, states[:, :3] * tension[:, None])
    levers = (wrench(cross(hook, pull)) for hook in -np.eye(3)[::-1])
    return Columns(stack(*levers, wrench(force=pull)))


def _pull(see: Instant, p: Numbers, state: Vector, carrier: Carrier) -> Pull:
    """Pull at a carrier whose acceleration depends on the pull; both are linear in the tension.

    State: direction n of the cable and its rate, ``n'' = -(a + g z)_across / L - |n'|^2 n - c n'`` with a the
    acceleration of the hook, and the tension per mass ``t = L |n'|^2 - (a + g z) . n``. Mass times hook is the lever of
    the pull ``m_p t n``.
    """
    along, rate, rotation = state[:3], state[3:], see.rotation
    cable = scaled(1 / see.functions.sqrt(dot(along, along)), along)
    hook, lever = (0, 0, -p["depth_m"]), tuple(-p[f"mass_times_{place}"] for place in ("behind", "right", "depth"))
    pulled = scaled(p["mass"] / see.vehicle.mass_kg, cable)
    turned = apply(carrier.inverse, across(lever, apply(transposed(rotation), cable)))
    bent = add(across(carrier.turning, hook), across(see.body_rate, across(see.body_rate, hook)))
    felt = add(carrier.acceleration, apply(rotation, bent), (0, 0, see.vehicle.gravity_m_s2))
    response = add(pulled, apply(rotation, across(turned, hook)))
    centripetal = dot(rate, rate)
    tension = (p["length_m"] * centripetal - dot(felt, cable)) / plus(1, dot(response, cable))
    felt = add(felt, scaled(tension, response))
    sideways = subtract(felt, scaled(dot(felt, cable), cable))
    swing = add(scaled(-1 / p["length_m"], sideways), scaled(-centripetal, cable), scaled(-p["damping_1_s"], rate))
    return Pull(scaled(tension, pulled), scaled(tension, turned), (*rate, *swing))


def _hook(known: Mapping[str, float]) -> float:
    """Say by the torque of the load how deep its hook is: a deeper one swings more, as a heavier load pulls more."""
    return known["mass_times_depth"] / known["mass"] if known["mass"] > 0 else np.nan


def _accounts(number: str, _values: Mapping[str, float], _vehicle: VehicleSettings) -> float:
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
            tuple(float(length) for length in np.geomspace(0.3, 4.0, 24).round(2)),
            "length of the cable",
            # A light damping lets it swing all flight long, and a few per cent make it one swing late.
            valley=0.02,
        ),
        # A swing that is forgotten sooner forgives more of a length and of a start that are a little off.
        Shape("damping_1_s", "1/s", (0.02, 0.2, 0.4, 0.6), "damping of the swing", first=0.4),
        Shape("depth_m", "m", (0.0, 0.1, 0.3), "depth of the hook below the centre of mass", first=0.0, follows=_hook),
    ),
    carried=Body(_pull, (0.0, 0.0, -1.0, 0.0, 0.0, 0.0)),
    accounts=_accounts,
)
