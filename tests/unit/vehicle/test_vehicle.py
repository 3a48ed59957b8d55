"""Equations of the vehicle: values, traces, rotors, motion and settings."""

import math
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError

from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.errors import ComputationError, SettingError
from cpfls_cli.vehicle.motion import Acting, Instant, Vehicle
from cpfls_cli.vehicle.rotors import allocation_matrix, body_wrench, rotor_demand, violations
from cpfls_cli.vehicle.settings import RotorSettings, VehicleSettings
from cpfls_cli.vehicle.stepping import Machine
from cpfls_cli.vehicle.tracing import SYMBOLS, Graph, array_symbols, python_source, traced, traced_in_two
from cpfls_cli.vehicle.values import (
    ARRAYS,
    Each,
    NoPolynomialError,
    Polynomial,
    Tangent,
    add,
    apply,
    cross,
    dot,
    scaled,
    subtract,
    transposed,
    zero,
)
from tests.builders.vehicles import alike

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
A, B = (0.3, -1.2, 2.5), (1.1, 0.4, -0.7)
THRUST, DRAG, ARM = 121.5e-6, 2.7e-6, 0.3
REACTION = CATALOGUE["rotor_acceleration"]


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
    assert (given.value, given.by[0].tolist(), given.by[1]) == (0, [2.0, 3.0], -3.0)


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


@pytest.mark.parametrize(
    "case", [lambda a: 1 / a, lambda a: a > 0, lambda a: a**0.5, lambda a: a / a, lambda a: F.largest(a, 1.0)]
)
def test_what_is_no_polynomial_is_refused(case):
    with pytest.raises(NoPolynomialError):
        case(Polynomial.number("a"))


def formulas(functions, a, b):
    """Some of all that symbols can do; of scalars, vectors, and one value a rotor."""
    each = functions.rotors([0.3, -0.4, 2.0]) + a[0]
    limited = functions.smallest(functions.largest(each * b[2], -0.5), 0.5)
    return (
        *add(apply(transposed((a, b, cross(a, b))), subtract(a, scaled(0.5, b))), (0, 0, -9.81)),
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
    (x,) = Graph().inputs("x", 1)
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
    limited = limited * x / (2.0 + functions.sqrt(k * k))
    return functions.total(lift**3), functions.total(limited), angle - functions.cos(x)


@pytest.mark.parametrize("short", [False, True])
def test_derivatives_are_written_as_numbers_with_derivatives_have_them(short):
    def differentiated(k, x):
        return Tangent(k, {0: 1.0}), Tangent(x, {1: 1.0})

    graph = Graph()
    (k,), (x,), (w,) = graph.inputs("k", 1), graph.inputs("x", 1), graph.inputs("w", 1, rotors=3)
    found = of_rotors(array_symbols(3), *differentiated(k, x), w)
    slopes = [tuple(each.by[place] for place in (0, 1) if place in each.by) for each in found]
    results = [*slopes, tuple(each.value for each in found)]
    written = traced_in_two(graph, ("k", (k,)), {"x": (x,), "w": (w,)}, results, short=short)

    rng = np.random.default_rng(0)
    x, w = rng.normal(0.0, 1.0, 7), rng.normal(0.0, 1.0, (3, 7))
    function = written((0.4,))
    *by, values = function((x,), (w,))
    # What was given is not written into by what is computed later, also of other sizes.
    function((x + 1.0,), (w - 1.0,))
    function((x[:3],), (w[:, :3],))
    for own, value, each in zip(by, values, of_rotors(ARRAYS, *differentiated(0.4, x), w), strict=True):
        np.testing.assert_allclose(value, each.value, rtol=1e-13)
        np.testing.assert_allclose(own, [each.by[place] for place in sorted(each.by)], rtol=1e-13)
    ahead, behind = (of_rotors(ARRAYS, 0.4, x + step, w) for step in (1e-6, -1e-6))
    for own, one, other in zip(by, ahead, behind, strict=True):
        np.testing.assert_allclose(own[-1], (one - other) / 2e-6, rtol=1e-6, atol=1e-7)


def ring(count, spins):
    angles = 2 * np.pi * np.arange(count) / count
    return VehicleSettings(rotors=alike(zip(np.cos(angles), np.sin(angles), spins, strict=True)))


def test_plus_layout_follows_the_hand_formulas():
    speed = np.random.default_rng(3).uniform(100, 900, (20, 4))
    w1, w2, w3, w4 = speed.T
    thrust, torque = body_wrench(VehicleSettings(), speed)
    np.testing.assert_allclose(thrust, THRUST * (w1**2 + w2**2 + w3**2 + w4**2))
    np.testing.assert_allclose(torque[:, 0], ARM * THRUST * (w4**2 - w2**2))
    np.testing.assert_allclose(torque[:, 1], ARM * THRUST * (w3**2 - w1**2))
    np.testing.assert_allclose(torque[:, 2], DRAG * (-(w1**2) + w2**2 - w3**2 + w4**2))


def test_cross_layout_follows_the_simulator_rotorpy():
    d, k, b = 0.1202081528, 5.57e-6, 1.36e-7
    rotors = alike([(1, 1, -1), (1, -1, 1), (-1, -1, -1), (-1, 1, 1)], k, b, d)
    expected = [[k, k, k, k], [k * d, -k * d, -k * d, k * d], [-k * d, -k * d, k * d, k * d], [b, -b, b, -b]]
    np.testing.assert_allclose(allocation_matrix(VehicleSettings(rotors=rotors)), expected)


def test_demand_of_four_rotors_is_the_speed_that_was_flown():
    speed = np.random.default_rng(4).uniform(100, 900, (50, 4))
    wrench = body_wrench(VehicleSettings(), speed)
    demand = rotor_demand(VehicleSettings(), wrench.thrust, wrench.body_torque)
    np.testing.assert_allclose(demand.speed, speed, rtol=1e-12)
    assert violations(demand.squared_speed, 1000.0, np.arange(50.0)) == ()


def test_demand_of_six_rotors_gives_the_wrench_with_the_smallest_norm():
    vehicle = ring(6, [1, -1, 1, -1, 1, -1])
    speed = np.random.default_rng(5).uniform(400, 500, (50, 6))
    wrench = body_wrench(vehicle, speed)
    demand = rotor_demand(vehicle, wrench.thrust, wrench.body_torque)
    again = body_wrench(vehicle, demand.speed)
    np.testing.assert_allclose(again.thrust, wrench.thrust, rtol=1e-12)
    np.testing.assert_allclose(again.body_torque, wrench.body_torque, atol=1e-11)
    least = np.linalg.lstsq(allocation_matrix(vehicle), np.column_stack(wrench).T, rcond=None)[0].T
    np.testing.assert_allclose(demand.squared_speed, least, rtol=1e-9)
    assert (np.linalg.norm(demand.squared_speed, axis=1) < np.linalg.norm(speed**2, axis=1)).all()


def test_what_rotors_cannot_do_is_reported_and_not_clipped():
    hover = 6 * 9.81
    torque = np.zeros((5, 3))
    torque[1, 0] = 2 * hover * ARM
    torque[3, 0] = 3 * hover * ARM
    demand = rotor_demand(VehicleSettings(rotor_speed_max_rad_s=500.0), np.full(5, hover), torque)
    squared_2, squared_4 = demand.squared_speed[3, [1, 3]]
    assert squared_2 == pytest.approx(hover / THRUST * (1 / 4 - 3 / 2))
    assert squared_4 == pytest.approx(hover / THRUST * (1 / 4 + 3 / 2))
    found = violations(demand.squared_speed, 500.0, np.arange(5.0))
    kinds = [(v.rotor, v.kind, v.first_s, v.last_s, v.samples) for v in found]
    assert kinds == [(2, "negative squared speed", 1.0, 3.0, 2), (4, "above the limit", 1.0, 3.0, 2)]
    assert [v.worst for v in found] == [squared_2, squared_4]
    np.testing.assert_array_equal(np.isnan(demand.speed), [[False, n, False, n] for n in (0, 1, 0, 1, 0)])


def test_standing_still_and_the_limit_itself_are_no_violations():
    limit = body_wrench(VehicleSettings(), np.array([[0.0] * 4, [1000.0] * 4]))
    demand = rotor_demand(VehicleSettings(), limit.thrust, limit.body_torque)
    assert violations(demand.squared_speed, 1000.0, np.arange(2.0)) == ()
    np.testing.assert_allclose(demand.speed, [[0.0] * 4, [1000.0] * 4])


@pytest.mark.parametrize(
    ("hubs", "missing"),
    [
        ([(1, 0, 1), (-1, 0, 1), (2, 0, -1), (-2, 0, -1)], "roll"),
        ([(0, 1, 1), (0, -1, 1), (0, 2, -1), (0, -2, -1)], "pitch"),
        ([(1, 0, 1), (0, 1, 1), (-1, 0, 1), (0, -1, 1)], "thrust, yaw"),
        ([(1, 1, 1), (-1, -1, -1)], "roll, pitch, yaw"),
    ],
)
def test_layouts_that_cannot_produce_a_wrench_are_refused(hubs, missing):
    rotors = tuple(RotorSettings(position_m=(float(x), float(y), 0.0), spin=spin) for x, y, spin in hubs)
    with pytest.raises(ComputationError, match=f"cannot produce {missing} independently"):
        rotor_demand(VehicleSettings(rotors=rotors), np.ones(1), np.zeros((1, 3)))


def test_a_wrench_that_is_not_finite_and_a_wrong_number_of_rotors_are_refused():
    with pytest.raises(ComputationError, match="not finite at sample 1"):
        rotor_demand(VehicleSettings(), np.ones(2), np.array([[0.0] * 3, [0.0, np.nan, 0.0]]))
    with pytest.raises(ComputationError, match=r"rotor_speed: expected shape \(time, 4\), got \(1, 6\)"):
        body_wrench(VehicleSettings(), np.zeros((1, 6)))


@pytest.mark.parametrize(
    "spins", sorted(product((-1, 1), repeat=4)), ids=lambda spins: "".join("-.+"[s + 1] for s in spins)
)
def test_the_reaction_to_rotors_that_speed_up_needs_no_order_of_spins(spins):
    stated = VehicleSettings()
    rotors = tuple(replace(rotor, spin=spin) for rotor, spin in zip(stated.rotors, spins, strict=True))
    vehicle = Vehicle(replace(stated, rotors=rotors), (Acting("reaction", REACTION.acts, {"J_r": 2e-5}),))
    speeding = np.array([[10.0], [-30.0], [70.0], [150.0]])
    seen = Instant(vehicle.settings, np.full((4, 1), 500.0), rotor_acceleration=speeding, functions=ARRAYS)
    torque, _ = vehicle.wrench(seen)
    assert torque[2] == pytest.approx(-2e-5 * (np.array(spins)[:, None] * speeding).sum(axis=0))


@pytest.mark.parametrize(
    ("inertia", "message"),
    [
        ((0.6, 0.0, 1.2), "greater than 0"),
        ((0.6, 0.6, -1.2), "greater than 0"),
        ((1.0, 1.0, 1.0, 0.0, 0.0, 2.0), r"not positive definite \(smallest principal moment -1\)"),
        ((1.0, 1.0, 1.0, 1.0, 0.0, 0.0), "not positive definite"),
        ((float("nan"), 1.0, 1.0), "greater than 0"),
        ((1.0, 1.0, 1.0, 0.1), "3 moments"),
    ],
)
def test_inertia_that_no_body_has_is_refused(inertia, message):
    with pytest.raises(SettingError, match=message) as refusal:
        VehicleSettings(inertia_kg_m2=inertia)
    assert refusal.value.key == "inertia_kg_m2"


def test_the_radius_of_a_propeller_is_positive_or_not_known():
    read = TypeAdapter(RotorSettings).validate_json
    assert [read(text).radius_m for text in ("{}", '{"radius_m": null}', '{"radius_m": 0.2}')] == [None, None, 0.2]
    with pytest.raises(ValidationError):
        read('{"radius_m": 0.0}')
