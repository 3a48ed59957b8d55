"""Vehicles drawn from what flights say of one: numbers that go together as their estimates do, of possible bodies."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.blocks import half_width
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.errors import ComputationError, InputError
from cpfls_cli.inertia import INERTIA_ENTRIES, INERTIA_PARAMETERS, MEASURED, nearest_body, six_parameters, symmetric
from cpfls_cli.playback.gusts import GUST_AXES, Gusts
from cpfls_cli.playback.lack import Lack
from cpfls_cli.playback.model import ModelEffect, Remainder, VehicleModel
from cpfls_cli.playback.parameters import CURVE, LEARNED, PRODUCT_NAMES, FoundNumber
from cpfls_cli.playback.vehicle import VehicleFit, bodily
from cpfls_cli.vehicle.rotors import figures_of_vehicle, with_factors
from cpfls_cli.vehicle_limits import broken_limits

MOMENTS = tuple(f"inertia.{name}" for name in INERTIA_PARAMETERS[:3])
THRUST, DRAG, LAG, DELAY = "thrust_factor", "drag_factor", "lag.time_constant_s", "delay.delay_s"
_SLOW_NAMES = tuple(
    (f"slow_actuation.{own}", name)
    for own, name in (("roll_pitch", "slow_roll_pitch"), ("yaw", "slow_yaw"), ("slow_s", "slow_s"))
)
POSITIVE = frozenset((*MOMENTS, THRUST, DRAG, "slow_actuation.slow_s"))
"""Numbers that are drawn by a factor, as their intervals are."""

_FEWEST, _AT_ONCE = 0.01, 1000
"""Share of draws that has to be of possible vehicles: with less the estimate itself is hardly one; and the fewest draws
that identify such a share."""
_OF_A_GROUP = ": "
"""In the names of numbers that only another configuration has."""
_EDGE = 1e-9
"""Rounding, of a moment of inertia next to the sum of the others."""
_FALLS = 2.0
"""Linear share a of the thrust in hover from which it falls there: its slope is 2 (1 - a) + a."""


@dataclass(frozen=True)
class Spread:
    """Vehicles that were drawn.

    Attributes
    ----------
    names : tuple of str
        Numbers that differ between them.
    centre : array, shape (number,), SI
        What they were drawn around: the estimate, or where that is of no body the nearest one.
    values : array, shape (vehicle, number), SI
    models : tuple of VehicleModel
        Each with gusts of its own, if the vehicle has any.
    tried : int
        Draws, possible or not.
    rejected : mapping of str to int
        How many of them are of no possible vehicle, by the reason that was met first.
    lack : Lack or None
        What the model lacks, whichever of its numbers it has: the same for all of them.
    """

    names: tuple[str, ...]
    centre: Array
    values: Array
    models: tuple[VehicleModel, ...]
    tried: int
    rejected: Mapping[str, int]
    lack: Lack | None = None


def drawn(model: VehicleModel, found: VehicleFit, count: int, rng: np.random.Generator) -> Spread:
    """Draw vehicles that the flights allow: by a multivariate t, each number within its interval in 95 % of draws.

    What is positive is drawn by factors. An interval that is longer on one side is two halves of the distribution. A
    number that is 0 stays so: its part is not in the model. How the autopilot's loop may have misled the fit is drawn
    between its bounds, alike for all factors.

    Parameters
    ----------
    count : int
        Of possible vehicles.

    Raises
    ------
    InputError
        If one block identifies the numbers, which says nothing of how sure they are.
    ComputationError
        If fewer than one draw of a hundred is of a possible vehicle.

    References
    ----------
    Gelman et al., Bayesian Data Analysis, chapter 3 (t of a normal with unknown scale); Wallis 2014, the two-piece
    normal distribution.
    """
    require_sure(found)
    places = [place for place, each in enumerate(found.numbers) if each.value and _OF_A_GROUP not in each.name]
    model, numbers = _of_a_body(model, [found.numbers[place] for place in places])
    root = _root(found.correlation[np.ix_(places, places)])
    kept: list[tuple[Array, VehicleModel]] = []
    rejected, tried = Counter[str](), 0
    while len(kept) < count:
        for row in _numbers_drawn(numbers, found, root, rng, max(count, _AT_ONCE)):
            if len(kept) < count:
                tried += 1
                why = _impossible(model, numbers, row)
                if why:
                    rejected[why] += 1
                else:
                    kept.append((row, model_at(model, numbers, row)))
        if len(kept) < _FEWEST * tried:
            first, often = rejected.most_common(1)[0]
            raise ComputationError(
                f"of {tried} vehicles drawn only {len(kept)} are possible; of {often} no vehicle has {first}; state "
                "what the flights do not identify in the config, or fly what identifies it (`cpfls info` names both)"
            )
    made = [each for _, each in kept]
    # What is seen of gusts is acceleration, so that their torque goes with the inertia.
    axes = [symmetric(each.vehicle.inertia_kg_m2).diagonal() for each in (model, *made)]
    heavier = np.array([np.append(own / axes[0], np.ones(3)) for own in axes[1:]])
    gusts = _gusts_drawn(found, model, heavier, rng)
    return Spread(
        tuple(number.name for number in numbers),
        np.array([number.value for number in numbers]),
        np.array([row for row, _ in kept]).reshape(count, len(numbers)),
        tuple(replace(each, gusts=own) for each, own in zip(made, gusts, strict=True)),
        tried,
        dict(rejected.most_common()),
        None if found.disturbance is None else found.disturbance.lack,
    )


def require_sure(found: VehicleFit) -> None:
    """Refuse numbers that one block alone identifies."""
    if found.blocks < 2:
        raise InputError("its flights are too short to show how sure its numbers are; find it in longer ones")


def _of_a_body(model: VehicleModel, numbers: Sequence[FoundNumber]) -> tuple[VehicleModel, list[FoundNumber]]:
    """Move an estimate to the nearest body: a flat one has a moment that is the sum of the others, and noise adds."""
    inertia = symmetric(model.vehicle.inertia_kg_m2)
    nearest = nearest_body(inertia)
    if nearest is inertia or np.linalg.eigvalsh(inertia)[2] > MEASURED * np.linalg.eigvalsh(inertia)[:2].sum():
        return model, list(numbers)
    entries = [float(nearest[entry]) for entry in INERTIA_ENTRIES]
    by_name = dict(zip((*MOMENTS, *PRODUCT_NAMES), entries, strict=True))
    moved = []
    for number in numbers:
        ratio = by_name.get(number.name, number.value) / number.value
        moved.append(number._replace(value=number.value * ratio, low=number.low * ratio, high=number.high * ratio))
    xx, yy, zz, xy, xz, yz = entries
    return replace(model, vehicle=replace(model.vehicle, inertia_kg_m2=(xx, yy, zz, xy, xz, yz))), moved


def _root(correlation: Array) -> Array:
    """Take a root of a correlation that rounding, or fewer blocks than numbers, leave without full rank."""
    sizes, axes = np.linalg.eigh(correlation)
    return np.asarray(axes * np.sqrt(np.maximum(sizes, 0.0)))


def _numbers_drawn(
    numbers: Sequence[FoundNumber], found: VehicleFit, root: Array, rng: np.random.Generator, count: int
) -> Array:
    """Draw numbers, possible or not, shape (count, number)."""
    # By which factors the loop may have misled the fit; where instruments identify the constants no loop has.
    ends = np.array([np.fmin(found.loop.low, 1.0), np.fmax(found.loop.high, 1.0)])
    ends = np.ones((2, 3)) if found.instruments else ends
    freedom = found.blocks - 1
    normal = rng.standard_normal((count, len(numbers))) @ root.T
    # In units of half an interval: of a t of so many blocks, 95 % lie between -1 and 1.
    unit = float(half_width(np.ones(()), found.blocks))
    shares = normal / np.sqrt(rng.chisquare(freedom, (count, 1)) / freedom) / unit
    least, most = np.log(ends)
    loop = np.exp(rng.uniform(least, most, (count, 3)))
    # By which it has widened intervals; see `widened_by_loop`.
    widened = dict(zip(MOMENTS, ends.T.tolist(), strict=True))
    widened[DRAG] = [1.0 / widened[MOMENTS[2]][1], 1.0 / widened[MOMENTS[2]][0]]
    values = np.empty_like(shares)
    for place, number in enumerate(numbers):
        below, above = widened.get(number.name, [1.0, 1.0])
        low, value, high = number.low / below, number.value, number.high / above
        if number.name in POSITIVE:
            low, value, high = np.log(np.clip([low, value, high], 1e-30, 1e30))
        halves = np.where(shares[:, place] < 0, max(value - low, 0.0), max(high - value, 0.0))
        moved = value + shares[:, place] * halves
        values[:, place] = np.exp(moved) if number.name in POSITIVE else moved
    _misled(numbers, values, loop)
    return values


def _misled(numbers: Sequence[FoundNumber], values: Array, loop: Array) -> None:
    """Multiply moments of inertia with what the loop may have done; about yaw the ratio to the drag factor alone."""
    named = {number.name: place for place, number in enumerate(numbers)}
    for axis, name in enumerate(MOMENTS):
        if name in named:
            values[:, named[name]] *= loop[:, axis]
        elif axis == 2 and DRAG in named:
            values[:, named[DRAG]] /= loop[:, axis]


def _impossible(model: VehicleModel, numbers: Sequence[FoundNumber], row: Array) -> str:
    """Say what of a draw no vehicle has; empty for a possible one."""
    values = dict(zip((number.name for number in numbers), row.tolist(), strict=True))
    if min(values.get(LAG, 0.0), values.get(DELAY, 0.0)) < 0.0:
        return "a lag or a delay below 0"
    if values.get(CURVE, 0.0) >= _FALLS:
        return "a thrust that does not rise with the commands in hover"
    smallest, middle, largest = np.linalg.eigvalsh(symmetric(_inertia(model, values)))
    if smallest <= 0.0:
        return "a principal moment of inertia that is not above 0"
    if largest > (smallest + middle) * (1.0 + _EDGE):
        return "a principal moment of inertia above the sum of the others"
    placed = [number._replace(value=values[number.name]) for number in numbers]
    of_none = [each.name for each in bodily(model.vehicle, placed) if not each.possible]
    if of_none:
        return f"such a {of_none[0]}"
    beyond = next(broken_limits(figures_of_vehicle(model_at(model, numbers, row).vehicle)), None)
    return "" if beyond is None else f"such a {beyond.what}"


def _inertia(model: VehicleModel, values: Mapping[str, float]) -> Array:
    parameters = six_parameters(model.vehicle.inertia_kg_m2)
    for place, name in enumerate((*MOMENTS, *PRODUCT_NAMES)):
        parameters[place] = values.get(name, parameters[place])
    return parameters


def model_at(model: VehicleModel, numbers: Sequence[FoundNumber], row: Array) -> VehicleModel:
    """Make the model of a vehicle with other numbers; factors of rotors that differ keep their ratios."""
    values = dict(zip((number.name for number in numbers), row.tolist(), strict=True))
    begun = {number.name: number.value for number in numbers}
    thrust, drag = (values[name] / begun[name] if name in begun else 1.0 for name in (THRUST, DRAG))
    xx, yy, zz, xy, xz, yz = _inertia(model, values).tolist()
    response = model.response
    slow = {name: values.get(own, getattr(response, name)) for own, name in _SLOW_NAMES}
    # For commands that are not a log's the model's delay is longer than the number, see `commanded_anew`.
    later = values[DELAY] - begun[DELAY] if DELAY in begun else 0.0
    return replace(
        model,
        vehicle=replace(with_factors(model.vehicle, thrust, drag), inertia_kg_m2=(xx, yy, zz, xy, xz, yz)),
        response=replace(response, lag_s=values.get(LAG, response.lag_s), delay_s=response.delay_s + later, **slow),
        effects=tuple(_effect_at(each, values) for each in model.effects),
        remainder=None if model.remainder is None else _remainder_at(model.remainder, values),
    )


def _effect_at(effect: ModelEffect, values: Mapping[str, float]) -> ModelEffect:
    names = (f"{effect.name}.{each.name}" for each in CATALOGUE[effect.name].coefficients)
    pairs = zip(names, effect.coefficients.tolist(), strict=False)
    return effect._replace(coefficients=np.array([values.get(name, value) for name, value in pairs]))


def _remainder_at(remainder: Remainder, values: Mapping[str, float]) -> Remainder:
    coefficients = remainder.coefficients.copy()
    for place, row in enumerate(remainder.rows.tolist()):
        block = next(name for name, rows in LEARNED.items() if row in rows)
        for column, power in np.ndindex(*coefficients.shape[1:]):
            name = f"{block}.{row}_{column}_{power}"
            coefficients[place, column, power] = values.get(name, coefficients[place, column, power])
    return replace(remainder, coefficients=coefficients)


def _gusts_drawn(
    found: VehicleFit, model: VehicleModel, heavier: Array, rng: np.random.Generator
) -> Iterator[Gusts | None]:
    """Draw the gusts of each vehicle."""
    gusts = found.disturbance
    if gusts is None or gusts.gusts is None:
        yield from [None] * len(heavier)
        return
    normal = rng.standard_normal((2, *heavier.shape))[..., : len(gusts.size)]
    size = _factors_drawn(gusts.size, gusts.low, gusts.high, normal[0])
    memory = _factors_drawn(gusts.memory, gusts.memory_low, gusts.memory_high, normal[1])
    white = np.zeros(len(GUST_AXES)) if model.gusts is None else model.gusts.white
    for own, own_size, own_memory in zip(heavier, size, memory, strict=True):
        yield Gusts.known(own_size * own[: len(own_size)], own_memory)._replace(white=white * own)


_NORMAL = 1.959964
"""Half of an interval of 95 %, in standard deviations."""


def _factors_drawn(value: Array, low: Array, high: Array, normal: Array) -> Array:
    """Draw positive numbers, each within its interval in 95 % of draws; as they are where no interval is known."""
    with np.errstate(divide="ignore", invalid="ignore"):
        down, up = (np.nan_to_num(np.abs(np.log(end / value)), posinf=0.0) for end in (low, high))
    return np.asarray(value * np.exp(normal / _NORMAL * np.where(normal < 0, down, up)))
