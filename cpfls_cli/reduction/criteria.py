"""The selection rules by name."""

from __future__ import annotations

from cpfls_cli.reduction.criterion import Criterion
from cpfls_cli.reduction.optimal_design import OptimalDesign
from cpfls_cli.reduction.printed import PrintedRule
from cpfls_cli.reduction.row_space import RowSpace
from cpfls_cli.reduction.settings import CriterionName
from cpfls_cli.reduction.smallest import SmallestSingularValue

EXCHANGE_INFORMATION: dict[str, float] = {"K-exchange": 0.0, "KD-exchange": 2.0}
"""Weight of the information kept, for the criteria that choose by exchange. Without it models come out several times
worse than from random samples; with 2 no worse; with 3, the condition number of 80 samples of the paper's path is not
below half of the full set's any more."""


def make_criterion(space: RowSpace, name: CriterionName) -> Criterion:
    """Create the rule of a criterion that chooses samples one by one.

    Parameters
    ----------
    space : RowSpace
    name : {"sigma_min", "A", "D", "paper-literal"}
    """
    if name == "paper-literal":
        full_column_rank = space.rank == space.parameters
        return PrintedRule(space.rows, space.rank_tolerance, full_column_rank=full_column_rank)
    return SmallestSingularValue(space.rows) if name == "sigma_min" else OptimalDesign(space.rows, name)
