"""Command `tune`: gains for an autopilot from a vehicle that was found, by margins over all that is possible."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.flight import FlightRecord
from cpfls_cli.artifacts.gains import AXES, DEFAULT, PROPOSED, TODAY, GainsRecord, NoiseGroup, ParameterRow
from cpfls_cli.artifacts.job import Job, begin, check_outputs, finish
from cpfls_cli.artifacts.output import check_output, refuse_own, write_text
from cpfls_cli.artifacts.parameters import DELAY, DRAG, FOUND_AS, INERTIA, LAG, THRUST
from cpfls_cli.artifacts.store import holds, read_record
from cpfls_cli.artifacts.vehicle_model import Vehicle
from cpfls_cli.autopilots.motors import straightening
from cpfls_cli.autopilots.parameters import Autopilot
from cpfls_cli.autopilots.registry import AUTOPILOTS
from cpfls_cli.commands.numbers import to_fly, with_numbers
from cpfls_cli.config.study import Study
from cpfls_cli.errors import InputError, about
from cpfls_cli.export.parameter_files import file_of, parameter_file
from cpfls_cli.flights.inputs import numbered_roles
from cpfls_cli.flights.models import found_vehicle, is_found, is_model, read_model
from cpfls_cli.logs.formats import log_contents, read_log
from cpfls_cli.look.effectiveness import effectiveness
from cpfls_cli.look.flight import LogFlight
from cpfls_cli.look.gains import Plant, TunedGains, tuned_gains
from cpfls_cli.look.reading import read_flight
from cpfls_cli.look.vibration import Change, vibration_of
from cpfls_cli.pages.gains import answer
from cpfls_cli.pages.look_gains import answer as answer_of_log
from cpfls_cli.pages.model import slow_words
from cpfls_cli.pages.source import source_of
from cpfls_cli.pages.trust import trust_words
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.report.content import Text
from cpfls_cli.report.numbers import number, percent
from cpfls_cli.report.outcome import Outcome, command_line, nothing_written
from cpfls_cli.result import plain
from cpfls_cli.tuning.gains import AskedMargins, Proposal, proposal_of, with_filters
from cpfls_cli.tuning.margins import evaluate
from cpfls_cli.tuning.noise import LEAST, Line, Noise, noise_of
from cpfls_cli.tuning.plant import HoverPlant, Spread, hover_plant, spread_of
from cpfls_cli.validation.trust import Trust
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.words import joined

_ASSUMED_LAG = (0.7, 1.3)
_ASSUMED_GAIN = (0.8, 1.25)
_STAYS = {"on": 1.0, "harmonics": 1.0, "mode": 0.0, "follows": 0.0}
"""What makes a notch of an autopilot one that stays at its centre."""
_OFF = 0.2
"""Hover thrust of a log that is further from the model's says that the largest rotor speed is another."""


def run(
    job: Job, model: Path, autopilot: str, flights: Sequence[Path] = (), asked: AskedMargins | None = None
) -> Outcome:
    """Find gains and write them, and a file of parameters beside."""
    asked = AskedMargins() if asked is None else asked
    own = AUTOPILOTS[autopilot]
    roles = numbered_roles("flight", flights)
    inputs = begin(job, {"model": model} | roles)
    record = _trusted(job, model)
    job = with_numbers(job, "tune", model, whole=True)
    vehicle = read_model(model, job.study)
    logs = [_read(flight, job.study) for flight in flights]
    known, refused = _todays(own, logs)
    today, system = ({}, "") if known is None else (known.of(own), known.system)
    if job.dry_run:
        return nothing_written(job)
    values = own.of_log(today) if today else own.defaults()
    noise = _noise(own, values, logs)
    work = _Work(own, record, vehicle, job.study, asked, noise)
    proposals, hover = work.proposed(values, today)
    chosen = values | {each.parameter.name: each.value for each in proposals}
    sets = {PROPOSED: evaluate(own.law(chosen), hover)}
    sets[TODAY if today else DEFAULT] = evaluate(own.law(values), work.hover(values))
    warnings = [
        *refused,
        *_mixer_notes(own, vehicle.vehicle),
        *_hover_notes(own, today, hover, record),
        *work.notes,
        *_lacking(own, today, proposals),
        *_steps(own, values, today),
        *([] if noise is not None or not flights else _unheard(job.study, logs)),
    ]
    heard = None if noise is None else _heard(own, noise, work.lines, (chosen, values))
    made = GainsRecord.of(
        own,
        model.name,
        asked,
        hover,
        sets,
        [each for each in proposals if _exists(each, today)],
        today,
        heard,
        warnings,
        system,
    )
    suffix, text = parameter_file(made, job.output.name)
    file = job.output.with_suffix(suffix)
    refuse_own(file, job.output)
    check_outputs(job, file)
    whole = finish(job, made, inputs)
    write_text(file, text)
    blocks = (*answer(source_of(job, whole)), Text(f"{file}: written, for the ground station"))
    to_report = ("cpfls", "report", job.config, job.output, "-o", job.output.with_suffix(".html"))
    return Outcome(whole.summary | {"file": str(file)}, blocks, next=(to_report,))


def run_log(
    log: Path, output: Path | None, asked: AskedMargins, *, force: bool = False, dry_run: bool = False
) -> Outcome:
    """Find gains from one log alone, and write those that change where a file is named."""
    contents = log_contents(log)
    with about(log, InputError):
        flight = read_flight(log.name, contents.topics, contents.units, contents.parameters, contents.system)
    if dry_run:
        return Outcome({"dry_run": True}, (Text(f"{log}: is a log of a multirotor; nothing is computed"),))
    vibration = vibration_of(flight)
    filters = () if vibration is None else vibration.changes
    found = of_flight(flight, effectiveness(flight), output, asked, filters=filters, force=force)
    return replace(found, blocks=(*(Text(f"{log}: {each}", "warning") for each in contents.warnings), *found.blocks))


def of_flight(
    flight: LogFlight,
    plants: Sequence[Plant],
    output: Path | None,
    asked: AskedMargins,
    *,
    filters: Sequence[Change] = (),
    force: bool = False,
) -> Outcome:
    """Find gains, and filters that its spectra ask for, from what a log shows of a vehicle."""
    gains = tuned_gains(flight, plants, asked)
    blocks = [*answer_of_log(gains)]
    blocks += [Text(f"{each.parameter}: {each.now:g} -> {each.proposed:g} Hz, {each.reason}") for each in filters]
    summary = plain(gains) | {"filters": [plain(each) for each in filters]}
    rows = _changed(gains, flight, filters) if output is not None and (gains.changes or filters) else []
    if output is None or not rows:
        said = [Text(f"{output}: not written, nothing changes")] if output else []
        return Outcome(summary, (*blocks, *said))
    suffix, text = file_of(AUTOPILOTS[gains.autopilot], gains.version, f"gains of cpfls from {flight.name}", rows)
    file = output.with_suffix(suffix)
    check_output(file, force)
    write_text(file, text)
    return Outcome(
        summary | {"file": str(file)}, (*blocks, Text(f"{file}: written, for the ground station")), written=file
    )


def _changed(gains: TunedGains, flight: LogFlight, filters: Sequence[Change]) -> list[ParameterRow]:
    """Give the parameters that change as a file has them; filters whose ranges are not known are left to the pilot."""
    autopilot = AUTOPILOTS[gains.autopilot]
    names = autopilot.firmware.names(flight.system)
    known = {names.get(each.name, each.name): each for each in autopilot.parameters}
    changes = [(row.parameter, row.today, row.proposed) for row in gains.changes]
    changes += [(each.parameter, each.now, each.proposed) for each in filters if each.parameter in known]
    return [
        ParameterRow(
            name=name,
            meaning=own.meaning,
            unit=own.unit,
            today=today,
            default=own.default,
            proposed=proposed,
            wanted=proposed,
            low=own.low,
            high=own.high,
            clipped=False,
        )
        for name, today, proposed in changes
        for own in (known[name],)
    ]


@dataclass(frozen=True)
class _Log:
    """What a log, or a flight that was imported from one, tells of its autopilot."""

    name: str
    system: str
    parameters: Mapping[str, float | str]
    time: Array
    rate: Array
    column: str
    """The one that holds the body rate about x."""

    def of(self, autopilot: Autopilot) -> dict[str, float]:
        """Give the parameters of a law."""
        return autopilot.in_log(self.parameters)


def _read(flight: Path, study: Study) -> _Log:
    """Read a log, or what an imported flight keeps of its log, which is low-passed and so tells no noise."""
    nothing = (np.zeros(0), np.zeros((0, 3)), "")
    if holds(flight, FlightRecord):
        kept = read_record(flight, FlightRecord).autopilot
        if kept is None:
            return _Log(flight.name, "", {}, *nothing)
        return _Log(flight.name, kept.system, kept.parameters, *nothing)
    contents = log_contents(flight, ())
    rates = _rates(flight, study) if _maps_rates(study) else nothing
    return _Log(flight.name, contents.system, contents.parameters, *rates)


def _todays(autopilot: Autopilot, logs: Sequence[_Log]) -> tuple[_Log | None, list[str]]:
    """Find the log that tells today's parameters, and say why others do not."""
    firmware, refused = autopilot.firmware, list[str]()
    for log in logs:
        if not firmware.wrote(log.system):
            refused.append(f"{log.name}: written by {log.system}, so its parameters are not those of {autopilot.title}")
        elif firmware.too_old(log.system):
            refused.append(f"{log.name}: written by {log.system}; {firmware.older}, so its parameters are not used")
        elif log.of(autopilot):
            return log, refused
    if not logs:
        return None, []
    beside = f"the defaults of {firmware.title} stand beside, and the file is for that version"
    return None, [*refused, beside if refused else f"no log tells gains of {autopilot.title}; {beside}"]


def _noise(autopilot: Autopilot, values: Mapping[str, float], logs: Sequence[_Log]) -> Noise | None:
    """Estimate the noise of the gyroscope in front of the filters of the law."""
    noise = noise_of([(log.time, log.rate) for log in logs])
    behind = [log.column.startswith(autopilot.filtered) for log in logs if log.column]
    return noise.before_filters(autopilot.law(values)) if noise is not None and all(behind) else noise


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
    """Say which rate of the law is assumed, where it is the gyroscope's and no log tells it."""
    if autopilot.by_role("loop.period") is not None and not today:
        yield (
            f"{number(autopilot.law(values).rate_hz, 4)} steps of the law in a second are assumed; a log of your "
            "vehicle tells them (--flight)"
        )


def _trusted(job: Job, model: Path) -> Vehicle:
    """Read a vehicle that is good for simulation and control, and refuse others with the flight that is missing."""
    if not is_found(model):
        what = "an identified model" if is_model(model) else "no model"
        raise InputError(f"{model}: is {what}; gains need a vehicle that `cpfls vehicle` found")
    record = found_vehicle(model)
    if record.verdict is not Trust.SIMULATION:
        good = trust_words(Trust.SIMULATION).short
        weak = f"; not determined: {joined(record.not_determined)}" if record.not_determined else ""
        raise InputError(
            f"{model}: {trust_words(record.verdict).short}{weak}. Gains need a vehicle that is {good}: a body "
            f"that is too heavy gives gains that are too high. {_missing(job, record)}"
        )
    return record


def _missing(job: Job, record: Vehicle) -> str:
    """Say which flight would make a vehicle good."""
    judged = record.held_out is not None or record.instruments is not None
    if record.verdict is Trust.NOT_JUDGED and not judged:
        return "The flight that is missing: one that is kept aside to judge it, `cpfls vehicle` with --held-out FLIGHT"
    planned = command_line(to_fly(job))
    slow = slow_words(record)
    if slow:
        return f"{slow} Then: {planned}, flown in still air, and `cpfls vehicle` again"
    return f"The flight that is missing: {planned}, flown in still air, then `cpfls vehicle` again"


@dataclass
class _Work:
    """What gains are found from."""

    autopilot: Autopilot
    record: Vehicle
    model: VehicleModel
    study: Study
    asked: AskedMargins
    noise: Noise | None

    def __post_init__(self) -> None:
        self.lines: list[Line] = [] if self.noise is None else self.noise.lines()
        self.notes: list[str] = []
        self.spreads = self._spreads()

    def proposed(self, values: Mapping[str, float], today: Mapping[str, float]) -> tuple[list[Proposal], HoverPlant]:
        """Find gains with the thrust curve and the notches that go with them."""
        others = [*_curve(self.autopilot, self.model, self.study)]
        if self.lines and _follows(self.autopilot, today):
            self.notes.append(
                f"a line at {number(self.lines[0].hz, 3)} Hz stands in the noise behind a notch that follows the "
                "motors; it is left as it is, and here it stands at its centre"
            )
        else:
            others += _notches(self.autopilot, self.lines)
        whole = {**values, **{each.parameter.name: each.value for each in others}}
        hover = self.hover(whole)
        found = with_filters(self.autopilot, whole, hover, self.asked, self.noise)
        if any(found.quieter):
            axes = joined([name for name, held in zip(AXES, found.quieter, strict=True) if held])
            why = "noise" if self.noise is not None else "noise that no log tells"
            self.notes.append(
                f"{axes}: held back by {why}; commands jitter at most twice as much as with the gains before: load "
                "these, fly, and tune again with that log"
            )
        held = self.autopilot.by_role("motors.hover")
        if held is not None:
            others.append(proposal_of(held, hover.share))
        return [*found.proposals, *others], hover

    def hover(self, values: Mapping[str, float]) -> HoverPlant:
        """Linearise the vehicle under a law."""
        lag = self.study.simulation.closed_loop.rotor_time_constant_s
        plant = hover_plant(self.autopilot.law(values), self.model.vehicle, self.model, lag)
        return replace(plant, spreads=self.spreads)

    def _spreads(self) -> tuple[Spread, Spread, Spread]:
        """Give what flights leave open of each axis, and take note of what they do not tell."""
        known = self.record.parameters
        intervals, stated = {}, []
        for key in (*INERTIA[:3], THRUST, DRAG, LAG, DELAY):
            each = known[key]
            if each.determined and each.value and each.low is not None and each.high is not None:
                # An end at or below zero says no more than that the number is small.
                intervals[key] = (max(each.low / each.value, 0.1), max(each.high / each.value, 0.1))
            elif key in INERTIA[:3] and FOUND_AS[key] in self.record.not_determined:
                intervals[key] = _ASSUMED_GAIN
                stated.append(each.name)
        if stated:
            self.notes.append(
                f"{joined(stated)}: not told by flights; as they stand, from a fifth less to a quarter more"
            )
        if not self.model.commanded:
            lag = 1e3 * self.study.simulation.closed_loop.rotor_time_constant_s
            self.notes.append(
                f"speeds were measured, so no flight tells how the rotors follow their commands: "
                f"{number(lag, 3)} ms of simulation.closed_loop.rotor_time_constant_s, 30 % either way"
            )
            intervals[LAG] = _ASSUMED_LAG
        named = {"lag": intervals.get(LAG, (1.0, 1.0)), "delay": intervals.get(DELAY, (1.0, 1.0))} | intervals
        roll, pitch, yaw = (spread_of(named, INERTIA[axis], DRAG if axis == 2 else THRUST) for axis in range(3))
        return roll, pitch, yaw


def _curve(autopilot: Autopilot, model: VehicleModel, study: Study) -> Iterator[Proposal]:
    """Propose the thrust curve, where flights tell thrust by the signal of the motors."""
    parameter = autopilot.by_role("motors.expo")
    if parameter is None or not model.commanded or study.import_.rotor_command_is != "speed":
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
        width = autopilot.by_role(f"all.measured.{name}_width")
        lower = autopilot.by_role(f"all.measured.{name}_lower")
        for role, value in _STAYS.items():
            if (fixed := autopilot.by_role(f"all.measured.{name}_{role}")) is not None:
                yield proposal_of(fixed, value)
        yield proposal_of(centre, line.hz)
        if width is not None:
            yield proposal_of(width, line.width_hz)
        if lower is not None:
            yield proposal_of(lower, line.hz - 0.5 * line.width_hz)


def _rates(flight: Path, study: Study) -> tuple[Array, Array, str]:
    """Read times and body rates of a log, as it has them, and the column of the first."""
    read = read_log(flight, study.import_)
    mapped = {str(name): given for name, given in read.settings.signals.items()}.get("body_rate")
    stamps = read.columns.get(read.settings.time_column or "timestamp")
    if mapped is None or stamps is None:
        return np.zeros(0), np.zeros((0, 3)), ""
    columns = [read.columns[name] for name in mapped.columns]
    factor = np.pi / 180 if "deg" in str(mapped.unit) else 1.0
    seconds = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}[read.settings.time_unit]
    rate = factor * np.stack(columns, axis=1)
    known = np.isfinite(rate).all(axis=1) & np.isfinite(stamps)
    return seconds * stamps[known], rate[known], mapped.columns[0]


def _unheard(study: Study, logs: Sequence[_Log]) -> Iterator[str]:
    """Say why logs tell no noise."""
    if all(not log.column and not len(log.time) for log in logs) and _maps_rates(study):
        yield "noise is not read: imported flights are low-passed and resampled; name the log itself with --flight too"
    elif not _maps_rates(study):
        yield "noise is not read: the config has no import.signals.body_rate (`cpfls init LOG` proposes it)"
    else:
        yield f"noise is not read: no log holds {LEAST} samples and a second of body rates without a pause"


def _maps_rates(study: Study) -> bool:
    return "body_rate" in {str(name) for name in study.import_.signals}


def _heard(
    autopilot: Autopilot, noise: Noise, lines: Sequence[Line], sets: tuple[Mapping[str, float], ...]
) -> NoiseGroup:
    return NoiseGroup.of(noise, lines, np.array([noise.of_commands(autopilot.law(values)) for values in sets]))


def _hover_notes(autopilot: Autopilot, today: Mapping[str, float], hover: HoverPlant, record: Vehicle) -> Iterator[str]:
    """Say where the hover thrust of a log is not that of the vehicle: the full thrust is another, and all gains too."""
    held = autopilot.by_role("motors.hover")
    if held is None or held.name not in today:
        return
    if abs(today[held.name] / hover.share - 1) > _OFF:
        yield (
            f"{held.name} is {today[held.name]:.3g} in the log, but the vehicle hovers at "
            f"{percent(hover.share, 2)} of its full thrust: if the log is right, vehicle.rotor_speed_max_rad_s is not "
            f"{record.model.vehicle.rotor_speed_max_rad_s:.6g}, and gains are off as thrust is"
        )


def _mixer_notes(autopilot: Autopilot, vehicle: VehicleSettings) -> Iterator[str]:
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
            f"mixer: rotors {joined([str(each) for each in wrong])} of the config do not stand where those of "
            f"{autopilot.title} do ({_places(autopilot.cross)}): assign its outputs so, or order the config so"
        )
    if all(turned):
        yield f"mixer: all rotors turn the other way round than those of {autopilot.title}; tell it, or yaw runs away"
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
