"""Evaluate chromosomes here, in processes beside, or on a cluster: one interface, one result."""

from cpfls_cli.workers.employ import employ
from cpfls_cli.workers.workforce import Workforce

__all__ = ["Workforce", "employ"]
