"""An artifact with the study that made it, as pages speak of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Generic

from typing_extensions import TypeVar

from cpfls_cli import store
from cpfls_cli.config.load import stored_study, validate
from cpfls_cli.config.study import Study, resolved
from cpfls_cli.files import text_sha256
from cpfls_cli.regressor.structure import model_structure
from cpfls_cli.report.content import Section
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
    """

    label: str
    sha256: str
    record: R
    config: Mapping[str, Any]
    vehicle: VehicleSettings
    parameters: int
    header: store.Origin = field(kw_only=True)

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


@dataclass(frozen=True)
class Document:
    """A report in any form: its sections, the artifacts that it is about, and the version of the program."""

    title: str
    version: str
    sections: Sequence[Section]
    origins: Sequence[Source]


def source_of_result(
    given: Any, origin: store.Origin, path: object, label: str, sha256: str, study: Study | None = None
) -> Source:
    """Name a result; its study is the one that it holds where none is given, of a stage without one the usual."""
    study = study or (stored_study(origin.config, path) if origin.config else validate({}, "default"))
    parameters = model_structure(study.identification).parameters
    return Source(label, sha256, given, resolved(study), study.vehicle, parameters, header=origin)
