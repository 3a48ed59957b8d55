"""The basis of a fuzzy system: rule firing times consequent features, with gradients by the input angles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.fuzzy.consequents import Features, row_products
from cpfls_cli.fuzzy.inputs import MappedInput
from cpfls_cli.fuzzy.membership import join_ends, membership_sensitivity, memberships


@dataclass(frozen=True)
class Antecedent:
    """Firing of the rules along one input.

    Attributes
    ----------
    value : array, shape (samples, rules)
    slope : array, shape (samples, rules), 1/rad
        Derivative by the input angle.
    """

    value: Array
    slope: Array


@dataclass(frozen=True)
class AntecedentSensitivity:
    """Derivatives of an antecedent by the inner breakpoints of its partition.

    Attributes
    ----------
    value, slope : array, shape (samples, rules, breakpoints)
    """

    value: Array
    slope: Array


@dataclass(frozen=True)
class Basis:
    """Basis functions of a fuzzy system, ``f(q) = basis @ coefficients``.

    Attributes
    ----------
    value : array, shape (samples, rules * features)
    gradient : array, shape (inputs, samples, rules * features), 1/rad
        Derivative by each input angle.
    """

    value: Array
    gradient: Array


def antecedent(mapped: MappedInput, breakpoints: Array, circular: bool) -> Antecedent:
    """Evaluate the firing of rules along one input.

    Parameters
    ----------
    mapped : MappedInput
    breakpoints : array, shape (functions,)
    circular : bool
        True joins the first and the last function: functions - 1 rules.

    References
    ----------
    Equations (6)-(9), Tables 1 and 2.
    """
    degrees = memberships(mapped.antecedent, breakpoints)
    slope = degrees.slope * mapped.antecedent_slope[:, None]
    if circular:
        return Antecedent(join_ends(degrees.value), join_ends(slope))
    return Antecedent(degrees.value, slope)


def antecedent_sensitivity(mapped: MappedInput, breakpoints: Array, circular: bool) -> AntecedentSensitivity:
    """Differentiate the firing of rules by the inner breakpoints.

    Parameters
    ----------
    mapped, breakpoints, circular
        See `antecedent`.
    """
    by_breakpoint = membership_sensitivity(mapped.antecedent, breakpoints)
    slope = by_breakpoint.slope * mapped.antecedent_slope[:, None, None]
    if circular:
        return AntecedentSensitivity(join_ends(by_breakpoint.value), join_ends(slope))
    return AntecedentSensitivity(by_breakpoint.value, slope)


def rule_firing(antecedents: list[Antecedent]) -> tuple[Array, Array]:
    """Multiply the antecedents of all inputs.

    Parameters
    ----------
    antecedents : list of Antecedent
        One per input, one or two.

    Returns
    -------
    value : array, shape (samples, rules)
        The rule index of the second input runs fastest.
    gradient : array, shape (inputs, samples, rules), 1/rad
    """
    if len(antecedents) == 1:
        return antecedents[0].value, antecedents[0].slope[None]
    first, second = antecedents
    gradient = [row_products(first.slope, second.value), row_products(first.value, second.slope)]
    return row_products(first.value, second.value), np.stack(gradient)


def basis(antecedents: list[Antecedent], consequent: Features) -> Basis:
    """Combine rule firing and consequent features by the product rule.

    References
    ----------
    Equations (9) and (13).
    """
    firing, firing_gradient = rule_firing(antecedents)
    gradient = [
        row_products(by_angle, consequent.value) + row_products(firing, slope)
        for by_angle, slope in zip(firing_gradient, consequent.gradient, strict=True)
    ]
    return Basis(row_products(firing, consequent.value), np.stack(gradient))
