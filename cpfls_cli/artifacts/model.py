"""What every model of a vehicle answers, whoever found it, and what it learned from."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Annotated, ClassVar, NamedTuple, Self

import numpy as np

from cpfls_cli.artifacts.gate import InputFile
from cpfls_cli.inertia import INERTIA_PARAMETERS, beyond_any_body, more_than_others
from cpfls_cli.result import About
from cpfls_cli.rounding import less
from cpfls_cli.validation.trust import Trust

if TYPE_CHECKING:
    from cpfls_cli.playback.model import VehicleModel


MODEL_FLIGHT = "model-flight"
"""Role of a flight that the model of a comparison or diagnosis learned from; of those compared it is ``flight``."""


class LearnedFlight(NamedTuple):
    """A flight that a model learned from."""

    name: Annotated[str, About("file name without its folder")]
    sha256: Annotated[str, About("hash of the file")]
    format: Annotated[str, About("format of the file, or its ending")]
    samples: Annotated[int | None, About("leading samples of it that were learned from")] = None
    of: Annotated[int | None, About("samples of it that were used: learned from or held out")] = None
    log: Annotated[str, About("hash of the log that it was imported from; empty where it is one")] = ""
    begins: Annotated[float, About("begin of it, from the first stamp of that log", unit="s")] = 0.0
    ends: Annotated[float, About("end of it, likewise", unit="s")] = 0.0

    @classmethod
    def in_file(cls, file: InputFile, samples: int | None = None, of: int | None = None) -> Self:
        """Name a file."""
        return cls(file.name, file.sha256, file.format, samples, of)

    def shared_with(self, other: LearnedFlight) -> tuple[float, float] | None:
        """Give the stretch, s, that is also in another flight: of the log that both are from, or of all time."""
        if self.sha256 in (other.sha256, other.log) or self.log == other.sha256:
            return -np.inf, np.inf
        if not self.log or self.log != other.log:
            return None
        begin, end = max(self.begins, other.begins), min(self.ends, other.ends)
        # One stretch may end where the next begins, and stamps on a clock of steps are no exact numbers.
        return (begin, end) if less(begin, end) else None

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
    """List flights once each; of one in several groups what was learned from most, and its log if any knows it."""
    kept: dict[str, LearnedFlight] = {}
    for flight in (flight for group in groups for flight in group):
        known = kept.get(flight.sha256, flight)
        most = flight if (known.samples or 0) < (flight.samples or 0) else known
        of_log = known if known.log else flight
        kept[flight.sha256] = most._replace(log=of_log.log, begins=of_log.begins, ends=of_log.ends)
    return tuple(kept.values())


def of_no_body(model: VehicleModel) -> tuple[str, ...]:
    """Name the moments of inertia of a vehicle that are those of no body of its mass between its rotors."""
    vehicle = model.vehicle
    pairs = zip(INERTIA_PARAMETERS[:3], vehicle.inertia_kg_m2, strict=False)
    moments = {f"inertia.{name}": value for name, value in pairs}
    excess = {f"inertia.{name}" for name in more_than_others(list(moments.values()))}
    hubs = np.array([rotor.position_m for rotor in vehicle.rotors])
    wrong = {*beyond_any_body(vehicle.mass_kg, hubs, moments), *excess}
    return tuple(name for name in moments if name in wrong)


class AnyModel:
    """What every model of a vehicle answers, whoever found it."""

    MADE_BY: ClassVar[str]
    """Command that makes it."""
    if TYPE_CHECKING:
        # Of a result it is a field, whose kind the class says that has it.
        model: VehicleModel

    @property
    def learned_from(self) -> tuple[LearnedFlight, ...]:
        """Flights that it was found in, those of what it was built on among them."""
        return ()

    @property
    def trust(self) -> str:
        """How far to trust it, a word of `Trust`; of a file by a newer program possibly another."""
        return Trust.NOT_JUDGED

    @property
    def judged_as(self) -> dict[str, str]:
        """How far to trust it, by what it is judged as; the word of the last is that of whoever takes it elsewhere."""
        return {"": self.trust}

    @property
    def stopped(self) -> str:
        """Why the search for it ended before its end; empty where it did not."""
        return ""

    @property
    def impossible(self) -> tuple[str, ...]:
        """Numbers of it that no such vehicle has, by the names of a fit."""
        return ()
