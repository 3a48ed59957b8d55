"""Continuous periodic fuzzy systems: partitions, memberships, consequents, their derivatives, and a fit by itself."""

from cpfls_cli.fuzzy.basis import Basis, antecedent, basis, feature_count, features
from cpfls_cli.fuzzy.inputs import InputRange, input_range, map_input, seesaw
from cpfls_cli.fuzzy.membership import breakpoints, join_ends, memberships, uniform_weights
from cpfls_cli.fuzzy.periodic_fit import PeriodicSettings, fit_periodic
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
