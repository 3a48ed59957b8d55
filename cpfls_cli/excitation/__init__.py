"""Paths that excite all parameters of a model, by optimal design of the experiment."""

from cpfls_cli.excitation.objective import condition_number
from cpfls_cli.excitation.optimise import Excitation, optimised_rotation

__all__ = ["Excitation", "condition_number", "optimised_rotation"]
