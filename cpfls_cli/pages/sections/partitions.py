"""Figure 6 and the numbers behind it: partitions, chromosome, coefficients."""

from __future__ import annotations

from collections.abc import Iterator

from cpfls_cli.inertia import INERTIA_PARAMETERS
from cpfls_cli.pages.figures.partitions import partitions_figure, partitions_of
from cpfls_cli.pages.sections.each import section_of_each
from cpfls_cli.pages.source import Source, Sources
from cpfls_cli.pages.verdict import fuzzy_part_off
from cpfls_cli.report.content import Block, Folded, Section, Table, Text
from cpfls_cli.report.numbers import count, number


def partitions_section(sources: Sources) -> Section | None:
    """Show the partitions of the models and their parameters.

    Returns
    -------
    Section or None
        None where no model was given.

    References
    ----------
    Figure 6 and section 10 of the paper.
    """
    return section_of_each("partitions", "Partitions and parameters", sources.models, _model)


def _model(model: Source, index: int) -> Iterator[Block]:
    if fuzzy_part_off(model):
        yield Text(f"The fuzzy part of {model.label} is off: no membership function takes part in it.", "note")
    elif max(len(peaks) for peaks in partitions_of(model).values()) > 1:
        yield partitions_figure(f"figure-6-partitions-{index}", model)
    else:
        yield Text(f"{model.label} has one rule per input: its one membership function is 1 everywhere.", "note")
    tables = [_partitions(model, index), _inertia(model, index), _coefficients(model, index)]
    yield Folded(f"Chromosome, breakpoints, inertia and coefficients of {model.label}", tables)


def _partitions(model: Source, index: int) -> Table:
    weights = [count(weight) for weight in model.artifact.array("model/weights")]
    rows = []
    for name, peaks in partitions_of(model).items():
        own, weights = weights[: len(peaks) - 1], weights[len(peaks) - 1 :]
        rows.append([name, " ".join(own), " ".join(number(float(peak), 5) for peak in peaks)])
    header = ("Partition", "Weights (16 bit)", "Breakpoints")
    return Table(f"chromosome-{index}", "Chromosome and the partitions that it encodes.", header, rows)


def _inertia(model: Source, index: int) -> Table:
    artifact = model.artifact
    fitted = artifact.array("baselines/rigid_body")
    own = artifact.array("model/rigid_body") if artifact.text("model/base") == "rigid-body" else None
    rows = [
        [name, number(float(own[place])) if own is not None else "none", number(float(fitted[place]))]
        for place, name in enumerate(INERTIA_PARAMETERS)
    ]
    header = ("kg m²", "Under the fuzzy part", "Rigid body alone")
    return Table(f"inertia-{index}", "Inertia found by least squares.", header, rows)


def _coefficients(model: Source, index: int) -> Table:
    names, values = model.artifact.texts("model/parameter"), model.artifact.array("model/coefficients")
    rows = [[name, number(float(value), 5)] for name, value in zip(names, values, strict=True)]
    return Table(
        f"coefficients-{index}", "Coefficients of the rule consequents, kg m².", ("Coefficient", "Value"), rows
    )
