"""Throttle that hovers, shape of the thrust curve, battery."""

import numpy as np
import pytest

from cpfls_cli.look.flight import Samples
from cpfls_cli.look.hover import hover_of
from cpfls_cli.units import STANDARD_GRAVITY as GRAVITY
from tests.builders.look_flights import correlated, still_flight

RATE = 20.0
NO_ROTORS = Samples(np.empty(0), np.empty((0, 0)))


def forces(up):
    return -np.outer(up, [0.0, 0.0, 1.0])


def climbing(seed, exponent, by=0.3, gusts=0.02, seconds=60.0):
    """Punches and dips of the collective, and the specific force that they make in gusts."""
    generator = np.random.default_rng(seed)
    samples = round(seconds * RATE)
    collective = 0.4 * np.exp(by * correlated(generator, samples, RATE, 1.0)[:, 0])
    up = GRAVITY * (collective / 0.4) ** exponent * np.exp(gusts * correlated(generator, samples, RATE, 1.0)[:, 0])
    return still_flight(seconds, RATE, collective=collective, specific_force=forces(up))


def test_the_throttle_that_hovers_covers_the_truth():
    inside = 0
    for seed in range(100):
        noise = correlated(np.random.default_rng(seed), 1200, RATE, 1.0)[:, 0]
        hover = hover_of(still_flight(60.0, RATE, collective=0.4 + 0.02 * noise))
        inside += hover.throttle.low <= 0.4 <= hover.throttle.high
    assert 88 <= inside <= 100
    assert (hover.found_by, hover.scatter) == ("specific force", pytest.approx(0.015, abs=0.006))


def test_climbs_and_the_ground_are_no_hover():
    """On the ground with idling motors the accelerometer shows gravity as well."""
    collective = np.full(1200, 0.4)
    up = np.full(1200, GRAVITY)
    collective[:200] = 0.1
    collective[200:400], up[200:400] = 0.6, 1.5 * GRAVITY
    hover = hover_of(still_flight(60.0, RATE, collective=collective, specific_force=forces(up)))
    assert (hover.throttle.value, hover.hover_s) == (pytest.approx(0.4), 40.0)


def test_hover_without_an_accelerometer_is_level_flight_at_one_height():
    climb, tilt = np.zeros(1200), np.zeros((1200, 3))
    collective = np.full(1200, 0.4)
    climb[:300], collective[:300] = 2.0, 0.5
    tilt[300:600, 0], collective[300:600] = 0.5, 0.45
    unknown = np.full((1200, 3), np.nan)
    flight = still_flight(60.0, RATE, climb_rate=climb, attitude=tilt, collective=collective, specific_force=unknown)
    hover = hover_of(flight)
    assert (hover.found_by, hover.throttle.value) == ("climb rate", pytest.approx(0.4))


@pytest.mark.parametrize("exponent", [1.0, 1.5, 2.0])
def test_the_exponent_of_thrust_lies_in_its_interval(exponent):
    shapes = [hover_of(climbing(seed, exponent)).shape for seed in range(40)]
    assert sum(shape.exponent.low <= exponent <= shape.exponent.high for shape in shapes) >= 37
    assert np.mean([shape.exponent.half for shape in shapes]) < 0.2


def test_a_height_controller_hides_no_exponent():
    """It moves the collective against gusts, so that force on collective alone is far from the thrust curve."""
    generator = np.random.default_rng(5)
    blows = 0.1 * correlated(generator, 2400, RATE, 1.0)[:, 0]
    wanted = 0.25 * correlated(generator, 2400, RATE, 1.0)[:, 0]
    collective = 0.4 * np.exp((wanted - 0.8 * blows) / 1.5)
    up = GRAVITY * (collective / 0.4) ** 1.5 * np.exp(blows)
    shape = hover_of(still_flight(120.0, RATE, collective=collective, specific_force=forces(up))).shape
    assert shape.exponent.low < 1.5 < shape.exponent.high
    only_gusts = 0.4 * np.exp(-0.95 * blows / 1.5)
    up = GRAVITY * (only_gusts / 0.4) ** 1.5 * np.exp(blows)
    assert hover_of(still_flight(120.0, RATE, collective=only_gusts, specific_force=forces(up))).shape is None


def test_a_loop_in_acro_is_no_hover_and_a_steady_collective_has_no_shape():
    """Where no attitude is logged, the mean force of a loop may be gravity all the same."""
    turning = np.tile([0.0, 6.0, 0.0], (1200, 1))
    flight = still_flight(60.0, RATE, body_rate=turning, attitude=np.full((1200, 3), np.nan))
    assert hover_of(flight).throttle is None
    assert hover_of(climbing(0, 1.5, by=0.02)).shape is None


def test_the_stated_curve_is_compared_by_its_exponent():
    flight = climbing(0, 1.5)
    assert hover_of(
        still_flight(
            60.0,
            RATE,
            collective=flight.collective,
            specific_force=flight.specific_force,
            autopilot="ardupilot",
            parameters={"MOT_THST_EXPO": 1.0, "MOT_SPIN_MIN": 0.0, "MOT_SPIN_MAX": 1.0, "MOT_THST_HOVER": 0.3},
        )
    ).shape.stated == pytest.approx(2.0, abs=1e-3)


def test_stated_hover_is_compared_as_thrust():
    """Of 0.4 of the range, a square curve makes 0.16 of thrust; what is asked of the mixer is thrust itself."""
    stated = {"MOT_THST_EXPO": 1.0, "MOT_SPIN_MIN": 0.0, "MOT_SPIN_MAX": 1.0, "MOT_THST_HOVER": 0.3}
    hover = hover_of(still_flight(60.0, RATE, autopilot="ardupilot", parameters=stated))
    assert (hover.stated.parameter, hover.stated.measured.value) == ("MOT_THST_HOVER", pytest.approx(0.16))
    assert hover.stated.differs
    # Thin air and force within 5 % of gravity: no finding.
    for value, differs in ((0.14, False), (0.12, True), (0.165, False)):
        known = stated | {"MOT_THST_HOVER": value}
        assert hover_of(still_flight(60.0, RATE, autopilot="ardupilot", parameters=known)).stated.differs == differs
    # What it adds for a battery is in the commands, and not in its throttle.
    added = stated | {"MOT_BAT_VOLT_MAX": 16.8}
    assert hover_of(still_flight(60.0, RATE, autopilot="ardupilot", parameters=added)).stated is None
    asked = still_flight(60.0, RATE, autopilot="ardupilot", parameters=stated, rotors=NO_ROTORS)
    assert hover_of(asked).stated.measured.value == pytest.approx(0.4)


def battery(seed=0, resistance=0.05, varied=5.0, seconds=120.0, noise=0.03):
    generator = np.random.default_rng(seed)
    samples = round(seconds * RATE)
    current = 20 + varied * correlated(generator, samples, RATE, 2.0)[:, 0]
    time = np.arange(samples) / RATE
    open_circuit = 16.5 - 0.8 * time / seconds - 0.2 * (time / seconds) ** 3
    voltage = open_circuit - resistance * current + noise * correlated(generator, samples, RATE, 2.0)[:, 0]
    return still_flight(seconds, RATE, voltage=voltage, current=current)


def test_resistance_and_open_circuit_voltage_cover_the_truth_where_the_current_varies():
    found = [hover_of(battery(seed)).battery for seed in range(60)]
    assert sum(each.slope.low <= 0.05 <= each.slope.high for each in found) >= 54
    assert sum(each.open_circuit_begin.low <= 16.5 <= each.open_circuit_begin.high for each in found) >= 54
    assert sum(each.open_circuit_end.low <= 15.5 <= each.open_circuit_end.high for each in found) >= 54
    assert found[0].used_mah == pytest.approx(20 * 120 / 3.6, rel=0.1)
    assert found[0].sag_hover.value == pytest.approx(0.05 * 20, rel=0.15)
    assert found[0].sag_full is None
    assert hover_of(battery(varied=0.3)).battery.slope is None


def test_without_current_voltage_is_compared_with_the_collective():
    generator = np.random.default_rng(1)
    collective = 0.4 + 0.08 * correlated(generator, 1200, RATE, 2.0)[:, 0]
    voltage = 16 - 2.0 * collective + 0.01 * generator.normal(size=1200)
    battery = hover_of(still_flight(60.0, RATE, collective=collective, voltage=voltage)).battery
    assert (battery.against, battery.slope.value) == ("collective", pytest.approx(2.0, abs=0.05))
    assert battery.open_circuit_begin is None
    assert np.isnan(battery.used_mah)
