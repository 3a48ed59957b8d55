"""Numbers and their intervals: the truth lies in a 95 % interval in about 95 % of the flights."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.gap.balance.balance_system import system
from cpfls_cli.gap.balance.refine import fit
from cpfls_cli.gap.naming.estimate import estimates
from cpfls_cli.gap.naming.search import block_index
from cpfls_cli.gap.settings import GapSettings
from tests.builders.gap_flights import VEHICLE, candidate, fly, weak

SETTINGS = GapSettings()
WEIGHT = np.ones(6)
OFFSET, DAMPING = [0.004, -0.003], [0.1, 0.1, 0.05]
TRUTH = [(candidate("com_offset"), OFFSET), (candidate("linear_damping"), DAMPING)]


def estimated(signals, chosen):
    hypothesis = system([weak(each) for each in signals], chosen)
    return estimates(hypothesis, WEIGHT, block_index(hypothesis, SETTINGS))


def noisy(signals, rng, gyro=0.005, rotor=1.0):
    return replace(
        signals,
        body_rate=signals.body_rate + gyro * rng.standard_normal(signals.body_rate.shape),
        rotor_speed=signals.speed + rotor * rng.standard_normal(signals.speed.shape),
    )


def test_intervals_cover_the_truth_about_as_often_as_they_say():
    """Noise of 60 draws on two flights of 24 s; eight numbers each."""
    clean = [fly(seed, TRUTH) for seed in (1, 2)]
    chosen = [found for found, _ in TRUTH]
    rng = np.random.default_rng(0)
    covered = []
    for _ in range(60):
        found = estimated([noisy(each, rng) for each in clean], chosen)
        numbers = [*found.effects[0], *found.effects[1], *found.parameters[:3]]
        truth = [*OFFSET, *DAMPING, 0.0, 0.0, 0.0]
        covered.append([number.low <= true <= number.high for number, true in zip(numbers, truth, strict=True)])
    assert 0.88 < np.mean(covered) < 0.99
    assert (np.mean(covered, axis=0) > 0.8).all()


def test_exact_flights_give_exact_numbers():
    found = estimated([fly(seed, TRUTH) for seed in (1, 2)], [one for one, _ in TRUTH])
    values = [number.value for effect in found.effects for number in effect]
    np.testing.assert_allclose(values, [*OFFSET, *DAMPING], rtol=2e-3)
    assert [number.name for number in found.effects[0]] == ["c_x", "c_y"]
    np.testing.assert_allclose(np.concatenate(found.of_effect), values)
    assert len(found.parameters) == 10
    assert all(abs(number.value) < 2e-3 for number in found.parameters[:6])


def test_longer_flights_narrow_the_intervals_as_the_root_of_their_length():
    rng, widths = np.random.default_rng(3), []
    for seconds in (24.0, 96.0):
        clean = fly(1, TRUTH[:1], seconds=seconds)
        runs = [estimated([noisy(clean, rng)], [TRUTH[0][0]]).effects[0] for _ in range(15)]
        widths.append(np.mean([number.high - number.low for run in runs for number in run]))
    assert widths[0] / widths[1] == pytest.approx(2, rel=0.3)


def test_shapes_and_coefficients_of_unit_stand_in_their_places():
    """A delay between two free effects: the order of numbers and their places in the fit must not shift."""
    chosen = [candidate("com_offset"), candidate("channel_delay", delay_s=0.02), candidate("linear_damping")]
    clean = fly(1, TRUTH)
    early = np.column_stack([np.interp(clean.time + 0.02, clean.time, channel) for channel in clean.speed.T])
    found = estimated([noisy(replace(clean, rotor_speed=early), np.random.default_rng(0))], chosen)
    (offset, delay, damping) = found.effects
    np.testing.assert_allclose([number.value for number in offset], OFFSET, rtol=0.1)
    np.testing.assert_allclose([number.value for number in damping], DAMPING, atol=0.02)
    assert (delay[0].name, delay[0].unit, delay[0].value) == ("delay_s", "s", 0.02)
    assert delay[0].low < 0.02 < delay[0].high
    assert delay[0].high - delay[0].low < 0.01
    assert [len(own) for own in found.of_effect] == [2, 0, 3]


def test_wind_is_told_as_wind_with_an_interval_of_its_own():
    drag = 1.5e-3
    truth = [(candidate("wind"), [drag, 4.0 * drag, -3.0 * drag])]
    found = estimated([noisy(fly(seed, truth), np.random.default_rng(seed)) for seed in (1, 2)], [truth[0][0]])
    k_d, x, y = found.effects[0]
    assert (k_d.name, x.unit) == ("k_d", "m/s")
    assert k_d.value == pytest.approx(drag, rel=0.15)
    assert x.low < 4.0 < x.high
    assert y.low < -3.0 < y.high
    assert x.high - x.low < 4
    np.testing.assert_allclose(x.value, found.of_effect[0][1] / found.of_effect[0][0])


def moments_and_coupling(linear):
    """Moments of inertia that rates show about each axis, and how strongly the two other rates couple into it."""
    stated = np.array(VEHICLE.inertia_kg_m2[:3])
    moments = stated * (1 + linear[:3])
    after, later = [1, 2, 0], [2, 0, 1]
    return moments, moments[later] - moments[after] + linear[3:6] * (stated[after] + stated[later]) / 2


def of_vehicle(values):
    known = [coefficient.name for coefficient in CATALOGUE["parameter_error"].coefficients]
    return (candidate("parameter_error"), [values.get(name, 0.0) for name in known])


def test_what_a_vehicle_can_have_is_found_as_it_is():
    hypothesis = system([weak(fly(seed, [of_vehicle({"inertia_x": 0.3, "coupling_y": -0.2})])) for seed in (1, 2)])
    linear = estimates(hypothesis, WEIGHT, block_index(hypothesis, SETTINGS)).linear
    np.testing.assert_array_equal(linear, fit(hypothesis, WEIGHT))
    np.testing.assert_allclose(linear[[0, 4]], [0.3, -0.2], atol=1e-3)


@pytest.mark.parametrize(("axis", "name"), [*enumerate("xyz")])
def test_no_coupling_is_larger_than_three_moments_of_inertia_allow(axis, name):
    """Two moments differ by no more than the third; what couples more has no name among the vehicle's numbers."""
    flights = [fly(seed, [of_vehicle({f"coupling_{name}": 4.0})]) for seed in (1, 2)]
    hypothesis = system([weak(each) for each in flights])
    free, bounded = fit(hypothesis, WEIGHT), estimated(flights, []).linear
    moments, coupling = moments_and_coupling(free)
    assert coupling[axis] > 2 * moments[axis]
    moments, coupling = moments_and_coupling(bounded)
    assert (moments >= 0.1 * np.array(VEHICLE.inertia_kg_m2[:3])).all()
    assert (np.abs(coupling) <= moments * (1 + 1e-9)).all()
    assert coupling[axis] == pytest.approx(moments[axis])


def test_a_log_with_reversed_yaw_is_told_and_not_built_into_the_model():
    rotors = tuple(replace(rotor, spin=-rotor.spin) for rotor in VEHICLE.rotors)
    reversed_yaw = replace(VEHICLE, rotors=rotors)
    found = estimated([replace(fly(seed), vehicle=reversed_yaw) for seed in (1, 2)], [])
    numbers = {number.name: number for number in found.parameters}
    assert numbers["inertia_z"].impossible
    assert not numbers["inertia_x"].impossible
    assert found.linear[2] == pytest.approx(-0.9)
