"""Compare, diagnose and extend in one go, with a report."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, ClassVar

import typer

from cpfls_cli.arguments import FlightsArgument, HeldOutOption, ModelOption
from cpfls_cli.artifacts.diagnosis import Diagnosis, Disagreement, Extended
from cpfls_cli.artifacts.gate import InputFile, format_name, read_origin
from cpfls_cli.artifacts.job import go_on
from cpfls_cli.artifacts.model import as_inputs, joined_flights
from cpfls_cli.config.check import no_body
from cpfls_cli.config.load import parse_config, stored_study, validate
from cpfls_cli.errors import ComputationError, InputError, visible
from cpfls_cli.flights.models import found_vehicle, is_found, learned_by, read_base
from cpfls_cli.flights.recordings import FlightSet, FlightSplit, read_flights, seen_twice, split_flights
from cpfls_cli.flights.training import known_by, known_flight, numbered_roles, refuse_seen
from cpfls_cli.gap.before_after import PlaybackChange, errors_by_horizon
from cpfls_cli.gap.whole_vehicle import has_effects, of_vehicle, with_known_wrench
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.report.content import Command
from cpfls_cli.result import described_fields, part, result
from cpfls_cli.simulators.corrected import corrected
from cpfls_cli.simulators.formats import is_simulator_file
from cpfls_cli.simulators.inside import in_simulator
from cpfls_cli.simulators.study import VehicleOf, played
from cpfls_cli.stage import Filled, Run, stage
from cpfls_cli.stages import diagnose as of_diagnosis
from cpfls_cli.stages._numbers import missing_flight, why_no_body_found, with_numbers
from cpfls_cli.stages.compare import check_ignored, compared, learned_from, progress_of, with_seen
from cpfls_cli.stages.extend import WORDS, extended
from cpfls_cli.stages.init import Stated, proposed, taken
from cpfls_cli.words import joined

PARTS = {
    "disagreement": ("compare", ""),
    "diagnosis": ("diagnose", "disagreement"),
    "extended": ("extend", "diagnosis"),
}
"""Files of the folder, each with the command whose result it is, and what it is made of."""


_STUDY = "study.yaml"
ConfigArgument = Annotated[
    Path,
    typer.Argument(
        metavar="CONFIG",
        help="Study config (YAML); a simulator's own file (SDF, URDF, MJCF, RotorPy, ArduPilot, crazyflow, a "
        "Crazyflie's header), which is corrected; or vehicle.h5.",
        show_default=False,
    ),
]


@result
class Gap:
    """What is missing in a model, and the model with it; what is asked of it besides is of its diagnosis."""

    SHOWN: ClassVar = (
        *Diagnosis.SHOWN,
        *(each.name for each in described_fields(Diagnosis) if each.brief),
        "disagreement",
        "extension",
    )

    disagreement: Disagreement = part(brief=False)
    diagnosis: Diagnosis = part(brief=False)
    extended: Extended | None = part(brief=False)

    @property
    def extension(self) -> dict[str, Any]:
        """Whether the model with the effects is written, and why not."""
        return {"written": self.extended is not None, "reason": self.diagnosis.refused}

    def __getattr__(self, name: str) -> Any:
        """Give what its diagnosis holds."""
        return getattr(self.diagnosis, name)


@stage(
    Gap,
    words={**WORDS, **of_diagnosis.WORDS},
    fills=Filled(PARTS),
    study=lambda given: not is_simulator_file(given["config"]) and not is_found(given["config"]),
)
def gap(
    run: Run,
    config: ConfigArgument,
    flights: FlightsArgument,
    held_out: HeldOutOption = None,
    model: ModelOption = None,
) -> Gap | None:
    """Find where a model and flights disagree, name what is missing, and put it into the model.

    The search adds one effect after another until nothing more can be named, so once through is all the way. Of a
    simulator's own file a study is made, and the file corrected; a vehicle that was found has its study with it.
    """
    held_out = held_out or []
    if is_found(config):
        model = _study_in(run, config, model)
    of_file = _study_of(run, config, [*flights, *held_out], model) if is_simulator_file(config) else None
    if of_file is not None and model is None and run.open_numbers != "guessed":
        _require_stated(run, config, of_file)
    with_numbers(run, "gap", model)
    if of_file is not None:
        run.study = run.study.model_copy(update={"vehicle": of_file.filled(run.study.vehicle)})
    trained = numbered_roles("flight", flights)
    inputs = dict(run.take(trained | ({} if model is None else {"model": model}), "disagreement"))
    why = "" if run.found is None else why_no_body_found(run, run.found)
    if run.found is not None and why:
        raise InputError(
            f"{run.found}: {why}, so no gap can be measured against it; --accept-guesses, with a config and without "
            f"--model, takes guesses from mass and arms. {missing_flight(run, found_vehicle(run.found))}"
        )
    kept_aside = numbered_roles("held-out", held_out)
    unseen = dict(run.take(kept_aside, "diagnosis"))
    for caution in run.cautions_of("disagreement", "diagnosis"):
        run.caution(caution)
    check_ignored(run.study)
    for why in no_body(run.study):
        run.note(why)
    # Of a simulator's file the numbers are those that it states, and a model gives those that it leaves open.
    base = read_base(model if of_file is None else None, run.study)
    given, split = _flights(run, flights, held_out, base, [*(inputs[role] for role in trained), *unseen.values()])
    learned = learned_by(model)
    files = tuple(known_by(trained, inputs))
    given = with_seen(given, model, learned, files)
    if run.dry_run:
        return None
    study = run.study
    disagreement = compared(study, given, base, progress_of(run.progress, 0.0, 0.15), split.whole)
    disagreement = learned_from(run, replace(disagreement, files=files), learned, "disagreement")
    found = of_diagnosis.diagnosed(study, split, disagreement.warnings, base, progress_of(run.progress, 0.15, 0.85))
    found = replace(found, files=files)
    trained_on = {role: inputs[role] for role in trained}
    held = known_by(kept_aside, unseen)
    found = of_diagnosis.learned_from(run, found, trained_on, learned, held, model="disagreement.h5", of="diagnosis")
    if of_file is not None:
        found = _with_file(run, found, of_file, split)
    run.progress(0.85, 1, "extend")
    extension = None
    try:
        extension = extended(study, split.training, split.held_out, found, base)
    except ComputationError as error:
        found = replace(found, refused=str(error))
    if extension is not None:
        all_learned = joined_flights(found.learned_from({**trained_on, **unseen}), learned)
        extension = replace(extension, learned_from=all_learned)
        run.take_also(as_inputs("flight", all_learned), "extended")
    run.progress(0.97, 1, "report")
    answer = Gap(disagreement=disagreement, diagnosis=found, extended=extension)
    run.next.append(_next(run, answer, [*flights, *held_out], model))
    return answer


def _study_in(run: Run, file: Path, model: Path | None) -> Path:
    """Take the study that a vehicle was found with, and the vehicle for the model."""
    if model is not None:
        raise InputError(f"--model {model}: {file} is the model; give one of the two, with a config for --model")
    text = read_origin(file).config
    run.study = stored_study(text, file)
    run.with_config, run.config = True, run.output / _STUDY
    run.outputs.append(run.config)
    run.texts[run.config] = text
    return file


def _study_of(run: Run, file: Path, flights: Sequence[Path], model: Path | None) -> VehicleOf:
    """Make the study of a simulator's file and the logs that it is compared with."""
    found = model if model is not None and is_found(model) else None
    like = None if found is None else stored_study(read_origin(found).config, found).vehicle
    stated = Stated(model=taken(run, file, "simulator"), like=like)
    # Files that it includes may lie in the output folder, and none of them may be written over.
    assert stated.model is not None, "it was just read"
    names = stated.model.output_names.values()
    run.outputs += [run.output / name for name in (_STUDY, *names)]
    # One that is not there is said to be so before what the file does not state.
    logs = [path for path in flights if not (path.is_file() and format_name(path))]
    made, _, text = proposed(run, logs, stated)
    if made.asked or made.vehicle is None:
        raise InputError(
            f"{file}: does not state all that a gap needs; `cpfls init --from {file} LOG... -o study.yaml` writes a "
            f"config, then {made.edits}"
        )
    run.study = validate(parse_config(text, _STUDY), _STUDY)
    run.with_config, run.config = True, run.output / _STUDY
    run.texts[run.config] = text
    for warning in (*made.vehicle.warnings, *made.contradictions):
        run.note(warning)
    return made.vehicle


def _require_stated(run: Run, file: Path, of: VehicleOf) -> None:
    """Refuse a simulator's file that leaves numbers open where no model is there to give them."""
    open_ = [name for name in run.study.vehicle.unknown if name != "drag_factor" or not of.states_ratio]
    if open_:
        names = joined([name.replace("_", " ") for name in open_])
        raise InputError(
            f"{file}: does not state {names}, which a gap needs: `cpfls init --from {file} LOG... -o study.yaml`, then "
            f"`cpfls vehicle study.yaml LOG... -o vehicle.h5` with flights of this vehicle, then this command with "
            "--model vehicle.h5; or --accept-guesses for guesses from mass and arms"
        )


def _with_file(run: Run, found: Diagnosis, of: VehicleOf, split: FlightSplit) -> Diagnosis:
    """Put what was found into the simulator's file, and play held-out flights back in it."""
    vehicle = run.study.vehicle
    said, files = corrected(of, vehicle, found, split.training)
    run.texts.update({run.output / name: text for name, text in files.items()})
    if said.changes:
        run.last_words = f"; {joined([str(run.output / name) for name in files])}: your file, corrected"
    held, horizon = split.held_out, run.study.gap.horizon_s
    try:
        pairs = played(of, files, vehicle, split.training, held, run.study.gap)
        before_after = PlaybackChange.of_pairs(pairs, errors_by_horizon(pairs, horizon))
    except InputError as error:
        run.note(f"{of.model.file.name} as corrected is not played back: {visible(str(error))}")
        return replace(found, corrected=said)
    inside = in_simulator(of, files, vehicle, held, pairs, horizon)
    return replace(found, corrected=replace(said, flown=before_after, in_simulator=inside))


def _flights(
    run: Run, flights: Sequence[Path], held_out: Sequence[Path], base: VehicleModel, files: Sequence[InputFile]
) -> tuple[FlightSet, FlightSplit]:
    """Read all flights together, so that one battery is full in all of them, and split them."""
    read = read_flights([*flights, *held_out], run.study)
    balanced = with_known_wrench(read.flights, base)
    flown = tuple(of_vehicle(read.flights, base)) if has_effects(base) else tuple(balanced)
    split = split_flights(balanced[: len(flights)], balanced[len(flights) :], run.study.gap)
    # Those held out are behind those learned from, whoever chose them.
    known = list(map(known_flight, [*flights, *held_out], files))
    refuse_seen(known[: len(split.training)], known[len(split.training) :])
    return FlightSet(flown[: len(flights)], (*seen_twice(files), *read.warnings)), split


def _next(run: Run, found: Gap, flights: Sequence[Path], model: Path | None) -> Command:
    folder, output = run.output, run.sibling("replay.h5")
    to_replay: Command = ("cpfls", "replay", run.config, folder / "extended.h5", *flights, "-o", output)
    given = () if model is None else ("--model", model)
    to_answer = go_on(run, "response", *flights, *given, output=run.sibling("response.h5"))
    named = to_answer if found.extended is None else to_replay
    return of_diagnosis.next_command(run, found.diagnosis, named, to_answer, folder / "diagnosis.h5")
