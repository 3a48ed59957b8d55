"""Training data of a study: flights, each split, and where given reduced to a selection."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.artifacts.spec import InputFile
from cpfls_cli.config.study import Study
from cpfls_cli.errors import InputError
from cpfls_cli.files import read_content
from cpfls_cli.flights.flight_source import flight_source, part_of
from cpfls_cli.identification.data import Split, TorqueSource, gathered, joined, sample_times, split_flight
from cpfls_cli.reduction.selection import Selection
from cpfls_cli.regressor.regressor import Regressor, data_ranges, joined_ranges, uniform_breakpoints
from cpfls_cli.regressor.structure import model_structure
from cpfls_cli.store import Origin, read

REST = "held-out rest"
# Samples whose regressor is written out at a time.
_BLOCK = 4096
_FLIGHTS, _ARE = ("flight", "flights"), ("is", "are")


@dataclass(frozen=True)
class SplitFlights:
    """Flights, each with a leading part that trains and a rest that is held out."""

    paths: tuple[Path, ...]
    flights: tuple[TorqueSource, ...]
    splits: tuple[Split, ...]

    @property
    def training(self) -> TorqueSource:
        """The parts that train, one after the other."""
        return joined(
            [part_of(flight, split.training) for flight, split in zip(self.flights, self.splits, strict=True)]
        )

    @property
    def training_indices(self) -> IntArray:
        """Indices of the samples that train among all samples of the flights, one after the other."""
        starts = np.cumsum([0, *(len(flight) for flight in self.flights)])
        return np.concatenate(
            [start + np.arange(split.training.stop) for start, split in zip(starts, self.splits, strict=False)]
        )

    @property
    def parts(self) -> tuple[tuple[int, int], ...]:
        """Of each flight, the leading samples that train, and all samples."""
        return tuple(
            (split.training.stop, len(flight)) for flight, split in zip(self.flights, self.splits, strict=True)
        )

    @property
    def rests(self) -> dict[str, TorqueSource]:
        """The parts that are held out, by name."""
        several = len(self.paths) > 1
        return {
            f"{REST} of {path.name}" if several else REST: part_of(flight, split.held_out)
            for path, flight, split in zip(self.paths, self.flights, self.splits, strict=True)
            if split.held_out.stop > split.held_out.start
        }


@dataclass(frozen=True)
class TrainingData:
    """What a model is learned from and judged on.

    Attributes
    ----------
    training : TorqueSource
        All that trains: judges chromosomes, and gives the input ranges.
    learned : TorqueSource
        The samples of it that parameters are learned from.
    rests : mapping of str to TorqueSource
        What of the flights is held out, by name.
    indices : array of int, shape (learned samples,)
        Of the learned samples among all samples of the flights, one flight after the other; ascending.
    parts : tuple of (int, int)
        Of each flight, the leading samples that train, and all samples.
    """

    training: TorqueSource
    learned: TorqueSource
    rests: Mapping[str, TorqueSource]
    indices: IntArray
    parts: tuple[tuple[int, int], ...]


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
) -> TrainingData:
    """Open flights and find what of them trains, all or what was selected from these very flights."""
    split = split_training(flights, study, inputs)
    training, candidates = split.training, split.training_indices
    if selection is None:
        return TrainingData(training, training, split.rests, candidates, split.parts)
    indices = _selected(_hashed(flights, inputs), selection, candidates)
    learned = gathered(training, np.searchsorted(candidates, indices))
    return TrainingData(training, learned, split.rests, indices, split.parts)


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
            f"{_ARE[len(roles) > 1]} given; "
            f"run `cpfls reduce` on {names}"
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
