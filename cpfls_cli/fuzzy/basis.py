"""Basis functions of a fuzzy system: rule firing times consequent features, with gradients by the input angles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.fuzzy.inputs import MappedInput
from cpfls_cli.fuzzy.membership import Memberships, join_ends, memberships

Consequents = Literal["seesaw", "harmonic"]
Products = Literal["additive", "tensor"]


@dataclass(frozen=True)
class Basis:
    """Functions of the input angles at samples: the features of a rule, or, times its firing, those of all rules.

    A fuzzy system is ``f(q) = basis @ coefficients``.

    Attributes
    ----------
    value : array, shape (samples, functions)
        The first feature of a rule is the constant 1.
    gradient : array, shape (inputs, samples, functions), 1/rad
        Derivative by each input angle.
    """

    value: Array
    gradient: Array


def feature_count(inputs: int, consequents: Consequents, harmonic_order: int, products: Products) -> int:
    """Count the coefficients of one rule.

    Parameters
    ----------
    inputs : int
        Number of input angles, 1 or 2.
    consequents : {"seesaw", "harmonic"}
    harmonic_order : int
        Highest harmonic; used by `harmonic` only.
    products : {"additive", "tensor"}
    """
    single = 1 if consequents == "seesaw" else 2 * harmonic_order
    return int((1 + single) ** inputs) if products == "tensor" else 1 + single * inputs


def features(
    angles: list[Array],
    mapped: list[MappedInput],
    consequents: Consequents,
    harmonic_order: int,
    products: Products,
) -> Basis:
    """Evaluate the consequent features of a fuzzy system, which each rule adds up.

    `seesaw` gives ``1, s_1, s_2``, the paper's. `harmonic` puts ``sin k q, cos k q``, k = 1..order, in place of
    each s; it is smooth everywhere. `additive` joins the inputs' features side by side, `tensor` multiplies them.

    Parameters
    ----------
    angles : list of array, shape (samples,), rad
        One or two input angles.
    mapped : list of MappedInput
        The same angles as the system sees them.
    consequents, harmonic_order, products
        See `feature_count`.

    References
    ----------
    Equation (7); method.md section 5.
    """
    if consequents == "seesaw":
        single = [_with_constant(m.consequent[:, None], m.consequent_slope[:, None]) for m in mapped]
    else:
        single = [_with_constant(*_harmonics(angle, harmonic_order)) for angle in angles]
    if len(single) == 1:
        value, slope = single[0]
        return Basis(value, slope[None])
    (value_1, slope_1), (value_2, slope_2) = single
    if products == "tensor":
        gradient = np.stack([row_products(slope_1, value_2), row_products(value_1, slope_2)])
        return Basis(row_products(value_1, value_2), gradient)
    # Side by side; the constant is that of the first.
    by_first = np.hstack([slope_1, np.zeros_like(slope_2[:, 1:])])
    by_second = np.hstack([np.zeros_like(slope_1), slope_2[:, 1:]])
    return Basis(np.hstack([value_1, value_2[:, 1:]]), np.stack([by_first, by_second]))


def _harmonics(angle: Array, order: int) -> tuple[Array, Array]:
    multiples = np.arange(1, order + 1)
    phase = angle[:, None] * multiples
    sine, cosine = np.sin(phase), np.cos(phase)
    return np.hstack([sine, cosine]), np.hstack([multiples * cosine, -multiples * sine])


def _with_constant(value: Array, slope: Array) -> tuple[Array, Array]:
    one = np.ones((len(value), 1))
    return np.hstack([one, value]), np.hstack([0.0 * one, slope])


def row_products(first: Array, second: Array) -> Array:
    """Multiply all pairs of columns (row-wise Kronecker product); the index of `second` runs fastest."""
    return (first[:, :, None] * second[:, None, :]).reshape(len(first), -1)


def antecedent(mapped: MappedInput, breakpoints: Array, circular: bool) -> Memberships:
    """Evaluate the firing of rules along one input, shape (samples, rules), and its slope by the angle, 1/rad.

    Parameters
    ----------
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
        return Memberships(join_ends(degrees.value), join_ends(slope))
    return Memberships(degrees.value, slope)


def rule_firing(antecedents: list[Memberships]) -> tuple[Array, Array]:
    """Multiply the antecedents of all inputs, one or two.

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


def basis(antecedents: list[Memberships], consequent: Basis) -> Basis:
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
