"""The rules: which of them the data excite."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from cpfls_cli.pages.sections.each import section_of_each
from cpfls_cli.pages.source import Source, Sources
from cpfls_cli.pages.verdict import fuzzy_part_off
from cpfls_cli.report.content import Block, Facts, Heading, Section, Table, Text
from cpfls_cli.report.numbers import count, number, percent


def rules_section(sources: Sources) -> Section | None:
    """Show what of the models the data determine.

    Returns
    -------
    Section or None
        None where no model was given.
    """
    return section_of_each("rules", "Excitation of the rules", sources.models, _rules)


def _rules(model: Source, index: int) -> Iterator[Block]:
    artifact = model.artifact
    names, excited = artifact.texts("rules/name"), artifact.array("rules/excited") != 0
    values = artifact.array("solve/singular_values")
    condition = number(artifact.number("solve/condition_number"), 5)
    yield Heading(model.label)
    yield Facts(
        [
            ("Rules excited", f"{int(np.sum(excited))} of {len(names)}"),
            ("Rank of the solved system", f"{count(artifact.number('solve/rank'))} of {len(values)}"),
            (
                "Condition number",
                f"{condition} over the kept singular values",
            ),
        ]
    )
    if excited.all():
        yield Text("Every rule fires in training, and the data determine most of its coefficients.")
        return
    silent = np.flatnonzero(~excited)
    firing, determined = artifact.array("rules/firing"), artifact.array("rules/determined")
    rows = [[names[i], number(float(firing[i]), 3), percent(float(determined[i]))] for i in silent]
    caption = (
        "Rules that are not excited: largest firing strength in training, and the share of the rule's coefficients "
        "that the data determine. What the model says there is not learned."
    )
    if fuzzy_part_off(model):
        caption += " The fuzzy part is off, so the model uses none of them."
    yield Table(f"silent-rules-{index}", caption, ("Rule", "Largest firing", "Determined"), rows)
