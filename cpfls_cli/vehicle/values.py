"""Numbers that the vehicle is written in: floats, arrays, both with derivatives, the symbols of `tracing`; vectors.

Vectors are tuples of components. What is always 0 is a plain 0, takes no part in sums and products, and costs nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import product
from math import prod
from operator import gt, lt
from typing import Any, NamedTuple

import numpy as np

Value = Any
"""A float, an array, a `Tangent` or a `Polynomial` of them, a `tracing.Symbol`, or `Each`."""
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


class Tangent:
    """A number with its derivatives by some others, each by its place; those that are always 0 are left out."""

    __slots__ = ("by", "value")
    __array_ufunc__ = None

    def __init__(self, value: Value, by: Mapping[int, Value]) -> None:
        self.value, self.by = value, by

    def chained(self, value: Value, slope: Value) -> Tangent:
        """Give what a function of it is, from its value and its slope."""
        return Tangent(value, {place: times(slope, change) for place, change in self.by.items()})

    def _merged(self, value: Value, other: Tangent) -> Tangent:
        by = dict(self.by)
        for place, change in other.by.items():
            by[place] = plus(by[place], change) if place in by else change
        return Tangent(value, by)

    def __add__(self, other: Value) -> Value:
        if isinstance(other, (Each, Polynomial)):
            return NotImplemented
        if isinstance(other, Tangent):
            return self._merged(plus(self.value, other.value), other)
        return self if zero(other) else Tangent(plus(self.value, other), self.by)

    def __sub__(self, other: Value) -> Value:
        return self.__add__(other if zero(other) else -other)

    def __rsub__(self, other: Value) -> Value:
        return (-self).__add__(other)

    def __mul__(self, other: Value) -> Value:
        if isinstance(other, (Each, Polynomial)):
            return NotImplemented
        if not isinstance(other, Tangent):
            return self.chained(times(self.value, other), other)
        if zero(self.value):
            return self.chained(0, other.value)
        given = other.chained(times(self.value, other.value), self.value)
        return given if zero(other.value) else given._merged(given.value, self.chained(0, other.value))

    def __truediv__(self, other: Value) -> Value:
        if isinstance(other, (Each, Tangent, Polynomial)):
            return self * other**-1
        return Tangent(0 if zero(self.value) else self.value / other, {at: d / other for at, d in self.by.items()})

    def __rtruediv__(self, other: Value) -> Value:
        return self**-1 * other

    def __neg__(self) -> Tangent:
        return Tangent(minus(0, self.value), {place: -change for place, change in self.by.items()})

    def __pow__(self, power: float) -> Tangent:
        if power == 2:
            return self.chained(self.value * self.value, 2.0 * self.value)
        # Powers of integers are not defined below 0.
        value = 1.0 * self.value
        return self.chained(value**power, power * value ** (power - 1))

    def __gt__(self, other: Value) -> Value:
        return self.value > value_of(other)

    def __lt__(self, other: Value) -> Value:
        return self.value < value_of(other)

    __radd__, __rmul__ = __add__, __mul__


def value_of(x: Value) -> Value:
    """Give a number without its derivatives."""
    return x.value if isinstance(x, Tangent) else x


def _lifted(function: Callable[[Value], Value], slope: Callable[[Value, Value], Value]) -> Callable[[Value], Value]:
    """Make a function of numbers with derivatives from one without and its slope, from argument and value."""

    def called(x: Value) -> Value:
        if not isinstance(x, Tangent):
            return function(x)
        value = function(x.value)
        return x.chained(value, slope(x.value, value))

    return called


def _extreme(
    choose: Callable[[Value, Value], Value], where: Callable[[Value, Value, Value], Value], *, largest: bool
) -> Callable[[Value, Value], Value]:
    def called(a: Value, b: Value) -> Value:
        if not isinstance(a, (Tangent, Polynomial)) and not isinstance(b, (Tangent, Polynomial)):
            return choose(a, b)
        return where(value_of(a) > value_of(b), *((a, b) if largest else (b, a)))

    return called


def differentiable(base: Functions, spread: Callable[[Value, Value], Value]) -> Functions:
    """Make functions of numbers with derivatives, and of polynomials, from those of numbers without.

    ``spread(value, other)``: the value for each rotor, where it is the same for all and the other one is not.
    """

    def where(condition: Value, yes: Value, no: Value) -> Value:
        if isinstance(yes, Polynomial) or isinstance(no, Polynomial):
            first, second = Polynomial.of(yes).terms, Polynomial.of(no).terms
            return Polynomial({at: where(condition, first.get(at, 0), second.get(at, 0)) for at in {**first, **second}})
        if not (isinstance(yes, Tangent) or isinstance(no, Tangent)):
            return base.where(condition, yes, no)
        ends = [one if isinstance(one, Tangent) else Tangent(one, {}) for one in (yes, no)]
        values = [one.value for one in ends]
        value = 0 if all(map(zero, values)) else base.where(condition, *values)
        places = {**ends[0].by, **ends[1].by}
        return Tangent(value, {at: base.where(condition, *(one.by.get(at, 0.0) for one in ends)) for at in places})

    def arctan2(y: Value, x: Value) -> Value:
        upward, along = value_of(y), value_of(x)
        angle = base.arctan2(upward, along)
        if not (isinstance(y, Tangent) or isinstance(x, Tangent)):
            return angle
        share = 1.0 / base.largest(upward * upward + along * along, _LEAST)
        turned = minus(times(Tangent(0, getattr(y, "by", {})), share * along), times(x - along, share * upward))
        return Tangent(angle, turned.by)

    def total(x: Value) -> Value:
        if isinstance(x, Polynomial):
            shape = np.broadcast_shapes(*(np.shape(value_of(value)) for value in x.terms.values()))
            return x.each(lambda value: total(plus(np.zeros(shape), value)))
        if not isinstance(x, Tangent):
            return x if zero(x) else base.total(x)
        # What is the same for all rotors counts once for each.
        by = {place: base.total(spread(change, x.value)) for place, change in x.by.items()}
        return Tangent(total(x.value), by)

    return Functions(
        sqrt=_lifted(base.sqrt, lambda _, root: 0.5 / base.largest(root, _LEAST)),
        exp=_lifted(base.exp, lambda _, value: value),
        sin=_lifted(base.sin, lambda x, _: base.cos(x)),
        cos=_lifted(base.cos, lambda x, _: -base.sin(x)),
        arctan2=arctan2,
        floor=lambda x: base.floor(value_of(x)),
        absolute=_lifted(base.absolute, lambda x, _: base.where(x > 0.0, 1.0, -1.0)),
        where=where,
        largest=_extreme(base.largest, where, largest=True),
        smallest=_extreme(base.smallest, where, largest=False),
        rotors=base.rotors,
        total=total,
    )


_LEAST = 1e-300
"""Square below which a direction has no slope."""


def _spread(value: Value, other: Value) -> Value:
    return value if zero(other) or np.shape(value) == other.shape else np.broadcast_to(value, other.shape)


ARRAYS = differentiable(
    Functions(
        sqrt=np.sqrt,
        exp=np.exp,
        sin=np.sin,
        cos=np.cos,
        arctan2=np.arctan2,
        floor=np.floor,
        absolute=np.abs,
        where=np.where,
        largest=np.maximum,
        smallest=np.minimum,
        rotors=lambda values: np.array([*values], dtype=float)[:, None],
        total=lambda x: x.sum(axis=0),
    ),
    _spread,
)
"""Functions of arrays over time, whose first axis is that of the rotors where there is one value for each of them, and
of such with derivatives."""


class NoPolynomialError(Exception):
    """Raised where something is no polynomial of numbers that are not known."""


class Polynomial:
    """A sum of products of numbers that are not known, each times a value.

    Attributes
    ----------
    terms : mapping of tuple of str to value
        By the sorted names of the factors.
    """

    __slots__ = ("terms",)
    __array_ufunc__ = None

    def __init__(self, terms: Mapping[tuple[str, ...], Value]) -> None:
        self.terms = terms

    @classmethod
    def of(cls, value: Value) -> Polynomial:
        """Take a value that depends on no such number."""
        return value if isinstance(value, cls) else cls({} if zero(value) else {(): value})

    @classmethod
    def number(cls, name: str) -> Polynomial:
        """Make a number that is not known."""
        return cls({(name,): 1.0})

    def each(self, function: Callable[[Value], Value]) -> Polynomial:
        """Apply a linear function to the values."""
        return Polynomial({factors: function(value) for factors, value in self.terms.items()})

    def __add__(self, other: Value) -> Any:
        if isinstance(other, Each):
            return NotImplemented
        total = dict(self.terms)
        for factors, value in Polynomial.of(other).terms.items():
            total[factors] = plus(total.get(factors, 0), value)
        return Polynomial(total)

    def __mul__(self, other: Value) -> Any:
        if isinstance(other, Each):
            return NotImplemented
        total: dict[tuple[str, ...], Value] = {}
        for (a, x), (b, y) in product(self.terms.items(), Polynomial.of(other).terms.items()):
            if not zero(value := times(x, y)):
                factors = tuple(sorted(a + b))
                total[factors] = plus(total.get(factors, 0), value)
        return Polynomial(total)

    def __neg__(self) -> Polynomial:
        return self.each(lambda value: -value)

    def __sub__(self, other: Value) -> Any:
        return self + minus(0, other)

    def __rsub__(self, other: Value) -> Any:
        return -self + other

    def __truediv__(self, other: Value) -> Any:
        return self * (1 / other)

    def __pow__(self, power: float) -> Any:
        if power not in (1, 2, 3):
            raise NoPolynomialError
        return prod([self] * (int(power) - 1), start=self)

    def _refused(self, _other: Value) -> Any:
        raise NoPolynomialError

    __radd__, __rmul__, __rtruediv__, __lt__, __gt__ = __add__, __mul__, _refused, _refused, _refused


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


def _of_each(operation: Callable[[Value, Value], Value]) -> Callable[[Each, Value], Each]:
    return lambda self, other: self.by(other, operation)


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

    def __neg__(self) -> Each:
        return Each(minus(0, x) for x in self.values)

    def __pow__(self, power: float) -> Each:
        return Each(0 if zero(x) else x**power for x in self.values)

    __add__ = __radd__ = _of_each(plus)
    __sub__, __rsub__ = _of_each(minus), _of_each(lambda a, b: minus(b, a))
    __mul__ = __rmul__ = _of_each(times)
    __truediv__ = _of_each(lambda a, b: 0 if zero(a) else a / b)
    __rtruediv__ = _of_each(lambda a, b: 0 if zero(b) else b / a)
    __gt__, __lt__ = _of_each(gt), _of_each(lt)


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
    return (minus(times(y, r), times(z, q)), minus(times(z, p), times(x, r)), minus(times(x, q), times(y, p)))


def inverse(rows: Sequence[Vector]) -> tuple[Vector, ...]:
    """Invert a symmetric matrix, given by rows."""
    first, second, third = rows
    columns = cross(second, third), cross(third, first), cross(first, second)
    return tuple(scaled(1.0 / dot(first, columns[0]), column) for column in columns)


def apply(rows: Iterable[Vector], vector: Vector) -> Vector:
    """Multiply a matrix, given by rows, with a vector."""
    return tuple(dot(row, vector) for row in rows)


def transposed(rows: Iterable[Vector]) -> tuple[Vector, ...]:
    """Exchange rows and columns."""
    return tuple(zip(*rows, strict=True))
