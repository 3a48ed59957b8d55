"""The artifacts that a report is about."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from cpfls_cli.artifacts.formats import (
    DIAGNOSIS,
    DISAGREEMENT,
    EXTENDED,
    FLIGHT,
    MODEL,
    PREDICTION,
    SELECTION,
    SWEEP,
    TRAJECTORY,
)
from cpfls_cli.artifacts.spec import ArtifactSpec
from cpfls_cli.artifacts.store import Artifact
from cpfls_cli.report.settings import ReportSettings
from cpfls_cli.vehicle.settings import VehicleSettings

HASH_SHOWN = 12
GAP_TITLE = "Where simulation and flight disagree"
"""Heading of a page about nothing else, unless the config gives one."""


@dataclass(frozen=True)
class Source:
    """One artifact and the study that made it.

    Attributes
    ----------
    label : str
        File name, unique in the report.
    config : mapping
        The resolved study that made it, by section and key.
    vehicle : VehicleSettings
        Of that study.
    parameters : int
        Linear parameters of the fuzzy part that that study asks for.
    """

    label: str
    sha256: str
    artifact: Artifact
    config: Mapping[str, Any]
    vehicle: VehicleSettings
    parameters: int

    @property
    def searched(self) -> bool:
        """Whether a model has partitions to search for; without, one chromosome was evaluated."""
        return bool(self.artifact.array("model/weights").size)

    @property
    def short_hash(self) -> str:
        """First digits of the hash."""
        return self.sha256[:HASH_SHOWN]

    @property
    def config_sha256(self) -> str:
        """Hash of the config that made it."""
        return hashlib.sha256(self.artifact.header.config.encode()).hexdigest()

    def made_from(self, role: str) -> str | None:
        """Hash of an input by its role; None where it had none."""
        source = self.artifact.header.inputs.get(role)
        return source.sha256 if source else None

    def input_name(self, role: str) -> str:
        """File name of an input by its role; empty where it had none."""
        source = self.artifact.header.inputs.get(role)
        return source.name if source else ""


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

    all: Sequence[Source]
    vehicle: VehicleSettings
    settings: ReportSettings

    @property
    def trajectories(self) -> list[Source]:
        """Planned paths."""
        return self._of(TRAJECTORY)

    @property
    def flights(self) -> list[Source]:
        """Flights, simulated or imported."""
        return self._of(FLIGHT)

    @property
    def selections(self) -> list[Source]:
        """Reduced training sets."""
        return self._of(SELECTION)

    @property
    def models(self) -> list[Source]:
        """Identified models."""
        return self._of(MODEL)

    @property
    def sweeps(self) -> list[Source]:
        """Replicates of searches."""
        return self._of(SWEEP)

    @property
    def predictions(self) -> list[Source]:
        """Predictions of models along flights."""
        return self._of(PREDICTION)

    @property
    def disagreements(self) -> list[Source]:
        """Where models and flights disagree."""
        return self._of(DISAGREEMENT)

    @property
    def diagnoses(self) -> list[Source]:
        """What models miss."""
        return self._of(DIAGNOSIS)

    @property
    def extensions(self) -> list[Source]:
        """Models with the effects that they missed."""
        return self._of(EXTENDED)

    @property
    def gap(self) -> list[Source]:
        """Everything that the gap workflow wrote, answers before their grounds."""
        return [*self.diagnoses, *self.extensions, *self.disagreements]

    @property
    def only_gap(self) -> bool:
        """Whether nothing else was given than what the gap workflow writes."""
        return len(self.gap) == len(self.all)

    @property
    def title(self) -> str:
        """Heading of the page."""
        usual = self.settings.title == ReportSettings().title
        return GAP_TITLE if usual and self.only_gap else self.settings.title

    def by_hash(self, sha256: str | None) -> Source | None:
        """Look up an artifact by its hash."""
        return next((source for source in self.all if source.sha256 == sha256), None)

    def _of(self, spec: ArtifactSpec) -> list[Source]:
        return [source for source in self.all if source.artifact.spec == spec]


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
