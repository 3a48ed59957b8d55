"""Gains from one log: relative to those that flew, over all plants that the log leaves possible."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from cpfls_cli.arrays import Array, Numbers
from cpfls_cli.autopilots.law import AXES, Law
from cpfls_cli.autopilots.parameters import Autopilot, Parameter
from cpfls_cli.autopilots.registry import AUTOPILOTS
from cpfls_cli.look.effectiveness import AxisPlant
from cpfls_cli.look.flight import LogFlight
from cpfls_cli.look.law import flown_feedback
from cpfls_cli.look.vibration import Change
from cpfls_cli.result import Estimate, about, part, result
from cpfls_cli.tuning.gains import USUAL_LEADS, AskedMargins, Tuned, floored, parameter_of, total_delay, tuned
from cpfls_cli.tuning.margins import axis_loops, crossing_margins, disk_of, frequencies, is_stable, moved_by
from cpfls_cli.tuning.plant import AxisPlant as LinearPlant
from cpfls_cli.tuning.plant import HoverPlant, Noise, noise_of

DRAWS = 40
"""Plants that are tuned one by one: the least and the largest of their gains are the ends of a 95 % interval."""
HOLDS = 0.95
"""Share of the plants with which proposed gains hold the asked margins."""
_HARDEST = 10
"""Of the plants that have to hold, so many of the hardest are tuned for together."""
ACCEPTABLE = AskedMargins(4.0, 30.0, 25.0)
"""Margins from which on a loop is usually accepted: what may have that of the disk, and flies, is not slowed down."""
_AT_ONCE = 1.25
"""Factor by which a gain changes at most from one log to the next."""
_TERMS = {"p": "P", "i": "I", "d": "D", "angle": "P of the angle"}
_SHORT = 0.9
"""Share of the asked disk margin, below which the best gains are none."""
_RAISED = "D in fast moves"
_FINE, _NEAR, _MOST_DB = 1e-6, 0.98, 99.0
_ANY, _ANY_SHARE = np.array([100.0, 0.02, 0.02, 1.0, 0.0]), 0.5
"""Numbers of plants, and of a hover, that nothing is computed of."""
_MOSTLY = 0.5
_NO_ANGLE = 1e-3
"""Gain of the angle, 1/s, that is none: the search takes a loop around the rate."""
_NOISE_STEP_HZ = 8.0
_STICK_MODES = {"px4": "Stabilized", "ardupilot": "Stabilize", "betaflight": "acro", "crazyflie": "attitude setpoints"}
"""Modes in which the stick is the setpoint of the attitude or of the rate: no position or height control moves it."""
_STICK_MOVES = {"roll": (0.4, 0.5, 4.0), "pitch": (0.4, 0.5, 4.0), "yaw": (0.6, 0.3, 2.0)}
"""Share of the full stick, and lowest and highest frequency, Hz, of moves that identify an axis."""
_STICK_S = 20.0
_LOWEST_NOISE_HZ = 40.0
"""Below, a spectrum holds more motion than noise; then noise is taken for white."""


@result
class AxisMargins:
    """What the loop about one axis bears, cut at the command, with all plants that the log leaves possible."""

    gain_db: Estimate = part()
    phase_deg: Estimate = part()
    disk_deg: Estimate = part()
    crossover_hz: Estimate = part()
    bandwidth_hz: Estimate = part()
    holds: float = about("share of the plants with which it has the asked margins")
    stable: float = about("share of the plants with which it is stable")


@result
class GainRow:
    """One parameter: what flew, and what is proposed."""

    parameter: str = about("as the version of the log names it")
    axis: str = about("roll, pitch or yaw")
    term: str = about("P, I, D, or P of the angle")
    unit: str = about("empty for a ratio")
    today: float = about("in the log")
    proposed: float = about("holds the asked margins with 95 % of the plants; today's where no change is sure")
    low: float = about("least of the best values over the plants; not finite where it goes with another", gaps=True)
    high: float = about("largest of the best values; not finite where noise or a range sets the value", gaps=True)
    direction: str = about("raise, lower or keep")
    why: str = about(
        "margins, noise, range, step: the way there in one log, with: it goes with another parameter of its axis, "
        "accepted: higher than the margins asked for, and kept, since it flew with enough; empty: not sure"
    )


@result
class AxisGains:
    """One axis with the gains that flew and with those that are proposed."""

    axis: str = about("roll, pitch or yaw")
    changed: bool = about("whether a change is sure")
    reason: str = about(
        "why nothing is proposed: weak, law (with the plant it would not fly), feedback (what flew is not as stated), "
        "margins (no gains keep them), band (the loop would cross above what is identified); empty where gains are "
        "proposed or kept"
    )
    fact: str = about("more about the reason")
    attitude: bool = about("whether the loop of the attitude is closed around that of the rate")
    before: AxisMargins | None = part(default=None)
    after: AxisMargins | None = part(default=None)


@result
class Manoeuvre:
    """Moves of one stick that make a log identify the vehicle about that axis."""

    axis: str = about("roll, pitch or yaw")
    mode: str = about("of the autopilot, in which the stick is the setpoint")
    amplitude: float = about("share of the full stick, to both sides")
    lowest: float = about("slowest moves, there and back, in a second", unit="Hz")
    highest: float = about("fastest moves", unit="Hz")
    seconds: float = about("that moves take, slow ones first", unit="s")


@result
class TunedGains:
    """Gains for the autopilot that wrote a log."""

    FORMAT: ClassVar[str] = "cpfls/look-gains"
    SHOWN = ("changes",)

    autopilot: str = about("px4, ardupilot, betaflight, crazyflie; empty where its law is not known")
    title: str = about("what it is called")
    version: str = about("that the parameters are for")
    reason: str = about("why there are no gains at all: autopilot, version, parameters; empty where there are")
    asked_gain: float = about("asked gain margin", unit="dB")
    asked_phase: float = about("asked phase margin", unit="deg")
    asked_disk: float = about("phase that the asked disk margin holds", unit="deg")
    required: float = about("phase that the disk holds that holds all three", unit="deg")
    rows: tuple[GainRow, ...] = part(default=())
    axes: tuple[AxisGains, ...] = part(default=())
    fly: tuple[Manoeuvre, ...] = part(default=())

    @property
    def changes(self) -> tuple[GainRow, ...]:
        """Rows that change."""
        return tuple(row for row in self.rows if row.direction != "keep")


@result
class LogGains(TunedGains):
    """Gains from a log alone, with the filters that its spectra ask for."""

    filters: tuple[Change, ...] = part(default=())


def tuned_gains(flight: LogFlight, plants: Sequence[AxisPlant], asked: AskedMargins | None = None) -> TunedGains:
    """Find the gains of all axes that a log identifies.

    Parameters
    ----------
    plants : sequence of AxisPlant
        About roll, pitch, yaw.
    """
    asked = AskedMargins() if asked is None else asked
    autopilot = AUTOPILOTS.get(flight.autopilot)
    known = {} if autopilot is None else autopilot.in_log(flight.parameters)
    reason = _unusable(autopilot, flight.system, known)
    axes: list[AxisGains] = []
    rows: list[GainRow] = []
    if autopilot is not None and not reason:
        work = _Work(autopilot, flight, plants, asked, autopilot.of_log(known))
        axes, rows = work.found()
    weak = [plant.axis for plant in plants if not plant.identified]
    return TunedGains(
        autopilot="" if autopilot is None else autopilot.name,
        title="" if autopilot is None else autopilot.title,
        version="" if autopilot is None else flight.system or autopilot.firmware.title,
        reason=reason,
        asked_gain=asked.gain_db,
        asked_phase=asked.phase_deg,
        asked_disk=asked.disk_deg,
        required=asked.required_deg,
        rows=tuple(rows),
        axes=tuple(axes),
        fly=tuple(_manoeuvres(flight.autopilot, weak)),
    )


def _manoeuvres(autopilot: str, axes: Sequence[str]) -> Iterator[Manoeuvre]:
    """Say which sticks to move about axes, by an autopilot whose modes are known."""
    for axis in axes if autopilot in _STICK_MODES else ():
        amplitude, low, high = _STICK_MOVES[axis]
        yield Manoeuvre(
            axis=axis, mode=_STICK_MODES[autopilot], amplitude=amplitude, lowest=low, highest=high, seconds=_STICK_S
        )


def _unusable(autopilot: Autopilot | None, system: str, known: Mapping[str, float]) -> str:
    """Say why a log has no gains that count as those of the law."""
    if autopilot is None or not autopilot.firmware.wrote(system):
        return "autopilot"
    if autopilot.firmware.gains_differ(system):
        return "version"
    return "" if known else "parameters"


@dataclass
class _Work:
    """What gains are found from."""

    autopilot: Autopilot
    flight: LogFlight
    plants: Sequence[AxisPlant]
    asked: AskedMargins
    values: Mapping[str, float]

    def __post_init__(self) -> None:
        flown = np.isfinite(self.flight.attitude_setpoint[self.flight.usable])
        self.attitude = flown.mean(axis=0) > _MOSTLY if len(flown) else np.zeros(len(AXES), dtype=bool)
        self.autopilot = _of_rates(self.autopilot, [AXES[axis] for axis in np.flatnonzero(~self.attitude)])
        # Without steps and ranges the best values are those of the plants.
        free = (
            replace(each, low=0.0, high=np.inf, step=_FINE * max(each.default, each.step))
            for each in self.autopilot.parameters
        )
        self.open = replace(self.autopilot, parameters=tuple(free))
        self.values = {each.name: self.values[each.name] for each in self.autopilot.parameters}
        self.law = self.open.law(self.values)
        self.names = self.autopilot.firmware.names(self.flight.system)
        self.axes = [axis for axis, plant in enumerate(self.plants) if plant.identified]
        self.noise = _noise(self.flight, self.autopilot, self.law)
        self.best = [_plant(_draws(plant)[0], self.law) for plant in self.plants]
        self.possible = [[_plant(draw, self.law) for draw in _draws(plant)] for plant in self.plants]
        self._frequency = frequencies(self.law)
        self._moved = [
            np.stack([moved_by(self.law, each, self._frequency) for each in plants]) for plants in self.possible
        ]
        self.refuted = [not self._keep_stable(axis) for axis in range(len(AXES))]

    def _keep_stable(self, axis: int) -> bool:
        """Drop the plants with which the loop that flew would be unstable; say where the one that was found is."""
        stable = self._held(axis, self.values) > 0
        if not stable[0] or stable.mean() < _MOSTLY:
            return False
        self.possible[axis] = [each for each, flies in zip(self.possible[axis], stable, strict=True) if flies]
        self._moved[axis] = self._moved[axis][stable]
        return True

    def found(self) -> tuple[list[AxisGains], list[GainRow]]:
        """Find what to change."""
        proposed, single = self._searched() if self.axes else (None, [])
        rows: list[GainRow] = []
        reasons: dict[int, tuple[str, str]] = {}
        for axis, plant in enumerate(self.plants):
            if proposed is None or not plant.identified:
                reasons[axis] = ("weak", plant.reason)
            elif self.refuted[axis]:
                reasons[axis] = ("law", "")
            elif fact := self._other_feedback(axis):
                reasons[axis] = ("feedback", fact)
            elif proposed.disk[axis] < _SHORT * self.asked.disk:
                reasons[axis] = ("margins", f"{_degrees(proposed.disk[axis]):.3g}")
            elif (crosses := self._margins(axis, _with(self.values, proposed)).crossover_hz.value) > plant.band_hz[1]:
                reasons[axis] = ("band", f"{crosses:.3g}")
            else:
                rows += self._rows(axis, proposed, single)
        return [self._axis(axis, rows, *reasons.get(axis, ("", ""))) for axis in range(len(AXES))], rows

    def _other_feedback(self, axis: int) -> str:
        """Say how the feedback that flew differs from the stated one where the loop crosses; empty where it fits."""
        flown = flown_feedback(self.flight, axis, self.law)
        crosses = self._margins(axis, self.values).crossover_hz.value
        if flown is None or flown.fits(crosses):
            return ""
        ratio, turned = flown.near(crosses) or (1.0, 0.0)
        return f"{ratio:.2g} times, turned by {np.degrees(turned):.0f} deg, at {crosses:.2g} Hz"

    def _searched(self) -> tuple[Tuned, list[Tuned]]:
        """Tune for the plants together that have to hold, and for each of some plants alone."""

        def of(
            autopilot: Autopilot,
            best: Sequence[LinearPlant],
            drawn: Sequence[tuple[LinearPlant, ...]],
            leads: Mapping[int, tuple[float, ...]],
        ) -> Tuned:
            hover = HoverPlant((best[0], best[1], best[2]), _ANY_SHARE, _ANY_SHARE, drawn=tuple(drawn))
            return tuned(autopilot, self.values, hover, self.asked, self.noise, leads=leads)

        middle = of(self.open, self.best, [], {axis: USUAL_LEADS[axis] for axis in self.axes})
        values = _with(self.values, middle)
        law = self.open.law(values)
        # All plants get derivatives in one proportion, else gains of neighbours jump from one to the next.
        leads = {
            axis: (law.axes[axis].d / max(law.axes[axis].p, _FINE) / total_delay(law, self.best[axis]),)
            for axis in self.axes
        }
        hardest = [self._hardest(axis, values) for axis in range(len(AXES))]
        single = [of(self.open, [each[draw % len(each)] for each in self.possible], [], leads) for draw in range(DRAWS)]
        return of(self.autopilot, self.best, hardest, leads), single

    def _hardest(self, axis: int, values: Mapping[str, float]) -> tuple[LinearPlant, ...]:
        """Take the hardest of the plants with which gains have to hold: of all but 5 %."""
        plants = self.possible[axis]
        order = np.argsort(self._held(axis, values), kind="stable")
        spared = int((1 - HOLDS) * len(plants))
        return tuple(plants[place] for place in order[spared : spared + _HARDEST])

    def _cut(self, axis: int, values: Mapping[str, float]) -> Numbers:
        """Give the loops that are closed in flight, shape (loop, plant, frequency), that of the command first."""
        loops = axis_loops(self.open.law(values), axis, self._moved[axis], self._frequency)
        return np.stack([loops.command, loops.rate, loops.angle] if self.attitude[axis] else [loops.rate])

    def _held(self, axis: int, values: Mapping[str, float]) -> Array:
        """Give the disk margin with each plant, 0 where it is unstable."""
        cut = self._cut(axis, values)
        return np.asarray(np.where(is_stable(self._frequency, cut), disk_of(cut), 0.0).min(axis=0))

    def _margins(self, axis: int, values: Mapping[str, float]) -> AxisMargins:
        cut, held, law = self._cut(axis, values), self._held(axis, values), self.open.law(values)
        gain, phase, crossover = crossing_margins(self._frequency, cut[0])
        rate = cut[0] if len(cut) == 1 else cut[1]
        follows = np.abs(self._moved[axis] * law.response(axis, self._frequency).forward / (1 + rate)) >= 0.5**0.5
        return AxisMargins(
            gain_db=_estimate(np.where(held > 0, np.minimum(gain, _MOST_DB), 0.0)),
            phase_deg=_estimate(np.where(held > 0, phase, 0.0)),
            disk_deg=_estimate(_degrees(held)),
            crossover_hz=_estimate(crossover),
            bandwidth_hz=_estimate(self._frequency[np.where(follows.all(axis=1), -1, np.argmin(follows, axis=1))]),
            holds=float((held >= _NEAR * self.asked.disk).mean()),
            stable=float((held > 0).mean()),
        )

    def _axis(self, axis: int, rows: Sequence[GainRow], reason: str, fact: str) -> AxisGains:
        identified = axis in self.axes
        new = {
            name: row.proposed for row in rows for name in self.values if self.names.get(name, name) == row.parameter
        }
        return AxisGains(
            axis=AXES[axis],
            changed=any(row.axis == AXES[axis] and row.direction != "keep" for row in rows),
            reason=reason,
            fact=fact,
            attitude=bool(self.attitude[axis]),
            # Of another law than the one that flew, margins say nothing.
            before=self._margins(axis, self.values) if identified and reason not in ("law", "feedback") else None,
            after=self._margins(axis, {**self.values, **new}) if identified and not reason else None,
        )

    def _rows(self, axis: int, proposed: Tuned, single: Sequence[Tuned]) -> list[GainRow]:
        """Compare the best values of an axis with today's: a change is sure where no plant wants today's."""
        quiet = proposed.quieter[axis] or np.mean([each.quieter[axis] for each in single]) > 1 - HOLDS
        factor = parameter_of(self.autopilot, axis, "k")
        rows: list[GainRow] = []
        values: list[float] = []
        for term, name in _TERMS.items():
            parameter = parameter_of(self.autopilot, axis, term)
            if parameter is None or (term == "angle" and not self._angled(axis, parameter)):
                continue
            # The search has 1 for the factor on P, I and D, which stays as it is.
            whole = 1.0 if factor is None or term == "angle" else self.values[factor.name]
            best = np.array([_value(each, parameter) for each in single]) / whole
            today, value = self.values[parameter.name], floored(parameter, _value(proposed, parameter) / whole).value
            at_end = value >= parameter.high
            low = min(float(best.min()), value)
            high = np.inf if quiet or at_end else max(float(best.max()), value)
            change = value - today if today < low or today > high else 0.0
            rows.append(
                GainRow(
                    parameter=self.names.get(parameter.name, parameter.name),
                    axis=AXES[axis],
                    term=name,
                    unit=parameter.unit,
                    today=today,
                    proposed=value if change else today,
                    low=low,
                    high=high,
                    direction=_direction(change),
                    why="" if not change else "noise" if quiet else "range" if at_end else "margins",
                )
            )
            values.append(value)
        rows = self._at_once(axis, self._together(axis, self._acceptable(axis, rows), values))
        return [*rows, *self._raised(axis, rows)]

    def _acceptable(self, axis: int, rows: list[GainRow]) -> list[GainRow]:
        """Keep gains that are higher than asked margins allow unless the loop surely has too little to be accepted."""
        if float(np.quantile(self._held(axis, self.values), HOLDS)) < 2 * np.tan(np.radians(ACCEPTABLE.disk_deg) / 2):
            return rows
        return [
            replace(row, proposed=row.today, direction="keep", why="accepted") if row.direction == "lower" else row
            for row in rows
        ]

    def _at_once(self, axis: int, rows: list[GainRow]) -> list[GainRow]:
        """Go no further than one log bears: law and vehicle are known around what flew."""
        capped = []
        for row in rows:
            parameter = next(
                each for each in self.autopilot.parameters if self.names.get(each.name, each.name) == row.parameter
            )
            most = row.today * _AT_ONCE if row.proposed > row.today else row.today / _AT_ONCE
            beyond = row.today > 0 and (row.proposed - most) * (row.proposed - row.today) > 0
            value = floored(parameter, most + (parameter.step if most < row.today else 0.0)).value
            capped.append(
                replace(row, proposed=value, direction=_direction(value - row.today), why="step") if beyond else row
            )
        names = {self.names.get(name, name): name for name in self.values}
        new = {names[row.parameter]: row.proposed for row in capped}
        # On the way no margin may be lost that what flew has.
        before, after = (
            float(np.quantile(self._held(axis, values), 1 - HOLDS)) for values in (self.values, {**self.values, **new})
        )
        if after >= _NEAR * min(before, self.asked.disk):
            return capped
        return [replace(row, proposed=row.today, direction="keep", why="") for row in rows]

    def _raised(self, axis: int, rows: Sequence[GainRow]) -> Iterator[GainRow]:
        """Move the derivative of fast moves in proportion to that of calm flight."""
        parameter = parameter_of(self.autopilot, axis, "d_raised")
        calm = next((row for row in rows if row.term == _TERMS["d"]), None)
        if parameter is None or calm is None or calm.direction == "keep" or not self.values[parameter.name] > 0:
            return
        name, today = self.names.get(parameter.name, parameter.name), self.values[parameter.name]
        if name:
            value = floored(parameter, today * calm.proposed / calm.today if calm.today else calm.proposed).value
            yield replace(
                calm, parameter=name, term=_RAISED, today=today, proposed=value, low=np.nan, high=np.nan, why="with",
                direction=_direction(value - today),
            )  # fmt: skip

    def _angled(self, axis: int, parameter: Parameter) -> bool:
        """Tell whether the gain of the angle is to be tuned with an axis: one of both tilts with the last of them."""
        own = parameter.role.startswith(AXES[axis]) or axis == max(each for each in self.axes if each < 2 or axis == 2)
        return own and bool(self.attitude[axis])

    def _together(self, axis: int, rows: list[GainRow], values: Sequence[float]) -> list[GainRow]:
        """Move what is not sure with what is, where what is sure alone would take margin away."""
        if all(row.direction == "keep" for row in rows):
            return rows
        names = {self.names.get(name, name): name for name in self.values}

        def least(chosen: Sequence[float]) -> float:
            new = {names[row.parameter]: value for row, value in zip(rows, chosen, strict=True)}
            return float(np.quantile(self._held(axis, {**self.values, **new}), 1 - HOLDS))

        if least([row.proposed for row in rows]) >= _NEAR * min(least([row.today for row in rows]), self.asked.disk):
            return rows
        return [
            row
            if row.direction != "keep" or value == row.today
            else replace(row, proposed=value, direction=_direction(value - row.today), why="with")
            for row, value in zip(rows, values, strict=True)
        ]


def _direction(change: float) -> str:
    return "raise" if change > 0 else "lower" if change < 0 else "keep"


def _degrees(disk: Array | float) -> Array:
    return np.asarray(np.degrees(2 * np.arctan(np.asarray(disk) / 2)))


def _estimate(drawn: Array) -> Estimate:
    """Give the value of the plant that was found, which is the first, with the interval over all."""
    low, high = np.quantile(drawn, [0.025, 0.975], method="nearest")
    return Estimate(value=float(drawn[0]), low=float(min(low, drawn[0])), high=float(max(high, drawn[0])))


def _draws(plant: AxisPlant) -> Array:
    """Give the numbers of the plant that was found, then of those that are possible; any where it is not identified."""
    return np.concatenate([plant.parameters[None], plant.draws]) if plant.identified else np.array([_ANY, _ANY])


def _plant(numbers: Array, law: Law) -> LinearPlant:
    """Make a plant that a step of the law and its hold come on top of: logs have both in the delay."""
    gain, delay, lag, damping, lead = (float(each) for each in numbers)
    return LinearPlant(gain, gain * lead, 0.0, 1.0, damping, lag, delay - 1.5 * law.period)


def _of_rates(autopilot: Autopilot, axes: Sequence[str]) -> Autopilot:
    """Open the loop of the angle about axes that fly rates."""
    groups = [
        *axes,
        *(["tilt"] if {"roll", "pitch"} <= set(axes) else []),
        *(["all"] if len(axes) == len(AXES) else []),
    ]
    dropped = {f"{group}.{role}" for group in groups for role in ("angle", "angle_i", "angle_d")}
    closed = {f"{axis}.angle": _NO_ANGLE for axis in axes}
    kept = tuple(each for each in autopilot.parameters if each.role not in dropped)
    return replace(autopilot, parameters=kept, fixed={**autopilot.fixed, **closed})


def _with(values: Mapping[str, float], found: Tuned) -> dict[str, float]:
    return {**values, **{each.parameter.name: each.value for each in found.proposals}}


def _value(found: Tuned, parameter: Parameter) -> float:
    return next(each.value for each in found.proposals if each.parameter.name == parameter.name)


def _noise(flight: LogFlight, autopilot: Autopilot, law: Law) -> Noise | None:
    """Estimate the noise of the gyroscope before filters, flat above what the log shows: no derivative hides there."""
    raw = flight.gyroscope_unfiltered
    samples = flight.gyroscope if raw is None else raw
    flown = np.interp(samples.time, flight.time, flight.usable.astype(float)) > 1 - _FINE
    noise = noise_of([(samples.time[flown], samples.values[flown])])
    if noise is None or noise.highest_hz < _LOWEST_NOISE_HZ:
        return None
    if raw is None and samples.source.startswith(autopilot.filtered):
        noise = noise.before_filters(law)
    level = np.median(noise.density[noise.frequency > 0.5 * noise.highest_hz], axis=0)
    step = _NOISE_STEP_HZ
    frequency = np.arange(step, 0.5 * law.rate_hz, step)
    mean = np.stack([_binned(noise.frequency, each, frequency, step) for each in noise.density.T], axis=1)
    return Noise(frequency=frequency, density=np.where(np.isfinite(mean), mean, level))


def _binned(frequency: Array, values: Array, middle: Array, width: float) -> Array:
    """Average values around frequencies; NaN where there is none."""
    place = np.round(frequency / width).astype(int) - 1
    inside = (place >= 0) & (place < len(middle))
    counts = np.bincount(place[inside], minlength=len(middle))
    total = np.bincount(place[inside], values[inside], minlength=len(middle))
    return np.asarray(np.where(counts > 0, total / np.maximum(counts, 1), np.nan))
