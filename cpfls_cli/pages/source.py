"""The artifacts that a report is about."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any

from typing_extensions import TypeVar

from cpfls_cli.config.study import ReportSettings
from cpfls_cli.report.source import Source as Source
from cpfls_cli.vehicle.settings import VehicleSettings

R = TypeVar("R", default=Any)


class _OfFormat:
    """The artifacts of one format, as an attribute."""

    def __init__(self, name: str) -> None:
        self.format = f"cpfls/{name}"

    def __get__(self, sources: Sources, _: type[Sources]) -> list[Source]:
        return [source for source in sources.all if source.format == self.format]


@dataclass(frozen=True)
class Sources:
    """Everything that a report is about, with vehicle and settings of the study that it is made with."""

    all: Sequence[Source]
    vehicle: VehicleSettings
    settings: ReportSettings

    trajectories, flights, selections = _OfFormat("trajectory"), _OfFormat("flight"), _OfFormat("selection")
    models, sweeps, predictions = _OfFormat("identified"), _OfFormat("sweep"), _OfFormat("prediction")
    replays, responses, twins = _OfFormat("replay"), _OfFormat("response"), _OfFormat("twin")
    gains, vehicles, extensions = _OfFormat("gains"), _OfFormat("vehicle"), _OfFormat("extended")
    disagreements, diagnoses = _OfFormat("disagreement"), _OfFormat("diagnosis")
    trends, changes = _OfFormat("trend"), _OfFormat("changed")

    @property
    def gap(self) -> list[Source]:
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

    def by_hash(self, sha256: str | None) -> Source | None:
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
