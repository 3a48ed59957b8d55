"""Symbols: the function that is written gives what the same formulas give of floats, each part of it once."""

import math

import numpy as np
import pytest

from cpfls_cli.vehicle.stepping import Machine
from cpfls_cli.vehicle.tracing import SYMBOLS, Graph, array_symbols, python_source, traced, traced_in_two
from cpfls_cli.vehicle.values import ARRAYS, Each, Tangent, add, apply, cross, dot, scaled, subtract, transposed, zero

A, B = (0.3, -1.2, 2.5), (1.1, 0.4, -0.7)


def formulas(functions, a, b):
    """Some of all that symbols can do; of scalars, vectors, and one value a rotor."""
    each = functions.rotors([0.3, -0.4, 2.0]) + a[0]
    limited = functions.smallest(functions.largest(each * b[2], -0.5), 0.5)
    rows = (a, b, cross(a, b))
    turned = apply(transposed(rows), subtract(a, scaled(0.5, b)))
    return (
        *add(turned, (0, 0, -9.81)),
        functions.total(limited / (1 + each**2)),
        functions.sqrt(dot(a, a)) ** -0.5 - functions.exp(-functions.absolute(a[1])),
        functions.where(a[0] > b[0], a[0], functions.where(a[1] < 0.0, b[1], b[2])),
        functions.arctan2(a[1], b[0]) + functions.floor(a[2]) - functions.sin(a[0]) * functions.cos(b[0]),
        2.0 / a[2] - (1 - a[0]) * 3,
    )


def written():
    graph = Graph()
    a, b = graph.inputs("a", 3), graph.inputs("b", 3)
    return graph, {"a": a, "b": b}, [formulas(SYMBOLS, a, b)]


def test_what_is_written_gives_what_floats_and_arrays_give():
    (found,) = traced(*written())(A, B)
    np.testing.assert_allclose(found, [float(x) for x in formulas(SYMBOLS, A, B)], rtol=1e-14)
    over_time = formulas(ARRAYS, *(tuple(np.array([x]) for x in vector) for vector in (A, B)))
    np.testing.assert_allclose(found, [float(np.squeeze(x)) for x in over_time], rtol=1e-14)


def test_what_is_computed_twice_is_written_once_and_what_no_result_needs_not_at_all():
    graph = Graph()
    (x,) = graph.inputs("x", 1)
    _ = SYMBOLS.cos(x)
    source = python_source(graph, {"x": (x,)}, [(SYMBOLS.sin(x) + 1, 2 * SYMBOLS.sin(x))])
    assert source.count("sin(") == 1
    assert "cos(" not in source


def test_what_is_known_is_folded_in_and_what_is_nothing_costs_nothing():
    graph = Graph()
    (x,) = graph.inputs("x", 1)
    assert [x * 0, 0.0 * x, 0 / x] == [0, 0, 0]
    assert [one is x for one in (x + 0, 0.0 + x, x * 1.0, x / 1, x - 0)] == [True] * 5
    assert SYMBOLS.sin(0.5) == math.sin(0.5)
    assert cross((x, 0, 0), (x, 0, 0)) == (0, 0, 0)
    assert zero(dot((x, 0, 0), (0, x, 1)))
    assert all(map(zero, Each([x, 0]) * Each([0, x])))


def test_a_step_keeps_values_for_the_next():
    def build(memory, given):
        kept = memory.recall((1.0, 1.0))
        older, newer = kept.values
        kept.keep((newer, older + newer + given[0]))
        return (memory.functions.where(memory.first, -1.0, older),)

    fibonacci = Machine.of(build, 1)
    assert [fibonacci.advance((0.0,))[0] for _ in range(6)] == [-1.0, 1.0, 2.0, 3.0, 5.0, 8.0]


def test_long_expressions_are_written_in_lines_that_python_can_read():
    graph = Graph()
    x = graph.inputs("x", 300)
    (found,) = traced(graph, {"x": x}, [(dot(x, x),)])(tuple(float(n) for n in range(300)))
    assert found[0] == pytest.approx(sum(n * n for n in range(300)))


def of_rotors(functions, k, x, w):
    """Sums over the rotors of what differs from rotor to rotor, and of what is the same for all."""
    lift = functions.rotors([1.0, -2.0, 3.0]) * w + x
    limited = functions.smallest(functions.largest(lift, -1.0), functions.absolute(x) + k)
    angle = functions.arctan2(functions.sin(x), functions.exp(k * x))
    return functions.total(lift**3), functions.total(limited / (2.0 + functions.sqrt(k * k))), angle - functions.cos(x)


def test_derivatives_are_written_as_numbers_with_derivatives_have_them():
    def differentiated(k, x):
        return Tangent(k, {0: 1.0}), Tangent(x, {1: 1.0})

    graph = Graph()
    (k,), (x,), (w,) = graph.inputs("k", 1), graph.inputs("x", 1), graph.inputs("w", 1, by_rotor=True)
    found = of_rotors(array_symbols(3), *differentiated(k, x), w)
    slopes = [tuple(each.by[place] for place in (0, 1) if place in each.by) for each in found]
    written = traced_in_two(graph, ("k", (k,)), {"x": (x,), "w": (w,)}, [*slopes, tuple(each.value for each in found)])

    rng = np.random.default_rng(0)
    x, w = rng.normal(0.0, 1.0, 7), rng.normal(0.0, 1.0, (3, 7))
    *by, values = written((0.4,))((x,), (w,))
    expected = of_rotors(ARRAYS, *differentiated(0.4, x), w)
    for own, value, each in zip(by, values, expected, strict=True):
        np.testing.assert_allclose(value, each.value, rtol=1e-13)
        np.testing.assert_allclose(own, [each.by[place] for place in sorted(each.by)], rtol=1e-13)
    ahead, behind = (of_rotors(ARRAYS, 0.4, x + step, w) for step in (1e-6, -1e-6))
    for own, one, other in zip(by, ahead, behind, strict=True):
        np.testing.assert_allclose(own[-1], (one - other) / 2e-6, rtol=1e-6, atol=1e-7)
