"""Settings of the report."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Gt
from typing_extensions import Doc

from cpfls_cli.settings import Settings


@dataclass(frozen=True, kw_only=True)
class EvaluationTime(Settings):
    """How long an evaluation takes on a number of samples."""

    samples: Annotated[int, Gt(0), Doc("samples learned from and judged on")]
    svd_s: Annotated[float, Gt(0), Doc("singular value decomposition of the regressor, s")]
    evaluation_s: Annotated[float, Gt(0), Doc("evaluation as the paper does it, s")]
    compiled_s: Annotated[float, Gt(0), Doc("evaluation by the compiled code, s")]


@dataclass(frozen=True, kw_only=True)
class ReportSettings(Settings):
    """What the report shows."""

    title: Annotated[str, Doc("heading of the page")] = "Identification of rotational dynamics"
    notes: Annotated[tuple[str, ...], Doc("what a reader should know about this study, one sentence each")] = ()
    paper: Annotated[bool, Doc("show the figures that the paper prints beside ours")] = False
    evaluation_times: Annotated[
        tuple[EvaluationTime, ...],
        Doc("times measured elsewhere, for the paper's claims about time; no artifact holds any"),
    ] = ()
