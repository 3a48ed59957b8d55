"""The reproduction of the paper: its claims one by one, and its figures beside ours."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from cpfls_cli.pages.claims import Claim, Verdict, claims_of
from cpfls_cli.pages.claims.compared import ComparedFigure
from cpfls_cli.pages.claims.figures import compared_figures
from cpfls_cli.pages.fuzzy_part import seesaw_figure
from cpfls_cli.pages.source import Sources
from cpfls_cli.report.content import Block, Cell, Folded, Section, Table, Text, Tone

_TONES: dict[Verdict, Tone] = {
    Verdict.PASS: "good",
    Verdict.FAIL: "warning",
    Verdict.UNDECIDED: "note",
    Verdict.NOT_MEASURED: "note",
}


def reproduction_section(sources: Sources) -> Section | None:
    """Check the claims of the paper and compare its figures, where that is asked for.

    Returns
    -------
    Section or None
        None where the report is not about the paper.

    References
    ----------
    Sections 8, 10 and 11 and Figures 1 to 7 of the paper.
    """
    if not sources.settings.paper or sources.only_gap:
        return None
    claims = claims_of(sources)
    blocks: list[Block] = [
        Text(_count(claims), "note"),
        _claims(claims),
        _rules(claims),
        _figures(compared_figures(sources)),
        seesaw_figure("figure-1-seesaw"),
    ]
    return Section("reproduction", "Reproduction of the paper", blocks)


def _count(claims: Sequence[Claim]) -> str:
    counts = Counter(claim.verdict for claim in claims)
    shown = ", ".join(f"{counts[verdict]} {verdict}" for verdict in Verdict if counts[verdict])
    return (
        f"{len(claims)} claims of the paper: {shown}. The rules were set before anything was measured. UNDECIDED: the "
        "seeds do not settle it. NOT MEASURED: the line says what is missing and what makes it."
    )


def _claims(claims: Sequence[Claim]) -> Table:
    rows: list[list[str | Cell]] = [
        [f"{c.name}: “{c.words}” ({c.where})", Cell(c.verdict, _TONES[c.verdict]), c.ours, c.paper, c.why]
        for c in claims
    ]
    header = ("Claim, in the paper's words", "Verdict", "Ours", "Paper's", "Why")
    every = frozenset(range(len(header)))
    return Table("claims", "The claims of the paper, one by one.", header, rows, every, every - {1})


def _rules(claims: Sequence[Claim]) -> Folded:
    table = Table(
        "claim-rules",
        "How each claim is measured. Mean squared errors are of the whole training part.",
        ("Claim", "Measured, and what passes"),
        [[claim.name, claim.rule] for claim in claims],
        frozenset({0, 1}),
        frozenset({1}),
    )
    return Folded("What is measured for each claim, and what passes", [table])


def _figures(figures: Sequence[ComparedFigure]) -> Table:
    rows: list[list[str | Cell]] = [
        [f"Figure {f.title}", f.paper, f.ours, Cell(f.agreement, "plain" if f.agreement == "agrees" else "note"), f.why]
        for f in figures
    ]
    header = ("Figure", "The paper's text", "Ours", "Agreement", "Why")
    caption = (
        "The figures of the paper beside those of this page that have their numbers. The paper gives pictures and no "
        "data, so what is compared is what its text says of them."
    )
    every = frozenset(range(len(header)))
    return Table("figures-of-the-paper", caption, header, rows, every, every - {3})
