"""Which flights a model learned from, and how much of each: one answer for every command and page that judges it."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from typing import Annotated, NamedTuple, Self

from cpfls_cli.artifacts.spec import InputFile
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


def as_inputs(role: str, flights: Sequence[LearnedFlight]) -> dict[str, InputFile]:
    """Make flights that were learned from inputs of another file, by numbered role."""
    return {f"{role}-{number}": flight.file for number, flight in enumerate(flights, start=1)}


def joined_flights(*groups: Iterable[LearnedFlight]) -> tuple[LearnedFlight, ...]:
    """List flights once each; of one that stands in several groups what was learned from most."""
    kept: dict[str, LearnedFlight] = {}
    for flight in (flight for group in groups for flight in group):
        known = kept.get(flight.sha256)
        if known is None or (known.samples or 0) < (flight.samples or 0):
            kept[flight.sha256] = flight
    return tuple(kept.values())


def part_learned(learned: Iterable[LearnedFlight], hashes: Collection[str]) -> LearnedFlight | None:
    """Find what was learned from a flight of these hashes, its file's and its log's; None where nothing was."""
    return next((flight for flight in learned if flight.sha256 in hashes), None)
