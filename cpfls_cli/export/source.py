"""What the templates of source code are filled with, in any language."""

from __future__ import annotations

from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from cpfls_cli.dynamics.rigid_body import VERTICAL
from cpfls_cli.export.facts import banner, facts
from cpfls_cli.export.sheet import Sheet
from cpfls_cli.export.tables import number, rules_along
from cpfls_cli.export.text import comment_lines, literal_text
from cpfls_cli.identification.excitation import CELLS
from cpfls_cli.regressor.structure import ModelStructure


def fill(template: str, words: dict[str, Any]) -> str:
    """Fill a template.

    Parameters
    ----------
    template : str
        File name.
    words : dict
        All that it asks for.
    """
    environment = Environment(
        loader=PackageLoader("cpfls_cli.export"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,
    )
    return environment.get_template(template).render(words)


def common_words(sheet: Sheet) -> dict[str, Any]:
    """Gather what all languages ask for: names, numbers, and which parts of the code the structure needs."""
    verdict = sheet.evidence.verdict
    return {
        "name": sheet.name,
        "macro": sheet.name.upper(),
        "banner": comment_lines(banner(sheet)),
        "facts": comment_lines(facts(sheet)),
        "complete": sheet.evidence.complete,
        "verdict_label": literal_text(verdict.label) if verdict else "none",
        "model_sha256": sheet.provenance.sha256,
        "vertical": VERTICAL,
        "cells": CELLS,
        "cell_deg": 360 // CELLS,
        "fuzzy": sheet.fuzzy,
        "rigid": sheet.rigid,
        "constant": number(sheet.model.coefficients[0]),
        **_structure_words(sheet.model.structure),
        "ranges": [{"minimum": number(r.minimum), "width": number(r.width)} for r in sheet.model.ranges],
    }


def _structure_words(structure: ModelStructure) -> dict[str, Any]:
    settings = structure.settings
    harmonic, data_range = settings.consequents == "harmonic", settings.input_map == "data-range"
    rules_used = any(block.rules > 1 for block in structure.blocks)
    mapped = not harmonic or rules_used
    features = {len(block.partitions): block.features for block in structure.blocks}
    return {
        "circular": structure.circular,
        "data_range": data_range,
        "harmonic": harmonic,
        "tensor": settings.products == "tensor",
        "order": settings.harmonic_order,
        "rules_used": rules_used,
        "seesaw_used": structure.circular and mapped and (data_range or not harmonic),
        "features_1": features[1],
        "features_2": features[2],
        "features_text": _features_text(structure),
        "pitch_rules": {
            block.function.name: rules_along(structure, block.partitions[-1])
            for block in structure.blocks
            if len(block.partitions) > 1
        },
    }


def _features_text(structure: ModelStructure) -> list[str]:
    settings = structure.settings
    order = settings.harmonic_order
    own = "s, the triangle wave of the angle, as the inputs of the rules have it"
    if settings.consequents == "harmonic":
        own = f"sin q .. sin {order}q, cos q .. cos {order}q" if order > 1 else "sin q, cos q"
    elif not structure.circular:
        own = "x, the angle on the scale of the membership functions"
    pairs = "1, those of roll, those of pitch"
    if settings.products == "tensor":
        pairs = "all products of (1, those of roll) and (1, those of pitch), pitch running fastest"
    return comment_lines([f"one input: 1, {own};", f"two inputs: {pairs}."])
