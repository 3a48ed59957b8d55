"""Settings of the genetic algorithm."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Ge, Gt, Le, Lt
from typing_extensions import Doc

from cpfls_cli.errors import SettingError
from cpfls_cli.settings import Settings

Ranking = Literal["quantity-dominance", "pareto-count", "pareto-fronts"]
Recombination = Literal["single-point", "intermediate"]
Reinsertion = Literal["uniform", "fitness", "elitist"]
Share = Annotated[float, Ge(0), Le(1)]


@dataclass(frozen=True, kw_only=True)
class EvolutionSettings(Settings):
    """Configure the genetic algorithm; the defaults are what found the best models in the least time.

    Raises
    ------
    SettingError
        If a subpopulation would hold fewer than two individuals.

    References
    ----------
    method.md section 7.
    """

    population: Annotated[int, Ge(2), Doc("chromosomes in the population, over all subpopulations")] = 30
    generations: Annotated[int, Ge(0), Doc("generations bred after the initial population")] = 60
    subpopulations: Annotated[int, Ge(1), Doc("subpopulations that breed apart; the population is split evenly")] = 1
    migration_rate: Annotated[Share, Doc("share of each subpopulation replaced at a migration")] = 0.2
    migration_interval: Annotated[int, Gt(0), Doc("generations between two migrations")] = 5
    generation_gap: Annotated[float, Gt(0), Le(1), Doc("offspring bred, as a share of the parents")] = 0.67
    crossover_rate: Annotated[Share, Doc("probability that a pair of parents recombines")] = 1.0
    recombination: Annotated[
        Recombination,
        Doc("of a pair: single-point (exchange the tails of their bits) or intermediate (gene by gene in between)"),
    ] = "intermediate"
    insertion_rate: Annotated[
        float, Gt(0), Le(1), Doc("share of the offspring, the fittest, that enters the population")
    ] = 1.0
    selective_pressure: Annotated[
        float, Ge(1), Le(2), Doc("expected offspring of the fittest over the mean; 1 selects at random")
    ] = 2.0
    mutated_individuals: Annotated[Share, Doc("share of the offspring that mutates")] = 1.0
    mutated_bits: Annotated[Share, Doc("share of the bits that flips in an offspring that mutates")] = 0.003
    ranking: Annotated[Ranking, Doc("comparison of objectives: quantity-dominance, pareto-count or pareto-fronts")] = (
        "quantity-dominance"
    )
    first_objective_weight: Annotated[
        int, Ge(1), Le(1000), Doc("how often the first objective counts in quantity-dominance; the others count once")
    ] = 1
    reinsertion: Annotated[
        Reinsertion,
        Doc("parents replaced: uniform (at random), fitness (the least fit), elitist (only by fitter offspring)"),
    ] = "elitist"
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
