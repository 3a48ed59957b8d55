"""The formats of all artifacts, in the order of the pipeline.

``python -m cpfls_cli.artifacts.formats`` prints them as Markdown tables for docs/format.md.
"""

from __future__ import annotations

from textwrap import fill

from cpfls_cli.artifacts.checkpoint import CheckpointRecord, VehicleCheckpointRecord
from cpfls_cli.artifacts.diagnosis import DiagnosisRecord
from cpfls_cli.artifacts.disagreement import DisagreementRecord
from cpfls_cli.artifacts.extended import ExtendedRecord
from cpfls_cli.artifacts.flight import FlightRecord
from cpfls_cli.artifacts.identified import IdentifiedRecord
from cpfls_cli.artifacts.prediction import PredictionRecord
from cpfls_cli.artifacts.replay import ReplayRecord
from cpfls_cli.artifacts.selection import SelectionRecord
from cpfls_cli.artifacts.spec import ArtifactSpec, DatasetSpec, Record
from cpfls_cli.artifacts.sweep import SweepRecord
from cpfls_cli.artifacts.trajectory import TrajectoryRecord
from cpfls_cli.artifacts.vehicle_model import VehicleRecord

RECORDS: tuple[type[Record], ...] = (
    TrajectoryRecord,
    FlightRecord,
    SelectionRecord,
    IdentifiedRecord,
    CheckpointRecord,
    SweepRecord,
    PredictionRecord,
    ReplayRecord,
    DisagreementRecord,
    DiagnosisRecord,
    ExtendedRecord,
    VehicleRecord,
    VehicleCheckpointRecord,
)
"""Every artifact format."""

# Of a line of docs.
_WIDTH = 120
_HEAD = "| dataset | dimensions | units | frame | required | description |\n|---|---|---|---|---|---|"


def record_of_format(name: str, kind: str = "") -> type[Record] | None:
    """Look up a format by the values of the root attributes ``format`` and ``kind``."""
    return next((each for each in RECORDS if (each.FORMAT.name, each.FORMAT.kind) == (name, kind)), None)


def format_tables() -> str:
    """Describe every artifact format as a table of its datasets.

    Returns
    -------
    str
        Markdown, one section for each format.
    """
    return "\n".join(_section(record.spec()) for record in RECORDS)


def _section(spec: ArtifactSpec) -> str:
    inputs = ", ".join(f"`/inputs/{role}`" for role in spec.inputs) or "none"
    rows = "\n".join(_row(dataset) for dataset in spec.datasets)
    words = fill(f"Made by {spec.makers}: {spec.description}. Inputs: {inputs}.", _WIDTH, break_on_hyphens=False)
    kind = f", kind `{spec.kind}`" if spec.kind else ""
    return f"### `{spec.format}`{kind}\n\n{words}\n\n{_HEAD}\n{rows}\n"


def _row(dataset: DatasetSpec) -> str:
    dimensions = " x ".join(dataset.dimensions) or "scalar"
    required = "yes" if dataset.required else "no"
    gaps = "; may be not finite" if dataset.gaps else ""
    cells = (f"`/{dataset.path}`", dimensions, dataset.units, dataset.frame, required, dataset.description + gaps)
    return f"| {' | '.join(cells)} |"


if __name__ == "__main__":
    print(format_tables(), end="")
