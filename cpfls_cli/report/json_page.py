"""A report as JSON: sections, facts, tables, words of figures, provenance."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import Any

from cpfls_cli.report.content import STRUCK, Block, Facts, Folded, Plot, Table, Text
from cpfls_cli.report.source import Document, Source


def json_page(document: Document) -> str:
    """Write a document as one JSON object; figures by their words."""
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
            return {"kind": "figure", "name": block.name, "caption": block.caption, "description": block.description}
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
