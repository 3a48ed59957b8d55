"""An effect: wrench columns that are linear in its coefficients, its description, and its hooks."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.effects.hooks import Actuation, Body, PhysicalNumbers, SensorLog, SensorTest, VehicleParts
from cpfls_cli.effects.signals import Signals
from cpfls_cli.filters import SecondOrder
from cpfls_cli.rotations import cross
from cpfls_cli.vehicle.motion import Instant, Numbers, Wrench, about_centre
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.vehicle.values import Tangent, Vector, zero

Kind = Literal["wrench", "actuator", "sensor", "parameter"]
Quantity = Literal["scales", "centre", "products", "drag", "rolling", "lag"]
"""Of a model of a simulator: factors of thrust, torque and inertia, centre of mass, products of inertia, rotors'."""


@dataclass(frozen=True)
class Coefficient:
    """One number that an effect needs."""

    name: str
    unit: str
    low: float  # What is physically possible, not what is usual, in multiples of `scale`.
    high: float  # The same.
    meaning: str
    scale: Callable[[VehicleSettings], float] | None = None  # Natural size on a vehicle, in `unit`; None for 1.
    of_log: bool = False  # Whether it is of the log, and not of the motion.
    by_force: bool = False  # Whether its force identifies it: without an accelerometer its torque is left out.

    def bounds(self, vehicle: VehicleSettings) -> tuple[float, float]:
        """Bound the coefficient on a vehicle, in `unit`."""
        scale = 1.0 if self.scale is None else self.scale(vehicle)
        return self.low * scale, self.high * scale


def of_axes(
    name: str,
    unit: str,
    low: float,
    high: float,
    meaning: str,
    scale: Callable[[VehicleSettings], float] | Sequence[Callable[[VehicleSettings], float]] | None = None,
) -> tuple[Coefficient, ...]:
    """Make a coefficient of each axis; ``{}`` in name and meaning is its letter, and scales may be three."""
    scales = (scale,) * 3 if scale is None or callable(scale) else scale
    return tuple(
        Coefficient(name.format(letter), unit, low, high, meaning.format(letter), own)
        for letter, own in zip("xyz", scales, strict=True)
    )


@dataclass(frozen=True)
class Shape:
    """A parameter that an effect depends on nonlinearly."""

    name: str
    unit: str
    grid: tuple[float, ...]  # Ascending; values that a search starts from. The first and the last bound it.
    meaning: str
    first: float | None = None  # Where a search stays until the effect is chosen; None: it tries the whole grid.
    valley: float | None = None  # Where the residual has many valleys over it: their width, as a share of the value.
    follows: Callable[[Mapping[str, float]], float] | None = None  # What coefficients, the vehicle's too, say of it.

    def bounds(self, _vehicle: VehicleSettings) -> tuple[float, float]:
        """Bound the shape, on any vehicle, in `unit`."""
        return self.grid[0], self.grid[-1]

    @property
    def tried(self) -> tuple[float, ...]:
        """Values that a search tries."""
        return self.grid if self.first is None else (self.first,)


@dataclass(frozen=True)
class Columns:
    """Wrench columns along a flight: ``wrench = direct @ c + d/dt (momentum @ c)``."""

    # Shape (time, 6, coefficient): torque (3) and force (3) about the body axes for one unit of each coefficient.
    direct: Array
    # Shape (time, 6, coefficient): what has to be differentiated in time; None for nothing. Nobody differentiates it:
    # windows are integrated by parts.
    momentum: Array | None = None

    def at_samples(self, coefficients: Array, time: Array) -> Array:
        """Evaluate ``direct @ c + d/dt (momentum @ c)`` sample by sample; noise of what is differentiated shows in it.

        `coefficients`: shape (coefficient,); `time`: shape (time,), s; Result: shape (time, 6).
        """
        momentum = None if self.momentum is None else self.momentum @ coefficients
        return Columns(np.asarray(self.direct @ coefficients), momentum).along(time)

    def along(self, time: Array) -> Array:
        """Evaluate what has no coefficients, ``direct + d/dt momentum``, at times in s."""
        if self.momentum is None:
            return self.direct
        # Slow to load, and who lists or shows effects differentiates nothing.
        from scipy.interpolate import CubicSpline

        return np.asarray(self.direct + CubicSpline(time, self.momentum)(time, 1))


@dataclass(frozen=True, kw_only=True)
class Effect:
    """A physical effect that a model may miss."""

    name: str  # Identifier.
    title: str  # What people call it.
    # Adds torque and force; changes what the rotors do; changes what the sensors say; a wrong number of the vehicle.
    kind: Kind
    formula: str  # One line.
    sentence: str  # What a pilot understands.
    needs: frozenset[str]  # Of `Signals.available`.
    excitation: str  # The flight that shows it.
    rivals: Mapping[str, str]  # Effects that look alike, each with the flight that separates them.
    source: str
    coefficients: tuple[Coefficient, ...] = ()  # Physical, as reported; those of `shapes` not among them.
    optional: int = 0  # How many of the last of its numbers a list or a file may leave out: they are 0.
    shapes: tuple[Shape, ...] = ()
    # ``columns(signals, shape) -> Columns``, linear in the linear coefficients; of an actuator the change of wrench.
    # Left out, it follows from `acts`; None for what only the audit of the sensors can see.
    columns: Callable[[Signals, Mapping[str, float]], Columns] | None = None
    # None: the linear coefficients are the physical ones, whose bounds bound them.
    physical: PhysicalNumbers | None = None
    # For effects that change what the others meet: ``apply(signals, shape) -> Signals`` as they would be without the
    # effect's error, or with its air, so that all other columns can be computed from them.
    apply: Callable[[Signals, Mapping[str, float]], Signals] | None = None
    # For effects with a random part: ``scatter(signals, shape) -> array, shape (time, 6)``, variance of torque and
    # force for a unit of relative scatter.
    scatter: Callable[[Signals, Mapping[str, float]], Array] | None = None
    # ``describe(vehicle, values) -> str``: what the coefficients that are surely not zero say in words, by name.
    describe: Callable[[VehicleSettings, Mapping[str, float]], str] | None = None
    quantity: Quantity | None = None  # Of a simulator's model, which its coefficients are.
    rotorpy: Mapping[str, str] = field(default_factory=dict)  # RotorPy's numbers, by coefficients with its formula.
    holds: frozenset[str] = frozenset()  # Effects that are special cases of this one, which is then not their rival.
    # Whether the columns hold the derivative of the body rates, and with it the noise of the gyroscope.
    rate_derivative: bool = False
    # ``filters(shape, period) -> SecondOrder``: what the body's momentum, axis by axis, goes through in its columns.
    filters: Callable[[Mapping[str, float], float], SecondOrder] | None = None
    # Place in the catalogue, in the actuator chain and, from the last to the first, in the log of the sensors.
    order: int = 1000
    of_all_forces: bool = False  # Whether it has a lever for the forces of all other effects.
    trims: bool = False  # Whether it is always the same, so that a vehicle that hovers is trimmed for it.
    moves: bool = False  # Whether runs that start from measured motion show it by the velocity alone.
    actuation: Actuation | None = None  # For effects between command and rotors: how they are simulated.
    # ``acts(see, p) -> Wrench`` at an instant, of its numbers by name. None for what changes only the log or the
    # actuators, or has a state of its own.
    acts: Callable[[Instant, Numbers], Wrench] | None = None
    # ``air(values)``: velocity of the air that all effects meet, m/s, world frame.
    air: Callable[[Mapping[str, float]], tuple[float, float, float]] | None = None
    carried: Body | None = None  # For effects with a state of their own, in place of `acts`.
    log: SensorLog | None = None  # For effects on the log: how they are simulated.
    test: SensorTest | None = None  # For effects that the sensor audit finds.
    # ``accounts(number, values, vehicle) -> float``: relative error of a number of the vehicle that the effect itself
    # leaves, so that the number is not called wrong.
    accounts: Callable[[str, Mapping[str, float], VehicleSettings], float] | None = None
    # ``in_vehicle(parts, shape, linear) -> VehicleParts``: for effects that have a place of their own in the model of a
    # whole vehicle.
    in_vehicle: Callable[[VehicleParts, Mapping[str, float], Array], VehicleParts] | None = None
    # What takes the place of this one once it is chosen: the same effect with numbers for which alone another effect
    # would do as well, or with those that others depend on as shapes, under the same names.
    exact: Effect | None = None
    tried_last: bool = False  # Whether it looks like many others: tried where a gap is left without it.
    added: str = ""  # The effect that the numbers which `exact` adds are, where all others are 0.
    # ``lever(linear, error, vehicle) -> array of bool, shape (coefficient,)``: coefficients that the others leave
    # possible, a torque being no larger than its force on a lever as long as the body.
    lever: Callable[[Array, Array, VehicleSettings], BoolArray] | None = None

    def __post_init__(self) -> None:
        """Give an actuator the change of wrench as its column, and others what they do for one unit of each number."""
        apply = self.apply
        if self.columns is None and self.kind == "actuator" and apply is not None:

            def change(signals: Signals, shape: Mapping[str, float]) -> Columns:
                return Columns(stack(apply(signals, shape).wrench - signals.wrench))

            object.__setattr__(self, "columns", change)
        elif self.columns is None and self.acts is not None:
            object.__setattr__(self, "columns", columns_of(self.acts, [each.name for each in self.coefficients]))

    @property
    def unit_coefficient(self) -> bool:
        """Whether the columns are right only with the coefficient 1: everything is in the shape."""
        return not self.coefficients

    @property
    def follows_state(self) -> bool:
        """Whether it acts at an instant on what free runs know: air velocity, body rate and rotors."""
        elsewhere = self.carried is not None or self.rate_derivative or self.needs & {"height", "attitude"}
        return self.acts is not None and not elsewhere

    @property
    def of_commands(self) -> bool:
        """Whether a flight that has it logs commands, which its rotors do not simply follow."""
        return self.actuation is not None or "command" in self.needs

    @property
    def is_lag(self) -> bool:
        """Whether it delays the rotors or their log, as a control loop seems to; the voltage of a supply does not."""
        if self.actuation is None:
            return self.kind == "actuator" and self.log is not None
        return self.actuation.supply is None

    def form(self, coefficients: int, shapes: Collection[str]) -> Effect:
        """Check by the fitted parameters whether it is this effect or what took its place."""
        other = self.exact or self
        names = {shape.name for shape in other.shapes}
        if (len(other.coefficients), names) == (coefficients, {*shapes}):
            return other
        fewer = 0 < len(self.coefficients) - coefficients <= self.optional
        return replace(self, coefficients=self.coefficients[:coefficients], columns=None) if fewer else self

    @property
    def numbers(self) -> tuple[Coefficient | Shape, ...]:
        """Coefficients, then shapes."""
        return (*self.coefficients, *self.shapes)

    def missing(self, signals: Signals) -> tuple[str, ...]:
        """Name the signals that the effect needs and the flight lacks."""
        return tuple(sorted(self.needs - signals.available))


def columns_of(
    acts: Callable[[Instant, Numbers], Wrench], names: Sequence[str]
) -> Callable[[Signals, Mapping[str, float]], Columns]:
    """Make columns of what an effect does at an instant, which is linear in the coefficients of these names."""

    def columns(signals: Signals, shape: Mapping[str, float]) -> Columns:
        see, unit = signals.instants, {name: Tangent(0, {place: 1.0}) for place, name in enumerate(names)}
        given = acts(see, Numbers({**shape, **unit}))
        torque, force = about_centre(see, given)
        direct = _filled((*torque, *force), len(signals), names)
        turns = not all(map(zero, given.momentum))
        return Columns(direct, _filled(given.momentum, len(signals), names) if turns else None)

    return columns


def _filled(components: Vector, samples: int, names: Sequence[str]) -> Array:
    """Arrange components as columns, shape (time, 6, coefficient)."""
    filled = np.zeros((samples, 6, max(len(names), 1)))
    for row, component in enumerate(components):
        by = component.by if isinstance(component, Tangent) else {0: component}
        for place, values in by.items():
            filled[:, row, place] = values
    return filled


def stack(*wrenches: Array) -> Array:
    """Arrange wrenches, one for each coefficient, as columns, shape (time, 6, coefficient).

    `wrenches`: shape (time, 6).
    """
    return np.stack(wrenches, axis=2)


def wrench(torque: Array | None = None, force: Array | None = None) -> Array:
    """Join a body torque and a body force, shape (time, 6), N m and N.

    `torque`, `force`, shape (time, 3): None for zero; one of them is given.
    """
    given = torque if torque is not None else force
    assert given is not None, "torque or force"
    zero = np.zeros_like(given)
    return np.concatenate([zero if torque is None else torque, zero if force is None else force], axis=1)


def hub_wrench(hubs: Array, force: Array) -> Array:
    """Sum forces at the hubs to a wrench about the centre of mass, ``(sum r_i x F_i, sum F_i)``.

    `hubs`: shape (rotor, 3), m; `force`: shape (time, rotor, 3), N; Result: shape (time, 6).
    """
    return wrench(cross(hubs[None], force).sum(axis=1), force.sum(axis=1))


def a_few_percent(_number: str, _values: Mapping[str, float], _vehicle: VehicleSettings) -> float:
    """Account for an error of any number as small as formulas of thrust are off by: it is not called wrong for it."""
    return 0.05
