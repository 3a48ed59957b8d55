"""The formats of all artifacts, in the order of the pipeline.

``python -m cpfls_cli.artifacts.formats`` prints them as Markdown tables for docs/format.md.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from textwrap import fill
from typing import Any

from cpfls_cli.artifacts.spec import DatasetSpec, Format, Record

_RECORDS = {
    ("cpfls/trajectory", ""): "trajectory.TrajectoryRecord",
    ("cpfls/flight", ""): "flight.FlightRecord",
    ("cpfls/model", "identified"): "identified.IdentifiedRecord",
    ("cpfls/checkpoint", ""): "checkpoint.CheckpointRecord",
    ("cpfls/sweep", ""): "sweep.SweepRecord",
    ("cpfls/prediction", ""): "prediction.PredictionRecord",
    ("cpfls/replay", ""): "replay.ReplayRecord",
    ("cpfls/response", ""): "response.ResponseRecord",
    ("cpfls/twin", ""): "twin.TwinRecord",
    ("cpfls/disagreement", ""): "disagreement.DisagreementRecord",
    ("cpfls/diagnosis", ""): "diagnosis.DiagnosisRecord",
    ("cpfls/model", "extended"): "extended.ExtendedRecord",
    ("cpfls/model", "vehicle"): "vehicle_model.VehicleRecord",
    ("cpfls/flight-numbers", ""): "flight_numbers.FlightNumbersRecord",
    ("cpfls/changed", ""): "changed.ChangedRecord",
    ("cpfls/trend", ""): "trend.TrendRecord",
    ("cpfls/vehicle-checkpoint", ""): "checkpoint.VehicleCheckpointRecord",
}
"""Every artifact format by its name and kind, and where its record is: it is loaded when a file of it is met."""

# Of a line of docs.
_WIDTH = 120
_HEAD = "| dataset | dimensions | units | frame | required | description |\n|---|---|---|---|---|---|"


def record_of_format(name: str, kind: str = "") -> type[Record] | None:
    """Look up a format by the values of the root attributes ``format`` and ``kind``, and load its record."""
    place = _RECORDS.get((name, kind))
    if place is None:
        return None
    module, record = place.split(".")
    found: type[Record] = getattr(import_module(f"cpfls_cli.artifacts.{module}"), record)
    return found


def stage_module(attributes: Mapping[str, Any]) -> str:
    """Name the module of the stage that made a file, by its root attributes; empty where it holds no result."""
    module = str(attributes.get("stage", "")).replace("-", "_")
    found = re.fullmatch(r"[a-z]\w*", module) and (Path(__file__).parents[1] / "stages" / f"{module}.py").is_file()
    return module if found else ""


def records() -> list[type[Record]]:
    """Load the records of all formats."""
    return [record for format_and_kind in _RECORDS if (record := record_of_format(*format_and_kind)) is not None]


def format_tables() -> str:
    """Describe every artifact format as Markdown, one section with the table of its datasets each."""
    return "\n".join(_section(record.spec()) for record in records())


def _section(spec: Format) -> str:
    inputs = ", ".join(f"`/inputs/{role}`" for role in spec.inputs) or "none"
    rows = "\n".join(_row(dataset) for dataset in spec.datasets)
    words = fill(f"Made by {spec.makers}: {spec.description}. Inputs: {inputs}.", _WIDTH, break_on_hyphens=False)
    kind = f", kind `{spec.kind}`" if spec.kind else ""
    return f"### `{spec.name}`{kind}\n\n{words}\n\n{_HEAD}\n{rows}\n"


def _row(dataset: DatasetSpec) -> str:
    dimensions = " x ".join(dataset.dimensions) or "scalar"
    required = "yes" if dataset.required else "no"
    gaps = "; may be not finite" if dataset.gaps else ""
    cells = (f"`/{dataset.path}`", dimensions, dataset.units, dataset.frame, required, dataset.description + gaps)
    return f"| {' | '.join(cells)} |"


if __name__ == "__main__":
    print(format_tables(), end="")
