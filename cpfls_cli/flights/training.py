"""Training data of a study: flights whole or chunk by chunk, each split, and reduced to a selection where given."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain, count, product
from pathlib import Path

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.artifacts.gate import InputFile, format_name, read_origin
from cpfls_cli.artifacts.model import LearnedFlight
from cpfls_cli.config.load import parse_config
from cpfls_cli.config.study import Study
from cpfls_cli.consistency.check import ENOUGH
from cpfls_cli.consistency.findings import Finding
from cpfls_cli.errors import ConfigError, InputError
from cpfls_cli.files import read_content
from cpfls_cli.flightlog.results import MOTION, Flight
from cpfls_cli.flightlog.settings import SETPOINTS
from cpfls_cli.flights.recordings import ReadFlight, check_flight, read_flight, units_of
from cpfls_cli.identification.data import (
    CHUNK,
    TRAINING,
    Split,
    TorqueData,
    TorqueSource,
    gathered,
    joined,
    sample_times,
    split_flight,
)
from cpfls_cli.logs.formats import is_log
from cpfls_cli.reduction.training_set import Selection
from cpfls_cli.regressor.regressor import Motion, Regressor, data_ranges, joined_ranges, uniform_breakpoints
from cpfls_cli.regressor.structure import model_structure
from cpfls_cli.store import IN_MEMORY, Origin, check_rows, count_rows, held_rows, read, read_rows

_NEEDED = ("time", *MOTION)
_TORQUE = "torque"
_ROTORS = ("rotor-speed", "rotor-command")


@dataclass(frozen=True)
class FlightFile:
    """Samples, from `start` to before `stop`, that stay in their file.

    The path is absolute, because workers may read it too; `names` are paths of datasets: time, motion and, where it is
    asked for, torque. Size and rows are those of the file as it was opened; whoever reads it elsewhere, or later, must
    find the same.
    """

    path: Path
    names: tuple[str, ...]
    start: int
    stop: int
    size_bytes: int
    rows: int

    def __len__(self) -> int:
        """Count the samples."""
        return self.stop - self.start

    def chunks(self) -> Iterator[TorqueData]:
        """Yield the samples, `CHUNK` at a time."""
        self._require_same_file()
        for rows in read_rows(self.path, self.names, self.start, self.stop, CHUNK):
            yield _torque_data(rows)

    def _require_same_file(self) -> None:
        if not self.path.is_file():
            fault = "no such file"
        elif (size := self.path.stat().st_size) != self.size_bytes:
            fault = f"another file, with {size} bytes instead of {self.size_bytes}"
        elif (rows := count_rows(self.path, Flight, self.names[0])) != self.rows:
            fault = f"another file, with {rows or 'no'} samples instead of {self.rows}"
        else:
            return
        raise InputError(
            f"{self.path}: {fault}; the workers of a scheduler also read a flight of more than {IN_MEMORY} samples "
            "from its file: put the same file there on each of their machines, and leave it unchanged"
        )


def flight_source(path: Path, *, torque: bool = True) -> TorqueSource:
    """Open a flight."""
    names = (*_NEEDED, _TORQUE) if torque else _NEEDED
    samples = count_rows(path, Flight, "time")
    if samples is None or samples <= IN_MEMORY:
        flight, _ = read(path, Flight)
        require_signals(path, flight.signals, *names)
        asked = {short: flight.signals[name] for name, short in SETPOINTS.items() if name in flight.signals}
        columns: dict[str, Array] = {name: own.reshape(len(own), -1) for name, own in asked.items()}
        return replace(_torque_data([getattr(flight, name) for name in names]), setpoints=columns)
    require_signals(path, held_rows(path, Flight), *names)
    check_rows(path, Flight, names)
    return FlightFile(path.resolve(), names, 0, samples, path.stat().st_size, samples)


def _torque_data(rows: Sequence[Array]) -> TorqueData:
    time, attitude, rate, acceleration = rows[: len(_NEEDED)]
    torque = rows[len(_NEEDED)] if len(rows) > len(_NEEDED) else np.zeros_like(attitude)
    return TorqueData(time, Motion(attitude, rate, acceleration), torque)


def require_signals(path: Path, held: Container[str], *needed: str) -> None:
    """Refuse a flight that lacks what is needed."""
    missing = [name for name in needed if name not in held]
    rotors = [name for name in ("rotor_speed", "rotor_command") if name in held]
    remedy = ""
    if missing == [_TORQUE] and rotors:
        remedy = (
            f"; import its log again with --set import.torque_source={rotors[0].replace('_', '-')}, and with --model "
            "VEHICLE.h5 of `cpfls vehicle` where the config does not know the factors of the rotors"
        )
    if missing:
        raise InputError(f"{path}: lacks {', '.join(missing)}; this stage needs {', '.join(needed)}{remedy}")


def part_of(source: TorqueSource, samples: slice) -> TorqueSource:
    """Take consecutive samples of a flight, a slice with a start and a stop."""
    if isinstance(source, FlightFile):
        return replace(source, start=source.start + samples.start, stop=source.start + samples.stop)
    assert isinstance(source, TorqueData)
    return source[samples]


def check_file(path: Path, study: Study) -> tuple[Finding, ...]:
    """Hold a flight against itself, its middle where it stays in its file; nothing of a flight of another vehicle.

    What drives it is held against the vehicle of the config where its rotors give its torque.
    """
    try:
        return check_flight(_enough_of(path, study), study, driven=torque_source_of(path, study) in _ROTORS)
    except InputError:
        return ()


def torque_source_of(path: Path, study: Study) -> str:
    """Say what gives the torque of a log, or of a flight that was imported; empty for one that was simulated."""
    if is_log(path):
        return study.import_.torque_source or ""
    made = read_origin(path)
    config = parse_config(made.config, f"{path}: /config")
    return str(config["import"]["torque_source"] or "") if "log" in made.inputs else ""


def _enough_of(path: Path, study: Study) -> ReadFlight:
    samples = None if is_log(path) else count_rows(path, Flight, "time")
    if samples is None or samples <= IN_MEMORY:
        return read_flight(path, study)
    names, first = held_rows(path, Flight), (samples - ENOUGH) // 2
    units = units_of(path, read_origin(path), study)
    (rows,) = read_rows(path, names, first, first + ENOUGH, ENOUGH)
    return ReadFlight(path.name, dict(zip(names, rows, strict=True)), units, ())


REST = "held-out rest"
# Samples whose regressor is written out at a time.
_BLOCK = 4096
_FLIGHTS, _ARE = ("flight", "flights"), ("is", "are")


@dataclass(frozen=True)
class SplitFlights:
    """Flights, each with a leading part that trains and a rest that is held out.

    `selected`: indices of samples that are learned from among all samples of the flights, one flight after the other;
    ascending, None for all that train.
    """

    paths: tuple[Path, ...]
    flights: tuple[TorqueSource, ...]
    splits: tuple[Split, ...]
    selected: IntArray | None = None

    @cached_property
    def training(self) -> TorqueSource:
        """The parts that train, one after the other: they judge chromosomes, and give the input ranges."""
        return joined(
            [part_of(flight, split.training) for flight, split in zip(self.flights, self.splits, strict=True)]
        )

    @cached_property
    def training_indices(self) -> IntArray:
        """Indices of the samples that train among all samples of the flights, one after the other."""
        starts = np.cumsum([0, *(len(flight) for flight in self.flights)])
        return np.concatenate(
            [start + np.arange(split.training.stop) for start, split in zip(starts, self.splits, strict=False)]
        )

    @property
    def indices(self) -> IntArray:
        """Indices of the samples that are learned from, as of those that train."""
        return self.training_indices if self.selected is None else self.selected

    @cached_property
    def learned(self) -> TorqueSource:
        """The samples that parameters are learned from."""
        if self.selected is None:
            return self.training
        return gathered(self.training, np.searchsorted(self.training_indices, self.selected))

    @property
    def parts(self) -> tuple[tuple[int, int], ...]:
        """Of each flight, the leading samples that train, and all samples."""
        return tuple(
            (split.training.stop, len(flight)) for flight, split in zip(self.flights, self.splits, strict=True)
        )

    @cached_property
    def rests(self) -> dict[str, TorqueSource]:
        """The parts that are held out, by name."""
        several = len(self.paths) > 1
        return {
            f"{REST} of {path.name}" if several else REST: part_of(flight, split.held_out)
            for path, flight, split in zip(self.paths, self.flights, self.splits, strict=True)
            if split.held_out.stop > split.held_out.start
        }


def flight_roles(flights: Sequence[Path]) -> dict[str, Path]:
    """Give the flights that train their roles as inputs: ``flight``, ``flight-2`` and so on."""
    return {"flight" if number == 1 else f"flight-{number}": path for number, path in enumerate(flights, start=1)}


def split_training(
    flights: Sequence[Path], study: Study, inputs: Mapping[str, InputFile] | None = None, *, torque: bool = True
) -> SplitFlights:
    """Open flights and split each as the study says."""
    _refuse_twice(flights, inputs)
    settings, sources = study.identification, [flight_source(path, torque=torque) for path in flights]
    splits = [split_flight(sample_times(source), settings.training_share, settings.embargo_s) for source in sources]
    return SplitFlights(tuple(flights), tuple(sources), tuple(splits))


def read_training(
    flights: Sequence[Path], selection: Path | None, study: Study, inputs: Mapping[str, InputFile] | None = None
) -> SplitFlights:
    """Open flights and find what of them trains, all or what was selected from these very flights."""
    split = split_training(flights, study, inputs)
    if selection is None:
        return split
    return replace(split, selected=_selected(_hashed(flights, inputs), selection, split.training_indices))


def _hashed(flights: Sequence[Path], inputs: Mapping[str, InputFile] | None) -> dict[Path, str]:
    roles = flight_roles(flights)
    return {path: inputs[role].sha256 if inputs else read_content(path).sha256 for role, path in roles.items()}


def _refuse_twice(flights: Sequence[Path], inputs: Mapping[str, InputFile] | None) -> None:
    known: dict[str, Path] = {}
    hashes = _hashed(flights, inputs) if len(flights) > 1 else {}
    for path in flights if hashes else ():
        if known.setdefault(hashes[path], path) is not path:
            raise InputError(f"{path}: holds the same flight as {known[hashes[path]]}; give each flight once")


def _selected(flights: Mapping[Path, str], selection: Path, candidates: IntArray) -> IntArray:
    chosen, origin = read(selection, Selection)
    _require_made_from(flights, selection, origin)
    indices = np.unique(chosen.indices)
    if len(indices) == 0 or len(indices) != len(chosen.indices):
        raise InputError(f"{selection}: indices is empty or has repeats; run `cpfls reduce` again")
    if not np.isin(indices, candidates).all():
        raise InputError(
            f"{selection}: selects samples other than the {len(candidates)} training samples; "
            "identification.training_share has changed since: run `cpfls reduce` again"
        )
    return indices


def _require_made_from(flights: Mapping[Path, str], selection: Path, origin: Origin) -> None:
    sources = {role: source for role, source in origin.inputs.items() if role.startswith("flight")}
    roles = flight_roles(list(flights))
    names = " ".join(str(path) for path in flights)
    if len(sources) != len(roles):
        raise InputError(
            f"{selection}: was made from {len(sources)} {_FLIGHTS[len(sources) > 1]}, and {len(roles)} "
            f"{_ARE[len(roles) > 1]} given; run `cpfls reduce` on {names}"
        )
    for role, path in roles.items():
        source = sources.get(role)
        if source is None or source.sha256 != flights[path]:
            name = source.name if source else "an unknown flight"
            raise InputError(
                f"{selection}: was made from another flight ({name}, sha256 differs from {path}); "
                f"run `cpfls reduce` on {names}"
            )


def uniform_regressor(training: TorqueSource, study: Study) -> Callable[[], Iterator[Array]]:
    """Write out the regressor at uniform partitions, block by block, as often as what is given is called."""
    structure = model_structure(study.identification)
    partitions = uniform_breakpoints(structure)
    ranges = joined_ranges(data_ranges(structure, data.motion.attitude) for data in training.chunks())

    def blocks() -> Iterator[Array]:
        for data in training.chunks():
            for start in range(0, len(data), _BLOCK):
                yield Regressor(structure, data.motion[start : start + _BLOCK], ranges).matrix(partitions)

    return blocks


def numbered_roles(role: str, flights: Sequence[Path]) -> dict[str, Path]:
    """Give flights of one role numbers: ``choose-on-1``, ``choose-on-2`` and so on."""
    return {f"{role}-{number}": path for number, path in enumerate(flights, start=1)}


def known_flight(path: Path, file: InputFile) -> LearnedFlight:
    """Name a flight by its file, the log that it was imported from, and the stretch of that."""
    log = None if is_log(path) else read_origin(path).inputs.get("log")
    known = LearnedFlight.in_file(file)
    if log is None:
        return known
    ((begin, end),) = next(read_rows(path, ("span_s",), 0, 2, 2))
    return known._replace(log=log.sha256, begins=float(begin), ends=float(end))


def known_by(paths: Mapping[str, Path], inputs: Mapping[str, InputFile]) -> list[LearnedFlight]:
    """Name flights once each."""
    return list(dict.fromkeys(known_flight(path, inputs[role]) for role, path in paths.items()))


def refuse_seen(learned: Iterable[LearnedFlight], held_out: Iterable[LearnedFlight]) -> None:
    """Refuse to judge on a flight that is learned from, as a whole or in a part of the log that it is from."""
    for flight, other in product(held_out, learned):
        shared = flight.shared_with(other)
        if shared is None:
            continue
        if np.isfinite(shared).all() and shared != (flight.begins, flight.ends):
            raise InputError(
                f"{flight.name}: holds {shared[0]:.1f} to {shared[1]:.1f} s of the log that {other.name} is from too, "
                "which is learned from; part the two by import.crop_s, or hold out another flight"
            )
        also = "" if other.name == flight.name else f" (as {other.name})"
        raise InputError(
            f"{flight.name}: is both learned from{also} and held out, so nothing would be judged; leave it out of "
            "one of them, or hold out another flight"
        )


def once(given: Mapping[str, Path], inputs: Mapping[str, InputFile]) -> tuple[dict[str, Path], list[str]]:
    """Leave out copies of a flight; one that is of today and of the reference is refused."""
    known: dict[str, str] = {}
    kept, warnings = {}, []
    for role, path in given.items():
        own = known_flight(path, inputs[role])
        hashes = [each for each in (own.sha256, own.log) if each]
        same = next((known[each] for each in hashes if each in known), None)
        if same is None:
            kept[role] = path
            known.update(dict.fromkeys(hashes, role))
        elif same.partition("-")[0] != role.partition("-")[0]:
            also = "" if given[same].name == path.name else f", as {given[same]}"
            raise InputError(
                f"{path}: is both a flight of today and one of the reference (--reference){also}; leave it out of one"
            )
        else:
            warnings.append(f"{path.name}: is given twice, also as {given[same].name}; counted once")
    return kept, warnings


def log_formats(paths: Sequence[Path]) -> set[str]:
    """Gather the endings, in small letters, of the logs among some files, and of those that flights were made from."""
    known = {path.suffix.lstrip(".").lower() for path in paths if is_log(path)}
    flights = (path for path in paths if format_name(path) == Flight.FORMAT)
    made = (read_origin(path).inputs.get("log") for path in flights)
    return known | {"" if log is None else log.format.lower() for log in made}


def choosing_source(flights: Sequence[Path], known: Mapping[str, LearnedFlight]) -> TorqueSource | None:
    """Open the flights to choose on, None where there are none; a model was fitted to what is another input too."""
    for role, path in numbered_roles("choose-on", flights).items():
        others = {other: file for other, file in known.items() if other != role}
        same = next((other for other, file in others.items() if known[role].shared_with(file)), None)
        if same is not None:
            raise InputError(f"--choose-on {path}: {_USED[same.partition('-')[0]]}; choose on another flight")
    return joined([flight_source(path) for path in flights]) if flights else None


_USED = {
    "flight": "is a training flight",
    "selection": "is the selection, not a flight",
    "validate": "judges (--validate)",
    "choose": "is given twice",
}


def held_out_parts(
    study: Study, rests: Mapping[str, TorqueSource], known: Mapping[str, LearnedFlight], validate: Sequence[Path]
) -> dict[str, TorqueSource]:
    """Gather what is judged but not learned from, under names of their own: rests of flights that train, and others."""
    if study.identification.training_share < 1 and not rests:
        raise ConfigError(
            f"identification.embargo_s = {study.identification.embargo_s:g}: leaves nothing of the flight to be "
            "held out; lower it, or lower identification.training_share"
        )
    parts = dict(rests)
    refuse_seen(*([own for role, own in known.items() if role.startswith(kind)] for kind in ("flight", "validate")))
    for path in validate:
        names = chain([path.name], (f"{path.name} ({number})" for number in count(2)))
        parts[next(name for name in names if name not in {TRAINING, *parts})] = flight_source(path)
    return parts
