"""A model as one module of Python that needs NumPy only."""

from __future__ import annotations

from typing import Any

import numpy as np

from cpfls_cli.export.points import Expected
from cpfls_cli.export.sheet import Sheet
from cpfls_cli.export.source import common_words, fill
from cpfls_cli.export.tables import filled, python_rows
from cpfls_cli.export.text import comment_text
from cpfls_cli.identification.model import Model
from cpfls_cli.inertia import symmetric


def python_source(sheet: Sheet, points: Expected, file: str) -> str:
    """Write a model as a module of Python.

    Parameters
    ----------
    points : Expected
        For the self-test.
    file : str
        Name of the file.
    """
    verdict = sheet.evidence.verdict
    words = {
        **common_words(sheet),
        "source": comment_text(file),
        "verdict_label": ascii(verdict.label) if verdict else None,
        **_tables(sheet.model),
        "points": [_point(points, index) for index in range(len(points))],
    }
    return fill("model.py.j2", words)


def visited_rows(model: Model) -> list[str]:
    """Draw the region that training visited.

    Returns
    -------
    list of str
        ``#`` for a visited cell, ``.`` for another; a line for each roll.
    """
    return ["".join(row) for row in np.where(model.visited, "#", ".")]


def _tables(model: Model) -> dict[str, Any]:
    structure = model.structure
    return {
        "partitions": [
            {"label": partition.name, "rows": python_rows(peaks, 8)}
            for partition, peaks in zip(structure.partitions, model.partitions, strict=True)
        ],
        "blocks": [
            {
                "name": block.function.name,
                "rows": python_rows(model.coefficients[block.columns].reshape(block.rules, block.features), 8),
            }
            for block in structure.blocks
            if block.partitions
        ],
        "rigid_body": python_rows(symmetric(model.rigid_body), 4),
        "visited_rows": visited_rows(model),
    }


def _point(points: Expected, index: int) -> str:
    motion = points.motion[index : index + 1]
    entries = {
        "q": motion.attitude[0],
        "qd": motion.rate[0],
        "qdd": motion.acceleration[0],
        "D": points.inertia[index],
        "C": points.coriolis[index],
        "torque": points.torque[index],
        "body": points.body[index],
        "scale": points.scale[index],
    }
    lines = [filled(f'"{name}": {values.tolist()!r},', 8) for name, values in entries.items()]
    return "\n".join(["    {", *lines, f'        "inside": {bool(points.inside[index])},', "    },"])
