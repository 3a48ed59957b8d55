"""Continuous periodic fuzzy systems: partitions, memberships, consequents, their derivatives, and a fit by itself."""

from cpfls_cli.fuzzy.periodic_fit import PeriodicSettings, fit_periodic
from cpfls_cli.fuzzy.periodic_system import FitQuality, PeriodicSystem

__all__ = ["FitQuality", "PeriodicSettings", "PeriodicSystem", "fit_periodic"]
