"""How the artifacts of a report were made, how those that it lacks are made, and where everything comes from."""

from __future__ import annotations

import shlex
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from cpfls_cli.artifacts.changed import ChangedRecord
from cpfls_cli.artifacts.diagnosis import DiagnosisRecord
from cpfls_cli.artifacts.disagreement import DisagreementRecord
from cpfls_cli.artifacts.extended import ExtendedRecord
from cpfls_cli.artifacts.flight import FlightRecord
from cpfls_cli.artifacts.identified import IdentifiedRecord
from cpfls_cli.artifacts.prediction import PredictionRecord
from cpfls_cli.artifacts.replay import USUAL, VEHICLE, ReplayRecord
from cpfls_cli.artifacts.response import ResponseRecord
from cpfls_cli.artifacts.spec import InputFile, Record
from cpfls_cli.artifacts.sweep import SweepRecord
from cpfls_cli.artifacts.trajectory import TrajectoryRecord
from cpfls_cli.artifacts.trend import TrendRecord
from cpfls_cli.artifacts.twin import TwinRecord
from cpfls_cli.artifacts.vehicle_model import VehicleRecord
from cpfls_cli.config.unknown import needs_numbers
from cpfls_cli.pages.source import Source, Sources
from cpfls_cli.reduction.selection import Selection
from cpfls_cli.report.content import HASH_SHOWN, Block, Listing, Section, Table, Text
from cpfls_cli.tuning.vehicle import Gains

_REPEAT = (
    "To make these artifacts again, save each config below, as it is, under the name that stands before it, and run "
    "these commands in the same folder. With the same versions of cpfls and of the libraries under it every file comes "
    "out equal, byte for byte."
)


def provenance_section(sources: Sources) -> Section:
    """List the artifacts with their hashes, inputs and configs."""
    blocks: list[Block] = [
        Table(
            "artifacts",
            "The artifacts of this report, by the SHA-256 of the file.",
            ("File", "Format", "cpfls", "Seed", "SHA-256 of the file", "SHA-256 of the config"),
            [_artifact(source) for source in sources.all],
            frozenset({0, 1, 2, 4, 5}),
            frozenset({4, 5}),
        )
    ]
    inputs = [row for source in sources.all for row in _inputs(source, sources)]
    if inputs:
        header = ("File", "Role", "Made from", "Format", "SHA-256", "In this report")
        caption = "The files that they were made from."
        blocks.append(Table("inputs", caption, header, inputs, frozenset(range(6)), frozenset({2, 4})))
    blocks.append(Text(_REPEAT))
    blocks.append(Listing("Commands to repeat", "\n".join(_commands(sources)), shown=True))
    for config in dict.fromkeys(source.header.config for source in sources.all):
        users = [source for source in sources.all if source.header.config == config]
        names = ", ".join(source.label for source in users)
        blocks.append(Listing(f"{_config_name(users[0])}: config of {names}", config))
    return Section("provenance", "Provenance", blocks)


def _artifact(source: Source) -> list[str]:
    header = source.header
    return [source.label, source.format, header.version, str(header.seed), source.sha256, source.config_sha256]


def _inputs(source: Source, sources: Sources) -> list[list[str]]:
    return [
        [source.label, role, file.name, file.format, file.sha256, "yes" if sources.by_hash(file.sha256) else "no"]
        for role, file in source.header.inputs.items()
    ]


def _config_name(source: Source) -> str:
    """Name the file that the config of an artifact is saved as."""
    return f"study-{source.config_sha256[:HASH_SHOWN]}.yaml"


@dataclass(frozen=True)
class _Command:
    """How a command is called: its name, the roles that are arguments, and those that are options."""

    name: str
    arguments: tuple[str, ...]
    options: tuple[str, ...] = ()


_COMMANDS: dict[type, _Command] = {
    Selection: _Command("reduce", ("flight",)),
    TrajectoryRecord: _Command("trajectory", (), ("waypoints",)),
    FlightRecord: _Command("simulate", ("trajectory",), ("model",)),
    IdentifiedRecord: _Command("identify", ("flight",), ("selection", "validate", "choose-on")),
    SweepRecord: _Command("sweep", ("flight",), ("validate", "choose-on")),
    PredictionRecord: _Command("predict", ("model", "flight")),
    ReplayRecord: _Command("replay", ("model", "flight")),
    TwinRecord: _Command("simulate", ("flight",), ("model",)),
    ResponseRecord: _Command("response", ("flight",), ("model",)),
    Gains: _Command("tune", ("model",), ("flight",)),
    DisagreementRecord: _Command("compare", ("flight",), ("model",)),
    DiagnosisRecord: _Command("diagnose", ("disagreement",), ("held-out",)),
    ExtendedRecord: _Command("extend", ("diagnosis",), ("model",)),
    ChangedRecord: _Command("changed", ("today",), ("since",)),
    TrendRecord: _Command("trend", ("flight",)),
    VehicleRecord: _Command("vehicle", ("flight",), ("held-out",)),
}
_IMPORT = _Command("import", ("log",))


def _commands(sources: Sources) -> list[str]:
    """Write the commands that make all artifacts of a report again, in an order that works.

    An artifact holds the names of its inputs, so that equal bytes need equal names.

    Returns
    -------
    list of str
        Lines for a shell; what cannot be known stands in comments.
    """
    paths = _paths(sources)
    # What the commands read and the report does not hold.
    needed = {file.sha256: file for source in sources.all for file in _read(source)}
    foreign = [
        f"# needs {shlex.quote(file.name)}, sha256 {sha256}"
        for sha256, file in needed.items()
        if sources.by_hash(sha256) is None
    ]
    folders = sorted({path.rsplit("/", 1)[0] for path in paths.values() if "/" in path})
    lines = [line for source in _in_order(sources.all) for line in _lines(source, paths)]
    return [*foreign, *(f"mkdir -p {folder}" for folder in folders), *lines]


def _paths(sources: Sources) -> dict[str, str]:
    """Name every artifact as those that were made from it call it; equal names go into folders of their own."""
    called = {file.sha256: file.name for source in sources.all for file in source.header.inputs.values()}
    labels = {source.sha256: source.label.rpartition("/")[2] for source in sources.all}
    names = {sha256: called.get(sha256, label) for sha256, label in labels.items()}
    count = Counter(names.values())
    return {sha256: name if count[name] == 1 else f"{sha256[:HASH_SHOWN]}/{name}" for sha256, name in names.items()}


def _read(source: Source) -> list[InputFile]:
    """List the inputs that are arguments or options of a command; others were handed on with one of these."""
    inputs, command = source.header.inputs, _command(source)
    roles = () if command is None else (*command.arguments, *command.options)
    return [inputs[name] for role in roles for name in _of_role(inputs, role)]


def _command(source: Source) -> _Command | None:
    return _IMPORT if "log" in source.header.inputs else _COMMANDS.get(type(source.record))


def _in_order(given: Sequence[Source]) -> Iterator[Source]:
    """Put every artifact behind those that it was made from."""
    remaining = list(given)
    while remaining:
        waiting = {source.sha256 for source in remaining}
        inputs = {source.sha256: {file.sha256 for file in source.header.inputs.values()} for source in remaining}
        ready = next((source for source in remaining if not inputs[source.sha256] & waiting), remaining[0])
        remaining.remove(ready)
        yield ready


def _lines(source: Source, paths: dict[str, str]) -> Iterator[str]:
    inputs, command = source.header.inputs, _command(source)
    output = shlex.quote(paths[source.sha256])
    if command is None:
        yield f"# {output}: no command is known that makes it"
        return
    if isinstance(source.record, IdentifiedRecord | VehicleRecord) and not source.record.complete:
        yield f"# the search for {output} was stopped before its end; this one goes on to it"
    words = ["cpfls", command.name, _config_name(source)]
    for role in command.arguments:
        # Of a replay of the vehicle of the config a word stands in the place of the model.
        of_config = [VEHICLE] if isinstance(source.record, ReplayRecord) and role == "model" else []
        words += _files(inputs, role, paths) or of_config
    for role in command.options:
        for file in _files(inputs, role, paths):
            words += [f"--{role}", file]
    # What its config leaves open stands there as it was taken.
    words += ["--accept-guesses"] if needs_numbers(source.vehicle, command.name) and "model" not in inputs else []
    yield " ".join([*words, *_asked(source.record), "-o", output])


def _asked(record: Record) -> list[str]:
    """Give the options that are no files."""
    if isinstance(record, Gains):
        asked = {"gain": record.asked.gain_db, "phase": record.asked.phase_deg, "disk": record.asked.disk_deg}
        margins = [word for name, value in asked.items() for word in (f"--{name}-margin", f"{value:g}")]
        return ["--autopilot", record.autopilot, *margins]
    if not isinstance(record, ReplayRecord):
        return []
    hold = [] if record.hold == USUAL else ["--hold", record.hold]
    return ["--horizon", repr(record.asked_s), "--every", str(record.every), *hold]


def _files(inputs: Mapping[str, InputFile], role: str, paths: dict[str, str]) -> list[str]:
    return [shlex.quote(paths.get(inputs[name].sha256, inputs[name].name)) for name in _of_role(inputs, role)]


def _of_role(inputs: Mapping[str, InputFile], role: str) -> list[str]:
    """List the inputs of a role, which have numbers where there are several."""
    numbers = {name: name.removeprefix(role).removeprefix("-") or "1" for name in inputs if name.startswith(role)}
    return sorted((name for name, number in numbers.items() if number.isdigit()), key=lambda name: int(numbers[name]))


_Lack = tuple[type, str, str]
_LACKS: tuple[_Lack, ...] = (
    (TrajectoryRecord, "Figure 2 and the table of peaks", "cpfls trajectory CONFIG -o trajectory.h5"),
    (
        FlightRecord,
        "Figure 4 and the quality of the flight",
        "cpfls simulate CONFIG trajectory.h5 -o flight.h5, or cpfls import CONFIG LOG -o flight.h5",
    ),
    (Selection, "Table 4 and Figure 5", "cpfls reduce CONFIG flight.h5 -o selection.h5"),
    (IdentifiedRecord, "Table 5, the baselines, Figure 6 and the rules", "cpfls identify CONFIG flight.h5 -o model.h5"),
    (
        PredictionRecord,
        "Figure 7 and the inertia matrix along a flight",
        "cpfls predict CONFIG model.h5 flight.h5 -o prediction.h5",
    ),
)
_GAP_LACKS: tuple[_Lack, ...] = (
    (
        DisagreementRecord,
        "where and when model and flights disagree",
        "cpfls compare CONFIG FLIGHT... -o disagreement.h5",
    ),
    (DiagnosisRecord, "what the model misses", "cpfls diagnose CONFIG disagreement.h5 -o diagnosis.h5"),
    (ExtendedRecord, "the model with the effects in it", "cpfls extend CONFIG diagnosis.h5 -o extended.h5"),
)
_SHOWN = {"extended": "extended model"}


def missing(sources: Sources) -> dict[str, str]:
    """Name the formats of which no artifact was given.

    Returns
    -------
    dict of str to str
        One sentence by format, such as ``selection``: what is not shown, and the command that makes it.
    """
    given = {type(source.record) for source in sources.all}
    lacking = {_word(wanted): (shows, command) for wanted, shows, command in _wanted(sources) if wanted not in given}
    return {
        word: f"Not shown, because no {_SHOWN.get(word, word)} was given: {shows}; made by: {command}."
        for word, (shows, command) in lacking.items()
    }


def _wanted(sources: Sources) -> Iterator[_Lack]:
    """List what a report of these artifacts could show: nobody who looks for a gap wants a training path."""
    if not sources.only_gap:
        yield from _LACKS
    if sources.gap:
        yield from _GAP_LACKS[:2]
        if any(diagnosis.record.effects.names() for diagnosis in sources.diagnoses):
            yield _GAP_LACKS[2]


def _word(wanted: Any) -> str:
    kind = getattr(wanted.FORMAT, "kind", "")
    name = getattr(wanted.FORMAT, "name", wanted.FORMAT)
    return str(name).removeprefix("cpfls/") if kind in ("", "identified") else str(kind)
