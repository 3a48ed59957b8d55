"""Settings of the genetic algorithm."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Ge, Gt, Le, Lt
from typing_extensions import Doc

from cpfls_cli.errors import SettingError
from cpfls_cli.settings import Settings

Ranking = Literal["quantity-dominance", "pareto-count", "pareto-fronts"]
Reinsertion = Literal["uniform", "fitness"]
Share = Annotated[float, Ge(0), Le(1)]


@dataclass(frozen=True, kw_only=True)
class EvolutionSettings(Settings):
    """Configure the genetic algorithm; the defaults are those of the paper, Table 5, population 75.

    Raises
    ------
    SettingError
        If a subpopulation would hold fewer than two individuals.

    References
    ----------
    method.md section 7.
    """

    population: Annotated[int, Ge(2), Doc("chromosomes in the population, over all subpopulations")] = 75
    generations: Annotated[int, Ge(0), Doc("generations bred after the initial population")] = 25
    subpopulations: Annotated[int, Ge(1), Doc("subpopulations that breed apart; the population is split evenly")] = 5
    migration_rate: Annotated[Share, Doc("share of each subpopulation replaced at a migration")] = 0.2
    migration_interval: Annotated[int, Gt(0), Doc("generations between two migrations")] = 5
    generation_gap: Annotated[float, Gt(0), Le(1), Doc("offspring bred, as a share of the parents")] = 0.8
    crossover_rate: Annotated[Share, Doc("probability that a pair of parents exchanges genes")] = 0.8
    insertion_rate: Annotated[
        float, Gt(0), Le(1), Doc("share of the offspring, the fittest, that enters the population")
    ] = 0.8
    selective_pressure: Annotated[
        float, Ge(1), Le(2), Doc("expected offspring of the fittest over the mean; 1 selects at random")
    ] = 1.5
    mutated_individuals: Annotated[Share, Doc("share of the offspring that mutates")] = 0.04
    mutated_bits: Annotated[Share, Doc("share of the bits that flips in an offspring that mutates")] = 0.01
    ranking: Annotated[Ranking, Doc("comparison of objectives: quantity-dominance, pareto-count or pareto-fronts")] = (
        "quantity-dominance"
    )
    reinsertion: Annotated[
        Reinsertion, Doc("parents replaced by offspring: uniform (at random) or fitness (the least fit)")
    ] = "uniform"
    stall_generations: Annotated[
        int | None, Ge(1), Doc("end when the best of no objective improved over so many generations; null: never")
    ] = None
    stall_improvement: Annotated[
        float,
        Ge(0),
        Lt(1),
        Doc("relative improvement over stall_generations up to which an objective counts as stalled"),
    ] = 1e-3

    def __post_init__(self) -> None:
        """Refuse a population that is too small for its subpopulations."""
        if self.population < 2 * self.subpopulations:
            raise SettingError(
                "population",
                f"{self.population} individuals cannot fill {self.subpopulations} subpopulations with two "
                f"each; use at least {2 * self.subpopulations}, or fewer subpopulations",
            )
