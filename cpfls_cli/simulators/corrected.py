"""A simulator's own file corrected: the bytes of what flights contradict are replaced, all others stay as they are.

Of the effects that `gap` names, those whose formula is the simulator's become numbers of the file:

- ``parameter_error``: thrust of all rotors is ``1 + thrust_scale`` times the stated one. Torque and inertia show only
  as their ratio, so a moment of inertia is ``(1 + inertia) (1 + thrust_scale)`` times the stated one; about z only
  where the yaw torque follows the thrust, as it does where the file states their ratio. What flights were compared with
  and the file does not state, such as the thrust of a vehicle that was given, is listed.
- ``rotor_mismatch``: thrust of single rotors, by the pattern that was found, and their yaw torque with it; what
  clockwise rotors drag more than they lift is their ratio of torque to thrust. ``drag_factor_error``: that of all.
  Where the file has one number for rotors that differ, only what is common to all is put into it.
- ``com_offset``: the centre of the heaviest link moves so that that of the vehicle does; where places of rotors are
  from the centre of mass they all move the other way.
- ``products_of_inertia``, ``rotor_drag``, ``motor_lag``: as they are. ``rolling_moment`` is positive for rotors that
  turn counter-clockwise and negative for others, since the plugin's formula has no sign of the turn.

A number is replaced only where the interval leaves the stated one out at the rate of errors that names are given at,
for all numbers together (Bonferroni): at 95 % each, of four that are right one would be moved in every sixth file.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import hypot
from pathlib import Path
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.effects.effect import Quantity
from cpfls_cli.effects.registry import effect as find
from cpfls_cli.effects.signals import Signals
from cpfls_cli.errors import visible
from cpfls_cli.flightlog.airframe import turns_by_rotors
from cpfls_cli.gap.naming.results import Conclusion, Estimate, GapVerdict, NamedEffect
from cpfls_cli.gap.settings import RARE
from cpfls_cli.inertia import INERTIA_ENTRIES, symmetric
from cpfls_cli.simulators.document import Node, Span, Stated, raw_bytes
from cpfls_cli.simulators.literals import with_comment
from cpfls_cli.simulators.model import ENTRIES, Rotor
from cpfls_cli.simulators.results import Change, Corrected
from cpfls_cli.simulators.study import VehicleOf
from cpfls_cli.vehicle.rotors import gain_modes
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.words import joined

_WAYS = (("forward", "back"), ("left", "right"), ("up", "down"))
_OF_EFFECTS: dict[str, Quantity] = {"drag": "drag", "rolling": "rolling", "lag_up": "lag"}
"""Numbers of a rotor that are effects of their own, which a study's vehicle has none of, by their quantity."""
_WRITES = (GapVerdict.NAMED, GapVerdict.PARTIAL, GapVerdict.AMBIGUOUS)
_OF_PLUGINS = ("sdf", "urdf-gazebo")
_OF_XML = (*_OF_PLUGINS, "urdf", "mjcf")
_BEFORE_ROOT = re.compile(rb"(?:<!--.*?-->|<\?.*?\?>|[^<])*", re.DOTALL)
"""Declaration and comments ahead of the first element."""
_ROUNDING, _SAME = 1e-9, 1e-6
_LEAST_S = 5.0
"""Length of a flight that shows single rotors."""
_BY_HAND = {
    **dict.fromkeys(_OF_PLUGINS, "a plugin of your own that adds this force and torque to the first link at each step"),
    "urdf": "applyExternalForce and applyExternalTorque at each step",
    "mjcf": "data.xfrc_applied of the body at each step",
    "rotorpy": "a class of your own under Multirotor, whose compute_body_wrench adds it",
    "ardupilot": "lines of your own in SIM_Frame.cpp",
    "crazyflow": "dist_f and dist_t at each step",
    "crazyflie": "nothing: the firmware has no model of it",
}
_OF_PLUGIN = {
    "thrust": "motorConstant",
    "ratio": "momentConstant",
    "lag_up": "timeConstantUp",
    "lag_down": "timeConstantDown",
    "drag": "rotorDragCoefficient",
    "rolling": "rollingMomentCoefficient",
}
_TAGS = {
    **dict.fromkeys(_OF_PLUGINS, _OF_PLUGIN),
    "urdf": {"thrust": "kf", "torque": "km", "drag": "drag_coeff_xy"},
    "mjcf": {"thrust": "gear z", "torque": "gear yaw", "ratio": "gear yaw", "lag_up": "dynprm", "lag_down": "dynprm"},
    "rotorpy": {"thrust": "k_eta", "torque": "k_m", "lag_up": "tau_m", "lag_down": "tau_m", "drag": "k_d"},
    "ardupilot": {"thrust": "hoverThrOut", "ratio": "motorN_yaw"},
    "crazyflow": {
        "thrust": "rpm2thrust",
        "torque": "rpm2torque",
        "lag_up": "rotor_dyn_coef",
        "lag_down": "rotor_dyn_coef",
        "drag": "drag_matrix",
    },
    "crazyflie": {"ratio": "THRUST2TORQUE", "curve": "VMOTOR2THRUST"},
}
"""Names of the numbers of a rotor in each format; what a format does not name it cannot hold."""
_NOT_STATED = {
    **dict.fromkeys(_OF_PLUGINS, "it has no place in the motor plugin"),
    "urdf": "the file states none; write kf and km into <properties>, as gym-pybullet-drones reads them, or scale the "
    "forces and torques that you apply",
    "mjcf": "controls are newtons, so no number of the file is wrong: put the factor on what makes controls of speeds",
    "ardupilot": "the motors are those of the frame; write motorN_position and motorN_yaw of each",
    "crazyflie": "the header has thrust by the volts of a motor, and that by speed is the model's; logs with motor.m1 "
    "to m4 and pm.vbat, without speeds, show it",
    "rotorpy": "k_eta and k_m are others; write them there",
    "crazyflow": "rpm2thrust and rpm2torque are others; write them there",
}
"""Why thrust or yaw torque of rotors is not put in, and what would do it."""


class _Found(NamedTuple):
    """A quantity in SI units as flights have it, with the ends of its interval."""

    value: float
    low: float
    high: float

    @classmethod
    def of(cls, number: Estimate) -> _Found:
        """Take an estimate."""
        return cls(number.value, number.low, number.high)

    def plus(self, added: float) -> _Found:
        """Add what is exact."""
        return _Found(*(each + added for each in self))

    def times(self, factor: float) -> _Found:
        ends = factor * self.low, factor * self.high
        return _Found(factor * self.value, min(ends), max(ends))

    def with_factor(self, other: _Found) -> _Found:
        """Multiply two factors whose errors are independent."""
        wide = [
            hypot(own / self.value, its / other.value)
            for own, its in zip(
                (self.low - self.value, self.high - self.value),
                (other.low - other.value, other.high - other.value),
                strict=True,
            )
        ]
        value = self.value * other.value
        return _Found(value, value * (1 - wide[0]), value * (1 + wide[1]))

    def __str__(self) -> str:
        """Write it with its interval."""
        return f"{self.value:.4g} [{self.low:.4g}, {self.high:.4g}]"

    def contradicts(self, stated: float, wider: float = 1.0) -> bool:
        """Tell whether a number lies outside the interval, made wider by a factor."""
        below, above = (self.value + wider * (end - self.value) for end in (self.low, self.high))
        rounding = _ROUNDING * abs(stated)
        return stated < below - rounding or stated > above + rounding


_ONE = _Found(1.0, 1.0, 1.0)


def _part(number: Estimate | None, times: float) -> _Found:
    return _Found(0.0, 0.0, 0.0) if number is None else _Found.of(number).times(float(times))


def _sum(*parts: _Found) -> _Found:
    """Add what is independent to 1."""
    value = 1.0 + sum(part.value for part in parts)
    below, above = (hypot(*(part[end] - part.value for part in parts)) for end in (1, 2))
    return _Found(value, value - below, value + above)


def _factor(number: Estimate | None) -> _Found:
    return _ONE if number is None else _Found.of(number).plus(1.0)


@dataclass
class _Corrections:
    """What is replaced and put in, and what is said of it."""

    of: VehicleOf
    vehicle: VehicleSettings
    numbers: int
    edits: dict[Span, bytes] = field(default_factory=dict)
    put_in: dict[Span, bytes] = field(default_factory=dict)
    changes: dict[tuple[str, str, float, float], tuple[Change, list[str]]] = field(default_factory=dict)
    unchanged: list[str] = field(default_factory=list)
    elsewhere: list[str] = field(default_factory=list)
    turned: list[int] = field(default_factory=list)

    @cached_property
    def wider(self) -> float:
        """By how much an interval that rarely leaves out any of all numbers is wider than one at 95 % of one."""
        from scipy.stats import norm

        return float(norm.isf(0.5 * RARE / max(self.numbers, 1)) / norm.isf(0.025))

    @property
    def rotors(self) -> list[Rotor]:
        """In the order of the study; the sign of a yaw torque is that of the turn as corrected."""
        found = [self.of.model.rotors[index] for index in self.of.order]
        return [_turned_round(rotor) if place in self.turned else rotor for place, rotor in enumerate(found)]

    def replace(
        self,
        name: str,
        stated: Stated,
        found: _Found,
        words: str,
        whom: str,
        room: Node | None,
        *,
        whatever: bool = False,
    ) -> None:
        """Put a number in the place of the stated one, where that is outside the interval, or whatever it is."""
        new, low, high = (stated.written(each) for each in found)
        low, high, name = min(low, high), max(low, high), stated.name or name
        before, text = stated.written(stated.value), f"{new:z.4g}"
        if stated.power < 0 and stated.value:
            # What the number is the reciprocal of is the other way round.
            words = words.replace("{share}", _share(found.value / stated.value))
        if not (whatever or found.contradicts(stated.value, self.wider)):
            word = f"is as near as chance leaves one of {self.numbers} numbers: the flights have"
            word = word if found.contradicts(stated.value) else "agrees with the flights,"
            self._keep(f"{name} {before:.4g} {word} {text} [{low:.4g}, {high:.4g}]")
        elif stated.span is not None:
            self.edits[stated.span] = text.encode()
            self.note(stated.span.file, name, stated.where, (before, float(text), low, high), words, whom)
            for other in stated.also:
                # An entry of a matrix that stands twice may be 0, and is the same then.
                share = other.value / before if before else 1.0
                same = share * new, *sorted((share * low, share * high))
                self.replace(name, other, _Found(*same), words, whom, None)
        elif room is not None and self.of.model.format in _OF_PLUGINS:
            self.put(room, f"<{name}>{text}</{name}>")
            self.note(room.file, name, stated.where, (before, float(text), low, high), words, whom)
        else:
            self.elsewhere.append(f"{name} = {text} [{low:.4g}, {high:.4g}]: {stated.where}; write it there")

    def note(
        self, file: Path, name: str, where: str, numbers: tuple[float, float, float, float], words: str, whom: str
    ) -> None:
        """Take note of a change: before, after, and the ends of the interval."""
        before, after, low, high = numbers
        change = Change(
            file=self.of.model.output_names[file],
            element=name,
            where=where,
            before=float(f"{before:.6g}"),
            after=after,
            low=low,
            high=high,
            sentence=words,
        )
        self.changes.setdefault((change.file, name, change.before, after), (change, []))[1].append(whom)

    def put(self, room: Node, line: str) -> None:
        """Put an element behind the last child of another one, indented as the first is; or into an empty one."""
        raw, tag = raw_bytes(room.file), room.opening
        assert tag is not None, "what was read has a tag"
        if not room.children:
            # A slash that closes it at once makes way for an end.
            begin, end = (b">", f"</{room.tag}>".encode()) if tag[1] else (b"", b"")
            place = Span(room.file, tag.start(1) if end else tag.end(), tag.end())
            self.put_in[place] = self.put_in.get(place, begin + end).removesuffix(end) + line.encode() + end
            return
        first, last = room.children[0].start, room.children[-1].close
        indent = raw[raw.rfind(b"\n", 0, first) + 1 : first]
        end_of_last = raw.index(b">", last) + 1
        place = Span(room.file, end_of_last, end_of_last)
        text = b"\n" + (indent if not indent.strip() else b"") + line.encode()
        self.put_in[place] = self.put_in.get(place, b"") + text

    def _keep(self, sentence: str) -> None:
        if sentence not in self.unchanged:
            self.unchanged.append(sentence)

    def of_rotors(self, kind: str, found: Sequence[_Found], words: str, common: Sequence[_Found] = ()) -> bool:
        """Correct a number of each rotor; False where the file does not state it.

        A number that is that of rotors that differ becomes what is common to them. Of a pattern over more than
        four rotors each is a part: all are corrected, or none.
        """
        name = _TAGS[self.of.model.format].get(kind)
        held: list[Stated] = [own for rotor in self.rotors if (own := getattr(rotor, kind)) is not None]
        if name is None or not held or len(held) < len(self.rotors):
            return False
        wanted = [f"{own.written(each.value):.4g}" for own, each in zip(held, found, strict=True)]
        off = [each.contradicts(own.value, self.wider) for own, each in zip(held, found, strict=True)]
        pattern = len(held) > 4 and len(set(wanted)) > 1 and any(off)
        for index, own in enumerate(held):
            alike = [other for other, each in enumerate(held) if own.span is not None and each.span == own.span]
            new = found[index]
            if len({wanted[other] for other in alike}) > 1:
                each = ", ".join(f"M{other + 1} {wanted[other]}" for other in alike)
                self._keep(f"{name} is one number for all rotors, and the flights have another for each: {each}")
                if not common or not common[index].contradicts(own.value, self.wider):
                    continue
                new = common[index]
            part = pattern and wanted[index] != f"{own.written(own.value):.4g}"
            self.replace(name, own, new, words, f"M{index + 1}", self.rotors[index].node, whatever=part)
        return True


def corrected(
    of: VehicleOf, vehicle: VehicleSettings, found: Conclusion, flights: Sequence[Signals]
) -> tuple[Corrected, dict[str, bytes]]:
    """Put what a diagnosis names into a simulator's file: what there is to say, and the files by name.

    Parameters
    ----------
    vehicle : VehicleSettings
        That flights were compared with: of the study that was made of the file, with what it leaves open.
    flights : sequence of Signals
        That it was found in.
    """
    made = _Corrections(of, vehicle, sum(len(each.numbers) for each in found.effects))
    if not found.contradictions:
        _directions(made, flights)
    if found.verdict in _WRITES and not found.contradictions:
        sure = []
        for each in found.effects:
            title, excitation = find(each.name).title, find(each.name).excitation
            if each.name in found.rivals:
                rivals = joined([find(rival.name).title for rival in found.rivals[each.name]], "or")
                made.unchanged.append(f"{title}: these flights cannot separate it from {rivals}")
            elif not each.identified:
                made.unchanged.append(
                    f"{title}, {_values(each)}: setpoints do not show it, and a fit sees how the loop answers gusts "
                    f"too; fly, with setpoints in the log: {excitation}"
                )
            else:
                sure.append(each)
        _put_in(made, sure)
        _not_found(made, found)
    elif found.verdict == GapVerdict.NO_GAP:
        _not_found(made, found)
    elif found.contradictions:
        made.unchanged.append("the log or its vehicle contradicts itself, so nothing is put in")
    changes = tuple(_said(change, whom) for change, whom in made.changes.values())
    files = _written(made, changes, [each.name for each in flights])
    names = of.model.output_names
    texts = {names[file]: text for file, text in files.items()}
    diff = list[str]()
    for file, text in files.items():
        given, after = (each.decode("utf-8", "replace").splitlines(keepends=True) for each in (raw_bytes(file), text))
        diff += difflib.unified_diff(given, after, f"given/{names[file]}", f"corrected/{names[file]}", n=1)
    said = Corrected(
        files=tuple(texts),
        changes=changes,
        unchanged=tuple(made.unchanged),
        elsewhere=tuple(made.elsewhere),
        diff=visible("".join(line if line.endswith("\n") else f"{line}\n" for line in diff)),
    )
    return said, texts


def _said(change: Change, whom: Sequence[str]) -> Change:
    whom = list(dict.fromkeys(whom))
    first = int(whom[0][1:]) if re.fullmatch(r"M\d+", whom[0]) else 0
    in_turn = len(whom) > 2 and whom == [f"M{first + place}" for place in range(len(whom))]
    names = f"{whom[0]} to {whom[-1]}" if in_turn else joined(whom)
    more = _share(change.after / change.before) if change.before else "not 0"
    return replace(change, sentence=change.sentence.format(whom=names, share=more))


def _share(factor: float) -> str:
    if factor > 3:
        return f"{factor:.3g} times as much"
    return f"{abs(100 * (factor - 1)):.3g} % {'more' if factor > 1 else 'less'}"


def _directions(made: _Corrections, flights: Sequence[Signals]) -> None:
    """Turn rotors round that the log has turn the other way, where flights show each of them by itself."""
    if not made.of.turned:
        return
    measured = [
        (each, speed)
        for each in flights
        if (speed := each.rotor_speed) is not None and speed.any() and len(each) * each.period > _LEAST_S
    ]
    if not measured:
        made.unchanged.append(f"directions of rotors: no flight of more than {_LEAST_S:g} s has speeds of rotors")
        return
    turns, half = turns_by_rotors((each.body_rate, speed, 1 / each.period, each.commanded) for each, speed in measured)
    stated = [rotor.turn.span for rotor in made.rotors if rotor.turn is not None]
    for place in made.of.turned:
        rotor, spin = made.rotors[place], made.of.spins[place]
        # The body turns against its rotors.
        shown, whom = _Found(-turns[place], -turns[place] - half[place], -turns[place] + half[place]), f"M{place + 1}"
        size = f"{shown.value:.2g} [{shown.low:.2g}, {shown.high:.2g}]"
        way = "counter-clockwise" if spin > 0 else "clockwise"
        says = f"{whom} turns {way}: fitted by itself, its yaw torque is {size} times the mean of all rotors"
        if spin * shown.value < 0 or not shown.contradicts(0.0, made.wider):
            made.unchanged.append(
                f"the direction of {whom}: the log has it turn {way}, and flights do not show it ({size})"
            )
        elif rotor.turn is None or rotor.turn.span is None or sum(rotor.turn.span == each for each in stated) > 1:
            where = "the format states no direction" if rotor.turn is None else rotor.turn.where
            made.elsewhere.append(f"{says}; {where}: turn it round there")
        else:
            span, is_word = rotor.turn.span, made.of.model.format in _OF_PLUGINS
            old = raw_bytes(span.file)[span.start : span.end]
            flipped = old[1:] if old[:1] == b"-" else b"-" + old.removeprefix(b"+")
            made.edits[span] = (b"ccw" if spin > 0 else b"cw") if is_word else flipped
            name = rotor.turn.name or ("turningDirection" if is_word else "gear yaw")
            after = -rotor.turn.value
            numbers = (rotor.turn.value, after, *shown.times(after * spin)[1:])
            made.note(span.file, name, rotor.turn.where, numbers, says, whom)
            made.turned.append(place)


def _turned_round(rotor: Rotor) -> Rotor:
    """Change the sign of a yaw torque whose number in the file has that of the turn."""
    ratio, torque = (
        replace(own, scale=-own.scale) if own and rotor.turn and own.span == rotor.turn.span else own
        for own in (rotor.ratio, rotor.torque)
    )
    return replace(rotor, ratio=ratio, torque=torque)


def _put_in(made: _Corrections, effects: Sequence[NamedEffect]) -> None:
    together = {
        number.name: number for each in effects if find(each.name).quantity == "scales" for number in each.numbers
    }
    if together:
        _of_rotors(made, together)
    for each in effects:
        quantity = find(each.name).quantity
        rule = None if quantity is None else _RULES.get(quantity)
        held = quantity == "scales" or (
            rule is not None and rule(made, {number.name: number for number in each.numbers})
        )
        held = held or _of_formula(made, each)
        if not held and not each.of_log:
            _not_held(made, each)
    if not (made.changes or made.elsewhere or made.unchanged):
        made.unchanged.append("nothing that the flights determine contradicts the file")


def _of_formula(made: _Corrections, each: NamedEffect) -> bool:
    """Correct the numbers of an effect whose very formula the simulator has; False where it has not."""
    stated = made.of.model.effects.get(each.name)
    if stated is None or any(number.name not in stated for number in each.numbers):
        return False
    for number in each.numbers:
        own = stated[number.name]
        made.replace(own.name, own, _Found.of(number), f"{find(each.name).title}: {{share}}", "", None)
    return True


def _not_found(made: _Corrections, found: Conclusion) -> None:
    """Say of what the file states and the flights did not show why."""
    named = {find(each.name).quantity for each in found.effects}
    hidden = {find(each.name).quantity: each.reason for each in found.not_excited}
    tags = _TAGS[made.of.model.format]
    for kind, quantity in _OF_EFFECTS.items():
        stated: Stated | None = getattr(made.rotors[0], kind) if made.rotors else None
        if kind not in tags or quantity in named or stated is None or stated.value == 0:
            continue
        _say_hidden(made, stated.name or tags[kind], stated, hidden.get(quantity))
    names, reasons = {each.name for each in found.effects}, {each.name: each.reason for each in found.not_excited}
    for effect, numbers in made.of.model.effects.items():
        for stated in numbers.values() if effect not in names else ():
            if stated.value != 0:
                _say_hidden(made, stated.name, stated, reasons.get(effect))


def _say_hidden(made: _Corrections, name: str, stated: Stated, reason: str | None) -> None:
    why = "these flights show none of it" if reason is None else f"these flights cannot show it: {reason}"
    made.unchanged.append(f"{name} {stated.written(stated.value):.4g}: {why}")


def _values(each: NamedEffect) -> str:
    return ", ".join(f"{number.name} {_Found.of(number)} {number.unit}" for number in each.numbers)


def _not_held(made: _Corrections, each: NamedEffect) -> None:
    entry, values = find(each.name), _values(each)
    made.elsewhere.append(
        f"{entry.title}: {entry.formula}{', with ' if values else ''}{values}; the format has no number for it: "
        f"{_BY_HAND[made.of.model.format]}; `cpfls export extended.h5 --format c` writes the lines"
    )


def _of_rotors(made: _Corrections, numbers: Mapping[str, Estimate]) -> None:
    """Correct thrust, yaw torque and inertia by wrong numbers, rotors that differ, and a wrong drag factor together."""
    scale = _factor(numbers.get("thrust_scale"))
    if not scale.contradicts(1.0, made.wider):
        # 1 with as wide an interval, where it may be that.
        scale = scale.plus(1.0 - scale.value)
    lifts, drags = (numbers.get(f"{what}_imbalance") for what in ("lift", "drag"))
    modes, spins = gain_modes(made.vehicle), [rotor.spin for rotor in made.vehicle.rotors]
    patterns = [
        [_part(numbers.get(f"difference_{place}"), share) for place, share in enumerate(own, 1)] for own in modes
    ]
    lifting = [_sum(*own, _part(lifts, spin)) for own, spin in zip(patterns, spins, strict=True)]
    differ = "difference_1" in numbers
    if "thrust_scale" in numbers or differ:
        shown = "the difference of opposite rotors" if modes.shape[1] == 2 else "what rotors have not in common"
        words = "thrust of {whom} is {share}" + (f"; flights show {shown}" if differ else "")
        _as_found(made, "thrust", [scale.with_factor(each) for each in lifting], words, scale)
        _largest_thrust(made, scale)
    by_inertia, why = _in_place_of_inertia(made, numbers, scale)
    if "error" in numbers or differ or why:
        error = _factor(numbers.get("error")).with_factor(by_inertia)
        kind = "torque" if any(rotor.torque is not None for rotor in made.rotors) else "ratio"
        # What a rotor lifts less it drags less, so that the ratio of the two stays.
        own = [
            [_part(drags, -spin), *(pattern if kind == "torque" else [_part(lifts, -spin)])]
            for pattern, spin in zip(patterns, spins, strict=True)
        ]
        words = f"yaw torque{'' if kind == 'torque' else ' over thrust'} of {{whom}} is {{share}}{why}"
        _as_found(made, kind, [error.with_factor(_sum(*each)) for each in own], words, error)
    _moments(made, numbers, scale, "xy" if why else "xyz")


def _as_found(made: _Corrections, kind: str, factors: Sequence[_Found], words: str, common: _Found) -> None:
    """Correct a number of each rotor by factors on it, or list them where flights were compared with another number."""
    known = [
        {"thrust": k, "torque": b, "ratio": b / k}[kind]
        for k, b in ((each.thrust_factor_n_s2, each.drag_factor_n_m_s2) for each in made.vehicle.rotors)
    ]
    if kind == "thrust" and made.of.lift is not None:
        kind, known = "curve", [rotor.curve.value for rotor in made.rotors if rotor.curve is not None]
    stated = [own.value for rotor in made.rotors if (own := getattr(rotor, kind)) is not None]
    if len(stated) == len(factors) == len(known) and np.allclose(stated, known, rtol=_SAME, atol=0.0):
        found = [factor.times(own) for factor, own in zip(factors, known, strict=True)]
        if made.of_rotors(kind, found, words, [common.times(own) for own in known]):
            return
    off = {f"M{index + 1}": str(each) for index, each in enumerate(factors) if each.contradicts(1.0, made.wider)}
    if off:
        alike = len(off) == len(factors) and len(set(off.values())) == 1
        sizes = {"all rotors": off["M1"]} if alike else off
        made.elsewhere.append(
            f"{words.partition(' of {whom}')[0]}, as a factor on that which flights were compared with: "
            f"{', '.join(f'{whom} {size}' for whom, size in sizes.items())}; {_NOT_STATED[made.of.model.format]}"
        )


def _largest_thrust(made: _Corrections, scale: _Found) -> None:
    """Change the largest thrust of gym-pybullet-drones with kf: rotors turn as fast as before."""
    node = made.rotors[0].node if made.rotors and made.of.model.format == "urdf" else None
    if node is not None and "thrust2weight" in node.attributes and scale.value != 1.0:
        share = node.number("thrust2weight")
        words = "rotors turn as fast as before, and lift {share}"
        made.replace("thrust2weight", share, scale.times(share.value), words, "all", None)


def _moments(made: _Corrections, numbers: Mapping[str, Estimate], scale: _Found, axes: str) -> None:
    # About z the torque follows the thrust where the file states the ratio of the two.
    follows = all(rotor.torque is None for rotor in made.rotors)
    if scale.value != 1.0 and follows and made.rotors and "inertia_z" not in numbers:
        name = _TAGS[made.of.model.format].get("ratio", "their ratio")
        made.unchanged.append(
            f"the inertia about z, and {name}: flights do not show them, and yaw torque follows thrust"
        )
    for axis in axes:
        if f"inertia_{axis}" in numbers:
            _inertia(made, {"xyz".index(axis): _moment(made, numbers, scale, axis)})


def _moment(made: _Corrections, numbers: Mapping[str, Estimate], scale: _Found, axis: str) -> _Found:
    """Give a moment of inertia as flights have it; that about z goes with the thrust where the ratio of both shows."""
    follows = axis != "z" or all(rotor.torque is None for rotor in made.rotors)
    factor = _factor(numbers.get(f"inertia_{axis}")).with_factor(scale if follows else _ONE)
    return factor.times(made.vehicle.inertia_kg_m2["xyz".index(axis)])


def _in_place_of_inertia(made: _Corrections, numbers: Mapping[str, Estimate], scale: _Found) -> tuple[_Found, str]:
    """Give what yaw torque is off where it is corrected in place of the inertia about z, and why."""
    if "inertia_z" not in numbers or not made.rotors:
        return _ONE, ""
    stated = dict(zip("xyz", made.vehicle.inertia_kg_m2, strict=False))
    found = {axis: _moment(made, numbers, scale, axis) for axis in "xyz" if f"inertia_{axis}" in numbers}
    # With what is written for the other two.
    x, y, z = (
        found[axis].value if axis in found and found[axis].contradicts(own, made.wider) else own
        for axis, own in stated.items()
    )
    of_newtons = made.of.states_ratio and all(rotor.thrust is None for rotor in made.rotors)
    if not of_newtons and z <= x + y:
        return _ONE, ""
    # Of the two whose ratio shows, the torque is a guess in most files that know no speeds.
    factor = found["z"].times(1.0 / stated["z"])
    why = ", by its ratio to the inertia about z"
    return (
        _Found(*(1.0 / each for each in (factor.value, factor.high, factor.low))),
        why if of_newtons else f"{why}, which in its place would be that of no body",
    )


def _inertia(made: _Corrections, wanted: Mapping[int, _Found]) -> None:
    """Change entries of the inertia of the heaviest link by what that of the vehicle is off."""
    whole, own = made.of.model.inertia, made.of.model.heaviest
    for entry, found in wanted.items():
        total = float(whole[INERTIA_ENTRIES[entry]])
        if own.node is None and not made.of.model.states_inertia:
            made.elsewhere.append(f"{ENTRIES[entry]} of the vehicle is {found} kg m^2: the file states none")
            continue
        if not own.entries or not _straight(own.turned):
            if found.contradicts(total, made.wider):
                made.elsewhere.append(
                    f"{ENTRIES[entry]} of the vehicle is {found} kg m^2, and not {total:.4g}: {own.inertia_at} states "
                    "it in other axes, or not; change it there"
                )
            continue
        new = found.plus(float(own.inertia[INERTIA_ENTRIES[entry]]) - total)
        words = f"moment of inertia {ENTRIES[entry]} of {{whom}} is {{share}}"
        words += "; about z flights show its ratio to the yaw torque alone" if entry == 2 else ""
        room = own.node.first("inertia") if own.node is not None and made.of.model.format == "sdf" else None
        made.replace(ENTRIES[entry], own.entries[entry], new, words, own.name or "the vehicle", room)


def _straight(turned: Array) -> bool:
    return bool(np.allclose(turned, np.eye(3), atol=1e-6))


def _products(made: _Corrections, numbers: Mapping[str, Estimate]) -> bool:
    known = symmetric(made.vehicle.inertia_kg_m2)
    added = dict(enumerate(list(numbers.values())[:3], start=3))
    _inertia(made, {at: _Found.of(each).plus(float(known[INERTIA_ENTRIES[at]])) for at, each in added.items()})
    return True


def _centre(made: _Corrections, numbers: Mapping[str, Estimate]) -> bool:
    model, body = made.of.model, made.of.model.heaviest
    if made.rotors and all(rotor.place for rotor in made.rotors):
        return _around_centre(made, numbers)
    share, whom = model.mass_kg / body.mass.value, body.name or "the vehicle"
    place, moved = [each.value for each in body.place] or [0.0] * 3, False
    for axis, name in enumerate("xyz"):
        own = numbers.get(f"c_{name}")
        if own is None:
            continue
        found = _Found.of(own).times(share).plus(place[axis])
        words = _moved(own.value, axis)
        if not _straight(body.link):
            if found.contradicts(place[axis], made.wider):
                made.elsewhere.append(f"{words}: {body.inertia_at} states it in other axes; change it there")
        elif body.place or body.node is None or model.format != "sdf":
            stated = body.place[axis] if body.place else Stated(place[axis], body.inertia_at)
            made.replace(f"pose {name}", stated, found, words, whom, None)
        elif found.contradicts(place[axis], made.wider):
            values = (place[axis], float(f"{found.value:.4g}"), found.low, found.high)
            made.note(body.node.file, f"pose {name}", f"{body.node.where}: no <pose>", values, words, whom)
            place[axis], moved = found.value, True
    if moved and body.node is not None:
        empty, text = body.node.first("pose"), f"{' '.join(f'{each:.4g}' for each in place)} 0 0 0"
        made.put(empty or body.node, text if empty else f"<pose>{text}</pose>")
    return True


def _moved(offset: float, axis: int) -> str:
    return f"centre of mass of the vehicle is {1e3 * abs(offset):.3g} mm {_WAYS[axis][int(offset < 0)]}"


def _around_centre(made: _Corrections, numbers: Mapping[str, Estimate]) -> bool:
    """Move all rotors the other way, whose places are from the centre of mass."""
    for axis, name in enumerate("xyz"):
        own = numbers.get(f"c_{name}")
        if own is None:
            continue
        moved = _Found.of(own).times(-1.0)
        words = f"{_moved(own.value, axis)}, and the place of {{whom}} is from it"
        if all(axis < len(rotor.place) for rotor in made.rotors):
            # All of them or none: an expression for several numbers has no place for one.
            whole = all(each.span is not None for rotor in made.rotors for each in rotor.place)
            for index, rotor in enumerate(made.rotors):
                place = rotor.place[axis] if whole else replace(rotor.place[axis], span=None)
                made.replace(place.name, place, moved.plus(place.value), words, f"M{index + 1}", None)
        elif moved.contradicts(0.0, made.wider):
            made.elsewhere.append(f"{_moved(own.value, axis)}: the format has no number for it")
    return True


def _hangs_on_hover(made: _Corrections, what: str) -> bool:
    """Leave a number that the file states at the hover speed where this is corrected too."""
    changed = [change.element for change, _ in made.changes.values()]
    if made.of.model.format != "crazyflow" or not any("rpm2thrust" in element for element in changed):
        return False
    made.unchanged.append(f"{what}: it hangs on the hover speed, which the thrust changes; run this on the new file")
    return True


def _lag(made: _Corrections, numbers: Mapping[str, Estimate]) -> bool:
    tau = numbers["time_constant_s"]
    if _hangs_on_hover(made, f"time constant {tau.value:.4g} s"):
        return True
    up, down = ([getattr(rotor, kind) for rotor in made.rotors] for kind in ("lag_up", "lag_down"))
    if None in up or None in down or "lag_up" not in _TAGS[made.of.model.format]:
        return False
    stated = [each.value for each in (*up, *down)]
    if tau.low <= max(stated) and tau.high >= min(stated):
        made.unchanged.append(
            f"time constants {min(stated):.4g} and {max(stated):.4g} s agree with the flights, {_Found.of(tau)} s up "
            "and down together"
        )
        return True
    for kind in ("lag_up", "lag_down"):
        made.of_rotors(kind, [_Found.of(tau)] * len(made.rotors), "time constant of {whom} is {share}")
    return True


def _drag(made: _Corrections, numbers: Mapping[str, Estimate]) -> bool:
    if _hangs_on_hover(made, f"drag of rotors {numbers['k_d'].value:.4g}"):
        return True
    return made.of_rotors("drag", [_Found.of(numbers["k_d"])] * len(made.rotors), "drag of {whom} is {share}")


def _rolling(made: _Corrections, numbers: Mapping[str, Estimate]) -> bool:
    signed = [_Found.of(numbers["mu"]).times(rotor.spin) for rotor in made.vehicle.rotors]
    return made.of_rotors("rolling", signed, "rolling moment of {whom} is {share}")


_RULES: dict[Quantity, Callable[[_Corrections, Mapping[str, Estimate]], bool]] = {
    "products": _products,
    "centre": _centre,
    "lag": _lag,
    "drag": _drag,
    "rolling": _rolling,
}
"""What corrects a quantity; False where the format has no number for it."""


def _written(made: _Corrections, changes: Sequence[Change], flights: Sequence[str]) -> dict[Path, bytes]:
    """Give the files as corrected; the one that was given is always among them."""
    found = {}
    for file in made.of.model.files:
        raw, edits = raw_bytes(file), {**made.edits, **made.put_in}
        own = sorted((span for span in edits if span.file == file), key=lambda span: span.start, reverse=True)
        if not own and file != made.of.model.file:
            continue
        for span in own:
            raw = raw[: span.start] + edits[span] + raw[span.end :]
        own_changes = [change for change in changes if change.file == made.of.model.output_names[file]]
        if own and made.of.model.format in _OF_XML:
            head = _BEFORE_ROOT.match(raw_bytes(file))
            assert head is not None, "it may be empty"
            raw = head[0] + _comment(_comment_lines(own_changes, flights), raw) + raw[head.end() :]
        elif own:
            raw = with_comment(file, raw, _comment_lines(own_changes, flights))
        found[file] = raw
    return found


def _comment_lines(changes: Sequence[Change], flights: Sequence[str]) -> list[str]:
    """Write what was changed, with intervals and flights."""
    return [
        f"Corrected by cpfls gap; 95 % intervals, from {', '.join(flights)}:",
        *(
            f"  {each.element} {each.before:.6g} to {each.after:.4g} [{each.low:.4g}, {each.high:.4g}]: {each.sentence}"
            for each in changes
        ),
    ]


def _comment(lines: Sequence[str], raw: bytes) -> bytes:
    """Write what was changed as a comment of XML."""
    end = "\r\n" if b"\r\n" in raw else "\n"
    # Two hyphens end a comment, and files are in many encodings.
    text = re.sub("-(?=-)", "- ", end.join(map(visible, lines)))
    return f"<!-- {text} -->{end}".encode("ascii", "xmlcharrefreplace")
