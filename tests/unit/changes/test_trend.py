"""Change points of rows of numbers that were drawn: where there is none, one, two, and none that counts."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import stdtrit

from cpfls_cli.changes import trend as module
from cpfls_cli.changes.judge import FALSE_ALARM
from cpfls_cli.changes.reference import EACH_TEST, Reference, furthest, number_limits
from cpfls_cli.changes.trend import most_complete, trend
from cpfls_cli.errors import InputError
from tests.builders.drawn_numbers import DEVIATION, NAMES, QUAD, flights, having


def row_of(given):
    return module.Row.of(given, Reference.of(given[: len(given) // 2], NAMES, QUAD), QUAD)


def test_rows_of_an_unchanged_vehicle_seldom_look_changed(monkeypatch):
    """Twenty rows of thirty flights, whose scatter is half to twice the usual one: 0.2 false alarms are expected."""
    # Of so many draws one in a hundred rows is beyond all of them.
    monkeypatch.setattr(module, "_DRAWS", 99)
    rng = np.random.default_rng(1)
    given = [flights(30, rng, scatter=scatter) for scatter in np.repeat([0.5, 1.0, 1.5, 2.0], 5)]
    p = np.array([module.change_points(row_of(each), rng)[0] for each in given])
    # Two and more happen once in sixty times.
    assert (p <= FALSE_ALARM).sum() <= 1
    assert p.max() > 0.5


def test_rows_that_are_drawn_scatter_by_the_freedom_of_each_kind():
    """A lone number is off by a t of few degrees of freedom, loads next to it by one of more: ends of 2 % of each."""
    rng = np.random.default_rng(2)
    names, given = NAMES[:5], flights(8, rng)
    row = module.Row.of(given, Reference.of(given, names, QUAD), QUAD)
    covariance, freedom = row.covariance(row.values)
    drawn = np.array([each[0] for each in row.unchanged(rng, 4000)]) / np.sqrt(np.diag(covariance))
    beyond = np.abs(drawn) > stdtrit(freedom, 0.99)
    assert freedom[0] > 1.3 * freedom[4]
    # Four deviations of a count of 80.
    assert np.abs(beyond.mean(axis=0) - 0.02).max() < 0.009


def test_a_step_is_found_at_its_flight():
    """Of three deviations in one of ten numbers, in the middle of the flights after the reference."""
    step = 3 * DEVIATION * (np.arange(10) == 7)
    found = trend(flights(30, np.random.default_rng(3), step, since=20), QUAD, np.random.default_rng(1))
    assert [shift.flight for shift in found.shifts] == [21]
    assert found.p <= FALSE_ALARM
    assert len(found.reference_flights) == 15


def test_a_rotor_is_named_with_its_size():
    """The others of the vehicle carry what it lacks by its size, so a row of the loads is what one rotor does."""
    weak = 0.25 * (np.arange(10) == 2)
    (shift,) = trend(flights(24, np.random.default_rng(4), weak, since=16), QUAD, np.random.default_rng(1)).shifts
    (cause,) = shift.causes
    assert (shift.flight, cause.name) == (17, "rotor M3")
    assert cause.belief > 0.9
    assert cause.sizes[0].low < 0.25 < cause.sizes[0].high


def test_a_change_that_is_taken_back_is_two():
    rng = np.random.default_rng(5)
    given = flights(30, rng)
    moved = {name: 6 * own for name, own in zip(NAMES, DEVIATION, strict=True) if name.startswith("delay")}
    given[12:20] = [
        having(flight, {name: value + moved.get(name, 0.0) for name, value in flight.values.items()})
        for flight in given[12:20]
    ]
    found = trend(given, QUAD, rng)
    assert [shift.flight for shift in found.shifts] == [13, 21]
    # A reference that holds a change would tell of no limits.
    assert len(found.reference_flights) == 12
    late = [any(name.startswith("delay") for name in flight.beyond) for flight in found.flights]
    assert any(late[12:20])
    assert not any(late[20:])


def test_a_battery_that_is_used_up_is_no_change():
    """Commands of hover that go with a voltage which falls from flight to flight."""
    rng = np.random.default_rng(6)
    volts = np.linspace(1.0, 0.8, 20)
    given = [
        having(
            flight,
            {name: x - np.log(each) * name.startswith("thrust") for name, x in flight.values.items()},
            voltage=each,
        )
        for flight, each in zip(flights(20, rng, scatter=0.5), volts.tolist(), strict=True)
    ]
    assert not trend(given, QUAD, rng).shifts
    assert trend([replace(each, voltage=np.nan) for each in given], QUAD, rng).shifts


def test_numbers_and_flights_that_are_the_most_together():
    given = flights(6, np.random.default_rng(7))
    few = {name: value for name, value in given[0].values.items() if name.startswith("thrust")}
    names, kept = most_complete([having(given[0], few), *given[1:]])
    assert (names, len(kept)) == (NAMES, 5)
    speeds = [replace(flight, commanded=False) for flight in given[:2]]
    assert not [name for name in most_complete([*speeds, *given[2:]])[0] if name.startswith("thrust")]
    with pytest.raises(InputError, match="no number in common"):
        most_complete([having(given[0], {})])


def test_too_few_flights_are_refused():
    given = flights(6, np.random.default_rng(8))
    with pytest.raises(InputError, match="a trend needs 4 at least"):
        trend(given[:3], QUAD, np.random.default_rng(1))
    with pytest.raises(InputError, match="a trend needs 7 at least"):
        trend(given, QUAD, np.random.default_rng(1), 6)


def test_the_reference_that_is_asked_for_is_taken():
    given = flights(8, np.random.default_rng(9))
    assert len(trend(given, QUAD, np.random.default_rng(1), 5).reference_flights) == 5
    assert len(trend(given, QUAD, np.random.default_rng(1)).reference_flights) == 4


def test_a_single_flight_beyond_its_limits_is_no_green_answer():
    """One flight of thirty that is off by itself, in a direction that is no known change, and that ends again."""
    given = flights(30, np.random.default_rng(8))
    moved = {name: 60 * own for name, own in zip(NAMES, DEVIATION, strict=True) if name == "thrust M2"}
    given[22] = having(given[22], {name: x + moved.get(name, 0.0) for name, x in given[22].values.items()})
    found = trend(given, QUAD, np.random.default_rng(1))
    assert found.p <= FALSE_ALARM
    assert found.verdict == "CHANGED"
    assert [row.flight for row in found.flights if row.beyond] == ["flight23"]


def test_a_flight_that_has_a_ratio_reversed_is_a_change():
    given = flights(12, np.random.default_rng(9))
    left = {name: value for name, value in given[9].values.items() if name != "delay yaw"}
    given[9] = having(given[9], left, reversed=("delay yaw",))
    found = trend(given, QUAD, np.random.default_rng(1))
    assert (found.left_out, found.reversed) == (("flight10",), ("flight10: delay yaw reversed, or nothing",))


def test_the_probability_and_the_limit_are_one_rule():
    """A number is beyond its limit just where the probability of any that far is half the rate of false alarms."""
    freedom = np.array([4.0, 4.0, 30.0, 30.0])
    limit = number_limits(freedom, 3)
    assert furthest(limit, freedom, 3) == pytest.approx(EACH_TEST, rel=1e-6)
    assert furthest(0.99 * limit, freedom, 3) > EACH_TEST
