"""Which flights a model learned from, and how much of each: one answer for every command and page that judges it."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Annotated, NamedTuple, Self

import numpy as np

from cpfls_cli.arrays import IntArray
from cpfls_cli.artifacts.spec import InputFile, dataset, record
from cpfls_cli.result import About

MODEL_FLIGHT = "model-flight"
"""Role of a flight that the model of a comparison or diagnosis learned from; of those compared it is ``flight``."""


class LearnedFlight(NamedTuple):
    """A flight that a model learned from."""

    name: Annotated[str, About("file name without its folder")]
    sha256: Annotated[str, About("hash of the file")]
    format: Annotated[str, About("format of the file, or its ending")]
    samples: Annotated[int | None, About("leading samples of it that were learned from")] = None
    of: Annotated[int | None, About("samples of it that were used: learned from or held out")] = None

    @classmethod
    def in_file(cls, file: InputFile, samples: int | None = None, of: int | None = None) -> Self:
        """Name a file."""
        return cls(file.name, file.sha256, file.format, samples, of)

    @property
    def file(self) -> InputFile:
        """The file."""
        return InputFile(self.name, self.sha256, self.format)

    @property
    def whole(self) -> bool:
        """Whether nothing of it is known to have been left out."""
        return self.samples == self.of


@record
class LearnedGroup:
    """How much of each flight a model learned from."""

    role: tuple[str, ...] = dataset("which of /inputs the flight is", "learned")
    samples: IntArray = dataset("leading samples of it that were learned from", "learned")
    of: IntArray = dataset("samples of it that were used: learned from or held out", "learned")

    @classmethod
    def parts(cls, roles: Iterable[str], parts: Sequence[tuple[int, int]]) -> Self:
        """Say of each flight how many samples were learned from, and of how many."""
        samples, of = np.array(parts, dtype=np.int64).reshape(-1, 2).T
        return cls(role=tuple(roles), samples=samples, of=of)

    def flights(self, inputs: Mapping[str, InputFile]) -> tuple[LearnedFlight, ...]:
        """List the flights, each with its file among the inputs of the artifact."""
        rows = zip(self.role, self.samples.tolist(), self.of.tolist(), strict=True)
        return tuple(LearnedFlight.in_file(inputs[role], samples, of) for role, samples, of in rows if role in inputs)


def as_inputs(role: str, flights: Sequence[LearnedFlight]) -> tuple[dict[str, InputFile], LearnedGroup | None]:
    """Make flights that were learned from inputs of another artifact, by numbered role, and tell how much of each.

    None for that where there are none, or an old file does not say.
    """
    inputs = {f"{role}-{number}": flight.file for number, flight in enumerate(flights, start=1)}
    parts = [(flight.samples, flight.of) for flight in flights if flight.samples is not None and flight.of is not None]
    known = bool(parts) and len(parts) == len(flights)
    return inputs, LearnedGroup.parts(inputs, parts) if known else None


def joined_flights(*groups: Iterable[LearnedFlight]) -> tuple[LearnedFlight, ...]:
    """List flights once each; of one that stands in several groups what was learned from most."""
    kept: dict[str, LearnedFlight] = {}
    for flight in (flight for group in groups for flight in group):
        known = kept.get(flight.sha256)
        if known is None or (known.samples or 0) < (flight.samples or 0):
            kept[flight.sha256] = flight
    return tuple(kept.values())


def learned_in(inputs: Mapping[str, InputFile], parts: LearnedGroup | None, role: str) -> tuple[LearnedFlight, ...]:
    """List the flights in a role, with how much of them was learned from where a file says so."""
    told = () if parts is None else parts.flights(inputs)
    files = [file for name, file in inputs.items() if name == role or name.startswith(f"{role}-")]
    return told or tuple(map(LearnedFlight.in_file, files))


def part_learned(learned: Iterable[LearnedFlight], hashes: Collection[str]) -> LearnedFlight | None:
    """Find what was learned from a flight of these hashes, its file's and its log's; None where nothing was."""
    return next((flight for flight in learned if flight.sha256 in hashes), None)
