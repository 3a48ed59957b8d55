"""Parameters of an autopilot by its own names, and the control law that they make."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from math import inf

from cpfls_cli.autopilots.law import AXES, AxisLaw, Filter, FilterKind, Law, Stage
from cpfls_cli.autopilots.motors import MixerRule, ThrustCurve
from cpfls_cli.errors import InputError

_GROUPS = {"all": AXES, "tilt": AXES[:2], **{name: (name,) for name in AXES}}
_ORDER: tuple[tuple[Stage, FilterKind, str], ...] = (
    ("measured", "notch", "measured.notch"),
    ("measured", "notch", "measured.notch2"),
    ("measured", "first", "measured.first"),
    ("measured", "first", "measured.first2"),
    ("measured", "second", "measured.second"),
    ("target", "first", "target.first"),
    ("error", "first", "error.first"),
    ("slope", "notch", "slope.notch"),
    ("slope", "first", "slope.first"),
    ("slope", "first", "slope.first2"),
    ("slope", "second", "slope.second"),
    ("output", "first", "output.first"),
)
"""Filters that a law may have, in the order in which a signal passes them."""

_KINDS: tuple[tuple[FilterKind, int, float], ...] = (
    ("first", 1, 1.0),
    ("second", 1, 1.0),
    ("first", 2, (2**0.5 - 1) ** -0.5),
    ("first", 3, (2 ** (1 / 3) - 1) ** -0.5),
)
"""Low-passes by number: kind, how many in series, and the cut-off of each over that of all."""


@dataclass(frozen=True)
class Parameter:
    """A parameter of an autopilot, as it writes it.

    `role`: what it is in the law, axes (``roll``, ``pitch``, ``yaw``, ``tilt`` for the first two, ``all``) or
    ``motors``, a dot, and the quantity; `low`, `high`: of the range that its documentation gives; `scale`: factor from
    it to the quantity of the law, SI; it is written in multiples of `step`; `absent`: its value where a log holds
    parameters but not this one, None for the default.
    """

    name: str
    role: str
    default: float
    low: float
    high: float
    meaning: str
    unit: str = ""
    scale: float = 1.0
    step: float = 1e-4
    absent: float | None = None


@dataclass(frozen=True)
class Firmware:
    """The version of an autopilot whose names, defaults and ranges these are, and what others have otherwise.

    `systems`: first words by which a log names the program that wrote it; `oldest`: first version whose gains count as
    these do, `older` what is otherwise in logs of before; `oldest_gains`: first version whose gains of the rate count
    as these do, whatever its filters (None: `oldest`); `renamed`: versions, with names here and those of the versions
    before.
    """

    title: str
    systems: tuple[str, ...]
    oldest: tuple[int, int] = (0, 0)
    older: str = ""
    oldest_gains: tuple[int, int] | None = None
    renamed: tuple[tuple[tuple[int, int], Mapping[str, str]], ...] = ()

    def wrote(self, system: str) -> bool:
        """Tell whether a log is of this autopilot, by what it says wrote it; one that says nothing may be."""
        return not system or system.split()[0] in self.systems

    def too_old(self, system: str) -> bool:
        """Tell whether gains of a log count otherwise."""
        version = version_of(system)
        return version is not None and version < self.oldest

    def gains_differ(self, system: str) -> bool:
        """Tell whether gains of the rate of a log count otherwise."""
        version, oldest = version_of(system), self.oldest_gains or self.oldest
        return version is not None and version < oldest

    def of(self, system: str) -> str:
        """Name the version that a file is for: that of a log where it states one."""
        return system if system and version_of(system) is not None else self.title

    def names(self, system: str) -> Mapping[str, str]:
        """Give the names of a log's version where they are others."""
        version, names = version_of(system), dict[str, str]()
        for before, others in self.renamed:
            if version is not None and version < before:
                names |= others
        return names


def version_of(system: str) -> tuple[int, int] | None:
    """Read the version out of what wrote a log, such as ``Betaflight 4.5.1 (77d01ba3b)``; None where it has none."""
    found = re.search(r"(?:^|[\sV])(\d+)\.(\d+)", system)
    return (int(found[1]), int(found[2])) if found else None


@dataclass(frozen=True)
class Autopilot:
    """An autopilot: what is fixed in its law, and its parameters.

    Attributes
    ----------
    name, title : str
    firmware : Firmware
    rate_hz : float
        Steps in a second, where no parameter says otherwise.
    mixer : MixerRule
    parameters : tuple of Parameter
    fixed : mapping of str to float
        Quantities of the law that are no parameters, by role.
    logged_as : mapping of str to tuple of str
        Parameters that a line of a log's header holds, separated by commas; an empty name is left out, and of two
        names both have the value. Of two lines that hold one the later counts, unless it is 0.
    filtered : tuple of str
        First letters of the columns in which its logs hold the gyroscope behind the filters of the law.
    slope_of_error, integrates_first, holds_integral, series : bool
        As `AxisLaw`, `Law` and `ThrustCurve` have them.
    source : tuple of str
        Titles and addresses of its documentation: of the law, then of the ranges.
    left_out : tuple of str
        Parts of its law that are not here.
    cross : tuple of tuple of int
        Rotors of its X quadrotor in its order: 1 for front and left, -1 for the other side; spin, 1 turns
        counter-clockwise seen from above.
    """

    name: str
    title: str
    firmware: Firmware
    rate_hz: float
    mixer: MixerRule
    parameters: tuple[Parameter, ...]
    source: tuple[str, ...]
    left_out: tuple[str, ...]
    cross: tuple[tuple[int, int, int], ...]
    fixed: Mapping[str, float] = field(default_factory=dict)
    logged_as: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    filtered: tuple[str, ...] = ()
    slope_of_error: bool = False
    integrates_first: bool = True
    holds_integral: bool = True
    series: bool = False

    def by_role(self, role: str) -> Parameter | None:
        """Give the parameter of a role; None where it has none."""
        return next((each for each in self.parameters if each.role == role), None)

    def named(self, name: str) -> Parameter:
        """Give a parameter by its name; InputError if the law has no such parameter."""
        for each in self.parameters:
            if each.name == name:
                return each
        near = get_close_matches(name, [each.name for each in self.parameters], 1)
        hint = f"; did you mean {near[0]}?" if near else ""
        raise InputError(f"{name}: the control law of {self.title} has no such parameter{hint}")

    def defaults(self) -> dict[str, float]:
        """Give all parameters at their defaults."""
        return {each.name: each.default for each in self.parameters}

    def in_log(self, logged: Mapping[str, float | str]) -> dict[str, float]:
        """Take the parameters of the law out of what a log knows; empty where it holds no gain of a rate."""
        found = {each.name: logged[each.name] for each in self.parameters if each.name in logged}
        for line in (each for each in self.logged_as if each in logged):
            for names, value in zip(self.logged_as[line], str(logged[line]).strip('"').split(","), strict=False):
                # What is 0 there is off where an earlier line says it too.
                found |= {name: value for name in names.split() if _number(value) or name not in found}
        gains = {each.name for each in self.parameters if each.role.endswith(".p")}
        return {name: _number(value) for name, value in found.items()} if gains & set(found) else {}

    def of_log(self, logged: Mapping[str, float]) -> dict[str, float]:
        """Give all parameters, where those of a log are known; what it lacks as before it existed, or at the default.

        Parameters
        ----------
        logged : mapping of str to float
            As `in_log` gives them.
        """
        return {
            each.name: logged.get(each.name, each.default if each.absent is None else each.absent)
            for each in self.parameters
        }

    def law(self, values: Mapping[str, float] | None = None) -> Law:
        """Make the control law of parameters.

        Parameters
        ----------
        values : mapping of str to float, or None
            By name; others at their defaults.

        Raises
        ------
        InputError
            If there is no such parameter.
        """
        given = self.defaults()
        for name, value in (values or {}).items():
            given[self.named(name).name] = float(value)
        roles = dict(self.fixed) | {each.role: each.scale * given[each.name] for each in self.parameters}
        axes = tuple(_axis(_of_axis(roles, axis), slope_of_error=self.slope_of_error) for axis in AXES)
        low, high = roles.get("motors.low", 0.0), roles.get("motors.high", 1.0)
        return Law(
            autopilot=self.name,
            rate_hz=self._rate(roles),
            axes=(axes[0], axes[1], axes[2]),
            curve=ThrustCurve(roles.get("motors.expo", 0.0), low, high, self.series),
            mixer=self.mixer,
            integrates_first=self.integrates_first,
            holds_integral=self.holds_integral,
        )

    def _rate(self, roles: Mapping[str, float]) -> float:
        """Give the steps in a second; a rate of 0 is one that no parameter limits."""
        period = roles.get("loop.period", 0.0) * roles.get("loop.every", 1.0)
        return roles.get("loop.rate", 0.0) or (1.0 / period if period > 0 else self.rate_hz)


def _number(text: float | str) -> float:
    try:
        return float(text)
    except ValueError:
        return 0.0


def _of_axis(roles: Mapping[str, float], axis: str) -> dict[str, float]:
    """Take the quantities of one axis; what is of this axis alone counts before what is of more."""
    found: dict[str, float] = {}
    for group in sorted(_GROUPS, key=lambda each: -len(_GROUPS[each])):
        if axis in _GROUPS[group]:
            found |= {role.partition(".")[2]: value for role, value in roles.items() if role.partition(".")[0] == group}
    return found


def _axis(found: Mapping[str, float], *, slope_of_error: bool) -> AxisLaw:
    whole = found.get("k", 1.0)
    integral = whole * found["i"]
    filters: dict[Stage, list[Filter]] = {}
    for stage, kind, name in _ORDER:
        if found.get(name, 0.0) > 0 and found.get(f"{name}_on", 1.0) > 0:
            own, count, higher = _KINDS[int(found.get(f"{name}_kind", 0))] if kind == "first" else (kind, 1, 1.0)
            filters.setdefault(stage, []).extend([Filter(own, higher * found[name], _width(found, name))] * count)
    angle_integral = found.get("angle_i", 0.0)
    # A limit of 0 is none.
    return AxisLaw(
        angle=found["angle"],
        angle_integral=angle_integral,
        angle_slope=found.get("angle_d", 0.0),
        angle_integral_limit=angle_integral * found.get("angle_integral_range", inf) if angle_integral else 0.0,
        p=whole * found["p"],
        i=integral,
        d=whole * found["d"],
        ff=found.get("ff", 0.0),
        integral_limit=min(found.get("integral_limit", inf), integral * found.get("integral_range", inf) or inf),
        limit=found.get("limit", 1.0),
        rate_limit=found.get("rate_limit", 0.0) or inf,
        slope_of_error=slope_of_error,
        **{stage: tuple(chosen) for stage, chosen in filters.items()},
    )


def _width(found: Mapping[str, float], name: str) -> float:
    """Give the width of a notch, by itself or by its lower end, Hz."""
    centre, lower = found.get(name, 0.0), found.get(f"{name}_lower", 0.0)
    if lower:
        return (centre**2 - lower**2) / lower if lower < centre else 0.5 * centre
    return found.get(f"{name}_width", 0.5 * centre)
