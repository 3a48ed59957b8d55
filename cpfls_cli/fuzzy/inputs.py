"""Maps from an angle to the inputs of antecedents and consequents: seesaw, full circle, data range."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.result import about
from cpfls_cli.rotations import wrapped

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
