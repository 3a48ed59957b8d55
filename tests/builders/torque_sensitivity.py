"""Derivatives of the model torque by inner breakpoints in NumPy, which the compiled loops are held against."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.fuzzy.inputs import MappedInput
from cpfls_cli.fuzzy.membership import Memberships, join_ends, z_function
from cpfls_cli.regressor.regressor import Breakpoints, Regressor


def torque_sensitivity(regressor: Regressor, partitions: Breakpoints, coefficients: Array) -> list[Array]:
    """Differentiate the model torque by every inner breakpoint, in closed form.

    Parameters
    ----------
    coefficients : array, shape (parameters,)

    Returns
    -------
    list of array, shape (samples, 3, functions - 2)
        One per partition.
    """
    structure = regressor.structure
    sensitivity = [np.zeros((len(regressor.motion), 3, max(p.functions - 2, 0))) for p in structure.partitions]
    for index, block in enumerate(structure.blocks):
        for input_index, partition in enumerate(block.partitions):
            if structure.partitions[partition].functions > 2:
                sensitivity[partition] = _block_sensitivity(regressor, partitions, coefficients, index, input_index)
    return sensitivity


def _block_sensitivity(
    regressor: Regressor, partitions: Breakpoints, coefficients: Array, index: int, input_index: int
) -> Array:
    """Differentiate one inertia function's torque by the breakpoints along one of its inputs."""
    block = regressor.structure.blocks[index]
    value, gradient = _function_sensitivity(regressor, partitions, coefficients, index, input_index)
    carried = regressor.carriers[index]
    torque: Array = carried.acceleration[:, :, None] * value[:, None, :]
    for angle, by_angle in zip(block.function.inputs, gradient, strict=True):
        along = by_angle * regressor.motion.rate[:, angle, None]
        torque += carried.rate[:, :, None] * along[:, None, :]
        torque[:, angle, :] -= carried.energy[:, None] * by_angle
    return torque


def _function_sensitivity(
    regressor: Regressor, partitions: Breakpoints, coefficients: Array, index: int, input_index: int
) -> tuple[Array, list[Array]]:
    """Differentiate f(q) and its gradient by breakpoints; the consequents do not depend on them."""
    block = regressor.structure.blocks[index]
    consequent = regressor.features[index]
    assert consequent is not None
    antecedents = regressor.antecedents(index, partitions)
    rules = [a.value.shape[1] for a in antecedents]
    per_rule = coefficients[block.columns].reshape(block.rules, block.features).T
    moved = antecedent_sensitivity(
        regressor.mapped[block.function.inputs[input_index]],
        partitions[block.partitions[input_index]],
        regressor.structure.circular,
    )
    outputs = _along(consequent.value @ per_rule, rules, input_index)
    value = _contract(outputs, moved.value, antecedents, input_index, slope=False)
    gradient = []
    for direction, slopes in enumerate(consequent.gradient):
        by_consequent = _contract(
            _along(slopes @ per_rule, rules, input_index), moved.value, antecedents, input_index, slope=False
        )
        gradient.append(by_consequent + _by_antecedent(outputs, moved, antecedents, input_index, direction))
    return value, gradient


def antecedent_sensitivity(mapped: MappedInput, breakpoints: Array, circular: bool) -> Memberships:
    """Differentiate the firing of rules and its slope by the inner breakpoints, shape (samples, rules, breakpoints).

    With ``u = (x - b1) / w``, ``w = b2 - b1``: ``du/db1 = (u - 1) / w`` and ``du/db2 = -u / w``.
    """
    scaled, functions, rows = mapped.antecedent, len(breakpoints), np.arange(len(mapped.antecedent))
    inside, clipped = (scaled >= 0.0) & (scaled <= 1.0), np.clip(scaled, 0.0, 1.0)
    interval = np.clip(np.searchsorted(breakpoints, clipped, side="right") - 1, 0, functions - 2)
    width = np.diff(breakpoints)[interval]
    empty = width <= 0.0
    width = np.where(empty, 1.0, width)
    position = np.where(empty, 1.0, (clipped - breakpoints[interval]) / width)
    _, first, second = (np.where(inside, part, 0.0) for part in z_function(position))
    value, slope = np.zeros((2, len(scaled), functions, functions))
    for end, towards in ((0, position - 1.0), (1, -position)):
        by_value = first * towards / width
        by_slope = (second * towards + (1 - 2 * end) * first) / width**2
        for side, sign in ((0, 1.0), (1, -1.0)):
            value[rows, interval + side, interval + end] = sign * by_value
            slope[rows, interval + side, interval + end] = sign * by_slope
    value, slope = value[:, :, 1:-1], slope[:, :, 1:-1] * mapped.antecedent_slope[:, None, None]
    return Memberships(join_ends(value), join_ends(slope)) if circular else Memberships(value, slope)


def _by_antecedent(
    outputs: Array, moved: Memberships, antecedents: list[Memberships], input_index: int, direction: int
) -> Array:
    if direction == input_index:
        return _contract(outputs, moved.slope, antecedents, input_index, slope=False)
    return _contract(outputs, moved.value, antecedents, input_index, slope=True)


def _along(rule_outputs: Array, rules: list[int], input_index: int) -> Array:
    """Arrange rule outputs as (samples, rules along the moved input, rules along the other)."""
    if len(rules) == 1:
        return rule_outputs[:, :, None]
    grid = rule_outputs.reshape(-1, *rules)
    return grid if input_index == 0 else grid.swapaxes(1, 2)


def _contract(outputs: Array, moved: Array, antecedents: list[Memberships], input_index: int, *, slope: bool) -> Array:
    """Sum rule outputs over both inputs' rules; the other input fires by its value or by its slope."""
    if len(antecedents) == 1:
        return np.asarray(np.einsum("nl,nlb->nb", outputs[:, :, 0], moved))
    other = antecedents[1 - input_index]
    fired = np.einsum("nlm,nm->nl", outputs, other.slope if slope else other.value)
    return np.asarray(np.einsum("nl,nlb->nb", fired, moved))
