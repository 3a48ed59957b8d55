"""Continuous periodic fuzzy systems: partitions, memberships, consequents and their derivatives."""

from cpfls_cli.fuzzy.basis import Basis, antecedent, basis
from cpfls_cli.fuzzy.consequents import feature_count, features
from cpfls_cli.fuzzy.inputs import InputRange, input_range, map_input, seesaw
from cpfls_cli.fuzzy.membership import join_ends, memberships
from cpfls_cli.fuzzy.partition import breakpoints, uniform_weights

__all__ = [
    "Basis",
    "InputRange",
    "antecedent",
    "basis",
    "breakpoints",
    "feature_count",
    "features",
    "input_range",
    "join_ends",
    "map_input",
    "memberships",
    "seesaw",
    "uniform_weights",
]
