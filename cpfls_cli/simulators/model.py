"""What the file of a simulator states of a vehicle: mass, inertia, centre of mass and rotors, each with its place."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.errors import InputError
from cpfls_cli.inertia import INERTIA_ENTRIES, symmetric
from cpfls_cli.simulators.document import Node, Stated
from cpfls_cli.vehicle.settings import VehicleSettings

GRAVITY = 9.81
ENTRIES = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
"""Names of the entries of an inertia in files."""
_STRAIGHT = 0.9998
"""Cosine of one degree: up to there an axis of thrust is that of the body."""
_SHORTEST = 1e-9
_ROUNDING = 1e-6


@dataclass(frozen=True)
class Body:
    """A part of the vehicle with mass of its own.

    Attributes
    ----------
    centre : array, shape (3,), m
        Its centre of mass, in the frame of the vehicle's first link: x forward, y left, z up.
    inertia : array, shape (3, 3), kg m^2
        About its centre of mass, in the same axes.
    turned, link : array, shape (3, 3)
        From the axes that its inertia and its place are stated in to those of the vehicle.
    entries : tuple of Stated
        Ixx Iyy Izz Ixy Ixz Iyz as stated; empty where they are not stated so.
    place : tuple of Stated
        x, y, z of its centre as stated; empty where they are not stated.
    node : Node or None
        The element that holds mass and inertia, to put something into.
    """

    name: str
    mass: Stated
    centre: Array
    inertia: Array
    turned: Array
    link: Array
    entries: tuple[Stated, ...] = ()
    place: tuple[Stated, ...] = ()
    node: Node | None = None

    @property
    def inertia_at(self) -> str:
        """Where its inertia is stated."""
        return self.entries[0].where if self.entries else self.mass.where


@dataclass(frozen=True)
class Rotor:
    """A rotor with what the file states of it; None for what the file cannot state.

    Attributes
    ----------
    hub : array, shape (3,), m
        Where its thrust acts, in the frame of the vehicle's first link.
    axis : array, shape (3,)
        Direction of its thrust, of length 1.
    spin : int
        1 counter-clockwise seen from above, -1 clockwise, 0 where that is not known.
    thrust : Stated or None, N s^2
        Thrust over squared speed.
    ratio : Stated or None, m
        Yaw torque over thrust.
    torque : Stated or None, N m s^2
        Yaw torque over squared speed, where that is what the file states.
    most : Stated or None, N
        Largest thrust, where controls are thrusts.
    curve : Stated or None
        Of thrust by the volts of a motor: a coefficient of it, with which the others go.
    turn : Stated or None
        Where its spin is stated.
    place : tuple of Stated
        x, y, z of its hub, m, as far as they are stated from the centre of mass; empty where they are not.
    node : Node or None
        The element that holds its numbers, to put something into.
    """

    name: str
    where: str
    hub: Array
    axis: Array
    spin: int
    thrust: Stated | None = None
    ratio: Stated | None = None
    torque: Stated | None = None
    speed_max: Stated | None = None
    most: Stated | None = None
    curve: Stated | None = None
    lag_up: Stated | None = None
    lag_down: Stated | None = None
    drag: Stated | None = None
    rolling: Stated | None = None
    turn: Stated | None = None
    place: tuple[Stated, ...] = ()
    node: Node | None = None

    @property
    def lift(self) -> float | None:
        """Largest thrust, N; None where the file does not state it."""
        if self.most is not None:
            return self.most.value
        both = self.thrust is not None and self.speed_max is not None
        return self.thrust.value * self.speed_max.value**2 if both and self.thrust and self.speed_max else None

    @property
    def drag_factor(self) -> float | None:
        """Yaw torque over squared speed, N m s^2."""
        if self.torque is not None:
            return self.torque.value
        return None if self.thrust is None or self.ratio is None else self.thrust.value * self.ratio.value


@dataclass(frozen=True)
class SimulatorModel:
    """A vehicle as the file of a simulator has it.

    Attributes
    ----------
    bodies : tuple of Body
        Parts with mass; the first one is that which the rotors hang on, though another may be heavier.
    cannot : tuple of str
        What files of this format cannot state.
    notes : tuple of str
        What is odd about the file.
    files : tuple of Path
        All files that it was read from, itself first.
    effects : mapping from str to mapping from str to Stated
        Numbers of effects by their coefficients, where the format has their very formulas.
    of_commands : bool
        Whether speeds are commands times the largest speed, so that logged speeds are others.
    by_volts : tuple of float
        Thrust of a motor, N, by powers of its volts, from the constant on; empty where the file has none.
    section : str
        Which vehicle of a file with several.
    """

    name: str
    format: str
    bodies: tuple[Body, ...]
    rotors: tuple[Rotor, ...]
    cannot: tuple[str, ...]
    notes: tuple[str, ...]
    files: tuple[Path, ...]
    effects: Mapping[str, Mapping[str, Stated]] = field(default_factory=dict)
    of_commands: bool = False
    by_volts: tuple[float, ...] = ()
    section: str = ""

    @property
    def file(self) -> Path:
        """The file that was given."""
        return self.files[0]

    @property
    def output_names(self) -> dict[Path, str]:
        """Names of its files where they are written anew; where these are alike by folders too, then by numbers."""
        taken: dict[Path, str] = {}
        for file in self.files:
            folders = (f"{file.parent.name}{number}-{file.name}" for number in ("", *range(2, len(self.files) + 2)))
            given = {name.lower() for name in taken.values()}
            taken[file] = next(name for name in (file.name, *folders) if name.lower() not in given)
        return taken

    @property
    def mass_kg(self) -> float:
        """Mass of all parts."""
        return float(sum(body.mass.value for body in self.bodies))

    @property
    def heaviest(self) -> Body:
        """The part that corrections of inertia and centre of mass go into."""
        return max(self.bodies, key=lambda body: body.mass.value)

    @property
    def centre(self) -> Array:
        """Centre of mass in the frame of the first link, shape (3,), m."""
        return np.asarray(sum(body.mass.value * body.centre for body in self.bodies) / self.mass_kg)

    @property
    def inertia(self) -> Array:
        """Inertia about the centre of mass, shape (3, 3), kg m^2: x forward, y left, z up."""
        total = np.zeros((3, 3))
        for body in self.bodies:
            apart = body.centre - self.centre
            total += body.inertia + body.mass.value * (apart @ apart * np.eye(3) - np.outer(apart, apart))
        return total

    @property
    def states_inertia(self) -> bool:
        """Whether the file states any inertia."""
        return bool(self.inertia.any())

    @property
    def moments(self) -> tuple[float, ...]:
        """Inertia as a study has it: three moments, or six entries where an axis is coupled."""
        six = [float(self.inertia[at]) for at in INERTIA_ENTRIES]
        coupled = max(map(abs, six[3:])) > 1e-6 * max(six[:3])
        return tuple(six if coupled else six[:3])

    @property
    def hubs(self) -> Array:
        """Hubs from the centre of mass, shape (rotor, 3), m."""
        return np.array([rotor.hub - self.centre for rotor in self.rotors])

    @property
    def speed_max(self) -> Stated | None:
        """Largest speed that all rotors reach, rad/s."""
        speeds = [rotor.speed_max for rotor in self.rotors]
        known = [each for each in speeds if each is not None]
        return min(known, key=lambda each: each.value) if known and len(known) == len(speeds) else None

    @property
    def lift(self) -> float | None:
        """Largest thrust of all rotors, N; None where the file does not state it."""
        lifts = [rotor.lift for rotor in self.rotors]
        known = [lift for lift in lifts if lift is not None]
        return sum(known) if known and len(known) == len(lifts) else None

    @property
    def where_of_mass(self) -> str:
        """Where the mass is stated."""
        with_mass = [body for body in self.bodies if body.mass.value > 0]
        rest = len(with_mass) - 1
        return self.heaviest.mass.where + (f", and {rest} more links fixed to it, rotors among them" if rest else "")


def _require_body(body: Body) -> None:
    if body.mass.value < 0:
        raise InputError(f"{body.mass.where}: a mass of {body.mass.value:g} kg; write one above 0")
    if body.mass.value > 0 and np.linalg.eigvalsh(body.inertia).min() < 0:
        raise InputError(
            f"{body.inertia_at}: inertia that no body has: a principal moment is below 0; correct ixx to iyz there"
        )


def checked(model: SimulatorModel) -> SimulatorModel:
    """Refuse a model without mass, one that cannot hover on its rotors, and rotors that do not lift along z.

    Raises
    ------
    InputError
    """
    for body in model.bodies:
        _require_body(body)
    if not model.mass_kg > 0:
        raise InputError(f"{model.file}: states no mass above 0 ({model.bodies[0].mass.where}); write one")
    for rotor in model.rotors:
        if rotor.axis[2] < _STRAIGHT:
            raise InputError(
                f"{rotor.where}: pushes along {np.round(rotor.axis, 3).tolist()}, not along z of the body; a study has "
                "rotors that lift along z alone"
            )
    lift, weight = model.lift, model.mass_kg * GRAVITY
    if lift is not None and lift < weight:
        raise InputError(
            f"{model.file}: {model.mass_kg:.4g} kg weigh {weight:.3g} N, and its {len(model.rotors)} rotors lift at "
            f"most {lift:.3g} N: it cannot hover; check the mass ({model.heaviest.mass.where}), and "
            f"thrust and limit of the rotors ({model.rotors[0].where})"
        )
    return replace(model, notes=(*model.notes, *_oddities(model)))


def _oddities(model: SimulatorModel) -> Iterator[str]:
    """Say of what a vehicle cannot have, but a simulator flies."""
    *others, largest = np.linalg.eigvalsh(model.inertia)
    if largest > (1 + _ROUNDING) * sum(others):
        yield (
            f"its largest moment of inertia, {largest:.4g} kg m^2, is more than the other two together, "
            f"{sum(others):.4g}, which no body has ({model.heaviest.inertia_at})"
        )
    spins = [rotor.spin for rotor in model.rotors]
    if len(spins) > 3 and all(spins):
        arm = np.abs(model.hubs[:, :2]).max()
        mixer = np.column_stack([np.ones(len(spins)), model.hubs[:, :2] / (arm or 1.0), spins])
        if np.linalg.matrix_rank(mixer, _ROUNDING) < 4:
            turns = ", ".join("counter-clockwise" if spin > 0 else "clockwise" for spin in spins)
            yield f"its rotors turn {turns}, so that roll, pitch and yaw are not independent: no autopilot flies it"


def part_of(
    name: str,
    mass: Stated,
    entries: Sequence[Stated],
    link: Array,
    own: Array,
    place: Sequence[Stated] = (),
    node: Node | None = None,
) -> Body:
    """Make a part of its inertia as stated, by the poses of its link and, in that, of its inertial, shape (4, 4)."""
    at = link @ own
    turned = at[:3, :3]
    inertia = turned @ symmetric([entry.value for entry in entries]) @ turned.T
    return Body(name, mass, at[:3, 3], inertia, turned, link[:3, :3], tuple(entries), tuple(place), node)


def of_one_body(mass: Stated, entries: Sequence[Stated], centre: str) -> Body:
    """Make the only part of a vehicle, about its centre of mass; the last says why no number states that."""
    return part_of("the vehicle", mass, entries, np.eye(4), np.eye(4), [Stated(0.0, centre)] * 3)


def of_settings(file: Path, vehicle: VehicleSettings, lag_s: float) -> SimulatorModel:
    """Take what flights found of a vehicle for a model as a simulator's file states one."""
    where = f"{file.name}: as flights have it"
    entries = [Stated(value, where) for value in (*vehicle.inertia_kg_m2, 0.0, 0.0, 0.0)[:6]]
    lag = Stated(lag_s, where) if lag_s > 0 else None
    rotors = tuple(
        Rotor(
            f"rotor {index}",
            where,
            np.array(rotor.position_m),
            np.array([0.0, 0.0, 1.0]),
            rotor.spin,
            thrust=Stated(rotor.thrust_factor_n_s2, where),
            torque=Stated(rotor.drag_factor_n_m_s2, where),
            speed_max=Stated(vehicle.rotor_speed_max_rad_s, where),
            lag_up=lag,
            lag_down=lag,
        )
        for index, rotor in enumerate(vehicle.rotors, 1)
    )
    body = of_one_body(Stated(vehicle.mass_kg, f"{file.name}: of its config"), entries, where)
    cannot = ("what effects it has: `cpfls gap` takes the file itself with all of them",)
    return SimulatorModel(file.stem, "vehicle", (body,), rotors, cannot, (), (file,))


def turning(node: Node, what: str) -> InputError:
    """Make the error of a joint that turns."""
    return node.error(f"{what} turns, and a study has one rigid body; fix it in the file that you give")


def unit(node: Node, name: str, direction: Sequence[float] | Array) -> Array:
    """Scale what an element states to length 1; InputError if it has no length."""
    length = float(np.linalg.norm(direction))
    if not length > _SHORTEST:
        raise node.error(f"{name} has no direction; write one whose length is not 0")
    return np.asarray(direction, dtype=float) / length


def of_quaternion(quaternion: Sequence[float] | Array) -> Array:
    """Rotation by a quaternion w, x, y, z of length 1, shape (3, 3)."""
    from scipy.spatial.transform import Rotation

    w, x, y, z = quaternion
    return np.asarray(Rotation.from_quat([x, y, z, w]).as_matrix())


def pose(rotation: Array, place: Sequence[float] | Array) -> Array:
    """Put a rotation and a place together, shape (4, 4)."""
    made = np.eye(4)
    made[:3, :3], made[:3, 3] = rotation, place
    return made
