"""An effect: wrench columns that are linear in its coefficients, its description, and its hooks."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.effects.hooks import Actuation, Body, PhysicalNumbers, SensorLog, SensorTest, VehicleParts
from cpfls_cli.effects.signals import Signals
from cpfls_cli.rotations import cross
from cpfls_cli.vehicle.motion import Instant, Numbers, Wrench, about_centre
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.vehicle.values import Linear, Vector, zero

Kind = Literal["wrench", "actuator", "sensor", "parameter"]


@dataclass(frozen=True)
class Coefficient:
    """One number that an effect needs.

    Attributes
    ----------
    low, high : float
        What is physically possible, not what is usual, in multiples of `scale`.
    scale : callable or None
        Natural size on a vehicle, in `unit`; None for 1.
    of_log : bool
        Whether it tells how the motion is logged, and leaves the motion itself as it is.
    """

    name: str
    unit: str
    low: float
    high: float
    meaning: str
    scale: Callable[[VehicleSettings], float] | None = None
    of_log: bool = False

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
    """A parameter that an effect depends on nonlinearly.

    Attributes
    ----------
    grid : tuple of float
        Ascending; values that a search starts from. The first and the last bound it.
    first : float or None
        Where a search stays until the effect is chosen; None: it tries the whole grid.
    valley : float or None
        Where the residual has many valleys over it: their width, as a share of the value.
    """

    name: str
    unit: str
    grid: tuple[float, ...]
    meaning: str
    first: float | None = None
    valley: float | None = None

    def bounds(self, _vehicle: VehicleSettings) -> tuple[float, float]:
        """Bound the shape, on any vehicle, in `unit`."""
        return self.grid[0], self.grid[-1]

    @property
    def tried(self) -> tuple[float, ...]:
        """Values that a search tries."""
        return self.grid if self.first is None else (self.first,)


@dataclass(frozen=True)
class Columns:
    """Wrench columns along a flight: ``wrench = direct @ c + d/dt (momentum @ c)``.

    Attributes
    ----------
    direct : array, shape (time, 6, coefficient)
        Torque (3) and force (3) about the body axes for one unit of each coefficient.
    momentum : array, shape (time, 6, coefficient), or None
        What has to be differentiated in time; None for nothing. Nobody differentiates it: windows are integrated by
        parts.
    """

    direct: Array
    momentum: Array | None = None

    def at_samples(self, coefficients: Array, time: Array) -> Array:
        """Evaluate ``direct @ c + d/dt (momentum @ c)`` sample by sample; noise of what is differentiated shows in it.

        Parameters
        ----------
        coefficients : array, shape (coefficient,)
        time : array, shape (time,), s

        Returns
        -------
        array, shape (time, 6)
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
    """A physical effect that a model may miss.

    Attributes
    ----------
    name : str
        Identifier.
    title : str
        What people call it.
    kind : {"wrench", "actuator", "sensor", "parameter"}
        Adds torque and force; changes what the rotors do; changes what the sensors say; a wrong number of the vehicle.
    formula : str
        One line.
    sentence : str
        What a pilot understands.
    coefficients : tuple of Coefficient
        Physical, as reported; those of `shapes` not among them.
    needs : frozenset of str
        Of `Signals.available`.
    excitation : str
        The flight that shows it.
    rivals : mapping of str to str
        Effects that look alike, each with the flight that tells them apart.
    columns : callable or None
        ``columns(signals, shape) -> Columns``, linear in the linear coefficients; of an actuator the change of wrench.
        Left out, it follows from `acts`; None for what only the audit of the sensors can see.
    physical : PhysicalNumbers or None
        None: the linear coefficients are the physical ones, whose bounds bound them.
    apply : callable or None
        For effects that change what the others meet: ``apply(signals, shape) -> Signals`` as they would be without the
        effect's error, or with its air, so that all other columns can be computed from them.
    describe : callable or None
        ``describe(vehicle, values) -> str``: what the coefficients that are surely not zero say in words, by name.
    rate_derivative : bool
        Whether the columns hold the derivative of the body rates, and with it the noise of the gyroscope.
    holds : frozenset of str
        Effects that are special cases of this one, which is then not their rival.
    scatter : callable or None
        For effects with a random part: ``scatter(signals, shape) -> array, shape (time, 6)``, variance of torque and
        force for a unit of relative scatter.
    order : int
        Place in the catalogue, in the actuator chain and, from the last to the first, in the log of the sensors.
    of_all_forces : bool
        Whether the columns have a lever for the forces of all other effects.
    actuation : Actuation or None
        For effects between command and rotors: how they are simulated.
    acts : callable or None
        ``acts(see, p) -> Wrench`` at an instant, of its numbers by name: what is simulated. None for what changes only
        the log or the actuators, or has a state of its own.
    air : callable or None
        ``air(values)``: velocity of the air that all effects meet, m/s, world frame.
    carried : Body or None
        For effects with a state of their own, in place of `acts`.
    log : SensorLog or None
        For effects on the log: how they are simulated.
    test : SensorTest or None
        For effects that the sensor audit finds.
    accounts : callable or None
        ``accounts(number, values) -> float``: relative error of a number of the vehicle that the effect itself leaves,
        so that the number is not called wrong.
    in_vehicle : callable or None
        ``in_vehicle(parts, shape, linear) -> VehicleParts``: for effects that have a place of their own in the model
        of a whole vehicle.
    exact : Effect or None
        What takes the place of this one once it is chosen: the same effect with numbers for which alone another effect
        would do as well, or with those that others depend on as shapes, under the same names.
    lever : callable or None
        ``lever(linear, error, vehicle) -> array of bool, shape (coefficient,)``: coefficients that the others leave
        possible, a torque being no larger than its force on a lever as long as the body.
    """

    name: str
    title: str
    kind: Kind
    formula: str
    sentence: str
    needs: frozenset[str]
    excitation: str
    rivals: Mapping[str, str]
    source: str
    coefficients: tuple[Coefficient, ...] = ()
    shapes: tuple[Shape, ...] = ()
    columns: Callable[[Signals, Mapping[str, float]], Columns] | None = None
    physical: PhysicalNumbers | None = None
    apply: Callable[[Signals, Mapping[str, float]], Signals] | None = None
    scatter: Callable[[Signals, Mapping[str, float]], Array] | None = None
    describe: Callable[[VehicleSettings, Mapping[str, float]], str] | None = None
    holds: frozenset[str] = frozenset()
    rate_derivative: bool = False
    order: int = 1000
    of_all_forces: bool = False
    actuation: Actuation | None = None
    acts: Callable[[Instant, Numbers], Wrench] | None = None
    air: Callable[[Mapping[str, float]], tuple[float, float, float]] | None = None
    carried: Body | None = None
    log: SensorLog | None = None
    test: SensorTest | None = None
    accounts: Callable[[str, Mapping[str, float]], float] | None = None
    in_vehicle: Callable[[VehicleParts, Mapping[str, float], Array], VehicleParts] | None = None
    exact: Effect | None = None
    lever: Callable[[Array, Array, VehicleSettings], BoolArray] | None = None

    def __post_init__(self) -> None:
        """Give an actuator the change of wrench as its column, and others what they do for one unit of each number."""
        apply = self.apply
        if self.columns is None and self.kind == "actuator" and apply is not None:
            object.__setattr__(self, "columns", lambda signals, shape: wrench_change(signals, apply(signals, shape)))
        elif self.columns is None and self.acts is not None:
            object.__setattr__(self, "columns", columns_of(self.acts, [each.name for each in self.coefficients]))

    @property
    def unit_coefficient(self) -> bool:
        """Whether the columns are right only with the coefficient 1: everything is in the shape."""
        return not self.coefficients

    @property
    def late(self) -> bool:
        """Whether it delays the rotors or their log, as a control loop seems to; the voltage of a supply does not."""
        if self.actuation is None:
            return self.kind == "actuator" and self.log is not None
        return self.actuation.supply is None

    def form(self, coefficients: int, shapes: Collection[str]) -> Effect:
        """Tell by the numbers that were fitted whether it is this effect or what took its place."""
        other = self.exact or self
        names = {shape.name for shape in other.shapes}
        return other if (len(other.coefficients), names) == (coefficients, {*shapes}) else self

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
        see, unit = signals.instants, {name: Linear({place: 1.0}) for place, name in enumerate(names)}
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
        by = component.by if isinstance(component, Linear) else {0: component}
        for place, values in by.items():
            filled[:, row, place] = values
    return filled


def stack(*wrenches: Array) -> Array:
    """Arrange wrenches, one for each coefficient, as columns.

    Parameters
    ----------
    *wrenches : array, shape (time, 6)

    Returns
    -------
    array, shape (time, 6, coefficient)
    """
    return np.stack(wrenches, axis=2)


def wrench(torque: Array | None = None, force: Array | None = None) -> Array:
    """Join a body torque and a body force.

    Parameters
    ----------
    torque, force : array, shape (time, 3), or None
        None for zero; one of them is given.

    Returns
    -------
    array, shape (time, 6), N m and N
    """
    given = torque if torque is not None else force
    assert given is not None, "torque or force"
    zero = np.zeros_like(given)
    return np.concatenate([zero if torque is None else torque, zero if force is None else force], axis=1)


def hub_wrench(hubs: Array, force: Array) -> Array:
    """Sum forces at the hubs to a wrench about the centre of mass, ``(sum r_i x F_i, sum F_i)``.

    Parameters
    ----------
    hubs : array, shape (rotor, 3), m
    force : array, shape (time, rotor, 3), N

    Returns
    -------
    array, shape (time, 6)
    """
    return wrench(cross(hubs[None], force).sum(axis=1), force.sum(axis=1))


def thrust_wrench(hubs: Array, thrust: Array) -> Array:
    """Sum changes of thrust along body z to a wrench.

    Parameters
    ----------
    hubs : array, shape (rotor, 3), m
    thrust : array, shape (time, rotor), N

    Returns
    -------
    array, shape (time, 6)
    """
    force = np.zeros((*thrust.shape, 3))
    force[..., 2] = thrust
    return hub_wrench(hubs, force)


def wrench_change(before: Signals, after: Signals) -> Columns:
    """Compute the change of wrench by another actuation as a column."""
    return Columns(stack(after.wrench - before.wrench))


def a_few_percent(_number: str, _values: Mapping[str, float]) -> float:
    """Account for an error of any number as small as formulas of thrust are off by: it is not called wrong for it."""
    return 0.05
