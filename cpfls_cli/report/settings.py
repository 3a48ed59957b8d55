"""Settings of the report."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from typing_extensions import Doc

from cpfls_cli.settings import Settings


@dataclass(frozen=True, kw_only=True)
class ReportSettings(Settings):
    """What the report shows."""

    title: Annotated[str, Doc("heading of the page")] = "Identification of rotational dynamics"
    notes: Annotated[tuple[str, ...], Doc("what a reader should know about this study, one sentence each")] = ()
    paper: Annotated[bool, Doc("show the figures that the paper prints beside ours")] = False
