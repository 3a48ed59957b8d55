"""Everything about a model that goes into an export: the model itself, where it comes from, what it is worth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from cpfls_cli.artifacts.spec import Header
from cpfls_cli.identification.model import Model


@dataclass(frozen=True)
class Provenance:
    """Where a model comes from.

    Attributes
    ----------
    file, sha256 : str
        Name, without its folder, and hash of the model artifact.
    header : Header
        Version and seed that made it, and its inputs.
    config : mapping
        The resolved study.
    exporter : str
        Version of the program that exports.
    """

    file: str
    sha256: str
    header: Header
    config: Mapping[str, Any]
    exporter: str


@dataclass(frozen=True)
class Verdict:
    """How far to trust a model, in words.

    Attributes
    ----------
    reasons : tuple of (str, float)
        Each with 1 where it speaks for the model, -1 against it, 0 neither.
    """

    label: str
    region: str
    reasons: tuple[tuple[str, float], ...]


@dataclass(frozen=True)
class Evidence:
    """What a model is worth.

    Attributes
    ----------
    complete : bool
        Whether the search came to its end.
    judged : mapping
        Scores by model and part, as JSON has them; numbers that are not known are not finite.
    verdict : Verdict or None
        None where the model holds no validation.
    """

    complete: bool
    stop_reason: str
    judged: Mapping[str, Any]
    findings: tuple[str, ...]
    verdict: Verdict | None


@dataclass(frozen=True)
class Sheet:
    """A model, ready to be written in any form.

    Attributes
    ----------
    name : str
        Prefix of all names in source code, an identifier.
    base : str
        ``none`` or ``rigid-body``.
    """

    name: str
    model: Model
    base: str
    provenance: Provenance
    evidence: Evidence

    @property
    def rigid(self) -> bool:
        """Whether a rigid body lies under the fuzzy part."""
        return bool(self.model.rigid_body.any())

    @property
    def fuzzy(self) -> bool:
        """Whether the fuzzy part does anything, or is all there is."""
        return bool(self.model.coefficients.any()) or not self.rigid
