"""Continuous periodic fuzzy systems: partitions, memberships, consequents, their derivatives, and a fit by itself."""

from cpfls_cli.fuzzy.basis import Basis, antecedent, basis
from cpfls_cli.fuzzy.consequents import feature_count, features
from cpfls_cli.fuzzy.inputs import InputRange, input_range, map_input, seesaw
from cpfls_cli.fuzzy.membership import join_ends, memberships
from cpfls_cli.fuzzy.partition import breakpoints, uniform_weights
from cpfls_cli.fuzzy.periodic_fit import fit_periodic
from cpfls_cli.fuzzy.periodic_settings import PeriodicSettings
from cpfls_cli.fuzzy.periodic_system import FitQuality, PeriodicSystem

__all__ = [
    "Basis",
    "FitQuality",
    "InputRange",
    "PeriodicSettings",
    "PeriodicSystem",
    "antecedent",
    "basis",
    "breakpoints",
    "feature_count",
    "features",
    "fit_periodic",
    "input_range",
    "join_ends",
    "map_input",
    "memberships",
    "seesaw",
    "uniform_weights",
]
