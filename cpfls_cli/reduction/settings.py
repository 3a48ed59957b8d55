"""Settings of the data reduction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Ge, Gt, Lt
from typing_extensions import Doc

from cpfls_cli.errors import SettingError
from cpfls_cli.settings import Settings

CriterionName = Literal["KD-exchange", "K-exchange", "sigma_min", "A", "D", "even", "paper-literal"]


@dataclass(frozen=True, kw_only=True)
class ReductionSettings(Settings):
    """How many samples to keep, and what makes a sample worth keeping."""

    size: Annotated[
        Annotated[int, Ge(1)] | None, Doc("samples to keep, three rows each; null: only the condition number stops")
    ] = 685
    condition_number: Annotated[
        Annotated[float, Gt(1)] | None,
        Doc("stop as soon as the kept samples have full rank and at most this condition number; null: only the size"),
    ] = None
    criterion: Annotated[
        CriterionName,
        Doc(
            "KD-exchange (small condition number and much information, by exchanging samples), K-exchange (smallest "
            "condition number, whatever is lost), or what the next sample must improve most: sigma_min (smallest "
            "singular value), A (sum of the parameter variances), D (their volume); even (every n-th sample); "
            "paper-literal (the printed rule, with the smallest value of the thin decomposition)"
        ),
    ] = "KD-exchange"
    rank_tolerance: Annotated[
        float, Gt(0), Lt(1), Doc("singular values below this fraction of the largest one count as zero")
    ] = 1e-10

    pool: Annotated[
        int, Ge(1), Doc("samples held in memory to choose from; longer flights are sampled, by leverage")
    ] = 20000

    def __post_init__(self) -> None:
        if self.size is not None and self.size > self.pool:
            raise SettingError("pool", f"expected at least size = {self.size}: samples are chosen from the pool")
        if self.size is None and self.condition_number is None:
            raise SettingError("size", "give a size, a condition_number or both: nothing would stop the reduction")
        if self.criterion == "even" and (self.size is None or self.condition_number is not None):
            raise SettingError("criterion", "even needs a size and no condition_number: a part of it would not be even")
