"""A model as C99: one source file and its header, with no dependency but the mathematics of the language."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.dynamics.rigid_body import vertical
from cpfls_cli.export.points import Expected
from cpfls_cli.export.sheet import Sheet
from cpfls_cli.export.source import common_words, fill
from cpfls_cli.export.tables import c_row, c_rows, filled, rule_labels
from cpfls_cli.export.text import comment_text
from cpfls_cli.identification.model import Model
from cpfls_cli.inertia import symmetric

_OUTSIDE, _VERTICAL = 1, 4


@dataclass(frozen=True)
class CSource:
    """C source code."""

    source: str
    header: str


def c_source(sheet: Sheet, points: Expected, stem: str) -> CSource:
    """Write a model as C99.

    Parameters
    ----------
    points : Expected
        For the self-test.
    stem : str
        Name of both files without ``.c`` and ``.h``.
    """
    words = {
        **common_words(sheet),
        "source": comment_text(f"{stem}.c"),
        "header": comment_text(f"{stem}.h"),
        **_tables(sheet.model),
        "points": [_point(points, index) for index in range(len(points))],
    }
    return CSource(fill("model.c.j2", words), fill("model.h.j2", words))


def _tables(model: Model) -> dict[str, Any]:
    structure = model.structure
    packed = np.packbits(model.visited, axis=1)
    return {
        "partitions": [
            {
                "label": p.name,
                "table": f"{p.function}_{('roll', 'pitch')[p.input]}",
                "functions": p.functions,
                "rows": filled(c_row(peaks), 4),
            }
            for p, peaks in zip(structure.partitions, model.partitions, strict=True)
        ],
        "rules": {
            p.name: f"rules_of(&{name}_input, {p.function}_{name}, {p.functions})"
            for p in structure.partitions
            for name in (("roll", "pitch")[p.input],)
        },
        "blocks": [
            {
                "name": block.function.name,
                "rules": block.rules,
                "inputs": len(block.partitions),
                "rows": c_rows(
                    model.coefficients[block.columns].reshape(block.rules, block.features),
                    rule_labels(block, structure),
                ),
            }
            for block in structure.blocks
            if block.partitions
        ],
        "rigid_rows": [c_row(row) for row in symmetric(model.rigid_body)],
        "visited_rows": [", ".join(f"0x{byte:02x}" for byte in row) for row in packed],
        "cell_bytes": packed.shape[1],
    }


def _point(points: Expected, index: int) -> str:
    motion = points.motion[index : index + 1]
    vectors = [motion.attitude[0], motion.rate[0], motion.acceleration[0]]
    matrices = [points.inertia[index], points.coriolis[index], np.array([points.torque[index], points.body[index]])]
    parts = [_braced(v) for v in vectors] + [_matrix(m) for m in matrices] + [_braced(points.scale[index])]
    flags = (0 if points.inside[index] else _OUTSIDE) | (_VERTICAL if vertical(motion.attitude)[0] else 0)
    return "    {\n" + "\n".join(filled(f"{part},", 8) for part in parts) + f"\n        {flags}u\n    }},"


def _braced(values: Array) -> str:
    return f"{{{c_row(values)}}}"


def _matrix(values: Array) -> str:
    return "{ " + ", ".join(_braced(row) for row in values) + " }"
