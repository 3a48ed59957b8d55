"""The vehicle of a study made of a simulator's file, with its rotors in the order of the log."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from cpfls_cli.errors import InputError
from cpfls_cli.flightlog.airframe import Airframe
from cpfls_cli.flightlog.proposal import Proposal
from cpfls_cli.simulators.document import Stated
from cpfls_cli.simulators.model import GRAVITY, Rotor, SimulatorModel

_PROGRAMS = {
    "sdf": "Gazebo",
    "urdf": "gym-pybullet-drones",
    "mjcf": "MuJoCo",
    "rotorpy": "RotorPy",
    "ardupilot": "ArduPilot's SITL",
    "crazyflow": "crazyflow",
    "crazyflie": "the Crazyflie's firmware",
    "vehicle": "cpfls",
}
_BESIDES = {
    "lag_up": ("time constant", "s"),
    "drag": ("drag of a rotor", "N s^2/(m rad)"),
    "rolling": ("rolling moment of a rotor", "kg m/rad"),
}
_KNOWN = ("stated", "data")
"""How sure a log has to be of its rotors to say in which order the columns are."""


class RotorLine(NamedTuple):
    """A rotor as the study lists it."""

    position_m: list[float]
    spin: int
    thrust: float | None
    drag: float | None
    comment: str


@dataclass(frozen=True)
class VehicleOf:
    """The section ``vehicle`` of a study, made of a simulator's file.

    Attributes
    ----------
    order : tuple of int
        Which rotor of the file each rotor of the study is.
    warnings : tuple of str
        Where the file and the log contradict each other.
    """

    model: SimulatorModel
    given_mass: bool
    mass_kg: float
    speed_max: float | None
    where_of_speed: str
    order: tuple[int, ...]
    notes: tuple[str, ...]
    warnings: tuple[str, ...]
    by_speed: bool = True
    """Whether the speeds of the log are those that the file's thrust goes by."""

    @property
    def program(self) -> str:
        """Whose file it is."""
        return _PROGRAMS[self.model.format]

    @property
    def centre(self) -> list[float]:
        """Centre of mass in the frame of the first link, m."""
        return _short(self.model.centre.tolist())

    @property
    def inertia(self) -> list[float] | None:
        """Moments of inertia, kg m^2, and products where there are any; None where the file states none."""
        return _short(list(self.model.moments)) if self.model.states_inertia else None

    @property
    def asked(self) -> tuple[str, ...]:
        """Keys of the config that the file does not state and no log is there to state."""
        keys = [] if self.speed_max is not None else ["vehicle.rotor_speed_max_rad_s"]
        keys += [] if self.model.rotors else ["vehicle.rotors"]
        return (*keys, *(f"vehicle.rotors.{i}.spin" for i, rotor in enumerate(self.rotors) if not rotor.spin))

    @property
    def lifts(self) -> float | None:
        """Largest thrust over the weight; None where the file does not state it."""
        return None if self.model.lift is None else self.model.lift / (self.mass_kg * GRAVITY)

    @property
    def rotors(self) -> list[RotorLine]:
        """The rotors, in the order of the log."""
        hubs, found = self.model.hubs, []
        for index in self.order:
            rotor = self.model.rotors[index]
            thrust = rotor.thrust.value if rotor.thrust is not None and self.by_speed else None
            drag = rotor.drag_factor if self.by_speed else None
            thrust, drag = (None if each is None else _short([each])[0] for each in (thrust, drag))
            found.append(
                RotorLine(_short(hubs[index].tolist()), rotor.spin, thrust, drag, f"{rotor.name}, {rotor.where}")
            )
        return found

    def where_of(self, quantity: str) -> str:
        """Say where a quantity of the first rotor stands."""
        rotor = self.model.rotors[self.order[0]]
        if quantity == "thrust":
            if not self.by_speed:
                return "by command, and the log has speeds"
            return "not stated by speed" if rotor.thrust is None else rotor.thrust.where
        stated = rotor.torque or rotor.ratio
        ratio = f", {rotor.ratio.value:g} m times the thrust" if rotor.ratio is not None else ""
        return "not stated" if stated is None else f"{stated.where}{ratio}"

    @property
    def besides(self) -> list[str]:
        """What the file states of the first rotor and the vehicle of a study does not hold."""
        if not self.model.rotors:
            return []
        return list(_besides(self.model.rotors[self.order[0]]))


def _besides(rotor: Rotor) -> Iterator[str]:
    for name, (words, unit) in _BESIDES.items():
        stated: Stated | None = getattr(rotor, name)
        if stated is None:
            continue
        down = f" up, {rotor.lag_down.value:g} {unit} down" if name == "lag_up" and rotor.lag_down else ""
        yield f"{words} {stated.value:g} {unit}{down} ({stated.where})"


def _short(values: list[float]) -> list[float]:
    """Write numbers without the digits of rounding."""
    return [float(f"{value:.12g}") + 0.0 for value in values]


def of_log(model: SimulatorModel, proposal: Proposal | None, mass_kg: float | None) -> VehicleOf:
    """Make the vehicle of a study; a log says in which order its rotors are, and how fast they turned.

    Raises
    ------
    InputError
        If the log has another number of rotors than the file.
    """
    airframe = None if proposal is None else proposal.airframe
    logged = 0 if proposal is None else proposal.rotors
    if model.rotors and logged not in (0, len(model.rotors)):
        raise InputError(
            f"{model.file}: has {len(model.rotors)} rotors, and the log {logged}; give the file of the vehicle that "
            "flew"
        )
    order, notes, warnings = tuple(range(len(model.rotors))), list[str](), list[str]()
    if model.rotors and airframe is not None and airframe.sure in _KNOWN:
        order = _order(model, airframe)
        if order != tuple(range(len(order))):
            notes.append("rotors are in the order of the log, whose motors are numbered another way than the file's")
        warnings += _turned(model, airframe, order)
    speed, where = _speed(model, proposal)
    mass = model.mass_kg if mass_kg is None else mass_kg
    by_speed = not model.of_commands or proposal is None or proposal.share_of_speed
    return VehicleOf(
        model, mass_kg is not None, _short([mass])[0], speed, where, order, tuple(notes), tuple(warnings), by_speed
    )


def _order(model: SimulatorModel, airframe: Airframe) -> tuple[int, ...]:
    """Find the rotor of the file in the direction of each rotor of the log; the file's own order where none fits."""
    hubs = model.hubs[:, :2] - model.hubs[:, :2].mean(axis=0)
    wanted = np.array([rotor.direction for rotor in airframe.rotors])
    wanted = wanted - wanted.mean(axis=0)
    lengths = np.linalg.norm(hubs, axis=1)[:, None] * np.linalg.norm(wanted, axis=1)[None]
    alike = (hubs @ wanted.T) / np.where(lengths > 0, lengths, np.inf)
    found = alike.argmax(axis=0)
    usual = tuple(range(len(hubs)))
    return tuple(found.tolist()) if sorted(found.tolist()) == list(usual) else usual


def _turned(model: SimulatorModel, airframe: Airframe, order: tuple[int, ...]) -> Iterator[str]:
    ways = {1: "counter-clockwise", -1: "clockwise"}
    for place, index in enumerate(order):
        rotor, logged = model.rotors[index], airframe.rotors[place].spin
        if rotor.spin * logged < 0:
            yield (
                f"{rotor.where}: {rotor.name} turns {ways[rotor.spin]} in the file and {ways[logged]} by the log "
                f"({airframe.reason}): one of the two is wrong; the config has the file's"
            )


def _speed(model: SimulatorModel, proposal: Proposal | None) -> tuple[float | None, str]:
    stated = model.speed_max
    if stated is None:
        if proposal is None:
            return None, "The file does not state how fast rotors turn"
        return proposal.speed_max, "A round number above the largest in the log: the file does not state it"
    if proposal is not None and not proposal.share_of_speed and proposal.speed_max > 1.2 * stated.value:
        return proposal.speed_max, f"Above the largest in the log; the file states {stated.value:g} ({stated.where})"
    return _short([stated.value])[0], stated.where
