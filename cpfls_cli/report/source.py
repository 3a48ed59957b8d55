"""Artifacts with the studies that made them, as pages speak of them."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from typing import Any, Generic

from typing_extensions import TypeVar

from cpfls_cli import store
from cpfls_cli.config.load import stored_study, validate
from cpfls_cli.config.study import ReportSettings, Study, resolved
from cpfls_cli.files import text_sha256
from cpfls_cli.regressor.structure import model_structure
from cpfls_cli.vehicle.settings import VehicleSettings

R = TypeVar("R", default=Any)


@dataclass(frozen=True)
class Source(Generic[R]):
    """One artifact and the study that made it.

    Attributes
    ----------
    label : str
        Name that is unique in a report.
    sha256 : str
        Hash of the file.
    record : object
        The result.
    config : mapping
        The resolved study, by section and key.
    parameters : int
        Linear parameters of the fuzzy part that the study asks for.
    header : store.Origin
        Where it comes from.
    wordings : dict
        What its stage says of it, by name of the stage, once that was asked for.
    """

    label: str
    sha256: str
    record: R
    config: Mapping[str, Any]
    vehicle: VehicleSettings
    parameters: int
    header: store.Origin = field(kw_only=True)
    wordings: dict[str, str] = field(default_factory=dict, init=False, repr=False, compare=False)

    @property
    def format(self) -> str:
        """Name of its format."""
        return str(self.record.FORMAT)  # type: ignore[attr-defined]

    @property
    def stage(self) -> str:
        """Stage that made it."""
        return self.header.stage

    @property
    def config_sha256(self) -> str:
        """Hash of the config that made it."""
        return text_sha256(self.header.config)

    def made_from(self, role: str) -> str | None:
        """Hash of an input by its role; None where it had none."""
        file = self.header.inputs.get(role)
        return file.sha256 if file else None

    def input_name(self, role: str) -> str:
        """File name of an input by its role; empty where it had none."""
        file = self.header.inputs.get(role)
        return file.name if file else ""


def source_of_result(
    given: Any, origin: store.Origin, path: object, label: str, sha256: str, study: Study | None = None
) -> Source:
    """Name a result; its study is the one that it holds where none is given, of a stage without one the usual."""
    study = study or (stored_study(origin.config, path) if origin.config else validate({}, "default"))
    parameters = model_structure(study.identification).parameters
    return Source(label, sha256, given, resolved(study), study.vehicle, parameters, header=origin)


class _OfFormat:
    """The artifacts of one format, as an attribute."""

    def __init__(self, name: str) -> None:
        self.format = f"cpfls/{name}"

    def __get__(self, sources: Sources, _: type[Sources]) -> list[Source]:
        return [source for source in sources.all if source.format == self.format]


_OF_GAP = ("diagnosis", "extended", "disagreement")
_TITLES = {
    "gains": "Gains for an autopilot",
    "vehicle": "A vehicle found in flights",
    **dict.fromkeys(("changed", "trend"), "What changed about a vehicle"),
    **dict.fromkeys(_OF_GAP, "Where simulation and flight disagree"),
    "twin": "Does the simulator fly like the vehicle",
    "replay": "What a model predicts of flights",
    "response": "How a vehicle answers its rotors",
}
"""Headings of pages on nothing but such formats; the first of those that are there gives it."""


@dataclass(frozen=True)
class Sources:
    """Everything that a report is about, with vehicle and settings of the study that it is made with."""

    all: Sequence[Source]
    vehicle: VehicleSettings
    settings: ReportSettings

    trajectories, flights, selections = _OfFormat("trajectory"), _OfFormat("flight"), _OfFormat("selection")
    models, vehicles = _OfFormat("identified"), _OfFormat("vehicle")
    extensions, diagnoses = _OfFormat("extended"), _OfFormat("diagnosis")

    @property
    def _formats(self) -> set[str]:
        return {source.format.removeprefix("cpfls/") for source in self.all}

    @property
    def gap(self) -> bool:
        """Whether anything is of the gap workflow."""
        return not self._formats.isdisjoint(_OF_GAP)

    @property
    def only_gap(self) -> bool:
        """Whether nothing else was given than how models and flights disagree, and what was found then."""
        return self._formats <= _TITLES.keys()

    @property
    def title(self) -> str:
        """Heading of the page: that of the config, or what suits artifacts of the gap workflow alone."""
        if self.settings.title != ReportSettings().title or not self.only_gap:
            return self.settings.title
        return next((words for name, words in _TITLES.items() if name in self._formats), _TITLES["response"])

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
