"""What a simulator holds of a vehicle: its part of the weights, its rotors, and the size of what is missing."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.dynamics import CELLS, InertiaFunctions, InertiaModel, body_inertia, vertical
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.effects.scales import hover_speed
from cpfls_cli.errors import InputError
from cpfls_cli.export.numbers import Numbers, motion_terms, spins, weights_by_part, weights_of_model
from cpfls_cli.export.points import parts_of
from cpfls_cli.inertia import nearest_body
from cpfls_cli.playback.flight import Body, MeasuredMotion, PlaybackFlight
from cpfls_cli.playback.model import VehicleModel, turning_by_attitude
from cpfls_cli.playback.player import in_the_air
from cpfls_cli.playback.rotors import RotorResponse
from cpfls_cli.playback.windows import Flown, Rotors, Runs, Steps, errors_of_runs
from cpfls_cli.rotations import rotation_matrix
from cpfls_cli.vehicle.motion import Acting, Vehicle
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.vehicle.tracing import Graph, traced_in_two
from cpfls_cli.vehicle.values import Each, Vector, add, plus

HORIZON_S = 0.5
"""How far ahead the size of what is missing is stated."""

# The flight about hover: runs with steps of 10 ms, speeds with waves of 5 % below and above what motors follow, and
# velocities in m/s, rates in rad/s and tilts in rad of a vehicle that is flown gently.
_RUNS, _PERIOD, _FREQUENCIES = 24, 0.01, (0.7, 2.0, 5.0)
_SPEED_SPREAD, _VELOCITY, _RATE, _TILT = 0.05, 1.5, 1.0, 0.25

NOTHING, _ROUNDING = 1e-9, 1e-12
"""Distance in SI that half a second without a part may end off, and torque or force: below both are rounding."""

_LAG, _DELAY, _SLOW = "lag of the rotors", "delay of the rotors", "slow actuation"
_ROTORS = "what differs between rotors, and their places"
_LEARNED = "the learned part, without a name"
_NO_BODY = "inertia with a moment larger than the sum of the others, which no body has: the nearest possible is used"
_PRODUCTS = "products of inertia"
_WIND = "wind of its flights, {:.3g} and {:.3g} m/s along x and y of the world, which the simulated world must provide"
FUZZY = "inertia that depends on the attitude"
FOUR = 4
"""Rotors that most simulators know."""

Holds = Callable[[Array], Array]
"""From a table of weights, shape (6, terms, 1 + 4 rotors), to the part of it that a target holds; linear."""


class Off(NamedTuple):
    """How far runs of half a second end apart: means of the norms of body rate, attitude, velocity and position, SI.

    NaN for what a flight does not show; the body rate is always known.
    """

    rate: float
    attitude: float
    velocity: float
    position: float

    @classmethod
    def of(cls, ends: Array) -> Self:
        """Take what runs end apart by, in the order of playback: position, velocity, attitude, rate."""
        return cls(*ends[::-1].tolist())

    @property
    def sentence(self) -> str:
        """All that is known, with units."""
        values = (self.rate, np.degrees(self.attitude), self.velocity, self.position)
        pairs = zip(values, ("rad/s", "degrees", "m/s", "m"), strict=True)
        *first, last = [f"{value:.3g} {unit}" for value, unit in pairs if np.isfinite(value)]
        return f"{', '.join(first)} and {last}" if first else last


@dataclass(frozen=True)
class Missing:
    """A part of a vehicle that a target does not hold, or not whole.

    Attributes
    ----------
    torque, force : float, N m and N
        Root mean square of the largest axis; NaN where nobody measured it.
    floors : float
        The same in noise floors of the flights that the model was made with; NaN where the model holds none.
    off : Off or None
        How far half a second without it ends from the whole model; None where nobody measured that.
    where : str
        Along what both were measured.
    instead : str or None
        What makes up for it outside of the target; None where nothing simple does.
    """

    title: str
    torque: float
    force: float
    floors: float
    off: Off | None
    where: str = "about hover"
    instead: str | None = None

    @property
    def sentence(self) -> str:
        """What is missing, and its size."""
        if self.off is None:
            unknown = "its size depends on the flight and was not measured along one"
            return f"Not held: {self.title}; {self.instead or unknown}."
        size = f": {self.torque:.3g} N m and {self.force:.3g} N {self.where}" if self.torque or self.force else ""
        size += f", {self.floors:.3g} noise floors" if size and not np.isnan(self.floors) else ""
        ends = f"half a second without it ends {self.off.sentence} off"
        return f"Not held, or only in part: {self.title}{size}; {ends}."


@dataclass(frozen=True)
class Held:
    """What a target flies.

    `weights`: torque and force by terms of the motion and of the rotors, shape (6, terms, 1 + 4 rotors); `squares`:
    whether the lag acts on speeds and on squared speeds each, and not on the speeds alone; `fuzzy`: in the place of the
    inertia of `body`; `numbers`: of a target that has numbers of its own; `beyond`: what is no sum of weights, and
    levers for its forces; `wind`: m/s, world frame.
    """

    vehicle: VehicleSettings
    weights: Array
    response: RotorResponse
    body: Body
    squares: bool = False
    fuzzy: InertiaModel | None = None
    numbers: Mapping[str, float] = field(default_factory=dict)
    beyond: tuple[Acting, ...] = ()
    wind: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @classmethod
    def whole(cls, model: VehicleModel) -> Self:
        """Hold everything."""
        acting = model.parts
        parts = weights_by_part(model)
        others = tuple(one for one in acting if one.name not in parts)
        levers = tuple(one for one in acting if one.of_all_forces)
        return cls(
            model.vehicle,
            np.asarray(sum(parts.values())),
            model.response,
            model.body,
            fuzzy=model.fuzzy,
            beyond=(*others, *levers) if others else (),
            wind=model.wind,
        )

    def rotor(self, flight: PlaybackFlight) -> Array:
        """Evaluate the terms of the rotors over each step of a flight, shape (time, 1 + 4 rotors)."""
        terms = flight.rotor_terms(*self.response.times)
        if self.squares:
            # The flight keeps its own.
            terms, rotors = terms.copy(), flight.speed.shape[1]
            squared = replace(flight, speed=flight.speed**2).rotor_terms(*self.response.times)
            terms[:, 1 + rotors : 1 + 2 * rotors] = squared[:, 1 : 1 + rotors]
        return terms

    def wrench(self, air: Array, rate: Array, rotor: Array) -> Array:
        """Compute torque and force, shape (samples, 6), N m and N, body frame."""
        by_rotor = np.tensordot(motion_terms(air, rate), self.weights, (1, 1))
        total: Array = np.einsum("tcu,tu->tc", by_rotor, rotor)
        if self.beyond:
            for column, component in enumerate(self._traced((*air.T, *rate.T, *rotor[:, 1:].T))):
                total[:, column] += component
        return total

    @cached_property
    def _traced(self) -> Callable[[tuple[Array, ...]], Vector]:
        """Trace what is no sum of weights as one function of arrays: air velocity, rate, and terms of the rotors."""
        graph = Graph()
        moved = graph.inputs("moved", 6 + 4 * len(self.vehicle.rotors))
        speed, square, turning, slow = np.reshape(np.array(moved[6:], dtype=object), (4, -1))
        rotors = (Each(speed), Each(turning), Each(map(plus, slow, square)))
        parts = parts_of(self.beyond, self.vehicle, (moved[:3], moved[3:6], *rotors))
        step = traced_in_two(graph, ("of_none", ()), {"moved": moved}, [add(*(wrench for _, wrench in parts))])(())
        return lambda given: step(given)[0]

    def along(self, flight: PlaybackFlight) -> Array:
        """Compute torque and force along a measured motion, shape (time, 6), N m and N, body frame."""
        motion = flight.motion
        air = np.einsum("tji,tj->ti", motion.rotation, motion.velocity - self.wind)
        return self.wrench(air, motion.rate, self.rotor(flight))

    def errors(self, flight: PlaybackFlight, starts: IntArray, horizon: int) -> Array:
        """Fly from samples of a flight as playback does, shape (run, horizon, 4, 3)."""
        runs = Runs(in_the_air(flight, self.wind).motion, starts, flight.translates)
        turning = None if self.fuzzy is None else turning_by_attitude(self.fuzzy)
        flown = _Flown(Vehicle(self.vehicle, ()), self.body, turning=turning, held=self)
        terms = self.rotor(flight)[starts + np.arange(horizon)[:, None]]
        return errors_of_runs(flown, runs, Steps(terms, terms))[0]


@dataclass(frozen=True, kw_only=True)
class _Flown(Flown):
    """A vehicle of sums of weights that runs fly."""

    held: Held

    def wrench(self, air: Vector, rate: Vector, rotors: Rotors) -> tuple[Vector, Vector]:
        # The lag of a target may act on squared speeds, so that terms of the rotors come as they are.
        assert rotors.push is not None, "terms stand in its place"
        terms = np.stack(rotors.push, axis=1)
        found = self.held.wrench(np.stack(air, axis=1), np.stack(rate, axis=1), terms)
        return tuple(found[:, :3].T), tuple(found[:, 3:].T)


def held_by(
    model: VehicleModel,
    holds: Holds,
    body: Body | None = None,
    numbers: Numbers | None = None,
    *,
    lags: bool = False,
    squares: bool = False,
) -> Held:
    """Take what a target of this body, or the model's, numbers of its own, and rotors with a lag or none holds."""
    weights, response = weights_of_model(model), RotorResponse(lag_s=model.response.lag_s if lags else 0.0)
    found = {} if numbers is None else numbers.of(weights)
    return Held(model.vehicle, holds(weights), response, body or model.body, squares, numbers=found)


ANY_ROTORS = "--format mjcf, sdf, jax and casadi take any"


def require_four(model: VehicleModel, pushes: str) -> None:
    """Refuse a vehicle without four rotors for a target that `pushes` at, or mixes, no other number of them."""
    if model.rotors != FOUR:
        raise InputError(f"{pushes} four rotors, but this vehicle has {model.rotors}; {ANY_ROTORS} number")


def require_two_each_way(model: VehicleModel, target: str) -> None:
    """Refuse a vehicle for a target that turns four rotors, two each way, where it has others."""
    if model.rotors != FOUR or spins(model.vehicle).sum():
        raise InputError(f"{target} turns four rotors, two each way, which this vehicle has not; {ANY_ROTORS}")


def identified_of(model: VehicleModel) -> InertiaFunctions | None:
    """Give the identified model whose inertia depends on the attitude; None for a constant inertia."""
    assert model.fuzzy is None or isinstance(model.fuzzy, InertiaFunctions), "no other depends on the attitude"
    return model.fuzzy


def constant_body(model: VehicleModel) -> Body:
    """Take the inertia of a vehicle for targets that hold but one: the mean over attitudes that training visited."""
    fuzzy = identified_of(model)
    if fuzzy is None:
        return model.body
    cell = 2 * np.pi / CELLS
    roll, pitch = ((np.argwhere(fuzzy.visited) + 0.5) * cell - np.pi).T
    attitude = np.column_stack([roll, pitch, np.zeros_like(roll)])
    _, tensors = body_inertia(fuzzy, attitude[~vertical(attitude)])
    mean = tensors.mean(axis=0) if len(tensors) else np.zeros((3, 3))
    if not np.linalg.eigvalsh(mean).min() > 0:
        raise InputError("its inertia, averaged where training went, is not that of any body; identify it again")
    return _with_inertia(model.body, mean)


def of_a_body(body: Body, margin: float = 0.0) -> Body:
    """Take the nearest inertia of a body: each principal moment is less, by a margin, than the sum of the others."""
    inertia = nearest_body(body.inertia, margin)
    if inertia is body.inertia:
        return body
    return _with_inertia(body, inertia)


def _with_inertia(body: Body, inertia: Array) -> Body:
    return body._replace(inertia=inertia, inverse=np.asarray(np.linalg.inv(inertia), dtype=float))


def missing(
    model: VehicleModel, held: Held, holds: Holds, floor: Array, wind: tuple[float, float, float]
) -> list[Missing]:
    """List what a target does not hold, each with its size, also in noise floors, shape (6,), N m and N."""
    flight, whole = probe_flight(model), replace(Held.whole(model), wind=(0.0, 0.0, 0.0))
    others = [*_left(model, whole, holds), *_others(held, whole)]
    if any(wind):
        others.append((_WIND.format(*wind), replace(whole, wind=wind)))
    if not others:
        return []
    known, wrench = _ends(whole, flight), whole.along(flight)
    found = []
    for title, other in others:
        size = np.sqrt(((wrench - other.along(flight)) ** 2).mean(axis=0))
        found.append(sized(title, size, floor, _apart(known, _ends(other, flight))))
    return [each for each in found if each.off is None or max(each.off) > NOTHING]


def together(model: VehicleModel, held: Held) -> Off:
    """Tell how far a target ends from the whole model after half a second about hover."""
    flight = probe_flight(model)
    return _apart(*(_ends(each, flight) for each in (Held.whole(model), held)))


def _left(model: VehicleModel, whole: Held, holds: Holds) -> Iterator[tuple[str, Held]]:
    """Give the whole model but for what is not held of each part."""
    rotors = model.rotors
    columns = {_ROTORS: slice(1 + rotors, 1 + 2 * rotors), _SLOW: slice(1 + 3 * rotors, None)}
    parts = weights_by_part(model)
    for name in (one.name for one in model.parts):
        title = CATALOGUE[name].title if name in CATALOGUE else _LEARNED
        if name == "rotors":
            pieces = {title: np.zeros_like(whole.weights) for title in columns}
            for title, own in columns.items():
                pieces[title][:, :, own] = parts[name][:, :, own]
        else:
            pieces = {title: parts[name]} if name in parts else {}
        for piece, weights in pieces.items():
            if (left := weights - holds(weights)).any():
                yield piece, replace(whole, weights=whole.weights - left)
        if name not in parts and holds is not everything:
            yield title, replace(whole, beyond=tuple(one for one in whole.beyond if one.name != name))


def everything(weights: Array) -> Array:
    """Hold all weights, and what is no sum of them."""
    return weights


def _others(held: Held, whole: Held) -> Iterator[tuple[str, Held]]:
    """Give the whole model but for what a target has otherwise than torque and force."""
    own, other = whole.response, held.response
    if own.delay_s != other.delay_s:
        yield _DELAY, replace(whole, response=replace(own, delay_s=other.delay_s))
    if own.lag_s != other.lag_s or (held.squares and own.lag_s):
        title = f"{_LAG}: it acts on squared speeds" if held.squares else _LAG
        yield title, replace(whole, response=replace(own, lag_s=other.lag_s), squares=held.squares)
    if whole.fuzzy is not None and held.fuzzy is None:
        yield FUZZY, replace(whole, fuzzy=None, body=held.body)
    elif np.any(held.body.inertia != whole.body.inertia):
        known = np.array_equal(np.diag(held.body.inertia), np.diag(whole.body.inertia))
        yield _PRODUCTS if known else _NO_BODY, replace(whole, body=held.body._replace(gravity=whole.body.gravity))
    if held.body.gravity != whole.body.gravity:
        yield "gravity", replace(whole, body=whole.body._replace(gravity=held.body.gravity))


def _ends(held: Held, flight: PlaybackFlight) -> Array:
    """Fly each stretch of a flight to its end, shape (run, 4, 3)."""
    horizon = len(flight) // len(flight.stretches) - 1
    return held.errors(flight, flight.starts(horizon, 1), horizon)[:, -1]


def _apart(first: Array, second: Array) -> Off:
    return Off.of(np.linalg.norm(second - first, axis=2).mean(axis=0))


def sized(title: str, size: Array, floor: Array, off: Off, where: str = Missing.where) -> Missing:
    """State the size of a part, its root mean square, shape (6,), N m and N, also in noise floors."""
    floors = size / floor
    largest = float(np.nanmax(floors)) if np.isfinite(floors).any() else float("nan")
    torque, force = (float(np.where(part < _ROUNDING, 0.0, part).max()) for part in (size[:3], size[3:]))
    return Missing(title, torque, force, largest, off, where)


def probe_flight(model: VehicleModel) -> PlaybackFlight:
    """Make a flight of short stretches about hover, each from a state at random along rotor speeds that wave."""
    rng, samples = np.random.default_rng(0), round(HORIZON_S / _PERIOD) + 1
    time = _PERIOD * np.arange(samples)
    hover, shape = hover_speed(model.vehicle), (_RUNS, model.rotors)
    waves = [
        np.sin(2 * np.pi * f * time[None, :, None] + rng.uniform(0, 2 * np.pi, shape)[:, None]) for f in _FREQUENCIES
    ]
    speed = hover * (1.0 + _SPEED_SPREAD * np.sum(waves, axis=0))
    velocity = rng.normal(0.0, _VELOCITY, (_RUNS, 3))
    rate = rng.normal(0.0, _RATE, (_RUNS, 3))
    rotation = rotation_matrix(rng.normal(0.0, [_TILT, _TILT, 1.0], (_RUNS, 3)))
    motion = MeasuredMotion(
        np.zeros((_RUNS * samples, 3)),
        np.repeat(velocity, samples, axis=0),
        np.repeat(rotation, samples, axis=0),
        np.repeat(rate, samples, axis=0),
        _PERIOD,
    )
    stretches = tuple(slice(start, start + samples) for start in range(0, _RUNS * samples, samples))
    return PlaybackFlight(
        name="about hover",
        motion=motion,
        speed=np.ascontiguousarray(speed.reshape(-1, model.rotors)),
        hold="linear",
        stretches=stretches,
    )
