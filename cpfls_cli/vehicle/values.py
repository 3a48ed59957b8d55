"""Numbers that the vehicle is written in: floats, arrays, the symbols of `tracing`; vectors of them, and one a rotor.

Vectors are tuples of components. What is always 0 is a plain 0, takes no part in sums and products, and costs nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

Value = Any
"""A float, an array, a `tracing.Symbol`, or `Each`."""
Vector = tuple[Value, ...]
"""Components along x, y, z, or as many as a state has."""

ZERO: Vector = (0, 0, 0)


class Functions(NamedTuple):
    """Functions of one kind of numbers.

    Attributes
    ----------
    where : callable
        ``where(condition, yes, no)``.
    rotors : callable
        Makes one value for each rotor of an iterable of floats.
    total : callable
        Sums over the rotors.
    """

    sqrt: Callable[[Value], Value]
    exp: Callable[[Value], Value]
    sin: Callable[[Value], Value]
    cos: Callable[[Value], Value]
    arctan2: Callable[[Value, Value], Value]
    floor: Callable[[Value], Value]
    absolute: Callable[[Value], Value]
    where: Callable[[Value, Value, Value], Value]
    largest: Callable[[Value, Value], Value]
    smallest: Callable[[Value, Value], Value]
    rotors: Callable[[Iterable[Value]], Value]
    total: Callable[[Value], Value]


class Linear:
    """What is linear in unknown numbers: the factor of each of them, by its place."""

    __slots__ = ("by",)
    __array_ufunc__ = None

    def __init__(self, by: Mapping[int, Value]) -> None:
        self.by = by

    def each(self, change: Callable[[Value], Value]) -> Linear:
        """Apply what is linear to all of them."""
        return Linear({place: change(value) for place, value in self.by.items()})

    def __add__(self, other: Value) -> Linear:
        if zero(other):
            return self
        return Linear({place: plus(self.by.get(place, 0), other.by.get(place, 0)) for place in {**self.by, **other.by}})

    def __sub__(self, other: Value) -> Linear:
        return self.__add__(-other)

    def __rsub__(self, other: Value) -> Linear:
        return (-self).__add__(other)

    def __mul__(self, other: Value) -> Linear:
        return self.each(lambda value: times(value, other))

    def __truediv__(self, other: Value) -> Linear:
        return self.each(lambda value: value / other)

    def __neg__(self) -> Linear:
        return self.each(lambda value: -value)

    __radd__, __rmul__ = __add__, __mul__


def _array_where(condition: Value, yes: Value, no: Value) -> Value:
    if not (isinstance(yes, Linear) or isinstance(no, Linear)):
        return np.where(condition, yes, no)
    ends = [one if isinstance(one, Linear) else Linear({}) for one in (yes, no)]
    places = {**ends[0].by, **ends[1].by}
    return Linear({at: np.where(condition, *(one.by.get(at, 0.0) for one in ends)) for at in places})


def _array_rotors(values: Iterable[Value]) -> Value:
    return np.array([*values], dtype=float)[:, None]


def _array_total(x: Value) -> Value:
    return x.each(_array_total) if isinstance(x, Linear) else x if zero(x) else x.sum(axis=0)


ARRAYS = Functions(
    *(np.sqrt, np.exp, np.sin, np.cos, np.arctan2, np.floor, np.abs),
    *(_array_where, np.maximum, np.minimum, _array_rotors, _array_total),
)
"""Functions of arrays over time, whose first axis is that of the rotors where there is one value for each of them."""


class Each:
    """One value for each rotor."""

    __slots__ = ("values",)
    __array_ufunc__ = None

    def __init__(self, values: Iterable[Value]) -> None:
        self.values = tuple(values)

    def __iter__(self) -> Iterator[Value]:
        return iter(self.values)

    def by(self, other: Value, operation: Callable[[Value, Value], Value]) -> Each:
        """Apply an operation with one value, or with that of each rotor."""
        others = other.values if isinstance(other, Each) else (other,) * len(self.values)
        return Each(map(operation, self.values, others))

    def __add__(self, other: Value) -> Each:
        return self.by(other, plus)

    def __sub__(self, other: Value) -> Each:
        return self.by(other, minus)

    def __rsub__(self, other: Value) -> Each:
        return self.by(other, lambda a, b: minus(b, a))

    def __mul__(self, other: Value) -> Each:
        return self.by(other, times)

    def __truediv__(self, other: Value) -> Each:
        return self.by(other, lambda a, b: 0 if zero(a) else a / b)

    def __rtruediv__(self, other: Value) -> Each:
        return self.by(other, lambda a, b: 0 if zero(b) else b / a)

    def __neg__(self) -> Each:
        return Each(minus(0, x) for x in self.values)

    def __pow__(self, power: float) -> Each:
        return Each(0 if zero(x) else x**power for x in self.values)

    def __gt__(self, other: Value) -> Each:
        return self.by(other, lambda a, b: a > b)

    def __lt__(self, other: Value) -> Each:
        return self.by(other, lambda a, b: a < b)

    __radd__, __rmul__ = __add__, __mul__


def zero(x: Value) -> bool:
    """Say whether a number is always 0."""
    return isinstance(x, (int, float)) and x == 0


def plus(*terms: Value) -> Value:
    """Add numbers."""
    total: Value = 0
    for term in terms:
        if not zero(term):
            total = term if zero(total) else total + term
    return total


def minus(a: Value, b: Value) -> Value:
    """Subtract the second number."""
    return a if zero(b) else -b if zero(a) else a - b


def times(a: Value, b: Value) -> Value:
    """Multiply two numbers."""
    return 0 if zero(a) or zero(b) else a * b


def add(*vectors: Iterable[Value]) -> Vector:
    """Add vectors."""
    return tuple(plus(*terms) for terms in zip(*vectors, strict=True))


def subtract(a: Iterable[Value], b: Iterable[Value]) -> Vector:
    """Subtract the second vector."""
    return tuple(map(minus, a, b))


def scaled(factor: Value, vector: Iterable[Value]) -> Vector:
    """Multiply a vector with a number."""
    return tuple(times(factor, x) for x in vector)


def dot(a: Iterable[Value], b: Iterable[Value]) -> Value:
    """Multiply two vectors to a number."""
    return plus(*map(times, a, b))


def cross(a: Vector, b: Vector) -> Vector:
    """Multiply two vectors to the one across."""
    (x, y, z), (p, q, r) = a, b
    return (
        minus(times(y, r), times(z, q)),
        minus(times(z, p), times(x, r)),
        minus(times(x, q), times(y, p)),
    )


def apply(rows: Iterable[Vector], vector: Vector) -> Vector:
    """Multiply a matrix, given by rows, with a vector."""
    return tuple(dot(row, vector) for row in rows)


def transposed(rows: Iterable[Vector]) -> tuple[Vector, ...]:
    """Exchange rows and columns."""
    return tuple(zip(*rows, strict=True))
