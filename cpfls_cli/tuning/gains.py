"""Gains by the margins that are asked for, in an autopilot's own parameters, over all vehicles that flights allow.

Along go the thrust curve, the hover thrust, and notches at the lines that the gyroscope's noise shows.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import floor
from typing import ClassVar

import numpy as np

from cpfls_cli.arrays import Numbers
from cpfls_cli.autopilots.law import AXES, AxisLaw, Law
from cpfls_cli.autopilots.motors import straightening
from cpfls_cli.autopilots.parameters import Autopilot, Parameter
from cpfls_cli.effects.scales import hover_speed
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.result import about, part, result
from cpfls_cli.tuning.margins import Evaluation, axis_loops, disk_of, evaluate, frequencies, is_stable, moved_by
from cpfls_cli.tuning.plant import AxisPlant, HoverPlant, Line, Noise, Spread, hover_plant, on_less
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.words import joined

_BELOW_CROSSOVER = 5.0
"""The integral takes over so much below what the rate follows: it costs about 11 degrees of phase there."""
_ANGLE_BELOW = 3.0
"""While the rate is tuned the angle is as much slower; then it gets what is left."""
_ANGLE_INTEGRAL_BELOW = 10.0
"""The integral of the angle takes over so much below what the angle follows at least: else each step is passed."""
_LEADS = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)
USUAL_LEADS = {0: _LEADS, 1: _LEADS, 2: _LEADS[:1]}
"""Derivative over proportional gain that is tried about each axis, in lags and delays of the loop.

Yaw by reaction torque is slow and noisy; its derivative stays 0, as all autopilots have it.
"""
_WORTH = 1.03
"""A longer lead has to be worth this: it brings noise."""
_OVERSHOOT = 1.1
"""Largest gain from asked angle to angle: a step is passed by about as much less 1."""
_ROUNDS = 24
_LOUDER = 2.0
"""Jitter of the commands over that of the gains before: those are known to fly, and what motors bear is not."""
_NEAR = 0.99
_NOISE_HZ, _NOISE_POINTS = 10.0, 100
_YAW_ALONE = ("yaw.error.first", "yaw.output.first")
_RAISED = 3


@dataclass(frozen=True)
class AskedMargins:
    """Margins that gains have to have, over all vehicles that flights leave possible."""

    gain_db: float = about("of gain alone", unit="dB", default=6.0)
    phase_deg: float = about("of phase alone", unit="deg", default=45.0)
    disk_deg: float = about("phase that the disk of both together holds", unit="deg", default=35.0)

    @property
    def disk(self) -> float:
        """The disk margin that holds all three."""
        factor = 10 ** (self.gain_db / 20)
        of_phase = 2 * np.tan(np.radians(max(self.phase_deg, self.disk_deg)) / 2)
        return float(max(2 * (factor - 1) / (factor + 1), of_phase))

    @property
    def required_deg(self) -> float:
        """The phase that this disk holds, degrees."""
        return float(np.degrees(2 * np.arctan(self.disk / 2)))


@dataclass(frozen=True)
class Proposal:
    """A parameter with the value proposed, in its range and multiples of its step, and the one wanted before."""

    parameter: Parameter
    value: float
    wanted: float

    @property
    def clipped(self) -> bool:
        """Whether the documented range does not hold what the margins allow."""
        slack = 1.01 * self.parameter.step
        return not self.parameter.low - slack <= self.wanted <= self.parameter.high + slack


@dataclass(frozen=True)
class Tuned:
    """Gains that were found.

    Attributes
    ----------
    proposals : list of Proposal
    disk : tuple of float
        The least disk margin about each axis with all plants, as far as it is asked for.
    quieter : tuple of bool
        Whether noise holds an axis back.
    """

    proposals: list[Proposal]
    disk: tuple[float, float, float]
    quieter: tuple[bool, bool, bool]


def tuned(
    autopilot: Autopilot,
    values: Mapping[str, float],
    hover: HoverPlant,
    asked: AskedMargins,
    noise: Noise | None = None,
    before: Mapping[str, float] | None = None,
    leads: Mapping[int, tuple[float, ...]] | None = None,
) -> Tuned:
    """Find the gains of all axes.

    For each axis: the rate that follows fastest with a disk margin as asked with every plant that is possible, the
    integral at a fifth of that speed, the derivative as long as it is worth it; then the highest gain from angle to
    rate with that margin and little overshoot. Commands jitter at most twice as much as with the gains before, by the
    noise of the gyroscope.

    Parameters
    ----------
    values : mapping of str to float
        All parameters, by name: filters and limits as they will be, gains as they are.
    noise : Noise or None
        None for white noise.
    before : mapping of str to float or None
        All parameters as they fly today, whose jitter counts; None: `values`.
    leads : mapping of int to tuple of float, or None
        Axes that are tuned, each with the derivatives over proportional gain that are tried, in lags and delays of the
        loop; None: all axes with the usual ones.
    """
    today = autopilot.law(values if before is None else before)
    whole = dict(values) | {each.name: 1.0 for each in autopilot.parameters if each.role.endswith(".k")}
    law = autopilot.law(whole)
    wanted: dict[str, list[float]] = {}
    least, quieter = [asked.disk] * len(AXES), [False] * len(AXES)
    for axis, tried in (USUAL_LEADS if leads is None else leads).items():
        loudest = _LOUDER * _jitter(today, axis, noise)
        search = _Search(law, axis, hover.corners(axis), asked.disk, noise, loudest, tried)
        found, least[axis] = search.found(autopilot)
        quieter[axis] = _jitter(_with(law, axis, found), axis, noise) > _NEAR * search.loudest
        roles = {"p": found.p, "i": found.i, "d": found.d, "k": 1.0, "d_raised": found.d}
        roles |= {"angle": found.angle, "angle_i": found.angle_integral}
        for role, value in roles.items():
            parameter = parameter_of(autopilot, axis, role)
            if parameter is not None:
                wanted.setdefault(parameter.name, []).append(value / parameter.scale)
    # A parameter of several axes suits the one that bears the least.
    proposals = [floored(autopilot.named(name), min(each)) for name, each in wanted.items()]
    return Tuned(proposals, (least[0], least[1], least[2]), (quieter[0], quieter[1], quieter[2]))


def with_filters(
    autopilot: Autopilot,
    values: Mapping[str, float],
    hover: HoverPlant,
    asked: AskedMargins,
    noise: Noise | None = None,
) -> Tuned:
    """Find gains as `tuned`, and raise the low-passes of yaw alone where it lacks margin or gets slower for them.

    Some come with cut-offs that suit heavy vehicles, and no gain makes up for what they are late.
    """
    raised: dict[str, Proposal] = {}
    found = tuned(autopilot, values, hover, asked, noise)
    for _ in range(_RAISED):
        late = [each for role in _YAW_ALONE if (each := autopilot.by_role(role)) is not None]
        slow = [each for each in late if 0 < _valued(values, raised, each) < each.high]
        holds, turns = found.disk[2] >= _NEAR * asked.disk, _yaw_angle(autopilot, found)
        if not slow or (holds and turns >= _yaw_angle(autopilot, values)):
            break
        more = raised | {
            each.name: proposal_of(each, min(2 * _valued(values, raised, each), each.high)) for each in slow
        }
        own = {**values, **{name: each.value for name, each in more.items()}}
        faster = tuned(autopilot, own, hover, asked, noise, values)
        if holds and _yaw_angle(autopilot, faster) <= turns:
            break
        found, raised = faster, more
    return replace(found, proposals=[*found.proposals, *raised.values()])


def _yaw_angle(autopilot: Autopilot, given: Tuned | Mapping[str, float]) -> float:
    """Give how much rate an error of the yaw angle asks for, in the parameter's unit."""
    angle = parameter_of(autopilot, 2, "angle")
    if angle is None:
        return 0.0
    values = {each.parameter.name: each.value for each in given.proposals} if isinstance(given, Tuned) else given
    return values[angle.name]


def _valued(values: Mapping[str, float], raised: Mapping[str, Proposal], parameter: Parameter) -> float:
    return raised[parameter.name].value if parameter.name in raised else values[parameter.name]


def _jitter(law: Law, axis: int, noise: Noise | None) -> float:
    """Give how much noise makes the command jitter, by a spectrum or, in any unit, by white noise."""
    if noise is not None:
        return noise.of_command(law, axis)
    frequency = np.linspace(_NOISE_HZ, 0.49 * law.rate_hz, _NOISE_POINTS)
    return float(np.sqrt(np.mean(np.abs(law.response(axis, frequency).feedback) ** 2)))


def parameter_of(autopilot: Autopilot, axis: int, role: str) -> Parameter | None:
    """Find the parameter of an axis, or the one that several share."""
    groups = (AXES[axis], "tilt", "all") if axis < 2 else (AXES[axis], "all")
    return next((found for group in groups if (found := autopilot.by_role(f"{group}.{role}")) is not None), None)


def floored(parameter: Parameter, wanted: float) -> Proposal:
    """Propose the next value below one that is wanted, inside the documented range."""
    return proposal_of(parameter, wanted, lambda steps: floor(steps + 1e-9))


def proposal_of(parameter: Parameter, wanted: float, whole: Callable[[float], int] = round) -> Proposal:
    """Propose the nearest value to one that is wanted, inside the documented range."""
    value = min(max(whole(wanted / parameter.step) * parameter.step, parameter.low), parameter.high)
    return Proposal(parameter, float(f"{value:.9g}"), wanted)


def _with(law: Law, axis: int, own: AxisLaw) -> Law:
    axes = [*law.axes]
    axes[axis] = own
    return replace(law, axes=(axes[0], axes[1], axes[2]))


def _follows(p: float, d: float, plant: AxisPlant) -> float:
    """Give about how fast the rate follows what is asked, rad/s: the derivative acts as more inertia."""
    return p * _torque(plant) / (1 + d * _torque(plant))


def total_delay(law: Law, plant: AxisPlant) -> float:
    """Give lags and delays between command and rate, s."""
    return plant.lag + plant.delay + 1.5 * law.period


def _torque(plant: AxisPlant) -> float:
    """Give the angular acceleration of a full command in the end, rad/s^2."""
    return plant.gain + plant.slow


@dataclass(frozen=True)
class _Search:
    """The search for the gains of one axis, by a law with filters, limits and gains as they are.

    As factor on all of these gains 1; `loudest`: most jitter of the command.
    """

    law: Law
    axis: int
    plants: list[AxisPlant]
    disk: float
    noise: Noise | None
    loudest: float
    leads: tuple[float, ...]

    def found(self, autopilot: Autopilot) -> tuple[AxisLaw, float]:
        """Find the gains, and the disk margin that they hold inside the documented ranges, as far as it is asked."""
        angle = parameter_of(autopilot, self.axis, "angle")
        # What no parameter sets stays as the law has it.
        rate = self._inside(autopilot, self._rate(None if angle is not None else self._own.angle))
        if angle is None:
            return rate, self._held(rate)
        wanted = self._angled(rate, self._angle(rate))
        proposal = floored(angle, wanted.angle / angle.scale)
        if proposal.value <= proposal.wanted:
            return wanted, self._held(wanted)
        # The range asks for more than the rate bears: then the rate has to suit it.
        least = angle.scale * proposal.value
        rate = self._inside(autopilot, self._rate(least))
        return replace(rate, angle=wanted.angle), self._held(self._angled(rate, least))

    @property
    def _own(self) -> AxisLaw:
        return self.law.axes[self.axis]

    def _inside(self, autopilot: Autopilot, rate: AxisLaw) -> AxisLaw:
        """Bring gains of the rate inside the documented ranges, through which the angle is controlled."""
        kept = {"p": rate.p, "i": rate.i, "d": rate.d}
        for role, value in kept.items():
            parameter = parameter_of(autopilot, self.axis, role)
            if parameter is not None:
                kept[role] = parameter.scale * floored(parameter, value / parameter.scale).value
        return replace(rate, p=kept["p"], i=kept["i"], d=kept["d"])

    def _rate(self, angle: float | None) -> AxisLaw:
        """Find the gains of the rate with a given gain of the angle, or with one that suits them."""
        found = self.plants[0]
        late = total_delay(self.law, found)
        best: AxisLaw | None = None
        for lead in self.leads:

            def own(gain: float, lead: float = lead) -> AxisLaw:
                slope = gain * lead * late
                fast = _follows(gain, slope, found)
                whole = replace(self._own, p=gain, i=gain * fast / _BELOW_CROSSOVER, d=slope)
                return self._angled(whole, fast / _ANGLE_BELOW if angle is None else angle)

            def held(gain: float, own: Callable[[float], AxisLaw] = own) -> float:
                return self._held(own(gain))

            scale = late * _torque(found)
            tried = own(_largest(held, self.disk, 1e-3 / scale, 10.0 / scale))
            if best is None or _follows(tried.p, tried.d, found) > _WORTH * _follows(best.p, best.d, found):
                best = tried
        assert best is not None, "some lead is tried"
        return best

    def _angle(self, rate: AxisLaw) -> float:
        return _largest(lambda gain: self._held(self._angled(rate, gain)), self.disk, 0.05, 50.0)

    def _angled(self, rate: AxisLaw, gain: float) -> AxisLaw:
        """Give the angle a gain, with its integral in the same proportion as before unless the angle is slow."""
        ratio = self._own.angle_integral / self._own.angle if self._own.angle else 0.0
        return replace(rate, angle=gain, angle_integral=min(ratio, gain / _ANGLE_INTEGRAL_BELOW) * gain)

    def _held(self, own: AxisLaw) -> float:
        """Give the least disk margin of all loops with all plants, as far as asked; less at overshoot and jitter."""
        law = _with(self.law, self.axis, own)
        loops = axis_loops(law, self.axis, self._moved, frequencies(law))
        passed = max(float(np.abs(loops.angle_closed).max()) / _OVERSHOOT, 1.0)
        cut = np.stack([loops.rate, loops.command, loops.angle])
        if not is_stable(loops.frequency, cut).all():
            return 0.0
        loud = _jitter(law, self.axis, self.noise) / self.loudest if self.loudest else 0.0
        return min(float(disk_of(cut).min()), self.disk) / max(passed, loud, 1.0)

    @cached_property
    def _moved(self) -> Numbers:
        frequency = frequencies(self.law)
        return np.stack([moved_by(self.law, each, frequency) for each in self.plants])


def _largest(held: Callable[[float], float], disk: float, low: float, high: float) -> float:
    """Find the largest gain that holds a margin, on a logarithmic scale; where none does the one that holds most."""
    steps = np.geomspace(low, high, _ROUNDS)
    margins: list[float] = []
    # From the largest down: what holds below the first that does is not asked for.
    for step in steps[::-1]:
        margins.append(held(step))
        if margins[-1] >= disk:
            break
    else:
        return float(steps[np.argmax(margins[::-1])])
    below = float(step)
    above = below * float(steps[1] / steps[0])
    for _ in range(8):
        middle = float(np.sqrt(below * above))
        below, above = (middle, above) if held(middle) >= disk else (below, middle)
    return below


PROPOSED, TODAY, DEFAULT = "proposed", "today", "default"
_NEAR_DEG = 0.5
"""Margins are met within this: gains are written with few digits."""
_STAYS = {"on": 1.0, "harmonics": 1.0, "mode": 0.0, "follows": 0.0}
"""What makes a notch of an autopilot one that stays at its centre."""
_OFF = 0.2
"""Hover thrust of a log that is further from the model's says that the largest rotor speed is another."""


@result
class ParameterRow:
    """A parameter of an autopilot with the value that is proposed, in its own unit."""

    meaning: str = about("what it is")
    unit: str = about("empty for a ratio")
    today: float = about("in the log; not finite where none holds it", gaps=True)
    default: float = about("of the autopilot")
    proposed: float = about("inside the documented range")
    wanted: float = about("by the margins, before it is brought inside that range")
    low: float = about("lower end of the documented range")
    high: float = about("upper end; not finite where none is documented", gaps=True)
    clipped: bool = about("whether the documented range limits it")

    @classmethod
    def of(cls, own: Parameter, today: float, proposed: float, wanted: float, *, clipped: bool = False) -> ParameterRow:
        """Propose a value of a parameter."""
        return cls(
            meaning=own.meaning,
            unit=own.unit,
            today=today,
            default=own.default,
            proposed=proposed,
            wanted=wanted,
            low=own.low,
            high=own.high if np.isfinite(own.high) else np.nan,
            clipped=clipped,
        )


@result
class Gains:
    """Gains for an autopilot, with their margins with the vehicle, and those of today's gains or of the defaults."""

    FORMAT: ClassVar[str] = "cpfls/gains"
    SHOWN = ("disk_required_deg", "falls_short")

    autopilot: str = about("px4, ardupilot, betaflight, crazyflie")
    title: str = about("what it is called")
    firmware: str = about("version that the parameters are for: that of the log, or the one whose ranges are known")
    vehicle: str = about("file of the vehicle")
    source: tuple[str, ...] = about("documentation of the law, then of the ranges", "source")
    left_out: tuple[str, ...] = about("parts of the law that are not modelled", "part")
    asked: AskedMargins = part()
    hover_thrust: float = about("share of the full thrust that hovers, in the units of the law")
    hover_signal: float = about("of the motors in hover, from 0 to 1")
    parameters: Mapping[str, ParameterRow] = part()
    sets: Mapping[str, Evaluation] = part()
    noise: Noise | None = part(default=None)
    warnings: tuple[str, ...] = about("what to know about these gains", "warning")

    @property
    def disk_required_deg(self) -> float:
        """The phase of the disk margin that holds all asked margins."""
        return self.asked.required_deg

    @property
    def before(self) -> str:
        """The other set: today, of the log, or default."""
        return next(name for name in self.sets if name != PROPOSED)

    @property
    def falls_short(self) -> dict[str, tuple[str, ...]]:
        """The axes of each set whose margins are not as asked with every possible plant, or that are unstable."""
        least = self.disk_required_deg - _NEAR_DEG
        return {
            name: tuple(axis for axis, each in zip(AXES, own.axes, strict=True) if each.disk_deg < least)
            for name, own in self.sets.items()
        }


def gains_for_vehicle(
    autopilot: Autopilot,
    model: VehicleModel,
    spreads: tuple[Spread, ...],
    *,
    vehicle: str,
    rotor_lag: float,
    signals: bool,
    drained: float = 1.0,
    today: Mapping[str, float] | None = None,
    system: str = "",
    noise: Noise | None = None,
    asked: AskedMargins | None = None,
) -> Gains:
    """Find gains for a vehicle, with the thrust curve and the notches that go with them.

    Parameters
    ----------
    spreads : tuple of Spread
        What flights leave open about each axis.
    vehicle : str
        Name of its file.
    rotor_lag : float, s
        Of speeds behind commands, where the model does not say.
    signals : bool
        Whether its commands are signals of motors, not speeds.
    drained : float
        Speed of a rotor by its command on the emptiest battery, over that on the fullest, which the model is of.
    today : mapping of str to float, or None
        Parameters of a log; None for the defaults.
    system : str
        What wrote that log.
    """
    asked, today = AskedMargins() if asked is None else asked, today or {}
    values = autopilot.of_log(today) if today else autopilot.defaults()

    def hover_of(whole: Mapping[str, float]) -> HoverPlant:
        law = autopilot.law(whole)
        hover = replace(hover_plant(law, model.vehicle, model, rotor_lag), spreads=spreads)
        return hover if drained == 1 else on_less(hover, drained, law, model, rotor_lag)

    others = [*_curve(autopilot, model)] if signals else []
    follows = noise is not None and bool(noise.lines) and _notch_follows(autopilot, today)
    if noise is not None and not follows:
        others += _notches(autopilot, noise.lines)
    whole = {**values, **{each.parameter.name: each.value for each in others}}
    hover = hover_of(whole)
    found = with_filters(autopilot, whole, hover, asked, noise)
    held = autopilot.by_role("motors.hover")
    proposals = [*found.proposals, *others, *([] if held is None else [proposal_of(held, hover.share)])]
    chosen = values | {each.parameter.name: each.value for each in proposals}
    names = autopilot.firmware.names(system)
    return Gains(
        autopilot=autopilot.name,
        title=autopilot.title,
        firmware=autopilot.firmware.of(system),
        vehicle=vehicle,
        source=autopilot.source,
        left_out=autopilot.left_out,
        asked=asked,
        hover_thrust=hover.share,
        hover_signal=hover.signal,
        parameters={
            names.get(each.parameter.name, each.parameter.name): ParameterRow.of(
                each.parameter, today.get(each.parameter.name, np.nan), each.value, each.wanted, clipped=each.clipped
            )
            for each in proposals
            if _exists(each, today)
        },
        sets={
            PROPOSED: evaluate(autopilot.law(chosen), hover, noise),
            TODAY if today else DEFAULT: evaluate(autopilot.law(values), hover_of(values), noise),
        },
        noise=noise,
        warnings=(
            *_mixer_warnings(autopilot, model.vehicle),
            *_hover_warnings(autopilot, today, hover, model.vehicle),
            *_of_noise(noise, found, follows=follows),
            *_lacking(autopilot, today, proposals),
            *_steps(autopilot, values, today),
        ),
    )


def _of_noise(noise: Noise | None, found: Tuned, *, follows: bool) -> Iterator[str]:
    """Say what noise does to the gains, and which line of it is left to a notch that follows the motors."""
    if follows and noise is not None:
        yield (
            f"a line at {noise.lines[0].hz:.3g} Hz is in the noise behind a notch that follows the motors; it is left "
            "as it is, and taken at its centre here"
        )
    if any(found.quieter):
        axes = joined([name for name, limited in zip(AXES, found.quieter, strict=True) if limited])
        why = "noise" if noise is not None else "noise, which no log shows"
        yield (
            f"{axes}: held back by {why}; commands jitter at most twice as much as with the gains before: load these, "
            "fly, and tune again with that log"
        )


def _curve(autopilot: Autopilot, model: VehicleModel) -> Iterator[Proposal]:
    """Propose the thrust curve, where flights show thrust by the signal of the motors."""
    parameter = autopilot.by_role("motors.expo")
    if parameter is None or not model.commanded:
        return
    share = sum(float(curve.coefficients[0]) for curve in model.thrust_curve)
    hover = hover_speed(model.vehicle) / model.vehicle.rotor_speed_max_rad_s
    wanted = straightening(autopilot.law().curve, share, hover, parameter.scale * parameter.high)
    yield proposal_of(parameter, wanted / parameter.scale)


def _notch_follows(autopilot: Autopilot, today: Mapping[str, float]) -> bool:
    """Tell whether the notch of a log follows the motors."""
    roles = ("notch_on", "notch_mode", "notch_follows")
    own = [autopilot.by_role(f"all.measured.{role}") for role in roles]
    return all(each is not None and today.get(each.name, 0.0) > 0 for each in own)


def _notches(autopilot: Autopilot, lines: Sequence[Line]) -> Iterator[Proposal]:
    """Propose a notch for each line of the noise that the autopilot has one for."""
    for name, line in zip(("notch", "notch2"), lines, strict=False):
        centre = autopilot.by_role(f"all.measured.{name}")
        if centre is None:
            return
        wanted = {f"{name}_{role}": value for role, value in _STAYS.items()}
        wanted |= {name: line.hz, f"{name}_width": line.width_hz, f"{name}_lower": line.hz - 0.5 * line.width_hz}
        for role, value in wanted.items():
            if (parameter := autopilot.by_role(f"all.measured.{role}")) is not None:
                yield proposal_of(parameter, value)


def _exists(proposal: Proposal, today: Mapping[str, float]) -> bool:
    """Tell whether to write a parameter: not one that the log lacks and that would stay as it is without it."""
    parameter = proposal.parameter
    return not today or parameter.name in today or proposal.value != parameter.absent


def _lacking(autopilot: Autopilot, today: Mapping[str, float], proposals: Sequence[Proposal]) -> Iterator[str]:
    """Say which parameters of the file the log does not hold."""
    # Behind a switch that is off a log leaves all out.
    switched = any(each.name in today for each in autopilot.parameters if each.role.endswith("_on"))
    missing = [
        each.parameter.name
        for each in proposals
        if today
        and each.parameter.name not in today
        and _exists(each, today)
        and not (switched and ".notch" in each.parameter.role)
    ]
    if missing:
        yield (
            f"{joined(missing)}: not in the log; {'its' if len(missing) == 1 else 'their'} default counts as today's, "
            "and another version may name it otherwise"
        )


def _steps(autopilot: Autopilot, values: Mapping[str, float], today: Mapping[str, float]) -> Iterator[str]:
    """Say which rate of the law is assumed, where it is the gyroscope's and no log holds it."""
    if autopilot.by_role("loop.period") is not None and not today:
        yield (
            f"{autopilot.law(values).rate_hz:.4g} steps of the law in a second are assumed; a log of your vehicle "
            "holds them (--flight)"
        )


def _hover_warnings(
    autopilot: Autopilot, today: Mapping[str, float], hover: HoverPlant, vehicle: VehicleSettings
) -> Iterator[str]:
    """Say where the hover thrust of a log is not that of the vehicle: the full thrust is another, and all gains too."""
    held = autopilot.by_role("motors.hover")
    if held is not None and held.name in today and abs(today[held.name] / hover.share - 1) > _OFF:
        yield (
            f"{held.name} is {today[held.name]:.3g} in the log, but the vehicle hovers at {100 * hover.share:.2g} % of "
            "its full thrust: if the log is right, vehicle.rotor_speed_max_rad_s is not "
            f"{vehicle.rotor_speed_max_rad_s:.6g}, and gains are off as thrust is"
        )


def _mixer_warnings(autopilot: Autopilot, vehicle: VehicleSettings) -> Iterator[str]:
    """Say which rotors of an X quadrotor are not where, or do not turn as, the autopilot's are."""
    own = [
        (int(np.sign(round(rotor.position_m[0], 4))), int(np.sign(round(rotor.position_m[1], 4))), rotor.spin)
        for rotor in vehicle.rotors
    ]
    if len(own) != len(autopilot.cross) or any(0 in each[:2] for each in own):
        return
    wrong = [place + 1 for place, each in enumerate(own) if each[:2] != autopilot.cross[place][:2]]
    turned = [each[2] != next(other[2] for other in autopilot.cross if other[:2] == each[:2]) for each in own]
    if wrong:
        yield (
            f"mixer: rotors {joined(map(str, wrong))} of the config are not where those of {autopilot.title} are "
            f"({_places(autopilot.cross)}): assign its outputs so, or order the config so"
        )
    if all(turned):
        yield f"mixer: all rotors turn the other way round than those of {autopilot.title}; set it so, or yaw runs away"
    elif any(turned):
        yield (
            f"mixer: rotors {joined([str(place + 1) for place, each in enumerate(turned) if each])} of the config turn "
            f"the other way round than those of {autopilot.title} there; check vehicle.rotors.spin"
        )


def _places(cross: Sequence[tuple[int, int, int]]) -> str:
    return ", ".join(
        f"{place + 1} {'front' if x > 0 else 'rear'} {'left' if y > 0 else 'right'}"
        for place, (x, y, _) in enumerate(cross)
    )
