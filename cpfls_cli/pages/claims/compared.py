"""A figure of the paper beside ours."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from cpfls_cli.report.numbers import UNKNOWN

Agreement = Literal["agrees", "differs", "read as printed", "cannot be compared", "not shown"]


@dataclass(frozen=True)
class ComparedFigure:
    """A figure of the paper beside ours.

    Attributes
    ----------
    title : str
        Number and subject.
    paper, ours : str
        What the paper's text says of it in numbers, and the same of ours.
    agreement : {"agrees", "differs", "read as printed", "cannot be compared", "not shown"}
        Read as printed: the paper's own numbers, decoded as here, agree with each other. It says nothing of any model.
    """

    title: str
    paper: str
    ours: str
    agreement: Agreement
    why: str


def agreement(agrees: bool) -> Agreement:
    """Say whether two numbers agree.

    Returns
    -------
    {"agrees", "differs"}
    """
    return "agrees" if agrees else "differs"


def reading(agrees: bool) -> Agreement:
    """Say whether printed numbers agree with each other as they are decoded here, whatever was identified.

    Returns
    -------
    {"read as printed", "differs"}
    """
    return "read as printed" if agrees else "differs"


def not_shown(title: str, printed: str, why: str) -> ComparedFigure:
    """Keep the place of a figure that cannot be drawn.

    Parameters
    ----------
    why : str
        What is missing.
    """
    return ComparedFigure(title, printed, UNKNOWN, "not shown", why)
