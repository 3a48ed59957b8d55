"""The formats as Markdown tables: ``python -m cpfls_cli.artifacts.describe`` prints them for docs/format.md."""

from __future__ import annotations

from cpfls_cli.artifacts.formats import FORMATS
from cpfls_cli.artifacts.spec import ArtifactSpec, DatasetSpec

_HEAD = "| dataset | dimensions | units | frame | required | description |\n|---|---|---|---|---|---|"


def format_tables() -> str:
    """Describe every artifact format as a table of its datasets.

    Returns
    -------
    str
        Markdown, one section for each format.
    """
    return "\n".join(_section(spec) for spec in FORMATS)


def _section(spec: ArtifactSpec) -> str:
    inputs = ", ".join(f"`/inputs/{role}`" for role in spec.inputs) or "none"
    rows = "\n".join(_row(dataset) for dataset in spec.datasets)
    return f"### `{spec.format}`\n\nMade by {spec.makers}: {spec.description}. Inputs: {inputs}.\n\n{_HEAD}\n{rows}\n"


def _row(dataset: DatasetSpec) -> str:
    dimensions = " x ".join(dataset.dimensions) or "scalar"
    required = "yes" if dataset.required else "no"
    gaps = "; may be not finite" if dataset.gaps else ""
    cells = (f"`/{dataset.path}`", dimensions, dataset.units, dataset.frame, required, dataset.description + gaps)
    return f"| {' | '.join(cells)} |"


if __name__ == "__main__":
    print(format_tables(), end="")
