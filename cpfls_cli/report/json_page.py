"""A report as JSON: sections, facts, tables, figures with their data, provenance."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from cpfls_cli.report.content import STRUCK, Block, Facts, Folded, Panel, Plot, Series, Table, Text
from cpfls_cli.report.source import Document, Source

_DIGITS = 6


def json_page(document: Document) -> str:
    """Write a document as one JSON object; numbers have six digits, null if unknown or at the edge of a panel."""
    page = {
        "title": document.title,
        "cpfls_version": document.version,
        "sections": [
            {"name": section.name, "title": section.title, "blocks": [_block(block) for block in section.blocks]}
            for section in document.sections
        ],
        "artifacts": [_origin(origin) for origin in document.origins],
    }
    return json.dumps(page, ensure_ascii=False, allow_nan=False, separators=(",", ":")) + "\n"


def _block(block: Block) -> dict[str, Any]:
    match block:
        case Table():
            return _table(block)
        case Folded():
            return {"kind": block.kind, "summary": block.summary, "blocks": [_block(inner) for inner in block.blocks]}
        case Facts():
            return {"kind": block.kind, "rows": [[_bare(term), _bare(value)] for term, value in block.rows]}
        case Text():
            return {"kind": block.kind, "text": block.text, "tone": block.tone}
        case Plot():
            words = {"name": block.name, "caption": block.caption, "description": block.description}
            return {"kind": "figure", **words, "panels": [_panel(panel) for panel in block.picture.panels]}
        case _:
            return {"kind": block.kind, **asdict(block)}


def _bare(text: str) -> str:
    """Leave out what strikes a number through; the word behind it stays."""
    return STRUCK.sub(r"\1", text)


def _table(table: Table) -> dict[str, Any]:
    cells = table.cells
    marked = [
        {"row": row, "column": column, "tone": cell.tone}
        for row, line in enumerate(cells)
        for column, cell in enumerate(line)
        if cell.tone != "plain"
    ]
    return {
        "kind": table.kind,
        "name": table.name,
        "caption": table.explained,
        "header": list(table.header),
        "rows": [[_bare(cell.text) for cell in line] for line in cells],
        "marked": marked,
    }


def _panel(panel: Panel) -> dict[str, Any]:
    named: Mapping[str, Any] = {
        key: [{"at": _rounded(at), "word": word} for at, word in names.items()]
        for key, names in (("x_names", panel.x_names), ("y_names", panel.y_names))
        if names
    }
    words = {"title": panel.title, "x_label": panel.x_label, "y_label": panel.y_label}
    return {**words, **named, "series": [_series(series) for series in panel.series]}


def _series(series: Series) -> dict[str, Any]:
    columns = {key: getattr(series, key) for key in ("x", "y", "low", "high", "value")}
    numbers = {key: [_rounded(value) for value in values] for key, values in columns.items() if values is not None}
    return {"label": series.label, "form": series.form, **numbers}


def _rounded(value: float) -> float | None:
    return float(f"{value:.{_DIGITS}g}") + 0.0 if np.isfinite(value) else None


def _origin(origin: Source) -> dict[str, Any]:
    header = origin.header
    return {
        "file": origin.label,
        "format": origin.format,
        "cpfls_version": header.version,
        "seed": header.seed,
        "sha256": origin.sha256,
        "config_sha256": origin.config_sha256,
        "inputs": {role: asdict(file) for role, file in header.inputs.items()},
        "cautions": list(header.cautions),
        "config": header.config,
    }
