"""The artifacts that a report is about."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Generic

from typing_extensions import TypeVar

from cpfls_cli.config.study import ReportSettings
from cpfls_cli.report.source import Source as Source
from cpfls_cli.vehicle.settings import VehicleSettings

if TYPE_CHECKING:
    # A page loads the records that it is about, not all others.
    from cpfls_cli.artifacts.diagnosis import Diagnosis
    from cpfls_cli.artifacts.disagreement import Disagreement
    from cpfls_cli.artifacts.extended import Extended
    from cpfls_cli.artifacts.identified import IdentifiedModel
    from cpfls_cli.artifacts.vehicle_model import Vehicle
    from cpfls_cli.changes.results import Changed, Trend
    from cpfls_cli.flights.flight import Flight
    from cpfls_cli.flights.path import PlannedPath
    from cpfls_cli.identification.replicates import Sweep
    from cpfls_cli.playback.along_flights import Playback
    from cpfls_cli.reduction.selection import Selection
    from cpfls_cli.response.flown import Responses
    from cpfls_cli.simulation.twin import Twin
    from cpfls_cli.tuning.vehicle import Gains
    from cpfls_cli.validation.prediction import AlongFlight

R = TypeVar("R", default=Any)


class _OfFormat(Generic[R]):
    """The artifacts of one format, as an attribute."""

    def __init__(self, name: str) -> None:
        self.format = name

    def __get__(self, sources: Sources, _: type[Sources]) -> list[Source[R]]:
        return [source for source in sources.all if source.format == self.format]


@dataclass(frozen=True)
class Sources:
    """Everything that a report is about, with vehicle and settings of the study that it is made with."""

    all: Sequence[Source[Any]]
    vehicle: VehicleSettings
    settings: ReportSettings

    trajectories: ClassVar[_OfFormat[PlannedPath]] = _OfFormat("cpfls/trajectory")
    flights: ClassVar[_OfFormat[Flight]] = _OfFormat("cpfls/flight")
    selections: ClassVar[_OfFormat[Selection]] = _OfFormat("cpfls/selection")
    models: ClassVar[_OfFormat[IdentifiedModel]] = _OfFormat("cpfls/identified")
    sweeps: ClassVar[_OfFormat[Sweep]] = _OfFormat("cpfls/sweep")
    predictions: ClassVar[_OfFormat[AlongFlight]] = _OfFormat("cpfls/prediction")
    replays: ClassVar[_OfFormat[Playback]] = _OfFormat("cpfls/replay")
    responses: ClassVar[_OfFormat[Responses]] = _OfFormat("cpfls/response")
    twins: ClassVar[_OfFormat[Twin]] = _OfFormat("cpfls/twin")
    gains: ClassVar[_OfFormat[Gains]] = _OfFormat("cpfls/gains")
    disagreements: ClassVar[_OfFormat[Disagreement]] = _OfFormat("cpfls/disagreement")
    diagnoses: ClassVar[_OfFormat[Diagnosis]] = _OfFormat("cpfls/diagnosis")
    vehicles: ClassVar[_OfFormat[Vehicle]] = _OfFormat("cpfls/vehicle")
    trends: ClassVar[_OfFormat[Trend]] = _OfFormat("cpfls/trend")
    changes: ClassVar[_OfFormat[Changed]] = _OfFormat("cpfls/changed")
    extensions: ClassVar[_OfFormat[Extended]] = _OfFormat("cpfls/extended")

    @property
    def gap(self) -> list[Source[Any]]:
        """Everything that the gap workflow wrote, answers before their grounds."""
        return [*self.diagnoses, *self.extensions, *self.disagreements]

    @property
    def only_gap(self) -> bool:
        """Whether nothing else was given than how models and flights disagree, and what was found then."""
        alone = (self.gap, self.replays, self.responses, self.twins, self.gains)
        return sum(map(len, (*alone, self.vehicles, self.changes, self.trends))) == len(self.all)

    @property
    def title(self) -> str:
        """Heading of the page: that of the config, or what suits artifacts of the gap workflow alone."""
        if self.settings.title != ReportSettings().title or not self.only_gap:
            return self.settings.title
        if self.gains:
            return "Gains for an autopilot"
        if self.vehicles:
            return "A vehicle found in flights"
        if self.changes or self.trends:
            return "What changed about a vehicle"
        if self.gap:
            return "Where simulation and flight disagree"
        if self.twins:
            return "Does the simulator fly like the vehicle"
        return "What a model predicts of flights" if self.replays else "How a vehicle answers its rotors"

    @property
    def answered(self) -> frozenset[str]:
        """Hashes of results whose answer another one gives: diagnosed comparisons, and models of a diagnosis."""
        diagnosed = {each.made_from("disagreement") for each in self.diagnoses}
        extended = {each.sha256 for each in self.extensions if self.by_hash(each.made_from("diagnosis")) is not None}
        return frozenset(each for each in (*diagnosed, *extended) if each is not None)

    def of_kind(self, kind: type[R]) -> list[Source[R]]:
        """List the artifacts of one kind, in the order given."""
        return [source for source in self.all if isinstance(source.record, kind)]

    def by_hash(self, sha256: str | None) -> Source[Any] | None:
        """Look up an artifact by its hash."""
        return next((source for source in self.all if source.sha256 == sha256), None)


def unique_labels(paths: Sequence[Path]) -> list[str]:
    """Name files apart: those whose name stands more than once by as many of their folders as that takes."""
    whole = [Path(os.path.abspath(path)).parts for path in paths]
    labels = []
    for parts in whole:
        alike = {other for other in whole if other[-1] == parts[-1]}
        depth = next(n for n in count(1) if len({other[-n:] for other in alike}) == len(alike))
        labels.append("/".join(parts[-depth:]))
    return labels
