"""The vehicle of a study made of a simulator's file, with its rotors in the order of the log; and how it flies."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import combinations
from os.path import abspath, commonpath
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np

from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.effects.signals import Signals
from cpfls_cli.errors import InputError
from cpfls_cli.flightlog.airframe import Airframe
from cpfls_cli.flightlog.proposal import Proposal
from cpfls_cli.gap.before_after import PlayedPair, played_pairs, rates_fade
from cpfls_cli.gap.settings import GapSettings
from cpfls_cli.playback.model import ModelEffect, VehicleModel
from cpfls_cli.playback.rotors import RotorResponse
from cpfls_cli.simulators.document import Stated
from cpfls_cli.simulators.formats import FORMATS, as_stated
from cpfls_cli.simulators.model import GRAVITY, Rotor, SimulatorModel
from cpfls_cli.vehicle.settings import RotorSettings, VehicleSettings

_BESIDES = {
    "lag_up": ("time constant", "s"),
    "drag": ("drag of a rotor", "N s^2/(m rad)"),
    "rolling": ("rolling moment of a rotor", "kg m/rad"),
}
_KNOWN = ("stated", "data")
"""How sure a log has to be of its rotors to say in which order the columns are."""
_LEAST_VOLTS = 1.0  # Below are shares of a full battery.
_ALIKE = 0.1
"""Share by which the mean thrust by a curve over volts differs between flights of one vehicle."""
_DIRECTION, _SPIN = 0.7, 0.1
"""Cosine from which two directions are the same, of rotors that are 45 degrees apart; what an equal spin counts."""

_FLOWN: dict[str, Callable[[Rotor], float]] = {
    "drag": lambda rotor: rotor.drag.value if rotor.drag else 0.0,
    # The plugin's formula has no sign of the turn; what all rotors have alike is no effect of the catalogue.
    "rolling": lambda rotor: rotor.spin * rotor.rolling.value if rotor.rolling else 0.0,
}
"""What a rotor of the file has of each quantity that is an effect of its own."""


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
    spins : tuple of int
        Of the rotors of the study: those of the log where it is sure of them, else those of the file.
    warnings : tuple of str
        Where the file and the log contradict each other.
    """

    model: SimulatorModel
    given_mass: bool
    mass_kg: float
    speed_max: float | None
    where_of_speed: str
    order: tuple[int, ...]
    spins: tuple[int, ...]
    notes: tuple[str, ...]
    warnings: tuple[str, ...]
    by_speed: bool = True
    """Whether the speeds of the log are those that the file's thrust goes by."""
    lift: float | None = None
    """Thrust of a motor at the largest speed, N, by the volts that the log shows; None where nothing says so."""

    @property
    def program(self) -> str:
        """Whose file it is."""
        return next((each.program for each in FORMATS if each.name == self.model.format), "cpfls")

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
        return (*keys, *(f"vehicle.rotors.{i}.spin" for i, spin in enumerate(self.spins) if not spin))

    @property
    def turned(self) -> tuple[int, ...]:
        """Rotors of the study that turn the other way in the file."""
        both = zip(self.spins, self.order, strict=True)
        return tuple(place for place, (spin, index) in enumerate(both) if spin * self.model.rotors[index].spin < 0)

    @property
    def lifts(self) -> float | None:
        """Largest thrust over the weight; None where the file does not state it."""
        return None if self.model.lift is None else self.model.lift / (self.mass_kg * GRAVITY)

    @property
    def rotors(self) -> list[RotorLine]:
        """The rotors, in the order of the log."""
        hubs, found = self.model.hubs, []
        for index, spin in zip(self.order, self.spins, strict=True):
            rotor = self.model.rotors[index]
            thrust = rotor.thrust.value if rotor.thrust is not None and self.by_speed else None
            drag = rotor.drag_factor if self.by_speed else None
            if self.lift is not None and self.speed_max:
                thrust = self.lift / self.speed_max**2
                drag = None if rotor.ratio is None else rotor.ratio.value * thrust
            thrust, drag = (None if each is None else _short([each])[0] for each in (thrust, drag))
            comment = f"{rotor.name}, {rotor.where}"
            comment += "; it turns the other way there" if spin * rotor.spin < 0 else ""
            found.append(RotorLine(_short(hubs[index].tolist()), spin, thrust, drag, comment))
        return found

    @property
    def states_ratio(self) -> bool:
        """Whether the yaw torque follows from the thrust, which another may give."""
        ratios = [self.model.rotors[index].ratio for index in self.order]
        return self.by_speed and bool(ratios) and None not in ratios

    def filled(self, vehicle: VehicleSettings) -> VehicleSettings:
        """Give rotors whose thrust a model states the yaw torque over thrust of the file."""
        rotors = list(vehicle.rotors)
        for at, (index, line) in enumerate(zip(self.order, self.rotors, strict=False)):
            ratio = self.model.rotors[index].ratio
            if line.thrust is None and ratio is not None and self.by_speed:
                own = rotors[at]
                rotors[at] = replace(own, drag_factor_n_m_s2=ratio.value * own.thrust_factor_n_s2)
        return replace(vehicle, rotors=tuple(rotors))

    def where_of(self, quantity: str) -> str:
        """Say where a quantity of the first rotor stands."""
        rotor = self.model.rotors[self.order[0]]
        if quantity == "thrust":
            if not self.by_speed:
                return "by command, and the log has speeds"
            if self.lift is not None and rotor.curve is not None:
                return f"that of hover, by the volts of the log and {rotor.curve.where}"
            return "not stated by speed" if rotor.thrust is None else rotor.thrust.where
        stated = rotor.torque or rotor.ratio
        ratio = f", {rotor.ratio.value:g} m times the thrust" if rotor.ratio is not None else ""
        return "not stated" if stated is None else f"{stated.where}{ratio}"

    @property
    def besides(self) -> list[str]:
        """What the file states of the first rotor and the vehicle of a study does not hold."""
        found = []
        for name, (words, unit) in _BESIDES.items() if self.model.rotors else ():
            rotor = self.model.rotors[self.order[0]]
            stated: Stated | None = getattr(rotor, name)
            if stated is not None:
                down = f" up, {rotor.lag_down.value:g} {unit} down" if name == "lag_up" and rotor.lag_down else ""
                found.append(f"{words} {stated.value:g} {unit}{down} ({stated.where})")
        known = [own for numbers in self.model.effects.values() for own in numbers.values() if own.value != 0]
        return [*found, *(f"{own.name.rpartition('.')[2]} {own.value:g} ({own.where})" for own in known)]


def _short(values: list[float]) -> list[float]:
    """Write numbers without the digits of rounding."""
    return [float(f"{value:.12g}") + 0.0 for value in values]


def of_log(
    model: SimulatorModel, proposal: Proposal | None, mass_kg: float | None, like: VehicleSettings | None = None
) -> VehicleOf:
    """Make the vehicle of a study; a log says in which order its rotors are, and how fast they turned.

    What hangs on the log, the largest speed and thrust by volts, is that of a vehicle made of this file with other
    logs, where one is given; InputError if the log has another number of rotors than the file.
    """
    airframe = None if proposal is None else proposal.airframe
    logged = 0 if proposal is None else proposal.rotors
    if model.rotors and logged not in (0, len(model.rotors)):
        raise InputError(
            f"{model.file}: has {len(model.rotors)} rotors, and the log {logged}; give the file of the vehicle that "
            "flew"
        )
    usual = tuple(range(len(model.rotors)))
    order, spins, notes, warnings = usual, tuple(rotor.spin for rotor in model.rotors), list[str](), list[str]()
    if model.rotors and airframe is not None and airframe.sure in _KNOWN:
        order, doubt = _order(model, airframe)
        warnings += [f"{model.file}: {doubt}"] if doubt else []
        if order != usual:
            notes.append("rotors are in the order of the log, whose motors are numbered another way than the file's")
        spins, turned = _spins(model, airframe, order)
        warnings += turned
    if like is None:
        speed, where = _speed(model, proposal)
    else:
        # What a log lets one guess is another number for each log, and no other vehicle.
        speed, where = like.rotor_speed_max_rad_s, "Of the model that gives what the file leaves open"
        if (stated := model.speed_max) is not None:
            where = f"Of the model that gives other numbers; the file states {stated.value:g} ({stated.where})"
    mass = model.mass_kg if mass_kg is None else mass_kg
    by_speed = not model.of_commands or proposal is None or proposal.share_of_speed
    given, short = mass_kg is not None, _short([mass])[0]
    lift = _lift(model, proposal) if model.by_volts and proposal is not None else None
    if lift is not None and like is not None and "thrust_factor" not in like.unknown:
        before = like.rotors[0].thrust_factor_n_s2 * like.rotor_speed_max_rad_s**2
        lift = before if abs(lift / before - 1) < _ALIKE else lift
    return VehicleOf(model, given, short, speed, where, order, spins, tuple(notes), tuple(warnings), by_speed, lift)


def _lift(model: SimulatorModel, proposal: Proposal) -> float | None:
    """Give the thrust of a motor at the largest speed, N, that lifts on average as the volts of the log do."""
    first, shares = proposal.first, proposal.first.speeds
    choices = {each.key: each.value for each in proposal.choices}
    if not proposal.share_of_speed or choices.get("rotor_command_is") != "speed":
        return None
    volts = np.nan if first.load is None else first.load.voltage
    if shares is None or not volts > _LEAST_VOLTS:
        return None
    flown = shares[np.isfinite(shares).all(axis=1)]
    lifts = np.maximum(np.polynomial.polynomial.polyval(volts * flown, model.by_volts), 0.0)
    return float(lifts.sum() / (flown**2).sum()) if lifts.any() and flown.any() else None


def _order(model: SimulatorModel, airframe: Airframe) -> tuple[tuple[int, ...], str]:
    """Find the rotor of the file for each rotor of the log, and what is not sure of it.

    They lie in the same direction from the middle; of two on one arm the spin says which is which.
    """
    from scipy.optimize import linear_sum_assignment

    hubs = model.hubs[:, :2] - model.hubs[:, :2].mean(axis=0)
    wanted = np.array([rotor.direction for rotor in airframe.rotors])
    wanted = wanted - wanted.mean(axis=0)
    lengths = np.linalg.norm(hubs, axis=1)[:, None] * np.linalg.norm(wanted, axis=1)[None]
    alike = (hubs @ wanted.T) / np.where(lengths > 0, lengths, np.inf)
    same = np.equal.outer([rotor.spin for rotor in model.rotors], [rotor.spin for rotor in airframe.rotors])
    order = linear_sum_assignment(-(alike + _SPIN * same).T)[1]
    places = range(len(order))
    if min(alike[order[place], place] for place in places) < _DIRECTION:
        return tuple(places), "no order of its rotors fits that of the log, so they are as in the file; check it"
    for one, other in combinations(places, 2):
        near = min(alike[order[other], one], alike[order[one], other]) > _DIRECTION
        if near and airframe.rotors[one].spin == airframe.rotors[other].spin:
            return tuple(order.tolist()), (
                f"M{one + 1} and M{other + 1} lie in the same direction and turn the same way, so which is which is a "
                "guess; check it"
            )
    return tuple(order.tolist()), ""


def _spins(model: SimulatorModel, airframe: Airframe, order: tuple[int, ...]) -> tuple[tuple[int, ...], list[str]]:
    """Give the spins of rotors, those of the log where it contradicts single ones of the file, and say so.

    Where the motion has all turn the other way it may be the log whose axes are mirrored.
    """
    ways = {1: "counter-clockwise", -1: "clockwise"}
    of_file, of_log_ = [model.rotors[index].spin for index in order], [rotor.spin for rotor in airframe.rotors]
    wrong = [place for place, spin in enumerate(of_file) if spin * of_log_[place] < 0]
    by_log = airframe.sure == "stated" or len(wrong) < len(order)
    said = []
    for place in wrong:
        rotor = model.rotors[order[place]]
        said.append(
            f"{rotor.where}: {rotor.name} turns {ways[rotor.spin]} in the file and {ways[of_log_[place]]} by the log "
            f"({airframe.reason}): one of the two is wrong; the config has the {'log' if by_log else 'file'}'s"
        )
    return tuple((its or own) if by_log else own for own, its in zip(of_file, of_log_, strict=True)), said


def _speed(model: SimulatorModel, proposal: Proposal | None) -> tuple[float | None, str]:
    stated = model.speed_max
    if stated is None:
        if proposal is None:
            return None, "The file does not state how fast rotors turn"
        return proposal.speed_max, "A round number above the largest in the log: the file does not state it"
    if proposal is not None and not proposal.share_of_speed and proposal.speed_max > 1.2 * stated.value:
        return proposal.speed_max, f"Above the largest in the log; the file states {stated.value:g} ({stated.where})"
    return _short([stated.value])[0], stated.where


@contextmanager
def corrected_files(model: SimulatorModel, texts: Mapping[str, bytes]) -> Iterator[Path]:
    """Have the files of a model for a while with corrected texts, by their names in the output; give the main one."""
    names = model.output_names
    # Includes are next to a file where it is named, and not where a link leads.
    folder = Path(commonpath([abspath(file.parent) for file in model.files]))
    with TemporaryDirectory() as copied:
        for file in model.files:
            copy = copied / Path(abspath(file)).relative_to(folder)
            copy.parent.mkdir(parents=True, exist_ok=True)
            copy.write_bytes(texts.get(names[file]) or file.read_bytes())
        yield copied / Path(abspath(model.file)).relative_to(folder)


def as_corrected(model: SimulatorModel, texts: Mapping[str, bytes]) -> SimulatorModel:
    """Read a model again with corrected files, by their names in the output; that it hovers is not asked."""
    with corrected_files(model, texts) as main:
        return as_stated(main.with_name(f"{main.name}:{model.section}") if model.section else main)


def _times(new: Stated | None, before: Stated | None) -> float:
    """Tell how many times a number is what it was, 1 where it is not stated."""
    return new.value / before.value if new is not None and before is not None and before.value else 1.0


def _settings(of: VehicleOf, given: VehicleOf, stated: VehicleSettings) -> VehicleSettings:
    """Give the vehicle of a file, `stated` being that of the file as given; of one without rotors those of the log."""
    rotors = list(stated.rotors) if not of.order else []
    for index, own, line in zip(of.order, stated.rotors, of.rotors, strict=False):
        new, before = (each.model.rotors[index] for each in (of, given))
        # Where controls are thrusts or shares, a file states by how much they are changed.
        more = _times(new.most, before.most) * _times(new.curve, before.curve)
        turn = more * _times(new.ratio, before.ratio)
        absolute = not (of.model.of_commands or of.model.by_volts)
        known = {
            "spin": new.spin,
            "thrust_factor_n_s2": line.thrust if line.thrust and absolute else more * own.thrust_factor_n_s2,
            "drag_factor_n_m_s2": line.drag if line.drag and absolute else turn * own.drag_factor_n_m_s2,
        }
        numbers = {key: value for key, value in known.items() if value}
        rotors.append(RotorSettings(**{**vars(own), **numbers, "position_m": tuple(line.position_m)}))
    whole: dict[str, Any] = {"inertia_kg_m2": tuple(of.inertia or stated.inertia_kg_m2), "rotors": tuple(rotors)}
    return replace(stated, mass_kg=of.mass_kg, **whole)


def vehicle_of(of: VehicleOf, given: VehicleOf, stated: VehicleSettings) -> VehicleModel:
    """Make the vehicle that the simulator flies: that of the study, with drag, rolling moment and lag of its rotors.

    A lag acts where a log has commands; measured speeds have it already. `given` is what `stated` was made of.
    """
    rotors = [of.model.rotors[index] for index in of.order]
    shares = {name: float(np.mean([own(rotor) for rotor in rotors] or [0.0])) for name, own in _FLOWN.items()}
    found = [(each.name, shares.get(str(each.quantity), 0.0)) for each in CATALOGUE.values()]
    effects = [ModelEffect(name, {}, np.array([share])) for name, share in found if share]
    for name, numbers in of.model.effects.items():
        values = [numbers[each.name].value if each.name in numbers else 0.0 for each in CATALOGUE[name].coefficients]
        effects += [ModelEffect(name, {}, np.array(values))] if any(values) else []
    lag = np.mean([rotor.lag_up.value for rotor in rotors if rotor.lag_up] or [0.0])
    return VehicleModel(
        vehicle=_settings(of, given, stated),
        effects=tuple(effects),
        response=RotorResponse(lag_s=float(lag)),
        commanded=True,
    )


def played(
    of: VehicleOf,
    texts: Mapping[str, bytes],
    stated: VehicleSettings,
    training: Sequence[Signals],
    held: Sequence[Signals],
    settings: GapSettings,
) -> list[PlayedPair]:
    """Make held-out flights and the vehicle of the file as given and as corrected ready for playback.

    Parameters
    ----------
    texts : dict of str to bytes
        Corrected files by their names in the output.
    stated : VehicleSettings
        Of the study that was made of the file as given.
    training, held : sequence of Signals
        Flights that the corrections were found in, and those that are played back.
    """
    before = vehicle_of(of, of, stated)
    after = vehicle_of(replace(of, model=as_corrected(of.model, texts)), of, stated)
    return played_pairs(held, after, before, rates_fade(training, settings.horizon_s))
