"""What a simulator holds of a vehicle: its part of the weights, its rotors, and the size of what is missing."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple, Self

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.dynamics.equations_of_motion import InertiaModel, body_inertia
from cpfls_cli.dynamics.inertia_functions import CELLS, InertiaFunctions
from cpfls_cli.dynamics.rigid_body import vertical
from cpfls_cli.effects.polynomial import STATE_TERMS
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.effects.scales import hover_speed
from cpfls_cli.errors import InputError
from cpfls_cli.export.numbers import Numbers
from cpfls_cli.inertia import nearest_body
from cpfls_cli.playback.flight import PlaybackFlight
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.playback.motion import Body, MeasuredMotion
from cpfls_cli.playback.player import Player, apart, free_runs, player_of, rotor_terms_along
from cpfls_cli.playback.rotors import RotorResponse
from cpfls_cli.playback.table import WrenchTable, body_of
from cpfls_cli.rotations import rotation_matrix

HORIZON_S = 0.5
"""How far ahead the size of what is missing is told."""

# The flight about hover: runs with steps of 10 ms, speeds with waves of 5 % below and above what motors follow, and
# velocities in m/s, rates in rad/s and tilts in rad of a vehicle that is flown gently.
_RUNS, _PERIOD, _FREQUENCIES = 24, 0.01, (0.7, 2.0, 5.0)
_SPEED_SPREAD, _VELOCITY, _RATE, _TILT = 0.05, 1.5, 1.0, 0.25

NOTHING, _ROUNDING = 1e-9, 1e-12
"""Distance in SI that half a second without a part may end off, and torque or force: below both are rounding."""

_LAG, _DELAY, _SLOW = "lag of the rotors", "delay of the rotors", "slow actuation"
_LINEAR = "part of the thrust that is linear in the speed"
_ROTORS = "what differs between rotors, and their places"
_LEARNED = "the learned part, without a name"
_NO_BODY = "inertia with a moment larger than the sum of the others, which no body has: the nearest possible is used"
_PRODUCTS = "products of inertia"
_WIND = "wind of its flights, {:.3g} and {:.3g} m/s along x and y of the world, which the simulated world must provide"
FUZZY = "inertia that depends on the attitude"

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
    """

    title: str
    torque: float
    force: float
    floors: float
    off: Off | None
    where: str = "about hover"

    @property
    def sentence(self) -> str:
        """What is missing, and its size."""
        if self.off is None:
            return f"Not held: {self.title}; its size depends on the flight and was not measured along one."
        if not (self.torque or self.force):
            return f"Not held, or only in part: {self.title}; half a second without it ends {self.off.sentence} off."
        floors = "" if np.isnan(self.floors) else f", {self.floors:.3g} noise floors"
        return (
            f"Not held, or only in part: {self.title}: {self.torque:.3g} N m and {self.force:.3g} N {self.where}"
            f"{floors}; half a second without it ends {self.off.sentence} off."
        )


@dataclass(frozen=True)
class Held:
    """What a target flies.

    Attributes
    ----------
    squares : bool
        Whether the lag acts on speeds and on squared speeds each, and not on the speeds alone.
    fuzzy : InertiaModel or None
        In the place of the inertia of `body`.
    numbers : mapping of str to float
        Of a target that has numbers of its own.
    """

    table: WrenchTable
    response: RotorResponse
    body: Body
    squares: bool = False
    fuzzy: InertiaModel | None = None
    numbers: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def whole(cls, model: VehicleModel) -> Self:
        """Hold everything."""
        return cls(model.table, model.response, model.body, fuzzy=model.fuzzy)

    def rotor(self, flight: PlaybackFlight) -> Array:
        """Evaluate the terms of the rotors over each step of a flight, shape (time, 1 + 4 rotors)."""
        terms = rotor_terms_along(flight, self.response)
        if self.squares:
            rotors = flight.speed.shape[1]
            squared = rotor_terms_along(replace(flight, speed=flight.speed**2), self.response)
            terms[:, 1 + rotors : 1 + 2 * rotors] = squared[:, 1 : 1 + rotors]
        return terms

    def player(self, flight: PlaybackFlight) -> Player:
        """Make it ready for a flight."""
        return Player(self.table, self.rotor(flight), self.body, fuzzy=self.fuzzy)


def held_by(
    model: VehicleModel,
    holds: Holds,
    response: RotorResponse,
    body: Body | None = None,
    numbers: Numbers | None = None,
    *,
    squares: bool = False,
) -> Held:
    """Take what a target of these rotors, this body, or the model's, and numbers of its own holds of a vehicle."""
    weights = model.table.weights
    table = WrenchTable(holds(weights)[:, : len(STATE_TERMS)])
    return Held(table, response, body or model.body, squares, numbers={} if numbers is None else numbers.of(weights))


def constant_body(model: VehicleModel) -> Body:
    """Take the inertia of a vehicle for targets that hold but one: the mean over attitudes that training visited."""
    if model.fuzzy is None:
        return model.body
    assert isinstance(model.fuzzy, InertiaFunctions), "an inertia over attitude is that of an identified model"
    cell = 2 * np.pi / CELLS
    roll, pitch = ((np.argwhere(model.fuzzy.visited) + 0.5) * cell - np.pi).T
    attitude = np.column_stack([roll, pitch, np.zeros_like(roll)])
    _, tensors = body_inertia(model.fuzzy, attitude[~vertical(attitude)])
    mean = tensors.mean(axis=0) if len(tensors) else np.zeros((3, 3))
    if not np.linalg.eigvalsh(mean).min() > 0:
        raise InputError("its inertia, averaged where training went, is not that of any body; identify it again")
    return body_of(model.vehicle, mean)


def of_a_body(body: Body, margin: float = 0.0) -> Body:
    """Take the nearest inertia of a body: each principal moment is less, by a margin, than the sum of the others."""
    inertia = nearest_body(body.inertia, margin)
    if inertia is body.inertia:
        return body
    return body._replace(inertia=inertia, inverse=np.asarray(np.linalg.inv(inertia), dtype=float))


def missing(
    model: VehicleModel, held: Held, holds: Holds, floor: Array, wind: tuple[float, float, float]
) -> list[Missing]:
    """List what a target does not hold, each with its size beside noise floors, shape (6,), N m and N."""
    flight = probe_flight(model)
    whole = player_of(model, flight)
    found = [_of_table(name, left, whole, flight, floor) for name, left in _left(model, holds) if left.any()]
    found += [_of_player(name, other, whole, flight, floor) for name, other in _others(model, held, whole, flight)]
    if any(wind):
        blown = replace(whole, wind=wind)
        found.append(_of_player(_WIND.format(*wind), whole, blown, flight, floor))
    return [each for each in found if each.off is None or max(each.off) > NOTHING]


def together(model: VehicleModel, held: Held) -> Off:
    """Tell how far a target ends from the whole model after half a second about hover."""
    flight = probe_flight(model)
    return _apart(player_of(model, flight), held.player(flight), flight)


def _left(model: VehicleModel, holds: Holds) -> Iterator[tuple[str, Array]]:
    """Give the rests of the parts of the table."""
    rotors = model.rotors
    columns = {_ROTORS: slice(1 + rotors, 1 + 2 * rotors), _LINEAR: slice(1, 1 + rotors)}
    columns[_SLOW] = slice(1 + 3 * rotors, None)
    for name, weights in model.parts.items():
        if name == "rotors":
            for title, own in columns.items():
                part = np.zeros_like(weights)
                part[:, :, own] = weights[:, :, own]
                yield title, part - holds(part)
        else:
            yield CATALOGUE[name].title if name in CATALOGUE else _LEARNED, weights - holds(weights)


def _others(model: VehicleModel, held: Held, whole: Player, flight: PlaybackFlight) -> Iterator[tuple[str, Player]]:
    """Give the whole model but for what a target has otherwise beside the table."""
    own, other = model.response, held.response
    if own.delay_s != other.delay_s:
        yield _DELAY, replace(whole, rotor=rotor_terms_along(flight, replace(own, delay_s=other.delay_s)))
    if own.lag_s != other.lag_s or (held.squares and own.lag_s):
        late = replace(held, response=replace(own, lag_s=other.lag_s))
        yield f"{_LAG}: it acts on squared speeds" if held.squares else _LAG, replace(whole, rotor=late.rotor(flight))
    if whole.fuzzy is not None and held.fuzzy is None:
        yield FUZZY, replace(whole, fuzzy=None, body=held.body)
    elif np.any(held.body.inertia != whole.body.inertia):
        known = np.array_equal(np.diag(held.body.inertia), np.diag(whole.body.inertia))
        yield _PRODUCTS if known else _NO_BODY, replace(whole, body=held.body._replace(gravity=whole.body.gravity))
    if held.body.gravity != whole.body.gravity:
        yield "gravity", replace(whole, body=whole.body._replace(gravity=held.body.gravity))


def _of_table(name: str, left: Array, whole: Player, flight: PlaybackFlight, floor: Array) -> Missing:
    alone = replace(whole, table=replace(whole.table, weights=left))
    without = replace(whole, table=replace(whole.table, weights=whole.table.weights - left))
    return _sized(name, alone.wrench(flight), floor, _apart(whole, without, flight))


def _of_player(name: str, other: Player, whole: Player, flight: PlaybackFlight, floor: Array) -> Missing:
    difference = whole.wrench(flight) - other.wrench(flight)
    return _sized(name, difference, floor, _apart(whole, other, flight))


def _sized(name: str, wrench: Array, floor: Array, off: Off) -> Missing:
    return sized(name, np.sqrt((wrench**2).mean(axis=0)), floor, off)


def sized(title: str, size: Array, floor: Array, off: Off, where: str = Missing.where) -> Missing:
    """Tell the size of a part, its root mean square, shape (6,), N m and N, beside noise floors."""
    floors = size / floor
    largest = float(np.nanmax(floors)) if np.isfinite(floors).any() else float("nan")
    torque, force = (float(np.where(part < _ROUNDING, 0.0, part).max()) for part in (size[:3], size[3:]))
    return Missing(title, torque, force, largest, off, where)


def _apart(first: Player, second: Player, flight: PlaybackFlight) -> Off:
    horizon = len(flight) // len(flight.stretches) - 1
    starts = flight.starts(horizon, 1)
    return Off.of(apart(*(free_runs(player, flight, starts, horizon) for player in (first, second))))


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
