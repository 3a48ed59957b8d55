"""Everything about a model that goes into an export: the model, where it comes from, and what it is worth in words."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from cpfls_cli.artifacts.model import ModelRecord
from cpfls_cli.artifacts.scores import MODEL
from cpfls_cli.config.load import parse_config
from cpfls_cli.identification.model import Model
from cpfls_cli.regressor.structure import Block, ModelStructure
from cpfls_cli.version import __version__

EXPORTER = __version__
"""Version of the program that exports."""

DO_NOT_USE = "DO NOT USE: this is the verdict on the model, which was exported all the same."

_SIGNS = {1: "for", -1: "against"}


@dataclass(frozen=True)
class Sheet:
    """A model, ready to be written in any form.

    Attributes
    ----------
    name : str
        Prefix of all names in source code, an identifier.
    model : Model
        What is evaluated.
    record : ModelRecord
        The artifact that it was read from.
    file, sha256 : str
        Name, without its folder, and hash of the artifact.
    """

    name: str
    model: Model
    record: ModelRecord
    file: str
    sha256: str

    @property
    def rigid(self) -> bool:
        """Whether a rigid body lies under the fuzzy part."""
        return bool(self.model.rigid_body.any())

    @property
    def fuzzy(self) -> bool:
        """Whether the fuzzy part does anything, or is all there is."""
        return bool(self.model.coefficients.any()) or not self.rigid

    @property
    def region_share(self) -> float:
        """Share of the circle of roll and pitch that training visited."""
        return float(np.mean(self.model.visited))

    @property
    def config(self) -> Mapping[str, Any]:
        """The resolved study."""
        return parse_config(self.record.origin.config, f"{self.file}: /config")

    @property
    def banner(self) -> list[str]:
        """Paragraphs that must not be overlooked; none for a complete model that is fit for use."""
        unfit = ["", DO_NOT_USE] if self.record.verdict_label == "do-not-use" else []
        if self.record.complete:
            return unfit
        why = f" ({self.record.stop_reason})" if self.record.stop_reason else ""
        return ["", f"INCOMPLETE MODEL: its search did not come to its end{why}. Do not fly with it.", *unfit]

    @property
    def facts(self) -> list[str]:
        """Paragraphs that say what the model is, what it is worth and where it comes from."""
        return [self._structure, "", *self._worth(), "", *self._origin()]

    @property
    def _structure(self) -> str:
        settings, structure = self.model.structure.settings, self.model.structure
        order = f" of order {settings.harmonic_order}" if settings.consequents == "harmonic" else ""
        functions = ", ".join(f"{partition.name} {partition.functions}" for partition in structure.partitions)
        fuzzy = "" if self.fuzzy else " The fuzzy part is off: this is a rigid body."
        return (
            f"Structure: {settings.structure}, {settings.input_map} inputs, {settings.consequents} consequents{order}, "
            f"{settings.products} products; membership functions {functions}; {structure.parameters} coefficients; "
            f"base {self.record.model.base}.{fuzzy} Training visited {self.region_share:.1%} of the circle of roll and "
            "pitch."
        )

    def _worth(self) -> Iterator[str]:
        verdict, judged = self.record.verdict, self.record.judged
        if verdict is None or verdict.label is None:
            yield "Verdict: none; the model holds no validation."
        else:
            yield f"Verdict: {verdict.label}. {verdict.region or ''}"
            for reason, speaks in verdict.reasons:
                yield f"- {_SIGNS.get(speaks, 'note')}: {reason}"
        for part in judged.parts if MODEL in judged.models else ():
            worst, r2 = judged.worst(MODEL, part)[0], judged.worst_r2(MODEL, part)
            error = f"largest error {worst:.3g} of the largest torque"
            yield f"Judged on {part} ({judged.samples_of(part)} samples), worst axis: {error}, R2 {r2:.4f}"
        for finding in self.record.findings:
            yield f"Finding: {finding}"

    def _origin(self) -> Iterator[str]:
        header = self.record.origin
        yield f"Model: {self.file}, sha256 {self.sha256}"
        yield f"Made by cpfls {header.version}, seed {header.seed}; exported by cpfls {EXPORTER}"
        for role, source in header.inputs.items():
            yield f"From {role}: {source.name}, sha256 {source.sha256}"


def rule_labels(block: Block, structure: ModelStructure) -> list[str]:
    """Name the rules of an inertia function by their places along its inputs."""
    names = [("roll", "pitch")[angle] for angle in block.function.inputs]
    last = rules_along(structure, block.partitions[-1])
    if len(names) == 1:
        return [f"{names[0]} {rule}" for rule in range(block.rules)]
    return [f"{names[0]} {rule // last}, {names[1]} {rule % last}" for rule in range(block.rules)]


def rules_along(structure: ModelStructure, partition: int) -> int:
    """Count the rules along one input.

    Parameters
    ----------
    partition : int
        Index.
    """
    functions = structure.partitions[partition].functions
    return max(functions - 1, 1) if structure.circular else functions
