"""The selection rules by name."""

from __future__ import annotations

from cpfls_cli.reduction.criterion import Criterion
from cpfls_cli.reduction.optimal_design import OptimalDesign
from cpfls_cli.reduction.printed import PrintedRule
from cpfls_cli.reduction.row_space import RowSpace
from cpfls_cli.reduction.settings import CriterionName
from cpfls_cli.reduction.smallest import SmallestSingularValue

EXCHANGE_INFORMATION: dict[str, float] = {"K-exchange": 0.0, "KD-exchange": 2.0}
"""Weight of the information kept, for the criteria that choose by exchange. With 2 the models trained are no worse than
from random samples, where the condition number alone makes them several times worse; more buys little."""


def make_criterion(space: RowSpace, name: CriterionName) -> Criterion:
    """Create the rule of a criterion that chooses samples one by one.

    Parameters
    ----------
    space : RowSpace
    name : {"sigma_min", "A", "D", "paper-literal"}

    Returns
    -------
    Criterion
    """
    if name == "paper-literal":
        full_column_rank = space.rank == space.parameters
        return PrintedRule(space.rows, space.rank_tolerance, full_column_rank=full_column_rank)
    return SmallestSingularValue(space.rows) if name == "sigma_min" else OptimalDesign(space.rows, name)
