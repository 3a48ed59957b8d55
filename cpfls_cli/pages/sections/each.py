"""A section that shows sources of one kind one after the other."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

from cpfls_cli.pages.source import Source
from cpfls_cli.report.content import Block, Section


def section_of_each(
    name: str, title: str, sources: Sequence[Source], blocks: Callable[[Source, int], Iterable[Block]]
) -> Section | None:
    """Join what is shown of each source to one section.

    Parameters
    ----------
    name : str
        Identifier of the section.
    blocks : callable
        What is shown of one source; takes it and its number, from 1.

    Returns
    -------
    Section or None
        None where there is no source.
    """
    if not sources:
        return None
    shown = [block for number, source in enumerate(sources, start=1) for block in blocks(source, number)]
    return Section(name, title, shown)
