"""The artifacts that a report is about."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Generic, Self

from typing_extensions import TypeVar

from cpfls_cli.artifacts.job import Job
from cpfls_cli.artifacts.spec import Record
from cpfls_cli.config.study import ReportSettings, resolved
from cpfls_cli.report.content import HASH_SHOWN, Block, Origin, Section
from cpfls_cli.vehicle.settings import VehicleSettings

if TYPE_CHECKING:
    # A page loads the records that it is about, not all others.
    from cpfls_cli.artifacts.diagnosis import DiagnosisRecord
    from cpfls_cli.artifacts.disagreement import DisagreementRecord
    from cpfls_cli.artifacts.extended import ExtendedRecord
    from cpfls_cli.artifacts.flight import FlightRecord
    from cpfls_cli.artifacts.identified import IdentifiedRecord
    from cpfls_cli.artifacts.prediction import PredictionRecord
    from cpfls_cli.artifacts.replay import ReplayRecord
    from cpfls_cli.artifacts.selection import SelectionRecord
    from cpfls_cli.artifacts.sweep import SweepRecord
    from cpfls_cli.artifacts.trajectory import TrajectoryRecord
    from cpfls_cli.artifacts.vehicle_model import VehicleRecord

R = TypeVar("R", bound=Record, default=Any)

GAP_TITLE = "Where simulation and flight disagree"
VEHICLE_TITLE = "A vehicle found in flights"
REPLAY_TITLE = "What a model predicts of flights"
"""Heading of a page about nothing else, unless the config gives one."""


@dataclass(frozen=True)
class Source(Origin, Generic[R]):
    """One artifact and the study that made it.

    Attributes
    ----------
    record : Record
        The artifact.
    config : mapping
        The resolved study that made it, by section and key.
    vehicle : VehicleSettings
        Of that study.
    parameters : int
        Linear parameters of the fuzzy part that that study asks for.
    """

    record: R
    config: Mapping[str, Any]
    vehicle: VehicleSettings
    parameters: int

    @classmethod
    def of(
        cls, label: str, sha256: str, record: R, config: Mapping[str, Any], vehicle: VehicleSettings, parameters: int
    ) -> Self:
        """Name an artifact for a document."""
        return cls(label, sha256, record.FORMAT.name, record.origin, record, config, vehicle, parameters)

    def made_from(self, role: str) -> str | None:
        """Hash of an input by its role; None where it had none."""
        return self.record.made_from(role)

    def input_name(self, role: str) -> str:
        """File name of an input by its role; empty where it had none."""
        return self.record.input_name(role)


@dataclass(frozen=True)
class Sources:
    """Everything that a report is about.

    Attributes
    ----------
    all : sequence of Source
        In the order given.
    vehicle : VehicleSettings
        Of the study that the report is made with.
    """

    all: Sequence[Source[Any]]
    vehicle: VehicleSettings
    settings: ReportSettings

    @property
    def trajectories(self) -> list[Source[TrajectoryRecord]]:
        """Planned paths."""
        return self._of("cpfls/trajectory")

    @property
    def flights(self) -> list[Source[FlightRecord]]:
        """Flights, simulated or imported."""
        return self._of("cpfls/flight")

    @property
    def selections(self) -> list[Source[SelectionRecord]]:
        """Reduced training sets."""
        return self._of("cpfls/selection")

    @property
    def models(self) -> list[Source[IdentifiedRecord]]:
        """Identified models."""
        return self._of("cpfls/model", "identified")

    @property
    def sweeps(self) -> list[Source[SweepRecord]]:
        """Replicates of searches."""
        return self._of("cpfls/sweep")

    @property
    def predictions(self) -> list[Source[PredictionRecord]]:
        """Predictions of models along flights."""
        return self._of("cpfls/prediction")

    @property
    def replays(self) -> list[Source[ReplayRecord]]:
        """Models played back along flights."""
        return self._of("cpfls/replay")

    @property
    def disagreements(self) -> list[Source[DisagreementRecord]]:
        """Where models and flights disagree."""
        return self._of("cpfls/disagreement")

    @property
    def diagnoses(self) -> list[Source[DiagnosisRecord]]:
        """What models miss."""
        return self._of("cpfls/diagnosis")

    @property
    def vehicles(self) -> list[Source[VehicleRecord]]:
        """Vehicles found in flights."""
        return self._of("cpfls/model", "vehicle")

    @property
    def extensions(self) -> list[Source[ExtendedRecord]]:
        """Models with the effects that they missed."""
        return self._of("cpfls/model", "extended")

    @property
    def gap(self) -> list[Source[Any]]:
        """Everything that the gap workflow wrote, answers before their grounds."""
        return [*self.diagnoses, *self.extensions, *self.disagreements]

    @property
    def only_gap(self) -> bool:
        """Whether nothing else was given than how models and flights disagree, and what was found then."""
        return len(self.gap) + len(self.replays) + len(self.vehicles) == len(self.all)

    @property
    def title(self) -> str:
        """Heading of the page."""
        usual = self.settings.title == ReportSettings().title
        if not usual or not self.only_gap:
            return self.settings.title
        if self.vehicles:
            return VEHICLE_TITLE
        return GAP_TITLE if self.gap else REPLAY_TITLE

    def by_hash(self, sha256: str | None) -> Source[Any] | None:
        """Look up an artifact by its hash."""
        return next((source for source in self.all if source.sha256 == sha256), None)

    def _of(self, name: str, kind: str = "") -> list[Source[Any]]:
        """List the artifacts of a format."""
        formats = ((source, source.record.FORMAT) for source in self.all)
        return [source for source, own in formats if (own.name, own.kind) == (name, kind)]


def unique_labels(names: Sequence[str], hashes: Sequence[str]) -> list[str]:
    """Name files apart: a name that stands more than once gets the first digits of its hash.

    Parameters
    ----------
    names : sequence of str
        File names without folders.
    """
    count = Counter(names)
    return [
        name if count[name] == 1 else f"{name} ({sha256[:HASH_SHOWN]})"
        for name, sha256 in zip(names, hashes, strict=True)
    ]


def source_of(job: Job, record: R) -> Source[R]:
    """Name the artifact that a job has just written, so that its page can speak of it."""
    return Source.of(job.output.name, "", record, resolved(job.study), job.study.vehicle, 0)


def section_of_each(
    name: str, title: str, sources: Sequence[Source[R]], blocks: Callable[[Source[R], int], Iterable[Block]]
) -> Section | None:
    """Join what is shown of each source to one section.

    Parameters
    ----------
    name : str
        Identifier of the section.
    blocks : callable
        What is shown of one source; takes it and its number, from 1.

    Returns
    -------
    Section or None
        None where there is no source.
    """
    if not sources:
        return None
    shown = [block for number, source in enumerate(sources, start=1) for block in blocks(source, number)]
    return Section(name, title, shown)
