"""Find a whole vehicle in flights with rotor speeds: rotors, inertia and effects, fitted on what they predict."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import fields, replace
from fnmatch import fnmatch
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from cpfls_cli.arguments import (
    AnywayOption,
    FlightsArgument,
    HeldOutOption,
    QuickOption,
    ResumeOption,
    WriteConfigOption,
)
from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.job import Job, origin_before
from cpfls_cli.artifacts.model import LearnedFlight
from cpfls_cli.artifacts.output import check_output, refuse_own
from cpfls_cli.artifacts.vehicle_model import (
    CENTRE,
    DELAY,
    DRAG,
    FOUND_AS,
    INERTIA,
    LAG,
    OF_NONE,
    OF_TURNING,
    ON_BOUND,
    THRUST,
    Parameter,
    Vehicle,
    excess,
    is_learned,
    mismatches,
    name_of,
    too_heavy,
    vehicle_section,
)
from cpfls_cli.config.study import Study, settings_of, to_yaml
from cpfls_cli.effects.registry import SUPPLY
from cpfls_cli.effects.scales import hover_speed
from cpfls_cli.errors import ConfigError, InputError
from cpfls_cli.flightlog.stated_vehicle import FAST_HZ, log_faster, shown_slowly
from cpfls_cli.flights.playback import flights_to_play, played
from cpfls_cli.flights.recordings import seen_twice
from cpfls_cli.flights.training import known_by, known_flight, numbered_roles, refuse_seen
from cpfls_cli.pages.gap_words import BY_HAND, WHAT_TO_FLY, flown_by_hand
from cpfls_cli.pages.model import WORDS as MODEL_WORDS
from cpfls_cli.pages.model import said_by
from cpfls_cli.pages.playback import ERRORS, draw_errors, errors_height, gust_words
from cpfls_cli.pages.playback import WORDS as PLAYBACK_WORDS
from cpfls_cli.pages.trust import NOTHING_COMES, contradicted, tell_before_search
from cpfls_cli.playback.errors import AlongFlights
from cpfls_cli.playback.flight import LoggedFlight, contradictions_of
from cpfls_cli.playback.loop import ANY, LoopBounds, shows_loop_anyhow
from cpfls_cli.playback.parameters import CURVE, MASS, blocks_of
from cpfls_cli.playback.replay import fading, replay
from cpfls_cli.playback.settings import GroupSettings, PlaybackSettings
from cpfls_cli.playback.structure import Judged, Kept, SearchStoppedError, TriedStructure
from cpfls_cli.playback.vehicle import Share, VehicleFit, find_vehicle, within_samples
from cpfls_cli.playback.weight import commanded_thrust
from cpfls_cli.report.canvas import BASELINE, GREY, Drawn, Figure, legend_over, line, style_of
from cpfls_cli.report.content import percent
from cpfls_cli.response.flown import VehicleResponse, vehicle_responses
from cpfls_cli.response.spectra import ACCEPTABLE
from cpfls_cli.rounding import levelled
from cpfls_cli.search import VehicleCheckpoint, Watch
from cpfls_cli.stage import Run, stage
from cpfls_cli.stages._checkpoint import stop_note
from cpfls_cli.stages._numbers import to_fly
from cpfls_cli.validation.trust import Trust
from cpfls_cli.words import by_name, did_you_mean, few, joined

_KEPT_EVERY = 10
"""Structures after which the checkpoint is written again: what a killed search has to judge anew at most."""
_LIVELY_RAD_S = 1.0
"""Body rate, root mean square, above which larger turns show no more of the vehicle."""
_FIRST_ANSWER = "a first answer by --quick: without it more structures are tried, on more windows"
_FAR = 3.0
"""Factor from the stated number from which on a found one is called effective, and no property of a part."""
_REMAINDER, _ROTORS = "remainder", "rotors"
_TRIED = {
    "chosen": "chosen",
    "best": "smallest error",
    "added": "named effects added",
    "everything": "all blocks",
    "nothing": "stated vehicle",
    "free": "chosen with a free body",
    "held": "body by bounds, rotors that only lag",
}
_MARKERS = {"chosen": "s", "best": "^", "added": "v", "everything": "D", "nothing": "x", "free": "P", "held": "P"}
_PANELS = (
    *(("torque", "N m", each) for each in ("x (roll to the right)", "y (nose down)", "z (yaw to the left)")),
    *(("force", "N", each) for each in ("x (ahead)", "y (left)", "z (up)")),
)
_STEPS = "steps of thrust, with rotor speeds or commands logged at 100 Hz or faster"
_TO_KNOW = {
    THRUST: "climb and descend more: the known mass then identifies thrust",
    DRAG: "turn about yaw with fast steps while rolling and pitching, or state Izz; else only their ratio is known",
    INERTIA[0]: "roll with fast steps or a multisine: several changes of direction a second",
    INERTIA[1]: "pitch with fast steps or a multisine: several changes of direction a second",
    INERTIA[2]: (
        "turn about yaw fast while rolling and pitching fast: the gyroscopic torque alone separates Izz from the drag "
        "factor; or state one of the two"
    ),
    **dict.fromkeys(INERTIA[3:], "roll and yaw fast at once"),
    LAG: _STEPS,
    DELAY: _STEPS,
    **dict.fromkeys(CENTRE, "climb and descend with much and little thrust: what an offset turns grows with thrust"),
}
"""What would identify a constant that the flights do not."""


def _wanting(r: Vehicle) -> list[Parameter]:
    return [each for each in r.parameters.values() if each.wanting]


def _reasons(r: Vehicle) -> Iterator[tuple[str, list[str]]]:
    """Say of the constants that were looked for and not found why, alike ones together."""
    for reason, same in groupby(_wanting(r), key=lambda each: each.reason):
        yield reason, [each.name for each in same]


def _to_know(r: Vehicle) -> Iterator[tuple[str, list[str]]]:
    """Say what would identify them; thrust without a value is that of flights that lack velocity."""

    def flight(own: Parameter) -> str:
        lacking = own.key == THRUST and own.value is None
        return f"{'log velocity (or position), and ' if lacking else ''}{_TO_KNOW[own.key]}"

    for asked, same in groupby(_wanting(r), key=flight):
        yield asked, [each.name for each in same]


Band = tuple[float, float, float]
"""Share that torque explains, and the ends of the band, Hz."""


def known_bands(bounds: LoopBounds, axis: int) -> tuple[Band, Band | None] | None:
    """Find the bands in which torque explains least about an axis, and most; None where no band is known."""
    shares, least = bounds.by_band[:, axis], bounds.explained[axis]
    known = np.flatnonzero(np.isfinite(shares))
    if not len(known):
        return None
    worst = int(known[np.argmin(np.abs(shares[known] - least))])
    best = int(known[np.argmax(levelled(shares[known]))])
    first, last = ((float(shares[at]), *bounds.band_hz[at].tolist()) for at in (worst, best))
    return first, last if best != worst else None


def bounded(r: Vehicle) -> list[Parameter]:
    """List the moments of inertia that were found between bounds."""
    return [r.parameters[key] for key in INERTIA[:3] if FOUND_AS[key] in r.bounded]


def shares_in_words(shares: Sequence[Share], first: int) -> str:
    """Compare what has a name with what is learned, next to the rotors: of torque from 0, of force from 3."""
    sizes = {each.name: float(np.linalg.norm(each.wrench[first : first + 3])) for each in shares}
    learned = sizes.pop(_REMAINDER, 0.0)
    sizes.pop(_ROTORS)
    named = float(np.sqrt(sum(value**2 for value in sizes.values())))
    if named + learned == 0:
        return "the rotors alone"
    share = learned**2 / (named**2 + learned**2)
    return f"named {percent(1 - share)}, learned {percent(share)} (squares, without the rotors)"


WORDS: Mapping[str, Any] = {
    **MODEL_WORDS,
    **PLAYBACK_WORDS,
    **by_name(
        bounded,
        excess,
        few,
        flown_by_hand,
        gust_words,
        is_learned,
        known_bands,
        log_faster,
        shown_slowly,
        _to_know,
        too_heavy,
    ),
    "ACCEPTABLE": ACCEPTABLE,
    "ANY": ANY,
    "BY_HAND": BY_HAND,
    "CURVE": CURVE,
    "DRAG": DRAG,
    "FAR": _FAR,
    "FAST_HZ": FAST_HZ,
    "LIVELY_RAD_S": _LIVELY_RAD_S,
    "OF_NONE": OF_NONE,
    "OF_TURNING": OF_TURNING,
    "ON_BOUND": ON_BOUND,
    "THRUST": THRUST,
    "SUPPLIED": f"{SUPPLY.name}.{SUPPLY.numbers[0].name}",
    "TRIED": _TRIED,
    "WHAT_TO_FLY": WHAT_TO_FLY,
    "by_name": lambda rows: {each.name: each for each in rows},
    "clipped": lambda share: float(np.clip(share, 0.0, 1.0)),
    "section": lambda r: to_yaml({"vehicle": vehicle_section(r)}).rstrip(),
    "shares": shares_in_words,
    "wanting": _reasons,
}


def _errors(r: Vehicle, figure: Figure) -> None:
    assert r.held_out is not None, "drawn only where there are errors"
    draw_errors(r.held_out, figure)


def _structures(r: Vehicle, figure: Figure) -> None:
    axes = figure.subplots()
    front = sorted((each.numbers, each.error) for each in r.structures if each.name == "front")
    count, error = (np.array(values, dtype=float) for values in zip(*front, strict=True))
    axes.plot(count, error, "o", label="Pareto front", color=GREY, markersize=4)
    by_name: dict[str, TriedStructure] = {each.name: each for each in r.structures}
    for place, (name, marker) in enumerate(_MARKERS.items()):
        if name not in by_name:
            continue
        look = {"label": _TRIED[name], "color": style_of(place)["color"], "markersize": 7, "linestyle": "none"}
        axes.plot([by_name[name].numbers], [by_name[name].error], marker, **look)
    axes.axhline(1.1, label="rates stay", **BASELINE)
    axes.set(xlabel="free numbers", ylabel="error on flights kept aside", yscale="log")
    legend_over(figure, axes)


def _remainder(r: Vehicle, figure: Figure) -> None:
    remainder = r.model.remainder
    assert remainder is not None, "drawn only where there is one"
    direction, learned, named = remainder_curves(r)
    chosen = set(remainder.rows.tolist())
    columns = [rows for rows in (range(3), range(3, 6)) if chosen & set(rows)]
    panels = figure.subplots(3, len(columns), sharex=True, sharey="col", squeeze=False)
    for column, rows in enumerate(columns):
        for axes, row in zip(panels[:, column], rows, strict=True):
            line(axes, direction, named[:, row], label="all effects that have a name", **BASELINE)
            line(axes, direction, learned[:, row], label="learned", **{**style_of(0), "linewidth": 2.0})
            kind, unit, words = _PANELS[row]
            axes.set_title(f"{kind} {words}, {unit}")
        panels[-1, column].set_xticks(np.arange(-180, 181, 90), ["back", "right", "ahead", "left", "back"])
    figure.supxlabel("direction of flight in the plane of the rotors", fontsize=9.5)
    legend_over(figure, panels[0, 0])


def remainder_curves(r: Vehicle) -> tuple[Array, Array, Array]:
    """Evaluate the remainder, and the effects that have a name, over the direction of flight.

    Directions are in degrees, 0 ahead, 90 left; torque and force in N m and N.
    """
    model, direction = r.model, np.linspace(-180.0, 180.0, 73)
    angle = np.radians(direction)
    velocity = r.airspeed_m_s * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    rotor = np.zeros((len(angle), 1 + 4 * model.rotors))
    rotor[:, 0] = 1.0
    rotor[:, 1 : 1 + model.rotors] = hover_speed(model.vehicle)
    parts = model.wrench_by_part(velocity, np.zeros_like(velocity), rotor)
    named = sum((own for name, own in parts.items() if name not in (_ROTORS, _REMAINDER)), np.zeros((len(angle), 6)))
    return direction, parts[_REMAINDER], named


@stage(
    Vehicle,
    title="The vehicle found in flights",
    figures={
        "errors": Drawn(
            ERRORS,
            lambda r: errors_height(r.held_out),
            _errors,
            lambda r: r.held_out is not None and len(r.held_out.horizon_s) > 1,
        ),
        "structures": Drawn("Playback error by the number of free numbers", 3.4, _structures),
        "remainder": Drawn(
            "The unnamed part, by direction of flight", 5.2, _remainder, lambda r: r.model.remainder is not None
        ),
    },
    words=WORDS,
    study=True,
    resumes=True,
    # The file holds it with its config.
    overrides=lambda anyway=False, quick=False, **_: [
        f"playback.{name}=true" for name, asked in (("anyway", anyway), ("quick", quick)) if asked
    ],
)
def vehicle(
    run: Run,
    flights: FlightsArgument,
    held_out: HeldOutOption = None,
    resume: ResumeOption = False,
    write_config: WriteConfigOption = None,
    anyway: AnywayOption = False,  # noqa: ARG001  # the config has it
    quick: QuickOption = False,  # noqa: ARG001  # so it has this one
) -> Vehicle | None:
    """Find a vehicle in flights, and judge it on those held out."""
    others = held_out or []
    learned, unseen = numbered_roles("flight", flights), numbered_roles("held-out", others)
    begun = origin_before(run.study, run.take(learned | unseen), "vehicle-checkpoint")
    checkpoint, kept = VehicleCheckpoint.begun(run, begun, resume=resume)
    known = [known_flight(path, run.files[role]) for role, path in learned.items()]
    refuse_seen(known, known_by(unseen, run.files))
    twice = seen_twice(run.files[role] for role in learned)
    if write_config is not None:
        refuse_own(write_config, run.output)
        check_output(write_config, run.force, run.inputs)
    named = [*flights, *others]
    read, lacking = supplied_alike(_grouped(flights_to_play(named, run.study), named, run.study.playback.groups))
    for flight in read:
        _require_rotors(flight)
        flight.playback.starts(_horizon(run, flight), 1)
    # After the rotors are known to be those of a vehicle that flies: blocks of others cannot be scaled.
    _check_blocks(run.study)
    _check_groups(run.study.playback.groups, read[: len(flights)])
    training = read[: len(flights)]
    settings, limit = _what_can_come(run, read, training)
    if run.dry_run:
        return None
    if kept is None:
        checkpoint.remove()
    run.until_written.enter_context(checkpoint.kept())
    found, signal = _found(run, training, settings, checkpoint, kept or {})
    # Rotors show nothing above half the rate at which they are logged.
    rotors_hz = min(flight.logged_hz for flight in training if not flight.group)
    seen = tuple(within_samples(found.numbers, rotors_hz))
    found = replace(found, loop=found.loop.up_to(rotors_hz / 2), numbers=seen)
    first = [_FIRST_ANSWER] if settings.quick else []
    warnings = [*first, *limit, *twice, *lacking, *(warning for flight in read for warning in flight.warnings)]
    sizes = [sum(map(len, flight.parts)) for flight in training]
    # All samples that were used were learned from.
    own = [flight._replace(samples=size, of=size) for flight, size in zip(known, sizes, strict=True)]
    made = _judged(run, found, read, own, warnings)
    if made.complete:
        # Of a search that goes on, the numbers are not those that are found; nothing is then in the way of --resume.
        run.texts |= _config_copy(run, write_config, made)
        run.afterwards.append(checkpoint.remove)
    run.next += next_commands(run, made, flights, others)
    note, run.exit_code = stop_note("generations" if made.complete else "interrupted", signal, run.output)
    run.said += [] if note is None else [note]
    return made


def next_commands(
    job: Job, made: Vehicle, flights: Sequence[Path], held_out: Sequence[Path]
) -> tuple[Sequence[str | Path], ...]:
    """Give the commands that show what was found, judge it, plan flights that identify more, or hand it over."""
    config, name = job.config, job.output.stem
    page = ("cpfls", "report", config, job.output, "-o", job.output.with_suffix(".html"))
    # No flight that is planned says more before the logs are faster.
    if not made.complete or made.logged_slowly:
        return (page,)
    if job.study.playback.quick:
        others = [part for path in held_out for part in ("--held-out", path)]
        return page, ("cpfls", "vehicle", config, *flights, *others, "-o", job.output.with_name(f"{name}-full.h5"))
    if made.trust in (Trust.LOOP, Trust.NOT_DETERMINED, Trust.LACKING, Trust.DO_NOT_USE):
        mission = job.output.with_name(f"{name}-mission.h5")
        return page, to_fly(job, mission, systems=made.logged_by)
    if not held_out and len(flights) > 1:
        judged = job.output.with_name(f"{name}-judged.h5")
        return page, ("cpfls", "vehicle", config, *flights[:-1], "--held-out", flights[-1], "-o", judged)
    return page, ("cpfls", "export", job.output, "-o", job.output.with_suffix(".c"))


def _config_copy(run: Run, copy: Path | None, made: Vehicle) -> dict[Path, str]:
    """Write the config again with the numbers that were found in the place of its section `vehicle`."""
    if copy is None:
        return {}
    section = vehicle_section(made)
    held = dict(zip(INERTIA, section["inertia_kg_m2"], strict=False))
    held |= {key: section["rotors"][0][key.partition(".")[2]] for key in (THRUST, DRAG)}
    open_ = [name_of(FOUND_AS[key]) for key, value in held.items() if value is None]
    run.last_words = f"{copy}: written, the config with these constants"
    run.last_words += f", null for what no flight determines: {joined(open_)}" if open_ else ""
    data = run.data() | {"vehicle": section}
    return {copy: f"# {run.config.name}, with the vehicle that `cpfls vehicle` found\n{to_yaml(data)}"}


def _what_can_come(
    run: Run, flights: Sequence[LoggedFlight], training: Sequence[LoggedFlight]
) -> tuple[PlaybackSettings, tuple[str, ...]]:
    """Refuse logs that contradict themselves, and seek no more than slow ones can identify; a warning first."""
    settings, wrong = run.study.playback, contradictions_of(flights)
    if wrong and not settings.anyway:
        raise InputError("\n".join(map(contradicted, wrong)) + f"\n{NOTHING_COMES}")
    tell_before_search(wrong)
    own = [flight for flight in training if not flight.group]
    logged_hz = min(flight.logged_hz for flight in own)
    along = [flight.playback for flight in own]
    if settings.anyway or not shows_loop_anyhow(run.study.vehicle, along, logged_hz):
        return settings, ()
    said = said_by("vehicle", logged_hz, "too-slow")[0]
    logging.getLogger("cpfls_cli").warning(said)
    return replace(settings, leave_out=blocks_of(run.study.vehicle), history_s=0.0), (said,)


def supplied_alike(flights: Sequence[LoggedFlight]) -> tuple[Sequence[LoggedFlight], tuple[str, ...]]:
    """Use the voltage behind commands in all flights or in none: a model that needs it is judged on none without it."""
    without = [flight.name for flight in flights if any(part.voltage is None for part in flight.parts)]
    if not without or len(without) == len(flights) or not flights[0].parts[0].commanded:
        return flights, ()
    said = f"the voltage of the battery is not used, because not all flights have it: {joined(without)} without"
    alike = [replace(flight, parts=tuple(replace(part, voltage=None) for part in flight.parts)) for flight in flights]
    return alike, (said,)


def _require_rotors(flight: LoggedFlight) -> None:
    if flight.playback.wrench is not None:
        raise InputError(
            f"{flight.name}: holds torque instead of rotor speeds; `cpfls vehicle` needs rotor_speed or rotor_command, "
            "or thrust with body_torque, of four rotors with known factors: name their columns in import.signals"
        )


def _found(
    run: Run, flights: Sequence[LoggedFlight], settings: PlaybackSettings, checkpoint: VehicleCheckpoint, kept: Kept
) -> tuple[VehicleFit, int | None]:
    """Search; an interrupt ends the search, and its number is given with what has been found until then."""
    study, watch = run.study, Watch(run, None)

    def progress(judged: Sequence[Judged], total: int) -> None:
        best = min(each.error for each in judged)
        run.progress(len(judged), total, f"structure {len(judged)}, smallest error {best:.3g}")
        stop = watch.should_stop()
        if stop or len(judged) % _KEPT_EVERY == 0:
            checkpoint.write(judged)
        if stop:
            raise SearchStoppedError

    commands = commanded_thrust([flight for flight in flights if not flight.group])
    along = [commands.acting(flight) for flight in flights]
    with settings_of("playback", study), watch.deferring():
        vehicle = find_vehicle(study.vehicle, along, settings, progress, kept, commands)
    return vehicle, watch.signal


def _judged(
    run: Run,
    found: VehicleFit,
    flights: Sequence[LoggedFlight],
    learned: Sequence[LearnedFlight],
    warnings: Iterable[str],
) -> Vehicle:
    """Say how well a vehicle predicts the flights that it was not found in, which come last, and what else is known."""
    training, rest = flights[: len(learned)], flights[len(learned) :]
    fading_s = fading([flight.playback for flight in training], _horizon(run, training[0]))
    behind = any(flight.parts[0].commanded for flight in training)
    shares = any(flight.shares for flight in training)
    own = {each.name: getattr(found, each.name) for each in fields(found)}
    known = {
        "commanded": behind,
        "held_s": held_s(training),
        "full_voltage": max(flight.parts[0].full_voltage for flight in flights),
    }
    own |= {name: replace(own[name], **known) for name in ("model", "forecast") if own[name] is not None}
    responses = mismatches(_responses(found, training), instrumented=found.instruments is not None)
    return Vehicle(
        **own,
        held_out=_held_out(found, rest, run, fading_s) if rest else None,
        responses=responses,
        fading_s=fading_s,
        full_speed_rad_s=found.model.vehicle.rotor_speed_max_rad_s if shares else None,
        rotors_logged_hz=min(flight.logged_hz for flight in training),
        logged_by=tuple(dict.fromkeys(flight.system for flight in training if flight.system)),
        warnings=tuple(warnings),
        contradictions=contradictions_of(flights),
        learned=tuple(learned),
    )


def held_s(flights: Sequence[LoggedFlight]) -> float:
    """Give for how long flights of commands, as they are logged, hold one, on average, s."""
    held = [flight.held_s for flight in flights if flight.parts[0].commanded]
    return sum(held) / max(len(held), 1)


def _held_out(vehicle: VehicleFit, flights: Sequence[LoggedFlight], run: Run, fading_s: float) -> AlongFlights:
    """Play a vehicle back along flights that it was not found in, from every sample."""
    models = {"": vehicle.forecast or vehicle.model, **vehicle.others}
    pairs = [replace(played(models[flight.group], flight, run.study.vehicle), fading_s=fading_s) for flight in flights]
    if vehicle.history is not None:
        pairs = [replace(pair, with_past=replace(pair.model, observer=vehicle.history)) for pair in pairs]
    errors = replay(
        pairs, _horizon(run, flights[0]), 1, lambda done: run.progress(done, 1, "plays back the flights held out")
    )
    return errors.along(pairs)


def _responses(vehicle: VehicleFit, flights: Sequence[LoggedFlight]) -> Mapping[str, VehicleResponse]:
    """Estimate frequency responses with those of the model; none where the flights show the loop alone."""
    own = [flight for flight in flights if not flight.group]
    if vehicle.instruments is None and vehicle.loop.unexplained:
        return {}
    assert vehicle.sources is not None, "it was found just now"
    try:
        return vehicle_responses(vehicle.model, own, vehicle.sources.by_flight)
    except InputError:
        # Stretches that are too short for a window; the flights' inputs were checked before.
        return {}


def _grouped(
    flights: Sequence[LoggedFlight], paths: Sequence[Path], groups: Sequence[GroupSettings]
) -> tuple[LoggedFlight, ...]:
    """Say of each flight in which configuration the vehicle flew it: the first whose names match."""
    grouped = []
    for flight, path in zip(flights, paths, strict=True):
        own = (group.name for group in groups if any(fnmatch(path.name, name) for name in group.flights))
        grouped.append(replace(flight, group=next(own, "")))
    return tuple(grouped)


def _check_groups(groups: Sequence[GroupSettings], training: Sequence[LoggedFlight]) -> None:
    """Refuse groups that no flight identifies."""
    flown = {flight.group for flight in training}
    for group in groups:
        if group.name not in flown:
            names = joined(repr(name) for name in group.flights)
            raise ConfigError(
                f"playback.groups: no training flight belongs to {group.name}: no file name matches {names}; name its "
                f"files there or leave the group out"
            )
    if "" not in flown:
        raise ConfigError(
            "playback.groups: every flight belongs to a group; at least one has to be of the section vehicle, whose "
            "mass gives all numbers their size"
        )


def _horizon(run: Run, flight: LoggedFlight) -> int:
    return max(1, round(run.study.playback.horizon_s / flight.parts[0].period))


def _check_blocks(study: Study) -> None:
    """Refuse names of blocks that no vehicle has."""
    known = (*study.vehicle.unknown, *blocks_of(study.vehicle))
    asked = [("playback.leave_out", name, known) for name in study.playback.leave_out]
    for group in study.playback.groups:
        key = f"playback.groups: {group.name}: differs"
        asked += [(key, name, (MASS, *known)) for name in group.differs or ()]
    for key, name, allowed in asked:
        if name not in allowed:
            hint = did_you_mean(name, allowed, f"the blocks are {', '.join(allowed)}")
            raise ConfigError(f"{key} = {name}: no such block ({hint})")
