"""The regressor Q(q, qd, qdd) of a model structure: torque is linear in the coefficients of the inertia functions."""

from cpfls_cli.regressor.motion import Motion
from cpfls_cli.regressor.regressor import InertiaValues, Regressor, data_ranges, uniform_breakpoints
from cpfls_cli.regressor.structure import ModelStructure, StructureSettings, model_structure

__all__ = [
    "InertiaValues",
    "ModelStructure",
    "Motion",
    "Regressor",
    "StructureSettings",
    "data_ranges",
    "model_structure",
    "uniform_breakpoints",
]
