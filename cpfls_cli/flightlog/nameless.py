"""Columns of a matrix that bear numbers and no names, recognised by how they move together."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.flightlog.agreement import (
    SLOW_HZ,
    first_derivative,
    fit_axes,
    on_clock,
    rotations_of,
    second_derivative,
    slow,
    turning_of,
)
from cpfls_cli.flightlog.names import ColumnGroup, Named
from cpfls_cli.flightlog.settings import SignalName
from cpfls_cli.rounding import less
from cpfls_cli.units import STANDARD_GRAVITY

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

# Attitude, rates, accelerometer and rotors are as many and more; what is narrower is another matrix.
_FEWEST_COLUMNS = 12
_STEPS_S, _EVEN = (2e-4, 0.2), 0.05  # Steps of a clock in s, and the share of them by which they differ on the mean.
_UNIT_LENGTH = 0.02  # By which the length of a quaternion is off 1, in single precision or filtered.
# Share that a derivative has to explain, and the ratio of sizes, where no name speaks for it.
_FOLLOWS, _NEAR = 0.8, 1.3
# Level in rad/s, or more in another unit, of every rotor in flight, and the ratio of their levels.
_SLOWEST_ROTOR, _ROTORS_ALIKE = 50.0, 1.3
_SIZE = 0.1  # Share by which an accelerometer may be off what carries the vehicle.
_RATE_HZ = 100.0  # Rate to which a fast matrix is thinned: every pair of runs is compared.
OF_A_MATRIX: Final = "a matrix without names"


def nameless_clock(columns: Mapping[str, Array]) -> str | None:
    """Find the column of a matrix without names that counts seconds in even steps."""
    for name in _of_matrix(columns):
        values = np.asarray(columns[name], dtype=float)
        steps = np.diff(values[np.isfinite(values)])
        if len(steps) < 2 or steps.min() <= 0:
            continue
        step = float(np.median(steps))
        if _STEPS_S[0] <= step <= _STEPS_S[1] and float(np.abs(steps - step).mean()) < _EVEN * step:
            return name
    return None


def _of_matrix(columns: Mapping[str, Array]) -> list[str]:
    """List the columns of the widest matrix, ``name[0]`` and on, in their order; none where it is narrow."""
    wide: dict[str, list[str]] = {}
    for name in columns:
        if name.endswith("]"):
            wide.setdefault(name.rpartition("[")[0], []).append(name)
    longest = max(wide.values(), key=len, default=[])
    return longest if len(longest) >= _FEWEST_COLUMNS else []


def nameless_signals(columns: Mapping[str, Array], time: Array) -> tuple[Named, ...]:
    """Find attitude, rates, accelerometer, position, velocity and rotors among columns without names.

    An attitude is four neighbours of length 1, and what its derivative explains are the rates; gravity tells the
    accelerometer, a derivative the velocity, in the axes of the world or of the body, and four large and like numbers
    are rotors. Without an attitude nothing is found.

    Parameters
    ----------
    time : array, shape (sample,), s
    """
    names = _of_matrix(columns)
    every = max(1, round(1 / (_RATE_HZ * float(np.median(np.diff(time)))))) if len(time) > 2 else 1
    table = np.column_stack([np.asarray(columns[name], dtype=float)[::every] for name in names]) if names else None
    if table is None or not np.isfinite(table).all():
        return ()
    grid = np.arange(time[0], time[-1], every * float(np.median(np.diff(time))))[: len(table)]
    table = table[: len(grid)]
    return tuple(_Matrix(names, table, time[::every][: len(grid)], grid).signals())


class _Matrix:
    """The table, and which of its columns are taken."""

    def __init__(self, names: Sequence[str], table: Array, time: Array, grid: Array) -> None:
        self.names, self.table, self.grid, self.time = names, table, grid, time
        self.rate_hz = 1 / float(grid[1] - grid[0])
        self.taken: set[int] = set()
        self.carried: tuple[float, ...] = (STANDARD_GRAVITY,)

    def runs(self, length: int) -> Iterator[tuple[int, Array]]:
        """Go through the runs of neighbours of which none is taken."""
        for first in range(self.table.shape[1] - length + 1):
            if not self.taken & set(range(first, first + length)):
                values = self.table[:, first : first + length]
                if float(np.ptp(values, axis=0).min()) > 0:
                    yield first, values

    def take(self, signal: SignalName, first: int, length: int) -> Named:
        """Take neighbours for a signal."""
        self.taken |= set(range(first, first + length))
        columns = tuple(self.names[first : first + length])
        pattern = f"columns {columns[0]} to {columns[-1]}"
        return Named(signal, ColumnGroup(pattern, "numbers", columns), 0.0, known=OF_A_MATRIX)

    def signals(self) -> Iterator[Named]:
        attitude = self._attitude()
        if attitude is None:
            return
        first, rotation, rates = attitude
        yield self.take("quaternion", first, 4)
        yield self.take("body_rate", rates, 3)
        yield from self._places(rotation)
        sensed = self._accelerometer()
        if sensed is not None:
            yield self.take("acceleration", sensed, 3)
        for first, values in self.runs(4):
            middle = np.median(values, axis=0)
            if values.min() >= 0 and middle.min() > _SLOWEST_ROTOR and middle.max() < _ROTORS_ALIKE * middle.min():
                yield self.take("rotor_speed", first, 4)
                return

    def _attitude(self) -> tuple[int, Rotation, int] | None:
        """Find the quaternion whose derivative explains three other columns best."""
        best: tuple[float, int, Rotation, int] | None = None
        for first, values in self.runs(4):
            if float(np.quantile(np.abs(np.linalg.norm(values, axis=1) - 1), 0.95)) > _UNIT_LENGTH:
                continue
            for key in (("xyzw", False), ("wxyz", False), ("xyzw", True), ("wxyz", True)):
                rotation = on_clock(rotations_of(values, *key), self.time, self.grid)
                turning = turning_of(rotation, self.rate_hz)
                if turning is None:
                    continue
                for rates, measured in self.runs(3):
                    fit = fit_axes(turning, slow(measured, self.rate_hz))
                    apart = rates + 3 <= first or rates >= first + 4
                    if apart and less(max(_FOLLOWS, best[0] if best else 0.0), fit.as_named):
                        best = (fit.as_named, first, rotation, rates)
        return None if best is None else best[1:]

    def _places(self, rotation: Rotation) -> Iterator[Named]:
        """Find three columns whose derivative, as it is or turned into the body, three others are."""
        best: tuple[float, int, int] | None = None
        for place, values in self.runs(3):
            derived = first_derivative(values, self.rate_hz)
            turned = rotation.inv().apply(derived)
            for speed, measured in self.runs(3):
                if abs(speed - place) < 3:
                    continue
                own = slow(measured, self.rate_hz, SLOW_HZ)
                for reference in (derived, turned):
                    fit = fit_axes(slow(reference, self.rate_hz, SLOW_HZ), own)
                    near = 1 / _NEAR < fit.gain < _NEAR
                    if near and less(max(_FOLLOWS, best[0] if best else 0.0), fit.as_named):
                        best = (fit.as_named, place, speed)
        if best is not None:
            # The usual size of what carries the vehicle, z of the position upward and downward.
            moving = second_derivative(self.table[:, best[1] : best[1] + 3], self.rate_hz)
            forces = (moving + np.array([0.0, 0.0, up * STANDARD_GRAVITY]) for up in (1.0, -1.0))
            self.carried = tuple(float(np.median(np.linalg.norm(force, axis=1))) for force in forces)
            yield self.take("position", best[1], 3)
            yield self.take("velocity", best[2], 3)

    def _accelerometer(self) -> int | None:
        """Find three columns of the size of what carries the vehicle, nearly all of it in the third."""
        best: tuple[float, int] | None = None
        for first, values in self.runs(3):
            middle = np.median(np.abs(values), axis=0)
            size = float(np.median(np.linalg.norm(values, axis=1)))
            off = min(abs(size / own - 1) for own in self.carried)
            if middle[:2].max() < 0.3 * middle[2] and off < (best[0] if best else _SIZE):
                best = (off, first)
        return None if best is None else best[1]
