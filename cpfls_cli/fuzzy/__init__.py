"""Continuous periodic fuzzy systems: partitions, memberships, consequents, their derivatives, and a fit by itself."""

from cpfls_cli.fuzzy.periodic import FitQuality, PeriodicSettings, PeriodicSystem, fit_periodic

__all__ = ["FitQuality", "PeriodicSettings", "PeriodicSystem", "fit_periodic"]
