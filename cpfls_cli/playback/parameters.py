"""Numbers of a vehicle that a fit may change: blocks of them, and what each adds to torque and force."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Annotated, NamedTuple

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.effects import scales
from cpfls_cli.effects.effect import Effect
from cpfls_cli.effects.registry import CATALOGUE, THRUST_CURVE, acting
from cpfls_cli.effects.signals import Signals
from cpfls_cli.fuzzy.periodic import PeriodicStructure
from cpfls_cli.inertia import INERTIA_PARAMETERS
from cpfls_cli.playback.model import Remainder
from cpfls_cli.result import About
from cpfls_cli.vehicle.settings import VehicleSettings

INERTIA = "inertia"
LEARNED: Mapping[str, tuple[int, ...]] = {"remainder": (0, 1, 2), "remainder_force": (3, 4, 5)}
"""Blocks of the learned remainder, of torque and of force, with the rows of the wrench that each adds to."""

# Names of the numbers that every vehicle can have.
LOG_INERTIA = tuple(f"inertia.log_{name}" for name in INERTIA_PARAMETERS[:3])
PRODUCT_NAMES = tuple(f"products.{name}" for name in INERTIA_PARAMETERS[3:])
PRODUCTS = "products"
DELAY, LAG, SLOW = "delay.delay_s", "lag.time_constant_s", "slow_actuation.log_slow_s"
SLOW_SHARES = ("slow_actuation.roll_pitch", "slow_actuation.yaw")
THRUST, DRAG = "thrust_factor.scale", "drag_factor.scale"
CURVE = f"{THRUST_CURVE.name}.{THRUST_CURVE.coefficients[0].name}"
MASS = "mass"
"""Block of groups of flights alone: one configuration has the stated mass, which gives all else its size."""

COUNTED, AS_STATED = "counted", "as_stated"
"""Blocks of groups of flights alone: coefficients of torque, shared with the vehicle of the config, are counted by its
inertia and not by that of the group; as numbers, or none where it is the stated one."""

LOG_MASS = "mass.log_mass"
LOG_COUNTED = tuple(f"{COUNTED}.log_{name}" for name in INERTIA_PARAMETERS[:3])

ROOM = 10.0
"""Bounds of a coefficient here, in multiples of those of the catalogue: an effective number may lie beyond them."""

_TURNED, _PUSHED = 2.0, 0.5
"""Natural size of a remainder: angular acceleration in rad/s^2 per m/s, acceleration in m/s^2 per m/s."""


@dataclass(frozen=True)
class Number:
    """One number of a vehicle, named by block and number, such as ``linear_damping.d_x``.

    `unit` is empty for a ratio or its logarithm; `start` is what is stated, or a small value where nothing is; `scale`
    the natural size of a change; `low` and `high` are physical bounds; `spread` is the standard deviation of what is
    believed before the flights, in scales.
    """

    name: str
    unit: str
    start: float
    scale: float
    low: float
    high: float
    spread: float

    @property
    def block(self) -> str:
        """Block that it comes and goes with."""
        return self.name.split(".")[0]

    @property
    def believed(self) -> float:
        """Half of an interval that says no more than what is believed of any such vehicle."""
        room = ROOM if self.block in CATALOGUE and self.block != THRUST_CURVE.name else 1.0
        return min(self.scale, (self.high - self.low) / (2 * room))

    @property
    def absent(self) -> float:
        """What it is in a model without its block."""
        return 0.0 if self.block in ("lag", "delay", "slow_actuation") else self.start


class Physical(NamedTuple):
    """A number as people know it: whether it cannot be below 0, and whether a config states it."""

    value: float
    unit: str
    positive: bool = False
    stated: bool = False


_SI = About("estimate", unit="SI")
_LOW, _HIGH = (About(f"{end} end of the 95 % interval", unit="SI") for end in ("lower", "upper"))


class FoundNumber(NamedTuple):
    """A number of a vehicle that was free.

    It is determined where the flights say more of it than what was believed before: to a factor of two where it cannot
    be negative, else to its natural size, or half of the range that is possible if that is less. What turns torque into
    rotation is not where it makes a body that cannot be.
    """

    name: Annotated[str, About("block and number")]
    unit: Annotated[str, About("empty for a ratio")]
    value: Annotated[float, _SI]
    low: Annotated[float, _LOW]
    high: Annotated[float, _HIGH]
    stated: Annotated[float, About("in the config; not finite where no config does", unit="SI", gaps=True)]
    determined: Annotated[bool, About("1 where the flights say more than what was believed before")]
    at_bound: Annotated[bool, About("1 where it lies on a bound, so the interval says little")]
    possible: Annotated[bool, About("0 where no such vehicle has the estimate, see `bodily`")] = True


class Difference(NamedTuple):
    """What a configuration has that the vehicle of the config has not."""

    name: Annotated[str, About("configuration, and what differs")]
    unit: Annotated[str, About("of the difference")]
    value: Annotated[float, _SI]
    low: Annotated[float, _LOW]
    high: Annotated[float, _HIGH]


def interval(value: float, half: float, *, positive: bool) -> tuple[float, float]:
    """Give the ends of an interval; by a factor for what cannot be below 0."""
    if not positive:
        return value - half, value + half
    # What is not known at all is known to a factor beyond any number.
    with np.errstate(over="ignore"):
        factor = float(np.exp(half / value))
    return value / factor, value * factor


_OF_ROTORS: Mapping[str, tuple[Number, ...]] = {
    INERTIA: tuple(Number(name, "", 0.0, 0.5, -4.0, 4.0, 3.0) for name in LOG_INERTIA),
    "thrust_factor": (Number(THRUST, "", 1.0, 0.2, 0.1, 10.0, 2.0),),
    "drag_factor": (Number(DRAG, "", 1.0, 0.5, 0.01, 30.0, 4.0),),
    "lag": (Number(LAG, "s", 0.01, 0.02, 0.001, 0.3, 5.0),),
    "delay": (Number(DELAY, "s", 0.002, 0.01, 0.0, 0.1, 5.0),),
    "slow_actuation": (
        *(Number(name, "", -0.05, 0.3, -1.5, 3.0, 3.0) for name in SLOW_SHARES),
        Number(SLOW, "", float(np.log(0.3)), 0.7, float(np.log(0.03)), float(np.log(5.0)), 2.0),
    ),
    MASS: (Number(LOG_MASS, "", 0.0, 0.1, -2.0, 2.0, 3.0),),
    COUNTED: tuple(Number(name, "", 0.0, 0.5, -4.0, 4.0, 3.0) for name in LOG_COUNTED),
    AS_STATED: (),
}
"""Blocks that are the same for all vehicles."""


def of_vehicle(block: str, vehicle: VehicleSettings) -> tuple[Effect, list[int]]:
    """Give an effect with the numbers that act on a vehicle, and the places of those that free runs identify."""
    known = acting(block, vehicle)
    return known, [place for place, each in enumerate(known.coefficients) if not each.by_force]


@lru_cache(maxsize=256)
def unit_wrenches(block: str, vehicle: VehicleSettings) -> Array:
    """Evaluate what a unit of each coefficient that is free does at some motions, shape (coefficient, motion, 6)."""
    (known, places), rotors = of_vehicle(block, vehicle), len(vehicle.rotors)
    rng = np.random.default_rng(0)
    speed = rng.uniform(500.0, 1500.0, (_MOTIONS, rotors))
    signals = Signals(
        time=np.arange(_MOTIONS, dtype=float),
        body_rate=rng.uniform(-2.0, 2.0, (_MOTIONS, 3)),
        vehicle=vehicle,
        attitude=rng.uniform(-1.0, 1.0, (_MOTIONS, 3)),
        velocity=rng.uniform(-3.0, 3.0, (_MOTIONS, 3)),
        position=rng.uniform(1.0, 2.0, (_MOTIONS, 3)),
        rotor_speed=speed,
    )
    assert known.columns is not None, "blocks have them"
    columns = known.columns(signals, {})
    given = columns.direct if columns.momentum is None else columns.direct + columns.momentum
    return np.moveaxis(given, 2, 0)[places]


_MOTIONS = 8
"""Motions at which effects are evaluated to see on what they act."""


def blocks_of(vehicle: VehicleSettings) -> tuple[str, ...]:
    """List the blocks that a vehicle can have: of rotors and body, effects of motion and rotors, and the remainder's.

    Numbers that the config does not know are free in every model, so they are not among the choices.
    """
    known = (block for block in _OF_ROTORS if block not in (MASS, COUNTED, AS_STATED, *vehicle.unknown))
    effects = (
        name
        for name, each in CATALOGUE.items()
        if each is THRUST_CURVE
        or (each.follows_state and each.kind == "wrench" and not each.shapes and each.needs <= _SEEN)
    )
    return (*known, PRODUCTS, *effects, *LEARNED)


_SEEN = {"body_rate", "velocity", "rotor_speed", "thrust"}
"""What effects that are sought may need."""


def needs_velocity(block: str) -> bool:
    """Tell whether a block can only be found where the velocity was measured."""
    known = CATALOGUE.get(block)
    return block in (*LEARNED, "thrust_factor") or bool(known and (known.moves or known.needs & {"velocity", "force"}))


def of_no_command(commanded: Iterable[bool]) -> set[str]:
    """Name what flights without any commands do not show: at a measured speed a propeller pulls by its square."""
    return set() if any(commanded) else {THRUST_CURVE.name}


class Rules(NamedTuple):
    """Partition and consequents of a remainder: even rules over the circle, order of the harmonics (0: seesaw)."""

    number: int
    order: int

    @property
    def columns(self) -> int:
        """Count the columns of the system; none without rules."""
        return self.number * (1 + (2 * self.order or 1))

    def of(self, other: Rules) -> Array:
        """Give the coefficients, one column for each of other rules, that come closest to the same over the circle."""
        turn = np.linspace(0.0, 2 * np.pi, _DIRECTIONS, endpoint=False)[:, None]
        own, given = (each._system.columns(turn) for each in (self, other))
        return np.asarray(np.linalg.lstsq(own, given)[0])

    @property
    def _system(self) -> PeriodicStructure:
        partition = np.linspace(0.0, 1.0, self.number + 1)
        return PeriodicStructure((partition,), "harmonic" if self.order else "seesaw", self.order, "additive")


_DIRECTIONS = 72
"""In which partitions are compared."""

_NO_RULES = Rules(0, 0)


@dataclass(frozen=True)
class FreeNumbers:
    """The numbers of a vehicle that are free, and what each adds to torque and force.

    `chosen` are blocks besides those of what is not known of the vehicle; `rules` are those of the remainder, where it
    is among them; `lag_s` is the lag of the rotors where that is not free.
    """

    vehicle: VehicleSettings
    chosen: tuple[str, ...]
    rules: Rules = _NO_RULES
    lag_s: float = 0.0

    @cached_property
    def blocks(self) -> tuple[str, ...]:
        """All blocks."""
        return (*sorted(set(self.vehicle.unknown) - set(self.chosen)), *self.chosen)

    @cached_property
    def numbers(self) -> tuple[Number, ...]:
        """All numbers, block by block."""
        return tuple(number for block in self.blocks for number in self.of_block(block))

    @cached_property
    def index(self) -> dict[str, int]:
        """Place of each number by name."""
        return {number.name: place for place, number in enumerate(self.numbers)}

    @property
    def effects(self) -> tuple[str, ...]:
        """Blocks that are effects of the catalogue and add a wrench."""
        return tuple(each for each in self.blocks if each in CATALOGUE and each not in (*_OF_ROTORS, PRODUCTS))

    @property
    def counting(self) -> tuple[str, ...]:
        """Names of the logarithms of the inertia in units of which coefficients of torque are counted."""
        return LOG_INERTIA if {COUNTED, AS_STATED}.isdisjoint(self.blocks) else LOG_COUNTED

    def of_block(self, block: str) -> tuple[Number, ...]:
        """List the numbers of a block."""
        vehicle = self.vehicle
        if block in _OF_ROTORS:
            return _OF_ROTORS[block]
        if block == THRUST_CURVE.name:
            # No more of the thrust than all of it can be linear, nor does it fall as the commands rise.
            return (Number(CURVE, THRUST_CURVE.coefficients[0].unit, 0.0, 0.5, -1.0, 1.0, 2.0),)
        if block == PRODUCTS:
            size = scales.smallest_inertia(vehicle)
            return tuple(
                Number(name, "kg m^2", 0.0, 0.1 * size, -0.5 * size, 0.5 * size, 1.0) for name in PRODUCT_NAMES
            )
        if block in LEARNED:
            return self._remainder_numbers(block)
        numbers, (known, places) = [], of_vehicle(block, vehicle)
        for each in (known.coefficients[place] for place in places):
            scale, (low, high) = 1.0 if each.scale is None else each.scale(vehicle), each.bounds(vehicle)
            numbers.append(Number(f"{block}.{each.name}", each.unit, 0.0, scale, ROOM * low, ROOM * high, 1.0))
        return tuple(numbers)

    def _remainder_numbers(self, block: str) -> tuple[Number, ...]:
        vehicle, hover = self.vehicle, scales.hover_speed(self.vehicle)
        sizes = [*(_TURNED * moment for moment in vehicle.inertia_kg_m2[:3]), *[_PUSHED * vehicle.mass_kg] * 3]
        return tuple(
            Number(f"{block}.{row}_{column}_{power}", "SI", 0.0, sizes[row] / rotor, -np.inf, np.inf, 1.0)
            for row in LEARNED[block]
            for column in range(self.rules.columns)
            for power, rotor in ((0, hover), (1, 1.0))
        )

    @cached_property
    def shares(self) -> dict[str, Array]:
        """Axes on which the coefficients of effects and remainder act, as shares, by name, shape (3,).

        A coefficient of torque is counted in units of the inertia about the axes on which it acts, so that a fit can
        change the inertia alone; 0 for one that has a force, which knows no inertia.
        """
        found = {}
        for block in (each for each in self.blocks if each in LEARNED or each in self.effects):
            if block in LEARNED:
                each_row = len(self.of_block(block)) // len(LEARNED[block])
                acts = np.repeat(np.eye(6)[list(LEARNED[block])], each_row, axis=0) > 0
            else:
                acts = np.array([np.any(each, axis=0) for each in unit_wrenches(block, self.vehicle)])
            for number, (own, pushes) in zip(
                self.of_block(block), zip(acts[:, :3], acts[:, 3:], strict=True), strict=True
            ):
                found[number.name] = own / max(own.sum(), 1) * (not pushes.any())
        return found

    def remainder(self, blocks: Sequence[str], coefficients: Array) -> Remainder:
        """Build the remainder of some of its blocks, from their coefficients in order."""
        rows = np.array([row for block in blocks for row in LEARNED[block]], dtype=np.int64)
        return Remainder(
            breakpoints=np.linspace(0.0, 1.0, self.rules.number + 1),
            harmonic_order=self.rules.order,
            rows=rows,
            coefficients=coefficients.reshape(len(rows), -1, 2),
        )
