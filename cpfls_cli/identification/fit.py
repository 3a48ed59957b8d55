"""What a solver finds for given partitions."""

from __future__ import annotations

from dataclasses import dataclass

from cpfls_cli.arrays import Array


@dataclass(frozen=True)
class Fit:
    """Linear parameters of a model, and how they were found.

    Attributes
    ----------
    coefficients : array, shape (parameters,), kg m^2
        Of the fuzzy inertia functions.
    rigid_body : array, shape (6,), kg m^2
        Inertia parameters under them; zero without a rigid-body base.
    ridge_weight : float
        0 without a ridge; infinite where the fuzzy part is off.
    mean_squared_error : float
        What the solver minimised, on the samples it learned from: of the torque in (N m)^2, or cross-validated and
        scaled by axis for a rigid-body base.
    conditioning : float
        Condition number of the system solved; one of smaller rank is always worse, and finite.
    row_scale : array, shape (3,), 1/(N m)
        What the rows of each axis were multiplied with.
    column_size : array, shape (parameters,)
        What the columns were divided by before the ridge held their coefficients; 1 without a ridge.
    """

    coefficients: Array
    rigid_body: Array
    ridge_weight: float
    mean_squared_error: float
    conditioning: float
    row_scale: Array
    column_size: Array
