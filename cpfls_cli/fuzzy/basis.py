"""Memberships, inputs and basis functions of a fuzzy system: firing times features, with gradients by the angles.

The formula is that of `z_function`: the falling edge of a function over the position u between its own peak (0) and
the next one (1). All else of a partition follows from it, whatever its shape: the next function rises as 1 minus it,
and the slopes follow by the chain rule. It has to fall from 1 to 0, with slope 0 at both ends: else the torque jumps.

Another formula is written here, and in the copies that stand where this one cannot be called:

- `cpfls_cli.regressor.kernels`, `_z_function`: the compiled loops of the search. numba caches compiled code by its
  file, and would not notice that a function which it compiled in from another file has changed.
- `cpfls_cli.playback.model`, `_blended`: the vehicle in any kind of numbers, which simulation and exports trace.
- `cpfls_cli/export/templates/model.c.j2`, `rules_of`, and `model.py.j2`, `_firing`, this in NumPy, CasADi and JAX: over
  the attitude. They run without this package; `tests/unit/export/test_simulators.py` flies them.
- `Z_FUNCTION` here, the words that the JSON of a model carries, and docs/method.md section 4.

`tests/unit/export/test_membership.py` evaluates all of them at the same points.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.result import about
from cpfls_cli.rotations import wrapped

Z_FUNCTION = "1 - 2 u^2 up to u = 1/2 and 2 (1 - u)^2 after it"
"""`z_function` in words."""


def breakpoints(weights: Array) -> Array:
    """Decode the breakpoints of a partition, ``b_k = sum_{i<=k} a_i / sum_j a_j``.

    Parameters
    ----------
    weights : array, shape (..., functions - 1), >= 0
        Weights a_i. An empty last axis is the partition of one function.

    Returns
    -------
    array, shape (..., functions)
        Where each membership function has its only peak: 0, b_1, ..., 1. One function alone has its peak at 0.
        All weights zero give NaN: such a partition is not defined.

    References
    ----------
    Equation (10); method.md section 4.
    """
    ends = np.zeros((*weights.shape[:-1], weights.shape[-1] + 1))
    if weights.shape[-1] == 0:
        return ends
    total = np.sum(weights, axis=-1, keepdims=True)
    undefined = ~(total > 0)
    np.cumsum(weights, axis=-1, out=ends[..., 1:])
    ends[..., 1:] /= np.where(undefined, 1.0, total)
    ends[..., -1] = 1.0
    ends[undefined[..., 0]] = np.nan
    return ends


def uniform_weights(functions: int) -> Array:
    """Give the weights of the equidistant partition of one or more functions, shape (functions - 1,)."""
    return np.ones(functions - 1)


@dataclass(frozen=True)
class Memberships:
    """Degrees of membership of samples in the functions of one partition, or firing of the rules along one input.

    Attributes
    ----------
    value : array, shape (samples, functions)
        Every row sums to 1.
    slope : array, shape (samples, functions)
        Derivative by the scaled input, or by the angle.
    """

    value: Array
    slope: Array


def z_function(position: Array) -> tuple[Array, Array, Array]:
    """Evaluate Zadeh's z-function, the edge along which a membership function falls, and two derivatives by u.

    ``z(u) = 1 - 2 u^2`` up to the middle, ``2 (1 - u)^2`` after it; u is 0 at the function's own peak, 1 at its
    neighbour's. Equation (8) with the squares that its print lost; method.md section 4.
    """
    left = position < 0.5
    rest = 1.0 - position
    value = np.where(left, 1.0 - 2.0 * position**2, 2.0 * rest**2)
    first = np.where(left, -4.0 * position, -4.0 * rest)
    return value, first, np.where(left, -4.0, 4.0)


def memberships(scaled_input: Array, breakpoints: Array) -> Memberships:
    """Evaluate all functions of a partition.

    Between two neighbouring breakpoints the left function falls along `z_function`, and the right one rises along
    s = 1 - z. Beyond the ends the outer functions stay at 1.

    Parameters
    ----------
    scaled_input : array, shape (samples,)
        Input on [0, 1]; values outside belong to the outer functions.
    breakpoints : array, shape (functions,)
        Ascending peaks from 0 to 1; equal neighbours make a function of zero width.

    References
    ----------
    Equation (8) with the squares that its print lost; method.md section 4.
    """
    if len(breakpoints) == 1:
        return Memberships(np.ones((len(scaled_input), 1)), np.zeros((len(scaled_input), 1)))
    clipped = np.minimum(np.maximum(scaled_input, 0.0), 1.0)
    found = np.searchsorted(breakpoints, clipped, side="right") - 1
    interval = np.minimum(np.maximum(found, 0), len(breakpoints) - 2)
    width = np.diff(breakpoints)[interval]
    # A function of zero width is met only at the very end of the range; its left neighbour has gone there.
    empty = width <= 0.0
    safe = np.where(empty, 1.0, width)
    falling, slope, _ = z_function(np.where(empty, 1.0, (clipped - breakpoints[interval]) / safe))
    slope = np.where(clipped == scaled_input, slope, 0.0) / safe
    functions = len(breakpoints)
    return Memberships(
        _spread(falling, 1.0 - falling, interval, functions), _spread(slope, -slope, interval, functions)
    )


def join_ends(values: Array) -> Array:
    """Join the first and the last function of a partition into one, which closes the circle.

    Parameters
    ----------
    values : array, shape (samples, functions, ...)
        Anything that adds up over functions: degrees of membership, slopes, sensitivities.

    Returns
    -------
    array, shape (samples, max(functions - 1, 1), ...)

    References
    ----------
    Tables 1 and 2: ``mu_pi0 = mu_z + mu_s``.
    """
    if values.shape[1] == 1:
        return values
    joined = values[:, :-1].copy()
    joined[:, 0] += values[:, -1]
    return joined


def _spread(left: Array, right: Array, interval: IntArray, functions: int) -> Array:
    spread = np.zeros((len(left), functions))
    rows = np.arange(len(left))
    spread[rows, interval] = left
    spread[rows, interval + 1] += right
    return spread


InputMap = Literal["full-circle", "data-range"]


@dataclass(frozen=True)
class InputRange:
    """Smallest and largest value of one mapped angle over the training data."""

    minimum: float = about("of the seesaw (circular systems) or of the wrapped angle in rad (classic systems)")
    maximum: float = about("the same, the largest")

    @property
    def width(self) -> float:
        """Width of the range; 1 where the data do not move, so that scaling stays defined."""
        return self.maximum - self.minimum if self.maximum > self.minimum else 1.0


@dataclass(frozen=True)
class MappedInput:
    """Inputs of antecedents and consequents for one angle, with their slopes.

    Attributes
    ----------
    antecedent, antecedent_slope : array, shape (samples,)
        Input of the membership functions on [0, 1], and its derivative by the angle, 1/rad.
    consequent, consequent_slope : array, shape (samples,)
        Input of the linear consequents, and its derivative by the angle, 1/rad.
    """

    antecedent: Array
    antecedent_slope: Array
    consequent: Array
    consequent_slope: Array


def seesaw(angle: Array) -> tuple[Array, Array]:
    """Evaluate the triangle wave with value 0 at 0, 1 at pi/2, 0 at pi and -1 at 3 pi/2, and its slope, 1/rad.

    The slope is +-2/pi; it jumps at pi/2 and 3 pi/2. Equation (11); method.md section 5.
    """
    near = wrapped(angle)
    folded = np.abs(near) > 0.5 * np.pi
    value = np.where(folded, np.copysign(np.pi, near) - near, near) * (2.0 / np.pi)
    return value, np.where(folded, -2.0 / np.pi, 2.0 / np.pi)


def input_range(angle: Array, circular: bool) -> InputRange:
    """Find the range of an angle over the training data, for the map `data-range`.

    Parameters
    ----------
    angle : array, shape (samples,), rad
    circular : bool
        True for continuous periodic systems (range of the seesaw), False for classic ones (range of the angle).
    """
    value = seesaw(angle)[0] if circular else wrapped(angle)
    return InputRange(float(np.min(value)), float(np.max(value)))


def map_input(angle: Array, input_map: InputMap, circular: bool, data_range: InputRange) -> MappedInput:
    """Map an angle to the inputs of a fuzzy system.

    Parameters
    ----------
    angle : array, shape (samples,), rad
    input_map : {"full-circle", "data-range"}
        `full-circle`: antecedent is the angle modulo 2 pi on [0, 1], truly circular; consequent is the seesaw.
        `data-range`: both are the seesaw scaled over the training data.
    circular : bool
        False for the classic system of [14], which takes the angle itself in place of the seesaw.
    data_range : InputRange
        Used by `data-range` only.

    References
    ----------
    Paper sections 3, 4 and 9; method.md section 5.
    """
    if input_map == "full-circle":
        # A circular system has no seam; a classic one jumps, so its seam lies opposite to hover.
        turns = np.mod(angle, 2.0 * np.pi) / (2.0 * np.pi) if circular else wrapped(angle) / (2.0 * np.pi) + 0.5
        per_turn = np.full(len(angle), 0.5 / np.pi)
        consequent, slope = seesaw(angle) if circular else (turns, per_turn)
        return MappedInput(turns, per_turn, consequent, slope)
    value, slope = seesaw(angle) if circular else (wrapped(angle), np.ones(len(angle)))
    scaled, scaled_slope = (value - data_range.minimum) / data_range.width, slope / data_range.width
    return MappedInput(scaled, scaled_slope, scaled, scaled_slope)


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
    angles: list[Array], mapped: list[MappedInput], consequents: Consequents, harmonic_order: int, products: Products
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
