"""Multi-objective genetic algorithm with the operators of the Sheffield toolbox; it knows no vehicle."""

from cpfls_cli.evolution.archive import Archive, Evaluate, Evaluation
from cpfls_cli.evolution.coding import BITS_PER_GENE, gray_decode, gray_encode
from cpfls_cli.evolution.dominance import pareto_front
from cpfls_cli.evolution.engine import evolve, start, step
from cpfls_cli.evolution.history import History
from cpfls_cli.evolution.ranking import rank
from cpfls_cli.evolution.settings import EvolutionSettings, Ranking, Reinsertion
from cpfls_cli.evolution.state import EvolutionState, Generation, best
from cpfls_cli.evolution.stopping import End, ended

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
