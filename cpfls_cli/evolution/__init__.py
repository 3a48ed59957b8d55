"""Multi-objective genetic algorithm with the operators of the Sheffield toolbox; it knows no vehicle."""

from cpfls_cli.evolution.archive import Archive, Evaluate, Evaluation
from cpfls_cli.evolution.engine import End, EvolutionState, Generation, History, best, ended, evolve, start, step
from cpfls_cli.evolution.operators import BITS_PER_GENE, gray_decode, gray_encode
from cpfls_cli.evolution.ranking import pareto_front, rank
from cpfls_cli.evolution.settings import EvolutionSettings, Ranking, Reinsertion

__all__ = [
    "BITS_PER_GENE",
    "Archive",
    "End",
    "Evaluate",
    "Evaluation",
    "EvolutionSettings",
    "EvolutionState",
    "Generation",
    "History",
    "Ranking",
    "Reinsertion",
    "best",
    "ended",
    "evolve",
    "gray_decode",
    "gray_encode",
    "pareto_front",
    "rank",
    "start",
    "step",
]
