"""Numbers with derivatives: each function against its difference quotient."""

import numpy as np
import pytest

from cpfls_cli.vehicle.values import ARRAYS, NoPolynomialError, Polynomial, Tangent, cross, dot

F = ARRAYS
CASES = {
    "sums and products": lambda x, y: (x + 2.0) * y - x * x + 3.0 * y - (1.0 - x),
    "quotients": lambda x, y: x / y + 2.0 / y + x / 4.0,
    "powers": lambda x, y: x**2 + y**3 + (y + 3.0) ** -0.5,
    "roots": lambda x, y: F.sqrt(x**2 + y**2),
    "functions": lambda x, y: F.exp(0.3 * x) + F.sin(x) * F.cos(y),
    "directions": lambda x, y: F.arctan2(x, y),
    "a direction over an array": lambda x, y: F.arctan2(x, np.array([0.5, -1.0, 2.0])) * y,
    "sizes": lambda x, y: F.absolute(x - y) * y,
    "branches": lambda x, y: F.where(x > 0.6, x * y, F.where(y < 1.0, y, 2.0)),
    "a branch without derivatives": lambda x, y: F.where(x > 0.6, 1.0, x) * y,
    "extremes": lambda x, y: F.largest(x, y) + F.smallest(x * y, 0.5) * x,
    "rotors": lambda x, y: F.total(F.rotors([1.0, -2.0, 0.5]) * x + y) * x + F.total(F.rotors([1.0, 2.0]) * y),
    "vectors": lambda x, y: dot(cross((x, y, 0), (0, y, x)), (1.0, 2.0, x)),
}


@pytest.mark.parametrize("case", CASES)
def test_derivatives_are_difference_quotients(case):
    x, y, step = np.array([0.3, 0.7, -1.2]), np.array([1.4, -0.8, 0.6]), 1e-6
    found = CASES[case](Tangent(x, {0: 1.0}), Tangent(y, {5: 1.0}))
    assert found.value == pytest.approx(CASES[case](x, y))
    for place, way in ((0, (step, 0.0)), (5, (0.0, step))):
        quotient = (CASES[case](x + way[0], y + way[1]) - CASES[case](x - way[0], y - way[1])) / (2 * step)
        assert np.broadcast_to(found.by.get(place, 0.0), 3) == pytest.approx(quotient, rel=1e-6, abs=1e-8)


def test_what_is_linear_has_no_value_and_a_factor_for_each_number():
    unit = {name: Tangent(0, {place: 1.0}) for place, name in enumerate("ab")}
    given = unit["a"] * np.array([1.0, 2.0]) - unit["b"] * 3.0 + unit["a"]
    assert given.value == 0
    assert given.by[0].tolist() == [2.0, 3.0]
    assert given.by[1] == -3.0


def test_a_polynomial_has_a_value_for_each_product_of_its_numbers():
    a, b, array = Polynomial.number("a"), Polynomial.number("b"), np.array([[1.0, 2.0], [3.0, 4.0]])
    given = F.total((a * array - 2.0 * b) * (a + 1.0) - array / 2.0) + Tangent(np.ones(2), {0: 3.0})
    found = {factors: value for factors, value in given.terms.items() if factors}
    assert set(found) == {("a",), ("a", "a"), ("a", "b"), ("b",)}
    assert found["a", "a"].tolist() == found["a",].tolist() == [4.0, 6.0]
    assert given.terms[()].value.tolist() == [-1.0, -2.0]
    branch = F.where(array > 2.0, a * array, b)
    assert branch.terms["a",].tolist() == [[0.0, 0.0], [3.0, 4.0]]
    assert branch.terms["b",].tolist() == [[1.0, 1.0], [0.0, 0.0]]


@pytest.mark.parametrize("case", [lambda a: 1.0 / a, lambda a: a**0.5, lambda a: F.largest(a, 1.0)])
def test_what_is_no_polynomial_is_refused(case):
    with pytest.raises(NoPolynomialError):
        case(Polynomial.number("a"))
