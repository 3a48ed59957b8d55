"""Gains for a vehicle that was found: by margins over all vehicles that flights leave possible, with what goes along.

Along go the thrust curve, the hover thrust, and notches at the lines that the gyroscope's noise shows.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import ClassVar

import numpy as np

from cpfls_cli.autopilots.law import AXES
from cpfls_cli.autopilots.motors import straightening
from cpfls_cli.autopilots.parameters import Autopilot, Parameter
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.result import about, part, result
from cpfls_cli.tuning.gains import AskedMargins, Proposal, Tuned, proposal_of, with_filters
from cpfls_cli.tuning.margins import Evaluation, evaluate
from cpfls_cli.tuning.plant import HoverPlant, Line, Noise, Spread, hover_plant
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.words import joined

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
    today : mapping of str to float, or None
        Parameters of a log; None for the defaults.
    system : str
        What wrote that log.
    """
    asked, today = AskedMargins() if asked is None else asked, today or {}
    values = autopilot.of_log(today) if today else autopilot.defaults()

    def hover_of(whole: Mapping[str, float]) -> HoverPlant:
        return replace(hover_plant(autopilot.law(whole), model.vehicle, model, rotor_lag), spreads=spreads)

    others = [*_curve(autopilot, model)] if signals else []
    follows = noise is not None and bool(noise.lines) and _follows(autopilot, today)
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
                each.parameter,
                today.get(each.parameter.name, np.nan),
                each.value,
                each.wanted,
                clipped=each.clipped,
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
    lift = sum(rotor.thrust_factor_n_s2 for rotor in model.vehicle.rotors)
    hovering = np.sqrt(model.vehicle.mass_kg * model.vehicle.gravity_m_s2 / lift)
    linear = model.thrust_linear * hovering / model.vehicle.rotor_speed_max_rad_s
    wanted = straightening(autopilot.law().curve, float(linear), parameter.scale * parameter.high)
    yield proposal_of(parameter, wanted / parameter.scale)


def _follows(autopilot: Autopilot, today: Mapping[str, float]) -> bool:
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
